/** @file
 *  crc32c.h: the checksum against its definition, bit by bit. */
#include "contract.h"

#include "hullguard/crc32c.h"

#include <string.h>

/* The remainder of the reflected polynomial 0x1EDC6F41, one bit at a time. */
static uint32_t by_bits(uint32_t crc, uint8_t byte)
{
    uint32_t left = ~crc ^ byte;
    for (uint8_t i = 0U; i < 8U; i++) {
        left = (left >> 1U) ^ (((left & 1U) != 0U) ? 0x82F63B78UL : 0UL);
    }
    return ~left;
}

/** The checksum by nibbles is that of the definition: of one byte whatever came before, and several bytes are one after another, so that it is of any number of bytes; of "123456789" it is
 *  0xE3069283.
 *  Any checksum to go on from, any number, 0 .. 4 bytes of it.
 *  @proves hg_crc32c
 *  @without conversion: a remainder is meant to be cut
 *  @run check real=f32 unwind=10 limit=90 */
void proof_crc32c(void)
{
    const uint32_t crc = any_u32();
    const uint32_t number = any_u32();
    const uint8_t bytes = any_u8();
    assume(requires_crc32c(bytes));
    prove(hg_crc32c(crc, number, 1U) == by_bits(crc, (uint8_t)(number & 0xFFU)), "the definition");
    uint32_t chained = crc;
    for (uint8_t i = 0U; i < bytes; i++) {
        chained = hg_crc32c(chained, number >> (8U * i), 1U);
    }
    prove(hg_crc32c(crc, number, bytes) == chained, "byte after byte");
    uint32_t sum = 0U;
    for (uint8_t i = 0U; i < 9U; i++) {
        sum = hg_crc32c(sum, (uint32_t)'1' + i, 1U);
    }
    prove(sum == 0xE3069283UL, "the check value");
    reach("end");
}

/** A number's words are its bits, the lowest first, NaN and infinity too: put together again they are the number; and a checksum takes all of them.
 *  Any number, any checksum to go on from.
 *  @proves hg_real_word hg_crc32c_real
 *  @run check real=f32 unwind=9 limit=90
 *  @run check real=f64 unwind=9 limit=90
 *  @run check real=q31 unwind=9 limit=90 */
void proof_real_word(void)
{
    hg_real x;
    hg_real again;
    uint32_t word[HG_REAL_WORDS];
    const uint32_t crc = any_u32();
    uint32_t sum = crc;
    for (uint8_t i = 0U; i < HG_REAL_WORDS; i++) {
        word[i] = hg_real_word(x, i);
        sum = hg_crc32c(sum, word[i], 4U);
    }
    (void)memcpy(&again, word, sizeof(again));
    prove(memcmp(&again, &x, sizeof(x)) == 0, "the same bits");
    prove(hg_crc32c_real(crc, x) == sum, "all of them");
    reach("end");
}
