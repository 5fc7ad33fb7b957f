/** @file
 *  From residuals and thresholds to a verdict on the plant (methods, platoon, section 4, "Confirmation").
 *
 *  A residual outside its threshold is an alarm: within the stated bounds no fault-free explanation is left. It is provisional while a
 *  group that feeds the generator is in doubt (its radius relied on silence, hold.h). The group's next frame settles it: either no frame was
 *  lost, then the alarm stands, or one was, then the alarm is taken back and judged anew with the corrected radii. Without doubt an
 *  alarm is confirmed at once. Debounce counts samples in a row: up before an alarm counts, down before a confirmed one, which shows for a
 *  sample at least, heals; a latched one never heals until restart. Not reentrant per instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_DECISION_H
#define HULLGUARD_DECISION_H

#include "hullguard/real.h"
#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* State of the plant. 0 is not a good state. */
typedef enum {
    HG_PLANT_STARTING    = 0, /* the initial state still dominates a threshold */
    HG_PLANT_NONE        = 1, /* no fault shows */
    HG_PLANT_PROVISIONAL = 2, /* an alarm that a lost frame could still explain */
    HG_PLANT_CONFIRMED   = 3  /* no fault-free explanation is left */
} hg_plant;

/* What a verdict rests on. */
typedef enum {
    HG_BASIS_UNSET       = 0, /* no verdict yet */
    HG_BASIS_SET         = 1, /* bounds: no false alarm while they hold */
    HG_BASIS_STATISTICAL = 2  /* probabilities: a stated rate of false alarms */
} hg_basis;

typedef struct {            /* flash: one a model, generated */
    uint8_t         generators; /* 1 .. HG_GENERATORS_MAX */
    const uint8_t  *feeds;      /* [generators] bit i: group i has a non-zero weight in the generator */
    const uint32_t *faults;     /* [generators] bit i: fault i of the model moves the generator */
    uint8_t         up;         /* alarms in a row that count as one, >= 1 */
    uint8_t         down;       /* quiet samples in a row that heal, >= 1 */
    bool            latch;      /* a confirmed alarm stays */
} hg_decision_config;

typedef struct {            /* RAM: one a generator */
    hg_plant state;         /* NONE, PROVISIONAL or CONFIRMED */
    uint8_t  up;            /* alarms in a row, saturated at the configured number */
    uint8_t  down;          /* quiet samples in a row */
    uint8_t  pending;       /* groups whose next frame must settle the alarm */
} hg_alarm;

typedef struct {            /* RAM: one a model */
    const hg_decision_config *config;
    hg_alarm                 *alarm; /* [generators] */
    uint32_t                  left;  /* faults that can explain every alarm that was confirmed since the plant was last without one */
} hg_decision;

typedef struct {            /* what one sample brings */
    uint32_t alarm;         /* bit g: a residual of generator g is outside its threshold */
    bool     ready;         /* every generator has settled after its start */
    uint8_t  doubt;         /* bit i: group i's radii rely on silence since its last frame */
    uint8_t  rewound;       /* bit i: group i's past radii were just corrected */
} hg_evidence;

/** Is any |r_i| > J_i? NaN in r or J counts as yes. Cost: n comparisons. */
static inline bool hg_decision_exceeds(const hg_real *r, const hg_real *J, uint8_t n)
{
    bool exceeds = false;
    for (uint8_t i = 0U; i < n; i++) {
        const bool outside = !(hg_real_abs(r[i]) <= J[i]); /* written so that NaN is an alarm, never blindness */
        exceeds = exceeds || outside;
    }
    return exceeds;
}

/** Begin with no alarm.
 *  @param[in] alarm  [generators] memory, owned by the caller
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    a number outside its range above */
hg_status hg_decision_start(hg_decision *self, const hg_decision_config *config, hg_alarm *alarm);

/** Forget all alarms, latched ones too. */
void hg_decision_reset(hg_decision *self);

/** One sample.
 *  @param[out] candidates  faults that can explain every alarm that was confirmed since the plant was last without one, healed ones too, or, while
 *              none is, every provisional one; 0 without an alarm, and when no single fault explains them all. Once confirmed, the true one is
 *              among them as long as there is only one.
 *  Result: state of the plant. Cost: generators x 10 operations. */
hg_plant hg_decision_step(hg_decision *self, const hg_evidence *evidence, uint32_t *candidates);

#ifdef __cplusplus
}
#endif

#endif
