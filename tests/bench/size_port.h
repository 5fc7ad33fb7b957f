/** @file
 *  The world of the programs that make size measures: what is behind it belongs to the board and does not count. */
#ifndef HULLGUARD_BENCH_SIZE_PORT_H
#define HULLGUARD_BENCH_SIZE_PORT_H

#include "hullguard/hullguard.h"

#include <stddef.h>

/** Something new for the program, or the end of it. */
bool port_take(void *what, size_t length);

/** Something that the program has found. */
void port_give(const void *what, size_t length);

#endif
