/** @file
 *  The classic CAN controller of the Zynq UltraScale+ MPSoC, as a controller of hal/board/controller.h.
 *  Its registers of bit timing: BRPR, the prescaler, and BTR. An FD frame on the wire is an error frame's business.
 *  What an emulator does otherwise than silicon: port.h, and nowhere else. */
#ifndef HULLGUARD_HAL_ZYNQMP_CAN_H
#define HULLGUARD_HAL_ZYNQMP_CAN_H

#include "controller.h"

extern const hg_controller_type hg_zynqmp_can;

#endif
