#include "hullguard/frame.h"

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#define FLOAT32_QUIET_NAN 0x7FC00000U
#define FLOAT32_BITS 32U

/* Lengths that CAN FD's 4-bit length code can say. */
static bool fd_length(uint8_t length)
{
    static const uint8_t above_eight[] = {12U, 16U, 20U, 24U, 32U, 48U, 64U};
    bool found = length <= HG_CAN_CLASSIC_MAX;
    for (uint8_t i = 0U; i < (uint8_t)sizeof(above_eight); i++) {
        found = found || (length == above_eight[i]);
    }
    return found;
}

/* Position in the frame of bit i of a field, i = 0 the least significant; bit p is bit p % 8 of byte p / 8. */
static uint16_t position(const hg_field *field, uint8_t i)
{
    uint16_t bit = field->start + i;
    if ((field->flags & HG_FIELD_MOTOROLA) != 0U) {
        /* A Motorola field runs down its byte and on to the top of the next: count in the order of transmission. */
        const uint16_t sent = (uint16_t)(((field->start / 8U) * 8U) + (7U - (field->start % 8U)) + (field->length - 1U - i));
        bit = (uint16_t)(((sent / 8U) * 8U) + (7U - (sent % 8U)));
    }
    return bit;
}

static uint32_t mask_of(const hg_field *field)
{
    return (field->length >= 32U) ? UINT32_MAX : (((uint32_t)1U << field->length) - 1U);
}

static bool field_valid(const hg_message *message, const hg_field *field)
{
    const bool is_signed = (field->flags & HG_FIELD_SIGNED) != 0U;
    const bool is_float = (field->flags & HG_FIELD_FLOAT32) != 0U;
    const uint8_t longest = (is_signed || is_float) ? 32U : 31U;
    bool valid = (field->length >= 1U) && (field->length <= longest);
    valid = valid && ((!is_float) || ((field->length == FLOAT32_BITS) && (HG_REAL_Q31 == 0)));
    for (uint8_t i = 0U; valid && (i < field->length); i++) {
        const uint16_t bit = position(field, i);
        valid = (bit < (8U * (uint16_t)message->length)) && (!hg_e2e_owns(message->e2e, bit));
    }
    return valid;
}

/* Would a code of this scale come out of an integer field as another one, or as the pattern for no value? */
static bool scale_fits(const hg_field *field, const hg_code_scale *scale)
{
    const bool is_signed = (field->flags & HG_FIELD_SIGNED) != 0U;
    const uint32_t mask = mask_of(field);
    const int64_t ones = is_signed ? ((int64_t)mask / 2) : (int64_t)mask;
    const int64_t least = is_signed ? -ones : 0;
    const int64_t most = is_signed ? ones : (ones - 1);
    const bool holds = ((field->flags & HG_FIELD_FLOAT32) != 0U) || ((scale->minimum >= least) && (scale->maximum <= most));
    return holds && hg_code_exponent_valid(scale->exponent);
}

bool hg_frame_valid(const hg_message *message)
{
    const bool fd = (message->flags & HG_CAN_FD) != 0U;
    const bool extended = (message->flags & HG_CAN_EXTENDED) != 0U;
    bool valid = hg_e2e_valid(message->e2e, message->length) && (message->width <= HG_GROUP_SIGNALS_MAX) &&
                 (message->length <= (fd ? HG_CAN_DATA_MAX : HG_CAN_CLASSIC_MAX)) && fd_length(message->length);
    valid = valid && (message->id <= (extended ? HG_CAN_ID_EXTENDED : HG_CAN_ID_STANDARD));
    valid = valid && ((message->width == 0U) || ((message->field != NULL) && (message->scale != NULL)));
    for (uint8_t g = 0U; valid && (g < message->width); g++) {
        valid = field_valid(message, &message->field[g]) && scale_fits(&message->field[g], &message->scale[g]);
    }
    return valid;
}

/* The pattern that stands for no value. */
static uint32_t invalid_pattern(const hg_field *field)
{
    uint32_t pattern = mask_of(field);
    if ((field->flags & HG_FIELD_FLOAT32) != 0U) {
        pattern = FLOAT32_QUIET_NAN;
    } else if ((field->flags & HG_FIELD_SIGNED) != 0U) {
        pattern = (uint32_t)1U << (field->length - 1U); /* NOLINT(clang-analyzer-core.BitwiseShift): a length is at least 1, hg_frame_valid() */
    } else {
        /* all ones */
    }
    return pattern;
}

#if HG_REAL_Q31
/* No field is a float: hg_frame_valid() refuses it. */
static uint32_t pattern_of_float(const hg_code_scale *scale, int32_t code)
{
    (void)scale;
    (void)code;
    return FLOAT32_QUIET_NAN;
}

static int32_t code_of_float(const hg_code_scale *scale, uint32_t pattern)
{
    (void)scale;
    (void)pattern;
    return HG_CODE_INVALID;
}
#else
static uint32_t pattern_of_float(const hg_code_scale *scale, int32_t code)
{
    const float value = (float)hg_code_value(scale, code);
    uint32_t pattern;
    /* deviation: misra-c2012-21.15: copying the bytes is the defined way from a float to its pattern */
    /* cppcheck-suppress misra-c2012-21.15 */
    (void)memcpy(&pattern, &value, sizeof(pattern));
    return pattern;
}

static int32_t code_of_float(const hg_code_scale *scale, uint32_t pattern)
{
    float value;
    /* deviation: misra-c2012-21.15: as above, the other way */
    /* cppcheck-suppress misra-c2012-21.15 */
    (void)memcpy(&value, &pattern, sizeof(value));
    return hg_code_encode(scale, (hg_real)value);
}
#endif

static uint32_t pattern_of(const hg_field *field, const hg_code_scale *scale, int32_t code)
{
    uint32_t pattern = (uint32_t)code & mask_of(field);
    if (!hg_code_valid(scale, code)) {
        pattern = invalid_pattern(field);
    } else if ((field->flags & HG_FIELD_FLOAT32) != 0U) {
        pattern = pattern_of_float(scale, code);
    } else {
        /* an integer field is the code itself */
    }
    return pattern;
}

static int32_t code_of(const hg_field *field, const hg_code_scale *scale, uint32_t pattern)
{
    int32_t code;
    if ((field->flags & HG_FIELD_FLOAT32) != 0U) {
        code = code_of_float(scale, pattern);
    } else {
        const bool negative = ((field->flags & HG_FIELD_SIGNED) != 0U) && ((pattern >> (field->length - 1U)) != 0U);
        const uint32_t extended = negative ? (pattern | ~mask_of(field)) : pattern;
        (void)memcpy(&code, &extended, sizeof(code)); /* two's complement, without an implementation-defined conversion */
    }
    return code;
}

void hg_frame_pack(const hg_message *message, const int32_t *code, hg_can_frame *frame)
{
    (void)memset(frame, 0, sizeof(*frame));
    frame->id = message->id;
    frame->flags = message->flags;
    frame->length = message->length;
    if (message->idle != NULL) {
        (void)memcpy(frame->data, message->idle, message->length);
    }
    for (uint8_t g = 0U; g < message->width; g++) {
        const hg_field *field = &message->field[g];
        const uint32_t pattern = pattern_of(field, &message->scale[g], code[g]);
        for (uint8_t i = 0U; i < field->length; i++) {
            const uint16_t bit = position(field, i);
            if (((pattern >> i) & 1U) != 0U) {
                frame->data[bit / 8U] |= (uint8_t)(1U << (bit % 8U));
            }
        }
    }
}

bool hg_frame_matches(const hg_message *message, const hg_can_frame *frame)
{
    const uint8_t kind = HG_CAN_EXTENDED | HG_CAN_REMOTE | HG_CAN_FD | HG_CAN_ERROR;
    return (frame->id == message->id) && ((frame->flags & kind) == (message->flags & kind)) && (frame->length == message->length);
}

static uint32_t read_field(const hg_field *field, const uint8_t *data)
{
    uint32_t pattern = 0U;
    for (uint8_t i = 0U; i < field->length; i++) {
        const uint16_t bit = position(field, i);
        if ((data[bit / 8U] & (uint8_t)(1U << (bit % 8U))) != 0U) {
            pattern |= (uint32_t)1U << i;
        }
    }
    return pattern;
}

hg_status hg_frame_unpack(const hg_message *message, const hg_can_frame *frame, int32_t *code)
{
    int32_t read[HG_GROUP_SIGNALS_MAX];
    if (!hg_frame_matches(message, frame)) {
        return HG_E_FORMAT;
    }
    for (uint8_t g = 0U; g < message->width; g++) {
        const hg_field *field = &message->field[g];
        const uint32_t pattern = read_field(field, frame->data);
        read[g] = HG_CODE_INVALID;
        if (pattern != invalid_pattern(field)) {
            read[g] = code_of(field, &message->scale[g], pattern);
            if (!hg_code_valid(&message->scale[g], read[g])) {
                return HG_E_NUMERIC;
            }
        }
    }
    for (uint8_t g = 0U; g < message->width; g++) {
        code[g] = read[g];
    }
    return HG_OK;
}
