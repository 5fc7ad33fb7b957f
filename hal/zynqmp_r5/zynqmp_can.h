/** @file
 *  The classic CAN controller of the Zynq UltraScale+ MPSoC, as a board of hal.h.
 *
 *  Receiving is polled by every call, or, where the platform has routed the controller's interrupt, done by hg_zynqmp_can_interrupt() as
 *  well: the interrupt must then be off while the main loop is inside send, receive, state or wait. Cost: bounded; each call reads at
 *  most HG_ZYNQMP_CAN_BURST frames and spins nowhere but in the controller's reset, HG_ZYNQMP_CAN_RESET_POLLS readings at most.
 *  lost: frames that found the queue full, exactly; and 1 for each overflow of the controller's own 64 frames, which tells no number. It
 *  is told of with the next call.
 *  CAN FD: the controller has none. send answers HG_E_FORMAT; an FD frame on the wire is an error frame's business.
 *  Bus-off: state OFF and send HG_E_BUS at once; after HG_ZYNQMP_CAN_RESTART_US the controller is set up anew, and joins when it has seen
 *  128 times 11 recessive bits, which it reports itself. Nothing waits for it. Frames that stood in its queue are dropped: they are of
 *  samples long gone.
 *  What an emulator does otherwise than silicon: port.h, and nowhere else. */
#ifndef HULLGUARD_HAL_ZYNQMP_CAN_H
#define HULLGUARD_HAL_ZYNQMP_CAN_H

#include "hal.h"
#include "queue.h"

#define HG_ZYNQMP_CAN_BURST 64U
#define HG_ZYNQMP_CAN_RESET_POLLS 1000U
#define HG_ZYNQMP_CAN_RESTART_US 100000U /* a pause that keeps a node with a broken transceiver from disturbing the others without end */

typedef struct {
    uintptr_t            base;          /* address of its registers, a multiple of 4 */
    uint32_t             prescaler;     /* register BRPR */
    uint32_t             timing;        /* register BTR */
    uint64_t           (*now_us)(void); /* monotonic */
    void               (*idle)(void);   /* called by wait between two looks: sleep until an interrupt, where there is one; null: nothing */
    const hg_hal_filter *filters;       /* null: every frame */
    size_t               filter_count;
    hg_queue_slot       *slots;         /* [depth] */
    uint32_t             depth;         /* a power of two */
} hg_zynqmp_can_options;

typedef struct {
    hg_zynqmp_can_options options;
    uintptr_t             reg;
    hg_queue              queue;
    hg_hal_report         report;
    uint64_t              restart_us;   /* when to leave bus-off */
    bool                  waiting;      /* for restart_us */
    volatile bool         stop;
} hg_zynqmp_can;

/** Reset the controller, set the bit rate and enable it. Clocks, pins and transceiver are the platform's.
 *  @retval HG_OK          started
 *  @retval HG_E_ARGUMENT  a null pointer, a depth that is no power of two, or a filter that hg_hal_filter_valid() refuses
 *  @retval HG_E_BUS       it stays in its reset */
hg_status hg_zynqmp_can_start(hg_zynqmp_can *self, const hg_zynqmp_can_options *options);

/** The board. */
hg_hal hg_zynqmp_can_hal(hg_zynqmp_can *self);

/** Move what has arrived into the queue, and look at the controller's error state. */
void hg_zynqmp_can_interrupt(hg_zynqmp_can *self);

/** End this wait and every later one with HG_E_IO. Interrupts may call it. */
void hg_zynqmp_can_stop(hg_zynqmp_can *self);

#endif
