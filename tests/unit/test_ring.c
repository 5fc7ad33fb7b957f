/** @file
 *  ring.h: the recent past of a signal vector. */
#include "support.h"

#include "hullguard/ring.h"

#define SIGNALS 3U
#define LENGTH 5U

static void a_ring_refuses_null_and_empty(void **state)
{
    (void)state;
    hg_ring ring;
    hg_real memory[2] = {CANARY, CANARY};
    assert_status(HG_E_ARGUMENT, hg_ring_start(NULL, 1U, 1U, memory));
    assert_status(HG_E_ARGUMENT, hg_ring_start(&ring, 1U, 1U, NULL));
    assert_status(HG_E_ARGUMENT, hg_ring_start(&ring, 0U, 1U, memory));
    assert_status(HG_E_ARGUMENT, hg_ring_start(&ring, 1U, 0U, memory));
    assert_untouched(memory, 2U);
    assert_status(HG_OK, hg_ring_start(&ring, 1U, 1U, memory));
    assert_real(0.0, memory[0]);
    assert_untouched(&memory[1], 1U);
    const hg_real one = R(1);
    assert_status(HG_OK, hg_ring_push(&ring, &one));
    assert_status(HG_OK, hg_ring_push(&ring, &one));
    assert_real(1.0, memory[0]);
    assert_untouched(&memory[1], 1U);
}

/* Before the first row every sample is 0, in a ring of one row too. */
static void a_new_ring_begins_at_its_first_row(void **state)
{
    (void)state;
    for (uint8_t length = 1U; length <= LENGTH; length++) {
        hg_ring ring;
        hg_real memory[SIGNALS * LENGTH];
        assert_status(HG_OK, hg_ring_start(&ring, SIGNALS, length, memory));
        assert_true(hg_ring_row(&ring, 0U) == memory);
        const hg_real row[SIGNALS] = {R(1), R(2), R(3)};
        assert_status(HG_OK, hg_ring_push(&ring, row));
        hg_ring_reset(&ring);
        assert_true(hg_ring_row(&ring, 0U) == memory);
        assert_real(0.0, memory[SIGNALS - 1U]);
    }
}

static void the_largest_ring_wraps_within_its_memory(void **state)
{
    (void)state;
    static hg_real memory[(255U * 255U) + 1U];
    static hg_real row[255];
    hg_ring ring;
    memory[255U * 255U] = CANARY;
    assert_status(HG_OK, hg_ring_start(&ring, 255U, 255U, memory));
    for (uint32_t k = 0U; k < 600U; k++) {
        for (size_t g = 0U; g < 255U; g++) {
            row[g] = R(k);
        }
        assert_status(HG_OK, hg_ring_push(&ring, row));
    }
    assert_untouched(&memory[255U * 255U], 1U);
    double sum = 0.0;
    for (size_t i = 0U; i < (255U * 255U); i++) {
        sum += (double)memory[i];
    }
    assert_near(255.0 * 255.0 * (599.0 + 345.0) / 2.0, sum, 0.5);
}

static void a_number_that_is_not_finite_is_refused_at_every_place(void **state)
{
    (void)state;
    const hg_real bad[] = {REAL_NAN, REAL_INF, -REAL_INF};
    hg_ring ring;
    hg_real memory[SIGNALS * LENGTH];
    assert_status(HG_OK, hg_ring_start(&ring, SIGNALS, LENGTH, memory));
    const hg_real good[SIGNALS] = {R(1), R(2), R(3)};
    assert_status(HG_OK, hg_ring_push(&ring, good));
    hg_real before[SIGNALS * LENGTH];
    (void)memcpy(before, memory, sizeof(before));
    const uint8_t newest = ring.newest;
    for (size_t i = 0U; i < COUNT(bad); i++) {
        for (size_t g = 0U; g < SIGNALS; g++) {
            hg_real row[SIGNALS] = {R(0), R(-1), R(0)};
            row[g] = bad[i];
            assert_status(HG_E_NUMERIC, hg_ring_push(&ring, row));
            assert_memory_equal(before, memory, sizeof(before));
            assert_int_equal(newest, ring.newest);
        }
    }
}

static void rewriting_finds_the_right_sample_and_signals(void **state)
{
    (void)state;
    for (uint32_t pushes = 1U; pushes < 15U; pushes++) {
        for (uint32_t lag = 0U; lag < 10U; lag++) {
            hg_ring ring;
            hg_real memory[(SIGNALS * LENGTH) + 1U];
            hg_real before[(SIGNALS * LENGTH) + 1U];
            memory[SIGNALS * LENGTH] = CANARY;
            assert_status(HG_OK, hg_ring_start(&ring, SIGNALS, LENGTH, memory));
            for (uint32_t k = 0U; k < pushes; k++) {
                const hg_real row[SIGNALS] = {R(k + 1U), R((k + 1U) * 100U), R((k + 1U) * 10000U)};
                assert_status(HG_OK, hg_ring_push(&ring, row));
            }
            (void)memcpy(before, memory, sizeof(before));
            const hg_real wide[2] = {R(7e6), R(8e6)};
            hg_ring_rewrite(&ring, (uint8_t)lag, 1U, 2U, wide);
            unsigned changed = 0U;
            for (size_t i = 0U; i <= (SIGNALS * LENGTH); i++) {
                if (!same_real(before[i], memory[i])) {
                    changed++;
                    const double column = ((i % SIGNALS) == 1U) ? 100.0 : 10000.0;
                    const double expected = (lag < pushes) ? ((double)(pushes - lag) * column) : 0.0;
                    assert_near(expected, before[i], 0.0);
                    assert_real(((i % SIGNALS) == 1U) ? R(7e6) : R(8e6), memory[i]);
                }
            }
            assert_int_equal((lag < LENGTH) ? 2 : 0, changed);
        }
    }
}

static void extreme_and_negative_numbers_are_taken(void **state)
{
    (void)state;
    const hg_real row[SIGNALS] = {HG_REAL_MAX, -HG_REAL_MAX, R(-1e-30)};
    hg_ring ring;
    hg_real memory[SIGNALS * LENGTH];
    assert_status(HG_OK, hg_ring_start(&ring, SIGNALS, LENGTH, memory));
    assert_status(HG_OK, hg_ring_push(&ring, row));
    assert_memory_equal(row, hg_ring_row(&ring, 0U), sizeof(row));
}

static void every_lag_is_found_while_the_ring_wraps(void **state)
{
    (void)state;
    for (uint32_t length = 1U; length <= 255U; length += 127U) {
        static hg_real memory[256];
        hg_ring ring;
        arm(memory, COUNT(memory));
        assert_status(HG_OK, hg_ring_start(&ring, 1U, (uint8_t)length, memory));
        for (uint32_t k = 1U; k < 600U; k++) {
            const hg_real now = R(k);
            assert_status(HG_OK, hg_ring_push(&ring, &now));
            for (uint32_t lag = 0U; lag < length; lag++) {
                assert_real((lag < k) ? (double)(k - lag) : 0.0, *hg_ring_row(&ring, (uint8_t)lag));
            }
        }
        assert_untouched(&memory[length], COUNT(memory) - length);
    }
}

static void reset_forgets_all(void **state)
{
    (void)state;
    const hg_real row[SIGNALS] = {R(1), R(2), R(3)};
    hg_ring ring;
    hg_real memory[(SIGNALS * LENGTH) + 1U];
    arm(memory, COUNT(memory));
    assert_status(HG_OK, hg_ring_start(&ring, SIGNALS, LENGTH, memory));
    for (int k = 0; k < 7; k++) {
        assert_status(HG_OK, hg_ring_push(&ring, row));
    }
    hg_ring_reset(&ring);
    for (size_t i = 0U; i < (SIGNALS * LENGTH); i++) {
        assert_real(0.0, memory[i]);
    }
    assert_untouched(&memory[SIGNALS * LENGTH], 1U);
    assert_status(HG_OK, hg_ring_push(&ring, row));
    assert_memory_equal(row, hg_ring_row(&ring, 0U), sizeof(row));
    assert_real(0.0, hg_ring_row(&ring, 1U)[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_ring_refuses_null_and_empty),
        cmocka_unit_test(a_new_ring_begins_at_its_first_row),
        cmocka_unit_test(the_largest_ring_wraps_within_its_memory),
        cmocka_unit_test(a_number_that_is_not_finite_is_refused_at_every_place),
        cmocka_unit_test(rewriting_finds_the_right_sample_and_signals),
        cmocka_unit_test(extreme_and_negative_numbers_are_taken),
        cmocka_unit_test(every_lag_is_found_while_the_ring_wraps),
        cmocka_unit_test(reset_forgets_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
