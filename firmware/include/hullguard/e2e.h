/** @file
 *  End-to-end protection, profile 22 of AUTOSAR E2E (wire format of profile 02): CRC-8H2F (polynomial 0x2F, start and final XOR 0xFF) in byte 0
 *  over all other bytes and then the data identifier of the counter's value; sequence counter 0 .. 15 in the low nibble of byte 1. The high
 *  nibble of byte 1 is the profile's to give away; here it carries the sample the frame belongs to, modulo 16.
 *  It guards integrity, not authenticity: whoever knows the data identifiers can forge a frame.
 *  The profile itself ends at 32 bytes; frames of up to 64 bytes are protected by the same arithmetic. In frames of up to 12 bytes no error of
 *  up to three bits passes; from 16 bytes (127 bits) on two bits at that distance do. CAN FD's own checksum of 17 or 21 bits covers the wire.
 *  The receiver's state moves by reception only, never by cycle: a sender that has nothing to say is not a lost frame.
 *  Reentrant per instance, safe in interrupt context, no allocation. */
#ifndef HULLGUARD_E2E_H
#define HULLGUARD_E2E_H

#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#define HG_E2E_P22_HEADER 2U   /* bytes before the signals */
#define HG_E2E_P22_LENGTH 64U  /* longest protected frame, bytes */
#define HG_E2E_LOST 15U        /* more frames lost than the counter tells */
#define HG_E2E_IDS 16U         /* data identifiers, one a counter value */

/** Checksum of a whole frame, its byte 0 left out.
 *  @param[in] data     [length], length 2 .. HG_E2E_P22_LENGTH  @param[in] data_id  [HG_E2E_IDS]
 *  Cost: 2 table look-ups a byte. */
uint8_t hg_e2e_p22_crc(const uint8_t *data, uint8_t length, const uint8_t *data_id);

/** Write counter, stamp and checksum into a frame whose signals are in place.
 *  @param[in,out] data  [length]  @param[in] counter  taken modulo 16  @param[in] stamp  sample index, taken modulo 16
 *  @retval HG_OK        done
 *  @retval HG_E_FORMAT  length outside HG_E2E_P22_HEADER .. HG_E2E_P22_LENGTH; nothing written */
hg_status hg_e2e_p22_protect(uint8_t *data, uint8_t length, const uint8_t *data_id, uint8_t counter, uint8_t stamp);

typedef struct {      /* RAM: one a received message */
    uint8_t counter;  /* of the last good frame */
    uint8_t crc;      /* its checksum */
    bool    seen;     /* has there been one? */
} hg_e2e_receiver;

/** What a good frame's header says. */
typedef struct {
    uint8_t stamp;    /* sample modulo 16 */
    uint8_t counter;  /* 0 .. 15 */
    uint8_t lost;     /* frames lost before this one by the counter, 0 .. 14; 0 for the first frame; HG_E2E_LOST for a counter that has not
                       * moved although the frame is another: 15 frames were lost, or the sender began anew */
} hg_e2e_header;

/** No frame seen yet. */
void hg_e2e_receiver_start(hg_e2e_receiver *self);

/** Check a received frame and move on.
 *  @retval HG_OK          *header is valid
 *  @retval HG_E_FORMAT    length out of range; nothing changed
 *  @retval HG_E_CRC       damaged; nothing changed
 *  @retval HG_E_REPEATED  the last good frame once more: counter and checksum are the same; nothing changed */
hg_status hg_e2e_p22_receive(hg_e2e_receiver *self, const uint8_t *data, uint8_t length, const uint8_t *data_id, hg_e2e_header *header);

#endif
