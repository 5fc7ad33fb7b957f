/** @file
 *  Where QEMU's xlnx-zcu102 differs from the Zynq UltraScale+ itself. HG_ZYNQMP_QEMU is 1 in images for the emulator.
 *
 *  | matter | silicon | QEMU 7.2 |
 *  |---|---|---|
 *  | identifier register | 11 bits in 31:21, IDE in 19, 18 more bits in 18:1, remote in 20 or 0 | Linux's can_id: identifier in 28:0, extended in 31, remote in 30, error frame in 29 |
 *  | data registers | first byte in 31:24 | first byte in 7:0 |
 *  | error state (SR.ESTAT) | active 1, bus-off 2, passive 3 | 0: active outside the configuration mode |
 *  | sending | queued, sent when the bus allows | sent within the write of the last word; never full, never unacknowledged |
 *  | a software reset | empties the queue of received frames | keeps it: the driver empties it, on both |
 *  | CAN FD frames | an error on the wire | up to 8 bytes are handed on as classic frames, longer ones are not |
 *  | interrupts of the R5 | the RPU's GIC | none: the driver polls, on both |
 *  | processor clock, for PMCCNTR | 500 MHz, by the first stage boot loader | 1 GHz |
 *  | bit timing | obeyed | ignored |
 *  | end of the program | the processor stops | semihosting ends the emulator */
#ifndef HULLGUARD_HAL_ZYNQMP_PORT_H
#define HULLGUARD_HAL_ZYNQMP_PORT_H

#include "hal.h"

#ifndef HG_ZYNQMP_QEMU
#define HG_ZYNQMP_QEMU 0
#endif

#if HG_ZYNQMP_QEMU

#define HG_ZYNQMP_PROCESSOR_MHZ 1000U
#define HG_ZYNQMP_BYTE_SHIFT(i) (8U * ((i) % 4U))
#define HG_ZYNQMP_ERROR_FRAME 0x20000000U

static inline uint32_t hg_zynqmp_id_of(const hg_can_frame *frame)
{
    return frame->id | (((frame->flags & HG_CAN_EXTENDED) != 0U) ? 0x80000000U : 0U) | (((frame->flags & HG_CAN_REMOTE) != 0U) ? 0x40000000U : 0U);
}

static inline void hg_zynqmp_read_id(uint32_t id, hg_can_frame *frame)
{
    const bool extended = (id & 0x80000000U) != 0U;

    frame->id = id & (extended ? HG_CAN_ID_EXTENDED : HG_CAN_ID_STANDARD);
    frame->flags = (uint8_t)((extended ? HG_CAN_EXTENDED : 0U) | (((id & 0x40000000U) != 0U) ? HG_CAN_REMOTE : 0U));
}

#else

#define HG_ZYNQMP_PROCESSOR_MHZ 500U
#define HG_ZYNQMP_BYTE_SHIFT(i) (24U - (8U * ((i) % 4U)))
#define HG_ZYNQMP_ERROR_FRAME 0U

static inline uint32_t hg_zynqmp_id_of(const hg_can_frame *frame)
{
    const uint32_t remote = ((frame->flags & HG_CAN_REMOTE) != 0U) ? 1U : 0U;

    if ((frame->flags & HG_CAN_EXTENDED) == 0U) {
        return (frame->id << 21) | (remote << 20);
    }
    return ((frame->id >> 18) << 21) | (1U << 20) | (1U << 19) | ((frame->id & 0x3FFFFU) << 1) | remote;
}

static inline void hg_zynqmp_read_id(uint32_t id, hg_can_frame *frame)
{
    const bool extended = (id & (1U << 19)) != 0U;
    const bool remote = (id & (extended ? 1U : (1U << 20))) != 0U;

    frame->id = extended ? (((id >> 21) << 18) | ((id >> 1) & 0x3FFFFU)) : (id >> 21);
    frame->flags = (uint8_t)((extended ? HG_CAN_EXTENDED : 0U) | (remote ? HG_CAN_REMOTE : 0U));
}

#endif

/** The error state that ESTAT tells, of a controller in its configuration mode or not. */
static inline hg_bus_state hg_zynqmp_state(uint32_t estat, bool configuring, bool warning)
{
    if ((estat == 2U) || ((HG_ZYNQMP_QEMU == 0) && (estat == 0U)) || configuring) {
        return HG_BUS_OFF;
    }
    if (estat == 3U) {
        return HG_BUS_PASSIVE;
    }
    return warning ? HG_BUS_WARNING : HG_BUS_ACTIVE;
}

#endif
