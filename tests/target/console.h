/** @file
 *  Where a test program prints and how it ends: through the emulator on a bare processor, through the C library elsewhere. */
#ifndef HULLGUARD_TESTS_CONSOLE_H
#define HULLGUARD_TESTS_CONSOLE_H

#include <stddef.h>

void console_write(const char *text, size_t length);

#endif
