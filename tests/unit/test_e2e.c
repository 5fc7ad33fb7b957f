/** @file
 *  e2e.h: profiles, counters and the state machine. Known answers come from the CRC catalogue and from the examples of the standard; everything else
 *  from references that share nothing with the code under test: checksums bit by bit, places in an array of bits, windows in an array of events. */
#include "support.h"

#include "hullguard/e2e.h"

#define BITS (8U * HG_E2E_LENGTH_MAX)
#define GUARDED (HG_E2E_LENGTH_MAX + 2U) /* a frame with bytes behind it that nobody may touch */
#define WINDOW_MAX 16U
#define MODE_NONE ((hg_e2e_id_mode)0)

static const uint8_t all_zero[HG_E2E_IDS] = {0U};
static const uint8_t from_zero[HG_E2E_IDS] = {0U, 1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 9U, 10U, 11U, 12U, 13U, 14U, 15U};
static const uint8_t from_one[HG_E2E_IDS] = {1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 9U, 10U, 11U, 12U, 13U, 14U, 15U, 16U};

/* Every profile with every mode that it has. */
static const struct {
    hg_e2e_profile profile;
    hg_e2e_id_mode mode;
    unsigned       modulus;
} kinds[] = {
    {HG_E2E_NONE, HG_E2E_BOTH, 1U},      {HG_E2E_P01, HG_E2E_BOTH, 15U}, {HG_E2E_P01, HG_E2E_ALTERNATE, 15U}, {HG_E2E_P01, HG_E2E_LOW, 15U},
    {HG_E2E_P01, HG_E2E_NIBBLE, 15U},    {HG_E2E_P11, HG_E2E_BOTH, 15U}, {HG_E2E_P11, HG_E2E_ALTERNATE, 15U}, {HG_E2E_P11, HG_E2E_LOW, 15U},
    {HG_E2E_P11, HG_E2E_NIBBLE, 15U},    {HG_E2E_P02, MODE_NONE, 16U},   {HG_E2E_P22, MODE_NONE, 16U},        {HG_E2E_P05, MODE_NONE, 256U},
};

/* ---- References ---- */

/* Polynomial division, one bit of the message at a time. */
static uint16_t by_bits(const uint8_t *line, size_t n, unsigned width, unsigned polynomial, unsigned start, unsigned final)
{
    const unsigned mask = (1U << width) - 1U;
    unsigned rest = start;
    for (size_t i = 0U; i < (8U * n); i++) {
        const unsigned in = ((unsigned)line[i / 8U] >> (7U - (i % 8U))) & 1U;
        const unsigned out = (rest >> (width - 1U)) & 1U;
        rest = ((rest << 1U) & mask) ^ ((in != out) ? polynomial : 0U);
    }
    return (uint16_t)(rest ^ final);
}

static bool with_nibble(const hg_e2e_config *c)
{
    return ((c->profile == HG_E2E_P01) || (c->profile == HG_E2E_P11)) && (c->mode == HG_E2E_NIBBLE);
}

/* What the checksum of a finished frame must be: the bytes in the order in which the standard takes them, and one division. */
static uint16_t reference_sum(const hg_e2e_config *c, const uint8_t *data, uint8_t length, unsigned counter)
{
    uint8_t line[HG_E2E_LENGTH_MAX + 2U];
    size_t n = 0U;
    const bool j1850 = (c->profile == HG_E2E_P01) || (c->profile == HG_E2E_P11);
    const uint8_t low = (uint8_t)c->data_id;
    const uint8_t high = (uint8_t)(c->data_id >> 8U);
    if (j1850) {
        line[n++] = ((c->mode == HG_E2E_ALTERNATE) && ((counter % 2U) == 1U)) ? high : low;
        if (c->mode == HG_E2E_BOTH) {
            line[n++] = high;
        }
        if (c->mode == HG_E2E_NIBBLE) {
            line[n++] = 0U;
        }
    }
    const unsigned own = (c->profile == HG_E2E_P05) ? 2U : 1U;
    for (unsigned i = 0U; i < length; i++) {
        if ((i < c->crc) || (i >= (c->crc + own))) {
            line[n++] = data[i];
        }
    }
    if (j1850) {
        return by_bits(line, n, 8U, 0x1DU, 0U, 0U);
    }
    if (c->profile == HG_E2E_P05) {
        line[n++] = low;
        line[n++] = high;
        return by_bits(line, n, 16U, 0x1021U, 0xFFFFU, 0U);
    }
    line[n++] = c->data_ids[counter];
    return by_bits(line, n, 8U, 0x2FU, 0xFFU, 0xFFU);
}

static void write_bits(uint8_t *data, unsigned first, unsigned count, unsigned value)
{
    for (unsigned i = 0U; i < count; i++) {
        const unsigned bit = first + i;
        const unsigned one = (value >> i) & 1U;
        data[bit / 8U] = (uint8_t)(((unsigned)data[bit / 8U] & ~(1U << (bit % 8U))) | (one << (bit % 8U)));
    }
}

static void reference_protect(const hg_e2e_config *c, uint8_t *data, uint8_t length, unsigned counter, unsigned stamp)
{
    if (c->stamp != HG_E2E_NO_STAMP) {
        write_bits(data, c->stamp, 4U, stamp);
    }
    if (c->profile == HG_E2E_NONE) {
        return;
    }
    const bool wide = c->profile == HG_E2E_P05;
    write_bits(data, c->counter, wide ? 8U : 4U, counter);
    if (with_nibble(c)) {
        write_bits(data, c->nibble, 4U, c->data_id >> 8U);
    }
    write_bits(data, 8U * (unsigned)c->crc, wide ? 16U : 8U, reference_sum(c, data, length, counter));
}

/* Places of a message: first bit, bits, multiple of what. */
typedef struct {
    unsigned first;
    unsigned count;
    unsigned multiple;
} place;

static size_t places_of(const hg_e2e_config *c, place found[4])
{
    size_t n = 0U;
    const bool wide = c->profile == HG_E2E_P05;
    if (c->profile != HG_E2E_NONE) {
        found[n++] = (place){8U * (unsigned)c->crc, wide ? 16U : 8U, 8U};
        found[n++] = (place){c->counter, wide ? 8U : 4U, wide ? 8U : 4U};
    }
    if (with_nibble(c)) {
        found[n++] = (place){c->nibble, 4U, 4U};
    }
    if (c->stamp != HG_E2E_NO_STAMP) {
        found[n++] = (place){c->stamp, 4U, 4U};
    }
    return n;
}

/* Shortest frame that holds every place. */
static unsigned shortest(const hg_e2e_config *c)
{
    place at[4];
    const size_t n = places_of(c, at);
    unsigned end = 0U;
    for (size_t i = 0U; i < n; i++) {
        const unsigned last = at[i].first + at[i].count;
        end = (last > end) ? last : end;
    }
    return (end + 7U) / 8U;
}

static bool reference_valid(const hg_e2e_config *c, unsigned length)
{
    bool taken[BITS] = {false};
    place at[4];
    const size_t n = places_of(c, at);
    for (size_t i = 0U; i < n; i++) {
        if (((at[i].first % at[i].multiple) != 0U) || ((at[i].first + at[i].count) > (8U * length))) {
            return false;
        }
        for (unsigned bit = at[i].first; bit < (at[i].first + at[i].count); bit++) {
            if (taken[bit]) {
                return false;
            }
            taken[bit] = true;
        }
    }
    return true;
}

/* ---- Drawn messages ---- */

static hg_e2e_config usual(hg_e2e_profile profile, hg_e2e_id_mode mode)
{
    const bool wide = profile == HG_E2E_P05;
    return (hg_e2e_config){.profile = profile, .mode = mode, .data_id = 0x0123U, .data_ids = from_one, .crc = 0U, .counter = wide ? 16U : 8U,
                           .nibble = 12U, .stamp = HG_E2E_NO_STAMP, .limits = &hg_e2e_limits_default};
}

/* Anything: many of them lie on one another, off their boundary or outside. */
static hg_e2e_config drawn(uint32_t *random, size_t kind, unsigned length)
{
    hg_e2e_config c = usual(kinds[kind].profile, kinds[kind].mode);
    const int32_t last = (int32_t)(2U * length); /* nibbles; the last one is just outside */
    c.data_id = (uint16_t)draw(random);
    c.crc = (uint8_t)draw_between(random, 0, (int32_t)length);
    c.counter = (uint16_t)(4 * draw_between(random, 0, last));
    c.nibble = (uint16_t)(4 * draw_between(random, 0, last));
    c.stamp = ((draw(random) % 2U) == 0U) ? HG_E2E_NO_STAMP : (uint16_t)(4 * draw_between(random, 0, last));
    if ((draw(random) % 8U) == 0U) {
        c.counter = (uint16_t)(c.counter + (draw(random) % 4U));
    }
    if ((draw(random) % 8U) == 0U) {
        c.nibble = (uint16_t)(c.nibble + (draw(random) % 4U));
    }
    if ((c.stamp != HG_E2E_NO_STAMP) && ((draw(random) % 8U) == 0U)) {
        c.stamp = (uint16_t)(c.stamp + (draw(random) % 4U));
    }
    return c;
}

static hg_e2e_config drawn_valid(uint32_t *random, size_t kind, unsigned length)
{
    hg_e2e_config c = drawn(random, kind, length);
    while (!reference_valid(&c, length)) {
        c = drawn(random, kind, length);
    }
    return c;
}

static void fill(uint32_t *random, uint8_t *bytes, size_t n)
{
    for (size_t i = 0U; i < n; i++) {
        bytes[i] = (uint8_t)draw(random);
    }
}

/* ---- One frame ---- */

static void check_values_of_the_catalogue_come_out(void **state)
{
    (void)state;
    uint8_t ids[HG_E2E_IDS] = {0U};
    ids['1' & 0x0F] = '9';
    uint8_t frame[10] = {0U, '1', '2', '3', '4', '5', '6', '7', '8', '9'};

    /* CRC-8H2F: the identifier of counter 1 ('1' is 0x31) is the last of "123456789". */
    hg_e2e_config c = usual(HG_E2E_P02, MODE_NONE);
    c.data_ids = ids;
    assert_status(HG_OK, hg_e2e_protect(&c, frame, 9U, 1U, 0U));
    assert_int_equal(0xDF, frame[0]);

    /* 0x1D from 0 without final XOR: CRC-8/GSM-A, for an identifier 0 leaves the start value alone. */
    c = usual(HG_E2E_P01, HG_E2E_LOW);
    c.data_id = 0U;
    assert_status(HG_OK, hg_e2e_protect(&c, frame, 10U, 1U, 0U));
    assert_int_equal(0x37, frame[0]);

    /* From the identifier that leads to 0xFF on, and inverted, it is CRC-8/SAE-J1850. */
    uint8_t to_ones = 0U;
    while (by_bits(&to_ones, 1U, 8U, 0x1DU, 0U, 0U) != 0xFFU) {
        to_ones++;
    }
    c.data_id = to_ones;
    assert_status(HG_OK, hg_e2e_protect(&c, frame, 10U, 1U, 0U));
    assert_int_equal(0x4B, frame[0] ^ 0xFF);

    /* CRC-16/IBM-3740: "89" is the identifier. */
    uint8_t wide[9] = {0U, 0U, '1', '2', '3', '4', '5', '6', '7'};
    c = usual(HG_E2E_P05, MODE_NONE);
    c.data_id = 0x3938U;
    assert_status(HG_OK, hg_e2e_protect(&c, wide, 9U, '1', 0U));
    assert_int_equal(0xB1, wide[0]);
    assert_int_equal(0x29, wide[1]);
    assert_int_equal(0x29B1, by_bits((const uint8_t *)"123456789", 9U, 16U, 0x1021U, 0xFFFFU, 0U));
}

static void check_example(const hg_e2e_config *c, uint8_t length, uint8_t counter, const uint8_t *before, const uint8_t *expected)
{
    uint8_t data[16];
    hg_e2e_header header;
    assert_true(hg_e2e_valid(c, length));
    (void)memcpy(data, before, length);
    assert_status(HG_OK, hg_e2e_protect(c, data, length, counter, 0U));
    assert_memory_equal(expected, data, length);
    assert_status(HG_OK, hg_e2e_check(c, data, length, &header));
    assert_count(counter, header.counter);
}

static void examples_of_the_standard_come_out(void **state)
{
    (void)state;
    static const uint8_t zeros[16] = {0U};
    static const struct {
        hg_e2e_id_mode mode;
        uint8_t        counter;
        uint8_t        frame[8];
    } j1850[] = {{HG_E2E_BOTH, 0U, {0xCCU, 0x00U}},   {HG_E2E_BOTH, 1U, {0x91U, 0x01U}},   {HG_E2E_LOW, 0U, {0xCEU, 0x00U}},
                 {HG_E2E_ALTERNATE, 0U, {0xCEU, 0x00U}}, {HG_E2E_NIBBLE, 0U, {0x2AU, 0x10U}}, {HG_E2E_NIBBLE, 1U, {0x77U, 0x11U}}};
    for (size_t i = 0U; i < COUNT(j1850); i++) {
        const hg_e2e_config p01 = usual(HG_E2E_P01, j1850[i].mode);
        const hg_e2e_config p11 = usual(HG_E2E_P11, j1850[i].mode);
        check_example(&p01, 8U, j1850[i].counter, zeros, j1850[i].frame);
        check_example(&p11, 8U, j1850[i].counter, zeros, j1850[i].frame);
    }
    static const struct {
        const uint8_t *ids;
        uint8_t        counter;
        uint8_t        before[8];
        uint8_t        frame[8];
    } h2f[] = {{all_zero, 1U, {0U}, {0x45U, 0x01U}},
               {from_zero, 2U, {0U, 1U, 2U, 3U, 4U, 5U, 6U, 7U}, {0xBCU, 0x02U, 0x02U, 0x03U, 0x04U, 0x05U, 0x06U, 0x07U}},
               {from_one, 1U, {0U}, {0x1BU, 0x01U}}};
    for (size_t i = 0U; i < COUNT(h2f); i++) {
        hg_e2e_config p02 = usual(HG_E2E_P02, MODE_NONE);
        hg_e2e_config p22 = usual(HG_E2E_P22, MODE_NONE);
        p02.data_ids = h2f[i].ids;
        p22.data_ids = h2f[i].ids;
        check_example(&p02, 8U, h2f[i].counter, h2f[i].before, h2f[i].frame);
        check_example(&p22, 8U, h2f[i].counter, h2f[i].before, h2f[i].frame);
    }
    hg_e2e_config p05 = usual(HG_E2E_P05, MODE_NONE);
    p05.data_id = 0x1234U;
    check_example(&p05, 8U, 0U, zeros, (const uint8_t[8]){0x1CU, 0xCAU, 0x00U});
    check_example(&p05, 8U, 1U, zeros, (const uint8_t[8]){0xCFU, 0x8DU, 0x01U});
    p05.crc = 8U, p05.counter = 80U;
    check_example(&p05, 16U, 0U, zeros, (const uint8_t[16]){0U, 0U, 0U, 0U, 0U, 0U, 0U, 0U, 0x28U, 0x91U, 0x00U});
    hg_e2e_config p11 = usual(HG_E2E_P11, HG_E2E_BOTH);
    p11.crc = 8U, p11.counter = 72U;
    check_example(&p11, 16U, 0U, zeros, (const uint8_t[16]){0U, 0U, 0U, 0U, 0U, 0U, 0U, 0U, 0x41U, 0x00U});
}

static void every_layout_agrees_with_the_references(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(31U);
    for (unsigned run = 0U; run < 20000U; run++) {
        const size_t kind = draw(&random) % COUNT(kinds);
        const uint8_t length = (uint8_t)draw_between(&random, 4, (int32_t)HG_E2E_LENGTH_MAX);
        uint8_t ids[HG_E2E_IDS];
        uint8_t data[GUARDED];
        uint8_t expected[GUARDED];
        hg_e2e_config c = drawn_valid(&random, kind, length);
        fill(&random, ids, sizeof(ids));
        fill(&random, data, sizeof(data));
        (void)memcpy(expected, data, sizeof(data));
        c.data_ids = ids;
        assert_true(hg_e2e_valid(&c, length));
        const uint8_t counter = (uint8_t)draw(&random); /* both are taken by their modulus */
        const uint8_t stamp = (uint8_t)draw(&random);
        const unsigned count = counter % kinds[kind].modulus;
        reference_protect(&c, expected, length, count, stamp % 16U);
        assert_status(HG_OK, hg_e2e_protect(&c, data, length, counter, stamp));
        assert_memory_equal(expected, data, sizeof(data));

        hg_e2e_header header = {.stamp = 0x5AU, .counter = 0x5AU, .crc = 0x5A5AU};
        assert_status(HG_OK, hg_e2e_check(&c, data, length, &header));
        assert_count(count, header.counter);
        assert_count((c.stamp != HG_E2E_NO_STAMP) ? (stamp % 16U) : 0U, header.stamp);
        assert_count((c.profile == HG_E2E_NONE) ? 0U : reference_sum(&c, data, length, count), header.crc);
    }
}

static void the_protection_writes_where_it_owns_and_nowhere_else(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(32U);
    for (unsigned run = 0U; run < 2000U; run++) {
        const uint8_t length = (uint8_t)draw_between(&random, 4, (int32_t)HG_E2E_LENGTH_MAX);
        const hg_e2e_config c = drawn_valid(&random, draw(&random) % COUNT(kinds), length);
        place at[4];
        const size_t n = places_of(&c, at);
        bool owned[BITS + 64U] = {false};
        for (size_t i = 0U; i < n; i++) {
            for (unsigned bit = at[i].first; bit < (at[i].first + at[i].count); bit++) {
                owned[bit] = true;
            }
        }
        for (uint16_t bit = 0U; bit < COUNT(owned); bit++) {
            assert_int_equal(owned[bit], hg_e2e_owns(&c, bit));
        }
        assert_false(hg_e2e_owns(&c, 0xFFFFU));
    }
}

/* HG_E2E_NO_STAMP is no place: not even the one that its number would be, far behind the frame. */
static void without_a_place_for_a_stamp_none_is_written_or_read(void **state)
{
    (void)state;
    static uint8_t data[(HG_E2E_NO_STAMP / 8U) + 1U];
    for (size_t kind = 0U; kind < COUNT(kinds); kind++) {
        const hg_e2e_config c = usual(kinds[kind].profile, kinds[kind].mode);
        hg_e2e_header header = {.stamp = 0x5AU, .counter = 0x5AU, .crc = 0x5A5AU};
        (void)memset(data, 0xFF, sizeof(data));
        assert_status(HG_OK, hg_e2e_protect(&c, data, 8U, 1U, 0U));
        assert_status(HG_OK, hg_e2e_check(&c, data, 8U, &header));
        assert_count(0U, header.stamp);
        for (size_t i = 8U; i < sizeof(data); i++) {
            assert_int_equal(0xFF, data[i]);
        }
    }
}

static void the_counter_has_its_modulus(void **state)
{
    (void)state;
    for (size_t i = 0U; i < COUNT(kinds); i++) {
        const hg_e2e_config c = usual(kinds[i].profile, kinds[i].mode);
        assert_count(kinds[i].modulus, hg_e2e_modulus(&c));
    }
}

/* Refused by both functions, and nothing is written. */
static void refuse_length(const hg_e2e_config *c, uint8_t length)
{
    uint8_t data[256];
    uint8_t before[256];
    (void)memset(data, 0x5A, sizeof(data));
    (void)memcpy(before, data, sizeof(data));
    hg_e2e_header header = {.stamp = 0x5AU, .counter = 0x5AU, .crc = 0x5A5AU};
    assert_status(HG_E_FORMAT, hg_e2e_protect(c, data, length, 1U, 1U));
    assert_memory_equal(before, data, sizeof(data));
    assert_status(HG_E_FORMAT, hg_e2e_check(c, data, length, &header));
    assert_int_equal(0x5A, header.stamp);
    assert_int_equal(0x5A, header.counter);
    assert_int_equal(0x5A5A, header.crc);
}

static void frames_too_short_for_a_place_or_too_long_are_refused(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(33U);
    for (unsigned run = 0U; run < 500U; run++) {
        const hg_e2e_config c = drawn_valid(&random, draw(&random) % COUNT(kinds), 4U + (draw(&random) % 61U));
        const unsigned least = shortest(&c);
        for (unsigned length = 0U; length < least; length++) {
            refuse_length(&c, (uint8_t)length);
        }
        refuse_length(&c, 65U);
        refuse_length(&c, 255U);
        uint8_t data[HG_E2E_LENGTH_MAX] = {0U};
        assert_status(HG_OK, hg_e2e_protect(&c, data, (uint8_t)least, 1U, 1U));
    }
    /* each place as the only one that lies outside */
    hg_e2e_config c = usual(HG_E2E_P01, HG_E2E_NIBBLE);
    c.crc = 8U, refuse_length(&c, 8U);
    c = usual(HG_E2E_P01, HG_E2E_NIBBLE), c.counter = 64U, refuse_length(&c, 8U);
    c = usual(HG_E2E_P01, HG_E2E_NIBBLE), c.nibble = 64U, refuse_length(&c, 8U);
    c = usual(HG_E2E_P01, HG_E2E_NIBBLE), c.stamp = 64U, refuse_length(&c, 8U);
    c = usual(HG_E2E_P05, MODE_NONE), c.crc = 7U, refuse_length(&c, 8U);
    c = usual(HG_E2E_P05, MODE_NONE), c.counter = 64U, refuse_length(&c, 8U);
    c = usual(HG_E2E_NONE, HG_E2E_BOTH), c.stamp = 64U, refuse_length(&c, 8U);
}

static void only_the_right_checksum_is_good(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(34U);
    for (size_t kind = 1U; kind < COUNT(kinds); kind++) {
        hg_e2e_config c = usual(kinds[kind].profile, kinds[kind].mode);
        uint8_t data[8];
        fill(&random, data, sizeof(data));
        assert_status(HG_OK, hg_e2e_protect(&c, data, 8U, (uint8_t)draw(&random), 0U));
        const unsigned own = (c.profile == HG_E2E_P05) ? 2U : 1U;
        for (unsigned byte = 0U; byte < own; byte++) {
            const uint8_t right = data[byte];
            for (unsigned wrong = 0U; wrong < 256U; wrong++) {
                hg_e2e_header header = {.stamp = 0x5AU, .counter = 0x5AU, .crc = 0x5A5AU};
                data[byte] = (uint8_t)wrong;
                const bool good = wrong == right;
                assert_status(good ? HG_OK : HG_E_CRC, hg_e2e_check(&c, data, 8U, &header));
                assert_int_equal(!good, (header.counter == 0x5AU) && (header.stamp == 0x5AU) && (header.crc == 0x5A5AU));
            }
            data[byte] = right;
        }
    }
}

static void frames_of_another_identifier_are_refused(void **state)
{
    (void)state;
    for (size_t kind = 1U; kind < COUNT(kinds); kind++) {
        hg_e2e_config c = usual(kinds[kind].profile, kinds[kind].mode);
        hg_e2e_config other = c;
        uint8_t data[8] = {0U, 0U, 0U, 7U};
        hg_e2e_header header;
        other.data_id = 0x0456U;
        other.data_ids = all_zero;
        assert_status(HG_OK, hg_e2e_protect(&other, data, 8U, 3U, 0U));
        assert_status(HG_OK, hg_e2e_check(&other, data, 8U, &header));
        assert_status(HG_E_CRC, hg_e2e_check(&c, data, 8U, &header));
    }
}

static void a_counter_of_15_is_damage_in_p01_and_p11_alone(void **state)
{
    (void)state;
    for (size_t kind = 1U; kind < COUNT(kinds); kind++) {
        hg_e2e_config c = usual(kinds[kind].profile, kinds[kind].mode);
        uint8_t data[8] = {0U};
        hg_e2e_header header;
        reference_protect(&c, data, 8U, 15U, 0U);
        assert_status((kinds[kind].modulus == 15U) ? HG_E_CRC : HG_OK, hg_e2e_check(&c, data, 8U, &header));
        c.ignore = HG_E2E_IGNORE_CRC; /* the counter is no part of the checksum */
        assert_status((kinds[kind].modulus == 15U) ? HG_E_CRC : HG_OK, hg_e2e_check(&c, data, 8U, &header));
    }
}

static void another_nibble_is_damage_though_the_checksum_is_good(void **state)
{
    (void)state;
    hg_e2e_config c = usual(HG_E2E_P11, HG_E2E_NIBBLE);
    for (unsigned nibble = 0U; nibble < 16U; nibble++) {
        uint8_t data[8] = {0U};
        hg_e2e_header header;
        hg_e2e_config sender = c;
        sender.data_id = (uint16_t)(0x0023U | (nibble << 8U)); /* the high byte is no part of the checksum */
        assert_status(HG_OK, hg_e2e_protect(&sender, data, 8U, 3U, 0U));
        c.ignore = 0U;
        assert_status((nibble == 1U) ? HG_OK : HG_E_CRC, hg_e2e_check(&c, data, 8U, &header));
        c.ignore = HG_E2E_IGNORE_CRC;
        assert_status(HG_OK, hg_e2e_check(&c, data, 8U, &header));
    }
}

static void with_the_checksum_ignored_a_damaged_frame_is_read(void **state)
{
    (void)state;
    for (size_t kind = 0U; kind < COUNT(kinds); kind++) {
        hg_e2e_config c = usual(kinds[kind].profile, kinds[kind].mode);
        uint8_t data[8] = {0U};
        hg_e2e_header header;
        c.stamp = 60U;
        assert_status(HG_OK, hg_e2e_protect(&c, data, 8U, 3U, 9U));
        data[4] ^= 1U;
        assert_status((kind == 0U) ? HG_OK : HG_E_CRC, hg_e2e_check(&c, data, 8U, &header));
        c.ignore = (uint8_t)~HG_E2E_IGNORE_CRC;
        assert_status((kind == 0U) ? HG_OK : HG_E_CRC, hg_e2e_check(&c, data, 8U, &header));
        c.ignore = HG_E2E_IGNORE_CRC;
        assert_status(HG_OK, hg_e2e_check(&c, data, 8U, &header));
        assert_count((kind == 0U) ? 0 : 3, header.counter);
        assert_int_equal(9, header.stamp);
    }
}

/* ---- Places ---- */

static void only_places_apart_and_inside_are_valid(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(35U);
    unsigned good = 0U;
    unsigned bad = 0U;
    for (unsigned run = 0U; run < 20000U; run++) {
        const uint8_t length = (uint8_t)draw_between(&random, 0, 10);
        const hg_e2e_config c = drawn(&random, draw(&random) % COUNT(kinds), length);
        const bool expected = reference_valid(&c, length);
        assert_int_equal(expected, hg_e2e_valid(&c, length));
        good += expected ? 1U : 0U;
        bad += expected ? 0U : 1U;
    }
    assert_true(good > 1000U);
    assert_true(bad > 1000U);
}

static void places_far_outside_are_refused(void **state)
{
    (void)state;
    hg_e2e_config c = usual(HG_E2E_P01, HG_E2E_NIBBLE);
    assert_true(hg_e2e_valid(&c, 64U));
    c.crc = 255U;
    assert_false(hg_e2e_valid(&c, 64U));
    c = usual(HG_E2E_P01, HG_E2E_NIBBLE), c.counter = 0xFFFCU;
    assert_false(hg_e2e_valid(&c, 64U));
    c = usual(HG_E2E_P01, HG_E2E_NIBBLE), c.nibble = 0xFFFCU;
    assert_false(hg_e2e_valid(&c, 64U));
    c = usual(HG_E2E_P01, HG_E2E_NIBBLE), c.stamp = 0xFFFCU;
    assert_false(hg_e2e_valid(&c, 64U));
    c = usual(HG_E2E_P05, MODE_NONE), c.counter = 0xFFF8U;
    assert_false(hg_e2e_valid(&c, 64U));
    c = usual(HG_E2E_NONE, HG_E2E_BOTH);
    assert_true(hg_e2e_valid(&c, 0U));
    assert_true(hg_e2e_valid(&c, 64U));
    assert_false(hg_e2e_valid(&c, 65U));
    assert_false(hg_e2e_valid(&c, 255U));
}

static void places_off_their_boundary_are_refused(void **state)
{
    (void)state;
    for (uint16_t off = 1U; off < 4U; off++) {
        hg_e2e_config c = usual(HG_E2E_P01, HG_E2E_NIBBLE);
        c.counter = (uint16_t)(32U + off);
        assert_false(hg_e2e_valid(&c, 8U));
        c = usual(HG_E2E_P01, HG_E2E_NIBBLE), c.nibble = (uint16_t)(32U + off);
        assert_false(hg_e2e_valid(&c, 8U));
        c = usual(HG_E2E_P01, HG_E2E_NIBBLE), c.stamp = (uint16_t)(32U + off);
        assert_false(hg_e2e_valid(&c, 8U));
        c = usual(HG_E2E_NONE, HG_E2E_BOTH), c.stamp = (uint16_t)(32U + off);
        assert_false(hg_e2e_valid(&c, 8U));
        c = usual(HG_E2E_NONE, HG_E2E_BOTH), c.counter = off, c.nibble = off; /* not there at all */
        assert_true(hg_e2e_valid(&c, 8U));
    }
    hg_e2e_config c = usual(HG_E2E_P05, MODE_NONE);
    c.counter = 36U;
    assert_false(hg_e2e_valid(&c, 8U));
}

static void missing_tables_and_unknown_kinds_are_refused(void **state)
{
    (void)state;
    assert_false(hg_e2e_valid(NULL, 8U));
    for (size_t kind = 0U; kind < COUNT(kinds); kind++) {
        const hg_e2e_config good = usual(kinds[kind].profile, kinds[kind].mode);
        const bool listed = kinds[kind].modulus == 16U;
        const bool modal = kinds[kind].modulus == 15U;
        hg_e2e_config c = good;
        assert_true(hg_e2e_valid(&c, 8U));
        c.data_ids = NULL;
        assert_int_equal(!listed, hg_e2e_valid(&c, 8U));
        c = good, c.mode = (hg_e2e_id_mode)0;
        assert_int_equal(!modal, hg_e2e_valid(&c, 8U));
        c = good, c.mode = (hg_e2e_id_mode)(HG_E2E_NIBBLE + 1);
        assert_int_equal(!modal, hg_e2e_valid(&c, 8U));
        c = good, c.limits = NULL;
        assert_false(hg_e2e_valid(&c, 8U));
        c = good, c.profile = (hg_e2e_profile)0;
        assert_false(hg_e2e_valid(&c, 8U));
        c = good, c.profile = (hg_e2e_profile)(HG_E2E_P22 + 1);
        assert_false(hg_e2e_valid(&c, 8U));
    }
}

static void limits_outside_their_ranges_are_refused(void **state)
{
    (void)state;
    static const hg_e2e_limit bad[] = {{0U, 0U, 0U}, {17U, 1U, 1U}, {255U, 1U, 1U}, {5U, 6U, 1U}, {5U, 1U, 6U}, {16U, 17U, 0U}, {16U, 0U, 17U}};
    static const hg_e2e_limit good[] = {{1U, 0U, 0U}, {1U, 1U, 1U}, {16U, 16U, 16U}, {16U, 0U, 0U}};
    for (unsigned which = 0U; which < 3U; which++) {
        for (size_t i = 0U; i < (COUNT(bad) + COUNT(good)); i++) {
            hg_e2e_config c = usual(HG_E2E_P22, MODE_NONE);
            hg_e2e_limits limits = hg_e2e_limits_default;
            hg_e2e_limit *const one = (which == 0U) ? &limits.init : ((which == 1U) ? &limits.valid : &limits.invalid);
            *one = (i < COUNT(bad)) ? bad[i] : good[i - COUNT(bad)];
            c.limits = &limits;
            assert_int_equal(i >= COUNT(bad), hg_e2e_valid(&c, 8U));
        }
    }
}

/* ---- One frame after another ---- */

static hg_e2e_header with(unsigned counter, unsigned crc)
{
    return (hg_e2e_header){.stamp = 0U, .counter = (uint8_t)counter, .crc = (uint16_t)crc};
}

/* Take a frame; what it says of the loss must come with it and with nothing else. */
static hg_status take(const hg_e2e_config *c, hg_e2e_receiver *self, const hg_e2e_header *header, unsigned step, unsigned lost, bool continues)
{
    hg_e2e_progress progress = {.lost = 0x5AU, .continues = !continues};
    const hg_status status = hg_e2e_sequence(c, self, header, (uint16_t)step, &progress);
    if (status == HG_OK) {
        assert_count(lost, progress.lost);
        assert_int_equal(continues, progress.continues);
    } else if (status == HG_E_REPEATED) {
        assert_int_equal(0x5A, progress.lost);
        assert_int_equal(!continues, progress.continues);
    } else {
        assert_status(HG_E_SEQUENCE, status);
    }
    return status;
}

static void the_first_frame_is_in_sequence(void **state)
{
    (void)state;
    for (size_t kind = 1U; kind < COUNT(kinds); kind++) {
        const hg_e2e_config c = usual(kinds[kind].profile, kinds[kind].mode);
        for (unsigned first = 0U; first < kinds[kind].modulus; first++) {
            const hg_e2e_header header = with(first, 0U);
            hg_e2e_receiver self;
            (void)memset(&self, 0x5A, sizeof(self));
            hg_e2e_receiver_start(&self);
            assert_false(self.seen);
            assert_false(hg_e2e_repeated(&c, &self, &header));
            assert_status(HG_OK, take(&c, &self, &header, 1U, 0U, false));
            assert_true(self.seen);
        }
    }
}

/* Every counter, every way it can have moved, every number of frames that there can have been. */
static void the_counter_may_move_as_far_as_the_time_allows(void **state)
{
    (void)state;
    for (size_t kind = 1U; kind < COUNT(kinds); kind++) {
        const hg_e2e_config c = usual(kinds[kind].profile, kinds[kind].mode);
        const unsigned modulus = kinds[kind].modulus;
        const unsigned steps[] = {1U, 2U, 3U, modulus - 1U, modulus, modulus + 1U, 1000U, HG_E2E_ANY_STEP};
        for (unsigned first = 0U; first < modulus; first += (modulus == 256U) ? 15U : 1U) {
            for (unsigned moved = 1U; moved <= modulus; moved++) { /* modulus: another frame with the same counter */
                for (size_t i = 0U; i < COUNT(steps); i++) {
                    hg_e2e_receiver self;
                    hg_e2e_receiver_start(&self);
                    const hg_e2e_header a = with(first, 17U);
                    const hg_e2e_header b = with((first + moved) % modulus, 18U);
                    assert_status(HG_OK, take(&c, &self, &a, 1U, 0U, false));
                    assert_status((moved <= steps[i]) ? HG_OK : HG_E_SEQUENCE, take(&c, &self, &b, steps[i], moved - 1U, moved == 1U));
                    assert_true(hg_e2e_repeated(&c, &self, &b)); /* either way it is the one to compare with */
                    const hg_e2e_header next = with((first + moved + 1U) % modulus, 19U);
                    assert_status(HG_OK, take(&c, &self, &next, 1U, 0U, true));
                }
            }
        }
    }
}

static void the_last_frame_once_more_changes_nothing(void **state)
{
    (void)state;
    for (size_t kind = 1U; kind < COUNT(kinds); kind++) {
        hg_e2e_config c = usual(kinds[kind].profile, kinds[kind].mode);
        hg_e2e_receiver self;
        const hg_e2e_header header = with(3U, 17U);
        const hg_e2e_header other_sum = with(3U, 18U);
        const hg_e2e_header other_counter = with(4U, 17U);
        hg_e2e_receiver_start(&self);
        assert_status(HG_OK, take(&c, &self, &header, 1U, 0U, false));
        const hg_e2e_receiver before = self;
        assert_true(hg_e2e_repeated(&c, &self, &header));
        assert_false(hg_e2e_repeated(&c, &self, &other_sum));
        assert_false(hg_e2e_repeated(&c, &self, &other_counter));
        assert_status(HG_E_REPEATED, take(&c, &self, &header, HG_E2E_ANY_STEP, 0U, true));
        assert_count(before.crc, self.crc);
        assert_count(before.counter, self.counter);
        assert_count(before.resync, self.resync);
        c.ignore = HG_E2E_IGNORE_COUNTER;
        assert_false(hg_e2e_repeated(&c, &self, &header));
    }
}

static void without_a_counter_every_frame_is_in_sequence_and_none_continues(void **state)
{
    (void)state;
    for (size_t kind = 0U; kind < COUNT(kinds); kind++) {
        hg_e2e_config c = usual(kinds[kind].profile, kinds[kind].mode);
        c.ignore = (kind == 0U) ? 0U : HG_E2E_IGNORE_COUNTER;
        hg_e2e_receiver self;
        hg_e2e_receiver_start(&self);
        for (unsigned i = 0U; i < 20U; i++) {
            const hg_e2e_header header = with((i * 7U) % 15U, 0U);
            assert_false(hg_e2e_repeated(&c, &self, &header));
            assert_status(HG_OK, take(&c, &self, &header, 1U, 0U, false));
            assert_status(HG_OK, take(&c, &self, &header, 1U, 0U, false));
        }
    }
}

static void two_receivers_do_not_know_of_each_other(void **state)
{
    (void)state;
    const hg_e2e_config c = usual(HG_E2E_P22, MODE_NONE);
    hg_e2e_receiver a;
    hg_e2e_receiver b;
    hg_e2e_receiver_start(&a);
    hg_e2e_receiver_start(&b);
    const hg_e2e_header at[] = {with(4U, 1U), with(9U, 2U), with(5U, 3U)};
    assert_status(HG_OK, take(&c, &a, &at[0], 1U, 0U, false));
    assert_status(HG_OK, take(&c, &b, &at[0], 1U, 0U, false));
    assert_status(HG_OK, take(&c, &b, &at[1], 5U, 4U, false));
    assert_status(HG_OK, take(&c, &a, &at[2], 1U, 0U, true));
}

/* The frame that jumped, and as many in sequence after it, are refused; any break in between begins anew. */
static void after_a_jump_frames_are_refused_until_they_are_in_sequence(void **state)
{
    (void)state;
    hg_e2e_config c = usual(HG_E2E_P01, HG_E2E_BOTH);
    c.resync = 2U;
    hg_e2e_receiver self;
    hg_e2e_receiver_start(&self);
    static const struct {
        unsigned  counter;
        unsigned  step;
        hg_status status;
        unsigned  lost;
        bool      continues;
    } script[] = {
        {0U, 1U, HG_OK, 0U, false},        {1U, 1U, HG_OK, 0U, true},        {9U, 3U, HG_E_SEQUENCE, 0U, false},
        {10U, 1U, HG_E_SEQUENCE, 0U, false}, {11U, 1U, HG_E_SEQUENCE, 0U, false}, {12U, 1U, HG_OK, 0U, true},
        {14U, 2U, HG_OK, 1U, false},         {5U, 2U, HG_E_SEQUENCE, 0U, false},  {6U, 9U, HG_E_SEQUENCE, 0U, false},
        {8U, 9U, HG_E_SEQUENCE, 0U, false},  {9U, 1U, HG_E_SEQUENCE, 0U, false},  {1U, 1U, HG_E_SEQUENCE, 0U, false},
        {2U, 1U, HG_E_SEQUENCE, 0U, false},  {3U, 1U, HG_E_SEQUENCE, 0U, false},  {5U, 2U, HG_OK, 1U, false},
    };
    for (size_t i = 0U; i < COUNT(script); i++) {
        const hg_e2e_header header = with(script[i].counter, (unsigned)i);
        assert_status(script[i].status, take(&c, &self, &header, script[i].step, script[i].lost, script[i].continues));
        if (script[i].status == HG_E_SEQUENCE) { /* once more: that changes nothing either */
            assert_status(HG_E_REPEATED, take(&c, &self, &header, HG_E2E_ANY_STEP, 0U, false));
        }
    }
}

/* Any frames, any limits, any number of frames to refuse after a jump: against the rule step by step. */
static void the_sequence_agrees_with_its_reference(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(38U);
    for (unsigned run = 0U; run < 2000U; run++) {
        const size_t kind = 1U + (draw(&random) % (COUNT(kinds) - 1U));
        const unsigned modulus = kinds[kind].modulus;
        hg_e2e_config c = usual(kinds[kind].profile, kinds[kind].mode);
        c.resync = (uint8_t)(draw(&random) % 4U);
        hg_e2e_receiver self;
        hg_e2e_receiver_start(&self);
        bool seen = false;
        unsigned last = 0U;
        unsigned sum = 0U;
        unsigned wait = 0U;
        for (unsigned i = 0U; i < 50U; i++) {
            const unsigned far = ((draw(&random) % 4U) == 0U) ? modulus : 3U;
            const unsigned counter = (last + (draw(&random) % far)) % modulus;
            const hg_e2e_header header = with(counter, draw(&random) % 2U);
            const unsigned step = 1U + (draw(&random) % 3U);
            unsigned moved = 1U;
            for (unsigned at = (last + 1U) % modulus; seen && (at != counter); at = (at + 1U) % modulus) {
                moved++;
            }
            hg_status expected = HG_E_SEQUENCE;
            if (seen && (counter == last) && (header.crc == sum)) {
                expected = HG_E_REPEATED;
            } else if (moved > step) {
                wait = c.resync;
            } else if (wait == 0U) {
                expected = HG_OK;
            } else {
                wait = (moved == 1U) ? (wait - 1U) : c.resync;
            }
            assert_status(expected, take(&c, &self, &header, step, moved - 1U, seen && (moved == 1U)));
            last = counter;
            sum = header.crc;
            seen = true;
        }
    }
}

/* A sender that really counts, losses that really happen: within the time that passed and one turn, the loss told is the true one. */
static void the_loss_told_is_the_true_one(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(36U);
    for (size_t kind = 1U; kind < COUNT(kinds); kind++) {
        hg_e2e_config c = usual(kinds[kind].profile, kinds[kind].mode);
        hg_e2e_receiver self;
        uint8_t data[8];
        hg_e2e_header header;
        hg_e2e_receiver_start(&self);
        uint64_t sent = 0U;
        for (unsigned i = 0U; i < 3000U; i++) {
            const unsigned moved = 1U + (draw(&random) % (kinds[kind].modulus - 1U));
            sent += moved;
            fill(&random, data, sizeof(data));
            assert_status(HG_OK, hg_e2e_protect(&c, data, 8U, (uint8_t)(sent % kinds[kind].modulus), 0U));
            assert_status(HG_OK, hg_e2e_check(&c, data, 8U, &header));
            const unsigned idle = draw(&random) % 3U; /* samples in which the sender had nothing to say */
            const unsigned step = ((draw(&random) % 4U) == 0U) ? HG_E2E_ANY_STEP : (moved + idle);
            assert_status(HG_OK, take(&c, &self, &header, step, (i == 0U) ? 0U : (moved - 1U), (i != 0U) && (moved == 1U)));
        }
    }
}

/* ---- State machine ---- */

typedef enum { GOOD = 1, DAMAGED, OTHER, SILENT } happening;

/* Every status, and what it is to the machine. */
static const struct {
    hg_status status;
    happening kind;
} events[] = {{HG_OK, GOOD},          {HG_E_CRC, DAMAGED},   {HG_E_FORMAT, DAMAGED}, {HG_E_EMPTY, SILENT}, {HG_E_REPEATED, OTHER},
              {HG_E_SEQUENCE, OTHER}, {HG_E_STAMP, OTHER},   {HG_E_STATE, OTHER}};

typedef struct {
    hg_e2e_state state;
    happening    seen[WINDOW_MAX]; /* latest first */
    size_t       n;
} reference_machine;

static void forget(reference_machine *self, size_t window)
{
    self->n = (self->n > window) ? window : self->n;
}

static unsigned times(const reference_machine *self, happening kind)
{
    unsigned found = 0U;
    for (size_t i = 0U; i < self->n; i++) {
        found += (self->seen[i] == kind) ? 1U : 0U;
    }
    return found;
}

static bool within_limit(const reference_machine *self, const hg_e2e_limit *limit)
{
    return (times(self, GOOD) >= limit->ok) && (times(self, DAMAGED) <= limit->error);
}

static void see(reference_machine *self, happening kind, size_t window)
{
    for (size_t i = WINDOW_MAX - 1U; i > 0U; i--) {
        self->seen[i] = self->seen[i - 1U];
    }
    self->seen[0] = kind;
    self->n++;
    forget(self, window);
}

static void reference_fall(reference_machine *self, const hg_e2e_limits *l)
{
    self->state = HG_E2E_INVALID;
    forget(self, l->clear ? 0U : l->invalid.window);
}

static void reference_rise(reference_machine *self, const hg_e2e_limits *l)
{
    self->state = HG_E2E_VALID;
    forget(self, l->valid.window);
}

static void reference_step(reference_machine *self, const hg_e2e_limits *l, happening kind)
{
    if (self->state == HG_E2E_NODATA) {
        if ((kind == GOOD) || (kind == OTHER)) {
            self->state = HG_E2E_INIT; /* whose window begins empty */
        }
    } else if (self->state == HG_E2E_INIT) {
        see(self, kind, l->init.window);
        if (within_limit(self, &l->init)) {
            reference_rise(self, l);
        } else if (times(self, DAMAGED) > l->init.error) {
            reference_fall(self, l);
        }
    } else if (self->state == HG_E2E_VALID) {
        see(self, kind, l->valid.window);
        if (!within_limit(self, &l->valid)) {
            reference_fall(self, l);
        }
    } else if (self->state == HG_E2E_INVALID) {
        see(self, kind, l->invalid.window);
        if (within_limit(self, &l->invalid)) {
            reference_rise(self, l);
        }
    }
}

static hg_e2e_limit drawn_limit(uint32_t *random)
{
    const int32_t window = draw_between(random, 1, WINDOW_MAX);
    const int32_t some = (window < 4) ? window : 4; /* often few, so that every state is left again */
    const bool few = (draw(random) % 2U) == 0U;
    return (hg_e2e_limit){.window = (uint8_t)window,
                          .ok = (uint8_t)draw_between(random, 0, few ? some : window),
                          .error = (uint8_t)draw_between(random, 0, few ? some : window)};
}

static void the_machine_agrees_with_its_reference(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(37U);
    unsigned moves[5][5] = {{0U}};
    for (unsigned run = 0U; run < 4000U; run++) {
        const hg_e2e_limits l = {.init = drawn_limit(&random),
                                 .valid = drawn_limit(&random),
                                 .invalid = drawn_limit(&random),
                                 .clear = (draw(&random) % 2U) == 0U};
        hg_e2e_machine self;
        reference_machine reference = {.state = HG_E2E_NODATA};
        hg_e2e_machine_start(&self);
        const unsigned good = draw(&random) % 100U; /* percent */
        for (unsigned i = 0U; i < 100U; i++) {
            const size_t which = ((draw(&random) % 100U) < good) ? 0U : (draw(&random) % COUNT(events));
            const hg_e2e_state before = reference.state;
            reference_step(&reference, &l, events[which].kind);
            const hg_e2e_state after = hg_e2e_machine_step(&self, &l, events[which].status);
            assert_int_equal(reference.state, after);
            assert_int_equal(after, self.state);
            moves[before][after]++;
        }
    }
    static const hg_e2e_state edges[][2] = {{HG_E2E_NODATA, HG_E2E_NODATA}, {HG_E2E_NODATA, HG_E2E_INIT},  {HG_E2E_INIT, HG_E2E_INIT},
                                            {HG_E2E_INIT, HG_E2E_VALID},    {HG_E2E_INIT, HG_E2E_INVALID}, {HG_E2E_VALID, HG_E2E_VALID},
                                            {HG_E2E_VALID, HG_E2E_INVALID}, {HG_E2E_INVALID, HG_E2E_VALID}, {HG_E2E_INVALID, HG_E2E_INVALID}};
    unsigned all = 0U;
    for (size_t i = 0U; i < COUNT(edges); i++) {
        const unsigned often = moves[edges[i][0]][edges[i][1]];
        assert_true(often > 100U);
        all += often;
    }
    assert_count(400000, all); /* and no other way */
}

static void a_machine_that_was_not_started_stays_so(void **state)
{
    (void)state;
    hg_e2e_machine self = {.state = HG_E2E_DEINIT};
    for (size_t i = 0U; i < 40U; i++) {
        assert_int_equal(HG_E2E_DEINIT, hg_e2e_machine_step(&self, &hg_e2e_limits_default, events[i % COUNT(events)].status));
    }
    hg_e2e_machine lost = {.state = (hg_e2e_state)77, .ok = 3U, .error = 3U};
    assert_int_equal(77, hg_e2e_machine_step(&lost, &hg_e2e_limits_default, HG_OK));
    assert_int_equal(0, lost.ok); /* and counts nothing */
    assert_int_equal(0, lost.error);
    hg_e2e_machine_start(&self);
    assert_int_equal(HG_E2E_NODATA, self.state);
    assert_int_equal(HG_E2E_INIT, hg_e2e_machine_step(&self, &hg_e2e_limits_default, HG_OK));
}

static void feed(hg_e2e_machine *self, const hg_e2e_limits *l, hg_status event, unsigned often, hg_e2e_state expected)
{
    for (unsigned i = 0U; i < often; i++) {
        assert_int_equal(expected, hg_e2e_machine_step(self, l, event));
    }
}

static void the_default_limits_do_what_they_say(void **state)
{
    (void)state;
    const hg_e2e_limits *l = &hg_e2e_limits_default;
    hg_e2e_machine self;
    hg_e2e_machine_start(&self);
    feed(&self, l, HG_E_EMPTY, 20U, HG_E2E_NODATA);
    feed(&self, l, HG_E_CRC, 20U, HG_E2E_NODATA);
    feed(&self, l, HG_OK, 1U, HG_E2E_INIT);
    feed(&self, l, HG_OK, 1U, HG_E2E_VALID);
    feed(&self, l, HG_E_EMPTY, 7U, HG_E2E_VALID); /* at least 1 good in 8 */
    feed(&self, l, HG_E_EMPTY, 3U, HG_E2E_INVALID);
    feed(&self, l, HG_OK, 1U, HG_E2E_INVALID); /* 2 good ones lead back */
    feed(&self, l, HG_OK, 1U, HG_E2E_VALID);
    feed(&self, l, HG_E_FORMAT, 3U, HG_E2E_VALID); /* 3 damaged ones in 8 may be */
    feed(&self, l, HG_E_CRC, 1U, HG_E2E_INVALID);
    feed(&self, l, HG_OK, 5U, HG_E2E_INVALID); /* 8 events back there are still more than 2 */
    feed(&self, l, HG_OK, 1U, HG_E2E_VALID);
    hg_e2e_machine_start(&self);
    feed(&self, l, HG_E_SEQUENCE, 20U, HG_E2E_INIT); /* a frame came, none was good */
    feed(&self, l, HG_E_CRC, 2U, HG_E2E_INIT);
    feed(&self, l, HG_E_CRC, 1U, HG_E2E_INVALID);
    hg_e2e_limits forgetful = *l;
    forgetful.clear = true;
    hg_e2e_machine_start(&self);
    feed(&self, &forgetful, HG_OK, 1U, HG_E2E_INIT);
    feed(&self, &forgetful, HG_OK, 1U, HG_E2E_VALID);
    feed(&self, &forgetful, HG_E_CRC, 3U, HG_E2E_VALID);
    feed(&self, &forgetful, HG_E_CRC, 1U, HG_E2E_INVALID);
    feed(&self, &forgetful, HG_OK, 1U, HG_E2E_INVALID);
    feed(&self, &forgetful, HG_OK, 1U, HG_E2E_VALID); /* the damaged ones are forgotten */
}

/* The window of INIT begins with INIT: neither the frame that led there nor what was before it counts. */
static void what_came_before_init_does_not_count_in_it(void **state)
{
    (void)state;
    const hg_e2e_limits *l = &hg_e2e_limits_default;
    hg_e2e_machine self;
    hg_e2e_machine_start(&self);
    feed(&self, l, HG_OK, 1U, HG_E2E_INIT);
    feed(&self, l, HG_E_EMPTY, 3U, HG_E2E_INIT);
    feed(&self, l, HG_OK, 1U, HG_E2E_VALID);
    hg_e2e_machine_start(&self);
    feed(&self, l, HG_E_CRC, 1U, HG_E2E_NODATA);
    feed(&self, l, HG_OK, 1U, HG_E2E_INIT);
    feed(&self, l, HG_OK, 1U, HG_E2E_VALID);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(check_values_of_the_catalogue_come_out),
        cmocka_unit_test(examples_of_the_standard_come_out),
        cmocka_unit_test(every_layout_agrees_with_the_references),
        cmocka_unit_test(the_protection_writes_where_it_owns_and_nowhere_else),
        cmocka_unit_test(without_a_place_for_a_stamp_none_is_written_or_read),
        cmocka_unit_test(the_counter_has_its_modulus),
        cmocka_unit_test(frames_too_short_for_a_place_or_too_long_are_refused),
        cmocka_unit_test(only_the_right_checksum_is_good),
        cmocka_unit_test(frames_of_another_identifier_are_refused),
        cmocka_unit_test(a_counter_of_15_is_damage_in_p01_and_p11_alone),
        cmocka_unit_test(another_nibble_is_damage_though_the_checksum_is_good),
        cmocka_unit_test(with_the_checksum_ignored_a_damaged_frame_is_read),
        cmocka_unit_test(only_places_apart_and_inside_are_valid),
        cmocka_unit_test(places_far_outside_are_refused),
        cmocka_unit_test(places_off_their_boundary_are_refused),
        cmocka_unit_test(missing_tables_and_unknown_kinds_are_refused),
        cmocka_unit_test(limits_outside_their_ranges_are_refused),
        cmocka_unit_test(the_first_frame_is_in_sequence),
        cmocka_unit_test(the_counter_may_move_as_far_as_the_time_allows),
        cmocka_unit_test(the_last_frame_once_more_changes_nothing),
        cmocka_unit_test(without_a_counter_every_frame_is_in_sequence_and_none_continues),
        cmocka_unit_test(two_receivers_do_not_know_of_each_other),
        cmocka_unit_test(after_a_jump_frames_are_refused_until_they_are_in_sequence),
        cmocka_unit_test(the_sequence_agrees_with_its_reference),
        cmocka_unit_test(the_loss_told_is_the_true_one),
        cmocka_unit_test(the_machine_agrees_with_its_reference),
        cmocka_unit_test(a_machine_that_was_not_started_stays_so),
        cmocka_unit_test(the_default_limits_do_what_they_say),
        cmocka_unit_test(what_came_before_init_does_not_count_in_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
