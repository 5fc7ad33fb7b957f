/** @file
 *  A board (hal/board/board.h) on the host whose controllers are register models written from their manuals: what silicon does and the emulators do
 *  not, errors above all. Time is virtual: it moves by a microsecond whenever somebody looks. One model is linked; what every model has alike is
 *  here. */
#ifndef HULLGUARD_TESTS_BOARDS_MODEL_BOARD_H
#define HULLGUARD_TESTS_BOARDS_MODEL_BOARD_H

#include "board.h"
#include "contract_rig.h"
#include "controller.h"
#include "registers.h"
#include "rig.h"

#define MODEL_BASE(i) (0x1000U + ((uintptr_t)(i) << 16)) /* where a controller's registers are said to be */
#define MODEL_NUMBER(base) (((base) - 0x1000U) >> 16)

/** What each controller has, whatever its registers. */
typedef struct {
    uint32_t fault;        /* error state, as its register tells it */
    uint32_t events;
    bool     warning;
    bool     acknowledged; /* is there anybody who does? */
} model_line;

/** How the registers of the linked model tell what happens. */
typedef struct {
    const hg_controller_type *type;
    uint32_t                  active, passive, off; /* error states */
    uint32_t                  error;                /* event */
} model_kind;

extern const model_kind model;

/** By the linked model: a controller's line. */
model_line *model_line_of(uint8_t number);

/** By the linked model: how many frames wait to be sent. */
uint32_t model_pending(uint8_t number);

/** Options that hg_controller_start() takes, for controller 0. */
hg_controller_options model_options(void);

/** Setup and teardown of tests whose state is a hg_hal[HG_BOARD_CONTROLLERS], both started. */
int model_open(void **state);
int model_close(void **state);
extern hg_hal model_hal[HG_BOARD_CONTROLLERS];

/** A row of CMUnitTest. */
#define MODEL_TEST(name) {#name, name, model_open, model_close, model_hal}

/** Tests of one model alone; the number that failed. */
int model_own(void);

#endif
