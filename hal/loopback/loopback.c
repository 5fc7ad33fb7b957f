#include "loopback.h"

#include <string.h>

/* --- the wire ---------------------------------------------------------------------------------------------------------------------- */

static bool well_formed(const hg_can_frame *frame)
{
    const bool fd = (frame->flags & HG_CAN_FD) != 0U;

    return frame->length <= (fd ? HG_CAN_DATA_MAX : HG_CAN_CLASSIC_MAX);
}

/* A remote request's length is a number without bytes behind it. */
static void copy_frame(hg_can_frame *to, const hg_can_frame *from)
{
    memset(to, 0, sizeof *to);
    to->id = from->id;
    to->flags = from->flags;
    to->length = from->length;
    if ((from->flags & HG_CAN_REMOTE) == 0U) {
        memcpy(to->data, from->data, from->length);
    }
}

static void arrive(hg_loopback *self, const hg_can_frame *frame)
{
    const size_t newest = (self->head + self->held + self->depth - 1U) % self->depth;
    uint64_t time_us = self->bus->now_us + self->bus->latency_us;

    if (self->report.bus == HG_BUS_OFF) {
        return;
    }
    if (!well_formed(frame)) {
        hg_hal_count(&self->report.malformed, 1U);
        return;
    }
    if (!hg_hal_filter_passes(self->filters, self->filter_count, frame)) {
        return;
    }
    if (self->held == self->depth) {
        hg_hal_count(&self->report.lost, 1U);
        return;
    }
    /* A latency that was made shorter must not let a frame overtake one that is under way. */
    if ((self->held > 0U) && (self->slots[newest].time_us > time_us)) {
        time_us = self->slots[newest].time_us;
    }
    hg_loopback_slot *const slot = &self->slots[(self->head + self->held) % self->depth];
    slot->time_us = time_us;
    copy_frame(&slot->frame, frame);
    self->held++;
}

static void broadcast(hg_loopback_bus *bus, const hg_loopback *sender, const hg_can_frame *frame)
{
    for (hg_loopback *other = bus->first; other != NULL; other = other->next) {
        if (other != sender) {
            arrive(other, frame);
        }
    }
}

/* --- the board --------------------------------------------------------------------------------------------------------------------- */

static hg_status try_send(hg_loopback *self, const hg_can_frame *frame)
{
    if (!hg_hal_sendable(frame)) {
        return HG_E_FORMAT;
    }
    if (self->report.bus == HG_BUS_OFF) {
        return HG_E_BUS;
    }
    if (self->busy > 0U) {
        self->busy -= (self->busy == UINT32_MAX) ? 0U : 1U;
        return HG_E_BUSY;
    }
    broadcast(self->bus, self, frame);
    return HG_OK;
}

static hg_status loopback_send(void *object, const hg_can_frame *frame)
{
    hg_loopback *const self = object;
    const hg_status status = try_send(self, frame);

    hg_hal_count((status == HG_OK) ? &self->report.sent : &self->report.refused, 1U);
    return status;
}

static bool arrived(const hg_loopback *self)
{
    return (self->held > 0U) && (self->slots[self->head].time_us <= self->bus->now_us);
}

static hg_status loopback_receive(void *object, hg_can_frame *frame, uint64_t *time_us)
{
    hg_loopback *const self = object;

    if (!arrived(self)) {
        return (self->report.bus == HG_BUS_OFF) ? HG_E_BUS : HG_E_EMPTY;
    }
    *frame = self->slots[self->head].frame;
    if (time_us != NULL) {
        *time_us = self->slots[self->head].time_us;
    }
    self->head = (self->head + 1U) % self->depth;
    self->held--;
    hg_hal_count(&self->report.received, 1U);
    return HG_OK;
}

static void loopback_state(void *object, hg_hal_report *out)
{
    const hg_loopback *const self = object;

    *out = self->report;
}

static uint64_t loopback_now_us(void *object)
{
    const hg_loopback *const self = object;

    return self->bus->now_us;
}

static hg_status loopback_wait(void *object, uint64_t until_us)
{
    hg_loopback *const self = object;

    if (self->stop != 0) {
        return HG_E_IO;
    }
    if (arrived(self)) {
        return HG_OK;
    }
    if ((self->held > 0U) && (self->slots[self->head].time_us <= until_us)) {
        hg_loopback_set_time(self->bus, self->slots[self->head].time_us);
        return HG_OK;
    }
    if (until_us == HG_HAL_FOREVER) {
        return HG_E_IO;
    }
    hg_loopback_set_time(self->bus, until_us);
    return HG_E_EMPTY;
}

/* --- set-up and the tester's hand -------------------------------------------------------------------------------------------------- */

hg_status hg_loopback_bus_start(hg_loopback_bus *self, uint32_t latency_us)
{
    if (self == NULL) {
        return HG_E_ARGUMENT;
    }
    self->first = NULL;
    self->now_us = 0U;
    self->latency_us = latency_us;
    return HG_OK;
}

hg_status hg_loopback_start(hg_loopback *self, hg_loopback_bus *bus, hg_loopback_slot *slots, size_t depth,
                            const hg_hal_filter *filters, size_t filter_count)
{
    if ((self == NULL) || (bus == NULL) || (slots == NULL) || (depth == 0U) || ((filters == NULL) && (filter_count > 0U))) {
        return HG_E_ARGUMENT;
    }
    for (size_t i = 0U; i < filter_count; i++) {
        if (!hg_hal_filter_valid(&filters[i])) {
            return HG_E_ARGUMENT;
        }
    }
    memset(self, 0, sizeof *self);
    self->bus = bus;
    self->slots = slots;
    self->depth = depth;
    self->filters = filters;
    self->filter_count = filter_count;
    self->report.bus = HG_BUS_ACTIVE;
    self->next = bus->first;
    bus->first = self;
    return HG_OK;
}

hg_hal hg_loopback_hal(hg_loopback *self)
{
    static const hg_hal_ops ops = {loopback_send, loopback_receive, loopback_state, loopback_now_us, loopback_wait};

    return (hg_hal){&ops, self};
}

void hg_loopback_set_time(hg_loopback_bus *self, uint64_t now_us)
{
    if (now_us > self->now_us) {
        self->now_us = now_us;
    }
}

void hg_loopback_set_latency(hg_loopback_bus *self, uint32_t latency_us)
{
    self->latency_us = latency_us;
}

hg_status hg_loopback_put(hg_loopback_bus *bus, const hg_can_frame *frame)
{
    if ((bus == NULL) || (frame == NULL)) {
        return HG_E_ARGUMENT;
    }
    broadcast(bus, NULL, frame);
    return HG_OK;
}

void hg_loopback_set_busy(hg_loopback *self, uint32_t sends)
{
    self->busy = sends;
}

void hg_loopback_set_bus(hg_loopback *self, hg_bus_state state)
{
    self->report.bus = state;
    if (state > HG_BUS_ACTIVE) {
        hg_hal_count(&self->report.errors, 1U);
    }
}

void hg_loopback_stop(hg_loopback *self)
{
    self->stop = 1;
}
