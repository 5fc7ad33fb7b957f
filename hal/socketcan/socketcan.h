/** @file
 *  A board over Linux SocketCAN: a raw socket, CLOCK_MONOTONIC, and a wait that sleeps in the kernel.
 *
 *  What is particular to it, beside the contract of hal.h:
 *  - `lost` counts what the kernel dropped at this socket. The kernel tells with the next frame it could queue, so the number is exact once
 *    a frame sent after the loss has been received.
 *  - The bus state follows the controller's error frames (bus off, restarted, controller problems). An interface that is down or gone is
 *    HG_BUS_OFF; up again it is HG_BUS_ACTIVE; one that was removed must be opened anew. Bus off reported by the controller ends with a
 *    report too (set restart-ms on the interface), with a frame from the bus, or with the interface going down and up; until then send
 *    returns HG_E_BUS without trying. A virtual interface never reports anything by itself, but any process may write an error frame.
 *  - Arrival times are the kernel's software stamps, carried over to CLOCK_MONOTONIC. If the wall clock is set between arrival and receive
 *    they are off by as much, but never later than now and never earlier than the frame before.
 *  - send tries `send_tries` times, HG_SOCKETCAN_RETRY_US apart, when the interface's queue is full; nothing else in here sleeps but wait.
 *    On real interfaces raise txqueuelen to 100 or more: the default of 10 is what fills up.
 *  - Other processes on the host that read the same interface receive what is sent here; this object does not.
 *
 *  No heap: the object is the caller's. It is used from one thread; hg_socketcan_stop() alone may be called from anywhere. */
#ifndef HULLGUARD_HAL_SOCKETCAN_H
#define HULLGUARD_HAL_SOCKETCAN_H

#include "hal.h"

#define HG_SOCKETCAN_FILTERS_MAX   64U     /* filters of one object */
#define HG_SOCKETCAN_DEPTH         1024U   /* frames; receive queue unless asked otherwise */
#define HG_SOCKETCAN_DEPTH_MAX     65536U  /* frames */
#define HG_SOCKETCAN_TRIES         4U      /* tries of one send unless asked otherwise */
#define HG_SOCKETCAN_RETRY_US      250U    /* between two tries: about one frame at 500 kbit/s */
#define HG_SOCKETCAN_BURST         256U    /* error reports and malformed frames one receive passes over before it returns HG_E_EMPTY */

/** Options of hg_socketcan_open(); a zeroed struct is a good start. */
typedef struct {
    const hg_hal_filter *filters;        /* [filter_count] needed during open only; null: every frame; not null with count 0: none */
    size_t               filter_count;   /* 0 .. HG_SOCKETCAN_FILTERS_MAX */
    uint32_t             depth;          /* frames the receive queue must hold, 0 (HG_SOCKETCAN_DEPTH) .. HG_SOCKETCAN_DEPTH_MAX */
    uint8_t              send_tries;     /* 0 (HG_SOCKETCAN_TRIES) .. 255 */
    bool                 classic_only;   /* neither send nor receive CAN FD */
    bool                 stop_on_signal; /* SIGINT and SIGTERM stop: they are blocked in this thread from open to close. Blocked signals are
                                            inherited, so open before starting threads and close before starting programs */
} hg_socketcan_options;

/** Read error_call, error_number and depth; the rest is the backend's. */
typedef struct {
    const char   *error_call;     /* the system call that failed last, "" if none did */
    int           error_number;   /* its errno, 0 if none did */
    uint32_t      depth;          /* frames the queue holds for certain: less than asked for where the system's limit is lower */
    int           can;            /* file descriptors, -1: closed */
    int           epoll;
    int           timer;
    int           stop;
    int           signals;
    int           ifindex;
    uint8_t       send_tries;
    bool          classic_only;
    bool          down;           /* off because of the interface, not the controller */
    uint32_t      kernel_lost;    /* the socket's drop count when last told */
    uint64_t      last_us;        /* arrival of the newest frame */
    hg_hal_report report;
} hg_socketcan;

/** Open a CAN interface. Filters and formats are set before the socket is bound, so that no frame of another kind is ever queued.
 *  An interface that is down can be opened: the board is HG_BUS_OFF until it comes up.
 *  @param[out] self       the object, written whole; after any error it is closed, and error_call and error_number say what failed
 *  @param[in]  interface  its name, "can0", 1 .. 15 characters
 *  @param[in]  options    null: all at their defaults
 *  @retval HG_OK          open
 *  @retval HG_E_ARGUMENT  a null pointer, a name of wrong length, an option outside its range
 *  @retval HG_E_BUS       no interface of that name
 *  @retval HG_E_IO        the system refused: no CAN in this kernel (EAFNOSUPPORT), no descriptors left (EMFILE), ...
 *  Nothing else can fail. Cost: about 20 system calls. */
hg_status hg_socketcan_open(hg_socketcan *self, const char *interface, const hg_socketcan_options *options);

/** The object as a board. Costs: send and receive one system call each (receive one more for each frame it passes over, and one while the
 *  interface is down); wait two; state none, or one while the interface is down. HG_E_IO of send and receive leaves error_call and
 *  error_number. */
hg_hal hg_socketcan_hal(hg_socketcan *self);

/** End the present and every later wait with HG_E_IO. Safe in signal handlers, other threads and forked children; errno is kept.
 *  Cannot fail. Cost: one system call. */
void hg_socketcan_stop(hg_socketcan *self);

/** Close all, unblock what stop_on_signal blocked. Frames not yet received are dropped. Closing twice does nothing. Cannot fail. */
void hg_socketcan_close(hg_socketcan *self);

#endif
