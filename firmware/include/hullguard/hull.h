/** @file
 *  The threshold: the exact interval hull of what a residual can be without a fault (methods, platoon, section 6). For a linear generator
 *  it is a sum of absolute impulse responses over the radii of its signals,
 *
 *      J_i(k) = bias_i(k) + sum over signals g, lags j < taps_g of |h_ig(j)| radius_g(k - j) + theta_i(k)
 *      theta_i(k) = decay_i theta_i(k-1) + sum over g of tail_gi radius_g(k - taps_g)
 *
 *  bias: disturbances, all rounding, and the initial state (started at rest, or in a moving plant); a table, then what holds for good.
 *  theta: what lies behind the taps, from above: tail_gi decay_i^j >= |h_ig(taps_g + j)| for all j, and from sample `settle` on likewise what is
 *  left of the initial state (rest_left decay^(j + 1) at sample settle + j). A signal that is nearly always known exactly needs few taps. theta
 *  heals as fast as the generator forgets and never keeps a maximum. All tables are rounded so that J is never below the exact hull.
 *  One decay for all that is behind the taps is too wide where fast and slow modes stand side by side (an unknown-input observer has its fixed
 *  poles); such a generator has a theta for each mode besides, in modal coordinates G = S Lam S^-1 of the generator's system (G, L; M, D):
 *
 *      theta_m(k) = |lam_m| theta_m(k-1) + sum_g |S^-1 L|_mg radius_g(k - taps_g)      added to J_i: sum_m |M S|_im |lam_m|^(taps-1) theta_m
 *
 *  (a complex pair is one mode, its output counted twice; taps of all signals are the same then), with tails of 0. A slow mode's theta may also begin with what the initial state puts
 *  into it, in place of thousands of bias rows. The bound of a step's rounding belongs into decay and input; in fixed point, where a theta has a
 *  unit of its own and loses at most one of its steps a sample, into bias: sum_m |M S|_im |lam_m|^(taps-1) step_m / (1 - |lam_m|).
 *  One ring of past radii serves all hulls of a detector; rewriting the past there is all that a late-discovered loss needs,
 *  because J is linear in the radii. Not reentrant per instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_HULL_H
#define HULLGUARD_HULL_H

#include "hullguard/real.h"
#include "hullguard/ring.h"
#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {                 /* flash: one a generator, generated */
    uint8_t        residuals;    /* 1 .. 255 */
    uint8_t        width;        /* signals read, 1 .. 255 */
    int8_t         exponent;     /* weight is the numbers below times 2^exponent; 0 for the float types */
    const uint8_t *signal;       /* [width] their places in the ring's rows */
    const uint8_t *taps;         /* [width] 0 .. ring length - 1 */
    const hg_real *weight;       /* >= 0: residuals 0 and 1, then 2 and 3, .., of each two (the last may be alone) signal after signal [taps + 1][2 or 1]:
                                    |h_ig(j)| by lag, then tail_gi */
    uint16_t       settle;       /* rows of the bias tables, 1 .. UINT16_MAX - 1 */
    const hg_real *rest;         /* [settle][residuals] bias after a start within the initial range, then */
    const hg_real *rest_left;    /* [residuals] what theta(settle - 1) is given */
    const hg_real *moving;       /* [settle][residuals] bias after a start anywhere in the state range, then */
    const hg_real *moving_left;  /* [residuals] what theta(settle - 1) is given */
    const hg_real *bias;         /* [residuals] bias from sample settle on */
    uint16_t       ready_rest;   /* samples until the initial state is a small part of J, after a start at rest */
    uint16_t       ready_moving; /* the same after a start in a moving plant */
    const hg_real *decay;        /* [residuals] 0 .. < 1 */
    uint8_t        modes;        /* with a theta of their own, 0 .. 255 */
    const hg_real *mode_decay;   /* [modes] 0 .. < 1 */
    const hg_real *mode_input;   /* [modes][width] >= 0, times 2^exponent */
    const hg_real *mode_output;  /* [residuals][modes] >= 0, times 2^exponent */
    const hg_real *mode_rest;    /* [modes] theta before the first sample after a start at rest, >= 0 */
    const hg_real *mode_moving;  /* [modes] the same after a start in a moving plant, >= 0 */
} hg_hull_config;

/* How the plant may move when a detector starts. The careful choice is the one that zeroed memory holds. */
typedef enum {
    HG_START_MOVING = 0, /* anywhere in its operating range: power-up, watchdog reset, after long silence */
    HG_START_REST   = 1  /* within the model's initial range */
} hg_start;

typedef struct {                 /* RAM: one a generator */
    const hg_hull_config *config;
    hg_real              *theta; /* [residuals] */
    hg_real              *mode;  /* [modes] their thetas */
    uint16_t              k;     /* samples since the start, saturated */
    hg_start              how;
} hg_hull;

/** Memory of one hull, numbers. */
#define HG_HULL_REALS(residuals, modes) ((uint32_t)(residuals) + (uint32_t)(modes))

/** Are sizes and tables within the ranges above, for a ring of this width and length? Cost: width + residuals + modes comparisons. */
bool hg_hull_valid(const hg_hull_config *config, uint8_t ring_width, uint8_t ring_length);

/** Begin at the sample after this call.
 *  @param[in] memory  [HG_HULL_REALS(residuals, modes)], owned by the caller
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    hg_hull_valid() says no */
hg_status hg_hull_start(hg_hull *self, const hg_hull_config *config, const hg_ring *ring, hg_start how, hg_real *memory);

/** Begin again. */
void hg_hull_reset(hg_hull *self, hg_start how);

/** Threshold of this sample, whose radii are the newest row of the ring.
 *  @param[out] J  [residuals] > 0; HG_REAL_MAX where it is larger
 *  Cost: residuals x (sum of taps + width + 1) + modes x (width + residuals) multiplications. */
void hg_hull_step(hg_hull *self, const hg_ring *ring, hg_real *J);

/** Has the initial state become a small part of J? */
static inline bool hg_hull_ready(const hg_hull *self)
{
    return self->k >= ((self->how == HG_START_REST) ? self->config->ready_rest : self->config->ready_moving);
}

#ifdef __cplusplus
}
#endif

#endif
