/** @file
 *  What a fault estimate stands for (methods, suspension, section 1.6). A weak spring and a worn damper enter a plant through the same column as an
 *  actuator, so that an unknown-input observer (uio.h) shows them as a fault of the actuator. Only their course differs: a component that has lost a
 *  share of what it does acts like a force  share c x, which follows the plant's motion; the actuator's force does not. Hence a regression
 *
 *      fhat(k) = offset + sum_i share_i phi_i(k)          phi_i: c_i xhat, averaged over the interval that fhat is about, through fhat's low pass
 *
 *  with a row c_i for each component: the force that the whole of it exerts (spring: stiffness times deflection; damper: damping times its rate), so
 *  that a share of 1 is its complete loss. It runs from `settle` samples after the estimate has left its radius until it has been back for `release`,
 *  over the last `blocks` blocks of `block` samples, and is judged at the end of each. With m the mean and s^2 the mean square about it:
 *
 *      one component alone explains fhat, with the offset and without it:
 *      R^2 > explained both about the means and about 0, and s(phi_i) >= excitation_i                            component i
 *      several do                                                                                              ambiguous: one of these
 *      none does, |m(fhat)| > steady s(fhat), and no phi_i is as steady and at least half as large                actuator
 *      the same, but some phi_i are: a plant at rest off its middle                                            ambiguous: actuator or one of these
 *      all together explain it, R^2 > explained                                                                ambiguous: several components
 *      anything else                                                                                           ambiguous
 *
 *  and sensors' fault estimates, which have rows of their own, tell for themselves. Two faults at once are ambiguous. Not told by this, or any other
 *  regression: a fault of the actuator that follows the motion as a component's would, and changes of what only the unknown input feels (a tyre).
 *  A verdict of this kind is one of probabilities (HG_BASIS_STATISTICAL): the alarm itself is the detector's and rests on bounds.
 *
 *  The regression is a triangular factor updated by rotations without square roots (Gentleman 1973): its first column, of ones, centres all others,
 *  and no number is ever squared and subtracted, so that float32 is enough. A block begins with an empty factor: memory is bounded, what is older than
 *  the window is forgotten to the last bit, and rounding does not gather. For floating-point hg_real only: the ratios of a factor's entries, which it
 *  divides, have no bound that holds for any data. An image in fixed point has the estimates and their radii, and no isolation.
 *  Not reentrant per instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_ISOLATE_H
#define HULLGUARD_ISOLATE_H

#include "hullguard/decision.h"
#include "hullguard/real.h"
#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if !HG_REAL_Q31
#define HG_ISOLATE_LARGEST HG_REAL_C(1e9) /* of any force or estimate that is taken in: sums of squares stay finite in float32 */

/* What the plant's behaviour comes from. 0 is not a good state. */
typedef enum {
    HG_CAUSE_UNDECIDED = 0, /* a fault shows, and the window is not full yet */
    HG_CAUSE_INPUT     = 1, /* no fault shows: what moves the plant is its unknown inputs */
    HG_CAUSE_ACTUATOR  = 2, /* a force that its command does not explain */
    HG_CAUSE_COMPONENT = 3, /* a part that has become weaker or stiffer */
    HG_CAUSE_SENSOR    = 4, /* a reading that is wrong */
    HG_CAUSE_AMBIGUOUS = 5  /* more than one candidate, or more than one fault */
} hg_cause;

typedef struct {                 /* flash: one an actuator-fault estimate, generated */
    uint8_t        estimates;    /* length of the vectors read, 1 .. 255 */
    uint8_t        actuator;     /* row of the actuator-fault estimate */
    hg_real        limit;        /* smallest magnitude of it that counts even where its radius is smaller, >= 0 */
    uint8_t        sensors;      /* 0 .. 30 - components */
    const uint8_t *sensor;       /* [sensors] rows of sensor-fault estimates */
    const hg_real *sensor_limit; /* [sensors] as limit */
    uint8_t        components;   /* 0 .. 30 */
    const hg_real *whole;        /* [components][estimates] c_i: force of the whole component, in the unit of the actuator's fault */
    const hg_real *excitation;   /* [components] smallest s(phi_i) that says something: beyond what noise alone makes of phi_i, > 0 */
    hg_real        low_pass;     /* a of the actuator-fault estimate, 0 < a <= 1 */
    uint32_t       settle;       /* samples of an episode that are left out: the onset, and the low pass */
    uint32_t       release;      /* samples within radius or limit that end an episode, >= 1 */
    uint16_t       block;        /* samples of a block, >= 1 */
    uint8_t        blocks;       /* of the window, >= 1 */
    hg_real        explained;    /* smallest R^2 that names a component: 0 .. < 1; usual: 0.9 */
    hg_real        steady;       /* smallest |mean| / scatter that names the actuator, > 0; usual: 5 */
} hg_isolate_config;

typedef struct {                 /* what a sample says */
    hg_cause cause;
    hg_basis basis;              /* HG_BASIS_STATISTICAL */
    uint32_t candidates;         /* bit 0: the actuator, bits 1 ..: the components, then the sensors */
    hg_real  explained;          /* R^2 of all components together in the last window, 0 .. 1 */
    hg_real  ratio;              /* squared mean of fhat over its mean square about it, at most HG_REAL_MAX */
} hg_isolation;

typedef struct {                 /* RAM */
    const hg_isolate_config *config;
    hg_isolation             found;
    hg_real                 *share;    /* [components + 1] offset, then share_i, of the last window that was judged; 0 before it, and where a component
                                          moves less than excitation_i beyond what those before it explain */
    hg_real                 *now;      /* [components] c_i xhat of the last sample */
    hg_real                 *smooth;   /* [components] phi_i */
    hg_real                 *row;      /* [components + 1] scratch */
    hg_real                 *factor;   /* [blocks + 1] of HG_ISOLATE_FACTOR(components) numbers: a block each, and the window's */
    uint32_t                 age;      /* samples of this episode, saturated */
    uint32_t                 quiet;    /* samples since the actuator's estimate was last outside, saturated */
    uint32_t                 silent;   /* the same of the sensors' */
    uint32_t                 seen;     /* bit i: sensor i in the sensors' episode */
    uint16_t                 filled;   /* samples in the open block */
    uint8_t                  open;     /* the block that is being filled */
    uint8_t                  complete; /* blocks that are full */
    bool                     episode;  /* of the actuator's estimate */
} hg_isolate;

/** Numbers of a regression with so many components: weights, the triangle above them, right-hand sides, residual sum of squares. */
#define HG_ISOLATE_FACTOR(components) \
    ((2U * ((uint32_t)(components) + 1U)) + ((((uint32_t)(components) + 1U) * (uint32_t)(components)) / 2U) + 1U)

/** Memory, numbers. */
#define HG_ISOLATE_REALS(components, blocks) \
    ((4U * (uint32_t)(components)) + 2U + (((uint32_t)(blocks) + 1U) * HG_ISOLATE_FACTOR(components)))

/** Are sizes and numbers within the ranges above? Cost: sensors + components x estimates comparisons. */
bool hg_isolate_valid(const hg_isolate_config *config);

/** Begin with no fault seen.
 *  @param[in] memory  [HG_ISOLATE_REALS(components, blocks)], owned by the caller
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    hg_isolate_valid() says no */
hg_status hg_isolate_start(hg_isolate *self, const hg_isolate_config *config, hg_real *memory);

/** Begin again: with the observer whose estimates it reads. */
void hg_isolate_reset(hg_isolate *self);

/** One sample.
 *  @param[in]  estimate, radius  [estimates] of the same sample, the observer's
 *  @param[out] found             what is known after it
 *  @retval HG_OK         taken in
 *  @retval HG_E_NUMERIC  an estimate or a component's force is not finite or beyond HG_ISOLATE_LARGEST, or a radius is NaN: nothing changed, and
 *                        *found is the last sample's
 *  Cost, with c components: c x estimates multiplications; in an episode 2 (c + 1) (c + 3) more and 2 (c + 1) divisions; at the end of a block, for
 *  each block of the window, (c + 1)^3 and (c + 1)^2 divisions. */
hg_status hg_isolate_step(hg_isolate *self, const hg_real *estimate, const hg_real *radius, hg_isolation *found);

#endif

#ifdef __cplusplus
}
#endif

#endif
