/** @file
 *  The number type. Everything from trigger to decision computes through these few primitives, so that one source serves float32, float64
 *  and Q31, a fixed-point type for cores without an FPU whose sums are wider than its values.
 *
 *               float types                       Q31
 *  hg_real      the number                        the number / 2^e, as 1/2^31 steps, -2^31 < q < 2^31; every signal, state and residual has an e of
 *                                                 its own, chosen by the design so that what it can ever be is less than 2^e
 *  hg_acc       a sum of products                 the same, as 1/2^62 steps in 64 bits; tables keep it below 2^63 whatever the signals are: the
 *                                                 magnitudes of what is multiplied into one sum add up to less than 2^31 in each table
 *  tables       the numbers                       the numbers / 2^exponent as Q31, exponent -31 .. 30 beside each table (0 for the float types)
 *  infinity     infinity                          +-(2^31 - 1): what did not fit saturates there, and is refused and counted as an infinity is
 *  rounding     to nearest even                   to nearest, ties away from zero: at most half a step each where this says "rounds"
 *
 *  A sum of products is gathered in an hg_acc and brought back to an hg_real once. Compile with -ffp-contract=off: a fused multiply-add would
 *  round differently on each target. Q31 results are the same bits everywhere. All functions are pure, safe in interrupt context, constant time. */
#ifndef HULLGUARD_REAL_H
#define HULLGUARD_REAL_H

#include "hullguard/config.h"

#include <float.h>
#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Generated tables carry both kinds of numbers. */
#if HG_REAL_Q31
#define HG_REAL_T(x, q) (q)
#define HG_EXPONENT(e) (e)
#else
#define HG_REAL_T(x, q) HG_REAL_C(x)
#define HG_EXPONENT(e) 0
#endif

#if HG_REAL_Q31
/* A number, and a sum of products, as the table above says. */
typedef int32_t hg_real;
typedef int64_t hg_acc;
/* deviation: misra-c2012-10.8: a constant is scaled and cut in one expression, because tables are initialised with it */
/* cppcheck-suppress-macro misra-c2012-10.8 */
#define HG_REAL_C(x) (((x) >= 1.0) ? INT32_MAX : (int32_t)((x) * 2147483648.0)) /* 1 and above: infinity */
#define HG_REAL_MAX (INT32_MAX - 1) /* the largest finite number */
#elif HG_REAL_F64
typedef double hg_real;
typedef hg_real hg_acc;
#define HG_REAL_C(x) (x)
#define HG_REAL_MAX DBL_MAX
#else
typedef float hg_real;
typedef hg_real hg_acc;
/* deviation: misra-c2012-20.10: a float constant needs its suffix, and nothing but ## can put it there */
/* cppcheck-suppress misra-c2012-20.10 */
#define HG_REAL_C(x) (x##F)
#define HG_REAL_MAX FLT_MAX
#endif

#if HG_REAL_Q31
#define HG_REAL_ZERO 0 /* the number 0 */

/* x / 2^places, rounded; 0 <= places <= 62, |x| + half of 2^places < 2^63. */
static inline int64_t hg_q31_shift(int64_t x, uint8_t places)
{
    const uint64_t one = 1U;
    const uint64_t half = (one << places) >> 1U;
    const uint64_t magnitude = (((x < 0) ? (uint64_t)(-x) : (uint64_t)x) + half) >> places;
    return (x < 0) ? -(int64_t)magnitude : (int64_t)magnitude;
}

/* The nearest number of the type: what does not fit becomes an infinity. */
static inline hg_real hg_q31_saturate(int64_t x)
{
    int64_t held = (x > (int64_t)INT32_MAX) ? (int64_t)INT32_MAX : x;
    held = (held < -(int64_t)INT32_MAX) ? -(int64_t)INT32_MAX : held;
    return (hg_real)held;
}

/** Magnitude of x. */
static inline hg_real hg_real_abs(hg_real x)
{
    return (x < 0) ? hg_q31_saturate(-(int64_t)x) : x;
}

/** False for what did not fit. */
static inline bool hg_real_finite(hg_real x)
{
    return (x >= -HG_REAL_MAX) && (x <= HG_REAL_MAX);
}

/** 0 for a finite number, 1 for what did not fit: many are checked by one sum. */
static inline hg_real hg_real_defect(hg_real x)
{
    return hg_real_finite(x) ? 0 : 1;
}

/** a + b. Exact, or saturated. */
static inline hg_real hg_real_add(hg_real a, hg_real b)
{
    return hg_q31_saturate((int64_t)a + b);
}

/** a - b. Exact, or saturated. */
static inline hg_real hg_real_sub(hg_real a, hg_real b)
{
    return hg_q31_saturate((int64_t)a - b);
}

/** a b, rounds: a from a table of numbers below 1. */
static inline hg_real hg_real_mul(hg_real a, hg_real b)
{
    return hg_q31_saturate(hg_q31_shift((int64_t)a * b, 31U));
}

/** x made larger by more than rounding can take from a sum: not needed where the bound of each rounding is in the tables. */
static inline hg_real hg_real_widen(hg_real x, hg_real factor)
{
    (void)factor;
    return x;
}

/** Do these powers of two fit the sums? */
static inline bool hg_exponent_valid(int8_t exponent)
{
    return (exponent >= -31) && (exponent <= 30);
}

/** May a scale of codes have this power of two? -40: the smallest code that one of 31 bits can stand for in an hg_real is less than a step then. */
static inline bool hg_code_exponent_valid(int8_t exponent)
{
    return (exponent >= -40) && (exponent <= 0);
}

/** resolution code 2^exponent, rounds; hg_code_exponent_valid(). */
static inline hg_real hg_real_of_code(hg_real resolution, int8_t exponent, int32_t code)
{
    return hg_q31_saturate(hg_q31_shift((int64_t)resolution * code, (uint8_t)(-exponent)));
}

/** x per_unit 2^-exponent / 4 to the nearest integer, ties away from zero, per_unit = 1 / (4 resolution); INT32_MIN where there is none;
 *  hg_code_exponent_valid(). */
static inline int32_t hg_real_to_code(hg_real x, hg_real per_unit, int8_t exponent)
{
    const int32_t places = 60 + (int32_t)exponent;
    const int64_t nearest = hg_q31_shift((int64_t)x * per_unit, (uint8_t)places);
    const bool known = hg_real_finite(x) && (nearest > -(int64_t)INT32_MAX) && (nearest < (int64_t)INT32_MAX);
    return known ? (int32_t)nearest : INT32_MIN;
}

/** sum + a x: a from a table, x a signal. Exact. */
static inline hg_acc hg_acc_mac(hg_acc sum, hg_real a, hg_real x)
{
    return sum + ((int64_t)a * x);
}

/** The sum as a number, times 2^exponent; rounds, and saturates here. */
static inline hg_real hg_acc_real(hg_acc sum, int8_t exponent)
{
    const int32_t places = 31 - (int32_t)exponent;
    return hg_q31_saturate(hg_q31_shift(sum, (uint8_t)places));
}

/** An empty sum. */
static inline hg_acc hg_acc_zero(void)
{
    return 0;
}

#else
#define HG_REAL_ZERO HG_REAL_C(0.0)

/** Magnitude of x. */
static inline hg_real hg_real_abs(hg_real x)
{
    return (x < HG_REAL_ZERO) ? -x : x;
}

/** False for NaN and for both infinities. */
static inline bool hg_real_finite(hg_real x)
{
    return (x >= -HG_REAL_MAX) && (x <= HG_REAL_MAX);
}

/** 0 for a finite number, NaN for what is none: many are checked by one sum. */
static inline hg_real hg_real_defect(hg_real x)
{
    return x - x;
}

/** a + b. */
static inline hg_real hg_real_add(hg_real a, hg_real b)
{
    return a + b;
}

/** a - b. */
static inline hg_real hg_real_sub(hg_real a, hg_real b)
{
    return a - b;
}

/** Product of two numbers that are both within their declared ranges. */
static inline hg_real hg_real_mul(hg_real a, hg_real b)
{
    return a * b;
}

/** x made larger by more than rounding can take from a sum. */
static inline hg_real hg_real_widen(hg_real x, hg_real factor)
{
    return x * factor;
}

/** Only Q31 tables are scaled. */
static inline bool hg_exponent_valid(int8_t exponent)
{
    return exponent == 0;
}

/** Only scales of Q31 carry a power of two. */
static inline bool hg_code_exponent_valid(int8_t exponent)
{
    return exponent == 0;
}

/** resolution code. */
static inline hg_real hg_real_of_code(hg_real resolution, int8_t exponent, int32_t code)
{
    (void)exponent;
    return hg_real_mul(resolution, (hg_real)code);
}

/** x per_unit to the nearest integer, ties away from zero; INT32_MIN where there is none. */
static inline int32_t hg_real_to_code(hg_real x, hg_real per_unit, int8_t exponent)
{
    int32_t code = INT32_MIN;
    (void)exponent;
    if (hg_real_finite(x)) {
        const hg_real exact = x * per_unit;
        /* Bounded before the conversion, which is undefined outside int32_t. */
        if ((exact > HG_REAL_C(-2147483000.0)) && (exact < HG_REAL_C(2147483000.0))) {
            const hg_real half = (exact < HG_REAL_ZERO) ? HG_REAL_C(-0.5) : HG_REAL_C(0.5);
            const hg_real moved = exact + half;
            code = (int32_t)moved; /* towards zero */
        }
    }
    return code;
}

/** sum + a x: a from a table, x a signal. */
static inline hg_acc hg_acc_mac(hg_acc sum, hg_real a, hg_real x)
{
    return sum + (a * x);
}

/** The sum as a number. */
static inline hg_real hg_acc_real(hg_acc sum, int8_t exponent)
{
    (void)exponent;
    return sum;
}

/** An empty sum. */
static inline hg_acc hg_acc_zero(void)
{
    return HG_REAL_ZERO;
}
#endif

/** The larger of two finite numbers. */
static inline hg_real hg_real_max(hg_real a, hg_real b)
{
    return (a > b) ? a : b;
}

/** The smaller of two finite numbers. */
static inline hg_real hg_real_min(hg_real a, hg_real b)
{
    return (a < b) ? a : b;
}

#ifdef __cplusplus
}
#endif

#endif
