/** @file
 *  consistency.h: scores against two filters side by side, one of which has the bias; who is blamed, and when. */
#include "support.h"

#include "hullguard/consistency.h"

#define STATES 2U
#define SENSORS 3U
#define ONSETS 4U
#define STRIDE 3U

static const hg_real plant_A[STATES * STATES] = {R(1), R(0.5), R(-0.25), R(0.875)};
static const hg_real plant_Q[STATES * STATES] = {R(0), R(0), R(0), R(0.0625)};
static const hg_real plant_x0[STATES] = {R(0), R(0)};
static const hg_real plant_P0[STATES * STATES] = {R(1), R(0), R(0), R(1)};
static const uint8_t places[SENSORS] = {0U, 0U, 1U};
static const hg_real rows[SENSORS * STATES] = {R(1), R(0), R(1), R(0.5), R(0.25), R(1)};
static const hg_real noise[SENSORS] = {R(0.0625), R(0.25), R(0.125)};
static const hg_real ranges[SENSORS] = {R(1000), R(1000), R(1000)};
static const hg_real ones[SENSORS] = {R(1), R(1), R(1)};
static const hg_real none[SENSORS] = {R(-1), R(-1), R(-1)};
static const hg_fusion_table table[1] = {{.alive = 7U, .level = ones, .relax = none, .early = none}};
static const hg_fusion_config filter = {.states = STATES, .sensors = SENSORS, .heartbeat = 9U, .watchdog = 9U, .modulus = 16U,
                                        .trigger = HG_FUSION_INNOVATION, .A = plant_A, .Q = plant_Q, .x0 = plant_x0, .P0 = plant_P0, .select = places,
                                        .R = noise, .range = ranges, .rates = 1U, .rate_step = R(1), .tables = 1U, .table = table};
static const hg_real no_least[SENSORS] = {R(0), R(0), R(0)};
static const hg_consistency_config usual = {.onsets = ONSETS, .stride = STRIDE, .least = no_least, .limit = R(30), .confirm = 2U, .repeats = 3U};

typedef struct {
    hg_fusion             self;
    hg_fusion_slot        slot[1];
    hg_fusion_entry       entry[SENSORS];
    hg_fusion_sensor      sensor[SENSORS];
    hg_fusion_record      record[SENSORS];
    int32_t               origin[STATES];
    hg_real               real[HG_FUSION_REALS(STATES, 0U, SENSORS, 0U)];
    hg_consistency        judge;
    hg_consistency_sum    sum[ONSETS * SENSORS];
    hg_consistency_sensor score[SENSORS + 1U]; /* one more, for the canary */
    hg_real               more[HG_CONSISTENCY_REALS(STATES, SENSORS, ONSETS) + 1U];
} rig;

static void begin(rig *p, const hg_fusion_config *config, const hg_consistency_config *judge)
{
    (void)memset(p, 0x5A, sizeof(*p));
    arm(p->more, COUNT(p->more));
    const hg_fusion_memory memory = {.slot = p->slot, .entry = p->entry, .sensor = p->sensor, .record = p->record, .origin = p->origin, .real = p->real};
    assert_status(HG_OK, hg_fusion_start(&p->self, config, &memory));
    const hg_consistency_memory other = {.sum = p->sum, .sensor = p->score, .real = p->more};
    p->score[SENSORS].equal = 90U;
    p->score[SENSORS].score = CANARY;
    assert_status(HG_OK, hg_consistency_start(&p->judge, judge, &p->self, &other));
}

/* One sample: those of `sends` send y. */
static uint16_t step(rig *p, uint8_t sends, const hg_real *y)
{
    assert_status(HG_OK, hg_fusion_open(&p->self, NULL));
    for (uint8_t i = 0U; i < SENSORS; i++) {
        if ((((uint32_t)sends >> i) & 1U) != 0U) {
            assert_status(HG_OK, hg_fusion_receive(&p->self, i, (uint8_t)(p->self.k & 15U), (uint8_t)(p->self.k & 15U), y[i]));
        }
    }
    assert_status(HG_OK, hg_fusion_close(&p->self));
    const uint16_t blamed = hg_consistency_step(&p->judge);
    assert_untouched(&p->more[COUNT(p->more) - 1U], 1U);
    assert_untouched(&p->score[SENSORS].score, 1U);
    assert_count(90U, p->score[SENSORS].equal);
    return blamed;
}

static double unit(uint32_t *seed)
{
    return ((double)draw_between(seed, -1000000, 1000000)) / 1e6;
}

static void start_tells_null_and_range(void **state)
{
    (void)state;
    static rig p;
    begin(&p, &filter, &usual);
    const hg_consistency_memory good = {.sum = p.sum, .sensor = p.score, .real = p.more};
    hg_consistency_memory m[3] = {good, good, good};
    m[0].sum = NULL;
    m[1].sensor = NULL;
    m[2].real = NULL;
    assert_status(HG_E_ARGUMENT, hg_consistency_start(NULL, &usual, &p.self, &good));
    assert_status(HG_E_ARGUMENT, hg_consistency_start(&p.judge, NULL, &p.self, &good));
    assert_status(HG_E_ARGUMENT, hg_consistency_start(&p.judge, &usual, NULL, &good));
    assert_status(HG_E_ARGUMENT, hg_consistency_start(&p.judge, &usual, &p.self, NULL));
    for (size_t i = 0U; i < COUNT(m); i++) {
        assert_status(HG_E_ARGUMENT, hg_consistency_start(&p.judge, &usual, &p.self, &m[i]));
    }
    hg_consistency_config c[6] = {usual, usual, usual, usual, usual, usual};
    c[0].onsets = 0U;
    c[1].stride = 0U;
    c[2].least = NULL;
    c[3].confirm = 0U;
    c[4].repeats = 1U;
    c[5].limit = R(0);
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_status(HG_E_CONFIG, hg_consistency_start(&p.judge, &c[i], &p.self, &good));
    }
    const hg_consistency_config least = {.onsets = 1U, .stride = 1U, .least = no_least, .limit = R(0.001), .confirm = 1U, .repeats = 2U};
    assert_status(HG_OK, hg_consistency_start(&p.judge, &least, &p.self, &good));
}

static void a_start_writes_to_its_own_sensors_only(void **state)
{
    (void)state;
    static rig p;
    static hg_consistency_sensor many[256]; /* as far as an index of 8 bits goes */
    for (size_t i = 0U; i < COUNT(many); i++) {
        many[i] = (hg_consistency_sensor){.score = CANARY, .y = CANARY, .equal = 90U};
    }
    begin(&p, &filter, &usual);
    const hg_consistency_memory memory = {.sum = p.sum, .sensor = many, .real = p.more};
    assert_status(HG_OK, hg_consistency_start(&p.judge, &usual, &p.self, &memory));
    for (size_t i = 0U; i < COUNT(many); i++) {
        const bool own = i < SENSORS;
        assert_real(own ? 0.0 : (double)CANARY, many[i].score);
        assert_real(own ? 0.0 : (double)CANARY, many[i].y);
        assert_count(own ? 0U : 90U, many[i].equal);
    }
}

/* The residuals of two filters on the same frames, one with a bias of one sensor from sample 0 on, differ by b rho: c must be the sum of rho^2 / s, and
 * d of the filter with the bias that of the other one plus b c. In the oldest hypothesis, which began with the bias. */
static void the_response_is_that_of_the_filter(void **state)
{
    (void)state;
    uint32_t seed = seed_of_run(31U);
    for (uint32_t run = 0U; run < 20U; run++) {
        static rig clean;
        static rig biased;
        hg_fusion_config c = filter;
        c.select = ((run % 2U) == 0U) ? places : NULL;
        c.C = rows;
        begin(&clean, &c, &usual);
        begin(&biased, &c, &usual);
        const uint32_t faulty = run % SENSORS;
        const double b = 0.75;
        double sum = 0.0;
        for (uint32_t k = 0U; k < (ONSETS * STRIDE); k++) { /* until the oldest begins anew */
            hg_real y[SENSORS];
            for (uint8_t i = 0U; i < SENSORS; i++) {
                y[i] = R(unit(&seed));
            }
            const uint8_t sends = (uint8_t)(draw(&seed) % 8U);
            (void)step(&clean, sends, y);
            y[faulty] += R(b);
            (void)step(&biased, sends, y);
            for (uint8_t i = 0U; i < SENSORS; i++) {
                if (clean.record[i].spread > R(0)) {
                    const double rho = ((double)biased.record[i].residual - (double)clean.record[i].residual) / b;
                    sum += rho * rho / (double)clean.record[i].spread;
                }
            }
            assert_near(sum, clean.sum[faulty].c, 1e-4 * (1.0 + sum));
            assert_near((double)clean.sum[faulty].d + (b * sum), biased.sum[faulty].d, 1e-4 * (1.0 + sum));
        }
        assert_true(sum > 0.0);
    }
}

static void hypotheses_begin_every_stride(void **state)
{
    (void)state;
    static rig p;
    begin(&p, &filter, &usual);
    const hg_real y[SENSORS] = {R(0), R(0), R(0)};
    for (uint32_t k = 0U; k < 100U; k++) {
        (void)step(&p, 7U, y);
        for (uint32_t onset = 0U; onset < ONSETS; onset++) {
            /* Samples that each hypothesis has seen: those that have not had their turn began with the first. */
            const uint32_t turn = k / STRIDE;
            const uint32_t last = (turn >= onset) ? (((turn - onset) / ONSETS) * ONSETS) + onset : 0U;
            const uint32_t samples = k - (last * STRIDE) + 1U;
            const double c = (double)p.sum[onset * SENSORS].c;
            assert_true(c > 0.0);
            assert_true((samples > 1U) || (fabs(c - (1.0 / (double)p.record[0].spread)) < 5.0 * c));
        }
        assert_count((k / STRIDE) % ONSETS, p.judge.onset);
    }
}

/* The smallest bias looked for: below it the likelihood of that one counts, and may be less than 1. */
static void small_biases_are_not_taken_for_larger_ones(void **state)
{
    (void)state;
    static const hg_real least[SENSORS] = {R(2), R(2), R(2)};
    static rig p;
    hg_consistency_config c = usual;
    c.least = least;
    begin(&p, &filter, &c);
    const hg_real y[SENSORS] = {R(0.01), R(0), R(0)};
    (void)step(&p, 7U, y);
    assert_real(0.0, p.score[0].score); /* 2 b d - b^2 c < 0 */
    begin(&p, &filter, &c);
    const hg_real far[SENSORS] = {R(8), R(0), R(0)};
    (void)step(&p, 1U, far);
    const double d = (double)p.sum[0].d;
    assert_near(d * d / (double)p.sum[0].c, p.score[0].score, 1e-4);
    assert_near(64.0 / (double)p.record[0].spread, p.score[0].score, 1e-3);
}

/* 2 b d - b^2 c of the best b with |b| >= least. */
static double best_score(const hg_consistency_sum *sum, double least)
{
    const double d = fabs((double)sum->d);
    const double c = (double)sum->c;
    const double b = (c > 0.0) ? fmax(d / c, least) : least;
    return b * ((2.0 * d) - (b * c));
}

static void a_score_is_that_of_the_best_hypothesis_now(void **state)
{
    (void)state;
    static const hg_real least[SENSORS] = {R(0.5), R(0.125), R(0.25)};
    uint32_t seed = seed_of_run(33U);
    static rig p;
    hg_consistency_config c = usual;
    c.least = least;
    begin(&p, &filter, &c);
    double before[SENSORS] = {0.0, 0.0, 0.0};
    uint32_t fallen = 0U;
    for (uint32_t k = 0U; k < 200U; k++) {
        hg_real y[SENSORS];
        for (uint8_t i = 0U; i < SENSORS; i++) {
            y[i] = R(0.5 * unit(&seed));
        }
        (void)step(&p, (uint8_t)(draw(&seed) % 8U), y);
        for (uint8_t i = 0U; i < SENSORS; i++) {
            double best = 0.0;
            for (uint32_t onset = 0U; onset < ONSETS; onset++) {
                best = fmax(best, best_score(&p.sum[(onset * SENSORS) + i], (double)least[i]));
            }
            assert_near(best, p.score[i].score, 1e-4 * (1.0 + best));
            fallen += (best < before[i]) ? 1U : 0U;
            before[i] = best;
        }
    }
    assert_true(fallen > 20U);
}

static void without_an_update_there_is_no_score(void **state)
{
    (void)state;
    static rig p;
    begin(&p, &filter, &usual);
    for (uint8_t i = 0U; i < SENSORS; i++) {
        hg_fusion_exclude(&p.self, i, true);
    }
    assert_count(0U, step(&p, 0U, NULL));
    for (uint8_t i = 0U; i < SENSORS; i++) {
        assert_real(0.0, p.score[i].score);
    }
    assert_count(0U, p.judge.leads);
    assert_count(0U, p.judge.leader);
}

static void the_biased_sensor_is_blamed_and_no_other(void **state)
{
    (void)state;
    uint32_t seed = seed_of_run(32U);
    for (uint8_t faulty = 0U; faulty < SENSORS; faulty++) {
        static rig p;
        begin(&p, &filter, &usual);
        uint16_t blamed = 0U;
        uint32_t at = 0U;
        for (uint32_t k = 0U; (k < 60U) && (blamed == 0U); k++) {
            hg_real y[SENSORS];
            for (uint8_t i = 0U; i < SENSORS; i++) {
                y[i] = R(0.1 * unit(&seed)) + (((i == faulty) && (k >= 30U)) ? R(4) : R(0));
            }
            blamed = step(&p, 7U, y);
            at = k;
        }
        assert_count(1U << faulty, blamed);
        assert_true(at >= 31U); /* confirmed: two samples in a row */
        assert_count(1U << faulty, step(&p, 0U, NULL)); /* until it is reset */
        hg_consistency_reset(&p.judge);
        assert_count(0U, p.judge.leader);
        assert_count(0U, p.judge.leads);
        assert_count(0U, step(&p, 0U, NULL));
    }
}

static void a_lead_must_last(void **state)
{
    (void)state;
    static rig p;
    hg_consistency_config c = usual;
    c.confirm = 255U;
    begin(&p, &filter, &c);
    const hg_real y[SENSORS] = {R(9), R(0), R(0)};
    const hg_real z[SENSORS] = {R(0), R(-90), R(0)};
    (void)step(&p, 7U, y);
    assert_count(1U, p.judge.leads);
    assert_count(0U, p.judge.leader);
    (void)step(&p, 7U, z);
    assert_count(1U, p.judge.leader); /* another one: it begins anew */
    assert_count(1U, p.judge.leads);
    p.judge.leads = 254U;
    assert_count(2U, step(&p, 0U, NULL));
    assert_count(2U, step(&p, 0U, NULL));
    assert_count(255U, p.judge.leads);
}

static void a_score_at_the_limit_is_not_above_it(void **state)
{
    (void)state;
    static rig p;
    hg_consistency_config c = usual;
    c.confirm = 1U;
    const hg_real y[SENSORS] = {R(9), R(0), R(0)};
    for (uint32_t run = 0U; run < 3U; run++) {
        begin(&p, &filter, &c); /* first with the usual limit: the score */
        const uint16_t blamed = step(&p, 1U, y);
        assert_count((run == 1U) ? 0U : 1U, blamed);
        assert_count((run == 1U) ? 0U : 1U, p.judge.leads);
        c.limit = p.score[0].score; /* at it, */
        if (run == 1U) {
            c.limit = R(0.999) * p.score[0].score; /* and below */
        }
    }
}

/* Two sensors of two states that know nothing of each other. */
static void of_two_that_stand_out_alike_it_is_the_first(void **state)
{
    (void)state;
    static const hg_real unit_matrix[STATES * STATES] = {R(1), R(0), R(0), R(1)};
    static const uint8_t apart[SENSORS] = {0U, 1U, 1U};
    static const hg_real alike[SENSORS] = {R(0.0625), R(0.0625), R(1000)};
    static const hg_real y[SENSORS] = {R(9), R(9), R(0)};
    static rig p;
    hg_fusion_config f = filter;
    f.A = unit_matrix;
    f.Q = unit_matrix;
    f.select = apart;
    f.R = alike;
    begin(&p, &f, &usual);
    hg_fusion_exclude(&p.self, 2U, true);
    assert_count(0U, step(&p, 3U, y));
    assert_real((double)p.score[0].score, p.score[1].score);
    assert_true(p.score[0].score > usual.limit);
    assert_count(0U, p.judge.leader);
}

static void all_who_were_blamed_stay_so_until_a_reset(void **state)
{
    (void)state;
    static rig p;
    hg_real y[SENSORS] = {R(0), R(0.125), R(0)};
    begin(&p, &filter, &usual);
    for (uint32_t k = 0U; k < 3U; k++) {
        y[0] += R(0.015625);
        y[2] += R(0.015625);
        assert_count((k < 2U) ? 0U : 2U, step(&p, 7U, y)); /* frozen */
    }
    for (uint32_t k = 0U; k < 2U; k++) {
        y[0] += R(90);
        (void)step(&p, 1U, y); /* biased */
    }
    assert_count(3U, p.judge.blamed);
    y[0] = R(0.5);
    for (uint32_t k = 0U; k < 3U; k++) {
        (void)step(&p, 4U, y); /* and the last one frozen */
    }
    assert_count(7U, p.judge.blamed);
    hg_consistency_reset(&p.judge);
    assert_count(0U, p.judge.blamed);
    for (uint8_t i = 0U; i < SENSORS; i++) {
        assert_real(0.0, p.score[i].score);
    }
    assert_untouched(&p.score[SENSORS].score, 1U);
}

static void a_frozen_sensor_repeats_itself(void **state)
{
    (void)state;
    static rig p;
    begin(&p, &filter, &usual);
    hg_real y[SENSORS] = {R(0.25), R(0.125), R(0)};
    assert_count(0U, step(&p, 2U, y));
    assert_count(0U, step(&p, 0U, y)); /* silence repeats nothing */
    assert_count(0U, step(&p, 2U, y));
    y[1] = R(0.12500001);
    assert_count(0U, step(&p, 2U, y));
    assert_count(0U, step(&p, 2U, y));
    assert_count(2U, step(&p, 2U, y));
    p.score[1].equal = 254U;
    for (uint32_t k = 0U; k < 2U; k++) {
        assert_count(2U, step(&p, 2U, y));
        assert_count(255U, p.score[1].equal);
    }
    hg_consistency_reset(&p.judge);
    hg_fusion_exclude(&p.self, 1U, true);
    assert_count(0U, step(&p, 2U, y)); /* who is out is not judged */
}

static void any_sensor_may_freeze(void **state)
{
    (void)state;
    static const hg_real zero[SENSORS] = {R(0), R(0), R(0)}; /* as it is before the first value, which repeats nothing */
    for (uint8_t i = 0U; i < SENSORS; i++) {
        static rig p;
        begin(&p, &filter, &usual);
        for (uint32_t k = 1U; k <= usual.repeats; k++) {
            assert_count((k < usual.repeats) ? 0U : (1UL << i), step(&p, (uint8_t)(1UL << i), zero));
        }
    }
}

static void after_a_start_it_rests(void **state)
{
    (void)state;
    static rig p;
    hg_consistency_config c = usual;
    c.rest = 5U;
    c.confirm = 1U;
    begin(&p, &filter, &c);
    const hg_real y[SENSORS] = {R(90), R(-90), R(0)};
    for (uint32_t k = 0U; k < 5U; k++) {
        assert_count(0U, step(&p, 7U, y));
        assert_real(0.0, p.sum[0].c);
    }
    assert_true(step(&p, 7U, y) != 0U);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_tells_null_and_range),
        cmocka_unit_test(a_start_writes_to_its_own_sensors_only),
        cmocka_unit_test(the_response_is_that_of_the_filter),
        cmocka_unit_test(hypotheses_begin_every_stride),
        cmocka_unit_test(small_biases_are_not_taken_for_larger_ones),
        cmocka_unit_test(a_score_is_that_of_the_best_hypothesis_now),
        cmocka_unit_test(without_an_update_there_is_no_score),
        cmocka_unit_test(the_biased_sensor_is_blamed_and_no_other),
        cmocka_unit_test(a_lead_must_last),
        cmocka_unit_test(a_score_at_the_limit_is_not_above_it),
        cmocka_unit_test(of_two_that_stand_out_alike_it_is_the_first),
        cmocka_unit_test(all_who_were_blamed_stay_so_until_a_reset),
        cmocka_unit_test(a_frozen_sensor_repeats_itself),
        cmocka_unit_test(any_sensor_may_freeze),
        cmocka_unit_test(after_a_start_it_rests),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
