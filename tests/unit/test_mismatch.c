/** @file
 *  mismatch.h: what an uncertain plant may do, against the equation in double precision. */
#include "support.h"

#include "hullguard/mismatch.h"

#define SIGNALS 4U
#define STATES 2U
#define WIDTH 3U

/* Halves and quarters, so that both number types give the numbers written here. */
static const uint8_t signal_list[WIDTH] = {3U, 0U, 1U};
static const hg_real constant_table[STATES] = {R(0.5), R(0)};
static const hg_real gain_table[STATES * WIDTH] = {R(1), R(0.25), R(0), R(0), R(2), R(4)};
static const hg_mismatch_config usual = {.states = STATES, .width = WIDTH, .signal = signal_list, .constant = constant_table,
                                         .gain = gain_table};

static void validity_looks_at_every_table_and_place(void **state)
{
    (void)state;
    assert_true(hg_mismatch_valid(&usual, SIGNALS));
    assert_false(hg_mismatch_valid(&usual, SIGNALS - 1U));
    hg_mismatch_config c[3] = {usual, usual, usual};
    c[0].signal = NULL;
    c[1].constant = NULL;
    c[2].gain = NULL;
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_false(hg_mismatch_valid(&c[i], SIGNALS));
    }
    for (size_t g = 0U; g < WIDTH; g++) {
        uint8_t places[WIDTH] = {0U, 0U, 0U};
        hg_mismatch_config outside = usual;
        outside.signal = places;
        assert_true(hg_mismatch_valid(&outside, 1U));
        places[g] = SIGNALS;
        assert_false(hg_mismatch_valid(&outside, SIGNALS));
        places[g] = 254U;
        assert_true(hg_mismatch_valid(&outside, 255U));
        places[g] = 255U;
        assert_false(hg_mismatch_valid(&outside, 255U));
    }
}

static void constants_alone_need_no_other_table(void **state)
{
    (void)state;
    const hg_mismatch_config c = {.states = STATES, .width = 0U, .signal = NULL, .constant = constant_table, .gain = NULL};
    const hg_real none[1] = {R(0)};
    hg_real out[STATES + 1U];
    arm(out, COUNT(out));
    assert_true(hg_mismatch_valid(&c, 1U));
    hg_mismatch_step(&c, none, none, out);
    assert_real(0.5, out[0]);
    assert_real(0.0, out[1]);
    hg_mismatch_grow(&c, none, out);
    assert_real(0.5, out[0]);
    assert_untouched(&out[STATES], 1U);
}

static void without_states_nothing_is_read_or_written(void **state)
{
    (void)state;
    const hg_mismatch_config c = {.states = 0U, .width = 200U, .signal = NULL, .constant = NULL, .gain = NULL};
    const hg_real none[1] = {R(1)};
    hg_real out[1] = {CANARY};
    assert_true(hg_mismatch_valid(&c, 1U));
    hg_mismatch_step(&c, none, none, out);
    hg_mismatch_grow(&c, none, out);
    assert_untouched(out, 1U);
}

static void a_sample_computes_by_hand(void **state)
{
    (void)state;
    const hg_real value[SIGNALS] = {R(-8), R(1), R(1000), R(-2)};
    const hg_real radius[SIGNALS] = {R(1), R(0.5), R(1000), R(0.25)};
    hg_real out[STATES + 1U];
    arm(out, COUNT(out));
    hg_mismatch_step(&usual, value, radius, out);
    assert_real(0.5 + 2.25 + (0.25 * 9.0), out[0]);
    assert_real((2.0 * 9.0) + (4.0 * 1.5), out[1]);
    assert_untouched(&out[STATES], 1U);
}

static void a_wider_radius_adds_what_the_step_would_have_added(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(71U);
    for (int i = 0; i < 1000; i++) {
        hg_real value[SIGNALS];
        hg_real radius[SIGNALS];
        hg_real wide[SIGNALS];
        hg_real increase[SIGNALS];
        hg_real out[STATES + 1U];
        hg_real expected[STATES];
        for (size_t g = 0U; g < SIGNALS; g++) {
            value[g] = R((double)draw_between(&random, -64, 64) / 8.0);
            radius[g] = R((double)draw_between(&random, 0, 64) / 8.0);
            increase[g] = ((draw(&random) % 2U) == 0U) ? R(0) : R((double)draw_between(&random, 0, 64) / 8.0);
            wide[g] = radius[g] + increase[g];
        }
        arm(out, COUNT(out));
        hg_mismatch_step(&usual, value, radius, out);
        hg_mismatch_grow(&usual, increase, out);
        hg_mismatch_step(&usual, value, wide, expected);
        assert_memory_equal(expected, out, sizeof(expected));
        assert_untouched(&out[STATES], 1U);
        for (size_t s = 0U; s < STATES; s++) {
            double sum = (double)constant_table[s];
            for (size_t g = 0U; g < WIDTH; g++) {
                sum += (double)gain_table[(s * WIDTH) + g] * (fabs((double)value[signal_list[g]]) + (double)wide[signal_list[g]]);
            }
            assert_near(sum, out[s], 0.0);
        }
    }
}

static void the_largest_tables_are_read_to_their_ends(void **state)
{
    (void)state;
    static uint8_t places[255];
    static hg_real constant[255];
    static hg_real gain[255U * 255U];
    static hg_real value[255];
    static hg_real radius[255];
    static hg_real out[256];
    for (size_t i = 0U; i < 255U; i++) {
        places[i] = (uint8_t)(254U - i);
        constant[i] = R(i);
        value[i] = R(1);
        radius[i] = R(0);
        for (size_t g = 0U; g < 255U; g++) {
            gain[(i * 255U) + g] = (g == i) ? R(2) : R(0);
        }
    }
    value[0] = R(-100);
    out[255] = CANARY;
    const hg_mismatch_config c = {.states = 255U, .width = 255U, .signal = places, .constant = constant, .gain = gain};
    assert_true(hg_mismatch_valid(&c, 255U));
    hg_mismatch_step(&c, value, radius, out);
    for (size_t i = 0U; i < 254U; i++) {
        assert_real((double)i + 2.0, out[i]);
    }
    assert_real(254.0 + 200.0, out[254]);
    hg_mismatch_grow(&c, value, out); /* as increases: all 1 but the first signal's */
    assert_real(2.0 + 2.0, out[0]);
    assert_real(454.0 - 200.0, out[254]);
    assert_untouched(&out[255], 1U);
}

static void a_sum_that_is_not_finite_becomes_the_largest_number(void **state)
{
    (void)state;
    const hg_real bad[] = {REAL_NAN, REAL_INF, -REAL_INF, HG_REAL_MAX, -HG_REAL_MAX};
    for (size_t i = 0U; i < COUNT(bad); i++) {
        const hg_real none[SIGNALS] = {R(0), R(0), R(0), R(0)};
        const hg_real value[SIGNALS] = {bad[i], R(0), R(0), R(1)};
        hg_real out[STATES] = {CANARY, CANARY};
        hg_mismatch_step(&usual, value, none, out);
        assert_true(hg_real_finite(out[0]));
        assert_real(HG_REAL_MAX, out[1]); /* twice the largest number too */
        if (i < 3U) {
            assert_real(HG_REAL_MAX, out[0]);
        }
        const hg_real wide[SIGNALS] = {hg_real_abs(bad[i]), R(0), R(0), R(0)};
        out[0] = R(1);
        out[1] = R(1);
        hg_mismatch_grow(&usual, wide, out);
        assert_true(hg_real_finite(out[0]));
        assert_real(HG_REAL_MAX, out[1]);
        hg_mismatch_grow(&usual, wide, out); /* and stays there */
        assert_real(HG_REAL_MAX, out[1]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(validity_looks_at_every_table_and_place),
        cmocka_unit_test(constants_alone_need_no_other_table),
        cmocka_unit_test(without_states_nothing_is_read_or_written),
        cmocka_unit_test(a_sample_computes_by_hand),
        cmocka_unit_test(a_wider_radius_adds_what_the_step_would_have_added),
        cmocka_unit_test(the_largest_tables_are_read_to_their_ends),
        cmocka_unit_test(a_sum_that_is_not_finite_becomes_the_largest_number),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
