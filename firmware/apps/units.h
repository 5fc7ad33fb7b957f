/** @file
 *  A node of any kind of model that is compiled in, for a program that drives it without caring which: a detector's (hullguard/node.h) or a fusion
 *  filter's (hullguard/tracker.h). Closing frame stands for tick, too. */
#ifndef HULLGUARD_APPS_UNITS_H
#define HULLGUARD_APPS_UNITS_H

#include "models.h"
#include "tracker_models.h"

#define APP_FRAMES_MAX (2U + HG_FUSION_STATES_MAX) /* that one report can hand out */

typedef struct {
    const app_model     *model;   /* of a detector, or null: then */
    const tracker_model *fusion;
    hg_node             *node;    /* started, of the same */
    hg_tracker          *tracker;
    uint32_t             digest;  /* of a filter's states so far (hg_tracker_digest) */
} app_unit;

/** A unit by its model's number, 0, 1, ..; false behind the last one. */
bool app_unit_at(app_unit *self, size_t index);

/** A unit by its model's name; false when it is not compiled in. */
bool app_unit_find(app_unit *self, const char *name);

const char *app_unit_name(const app_unit *self);
uint32_t app_unit_hash(const app_unit *self);
uint32_t app_unit_sample_time_us(const app_unit *self);

/** Frames of senders that it listens to: how many, and each with its name. */
uint8_t app_unit_links(const app_unit *self);
const char *app_unit_link(const app_unit *self, uint8_t i);
const hg_message *app_unit_message(const app_unit *self, uint8_t i);
const hg_link_health *app_unit_health(const app_unit *self, uint8_t i);

/** What a verdict says of a link; of the tick's by what it is worth: a verdict is there. */
hg_bus_health app_unit_bus(const app_unit *self, const hg_verdict *verdict, uint8_t i);

/** Requests that it answers beside them, or null. */
const hg_message *app_unit_request(const app_unit *self);

/** Before the start. @retval HG_OK  passed, or there is nothing to test  Others: as NAME_selftest() of a detector's generated header */
hg_status app_unit_selftest(const app_unit *self);

/* As hg_node_X() and hg_tracker_X(). A report's frames are [APP_FRAMES_MAX], a fusion filter's with its estimates. */
hg_status app_unit_start(app_unit *self, hg_start how);
hg_status app_unit_receive(const app_unit *self, const hg_can_frame *frame);
hg_status app_unit_step(app_unit *self, hg_verdict *verdict);
uint8_t app_unit_report(const app_unit *self, const hg_verdict *verdict, bool reply, hg_can_frame *frame);
hg_status app_unit_freeze(const app_unit *self, hg_can_frame *frame);
void app_unit_expect(const app_unit *self, uint32_t samples);
void app_unit_overdue(const app_unit *self);
void app_unit_outage(const app_unit *self);
uint8_t app_unit_due(const app_unit *self);
uint32_t app_unit_k(const app_unit *self);

/** Has a closing frame been accepted, so that its time says how far behind the node is? */
bool app_unit_closed(const app_unit *self);

#endif
