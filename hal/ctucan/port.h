/** @file
 *  Where QEMU's model of the core (-device ctucan_pci) differs from the core itself. HG_CTUCAN_QEMU is 1 in images for the emulator.
 *
 *  | matter | core | QEMU 7.2 |
 *  |---|---|---|
 *  | fault state | one of active, passive, bus-off is set; bus-off while disabled and until 11 recessive bits were seen | reads 0: active while enabled |
 *  | sending | a buffer is busy until the frame is acknowledged | sent within the write that says so; never busy, never unacknowledged |
 *  | transmit priority 0 | the lowest | never sent: the driver uses 1 .. 7 on both |
 *  | time stamp of a received frame | the platform's time base | 0: the driver stamps what it takes from the core, on both |
 *  | buffer of received frames | 32 .. 4096 words, by synthesis | 2048 words |
 *  | FD length between two steps of the DLC | cannot be on a wire | taken from the host's socket, and said to be of the next step; where that is another number of words the driver finds too few: malformed |
 *  | error frame of the host's socket | cannot be on a wire | arrives as a data frame with the error class as identifier |
 *  | bit timing | obeyed | ignored |
 *  Only the first needs code. */
#ifndef HULLGUARD_HAL_CTUCAN_PORT_H
#define HULLGUARD_HAL_CTUCAN_PORT_H

#include "hal.h"

#ifndef HG_CTUCAN_QEMU
#define HG_CTUCAN_QEMU 0
#endif

#define HG_CTUCAN_ERROR_ACTIVE 0x1U   /* bits of the fault state */
#define HG_CTUCAN_ERROR_PASSIVE 0x2U
#define HG_CTUCAN_OFF 0x4U

/** The fault state that its bits tell, of a core that is enabled or not. */
static inline hg_bus_state hg_ctucan_fault(uint32_t bits, bool enabled, bool warning)
{
    if (((bits & HG_CTUCAN_OFF) != 0U) || ((HG_CTUCAN_QEMU == 0) && (bits == 0U)) || (!enabled)) {
        return HG_BUS_OFF;
    }
    if ((bits & HG_CTUCAN_ERROR_PASSIVE) != 0U) {
        return HG_BUS_PASSIVE;
    }
    return warning ? HG_BUS_WARNING : HG_BUS_ACTIVE;
}

#endif
