/** @file
 *  hull.h: thresholds from radii, against a sum over the whole past in double precision. */
#include "support.h"

#include "hullguard/hull.h"

#define SIGNALS 3U
#define LENGTH 5U
#define TAPS 4U
#define OUT 2U
#define IN 2U
#define SETTLE 3U

static const uint8_t signal_list[IN] = {2U, 0U};
static hg_real weight_table[TAPS * OUT * IN];
static const hg_real rest_table[SETTLE * OUT] = {R(1), R(2), R(0.5), R(1), R(0.25), R(0.5)};
static const hg_real moving_table[SETTLE * OUT] = {R(100), R(200), R(50), R(100), R(25), R(50)};
static const hg_real tail_in[IN] = {R(1), R(0.5)};
static const hg_real tail_out[OUT] = {R(0.25), R(0.125)};
static const hg_hull_config usual = {.residuals = OUT,
                                     .width = IN,
                                     .signal = signal_list,
                                     .taps = TAPS,
                                     .weight = weight_table,
                                     .settle = SETTLE,
                                     .rest = rest_table,
                                     .moving = moving_table,
                                     .ready_rest = 1U,
                                     .ready_moving = 4U,
                                     .decay = R(0.5),
                                     .tail_input = tail_in,
                                     .tail_output = tail_out};

/* Small multiples of 1/8: every sum is exact in float32 too. */
static int fill_weights(void **state)
{
    (void)state;
    for (size_t i = 0U; i < COUNT(weight_table); i++) {
        weight_table[i] = R((double)((i * 7U) % 11U) / 8.0);
    }
    return 0;
}

static void start_tells_null_and_bad_tables(void **state)
{
    (void)state;
    hg_hull self;
    hg_ring ring;
    hg_real memory[SIGNALS * LENGTH];
    assert_status(HG_OK, hg_ring_start(&ring, SIGNALS, LENGTH, memory));
    assert_status(HG_E_ARGUMENT, hg_hull_start(NULL, &usual, &ring, HG_START_REST));
    assert_status(HG_E_ARGUMENT, hg_hull_start(&self, NULL, &ring, HG_START_REST));
    assert_status(HG_E_ARGUMENT, hg_hull_start(&self, &usual, NULL, HG_START_REST));
    const uint8_t outside[IN] = {0U, SIGNALS};
    hg_hull_config c[17];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = usual;
    }
    c[0].residuals = 0U;
    c[1].width = 0U;
    c[2].taps = 0U;
    c[3].taps = LENGTH;
    c[4].settle = 0U;
    c[5].decay = R(-0.1);
    c[6].decay = R(1);
    c[7].signal = NULL;
    c[8].weight = NULL;
    c[9].rest = NULL;
    c[10].moving = NULL;
    c[11].tail_input = NULL;
    c[12].tail_output = NULL;
    c[13].signal = outside;
    c[14].decay = REAL_NAN;
    c[15].decay = REAL_INF;
    c[16].taps = 255U;
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_false(hg_hull_valid(&c[i], SIGNALS, LENGTH));
        assert_status(HG_E_CONFIG, hg_hull_start(&self, &c[i], &ring, HG_START_REST));
    }
    assert_true(hg_hull_valid(&usual, SIGNALS, LENGTH));
    c[0] = usual;
    c[0].decay = R(0);
    assert_true(hg_hull_valid(&c[0], SIGNALS, LENGTH));
}

/* The definition in the header, over the whole past and in double. */
static double threshold_by_definition(const hg_real (*past)[SIGNALS], uint32_t k, size_t i, hg_start how, uint32_t since)
{
    const uint32_t row = (since < SETTLE) ? since : (SETTLE - 1U);
    double sum = (double)((how == HG_START_REST) ? rest_table : moving_table)[(row * OUT) + i];
    for (uint32_t lag = 0U; (lag < TAPS) && (lag <= k); lag++) {
        for (size_t g = 0U; g < IN; g++) {
            sum += (double)weight_table[(((lag * OUT) + i) * IN) + g] * (double)past[k - lag][signal_list[g]];
        }
    }
    double theta = 0.0;
    double power = 1.0;
    for (uint32_t lag = TAPS; lag <= k; lag++) {
        theta += power * (((double)tail_in[0] * (double)past[k - lag][signal_list[0]]) +
                          ((double)tail_in[1] * (double)past[k - lag][signal_list[1]]));
        power *= (double)usual.decay;
    }
    return sum + ((double)tail_out[i] * theta);
}

static void thresholds_follow_the_definition_also_after_rewriting(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(41U);
    const hg_start starts[] = {HG_START_REST, HG_START_MOVING};
    for (size_t s = 0U; s < 2U; s++) {
        static hg_real past[400][SIGNALS];
        hg_hull self;
        hg_ring ring;
        hg_real memory[SIGNALS * LENGTH];
        assert_status(HG_OK, hg_ring_start(&ring, SIGNALS, LENGTH, memory));
        assert_status(HG_OK, hg_hull_start(&self, &usual, &ring, starts[s]));
        for (uint32_t k = 0U; k < 400U; k++) {
            hg_real J[OUT + 1U];
            arm(J, OUT + 1U);
            for (size_t g = 0U; g < SIGNALS; g++) {
                past[k][g] = R((double)draw_between(&random, 0, 16) / 4.0);
            }
            assert_status(HG_OK, hg_ring_push(&ring, past[k]));
            /* what a late-discovered loss does: the past grows, as far back as the taps reach */
            if ((draw(&random) % 3U) == 0U) {
                for (uint32_t lag = 1U; (lag < TAPS) && (lag <= k); lag++) {
                    past[k - lag][1] += R(1);
                    past[k - lag][2] += R(2);
                    hg_ring_rewrite(&ring, (uint8_t)lag, 1U, 2U, &past[k - lag][1]);
                }
            }
            hg_hull_step(&self, &ring, J);
            for (size_t i = 0U; i < OUT; i++) {
                const double expected = threshold_by_definition((const hg_real(*)[SIGNALS])past, k, i, starts[s], k);
                assert_near(expected, J[i], 1e-5 * expected);
            }
            assert_untouched(&J[OUT], 1U);
        }
    }
}

static void the_tail_bounds_an_endless_response_and_heals(void **state)
{
    (void)state;
    /* h_j = 0.75^j: two taps, the rest in the tail, which is exact for one signal */
    const uint8_t first = 0U;
    const hg_real weight[2] = {R(1), R(0.75)};
    const hg_real bias = R(0.0625);
    const hg_real in = R(1);
    const hg_real out = R(0.5625);
    const hg_hull_config c = {.residuals = 1U, .width = 1U, .signal = &first, .taps = 2U, .weight = weight, .settle = 1U, .rest = &bias,
                              .moving = &bias, .decay = R(0.75), .tail_input = &in, .tail_output = &out};
    hg_hull self;
    hg_ring ring;
    hg_real memory[3];
    hg_real J;
    double exact = 0.0;
    assert_status(HG_OK, hg_ring_start(&ring, 1U, 3U, memory));
    assert_status(HG_OK, hg_hull_start(&self, &c, &ring, HG_START_REST));
    for (int k = 0; k < 300; k++) {
        const hg_real radius = (k < 100) ? R(8) : R(0);
        assert_status(HG_OK, hg_ring_push(&ring, &radius));
        hg_hull_step(&self, &ring, &J);
        exact = (0.75 * exact) + (double)radius;
        assert_near(exact + 0.0625, J, 1e-4);
    }
    assert_near(0.0625, J, 1e-7); /* no stored maximum */
}

/* Radii that no design allows still must not leave the threshold infinite for ever: nothing would be detected any more. */
static void a_tail_that_overflows_heals(void **state)
{
    (void)state;
    const uint8_t first = 0U;
    const hg_real zero = R(0);
    const hg_real bias = R(1);
    const hg_real big = R(100);
    const hg_hull_config c = {.residuals = 1U, .width = 1U, .signal = &first, .taps = 1U, .weight = &zero, .settle = 1U, .rest = &bias,
                              .moving = &bias, .decay = R(0.5), .tail_input = &big, .tail_output = &zero};
    hg_hull self;
    hg_ring ring;
    hg_real memory[2];
    hg_real J;
    const hg_real most = HG_REAL_MAX;
    assert_status(HG_OK, hg_ring_start(&ring, 1U, 2U, memory));
    assert_status(HG_OK, hg_hull_start(&self, &c, &ring, HG_START_REST));
    for (int k = 0; k < 5000; k++) {
        assert_status(HG_OK, hg_ring_push(&ring, (k < 5) ? &most : &zero));
        hg_hull_step(&self, &ring, &J);
        assert_true(hg_real_finite(self.theta));
        assert_real(1.0, J);
    }
    assert_near(0.0, self.theta, 1e-30);
}

static void readiness_counts_samples_and_never_wraps(void **state)
{
    (void)state;
    hg_hull self;
    hg_ring ring;
    hg_real memory[SIGNALS * LENGTH];
    hg_real J[OUT];
    assert_status(HG_OK, hg_ring_start(&ring, SIGNALS, LENGTH, memory));
    assert_status(HG_OK, hg_hull_start(&self, &usual, &ring, HG_START_REST));
    assert_false(hg_hull_ready(&self));
    hg_hull_step(&self, &ring, J);
    assert_true(hg_hull_ready(&self));
    hg_hull_reset(&self, HG_START_MOVING);
    for (int k = 0; k < 70000; k++) {
        assert_int_equal(k >= 4, hg_hull_ready(&self));
        hg_hull_step(&self, &ring, J);
        assert_real(moving_table[((k < (int)SETTLE) ? (size_t)k : (SETTLE - 1U)) * OUT], J[0]);
    }
    assert_int_equal(65535, self.k);
}

static void reset_forgets_all(void **state)
{
    (void)state;
    hg_hull self;
    hg_ring ring;
    hg_real memory[SIGNALS * LENGTH];
    hg_real J[OUT];
    const hg_real wide[SIGNALS] = {R(9), R(9), R(9)};
    assert_status(HG_OK, hg_ring_start(&ring, SIGNALS, LENGTH, memory));
    assert_status(HG_OK, hg_hull_start(&self, &usual, &ring, HG_START_REST));
    for (int k = 0; k < 20; k++) {
        assert_status(HG_OK, hg_ring_push(&ring, wide));
        hg_hull_step(&self, &ring, J);
    }
    hg_ring_reset(&ring);
    hg_hull_reset(&self, HG_START_REST);
    hg_hull_step(&self, &ring, J);
    assert_real(1.0, J[0]);
    assert_real(2.0, J[1]);
}

static void hulls_share_a_ring_and_nothing_else(void **state)
{
    (void)state;
    hg_hull a;
    hg_hull b;
    hg_ring ring;
    hg_real memory[SIGNALS * LENGTH];
    hg_real J[OUT];
    hg_real K[OUT];
    const hg_real row[SIGNALS] = {R(1), R(1), R(1)};
    assert_status(HG_OK, hg_ring_start(&ring, SIGNALS, LENGTH, memory));
    assert_status(HG_OK, hg_hull_start(&a, &usual, &ring, HG_START_REST));
    assert_status(HG_OK, hg_hull_start(&b, &usual, &ring, HG_START_REST));
    for (int k = 0; k < 200; k++) {
        assert_status(HG_OK, hg_ring_push(&ring, row));
        hg_hull_step(&a, &ring, J);
        hg_hull_step(&b, &ring, K);
        assert_memory_equal(J, K, sizeof(J));
    }
    hg_hull_reset(&a, HG_START_MOVING);
    hg_hull_step(&b, &ring, K);
    assert_memory_equal(J, K, sizeof(J));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_tells_null_and_bad_tables),
        cmocka_unit_test(thresholds_follow_the_definition_also_after_rewriting),
        cmocka_unit_test(the_tail_bounds_an_endless_response_and_heals),
        cmocka_unit_test(a_tail_that_overflows_heals),
        cmocka_unit_test(readiness_counts_samples_and_never_wraps),
        cmocka_unit_test(reset_forgets_all),
        cmocka_unit_test(hulls_share_a_ring_and_nothing_else),
    };
    return cmocka_run_group_tests(tests, fill_weights, NULL);
}
