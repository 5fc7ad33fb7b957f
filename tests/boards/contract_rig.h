/** @file
 *  The hand on the emulated controller that the contract suite needs: one .c file a board. */
#ifndef HULLGUARD_TESTS_BOARDS_CONTRACT_RIG_H
#define HULLGUARD_TESTS_BOARDS_CONTRACT_RIG_H

#include <stdbool.h>

extern const char *const contract_name;
extern const bool        contract_classic;   /* no CAN FD */

/** Take all room from controller 0, or give it back; skips the test where the emulator cannot. */
void contract_full(bool full);

/** Take controller 0 off the bus, or back. */
void contract_link(bool up);

#endif
