/** @file
 *  The part of <string.h> that the library and the compiler ask for, for images without a C library; hal/start/memory.c defines it. */
#ifndef HULLGUARD_TOOLCHAINS_STRING_H
#define HULLGUARD_TOOLCHAINS_STRING_H

#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t n);
void *memset(void *to, int byte, size_t n);

#endif
