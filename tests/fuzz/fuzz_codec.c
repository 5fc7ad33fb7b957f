/* frame.h, code.h: any layout that hg_frame_valid() accepts, there and back, beside a second reading of the layout bit by bit. */
#include "fuzz.h"

#include "hullguard/frame.h"

#define WIDTH 6U
#define BITS (8U * HG_CAN_DATA_MAX)

static const hg_status unpack_answers[] = {HG_OK, HG_E_FORMAT, HG_E_NUMERIC};

typedef struct {
    uint8_t       ids[HG_E2E_IDS];
    hg_e2e_config rule;
    hg_field      field[WIDTH];
    hg_code_scale scale[WIDTH];
    uint8_t       idle[HG_CAN_DATA_MAX];
    hg_message    message;
    bool          taken[BITS];  /* by a field */
    bool          apart;        /* no two fields overlap */
} layout;

static hg_code_scale take_scale(source *s)
{
    static const double resolutions[] = {1.0, 0.5, 0.01, 0.001, 3.0e-7, 250.0, 1.0e30, 1.0e-30};
    hg_code_scale scale = {.resolution = (hg_real)resolutions[take_below(s, 8U)], .offset = HG_REAL_ZERO};
    scale.per_unit = HG_REAL_C(1.0) / scale.resolution;
    if ((take8(s) & 1U) != 0U) {
        scale.offset = (hg_real)(int8_t)take8(s);
    }
    const int32_t a = (int32_t)(take32(s) >> take_below(s, 32U));
    scale.minimum = ((take8(s) & 1U) != 0U) ? 0 : -(a & INT32_MAX);
    scale.maximum = (int32_t)((take32(s) >> (1U + take_below(s, 31U))) & INT32_MAX);
    return scale;
}

/* Bit i of a field, least significant first, in DBC terms: a Motorola field's start is its most significant bit, and goes down the byte, then
   to bit 7 of the next. */
static unsigned place(const hg_field *field, unsigned i)
{
    unsigned bit = field->start + i;
    if ((field->flags & HG_FIELD_MOTOROLA) != 0U) {
        bit = field->start;
        for (unsigned left = field->length - 1U - i; left > 0U; left--) {
            bit = ((bit % 8U) == 0U) ? (bit + 15U) : (bit - 1U);
        }
    }
    return bit;
}

static void take_layout(source *s, layout *l)
{
    (void)memset(l, 0, sizeof(*l));
    l->rule = (hg_e2e_config){.profile = (hg_e2e_profile)(1U + take_below(s, 6U)), .mode = (hg_e2e_id_mode)(1U + take_below(s, 4U)), .data_id = take16(s),
                              .data_ids = l->ids, .crc = take_below(s, 64U), .counter = (uint16_t)(8U * take_below(s, 64U)), .nibble = (uint16_t)(4U * take_below(s, 128U)),
                              .stamp = HG_E2E_NO_STAMP, .limits = &hg_e2e_limits_default};
    l->message = (hg_message){.id = take32(s) >> take_below(s, 32U), .flags = take_below(s, 32U), .length = take_below(s, 66U), .width = take_below(s, WIDTH + 1U),
                              .field = l->field, .scale = l->scale, .e2e = &l->rule, .idle = ((take8(s) & 1U) != 0U) ? l->idle : NULL};
    for (uint8_t g = 0U; g < l->message.width; g++) {
        l->field[g] = (hg_field){.start = take16(s) % 520U, .length = take_below(s, 34U), .flags = take_below(s, 8U)};
        l->scale[g] = take_scale(s);
    }
}

/* Do no two fields share a bit? And the sender's filling, which is 0 where fields and protection lie. */
static void mark(source *s, layout *l)
{
    l->apart = true;
    for (uint8_t g = 0U; g < l->message.width; g++) {
        for (unsigned i = 0U; i < l->field[g].length; i++) {
            const unsigned bit = place(&l->field[g], i);
            require(20U, bit < (8U * (unsigned)l->message.length));
            l->apart = l->apart && (!l->taken[bit]);
            l->taken[bit] = true;
        }
    }
    for (unsigned bit = 0U; bit < BITS; bit++) {
        if ((bit < (8U * (unsigned)l->message.length)) && (!l->taken[bit]) && (!hg_e2e_owns(&l->rule, (uint16_t)bit)) && ((bit % 3U) == (l->rule.data_id % 3U))) {
            l->idle[bit / 8U] |= (uint8_t)(1U << (bit % 8U));
        }
    }
    (void)s;
}

static uint32_t pattern_of(const hg_field *field, const uint8_t *data)
{
    uint32_t pattern = 0U;
    for (unsigned i = 0U; i < field->length; i++) {
        const unsigned bit = place(field, i);
        pattern |= (((uint32_t)data[bit / 8U] >> (bit % 8U)) & 1U) << i;
    }
    return pattern;
}

/* What an integer field's pattern says, in 64 bits; beyond int32_t for none. */
static int64_t meant(const hg_field *field, uint32_t pattern)
{
    const int64_t turn = (int64_t)1 << field->length;
    const bool is_signed = (field->flags & HG_FIELD_SIGNED) != 0U;
    const int64_t none = is_signed ? (turn / 2) : (turn - 1);
    int64_t value = (int64_t)pattern;
    if (value == none) {
        value = INT64_MIN;
    } else if (is_signed && (value > none)) {
        value -= turn;
    } else {
        /* as it stands */
    }
    return value;
}

static int32_t take_code(source *s, const hg_code_scale *scale)
{
    int32_t code = (int32_t)take32(s);
    const uint8_t kind = take_below(s, 4U);
    if (kind == 0U) {
        code = scale->minimum;
    } else if (kind == 1U) {
        code = scale->maximum;
    } else if (kind == 2U) {
        const int64_t span = ((int64_t)scale->maximum - scale->minimum) + 1;
        code = (span > 0) ? (int32_t)(scale->minimum + ((int64_t)(uint32_t)code % span)) : code;
    } else {
        /* any */
    }
    return code;
}

static void there_and_back(source *s, const layout *l)
{
    int32_t code[WIDTH] = {0};
    int32_t back[WIDTH] = {0};
    hg_can_frame frame;
    (void)memset(&frame, 0xA5, sizeof(frame));
    for (uint8_t g = 0U; g < l->message.width; g++) {
        code[g] = take_code(s, &l->scale[g]);
    }
    hg_frame_pack(&l->message, code, &frame);
    require(21U, hg_frame_matches(&l->message, &frame));
    for (unsigned bit = 0U; bit < BITS; bit++) {
        const uint8_t filling = (l->message.idle != NULL) ? l->idle[bit / 8U] : 0U;
        require(22U, l->taken[bit] || ((((frame.data[bit / 8U] ^ filling) >> (bit % 8U)) & 1U) == 0U));
    }
    if (!l->apart) {
        return;
    }
    const hg_status status = hg_frame_unpack(&l->message, &frame, back);
    for (uint8_t g = 0U; g < l->message.width; g++) {
        if ((l->field[g].flags & HG_FIELD_FLOAT32) == 0U) {
            const bool valid = (code[g] != HG_CODE_INVALID) && (code[g] >= l->scale[g].minimum) && (code[g] <= l->scale[g].maximum);
            require(23U, meant(&l->field[g], pattern_of(&l->field[g], frame.data)) == (valid ? (int64_t)code[g] : INT64_MIN));
            require(23U, (status != HG_OK) || (back[g] == (valid ? code[g] : HG_CODE_INVALID)));
        }
    }
}

static void any_bytes(source *s, const layout *l)
{
    int32_t code[WIDTH];
    hg_can_frame frame = {.id = l->message.id, .flags = l->message.flags, .length = l->message.length};
    for (uint8_t g = 0U; g < WIDTH; g++) {
        code[g] = 0x5A5A5A5A;
    }
    for (uint8_t i = 0U; i < HG_CAN_DATA_MAX; i++) {
        frame.data[i] = take8(s);
    }
    if (take8(s) == 255U) {
        frame.flags ^= take8(s);
        frame.length = take8(s);
    }
    const hg_status status = hg_frame_unpack(&l->message, &frame, code);
    require(24U, one_of(status, unpack_answers, 3U));
    require(24U, (status == HG_E_FORMAT) == (!hg_frame_matches(&l->message, &frame)));
    for (uint8_t g = 0U; g < WIDTH; g++) {
        const bool written = (status == HG_OK) && (g < l->message.width);
        require(24U, written || (code[g] == 0x5A5A5A5A));
        require(25U, (!written) || (code[g] == HG_CODE_INVALID) || hg_code_valid(&l->scale[g], code[g]));
        if (written && ((l->field[g].flags & HG_FIELD_FLOAT32) == 0U)) {
            require(23U, meant(&l->field[g], pattern_of(&l->field[g], frame.data)) == ((code[g] == HG_CODE_INVALID) ? INT64_MIN : (int64_t)code[g]));
        }
    }
}

/* A number there and back: what comes of it is within the scale, and as near as code.h says. */
static void numbers(source *s, const hg_code_scale *scale)
{
    const uint32_t bits = take32(s);
    float value;
    (void)memcpy(&value, &bits, sizeof(value));
    const int32_t code = hg_code_encode(scale, (hg_real)value);
    require(26U, (code == HG_CODE_INVALID) || ((code >= scale->minimum) && (code <= scale->maximum)));
    require(26U, hg_real_finite((hg_real)value) || (code == HG_CODE_INVALID));
    require(26U, hg_code_valid(scale, code) == (code != HG_CODE_INVALID));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    source s = {.data = data, .left = size};
    static layout l;
    take_layout(&s, &l);
    if (hg_frame_valid(&l.message)) {
        mark(&s, &l);
        there_and_back(&s, &l);
        any_bytes(&s, &l);
        for (uint8_t g = 0U; g < l.message.width; g++) {
            numbers(&s, &l.scale[g]);
        }
    }
    return 0;
}
