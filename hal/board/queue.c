#include "queue.h"

hg_status hg_queue_start(hg_queue *self, hg_queue_slot *slots, uint32_t depth)
{
    if ((self == NULL) || (slots == NULL) || (depth < 2U) || ((depth & (depth - 1U)) != 0U)) {
        return HG_E_ARGUMENT;
    }
    *self = (hg_queue){.slots = slots, .depth = depth};
    return HG_OK;
}

hg_status hg_queue_put(hg_queue *self, const hg_can_frame *frame, uint64_t time_us)
{
    const uint32_t written = self->written;

    if ((written - self->read) == self->depth) {
        return HG_E_BUSY;
    }
    self->slots[written & (self->depth - 1U)] = (hg_queue_slot){.time_us = time_us, .frame = *frame};
    self->written = written + 1U;   /* last: the slot is whole when the reader sees it */
    return HG_OK;
}

hg_status hg_queue_get(hg_queue *self, hg_can_frame *frame, uint64_t *time_us)
{
    const uint32_t read = self->read;

    if (self->written == read) {
        return HG_E_EMPTY;
    }
    const hg_queue_slot *const slot = &self->slots[read & (self->depth - 1U)];
    *frame = slot->frame;
    if (time_us != NULL) {
        *time_us = slot->time_us;
    }
    self->read = read + 1U;
    return HG_OK;
}
