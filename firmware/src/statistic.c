#include "hullguard/statistic.h"

#include <stddef.h>

#if HG_WITH_POLYNOMIAL

uint32_t hg_statistic_reals(const hg_statistic_config *config)
{
    const hg_polynomial_config *filter = &config->filter;
    return HG_POLYNOMIAL_REALS(filter->states, filter->outputs, filter->lifted, filter->measured, filter->ring) + (2U * (uint32_t)filter->outputs);
}

static bool inputs_valid(const hg_statistic_config *config, uint8_t signals)
{
    bool valid = (config->inputs == 0U) || ((config->input != NULL) && (config->zero != NULL) && (config->drive != NULL) && (config->direct != NULL) &&
                                            (config->known != NULL));
    for (uint8_t i = 0U; valid && (i < config->inputs); i++) {
        valid = (config->input[i] < signals) && (config->known[i] >= HG_REAL_ZERO);
    }
    return valid;
}

bool hg_statistic_valid(const hg_statistic_config *config, uint8_t signals)
{
    bool valid = hg_polynomial_valid(&config->filter) && (config->signal != NULL) && (config->gain != NULL) && inputs_valid(config, signals);
    for (uint8_t j = 0U; valid && (j < config->filter.outputs); j++) {
        valid = (config->signal[j] < signals) && (config->gain[j] > HG_REAL_ZERO);
    }
    return valid;
}

hg_status hg_statistic_start(hg_statistic *self, const hg_statistic_config *config, hg_real *memory)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL)) {
        return HG_E_ARGUMENT;
    }
    const uint8_t outputs = config->filter.outputs;
    self->config = config;
    self->y = memory;
    self->radius = &memory[outputs];
    self->samples = 0U;
    return hg_polynomial_start(&self->filter, &config->filter, &memory[2U * (uint32_t)outputs], hg_statistic_reals(config) - (2U * (uint32_t)outputs));
}

void hg_statistic_reset(hg_statistic *self)
{
    hg_polynomial_reset(&self->filter);
    self->samples = 0U;
}

static bool inputs_known(const hg_statistic_config *config, const hg_real *radius)
{
    bool known = true;
    for (uint8_t i = 0U; i < config->inputs; i++) {
        known = known && (radius[config->input[i]] <= config->known[i]);
    }
    return known;
}

/* Row a of a table times what the inputs are beyond their zeros. */
static hg_real pushed(const hg_statistic_config *config, const hg_real *table, uint8_t a, const hg_real *value)
{
    hg_real sum = HG_REAL_ZERO;
    for (uint8_t i = 0U; i < config->inputs; i++) {
        sum += table[((uint32_t)a * config->inputs) + i] * (value[config->input[i]] - config->zero[i]);
    }
    return sum;
}

/* Measurements as the filter has them. */
static void take_outputs(hg_statistic *self, const hg_real *value, const hg_real *radius)
{
    const hg_statistic_config *config = self->config;
    for (uint8_t j = 0U; j < config->filter.outputs; j++) {
        const uint8_t place = config->signal[j];
        self->y[j] = (config->gain[j] * value[place]) - pushed(config, config->direct, j, value);
        self->radius[j] = config->gain[j] * radius[place];
    }
}

hg_status hg_statistic_step(hg_statistic *self, const hg_real *value, const hg_real *radius, hg_real *r, hg_real *J)
{
    const hg_statistic_config *config = self->config;
    const hg_polynomial_judgement *judgement = &self->filter.judgement;
    const bool known = inputs_known(config, radius);
    hg_status status = HG_OK;
    if (known) {
        take_outputs(self, value, radius);
        status = hg_polynomial_step(&self->filter, self->y, self->radius);
    }
    J[1] = hg_linalg_root(config->filter.joint);
    J[2] = hg_linalg_root(config->filter.drift);
    if ((!known) || (status != HG_OK)) {
        hg_statistic_reset(self); /* a sample that nothing stands for */
        r[0] = HG_REAL_ZERO;
        r[1] = HG_REAL_ZERO;
        r[2] = HG_REAL_ZERO;
        J[0] = config->filter.kappa;
        return status;
    }
    for (uint8_t l = 0U; l < config->filter.states; l++) {
        self->filter.c[l] += pushed(config, config->drive, l, value);
    }
    r[0] = judgement->plain;
    r[1] = hg_linalg_root(judgement->joint);
    r[2] = hg_linalg_root(judgement->drift);
    J[0] = judgement->threshold;
    self->samples = (self->samples < UINT8_MAX) ? (uint8_t)(self->samples + 1U) : UINT8_MAX;
    return HG_OK;
}

bool hg_statistic_ready(const hg_statistic *self)
{
    return self->samples > self->config->settle;
}

#endif
