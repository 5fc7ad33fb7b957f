/** @file
 *  The threshold: the exact interval hull of what a residual can be without a fault (methods, platoon, section 6). For a linear generator
 *  it is a sum of absolute impulse responses over the radii of its signals,
 *
 *      J_i(k) = bias_i(k) + sum over lags j < taps of |h_i(j)| radius(k - j) + tail_i(k)
 *
 *  bias: initial state (two tables: started at rest, or in a moving plant), disturbances and all rounding; offline, its last row holds for good.
 *  tail: what lies behind the taps, from above:  theta(k) = decay theta(k-1) + sum_g tail_input_g radius_g(k - taps), tail_i = tail_output_i theta;
 *  it heals as fast as the generator forgets and never keeps a maximum. All tables are rounded so that J is never below the exact hull.
 *  One ring of past radii serves all hulls of a detector; rewriting the past there is all that a late-discovered loss needs,
 *  because J is linear in the radii. Not reentrant per instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_HULL_H
#define HULLGUARD_HULL_H

#include "hullguard/real.h"
#include "hullguard/ring.h"
#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

typedef struct {                 /* flash: one a generator, generated */
    uint8_t        residuals;    /* 1 .. 255 */
    uint8_t        width;        /* signals read, 1 .. 255 */
    const uint8_t *signal;       /* [width] their places in the ring's rows */
    uint8_t        taps;         /* 1 .. ring length - 1 */
    const hg_real *weight;       /* [taps][residuals][width] >= 0, lag 0 first */
    uint16_t       settle;       /* rows of the bias tables, >= 1 */
    const hg_real *rest;         /* [settle][residuals] bias after a start within the initial range */
    const hg_real *moving;       /* [settle][residuals] bias after a start anywhere in the state range */
    uint16_t       ready_rest;   /* samples until the initial state is a small part of J, after a start at rest */
    uint16_t       ready_moving; /* the same after a start in a moving plant */
    hg_real        decay;        /* 0 .. < 1 */
    const hg_real *tail_input;   /* [width] >= 0 */
    const hg_real *tail_output;  /* [residuals] >= 0 */
} hg_hull_config;

/* How the plant may move when a detector starts. The careful choice is the one that zeroed memory holds. */
typedef enum {
    HG_START_MOVING = 0, /* anywhere in its operating range: power-up, watchdog reset, after long silence */
    HG_START_REST   = 1  /* within the model's initial range */
} hg_start;

typedef struct {                 /* RAM: one a generator */
    const hg_hull_config *config;
    hg_real               theta;
    uint16_t              k;     /* samples since the start, saturated */
    hg_start              how;
} hg_hull;

/** Are sizes and tables within the ranges above, for a ring of this width and length? Cost: width comparisons. */
bool hg_hull_valid(const hg_hull_config *config, uint8_t ring_width, uint8_t ring_length);

/** Begin at the sample after this call.
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    hg_hull_valid() says no */
hg_status hg_hull_start(hg_hull *self, const hg_hull_config *config, const hg_ring *ring, hg_start how);

/** Begin again. */
void hg_hull_reset(hg_hull *self, hg_start how);

/** Threshold of this sample, whose radii are the newest row of the ring.
 *  @param[out] J  [residuals] > 0
 *  Cost: taps x residuals x width multiplications. */
void hg_hull_step(hg_hull *self, const hg_ring *ring, hg_real *J);

/** Has the initial state become a small part of J? */
bool hg_hull_ready(const hg_hull *self);

#endif
