/** @file
 *  Silence by prediction (methods, platoon, section 7, end): between two frames of a group, what the plant's model says of its signals, where that
 *  is tighter than what the sender's silence says. An open-loop copy of the plant that each frame corrects:
 *
 *      in the sample of a frame   x <- x + correct (y - output x - direct u)
 *      always                     predicted = output x + direct u,  then  x <- state x + drive u
 *
 *  is wrong by at most radius(samples since the frame): disturbances, noise, and what the outputs do not see of the state, which has forgotten
 *  how it began after `settle` samples with all inputs known. It does not rely on the sender's silence, so that a late-discovered loss
 *  leaves it true. It does rely on the inputs: one that is not known (its frame is missing) ends the prediction for `settle` samples.
 *  Derived signals, one for each signal of the group: value and radius of the tighter of the two. Not reentrant per instance; safe in
 *  interrupt context; no allocation. */
#ifndef HULLGUARD_PREDICT_H
#define HULLGUARD_PREDICT_H

#include "hullguard/linalg.h"
#include "hullguard/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {                /* flash: one a predicted group, generated */
    uint8_t        group;       /* whose signals are predicted */
    uint8_t        first;       /* place of the group's first signal in the signal vector */
    uint8_t        order;       /* states, 1 .. 255 */
    uint8_t        width;       /* signals of the group, 1 .. 255 */
    uint8_t        inputs;      /* 1 .. 255; a plant without inputs reads any signal with weight 0 */
    const uint8_t *input;       /* [inputs] their places in the signal vector */
    const hg_real *known;       /* [inputs] radius up to which an input counts as known */
    hg_matrix      correct;     /* order x width */
    hg_matrix      state;       /* order x order */
    hg_matrix      drive;       /* order x inputs */
    hg_matrix      output;      /* width x order */
    hg_matrix      direct;      /* width x inputs */
    const hg_real *fresh;       /* [width] radius that a signal has in the sample of its frame: more means that its sender had no value */
    uint8_t        horizon;     /* samples after a frame for which there is a radius, 1 .. 254 */
    const hg_real *radius;      /* [horizon][width] */
    uint16_t       settle;      /* samples with all inputs known, and a frame at least every `horizon`, before the frame from which there is a prediction */
} hg_predict_config;

typedef struct {                /* RAM */
    const hg_predict_config *config;
    hg_real                 *x;     /* [order] predicted state of the open sample */
    hg_real                 *next;  /* [order] scratch */
    hg_real                 *u;     /* [inputs] scratch */
    hg_real                 *y;     /* [width] scratch */
    uint16_t                 k;     /* samples since x began to follow the plant, saturated */
    bool                     sure;  /* has a frame corrected x since it settled? */
} hg_predict;

/** Memory of one predictor, numbers. */
#define HG_PREDICT_REALS(order, inputs, width) ((2U * (uint32_t)(order)) + (uint32_t)(inputs) + (uint32_t)(width))

/** Do matrices and places fit one another and a vector of `signals`? Cost: inputs comparisons. */
bool hg_predict_valid(const hg_predict_config *config, uint8_t signals);

/** Begin with x = 0, and nothing predicted until it has settled.
 *  @param[in] memory  [HG_PREDICT_REALS(order, inputs, width)], owned by the caller
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer */
hg_status hg_predict_start(hg_predict *self, const hg_predict_config *config, hg_real *memory);

/** Begin again. */
void hg_predict_reset(hg_predict *self);

/** One sample.
 *  @param[in]  age         samples since the group's last frame, 0 in the sample of a frame
 *  @param[in]  value, radius  the signal vector as the holds know it
 *  @param[out] out_value, out_radius  [width] the tighter of held and predicted
 *  Cost: (order + width)(order + inputs) multiplications. */
void hg_predict_step(hg_predict *self, uint8_t age, const hg_real *value, const hg_real *radius, hg_real *out_value, hg_real *out_radius);

#ifdef __cplusplus
}
#endif

#endif
