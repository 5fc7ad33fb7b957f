/** @file
 *  A board with nothing on it: the template for a new backend, and what an image is linked with where there is no CAN controller to drive.
 *  Its bus is off: send answers HG_E_BUS, receive HG_E_BUS when asked, and its clock stands still. Copy the folder, give the functions
 *  your board's name, and replace each body; hal.h says what they promise. No function may be called from an interrupt. */
#ifndef HULLGUARD_BLANK_H
#define HULLGUARD_BLANK_H

#include "hal.h"

/** State of the backend; the caller's. */
typedef struct {
    hg_hal_report report;
} hg_blank;

/** Bring up the controller and the clock. A real one takes the bit rate and the filters here, and can fail.
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer */
hg_status hg_blank_start(hg_blank *self);

/** The board as an application sees it, valid as long as *self. */
hg_hal hg_blank_hal(hg_blank *self);

#endif
