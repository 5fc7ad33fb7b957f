#include "blank/blank.h"

#include "bare.h"

static hg_status blank_send(void *object, const hg_can_frame *frame)
{
    hg_blank *const self = object;

    hg_hal_count(&self->report.refused, 1U);
    return hg_hal_sendable(frame) ? HG_E_BUS : HG_E_FORMAT; /* yours: a transmit buffer, HG_E_BUSY when there is none; count `sent` */
}

static hg_status blank_receive(void *object, hg_can_frame *frame, uint64_t *time_us)
{
    (void)object;
    (void)frame;
    (void)time_us;
    return HG_E_BUS; /* yours: the oldest frame of the controller or of an hg_inbox, HG_E_EMPTY without one; count `received` */
}

static void blank_state(void *object, hg_hal_report *out)
{
    const hg_blank *const self = object;

    *out = self->report; /* yours: the controller's error counters say which state of hg_bus_state */
}

static uint64_t blank_now_us(void *object)
{
    (void)object;
    return 0U; /* yours: a free-running timer, extended to 64 bits */
}

static hg_status blank_wait(void *object, uint64_t until_us)
{
    (void)object;
    (void)until_us;
    return HG_OK; /* yours: WFI until a frame or the moment has come; HG_OK at once is allowed and keeps the processor busy */
}

hg_status hg_blank_start(hg_blank *self)
{
    if (self == NULL) {
        return HG_E_ARGUMENT;
    }
    *self = (hg_blank){.report = {.bus = HG_BUS_OFF}};
    return HG_OK;
}

hg_hal hg_blank_hal(hg_blank *self)
{
    static const hg_hal_ops ops = {blank_send, blank_receive, blank_state, blank_now_us, blank_wait};

    return (hg_hal){.ops = &ops, .self = self};
}

hg_status hg_board_start(hg_hal *board)
{
    static hg_blank blank;
    const hg_status status = hg_blank_start(&blank);

    *board = hg_blank_hal(&blank);
    return status;
}
