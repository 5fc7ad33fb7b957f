/** @file
 *  What the receiver knows about an event-triggered group between its frames: the last value, and how wrong it may be by now.
 *  Counterpart of trigger.h (methods, platoon, section 4). Radius of channel g, j samples after the last frame:
 *
 *      j = 0                          half_g                                      quantisation and the rounding of encoder and decoder
 *      j <= silence                   slew_g(j)                                   the sender does not look yet
 *      later                          min(threshold_g resolution_g + half_g, slew_g(j))
 *      a frame is known to be lost    slew_g(j) from the last good frame on       (counter, stamp, checksum, or none when interval_max has passed)
 *      longer than interval_max + margin, never, or sent as invalid:  span_g      stale
 *
 *  A radius that relies on the sender's silence is conditional: a lost frame that shows only later makes it too small in hindsight. Until
 *  the next frame the group is in doubt; when a loss shows, the step answers how many past samples to rewrite, and hg_hold_past() how wide.
 *  Not reentrant per instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_HOLD_H
#define HULLGUARD_HOLD_H

#include "hullguard/code.h"
#include "hullguard/real.h"
#include "hullguard/ring.h"
#include "hullguard/status.h"
#include "hullguard/trigger.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Health of one group's link. 0 is not a good state. */
typedef enum {
    HG_BUS_ABSENT = 0, /* no good frame yet */
    HG_BUS_GOOD   = 1, /* nothing is known to be lost */
    HG_BUS_LOSSY  = 2, /* a frame was lost and two good ones in a row have not been seen since */
    HG_BUS_STALE  = 3  /* no good frame for longer than interval_max + margin */
} hg_bus_health;

typedef struct {                       /* flash: one a group, generated */
    const hg_trigger_config *trigger;  /* the sender's promise */
    uint8_t                  margin;   /* samples after interval_max until the group is stale, 0 .. 255 - interval_max - 1 */
    const hg_code_scale     *scale;      /* [width] */
    const hg_real           *half;       /* [width] |y - decode(encode(y))| is at most this, signal units */
    const hg_real           *slew;       /* [interval_max + margin][width] |y(k+j) - decode(encode(y(k)))|, j = 1 .., never above span */
    const hg_real           *span;       /* [width] upper end of the range minus its lower end */
    const hg_real           *middle;     /* [width] middle of the range: the value before the first frame */
} hg_hold_config;

typedef struct {               /* RAM: one a group */
    const hg_hold_config *config;
    int32_t              *sent;      /* [width] codes of the last good frame */
    int32_t              *previous;  /* [width] codes of the one before */
    hg_real              *value;     /* [width] of the last good frame, signal units */
    hg_real              *promise;   /* [width] its radius while the sender, who must not be silent beyond it, is silent */
    uint8_t               age;       /* samples since the last good frame, saturated */
    uint8_t               good;      /* good frames in a row: 0 none yet, 1, or 2 */
    uint8_t               level;     /* of the trigger, known when good is 2 */
    uint8_t               silence;   /* samples since that frame in which the sender may not look */
    bool                  holes;     /* a signal has no value: it was sent as invalid, or nothing was sent */
    bool                  seen;      /* has there been a good frame? */
    bool                  recovering; /* the last good frame came after a loss */
    bool                  fresh;     /* a good frame arrived for the open sample */
    bool                  lost;      /* a loss is known since the last good frame */
    bool                  doubt;     /* a radius since the last good frame relied on silence */
    bool                  gap;       /* the fresh frame revealed a loss */
    uint8_t               gap_age;   /* age of the good frame before the gap, samples */
} hg_hold;

/** Memory of one group, integers and numbers. */
#define HG_HOLD_CODES(width) (2U * (uint32_t)(width))
#define HG_HOLD_REALS(width) (2U * (uint32_t)(width))

/** Begin before the first sample: nothing known, radius = span.
 *  @param[in] codes  [HG_HOLD_CODES(width)] memory, owned by the caller
 *  @param[in] reals  [HG_HOLD_REALS(width)] the same
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    the trigger's tables are not valid, one of the group's is missing, holds no radius or a scale's
 *                         exponent that is not valid, or interval_max + margin does not fit */
hg_status hg_hold_start(hg_hold *self, const hg_hold_config *config, int32_t *codes, hg_real *reals);

/** Take a good frame of the open sample (the one that the next hg_hold_step() will take).
 *  @param[in] code       [width] codes as sent; HG_CODE_INVALID where the sender had no value
 *  @param[in] continues  did the frame's sequence counter continue the last good frame's?
 *  @retval HG_OK          booked
 *  @retval HG_E_REPEATED  the sample already has a frame; nothing changed
 *  Cost: width x 2 copies, 2 multiplications and, for each level it may be on, one more: a sample without a frame has none. */
hg_status hg_hold_receive(hg_hold *self, const int32_t *code, bool continues);

/** A frame of this group is known to be lost: it came damaged, early, late or refused. From now on only the slew is trusted. */
void hg_hold_lose(hg_hold *self);

/** Close the sample: what is known now, and how wrong it may be.
 *  @param[out] value   [width] signal units, finite
 *  @param[out] radius  [width] signal units, finite, >= 0
 *  @param[out] rewind  number of past samples, this one not counted, whose radii hg_hold_past() now corrects; 0 nearly always
 *  Cost: width comparisons; the same with a frame, without one, and after a loss. */
void hg_hold_step(hg_hold *self, hg_real *value, hg_real *radius, uint8_t *rewind);

/** Radii of a past sample in the light of a loss; to be called after a step that asked for it, for lag = 1 .. rewind.
 *  @param[in]  lag     samples before the one just stepped
 *  @param[out] radius  [width] */
void hg_hold_past(const hg_hold *self, uint8_t lag, hg_real *radius);

/** The same for lag = 1 .. lags, in the ring of radii that thresholds read: this group's signals stand in its rows from place `first` on.
 *  @param[in] lags  at most rewind and ring length - 1
 *  Cost: lags x width copies. */
void hg_hold_rewrite(const hg_hold *self, hg_ring *ring, uint8_t first, uint8_t lags);

/** Does a radius since the last good frame rely on the sender's silence? */
static inline bool hg_hold_doubt(const hg_hold *self)
{
    return self->doubt;
}

/** Samples since the last good frame as of the last step, 0 in the sample of a frame; saturates at 255, as does never. */
uint8_t hg_hold_age(const hg_hold *self);

/** Health of the link as of the last step. */
hg_bus_health hg_hold_health(const hg_hold *self);

#ifdef __cplusplus
}
#endif

#endif
