/** @file
 *  A fusion filter on a bus, of small sizes (any_fusion.h), tables and state of any content, messages of one field each. */
#ifndef HULLGUARD_ANY_TRACKER_H
#define HULLGUARD_ANY_TRACKER_H

#include "any_fusion.h"

static const hg_field field[2] = {{.start = 24U, .length = 8U, .flags = HG_FIELD_SIGNED}, {.start = 32U, .length = 8U, .flags = HG_FIELD_SIGNED}};
static const hg_code_scale scale[2] = {{.resolution = 1.0F, .per_unit = 1.0F, .minimum = -100, .maximum = 100}, {.resolution = 1.0F, .per_unit = 1.0F, .minimum = -100, .maximum = 100}};

/* Messages of 8 bytes, with the identifiers from this one on. */
static const hg_message *messages_of(uint32_t id, uint8_t count, uint8_t width)
{
    hg_e2e_config *e2e = any_array(hg_e2e_config, 1U);
    hg_message *message = any_array(hg_message, count);
    *e2e = (hg_e2e_config){.profile = HG_E2E_P22, .data_ids = any_array(uint8_t, HG_E2E_IDS), .crc = 0U, .counter = 8U, .stamp = 12U, .resync = any_u8(), .limits = &hg_e2e_limits_default};
    for (uint8_t i = 0U; i < count; i++) {
        message[i] = (hg_message){.id = id + i, .flags = 0U, .length = 8U, .width = width, .field = field, .scale = scale, .e2e = e2e, .idle = NULL};
    }
    return message;
}

static const hg_consistency_config *any_consistency_config(void)
{
    hg_consistency_config *config = any_array(hg_consistency_config, 1U);
    config->onsets = 1U;
    config->least = any_array(hg_real, SENSORS);
    return config;
}

/* Sensors have the identifiers 0 .., the tick the one behind them. */
static hg_tracker_config *any_tracker_config(void)
{
    hg_tracker_config *config = any_array(hg_tracker_config, 1U);
    hg_fusion_config *fusion = any_array(hg_fusion_config, 1U);
    hg_tracker_source *source = any_array(hg_tracker_source, SENSORS);
    *fusion = any_fusion_config();
    for (uint8_t i = 0U; i < SENSORS; i++) {
        source[i] = (hg_tracker_source){.message = messages_of(i, 1U, 1U), .wraps = any_bool()};
    }
    *config = (hg_tracker_config){.fusion = fusion, .consistency = any_bool() ? any_consistency_config() : NULL, .source = source, .tick = messages_of(SENSORS, 1U, 0U),
                                  .verdict = messages_of(SENSORS + 1U, 1U, 0U), .status = messages_of(SENSORS + 2U, 1U, 0U), .estimate = messages_of(SENSORS + 3U, STATES, 2U),
                                  .heartbeat = any_u16(), .interval = any_u16(), .model_hash = any_u32()};
    return config;
}

#endif
