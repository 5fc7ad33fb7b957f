/** @file
 *  A console and an exit status through the debugger or the emulator: Cortex-M, Cortex-R (A32) and RISC-V. Without one attached the call
 *  is an exception: for tests, not for an ECU in the field. */
#ifndef HULLGUARD_SEMIHOSTING_H
#define HULLGUARD_SEMIHOSTING_H

#include <stddef.h>

/** Print length bytes; whatever happens to them cannot be known. */
void hg_semihosting_write(const char *text, size_t length);

/** End the program. @param[in] status  0 .. 255, the emulator's exit status */
_Noreturn void hg_semihosting_exit(int status);

#endif
