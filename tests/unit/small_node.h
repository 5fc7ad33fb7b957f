/** @file
 *  Messages of a node with the model of small_model.h, for tests that give its groups rules of their own: what the node says of itself, two fields, and a rule of each kind. */
#ifndef HULLGUARD_TESTS_SMALL_NODE_H
#define HULLGUARD_TESTS_SMALL_NODE_H

#include "small_model.h"

static const uint8_t ids[HG_E2E_IDS] = {0x11U, 0x22U, 0x33U, 0x44U, 0x55U, 0x66U, 0x77U, 0x88U, 0x99U, 0xAAU, 0xBBU, 0xCCU, 0xDDU, 0xEEU, 0xFFU, 0x10U};
static const hg_e2e_config stamped_rule = {.profile = HG_E2E_P22, .data_ids = ids, .counter = 8U, .stamp = 12U, .limits = &hg_e2e_limits_default};
static const hg_e2e_config unstamped_rule = {.profile = HG_E2E_P11, .mode = HG_E2E_NIBBLE, .data_id = 0x123U, .counter = 8U, .nibble = 12U,
                                             .stamp = HG_E2E_NO_STAMP, .limits = &hg_e2e_limits_default}; /* its counter has 15 values */
static const hg_e2e_config no_rule = {.profile = HG_E2E_NONE, .mode = HG_E2E_BOTH, .stamp = HG_E2E_NO_STAMP, .limits = &hg_e2e_limits_default};
static const hg_field fields[2] = {{16U, 16U, HG_FIELD_SIGNED}, {32U, 16U, HG_FIELD_SIGNED}};
static const hg_message verdict_message = {.id = 0x200U, .length = 8U, .e2e = &stamped_rule};
static const hg_message status_message = {.id = 0x201U, .length = 8U, .e2e = &stamped_rule};

#endif
