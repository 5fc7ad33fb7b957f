/** @file
 *  selftest.h: the stored drives of the shipped models, and that a drive with another outcome is seen. */
#include "support.h"

#include "hullguard/selftest.h"

#include "battery_cell.h"
#include "cubic_suspension.h"
#include "openacc.h"
#include "platoon.h"
#include "platoon_bank.h"
#include "quadratic_sensor.h"
#include "small_model.h"
#include "suspension.h"
#include "suspension_published.h"
#include "two_state.h"

#define FAULT 24U

#define TESTED(model)                                                                    \
    {                                                                                    \
        static hg_##model##_node node;                                                   \
        (void)memset(&node, 0x5A, sizeof(node));                                         \
        assert_status(HG_OK, hg_##model##_selftest(&node));                              \
        assert_status(HG_OK, hg_##model##_selftest(&node)); /* and once more, just so */ \
        assert_status(HG_OK, hg_##model##_node_start(&node, HG_START_MOVING));           \
    }

static void shipped_models_pass_theirs(void **state)
{
    (void)state;
    TESTED(platoon)
    TESTED(platoon_bank)
    TESTED(openacc)
    TESTED(suspension)
    TESTED(suspension_published)
    TESTED(battery_cell)
    TESTED(cubic_suspension)
    TESTED(quadratic_sensor)
    TESTED(two_state)
    assert_status(HG_E_ARGUMENT, hg_platoon_selftest(NULL));
}

static const int32_t rest[HG_PLATOON_SIGNALS];
static const hg_selftest_config usual = {
    .how = HG_START_REST, .samples = 30U, .fault = FAULT, .signal = HG_PLATOON_CONTROL1_MPS2, .spread = 3U, .size = 3750, .code = rest};
static hg_platoon_node platoon;

static hg_selftest_result driven(const hg_selftest_config *config)
{
    hg_selftest_result result;
    assert_status(HG_OK, hg_platoon_node_start(&platoon, config->how));
    hg_selftest_drive(&platoon.node, config, &result);
    return result;
}

static hg_status tested(const hg_selftest_config *config)
{
    assert_status(HG_OK, hg_platoon_node_start(&platoon, config->how));
    return hg_selftest_run(&platoon.node, config);
}

static void a_drive_is_quiet_and_then_finds_its_fault(void **state)
{
    (void)state;
    hg_selftest_config config = usual;
    const hg_selftest_result result = driven(&config);
    assert_true(result.quiet);
    assert_true(result.found);
    for (uint8_t i = 0U; i < HG_PLATOON_GROUPS; i++) { /* every frame was good */
        assert_count(30, hg_node_health(&platoon.node, i)->good);
    }
    config.digest = result.digest;
    assert_status(HG_OK, tested(&config));
    config.digest ^= 0x100U;
    assert_status(HG_E_SELFTEST, tested(&config));
}

static void an_alarm_too_soon_or_none_is_no_success(void **state)
{
    (void)state;
    hg_selftest_config config = usual;
    config.samples = FAULT;
    hg_selftest_result result = driven(&config);
    assert_true(result.quiet && (!result.found));
    config.digest = result.digest;
    assert_status(HG_E_SELFTEST, tested(&config));
    config.samples = 30U;
    config.fault = 30U;
    config.spread = 127U;
    int32_t far[HG_PLATOON_SIGNALS] = {0, 0, 0, 100000, -100000, 0}; /* beyond the range: sent as its ends */
    config.code = far;
    result = driven(&config);
    assert_true((!result.quiet) && result.found);
    for (uint8_t i = 0U; i < HG_PLATOON_GROUPS; i++) {
        assert_count(30, hg_node_health(&platoon.node, i)->good);
        assert_count(0, hg_node_health(&platoon.node, i)->invalid);
    }
    config.digest = result.digest;
    assert_status(HG_E_SELFTEST, tested(&config));
}

static void another_table_or_instruction_is_another_digest(void **state)
{
    (void)state;
    const uint32_t good = driven(&usual).digest;
    for (uint8_t i = 0U; i < 3U; i++) { /* as a table would do that says so */
        hg_selftest_config config = usual;
        config.spread = (i == 0U) ? 4U : 3U;
        config.size = (i == 1U) ? 3751 : 3750;
        config.fault = (i == 2U) ? (FAULT + 1U) : FAULT;
        assert_true(driven(&config).digest != good);
    }
}

#define P22(list) {.profile = HG_E2E_P22, .data_ids = (list), .crc = 0U, .counter = 8U, .stamp = 12U, .limits = &hg_e2e_limits_default}

static const uint8_t ids[HG_E2E_IDS] = {7U, 7U, 7U, 7U, 7U, 7U, 7U, 7U, 7U, 7U, 7U, 7U, 7U, 7U, 7U, 7U};
static const hg_e2e_config rules = P22(ids);
static const hg_field fields[2] = {{16U, 16U, HG_FIELD_SIGNED}, {32U, 16U, HG_FIELD_SIGNED}};
static const hg_message own = {.id = 0x200U, .length = 8U, .e2e = &rules};
static const int32_t still[SM_SIGNALS];
static const hg_selftest_config drive = {.how = HG_START_REST, .samples = 20U, .fault = 11U, .signal = 0U, .spread = 0U, .size = 2000, .code = still};
static hg_link link[SM_GROUPS];

/* The small model, or the same with its groups the other way round. */
static hg_selftest_result driven_small(const uint8_t *silence, uint8_t closing)
{
    const uint8_t other = (uint8_t)(1U - closing);
    hg_message messages[SM_GROUPS];
    hg_hold_config hold[SM_GROUPS];
    hg_trigger_config trigger = sm_trigger_a;
    hg_detector_config detector = sm_detector;
    messages[other] = (hg_message){.id = 0x101U, .length = 6U, .width = 2U, .field = fields, .scale = sm_scale, .e2e = &rules};
    messages[closing] = (hg_message){.id = 0x110U, .length = 4U, .width = 1U, .field = fields, .scale = sm_scale, .e2e = &rules};
    hold[other] = sm_hold[0];
    hold[closing] = sm_hold[1];
    hold[other].trigger = &trigger;
    trigger.silence = silence;
    detector.hold = hold;
    const hg_node_config config = {.detector = &detector, .message = messages, .closing = closing, .verdict = &own, .status = &own, .heartbeat = 5U};
    static sm_storage storage;
    hg_node node;
    int32_t last[2];
    hg_selftest_result result;
    const hg_node_memory memory = {.detector = sm_memory(&storage), .link = link, .closing = last};
    assert_status(HG_OK, hg_node_start(&node, &config, &memory, HG_START_REST));
    hg_selftest_drive(&node, &drive, &result);
    return result;
}

/* A sender that keeps silent for a sample after each frame speaks every second one, and nothing of it counts as lost or is refused. */
static void a_silent_sender_is_let_be_silent(void **state)
{
    (void)state;
    static const uint8_t silences[2][3] = {{1U, 0U, 3U}, {0U, 1U, 3U}}; /* the last is of no level */
    for (size_t i = 0U; i < 2U; i++) {
        const hg_selftest_result result = driven_small(silences[i], 1U);
        assert_true(result.quiet && result.found);
        assert_count(10, link[0].health.good);
        assert_count(20, link[1].health.good);
        assert_count(0, link[0].health.lost + link[0].health.sequence + link[0].health.repeated);
    }
}

static void who_closes_a_sample_speaks_last(void **state)
{
    (void)state;
    const hg_selftest_result result = driven_small(sm_silence_a, 0U);
    assert_true(result.quiet);
    assert_count(20, link[0].health.good);
    assert_count(10, link[1].health.good);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shipped_models_pass_theirs),
        cmocka_unit_test(a_drive_is_quiet_and_then_finds_its_fault),
        cmocka_unit_test(an_alarm_too_soon_or_none_is_no_success),
        cmocka_unit_test(another_table_or_instruction_is_another_digest),
        cmocka_unit_test(a_silent_sender_is_let_be_silent),
        cmocka_unit_test(who_closes_a_sample_speaks_last),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
