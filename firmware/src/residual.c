#include "hullguard/residual.h"

#include <stddef.h>

bool hg_residual_valid(const hg_residual_config *config)
{
    return (config->order >= 1U) && (config->residuals >= 1U) && (config->width >= 1U) && (config->signal != NULL) &&
           HG_SIZE_FITS(HG_ONLY_ORDER, config->order) && HG_SIZE_FITS(HG_ONLY_RESIDUALS, config->residuals) && HG_SIZE_FITS(HG_ONLY_READ, config->width) &&
           ((HG_ONLY_IN_ORDER == 0U) || hg_linalg_in_order(config->signal, config->width)) && hg_linalg_fits(&config->state, &config->input, config->order, config->order, config->width) &&
           hg_linalg_fits(&config->output, &config->direct, config->residuals, config->order, config->width);
}

hg_status hg_residual_start(hg_residual *self, const hg_residual_config *config, hg_real *memory)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!hg_residual_valid(config)) {
        return HG_E_CONFIG;
    }
    self->config = config;
    self->z = memory;
    self->next = &memory[config->order];
    self->input = &memory[2U * (uint16_t)config->order];
    hg_residual_reset(self);
    return HG_OK;
}

void hg_residual_reset(hg_residual *self)
{
    for (uint8_t i = 0U; i < self->config->order; i++) {
        self->z[i] = HG_REAL_ZERO;
    }
}

/* The signals it reads, one after another. */
static const hg_real *gathered(const hg_residual *self, const hg_real *value, uint8_t width)
{
    for (uint8_t g = 0U; (HG_ONLY_IN_ORDER == 0U) && (g < width); g++) {
        self->input[g] = value[self->config->signal[g]];
    }
    return (HG_ONLY_IN_ORDER == 0U) ? self->input : value;
}

hg_status hg_residual_step(hg_residual *self, const hg_real *value, hg_real *r)
{
    const hg_residual_config *config = self->config;
    const uint8_t order = HG_SIZE(HG_ONLY_ORDER, config->order);
    const uint8_t width = HG_SIZE(HG_ONLY_READ, config->width);
    const hg_real *input = gathered(self, value, width);
    if ((HG_REAL_Q31 != 0) && (!hg_linalg_finite(input, width))) {
        return HG_E_NUMERIC; /* of the float types, what is not finite makes every sum below so */
    }
    hg_linalg_rows(&config->state, self->z, &config->input, input, self->next, order, order, width);
    if (!hg_linalg_finite(self->next, order)) {
        return HG_E_NUMERIC; /* once in z, an infinity would make all that follows NaN */
    }
    hg_linalg_rows(&config->output, self->z, &config->direct, input, r, HG_SIZE(HG_ONLY_RESIDUALS, config->residuals), order, width);
    hg_real *swap = self->z;
    self->z = self->next;
    self->next = swap;
    return HG_OK;
}

hg_status hg_residual_pair_step(hg_residual_pair *self, const hg_real *value, hg_real *r0, hg_real *r)
{
    const hg_status status = hg_residual_step(&self->observer, value, r0);
    return (status == HG_OK) ? hg_residual_step(&self->filter, r0, r) : status;
}
