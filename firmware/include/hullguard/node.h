/** @file
 *  What runs on an ECU, between a CAN controller and the library: a sender (trigger, codec, protection) and a detector node (protection,
 *  codec, detector, verdict frames). No clock is read: the detector's time is the closing frame, and an application whose closing frame is
 *  overdue says so with hg_node_overdue().
 *
 *      on every frame:      hg_node_receive(&node, &frame)
 *      then, and overdue:   while (hg_node_step(&node, &verdict) == HG_OK) { send what hg_node_report() hands out }
 *      then, with freeze.h: while (hg_node_freeze(&node, &frame) == HG_OK) { send the frame }
 *
 *  Stamps. The project's own frames carry k modulo 16. A measurement frame of another sample is early (1 .. 7 ahead) or late: counted, treated
 *  as lost, never booked to the wrong sample. Its counter may have moved by as many frames as the sender can have sent since the last good one
 *  and no further. A frame without a stamp, of a vehicle's own network, belongs to the sample that is open when it comes: its radii must allow
 *  for that (the design's skew). Where a closing frame is missing, too, it may be of a later sample: the detector then begins again, unless the
 *  application's clock has closed the sample in time with hg_node_overdue().
 *  A closing frame j <= 7 ahead makes j steps without it first. One that is late, or whose counter has not moved with its sample, is refused;
 *  two such running that agree with each other (and, where the application has a clock, with the samples it closed as overdue in between:
 *  old frames sent once more come in a burst) are of a sender that began anew or of one this node has lost: the detector restarts at the
 *  sender's sample with nothing known of any group. The sample index never goes back. More than 7 closing frames lost in a row read as fewer,
 *  or as none: the application, which has a clock, must have called hg_node_overdue() for each, or call hg_node_outage(). Otherwise an
 *  alarm after such an outage may be false. Closing frames without a stamp are timed by their counter alike.
 *  A link that has seen too many damaged frames is not trusted until good ones came (e2e.h, INVALID). A closing frame that is not, or whose numbers
 *  are out of range, still tells the time, and its numbers count as lost. What may come and what becomes of it: the table in firmware/README.md.
 *  Not reentrant per instance. hg_inbox is the one structure that an interrupt may share with the main loop. */
#ifndef HULLGUARD_NODE_H
#define HULLGUARD_NODE_H

#include "hullguard/detector.h"
#include "hullguard/e2e.h"
#include "hullguard/frame.h"
#include "hullguard/freeze.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Sender ---- */

typedef struct {                       /* flash: one a group */
    const hg_message        *message;
    const hg_trigger_config *trigger;
} hg_sender_config;

typedef struct {                       /* RAM: one a group */
    const hg_sender_config *config;
    hg_trigger              trigger;
    int32_t                *code;      /* [width] this sample's codes */
    uint8_t                 counter;   /* of the next frame */
} hg_sender;

/** Begin before the first sample. A sender that begins anew while others listen (its ECU has restarted) first keeps silent for interval_max samples:
 *  its counter may by chance continue the old one, and only that silence tells receivers that its promise was broken meanwhile.
 *  @param[in] codes  [2 width] memory, owned by the caller
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    message and trigger contradict each other */
hg_status hg_sender_start(hg_sender *self, const hg_sender_config *config, int32_t *codes);

/** One sample: encode, ask the trigger, and when it says so lay out a protected frame.
 *  @param[in]  k      sample index; its low 4 bits become the frame's stamp
 *  @param[in]  value  [width] signal units; NaN, infinity and out of range are sent as invalid
 *  @param[out] frame  to be sent now, valid only with HG_OK
 *  @retval HG_OK       send *frame
 *  @retval HG_E_EMPTY  silence */
hg_status hg_sender_step(hg_sender *self, uint32_t k, const hg_real *value, hg_can_frame *frame);

/* ---- Detector node ---- */

typedef struct {                       /* flash: one a model, generated */
    const hg_detector_config *detector;
    const hg_message         *message;    /* [groups] */
    uint8_t                   closing;    /* the group whose frame closes the sample */
    const hg_message         *verdict;    /* 8 bytes, or 12 for more than 16 faults; no fields: the map stands in frame.h; P22 */
    const hg_message         *status;     /* 8 bytes, no fields; P22 */
    uint16_t                  heartbeat;  /* samples between heartbeats, >= 1 */
    uint32_t                  model_hash; /* of the model that the tables are of; the status frame carries it */
    const hg_freeze_config   *freeze;     /* or null: nothing is recorded */
} hg_node_config;

typedef struct {            /* what happened on one group's link since the start; every counter saturates */
    uint16_t good;          /* frames booked */
    uint16_t lost;          /* by the sequence counter */
    uint16_t crc;           /* damaged */
    uint16_t format;        /* wrong length or kind */
    uint16_t repeated;      /* duplicates */
    uint16_t early;         /* stamped ahead of the open sample */
    uint16_t late;          /* stamped behind it */
    uint16_t sequence;      /* the counter jumped further than the time allows: old frames, a second sender, one that began anew */
    uint16_t untrusted;     /* good, but too many before were not (HG_E2E_INVALID) */
    uint16_t numeric;       /* a value neither in range nor marked invalid */
    uint16_t invalid;       /* frames with a value marked invalid by its sender */
} hg_link_health;

typedef struct {            /* RAM: one a group */
    hg_e2e_receiver receiver;
    hg_e2e_machine  machine;
    uint32_t        k;      /* sample of the last frame whose checksum was good */
    bool            timed;  /* is that sample known? */
    hg_link_health  health;
} hg_link;

typedef struct {            /* the record that the verdict frame carries */
    uint32_t   k;           /* sample it speaks of */
    uint32_t   model_hash;  /* of the node's tables */
    uint32_t   candidates;  /* bit i: fault i of the model can explain the alarm */
    hg_plant   plant;
    hg_basis   basis;
    uint16_t   bus;         /* bits 2i+1:2i: hg_bus_health of group i */
    bool       refused;     /* has a number been refused since the start? */
} hg_verdict;

typedef struct {                /* RAM: one a node */
    const hg_node_config *config;
    hg_detector     detector;
    hg_link        *link;       /* [groups] */
    int32_t        *closing;    /* [width of the closing group] codes waiting for their sample */
    uint32_t        k;          /* the open sample */
    uint32_t        unknown;    /* frames with an identifier that is not the model's */
    uint32_t        overdue;    /* samples closed without the numbers of their closing frame */
    uint8_t         due;        /* steps to make */
    bool            held;       /* closing[] waits for the last of them */
    bool            continues;  /* and its sequence counter continued */
    bool            synchronised; /* has a closing frame told which sample is open? */
    bool            slipped;    /* the last closing frame was refused, late or out of step */
    uint8_t         slipped_counter; /* its sequence counter */
    uint8_t         slipped_stamp;   /* and its stamp */
    uint32_t        slipped_k;  /* the sample that was open then */
    bool            clocked;    /* the application has a clock: it has called hg_node_overdue() or hg_node_expect() */
    bool            closed;     /* has a closing frame been accepted? */
    uint8_t         closing_counter; /* of the last one accepted, or late in its sequence: its counter */
    uint32_t        closing_k;  /* and its sample */
    uint8_t         ahead_max;  /* samples that a closing frame can be ahead */
    bool            reported;   /* has a verdict frame been handed out? */
    uint16_t        silence;    /* samples since the last heartbeat */
    hg_verdict      last;       /* the last one of those */
    uint8_t         verdict_counter; /* of the next verdict frame */
    uint8_t         status_counter;  /* of the next status frame */
    hg_freeze      *freeze;     /* null without one */
} hg_node;

typedef struct {                /* owned by the caller; one storage type a model is generated */
    hg_detector_memory detector;
    hg_link           *link;    /* [groups] */
    int32_t           *closing; /* [width of the closing group] */
    hg_freeze         *freeze;  /* this and the next are not read without a freeze frame */
    hg_freeze_memory   frozen;
} hg_node_memory;

/** Begin before a sample. Sample 0 is open until a closing frame says otherwise.
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_SIZE      memory shorter than the configuration needs
 *  @retval HG_E_CONFIG    tables contradict one another */
hg_status hg_node_start(hg_node *self, const hg_node_config *config, const hg_node_memory *memory, hg_start how);

/** Take a frame from the bus, whatever it is. Every refusal is counted in the group's link, and a refused or damaged frame of a group counts as lost.
 *  A request for the freeze frame is answered as hg_freeze_receive() says; it is in no link, and hg_freeze.refused counts.
 *  @retval HG_OK          booked; after the closing frame hg_node_step() has work, and after one that is HG_E_STATE or HG_E_NUMERIC
 *  @retval HG_E_ID        not a frame of this model
 *  @retval HG_E_FORMAT    wrong length or kind
 *  @retval HG_E_CRC       damaged
 *  @retval HG_E_REPEATED  a duplicate, or a second frame of the group for the same sample (which then counts as lost)
 *  @retval HG_E_STAMP     of another sample
 *  @retval HG_E_SEQUENCE  the counter jumped further than the time allows
 *  @retval HG_E_STATE     good, but its link is not to be trusted yet
 *  @retval HG_E_NUMERIC   a value out of range
 *  @retval HG_E_BUSY      steps are due: make them first; nothing changed */
hg_status hg_node_receive(hg_node *self, const hg_can_frame *frame);

/** The application's clock says that a closing frame received now cannot be further ahead of the open sample than this.
 *  @param[in] samples  0 .. 7; more are taken as 7, which it is after the start. An old closing frame, sent once more, can look as if it were
 *  up to 7 samples ahead: who has a clock and calls this before hg_node_receive() refuses it. */
void hg_node_expect(hg_node *self, uint32_t samples);

/** The open sample's closing frame has not come in time: the sample is closed without it. */
void hg_node_overdue(hg_node *self);

/** More closing frames may have been missed than the stamp can tell, which is 7: the process was stopped, or frames were dropped on the way.
 *  The application sees it by the time between two closing frames. The detector forgets all it holds and begins again, anywhere in the
 *  plant's range, with the sample of the next closing frame. Steps that are due are dropped. Cost: a pass over the real memory. */
void hg_node_outage(hg_node *self);

/** Make one step that is due.
 *  @retval HG_OK       *verdict is of the sample just closed
 *  @retval HG_E_EMPTY  nothing is due */
hg_status hg_node_step(hg_node *self, hg_verdict *verdict);

/** Frames to send after a step: a verdict frame when plant, candidates, basis, bus or refused changed; with every heartbeat one, and a status frame.
 *  @param[in]  reply  answer this step in any case (lockstep)
 *  @param[out] frame  [2]
 *  Result: number of frames, 0 .. 2. */
uint8_t hg_node_report(hg_node *self, const hg_verdict *verdict, bool reply, hg_can_frame *frame);

/** The next frame that answers a request for the freeze frame (freeze.h). @retval HG_OK  send *frame  @retval HG_E_EMPTY  none now, or no freeze frame */
hg_status hg_node_freeze(hg_node *self, hg_can_frame *frame);

/** Read a verdict frame; the other end of the wire. k is known modulo 4096, the model hash is not in it.
 *  @retval HG_OK  @retval HG_E_FORMAT  @retval HG_E_CRC */
hg_status hg_verdict_read(const hg_message *message, const hg_can_frame *frame, hg_verdict *verdict, bool *reply);

/** Are these messages a verdict and a status frame as frame.h draws them? */
bool hg_report_valid(const hg_message *verdict, const hg_message *status);

/** Write a verdict frame. @param[in] reply  sent only to answer a tick in lockstep  @param[in] counter  sequence counter of the frame, 0 .. 15 */
void hg_verdict_write(const hg_message *message, const hg_verdict *verdict, bool reply, uint8_t counter, hg_can_frame *frame);

/** Write a status frame. @param[in] verdict  its k and model_hash are sent  @param[in] lost, refusals  frames since the start */
void hg_status_write(const hg_message *message, const hg_verdict *verdict, uint32_t lost, uint32_t refusals, uint8_t counter, hg_can_frame *frame);

/** Count a frame that was refused with this status; others are not counted here. */
void hg_link_refuse(hg_link_health *health, hg_status status);

/** Health of one group's link. @param[in] group  0 .. groups - 1 */
const hg_link_health *hg_node_health(const hg_node *self, uint8_t group);

/* ---- From a receive interrupt to the main loop ---- */

typedef struct {                    /* RAM; one writer, one reader, no lock: wait-free on one core */
    hg_can_frame     *frame;        /* [length] */
    uint8_t           length;       /* a power of two, 2 .. 128 */
    volatile uint8_t  written;      /* frames put, modulo 256: only the interrupt writes it */
    volatile uint8_t  read;         /* frames taken, modulo 256: only the main loop writes it */
    volatile uint16_t overflow;     /* frames that found no room, saturated: only the interrupt writes it */
} hg_inbox;

/** @retval HG_OK ready  @retval HG_E_ARGUMENT  a null pointer, or length is not a power of two in 2 .. 128 */
hg_status hg_inbox_start(hg_inbox *self, hg_can_frame *frame, uint8_t length);

/** From the interrupt. @retval HG_OK stored  @retval HG_E_BUSY no room: counted, the frame is lost, and its sequence counter will tell */
hg_status hg_inbox_put(hg_inbox *self, const hg_can_frame *frame);

/** From the main loop. @retval HG_OK *frame is the oldest  @retval HG_E_EMPTY none */
hg_status hg_inbox_get(hg_inbox *self, hg_can_frame *frame);

#ifdef __cplusplus
}
#endif

#endif
