#include "hullguard/node.h"

#include <stddef.h>

hg_status hg_inbox_start(hg_inbox *self, hg_can_frame *frame, uint8_t length)
{
    /* A power of two divides 256, so that the counters may wrap. */
    if ((self == NULL) || (frame == NULL) || (length < 2U) || (length > 128U) || ((length & (uint8_t)(length - 1U)) != 0U)) {
        return HG_E_ARGUMENT;
    }
    self->frame = frame;
    self->length = length;
    self->written = 0U;
    self->read = 0U;
    self->overflow = 0U;
    return HG_OK;
}

hg_status hg_inbox_put(hg_inbox *self, const hg_can_frame *frame)
{
    const uint8_t written = self->written;
    const uint8_t waiting = (uint8_t)(written - self->read);
    if (waiting >= self->length) {
        const uint16_t overflow = self->overflow;
        self->overflow = (overflow < UINT16_MAX) ? (uint16_t)(overflow + 1U) : UINT16_MAX;
        return HG_E_BUSY;
    }
    self->frame[written & (uint8_t)(self->length - 1U)] = *frame;
    self->written = (uint8_t)(written + 1U);
    return HG_OK;
}

hg_status hg_inbox_get(hg_inbox *self, hg_can_frame *frame)
{
    const uint8_t read = self->read;
    if (self->written == read) {
        return HG_E_EMPTY;
    }
    *frame = self->frame[read & (uint8_t)(self->length - 1U)];
    self->read = (uint8_t)(read + 1U);
    return HG_OK;
}
