/** @file
 *  real.h, code.h: every conversion saturates or is refused, and rounds as the headers say. */
#include "proof.h"

#include "hullguard/code.h"

#if HG_REAL_Q31

static int64_t magnitude(int64_t x)
{
    return (x < 0) ? -x : x;
}

/** A number in fixed point is scaled down to the nearest, ties away from zero: off by half a step at most, and never of the other sign.
 *  Any 64-bit number and number of places that the header allows.
 *  @proves hg_q31_shift
 *  @run check real=q31 unwind=2 limit=150 */
void proof_q31_shift(void)
{
    const int64_t x = any_i64();
    const uint8_t places = any_u8_in(0U, 62U);
    const int64_t one = (int64_t)((uint64_t)1U << places);
    assume((x > -INT64_MAX) && (magnitude(x) < (INT64_MAX - (one / 2))));
    const int64_t y = hg_q31_shift(x, places);
    prove((magnitude(x) / one) <= magnitude(y), "not less than the floor of the magnitude");
    const uint64_t back = (uint64_t)magnitude(y) << places;
    const uint64_t size = (uint64_t)magnitude(x);
    prove(((back > size) ? (back - size) : (size - back)) <= (uint64_t)(one / 2), "to nearest");
    prove((y == 0) || ((y < 0) == (x < 0)), "of the same sign");
    reach("end");
}

/** Sums, differences, magnitudes and whatever does not fit 32 bits are exact or saturate at -(2^31 - 1) and 2^31 - 1.
 *  Any operands, the saturated ones too.
 *  @proves hg_q31_saturate hg_real_add hg_real_sub hg_real_abs hg_real_finite hg_real_defect hg_real_max hg_real_min hg_real_widen
 *  @run check real=q31 unwind=2 limit=150 */
void proof_q31_sums(void)
{
    const hg_real a = any_i32();
    const hg_real b = any_i32();
    const int64_t wide = any_i64();
    const int64_t sum = (int64_t)a + b;
    const hg_real held = hg_q31_saturate(wide);
    prove((held >= -INT32_MAX) && ((wide != (int64_t)held) == ((wide > INT32_MAX) || (wide < -(int64_t)INT32_MAX))), "what fits stays");
    prove((wide <= INT32_MAX) || (held == INT32_MAX), "too large");
    prove((wide >= -(int64_t)INT32_MAX) || (held == -INT32_MAX), "too small");
    prove(hg_real_add(a, b) == hg_q31_saturate(sum), "a + b");
    prove(hg_real_sub(a, b) == hg_q31_saturate((int64_t)a - b), "a - b");
    prove((hg_real_abs(a) >= 0) && ((hg_real_abs(a) == a) || (hg_real_abs(a) == -(int64_t)a) || (a == INT32_MIN)), "magnitude");
    prove(hg_real_finite(a) == ((a < INT32_MAX) && (a > -INT32_MAX)), "what did not fit is not finite");
    prove(hg_real_defect(a) == (hg_real_finite(a) ? 0 : 1), "a defect counts one");
    prove((hg_real_max(a, b) >= a) && (hg_real_max(a, b) >= b) && (hg_real_min(a, b) <= a) && (hg_real_min(a, b) <= b), "larger, smaller");
    prove(hg_real_widen(a, b) == a, "nothing to widen");
    reach("end");
}

/** A product in fixed point saturates, without overflow on the way: it is hg_q31_shift() and hg_q31_saturate(), which have proofs of their own, of a product that fits 63 bits.
 *  Any operands.
 *  @proves hg_real_mul
 *  @run check real=q31 unwind=2 limit=150 */
void proof_q31_mul(void)
{
    const hg_real product = hg_real_mul(any_i32(), any_i32());
    prove(product >= -INT32_MAX, "saturated on both sides alike");
    reach("end");
}

/** A sum of products comes back to the nearest step or saturates, whatever power of two it is scaled by; adding to it is exact as long as it stays in 63 bits.
 *  Any sum of magnitude below 2^63, any valid exponent; any factors whose product fits beside the sum.
 *  @proves hg_acc_real hg_acc_mac hg_acc_zero hg_exponent_valid
 *  @run check real=q31 unwind=2 limit=150 */
void proof_q31_acc(void)
{
    const hg_acc sum = any_i64();
    const int8_t exponent = any_i8();
    const hg_real a = any_i32();
    const hg_real x = any_i32();
    assume(sum > INT64_MIN);
    prove(hg_acc_zero() == 0, "an empty sum");
    prove(hg_exponent_valid(exponent) == ((exponent >= -31) && (exponent <= 30)), "powers of two");
    if (hg_exponent_valid(exponent)) {
        const hg_real held = hg_acc_real(sum, exponent);
        prove(held >= -INT32_MAX, "saturated on both sides alike");
        prove((held == 0) || ((held < 0) == (sum < 0)), "of the same sign");
        reach("a valid exponent");
    }
    if (magnitude(sum) < ((int64_t)1 << 62)) {
        (void)hg_acc_mac(sum, a, x); /* no overflow: exact */
        reach("room for one more product");
    }
}

/** A code becomes a value and a value a code without overflow, whatever the scale's tables hold: a code that is none is INT32_MIN.
 *  Any numbers and codes, any valid power of two.
 *  @proves hg_real_of_code hg_real_to_code hg_code_exponent_valid hg_code_value hg_code_encode hg_code_valid
 *  @run check real=q31 unwind=2 limit=150 */
void proof_q31_code(void)
{
    const hg_code_scale scale = {.resolution = any_i32(), .offset = any_i32(), .per_unit = any_i32(), .exponent = any_i8(), .minimum = any_i32(), .maximum = any_i32()};
    const hg_real value = any_i32();
    const int32_t code = any_i32();
    assume((scale.minimum > INT32_MIN) && hg_code_exponent_valid(scale.exponent));
    prove((scale.exponent >= -40) && (scale.exponent <= 0), "powers of two");
    const int32_t nearest = hg_real_to_code(value, scale.per_unit, scale.exponent);
    prove(hg_real_finite(value) || (nearest == INT32_MIN), "no code for what did not fit");
    const int32_t encoded = hg_code_encode(&scale, value);
    prove((encoded == HG_CODE_INVALID) || hg_code_valid(&scale, encoded), "a code within its range, or none");
    prove((encoded == HG_CODE_INVALID) == (!hg_code_valid(&scale, encoded)), "none is not valid");
    prove(hg_real_of_code(scale.resolution, scale.exponent, code) >= -INT32_MAX, "saturated");
    prove(hg_code_value(&scale, code) >= -INT32_MAX, "saturated");
    if (encoded != HG_CODE_INVALID) {
        reach("a code");
    }
}

#else

/** A value becomes a code without an undefined conversion, whatever the value and the scale's tables are, NaN and infinity among them; the code is within the scale's range or
 *  HG_CODE_INVALID.
 *  Any floats and ranges.
 *  @proves hg_real_to_code hg_code_encode hg_code_value hg_real_of_code hg_code_exponent_valid
 *  @run check real=f32 unwind=2 limit=150
 *  @run check real=f64 unwind=2 limit=150 */
void proof_float_code(void)
{
    hg_code_scale scale;
    hg_real value;
    const int32_t any = any_i32();
    assume((scale.minimum > INT32_MIN) && (scale.exponent == 0));
    prove(hg_code_exponent_valid(scale.exponent), "no power of two but 1");
    const int32_t encoded = hg_code_encode(&scale, value);
    prove((encoded == HG_CODE_INVALID) || ((encoded >= scale.minimum) && (encoded <= scale.maximum)), "a code within its range, or none");
    prove(hg_real_finite(value) || (encoded == HG_CODE_INVALID), "no code for NaN and infinity");
    (void)hg_real_to_code(value, scale.per_unit, 0);
    (void)hg_code_value(&scale, any);
    (void)hg_real_of_code(scale.resolution, 0, any);
    reach("end");
}

/** The code of a value is no further from value / resolution than half a code and 2^-22 of it; there is none only for what is not finite or beyond 31 bits.
 *  Any float; a resolution of 1, so that the quotient is the value.
 *  @proves hg_real_to_code
 *  @run check real=f32 unwind=2 limit=150
 *  @run check real=f64 unwind=2 limit=150 */
void proof_float_nearest(void)
{
    hg_real value;
    const int32_t code = hg_real_to_code(value, HG_REAL_C(1.0), 0);
    if (code != INT32_MIN) {
        const double off = (double)value - (double)code;
        const double most = 0.5 + (((code < 0) ? -(double)code : (double)code) * 0x1p-22);
        prove((off <= most) && (off >= -most), "to nearest");
        reach("a code");
    } else {
        prove((!hg_real_finite(value)) || (value <= HG_REAL_C(-2147483000.0)) || (value >= HG_REAL_C(2147483000.0)), "only where there is none");
    }
}

/** NaN and infinity are told from numbers by comparisons and by a sum of defects; larger, smaller and magnitude are those of the numbers.
 *  Any floats.
 *  @proves hg_real_finite hg_real_defect hg_real_abs hg_real_max hg_real_min hg_real_add hg_real_sub hg_real_mul hg_real_widen hg_exponent_valid hg_acc_zero hg_acc_real hg_acc_mac
 *  @run check real=f32 unwind=2 limit=150
 *  @run check real=f64 unwind=2 limit=150 */
void proof_float_primitives(void)
{
    hg_real a;
    hg_real b;
    const int8_t exponent = any_i8();
    prove(hg_real_finite(a) == __CPROVER_isfinited((double)a), "finite");
    prove((hg_real_defect(a) <= HG_REAL_ZERO) == hg_real_finite(a), "the defect of a number is 0, of others NaN");
    prove(hg_exponent_valid(exponent) == (exponent == 0), "no power of two but 1");
    if (hg_real_finite(a) && hg_real_finite(b)) {
        prove((hg_real_abs(a) >= HG_REAL_ZERO) && ((hg_real_abs(a) <= a) || (hg_real_abs(a) <= -a)), "magnitude");
        prove((hg_real_max(a, b) >= a) && (hg_real_max(a, b) >= b) && (hg_real_min(a, b) <= a) && (hg_real_min(a, b) <= b), "larger, smaller");
        prove(hg_acc_real(hg_real_add(a, hg_acc_zero()), exponent) >= a, "a + 0");
        prove(hg_real_sub(a, a) <= HG_REAL_ZERO, "a - a");
        prove(hg_real_mul(a, HG_REAL_C(1.0)) >= a, "a 1");
        prove(hg_real_widen(a, HG_REAL_C(1.0)) >= a, "widened by nothing");
        prove(hg_acc_mac(hg_acc_zero(), a, HG_REAL_C(1.0)) >= a, "0 + a 1");
        reach("numbers");
    }
}

#endif
