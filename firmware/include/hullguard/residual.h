/** @file
 *  A residual generator: a linear system from signals, outputs and inputs alike, to residuals that are zero but for the initial state,
 *  disturbances, event errors and faults. The variable-order observer with its post-filter fused (methods, platoon, sections 2 and 3) is
 *
 *      z(k+1) = (G - Lo W) z + [L + Lo V, H - Lo Qu] [y; u]        r = -Mo W z + Mo [V, -Qu] [y; u]
 *
 *  and the observer and the post-filter as published are two such systems in series (hg_residual_pair).
 *  Inputs are signals too: the generator reads one vector and an index list instead of y and u apart.
 *  Not reentrant per instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_RESIDUAL_H
#define HULLGUARD_RESIDUAL_H

#include "hullguard/linalg.h"
#include "hullguard/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {                /* flash: one a generator, generated */
    uint8_t        order;       /* s: length of z, 1 .. 255 */
    uint8_t        residuals;   /* length of r, 1 .. 255 */
    uint8_t        width;       /* signals read, 1 .. 255 */
    const uint8_t *signal;      /* [width] their places in the model's signal vector */
    hg_matrix      state;       /* order x order */
    hg_matrix      input;       /* order x width */
    hg_matrix      output;      /* residuals x order */
    hg_matrix      direct;      /* residuals x width */
} hg_residual_config;

typedef struct {                /* RAM */
    const hg_residual_config *config;
    hg_real                  *z;      /* [order] */
    hg_real                  *next;   /* [order] scratch */
    hg_real                  *input;  /* [width] scratch */
} hg_residual;

/** Memory of one generator, numbers. */
#define HG_RESIDUAL_REALS(order, width) ((2U * (uint32_t)(order)) + (uint32_t)(width))

/** Do the matrices fit one another? Constant time. */
bool hg_residual_valid(const hg_residual_config *config);

/** Begin with z = 0.
 *  @param[in] memory  [HG_RESIDUAL_REALS(order, width)], owned by the caller
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    hg_residual_valid() says no */
hg_status hg_residual_start(hg_residual *self, const hg_residual_config *config, hg_real *memory);

/** z = 0 again. */
void hg_residual_reset(hg_residual *self);

/** One sample.
 *  @param[in]  value  the model's signal vector at this sample, at least as long as the largest index in signal[]
 *  @param[out] r      [residuals]
 *  @retval HG_OK         z has moved on
 *  @retval HG_E_NUMERIC  a signal it reads is not finite, or so large that the next state overflows; z and r are unchanged
 *  Cost: (order + residuals)(order + width) multiplications. */
hg_status hg_residual_step(hg_residual *self, const hg_real *value, hg_real *r);

/** Observer and dynamic post-filter as two systems, as published; for comparison with the fused form.
 *  The filter reads the observer's raw residuals r0: its signal list is 0, 1, .. */
typedef struct {
    hg_residual observer;
    hg_residual filter;
} hg_residual_pair;

/** One sample of both.
 *  @param[out] r0  [observer residuals] before the post-filter
 *  @param[out] r   [filter residuals] after it
 *  @retval HG_OK         both have moved on
 *  @retval HG_E_NUMERIC  a signal is not finite or so large that the observer overflows; nothing changed. A filter that overflows leaves
 *                        the pair out of step: reset both */
hg_status hg_residual_pair_step(hg_residual_pair *self, const hg_real *value, hg_real *r0, hg_real *r);

#ifdef __cplusplus
}
#endif

#endif
