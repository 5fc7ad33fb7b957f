/** @file
 *  A CAN bus inside one process, in virtual time: for tests, and for running many nodes at once without an operating system.
 *
 *  Any number of endpoints share a bus; each is a board (hal.h). A frame sent by one is put at once into the receive queue of every other
 *  whose filter lets it pass, to be received `latency_us` later. Time stands still but for hg_loopback_set_time() and for wait, which
 *  moves it to the next arrival at that endpoint or to its deadline, whichever is first: a run is deterministic, and quick.
 *  With several endpoints on one bus, let one of them wait and the others poll, or set the time yourself.
 *
 *  All memory is the caller's. Bus and endpoints must stay where they are (they point at one another), and be used from one thread;
 *  only hg_loopback_stop() may be called from a signal handler. `lost` is exact at once: a full queue drops the newest frame. */
#ifndef HULLGUARD_HAL_LOOPBACK_H
#define HULLGUARD_HAL_LOOPBACK_H

#include <signal.h>

#include "hal.h"

typedef struct hg_loopback hg_loopback;

/** A wire. Start it before its endpoints; read its members, write them through the functions. */
typedef struct {
    hg_loopback *first;
    uint64_t     now_us;
    uint32_t     latency_us;
} hg_loopback_bus;

/** One place in a receive queue. */
typedef struct {
    uint64_t     time_us;   /* arrival */
    hg_can_frame frame;
} hg_loopback_slot;

/** An endpoint. */
struct hg_loopback {
    hg_loopback_bus       *bus;
    hg_loopback           *next;
    hg_loopback_slot      *slots;         /* [depth] a ring */
    size_t                 depth;
    size_t                 head;          /* oldest */
    size_t                 held;
    const hg_hal_filter   *filters;
    size_t                 filter_count;
    hg_hal_report          report;
    uint32_t               busy;          /* sends still to be refused */
    volatile sig_atomic_t  stop;
};

/** Start a bus without endpoints at time 0.
 *  @param[out] self        the bus
 *  @param[in]  latency_us  from send to arrival, 0 .. UINT32_MAX
 *  @retval HG_OK           started
 *  @retval HG_E_ARGUMENT   self is null
 *  Nothing else can fail. */
hg_status hg_loopback_bus_start(hg_loopback_bus *self, uint32_t latency_us);

/** Join an endpoint to a bus, error-active, its queue empty.
 *  @param[out] self          the endpoint
 *  @param[in]  bus           a started bus
 *  @param[in]  slots         [depth] memory of the receive queue, the caller's, not shared
 *  @param[in]  depth         frames that are kept, at least 1
 *  @param[in]  filters       [filter_count] must outlive the endpoint; null: accept every frame; not null with count 0: none
 *  @param[in]  filter_count  length of filters
 *  @retval HG_OK             joined
 *  @retval HG_E_ARGUMENT     a null pointer, a depth of 0, or a filter outside its ranges; nothing was changed
 *  Nothing else can fail. Cost: filter_count. */
hg_status hg_loopback_start(hg_loopback *self, hg_loopback_bus *bus, hg_loopback_slot *slots, size_t depth,
                            const hg_hal_filter *filters, size_t filter_count);

/** The endpoint as a board. Its costs: send one filter pass and one copy for each endpoint of the bus; receive one copy; the rest constant.
 *  wait with HG_HAL_FOREVER and nothing under way returns HG_E_IO, because within one thread nothing could ever end it. */
hg_hal hg_loopback_hal(hg_loopback *self);

/** Set the clock of a bus. A moment before the present one is ignored: time never goes backwards. Cannot fail. */
void hg_loopback_set_time(hg_loopback_bus *self, uint64_t now_us);

/** Set the time from send to arrival for frames sent from now on; frames already under way are not overtaken. Cannot fail. */
void hg_loopback_set_latency(hg_loopback_bus *self, uint32_t latency_us);

/** Put a frame on the bus as a stranger would: every endpoint may receive it, and lengths no DLC has (13 in FD) are let through.
 *  @param[in] bus         a started bus
 *  @param[in] frame       copied
 *  @retval HG_OK          delivered or counted as lost, endpoint by endpoint
 *  @retval HG_E_ARGUMENT  a null pointer
 *  Nothing else can fail. A length beyond what the format can hold is counted in `malformed` of each endpoint and dropped there. */
hg_status hg_loopback_put(hg_loopback_bus *bus, const hg_can_frame *frame);

/** Let the next `sends` calls of send at this endpoint find no room (HG_E_BUSY); UINT32_MAX: until further notice. Cannot fail. */
void hg_loopback_set_busy(hg_loopback *self, uint32_t sends);

/** Let the controller of this endpoint report a bus state, as an error frame would; counted in `errors` if it is worse than
 *  HG_BUS_ACTIVE. In HG_BUS_OFF the endpoint neither sends nor receives; what arrives meanwhile is not for it and not lost. Cannot fail. */
void hg_loopback_set_bus(hg_loopback *self, hg_bus_state state);

/** End the present and every later wait of this endpoint with HG_E_IO. Safe in a signal handler. Cannot fail. */
void hg_loopback_stop(hg_loopback *self);

#endif
