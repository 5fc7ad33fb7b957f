/** @file
 *  linalg.h and the primitives of real.h. */
#include "support.h"

#include "hullguard/linalg.h"

static void apply_is_the_sum_of_two_products(void **state)
{
    (void)state;
    const hg_real m_data[] = {R(1), R(2), R(3), R(4)};
    const hg_real n_data[] = {R(10), R(20), R(30), R(40), R(50), R(60)};
    const hg_matrix m = {.rows = 2U, .cols = 2U, .exponent = 0, .data = m_data};
    const hg_matrix n = {.rows = 2U, .cols = 3U, .exponent = 0, .data = n_data};
    const hg_real x[] = {R(1), R(-1)};
    const hg_real y[] = {R(1), R(0.5), R(-1)};
    hg_real out[3];
    arm(out, 3U);
    hg_linalg_apply(&m, x, &n, y, out);
    assert_real(-11.0, out[0]); /* 1 - 2 + 10 + 10 - 30 */
    assert_real(4.0, out[1]);   /* 3 - 4 + 40 + 25 - 60 */
    assert_untouched(&out[2], 1U);
}

static void apply_with_an_empty_second_matrix_is_the_first_product(void **state)
{
    (void)state;
    const hg_real m_data[] = {R(2), R(3)};
    const hg_matrix m = {.rows = 1U, .cols = 2U, .exponent = 0, .data = m_data};
    const hg_matrix n = {.rows = 1U, .cols = 0U, .exponent = 0, .data = m_data};
    const hg_real x[] = {R(5), R(7)};
    hg_real out[2];
    arm(out, 2U);
    hg_linalg_apply(&m, x, &n, x, out);
    assert_real(31.0, out[0]);
    hg_linalg_apply(&n, x, &m, x, out);
    assert_real(31.0, out[0]);
    assert_untouched(&out[1], 1U);
}

/* A large number that cancels shows the order: in index order, first m then n, the small term between is lost or kept. */
static void apply_sums_in_index_order(void **state)
{
    (void)state;
    const hg_real big = R(1.0) / ((sizeof(hg_real) == 4U) ? R(FLT_EPSILON) : R(DBL_EPSILON)) * R(4.0);
    const hg_real m_data[] = {big, R(1)};
    const hg_real n_data[] = {-big, R(1)};
    const hg_real ones[] = {R(1), R(1)};
    const hg_matrix m = {.rows = 1U, .cols = 2U, .exponent = 0, .data = m_data};
    const hg_matrix n = {.rows = 1U, .cols = 2U, .exponent = 0, .data = n_data};
    hg_real out;
    hg_linalg_apply(&m, ones, &n, ones, &out);
    assert_real(1.0, out); /* the first 1 drowned, the second did not */
}

static void apply_takes_the_largest_shape(void **state)
{
    (void)state;
    static hg_real table[255U * 255U];
    static hg_real x[255];
    static hg_real out[256];
    for (size_t i = 0U; i < COUNT(table); i++) {
        table[i] = R(1);
    }
    for (size_t i = 0U; i < 255U; i++) {
        x[i] = R(1);
    }
    const hg_matrix m = {.rows = 255U, .cols = 255U, .exponent = 0, .data = table};
    arm(out, 256U);
    hg_linalg_apply(&m, x, &m, x, out);
    for (size_t i = 0U; i < 255U; i++) {
        assert_real(510.0, out[i]);
    }
    assert_untouched(&out[255], 1U);
}

static void fits_notices_each_contradiction(void **state)
{
    (void)state;
    const hg_real data[6] = {R(0)};
    const hg_matrix m = {.rows = 2U, .cols = 3U, .exponent = 0, .data = data};
    const hg_matrix n = {.rows = 2U, .cols = 1U, .exponent = 0, .data = data};
    assert_true(hg_linalg_fits(&m, &n, 2U, 3U, 1U));
    assert_false(hg_linalg_fits(&m, &n, 1U, 3U, 1U));
    assert_false(hg_linalg_fits(&m, &n, 2U, 2U, 1U));
    assert_false(hg_linalg_fits(&m, &n, 2U, 3U, 2U));
    hg_matrix other = n;
    other.rows = 3U;
    assert_false(hg_linalg_fits(&m, &other, 2U, 3U, 1U));
    other = n;
    other.exponent = 1;
    assert_false(hg_linalg_fits(&m, &other, 2U, 3U, 1U));
    hg_matrix scaled = m;
    scaled.exponent = 1;
    assert_false(hg_linalg_fits(&scaled, &other, 2U, 3U, 1U)); /* float tables are not scaled */
    other = n;
    other.data = NULL;
    assert_false(hg_linalg_fits(&m, &other, 2U, 3U, 1U));
    other = m;
    other.data = NULL;
    assert_false(hg_linalg_fits(&other, &n, 2U, 3U, 1U));
}

static void finite_finds_a_bad_number_at_every_place(void **state)
{
    (void)state;
    const hg_real bad[] = {REAL_NAN, -REAL_NAN, REAL_INF, -REAL_INF};
    hg_real x[5] = {R(0), R(-0.0), HG_REAL_MAX, -HG_REAL_MAX, R(1)};
    assert_true(hg_linalg_finite(x, 5U));
    assert_true(hg_linalg_finite(x, 0U));
    for (size_t i = 0U; i < COUNT(bad); i++) {
        for (size_t place = 0U; place < 5U; place++) {
            const hg_real kept = x[place];
            x[place] = bad[i];
            assert_false(hg_linalg_finite(x, 5U));
            assert_true(hg_linalg_finite(x, (uint16_t)place));
            x[place] = kept;
        }
    }
}

static void a_list_out_of_order_is_found_at_every_place(void **state)
{
    (void)state;
    uint8_t place[255];
    for (uint8_t i = 0U; i < COUNT(place); i++) {
        place[i] = i;
    }
    assert_true(hg_linalg_in_order(place, 255U));
    assert_true(hg_linalg_in_order(place, 0U));
    for (uint8_t i = 0U; i < COUNT(place); i++) {
        place[i] = (uint8_t)(i + 1U);
        assert_false(hg_linalg_in_order(place, 255U));
        assert_true(hg_linalg_in_order(place, i));
        place[i] = i;
    }
}

/* The last codes that there are, and the first numbers behind them. */
static void a_number_without_a_code_has_none(void **state)
{
    (void)state;
    const hg_real last = (sizeof(hg_real) == 4U) ? R(nextafterf(2147483000.0F, 0.0F)) : R(nextafter(2147483000.0, 0.0));
    assert_true(hg_real_to_code(last, R(1), 0) > 2147482000);
    assert_true(hg_real_to_code(-last, R(1), 0) < -2147482000);
    const hg_real none[] = {R(2147483000.0), R(3e9), R(1e30), HG_REAL_MAX, REAL_INF, REAL_NAN};
    for (size_t i = 0U; i < COUNT(none); i++) {
        assert_int_equal(INT32_MIN, hg_real_to_code(none[i], R(1), 0));
        assert_int_equal(INT32_MIN, hg_real_to_code(-none[i], R(1), 0));
        assert_int_equal(INT32_MIN, hg_real_to_code(none[i], R(2), 0));
    }
    assert_int_equal(INT32_MIN, hg_real_to_code(REAL_INF, R(0), 0));
    assert_int_equal(0, hg_real_to_code(R(0), R(1), 0));
}

static void primitives_choose_and_measure(void **state)
{
    (void)state;
    assert_false(signbit(hg_real_abs(R(0))));
    assert_true(hg_real_finite(HG_REAL_MAX));
    assert_true(hg_real_finite(-HG_REAL_MAX));
    assert_false(hg_real_finite(REAL_INF));
    assert_false(hg_real_finite(-REAL_INF));
    assert_real(2.0, hg_real_abs(R(-2.0)));
    assert_real(2.0, hg_real_abs(R(2.0)));
    assert_real(3.0, hg_real_max(R(3.0), R(-4.0)));
    assert_real(3.0, hg_real_max(R(-4.0), R(3.0)));
    assert_real(-4.0, hg_real_min(R(3.0), R(-4.0)));
    assert_real(-4.0, hg_real_min(R(-4.0), R(3.0)));
    assert_real(HG_REAL_MAX, hg_real_min(REAL_INF, HG_REAL_MAX));
    assert_real(6.0, hg_acc_real(hg_acc_mac(hg_acc_zero(), R(2.0), R(3.0)), 5));
    assert_false(hg_real_finite(REAL_NAN));
    assert_true(hg_real_finite(R(1e-40)));
}

static void root_is_the_square_root(void **state)
{
    (void)state;
    static const double squares[] = {1e-30, 1e-3, 0.5, 1.0, 2.0, 3.999, 4.0, 49.0, 1e30};
    for (size_t i = 0U; i < COUNT(squares); i++) {
        assert_near(1.0, (double)hg_linalg_root(R(squares[i])) / sqrt(squares[i]), 3e-7);
    }
    const double step = (sizeof(hg_real) == 4U) ? (double)FLT_EPSILON : 2.0 * DBL_EPSILON; /* the reference rounds too */
    for (int i = 0; i < 30000; i++) { /* all of 1 .. 4: what is left of Newton's iteration is less than a step of the number type */
        const hg_real x = R(1) + (R(i) * R(1e-4));
        assert_near(1.0, (double)hg_linalg_root(x) / sqrt((double)x), step);
    }
    assert_near(1.0, (double)hg_linalg_root(R(FLT_MIN)) / sqrt((double)FLT_MIN), step);
    assert_near(1.0, (double)hg_linalg_root(R(FLT_MAX)) / sqrt((double)FLT_MAX), step);
    assert_real(8.0, hg_linalg_root(R(64)));
    assert_true(hg_linalg_root(R(0)) < R(1e-20));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(apply_is_the_sum_of_two_products),
        cmocka_unit_test(apply_with_an_empty_second_matrix_is_the_first_product),
        cmocka_unit_test(apply_sums_in_index_order),
        cmocka_unit_test(apply_takes_the_largest_shape),
        cmocka_unit_test(fits_notices_each_contradiction),
        cmocka_unit_test(finite_finds_a_bad_number_at_every_place),
        cmocka_unit_test(a_list_out_of_order_is_found_at_every_place),
        cmocka_unit_test(a_number_without_a_code_has_none),
        cmocka_unit_test(primitives_choose_and_measure),
        cmocka_unit_test(root_is_the_square_root),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
