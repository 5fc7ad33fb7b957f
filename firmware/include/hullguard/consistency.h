/** @file
 *  Does what a sensor says fit what all others say? A test of each sensor of a fusion filter (fusion.h) by the updates the filter makes anyway, and the
 *  sensors it blames. Statistical: its false alarms have a rate, not a bound.
 *
 *  A bias b of sensor i that began in sample theta moves the estimate by b f and the residual r'_l of sensor l by b rho_l, in the filter's own arithmetic:
 *
 *      f = 0 at theta;  every sample  f <- A f;  every update of sensor l  rho = [l = i] - C_l f,  f <- f + K_l rho
 *      d = sum rho r' / s,   c = sum rho^2 / s,   score(i, theta) = 2 b d - b^2 c,   b = d / c, but |b| at least `least` of sensor i
 *
 *  the generalised likelihood ratio of a bias of that size or more (twice its logarithm). Events need no correction of their own: a silence enters as what it is to
 *  the filter, a residual with spread s = C g + R', and since R' is such that the filter's covariance is right, d has the variance c without a fault
 *  whether the sensor spoke or not. A plain sum of r'^2 / s has no direction: with two sensors of one quantity it blames the one that is believed less,
 *  because the filter follows the other.
 *
 *  Scores are kept for `onsets` hypotheses of theta, `stride` samples apart; the oldest begins anew. A sensor is blamed when its largest score is above
 *  `limit` and the largest of all in `confirm` samples in a row: what tells a biased sensor from its neighbours is how it began. A sensor is blamed too when `repeats` values in a row are equal to the bit: it is frozen, since
 *  noise does not repeat. A dead one is the watchdog's (hg_fusion_alive()).
 *
 *  It judges; hg_fusion_exclude() takes a sensor out, in all nodes in the same sample: every node runs this too, or one node tells the others.
 *  After an exclusion all hypotheses begin anew, `rest` samples later: the estimate has yet to forget what the sensor did to it, or the next one that
 *  contradicts it would be blamed for being right. A sensor that is out is not judged. Not reentrant per instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_CONSISTENCY_H
#define HULLGUARD_CONSISTENCY_H

#include "hullguard/fusion.h"

#ifdef __cplusplus
extern "C" {
#endif

#if HG_REAL_F32 || HG_REAL_F64

typedef struct {            /* flash */
    uint8_t onsets;         /* hypotheses a sensor, 1 .. 255 */
    uint8_t stride;         /* samples between two, >= 1 */
    const hg_real *least;   /* [sensors] >= 0: smallest bias that is looked for, measurement units; 2.5 standard deviations where 3 must be found */
    hg_real limit;          /* > 0 */
    uint8_t confirm;        /* samples, >= 1 */
    uint8_t repeats;        /* equal values in a row, >= 2 */
    uint8_t rest;           /* samples after a start or a reset in which nothing is judged */
} hg_consistency_config;

typedef struct {            /* RAM: one a hypothesis */
    hg_real d;              /* the sums above, since the hypothesis began */
    hg_real c;              /* without a fault the variance of d */
} hg_consistency_sum;

typedef struct {            /* RAM: one a sensor */
    hg_real score;          /* largest of its hypotheses as of the last step */
    hg_real y;              /* last value */
    uint8_t equal;          /* values in a row that are equal to it, itself included, saturated */
} hg_consistency_sensor;

typedef struct {
    hg_consistency_sum    *sum;    /* [onsets m] */
    hg_consistency_sensor *sensor; /* [m] */
    hg_real               *real;   /* [HG_CONSISTENCY_REALS(n, m, onsets)] */
} hg_consistency_memory;

/** Numbers in hg_consistency_memory. */
#define HG_CONSISTENCY_REALS(states, sensors, onsets) ((uint32_t)(states) * (((uint32_t)(sensors) * (uint32_t)(onsets)) + 1U))

typedef struct {            /* RAM */
    const hg_consistency_config *config;
    const hg_fusion             *fusion;
    hg_consistency_sum          *sum;
    hg_consistency_sensor       *sensor;
    hg_real                     *f;      /* [onsets][m][n] */
    hg_real                     *next;   /* [n] scratch */
    uint8_t                      onset;  /* the hypotheses that began last */
    uint8_t                      since;  /* samples ago */
    uint8_t                      leader; /* sensor that stands out */
    uint8_t                      leads;  /* samples in a row, saturated; 0: none does */
    uint8_t                      rests;  /* samples in which nothing is judged yet */
    uint16_t                     blamed; /* bit i: sensor i, until hg_consistency_reset() */
} hg_consistency;

/** Begin with no hypothesis older than the next sample.
 *  @param[in] fusion  started
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    a number out of range */
hg_status hg_consistency_start(hg_consistency *self, const hg_consistency_config *config, const hg_fusion *fusion, const hg_consistency_memory *memory);

/** Forget all hypotheses and whom was blamed: after an exclusion, a return, or a reset of the filter. Values in a row are counted on. */
void hg_consistency_reset(hg_consistency *self);

/** One sample, after hg_fusion_close(): judge the records of the last settled sample.
 *  Result: bit i: sensor i is blamed, since the last reset.
 *  Cost: onsets m (n^2 + m (n + 4)) multiplications, dense rows m n more; onsets m divisions. */
uint16_t hg_consistency_step(hg_consistency *self);

#endif
#ifdef __cplusplus
}
#endif

#endif
