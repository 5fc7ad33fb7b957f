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
        cmocka_unit_test(a_known_input_moves_the_plant_and_the_filter_alike),
        cmocka_unit_test(a_radius_is_in_the_filters_unit),
        cmocka_unit_test(an_input_that_is_not_known_begins_anew),
        cmocka_unit_test(every_input_must_be_known),
        cmocka_unit_test(a_number_out_of_range_begins_anew),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
