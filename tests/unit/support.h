/** @file
 *  What every unit test needs: CMocka with the headers it wants first, numbers compared bit by bit, canaries, a seeded random source. */
#ifndef HULLGUARD_TESTS_SUPPORT_H
#define HULLGUARD_TESTS_SUPPORT_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "hullguard/real.h"
#include "hullguard/status.h"

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))
#define R(x) ((hg_real)(x))
#define REAL_NAN ((hg_real)NAN)
#define REAL_INF ((hg_real)INFINITY)
#define CANARY R(-12345.5)
#define CANARY_CODE 0x5A5A5A5A

/* CMocka widens to unsigned without a cast of its own, which -Wsign-conversion takes for a mistake. */
#define assert_status(expected, call) assert_int_equal((int)(expected), (int)(call))
#define assert_count(expected, actual) assert_int_equal((long long)(expected), (long long)(actual))

/* Same number to the bit; == on floats is what -Wfloat-equal warns of. */
static inline bool same_real(hg_real a, hg_real b)
{
    return (a <= b) && (a >= b);
}

static inline void check_real(hg_real expected, hg_real actual, const char *file, int line)
{
    if (!same_real(expected, actual)) {
        print_error("expected %.17g, got %.17g\n", (double)expected, (double)actual);
        _fail(file, line);
    }
}
#define assert_real(expected, actual) check_real(R(expected), (actual), __FILE__, __LINE__)

static inline void check_near(double expected, double actual, double tolerance, const char *file, int line)
{
    if (!(fabs(expected - actual) <= tolerance)) {
        print_error("expected %.17g within %.3g, got %.17g\n", expected, tolerance, actual);
        _fail(file, line);
    }
}
#define assert_near(expected, actual, tolerance) check_near((double)(expected), (double)(actual), (tolerance), __FILE__, __LINE__)

/* Fill memory with a number that no test computes, and see later that nobody wrote there. */
static inline void arm(hg_real *x, size_t n)
{
    for (size_t i = 0U; i < n; i++) {
        x[i] = CANARY;
    }
}

static inline void check_untouched(const hg_real *x, size_t n, const char *file, int line)
{
    for (size_t i = 0U; i < n; i++) {
        check_real(CANARY, x[i], file, line);
    }
}
#define assert_untouched(x, n) check_untouched((x), (n), __FILE__, __LINE__)

static inline void arm_codes(int32_t *x, size_t n)
{
    for (size_t i = 0U; i < n; i++) {
        x[i] = CANARY_CODE;
    }
}

#define assert_codes_untouched(x, n)                       \
    do {                                                   \
        for (size_t i_ = 0U; i_ < (n); i_++) {             \
            assert_int_equal(CANARY_CODE, (int)(x)[i_]);   \
        }                                                  \
    } while (false)

/* Random tests print their seed when they fail; HULLGUARD_SEED runs that case again. */
static inline uint32_t seed_of_run(uint32_t usual)
{
    const char *text = getenv("HULLGUARD_SEED");
    const uint32_t seed = (text != NULL) ? (uint32_t)strtoul(text, NULL, 0) : usual;
    print_message("HULLGUARD_SEED=%lu\n", (unsigned long)seed);
    return seed;
}

static inline uint32_t draw(uint32_t *state)
{
    uint32_t x = (*state == 0U) ? 0x9E3779B9U : *state; /* xorshift32 never leaves 0 */
    x ^= x << 13U;
    x ^= x >> 17U;
    x ^= x << 5U;
    *state = x;
    return x;
}

/* Uniform in low .. high. */
static inline int32_t draw_between(uint32_t *state, int32_t low, int32_t high)
{
    const int64_t span = ((int64_t)high - (int64_t)low) + 1;
    return (int32_t)((int64_t)low + ((int64_t)draw(state) % span));
}

#endif
