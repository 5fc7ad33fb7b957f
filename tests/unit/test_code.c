/** @file
 *  code.h: values to integers and back. */
#include "support.h"

#include "hullguard/code.h"

static hg_code_scale scale_of(double resolution, double offset, int32_t minimum, int32_t maximum)
{
    return (hg_code_scale){.resolution = R(resolution), .offset = R(offset), .per_unit = R(1.0 / resolution), .minimum = minimum,
        .maximum = maximum};
}

static void every_code_survives_the_round_trip(void **state)
{
    (void)state;
    const double resolutions[] = {0.5, 0.01, 3.0, 1.0 / 65536.0};
    const double offsets[] = {0.0, -100.0, 12.5};
    for (size_t i = 0U; i < COUNT(resolutions); i++) {
        for (size_t j = 0U; j < COUNT(offsets); j++) {
            /* float32 must still tell neighbouring values apart beside the offset */
            if ((sizeof(hg_real) == 4U) && ((fabs(offsets[j]) / resolutions[i]) > 1e6)) {
                continue;
            }
            const hg_code_scale scale = scale_of(resolutions[i], offsets[j], -2048, 2047);
            for (int32_t code = -2048; code <= 2047; code++) {
                assert_int_equal(code, hg_code_encode(&scale, hg_code_value(&scale, code)));
            }
        }
    }
}

static void a_value_goes_to_the_nearest_code(void **state)
{
    (void)state;
    const hg_code_scale scale = scale_of(0.25, 1.0, -100, 100);
    assert_int_equal(0, hg_code_encode(&scale, R(1.0)));
    assert_int_equal(0, hg_code_encode(&scale, R(1.12)));
    assert_int_equal(1, hg_code_encode(&scale, R(1.13)));
    assert_int_equal(-1, hg_code_encode(&scale, R(0.87)));
    assert_int_equal(0, hg_code_encode(&scale, R(0.88)));
}

static void a_tie_goes_away_from_zero(void **state)
{
    (void)state;
    const hg_code_scale scale = scale_of(1.0, 0.0, -100, 100);
    for (int32_t i = 0; i < 100; i++) {
        assert_int_equal(i + 1, hg_code_encode(&scale, R((double)i + 0.5)));
        assert_int_equal(-i - 1, hg_code_encode(&scale, R(-(double)i - 0.5)));
    }
}

/* The deviation that a model's half must cover, as the header states it: half a code and 2^-22 of the code. */
static void rounding_moves_the_nearest_code_by_no_more_than_stated(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(11U);
    const hg_code_scale scale = scale_of(1.0, 0.0, -2147480000, 2147480000);
    for (int i = 0; i < 200000; i++) {
        const int32_t size = draw_between(&random, 0, 30);
        const hg_real value = R((double)draw_between(&random, -2147480000, 2147480000) / (double)(1L << size));
        const int32_t code = hg_code_encode(&scale, value);
        if (hg_code_valid(&scale, code)) {
            assert_true(fabs((double)value - (double)code) <= (0.5 + (fabs((double)code) / 4194304.0)));
        }
    }
    const hg_real below_half = R(0.49999997);
    assert_true(hg_code_encode(&scale, below_half) <= 1);
}

static void a_code_outside_the_range_is_invalid(void **state)
{
    (void)state;
    const hg_code_scale scale = scale_of(1.0, 0.0, -3, 5);
    assert_int_equal(-3, hg_code_encode(&scale, R(-3.0)));
    assert_int_equal(-3, hg_code_encode(&scale, R(-3.4)));
    assert_int_equal(HG_CODE_INVALID, hg_code_encode(&scale, R(-3.6)));
    assert_int_equal(5, hg_code_encode(&scale, R(5.4)));
    assert_int_equal(HG_CODE_INVALID, hg_code_encode(&scale, R(5.5)));
}

static void what_is_not_finite_or_overflows_is_invalid(void **state)
{
    (void)state;
    const hg_code_scale scale = scale_of(1.0, 0.0, -INT32_MAX, INT32_MAX);
    const hg_real hopeless[] = {REAL_NAN, REAL_INF, -REAL_INF, HG_REAL_MAX, -HG_REAL_MAX, R(2147483648.0), R(-2147483648.0), R(1e12),
        R(-1e12)};
    for (size_t i = 0U; i < COUNT(hopeless); i++) {
        assert_int_equal(HG_CODE_INVALID, hg_code_encode(&scale, hopeless[i]));
    }
    /* The difference to the offset overflows before the range is looked at. */
    const hg_code_scale far = {.resolution = R(1.0), .offset = -HG_REAL_MAX, .per_unit = R(1.0), .minimum = -5, .maximum = 5};
    assert_int_equal(HG_CODE_INVALID, hg_code_encode(&far, HG_REAL_MAX));
    assert_int_equal(2000000000, hg_code_encode(&scale, R(2000000000.0)));
    assert_int_equal(-2000000000, hg_code_encode(&scale, R(-2000000000.0)));
}

static void validity_is_the_closed_range(void **state)
{
    (void)state;
    const hg_code_scale scale = scale_of(1.0, 0.0, -3, 5);
    assert_false(hg_code_valid(&scale, HG_CODE_INVALID));
    assert_false(hg_code_valid(&scale, -4));
    assert_true(hg_code_valid(&scale, -3));
    assert_true(hg_code_valid(&scale, 5));
    assert_false(hg_code_valid(&scale, 6));
    assert_false(hg_code_valid(&scale, INT32_MAX));
}

static void the_value_of_a_code_is_offset_and_resolution(void **state)
{
    (void)state;
    const hg_code_scale scale = scale_of(0.25, 1.0, -100, 100);
    assert_real(1.0, hg_code_value(&scale, 0));
    assert_real(26.0, hg_code_value(&scale, 100));
    assert_real(-24.0, hg_code_value(&scale, -100));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_code_survives_the_round_trip),
        cmocka_unit_test(a_value_goes_to_the_nearest_code),
        cmocka_unit_test(a_tie_goes_away_from_zero),
        cmocka_unit_test(rounding_moves_the_nearest_code_by_no_more_than_stated),
        cmocka_unit_test(a_code_outside_the_range_is_invalid),
        cmocka_unit_test(what_is_not_finite_or_overflows_is_invalid),
        cmocka_unit_test(validity_is_the_closed_range),
        cmocka_unit_test(the_value_of_a_code_is_offset_and_resolution),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
