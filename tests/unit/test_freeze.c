/** @file
 *  freeze.h: what is recorded around an alarm, what the words of a record say, requests of every kind, and the node that owns it. */
#include "support.h"

#include "hullguard/crc32c.h"
#include "hullguard/freeze.h"
#include "hullguard/node.h"

#include "small_model.h"

#define SAMPLES 6U
#define MANY 60U /* samples of a longer record */
#define AFTER 2U
#define BURST 3U
#define HASH 0x12345678UL
#define REALS HG_FREEZE_REALS(SM_SIGNALS, 2U)
#define ROW (3U + (REALS * HG_REAL_WORDS))
#define WORDS (3U + (SAMPLES * ROW) + 1U)
#define STATE_PLACE 0xFFFFU

static const uint8_t ids[4][HG_E2E_IDS] = {{1U, 1U, 1U, 1U, 1U, 1U, 1U, 1U, 1U, 1U, 1U, 1U, 1U, 1U, 1U, 1U},
                                           {2U, 2U, 2U, 2U, 2U, 2U, 2U, 2U, 2U, 2U, 2U, 2U, 2U, 2U, 2U, 2U},
                                           {3U, 3U, 3U, 3U, 3U, 3U, 3U, 3U, 3U, 3U, 3U, 3U, 3U, 3U, 3U, 3U},
                                           {4U, 4U, 4U, 4U, 4U, 4U, 4U, 4U, 4U, 4U, 4U, 4U, 4U, 4U, 4U, 4U}};
#define P22(list) {.profile = HG_E2E_P22, .data_ids = (list), .crc = 0U, .counter = 8U, .stamp = 12U, .limits = &hg_e2e_limits_default}
static const hg_e2e_config rules[4] = {P22(ids[0]), P22(ids[1]), P22(ids[2]), P22(ids[3])};
static const hg_message request_message = {.id = 0x300U, .length = 8U, .e2e = &rules[0]};
static const hg_message response_message = {.id = 0x301U, .length = 8U, .e2e = &rules[1]};
static const hg_freeze_config usual = {.samples = SAMPLES, .after = AFTER, .burst = BURST, .request = &request_message, .response = &response_message};

typedef struct {
    hg_freeze          self;
    hg_detector        detector;   /* its numbers alone are read */
    hg_detector_config config;
    hg_real            value[SM_SIGNALS], radius[SM_SIGNALS], r[2], J[2];
    hg_freeze_row      row[MANY + 1U];
    hg_real            real[(MANY * REALS) + 1U];
    hg_freeze_memory   memory;
    uint32_t           k;
    uint8_t            counter;
    uint8_t            answers; /* responses so far */
} rig;

static void begin_with(rig *g, const hg_freeze_config *config)
{
    (void)memset(g, 0x5A, sizeof(*g));
    g->config = sm_detector;
    g->detector.config = &g->config;
    g->detector.value = g->value;
    g->detector.radius = g->radius;
    g->detector.r = g->r;
    g->detector.J = g->J;
    arm(g->real, COUNT(g->real));
    g->memory = (hg_freeze_memory){.row = g->row, .real = g->real};
    g->k = 100U;
    g->counter = 0U;
    g->answers = 0U;
    assert_status(HG_OK, hg_freeze_start(&g->self, config, &g->memory, &g->detector, HASH));
}

static void begin(rig *g)
{
    begin_with(g, &usual);
}

/* Numbers that say which they are. */
static hg_real number(uint32_t k, uint32_t place)
{
    return R((16.0 * k) + place + 0.25);
}

static void sample(rig *g, hg_plant plant)
{
    for (uint32_t i = 0U; i < SM_SIGNALS; i++) {
        g->value[i] = number(g->k, i);
        g->radius[i] = number(g->k, SM_SIGNALS + i);
    }
    for (uint32_t i = 0U; i < 2U; i++) {
        g->r[i] = number(g->k, (2U * SM_SIGNALS) + i);
        g->J[i] = number(g->k, (2U * SM_SIGNALS) + 2U + i);
    }
    const hg_freeze_row row = {.k = g->k, .candidates = g->k ^ 0xF0U, .bus = 0x1234U, .plant = plant, .basis = HG_BASIS_SET};
    hg_freeze_step(&g->self, &row);
    assert_untouched(&g->real[g->self.config->samples * REALS], 1U);
    g->k++;
}

static void samples(rig *g, uint32_t count, hg_plant plant)
{
    for (uint32_t i = 0U; i < count; i++) {
        sample(g, plant);
    }
}

static hg_can_frame request_of(rig *g, uint8_t command, uint8_t record, uint32_t first, uint32_t words)
{
    hg_can_frame frame = {.id = request_message.id, .length = 8U};
    frame.data[2] = command;
    frame.data[3] = record;
    frame.data[4] = (uint8_t)(first & 0xFFU);
    frame.data[5] = (uint8_t)(first >> 8U);
    frame.data[6] = (uint8_t)(words & 0xFFU);
    frame.data[7] = (uint8_t)(words >> 8U);
    assert_status(HG_OK, hg_e2e_protect(&rules[0], frame.data, 8U, g->counter, 0U));
    g->counter = (g->counter + 1U) & 0x0FU;
    return frame;
}

static hg_status ask(rig *g, uint8_t command, uint8_t record, uint32_t first, uint32_t words)
{
    const hg_can_frame frame = request_of(g, command, record, first, words);
    return hg_freeze_receive(&g->self, &frame);
}

/* The next response: its place, and its word. Each has its own counter, and nothing stands behind its end. */
static uint32_t response(rig *g, uint32_t *word)
{
    hg_can_frame frame;
    hg_e2e_header header;
    assert_status(HG_OK, hg_freeze_report(&g->self, &frame));
    assert_true((frame.id == 0x301U) && (frame.length == 8U) && (frame.flags == 0U));
    assert_status(HG_OK, hg_e2e_check(&rules[1], frame.data, 8U, &header));
    assert_count((g->k - 1U) & 15U, header.stamp);
    assert_count(g->answers & 15U, header.counter);
    g->answers++;
    for (size_t i = 8U; i < HG_CAN_DATA_MAX; i++) {
        assert_int_equal(0, frame.data[i]);
    }
    *word = frame.data[4] | ((uint32_t)frame.data[5] << 8U) | ((uint32_t)frame.data[6] << 16U) | ((uint32_t)frame.data[7] << 24U);
    return frame.data[2] | ((uint32_t)frame.data[3] << 8U);
}

static void nothing_to_send(rig *g)
{
    hg_can_frame frame;
    assert_status(HG_E_EMPTY, hg_freeze_report(&g->self, &frame));
}

static void state_is(rig *g, hg_freeze_state state, uint32_t missed, uint32_t record, uint32_t words)
{
    uint32_t word;
    assert_count(STATE_PLACE, response(g, &word));
    assert_true(word == ((uint32_t)state | (missed << 2U) | (record << 8U) | (words << 16U)));
}

/* An alarm in a full ring, and all until it can be read. */
static void freeze(rig *g)
{
    samples(g, SAMPLES, HG_PLANT_NONE);
    samples(g, 1U + AFTER, HG_PLANT_CONFIRMED);
    while (g->self.state == HG_FREEZE_CLOSING) {
        sample(g, HG_PLANT_NONE);
    }
    assert_int_equal(HG_FREEZE_FROZEN, g->self.state);
}

/* ---- start ---- */

static hg_status start_with(const hg_freeze_config *config)
{
    rig g;
    begin(&g);
    return hg_freeze_start(&g.self, config, &g.memory, &g.detector, HASH);
}

static void a_start_refuses_what_is_not_there(void **state)
{
    (void)state;
    rig g;
    begin(&g);
    assert_status(HG_E_ARGUMENT, hg_freeze_start(NULL, &usual, &g.memory, &g.detector, HASH));
    assert_status(HG_E_ARGUMENT, hg_freeze_start(&g.self, NULL, &g.memory, &g.detector, HASH));
    assert_status(HG_E_ARGUMENT, hg_freeze_start(&g.self, &usual, NULL, &g.detector, HASH));
    assert_status(HG_E_ARGUMENT, hg_freeze_start(&g.self, &usual, &g.memory, NULL, HASH));
    g.memory.row = NULL;
    assert_status(HG_E_ARGUMENT, hg_freeze_start(&g.self, &usual, &g.memory, &g.detector, HASH));
    g.memory = (hg_freeze_memory){.row = g.row};
    assert_status(HG_E_ARGUMENT, hg_freeze_start(&g.self, &usual, &g.memory, &g.detector, HASH));
}

static void a_start_refuses_numbers_and_messages(void **state)
{
    (void)state;
    hg_freeze_config c = usual;
    c.samples = 0U;
    assert_status(HG_E_CONFIG, start_with(&c));
    c = usual;
    c.after = SAMPLES;
    assert_status(HG_E_CONFIG, start_with(&c));
    c = usual;
    c.burst = 0U;
    assert_status(HG_E_CONFIG, start_with(&c));
    c = usual;
    c.burst = 1U;
    assert_status(HG_OK, start_with(&c));
    const hg_field field = {32U, 16U, HG_FIELD_SIGNED};
    hg_e2e_config other = rules[0];
    hg_message message = request_message;
    for (uint32_t i = 0U; i < 8U; i++) {
        c = usual;
        other = rules[0];
        message = request_message;
        message.e2e = &other;
        message.length = (i == 0U) ? 7U : 8U;
        message.width = (i == 1U) ? 1U : 0U;
        message.field = &field;
        message.scale = sm_scale;
        other.profile = (i == 2U) ? HG_E2E_P02 : HG_E2E_P22;
        other.crc = (i == 3U) ? 2U : 0U;
        other.counter = (i == 4U) ? 16U : 8U;
        other.stamp = (i == 5U) ? 20U : 12U;
        c.request = (i == 6U) ? NULL : ((i == 7U) ? &request_message : &message);
        c.response = (i == 7U) ? &message : &response_message;
        message.length = (i == 7U) ? 9U : message.length; /* no length of a frame */
        assert_status(HG_E_CONFIG, start_with(&c));
    }
    rig g;
    begin(&g);
    g.config.width = 255U;
    g.config.residuals = 300U;
    c = usual;
    c.samples = 255U; /* more words than responses can number */
    assert_status(HG_E_CONFIG, hg_freeze_start(&g.self, &c, &g.memory, &g.detector, HASH));
    c.samples = 1U;
    c.after = 0U;
    const uint32_t most = 65535U - 3U - 1U - 3U; /* of a single sample: without head, checksum, and its own head */
    g.config.residuals = (uint16_t)((most / (2U * HG_REAL_WORDS)) - 255U);
    assert_status(HG_OK, hg_freeze_start(&g.self, &c, &g.memory, &g.detector, HASH));
    g.config.residuals++;
    assert_status(HG_E_CONFIG, hg_freeze_start(&g.self, &c, &g.memory, &g.detector, HASH));
}

/* ---- recording ---- */

static void checksum_is_right(const rig *g)
{
    const uint32_t last = hg_freeze_words(&g->self) - 1U;
    uint32_t crc = 0U;
    for (uint32_t place = 0U; place < last; place++) {
        crc = hg_crc32c(crc, hg_freeze_word(&g->self, place), 4U);
    }
    assert_true(hg_freeze_word(&g->self, last) == crc);
}

static void a_record_holds_what_was_before_and_after_an_alarm(void **state)
{
    (void)state;
    rig g;
    begin(&g);
    samples(&g, 9U, HG_PLANT_NONE);
    const uint32_t alarm = g.k;
    sample(&g, HG_PLANT_CONFIRMED);
    assert_int_equal(HG_FREEZE_CLOSING, g.self.state);
    samples(&g, AFTER, HG_PLANT_CONFIRMED);
    for (uint32_t i = 0U; i < SAMPLES; i++) { /* as many steps of the checksum */
        assert_int_equal(HG_FREEZE_CLOSING, g.self.state);
        sample(&g, HG_PLANT_NONE);
        assert_count((i + 1U) * ROW, g.self.summed); /* of a record of any length as many a sample */
    }
    sample(&g, HG_PLANT_NONE);
    assert_int_equal(HG_FREEZE_FROZEN, g.self.state);
    assert_true(hg_freeze_words(&g.self) == WORDS);
#if HG_REAL_F64
    assert_true(hg_freeze_word(&g.self, 0U) == (0x00010201UL | (SAMPLES << 24U)));
#else
    assert_true(hg_freeze_word(&g.self, 0U) == (0x00010101UL | (SAMPLES << 24U)));
#endif
    assert_true(hg_freeze_word(&g.self, 1U) == HASH);
    assert_true(hg_freeze_word(&g.self, 2U) == (SM_SIGNALS | ((SAMPLES - 1U - AFTER) << 8U) | (2U << 16U)));
    checksum_is_right(&g);
    for (uint32_t i = 0U; i < SAMPLES; i++) {
        const uint32_t k = (alarm + AFTER + 1U + i) - SAMPLES;
        const uint32_t first = 3U + (i * ROW);
        const uint32_t plant = (k >= alarm) ? (uint32_t)HG_PLANT_CONFIRMED : (uint32_t)HG_PLANT_NONE;
        assert_true(hg_freeze_word(&g.self, first) == k);
        assert_true(hg_freeze_word(&g.self, first + 1U) == (plant | ((uint32_t)HG_BASIS_SET << 8U) | 0x12340000UL));
        assert_true(hg_freeze_word(&g.self, first + 2U) == (k ^ 0xF0U));
        for (uint32_t x = 0U; x < (REALS * HG_REAL_WORDS); x++) {
            const uint32_t expected = hg_real_word(number(k, x / HG_REAL_WORDS), (uint8_t)(x % HG_REAL_WORDS));
            assert_true(hg_freeze_word(&g.self, first + 3U + x) == expected);
        }
    }
}

static void an_alarm_before_the_ring_is_full_is_a_short_record(void **state)
{
    (void)state;
    for (uint32_t before = 0U; before < (SAMPLES - 1U - AFTER); before++) {
        rig g;
        const uint32_t held = before + 1U + AFTER;
        begin(&g);
        samples(&g, before, HG_PLANT_NONE);
        samples(&g, 1U + AFTER + held + 1U, HG_PLANT_CONFIRMED);
        assert_int_equal(HG_FREEZE_FROZEN, g.self.state);
        assert_true(hg_freeze_words(&g.self) == (3U + (held * ROW) + 1U));
        assert_true((hg_freeze_word(&g.self, 0U) >> 24U) == held);
        assert_true((hg_freeze_word(&g.self, 2U) >> 8U) == ((2U << 8U) | before)); /* the place of the alarm */
        for (uint32_t i = 0U; i < held; i++) {
            assert_true(hg_freeze_word(&g.self, 3U + (i * ROW)) == (100U + i));
        }
        checksum_is_right(&g);
    }
}

static void nothing_but_a_confirmed_alarm_freezes(void **state)
{
    (void)state;
    rig g;
    begin(&g);
    samples(&g, 3U, HG_PLANT_STARTING);
    samples(&g, 30U, HG_PLANT_PROVISIONAL);
    samples(&g, 30U, HG_PLANT_NONE);
    assert_int_equal(HG_FREEZE_RECORDING, g.self.state);
}

static void a_second_alarm_does_not_overwrite(void **state)
{
    (void)state;
    rig g;
    begin(&g);
    freeze(&g);
    const uint32_t first = hg_freeze_word(&g.self, 3U);
    const uint32_t crc = hg_freeze_word(&g.self, WORDS - 1U);
    for (uint32_t i = 0U; i < 70U; i++) {
        samples(&g, 2U, HG_PLANT_CONFIRMED);
        samples(&g, 2U, HG_PLANT_NONE);
    }
    assert_true((hg_freeze_word(&g.self, 3U) == first) && (hg_freeze_word(&g.self, WORDS - 1U) == crc));
    assert_status(HG_OK, ask(&g, HG_FREEZE_STATE, 0U, 0U, 0U));
    state_is(&g, HG_FREEZE_FROZEN, 63U, 1U, WORDS);
}

/* ---- reading ---- */

static void a_record_is_read_a_few_words_a_sample(void **state)
{
    (void)state;
    rig g;
    uint32_t word;
    begin(&g);
    freeze(&g);
    nothing_to_send(&g);
    assert_status(HG_OK, ask(&g, HG_FREEZE_READ, 1U, 0U, 0U));
    state_is(&g, HG_FREEZE_FROZEN, 0U, 1U, WORDS);
    uint32_t next = 0U;
    uint32_t credit = BURST - 1U;
    while (next < WORDS) {
        for (; (credit > 0U) && (next < WORDS); credit--) {
            assert_count(next, response(&g, &word));
            assert_true(word == hg_freeze_word(&g.self, next));
            next++;
        }
        nothing_to_send(&g);
        sample(&g, HG_PLANT_NONE);
        credit = BURST;
    }
    nothing_to_send(&g);
    assert_status(HG_OK, ask(&g, HG_FREEZE_READ, 1U, 30U, 1U)); /* one that was lost */
    state_is(&g, HG_FREEZE_FROZEN, 0U, 1U, WORDS);
    assert_count(30U, response(&g, &word));
    assert_true(word == hg_freeze_word(&g.self, 30U));
    nothing_to_send(&g);
}

static void a_part_is_read_and_no_more(void **state)
{
    (void)state;
    rig g;
    uint32_t word;
    begin(&g);
    freeze(&g);
    static const uint32_t parts[][3] = {{5U, 2U, 2U}, {WORDS - 2U, 0U, 2U}, {WORDS - 2U, 2U, 2U}, {WORDS - 1U, 9U, 1U}, {0U, 1U, 1U}}; /* first, asked for, given */
    for (size_t i = 0U; i < COUNT(parts); i++) {
        assert_status(HG_OK, ask(&g, HG_FREEZE_READ, 1U, parts[i][0], parts[i][1]));
        state_is(&g, HG_FREEZE_FROZEN, 0U, 1U, WORDS);
        for (uint32_t n = 0U; n < parts[i][2]; n++) {
            assert_count(parts[i][0] + n, response(&g, &word));
        }
        nothing_to_send(&g);
    }
}

/* Place and number of words have two bytes each. */
static void a_part_of_a_long_record_is_read(void **state)
{
    (void)state;
    static rig g;
    hg_freeze_config c = usual;
    uint32_t word;
    c.samples = MANY;
    c.burst = 255U;
    begin_with(&g, &c);
    samples(&g, MANY, HG_PLANT_NONE);
    samples(&g, 1U + AFTER, HG_PLANT_CONFIRMED);
    samples(&g, MANY + 1U, HG_PLANT_NONE);
    const uint32_t words = 3U + (MANY * ROW) + 1U;
    static const uint32_t parts[][2] = {{258U, 5U}, {3U, 260U}, {513U, 257U}}; /* first, and how many */
    for (size_t i = 0U; i < COUNT(parts); i++) {
        assert_status(HG_OK, ask(&g, HG_FREEZE_READ, 1U, parts[i][0], parts[i][1]));
        state_is(&g, HG_FREEZE_FROZEN, 0U, 1U, words);
        for (uint32_t n = 0U; n < parts[i][1]; n++) {
            assert_count(parts[i][0] + n, response(&g, &word));
            assert_true(word == hg_freeze_word(&g.self, parts[i][0] + n));
            if (g.self.credit == 0U) {
                sample(&g, HG_PLANT_NONE);
            }
        }
        nothing_to_send(&g);
    }
    assert_count(0U, g.self.refused);
}

static void what_does_not_fit_the_state_is_answered_and_counted(void **state)
{
    (void)state;
    rig g;
    begin(&g);
    assert_status(HG_E_STATE, ask(&g, HG_FREEZE_READ, 0U, 0U, 0U)); /* nothing there yet */
    sample(&g, HG_PLANT_NONE);
    state_is(&g, HG_FREEZE_RECORDING, 0U, 0U, 0U);
    assert_status(HG_E_STATE, ask(&g, HG_FREEZE_CLEAR, 0U, 0U, 0U));
    state_is(&g, HG_FREEZE_RECORDING, 0U, 0U, 0U);
    samples(&g, SAMPLES, HG_PLANT_NONE);
    sample(&g, HG_PLANT_CONFIRMED);
    assert_status(HG_E_STATE, ask(&g, HG_FREEZE_READ, 1U, 0U, 0U)); /* not yet */
    state_is(&g, HG_FREEZE_CLOSING, 0U, 1U, 0U);
    samples(&g, AFTER + SAMPLES + 1U, HG_PLANT_CONFIRMED);
    assert_status(HG_E_STATE, ask(&g, HG_FREEZE_READ, 2U, 0U, 0U)); /* another record */
    state_is(&g, HG_FREEZE_FROZEN, 0U, 1U, WORDS);
    assert_status(HG_E_STATE, ask(&g, HG_FREEZE_READ, 1U, WORDS, 0U)); /* no such word */
    state_is(&g, HG_FREEZE_FROZEN, 0U, 1U, WORDS);
    assert_status(HG_E_STATE, ask(&g, HG_FREEZE_CLEAR, 0U, 0U, 0U)); /* of a record long gone */
    state_is(&g, HG_FREEZE_FROZEN, 0U, 1U, WORDS);
    assert_count(6U, g.self.refused);
    nothing_to_send(&g);
}

static void a_clear_begins_anew(void **state)
{
    (void)state;
    rig g;
    uint32_t word;
    begin(&g);
    freeze(&g);
    samples(&g, 2U, HG_PLANT_CONFIRMED);
    assert_status(HG_OK, ask(&g, HG_FREEZE_READ, 1U, 0U, 0U));
    state_is(&g, HG_FREEZE_FROZEN, 1U, 1U, WORDS);
    assert_count(0U, response(&g, &word));
    assert_status(HG_OK, ask(&g, HG_FREEZE_CLEAR, 1U, 0U, 0U));
    state_is(&g, HG_FREEZE_RECORDING, 0U, 1U, 0U);
    nothing_to_send(&g); /* the rest of what was asked for is gone */
    assert_status(HG_E_STATE, ask(&g, HG_FREEZE_CLEAR, 1U, 0U, 0U)); /* a double */
    state_is(&g, HG_FREEZE_RECORDING, 0U, 1U, 0U);
    samples(&g, 40U, HG_PLANT_CONFIRMED); /* the same alarm goes on: it was read */
    assert_int_equal(HG_FREEZE_RECORDING, g.self.state);
    freeze(&g);
    assert_true((hg_freeze_word(&g.self, 0U) >> 16U) == ((SAMPLES << 8U) | 2U));
    assert_true(hg_freeze_word(&g.self, 3U) == (100U + SAMPLES + 1U + AFTER + SAMPLES + 1U + 2U + 40U + 1U + AFTER));
}

static void after_a_clear_nothing_from_before_it_is_recorded(void **state)
{
    (void)state;
    rig g;
    begin(&g);
    freeze(&g);
    assert_status(HG_OK, ask(&g, HG_FREEZE_CLEAR, 1U, 0U, 0U));
    state_is(&g, HG_FREEZE_RECORDING, 0U, 1U, 0U);
    const uint32_t k = g.k;
    sample(&g, HG_PLANT_CONFIRMED);
    samples(&g, AFTER + AFTER + 2U, HG_PLANT_CONFIRMED);
    assert_int_equal(HG_FREEZE_FROZEN, g.self.state);
    assert_true(hg_freeze_words(&g.self) == (3U + ((1U + AFTER) * ROW) + 1U));
    assert_true(hg_freeze_word(&g.self, 3U) == k);
    checksum_is_right(&g);
}

static void an_extended_request_is_one(void **state)
{
    (void)state;
    rig g;
    hg_message extended = request_message;
    hg_freeze_config c = usual;
    extended.flags = HG_CAN_EXTENDED;
    c.request = &extended;
    begin_with(&g, &c);
    hg_can_frame frame = request_of(&g, HG_FREEZE_STATE, 0U, 0U, 0U);
    assert_status(HG_E_ID, hg_freeze_receive(&g.self, &frame));
    frame.flags = HG_CAN_EXTENDED;
    assert_status(HG_OK, hg_freeze_receive(&g.self, &frame));
}

static void damaged_and_foreign_frames_are_no_requests(void **state)
{
    (void)state;
    rig g;
    begin(&g);
    const hg_can_frame good = request_of(&g, HG_FREEZE_STATE, 0U, 0U, 0U);
    hg_can_frame frame = good;
    frame.id++;
    assert_status(HG_E_ID, hg_freeze_receive(&g.self, &frame));
    frame = good;
    frame.flags = HG_CAN_EXTENDED;
    assert_status(HG_E_ID, hg_freeze_receive(&g.self, &frame));
    assert_count(0U, g.self.refused);
    frame = good;
    frame.length = 7U;
    assert_status(HG_E_FORMAT, hg_freeze_receive(&g.self, &frame));
    for (size_t bit = 0U; bit < 64U; bit++) {
        frame = good;
        frame.data[bit / 8U] ^= (uint8_t)(1U << (bit % 8U));
        assert_status(HG_E_CRC, hg_freeze_receive(&g.self, &frame));
    }
    assert_status(HG_E_NUMERIC, ask(&g, 0U, 0U, 0U, 0U));
    assert_status(HG_E_NUMERIC, ask(&g, 4U, 0U, 0U, 0U));
    assert_count(67U, g.self.refused);
    nothing_to_send(&g);
    g.self.refused = UINT16_MAX;
    assert_status(HG_E_NUMERIC, ask(&g, 4U, 0U, 0U, 0U));
    assert_count(UINT16_MAX, g.self.refused);
}

/* ---- the node ---- */

static const hg_field fields[2] = {{16U, 16U, HG_FIELD_SIGNED}, {32U, 16U, HG_FIELD_SIGNED}};
static const hg_message messages[SM_GROUPS] = {
    {.id = 0x101U, .length = 6U, .width = 2U, .field = fields, .scale = sm_scale, .e2e = &rules[2]},
    {.id = 0x110U, .length = 4U, .width = 1U, .field = fields, .scale = sm_scale, .e2e = &rules[3]}};
static const hg_message verdict_message = {.id = 0x200U, .length = 8U, .e2e = &rules[2]};
static const hg_message status_message = {.id = 0x201U, .length = 8U, .e2e = &rules[3]};
static const hg_node_config node_config = {.detector = &sm_detector, .message = messages, .closing = 1U, .verdict = &verdict_message, .status = &status_message,
                                           .heartbeat = 5U, .model_hash = HASH, .freeze = &usual};

typedef struct {
    hg_node        node;
    sm_storage     storage;
    hg_link        link[SM_GROUPS];
    int32_t        closing[2];
    hg_freeze      freeze;
    hg_freeze_row  row[SAMPLES];
    hg_real        real[SAMPLES * REALS];
    hg_node_memory memory;
} whole;

static void close_samples(whole *w, uint32_t first, uint32_t count, int32_t code)
{
    for (uint32_t k = first; k < (first + count); k++) {
        const int32_t codes[2] = {code, 0};
        hg_can_frame frame;
        hg_verdict verdict;
        for (uint8_t i = 0U; i < SM_GROUPS; i++) {
            const int32_t none[2] = {0, 0};
            hg_frame_pack(&messages[i], (i == 0U) ? codes : none, &frame);
            assert_status(HG_OK, hg_e2e_protect(messages[i].e2e, frame.data, frame.length, (uint8_t)(k & 15U), (uint8_t)(k & 15U)));
            (void)hg_node_receive(&w->node, &frame);
        }
        assert_status(HG_OK, hg_node_step(&w->node, &verdict));
        assert_true(verdict.k == k);
    }
}

static void a_node_freezes_what_its_detector_knew(void **state)
{
    (void)state;
    static whole w;
    rig g = {.k = 0U, .counter = 0U};
    hg_can_frame frame;
    w.memory = (hg_node_memory){.detector = sm_memory(&w.storage), .link = w.link, .closing = w.closing, .frozen = {.row = w.row, .real = w.real}};
    assert_status(HG_E_ARGUMENT, hg_node_start(&w.node, &node_config, &w.memory, HG_START_REST)); /* no room for it */
    w.memory.freeze = &w.freeze;
    assert_status(HG_OK, hg_node_start(&w.node, &node_config, &w.memory, HG_START_REST));
    close_samples(&w, 0U, 20U, 0);
    close_samples(&w, 20U, 1U, 2000);
    assert_int_equal(HG_FREEZE_CLOSING, w.freeze.state);
    assert_real(2000.0 * SM_RESOLUTION, w.node.detector.value[0]);
    const hg_real r = w.node.detector.r[0];
    close_samples(&w, 21U, 20U, 0);
    frame = request_of(&g, HG_FREEZE_READ, 1U, 3U + ((SAMPLES - 1U - AFTER) * ROW) + 3U + (2U * SM_SIGNALS * HG_REAL_WORDS), 1U);
    assert_status(HG_OK, hg_node_receive(&w.node, &frame));
    assert_count(0U, w.node.unknown);
    assert_status(HG_OK, hg_node_freeze(&w.node, &frame)); /* the state, and then */
    assert_status(HG_OK, hg_node_freeze(&w.node, &frame));
    assert_true((frame.data[4] | ((uint32_t)frame.data[5] << 8U) | ((uint32_t)frame.data[6] << 16U) | ((uint32_t)frame.data[7] << 24U)) == hg_real_word(r, 0U));
    assert_status(HG_E_EMPTY, hg_node_freeze(&w.node, &frame));
    frame.id = 0x400U;
    assert_status(HG_E_ID, hg_node_receive(&w.node, &frame));
    assert_count(1U, w.node.unknown);
}

static void a_node_without_one_knows_no_requests(void **state)
{
    (void)state;
    static whole w;
    rig g = {.k = 0U, .counter = 0U};
    hg_node_config config = node_config;
    config.freeze = NULL;
    w.memory = (hg_node_memory){.detector = sm_memory(&w.storage), .link = w.link, .closing = w.closing};
    assert_status(HG_OK, hg_node_start(&w.node, &config, &w.memory, HG_START_REST));
    hg_can_frame frame = request_of(&g, HG_FREEZE_STATE, 0U, 0U, 0U);
    assert_status(HG_E_ID, hg_node_receive(&w.node, &frame));
    assert_count(1U, w.node.unknown);
    close_samples(&w, 0U, 3U, 0);
    assert_status(HG_E_EMPTY, hg_node_freeze(&w.node, &frame));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_start_refuses_what_is_not_there),
        cmocka_unit_test(a_start_refuses_numbers_and_messages),
        cmocka_unit_test(a_record_holds_what_was_before_and_after_an_alarm),
        cmocka_unit_test(an_alarm_before_the_ring_is_full_is_a_short_record),
        cmocka_unit_test(nothing_but_a_confirmed_alarm_freezes),
        cmocka_unit_test(a_second_alarm_does_not_overwrite),
        cmocka_unit_test(a_record_is_read_a_few_words_a_sample),
        cmocka_unit_test(a_part_is_read_and_no_more),
        cmocka_unit_test(a_part_of_a_long_record_is_read),
        cmocka_unit_test(what_does_not_fit_the_state_is_answered_and_counted),
        cmocka_unit_test(a_clear_begins_anew),
        cmocka_unit_test(after_a_clear_nothing_from_before_it_is_recorded),
        cmocka_unit_test(an_extended_request_is_one),
        cmocka_unit_test(damaged_and_foreign_frames_are_no_requests),
        cmocka_unit_test(a_node_freezes_what_its_detector_knew),
        cmocka_unit_test(a_node_without_one_knows_no_requests),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
