/** @file
 *  A fusion filter on a bus: what every node that has to know the common prediction runs, the centre and each of its sensors alike
 *  (fusion.h, consistency.h, e2e.h), and what a sensor's node does beside it. Every node sees the same frames and computes the same, so that all copies are
 *  equal to the bit; hg_tracker_digest() is what two of them compare.
 *
 *      a sensor's frame   CRC 8 | counter 4, sample modulo 16 4 | value: float32, or 16 bits of a code            profile 22
 *      the tick           CRC 8 | counter 4, sample modulo 16 4          closes the sample; of any one node, after all sensors' frames
 *      verdict, status    as frame.h draws them: basis statistical; candidate i: sensor i is dead, frozen or biased, and is out of the fusion
 *      estimate           CRC 8 | counter 4, sample modulo 16 4 | state 32 | standard deviation 16; a frame a state
 *
 *      a node             on every frame: hg_tracker_receive(); then, and overdue: while (hg_tracker_step() == HG_OK) { send what hg_tracker_report() and
 *                         hg_tracker_estimate() hand out, a sensor's node nothing }
 *      a sensor's node    after that its reading: hg_fusion_sender_step(); the frame goes to its own hg_tracker_receive() once it is sent for certain, never before
 *
 *  Values on the wire are absolute; the filter takes them relative to its local origin. One that wraps round has the codes minimum .. maximum of its scale for
 *  all multiples of their range, and means the one nearest to the prediction.
 *
 *  A frame is booked to the sample of its stamp: to the open one, and up to `depth` samples back. One that is up to `delay` late is as good as one in time, is due
 *  that much later, and leaves all copies equal. Its counter may have moved by a frame a sample, no
 *  further. A tick up to 7 samples ahead closes those between without their frames; a late one is refused, and two late ones in sequence are of a time that this node
 *  has lost: the filter begins again there. The sample index is known from the first tick on.
 *
 *  A sensor that consistency.h blames is taken out in every node in the same sample, until the node starts again; one that is dead (fusion.h, watchdog) is back with
 *  its next frame. Bits 2i+1:2i of a verdict's bus are of sensors i and i + 8: the larger number. While none is heard, nobody is suspected: then it is the bus. Nodes that start at different times have copies that come near to each other but are not
 *  equal; neither are those of nodes that did not hear the same frames, which a CAN controller that accepts or refuses for all prevents.
 *
 *  Float only: a fixed-point build leaves this module out. Not reentrant per instance; no allocation. */
#ifndef HULLGUARD_TRACKER_H
#define HULLGUARD_TRACKER_H

#include "hullguard/consistency.h"
#include "hullguard/node.h"

#ifdef __cplusplus
extern "C" {
#endif

#if HG_REAL_F32 || HG_REAL_F64

typedef struct {                     /* flash: one a sensor */
    const hg_message *message;       /* one field; protected, with a stamp and a counter that every check is on for */
    bool              wraps;         /* codes go round: the field has more of them than minimum .. maximum, and the offset is 0 */
} hg_tracker_source;

typedef struct {                     /* flash: one a model, generated */
    const hg_fusion_config      *fusion;      /* without inputs; modulus as the frames' */
    const hg_consistency_config *consistency; /* NULL: nobody is judged */
    const hg_tracker_source     *source;      /* [sensors] */
    const hg_message            *tick;        /* no fields; protected as the sources */
    const hg_message            *verdict;     /* 8 bytes, no fields; P22 */
    const hg_message            *status;      /* 8 bytes, no fields; P22 */
    const hg_message            *estimate;    /* [states] two fields each: state and its standard deviation */
    uint16_t                     heartbeat;   /* samples between two status frames, >= 1 */
    uint16_t                     interval;    /* samples between two estimates, >= 1 */
    uint32_t                     model_hash;  /* of the model that the tables are of */
} hg_tracker_config;

typedef struct {                     /* owned by the caller; one storage type a model is generated */
    hg_fusion_memory      fusion;
    hg_consistency_memory consistency; /* not read without a configuration */
    hg_link              *link;      /* [sensors + 1] the last one is the tick's */
    hg_real              *real;      /* [2 states] */
} hg_tracker_memory;

typedef struct {                     /* RAM: one a node */
    const hg_tracker_config *config;
    hg_fusion       fusion;          /* its sample is the open one */
    hg_consistency  consistency;
    hg_link        *link;            /* [sensors + 1] */
    hg_real        *value;           /* [states] estimate of the sample closed last, absolute */
    hg_real        *deviation;       /* [states] its standard deviations */
    uint32_t        k;               /* the open sample */
    uint32_t        unknown;         /* frames with an identifier that is not the model's */
    uint32_t        overdue;         /* samples closed without their tick */
    uint16_t        blamed;          /* bit i: sensor i was taken out */
    uint16_t        lossy;           /* bit i: frames were lost before its last one */
    uint8_t         due;             /* steps to make */
    bool            ticked;          /* by a tick? */
    bool            synchronised;    /* has a tick told which sample is open? */
    bool            judging;         /* has the consistency test begun to judge? */
    bool            slipped;         /* the last tick was late */
    uint8_t         slipped_counter; /* its sequence counter */
    uint8_t         slipped_stamp;   /* and its stamp */
    uint8_t         ahead_max;       /* samples that a tick can be ahead */
    bool            reported;        /* has a verdict frame been handed out? */
    uint16_t        silence;         /* samples since the last status frame */
    uint16_t        unsaid;          /* samples since the last estimate */
    hg_verdict      last;
    uint8_t         verdict_counter; /* of the next verdict frame */
    uint8_t         status_counter;  /* of the next status frame */
    uint8_t         estimate_counter; /* of the next estimate */
} hg_tracker;

/** Begin: sample 0 is open until a tick says otherwise.
 *  @param[in] how  HG_START_REST: sample 0 is the plant's too; HG_START_MOVING: the first tick tells
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    tables contradict one another */
hg_status hg_tracker_start(hg_tracker *self, const hg_tracker_config *config, const hg_tracker_memory *memory, hg_start how);

/** Take a frame from the bus, whatever it is; a sensor's node: its own too, once it is sent.
 *  @retval HG_OK          booked; after the tick hg_tracker_step() has work
 *  @retval HG_E_ID        not a frame of this model
 *  @retval HG_E_FORMAT    wrong length or kind
 *  @retval HG_E_CRC       damaged
 *  @retval HG_E_REPEATED  a duplicate, or there is a value for this sample already
 *  @retval HG_E_STAMP     of a sample that is not held
 *  @retval HG_E_SEQUENCE  the counter jumped further than the time allows
 *  @retval HG_E_STATE     good, but its link is not to be trusted yet
 *  @retval HG_E_NUMERIC   no value, or out of range
 *  @retval HG_E_BUSY      steps are due: make them first; nothing changed
 *  Cost: that of its checksum, n multiplications and a division. */
hg_status hg_tracker_receive(hg_tracker *self, const hg_can_frame *frame);

/** The application's clock says that a tick received now cannot be further ahead of the open sample than this. @param[in] samples  0 .. 7; more are taken as 7 */
void hg_tracker_expect(hg_tracker *self, uint32_t samples);

/** The open sample's tick has not come in time: the sample is closed without it. */
void hg_tracker_overdue(hg_tracker *self);

/** More ticks may have been missed than a stamp can tell: the filter begins again with the next one. */
void hg_tracker_outage(hg_tracker *self);

/** Close a sample that is due, judge its sensors, and open the next.
 *  @param[out] verdict  of the sample just closed
 *  @retval HG_OK       done
 *  @retval HG_E_EMPTY  nothing is due
 *  Cost: hg_fusion_close(), hg_consistency_step(), hg_fusion_open() and n square roots. */
hg_status hg_tracker_step(hg_tracker *self, hg_verdict *verdict);

/** Frames to send after a step, as hg_node_report(). @param[out] frame  [2]. Result: number of frames, 0 .. 2. */
uint8_t hg_tracker_report(hg_tracker *self, const hg_verdict *verdict, bool reply, hg_can_frame *frame);

/** The estimate of the sample closed last, a frame a state: to be asked for j = 0 .. states - 1, in that order, once after each step.
 *  @retval HG_OK       send *frame
 *  @retval HG_E_EMPTY  not in this sample */
hg_status hg_tracker_estimate(hg_tracker *self, uint8_t j, hg_can_frame *frame);

/** FNV-1a over all that must be equal in nodes of one number type and byte order: prediction, covariance and origin of the newest sample that no frame in time can change.
 *  @param[in] digest  of the samples before; HG_TRACKER_DIGEST for none */
uint32_t hg_tracker_digest(const hg_fusion *fusion, uint32_t digest);
#define HG_TRACKER_DIGEST 0x811C9DC5U /* where a digest begins */

/** Health of a sensor's link; `sensors`: of the tick's. */
const hg_link_health *hg_tracker_health(const hg_tracker *self, uint8_t i);

/* ---- A sensor's node ---- */

typedef struct {            /* RAM: one a sensor of this node */
    const hg_tracker *tracker; /* the node's own copy */
    uint8_t           sensor;  /* 0 .. sensors - 1 */
    uint8_t           counter; /* of the next frame: it counts those that were to be sent, so that receivers see what was lost */
} hg_fusion_sender;

/** Begin. @param[in] tracker  started  @param[in] sensor  0 .. sensors - 1
 *  @retval HG_OK ready  @retval HG_E_ARGUMENT a null pointer, or no such sensor */
hg_status hg_fusion_sender_start(hg_fusion_sender *self, const hg_tracker *tracker, uint8_t sensor);

/** One reading, in the sample that is open in the node's own copy.
 *  @param[in]  y      absolute, signal units
 *  @param[in]  dice   HG_FUSION_STOCHASTIC: -2 ln u, a fresh random number; else not read
 *  @param[in]  own    a trigger of the sensor's own says so (HG_FUSION_OWN); else false
 *  @param[out] frame  to be sent now, valid only with HG_OK
 *  @retval HG_OK         send *frame, and once it is sent for certain give it to hg_tracker_receive() of the own copy
 *  @retval HG_E_EMPTY    silence
 *  @retval HG_E_NUMERIC  y is not finite or out of range: nothing that could be sent
 *  @retval HG_E_STATE    which sample is open is not known yet */
hg_status hg_fusion_sender_step(hg_fusion_sender *self, hg_real y, hg_real dice, bool own, hg_can_frame *frame);

#endif
#ifdef __cplusplus
}
#endif

#endif
