/** @file
 *  Event-triggered sequential fusion (methods, fusion): one Kalman filter whose sensors send a scalar measurement only when it differs from what the
 *  common prediction says of it, and in which silence is information. It brings its own receiver side: its triggers compare with a prediction,
 *  not with a held value, so hold.h has no part in it. Estimates are statistical: a mean and a covariance, not a bound.
 *
 *      open    x <- A x + B u,  P <- A P A' + Q;  for every sensor i  reference = C_i x,  variance S_i = C_i P C_i' + R_i           (section 3)
 *      due     the sensor speaks when its trigger says so, or when its last frame is `heartbeat` samples old
 *      close   for every sensor in its order one scalar update:  g = P C_i', s = C_i g + R', K = g / s, x <- x + K r', P by Joseph's form
 *
 *          what is known of a sensor             r'                    R'
 *          a value                               y - C_i x             R;  with |r'| > huber sqrt(s) it grows to huber's weight: |r'| sqrt(s) / huber - C_i g
 *          silence                               reference - C_i x     R + s relax,  relax = 1 / beta_p - 1
 *          lost, or silent when it had to speak  none
 *
 *  beta_p is a constant a sensor, threshold and loss rate (host: design/fusion.py); no exponential is computed here. Silence pulls towards the
 *  reference, the middle of the interval it stands for: to first order that is the mean of the normal distribution cut off there. For a closed-loop stochastic
 *  trigger it is exact.
 *
 *  Every node that has to know the prediction runs this same code on the same frames: the sensors on those they overhear, each on its own as well,
 *  with the value as received (quantised), and only once it was sent for certain. All decisions are made from what every node has by then, in the same
 *  order, so that the states of all nodes are equal to the bit (-ffp-contract=off; one number type).
 *
 *  Late frames. A frame may be `delay` samples late as a matter of course: until then silence means less (table `early`), what has passed is
 *  filtered again in each close, and references are predictions from the last sample that no frame can change any more. A frame that comes later still, or what
 *  a frame says of the past (hg_fusion_recall), is filtered in as long as it is within `depth` samples; only this node then knows it, which is why references of
 *  nodes that must stay equal want every frame within `delay`.
 *
 *  Local origin. float32 resolves 2^-24 of the largest position, so a state with an origin step > 0 is kept below about one step: when it is beyond, whole
 *  steps move into an integer, in the same sample in all nodes. Measurements are relative to the origin: y = absolute - C_i (origin step), hg_fusion.origin.
 *
 *  Float only: a fixed-point build leaves this module out. Not reentrant per instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_FUSION_H
#define HULLGUARD_FUSION_H

#include "hullguard/linalg.h"
#include "hullguard/real.h"
#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if HG_REAL_F32 || HG_REAL_F64

/* When a sensor speaks: r = y - reference. */
typedef enum {
    HG_FUSION_OBSERVATION = 1, /* r^2 > level: a fixed width, measurement units squared */
    HG_FUSION_INNOVATION  = 2, /* r^2 > level S: level is delta_i^2 */
    HG_FUSION_STOCHASTIC  = 3, /* level r^2 > dice S, dice = -2 ln u with u uniform in 0 .. 1 */
    HG_FUSION_SCHEDULED   = 4, /* C_i P C_i' > level, P after the updates of the sensors before it: no data in it, so that a missing frame is a lost one */
    HG_FUSION_OWN         = 5  /* what the node cannot know (variance.h): silence says nothing, hg_fusion_due() tells the heartbeat alone */
} hg_fusion_trigger;

typedef struct {           /* flash: one a set of sensors alive, generated */
    uint16_t       alive;  /* bit i: sensor i speaks */
    const hg_real *level;  /* [sensors] of the trigger, > 0 */
    const hg_real *relax;  /* [rates][sensors] 1 / beta_p - 1 at the loss rates 0, rate_step, ..; negative: silence says nothing */
    const hg_real *early;  /* [rates][sensors] the same while the frame may be on its way; read with delay > 0 only */
} hg_fusion_table;

typedef struct {                  /* flash: generated; shared by all nodes */
    uint8_t                states;     /* n: 1 .. HG_FUSION_STATES_MAX */
    uint8_t                inputs;     /* 0 .. 255 */
    uint8_t                sensors;    /* m: 1 .. HG_FUSION_SENSORS_MAX */
    uint8_t                depth;      /* L: past samples that can be filtered again, 0 .. 14: a stamp modulo 16 tells no more */
    uint8_t                delay;      /* samples that a frame may be late as a matter of course, 0 .. depth */
    uint8_t                heartbeat;  /* H: longest time between two frames of a sensor, samples, 1 .. watchdog */
    uint8_t                watchdog;   /* samples without a frame after which a sensor counts as dead, heartbeat .. 254; usual 3 H */
    uint16_t               modulus;    /* values of the frames' sequence counter, 2 .. 256 (e2e.h) */
    hg_fusion_trigger      trigger;
    const hg_real         *A;          /* n x n */
    const hg_real         *B;          /* n x inputs; not read without inputs */
    const hg_real         *Q;          /* n x n, symmetric */
    const hg_real         *x0;         /* [n] estimate before the first sample, relative to the origin 0 */
    const hg_real         *P0;         /* n x n, symmetric, its covariance */
    const uint8_t         *select;     /* [m] C_i is the unit row of this state; or NULL, and then */
    const hg_real         *C;          /* m x n */
    const hg_real         *R;          /* [m] > 0 */
    const hg_real         *range;      /* [m] > 0: |y| is at most this, or the value is refused */
    hg_real                huber;      /* gamma, standard deviations, > 0; <= 0: every value has its full weight */
    const hg_real         *origin;     /* [n] step of the local origin, signal units, > 0 only where column j of A is that of the unit matrix; NULL or 0: none */
    uint8_t                rates;      /* loss rates that the tables know, >= 1 */
    hg_real                rate_step;  /* between two of them, > 0 */
    hg_real                loss;       /* loss rate to begin with, 0 .. 1; it counts as much as 16 frames */
    hg_real                smoothing;  /* least weight of one frame in the loss rate, 0 .. 1; until then a sensor's rate is the mean of all its frames */
    uint8_t                tables;     /* >= 1 */
    const hg_fusion_table *table;      /* [tables] the first is that of all sensors, and serves where none has the set of those alive */
} hg_fusion_config;

/* What is known of a sensor in one sample. */
typedef enum {
    HG_FUSION_NOTHING = 1, /* no frame: silence or a loss */
    HG_FUSION_VALUE   = 2, /* a frame with a value */
    HG_FUSION_SILENT  = 3, /* the sensor has said so */
    HG_FUSION_LOST    = 4  /* it spoke, and the frame is gone */
} hg_fusion_known;

typedef struct {               /* RAM: one a sensor and sample held */
    hg_real         y;         /* as received, relative to the present origin */
    hg_real         reference; /* what its trigger compares with, likewise */
    hg_real         variance;  /* S_i of the reference */
    hg_fusion_known known;
    uint8_t         counter;   /* of the frame, where counted */
    uint8_t         age;       /* samples since its last frame before this sample, saturated; `heartbeat` before the first */
    bool            counted;   /* the value came in a frame of its own */
    bool            expected;  /* HG_FUSION_SCHEDULED: it has to speak */
} hg_fusion_entry;

typedef struct {                  /* RAM: one a sample held */
    hg_real               *x;     /* [n] prediction for the sample, before its updates */
    hg_real               *P;     /* n x n */
    hg_real               *shift; /* [n] by how much the origin has moved since the sample was opened */
    hg_real               *u;     /* [inputs] that led to it */
    hg_fusion_entry       *entry; /* [m] */
    const hg_fusion_table *table; /* by the sensors alive */
    uint16_t               excluded; /* bit i: sensor i was taken out */
} hg_fusion_slot;

typedef struct {         /* RAM: one a sensor; counters saturate */
    uint16_t frames;     /* fused or excluded in time */
    uint16_t lost;       /* by the counter */
    uint16_t late;       /* filtered in after `delay`, or too late for that */
    uint16_t repeated;   /* a second value of one sample */
    uint16_t refused;    /* not finite or out of range */
    uint8_t  counter;    /* of the last frame */
    uint8_t  age;        /* samples since its last frame, as of the sample after the one closed last */
    bool     seen;       /* has there been one? */
    hg_real  loss;       /* loss rate, smoothed, 0 .. 1 */
} hg_fusion_sensor;

/* The last update of the newest sample that no frame in time can change any more, one a sensor: what consistency.h judges. */
typedef struct {
    hg_real  residual; /* r' */
    hg_real  spread;   /* s; <= 0: there was no update */
    hg_real *gain;     /* [n] K */
    hg_real  y;        /* value received, relative to the present origin */
    bool     value;    /* was there one? */
} hg_fusion_record;

typedef struct {
    hg_fusion_slot   *slot;   /* [depth + 1] */
    hg_fusion_entry  *entry;  /* [(depth + 1) m] */
    hg_fusion_sensor *sensor; /* [m] */
    hg_fusion_record *record; /* [m] */
    int32_t          *origin; /* [n] */
    hg_real          *real;   /* [HG_FUSION_REALS(n, inputs, m, depth)] */
} hg_fusion_memory;

/** Numbers in hg_fusion_memory. */
#define HG_FUSION_REALS(states, inputs, sensors, depth) \
    ((((uint32_t)(depth) + 1U) * (((uint32_t)(states) * ((uint32_t)(states) + 2U)) + (uint32_t)(inputs))) + \
     ((uint32_t)(states) * ((3U * (uint32_t)(states)) + 5U + (uint32_t)(sensors))))

typedef struct {                    /* RAM: one a node */
    const hg_fusion_config *config;
    hg_fusion_slot         *slot;
    hg_fusion_sensor       *sensor;
    hg_fusion_record       *record;
    int32_t                *origin; /* [n] whole steps of the local origin */
    hg_real                *x;      /* [n] estimate: prediction after open, with all that is known after close; relative to the origin */
    hg_real                *P;      /* n x n, its covariance */
    hg_real                *ahead;  /* [n] and */
    hg_real                *wide;   /* n x n: scratch for references */
    hg_real                *product; /* n x n scratch */
    hg_real                *g;      /* [n] scratch */
    hg_real                *next;   /* [n] scratch */
    hg_real                *move;   /* [n] scratch */
    uint32_t                k;      /* sample that is open, or was closed last; it wraps */
    uint16_t                excluded; /* from the next sample on */
    uint16_t                resets; /* times the state was not finite, saturated */
    uint8_t                 newest; /* place of sample k among the slots */
    uint8_t                 held;   /* samples held, 0 .. depth + 1 */
    uint8_t                 redo;   /* samples back from which on the next close filters again */
    bool                    open;   /* is sample k open? */
} hg_fusion;

/** Are sizes and tables within the ranges above? Cost: n^2 + tables rates m comparisons. */
bool hg_fusion_valid(const hg_fusion_config *config);

/** Begin: x0 and P0 before the first sample, origin 0, every sensor has to speak in the first.
 *  @param[in] memory  what its fields say, owned by the caller; the structure itself is not kept
 *  @retval HG_OK          ready for hg_fusion_open()
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    hg_fusion_valid() says no */
hg_status hg_fusion_start(hg_fusion *self, const hg_fusion_config *config, const hg_fusion_memory *memory);

/** Begin again; the counters go on. */
void hg_fusion_reset(hg_fusion *self);

/** Open the next sample: predict.
 *  @param[in] u  [inputs] since the sample before; not read without inputs
 *  @retval HG_OK          x and P are the prediction
 *  @retval HG_E_BUSY      the sample before is still open; nothing changed
 *  @retval HG_E_NUMERIC   an input is not finite; nothing changed
 *  Cost: (1 + delay)(1.5 n^3 + n^2 + n inputs) + m n^2 multiplications, with a schedule m n^2 more. */
hg_status hg_fusion_open(hg_fusion *self, const hg_real *u);

/** Has sensor i to speak in the open sample? To be asked of the sensor's own copy, before anything of the sample is booked there.
 *  @param[in] i     0 .. m - 1
 *  @param[in] y     its measurement, relative to the origin
 *  @param[in] dice  HG_FUSION_STOCHASTIC: -2 ln u, a fresh random number; else not read
 *  @retval HG_OK          send
 *  @retval HG_E_EMPTY     stay silent
 *  @retval HG_E_NUMERIC   y is not finite or out of range: nothing that could be sent
 *  @retval HG_E_STATE     no sample is open
 *  Cost: 3 multiplications. */
hg_status hg_fusion_due(const hg_fusion *self, uint8_t i, hg_real y, hg_real dice);

/** Book a frame.
 *  @param[in] i        0 .. m - 1
 *  @param[in] stamp    sample of the measurement modulo 16
 *  @param[in] counter  counts the sensor's frames, taken by the modulus
 *  @param[in] y        as received, relative to the origin as it was when the sample was opened
 *  @retval HG_OK          booked; filtered in by the next close
 *  @retval HG_E_STAMP     of a sample that is not held any more, or not yet
 *  @retval HG_E_REPEATED  there is a value already; nothing changed
 *  @retval HG_E_NUMERIC   y is not finite or out of range; nothing changed
 *  Counted each in hg_fusion_sensor. Cost: n multiplications. */
hg_status hg_fusion_receive(hg_fusion *self, uint8_t i, uint8_t stamp, uint8_t counter, hg_real y);

/** A value whose code wraps round on the wire (16 bits of an absolute position): of all that it can stand for, the one nearest to what is predicted.
 *  With an origin step that is a multiple of `period` it means the same to nodes whose origins differ, as they may where nodes do not hear the same frames.
 *  @param[in] i, stamp  as in hg_fusion_receive()
 *  @param[in] y         code times resolution
 *  @param[in] period    2^bits times resolution, > 0
 *  Result: for hg_fusion_receive() or hg_fusion_recall(); y itself when the sample is not held. Cost: one division. */
hg_real hg_fusion_unwrap(const hg_fusion *self, uint8_t i, uint8_t stamp, hg_real y, hg_real period);

/** An absolute measurement as hg_fusion_receive() and hg_fusion_due() take it: relative to the origin as it was when its sample was opened; the present one where that
 *  is not held. One that wraps round goes through hg_fusion_unwrap() next, and then its period is free.
 *  @param[in] i, stamp  as in hg_fusion_receive()  @param[in] y  absolute, signal units. Cost: 2 n multiplications. */
hg_real hg_fusion_local(const hg_fusion *self, uint8_t i, uint8_t stamp, hg_real y);

/** Number the open sample, of which nothing is booked yet: stamps count from it. @param[in] k  its index. Constant time. */
void hg_fusion_number(hg_fusion *self, uint32_t k);

/** Book what a frame says of its sensor's past.
 *  @param[in] stamp     sample of that frame modulo 16
 *  @param[in] spoken    bit b: the sensor has sent a frame b + 1 samples before it; 0: it was silent by its trigger
 *  @param[in] previous  value of the last of these frames, relative to the origin in that sample; not finite or out of range: not there
 *  Silences are confirmed; a frame that is missing here is known to be lost, or restored if it is the last. What is not held any more is left as it is.
 *  @retval HG_OK       booked, or there was nothing to book
 *  @retval HG_E_STAMP  that frame's sample is not held
 *  Cost: at most 8 + n operations, and the next close filters again from the first sample that changed. */
hg_status hg_fusion_recall(hg_fusion *self, uint8_t i, uint8_t stamp, uint8_t spoken, hg_real previous);

/** Close the sample: filter in what is booked.
 *  @retval HG_OK         x and P are the estimate
 *  @retval HG_E_STATE    no sample is open
 *  @retval HG_E_NUMERIC  the state was not finite any more and has begun again from x0 and P0; the sample is closed
 *  Cost a sample: m divisions by s and m (3 n^2 / 2 + 5 n) multiplications, dense rows n^2 + n more; times 1 + samples filtered again, with a prediction each. */
hg_status hg_fusion_close(hg_fusion *self);

/** Take a sensor out of the fusion from the next sample on, or back in. All nodes must do so in the same sample. Constant time. */
void hg_fusion_exclude(hg_fusion *self, uint8_t i, bool out);

/** Sensors that are in the fusion as of the newest sample: bit i, neither dead nor taken out. Cost: m comparisons. */
uint16_t hg_fusion_alive(const hg_fusion *self);

#endif
#ifdef __cplusplus
}
#endif

#endif
