/** @file
 *  fusion.h on plants that couple all of their states, with two inputs and dense or selected rows, against the same filter in double precision and by its textbook
 *  equations: predictions, references, schedules, what silence says, late frames, and sensors that are taken out and let in. */
#include "support.h"

#include "hullguard/fusion.h"

#define N 3U
#define M 3U
#define INPUTS 2U
#define DEPTH 6U
#define SLOTS (DEPTH + 1U)
#define SAMPLES 40U
#define HEARTBEAT 4U

/* One number more stands behind some lists, and one sensor's behind each sample: nobody may read or write them. */
static const hg_real plant_A[(N * N) + N] = {R(0.75), R(0.25), R(-0.125), R(-0.5), R(0.5), R(0.25), R(0.125), R(-0.25), R(0.875), R(9), R(9), R(9)};
static const hg_real plant_B[N * INPUTS] = {R(0.5), R(-1), R(0.25), R(2), R(-0.75), R(0.125)};
static const hg_real plant_Q[N * N] = {R(0.125), R(0.03125), R(0), R(0.03125), R(0.25), R(-0.0625), R(0), R(-0.0625), R(0.5)};
static const hg_real plant_x0[N] = {R(0.5), R(-0.25), R(1)};
static const hg_real plant_P0[N * N] = {R(2), R(0.25), R(0.125), R(0.25), R(1), R(0), R(0.125), R(0), R(4)};
static const uint8_t places[M + 1U] = {2U, 0U, 1U, 0U};
static const hg_real rows[M * N] = {R(1), R(0.5), R(-0.25), R(0.125), R(-1), R(0.75), R(-0.5), R(0.25), R(1.5)};
static const hg_real noise[M] = {R(0.25), R(0.5), R(0.125)};
static const hg_real ranges[M] = {R(1000), R(1000), R(1000)};
static const hg_real level_of[3][M + 1U] = {{R(0.5), R(1), R(0.75)}, {R(1.5), R(0.25), R(0.5)}, {R(0.25), R(0.75), R(1.25)}};
static const hg_real relax_of[3][M] = {{R(0.25), R(0.5), R(0)}, {R(1), R(0.125), R(-1)}, {R(0.75), R(2), R(0.5)}};
static const hg_real early_of[3][M] = {{R(2), R(3), R(-1)}, {R(1.5), R(4), R(0)}, {R(0.5), R(1), R(2.5)}};
static const hg_fusion_table tables[3] = {{.alive = 7U, .level = level_of[0], .relax = relax_of[0], .early = early_of[0]},
                                          {.alive = 6U, .level = level_of[1], .relax = relax_of[1], .early = early_of[1]},
                                          {.alive = 5U, .level = level_of[2], .relax = relax_of[2], .early = early_of[2]}};
static const hg_fusion_config usual = {.states = N, .inputs = INPUTS, .sensors = M, .depth = DEPTH, .delay = 0U, .heartbeat = HEARTBEAT, .watchdog = 254U, .modulus = 15U,
                                       .trigger = HG_FUSION_INNOVATION, .A = plant_A, .B = plant_B, .Q = plant_Q, .x0 = plant_x0, .P0 = plant_P0,
                                       .select = NULL, .C = rows, .R = noise, .range = ranges, .huber = R(0), .rates = 1U, .rate_step = R(1), .loss = R(0),
                                       .smoothing = R(0.0625), .tables = 3U, .table = tables};

typedef struct {
    hg_fusion        self;
    hg_fusion_slot   slot[SLOTS];
    hg_fusion_entry  entry[(SLOTS * M) + 1U];
    hg_fusion_sensor sensor[M];
    hg_fusion_record record[M];
    int32_t          origin[N + 1U];
    hg_real          real[HG_FUSION_REALS(N, INPUTS, M, DEPTH) + 1U];
} rig;

static void begin(rig *p, const hg_fusion_config *config)
{
    const hg_fusion_memory memory = {.slot = p->slot, .entry = p->entry, .sensor = p->sensor, .record = p->record, .origin = p->origin, .real = p->real};
    (void)memset(p, 0x5A, sizeof(*p));
    p->entry[(config->depth + 1U) * config->sensors].expected = false;
    arm(p->real, COUNT(p->real));
    p->origin[N] = CANARY_CODE;
    for (uint8_t i = 0U; i < M; i++) {
        p->record[i].value = true; /* as memory may be */
    }
    assert_status(HG_OK, hg_fusion_start(&p->self, config, &memory));
    for (uint8_t i = 0U; i < M; i++) {
        assert_real(0.0, p->record[i].residual);
        assert_real(0.0, p->record[i].spread);
        assert_false(p->record[i].value);
    }
}

static void check_ends(const rig *p)
{
    const hg_fusion_config *c = p->self.config;
    assert_untouched(&p->real[HG_FUSION_REALS(c->states, c->inputs, c->sensors, c->depth)], 1U);
    assert_false(p->entry[(c->depth + 1U) * c->sensors].expected);
    assert_int_equal(CANARY_CODE, p->origin[N]);
}

/* ---- the reference ---- */

typedef struct {
    double x[N], P[N][N];
} belief;

typedef struct { /* what is known of a sample */
    double   u[INPUTS];
    bool     value[M]; /* has its frame arrived? */
    double   y[M];
    uint16_t excluded;
    size_t   table;
    double   reference[M], variance[M];
    bool     expected[M];
} sample;

typedef struct { /* of the update that one sensor was worth */
    bool   some;
    double residual, spread, gain[N];
} worth;

static void row_of(const hg_fusion_config *c, uint8_t i, double *row)
{
    for (size_t j = 0U; j < N; j++) {
        row[j] = (c->select == NULL) ? (double)rows[(i * N) + j] : ((places[i] == j) ? 1.0 : 0.0);
    }
}

static void predict(belief *b, const double *u)
{
    belief next = {{0.0}, {{0.0}}};
    for (size_t i = 0U; i < N; i++) {
        for (size_t j = 0U; j < N; j++) {
            next.x[i] += (double)plant_A[(i * N) + j] * b->x[j];
            next.P[i][j] = (double)plant_Q[(i * N) + j];
            for (size_t k = 0U; k < N; k++) {
                for (size_t l = 0U; l < N; l++) {
                    next.P[i][j] += (double)plant_A[(i * N) + k] * b->P[k][l] * (double)plant_A[(j * N) + l];
                }
            }
        }
        for (size_t j = 0U; j < INPUTS; j++) {
            next.x[i] += (double)plant_B[(i * INPUTS) + j] * u[j];
        }
    }
    *b = next;
}

/* c P c' */
static double spread_along(const belief *b, const double *c)
{
    double sum = 0.0;
    for (size_t i = 0U; i < N; i++) {
        for (size_t j = 0U; j < N; j++) {
            sum += c[i] * b->P[i][j] * c[j];
        }
    }
    return sum;
}

static double along(const belief *b, const double *c)
{
    return (c[0] * b->x[0]) + (c[1] * b->x[1]) + (c[2] * b->x[2]);
}

static void update(belief *b, const double *c, double r, double R, double *K)
{
    const double s = spread_along(b, c) + R;
    belief old = *b;
    for (size_t i = 0U; i < N; i++) {
        K[i] = ((old.P[i][0] * c[0]) + (old.P[i][1] * c[1]) + (old.P[i][2] * c[2])) / s;
        b->x[i] += K[i] * r;
    }
    for (size_t i = 0U; i < N; i++) {
        for (size_t j = 0U; j < N; j++) {
            b->P[i][j] = old.P[i][j] - (K[i] * s * K[j]);
        }
    }
}

/* All that is known of one sample; ages as of it. */
static void fuse(const hg_fusion_config *config, belief *b, const sample *s, const unsigned *age, bool early, worth *found)
{
    for (uint8_t i = 0U; i < M; i++) {
        double c[N];
        row_of(config, i, c);
        const double p = spread_along(b, c);
        const double whole = p + (double)noise[i];
        const double relax = (double)(early ? early_of : relax_of)[s->table][i];
        const double r = (s->value[i] ? s->y[i] : s->reference[i]) - along(b, c);
        double R = (double)noise[i];
        found[i].some = (s->excluded & (1U << i)) == 0U;
        if (!s->value[i]) {
            found[i].some = found[i].some && (age[i] < HEARTBEAT) && (relax >= 0.0) && ((tables[s->table].alive & (1U << i)) != 0U);
            R += whole * relax;
        } else if ((config->huber > R(0)) && (fabs(r) > ((double)config->huber * sqrt(whole)))) {
            R = (fabs(r) * sqrt(whole) / (double)config->huber) - p;
        }
        found[i].residual = r;
        found[i].spread = found[i].some ? (p + R) : 0.0;
        if (found[i].some) {
            update(b, c, r, R, found[i].gain);
        }
    }
}

/* References from the settled prediction `from`, moved on to sample k. */
static void refer(const hg_fusion_config *config, sample *past, size_t k, size_t from, const belief *settled)
{
    belief b = *settled;
    const uint16_t alive = (uint16_t)(7U & ~(unsigned)past[from].excluded);
    for (size_t j = from + 1U; j <= k; j++) {
        predict(&b, past[j].u);
    }
    past[k].table = (alive == 6U) ? 1U : ((alive == 5U) ? 2U : 0U);
    belief left = b;
    for (uint8_t i = 0U; i < M; i++) {
        double c[N];
        double K[N];
        row_of(config, i, c);
        past[k].reference[i] = along(&b, c);
        past[k].variance[i] = spread_along(&b, c) + (double)noise[i];
        const double p = spread_along(&left, c);
        past[k].expected[i] = (config->trigger == HG_FUSION_SCHEDULED) && (p > (double)level_of[past[k].table][i]);
        if (past[k].expected[i] && ((past[k].excluded & (1U << i)) == 0U)) {
            update(&left, c, 0.0, (double)noise[i], K);
        }
    }
}

/* ---- both, side by side ---- */

static void check_belief(const belief *b, const hg_fusion *self)
{
    for (size_t i = 0U; i < N; i++) {
        assert_near(b->x[i], self->x[i], 1e-4 * (1.0 + fabs(b->x[i])));
        for (size_t j = 0U; j < N; j++) {
            assert_near(b->P[i][j], self->P[(i * N) + j], 1e-4 * (1.0 + fabs(b->P[i][j])));
        }
    }
}

static void check_opened(const rig *p, const sample *s, const unsigned *age)
{
    const hg_fusion_slot *slot = &p->slot[p->self.newest];
    assert_true(slot->table == &tables[s->table]);
    for (uint8_t i = 0U; i < M; i++) {
        const hg_fusion_entry *entry = &slot->entry[i];
        assert_near(s->reference[i], entry->reference, 1e-4 * (1.0 + fabs(s->reference[i])));
        assert_near(s->variance[i], entry->variance, 1e-4 * s->variance[i]);
        assert_int_equal(s->expected[i], entry->expected);
        assert_count(age[i], entry->age);
        const bool wanted = (s->expected[i] && ((s->excluded & (1U << i)) == 0U)) || (age[i] >= HEARTBEAT);
        if (p->self.config->trigger == HG_FUSION_SCHEDULED) {
            assert_status(wanted ? HG_OK : HG_E_EMPTY, hg_fusion_due(&p->self, i, R(0), R(0)));
        }
    }
}

static void check_records(const rig *p, const sample *settled, const worth *found)
{
    for (uint8_t i = 0U; i < M; i++) {
        assert_int_equal(settled->value[i], p->record[i].value);
        assert_near(found[i].spread, p->record[i].spread, 1e-4 * (1.0 + found[i].spread));
        if (settled->value[i]) {
            assert_real(settled->y[i], p->record[i].y);
        }
        for (size_t j = 0U; found[i].some && (j < N); j++) {
            assert_near(found[i].residual, p->record[i].residual, 1e-4 * (1.0 + fabs(found[i].residual)));
            assert_near(found[i].gain[j], p->record[i].gain[j], 1e-4);
        }
    }
}

/* Ages in sample k by the frames that have arrived. */
static void ages(const sample *past, size_t k, unsigned *age)
{
    for (uint8_t i = 0U; i < M; i++) {
        age[i] = HEARTBEAT;
        for (size_t j = 0U; j < k; j++) {
            age[i] = past[j].value[i] ? 1U : (age[i] + 1U);
        }
    }
}

/* Each sensor sends by chance; its frame arrives up to `delay` samples later, while a sample is open or after it was closed. */
static void run(const hg_fusion_config *config, uint32_t *seed)
{
    static rig p;
    static sample past[SAMPLES];
    const size_t delay = config->delay;
    bool sent[SAMPLES][M];
    uint8_t counter[SAMPLES][M];
    uint8_t count[M] = {0U, 0U, 0U};
    belief settled; /* prediction of sample k - delay */
    belief now;
    unsigned age[M];
    unsigned opened[M] = {HEARTBEAT, HEARTBEAT, HEARTBEAT}; /* as of the close before: what comes in between is looked at in the next */
    (void)memset(past, 0, sizeof(past));
    begin(&p, config);
    for (size_t i = 0U; i < N; i++) {
        settled.x[i] = (double)plant_x0[i];
        for (size_t j = 0U; j < N; j++) {
            settled.P[i][j] = (double)plant_P0[(i * N) + j];
        }
    }
    now = settled;
    for (size_t k = 0U; k < SAMPLES; k++) {
        const size_t from = (k > delay) ? (k - delay) : 0U;
        hg_real u[INPUTS];
        for (size_t j = 0U; j < INPUTS; j++) {
            past[k].u[j] = draw_between(seed, -64, 64) / 64.0;
            u[j] = R(past[k].u[j]);
        }
        past[k].excluded = p.self.excluded;
        assert_status(HG_OK, hg_fusion_open(&p.self, u));
        predict(&now, past[k].u);
        check_belief(&now, &p.self);
        if ((k == 0U) || (k > delay)) {
            predict(&settled, past[from].u);
        }
        refer(config, past, k, from, &settled);
        check_opened(&p, &past[k], opened);
        for (uint8_t i = 0U; i < M; i++) {
            sent[k][i] = draw_between(seed, 0, 2) == 0;
            past[k].y[i] = draw_between(seed, -256, 256) / 64.0;
            counter[k][i] = (uint8_t)(count[i] % 15U);
            count[i] = (uint8_t)(count[i] + (sent[k][i] ? 1U : 0U));
        }
        for (size_t j = from; j <= k; j++) {
            for (uint8_t i = 0U; i < M; i++) {
                if (sent[j][i] && (!past[j].value[i]) && (((k - j) == delay) || (draw_between(seed, 0, 1) == 0))) {
                    assert_status(HG_OK, hg_fusion_receive(&p.self, i, (uint8_t)(j & 15U), counter[j][i], R(past[j].y[i])));
                    past[j].value[i] = true;
                }
            }
        }
        assert_status(HG_OK, hg_fusion_close(&p.self));
        check_ends(&p);
        now = settled;
        for (size_t j = from; j <= k; j++) {
            worth found[M];
            if (j > from) {
                predict(&now, past[j].u);
            }
            ages(past, j, age);
            fuse(config, &now, &past[j], age, (k - j) < delay, found);
            if ((k - j) == delay) {
                settled = now;
                check_records(&p, &past[j], found);
            }
        }
        check_belief(&now, &p.self);
        ages(past, k + 1U, opened);
        for (size_t j = (k >= delay) ? (from + 1U) : 0U; (j <= k) && (delay > 0U); j++) { /* between two samples */
            for (uint8_t i = 0U; i < M; i++) {
                if (sent[j][i] && (!past[j].value[i]) && (draw_between(seed, 0, 3) == 0)) {
                    assert_status(HG_OK, hg_fusion_receive(&p.self, i, (uint8_t)(j & 15U), counter[j][i], R(past[j].y[i])));
                    past[j].value[i] = true;
                }
            }
        }
        if (draw_between(seed, 0, 3) == 0) {
            const uint8_t which = (uint8_t)draw_between(seed, 0, 1);
            hg_fusion_exclude(&p.self, (uint8_t)(1U - which), false);
            hg_fusion_exclude(&p.self, which, draw_between(seed, 0, 1) == 0);
        }
    }
    for (uint8_t i = 0U; i < M; i++) {
        uint16_t frames = 0U;
        for (size_t k = 0U; (k + delay) < SAMPLES; k++) {
            frames = (uint16_t)(frames + (sent[k][i] ? 1U : 0U));
        }
        assert_count(frames, p.sensor[i].frames);
        assert_count(0U, p.sensor[i].lost);
        assert_count(0U, p.sensor[i].late);
    }
}

static void any_plant_is_filtered_by_the_textbook(void **state)
{
    (void)state;
    uint32_t seed = seed_of_run(41U);
    for (uint32_t i = 0U; i < 24U; i++) {
        hg_fusion_config c = usual;
        c.select = ((i % 2U) == 0U) ? places : NULL;
        c.huber = ((i % 3U) == 0U) ? R(0.75) : R(0);
        c.trigger = ((i % 4U) == 3U) ? HG_FUSION_SCHEDULED : HG_FUSION_INNOVATION;
        c.delay = (uint8_t)((i / 4U) % 4U);
        c.depth = ((i % 8U) < 4U) ? c.delay : DEPTH; /* as few samples as will do, or more */
        run(&c, &seed);
    }
}

/* ---- frames later than `delay` ---- */

/* They leave the state that they would have left in time; references that followed from what they change are new as well. */
static void late_frames_are_filtered_in_whatever_the_delay(void **state)
{
    (void)state;
    static const hg_real rest[INPUTS] = {R(0), R(0)};
    uint32_t seed = seed_of_run(42U);
    for (uint8_t delay = 0U; delay <= 4U; delay++) {
        static rig node[2];
        hg_fusion_config c = usual;
        c.delay = delay;
        begin(&node[0], &c);
        begin(&node[1], &c);
        for (uint32_t round = 0U; round < 60U; round++) {
            hg_real y[SLOTS];
            for (uint8_t k = 0U; k < SLOTS; k++) { /* sensor 1 is silent towards the second node, */
                for (size_t j = 0U; j < COUNT(node); j++) {
                    assert_status(HG_OK, hg_fusion_open(&node[j].self, rest));
                }
                const uint8_t stamp = (uint8_t)(node[0].self.k & 15U);
                y[k] = R(draw_between(&seed, -256, 256) / 64.0);
                assert_status(HG_OK, hg_fusion_receive(&node[0].self, 1U, stamp, 0U, y[k]));
                for (size_t j = 0U; (j < COUNT(node)) && ((k % 3U) == 1U); j++) { /* the others in between, so that their silence says something */
                    assert_status(HG_OK, hg_fusion_receive(&node[j].self, 0U, stamp, 0U, y[k]));
                    assert_status(HG_OK, hg_fusion_receive(&node[j].self, 2U, stamp, 0U, -y[k]));
                }
                for (uint8_t i = 0U; (k + 1U == SLOTS) && (i < SLOTS); i++) { /* until it hears all in the last of these samples */
                    assert_status(HG_OK, hg_fusion_receive(&node[1].self, 1U, (uint8_t)((node[1].self.k + 1U + i - SLOTS) & 15U), 0U, y[i]));
                }
                for (size_t j = 0U; j < COUNT(node); j++) {
                    assert_status(HG_OK, hg_fusion_close(&node[j].self));
                    for (uint8_t i = 0U; i < M; i++) {
                        node[j].sensor[i].loss = R(0); /* a rate that is known late is another one */
                    }
                }
            }
            assert_memory_equal(node[0].self.x, node[1].self.x, N * sizeof(hg_real));
            assert_memory_equal(node[0].self.P, node[1].self.P, N * N * sizeof(hg_real));
        }
    }
}

static void a_frame_is_late_when_it_comes_after_the_delay(void **state)
{
    (void)state;
    static const hg_real rest[INPUTS] = {R(0), R(0)};
    static const struct {
        bool    open;
        uint8_t lag;
        bool    late;
    } cases[] = {{true, 0U, false}, {true, 2U, false}, {true, 3U, true}, {false, 0U, false}, {false, 1U, false}, {false, 2U, true}, {false, 4U, true}};
    for (size_t i = 0U; i < COUNT(cases); i++) {
        static rig p;
        hg_fusion_config c = usual;
        c.delay = 2U;
        begin(&p, &c);
        for (uint32_t k = 0U; k < SLOTS; k++) {
            assert_status(HG_OK, hg_fusion_open(&p.self, rest));
            if ((!cases[i].open) || (k < (SLOTS - 1U))) {
                assert_status(HG_OK, hg_fusion_close(&p.self));
            }
        }
        assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, (uint8_t)((p.self.k - cases[i].lag) & 15U), 0U, R(0)));
        assert_count(cases[i].late ? 1U : 0U, p.sensor[0].late);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_plant_is_filtered_by_the_textbook),
        cmocka_unit_test(late_frames_are_filtered_in_whatever_the_delay),
        cmocka_unit_test(a_frame_is_late_when_it_comes_after_the_delay),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
