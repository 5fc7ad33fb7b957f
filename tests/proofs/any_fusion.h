/** @file
 *  A fusion filter of small sizes, tables and state of any content: STATES states without inputs, SENSORS sensors, DEPTH past samples, counters of up to MODULUS values, one table of one
 *  loss rate. Every array is an object of its own. */
#ifndef HULLGUARD_ANY_FUSION_H
#define HULLGUARD_ANY_FUSION_H

#include "stubs.h"

#include "hullguard/tracker.h"

#define SLOTS (DEPTH + 1U)
#ifndef MODULUS
#define MODULUS 256U
#endif

static hg_fusion_table *any_fusion_table(void)
{
    hg_fusion_table *table = any_array(hg_fusion_table, 1U);
    *table = (hg_fusion_table){.alive = any_u16(), .level = any_array(hg_real, SENSORS), .relax = any_array(hg_real, SENSORS), .early = any_array(hg_real, SENSORS)};
    return table;
}

static hg_fusion_config any_fusion_config(void)
{
    hg_real huber;
    hg_real rate_step;
    hg_real loss;
    hg_real smoothing;
    uint8_t *select = any_array(uint8_t, SENSORS);
    hg_real *C = any_array(hg_real, SENSORS * STATES);
    const bool selects = any_bool();
    return (hg_fusion_config){.states = STATES, .inputs = 0U, .sensors = SENSORS, .depth = DEPTH, .delay = any_u8(), .heartbeat = any_u8(), .watchdog = any_u8(),
                              .modulus = any_u16(), .trigger = (hg_fusion_trigger)any_u8(), .A = any_array(hg_real, STATES * STATES), .B = NULL,
                              .Q = any_array(hg_real, STATES * STATES), .x0 = any_array(hg_real, STATES), .P0 = any_array(hg_real, STATES * STATES),
                              .select = selects ? select : NULL, .C = selects ? NULL : C, .R = any_array(hg_real, SENSORS), .range = any_array(hg_real, SENSORS), .huber = huber,
                              .origin = any_bool() ? any_array(hg_real, STATES) : NULL, .rates = 1U, .rate_step = rate_step, .loss = loss, .smoothing = smoothing, .tables = 1U,
                              .table = any_fusion_table()};
}

#define FUSION_REALS HG_FUSION_REALS(STATES, 0U, SENSORS, DEPTH)

/* A filter in any state, each part of its memory an object of its own. */
static hg_fusion any_fusion(const hg_fusion_config *config)
{
    hg_fusion self = {.config = config, .slot = any_array(hg_fusion_slot, SLOTS), .sensor = any_array(hg_fusion_sensor, SENSORS), .record = any_array(hg_fusion_record, SENSORS),
                      .origin = any_array(int32_t, STATES), .x = any_array(hg_real, STATES), .P = any_array(hg_real, STATES * STATES), .ahead = any_array(hg_real, STATES),
                      .wide = any_array(hg_real, STATES * STATES), .product = any_array(hg_real, STATES * STATES), .g = any_array(hg_real, STATES), .next = any_array(hg_real, STATES),
                      .move = any_array(hg_real, STATES), .k = any_u32(), .excluded = any_u16(), .resets = any_u16(), .newest = any_u8(), .held = any_u8(), .redo = any_u8(),
                      .open = any_bool()};
    for (uint8_t l = 0U; l < SLOTS; l++) {
        self.slot[l] = (hg_fusion_slot){.x = any_array(hg_real, STATES), .P = any_array(hg_real, STATES * STATES), .shift = any_array(hg_real, STATES), .u = NULL,
                                        .entry = any_array(hg_fusion_entry, SENSORS), .table = config->table, .excluded = any_u16()};
        for (uint8_t i = 0U; i < SENSORS; i++) {
            self.slot[l].entry[i].counted = any_bool();
            self.slot[l].entry[i].expected = any_bool();
        }
    }
    for (uint8_t i = 0U; i < SENSORS; i++) {
        self.sensor[i].seen = any_bool();
        self.record[i].value = any_bool();
        self.record[i].gain = any_array(hg_real, STATES);
    }
    assume(config->modulus <= MODULUS);
    return self;
}

#endif
