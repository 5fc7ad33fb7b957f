/** @file
 *  Receive queue between a controller's interrupt, or whoever polls in its place, and hg_hal_receive(): one writer, one reader, no lock.
 *  It drops the newest frame when full and counts it, so that `lost` is exact as long as the controller itself does not overflow. */
#ifndef HULLGUARD_HAL_BOARD_QUEUE_H
#define HULLGUARD_HAL_BOARD_QUEUE_H

#include "hal.h"

typedef struct {
    uint64_t     time_us;
    hg_can_frame frame;
} hg_queue_slot;

typedef struct {
    hg_queue_slot    *slots;     /* [depth] the caller's */
    uint32_t          depth;     /* a power of two */
    volatile uint32_t written;   /* frames put, modulo 2^32: only the writer changes it */
    volatile uint32_t read;      /* frames taken, modulo 2^32: only the reader changes it */
} hg_queue;

/** @param[in] depth  a power of two, at least 2  @retval HG_OK  empty  @retval HG_E_ARGUMENT  null or no power of two */
hg_status hg_queue_start(hg_queue *self, hg_queue_slot *slots, uint32_t depth);

/** @retval HG_OK  copied  @retval HG_E_BUSY  full, nothing changed */
hg_status hg_queue_put(hg_queue *self, const hg_can_frame *frame, uint64_t time_us);

/** @param[out] time_us  may be null  @retval HG_OK  the oldest  @retval HG_E_EMPTY  none, nothing written */
hg_status hg_queue_get(hg_queue *self, hg_can_frame *frame, uint64_t *time_us);

static inline bool hg_queue_empty(const hg_queue *self)
{
    return self->written == self->read;
}

#endif
