#include "units.h"

bool app_unit_at(app_unit *self, size_t index)
{
    size_t detectors = 0U;
    while (app_model_at(detectors) != NULL) {
        detectors++;
    }
    *self = (app_unit){.model = app_model_at(index), .digest = HG_TRACKER_DIGEST};
    if (index >= detectors) {
        self->fusion = tracker_model_at(index - detectors);
    }
    return (self->model != NULL) || (self->fusion != NULL);
}

bool app_unit_find(app_unit *self, const char *name)
{
    *self = (app_unit){.model = app_model_find(name), .digest = HG_TRACKER_DIGEST};
    if (self->model == NULL) {
        self->fusion = tracker_model_find(name);
    }
    return (self->model != NULL) || (self->fusion != NULL);
}

const char *app_unit_name(const app_unit *self)
{
    return (self->model != NULL) ? self->model->name : self->fusion->name;
}

uint32_t app_unit_hash(const app_unit *self)
{
    return (self->model != NULL) ? self->model->config->model_hash : self->fusion->config->model_hash;
}

uint32_t app_unit_sample_time_us(const app_unit *self)
{
    return (self->model != NULL) ? self->model->sample_time_us : self->fusion->sample_time_us;
}

/* Sensors of a filter; behind them comes the tick. */
static uint8_t sensors(const app_unit *self)
{
    return self->fusion->config->fusion->sensors;
}

uint8_t app_unit_links(const app_unit *self)
{
    return (self->model != NULL) ? self->model->config->detector->groups : (uint8_t)(sensors(self) + 1U);
}

const char *app_unit_link(const app_unit *self, uint8_t i)
{
    if (self->model != NULL) {
        return self->model->group[i];
    }
    return (i < sensors(self)) ? self->fusion->sensor[i] : "tick";
}

const hg_message *app_unit_message(const app_unit *self, uint8_t i)
{
    if (self->model != NULL) {
        return &self->model->config->message[i];
    }
    return (i < sensors(self)) ? self->fusion->config->source[i].message : self->fusion->config->tick;
}

const hg_link_health *app_unit_health(const app_unit *self, uint8_t i)
{
    return (self->model != NULL) ? hg_node_health(self->node, i) : hg_tracker_health(self->tracker, i);
}

hg_bus_health app_unit_bus(const app_unit *self, const hg_verdict *verdict, uint8_t i)
{
    if ((self->model == NULL) && (i >= sensors(self))) {
        return HG_BUS_GOOD;
    }
    return (hg_bus_health)(((unsigned)verdict->bus >> (2U * (i % 8U))) & 0x3U);
}

const hg_message *app_unit_request(const app_unit *self)
{
    return ((self->model != NULL) && (self->model->config->freeze != NULL)) ? self->model->config->freeze->request : NULL;
}

hg_status app_unit_selftest(const app_unit *self)
{
    const hg_status status = (self->model != NULL) ? app_model_selftest(self->model) : HG_E_EMPTY;
    return (status == HG_E_EMPTY) ? HG_OK : status; /* no drive was found for this model */
}

hg_status app_unit_start(app_unit *self, hg_start how)
{
    return (self->model != NULL) ? app_model_start(self->model, &self->node, how) : self->fusion->start(&self->tracker, how);
}

hg_status app_unit_receive(const app_unit *self, const hg_can_frame *frame)
{
    return (self->model != NULL) ? hg_node_receive(self->node, frame) : hg_tracker_receive(self->tracker, frame);
}

hg_status app_unit_step(app_unit *self, hg_verdict *verdict)
{
    if (self->model != NULL) {
        return hg_node_step(self->node, verdict);
    }
    const hg_status status = hg_tracker_step(self->tracker, verdict);
    self->digest = (status == HG_OK) ? hg_tracker_digest(&self->tracker->fusion, self->digest) : self->digest;
    return status;
}

uint8_t app_unit_report(const app_unit *self, const hg_verdict *verdict, bool reply, hg_can_frame *frame)
{
    if (self->model != NULL) {
        return hg_node_report(self->node, verdict, reply, frame);
    }
    uint8_t frames = hg_tracker_report(self->tracker, verdict, reply, frame);
    for (uint8_t j = 0U; j < self->fusion->config->fusion->states; j++) {
        frames = (uint8_t)(frames + ((hg_tracker_estimate(self->tracker, j, &frame[frames]) == HG_OK) ? 1U : 0U));
    }
    return frames;
}

hg_status app_unit_freeze(const app_unit *self, hg_can_frame *frame)
{
    return (self->model != NULL) ? hg_node_freeze(self->node, frame) : HG_E_EMPTY;
}

void app_unit_expect(const app_unit *self, uint32_t samples)
{
    if (self->model != NULL) {
        hg_node_expect(self->node, samples);
    } else {
        hg_tracker_expect(self->tracker, samples);
    }
}

void app_unit_overdue(const app_unit *self)
{
    if (self->model != NULL) {
        hg_node_overdue(self->node);
    } else {
        hg_tracker_overdue(self->tracker);
    }
}

void app_unit_outage(const app_unit *self)
{
    if (self->model != NULL) {
        hg_node_outage(self->node);
    } else {
        hg_tracker_outage(self->tracker);
    }
}

uint8_t app_unit_due(const app_unit *self)
{
    return (self->model != NULL) ? self->node->due : self->tracker->due;
}

uint32_t app_unit_k(const app_unit *self)
{
    return (self->model != NULL) ? self->node->k : self->tracker->k;
}

bool app_unit_closed(const app_unit *self)
{
    return (self->model != NULL) ? self->node->closed : (hg_tracker_health(self->tracker, sensors(self))->good > 0U);
}
