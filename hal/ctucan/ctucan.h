/** @file
 *  CTU CAN FD, a soft core with classic CAN and CAN FD (core version 2.2 and later), as a controller of hal/board/controller.h.
 *  Its registers of bit timing: BTR, nominal bit rate, and BTR_FD, data bit rate. A core is known by its identifier before it is reset.
 *  What an emulator does otherwise than silicon: port.h, and nowhere else. */
#ifndef HULLGUARD_HAL_CTUCAN_H
#define HULLGUARD_HAL_CTUCAN_H

#include "controller.h"

extern const hg_controller_type hg_ctucan;

#endif
