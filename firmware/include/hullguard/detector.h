/** @file
 *  A detector: holds of all groups, residual generators, banks of certificates and polynomial filters side by side, each with its threshold, under one
 *  decision. It knows codes and samples, nothing of frames or clocks. One sample is
 *
 *      hg_detector_receive()  for each good frame of the open sample      hg_detector_lose()  for each one known to be lost
 *      hg_detector_step()     closes it: hold, derived signals, generators, banks, filters, thresholds, decision
 *
 *  The signal vector: what the groups send, group after group; then what is derived from it: the predicted groups' signals (predict.h), then
 *  the uncertain states (mismatch.h). Generators, thresholds and banks name their signals by place and do not care which is which.
 *  A missing frame only widens radii. Not reentrant per instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_DETECTOR_H
#define HULLGUARD_DETECTOR_H

#include "hullguard/bank.h"
#include "hullguard/decision.h"
#include "hullguard/hold.h"
#include "hullguard/hull.h"
#include "hullguard/mismatch.h"
#include "hullguard/predict.h"
#include "hullguard/residual.h"
#include "hullguard/ring.h"
#include "hullguard/statistic.h"
#include "hullguard/status.h"
#include "hullguard/zonotope.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {                /* flash: one a model, generated */
    uint8_t                   signals;    /* sent ones, 1 .. 255 */
    uint8_t                   width;      /* length of the signal vector: sent and derived, 1 .. 255 */
    uint8_t                   groups;     /* 1 .. HG_GROUPS_MAX; their signals follow one another in the vector */
    const hg_hold_config     *hold;       /* [groups] */
    uint8_t                   predictors; /* predicted groups, 0 .. HG_GROUPS_MAX */
    const hg_predict_config  *predict;    /* [predictors] */
    const hg_mismatch_config *mismatch;   /* of an uncertain plant, or null */
    uint8_t                   generators; /* 0 .. HG_GENERATORS_MAX */
    const hg_residual_config *residual;   /* [generators] */
    const hg_hull_config     *hull;       /* [generators] thresholds by the exact hull, or null: then by */
    const hg_zonotope_config *zonotope;   /* [generators] zonotopes */
    uint8_t                   banks;      /* generators + banks + polynomials: 1 .. HG_GENERATORS_MAX */
    const hg_bank_config     *bank;       /* [banks] */
    uint8_t                   polynomials; /* polynomial filters */
    const hg_statistic_config *polynomial; /* [polynomials], not read without one */
    hg_decision_config        decision;   /* of generators, then banks, then polynomial filters */
    uint8_t                   history;    /* rows of the ring of radii, 1 .. 255: more than the taps of any hull, with zonotopes than any interval_max, as many as any bank's window */
    uint8_t                   window;     /* rows of the ring of values: the longest window of a bank; 0 without one */
    uint16_t                  residuals;  /* of all generators together, one for each bank, HG_STATISTICS for each polynomial filter */
    uint16_t                  codes;      /* numbers of integer memory: HG_HOLD_CODES(signals) */
    uint32_t                  reals;      /* numbers of real memory: hg_detector_reals() */
    uint32_t                  sums;       /* numbers of the banks' memory: hg_detector_sums() */
} hg_detector_config;

typedef struct {                /* where a detector keeps what it knows; owned by the caller, one storage type a model is generated */
    hg_hold  *hold;             /* [groups] */
    hg_predict *predict;        /* [predictors], null without one */
    hg_residual *residual;      /* [generators], null without one */
    hg_hull  *hull;             /* [generators], null without one */
    hg_zonotope *zonotope;      /* [generators], null without one */
    hg_bank  *bank;             /* [banks], null without one */
    hg_statistic *polynomial;   /* [polynomials], null without one */
    hg_alarm *alarm;            /* [generators + banks + polynomials] */
    int32_t  *code;             /* [codes] */
    uint16_t  codes;            /* length of code[] */
    hg_real  *real;             /* [reals] */
    uint32_t  reals;            /* length of real[] */
    hg_acc   *sum;              /* [sums], null without a bank */
    uint32_t  sums;             /* length of sum[] */
} hg_detector_memory;

typedef struct {                /* RAM: one a detector */
    const hg_detector_config *config;
    hg_detector_memory        memory;
    hg_ring                   radii;     /* of the whole signal vector */
    hg_ring                   values;    /* of the sent signals, for the banks */
    hg_decision               decision;
    hg_real                  *value;     /* [width] of the last sample */
    hg_real                  *radius;    /* [width] of the last sample: the newest row of radii */
    hg_real                  *r;         /* [residuals] of the last sample, generators one after another, then the closest of each bank, then the filters' statistics */
    hg_real                  *J;         /* [residuals] of the last sample */
    hg_real                  *past;      /* [width] scratch */
    uint32_t                  refusals;  /* steps of generators, banks and filters refused for a number that is not finite; saturates */
    uint8_t                   samples;   /* closed since it began, saturated: no radius before is corrected */
    uint32_t                  beginnings; /* the start and restarts since, wraps: what keeps a state beside it (uio.h) begins again with it */
} hg_detector;

typedef struct {                /* what a step found */
    hg_plant plant;
    hg_basis basis;             /* SET where what rests on bounds says it too */
    uint32_t candidates;        /* bit i: fault i of the model can explain the alarm; 0 without one, or when no single fault can */
} hg_finding;

/** Numbers of real memory that a configuration needs. Cost: a pass over generators, predictors and filters. */
uint32_t hg_detector_reals(const hg_detector_config *config);

/** Numbers of the banks' memory that a configuration needs. Cost: a pass over the banks. */
uint32_t hg_detector_sums(const hg_detector_config *config);

/** Begin before a sample.
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_SIZE      code[], real[] or sum[] is shorter than the configuration needs
 *  @retval HG_E_CONFIG    tables contradict one another */
hg_status hg_detector_start(hg_detector *self, const hg_detector_config *config, const hg_detector_memory *memory, hg_start how);

/** Begin again with the same configuration, in the middle of a drive: z = 0, windows are empty, the thresholds hold for a plant anywhere in its
 *  range (how = HG_START_MOVING), and what the holds know stays. Cost: a pass over the real memory. */
void hg_detector_restart(hg_detector *self, hg_start how);

/** Take a good frame of the open sample.
 *  @param[in] group      0 .. groups - 1
 *  @param[in] code       [width of the group]
 *  @param[in] continues  did its sequence counter continue?
 *  @retval HG_OK          booked
 *  @retval HG_E_REPEATED  the sample already has a frame of this group
 *  @retval HG_E_NUMERIC   a code is neither valid nor HG_CODE_INVALID; booked as lost
 *  @retval HG_E_ARGUMENT  no such group */
hg_status hg_detector_receive(hg_detector *self, uint8_t group, const int32_t *code, bool continues);

/** A frame of this group is known to be lost. @retval HG_OK noted  @retval HG_E_ARGUMENT no such group */
hg_status hg_detector_lose(hg_detector *self, uint8_t group);

/** Close the sample and judge it.
 *  @retval HG_OK         *finding is this sample's
 *  @retval HG_E_NUMERIC  a generator, a bank or a filter refused a number that is not finite; a generator or filter begins again, and *finding is the others'
 *  Cost: the sum of its parts; independent of the data but for a rewind. */
hg_status hg_detector_step(hg_detector *self, hg_finding *finding);

#ifdef __cplusplus
}
#endif

#endif
