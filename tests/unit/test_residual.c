/** @file
 *  residual.h: linear residual generators. */
#include "support.h"

#include "hullguard/residual.h"

#define ORDER 2U
#define OUT 2U
#define IN 3U
#define REALS (HG_RESIDUAL_REALS(ORDER, IN))

/* Halves and quarters, so that both number types give the numbers written here. */
static const hg_real a_data[ORDER * ORDER] = {R(0.5), R(0.25), R(0), R(0.5)};
static const hg_real b_data[ORDER * IN] = {R(1), R(0), R(0.5), R(0), R(2), R(0)};
static const hg_real c_data[OUT * ORDER] = {R(-1), R(0), R(0), R(1)};
static const hg_real d_data[OUT * IN] = {R(1), R(1), R(0), R(0), R(0), R(4)};
static const uint8_t signal_list[IN] = {4U, 0U, 2U};
static const hg_residual_config usual = {.order = ORDER,
                                         .residuals = OUT,
                                         .width = IN,
                                         .signal = signal_list,
                                         .state = {ORDER, ORDER, 0, a_data},
                                         .input = {ORDER, IN, 0, b_data},
                                         .output = {OUT, ORDER, 0, c_data},
                                         .direct = {OUT, IN, 0, d_data}};

static void start_tells_null_and_bad_shapes(void **state)
{
    (void)state;
    hg_residual self;
    hg_real memory[REALS];
    arm(memory, REALS);
    assert_status(HG_E_ARGUMENT, hg_residual_start(NULL, &usual, memory));
    assert_status(HG_E_ARGUMENT, hg_residual_start(&self, NULL, memory));
    assert_status(HG_E_ARGUMENT, hg_residual_start(&self, &usual, NULL));
    hg_residual_config c[12];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = usual;
    }
    c[0].order = 0U;
    c[1].residuals = 0U;
    c[2].width = 0U;
    c[3].signal = NULL;
    c[4].state.rows = 1U;
    c[5].state.cols = 1U;
    c[6].input.cols = 2U;
    c[7].output.rows = 1U;
    c[8].output.cols = 1U;
    c[9].direct.cols = 2U;
    c[10].direct.data = NULL;
    c[11].state.exponent = 3;
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_false(hg_residual_valid(&c[i]));
        assert_status(HG_E_CONFIG, hg_residual_start(&self, &c[i], memory));
    }
    assert_untouched(memory, REALS);
    assert_true(hg_residual_valid(&usual));
}

/* No size may be 0, though the tables agree about it. */
static void nothing_is_no_size(void **state)
{
    (void)state;
    hg_residual_config c = usual;
    c.order = c.state.rows = c.state.cols = c.input.rows = c.output.cols = 0U;
    assert_false(hg_residual_valid(&c));
    c = usual;
    c.residuals = c.output.rows = c.direct.rows = 0U;
    assert_false(hg_residual_valid(&c));
    c = usual;
    c.width = c.input.cols = c.direct.cols = 0U;
    assert_false(hg_residual_valid(&c));
}

static void begin(hg_residual *self, hg_real memory[REALS + 1U])
{
    arm(memory, REALS + 1U);
    assert_status(HG_OK, hg_residual_start(self, &usual, memory));
}

static void a_step_computes_by_hand(void **state)
{
    (void)state;
    hg_residual self;
    hg_real memory[REALS + 1U];
    hg_real r[OUT + 1U];
    arm(r, OUT + 1U);
    begin(&self, memory);
    const hg_real first[5] = {R(2), REAL_NAN, R(8), REAL_NAN, R(1)}; /* signals 1 and 3 are not read */
    assert_status(HG_OK, hg_residual_step(&self, first, r));
    assert_real(3.0, r[0]);
    assert_real(32.0, r[1]);
    assert_real(5.0, self.z[0]); /* 1 + 8 / 2 */
    assert_real(4.0, self.z[1]);
    const hg_real second[5] = {R(0), R(0), R(0), R(0), R(0)};
    assert_status(HG_OK, hg_residual_step(&self, second, r));
    assert_real(-5.0, r[0]);
    assert_real(4.0, r[1]);
    assert_real(3.5, self.z[0]);
    assert_real(2.0, self.z[1]);
    assert_untouched(&r[OUT], 1U);
    assert_untouched(&memory[REALS], 1U);
}

static void a_number_that_is_not_finite_changes_nothing(void **state)
{
    (void)state;
    const hg_real bad[] = {REAL_NAN, REAL_INF, -REAL_INF};
    hg_residual self;
    hg_real memory[REALS + 1U];
    hg_real r[OUT];
    begin(&self, memory);
    const hg_real good[5] = {R(2), R(0), R(8), R(0), R(1)};
    assert_status(HG_OK, hg_residual_step(&self, good, r));
    const hg_real z[ORDER] = {self.z[0], self.z[1]};
    for (size_t i = 0U; i < COUNT(bad); i++) {
        for (size_t g = 0U; g < IN; g++) {
            hg_real value[5] = {R(0), R(0), R(0), R(0), R(0)};
            value[signal_list[g]] = bad[i];
            arm(r, OUT);
            assert_status(HG_E_NUMERIC, hg_residual_step(&self, value, r));
            assert_untouched(r, OUT);
            assert_real(z[0], self.z[0]);
            assert_real(z[1], self.z[1]);
        }
    }
}

/* A state that has once become infinite would make every later residual NaN, which exceeds no threshold: the detector would be blind. */
static void a_sum_that_overflows_never_enters_the_state(void **state)
{
    (void)state;
    hg_residual self;
    hg_real memory[REALS + 1U];
    hg_real r[OUT];
    begin(&self, memory);
    const hg_real good[5] = {R(2), R(0), R(8), R(0), R(1)};
    assert_status(HG_OK, hg_residual_step(&self, good, r));
    const hg_real z[ORDER] = {self.z[0], self.z[1]};
    const hg_real huge[5] = {HG_REAL_MAX, R(0), R(0), R(0), R(0)};
    arm(r, OUT);
    assert_status(HG_E_NUMERIC, hg_residual_step(&self, huge, r));
    assert_untouched(r, OUT);
    assert_real(z[0], self.z[0]);
    assert_real(z[1], self.z[1]);
}

static void reset_is_a_fresh_start(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(31U);
    hg_residual self;
    hg_residual fresh;
    hg_real memory[REALS + 1U];
    hg_real other[REALS + 1U];
    hg_real value[5] = {R(0)};
    hg_real r[OUT];
    hg_real s[OUT];
    begin(&self, memory);
    begin(&fresh, other);
    for (int k = 0; k < 101; k++) { /* odd, so that state and scratch have changed places */
        for (size_t i = 0U; i < 5U; i++) {
            value[i] = R(draw_between(&random, -100, 100));
        }
        assert_status(HG_OK, hg_residual_step(&self, value, r));
    }
    hg_residual_reset(&self);
    for (int k = 0; k < 50; k++) {
        for (size_t i = 0U; i < 5U; i++) {
            value[i] = R(draw_between(&random, -100, 100));
        }
        assert_status(HG_OK, hg_residual_step(&self, value, r));
        assert_status(HG_OK, hg_residual_step(&fresh, value, s));
        assert_memory_equal(r, s, sizeof(r));
    }
    assert_untouched(&memory[REALS], 1U);
}

static const hg_real f_one[1] = {R(0.5)};
static const hg_real f_in[2] = {R(1), R(1)};
static const uint8_t f_signal[2] = {0U, 1U};
static const hg_residual_config filter_config = {.order = 1U,
                                                 .residuals = 1U,
                                                 .width = 2U,
                                                 .signal = f_signal,
                                                 .state = {1U, 1U, 0, f_one},
                                                 .input = {1U, 2U, 0, f_in},
                                                 .output = {1U, 1U, 0, f_one},
                                                 .direct = {1U, 2U, 0, f_in}};

static void a_pair_is_two_systems_in_series(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(33U);
    hg_residual_pair pair;
    hg_residual observer;
    hg_residual filter;
    hg_real m[4][REALS + 1U];
    hg_real r0[OUT];
    hg_real s0[OUT];
    hg_real r;
    hg_real s;
    begin(&pair.observer, m[0]);
    begin(&observer, m[1]);
    assert_status(HG_OK, hg_residual_start(&pair.filter, &filter_config, m[2]));
    assert_status(HG_OK, hg_residual_start(&filter, &filter_config, m[3]));
    for (int k = 0; k < 50; k++) {
        hg_real value[5];
        for (size_t i = 0U; i < 5U; i++) {
            value[i] = R(draw_between(&random, -100, 100));
        }
        assert_status(HG_OK, hg_residual_pair_step(&pair, value, r0, &r));
        assert_status(HG_OK, hg_residual_step(&observer, value, s0));
        assert_status(HG_OK, hg_residual_step(&filter, s0, &s));
        assert_memory_equal(r0, s0, sizeof(r0));
        assert_real(s, r);
    }
    const hg_real bad[5] = {REAL_INF, R(0), R(0), R(0), R(0)};
    const hg_real kept[3] = {pair.observer.z[0], pair.observer.z[1], pair.filter.z[0]};
    arm(r0, OUT);
    arm(&r, 1U);
    assert_status(HG_E_NUMERIC, hg_residual_pair_step(&pair, bad, r0, &r));
    assert_untouched(r0, OUT);
    assert_untouched(&r, 1U);
    assert_real(kept[0], pair.observer.z[0]);
    assert_real(kept[1], pair.observer.z[1]);
    assert_real(kept[2], pair.filter.z[0]);
    /* the filter's state is guarded as the observer's is */
    const hg_real large[5] = {R(0), R(0), R(0), R(0), HG_REAL_MAX * R(0.75)};
    pair.filter.z[0] = HG_REAL_MAX;
    assert_status(HG_E_NUMERIC, hg_residual_pair_step(&pair, large, r0, &r));
    assert_real(HG_REAL_MAX, pair.filter.z[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_tells_null_and_bad_shapes),
        cmocka_unit_test(nothing_is_no_size),
        cmocka_unit_test(a_step_computes_by_hand),
        cmocka_unit_test(a_number_that_is_not_finite_changes_nothing),
        cmocka_unit_test(a_sum_that_overflows_never_enters_the_state),
        cmocka_unit_test(reset_is_a_fresh_start),
        cmocka_unit_test(a_pair_is_two_systems_in_series),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
