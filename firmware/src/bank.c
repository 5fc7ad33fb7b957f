#include "hullguard/bank.h"

#include <stddef.h>

bool hg_bank_valid(const hg_bank_config *config, uint8_t values, uint8_t radii, uint8_t length)
{
    bool valid = (config->certificates >= 1U) && (config->window >= 1U) && (config->window <= length) && (config->width >= 1U) &&
                 (config->signal != NULL) && (config->weight != NULL) && (config->bias != NULL) && (config->widen >= HG_REAL_C(1.0)) &&
                 hg_exponent_valid(config->exponent);
    valid = valid && ((config->extras == 0U) || ((config->extra != NULL) && (config->extra_weight != NULL)));
    for (uint8_t g = 0U; valid && (g < config->width); g++) {
        valid = (config->signal[g] < values) && (config->signal[g] < radii);
    }
    for (uint8_t e = 0U; valid && (e < config->extras); e++) {
        valid = config->extra[e] < radii;
    }
    return valid;
}

hg_status hg_bank_start(hg_bank *self, const hg_bank_config *config, hg_acc *memory)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL)) {
        return HG_E_ARGUMENT;
    }
    self->config = config;
    self->sum = memory;
    hg_bank_reset(self);
    return HG_OK;
}

void hg_bank_reset(hg_bank *self)
{
    self->k = 0U;
    self->closest = 0U;
    for (uint32_t i = 0U; i < HG_BANK_SUMS(self->config->certificates); i++) {
        self->sum[i] = hg_acc_zero();
    }
}

/* All certificates side by side: the innermost loop runs over one row of the table. */
static void add_sample(const hg_bank *self, const hg_real *weight, const hg_real *value, const hg_real *radius)
{
    const hg_bank_config *config = self->config;
    const uint8_t n = config->certificates;
    hg_acc *residual = self->sum;
    hg_acc *threshold = &self->sum[n];
    for (uint8_t g = 0U; g < config->width; g++) {
        const hg_real *row = &weight[(uint16_t)g * n];
        const hg_real v = value[config->signal[g]];
        const hg_real wide = hg_real_widen(radius[config->signal[g]], config->widen);
        for (uint8_t c = 0U; c < n; c++) {
            residual[c] = hg_acc_mac(residual[c], row[c], v);
            threshold[c] = hg_acc_mac(threshold[c], hg_real_abs(row[c]), wide);
        }
    }
}

static void add_extras(const hg_bank *self, const hg_real *weight, const hg_real *radius)
{
    const uint8_t n = self->config->certificates;
    hg_acc *threshold = &self->sum[n];
    for (uint8_t e = 0U; e < self->config->extras; e++) {
        const hg_real *row = &weight[(uint16_t)e * n];
        const hg_real wide = radius[self->config->extra[e]];
        for (uint8_t c = 0U; c < n; c++) {
            threshold[c] = hg_acc_mac(threshold[c], row[c], wide);
        }
    }
}

static void add_window(hg_bank *self, const hg_ring *value, const hg_ring *radius)
{
    const hg_bank_config *config = self->config;
    const uint32_t n = config->certificates;
    for (uint32_t i = 0U; i < HG_BANK_SUMS(n); i++) {
        self->sum[i] = hg_acc_zero();
    }
    for (uint8_t lag = 0U; lag < config->window; lag++) {
        const hg_real *wide = hg_ring_row(radius, lag);
        add_sample(self, &config->weight[(uint32_t)lag * config->width * n], hg_ring_row(value, lag), wide);
        if (config->extras > 0U) {
            add_extras(self, &config->extra_weight[(uint32_t)lag * config->extras * n], wide);
        }
    }
}

/* Is a pair nearer to an alarm than another? An alarm always is; otherwise the larger |r| / J, compared without a division. */
static bool nearer(hg_real r, hg_real J, hg_real best_r, hg_real best_J)
{
    const hg_real a = hg_real_abs(r);
    const hg_real b = hg_real_abs(best_r);
    return ((a > J) == (b > best_J)) ? (hg_acc_mac(hg_acc_zero(), a, best_J) > hg_acc_mac(hg_acc_zero(), b, J)) : (a > J);
}

hg_status hg_bank_step(hg_bank *self, const hg_ring *value, const hg_ring *radius, hg_real *r, hg_real *J)
{
    const hg_bank_config *config = self->config;
    *r = HG_REAL_ZERO;
    *J = config->bias[0];
    self->k = (self->k < config->window) ? (uint8_t)(self->k + 1U) : config->window;
    if (!hg_bank_ready(self)) {
        return HG_E_EMPTY;
    }
    add_window(self, value, radius);
    for (uint8_t c = 0U; c < config->certificates; c++) {
        const hg_real residual = hg_acc_real(self->sum[c], config->exponent);
        const hg_real threshold = hg_real_add(config->bias[c], hg_acc_real(self->sum[(uint16_t)c + config->certificates], config->exponent));
        if ((!hg_real_finite(residual)) || (!hg_real_finite(threshold))) {
            *r = HG_REAL_ZERO;
            *J = config->bias[0];
            self->closest = 0U;
            return HG_E_NUMERIC;
        }
        if ((c == 0U) || nearer(residual, threshold, *r, *J)) {
            self->closest = c;
            *r = residual;
            *J = threshold;
        }
    }
    return HG_OK;
}

bool hg_bank_ready(const hg_bank *self)
{
    return self->k >= self->config->window;
}
