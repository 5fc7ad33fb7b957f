/** @file
 *  What a proof says to the model checker. A proof is a function proof_X(): it takes any inputs that are allowed, calls the library, and states what must hold.
 *  It takes them with any_X(), narrows them with assume(), and ends with reach(), which fails where no input is left: a proof of nothing. */
#ifndef HULLGUARD_PROOF_H
#define HULLGUARD_PROOF_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Any value of the type: CBMC takes functions of this name for it. */
uint8_t nondet_uint8(void);
uint16_t nondet_uint16(void);
uint32_t nondet_uint32(void);
int8_t nondet_int8(void);
int16_t nondet_int16(void);
int32_t nondet_int32(void);
int64_t nondet_int64(void);
float nondet_float(void);
double nondet_double(void);

#define any_u8 nondet_uint8
#define any_u16 nondet_uint16
#define any_u32 nondet_uint32
#define any_i8 nondet_int8
#define any_i16 nondet_int16
#define any_i32 nondet_int32
#define any_i64 nondet_int64

/* A local variable without an initial value holds any; of a bool only these two are values. */
static inline bool any_bool(void)
{
    return (nondet_uint8() & 1U) != 0U;
}

static inline uint8_t any_u8_in(uint8_t least, uint8_t most)
{
    const uint8_t x = nondet_uint8();
    __CPROVER_assume((x >= least) && (x <= most));
    return x;
}

static inline int32_t any_i32_in(int32_t least, int32_t most)
{
    const int32_t x = nondet_int32();
    __CPROVER_assume((x >= least) && (x <= most));
    return x;
}

#define assume(condition) __CPROVER_assume(condition)
#define prove(condition, text) __CPROVER_assert(condition, text)

/* Is there an input that comes here? */
#define reach(text) __CPROVER_assert(false, "reachable: " text)

#define COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

/* The last n places of an array: what is written or read behind them lies outside of any object, and is seen. */
#define TAIL(array, n) (&(array)[COUNT_OF(array) - (n)])

/* ---- What instrument.py writes ---- */

/* An index of an array, checked against the array's own length; `i` of a pointer. */
#define PROOF_INDEX(a, i) \
    __builtin_choose_expr(!__builtin_types_compatible_p(__typeof__(a), __typeof__(&(a)[0])), proof_index((i), sizeof(a) / sizeof((a)[0])), (i))

static inline size_t proof_index(int64_t i, size_t length)
{
    __CPROVER_assert((i >= 0) && ((size_t)i < length), "index within its own array");
    return (size_t)i;
}

/* Arithmetic. With ANY_NUMBERS floating-point products and quotients are any, with ANY_SUMS sums and differences, too: what is proven then holds whatever they are, and the solver is
   spared them. Memory safety, and that what enters a state is finite where a comparison says so, hold that way; values do not. With ANY_SHARES they keep what rounding keeps of signs and
   sizes: of numbers that are not negative none is negative, a factor up to 1 makes nothing larger, nor does a divisor from 1 on. */
#define PROOF_ANY(result) _Generic((result), float: nondet_float(), double: nondet_double(), default: (result))
static inline float proof_times(float a, float b)
{
    const float r = nondet_float();
    const bool positive = (a >= 0.0F) && (a < __builtin_inff()) && (b >= 0.0F) && (b < __builtin_inff());
    __CPROVER_assume((!positive) || ((r >= 0.0F) && ((b > 1.0F) || (r <= a)) && ((a > 1.0F) || (r <= b))));
    return r;
}
static inline float proof_over(float a, float b)
{
    const float r = nondet_float();
    const bool positive = (a >= 0.0F) && (a < __builtin_inff()) && (b > 0.0F);
    __CPROVER_assume((!positive) || ((r >= 0.0F) && ((b < 1.0F) || (r <= a))));
    return r;
}
#ifdef ANY_SHARES
#define PROOF_TIMES(a, b) _Generic((a) * (b), float: proof_times((float)(a), (float)(b)), default: ((a) * (b)))
#define PROOF_OVER(a, b) _Generic((a) / (b), float: proof_over((float)(a), (float)(b)), default: ((a) / (b)))
#elif defined(ANY_NUMBERS)
#define PROOF_TIMES(a, b) PROOF_ANY((a) * (b))
#define PROOF_OVER(a, b) PROOF_ANY((a) / (b))
#else
#define PROOF_TIMES(a, b) ((a) * (b))
#define PROOF_OVER(a, b) ((a) / (b))
#endif
#ifdef ANY_SUMS
#define PROOF_PLUS(a, b) PROOF_ANY((a) + (b))
#define PROOF_MINUS(a, b) PROOF_ANY((a) - (b))
#else
#define PROOF_PLUS(a, b) ((a) + (b))
#define PROOF_MINUS(a, b) ((a) - (b))
#endif

#endif
