#include "hullguard/node.h"

#include <stddef.h>

#define COUNTER_MASK 0x0FU
#define STAMP_MASK 0x0FU
#define COUNTER_BIT 8U /* of the node's own frames */
#define STAMP_BIT 12U
#define STAMP_AHEAD_MAX 7U /* stamps beyond lie nearer in the past than in the future */
#define VERDICT_LENGTH 8U
#define VERDICT_LENGTH_WIDE 12U /* with room for candidates 31:16 */
#define VERDICT_FAULTS 16U     /* candidates without that room */

/* A macro, so that it is a constant for a compiler that does not optimise too: without the part there is nothing to link with. */
#define FREEZES(config) ((HG_WITH_FREEZE != 0) && ((config)->freeze != NULL))

static void raise16(uint16_t *counter, uint32_t by)
{
    const uint32_t room = UINT16_MAX - (uint32_t)*counter;
    *counter = (uint16_t)(*counter + ((by < room) ? by : room));
}

static void raise32(uint32_t *counter)
{
    *counter += (*counter < UINT32_MAX) ? 1U : 0U;
}

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

/* Does a message begin as frame.h draws the node's own? */
static bool own_header(const hg_e2e_config *e2e)
{
    return (e2e->profile == HG_E2E_P22) && (e2e->crc == 0U) && (e2e->counter == COUNTER_BIT) && (e2e->stamp == STAMP_BIT);
}

/* A closing frame is the clock: without a counter a lost one would never show. */
static bool has_counter(const hg_e2e_config *e2e)
{
    return (e2e->profile != HG_E2E_NONE) && ((e2e->ignore & HG_E2E_IGNORE_COUNTER) == 0U);
}

static bool stamped(const hg_e2e_config *e2e)
{
    return (e2e->stamp != HG_E2E_NO_STAMP) && ((e2e->ignore & HG_E2E_IGNORE_STAMP) == 0U);
}

/* Does a sender speak every interval_max samples, whatever its signals do? Its silence promises nothing, and its age tells of every loss. */
static bool periodic(const hg_trigger_config *trigger)
{
    bool always = true;
    for (uint8_t l = 0U; l < trigger->levels; l++) {
        always = always && ((trigger->silence[l] + 1U) >= trigger->interval_max);
    }
    return always;
}

bool hg_report_valid(const hg_message *verdict, const hg_message *status)
{
    const bool valid = (verdict != NULL) && (status != NULL) && hg_frame_valid(verdict) && hg_frame_valid(status);
    return valid && ((verdict->length == VERDICT_LENGTH) || wide(verdict)) && (status->length == VERDICT_LENGTH) && (verdict->width == 0U) &&
           (status->width == 0U) && own_header(verdict->e2e) && own_header(status->e2e);
}

static bool config_valid(const hg_node_config *config)
{
    bool valid = (config->detector != NULL) && (config->message != NULL) && (config->heartbeat >= 1U) && hg_report_valid(config->verdict, config->status);
    valid = valid && (config->detector->hold != NULL) && (config->closing < config->detector->groups) && (config->detector->groups <= HG_GROUPS_MAX);
    for (uint8_t i = 0U; valid && (i < config->detector->groups); i++) {
        valid = hg_frame_valid(&config->message[i]) && (config->detector->hold[i].trigger != NULL) &&
                (config->message[i].width == config->detector->hold[i].trigger->width);
    }
    const bool freezes = FREEZES(config); /* false where the library has no freeze frame */
    return valid && has_counter(config->message[config->closing].e2e) && (freezes == (config->freeze != NULL));
}

/* The freeze frame records what the detector, which has been started, makes of each sample. */
static hg_status start_freeze(hg_node *self, const hg_node_memory *memory)
{
    if (!FREEZES(self->config)) {
        return HG_OK;
    }
    self->freeze = memory->freeze;
    return hg_freeze_start(memory->freeze, self->config->freeze, &memory->frozen, &self->detector, self->config->model_hash);
}

hg_status hg_node_start(hg_node *self, const hg_node_config *config, const hg_node_memory *memory, hg_start how)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL) || (memory->link == NULL) || (memory->closing == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!config_valid(config)) {
        return HG_E_CONFIG;
    }
    *self = (hg_node){.config = config, .link = memory->link, .closing = memory->closing, .ahead_max = STAMP_AHEAD_MAX};
    self->synchronised = how == HG_START_REST;
    for (uint8_t i = 0U; i < config->detector->groups; i++) {
        self->link[i] = (hg_link){.timed = false};
        hg_e2e_receiver_start(&self->link[i].receiver);
        hg_e2e_machine_start(&self->link[i].machine);
    }
    const hg_status status = hg_detector_start(&self->detector, config->detector, &memory->detector, how);
    if ((status == HG_OK) && (!verdict_holds(config->verdict, &config->detector->decision))) {
        return HG_E_CONFIG;
    }
    return (status == HG_OK) ? start_freeze(self, memory) : status;
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

void hg_link_refuse(hg_link_health *health, hg_status status)
{
    if (status == HG_E_FORMAT) {
        raise16(&health->format, 1U);
    } else if (status == HG_E_CRC) {
        raise16(&health->crc, 1U);
    } else if (status == HG_E_REPEATED) {
        raise16(&health->repeated, 1U);
    } else if (status == HG_E_SEQUENCE) {
        raise16(&health->sequence, 1U);
    } else if (status == HG_E_STATE) {
        raise16(&health->untrusted, 1U);
    } else if (status == HG_E_NUMERIC) {
        raise16(&health->numeric, 1U);
    } else {
        /* not refused, or counted where the stamp was read */
    }
}

/* Samples that a frame is ahead of the open one, modulo 16 or the counter's turn: above STAMP_AHEAD_MAX it is behind. */
static uint8_t ahead_of(const hg_node *self, uint8_t group, const hg_e2e_header *header)
{
    const hg_e2e_config *e2e = self->config->message[group].e2e;
    uint32_t ahead = 0U;
    if (stamped(e2e)) {
        ahead = (header->stamp - self->k) & STAMP_MASK;
    } else if ((group == self->config->closing) && self->closed) {
        /* One closing frame a sample: its counter is a stamp, too. */
        const uint32_t modulus = hg_e2e_modulus(e2e);
        const uint32_t frames = ((header->counter + modulus) - self->closing_counter) % modulus;
        ahead = ((frames + modulus) - ((self->k - self->closing_k) % modulus)) % modulus;
    } else {
        /* whatever comes belongs to the open sample */
    }
    return (uint8_t)ahead;
}

/* Frames of a group that can have been sent from its last good one to one of sample k, that one included. */
static uint16_t step_max(const hg_node *self, uint8_t group, uint32_t k)
{
    const hg_link *link = &self->link[group];
    const hg_trigger_config *trigger = self->config->detector->hold[group].trigger;
    if (!link->timed) {
        return HG_E2E_ANY_STEP;
    }
    uint32_t shortest = UINT8_MAX;
    for (uint8_t l = 0U; l < trigger->levels; l++) {
        shortest = (trigger->silence[l] < shortest) ? trigger->silence[l] : shortest;
    }
    const uint32_t passed = k - link->k;
    uint32_t step = (passed <= (uint32_t)INT32_MAX) ? (passed / (shortest + 1U)) : 0U;
    /* Without a stamp two frames of neighbouring samples may come within one. */
    step += stamped(self->config->message[group].e2e) ? 0U : 1U;
    return (step < HG_E2E_ANY_STEP) ? (uint16_t)step : HG_E2E_ANY_STEP;
}

/* Sample and sequence of a measurement frame whose checksum is good. One of another sample moves the counter only where it fits the sequence:
 * a late frame has been received, an old one that is sent once more has nothing to say. */
static hg_status admit_sample(hg_node *self, uint8_t group, const hg_e2e_header *header, hg_e2e_progress *progress)
{
    const hg_e2e_config *e2e = self->config->message[group].e2e;
    hg_link *link = &self->link[group];
    const uint8_t ahead = ahead_of(self, group, header);
    const uint32_t k = (self->k + ahead) - ((ahead > STAMP_AHEAD_MAX) ? (STAMP_MASK + 1U) : 0U);
    const uint16_t step = step_max(self, group, k);
    hg_e2e_receiver moved = link->receiver;
    hg_status status = hg_e2e_sequence(e2e, &moved, header, step, progress); /* no repetition: admit() has looked */
    /* In a time that is long enough for a whole turn the counter says nothing for certain. */
    progress->continues = progress->continues && (step <= hg_e2e_modulus(e2e));
    if ((ahead == 0U) || (status == HG_OK)) {
        link->receiver = moved;
        link->k = k;
        link->timed = self->synchronised;
    }
    raise16(&link->health.lost, (status == HG_OK) ? progress->lost : 0U);
    if (!self->synchronised) {
        status = HG_E_STAMP; /* of a sample that nobody can name yet: no fault of the sender's, and not counted */
    } else if (ahead != 0U) {
        raise16((ahead > STAMP_AHEAD_MAX) ? &link->health.late : &link->health.early, 1U);
        status = HG_E_STAMP;
    } else {
        /* of the open sample: the sequence decides */
    }
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
        (void)hg_hold_start(hold, hold->config, hold->sent, hold->value);
        self->link[i].timed = false;
    }
    hg_detector_restart(&self->detector, HG_START_MOVING);
}

/* Every sample has one closing frame: since the last one accepted, counter and sample index must have moved alike. */
static bool in_step(const hg_node *self, const hg_e2e_header *header, uint8_t ahead)
{
    const uint32_t modulus = hg_e2e_modulus(self->config->message[self->config->closing].e2e);
    const uint32_t frames = ((header->counter + modulus) - self->closing_counter) % modulus;
    const uint32_t samples = ((self->k + ahead) - self->closing_k) % modulus;
    return (!self->closed) || (frames == samples);
}

/* Is a refused closing frame the next but a few after the refused one before it? Then it is this node that has lost the sample index. */
static bool agrees(const hg_node *self, const hg_e2e_header *header)
{
    const hg_e2e_config *e2e = self->config->message[self->config->closing].e2e;
    const uint32_t modulus = hg_e2e_modulus(e2e);
    const uint32_t frames = ((header->counter + modulus) - self->slipped_counter) % modulus;
    const uint32_t samples = ((uint32_t)header->stamp - self->slipped_stamp) & STAMP_MASK;
    const bool paced = (!self->clocked) || (frames == (self->k - self->slipped_k));
    return self->slipped && paced && (frames >= 1U) && (frames <= STAMP_AHEAD_MAX) && ((!stamped(e2e)) || (samples == frames));
}

/* A closing frame of a sample that was closed without it, late but no old one, has been received all the same: it is no lost frame, and the
 * next one goes on from it. */
static void note_straggler(hg_node *self, const hg_e2e_header *header)
{
    const uint8_t closing = self->config->closing;
    const hg_e2e_config *e2e = self->config->message[closing].e2e;
    const uint32_t modulus = hg_e2e_modulus(e2e);
    const uint32_t frames = ((header->counter + modulus) - self->closing_counter) % modulus;
    const uint32_t without = (self->k - 1U) - self->closing_k; /* samples closed since the last one */
    const uint32_t k = self->closing_k + frames;
    const bool stamp_fits = (!stamped(e2e)) || (header->stamp == (k & STAMP_MASK));
    if (self->closed && (frames >= 1U) && (frames <= without) && stamp_fits) {
        hg_e2e_progress progress = {.lost = 0U, .continues = false};
        (void)hg_e2e_sequence(e2e, &self->link[closing].receiver, header, HG_E2E_ANY_STEP, &progress);
        raise16(&self->link[closing].health.lost, progress.lost);
        self->closing_counter = header->counter;
        self->closing_k = k;
    }
}

static hg_status refuse_closing(hg_node *self, const hg_e2e_header *header, uint8_t ahead)
{
    hg_link_health *health = &self->link[self->config->closing].health;
    hg_status status = HG_E_SEQUENCE;
    self->slipped = true;
    self->slipped_counter = header->counter;
    self->slipped_stamp = header->stamp;
    self->slipped_k = self->k;
    note_straggler(self, header);
    if (ahead > STAMP_AHEAD_MAX) {
        raise16(&health->late, 1U);
        status = HG_E_STAMP;
    } else if (ahead > self->ahead_max) {
        raise16(&health->early, 1U);
        status = HG_E_STAMP;
    } else {
        /* out of step */
    }
    return status;
}

/* Has a frame without a stamp been booked to the open sample? Where closing frames are missing it may be of a later one. */
static bool misplaced(const hg_node *self)
{
    bool any = false;
    for (uint8_t i = 0U; i < self->config->detector->groups; i++) {
        any = any || (self->detector.memory.hold[i].fresh && (!stamped(self->config->message[i].e2e)));
    }
    return any;
}

/* The closing frame tells the time: steps become due. Without a code its numbers are not to be used, and the sample is closed without them. */
static hg_status close_sample(hg_node *self, const int32_t *code, const hg_e2e_header *header)
{
    const uint8_t closing = self->config->closing;
    const hg_message *message = &self->config->message[closing];
    hg_link *link = &self->link[closing];
    uint8_t ahead = ahead_of(self, closing, header);
    const bool known = self->synchronised && (ahead <= self->ahead_max) && in_step(self, header, ahead);
    if (self->synchronised && (!known)) {
        if (!agrees(self, header)) {
            return refuse_closing(self, header, ahead);
        }
        hg_e2e_receiver_start(&link->receiver);
    }
    if ((!known) || ((ahead > 0U) && misplaced(self))) {
        if (self->synchronised) {
            forget_past(self);
        }
        self->k += (known || stamped(message->e2e)) ? ahead : 0U; /* the sender's sample */
        ahead = 0U;
    }
    hg_e2e_progress progress = {.lost = 0U, .continues = false};
    (void)hg_e2e_sequence(message->e2e, &link->receiver, header, HG_E2E_ANY_STEP, &progress); /* no repetition, and any step will do */
    /* In step with the time, as many are missing as samples, however often the counter has gone round meanwhile. */
    raise16(&link->health.lost, (known && self->closed) ? (((self->k + ahead) - self->closing_k) - 1U) : 0U);
    self->synchronised = true;
    self->slipped = false;
    self->closed = true;
    self->closing_counter = header->counter;
    self->closing_k = self->k + ahead;
    self->held = code != NULL;
    for (uint8_t g = 0U; self->held && (g < message->width); g++) {
        self->closing[g] = code[g];
    }
    self->continues = progress.continues;
    self->due = (uint8_t)(ahead + 1U);
    return HG_OK;
}

/* One frame alone: kind, length, checksum, and is it the last one once more? */
static hg_status admit(const hg_node *self, uint8_t group, const hg_can_frame *frame, hg_e2e_header *header)
{
    const hg_message *message = &self->config->message[group];
    hg_status status = HG_E_FORMAT;
    if (hg_frame_matches(message, frame)) {
        status = hg_e2e_check(message->e2e, frame->data, frame->length, header);
    }
    if ((status == HG_OK) && hg_e2e_repeated(message->e2e, &self->link[group].receiver, header)) {
        status = HG_E_REPEATED;
    }
    return status;
}

/* What a frame of the open sample says. A closing frame tells the time whatever its numbers are. */
static hg_status book(hg_node *self, uint8_t group, const hg_can_frame *frame, const hg_e2e_header *header, const hg_e2e_progress *progress)
{
    int32_t code[HG_GROUP_SIGNALS_MAX];
    const hg_message *message = &self->config->message[group];
    hg_link *link = &self->link[group];
    const bool trusted = (link->machine.state != HG_E2E_INVALID) || ((message->e2e->ignore & HG_E2E_IGNORE_STATE) != 0U);
    hg_status status = trusted ? hg_frame_unpack(message, frame, code) : HG_E_STATE;
    if (group == self->config->closing) {
        const hg_status timed = close_sample(self, (status == HG_OK) ? code : NULL, header);
        status = (timed == HG_OK) ? status : timed;
    } else if (status == HG_OK) {
        const bool uncounted = (message->e2e->profile == HG_E2E_NONE) && periodic(self->config->detector->hold[group].trigger);
        status = hg_detector_receive(&self->detector, group, code, progress->continues || uncounted);
        if (status == HG_E_REPEATED) {
            /* A second good frame for one sample is no duplicate by its counter: what it said is lost, and the next frame continues it. */
            (void)hg_detector_lose(&self->detector, group);
        }
    } else {
        /* refused */
    }
    if (status == HG_OK) {
        count_good(&link->health, code, message->width);
    }
    return status;
}

hg_status hg_node_receive(hg_node *self, const hg_can_frame *frame)
{
    hg_e2e_header header = {.stamp = 0U, .counter = 0U, .crc = 0U};
    hg_e2e_progress progress = {.lost = 0U, .continues = false};
    const uint8_t group = group_of(self->config, frame);
    if (group >= self->config->detector->groups) {
        const hg_status request = FREEZES(self->config) ? hg_freeze_receive(self->freeze, frame) : HG_E_ID;
        if (request == HG_E_ID) {
            raise32(&self->unknown);
        }
        return request;
    }
    if (self->due > 0U) {
        return HG_E_BUSY;
    }
    const bool closing = group == self->config->closing;
    hg_link *link = &self->link[group];
    hg_status status = admit(self, group, frame, &header);
    if ((status == HG_OK) && (!closing)) {
        status = admit_sample(self, group, &header, &progress);
    }
    if ((status != HG_E_FORMAT) && (status != HG_E_REPEATED)) { /* a twin of another kind or length, or a double, says nothing new of its sender */
        (void)hg_e2e_machine_step(&link->machine, self->config->message[group].e2e->limits, status);
    }
    status = (status == HG_OK) ? book(self, group, frame, &header, &progress) : status;
    hg_link_refuse(&link->health, status);
    if ((status != HG_OK) && (status != HG_E_REPEATED)) {
        (void)hg_detector_lose(&self->detector, group);
    }
    return status;
}

void hg_node_expect(hg_node *self, uint32_t samples)
{
    self->ahead_max = (samples < STAMP_AHEAD_MAX) ? (uint8_t)samples : STAMP_AHEAD_MAX;
    self->clocked = true;
}

void hg_node_overdue(hg_node *self)
{
    self->clocked = true;
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

/* A sender speaks at least every interval_max samples: each time that passes without a frame is an event of its link. */
static void look_at_deadlines(hg_node *self)
{
    for (uint8_t i = 0U; i < self->config->detector->groups; i++) {
        const uint8_t age = hg_hold_age(&self->detector.memory.hold[i]);
        const uint8_t interval = self->config->detector->hold[i].trigger->interval_max;
        if ((age >= interval) && (age < UINT8_MAX) && ((age % interval) == 0U)) {
            (void)hg_e2e_machine_step(&self->link[i].machine, self->config->message[i].e2e->limits, HG_E_EMPTY);
        }
    }
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
    look_at_deadlines(self);
    *verdict = (hg_verdict){.k = self->k,
                            .model_hash = self->config->model_hash,
                            .candidates = finding.candidates,
                            .plant = finding.plant,
                            .basis = finding.basis,
                            .bus = bus_of(self),
                            .refused = refused(self)};
    if (FREEZES(self->config)) {
        const hg_freeze_row row = {.k = self->k, .candidates = finding.candidates, .bus = verdict->bus, .plant = finding.plant, .basis = finding.basis};
        hg_freeze_step(self->freeze, &row);
    }
    self->k++;
    return HG_OK;
}

hg_status hg_node_freeze(hg_node *self, hg_can_frame *frame)
{
    return FREEZES(self->config) ? hg_freeze_report(self->freeze, frame) : HG_E_EMPTY;
}

static hg_can_frame blank(const hg_message *message)
{
    hg_can_frame frame;
    hg_frame_pack(message, NULL, &frame); /* no fields: an empty frame of the message's kind and length */
    return frame;
}

void hg_verdict_write(const hg_message *message, const hg_verdict *verdict, bool reply, uint8_t counter, hg_can_frame *frame)
{
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
    (void)hg_e2e_protect(message->e2e, frame->data, frame->length, counter, (uint8_t)(verdict->k & STAMP_MASK));
}

static uint8_t clipped(uint32_t count)
{
    return (count > UINT8_MAX) ? UINT8_MAX : (uint8_t)count;
}

void hg_status_write(const hg_message *message, const hg_verdict *verdict, uint32_t lost, uint32_t refusals, uint8_t counter, hg_can_frame *frame)
{
    *frame = blank(message);
    frame->data[2] = (uint8_t)(verdict->model_hash & 0xFFU);
    frame->data[3] = (uint8_t)((verdict->model_hash >> 8U) & 0xFFU);
    frame->data[4] = (uint8_t)((verdict->model_hash >> 16U) & 0xFFU);
    frame->data[5] = (uint8_t)((verdict->model_hash >> 24U) & 0xFFU);
    frame->data[6] = clipped(lost);
    frame->data[7] = clipped(refusals);
    (void)hg_e2e_protect(message->e2e, frame->data, frame->length, counter, (uint8_t)(verdict->k & STAMP_MASK));
}

/* The status frame of all links together. */
static void put_status(const hg_node *self, const hg_verdict *verdict, hg_can_frame *frame)
{
    uint32_t lost = 0U;
    uint32_t refusals = 0U;
    for (uint8_t i = 0U; i < self->config->detector->groups; i++) {
        const hg_link_health *health = &self->link[i].health;
        lost += health->lost;
        refusals += (uint32_t)health->crc + health->format + health->early + health->late + health->sequence + health->untrusted + health->numeric;
    }
    hg_status_write(self->config->status, verdict, lost, refusals, self->status_counter, frame);
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
        hg_verdict_write(self->config->verdict, verdict, (!changed) && (!beat), self->verdict_counter, &frame[0]);
        self->verdict_counter = (self->verdict_counter + 1U) & COUNTER_MASK;
        frames = 1U;
    }
    if (changed || beat) {
        self->reported = true;
        self->last = *verdict;
    }
    if (beat) {
        self->silence = 0U;
        put_status(self, verdict, &frame[1]);
        self->status_counter = (self->status_counter + 1U) & COUNTER_MASK;
        frames = 2U;
    }
    return frames;
}

hg_status hg_verdict_read(const hg_message *message, const hg_can_frame *frame, hg_verdict *verdict, bool *reply)
{
    hg_e2e_header header;
    if ((!hg_frame_matches(message, frame)) || ((frame->length != VERDICT_LENGTH) && (!wide(message)))) {
        return HG_E_FORMAT;
    }
    const hg_status status = hg_e2e_check(message->e2e, frame->data, frame->length, &header);
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
