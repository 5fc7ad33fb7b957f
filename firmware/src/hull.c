#include "hullguard/hull.h"

#include <stddef.h>

bool hg_hull_valid(const hg_hull_config *config, uint8_t ring_width, uint8_t ring_length)
{
    bool valid = (config->residuals >= 1U) && (config->width >= 1U) && (config->taps >= 1U) && (config->taps < ring_length) &&
                 (config->settle >= 1U) && (config->decay >= HG_REAL_ZERO) && (config->decay < HG_REAL_C(1.0));
    valid = valid && (config->signal != NULL) && (config->weight != NULL) && (config->rest != NULL) && (config->moving != NULL) &&
            (config->tail_input != NULL) && (config->tail_output != NULL);
    for (uint8_t g = 0U; valid && (g < config->width); g++) {
        valid = config->signal[g] < ring_width;
    }
    return valid;
}

hg_status hg_hull_start(hg_hull *self, const hg_hull_config *config, const hg_ring *ring, hg_start how)
{
    if ((self == NULL) || (config == NULL) || (ring == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!hg_hull_valid(config, ring->width, ring->length)) {
        return HG_E_CONFIG;
    }
    self->config = config;
    hg_hull_reset(self, how);
    return HG_OK;
}

void hg_hull_reset(hg_hull *self, hg_start how)
{
    self->theta = HG_REAL_ZERO;
    self->k = 0U;
    self->how = how;
}

/* The bound on all lags behind the taps moves on by one sample. */
static void tail_step(hg_hull *self, const hg_ring *ring)
{
    const hg_hull_config *config = self->config;
    const hg_real *leaving = hg_ring_row(ring, config->taps);
    hg_acc sum = hg_acc_zero();
    for (uint8_t g = 0U; g < config->width; g++) {
        sum = hg_acc_mac(sum, config->tail_input[g], leaving[config->signal[g]]);
    }
    /* Held finite: an infinite theta would never heal. */
    self->theta = hg_real_min(hg_real_mul(config->decay, self->theta) + hg_acc_real(sum, 0), HG_REAL_MAX);
}

void hg_hull_step(hg_hull *self, const hg_ring *ring, hg_real *J)
{
    const hg_hull_config *config = self->config;
    const uint16_t stride = (uint16_t)config->residuals * config->width;
    const uint16_t row = (self->k < config->settle) ? self->k : (uint16_t)(config->settle - 1U);
    const hg_real *bias = &((self->how == HG_START_REST) ? config->rest : config->moving)[(uint32_t)row * config->residuals];
    tail_step(self, ring);
    for (uint8_t i = 0U; i < config->residuals; i++) {
        hg_acc sum = hg_acc_zero();
        for (uint8_t lag = 0U; lag < config->taps; lag++) {
            const hg_real *weight = &config->weight[((uint32_t)lag * stride) + ((uint32_t)i * config->width)];
            const hg_real *radius = hg_ring_row(ring, lag);
            for (uint8_t g = 0U; g < config->width; g++) {
                sum = hg_acc_mac(sum, weight[g], radius[config->signal[g]]);
            }
        }
        J[i] = bias[i] + hg_acc_real(sum, 0) + hg_real_mul(config->tail_output[i], self->theta);
    }
    self->k = (self->k < UINT16_MAX) ? (uint16_t)(self->k + 1U) : UINT16_MAX;
}

bool hg_hull_ready(const hg_hull *self)
{
    const uint16_t needed = (self->how == HG_START_REST) ? self->config->ready_rest : self->config->ready_moving;
    return self->k >= needed;
}
