#include "zynqmp_can.h"

#include "port.h"
#include "registers.h"

/* Registers, in words from the base. */
enum {
    SRR = 0x00 / 4, MSR = 0x04 / 4, BRPR = 0x08 / 4, BTR = 0x0C / 4, ESR = 0x14 / 4, SR = 0x18 / 4, ISR = 0x1C / 4, ICR = 0x24 / 4,
    TX_ID = 0x30 / 4, TX_DLC = 0x34 / 4, TX_DATA = 0x38 / 4, RX_ID = 0x50 / 4, RX_DLC = 0x54 / 4, RX_DATA = 0x58 / 4, AFR = 0x60 / 4
};

#define SRR_RESET (1U << 0)
#define SRR_ENABLE (1U << 1)
#define SR_CONFIG (1U << 0)
#define SR_WARNING (1U << 6)
#define SR_ESTAT(sr) (((sr) >> 7) & 0x3U)
#define SR_TX_FULL (1U << 10)
#define ISR_OVERFLOW (1U << 6)
#define ISR_RECEIVED (1U << 7)
#define ISR_ERROR (1U << 8)
#define ISR_BUS_OFF (1U << 9)
#define ESR_ALL 0x1FU
#define DLC_SHIFT 28U
#define DATA_WORDS 2U
#define DEPTH_OF_CONTROLLER 64U

/* ---- receiving, and the state of the bus ---- */

/* All four words must be read: the last one moves the queue on. */
static void read_frame(const hg_zynqmp_can *self, uint32_t *id, hg_can_frame *frame)
{
    *id = hg_register_read(self->reg, RX_ID);
    const uint32_t dlc = hg_register_read(self->reg, RX_DLC) >> DLC_SHIFT;
    const uint32_t data[DATA_WORDS] = {hg_register_read(self->reg, RX_DATA), hg_register_read(self->reg, RX_DATA + 1)};
    *frame = (hg_can_frame){.length = (uint8_t)((dlc > HG_CAN_CLASSIC_MAX) ? HG_CAN_CLASSIC_MAX : dlc)}; /* ISO 11898-1: DLC 9 .. 15 is 8 bytes */

    hg_zynqmp_read_id(*id, frame);
    if ((frame->flags & HG_CAN_REMOTE) == 0U) {
        for (uint32_t i = 0U; i < frame->length; i++) {
            frame->data[i] = (uint8_t)((data[i / 4U] >> HG_ZYNQMP_BYTE_SHIFT(i)) & 0xFFU);
        }
    }
}

static void take_frames(hg_zynqmp_can *self)
{
    uint32_t id;
    hg_can_frame frame;

    for (uint32_t i = 0U; (i < HG_ZYNQMP_CAN_BURST) && ((hg_register_read(self->reg, ISR) & ISR_RECEIVED) != 0U); i++) {
        read_frame(self, &id, &frame);
        hg_register_write(self->reg, ICR, ISR_RECEIVED); /* comes back at once where there is another one */
        if (((id & HG_ZYNQMP_ERROR_FRAME) == 0U) && hg_hal_filter_passes(self->options.filters, self->options.filter_count, &frame)
            && (hg_queue_put(&self->queue, &frame, self->options.now_us()) != HG_OK)) {
            hg_hal_count(&self->report.lost, 1U);
        }
    }
    if ((hg_register_read(self->reg, ISR) & ISR_OVERFLOW) != 0U) {
        hg_register_write(self->reg, ICR, ISR_OVERFLOW);
        hg_hal_count(&self->report.lost, 1U);
    }
}

static bool set_up(const hg_zynqmp_can *self)
{
    uint32_t polls = 0U;

    hg_register_write(self->reg, SRR, SRR_RESET);
    while (((hg_register_read(self->reg, SR) & SR_CONFIG) == 0U) && (polls < HG_ZYNQMP_CAN_RESET_POLLS)) {
        polls++;
    }
    if (polls == HG_ZYNQMP_CAN_RESET_POLLS) {
        return false;
    }
    hg_register_write(self->reg, BRPR, self->options.prescaler);
    hg_register_write(self->reg, BTR, self->options.timing);
    hg_register_write(self->reg, AFR, 0U); /* every frame: there are but four filters in hardware, and they cannot tell all kinds apart */
    hg_register_write(self->reg, MSR, 0U);
    for (uint32_t i = 0U; (i < (2U * DEPTH_OF_CONTROLLER)) && ((hg_register_read(self->reg, ISR) & ISR_RECEIVED) != 0U); i++) {
        uint32_t id;
        hg_can_frame old;
        read_frame(self, &id, &old);
        hg_register_write(self->reg, ICR, ISR_RECEIVED);
    }
    hg_register_write(self->reg, SRR, SRR_ENABLE);
    return true;
}

static void leave_bus_off(hg_zynqmp_can *self)
{
    const uint64_t now_us = self->options.now_us();

    if (!self->waiting) {
        self->waiting = true;
        self->restart_us = now_us + HG_ZYNQMP_CAN_RESTART_US;
    } else if (now_us >= self->restart_us) {
        (void)set_up(self); /* in vain: it is tried again after the same pause */
        self->restart_us = now_us + HG_ZYNQMP_CAN_RESTART_US;
    } else {
        /* not yet */
    }
}

static void look_at_state(hg_zynqmp_can *self)
{
    const uint32_t events = hg_register_read(self->reg, ISR) & (ISR_ERROR | ISR_BUS_OFF);
    const uint32_t status = hg_register_read(self->reg, SR);

    if (events != 0U) {
        hg_register_write(self->reg, ESR, ESR_ALL);
        hg_register_write(self->reg, ICR, events);
        hg_hal_count(&self->report.errors, 1U);
    }
    self->report.bus = hg_zynqmp_state(SR_ESTAT(status), (status & SR_CONFIG) != 0U, (status & SR_WARNING) != 0U);
    if (self->report.bus == HG_BUS_OFF) {
        leave_bus_off(self);
    } else {
        self->waiting = false;
    }
}

void hg_zynqmp_can_interrupt(hg_zynqmp_can *self)
{
    take_frames(self);
    look_at_state(self);
}

static hg_status receive(void *object, hg_can_frame *frame, uint64_t *time_us)
{
    hg_zynqmp_can *const self = object;

    hg_zynqmp_can_interrupt(self);
    if (hg_queue_get(&self->queue, frame, time_us) == HG_OK) {
        hg_hal_count(&self->report.received, 1U);
        return HG_OK;
    }
    return (self->report.bus == HG_BUS_OFF) ? HG_E_BUS : HG_E_EMPTY;
}

/* ---- sending ---- */

static void write_frame(const hg_zynqmp_can *self, const hg_can_frame *frame)
{
    uint32_t data[DATA_WORDS] = {0U};

    if ((frame->flags & HG_CAN_REMOTE) == 0U) {
        for (uint32_t i = 0U; i < frame->length; i++) {
            data[i / 4U] |= (uint32_t)frame->data[i] << HG_ZYNQMP_BYTE_SHIFT(i);
        }
    }
    hg_register_write(self->reg, TX_ID, hg_zynqmp_id_of(frame));
    hg_register_write(self->reg, TX_DLC, (uint32_t)frame->length << DLC_SHIFT);
    hg_register_write(self->reg, TX_DATA, data[0]);
    hg_register_write(self->reg, TX_DATA + 1, data[1]); /* the last word queues the frame */
}

static hg_status try_send(hg_zynqmp_can *self, const hg_can_frame *frame)
{
    if ((!hg_hal_sendable(frame)) || ((frame->flags & HG_CAN_FD) != 0U)) {
        return HG_E_FORMAT;
    }
    hg_zynqmp_can_interrupt(self);
    if (self->report.bus == HG_BUS_OFF) {
        return HG_E_BUS;
    }
    if ((hg_register_read(self->reg, SR) & SR_TX_FULL) != 0U) {
        return HG_E_BUSY;
    }
    write_frame(self, frame);
    return HG_OK;
}

static hg_status send(void *object, const hg_can_frame *frame)
{
    hg_zynqmp_can *const self = object;
    const hg_status status = try_send(self, frame);

    hg_hal_count((status == HG_OK) ? &self->report.sent : &self->report.refused, 1U);
    return status;
}

/* ---- the rest of hal.h ---- */

static void state(void *object, hg_hal_report *out)
{
    hg_zynqmp_can *const self = object;

    hg_zynqmp_can_interrupt(self);
    *out = self->report;
}

static uint64_t now_us(void *object)
{
    const hg_zynqmp_can *const self = object;

    return self->options.now_us();
}

static hg_status wait(void *object, uint64_t until_us)
{
    hg_zynqmp_can *const self = object;

    for (;;) {
        if (self->stop) {
            return HG_E_IO;
        }
        hg_zynqmp_can_interrupt(self);
        if (!hg_queue_empty(&self->queue)) {
            return HG_OK;
        }
        if (self->options.now_us() >= until_us) {
            return HG_E_EMPTY;
        }
        if (self->options.idle != NULL) {
            self->options.idle();
        }
    }
}

/* ---- start and stop ---- */

static bool options_good(const hg_zynqmp_can_options *options)
{
    bool good = (options->base != 0U) && ((options->base % 4U) == 0U) && (options->now_us != NULL);
    good = good && ((options->filters != NULL) || (options->filter_count == 0U));
    for (size_t i = 0U; good && (i < options->filter_count); i++) {
        good = hg_hal_filter_valid(&options->filters[i]);
    }
    return good;
}

hg_status hg_zynqmp_can_start(hg_zynqmp_can *self, const hg_zynqmp_can_options *options)
{
    if ((self == NULL) || (options == NULL) || (!options_good(options))) {
        return HG_E_ARGUMENT;
    }
    *self = (hg_zynqmp_can){.options = *options, .reg = options->base};
    const hg_status queue = hg_queue_start(&self->queue, options->slots, options->depth);
    if (queue != HG_OK) {
        return queue;
    }
    if (!set_up(self)) {
        return HG_E_BUS;
    }
    look_at_state(self);
    return HG_OK;
}

hg_hal hg_zynqmp_can_hal(hg_zynqmp_can *self)
{
    static const hg_hal_ops ops = {send, receive, state, now_us, wait};

    return (hg_hal){.ops = &ops, .self = self};
}

void hg_zynqmp_can_stop(hg_zynqmp_can *self)
{
    self->stop = true;
}
