#include "host.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

struct hgh_run {
    hgh_run_config config;
    size_t         size; /* of this block */
    hgh_plant      plant;
    hgh_faults     faults; /* of a replay */
    hgh_random     noise, loss;
    hgh_result     result;
    int64_t        k;
    int64_t        fault_start;
    int64_t        settled; /* first sample in which the initial state does not matter */
    int64_t        last_event[HG_GROUPS_MAX];
    int64_t        lost_until[HG_GROUPS_MAX];
    uint32_t       events, lost;
    int64_t        bits; /* of the last sample */
    hg_verdict     verdict;
    hg_node        node;
    hg_sender      sender[HG_GROUPS_MAX];
    double         reading[HGH_SIGNALS_MAX], promise[HGH_SIGNALS_MAX];
    double         value[UINT8_MAX], radius[UINT8_MAX]; /* of the whole signal vector */
    double        *r, *J;
};

/* Hands out pieces of the block behind the structure; counts only while base is null. */
typedef struct {
    char  *base;
    size_t used;
} arena;

static void *take(arena *a, size_t count, size_t size)
{
    a->used = (a->used + 15U) & ~(size_t)15U;
    char *p = (a->base != NULL) ? a->base + a->used : NULL;
    a->used += count * size;
    return p;
}

static hg_node_memory node_memory(arena *a, const hg_node_config *node)
{
    const hg_detector_config *d = node->detector;
    hg_node_memory m;
    m.detector.hold = take(a, d->groups, sizeof(hg_hold));
    m.detector.predict = take(a, d->predictors, sizeof(hg_predict));
    m.detector.residual = take(a, d->generators, sizeof(hg_residual));
    m.detector.hull = take(a, d->generators, sizeof(hg_hull));
    m.detector.zonotope = take(a, d->generators, sizeof(hg_zonotope));
    m.detector.bank = take(a, d->banks, sizeof(hg_bank));
    m.detector.polynomial = take(a, d->polynomials, sizeof(hg_statistic));
    m.detector.alarm = take(a, (size_t)d->generators + d->banks + d->polynomials, sizeof(hg_alarm));
    m.detector.codes = (uint16_t)HG_HOLD_CODES(d->signals);
    m.detector.code = take(a, m.detector.codes, sizeof(int32_t));
    m.detector.reals = hg_detector_reals(d);
    m.detector.real = take(a, m.detector.reals, sizeof(hg_real));
    m.detector.sums = hg_detector_sums(d);
    m.detector.sum = take(a, m.detector.sums, sizeof(hg_acc));
    m.link = take(a, d->groups, sizeof(hg_link));
    m.closing = take(a, (size_t)node->message[node->closing].width + 1U, sizeof(int32_t));
    m.freeze = NULL;
    m.frozen = (hg_freeze_memory){0};
    if (node->freeze != NULL) {
        m.freeze = take(a, 1U, sizeof(hg_freeze));
        m.frozen.row = take(a, node->freeze->samples, sizeof(hg_freeze_row));
        m.frozen.real = take(a, (size_t)node->freeze->samples * 2U * ((size_t)d->width + d->residuals), sizeof(hg_real));
    }
    return m;
}

static int64_t first_fault(const hgh_fault *fault, int32_t count)
{
    int64_t first = INT64_MAX;
    for (int32_t i = 0; i < count; i++) {
        first = (fault[i].start < first) ? fault[i].start : first;
    }
    return first;
}

static int64_t settling(const hg_detector_config *d)
{
    int64_t longest = 0;
    for (uint8_t g = 0U; g < d->generators; g++) {
        const uint16_t ready = (d->hull != NULL) ? d->hull[g].ready_moving : d->zonotope[g].ready_moving;
        longest = (ready > longest) ? ready : longest;
    }
    for (uint8_t b = 0U; b < d->banks; b++) {
        longest = (d->bank[b].window > longest) ? d->bank[b].window : longest;
    }
    for (uint8_t p = 0U; p < d->polynomials; p++) {
        longest = (d->polynomial[p].settle > longest) ? d->polynomial[p].settle : longest;
    }
    return longest;
}

static void forget(hgh_run *self)
{
    self->result = (hgh_result){.provisional_at = -1, .confirmed_at = -1, .candidates_always = UINT32_MAX};
}

hgh_run *hgh_run_new(const hgh_run_config *config, uint64_t run)
{
    const hg_detector_config *d = config->node->detector;
    if ((config->signals > HGH_SIGNALS_MAX) || (config->signals != d->signals) || (config->faults > HGH_FAULTS_MAX) ||
        ((config->plant == NULL) == (config->series == NULL)) ||
        ((config->plant != NULL) && ((config->plants < 1) || (config->plant->n > HGH_STATES_MAX) || (config->plant->p > HGH_STATES_MAX) || (config->plant->nd > HGH_DISTURBANCES_MAX)))) {
        return NULL;
    }
    arena sizes = {NULL, sizeof(hgh_run)};
    (void)node_memory(&sizes, config->node);
    (void)take(&sizes, 2U * (size_t)d->signals, sizeof(int32_t));
    (void)take(&sizes, 2U * (size_t)d->residuals, sizeof(double));
    hgh_run *self = calloc(1U, sizes.used + 16U);
    if (self == NULL) {
        return NULL;
    }
    arena a = {(char *)self, sizeof(hgh_run)};
    const hg_node_memory memory = node_memory(&a, config->node);
    int32_t *code = take(&a, 2U * (size_t)d->signals, sizeof(int32_t));
    self->r = take(&a, 2U * (size_t)d->residuals, sizeof(double));
    self->J = self->r + d->residuals;
    self->config = *config;
    if (config->plant != NULL) {
        self->config.plant = &config->plant[run % (uint64_t)config->plants];
    }
    self->size = sizes.used;
    bool good = hg_node_start(&self->node, config->node, &memory, (config->start == (int32_t)HG_START_REST) ? HG_START_REST : HG_START_MOVING) == HG_OK;
    for (uint8_t g = 0U; good && (g < d->groups); g++) {
        good = hg_sender_start(&self->sender[g], &config->sender[g], code) == HG_OK;
        code += 2 * config->sender[g].trigger->width;
        self->last_event[g] = -1;
    }
    if (!good) {
        free(self);
        return NULL;
    }
    if (config->plant != NULL) {
        hgh_plant_start(&self->plant, self->config.plant, config->reference, config->fault, config->faults, config->seed, run);
        if (config->initial != NULL) {
            memcpy(self->plant.x, config->initial, (size_t)config->plant->n * sizeof(double));
        }
    }
    hgh_faults_start(&self->faults, config->fault, config->faults, config->sample_time_s, config->seed, run);
    hgh_random_start(&self->noise, config->seed, run, 4U);
    hgh_random_start(&self->loss, config->seed, run, 5U);
    self->fault_start = first_fault(config->fault, config->faults);
    self->settled = settling(d);
    forget(self);
    return self;
}

void hgh_run_free(hgh_run *self)
{
    free(self);
}

void hgh_run_inject(hgh_run *self, const hgh_fault *fault, int32_t count)
{
    hgh_faults *faults = (self->config.plant != NULL) ? &self->plant.faults : &self->faults;
    hgh_faults_start(faults, fault, count, self->config.sample_time_s, self->config.seed, (uint64_t)self->k);
    for (int32_t i = 0; i < count; i++) {
        /* The last good value, for a freeze that starts with the next sample. */
        faults->active[i].frozen = self->reading[fault[i].signal];
        faults->active[i].held = self->k > 0;
    }
    self->fault_start = first_fault(fault, count);
    forget(self);
}

static void read_signals(hgh_run *self)
{
    const hgh_run_config *c = &self->config;
    if (c->plant != NULL) {
        const double *d = (c->disturbance != NULL) ? &c->disturbance[self->k * c->plant->nd] : NULL;
        hgh_plant_read(&self->plant, d, self->reading);
        return;
    }
    for (int32_t i = 0; i < c->signals; i++) {
        double value = c->series[self->k * c->signals + i];
        if (c->noise != NULL) {
            value += c->noise[i] * hgh_random_signed(&self->noise);
        }
        self->reading[i] = hgh_faults_apply(&self->faults, 0, i, self->k, value);
    }
}

static void count_event(hgh_run *self, uint8_t group)
{
    hgh_result *result = &self->result;
    if (self->last_event[group] >= 0) {
        const int64_t interval = self->k - self->last_event[group];
        result->interval_min = ((result->interval_min == 0) || (interval < result->interval_min)) ? interval : result->interval_min;
        result->interval_max = (interval > result->interval_max) ? interval : result->interval_max;
    }
    self->last_event[group] = self->k;
    result->measurement++;
}

/* Does the receiver miss this measurement frame? */
static bool dropped(hgh_run *self, uint8_t group)
{
    if (self->config.loss <= 0.0) {
        return false;
    }
    const bool begins = hgh_random_unit(&self->loss) < self->config.loss;
    if (self->k < self->lost_until[group]) {
        return true;
    }
    self->lost_until[group] = begins ? self->k + self->config.burst : 0;
    return begins;
}

static void speak(hgh_run *self, uint8_t group, const double *reading)
{
    hg_real value[HG_GROUP_SIGNALS_MAX];
    hg_can_frame frame;
    const bool closing = group == self->config.node->closing;
    for (uint8_t g = 0U; g < self->config.sender[group].trigger->width; g++) {
        value[g] = hgh_real(reading[g], self->config.unit[(reading - self->reading) + g]);
    }
    if (hg_sender_step(&self->sender[group], (uint32_t)self->k, value, &frame) != HG_OK) {
        return;
    }
    const int64_t bits = (int64_t)hgh_frame_bits(&frame);
    self->events |= 1U << group;
    self->bits += bits;
    if (closing) {
        self->result.closing++;
    } else {
        count_event(self, group);
        self->result.measurement_bits += bits;
    }
    if (!closing && dropped(self, group)) {
        self->lost |= 1U << group;
        self->result.lost++;
    } else {
        (void)hg_node_receive(&self->node, &frame);
    }
}

/* Does a sender not look at this sample, because it has just spoken? */
static bool silent_phase(const hgh_run *self)
{
    bool silent = false;
    for (uint8_t g = 0U; g < self->config.node->detector->groups; g++) {
        const hg_trigger *t = &self->sender[g].trigger;
        silent = silent || ((t->age >= 1U) && (t->age <= t->config->silence[t->level]));
    }
    return silent;
}

static double largest_ratio(const hgh_run *self)
{
    double ratio = 0.0;
    for (uint16_t i = 0U; i < self->config.node->detector->residuals; i++) {
        ratio = fmax(ratio, fabs((double)self->node.detector.r[i]) / (double)self->node.detector.J[i]);
    }
    return ratio;
}

static void judge(hgh_run *self, const hg_verdict *verdict)
{
    hgh_result *result = &self->result;
    const double ratio = largest_ratio(self);
    if (self->k < self->fault_start) {
        result->margin = fmax(result->margin, ratio);
        result->margin_settled = (self->k >= self->settled) ? fmax(result->margin_settled, ratio) : 0.0;
        result->false_provisional += ((verdict->plant >= HG_PLANT_PROVISIONAL) && (self->verdict.plant < HG_PLANT_PROVISIONAL)) ? 1 : 0;
        result->false_confirmed += ((verdict->plant == HG_PLANT_CONFIRMED) && (self->verdict.plant != HG_PLANT_CONFIRMED)) ? 1 : 0;
    } else {
        result->margin_after = fmax(result->margin_after, ratio);
        if ((verdict->plant >= HG_PLANT_PROVISIONAL) && (result->provisional_at < 0)) {
            result->provisional_at = self->k;
            result->candidates = verdict->candidates;
        }
        if (verdict->plant == HG_PLANT_CONFIRMED) {
            result->confirmed_at = (result->confirmed_at < 0) ? self->k : result->confirmed_at;
            result->candidates_always &= verdict->candidates;
        }
        if ((verdict->plant >= HG_PLANT_PROVISIONAL) && (self->k <= (result->provisional_at + HGH_LATER))) {
            result->candidates_later = verdict->candidates;
        }
    }
    result->plant = (int32_t)verdict->plant;
    self->verdict = *verdict;
}

static void step(hgh_run *self)
{
    const hg_node_config *node = self->config.node;
    hg_verdict verdict;
    hg_can_frame frame[2];
    self->events = 0U;
    self->lost = 0U;
    self->bits = 0;
    read_signals(self);
    const double *reading = self->reading;
    for (uint8_t g = 0U; g < node->detector->groups; g++) {
        if (g != node->closing) {
            speak(self, g, reading);
        }
        reading += self->config.sender[g].trigger->width;
    }
    reading = self->reading;
    for (uint8_t g = 0U; g < node->closing; g++) {
        reading += self->config.sender[g].trigger->width;
    }
    speak(self, node->closing, reading);
    self->result.silent += silent_phase(self) ? 1 : 0;
    while (hg_node_step(&self->node, &verdict) == HG_OK) {
        const uint8_t frames = hg_node_report(&self->node, &verdict, false, frame);
        for (uint8_t i = 0U; i < frames; i++) {
            self->bits += (int64_t)hgh_frame_bits(&frame[i]);
        }
        self->result.verdicts += frames;
        judge(self, &verdict);
    }
    self->result.bits += self->bits;
    if (self->config.plant != NULL) {
        hgh_plant_move(&self->plant);
    }
    self->k++;
}

bool hgh_run_steps(hgh_run *self, int64_t samples)
{
    for (int64_t i = 0; (i < samples) && (self->k < self->config.samples); i++) {
        step(self);
    }
    return self->k < self->config.samples;
}

const hgh_result *hgh_run_result(const hgh_run *self)
{
    return &self->result;
}

static void promises(hgh_run *self)
{
    double *promise = self->promise;
    const int32_t *unit = self->config.unit;
    for (uint8_t g = 0U; g < self->config.node->detector->groups; g++) {
        const hg_trigger *t = &self->sender[g].trigger;
        const hg_code_scale *scale = self->config.sender[g].message->scale;
        const bool looked = t->age > t->config->silence[t->level];
        for (uint8_t i = 0U; i < t->config->width; i++) {
            const double step = ldexp(hgh_number(scale[i].resolution, unit[i]), scale[i].exponent);
            promise[i] = looked ? ((double)hg_trigger_threshold(t->config, t->level, i, t->sent[i]) + 0.5) * step : (double)INFINITY;
        }
        promise += t->config->width;
        unit += t->config->width;
    }
}

hgh_view hgh_run_view(hgh_run *self)
{
    const hg_detector *d = &self->node.detector;
    const int32_t *unit = self->config.unit;
    for (uint8_t i = 0U; i < d->config->width; i++) {
        self->value[i] = hgh_number(d->value[i], unit[i]);
        self->radius[i] = hgh_number(d->radius[i], unit[i]);
    }
    for (uint16_t i = 0U; i < d->config->residuals; i++) {
        self->r[i] = hgh_number(d->r[i], unit[d->config->width + i]);
        self->J[i] = hgh_number(d->J[i], unit[d->config->width + i]);
    }
    promises(self);
    return (hgh_view){.reading = self->reading,
                      .value = self->value,
                      .radius = self->radius,
                      .promise = self->promise,
                      .r = self->r,
                      .J = self->J,
                      .events = self->events,
                      .lost = self->lost,
                      .plant = (int32_t)self->verdict.plant,
                      .bus = self->verdict.bus,
                      .bits = self->bits};
}

int64_t hgh_batch(const hgh_run_config *config, int64_t first, int64_t count, hgh_result *result)
{
    for (int64_t i = 0; i < count; i++) {
        hgh_run *run = hgh_run_new(config, (uint64_t)(first + i));
        if (run == NULL) {
            return i;
        }
        (void)hgh_run_steps(run, config->samples);
        result[i] = run->result;
        hgh_run_free(run);
    }
    return count;
}

int64_t hgh_sweep(const hgh_run_config *config, const hgh_fault *fault, int32_t faults, int64_t start, int64_t step_by, int64_t starts,
                  int64_t horizon, int32_t *delay)
{
    hgh_run *run = hgh_run_new(config, 0U);
    hgh_run *saved = (run != NULL) ? malloc(run->size) : NULL;
    int64_t made = 0;
    for (int64_t s = 0; (saved != NULL) && (s < starts); s++) {
        const int64_t begin = start + s * step_by;
        (void)hgh_run_steps(run, begin - run->k);
        memcpy(saved, run, run->size); /* its pointers lead into run, where it will be put back */
        for (int32_t f = 0; f < faults; f++) {
            hgh_fault moved = fault[f];
            moved.start = begin;
            moved.end = (fault[f].end == INT64_MAX) ? INT64_MAX : begin + fault[f].end;
            hgh_run_inject(run, &moved, 1);
            (void)hgh_run_steps(run, horizon);
            delay[s * faults + f] = (run->result.provisional_at < 0) ? -1 : (int32_t)(run->result.provisional_at - begin);
            memcpy(run, saved, saved->size);
        }
        made++;
    }
    free(saved);
    hgh_run_free(run);
    return made;
}
