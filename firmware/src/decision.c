#include "hullguard/decision.h"

#include <stddef.h>

hg_status hg_decision_start(hg_decision *self, const hg_decision_config *config, hg_alarm *alarm)
{
    if ((self == NULL) || (config == NULL) || (alarm == NULL)) {
        return HG_E_ARGUMENT;
    }
    const bool sized = (config->generators >= 1U) && (config->generators <= HG_GENERATORS_MAX) && HG_SIZE_FITS(HG_ONLY_JUDGED, config->generators);
    if ((!sized) || (config->up < 1U) || (config->down < 1U) || (config->feeds == NULL) || (config->faults == NULL)) {
        return HG_E_CONFIG;
    }
    self->config = config;
    self->alarm = alarm;
    hg_decision_reset(self);
    return HG_OK;
}

static void forget(hg_alarm *alarm)
{
    *alarm = (hg_alarm){.state = HG_PLANT_NONE, .up = 0U, .down = 0U, .pending = 0U};
}

void hg_decision_reset(hg_decision *self)
{
    for (uint8_t g = 0U; g < self->config->generators; g++) {
        forget(&self->alarm[g]);
    }
    self->left = UINT32_MAX;
}

static uint8_t next(uint8_t counter, uint8_t limit)
{
    return (counter < limit) ? (uint8_t)(counter + 1U) : limit;
}

static void count(hg_alarm *alarm, const hg_decision_config *config, bool raised)
{
    if (raised) {
        alarm->up = next(alarm->up, config->up);
        alarm->down = 0U;
    } else {
        alarm->up = 0U;
        alarm->down = next(alarm->down, config->down);
    }
}

static void alarm_step(hg_alarm *alarm, const hg_decision_config *config, uint8_t feeds, bool raised, const hg_evidence *evidence)
{
    const bool was_confirmed = alarm->state == HG_PLANT_CONFIRMED;
    const uint8_t doubt = feeds & evidence->doubt;
    if ((!was_confirmed) && ((alarm->pending & evidence->rewound) != 0U)) {
        forget(alarm); /* raised, or counted, with radii that were too small; judged anew below */
    }
    alarm->pending &= doubt; /* a group that is no longer in doubt has settled what relied on it */
    count(alarm, config, raised);
    if ((!was_confirmed) && (alarm->state != HG_PLANT_PROVISIONAL)) { /* none; or what is no state, of a memory that failed: it must not stay */
        alarm->pending = raised ? (alarm->pending | doubt) : 0U;
        alarm->state = (alarm->up >= config->up) ? HG_PLANT_PROVISIONAL : HG_PLANT_NONE;
    }
    if ((alarm->state == HG_PLANT_PROVISIONAL) && (alarm->pending == 0U)) {
        alarm->state = HG_PLANT_CONFIRMED;
    }
    if (was_confirmed && (alarm->down >= config->down) && (!config->latch)) {
        forget(alarm); /* was confirmed before: a confirmed alarm is seen for a sample at least */
    }
}

hg_plant hg_decision_step(hg_decision *self, const hg_evidence *evidence, uint32_t *candidates)
{
    const hg_decision_config *config = self->config;
    hg_plant plant = evidence->ready ? HG_PLANT_NONE : HG_PLANT_STARTING;
    const uint8_t judged = HG_SIZE(HG_ONLY_JUDGED, config->generators);
    uint32_t common = 0U;
    for (uint8_t g = 0U; g < judged; g++) {
        hg_alarm *alarm = &self->alarm[g];
        alarm_step(alarm, config, config->feeds[g], ((evidence->alarm >> g) & 1U) != 0U, evidence);
        if (alarm->state != HG_PLANT_NONE) {
            /* A provisional alarm may yet be taken back: it must not narrow what confirmed ones say. */
            if (alarm->state > plant) {
                plant = alarm->state;
                common = config->faults[g];
            } else if (alarm->state == plant) {
                common &= config->faults[g];
            } else {
                /* a provisional one beside a confirmed one */
            }
        }
    }
    if (plant == HG_PLANT_CONFIRMED) {
        self->left &= common;
    } else if (plant != HG_PLANT_PROVISIONAL) {
        self->left = UINT32_MAX; /* the episode is over */
    } else {
        /* nothing is sure yet */
    }
    *candidates = common & self->left;
    return plant;
}
