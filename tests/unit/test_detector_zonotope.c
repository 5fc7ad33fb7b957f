/** @file
 *  detector.h with zonotopes for thresholds: on the small model, whose generators forget in one sample, a zonotope that never has to reduce is
 *  the exact hull. The same frames and losses go to a detector of either kind, and their thresholds must agree. */
#include "support.h"

#include "hullguard/detector.h"

#include "small_model.h"

#define COLUMNS 8U
#define ROOM(width) (HG_ZONOTOPE_REALS(1U, COLUMNS, (width)))
#define REALS (SM_REALS - (2U * HG_HULL_REALS(1U, 0U)) + ROOM(2U) + ROOM(1U))

static const uint8_t one_row[] = {1U};
static const hg_real zero[] = {R(0), R(0)};
static const hg_real one[] = {R(1), R(1)};
static const hg_real minus_one[] = {R(-1)};
static const hg_real rest_0[] = {R(0.0625), R(0.0625)};
static const hg_real moving_0[] = {R(64), R(0.0625)};
static const hg_real bias_1[] = {R(64), R(0.25)};
static const hg_zonotope_config balls[SM_GENERATORS] = {
    {.order = 1U, .residuals = 1U, .width = 2U, .disturbances = 0U, .initial = 0U, .columns = COLUMNS, .blocks = 1U, .reduction = HG_REDUCTION_BALL,
     .signal = sm_signals_0, .block = one_row, .state = zero, .input = zero, .output = zero, .outer = zero, .direct = one, .settle = 2U,
     .bias_rest = rest_0, .bias_moving = moving_0, .decay = zero, .always = zero, .growth = zero, .output_growth = zero, .recover = 1U,
     .ready_rest = 0U, .ready_moving = 3U},
    {.order = 1U, .residuals = 1U, .width = 1U, .disturbances = 0U, .initial = 0U, .columns = COLUMNS, .blocks = 1U, .reduction = HG_REDUCTION_BALL,
     .signal = sm_signals_1, .block = one_row, .state = zero, .input = one, .output = minus_one, .outer = one, .direct = one, .settle = 2U,
     .bias_rest = bias_1, .bias_moving = bias_1, .decay = zero, .always = zero, .growth = zero, .output_growth = zero, .recover = 1U,
     .ready_rest = 0U, .ready_moving = 2U}};

static hg_detector_config with_balls(void)
{
    hg_detector_config c = sm_detector;
    c.hull = NULL;
    c.zonotope = balls;
    c.reals = REALS;
    return c;
}

typedef struct {
    hg_detector self;
    hg_hold     hold[SM_GROUPS];
    hg_residual residual[SM_GENERATORS];
    hg_hull     hull[SM_GENERATORS];
    hg_zonotope zonotope[SM_GENERATORS];
    hg_alarm    alarm[SM_GENERATORS];
    int32_t     code[SM_CODES];
    hg_real     real[REALS + 1U];
    hg_finding  finding;
} rig;

static hg_detector_memory memory_of(rig *r, const hg_detector_config *config)
{
    const bool hull = config->hull != NULL;
    arm(r->real, COUNT(r->real));
    return (hg_detector_memory){.hold = r->hold, .residual = r->residual, .hull = hull ? r->hull : NULL, .zonotope = hull ? NULL : r->zonotope,
                                .alarm = r->alarm, .code = r->code, .codes = SM_CODES, .real = r->real, .reals = config->reals};
}

static void begin(rig *r, const hg_detector_config *config, hg_start how)
{
    (void)memset(r, 0x5A, sizeof(*r));
    const hg_detector_memory memory = memory_of(r, config);
    assert_count(config->reals, hg_detector_reals(config));
    assert_status(HG_OK, hg_detector_start(&r->self, config, &memory, how));
}

static void refuse(const hg_detector_config *config, const hg_detector_memory *memory, hg_status expected)
{
    hg_detector self;
    assert_status(expected, hg_detector_start(&self, config, memory, HG_START_REST));
}

static void what_cannot_be_is_refused(void **state)
{
    (void)state;
    static rig r;
    const hg_detector_config good = with_balls();
    const hg_detector_memory memory = memory_of(&r, &good);
    hg_detector_memory none = memory;
    none.zonotope = NULL;
    refuse(&good, &none, HG_E_ARGUMENT);
    hg_detector_config c = good;
    c.hull = sm_hull; /* either the one or the other */
    refuse(&c, &memory, HG_E_CONFIG);
    c = good;
    c.zonotope = NULL;
    refuse(&c, &memory, HG_E_CONFIG);
    c = good;
    c.history = 4U; /* group 0 is silent for up to 4: a rewind would need a row that is gone */
    refuse(&c, &memory, HG_E_CONFIG);
    hg_zonotope_config own[SM_GENERATORS] = {balls[0], balls[1]};
    c = good;
    c.zonotope = own;
    own[1].residuals = 2U;
    refuse(&c, &memory, HG_E_CONFIG);
    own[1] = balls[1];
    own[1].columns = 0U;
    refuse(&c, &memory, HG_E_CONFIG);
    hg_detector_memory little = memory;
    little.reals = REALS - 1U;
    refuse(&good, &little, HG_E_SIZE);
}

static void give(rig *r, uint8_t group, int32_t a, int32_t b, bool continues)
{
    const int32_t code[2] = {a, b};
    assert_status(HG_OK, hg_detector_receive(&r->self, group, code, continues));
}

static void agree(const rig *hull, const rig *ball)
{
    for (uint16_t i = 0U; i < 2U; i++) {
        assert_real(hull->self.r[i], ball->self.r[i]);
        assert_true(ball->self.J[i] >= hull->self.J[i]);
        assert_near(hull->self.J[i], ball->self.J[i], 1e-4);
    }
    assert_int_equal(hull->finding.plant, ball->finding.plant);
    assert_untouched(&ball->real[REALS], 1U);
}

static void a_zonotope_that_need_not_reduce_is_the_hull(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(61U);
    const hg_detector_config zonotope = with_balls();
    unsigned rewound = 0U;
    for (int run = 0; run < 20; run++) {
        static rig hull;
        static rig ball;
        const hg_start how = ((run % 2) == 0) ? HG_START_REST : HG_START_MOVING;
        begin(&hull, &sm_detector, how);
        begin(&ball, &zonotope, how);
        for (int k = 0; k < 400; k++) {
            const int32_t a = draw_between(&random, -20, 20);
            const int32_t b = draw_between(&random, -20, 20);
            const bool continues = draw_between(&random, 0, 9) > 2;
            if (draw_between(&random, 0, 2) == 0) {
                give(&hull, 0U, a, b, continues);
                give(&ball, 0U, a, b, continues);
            } else if (draw_between(&random, 0, 9) == 0) {
                assert_status(HG_OK, hg_detector_lose(&hull.self, 0U));
                assert_status(HG_OK, hg_detector_lose(&ball.self, 0U));
            } else {
                /* silence */
            }
            give(&hull, 1U, a, 0, continues);
            give(&ball, 1U, a, 0, continues);
            const hg_real before = hg_ring_row(&ball.self.radii, 0U)[0];
            assert_status(HG_OK, hg_detector_step(&hull.self, &hull.finding));
            assert_status(HG_OK, hg_detector_step(&ball.self, &ball.finding));
            rewound += (hg_ring_row(&ball.self.radii, 1U)[0] > before) ? 1U : 0U;
            agree(&hull, &ball);
            if ((k % 150) == 149) {
                hg_detector_restart(&hull.self, HG_START_MOVING);
                hg_detector_restart(&ball.self, HG_START_MOVING);
            }
        }
    }
    assert_true(rewound > 10U); /* radii of the past were widened */
}

/* Only corrupted tables bring a number that is not finite as far as a generator. */
static void a_refused_generator_begins_again(void **state)
{
    (void)state;
    const hg_real bad_middle[] = {REAL_NAN, R(0)};
    hg_hold_config hold[SM_GROUPS] = {sm_hold[0], sm_hold[1]};
    hold[0].middle = bad_middle;
    hg_detector_config c = with_balls();
    c.hold = hold;
    static rig r;
    begin(&r, &c, HG_START_REST);
    for (int k = 0; k < 5; k++) {
        give(&r, 0U, 10, 10, true);
        give(&r, 1U, 10, 0, true);
        assert_status(HG_OK, hg_detector_step(&r.self, &r.finding));
    }
    give(&r, 0U, HG_CODE_INVALID, 10, true);
    give(&r, 1U, 10, 0, true);
    assert_status(HG_E_NUMERIC, hg_detector_step(&r.self, &r.finding));
    assert_int_equal(HG_START_MOVING, r.zonotope[0].how);
    assert_false(hg_zonotope_ready(&r.zonotope[0]));
    assert_true(hg_zonotope_ready(&r.zonotope[1]));
    assert_int_equal(HG_PLANT_STARTING, r.finding.plant);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_cannot_be_is_refused),
        cmocka_unit_test(a_zonotope_that_need_not_reduce_is_the_hull),
        cmocka_unit_test(a_refused_generator_begins_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
