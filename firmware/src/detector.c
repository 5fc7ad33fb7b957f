#include "hullguard/detector.h"

#include <stddef.h>

uint32_t hg_detector_reals(const hg_detector_config *config)
{
    uint32_t reals = (3U * (uint32_t)config->signals) + (2U * (uint32_t)config->residuals);
    reals += HG_RADII_REALS(config->signals, config->history);
    for (uint8_t g = 0U; g < config->generators; g++) {
        reals += HG_RESIDUAL_REALS(config->residual[g].order, config->residual[g].width);
    }
    return reals;
}

static bool generators_valid(const hg_detector_config *config)
{
    uint32_t residuals = 0U;
    bool valid = true;
    for (uint8_t g = 0U; g < config->generators; g++) {
        valid = valid && (config->residual[g].residuals == config->hull[g].residuals);
        residuals += config->residual[g].residuals;
        /* A rewind must end inside the taps: what the tail has taken in cannot be corrected. */
        for (uint8_t i = 0U; i < config->groups; i++) {
            valid = valid && (config->hull[g].taps >= config->hold[i].trigger->interval_max);
        }
        valid = valid && (config->residual[g].signal != NULL);
        for (uint8_t i = 0U; valid && (i < config->residual[g].width); i++) {
            valid = config->residual[g].signal[i] < config->signals;
        }
    }
    return valid && (residuals == config->residuals);
}

static hg_status start_holds(hg_detector *self)
{
    const hg_detector_config *config = self->config;
    hg_status status = HG_OK;
    uint16_t first = 0U;
    for (uint8_t i = 0U; (status == HG_OK) && (i < config->groups); i++) {
        if ((config->hold[i].trigger == NULL) || ((first + config->hold[i].trigger->width) > config->signals)) {
            return HG_E_CONFIG;
        }
        status = hg_hold_start(&self->memory.hold[i], &config->hold[i], &self->memory.code[2U * first]);
        first += config->hold[i].trigger->width;
    }
    return (first == config->signals) ? status : HG_E_CONFIG;
}

static hg_status start_generators(hg_detector *self, hg_start how)
{
    const hg_detector_config *config = self->config;
    hg_real *memory = &self->past[config->signals];
    hg_status status = hg_radii_start(&self->radii, config->signals, config->history, memory);
    memory = &memory[HG_RADII_REALS(config->signals, config->history)];
    for (uint8_t g = 0U; (status == HG_OK) && (g < config->generators); g++) {
        status = hg_residual_start(&self->memory.residual[g], &config->residual[g], memory);
        if (status == HG_OK) {
            status = hg_hull_start(&self->memory.hull[g], &config->hull[g], &self->radii, how);
        }
        memory = &memory[HG_RESIDUAL_REALS(config->residual[g].order, config->residual[g].width)];
    }
    return status;
}

hg_status hg_detector_start(hg_detector *self, const hg_detector_config *config, const hg_detector_memory *memory, hg_start how)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL) || (memory->hold == NULL) || (memory->residual == NULL) ||
        (memory->hull == NULL) || (memory->code == NULL) || (memory->real == NULL)) {
        return HG_E_ARGUMENT;
    }
    if ((config->signals < 1U) || (config->history < 1U) || (config->groups < 1U) || (config->groups > HG_GROUPS_MAX) ||
        (config->generators < 1U) || (config->generators > HG_GENERATORS_MAX) || (config->generators != config->decision.generators) ||
        (config->hold == NULL) || (config->residual == NULL) || (config->hull == NULL)) {
        return HG_E_CONFIG;
    }
    if ((memory->codes < (2U * (uint16_t)config->signals)) || (memory->reals < hg_detector_reals(config))) {
        return HG_E_SIZE;
    }
    self->config = config;
    self->memory = *memory;
    self->refusals = 0U;
    self->value = memory->real;
    self->radius = &self->value[config->signals];
    self->r = &self->radius[config->signals];
    self->J = &self->r[config->residuals];
    self->past = &self->J[config->residuals];
    for (uint32_t i = 0U; i < memory->reals; i++) {
        memory->real[i] = HG_REAL_ZERO;
    }
    hg_status status = start_holds(self);
    if ((status == HG_OK) && (!generators_valid(config))) {
        status = HG_E_CONFIG;
    }
    if (status == HG_OK) {
        status = start_generators(self, how);
    }
    return (status == HG_OK) ? hg_decision_start(&self->decision, &config->decision, memory->alarm) : status;
}

void hg_detector_restart(hg_detector *self, hg_start how)
{
    hg_radii_reset(&self->radii);
    for (uint8_t g = 0U; g < self->config->generators; g++) {
        hg_residual_reset(&self->memory.residual[g]);
        hg_hull_reset(&self->memory.hull[g], how);
    }
    hg_decision_reset(&self->decision);
}

hg_status hg_detector_receive(hg_detector *self, uint8_t group, const int32_t *code, bool continues)
{
    if (group >= self->config->groups) {
        return HG_E_ARGUMENT;
    }
    const hg_hold_config *config = &self->config->hold[group];
    for (uint8_t g = 0U; g < config->trigger->width; g++) {
        if ((code[g] != HG_CODE_INVALID) && (!hg_code_valid(&config->scale[g], code[g]))) {
            hg_hold_lose(&self->memory.hold[group]);
            return HG_E_NUMERIC;
        }
    }
    return hg_hold_receive(&self->memory.hold[group], code, continues);
}

hg_status hg_detector_lose(hg_detector *self, uint8_t group)
{
    if (group >= self->config->groups) {
        return HG_E_ARGUMENT;
    }
    hg_hold_lose(&self->memory.hold[group]);
    return HG_OK;
}

/* Close the sample in every hold; radii of the past are corrected where a loss has just shown. */
static void step_holds(hg_detector *self, hg_evidence *evidence)
{
    uint8_t rewind[HG_GROUPS_MAX];
    uint8_t first = 0U;
    for (uint8_t i = 0U; i < self->config->groups; i++) {
        hg_hold *hold = &self->memory.hold[i];
        hg_hold_step(hold, &self->value[first], &self->radius[first], &rewind[i]);
        if (hg_hold_doubt(hold)) {
            evidence->doubt |= (uint8_t)(1U << i);
        }
        if (rewind[i] > 0U) {
            evidence->rewound |= (uint8_t)(1U << i);
        }
        first += hold->config->trigger->width;
    }
    (void)hg_radii_push(&self->radii, self->radius);
    first = 0U;
    for (uint8_t i = 0U; i < self->config->groups; i++) {
        const uint8_t width = self->config->hold[i].trigger->width;
        for (uint8_t lag = 1U; lag <= rewind[i]; lag++) {
            hg_hold_past(&self->memory.hold[i], lag, self->past);
            hg_radii_rewrite(&self->radii, lag, first, width, self->past);
        }
        first += width;
    }
}

hg_status hg_detector_step(hg_detector *self, hg_finding *finding)
{
    hg_evidence evidence = {.alarm = 0U, .ready = true, .doubt = 0U, .rewound = 0U};
    hg_status status = HG_OK;
    hg_real *r = self->r;
    hg_real *J = self->J;
    step_holds(self, &evidence);
    for (uint8_t g = 0U; g < self->config->generators; g++) {
        const uint8_t n = self->config->residual[g].residuals;
        hg_hull *hull = &self->memory.hull[g];
        const hg_status moved = hg_residual_step(&self->memory.residual[g], self->value, r);
        hg_hull_step(hull, &self->radii, J);
        if (moved != HG_OK) {
            /* A sample is missing from z for good: only a start anywhere in the range is still true of it. */
            hg_residual_reset(&self->memory.residual[g]);
            hg_hull_reset(hull, HG_START_MOVING);
            self->refusals += (self->refusals < UINT32_MAX) ? 1U : 0U;
            status = moved;
        } else if (hg_decision_exceeds(r, J, n)) {
            evidence.alarm |= (uint32_t)1U << g;
        } else {
            /* within its threshold */
        }
        evidence.ready = evidence.ready && hg_hull_ready(hull);
        r = &r[n];
        J = &J[n];
    }
    finding->plant = hg_decision_step(&self->decision, &evidence, &finding->candidates);
    finding->basis = HG_BASIS_SET;
    return status;
}
