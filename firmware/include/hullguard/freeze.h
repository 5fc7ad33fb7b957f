/** @file
 *  Freeze frame: the last samples before and after a confirmed alarm, every signal's value and radius and every generator's r and J as they were when
 *  the sample was judged, kept until somebody has read them over the bus and says so. A second alarm meanwhile is counted and does not overwrite.
 *
 *      RECORDING --confirmed alarm--> CLOSING --`after` samples, then its checksum--> FROZEN --clear--> RECORDING, with nothing held
 *
 *  An alarm begins in the sample in which the plant's state becomes CONFIRMED: one that lasts beyond a clear does not freeze anew.
 *  hg_node owns it (node.h): a request is taken by hg_node_receive(), and hg_node_freeze() hands out frames. Both have 8 bytes, as one of classic CAN, with
 *  the header of profile 22 in bytes 0 and 1 (the stamp is that of the last sample; a request's is not looked at, nor is its counter, because to ask twice does
 *  no harm):
 *
 *      request   2 command: 1 state, 2 read, 3 clear   3 record   4, 5 first word   6, 7 words, 0: to the last        read and clear name the record
 *      response  2, 3 place of the word                4 .. 7 word
 *                2, 3 0xFFFF: the state, to every request   4 state(1:0) alarms not recorded(7:2)   5 record   6, 7 words of the record, 0 unless FROZEN
 *
 *  All numbers lowest byte first. The record's words, hg_real as its bits (float64: two words, the lower first):
 *
 *      0            format 1(7:0) number type(15:8) record(23:16) samples held(31:24)      number type: 1 float32, 2 float64, 3 fixed point
 *      1            model hash
 *      2            width(7:0) place of the alarm's sample(15:8) residuals(31:16)
 *      3 ..         each sample, oldest first: k; plant(7:0) basis(15:8) bus(31:16); candidates; value [width], radius [width], r [residuals], J [residuals]
 *      the last     CRC-32C of all before (crc32c.h)
 *
 *  Rate: a request lets `burst` frames out at most, and so does each sample closed. Nothing of this touches the detector. What is not protected: whoever
 *  knows the identifiers can read and clear. Not reentrant per instance. */
#ifndef HULLGUARD_FREEZE_H
#define HULLGUARD_FREEZE_H

#include "hullguard/detector.h"
#include "hullguard/frame.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a freeze frame is doing. 0 is not a good state. */
typedef enum {
    HG_FREEZE_OFF       = 0, /* not started */
    HG_FREEZE_RECORDING = 1, /* every sample is entered, the oldest is overwritten */
    HG_FREEZE_CLOSING   = 2, /* an alarm was confirmed; the samples after it, or the checksum, are still missing */
    HG_FREEZE_FROZEN    = 3  /* can be read */
} hg_freeze_state;

#define HG_FREEZE_STATE 1U /* command: tell the state */
#define HG_FREEZE_READ 2U  /* command: hand out words */
#define HG_FREEZE_CLEAR 3U /* command: record anew */
#define HG_FREEZE_NO_WORD 0xFFFFU /* the place of a response that tells the state */

typedef struct {                /* flash: one a model, generated */
    uint8_t           samples;  /* rows of the ring, 1 .. 255 */
    uint8_t           after;    /* of them after the sample of the alarm, 0 .. samples - 1 */
    uint8_t           burst;    /* frames a request or sample, 1 .. 255 */
    const hg_message *request;  /* 8 bytes, no fields; P22 */
    const hg_message *response; /* 8 bytes, no fields; P22 */
} hg_freeze_config;

typedef struct {           /* what a sample was judged to be */
    uint32_t k;            /* sample */
    uint32_t candidates;   /* as in hg_verdict, */
    uint16_t bus;          /* and so is this */
    hg_plant plant;
    hg_basis basis;
} hg_freeze_row;

typedef struct {               /* owned by the caller; part of the storage type that a model is generated */
    hg_freeze_row *row;        /* [samples] */
    hg_real       *real;       /* [samples][HG_FREEZE_REALS(width, residuals)] */
} hg_freeze_memory;

/** Numbers of a sample. */
#define HG_FREEZE_REALS(width, residuals) (2U * ((uint32_t)(width) + (uint32_t)(residuals)))

typedef struct {               /* RAM: one a node */
    const hg_freeze_config *config;
    const hg_detector      *detector;
    hg_freeze_memory        memory;
    uint32_t                model_hash; /* of the node's tables */
    uint32_t                crc;       /* of the words summed so far */
    uint32_t                summed;    /* words */
    uint32_t                next;      /* word to hand out, up to */
    uint32_t                end;       /* this one */
    hg_freeze_state         state;
    uint8_t                 newest;    /* row of the last sample */
    uint8_t                 held;      /* rows in use */
    uint8_t                 rest;      /* samples of this alarm still to come */
    uint8_t                 record;    /* number of the last record, wraps; 0 before the first */
    uint8_t                 missed;    /* alarms confirmed while there was a record, saturated at 63 */
    uint8_t                 credit;    /* frames that may be handed out */
    uint8_t                 counter;   /* of the next response */
    uint8_t                 stamp;     /* of the last sample */
    bool                    confirmed; /* was the last sample? */
    bool                    answer;    /* a request waits for the state */
    uint16_t                refused;   /* requests that were not good, or did not fit the state; saturates */
} hg_freeze;

/** Begin with nothing held.
 *  @param[in] detector  started; its numbers are recorded
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    a number out of range, a message that is not as above, or a record of more than 65 535 words */
hg_status hg_freeze_start(hg_freeze *self, const hg_freeze_config *config, const hg_freeze_memory *memory, const hg_detector *detector, uint32_t model_hash);

/** A sample has been closed. Cost: a copy of its numbers, or after an alarm as many steps of a checksum. */
void hg_freeze_step(hg_freeze *self, const hg_freeze_row *row);

/** Take a request.
 *  @retval HG_OK         answered by hg_freeze_report()
 *  @retval HG_E_ID       no request
 *  @retval HG_E_FORMAT   wrong length or kind
 *  @retval HG_E_CRC      damaged
 *  @retval HG_E_NUMERIC  no such command
 *  @retval HG_E_STATE    there is no such record, or no such word; answered with the state */
hg_status hg_freeze_receive(hg_freeze *self, const hg_can_frame *frame);

/** The next frame to send. @retval HG_OK *frame  @retval HG_E_EMPTY none now */
hg_status hg_freeze_report(hg_freeze *self, hg_can_frame *frame);

/** Words of the record that is held, its checksum included. */
uint32_t hg_freeze_words(const hg_freeze *self);

/** A word of the record, of a node that is FROZEN. @param[in] place  0 .. hg_freeze_words() - 1 */
uint32_t hg_freeze_word(const hg_freeze *self, uint32_t place);

#ifdef __cplusplus
}
#endif

#endif
