/** @file
 *  detector.h with more than one of everything: three groups, two predictors, generators, banks and filters, and an uncertain plant. Each part has memory of its
 *  own, computes what it computes alone, and raises its own alarm. Signals s0 and s1, s2, s3 are sent by groups 0, 1, 2; places 4 and 5 are the predicted s0 and
 *  s1, 6 the predicted s3, 7 what the plant is uncertain by. s0, s1, s2 and their generators are those of test_detector_derived.c.
 *      bank 0: as there, reads s0 and s2        bank 1: s3 itself        filter 0: small_filter.h, reads s1 and s2        filter 1: reads s0 and s3 */
#include "support.h"

#include "hullguard/detector.h"

#include "small_filter.h"
#include "small_model.h"

#define SIGNALS 4U
#define GROUPS 3U
#define WIDTH 8U
#define JUDGED 6U
#define RESIDUALS (2U + 2U + (2U * HG_STATISTICS))
#define HISTORY 6U
#define TAPS 5U
#define WINDOW 3U
#define SETTLE 6U
#define REALS_MAX 1000U
#define SUMS 6U
#define TINY 0.000244140625
#define AT 64 /* code of 1, at which the input of filter 0 does nothing */
#define SLEW_C(j) ((0.5 * (j)) + SM_HALF)
#define PROMISE_C (0.03125 + SM_HALF)  /* group 2 while it is silent */
#define PROMISE_A (0.25 + SM_HALF)     /* group 0 while it is silent, at level 0 */
#define DRIFT 0.0625
#define PREDICTED(j) (SM_HALF + (DRIFT * (j)))        /* s0 */
#define PREDICTED_C(j) (SM_HALF + (0.001953125 * (j))) /* s3 */
#define SPAN_C 50.0

/* ---- tables ---- */

static const uint8_t silence_c[] = {0U};
static const int32_t sigma_c[] = {2};
static const hg_trigger_config trigger_c = {.width = 1U, .levels = 1U, .interval_max = 4U, .silence = silence_c, .delta = sm_delta, .sigma = sigma_c,
                                            .activity = sm_zero, .zero = sm_zero};
static const hg_real slew_c[] = {R(SLEW_C(1)), R(SLEW_C(2)), R(SLEW_C(3)), R(SLEW_C(4)), R(SLEW_C(5)), R(SLEW_C(6))};
static const hg_real span[16] = {R(94), R(94), R(94), R(SPAN_C), R(94), R(94), R(94), R(94), R(94), R(94), R(94), R(94),
                                 R(94), R(94), R(94), R(94)}; /* of all signals, one after another, and more behind them */
static const hg_hold_config hold[GROUPS] = {
    {.trigger = &sm_trigger_a, .margin = 2U, .scale = sm_scale, .half = sm_half, .slew = sm_slew_a, .span = &span[0], .middle = sm_middle},
    {.trigger = &sm_trigger_b, .margin = 3U, .scale = sm_scale, .half = sm_half, .slew = sm_slew_b, .span = &span[2], .middle = sm_middle},
    {.trigger = &trigger_c, .margin = 2U, .scale = sm_scale, .half = sm_half, .slew = slew_c, .span = &span[3], .middle = sm_middle}};

static const uint8_t place_of_u[] = {2U};
static const hg_real u_known[] = {R(SM_HALF)};
static const hg_real any[] = {R(SM_SPAN)};
static const hg_real unit[] = {R(1), R(0), R(0), R(1)};
static const hg_real drive[] = {R(0.25), R(0), R(0), R(0)};
static const hg_real zeros[] = {R(0), R(0), R(0), R(0)};
static const hg_real radius_a[] = {R(PREDICTED(1)), R(SM_SPAN), R(PREDICTED(2)), R(SM_SPAN), R(PREDICTED(3)), R(SM_SPAN),
                                   R(PREDICTED(4)), R(SM_SPAN), R(PREDICTED(5)), R(SM_SPAN), R(PREDICTED(6)), R(SM_SPAN)};
static const hg_real radius_c[] = {R(PREDICTED_C(1)), R(PREDICTED_C(2)), R(PREDICTED_C(3)), R(PREDICTED_C(4)), R(PREDICTED_C(5)), R(PREDICTED_C(6))};
static const hg_predict_config predict[] = {
    {.group = 0U, .first = 0U, .order = 2U, .width = 2U, .inputs = 1U, .input = place_of_u, .known = u_known, .correct = {2U, 2U, 0, unit},
     .state = {2U, 2U, 0, unit}, .drive = {2U, 1U, 0, drive}, .output = {2U, 2U, 0, unit}, .direct = {2U, 1U, 0, zeros}, .fresh = sm_half,
     .horizon = 6U, .radius = radius_a, .settle = SETTLE},
    {.group = 2U, .first = 3U, .order = 1U, .width = 1U, .inputs = 1U, .input = place_of_u, .known = any, .correct = {1U, 1U, 0, unit},
     .state = {1U, 1U, 0, unit}, .drive = {1U, 1U, 0, zeros}, .output = {1U, 1U, 0, unit}, .direct = {1U, 1U, 0, zeros}, .fresh = sm_half,
     .horizon = 6U, .radius = radius_c, .settle = SETTLE}};

static const uint8_t mismatch_place[] = {0U, 1U};
static const hg_real mismatch_constant[] = {R(0.0078125)};
static const hg_real mismatch_gain[] = {R(0.0625), R(0.001953125)};
static const hg_mismatch_config mismatch = {.states = 1U, .width = 2U, .signal = mismatch_place, .constant = mismatch_constant, .gain = mismatch_gain};

static const uint8_t read_0[] = {4U, 2U};
static const uint8_t wide_0[] = {4U, 2U, 7U};
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
     .rest_left = zeros, .moving = sm_start_1, .moving_left = zeros, .bias = sm_bias_1, .ready_rest = 0U, .ready_moving = 2U, .decay = zeros}};

static const uint8_t bank_place[] = {0U, 2U};
static const uint8_t bank_extra[] = {7U};
static const hg_real bank_weight[] = {R(1), R(1), R(0), R(0), R(0), R(-1), R(-0.25), R(-0.25), R(-1), R(0), R(-0.25), R(0)};
static const hg_real bank_extra_weight[] = {R(0), R(0), R(1), R(1), R(1), R(0)};
static const hg_real bank_bias[] = {R(TINY), R(2.0 * TINY)};
static const uint8_t itself_place[] = {3U};
static const hg_real itself_bias[] = {R(4)};
static const hg_bank_config bank[] = {
    {.certificates = 2U, .window = WINDOW, .width = 2U, .signal = bank_place, .weight = bank_weight, .extras = 1U, .extra = bank_extra,
     .extra_weight = bank_extra_weight, .bias = bank_bias, .widen = R(1)},
    {.certificates = 1U, .window = 1U, .width = 1U, .signal = itself_place, .weight = sm_one, .bias = itself_bias, .widen = R(1)}};

/* x+ = x / 2 + w, y = 4 (s0, s3) = (x + v1, x + v2), all variances 1/4. */
static const uint16_t two_terms[] = {1U, 2U};
static const uint8_t two_zeros[] = {0U, 0U, 0U};
static const uint16_t two_start[] = {0U, 5U, 6U, 7U, 8U, 9U};
static const uint16_t two_product[] = {0U, 1U, 2U, 3U, 4U, 1U, 2U, 3U, 4U};
static const uint8_t two_noise[] = {0U, 0U, 1U, 2U, 3U};
static const uint8_t two_moment[] = {0U, 1U, 0U, 0U, 0U};
static const uint8_t two_factor[] = {0U, 0U, 1U};
static const hg_real two_mean[] = {R(1), R(0), R(0), R(0)};
static const hg_real two_covariance[16] = {[5] = R(0.25), [10] = R(0.25), [15] = R(0.25)};
static const hg_real two_quarters[] = {R(0.25), R(0.25)};
static const hg_real two_ranges[] = {R(1000), R(1000)};
static const hg_real two_fresh[] = {R(0.0625), R(0.0625)};
static const hg_real two_gains[] = {R(4), R(4)};
static const uint8_t two_signals[] = {0U, 3U};
static const hg_real two_units[] = {R(1), R(1)};
#define FILTER_1                                                                                                                                  \
    {.filter = {.states = 1U, .outputs = 2U, .degree = 1U, .bounded = false, .lifted = 1U, .measured = 2U, .judged = 2U, .noises = 4U, .ring = 5U, \
                .lower = 5U, .f = {.width = 1U, .end = sf_one_term, .coefficient = sf_half, .factor = sf_first},                                 \
                .h = {.width = 1U, .end = two_terms, .coefficient = two_units, .factor = two_zeros}, .start = two_start, .product = two_product, \
                .parent = two_zeros, .factor = two_factor, .noise = two_noise, .moment = two_moment, .mean = two_mean,                           \
                .covariance = two_covariance, .x0 = sf_zero, .P0 = sf_unit, .M0 = sf_M0, .Q = sf_quarter, .R = two_quarters,                     \
                .range = two_ranges, .fresh = two_fresh, .kappa = R(4), .joint = R(16), .weight = R(0.25), .drift = R(9)},                       \
     .signal = two_signals, .gain = two_gains, .settle = SF_SETTLE}

static hg_statistic_config polynomial[2];

static const uint8_t feeds[JUDGED] = {0x3U, 0x1U, 0x3U, 0x4U, 0x3U, 0x5U};
static const uint32_t faults[JUDGED] = {0x1U, 0x2U, 0x4U, 0x8U, 0x10U, 0x20U};

static hg_detector_config all_config(void)
{
    const hg_statistic_config other = FILTER_1;
    polynomial[0] = sf_config;
    polynomial[1] = other;
    return (hg_detector_config){
        .signals = SIGNALS, .width = WIDTH, .groups = GROUPS, .hold = hold, .predictors = 2U, .predict = predict, .mismatch = &mismatch,
        .generators = 2U, .residual = residual, .hull = hull, .banks = 2U, .bank = bank, .polynomials = 2U, .polynomial = polynomial,
        .decision = {.generators = JUDGED, .feeds = feeds, .faults = faults, .up = 1U, .down = 3U, .latch = false},
        .history = HISTORY, .window = WINDOW, .residuals = RESIDUALS, .codes = HG_HOLD_CODES(SIGNALS), .sums = SUMS};
}

/* The same with one judge alone: 0 and 1 are generators, 2 and 3 banks, 4 and 5 filters. */
static hg_detector_config one_config(uint8_t judge)
{
    hg_detector_config c = all_config();
    const uint8_t which = judge % 2U;
    c.generators = (judge < 2U) ? 1U : 0U;
    c.residual = &residual[which];
    c.hull = &hull[which];
    c.banks = ((judge / 2U) == 1U) ? 1U : 0U;
    c.bank = &bank[which];
    c.polynomials = (judge >= 4U) ? 1U : 0U;
    c.polynomial = &polynomial[which];
    c.decision.generators = 1U;
    c.decision.feeds = &feeds[judge];
    c.decision.faults = &faults[judge];
    c.residuals = (judge < 4U) ? 1U : HG_STATISTICS;
    return c;
}

/* ---- rig ---- */

typedef struct {
    hg_detector  self;
    hg_hold      hold[GROUPS];
    hg_predict   predict[HG_GROUPS_MAX];
    hg_residual  residual[3]; /* one more than there are, of these four */
    hg_hull      hull[2];
    hg_zonotope  zonotope[3];
    hg_bank      bank[3];
    hg_statistic polynomial[3];
    hg_alarm     alarm[JUDGED + 1U];
    int32_t      code[HG_HOLD_CODES(SIGNALS) + 1U];
    hg_real      real[REALS_MAX];
    hg_acc       sum[SUMS + 1U];
    hg_finding   finding;
    uint32_t     reals;
    uint32_t     sums;
} rig;

static hg_status start_of(rig *r, const hg_detector_config *config, hg_start how)
{
    (void)memset(r, 0x5A, sizeof(*r));
    arm_codes(r->code, COUNT(r->code));
    arm(r->real, COUNT(r->real));
    arm(r->sum, COUNT(r->sum));
    r->reals = hg_detector_reals(config);
    r->sums = hg_detector_sums(config);
    assert_true(r->reals < REALS_MAX);
    assert_true(r->sums <= SUMS);
    const bool by_hull = config->hull != NULL;
    const hg_detector_memory memory = {.hold = r->hold, .predict = r->predict, .residual = r->residual, .hull = by_hull ? r->hull : NULL,
                                       .zonotope = by_hull ? NULL : r->zonotope, .bank = r->bank, .polynomial = r->polynomial, .alarm = r->alarm,
                                       .code = r->code, .codes = config->codes, .real = r->real, .reals = r->reals, .sum = r->sum, .sums = r->sums};
    return hg_detector_start(&r->self, config, &memory, how);
}

static void check_canaries(const rig *r)
{
    assert_codes_untouched(&r->code[HG_HOLD_CODES(SIGNALS)], 1U);
    assert_untouched(&r->real[r->reals], REALS_MAX - r->reals);
    assert_untouched(&r->sum[r->sums], (SUMS + 1U) - r->sums);
}

static void begin(rig *r, const hg_detector_config *config)
{
    assert_status(HG_OK, start_of(r, config, HG_START_REST));
    check_canaries(r);
}

static void refuse(const hg_detector_config *config, int line)
{
    static rig r;
    const hg_status status = start_of(&r, config, HG_START_REST);
    if (status != HG_E_CONFIG) {
        print_error("case of line %d: %d\n", line, (int)status);
    }
    assert_status(HG_E_CONFIG, status);
    check_canaries(&r);
}
#define assert_refused(config) refuse((config), __LINE__)

static void give(rig *r, uint8_t group, int32_t a, int32_t b, bool continues)
{
    const int32_t code[2] = {a, b};
    assert_status(HG_OK, hg_detector_receive(&r->self, group, code, continues));
}

static hg_plant step(rig *r)
{
    (void)memset(&r->finding, 0x5A, sizeof(r->finding));
    assert_status(HG_OK, hg_detector_step(&r->self, &r->finding));
    check_canaries(r);
    return r->finding.plant;
}

static hg_plant sample(rig *r, int32_t s0, int32_t s1, int32_t u, int32_t s3)
{
    give(r, 0U, s0, s1, true);
    give(r, 1U, u, 0, true);
    give(r, 2U, s3, 0, true);
    return step(r);
}

/* So long that all parts are ready. */
static void settle(rig *r, int32_t u)
{
    for (uint32_t k = 0U; k <= SETTLE; k++) {
        (void)sample(r, 0, 0, u, 0);
    }
}

static hg_real past(const rig *r, uint8_t lag, uint8_t place)
{
    return hg_ring_row(&r->self.radii, lag)[place];
}

/* ---- start ---- */

/* Pieces of memory, one after another as they lie. */
typedef struct {
    const hg_real *first[32];
    size_t         length[32];
    size_t         count;
} pieces;

static void piece(pieces *p, const hg_real *first, size_t length)
{
    size_t i = p->count;
    for (; (i > 0U) && (p->first[i - 1U] > first); i--) {
        p->first[i] = p->first[i - 1U];
        p->length[i] = p->length[i - 1U];
    }
    p->first[i] = first;
    p->length[i] = length;
    p->count++;
}

static void assert_one_after_another(const pieces *p, const hg_real *memory, size_t length)
{
    const hg_real *end = memory;
    for (size_t i = 0U; i < p->count; i++) {
        assert_ptr_equal(end, p->first[i]);
        end = &p->first[i][p->length[i]];
    }
    assert_ptr_equal(&memory[length], end);
}

static pieces pieces_of(const rig *r, const hg_detector_config *c)
{
    pieces p = {.count = 0U};
    const hg_detector *d = &r->self;
    piece(&p, d->value, WIDTH);
    piece(&p, d->r, RESIDUALS);
    piece(&p, d->J, RESIDUALS);
    piece(&p, d->past, WIDTH);
    piece(&p, d->radii.data, HG_RING_REALS(WIDTH, HISTORY));
    piece(&p, d->values.data, HG_RING_REALS(SIGNALS, WINDOW));
    for (size_t i = 0U; i < GROUPS; i++) {
        piece(&p, r->hold[i].value, HG_HOLD_REALS(c->hold[i].trigger->width));
    }
    for (size_t i = 0U; i < 2U; i++) {
        piece(&p, r->predict[i].x, HG_PREDICT_REALS(predict[i].order, predict[i].inputs, predict[i].width));
        piece(&p, r->residual[i].z, HG_RESIDUAL_REALS(residual[i].order, residual[i].width));
        piece(&p, r->polynomial[i].y, hg_statistic_reals(&polynomial[i]));
        if (c->hull != NULL) {
            piece(&p, r->hull[i].theta, HG_HULL_REALS(1U, 0U));
        } else {
            const hg_zonotope_config *z = &c->zonotope[i];
            piece(&p, r->zonotope[i].column, HG_ZONOTOPE_REALS(z->order, z->columns, (uint32_t)z->width + z->disturbances));
        }
    }
    return p;
}

static void every_part_has_memory_of_its_own(void **state)
{
    (void)state;
    static rig r;
    const hg_detector_config c = all_config();
    begin(&r, &c);
    const pieces p = pieces_of(&r, &c);
    assert_one_after_another(&p, r.real, r.reals);
    assert_ptr_equal(r.sum, r.bank[0].sum);
    assert_ptr_equal(&r.sum[HG_BANK_SUMS(2U)], r.bank[1].sum);
    assert_count(SUMS, r.sums);
    assert_true(hg_statistic_reals(&polynomial[0]) != hg_statistic_reals(&polynomial[1]));
    const size_t first[GROUPS] = {0U, 2U, 3U};
    for (size_t i = 0U; i < GROUPS; i++) {
        assert_ptr_equal(&r.code[2U * first[i]], r.hold[i].sent);
    }
}

static void before_the_first_sample_all_is_zero(void **state)
{
    (void)state;
    static rig r;
    const hg_detector_config c = all_config();
    begin(&r, &c);
    assert_count(0U, r.self.refusals);
    assert_count(0U, r.self.samples);
    assert_count(1U, r.self.beginnings);
    assert_ptr_equal(hg_ring_row(&r.self.radii, 0U), r.self.radius);
    for (uint8_t g = 0U; g < WIDTH; g++) {
        assert_real(0.0, r.self.value[g]);
        assert_real(0.0, r.self.radius[g]);
    }
    for (uint16_t i = 0U; i < RESIDUALS; i++) {
        assert_real(0.0, r.self.r[i]);
        assert_real(0.0, r.self.J[i]);
    }
}

static void the_last_of_several_is_looked_at_too(void **state)
{
    (void)state;
    const hg_detector_config good = all_config();
    hg_detector_config c = good;
    hg_predict_config p[2] = {predict[0], predict[1]};
    c.predict = p;
    p[1].horizon = 0U;
    assert_refused(&c);
    p[1] = predict[1];
    p[1].first = 2U; /* group 2 begins at 3 */
    assert_refused(&c);
    hg_bank_config b[2] = {bank[0], bank[1]};
    c = good;
    c.bank = b;
    b[1].widen = R(0.5);
    assert_refused(&c);
    c = good;
    polynomial[1].signal = NULL;
    assert_refused(&c);
    (void)all_config();
    const uint8_t outside[] = {4U, WIDTH};
    hg_residual_config res[2] = {residual[0], residual[1]};
    c.residual = res;
    res[0].signal = outside; /* its second */
    assert_refused(&c);
}

static void a_rewind_ends_within_the_taps_of_what_a_later_group_sends_and_of_what_is_derived(void **state)
{
    (void)state;
    const uint8_t few[] = {2U, TAPS, TAPS};
    const uint8_t enough[] = {3U, 0U, 3U}; /* group 1 speaks in every sample: there is nothing to rewind */
    const uint8_t later[] = {3U, 2U, 7U};
    hg_hull_config h[2] = {hull[0], hull[1]};
    hg_detector_config c = all_config();
    static rig r;
    c.hull = h;
    h[0].taps = few; /* of place 4, which any group may change */
    assert_refused(&c);
    h[0].taps = enough;
    begin(&r, &c);
    h[0].signal = later;
    begin(&r, &c);
    h[0].taps = few;
    assert_refused(&c);
}

static const uint8_t one_row[] = {1U};
static const hg_real balls_in[] = {R(1), R(0.25), R(1)};
static const hg_real balls_direct[] = {R(1), R(0), R(0)};
static const hg_real balls_tiny[] = {R(TINY)};
static const hg_real balls_rest_0[] = {R(64), R(0)};
static const hg_real balls_rest_1[] = {R(64), R(0.25)};
static const hg_zonotope_config balls[2] = { /* the hulls above */
    {.order = 1U, .residuals = 1U, .width = 3U, .disturbances = 1U, .initial = 0U, .columns = 12U, .blocks = 1U, .reduction = HG_REDUCTION_BALL,
     .signal = wide_0, .block = one_row, .state = zeros, .input = balls_in, .disturbance = balls_tiny, .output = sm_minus_one, .outer = sm_one,
     .direct = balls_direct, .settle = 2U, .bias_rest = balls_rest_0, .bias_moving = balls_rest_0, .decay = zeros, .always = zeros, .growth = zeros,
     .output_growth = zeros, .recover = 1U, .ready_rest = 0U, .ready_moving = 2U},
    {.order = 1U, .residuals = 1U, .width = 1U, .disturbances = 0U, .initial = 0U, .columns = 12U, .blocks = 1U, .reduction = HG_REDUCTION_BALL,
     .signal = sm_signals_1, .block = one_row, .state = zeros, .input = sm_one, .output = sm_minus_one, .outer = sm_one, .direct = sm_one,
     .settle = 2U, .bias_rest = balls_rest_1, .bias_moving = balls_rest_1, .decay = zeros, .always = zeros, .growth = zeros,
     .output_growth = zeros, .recover = 1U, .ready_rest = 0U, .ready_moving = 2U}};

static void zonotopes_have_memory_of_their_own(void **state)
{
    (void)state;
    static rig r;
    hg_detector_config c = all_config();
    c.hull = NULL;
    c.zonotope = balls;
    begin(&r, &c);
    const pieces p = pieces_of(&r, &c);
    assert_one_after_another(&p, r.real, r.reals);
}

/* They need the old radii of all that is rewritten, whoever sent it. */
static void zonotopes_need_as_much_history_as_the_slowest_group(void **state)
{
    (void)state;
    static rig r;
    hg_detector_config c = all_config();
    c.hull = NULL;
    c.zonotope = balls;
    c.history = 4U;
    assert_refused(&c);
    c.history = 5U;
    begin(&r, &c);
    hg_trigger_config slow = trigger_c;
    hg_hold_config h[GROUPS] = {hold[0], hold[1], hold[2]};
    c.hold = h;
    h[2].trigger = &slow;
    h[2].margin = 1U;
    slow.interval_max = 5U;
    assert_refused(&c);
}

#define MANY 31U
static const int32_t many_zeros[MANY + 1U] = {0};
static const uint16_t many_none[MANY + 1U] = {0U};

/* The vector cannot be longer, and its last place is a sent signal like the others. */
static void of_the_longest_vector_too(void **state)
{
    (void)state;
    static hg_real slew[(MANY + 1U) * 6U];
    static hg_real real[4000];
    static int32_t code[HG_HOLD_CODES(255U)];
    static hg_code_scale scale[MANY + 1U];
    static rig r;
    for (size_t i = 0U; i < (MANY + 1U); i++) {
        scale[i] = sm_scale[0];
    }
    hg_trigger_config trigger = {.width = MANY + 1U, .levels = 1U, .interval_max = 1U, .silence = sm_silence_b, .delta = many_none, .sigma = many_zeros,
                                 .activity = many_zeros, .zero = many_zeros};
    hg_trigger_config slow = trigger;
    hg_trigger_config last = trigger;
    slow.interval_max = 6U;
    last.width = MANY;
    hg_hold_config h[8];
    for (size_t i = 0U; i < 8U; i++) {
        h[i] = (hg_hold_config){.trigger = (i == 7U) ? &last : &trigger, .scale = scale, .half = slew, .slew = slew, .span = slew, .middle = slew};
    }
    h[1].trigger = &slow;
    const hg_detector_config c = {.signals = 255U, .width = 255U, .groups = 8U, .hold = h, .generators = 1U, .residual = &residual[1], .zonotope = &balls[1],
                                  .decision = {.generators = 1U, .feeds = feeds, .faults = faults, .up = 1U, .down = 1U}, .history = 6U, .residuals = 1U};
    hg_detector_config more = c;
    more.history = 7U;
    const hg_detector_memory memory = {.hold = (hg_hold[8]){{.age = 0U}}, .residual = r.residual, .zonotope = r.zonotope, .alarm = r.alarm, .code = code,
                                       .codes = COUNT(code), .real = real, .reals = COUNT(real)};
    assert_status(HG_E_CONFIG, hg_detector_start(&r.self, &c, &memory, HG_START_REST));
    assert_status(HG_OK, hg_detector_start(&r.self, &more, &memory, HG_START_REST));
}

static void as_many_predictors_as_groups_are_taken(void **state)
{
    (void)state;
    static rig r;
    hg_predict_config p[HG_GROUPS_MAX];
    for (size_t i = 0U; i < HG_GROUPS_MAX; i++) {
        p[i] = predict[1];
    }
    hg_detector_config c = one_config(1U);
    c.predictors = HG_GROUPS_MAX;
    c.predict = p;
    c.mismatch = NULL;
    c.width = SIGNALS + HG_GROUPS_MAX;
    begin(&r, &c);
    settle(&r, 0);
    give(&r, 1U, 0, 0, true);
    (void)step(&r);
    for (uint8_t i = 0U; i < HG_GROUPS_MAX; i++) {
        assert_real(PREDICTED_C(1), r.self.radius[SIGNALS + i]);
    }
}

/* The smallest detector: one signal of one group, and a bank that looks at one sample. */
static void one_of_everything_is_enough(void **state)
{
    (void)state;
    const uint8_t first[] = {0U};
    hg_bank_config b = bank[1];
    b.signal = first;
    const hg_detector_config c = {.signals = 1U, .width = 1U, .groups = 1U, .hold = &hold[2], .banks = 1U, .bank = &b,
                                  .decision = {.generators = 1U, .feeds = &feeds[1], .faults = faults, .up = 1U, .down = 1U}, .history = 1U, .window = 1U,
                                  .residuals = 1U, .codes = HG_HOLD_CODES(1U)};
    static rig r;
    begin(&r, &c);
    give(&r, 0U, AT, 0, true);
    assert_int_equal(HG_PLANT_NONE, step(&r));
    assert_real(1.0, r.self.r[0]);
    assert_real(4.0 + SM_HALF, r.self.J[0]);
}

static void ticks_alone_are_no_detector(void **state)
{
    (void)state;
    const hg_trigger_config tick = {.width = 0U, .levels = 1U, .interval_max = 1U, .silence = sm_silence_b};
    const hg_hold_config h = {.trigger = &tick};
    hg_residual_config res = residual[1];
    hg_hull_config none = hull[1];
    res.width = 0U;
    none.width = 0U;
    const hg_detector_config c = {.signals = 0U, .width = 0U, .groups = 1U, .hold = &h, .generators = 1U, .residual = &res, .hull = &none,
                                  .decision = {.generators = 1U, .feeds = feeds, .faults = faults, .up = 1U, .down = 1U}, .history = 1U, .residuals = 1U};
    assert_refused(&c);
}

/* ---- samples ---- */

/* The same frames, and their losses, to several detectors. */
typedef struct {
    rig    *r;
    size_t  count;
} crowd;

static void all_give(const crowd *c, uint8_t group, int32_t a, int32_t b, bool continues)
{
    for (size_t i = 0U; i < c->count; i++) {
        give(&c->r[i], group, a, b, continues);
    }
}

static void all_lose(const crowd *c, uint8_t group)
{
    for (size_t i = 0U; i < c->count; i++) {
        assert_status(HG_OK, hg_detector_lose(&c->r[i].self, group));
    }
}

/* One sample of random codes; an invalid one now and then. */
static void all_move(const crowd *c, int32_t reach, uint32_t *random)
{
    const bool continues = draw_between(random, 0, 9) > 2;
    const int32_t a = (draw_between(random, 0, 19) == 0) ? HG_CODE_INVALID : draw_between(random, -reach, reach);
    const int32_t b = draw_between(random, -reach, reach);
    for (uint8_t group = 0U; group < GROUPS; group++) {
        if ((group == 1U) ? (draw_between(random, 0, 9) > 0) : (draw_between(random, 0, 2) == 0)) {
            all_give(c, group, (group == 0U) ? a : b, b, continues);
        } else if (draw_between(random, 0, 9) == 0) {
            all_lose(c, group);
        } else {
            /* silence */
        }
    }
    for (size_t i = 0U; i < c->count; i++) {
        (void)step(&c->r[i]);
    }
}

/* Where in r and J the numbers of a judge are, and how many. */
static size_t place_of(size_t judge)
{
    return (judge < 4U) ? judge : (4U + (HG_STATISTICS * (judge - 4U)));
}

static void each_judge_computes_beside_the_others_what_it_computes_alone(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(71U);
    static rig r[JUDGED + 1U];
    static hg_detector_config c[JUDGED + 1U];
    const crowd them = {.r = r, .count = JUDGED + 1U};
    unsigned alarms[JUDGED] = {0U};
    for (uint8_t i = 0U; i < JUDGED; i++) {
        c[i] = one_config(i);
    }
    c[JUDGED] = all_config();
    for (int run = 0; run < 6; run++) {
        for (size_t i = 0U; i <= JUDGED; i++) {
            begin(&r[i], &c[i]);
        }
        for (int k = 0; k < 300; k++) {
            all_move(&them, ((run % 2) == 0) ? 20 : 300, &random);
            for (size_t i = 0U; i < JUDGED; i++) {
                const size_t n = (i < 4U) ? 1U : HG_STATISTICS;
                assert_memory_equal(r[i].self.r, &r[JUDGED].self.r[place_of(i)], n * sizeof(hg_real));
                assert_memory_equal(r[i].self.J, &r[JUDGED].self.J[place_of(i)], n * sizeof(hg_real));
                assert_int_equal(r[i].alarm[0].state, r[JUDGED].alarm[i].state);
                alarms[i] += (r[i].alarm[0].state == HG_PLANT_CONFIRMED) ? 1U : 0U;
            }
            if ((k % 100) == 99) {
                for (size_t i = 0U; i <= JUDGED; i++) {
                    hg_detector_restart(&r[i].self, HG_START_MOVING);
                }
            }
        }
    }
    for (size_t i = 0U; i < JUDGED; i++) {
        assert_true(alarms[i] > 10U);
    }
}

/* Its numbers are behind those of as many generators and banks as there are. */
static void a_filter_computes_the_same_beside_fewer_generators(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(74U);
    static rig r[2];
    const crowd them = {.r = r, .count = 2U};
    const hg_detector_config alone = one_config(4U);
    hg_detector_config c = all_config();
    c.generators = 1U;
    c.polynomials = 1U;
    c.decision.generators = 4U;
    c.residuals = 1U + 2U + HG_STATISTICS;
    begin(&r[0], &alone);
    begin(&r[1], &c);
    for (int k = 0; k < 100; k++) {
        all_move(&them, 20, &random);
        assert_memory_equal(r[0].self.r, &r[1].self.r[3], HG_STATISTICS * sizeof(hg_real));
        assert_memory_equal(r[0].self.J, &r[1].self.J[3], HG_STATISTICS * sizeof(hg_real));
    }
}

static void an_alarm_says_which_judge_and_what_it_rests_on(void **state)
{
    (void)state;
    static rig r;
    const hg_detector_config c = all_config();
    for (size_t i = 0U; i < JUDGED; i++) {
        begin(&r, &c);
        for (int k = 0; k < 40; k++) {
            (void)sample(&r, 0, -80, 0, 0); /* filter 0 is at rest there: x = -4, y = -5 */
        }
        assert_int_equal(HG_PLANT_NONE, r.finding.plant);
        for (size_t j = 0U; j < JUDGED; j++) {
            r.alarm[j] = (hg_alarm){.state = (i == j) ? HG_PLANT_CONFIRMED : HG_PLANT_NONE}; /* as if it had raised one */
        }
        assert_int_equal(HG_PLANT_CONFIRMED, sample(&r, 0, -80, 0, 0));
        assert_int_equal(faults[i], r.finding.candidates);
        assert_int_equal((i < 4U) ? HG_BASIS_SET : HG_BASIS_STATISTICAL, r.finding.basis);
    }
}

static void a_restart_reaches_every_part(void **state)
{
    (void)state;
    static rig r;
    const hg_detector_config c = all_config();
    begin(&r, &c);
    for (int k = 0; k < 20; k++) {
        (void)sample(&r, 10, 20, AT, 30);
    }
    for (size_t i = 0U; i < 2U; i++) {
        assert_true(r.predict[i].sure);
        assert_true(hg_bank_ready(&r.bank[i]));
        assert_true(hg_statistic_ready(&r.polynomial[i]));
    }
    hg_detector_restart(&r.self, HG_START_MOVING);
    for (size_t i = 0U; i < 2U; i++) {
        assert_false(r.predict[i].sure);
        assert_real(0.0, r.predict[i].x[0]);
        assert_real(0.0, r.residual[i].z[0]);
        assert_int_equal(0, r.hull[i].k);
        assert_int_equal(HG_START_MOVING, r.hull[i].how);
        assert_false(hg_bank_ready(&r.bank[i]));
        assert_count(0U, r.polynomial[i].samples);
    }
}

/* After settle(): two samples without frames of groups 0 and 2; in the second, group 1 is missing too. */
static void two_silent(rig *r)
{
    settle(r, 0);
    give(r, 1U, 0, 0, true);
    (void)step(r);
    assert_real(SM_SLEW(1), r->self.radius[0]);
    assert_real(PREDICTED(1), r->self.radius[4]);
    assert_real(SM_SLEW(1), r->self.radius[5]); /* the prediction is no better */
    assert_real(PROMISE_C, r->self.radius[3]);
    assert_real(PREDICTED_C(1), r->self.radius[6]);
    (void)step(r);
    assert_real(SM_SLEW(1), r->self.radius[2]);
    assert_real(PROMISE_A, r->self.radius[4]); /* without u there is no prediction of s0 */
    assert_real(PREDICTED_C(2), r->self.radius[6]);
}

/* What has grown later is a little more than what it would have been from the start, and never less. */
static void assert_grown(double expected, hg_real actual)
{
    assert_true((double)actual >= expected);
    assert_near(expected, actual, 1e-6);
}

static void a_rewind_widens_what_was_derived_from_its_group_and_nothing_else(void **state)
{
    (void)state;
    static rig r;
    const hg_detector_config c = all_config();
    for (uint8_t group = 0U; group < GROUPS; group += 2U) {
        hg_real before[2][WIDTH];
        begin(&r, &c);
        two_silent(&r);
        for (uint8_t lag = 0U; lag < 2U; lag++) {
            (void)memcpy(before[lag], hg_ring_row(&r.self.radii, lag), sizeof(before[lag]));
        }
        give(&r, group, 0, 0, false);
        give(&r, 1U, 0, 0, true);
        (void)step(&r);
        for (uint8_t lag = 1U; lag <= 2U; lag++) {
            const double wide = (group == 0U) ? (double)SM_SLEW(3 - (int)lag) : SLEW_C(3 - (int)lag);
            double expected[WIDTH];
            for (uint8_t g = 0U; g < WIDTH; g++) {
                const bool own = (group == 0U) ? ((g < 2U) || (g == 4U) || (g == 5U)) : ((g == 3U) || (g == 6U));
                expected[g] = own ? wide : (double)before[lag - 1U][g];
            }
            for (uint8_t g = 0U; g < (WIDTH - 1U); g++) {
                assert_real(expected[g], past(&r, lag, g));
            }
            const double grown = ((wide - (double)before[lag - 1U][0]) * 0.0625) + ((wide - (double)before[lag - 1U][1]) * 0.001953125);
            assert_grown((double)before[lag - 1U][7] + ((group == 0U) ? grown : 0.0), past(&r, lag, 7U));
        }
    }
}

/* With one predicted group and nothing else that is derived, and with no derived signal at all. */
static void a_rewind_widens_a_prediction_that_stands_alone(void **state)
{
    (void)state;
    static rig r;
    hg_detector_config c = one_config(1U);
    c.mismatch = NULL;
    c.predictors = 1U;
    c.width = SIGNALS + 2U;
    begin(&r, &c);
    settle(&r, 0);
    for (int k = 0; k < 2; k++) {
        give(&r, 1U, 0, 0, true);
        give(&r, 2U, 0, 0, true);
        (void)step(&r);
    }
    assert_real(PREDICTED(2), r.self.radius[4]);
    give(&r, 0U, 0, 0, false);
    give(&r, 1U, 0, 0, true);
    (void)step(&r);
    assert_real(SM_SLEW(2), past(&r, 1U, 4U));
    assert_real(SM_SLEW(1), past(&r, 2U, 4U));
}

/* Inputs of two groups, of which the second may have to be taken back; its prediction may be as long as one can be. */
static void the_last_input_that_relies_on_silence_ends_the_prediction(void **state)
{
    (void)state;
    static hg_real close_by[254U * 2U];
    for (size_t i = 0U; i < COUNT(close_by); i++) {
        close_by[i] = R(PREDICTED(1));
    }
    const uint8_t places[] = {2U, 3U};
    hg_real known[] = {R(SM_HALF), R(PROMISE_C)};
    hg_predict_config p[2] = {predict[0], predict[1]};
    p[0].inputs = 2U;
    p[0].input = places;
    p[0].known = known;
    p[0].drive = (hg_matrix){2U, 2U, 0, drive};
    p[0].direct = (hg_matrix){2U, 2U, 0, zeros};
    p[0].horizon = 254U;
    p[0].radius = close_by;
    hg_detector_config c = all_config();
    c.predict = p;
    static rig r;
    for (int trusted = 0; trusted < 2; trusted++) {
        known[1] = (trusted != 0) ? R(SPAN_C) : R(PROMISE_C); /* any radius will do: nothing to take back */
        begin(&r, &c);
        settle(&r, 0);
        give(&r, 1U, 0, 0, true);
        (void)step(&r);
        assert_real(PROMISE_C, r.self.radius[3]); /* close enough, but it relies on silence */
        assert_real((trusted != 0) ? PREDICTED(1) : (double)SM_SLEW(1), r.self.radius[4]);
    }
}

static void losses_of_two_groups_in_one_sample_take_back_what_relied_on_either(void **state)
{
    (void)state;
    static rig r;
    hg_detector_config c = one_config(0U);
    const uint8_t both[] = {0x5U};
    for (uint8_t lost = 0U; lost < 4U; lost++) {
        c.decision.feeds = both;
        begin(&r, &c);
        settle(&r, 0);
        for (int k = 0; k < 2; k++) {
            give(&r, 1U, 0, 0, true);
            assert_int_equal(HG_PLANT_NONE, step(&r));
        }
        r.alarm[0] = (hg_alarm){.state = HG_PLANT_PROVISIONAL, .up = 1U, .pending = 0x1U}; /* as if the residual had relied on group 0 and been too large */
        give(&r, 0U, 0, 0, (lost & 1U) == 0U);
        give(&r, 1U, 0, 0, true);
        give(&r, 2U, 0, 0, (lost & 2U) == 0U);
        assert_int_equal(((lost & 1U) != 0U) ? HG_PLANT_NONE : HG_PLANT_CONFIRMED, step(&r));
    }
}

/* ---- zonotopes ---- */

static void zonotopes_of_derived_signals_that_need_not_reduce_are_the_hulls(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(72U);
    static rig r[2];
    const crowd them = {.r = r, .count = 2U};
    const hg_detector_config by_hull = all_config();
    hg_detector_config by_zonotope = by_hull;
    by_zonotope.hull = NULL;
    by_zonotope.zonotope = balls;
    unsigned rewound = 0U;
    for (int run = 0; run < 10; run++) {
        begin(&r[0], &by_hull);
        begin(&r[1], &by_zonotope);
        settle(&r[0], 0);
        settle(&r[1], 0);
        for (int k = 0; k < 200; k++) {
            const hg_real before = past(&r[1], 0U, 0U);
            all_move(&them, 20, &random);
            rewound += (past(&r[1], 1U, 0U) > before) ? 1U : 0U;
            for (size_t i = 0U; i < 2U; i++) {
                assert_real(r[0].self.r[i], r[1].self.r[i]);
                assert_near(r[0].self.J[i], r[1].self.J[i], 1e-3);
            }
        }
    }
    assert_true(rewound > 10U);
}

/* ---- what goes wrong ---- */

static const hg_real bad_middle[] = {REAL_NAN, R(0)};

/* Only corrupted tables bring a number that is not finite as far as this. */
static void a_part_that_refuses_begins_again_and_no_other(void **state)
{
    (void)state;
    static rig r;
    hg_hold_config h[GROUPS] = {hold[0], hold[1], hold[2]};
    hg_detector_config c = all_config();
    h[0].middle = bad_middle;
    c.hold = h;
    c.polynomials = 1U; /* the second would refuse as well */
    c.decision.generators = JUDGED - 1U;
    c.residuals = RESIDUALS - HG_STATISTICS;
    begin(&r, &c);
    settle(&r, AT);
    for (int k = 0; k < 5; k++) {
        (void)sample(&r, 8 * k, 32, AT + 4, 30);
    }
    assert_true(fabs((double)r.self.r[2]) > 0.0);
    assert_real(30.0 * SM_RESOLUTION, r.self.r[3]);
    give(&r, 0U, HG_CODE_INVALID, 32, true);
    give(&r, 1U, AT, 0, true);
    give(&r, 2U, 30, 0, true);
    assert_status(HG_E_NUMERIC, hg_detector_step(&r.self, &r.finding));
    check_canaries(&r);
    assert_count(3U, r.self.refusals); /* generator 0 and both banks: a sample that cannot be kept is missing from every window */
    assert_real(0.0, r.residual[0].z[0]);
    assert_real(32.0 * SM_RESOLUTION, r.residual[1].z[0]);
    assert_real(0.0, r.self.r[1]);
    for (size_t b = 0U; b < 2U; b++) {
        assert_real(0.0, r.self.r[2U + b]);
        assert_real(c.bank[b].bias[0], r.self.J[2U + b]);
        assert_int_equal(0, r.bank[b].k);
    }
    assert_true(hg_statistic_ready(&r.polynomial[0]));
}

/* What leads every read and write of the rings is in flash: memory that fails cannot move it. */
static void sizes_of_the_rings_are_those_of_the_tables(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(73U);
    static rig r[2];
    const crowd them = {.r = r, .count = 2U};
    for (uint8_t judge = 2U; judge <= JUDGED; judge++) { /* with one bank, and with two */
        const hg_detector_config c = (judge < JUDGED) ? one_config(judge) : all_config();
        begin(&r[0], &c);
        begin(&r[1], &c);
        for (int k = 0; k < 30; k++) {
            r[1].self.radii.width = (uint8_t)draw(&random);
            r[1].self.radii.length = (uint8_t)draw(&random);
            r[1].self.values.width = (uint8_t)draw(&random);
            r[1].self.values.length = (uint8_t)draw(&random);
            all_move(&them, 20, &random);
            assert_memory_equal(r[0].self.r, r[1].self.r, c.residuals * sizeof(hg_real));
            assert_memory_equal(r[0].self.J, r[1].self.J, c.residuals * sizeof(hg_real));
        }
    }
}

static void samples_are_counted_and_saturate(void **state)
{
    (void)state;
    static rig r;
    const hg_detector_config c = one_config(3U);
    begin(&r, &c);
    for (uint32_t k = 1U; k <= 300U; k++) {
        (void)sample(&r, 0, 0, 0, 0);
        assert_count((k < UINT8_MAX) ? k : UINT8_MAX, r.self.samples);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_part_has_memory_of_its_own),
        cmocka_unit_test(before_the_first_sample_all_is_zero),
        cmocka_unit_test(the_last_of_several_is_looked_at_too),
        cmocka_unit_test(a_rewind_ends_within_the_taps_of_what_a_later_group_sends_and_of_what_is_derived),
        cmocka_unit_test(zonotopes_have_memory_of_their_own),
        cmocka_unit_test(zonotopes_need_as_much_history_as_the_slowest_group),
        cmocka_unit_test(of_the_longest_vector_too),
        cmocka_unit_test(as_many_predictors_as_groups_are_taken),
        cmocka_unit_test(one_of_everything_is_enough),
        cmocka_unit_test(ticks_alone_are_no_detector),
        cmocka_unit_test(each_judge_computes_beside_the_others_what_it_computes_alone),
        cmocka_unit_test(a_filter_computes_the_same_beside_fewer_generators),
        cmocka_unit_test(an_alarm_says_which_judge_and_what_it_rests_on),
        cmocka_unit_test(a_restart_reaches_every_part),
        cmocka_unit_test(a_rewind_widens_what_was_derived_from_its_group_and_nothing_else),
        cmocka_unit_test(a_rewind_widens_a_prediction_that_stands_alone),
        cmocka_unit_test(the_last_input_that_relies_on_silence_ends_the_prediction),
        cmocka_unit_test(losses_of_two_groups_in_one_sample_take_back_what_relied_on_either),
        cmocka_unit_test(zonotopes_of_derived_signals_that_need_not_reduce_are_the_hulls),
        cmocka_unit_test(a_part_that_refuses_begins_again_and_no_other),
        cmocka_unit_test(sizes_of_the_rings_are_those_of_the_tables),
        cmocka_unit_test(samples_are_counted_and_saturate),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
