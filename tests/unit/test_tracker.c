/** @file
 *  tracker.h: a fusion filter behind frames. Copies that must be equal, frames that must be refused, sensors that must be suspected. */
#include "support.h"

#include "hullguard/tracker.h"

#define STATES 2U
#define SENSORS 16U /* of the larger model; the usual one has the first three */
#define USUAL 3U
#define DEPTH 2U
#define ONSETS 6U
#define HEARTBEAT 4U
#define WATCHDOG 9U
#define HASH 0x12345678UL

#define EIGHT(x) (x), (x), (x), (x), (x), (x), (x), (x)
#define ONE_ID(x) {EIGHT(x), EIGHT(x)}
#define P22(list) {.profile = HG_E2E_P22, .data_ids = (list), .crc = 0U, .counter = 8U, .stamp = 12U, .limits = &hg_e2e_limits_default}
static const uint8_t ids[4][HG_E2E_IDS] = {ONE_ID(0x11U), ONE_ID(0x22U), ONE_ID(0x33U), ONE_ID(0x44U)};
static const hg_e2e_config rules[4] = {P22(ids[0]), P22(ids[1]), P22(ids[2]), P22(ids[3])};
static const hg_field as_float[1] = {{16U, 32U, HG_FIELD_FLOAT32}};
static const hg_field as_code[1] = {{16U, 16U, HG_FIELD_SIGNED}};
static const hg_field as_estimate[2] = {{16U, 32U, HG_FIELD_FLOAT32}, {48U, 16U, 0U}};
#define PER 1024
#define STEP R(1.0 / PER)
static const hg_code_scale wide_scale[1] = {{.resolution = STEP, .per_unit = R(PER), .minimum = -1024000, .maximum = 1024000}};
static const hg_code_scale round_scale[1] = {{.resolution = STEP, .per_unit = R(PER), .minimum = -32767, .maximum = 32767}};
static const hg_code_scale estimate_scale[2] = {{.resolution = STEP, .per_unit = R(PER), .minimum = -1024000, .maximum = 1024000},
                                                {.resolution = R(2.0 / PER), .per_unit = R(PER / 2), .minimum = 0, .maximum = 65534}};
#define FLOATS(n) {.id = (n), .length = 6U, .width = 1U, .field = as_float, .scale = wide_scale, .e2e = &rules[0]}
static const hg_message messages[SENSORS] = {
    FLOATS(0x100U), {.id = 0x101U, .length = 4U, .width = 1U, .field = as_code, .scale = round_scale, .e2e = &rules[1]}, FLOATS(0x102U),
    FLOATS(0x103U), FLOATS(0x104U), FLOATS(0x105U), FLOATS(0x106U), FLOATS(0x107U), FLOATS(0x108U), FLOATS(0x109U),
    FLOATS(0x10AU), FLOATS(0x10BU), FLOATS(0x10CU), FLOATS(0x10DU), FLOATS(0x10EU), FLOATS(0x10FU)};
static const hg_tracker_source sources[SENSORS] = {
    {&messages[0], false}, {&messages[1], true}, {&messages[2], false}, {&messages[3], false}, {&messages[4], false},
    {&messages[5], false}, {&messages[6], false}, {&messages[7], false}, {&messages[8], false}, {&messages[9], false},
    {&messages[10], false}, {&messages[11], false}, {&messages[12], false}, {&messages[13], false}, {&messages[14], false}, {&messages[15], false}};
static const hg_message tick_message = {.id = 0x110U, .length = 2U, .e2e = &rules[2]};
static const hg_message verdict_message = {.id = 0x120U, .length = 8U, .e2e = &rules[3]};
static const hg_message status_message = {.id = 0x121U, .length = 8U, .e2e = &rules[3]};
#define ESTIMATE(n) {.id = (n), .length = 8U, .width = 2U, .field = as_estimate, .scale = estimate_scale, .e2e = &rules[3]}
static const hg_message estimates[STATES] = {ESTIMATE(0x130U), ESTIMATE(0x131U)};

static const hg_real plant_A[STATES * STATES] = {R(1), R(0.5), R(0), R(1)};
static const hg_real plant_Q[STATES * STATES] = {R(0), R(0), R(0), R(0.015625)};
static const hg_real plant_x0[STATES] = {R(0), R(0)};
static const hg_real plant_P0[STATES * STATES] = {R(1), R(0), R(0), R(1)};
static const uint8_t places[SENSORS] = {0U, 0U, 1U};
static const hg_real noise[SENSORS] = {EIGHT(R(0.0625)), EIGHT(R(0.0625))};
static const hg_real ranges[SENSORS] = {EIGHT(R(4000)), EIGHT(R(4000))};
static const hg_real levels[SENSORS] = {EIGHT(R(1)), EIGHT(R(1))};
static const hg_real worth[SENSORS] = {EIGHT(R(0.25)), EIGHT(R(0.25))};
static const hg_real origins[STATES] = {R(16), R(0)};
static const hg_fusion_table table[1] = {{.alive = 0xFFFFU, .level = levels, .relax = worth, .early = worth}};
#define FILTER(count, back, slack)                                                                                                                \
    {.states = STATES, .sensors = (count), .depth = (back), .delay = (slack), .heartbeat = HEARTBEAT, .watchdog = WATCHDOG, .modulus = 16U,       \
     .trigger = HG_FUSION_INNOVATION, .A = plant_A, .Q = plant_Q, .x0 = plant_x0, .P0 = plant_P0, .select = places, .R = noise, .range = ranges,  \
     .origin = origins, .rates = 1U, .rate_step = R(1), .tables = 1U, .table = table}
static const hg_fusion_config filter = FILTER(USUAL, 0U, 0U);
static const hg_fusion_config late_filter = FILTER(USUAL, DEPTH, 1U);
static const hg_fusion_config large_filter = FILTER(SENSORS, 0U, 0U);
static const hg_real least[SENSORS] = {EIGHT(R(0.5)), EIGHT(R(0.5))};
static const hg_consistency_config judge = {.onsets = ONSETS, .stride = 2U, .least = least, .limit = R(30), .confirm = 3U, .repeats = 4U, .rest = 5U};
static const hg_tracker_config usual = {.fusion = &filter, .consistency = &judge, .source = sources, .tick = &tick_message, .verdict = &verdict_message,
                                        .status = &status_message, .estimate = estimates, .heartbeat = 5U, .interval = 3U, .model_hash = HASH};

typedef struct {
    hg_tracker            self;
    hg_fusion_slot        slot[DEPTH + 1U];
    hg_fusion_entry       entry[(DEPTH + 1U) * SENSORS];
    hg_fusion_sensor      sensor[SENSORS];
    hg_fusion_record      record[SENSORS];
    int32_t               origin[STATES];
    hg_real               real[HG_FUSION_REALS(STATES, 0U, SENSORS, DEPTH)];
    hg_consistency_sum    sum[ONSETS * SENSORS];
    hg_consistency_sensor judged[SENSORS];
    hg_real               response[HG_CONSISTENCY_REALS(STATES, SENSORS, ONSETS)];
    hg_link               link[SENSORS + 1U];
    hg_real               estimate[2U * STATES];
    hg_verdict            verdict;
    uint8_t               ticks; /* counter of the next tick */
} rig;

static hg_tracker_memory memory_of(rig *r)
{
    return (hg_tracker_memory){
        .fusion = {.slot = r->slot, .entry = r->entry, .sensor = r->sensor, .record = r->record, .origin = r->origin, .real = r->real},
        .consistency = {.sum = r->sum, .sensor = r->judged, .real = r->response},
        .link = r->link,
        .real = r->estimate};
}

static void begin(rig *r, const hg_tracker_config *config, hg_start how)
{
    (void)memset(r, 0x5A, sizeof(*r));
    const hg_tracker_memory memory = memory_of(r);
    r->ticks = 3U;
    assert_status(HG_OK, hg_tracker_start(&r->self, config, &memory, how));
}

static hg_can_frame tick_frame(uint8_t counter, uint32_t k)
{
    hg_can_frame frame;
    hg_frame_pack(&tick_message, NULL, &frame);
    assert_status(HG_OK, hg_e2e_protect(tick_message.e2e, frame.data, frame.length, counter, (uint8_t)(k & 15U)));
    return frame;
}

static hg_status tick(rig *r, uint32_t k)
{
    const hg_can_frame frame = tick_frame(r->ticks++, k);
    return hg_tracker_receive(&r->self, &frame);
}

static hg_can_frame value_frame(uint8_t i, uint8_t counter, uint32_t k, double y)
{
    hg_can_frame frame;
    const int32_t code = hg_code_encode(messages[i].scale, R(y));
    hg_frame_pack(&messages[i], &code, &frame);
    assert_status(HG_OK, hg_e2e_protect(messages[i].e2e, frame.data, frame.length, counter, (uint8_t)(k & 15U)));
    return frame;
}

static hg_status value(rig *r, uint8_t i, uint8_t counter, uint32_t k, double y)
{
    const hg_can_frame frame = value_frame(i, counter, k, y);
    return hg_tracker_receive(&r->self, &frame);
}

static void step(rig *r)
{
    assert_status(HG_OK, hg_tracker_step(&r->self, &r->verdict));
}

static void assert_same_machine(const hg_e2e_machine *a, const hg_e2e_machine *b)
{
    assert_int_equal((int)a->state, (int)b->state);
    assert_count(a->ok, b->ok);
    assert_count(a->error, b->error);
}

/* A quiet sample: every sensor of `sends` says y. Counters follow the sample. */
static void sample(rig *r, uint32_t k, uint16_t sends, double y)
{
    for (uint8_t i = 0U; i < r->self.config->fusion->sensors; i++) {
        if ((((uint32_t)sends >> i) & 1U) != 0U) {
            assert_status(HG_OK, value(r, i, (uint8_t)(k & 15U), k, (places[i] == 0U) ? (y + (0.01 * (double)(((3U * k) + i) % 5U))) : (0.01 * (double)(k % 3U))));
        }
    }
    assert_status(HG_OK, tick(r, k));
    step(r);
}

/* ---- start ---- */

static void refused_config(const hg_tracker_config *config)
{
    static rig r;
    const hg_tracker_memory memory = memory_of(&r);
    assert_status(HG_E_CONFIG, hg_tracker_start(&r.self, config, &memory, HG_START_REST));
}

static void test_start_refuses_null_pointers(void **state)
{
    static rig r;
    (void)state;
    hg_tracker_memory memory = memory_of(&r);
    assert_status(HG_E_ARGUMENT, hg_tracker_start(NULL, &usual, &memory, HG_START_REST));
    assert_status(HG_E_ARGUMENT, hg_tracker_start(&r.self, NULL, &memory, HG_START_REST));
    assert_status(HG_E_ARGUMENT, hg_tracker_start(&r.self, &usual, NULL, HG_START_REST));
    memory.link = NULL;
    assert_status(HG_E_ARGUMENT, hg_tracker_start(&r.self, &usual, &memory, HG_START_REST));
    memory = memory_of(&r);
    memory.real = NULL;
    assert_status(HG_E_ARGUMENT, hg_tracker_start(&r.self, &usual, &memory, HG_START_REST));
    memory = memory_of(&r);
    memory.fusion.slot = NULL;
    assert_status(HG_E_ARGUMENT, hg_tracker_start(&r.self, &usual, &memory, HG_START_REST));
    memory = memory_of(&r);
    memory.consistency.sum = NULL;
    assert_status(HG_E_ARGUMENT, hg_tracker_start(&r.self, &usual, &memory, HG_START_REST));
}

static void test_start_refuses_contradictions(void **state)
{
    (void)state;
    hg_tracker_config config = usual;
    config.fusion = NULL;
    refused_config(&config);
    config = usual;
    config.source = NULL;
    refused_config(&config);
    config = usual;
    config.estimate = NULL;
    refused_config(&config);
    config = usual;
    config.heartbeat = 0U;
    refused_config(&config);
    config = usual;
    config.interval = 0U;
    refused_config(&config);
    config = usual;
    config.tick = NULL;
    refused_config(&config);
    config = usual;
    config.status = NULL;
    refused_config(&config);
    config = usual;
    config.verdict = NULL;
    refused_config(&config);
    hg_fusion_config wrong = filter;
    config = usual;
    config.fusion = &wrong;
    wrong.watchdog = 1U;
    refused_config(&config);
    wrong = filter;
    wrong.inputs = 1U;
    wrong.B = plant_x0;
    refused_config(&config);
    wrong = filter;
    wrong.modulus = 15U;
    refused_config(&config);
}

static void test_start_refuses_frames_that_do_not_tell_their_sample(void **state)
{
    (void)state;
    hg_tracker_config config = usual;
    hg_e2e_config rule = rules[2];
    hg_message message = tick_message;
    message.e2e = &rule;
    config.tick = &message;
    rule.stamp = HG_E2E_NO_STAMP;
    refused_config(&config);
    rule = rules[2];
    rule.ignore = HG_E2E_IGNORE_COUNTER;
    refused_config(&config);
    rule = rules[2];
    message.length = 9U; /* no classic frame */
    refused_config(&config);
    message = messages[0]; /* a tick with a value */
    refused_config(&config);
    config = usual;
    hg_message own[STATES] = {estimates[0], estimates[1]};
    config.estimate = own;
    own[1].width = 1U;
    refused_config(&config);
    own[1] = estimates[1];
    own[1].length = 7U;
    refused_config(&config);
}

static void test_start_refuses_a_wrong_consistency_test(void **state)
{
    (void)state;
    hg_tracker_config config = usual;
    hg_consistency_config wrong = judge;
    wrong.onsets = 0U;
    config.consistency = &wrong;
    refused_config(&config);
}

static void test_the_least_of_every_number_will_do(void **state)
{
    static rig r;
    (void)state;
    hg_tracker_config config = usual;
    config.heartbeat = 1U;
    config.interval = 1U;
    begin(&r, &config, HG_START_REST);
}

static void test_start_looks_at_the_first_message_too(void **state)
{
    (void)state;
    hg_tracker_config config = usual;
    hg_tracker_source own[USUAL] = {sources[0], sources[1], sources[2]};
    hg_message message = messages[0];
    hg_e2e_config rule = rules[0];
    config.source = own;
    own[0].message = &message;
    message.e2e = &rule;
    rule.stamp = HG_E2E_NO_STAMP;
    refused_config(&config);
    config = usual;
    hg_message said[STATES] = {estimates[0], estimates[1]};
    config.estimate = said;
    said[0].width = 1U;
    refused_config(&config);
}

/* ---- frames ---- */

static void test_identifiers_of_29_bits(void **state)
{
    static rig r;
    (void)state;
    hg_tracker_config config = usual;
    hg_tracker_source own[USUAL] = {sources[0], sources[1], sources[2]};
    hg_message message = messages[0];
    message.flags = HG_CAN_EXTENDED;
    own[0].message = &message;
    config.source = own;
    begin(&r, &config, HG_START_REST);
    hg_can_frame frame = value_frame(0U, 0U, 0U, 0.5);
    assert_status(HG_E_ID, hg_tracker_receive(&r.self, &frame));
    frame.flags |= HG_CAN_EXTENDED;
    assert_status(HG_OK, hg_tracker_receive(&r.self, &frame));
}

static void test_what_is_not_for_us(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    hg_can_frame frame = value_frame(0U, 0U, 0U, 0.5);
    frame.id = 0x7FFU;
    assert_status(HG_E_ID, hg_tracker_receive(&r.self, &frame));
    frame.id = 0x100U;
    frame.flags = HG_CAN_EXTENDED;
    assert_status(HG_E_ID, hg_tracker_receive(&r.self, &frame));
    assert_count(2U, r.self.unknown);
    r.self.unknown = UINT32_MAX;
    assert_status(HG_E_ID, hg_tracker_receive(&r.self, &frame));
    assert_count(UINT32_MAX, r.self.unknown);
    frame.flags = 0U;
    frame.length = 5U;
    assert_status(HG_E_FORMAT, hg_tracker_receive(&r.self, &frame));
    frame.length = 6U;
    frame.data[3] ^= 0x10U;
    assert_status(HG_E_CRC, hg_tracker_receive(&r.self, &frame));
    assert_count(1U, hg_tracker_health(&r.self, 0U)->format);
    assert_count(1U, hg_tracker_health(&r.self, 0U)->crc);
    assert_count(0U, hg_tracker_health(&r.self, 0U)->good);
}

static void test_values_and_doubles(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    assert_status(HG_OK, value(&r, 0U, 4U, 0U, 0.5));
    assert_status(HG_E_REPEATED, value(&r, 0U, 4U, 0U, 0.5));
    assert_status(HG_E_SEQUENCE, value(&r, 0U, 5U, 0U, 0.75)); /* two frames of one sample */
    assert_count(1U, hg_tracker_health(&r.self, 0U)->repeated);
    assert_count(1U, hg_tracker_health(&r.self, 0U)->sequence);
    assert_status(HG_E_EMPTY, hg_tracker_step(&r.self, &r.verdict));
    assert_status(HG_OK, tick(&r, 0U));
    assert_status(HG_E_BUSY, value(&r, 1U, 0U, 0U, 0.5));
    hg_tracker_overdue(&r.self); /* a step is due already */
    assert_count(1U, r.self.due);
    step(&r);
    assert_status(HG_E_EMPTY, hg_tracker_step(&r.self, &r.verdict));
    assert_count(0U, r.verdict.k);
    assert_count(HASH, r.verdict.model_hash);
    assert_true(r.verdict.basis == HG_BASIS_STATISTICAL);
    assert_count(0U, r.self.overdue);
    assert_near(0.47, r.estimate[0], 0.01); /* P = 1.25 beside R = 0.0625 */
    assert_near(0.244, r.estimate[STATES], 0.002);
    assert_real(r.self.value[0], r.estimate[0]);
    assert_count(1U, hg_tracker_health(&r.self, USUAL)->good);
    const hg_can_frame again = tick_frame(3U, 0U);
    assert_status(HG_E_REPEATED, hg_tracker_receive(&r.self, &again)); /* the tick, once more */
    assert_count(1U, hg_tracker_health(&r.self, USUAL)->repeated);
    assert_count(0U, hg_tracker_health(&r.self, USUAL)->late);
    assert_count(1U, hg_tracker_health(&r.self, USUAL)->good);
}

static void test_each_state_has_its_estimate(void **state)
{
    static rig r;
    (void)state;
    hg_tracker_config config = usual;
    config.consistency = NULL;
    begin(&r, &config, HG_START_REST);
    for (uint32_t k = 0U; k < 10U; k++) {
        assert_status(HG_OK, value(&r, 2U, (uint8_t)(k & 15U), k, 3.0)); /* the second one is measured, */
        const hg_fusion_slot *slot = &r.slot[r.self.fusion.newest];
        const double P = (double)slot->P[3];
        const double predicted = (double)slot->x[1];
        assert_status(HG_OK, tick(&r, k));
        step(&r);
        if (k >= HEARTBEAT) { /* and the others are overdue */
            assert_near(predicted + (P / (P + 0.0625) * (3.0 - predicted)), r.estimate[1], 1e-4);
            assert_near(sqrt(P * 0.0625 / (P + 0.0625)), r.estimate[STATES + 1U], 1e-4);
        }
    }
}

static void test_twins_and_doubles_say_nothing_of_a_sender(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    for (uint32_t k = 0U; k < 3U; k++) {
        sample(&r, k, 7U, 0.0);
    }
    const hg_can_frame frame = value_frame(0U, 3U, 3U, 0.5);
    hg_can_frame twin = frame;
    twin.length = 5U;
    assert_status(HG_OK, hg_tracker_receive(&r.self, &frame));
    const hg_e2e_machine before = r.link[0].machine;
    assert_true(before.ok != 0U);
    assert_status(HG_E_REPEATED, hg_tracker_receive(&r.self, &frame));
    assert_same_machine(&before, &r.link[0].machine);
    assert_status(HG_E_FORMAT, hg_tracker_receive(&r.self, &twin));
    assert_same_machine(&before, &r.link[0].machine);
}

static void test_what_cannot_be_used(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    assert_status(HG_E_NUMERIC, value(&r, 0U, 4U, 0U, 1e9)); /* encoded as no value */
    assert_count(1U, hg_tracker_health(&r.self, 0U)->invalid);
    assert_count(1U, hg_tracker_health(&r.self, 0U)->numeric);
    assert_count(0U, hg_tracker_health(&r.self, 0U)->good);
    assert_count(0U, r.sensor[0].refused); /* the filter is not asked */
    hg_tracker_overdue(&r.self);
    step(&r);
    assert_true(r.verdict.refused); /* of one sensor alone */
    begin(&r, &usual, HG_START_REST);
    hg_can_frame frame = value_frame(2U, 0U, 0U, 0.5);
    frame.data[2] = 0U;
    frame.data[3] = 0U;
    frame.data[4] = 0x80U;
    frame.data[5] = 0x7FU; /* infinity */
    assert_status(HG_OK, hg_e2e_protect(messages[2].e2e, frame.data, 6U, 0U, 0U));
    assert_status(HG_E_NUMERIC, hg_tracker_receive(&r.self, &frame));
    assert_status(HG_OK, value(&r, 1U, 0U, 0U, 0.5));
    assert_status(HG_OK, tick(&r, 0U));
    step(&r);
    assert_true(r.verdict.refused);
    frame = value_frame(1U, 1U, 1U, 0.5);
    for (uint8_t c = 1U; c < 5U; c++) {
        frame.data[3] = (uint8_t)(frame.data[3] + c);
        assert_status(HG_E_CRC, hg_tracker_receive(&r.self, &frame));
    }
    assert_status(HG_E_STATE, value(&r, 1U, 1U, 1U, 0.5)); /* too many damaged ones before */
    assert_count(1U, hg_tracker_health(&r.self, 1U)->untrusted);
}

static void test_lost_frames_show_in_the_counter(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    sample(&r, 0U, 7U, 0.0);
    sample(&r, 1U, 6U, 0.0);
    assert_status(HG_OK, value(&r, 0U, 2U, 2U, 0.0)); /* 1 was lost */
    assert_status(HG_OK, tick(&r, 2U));
    step(&r);
    assert_count(1U, hg_tracker_health(&r.self, 0U)->lost);
    assert_count((uint32_t)HG_BUS_LOSSY, (uint32_t)r.verdict.bus & 3U);
    assert_status(HG_OK, value(&r, 0U, 3U, 3U, 0.0));
    assert_status(HG_E_SEQUENCE, value(&r, 1U, 9U, 3U, 0.0)); /* it cannot have sent so many */
    assert_status(HG_OK, tick(&r, 3U));
    step(&r);
    assert_count((uint32_t)HG_BUS_GOOD, (uint32_t)r.verdict.bus & 3U);
    assert_count(1U, hg_tracker_health(&r.self, 0U)->lost);
    assert_count(0U, hg_tracker_health(&r.self, 1U)->lost); /* of those that it cannot have sent none is counted as lost */
    assert_count((uint32_t)HG_BUS_GOOD, ((uint32_t)r.verdict.bus >> 2U) & 3U);
    hg_link_health *health = &r.link[0].health;
    health->lost = UINT16_MAX - 1U;
    assert_status(HG_OK, tick(&r, 4U));
    step(&r);
    assert_status(HG_OK, tick(&r, 5U));
    step(&r);
    assert_status(HG_OK, value(&r, 0U, 6U, 6U, 0.0)); /* two were lost, and there is room for one */
    assert_status(HG_OK, value(&r, 2U, 6U, 6U, 0.0));
    assert_status(HG_OK, tick(&r, 6U));
    step(&r);
    assert_count(UINT16_MAX, health->lost);
    assert_count((uint32_t)HG_BUS_LOSSY, (uint32_t)r.verdict.bus & 3U);
    assert_status(HG_OK, value(&r, 2U, 7U, 7U, 0.0)); /* another sensor's frame says nothing of it */
    assert_status(HG_OK, tick(&r, 7U));
    step(&r);
    assert_count((uint32_t)HG_BUS_LOSSY, (uint32_t)r.verdict.bus & 3U);
    assert_count((uint32_t)HG_BUS_GOOD, ((uint32_t)r.verdict.bus >> 4U) & 3U);
}

/* A frame of sample 20 + ahead, modulo 16, while 20 is open. */
static void test_a_frame_of_another_sample_was_sent_in_that(void **state)
{
    (void)state;
    for (uint32_t ahead = 1U; ahead < 16U; ahead++) {
        static rig r;
        begin(&r, &usual, HG_START_REST);
        for (uint32_t k = 0U; k < 20U; k++) {
            assert_status(HG_OK, tick(&r, k));
            step(&r);
        }
        const bool late = ahead > 7U;
        const uint32_t of = late ? (20U + ahead - 16U) : (20U + ahead);
        assert_status(HG_E_STAMP, value(&r, 0U, 3U, of, 0.0));
        assert_count(of, r.link[0].k);
        assert_count(late ? 1U : 0U, r.link[0].health.late);
        assert_count(late ? 0U : 1U, r.link[0].health.early);
        assert_status(HG_E_STAMP, value(&r, 0U, 13U, of, 1.0)); /* ten frames more in the same sample: not believed, and nothing moves */
        assert_count(of, r.link[0].k);
        assert_count(3U, r.link[0].receiver.counter);
    }
}

static void test_a_counter_moves_no_further_than_the_samples(void **state)
{
    (void)state;
    static const struct {
        uint32_t  passed; /* samples since the last frame, by its stamp */
        uint8_t   moved;
        hg_status status;
    } cases[] = {{1U, 2U, HG_E_SEQUENCE}, {2U, 2U, HG_OK}, {32767U, 9U, HG_OK}, {32768U, 1U, HG_E_SEQUENCE}, {(uint32_t)-3, 1U, HG_E_SEQUENCE}};
    for (size_t i = 0U; i < COUNT(cases); i++) {
        static rig r;
        begin(&r, &usual, HG_START_REST);
        for (uint32_t k = 0U; k < 12U; k++) {
            sample(&r, k, 1U, 0.0);
        }
        r.link[0].k = r.self.k - cases[i].passed;
        assert_status(cases[i].status, value(&r, 0U, (uint8_t)((11U + cases[i].moved) & 15U), 12U, 0.0));
        assert_count((cases[i].status == HG_OK) ? (cases[i].moved - 1U) : 0U, r.link[0].health.lost);
        assert_count(12U, r.link[0].k); /* it was received all the same */
    }
}

static void test_a_stamp_names_its_sample(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    sample(&r, 0U, 1U, 0.0);
    assert_status(HG_E_STAMP, value(&r, 0U, 1U, 3U, 0.0)); /* early: a tick is missing here */
    assert_count(1U, hg_tracker_health(&r.self, 0U)->early);
    assert_status(HG_E_STAMP, value(&r, 1U, 1U, 0U, 0.0)); /* late, and in sequence */
    assert_count(1U, hg_tracker_health(&r.self, 1U)->late);
    assert_status(HG_E_STAMP, value(&r, 1U, 9U, 0U, 0.0)); /* late, and an old one */
    assert_count(2U, hg_tracker_health(&r.self, 1U)->late);
    static rig held;
    hg_tracker_config config = usual;
    config.fusion = &late_filter;
    begin(&held, &config, HG_START_REST);
    sample(&held, 0U, 1U, 0.0);
    assert_status(HG_OK, value(&held, 1U, 1U, 0U, 0.0)); /* a sample late, as a matter of course */
    sample(&held, 1U, 1U, 0.0);
    held.self.link[0].k = held.self.k - 70000U; /* long ago: no counter can be wrong */
    assert_status(HG_E_SEQUENCE, value(&held, 0U, 9U, 2U, 0.0));
}

static void test_a_value_goes_round(void **state)
{
    static rig r;
    static rig sensor;
    static const double speed = 6.0; /* in half a time unit 3, which the origin follows */
    (void)state;
    begin(&r, &usual, HG_START_REST);
    begin(&sensor, &usual, HG_START_REST);
    hg_fusion_sender sender;
    assert_status(HG_OK, hg_fusion_sender_start(&sender, &sensor.self, 1U));
    for (uint32_t k = 0U; k < 200U; k++) {
        hg_can_frame frame;
        const double y = -0.5 * speed * (double)k;
        if (hg_fusion_sender_step(&sender, R(y), R(0), false, &frame) == HG_OK) {
            int32_t code = 0;
            assert_status(HG_OK, hg_frame_unpack(&messages[1], &frame, &code));
            const double turns = ((y * PER) - (double)code) / 65535.0; /* as many codes as there are */
            assert_near(floor(turns + 0.5), turns, 1e-3);
            assert_status(HG_OK, hg_tracker_receive(&r.self, &frame));
            assert_status(HG_OK, hg_tracker_receive(&sensor.self, &frame));
        }
        const hg_can_frame closing = tick_frame((uint8_t)(k & 15U), k);
        assert_status(HG_OK, hg_tracker_receive(&r.self, &closing));
        assert_status(HG_OK, hg_tracker_receive(&sensor.self, &closing));
        step(&r);
        step(&sensor);
        assert_count(hg_tracker_digest(&r.self.fusion, 7U), hg_tracker_digest(&sensor.self.fusion, 7U));
        if (k > 20U) {
            assert_near(y, r.estimate[0], 0.6);
        }
    }
    assert_true(r.origin[0] < -30); /* -597 in steps of 16 */
    /* Of a sample that is not held: by the present origin. */
    assert_near(-512.0 - (16.0 * (double)r.origin[0]), hg_fusion_local(&r.self.fusion, 0U, (uint8_t)((r.self.k + 5U) & 15U), R(-512)), 1e-6);
}

/* A sensor of an angle in turns: the circle has 65 535 codes. */
static void test_a_turn_is_sent_as_the_nearest_code(void **state)
{
    (void)state;
    static const hg_code_scale turn_scale[1] = {{.resolution = R(1.0 / 65536.0), .per_unit = R(65536), .minimum = -32767, .maximum = 32767}};
    static const double at[] = {0.0, 0.25, 0.49, 0.7, 0.99, 1.3, 2.75, 32767.5 / 65536.0, 98302.5 / 65536.0};
    static rig r;
    hg_tracker_config config = usual;
    hg_tracker_source own[USUAL] = {sources[0], sources[1], sources[2]};
    hg_message message = messages[1];
    message.scale = turn_scale;
    own[1].message = &message;
    config.source = own;
    begin(&r, &config, HG_START_REST);
    hg_fusion_sender sender;
    assert_status(HG_OK, hg_fusion_sender_start(&sender, &r.self, 1U));
    for (size_t i = 0U; i < (2U * COUNT(at)); i++) {
        const double y = ((i % 2U) == 0U) ? at[i / 2U] : -at[i / 2U];
        hg_can_frame frame;
        int32_t code = 0;
        assert_status(HG_OK, hg_fusion_sender_step(&sender, R(y), R(0), true, &frame));
        assert_status(HG_OK, hg_frame_unpack(&message, &frame, &code));
        const double turns = ((y * 65536.0) - (double)code) / 65535.0;
        assert_near(floor(turns + 0.5), turns, 0.6 / 65535.0); /* the nearest code, but for half of one where the circle closes */
        assert_true((code >= -32767) && (code <= 32767));
    }
}

static void test_a_value_that_does_not_go_round_is_what_it_says(void **state)
{
    (void)state;
    static rig r;
    begin(&r, &usual, HG_START_REST);
    sample(&r, 0U, 1U, -900.0);
    assert_status(HG_OK, value(&r, 0U, 1U, 1U, 990.0)); /* more than half of all codes away */
    const double origin = 16.0 * r.origin[0];
    assert_status(HG_OK, tick(&r, 1U));
    step(&r);
    assert_near(990.0 - origin, r.record[0].y, 1e-3);
}

/* ---- time ---- */

static void test_a_tick_may_be_seven_samples_ahead(void **state)
{
    (void)state;
    for (uint32_t ahead = 6U; ahead <= 9U; ahead++) {
        static rig r;
        begin(&r, &usual, HG_START_REST);
        sample(&r, 0U, 7U, 0.0);
        assert_status((ahead <= 7U) ? HG_OK : HG_E_STAMP, tick(&r, 1U + ahead));
        assert_count((ahead <= 7U) ? (ahead + 1U) : 0U, r.self.due);
        assert_count((ahead <= 7U) ? 0U : 1U, hg_tracker_health(&r.self, USUAL)->late);
        begin(&r, &usual, HG_START_REST);
        hg_tracker_expect(&r.self, 6U);
        assert_count(6U, r.self.ahead_max);
        sample(&r, 0U, 7U, 0.0);
        assert_status((ahead <= 6U) ? HG_OK : HG_E_STAMP, tick(&r, 1U + ahead));
        assert_count((ahead == 7U) ? 1U : 0U, hg_tracker_health(&r.self, USUAL)->early);
        assert_count((ahead > 7U) ? 1U : 0U, hg_tracker_health(&r.self, USUAL)->late);
    }
}

/* Counters that go round at another number; between the two late ones a good tick says that they meant nothing. */
static void test_two_late_ticks_in_a_row_are_believed(void **state)
{
    (void)state;
    static rig r;
    begin(&r, &usual, HG_START_REST);
    for (uint32_t k = 0U; k < 12U; k++) {
        sample(&r, k, 7U, 0.0);
    }
    hg_can_frame frame = tick_frame(15U, 5U);
    assert_status(HG_E_STAMP, hg_tracker_receive(&r.self, &frame));
    frame = tick_frame(5U, 12U);
    assert_status(HG_OK, hg_tracker_receive(&r.self, &frame));
    step(&r);
    frame = tick_frame(0U, 6U); /* goes on from the late one, but another has come since */
    assert_status(HG_E_STAMP, hg_tracker_receive(&r.self, &frame));
    assert_count(2U, hg_tracker_health(&r.self, USUAL)->late);
    frame = tick_frame(1U, 7U);
    assert_status(HG_OK, hg_tracker_receive(&r.self, &frame));
    assert_count(2U, hg_tracker_health(&r.self, USUAL)->late); /* that is not late, it is the time */
    step(&r);
    assert_count(23U, r.verdict.k); /* 7 modulo 16, after 12 */
    for (uint8_t i = 0U; i < USUAL; i++) { /* nobody knows how many samples have really passed: counters may be anywhere */
        assert_status(HG_OK, value(&r, i, 9U, 24U, 0.0));
    }
}

static void test_late_ticks_with_counters_of_fifteen(void **state)
{
    (void)state;
    static const hg_e2e_config rule = {.profile = HG_E2E_P01, .mode = HG_E2E_BOTH, .data_id = 5U, .crc = 0U, .counter = 8U, .stamp = 12U, .limits = &hg_e2e_limits_default};
    static rig r;
    hg_tracker_config config = usual;
    hg_fusion_config own_filter = filter;
    hg_tracker_source own[USUAL];
    hg_message message[USUAL];
    hg_message own_tick = tick_message;
    own_filter.modulus = 15U;
    own_tick.e2e = &rule;
    for (uint8_t i = 0U; i < USUAL; i++) {
        message[i] = messages[i];
        message[i].e2e = &rule;
        own[i] = sources[i];
        own[i].message = &message[i];
    }
    config.fusion = &own_filter;
    config.source = own;
    config.tick = &own_tick;
    for (uint8_t first = 13U; first <= 14U; first++) { /* not round, and round */
        begin(&r, &config, HG_START_REST);
        for (uint8_t n = 0U; n < 2U; n++) {
            hg_can_frame frame;
            hg_frame_pack(&own_tick, NULL, &frame);
            assert_status(HG_OK, hg_e2e_protect(&rule, frame.data, frame.length, (uint8_t)((first + n) % 15U), (uint8_t)(9U + n)));
            assert_status((n == 0U) ? HG_E_STAMP : HG_OK, hg_tracker_receive(&r.self, &frame));
        }
    }
}

static void test_the_first_tick_tells_the_time(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_MOVING);
    hg_fusion_sender sender;
    hg_can_frame frame;
    assert_status(HG_OK, hg_fusion_sender_start(&sender, &r.self, 0U));
    assert_status(HG_E_STATE, hg_fusion_sender_step(&sender, R(0), R(0), false, &frame));
    assert_status(HG_E_STAMP, value(&r, 0U, 0U, 5U, 0.0));
    assert_count(0U, hg_tracker_health(&r.self, 0U)->early);
    assert_status(HG_OK, tick(&r, 5U));
    assert_status(HG_E_STATE, hg_fusion_sender_step(&sender, R(0), R(0), false, &frame)); /* a step is due */
    step(&r);
    assert_count(5U, r.verdict.k);
    sample(&r, 6U, 7U, 0.0);
    assert_count(6U, r.verdict.k);
}

static void test_samples_without_a_tick(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    sample(&r, 0U, 7U, 0.0);
    assert_status(HG_OK, tick(&r, 3U)); /* those of 1 and 2 are gone */
    assert_count(3U, r.self.due);
    step(&r);
    step(&r);
    step(&r);
    assert_count(3U, r.verdict.k);
    assert_count(2U, r.self.overdue);
    assert_count(2U, hg_tracker_health(&r.self, USUAL)->lost);
    hg_tracker_overdue(&r.self);
    assert_count(1U, r.self.due);
    step(&r);
    assert_count(4U, r.verdict.k);
    assert_count(3U, r.self.overdue);
    r.self.overdue = UINT32_MAX;
    hg_tracker_overdue(&r.self);
    step(&r);
    assert_count(UINT32_MAX, r.self.overdue);
}

static void test_a_late_tick_is_refused_and_two_are_believed(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    for (uint32_t k = 0U; k < 12U; k++) {
        sample(&r, k, 7U, 0.0);
    }
    hg_can_frame frame = tick_frame(1U, 5U);
    assert_status(HG_E_STAMP, hg_tracker_receive(&r.self, &frame));
    assert_count(1U, hg_tracker_health(&r.self, USUAL)->late);
    frame = tick_frame(2U, 7U); /* its stamp does not go on from that */
    assert_status(HG_E_STAMP, hg_tracker_receive(&r.self, &frame));
    frame = tick_frame(9U, 8U); /* nor its counter */
    assert_status(HG_E_STAMP, hg_tracker_receive(&r.self, &frame));
    hg_tracker_expect(&r.self, 2U);
    frame = tick_frame(10U, 15U); /* three ahead is more than the clock allows */
    assert_status(HG_E_STAMP, hg_tracker_receive(&r.self, &frame));
    assert_count(1U, hg_tracker_health(&r.self, USUAL)->early);
    frame = tick_frame(11U, 16U); /* but so says its sender again */
    assert_status(HG_OK, hg_tracker_receive(&r.self, &frame));
    step(&r);
    assert_count(16U, r.verdict.k);
    assert_true(r.verdict.plant == HG_PLANT_STARTING);
    hg_tracker_expect(&r.self, 70U);
    assert_count(7U, r.self.ahead_max);
}

static void test_an_outage_begins_again(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    for (uint32_t k = 0U; k < 9U; k++) {
        sample(&r, k, 7U, 3.0);
    }
    assert_true(r.verdict.plant == HG_PLANT_NONE);
    hg_tracker_outage(&r.self);
    assert_status(HG_E_STAMP, value(&r, 0U, 0U, 9U, 0.0));
    assert_status(HG_OK, tick(&r, 13U));
    step(&r);
    assert_count(13U, r.verdict.k);
    assert_true(r.verdict.plant == HG_PLANT_STARTING);
    assert_near(0.0, r.estimate[0], 1e-6);
}

/* Counters that went round meanwhile: frames that look like the last ones are new; a step that was due is not; nor is what was estimated. */
static void test_after_an_outage_nothing_is_repeated(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    for (uint32_t k = 0U; k < 4U; k++) {
        sample(&r, k, 7U, 3.0);
    }
    hg_can_frame last[USUAL];
    for (uint8_t i = 0U; i < USUAL; i++) {
        last[i] = value_frame(i, 4U, 4U, 3.0);
        assert_status(HG_OK, hg_tracker_receive(&r.self, &last[i]));
    }
    const hg_can_frame last_tick = tick_frame(r.ticks, 4U);
    assert_status(HG_OK, hg_tracker_receive(&r.self, &last_tick));
    hg_tracker_outage(&r.self);
    assert_status(HG_E_EMPTY, hg_tracker_step(&r.self, &r.verdict));
    hg_tracker_overdue(&r.self);
    step(&r);
    assert_real(0.0, r.estimate[0]); /* what it was at the start, not what it was before */
    assert_status(HG_OK, hg_tracker_receive(&r.self, &last_tick));
    step(&r);
    const hg_can_frame next = tick_frame(1U, 12U); /* ahead of the frames by 16, less one */
    assert_status(HG_OK, hg_tracker_receive(&r.self, &next));
    while (r.self.due > 0U) {
        step(&r);
    }
    const hg_can_frame full = tick_frame(2U, 19U);
    assert_status(HG_OK, hg_tracker_receive(&r.self, &full));
    while (r.self.due > 0U) {
        step(&r);
    }
    for (uint8_t i = 0U; i < USUAL; i++) {
        assert_status(HG_OK, hg_tracker_receive(&r.self, &last[i]));
    }
}

/* ---- suspects ---- */

static void test_a_dead_sensor_is_suspected_and_comes_back(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    for (uint32_t k = 0U; k < 20U; k++) {
        sample(&r, k, 7U, 0.0);
    }
    assert_true(r.verdict.plant == HG_PLANT_NONE);
    for (uint32_t k = 20U; k < (19U + WATCHDOG); k++) {
        sample(&r, k, 5U, 0.0);
        assert_count(0U, r.verdict.candidates);
    }
    assert_count((uint32_t)HG_BUS_LOSSY, ((uint32_t)r.verdict.bus >> 2U) & 3U);
    sample(&r, 28U, 5U, 0.0);
    assert_count(2U, r.verdict.candidates);
    assert_true(r.verdict.plant == HG_PLANT_CONFIRMED);
    assert_count((uint32_t)HG_BUS_STALE, ((uint32_t)r.verdict.bus >> 2U) & 3U);
    sample(&r, 29U, 7U, 0.0);
    assert_count(0U, r.verdict.candidates);
    assert_true(r.verdict.plant == HG_PLANT_NONE);
}

/* The frame of sample k of the second sensor comes after the tick of that sample; the others' in time. */
static void delayed(rig *r, uint32_t k, uint16_t sends)
{
    if (k > 0U) {
        const uint32_t before = k - 1U;
        assert_status(HG_OK, value(r, 1U, (uint8_t)(before & 15U), before, 0.01 * (double)(before % 5U)));
    }
    sample(r, k, sends, 0.0);
}

static void test_a_frame_within_the_delay_is_not_overdue(void **state)
{
    static rig r;
    hg_tracker_config config = usual;
    (void)state;
    config.fusion = &late_filter;
    begin(&r, &config, HG_START_REST);
    for (uint32_t k = 0U; k < 20U; k++) {
        delayed(&r, k, 5U);
    }
    assert_count(20U - 1U, hg_tracker_health(&r.self, 1U)->good);
    assert_count(0U, hg_tracker_health(&r.self, 1U)->late); /* as a matter of course */
    for (uint32_t k = 20U; k <= (18U + HEARTBEAT); k++) {
        sample(&r, k, 5U, 0.0); /* in the last one it had to speak, and the frame may be on its way */
    }
    assert_count((uint32_t)HG_BUS_GOOD, ((uint32_t)r.verdict.bus >> 2U) & 3U);
    assert_count(1U, (uint32_t)r.link[1].machine.ok & 1U);
    sample(&r, 18U + HEARTBEAT + 1U, 5U, 0.0);
    assert_count((uint32_t)HG_BUS_LOSSY, ((uint32_t)r.verdict.bus >> 2U) & 3U);
    assert_count(0U, (uint32_t)r.link[1].machine.ok & 1U);
}

static void test_nobody_heard_is_the_bus(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    for (uint32_t k = 0U; k < 300U; k++) {
        sample(&r, k, (k < 20U) ? 3U : 0U, 0.0);
        if (k == 19U) {
            assert_count(4U, r.verdict.candidates); /* the third has never been there */
        }
    }
    assert_count(0U, r.verdict.candidates);
    assert_true(r.verdict.plant == HG_PLANT_STARTING);
    assert_count(((uint32_t)HG_BUS_STALE * 5U), r.verdict.bus); /* the others; the third is absent */
}

static void test_a_biased_sensor_is_taken_out(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    uint32_t k = 0U;
    for (; k < 20U; k++) {
        sample(&r, k, 7U, 0.0);
    }
    for (; (k < 60U) && (r.verdict.candidates == 0U); k++) {
        assert_status(HG_OK, value(&r, 0U, (uint8_t)(k & 15U), k, 2.0 + (0.01 * (double)(k % 5U))));
        sample(&r, k, 6U, 0.0);
    }
    assert_count(1U, r.verdict.candidates);
    assert_true(r.verdict.plant == HG_PLANT_CONFIRMED);
    assert_count(1U, r.self.blamed);
    for (uint32_t end = k + 30U; k < end; k++) {
        assert_status(HG_OK, value(&r, 0U, (uint8_t)(k & 15U), k, 2.0 + (0.01 * (double)(k % 5U))));
        sample(&r, k, 6U, 0.0);
    }
    assert_count(1U, r.verdict.candidates);
    assert_near(0.02, r.estimate[0], 0.05);
}

/* Any sensor can be the one; it is out from the next sample on, the judge rests, and stays its suspect when it falls silent. */
static void test_whoever_is_biased_is_out_and_the_judge_rests(void **state)
{
    (void)state;
    for (uint8_t faulty = 0U; faulty < USUAL; faulty++) {
        static rig r;
        begin(&r, &usual, HG_START_REST);
        uint32_t k = 0U;
        for (; k < 60U; k++) {
            if (k >= 20U) {
                assert_status(HG_OK, value(&r, faulty, (uint8_t)(k & 15U), k, 4.0 + (0.01 * (double)(k % 5U))));
            }
            sample(&r, k, (uint16_t)((k >= 20U) ? (7U & ~(1U << faulty)) : 7U), 0.0);
            assert_true(r.verdict.plant == ((r.self.blamed != 0U) ? HG_PLANT_CONFIRMED : ((k >= 4U) ? HG_PLANT_NONE : HG_PLANT_STARTING)));
            if (r.self.blamed != 0U) {
                break;
            }
        }
        assert_count(1U << faulty, r.self.blamed);
        assert_count(1U << faulty, r.self.fusion.excluded);
        assert_count(judge.rest, r.self.consistency.rests);
        assert_count(0U, r.self.consistency.blamed);
        for (uint32_t end = k + 20U; k < end;) {
            k++;
            sample(&r, k, (uint16_t)(7U & ~(1U << faulty)), 0.0);
        }
        assert_count(1U << faulty, r.verdict.candidates); /* taken out, and dead by now */
    }
}

/* Records of a state that is none say nothing of anybody, however long a sensor has led. */
static void test_a_lost_state_is_nobodys_fault(void **state)
{
    (void)state;
    static rig r;
    begin(&r, &usual, HG_START_REST);
    uint32_t k = 0U;
    for (; k < 20U; k++) {
        sample(&r, k, 7U, 0.0);
    }
    for (; (k < 40U) && (r.self.consistency.leads < (judge.confirm - 1U)); k++) {
        assert_status(HG_OK, value(&r, 0U, (uint8_t)(k & 15U), k, 4.0 + (0.01 * (double)(k % 5U))));
        sample(&r, k, 6U, 0.0);
    }
    assert_count(judge.confirm - 1U, r.self.consistency.leads);
    r.slot[r.self.fusion.newest].P[0] = REAL_NAN;
    sample(&r, k, 0U, 0.0);
    assert_count(1U, r.self.fusion.resets);
    assert_count(0U, r.self.blamed);
    assert_count(judge.rest, r.self.consistency.rests);
    assert_true(r.verdict.refused);
}

/* The heartbeat is overdue, once and again after each further one, until the age cannot be told any more. */
static void test_an_overdue_heartbeat_is_an_event_each_time(void **state)
{
    (void)state;
    static const uint8_t heartbeats[] = {2U, 3U, 4U, 11U};
    static const hg_e2e_machine valid = {.state = HG_E2E_VALID, .ok = 0x000FU, .error = 0U};
    for (size_t h = 0U; h < COUNT(heartbeats); h++) {
        static rig r;
        hg_tracker_config config = usual;
        hg_fusion_config own = filter;
        const uint32_t beat = heartbeats[h];
        own.heartbeat = heartbeats[h];
        own.watchdog = 20U;
        config.fusion = &own;
        config.consistency = NULL;
        begin(&r, &config, HG_START_REST);
        sample(&r, 0U, 7U, 0.0);
        for (uint32_t k = 1U; k < 300U; k++) {
            const uint16_t sends = (uint16_t)(1U << (1U + (h % 2U))); /* of three sensors one goes on */
            for (uint8_t i = 0U; i <= USUAL; i++) {
                r.link[i].machine = valid; /* so that one more event shows */
            }
            r.sensor[USUAL].age = (uint8_t)(beat + 1U); /* behind the last one: nobody's */
            sample(&r, k, sends, 0.0);
            const uint32_t age = (k < 254U) ? (k + 1U) : 255U; /* in the next sample, of a sensor that was heard in sample 0 */
            const bool event = (age > beat) && (age < 255U) && (((age - beat - 1U) % beat) == 0U);
            for (uint8_t i = 0U; i <= USUAL; i++) {
                hg_e2e_machine expected = valid;
                const bool heard = (i == USUAL) || ((((uint32_t)sends >> i) & 1U) != 0U); /* the tick always */
                if (heard) {
                    (void)hg_e2e_machine_step(&expected, &hg_e2e_limits_default, HG_OK);
                } else if (event) {
                    (void)hg_e2e_machine_step(&expected, &hg_e2e_limits_default, HG_E_EMPTY);
                } else {
                    /* nothing has happened */
                }
                assert_same_machine(&expected, &r.link[i].machine);
            }
        }
    }
}

static void test_without_a_consistency_test(void **state)
{
    static rig r;
    (void)state;
    hg_tracker_config config = usual;
    hg_fusion_config plain = filter;
    plain.origin = NULL;
    config.fusion = &plain;
    config.consistency = NULL;
    begin(&r, &config, HG_START_REST);
    sample(&r, 0U, 7U, 0.0);
    assert_true(r.verdict.plant == HG_PLANT_NONE);
    for (uint32_t k = 1U; k < 40U; k++) {
        assert_status(HG_OK, value(&r, 0U, (uint8_t)(k & 15U), k, 2.0));
        sample(&r, k, 6U, 0.0);
    }
    assert_count(0U, r.verdict.candidates);
}

static void test_a_state_that_is_lost_begins_again(void **state)
{
    static rig r;
    static const hg_real wild[STATES * STATES] = {R(1e30), R(0), R(0), R(1)};
    (void)state;
    hg_tracker_config config = usual;
    hg_fusion_config growing = filter;
    growing.A = wild;
    growing.origin = NULL;
    config.fusion = &growing;
    begin(&r, &config, HG_START_REST);
    for (uint32_t k = 0U; k < 9U; k++) {
        assert_status(HG_OK, tick(&r, k));
        step(&r);
    }
    assert_true(r.self.fusion.resets > 0U);
    assert_true(r.verdict.refused);
}

/* Two bits for sensors i and i + 8 together: the larger number, whichever of the two has it. */
static void test_sixteen_bits_of_health_serve_sixteen_sensors(void **state)
{
    static rig r;
    (void)state;
    hg_tracker_config config = usual;
    config.fusion = &large_filter;
    config.consistency = NULL;
    begin(&r, &config, HG_START_REST);
    sample(&r, 0U, 0x0FEU, 0.0);
    assert_count(0x5554U, r.verdict.bus); /* the first has never been there, and none of the last eight */
    sample(&r, 1U, 0xFFFFU, 0.0);
    assert_count(0x5555U, r.verdict.bus);
    for (uint32_t k = 2U; k < 20U; k++) {
        sample(&r, k, 0xD7FEU, 0.0); /* without 0, and 11 and 13 */
    }
    assert_count(0x5555U | 0x0003U | 0x00C0U | 0x0C00U, r.verdict.bus);
    assert_count((1U << 0U) | (1U << 11U) | (1U << 13U), r.verdict.candidates);
    for (uint32_t k = 20U; k < 40U; k++) {
        sample(&r, k, 0xFEFBU, 0.0); /* without 2 and 8 */
    }
    assert_count(0x5555U | 0x0003U | 0x0030U, r.verdict.bus);
    assert_count((1U << 2U) | (1U << 8U), r.verdict.candidates);
    begin(&r, &config, HG_START_REST);
    sample(&r, 0U, 0xFFFFU, 0.0);
    sample(&r, 1U, 0xFBF7U, 0.0);
    sample(&r, 2U, 0xFFFFU, 0.0); /* frames of 3 and 10 were lost; those of 11 and 2 were not */
    assert_count(0x55A5U, r.verdict.bus);
}

/* ---- reports ---- */

static void test_reports(void **state)
{
    static rig r;
    hg_can_frame frame[2];
    hg_verdict told;
    bool reply = false;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    sample(&r, 0U, 7U, 0.0);
    assert_count(2U, hg_tracker_report(&r.self, &r.verdict, false, frame)); /* the first always */
    assert_status(HG_OK, hg_verdict_read(&verdict_message, &frame[0], &told, &reply));
    assert_false(reply);
    assert_true((told.basis == HG_BASIS_STATISTICAL) && (told.k == 0U));
    assert_count(0x78U, frame[1].data[2]);
    assert_count(0x12U, frame[1].data[5]);
    sample(&r, 1U, 7U, 0.0);
    assert_count(0U, hg_tracker_report(&r.self, &r.verdict, false, frame));
    sample(&r, 2U, 7U, 0.0);
    assert_count(1U, hg_tracker_report(&r.self, &r.verdict, true, frame));
    assert_status(HG_OK, hg_verdict_read(&verdict_message, &frame[0], &told, &reply));
    assert_true(reply);
    hg_verdict other = r.verdict;
    other.plant = HG_PLANT_CONFIRMED;
    assert_count(1U, hg_tracker_report(&r.self, &other, false, frame));
    other.candidates = 4U;
    assert_count(1U, hg_tracker_report(&r.self, &other, false, frame));
    other.bus ^= 3U;
    assert_count(2U, hg_tracker_report(&r.self, &other, false, frame)); /* and the heartbeat */
    other.refused = true;
    assert_count(1U, hg_tracker_report(&r.self, &other, false, frame));
    assert_status(HG_OK, hg_verdict_read(&verdict_message, &frame[0], &told, &reply));
    assert_true((told.plant == HG_PLANT_CONFIRMED) && (told.candidates == 4U) && told.refused);
    for (uint8_t i = 0U; i < 3U; i++) {
        assert_count(0U, hg_tracker_report(&r.self, &other, false, frame));
    }
    assert_count(2U, hg_tracker_report(&r.self, &other, true, frame)); /* a heartbeat is no mere answer */
    assert_status(HG_OK, hg_verdict_read(&verdict_message, &frame[0], &told, &reply));
    assert_false(reply);
}

static void test_frames_of_a_report_are_counted(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    sample(&r, 0U, 7U, 0.0);
    uint8_t verdicts = 0U;
    uint8_t statuses = 0U;
    for (uint32_t n = 0U; n < 200U; n++) {
        hg_can_frame frame[2];
        hg_e2e_header header;
        const uint8_t frames = hg_tracker_report(&r.self, &r.verdict, (n % 3U) == 0U, frame);
        if (frames >= 1U) {
            assert_status(HG_OK, hg_e2e_check(verdict_message.e2e, frame[0].data, frame[0].length, &header));
            assert_count(verdicts % 16U, header.counter);
            verdicts++;
        }
        if (frames == 2U) {
            assert_status(HG_OK, hg_e2e_check(status_message.e2e, frame[1].data, frame[1].length, &header));
            assert_count(statuses % 16U, header.counter);
            statuses++;
        }
    }
    assert_true((verdicts > 80U) && (statuses > 30U));
}

/* Every reason to refuse a frame, of every sensor and the tick, in one number; lost frames in another. */
static void test_the_status_frame_sums_up_all_links(void **state)
{
    static rig r;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    sample(&r, 0U, 7U, 0.0);
    for (uint8_t i = 0U; i <= USUAL; i++) {
        hg_link_health *health = &r.link[i].health;
        uint16_t *const reason[] = {&health->crc, &health->format, &health->early, &health->late, &health->sequence, &health->untrusted, &health->numeric};
        for (size_t n = 0U; n < COUNT(reason); n++) {
            hg_can_frame frame[2];
            health->lost = (uint16_t)(3U + i);
            *reason[n] = (uint16_t)(5U + n);
            r.self.reported = false;
            assert_count(2U, hg_tracker_report(&r.self, &r.verdict, false, frame));
            assert_count(3U + i, frame[1].data[6]);
            assert_count(5U + n, frame[1].data[7]);
            *reason[n] = 0U;
            health->lost = 0U;
        }
    }
    for (uint8_t i = 0U; i <= USUAL; i++) {
        r.link[i].health = (hg_link_health){.lost = 1U, .crc = 1U, .format = 2U, .early = 3U, .late = 4U, .sequence = 5U, .untrusted = 6U, .numeric = 7U};
    }
    hg_can_frame frame[2];
    r.self.reported = false;
    assert_count(2U, hg_tracker_report(&r.self, &r.verdict, false, frame));
    assert_count(1U + USUAL, frame[1].data[6]);
    assert_count(28U * (1U + USUAL), frame[1].data[7]);
}

static void test_estimates(void **state)
{
    static rig r;
    hg_can_frame frame;
    int32_t code[2];
    (void)state;
    begin(&r, &usual, HG_START_REST);
    for (uint32_t k = 0U; k < 2U; k++) {
        sample(&r, k, 7U, 2.0);
        assert_status(HG_E_EMPTY, hg_tracker_estimate(&r.self, 0U, &frame));
    }
    sample(&r, 2U, 7U, 2.0);
    assert_status(HG_OK, hg_tracker_estimate(&r.self, 0U, &frame));
    assert_status(HG_OK, hg_frame_unpack(&estimates[0], &frame, code));
    assert_near(r.estimate[0], (double)code[0] / PER, 0.5 / PER);
    assert_near(r.estimate[STATES], 2.0 * (double)code[1] / PER, 1.0 / PER);
    assert_count(2U, frame.data[1] >> 4U);
    assert_status(HG_OK, hg_tracker_estimate(&r.self, 1U, &frame));
    assert_status(HG_E_EMPTY, hg_tracker_estimate(&r.self, 0U, &frame));
    for (uint32_t k = 3U; k < 60U; k++) {
        sample(&r, k, 7U, -20.0); /* a negative one, and not a small one */
        for (uint8_t j = 0U; j < STATES; j++) {
            hg_e2e_header header;
            assert_status(((k % 3U) == 2U) ? HG_OK : HG_E_EMPTY, hg_tracker_estimate(&r.self, j, &frame));
            if ((k % 3U) == 2U) {
                assert_status(HG_OK, hg_e2e_check(estimates[j].e2e, frame.data, frame.length, &header));
                assert_count((k / 3U) % 16U, header.counter);
                assert_count(k % 16U, header.stamp);
                assert_status(HG_OK, hg_frame_unpack(&estimates[j], &frame, code));
                assert_near(r.estimate[j], (double)code[0] / PER, 0.5 / PER);
                assert_near(r.estimate[STATES + j], 2.0 * (double)code[1] / PER, 1.0 / PER);
            }
        }
    }
    assert_true(r.estimate[0] < R(-15));
}

/* FNV-1a. */
static uint32_t fnv(uint32_t sum, const void *data, size_t bytes)
{
    const uint8_t *byte = data;
    uint32_t now = sum;
    for (size_t i = 0U; i < bytes; i++) {
        now = (now ^ byte[i]) * 16777619U;
    }
    return now;
}

static void test_a_digest_is_of_the_settled_prediction_and_the_origin(void **state)
{
    static rig r;
    hg_tracker_config config = usual;
    (void)state;
    config.fusion = &late_filter;
    begin(&r, &config, HG_START_REST);
    for (uint32_t k = 0U; k < 40U; k++) {
        const size_t lag = (k == 0U) ? 0U : 1U; /* one sample may still change */
        const hg_fusion_slot *settled = &r.slot[(r.self.fusion.newest + (DEPTH + 1U) - lag) % (DEPTH + 1U)];
        uint32_t sum = HG_TRACKER_DIGEST;
        for (size_t j = 0U; j < STATES; j++) {
            sum = fnv(sum, &settled->x[j], sizeof(hg_real));
            sum = fnv(sum, &r.origin[j], sizeof(int32_t));
        }
        sum = fnv(sum, settled->P, STATES * STATES * sizeof(hg_real));
        assert_true(hg_tracker_digest(&r.self.fusion, HG_TRACKER_DIGEST) == sum);
        sample(&r, k, 7U, 0.75 * k);
    }
    assert_true(r.origin[0] > 0);
}

static void test_digests_tell_states_apart(void **state)
{
    static rig a;
    static rig b;
    hg_tracker_config config = usual;
    (void)state;
    config.fusion = &late_filter;
    begin(&a, &config, HG_START_REST);
    begin(&b, &config, HG_START_REST);
    assert_count(hg_tracker_digest(&a.self.fusion, HG_TRACKER_DIGEST), hg_tracker_digest(&b.self.fusion, HG_TRACKER_DIGEST));
    assert_true(hg_tracker_digest(&a.self.fusion, 1U) != hg_tracker_digest(&a.self.fusion, 2U));
    sample(&a, 0U, 7U, 1.0);
    sample(&b, 0U, 7U, 1.0);
    sample(&a, 1U, 7U, 1.0);
    sample(&b, 1U, 3U, 1.0); /* one frame fewer; it shows when it cannot come any more */
    assert_count(hg_tracker_digest(&a.self.fusion, 1U), hg_tracker_digest(&b.self.fusion, 1U));
    sample(&a, 2U, 7U, 1.0);
    sample(&b, 2U, 7U, 1.0);
    assert_true(hg_tracker_digest(&a.self.fusion, 1U) != hg_tracker_digest(&b.self.fusion, 1U));
}

static void test_every_number_of_a_prediction_is_in_its_digest(void **state)
{
    enum { MORE = 3 };
    (void)state;
    hg_real x[MORE] = {R(0)};
    hg_real P[(MORE * MORE) + 1] = {R(0)};
    int32_t origin[MORE] = {0};
    const hg_fusion_config config = {.states = MORE};
    hg_fusion_slot slot = {.x = x, .P = P};
    const hg_fusion fusion = {.config = &config, .slot = &slot, .origin = origin, .held = 1U};
    const uint32_t none = hg_tracker_digest(&fusion, HG_TRACKER_DIGEST);
    for (size_t i = 0U; i <= (MORE * MORE); i++) {
        P[i] = R(1);
        assert_int_equal(i < (MORE * MORE), hg_tracker_digest(&fusion, HG_TRACKER_DIGEST) != none);
        P[i] = R(0);
    }
}

/* ---- a sensor's node ---- */

static void test_a_sender_speaks_when_it_is_due(void **state)
{
    static rig r;
    hg_fusion_sender sender;
    hg_can_frame frame;
    (void)state;
    begin(&r, &usual, HG_START_REST);
    assert_status(HG_E_ARGUMENT, hg_fusion_sender_start(NULL, &r.self, 0U));
    assert_status(HG_E_ARGUMENT, hg_fusion_sender_start(&sender, NULL, 0U));
    assert_status(HG_E_ARGUMENT, hg_fusion_sender_start(&sender, &r.self, USUAL));
    assert_status(HG_OK, hg_fusion_sender_start(&sender, &r.self, 0U));
    assert_status(HG_OK, hg_fusion_sender_step(&sender, R(0.25), R(0), false, &frame)); /* the first is due whatever it says */
    assert_status(HG_OK, hg_tracker_receive(&r.self, &frame));
    assert_status(HG_OK, tick(&r, 0U));
    step(&r);
    assert_status(HG_E_EMPTY, hg_fusion_sender_step(&sender, R(0.25), R(0), false, &frame));
    assert_status(HG_OK, hg_fusion_sender_step(&sender, R(0.25), R(0), true, &frame));
    assert_count(0x11U, frame.data[1]);
    assert_status(HG_OK, hg_fusion_sender_step(&sender, R(900), R(0), false, &frame));
    assert_status(HG_E_NUMERIC, hg_fusion_sender_step(&sender, R(1001), R(0), false, &frame)); /* no code has it */
    assert_status(HG_E_NUMERIC, hg_fusion_sender_step(&sender, R(5000), R(0), false, &frame)); /* out of the filter's range */
    assert_status(HG_E_NUMERIC, hg_fusion_sender_step(&sender, REAL_NAN, R(0), false, &frame));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_start_refuses_null_pointers),
        cmocka_unit_test(test_start_refuses_contradictions),
        cmocka_unit_test(test_start_refuses_frames_that_do_not_tell_their_sample),
        cmocka_unit_test(test_start_refuses_a_wrong_consistency_test),
        cmocka_unit_test(test_what_is_not_for_us),
        cmocka_unit_test(test_values_and_doubles),
        cmocka_unit_test(test_twins_and_doubles_say_nothing_of_a_sender),
        cmocka_unit_test(test_what_cannot_be_used),
        cmocka_unit_test(test_lost_frames_show_in_the_counter),
        cmocka_unit_test(test_a_stamp_names_its_sample),
        cmocka_unit_test(test_a_value_goes_round),
        cmocka_unit_test(test_the_first_tick_tells_the_time),
        cmocka_unit_test(test_samples_without_a_tick),
        cmocka_unit_test(test_a_late_tick_is_refused_and_two_are_believed),
        cmocka_unit_test(test_an_outage_begins_again),
        cmocka_unit_test(test_a_dead_sensor_is_suspected_and_comes_back),
        cmocka_unit_test(test_a_frame_within_the_delay_is_not_overdue),
        cmocka_unit_test(test_nobody_heard_is_the_bus),
        cmocka_unit_test(test_a_biased_sensor_is_taken_out),
        cmocka_unit_test(test_without_a_consistency_test),
        cmocka_unit_test(test_a_state_that_is_lost_begins_again),
        cmocka_unit_test(test_sixteen_bits_of_health_serve_sixteen_sensors),
        cmocka_unit_test(test_reports),
        cmocka_unit_test(test_estimates),
        cmocka_unit_test(test_digests_tell_states_apart),
        cmocka_unit_test(test_the_least_of_every_number_will_do),
        cmocka_unit_test(test_start_looks_at_the_first_message_too),
        cmocka_unit_test(test_identifiers_of_29_bits),
        cmocka_unit_test(test_each_state_has_its_estimate),
        cmocka_unit_test(test_a_frame_of_another_sample_was_sent_in_that),
        cmocka_unit_test(test_a_counter_moves_no_further_than_the_samples),
        cmocka_unit_test(test_a_turn_is_sent_as_the_nearest_code),
        cmocka_unit_test(test_a_value_that_does_not_go_round_is_what_it_says),
        cmocka_unit_test(test_a_tick_may_be_seven_samples_ahead),
        cmocka_unit_test(test_two_late_ticks_in_a_row_are_believed),
        cmocka_unit_test(test_late_ticks_with_counters_of_fifteen),
        cmocka_unit_test(test_after_an_outage_nothing_is_repeated),
        cmocka_unit_test(test_whoever_is_biased_is_out_and_the_judge_rests),
        cmocka_unit_test(test_a_lost_state_is_nobodys_fault),
        cmocka_unit_test(test_an_overdue_heartbeat_is_an_event_each_time),
        cmocka_unit_test(test_frames_of_a_report_are_counted),
        cmocka_unit_test(test_the_status_frame_sums_up_all_links),
        cmocka_unit_test(test_a_digest_is_of_the_settled_prediction_and_the_origin),
        cmocka_unit_test(test_every_number_of_a_prediction_is_in_its_digest),
        cmocka_unit_test(test_a_sender_speaks_when_it_is_due),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
