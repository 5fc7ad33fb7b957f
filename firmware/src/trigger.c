#include "hullguard/trigger.h"

#include <stddef.h>

#define DELTA_SHIFT 16U /* delta is in 1/65536 */

/* |a - b| of any two codes, which may not fit 32 bits signed. */
static uint32_t distance(int32_t a, int32_t b)
{
    const int64_t difference = (int64_t)a - (int64_t)b;
    return (uint32_t)((difference < 0) ? -difference : difference);
}

static uint16_t entry(const hg_trigger_config *config, uint8_t level, uint8_t channel)
{
    return (uint16_t)(((uint16_t)level * config->width) + channel);
}

bool hg_trigger_valid(const hg_trigger_config *config)
{
    bool valid = (config->width <= HG_GROUP_SIGNALS_MAX) && (config->levels >= 1U) && (config->levels <= HG_LEVELS_MAX) &&
                 (config->interval_max >= 1U) && (config->silence != NULL);
    if (valid && (config->width > 0U)) {
        valid = (config->delta != NULL) && (config->sigma != NULL) && (config->activity != NULL) && (config->zero != NULL);
    }
    for (uint8_t level = 0U; valid && (level < config->levels); level++) {
        valid = config->silence[level] < config->interval_max;
        for (uint8_t g = 0U; valid && (g < config->width); g++) {
            valid = config->sigma[entry(config, level, g)] >= 0;
        }
    }
    return valid;
}

int32_t hg_trigger_threshold(const hg_trigger_config *config, uint8_t level, uint8_t channel, int32_t sent)
{
    int32_t threshold = 0;
    if (sent != HG_CODE_INVALID) {
        const uint16_t i = entry(config, level, channel);
        const uint64_t relative = ((uint64_t)config->delta[i] * distance(sent, config->zero[channel])) >> DELTA_SHIFT;
        const uint64_t sum = relative + (uint64_t)(uint32_t)config->sigma[i];
        threshold = (sum > (uint64_t)INT32_MAX) ? INT32_MAX : (int32_t)sum;
    }
    return threshold;
}

/* Did channel g move by at least the activity of this level? */
static bool active(const hg_trigger_config *config, uint8_t level, uint8_t g, int32_t sent, int32_t previous)
{
    const int32_t least = config->activity[entry(config, level, g)];
    return (sent == HG_CODE_INVALID) || (previous == HG_CODE_INVALID) || ((int64_t)distance(sent, previous) >= (int64_t)least);
}

uint8_t hg_trigger_level(const hg_trigger_config *config, const int32_t *sent, const int32_t *previous)
{
    uint8_t level = 0U;
    for (uint8_t l = 1U; l < config->levels; l++) {
        for (uint8_t g = 0U; g < config->width; g++) {
            if (active(config, l, g, sent[g], previous[g])) {
                level = l;
            }
        }
    }
    return level;
}

hg_status hg_trigger_start(hg_trigger *self, const hg_trigger_config *config, int32_t *codes)
{
    if ((self == NULL) || (config == NULL) || (codes == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!hg_trigger_valid(config)) {
        return HG_E_CONFIG;
    }
    self->config = config;
    self->sent = codes;
    self->level = 0U;
    self->age = 0U;
    self->started = false;
    for (uint8_t g = 0U; g < config->width; g++) {
        codes[g] = HG_CODE_INVALID;
    }
    return HG_OK;
}

static bool deviates(const hg_trigger *self, const int32_t *code)
{
    bool deviation = false;
    for (uint8_t g = 0U; g < self->config->width; g++) {
        const int32_t threshold = hg_trigger_threshold(self->config, self->level, g, self->sent[g]);
        /* Invalid is a code like any other here: to or from it the distance exceeds every threshold but the saturated one. */
        const bool validity = (code[g] == HG_CODE_INVALID) != (self->sent[g] == HG_CODE_INVALID);
        deviation = deviation || validity || ((int64_t)distance(code[g], self->sent[g]) > (int64_t)threshold);
    }
    return deviation;
}

hg_status hg_trigger_step(hg_trigger *self, const int32_t *code)
{
    const hg_trigger_config *config = self->config;
    if (self->started) {
        self->age++;
        const bool overdue = self->age >= config->interval_max;
        const bool silent = self->age <= config->silence[self->level];
        if ((!overdue) && (silent || (!deviates(self, code)))) {
            return HG_E_EMPTY;
        }
    }
    self->level = self->started ? hg_trigger_level(config, code, self->sent) : 0U;
    self->started = true;
    self->age = 0U;
    for (uint8_t g = 0U; g < config->width; g++) {
        self->sent[g] = code[g];
    }
    return HG_OK;
}
