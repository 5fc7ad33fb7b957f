/** @file
 *  The four functions of string.h that a compiler may call by itself, for images without a C library. */
#ifndef HULLGUARD_HAL_BOARD_STRING_H
#define HULLGUARD_HAL_BOARD_STRING_H

#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t count);
void *memmove(void *to, const void *from, size_t count);
void *memset(void *to, int value, size_t count);
int   memcmp(const void *a, const void *b, size_t count);

#endif
