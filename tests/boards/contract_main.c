/* The contract suite on the board itself: its controllers 0 and 1, which the emulator puts on one bus, are the node and the peer. The node's receive
 * interrupt, which the emulated machines have not routed, is a call of hg_board_service() behind each frame that the peer has sent. */
#include "rig.h"

#include "board.h"
#include "contract_rig.h"

#define NODE 0U
#define PEER 1U
#define STOP_AFTER_US 20000U

typedef struct {
    rig          base;
    hg_hal       peer;        /* without the stand-in for the interrupt */
    hg_can_frame later;
    uint64_t     later_us;    /* HG_HAL_FOREVER: nothing is to come */
    uint64_t     stop_us;
} board_rig;

_Static_assert(offsetof(board_rig, base) == 0U, "a rig is cast to its first member and back");

static board_rig the;

/* ---- the peer ---- */

static hg_status peer_send(void *self, const hg_can_frame *frame)
{
    (void)self;
    const hg_status status = hg_hal_send(&the.peer, frame);
    hg_board_service(NODE);
    return status;
}

static hg_status peer_receive(void *self, hg_can_frame *frame, uint64_t *time_us)
{
    (void)self;
    return hg_hal_receive(&the.peer, frame, time_us);
}

static void peer_state(void *self, hg_hal_report *out)
{
    (void)self;
    hg_hal_state(&the.peer, out);
}

static uint64_t peer_now_us(void *self)
{
    (void)self;
    return hg_hal_now_us(&the.peer);
}

static hg_status peer_wait(void *self, uint64_t until_us)
{
    (void)self;
    return hg_hal_wait(&the.peer, until_us);
}

/* ---- the rig ---- */

/* What happens while somebody waits. */
static void while_idle(void)
{
    const uint64_t now_us = hg_board_now_us();

    if (now_us >= the.later_us) {
        the.later_us = HG_HAL_FOREVER;
        assert_int_equal(hg_hal_send(&the.peer, &the.later), HG_OK);
    }
    if (now_us >= the.stop_us) {
        the.stop_us = HG_HAL_FOREVER;
        hg_board_stop(NODE);
    }
}

static void rig_open(rig *self, const hg_hal_filter *filters, size_t count)
{
    static const hg_hal_ops peer = {peer_send, peer_receive, peer_state, peer_now_us, peer_wait};

    the.later_us = HG_HAL_FOREVER;
    the.stop_us = HG_HAL_FOREVER;
    hg_board_set_idle(while_idle);
    assert_int_equal(hg_board_can(NODE, filters, count, &self->node), HG_OK);
    assert_int_equal(hg_board_can(PEER, NULL, 0U, &the.peer), HG_OK);
    self->peer = (hg_hal){.ops = &peer, .self = &the};
}

static void rig_close(rig *self)
{
    (void)self;
}

static void rig_put(rig *self, const hg_can_frame *frame)
{
    (void)self;
    (void)frame;
    check_skip("no controller can send a length that has no DLC");
}

static void rig_put_later(rig *self, const hg_can_frame *frame, uint32_t delay_us)
{
    (void)self;
    the.later = *frame;
    the.later_us = hg_board_now_us() + delay_us;
}

static void rig_report(rig *self, hg_bus_state state)
{
    (void)self;
    contract_report(state);
}

static void rig_full(rig *self, bool full)
{
    (void)self;
    contract_full(full);
}

static void rig_link(rig *self, bool up)
{
    (void)self;
    contract_link(up);
}

static void rig_stop(rig *self)
{
    (void)self;
    the.stop_us = hg_board_now_us() + STOP_AFTER_US;
}

int main(void)
{
    static const rig_ops ops = {rig_open, rig_close, rig_put, rig_put_later, rig_report, rig_full, rig_link, rig_stop};

    the.base = (rig){.ops = &ops, .classic = contract_classic};
    const int failed = contract_run(contract_name, &the.base);
    return failed + contract_own();
}
