#include "hullguard/detector.h"

#include <stddef.h>

/* deviation: misra-c2012-10.8: HG_REAL_C, as in real.h */
/* cppcheck-suppress-macro misra-c2012-10.8 */
#define WIDER HG_REAL_C(1.000001) /* more than the rounding of a difference can take away */

/* Parts that an image does without are constants here, so that the compiler drops them and the linker what they call; so are sizes of config.h. */
static uint8_t predictors_of(const hg_detector_config *config)
{
    return (HG_WITH_PREDICT != 0) ? config->predictors : 0U;
}

static uint8_t groups_of(const hg_detector_config *config)
{
    return HG_SIZE(HG_ONLY_GROUPS, config->groups);
}

static uint8_t generators_of(const hg_detector_config *config)
{
    return HG_SIZE(HG_ONLY_GENERATORS, config->generators);
}

static uint8_t banks_of(const hg_detector_config *config)
{
    return (HG_WITH_BANK != 0) ? config->banks : 0U;
}

static bool with_mismatch(const hg_detector_config *config)
{
    return (HG_WITH_MISMATCH != 0) && (config->mismatch != NULL);
}

/* A macro, so that it is a constant for a compiler that does not optimise too: without the part there is nothing to link with. */
#define BY_ZONOTOPE(config) ((HG_WITH_ZONOTOPE != 0) && ((config)->zonotope != NULL))

/* As above: fixed point has nothing to link with. */
#define POLYNOMIALS(config) ((HG_WITH_POLYNOMIAL != 0) ? (config)->polynomials : 0U)

/* Has this image all that a configuration asks for? */
static bool parts_there(const hg_detector_config *config)
{
    const bool by_zonotope = BY_ZONOTOPE(config);
    return (predictors_of(config) == config->predictors) && (banks_of(config) == config->banks) &&
           (with_mismatch(config) == (config->mismatch != NULL)) && (by_zonotope == (config->zonotope != NULL)) &&
           (POLYNOMIALS(config) == config->polynomials);
}

uint32_t hg_detector_reals(const hg_detector_config *config)
{
    uint32_t reals = (2U * (uint32_t)config->width) + (2U * (uint32_t)config->residuals) + HG_HOLD_REALS(config->signals);
    reals += HG_RING_REALS(config->width, config->history) + HG_RING_REALS(config->signals, config->window);
    for (uint8_t g = 0U; g < config->generators; g++) {
        reals += HG_RESIDUAL_REALS(config->residual[g].order, config->residual[g].width);
    }
    for (uint8_t g = 0U; (config->hull != NULL) && (g < config->generators); g++) {
        reals += HG_HULL_REALS(config->hull[g].residuals, config->hull[g].modes);
    }
    for (uint8_t g = 0U; BY_ZONOTOPE(config) && (g < config->generators); g++) {
        const hg_zonotope_config *zonotope = &config->zonotope[g];
        reals += HG_ZONOTOPE_REALS(zonotope->order, zonotope->columns, (uint32_t)zonotope->width + zonotope->disturbances);
    }
    for (uint8_t i = 0U; i < predictors_of(config); i++) {
        reals += HG_PREDICT_REALS(config->predict[i].order, config->predict[i].inputs, config->predict[i].width);
    }
    for (uint8_t p = 0U; (HG_WITH_POLYNOMIAL != 0) && (p < config->polynomials); p++) {
        reals += hg_statistic_reals(&config->polynomial[p]);
    }
    return reals;
}

uint32_t hg_detector_sums(const hg_detector_config *config)
{
    uint32_t sums = 0U;
    for (uint8_t b = 0U; b < banks_of(config); b++) {
        sums += HG_BANK_SUMS(config->bank[b].certificates);
    }
    return sums;
}

static bool counts_valid(const hg_detector_config *config)
{
    const uint32_t judged = (uint32_t)config->generators + config->banks + config->polynomials;
    bool valid = (config->signals >= 1U) && (config->width >= config->signals) && (config->history >= 1U) && (config->groups >= 1U) &&
                 (config->groups <= HG_GROUPS_MAX) && (config->predictors <= HG_GROUPS_MAX) && (config->hold != NULL);
    valid = valid && (judged >= 1U) && (judged <= HG_GENERATORS_MAX) && (judged == config->decision.generators);
    valid = valid && ((config->generators == 0U) || ((config->residual != NULL) && ((config->hull != NULL) != (config->zonotope != NULL))));
    valid = valid && HG_SIZE_FITS(HG_ONLY_GROUPS, config->groups) && HG_SIZE_FITS(HG_ONLY_GENERATORS, config->generators) &&
            HG_SIZE_FITS(HG_ONLY_WIDTH, config->width) && HG_SIZE_FITS(HG_ONLY_HISTORY, config->history);
    valid = valid && ((config->banks == 0U) || ((config->bank != NULL) && (config->window >= 1U)));
    valid = valid && ((config->polynomials == 0U) || (config->polynomial != NULL));
    return valid && ((config->predictors == 0U) || (config->predict != NULL));
}

static bool memory_there(const hg_detector_config *config, const hg_detector_memory *memory)
{
    bool there = (memory->hold != NULL) && (memory->alarm != NULL) && (memory->code != NULL) && (memory->real != NULL);
    there = there && ((config->generators == 0U) || ((memory->residual != NULL) &&
                      (((config->hull != NULL) ? (const void *)memory->hull : (const void *)memory->zonotope) != NULL)));
    there = there && ((config->banks == 0U) || ((memory->bank != NULL) && (memory->sum != NULL)));
    there = there && ((config->polynomials == 0U) || (memory->polynomial != NULL));
    return there && ((config->predictors == 0U) || (memory->predict != NULL));
}

/* Derived signals fill the vector exactly, each group that is predicted is there and has the signals that its predictor says. */
static bool derived_valid(const hg_detector_config *config)
{
    uint16_t width = config->signals;
    bool valid = true;
    for (uint8_t i = 0U; valid && (i < predictors_of(config)); i++) {
        const hg_predict_config *predict = &config->predict[i];
        uint16_t first = 0U;
        valid = (predict->group < config->groups) && hg_predict_valid(predict, config->signals);
        for (uint8_t g = 0U; valid && (g < predict->group); g++) {
            first += config->hold[g].trigger->width;
        }
        valid = valid && (predict->first == first) && (predict->width == config->hold[predict->group].trigger->width);
        width += predict->width;
    }
    if (valid && with_mismatch(config)) {
        valid = hg_mismatch_valid(config->mismatch, config->signals);
        width += config->mismatch->states;
    }
    return valid && (width == config->width);
}

/* How far back a signal's radius may still be rewritten: less than interval_max of its group, or of any for a signal that is derived from several. */
static uint8_t rewinds_of(const hg_detector_config *config, uint8_t place)
{
    uint8_t longest = 1U; /* no interval is shorter */
    uint16_t end = 0U;
    for (uint8_t i = 0U; i < config->groups; i++) {
        const hg_trigger_config *trigger = config->hold[i].trigger;
        const bool own = (place >= end) && (place < (end + trigger->width));
        end += trigger->width;
        longest = ((own || (place >= config->signals)) && (trigger->interval_max > longest)) ? trigger->interval_max : longest;
    }
    return (uint8_t)(longest - 1U);
}

/* A rewind must end inside the taps: what a tail has taken in cannot be corrected. */
static bool rewinds_end(const hg_detector_config *config, const hg_hull_config *hull)
{
    bool valid = (hull->signal != NULL) && (hull->taps != NULL);
    for (uint8_t g = 0U; valid && (g < hull->width); g++) {
        valid = rewinds_of(config, hull->signal[g]) <= hull->taps[g];
    }
    return valid;
}

static bool generator_valid(const hg_detector_config *config, uint8_t g)
{
    const hg_residual_config *residual = &config->residual[g];
    bool valid = false;
    if (config->hull != NULL) {
        valid = (residual->residuals == config->hull[g].residuals) && rewinds_end(config, &config->hull[g]);
    } else {
        valid = (residual->residuals == config->zonotope[g].residuals) && ((rewinds_of(config, UINT8_MAX) + 1U) < config->history); /* it needs the old radii of all that is rewritten */
    }
    valid = valid && (residual->signal != NULL);
    for (uint8_t i = 0U; valid && (i < residual->width); i++) {
        valid = residual->signal[i] < config->width;
    }
    return valid;
}

static bool generators_valid(const hg_detector_config *config)
{
    uint32_t residuals = config->banks + (HG_STATISTICS * (uint32_t)POLYNOMIALS(config));
    bool valid = true;
    for (uint8_t g = 0U; valid && (g < config->generators); g++) {
        valid = generator_valid(config, g);
        residuals += config->residual[g].residuals;
    }
    for (uint8_t b = 0U; valid && (b < banks_of(config)); b++) {
        valid = (config->bank[b].window <= config->history) && hg_bank_valid(&config->bank[b], config->signals, config->width, config->window);
    }
    for (uint8_t p = 0U; (HG_WITH_POLYNOMIAL != 0) && valid && (p < config->polynomials); p++) {
        valid = hg_statistic_valid(&config->polynomial[p], config->signals);
    }
    return valid && (residuals == config->residuals);
}

static hg_status start_holds(hg_detector *self)
{
    const hg_detector_config *config = self->config;
    hg_real *memory = &self->past[config->width];
    hg_status status = HG_OK;
    uint16_t first = 0U;
    for (uint8_t i = 0U; (status == HG_OK) && (i < config->groups); i++) {
        if ((config->hold[i].trigger == NULL) || ((first + config->hold[i].trigger->width) > config->signals)) {
            return HG_E_CONFIG;
        }
        status = hg_hold_start(&self->memory.hold[i], &config->hold[i], &self->memory.code[HG_HOLD_CODES(first)], &memory[HG_HOLD_REALS(first)]);
        first += config->hold[i].trigger->width;
    }
    return (first == config->signals) ? status : HG_E_CONFIG;
}

/* Everything between the holds and the decision takes its memory from one piece, behind theirs and in this order. */
static hg_status start_generators(hg_detector *self, hg_start how)
{
    const hg_detector_config *config = self->config;
    hg_real *memory = &self->past[config->width + HG_HOLD_REALS(config->signals)];
    hg_status status = hg_ring_start(&self->radii, config->width, config->history, memory);
    self->radius = memory;
    memory = &memory[HG_RING_REALS(config->width, config->history)];
    for (uint8_t g = 0U; (status == HG_OK) && (g < config->generators); g++) {
        status = hg_residual_start(&self->memory.residual[g], &config->residual[g], memory);
        memory = &memory[HG_RESIDUAL_REALS(config->residual[g].order, config->residual[g].width)];
        if ((status == HG_OK) && BY_ZONOTOPE(config)) {
            const hg_zonotope_config *zonotope = &config->zonotope[g];
            status = hg_zonotope_start(&self->memory.zonotope[g], zonotope, &self->radii, how, memory);
            memory = &memory[HG_ZONOTOPE_REALS(zonotope->order, zonotope->columns, (uint32_t)zonotope->width + zonotope->disturbances)];
        } else if (status == HG_OK) {
            status = hg_hull_start(&self->memory.hull[g], &config->hull[g], &self->radii, how, memory);
            memory = &memory[HG_HULL_REALS(config->hull[g].residuals, config->hull[g].modes)];
        } else {
            /* refused */
        }
    }
    for (uint8_t i = 0U; (status == HG_OK) && (i < predictors_of(config)); i++) {
        const hg_predict_config *predict = &config->predict[i];
        status = hg_predict_start(&self->memory.predict[i], predict, memory);
        memory = &memory[HG_PREDICT_REALS(predict->order, predict->inputs, predict->width)];
    }
    for (uint8_t p = 0U; (HG_WITH_POLYNOMIAL != 0) && (status == HG_OK) && (p < config->polynomials); p++) {
        status = hg_statistic_start(&self->memory.polynomial[p], &config->polynomial[p], memory);
        memory = &memory[hg_statistic_reals(&config->polynomial[p])];
    }
    if ((status == HG_OK) && (banks_of(config) > 0U)) {
        hg_acc *sum = self->memory.sum;
        /* No pointer is null and no size 0 any more: none of these can fail. */
        (void)hg_ring_start(&self->values, config->signals, config->window, memory);
        for (uint8_t b = 0U; b < banks_of(config); b++) {
            (void)hg_bank_start(&self->memory.bank[b], &config->bank[b], sum);
            sum = &sum[HG_BANK_SUMS(config->bank[b].certificates)];
        }
    }
    return status;
}

hg_status hg_detector_start(hg_detector *self, const hg_detector_config *config, const hg_detector_memory *memory, hg_start how)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL)) {
        return HG_E_ARGUMENT;
    }
    if ((!counts_valid(config)) || (!parts_there(config))) {
        return HG_E_CONFIG;
    }
    if (!memory_there(config, memory)) {
        return HG_E_ARGUMENT;
    }
    if ((memory->codes < HG_HOLD_CODES(config->signals)) || (memory->reals < hg_detector_reals(config)) ||
        (memory->sums < hg_detector_sums(config))) {
        return HG_E_SIZE;
    }
    self->config = config;
    self->memory = *memory;
    self->refusals = 0U;
    self->beginnings = 1U;
    self->samples = 0U;
    self->value = memory->real;
    self->r = &self->value[config->width];
    self->J = &self->r[config->residuals];
    self->past = &self->J[config->residuals];
    for (uint32_t i = 0U; i < memory->reals; i++) {
        memory->real[i] = HG_REAL_ZERO;
    }
    hg_status status = start_holds(self);
    if ((status == HG_OK) && ((!derived_valid(config)) || (!generators_valid(config)))) {
        status = HG_E_CONFIG;
    }
    if (status == HG_OK) {
        status = start_generators(self, how);
    }
    return (status == HG_OK) ? hg_decision_start(&self->decision, &config->decision, memory->alarm) : status;
}

static void reset_threshold(hg_detector *self, uint8_t g, hg_start how)
{
    if (!BY_ZONOTOPE(self->config)) {
        hg_hull_reset(&self->memory.hull[g], how);
    } else {
        hg_zonotope_reset(&self->memory.zonotope[g], how);
    }
}

static void reset_banks(hg_detector *self)
{
    for (uint8_t b = 0U; b < self->config->banks; b++) {
        hg_bank_reset(&self->memory.bank[b]);
    }
}

void hg_detector_restart(hg_detector *self, hg_start how)
{
    self->beginnings++;
    self->samples = 0U;
    hg_ring_reset(&self->radii);
    for (uint8_t i = 0U; i < self->config->predictors; i++) {
        hg_predict_reset(&self->memory.predict[i]);
    }
    for (uint8_t g = 0U; g < self->config->generators; g++) {
        hg_residual_reset(&self->memory.residual[g]);
        reset_threshold(self, g, how);
    }
    reset_banks(self);
    for (uint8_t p = 0U; (HG_WITH_POLYNOMIAL != 0) && (p < self->config->polynomials); p++) {
        hg_statistic_reset(&self->memory.polynomial[p]);
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

/* Does an input's radius stand, whatever shows later? One that relies on silence may have to be taken back, which no prediction could follow;
   an input that any radius will do for has nothing to take back. */
static bool inputs_certain(const hg_detector_config *config, const hg_predict_config *predict, uint8_t doubt)
{
    bool certain = true;
    uint8_t first = 0U;
    for (uint8_t i = 0U; i < config->groups; i++) {
        const hg_hold_config *hold = &config->hold[i];
        const uint8_t end = (uint8_t)(first + hold->trigger->width);
        const bool settled = (doubt & (uint8_t)(1U << i)) == 0U;
        for (uint8_t g = 0U; g < predict->inputs; g++) {
            const uint8_t place = predict->input[g];
            const bool own = (place >= first) && (place < end);
            certain = certain && (settled || (!own) || (predict->known[g] >= hold->span[place - first]));
        }
        first = end;
    }
    return certain;
}

/* Signals that follow from the sent ones: value and radius of each. */
static void derive(hg_detector *self, uint8_t doubt)
{
    const hg_detector_config *config = self->config;
    uint8_t place = config->signals;
    for (uint8_t i = 0U; i < predictors_of(config); i++) {
        const hg_predict_config *predict = &config->predict[i];
        /* An age beyond every horizon ends the prediction. */
        const uint8_t age = inputs_certain(config, predict, doubt) ? hg_hold_age(&self->memory.hold[predict->group]) : UINT8_MAX;
        hg_predict_step(&self->memory.predict[i], age, self->value, self->radius, &self->value[place], &self->radius[place]);
        place += predict->width;
    }
    if (with_mismatch(config)) {
        hg_mismatch_step(config->mismatch, self->value, self->radius, &self->radius[place]); /* their values stay 0 */
    }
}

/* By how much a radius has grown, from above and finite. */
static hg_real difference(hg_real now, hg_real before)
{
    return hg_real_min(hg_real_widen(hg_real_sub(now, before), WIDER), HG_REAL_MAX);
}

/* The radii of one group at a past sample turn out wider, and with them what was derived from them. */
static void widen_past(hg_detector *self, uint8_t group, uint8_t first, uint8_t lag)
{
    const hg_detector_config *config = self->config;
    hg_real *row = hg_ring_row(&self->radii, lag);
    hg_real *increase = self->past;
    uint8_t place = config->signals;
    for (uint8_t g = 0U; g < config->width; g++) {
        increase[g] = row[g];
    }
    hg_hold_past(&self->memory.hold[group], lag, &row[first]);
    for (uint8_t i = 0U; i < predictors_of(config); i++) {
        const hg_predict_config *predict = &config->predict[i];
        /* Where the prediction was the tighter one it still is; the held one's wider radius holds for either. */
        for (uint8_t g = 0U; (predict->group == group) && (g < predict->width); g++) {
            row[place + g] = hg_real_max(row[place + g], row[first + g]);
        }
        place += predict->width;
    }
    for (uint8_t g = 0U; g < place; g++) {
        increase[g] = difference(row[g], increase[g]);
    }
    if (with_mismatch(config)) {
        hg_mismatch_grow(config->mismatch, increase, &row[place]);
        for (uint8_t g = place; g < config->width; g++) {
            increase[g] = difference(row[g], increase[g]);
        }
    }
    for (uint8_t g = 0U; BY_ZONOTOPE(config) && (g < config->generators); g++) {
        hg_zonotope_widen(&self->memory.zonotope[g], lag, 0U, config->width, increase);
    }
}

/* The radii of one group turn out wider, `rewind` samples back. */
static void rewrite(hg_detector *self, uint8_t group, uint8_t first, uint8_t rewind)
{
    const hg_detector_config *config = self->config;
    const uint8_t kept = (uint8_t)(HG_SIZE(HG_ONLY_HISTORY, config->history) - 1U);
    /* What was before the beginning is the initial state's business, which the thresholds hold already. */
    const uint8_t known = (rewind < self->samples) ? rewind : self->samples;
    const uint8_t lags = (known < kept) ? known : kept;
    const bool by_zonotope = BY_ZONOTOPE(config);
    if ((predictors_of(config) == 0U) && (!with_mismatch(config)) && (!by_zonotope)) {
        hg_hold_rewrite(&self->memory.hold[group], &self->radii, first, lags); /* a hull asks for no more than the new radii */
    } else {
        for (uint8_t lag = 1U; lag <= lags; lag++) {
            widen_past(self, group, first, lag);
        }
    }
}

/* Close the sample in every hold; radii of the past are corrected where a loss has just shown. */
static void step_holds(hg_detector *self, hg_evidence *evidence)
{
    const hg_detector_config *config = self->config;
    uint8_t first = 0U;
    /* Sizes again from the tables: they lead every read and write of the rings, and their copies in RAM could be any number. */
    self->radii.width = config->width;
    self->radii.length = config->history;
    if (banks_of(config) > 0U) {
        self->values.width = config->signals;
        self->values.length = config->window;
    }
    self->radius = hg_ring_open(&self->radii);
    for (uint8_t i = 0U; i < groups_of(config); i++) {
        hg_hold *hold = &self->memory.hold[i];
        uint8_t rewind;
        hg_hold_step(hold, &self->value[first], &self->radius[first], &rewind);
        evidence->doubt |= (uint8_t)((hg_hold_doubt(hold) ? 1U : 0U) << i);
        if (rewind > 0U) {
            evidence->rewound |= (uint8_t)(1U << i);
            rewrite(self, i, first, rewind);
        }
        first += HG_SIZE(HG_ONLY_GROUP_SIGNALS, config->hold[i].trigger->width);
    }
    derive(self, evidence->doubt);
    self->samples = (self->samples < UINT8_MAX) ? (uint8_t)(self->samples + 1U) : UINT8_MAX;
}

static void refuse(hg_detector *self)
{
    self->refusals += (self->refusals < UINT32_MAX) ? 1U : 0U;
}

/* Threshold of one generator; has it settled since its start? */
static bool step_threshold(hg_detector *self, uint8_t g, hg_real *J)
{
    if (!BY_ZONOTOPE(self->config)) {
        hg_hull_step(&self->memory.hull[g], &self->radii, J);
        return hg_hull_ready(&self->memory.hull[g]);
    }
    hg_zonotope_step(&self->memory.zonotope[g], &self->radii, J);
    return hg_zonotope_ready(&self->memory.zonotope[g]);
}

/* Residuals and thresholds of the generators. */
static hg_status step_generators(hg_detector *self, hg_evidence *evidence)
{
    hg_status status = HG_OK;
    hg_real *r = self->r;
    hg_real *J = self->J;
    for (uint8_t g = 0U; g < generators_of(self->config); g++) {
        const uint8_t n = HG_SIZE(HG_ONLY_RESIDUALS, self->config->residual[g].residuals);
        const hg_status moved = hg_residual_step(&self->memory.residual[g], self->value, r);
        bool ready = step_threshold(self, g, J);
        if (moved != HG_OK) {
            /* A sample is missing from z for good: only a start anywhere in the range is still true of it. */
            hg_residual_reset(&self->memory.residual[g]);
            reset_threshold(self, g, HG_START_MOVING);
            ready = false;
            refuse(self);
            status = moved;
        } else if (hg_decision_exceeds(r, J, n)) {
            evidence->alarm |= (uint32_t)1U << g;
        } else {
            /* within its threshold */
        }
        evidence->ready = evidence->ready && ready;
        r = &r[n];
        J = &J[n];
    }
    return status;
}

/* Behind the generators' residuals. */
static uint16_t first_of_banks(const hg_detector_config *config)
{
    return (uint16_t)((config->residuals - config->banks) - (HG_STATISTICS * (uint32_t)POLYNOMIALS(config)));
}

/* The same of the banks. A sample that cannot be kept is missing from every window. */
static hg_status step_banks(hg_detector *self, hg_evidence *evidence)
{
    const hg_detector_config *config = self->config;
    const hg_status kept = (banks_of(config) > 0U) ? hg_ring_push(&self->values, self->value) : HG_OK;
    hg_status status = HG_OK;
    for (uint8_t b = 0U; b < banks_of(config); b++) {
        const uint16_t place = (uint16_t)(first_of_banks(config) + b);
        hg_bank *bank = &self->memory.bank[b];
        hg_status judged = kept;
        if (kept == HG_OK) {
            judged = hg_bank_step(bank, &self->values, &self->radii, &self->r[place], &self->J[place]);
        } else {
            hg_bank_reset(bank);
            self->r[place] = HG_REAL_ZERO;
            self->J[place] = config->bank[b].bias[0];
        }
        if (judged == HG_E_NUMERIC) {
            refuse(self);
            status = judged;
        } else if (hg_decision_exceeds(&self->r[place], &self->J[place], 1U)) {
            evidence->alarm |= (uint32_t)1U << ((uint32_t)config->generators + b);
        } else {
            /* within its threshold, or the window is not full */
        }
        evidence->ready = evidence->ready && hg_bank_ready(bank);
    }
    return status;
}

/* And of the polynomial filters. What one has taken in with a radius that was too small it forgets by itself; beginning again would leave it blind for longer. */
static hg_status step_polynomials(hg_detector *self, hg_evidence *evidence)
{
    const hg_detector_config *config = self->config;
    const uint8_t sets = (uint8_t)(config->generators + config->banks);
    hg_status status = HG_OK;
    for (uint8_t p = 0U; (HG_WITH_POLYNOMIAL != 0) && (p < config->polynomials); p++) {
        const uint8_t judge = (uint8_t)(sets + p);
        const uint16_t place = (uint16_t)(first_of_banks(config) + config->banks + (HG_STATISTICS * (uint32_t)p));
        hg_statistic *polynomial = &self->memory.polynomial[p];
        const hg_status moved = hg_statistic_step(polynomial, self->value, self->radius, &self->r[place], &self->J[place]);
        const bool ready = hg_statistic_ready(polynomial);
        if (moved != HG_OK) {
            refuse(self);
            status = moved;
        } else if (ready && hg_decision_exceeds(&self->r[place], &self->J[place], HG_STATISTICS)) {
            evidence->alarm |= (uint32_t)1U << judge;
        } else {
            /* within its thresholds, or not settled */
        }
        evidence->ready = evidence->ready && ready;
    }
    return status;
}

/* What a verdict rests on: bounds where they say as much by themselves. */
static hg_basis basis_of(const hg_detector *self, hg_plant plant)
{
    const uint8_t sets = (uint8_t)(self->config->generators + self->config->banks);
    bool bounded = (sets > 0U) && (plant <= HG_PLANT_NONE);
    for (uint8_t g = 0U; g < sets; g++) {
        bounded = bounded || (self->memory.alarm[g].state == plant);
    }
    return bounded ? HG_BASIS_SET : HG_BASIS_STATISTICAL;
}

hg_status hg_detector_step(hg_detector *self, hg_finding *finding)
{
    hg_evidence evidence = {.alarm = 0U, .ready = true, .doubt = 0U, .rewound = 0U};
    step_holds(self, &evidence);
    const hg_status generators = step_generators(self, &evidence);
    const hg_status banks = step_banks(self, &evidence);
    const hg_status polynomials = step_polynomials(self, &evidence);
    finding->plant = hg_decision_step(&self->decision, &evidence, &finding->candidates);
    finding->basis = basis_of(self, finding->plant);
    const hg_status sets = (generators == HG_OK) ? banks : generators;
    return (sets == HG_OK) ? polynomials : sets;
}
