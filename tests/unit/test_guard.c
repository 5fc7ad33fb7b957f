/** @file
 *  guard.h: memory that nobody may change. */
#include "support.h"

#include "hullguard/guard.h"

#define BYTES 67U /* words, and a rest */
#define BITS (8U * BYTES)
#define BURST 31U

static uint8_t  memory[BYTES + 1U];
static uint32_t seed;

static void fill(uint8_t *at)
{
    seed = seed_of_run(7U);
    for (uint32_t i = 0U; i < BYTES; i++) {
        at[i] = (uint8_t)(draw(&seed) & 0xFFU);
    }
}

static void flip(uint8_t *at, uint32_t bit)
{
    at[bit / 8U] ^= (uint8_t)(1U << (bit % 8U));
}

static void what_is_not_there_is_refused(void **state)
{
    (void)state;
    hg_guard guard = {.sum = 5U};
    assert_status(HG_E_ARGUMENT, hg_guard_seal(NULL, memory, BYTES));
    assert_status(HG_E_ARGUMENT, hg_guard_seal(&guard, NULL, BYTES));
    assert_status(HG_E_ARGUMENT, hg_guard_seal(&guard, memory, 0U));
    assert_status(HG_E_ARGUMENT, hg_guard_check(NULL, memory, BYTES));
    assert_status(HG_E_ARGUMENT, hg_guard_check(&guard, NULL, BYTES));
    assert_status(HG_E_ARGUMENT, hg_guard_check(&guard, memory, 0U));
    assert_int_equal(5, guard.sum);
}

static void memory_as_it_was_sealed_is_good(void **state)
{
    (void)state;
    for (uint32_t offset = 0U; offset <= 1U; offset++) {
        uint8_t *const at = &memory[offset];
        fill(at);
        for (uint32_t bytes = 1U; bytes <= BYTES; bytes++) {
            hg_guard guard = {0};
            uint8_t before[sizeof(memory)];
            (void)memcpy(before, memory, sizeof(memory));
            assert_status(HG_OK, hg_guard_seal(&guard, at, bytes));
            assert_status(HG_OK, hg_guard_check(&guard, at, bytes));
            assert_memory_equal(before, memory, sizeof(memory));
        }
    }
}

/* The definition, bit by bit: another processor, or a checksum unit in hardware, may make the same seal. */
static uint32_t defined(const uint8_t *at, uint32_t bytes)
{
    uint32_t sum = 0x9E3779B9U ^ bytes;
    for (uint32_t word = 0U; word <= (bytes / 4U); word++) {
        const uint32_t lowest = sum % 2U;
        sum = (sum / 2U) + (lowest * 0x80000000U);
        for (uint32_t i = 4U * word; (i < bytes) && (i < ((4U * word) + 4U)); i++) {
            for (uint32_t bit = 0U; bit < 8U; bit++) {
                if (((at[i] >> bit) & 1U) != 0U) {
                    sum ^= (uint32_t)1U << ((8U * (i % 4U)) + bit);
                }
            }
        }
    }
    return sum;
}

static void the_seal_is_the_defined_sum(void **state)
{
    (void)state;
    fill(memory);
    for (uint32_t bytes = 1U; bytes <= BYTES; bytes++) {
        hg_guard guard = {0};
        assert_status(HG_OK, hg_guard_seal(&guard, memory, bytes));
        assert_int_equal(defined(memory, bytes), guard.sum);
    }
}

static void every_bit_of_memory_and_seal_counts(void **state)
{
    (void)state;
    fill(memory);
    for (uint32_t bytes = 1U; bytes <= BYTES; bytes++) {
        hg_guard guard = {0};
        assert_status(HG_OK, hg_guard_seal(&guard, memory, bytes));
        for (uint32_t bit = 0U; bit < (8U * bytes); bit++) {
            flip(memory, bit);
            assert_status(HG_E_DIGEST, hg_guard_check(&guard, memory, bytes));
            flip(memory, bit);
        }
        for (uint32_t bit = 0U; bit < 32U; bit++) {
            guard.sum ^= (uint32_t)1U << bit;
            assert_status(HG_E_DIGEST, hg_guard_check(&guard, memory, bytes));
            guard.sum ^= (uint32_t)1U << bit;
        }
        assert_status(HG_OK, hg_guard_check(&guard, memory, bytes));
    }
}

/* Any pattern within 31 bits in a row, begun and ended by a wrong bit; the words are those of the library, lowest byte first. */
static void a_burst_is_found_wherever_it_begins(void **state)
{
    (void)state;
    hg_guard guard = {0};
    fill(memory);
    assert_status(HG_OK, hg_guard_seal(&guard, memory, BYTES));
    for (uint32_t first = 0U; first < BITS; first++) {
        for (uint32_t length = 2U; (length <= BURST) && ((first + length) <= BITS); length++) {
            uint8_t kept[sizeof(memory)];
            (void)memcpy(kept, memory, sizeof(memory));
            flip(memory, first);
            flip(memory, first + length - 1U);
            assert_status(HG_E_DIGEST, hg_guard_check(&guard, memory, BYTES));
            for (uint32_t bit = first + 1U; bit < (first + length - 1U); bit++) {
                if ((draw(&seed) & 0x100U) != 0U) {
                    flip(memory, bit);
                }
            }
            assert_status(HG_E_DIGEST, hg_guard_check(&guard, memory, BYTES));
            (void)memcpy(memory, kept, sizeof(memory));
        }
    }
}

static void of_two_bits_in_two_words_one_pair_in_32_is_missed(void **state)
{
    (void)state;
    hg_guard guard = {0};
    uint32_t missed = 0U;
    fill(memory);
    assert_status(HG_OK, hg_guard_seal(&guard, memory, 64U));
    for (uint32_t a = 0U; a < 32U; a++) {
        for (uint32_t b = 32U; b < 512U; b++) {
            flip(memory, a);
            flip(memory, b);
            missed += (hg_guard_check(&guard, memory, 64U) == HG_OK) ? 1U : 0U;
            flip(memory, a);
            flip(memory, b);
        }
    }
    assert_int_equal((32U * 480U) / 32U, missed);
}

/* A loader that clears RAM, or one that never ran: no seal fits by itself. */
static void what_was_never_sealed_does_not_fit(void **state)
{
    (void)state;
    for (uint32_t bytes = 1U; bytes <= BYTES; bytes++) {
        const hg_guard guard = {.sum = 0U};
        (void)memset(memory, 0, sizeof(memory));
        assert_status(HG_E_DIGEST, hg_guard_check(&guard, memory, bytes));
    }
}

static void another_length_does_not_fit(void **state)
{
    (void)state;
    hg_guard guard = {0};
    (void)memset(memory, 0, sizeof(memory));
    assert_status(HG_OK, hg_guard_seal(&guard, memory, 32U));
    assert_status(HG_E_DIGEST, hg_guard_check(&guard, memory, 31U));
    assert_status(HG_E_DIGEST, hg_guard_check(&guard, memory, 36U));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_not_there_is_refused),
        cmocka_unit_test(memory_as_it_was_sealed_is_good),
        cmocka_unit_test(the_seal_is_the_defined_sum),
        cmocka_unit_test(every_bit_of_memory_and_seal_counts),
        cmocka_unit_test(a_burst_is_found_wherever_it_begins),
        cmocka_unit_test(of_two_bits_in_two_words_one_pair_in_32_is_missed),
        cmocka_unit_test(what_was_never_sealed_does_not_fit),
        cmocka_unit_test(another_length_does_not_fit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
