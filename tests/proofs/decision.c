/** @file
 *  decision.h: what becomes of an alarm. */
#include "proof.h"

#include "hullguard/decision.h"

static bool within(uint32_t some, uint32_t all)
{
    return (some & ~all) == 0U;
}

/** A confirmed alarm stays, for good where it is latched, else until `down` quiet samples; a provisional one goes only when a group it waits for was rewound; a new alarm wants
 *  `up` raised samples in a row, and without doubt is confirmed at once. The state of the plant is that of its worst generator, STARTING only without an alarm; the
 *  candidates of a confirmed plant only shrink until it is without an alarm.
 *  Any configuration of up to GENERATORS generators, any state that a step can leave, any evidence in two samples.
 *  @proves hg_decision_start hg_decision_step hg_decision_reset
 *  @run check real=f32 unwind=5 limit=150 GENERATORS=2U
 *  @run deep real=f32 unwind=34 limit=3600 GENERATORS=32U */
void proof_decision(void)
{
    uint8_t feeds[GENERATORS];
    uint32_t faults[GENERATORS];
    hg_alarm alarm[GENERATORS];
    hg_alarm before[GENERATORS];
    hg_decision self;
    const uint8_t n = any_u8_in(0U, GENERATORS);
    const hg_decision_config config = {
        .generators = n, .feeds = TAIL(feeds, n), .faults = TAIL(faults, n), .up = any_u8(), .down = any_u8(), .latch = any_bool()};
    const hg_status started = hg_decision_start(&self, &config, TAIL(alarm, n));
    prove((started == HG_OK) == ((n >= 1U) && (config.up >= 1U) && (config.down >= 1U)), "numbers in range");
    prove((hg_decision_start(NULL, &config, alarm) == HG_E_ARGUMENT) && (hg_decision_start(&self, NULL, alarm) == HG_E_ARGUMENT) &&
              (hg_decision_start(&self, &config, NULL) == HG_E_ARGUMENT),
          "null pointers");
    assume(started == HG_OK);
    for (uint8_t g = 0U; g < n; g++) {
        prove(self.alarm[g].state == HG_PLANT_NONE, "no alarm");
        self.alarm[g] = (hg_alarm){.state = (hg_plant)any_u8_in(HG_PLANT_NONE, HG_PLANT_CONFIRMED), .up = any_u8(), .down = any_u8(), .pending = any_u8()};
        assume((self.alarm[g].up <= config.up) && (self.alarm[g].down <= config.down));
        assume((self.alarm[g].state != HG_PLANT_PROVISIONAL) || ((self.alarm[g].pending & config.feeds[g]) != 0U));
        before[g] = self.alarm[g];
    }
    self.left = any_u32();
    const hg_evidence evidence = {.alarm = any_u32(), .ready = any_bool(), .doubt = any_u8(), .rewound = any_u8()};
    const hg_evidence later = {.alarm = any_u32(), .ready = any_bool(), .doubt = any_u8(), .rewound = any_u8()};
    uint32_t candidates;
    uint32_t next;
    const hg_plant plant = hg_decision_step(&self, &evidence, &candidates);
    hg_plant worst = evidence.ready ? HG_PLANT_NONE : HG_PLANT_STARTING;
    for (uint8_t g = 0U; g < n; g++) {
        const hg_alarm *now = &self.alarm[g];
        const bool raised = ((evidence.alarm >> g) & 1U) != 0U;
        const bool was = before[g].state == HG_PLANT_CONFIRMED;
        const bool healed = (!config.latch) && (!raised) && ((before[g].down + 1U) >= config.down);
        const bool taken_back = (before[g].pending & evidence.rewound) != 0U;
        prove((!was) || (now->state == HG_PLANT_CONFIRMED) || ((now->state == HG_PLANT_NONE) && healed), "a confirmed alarm stays until it heals");
        prove((!was) || (!config.latch) || (now->state == HG_PLANT_CONFIRMED), "a latched one for good");
        prove((before[g].state != HG_PLANT_PROVISIONAL) || (now->state >= HG_PLANT_PROVISIONAL) || taken_back, "a provisional one until it is taken back");
        prove((before[g].state != HG_PLANT_NONE) || (now->state == HG_PLANT_NONE) || (raised && (now->up >= config.up)), "up in a row");
        prove(was || (!raised) || (config.up > 1U) || ((config.feeds[g] & evidence.doubt) != 0U) || (now->state == HG_PLANT_CONFIRMED), "without doubt confirmed at once");
        prove((now->state != HG_PLANT_PROVISIONAL) || ((now->pending & config.feeds[g] & evidence.doubt) != 0U), "a provisional one waits for a group in doubt");
        prove((now->up <= config.up) && (now->down <= config.down), "counters saturate");
        worst = ((now->state != HG_PLANT_NONE) && (now->state > worst)) ? now->state : worst;
    }
    prove(plant == worst, "the worst of all");
    const uint32_t left = self.left;
    const hg_plant after = hg_decision_step(&self, &later, &next);
    if ((plant == HG_PLANT_CONFIRMED) && (after == HG_PLANT_CONFIRMED)) {
        prove(within(next, candidates), "candidates only shrink");
        reach("two confirmed samples");
    }
    if ((plant == HG_PLANT_CONFIRMED) && (after == HG_PLANT_PROVISIONAL)) {
        prove(within(next, left) && (self.left == left), "a provisional alarm does not narrow what was confirmed");
    }
    prove(((plant != HG_PLANT_NONE) && (plant != HG_PLANT_STARTING)) || (candidates == 0U), "no candidate without an alarm");
    hg_decision_reset(&self);
    prove((self.left == UINT32_MAX) && (self.alarm[0].state == HG_PLANT_NONE), "forgotten");
}

/** Any residual outside its threshold is an alarm, and so is one that is no number: never blindness.
 *  Up to RESIDUALS residuals and thresholds, any floats.
 *  @proves hg_decision_exceeds
 *  @run check real=f32 unwind=5 limit=150 RESIDUALS=3U
 *  @run check real=q31 unwind=5 limit=150 RESIDUALS=3U */
void proof_decision_exceeds(void)
{
    hg_real r[RESIDUALS];
    hg_real J[RESIDUALS];
    const uint8_t n = any_u8_in(1U, RESIDUALS);
    const uint8_t i = any_u8_in(0U, (uint8_t)(n - 1U));
    const hg_real *own = TAIL(r, n);
    const hg_real *limit = TAIL(J, n);
    const bool exceeds = hg_decision_exceeds(own, limit, n);
    prove(exceeds || ((own[i] <= limit[i]) && ((own[i] >= HG_REAL_ZERO) || (hg_real_abs(own[i]) <= limit[i]))), "every one is looked at");
#if !HG_REAL_Q31
    prove(exceeds || (__CPROVER_isfinited((double)own[i]) || (!__CPROVER_isfinited((double)limit[i]))), "NaN and infinity are an alarm");
#endif
    if (!exceeds) {
        reach("all within");
    }
}
