/** @file
 *  detector.h with all that is optional: a predicted group, an uncertain plant, a bank of certificates. Signals and holds are those of
 *  small_model.h; here s0 and s2 belong to a plant that can be computed by hand,
 *
 *      x(k+1) = x(k) + u(k) / 4 + w(k)      |w| <= 1/128 + |u| / 16 + |s1| / 512      s0 = x, s2 = u, |u| <= 1/2, |s1| <= 8
 *
 *  and s1 moves by at most 1/4 a sample. Places: 0 .. 2 sent, 3 and 4 predicted s0 and s1, 5 what w may be.
 *      generator 0: r(k) = p0(k) - p0(k-1) - u(k-1) / 4           (faults 0 and 2)
 *      generator 1: r(k) = s1(k) - s1(k-1)                        (fault 1)
 *      bank:        s0(k) - s0(k-2) - (u(k-1) + u(k-2)) / 4 and s0(k) - s0(k-1) - u(k-1) / 4     (faults 0 and 3)
 *  All numbers are multiples of powers of two, so that both number types give the same. */
#include "support.h"

#include "hullguard/detector.h"

#include "small_model.h"

#define WIDTH 6U
#define WINDOW 3U
#define CERTIFICATES 2U
#define HISTORY 6U
#define TAPS 5U
#define SETTLE 6U
#define REALS ((2U * WIDTH) + HG_HOLD_REALS(SM_SIGNALS) + (2U * 3U) + (WIDTH * HISTORY) + (SM_SIGNALS * WINDOW) + 4U + 3U + 7U + 2U)
#define SUMS (2U * CERTIFICATES)
#define TINY 0.000244140625
#define DRIFT (0.0078125 + 0.03125 + 0.015625 + (0.25 * SM_HALF)) /* of the prediction in a sample */
#define PREDICTED(j) (SM_HALF + ((double)(j) * DRIFT))
#define HELD (0.25 + SM_HALF) /* what silence promises at level 0 */
#define ACTIVE (0.0625 + SM_HALF) /* the same at level 1 */
#define SLEW(j) ((0.25 * (double)(j)) + SM_HALF)

static const uint8_t input_place[] = {2U};
static const hg_real known[] = {R(SM_HALF)};
static const hg_real unit[] = {R(1), R(0), R(0), R(1)};
static const hg_real drive[] = {R(0.25), R(0)};
static const hg_real zeros[] = {R(0), R(0), R(0), R(0)};
static const hg_real predict_radius[] = {R(PREDICTED(1)), R(SLEW(1)), R(PREDICTED(2)), R(SLEW(2)), R(PREDICTED(3)), R(SLEW(3)),
                                         R(PREDICTED(4)), R(SLEW(4)), R(PREDICTED(5)), R(SLEW(5)), R(PREDICTED(6)), R(SLEW(6))};
static const hg_predict_config predict[] = {
    {.group = 0U, .first = 0U, .order = 2U, .width = 2U, .inputs = 1U, .input = input_place, .known = known, .correct = {2U, 2U, 0, unit},
     .state = {2U, 2U, 0, unit}, .drive = {2U, 1U, 0, drive}, .output = {2U, 2U, 0, unit}, .direct = {2U, 1U, 0, zeros}, .fresh = sm_half,
     .horizon = 6U, .radius = predict_radius, .settle = SETTLE}};

static const uint8_t mismatch_place[] = {2U, 1U};
static const hg_real mismatch_constant[] = {R(0.0078125)};
static const hg_real mismatch_gain[] = {R(0.0625), R(0.001953125)};
static const hg_mismatch_config mismatch = {.states = 1U, .width = 2U, .signal = mismatch_place, .constant = mismatch_constant,
                                            .gain = mismatch_gain};

static const uint8_t read_0[] = {3U, 2U};
static const uint8_t wide_0[] = {3U, 2U, 5U};
static const hg_real into_0[] = {R(1), R(0.25)};
static const hg_real direct_0[] = {R(1), R(0)};
static const hg_residual_config residual[] = {
    {.order = 1U, .residuals = 1U, .width = 2U, .signal = read_0, .state = {1U, 1U, 0, zeros}, .input = {1U, 2U, 0, into_0},
     .output = {1U, 1U, 0, sm_minus_one}, .direct = {1U, 2U, 0, direct_0}},
    {.order = 1U, .residuals = 1U, .width = 1U, .signal = sm_signals_1, .state = {1U, 1U, 0, zeros}, .input = {1U, 1U, 0, sm_one},
     .output = {1U, 1U, 0, sm_minus_one}, .direct = {1U, 1U, 0, sm_one}}};
static const uint8_t taps[] = {TAPS, TAPS, TAPS};
static const hg_real weight_0[(TAPS + 1U) * 3U] = {[0] = R(1), [1] = R(1), [TAPS + 2U] = R(0.25), [(2U * TAPS) + 3U] = R(1)};
static const hg_real bias_0[] = {R(TINY)};
static const hg_hull_config hull[] = {
    {.residuals = 1U, .width = 3U, .signal = wide_0, .taps = taps, .weight = weight_0, .settle = 1U, .rest = sm_start_0, .rest_left = zeros,
     .moving = sm_start_0, .moving_left = zeros, .bias = bias_0, .ready_rest = 0U, .ready_moving = 2U, .decay = zeros},
    {.residuals = 1U, .width = 1U, .signal = sm_signals_1, .taps = taps, .weight = sm_weight_1, .settle = 1U, .rest = sm_start_1,
     .rest_left = zeros, .moving = sm_start_1, .moving_left = zeros, .bias = sm_bias_1, .ready_rest = 0U, .ready_moving = 2U,
     .decay = zeros}};

static const uint8_t bank_place[] = {0U, 2U};
static const uint8_t bank_extra[] = {5U};
static const hg_real bank_weight[] = {R(1), R(1), R(0), R(0), R(0), R(-1), R(-0.25), R(-0.25), R(-1), R(0), R(-0.25), R(0)};
static const hg_real bank_extra_weight[] = {R(0), R(0), R(1), R(1), R(1), R(0)};
static const hg_real bank_bias[] = {R(TINY), R(TINY)};
static const hg_bank_config bank[] = {{.certificates = CERTIFICATES, .window = WINDOW, .width = 2U, .signal = bank_place, .weight = bank_weight,
                                       .extras = 1U, .extra = bank_extra, .extra_weight = bank_extra_weight, .bias = bank_bias, .widen = R(1)}};

static const uint8_t feeds[] = {0x3U, 0x1U, 0x3U};
static const uint32_t faults[] = {0x5U, 0x2U, 0x9U};
static const hg_detector_config usual = {
    .signals = SM_SIGNALS, .width = WIDTH, .groups = SM_GROUPS, .hold = sm_hold, .predictors = 1U, .predict = predict, .mismatch = &mismatch,
    .generators = 2U, .residual = residual, .hull = hull, .banks = 1U, .bank = bank,
    .decision = {.generators = 3U, .feeds = feeds, .faults = faults, .up = 1U, .down = 3U, .latch = false},
    .history = HISTORY, .window = WINDOW, .residuals = 3U, .codes = SM_CODES, .reals = REALS, .sums = SUMS};

/* Nothing but the bank, whose extra radius is the first derived signal. */
static const uint8_t alone_extra[] = {3U};
static const hg_bank_config bank_alone[] = {{.certificates = CERTIFICATES, .window = WINDOW, .width = 2U, .signal = bank_place,
    .weight = bank_weight, .extras = 1U, .extra = alone_extra, .extra_weight = bank_extra_weight, .bias = bank_bias, .widen = R(1)}};
static const hg_detector_config alone = {
    .signals = SM_SIGNALS, .width = SM_SIGNALS + 1U, .groups = SM_GROUPS, .hold = sm_hold, .predictors = 0U, .predict = NULL,
    .mismatch = &mismatch, .generators = 0U, .residual = NULL, .hull = NULL, .banks = 1U, .bank = bank_alone,
    .decision = {.generators = 1U, .feeds = &feeds[2], .faults = &faults[2], .up = 1U, .down = 3U, .latch = false},
    .history = WINDOW, .window = WINDOW, .residuals = 1U, .codes = SM_CODES,
    .reals = (2U * 4U) + 2U + HG_HOLD_REALS(SM_SIGNALS) + (4U * WINDOW) + (SM_SIGNALS * WINDOW), .sums = SUMS};

typedef struct {
    hg_hold     hold[SM_GROUPS];
    hg_predict  predict[2];
    hg_residual residual[SM_GENERATORS];
    hg_hull     hull[SM_GENERATORS];
    hg_bank     bank[2];
    hg_alarm    alarm[4];
    int32_t     code[SM_CODES + 1U]; /* one more each, for the canary */
    hg_real     real[REALS + 2U]; /* a test has a predictor with one input more */
    hg_acc      sum[SUMS + 1U];
} storage;

static hg_detector_memory memory_of(storage *s, const hg_detector_config *config)
{
    arm_codes(s->code, COUNT(s->code));
    arm(s->real, COUNT(s->real));
    arm(s->sum, COUNT(s->sum));
    return (hg_detector_memory){.hold = s->hold, .predict = (config->predictors > 0U) ? s->predict : NULL,
                                .residual = (config->generators > 0U) ? s->residual : NULL,
                                .hull = (config->generators > 0U) ? s->hull : NULL, .bank = (config->banks > 0U) ? s->bank : NULL,
                                .alarm = s->alarm, .code = s->code, .codes = SM_CODES, .real = s->real, .reals = config->reals,
                                .sum = (config->banks > 0U) ? s->sum : NULL, .sums = config->sums};
}

typedef struct {
    hg_detector self;
    storage     storage;
    hg_finding  finding;
} rig;

static void begin(rig *r, const hg_detector_config *config)
{
    (void)memset(r, 0x5A, sizeof(*r));
    const hg_detector_memory memory = memory_of(&r->storage, config);
    assert_count(config->reals, hg_detector_reals(config));
    assert_count(config->sums, hg_detector_sums(config));
    assert_status(HG_OK, hg_detector_start(&r->self, config, &memory, HG_START_REST));
}

static void check_canaries(const rig *r)
{
    assert_codes_untouched(&r->storage.code[SM_CODES], 1U);
    assert_untouched(&r->storage.real[r->self.config->reals], 1U);
    assert_untouched(&r->storage.sum[r->self.config->sums], 1U);
}

static hg_plant step(rig *r)
{
    (void)memset(&r->finding, 0x5A, sizeof(r->finding));
    assert_status(HG_OK, hg_detector_step(&r->self, &r->finding));
    assert_int_equal(HG_BASIS_SET, r->finding.basis);
    check_canaries(r);
    return r->finding.plant;
}

static void give(rig *r, uint8_t group, int32_t a, int32_t b, bool continues)
{
    const int32_t code[2] = {a, b};
    assert_status(HG_OK, hg_detector_receive(&r->self, group, code, continues));
}

static hg_plant sample(rig *r, int32_t s0, int32_t s1, int32_t u)
{
    give(r, 0U, s0, s1, true);
    give(r, 1U, u, 0, true);
    return step(r);
}

static hg_plant silent(rig *r, int32_t u)
{
    give(r, 1U, u, 0, true);
    return step(r);
}

/* A plant at rest for so long that all parts are ready. */
static void settle(rig *r)
{
    for (uint32_t k = 0U; k <= SETTLE; k++) {
        (void)sample(r, 0, 0, 0);
    }
    assert_int_equal(HG_PLANT_NONE, r->finding.plant);
}

static hg_real past(const rig *r, uint8_t lag, uint8_t place)
{
    return hg_ring_row(&r->self.radii, lag)[place];
}

/* What has grown later is a little more than what it would have been from the start, and never less. */
static void assert_grown(double expected, hg_real actual)
{
    assert_true((double)actual >= expected);
    assert_near(expected, actual, 1e-6);
}

/* ---- start ---- */

static void refuse(const hg_detector_config *config, hg_status expected, int line)
{
    static storage s;
    hg_detector self;
    hg_detector_memory memory = memory_of(&s, &usual);
    const hg_status status = hg_detector_start(&self, config, &memory, HG_START_REST);
    if (status != expected) {
        print_error("case of line %d: %d\n", line, (int)status);
    }
    assert_status(expected, status);
    assert_untouched(&s.real[REALS], 1U);
    assert_untouched(&s.sum[SUMS], 1U);
}
#define assert_refused(config) refuse((config), HG_E_CONFIG, __LINE__)

static void missing_memory_is_refused(void **state)
{
    (void)state;
    static storage s;
    hg_detector self;
    hg_detector_memory m[5];
    for (size_t i = 0U; i < COUNT(m); i++) {
        m[i] = memory_of(&s, &usual);
    }
    m[0].predict = NULL;
    m[1].residual = NULL;
    m[2].hull = NULL;
    m[3].bank = NULL;
    m[4].sum = NULL;
    for (size_t i = 0U; i < COUNT(m); i++) {
        assert_status(HG_E_ARGUMENT, hg_detector_start(&self, &usual, &m[i], HG_START_REST));
    }
    assert_untouched(s.real, COUNT(s.real));
    assert_untouched(s.sum, COUNT(s.sum));
}

static void memory_one_too_short_is_refused(void **state)
{
    (void)state;
    static storage s;
    hg_detector self;
    hg_detector_memory memory = memory_of(&s, &usual);
    memory.reals = REALS - 1U;
    assert_status(HG_E_SIZE, hg_detector_start(&self, &usual, &memory, HG_START_REST));
    memory = memory_of(&s, &usual);
    memory.sums = SUMS - 1U;
    assert_status(HG_E_SIZE, hg_detector_start(&self, &usual, &memory, HG_START_REST));
    assert_untouched(s.real, COUNT(s.real));
    assert_untouched(s.sum, COUNT(s.sum));
    memory.sums = SUMS;
    assert_status(HG_OK, hg_detector_start(&self, &usual, &memory, HG_START_REST));
}

static void sizes_that_contradict_one_another_are_refused(void **state)
{
    (void)state;
    hg_detector_config c[12];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = usual;
    }
    c[0].width = SM_SIGNALS - 1U;
    c[1].width = WIDTH - 1U;
    c[2].predictors = (uint8_t)(HG_GROUPS_MAX + 1U);
    c[3].predict = NULL;
    c[4].bank = NULL;
    c[5].window = 0U;
    c[6].banks = 0U;       /* the decision counts three */
    c[7].decision.generators = 2U;
    c[8].generators = (uint8_t)HG_GENERATORS_MAX;
    c[8].decision.generators = (uint8_t)(HG_GENERATORS_MAX + 1U);
    c[9].residuals = 2U;   /* one for each bank */
    c[10].history = WINDOW;
    c[11].mismatch = NULL; /* a place without a signal */
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_refused(&c[i]);
    }
    hg_detector_config none = alone;
    none.banks = 0U;
    none.decision.generators = 0U;
    assert_refused(&none);
    none = alone;
    none.generators = 1U;
    none.decision.generators = 2U;
    assert_refused(&none); /* a generator without tables */
    none.residual = residual;
    assert_refused(&none);
}

static void a_vector_wider_than_its_signals_is_refused(void **state)
{
    (void)state;
    static storage s;
    static hg_real real[REALS + 100U];
    hg_detector self;
    hg_detector_config c = usual;
    hg_detector_memory memory = memory_of(&s, &usual);
    c.width = WIDTH + 1U;
    memory.real = real;
    memory.reals = COUNT(real);
    assert_status(HG_E_CONFIG, hg_detector_start(&self, &c, &memory, HG_START_REST));
}

static void contradicting_predictors_are_refused(void **state)
{
    (void)state;
    hg_predict_config p[1] = {predict[0]};
    hg_detector_config c = usual;
    c.predict = p;
    p[0].group = SM_GROUPS;
    assert_refused(&c);
    p[0] = predict[0];
    p[0].horizon = 0U;
    assert_refused(&c);
    const uint8_t derived[] = {3U}; /* an input must be sent */
    p[0] = predict[0];
    p[0].input = derived;
    assert_refused(&c);
    p[0] = predict[0];
    p[0].correct.exponent = 1; /* float tables are not scaled */
    assert_refused(&c);
    p[0] = predict[0];
    p[0].first = 1U; /* not where group 0 begins */
    assert_refused(&c);
    p[0] = predict[0];
    p[0].group = 1U; /* begins at 2 */
    assert_refused(&c);
    const hg_predict_config narrow = {.group = 1U, .first = 2U, .order = 1U, .width = 1U, .inputs = 1U, .input = input_place, .known = known,
        .correct = {1U, 1U, 0, unit}, .state = {1U, 1U, 0, unit}, .drive = {1U, 1U, 0, drive}, .output = {1U, 1U, 0, unit},
        .direct = {1U, 1U, 0, zeros}, .fresh = sm_half, .horizon = 6U, .radius = predict_radius, .settle = SETTLE};
    p[0] = narrow;
    p[0].group = 0U;
    p[0].first = 0U; /* group 0 has two signals */
    assert_refused(&c);
    p[0] = narrow;
    assert_refused(&c); /* right in itself, but one place is left over */
}

static void a_contradicting_mismatch_is_refused(void **state)
{
    (void)state;
    const uint8_t derived[] = {2U, 3U};
    hg_mismatch_config m = mismatch;
    hg_detector_config c = usual;
    c.mismatch = &m;
    m.constant = NULL;
    assert_refused(&c);
    m = mismatch;
    m.signal = derived;
    assert_refused(&c);
    m = mismatch;
    m.exponent = 1; /* float tables are not scaled */
    assert_refused(&c);
    m = mismatch;
    m.states = 0U; /* one place is left over */
    assert_refused(&c);
}

static void contradicting_banks_are_refused(void **state)
{
    (void)state;
    const uint8_t derived[] = {0U, 3U};
    const uint8_t outside[] = {WIDTH};
    hg_bank_config b[1] = {bank[0]};
    hg_detector_config c = usual;
    c.bank = b;
    b[0].widen = R(0.5);
    assert_refused(&c);
    b[0] = bank[0];
    b[0].signal = derived; /* has no value that is kept */
    assert_refused(&c);
    b[0] = bank[0];
    b[0].exponent = -1;
    assert_refused(&c);
    b[0] = bank[0];
    b[0].extra = outside;
    assert_refused(&c);
    b[0] = bank[0];
    b[0].window = WINDOW + 1U; /* longer than the ring of values */
    assert_refused(&c);
    hg_detector_config d = alone;
    d.history = WINDOW - 1U;
    assert_refused(&d);
    hg_residual_config empty[2] = {residual[0], residual[1]};
    empty[0].state.rows = 2U;
    c = usual;
    c.residual = empty;
    assert_refused(&c);
}

/* ---- samples by hand ---- */

static double mismatch_of(double u, double ru, double s1, double r1)
{
    return 0.0078125 + (0.0625 * (fabs(u) + ru)) + (0.001953125 * (fabs(s1) + r1));
}

static void samples_compute_by_hand(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    assert_int_equal(HG_PLANT_STARTING, sample(&r, 64, 128, 32)); /* the bank's window is not full */
    assert_real(1.0, r.self.value[3]);
    assert_real(2.0, r.self.value[4]);
    assert_real(0.0, r.self.value[5]);
    assert_real(SM_HALF, r.self.radius[3]);
    assert_real(mismatch_of(0.5, SM_HALF, 2.0, SM_HALF), r.self.radius[5]);
    assert_real(0.0, r.self.r[2]);
    assert_real(TINY, r.self.J[2]);
    assert_int_equal(HG_PLANT_STARTING, sample(&r, 72, 128, 32));
    assert_real(0.0, r.self.r[0]); /* 1/8 is what u / 4 explains */
    assert_real(TINY + (2.25 * SM_HALF) + mismatch_of(0.5, SM_HALF, 2.0, SM_HALF), r.self.J[0]);
    assert_int_equal(HG_PLANT_NONE, sample(&r, 80, 128, 32));
    assert_real(0.0, r.self.r[2]);
    assert_real(0.0, r.self.value[5]);
    assert_int_equal(HG_PLANT_NONE, sample(&r, 87, 128, 32)); /* one code too low: 1/64 */
    assert_real(-0.015625, r.self.r[2]);
    assert_int_equal(1, r.storage.bank[0].closest);
    assert_real(TINY + (2.25 * SM_HALF) + mismatch_of(0.5, SM_HALF, 2.0, SM_HALF), r.self.J[2]);
    assert_real(TINY + (2.5 * SM_HALF) + (2.0 * mismatch_of(0.5, SM_HALF, 2.0, SM_HALF)), R(TINY) + r.storage.sum[2]);
}

/* After settle(): one sample within the silent phase and one that relies on silence, with u = 1/2 from the first of them on. */
static void two_silent(rig *r)
{
    settle(r);
    assert_int_equal(HG_PLANT_NONE, silent(r, 32));
    assert_real(0.0, r->self.value[3]);
    assert_real(PREDICTED(1), r->self.radius[3]);
    assert_real(SLEW(1), r->self.radius[0]);
    assert_real(SLEW(1), r->self.radius[4]); /* no better than the held one */
    assert_int_equal(HG_PLANT_NONE, silent(r, 32));
    assert_real(0.125, r->self.value[3]);
    assert_real(0.0, r->self.value[0]);
    assert_real(PREDICTED(2), r->self.radius[3]);
    assert_real(HELD, r->self.radius[0]);
    assert_real(HELD, r->self.radius[4]);
    assert_real(mismatch_of(0.5, SM_HALF, 0.0, HELD), r->self.radius[5]);
}

static void silence_is_predicted(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    two_silent(&r);
    assert_real(0.0, r.self.r[0]);
    assert_real(TINY + PREDICTED(2) + PREDICTED(1) + (0.25 * SM_HALF) + mismatch_of(0.5, SM_HALF, 0.0, SLEW(1)), r.self.J[0]);
    assert_real(-0.125, r.self.r[2]); /* banks read what was held */
    assert_real(TINY + HELD + SM_HALF + (0.5 * SM_HALF) + mismatch_of(0.5, SM_HALF, 0.0, SLEW(1)) + mismatch_of(0.0, SM_HALF, 0.0, SM_HALF),
                r.self.J[2]);
    assert_int_equal(0, r.storage.bank[0].closest);
}

static void a_rewind_widens_what_was_derived(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    two_silent(&r);
    give(&r, 0U, 16, 0, false);
    give(&r, 1U, 32, 0, true);
    assert_int_equal(HG_PLANT_NONE, step(&r));
    assert_real(SM_HALF, past(&r, 0U, 0U));
    assert_real(SM_HALF, past(&r, 0U, 3U));
    for (uint8_t lag = 1U; lag <= 2U; lag++) {
        const double wide = SLEW(3 - (int)lag);
        for (uint8_t g = 0U; g < 2U; g++) {
            assert_real(wide, past(&r, lag, g));
            assert_real(wide, past(&r, lag, (uint8_t)(3U + g))); /* whichever it was, this is true */
        }
        assert_real(SM_HALF, past(&r, lag, 2U));
        assert_grown(mismatch_of(0.5, SM_HALF, 0.0, wide), past(&r, lag, 5U));
    }
    for (uint8_t g = 0U; g < 5U; g++) {
        assert_real(SM_HALF, past(&r, 3U, g)); /* the last good frame */
    }
    assert_grown(TINY + SM_HALF + SLEW(2) + (0.25 * SM_HALF) + mismatch_of(0.5, SM_HALF, 0.0, SLEW(2)), r.self.J[0]);
    /* the prediction relied on nothing that was lost */
    assert_int_equal(HG_PLANT_NONE, silent(&r, 32));
    assert_real(0.25 + 0.125, r.self.value[3]);
    assert_real(PREDICTED(1), r.self.radius[3]);
}

static void a_prediction_that_is_wider_than_what_was_lost_stays(void **state)
{
    (void)state;
    hg_real generous[12];
    (void)memcpy(generous, predict_radius, sizeof(generous));
    hg_predict_config p[1] = {predict[0]};
    hg_detector_config c = usual;
    c.predict = p;
    p[0].radius = generous;
    rig r;
    begin(&r, &c);
    two_silent(&r);
    hg_ring_row(&r.self.radii, 0U)[3] = R(7); /* as if the prediction had been that wide */
    hg_ring_row(&r.self.radii, 0U)[4] = R(9);
    give(&r, 0U, 16, 0, false);
    (void)silent(&r, 32);
    assert_real(7.0, past(&r, 1U, 3U));
    assert_real(9.0, past(&r, 1U, 4U));
    assert_real(SLEW(1), past(&r, 2U, 4U));
}

/* Group 1 is behind group 0 in the vector, and has no predictor. */
static void a_rewind_of_another_group_grows_the_mismatch_alone(void **state)
{
    (void)state;
    hg_trigger_config slow = sm_trigger_b;
    slow.interval_max = 4U;
    const int32_t sigma[] = {2, 0};
    slow.sigma = sigma;
    hg_hold_config hold[SM_GROUPS] = {sm_hold[0], sm_hold[1]};
    hold[1].trigger = &slow;
    hold[1].margin = 0U;
    hg_detector_config c = usual;
    c.hold = hold;
    rig r;
    begin(&r, &c);
    settle(&r);
    give(&r, 0U, 0, 0, true);
    (void)step(&r);
    const double promised = 0.03125 + SM_HALF;
    assert_real(promised, r.self.radius[2]);
    const double before = mismatch_of(0.0, promised, 0.0, SM_HALF);
    assert_real(before, r.self.radius[5]);
    give(&r, 0U, 0, 0, true);
    give(&r, 1U, 0, 0, false);
    (void)step(&r);
    assert_real(SLEW(1), past(&r, 1U, 2U));
    assert_grown(before + (0.0625 * (SLEW(1) - promised)), past(&r, 1U, 5U));
    for (uint8_t g = 0U; g < 2U; g++) {
        assert_real(SM_HALF, past(&r, 1U, g));
        assert_real(SM_HALF, past(&r, 1U, (uint8_t)(3U + g)));
    }
}

static void a_missing_input_ends_the_prediction(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    settle(&r);
    (void)step(&r); /* neither frame: u moves on by its slew */
    assert_real(SLEW(1), r.self.radius[2]);
    assert_real(SLEW(1), r.self.radius[3]);
    (void)silent(&r, 0);
    assert_real(HELD, r.self.radius[3]);
    for (uint32_t k = 0U; k <= SETTLE; k++) {
        (void)sample(&r, 0, 0, 0);
        assert_real(SM_HALF, r.self.radius[3]);
    }
    (void)silent(&r, 0);
    assert_real(PREDICTED(1), r.self.radius[3]);
}

/* An input whose sender promises to be silent only while its code does not change: as good as fresh, unless a frame was lost. */
static void an_input_that_relies_on_silence_ends_the_prediction(void **state)
{
    (void)state;
    hg_trigger_config slow = sm_trigger_b;
    slow.interval_max = 4U;
    hg_hold_config hold[SM_GROUPS] = {sm_hold[0], sm_hold[1]};
    hold[1].trigger = &slow;
    hold[1].margin = 0U;
    hg_detector_config c = usual;
    c.hold = hold;
    rig r;
    begin(&r, &c);
    settle(&r);
    (void)silent(&r, 0);
    assert_real(PREDICTED(1), r.self.radius[3]);
    (void)step(&r);
    assert_real(SM_HALF, r.self.radius[2]);
    assert_true(hg_hold_doubt(&r.storage.hold[1]));
    assert_real(HELD, r.self.radius[3]);
    give(&r, 0U, 0, 0, true);
    give(&r, 1U, 32, 0, false); /* u was 1/2 already */
    (void)step(&r);
    (void)silent(&r, 32);
    assert_real(SLEW(1), r.self.radius[3]);
    /* One that any radius will do for is not asked. */
    const hg_real any[] = {R(SM_SPAN)};
    hg_predict_config p[1] = {predict[0]};
    p[0].known = any;
    c.predict = p;
    begin(&r, &c);
    settle(&r);
    (void)silent(&r, 0);
    (void)step(&r);
    assert_true(hg_hold_doubt(&r.storage.hold[1]));
    assert_real(PREDICTED(2), r.self.radius[3]);
}

/* Inputs of both groups, the first of them known also while it is silent, as long as nothing can have been lost. */
static void any_input_that_relies_on_silence_ends_the_prediction(void **state)
{
    (void)state;
    const uint8_t places[] = {1U, 2U};
    const hg_real widely[] = {R(HELD), R(SM_HALF)};
    const hg_real drive_2[] = {R(0), R(0.25), R(0), R(0)};
    hg_predict_config p[1] = {predict[0]};
    p[0].inputs = 2U;
    p[0].input = places;
    p[0].known = widely;
    p[0].drive = (hg_matrix){2U, 2U, 0, drive_2};
    p[0].direct = (hg_matrix){2U, 2U, 0, zeros};
    hg_detector_config c = usual;
    c.predict = p;
    c.reals = REALS + 1U;
    rig r;
    begin(&r, &c);
    settle(&r);
    (void)silent(&r, 0);
    assert_real(PREDICTED(1), r.self.radius[3]);
    (void)silent(&r, 0);
    assert_real(HELD, r.self.radius[1]); /* no wider than before, but now it relies on silence */
    assert_real(HELD, r.self.radius[3]);
}

static void a_code_marked_invalid_is_not_predicted(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    settle(&r);
    (void)sample(&r, 0, HG_CODE_INVALID, 0);
    assert_real(SM_SPAN, r.self.radius[1]);
    assert_real(SM_SPAN, r.self.radius[4]);
    assert_real(mismatch_of(0.0, SM_HALF, 0.0, SM_SPAN), r.self.radius[5]);
    (void)silent(&r, 0);
    assert_real(ACTIVE, r.self.radius[3]);
}

static void a_stale_group_ends_the_prediction(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    settle(&r);
    for (int j = 1; j <= 6; j++) {
        (void)silent(&r, 0);
        assert_real(fmin((j == 1) || (j > 3) ? SLEW(j) : HELD, PREDICTED(j)), r.self.radius[3]); /* lost after interval_max */
    }
    (void)silent(&r, 0);
    assert_real(SM_SPAN, r.self.radius[3]);
}

/* ---- restart and refusals ---- */

static void restart_empties_windows_and_ends_predictions(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    two_silent(&r);
    hg_detector_restart(&r.self, HG_START_MOVING);
    for (uint8_t g = 0U; g < WIDTH; g++) {
        for (uint8_t lag = 0U; lag < HISTORY; lag++) {
            assert_real(0.0, past(&r, lag, g));
        }
    }
    assert_false(hg_bank_ready(&r.storage.bank[0]));
    assert_int_equal(HG_PLANT_STARTING, sample(&r, 640, 0, 0)); /* a jump in between is not the windows' business */
    assert_int_equal(HG_PLANT_STARTING, silent(&r, 0));
    assert_real(ACTIVE, r.self.radius[0]); /* what the holds know stays */
    assert_real(ACTIVE, r.self.radius[3]);
    assert_false(hg_bank_ready(&r.storage.bank[0]));
    assert_int_equal(HG_PLANT_NONE, sample(&r, 640, 0, 0));
    assert_true(hg_bank_ready(&r.storage.bank[0]));
    assert_real(0.0, r.self.r[2]);
}

static const hg_real bad_middle[] = {REAL_NAN, R(0)};

/* Only corrupted tables bring a number that is not finite as far as this. */
static void a_number_that_is_not_finite_empties_the_windows(void **state)
{
    (void)state;
    const hg_detector_config *configs[] = {&usual, &alone};
    for (size_t i = 0U; i < COUNT(configs); i++) {
        hg_hold_config hold[SM_GROUPS] = {sm_hold[0], sm_hold[1]};
        hold[0].middle = bad_middle;
        hg_detector_config c = *configs[i];
        c.hold = hold;
        rig r;
        begin(&r, &c);
        for (int k = 0; k < 10; k++) {
            (void)sample(&r, 0, 0, 0);
        }
        assert_int_equal(HG_PLANT_NONE, r.finding.plant);
        const uint16_t last = (uint16_t)(c.residuals - 1U);
        for (uint32_t j = 1U; j <= 2U; j++) {
            give(&r, 0U, HG_CODE_INVALID, 0, true);
            give(&r, 1U, 0, 0, true);
            const uint32_t before = r.self.refusals;
            assert_status(HG_E_NUMERIC, hg_detector_step(&r.self, &r.finding));
            check_canaries(&r);
            assert_count(before + ((i == 0U) ? 2U : 1U), r.self.refusals); /* generator 0 and the bank, or the bank alone */
            assert_real(0.0, r.self.r[last]);
            assert_real(TINY, r.self.J[last]);
            assert_int_equal(HG_PLANT_STARTING, r.finding.plant);
            assert_int_equal(0, r.storage.bank[0].k);
            assert_true(hg_linalg_finite(r.self.radii.data, (uint16_t)(c.width * c.history)));
            assert_true(hg_linalg_finite(r.self.values.data, SM_SIGNALS * WINDOW));
        }
        /* All jumps while the value was missing: a window that still held an older sample would see it. */
        for (uint32_t k = 1U; k <= (WINDOW + 2U); k++) {
            assert_int_equal((k < WINDOW) ? HG_PLANT_STARTING : HG_PLANT_NONE, sample(&r, 640, 0, 0));
            assert_int_equal(k >= WINDOW, hg_bank_ready(&r.storage.bank[0]));
        }
        r.self.refusals = UINT32_MAX;
        give(&r, 0U, HG_CODE_INVALID, 0, true);
        assert_status(HG_E_NUMERIC, hg_detector_step(&r.self, &r.finding));
        assert_true(r.self.refusals == UINT32_MAX);
    }
}

static void a_value_that_the_mismatch_cannot_bound_spoils_no_other_radius(void **state)
{
    (void)state;
    const hg_real nan_middle[] = {R(0), REAL_NAN};
    hg_hold_config hold[SM_GROUPS] = {sm_hold[0], sm_hold[1]};
    hold[0].middle = nan_middle;
    hg_detector_config c = usual;
    c.hold = hold;
    rig r;
    begin(&r, &c);
    for (int k = 0; k < 10; k++) {
        (void)sample(&r, 0, 0, 0);
    }
    give(&r, 0U, 0, HG_CODE_INVALID, true);
    give(&r, 1U, 0, 0, true);
    assert_status(HG_E_NUMERIC, hg_detector_step(&r.self, &r.finding));
    assert_real(HG_REAL_MAX, past(&r, 0U, 5U));
    assert_real(SM_HALF, past(&r, 0U, 0U));
    assert_real(SM_SPAN, past(&r, 0U, 1U));
    (void)sample(&r, 0, 0, 0);
    assert_real(HG_REAL_MAX, past(&r, 1U, 5U)); /* the sample is there, and where it belongs */
    assert_real(SM_SPAN, past(&r, 1U, 1U));
}

static void the_largest_number_is_a_radius_and_none_that_is_not_finite(void **state)
{
    (void)state;
    hg_real span[] = {R(0), R(SM_SPAN)};
    hg_hold_config hold[SM_GROUPS] = {sm_hold[0], sm_hold[1]};
    hold[0].span = span;
    hg_detector_config c = usual;
    c.hold = hold;
    rig r;
    const hg_real bad[] = {REAL_NAN, REAL_INF, R(-1)};
    for (size_t i = 0U; i < COUNT(bad); i++) {
        span[0] = bad[i];
        const hg_detector_memory memory = memory_of(&r.storage, &c);
        assert_status(HG_E_CONFIG, hg_detector_start(&r.self, &c, &memory, HG_START_REST));
    }
    span[0] = HG_REAL_MAX;
    begin(&r, &c);
    for (int k = 0; k < 4; k++) {
        (void)sample(&r, 0, 0, 0);
    }
    give(&r, 0U, HG_CODE_INVALID, 0, true);
    give(&r, 1U, 0, 0, true);
    assert_int_equal(HG_PLANT_NONE, step(&r));
    assert_real(HG_REAL_MAX, past(&r, 0U, 0U));
    assert_real(HG_REAL_MAX, past(&r, 0U, 3U));
    assert_real(SM_HALF, past(&r, 0U, 1U));
    (void)sample(&r, 0, 0, 0);
    assert_real(HG_REAL_MAX, past(&r, 1U, 0U)); /* the sample is there, and where it belongs */
    assert_real(SM_HALF, past(&r, 1U, 1U));
}

/* ---- alarms ---- */

static void a_lost_frame_takes_a_banks_alarm_back(void **state)
{
    (void)state;
    for (int lost = 0; lost < 2; lost++) {
        rig r;
        begin(&r, &alone);
        for (uint32_t k = 0U; k < WINDOW; k++) {
            (void)sample(&r, 0, 0, 0);
        }
        assert_int_equal(HG_PLANT_NONE, sample(&r, 0, 0, 64)); /* u = 1 drives s0 by 1/4 a sample */
        assert_int_equal(HG_PLANT_NONE, silent(&r, 64));
        assert_int_equal(HG_PLANT_PROVISIONAL, silent(&r, 64)); /* silence says that s0 has moved by less than 1/2 */
        assert_int_equal(0x9, r.finding.candidates);
        assert_real(-0.5, r.self.r[0]);
        give(&r, 0U, 48, 0, lost == 0);
        give(&r, 1U, 64, 0, true);
        assert_int_equal((lost == 0) ? HG_PLANT_CONFIRMED : HG_PLANT_NONE, step(&r));
        assert_int_equal((lost == 0) ? 0x9 : 0, r.finding.candidates);
    }
}

static void candidates_are_narrowed_by_the_bank_for_the_episode(void **state)
{
    (void)state;
    hg_detector_config c = usual;
    c.decision.down = 1U;
    rig r;
    begin(&r, &c);
    settle(&r);
    assert_int_equal(HG_PLANT_CONFIRMED, sample(&r, 640, 0, 0)); /* s0 jumps: generator 0 and the bank */
    assert_int_equal(0x1, r.finding.candidates);
    assert_int_equal(HG_PLANT_CONFIRMED, sample(&r, 640, 0, 0)); /* still in the bank's window: it alone */
    assert_int_equal(HG_PLANT_NONE, (int)r.storage.alarm[0].state);
    assert_int_equal(0x1, r.finding.candidates);
    assert_int_equal(HG_PLANT_NONE, sample(&r, 640, 0, 0));
    assert_int_equal(0, r.finding.candidates);
}

static void a_rewind_longer_than_the_ring_ends_with_it(void **state)
{
    (void)state;
    rig r;
    begin(&r, &alone);
    for (uint32_t k = 0U; k < WINDOW; k++) {
        (void)sample(&r, 0, 0, 0);
    }
    (void)silent(&r, 0);
    (void)silent(&r, 0);
    (void)silent(&r, 0);
    assert_int_equal(HG_PLANT_NONE, silent(&r, 0)); /* nothing for interval_max: lost, 3 samples back, in a ring of 3 rows */
    assert_real(SLEW(4), past(&r, 0U, 0U));
    assert_real(SLEW(3), past(&r, 1U, 0U));
    assert_real(SLEW(2), past(&r, 2U, 0U));
    assert_real(mismatch_of(0.0, SM_HALF, 0.0, SLEW(4)), past(&r, 0U, 3U)); /* not taken for the row behind the oldest */
    assert_grown(mismatch_of(0.0, SM_HALF, 0.0, SLEW(2)), past(&r, 2U, 3U));
}

/* ---- the claim ---- */

/* The plant of the header within its bounds, mostly at their ends. */
typedef struct {
    double x;
    double s1;
    double u;
    double goal; /* of u */
    double push[3];
} plant;

static void plant_move(plant *p, uint32_t *random)
{
    const double w = (p->push[0] / 128.0) + (p->push[1] * fabs(p->u) / 16.0) + (p->push[2] * fabs(p->s1) / 512.0);
    p->x += (0.25 * p->u) + w;
    for (size_t i = 0U; i < 3U; i++) {
        if ((draw(random) % 10U) == 0U) {
            p->push[i] = (double)draw_between(random, -1, 1);
        }
    }
    const double move = (double)draw_between(random, -16, 16) / 64.0;
    p->s1 += (fabs(p->s1 + move) <= 7.0) ? move : 0.0;
    if ((draw(random) % 12U) == 0U) {
        p->goal = (double)draw_between(random, -29, 29) / 64.0;
    }
    if (fabs(p->x) > 30.0) {
        p->goal = (p->x > 0.0) ? -0.25 : 0.25;
    }
    p->u += fmax(-0.25, fmin(0.25, p->goal - p->u));
}

typedef struct {
    hg_trigger trigger;
    int32_t    codes[2];
    uint8_t    group;
    uint32_t   counter;
    uint32_t   last;
} sender;

static void send(rig *r, sender *s, const int32_t *code, int32_t loss, uint32_t *random)
{
    if (hg_trigger_step(&s->trigger, code) == HG_OK) {
        s->counter++;
        if (draw_between(random, 0, 99) >= loss) {
            give(r, s->group, code[0], code[1], (s->counter - s->last) == 1U);
            s->last = s->counter;
        } else if ((draw(random) % 3U) == 0U) {
            assert_status(HG_OK, hg_detector_lose(&r->self, s->group));
        } else {
            /* nobody knows yet */
        }
    }
}

/* What a run saw. */
typedef struct {
    unsigned provisional;
    unsigned predicted;
    int      confirmed_at;
} seen;

static void run_plant(const hg_detector_config *config, int32_t loss, uint32_t *random, seen *all)
{
    rig r;
    plant p = {.x = 3.0, .s1 = -2.0};
    sender outputs = {.group = 0U};
    sender input = {.group = 1U};
    begin(&r, config);
    assert_status(HG_OK, hg_trigger_start(&outputs.trigger, config->hold[0].trigger, outputs.codes));
    assert_status(HG_OK, hg_trigger_start(&input.trigger, config->hold[1].trigger, input.codes));
    all->confirmed_at = -1;
    for (int k = 0; k < 1000; k++) {
        const bool fault = k >= 900;
        const double wrong = (fault && (((k / 5) % 2) == 0)) ? 4.0 : 0.0;
        const int32_t a[2] = {hg_code_encode(&sm_scale[0], R(p.x + wrong)), hg_code_encode(&sm_scale[1], R(p.s1))};
        const int32_t b[2] = {hg_code_encode(&sm_scale[0], R(p.u)), 0};
        send(&r, &outputs, a, loss, random);
        send(&r, &input, b, loss / 3, random);
        const hg_plant found = step(&r);
        if (!fault && (found == HG_PLANT_CONFIRMED)) {
            print_error("sample %d: confirmed without a fault\n", k);
            fail();
        }
        all->provisional += ((!fault) && (found == HG_PLANT_PROVISIONAL)) ? 1U : 0U;
        if ((!fault) && (config->predictors > 0U) && (r.self.radius[3] < r.self.radius[0])) {
            all->predicted++; /* true whatever was lost */
            assert_true(fabs(p.x - (double)r.self.value[3]) <= (double)r.self.radius[3]);
        }
        if (fault && (found == HG_PLANT_CONFIRMED) && (all->confirmed_at < 0)) {
            all->confirmed_at = k;
            assert_true((r.finding.candidates & 1U) != 0U);
        }
        plant_move(&p, random);
    }
}

/* The claim of the library: within the bounds no alarm is ever confirmed, whatever the link loses; and a fault is. */
static void no_false_alarm_is_confirmed_whatever_is_lost(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(52U);
    hg_trigger_config slow = sm_trigger_b; /* an input that is sent when its code changes, or every fourth sample */
    slow.interval_max = 4U;
    hg_hold_config hold[SM_GROUPS] = {sm_hold[0], sm_hold[1]};
    hold[1].trigger = &slow;
    hold[1].margin = 0U;
    hg_predict_config at_once[1] = {predict[0]};
    at_once[0].settle = 0U; /* a frame tells all of x here, and inputs are seldom known for long */
    hg_detector_config by_events = usual;
    by_events.hold = hold;
    by_events.predict = at_once;
    const hg_detector_config *configs[] = {&usual, &by_events, &alone};
    for (size_t i = 0U; i < COUNT(configs); i++) {
        seen all = {.provisional = 0U, .predicted = 0U, .confirmed_at = -1};
        for (int run = 0; run < 40; run++) {
            run_plant(configs[i], (run % 4) * 12, &random, &all);
            assert_true(all.confirmed_at >= 900);
            assert_true(all.confirmed_at < 960);
        }
        print_message("%u provisional alarms, %u predictions\n", all.provisional, all.predicted);
        assert_true(all.provisional > 0U); /* losses did raise alarms that had to be taken back */
        assert_int_equal(configs[i]->predictors > 0U, all.predicted > 500U);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(missing_memory_is_refused),
        cmocka_unit_test(memory_one_too_short_is_refused),
        cmocka_unit_test(sizes_that_contradict_one_another_are_refused),
        cmocka_unit_test(a_vector_wider_than_its_signals_is_refused),
        cmocka_unit_test(contradicting_predictors_are_refused),
        cmocka_unit_test(a_contradicting_mismatch_is_refused),
        cmocka_unit_test(contradicting_banks_are_refused),
        cmocka_unit_test(samples_compute_by_hand),
        cmocka_unit_test(silence_is_predicted),
        cmocka_unit_test(a_rewind_widens_what_was_derived),
        cmocka_unit_test(a_prediction_that_is_wider_than_what_was_lost_stays),
        cmocka_unit_test(a_rewind_of_another_group_grows_the_mismatch_alone),
        cmocka_unit_test(a_missing_input_ends_the_prediction),
        cmocka_unit_test(an_input_that_relies_on_silence_ends_the_prediction),
        cmocka_unit_test(any_input_that_relies_on_silence_ends_the_prediction),
        cmocka_unit_test(a_code_marked_invalid_is_not_predicted),
        cmocka_unit_test(a_stale_group_ends_the_prediction),
        cmocka_unit_test(restart_empties_windows_and_ends_predictions),
        cmocka_unit_test(a_number_that_is_not_finite_empties_the_windows),
        cmocka_unit_test(a_value_that_the_mismatch_cannot_bound_spoils_no_other_radius),
        cmocka_unit_test(the_largest_number_is_a_radius_and_none_that_is_not_finite),
        cmocka_unit_test(a_lost_frame_takes_a_banks_alarm_back),
        cmocka_unit_test(candidates_are_narrowed_by_the_bank_for_the_episode),
        cmocka_unit_test(a_rewind_longer_than_the_ring_ends_with_it),
        cmocka_unit_test(no_false_alarm_is_confirmed_whatever_is_lost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
