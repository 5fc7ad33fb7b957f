/* The two functions of the C library that an image may need: the library calls them, and compilers turn copies of structures into them.
 * Compiled with -fno-tree-loop-distribute-patterns, lest their loops become calls of themselves. */

#include <stdint.h>
#include <string.h>

void *memcpy(void *restrict to, const void *restrict from, size_t n)
{
    uint8_t *const target = to;
    const uint8_t *const source = from;

    for (size_t i = 0U; i < n; i++) {
        target[i] = source[i];
    }
    return to;
}

void *memset(void *to, int byte, size_t n)
{
    uint8_t *const target = to;

    for (size_t i = 0U; i < n; i++) {
        target[i] = (uint8_t)byte;
    }
    return to;
}
