#include "hullguard/zonotope.h"

#if HG_WITH_ZONOTOPE

#include <stddef.h>

/* Columns there can be before a reduction. */
static uint16_t most_columns(const hg_zonotope_config *config)
{
    return (uint16_t)((uint16_t)config->columns + config->width + config->disturbances);
}

static bool blocks_valid(const hg_zonotope_config *config)
{
    uint16_t rows = 0U;
    bool valid = (config->block != NULL) && (config->decay != NULL);
    for (uint8_t b = 0U; valid && (b < config->blocks); b++) {
        const hg_real decay = config->decay[b];
        valid = (config->block[b] >= 1U) && (decay >= HG_REAL_ZERO) && (decay < HG_REAL_C(1.0));
        valid = valid && ((config->block[b] == 2U) || (decay <= HG_REAL_ZERO));
        rows += config->block[b];
    }
    return valid && (rows == config->order);
}

static bool sizes_valid(const hg_zonotope_config *config)
{
    const bool known = (config->reduction == HG_REDUCTION_TRUNCATE) || (config->reduction == HG_REDUCTION_BALL) ||
                       ((config->reduction == HG_REDUCTION_BOX) && (config->columns >= config->order));
    return known && (config->order >= 1U) && (config->residuals >= 1U) && (config->columns >= 1U) && (config->initial <= most_columns(config)) &&
           (config->settle >= 1U);
}

bool hg_zonotope_valid(const hg_zonotope_config *config, uint8_t ring_width)
{
    bool valid = sizes_valid(config) && blocks_valid(config) && (config->state != NULL) && (config->output != NULL) &&
                 (config->outer != NULL) && (config->bias_rest != NULL) && (config->bias_moving != NULL) && (config->always != NULL) &&
                 (config->growth != NULL) && (config->output_growth != NULL);
    valid = valid && ((config->disturbances == 0U) || (config->disturbance != NULL));
    valid = valid && ((config->initial == 0U) || ((config->rest != NULL) && (config->moving != NULL)));
    valid = valid && ((config->width == 0U) || ((config->signal != NULL) && (config->input != NULL) && (config->direct != NULL)));
    for (uint8_t g = 0U; valid && (g < config->width); g++) {
        valid = config->signal[g] < ring_width;
    }
    return valid;
}

static hg_real *column_of(const hg_zonotope *self, uint16_t i)
{
    return &self->column[(uint32_t)i * self->config->order];
}

static hg_real magnitude(const hg_real *column, uint8_t rows)
{
    hg_real sum = HG_REAL_ZERO;
    for (uint8_t m = 0U; m < rows; m++) {
        sum += hg_real_abs(column[m]);
    }
    return sum;
}

/* Euclid's norm of two entries, from above by at most 2 %: for the larger one first, the tangents of the circle at pi/16 and 3 pi/16 touch
 * one around it. Their numbers are rounded up by more than three operations can lose. */
static hg_real euclid(hg_real a, hg_real b)
{
    const hg_real large = hg_real_max(hg_real_abs(a), hg_real_abs(b));
    const hg_real small = hg_real_min(hg_real_abs(a), hg_real_abs(b));
    const hg_real flat = large + hg_real_mul(HG_REAL_C(0.19892), small);
    const hg_real steep = hg_real_mul(HG_REAL_C(0.84776), large) + hg_real_mul(HG_REAL_C(0.56646), small);
    return hg_real_max(flat, steep);
}

/* Sum of the magnitudes of all that is in the set; what every relative error is a share of. */
static hg_real size_of(const hg_zonotope *self)
{
    hg_real sum = magnitude(self->spread, self->config->order);
    for (uint16_t i = 0U; i < self->count; i++) {
        sum += magnitude(column_of(self, i), self->config->order);
    }
    return sum;
}

/* A set that holds nothing. */
static void empty(hg_zonotope *self)
{
    self->count = 0U;
    self->size = HG_REAL_ZERO;
    for (uint8_t m = 0U; m < self->config->order; m++) {
        self->spread[m] = HG_REAL_ZERO;
    }
}

/* Nothing that is not finite may stay. What was in the set moves on unseen by Lam, whose norm bounds it: after `recover` samples it is
 * within always[], which the spread holds by then. */
static void settle_size(hg_zonotope *self)
{
    self->size = size_of(self);
    if (!hg_real_finite(self->size)) {
        empty(self);
        self->lost = self->config->recover;
    }
}

static void swap_columns(hg_zonotope *self, uint16_t i, uint16_t j)
{
    hg_real *a = column_of(self, i);
    hg_real *b = column_of(self, j);
    for (uint8_t m = 0U; m < self->config->order; m++) {
        const hg_real entry = a[m];
        a[m] = b[m];
        b[m] = entry;
    }
    const hg_real score = self->score[i];
    self->score[i] = self->score[j];
    self->score[j] = score;
}

/* Restore the heap of the first n columns, smallest score on top, below place i. */
static void sift(hg_zonotope *self, uint16_t i, uint16_t n)
{
    uint16_t parent = i;
    uint32_t child = (2U * (uint32_t)i) + 1U;
    while (child < n) {
        if (((child + 1U) < n) && (self->score[child + 1U] < self->score[child])) {
            child++;
        }
        if (self->score[child] >= self->score[parent]) {
            break;
        }
        swap_columns(self, parent, (uint16_t)child);
        parent = (uint16_t)child;
        child = (2U * child) + 1U;
    }
}

/* What a column is worth keeping for. */
static hg_real score_of(const hg_zonotope *self, const hg_real *column)
{
    const hg_zonotope_config *config = self->config;
    hg_real squares = HG_REAL_ZERO;
    hg_real largest = HG_REAL_ZERO;
    for (uint8_t m = 0U; m < config->order; m++) {
        squares += hg_real_mul(column[m], column[m]);
        largest = hg_real_max(largest, hg_real_abs(column[m]));
    }
    return (config->reduction == HG_REDUCTION_TRUNCATE) ? squares : (magnitude(column, config->order) - largest);
}

/* Bring the `keep` columns of the highest score to the front. */
static void select_columns(hg_zonotope *self, uint16_t keep)
{
    for (uint16_t i = 0U; i < self->count; i++) {
        self->score[i] = score_of(self, column_of(self, i));
    }
    for (uint16_t i = keep / 2U; i > 0U; i--) {
        sift(self, (uint16_t)(i - 1U), keep);
    }
    for (uint16_t i = keep; (keep > 0U) && (i < self->count); i++) {
        if (self->score[i] > self->score[0]) {
            swap_columns(self, 0U, i);
            sift(self, 0U, keep);
        }
    }
}

/* Columns from `keep` on become the box around their sum: one column a row. */
static void box(hg_zonotope *self, uint16_t keep)
{
    const uint8_t order = self->config->order;
    for (uint8_t m = 0U; m < order; m++) {
        self->scratch[m] = HG_REAL_ZERO;
    }
    for (uint16_t i = keep; i < self->count; i++) {
        const hg_real *column = column_of(self, i);
        for (uint8_t m = 0U; m < order; m++) {
            self->scratch[m] += hg_real_abs(column[m]);
        }
    }
    for (uint8_t i = 0U; i < order; i++) {
        hg_real *column = column_of(self, (uint16_t)(keep + i));
        for (uint8_t m = 0U; m < order; m++) {
            column[m] = (m == i) ? self->scratch[m] : HG_REAL_ZERO;
        }
    }
}

/* A column goes into the spread. */
static void enclose(hg_zonotope *self, const hg_real *column)
{
    const hg_zonotope_config *config = self->config;
    uint16_t row = 0U;
    for (uint8_t b = 0U; b < config->blocks; b++) {
        const bool round = config->decay[b] > HG_REAL_ZERO;
        for (uint8_t m = 0U; m < config->block[b]; m++) {
            self->spread[row + m] += round ? euclid(column[row], column[row + 1U]) : hg_real_abs(column[row + m]);
        }
        row += config->block[b];
    }
}

/* At most q columns. */
static void reduce(hg_zonotope *self)
{
    const hg_zonotope_config *config = self->config;
    if (self->count <= config->columns) {
        return;
    }
    if (config->reduction == HG_REDUCTION_BOX) {
        const uint16_t keep = (uint16_t)config->columns - config->order;
        select_columns(self, keep);
        box(self, keep);
    } else {
        select_columns(self, config->columns);
        for (uint16_t i = config->columns; (config->reduction == HG_REDUCTION_BALL) && (i < self->count); i++) {
            enclose(self, column_of(self, i));
        }
    }
    self->count = config->columns;
}

hg_status hg_zonotope_start(hg_zonotope *self, const hg_zonotope_config *config, const hg_ring *ring, hg_start how, hg_real *memory)
{
    if ((self == NULL) || (config == NULL) || (ring == NULL) || (memory == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!hg_zonotope_valid(config, ring->width)) {
        return HG_E_CONFIG;
    }
    const uint16_t most = most_columns(config);
    self->config = config;
    self->column = memory;
    self->score = &self->column[(uint32_t)most * config->order];
    self->spread = &self->score[most];
    self->scratch = &self->spread[config->order];
    hg_zonotope_reset(self, how);
    return HG_OK;
}

void hg_zonotope_reset(hg_zonotope *self, hg_start how)
{
    const hg_zonotope_config *config = self->config;
    const hg_real *initial = (how == HG_START_REST) ? config->rest : config->moving;
    empty(self);
    self->lost = 0U;
    self->k = 0U;
    self->how = how;
    for (uint16_t i = 0U; i < ((uint16_t)config->initial * config->order); i++) {
        self->column[i] = initial[i];
    }
    self->count = config->initial;
    reduce(self);
    settle_size(self);
}

/* One block of Lam, or of its magnitudes, times its part of a column. */
static void multiply(const hg_zonotope *self, const hg_real *lam, uint8_t rows, bool magnitudes, hg_real *part)
{
    for (uint8_t m = 0U; m < rows; m++) {
        hg_acc sum = hg_acc_zero();
        for (uint8_t n = 0U; n < rows; n++) {
            const hg_real factor = lam[((uint16_t)m * rows) + n];
            sum = hg_acc_mac(sum, magnitudes ? hg_real_abs(factor) : factor, part[n]);
        }
        self->scratch[m] = hg_acc_real(sum, 0);
    }
    for (uint8_t m = 0U; m < rows; m++) {
        part[m] = self->scratch[m];
    }
}

/* Lam times a column. */
static void propagate(const hg_zonotope *self, hg_real *column)
{
    const hg_zonotope_config *config = self->config;
    const hg_real *lam = config->state;
    hg_real *part = column;
    for (uint8_t b = 0U; b < config->blocks; b++) {
        multiply(self, lam, config->block[b], false, part);
        part = &part[config->block[b]];
        lam = &lam[(uint16_t)config->block[b] * config->block[b]];
    }
}

/* The spread one sample on: discs by the norm of their block, boxes by the magnitudes of theirs. */
static void propagate_spread(hg_zonotope *self)
{
    const hg_zonotope_config *config = self->config;
    const hg_real *lam = config->state;
    hg_real *part = self->spread;
    for (uint8_t b = 0U; b < config->blocks; b++) {
        if (config->decay[b] > HG_REAL_ZERO) {
            part[0] = hg_real_mul(config->decay[b], part[0]);
            part[1] = part[0];
        } else {
            multiply(self, lam, config->block[b], true, part);
        }
        part = &part[config->block[b]];
        lam = &lam[(uint16_t)config->block[b] * config->block[b]];
    }
    for (uint8_t m = 0U; m < config->order; m++) {
        self->spread[m] += config->always[m];
    }
}

/* One more column: `factor` times this one. */
static hg_real *append(hg_zonotope *self, const hg_real *column, hg_real factor)
{
    hg_real *made = column_of(self, self->count);
    for (uint8_t m = 0U; m < self->config->order; m++) {
        made[m] = hg_real_mul(column[m], factor);
    }
    self->size += magnitude(made, self->config->order);
    self->count++;
    return made;
}

/* What a step, or several, may have missed of magnitudes that sum up to this. */
static void miss(hg_zonotope *self, hg_real size)
{
    for (uint8_t m = 0U; m < self->config->order; m++) {
        self->spread[m] += hg_real_mul(self->config->growth[m], size);
    }
}

void hg_zonotope_widen(hg_zonotope *self, uint8_t lag, uint8_t first, uint8_t count, const hg_real *increase)
{
    const hg_zonotope_config *config = self->config;
    hg_real size = HG_REAL_ZERO;
    if ((lag == 0U) || (lag > self->k)) {
        return;
    }
    for (uint8_t g = 0U; g < config->width; g++) {
        const uint8_t place = config->signal[g];
        if ((place >= first) && ((place - first) < count) && (increase[place - first] > HG_REAL_ZERO)) {
            hg_real *column = append(self, &config->input[(uint16_t)g * config->order], increase[place - first]);
            size += magnitude(column, config->order);
            for (uint8_t j = 1U; j < lag; j++) {
                propagate(self, column);
                size += magnitude(column, config->order);
            }
        }
    }
    /* Earlier errors have shrunk since; that they have not is on the safe side. */
    miss(self, size);
    reduce(self);
    settle_size(self);
}

/* J of this sample from the set as it is. */
static void evaluate(const hg_zonotope *self, const hg_real *radius, hg_real *J)
{
    const hg_zonotope_config *config = self->config;
    const uint16_t row = (self->k < config->settle) ? self->k : (uint16_t)(config->settle - 1U);
    const hg_real *bias = &((self->how == HG_START_REST) ? config->bias_rest : config->bias_moving)[(uint32_t)row * config->residuals];
    for (uint8_t i = 0U; i < config->residuals; i++) {
        const hg_real *output = &config->output[(uint16_t)i * config->order];
        hg_acc sum = hg_acc_mac(hg_acc_zero(), config->output_growth[i], self->size);
        for (uint8_t g = 0U; g < config->width; g++) {
            sum = hg_acc_mac(sum, config->direct[((uint16_t)i * config->width) + g], radius[config->signal[g]]);
        }
        for (uint8_t m = 0U; m < config->order; m++) {
            sum = hg_acc_mac(sum, config->outer[((uint16_t)i * config->order) + m], self->spread[m]);
        }
        for (uint16_t c = 0U; c < self->count; c++) {
            const hg_real *column = column_of(self, c);
            hg_acc dot = hg_acc_zero();
            for (uint8_t m = 0U; m < config->order; m++) {
                dot = hg_acc_mac(dot, output[m], column[m]);
            }
            sum += hg_real_abs(hg_acc_real(dot, 0));
        }
        J[i] = bias[i] + hg_acc_real(sum, 0);
        /* Not min(): a difference of infinities is no number, and as large as any. */
        if ((self->lost > 0U) || (!hg_real_finite(J[i]))) {
            J[i] = HG_REAL_MAX;
        }
    }
}

void hg_zonotope_step(hg_zonotope *self, const hg_ring *ring, hg_real *J)
{
    const hg_zonotope_config *config = self->config;
    const hg_real *radius = hg_ring_row(ring, 0U);
    evaluate(self, radius, J);
    for (uint16_t i = 0U; i < self->count; i++) {
        propagate(self, column_of(self, i));
    }
    propagate_spread(self);
    for (uint8_t g = 0U; g < config->width; g++) {
        if (radius[config->signal[g]] > HG_REAL_ZERO) {
            (void)append(self, &config->input[(uint16_t)g * config->order], radius[config->signal[g]]);
        }
    }
    for (uint8_t d = 0U; d < config->disturbances; d++) {
        (void)append(self, &config->disturbance[(uint16_t)d * config->order], HG_REAL_C(1.0));
    }
    /* size is now that of before and what has come in: all that this sample's errors are a share of. */
    miss(self, self->size);
    reduce(self);
    if ((self->lost > 0U) && (self->lost < UINT16_MAX)) {
        self->lost--;
    }
    settle_size(self);
    self->k = (self->k < UINT16_MAX) ? (uint16_t)(self->k + 1U) : UINT16_MAX;
}

bool hg_zonotope_ready(const hg_zonotope *self)
{
    const uint16_t needed = (self->how == HG_START_REST) ? self->config->ready_rest : self->config->ready_moving;
    return (self->lost == 0U) && (self->k >= needed);
}

#endif
