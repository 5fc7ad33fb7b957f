/** @file
 *  guard.h: memory that nobody may change. */
#include "proof.h"

#include "hullguard/guard.h"

/** Sealed memory is good as long as it is as it was, and any number of wrong bits within 31 in a row is found.
 *  Any memory of any length up to BYTES, the wrong bits anywhere in it.
 *  @proves hg_guard_seal hg_guard_check hg_guard_sum
 *  @run check real=f32 unwind=15 limit=60 BYTES=13U */
void proof_guard(void)
{
    uint8_t memory[BYTES];
    hg_guard self;
    const uint8_t bytes = any_u8_in(0U, BYTES);
    uint8_t *const at = TAIL(memory, bytes);
    prove((hg_guard_seal(NULL, at, bytes) == HG_E_ARGUMENT) && (hg_guard_check(NULL, at, bytes) == HG_E_ARGUMENT), "null pointers");
    prove((hg_guard_seal(&self, NULL, bytes) == HG_E_ARGUMENT) && (hg_guard_check(&self, NULL, bytes) == HG_E_ARGUMENT), "null pointers");
    const hg_status sealed = hg_guard_seal(&self, at, bytes);
    prove(sealed == ((bytes > 0U) ? HG_OK : HG_E_ARGUMENT), "not without memory");
    if (sealed == HG_OK) {
        prove((hg_guard_check(&self, at, bytes) == HG_OK) && (hg_guard_sum(at, bytes) == self.sum), "as it was");
        const uint64_t wrong = ((uint64_t)(any_u32() >> 1U) | 1U) << any_u8_in(0U, 7U); /* 31 bits, the first of them in the first byte */
        const uint8_t from = any_u8_in(0U, (uint8_t)(bytes - 1U));
        for (uint8_t i = 0U; (i < 5U) && ((from + i) < bytes); i++) {
            at[from + i] ^= (uint8_t)((wrong >> (8U * i)) & 0xFFU);
        }
        prove(hg_guard_check(&self, at, bytes) == HG_E_DIGEST, "wrong bits");
        reach("a burst");
    } else {
        prove(hg_guard_check(&self, at, bytes) == HG_E_ARGUMENT, "no memory");
    }
}

/** A wrong bit of the seal is found.
 *  @proves hg_guard_check
 *  @run check real=f32 unwind=15 limit=60 BYTES=13U */
void proof_guard_seal(void)
{
    uint8_t memory[BYTES];
    hg_guard self;
    const uint8_t bytes = any_u8_in(1U, BYTES);
    (void)hg_guard_seal(&self, TAIL(memory, bytes), bytes);
    self.sum ^= 1UL << any_u8_in(0U, 31U);
    prove(hg_guard_check(&self, TAIL(memory, bytes), bytes) == HG_E_DIGEST, "another seal");
    reach("the end");
}
