/** @file
 *  e2e.h: profile 22. Known answers come from the CRC catalogue and from an independent implementation of profile 02. */
#include "support.h"

#include "hullguard/e2e.h"

static const uint8_t all_zero[HG_E2E_IDS] = {0U};
static const uint8_t all_same[HG_E2E_IDS] = {0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U,
                                             0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U};
static const uint8_t counting[HG_E2E_IDS] = {0U, 1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 9U, 10U, 11U, 12U, 13U, 14U, 15U};
static const uint8_t from_one[HG_E2E_IDS] = {1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 9U, 10U, 11U, 12U, 13U, 14U, 15U, 16U};

/* Polynomial division bit by bit, sharing nothing with the code under test. */
static uint8_t crc_by_bits(const uint8_t *data, size_t n)
{
    unsigned crc = 0xFFU;
    for (size_t i = 0U; i < n; i++) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = ((crc & 0x80U) != 0U) ? (((crc << 1U) ^ 0x2FU) & 0xFFU) : ((crc << 1U) & 0xFFU);
        }
    }
    return (uint8_t)(crc ^ 0xFFU);
}

static void the_catalogue_check_value_comes_out(void **state)
{
    (void)state;
    /* "123456789": byte 0 of a frame is skipped, the data identifier is the last byte; '1' (0x31) selects counter 1. */
    const uint8_t frame[] = {0xEEU, '1', '2', '3', '4', '5', '6', '7', '8'};
    uint8_t ids[HG_E2E_IDS] = {0U};
    ids['1' & 0x0F] = '9';
    assert_int_equal(0xDF, hg_e2e_p22_crc(frame, (uint8_t)sizeof(frame), ids));
    assert_int_equal(0xDF, crc_by_bits((const uint8_t *)"123456789", 9U));
}

static void published_frames_come_out(void **state)
{
    (void)state;
    uint8_t a[8] = {0U};
    assert_status(HG_OK, hg_e2e_p22_protect(a, 8U, all_zero, 1U, 0U));
    const uint8_t expected_a[8] = {0x45U, 0x01U};
    assert_memory_equal(expected_a, a, 8U);
    uint8_t b[8] = {0U, 1U, 2U, 3U, 4U, 5U, 6U, 7U};
    assert_status(HG_OK, hg_e2e_p22_protect(b, 8U, counting, 2U, 0U));
    const uint8_t expected_b[8] = {0xBCU, 0x02U, 0x02U, 0x03U, 0x04U, 0x05U, 0x06U, 0x07U};
    assert_memory_equal(expected_b, b, 8U);
    uint8_t c[8] = {0U};
    assert_status(HG_OK, hg_e2e_p22_protect(c, 8U, from_one, 1U, 0U));
    const uint8_t expected_c[8] = {0x1BU, 0x01U};
    assert_memory_equal(expected_c, c, 8U);
}

static void the_checksum_agrees_with_bitwise_division(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(7U);
    for (int i = 0; i < 20000; i++) {
        uint8_t data[HG_E2E_P22_LENGTH];
        uint8_t line[HG_E2E_P22_LENGTH];
        uint8_t ids[HG_E2E_IDS];
        const uint8_t length = (uint8_t)draw_between(&random, 2, 64);
        for (size_t j = 0U; j < sizeof(data); j++) {
            data[j] = (uint8_t)draw(&random);
        }
        for (size_t j = 0U; j < sizeof(ids); j++) {
            ids[j] = (uint8_t)draw(&random);
        }
        (void)memcpy(line, &data[1], (size_t)length - 1U);
        line[length - 1] = ids[data[1] & 0x0FU];
        assert_int_equal(crc_by_bits(line, length), hg_e2e_p22_crc(data, length, ids));
    }
}

static void protect_writes_two_bytes_and_no_more(void **state)
{
    (void)state;
    for (uint8_t length = 2U; length <= 64U; length++) {
        uint8_t data[66];
        (void)memset(data, 0x5A, sizeof(data));
        assert_status(HG_OK, hg_e2e_p22_protect(data, length, counting, 0x1DU, 0x2BU));
        assert_int_equal(0xBD, data[1]); /* both modulo 16 */
        for (size_t i = 2U; i < sizeof(data); i++) {
            assert_int_equal(0x5A, data[i]);
        }
    }
}

static void a_length_out_of_range_is_refused_and_nothing_written(void **state)
{
    (void)state;
    const uint8_t lengths[] = {0U, 1U, 65U, 128U, 255U};
    for (size_t i = 0U; i < COUNT(lengths); i++) {
        uint8_t data[256];
        uint8_t before[256];
        (void)memset(data, 0x5A, sizeof(data));
        (void)memcpy(before, data, sizeof(data));
        assert_status(HG_E_FORMAT, hg_e2e_p22_protect(data, lengths[i], counting, 1U, 1U));
        assert_memory_equal(before, data, sizeof(data));
        hg_e2e_receiver self = {.counter = 3U, .seen = true};
        hg_e2e_header header = {.stamp = 0x5AU, .lost = 0x5AU};
        assert_status(HG_E_FORMAT, hg_e2e_p22_receive(&self, data, lengths[i], counting, &header));
        assert_int_equal(3, self.counter);
        assert_true(self.seen);
        assert_int_equal(0x5A, header.stamp);
        assert_int_equal(0x5A, header.lost);
    }
}

static hg_status receive(hg_e2e_receiver *self, uint8_t counter, uint8_t stamp, hg_e2e_header *header)
{
    uint8_t data[5] = {0U, 0U, counter, 7U, 9U};
    assert_status(HG_OK, hg_e2e_p22_protect(data, 5U, counting, counter, stamp));
    return hg_e2e_p22_receive(self, data, 5U, counting, header);
}

static void every_step_of_the_counter_is_told(void **state)
{
    (void)state;
    for (uint8_t first = 0U; first < 16U; first++) {
        for (uint8_t moved = 1U; moved < 16U; moved++) {
            hg_e2e_receiver self;
            hg_e2e_header header = {.stamp = 0x5AU, .lost = 0x5AU};
            hg_e2e_receiver_start(&self);
            assert_false(self.seen);
            assert_status(HG_OK, receive(&self, first, moved, &header));
            assert_int_equal(0, header.lost);
            assert_int_equal(moved, header.stamp);
            assert_status(HG_OK, receive(&self, (uint8_t)(first + moved), 15U, &header));
            assert_int_equal(moved - 1, header.lost);
            assert_int_equal(15, header.stamp);
        }
    }
}

static void another_frame_with_the_same_counter_is_no_repetition(void **state)
{
    (void)state;
    for (uint8_t counter = 0U; counter < 16U; counter++) {
        hg_e2e_receiver self;
        hg_e2e_header header;
        hg_e2e_receiver_start(&self);
        assert_status(HG_OK, receive(&self, counter, 1U, &header));
        assert_status(HG_OK, receive(&self, counter, 2U, &header)); /* 15 were lost, or the sender began anew */
        assert_int_equal(HG_E2E_LOST, header.lost);
        assert_int_equal(2, header.stamp);
        assert_int_equal(counter, header.counter);
        assert_status(HG_E_REPEATED, receive(&self, counter, 2U, &header));
    }
}

static void a_repeated_counter_changes_nothing(void **state)
{
    (void)state;
    for (uint8_t counter = 0U; counter < 16U; counter++) {
        hg_e2e_receiver self;
        hg_e2e_header header;
        hg_e2e_receiver_start(&self);
        assert_status(HG_OK, receive(&self, counter, 1U, &header));
        header = (hg_e2e_header){.stamp = 0x5AU, .lost = 0x5AU};
        assert_status(HG_E_REPEATED, receive(&self, counter, 1U, &header));
        assert_int_equal(0x5A, header.stamp);
        assert_int_equal(0x5A, header.lost);
        assert_int_equal(counter, self.counter);
        assert_status(HG_OK, receive(&self, (uint8_t)(counter + 1U), 3U, &header));
        assert_int_equal(0, header.lost);
    }
}

static void the_counter_runs_round_without_a_loss(void **state)
{
    (void)state;
    hg_e2e_receiver self;
    hg_e2e_header header;
    hg_e2e_receiver_start(&self);
    for (uint32_t i = 0U; i < 1000U; i++) {
        assert_status(HG_OK, receive(&self, (uint8_t)i, (uint8_t)(i * 3U), &header));
        assert_int_equal(0, header.lost);
        assert_int_equal((i * 3U) % 16U, header.stamp);
    }
}

static void two_receivers_do_not_know_of_each_other(void **state)
{
    (void)state;
    hg_e2e_receiver a;
    hg_e2e_receiver b;
    hg_e2e_header header;
    hg_e2e_receiver_start(&a);
    hg_e2e_receiver_start(&b);
    assert_status(HG_OK, receive(&a, 4U, 0U, &header));
    assert_status(HG_OK, receive(&b, 4U, 0U, &header));
    assert_status(HG_OK, receive(&b, 9U, 0U, &header));
    assert_int_equal(4, header.lost);
    assert_status(HG_OK, receive(&a, 5U, 0U, &header));
    assert_int_equal(0, header.lost);
}

static void every_wrong_checksum_is_damage_and_changes_nothing(void **state)
{
    (void)state;
    uint8_t data[8] = {0U, 0U, 1U, 2U, 3U, 4U, 5U, 6U};
    assert_status(HG_OK, hg_e2e_p22_protect(data, 8U, counting, 5U, 9U));
    const uint8_t right = data[0];
    for (uint32_t wrong = 0U; wrong < 256U; wrong++) {
        hg_e2e_receiver self;
        hg_e2e_header header = {.stamp = 0x5AU, .lost = 0x5AU};
        hg_e2e_receiver_start(&self);
        data[0] = (uint8_t)wrong;
        const hg_status status = hg_e2e_p22_receive(&self, data, 8U, counting, &header);
        assert_status((data[0] == right) ? HG_OK : HG_E_CRC, status);
        if (status != HG_OK) {
            assert_false(self.seen);
            assert_int_equal(0x5A, header.stamp);
        }
    }
}

/* Receive a frame with some bits turned over by a receiver that would take any counter; true when it is taken for good. */
static bool passes(const uint8_t *frame, const uint8_t *ids, const unsigned *bits, size_t n)
{
    uint8_t bad[8];
    hg_e2e_receiver self;
    hg_e2e_header header;
    (void)memcpy(bad, frame, 8U);
    for (size_t i = 0U; i < n; i++) {
        bad[bits[i] / 8U] ^= (uint8_t)(1U << (bits[i] % 8U));
    }
    hg_e2e_receiver_start(&self);
    return hg_e2e_p22_receive(&self, bad, 8U, ids, &header) == HG_OK;
}

/* All errors of one, two and three bits in an 8-byte frame; how many there are and how many pass. */
static void count_passing(const uint8_t *ids, uint8_t counter, unsigned tried[3], unsigned passed[3])
{
    uint8_t frame[8] = {0U, 0U, 0x12U, 0x34U, 0x56U, 0x78U, 0x9AU, 0xBCU};
    unsigned bits[3];
    assert_status(HG_OK, hg_e2e_p22_protect(frame, 8U, ids, counter, 11U));
    assert_true(passes(frame, ids, bits, 0U));
    for (bits[0] = 0U; bits[0] < 64U; bits[0]++) {
        tried[0]++;
        passed[0] += passes(frame, ids, bits, 1U) ? 1U : 0U;
        for (bits[1] = 0U; bits[1] < bits[0]; bits[1]++) {
            tried[1]++;
            passed[1] += passes(frame, ids, bits, 2U) ? 1U : 0U;
            for (bits[2] = 0U; bits[2] < bits[1]; bits[2]++) {
                tried[2]++;
                passed[2] += passes(frame, ids, bits, 3U) ? 1U : 0U;
            }
        }
    }
}

static void a_constant_identifier_list_lets_no_error_of_three_bits_pass(void **state)
{
    (void)state;
    unsigned tried[3] = {0U, 0U, 0U};
    unsigned passed[3] = {0U, 0U, 0U};
    for (uint8_t counter = 0U; counter < 16U; counter++) {
        count_passing(all_same, counter, tried, passed);
    }
    assert_int_equal(16 * 64, tried[0]);
    assert_int_equal(16 * 2016, tried[1]);
    assert_int_equal(16 * 41664, tried[2]);
    assert_int_equal(0, passed[0]);
    assert_int_equal(0, passed[1]);
    assert_int_equal(0, passed[2]);
}

/* The identifier then changes with the counter bits, so some triples cancel: the reason why the design chooses the list. */
static void the_list_0_to_15_lets_some_errors_of_three_bits_pass(void **state)
{
    (void)state;
    unsigned tried[3] = {0U, 0U, 0U};
    unsigned passed[3] = {0U, 0U, 0U};
    count_passing(counting, 0U, tried, passed);
    assert_int_equal(41664, tried[2]);
    assert_int_equal(0, passed[0]);
    assert_int_equal(0, passed[1]);
    assert_int_equal(48, passed[2]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_catalogue_check_value_comes_out),
        cmocka_unit_test(published_frames_come_out),
        cmocka_unit_test(the_checksum_agrees_with_bitwise_division),
        cmocka_unit_test(protect_writes_two_bytes_and_no_more),
        cmocka_unit_test(a_length_out_of_range_is_refused_and_nothing_written),
        cmocka_unit_test(every_step_of_the_counter_is_told),
        cmocka_unit_test(another_frame_with_the_same_counter_is_no_repetition),
        cmocka_unit_test(a_repeated_counter_changes_nothing),
        cmocka_unit_test(the_counter_runs_round_without_a_loss),
        cmocka_unit_test(two_receivers_do_not_know_of_each_other),
        cmocka_unit_test(every_wrong_checksum_is_damage_and_changes_nothing),
        cmocka_unit_test(a_constant_identifier_list_lets_no_error_of_three_bits_pass),
        cmocka_unit_test(the_list_0_to_15_lets_some_errors_of_three_bits_pass),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
