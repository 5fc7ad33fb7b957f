/** @file
 *  A detector in any state that samples can leave, for the sizes of its tables. Every array is an object of its own: what runs over the end of one is outside, and is seen. */
#ifndef HULLGUARD_STATE_DETECTOR_H
#define HULLGUARD_STATE_DETECTOR_H

#include "stubs.h"

/* Row of the newest radii: any, or one that is a constant, which makes constants of all places of the past. */
#ifndef NEWEST_ROW
#define NEWEST_ROW any_u8()
#endif

/* No array has no place. */
#define PLACES(n) (((n) > 0U) ? (n) : 1U)

static hg_hold *state_holds(const hg_detector_config *config)
{
    hg_hold *hold = any_array(hg_hold, config->groups);
    for (uint8_t i = 0U; i < config->groups; i++) {
        const uint8_t width = config->hold[i].trigger->width;
        int32_t *code = any_array(int32_t, HG_HOLD_CODES(width));
        hg_real *real = any_array(hg_real, HG_HOLD_REALS(width));
        hold[i] = (hg_hold){.config = &config->hold[i], .sent = code, .previous = &code[width], .value = real, .promise = &real[width], .age = any_u8(), .good = any_u8(), .level = any_u8(),
                            .silence = any_u8(), .holes = any_bool(), .seen = any_bool(), .recovering = any_bool(), .fresh = any_bool(), .lost = any_bool(), .doubt = any_bool(),
                            .gap = any_bool(), .gap_age = any_u8()};
    }
    return hold;
}

static hg_predict *state_predictors(const hg_detector_config *config)
{
    hg_predict *predict = any_array(hg_predict, PLACES(config->predictors));
    for (uint8_t i = 0U; i < config->predictors; i++) {
        const hg_predict_config *table = &config->predict[i];
        predict[i] = (hg_predict){.config = table, .x = any_array(hg_real, table->order), .next = any_array(hg_real, table->order), .u = any_array(hg_real, PLACES(table->inputs)),
                                  .y = any_array(hg_real, table->width), .k = any_u16(), .sure = any_bool()};
    }
    return predict;
}

static hg_residual *state_residuals(const hg_detector_config *config)
{
    hg_residual *residual = any_array(hg_residual, PLACES(config->generators));
    for (uint8_t g = 0U; g < config->generators; g++) {
        const hg_residual_config *table = &config->residual[g];
        residual[g] = (hg_residual){.config = table, .z = any_array(hg_real, table->order), .next = any_array(hg_real, table->order), .input = any_array(hg_real, table->width)};
    }
    return residual;
}

static hg_hull *state_hulls(const hg_detector_config *config)
{
    hg_hull *hull = any_array(hg_hull, PLACES(config->generators));
    for (uint8_t g = 0U; (config->hull != NULL) && (g < config->generators); g++) {
        const hg_hull_config *table = &config->hull[g];
        hull[g] = (hg_hull){.config = table, .theta = any_array(hg_real, table->residuals), .mode = any_array(hg_real, PLACES(table->modes)), .k = any_u16(),
                            .how = (hg_start)any_u8_in(0U, 1U)};
    }
    return hull;
}

static hg_zonotope *state_zonotopes(const hg_detector_config *config)
{
    hg_zonotope *zonotope = any_array(hg_zonotope, PLACES(config->generators));
    for (uint8_t g = 0U; (config->zonotope != NULL) && (g < config->generators); g++) {
        const hg_zonotope_config *table = &config->zonotope[g];
        const uint32_t most = (uint32_t)table->columns + table->width + table->disturbances;
        hg_real size;
        zonotope[g] = (hg_zonotope){.config = table, .column = any_array(hg_real, most * table->order), .score = any_array(hg_real, most), .spread = any_array(hg_real, table->order),
                                    .scratch = any_array(hg_real, table->order), .size = size, .count = any_u16(), .lost = any_u16(), .k = any_u16(), .how = (hg_start)any_u8_in(0U, 1U)};
    }
    return zonotope;
}

#if HG_WITH_POLYNOMIAL
static hg_statistic *state_statistics(const hg_detector_config *config)
{
    hg_statistic *statistic = any_array(hg_statistic, PLACES(config->polynomials));
    for (uint8_t p = 0U; p < config->polynomials; p++) {
        (void)hg_statistic_start(&statistic[p], &config->polynomial[p], any_array(hg_real, hg_statistic_reals(&config->polynomial[p])));
        statistic[p].samples = any_u8();
    }
    return statistic;
}
#endif

static hg_bank *state_banks(const hg_detector_config *config)
{
    hg_bank *bank = any_array(hg_bank, PLACES(config->banks));
    for (uint8_t b = 0U; b < config->banks; b++) {
        bank[b] = (hg_bank){.config = &config->bank[b], .sum = any_array(hg_acc, HG_BANK_SUMS(config->bank[b].certificates)), .k = any_u8(), .closest = 0U};
    }
    return bank;
}

static hg_alarm *state_alarms(const hg_detector_config *config)
{
    hg_alarm *alarm = any_array(hg_alarm, config->decision.generators);
    for (uint8_t g = 0U; g < config->decision.generators; g++) {
        alarm[g] = (hg_alarm){.state = (hg_plant)any_u8_in(HG_PLANT_NONE, HG_PLANT_CONFIRMED), .up = any_u8(), .down = any_u8(), .pending = any_u8()};
    }
    return alarm;
}

static hg_detector any_detector(const hg_detector_config *config)
{
    hg_detector self = {.config = config,
                        .memory = {.hold = state_holds(config), .predict = state_predictors(config), .residual = state_residuals(config), .hull = state_hulls(config),
                                   .zonotope = state_zonotopes(config), .bank = state_banks(config), .alarm = state_alarms(config)},
                        .radii = {.data = any_array(hg_real, HG_RING_REALS(config->width, config->history)), .width = config->width, .length = config->history, .newest = NEWEST_ROW},
                        .values = {.data = any_array(hg_real, HG_RING_REALS(config->signals, PLACES(config->window))), .width = config->signals, .length = config->window, .newest = any_u8()},
                        .value = any_array(hg_real, config->width), .r = any_array(hg_real, config->residuals), .J = any_array(hg_real, config->residuals),
                        .past = any_array(hg_real, config->width), .refusals = any_u32(), .samples = any_u8(), .beginnings = any_u32()};
#if HG_WITH_POLYNOMIAL
    self.memory.polynomial = state_statistics(config);
#endif
    self.radius = self.radii.data;
    self.decision = (hg_decision){.config = &config->decision, .alarm = self.memory.alarm, .left = any_u32()};
    assume(started_detector(&self));
    return self;
}

#endif
