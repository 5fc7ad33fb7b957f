/** @file
 *  What an uncertain plant may do beyond its nominal model. Parameter intervals make x(k+1) = A x + B u + w with |w_i| <= |dA_i| |x| + |dB_i| |u|,
 *  and that is a derived signal for each such state: its value is 0 and its radius
 *
 *      radius_i(k) = constant_i + sum_g gain_ig (|value_g(k)| + radius_g(k))
 *
 *  constant: what unmeasured states contribute at most, within their reach. Thresholds take these radii like all others. All tables are rounded up
 *  by more than the sum can lose. No state; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_MISMATCH_H
#define HULLGUARD_MISMATCH_H

#include "hullguard/real.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {              /* flash: one a model, generated */
    uint8_t        states;    /* derived signals, 0 .. 255 */
    uint8_t        width;     /* signals read, 0 .. 255 */
    int8_t         exponent;  /* gain is the numbers below times 2^exponent; 0 for the float types */
    const uint8_t *signal;    /* [width] their places in the signal vector */
    const hg_real *constant;  /* [states] >= 0 */
    const hg_real *gain;      /* [states][width] >= 0 */
} hg_mismatch_config;

/** Are the tables there, and the places below `signals`? Cost: width comparisons. */
bool hg_mismatch_valid(const hg_mismatch_config *config, uint8_t signals);

/** Radii at one sample.
 *  @param[in]  value, radius  the signal vector
 *  @param[out] out            [states] finite: HG_REAL_MAX where a sum is not, so that one bad number spoils no other signal's past
 *  Cost: states x width multiplications. */
void hg_mismatch_step(const hg_mismatch_config *config, const hg_real *value, const hg_real *radius, hg_real *out);

/** A past sample's radii turn out larger.
 *  @param[in]     increase  by how much, the signal vector, >= 0
 *  @param[in,out] out       [states] the derived radii of that sample; finite as above
 *  Cost: states x width multiplications. */
void hg_mismatch_grow(const hg_mismatch_config *config, const hg_real *increase, hg_real *out);

#ifdef __cplusplus
}
#endif

#endif
