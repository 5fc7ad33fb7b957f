#include "host.h"

#if !HG_REAL_Q31 /* fusion is for the float types */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TWO_PI 6.283185307179586
#define ID_FIRST 0x140U
#define FNV_START 0xCBF29CE484222325ULL
#define FNV_PRIME 0x100000001B3ULL

/* Data identifiers of profile 22; which they are does not change the length of a frame but by chance. */
static const uint8_t data_ids[HG_E2E_IDS] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
static const hg_e2e_config protection = {.profile = HG_E2E_P22, .mode = HG_E2E_BOTH, .data_ids = data_ids, .crc = 0U, .ignore = 0U,
                                         .counter = 8U, .nibble = 0U, .stamp = 12U, .resync = 0U, .limits = &hg_e2e_limits_default};

typedef struct {
    hg_fusion         filter;
    hg_fusion_memory  memory;
} node;

typedef struct {          /* a sensor outside its filter */
    hgh_random  noise, odd;
    hg_variance variance;
    int16_t     window[UINT8_MAX];
    uint8_t     counter;
    uint8_t     spoken;   /* bit b: sent b + 1 samples ago */
    hg_real     previous; /* value in the last frame */
    double      frozen;
    bool        waits;    /* a frame is on its way for one more sample */
    hg_real     late_y;
    uint8_t     late_counter;
} sensor;

typedef struct {
    const hgh_fusion_config *config;
    hgh_fusion_result       *result;
    node                     node[HG_FUSION_SENSORS_MAX + 1U];
    sensor                   sensor[HG_FUSION_SENSORS_MAX];
    hg_consistency           judge;
    hg_consistency_memory    judging;
    hgh_random               plant, loss, late, dice;
    double                   x[HG_FUSION_STATES_MAX];
    bool                     blamed; /* has there been one in this run? */
    int64_t                  run;    /* of this batch */
} runner;

static double normal(hgh_random *random)
{
    const double u = 1.0 - hgh_random_unit(random);
    const double v = hgh_random_unit(random);
    return sqrt(-2.0 * log(u)) * cos(TWO_PI * v);
}

static const hg_fusion_config *config_of(const hgh_fusion_config *config, int32_t i)
{
    return (i == 0) ? config->centre : config->sensor;
}

static bool make_node(node *self, const hg_fusion_config *c)
{
    const size_t n = c->states, m = c->sensors, slots = (size_t)c->depth + 1U;
    self->memory.slot = calloc(slots, sizeof(hg_fusion_slot));
    self->memory.entry = calloc(slots * m, sizeof(hg_fusion_entry));
    self->memory.sensor = calloc(m, sizeof(hg_fusion_sensor));
    self->memory.record = calloc(m, sizeof(hg_fusion_record));
    self->memory.origin = calloc(n, sizeof(int32_t));
    self->memory.real = calloc(HG_FUSION_REALS(c->states, c->inputs, c->sensors, c->depth), sizeof(hg_real));
    return hg_fusion_start(&self->filter, c, &self->memory) == HG_OK;
}

static void free_node(node *self)
{
    free(self->memory.slot);
    free(self->memory.entry);
    free(self->memory.sensor);
    free(self->memory.record);
    free(self->memory.origin);
    free(self->memory.real);
}

static bool make_judge(runner *r)
{
    const hg_consistency_config *c = r->config->consistency;
    const size_t m = r->config->centre->sensors;
    if (c == NULL) {
        return true;
    }
    r->judging.sum = calloc(c->onsets * m, sizeof(hg_consistency_sum));
    r->judging.sensor = calloc(m, sizeof(hg_consistency_sensor));
    r->judging.real = calloc(HG_CONSISTENCY_REALS(r->config->centre->states, m, c->onsets), sizeof(hg_real));
    return hg_consistency_start(&r->judge, c, &r->node[0].filter, &r->judging) == HG_OK;
}

static void free_judge(runner *r)
{
    free(r->judging.sum);
    free(r->judging.sensor);
    free(r->judging.real);
}

/* C_i (origin step) of a node: what its measurements are relative to. */
static double origin_of(const runner *r, const node *at, int32_t i)
{
    const hg_fusion_config *c = at->filter.config;
    double sum = 0.0;
    for (int32_t j = 0; (c->origin != NULL) && (j < (int32_t)c->states); j++) {
        sum += r->config->C[i * (int32_t)c->states + j] * (double)at->filter.origin[j] * (double)c->origin[j];
    }
    return sum;
}

static node *node_of(runner *r, int32_t i)
{
    return &r->node[(r->config->nodes == 1) ? 0 : ((r->config->nodes == 2) ? 1 : i + 1)];
}

static void move_plant(runner *r, int64_t k)
{
    const hgh_fusion_config *c = r->config;
    const int32_t n = (int32_t)c->centre->states;
    double next[HG_FUSION_STATES_MAX];
    for (int32_t a = 0; a < n; a++) {
        next[a] = c->q[a] * normal(&r->plant);
        for (int32_t b = 0; b < n; b++) {
            next[a] += c->A[a * n + b] * r->x[b];
        }
        if ((c->jump != NULL) && (k == c->jump_at)) {
            next[a] += c->jump[a];
        }
    }
    memcpy(r->x, next, sizeof(double) * (size_t)n);
}

/* A sensor's reading, absolute. */
static double measure(runner *r, int32_t i, int64_t k)
{
    const hgh_fusion_config *c = r->config;
    const int32_t n = (int32_t)c->centre->states;
    sensor *s = &r->sensor[i];
    double y = c->sigma[i] * normal(&s->noise);
    for (int32_t j = 0; j < n; j++) {
        y += c->C[i * n + j] * r->x[j];
    }
    const double odd = hgh_random_unit(&s->odd);
    if (odd < c->outlier) {
        y += ((odd < 0.5 * c->outlier) ? 1.0 : -1.0) * c->outlier_size * c->sigma[i];
    }
    const bool faulty = (c->fault != HGH_SENSOR_GOOD) && (i == c->fault_sensor) && (k >= c->fault_at);
    if (faulty && (c->fault == HGH_SENSOR_BIASED)) {
        y += c->fault_size;
    }
    if (faulty && (c->fault == HGH_SENSOR_FROZEN)) {
        y = (k == c->fault_at) ? y : s->frozen;
    }
    s->frozen = y;
    return y;
}

static bool wants(runner *r, int32_t i, int64_t k, double y, hg_real local)
{
    const hgh_fusion_config *c = r->config;
    const hg_fusion *own = &node_of(r, i)->filter;
    const double step = (c->rate != NULL) ? c->rate[i] : 0.0;
    const double at = (double)k * step + 0.37 * (double)i + 1e-9;
    const hg_real dice = (hg_real)(-2.0 * log(1.0 - hgh_random_unit(&r->dice)));
    bool speaks = hg_fusion_due(own, (uint8_t)i, local, dice) == HG_OK;
    if (c->variance != NULL) {
        speaks = (hg_variance_step(&r->sensor[i].variance, (int16_t)lrint(y / c->converter)) == HG_OK) || speaks;
    }
    switch (c->send) {
    case HGH_SEND_ALWAYS:
        return true;
    case HGH_SEND_RANDOM:
        return hgh_random_unit(&r->dice) < step;
    case HGH_SEND_DECIMATED:
        return floor(at + step) > floor(at);
    default:
        return speaks;
    }
}

#define CODES 65536.0 /* of 16 bits */

/* 16 bits of an absolute value: what it wraps round to. */
static uint16_t wrapped(double y, double resolution)
{
    return (uint16_t)((int64_t)llrint(y / resolution) & 0xFFFF);
}

/* The frame on the wire, its length, and the value in it: relative to the sender's origin as float32, wrapped round in 16 bits. */
static hg_real transmit(const runner *r, int32_t i, int64_t k, double y, double origin, double *bits)
{
    const hgh_fusion_config *c = r->config;
    const sensor *s = &r->sensor[i];
    hg_can_frame frame = {.id = ID_FIRST + (uint32_t)i, .flags = 0U, .length = (c->resolution > 0.0) ? 4U : 6U};
    uint32_t raw;
    hg_real value;
    if (c->resolution > 0.0) {
        raw = wrapped(y, c->resolution);
        value = (hg_real)((double)(int16_t)raw * c->resolution);
    } else {
        const float narrow = (float)(y - origin);
        memcpy(&raw, &narrow, sizeof raw);
        value = (hg_real)narrow;
    }
    for (uint32_t b = 2U; b < frame.length; b++) {
        frame.data[b] = (uint8_t)(raw >> (8U * (b - 2U)));
    }
    if (c->recall != 0) { /* of 16 bits, whatever the value itself has */
        const uint16_t before = isfinite(s->previous) ? wrapped((double)s->previous, c->resolution) : 0U;
        frame.data[frame.length] = s->spoken;
        frame.data[frame.length + 1U] = (uint8_t)before;
        frame.data[frame.length + 2U] = (uint8_t)(before >> 8);
        frame.length = (uint8_t)(frame.length + 3U);
    }
    (void)hg_e2e_protect(&protection, frame.data, frame.length, s->counter, (uint8_t)(k & 15));
    *bits = (double)hgh_frame_bits(&frame);
    return value;
}

/* A value of sample k as this node takes it. */
static hg_real decoded(const runner *r, const node *at, int32_t i, int64_t k, hg_real value)
{
    const double period = CODES * r->config->resolution;
    return (period > 0.0) ? hg_fusion_unwrap(&at->filter, (uint8_t)i, (uint8_t)(k & 15), value, (hg_real)period) : value;
}

/* What a frame of sample k says of the samples before. */
static void recall(const runner *r, node *at, int32_t i, int64_t k)
{
    const sensor *s = &r->sensor[i];
    int64_t back = 1;
    while ((back < 8) && (((s->spoken >> (back - 1)) & 1) == 0)) {
        back++;
    }
    (void)hg_fusion_recall(&at->filter, (uint8_t)i, (uint8_t)(k & 15), s->spoken, decoded(r, at, i, k - back, s->previous));
}

/* A frame as nodes hear it: its sender's, the centre, the others. */
static void deliver(runner *r, int32_t i, int64_t k, uint8_t counter, hg_real value, bool own, bool others, bool centre)
{
    const int32_t mine = (int32_t)(node_of(r, i) - r->node);
    for (int32_t j = 0; j < r->config->nodes; j++) {
        node *at = &r->node[j];
        const bool hears = (j == 0) ? ((mine == 0) ? own : (others && centre)) : ((j == mine) ? own : others);
        if (hears) {
            (void)hg_fusion_receive(&at->filter, (uint8_t)i, (uint8_t)(k & 15), counter, decoded(r, at, i, k, value));
        }
        if (hears && (r->config->recall != 0)) {
            recall(r, at, i, k);
        }
    }
}

static void sense(runner *r, int32_t i, int64_t k)
{
    const hgh_fusion_config *c = r->config;
    sensor *s = &r->sensor[i];
    const double origin = origin_of(r, node_of(r, i), i);
    const double y = measure(r, i, k);
    const bool dead = (c->fault == HGH_SENSOR_DEAD) && (i == c->fault_sensor) && (k >= c->fault_at);
    const bool lost = hgh_random_unit(&r->loss) < c->loss;
    const bool late = hgh_random_unit(&r->late) < c->late;
    const bool speaks = wants(r, i, k, y, (hg_real)(y - origin)) && !dead;
    if (speaks) {
        double bits;
        s->counter = (uint8_t)((s->counter + 1U) & 15U);
        const hg_real received = transmit(r, i, k, y, origin, &bits);
        if (k >= c->skip) {
            r->result->sent[i] += 1.0;
            r->result->bits += bits;
        }
        const bool heard = (!lost) || (c->lossy == HGH_LOSS_CENTRE);
        deliver(r, i, k, s->counter, received, heard && (!late || (c->nodes > 1)), heard && !late, !lost);
        s->waits = heard && late && ((c->lossy != HGH_LOSS_CENTRE) || !lost);
        s->late_y = received;
        s->late_counter = s->counter;
        s->previous = received;
    }
    s->spoken = (uint8_t)(((uint32_t)s->spoken << 1) | (speaks ? 1U : 0U));
}

static void deliver_late(runner *r, int64_t k)
{
    for (int32_t i = 0; i < (int32_t)r->config->centre->sensors; i++) {
        sensor *s = &r->sensor[i];
        if (s->waits) {
            deliver(r, i, k - 1, s->late_counter, s->late_y, r->config->nodes == 1, true, true);
            s->waits = false;
        }
    }
}

/* e' P^-1 e by Cholesky; P is positive definite, or the result is not finite. */
static double nees(const hg_fusion *f, const double *e)
{
    const int32_t n = (int32_t)f->config->states;
    double L[HG_FUSION_STATES_MAX][HG_FUSION_STATES_MAX], z[HG_FUSION_STATES_MAX], sum = 0.0;
    for (int32_t a = 0; a < n; a++) {
        for (int32_t b = 0; b <= a; b++) {
            double v = (double)f->P[a * n + b];
            for (int32_t j = 0; j < b; j++) {
                v -= L[a][j] * L[b][j];
            }
            L[a][b] = (a == b) ? sqrt(v) : v / L[b][b];
        }
        double v = e[a];
        for (int32_t j = 0; j < a; j++) {
            v -= L[a][j] * z[j];
        }
        z[a] = v / L[a][a];
        sum += z[a] * z[a];
    }
    return sum;
}

static const hg_fusion_slot *settled(const hg_fusion *f)
{
    const uint32_t slots = (uint32_t)f->config->depth + 1U;
    return &f->slot[(f->newest + slots - f->config->delay) % slots];
}

static uint64_t hash(uint64_t so_far, const void *data, size_t bytes)
{
    const uint8_t *byte = data;
    for (size_t i = 0; i < bytes; i++) {
        so_far = (so_far ^ byte[i]) * FNV_PRIME;
    }
    return so_far;
}

/* All that must be the same in every node: estimate, origin, and what it knows of its sensors. */
static uint64_t hash_node(const hg_fusion *f)
{
    const size_t n = f->config->states;
    const hg_fusion_slot *slot = settled(f);
    uint64_t h = hash(FNV_START, slot->x, n * sizeof(hg_real));
    h = hash(h, slot->P, n * n * sizeof(hg_real));
    h = hash(h, f->origin, n * sizeof(int32_t));
    if (f->config->delay == 0U) {
        h = hash(hash(h, f->x, n * sizeof(hg_real)), f->P, n * n * sizeof(hg_real));
    }
    for (uint8_t i = 0U; i < f->config->sensors; i++) {
        h = hash(h, &slot->entry[i].reference, sizeof(hg_real));
        h = hash(h, &slot->entry[i].age, sizeof(uint8_t));
        h = hash(h, &f->sensor[i].loss, sizeof(hg_real));
        h = hash(h, &f->sensor[i].lost, sizeof(uint16_t));
    }
    return h;
}

static void judge(runner *r, int64_t k)
{
    hgh_fusion_result *out = r->result;
    const uint16_t blamed = (r->config->consistency != NULL) ? hg_consistency_step(&r->judge) : 0U;
    if (blamed == 0U) {
        return;
    }
    out->blames++;
    if (!r->blamed) {
        out->blamed_at[r->run] = k;
        out->blamed[r->run] = blamed;
        r->blamed = true;
    }
    for (int32_t j = 0; (r->config->exclude != 0) && (j < r->config->nodes); j++) {
        for (uint8_t i = 0U; i < r->config->centre->sensors; i++) {
            if (((blamed >> i) & 1U) != 0U) {
                hg_fusion_exclude(&r->node[j].filter, i, true);
            }
        }
    }
    hg_consistency_reset(&r->judge);
    for (uint8_t i = 0U; i < r->config->centre->sensors; i++) {
        r->judge.sensor[i].equal = 0U;
    }
}

static void score(runner *r, int64_t k)
{
    const hg_fusion *f = &r->node[0].filter;
    const int32_t n = (int32_t)f->config->states;
    double e[HG_FUSION_STATES_MAX];
    for (int32_t j = 0; j < n; j++) {
        const double step = (f->config->origin != NULL) ? (double)f->config->origin[j] : 0.0;
        e[j] = r->x[j] - ((double)f->x[j] + (double)f->origin[j] * step);
        r->result->error2[k * n + j] += e[j] * e[j];
        r->result->largest = fmax(r->result->largest, fabs((double)f->x[j]));
    }
    r->result->nees[k] += nees(f, e);
    const uint64_t first = hash_node(f);
    bool equal = true;
    for (int32_t i = 2; i < r->config->nodes; i++) { /* sensors' nodes among themselves */
        equal = equal && (hash_node(&r->node[i].filter) == hash_node(&r->node[1].filter));
    }
    if ((r->config->nodes > 1) && (r->config->lossy != HGH_LOSS_CENTRE)) {
        equal = equal && (hash_node(&r->node[1].filter) == first);
    }
    r->result->unequal += equal ? 0 : 1;
    r->result->hash = hash(r->result->hash, &first, sizeof first);
}

static bool begin_run(runner *r, uint64_t run)
{
    const hgh_fusion_config *c = r->config;
    const int32_t n = (int32_t)c->centre->states, m = (int32_t)c->centre->sensors;
    hgh_random initial;
    hgh_random_start(&initial, c->seed, run, 200U);
    hgh_random_start(&r->plant, c->seed, run, 201U);
    hgh_random_start(&r->loss, c->seed, run, 202U);
    hgh_random_start(&r->late, c->seed, run, 203U);
    hgh_random_start(&r->dice, c->seed, run, 204U);
    for (int32_t j = 0; j < n; j++) {
        r->x[j] = c->x0[j] + c->p0[j] * normal(&initial);
    }
    bool good = true;
    for (int32_t i = 0; i < m; i++) {
        sensor *s = &r->sensor[i];
        memset(s, 0, sizeof *s);
        hgh_random_start(&s->noise, c->seed, run, 210U + (uint64_t)i);
        hgh_random_start(&s->odd, c->seed, run, 230U + (uint64_t)i);
        s->previous = (hg_real)NAN;
        if (c->variance != NULL) {
            good = good && (hg_variance_start(&s->variance, &c->variance[i], s->window) == HG_OK);
        }
    }
    for (int32_t j = 0; j < c->nodes; j++) {
        hg_fusion *f = &r->node[j].filter;
        good = good && (hg_fusion_start(f, config_of(c, j), &r->node[j].memory) == HG_OK);
    }
    r->blamed = false;
    return good && ((c->consistency == NULL) || (hg_consistency_start(&r->judge, c->consistency, &r->node[0].filter, &r->judging) == HG_OK));
}

static void one_run(runner *r)
{
    const hgh_fusion_config *c = r->config;
    static const hg_real none[1] = {HG_REAL_ZERO};
    for (int64_t k = 0; k < c->samples; k++) {
        move_plant(r, k);
        for (int32_t j = 0; j < c->nodes; j++) {
            (void)hg_fusion_open(&r->node[j].filter, none);
        }
        deliver_late(r, k);
        for (int32_t i = 0; i < (int32_t)c->centre->sensors; i++) {
            sense(r, i, k);
        }
        for (int32_t j = 0; j < c->nodes; j++) {
            (void)hg_fusion_close(&r->node[j].filter);
        }
        score(r, k);
        judge(r, k);
    }
    for (int32_t j = 0; j < c->nodes; j++) {
        r->result->resets += r->node[j].filter.resets;
    }
    for (int32_t j = 0; j < (int32_t)c->centre->states; j++) {
        r->result->origins += llabs((long long)r->node[0].filter.origin[j]);
    }
}

bool hgh_fusion_batch(const hgh_fusion_config *config, int64_t first, int64_t count, hgh_fusion_result *result)
{
    runner *r = calloc(1U, sizeof *r);
    if (r == NULL) {
        return false;
    }
    r->config = config;
    r->result = result;
    bool good = true;
    for (int32_t j = 0; j < config->nodes; j++) {
        good = make_node(&r->node[j], config_of(config, j)) && good;
    }
    good = good && make_judge(r);
    for (int64_t i = 0; good && (i < count); i++) {
        r->run = i;
        result->blamed_at[i] = -1;
        result->blamed[i] = 0;
        good = begin_run(r, (uint64_t)(first + i));
        if (good) {
            one_run(r);
        }
    }
    for (int32_t j = 0; j < config->nodes; j++) {
        free_node(&r->node[j]);
    }
    free_judge(r);
    free(r);
    return good;
}

#endif
