/* One suite for every backend: the rules of hal.h, each tried. Times are judged by order and lower bounds only, so that it holds on
 * machines where a process may be held up for tens of milliseconds. */
#include "rig.h"

#include <string.h>

#define SOON_US 5000000U    /* long enough for anything that does come */

/* --- helpers ----------------------------------------------------------------------------------------------------------------------- */

static hg_can_frame make(uint32_t id, unsigned flags, unsigned length)
{
    hg_can_frame frame = {.id = id, .flags = (uint8_t)flags, .length = (uint8_t)length};

    if ((flags & HG_CAN_REMOTE) == 0U) {
        for (unsigned i = 0U; i < length; i++) {
            frame.data[i] = (uint8_t)((id + (7U * i) + 1U) & 0xFFU);
        }
    }
    return frame;
}

/* The longest frame that the rig's boards can send. */
static hg_can_frame longest(const rig *r, uint32_t id)
{
    return r->classic ? make(id, 0U, HG_CAN_CLASSIC_MAX) : make(id, HG_CAN_FD, HG_CAN_DATA_MAX);
}

static void same(const hg_can_frame *a, const hg_can_frame *b)
{
    assert_int_equal(a->id, b->id);
    assert_int_equal(a->flags, b->flags);
    assert_int_equal(a->length, b->length);
    assert_memory_equal(a->data, b->data, HG_CAN_DATA_MAX);   /* the tail beyond length too: it must be zero */
}

static hg_can_frame take(const hg_hal *hal)
{
    hg_can_frame frame;

    memset(&frame, 0xA5, sizeof frame);
    assert_int_equal(hg_hal_wait(hal, hg_hal_now_us(hal) + SOON_US), HG_OK);
    assert_int_equal(hg_hal_receive(hal, &frame, NULL), HG_OK);
    return frame;
}

static void expect(const hg_hal *hal, const hg_can_frame *frame)
{
    const hg_can_frame got = take(hal);

    same(&got, frame);
}

/* An operating system may hand on a frame a moment after it was sent. */
static hg_status settle(const hg_hal *hal)
{
    return hg_hal_wait(hal, hg_hal_now_us(hal) + 5000U);
}

static void expect_none(const hg_hal *hal)
{
    hg_can_frame frame;
    hg_can_frame untouched;

    assert_int_equal(settle(hal), HG_E_EMPTY);
    memset(&frame, 0xA5, sizeof frame);
    untouched = frame;
    assert_int_equal(hg_hal_receive(hal, &frame, NULL), HG_E_EMPTY);
    assert_memory_equal(&frame, &untouched, sizeof frame);
}

static hg_hal_report report_of(const hg_hal *hal)
{
    hg_hal_report report;

    memset(&report, 0xA5, sizeof report);
    hg_hal_state(hal, &report);
    return report;
}

static void send(const hg_hal *hal, const hg_can_frame *frame)
{
    assert_int_equal(hg_hal_send(hal, frame), HG_OK);
}

static int open_plain(void **state)
{
    rig *const r = *state;

    r->ops->open(r, NULL, 0U);
    return 0;
}

static int close_rig(void **state)
{
    rig *const r = *state;

    r->ops->close(r);
    return 0;
}

/* --- carrying frames --------------------------------------------------------------------------------------------------------------- */

static void starts_active_and_empty(void **state)
{
    const rig *const r = *state;
    const hg_hal_report report = report_of(&r->node);

    assert_int_equal(report.bus, HG_BUS_ACTIVE);
    assert_int_equal(report.received | report.sent | report.lost | report.refused | report.errors | report.malformed, 0);
    expect_none(&r->node);
}

static void keeps_order_and_loses_nothing_up_to_the_stated_depth(void **state)
{
    const rig *const r = *state;

    for (uint32_t i = 0U; i < RIG_DEPTH; i++) {
        const hg_can_frame frame = longest(r, i);   /* they fill a queue counted in bytes soonest */
        send(&r->peer, &frame);
    }
    for (uint32_t i = 0U; i < RIG_DEPTH; i++) {
        const hg_can_frame frame = longest(r, i);
        expect(&r->node, &frame);
    }
    expect_none(&r->node);
    assert_int_equal(report_of(&r->node).received, RIG_DEPTH);
    assert_int_equal(report_of(&r->node).lost, 0);
    assert_int_equal(report_of(&r->peer).sent, RIG_DEPTH);
}

/* Overfill the node's queue, empty it, and return how many frames it had kept. */
static uint32_t flood(const rig *r)
{
    hg_can_frame frame;
    uint32_t kept = 0U;

    for (uint32_t i = 0U; i < RIG_FLOOD; i++) {
        frame = make(i, 0U, 8U);
        send(&r->peer, &frame);
    }
    while ((settle(&r->node) == HG_OK) && (hg_hal_receive(&r->node, &frame, NULL) == HG_OK)) {
        assert_int_equal(frame.id, kept);   /* the oldest are kept, without a gap */
        kept++;
    }
    assert_in_range(kept, RIG_DEPTH, RIG_FLOOD - 1U);
    frame = make(0x7F0U, 0U, 0U);           /* a backend may learn of its loss with the next frame */
    send(&r->peer, &frame);
    expect(&r->node, &frame);
    return kept;
}

static void counts_overflow_exactly(void **state)
{
    const rig *const r = *state;
    uint32_t kept = 0U;

    for (uint32_t round = 1U; round <= 3U; round++) {
        kept += flood(r);
        assert_int_equal(report_of(&r->node).lost, (round * RIG_FLOOD) - kept);
        assert_int_equal(report_of(&r->node).received, kept + round);
    }
    assert_int_equal(report_of(&r->peer).lost, 0);
}

static void does_not_receive_its_own_frames(void **state)
{
    const rig *const r = *state;
    const hg_can_frame mine = make(0x123U, 0U, 3U);
    const hg_can_frame other = make(0x124U, 0U, 4U);

    send(&r->node, &mine);
    send(&r->peer, &other);
    expect(&r->node, &other);
    expect_none(&r->node);
    expect(&r->peer, &mine);
    expect_none(&r->peer);
}

static void carries_classic_lengths_0_to_8(void **state)
{
    const rig *const r = *state;

    for (unsigned length = 0U; length <= 8U; length++) {
        const hg_can_frame standard = make(0x100U + length, 0U, length);
        const hg_can_frame extended = make(0x12345600U + length, HG_CAN_EXTENDED, length);
        const hg_can_frame remote = make(0x200U + length, HG_CAN_REMOTE, length);
        send(&r->peer, &standard);
        send(&r->peer, &extended);
        send(&r->peer, &remote);
        expect(&r->node, &standard);
        expect(&r->node, &extended);
        expect(&r->node, &remote);
    }
}

static void carries_fd_lengths_0_to_64(void **state)
{
    static const uint8_t lengths[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    const rig *const r = *state;

    for (size_t i = 0U; i < sizeof lengths; i++) {
        const hg_can_frame plain = make(0x100U, HG_CAN_FD, lengths[i]);
        const hg_can_frame quick = make(0x1FFFFFFFU, HG_CAN_FD | HG_CAN_BRS | HG_CAN_EXTENDED, lengths[i]);
        if (r->classic) {
            assert_int_equal(hg_hal_send(&r->node, &plain), HG_E_FORMAT);
            continue;
        }
        send(&r->peer, &plain);
        send(&r->peer, &quick);
        expect(&r->node, &plain);
        expect(&r->node, &quick);
    }
}

static void hands_on_a_stranger_s_fd_length_13(void **state)
{
    rig *const r = *state;
    const hg_can_frame odd = make(0x55U, HG_CAN_FD, 13U);

    r->ops->put(r, &odd);
    expect(&r->node, &odd);
    assert_int_equal(report_of(&r->node).malformed, 0);
}

static void refuses_frames_that_cannot_exist(void **state)
{
    const rig *const r = *state;
    const hg_can_frame bad[] = {
        make(0x800U, 0U, 1U), make(0x20000000U, HG_CAN_EXTENDED, 1U), make(1U, 0U, 9U), make(1U, HG_CAN_FD, 9U), make(1U, HG_CAN_FD, 13U),
        make(1U, HG_CAN_FD, 28U), make(1U, HG_CAN_FD, 63U), {.id = 1U, .flags = HG_CAN_FD, .length = 65U}, make(1U, HG_CAN_BRS, 1U),
        make(1U, HG_CAN_FD | HG_CAN_REMOTE, 1U), make(1U, HG_CAN_ERROR, 8U), make(1U, 0x20U, 1U), {.id = 1U, .length = 255U},
    };
    const size_t count = sizeof bad / sizeof bad[0];

    for (size_t i = 0U; i < count; i++) {
        assert_int_equal(hg_hal_send(&r->node, &bad[i]), HG_E_FORMAT);
    }
    assert_int_equal(report_of(&r->node).refused, count);
    assert_int_equal(report_of(&r->node).sent, 0);
    expect_none(&r->peer);
}

/* --- filters ----------------------------------------------------------------------------------------------------------------------- */

static int open_filtered(void **state)
{
    static const hg_hal_filter filters[] = {
        {0x123U, HG_CAN_ID_EXTENDED, 0U}, {0x456U, HG_CAN_ID_EXTENDED, HG_CAN_EXTENDED}, {0x1A0U, 0x7F0U, 0U},
        {0x321U, HG_CAN_ID_EXTENDED, HG_CAN_REMOTE},
    };
    rig *const r = *state;

    r->ops->open(r, filters, sizeof filters / sizeof filters[0]);
    return 0;
}

static void filter_tells_twins_apart(void **state)
{
    const rig *const r = *state;
    const hg_can_frame out[] = {
        make(0x123U, HG_CAN_EXTENDED, 2U), make(0x123U, HG_CAN_REMOTE, 2U), make(0x456U, 0U, 2U), make(0x122U, 0U, 2U),
        make(0x456U, HG_CAN_EXTENDED | HG_CAN_REMOTE, 0U), make(0x1B0U, 0U, 2U), make(0x1A5U, HG_CAN_EXTENDED, 2U), make(0x321U, 0U, 2U),
        make(0x10000456U, HG_CAN_EXTENDED, 2U),
    };
    const hg_can_frame in[] = {
        make(0x123U, 0U, 2U), make(0x456U, HG_CAN_EXTENDED, 2U), make(0x1AFU, 0U, 2U), longest(r, 0x1A0U),
        make(0x321U, HG_CAN_REMOTE, 0U),
    };

    for (size_t i = 0U; i < sizeof out / sizeof out[0]; i++) {
        send(&r->peer, &out[i]);
    }
    for (size_t i = 0U; i < sizeof in / sizeof in[0]; i++) {
        send(&r->peer, &in[i]);
    }
    for (size_t i = 0U; i < sizeof in / sizeof in[0]; i++) {
        expect(&r->node, &in[i]);
    }
    expect_none(&r->node);
}

static int open_deaf(void **state)
{
    static const hg_hal_filter nothing[1];
    rig *const r = *state;

    r->ops->open(r, nothing, 0U);
    return 0;
}

static void empty_filter_list_passes_nothing(void **state)
{
    const rig *const r = *state;
    const hg_can_frame frame = make(0U, 0U, 0U);

    send(&r->peer, &frame);
    expect_none(&r->node);
    send(&r->node, &frame);
    expect(&r->peer, &frame);
}

/* --- waiting ----------------------------------------------------------------------------------------------------------------------- */

static void wait_ends_at_the_deadline_and_not_before(void **state)
{
    const rig *const r = *state;

    for (uint32_t i = 1U; i <= 10U; i++) {
        const uint64_t until = hg_hal_now_us(&r->node) + (i * 500U);
        assert_int_equal(hg_hal_wait(&r->node, until), HG_E_EMPTY);
        assert_true(hg_hal_now_us(&r->node) >= until);
    }
}

static void wait_for_a_past_moment_is_a_poll(void **state)
{
    const rig *const r = *state;
    const hg_can_frame frame = make(1U, 0U, 1U);

    assert_int_equal(hg_hal_wait(&r->node, 0U), HG_E_EMPTY);
    assert_int_equal(hg_hal_wait(&r->node, hg_hal_now_us(&r->node)), HG_E_EMPTY);
    send(&r->peer, &frame);
    assert_int_equal(hg_hal_wait(&r->node, 0U), HG_OK);
    expect(&r->node, &frame);
    assert_int_equal(hg_hal_wait(&r->node, 0U), HG_E_EMPTY);
}

static void wait_wakes_on_a_frame(void **state)
{
    rig *const r = *state;
    const hg_can_frame frame = make(0x77U, 0U, 5U);
    const uint64_t before = hg_hal_now_us(&r->node);
    hg_can_frame got;
    uint64_t at = 0U;

    r->ops->put_later(r, &frame, 20000U);
    assert_int_equal(hg_hal_wait(&r->node, before + SOON_US), HG_OK);
    assert_true(hg_hal_now_us(&r->node) < (before + SOON_US));
    assert_int_equal(hg_hal_receive(&r->node, &got, &at), HG_OK);
    same(&got, &frame);
    assert_true(at >= (before + 20000U));
    assert_true(at <= hg_hal_now_us(&r->node));
    r->ops->put_later(r, &frame, 20000U);
    assert_int_equal(hg_hal_wait(&r->node, HG_HAL_FOREVER), HG_OK);
}

static void arrival_times_never_go_backwards(void **state)
{
    const rig *const r = *state;
    uint64_t last = hg_hal_now_us(&r->node);

    for (uint32_t i = 0U; i < 20U; i++) {
        const hg_can_frame frame = make(i, 0U, 0U);
        hg_can_frame got;
        uint64_t at = 0U;
        send(&r->peer, &frame);
        assert_int_equal(hg_hal_wait(&r->node, hg_hal_now_us(&r->node) + SOON_US), HG_OK);
        assert_int_equal(hg_hal_receive(&r->node, &got, &at), HG_OK);
        assert_true(at >= last);
        assert_true(at <= hg_hal_now_us(&r->node));
        last = at;
    }
}

static void stamps_the_arrival_and_not_the_reading(void **state)
{
    const rig *const r = *state;
    const hg_can_frame frame = make(2U, 0U, 0U);
    hg_can_frame got;
    uint64_t at = 0U;

    send(&r->peer, &frame);
    const uint64_t sent = hg_hal_now_us(&r->node);
    assert_int_equal(hg_hal_wait(&r->peer, sent + 100000U), HG_E_EMPTY);
    assert_int_equal(hg_hal_receive(&r->node, &got, &at), HG_OK);
    assert_true(at < (sent + 100000U));
}

static void stop_ends_this_wait_and_every_later_one(void **state)
{
    rig *const r = *state;
    const uint64_t before = hg_hal_now_us(&r->node);

    r->ops->stop(r);
    assert_int_equal(hg_hal_wait(&r->node, before + SOON_US), HG_E_IO);
    assert_true(hg_hal_now_us(&r->node) < (before + SOON_US));
    assert_int_equal(hg_hal_wait(&r->node, 0U), HG_E_IO);
    assert_int_equal(hg_hal_wait(&r->node, HG_HAL_FOREVER), HG_E_IO);
    assert_int_equal(hg_hal_wait(&r->peer, 0U), HG_E_EMPTY);
}

/* --- trouble ----------------------------------------------------------------------------------------------------------------------- */

static void reports_a_full_queue_and_recovers(void **state)
{
    rig *const r = *state;
    const hg_can_frame frame = make(0x31U, 0U, 8U);

    r->ops->full(r, true);
    assert_int_equal(hg_hal_send(&r->node, &frame), HG_E_BUSY);
    assert_int_equal(hg_hal_send(&r->node, &frame), HG_E_BUSY);
    assert_int_equal(report_of(&r->node).refused, 2);
    assert_int_equal(report_of(&r->node).bus, HG_BUS_ACTIVE);
    r->ops->full(r, false);
    while ((settle(&r->peer) == HG_OK) && (hg_hal_receive(&r->peer, &(hg_can_frame){0}, NULL) == HG_OK)) {
    }
    send(&r->node, &frame);
    expect(&r->peer, &frame);
    expect_none(&r->peer);
    assert_int_equal(report_of(&r->node).sent, 1);
}

static void reports_a_dead_link_and_recovers(void **state)
{
    rig *const r = *state;
    const hg_can_frame early = make(0x40U, 0U, 1U);
    const hg_can_frame frame = make(0x41U, 0U, 1U);
    hg_can_frame got;

    send(&r->peer, &early);
    assert_int_equal(settle(&r->node), HG_OK);
    r->ops->link(r, false);
    assert_int_equal(hg_hal_receive(&r->node, &got, NULL), HG_OK);   /* what had arrived is still handed out */
    same(&got, &early);
    assert_int_equal(hg_hal_receive(&r->node, &got, NULL), HG_E_BUS);
    assert_int_equal(hg_hal_receive(&r->node, &got, NULL), HG_E_BUS);
    assert_int_equal(report_of(&r->node).bus, HG_BUS_OFF);
    assert_int_equal(hg_hal_send(&r->node, &frame), HG_E_BUS);
    assert_int_equal(report_of(&r->node).refused, 1);
    assert_int_equal(hg_hal_wait(&r->node, hg_hal_now_us(&r->node) + 1000U), HG_E_EMPTY);   /* no spinning while it is dead */
    r->ops->link(r, true);
    assert_int_equal(report_of(&r->node).bus, HG_BUS_ACTIVE);
    send(&r->node, &frame);
    expect(&r->peer, &frame);
    send(&r->peer, &frame);
    expect(&r->node, &frame);
    r->ops->report(r, HG_BUS_WARNING);   /* and the controller's own word counts again */
    (void)settle(&r->node);
    (void)hg_hal_receive(&r->node, &got, NULL);
    assert_int_equal(report_of(&r->node).bus, HG_BUS_WARNING);
}

static void sends_at_once_after_an_outage_it_slept_through(void **state)
{
    rig *const r = *state;
    const hg_can_frame frame = make(0x61U, 0U, 1U);

    r->ops->link(r, false);
    r->ops->link(r, true);
    send(&r->node, &frame);
    expect(&r->peer, &frame);
    send(&r->peer, &frame);
    expect(&r->node, &frame);
    assert_int_equal(report_of(&r->node).bus, HG_BUS_ACTIVE);
}

static void error_reports_set_the_state_and_are_no_data(void **state)
{
    static const hg_bus_state states[] = {HG_BUS_WARNING, HG_BUS_PASSIVE, HG_BUS_OFF};
    rig *const r = *state;
    const hg_can_frame frame = make(0x51U, 0U, 8U);
    hg_can_frame got;

    for (uint32_t i = 0U; i < 3U; i++) {
        const bool off = states[i] == HG_BUS_OFF;
        r->ops->report(r, states[i]);
        (void)settle(&r->node);
        assert_int_equal(hg_hal_receive(&r->node, &got, NULL), off ? HG_E_BUS : HG_E_EMPTY);
        assert_int_equal(report_of(&r->node).bus, states[i]);
        assert_int_equal(report_of(&r->node).errors, i + 1U);
        assert_int_equal(hg_hal_send(&r->node, &frame), off ? HG_E_BUS : HG_OK);
    }
    assert_int_equal(report_of(&r->node).received, 0);
    r->ops->report(r, HG_BUS_ACTIVE);
    (void)settle(&r->node);
    (void)hg_hal_receive(&r->node, &got, NULL);
    assert_int_equal(report_of(&r->node).bus, HG_BUS_ACTIVE);
    send(&r->node, &frame);
    send(&r->peer, &frame);
    expect(&r->node, &frame);
}

static void counters_stay_at_their_largest_value(void **state)
{
    uint32_t counter = UINT32_MAX - 2U;

    (void)state;
    hg_hal_count(&counter, 1U);
    assert_int_equal(counter, UINT32_MAX - 1U);
    hg_hal_count(&counter, 5U);
    assert_int_equal(counter, UINT32_MAX);
    hg_hal_count(&counter, UINT32_MAX);
    assert_int_equal(counter, UINT32_MAX);
}

#define CASE(test, open) {#test, test, open, close_rig, self}

int contract_run(const char *name, rig *self)
{
    const struct CMUnitTest tests[] = {
        CASE(starts_active_and_empty, open_plain),
        CASE(keeps_order_and_loses_nothing_up_to_the_stated_depth, open_plain),
        CASE(counts_overflow_exactly, open_plain),
        CASE(does_not_receive_its_own_frames, open_plain),
        CASE(carries_classic_lengths_0_to_8, open_plain),
        CASE(carries_fd_lengths_0_to_64, open_plain),
        CASE(hands_on_a_stranger_s_fd_length_13, open_plain),
        CASE(refuses_frames_that_cannot_exist, open_plain),
        CASE(filter_tells_twins_apart, open_filtered),
        CASE(empty_filter_list_passes_nothing, open_deaf),
        CASE(wait_ends_at_the_deadline_and_not_before, open_plain),
        CASE(wait_for_a_past_moment_is_a_poll, open_plain),
        CASE(wait_wakes_on_a_frame, open_plain),
        CASE(arrival_times_never_go_backwards, open_plain),
        CASE(stamps_the_arrival_and_not_the_reading, open_plain),
        CASE(stop_ends_this_wait_and_every_later_one, open_plain),
        CASE(reports_a_full_queue_and_recovers, open_plain),
        CASE(reports_a_dead_link_and_recovers, open_plain),
        CASE(sends_at_once_after_an_outage_it_slept_through, open_plain),
        CASE(error_reports_set_the_state_and_are_no_data, open_plain),
        CASE(counters_stay_at_their_largest_value, open_plain),
    };

    return cmocka_run_group_tests_name(name, tests, NULL, NULL);
}
