/** @file
 *  hold.h: what is known between frames. The soundness tests run sender and receiver against each other over a lossy link. */
#include "support.h"

#include "hullguard/hold.h"

#define WIDTH 2U
#define LEVELS 2U
#define INTERVAL 5U
#define MARGIN 3U
#define HORIZON (INTERVAL + MARGIN)
#define RING_WIDTH (WIDTH + 2U)
#define RING_LENGTH (INTERVAL + 1U)
#define STEP 6 /* codes that a channel moves at most in one sample */

static const uint8_t silence_table[LEVELS] = {2U, 1U};
static const uint16_t delta_table[LEVELS * WIDTH] = {3277U, 0U, 0U, 0U};
static const int32_t sigma_table[LEVELS * WIDTH] = {6, 8, 2, 3};
static const int32_t activity_table[LEVELS * WIDTH] = {0, 0, 12, 12};
static const int32_t zero_table[WIDTH] = {0, 0};
static const hg_trigger_config trigger = {.width = WIDTH,
                                          .levels = LEVELS,
                                          .interval_max = INTERVAL,
                                          .silence = silence_table,
                                          .delta = delta_table,
                                          .sigma = sigma_table,
                                          .activity = activity_table,
                                          .zero = zero_table};
/* Powers of two everywhere, so that float32 adds nothing to compare with. */
static const hg_code_scale scale_table[WIDTH] = {{R(0.25), R(0), R(4), 0, -400, 400}, {R(0.5), R(10), R(2), 0, -400, 400}};
static const hg_real half_table[WIDTH] = {R(0.125), R(0.25)};
static const hg_real span_table[WIDTH] = {R(200), R(400)};
static const hg_real middle_table[WIDTH] = {R(1), R(12)};
static hg_real slew_table[HORIZON * WIDTH];
static const hg_hold_config usual = {.trigger = &trigger,
                                     .margin = MARGIN,
                                     .scale = scale_table,
                                     .half = half_table,
                                     .slew = slew_table,
                                     .span = span_table,
                                     .middle = middle_table};

static int fill_slew(void **state)
{
    (void)state;
    for (size_t j = 0U; j < HORIZON; j++) {
        for (size_t g = 0U; g < WIDTH; g++) {
            slew_table[(j * WIDTH) + g] = (R(STEP) * R((double)j + 1.0) * scale_table[g].resolution) + half_table[g];
        }
    }
    return 0;
}

static hg_real slew(uint32_t j, size_t g)
{
    return slew_table[((j - 1U) * WIDTH) + g];
}

typedef struct {
    hg_hold hold;
    int32_t codes[HG_HOLD_CODES(WIDTH) + 1U];
    hg_real reals[HG_HOLD_REALS(WIDTH) + 1U];
    hg_real value[WIDTH + 1U];
    hg_real radius[WIDTH + 1U];
    uint8_t rewind;
} rig;

static void begin(rig *r)
{
    (void)memset(r, 0x5A, sizeof(*r));
    arm_codes(r->codes, HG_HOLD_CODES(WIDTH) + 1U);
    arm(r->reals, HG_HOLD_REALS(WIDTH) + 1U);
    arm(r->value, WIDTH + 1U);
    arm(r->radius, WIDTH + 1U);
    assert_status(HG_OK, hg_hold_start(&r->hold, &usual, r->codes, r->reals));
}

/* The past in a ring is rewritten as it is row by row; nothing else of the ring changes, wherever its newest row is. */
static void check_rewrite(const rig *r)
{
    hg_real memory[RING_WIDTH * RING_LENGTH];
    hg_ring ring;
    for (uint8_t i = 0U; i < (3U * RING_LENGTH); i++) {
        const uint8_t first = (uint8_t)(i / RING_LENGTH); /* of the group in the row */
        assert_status(HG_OK, hg_ring_start(&ring, RING_WIDTH, RING_LENGTH, memory));
        arm(memory, COUNT(memory));
        ring.newest = (uint8_t)(i % RING_LENGTH);
        for (uint8_t lag = 1U; lag <= r->rewind; lag++) { /* without a value it had the radius of the range */
            (void)memcpy(&hg_ring_row(&ring, lag)[first], span_table, sizeof(span_table));
        }
        hg_hold_rewrite(&r->hold, &ring, first, r->rewind);
        for (uint8_t lag = 0U; lag < RING_LENGTH; lag++) {
            const hg_real *row = hg_ring_row(&ring, lag);
            hg_real past[WIDTH];
            arm(past, WIDTH);
            if ((lag >= 1U) && (lag <= r->rewind)) {
                hg_hold_past(&r->hold, lag, past);
            }
            assert_memory_equal(past, &row[first], sizeof(past));
            assert_untouched(row, first);
            assert_untouched(&row[first + WIDTH], RING_WIDTH - (first + WIDTH));
        }
    }
}

static void step(rig *r)
{
    r->rewind = 0x5AU;
    hg_hold_step(&r->hold, r->value, r->radius, &r->rewind);
    for (size_t g = 0U; g < WIDTH; g++) {
        assert_true(hg_real_finite(r->value[g]));
        assert_true(hg_real_finite(r->radius[g]));
        assert_true(r->radius[g] >= R(0));
    }
    assert_untouched(&r->value[WIDTH], 1U);
    assert_untouched(&r->radius[WIDTH], 1U);
    assert_codes_untouched(&r->codes[HG_HOLD_CODES(WIDTH)], 1U);
    assert_untouched(&r->reals[HG_HOLD_REALS(WIDTH)], 1U);
    if (r->rewind > 0U) {
        check_rewrite(r);
    }
}

static void frame(rig *r, int32_t a, int32_t b, bool continues)
{
    const int32_t code[WIDTH] = {a, b};
    assert_status(HG_OK, hg_hold_receive(&r->hold, code, continues));
    step(r);
}

static void start_tells_null_and_bad_tables(void **state)
{
    (void)state;
    hg_hold self;
    int32_t codes[HG_HOLD_CODES(WIDTH)];
    hg_real reals[HG_HOLD_REALS(WIDTH)];
    arm_codes(codes, COUNT(codes));
    arm(reals, COUNT(reals));
    assert_status(HG_E_ARGUMENT, hg_hold_start(NULL, &usual, codes, reals));
    assert_status(HG_E_ARGUMENT, hg_hold_start(&self, NULL, codes, reals));
    assert_status(HG_E_ARGUMENT, hg_hold_start(&self, &usual, NULL, reals));
    assert_status(HG_E_ARGUMENT, hg_hold_start(&self, &usual, codes, NULL));
    hg_hold_config c = usual;
    c.trigger = NULL;
    assert_status(HG_E_CONFIG, hg_hold_start(&self, &c, codes, reals));
    hg_trigger_config t = trigger;
    t.levels = 0U;
    c = usual, c.trigger = &t;
    assert_status(HG_E_CONFIG, hg_hold_start(&self, &c, codes, reals));
    c = usual, c.margin = (uint8_t)(255U - INTERVAL);
    assert_status(HG_E_CONFIG, hg_hold_start(&self, &c, codes, reals));
    c = usual, c.scale = NULL;
    assert_status(HG_E_CONFIG, hg_hold_start(&self, &c, codes, reals));
    c = usual, c.half = NULL;
    assert_status(HG_E_CONFIG, hg_hold_start(&self, &c, codes, reals));
    c = usual, c.slew = NULL;
    assert_status(HG_E_CONFIG, hg_hold_start(&self, &c, codes, reals));
    c = usual, c.span = NULL;
    assert_status(HG_E_CONFIG, hg_hold_start(&self, &c, codes, reals));
    c = usual, c.middle = NULL;
    assert_status(HG_E_CONFIG, hg_hold_start(&self, &c, codes, reals));
    assert_codes_untouched(codes, COUNT(codes));
    assert_untouched(reals, COUNT(reals));
    static hg_real long_slew[254U * WIDTH];
    c = usual, c.slew = long_slew, c.margin = (uint8_t)(254U - INTERVAL);
    assert_status(HG_OK, hg_hold_start(&self, &c, codes, reals));
}

static void start_tells_a_scale_of_the_other_number_type(void **state)
{
    (void)state;
    hg_hold self;
    int32_t codes[HG_HOLD_CODES(WIDTH)];
    hg_real reals[HG_HOLD_REALS(WIDTH)];
    for (int exponent = INT8_MIN; exponent <= INT8_MAX; exponent++) {
        for (size_t g = 0U; g < WIDTH; g++) {
            hg_code_scale scale[WIDTH] = {scale_table[0], scale_table[1]};
            hg_hold_config c = usual;
            c.scale = scale;
            scale[g].exponent = (int8_t)exponent;
            assert_status((exponent == 0) ? HG_OK : HG_E_CONFIG, hg_hold_start(&self, &c, codes, reals));
        }
    }
}

/* At every place of every table, and none behind them. */
static void start_tells_numbers_that_are_no_radii(void **state)
{
    (void)state;
    const hg_real bad[] = {REAL_NAN, REAL_INF, -REAL_INF, R(-0.125)};
    hg_hold self;
    int32_t codes[HG_HOLD_CODES(WIDTH)];
    hg_real reals[HG_HOLD_REALS(WIDTH)];
    arm_codes(codes, COUNT(codes));
    arm(reals, COUNT(reals));
    for (size_t place = 0U; place < ((2U + HORIZON) * WIDTH); place++) {
        for (size_t i = 0U; i < COUNT(bad); i++) {
            hg_real table[(2U + HORIZON) * WIDTH];
            hg_hold_config c = usual;
            (void)memcpy(table, half_table, sizeof(half_table));
            (void)memcpy(&table[WIDTH], span_table, sizeof(span_table));
            (void)memcpy(&table[2U * WIDTH], slew_table, sizeof(slew_table));
            c.half = table;
            c.span = &table[WIDTH];
            c.slew = &table[2U * WIDTH];
            table[place] = bad[i];
            assert_status(HG_E_CONFIG, hg_hold_start(&self, &c, codes, reals));
        }
    }
    assert_codes_untouched(codes, COUNT(codes));
    assert_untouched(reals, COUNT(reals));
}

/* Whatever was in the memory: no frame seen, nothing sent, nothing promised. */
static void a_start_leaves_nothing_undefined(void **state)
{
    (void)state;
    static const int patterns[] = {0x00, 0x01, 0x5A};
    for (size_t i = 0U; i < COUNT(patterns); i++) {
        rig r;
        (void)memset(&r, patterns[i], sizeof(r));
        assert_status(HG_OK, hg_hold_start(&r.hold, &usual, r.codes, r.reals));
        assert_int_equal(UINT8_MAX, hg_hold_age(&r.hold));
        assert_int_equal(0, r.hold.good);
        assert_int_equal(0, r.hold.level);
        assert_int_equal(0, r.hold.silence);
        assert_int_equal(0, r.hold.gap_age);
        assert_true(r.hold.holes);
        assert_false(r.hold.seen || r.hold.recovering || r.hold.fresh);
        assert_false(r.hold.lost || r.hold.doubt);
        assert_false(r.hold.gap);
        for (size_t g = 0U; g < WIDTH; g++) {
            assert_int_equal(HG_CODE_INVALID, r.hold.sent[g]);
            assert_int_equal(HG_CODE_INVALID, r.hold.previous[g]);
            assert_real(middle_table[g], r.hold.value[g]);
            assert_real(HG_REAL_MAX, r.hold.promise[g]);
        }
    }
}

/* A threshold of 0 is one: the sender speaks of every step of its code. */
static void a_promise_of_no_threshold_is_the_rounding_alone(void **state)
{
    (void)state;
    const uint8_t silence[2] = {0U, 0U};
    const uint16_t delta[2 * WIDTH] = {0U};
    const int32_t sigma[2 * WIDTH] = {0, 0, 4, 4};
    const int32_t activity[2 * WIDTH] = {0, 0, 300, 300};
    hg_trigger_config exact = trigger;
    exact.levels = 2U;
    exact.silence = silence;
    exact.delta = delta;
    exact.sigma = sigma;
    exact.activity = activity;
    hg_hold_config c = usual;
    c.trigger = &exact;
    rig r;
    begin(&r);
    assert_status(HG_OK, hg_hold_start(&r.hold, &c, r.codes, r.reals));
    frame(&r, 100, -100, true);
    frame(&r, 100, -100, true); /* two in a row: level 0 */
    step(&r);
    assert_real(half_table[0], r.radius[0]);
    assert_real(half_table[1], r.radius[1]);
}

/* The sender's silence says nothing of a signal that has no value: it is nothing to be in doubt about. */
static void a_signal_without_a_value_promises_nothing(void **state)
{
    (void)state;
    rig r;
    begin(&r);
    frame(&r, 100, -100, true);
    frame(&r, HG_CODE_INVALID, HG_CODE_INVALID, true);
    for (uint32_t j = 1U; j < INTERVAL; j++) {
        step(&r);
        assert_false(hg_hold_doubt(&r.hold));
        assert_real(span_table[0], r.radius[0]);
        assert_real(span_table[1], r.radius[1]);
    }
}

static void before_the_first_frame_nothing_is_known(void **state)
{
    (void)state;
    rig r;
    begin(&r);
    assert_int_equal(HG_BUS_ABSENT, hg_hold_health(&r.hold));
    for (int k = 0; k < 600; k++) {
        if ((k % 100) == 50) {
            hg_hold_lose(&r.hold);
        }
        step(&r);
        for (size_t g = 0U; g < WIDTH; g++) {
            assert_real(middle_table[g], r.value[g]);
            assert_real(span_table[g], r.radius[g]);
        }
        assert_int_equal(0, r.rewind);
        assert_int_equal(UINT8_MAX, hg_hold_age(&r.hold));
        assert_false(hg_hold_doubt(&r.hold));
        assert_int_equal(HG_BUS_ABSENT, hg_hold_health(&r.hold));
    }
}

static void the_radius_follows_the_table_of_the_header(void **state)
{
    (void)state;
    rig r;
    begin(&r);
    frame(&r, 100, -100, true);
    assert_real(25.0, r.value[0]);
    assert_real(-40.0, r.value[1]);
    assert_real(half_table[0], r.radius[0]);
    assert_real(half_table[1], r.radius[1]);
    assert_int_equal(HG_BUS_GOOD, hg_hold_health(&r.hold));
    assert_false(hg_hold_doubt(&r.hold));
    frame(&r, 101, -101, true); /* two in a row: the level is 0 for sure */
    for (uint32_t j = 1U; j <= 2U; j++) {
        step(&r);
        assert_real(slew(j, 0U), r.radius[0]); /* the sender does not look yet */
        assert_real(slew(j, 1U), r.radius[1]);
        assert_false(hg_hold_doubt(&r.hold));
    }
    step(&r);
    assert_real((6.0 + 5.0) * 0.25 + 0.125, r.radius[0]); /* 3277 / 65536 of 101, rounded down */
    assert_real((8.0 * 0.5) + 0.25, r.radius[1]);
    assert_true(hg_hold_doubt(&r.hold));
    assert_real(25.25, r.value[0]);
}

static void the_smaller_of_promise_and_slew_counts(void **state)
{
    (void)state;
    rig r;
    begin(&r);
    frame(&r, 0, 0, true);
    frame(&r, 20, 0, true); /* level 1: silence 1, thresholds 2 and 3 */
    step(&r);
    assert_real(slew(1U, 0U), r.radius[0]);
    step(&r);
    assert_real((2.0 * 0.25) + 0.125, r.radius[0]);
    assert_real((3.0 * 0.5) + 0.25, r.radius[1]);
    begin(&r);
    frame(&r, 400, 0, true); /* one frame: over all levels the silence is 2, the threshold 6 + 20 */
    step(&r);
    step(&r);
    step(&r);
    assert_real(slew(3U, 0U), r.radius[0]); /* slew 18 codes < 26 */
    assert_real((8.0 * 0.5) + 0.25, r.radius[1]);
    assert_true(hg_hold_doubt(&r.hold));
}

/* After one frame the sender may be on any level: the longest silence and the widest threshold count, whichever levels they belong to. */
static void while_the_level_is_unknown_the_widest_counts(void **state)
{
    (void)state;
    const uint8_t quiet[3] = {0U, 2U, 1U};
    const int32_t sigma[3] = {2, 1, 4};
    const uint16_t delta[3] = {0U, 0U, 0U};
    const int32_t activity[3] = {0, 10, 20};
    const hg_trigger_config t = {.width = 1U, .levels = 3U, .interval_max = INTERVAL, .silence = quiet, .delta = delta, .sigma = sigma,
                                 .activity = activity, .zero = zero_table};
    const hg_real steps[HORIZON] = {R(10), R(20), R(30), R(40), R(50), R(60), R(70), R(80)};
    hg_hold_config c = usual;
    c.trigger = &t;
    c.slew = steps;
    const int32_t codes_sent[3] = {0, 0, 15};
    const uint8_t longest[3] = {2U, 0U, 2U};
    const double widest[3] = {4.0, 2.0, 1.0};
    hg_hold self;
    int32_t codes[HG_HOLD_CODES(1U)];
    hg_real reals[HG_HOLD_REALS(1U)];
    hg_real value;
    hg_real radius;
    uint8_t rewind;
    assert_status(HG_OK, hg_hold_start(&self, &c, codes, reals));
    for (size_t i = 0U; i < 3U; i++) { /* one frame, level unknown; then level 0; then level 1 */
        assert_status(HG_OK, hg_hold_receive(&self, &codes_sent[i], true));
        hg_hold_step(&self, &value, &radius, &rewind);
        for (uint32_t j = 1U; j < 4U; j++) {
            hg_hold_step(&self, &value, &radius, &rewind);
            assert_real((j <= longest[i]) ? steps[j - 1U] : R((widest[i] * 0.25) + 0.125), radius);
        }
    }
}

/* A slew table that falls is no table of the design's, but it must not end a doubt that a radius before has raised. */
static void doubt_stays_until_it_is_settled(void **state)
{
    (void)state;
    const hg_real falling[HORIZON * WIDTH] = {R(9), R(9), R(9), R(9), R(9), R(9), R(0), R(0), R(9), R(9), R(9), R(9), R(9), R(9), R(9),
        R(9)};
    hg_hold_config c = usual;
    c.slew = falling;
    rig r;
    begin(&r);
    assert_status(HG_OK, hg_hold_start(&r.hold, &c, r.codes, r.reals));
    frame(&r, 0, 0, true);
    step(&r);
    step(&r);
    assert_false(hg_hold_doubt(&r.hold));
    step(&r);
    assert_true(hg_hold_doubt(&r.hold));
    step(&r);
    assert_real(0.0, r.radius[0]);
    assert_true(hg_hold_doubt(&r.hold));
}

static void a_second_frame_of_one_sample_is_refused(void **state)
{
    (void)state;
    rig r;
    begin(&r);
    const int32_t first[WIDTH] = {1, 2};
    const int32_t second[WIDTH] = {3, 4};
    assert_status(HG_OK, hg_hold_receive(&r.hold, first, true));
    const hg_hold before = r.hold;
    int32_t codes[HG_HOLD_CODES(WIDTH)];
    hg_real reals[HG_HOLD_REALS(WIDTH)];
    (void)memcpy(codes, r.codes, sizeof(codes));
    (void)memcpy(reals, r.reals, sizeof(reals));
    assert_status(HG_E_REPEATED, hg_hold_receive(&r.hold, second, true));
    assert_memory_equal(&before, &r.hold, sizeof(before));
    assert_memory_equal(codes, r.codes, sizeof(codes));
    assert_memory_equal(reals, r.reals, sizeof(reals));
    step(&r);
    assert_real(0.25, r.value[0]);
}

static void silence_past_the_longest_interval_is_a_loss_and_then_stale(void **state)
{
    (void)state;
    rig r;
    begin(&r);
    frame(&r, 0, 0, true);
    frame(&r, 0, 0, true);
    for (uint32_t j = 1U; j < INTERVAL; j++) {
        step(&r);
        assert_int_equal(0, r.rewind);
        assert_int_equal(HG_BUS_GOOD, hg_hold_health(&r.hold));
    }
    assert_true(hg_hold_doubt(&r.hold));
    step(&r);
    assert_int_equal(HG_BUS_LOSSY, hg_hold_health(&r.hold));
    assert_int_equal(INTERVAL - 1U, r.rewind);
    assert_false(hg_hold_doubt(&r.hold));
    for (uint8_t lag = 1U; lag <= r.rewind; lag++) {
        hg_real past[WIDTH + 1U];
        arm(past, WIDTH + 1U);
        hg_hold_past(&r.hold, lag, past);
        assert_real(slew(INTERVAL - (uint32_t)lag, 0U), past[0]);
        assert_real(slew(INTERVAL - (uint32_t)lag, 1U), past[1]);
        assert_untouched(&past[WIDTH], 1U);
    }
    for (uint32_t j = INTERVAL; j <= HORIZON; j++) {
        assert_real(slew(j, 0U), r.radius[0]);
        assert_int_equal(HG_BUS_LOSSY, hg_hold_health(&r.hold));
        step(&r);
        assert_int_equal(0, r.rewind);
    }
    for (int k = 0; k < 600; k++) { /* the age saturates */
        assert_real(span_table[0], r.radius[0]);
        assert_real(0.0, r.value[0]);
        assert_int_equal(HG_BUS_STALE, hg_hold_health(&r.hold));
        step(&r);
        assert_int_equal(0, r.rewind);
    }
    frame(&r, 8, 8, true); /* its counter may have run round */
    assert_real(half_table[0], r.radius[0]);
    assert_int_equal(HG_BUS_LOSSY, hg_hold_health(&r.hold));
    frame(&r, 8, 8, true);
    assert_int_equal(HG_BUS_GOOD, hg_hold_health(&r.hold));
}

static void a_frame_at_the_longest_interval_is_in_time(void **state)
{
    (void)state;
    rig r;
    begin(&r);
    frame(&r, 0, 0, true);
    frame(&r, 0, 0, true);
    for (uint32_t j = 1U; j < INTERVAL; j++) {
        step(&r);
    }
    frame(&r, 0, 0, true);
    assert_int_equal(0, r.rewind);
    assert_int_equal(HG_BUS_GOOD, hg_hold_health(&r.hold));
    assert_int_equal(2, r.hold.good);
}

static void a_gap_in_the_counter_rewinds_to_the_frame_before_it(void **state)
{
    (void)state;
    for (uint8_t silent = 0U; silent < (INTERVAL - 1U); silent++) {
        rig r;
        begin(&r);
        frame(&r, 40, 0, true);
        frame(&r, 40, 0, true);
        for (uint8_t j = 0U; j < silent; j++) {
            step(&r);
        }
        const bool doubted = hg_hold_doubt(&r.hold);
        frame(&r, 60, 0, false);
        assert_int_equal(doubted ? silent : 0, r.rewind);
        for (uint8_t lag = 1U; lag <= r.rewind; lag++) {
            hg_real past[WIDTH];
            hg_hold_past(&r.hold, lag, past);
            assert_real(slew((uint32_t)silent + 1U - lag, 0U), past[0]);
        }
        assert_real(half_table[0], r.radius[0]);
        assert_int_equal(HG_BUS_LOSSY, hg_hold_health(&r.hold));
        assert_false(hg_hold_doubt(&r.hold));
        assert_int_equal(1, r.hold.good);
        step(&r);
        assert_int_equal(0, r.rewind); /* asked for once only */
        assert_int_equal(HG_BUS_LOSSY, hg_hold_health(&r.hold));
    }
}

static void channels_that_were_invalid_rewind_to_their_span(void **state)
{
    (void)state;
    rig r;
    hg_real past[WIDTH];
    begin(&r);
    frame(&r, 40, HG_CODE_INVALID, true);
    assert_real(half_table[0], r.radius[0]);
    assert_real(span_table[1], r.radius[1]);
    assert_real(middle_table[1], r.value[1]);
    frame(&r, 40, HG_CODE_INVALID, true);
    assert_int_equal(1, r.hold.level); /* invalid counts as the highest activity */
    step(&r);
    step(&r);
    assert_true(hg_hold_doubt(&r.hold));
    frame(&r, HG_CODE_INVALID, 40, false);
    assert_int_equal(2, r.rewind);
    hg_hold_past(&r.hold, 1U, past);
    assert_real(slew(2U, 0U), past[0]);
    assert_real(span_table[1], past[1]);
    assert_real(span_table[0], r.radius[0]);
    assert_real(half_table[1], r.radius[1]);
}

static void a_reported_loss_rewinds_at_once_and_trusts_only_the_slew(void **state)
{
    (void)state;
    rig r;
    begin(&r);
    frame(&r, 0, 0, true);
    frame(&r, 0, 0, true);
    step(&r);
    step(&r);
    step(&r);
    assert_true(hg_hold_doubt(&r.hold));
    hg_hold_lose(&r.hold);
    step(&r);
    assert_int_equal(3, r.rewind);
    assert_false(hg_hold_doubt(&r.hold));
    assert_real(slew(4U, 0U), r.radius[0]);
    assert_int_equal(HG_BUS_LOSSY, hg_hold_health(&r.hold));
    frame(&r, 0, 0, true); /* its counter continues, but one was lost */
    assert_int_equal(0, r.rewind);
    assert_int_equal(1, r.hold.good);
    assert_int_equal(HG_BUS_LOSSY, hg_hold_health(&r.hold));
    frame(&r, 0, 0, true);
    assert_int_equal(HG_BUS_GOOD, hg_hold_health(&r.hold));
}

static void a_loss_and_a_good_frame_in_one_sample(void **state)
{
    (void)state;
    rig r;
    const int32_t code[WIDTH] = {4, 4};
    for (int order = 0; order < 2; order++) {
        begin(&r);
        frame(&r, 0, 0, true);
        frame(&r, 0, 0, true);
        step(&r);
        step(&r);
        step(&r);
        if (order == 0) {
            hg_hold_lose(&r.hold);
        }
        assert_status(HG_OK, hg_hold_receive(&r.hold, code, true));
        if (order == 1) {
            hg_hold_lose(&r.hold);
        }
        step(&r);
        assert_int_equal((order == 0) ? 3 : 0, r.rewind);
        assert_real(half_table[0], r.radius[0]);
        assert_int_equal(HG_BUS_LOSSY, hg_hold_health(&r.hold));
        step(&r);
        step(&r);
        step(&r);
        assert_int_equal(order == 0, hg_hold_doubt(&r.hold)); /* a loss after the frame: silence proves nothing */
        assert_real((order == 0) ? R((8.0 * 0.5) + 0.25) : slew(3U, 1U), r.radius[1]);
    }
}

static void a_group_without_signals_only_tells_its_health(void **state)
{
    (void)state;
    const uint8_t quiet = 0U;
    const hg_trigger_config tick = {.width = 0U, .levels = 1U, .interval_max = 1U, .silence = &quiet};
    const hg_hold_config c = {.trigger = &tick, .margin = 1U};
    hg_hold self;
    int32_t codes = CANARY_CODE;
    hg_real none = CANARY;
    uint8_t rewind = 0U;
    assert_status(HG_OK, hg_hold_start(&self, &c, &codes, &none));
    for (int k = 0; k < 20; k++) {
        assert_status(HG_OK, hg_hold_receive(&self, &codes, true));
        hg_hold_step(&self, &none, &none, &rewind);
        assert_int_equal(0, rewind);
        assert_int_equal(HG_BUS_GOOD, hg_hold_health(&self));
    }
    hg_hold_step(&self, &none, &none, &rewind);
    assert_int_equal(HG_BUS_LOSSY, hg_hold_health(&self));
    hg_hold_step(&self, &none, &none, &rewind);
    assert_int_equal(HG_BUS_LOSSY, hg_hold_health(&self));
    hg_hold_step(&self, &none, &none, &rewind);
    assert_int_equal(HG_BUS_STALE, hg_hold_health(&self));
    assert_untouched(&none, 1U);
    assert_codes_untouched(&codes, 1U);
}

#define SAMPLES 20000

/* A sender and its receiver over a link that loses frames unnoticed, damages them, or is dead for a while. Whatever the receiver said of a
 * sample by the time its doubt was settled must contain the true value. */
static void soundness(uint32_t seed, int32_t loss_percent, int32_t damage_percent)
{
    static hg_real truth[SAMPLES][WIDTH];
    static hg_real value[SAMPLES][WIDTH];
    static hg_real radius[SAMPLES][WIDTH];
    uint32_t random = seed;
    hg_trigger sender;
    int32_t sent[WIDTH];
    rig r;
    int32_t step_of[WIDTH] = {0, 0};
    hg_real y[WIDTH] = {R(3), R(7)};
    uint32_t counter = 0U;
    uint32_t last_counter = 0U;
    int outage = 0;
    int unsettled = 0;
    unsigned rewound = 0U;
    unsigned tight = 0U;
    assert_status(HG_OK, hg_trigger_start(&sender, &trigger, sent));
    begin(&r);
    for (int k = 0; k < SAMPLES; k++) {
        int32_t code[WIDTH];
        for (size_t g = 0U; g < WIDTH; g++) {
            /* manoeuvres: long runs in one direction, then rest */
            if ((draw(&random) % 10U) == 0U) {
                step_of[g] = ((draw(&random) % 3U) == 0U) ? 0 : draw_between(&random, -STEP, STEP);
            }
            const hg_real moved = y[g] + (R(step_of[g]) * scale_table[g].resolution * R((double)draw_between(&random, 0, 64) / 64.0));
            y[g] = ((moved > R(90)) || (moved < R(-90))) ? y[g] : moved;
            truth[k][g] = y[g];
            code[g] = hg_code_encode(&scale_table[g], y[g]);
        }
        if ((draw(&random) % 500U) == 0U) {
            outage = draw_between(&random, 1, 12);
        }
        outage -= (outage > 0) ? 1 : 0;
        if (hg_trigger_step(&sender, code) == HG_OK) {
            counter++;
            const int32_t fate = draw_between(&random, 0, 99);
            if ((outage > 0) || (fate < loss_percent)) {
                /* gone, and nobody knows */
            } else if (fate < (loss_percent + damage_percent)) {
                hg_hold_lose(&r.hold);
            } else {
                const bool continues = ((counter - last_counter) % 16U) == 1U;
                assert_status(HG_OK, hg_hold_receive(&r.hold, code, continues));
                last_counter = counter;
            }
        }
        step(&r);
        for (size_t g = 0U; g < WIDTH; g++) {
            value[k][g] = r.value[g];
            radius[k][g] = r.radius[g];
            tight += (r.radius[g] < R(5)) ? 1U : 0U;
        }
        for (uint8_t lag = 1U; lag <= r.rewind; lag++) {
            hg_real past[WIDTH];
            const int then = k - (int)lag;
            hg_hold_past(&r.hold, lag, past);
            for (size_t g = 0U; g < WIDTH; g++) {
                /* never narrower, and what was settled stays as it was */
                assert_true(past[g] >= radius[then][g]);
                assert_true((then >= unsettled) || same_real(past[g], radius[then][g]));
                radius[then][g] = past[g];
            }
            rewound++;
        }
        if (!hg_hold_doubt(&r.hold)) {
            for (; unsettled <= k; unsettled++) {
                for (size_t g = 0U; g < WIDTH; g++) {
                    if (!(fabs((double)truth[unsettled][g] - (double)value[unsettled][g]) <= (double)radius[unsettled][g])) {
                        print_error("seed %lu sample %d channel %d: |%g - %g| > %g\n", (unsigned long)seed, unsettled, (int)g,
                                    (double)truth[unsettled][g], (double)value[unsettled][g], (double)radius[unsettled][g]);
                        fail();
                    }
                }
            }
        }
    }
    /* the test would prove nothing if it never met what it is for */
    assert_true(tight > (SAMPLES / 2U));
    assert_true((rewound > 50U) || ((loss_percent + damage_percent) == 0));
}

static void values_and_radii_contain_the_truth_whatever_is_lost(void **state)
{
    (void)state;
    const uint32_t seed = seed_of_run(21U);
    const int32_t losses[][2] = {{0, 0}, {2, 0}, {10, 0}, {0, 10}, {10, 10}, {30, 10}};
    for (uint32_t i = 0U; i < COUNT(losses); i++) {
        for (uint32_t repeat = 0U; repeat < 3U; repeat++) {
            soundness(seed + (100U * i) + repeat, losses[i][0], losses[i][1]);
        }
    }
}

static void two_holds_do_not_know_of_each_other(void **state)
{
    (void)state;
    rig a;
    rig b;
    begin(&a);
    begin(&b);
    frame(&a, 4, 4, true);
    step(&b);
    assert_int_equal(HG_BUS_ABSENT, hg_hold_health(&b.hold));
    frame(&b, 8, 8, true);
    hg_hold_lose(&b.hold);
    frame(&a, 4, 4, true);
    assert_int_equal(HG_BUS_GOOD, hg_hold_health(&a.hold));
    assert_real(1.0, a.value[0]);
}

/* A bit of the memory that failed: what leads into the tables is within them. */
static void an_age_that_cannot_be_leads_to_no_other_table(void **state)
{
    static const uint8_t ages[] = {0U, INTERVAL + 1U, UINT8_MAX};
    static const int32_t code[WIDTH] = {4, 5};
    (void)state;
    for (size_t i = 0U; i < COUNT(ages); i++) {
        rig r;
        begin(&r);
        assert_status(HG_OK, hg_hold_receive(&r.hold, code, false));
        step(&r);
        assert_status(HG_OK, hg_hold_receive(&r.hold, code, true));
        r.hold.gap = true;
        r.hold.gap_age = ages[i];
        step(&r);
        assert_int_equal(INTERVAL - 1U, r.rewind); /* as far as one can have been lost */
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_tells_null_and_bad_tables),
        cmocka_unit_test(start_tells_numbers_that_are_no_radii),
        cmocka_unit_test(start_tells_a_scale_of_the_other_number_type),
        cmocka_unit_test(an_age_that_cannot_be_leads_to_no_other_table),
        cmocka_unit_test(a_start_leaves_nothing_undefined),
        cmocka_unit_test(a_promise_of_no_threshold_is_the_rounding_alone),
        cmocka_unit_test(a_signal_without_a_value_promises_nothing),
        cmocka_unit_test(before_the_first_frame_nothing_is_known),
        cmocka_unit_test(the_radius_follows_the_table_of_the_header),
        cmocka_unit_test(the_smaller_of_promise_and_slew_counts),
        cmocka_unit_test(while_the_level_is_unknown_the_widest_counts),
        cmocka_unit_test(doubt_stays_until_it_is_settled),
        cmocka_unit_test(a_second_frame_of_one_sample_is_refused),
        cmocka_unit_test(silence_past_the_longest_interval_is_a_loss_and_then_stale),
        cmocka_unit_test(a_frame_at_the_longest_interval_is_in_time),
        cmocka_unit_test(a_gap_in_the_counter_rewinds_to_the_frame_before_it),
        cmocka_unit_test(channels_that_were_invalid_rewind_to_their_span),
        cmocka_unit_test(a_reported_loss_rewinds_at_once_and_trusts_only_the_slew),
        cmocka_unit_test(a_loss_and_a_good_frame_in_one_sample),
        cmocka_unit_test(a_group_without_signals_only_tells_its_health),
        cmocka_unit_test(values_and_radii_contain_the_truth_whatever_is_lost),
        cmocka_unit_test(two_holds_do_not_know_of_each_other),
    };
    return cmocka_run_group_tests(tests, fill_slew, NULL);
}
