#include "hullguard/variance.h"

#include <stddef.h>

hg_status hg_variance_start(hg_variance *self, const hg_variance_config *config, int16_t *memory)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL)) {
        return HG_E_ARGUMENT;
    }
    if ((config->window < 3U) || (config->level < 0)) {
        return HG_E_CONFIG;
    }
    self->config = config;
    self->y = memory;
    self->S1 = 0;
    self->S2 = 0;
    self->T1 = 0;
    self->oldest = 0U;
    self->held = 0U;
    return HG_OK;
}

/* Left side of the header's equation. */
static int64_t scatter(const hg_variance *self)
{
    const int64_t W = (int64_t)self->config->window;
    int64_t sum = (W * self->S2) - (self->S1 * self->S1);
    if (self->config->detrended) {
        const int64_t slope = (2 * self->T1) - ((W - 1) * self->S1);
        sum = (((W * W) - 1) * sum) - (3 * (slope * slope));
    }
    return sum;
}

hg_status hg_variance_step(hg_variance *self, int16_t code)
{
    const uint8_t window = self->config->window;
    const int64_t y = (int64_t)code;
    if (self->held < window) {
        self->T1 += (int64_t)self->held * y;
        self->y[self->held] = code;
        self->held++;
    } else {
        const int64_t old = (int64_t)self->y[self->oldest];
        /* Every sample but the oldest moves one place down; the newest comes in on top. */
        self->T1 += (((int64_t)window - 1) * y) - (self->S1 - old);
        self->S1 -= old;
        self->S2 -= old * old;
        self->y[self->oldest] = code;
        self->oldest = ((self->oldest + 1U) < window) ? (uint8_t)(self->oldest + 1U) : 0U;
    }
    self->S1 += y;
    self->S2 += y * y;
    return ((self->held < window) || (scatter(self) > self->config->level)) ? HG_OK : HG_E_EMPTY;
}
