/** @file
 *  A bank of certificates: FIR residuals over a window of held values, each with its exact threshold (methods, platoon, section 7).
 *  A certificate is a parity vector w over the window, found offline as the proof that a faulty window has no fault-free explanation:
 *
 *      r_c(k) = sum over lags j < window of w_c(j) value(k - j)
 *      J_c(k) = bias_c + widen sum |w_c(j)| radius(k - j) + sum of extra_c(j) radius(k - j)
 *
 *  bias: disturbances, what rounding leaves of the plant's motion in w, and the rounding of r; widen: the rounding of J. The extra sum runs over
 *  derived signals that have a radius and no value, such as what an uncertain plant may do (mismatch.h). A bank is one hypothesis: an
 *  alarm of any of its certificates is the bank's. It has no state but the rings of values and radii, so that a late-discovered
 *  loss needs nothing here but the rewritten radii. Not reentrant per instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_BANK_H
#define HULLGUARD_BANK_H

#include "hullguard/real.h"
#include "hullguard/ring.h"
#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {                   /* flash: one a bank, generated */
    uint8_t        certificates;   /* 1 .. 255 */
    uint8_t        window;         /* samples, 1 .. 255 */
    uint8_t        width;          /* signals read, 1 .. 255 */
    const uint8_t *signal;         /* [width] their places in the rings' rows */
    int8_t         exponent;       /* weight and extra_weight are the numbers below times 2^exponent; 0 for the float types */
    const hg_real *weight;         /* [window][width][certificates], lag 0 first */
    uint8_t        extras;         /* radii that are added besides, 0 .. 255 */
    const uint8_t *extra;          /* [extras] their places in the rows of the ring of radii */
    const hg_real *extra_weight;   /* [window][extras][certificates] >= 0 */
    const hg_real *bias;           /* [certificates] > 0 */
    hg_real        widen;          /* >= 1 */
} hg_bank_config;

typedef struct {                   /* RAM */
    const hg_bank_config *config;
    hg_acc               *sum;     /* [certificates] residuals, then [certificates] thresholds, of the last step */
    uint8_t               k;       /* samples in the window, saturated at its length */
    uint8_t               closest; /* certificate whose |r| / J was largest at the last step */
} hg_bank;

/** Memory of one bank, sums. */
#define HG_BANK_SUMS(certificates) (2U * (uint32_t)(certificates))

/** Are sizes and tables within the ranges above, for rings of this many signals with a value, and with a radius, and a ring of values of this
 *  length? Cost: width + extras comparisons. */
bool hg_bank_valid(const hg_bank_config *config, uint8_t values, uint8_t radii, uint8_t length);

/** Begin with an empty window.
 *  @param[in] memory  [HG_BANK_SUMS(certificates)], owned by the caller
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer */
hg_status hg_bank_start(hg_bank *self, const hg_bank_config *config, hg_acc *memory);

/** Empty the window. */
void hg_bank_reset(hg_bank *self);

/** One sample, whose values and radii are the newest rows of the rings.
 *  @param[out] r  [1] residual of the certificate whose |r| / J is largest  @param[out] J  [1] its threshold
 *  @retval HG_OK         done
 *  @retval HG_E_EMPTY    the window is not full yet: r is 0 and J the first certificate's bias
 *  @retval HG_E_NUMERIC  a sum is not finite: r is 0 and J the first certificate's bias
 *  Cost: certificates x window x (2 width + extras) multiplications. */
hg_status hg_bank_step(hg_bank *self, const hg_ring *value, const hg_ring *radius, hg_real *r, hg_real *J);

/** Is the window full? */
bool hg_bank_ready(const hg_bank *self);

#ifdef __cplusplus
}
#endif

#endif
