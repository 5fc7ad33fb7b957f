#include "hullguard/uio.h"

#include <stddef.h>

bool hg_uio_valid(const hg_uio_config *config, uint8_t ring_width, uint8_t ring_length)
{
    const uint16_t estimates = (uint16_t)((uint16_t)config->actuators + config->sensors + config->unknown + config->states);
    bool valid = (config->observer.residuals == estimates) && (config->hull.residuals == estimates) &&
                 hg_residual_valid(&config->observer) && hg_hull_valid(&config->hull, ring_width, ring_length);
    for (uint8_t g = 0U; valid && (g < config->observer.width); g++) {
        valid = config->observer.signal[g] < ring_width;
    }
    return valid;
}

hg_status hg_uio_start(hg_uio *self, const hg_uio_config *config, const hg_ring *ring, hg_start how, hg_real *memory)
{
    if ((self == NULL) || (config == NULL) || (ring == NULL) || (memory == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!hg_uio_valid(config, ring->width, ring->length)) {
        return HG_E_CONFIG;
    }
    self->config = config;
    self->beginnings = 1U;
    /* No pointer is null and the tables are valid: neither can fail. */
    (void)hg_residual_start(&self->observer, &config->observer, memory);
    (void)hg_hull_start(&self->hull, &config->hull, ring, how, &memory[HG_RESIDUAL_REALS(config->observer.order, config->observer.width)]);
    return HG_OK;
}

void hg_uio_reset(hg_uio *self, hg_start how)
{
    hg_residual_reset(&self->observer);
    hg_hull_reset(&self->hull, how);
}

hg_status hg_uio_step(hg_uio *self, const hg_real *value, const hg_ring *ring, hg_real *estimate, hg_real *radius)
{
    const uint8_t estimates = self->config->observer.residuals;
    const hg_status status = hg_residual_step(&self->observer, value, estimate);
    hg_hull_step(&self->hull, ring, radius);
    if (status != HG_OK) {
        /* A sample is missing from the state for good: only a start anywhere in the range is still true of the plant. */
        hg_uio_reset(self, HG_START_MOVING);
    }
    for (uint8_t i = 0U; i < estimates; i++) {
        if ((status != HG_OK) || (!hg_real_finite(estimate[i]))) { /* a radius is never more than HG_REAL_MAX */
            estimate[i] = HG_REAL_ZERO;
            radius[i] = HG_REAL_MAX;
        }
    }
    return status;
}

hg_status hg_uio_follow(hg_uio *self, const hg_detector *detector, hg_real *estimate, hg_real *radius)
{
    if (self->beginnings != detector->beginnings) {
        self->beginnings = detector->beginnings;
        hg_uio_reset(self, HG_START_MOVING);
    }
    return hg_uio_step(self, detector->value, &detector->radii, estimate, radius);
}

bool hg_uio_ready(const hg_uio *self)
{
    return hg_hull_ready(&self->hull);
}
