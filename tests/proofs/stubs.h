/** @file
 *  Stand-ins for functions of the library in the proofs of those that call them (@stub FUNCTION puts stub_FUNCTION() in its place): each asserts that it is called as
 *  contract.h requires, writes anything into all that the function may write, and gives anything that contract.h ensures. */
#ifndef HULLGUARD_STUBS_H
#define HULLGUARD_STUBS_H

#include "contract.h"

static void write_reals(hg_real *x, uint32_t count)
{
    for (uint32_t i = 0U; i < count; i++) {
        hg_real any;
        x[i] = any;
    }
}

static void write_codes(int32_t *x, uint32_t count)
{
    for (uint32_t i = 0U; i < count; i++) {
        x[i] = any_i32();
    }
}

static hg_status any_status(void)
{
    return (hg_status)any_i8();
}

/* ---- hold.h ---- */

/* Anything but where its parts are, and anything in these. */
static void write_hold(hg_hold *self)
{
    const hg_hold before = *self;
    const uint8_t width = self->config->trigger->width;
    *self = (hg_hold){.config = before.config, .sent = before.sent, .previous = before.previous, .value = before.value, .promise = before.promise, .age = any_u8(), .good = any_u8(),
                      .level = any_u8(), .silence = any_u8(), .holes = any_bool(), .seen = any_bool(), .recovering = any_bool(), .fresh = any_bool(), .lost = any_bool(),
                      .doubt = any_bool(), .gap = any_bool(), .gap_age = any_u8()};
    write_codes(self->sent, width);
    write_codes(self->previous, width);
    write_reals(self->value, width);
    write_reals(self->promise, width);
}

hg_status stub_hg_hold_start(hg_hold *self, const hg_hold_config *config, int32_t *codes, hg_real *reals)
{
    prove(requires_hold_start(config, codes, reals), "contract of hg_hold_start()");
    const hg_hold before = *self;
    const hg_status status = any_bool() ? HG_OK : HG_E_CONFIG;
    if (status == HG_OK) {
        const uint8_t width = config->trigger->width;
        self->config = config;
        self->sent = codes;
        self->previous = &codes[width];
        self->value = reals;
        self->promise = &reals[width];
        write_hold(self);
    }
    assume(ensures_hold_start(self, &before, config, codes, reals, status));
    return status;
}

hg_status stub_hg_hold_receive(hg_hold *self, const int32_t *code, bool continues)
{
    prove(requires_hold_receive(self, code), "contract of hg_hold_receive()");
    (void)continues;
    const hg_hold before = *self;
    const hg_status status = any_status();
    write_hold(self);
    assume(ensures_hold_receive(self, &before, status));
    return status;
}

void stub_hg_hold_step(hg_hold *self, hg_real *value, hg_real *radius, uint8_t *rewind)
{
    prove(requires_hold_step(self, value, radius, rewind), "contract of hg_hold_step()");
    const hg_hold before = *self;
    write_hold(self);
    write_reals(value, self->config->trigger->width);
    write_reals(radius, self->config->trigger->width);
    *rewind = any_u8();
    assume(ensures_hold_step(self, &before, *rewind));
}

void stub_hg_hold_past(const hg_hold *self, uint8_t lag, hg_real *radius)
{
    prove(requires_hold_past(self, lag, radius), "contract of hg_hold_past()");
    write_reals(radius, self->config->trigger->width);
}

void stub_hg_hold_rewrite(const hg_hold *self, hg_ring *ring, uint8_t first, uint8_t lags)
{
    prove(requires_hold_rewrite(self, ring, first, lags), "contract of hg_hold_rewrite()");
    write_reals(ring->data, HG_RING_REALS(ring->width, ring->length));
}

/* ---- predict.h, mismatch.h ---- */

void stub_hg_predict_reset(hg_predict *self)
{
    prove(requires_predict_reset(self), "contract of hg_predict_reset()");
    const hg_predict before = *self;
    self->k = any_u16();
    self->sure = any_bool();
    write_reals(self->x, self->config->order);
    assume(ensures_predict_reset(self, &before));
}

void stub_hg_predict_step(hg_predict *self, uint8_t age, const hg_real *value, const hg_real *radius, hg_real *out_value, hg_real *out_radius)
{
    prove(requires_predict_step(self, value, radius, out_value, out_radius), "contract of hg_predict_step()");
    (void)age;
    const hg_predict before = *self;
    const bool swapped = any_bool();
    *self = (hg_predict){.config = before.config, .x = swapped ? before.next : before.x, .next = swapped ? before.x : before.next, .u = before.u, .y = before.y, .k = any_u16(), .sure = any_bool()};
    write_reals(self->x, self->config->order);
    write_reals(self->next, self->config->order);
    write_reals(self->u, self->config->inputs);
    write_reals(self->y, self->config->width);
    write_reals(out_value, self->config->width);
    write_reals(out_radius, self->config->width);
    assume(ensures_predict_step(self, &before));
}

void stub_hg_mismatch_step(const hg_mismatch_config *config, const hg_real *value, const hg_real *radius, hg_real *out)
{
    prove(requires_mismatch_step(config, value, radius, out), "contract of hg_mismatch_step()");
    write_reals(out, config->states);
}

void stub_hg_mismatch_grow(const hg_mismatch_config *config, const hg_real *increase, hg_real *out)
{
    prove(requires_mismatch_grow(config, increase, out), "contract of hg_mismatch_grow()");
    write_reals(out, config->states);
}

/* ---- residual.h ---- */

void stub_hg_residual_reset(hg_residual *self)
{
    prove(requires_residual_reset(self), "contract of hg_residual_reset()");
    write_reals(self->z, self->config->order);
}

hg_status stub_hg_residual_step(hg_residual *self, const hg_real *value, hg_real *r)
{
    prove(requires_residual_step(self, value, r), "contract of hg_residual_step()");
    const hg_residual before = *self;
    const hg_status status = any_bool() ? HG_OK : HG_E_NUMERIC;
    if (status == HG_OK) {
        self->z = before.next;
        self->next = before.z;
    }
    write_reals(self->z, self->config->order);
    write_reals(self->next, self->config->order);
    write_reals(self->input, self->config->width);
    write_reals(r, self->config->residuals);
    assume(ensures_residual_step(self, &before, status));
    return status;
}

/* ---- hull.h, zonotope.h ---- */

static void write_hull(hg_hull *self)
{
    self->k = any_u16();
    self->how = (hg_start)any_u8();
    write_reals(self->theta, self->config->residuals);
    write_reals(self->mode, self->config->modes);
}

void stub_hg_hull_reset(hg_hull *self, hg_start how)
{
    prove(requires_hull_reset(self), "contract of hg_hull_reset()");
    (void)how;
    const hg_hull before = *self;
    write_hull(self);
    assume(ensures_hull_reset(self, &before));
}

void stub_hg_hull_step(hg_hull *self, const hg_ring *ring, hg_real *J)
{
    prove(requires_hull_step(self, ring, J), "contract of hg_hull_step()");
    const hg_hull before = *self;
    write_hull(self);
    write_reals(J, self->config->residuals);
    assume(ensures_hull_step(self, &before));
}

#if HG_WITH_ZONOTOPE
static void write_zonotope(hg_zonotope *self)
{
    const hg_zonotope_config *config = self->config;
    const hg_zonotope before = *self;
    const uint32_t most = (uint32_t)config->columns + config->width + config->disturbances;
    hg_real size;
    *self = (hg_zonotope){.config = config, .column = before.column, .score = before.score, .spread = before.spread, .scratch = before.scratch, .size = size, .count = any_u16(),
                          .lost = any_u16(), .k = any_u16(), .how = (hg_start)any_u8()};
    write_reals(self->column, most * config->order);
    write_reals(self->score, most);
    write_reals(self->spread, config->order);
    write_reals(self->scratch, config->order);
}

void stub_hg_zonotope_reset(hg_zonotope *self, hg_start how)
{
    prove(requires_zonotope_reset(self), "contract of hg_zonotope_reset()");
    (void)how;
    const hg_zonotope before = *self;
    write_zonotope(self);
    assume(ensures_zonotope(self, &before));
}

void stub_hg_zonotope_widen(hg_zonotope *self, uint8_t lag, uint8_t first, uint8_t count, const hg_real *increase)
{
    prove(requires_zonotope_widen(self, count, increase), "contract of hg_zonotope_widen()");
    (void)lag;
    (void)first;
    const hg_zonotope before = *self;
    write_zonotope(self);
    assume(ensures_zonotope(self, &before));
}

void stub_hg_zonotope_step(hg_zonotope *self, const hg_ring *ring, hg_real *J)
{
    prove(requires_zonotope_step(self, ring, J), "contract of hg_zonotope_step()");
    const hg_zonotope before = *self;
    write_zonotope(self);
    write_reals(J, self->config->residuals);
    assume(ensures_zonotope(self, &before));
}
#endif

/* ---- bank.h ---- */

static void write_bank(hg_bank *self)
{
    self->k = any_u8();
    self->closest = any_u8();
    write_reals(self->sum, HG_BANK_SUMS(self->config->certificates));
}

void stub_hg_bank_reset(hg_bank *self)
{
    prove(requires_bank_reset(self), "contract of hg_bank_reset()");
    const hg_bank before = *self;
    write_bank(self);
    assume(ensures_bank_reset(self, &before));
}

hg_status stub_hg_bank_step(hg_bank *self, const hg_ring *value, const hg_ring *radius, hg_real *r, hg_real *J)
{
    prove(requires_bank_step(self, value, radius, r, J), "contract of hg_bank_step()");
    const hg_bank before = *self;
    const hg_status status = any_status();
    write_bank(self);
    write_reals(r, 1U);
    write_reals(J, 1U);
    assume(ensures_bank_step(self, &before, status));
    return status;
}

/* ---- polynomial.h, statistic.h ---- */

#if HG_WITH_POLYNOMIAL
/* What others read of a filter: the point of expansion and the judgement. */
static void write_polynomial(hg_polynomial *self)
{
    hg_polynomial_judgement any;
    self->judgement = any;
    self->dropped = any_u16();
    self->held = any_u16();
    self->restarts = any_u16();
    write_reals(self->c, self->config->states);
}

void stub_hg_polynomial_reset(hg_polynomial *self)
{
    prove(requires_polynomial_reset(self), "contract of hg_polynomial_reset()");
    write_polynomial(self);
    assume(started_polynomial(self));
}

hg_status stub_hg_polynomial_step(hg_polynomial *self, const hg_real *y, const hg_real *radius)
{
    prove(requires_polynomial_step(self, y, radius), "contract of hg_polynomial_step()");
    const hg_polynomial before = *self;
    const hg_status status = any_status();
    write_polynomial(self);
    assume(ensures_polynomial_step(self, &before, status) && started_polynomial(self));
    return status;
}

static void write_statistic(hg_statistic *self)
{
    self->samples = any_u8();
    write_polynomial(&self->filter);
    write_reals(self->y, self->config->filter.outputs);
    write_reals(self->radius, self->config->filter.outputs);
}

void stub_hg_statistic_reset(hg_statistic *self)
{
    prove(started_statistic(self), "contract of hg_statistic_reset()");
    const hg_statistic before = *self;
    write_statistic(self);
    assume(ensures_statistic_reset(self, &before));
}

hg_status stub_hg_statistic_step(hg_statistic *self, const hg_real *value, const hg_real *radius, hg_real *r, hg_real *J)
{
    prove(requires_statistic_step(self, value, radius, r, J), "contract of hg_statistic_step()");
    const hg_statistic before = *self;
    const hg_status status = any_status();
    write_statistic(self);
    write_reals(r, HG_STATISTICS);
    write_reals(J, HG_STATISTICS);
    assume(ensures_statistic_step(self, &before, status));
    return status;
}
#endif

/* ---- detector.h ---- */

/* Anything but what it is made of: counts, rows and states of its parts, and all numbers of the last sample. */
static void write_detector(hg_detector *self)
{
    const hg_detector_config *config = self->config;
    const hg_detector_memory *part = &self->memory;
    self->radii.newest = any_u8_in(0U, (uint8_t)(self->radii.length - 1U));
    self->values.newest = any_u8();
    self->decision.left = any_u32();
    self->refusals = any_u32();
    self->samples = any_u8();
    self->beginnings = any_u32();
    write_reals(self->value, config->width);
    write_reals(self->r, config->residuals);
    write_reals(self->J, config->residuals);
    write_reals(self->past, config->width);
    write_reals(self->radii.data, HG_RING_REALS(config->width, config->history));
    for (uint8_t i = 0U; i < config->groups; i++) {
        write_hold(&part->hold[i]);
    }
    for (uint8_t i = 0U; i < config->predictors; i++) {
        part->predict[i].k = any_u16();
        part->predict[i].sure = any_bool();
    }
    for (uint8_t g = 0U; g < config->generators; g++) {
        if (config->hull != NULL) {
            write_hull(&part->hull[g]);
        }
#if HG_WITH_ZONOTOPE
        if (config->hull == NULL) {
            write_zonotope(&part->zonotope[g]);
        }
#endif
    }
#if HG_WITH_POLYNOMIAL
    for (uint8_t p = 0U; p < config->polynomials; p++) {
        write_statistic(&part->polynomial[p]);
    }
#endif
    for (uint8_t b = 0U; b < config->banks; b++) {
        write_bank(&part->bank[b]);
    }
    for (uint8_t g = 0U; g < config->decision.generators; g++) {
        part->alarm[g] = (hg_alarm){.state = (hg_plant)any_u8(), .up = any_u8(), .down = any_u8(), .pending = any_u8()};
    }
}

hg_status stub_hg_detector_receive(hg_detector *self, uint8_t group, const int32_t *code, bool continues)
{
    prove(requires_detector_receive(self, group, code), "contract of hg_detector_receive()");
    (void)continues;
    const hg_status status = any_status();
    if (group < self->config->groups) {
        const hg_hold before = self->memory.hold[group];
        write_hold(&self->memory.hold[group]);
        assume(kept_hold(&self->memory.hold[group], &before));
    }
    assume(ensures_detector_receive(self, group, status));
    return status;
}

void stub_hg_detector_restart(hg_detector *self, hg_start how)
{
    prove(started_detector(self), "contract of hg_detector_restart()");
    (void)how;
    const hg_detector before = *self;
    write_detector(self);
    assume(ensures_detector_restart(self, &before) && started_detector(self));
}

hg_status stub_hg_detector_step(hg_detector *self, hg_finding *finding)
{
    prove(started_detector(self), "contract of hg_detector_step()");
    const hg_detector before = *self;
    const hg_status status = any_status();
    write_detector(self);
    self->radius = &self->radii.data[(uint16_t)self->radii.newest * self->radii.width];
    *finding = (hg_finding){.plant = (hg_plant)any_u8(), .basis = (hg_basis)any_u8(), .candidates = any_u32()};
    assume(ensures_detector_step(self, &before, finding, status) && started_detector(self));
    return status;
}

/* ---- e2e.h, frame.h ---- */

hg_status stub_hg_e2e_check(const hg_e2e_config *config, const uint8_t *data, uint8_t length, hg_e2e_header *header)
{
    prove(requires_e2e_check(config, data, length, header), "contract of hg_e2e_check()");
    const hg_status status = any_status();
    *header = (hg_e2e_header){.stamp = any_u8(), .counter = any_u8(), .crc = any_u16()};
    assume(ensures_e2e_check(config, header, status));
    return status;
}

bool stub_hg_frame_matches(const hg_message *message, const hg_can_frame *frame)
{
    prove(requires_frame_matches(message, frame), "contract of hg_frame_matches()");
    const bool matches = any_bool();
    assume(ensures_frame_matches(message, frame, matches));
    return matches;
}

hg_status stub_hg_frame_unpack(const hg_message *message, const hg_can_frame *frame, int32_t *code)
{
    prove(requires_frame_unpack(message, frame, code), "contract of hg_frame_unpack()");
    const hg_status status = any_status();
    write_codes(code, message->width);
    assume(ensures_frame_unpack(status));
    return status;
}

/* ---- linalg.h, fusion.h, consistency.h ---- */

#if HG_REAL_F32 || HG_REAL_F64
hg_real stub_hg_linalg_root(hg_real x)
{
    (void)x;
    hg_real any;
    assume(ensures_linalg_root(any));
    return any;
}

static void write_fusion_slot(const hg_fusion_config *config, hg_fusion_slot *slot)
{
    const uint32_t n = config->states;
    write_reals(slot->x, n);
    write_reals(slot->P, n * n);
    write_reals(slot->shift, n);
    for (uint8_t i = 0U; i < config->sensors; i++) {
        hg_fusion_entry any;
        any.counted = any_bool();
        any.expected = any_bool();
        slot->entry[i] = any;
    }
    slot->table = &config->table[any_u8() % config->tables];
    slot->excluded = any_u16();
}

/* Anything but where its parts are, and anything in these. */
static void write_fusion(hg_fusion *self)
{
    const hg_fusion_config *config = self->config;
    const uint32_t n = config->states;
    for (uint8_t l = 0U; l <= config->depth; l++) {
        write_fusion_slot(config, &self->slot[l]);
    }
    for (uint8_t i = 0U; i < config->sensors; i++) {
        hg_fusion_sensor any;
        any.seen = any_bool();
        self->sensor[i] = any;
        hg_real number;
        self->record[i].residual = number;
        self->record[i].value = any_bool();
        write_reals(&self->record[i].spread, 1U);
        write_reals(&self->record[i].y, 1U);
        write_reals(self->record[i].gain, n);
    }
    write_codes(self->origin, n);
    write_reals(self->x, n);
    write_reals(self->P, n * n);
    write_reals(self->ahead, n);
    write_reals(self->wide, n * n);
    write_reals(self->product, n * n);
    write_reals(self->g, n);
    write_reals(self->next, n);
    write_reals(self->move, n);
    self->k = any_u32();
    self->resets = any_u16();
    self->newest = any_u8();
    self->held = any_u8();
    self->redo = any_u8();
    self->open = any_bool();
}

#ifdef VALID
/* A run for each answer: tables do not change, so that it is the same at every call, and a constant keeps every size one. */
bool stub_hg_fusion_valid(const hg_fusion_config *config)
{
    assume(ensures_fusion_valid(config, VALID));
    return VALID;
}
#endif

/* Each part where placed_fusion() looks for it. */
static void place_fusion(hg_fusion *self, const hg_fusion_config *config, const hg_fusion_memory *memory)
{
    *self = laid_fusion(config, memory);
    for (uint8_t l = 0U; l <= config->depth; l++) {
        self->slot[l] = laid_slot(config, memory, l);
    }
    for (uint8_t i = 0U; i < config->sensors; i++) {
        self->record[i].gain = laid_gain(self, i);
    }
}

hg_status stub_hg_fusion_start(hg_fusion *self, const hg_fusion_config *config, const hg_fusion_memory *memory)
{
    prove(requires_fusion_start(config, memory), "contract of hg_fusion_start()");
    const hg_status status = hg_fusion_valid(config) ? HG_OK : HG_E_CONFIG;
    if (status == HG_OK) {
        place_fusion(self, config, memory);
        write_fusion(self);
    } else {
        hg_fusion any; /* of a refused one nothing is promised */
        *self = any;
    }
    assume(ensures_fusion_start(self, config, memory, status));
    return status;
}

void stub_hg_fusion_reset(hg_fusion *self)
{
    prove(started_fusion(self), "contract of hg_fusion_reset()");
    const hg_fusion before = *self;
    write_fusion(self);
    assume(ensures_fusion_reset(self, &before));
}

hg_status stub_hg_fusion_open(hg_fusion *self, const hg_real *u)
{
    prove(started_fusion(self) && readable(u, self->config->inputs), "contract of hg_fusion_open()");
    const hg_fusion before = *self;
    const hg_status status = any_status();
    write_fusion(self);
    assume(ensures_fusion_open(self, &before, status));
    return status;
}

hg_status stub_hg_fusion_due(const hg_fusion *self, uint8_t i, hg_real y, hg_real dice)
{
    prove(requires_fusion_sensor(self, i), "contract of hg_fusion_due()");
    (void)y;
    (void)dice;
    const hg_status status = any_status();
    assume(ensures_fusion_due(self, status));
    return status;
}

hg_real stub_hg_fusion_local(const hg_fusion *self, uint8_t i, uint8_t stamp, hg_real y)
{
    prove(requires_fusion_sensor(self, i), "contract of hg_fusion_local()");
    (void)stamp;
    (void)y;
    hg_real any;
    write_reals(self->next, self->config->states);
    return any;
}

hg_real stub_hg_fusion_unwrap(const hg_fusion *self, uint8_t i, uint8_t stamp, hg_real y, hg_real period)
{
    prove(requires_fusion_sensor(self, i), "contract of hg_fusion_unwrap()");
    (void)stamp;
    (void)y;
    (void)period;
    hg_real any;
    return any;
}

hg_status stub_hg_fusion_receive(hg_fusion *self, uint8_t i, uint8_t stamp, uint8_t counter, hg_real y)
{
    prove(requires_fusion_sensor(self, i), "contract of hg_fusion_receive()");
    (void)stamp;
    (void)counter;
    (void)y;
    const hg_fusion before = *self;
    const hg_status status = any_status();
    write_fusion(self);
    assume(ensures_fusion_receive(self, &before, status));
    return status;
}

hg_status stub_hg_fusion_close(hg_fusion *self)
{
    prove(started_fusion(self), "contract of hg_fusion_close()");
    const hg_fusion before = *self;
    const hg_status status = any_status();
    write_fusion(self);
    assume(ensures_fusion_close(self, &before, status));
    return status;
}

/* Anything but where its parts are, and anything in these. */
static void write_consistency(hg_consistency *self)
{
    const hg_consistency before = *self;
    const uint8_t m = self->fusion->config->sensors;
    for (uint16_t s = 0U; s < ((uint16_t)self->config->onsets * m); s++) {
        hg_consistency_sum any;
        self->sum[s] = any;
    }
    for (uint8_t i = 0U; i < m; i++) {
        hg_consistency_sensor any;
        self->sensor[i] = any;
    }
    write_reals(self->f, ((uint32_t)self->config->onsets * m) * self->fusion->config->states);
    write_reals(self->next, self->fusion->config->states);
    *self = (hg_consistency){.config = before.config, .fusion = before.fusion, .sum = before.sum, .sensor = before.sensor, .f = before.f, .next = before.next, .onset = any_u8(),
                             .since = any_u8(), .leader = any_u8(), .leads = any_u8(), .rests = any_u8(), .blamed = any_u16()};
}

#ifdef TESTS
/* As above: TESTS says whether a run's tables are refused, or begin. */
hg_status stub_hg_consistency_start(hg_consistency *self, const hg_consistency_config *config, const hg_fusion *fusion, const hg_consistency_memory *memory)
{
    prove(requires_consistency_start(config, fusion, memory), "contract of hg_consistency_start()");
    const hg_status status = (TESTS == 1U) ? HG_OK : HG_E_CONFIG;
    if (status == HG_OK) {
        *self = (hg_consistency){.config = config, .fusion = fusion, .sum = memory->sum, .sensor = memory->sensor, .next = memory->real, .f = &memory->real[fusion->config->states]};
        write_consistency(self);
    } else {
        hg_consistency any; /* of a refused one nothing is promised */
        *self = any;
    }
    assume(ensures_consistency_start(self, config, fusion, memory, status));
    return status;
}
#endif

void stub_hg_consistency_reset(hg_consistency *self)
{
    prove(requires_consistency_reset(self), "contract of hg_consistency_reset()");
    const hg_consistency before = *self;
    write_consistency(self);
    assume(ensures_consistency_reset(self, &before));
}

uint16_t stub_hg_consistency_step(hg_consistency *self)
{
    prove(requires_consistency_step(self), "contract of hg_consistency_step()");
    const hg_consistency before = *self;
    const uint16_t blamed = any_u16();
    write_consistency(self);
    assume(ensures_consistency_step(self, &before, blamed));
    return blamed;
}
#endif

/* ---- crc32c.h, digest.h ---- */

/* Some function of all that it is given: what is proven with it holds of any checksum. */
uint32_t __CPROVER_uninterpreted_checksum(uint32_t crc, uint32_t number, uint8_t bytes);

uint32_t stub_hg_crc32c(uint32_t crc, uint32_t number, uint8_t bytes)
{
    prove(requires_crc32c(bytes), "contract of hg_crc32c()");
    return __CPROVER_uninterpreted_checksum(crc, number, bytes);
}

static void write_digest(hg_digest *self)
{
    *self = (hg_digest){.crc = any_u32(), .done = any_u32(), .skip = any_u32(), .left = any_u32()};
}

void stub_hg_digest_bytes(hg_digest *self, const uint8_t *x, uint32_t count)
{
    prove(requires_digest(x, count), "contract of hg_digest_bytes()");
    const hg_digest before = *self;
    write_digest(self);
    assume(ensures_digest(self, &before, x != NULL, count));
}

void stub_hg_digest_halves(hg_digest *self, const uint16_t *x, uint32_t count)
{
    prove(requires_digest(x, count), "contract of hg_digest_halves()");
    const hg_digest before = *self;
    write_digest(self);
    assume(ensures_digest(self, &before, x != NULL, count));
}

void stub_hg_digest_codes(hg_digest *self, const int32_t *x, uint32_t count)
{
    prove(requires_digest(x, count), "contract of hg_digest_codes()");
    const hg_digest before = *self;
    write_digest(self);
    assume(ensures_digest(self, &before, x != NULL, count));
}

void stub_hg_digest_masks(hg_digest *self, const uint32_t *x, uint32_t count)
{
    prove(requires_digest(x, count), "contract of hg_digest_masks()");
    const hg_digest before = *self;
    write_digest(self);
    assume(ensures_digest(self, &before, x != NULL, count));
}

void stub_hg_digest_reals(hg_digest *self, const hg_real *x, uint32_t count)
{
    prove(requires_digest(x, count), "contract of hg_digest_reals()");
    const hg_digest before = *self;
    write_digest(self);
    assume(ensures_digest(self, &before, x != NULL, count));
}

/* ---- freeze.h ---- */

/* Anything but what it is made of. */
static void write_freeze(hg_freeze *self)
{
    const hg_freeze before = *self;
    const uint32_t reals = HG_FREEZE_REALS(self->detector->config->width, self->detector->config->residuals);
    *self = (hg_freeze){.config = before.config, .detector = before.detector, .memory = before.memory, .model_hash = before.model_hash, .crc = any_u32(), .summed = any_u32(),
                        .next = any_u32(), .end = any_u32(), .state = (hg_freeze_state)any_u8(), .newest = any_u8(), .held = any_u8(), .rest = any_u8(), .record = any_u8(),
                        .missed = any_u8(), .credit = any_u8(), .counter = any_u8(), .stamp = any_u8(), .confirmed = any_bool(), .answer = any_bool(), .refused = any_u16()};
    for (uint8_t i = 0U; i < self->config->samples; i++) {
        hg_freeze_row row;
        self->memory.row[i] = row;
    }
    write_reals(self->memory.real, self->config->samples * reals);
}

void stub_hg_freeze_step(hg_freeze *self, const hg_freeze_row *row)
{
    prove(requires_freeze(self) && readable(row, 1U), "contract of hg_freeze_step()");
    const hg_freeze before = *self;
    write_freeze(self);
    assume(ensures_freeze(self, &before));
}

hg_status stub_hg_freeze_receive(hg_freeze *self, const hg_can_frame *frame)
{
    prove(requires_freeze_receive(self, frame), "contract of hg_freeze_receive()");
    const hg_freeze before = *self;
    const hg_status status = any_status();
    write_freeze(self);
    assume(ensures_freeze_receive(self, &before, status));
    return status;
}

hg_status stub_hg_freeze_report(hg_freeze *self, hg_can_frame *frame)
{
    prove(requires_freeze(self) && writable(frame, 1U), "contract of hg_freeze_report()");
    const hg_freeze before = *self;
    const hg_status status = any_status();
    hg_can_frame any;
    *frame = any;
    write_freeze(self);
    assume(ensures_freeze_report(self, &before, status));
    return status;
}

/* ---- e2e.h: what is written ---- */

hg_status stub_hg_e2e_protect(const hg_e2e_config *config, uint8_t *data, uint8_t length, uint8_t counter, uint8_t stamp)
{
    prove(requires_e2e_protect(config, data, length), "contract of hg_e2e_protect()");
    (void)counter;
    (void)stamp;
    const hg_status status = any_status();
    for (uint8_t i = 0U; i < length; i++) {
        data[i] = any_u8();
    }
    assume(ensures_e2e_protect(status));
    return status;
}

/* ---- frame.h: what is written; node.h: what a self-test calls ---- */

void stub_hg_frame_pack(const hg_message *message, const int32_t *code, hg_can_frame *frame)
{
    prove(requires_frame_pack(message, code, frame), "contract of hg_frame_pack()");
    hg_can_frame any;
    *frame = any;
    assume(ensures_frame_pack(message, frame));
}

/* Anything but what it is made of; the numbers that wait for the closing frame, too. */
static void write_node(hg_node *self)
{
    write_detector(&self->detector);
    for (uint8_t i = 0U; i < self->config->detector->groups; i++) {
        hg_link link;
        link.timed = any_bool();
        link.receiver.seen = any_bool();
        self->link[i] = link;
    }
    write_codes(self->closing, self->config->message[self->config->closing].width);
    self->k = any_u32();
    self->unknown = any_u32();
    self->overdue = any_u32();
    self->due = any_u8();
    self->held = any_bool();
    self->continues = any_bool();
    self->synchronised = any_bool();
    self->slipped = any_bool();
    self->slipped_counter = any_u8();
    self->slipped_stamp = any_u8();
    self->slipped_k = any_u32();
    self->closed = any_bool();
    self->closing_counter = any_u8();
    self->closing_k = any_u32();
}

hg_status stub_hg_node_receive(hg_node *self, const hg_can_frame *frame)
{
    prove(started_node(self) && readable(frame, 1U), "contract of hg_node_receive()");
    const hg_status status = any_status();
    write_node(self);
    assume(ensures_node_receive(status) && started_node(self));
    return status;
}

hg_status stub_hg_node_step(hg_node *self, hg_verdict *verdict)
{
    prove(started_node(self) && writable(verdict, 1U), "contract of hg_node_step()");
    const hg_node before = *self;
    const hg_status status = any_status();
    write_node(self);
    *verdict = (hg_verdict){.k = any_u32(), .model_hash = any_u32(), .candidates = any_u32(), .plant = (hg_plant)any_u8(), .basis = (hg_basis)any_u8(), .bus = any_u16(),
                            .refused = any_bool()};
    assume(ensures_node_step(self, &before, verdict, status) && started_node(self));
    return status;
}

void stub_hg_selftest_drive(hg_node *node, const hg_selftest_config *config, hg_selftest_result *result)
{
    prove(requires_selftest(node, config), "contract of hg_selftest_drive()");
    write_node(node);
    *result = (hg_selftest_result){.digest = any_u32(), .quiet = any_bool(), .found = any_bool()};
    assume(ensures_selftest_drive(config, result));
}

#endif
