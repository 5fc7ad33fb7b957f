/* The contract suite on the in-process bus. */
#include "rig.h"

#include "loopback/loopback.h"

typedef struct {
    rig              base;
    hg_loopback_bus  bus;
    hg_loopback      node;
    hg_loopback      peer;
    hg_loopback_slot node_slots[RIG_DEPTH];
    hg_loopback_slot peer_slots[RIG_FLOOD];
} loopback_rig;

_Static_assert(offsetof(loopback_rig, base) == 0U, "a rig is cast to its first member and back");

static loopback_rig *mine(rig *self)
{
    return (loopback_rig *)(void *)self;
}

static void rig_open(rig *self, const hg_hal_filter *filters, size_t count)
{
    loopback_rig *const r = mine(self);

    assert_int_equal(hg_loopback_bus_start(&r->bus, 0U), HG_OK);
    assert_int_equal(hg_loopback_start(&r->node, &r->bus, r->node_slots, RIG_DEPTH, filters, count), HG_OK);
    assert_int_equal(hg_loopback_start(&r->peer, &r->bus, r->peer_slots, RIG_FLOOD, NULL, 0U), HG_OK);
    self->node = hg_loopback_hal(&r->node);
    self->peer = hg_loopback_hal(&r->peer);
}

static void rig_close(rig *self)
{
    (void)self;
}

static void rig_put(rig *self, const hg_can_frame *frame)
{
    assert_int_equal(hg_loopback_put(&mine(self)->bus, frame), HG_OK);
}

static void rig_put_later(rig *self, const hg_can_frame *frame, uint32_t delay_us)
{
    hg_loopback_set_latency(&mine(self)->bus, delay_us);
    rig_put(self, frame);
    hg_loopback_set_latency(&mine(self)->bus, 0U);
}

static void rig_report(rig *self, hg_bus_state state)
{
    hg_loopback_set_bus(&mine(self)->node, state);
}

static void rig_full(rig *self, bool full)
{
    hg_loopback_set_busy(&mine(self)->node, full ? UINT32_MAX : 0U);
}

static void rig_link(rig *self, bool up)
{
    hg_loopback_set_bus(&mine(self)->node, up ? HG_BUS_ACTIVE : HG_BUS_OFF);
}

static void rig_stop(rig *self)
{
    hg_loopback_stop(&mine(self)->node);
}

/* --- what only this backend has ------------------------------------------------------------------------------------------------------- */

static int open_alone(void **state)
{
    rig_open(*state, NULL, 0U);
    return 0;
}

static void start_refuses_what_cannot_work(void **state)
{
    static const hg_hal_filter bad[] = {{0x800U, 0U, 0U}, {0U, 0x20000000U, 0U}, {0U, 0U, HG_CAN_FD}};
    loopback_rig *const r = *state;
    hg_loopback other;

    assert_int_equal(hg_loopback_bus_start(NULL, 0U), HG_E_ARGUMENT);
    assert_int_equal(hg_loopback_start(NULL, &r->bus, r->node_slots, 1U, NULL, 0U), HG_E_ARGUMENT);
    assert_int_equal(hg_loopback_start(&other, NULL, r->node_slots, 1U, NULL, 0U), HG_E_ARGUMENT);
    assert_int_equal(hg_loopback_start(&other, &r->bus, NULL, 1U, NULL, 0U), HG_E_ARGUMENT);
    assert_int_equal(hg_loopback_start(&other, &r->bus, r->node_slots, 0U, NULL, 0U), HG_E_ARGUMENT);
    assert_int_equal(hg_loopback_start(&other, &r->bus, r->node_slots, 1U, NULL, 1U), HG_E_ARGUMENT);
    for (size_t i = 0U; i < (sizeof bad / sizeof bad[0]); i++) {
        assert_int_equal(hg_loopback_start(&other, &r->bus, r->node_slots, 1U, &bad[i], 1U), HG_E_ARGUMENT);
    }
    assert_int_equal(hg_loopback_put(NULL, &(hg_can_frame){.id = 1U}), HG_E_ARGUMENT);
    assert_int_equal(hg_loopback_put(&r->bus, NULL), HG_E_ARGUMENT);
    assert_ptr_equal(r->bus.first, &r->peer);
}

static void a_shorter_latency_lets_no_frame_overtake(void **state)
{
    loopback_rig *const r = *state;
    const hg_hal *const hal = &r->base.node;
    hg_can_frame got;
    uint64_t at = 0U;

    hg_loopback_set_latency(&r->bus, 1000U);
    assert_int_equal(hg_hal_send(&r->base.peer, &(hg_can_frame){.id = 1U}), HG_OK);
    hg_loopback_set_latency(&r->bus, 10U);
    assert_int_equal(hg_hal_send(&r->base.peer, &(hg_can_frame){.id = 2U}), HG_OK);
    assert_int_equal(hg_hal_wait(hal, 999U), HG_E_EMPTY);
    assert_int_equal(hg_hal_wait(hal, HG_HAL_FOREVER), HG_OK);
    assert_int_equal(hg_hal_now_us(hal), 1000);
    for (uint32_t id = 1U; id <= 2U; id++) {
        assert_int_equal(hg_hal_receive(hal, &got, &at), HG_OK);
        assert_int_equal(got.id, id);
        assert_int_equal(at, 1000);
    }
    assert_int_equal(hg_hal_wait(hal, HG_HAL_FOREVER), HG_E_IO);   /* nothing could ever end it */
    hg_loopback_set_time(&r->bus, 5U);
    assert_int_equal(hg_hal_now_us(hal), 1000);
}

static void busy_lasts_as_many_sends_as_asked(void **state)
{
    loopback_rig *const r = *state;
    const hg_can_frame frame = {.id = 1U};

    hg_loopback_set_busy(&r->node, 2U);
    assert_int_equal(hg_hal_send(&r->base.node, &frame), HG_E_BUSY);
    assert_int_equal(hg_hal_send(&r->base.node, &frame), HG_E_BUSY);
    assert_int_equal(hg_hal_send(&r->base.node, &frame), HG_OK);
}

static void counts_the_malformed_and_hears_nothing_while_off(void **state)
{
    loopback_rig *const r = *state;
    hg_hal_report report;

    assert_int_equal(hg_loopback_put(&r->bus, &(hg_can_frame){.id = 1U, .length = 9U}), HG_OK);
    assert_int_equal(hg_loopback_put(&r->bus, &(hg_can_frame){.id = 1U, .flags = HG_CAN_FD, .length = 65U}), HG_OK);
    hg_loopback_set_bus(&r->node, HG_BUS_OFF);
    assert_int_equal(hg_loopback_put(&r->bus, &(hg_can_frame){.id = 1U, .length = 8U}), HG_OK);
    hg_hal_state(&r->base.node, &report);
    assert_int_equal(report.malformed, 2);
    assert_int_equal(report.lost | report.received, 0);
    assert_int_equal(hg_hal_receive(&r->base.node, &(hg_can_frame){0}, NULL), HG_E_BUS);
}

static int own_tests(loopback_rig *r)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_prestate_setup_teardown(start_refuses_what_cannot_work, open_alone, NULL, r),
        cmocka_unit_test_prestate_setup_teardown(a_shorter_latency_lets_no_frame_overtake, open_alone, NULL, r),
        cmocka_unit_test_prestate_setup_teardown(busy_lasts_as_many_sends_as_asked, open_alone, NULL, r),
        cmocka_unit_test_prestate_setup_teardown(counts_the_malformed_and_hears_nothing_while_off, open_alone, NULL, r),
    };

    return cmocka_run_group_tests_name("loopback alone", tests, NULL, NULL);
}

int main(void)
{
    static const rig_ops ops = {rig_open, rig_close, rig_put, rig_put_later, rig_report, rig_full, rig_link, rig_stop};
    loopback_rig r = {.base = {.ops = &ops}};

    return contract_run("loopback", &r.base) + own_tests(&r);
}
