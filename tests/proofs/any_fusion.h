/** @file
 *  A fusion filter of small sizes, tables and state of any content: STATES states without inputs, SENSORS sensors, DEPTH past samples, counters of up to MODULUS values, one table of one
 *  loss rate. Every array is an object of its own. */
#ifndef HULLGUARD_ANY_FUSION_H
#define HULLGUARD_ANY_FUSION_H

#include "stubs.h"

#include "hullguard/consistency.h"

#define SLOTS (DEPTH + 1U)

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

#endif
