/** @file
 *  The one function an image without an operating system wants from its board, beside hal.h. The backend it is linked with defines it. */
#ifndef HULLGUARD_BARE_H
#define HULLGUARD_BARE_H

#include "hal.h"

/** Bring up the board's CAN controller and clock, with the bit rate and the filters of the application's network. Call it once.
 *  @param[out] board  the board, which lives as long as the image
 *  @retval HG_OK  ready; else as the backend's own start */
hg_status hg_board_start(hg_hal *board);

#endif
