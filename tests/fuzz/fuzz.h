/** @file
 *  What every fuzz target needs: an input read byte by byte, and the invariants of INVARIANTS.md by their numbers. A target is one function,
 *  LLVMFuzzerTestOneInput(), which libFuzzer and AFL++ both call; an input that ends is read on as zeros, so that every input is a whole run. */
#ifndef HULLGUARD_TESTS_FUZZ_H
#define HULLGUARD_TESTS_FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hullguard/real.h"
#include "hullguard/status.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* An invariant does not hold: its number is the first thing that whoever reads the log wants. */
static inline void violated(unsigned number, const char *what, const char *file, int line)
{
    (void)fprintf(stderr, "invariant I%u does not hold: %s (%s:%d)\n", number, what, file, line);
    abort();
}
#define require(number, holds)                                     \
    do {                                                           \
        if (!(holds)) {                                            \
            violated((number), #holds, __FILE__, __LINE__);        \
        }                                                          \
    } while (false)

typedef struct {
    const uint8_t *data;
    size_t         left;
} source;

static inline bool more(const source *s)
{
    return s->left > 0U;
}

static inline uint8_t take8(source *s)
{
    uint8_t byte = 0U;
    if (s->left > 0U) {
        byte = *s->data;
        s->data++;
        s->left--;
    }
    return byte;
}

static inline uint16_t take16(source *s)
{
    const uint16_t low = take8(s);
    return (uint16_t)(low | (uint16_t)((uint16_t)take8(s) << 8U));
}

static inline uint32_t take32(source *s)
{
    const uint32_t low = take16(s);
    return low | ((uint32_t)take16(s) << 16U);
}

/* 0 .. n - 1; n <= 256. */
static inline uint8_t take_below(source *s, unsigned n)
{
    return (uint8_t)(take8(s) % n);
}

/* Any finite number, from the smallest to the largest: magnitudes matter as much as values. */
static inline hg_real take_finite(source *s)
{
    const uint32_t bits = take32(s);
    float value;
    (void)memcpy(&value, &bits, sizeof(value));
    return hg_real_finite((hg_real)value) ? (hg_real)value : HG_REAL_ZERO;
}

static inline bool one_of(hg_status status, const hg_status *list, size_t n)
{
    bool found = false;
    for (size_t i = 0U; i < n; i++) {
        found = found || (status == list[i]);
    }
    return found;
}

static inline bool all_finite(const hg_real *x, size_t n)
{
    bool finite = true;
    for (size_t i = 0U; i < n; i++) {
        finite = finite && hg_real_finite(x[i]);
    }
    return finite;
}

#endif
