#include "hullguard/code.h"

int32_t hg_code_encode(const hg_code_scale *scale, hg_real value)
{
    int32_t code = HG_CODE_INVALID;
    if (hg_real_finite(value)) {
        const hg_real exact = hg_real_mul(value - scale->offset, scale->per_unit);
        /* Bounded before the conversion, which is undefined outside int32_t. */
        if ((exact > (HG_REAL_C(-2147483000.0))) && (exact < HG_REAL_C(2147483000.0))) {
            const hg_real half = (exact < HG_REAL_ZERO) ? HG_REAL_C(-0.5) : HG_REAL_C(0.5);
            const hg_real moved = exact + half;
            const int32_t nearest = (int32_t)moved; /* towards zero */
            code = hg_code_valid(scale, nearest) ? nearest : HG_CODE_INVALID;
        }
    }
    return code;
}

hg_real hg_code_value(const hg_code_scale *scale, int32_t code)
{
    return scale->offset + hg_real_mul(scale->resolution, (hg_real)code);
}

bool hg_code_valid(const hg_code_scale *scale, int32_t code)
{
    return (code >= scale->minimum) && (code <= scale->maximum);
}
