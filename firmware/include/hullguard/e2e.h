/** @file
 *  End-to-end protection by the profiles 01, 02, 05, 11 and 22 of AUTOSAR E2E, one const rule table a message, every check on by default.
 *
 *      profile   checksum (polynomial, start, final XOR)   over                                            counter   data identifier
 *      P01, P11  CRC-8   (0x1D, 0x00, 0x00) 1 byte         identifier, then all bytes but its own          0 .. 14   16 bits, by mode
 *      P02, P22  CRC-8   (0x2F, 0xFF, 0xFF) 1 byte         all bytes but its own, then the list's entry    0 .. 15   list of 16 bytes
 *      P05       CRC-16  (0x1021, 0xFFFF, 0) 2 bytes, low first; all bytes but its own, then identifier    0 .. 255  16 bits, low first
 *
 *  P01 and P11 share one wire format, P02 and P22 another. How the profiles take their 16-bit identifier into the sum of P01 and P11:
 *  both (low, high byte), alternate (low with an even counter, high with an odd one), low, or nibble (low byte, then 0; the low nibble of the
 *  high byte travels in the frame). Places of checksum, counter and nibble are those of the message, so that a vehicle's own layout fits.
 *
 *  Errors that pass the check in a frame of 8 bytes with the counter 0, of 64, 2 016 and 41 664 of 1, 2 and 3 wrong bits; and the longest frame
 *  in which every error of 2 bits is seen, bytes (tests/unit/test_e2e_errors.c):
 *
 *      P05                                     0, 0, 0      64        P01, P11 both, low                 0, 0, 198    31
 *      P02, P22, data identifiers all equal    0, 0, 0      14        P01, P11 nibble                    0, 0, 169    32
 *      P02, P22, data identifiers 0, 1, .. 15  0, 0, 48     14        P01 alternate                      up to 1, 1, 202
 *
 *  No data and no data identifier changes these figures, but for alternate (identifiers whose bytes differ by 0x83 let one wrong bit pass, 63
 *  other differences two) and lists that are not linear in the counter: 1, 2, .. 16 lets 54 errors of 3 bits pass, random lists some of 1 bit.
 *
 *  A message may carry 4 bits that are no part of any profile: the sample index modulo 16 (node.h).
 *  It guards integrity, not authenticity: whoever knows the data identifiers can forge a frame.
 *
 *  Two stages. hg_e2e_check() looks at one frame alone. hg_e2e_sequence() compares it with the last good one; how far the counter may have
 *  moved is the caller's to say, because a sender that has nothing to say is not a lost frame: the step grows with the time that passed
 *  (MaxDeltaCounter of P01 and P02, which grows with every cycle without data, without the cycle).
 *  hg_e2e_machine_step() is the state machine of AUTOSAR E2E, driven by receptions and by expired heartbeat deadlines, never by cycles: called
 *  once a cycle it takes an event-triggered sender's silence for errors: 68 % of the time not VALID in fault-free traffic (window 5, three good
 *  frames to leave INVALID, a frame every 4 cycles on average), against 0.004 % (tests/host/test_e2e.py).
 *  Narrower than the standard: after a jump the counter is compared with the refused frame's, in P01 and P02 too; MaxNoNewOrRepeatedData and
 *  TransitToInvalidExtended are not there: the deadline says what they are for.
 *  Reentrant per instance, safe in interrupt context, no allocation. */
#ifndef HULLGUARD_E2E_H
#define HULLGUARD_E2E_H

#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define HG_E2E_LENGTH_MAX 64U    /* longest protected frame, bytes; the profiles promise 30 (P01, P11) and 32 (P02, P22) */
#define HG_E2E_IDS 16U           /* entries of a list of data identifiers, one a counter value */
#define HG_E2E_NO_STAMP 0xFFFFU  /* the message carries no sample index */
#define HG_E2E_ANY_STEP 0xFFFFU  /* nothing is known of how much time has passed */

#define HG_E2E_IGNORE_CRC 0x01U      /* do not look at the checksum, nor at the nibble of the data identifier */
#define HG_E2E_IGNORE_COUNTER 0x02U  /* do not look at the sequence: whether frames were lost is then never known */
#define HG_E2E_IGNORE_STAMP 0x04U    /* book to the open sample whatever the stamp says */
#define HG_E2E_IGNORE_STATE 0x08U    /* use good frames in state INVALID too */

/* Profile of a message: the table above has each one's checksum, counter and data identifier. */
typedef enum {
    HG_E2E_NONE = 1, /* no protection: every frame is good, a loss shows by its age only */
    HG_E2E_P01  = 2, /* AUTOSAR E2E profile 01 */
    HG_E2E_P02  = 3, /* profile 02 */
    HG_E2E_P05  = 4, /* profile 05 */
    HG_E2E_P11  = 5, /* profile 11 */
    HG_E2E_P22  = 6  /* profile 22 */
} hg_e2e_profile;

typedef enum { /* which bytes of the data identifier go into the sum of P01 and P11; P11 of the standard knows both and nibble only */
    HG_E2E_BOTH      = 1, /* low, then high */
    HG_E2E_ALTERNATE = 2, /* low with an even counter, high with an odd one */
    HG_E2E_LOW       = 3, /* low */
    HG_E2E_NIBBLE    = 4  /* low, then 0; the low nibble of the high byte is in the frame */
} hg_e2e_id_mode;

typedef struct {    /* one state's way out */
    uint8_t window; /* events looked at, 1 .. 16 */
    uint8_t ok;     /* good frames that there must be among them, 0 .. window */
    uint8_t error;  /* damaged ones that there may be, 0 .. window */
} hg_e2e_limit;

typedef struct {          /* flash: limits of the state machine, AUTOSAR's names in brackets */
    hg_e2e_limit init;    /* WindowSizeInit, MinOkStateInit, MaxErrorStateInit */
    hg_e2e_limit valid;   /* .. Valid */
    hg_e2e_limit invalid; /* .. Invalid */
    bool         clear;   /* ClearToInvalid: forget the events on the way to INVALID */
} hg_e2e_limits;

typedef struct {               /* flash: one a message */
    hg_e2e_profile profile;
    hg_e2e_id_mode mode;       /* P01, P11 */
    uint16_t       data_id;    /* P01, P05, P11 */
    const uint8_t *data_ids;   /* P02, P22: [HG_E2E_IDS]; else not read */
    uint8_t        crc;        /* byte of the checksum; P05: its low byte, the high one follows */
    uint8_t        ignore;     /* HG_E2E_IGNORE_*; 0: every check is on */
    uint16_t       counter;    /* first bit of the counter: bit i of byte b is 8 b + i; a multiple of 4, for P05 of 8 */
    uint16_t       nibble;     /* first bit of the data identifier's nibble, a multiple of 4; P01, P11 in mode nibble */
    uint16_t       stamp;      /* first bit of the sample index modulo 16, a multiple of 4; or HG_E2E_NO_STAMP */
    uint8_t        resync;     /* good frames in sequence that are refused after a jump of the counter (SyncCounter of P01, P02) */
    const hg_e2e_limits *limits; /* of the state machine */
} hg_e2e_config;

/** Limits for those who have no reason for others: windows of 8; INIT 1 good and at most 2 damaged frames; VALID at least 1 good and at most 3 damaged
 *  ones; INVALID is left with 2 good and at most 2 damaged ones. The order of AUTOSAR's constr_3177 (errors VALID >= INIT >= INVALID) holds. */
extern const hg_e2e_limits hg_e2e_limits_default;

/** Do all places lie in a frame of that length, apart from one another, and are tables and limits there? */
bool hg_e2e_valid(const hg_e2e_config *config, uint8_t length);

/** Values that the counter takes: 15, 16 or 256; 1 without protection. */
uint16_t hg_e2e_modulus(const hg_e2e_config *config);

/** Is a bit of the frame (8 b + i) the protection's own, or the stamp's? */
bool hg_e2e_owns(const hg_e2e_config *config, uint16_t bit);

/** Write counter, nibble, stamp and checksum into a frame whose signals are in place.
 *  @param[in,out] data  [length]  @param[in] counter  taken by the modulus  @param[in] stamp  sample index, taken modulo 16; not written without a place
 *  @retval HG_OK        done
 *  @retval HG_E_FORMAT  the frame is too short for the places, or longer than HG_E2E_LENGTH_MAX; nothing written
 *  Cost: 2 table look-ups a byte. */
hg_status hg_e2e_protect(const hg_e2e_config *config, uint8_t *data, uint8_t length, uint8_t counter, uint8_t stamp);

/** What a frame's header says. */
typedef struct {
    uint8_t  stamp;     /* sample modulo 16; 0 without a place */
    uint8_t  counter;   /* 0 .. modulus - 1 */
    uint16_t crc;       /* as computed */
} hg_e2e_header;

/** Look at one frame alone.
 *  @retval HG_OK        *header is valid
 *  @retval HG_E_FORMAT  the frame is too short for the places, or longer than HG_E2E_LENGTH_MAX
 *  @retval HG_E_CRC     checksum, nibble of the data identifier or a counter beyond its range: damaged, or meant for others */
hg_status hg_e2e_check(const hg_e2e_config *config, const uint8_t *data, uint8_t length, hg_e2e_header *header);

typedef struct {       /* RAM: one a received message */
    uint16_t crc;      /* of the last frame whose checksum was good */
    uint8_t  counter;  /* its counter */
    uint8_t  stamp;    /* its stamp: a checksum of 8 bits may by chance be that of another sample's frame */
    uint8_t  resync;   /* frames in sequence to refuse yet */
    bool     seen;     /* has there been one? */
} hg_e2e_receiver;

typedef struct {
    uint8_t lost;      /* frames lost before this one by the counter, 0 .. modulus - 1; 0 for the first frame */
    bool    continues; /* none was lost for certain: the counter moved by one since a frame that was seen */
} hg_e2e_progress;

/** No frame seen yet. */
void hg_e2e_receiver_start(hg_e2e_receiver *self);

/** Is this the last good frame once more? It then says nothing new, whatever its counter means. */
bool hg_e2e_repeated(const hg_e2e_config *config, const hg_e2e_receiver *self, const hg_e2e_header *header);

/** Compare a good frame with the last one, and move on. A counter that has not moved, in another frame, counts as a whole turn.
 *  @param[in] step  frames that the sender can have sent since the last good frame, this one included; 0 refuses any; HG_E2E_ANY_STEP when
 *                   unknown
 *  @retval HG_OK           *progress is valid; the first frame is in sequence with any step from 1 on
 *  @retval HG_E_REPEATED   the last good frame once more; nothing changed
 *  @retval HG_E_SEQUENCE   the counter moved further than that: an old frame, a second sender, or one that began anew. The next is compared with this one. */
hg_status hg_e2e_sequence(const hg_e2e_config *config, hg_e2e_receiver *self, const hg_e2e_header *header, uint16_t step, hg_e2e_progress *progress);

/** State of a link. 0 is not a good state (in AUTOSAR VALID is 0, and zeroed memory reads VALID). */
typedef enum {
    HG_E2E_DEINIT  = 0, /* not started */
    HG_E2E_NODATA  = 1, /* no good frame yet */
    HG_E2E_INIT    = 2, /* some; not yet enough */
    HG_E2E_VALID   = 3, /* what comes may be used */
    HG_E2E_INVALID = 4  /* too many damaged frames, or no good one for long: what comes is not to be used */
} hg_e2e_state;

typedef struct {          /* RAM: one a received message */
    hg_e2e_state state;
    uint16_t     ok;      /* bit i: the event i before the last was a good frame */
    uint16_t     error;   /* bit i: it was a damaged one */
} hg_e2e_machine;

/** State NODATA. */
void hg_e2e_machine_start(hg_e2e_machine *self);

/** One event; at most one change of state. A machine that was not started stays in DEINIT.
 *  @param[in] event  HG_OK: a good frame; HG_E_CRC, HG_E_FORMAT: a damaged one; HG_E_EMPTY: the heartbeat's deadline has passed without one;
 *                    anything else: a frame that counts for neither (repeated, out of sequence)
 *  Result: the state after it. Cost: a pass over at most 16 bits. */
hg_e2e_state hg_e2e_machine_step(hg_e2e_machine *self, const hg_e2e_limits *limits, hg_status event);

#ifdef __cplusplus
}
#endif

#endif
