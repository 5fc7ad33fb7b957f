#include "hullguard/predict.h"

#include <stddef.h>

bool hg_predict_valid(const hg_predict_config *config, uint8_t signals)
{
    bool valid = (config->order >= 1U) && (config->width >= 1U) && (config->inputs >= 1U) && (config->horizon >= 1U) &&
                 (config->horizon < UINT8_MAX) && (config->input != NULL) && (config->known != NULL) && (config->fresh != NULL) &&
                 (config->radius != NULL) && (((uint16_t)config->first + config->width) <= signals);
    valid = valid && (config->correct.rows == config->order) && (config->correct.cols == config->width) && (config->correct.data != NULL) &&
            hg_exponent_valid(config->correct.exponent);
    valid = valid && hg_linalg_fits(&config->state, &config->drive, config->order, config->order, config->inputs);
    valid = valid && hg_linalg_fits(&config->output, &config->direct, config->width, config->order, config->inputs);
    for (uint8_t i = 0U; valid && (i < config->inputs); i++) {
        valid = config->input[i] < signals;
    }
    return valid;
}

hg_status hg_predict_start(hg_predict *self, const hg_predict_config *config, hg_real *memory)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL)) {
        return HG_E_ARGUMENT;
    }
    self->config = config;
    self->x = memory;
    self->next = &memory[config->order];
    self->u = &self->next[config->order];
    self->y = &self->u[config->inputs];
    hg_predict_reset(self);
    return HG_OK;
}

void hg_predict_reset(hg_predict *self)
{
    self->k = 0U;
    self->sure = false;
    for (uint8_t i = 0U; i < self->config->order; i++) {
        self->x[i] = HG_REAL_ZERO;
    }
}

/* Take a frame's values over; y holds what was predicted of them. */
static void correct(hg_predict *self, const hg_real *value)
{
    const hg_predict_config *config = self->config;
    for (uint8_t g = 0U; g < config->width; g++) {
        self->y[g] = hg_real_sub(value[config->first + g], self->y[g]);
    }
    for (uint8_t i = 0U; i < config->order; i++) {
        hg_acc sum = hg_acc_zero();
        for (uint8_t g = 0U; g < config->width; g++) {
            sum = hg_acc_mac(sum, config->correct.data[((uint16_t)i * config->width) + g], self->y[g]);
        }
        self->x[i] = hg_real_add(self->x[i], hg_acc_real(sum, config->correct.exponent));
    }
}

/* Does x still follow the plant: frames within the horizon, no value missing from one, every input known? */
static bool follows(const hg_predict *self, uint8_t age, const hg_real *radius)
{
    const hg_predict_config *config = self->config;
    bool known = age <= config->horizon;
    for (uint8_t i = 0U; i < config->inputs; i++) {
        known = known && (radius[config->input[i]] <= config->known[i]);
    }
    for (uint8_t g = 0U; (age == 0U) && (g < config->width); g++) {
        known = known && (radius[config->first + g] <= config->fresh[g]);
    }
    return known;
}

static void advance(hg_predict *self)
{
    const hg_predict_config *config = self->config;
    hg_linalg_apply(&config->state, self->x, &config->drive, self->u, self->next);
    hg_real *swap = self->x;
    self->x = self->next;
    self->next = swap;
    if (hg_linalg_finite(self->x, config->order)) {
        self->k = (self->k < UINT16_MAX) ? (uint16_t)(self->k + 1U) : UINT16_MAX;
    } else {
        hg_predict_reset(self);
    }
}

void hg_predict_step(hg_predict *self, uint8_t age, const hg_real *value, const hg_real *radius, hg_real *out_value, hg_real *out_radius)
{
    const hg_predict_config *config = self->config;
    const bool following = follows(self, age, radius);
    for (uint8_t i = 0U; i < config->inputs; i++) {
        self->u[i] = value[config->input[i]];
    }
    hg_linalg_apply(&config->output, self->x, &config->direct, self->u, self->y);
    const bool usable = following && (age >= 1U) && self->sure && hg_linalg_finite(self->y, config->width);
    for (uint8_t g = 0U; g < config->width; g++) {
        out_value[g] = value[config->first + g];
        out_radius[g] = radius[config->first + g];
        const hg_real predicted = usable ? config->radius[(((uint16_t)age - 1U) * config->width) + g] : out_radius[g];
        if (predicted < out_radius[g]) {
            out_value[g] = self->y[g];
            out_radius[g] = predicted;
        }
    }
    if (!following) {
        hg_predict_reset(self);
    } else {
        if (age == 0U) {
            correct(self, value);
            self->sure = self->k >= config->settle;
        }
        advance(self);
    }
}
