/** @file
 *  A checksum over memory that nobody may change now. A node's memory changes inside its functions only: what it has when one returns, it must have when
 *  the next one is called. Sealed for that time, a bit that changes (radiation, a supply that dips, another task's stray pointer) is found before anything uses it, in
 *  values and radii, observers, counters and pointers alike:
 *
 *      hg_platoon_node_start(&memory, HG_START_REST);
 *      for (;;) {
 *          hg_guard_seal(&guard, (const uint8_t *)&memory, sizeof(memory));
 *          wait for a frame or the deadline
 *          if (hg_guard_check(&guard, (const uint8_t *)&memory, sizeof(memory)) != HG_OK) {
 *              hg_platoon_node_start(&memory, HG_START_MOVING);
 *          }
 *          hg_node_receive(), hg_node_overdue(), hg_node_step(), ..
 *      }
 *
 *  Without it a node bears most single faults by itself (firmware/README.md has the numbers); it cannot know a wrong pointer, nor a radius that is too large.
 *  What is found for certain: any one wrong bit, in the memory or in the seal, and any number of them within 31 bits in a row; of two bits in different words 31 of
 *  32 pairs; of anything without order all but one in 2^32. Nothing is found that happens while a function of the node runs.
 *  Not reentrant per instance; safe in interrupt context. */
#ifndef HULLGUARD_GUARD_H
#define HULLGUARD_GUARD_H

#include "hullguard/status.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {  /* RAM: one a piece of memory */
    uint32_t sum; /* 0x9E3779B9 XOR the number of bytes; then, for each word of four, lowest byte first, and the rest, filled up with zeros, which may be none:
                   * rotate right by 1, XOR the word */
} hg_guard;

/** Remember the memory as it is now.
 *  @param[in] memory  [bytes], any alignment
 *  @retval HG_OK          sealed
 *  @retval HG_E_ARGUMENT  a null pointer, or no bytes
 *  Cost: one instruction a byte on a Cortex-M4, three where words must be aligned. */
hg_status hg_guard_seal(hg_guard *self, const uint8_t *memory, uint32_t bytes);

/** Is the memory as it was? Changes nothing.
 *  @retval HG_OK          as it was sealed
 *  @retval HG_E_DIGEST    it is not, or was never sealed: start whatever it holds anew
 *  @retval HG_E_ARGUMENT  a null pointer, or no bytes
 *  Cost: as hg_guard_seal(). */
hg_status hg_guard_check(const hg_guard *self, const uint8_t *memory, uint32_t bytes);

#ifdef __cplusplus
}
#endif

#endif
