/** @file
 *  node.h with frames as a vehicle sends them: without a stamp, without protection, with signals beside the model's. */
#include "support.h"

#include "hullguard/node.h"

#include "small_node.h"

static const uint8_t idle[7] = {0U, 0U, 0U, 0U, 0U, 0U, 0xA5U};

static const uint8_t every_second[] = {1U};
static const hg_trigger_config second_trigger = {.width = 2U, .levels = 1U, .interval_max = 2U, .silence = every_second, .delta = sm_delta,
                                                 .sigma = sm_zero, .activity = sm_zero, .zero = sm_zero};

typedef struct {
    hg_node           self;
    sm_storage        storage;
    hg_link           link[SM_GROUPS];
    int32_t           closing[2];
    hg_node_memory    memory;
    hg_message        message[SM_GROUPS];
    hg_hold_config    hold[SM_GROUPS];
    hg_detector_config detector;
    hg_node_config    config;
    hg_verdict        verdict;
    uint8_t           counter[SM_GROUPS];
} rig;

/* A node whose first group is protected so, and sent by that trigger. */
static void begin(rig *r, const hg_e2e_config *e2e, const hg_trigger_config *trigger)
{
    (void)memset(r, 0, sizeof(*r));
    r->message[0] = (hg_message){.id = 0x101U, .length = 7U, .width = 2U, .field = fields, .scale = sm_scale, .e2e = e2e, .idle = idle};
    r->message[1] = (hg_message){.id = 0x110U, .length = 4U, .width = 1U, .field = fields, .scale = sm_scale, .e2e = &stamped_rule};
    (void)memcpy(r->hold, sm_hold, sizeof(r->hold));
    r->hold[0].trigger = trigger;
    r->detector = sm_detector;
    r->detector.hold = r->hold;
    r->config = (hg_node_config){.detector = &r->detector, .message = r->message, .closing = 1U, .verdict = &verdict_message,
                                 .status = &status_message, .heartbeat = 5U};
    r->memory = (hg_node_memory){.detector = sm_memory(&r->storage), .link = r->link, .closing = r->closing};
    assert_status(HG_OK, hg_node_start(&r->self, &r->config, &r->memory, HG_START_REST));
}

static hg_status give(rig *r, uint8_t group, uint32_t k, int32_t a, int32_t b)
{
    const int32_t code[2] = {a, b};
    hg_can_frame frame;
    hg_frame_pack(&r->message[group], code, &frame);
    assert_status(HG_OK, hg_e2e_protect(r->message[group].e2e, frame.data, frame.length, r->counter[group], (uint8_t)(k & 15U)));
    r->counter[group] = (uint8_t)((r->counter[group] + 1U) % hg_e2e_modulus(r->message[group].e2e));
    return hg_node_receive(&r->self, &frame);
}

static void close(rig *r, uint32_t k)
{
    assert_status(HG_OK, give(r, 1U, k, 0, 0));
    assert_status(HG_OK, hg_node_step(&r->self, &r->verdict));
}

static unsigned bus(const rig *r)
{
    return (unsigned)r->verdict.bus & 3U;
}

static void a_sender_fills_its_frame_and_no_receiver_looks(void **state)
{
    (void)state;
    rig r;
    hg_can_frame frame;
    const int32_t code[2] = {1, -1};
    begin(&r, &unstamped_rule, &sm_trigger_a);
    hg_frame_pack(&r.message[0], code, &frame);
    assert_int_equal(0xA5, frame.data[6]);
    assert_int_equal(0x01, frame.data[2]);
    assert_int_equal(0xFF, frame.data[5]);
    frame.data[6] = 0x5AU;
    assert_status(HG_OK, hg_e2e_protect(&unstamped_rule, frame.data, frame.length, 0U, 0U));
    assert_status(HG_OK, hg_node_receive(&r.self, &frame));
}

static void a_frame_without_a_stamp_belongs_to_the_open_sample(void **state)
{
    (void)state;
    rig r;
    begin(&r, &unstamped_rule, &sm_trigger_a);
    for (uint32_t k = 0U; k < 40U; k++) {
        assert_status(HG_OK, give(&r, 0U, k + 5U, (int32_t)k, 0));
        close(&r, k);
        assert_int_equal(HG_BUS_GOOD, bus(&r));
    }
    assert_int_equal(40, hg_node_health(&r.self, 0U)->good);
    assert_int_equal(0, hg_node_health(&r.self, 0U)->lost);
}

static void a_second_frame_within_a_sample_is_lost_for_the_promise(void **state)
{
    (void)state;
    rig r;
    begin(&r, &unstamped_rule, &sm_trigger_a);
    for (uint32_t k = 0U; k < 3U; k++) {
        assert_status(HG_OK, give(&r, 0U, k, 0, 0));
        close(&r, k);
    }
    assert_status(HG_OK, give(&r, 0U, 3U, 0, 0));
    assert_status(HG_E_REPEATED, give(&r, 0U, 3U, 64, 64));
    close(&r, 3U);
    /* The sender's promise is about 64 codes now: only the slew holds for the value before. */
    close(&r, 4U);
    close(&r, 5U);
    assert_int_equal(HG_BUS_LOSSY, bus(&r));
    assert_true(r.self.detector.radius[0] >= sm_slew_a[2]);
}

static void an_unprotected_link_is_judged_by_its_age(void **state)
{
    (void)state;
    rig r;
    begin(&r, &no_rule, &second_trigger);
    for (uint32_t k = 0U; k < 20U; k++) {
        if ((k % 2U) == 0U) {
            assert_status(HG_OK, give(&r, 0U, k, (int32_t)k, 0));
        }
        close(&r, k);
        assert_int_equal(HG_BUS_GOOD, bus(&r));
    }
    close(&r, 20U); /* its frame is missing */
    assert_int_equal(HG_BUS_LOSSY, bus(&r));
    close(&r, 21U);
    assert_status(HG_OK, give(&r, 0U, 22U, 0, 0));
    close(&r, 22U);
    assert_int_equal(HG_BUS_LOSSY, bus(&r)); /* two good ones in a row end that */
    close(&r, 23U);
    assert_status(HG_OK, give(&r, 0U, 24U, 0, 0));
    close(&r, 24U);
    assert_int_equal(HG_BUS_GOOD, bus(&r));
}

static void an_unprotected_event_is_never_whole(void **state)
{
    (void)state;
    rig r;
    begin(&r, &no_rule, &sm_trigger_a);
    for (uint32_t k = 0U; k < 6U; k++) {
        assert_status(HG_OK, give(&r, 0U, k, 0, 0));
        close(&r, k);
        assert_int_equal((k == 0U) ? HG_BUS_GOOD : HG_BUS_LOSSY, bus(&r));
    }
}

static void a_closing_frame_without_a_stamp_counts_samples_by_its_counter(void **state)
{
    (void)state;
    rig r;
    begin(&r, &unstamped_rule, &sm_trigger_a);
    r.message[1].e2e = &unstamped_rule;
    for (uint32_t k = 0U; k < 40U; k++) {
        if ((k % 5U) != 4U) { /* every fifth is lost: the next one makes two steps */
            assert_status(HG_OK, give(&r, 1U, 0U, 0, 0));
            assert_status(HG_OK, hg_node_step(&r.self, &r.verdict));
            if (((k % 5U) == 0U) && (k > 0U)) {
                assert_int_equal(k - 1U, r.verdict.k);
                assert_status(HG_OK, hg_node_step(&r.self, &r.verdict));
            }
            assert_int_equal(k, r.verdict.k);
            assert_status(HG_E_EMPTY, hg_node_step(&r.self, &r.verdict));
        } else {
            r.counter[1] = (uint8_t)((r.counter[1] + 1U) % 15U);
        }
    }
    assert_int_equal(7, hg_node_health(&r.self, 1U)->lost);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sender_fills_its_frame_and_no_receiver_looks),
        cmocka_unit_test(a_frame_without_a_stamp_belongs_to_the_open_sample),
        cmocka_unit_test(a_second_frame_within_a_sample_is_lost_for_the_promise),
        cmocka_unit_test(an_unprotected_link_is_judged_by_its_age),
        cmocka_unit_test(an_unprotected_event_is_never_whole),
        cmocka_unit_test(a_closing_frame_without_a_stamp_counts_samples_by_its_counter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
