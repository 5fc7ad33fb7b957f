/* Byte by byte: frames are short, and nothing here is worth a second way to be wrong. Compiled without the optimisation that would turn
 * these loops into calls of themselves. */
#include <string.h>

#include <stdbool.h>
#include <stdint.h>

void *memcpy(void *restrict to, const void *restrict from, size_t count)
{
    uint8_t *const out = to;
    const uint8_t *const in = from;

    for (size_t i = 0U; i < count; i++) {
        out[i] = in[i];
    }
    return to;
}

void *memmove(void *to, const void *from, size_t count)
{
    uint8_t *const out = to;
    const uint8_t *const in = from;
    const bool up = (uintptr_t)out <= (uintptr_t)in;

    for (size_t i = 0U; i < count; i++) {
        const size_t at = up ? i : (count - 1U - i);
        out[at] = in[at];
    }
    return to;
}

void *memset(void *to, int value, size_t count)
{
    uint8_t *const out = to;

    for (size_t i = 0U; i < count; i++) {
        out[i] = (uint8_t)((unsigned)value & 0xFFU);
    }
    return to;
}

int memcmp(const void *a, const void *b, size_t count)
{
    const uint8_t *const x = a;
    const uint8_t *const y = b;

    for (size_t i = 0U; i < count; i++) {
        if (x[i] != y[i]) {
            return (int)x[i] - (int)y[i];
        }
    }
    return 0;
}
