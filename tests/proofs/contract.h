/** @file
 *  Contracts: what a function of the library asks for and what it gives, each said once.
 *
 *  A large function is proven with stubs (stubs.h) in place of what it calls. A stub asserts requires_X(), writes anything into all that X may write, and assumes
 *  ensures_X(); a proof of X assumes requires_X() of any state and proves ensures_X(). So nothing is assumed anywhere that is not proven elsewhere, and proofs.py looks
 *  whether both sides call the same. What X may write is seen by its proof, too: there its outputs and the parts of its state are memory of their own, so that
 *  anything further is outside of any object; and what a stub leaves of a state as it was stands in ensures_X() or is said there to be unchanged.
 *  state_x() is what holds of a started x between two calls: every start and every step proves it, every step may rely on it. */
#ifndef HULLGUARD_CONTRACT_H
#define HULLGUARD_CONTRACT_H

#include "proof.h"

#include "hullguard/digest.h"
#include "hullguard/tracker.h"
#include "hullguard/selftest.h"

#include <stdlib.h>

/* An array of any content and an object of its own, of exactly this length: tables and memory of a proof. */
#define any_array(type, count) ((type *)malloc(sizeof(type) * (count)))

/* So many things can be read, or read and written, there; of none nothing is asked. */
#define readable(pointer, count) (((count) == 0U) || __CPROVER_r_ok((pointer), (count) * sizeof(*(pointer))))
#define writable(pointer, count) (((count) == 0U) || __CPROVER_rw_ok((pointer), (count) * sizeof(*(pointer))))

/* ---- ring.h ---- */

static inline bool state_ring(const hg_ring *self)
{
    return (self->width >= 1U) && (self->length >= 1U) && (self->newest < self->length) && writable(self->data, HG_RING_REALS(self->width, self->length));
}

/* ---- hold.h ---- */

static inline bool state_hold(const hg_hold *self)
{
    const hg_trigger_config *trigger = self->config->trigger;
    const uint8_t width = trigger->width;
    return (self->good <= 2U) && (self->level < trigger->levels) && (self->silence < trigger->interval_max) && (self->seen || (self->holes && (self->age == UINT8_MAX))) &&
           ((!self->fresh) || (self->seen && (self->good >= 1U))) && ((!self->gap) || (self->seen && (self->gap_age >= 1U))) &&
           /* Doubt is of silence within interval_max after a good frame, and of nothing older. */
           ((!self->doubt) || (self->seen && (self->age >= 1U) && (self->age < trigger->interval_max))) && writable(self->sent, width) && writable(self->previous, width) &&
           writable(self->value, width) && writable(self->promise, width);
}

/* Its memory as hg_hold_start() was given it: begun again, it takes it so. */
static inline bool whole_hold(const hg_hold *self)
{
    const uint8_t width = self->config->trigger->width;
    return (self->previous == &self->sent[width]) && (self->promise == &self->value[width]) && writable(self->sent, HG_HOLD_CODES(width)) && writable(self->value, HG_HOLD_REALS(width));
}

static inline bool kept_hold(const hg_hold *self, const hg_hold *before)
{
    return (self->config == before->config) && (self->sent == before->sent) && (self->previous == before->previous) && (self->value == before->value) && (self->promise == before->promise);
}

static inline bool requires_hold_start(const hg_hold_config *config, const int32_t *codes, const hg_real *reals)
{
    /* Nothing of a table that is not there; else as many numbers as its sizes say. */
    return (config->trigger == NULL) || (!hg_trigger_valid(config->trigger)) || (writable(codes, HG_HOLD_CODES(config->trigger->width)) && writable(reals, HG_HOLD_REALS(config->trigger->width)));
}

static inline bool ensures_hold_start(const hg_hold *self, const hg_hold *before, const hg_hold_config *config, const int32_t *codes, const hg_real *reals, hg_status status)
{
    if (status != HG_OK) { /* nothing has changed */
        return (status == HG_E_CONFIG) && kept_hold(self, before) && (self->age == before->age) && (self->good == before->good) && (self->level == before->level) &&
               (self->silence == before->silence) && (self->holes == before->holes) && (self->seen == before->seen) && (self->recovering == before->recovering) &&
               (self->fresh == before->fresh) && (self->lost == before->lost) && (self->doubt == before->doubt) && (self->gap == before->gap) && (self->gap_age == before->gap_age);
    }
    const uint8_t width = config->trigger->width;
    return (self->config == config) && hg_trigger_valid(config->trigger) && (self->sent == codes) && (self->previous == &codes[width]) && (self->value == reals) &&
           (self->promise == &reals[width]) && state_hold(self) && (!self->fresh);
}

static inline bool requires_hold_receive(const hg_hold *self, const int32_t *code)
{
    return state_hold(self) && readable(code, self->config->trigger->width);
}

static inline bool ensures_hold_receive(const hg_hold *self, const hg_hold *before, hg_status status)
{
    return kept_hold(self, before) && state_hold(self) && (status == (before->fresh ? HG_E_REPEATED : HG_OK)) && self->fresh;
}

static inline bool requires_hold_step(const hg_hold *self, const hg_real *value, const hg_real *radius, const uint8_t *rewind)
{
    const uint8_t width = self->config->trigger->width;
    return state_hold(self) && writable(value, width) && writable(radius, width) && writable(rewind, 1U);
}

static inline bool ensures_hold_step(const hg_hold *self, const hg_hold *before, uint8_t rewind)
{
    /* Rewound no further than the sender may have been silent: hg_hold_past() reads the slew's table for it. */
    const bool known = (rewind == 0U) || ((self->gap_age == (rewind + 1U)) && (self->gap_age <= self->config->trigger->interval_max));
    return kept_hold(self, before) && state_hold(self) && (!self->fresh) && known;
}

static inline bool requires_hold_past(const hg_hold *self, uint8_t lag, const hg_real *radius)
{
    return state_hold(self) && (lag >= 1U) && (lag < self->gap_age) && (self->gap_age <= self->config->trigger->interval_max) && writable(radius, self->config->trigger->width);
}

static inline bool requires_hold_rewrite(const hg_hold *self, const hg_ring *ring, uint8_t first, uint8_t lags)
{
    return state_hold(self) && state_ring(ring) && ((first + self->config->trigger->width) <= ring->width) && (lags < ring->length) &&
           (lags < self->gap_age) && (self->gap_age <= self->config->trigger->interval_max);
}

/* ---- predict.h, mismatch.h ---- */

static inline bool state_predict(const hg_predict *self)
{
    const hg_predict_config *config = self->config;
    return writable(self->x, config->order) && writable(self->next, config->order) && writable(self->u, config->inputs) && writable(self->y, config->width);
}

/* x and its scratch change places. */
static inline bool kept_predict(const hg_predict *self, const hg_predict *before)
{
    const bool same = (self->x == before->x) && (self->next == before->next);
    const bool swapped = (self->x == before->next) && (self->next == before->x);
    return (self->config == before->config) && (same || swapped) && (self->u == before->u) && (self->y == before->y);
}

static inline bool requires_predict_reset(const hg_predict *self)
{
    return state_predict(self);
}

static inline bool ensures_predict_reset(const hg_predict *self, const hg_predict *before)
{
    return kept_predict(self, before) && (self->x == before->x) && (!self->sure);
}

static inline bool requires_predict_step(const hg_predict *self, const hg_real *value, const hg_real *radius, const hg_real *out_value, const hg_real *out_radius)
{
    const hg_predict_config *config = self->config;
    const uint32_t end = (uint32_t)config->first + config->width;
    bool there = state_predict(self) && hg_predict_valid(config, UINT8_MAX) && readable(value, end) && readable(radius, end);
    for (uint8_t i = 0U; i < config->inputs; i++) {
        there = there && readable(&value[config->input[i]], 1U) && readable(&radius[config->input[i]], 1U);
    }
    return there && writable(out_value, config->width) && writable(out_radius, config->width);
}

static inline bool ensures_predict_step(const hg_predict *self, const hg_predict *before)
{
    return kept_predict(self, before) && state_predict(self);
}

static inline bool requires_mismatch_grow(const hg_mismatch_config *config, const hg_real *increase, const hg_real *out)
{
    bool there = hg_mismatch_valid(config, UINT8_MAX) && writable(out, config->states);
    for (uint8_t g = 0U; (config->states > 0U) && (g < config->width); g++) {
        there = there && readable(&increase[config->signal[g]], 1U);
    }
    return there;
}

static inline bool requires_mismatch_step(const hg_mismatch_config *config, const hg_real *value, const hg_real *radius, const hg_real *out)
{
    return requires_mismatch_grow(config, value, out) && requires_mismatch_grow(config, radius, out);
}

/* ---- residual.h ---- */

static inline bool state_residual(const hg_residual *self)
{
    const hg_residual_config *config = self->config;
    return hg_residual_valid(config) && writable(self->z, config->order) && writable(self->next, config->order) && writable(self->input, config->width);
}

static inline bool requires_residual_reset(const hg_residual *self)
{
    return writable(self->z, self->config->order);
}

static inline bool requires_residual_step(const hg_residual *self, const hg_real *value, const hg_real *r)
{
    const hg_residual_config *config = self->config;
    bool there = state_residual(self) && writable(r, config->residuals);
    for (uint8_t g = 0U; g < config->width; g++) {
        there = there && readable(&value[config->signal[g]], 1U);
    }
    return there;
}

static inline bool ensures_residual_step(const hg_residual *self, const hg_residual *before, hg_status status)
{
    const bool same = (self->z == before->z) && (self->next == before->next);
    const bool swapped = (self->z == before->next) && (self->next == before->z);
    return ((status == HG_OK) || (status == HG_E_NUMERIC)) && (self->config == before->config) && ((status == HG_OK) ? swapped : same) && (self->input == before->input);
}

/* ---- hull.h, zonotope.h ---- */

static inline bool requires_hull_reset(const hg_hull *self)
{
    return writable(self->theta, self->config->residuals) && writable(self->mode, self->config->modes);
}

static inline bool ensures_hull_reset(const hg_hull *self, const hg_hull *before)
{
    return (self->config == before->config) && (self->theta == before->theta) && (self->mode == before->mode) && (self->k == 0U);
}

static inline bool requires_hull_step(const hg_hull *self, const hg_ring *ring, const hg_real *J)
{
    return state_ring(ring) && hg_hull_valid(self->config, ring->width, ring->length) && requires_hull_reset(self) && writable(J, self->config->residuals);
}

static inline bool ensures_hull_step(const hg_hull *self, const hg_hull *before)
{
    return (self->config == before->config) && (self->theta == before->theta) && (self->mode == before->mode) && (self->how == before->how) &&
           (self->k == ((before->k < UINT16_MAX) ? (before->k + 1U) : UINT16_MAX));
}

#if HG_WITH_ZONOTOPE
static inline bool requires_zonotope_reset(const hg_zonotope *self)
{
    const hg_zonotope_config *config = self->config;
    const uint32_t most = (uint32_t)config->columns + config->width + config->disturbances;
    return writable(self->column, most * config->order) && writable(self->score, most) && writable(self->spread, config->order) && writable(self->scratch, config->order);
}

static inline bool state_zonotope(const hg_zonotope *self, uint8_t signals)
{
    return hg_zonotope_valid(self->config, signals) && requires_zonotope_reset(self) && (self->count <= self->config->columns);
}

static inline bool ensures_zonotope(const hg_zonotope *self, const hg_zonotope *before)
{
    return (self->config == before->config) && (self->column == before->column) && (self->score == before->score) && (self->spread == before->spread) &&
           (self->scratch == before->scratch) && (self->count <= self->config->columns);
}

static inline bool requires_zonotope_widen(const hg_zonotope *self, uint8_t count, const hg_real *increase)
{
    return state_zonotope(self, UINT8_MAX) && readable(increase, count);
}

static inline bool requires_zonotope_step(const hg_zonotope *self, const hg_ring *ring, const hg_real *J)
{
    return state_ring(ring) && state_zonotope(self, ring->width) && writable(J, self->config->residuals);
}
#endif

/* ---- bank.h ---- */

static inline bool requires_bank_reset(const hg_bank *self)
{
    return writable(self->sum, HG_BANK_SUMS(self->config->certificates));
}

static inline bool ensures_bank_reset(const hg_bank *self, const hg_bank *before)
{
    return (self->config == before->config) && (self->sum == before->sum) && (self->k == 0U) && (self->closest == 0U);
}

static inline bool requires_bank_step(const hg_bank *self, const hg_ring *value, const hg_ring *radius, const hg_real *r, const hg_real *J)
{
    return state_ring(value) && state_ring(radius) && hg_bank_valid(self->config, value->width, radius->width, value->length) && (self->config->window <= radius->length) &&
           requires_bank_reset(self) && writable(r, 1U) && writable(J, 1U);
}

static inline bool ensures_bank_step(const hg_bank *self, const hg_bank *before, hg_status status)
{
    return (self->config == before->config) && (self->sum == before->sum) && (self->k <= self->config->window) && (self->closest < self->config->certificates) &&
           ((status == HG_OK) || (status == HG_E_EMPTY) || (status == HG_E_NUMERIC));
}

/* ---- polynomial.h ---- */

#if HG_WITH_POLYNOMIAL
/* Every part has as many numbers as the tables say. */
static inline bool started_polynomial(const hg_polynomial *self)
{
    const hg_polynomial_config *config = self->config;
    const uint32_t n = config->states;
    const uint32_t p = config->outputs;
    const uint32_t wide = (uint32_t)config->lifted + 1U;
    const uint32_t rows = (uint32_t)config->lifted + config->measured;
    bool there = writable(self->x, n) && writable(self->Px, n * n) && writable(self->ekf, n) && writable(self->c, n) && writable(self->Pe, n * n) && writable(self->z, wide);
    there = there && writable(self->P, HG_POLYNOMIAL_HALF(wide - 1U)) && writable(self->M, HG_POLYNOMIAL_HALF(wide)) && writable(self->mean, p) && writable(self->eta, p);
    there = there && writable(self->radius, p) && writable(self->width, p) && writable(self->L, n * p) && writable(self->slack, rows) && writable(self->weigh, rows) &&
            writable(self->next, wide);
    return there && writable(self->root, (uint32_t)config->measured * config->measured) && writable(self->poly, rows * config->ring) && writable(self->shift, n * config->ring) &&
           writable(self->term, config->ring);
}

static inline bool requires_polynomial_step(const hg_polynomial *self, const hg_real *y, const hg_real *radius)
{
    return hg_polynomial_valid(self->config) && started_polynomial(self) && readable(y, self->config->outputs) && readable(radius, self->config->outputs);
}

static inline bool ensures_polynomial_step(const hg_polynomial *self, const hg_polynomial *before, hg_status status)
{
    return ((status == HG_OK) || (status == HG_E_NUMERIC)) && (self->config == before->config) && (self->x == before->x) && (self->c == before->c) && (self->P == before->P) &&
           (self->poly == before->poly) && (self->term == before->term);
}
static inline bool requires_polynomial_reset(const hg_polynomial *self)
{
    return hg_polynomial_valid(self->config) && started_polynomial(self);
}

/* ---- statistic.h ---- */

static inline bool started_statistic(const hg_statistic *self)
{
    const hg_statistic_config *config = self->config;
    return hg_statistic_valid(config, UINT8_MAX) && (self->filter.config == &config->filter) && started_polynomial(&self->filter) && writable(self->y, config->filter.outputs) &&
           writable(self->radius, config->filter.outputs);
}

static inline bool requires_statistic_step(const hg_statistic *self, const hg_real *value, const hg_real *radius, const hg_real *r, const hg_real *J)
{
    const hg_statistic_config *config = self->config;
    bool there = started_statistic(self) && writable(r, HG_STATISTICS) && writable(J, HG_STATISTICS);
    for (uint8_t j = 0U; j < config->filter.outputs; j++) {
        there = there && readable(&value[config->signal[j]], 1U) && readable(&radius[config->signal[j]], 1U);
    }
    for (uint8_t i = 0U; i < config->inputs; i++) {
        there = there && readable(&value[config->input[i]], 1U) && readable(&radius[config->input[i]], 1U);
    }
    return there;
}

static inline bool ensures_statistic_reset(const hg_statistic *self, const hg_statistic *before)
{
    return (self->config == before->config) && (self->y == before->y) && (self->radius == before->radius) && (self->samples == 0U) && started_statistic(self);
}

static inline bool ensures_statistic_step(const hg_statistic *self, const hg_statistic *before, hg_status status)
{
    return ((status == HG_OK) || (status == HG_E_NUMERIC)) && (self->config == before->config) && (self->y == before->y) && (self->radius == before->radius) && started_statistic(self);
}
#endif

/* ---- detector.h ---- */

/* Places of group i's signals in the vector: from here on. */
static inline uint32_t first_of(const hg_detector_config *config, uint8_t group)
{
    uint32_t first = 0U;
    for (uint8_t i = 0U; i < group; i++) {
        first += config->hold[i].trigger->width;
    }
    return first;
}

/* What hg_detector_start() accepts, of groups and what is derived from their signals, */
static inline bool valid_signals(const hg_detector_config *config)
{
    uint32_t width = config->signals;
    bool valid = (config->groups >= 1U) && (config->groups <= HG_GROUPS_MAX) && (config->history >= 1U) && (first_of(config, config->groups) == config->signals);
    for (uint8_t i = 0U; i < config->predictors; i++) {
        const hg_predict_config *predict = &config->predict[i];
        valid = valid && (predict->group < config->groups) && hg_predict_valid(predict, config->signals) && (predict->first == first_of(config, predict->group)) &&
                (predict->width == config->hold[predict->group].trigger->width);
        width += predict->width;
    }
    if (config->mismatch != NULL) {
        valid = valid && hg_mismatch_valid(config->mismatch, config->signals);
        width += config->mismatch->states;
    }
    return valid && (width == config->width);
}

/* and of generators and banks. */
static inline bool valid_judges(const hg_detector_config *config)
{
    uint32_t residuals = config->banks + (HG_STATISTICS * (uint32_t)config->polynomials);
    bool valid = (((uint32_t)config->generators + config->banks + config->polynomials) == config->decision.generators) && (config->decision.generators <= HG_GENERATORS_MAX);
    for (uint8_t g = 0U; g < config->generators; g++) {
        const hg_residual_config *residual = &config->residual[g];
        valid = valid && hg_residual_valid(residual);
        for (uint8_t i = 0U; valid && (i < residual->width); i++) {
            valid = residual->signal[i] < config->width;
        }
        if (config->hull != NULL) {
            valid = valid && hg_hull_valid(&config->hull[g], config->width, config->history) && (config->hull[g].residuals == residual->residuals);
        }
#if HG_WITH_ZONOTOPE
        if (config->hull == NULL) {
            valid = valid && hg_zonotope_valid(&config->zonotope[g], config->width) && (config->zonotope[g].residuals == residual->residuals);
        }
#endif
        residuals += residual->residuals;
    }
#if HG_WITH_POLYNOMIAL
    for (uint8_t p = 0U; p < config->polynomials; p++) {
        valid = valid && hg_statistic_valid(&config->polynomial[p], config->signals);
    }
#endif
    for (uint8_t b = 0U; b < config->banks; b++) {
        valid = valid && (config->bank[b].window <= config->history) && hg_bank_valid(&config->bank[b], config->signals, config->width, config->window);
    }
    return valid && (residuals == config->residuals);
}

/* Where a detector's own numbers are, and that its rings are in step with its tables. */
static inline bool state_detector(const hg_detector *self)
{
    const hg_detector_config *config = self->config;
    bool there = writable(self->value, config->width) && writable(self->r, config->residuals) && writable(self->J, config->residuals) && writable(self->past, config->width);
    there = there && writable(self->radius, config->width) && state_ring(&self->radii) && (self->radii.width == config->width) && (self->radii.length == config->history);
    return there && ((config->banks == 0U) || (state_ring(&self->values) && (self->values.width == config->signals) && (self->values.length == config->window)));
}

/* All of a started detector, parts and tables: what its step needs, and what start, step and restart leave. */
static inline bool started_detector(const hg_detector *self)
{
    const hg_detector_config *config = self->config;
    const hg_detector_memory *part = &self->memory;
    bool started = valid_signals(config) && valid_judges(config) && state_detector(self) && writable(part->alarm, config->decision.generators) && (self->decision.alarm == part->alarm);
    for (uint8_t i = 0U; i < config->groups; i++) {
        started = started && (part->hold[i].config == &config->hold[i]) && state_hold(&part->hold[i]) && whole_hold(&part->hold[i]);
    }
    for (uint8_t i = 0U; i < config->predictors; i++) {
        started = started && (part->predict[i].config == &config->predict[i]) && state_predict(&part->predict[i]);
    }
    for (uint8_t g = 0U; g < config->generators; g++) {
        started = started && (part->residual[g].config == &config->residual[g]) && state_residual(&part->residual[g]);
        if (config->hull != NULL) {
            started = started && (part->hull[g].config == &config->hull[g]) && requires_hull_reset(&part->hull[g]);
        }
#if HG_WITH_ZONOTOPE
        if (config->hull == NULL) {
            started = started && (part->zonotope[g].config == &config->zonotope[g]) && state_zonotope(&part->zonotope[g], config->width);
        }
#endif
    }
#if HG_WITH_POLYNOMIAL
    for (uint8_t p = 0U; p < config->polynomials; p++) {
        started = started && (part->polynomial[p].config == &config->polynomial[p]) && started_statistic(&part->polynomial[p]);
    }
#endif
    for (uint8_t b = 0U; b < config->banks; b++) {
        started = started && (part->bank[b].config == &config->bank[b]) && requires_bank_reset(&part->bank[b]);
    }
    return started;
}

static inline bool requires_detector_receive(const hg_detector *self, uint8_t group, const int32_t *code)
{
    return started_detector(self) && ((group >= self->config->groups) || readable(code, self->config->hold[group].trigger->width));
}

static inline bool ensures_detector_receive(const hg_detector *self, uint8_t group, hg_status status)
{
    if (group >= self->config->groups) {
        return status == HG_E_ARGUMENT;
    }
    return ((status == HG_OK) || (status == HG_E_REPEATED) || (status == HG_E_NUMERIC)) && state_hold(&self->memory.hold[group]);
}

static inline bool ensures_detector_restart(const hg_detector *self, const hg_detector *before)
{
    return (self->samples == 0U) && (self->beginnings == (uint32_t)(before->beginnings + 1U)) && (self->refusals == before->refusals);
}

static inline bool ensures_detector_step(const hg_detector *self, const hg_detector *before, const hg_finding *finding, hg_status status)
{
    return ((status == HG_OK) || (status == HG_E_NUMERIC)) && (finding->plant <= HG_PLANT_CONFIRMED) && ((finding->basis == HG_BASIS_SET) || (finding->basis == HG_BASIS_STATISTICAL)) &&
           (self->beginnings == before->beginnings) && (self->radii.newest < self->radii.length) && (self->radius == &self->radii.data[(uint16_t)self->radii.newest * self->radii.width]);
}

/* ---- e2e.h, frame.h ---- */

static inline bool requires_e2e_check(const hg_e2e_config *config, const uint8_t *data, uint8_t length, const hg_e2e_header *header)
{
    const bool listed = (config->profile == HG_E2E_P02) || (config->profile == HG_E2E_P22);
    return (config->profile >= HG_E2E_NONE) && (config->profile <= HG_E2E_P22) && ((!listed) || readable(config->data_ids, HG_E2E_IDS)) && readable(data, length) && writable(header, 1U);
}

static inline bool ensures_e2e_check(const hg_e2e_config *config, const hg_e2e_header *header, hg_status status)
{
    return (status == HG_E_CRC) || (status == HG_E_FORMAT) || ((status == HG_OK) && (header->counter < hg_e2e_modulus(config)) && (header->stamp <= 15U));
}

static inline bool requires_frame_matches(const hg_message *message, const hg_can_frame *frame)
{
    return readable(message, 1U) && readable(frame, 1U);
}

static inline bool ensures_frame_matches(const hg_message *message, const hg_can_frame *frame, bool matches)
{
    return (!matches) || ((frame->id == message->id) && (frame->length == message->length));
}

static inline bool requires_frame_unpack(const hg_message *message, const hg_can_frame *frame, const int32_t *code)
{
    return hg_frame_valid(message) && readable(frame, 1U) && writable(code, message->width);
}

static inline bool ensures_frame_unpack(hg_status status)
{
    return (status == HG_OK) || (status == HG_E_FORMAT) || (status == HG_E_NUMERIC);
}

/* ---- node.h ---- */

/* Of a node between two calls: its links and its clock. */
static inline bool state_node(const hg_node *self)
{
    const hg_node_config *config = self->config;
    const uint16_t modulus = hg_e2e_modulus(config->message[config->closing].e2e);
    bool in_range = (self->due <= 8U) && (self->ahead_max <= 7U) && (self->closing_counter < modulus) && (self->slipped_counter < modulus) && (self->slipped_stamp <= 15U) &&
                    (self->verdict_counter <= 15U) && (self->status_counter <= 15U) && (config->closing < config->detector->groups) &&
                    writable(self->closing, config->message[config->closing].width) && (self->detector.config == config->detector);
    for (uint8_t i = 0U; i < config->detector->groups; i++) {
        in_range = in_range && writable(&self->link[i], 1U) && (self->link[i].receiver.counter < hg_e2e_modulus(config->message[i].e2e));
    }
    return in_range;
}

/* ---- linalg.h ---- */

/* It ends, with any number. */
static inline bool ensures_linalg_root(hg_real y)
{
    return (y <= HG_REAL_ZERO) || (y >= HG_REAL_ZERO) || (y != y);
}

/* ---- fusion.h ---- */

#if HG_REAL_F32 || HG_REAL_F64
/* Of one sensor between two calls, its last update's record and its loss rate, which chooses a row of the tables. */
static inline bool state_fusion_sensor(const hg_fusion *self, uint8_t i)
{
    const hg_fusion_sensor *sensor = &self->sensor[i];
    return writable(sensor, 1U) && writable(&self->record[i], 1U) && writable(self->record[i].gain, self->config->states) && (sensor->loss >= HG_REAL_ZERO) &&
           (sensor->loss <= HG_REAL_C(1.0)) && (sensor->counter < self->config->modulus);
}

/* Of the place of one sample: one that is held knows its table, and counters of values are in range. */
static inline bool state_fusion_slot(const hg_fusion *self, uint8_t place)
{
    const hg_fusion_config *config = self->config;
    const hg_fusion_slot *slot = &self->slot[place];
    const uint32_t n = config->states;
    const uint8_t back = (uint8_t)((self->newest >= place) ? (self->newest - place) : ((self->newest + config->depth + 1U) - place));
    bool known = back >= self->held;
    for (uint8_t t = 0U; t < config->tables; t++) {
        known = known || (slot->table == &config->table[t]);
    }
    known = known && writable(slot->x, n) && writable(slot->P, n * n) && writable(slot->shift, n) && writable(slot->u, config->inputs) && writable(slot->entry, config->sensors);
    for (uint8_t i = 0U; known && (back < self->held) && (i < config->sensors); i++) {
        known = slot->entry[i].counter < config->modulus;
    }
    return known;
}

static inline bool started_fusion(const hg_fusion *self)
{
    const hg_fusion_config *config = self->config;
    const uint32_t n = config->states;
    bool started = hg_fusion_valid(config) && (self->newest <= config->depth) && (self->held <= (config->depth + 1U)) && ((!self->open) || (self->held >= 1U));
    started = started && writable(self->origin, n) && writable(self->x, n) && writable(self->P, n * n) && writable(self->ahead, n) && writable(self->wide, n * n) &&
              writable(self->product, n * n) && writable(self->g, n) && writable(self->next, n) && writable(self->move, n);
    for (uint8_t l = 0U; started && (l <= config->depth); l++) {
        started = state_fusion_slot(self, l);
    }
    for (uint8_t i = 0U; started && (i < config->sensors); i++) {
        started = state_fusion_sensor(self, i);
    }
    return started;
}

/* Where its parts are. */
static inline bool kept_fusion(const hg_fusion *self, const hg_fusion *before)
{
    return (self->config == before->config) && (self->slot == before->slot) && (self->sensor == before->sensor) && (self->record == before->record) && (self->origin == before->origin) &&
           (self->x == before->x) && (self->P == before->P) && (self->next == before->next);
}

static inline bool requires_fusion_sensor(const hg_fusion *self, uint8_t i)
{
    return started_fusion(self) && (i < self->config->sensors);
}

/* Its tables' sizes are those that the library is made for: what is written for one sensor or state has a bit, or a place, for each. */
static inline bool ensures_fusion_valid(const hg_fusion_config *config, bool valid)
{
    return (!valid) || ((config->states >= 1U) && (config->states <= HG_FUSION_STATES_MAX) && (config->sensors >= 1U) && (config->sensors <= HG_FUSION_SENSORS_MAX) &&
                        (config->modulus >= 2U) && (config->modulus <= 256U) && (config->depth <= 14U) && (config->heartbeat >= 1U));
}

/* Memory as the tables' sizes say, if there are any that fit one another. */
static inline bool requires_fusion_start(const hg_fusion_config *config, const hg_fusion_memory *memory)
{
    const uint32_t places = (uint32_t)config->depth + 1U;
    return (!hg_fusion_valid(config)) ||
           (writable(memory->slot, places) && writable(memory->entry, places * config->sensors) && writable(memory->sensor, config->sensors) && writable(memory->record, config->sensors) &&
            writable(memory->origin, config->states) && writable(memory->real, HG_FUSION_REALS(config->states, config->inputs, config->sensors, config->depth)));
}

/* Where the parts of a filter have their numbers, one after another, none twice: of a sample, the filter's own behind those of all samples, of a sensor's record behind them. */
static inline hg_fusion_slot laid_slot(const hg_fusion_config *config, const hg_fusion_memory *memory, uint8_t place)
{
    const uint32_t n = config->states;
    hg_real *real = &memory->real[place * ((n * (n + 2U)) + config->inputs)];
    return (hg_fusion_slot){.x = real, .P = &real[n], .shift = &real[n + (n * n)], .u = &real[n * (n + 2U)], .entry = &memory->entry[(uint32_t)place * config->sensors]};
}

static inline hg_fusion laid_fusion(const hg_fusion_config *config, const hg_fusion_memory *memory)
{
    const uint32_t n = config->states;
    hg_real *real = &memory->real[(config->depth + 1U) * ((n * (n + 2U)) + config->inputs)];
    return (hg_fusion){.config = config, .slot = memory->slot, .sensor = memory->sensor, .record = memory->record, .origin = memory->origin, .x = real, .ahead = &real[n], .g = &real[2U * n],
                       .next = &real[3U * n], .move = &real[4U * n], .P = &real[5U * n], .wide = &real[(5U + n) * n], .product = &real[(5U + (2U * n)) * n]};
}

static inline hg_real *laid_gain(const hg_fusion *laid, uint8_t i)
{
    const uint32_t n = laid->config->states;
    return &laid->product[(n + i) * n];
}

static inline bool placed_fusion(const hg_fusion *self, const hg_fusion_memory *memory)
{
    const hg_fusion_config *config = self->config;
    const hg_fusion laid = laid_fusion(config, memory);
    bool fits = (self->slot == laid.slot) && (self->sensor == laid.sensor) && (self->record == laid.record) && (self->origin == laid.origin) && (self->x == laid.x) &&
                (self->ahead == laid.ahead) && (self->g == laid.g) && (self->next == laid.next) && (self->move == laid.move) && (self->P == laid.P) && (self->wide == laid.wide) &&
                (self->product == laid.product);
    for (uint8_t l = 0U; l <= config->depth; l++) {
        const hg_fusion_slot *slot = &self->slot[l];
        const hg_fusion_slot own = laid_slot(config, memory, l);
        fits = fits && (slot->x == own.x) && (slot->P == own.P) && (slot->shift == own.shift) && (slot->u == own.u) && (slot->entry == own.entry);
    }
    for (uint8_t i = 0U; i < config->sensors; i++) {
        fits = fits && (self->record[i].gain == laid_gain(&laid, i));
    }
    return fits;
}

static inline bool ensures_fusion_start(const hg_fusion *self, const hg_fusion_config *config, const hg_fusion_memory *memory, hg_status status)
{
    if (!hg_fusion_valid(config)) {
        return status == HG_E_CONFIG;
    }
    return (status == HG_OK) && (self->config == config) && placed_fusion(self, memory) && started_fusion(self) && (self->held == 0U) && (!self->open);
}

static inline bool ensures_fusion_reset(const hg_fusion *self, const hg_fusion *before)
{
    return started_fusion(self) && kept_fusion(self, before) && (self->held == 0U) && (!self->open) && (self->k == UINT32_MAX);
}

static inline bool ensures_fusion_open(const hg_fusion *self, const hg_fusion *before, hg_status status)
{
    return started_fusion(self) && kept_fusion(self, before) && self->open && (status == (before->open ? HG_E_BUSY : HG_OK)) &&
           (self->k == (uint32_t)(before->k + (before->open ? 0U : 1U)));
}

static inline bool ensures_fusion_due(const hg_fusion *self, hg_status status)
{
    return (status == HG_OK) || (status == HG_E_EMPTY) || (status == HG_E_NUMERIC) || ((status == HG_E_STATE) && (!self->open));
}

static inline bool ensures_fusion_receive(const hg_fusion *self, const hg_fusion *before, hg_status status)
{
    return started_fusion(self) && kept_fusion(self, before) && (self->open == before->open) && (self->k == before->k) &&
           ((status == HG_OK) || (status == HG_E_STAMP) || (status == HG_E_REPEATED) || (status == HG_E_NUMERIC));
}

static inline bool ensures_fusion_close(const hg_fusion *self, const hg_fusion *before, hg_status status)
{
    const bool done = (status == HG_OK) || ((status == HG_E_NUMERIC) && (self->held == 0U));
    return started_fusion(self) && kept_fusion(self, before) && (!self->open) && (self->k == before->k) && (before->open ? done : (status == HG_E_STATE));
}

/* ---- consistency.h ---- */

/* Its memory, and of the filter what it reads. */
static inline bool requires_consistency_reset(const hg_consistency *self)
{
    const uint32_t n = self->fusion->config->states;
    const uint8_t m = self->fusion->config->sensors;
    const uint8_t onsets = self->config->onsets;
    const uint32_t sums = (uint32_t)onsets * m;
    bool there = (onsets >= 1U) && readable(self->config->least, m) && writable(self->sum, sums) && writable(self->sensor, m) && writable(self->f, sums * n) && writable(self->next, n);
    for (uint8_t i = 0U; there && (i < m); i++) {
        there = readable(&self->fusion->record[i], 1U) && readable(self->fusion->record[i].gain, n);
    }
    return there;
}

static inline bool state_consistency(const hg_consistency *self)
{
    const uint8_t m = self->fusion->config->sensors;
    return requires_consistency_reset(self) && (self->onset < self->config->onsets) && (self->leader < m) && ((self->blamed >> m) == 0U);
}

static inline bool kept_consistency(const hg_consistency *self, const hg_consistency *before)
{
    return (self->config == before->config) && (self->fusion == before->fusion) && (self->sum == before->sum) && (self->sensor == before->sensor) && (self->f == before->f) &&
           (self->next == before->next);
}

/* Memory as the tables' sizes say, if they have any, and a filter's records. */
static inline bool requires_consistency_start(const hg_consistency_config *config, const hg_fusion *fusion, const hg_consistency_memory *memory)
{
    const uint8_t m = fusion->config->sensors;
    const uint32_t n = fusion->config->states;
    bool there = (config->least == NULL) || readable(config->least, m);
    for (uint8_t i = 0U; there && (i < m); i++) {
        there = readable(&fusion->record[i], 1U) && readable(fusion->record[i].gain, n);
    }
    return there && writable(memory->sum, (uint32_t)config->onsets * m) && writable(memory->sensor, m) && writable(memory->real, HG_CONSISTENCY_REALS(n, m, config->onsets));
}

static inline bool ensures_consistency_start(const hg_consistency *self, const hg_consistency_config *config, const hg_fusion *fusion, const hg_consistency_memory *memory, hg_status status)
{
    if (status != HG_OK) {
        return status == HG_E_CONFIG;
    }
    return (self->config == config) && (self->fusion == fusion) && (self->sum == memory->sum) && (self->sensor == memory->sensor) && (self->next == memory->real) &&
           (self->f == &memory->real[fusion->config->states]) && state_consistency(self);
}

static inline bool ensures_consistency_reset(const hg_consistency *self, const hg_consistency *before)
{
    return kept_consistency(self, before) && state_consistency(self) && (self->blamed == 0U);
}

static inline bool requires_consistency_step(const hg_consistency *self)
{
    return state_consistency(self);
}

static inline bool ensures_consistency_step(const hg_consistency *self, const hg_consistency *before, uint16_t blamed)
{
    return kept_consistency(self, before) && state_consistency(self) && (blamed == self->blamed);
}

/* ---- tracker.h ---- */

/* Between two calls a sample is open, and links, clock and judgement are as the filter's. */
static inline bool started_tracker(const hg_tracker *self)
{
    const hg_tracker_config *config = self->config;
    const hg_fusion_config *fusion = config->fusion;
    bool started = (config->heartbeat >= 1U) && (config->interval >= 1U) && (self->fusion.config == fusion) && started_fusion(&self->fusion) && self->fusion.open;
    started = started && writable(self->value, fusion->states) && writable(self->deviation, fusion->states) && (self->due <= 8U) && (self->ahead_max <= 7U) &&
              (self->slipped_counter < fusion->modulus) && (self->slipped_stamp <= 15U) && (self->verdict_counter <= 15U) && (self->status_counter <= 15U);
    for (uint8_t i = 0U; started && (i <= fusion->sensors); i++) {
        started = writable(&self->link[i], 1U) && (self->link[i].receiver.counter < fusion->modulus);
    }
    const hg_consistency *judge = &self->consistency;
    return started && ((config->consistency == NULL) || ((judge->config == config->consistency) && (judge->fusion == &self->fusion) && state_consistency(judge)));
}
#endif

/* ---- crc32c.h, digest.h ---- */

static inline bool requires_crc32c(uint8_t bytes)
{
    return bytes <= 4U;
}

/* A table that is there holds as many numbers as are taken. */
#define requires_digest(x, count) (((x) == NULL) || readable((x), (count)))

/* No number is taken twice, none is passed over twice, and no more are taken than there is room for. */
static inline bool ensures_digest(const hg_digest *self, const hg_digest *before, bool there, uint32_t count)
{
    const uint32_t length = there ? count : 0U;
    const uint32_t passed = before->skip - self->skip;
    const uint32_t taken = before->left - self->left;
    return (self->skip <= before->skip) && (self->left <= before->left) && (self->done == (uint32_t)(before->done + taken)) && (passed <= length) && (taken <= (length - passed)) &&
           ((taken == 0U) || (self->skip == 0U)) && (((passed + taken) == length) || (self->left == 0U) || (self->skip > 0U));
}

/* ---- freeze.h ---- */

static inline bool requires_freeze(const hg_freeze *self)
{
    const hg_freeze_config *config = self->config;
    const hg_detector *detector = self->detector;
    const uint32_t reals = HG_FREEZE_REALS(detector->config->width, detector->config->residuals);
    return state_detector(detector) && (config->samples >= 1U) && (config->after < config->samples) && (config->burst >= 1U) && (self->held <= config->samples) &&
           (self->newest < config->samples) && (self->state >= HG_FREEZE_RECORDING) && (self->state <= HG_FREEZE_FROZEN) && (self->rest <= config->after) &&
           /* With the samples that are still to come a record holds that of its alarm. */
           ((self->state == HG_FREEZE_RECORDING) || (((uint32_t)self->held + self->rest) > config->after)) && ((self->state != HG_FREEZE_FROZEN) || (self->rest == 0U)) && (self->missed <= 63U) && writable(self->memory.row, config->samples) && writable(self->memory.real, config->samples * reals);
}

static inline bool kept_freeze(const hg_freeze *self, const hg_freeze *before)
{
    return (self->config == before->config) && (self->detector == before->detector) && (self->memory.row == before->memory.row) && (self->memory.real == before->memory.real) &&
           (self->model_hash == before->model_hash);
}

static inline bool ensures_freeze(const hg_freeze *self, const hg_freeze *before)
{
    return kept_freeze(self, before) && requires_freeze(self);
}

static inline bool requires_freeze_receive(const hg_freeze *self, const hg_can_frame *frame)
{
    return requires_freeze(self) && readable(frame, 1U);
}

static inline bool ensures_freeze_receive(const hg_freeze *self, const hg_freeze *before, hg_status status)
{
    return ensures_freeze(self, before) &&
           ((status == HG_OK) || (status == HG_E_ID) || (status == HG_E_FORMAT) || (status == HG_E_CRC) || (status == HG_E_STATE) || (status == HG_E_NUMERIC));
}

static inline bool ensures_freeze_report(const hg_freeze *self, const hg_freeze *before, hg_status status)
{
    return ensures_freeze(self, before) && ((status == HG_OK) ? (self->credit == (before->credit - 1U)) : ((status == HG_E_EMPTY) && (self->credit == before->credit)));
}

/* ---- e2e.h: what is written ---- */

static inline bool requires_e2e_protect(const hg_e2e_config *config, const uint8_t *data, uint8_t length)
{
    const bool listed = (config->profile == HG_E2E_P02) || (config->profile == HG_E2E_P22);
    return (config->profile >= HG_E2E_NONE) && (config->profile <= HG_E2E_P22) && ((!listed) || readable(config->data_ids, HG_E2E_IDS)) && writable(data, length);
}

static inline bool ensures_e2e_protect(hg_status status)
{
    return (status == HG_OK) || (status == HG_E_FORMAT);
}

/* ---- frame.h: what is written; node.h: what a self-test calls ---- */

static inline bool requires_frame_pack(const hg_message *message, const int32_t *code, const hg_can_frame *frame)
{
    return hg_frame_valid(message) && readable(code, message->width) && writable(frame, 1U);
}

static inline bool ensures_frame_pack(const hg_message *message, const hg_can_frame *frame)
{
    return (frame->id == message->id) && (frame->length == message->length);
}

static inline bool started_node(const hg_node *self)
{
    return state_node(self) && started_detector(&self->detector);
}

static inline bool ensures_node_receive(hg_status status)
{
    return (status == HG_OK) || (status == HG_E_ID) || (status == HG_E_FORMAT) || (status == HG_E_CRC) || (status == HG_E_REPEATED) || (status == HG_E_STAMP) ||
           (status == HG_E_SEQUENCE) || (status == HG_E_STATE) || (status == HG_E_NUMERIC) || (status == HG_E_BUSY);
}

static inline bool ensures_node_step(const hg_node *self, const hg_node *before, const hg_verdict *verdict, hg_status status)
{
    if (status != HG_OK) {
        return (status == HG_E_EMPTY) && (before->due == 0U);
    }
    return (self->due == (before->due - 1U)) && (verdict->k == before->k) && (self->k == (uint32_t)(before->k + 1U)) && (verdict->plant <= HG_PLANT_CONFIRMED) &&
           ((verdict->basis == HG_BASIS_SET) || (verdict->basis == HG_BASIS_STATISTICAL)) && (verdict->model_hash == self->config->model_hash);
}

/* ---- selftest.h ---- */

static inline bool requires_selftest(const hg_node *self, const hg_selftest_config *drive)
{
    uint32_t signals = 0U;
    for (uint8_t i = 0U; i < self->config->detector->groups; i++) {
        signals += self->config->message[i].width;
    }
    bool within = started_node(self) && (drive->spread <= 127U) && (drive->signal < signals) && (drive->size <= 1000000) && (drive->size >= -1000000) && readable(drive->code, signals);
    for (uint32_t i = 0U; within && (i < signals); i++) {
        within = (drive->code[i] <= 1000000) && (drive->code[i] >= -1000000);
    }
    return within;
}

static inline bool ensures_selftest_drive(const hg_selftest_config *drive, const hg_selftest_result *result)
{
    return result->quiet || (drive->fault > 0U);
}

#endif
