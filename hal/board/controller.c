#include "controller.h"

/* ---- receiving, and the state of the bus ---- */

static hg_status take_frame(hg_controller *self)
{
    const hg_controller_options *const options = &self->options;
    hg_can_frame frame;
    const hg_status status = options->place.type->read(&options->place, &frame);

    if (status == HG_E_FORMAT) {
        hg_hal_count(&self->report.malformed, 1U);
    } else if ((status == HG_OK) && hg_hal_filter_passes(options->filters, options->filter_count, &frame)
               && (hg_queue_put(&self->queue, &frame, options->now_us()) != HG_OK)) {
        hg_hal_count(&self->report.lost, 1U);
    } else {
        /* queued, not asked for, or no frame */
    }
    return status;
}

static void leave_bus_off(hg_controller *self)
{
    const hg_controller_place *const at = &self->options.place;
    const uint64_t now_us = self->options.now_us();

    if (!self->waiting) {
        at->type->withdraw(at);
        self->waiting = true;
        self->rejoin_us = now_us + HG_CONTROLLER_RESTART_US;
    } else if (now_us >= self->rejoin_us) {
        at->type->rejoin(at);
        self->rejoin_us = now_us + HG_CONTROLLER_RESTART_US;
    } else {
        /* not yet */
    }
}

static void look_at_state(hg_controller *self)
{
    const hg_controller_place *const at = &self->options.place;

    hg_hal_count(&self->report.lost, at->type->overflowed(at) ? 1U : 0U);
    hg_hal_count(&self->report.errors, at->type->reported(at) ? 1U : 0U);
    self->report.bus = at->type->state(at);
    if (self->report.bus == HG_BUS_OFF) {
        leave_bus_off(self);
    } else {
        self->waiting = false;
    }
}

void hg_controller_interrupt(hg_controller *self)
{
    uint32_t taken = 0U;

    while ((taken < HG_CONTROLLER_BURST) && (take_frame(self) != HG_E_EMPTY)) {
        taken++;
    }
    look_at_state(self);
}

/* ---- hal.h ---- */

static hg_status receive(void *object, hg_can_frame *frame, uint64_t *time_us)
{
    hg_controller *const self = object;

    hg_controller_interrupt(self);
    if (hg_queue_get(&self->queue, frame, time_us) == HG_OK) {
        hg_hal_count(&self->report.received, 1U);
        return HG_OK;
    }
    return (self->report.bus == HG_BUS_OFF) ? HG_E_BUS : HG_E_EMPTY;
}

static hg_status try_send(hg_controller *self, const hg_can_frame *frame)
{
    const hg_controller_place *const at = &self->options.place;

    if ((!hg_hal_sendable(frame)) || ((!at->type->fd) && ((frame->flags & HG_CAN_FD) != 0U))) {
        return HG_E_FORMAT;
    }
    hg_controller_interrupt(self);
    if (self->report.bus == HG_BUS_OFF) {
        return HG_E_BUS;
    }
    return at->type->write(at, frame) ? HG_OK : HG_E_BUSY;
}

static hg_status send(void *object, const hg_can_frame *frame)
{
    hg_controller *const self = object;
    const hg_status status = try_send(self, frame);

    hg_hal_count((status == HG_OK) ? &self->report.sent : &self->report.refused, 1U);
    return status;
}

static void state(void *object, hg_hal_report *out)
{
    hg_controller *const self = object;

    hg_controller_interrupt(self);
    *out = self->report;
}

static uint64_t now_us(void *object)
{
    const hg_controller *const self = object;

    return self->options.now_us();
}

static hg_status wait(void *object, uint64_t until_us)
{
    hg_controller *const self = object;

    for (;;) {
        if (self->stop) {
            return HG_E_IO;
        }
        hg_controller_interrupt(self);
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

static bool options_good(const hg_controller_options *options)
{
    const hg_controller_place *const at = &options->place;
    bool good = (at->type != NULL) && (at->base != 0U) && ((at->base % 4U) == 0U) && (options->now_us != NULL);

    good = good && ((options->filters != NULL) || (options->filter_count == 0U));
    for (size_t i = 0U; good && (i < options->filter_count); i++) {
        good = hg_hal_filter_valid(&options->filters[i]);
    }
    return good;
}

hg_status hg_controller_start(hg_controller *self, const hg_controller_options *options)
{
    if ((self == NULL) || (options == NULL) || (!options_good(options))) {
        return HG_E_ARGUMENT;
    }
    *self = (hg_controller){.options = *options};
    const hg_status queue = hg_queue_start(&self->queue, options->slots, options->depth);
    if (queue != HG_OK) {
        return queue;
    }
    if (!options->place.type->set_up(&self->options.place)) {
        return HG_E_BUS;
    }
    look_at_state(self);
    return HG_OK;
}

hg_hal hg_controller_hal(hg_controller *self)
{
    static const hg_hal_ops ops = {send, receive, state, now_us, wait};

    return (hg_hal){.ops = &ops, .self = self};
}

void hg_controller_stop(hg_controller *self)
{
    self->stop = true;
}
