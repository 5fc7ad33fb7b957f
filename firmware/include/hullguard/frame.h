/** @file
 *  Codes to bytes and back, by constant tables in DBC terms: start bit, length, byte order, sign, float32. Scale and offset are the
 *  signal's code scale (code.h). A field's largest unsigned, or most negative signed, pattern stands for HG_CODE_INVALID; a float32 field
 *  says it with a quiet NaN. Reentrant, safe in interrupt context, no allocation.
 *
 *  The project's own layout of a measurement or control frame (profile 22), signals of whole bytes from byte 2 on:
 *
 *      byte  0        1                        2 ..
 *            CRC      stamp(7:4) counter(3:0)  signal, low byte first
 *
 *  The verdict frame, 8 bytes; 12 bytes of CAN FD for a model of more than 16 faults:
 *
 *      byte  0    1              2                                                     3, 4         5, 6               7
 *            CRC  stamp counter  plant(1:0) basis(3:2) reply(4) refused(5) 0(7:6)      candidates   bus, 2 bits/group  k(11:4)
 *      byte  8, 9               10, 11
 *            candidates(31:16)  0
 *
 *  plant: hg_plant; basis: hg_basis; reply: sent only because a tick is answered in lockstep; refused: a number was refused since the start;
 *  candidates: bit i is fault i of the model, low byte first; bus: hg_bus_health of group i in bits 2i+1:2i. The status frame, with every heartbeat, 8 bytes:
 *
 *      byte  0    1              2 .. 5                       6                             7
 *            CRC  stamp counter  model hash, low byte first   frames lost (saturated)       frames refused (saturated) */
#ifndef HULLGUARD_FRAME_H
#define HULLGUARD_FRAME_H

#include "hullguard/can.h"
#include "hullguard/code.h"
#include "hullguard/e2e.h"
#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define HG_FIELD_MOTOROLA 0x01U /* big-endian: start is the most significant bit, as in a DBC */
#define HG_FIELD_SIGNED 0x02U   /* two's complement */
#define HG_FIELD_FLOAT32 0x04U  /* IEEE 754, 32 bits: the code's value in signal units; not with Q31 */

typedef struct {          /* flash: one a signal in a frame */
    uint16_t start;       /* DBC start bit: least significant bit (Intel) or most significant bit (Motorola) */
    uint8_t  length;      /* bits: 1 .. 31 unsigned, 1 .. 32 signed, 32 float32 */
    uint8_t  flags;       /* HG_FIELD_* */
} hg_field;

typedef struct {                   /* flash: one a message */
    uint32_t             id;       /* 11 or 29 bits, without flag bits */
    uint8_t              flags;    /* HG_CAN_EXTENDED, HG_CAN_FD, HG_CAN_BRS */
    uint8_t              length;   /* bytes */
    uint8_t              width;    /* signals, 0 .. HG_GROUP_SIGNALS_MAX */
    const hg_field      *field;    /* [width] */
    const hg_code_scale *scale;    /* [width] */
    const hg_e2e_config *e2e;      /* protection; the fields stay clear of its places */
    const uint8_t       *idle;     /* [length] what a sender fills the frame with where no field lies; NULL: 0. Receivers do not look at it */
} hg_message;

/** Do all fields lie inside the frame and clear of the protection, is the protection valid, can an integer field hold every code of its scale
 *  beside the invalid pattern, is the scale's exponent valid, and is the length one that the format can carry? Fields that overlap one another are not looked for.
 *  Cost: a pass over the fields' bits. */
bool hg_frame_valid(const hg_message *message);

/** Has a frame the message's identifier, kind (extended, remote, FD, error) and length? The bit-rate switch is not looked at. */
bool hg_frame_matches(const hg_message *message, const hg_can_frame *frame);

/** Lay codes into a frame; unused bits are idle's, which are 0 in fields and protection, or 0. The protection is not written.
 *  @param[in]  code   [width] within the scale's minimum .. maximum, or HG_CODE_INVALID (anything else is sent as invalid)
 *  Cannot fail for a message that hg_frame_valid() accepts. Cost: a few operations a byte and signal. */
void hg_frame_pack(const hg_message *message, const int32_t *code, hg_can_frame *frame);

/** Read codes out of a frame; does not look at the protection.
 *  @param[out] code  [width] within minimum .. maximum, or HG_CODE_INVALID; untouched unless HG_OK
 *  @retval HG_OK         all read
 *  @retval HG_E_FORMAT   hg_frame_matches() says no
 *  @retval HG_E_NUMERIC  a field holds neither a valid code nor the invalid pattern, for float32: infinity, another NaN, or out of range */
hg_status hg_frame_unpack(const hg_message *message, const hg_can_frame *frame, int32_t *code);

#ifdef __cplusplus
}
#endif

#endif
