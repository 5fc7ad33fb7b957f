/** @file
 *  node.h: frames to samples, verdicts to frames, and the inbox between interrupt and main loop. */
#include "support.h"

#include "hullguard/node.h"

#include "small_plant.h"

#define HEARTBEAT 5U
#define HASH 0x89ABCDEFUL

static const uint8_t ids[4][HG_E2E_IDS] = {
    {0x11U, 0x11U, 0x11U, 0x11U, 0x11U, 0x11U, 0x11U, 0x11U, 0x11U, 0x11U, 0x11U, 0x11U, 0x11U, 0x11U, 0x11U, 0x11U},
    {0x22U, 0x22U, 0x22U, 0x22U, 0x22U, 0x22U, 0x22U, 0x22U, 0x22U, 0x22U, 0x22U, 0x22U, 0x22U, 0x22U, 0x22U, 0x22U},
    {0x33U, 0x33U, 0x33U, 0x33U, 0x33U, 0x33U, 0x33U, 0x33U, 0x33U, 0x33U, 0x33U, 0x33U, 0x33U, 0x33U, 0x33U, 0x33U},
    {0x44U, 0x44U, 0x44U, 0x44U, 0x44U, 0x44U, 0x44U, 0x44U, 0x44U, 0x44U, 0x44U, 0x44U, 0x44U, 0x44U, 0x44U, 0x44U}};
#define P22(list) {.profile = HG_E2E_P22, .data_ids = (list), .crc = 0U, .counter = 8U, .stamp = 12U, .limits = &hg_e2e_limits_default}
static const hg_e2e_config rules[4] = {P22(ids[0]), P22(ids[1]), P22(ids[2]), P22(ids[3])};
static const hg_field fields[2] = {{16U, 16U, HG_FIELD_SIGNED}, {32U, 16U, HG_FIELD_SIGNED}};
static const hg_message messages[SM_GROUPS] = {
    {.id = 0x101U, .length = 6U, .width = 2U, .field = fields, .scale = sm_scale, .e2e = &rules[0]},
    {.id = 0x110U, .length = 4U, .width = 1U, .field = fields, .scale = sm_scale, .e2e = &rules[1]}};
static const hg_message verdict_message = {.id = 0x200U, .length = 8U, .e2e = &rules[2]};
static const hg_message wide_message = {.id = 0x200U, .flags = HG_CAN_FD | HG_CAN_BRS, .length = 12U, .e2e = &rules[2]};
static const hg_message status_message = {.id = 0x201U, .length = 8U, .e2e = &rules[3]};
static const hg_node_config usual = {.detector = &sm_detector, .message = messages, .closing = 1U, .verdict = &verdict_message,
                                     .status = &status_message, .heartbeat = HEARTBEAT, .model_hash = HASH};

typedef struct {
    hg_node        self;
    sm_storage     storage;
    hg_link        link[SM_GROUPS];
    int32_t        closing[2];
    hg_node_memory memory;
    hg_verdict     verdict;
    uint8_t        counter[SM_GROUPS];
} rig;

static void begin_with(rig *r, const hg_node_config *config, hg_start how)
{
    (void)memset(r, 0x5A, sizeof(*r));
    arm_codes(r->closing, 2U);
    r->memory = (hg_node_memory){.detector = sm_memory(&r->storage), .link = r->link, .closing = r->closing};
    r->counter[0] = 7U;
    r->counter[1] = 11U;
    assert_status(HG_OK, hg_node_start(&r->self, config, &r->memory, how));
}

static void begin(rig *r, hg_start how)
{
    begin_with(r, &usual, how);
}

/* At rest, with checks of the first group off. */
static void begin_ignoring(rig *r, uint8_t ignore)
{
    static hg_e2e_config careless;
    static hg_message loose[SM_GROUPS];
    static hg_node_config config;
    careless = rules[0];
    careless.ignore = ignore;
    (void)memcpy(loose, messages, sizeof(loose));
    loose[0].e2e = &careless;
    config = usual;
    config.message = loose;
    begin_with(r, &config, HG_START_REST);
}

/* The checksum that a frame ought to have. */
static uint8_t crc_of(uint8_t rule, const uint8_t *data, uint8_t length)
{
    uint8_t copy[HG_CAN_DATA_MAX];
    (void)memcpy(copy, data, length);
    assert_status(HG_OK, hg_e2e_protect(&rules[rule], copy, length, data[1] & 15U, data[1] >> 4U));
    return copy[0];
}

static hg_can_frame frame_of(rig *r, uint8_t group, uint32_t k, int32_t a, int32_t b)
{
    const int32_t code[2] = {a, b};
    hg_can_frame frame;
    hg_frame_pack(&messages[group], code, &frame);
    assert_status(HG_OK, hg_e2e_protect(messages[group].e2e, frame.data, frame.length, r->counter[group], (uint8_t)(k & 15U)));
    r->counter[group]++;
    return frame;
}

static hg_status give(rig *r, uint8_t group, uint32_t k, int32_t a, int32_t b)
{
    const hg_can_frame frame = frame_of(r, group, k, a, b);
    return hg_node_receive(&r->self, &frame);
}

static void step(rig *r, uint32_t k)
{
    (void)memset(&r->verdict, 0x5A, sizeof(r->verdict));
    assert_status(HG_OK, hg_node_step(&r->self, &r->verdict));
    assert_true(r->verdict.k == k);
    assert_true(r->verdict.model_hash == HASH);
    assert_int_equal(HG_BASIS_SET, r->verdict.basis);
    sm_check_canaries(&r->storage);
    assert_codes_untouched(&r->closing[1], 1U);
}

static void nothing_is_due(rig *r)
{
    const hg_node before = r->self;
    arm_codes((int32_t *)&r->verdict.k, 1U);
    assert_status(HG_E_EMPTY, hg_node_step(&r->self, &r->verdict));
    assert_true(r->verdict.k == (uint32_t)CANARY_CODE);
    assert_memory_equal(&before, &r->self, sizeof(before));
}

/* A whole good sample of both groups. */
static void sample(rig *r, uint32_t k, int32_t a, int32_t b, int32_t c)
{
    assert_status(HG_OK, give(r, 0U, k, a, b));
    nothing_is_due(r);
    assert_status(HG_OK, give(r, 1U, k, c, 0));
    step(r, k);
    nothing_is_due(r);
}

static unsigned bus(const rig *r, uint8_t group)
{
    return ((unsigned)r->verdict.bus >> (2U * group)) & 3U;
}

/* ---- sender ---- */

static void a_sender_refuses_null_and_contradictions(void **state)
{
    (void)state;
    hg_sender self;
    int32_t codes[4];
    const hg_sender_config good = {.message = &messages[0], .trigger = &sm_trigger_a};
    const hg_sender_config no_message = {.message = NULL, .trigger = &sm_trigger_a};
    const hg_sender_config no_trigger = {.message = &messages[0], .trigger = NULL};
    assert_status(HG_E_ARGUMENT, hg_sender_start(NULL, &good, codes));
    assert_status(HG_E_ARGUMENT, hg_sender_start(&self, NULL, codes));
    assert_status(HG_E_ARGUMENT, hg_sender_start(&self, &good, NULL));
    assert_status(HG_E_ARGUMENT, hg_sender_start(&self, &no_message, codes));
    assert_status(HG_E_ARGUMENT, hg_sender_start(&self, &no_trigger, codes));
    hg_message broken = messages[0];
    broken.length = 5U;
    hg_trigger_config dumb = sm_trigger_a;
    dumb.levels = 0U;
    const hg_sender_config c[] = {
        {.message = &broken, .trigger = &sm_trigger_a}, {.message = &messages[1], .trigger = &sm_trigger_a}, {.message = &messages[0],
            .trigger = &dumb}};
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_status(HG_E_CONFIG, hg_sender_start(&self, &c[i], codes));
    }
}

/* Every signal is coded by its own scale. */
static void a_sender_sends_each_signal_by_its_own_scale(void **state)
{
    (void)state;
    hg_sender self;
    int32_t codes[(2U * 2U) + 1U];
    hg_can_frame frame;
    int32_t code[2];
    const hg_code_scale scale[2] = {sm_scale[0], {R(0.5), R(10), R(2), 0, -SM_LIMIT, SM_LIMIT}};
    hg_message message = messages[0];
    message.scale = scale;
    const hg_sender_config c = {.message = &message, .trigger = &sm_trigger_a};
    const hg_real value[2] = {R(1), R(20)};
    arm_codes(codes, COUNT(codes));
    assert_status(HG_OK, hg_sender_start(&self, &c, codes));
    assert_status(HG_OK, hg_sender_step(&self, 0U, value, &frame));
    assert_status(HG_OK, hg_frame_unpack(&message, &frame, code));
    assert_int_equal(64, code[0]);
    assert_int_equal(20, code[1]);
    assert_codes_untouched(&codes[2U * 2U], 1U);
}

static void a_sender_stamps_counts_and_protects_what_it_sends(void **state)
{
    (void)state;
    hg_sender self;
    int32_t codes[3] = {0, 0, CANARY_CODE};
    const hg_sender_config c = {.message = &messages[1], .trigger = &sm_trigger_b};
    assert_status(HG_OK, hg_sender_start(&self, &c, codes));
    for (uint32_t k = 100U; k < 200U; k++) {
        hg_can_frame frame;
        int32_t code = CANARY_CODE;
        const hg_real value = R((double)k * SM_RESOLUTION);
        (void)memset(&frame, 0x5A, sizeof(frame));
        assert_status(HG_OK, hg_sender_step(&self, k, &value, &frame));
        assert_int_equal((int)((k - 100U) & 15U), frame.data[1] & 15);
        assert_int_equal((int)(k & 15U), frame.data[1] >> 4);
        assert_int_equal(crc_of(1U, frame.data, 4U), frame.data[0]);
        assert_status(HG_OK, hg_frame_unpack(&messages[1], &frame, &code));
        assert_count(k, code);
    }
    assert_codes_untouched(&codes[2], 1U);
}

static void a_silent_sender_leaves_the_frame_and_its_counter_alone(void **state)
{
    (void)state;
    hg_sender self;
    int32_t codes[4];
    const hg_sender_config c = {.message = &messages[0], .trigger = &sm_trigger_a};
    const hg_real value[2] = {R(1), R(2)};
    hg_can_frame frame;
    hg_can_frame before;
    assert_status(HG_OK, hg_sender_start(&self, &c, codes));
    assert_status(HG_OK, hg_sender_step(&self, 0U, value, &frame));
    (void)memset(&frame, 0x5A, sizeof(frame));
    before = frame;
    for (uint32_t k = 1U; k < 4U; k++) {
        assert_status(HG_E_EMPTY, hg_sender_step(&self, k, value, &frame));
        assert_memory_equal(&before, &frame, sizeof(frame));
    }
    assert_status(HG_OK, hg_sender_step(&self, 4U, value, &frame));
    assert_int_equal(0x41, frame.data[1]);
}

static void what_cannot_be_sent_goes_out_as_invalid(void **state)
{
    (void)state;
    const hg_real bad[] = {REAL_NAN, REAL_INF, -REAL_INF, R(47.0), R(-47.0), HG_REAL_MAX};
    hg_sender self;
    int32_t codes[2];
    const hg_sender_config c = {.message = &messages[1], .trigger = &sm_trigger_b};
    assert_status(HG_OK, hg_sender_start(&self, &c, codes));
    for (size_t i = 0U; i < COUNT(bad); i++) {
        hg_can_frame frame;
        assert_status(HG_OK, hg_sender_step(&self, 0U, &bad[i], &frame));
        assert_int_equal(0x00, frame.data[2]);
        assert_int_equal(0x80, frame.data[3]);
    }
}

/* ---- start ---- */

static void a_node_refuses_null(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    assert_status(HG_E_ARGUMENT, hg_node_start(NULL, &usual, &r.memory, HG_START_REST));
    assert_status(HG_E_ARGUMENT, hg_node_start(&r.self, NULL, &r.memory, HG_START_REST));
    assert_status(HG_E_ARGUMENT, hg_node_start(&r.self, &usual, NULL, HG_START_REST));
    hg_node_memory m[4] = {r.memory, r.memory, r.memory, r.memory};
    m[0].link = NULL;
    m[1].closing = NULL;
    m[2].detector.real = NULL;
    m[3].detector.alarm = NULL;
    for (size_t i = 0U; i < COUNT(m); i++) {
        assert_status(HG_E_ARGUMENT, hg_node_start(&r.self, &usual, &m[i], HG_START_REST));
    }
    hg_node_memory shorter = r.memory;
    shorter.detector.codes--;
    assert_status(HG_E_SIZE, hg_node_start(&r.self, &usual, &shorter, HG_START_REST));
    shorter = r.memory;
    shorter.detector.reals--;
    assert_status(HG_E_SIZE, hg_node_start(&r.self, &usual, &shorter, HG_START_REST));
}

static void a_node_refuses_contradictions(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    hg_message broken = verdict_message;
    broken.e2e = NULL;
    hg_message seven = verdict_message;
    seven.length = 7U;
    hg_message with_field = {.id = 0x200U, .length = 8U, .width = 1U, .field = fields, .scale = sm_scale, .e2e = &rules[2]};
    hg_message swapped[SM_GROUPS] = {messages[1], messages[0]};
    hg_message damaged[SM_GROUPS] = {messages[0], messages[1]};
    damaged[1].length = 3U;
    hg_hold_config hold[SM_GROUPS] = {sm_hold[0], sm_hold[1]};
    hold[1].trigger = NULL;
    hg_detector_config d[5] = {sm_detector, sm_detector, sm_detector, sm_detector, sm_detector};
    d[0].groups = (uint8_t)(HG_GROUPS_MAX + 1U);
    d[1].hold = NULL;
    d[2].hold = hold;
    d[3].generators = 0U;
    d[4].groups = 1U;
    hg_node_config c[20];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = usual;
    }
    c[0].detector = NULL;
    c[1].message = NULL;
    c[2].verdict = NULL;
    c[3].status = NULL;
    c[4].heartbeat = 0U;
    c[5].verdict = &broken;
    c[6].status = &broken;
    c[7].verdict = &seven;
    c[8].status = &seven;
    c[9].verdict = &with_field;
    c[10].status = &with_field;
    c[11].closing = SM_GROUPS;
    c[12].closing = 255U;
    c[13].message = swapped;
    c[14].message = damaged;
    for (size_t i = 0U; i < COUNT(d); i++) {
        c[15U + i].detector = &d[i];
    }
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_status(HG_E_CONFIG, hg_node_start(&r.self, &c[i], &r.memory, HG_START_REST));
    }
    assert_status(HG_OK, hg_node_start(&r.self, &usual, &r.memory, HG_START_REST));
}

/* The node's own frames begin as frame.h draws them, and the closing frame has a counter. */
static void a_node_refuses_other_headers_of_its_own(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    hg_e2e_config other[4] = {rules[2], rules[2], rules[2], rules[2]};
    other[0].profile = HG_E2E_P02;
    other[1].crc = 7U;
    other[2].counter = 16U;
    other[3].stamp = HG_E2E_NO_STAMP;
    for (size_t i = 0U; i < COUNT(other); i++) {
        hg_message message = verdict_message;
        hg_node_config c[2] = {usual, usual};
        message.e2e = &other[i];
        c[0].verdict = &message;
        c[1].status = &message;
        assert_status(HG_E_CONFIG, hg_node_start(&r.self, &c[0], &r.memory, HG_START_REST));
        assert_status(HG_E_CONFIG, hg_node_start(&r.self, &c[1], &r.memory, HG_START_REST));
    }
    hg_e2e_config uncounted[2] = {rules[1], rules[1]};
    uncounted[0].profile = HG_E2E_NONE;
    uncounted[1].ignore = HG_E2E_IGNORE_COUNTER;
    for (size_t i = 0U; i < COUNT(uncounted); i++) {
        hg_message message[SM_GROUPS] = {messages[0], messages[1]};
        hg_node_config c = usual;
        c.message = message;
        message[0].e2e = &uncounted[i];
        assert_status(HG_OK, hg_node_start(&r.self, &c, &r.memory, HG_START_REST));
        message[1].e2e = &uncounted[i];
        assert_status(HG_E_CONFIG, hg_node_start(&r.self, &c, &r.memory, HG_START_REST));
    }
}

/* ---- frames into a node ---- */

static void samples_follow_one_another_and_the_index_wraps(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    for (uint32_t k = 0U; k < 40U; k++) {
        sample(&r, k, 10, 20, 10);
        assert_int_equal(HG_PLANT_NONE, r.verdict.plant);
        assert_int_equal(HG_BUS_GOOD, bus(&r, 0U));
        assert_int_equal(HG_BUS_GOOD, bus(&r, 1U));
        assert_int_equal(0, r.verdict.bus >> 4U);
        assert_false(r.verdict.refused);
    }
    r.self.k = UINT32_MAX - 19U; /* ... 0xFFFFFFEC: four short of a multiple of 16 */
    r.link[0].k = r.self.k - 1U;
    r.self.closing_k = r.self.k - 1U;
    for (uint32_t i = 0U; i < 40U; i++) {
        sample(&r, UINT32_MAX - 19U + i, 10, 20, 10);
    }
    const hg_link_health *health = hg_node_health(&r.self, 0U);
    assert_int_equal(80, health->good);
    assert_int_equal(0, health->lost + health->crc + health->format + health->repeated + health->early + health->late +
        health->sequence + health->untrusted + health->numeric + health->invalid);
    assert_count(0, r.self.unknown);
    assert_count(0, r.self.overdue);
}

static void foreign_frames_are_not_ours(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    hg_can_frame frame = frame_of(&r, 0U, 0U, 0, 0);
    frame.id = 0x102U;
    assert_status(HG_E_ID, hg_node_receive(&r.self, &frame));
    frame.id = 0x200U; /* our own verdict */
    assert_status(HG_E_ID, hg_node_receive(&r.self, &frame));
    frame.id = 0x101U;
    frame.flags = HG_CAN_EXTENDED; /* the twin with 29 bits */
    assert_status(HG_E_ID, hg_node_receive(&r.self, &frame));
    assert_count(3, r.self.unknown);
    r.self.unknown = UINT32_MAX;
    assert_status(HG_E_ID, hg_node_receive(&r.self, &frame));
    assert_true(r.self.unknown == UINT32_MAX);
    sample(&r, 0U, 0, 0, 0);
    assert_int_equal(HG_BUS_GOOD, bus(&r, 0U));
}

static void a_frame_of_wrong_kind_or_length_is_refused_and_counts_as_lost(void **state)
{
    (void)state;
    static rig r;
    const uint8_t kinds[] = {HG_CAN_REMOTE, HG_CAN_FD, HG_CAN_ERROR};
    uint16_t count = 0U;
    begin(&r, HG_START_REST);
    sample(&r, 0U, 0, 0, 0);
    for (uint32_t i = 0U; i < (COUNT(kinds) + 70U); i++) {
        hg_can_frame frame = frame_of(&r, 0U, 1U, 0, 0);
        r.counter[0]--;
        if (i < COUNT(kinds)) {
            frame.flags = kinds[i];
        } else {
            frame.length = (uint8_t)(i - COUNT(kinds));
        }
        if (frame.length == 6U && frame.flags == 0U) {
            continue;
        }
        assert_status(HG_E_FORMAT, hg_node_receive(&r.self, &frame));
        count++;
        assert_int_equal(count, hg_node_health(&r.self, 0U)->format);
    }
    sample(&r, 1U, 0, 0, 0);
    assert_int_equal(HG_BUS_LOSSY, bus(&r, 0U));
    assert_int_equal(HG_BUS_GOOD, bus(&r, 1U));
    sample(&r, 2U, 0, 0, 0);
    assert_int_equal(HG_BUS_GOOD, bus(&r, 0U));
}

static void a_damaged_frame_is_refused_and_counts_as_lost(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    sample(&r, 0U, 0, 0, 0);
    for (uint8_t group = 0U; group < SM_GROUPS; group++) {
        hg_can_frame frame = frame_of(&r, group, 1U, 0, 0);
        r.counter[group]--;
        for (unsigned bit = 0U; bit < (8U * (unsigned)frame.length); bit++) {
            hg_can_frame bad = frame;
            bad.data[bit / 8U] ^= (uint8_t)(1U << (bit % 8U));
            assert_status(HG_E_CRC, hg_node_receive(&r.self, &bad));
        }
        assert_int_equal(8 * frame.length, hg_node_health(&r.self, group)->crc);
    }
    /* Windows of 8 events, left with at most 2 damaged ones: 4 good frames and an expired deadline (interval 4) do not do; 3 good frames and as many
       expired deadlines (interval 1) do. What closes the samples tells the time all the while. */
    for (uint32_t k = 1U; k <= 4U; k++) {
        assert_status(HG_E_STATE, give(&r, 0U, k, 0, 0));
        assert_status((k < 4U) ? HG_E_STATE : HG_OK, give(&r, 1U, k, 0, 0));
        step(&r, k);
        assert_int_equal(k, hg_node_health(&r.self, 0U)->untrusted);
        assert_int_equal((k < 4U) ? k : 3U, hg_node_health(&r.self, 1U)->untrusted);
        assert_real((k < 4U) ? SM_SLEW(k) : R(SM_HALF), r.self.detector.radius[2]);
    }
    assert_int_equal(HG_E2E_INVALID, r.link[0].machine.state);
    sample(&r, 5U, 0, 0, 0);
    assert_int_equal(HG_E2E_VALID, r.link[0].machine.state);
    assert_int_equal(HG_BUS_LOSSY, bus(&r, 0U));
    sample(&r, 6U, 0, 0, 0);
    assert_int_equal(HG_BUS_GOOD, bus(&r, 0U));
}

/* The same link with the check of the state off: every good frame is booked. */
static void a_link_may_be_trusted_whatever_came_before(void **state)
{
    (void)state;
    static rig r;
    begin_ignoring(&r, HG_E2E_IGNORE_STATE);
    sample(&r, 0U, 0, 0, 0);
    for (unsigned i = 0U; i < 20U; i++) {
        hg_can_frame bad = frame_of(&r, 0U, 1U, 0, 0);
        r.counter[0]--;
        bad.data[0] ^= 1U;
        assert_status(HG_E_CRC, hg_node_receive(&r.self, &bad));
    }
    sample(&r, 1U, 0, 0, 0);
    assert_int_equal(HG_E2E_INVALID, r.link[0].machine.state);
    assert_int_equal(0, hg_node_health(&r.self, 0U)->untrusted);
}

/* Silence is an event of the link at every expired deadline, and at no other time: 4 samples here, windows of 8. */
static void a_silent_link_falls_by_its_deadline(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    sample(&r, 0U, 0, 0, 0);
    sample(&r, 1U, 0, 0, 0);
    assert_int_equal(HG_E2E_VALID, r.link[0].machine.state);
    for (uint32_t k = 2U; k < 2U + 40U; k++) {
        assert_status(HG_OK, give(&r, 1U, k, 0, 0));
        step(&r, k);
        /* two good frames are among the last 8 events until the seventh deadline, one at the seventh, none at the eighth */
        assert_int_equal((k < 1U + (4U * 8U)) ? HG_E2E_VALID : HG_E2E_INVALID, r.link[0].machine.state);
    }
}

static void a_duplicate_is_counted_and_harmless(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    for (uint32_t k = 0U; k < 40U; k++) {
        const hg_can_frame a = frame_of(&r, 0U, k, 1, 2);
        const hg_can_frame b = frame_of(&r, 1U, k, 1, 0);
        assert_status(HG_OK, hg_node_receive(&r.self, &a));
        assert_status(HG_E_REPEATED, hg_node_receive(&r.self, &a));
        assert_status(HG_OK, hg_node_receive(&r.self, &b));
        assert_status(HG_E_BUSY, hg_node_receive(&r.self, &b));
        step(&r, k);
        assert_status(HG_E_REPEATED, hg_node_receive(&r.self, &b));
        assert_status(HG_E_REPEATED, hg_node_receive(&r.self, &a));
        assert_int_equal(HG_BUS_GOOD, bus(&r, 0U));
        assert_int_equal(HG_BUS_GOOD, bus(&r, 1U));
        nothing_is_due(&r);
    }
    assert_int_equal(80, hg_node_health(&r.self, 0U)->repeated);
    assert_int_equal(40, hg_node_health(&r.self, 1U)->repeated);
    assert_int_equal(0, hg_node_health(&r.self, 0U)->lost);
}

static void a_second_frame_of_one_sample_is_no_duplicate_but_a_loss(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    sample(&r, 0U, 0, 0, 0);
    assert_status(HG_OK, give(&r, 0U, 1U, 10, 10));
    assert_status(HG_E_SEQUENCE, give(&r, 0U, 1U, 20, 20)); /* its counter moved on within a sample: its sender now goes by these codes */
    assert_int_equal(1, hg_node_health(&r.self, 0U)->sequence);
    assert_status(HG_OK, give(&r, 1U, 1U, 0, 0));
    step(&r, 1U);
    assert_int_equal(HG_BUS_LOSSY, bus(&r, 0U));
    assert_status(HG_OK, give(&r, 1U, 2U, 0, 0));
    step(&r, 2U);
    assert_status(HG_OK, give(&r, 1U, 3U, 0, 0));
    step(&r, 3U);
    assert_real(SM_SLEW(2), r.self.detector.radius[0]); /* silence proves nothing */
}

static void a_measurement_of_another_sample_is_never_booked(void **state)
{
    (void)state;
    for (uint32_t ahead = 1U; ahead < 16U; ahead++) {
        static rig r;
        begin(&r, HG_START_REST);
        for (uint32_t k = 0U; k < 20U; k++) {
            sample(&r, k, 0, 0, 0);
        }
        assert_status(HG_E_STAMP, give(&r, 0U, 20U + ahead, 500, 500));
        assert_int_equal((ahead <= 7U) ? 1 : 0, hg_node_health(&r.self, 0U)->early);
        assert_int_equal((ahead <= 7U) ? 0 : 1, hg_node_health(&r.self, 0U)->late);
        assert_int_equal(20, hg_node_health(&r.self, 0U)->good);
        assert_status(HG_OK, give(&r, 1U, 20U, 0, 0));
        step(&r, 20U);
        assert_real(0.0, r.self.detector.value[0]);
        assert_int_equal(HG_BUS_LOSSY, bus(&r, 0U));
        assert_real(SM_SLEW(1), r.self.detector.radius[0]);
    }
}

/* Whatever its stamp says, with that check off it is of the sample that is open. */
static void a_stamp_may_be_ignored(void **state)
{
    (void)state;
    static rig r;
    begin_ignoring(&r, HG_E2E_IGNORE_STAMP);
    for (uint32_t k = 0U; k < 40U; k++) {
        assert_status(HG_OK, give(&r, 0U, 5U * k, 10, 10));
        assert_status(HG_OK, give(&r, 1U, k, 10, 0));
        step(&r, k);
        assert_int_equal(HG_BUS_GOOD, bus(&r, 0U));
    }
}

/* Samples of the closing frame alone. */
static void ticks(rig *r, uint32_t from, uint32_t to)
{
    for (uint32_t k = from; k < to; k++) {
        assert_status(HG_OK, give(r, 1U, k, 0, 0));
        step(r, k);
    }
}

static void lost_frames_are_counted_by_the_sequence(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    sample(&r, 0U, 0, 0, 0);
    ticks(&r, 1U, 4U);
    r.counter[0] = (uint8_t)(r.counter[0] + 3U);
    sample(&r, 4U, 0, 0, 0);
    assert_int_equal(3, hg_node_health(&r.self, 0U)->lost);
    assert_int_equal(HG_BUS_LOSSY, bus(&r, 0U));
    sample(&r, 5U, 0, 0, 0);
    assert_int_equal(HG_BUS_GOOD, bus(&r, 0U));
    r.link[0].health.lost = UINT16_MAX - 1U;
    ticks(&r, 6U, 20U);
    r.counter[0] = (uint8_t)(r.counter[0] + 14U);
    sample(&r, 20U, 0, 0, 0);
    assert_int_equal(UINT16_MAX, hg_node_health(&r.self, 0U)->lost);
}

/* A counter cannot move further than the sender can have spoken since: such a frame is old, or another sender's. */
static void a_counter_that_jumped_is_refused_once(void **state)
{
    (void)state;
    for (uint32_t silent = 0U; silent < 20U; silent++) {
        for (uint8_t lost = 0U; lost < 15U; lost++) {
            static rig r;
            begin(&r, HG_START_REST);
            sample(&r, 0U, 0, 0, 0);
            ticks(&r, 1U, 1U + silent);
            r.counter[0] = (uint8_t)(r.counter[0] + lost);
            const bool possible = lost <= silent;
            assert_status(possible ? HG_OK : HG_E_SEQUENCE, give(&r, 0U, 1U + silent, 0, 0));
            assert_int_equal(possible ? 0 : 1, hg_node_health(&r.self, 0U)->sequence);
            assert_int_equal(possible ? lost : 0, hg_node_health(&r.self, 0U)->lost);
            ticks(&r, 1U + silent, 2U + silent);
            assert_status(HG_OK, give(&r, 0U, 2U + silent, 0, 0)); /* the next is compared with the refused one */
        }
    }
}

/* Which level a sender is on nobody knows: the shortest silence of all says how often it can have spoken. */
static void of_several_silences_the_shortest_counts(void **state)
{
    (void)state;
    static const uint8_t silences[2][3] = {{1U, 2U, 0U}, {2U, 1U, 9U}}; /* the last is of no level */
    for (uint8_t i = 0U; i < 2U; i++) {
        for (uint32_t passed = 1U; passed < 12U; passed++) {
            for (uint32_t moved = 1U; moved < 8U; moved++) {
                static rig r;
                hg_trigger_config trigger = sm_trigger_a;
                trigger.silence = silences[i];
                hg_hold_config hold[SM_GROUPS] = {sm_hold[0], sm_hold[1]};
                hold[0].trigger = &trigger;
                hg_detector_config detector = sm_detector;
                detector.hold = hold;
                hg_node_config config = usual;
                config.detector = &detector;
                begin_with(&r, &config, HG_START_REST);
                sample(&r, 0U, 0, 0, 0);
                ticks(&r, 1U, passed);
                r.counter[0] = (uint8_t)(r.counter[0] + moved - 1U);
                assert_status((moved <= (passed / 2U)) ? HG_OK : HG_E_SEQUENCE, give(&r, 0U, passed, 0, 0));
            }
        }
    }
}

/* After a silence in which more frames can have been sent than any step can say, every counter fits. */
static void after_a_very_long_silence_any_counter_fits(void **state)
{
    (void)state;
    for (uint8_t lost = 0U; lost < 16U; lost++) {
        static rig r;
        begin(&r, HG_START_REST);
        sample(&r, 0U, 0, 0, 0);
        r.link[0].k -= 70000U + lost;
        r.counter[0] = (uint8_t)(r.counter[0] + lost);
        assert_status(HG_OK, give(&r, 0U, 1U, 0, 1));
        assert_int_equal(lost, hg_node_health(&r.self, 0U)->lost);
    }
}

static void a_missing_tick_is_a_step(void **state)
{
    (void)state;
    for (uint32_t jump = 0U; jump <= 7U; jump++) {
        static rig r;
        begin(&r, HG_START_REST);
        sample(&r, 0U, 0, 0, 0);
        assert_status(HG_OK, give(&r, 0U, 1U, 8, 8)); /* belongs to the sample whose closing frame is missing */
        r.counter[1] = (uint8_t)(r.counter[1] + jump);
        assert_status(HG_OK, give(&r, 1U, 1U + jump, 8, 0));
        for (uint32_t j = 0U; j <= jump; j++) {
            const hg_can_frame early = {.id = 0x110U, .length = 4U};
            const hg_node before = r.self;
            assert_status(HG_E_BUSY, hg_node_receive(&r.self, &early));
            assert_memory_equal(&before, &r.self, sizeof(before));
            step(&r, 1U + j);
            if (j == 0U) {
                assert_real(8.0 * SM_RESOLUTION, r.self.detector.value[0]);
                assert_real(SM_HALF, r.self.detector.radius[0]);
            }
            if (j == jump) {
                assert_real(8.0 * SM_RESOLUTION, r.self.detector.value[2]);
                assert_real(SM_HALF, r.self.detector.radius[2]);
            } else {
                assert_real((j < 4U) ? SM_SLEW((double)j + 1.0) : R(SM_SPAN), r.self.detector.radius[2]);
            }
        }
        nothing_is_due(&r);
        assert_count(jump, r.self.overdue);
        assert_int_equal((jump == 0U) ? HG_BUS_GOOD : HG_BUS_LOSSY, bus(&r, 1U));
        assert_int_equal(jump, hg_node_health(&r.self, 1U)->lost);
    }
}

static void one_late_tick_is_a_straggler(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_MOVING);
    for (uint32_t k = 0U; k < 5U; k++) {
        assert_status((k == 0U) ? HG_E_STAMP : HG_OK, give(&r, 0U, k, 640, 640));
        assert_status(HG_OK, give(&r, 1U, k, 640, 0));
        step(&r, k);
    }
    for (uint16_t i = 0U; i < 20U; i++) {
        const uint32_t k = 5U + (2U * (uint32_t)i);
        const hg_can_frame tick = frame_of(&r, 1U, k, 640, 0);
        assert_status(HG_OK, give(&r, 0U, k, 640, 640));
        hg_node_overdue(&r.self);
        step(&r, k);
        assert_int_equal(HG_PLANT_NONE, r.verdict.plant);
        assert_status(HG_E_STAMP, hg_node_receive(&r.self, &tick)); /* its sample is closed already */
        nothing_is_due(&r);
        assert_int_equal(i + 1U, hg_node_health(&r.self, 1U)->late);
        assert_status(HG_E_REPEATED, hg_node_receive(&r.self, &tick)); /* once more: nothing new, and no second witness */
        sample(&r, k + 1U, 640, 640, 640);
        assert_int_equal(HG_PLANT_NONE, r.verdict.plant); /* a restart in a moving plant would be starting */
        assert_int_equal(HG_BUS_GOOD, bus(&r, 0U));
        assert_int_equal(HG_BUS_LOSSY, bus(&r, 1U));
    }
    assert_count(20, r.self.overdue);
    assert_int_equal(0, hg_node_health(&r.self, 1U)->lost);
}

/* The counter of the last tick accepted is what counts, whatever has been refused since. */
static void old_ticks_between_leave_the_others_in_step(void **state)
{
    (void)state;
    for (uint8_t back = 1U; back <= 7U; back++) {
        static rig r;
        begin(&r, HG_START_MOVING);
        for (uint32_t k = 0U; k < 40U; k++) {
            r.counter[1] = (uint8_t)(r.counter[1] - 1U - back);
            hg_can_frame old = frame_of(&r, 1U, k - 1U - back, 0, 0);
            r.counter[1] = (uint8_t)(r.counter[1] + back);
            if ((k >= 20U) && ((k % 2U) == 0U)) {
                assert_status(HG_E_STAMP, hg_node_receive(&r.self, &old));
            }
            assert_status(HG_OK, give(&r, 1U, k, 0, 0));
            step(&r, k);
            assert_int_equal((k < 2U) ? HG_PLANT_STARTING : HG_PLANT_NONE, r.verdict.plant);
        }
        assert_int_equal(10, hg_node_health(&r.self, 1U)->late);
    }
}

static void two_late_ticks_restart_with_nothing_known(void **state)
{
    (void)state;
    for (uint32_t ahead = 8U; ahead < 16U; ahead++) {
        static rig r;
        begin(&r, HG_START_REST);
        for (uint32_t k = 0U; k < 5U; k++) {
            sample(&r, k, 640, 640, 640);
        }
        assert_status(HG_OK, give(&r, 0U, 5U, 640, 640)); /* of the sample that this node believed to be open */
        r.counter[1] = (uint8_t)(r.counter[1] + (ahead / 2U));
        assert_status(HG_E_STAMP, give(&r, 1U, 5U + ahead, 0, 0));
        r.counter[1]++;
        assert_status(HG_E_STAMP, give(&r, 1U, 5U + ahead, 0, 0)); /* the counter moved by two and the sample not at all: no witness */
        assert_status(HG_OK, give(&r, 1U, 6U + ahead, 0, 0));
        const uint32_t k = 5U + ((ahead + 1U) & 15U); /* forward only */
        step(&r, k);
        nothing_is_due(&r);
        assert_int_equal(HG_PLANT_STARTING, r.verdict.plant);
        /* Up to 15 samples may have passed: neither the frame just booked nor an older one says anything of this sample. */
        assert_real(SM_SPAN, r.self.detector.radius[0]);
        assert_real(SM_SPAN, r.self.detector.radius[1]);
        assert_real(SM_HALF, r.self.detector.radius[2]);
        assert_int_equal(HG_BUS_ABSENT, bus(&r, 0U));
        assert_int_equal(2, hg_node_health(&r.self, 1U)->late); /* the third one was not refused */
        sample(&r, k + 1U, 0, 0, 0);
        assert_int_equal(HG_BUS_GOOD, bus(&r, 0U));
        assert_int_equal(HG_BUS_GOOD, bus(&r, 1U));
        sample(&r, k + 2U, 0, 0, 0);
        sample(&r, k + 3U, 0, 0, 0);
        assert_int_equal(HG_PLANT_NONE, r.verdict.plant);
    }
}

static void a_moving_start_waits_for_the_sample_index(void **state)
{
    (void)state;
    for (uint32_t stamp = 0U; stamp < 16U; stamp++) {
        static rig r;
        begin(&r, HG_START_MOVING);
        assert_status(HG_E_STAMP, give(&r, 0U, 0U, 5, 5)); /* even with the stamp of the sample that happens to be open */
        assert_status(HG_E_STAMP, give(&r, 0U, 9U, 5, 5));
        assert_int_equal(0, hg_node_health(&r.self, 0U)->early); /* nobody can say of which sample they are */
        assert_int_equal(0, hg_node_health(&r.self, 0U)->late);
        nothing_is_due(&r);
        assert_status(HG_OK, give(&r, 1U, stamp, 5, 0));
        step(&r, stamp);
        nothing_is_due(&r);
        assert_int_equal(HG_PLANT_STARTING, r.verdict.plant);
        assert_int_equal(HG_BUS_ABSENT, bus(&r, 0U));
        assert_int_equal(HG_BUS_GOOD, bus(&r, 1U));
        sample(&r, stamp + 1U, 5, 5, 5);
        assert_int_equal(HG_BUS_GOOD, bus(&r, 0U));
        sample(&r, stamp + 2U, 5, 5, 5);
        assert_int_equal(HG_PLANT_NONE, r.verdict.plant);
    }
}

static void the_sample_index_never_goes_back(void **state)
{
    (void)state;
    for (uint32_t stamp = 0U; stamp < 16U; stamp++) {
        static rig r;
        begin(&r, HG_START_MOVING);
        for (uint32_t k = 0U; k < 21U; k++) {
            hg_node_overdue(&r.self);
            step(&r, k);
        }
        assert_status(HG_OK, give(&r, 1U, stamp, 5, 0));
        step(&r, 21U + ((stamp - 21U) & 15U));
    }
}

static void an_overdue_tick_is_one_step_however_often_said(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    sample(&r, 0U, 0, 0, 0);
    hg_node_overdue(&r.self);
    hg_node_overdue(&r.self);
    step(&r, 1U);
    nothing_is_due(&r);
    assert_count(1, r.self.overdue);
    assert_int_equal(HG_BUS_LOSSY, bus(&r, 1U));
    assert_real(SM_SLEW(1), r.self.detector.radius[2]);
    assert_status(HG_E_STAMP, give(&r, 1U, 1U, 0, 0)); /* it comes at last */
    sample(&r, 2U, 0, 0, 0);
    /* with steps due already, overdue adds none */
    r.counter[1] = (uint8_t)(r.counter[1] + 2U);
    assert_status(HG_OK, give(&r, 1U, 5U, 0, 0));
    hg_node_overdue(&r.self);
    for (uint32_t k = 3U; k <= 5U; k++) {
        step(&r, k);
    }
    nothing_is_due(&r);
    r.self.overdue = UINT32_MAX;
    hg_node_overdue(&r.self);
    step(&r, 6U);
    assert_true(r.self.overdue == UINT32_MAX);
}

static void numbers_out_of_range_are_refused_and_told(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    sample(&r, 0U, 0, 0, 0);
    assert_false(r.verdict.refused);
    hg_can_frame bad = frame_of(&r, 0U, 1U, 0, 0);
    bad.data[3] = 0x7FU; /* 32512: a number, but outside the range */
    assert_status(HG_OK, hg_e2e_protect(&rules[0], bad.data, 6U, bad.data[1], 1U));
    assert_status(HG_E_NUMERIC, hg_node_receive(&r.self, &bad));
    assert_int_equal(1, hg_node_health(&r.self, 0U)->numeric);
    assert_status(HG_OK, give(&r, 1U, 1U, HG_CODE_INVALID, 0));
    step(&r, 1U);
    assert_true(r.verdict.refused);
    assert_int_equal(HG_BUS_LOSSY, bus(&r, 0U));
    assert_real(0.0, r.self.detector.value[0]);
    assert_int_equal(1, hg_node_health(&r.self, 1U)->invalid);
    assert_real(SM_SPAN, r.self.detector.radius[2]);
    sample(&r, 2U, 0, 0, 0);
    assert_true(r.verdict.refused); /* since the start */
    r.link[0].health.numeric = 0U;
    r.self.detector.refusals = 1U;
    sample(&r, 3U, 0, 0, 0);
    assert_true(r.verdict.refused);
}

/* Message and hold may be given different scales by a careless table: the narrower one decides. */
static void a_code_that_only_the_message_allows_is_refused(void **state)
{
    (void)state;
    static rig r;
    hg_code_scale narrow[2] = {sm_scale[0], sm_scale[1]};
    narrow[0].maximum = 100;
    hg_hold_config hold[SM_GROUPS] = {sm_hold[0], sm_hold[1]};
    hold[0].scale = narrow;
    hg_detector_config d = sm_detector;
    d.hold = hold;
    hg_node_config c = usual;
    c.detector = &d;
    begin_with(&r, &c, HG_START_REST);
    assert_status(HG_OK, give(&r, 0U, 0U, 100, 200));
    assert_status(HG_OK, give(&r, 1U, 0U, 100, 0));
    step(&r, 0U);
    assert_status(HG_E_NUMERIC, give(&r, 0U, 1U, 101, 200));
    assert_int_equal(1, hg_node_health(&r.self, 0U)->numeric);
    assert_status(HG_OK, give(&r, 1U, 1U, 100, 0));
    step(&r, 1U);
    assert_true(r.verdict.refused);
    assert_int_equal(HG_BUS_LOSSY, bus(&r, 0U));
}

static void health_counters_saturate(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    (void)memset(&r.link[0].health, 0xFF, sizeof(r.link[0].health));
    hg_can_frame bad = frame_of(&r, 0U, 0U, 0, 0);
    r.counter[0]--;
    bad.length = 8U;
    assert_status(HG_E_FORMAT, hg_node_receive(&r.self, &bad));
    bad.length = 6U;
    bad.data[0] ^= 1U;
    assert_status(HG_E_CRC, hg_node_receive(&r.self, &bad));
    assert_status(HG_E_STAMP, give(&r, 0U, 1U, 0, 0));
    assert_status(HG_E_STAMP, give(&r, 0U, 9U, 0, 0));
    r.link[0].machine.state = HG_E2E_INVALID;
    r.link[0].machine.error = 0xFFU;
    r.link[0].timed = false;
    assert_status(HG_E_STATE, give(&r, 0U, 0U, 0, 0));
    r.link[0].machine.state = HG_E2E_VALID;
    r.link[0].machine.error = 0U;
    r.link[0].timed = false;
    const hg_can_frame good = frame_of(&r, 0U, 0U, HG_CODE_INVALID, 0);
    assert_status(HG_OK, hg_node_receive(&r.self, &good));
    assert_status(HG_E_REPEATED, hg_node_receive(&r.self, &good));
    r.counter[0] = (uint8_t)(r.counter[0] + 5U);
    assert_status(HG_E_SEQUENCE, give(&r, 0U, 0U, 0, 0));
    hg_link_health full;
    (void)memset(&full, 0xFF, sizeof(full));
    assert_memory_equal(&full, hg_node_health(&r.self, 0U), sizeof(full));
}

static void two_nodes_share_tables_and_nothing_else(void **state)
{
    (void)state;
    static rig a;
    static rig b;
    begin(&a, HG_START_REST);
    begin(&b, HG_START_MOVING);
    for (uint32_t k = 0U; k < 20U; k++) {
        sample(&a, k, 1, 1, 1);
        assert_status(HG_OK, give(&b, 1U, k, 3000, 0));
        step(&b, k);
        assert_int_equal(HG_PLANT_NONE, a.verdict.plant);
        assert_int_equal(HG_BUS_GOOD, bus(&a, 0U));
        assert_int_equal(HG_BUS_ABSENT, bus(&b, 0U));
    }
}

/* One sample over a link that loses nothing, or everything; the status of the closing frame. */
static hg_status plant_sample(plant *p, rig *r, uint32_t k, bool fault, bool sent)
{
    hg_real value[SM_GROUPS][2];
    hg_status status = HG_E_EMPTY;
    plant_move(p, fault, value);
    for (uint8_t group = 0U; group < SM_GROUPS; group++) {
        hg_can_frame frame;
        if ((hg_sender_step(&p->sender[group], k, value[group], &frame) == HG_OK) && sent) {
            status = hg_node_receive(&r->self, &frame);
        }
    }
    return status;
}

/* The steps that are due, and whether one of them confirmed an alarm. */
static bool confirms(rig *r)
{
    bool confirmed = false;
    while (hg_node_step(&r->self, &r->verdict) == HG_OK) {
        sm_check_canaries(&r->storage);
        confirmed = confirmed || (r->verdict.plant == HG_PLANT_CONFIRMED);
    }
    return confirmed;
}

static void nothing_is_known_but_the_closing_frame(const rig *r)
{
    assert_int_equal(HG_PLANT_STARTING, r->verdict.plant);
    assert_int_equal(HG_BUS_ABSENT, bus(r, 0U));
    assert_int_equal(HG_BUS_GOOD, bus(r, 1U));
    assert_real(SM_SPAN, r->self.detector.radius[0]);
    assert_real(SM_SPAN, r->self.detector.radius[1]);
    assert_real(SM_HALF, r->self.detector.radius[2]);
}

/* A sender whose index leaps while its counter goes on, or that begins anew at 0 with both. The plant goes on in either case. */
static void a_leap(uint32_t seed, uint32_t leap, int32_t by, bool anew)
{
    static rig r;
    plant p;
    uint32_t k = 5U; /* not in phase with the counter: a sender that begins anew has moved one against the other */
    uint32_t wait = 0U;
    bool found = false;
    begin(&r, HG_START_MOVING);
    plant_begin(&p, messages, seed);
    for (uint32_t i = 0U; i < 160U; i++, k++) {
        if (i == leap) {
            k = anew ? 0U : (uint32_t)((int32_t)k + by);
            wait = 4U;
        }
        if ((i == leap) && anew) {
            plant_sender(&p, 0U);
            plant_sender(&p, 1U);
        }
        const bool fault = i >= 140U;
        const hg_status status = plant_sample(&p, &r, k, fault, true);
        const bool confirmed = confirms(&r);
        assert_false(confirmed && (!fault));
        found = found || confirmed;
        if ((wait > 0U) && (status == HG_OK) && (r.verdict.plant == HG_PLANT_STARTING)) {
            nothing_is_known_but_the_closing_frame(&r);
            assert_count(k & 15U, r.verdict.k & 15U);
            wait = 0U;
        }
        assert_true(wait != 1U); /* the third closing frame at the latest */
        wait -= (wait > 0U) ? 1U : 0U;
    }
    assert_true(found);
}

static void a_sender_that_leaps_or_begins_anew_restarts_the_detector(void **state)
{
    (void)state;
    const uint32_t seed = seed_of_run(91U);
    for (uint32_t i = 0U; i < 320U; i++) {
        const uint32_t leap = 60U + (i % 16U);
        a_leap(seed + i, leap, -1, false);
        a_leap(seed + i, leap, (int32_t)(1U + (i % 15U)), false);
        a_leap(seed + i, leap, 0, true);
    }
}

static void an_outage_that_is_told_is_no_plant_fault(void **state)
{
    (void)state;
    const uint32_t seed = seed_of_run(95U);
    for (uint32_t i = 0U; i < 330U; i++) {
        static rig r;
        plant p;
        const uint32_t first = 50U + (i / 33U);
        const uint32_t last = first + 8U + (i % 33U); /* the first sample after 8 .. 40 lost ones */
        bool found = false;
        begin(&r, ((i & 1U) != 0U) ? HG_START_REST : HG_START_MOVING);
        plant_begin(&p, messages, seed + i);
        for (uint32_t k = 0U; k < 160U; k++) {
            const bool fault = k >= 140U;
            const bool sent = (k < first) || (k >= last);
            if (k == last) {
                hg_node_outage(&r.self);
            }
            const hg_status status = plant_sample(&p, &r, k, fault, sent);
            const uint32_t steps = r.self.due;
            const bool confirmed = confirms(&r);
            assert_false(confirmed && (!fault));
            found = found || confirmed;
            assert_status(sent ? HG_OK : HG_E_EMPTY, status);
            assert_count(sent ? 1U : 0U, steps);
            assert_true((!sent) || ((r.verdict.k & 15U) == (k & 15U)));
            if (k == last) {
                nothing_is_known_but_the_closing_frame(&r);
            }
        }
        assert_true(found);
        assert_count(0, r.self.overdue);
        for (uint8_t group = 0U; group < SM_GROUPS; group++) {
            const hg_link_health *health = hg_node_health(&r.self, group);
            assert_int_equal(0, health->lost + health->repeated + health->early + health->late);
        }
    }
}

/* A counter that has not moved with its sample is of a sender that began anew, or of an old frame; the next one tells which. */
static void two_ticks_out_of_step_restart_the_detector(void **state)
{
    (void)state;
    for (uint32_t k = 5U; k < 12U; k++) {
        for (int deadline = 0; deadline <= 1; deadline++) {
            static rig r;
            begin(&r, HG_START_REST);
            for (uint32_t i = 0U; i < 5U; i++) {
                sample(&r, i, 640, 640, 640);
            }
            for (uint32_t i = 5U; (deadline != 0) && (i < k); i++) {
                hg_node_overdue(&r.self);
                step(&r, i);
            }
            r.counter[1]--;
            assert_status(HG_E_SEQUENCE, give(&r, 1U, k, 641, 0));
            nothing_is_due(&r);
            assert_int_equal(1, hg_node_health(&r.self, 1U)->sequence);
            if (deadline != 0) {
                hg_node_overdue(&r.self);
                step(&r, k);
            }
            assert_status(HG_OK, give(&r, 1U, k + 1U, 641, 0));
            step(&r, k + 1U);
            nothing_is_due(&r);
            nothing_is_known_but_the_closing_frame(&r);
            assert_int_equal(0, hg_node_health(&r.self, 1U)->late);
            assert_int_equal(0, hg_node_health(&r.self, 1U)->lost); /* nobody knows how many */
        }
    }
}

/* A sender that was held up sends what it owes in a burst: all of it is late, none of it is lost, and the sample index stands. */
static void closing_frames_that_come_late_in_a_burst_are_not_lost(void **state)
{
    (void)state;
    for (uint32_t owed = 1U; owed <= 40U; owed++) {
        for (uint32_t missing = 0U; missing < 3U; missing++) { /* of these, the first few never come */
            static rig r;
            begin(&r, HG_START_REST);
            for (uint32_t k = 0U; k < 5U; k++) {
                sample(&r, k, 0, 0, 0);
            }
            for (uint32_t k = 5U; k < 5U + owed; k++) {
                hg_node_overdue(&r.self);
                step(&r, k);
            }
            const uint32_t first = 5U + ((missing < owed) ? missing : owed);
            r.counter[1] = (uint8_t)(r.counter[1] + (first - 5U));
            uint32_t refused = 0U;
            for (uint32_t k = first; k < 5U + owed; k++) {
                refused += (give(&r, 1U, k, 0, 0) == HG_E_STAMP) ? 1U : 0U;
            }
            if (owed > 8U) {
                continue; /* beyond what a stamp can tell: the application must have said so (node.h) */
            }
            assert_int_equal(5U + owed - first, refused);
            assert_int_equal(refused, hg_node_health(&r.self, 1U)->late);
            sample(&r, 5U + owed, 0, 0, 0);
            assert_int_equal(first - 5U, hg_node_health(&r.self, 1U)->lost);
            assert_int_equal(HG_PLANT_NONE, r.verdict.plant); /* no beginning anew */
        }
    }
}

/* Old closing frames sent once more agree with each other, too; a clock knows that no sample passed between them. */
static void a_burst_of_old_ticks_does_not_restart_a_node_with_a_clock(void **state)
{
    (void)state;
    for (int clocked = 0; clocked <= 1; clocked++) {
        static rig r;
        hg_can_frame old[3] = {{.id = 0U}, {.id = 0U}, {.id = 0U}};
        begin(&r, HG_START_REST);
        for (uint32_t k = 0U; k < 20U; k++) {
            assert_status(HG_OK, give(&r, 0U, k, 0, 0));
            const hg_can_frame tick = frame_of(&r, 1U, k, 0, 0);
            if ((k >= 15U) && (k < 18U)) {
                old[k - 15U] = tick;
            }
            assert_status(HG_OK, hg_node_receive(&r.self, &tick));
            step(&r, k);
        }
        if (clocked != 0) {
            hg_node_expect(&r.self, 0U);
        }
        assert_status(HG_E_STAMP, hg_node_receive(&r.self, &old[0]));
        assert_status((clocked != 0) ? HG_E_STAMP : HG_OK, hg_node_receive(&r.self, &old[1]));
        if (clocked != 0) {
            assert_status(HG_E_STAMP, hg_node_receive(&r.self, &old[2]));
            sample(&r, 20U, 0, 0, 0);
            assert_int_equal(HG_PLANT_NONE, r.verdict.plant);
            assert_int_equal(3, hg_node_health(&r.self, 1U)->late);
        }
    }
}

/* One old closing frame can look as if it were ahead: counter and stamp went round together. A clock tells. */
static void who_has_a_clock_refuses_what_comes_too_soon(void **state)
{
    (void)state;
    for (uint32_t back = 9U; back <= 15U; back++) {
        for (uint32_t most = 0U; most <= 8U; most++) {
            static rig r;
            begin(&r, HG_START_REST);
            hg_can_frame old = {.id = 0U};
            for (uint32_t k = 0U; k < 20U; k++) {
                assert_status(HG_OK, give(&r, 0U, k, 0, 0));
                const hg_can_frame tick = frame_of(&r, 1U, k, 0, 0);
                old = (k == (20U - back)) ? tick : old;
                assert_status(HG_OK, hg_node_receive(&r.self, &tick));
                step(&r, k);
            }
            hg_node_expect(&r.self, most);
            const bool accepted = (16U - back) <= most;
            assert_status(accepted ? HG_OK : HG_E_STAMP, hg_node_receive(&r.self, &old));
            assert_int_equal(accepted ? 0 : 1, hg_node_health(&r.self, 1U)->early);
            if (!accepted) {
                sample(&r, 20U, 0, 0, 0);
                assert_int_equal(HG_BUS_GOOD, bus(&r, 0U));
            }
        }
    }
}

static void an_outage_drops_the_steps_that_are_due(void **state)
{
    (void)state;
    static rig r;
    begin(&r, HG_START_REST);
    sample(&r, 0U, 640, 640, 640);
    r.counter[1] = (uint8_t)(r.counter[1] + 3U);
    assert_status(HG_OK, give(&r, 1U, 4U, 640, 0)); /* 1 .. 4 */
    step(&r, 1U);
    assert_true(r.self.closed);
    hg_node_outage(&r.self);
    assert_false(r.self.closed);
    nothing_is_due(&r);
    hg_node_outage(&r.self); /* said twice is said once */
    assert_status(HG_E_STAMP, give(&r, 0U, 2U, 640, 640)); /* the open sample's, but who knows */
    assert_int_equal(0, hg_node_health(&r.self, 0U)->early + hg_node_health(&r.self, 0U)->late);
    hg_node_overdue(&r.self); /* a bus that stays silent is told all the same */
    step(&r, 2U);
    assert_int_equal(HG_PLANT_STARTING, r.verdict.plant);
    assert_int_equal(HG_BUS_ABSENT, bus(&r, 0U));
    assert_int_equal(HG_BUS_ABSENT, bus(&r, 1U));
    assert_real(SM_SPAN, r.self.detector.radius[2]); /* the closing frame that was held is forgotten */
    assert_status(HG_OK, give(&r, 1U, 17U, 640, 0)); /* 14 ahead: any step is possible */
    step(&r, 17U);
    nothing_is_due(&r);
    nothing_is_known_but_the_closing_frame(&r);
    hg_node_overdue(&r.self);
    hg_node_outage(&r.self);
    nothing_is_due(&r);
}

/* The link does what links do: it drops, damages, doubles and delays frames, closing frames too, some for longer than a stamp can tell
 * forward from back. The plant keeps its bounds until a fault comes, and before that no alarm may ever be confirmed. */
static void abuse(uint32_t seed, bool deadline, unsigned restarts[1], unsigned provisional[1])
{
    static rig r;
    plant p;
    int32_t outage = 0;
    unsigned missed = 0U;
    unsigned certain = 0U;
    bool confirmed = false;
    hg_can_frame straggler = {.id = 0x7FFU};
    begin(&r, ((seed & 1U) != 0U) ? HG_START_REST : HG_START_MOVING);
    plant_begin(&p, messages, seed);
    for (uint32_t k = 0U; k < 700U; k++) {
        const bool fault = k >= 600U;
        hg_real value[SM_GROUPS][2];
        plant_move(&p, fault, value);
        if (((draw(&p.random) % 60U) == 0U) && (!fault)) {
            outage = draw_between(&p.random, 1, 12);
        }
        outage -= (outage > 0) ? 1 : 0;
        for (uint8_t group = 0U; group < SM_GROUPS; group++) {
            hg_can_frame frame;
            if (hg_sender_step(&p.sender[group], k, value[group], &frame) != HG_OK) {
                continue;
            }
            int32_t fate = draw_between(&p.random, 0, 99);
            if (group == 1U) {
                /* 16 samples without an accepted closing frame are none by their stamps, only a deadline sees them (node.h): before, two
                 * come, and the second late one running is accepted */
                if ((missed >= 11U) && (!deadline)) {
                    certain = 2U;
                }
                if (certain > 0U) {
                    certain--;
                    outage = 0;
                    fate = 50;
                }
                missed++;
            }
            if ((fate < 4) || ((outage > 0) && ((group == 1U) || (fate < 30)))) {
                /* lost */
            } else if (fate < 8) {
                frame.data[draw(&p.random) % frame.length] ^= 0x40U;
                assert_status(HG_E_CRC, hg_node_receive(&r.self, &frame));
            } else if ((fate < 12) && (group == 0U)) {
                straggler = frame;
            } else {
                const hg_status status = hg_node_receive(&r.self, &frame);
                missed = ((group == 1U) && (status == HG_OK)) ? 0U : missed;
                if (fate > 95) {
                    (void)hg_node_receive(&r.self, &frame);
                }
            }
        }
        if (deadline) {
            hg_node_overdue(&r.self); /* does nothing where the closing frame came */
        }
        const bool was_starting = r.verdict.plant == HG_PLANT_STARTING;
        while (hg_node_step(&r.self, &r.verdict) == HG_OK) {
            sm_check_canaries(&r.storage);
            if ((r.verdict.plant == HG_PLANT_CONFIRMED) && (!fault)) {
                print_error("seed %lu, sample %lu: confirmed without a fault\n", (unsigned long)seed, (unsigned long)k);
                fail();
            }
            confirmed = confirmed || (r.verdict.plant == HG_PLANT_CONFIRMED);
            provisional[0] += (r.verdict.plant == HG_PLANT_PROVISIONAL) ? 1U : 0U;
        }
        restarts[0] += ((!was_starting) && (r.verdict.plant == HG_PLANT_STARTING)) ? 1U : 0U;
        if (straggler.id != 0x7FFU) {
            (void)hg_node_receive(&r.self, &straggler);
            straggler.id = 0x7FFU;
        }
    }
    assert_true(confirmed);
}

static void no_alarm_is_confirmed_without_a_fault_whatever_the_link_does(void **state)
{
    (void)state;
    const uint32_t seed = seed_of_run(81U);
    unsigned restarts = 0U;
    unsigned provisional = 0U;
    for (uint32_t i = 0U; i < 100U; i++) {
        abuse(seed + i, (i % 4U) >= 2U, &restarts, &provisional);
    }
    assert_true(restarts > 10U);
    assert_true(provisional > 10U);
}

/* ---- verdicts out of a node ---- */

static hg_verdict verdict_of(uint32_t k)
{
    return (hg_verdict){.k = k, .model_hash = HASH, .candidates = 0U, .plant = HG_PLANT_NONE, .basis = HG_BASIS_SET, .bus = 5U,
        .refused = false};
}

static uint8_t report(rig *r, const hg_verdict *verdict, bool reply, hg_can_frame frame[3])
{
    (void)memset(frame, 0x5A, 3U * sizeof(frame[0]));
    hg_can_frame untouched;
    (void)memset(&untouched, 0x5A, sizeof(untouched));
    const uint8_t frames = hg_node_report(&r->self, verdict, reply, frame);
    for (uint8_t i = frames; i < 3U; i++) {
        assert_memory_equal(&untouched, &frame[i], sizeof(untouched));
    }
    return frames;
}

static void the_first_verdict_is_told_with_the_status(void **state)
{
    (void)state;
    static rig r;
    hg_can_frame frame[3];
    begin(&r, HG_START_REST);
    const hg_verdict v = verdict_of(0U);
    assert_int_equal(2, report(&r, &v, true, frame));
    assert_count(0x200, frame[0].id);
    assert_count(0x201, frame[1].id);
    assert_int_equal(0, frame[0].data[2] & 0x10); /* it would have been sent without being asked */
}

static void more_than_16_faults_need_the_longer_verdict_frame(void **state)
{
    (void)state;
    static rig r;
    static const uint32_t many[SM_GENERATORS] = {0x1U, 0x10000U};
    begin(&r, HG_START_REST);
    hg_detector_config detector = sm_detector;
    detector.decision.faults = many;
    hg_node_config c = usual;
    c.detector = &detector;
    assert_status(HG_E_CONFIG, hg_node_start(&r.self, &c, &r.memory, HG_START_REST));
    c.verdict = &wide_message;
    assert_status(HG_OK, hg_node_start(&r.self, &c, &r.memory, HG_START_REST));
    c.detector = &sm_detector; /* few faults may have it too */
    assert_status(HG_OK, hg_node_start(&r.self, &c, &r.memory, HG_START_REST));
}

static void the_longer_verdict_frame_has_the_documented_bytes_and_reads_back(void **state)
{
    (void)state;
    static rig r;
    hg_can_frame frame[3];
    hg_node_config c = usual;
    hg_verdict back;
    bool reply = false;
    uint32_t random = seed_of_run(62U);
    c.verdict = &wide_message;
    begin_with(&r, &c, HG_START_REST);
    const hg_verdict v = {.k = 0xFFFF5ABCUL, .model_hash = HASH, .candidates = 0x84216375UL, .plant = HG_PLANT_CONFIRMED,
        .basis = HG_BASIS_SET, .bus = 0x1234U, .refused = true};
    (void)report(&r, &v, false, frame);
    const uint8_t expected[11] = {0xC0U, 0x27U, 0x75U, 0x63U, 0x34U, 0x12U, 0xABU, 0x21U, 0x84U, 0U, 0U};
    assert_memory_equal(expected, &frame[0].data[1], 11U);
    assert_int_equal(crc_of(2U, frame[0].data, 12U), frame[0].data[0]);
    assert_int_equal(12, frame[0].length);
    assert_int_equal(HG_CAN_FD | HG_CAN_BRS, frame[0].flags);
    assert_status(HG_E_FORMAT, hg_verdict_read(&verdict_message, &frame[0], &back, &reply));
    for (int i = 0; i < 500; i++) {
        hg_verdict any = v;
        any.candidates = draw(&random);
        (void)report(&r, &any, true, frame);
        assert_status(HG_OK, hg_verdict_read(&wide_message, &frame[0], &back, &reply));
        assert_true(back.candidates == any.candidates);
        assert_true(back.k == 0xABCU);
        assert_int_equal(any.bus, back.bus);
    }
    frame[0].data[9] ^= 1U;
    assert_status(HG_E_CRC, hg_verdict_read(&wide_message, &frame[0], &back, &reply));
}

static void the_verdict_frame_has_the_documented_bytes(void **state)
{
    (void)state;
    static rig r;
    hg_can_frame frame[3];
    begin(&r, HG_START_REST);
    const hg_verdict v = {.k = 0xFFFF5ABCUL, .model_hash = HASH, .candidates = 0x8421U, .plant = HG_PLANT_CONFIRMED,
        .basis = HG_BASIS_STATISTICAL, .bus = 0x1234U, .refused = true};
    r.link[0].health = (hg_link_health){.lost = 3U, .crc = 1U, .format = 2U, .early = 4U, .late = 8U, .numeric = 16U, .repeated = 99U,
        .invalid = 99U, .good = 99U};
    r.link[1].health = (hg_link_health){.lost = 4U, .crc = 32U};
    assert_int_equal(2, report(&r, &v, false, frame));
    const uint8_t expected[7] = {0xC0U, 0x2BU, 0x21U, 0x84U, 0x34U, 0x12U, 0xABU};
    assert_memory_equal(expected, &frame[0].data[1], 7U);
    assert_int_equal(crc_of(2U, frame[0].data, 8U), frame[0].data[0]);
    assert_int_equal(8, frame[0].length);
    assert_int_equal(0, frame[0].flags);
    const uint8_t told[7] = {0xC0U, 0xEFU, 0xCDU, 0xABU, 0x89U, 7U, 63U};
    assert_memory_equal(told, &frame[1].data[1], 7U);
    assert_int_equal(crc_of(3U, frame[1].data, 8U), frame[1].data[0]);
    (void)memset(&r.link[1].health, 0xFF, sizeof(r.link[1].health));
    for (uint32_t i = 0U; i < HEARTBEAT; i++) {
        (void)report(&r, &v, false, frame);
    }
    assert_int_equal(255, frame[1].data[6]);
    assert_int_equal(255, frame[1].data[7]);
    assert_int_equal(0xC1, frame[1].data[1]);
}

static void a_heartbeat_comes_when_nothing_changes(void **state)
{
    (void)state;
    const uint16_t beats[] = {1U, 2U, HEARTBEAT, 300U, UINT16_MAX};
    for (size_t b = 0U; b < COUNT(beats); b++) {
        static rig r;
        hg_can_frame frame[3];
        hg_node_config c = usual;
        c.heartbeat = beats[b];
        begin_with(&r, &c, HG_START_REST);
        for (uint32_t k = 0U; k < 140000U; k++) {
            const hg_verdict v = verdict_of(k);
            assert_int_equal(((k % beats[b]) == 0U) ? 2 : 0, report(&r, &v, false, frame));
        }
    }
}

static void every_change_is_told_at_once(void **state)
{
    (void)state;
    for (int what = 0; what < 5; what++) {
        static rig r;
        hg_can_frame frame[3];
        begin(&r, HG_START_REST);
        hg_verdict v = verdict_of(0U);
        (void)report(&r, &v, false, frame);
        v = verdict_of(1U);
        assert_int_equal(0, report(&r, &v, false, frame));
        v = verdict_of(2U);
        if (what == 0) {
            v.plant = HG_PLANT_PROVISIONAL;
        } else if (what == 1) {
            v.candidates = 4U;
        } else if (what == 2) {
            v.basis = HG_BASIS_STATISTICAL;
        } else if (what == 3) {
            v.bus = 6U;
        } else {
            v.refused = true;
        }
        assert_int_equal(1, report(&r, &v, false, frame));
        assert_int_equal(0, frame[0].data[2] & 0x10);
        for (uint32_t k = 3U; k < 8U; k++) {
            v.k = k; /* the heartbeat keeps its pace, or a flapping bus would starve the status frame */
            assert_int_equal(((k % HEARTBEAT) == 0U) ? 2 : 0, report(&r, &v, false, frame));
        }
        v = verdict_of(8U); /* and back */
        assert_int_equal(1, report(&r, &v, false, frame));
    }
}

static void a_reply_is_marked_and_shifts_no_heartbeat(void **state)
{
    (void)state;
    static rig r;
    hg_can_frame frame[3];
    begin(&r, HG_START_REST);
    for (uint32_t k = 0U; k < 50U; k++) {
        const hg_verdict v = verdict_of(k);
        const bool beat = (k % HEARTBEAT) == 0U;
        assert_int_equal(beat ? 2 : 1, report(&r, &v, true, frame));
        assert_int_equal(beat ? 0 : 0x10, frame[0].data[2] & 0x10);
        assert_int_equal((int)(k & 15U), frame[0].data[1] & 15); /* the counter moves with every frame */
    }
}

static void a_verdict_reads_back_as_written(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(61U);
    static rig r;
    begin(&r, HG_START_REST);
    for (int i = 0; i < 2000; i++) {
        hg_can_frame frame[3];
        const hg_verdict v = {.k = draw(&random), .model_hash = HASH, .candidates = draw(&random) & 0xFFFFU,
            .plant = (hg_plant)(draw(&random) & 3U),
                              .basis = (hg_basis)(draw(&random) % 3U), .bus = (uint16_t)(draw(&random) & 0xFFFFU),
                                  .refused = (draw(&random) & 1U) != 0U};
        hg_verdict back;
        bool reply = false;
        const uint8_t frames = hg_node_report(&r.self, &v, true, frame);
        assert_true(frames >= 1U);
        assert_status(HG_OK, hg_verdict_read(&verdict_message, &frame[0], &back, &reply));
        assert_true(back.k == (v.k & 0xFFFU));
        assert_true(back.candidates == v.candidates);
        assert_int_equal(v.plant, back.plant);
        assert_int_equal(v.basis, back.basis);
        assert_int_equal(v.bus, back.bus);
        assert_int_equal(v.refused, back.refused);
        assert_count(0, back.model_hash);
        assert_int_equal((frame[0].data[2] & 0x10) != 0, reply);
    }
}

static void a_verdict_that_is_none_is_refused(void **state)
{
    (void)state;
    static rig r;
    hg_can_frame frame[3];
    hg_verdict back;
    hg_verdict before;
    bool reply = true;
    begin(&r, HG_START_REST);
    const hg_verdict v = verdict_of(0U);
    (void)report(&r, &v, false, frame);
    (void)memset(&back, 0x5A, sizeof(back));
    (void)memcpy(&before, &back, sizeof(back));
    hg_can_frame bad = frame[0];
    bad.flags = HG_CAN_REMOTE;
    assert_status(HG_E_FORMAT, hg_verdict_read(&verdict_message, &bad, &back, &reply));
    assert_status(HG_E_FORMAT, hg_verdict_read(&verdict_message, &frame[1], &back, &reply));
    hg_message seven = verdict_message;
    seven.length = 7U;
    bad = frame[0];
    bad.length = 7U;
    assert_status(HG_E_FORMAT, hg_verdict_read(&seven, &bad, &back, &reply));
    for (unsigned bit = 0U; bit < 64U; bit++) {
        bad = frame[0];
        bad.data[bit / 8U] ^= (uint8_t)(1U << (bit % 8U));
        assert_status(HG_E_CRC, hg_verdict_read(&verdict_message, &bad, &back, &reply));
    }
    assert_memory_equal(&before, &back, sizeof(back));
    assert_true(reply);
}

/* ---- inbox ---- */

static void an_inbox_has_a_length_that_divides_its_counters(void **state)
{
    (void)state;
    static hg_can_frame room[128];
    hg_inbox self;
    for (uint32_t length = 0U; length < 256U; length++) {
        const bool good = (length == 2U) || (length == 4U) || (length == 8U) || (length == 16U) || (length == 32U) ||
            (length == 64U) || (length == 128U);
        assert_status(good ? HG_OK : HG_E_ARGUMENT, hg_inbox_start(&self, room, (uint8_t)length));
    }
    assert_status(HG_E_ARGUMENT, hg_inbox_start(NULL, room, 2U));
    assert_status(HG_E_ARGUMENT, hg_inbox_start(&self, NULL, 2U));
}

static void an_inbox_hands_out_in_order_and_counts_what_found_no_room(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(71U);
    for (uint32_t length = 2U; length <= 128U; length *= 2U) {
        static hg_can_frame room[129];
        hg_inbox self;
        hg_can_frame frame;
        uint32_t put = 0U;
        uint32_t got = 0U;
        uint32_t dropped = 0U;
        (void)memset(room, 0x5A, sizeof(room));
        assert_status(HG_OK, hg_inbox_start(&self, room, (uint8_t)length));
        (void)memset(&frame, 0x77, sizeof(frame));
        assert_status(HG_E_EMPTY, hg_inbox_get(&self, &frame));
        assert_true(frame.id == 0x77777777UL);
        for (int i = 0; i < 5000; i++) {
            const int32_t burst = draw_between(&random, 0, (int32_t)length + 2);
            const bool filling = (draw(&random) & 1U) != 0U;
            for (int32_t j = 0; j < burst; j++) {
                if (filling) {
                    frame = (hg_can_frame){.id = put};
                    const bool room_left = (put - got) < length;
                    assert_status(room_left ? HG_OK : HG_E_BUSY, hg_inbox_put(&self, &frame));
                    put += room_left ? 1U : 0U;
                    dropped += room_left ? 0U : 1U;
                } else {
                    const bool some = put != got;
                    assert_status(some ? HG_OK : HG_E_EMPTY, hg_inbox_get(&self, &frame));
                    if (some) {
                        assert_count(got, frame.id);
                        got++;
                    }
                }
            }
            assert_count((dropped < UINT16_MAX) ? dropped : UINT16_MAX, self.overflow);
        }
        for (size_t i = length; i < COUNT(room); i++) {
            assert_true(room[i].id == 0x5A5A5A5AUL);
        }
        assert_true(got > 256U);
        assert_true(dropped > 0U);
    }
}

static void the_overflow_counter_saturates(void **state)
{
    (void)state;
    hg_can_frame room[2];
    hg_inbox self;
    const hg_can_frame frame = {.id = 1U};
    assert_status(HG_OK, hg_inbox_start(&self, room, 2U));
    assert_status(HG_OK, hg_inbox_put(&self, &frame));
    assert_status(HG_OK, hg_inbox_put(&self, &frame));
    for (uint32_t i = 1U; i < 70000U; i++) {
        assert_status(HG_E_BUSY, hg_inbox_put(&self, &frame));
        assert_count((i < UINT16_MAX) ? i : UINT16_MAX, self.overflow);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sender_refuses_null_and_contradictions),
        cmocka_unit_test(a_sender_sends_each_signal_by_its_own_scale),
        cmocka_unit_test(a_sender_stamps_counts_and_protects_what_it_sends),
        cmocka_unit_test(a_silent_sender_leaves_the_frame_and_its_counter_alone),
        cmocka_unit_test(what_cannot_be_sent_goes_out_as_invalid),
        cmocka_unit_test(a_node_refuses_null),
        cmocka_unit_test(a_node_refuses_contradictions),
        cmocka_unit_test(a_node_refuses_other_headers_of_its_own),
        cmocka_unit_test(samples_follow_one_another_and_the_index_wraps),
        cmocka_unit_test(foreign_frames_are_not_ours),
        cmocka_unit_test(a_frame_of_wrong_kind_or_length_is_refused_and_counts_as_lost),
        cmocka_unit_test(a_damaged_frame_is_refused_and_counts_as_lost),
        cmocka_unit_test(a_link_may_be_trusted_whatever_came_before),
        cmocka_unit_test(a_silent_link_falls_by_its_deadline),
        cmocka_unit_test(a_duplicate_is_counted_and_harmless),
        cmocka_unit_test(a_second_frame_of_one_sample_is_no_duplicate_but_a_loss),
        cmocka_unit_test(a_measurement_of_another_sample_is_never_booked),
        cmocka_unit_test(a_stamp_may_be_ignored),
        cmocka_unit_test(lost_frames_are_counted_by_the_sequence),
        cmocka_unit_test(a_counter_that_jumped_is_refused_once),
        cmocka_unit_test(of_several_silences_the_shortest_counts),
        cmocka_unit_test(after_a_very_long_silence_any_counter_fits),
        cmocka_unit_test(a_missing_tick_is_a_step),
        cmocka_unit_test(one_late_tick_is_a_straggler),
        cmocka_unit_test(old_ticks_between_leave_the_others_in_step),
        cmocka_unit_test(two_late_ticks_restart_with_nothing_known),
        cmocka_unit_test(a_moving_start_waits_for_the_sample_index),
        cmocka_unit_test(the_sample_index_never_goes_back),
        cmocka_unit_test(an_overdue_tick_is_one_step_however_often_said),
        cmocka_unit_test(numbers_out_of_range_are_refused_and_told),
        cmocka_unit_test(a_code_that_only_the_message_allows_is_refused),
        cmocka_unit_test(health_counters_saturate),
        cmocka_unit_test(two_nodes_share_tables_and_nothing_else),
        cmocka_unit_test(a_sender_that_leaps_or_begins_anew_restarts_the_detector),
        cmocka_unit_test(an_outage_that_is_told_is_no_plant_fault),
        cmocka_unit_test(two_ticks_out_of_step_restart_the_detector),
        cmocka_unit_test(closing_frames_that_come_late_in_a_burst_are_not_lost),
        cmocka_unit_test(a_burst_of_old_ticks_does_not_restart_a_node_with_a_clock),
        cmocka_unit_test(who_has_a_clock_refuses_what_comes_too_soon),
        cmocka_unit_test(an_outage_drops_the_steps_that_are_due),
        cmocka_unit_test(no_alarm_is_confirmed_without_a_fault_whatever_the_link_does),
        cmocka_unit_test(the_first_verdict_is_told_with_the_status),
        cmocka_unit_test(more_than_16_faults_need_the_longer_verdict_frame),
        cmocka_unit_test(the_longer_verdict_frame_has_the_documented_bytes_and_reads_back),
        cmocka_unit_test(the_verdict_frame_has_the_documented_bytes),
        cmocka_unit_test(a_heartbeat_comes_when_nothing_changes),
        cmocka_unit_test(every_change_is_told_at_once),
        cmocka_unit_test(a_reply_is_marked_and_shifts_no_heartbeat),
        cmocka_unit_test(a_verdict_reads_back_as_written),
        cmocka_unit_test(a_verdict_that_is_none_is_refused),
        cmocka_unit_test(an_inbox_has_a_length_that_divides_its_counters),
        cmocka_unit_test(an_inbox_hands_out_in_order_and_counts_what_found_no_room),
        cmocka_unit_test(the_overflow_counter_saturates),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
