/** @file
 *  A polynomial filter (polynomial.h) as a judge of a detector: it takes its outputs from the holds as (value, radius), and its three statistics stand as
 *  residuals beside their thresholds, so that one decision hears them and all others:
 *
 *      r = (||y - its prediction||, J2, root of the drift)      J = (kappa sqrt(tr S11) + ||radius||, root of joint, root of drift)
 *
 *  Inputs that the detector knows move the plant by x+ = f(x) + B u + w, y = h(x) + D u + v: D u is taken off the measurement, and B u moves the point of
 *  expansion; no moment of the error feels either. An input that is not known (its closing frame was lost) leaves a sample that nothing stands for: the
 *  filter begins again. Where radii that it has used turn out to have been too small it goes on: the decision takes back what alarm they made, and the
 *  estimate forgets them.
 *  Its alarms hold with a probability (HG_BASIS_STATISTICAL). Float only: HG_WITH_POLYNOMIAL is 0 in fixed point. Not reentrant per instance; safe in
 *  interrupt context; no allocation. */
#ifndef HULLGUARD_STATISTIC_H
#define HULLGUARD_STATISTIC_H

#include "hullguard/polynomial.h"
#include "hullguard/real.h"
#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define HG_STATISTICS 3U /* plain, joint, drift */

typedef struct {                 /* flash: generated */
    hg_polynomial_config filter; /* its measurements are gain times the signals */
    const uint8_t *signal;       /* [outputs] places in the signal vector */
    const hg_real *gain;         /* [outputs] > 0: filter units a signal unit */
    uint8_t        inputs;       /* known ones, 0 .. 255; the five below are not read without one */
    const uint8_t *input;        /* [inputs] places in the signal vector */
    const hg_real *zero;         /* [inputs] value at which an input does nothing */
    const hg_real *drive;        /* states x inputs: B, filter units a signal unit */
    const hg_real *direct;       /* outputs x inputs: D, filter units a signal unit */
    const hg_real *known;        /* [inputs] >= 0: radius up to which an input is known, signal units */
    uint8_t        settle;       /* samples after a beginning in which no alarm counts */
} hg_statistic_config;

typedef struct {                 /* RAM: one a filter */
    const hg_statistic_config *config;
    hg_polynomial  filter;
    hg_real       *y;            /* [outputs] */
    hg_real       *radius;       /* [outputs], filter units */
    uint8_t        samples;      /* since it began, saturated */
} hg_statistic;

/** Numbers of RAM. Cost: a few products. */
uint32_t hg_statistic_reals(const hg_statistic_config *config);

/** Are the tables within the ranges above, and do they name only the first `signals` places? Cost: as hg_polynomial_valid(). */
bool hg_statistic_valid(const hg_statistic_config *config, uint8_t signals);

/** Begin.
 *  @param[in] memory  [hg_statistic_reals()], owned by the caller
 *  @retval HG_OK          ready for hg_statistic_step()
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    hg_polynomial_valid() says no */
hg_status hg_statistic_start(hg_statistic *self, const hg_statistic_config *config, hg_real *memory);

/** Begin again, with what was known before the first sample. */
void hg_statistic_reset(hg_statistic *self);

/** One sample.
 *  @param[in]  value   [signals] signal units
 *  @param[in]  radius  [signals] signal units
 *  @param[out] r       [HG_STATISTICS] >= 0
 *  @param[out] J       [HG_STATISTICS] > 0
 *  @retval HG_OK         r and J are of this sample; after a beginning that the sample caused r is 0
 *  @retval HG_E_NUMERIC  hg_polynomial_step() refused it: the filter has begun again, r is 0
 *  Cost: that of hg_polynomial_step(). */
hg_status hg_statistic_step(hg_statistic *self, const hg_real *value, const hg_real *radius, hg_real *r, hg_real *J);

/** Do its alarms count: have `settle` samples passed since it began? */
bool hg_statistic_ready(const hg_statistic *self);

#ifdef __cplusplus
}
#endif

#endif
