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

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {  /* RAM: one a piece of memory */
    uint32_t sum; /* 0x9E3779B9 XOR the number of bytes; then, for each word of four, lowest byte first, and the rest, filled up with zeros, which may be none:
                   * rotate right by 1, XOR the word */
} hg_guard;

/** The sum of memory. Rotation and XOR can both be undone: two memories that differ at one place have different sums.
 *  @param[in] memory  [bytes], any alignment
 *  Cost: one instruction a byte on a Cortex-M4, three where words must be aligned. */
static inline uint32_t hg_guard_sum(const uint8_t *memory, uint32_t bytes)
{
    uint32_t sum = (uint32_t)0x9E3779B9UL ^ bytes; /* another length has another sum, and a seal that was never made fits no memory of zeros */
    uint32_t at = 0U;
    for (; (bytes - at) >= 4U; at += 4U) {
        const uint32_t word = (uint32_t)memory[at] | ((uint32_t)memory[at + 1U] << 8U) | ((uint32_t)memory[at + 2U] << 16U) | ((uint32_t)memory[at + 3U] << 24U);
        /* To the right: to the left, bit 31 of a word and bit 0 of the next, neighbours in memory, would cancel. */
        sum = ((sum >> 1U) | (sum << 31U)) ^ word;
    }
    uint32_t rest = 0U;
    for (uint32_t i = bytes; i > at; i--) {
        rest = (rest << 8U) | memory[i - 1U];
    }
    return ((sum >> 1U) | (sum << 31U)) ^ rest;
}

/** Remember the memory as it is now.
 *  @param[in] memory  [bytes], any alignment
 *  @retval HG_OK          sealed
 *  @retval HG_E_ARGUMENT  a null pointer, or no bytes */
static inline hg_status hg_guard_seal(hg_guard *self, const uint8_t *memory, uint32_t bytes)
{
    const bool there = (self != NULL) && (memory != NULL) && (bytes > 0U);
    if (there) {
        self->sum = hg_guard_sum(memory, bytes);
    }
    return there ? HG_OK : HG_E_ARGUMENT;
}

/** Is the memory as it was? Changes nothing.
 *  @retval HG_OK          as it was sealed
 *  @retval HG_E_DIGEST    it is not, or was never sealed: start whatever it holds anew
 *  @retval HG_E_ARGUMENT  a null pointer, or no bytes */
static inline hg_status hg_guard_check(const hg_guard *self, const uint8_t *memory, uint32_t bytes)
{
    hg_status status = HG_E_ARGUMENT;
    if ((self != NULL) && (memory != NULL) && (bytes > 0U)) {
        status = (hg_guard_sum(memory, bytes) == self->sum) ? HG_OK : HG_E_DIGEST;
    }
    return status;
}

#ifdef __cplusplus
}
#endif

#endif
