#include "host.h"

/* Bits of one frame as they leave the controller: a run of five equal bits is followed by one of the other kind. */
typedef struct {
    uint32_t count;
    uint32_t run;
    uint32_t last; /* 2: none yet */
    uint32_t crc;
    bool     stuffed; /* was the last bit followed by a stuff bit? */
} wire;

static void put(wire *w, uint32_t bit)
{
    /* CRC-15 of classic CAN, over the unstuffed bits. */
    const uint32_t next = (bit ^ (w->crc >> 14)) & 1U;
    w->crc = ((w->crc << 1) ^ (next ? 0x4599U : 0U)) & 0x7FFFU;
    w->run = (bit == w->last) ? w->run + 1U : 1U;
    w->last = bit;
    w->count++;
    w->stuffed = (w->run == 5U);
    if (w->stuffed) {
        w->count++;
        w->last = 1U - bit;
        w->run = 1U;
    }
}

static void put_bits(wire *w, uint32_t value, uint32_t bits)
{
    for (uint32_t i = bits; i > 0U; i--) {
        put(w, (value >> (i - 1U)) & 1U);
    }
}

static uint32_t length_code(uint32_t length)
{
    static const uint8_t above[] = {12U, 16U, 20U, 24U, 32U, 48U, 64U};
    uint32_t code = length;
    if (length > 8U) {
        code = 9U;
        while ((code < 15U) && (above[code - 9U] < length)) {
            code++;
        }
    }
    return code;
}

/* Start of frame to data length code; the bits up to and with the one that switches the bit rate. */
static uint32_t put_header(wire *w, const hg_can_frame *frame, bool fd, bool remote)
{
    uint32_t nominal = 0U;
    put(w, 0U);
    if ((frame->flags & HG_CAN_EXTENDED) != 0U) {
        put_bits(w, frame->id >> 18, 11U);
        put_bits(w, 3U, 2U); /* SRR, IDE */
        put_bits(w, frame->id & 0x3FFFFU, 18U);
        put(w, remote ? 1U : 0U);
        put_bits(w, fd ? 2U : 0U, 2U); /* FDF and reserved, or r1 r0 */
    } else {
        put_bits(w, frame->id, 11U);
        put(w, remote ? 1U : 0U);
        put(w, 0U); /* IDE */
        put_bits(w, fd ? 2U : 0U, fd ? 2U : 1U);
    }
    if (fd) {
        nominal = w->count + 1U; /* a stuff bit behind the switch is a fast one */
        put(w, ((frame->flags & HG_CAN_BRS) != 0U) ? 1U : 0U);
        put(w, 0U); /* ESI */
    }
    put_bits(w, length_code(frame->length), 4U);
    return nominal;
}

/* Bits of the frame, and of these the ones of the data phase. The rate changes at the sample points of BRS and CRC delimiter; as their fast
   and slow parts complement one another, that is one slow bit (BRS) and one fast bit (the delimiter) for any sample points. */
static uint32_t measure(const hg_can_frame *frame, uint32_t *fast)
{
    const bool fd = (frame->flags & HG_CAN_FD) != 0U;
    const bool remote = ((frame->flags & HG_CAN_REMOTE) != 0U) && !fd;
    wire w = {.count = 0U, .run = 0U, .last = 2U, .crc = 0U, .stuffed = false};
    const uint32_t nominal = put_header(&w, frame, fd, remote);
    for (uint32_t i = 0U; (i < frame->length) && !remote; i++) {
        put_bits(&w, frame->data[i], 8U);
    }
    *fast = 0U;
    if (fd) {
        const bool small = frame->length <= 16U;
        w.count -= w.stuffed ? 1U : 0U; /* the fixed stuff bit that follows stands for it (ISO 11898-1, frame coding) */
        w.count += 4U + (small ? 17U + 6U : 21U + 7U); /* stuff count, CRC, and their fixed stuff bits */
        *fast = ((frame->flags & HG_CAN_BRS) != 0U) ? (w.count + 1U - nominal) : 0U;
    } else {
        put_bits(&w, w.crc, 15U);
    }
    return w.count + 13U; /* delimiters, acknowledge, end of frame, interframe space */
}

uint32_t hgh_frame_bits(const hg_can_frame *frame)
{
    uint32_t fast;
    return measure(frame, &fast);
}

uint32_t hgh_frame_data_bits(const hg_can_frame *frame)
{
    uint32_t fast;
    (void)measure(frame, &fast);
    return fast;
}
