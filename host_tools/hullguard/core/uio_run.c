#include "host.h"

#include <stdlib.h>

struct hgh_uio {
    hgh_uio_config config;
    uint8_t        estimates;
    hg_ring        ring;
    hg_uio         uio;
#if !HG_REAL_Q31
    hg_isolate   isolate;
    hg_isolation found;
#endif
    hg_real        value[UINT8_MAX], radius[UINT8_MAX], estimate[UINT8_MAX], bound[UINT8_MAX];
    hg_real        memory[];
};

static size_t reals_of(const hgh_uio_config *config)
{
    const hg_uio_config *uio = config->uio;
    size_t reals = HG_RING_REALS(config->width, config->history) + HG_UIO_REALS(uio->observer.order, uio->observer.width, uio->hull.residuals, uio->hull.modes);
#if !HG_REAL_Q31
    const hg_isolate_config *isolate = config->isolate;
    reals += (isolate != NULL) ? HG_ISOLATE_REALS(isolate->components, isolate->blocks) : 0U;
#endif
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
#if HG_REAL_Q31
    good = good && (config->isolate == NULL);
#else
    if (good && (config->isolate != NULL)) {
        memory = &memory[HG_UIO_REALS(observer->order, observer->width, config->uio->hull.residuals, config->uio->hull.modes)];
        good = (config->isolate->estimates == self->estimates) && (hg_isolate_start(&self->isolate, config->isolate, memory) == HG_OK);
    }
#endif
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
        self->value[g] = hgh_real(value[g], self->config.unit[g]);
        self->radius[g] = (radius != NULL) ? hgh_real(radius[g], self->config.unit[g]) : HG_REAL_ZERO;
    }
    const bool wide = hg_ring_push(&self->ring, self->radius) == HG_OK;
    if (!wide) { /* a radius that is no number: the sample counts, with the largest one */
        for (int32_t g = 0; g < self->config.width; g++) {
            self->radius[g] = HG_REAL_MAX;
        }
        (void)hg_ring_push(&self->ring, self->radius);
    }
    const bool moved = hg_uio_step(&self->uio, self->value, &self->ring, self->estimate, self->bound) == HG_OK;
#if !HG_REAL_Q31
    if (self->config.isolate != NULL) {
        (void)hg_isolate_step(&self->isolate, self->estimate, self->bound, &self->found);
    }
#endif
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
                estimate[out + i] = hgh_number(self->estimate[i], self->config.estimate_unit[i]);
            }
            if (bound != NULL) {
                bound[out + i] = ((HG_REAL_Q31 != 0) && (self->bound[i] >= HG_REAL_MAX)) ? DBL_MAX : hgh_number(self->bound[i], self->config.estimate_unit[i]);
            }
        }
#if !HG_REAL_Q31
        if (isolation != NULL) {
            isolation[k] = self->found;
        }
#else
        (void)isolation;
#endif
    }
    return taken;
}

#if !HG_REAL_Q31
const hg_real *hgh_uio_share(const hgh_uio *self)
{
    return self->isolate.share;
}
#endif
