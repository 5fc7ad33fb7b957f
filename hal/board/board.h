/** @file
 *  What a board without operating system gives to a main: its CAN controller as an hg_hal, a console, an end. One board is linked into an
 *  image; hal/ctucan/board.c and hal/zynqmp_r5/board.c are two: hg_board_place() and what is about console, clock and end. start.S of the board's
 *  folder sets up stack and memory and calls main().
 *  Cost: the console polls its UART; a character waits for room, at most HG_BOARD_SAY_POLLS readings of a register, and is then dropped. */
#ifndef HULLGUARD_HAL_BOARD_H
#define HULLGUARD_HAL_BOARD_H

#include "controller.h"

#define HG_BOARD_SAY_POLLS 100000U
#define HG_BOARD_DEPTH 128U      /* frames in the receive queue of each controller */
#define HG_BOARD_CONTROLLERS 2U  /* CAN controllers of each board that is linked so far */

/** Start a CAN controller of the board.
 *  @param[in]  number   0 .. HG_BOARD_CONTROLLERS - 1
 *  @param[in]  filters  [count] kept by reference; null: every frame
 *  @param[out] hal      the controller, valid with HG_OK
 *  @retval HG_OK          started; starting again begins anew
 *  @retval HG_E_ARGUMENT  no such controller, or a filter that hg_hal_filter_valid() refuses
 *  @retval HG_E_BUS       the controller is not there, or does not come out of its reset */
hg_status hg_board_can(uint8_t number, const hg_hal_filter *filters, size_t count, hg_hal *hal);

/** Where a controller is, made ready to be reached.
 *  @param[in]  number  0 .. HG_BOARD_CONTROLLERS - 1
 *  @param[out] place   written whole
 *  @return false where it is not there */
bool hg_board_place(uint8_t number, hg_controller_place *place);

/** What waits call between two looks, of controllers started from now on; null, as at the start: nothing. */
void hg_board_set_idle(void (*function)(void));

/** Do for a controller what its receive interrupt does: for callers that keep the processor long without a call of its hg_hal. */
void hg_board_service(uint8_t number);

/** Ask the waits of a controller to end, now and later, until it is started again. */
void hg_board_stop(uint8_t number);

/** Write text to the console. */
void hg_board_say(const char *text);

/** Write a number in decimal digits to the console. */
void hg_board_say_number(uint32_t number);

/** The next character from the console; -1: none has come. */
int hg_board_key(void);

/** Microseconds since the start. */
uint64_t hg_board_now_us(void);

/** End: in an emulator its process ends with this exit status, on a board the processor stops. */
_Noreturn void hg_board_leave(uint32_t status);

#endif
