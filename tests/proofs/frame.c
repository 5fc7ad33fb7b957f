/** @file
 *  frame.h: codes to bytes and back. */
#include "contract.h"

static hg_code_scale any_scale(void)
{
    hg_code_scale scale;
    scale.minimum = any_i32();
    scale.maximum = any_i32();
    scale.exponent = any_i8();
    return scale;
}

/** What is packed comes out of the frame as it went in, whatever the field's place, length, byte order and sign: every code of a valid scale, and the one that stands for no value.
 *  A frame of any other kind, length or identifier is refused without a write.
 *  Any valid message of one integer field, in any frame of up to LENGTH bytes; of byte order and sign FLAGS; any code.
 *  @proves hg_frame_pack hg_frame_unpack hg_frame_valid hg_frame_matches
 *  @without conversion: the bytes of a pattern are cut to 8 bits on purpose
 *  @run check real=f32 unwind=33 limit=150 LENGTH=2U FLAGS=0U
 *  @run deep real=f32 unwind=33 limit=1800 LENGTH=2U FLAGS=3U
 *  @run deep real=f32 unwind=33 limit=1800 LENGTH=2U FLAGS=1U
 *  @run deep real=f32 unwind=33 limit=1800 LENGTH=2U FLAGS=2U
 *  @run deep real=f32 unwind=33 limit=7200 hg_e2e_valid.0:65 LENGTH=8U FLAGS=0U
 *  @run deep real=f32 unwind=33 limit=7200 hg_e2e_valid.0:65 LENGTH=8U FLAGS=1U
 *  @run deep real=f32 unwind=33 limit=7200 hg_e2e_valid.0:65 LENGTH=8U FLAGS=2U
 *  @run deep real=f32 unwind=33 limit=7200 hg_e2e_valid.0:65 LENGTH=8U FLAGS=3U */
void proof_frame_round(void)
{
    const hg_e2e_config e2e = {.profile = HG_E2E_NONE, .stamp = HG_E2E_NO_STAMP, .limits = &hg_e2e_limits_default};
    const hg_field field = {.start = any_u16(), .length = any_u8(), .flags = FLAGS};
    const hg_code_scale scale = any_scale();
    const hg_message message = {.id = any_u32(), .flags = any_u8(), .length = any_u8(), .width = 1U, .field = &field, .scale = &scale, .e2e = &e2e, .idle = NULL};
    assume((message.length <= LENGTH) && hg_frame_valid(&message));
    prove((field.start < (8U * LENGTH)) && (field.length <= 32U), "the field is in the frame");
    int32_t code = any_i32();
    const int32_t was = code;
    hg_can_frame frame;
    assume(requires_frame_pack(&message, &code, &frame));
    hg_frame_pack(&message, &code, &frame);
    prove(ensures_frame_pack(&message, &frame), "its identifier and length");
    prove(hg_frame_matches(&message, &frame), "of the message's kind");
    int32_t read;
    prove(hg_frame_unpack(&message, &frame, &read) == HG_OK, "what was packed can be read");
    prove((code == was) && (read == (hg_code_valid(&scale, code) ? code : HG_CODE_INVALID)), "as it went in");
    if (hg_code_valid(&scale, code) && (field.length > 9U)) {
        reach("a field over two bytes");
    }
    frame.id ^= 1U;
    read = was;
    prove((hg_frame_unpack(&message, &frame, &read) == HG_E_FORMAT) && (read == was), "another message is refused, nothing written");
}

/** Every bit of a code stands in the frame where a DBC says, and all other bits are 0: from its start bit on upwards in a little-endian field; in a big-endian one from its most
 *  significant bit downwards in each byte, byte after byte.
 *  Any valid message of one integer field in a frame of up to LENGTH bytes, of byte order and sign FLAGS; any valid code.
 *  @proves hg_frame_pack
 *  @without conversion: the bytes of a pattern are cut to 8 bits on purpose
 *  @run deep real=f32 unwind=33 limit=3600 LENGTH=2U FLAGS=0U
 *  @run deep real=f32 unwind=33 limit=3600 LENGTH=2U FLAGS=3U
 *  @run deep real=f32 unwind=65 limit=3600 LENGTH=8U FLAGS=2U
 *  @run deep real=f32 unwind=65 limit=3600 LENGTH=8U FLAGS=1U */
void proof_frame_layout(void)
{
    const hg_e2e_config e2e = {.profile = HG_E2E_NONE, .stamp = HG_E2E_NO_STAMP, .limits = &hg_e2e_limits_default};
    const hg_field field = {.start = any_u16(), .length = any_u8(), .flags = FLAGS};
    const hg_code_scale scale = any_scale();
    const hg_message message = {.id = any_u32(), .flags = any_u8(), .length = any_u8(), .width = 1U, .field = &field, .scale = &scale, .e2e = &e2e, .idle = NULL};
    assume((message.length <= LENGTH) && hg_frame_valid(&message));
    const int32_t code = any_i32();
    assume(hg_code_valid(&scale, code));
    hg_can_frame frame;
    hg_frame_pack(&message, &code, &frame);
    uint64_t seen = 0U;
    uint32_t place = field.start;
    for (uint8_t n = 0U; n < field.length; n++) {
        const uint32_t i = ((FLAGS & HG_FIELD_MOTOROLA) != 0U) ? (field.length - 1U - n) : n;
        prove(((frame.data[place / 8U] >> (place % 8U)) & 1U) == (((uint32_t)code >> i) & 1U), "the code's bit");
        seen |= (uint64_t)1U << place;
        place = ((FLAGS & HG_FIELD_MOTOROLA) == 0U) ? (place + 1U) : (((place % 8U) == 0U) ? (place + 15U) : (place - 1U));
    }
    const uint8_t bit = any_u8_in(0U, (8U * LENGTH) - 1U);
    prove((((seen >> bit) & 1U) != 0U) || (((frame.data[bit / 8U] >> (bit % 8U)) & 1U) == 0U), "no other bit");
    reach("end");
}

/** A frame of any bytes is read without overrun, and every code that comes out is valid or stands for no value; when one is neither, nothing is written.
 *  Any valid message of WIDTH fields, float32 fields among them, in a frame of up to LENGTH bytes; any bytes.
 *  @proves hg_frame_unpack hg_frame_matches hg_frame_valid
 *  @without conversion: the bytes of a pattern are cut to 8 bits on purpose
 *  @run check real=f32 unwind=33 limit=150 LENGTH=4U WIDTH=1U
 *  @run check real=q31 unwind=33 limit=150 LENGTH=3U WIDTH=1U
 *  @run deep real=f32 unwind=33 limit=3600 hg_e2e_valid.0:65 LENGTH=8U WIDTH=2U */
void proof_frame_unpack(void)
{
    const hg_e2e_config e2e = {.profile = HG_E2E_NONE, .stamp = HG_E2E_NO_STAMP, .limits = &hg_e2e_limits_default};
    hg_field field[WIDTH];
    hg_code_scale scale[WIDTH];
    hg_message message = {.id = any_u32(), .flags = any_u8(), .length = any_u8(), .width = WIDTH, .field = field, .scale = scale, .e2e = &e2e, .idle = NULL};
    assume((message.length <= LENGTH) && hg_frame_valid(&message));
    hg_can_frame frame;
    int32_t code[WIDTH];
    const int32_t before = code[0];
    assume(requires_frame_matches(&message, &frame));
    prove(ensures_frame_matches(&message, &frame, hg_frame_matches(&message, &frame)), "its identifier and length");
    assume(requires_frame_unpack(&message, &frame, code));
    const hg_status status = hg_frame_unpack(&message, &frame, code);
    prove(ensures_frame_unpack(status), "no other status");
    for (uint8_t g = 0U; g < WIDTH; g++) {
        prove((status != HG_OK) || (code[g] == HG_CODE_INVALID) || hg_code_valid(&scale[g], code[g]), "a code, or none");
    }
    prove((status == HG_OK) || (code[0] == before), "nothing written");
    if (status == HG_OK) {
        reach("read");
    }
    if (status == HG_E_NUMERIC) {
        reach("refused");
    }
}
