/** @file
 *  statistic.h: a filter's statistics as residuals, inputs that are known and inputs that are not. */
#include "support.h"

#include "small_filter.h"

#define SIGNALS 3U

typedef struct {
    hg_statistic self;
    hg_real      memory[SF_REALS + 1U];
    hg_real      value[SIGNALS], radius[SIGNALS];
    hg_real      r[HG_STATISTICS + 1U], J[HG_STATISTICS + 1U];
    double       x; /* of the plant, and */
    double       estimate, variance; /* of a Kalman filter: the prediction */
} rig;

static void begin(rig *r)
{
    (void)memset(r, 0, sizeof *r);
    arm(&r->memory[SF_REALS], 1U);
    arm(r->r, COUNT(r->r));
    arm(r->J, COUNT(r->J));
    r->variance = 1.0;
    assert_status(HG_OK, hg_statistic_start(&r->self, &sf_config, r->memory));
}

static hg_status step(rig *r, double y, double u, double y_radius, double u_radius)
{
    r->value[1] = R((y + (u - 1.0)) / 4.0);
    r->value[2] = R(u);
    r->radius[1] = R(y_radius);
    r->radius[2] = R(u_radius);
    const hg_status status = hg_statistic_step(&r->self, r->value, r->radius, r->r, r->J);
    assert_untouched(&r->memory[SF_REALS], 1U);
    assert_untouched(&r->r[HG_STATISTICS], 1U);
    assert_untouched(&r->J[HG_STATISTICS], 1U);
    return status;
}

static void null_pointers_are_refused(void **state)
{
    (void)state;
    static rig r;
    assert_count(SF_REALS, hg_statistic_reals(&sf_config));
    assert_status(HG_E_ARGUMENT, hg_statistic_start(NULL, &sf_config, r.memory));
    assert_status(HG_E_ARGUMENT, hg_statistic_start(&r.self, NULL, r.memory));
    assert_status(HG_E_ARGUMENT, hg_statistic_start(&r.self, &sf_config, NULL));
    hg_statistic_config c = sf_config;
    c.filter.degree = 4U;
    assert_status(HG_E_CONFIG, hg_statistic_start(&r.self, &c, r.memory));
}

static void tables_that_name_nothing_are_not_valid(void **state)
{
    (void)state;
    static const hg_real below[] = {R(-1)};
    assert_true(hg_statistic_valid(&sf_config, SIGNALS));
    assert_false(hg_statistic_valid(&sf_config, 2U)); /* the input's place */
    assert_false(hg_statistic_valid(&sf_config, 1U)); /* the output's as well */
    hg_statistic_config c[12];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = sf_config;
    }
    c[0].filter.degree = 0U;
    c[1].signal = NULL;
    c[2].gain = NULL;
    c[3].input = NULL;
    c[4].zero = NULL;
    c[5].drive = NULL;
    c[6].direct = NULL;
    c[7].known = NULL;
    c[8].known = below;
    c[9].gain = below;
    c[10].gain = sf_zero;
    c[11].inputs = 0U;
    c[11].signal = sf_input;
    for (size_t i = 0U; i < 11U; i++) {
        assert_false(hg_statistic_valid(&c[i], SIGNALS));
    }
    assert_true(hg_statistic_valid(&c[11], SIGNALS));
    assert_false(hg_statistic_valid(&c[11], 2U));
    c[11].input = NULL; /* not read without one */
    assert_true(hg_statistic_valid(&c[11], SIGNALS));
}

/* ---- two plants side by side: x_a+ = decay_a x_a + B_a (u - zero) + w_a, gain_a signal_a = x_a + D_a (u - zero) + v_a ---- */

#define PAIR 2U
#define PAIR_REALS (HG_POLYNOMIAL_REALS(PAIR, PAIR, PAIR, PAIR, 7U) + (2U * PAIR))
#define PAIR_SIGNALS 5U

static const uint16_t pair_end[] = {1U, 2U};
static const uint8_t pair_factor[] = {0U, 1U, 0U, 1U};
static const hg_real pair_decay[] = {R(0.5), R(-0.25)};
static const hg_real pair_one[] = {R(1), R(1)};
static const uint16_t pair_start[] = {0U, 7U, 8U, 9U, 10U, 11U, 12U, 13U};
static const uint16_t pair_product[] = {0U, 1U, 2U, 3U, 4U, 5U, 6U, 1U, 2U, 3U, 4U, 5U, 6U};
static const uint8_t pair_noise[] = {0U, 0U, 0U, 1U, 2U, 3U, 4U};
static const uint8_t pair_moment[] = {0U, 1U, 2U, 0U, 0U, 0U, 0U};
static const hg_real pair_mean[] = {R(1), R(0), R(0), R(0), R(0)};
static const hg_real pair_covariance[25] = {[6] = R(0.25), [12] = R(0.5), [18] = R(0.125), [24] = R(0.75)};
static const hg_real pair_P0[] = {R(1), R(0), R(0), R(2)};
static const hg_real pair_M0[] = {R(1), R(0), R(0), R(0), R(1), R(0), R(0), R(0), R(2)};
static const hg_real pair_Q[] = {R(0.25), R(0.5)};
static const hg_real pair_R[] = {R(0.125), R(0.75)};
static const hg_real pair_zero[] = {R(0), R(0)};
static const hg_real pair_range[] = {R(1000), R(1000)};
/* What stands behind a list is nothing that it could hold. */
static const uint8_t pair_signal[] = {3U, 1U, 99U};
static const hg_real pair_gain[] = {R(4), R(2), R(-1)};
static const uint8_t pair_input[] = {0U, 4U, 99U};
static const hg_real pair_rest[] = {R(1), R(-2), R(99)};
static const hg_real pair_known[] = {R(0), R(0.5), R(-1)};
static const hg_real pair_drive[] = {R(2), R(0.5), R(-1), R(0.25)};
static const hg_real pair_direct[] = {R(1), R(-0.5), R(0.75), R(3)};
static const hg_statistic_config pair_config = {
    .filter = {.states = PAIR, .outputs = PAIR, .degree = 1U, .bounded = false, .lifted = PAIR, .measured = PAIR, .judged = PAIR, .noises = 5U, .ring = 7U, .lower = 7U,
               .f = {.width = 1U, .end = pair_end, .coefficient = pair_decay, .factor = pair_factor},
               .h = {.width = 1U, .end = pair_end, .coefficient = pair_one, .factor = pair_factor},
               .start = pair_start, .product = pair_product, .parent = pair_factor, .factor = pair_factor, .noise = pair_noise, .moment = pair_moment,
               .mean = pair_mean, .covariance = pair_covariance, .x0 = pair_zero, .P0 = pair_P0, .M0 = pair_M0, .Q = pair_Q, .R = pair_R,
               .range = pair_range, .fresh = pair_zero, .kappa = R(4), .joint = R(16), .weight = R(0.25), .drift = R(9)},
    .signal = pair_signal, .gain = pair_gain, .inputs = 2U, .input = pair_input, .zero = pair_rest, .drive = pair_drive, .direct = pair_direct, .known = pair_known,
    .settle = SF_SETTLE};

static void every_entry_of_a_list_is_looked_at(void **state)
{
    (void)state;
    static const uint8_t far[] = {3U, PAIR_SIGNALS};
    static const hg_real below[] = {R(0.5), R(-1)};
    static const hg_real none[] = {R(4), R(0)};
    assert_true(hg_statistic_valid(&pair_config, PAIR_SIGNALS));
    hg_statistic_config c[4] = {pair_config, pair_config, pair_config, pair_config};
    c[0].signal = far;
    c[1].gain = none;
    c[2].input = far;
    c[3].known = below;
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_false(hg_statistic_valid(&c[i], PAIR_SIGNALS));
    }
}

/* Plants that know nothing of each other: what each filter alone would say, and norms over both. */
static void two_plants_are_filtered_like_each_alone(void **state)
{
    (void)state;
    static hg_statistic self;
    static hg_real memory[PAIR_REALS + 1U];
    uint32_t random = seed_of_run(8U);
    double x[PAIR] = {0.0, 0.0}, estimate[PAIR] = {0.0, 0.0}, variance[PAIR] = {1.0, 2.0};
    assert_count(PAIR_REALS, hg_statistic_reals(&pair_config));
    arm(memory, COUNT(memory));
    assert_status(HG_OK, hg_statistic_start(&self, &pair_config, memory));
    assert_true(self.y == memory);
    assert_true(self.radius == &memory[PAIR]);
    assert_true(self.filter.x == &memory[2U * PAIR]); /* the filter's first */
    for (int k = 0; k < 100; k++) {
        hg_real value[PAIR_SIGNALS] = {R(0)}, r[HG_STATISTICS], J[HG_STATISTICS];
        const hg_real radius[PAIR_SIGNALS] = {R(0)};
        double square = 0.0, joint = 0.0, trace = 0.0, innovation[PAIR];
        double u[2];
        for (size_t i = 0U; i < 2U; i++) {
            u[i] = draw_between(&random, -64, 64) / 16.0;
            value[pair_input[i]] = R(u[i] + (double)pair_rest[i]);
        }
        for (size_t a = 0U; a < PAIR; a++) {
            const double y = x[a] + (draw_between(&random, -64, 64) / 64.0);
            const double through = ((double)pair_direct[2U * a] * u[0]) + ((double)pair_direct[(2U * a) + 1U] * u[1]);
            const double S = variance[a] + (double)pair_R[a];
            value[pair_signal[a]] = R((y + through) / (double)pair_gain[a]);
            innovation[a] = y - estimate[a];
            square += innovation[a] * innovation[a];
            joint += innovation[a] * innovation[a] / S;
            trace += S;
        }
        assert_status(HG_OK, hg_statistic_step(&self, value, radius, r, J));
        assert_untouched(&memory[PAIR_REALS], 1U);
        assert_near(sqrt(square), r[0], 1e-4);
        assert_near(sqrt(joint), r[1], 1e-4);
        assert_near(4.0 * sqrt(trace), J[0], 1e-4);
        for (size_t a = 0U; a < PAIR; a++) {
            const double gain = variance[a] / (variance[a] + (double)pair_R[a]);
            const double push = ((double)pair_drive[2U * a] * u[0]) + ((double)pair_drive[(2U * a) + 1U] * u[1]);
            const double decay = (double)pair_decay[a];
            assert_near(estimate[a] + (gain * innovation[a]), self.filter.x[a], 1e-4);
            estimate[a] = (decay * (estimate[a] + (gain * innovation[a]))) + push;
            variance[a] = (decay * decay * variance[a] * (1.0 - gain)) + (double)pair_Q[a];
            x[a] = (decay * x[a]) + push + (draw_between(&random, -64, 64) / 64.0);
        }
    }
}

/* x and P of a Kalman filter, then its prediction for the next sample. */
static void kalman(rig *r, double y, double u)
{
    const double S = r->variance + 0.25;
    const double innovation = y - r->estimate;
    assert_near(fabs(innovation), r->r[0], 1e-5);
    assert_near(4.0 * sqrt(S), r->J[0], 1e-5);
    assert_near(fabs(innovation) / sqrt(S), r->r[1], 1e-5);
    assert_real(4, r->J[1]);
    assert_real(3, r->J[2]);
    const double gain = r->variance / S;
    assert_near(r->estimate + (gain * innovation), r->self.filter.x[0], 1e-5);
    r->estimate = (0.5 * (r->estimate + (gain * innovation))) + (2.0 * (u - 1.0));
    r->variance = (0.25 * r->variance * (1.0 - gain)) + 0.25;
}

static void a_known_input_moves_the_plant_and_the_filter_alike(void **state)
{
    (void)state;
    static rig r;
    uint32_t random = seed_of_run(7U);
    begin(&r);
    for (int k = 0; k < 300; k++) {
        const double u = draw_between(&random, -64, 64) / 8.0;
        const double y = r.x + (draw_between(&random, -64, 64) / 64.0);
        assert_status(HG_OK, step(&r, y, u, 0.0078125, 0.0078125));
        assert_int_equal(k >= (int)SF_SETTLE, hg_statistic_ready(&r.self));
        kalman(&r, y, u);
        r.x = (0.5 * r.x) + (2.0 * (u - 1.0)) + (draw_between(&random, -64, 64) / 64.0);
    }
    assert_count(255, r.self.samples);
}

static void a_radius_is_in_the_filters_unit(void **state)
{
    (void)state;
    static rig r;
    begin(&r);
    assert_status(HG_OK, step(&r, 0.0, 1.0, 0.015625, 0.0)); /* 4 times that is what counts as just arrived */
    assert_near(4.0 * sqrt(1.25), r.J[0], 1e-5);
    begin(&r);
    assert_status(HG_OK, step(&r, 0.0, 1.0, 0.25, 0.0));
    assert_near((4.0 * sqrt(1.25)) + 1.0, r.J[0], 1e-5);
}

static void an_input_that_is_not_known_begins_anew(void **state)
{
    (void)state;
    static rig r;
    begin(&r);
    for (uint8_t k = 0U; k <= SF_SETTLE; k++) {
        assert_status(HG_OK, step(&r, 3.0, 1.0, 0.0, 0.0));
    }
    assert_true(hg_statistic_ready(&r.self));
    assert_status(HG_OK, step(&r, 3.0, 1.0, 0.0, 0.0079));
    assert_false(hg_statistic_ready(&r.self));
    assert_real(0, r.r[0]);
    assert_real(0, r.r[1]);
    assert_real(0, r.r[2]);
    assert_real(4, r.J[0]);
    assert_status(HG_OK, step(&r, 2000.0, 1.0, 0.0, 0.0079)); /* the filter is not asked at all */
    assert_status(HG_OK, step(&r, 0.5, 1.0, 0.0, 0.0)); /* as the first sample of all */
    assert_near(4.0 * sqrt(1.25), r.J[0], 1e-5);
    assert_near(0.4, r.self.filter.x[0], 1e-5);
}

static void every_input_must_be_known(void **state)
{
    (void)state;
    static rig r;
    static const uint8_t input[] = {0U, 2U};
    static const hg_real two[] = {R(0), R(2)};
    static const hg_real known[] = {R(0.5), R(0.5)};
    hg_statistic_config c = sf_config;
    c.inputs = 2U;
    c.input = input;
    c.zero = two;
    c.drive = two;
    c.direct = two;
    c.known = known;
    begin(&r);
    r.self.config = &c;
    for (size_t i = 0U; i < 4U; i++) {
        r.radius[0] = ((i & 1U) != 0U) ? R(1) : R(0);
        assert_status(HG_OK, step(&r, 0.0, 2.0, 0.0, ((i & 2U) != 0U) ? 1.0 : 0.0));
        assert_count((i == 0U) ? 1 : 0, r.self.samples);
    }
}

static void a_number_out_of_range_begins_anew(void **state)
{
    (void)state;
    static rig r;
    begin(&r);
    assert_status(HG_OK, step(&r, 3.0, 1.0, 0.0, 0.0));
    assert_status(HG_E_NUMERIC, step(&r, 2000.0, 1.0, 0.0, 0.0));
    assert_real(0, r.r[0]);
    assert_true(r.J[0] > R(0));
    assert_count(0, r.self.samples);
    assert_status(HG_OK, step(&r, 0.5, 1.0, 0.0, 0.0));
    assert_near(0.4, r.self.filter.x[0], 1e-5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(null_pointers_are_refused),
        cmocka_unit_test(tables_that_name_nothing_are_not_valid),
        cmocka_unit_test(every_entry_of_a_list_is_looked_at),
        cmocka_unit_test(two_plants_are_filtered_like_each_alone),
        cmocka_unit_test(a_known_input_moves_the_plant_and_the_filter_alike),
        cmocka_unit_test(a_radius_is_in_the_filters_unit),
        cmocka_unit_test(an_input_that_is_not_known_begins_anew),
        cmocka_unit_test(every_input_must_be_known),
        cmocka_unit_test(a_number_out_of_range_begins_anew),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
