#include "host.h"

#if !HG_REAL_Q31 /* isolation is for the float types */

#include <stdlib.h>

struct hgh_uio {
    hgh_uio_config config;
    uint8_t        estimates;
    hg_ring        ring;
    hg_uio         uio;
    hg_isolate     isolate;
    hg_isolation   found;
    hg_real        value[UINT8_MAX], radius[UINT8_MAX], estimate[UINT8_MAX], bound[UINT8_MAX];
    hg_real        memory[];
};

static size_t reals_of(const hgh_uio_config *config)
{
    const hg_uio_config *uio = config->uio;
    const hg_isolate_config *isolate = config->isolate;
    size_t reals = HG_RING_REALS(config->width, config->history) + HG_UIO_REALS(uio->observer.order, uio->observer.width, uio->hull.residuals, uio->hull.modes);
    reals += (isolate != NULL) ? HG_ISOLATE_REALS(isolate->components, isolate->blocks) : 0U;
    return reals;
}

hgh_uio *hgh_uio_new(const hgh_uio_config *config)
{
    if ((config->width < 1) || (config->width > UINT8_MAX) || (config->history < 1) || (config->history > UINT8_MAX)) {
        return NULL;
    }
    const hg_residual_config *observer = &config->uio->observer;
    hgh_uio *self = calloc(1U, sizeof *self + (reals_of(config) * sizeof(hg_real)));
    if (self == NULL) {
        return NULL;
    }
    hg_real *memory = &self->memory[HG_RING_REALS(config->width, config->history)];
    self->config = *config;
    self->estimates = observer->residuals;
    bool good = hg_ring_start(&self->ring, (uint8_t)config->width, (uint8_t)config->history, self->memory) == HG_OK;
    good = good && (hg_uio_start(&self->uio, config->uio, &self->ring, (hg_start)config->start, memory) == HG_OK);
    if (good && (config->isolate != NULL)) {
        memory = &memory[HG_UIO_REALS(observer->order, observer->width, config->uio->hull.residuals, config->uio->hull.modes)];
        good = (config->isolate->estimates == self->estimates) && (hg_isolate_start(&self->isolate, config->isolate, memory) == HG_OK);
    }
    if (!good) {
        free(self);
        return NULL;
    }
    return self;
}

void hgh_uio_free(hgh_uio *self)
{
    free(self);
}

static bool step(hgh_uio *self, const double *value, const double *radius)
{
    for (int32_t g = 0; g < self->config.width; g++) {
        self->value[g] = (hg_real)value[g];
        self->radius[g] = (radius != NULL) ? (hg_real)radius[g] : HG_REAL_ZERO;
    }
    const bool wide = hg_ring_push(&self->ring, self->radius) == HG_OK;
    if (!wide) { /* a radius that is no number: the sample counts, with the largest one */
        for (int32_t g = 0; g < self->config.width; g++) {
            self->radius[g] = HG_REAL_MAX;
        }
        (void)hg_ring_push(&self->ring, self->radius);
    }
    const bool moved = hg_uio_step(&self->uio, self->value, &self->ring, self->estimate, self->bound) == HG_OK;
    if (self->config.isolate != NULL) {
        (void)hg_isolate_step(&self->isolate, self->estimate, self->bound, &self->found);
    }
    return moved && wide;
}

int64_t hgh_uio_steps(hgh_uio *self, const double *value, const double *radius, int64_t samples, double *estimate, double *bound,
                      hg_isolation *isolation)
{
    int64_t taken = 0;
    for (int64_t k = 0; k < samples; k++) {
        const size_t in = (size_t)k * (size_t)self->config.width;
        const size_t out = (size_t)k * self->estimates;
        taken += step(self, &value[in], (radius != NULL) ? &radius[in] : NULL) ? 1 : 0;
        for (size_t i = 0; i < self->estimates; i++) {
            if (estimate != NULL) {
                estimate[out + i] = (double)self->estimate[i];
            }
            if (bound != NULL) {
                bound[out + i] = (double)self->bound[i];
            }
        }
        if (isolation != NULL) {
            isolation[k] = self->found;
        }
    }
    return taken;
}

const hg_real *hgh_uio_share(const hgh_uio *self)
{
    return self->isolate.share;
}

#endif
