/** @file
 *  How the library meets a board: a CAN controller, a clock, and a way to sleep until one of them has something to say. Nothing more.
 *
 *  A board is an object of type hg_hal: a constant table of functions and the backend's own state. Several boards live in one image, and
 *  a wrapper that spoils frames on purpose is a board whose self points at another one. Applications call the hg_hal_*() functions below;
 *  a backend supplies an hg_hal_ops and a function that returns its hg_hal.
 *
 *  Rules for every backend; tests/contract/ checks them:
 *   1. send, receive, state and now_us never block for longer than their stated cost; only wait sleeps.
 *   2. Frames arrive in the order in which they were on the bus, none twice. What the backend had to drop is counted in `lost`.
 *   3. A board never receives the frames it sent itself.
 *   4. An error report of the controller changes the bus state and is counted; it is never handed out as a frame.
 *   5. Frames from the bus are not trusted: lengths are checked against the format, and a frame that contradicts itself is counted in
 *      `malformed` and dropped. FD lengths between two steps of the DLC (13, say) are handed on: the codec above knows what it expects.
 *   6. A counter that has reached its largest value stays there.
 *   7. One context calls one object. A backend names the functions that interrupts or signal handlers may call as well. */
#ifndef HULLGUARD_HAL_H
#define HULLGUARD_HAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hullguard/can.h"
#include "hullguard/status.h"

#define HG_HAL_FOREVER UINT64_MAX   /* a deadline that never comes */

/** Error state of the controller, by the fault confinement of ISO 11898-1. Memory that was never written is not a healthy bus. */
typedef enum {
    HG_BUS_UNKNOWN = 0,   /* nothing has been asked yet */
    HG_BUS_ACTIVE  = 1,   /* both error counters below 96 */
    HG_BUS_WARNING = 2,   /* one of them 96 .. 127 */
    HG_BUS_PASSIVE = 3,   /* one of them 128 or more */
    HG_BUS_OFF     = 4    /* transmit error counter beyond 255, or the interface is down or gone */
} hg_bus_state;

/** What hg_hal_state() tells. Counters saturate; they start at 0 when the backend starts and nothing resets them. */
typedef struct {
    hg_bus_state bus;
    uint32_t received;    /* frames handed out by receive */
    uint32_t sent;        /* frames accepted by send */
    uint32_t lost;        /* frames dropped because the receive queue was full; a backend may learn of them late (its header says when) */
    uint32_t refused;     /* calls of send that did not return HG_OK */
    uint32_t errors;      /* error reports of the controller */
    uint32_t malformed;   /* reads of a wrong size or frames whose length contradicts their format, dropped */
} hg_hal_report;

/** Frames to accept: those whose identifier agrees with id in the bits of mask, and whose identifier type (standard or extended) and
 *  kind (data or remote) are exactly those of flags. The extended twin of a standard identifier, or a remote request for it, therefore
 *  does not pass. Classic and FD frames are not told apart. Backends with fewer filters in hardware do the rest in software. */
typedef struct {
    uint32_t id;          /* 0 .. HG_CAN_ID_STANDARD, or .. HG_CAN_ID_EXTENDED with HG_CAN_EXTENDED */
    uint32_t mask;        /* the bits of id that count; HG_CAN_ID_EXTENDED: all */
    uint8_t  flags;       /* of HG_CAN_EXTENDED and HG_CAN_REMOTE */
} hg_hal_filter;

/** Functions of a backend; the wrappers below are their manual. The pointers are never null. */
typedef struct {
    hg_status (*send)(void *self, const hg_can_frame *frame);
    hg_status (*receive)(void *self, hg_can_frame *frame, uint64_t *time_us);
    void      (*state)(void *self, hg_hal_report *out);
    uint64_t  (*now_us)(void *self); /* as hg_hal_now_us(); so are the others as their wrappers */
    hg_status (*wait)(void *self, uint64_t until_us);
} hg_hal_ops;

/** A board. */
typedef struct {
    const hg_hal_ops *ops;
    void             *self;   /* the backend's object; whoever started it owns it and keeps it alive */
} hg_hal;

/** Hand a frame to the controller.
 *  HG_OK means that it stands in the controller's queue, not that a node has acknowledged it.
 *  @param[in] hal    a started board
 *  @param[in] frame  copied; the caller may reuse it at once
 *  @retval HG_OK        taken
 *  @retval HG_E_BUSY    no room now; the same call may succeed later
 *  @retval HG_E_BUS     the bus is off or the interface is down; nothing was queued
 *  @retval HG_E_FORMAT  not a frame this board can send: see hg_hal_sendable(), or FD on a classic interface
 *  @retval HG_E_IO      the driver refused for another reason; the backend keeps it
 *  Nothing else can fail. Whatever is not HG_OK is counted in `refused`. Cost: one copy of the frame, and what the backend states. */
static inline hg_status hg_hal_send(const hg_hal *hal, const hg_can_frame *frame)
{
    return hal->ops->send(hal->self, frame);
}

/** Take the oldest frame that has arrived.
 *  @param[in]  hal      a started board
 *  @param[out] frame    written only with HG_OK; data[] beyond length is zero
 *  @param[out] time_us  when it arrived, on the clock of hg_hal_now_us(), as exactly as the backend knows; may be null
 *  @retval HG_OK       a frame
 *  @retval HG_E_EMPTY  none has arrived
 *  @retval HG_E_BUS    none has arrived, and none will while the bus is off or the interface is down
 *  @retval HG_E_IO     the driver refused; the backend keeps why
 *  Nothing else can fail. Cost: one copy of the frame, and a bounded number of dropped ones. */
static inline hg_status hg_hal_receive(const hg_hal *hal, hg_can_frame *frame, uint64_t *time_us)
{
    return hal->ops->receive(hal->self, frame, time_us);
}

/** What the controller says about the bus, and the counters. Cannot fail.
 *  The state follows the reports of the controller in the order in which receive comes upon them: drain first, then ask.
 *  @param[in]  hal  a started board
 *  @param[out] out  written whole */
static inline void hg_hal_state(const hg_hal *hal, hg_hal_report *out)
{
    hal->ops->state(hal->self, out);
}

/** Time in microseconds since a moment of the backend's choice. Never goes backwards, is never set. Cannot fail. */
static inline uint64_t hg_hal_now_us(const hg_hal *hal)
{
    return hal->ops->now_us(hal->self); /* NOLINT(clang-analyzer-core.NullDereference): a backend fills ops before it answers HG_OK */
}

/** Sleep until there is something to receive, or a moment has come.
 *  Frames win over the deadline, so a caller that must act in time on a bus that never falls silent compares the clock itself.
 *  @param[in] hal       a started board
 *  @param[in] until_us  absolute, on the clock of hg_hal_now_us(); a past moment makes this a poll; HG_HAL_FOREVER: no deadline
 *  @retval HG_OK       call receive until it returns HG_E_EMPTY; it may do so at once (an error report, a change of the bus state)
 *  @retval HG_E_EMPTY  the moment has come and nothing has arrived; never returned early
 *  @retval HG_E_IO     the wait is over for good: asked to stop, by the means the backend's header names, which stays so for every later wait; or the
 *                      operating system refused, and the backend keeps why */
static inline hg_status hg_hal_wait(const hg_hal *hal, uint64_t until_us)
{
    return hal->ops->wait(hal->self, until_us);
}

/* --- for backends ------------------------------------------------------------------------------------------------------------------ */

/** Whether a length can be written in a DLC: 0 .. 8, and for FD 12, 16, 20, 24, 32, 48 and 64 as well. */
static inline bool hg_hal_length_exists(bool fd, unsigned length)
{
    if (length <= HG_CAN_CLASSIC_MAX) {
        return true;
    }
    return fd && (((length <= 24U) && ((length % 4U) == 0U)) || (length == 32U) || (length == 48U) || (length == HG_CAN_DATA_MAX));
}

/** Whether a frame can stand on a CAN bus: flags known and not HG_CAN_ERROR, identifier within its type, remote requests and bit-rate
 *  switch only where the format has them, a length that has a DLC. What this refuses, every backend's send answers with HG_E_FORMAT. */
static inline bool hg_hal_sendable(const hg_can_frame *frame)
{
    const unsigned known = HG_CAN_EXTENDED | HG_CAN_REMOTE | HG_CAN_FD | HG_CAN_BRS;
    const unsigned flags = frame->flags;
    const bool fd = (flags & HG_CAN_FD) != 0U;
    const uint32_t id_max = ((flags & HG_CAN_EXTENDED) != 0U) ? (uint32_t)HG_CAN_ID_EXTENDED : (uint32_t)HG_CAN_ID_STANDARD;

    if (((flags & ~known) != 0U) || (frame->id > id_max)) {
        return false;
    }
    if (fd && ((flags & HG_CAN_REMOTE) != 0U)) {
        return false;
    }
    if (!fd && ((flags & HG_CAN_BRS) != 0U)) {
        return false;
    }
    return hg_hal_length_exists(fd, frame->length);
}

/** Add to a counter that stays at its largest value. */
static inline void hg_hal_count(uint32_t *counter, uint32_t amount)
{
    *counter = (amount > (UINT32_MAX - *counter)) ? UINT32_MAX : (*counter + amount);
}

/** Whether a filter has bits it may not have. */
static inline bool hg_hal_filter_valid(const hg_hal_filter *filter)
{
    const unsigned flags = filter->flags;
    const uint32_t id_max = ((flags & HG_CAN_EXTENDED) != 0U) ? (uint32_t)HG_CAN_ID_EXTENDED : (uint32_t)HG_CAN_ID_STANDARD;

    return ((flags & ~(HG_CAN_EXTENDED | HG_CAN_REMOTE)) == 0U) && (filter->id <= id_max) && (filter->mask <= HG_CAN_ID_EXTENDED);
}

/** Whether a list of filters lets a frame pass. A null list passes every frame, an empty one none. Cost: count comparisons. */
static inline bool hg_hal_filter_passes(const hg_hal_filter *filters, size_t count, const hg_can_frame *frame)
{
    const unsigned kind = HG_CAN_EXTENDED | HG_CAN_REMOTE;

    if (filters == NULL) {
        return true;
    }
    for (size_t i = 0U; i < count; i++) {
        if (((frame->flags & kind) == (filters[i].flags & kind)) && (((frame->id ^ filters[i].id) & filters[i].mask) == 0U)) {
            return true;
        }
    }
    return false;
}

#endif
