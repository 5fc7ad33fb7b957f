/** @file
 *  isolate.h: what a fault estimate stands for, on courses whose cause is known, and the regression against normal equations in double. */
#include "support.h"

#include "hullguard/isolate.h"

#include <float.h>

/* Estimates: actuator's fault, two sensors' faults, deflection, speeds of two bodies. */
#define ESTIMATES 6U
#define COMPONENTS 2U
#define SENSORS 2U
#define SETTLE 20U
#define RELEASE 30U
#define BLOCK 25U
#define BLOCKS 4U
#define WINDOW (BLOCK * BLOCKS)
#define REALS (HG_ISOLATE_REALS(COMPONENTS, BLOCKS))
#define SPRING 16000.0
#define DAMPER 1650.0
#define LOW_PASS 0.25

static const uint8_t sensor_list[SENSORS] = {2U, 1U};
static const hg_real sensor_limit[SENSORS] = {R(0.5), R(0.25)};
static const hg_real whole[COMPONENTS * ESTIMATES] = {R(0), R(0), R(0), R(SPRING), R(0), R(0), R(0), R(0), R(0), R(0), R(DAMPER), R(-DAMPER)};
static const hg_real excitation[COMPONENTS] = {R(8), R(8)};
static const hg_isolate_config usual = {.estimates = ESTIMATES, .actuator = 0U, .limit = R(12), .sensors = SENSORS, .sensor = sensor_list,
                                        .sensor_limit = sensor_limit, .components = COMPONENTS, .whole = whole, .excitation = excitation,
                                        .low_pass = R(LOW_PASS), .settle = SETTLE, .release = RELEASE, .block = BLOCK, .blocks = BLOCKS,
                                        .explained = R(0.9), .steady = R(5)};
static const hg_real no_radius[ESTIMATES] = {R(0), R(0), R(0), R(0), R(0), R(0)};

/* A moving plant and what its observer says of it: the fault estimate is the low-passed force over each interval. */
typedef struct {
    double   motion;    /* of the road: 1 for usual, 0 for none */
    double   offset;    /* deflection at rest */
    double   actuator;  /* force */
    double   spring;    /* shares lost */
    double   damper;
    double   noise;     /* of the estimate */
    double   low;       /* its low pass */
    double   force;     /* of the last sample */
    uint32_t random;
    uint32_t k;
} course;

static void course_step(course *c, hg_real *estimate)
{
    const double t = 0.11 * (double)c->k;
    const double deflection = c->offset + (c->motion * 0.02 * sin(t));
    const double rate = c->motion * 0.15 * (sin((2.3 * t) + 1.0) + (0.5 * cos(t)));
    const double force = c->actuator + (c->spring * SPRING * deflection) + (c->damper * DAMPER * rate);
    c->low += LOW_PASS * ((0.5 * (force + c->force)) - c->low);
    c->force = force;
    c->k++;
    estimate[0] = R(c->low + (c->noise * (double)draw_between(&c->random, -100, 100) / 100.0));
    estimate[1] = R(0);
    estimate[2] = R(0);
    estimate[3] = R(deflection);
    estimate[4] = R(rate + 0.3);
    estimate[5] = R(0.3);
}

typedef struct {
    hg_isolate   isolate;
    hg_isolation found;
    hg_real      memory[REALS + 1U];
} rig;

static void begin(rig *r, const hg_isolate_config *config)
{
    arm(r->memory, COUNT(r->memory));
    assert_status(HG_OK, hg_isolate_start(&r->isolate, config, r->memory));
}

static void run(rig *r, course *c, uint32_t samples)
{
    for (uint32_t i = 0U; i < samples; i++) {
        hg_real estimate[ESTIMATES];
        course_step(c, estimate);
        assert_status(HG_OK, hg_isolate_step(&r->isolate, estimate, no_radius, &r->found));
        assert_int_equal((int)HG_BASIS_STATISTICAL, (int)r->found.basis);
    }
}

#define assert_found(r, what, bits)                              \
    do {                                                         \
        assert_int_equal((int)(what), (int)(r).found.cause);     \
        assert_count((bits), (r).found.candidates);              \
    } while (false)

static void start_tells_null_and_bad_tables(void **state)
{
    (void)state;
    hg_isolate self;
    hg_real memory[REALS];
    const uint8_t outside[SENSORS] = {0U, ESTIMATES};
    const hg_real not_finite[COMPONENTS * ESTIMATES] = {REAL_NAN};
    const hg_real nothing[COMPONENTS] = {R(1), R(0)};
    arm(memory, REALS);
    assert_status(HG_E_ARGUMENT, hg_isolate_start(NULL, &usual, memory));
    assert_status(HG_E_ARGUMENT, hg_isolate_start(&self, NULL, memory));
    assert_status(HG_E_ARGUMENT, hg_isolate_start(&self, &usual, NULL));
    hg_isolate_config c[23];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = usual;
    }
    c[0].actuator = ESTIMATES;
    c[1].sensors = 29U;
    c[2].sensor = NULL;
    c[3].sensor = outside;
    c[4].sensor_limit = NULL;
    c[5].release = 0U;
    c[6].block = 0U;
    c[7].blocks = 0U;
    c[8].limit = R(-1);
    c[9].limit = REAL_NAN;
    c[10].low_pass = R(0);
    c[11].low_pass = R(1.5);
    c[12].explained = R(-0.1);
    c[13].explained = R(1);
    c[14].steady = R(0);
    c[15].excitation = NULL;
    c[16].excitation = nothing;
    c[17].whole = NULL;
    c[18].whole = not_finite;
    c[19].components = 31U;
    c[20].low_pass = REAL_NAN;
    c[21].steady = REAL_NAN;
    c[22].estimates = 0U;
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_false(hg_isolate_valid(&c[i]));
        assert_status(HG_E_CONFIG, hg_isolate_start(&self, &c[i], memory));
    }
    assert_untouched(memory, REALS);
    assert_true(hg_isolate_valid(&usual));
    c[0] = usual;
    c[0].sensors = 0U;
    c[0].sensor = NULL;
    c[0].sensor_limit = NULL;
    c[0].components = 0U;
    c[0].whole = NULL;
    c[0].excitation = NULL;
    assert_true(hg_isolate_valid(&c[0]));
}

static void road_alone_is_no_fault(void **state)
{
    (void)state;
    rig r;
    course c = {.motion = 1.0, .noise = 5.0, .random = seed_of_run(61U)};
    begin(&r, &usual);
    for (int i = 0; i < 20; i++) {
        run(&r, &c, 20U);
        assert_found(r, HG_CAUSE_INPUT, 0U);
    }
    assert_untouched(&r.memory[REALS], 1U);
}

static void the_window_is_waited_for(void **state)
{
    (void)state;
    rig r;
    course c = {.motion = 1.0, .actuator = 200.0, .random = seed_of_run(62U)};
    begin(&r, &usual);
    run(&r, &c, SETTLE + WINDOW - 1U); /* the first sample is outside already */
    assert_found(r, HG_CAUSE_UNDECIDED, 7U);
    assert_real(0.0, r.isolate.share[0]);
    run(&r, &c, 1U);
    assert_found(r, HG_CAUSE_ACTUATOR, 1U);
}

static void an_actuator_is_told_with_its_force(void **state)
{
    (void)state;
    const double force[] = {200.0, -200.0, 20.0};
    for (size_t i = 0U; i < COUNT(force); i++) {
        rig r;
        course c = {.motion = 1.0, .noise = 4.0, .actuator = force[i], .random = seed_of_run(63U)};
        begin(&r, &usual);
        run(&r, &c, 400U);
        assert_found(r, HG_CAUSE_ACTUATOR, 1U);
        assert_near(force[i], r.isolate.share[0], 2.0);
        assert_true(r.found.explained < R(0.2));
        assert_true(r.found.ratio > R(25));
    }
}

static void a_component_is_told_with_its_share(void **state)
{
    (void)state;
    rig r;
    course spring = {.motion = 1.0, .noise = 4.0, .spring = 0.2, .random = seed_of_run(64U)};
    course damper = {.motion = 1.0, .noise = 4.0, .damper = 0.5, .offset = 0.001, .random = seed_of_run(65U)};
    begin(&r, &usual);
    run(&r, &spring, 600U);
    assert_found(r, HG_CAUSE_COMPONENT, 2U);
    assert_near(0.2, r.isolate.share[1], 0.01);
    assert_near(0.0, r.isolate.share[2], 0.01);
    assert_near(0.0, r.isolate.share[0], 2.0);
    assert_true(r.found.explained > R(0.95));
    begin(&r, &usual);
    run(&r, &damper, 600U);
    assert_found(r, HG_CAUSE_COMPONENT, 4U);
    assert_near(0.5, r.isolate.share[2], 0.01);
    assert_near(0.0, r.isolate.share[1], 0.02);
}

static void several_components_are_ambiguous(void **state)
{
    (void)state;
    rig r;
    course c = {.motion = 1.0, .spring = 0.5, .damper = 0.5, .random = seed_of_run(66U)};
    begin(&r, &usual);
    run(&r, &c, 400U);
    assert_found(r, HG_CAUSE_AMBIGUOUS, 6U);
    assert_near(0.5, r.isolate.share[1], 0.01);
    assert_near(0.5, r.isolate.share[2], 0.01);
}

/* A spring beside an offset of its own size is two faults: each alone explains only a part. */
static void a_component_beside_an_actuator_is_ambiguous(void **state)
{
    (void)state;
    rig r;
    course c = {.motion = 1.0, .spring = 0.2, .actuator = 60.0, .random = seed_of_run(67U)};
    begin(&r, &usual);
    run(&r, &c, 400U);
    assert_int_equal((int)HG_CAUSE_AMBIGUOUS, (int)r.found.cause);
}

/* Two rows that say the same cannot be told apart, and do not spoil the solution with numbers that are none. */
static void equal_components_are_ambiguous(void **state)
{
    (void)state;
    hg_real twice[COMPONENTS * ESTIMATES];
    memcpy(twice, whole, sizeof(twice));
    memcpy(&twice[ESTIMATES], whole, ESTIMATES * sizeof(hg_real));
    hg_isolate_config config = usual;
    config.whole = twice;
    rig r;
    course c = {.motion = 1.0, .spring = 0.2, .random = seed_of_run(68U)};
    begin(&r, &config);
    run(&r, &c, 400U);
    assert_found(r, HG_CAUSE_AMBIGUOUS, 6U);
    assert_near(0.2, r.isolate.share[1], 0.01);
    assert_real(0.0, r.isolate.share[2]);
}

/* A plant that stands off its middle: a spring that has lost a share pushes as steadily as an actuator. */
static void without_motion_nothing_is_told_apart(void **state)
{
    (void)state;
    rig r;
    course spring = {.offset = 0.02, .spring = 0.2, .noise = 1.0, .random = seed_of_run(69U)};
    course actuator = {.offset = 0.02, .actuator = 64.0, .noise = 1.0, .random = seed_of_run(70U)};
    course middle = {.actuator = 64.0, .noise = 1.0, .random = seed_of_run(71U)};
    course nearly = {.offset = 0.001, .actuator = 64.0, .noise = 1.0, .random = seed_of_run(82U)};
    begin(&r, &usual);
    run(&r, &spring, 400U);
    assert_found(r, HG_CAUSE_AMBIGUOUS, 3U);
    begin(&r, &usual);
    run(&r, &actuator, 400U);
    assert_found(r, HG_CAUSE_AMBIGUOUS, 3U);
    begin(&r, &usual);
    run(&r, &middle, 400U); /* no deflection: no spring could push so */
    assert_found(r, HG_CAUSE_ACTUATOR, 1U);
    begin(&r, &usual);
    run(&r, &nearly, 400U); /* too little of it */
    assert_found(r, HG_CAUSE_ACTUATOR, 1U);
}

static void a_force_that_follows_nothing_is_ambiguous(void **state)
{
    (void)state;
    rig r;
    course c = {.motion = 1.0, .noise = 500.0, .random = seed_of_run(72U)};
    begin(&r, &usual);
    run(&r, &c, 600U);
    assert_found(r, HG_CAUSE_AMBIGUOUS, 7U);
}

/* Motion no larger than noise names nobody, whatever it explains. */
static void small_motion_names_nobody(void **state)
{
    (void)state;
    const hg_real lowest = (sizeof(hg_real) == 8U) ? R(DBL_MIN) : R(FLT_MIN);
    const hg_real large[COMPONENTS] = {R(400), R(400)};
    const hg_real none[COMPONENTS] = {lowest, lowest}; /* whose square is 0 */
    hg_isolate_config config = usual;
    rig r;
    course spring = {.motion = 1.0, .spring = 0.2, .random = seed_of_run(73U)};
    config.excitation = large;
    begin(&r, &config);
    run(&r, &spring, 400U);
    assert_int_equal((int)HG_CAUSE_AMBIGUOUS, (int)r.found.cause);
    course still = {.actuator = 64.0, .noise = 1.0, .random = seed_of_run(74U)};
    config.excitation = none;
    begin(&r, &config);
    run(&r, &still, 400U);
    assert_found(r, HG_CAUSE_ACTUATOR, 1U);
}

static void one_sample_windows_do_not_divide_by_nothing(void **state)
{
    (void)state;
    hg_isolate_config config = usual;
    config.block = 1U;
    config.blocks = 1U;
    config.settle = 0U;
    rig r;
    course c = {.actuator = 64.0, .motion = 0.0, .random = seed_of_run(75U)};
    begin(&r, &config);
    run(&r, &c, 50U);
    assert_found(r, HG_CAUSE_ACTUATOR, 1U);
    assert_real(0.0, r.found.explained);
    assert_real(HG_REAL_MAX, r.found.ratio);
}

static void what_is_older_than_the_window_is_forgotten(void **state)
{
    (void)state;
    rig r;
    rig fresh;
    course c = {.motion = 1.0, .spring = 0.2, .noise = 2.0, .random = seed_of_run(76U)};
    begin(&r, &usual);
    run(&r, &c, 3000U);
    c.spring = 0.0;
    c.damper = 0.5;
    run(&r, &c, 400U);
    assert_found(r, HG_CAUSE_COMPONENT, 4U);
    /* the same samples, from the beginning of a block on, into one whose blocks hold nothing */
    run(&r, &c, BLOCK - r.isolate.filled);
    begin(&fresh, &usual);
    memcpy(fresh.isolate.smooth, r.isolate.smooth, COMPONENTS * sizeof(hg_real));
    memcpy(fresh.isolate.now, r.isolate.now, COMPONENTS * sizeof(hg_real));
    memset(fresh.isolate.factor, 0, (BLOCKS + 1U) * HG_ISOLATE_FACTOR(COMPONENTS) * sizeof(hg_real));
    fresh.isolate.episode = true;
    fresh.isolate.quiet = r.isolate.quiet;
    fresh.isolate.age = SETTLE;
    fresh.isolate.filled = 0U;
    fresh.isolate.open = r.isolate.open;
    fresh.isolate.complete = 0U;
    course d = c;
    run(&r, &c, WINDOW);
    run(&fresh, &d, WINDOW);
    assert_found(r, fresh.found.cause, fresh.found.candidates);
    assert_real((double)r.found.explained, fresh.found.explained);
    assert_real((double)r.found.ratio, fresh.found.ratio);
    assert_memory_equal(r.isolate.share, fresh.isolate.share, (COMPONENTS + 1U) * sizeof(hg_real));
}

static void an_episode_ends_and_another_begins(void **state)
{
    (void)state;
    rig r;
    course c = {.motion = 1.0, .actuator = 200.0, .random = seed_of_run(77U)};
    begin(&r, &usual);
    run(&r, &c, 300U);
    assert_found(r, HG_CAUSE_ACTUATOR, 1U);
    c.actuator = 0.0;
    run(&r, &c, RELEASE + 100U);
    assert_found(r, HG_CAUSE_INPUT, 0U);
    c.damper = 0.5;
    run(&r, &c, 10U);
    assert_found(r, HG_CAUSE_UNDECIDED, 7U);
    run(&r, &c, 400U);
    assert_found(r, HG_CAUSE_COMPONENT, 4U);
}

static void short_returns_do_not_end_an_episode(void **state)
{
    (void)state;
    rig r;
    const hg_real beyond[ESTIMATES] = {R(13), R(0), R(0), R(0), R(0), R(0)};
    const hg_real within[ESTIMATES] = {R(11), R(0), R(0), R(0), R(0), R(0)};
    begin(&r, &usual);
    assert_status(HG_OK, hg_isolate_step(&r.isolate, beyond, no_radius, &r.found));
    for (uint32_t i = 1U; i < RELEASE; i++) {
        assert_status(HG_OK, hg_isolate_step(&r.isolate, within, no_radius, &r.found));
        assert_found(r, HG_CAUSE_UNDECIDED, 7U);
    }
    assert_status(HG_OK, hg_isolate_step(&r.isolate, within, no_radius, &r.found));
    assert_found(r, HG_CAUSE_INPUT, 0U);
}

static void radii_are_limits_too(void **state)
{
    (void)state;
    rig r;
    const hg_real estimate[ESTIMATES] = {R(100), R(2), R(0), R(0), R(0), R(0)};
    const hg_real wide[ESTIMATES] = {R(100), R(2), R(0), R(0), R(0), R(0)};
    const hg_real infinite[ESTIMATES] = {REAL_INF, REAL_INF, R(0), R(0), R(0), R(0)};
    begin(&r, &usual);
    assert_status(HG_OK, hg_isolate_step(&r.isolate, estimate, wide, &r.found));
    assert_found(r, HG_CAUSE_INPUT, 0U);
    assert_status(HG_OK, hg_isolate_step(&r.isolate, estimate, infinite, &r.found));
    assert_found(r, HG_CAUSE_INPUT, 0U);
    assert_status(HG_OK, hg_isolate_step(&r.isolate, estimate, no_radius, &r.found));
    assert_found(r, HG_CAUSE_AMBIGUOUS, 0x17U); /* sensor_list[1] is estimate 1 */
}

static void sensors_tell_for_themselves(void **state)
{
    (void)state;
    rig r;
    hg_real estimate[ESTIMATES] = {R(0), R(-0.3), R(0), R(0), R(0), R(0)};
    begin(&r, &usual);
    assert_status(HG_OK, hg_isolate_step(&r.isolate, estimate, no_radius, &r.found));
    assert_found(r, HG_CAUSE_SENSOR, 0x10U);
    estimate[1] = R(0);
    for (uint32_t i = 1U; i < RELEASE; i++) {
        assert_status(HG_OK, hg_isolate_step(&r.isolate, estimate, no_radius, &r.found));
        assert_found(r, HG_CAUSE_SENSOR, 0x10U);
    }
    assert_status(HG_OK, hg_isolate_step(&r.isolate, estimate, no_radius, &r.found));
    assert_found(r, HG_CAUSE_INPUT, 0U);
    estimate[1] = R(1);
    estimate[2] = R(1);
    assert_status(HG_OK, hg_isolate_step(&r.isolate, estimate, no_radius, &r.found));
    assert_found(r, HG_CAUSE_AMBIGUOUS, 0x18U);
}

static void bad_numbers_change_nothing(void **state)
{
    (void)state;
    rig r;
    course c = {.motion = 1.0, .spring = 0.2, .random = seed_of_run(78U)};
    begin(&r, &usual);
    run(&r, &c, 333U);
    hg_isolate before;
    const hg_isolation found = r.found;
    memcpy(&before, &r.isolate, sizeof(before)); /* padding too */
    const hg_real bad[] = {REAL_NAN, REAL_INF, -REAL_INF, R(2e9)};
    hg_real memory[REALS];
    const uint32_t kept = REALS - (COMPONENTS + 1U); /* row[] is scratch, behind share[] */
    memcpy(memory, r.memory, sizeof(memory));
    for (size_t b = 0U; b < COUNT(bad); b++) {
        for (size_t e = 0U; e < ESTIMATES; e++) {
            hg_real estimate[ESTIMATES] = {R(0), R(0), R(0), R(0), R(0), R(0)};
            estimate[e] = bad[b];
            assert_status(HG_E_NUMERIC, hg_isolate_step(&r.isolate, estimate, no_radius, &r.found));
        }
    }
    const hg_real steep[ESTIMATES] = {R(0), R(0), R(0), R(1e8), R(0), R(0)}; /* fine, but the spring's force is not */
    assert_status(HG_E_NUMERIC, hg_isolate_step(&r.isolate, steep, no_radius, &r.found));
    const hg_real bad_radius[ESTIMATES] = {R(0), R(0), REAL_NAN, R(0), R(0), R(0)};
    assert_status(HG_E_NUMERIC, hg_isolate_step(&r.isolate, no_radius, bad_radius, &r.found));
    assert_memory_equal(&before, &r.isolate, sizeof(before));
    assert_int_equal((int)found.cause, (int)r.found.cause);
    assert_memory_equal(memory, r.memory, (COMPONENTS + 1U) * sizeof(hg_real));
    assert_memory_equal(&memory[2U * (COMPONENTS + 1U)], &r.memory[2U * (COMPONENTS + 1U)], (kept - (COMPONENTS + 1U)) * sizeof(hg_real));
}

static void the_largest_numbers_stay_finite(void **state)
{
    (void)state;
    rig r;
    hg_isolate_config config = usual;
    hg_real one[COMPONENTS * ESTIMATES] = {R(0)};
    one[3] = R(1);
    one[ESTIMATES + 4U] = R(1);
    config.whole = one;
    begin(&r, &config);
    for (uint32_t k = 0U; k < 400U; k++) {
        const hg_real sign = ((k & 1U) == 0U) ? HG_ISOLATE_LARGEST : -HG_ISOLATE_LARGEST;
        const hg_real slow = ((k & 8U) == 0U) ? HG_ISOLATE_LARGEST : -HG_ISOLATE_LARGEST;
        const hg_real estimate[ESTIMATES] = {sign, R(0), R(0), slow, (k % 3U == 0U) ? sign : slow, R(0)};
        assert_status(HG_OK, hg_isolate_step(&r.isolate, estimate, no_radius, &r.found));
    }
    for (uint32_t i = 0U; i < REALS; i++) {
        assert_true(hg_real_finite(r.memory[i]));
    }
    assert_true(hg_real_finite(r.found.explained));
}

/* Offset and shares of a window by normal equations in double. */
static void solve_by_normal_equations(double sums[3][4], double *b)
{
    for (size_t i = 0U; i < 3U; i++) {
        for (size_t j = i + 1U; j < 3U; j++) {
            const double part = sums[j][i] / sums[i][i];
            for (size_t l = 0U; l < 4U; l++) {
                sums[j][l] -= part * sums[i][l];
            }
        }
    }
    for (size_t i = 3U; i > 0U; i--) {
        b[i - 1U] = sums[i - 1U][3];
        for (size_t j = i; j < 3U; j++) {
            b[i - 1U] -= sums[i - 1U][j] * b[j];
        }
        b[i - 1U] /= sums[i - 1U][i - 1U];
    }
}

static void the_regression_is_that_of_normal_equations(void **state)
{
    (void)state;
    rig r;
    course c = {.motion = 1.0, .actuator = 50.0, .spring = 0.3, .damper = 0.2, .noise = 10.0, .offset = 0.03, .random = seed_of_run(79U)};
    double phi[COMPONENTS] = {0.0, 0.0};
    double last[COMPONENTS] = {0.0, 0.0};
    double sums[3][4] = {{0}};
    begin(&r, &usual);
    for (uint32_t k = 0U; k < (SETTLE + WINDOW); k++) {
        hg_real estimate[ESTIMATES];
        course_step(&c, estimate);
        assert_status(HG_OK, hg_isolate_step(&r.isolate, estimate, no_radius, &r.found));
        const double force[COMPONENTS] = {SPRING * (double)estimate[3], DAMPER * ((double)estimate[4] - (double)estimate[5])};
        for (size_t i = 0U; i < COMPONENTS; i++) {
            phi[i] += LOW_PASS * ((0.5 * (force[i] + last[i])) - phi[i]);
            last[i] = force[i];
        }
        const double row[4] = {1.0, phi[0], phi[1], (double)estimate[0]};
        for (size_t i = 0U; (k >= SETTLE) && (i < 3U); i++) {
            for (size_t j = 0U; j < 4U; j++) {
                sums[i][j] += row[i] * row[j];
            }
        }
    }
    double b[3];
    solve_by_normal_equations(sums, b);
    assert_near(b[0], r.isolate.share[0], (sizeof(hg_real) == 8U) ? 1e-8 : 1e-2);
    assert_near(b[1], r.isolate.share[1], (sizeof(hg_real) == 8U) ? 1e-10 : 1e-4);
    assert_near(b[2], r.isolate.share[2], (sizeof(hg_real) == 8U) ? 1e-10 : 1e-4);
}

static void counters_saturate(void **state)
{
    (void)state;
    rig r;
    course c = {.motion = 1.0, .actuator = 200.0, .random = seed_of_run(80U)};
    begin(&r, &usual);
    run(&r, &c, 300U);
    r.isolate.age = UINT32_MAX;
    run(&r, &c, 300U);
    assert_found(r, HG_CAUSE_ACTUATOR, 1U);
    assert_count(UINT32_MAX, r.isolate.age);
}

static void reset_forgets_all(void **state)
{
    (void)state;
    rig r;
    rig fresh;
    course c = {.motion = 1.0, .spring = 0.2, .random = seed_of_run(81U)};
    begin(&r, &usual);
    run(&r, &c, 400U);
    hg_isolate_reset(&r.isolate);
    begin(&fresh, &usual);
    course d = c;
    for (int i = 0; i < 40; i++) {
        run(&r, &c, 10U);
        run(&fresh, &d, 10U);
        assert_int_equal((int)fresh.found.cause, (int)r.found.cause);
        assert_memory_equal(fresh.isolate.share, r.isolate.share, (COMPONENTS + 1U) * sizeof(hg_real));
    }
    assert_found(r, HG_CAUSE_COMPONENT, 2U);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_tells_null_and_bad_tables),
        cmocka_unit_test(road_alone_is_no_fault),
        cmocka_unit_test(the_window_is_waited_for),
        cmocka_unit_test(an_actuator_is_told_with_its_force),
        cmocka_unit_test(a_component_is_told_with_its_share),
        cmocka_unit_test(several_components_are_ambiguous),
        cmocka_unit_test(a_component_beside_an_actuator_is_ambiguous),
        cmocka_unit_test(equal_components_are_ambiguous),
        cmocka_unit_test(without_motion_nothing_is_told_apart),
        cmocka_unit_test(a_force_that_follows_nothing_is_ambiguous),
        cmocka_unit_test(small_motion_names_nobody),
        cmocka_unit_test(one_sample_windows_do_not_divide_by_nothing),
        cmocka_unit_test(what_is_older_than_the_window_is_forgotten),
        cmocka_unit_test(an_episode_ends_and_another_begins),
        cmocka_unit_test(short_returns_do_not_end_an_episode),
        cmocka_unit_test(radii_are_limits_too),
        cmocka_unit_test(sensors_tell_for_themselves),
        cmocka_unit_test(bad_numbers_change_nothing),
        cmocka_unit_test(the_largest_numbers_stay_finite),
        cmocka_unit_test(the_regression_is_that_of_normal_equations),
        cmocka_unit_test(counters_saturate),
        cmocka_unit_test(reset_forgets_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
