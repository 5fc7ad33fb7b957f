/** @file
 *  The recent past of a signal vector: the radii that thresholds add up, and the values that FIR residuals read. One row a sample, the newest
 *  overwriting the oldest. Rewriting a past row is all that a late-discovered loss needs, because thresholds are linear in the radii.
 *  Not reentrant per instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_RING_H
#define HULLGUARD_RING_H

#include "hullguard/real.h"
#include "hullguard/status.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {        /* RAM */
    hg_real *data;      /* [length][width] */
    uint8_t  width;     /* signals, 1 .. 255 */
    uint8_t  length;    /* samples kept, the newest included, 1 .. 255 */
    uint8_t  newest;    /* row of the newest sample */
} hg_ring;

/** Memory of a ring, numbers. */
#define HG_RING_REALS(width, length) ((uint32_t)(width) * (uint32_t)(length))

/** Begin with all numbers 0: the past before the first sample is the initial state's business.
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer, or width or length 0 */
hg_status hg_ring_start(hg_ring *self, uint8_t width, uint8_t length, hg_real *memory);

/** Forget all: every number 0. */
void hg_ring_reset(hg_ring *self);

/** Begin a new sample. Result: [width], where the oldest was; to be filled with finite numbers before the ring is read. Constant time. */
hg_real *hg_ring_open(hg_ring *self);

/** Enter a new sample.
 *  @param[in] row  [width]
 *  @retval HG_OK         entered
 *  @retval HG_E_NUMERIC  a number is not finite; nothing changed */
hg_status hg_ring_push(hg_ring *self, const hg_real *row);

/** Overwrite a part of a past sample.
 *  @param[in] lag    samples before the newest, 0 .. length - 1; more is ignored: nothing here remembers it
 *  @param[in] first  first signal  @param[in] count  signals from there
 *  @param[in] part   [count] finite */
void hg_ring_rewrite(hg_ring *self, uint8_t lag, uint8_t first, uint8_t count, const hg_real *part);

/** The sample `lag` before the newest. @param[in] lag  0 .. length - 1  Result: [width]. Constant time. */
hg_real *hg_ring_row(const hg_ring *self, uint8_t lag);

#ifdef __cplusplus
}
#endif

#endif
