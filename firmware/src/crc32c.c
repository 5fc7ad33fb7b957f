#include "hullguard/crc32c.h"

#include <string.h>

#define NIBBLE_BITS 4U
#define NIBBLE_MASK 0x0FU
#define BYTE_BITS 8U
#define BYTE_MASK 0xFFU

uint32_t hg_crc32c(uint32_t crc, uint32_t number, uint8_t bytes)
{
    /* [16] remainder of each nibble, reflected */
    static const uint32_t remainder[] = {
        0x00000000UL, 0x105EC76FUL, 0x20BD8EDEUL, 0x30E349B1UL, 0x417B1DBCUL, 0x5125DAD3UL, 0x61C69362UL, 0x7198540DUL,
        0x82F63B78UL, 0x92A8FC17UL, 0xA24BB5A6UL, 0xB21572C9UL, 0xC38D26C4UL, 0xD3D3E1ABUL, 0xE330A81AUL, 0xF36E6F75UL,
    };
    uint32_t left = ~crc;
    uint32_t rest = number;
    for (uint8_t i = 0U; i < bytes; i++) {
        left ^= rest & BYTE_MASK;
        left = (left >> NIBBLE_BITS) ^ remainder[left & NIBBLE_MASK];
        left = (left >> NIBBLE_BITS) ^ remainder[left & NIBBLE_MASK];
        rest >>= BYTE_BITS;
    }
    return ~left;
}

uint32_t hg_real_word(hg_real x, uint8_t word)
{
#if HG_REAL_F64
    uint64_t bits;
    /* deviation: misra-c2012-21.15: copying the bytes is the defined way from a number to its bits */
    /* cppcheck-suppress misra-c2012-21.15 */
    (void)memcpy(&bits, &x, sizeof(bits));
    return (word == 0U) ? (uint32_t)(bits & UINT32_MAX) : (uint32_t)(bits >> 32U);
#else
    uint32_t bits;
    (void)word; /* there is one */
    /* deviation: misra-c2012-21.15: as above */
    /* cppcheck-suppress misra-c2012-21.15 */
    (void)memcpy(&bits, &x, sizeof(bits));
    return bits;
#endif
}

uint32_t hg_crc32c_real(uint32_t crc, hg_real x)
{
    uint32_t now = crc;
    for (uint8_t word = 0U; word < HG_REAL_WORDS; word++) {
        now = hg_crc32c(now, hg_real_word(x, word), 4U);
    }
    return now;
}
