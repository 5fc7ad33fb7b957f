#include "hullguard/code.h"

int32_t hg_code_encode(const hg_code_scale *scale, hg_real value)
{
    int32_t code = HG_CODE_INVALID;
    if (hg_real_finite(value)) {
        const int32_t nearest = hg_real_to_code(hg_real_sub(value, scale->offset), scale->per_unit, scale->exponent);
        code = hg_code_valid(scale, nearest) ? nearest : HG_CODE_INVALID;
    }
    return code;
}

bool hg_code_valid(const hg_code_scale *scale, int32_t code)
{
    return (code >= scale->minimum) && (code <= scale->maximum);
}
