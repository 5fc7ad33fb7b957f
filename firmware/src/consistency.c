#include "hullguard/consistency.h"

#include <stddef.h>

#if HG_REAL_F32 || HG_REAL_F64

static uint16_t hypothesis(const hg_consistency *self, uint8_t onset, uint8_t i)
{
    return (uint16_t)(((uint16_t)onset * self->fusion->config->sensors) + i);
}

static hg_real *response(const hg_consistency *self, uint16_t h)
{
    return &self->f[(uint32_t)h * self->fusion->config->states];
}

/* A bias of every sensor that begins in the next sample. */
static void begin_onset(hg_consistency *self, uint8_t onset)
{
    const hg_fusion_config *filter = self->fusion->config;
    for (uint8_t i = 0U; i < filter->sensors; i++) {
        const uint16_t h = hypothesis(self, onset, i);
        hg_real *f = response(self, h);
        self->sum[h].d = HG_REAL_ZERO;
        self->sum[h].c = HG_REAL_ZERO;
        for (uint8_t j = 0U; j < filter->states; j++) {
            f[j] = HG_REAL_ZERO;
        }
    }
}

hg_status hg_consistency_start(hg_consistency *self, const hg_consistency_config *config, const hg_fusion *fusion, const hg_consistency_memory *memory)
{
    if ((self == NULL) || (config == NULL) || (fusion == NULL) || (memory == NULL) || (memory->sum == NULL) || (memory->sensor == NULL) ||
        (memory->real == NULL)) {
        return HG_E_ARGUMENT;
    }
    if ((config->onsets < 1U) || (config->stride < 1U) || (config->least == NULL) || (config->confirm < 1U) || (config->repeats < 2U) ||
        (!(config->limit > HG_REAL_ZERO))) {
        return HG_E_CONFIG;
    }
    self->config = config;
    self->fusion = fusion;
    self->sum = memory->sum;
    self->sensor = memory->sensor;
    self->next = memory->real;
    self->f = &memory->real[fusion->config->states];
    for (uint8_t i = 0U; i < fusion->config->sensors; i++) {
        self->sensor[i].equal = 0U;
        self->sensor[i].y = HG_REAL_ZERO;
    }
    hg_consistency_reset(self);
    return HG_OK;
}

void hg_consistency_reset(hg_consistency *self)
{
    for (uint8_t onset = 0U; onset < self->config->onsets; onset++) {
        begin_onset(self, onset);
    }
    for (uint8_t i = 0U; i < self->fusion->config->sensors; i++) {
        self->sensor[i].score = HG_REAL_ZERO;
    }
    self->onset = 0U;
    self->since = 0U;
    self->leader = 0U;
    self->leads = 0U;
    self->rests = self->config->rest;
    self->blamed = 0U;
}

/* C_l f */
static hg_real seen_by(const hg_fusion_config *filter, uint8_t l, const hg_real *f)
{
    hg_real sum = HG_REAL_ZERO;
    if (filter->select != NULL) {
        sum = f[filter->select[l]];
    } else {
        for (uint8_t j = 0U; j < filter->states; j++) {
            sum += filter->C[((uint16_t)l * filter->states) + j] * f[j];
        }
    }
    return sum;
}

/* One sample of the hypothesis that sensor i is biased. */
static void follow(const hg_consistency *self, uint8_t i, hg_real *f, hg_consistency_sum *sum)
{
    const hg_fusion_config *filter = self->fusion->config;
    const uint8_t n = filter->states;
    for (uint8_t a = 0U; a < n; a++) {
        hg_acc moved = hg_acc_zero();
        for (uint8_t b = 0U; b < n; b++) {
            moved = hg_acc_mac(moved, filter->A[((uint16_t)a * n) + b], f[b]);
        }
        self->next[a] = hg_acc_real(moved, 0);
    }
    for (uint8_t a = 0U; a < n; a++) {
        f[a] = self->next[a];
    }
    for (uint8_t l = 0U; l < filter->sensors; l++) {
        const hg_fusion_record *record = &self->fusion->record[l];
        if (record->spread > HG_REAL_ZERO) {
            const hg_real rho = ((l == i) ? HG_REAL_C(1.0) : HG_REAL_ZERO) - seen_by(filter, l, f);
            const hg_real weight = rho / record->spread;
            sum->d += weight * record->residual;
            sum->c += weight * rho;
            for (uint8_t a = 0U; a < n; a++) {
                f[a] += record->gain[a] * rho;
            }
        }
    }
}

/* Twice the logarithm of the likelihood ratio of a bias of at least this size. Of either sign: the sign of d is the better one. */
static hg_real likelihood(const hg_consistency_sum *sum, hg_real least)
{
    const hg_real d = hg_real_abs(sum->d);
    const hg_real b = (d > (least * sum->c)) ? (d / sum->c) : least;
    return b * ((HG_REAL_C(2.0) * d) - (b * sum->c));
}

/* How often the sensor has said the same. */
static void look_for_repeats(hg_consistency_sensor *sensor, const hg_fusion_record *record)
{
    if (record->value) {
        const bool same = (record->y >= sensor->y) && (record->y <= sensor->y);
        const uint8_t more = (sensor->equal < UINT8_MAX) ? (uint8_t)(sensor->equal + 1U) : sensor->equal;
        sensor->equal = same ? more : 1U;
        sensor->y = record->y;
    }
}

/* Is the largest score above the limit, and for how long has it been that sensor's? */
static void look_for_leader(hg_consistency *self)
{
    uint8_t best = 0U;
    for (uint8_t i = 1U; i < self->fusion->config->sensors; i++) {
        best = (self->sensor[i].score > self->sensor[best].score) ? i : best;
    }
    const uint8_t more = (self->leads < UINT8_MAX) ? (uint8_t)(self->leads + 1U) : self->leads;
    const uint8_t again = (best == self->leader) ? more : 1U;
    self->leads = (self->sensor[best].score > self->config->limit) ? again : 0U;
    self->leader = best;
}

/* Move all hypotheses one sample on. */
static void judge(hg_consistency *self)
{
    const hg_consistency_config *config = self->config;
    if (self->since >= config->stride) {
        self->onset = ((self->onset + 1U) < config->onsets) ? (uint8_t)(self->onset + 1U) : 0U;
        self->since = 0U;
        begin_onset(self, self->onset);
    }
    self->since++;
    for (uint8_t i = 0U; i < self->fusion->config->sensors; i++) {
        hg_consistency_sensor *sensor = &self->sensor[i];
        sensor->score = HG_REAL_ZERO;
        for (uint8_t onset = 0U; onset < config->onsets; onset++) {
            const uint16_t h = hypothesis(self, onset, i);
            hg_consistency_sum *sum = &self->sum[h];
            follow(self, i, response(self, h), sum);
            sensor->score = hg_real_max(sensor->score, likelihood(sum, config->least[i]));
        }
    }
    look_for_leader(self);
    if (self->leads >= config->confirm) {
        self->blamed |= (uint16_t)(1UL << self->leader);
    }
}

uint16_t hg_consistency_step(hg_consistency *self)
{
    for (uint8_t i = 0U; i < self->fusion->config->sensors; i++) {
        hg_consistency_sensor *sensor = &self->sensor[i];
        const uint16_t bit = (uint16_t)(1UL << i);
        look_for_repeats(sensor, &self->fusion->record[i]);
        if ((self->rests == 0U) && (sensor->equal >= self->config->repeats) && ((self->fusion->excluded & bit) == 0U)) {
            self->blamed |= bit;
        }
    }
    if (self->rests == 0U) {
        judge(self);
    } else {
        self->rests--;
    }
    return self->blamed;
}

#endif
