/** @file
 *  A node on a detector of small sizes (any_detector.h), tables and state of any content, messages of one field each: GROUPS groups, the last of them the closing one, protected by
 *  PROTECTION. */
#ifndef HULLGUARD_ANY_NODE_H
#define HULLGUARD_ANY_NODE_H

#include "any_detector.h"

#ifndef SAMPLES
#define SAMPLES 1U /* of a freeze frame */
#endif

/* Protection of a measurement message and of the closing one, by PROTECTION: of the project's own frames; of a vehicle's, without stamps; without protection beside the closing one. */
#if PROTECTION == 1U
#define MEASURED {.profile = HG_E2E_P22, .data_ids = ids, .crc = 0U, .counter = 8U, .stamp = 12U, .resync = any_u8(), .limits = &hg_e2e_limits_default}
#define CLOSING MEASURED
#elif PROTECTION == 2U
#define MEASURED {.profile = HG_E2E_P05, .data_id = any_u16(), .crc = 0U, .counter = 16U, .stamp = HG_E2E_NO_STAMP, .resync = any_u8(), .limits = &hg_e2e_limits_default}
#define CLOSING MEASURED
#else
#define MEASURED {.profile = HG_E2E_NONE, .stamp = HG_E2E_NO_STAMP, .limits = &hg_e2e_limits_default}
#define CLOSING {.profile = HG_E2E_P01, .mode = HG_E2E_BOTH, .data_id = any_u16(), .crc = 0U, .counter = 8U, .stamp = HG_E2E_NO_STAMP, .resync = any_u8(), .limits = &hg_e2e_limits_default}
#endif
#define OWN {.profile = HG_E2E_P22, .data_ids = ids, .crc = 0U, .counter = 8U, .stamp = 12U, .limits = &hg_e2e_limits_default}

static const hg_field field = {.start = 24U, .length = 8U, .flags = HG_FIELD_SIGNED};
static const hg_code_scale scale = {.minimum = -100, .maximum = 100};

static hg_message message_of(uint32_t id, uint8_t length, uint8_t width, const hg_e2e_config *e2e)
{
    return (hg_message){.id = id, .flags = 0U, .length = length, .width = width, .field = &field, .scale = &scale, .e2e = e2e, .idle = NULL};
}

/* What a node is made of, each an object of its own. */
static hg_node_config *any_node_config(void)
{
    const uint8_t *ids = any_array(uint8_t, HG_E2E_IDS);
    hg_e2e_config *e2e = any_array(hg_e2e_config, 3U);
    hg_message *message = any_array(hg_message, GROUPS);
    hg_message *own = any_array(hg_message, 2U);
    hg_detector_config *detector = any_array(hg_detector_config, 1U);
    hg_node_config *config = any_array(hg_node_config, 1U);
    e2e[0] = (hg_e2e_config)MEASURED;
    e2e[1] = (hg_e2e_config)CLOSING;
    e2e[2] = (hg_e2e_config)OWN;
    for (uint8_t i = 0U; i < GROUPS; i++) {
        message[i] = message_of(i, 4U, 1U, &e2e[((i + 1U) < GROUPS) ? 0U : 1U]);
    }
    own[0] = message_of(GROUPS, 8U, 0U, &e2e[2]);
    own[1] = message_of(GROUPS + 1U, 8U, 0U, &e2e[2]);
    *detector = any_detector_config();
    *config = (hg_node_config){.detector = detector, .message = message, .closing = GROUPS - 1U, .verdict = &own[0], .status = &own[1], .heartbeat = any_u16(), .model_hash = any_u32(),
                               .freeze = NULL};
    assume(config->heartbeat >= 1U);
    return config;
}

/* A node in any state that frames and samples can leave. */
static hg_node any_node(const hg_node_config *config)
{
    hg_node self;
    self.config = config;
    self.detector = any_detector(config->detector);
    self.link = any_array(hg_link, GROUPS);
    self.closing = any_array(int32_t, WIDTH);
    self.held = any_bool();
    self.continues = any_bool();
    self.synchronised = any_bool();
    self.slipped = any_bool();
    self.clocked = any_bool();
    self.closed = any_bool();
    self.reported = any_bool();
    self.last.refused = any_bool();
    self.freeze = NULL;
    for (uint8_t i = 0U; i < GROUPS; i++) {
        self.link[i].timed = any_bool();
        self.link[i].receiver.seen = any_bool();
    }
    assume(state_node(&self));
    return self;
}

/* Requests and responses have the identifiers behind those of the node's own. */
static hg_freeze_config *any_freeze_config(void)
{
    const uint8_t *ids = any_array(uint8_t, HG_E2E_IDS);
    hg_e2e_config *e2e = any_array(hg_e2e_config, 1U);
    hg_message *message = any_array(hg_message, 2U);
    hg_freeze_config *config = any_array(hg_freeze_config, 1U);
    *e2e = (hg_e2e_config)OWN;
    message[0] = message_of(GROUPS + 2U, 8U, 0U, e2e);
    message[1] = message_of(GROUPS + 3U, 8U, 0U, e2e);
    *config = (hg_freeze_config){.samples = SAMPLES, .after = any_u8_in(0U, SAMPLES - 1U), .burst = any_u8_in(1U, UINT8_MAX), .request = &message[0], .response = &message[1]};
    return config;
}

/* A freeze frame in any state that samples and requests can leave. */
static hg_freeze any_freeze(const hg_detector *detector)
{
    hg_freeze self;
    self.config = any_freeze_config();
    self.detector = detector;
    self.memory = (hg_freeze_memory){.row = any_array(hg_freeze_row, SAMPLES), .real = any_array(hg_real, SAMPLES * HG_FREEZE_REALS(ALL, RESIDUES))};
    self.confirmed = any_bool();
    self.answer = any_bool();
    assume(requires_freeze(&self));
    return self;
}

#endif
