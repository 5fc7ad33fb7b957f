#include "hullguard/isolate.h"

#if !HG_REAL_Q31

#include "hullguard/linalg.h"

#include <stddef.h>

/* ---- The regression: X = D^(1/2) R with R unit upper triangular, column 0 of ones ---- */

typedef struct {
    uint8_t  columns;
    hg_real *weight;   /* [columns] D */
    hg_real *triangle; /* R above its diagonal, row after row */
    hg_real *right;    /* [columns] the same rotations of the right-hand side */
    hg_real *rest;     /* [1] sum of squares that nothing explains */
} factor;

static factor factor_at(const hg_isolate *self, uint8_t place)
{
    const uint8_t columns = (uint8_t)(self->config->components + 1U);
    const uint16_t entries = (uint16_t)(((uint16_t)columns * self->config->components) / 2U);
    hg_real *memory = &self->factor[place * HG_ISOLATE_FACTOR(self->config->components)];
    return (factor){.columns = columns,
                    .weight = memory,
                    .triangle = &memory[columns],
                    .right = &memory[(uint16_t)columns + entries],
                    .rest = &memory[(2U * (uint16_t)columns) + entries]};
}

static void factor_clear(const hg_isolate *self, uint8_t place)
{
    const uint32_t size = HG_ISOLATE_FACTOR(self->config->components);
    for (uint32_t i = 0U; i < size; i++) {
        self->factor[(place * size) + i] = HG_REAL_ZERO;
    }
}

/* R_ij, i < j */
static hg_real *above(const factor *f, uint8_t i, uint8_t j)
{
    const uint32_t row = i;
    const uint32_t before = (row * f->columns) - ((row * (row + 1U)) / 2U);
    return &f->triangle[(before + j) - (row + 1U)];
}

/* One more equation x b = y of the given weight, whose first entry that is not 0 is x[first]; x is used up. A rotation makes x[i] 0. In this form
   each new entry is a mean of the old one and the equation's: it cannot grow, whatever the weights (Gentleman 1973, formula without square roots). */
static void factor_take(const factor *f, uint8_t first, hg_real *x, hg_real y, hg_real weight)
{
    hg_real left = weight;
    hg_real right = y;
    for (uint8_t i = first; i < f->columns; i++) {
        const hg_real scaled = left * x[i];
        const hg_real sum = f->weight[i] + (scaled * x[i]);
        if (sum > HG_REAL_ZERO) { /* else neither of them says anything of column i */
            const hg_real old = f->weight[i] / sum;
            const hg_real fresh = scaled / sum;
            f->weight[i] = sum;
            left *= old;
            for (uint8_t j = (uint8_t)(i + 1U); j < f->columns; j++) {
                hg_real *r = above(f, i, j);
                const hg_real before = x[j];
                x[j] -= x[i] * *r;
                *r = (old * *r) + (fresh * before);
            }
            const hg_real before = right;
            right -= x[i] * f->right[i];
            f->right[i] = (old * f->right[i]) + (fresh * before);
        }
    }
    *f->rest += left * right * right;
}

/* All equations that are in another factor. */
static void factor_merge(const factor *f, const factor *other, hg_real *row)
{
    for (uint8_t i = 0U; i < other->columns; i++) {
        row[i] = HG_REAL_C(1.0);
        for (uint8_t j = (uint8_t)(i + 1U); j < other->columns; j++) {
            row[j] = *above(other, i, j);
        }
        factor_take(f, i, row, other->right[i], other->weight[i]);
    }
    *f->rest += *other->rest;
}

/* b = R^-1 right. A column that moves, beyond what the ones before it explain, by less than its least scatter is left out: what rounding and noise
   would make of it is no number to show. */
static void factor_solve(const factor *f, const hg_real *least, hg_real *b)
{
    for (uint8_t i = f->columns; i > 0U; i--) {
        const uint8_t row = (uint8_t)(i - 1U);
        hg_real sum = f->right[row];
        for (uint8_t j = i; j < f->columns; j++) {
            sum -= *above(f, row, j) * b[j];
        }
        b[row] = sum;
        if ((row > 0U) && (f->weight[row] < (f->weight[0] * least[row - 1U] * least[row - 1U]))) {
            b[row] = HG_REAL_ZERO;
        }
    }
}

/* ---- The judgement ---- */

typedef struct {     /* of one column, or of fhat, over the window */
    hg_real mean;
    hg_real scatter; /* sum of squares about the mean */
    hg_real shared;  /* sum of products with fhat about the means */
} moments;

static moments moments_of(const factor *f, uint8_t j)
{
    moments m = {.mean = *above(f, 0U, j), .scatter = f->weight[j], .shared = f->weight[j] * f->right[j]};
    for (uint8_t i = 1U; i < j; i++) {
        const hg_real r = *above(f, i, j);
        m.scatter += f->weight[i] * r * r;
        m.shared += f->weight[i] * r * f->right[i];
    }
    return m;
}

static moments moments_of_fault(const factor *f)
{
    moments m = {.mean = f->right[0], .scatter = *f->rest, .shared = HG_REAL_ZERO};
    for (uint8_t i = 1U; i < f->columns; i++) {
        m.scatter += f->weight[i] * f->right[i] * f->right[i];
    }
    m.shared = m.scatter;
    return m;
}

/* Does one column explain more than a share of fhat's squares? */
static bool explains(hg_real shared, hg_real squares, hg_real total, hg_real share)
{
    return (squares > HG_REAL_ZERO) && (((shared / squares) * shared) > (share * total));
}

/* Alone, about the means and about 0: what has an offset as well is not this component's doing. */
static bool names(const hg_isolate_config *config, uint8_t component, hg_real n, const moments *m, const moments *fault)
{
    const hg_real least = config->excitation[component];
    return (m->scatter >= (n * least * least)) && explains(m->shared, m->scatter, fault->scatter, config->explained) &&
           explains(m->shared + (n * m->mean * fault->mean), m->scatter + (n * m->mean * m->mean),
                    fault->scatter + (n * fault->mean * fault->mean), config->explained);
}

static bool is_steady(const hg_isolate_config *config, hg_real n, const moments *m)
{
    return (n * m->mean * m->mean) > (config->steady * config->steady * m->scatter);
}

static uint32_t place_bit(uint8_t i)
{
    return (uint32_t)1U << i;
}

static void conclude(hg_isolation *found, hg_cause cause, uint32_t candidates)
{
    found->cause = cause;
    found->candidates = candidates;
}

static void name_cause(hg_isolate *self, const factor *f)
{
    const hg_isolate_config *config = self->config;
    hg_isolation *found = &self->found;
    const hg_real n = f->weight[0];
    const moments fault = moments_of_fault(f);
    uint32_t named = 0U;
    uint32_t rivals = 0U; /* that stand as still as fhat and could exert it: at rest the spring carries what the actuator does, so a half, not the whole */
    uint8_t count = 0U;
    for (uint8_t i = 0U; i < config->components; i++) {
        const moments m = moments_of(f, (uint8_t)(i + 1U));
        if (names(config, i, n, &m, &fault)) {
            named |= place_bit((uint8_t)(i + 1U));
            count++;
        }
        if (is_steady(config, n, &m) && (hg_real_abs(m.mean) >= (HG_REAL_C(0.5) * hg_real_abs(fault.mean)))) {
            rivals |= place_bit((uint8_t)(i + 1U));
        }
    }
    const uint32_t components = place_bit((uint8_t)(config->components + 1U)) - 2U;
    found->explained = (fault.scatter > *f->rest) ? ((fault.scatter - *f->rest) / fault.scatter) : HG_REAL_ZERO;
    found->ratio = (fault.scatter > HG_REAL_ZERO) ? hg_real_min((n * fault.mean * fault.mean) / fault.scatter, HG_REAL_MAX) : HG_REAL_MAX;
    if (count > 0U) {
        conclude(found, (count == 1U) ? HG_CAUSE_COMPONENT : HG_CAUSE_AMBIGUOUS, named);
    } else if (is_steady(config, n, &fault)) {
        conclude(found, (rivals == 0U) ? HG_CAUSE_ACTUATOR : HG_CAUSE_AMBIGUOUS, rivals | 1U);
    } else if (found->explained > config->explained) {
        conclude(found, HG_CAUSE_AMBIGUOUS, components);
    } else {
        conclude(found, HG_CAUSE_AMBIGUOUS, components | 1U);
    }
    factor_solve(f, config->excitation, self->share);
}

static void judge_window(hg_isolate *self)
{
    const uint8_t blocks = self->config->blocks;
    const factor window = factor_at(self, blocks);
    factor_clear(self, blocks);
    for (uint8_t b = 0U; b < blocks; b++) {
        const factor block = factor_at(self, b);
        factor_merge(&window, &block, self->row);
    }
    name_cause(self, &window);
}

/* ---- The module ---- */

static bool table_valid(const hg_real *table, uint16_t n)
{
    return (n == 0U) || ((table != NULL) && hg_linalg_finite(table, n));
}

static bool places_valid(const hg_isolate_config *config)
{
    bool valid = (config->actuator < config->estimates) && ((config->sensors == 0U) || (config->sensor != NULL));
    for (uint8_t i = 0U; valid && (i < config->sensors); i++) {
        valid = config->sensor[i] < config->estimates;
    }
    return valid;
}

bool hg_isolate_valid(const hg_isolate_config *config)
{
    const uint16_t candidates = (uint16_t)(1U + (uint16_t)config->components + config->sensors);
    bool valid = (candidates <= 31U) && places_valid(config) && (config->release >= 1U) && (config->block >= 1U) && (config->blocks >= 1U);
    valid = valid && (config->limit >= HG_REAL_ZERO) && (config->low_pass > HG_REAL_ZERO) && (config->low_pass <= HG_REAL_C(1.0)) &&
            (config->explained >= HG_REAL_ZERO) && (config->explained < HG_REAL_C(1.0)) && (config->steady > HG_REAL_ZERO);
    valid = valid && table_valid(config->sensor_limit, config->sensors) && table_valid(config->excitation, config->components) &&
            table_valid(config->whole, (uint16_t)((uint16_t)config->components * config->estimates));
    for (uint8_t i = 0U; valid && (i < config->components); i++) {
        valid = config->excitation[i] > HG_REAL_ZERO;
    }
    return valid;
}

hg_status hg_isolate_start(hg_isolate *self, const hg_isolate_config *config, hg_real *memory)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!hg_isolate_valid(config)) {
        return HG_E_CONFIG;
    }
    const uint16_t columns = (uint16_t)(config->components + 1U);
    self->config = config;
    self->share = memory;
    self->row = &memory[columns];
    self->now = &memory[2U * columns];
    self->smooth = &self->now[config->components];
    self->factor = &self->smooth[config->components];
    hg_isolate_reset(self);
    return HG_OK;
}

static void begin_episode(hg_isolate *self)
{
    self->episode = true;
    self->age = 0U;
    self->filled = 0U;
    self->open = 0U;
    self->complete = 0U;
    factor_clear(self, 0U);
    conclude(&self->found, HG_CAUSE_UNDECIDED, place_bit((uint8_t)(self->config->components + 1U)) - 1U);
}

static void end_episode(hg_isolate *self)
{
    self->episode = false;
    conclude(&self->found, HG_CAUSE_INPUT, 0U);
}

void hg_isolate_reset(hg_isolate *self)
{
    for (uint8_t i = 0U; i < self->config->components; i++) {
        self->now[i] = HG_REAL_ZERO;
        self->smooth[i] = HG_REAL_ZERO;
    }
    for (uint8_t i = 0U; i <= self->config->components; i++) {
        self->share[i] = HG_REAL_ZERO;
    }
    self->found = (hg_isolation){.cause = HG_CAUSE_INPUT, .basis = HG_BASIS_STATISTICAL, .candidates = 0U, .explained = HG_REAL_ZERO,
                                 .ratio = HG_REAL_ZERO};
    self->quiet = UINT32_MAX;
    self->silent = UINT32_MAX;
    self->seen = 0U;
    end_episode(self);
}

/* Forces of the whole components, and whether all that is read may come in. */
static bool read_forces(hg_isolate *self, const hg_real *estimate, const hg_real *radius)
{
    const hg_isolate_config *config = self->config;
    bool good = true;
    for (uint8_t e = 0U; e < config->estimates; e++) {
        good = good && (hg_real_abs(estimate[e]) <= HG_ISOLATE_LARGEST) && (radius[e] >= HG_REAL_ZERO);
    }
    for (uint8_t i = 0U; good && (i < config->components); i++) {
        hg_acc sum = hg_acc_zero();
        for (uint8_t e = 0U; e < config->estimates; e++) {
            sum = hg_acc_mac(sum, config->whole[((uint16_t)i * config->estimates) + e], estimate[e]);
        }
        self->row[i] = hg_acc_real(sum, 0);
        good = hg_real_abs(self->row[i]) <= HG_ISOLATE_LARGEST;
    }
    return good;
}

/* phi: fhat(k) is about the interval that ends at k, in which c x is the mean of its ends, but for the square of the sample time. */
static void smooth_forces(hg_isolate *self)
{
    for (uint8_t i = 0U; i < self->config->components; i++) {
        const hg_real mean = HG_REAL_C(0.5) * (self->now[i] + self->row[i]);
        self->smooth[i] += self->config->low_pass * (mean - self->smooth[i]);
        self->now[i] = self->row[i];
    }
}

static bool outside(hg_real estimate, hg_real radius, hg_real limit)
{
    return hg_real_abs(estimate) > hg_real_max(radius, limit);
}

static uint32_t count_up(uint32_t counter)
{
    return (counter < UINT32_MAX) ? (counter + 1U) : UINT32_MAX;
}

static void look_at_sensors(hg_isolate *self, const hg_real *estimate, const hg_real *radius)
{
    const hg_isolate_config *config = self->config;
    uint32_t now = 0U;
    for (uint8_t i = 0U; i < config->sensors; i++) {
        const uint8_t e = config->sensor[i];
        now |= outside(estimate[e], radius[e], config->sensor_limit[i]) ? place_bit(i) : 0U;
    }
    self->silent = (now != 0U) ? 0U : count_up(self->silent);
    self->seen = (self->silent >= config->release) ? 0U : (self->seen | now);
}

static void look_at_actuator(hg_isolate *self, const hg_real *estimate, const hg_real *radius)
{
    const hg_isolate_config *config = self->config;
    const bool now = outside(estimate[config->actuator], radius[config->actuator], config->limit);
    self->quiet = now ? 0U : count_up(self->quiet);
    if (now && (!self->episode)) {
        begin_episode(self);
    } else if (self->episode && (self->quiet >= config->release)) {
        end_episode(self);
    } else {
        /* goes on */
    }
}

/* One more sample of the regression; the end of a block is judged once the window is full. */
static void take_sample(hg_isolate *self, hg_real fault)
{
    const hg_isolate_config *config = self->config;
    const factor block = factor_at(self, self->open);
    self->row[0] = HG_REAL_C(1.0);
    for (uint8_t i = 0U; i < config->components; i++) {
        self->row[i + 1U] = self->smooth[i];
    }
    factor_take(&block, 0U, self->row, fault, HG_REAL_C(1.0));
    self->filled++;
    if (self->filled >= config->block) {
        self->filled = 0U;
        self->complete = (self->complete < config->blocks) ? (uint8_t)(self->complete + 1U) : config->blocks;
        self->open = ((self->open + 1U) < config->blocks) ? (uint8_t)(self->open + 1U) : 0U;
        if (self->complete >= config->blocks) {
            judge_window(self);
        }
        factor_clear(self, self->open);
    }
}

/* Sensors beside the actuator's estimate: a fault of their own, or one more. */
static hg_isolation together(const hg_isolate *self)
{
    hg_isolation found = self->found;
    if (self->seen != 0U) {
        const bool one = (!self->episode) && ((self->seen & (self->seen - 1U)) == 0U);
        found.cause = one ? HG_CAUSE_SENSOR : HG_CAUSE_AMBIGUOUS;
        found.candidates |= self->seen << (self->config->components + 1U);
    }
    return found;
}

hg_status hg_isolate_step(hg_isolate *self, const hg_real *estimate, const hg_real *radius, hg_isolation *found)
{
    hg_status status = HG_E_NUMERIC;
    if (read_forces(self, estimate, radius)) {
        status = HG_OK;
        smooth_forces(self);
        look_at_sensors(self, estimate, radius);
        look_at_actuator(self, estimate, radius);
        if (self->episode) {
            self->age = count_up(self->age);
            if (self->age > self->config->settle) {
                take_sample(self, estimate[self->config->actuator]);
            }
        }
    }
    *found = together(self);
    return status;
}

#endif
