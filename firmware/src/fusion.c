#include "hullguard/fusion.h"

#include <stddef.h>

#if HG_REAL_F32 || HG_REAL_F64

#define DEPTH_MAX 14U         /* a stamp modulo 16 names 16 samples, and one of them is the next */
#define STAMPS 16U
#define PAST 8U               /* samples before a frame that it can speak of */
#define PRIOR HG_REAL_C(16.0) /* frames that the loss rate to begin with is worth */
#define STEPS_MAX HG_REAL_C(32767.0) /* of the origin in one sample: more is no motion but a state that is about to be lost */

static uint16_t square(uint8_t n)
{
    return (uint16_t)((uint16_t)n * n);
}

/* Place of row a, column b in a row-major matrix of n columns. */
static uint16_t at(uint8_t n, uint8_t a, uint8_t b)
{
    return (uint16_t)(((uint16_t)a * n) + b);
}

static bool all_tables_valid(const hg_fusion_config *config)
{
    bool valid = (config->tables >= 1U) && (config->table != NULL);
    for (uint8_t t = 0U; valid && (t < config->tables); t++) {
        const hg_fusion_table *table = &config->table[t];
        valid = (table->level != NULL) && (table->relax != NULL) && ((config->delay == 0U) || (table->early != NULL));
    }
    return valid;
}

/* The origin of state j may move if nothing but state j itself follows from it. */
static bool origin_valid(const hg_fusion_config *config)
{
    bool valid = true;
    for (uint8_t j = 0U; (config->origin != NULL) && (j < config->states); j++) {
        for (uint8_t i = 0U; (config->origin[j] > HG_REAL_ZERO) && (i < config->states); i++) {
            const hg_real a = config->A[at(config->states, i, j)] - ((i == j) ? HG_REAL_C(1.0) : HG_REAL_ZERO);
            valid = valid && (a >= HG_REAL_ZERO) && (a <= HG_REAL_ZERO);
        }
    }
    return valid;
}

static bool sensors_valid(const hg_fusion_config *config)
{
    bool valid = (config->R != NULL) && (config->range != NULL) && ((config->select != NULL) || (config->C != NULL));
    for (uint8_t i = 0U; valid && (i < config->sensors); i++) {
        valid = (config->R[i] > HG_REAL_ZERO) && (config->range[i] > HG_REAL_ZERO);
        valid = valid && ((config->select == NULL) || (config->select[i] < config->states));
    }
    return valid;
}

bool hg_fusion_valid(const hg_fusion_config *config)
{
    bool valid = (config->states >= 1U) && (config->states <= HG_FUSION_STATES_MAX) && (config->sensors >= 1U) &&
                 (config->sensors <= HG_FUSION_SENSORS_MAX) && (config->depth <= DEPTH_MAX) && (config->delay <= config->depth);
    valid = valid && (config->heartbeat >= 1U) && (config->heartbeat <= config->watchdog) && (config->watchdog < UINT8_MAX) &&
            (config->modulus >= 2U) && (config->modulus <= 256U);
    valid = valid && (config->trigger >= HG_FUSION_OBSERVATION) && (config->trigger <= HG_FUSION_OWN);
    valid = valid && (config->A != NULL) && (config->Q != NULL) && (config->x0 != NULL) && (config->P0 != NULL) &&
            ((config->inputs == 0U) || (config->B != NULL));
    valid = valid && (config->rates >= 1U) && (config->rate_step > HG_REAL_ZERO) && (config->smoothing >= HG_REAL_ZERO) &&
            (config->smoothing <= HG_REAL_C(1.0)) && (config->loss >= HG_REAL_ZERO) && (config->loss <= HG_REAL_C(1.0));
    return valid && sensors_valid(config) && all_tables_valid(config) && origin_valid(config);
}

/* The sample `lag` before the newest; lag < held. */
static hg_fusion_slot *slot_of(const hg_fusion *self, uint8_t lag)
{
    const uint8_t place = (self->newest >= lag) ? (uint8_t)(self->newest - lag) : (uint8_t)((self->newest + self->config->depth + 1U) - lag);
    return &self->slot[place];
}

/* C_i v */
static hg_real row_times(const hg_fusion_config *config, uint8_t i, const hg_real *v)
{
    hg_real result;
    if (config->select != NULL) {
        result = v[config->select[i]];
    } else {
        hg_acc sum = hg_acc_zero();
        for (uint8_t j = 0U; j < config->states; j++) {
            sum = hg_acc_mac(sum, config->C[at(config->states, i, j)], v[j]);
        }
        result = hg_acc_real(sum, 0);
    }
    return result;
}

/* g = P C_i' */
static void times_row(const hg_fusion_config *config, const hg_real *P, uint8_t i, hg_real *g)
{
    for (uint8_t a = 0U; a < config->states; a++) {
        g[a] = row_times(config, i, &P[(uint16_t)a * config->states]);
    }
}

/* x + K r and P by Joseph's form: (I - K C) P (I - K C)' + R K K', whose (I - K C) P C' is g - K p with p = C g. The upper half, mirrored. */
static void update(const hg_fusion *self, hg_real *x, hg_real *P, hg_real p, hg_real r, hg_real R, hg_real *K)
{
    const uint8_t n = self->config->states;
    const hg_real *g = self->g;
    const hg_real per_s = HG_REAL_C(1.0) / (p + R);
    for (uint8_t a = 0U; a < n; a++) {
        K[a] = g[a] * per_s;
    }
    for (uint8_t a = 0U; a < n; a++) {
        const hg_real rest = g[a] - (K[a] * p);
        x[a] += K[a] * r;
        for (uint8_t b = a; b < n; b++) {
            const uint16_t ab = at(n, a, b);
            P[ab] = ((P[ab] - (K[a] * g[b])) - (rest * K[b])) + ((R * K[a]) * K[b]);
            P[at(n, b, a)] = P[ab];
        }
    }
}

/* x <- A x + B u, P <- A P A' + Q */
static void predict(const hg_fusion *self, const hg_real *u, hg_real *x, hg_real *P)
{
    const hg_fusion_config *config = self->config;
    const uint8_t n = config->states;
    for (uint8_t a = 0U; a < n; a++) {
        const hg_real *row = &config->A[(uint16_t)a * n];
        hg_acc sum = hg_acc_zero();
        for (uint8_t b = 0U; b < n; b++) {
            sum = hg_acc_mac(sum, row[b], x[b]);
        }
        for (uint8_t b = 0U; b < config->inputs; b++) {
            sum = hg_acc_mac(sum, config->B[at(config->inputs, a, b)], u[b]);
        }
        self->next[a] = hg_acc_real(sum, 0);
        for (uint8_t b = 0U; b < n; b++) {
            hg_acc product = hg_acc_zero();
            for (uint8_t c = 0U; c < n; c++) {
                product = hg_acc_mac(product, row[c], P[at(n, c, b)]);
            }
            self->product[at(n, a, b)] = hg_acc_real(product, 0);
        }
    }
    for (uint8_t a = 0U; a < n; a++) {
        x[a] = self->next[a];
        for (uint8_t b = a; b < n; b++) {
            hg_acc sum = hg_acc_zero();
            for (uint8_t c = 0U; c < n; c++) {
                sum = hg_acc_mac(sum, self->product[at(n, a, c)], config->A[at(n, b, c)]);
            }
            const uint16_t ab = at(n, a, b);
            P[ab] = hg_acc_real(sum, 0) + config->Q[ab];
            P[at(n, b, a)] = P[ab];
        }
    }
}

static void copy(hg_real *to, const hg_real *from, uint16_t count)
{
    for (uint16_t i = 0U; i < count; i++) {
        to[i] = from[i];
    }
}

static uint16_t bit(uint8_t i)
{
    return (uint16_t)(1UL << i);
}

/* Sensors that speak in this sample, neither dead nor taken out. */
static uint16_t alive_in(const hg_fusion_config *config, const hg_fusion_slot *slot)
{
    uint16_t alive = 0U;
    for (uint8_t i = 0U; i < config->sensors; i++) {
        if ((slot->entry[i].age <= config->watchdog) && ((slot->excluded & bit(i)) == 0U)) {
            alive |= bit(i);
        }
    }
    return alive;
}

static const hg_fusion_table *table_for(const hg_fusion_config *config, uint16_t alive)
{
    const hg_fusion_table *found = &config->table[0];
    for (uint8_t t = 1U; t < config->tables; t++) {
        if (config->table[t].alive == alive) {
            found = &config->table[t];
        }
    }
    return found;
}

/* Which sensors a schedule expects, in their order, each with the covariance that those before it leave. */
static void expect(const hg_fusion *self, hg_fusion_slot *slot)
{
    const hg_fusion_config *config = self->config;
    for (uint8_t i = 0U; i < config->sensors; i++) {
        hg_fusion_entry *entry = &slot->entry[i];
        times_row(config, self->wide, i, self->g);
        const hg_real p = row_times(config, i, self->g);
        entry->expected = p > slot->table->level[i];
        if (entry->expected && ((slot->excluded & bit(i)) == 0U)) {
            update(self, self->ahead, self->wide, p, HG_REAL_ZERO, config->R[i], self->next);
        }
    }
}

/* What the triggers of a sample compare with: a prediction from the last sample that no frame in time could change any more when it was opened. */
static void refer(const hg_fusion *self, uint8_t lag)
{
    const hg_fusion_config *config = self->config;
    const uint8_t oldest = (uint8_t)(self->held - 1U);
    const uint8_t back = (uint8_t)(lag + config->delay);
    const uint8_t from = (back < oldest) ? back : oldest;
    const hg_fusion_slot *settled = slot_of(self, from);
    hg_fusion_slot *slot = slot_of(self, lag);
    copy(self->ahead, settled->x, config->states);
    copy(self->wide, settled->P, square(config->states));
    for (uint8_t l = from; l > lag; l--) {
        predict(self, slot_of(self, (uint8_t)(l - 1U))->u, self->ahead, self->wide);
    }
    slot->table = table_for(config, alive_in(config, settled));
    for (uint8_t i = 0U; i < config->sensors; i++) {
        times_row(config, self->wide, i, self->g);
        slot->entry[i].reference = row_times(config, i, self->ahead);
        slot->entry[i].variance = row_times(config, i, self->g) + config->R[i];
    }
    if (config->trigger == HG_FUSION_SCHEDULED) {
        expect(self, slot);
    }
}

/* Samples since a sensor's last frame, in the sample after this one. */
static uint8_t age_after(const hg_fusion_entry *entry)
{
    const uint8_t older = (entry->age < UINT8_MAX) ? (uint8_t)(entry->age + 1U) : entry->age;
    return (entry->known == HG_FUSION_VALUE) ? 1U : older;
}

/* The prediction for the sample `lag` before the newest; x and P are the estimate in the sample before it. */
static void predict_slot(const hg_fusion *self, uint8_t lag)
{
    hg_fusion_slot *slot = slot_of(self, lag);
    predict(self, slot->u, self->x, self->P);
    copy(slot->x, self->x, self->config->states);
    copy(slot->P, self->P, square(self->config->states));
}

/* Row of the tables for a sensor's loss rate. */
static uint16_t rate_row(const hg_fusion *self, uint8_t i)
{
    const hg_fusion_config *config = self->config;
    const hg_real nearest = (self->sensor[i].loss / config->rate_step) + HG_REAL_C(0.5);
    const uint8_t last = (uint8_t)(config->rates - 1U);
    const uint8_t row = (nearest < (hg_real)last) ? (uint8_t)(int32_t)nearest : last;
    return (uint16_t)((uint16_t)row * config->sensors) + i;
}

/* 1 / beta - 1 of a sensor that sent nothing, as far as is known; negative: that says nothing. */
static hg_real relaxation(const hg_fusion *self, const hg_fusion_slot *slot, uint8_t i, bool early)
{
    const hg_fusion_entry *entry = &slot->entry[i];
    const hg_fusion_table *table = slot->table;
    hg_real relax = HG_REAL_C(-1.0);
    if (entry->known == HG_FUSION_SILENT) {
        relax = table->relax[i];
    } else if ((entry->known == HG_FUSION_NOTHING) && (entry->age < self->config->heartbeat)) {
        relax = (early ? table->early : table->relax)[rate_row(self, i)];
    } else {
        /* lost; or silent though it had to speak, which is lost too */
    }
    return relax;
}

/* The update that one sensor's knowledge is, with p = C g: true when there is one. */
static bool pseudo(const hg_fusion *self, const hg_fusion_slot *slot, uint8_t i, bool early, hg_real p, hg_real *r, hg_real *R)
{
    const hg_fusion_config *config = self->config;
    const hg_fusion_entry *entry = &slot->entry[i];
    const hg_real s = p + config->R[i];
    bool some = (slot->excluded & bit(i)) == 0U;
    *R = config->R[i];
    if (entry->known == HG_FUSION_VALUE) {
        *r = entry->y - row_times(config, i, self->x);
        if ((config->huber > HG_REAL_ZERO) && ((*r * *r) > ((config->huber * config->huber) * s))) {
            *R = ((hg_real_abs(*r) * hg_linalg_root(s)) / config->huber) - p;
        }
    } else {
        const hg_real relax = relaxation(self, slot, i, early);
        *r = entry->reference - row_times(config, i, self->x);
        *R += s * relax;
        some = some && (relax >= HG_REAL_ZERO) && ((slot->table->alive & bit(i)) != 0U);
    }
    return some;
}

/* All that is known of the sample `lag` before the newest; x and P are its prediction. */
static void fuse(hg_fusion *self, uint8_t lag)
{
    const hg_fusion_config *config = self->config;
    const hg_fusion_slot *slot = slot_of(self, lag);
    for (uint8_t i = 0U; i < config->sensors; i++) {
        hg_fusion_record *record = &self->record[i];
        hg_real *K = (lag == config->delay) ? record->gain : self->next;
        hg_real r;
        hg_real R;
        times_row(config, self->P, i, self->g);
        const hg_real p = row_times(config, i, self->g);
        const bool some = pseudo(self, slot, i, lag < config->delay, p, &r, &R);
        if (some) {
            update(self, self->x, self->P, p, r, R, K);
        }
        if (lag == config->delay) {
            record->residual = r;
            record->spread = some ? (p + R) : HG_REAL_ZERO;
            record->value = slot->entry[i].known == HG_FUSION_VALUE;
            record->y = slot->entry[i].y;
        }
    }
}

static void saturating_add(uint16_t *counter, uint16_t more)
{
    const uint32_t sum = (uint32_t)*counter + more;
    *counter = (sum < UINT16_MAX) ? (uint16_t)sum : UINT16_MAX;
}

/* Frames of a sample that no frame in time can change any more: how many were lost before them, and the rate of that. */
static void take_stock(hg_fusion *self, const hg_fusion_slot *slot)
{
    const hg_fusion_config *config = self->config;
    for (uint8_t i = 0U; i < config->sensors; i++) {
        const hg_fusion_entry *entry = &slot->entry[i];
        hg_fusion_sensor *sensor = &self->sensor[i];
        if ((entry->known == HG_FUSION_VALUE) && entry->counted) {
            const uint32_t ahead = ((uint32_t)entry->counter + config->modulus) - sensor->counter; /* 1 .. 2 modulus - 1 */
            const uint32_t gap = sensor->seen ? ((ahead - 1U) % config->modulus) : 0U;
            const hg_real weight = hg_real_max(config->smoothing, HG_REAL_C(1.0) / ((hg_real)sensor->frames + PRIOR));
            for (uint32_t g = 0U; g < gap; g++) {
                sensor->loss += weight * (HG_REAL_C(1.0) - sensor->loss);
            }
            sensor->loss -= weight * sensor->loss;
            saturating_add(&sensor->lost, (uint16_t)gap);
            saturating_add(&sensor->frames, 1U);
            sensor->counter = entry->counter;
            sensor->seen = true;
        }
    }
}

hg_status hg_fusion_start(hg_fusion *self, const hg_fusion_config *config, const hg_fusion_memory *memory)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL) || (memory->slot == NULL) || (memory->entry == NULL) || (memory->sensor == NULL) ||
        (memory->record == NULL) || (memory->origin == NULL) || (memory->real == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!hg_fusion_valid(config)) {
        return HG_E_CONFIG;
    }
    const uint8_t n = config->states;
    hg_real *real = memory->real;
    self->config = config;
    self->slot = memory->slot;
    self->sensor = memory->sensor;
    self->record = memory->record;
    self->origin = memory->origin;
    for (uint8_t l = 0U; l <= config->depth; l++) {
        hg_fusion_slot *slot = &self->slot[l];
        slot->entry = &memory->entry[(uint16_t)l * config->sensors];
        slot->x = real;
        slot->P = &slot->x[n];
        slot->shift = &slot->P[square(n)];
        slot->u = &slot->shift[n];
        real = &slot->u[config->inputs];
    }
    hg_real **const vector[] = {&self->x, &self->ahead, &self->g, &self->next, &self->move};
    hg_real **const matrix[] = {&self->P, &self->wide, &self->product};
    for (uint8_t v = 0U; v < 5U; v++) {
        *vector[v] = real;
        real = &real[n];
    }
    for (uint8_t m = 0U; m < 3U; m++) {
        *matrix[m] = real;
        real = &real[square(n)];
    }
    for (uint8_t i = 0U; i < config->sensors; i++) {
        self->record[i].gain = &real[(uint16_t)i * n];
        self->sensor[i] = (hg_fusion_sensor){.frames = 0U, .seen = false, .loss = config->loss};
    }
    self->excluded = 0U;
    self->resets = 0U;
    hg_fusion_reset(self);
    return HG_OK;
}

void hg_fusion_reset(hg_fusion *self)
{
    const hg_fusion_config *config = self->config;
    copy(self->x, config->x0, config->states);
    copy(self->P, config->P0, square(config->states));
    for (uint8_t j = 0U; j < config->states; j++) {
        self->origin[j] = 0;
    }
    for (uint8_t i = 0U; i < config->sensors; i++) {
        self->sensor[i].age = config->heartbeat;
        self->record[i].residual = HG_REAL_ZERO;
        self->record[i].spread = HG_REAL_ZERO;
        self->record[i].value = false;
    }
    self->k = UINT32_MAX;
    self->newest = 0U;
    self->held = 0U;
    self->redo = 0U;
    self->open = false;
}

/* The whole number next to this one towards 0, within what an origin or a code can be away. */
static hg_real whole(hg_real x)
{
    return (hg_real)(int32_t)hg_real_max(hg_real_min(x, STEPS_MAX), -STEPS_MAX);
}

/* Whole steps of the origin that state j is away; 0 within one step. */
static hg_real steps_off(const hg_fusion_config *config, const hg_fusion_slot *slot, uint8_t j)
{
    hg_real steps = HG_REAL_ZERO;
    if ((config->origin != NULL) && (config->origin[j] > HG_REAL_ZERO)) {
        steps = whole(slot->x[j] / config->origin[j]);
    }
    return steps;
}

/* A sample held gets the new origin. */
static void move_slot(const hg_fusion *self, hg_fusion_slot *slot)
{
    const hg_fusion_config *config = self->config;
    for (uint8_t j = 0U; j < config->states; j++) {
        slot->x[j] -= self->move[j];
        slot->shift[j] += self->move[j];
    }
    for (uint8_t i = 0U; i < config->sensors; i++) {
        const hg_real by = row_times(config, i, self->move);
        slot->entry[i].y -= by;
        slot->entry[i].reference -= by;
    }
}

/* Keep the numbers small: whole steps of what the last settled sample is away go into the origin. The open sample's measurements know it already. */
static void move_origin(hg_fusion *self)
{
    const hg_fusion_config *config = self->config;
    const uint8_t oldest = (uint8_t)(self->held - 1U);
    const hg_fusion_slot *settled = slot_of(self, (config->delay < oldest) ? config->delay : oldest);
    bool moved = false;
    for (uint8_t j = 0U; j < config->states; j++) {
        const hg_real steps = steps_off(config, settled, j);
        self->move[j] = HG_REAL_ZERO;
        if (hg_real_abs(steps) > HG_REAL_ZERO) {
            self->move[j] = steps * config->origin[j];
            self->origin[j] = (int32_t)((int64_t)self->origin[j] + (int64_t)steps);
            moved = true;
        }
    }
    for (uint8_t lag = 0U; moved && (lag < self->held); lag++) {
        move_slot(self, slot_of(self, lag));
    }
    if (moved) {
        copy(self->x, slot_of(self, 0U)->x, config->states);
        for (uint8_t j = 0U; j < config->states; j++) {
            slot_of(self, 0U)->shift[j] = HG_REAL_ZERO;
        }
    }
}

hg_status hg_fusion_open(hg_fusion *self, const hg_real *u)
{
    const hg_fusion_config *config = self->config;
    if (self->open) {
        return HG_E_BUSY;
    }
    if (!hg_linalg_finite(u, config->inputs)) {
        return HG_E_NUMERIC;
    }
    self->newest = (self->newest < config->depth) ? (uint8_t)(self->newest + 1U) : 0U;
    self->held = (self->held <= config->depth) ? (uint8_t)(self->held + 1U) : self->held;
    self->k++;
    self->open = true;
    hg_fusion_slot *slot = slot_of(self, 0U);
    copy(slot->u, u, config->inputs);
    slot->excluded = self->excluded;
    for (uint8_t i = 0U; i < config->sensors; i++) {
        slot->entry[i] = (hg_fusion_entry){.known = HG_FUSION_NOTHING, .age = self->sensor[i].age, .counted = false, .expected = false};
    }
    for (uint8_t j = 0U; j < config->states; j++) {
        slot->shift[j] = HG_REAL_ZERO;
    }
    predict_slot(self, 0U);
    move_origin(self);
    refer(self, 0U);
    return HG_OK;
}

static bool takes(const hg_fusion_config *config, uint8_t i, hg_real y)
{
    return hg_real_finite(y) && (hg_real_abs(y) <= config->range[i]);
}

hg_status hg_fusion_due(const hg_fusion *self, uint8_t i, hg_real y, hg_real dice)
{
    const hg_fusion_config *config = self->config;
    if (!self->open) {
        return HG_E_STATE;
    }
    if (!takes(config, i, y)) {
        return HG_E_NUMERIC;
    }
    const hg_fusion_slot *slot = slot_of(self, 0U);
    const hg_fusion_entry *entry = &slot->entry[i];
    const hg_real level = slot->table->level[i];
    const hg_real r = y - entry->reference;
    bool speaks = false;
    if (config->trigger == HG_FUSION_OBSERVATION) {
        speaks = (r * r) > level;
    } else if (config->trigger == HG_FUSION_INNOVATION) {
        speaks = (r * r) > (level * entry->variance);
    } else if (config->trigger == HG_FUSION_STOCHASTIC) {
        speaks = (level * (r * r)) > (dice * entry->variance);
    } else if (config->trigger == HG_FUSION_SCHEDULED) {
        speaks = entry->expected;
    } else {
        /* HG_FUSION_OWN: the heartbeat alone */
    }
    speaks = speaks && ((slot->excluded & bit(i)) == 0U);
    return (speaks || (entry->age >= config->heartbeat)) ? HG_OK : HG_E_EMPTY;
}

/* Can the sample `lag` before k still be filtered again? When k is closed, the next open gives the oldest sample's place away. */
static bool reachable(const hg_fusion *self, uint8_t lag)
{
    return (lag < self->held) && (self->open || (lag < self->config->depth));
}

/* Book a value; the next close begins where it belongs. */
static void enter(hg_fusion *self, uint8_t lag, uint8_t i, hg_fusion_known known, hg_real y)
{
    const hg_fusion_slot *slot = slot_of(self, lag);
    const uint8_t back = self->open ? lag : (uint8_t)(lag + 1U);
    slot->entry[i].known = known;
    slot->entry[i].counted = false;
    slot->entry[i].y = y - row_times(self->config, i, slot->shift);
    self->redo = (back > self->redo) ? back : self->redo;
}

hg_status hg_fusion_receive(hg_fusion *self, uint8_t i, uint8_t stamp, uint8_t counter, hg_real y)
{
    const hg_fusion_config *config = self->config;
    hg_fusion_sensor *sensor = &self->sensor[i];
    const uint8_t lag = (uint8_t)((self->k - stamp) % STAMPS);
    if (!takes(config, i, y)) {
        saturating_add(&sensor->refused, 1U);
        return HG_E_NUMERIC;
    }
    if (!reachable(self, lag)) {
        saturating_add(&sensor->late, 1U);
        return HG_E_STAMP;
    }
    hg_fusion_entry *entry = &slot_of(self, lag)->entry[i];
    if (entry->known == HG_FUSION_VALUE) {
        saturating_add(&sensor->repeated, 1U);
        return HG_E_REPEATED;
    }
    enter(self, lag, i, HG_FUSION_VALUE, y);
    entry->counter = (uint8_t)((uint16_t)counter % config->modulus);
    entry->counted = true;
    if ((lag + (self->open ? 0U : 1U)) > config->delay) {
        saturating_add(&sensor->late, 1U);
    }
    return HG_OK;
}

hg_real hg_fusion_unwrap(const hg_fusion *self, uint8_t i, uint8_t stamp, hg_real y, hg_real period)
{
    const uint8_t lag = (uint8_t)((self->k - stamp) % STAMPS);
    hg_real found = y;
    if (lag < self->held) {
        const hg_fusion_slot *slot = slot_of(self, lag);
        const hg_real off = (slot->entry[i].reference + row_times(self->config, i, slot->shift)) - y;
        const hg_real half = (off < HG_REAL_ZERO) ? HG_REAL_C(-0.5) : HG_REAL_C(0.5);
        found = y + (whole((off / period) + half) * period);
    }
    return found;
}

hg_real hg_fusion_local(const hg_fusion *self, uint8_t i, uint8_t stamp, hg_real y)
{
    const hg_fusion_config *config = self->config;
    const uint8_t lag = (uint8_t)((self->k - stamp) % STAMPS);
    for (uint8_t j = 0U; j < config->states; j++) {
        const hg_real step = (config->origin != NULL) ? config->origin[j] : HG_REAL_ZERO;
        const hg_real since = (lag < self->held) ? slot_of(self, lag)->shift[j] : HG_REAL_ZERO;
        self->next[j] = ((hg_real)self->origin[j] * step) - since;
    }
    return y - row_times(config, i, self->next);
}

void hg_fusion_number(hg_fusion *self, uint32_t k)
{
    self->k = k;
}

hg_status hg_fusion_recall(hg_fusion *self, uint8_t i, uint8_t stamp, uint8_t spoken, hg_real previous)
{
    const uint8_t lag = (uint8_t)((self->k - stamp) % STAMPS);
    bool last = takes(self->config, i, previous);
    if (!reachable(self, lag)) {
        return HG_E_STAMP;
    }
    for (uint8_t b = 0U; (b < PAST) && reachable(self, (uint8_t)(lag + 1U + b)); b++) {
        const uint8_t past = (uint8_t)(lag + 1U + b);
        const bool spoke = (((uint32_t)spoken >> b) & 1U) != 0U;
        const bool unknown = slot_of(self, past)->entry[i].known == HG_FUSION_NOTHING;
        if (unknown && (!spoke)) {
            enter(self, past, i, HG_FUSION_SILENT, HG_REAL_ZERO);
        } else if (unknown) {
            enter(self, past, i, last ? HG_FUSION_VALUE : HG_FUSION_LOST, last ? previous : HG_REAL_ZERO);
        } else {
            /* known already */
        }
        last = last && (!spoke);
    }
    return HG_OK;
}

/* Is the estimate one? A covariance that is not positive is none. */
static bool sane(const hg_fusion *self)
{
    const uint8_t n = self->config->states;
    bool good = hg_linalg_finite(self->x, n) && hg_linalg_finite(self->P, square(n));
    for (uint8_t j = 0U; j < n; j++) {
        good = good && (self->P[at(n, j, j)] >= HG_REAL_ZERO);
    }
    return good;
}

/* Filter from `start` samples back to now. */
static void filter_from(hg_fusion *self, uint8_t start)
{
    const hg_fusion_config *config = self->config;
    copy(self->x, slot_of(self, start)->x, config->states);
    copy(self->P, slot_of(self, start)->P, square(config->states));
    for (uint8_t back = 0U; back <= start; back++) {
        const uint8_t lag = (uint8_t)(start - back);
        if (back > 0U) {
            const hg_fusion_slot *before = slot_of(self, (uint8_t)(lag + 1U));
            for (uint8_t i = 0U; i < config->sensors; i++) {
                slot_of(self, lag)->entry[i].age = age_after(&before->entry[i]);
            }
            predict_slot(self, lag);
            if (((uint16_t)lag + config->delay) < start) {
                refer(self, lag);
            }
        }
        fuse(self, lag);
        if (lag == config->delay) {
            take_stock(self, slot_of(self, lag));
        }
    }
}

hg_status hg_fusion_close(hg_fusion *self)
{
    const hg_fusion_config *config = self->config;
    if (!self->open) {
        return HG_E_STATE;
    }
    const uint8_t back = (self->redo > config->delay) ? self->redo : config->delay;
    filter_from(self, (back < self->held) ? back : (uint8_t)(self->held - 1U));
    self->redo = 0U;
    self->open = false;
    for (uint8_t i = 0U; i < config->sensors; i++) {
        self->sensor[i].age = age_after(&slot_of(self, 0U)->entry[i]);
    }
    if (!sane(self)) {
        const uint32_t k = self->k;
        hg_fusion_reset(self);
        self->k = k;
        saturating_add(&self->resets, 1U);
        return HG_E_NUMERIC;
    }
    return HG_OK;
}

void hg_fusion_exclude(hg_fusion *self, uint8_t i, bool out)
{
    self->excluded = out ? (uint16_t)(self->excluded | bit(i)) : (uint16_t)(self->excluded & (uint16_t)~bit(i));
}

uint16_t hg_fusion_alive(const hg_fusion *self)
{
    return alive_in(self->config, slot_of(self, 0U));
}

#endif
