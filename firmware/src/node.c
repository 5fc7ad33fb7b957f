#include "hullguard/node.h"

#include <stddef.h>

#define COUNTER_MASK 0x0FU
#define STAMP_MASK 0x0FU
#define STAMP_AHEAD_MAX 7U /* stamps beyond lie nearer in the past than in the future */
#define VERDICT_LENGTH 8U
#define VERDICT_LENGTH_WIDE 12U /* with room for candidates 31:16 */
#define VERDICT_FAULTS 16U     /* candidates without that room */

static void raise16(uint16_t *counter, uint16_t by)
{
    const uint32_t sum = (uint32_t)*counter + by;
    *counter = (sum > UINT16_MAX) ? UINT16_MAX : (uint16_t)sum;
}

static void raise32(uint32_t *counter)
{
    *counter += (*counter < UINT32_MAX) ? 1U : 0U;
}

/* ---- Sender ---- */

hg_status hg_sender_start(hg_sender *self, const hg_sender_config *config, int32_t *codes)
{
    if ((self == NULL) || (config == NULL) || (codes == NULL) || (config->message == NULL) || (config->trigger == NULL)) {
        return HG_E_ARGUMENT;
    }
    if ((!hg_frame_valid(config->message)) || (config->message->width != config->trigger->width)) {
        return HG_E_CONFIG;
    }
    self->config = config;
    self->code = &codes[config->trigger->width];
    self->counter = 0U;
    return hg_trigger_start(&self->trigger, config->trigger, codes);
}

hg_status hg_sender_step(hg_sender *self, uint32_t k, const hg_real *value, hg_can_frame *frame)
{
    const hg_message *message = self->config->message;
    for (uint8_t g = 0U; g < message->width; g++) {
        self->code[g] = hg_code_encode(&message->scale[g], value[g]);
    }
    hg_status status = hg_trigger_step(&self->trigger, self->code);
    if (status == HG_OK) {
        hg_frame_pack(message, self->code, frame);
        status = hg_e2e_p22_protect(frame->data, frame->length, message->data_id, self->counter, (uint8_t)(k & STAMP_MASK));
        self->counter = (self->counter + 1U) & COUNTER_MASK;
    }
    return status;
}

/* ---- Detector node ---- */

static bool wide(const hg_message *verdict)
{
    return verdict->length == VERDICT_LENGTH_WIDE;
}

/* Does the verdict frame have room for every fault that an alarm can name? */
static bool verdict_holds(const hg_message *verdict, const hg_decision_config *decision)
{
    uint32_t faults = 0U;
    for (uint8_t g = 0U; g < decision->generators; g++) {
        faults |= decision->faults[g];
    }
    return wide(verdict) || ((faults >> VERDICT_FAULTS) == 0U);
}

static bool config_valid(const hg_node_config *config)
{
    bool valid = (config->detector != NULL) && (config->message != NULL) && (config->verdict != NULL) && (config->status != NULL) &&
                 (config->heartbeat >= 1U);
    valid = valid && hg_frame_valid(config->verdict) && hg_frame_valid(config->status);
    valid = valid && ((config->verdict->length == VERDICT_LENGTH) || wide(config->verdict)) && (config->status->length == VERDICT_LENGTH);
    valid = valid && (config->verdict->width == 0U) && (config->status->width == 0U) && (config->detector->hold != NULL);
    valid = valid && (config->closing < config->detector->groups) && (config->detector->groups <= HG_GROUPS_MAX);
    for (uint8_t i = 0U; valid && (i < config->detector->groups); i++) {
        valid = hg_frame_valid(&config->message[i]) && (config->detector->hold[i].trigger != NULL) &&
                (config->message[i].width == config->detector->hold[i].trigger->width);
    }
    return valid;
}

hg_status hg_node_start(hg_node *self, const hg_node_config *config, const hg_node_memory *memory, hg_start how)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL) || (memory->link == NULL) || (memory->closing == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!config_valid(config)) {
        return HG_E_CONFIG;
    }
    *self = (hg_node){.config = config, .link = memory->link, .closing = memory->closing};
    self->synchronised = how == HG_START_REST;
    for (uint8_t i = 0U; i < config->detector->groups; i++) {
        hg_e2e_receiver_start(&self->link[i].receiver);
        self->link[i].health = (hg_link_health){.good = 0U};
    }
    const hg_status status = hg_detector_start(&self->detector, config->detector, &memory->detector, how);
    return ((status == HG_OK) && (!verdict_holds(config->verdict, &config->detector->decision))) ? HG_E_CONFIG : status;
}

/* The group whose identifier this is, standard or extended alike; groups when there is none. */
static uint8_t group_of(const hg_node_config *config, const hg_can_frame *frame)
{
    uint8_t group = 0U;
    while ((group < config->detector->groups) && ((config->message[group].id != frame->id) ||
                                                  (((config->message[group].flags ^ frame->flags) & HG_CAN_EXTENDED) != 0U))) {
        group++;
    }
    return group;
}

static void count_refusal(hg_link_health *health, hg_status status)
{
    if (status == HG_E_FORMAT) {
        raise16(&health->format, 1U);
    } else if (status == HG_E_CRC) {
        raise16(&health->crc, 1U);
    } else if (status == HG_E_REPEATED) {
        raise16(&health->repeated, 1U);
    } else if (status == HG_E_NUMERIC) {
        raise16(&health->numeric, 1U);
    } else {
        /* not refused */
    }
}

/* Format, protection and content of a frame that carries a group's identifier; counts what it refuses. */
static hg_status admit(hg_node *self, uint8_t group, const hg_can_frame *frame, int32_t *code, hg_e2e_header *header)
{
    const hg_message *message = &self->config->message[group];
    hg_link *link = &self->link[group];
    hg_status status = HG_E_FORMAT;
    if (hg_frame_matches(message, frame)) {
        status = hg_e2e_p22_receive(&link->receiver, frame->data, frame->length, message->data_id, header);
        if (status == HG_OK) {
            raise16(&link->health.lost, header->lost);
            status = hg_frame_unpack(message, frame, code);
        }
    }
    count_refusal(&link->health, status);
    return status;
}

static void count_good(hg_link_health *health, const int32_t *code, uint8_t width)
{
    bool invalid = false;
    for (uint8_t g = 0U; g < width; g++) {
        invalid = invalid || (code[g] == HG_CODE_INVALID);
    }
    raise16(&health->good, 1U);
    raise16(&health->invalid, invalid ? 1U : 0U);
}

/* What is known of the past belongs to nobody knows which samples any more: how old a held value is, and of which sample a frame already
 * booked for the open one was. */
static void forget_past(hg_node *self)
{
    for (uint8_t i = 0U; i < self->config->detector->groups; i++) {
        hg_hold *hold = &self->detector.memory.hold[i];
        (void)hg_hold_start(hold, hold->config, hold->sent);
    }
    hg_detector_restart(&self->detector, HG_START_MOVING);
}

/* Every sample has one closing frame: since the last one accepted, counter and sample index must have moved alike. */
static bool in_step(const hg_node *self, const hg_e2e_header *header, uint8_t ahead)
{
    const uint8_t frames = (uint8_t)((header->counter - self->closing_counter) & COUNTER_MASK);
    const uint8_t samples = (uint8_t)(((self->k + ahead) - self->closing_k) & COUNTER_MASK);
    return (!self->closed) || (frames == samples);
}

/* The closing frame tells the time: steps become due. */
static hg_status close_sample(hg_node *self, const int32_t *code, const hg_e2e_header *header)
{
    const uint8_t width = self->config->message[self->config->closing].width;
    hg_link_health *health = &self->link[self->config->closing].health;
    uint8_t ahead = (uint8_t)((header->stamp - self->k) & STAMP_MASK);
    const bool anew = header->lost == HG_E2E_LOST;
    if ((self->synchronised) && (ahead > STAMP_AHEAD_MAX) && (!self->slipped) && (!anew)) {
        self->slipped = true;
        raise16(&health->late, 1U);
        return HG_E_STAMP;
    }
    if ((!self->synchronised) || (ahead > STAMP_AHEAD_MAX) || anew || (!in_step(self, header, ahead))) {
        /* Late twice running, or a sender that began anew: this node has lost the sample index. Take the sender's. */
        if (self->synchronised) {
            forget_past(self);
        }
        self->k += ahead;
        ahead = 0U;
    }
    self->synchronised = true;
    self->slipped = false;
    self->closed = true;
    self->closing_counter = header->counter;
    self->closing_k = self->k + ahead;
    for (uint8_t g = 0U; g < width; g++) {
        self->closing[g] = code[g];
    }
    self->held = true;
    self->continues = header->lost == 0U;
    self->due = (uint8_t)(ahead + 1U);
    count_good(health, code, width);
    return HG_OK;
}

static hg_status book(hg_node *self, uint8_t group, const int32_t *code, const hg_e2e_header *header)
{
    hg_link_health *health = &self->link[group].health;
    const uint8_t ahead = (uint8_t)((header->stamp - self->k) & STAMP_MASK);
    if (!self->synchronised) {
        return HG_E_STAMP; /* of a sample that nobody can name yet: no fault of the sender's, and not counted */
    }
    if (ahead != 0U) {
        raise16((ahead > STAMP_AHEAD_MAX) ? &health->late : &health->early, 1U);
        return HG_E_STAMP;
    }
    const hg_status status = hg_detector_receive(&self->detector, group, code, header->lost == 0U);
    if (status == HG_OK) {
        count_good(health, code, self->config->message[group].width);
    } else {
        count_refusal(health, status);
        /* A second good frame for one sample is no duplicate by its counter: what it said is lost, and the next frame continues it. */
        (void)hg_detector_lose(&self->detector, group);
    }
    return status;
}

hg_status hg_node_receive(hg_node *self, const hg_can_frame *frame)
{
    int32_t code[HG_GROUP_SIGNALS_MAX];
    hg_e2e_header header = {.stamp = 0U, .lost = 0U};
    const uint8_t group = group_of(self->config, frame);
    if (group >= self->config->detector->groups) {
        raise32(&self->unknown);
        return HG_E_ID;
    }
    if (self->due > 0U) {
        return HG_E_BUSY;
    }
    hg_status status = admit(self, group, frame, code, &header);
    if (status == HG_OK) {
        status = (group == self->config->closing) ? close_sample(self, code, &header) : book(self, group, code, &header);
    }
    if ((status != HG_OK) && (status != HG_E_REPEATED)) {
        (void)hg_detector_lose(&self->detector, group);
    }
    return status;
}

void hg_node_overdue(hg_node *self)
{
    if (self->due == 0U) {
        self->due = 1U;
    }
}

void hg_node_outage(hg_node *self)
{
    for (uint8_t i = 0U; i < self->config->detector->groups; i++) {
        hg_e2e_receiver_start(&self->link[i].receiver); /* a counter that ran round meanwhile is no repetition */
    }
    forget_past(self);
    self->due = 0U;
    self->held = false;
    self->slipped = false;
    self->closed = false;
    self->synchronised = false;
}

static uint16_t bus_of(const hg_node *self)
{
    uint16_t bus = 0U;
    for (uint8_t i = 0U; i < self->config->detector->groups; i++) {
        const uint32_t health = (uint32_t)hg_hold_health(&self->detector.memory.hold[i]);
        const uint32_t place = 2U * (uint32_t)i;
        bus |= (uint16_t)(health << place);
    }
    return bus;
}

static bool refused(const hg_node *self)
{
    bool any = self->detector.refusals > 0U;
    for (uint8_t i = 0U; i < self->config->detector->groups; i++) {
        any = any || (self->link[i].health.numeric > 0U);
    }
    return any;
}

hg_status hg_node_step(hg_node *self, hg_verdict *verdict)
{
    if (self->due == 0U) {
        return HG_E_EMPTY;
    }
    hg_finding finding;
    self->due--;
    if (self->held && (self->due == 0U)) {
        (void)hg_detector_receive(&self->detector, self->config->closing, self->closing, self->continues);
        self->held = false;
    } else {
        raise32(&self->overdue);
    }
    (void)hg_detector_step(&self->detector, &finding); /* a refusal is in the verdict's refused flag */
    *verdict = (hg_verdict){.k = self->k,
                            .model_hash = self->config->model_hash,
                            .candidates = finding.candidates,
                            .plant = finding.plant,
                            .basis = finding.basis,
                            .bus = bus_of(self),
                            .refused = refused(self)};
    self->k++;
    return HG_OK;
}

static hg_can_frame blank(const hg_message *message)
{
    hg_can_frame frame;
    hg_frame_pack(message, NULL, &frame); /* no fields: an empty frame of the message's kind and length */
    return frame;
}

static void put_verdict(hg_node *self, const hg_verdict *verdict, bool reply, hg_can_frame *frame)
{
    const hg_message *message = self->config->verdict;
    *frame = blank(message);
    const uint32_t flags = (reply ? 0x10U : 0U) | (verdict->refused ? 0x20U : 0U);
    frame->data[2] = (uint8_t)((uint32_t)verdict->plant | ((uint32_t)verdict->basis << 2U) | flags);
    frame->data[3] = (uint8_t)(verdict->candidates & 0xFFU);
    frame->data[4] = (uint8_t)((verdict->candidates >> 8U) & 0xFFU);
    frame->data[5] = (uint8_t)(verdict->bus & 0xFFU);
    frame->data[6] = (uint8_t)(verdict->bus >> 8U);
    frame->data[7] = (uint8_t)((verdict->k >> 4U) & 0xFFU);
    if (wide(message)) {
        frame->data[8] = (uint8_t)((verdict->candidates >> 16U) & 0xFFU);
        frame->data[9] = (uint8_t)(verdict->candidates >> 24U);
    }
    (void)hg_e2e_p22_protect(frame->data, frame->length, message->data_id, self->verdict_counter, (uint8_t)(verdict->k & STAMP_MASK));
    self->verdict_counter = (self->verdict_counter + 1U) & COUNTER_MASK;
}

static uint8_t clipped(uint32_t count)
{
    return (count > UINT8_MAX) ? UINT8_MAX : (uint8_t)count;
}

static void put_status(hg_node *self, const hg_verdict *verdict, hg_can_frame *frame)
{
    const hg_message *message = self->config->status;
    uint32_t lost = 0U;
    uint32_t refusals = 0U;
    for (uint8_t i = 0U; i < self->config->detector->groups; i++) {
        const hg_link_health *health = &self->link[i].health;
        lost += health->lost;
        refusals += (uint32_t)health->crc + health->format + health->early + health->late + health->numeric;
    }
    *frame = blank(message);
    frame->data[2] = (uint8_t)(verdict->model_hash & 0xFFU);
    frame->data[3] = (uint8_t)((verdict->model_hash >> 8U) & 0xFFU);
    frame->data[4] = (uint8_t)((verdict->model_hash >> 16U) & 0xFFU);
    frame->data[5] = (uint8_t)((verdict->model_hash >> 24U) & 0xFFU);
    frame->data[6] = clipped(lost);
    frame->data[7] = clipped(refusals);
    (void)hg_e2e_p22_protect(frame->data, frame->length, message->data_id, self->status_counter, (uint8_t)(verdict->k & STAMP_MASK));
    self->status_counter = (self->status_counter + 1U) & COUNTER_MASK;
}

uint8_t hg_node_report(hg_node *self, const hg_verdict *verdict, bool reply, hg_can_frame *frame)
{
    const hg_verdict *last = &self->last;
    const bool changed = (!self->reported) || (verdict->plant != last->plant) || (verdict->candidates != last->candidates) ||
                         (verdict->basis != last->basis) || (verdict->bus != last->bus) || (verdict->refused != last->refused);
    const bool beat = (!self->reported) || ((self->silence + 1U) >= self->config->heartbeat);
    uint8_t frames = 0U;
    self->silence++;
    if (changed || beat || reply) {
        put_verdict(self, verdict, (!changed) && (!beat), &frame[0]);
        frames = 1U;
    }
    if (changed || beat) {
        self->reported = true;
        self->last = *verdict;
    }
    if (beat) {
        self->silence = 0U;
        put_status(self, verdict, &frame[1]);
        frames = 2U;
    }
    return frames;
}

hg_status hg_verdict_read(const hg_message *message, const hg_can_frame *frame, hg_verdict *verdict, bool *reply)
{
    hg_e2e_receiver fresh;
    hg_e2e_header header;
    if ((!hg_frame_matches(message, frame)) || ((frame->length != VERDICT_LENGTH) && (!wide(message)))) {
        return HG_E_FORMAT;
    }
    hg_e2e_receiver_start(&fresh);
    const hg_status status = hg_e2e_p22_receive(&fresh, frame->data, frame->length, message->data_id, &header);
    if (status == HG_OK) {
        const uint8_t plant = frame->data[2] & 0x3U;
        const uint8_t basis = (frame->data[2] >> 2U) & 0x3U;
        const uint32_t high = wide(message) ? ((uint32_t)frame->data[8] | ((uint32_t)frame->data[9] << 8U)) : 0U;
        *verdict = (hg_verdict){.k = ((uint32_t)frame->data[7] << 4U) | header.stamp,
                                .model_hash = 0U,
                                .candidates = (uint32_t)frame->data[3] | ((uint32_t)frame->data[4] << 8U) | (high << VERDICT_FAULTS),
                                .plant = (hg_plant)plant,
                                .basis = (hg_basis)basis,
                                .bus = (uint16_t)(frame->data[5] | ((uint16_t)frame->data[6] << 8U)),
                                .refused = (frame->data[2] & 0x20U) != 0U};
        *reply = (frame->data[2] & 0x10U) != 0U;
    }
    return status;
}

const hg_link_health *hg_node_health(const hg_node *self, uint8_t group)
{
    return &self->link[group].health;
}

/* ---- From a receive interrupt to the main loop ---- */

hg_status hg_inbox_start(hg_inbox *self, hg_can_frame *frame, uint8_t length)
{
    /* A power of two divides 256, so that the counters may wrap. */
    if ((self == NULL) || (frame == NULL) || (length < 2U) || (length > 128U) || ((length & (uint8_t)(length - 1U)) != 0U)) {
        return HG_E_ARGUMENT;
    }
    self->frame = frame;
    self->length = length;
    self->written = 0U;
    self->read = 0U;
    self->overflow = 0U;
    return HG_OK;
}

hg_status hg_inbox_put(hg_inbox *self, const hg_can_frame *frame)
{
    const uint8_t written = self->written;
    const uint8_t waiting = (uint8_t)(written - self->read);
    if (waiting >= self->length) {
        const uint16_t overflow = self->overflow;
        self->overflow = (overflow < UINT16_MAX) ? (uint16_t)(overflow + 1U) : UINT16_MAX;
        return HG_E_BUSY;
    }
    self->frame[written & (uint8_t)(self->length - 1U)] = *frame;
    self->written = (uint8_t)(written + 1U);
    return HG_OK;
}

hg_status hg_inbox_get(hg_inbox *self, hg_can_frame *frame)
{
    const uint8_t read = self->read;
    if (self->written == read) {
        return HG_E_EMPTY;
    }
    *frame = self->frame[read & (uint8_t)(self->length - 1U)];
    self->read = (uint8_t)(read + 1U);
    return HG_OK;
}
