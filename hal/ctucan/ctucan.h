/** @file
 *  CTU CAN FD, a soft core with classic CAN and CAN FD (core version 2.2 and later), as a board of hal.h.
 *
 *  Registers are reached through a base address, so that the same driver runs on a PCI card, in an FPGA and on plain memory in a test.
 *  Receiving is polled by every call, or, where the platform has routed the core's interrupt, done by hg_ctucan_interrupt() as well:
 *  the interrupt must then be off while the main loop is inside send, receive, state or wait. Cost: bounded; each call reads at most
 *  HG_CTUCAN_BURST frames from the core and spins nowhere but in the core's reset, HG_CTUCAN_RESET_POLLS readings at most.
 *  lost: frames that found the queue full, exactly; and 1 for each overrun of the core's own buffer, which tells no number. It is told
 *  of with the next call.
 *  Bus-off: state OFF and send HG_E_BUS at once; after restart_us the error counters are reset, and the core joins again when it has
 *  seen 128 times 11 recessive bits, which it reports itself. Nothing waits for it. Frames that stood in transmit buffers are withdrawn:
 *  they are of samples long gone.
 *  What an emulator does otherwise than silicon: port.h, and nowhere else. */
#ifndef HULLGUARD_HAL_CTUCAN_H
#define HULLGUARD_HAL_CTUCAN_H

#include "hal.h"
#include "queue.h"

#define HG_CTUCAN_BURST 64U
#define HG_CTUCAN_RESET_POLLS 1000U
#define HG_CTUCAN_RESTART_US 100000U /* a pause that keeps a node with a broken transceiver from disturbing the others without end */

typedef struct {
    uintptr_t            core;          /* address of its registers, a multiple of 4 */
    uint32_t             timing;        /* register BTR: nominal bit rate */
    uint32_t             timing_fd;     /* register BTR_FD: data bit rate */
    uint64_t           (*now_us)(void); /* monotonic */
    void               (*idle)(void);   /* called by wait between two looks: sleep until an interrupt, where there is one; null: nothing */
    const hg_hal_filter *filters;       /* null: every frame */
    size_t               filter_count;
    hg_queue_slot       *slots;         /* [depth] */
    uint32_t             depth;         /* a power of two */
} hg_ctucan_options;

typedef struct {
    hg_ctucan_options  options;
    uintptr_t          core;
    hg_queue           queue;
    hg_hal_report      report;
    uint64_t           restart_us;      /* when to leave bus-off */
    bool               waiting;         /* for restart_us */
    volatile bool      stop;
} hg_ctucan;

/** Reset the core, set bit rates and enable it.
 *  @retval HG_OK          started
 *  @retval HG_E_ARGUMENT  a null pointer, a depth that is no power of two, or a filter that hg_hal_filter_valid() refuses
 *  @retval HG_E_BUS       no such core at that address, or it stays in its reset */
hg_status hg_ctucan_start(hg_ctucan *self, const hg_ctucan_options *options);

/** The board. */
hg_hal hg_ctucan_hal(hg_ctucan *self);

/** Move what has arrived into the queue, and look at the controller's error state. */
void hg_ctucan_interrupt(hg_ctucan *self);

/** End this wait and every later one with HG_E_IO. Interrupts may call it. */
void hg_ctucan_stop(hg_ctucan *self);

#endif
