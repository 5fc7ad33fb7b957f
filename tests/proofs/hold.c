/** @file
 *  hold.h: what the receiver knows between frames. */
#include "contract.h"

#if HG_REAL_Q31

/* Radii of all samples so far, newest at k: what was said of each, as corrected since. */
typedef struct {
    int32_t truth[SAMPLES];
    hg_real value[SAMPLES];
    hg_real radius[SAMPLES];
} record;

static bool covered(const record *past, uint8_t k)
{
    const int64_t apart = (int64_t)past->truth[k] - past->value[k];
    return ((apart < 0) ? -apart : apart) <= past->radius[k];
}

/* A step of a slew-limited signal within its range. */
static int32_t moved(int32_t from)
{
    const int32_t to = any_i32_in(-RANGE, RANGE);
    assume(((to - from) <= SLEW) && ((from - to) <= SLEW));
    return to;
}

/** The radius is never too small for a lawful sender. Sender (trigger.h) and receiver (hold.h) run side by side for SAMPLES samples over a link that loses any frames, each with
 *  or without the receiver's knowing: |true value - value| <= radius holds in every sample that does not rely on a silence that may yet be taken back, and once a loss has
 *  shown, for all samples that hg_hold_past() rewrites and all before. A radius that is too small stands only in a group in doubt, after a frame was lost unseen.
 *  One channel, one unit a code, in integers; any signal within +-RANGE that moves by at most SLEW a sample; interval_max INTERVAL, LEVELS levels; any absolute and relative
 *  thresholds (delta a multiple of 1/16) and activities up to SIGMA, any silence. A lost frame is known by the next one's counter or at once; the sender starts with the first sample.
 *  @proves hg_hold_start hg_hold_receive hg_hold_lose hg_hold_step hg_hold_past hg_hold_doubt
 *  @run check real=q31 unwind=7 limit=150 SAMPLES=5U INTERVAL=3U LEVELS=1U SIGMA=7 SLEW=3 RANGE=15 MARGIN=1U
 *  @run deep real=q31 unwind=9 limit=3600 SAMPLES=7U INTERVAL=4U LEVELS=2U SIGMA=7 SLEW=3 RANGE=15 MARGIN=1U
 *  @run deep real=q31 unwind=10 limit=7200 SAMPLES=8U INTERVAL=4U LEVELS=2U SIGMA=7 SLEW=3 RANGE=31 MARGIN=1U */
void proof_hold_radius(void)
{
    uint8_t silence[LEVELS];
    uint16_t delta[LEVELS];
    int32_t sigma[LEVELS];
    int32_t activity[LEVELS];
    for (uint8_t l = 0U; l < LEVELS; l++) {
        silence[l] = any_u8_in(0U, INTERVAL - 1U);
        delta[l] = (uint16_t)(any_u8_in(0U, 15U) * 4096U);
        sigma[l] = any_i32_in(0, SIGMA);
        activity[l] = any_i32_in(0, SIGMA);
    }
    const int32_t zero = 0;
    const hg_trigger_config promise = {.width = 1U, .levels = LEVELS, .interval_max = INTERVAL, .silence = silence, .delta = delta, .sigma = sigma, .activity = activity, .zero = &zero};
    const hg_code_scale scale = {.resolution = 1, .offset = 0, .per_unit = 1, .exponent = 0, .minimum = -RANGE, .maximum = RANGE};
    const hg_real half = 0;
    const hg_real span = 2 * RANGE;
    const hg_real middle = 0;
    hg_real slew[INTERVAL + MARGIN];
    for (int32_t j = 0; j < (int32_t)(INTERVAL + MARGIN); j++) {
        slew[j] = (((j + 1) * SLEW) < span) ? ((j + 1) * SLEW) : span;
    }
    const hg_hold_config config = {.trigger = &promise, .margin = MARGIN, .scale = &scale, .half = &half, .slew = slew, .span = &span, .middle = &middle};
    hg_trigger sender;
    hg_hold receiver;
    int32_t sent;
    int32_t codes[HG_HOLD_CODES(1U)];
    hg_real reals[HG_HOLD_REALS(1U)];
    record past;
    prove(hg_trigger_start(&sender, &promise, &sent) == HG_OK, "the sender starts");
    prove(hg_hold_start(&receiver, &config, codes, reals) == HG_OK, "the receiver starts");
    int32_t truth = any_i32_in(-RANGE, RANGE);
    bool whole = true;  /* has every frame since the last good one come? */
    bool secret = false; /* has one been lost that the receiver does not know of? */
    for (uint8_t k = 0U; k < SAMPLES; k++) {
        truth = moved(truth);
        past.truth[k] = truth;
        if (hg_trigger_step(&sender, &truth) == HG_OK) {
            const uint8_t fate = any_u8_in(0U, 2U);
            if (fate == 0U) {
                prove(hg_hold_receive(&receiver, &truth, whole) == HG_OK, "a frame is booked");
                whole = true;
                secret = false;
            } else {
                whole = false;
                if (fate == 1U) {
                    hg_hold_lose(&receiver);
                } else {
                    secret = true;
                }
            }
        }
        uint8_t rewind;
        hg_hold_step(&receiver, &past.value[k], &past.radius[k], &rewind);
        prove(past.radius[k] >= 0, "a radius");
        prove(rewind <= k, "no sample before the first is rewritten");
        for (uint8_t lag = 1U; lag <= rewind; lag++) {
            hg_hold_past(&receiver, lag, &past.radius[k - lag]);
        }
        prove(covered(&past, k) || (hg_hold_doubt(&receiver) && secret), "too small only in doubt, and after a loss unseen");
        if (!hg_hold_doubt(&receiver)) {
            for (uint8_t j = 0U; j <= k; j++) {
                prove(covered(&past, j), "settled: every sample so far");
            }
        }
        if (rewind > 1U) {
            reach("a past that is rewritten");
        }
    }
    reach("end");
}

#else

/* Tables of any content. */
typedef struct {
    uint8_t       silence[LEVELS];
    uint16_t      delta[LEVELS * WIDTH];
    int32_t       sigma[LEVELS * WIDTH];
    int32_t       activity[LEVELS * WIDTH];
    int32_t       zero[WIDTH];
    hg_code_scale scale[WIDTH];
    hg_real       half[WIDTH];
    hg_real       slew[HORIZON * WIDTH];
    hg_real       span[WIDTH];
    hg_real       middle[WIDTH];
} tables;

static void any_state(hg_hold *self)
{
    self->age = any_u8();
    self->good = any_u8();
    self->level = any_u8();
    self->silence = any_u8();
    self->holes = any_bool();
    self->seen = any_bool();
    self->recovering = any_bool();
    self->fresh = any_bool();
    self->lost = any_bool();
    self->doubt = any_bool();
    self->gap = any_bool();
    self->gap_age = any_u8();
}

/** A hold takes any frames, losses and silences, of any valid tables: no overrun, what is past rewritten only for samples that the slew's table knows; a second
 *  frame of a sample is refused; and it is again in a state that samples can leave.
 *  WIDTH channels, LEVELS levels, a slew table of HORIZON rows; any tables; a sample in any state that samples can leave.
 *  @proves hg_hold_start hg_hold_receive hg_hold_lose hg_hold_step hg_hold_doubt hg_hold_age hg_hold_health
 *  @run check real=f32 unwind=6 limit=150 WIDTH=1U LEVELS=1U HORIZON=3U
 *  @run deep real=f32 unwind=12 limit=3600 WIDTH=3U LEVELS=2U HORIZON=4U */
void proof_hold_step(void)
{
    tables t;
    int32_t codes[HG_HOLD_CODES(WIDTH)];
    hg_real reals[HG_HOLD_REALS(WIDTH)];
    const uint8_t interval = any_u8_in(1U, HORIZON);
    const uint8_t margin = (uint8_t)(HORIZON - interval);
    const hg_trigger_config promise = {.width = WIDTH, .levels = LEVELS, .interval_max = interval, .silence = t.silence, .delta = t.delta, .sigma = t.sigma, .activity = t.activity, .zero = t.zero};
    const hg_hold_config config = {.trigger = &promise, .margin = margin, .scale = t.scale, .half = t.half, .slew = t.slew, .span = t.span, .middle = t.middle};
    hg_hold self;
    prove((hg_hold_start(NULL, &config, codes, reals) == HG_E_ARGUMENT) && (hg_hold_start(&self, NULL, codes, reals) == HG_E_ARGUMENT) &&
              (hg_hold_start(&self, &config, NULL, reals) == HG_E_ARGUMENT) && (hg_hold_start(&self, &config, codes, NULL) == HG_E_ARGUMENT),
          "null pointers");
    any_state(&self);
    const hg_hold other = self;
    assume(requires_hold_start(&config, codes, reals));
    const hg_status started = hg_hold_start(&self, &config, codes, reals);
    prove(ensures_hold_start(&self, &other, &config, codes, reals, started), "begun, or refused for its tables");
    if (started != HG_OK) {
        return;
    }
    /* Memory of its own for each part: what runs over the end of one is outside. */
    int32_t sent[WIDTH];
    int32_t previous[WIDTH];
    hg_real held[WIDTH];
    hg_real promised[WIDTH];
    self.sent = sent;
    self.previous = previous;
    self.value = held;
    self.promise = promised;
    any_state(&self);
    assume(state_hold(&self));
    hg_real value[WIDTH];
    hg_real radius[WIDTH];
    int32_t code[WIDTH];
    uint8_t rewind;
    if (any_bool()) {
        const hg_hold before = self;
        hg_hold_lose(&self);
        prove(kept_hold(&self, &before) && state_hold(&self) && self.lost, "noted");
    }
    if (any_bool()) {
        const hg_hold before = self;
        assume(requires_hold_receive(&self, code));
        const hg_status status = hg_hold_receive(&self, code, any_bool());
        prove(ensures_hold_receive(&self, &before, status), "one a sample");
        if (status == HG_OK) {
            reach("a frame");
        }
    }
    const hg_hold before = self;
    assume(requires_hold_step(&self, value, radius, &rewind));
    hg_hold_step(&self, value, radius, &rewind);
    prove(ensures_hold_step(&self, &before, rewind), "no further back than the sender may have been silent");
    if (rewind > 0U) {
        reach("a past to rewrite");
    }
    prove((!hg_hold_doubt(&self)) || (hg_hold_age(&self) < interval), "doubt ends with the silence");
    prove((hg_hold_age(&self) >= 1U) || (self.good > 0U) || self.lost, "age 0 is that of a frame");
    prove((hg_hold_health(&self) >= HG_BUS_ABSENT) && (hg_hold_health(&self) <= HG_BUS_STALE), "one of four");
    prove(self.seen || (hg_hold_health(&self) == HG_BUS_ABSENT), "absent until the first");
}

/** What is past is rewritten only in the samples asked for, in the places of the group, and by no row that the slew's table does not have.
 *  WIDTH channels, a slew table of HORIZON rows, a ring of LENGTH rows, in which the group has its place behind another; any state that samples can leave.
 *  @proves hg_hold_past hg_hold_rewrite
 *  @run check real=f32 unwind=6 limit=150 WIDTH=2U LEVELS=1U HORIZON=3U LENGTH=3U */
void proof_hold_past(void)
{
    hg_trigger_config promise = {.width = WIDTH, .levels = LEVELS, .interval_max = any_u8_in(1U, HORIZON)};
    const hg_hold_config config = {.trigger = &promise, .margin = (uint8_t)(HORIZON - promise.interval_max), .slew = any_array(hg_real, HORIZON * WIDTH), .span = any_array(hg_real, WIDTH)};
    hg_hold self = {.config = &config, .sent = any_array(int32_t, WIDTH), .previous = any_array(int32_t, WIDTH), .value = any_array(hg_real, WIDTH), .promise = any_array(hg_real, WIDTH)};
    any_state(&self);
    hg_ring ring = {.data = any_array(hg_real, LENGTH * (WIDTH + 1U)), .width = WIDTH + 1U, .length = LENGTH, .newest = any_u8()};
    const uint8_t row = any_u8_in(0U, LENGTH - 1U);
    const hg_real *other = &ring.data[row * (WIDTH + 1U)];
    const hg_real before = *other;
    hg_real radius[WIDTH];
    const uint8_t lag = any_u8();
    const uint8_t lags = any_u8();
    if (any_bool()) {
        assume(requires_hold_past(&self, lag, radius));
        hg_hold_past(&self, lag, radius);
        reach("a past sample");
    } else {
        assume(requires_hold_rewrite(&self, &ring, 1U, lags));
        hg_hold_rewrite(&self, &ring, 1U, lags);
        prove((*other == before) || (before != before), "another group's radius");
        reach("the past in a ring");
    }
}

#endif
