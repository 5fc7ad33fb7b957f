#include "hullguard/ring.h"

#include "hullguard/linalg.h"

#include <stddef.h>

hg_status hg_ring_start(hg_ring *self, uint8_t width, uint8_t length, hg_real *memory)
{
    if ((self == NULL) || (memory == NULL) || (width == 0U) || (length == 0U)) {
        return HG_E_ARGUMENT;
    }
    self->data = memory;
    self->width = width;
    self->length = length;
    hg_ring_reset(self);
    return HG_OK;
}

void hg_ring_reset(hg_ring *self)
{
    self->newest = 0U;
    for (uint32_t i = 0U; i < HG_RING_REALS(self->width, self->length); i++) {
        self->data[i] = HG_REAL_ZERO;
    }
}

hg_real *hg_ring_open(hg_ring *self)
{
    self->newest = ((self->newest + 1U) < self->length) ? (uint8_t)(self->newest + 1U) : 0U;
    return &self->data[(uint16_t)self->newest * self->width];
}

hg_status hg_ring_push(hg_ring *self, const hg_real *row)
{
    if (!hg_linalg_finite(row, self->width)) {
        return HG_E_NUMERIC;
    }
    hg_real *newest = hg_ring_open(self);
    for (uint8_t g = 0U; g < self->width; g++) {
        newest[g] = row[g];
    }
    return HG_OK;
}

static uint16_t start_of(const hg_ring *self, uint8_t lag)
{
    const uint8_t row = (self->newest >= lag) ? (uint8_t)(self->newest - lag) : (uint8_t)((self->newest + self->length) - lag);
    return (uint16_t)row * self->width;
}

hg_real *hg_ring_row(const hg_ring *self, uint8_t lag)
{
    return &self->data[start_of(self, lag)];
}

void hg_ring_rewrite(hg_ring *self, uint8_t lag, uint8_t first, uint8_t count, const hg_real *part)
{
    if (lag < self->length) {
        hg_real *row = &self->data[start_of(self, lag)];
        for (uint8_t g = 0U; g < count; g++) {
            row[first + g] = part[g];
        }
    }
}
