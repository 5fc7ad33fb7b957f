/** @file
 *  frame.h: codes to bytes and back. The golden bytes were written down by hand from the DBC conventions. */
#include "support.h"

#include "hullguard/e2e.h"
#include "hullguard/frame.h"

static const uint8_t ids[HG_E2E_IDS] = {0U};
static const hg_e2e_config p22 = {.profile = HG_E2E_P22, .data_ids = ids, .crc = 0U, .counter = 8U, .stamp = 12U, .limits = &hg_e2e_limits_default};

static hg_code_scale scale_of(double resolution, int32_t minimum, int32_t maximum)
{
    return (hg_code_scale){.resolution = R(resolution), .offset = R(0), .per_unit = R(1.0 / resolution), .minimum = minimum,
        .maximum = maximum};
}

/* A classic frame of 8 bytes with one field. */
static hg_message message_of(const hg_field *field, const hg_code_scale *scale)
{
    return (hg_message){.id = 0x123U, .flags = 0U, .length = 8U, .width = 1U, .field = field, .scale = scale, .e2e = &p22};
}

/* Every code that a field can carry beside its invalid pattern. */
static hg_code_scale whole_range(const hg_field *field)
{
    const int64_t top = (int64_t)1 << (field->length - (((field->flags & HG_FIELD_SIGNED) != 0U) ? 1 : 0));
    return ((field->flags & HG_FIELD_SIGNED) != 0U) ? scale_of(1.0, (int32_t)(1 - top), (int32_t)(top - 1)) : scale_of(1.0, 0,
        (int32_t)(top - 2));
}

static void golden_bytes_come_out_and_go_back_in(void **state)
{
    (void)state;
    const struct {
        hg_field field;
        int32_t  code;
        uint8_t  bytes[8];
    } golden[] = {
        {{16U, 16U, 0U}, 0x1234, {0, 0, 0x34, 0x12}},
        {{20U, 12U, 0U}, 0xABC, {0, 0, 0xC0, 0xAB}},
        {{27U, 3U, 0U}, 5, {0, 0, 0, 0x28}},
        {{33U, 31U, 0U}, 0x40000001, {0, 0, 0, 0, 0x02, 0, 0, 0x80}},
        {{16U, 12U, HG_FIELD_SIGNED}, -1, {0, 0, 0xFF, 0x0F}},
        {{16U, 12U, HG_FIELD_SIGNED}, -2047, {0, 0, 0x01, 0x08}},
        {{16U, 12U, HG_FIELD_SIGNED}, HG_CODE_INVALID, {0, 0, 0x00, 0x08}},
        {{16U, 12U, 0U}, HG_CODE_INVALID, {0, 0, 0xFF, 0x0F}},
        {{32U, 32U, HG_FIELD_SIGNED}, -2, {0, 0, 0, 0, 0xFE, 0xFF, 0xFF, 0xFF}},
        {{32U, 32U, HG_FIELD_SIGNED}, HG_CODE_INVALID, {0, 0, 0, 0, 0, 0, 0, 0x80}},
        {{23U, 16U, HG_FIELD_MOTOROLA}, 0x1234, {0, 0, 0x12, 0x34}},
        {{19U, 12U, HG_FIELD_MOTOROLA}, 0xABC, {0, 0, 0x0A, 0xBC}},
        {{21U, 5U, HG_FIELD_MOTOROLA}, 0x16, {0, 0, 0x2C}},
        {{16U, 9U, HG_FIELD_MOTOROLA}, 0x155, {0, 0, 0x01, 0x55}},
        {{23U, 12U, HG_FIELD_MOTOROLA | HG_FIELD_SIGNED}, -2, {0, 0, 0xFF, 0xE0}},
        {{23U, 12U, HG_FIELD_MOTOROLA | HG_FIELD_SIGNED}, HG_CODE_INVALID, {0, 0, 0x80, 0x00}},
        {{39U, 32U, HG_FIELD_MOTOROLA | HG_FIELD_SIGNED}, 0x12345678, {0, 0, 0, 0, 0x12, 0x34, 0x56, 0x78}},
        {{16U, 32U, HG_FIELD_FLOAT32}, 1, {0, 0, 0x00, 0x00, 0x80, 0x3F}},
        {{23U, 32U, HG_FIELD_FLOAT32 | HG_FIELD_MOTOROLA}, 1, {0, 0, 0x3F, 0x80, 0x00, 0x00}},
        {{16U, 32U, HG_FIELD_FLOAT32 | HG_FIELD_SIGNED}, -100, {0, 0, 0x00, 0x00, 0xC8, 0xC2}},
        {{16U, 32U, HG_FIELD_FLOAT32}, HG_CODE_INVALID, {0, 0, 0x00, 0x00, 0xC0, 0x7F}},
        {{23U, 32U, HG_FIELD_FLOAT32 | HG_FIELD_MOTOROLA}, HG_CODE_INVALID, {0, 0, 0x7F, 0xC0, 0x00, 0x00}},
    };
    for (size_t i = 0U; i < COUNT(golden); i++) {
        const hg_code_scale scale =
            ((golden[i].field.flags & HG_FIELD_FLOAT32) != 0U) ? scale_of(1.0, -1000, 1000) : whole_range(&golden[i].field);
        const hg_message message = message_of(&golden[i].field, &scale);
        hg_can_frame frame;
        int32_t code[2];
        arm_codes(code, 2U);
        (void)memset(&frame, 0x5A, sizeof(frame));
        assert_true(hg_frame_valid(&message));
        hg_frame_pack(&message, &golden[i].code, &frame);
        assert_memory_equal(golden[i].bytes, frame.data, 8U);
        assert_count(0x123, frame.id);
        assert_int_equal(0, frame.flags);
        assert_int_equal(8, frame.length);
        for (size_t j = 8U; j < sizeof(frame.data); j++) {
            assert_int_equal(0, frame.data[j]);
        }
        assert_status(HG_OK, hg_frame_unpack(&message, &frame, code));
        assert_int_equal(golden[i].code, code[0]);
        assert_codes_untouched(&code[1], 1U);
    }
}

/* Where the next less significant bit lies: Motorola fields saw-tooth through the bytes. */
static unsigned below(unsigned bit, bool motorola)
{
    if (!motorola) {
        return bit - 1U;
    }
    return ((bit % 8U) == 0U) ? (bit + 15U) : (bit - 1U);
}

/* All fields up to 10 bits, every place, order and sign, every pattern: the bits stand where a DBC puts them, and come back. */
static void small_fields_survive_exhaustively(void **state)
{
    (void)state;
    unsigned long tried = 0UL;
    for (uint8_t flags = 0U; flags < 4U; flags++) {
        const bool motorola = (flags & HG_FIELD_MOTOROLA) != 0U;
        for (uint8_t length = 1U; length <= 10U; length++) {
            for (uint16_t start = 0U; start < 80U; start++) {
                const hg_field field = {.start = start, .length = length, .flags = flags};
                const hg_code_scale scale = whole_range(&field);
                const hg_message message = message_of(&field, &scale);
                unsigned place[10];
                bool inside = true;
                unsigned bit = motorola ? start : ((unsigned)start + length - 1U);
                for (unsigned i = 0U; i < length; i++) {
                    place[i] = bit;
                    inside = inside && (bit >= 16U) && (bit < 64U);
                    bit = below(bit, motorola);
                }
                assert_int_equal(inside, hg_frame_valid(&message));
                for (uint32_t pattern = 0U; inside && (pattern < (1UL << length)); pattern++) {
                    hg_can_frame frame = {.id = 0x123U, .length = 8U};
                    hg_can_frame again;
                    int32_t code = CANARY_CODE;
                    for (unsigned i = 0U; i < length; i++) {
                        const uint32_t one = (pattern >> (length - 1U - i)) & 1U;
                        frame.data[place[i] / 8U] |= (uint8_t)(one << (place[i] % 8U));
                    }
                    assert_status(HG_OK, hg_frame_unpack(&message, &frame, &code));
                    const bool negative = ((flags & HG_FIELD_SIGNED) != 0U) && ((pattern >> (length - 1U)) != 0U);
                    const int32_t plain = (int32_t)pattern - (negative ? (int32_t)(1L << length) : 0);
                    const uint32_t none = ((flags & HG_FIELD_SIGNED) != 0U) ? (1U << (length - 1U)) : ((1U << length) - 1U);
                    assert_int_equal((pattern == none) ? HG_CODE_INVALID : plain, code);
                    hg_frame_pack(&message, &code, &again);
                    assert_memory_equal(frame.data, again.data, sizeof(frame.data));
                    tried++;
                }
            }
        }
    }
    print_message("%lu fields\n", tried);
}

static void every_length_carries_its_extremes(void **state)
{
    (void)state;
    for (uint8_t flags = 0U; flags < 4U; flags++) {
        const bool is_signed = (flags & HG_FIELD_SIGNED) != 0U;
        for (uint8_t length = 1U; length <= (is_signed ? 32U : 31U); length++) {
            const hg_field field = {.start = ((flags & HG_FIELD_MOTOROLA) != 0U) ? 19U : 21U, .length = length, .flags = flags};
            const hg_code_scale scale = whole_range(&field);
            const hg_message message = message_of(&field, &scale);
            assert_true(hg_frame_valid(&message));
            int32_t codes[68];
            size_t n = 0U;
            codes[n++] = scale.minimum;
            codes[n++] = scale.maximum;
            codes[n++] = HG_CODE_INVALID;
            for (uint8_t bit = 0U; bit < 31U; bit++) {
                codes[n++] = (int32_t)(1UL << bit);
                codes[n++] = -(int32_t)(1UL << bit);
            }
            for (size_t i = 0U; i < n; i++) {
                hg_can_frame frame;
                int32_t code = CANARY_CODE;
                hg_frame_pack(&message, &codes[i], &frame);
                assert_status(HG_OK, hg_frame_unpack(&message, &frame, &code));
                /* what does not fit is sent as invalid, never as another number */
                assert_int_equal(hg_code_valid(&scale, codes[i]) ? codes[i] : HG_CODE_INVALID, code);
            }
        }
    }
}

static void an_integer_outside_the_scale_is_refused(void **state)
{
    (void)state;
    const hg_field fields[2] = {{16U, 8U, HG_FIELD_SIGNED}, {24U, 8U, HG_FIELD_SIGNED}};
    const hg_code_scale scales[2] = {scale_of(1.0, -10, 20), scale_of(1.0, -10, 20)};
    const hg_message message = {.id = 1U, .length = 8U, .width = 2U, .field = fields, .scale = scales, .e2e = &p22};
    for (int32_t a = -128; a < 128; a++) {
        hg_can_frame frame = {.id = 1U, .length = 8U};
        int32_t code[2];
        arm_codes(code, 2U);
        frame.data[3] = (uint8_t)a;
        const hg_status status = hg_frame_unpack(&message, &frame, code);
        if (a == -128) {
            assert_status(HG_OK, status);
            assert_int_equal(HG_CODE_INVALID, code[1]);
        } else if ((a >= -10) && (a <= 20)) {
            assert_status(HG_OK, status);
            assert_int_equal(0, code[0]);
            assert_int_equal(a, code[1]);
        } else {
            assert_status(HG_E_NUMERIC, status);
            assert_codes_untouched(code, 2U); /* the good first signal either */
        }
    }
}

static void a_float_that_is_no_value_is_refused(void **state)
{
    (void)state;
    const hg_field field = {16U, 32U, HG_FIELD_FLOAT32};
    const hg_code_scale scale = scale_of(0.5, -100, 100);
    const hg_message message = message_of(&field, &scale);
    const struct { uint32_t pattern; hg_status status; int32_t code; } cases[] = {
        {0x7FC00000UL, HG_OK, HG_CODE_INVALID},    /* the quiet NaN that says so */
        {0x7FC00001UL, HG_E_NUMERIC, CANARY_CODE}, /* another NaN */
        {0xFFC00000UL, HG_E_NUMERIC, CANARY_CODE}, {0x7F800001UL, HG_E_NUMERIC, CANARY_CODE},
        {0x7F800000UL, HG_E_NUMERIC, CANARY_CODE}, /* infinity */
        {0xFF800000UL, HG_E_NUMERIC, CANARY_CODE}, {0x7F7FFFFFUL, HG_E_NUMERIC, CANARY_CODE},
        {0x42480000UL, HG_OK, 100},                /* 50 */
        {0x424A0000UL, HG_E_NUMERIC, CANARY_CODE}, /* 50.5 */
        {0xC2480000UL, HG_OK, -100}, {0x00000001UL, HG_OK, 0}, {0x80000000UL, HG_OK, 0}};
    for (size_t i = 0U; i < COUNT(cases); i++) {
        hg_can_frame frame = {.id = 0x123U, .length = 8U};
        int32_t code = CANARY_CODE;
        for (uint8_t b = 0U; b < 4U; b++) { /* lowest byte first, whatever the processor's order is */
            frame.data[2U + b] = (uint8_t)(cases[i].pattern >> (8U * b));
        }
        assert_status(cases[i].status, hg_frame_unpack(&message, &frame, &code));
        assert_int_equal(cases[i].code, code);
    }
}

static void only_the_exact_kind_of_frame_matches(void **state)
{
    (void)state;
    const hg_field field = {16U, 8U, 0U};
    const hg_code_scale scale = scale_of(1.0, 0, 200);
    hg_message message = message_of(&field, &scale);
    hg_can_frame right;
    const int32_t seven = 7;
    hg_frame_pack(&message, &seven, &right);
    assert_true(hg_frame_matches(&message, &right));
    const uint8_t kinds[] = {HG_CAN_EXTENDED, HG_CAN_REMOTE, HG_CAN_FD, HG_CAN_ERROR};
    for (size_t i = 0U; i < COUNT(kinds); i++) {
        hg_can_frame wrong = right;
        int32_t code = CANARY_CODE;
        wrong.flags = kinds[i];
        assert_false(hg_frame_matches(&message, &wrong));
        assert_status(HG_E_FORMAT, hg_frame_unpack(&message, &wrong, &code));
        assert_codes_untouched(&code, 1U);
    }
    hg_can_frame wrong = right;
    wrong.id = 0x124U;
    assert_false(hg_frame_matches(&message, &wrong));
    for (uint32_t length = 0U; length < 256U; length++) {
        wrong = right;
        wrong.length = (uint8_t)length;
        assert_int_equal(length == 8U, hg_frame_matches(&message, &wrong));
    }
    message.flags = HG_CAN_FD | HG_CAN_EXTENDED;
    wrong = right;
    assert_false(hg_frame_matches(&message, &wrong));
    wrong.flags = HG_CAN_FD | HG_CAN_EXTENDED | HG_CAN_BRS; /* the bit-rate switch is not looked at */
    assert_true(hg_frame_matches(&message, &wrong));
}

/* As many signals as there may be, of two bits each. */
static void the_widest_message_is_valid(void **state)
{
    (void)state;
    static hg_field field[HG_GROUP_SIGNALS_MAX];
    static hg_code_scale scale[HG_GROUP_SIGNALS_MAX];
    for (uint8_t g = 0U; g < HG_GROUP_SIGNALS_MAX; g++) {
        field[g] = (hg_field){(uint16_t)(16U + (2U * g)), 2U, 0U};
        scale[g] = scale_of(1.0, 0, 2);
    }
    hg_message m = message_of(field, scale);
    m.flags = HG_CAN_FD;
    m.length = 64U;
    m.width = HG_GROUP_SIGNALS_MAX;
    assert_true(hg_frame_valid(&m));
    m.width = HG_GROUP_SIGNALS_MAX + 1U;
    assert_false(hg_frame_valid(&m));
}

/* A field of no bits carries not even a signal that is always 0. */
static void a_field_of_no_bits_is_invalid(void **state)
{
    (void)state;
    const hg_code_scale scale = scale_of(1.0, 0, 0);
    static const uint8_t flags[] = {0U, HG_FIELD_SIGNED};
    for (size_t i = 0U; i < COUNT(flags); i++) {
        hg_field field = {16U, 1U, flags[i]};
        const hg_message m = message_of(&field, &scale);
        assert_true(hg_frame_valid(&m));
        field.length = 0U;
        assert_false(hg_frame_valid(&m));
    }
}

static void messages_that_no_frame_can_carry_are_invalid(void **state)
{
    (void)state;
    const hg_field good = {16U, 8U, 0U};
    const hg_code_scale scale = scale_of(1.0, 0, 200);
    const hg_message usual = message_of(&good, &scale);
    hg_message m = usual;
    assert_true(hg_frame_valid(&m));
    m = usual, m.e2e = NULL;
    assert_false(hg_frame_valid(&m));
    m = usual, m.width = (uint8_t)(HG_GROUP_SIGNALS_MAX + 1U);
    assert_false(hg_frame_valid(&m));
    m = usual, m.field = NULL;
    assert_false(hg_frame_valid(&m));
    m = usual, m.scale = NULL;
    assert_false(hg_frame_valid(&m));
    m = usual, m.width = 0U, m.field = NULL, m.scale = NULL;
    assert_true(hg_frame_valid(&m));
    m = usual, m.id = 0x7FFU;
    assert_true(hg_frame_valid(&m));
    m.id = 0x800U;
    assert_false(hg_frame_valid(&m));
    m.flags = HG_CAN_EXTENDED;
    assert_true(hg_frame_valid(&m));
    m.id = 0x1FFFFFFFU;
    assert_true(hg_frame_valid(&m));
    m.id = 0x20000000U;
    assert_false(hg_frame_valid(&m));
    for (uint32_t length = 0U; length < 256U; length++) {
        m = usual, m.width = 0U, m.length = (uint8_t)length;
        assert_int_equal((length >= 2U) && (length <= 8U), hg_frame_valid(&m));
        m.flags = HG_CAN_FD;
        const bool fd = ((length >= 2U) && (length <= 8U)) || (length == 12U) || (length == 16U) || (length == 20U) ||
            (length == 24U) || (length == 32U) || (length == 48U) || (length == 64U);
        assert_int_equal(fd, hg_frame_valid(&m));
    }
    for (int exponent = INT8_MIN; exponent <= INT8_MAX; exponent++) {
        hg_code_scale other = scale;
        m = usual, m.scale = &other;
        other.exponent = (int8_t)exponent;
        assert_int_equal(exponent == 0, hg_frame_valid(&m)); /* only scales of Q31 carry a power of two */
    }
}

static void fields_outside_the_frame_or_of_no_type_are_invalid(void **state)
{
    (void)state;
    const hg_code_scale scale = scale_of(1.0, 0, 0);
    const struct { hg_field field; bool valid; } cases[] = {
        {{16U, 0U, 0U}, false}, {{16U, 1U, 0U}, true}, {{16U, 31U, 0U}, true}, {{16U, 32U, 0U}, false}, {{16U, 32U, HG_FIELD_SIGNED}, true},
        {{16U, 33U, HG_FIELD_SIGNED}, false}, {{16U, 255U, HG_FIELD_SIGNED}, false}, {{16U, 31U, HG_FIELD_FLOAT32}, false},
        {{16U, 32U, HG_FIELD_FLOAT32}, true}, {{15U, 8U, 0U}, false}, {{0U, 8U, 0U}, false}, {{56U, 8U, 0U}, true}, {{57U, 8U, 0U}, false},
        {{63U, 1U, 0U}, true}, {{64U, 1U, 0U}, false}, {{65535U, 8U, 0U}, false}, {{65535U, 31U, HG_FIELD_MOTOROLA}, false},
        {{23U, 8U, HG_FIELD_MOTOROLA}, true}, {{15U, 8U, HG_FIELD_MOTOROLA}, false}, {{8U, 9U, HG_FIELD_MOTOROLA}, false},
        {{63U, 8U, HG_FIELD_MOTOROLA}, true}, {{62U, 8U, HG_FIELD_MOTOROLA}, false}, {{63U, 9U, HG_FIELD_MOTOROLA}, false}};
    for (size_t i = 0U; i < COUNT(cases); i++) {
        const hg_message message = message_of(&cases[i].field, &scale);
        assert_int_equal(cases[i].valid, hg_frame_valid(&message));
    }
}

/* Otherwise a code would be cut to the field's bits and come out as another number. */
static void a_scale_wider_than_its_field_is_invalid(void **state)
{
    (void)state;
    const struct { hg_field field; int32_t minimum; int32_t maximum; bool valid; } cases[] = {
        {{16U, 8U, 0U}, 0, 254, true}, {{16U, 8U, 0U}, 0, 255, false}, {{16U, 8U, 0U}, -1, 10, false},
        {{16U, 8U, HG_FIELD_SIGNED}, -127, 127, true}, {{16U, 8U, HG_FIELD_SIGNED}, -128, 127, false}, {{16U, 8U, HG_FIELD_SIGNED}, 0,
            128, false},
        {{16U, 31U, 0U}, 0, INT32_MAX - 1, true}, {{16U, 31U, 0U}, 0, INT32_MAX, false},
        {{16U, 32U, HG_FIELD_SIGNED}, -INT32_MAX, INT32_MAX, true}, {{16U, 32U, HG_FIELD_FLOAT32}, -INT32_MAX, INT32_MAX, true}};
    for (size_t i = 0U; i < COUNT(cases); i++) {
        const hg_code_scale scale = scale_of(1.0, cases[i].minimum, cases[i].maximum);
        const hg_message message = message_of(&cases[i].field, &scale);
        assert_int_equal(cases[i].valid, hg_frame_valid(&message));
    }
}

static void many_signals_share_a_long_frame(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(13U);
    hg_field fields[30];
    hg_code_scale scales[30];
    for (uint16_t i = 0U; i < 30U; i++) {
        fields[i] = (hg_field){.start = (uint16_t)(16U + (8U * i) + (((i % 2U) == 1U) ? 7U : 0U)), .length = 8U,
            .flags = ((i % 2U) == 1U) ? HG_FIELD_MOTOROLA : 0U};
        scales[i] = scale_of(1.0, 0, 254);
    }
    const hg_message message = {
        .id = 0x12345U, .flags = HG_CAN_EXTENDED | HG_CAN_FD | HG_CAN_BRS, .length = 32U, .width = 30U, .field = fields,
            .scale = scales, .e2e = &p22};
    assert_true(hg_frame_valid(&message));
    for (int i = 0; i < 1000; i++) {
        int32_t code[30];
        int32_t again[31];
        hg_can_frame frame;
        arm_codes(again, 31U);
        for (size_t j = 0U; j < 30U; j++) {
            code[j] = draw_between(&random, 0, 254);
        }
        hg_frame_pack(&message, code, &frame);
        assert_int_equal(HG_CAN_EXTENDED | HG_CAN_FD | HG_CAN_BRS, frame.flags);
        for (size_t j = 0U; j < 30U; j++) {
            assert_int_equal(code[j], frame.data[2U + j]);
        }
        assert_status(HG_OK, hg_frame_unpack(&message, &frame, again));
        assert_memory_equal(code, again, sizeof(code));
        assert_codes_untouched(&again[30], 1U);
    }
}

static void a_frame_of_64_bytes_carries_signals_to_its_end(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(36U);
    hg_field fields[31];
    hg_code_scale scales[31];
    for (size_t j = 0U; j < COUNT(fields); j++) {
        fields[j] = (hg_field){.start = (uint16_t)(16U + (16U * j)), .length = 16U, .flags = HG_FIELD_SIGNED};
        scales[j] = scale_of(1.0, -32767, 32767);
    }
    hg_message message = {.id = 0x123U, .flags = HG_CAN_FD | HG_CAN_BRS, .length = 64U, .width = 31U, .field = fields, .scale = scales,
        .e2e = &p22};
    assert_true(hg_frame_valid(&message));
    for (int i = 0; i < 200; i++) {
        int32_t code[31];
        int32_t again[31];
        hg_can_frame frame;
        for (size_t j = 0U; j < COUNT(code); j++) {
            code[j] = draw_between(&random, -32767, 32767);
        }
        hg_frame_pack(&message, code, &frame);
        assert_int_equal((uint32_t)code[30] & 0xFFU, frame.data[62]);
        assert_status(HG_OK, hg_frame_unpack(&message, &frame, again));
        assert_memory_equal(code, again, sizeof(code));
    }
    message.length = 48U;
    assert_false(hg_frame_valid(&message));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(golden_bytes_come_out_and_go_back_in),
        cmocka_unit_test(small_fields_survive_exhaustively),
        cmocka_unit_test(every_length_carries_its_extremes),
        cmocka_unit_test(an_integer_outside_the_scale_is_refused),
        cmocka_unit_test(a_float_that_is_no_value_is_refused),
        cmocka_unit_test(only_the_exact_kind_of_frame_matches),
        cmocka_unit_test(the_widest_message_is_valid),
        cmocka_unit_test(a_field_of_no_bits_is_invalid),
        cmocka_unit_test(messages_that_no_frame_can_carry_are_invalid),
        cmocka_unit_test(fields_outside_the_frame_or_of_no_type_are_invalid),
        cmocka_unit_test(a_scale_wider_than_its_field_is_invalid),
        cmocka_unit_test(many_signals_share_a_long_frame),
        cmocka_unit_test(a_frame_of_64_bytes_carries_signals_to_its_end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
