/** @file
 *  CRC-32C (Castagnoli: polynomial 0x1EDC6F41, bits reflected, start and final XOR 0xFFFFFFFF; "123456789" gives 0xE3069283). Of what it is taken
 *  over it shows for certain, in the order in which the bits are taken, every single wrong bit, every odd number of them, every burst of up to 32
 *  bits, any 3 bits in less than 2^31 and any 5 in 5 243 (Koopman, 32-bit CRCs for Internet applications, DSN 2002); of anything else all but
 *  one in 2^32. Pure, safe in interrupt context. */
#ifndef HULLGUARD_CRC32C_H
#define HULLGUARD_CRC32C_H

#include "hullguard/real.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Go on with more bytes.
 *  @param[in] crc     of the bytes before; 0 to begin
 *  @param[in] number  its lowest bytes are taken, the lowest first, whatever the processor's order is
 *  @param[in] bytes   how many, 0 .. 4
 *  Cost: two table look-ups a byte. */
uint32_t hg_crc32c(uint32_t crc, uint32_t number, uint8_t bytes);

/** Words of 32 bits that a number has. */
#if HG_REAL_F64
#define HG_REAL_WORDS 2U
#else
#define HG_REAL_WORDS 1U
#endif

/** A number's bits. @param[in] word  0 .. HG_REAL_WORDS - 1, the lowest bits first */
uint32_t hg_real_word(hg_real x, uint8_t word);

/** Go on with a number, word after word. */
uint32_t hg_crc32c_real(uint32_t crc, hg_real x);

#ifdef __cplusplus
}
#endif

#endif
