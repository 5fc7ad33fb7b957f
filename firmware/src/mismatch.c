#include "hullguard/mismatch.h"

#include <stddef.h>

bool hg_mismatch_valid(const hg_mismatch_config *config, uint8_t signals)
{
    bool valid = hg_exponent_valid(config->exponent);
    valid = valid && ((config->states == 0U) ||
                 ((config->constant != NULL) && ((config->width == 0U) || ((config->signal != NULL) && (config->gain != NULL)))));
    for (uint8_t g = 0U; valid && (config->states > 0U) && (g < config->width); g++) {
        valid = config->signal[g] < signals;
    }
    return valid;
}

void hg_mismatch_step(const hg_mismatch_config *config, const hg_real *value, const hg_real *radius, hg_real *out)
{
    for (uint8_t i = 0U; i < config->states; i++) {
        hg_acc sum = hg_acc_zero();
        for (uint8_t g = 0U; g < config->width; g++) {
            const uint8_t place = config->signal[g];
            sum = hg_acc_mac(sum, config->gain[((uint16_t)i * config->width) + g], hg_real_add(hg_real_abs(value[place]), radius[place]));
        }
        out[i] = hg_real_min(hg_real_add(config->constant[i], hg_acc_real(sum, config->exponent)), HG_REAL_MAX); /* NaN too */
    }
}

void hg_mismatch_grow(const hg_mismatch_config *config, const hg_real *increase, hg_real *out)
{
    for (uint8_t i = 0U; i < config->states; i++) {
        hg_acc sum = hg_acc_zero();
        for (uint8_t g = 0U; g < config->width; g++) {
            sum = hg_acc_mac(sum, config->gain[((uint16_t)i * config->width) + g], increase[config->signal[g]]);
        }
        out[i] = hg_real_min(hg_real_add(out[i], hg_acc_real(sum, config->exponent)), HG_REAL_MAX);
    }
}
