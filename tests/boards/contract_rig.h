/** @file
 *  The hand on the controllers that the contract suite needs: one .c file a board, emulated or modelled. */
#ifndef HULLGUARD_TESTS_BOARDS_CONTRACT_RIG_H
#define HULLGUARD_TESTS_BOARDS_CONTRACT_RIG_H

#include "hal.h"

extern const char *const contract_name;
extern const bool        contract_classic;   /* no CAN FD */

/** Take all room from controller 0, or give it back; skips the test where the emulator cannot. */
void contract_full(bool full);

/** Take controller 0 off the bus, or back. */
void contract_link(bool up);

/** Let controller 0 report this state; skips the test where the emulator cannot. */
void contract_report(hg_bus_state state);

/** Tests of this board alone; the number that failed. */
int contract_own(void);

#endif
