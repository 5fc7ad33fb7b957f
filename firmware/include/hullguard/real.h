/** @file
 *  The number type. Everything from trigger to decision computes through these few primitives, so that one source serves
 *  float32 and float64 today and a fixed-point type whose sums are wider than its values.
 *  A sum of products is gathered in an hg_acc and brought back to an hg_real once, with the power of two its matrix was scaled by
 *  (0 for the float types). Compile with -ffp-contract=off: a fused multiply-add would round differently on each target.
 *  All functions are pure, safe in interrupt context, constant time. */
#ifndef HULLGUARD_REAL_H
#define HULLGUARD_REAL_H

#include "hullguard/config.h"

#include <float.h>
#include <stdbool.h>
#include <stdint.h>

#if HG_REAL_F64
typedef double hg_real;
#define HG_REAL_C(x) (x)
#define HG_REAL_MAX DBL_MAX
#else
typedef float hg_real;
/* deviation: misra-c2012-20.10: a float constant needs its suffix, and nothing but ## can put it there */
/* cppcheck-suppress misra-c2012-20.10 */
#define HG_REAL_C(x) (x##F)
#define HG_REAL_MAX FLT_MAX
#endif
typedef hg_real hg_acc; /* of a sum of products */

#define HG_REAL_ZERO HG_REAL_C(0.0)

/** Magnitude of x. */
static inline hg_real hg_real_abs(hg_real x)
{
    return (x < HG_REAL_ZERO) ? -x : x;
}

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

/** False for NaN and for both infinities. */
static inline bool hg_real_finite(hg_real x)
{
    return (x >= -HG_REAL_MAX) && (x <= HG_REAL_MAX);
}

/** Product of two numbers that are both within their declared ranges. */
static inline hg_real hg_real_mul(hg_real a, hg_real b)
{
    return a * b;
}

/** An empty sum. */
static inline hg_acc hg_acc_zero(void)
{
    return HG_REAL_ZERO;
}

/** sum + a x: a from a table, x a signal. */
static inline hg_acc hg_acc_mac(hg_acc sum, hg_real a, hg_real x)
{
    return sum + (a * x);
}

/** The sum as a number, times 2^exponent; a saturating type saturates here. */
static inline hg_real hg_acc_real(hg_acc sum, int8_t exponent)
{
    (void)exponent;
    return sum;
}

#endif
