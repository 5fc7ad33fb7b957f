/** @file
 *  The integer that stands for a signal value on the wire: value = offset + resolution * code. Trigger and hold reason about codes,
 *  because integers are the same number on every processor. Pure functions, safe in interrupt context, constant time. */
#ifndef HULLGUARD_CODE_H
#define HULLGUARD_CODE_H

#include "hullguard/real.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define HG_CODE_INVALID INT32_MIN /* stands for a value that cannot be sent: out of range or not finite */

typedef struct {           /* flash: one a signal, generated */
    hg_real resolution;  /* signal units a code, > 0; Q31: times 2^exponent */
    hg_real offset;      /* signal value of code 0 */
    hg_real per_unit;    /* codes a signal unit: 1 / resolution; Q31: 1 / (4 resolution) */
    int8_t  exponent;    /* Q31: -40 .. 0; 0 for the float types: hg_code_exponent_valid() */
    int32_t minimum;     /* smallest valid code, > INT32_MIN */
    int32_t maximum;     /* largest valid code */
} hg_code_scale;

/** Nearest code; HG_CODE_INVALID when the value is not finite or its code is outside minimum .. maximum.
 *  A tie goes away from zero. float32 moves the nearest code by at most 2^-22 |code|, Q31 by at most 2^-30 |code| and what a step of the value
 *  is in codes; a model's half (hold.h) covers it. */
int32_t hg_code_encode(const hg_code_scale *scale, hg_real value);

/** Signal value of a valid code. */
static inline hg_real hg_code_value(const hg_code_scale *scale, int32_t code)
{
    return hg_real_add(scale->offset, hg_real_of_code(scale->resolution, scale->exponent, code));
}

/** Is the code one that hg_code_encode() gives to a value? False for HG_CODE_INVALID. */
bool hg_code_valid(const hg_code_scale *scale, int32_t code);

#ifdef __cplusplus
}
#endif

#endif
