/** @file
 *  What CAN controllers with registers do alike as boards of hal.h: queue, filters, counters, waits, and the way out of bus-off. What differs
 *  is a table of functions over the registers, a constant for each kind: hg_ctucan in hal/ctucan/ctucan.h, hg_zynqmp_can in
 *  hal/zynqmp_r5/zynqmp_can.h. Registers are reached through a base address (registers.h), so that one driver serves a card, an FPGA,
 *  a chip, and plain memory in a test.
 *
 *  Receiving is polled by every call, or, where the platform has routed the controller's interrupt, done by hg_controller_interrupt() as
 *  well: the interrupt must then be off while the main loop is inside send, receive, state or wait. Cost: bounded; each call reads at most
 *  HG_CONTROLLER_BURST frames and spins nowhere but in the controller's reset, HG_CONTROLLER_RESET_POLLS readings at most.
 *  lost: frames that found the queue full, exactly; and 1 for each overflow of the controller's own queue, which tells no number. It is told
 *  of with the next call.
 *  CAN FD: where the controller has none, send answers HG_E_FORMAT.
 *  Bus-off: state OFF and send HG_E_BUS at once; after HG_CONTROLLER_RESTART_US the controller is told to join again, which it does when it
 *  has seen 128 times 11 recessive bits, and reports itself; in vain, it is told so again after the same pause. Nothing waits for it. Frames
 *  that stood in its transmit queue are withdrawn: they are of samples long gone. */
#ifndef HULLGUARD_HAL_BOARD_CONTROLLER_H
#define HULLGUARD_HAL_BOARD_CONTROLLER_H

#include "hal.h"
#include "queue.h"

#define HG_CONTROLLER_BURST 64U
#define HG_CONTROLLER_RESET_POLLS 1000U
#define HG_CONTROLLER_RESTART_US 100000U /* a pause that keeps a node with a broken transceiver from disturbing the others without end */
#define HG_CONTROLLER_TIMING 2U

typedef struct hg_controller_type hg_controller_type;

/** A controller and where it is. Clocks, pins and transceiver are the platform's. */
typedef struct {
    const hg_controller_type *type;
    uintptr_t                 base;                         /* address of its registers, a multiple of 4 */
    uint32_t                  timing[HG_CONTROLLER_TIMING]; /* its registers of bit timing; the header of the type says which */
} hg_controller_place;

/** The registers of a kind of controller. No pointer is null; nothing but set_up waits. */
struct hg_controller_type {
    bool fd; /* has CAN FD */

    /* Reset, empty, set bit rates, enable. False: no such controller, or it stays in its reset. */
    bool (*set_up)(const hg_controller_place *at);

    /* Take the oldest frame. HG_OK, HG_E_EMPTY none, HG_E_FORMAT it contradicts itself, HG_E_ID its identifier is that of a report. */
    hg_status (*read)(const hg_controller_place *at, hg_can_frame *frame);

    /* Has its receive queue overflowed since the last call? */
    bool (*overflowed)(const hg_controller_place *at);

    /* Has it reported an error since the last call? */
    bool (*reported)(const hg_controller_place *at);

    hg_bus_state (*state)(const hg_controller_place *at);

    /* Queue a frame that it can send. False: no room, nothing done. */
    bool (*write)(const hg_controller_place *at, const hg_can_frame *frame);

    /* Bus-off has come: withdraw what stands in the transmit queue, unless rejoin does. */
    void (*withdraw)(const hg_controller_place *at);

    /* Leave bus-off. */
    void (*rejoin)(const hg_controller_place *at);
};

typedef struct {
    hg_controller_place  place;
    uint64_t           (*now_us)(void); /* monotonic */
    void               (*idle)(void);   /* called by wait between two looks: sleep until an interrupt, where there is one; null: nothing */
    const hg_hal_filter *filters;       /* null: every frame */
    size_t               filter_count;
    hg_queue_slot       *slots;         /* [depth] */
    uint32_t             depth;         /* a power of two */
} hg_controller_options;

typedef struct {
    hg_controller_options options;
    hg_queue              queue;
    hg_hal_report         report;
    uint64_t              rejoin_us;    /* when to leave bus-off */
    bool                  waiting;      /* for rejoin_us */
    volatile bool         stop;
} hg_controller;

/** Reset the controller, set bit rates and enable it.
 *  @retval HG_OK          started; starting again begins anew
 *  @retval HG_E_ARGUMENT  a null pointer, a base that is 0 or no multiple of 4, a depth that is no power of two, or a filter that
 *                         hg_hal_filter_valid() refuses
 *  @retval HG_E_BUS       no such controller at that address, or it stays in its reset */
hg_status hg_controller_start(hg_controller *self, const hg_controller_options *options);

/** The board. */
hg_hal hg_controller_hal(hg_controller *self);

/** Move what has arrived into the queue, and look at the controller's error state. */
void hg_controller_interrupt(hg_controller *self);

/** End this wait and every later one with HG_E_IO. Interrupts may call it. */
void hg_controller_stop(hg_controller *self);

#endif
