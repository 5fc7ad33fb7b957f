/** @file
 *  A board (hal/board/board.h) on the host whose controllers are register models written from their manuals: what silicon does and the emulators do
 *  not, errors above all. Time is virtual: it moves by a microsecond whenever somebody looks. */
#ifndef HULLGUARD_TESTS_BOARDS_MODEL_BOARD_H
#define HULLGUARD_TESTS_BOARDS_MODEL_BOARD_H

#include "board.h"
#include "queue.h"

#define MODEL_BASE(i) (0x1000U + ((uintptr_t)(i) << 16))   /* where the models' registers are said to be */
#define MODEL_NUMBER(base) (((base) - 0x1000U) >> 16)

extern hg_queue_slot model_slots[HG_BOARD_CONTROLLERS][HG_BOARD_DEPTH];
extern void        (*model_idle)(void);

#endif
