/** @file
 *  e2e.h: what the checks see. Every error of one, two and three bits in frames of 8 bytes, and how long a frame may grow.
 *
 *  A checksum is linear in the bits that are turned over, so what passes depends neither on the frame's data nor on the data identifier. Two
 *  things break that. A list of data identifiers, and the data identifier of mode alternate, change with the counter, whose bits an error may
 *  hit: P02, P22 and alternate depend on the list, or on the two bytes of the identifier. And P01 and P11 refuse the counter 15, so that what
 *  passes depends on the counter from which 15 can be reached. In mode nibble an error in that nibble is seen by itself.
 *
 *  CRC-8 of P01 and P11 is primitive (period 255): no error of two bits passes in up to 31 bytes, some of three do.
 *  CRC-8H2F of P02 and P22 has the factor x + 1 (period 127): with all data identifiers equal no odd number of wrong bits ever passes; of two,
 *  none in up to 14 bytes. The data identifier stands between data and checksum, which costs the byte that one would expect more.
 *  CRC-16 of P05 has the factor x + 1 and the period 32767: nothing passes up to three bits. */
#include "support.h"

#include "hullguard/e2e.h"

#define DEEPEST 3U
#define COUNTERS 16U
#define EIGHT 8U

static const uint8_t all_same[HG_E2E_IDS] = {0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U,
                                             0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U, 0xA5U};
static const uint8_t from_zero[HG_E2E_IDS] = {0U, 1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 9U, 10U, 11U, 12U, 13U, 14U, 15U};
static const uint8_t from_one[HG_E2E_IDS] = {1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 9U, 10U, 11U, 12U, 13U, 14U, 15U, 16U};
/* High bytes of x <- 1664525 x + 1013904223 from 1 on. */
static const uint8_t pseudo_random[2][HG_E2E_IDS] = {{0x3CU, 0x5EU, 0x81U, 0xB4U, 0x0CU, 0x5EU, 0xC6U, 0x8EU,
                                                      0x04U, 0xA3U, 0x40U, 0x6CU, 0x97U, 0xD6U, 0x3CU, 0xFBU},
                                                     {0xDCU, 0x53U, 0xAEU, 0x88U, 0x37U, 0x1AU, 0x12U, 0x51U,
                                                      0x21U, 0xB5U, 0x95U, 0x61U, 0x43U, 0xC0U, 0xEEU, 0x2DU}};

/* The places of the project's own frames; the sample index is data like any other. */
static hg_e2e_config j1850(hg_e2e_profile profile, hg_e2e_id_mode mode, uint16_t data_id)
{
    return (hg_e2e_config){.profile = profile, .mode = mode, .data_id = data_id, .crc = 0U, .counter = 8U, .nibble = 12U, .stamp = HG_E2E_NO_STAMP,
                           .limits = &hg_e2e_limits_default};
}

static hg_e2e_config h2f(hg_e2e_profile profile, const uint8_t *data_ids)
{
    return (hg_e2e_config){.profile = profile, .data_ids = data_ids, .crc = 0U, .counter = 8U, .stamp = HG_E2E_NO_STAMP,
                           .limits = &hg_e2e_limits_default};
}

static hg_e2e_config p05(uint16_t data_id)
{
    return (hg_e2e_config){.profile = HG_E2E_P05, .data_id = data_id, .crc = 0U, .counter = 16U, .stamp = HG_E2E_NO_STAMP,
                           .limits = &hg_e2e_limits_default};
}

/* Patterns of 1 .. DEEPEST wrong bits: how many there are, and how many pass. */
typedef struct {
    unsigned tried[DEEPEST];
    unsigned passed[DEEPEST];
} tally;

static void turn(uint8_t *data, unsigned bit)
{
    data[bit / 8U] ^= (uint8_t)(1U << (bit % 8U));
}

static void try_one(const hg_e2e_config *config, const uint8_t *data, uint8_t length, unsigned wrong, tally *count)
{
    hg_e2e_header header;
    count->tried[wrong - 1U]++;
    count->passed[wrong - 1U] += (hg_e2e_check(config, data, length, &header) == HG_OK) ? 1U : 0U;
}

/* All errors of 1 .. deepest bits in a frame of random data. */
static tally all_errors(const hg_e2e_config *config, uint8_t length, uint8_t counter, unsigned deepest, uint32_t *random)
{
    tally count = {{0U}, {0U}};
    uint8_t data[HG_E2E_LENGTH_MAX] = {0U};
    hg_e2e_header header;
    for (uint8_t i = 0U; i < length; i++) {
        data[i] = (uint8_t)draw(random);
    }
    assert_true(hg_e2e_valid(config, length));
    assert_status(HG_OK, hg_e2e_protect(config, data, length, counter, 0U));
    assert_status(HG_OK, hg_e2e_check(config, data, length, &header));
    assert_count(counter, header.counter);
    for (unsigned a = 0U; a < (8U * (unsigned)length); a++) {
        turn(data, a);
        try_one(config, data, length, 1U, &count);
        for (unsigned b = 0U; (deepest >= 2U) && (b < a); b++) {
            turn(data, b);
            try_one(config, data, length, 2U, &count);
            for (unsigned c = 0U; (deepest >= 3U) && (c < b); c++) {
                turn(data, c);
                try_one(config, data, length, 3U, &count);
                turn(data, c);
            }
            turn(data, b);
        }
        turn(data, a);
    }
    return count;
}

/* Frames of 8 bytes: `two` and `three` hold the patterns that pass for every counter; none of one bit may. */
static void expect(const hg_e2e_config *config, const unsigned *one, const unsigned *two, const unsigned *three, uint32_t *random)
{
    static const unsigned none[COUNTERS] = {0U};
    for (uint16_t counter = 0U; counter < hg_e2e_modulus(config); counter++) {
        const tally found = all_errors(config, EIGHT, (uint8_t)counter, DEEPEST, random);
        assert_count(64, found.tried[0]);
        assert_count(2016, found.tried[1]);
        assert_count(41664, found.tried[2]);
        const unsigned at = counter % COUNTERS;
        assert_count((one != NULL) ? one[at] : none[at], found.passed[0]);
        assert_count((two != NULL) ? two[at] : none[at], found.passed[1]);
        assert_count((three != NULL) ? three[at] : none[at], found.passed[2]);
    }
}

/* 198 triples cancel. Those that turn a counter into 15 are refused: 1 from 6 (which lacks two bits), 7 or 8 from 7, 11, 13 and 14 (which lack one). */
static const unsigned whole_identifier[COUNTERS] = {198U, 198U, 198U, 198U, 198U, 198U, 197U, 191U, 198U, 198U, 198U, 190U, 198U, 190U, 191U};

static void both_and_low_let_198_errors_of_three_bits_pass_whatever_the_identifier(void **state)
{
    (void)state;
    static const uint16_t data_ids[] = {0U, 0x0123U, 0x0A5CU, 0xFFFFU};
    uint32_t random = seed_of_run(11U);
    for (size_t i = 0U; i < COUNT(data_ids); i++) {
        const hg_e2e_config both = j1850(HG_E2E_P01, HG_E2E_BOTH, data_ids[i]);
        const hg_e2e_config low = j1850(HG_E2E_P01, HG_E2E_LOW, data_ids[i]);
        expect(&both, NULL, NULL, whole_identifier, &random);
        expect(&low, NULL, NULL, whole_identifier, &random);
    }
    const hg_e2e_config drawn = j1850(HG_E2E_P11, HG_E2E_BOTH, (uint16_t)draw(&random));
    expect(&drawn, NULL, NULL, whole_identifier, &random);
}

/* 29 of the 198 need a bit of the nibble, whose damage is seen without the checksum. */
static void nibble_lets_169_errors_of_three_bits_pass_whatever_the_identifier(void **state)
{
    (void)state;
    static const unsigned three[COUNTERS] = {169U, 169U, 169U, 169U, 169U, 169U, 168U, 163U, 169U, 169U, 169U, 162U, 169U, 162U, 162U};
    static const uint16_t data_ids[] = {0U, 0x0123U, 0x0A5CU, 0x0FFFU};
    uint32_t random = seed_of_run(12U);
    for (size_t i = 0U; i < COUNT(data_ids); i++) {
        const hg_e2e_config p11 = j1850(HG_E2E_P11, HG_E2E_NIBBLE, data_ids[i]);
        expect(&p11, NULL, NULL, three, &random);
    }
    const hg_e2e_config drawn = j1850(HG_E2E_P01, HG_E2E_NIBBLE, (uint16_t)draw(&random));
    expect(&drawn, NULL, NULL, three, &random);
}

/* Turning bit 0 of the counter exchanges the identifier's bytes: their difference decides, and equal bytes make it linear again. */
static void alternate_depends_on_the_difference_of_the_identifiers_bytes(void **state)
{
    (void)state;
    static const unsigned three_0123[COUNTERS] = {199U, 199U, 199U, 199U, 199U, 199U, 199U, 192U, 199U, 199U, 199U, 191U, 199U, 191U, 190U};
    uint32_t random = seed_of_run(13U);
    const uint8_t byte = (uint8_t)draw(&random);
    const hg_e2e_config equal = j1850(HG_E2E_P01, HG_E2E_ALTERNATE, (uint16_t)(byte * 0x0101U));
    const hg_e2e_config same = j1850(HG_E2E_P01, HG_E2E_ALTERNATE, 0x0123U);
    const hg_e2e_config also = j1850(HG_E2E_P01, HG_E2E_ALTERNATE, (uint16_t)(0x0123U ^ (byte * 0x0101U)));
    expect(&equal, NULL, NULL, whole_identifier, &random);
    expect(&same, NULL, NULL, three_0123, &random);
    expect(&also, NULL, NULL, three_0123, &random);
}

static void alternate_has_identifiers_that_let_errors_of_one_or_two_bits_pass(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(14U);
    unsigned with_two = 0U;
    unsigned most = 0U;
    for (unsigned difference = 0U; difference < 256U; difference++) {
        const unsigned low = draw(&random) & 0xFFU;
        const hg_e2e_config config = j1850(HG_E2E_P01, HG_E2E_ALTERNATE, (uint16_t)(((low ^ difference) << 8U) | low));
        const tally found = all_errors(&config, EIGHT, 0U, DEEPEST, &random);
        assert_count((difference == 0x83U) ? 1 : 0, found.passed[0]); /* the change of the checksum by bit 0 of the counter is that of the byte */
        assert_in_range(found.passed[1], 0, 1);
        with_two += found.passed[1];
        most = (found.passed[2] > most) ? found.passed[2] : most;
    }
    assert_count(63, with_two); /* one for each other bit of the frame whose change can be made up for */
    assert_count(202, most);
}

/* A profile with a list of data identifiers, and how many errors of one, two and three bits it lets pass, for every counter. */
typedef struct {
    hg_e2e_profile profile;
    const uint8_t *list;
    unsigned       passing[DEEPEST][COUNTERS];
} list_case;

static void expect_lists(const list_case *cases, size_t count, unsigned run)
{
    uint32_t random = seed_of_run(run);
    for (size_t i = 0U; i < count; i++) {
        const hg_e2e_config config = h2f(cases[i].profile, cases[i].list);
        expect(&config, cases[i].passing[0], cases[i].passing[1], cases[i].passing[2], &random);
    }
}

static void equal_entries_of_a_list_let_nothing_pass(void **state)
{
    (void)state;
    static const list_case cases[] = {{.profile = HG_E2E_P02, .list = all_same}, {.profile = HG_E2E_P22, .list = all_same}};
    expect_lists(cases, COUNT(cases), 15U);
}

/* 0 .. 15 is linear in the counter: the same for every counter. Any other list is worse or better by chance. */
static void other_lists_let_errors_pass(void **state)
{
    (void)state;
    static const list_case cases[] = {
        {HG_E2E_P02, from_zero,
         {{0U}, {0U}, {48U, 48U, 48U, 48U, 48U, 48U, 48U, 48U, 48U, 48U, 48U, 48U, 48U, 48U, 48U, 48U}}},
        {HG_E2E_P22, from_one,
         {{0U}, {1U, 2U, 0U, 2U, 1U, 1U, 1U, 3U, 1U, 2U, 0U, 1U, 1U, 2U, 0U, 2U},
          {38U, 28U, 54U, 28U, 38U, 42U, 39U, 14U, 38U, 28U, 53U, 40U, 38U, 28U, 54U, 28U}}},
    };
    expect_lists(cases, COUNT(cases), 16U);
}

static void random_lists_let_errors_of_one_and_two_bits_pass(void **state)
{
    (void)state;
    static const list_case cases[] = {
        {HG_E2E_P02, pseudo_random[0],
         {{0U}, {1U, 0U, 3U, 3U, 0U, 0U, 3U, 2U, 1U, 0U, 0U, 1U, 2U, 2U, 1U, 1U},
          {27U, 41U, 16U, 12U, 32U, 29U, 2U, 27U, 29U, 44U, 46U, 30U, 32U, 17U, 47U, 43U}}},
        {HG_E2E_P02, pseudo_random[1],
         {{0U, 0U, 0U, 0U, 0U, 0U, 0U, 0U, 0U, 0U, 1U, 1U, 0U, 0U, 0U, 0U}, {2U, 1U, 1U, 1U, 3U, 2U, 0U, 1U, 1U, 0U, 2U, 0U, 1U, 1U, 2U, 2U},
          {32U, 44U, 47U, 43U, 19U, 31U, 48U, 44U, 51U, 46U, 14U, 23U, 48U, 46U, 17U, 27U}}},
    };
    expect_lists(cases, COUNT(cases), 17U);
}

static void p05_lets_nothing_pass(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(18U);
    const hg_e2e_config config = p05((uint16_t)draw(&random));
    expect(&config, NULL, NULL, NULL, &random);
}

/* Errors of three bits in frames of up to 12 bytes, 2 .. 12, with counter 0, from which no three bits lead to 15. */
static void longer_frames_let_more_errors_of_three_bits_pass(void **state)
{
    (void)state;
    static const unsigned both[13] = {0U, 0U, 0U, 3U, 18U, 46U, 87U, 141U, 198U, 274U, 362U, 465U, 587U};
    static const unsigned nibble[13] = {0U, 0U, 0U, 0U, 10U, 30U, 64U, 113U, 169U, 232U, 318U, 409U, 523U};
    static const unsigned zero[13] = {0U, 0U, 0U, 9U, 10U, 11U, 27U, 46U, 48U, 68U, 92U, 110U, 131U};
    uint32_t random = seed_of_run(19U);
    const hg_e2e_config configs[] = {j1850(HG_E2E_P11, HG_E2E_BOTH, 0x0123U), j1850(HG_E2E_P11, HG_E2E_NIBBLE, 0x0123U), h2f(HG_E2E_P22, from_zero),
                                     h2f(HG_E2E_P22, all_same), p05(0x1234U)};
    const unsigned *expected[] = {both, nibble, zero, NULL, NULL};
    for (size_t i = 0U; i < COUNT(configs); i++) {
        for (uint8_t length = (configs[i].profile == HG_E2E_P05) ? 3U : 2U; length <= 12U; length++) {
            const tally found = all_errors(&configs[i], length, 0U, DEEPEST, &random);
            assert_count(0, found.passed[0]);
            assert_count(0, found.passed[1]);
            assert_count((expected[i] != NULL) ? expected[i][length] : 0U, found.passed[2]);
        }
    }
}

/* Errors of three bits in 16 bytes, those of two in every length that there is: where they begin, and how many there are in the longest. */
static void only_p05_sees_every_error_of_two_bits_in_long_frames(void **state)
{
    (void)state;
    static const struct {
        unsigned begin;   /* shortest length at which one of two bits passes */
        unsigned longest; /* that pass in 64 bytes, of 130816 */
        unsigned three;   /* of three bits that pass in 16 bytes, of 341376 */
    } expected[] = {{32U, 259U, 1349U}, {33U, 253U, 1230U}, {15U, 782U, 0U}, {15U, 766U, 243U}, {65U, 0U, 0U}};
    const hg_e2e_config configs[] = {j1850(HG_E2E_P11, HG_E2E_BOTH, 0x0123U), j1850(HG_E2E_P11, HG_E2E_NIBBLE, 0x0123U), h2f(HG_E2E_P22, all_same),
                                     h2f(HG_E2E_P22, from_zero), p05(0x1234U)};
    uint32_t random = seed_of_run(20U);
    for (size_t i = 0U; i < COUNT(configs); i++) {
        for (uint8_t length = 3U; length <= HG_E2E_LENGTH_MAX; length++) {
            const tally found = all_errors(&configs[i], length, 0U, (length == 16U) ? 3U : 2U, &random);
            assert_count(0, found.passed[0]);
            assert_int_equal(length >= expected[i].begin, found.passed[1] > 0U);
            if (length == 16U) {
                assert_count(expected[i].three, found.passed[2]);
            }
            if (length == HG_E2E_LENGTH_MAX) {
                assert_count(130816, found.tried[1]);
                assert_count(expected[i].longest, found.passed[1]);
            }
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(both_and_low_let_198_errors_of_three_bits_pass_whatever_the_identifier),
        cmocka_unit_test(nibble_lets_169_errors_of_three_bits_pass_whatever_the_identifier),
        cmocka_unit_test(alternate_depends_on_the_difference_of_the_identifiers_bytes),
        cmocka_unit_test(alternate_has_identifiers_that_let_errors_of_one_or_two_bits_pass),
        cmocka_unit_test(equal_entries_of_a_list_let_nothing_pass),
        cmocka_unit_test(other_lists_let_errors_pass),
        cmocka_unit_test(random_lists_let_errors_of_one_and_two_bits_pass),
        cmocka_unit_test(p05_lets_nothing_pass),
        cmocka_unit_test(longer_frames_let_more_errors_of_three_bits_pass),
        cmocka_unit_test(only_p05_sees_every_error_of_two_bits_in_long_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
