#include "hullguard/tracker.h"

#include <stddef.h>
#include <string.h>

#if HG_REAL_F32 || HG_REAL_F64

#define COUNTER_MASK 0x0FU
#define STAMP_MASK 0x0FU
#define AHEAD_MAX 7U       /* stamps beyond lie nearer in the past than in the future */
#define BUS_SENSORS 8U     /* that a verdict has two bits each for */
#define FNV_PRIME 0x01000193U
#define TURNS_MAX HG_REAL_C(32767.0) /* periods that a value which wraps can be away from 0 */

static void add16(uint16_t *counter, uint32_t by)
{
    const uint32_t room = UINT16_MAX - (uint32_t)*counter;
    *counter = (uint16_t)(*counter + ((by < room) ? by : room));
}

static void add32(uint32_t *counter)
{
    *counter += (*counter < UINT32_MAX) ? 1U : 0U;
}

static uint16_t mark(uint8_t i)
{
    return (uint16_t)(1UL << i);
}

/* A sensor's message, or behind the last one the tick's. */
static const hg_message *message_of(const hg_tracker_config *config, uint8_t i)
{
    return (i < config->fusion->sensors) ? config->source[i].message : config->tick;
}

/* Does a message say which sample it is of, and how many were before it? */
static bool linked(const hg_message *message, uint16_t modulus, uint8_t width)
{
    return (message != NULL) && hg_frame_valid(message) && (message->width == width) && (message->e2e->stamp != HG_E2E_NO_STAMP) &&
           (message->e2e->ignore == 0U) && (hg_e2e_modulus(message->e2e) == modulus);
}

static bool all_valid(const hg_tracker_config *config)
{
    bool valid = (config->fusion != NULL) && (config->source != NULL) && (config->estimate != NULL) && (config->heartbeat >= 1U) && (config->interval >= 1U);
    valid = valid && hg_fusion_valid(config->fusion) && (config->fusion->inputs == 0U) && hg_report_valid(config->verdict, config->status);
    for (uint8_t i = 0U; valid && (i <= config->fusion->sensors); i++) {
        valid = linked(message_of(config, i), config->fusion->modulus, (i < config->fusion->sensors) ? 1U : 0U);
    }
    for (uint8_t j = 0U; valid && (j < config->fusion->states); j++) {
        valid = hg_frame_valid(&config->estimate[j]) && (config->estimate[j].width == 2U);
    }
    return valid;
}

/* The filter from its initial state on, and nobody judged yet. */
static void begin(hg_tracker *self)
{
    hg_fusion_reset(&self->fusion);
    if (self->config->consistency != NULL) {
        hg_consistency_reset(&self->consistency);
    }
    for (uint8_t i = 0U; i <= self->config->fusion->sensors; i++) {
        self->link[i].timed = false;
    }
    self->judging = false;
    (void)hg_fusion_open(&self->fusion, NULL); /* no input is not finite, and no sample is open */
    hg_fusion_number(&self->fusion, self->k);
}

hg_status hg_tracker_start(hg_tracker *self, const hg_tracker_config *config, const hg_tracker_memory *memory, hg_start how)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL) || (memory->link == NULL) || (memory->real == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!all_valid(config)) {
        return HG_E_CONFIG;
    }
    *self = (hg_tracker){.config = config, .link = memory->link, .value = memory->real, .deviation = &memory->real[config->fusion->states],
                         .synchronised = how == HG_START_REST, .ahead_max = AHEAD_MAX};
    for (uint8_t i = 0U; i <= config->fusion->sensors; i++) {
        self->link[i] = (hg_link){.timed = false};
        hg_e2e_receiver_start(&self->link[i].receiver);
        hg_e2e_machine_start(&self->link[i].machine);
    }
    hg_status status = hg_fusion_start(&self->fusion, config->fusion, &memory->fusion);
    if ((status == HG_OK) && (config->consistency != NULL)) {
        status = hg_consistency_start(&self->consistency, config->consistency, &self->fusion, &memory->consistency);
    }
    if (status == HG_OK) {
        begin(self);
    }
    return status;
}

/* Whose identifier this is: a sensor's, behind them the tick's, behind that nobody's. */
static uint8_t link_of(const hg_tracker_config *config, const hg_can_frame *frame)
{
    uint8_t i = 0U;
    while ((i <= config->fusion->sensors) && ((message_of(config, i)->id != frame->id) ||
                                              (((message_of(config, i)->flags ^ frame->flags) & HG_CAN_EXTENDED) != 0U))) {
        i++;
    }
    return i;
}

/* Sample and sequence of a sensor's frame whose checksum is good. A frame of a sample that is not held has been received all the same. */
static hg_status admit_value(hg_tracker *self, uint8_t i, const hg_e2e_header *header)
{
    const hg_e2e_config *e2e = self->config->source[i].message->e2e;
    hg_link *link = &self->link[i];
    hg_e2e_receiver moved = link->receiver;
    hg_e2e_progress progress = {.lost = 0U, .continues = false};
    if (!self->synchronised) {
        return HG_E_STAMP; /* of a sample that nobody can name yet: no fault of the sender's, and not counted */
    }
    const uint8_t back = (uint8_t)((self->k - header->stamp) & STAMP_MASK);
    const uint8_t ahead = (uint8_t)((header->stamp - self->k) & STAMP_MASK);
    const bool held = back <= self->config->fusion->depth;
    const uint32_t k = (held || (ahead > AHEAD_MAX)) ? (self->k - back) : (self->k + ahead);
    const uint32_t passed = k - link->k;
    uint16_t step = (passed <= (uint32_t)INT16_MAX) ? (uint16_t)passed : 0U; /* a frame a sample at most */
    step = link->timed ? step : HG_E2E_ANY_STEP;
    hg_status status = hg_e2e_sequence(e2e, &moved, header, step, &progress); /* no repetition: hg_tracker_receive() has looked */
    if (held || (status == HG_OK)) {
        link->receiver = moved;
        link->k = k;
        link->timed = true;
    }
    add16(&link->health.lost, (status == HG_OK) ? progress.lost : 0U);
    self->lossy = (uint16_t)((self->lossy & (uint16_t)~mark(i)) | ((progress.lost > 0U) ? mark(i) : 0U));
    if (!held) {
        add16((ahead > AHEAD_MAX) ? &link->health.late : &link->health.early, 1U);
        status = HG_E_STAMP;
    }
    return status;
}

/* Codes of a scale that goes round, times its resolution. */
static hg_real period_of(const hg_code_scale *scale)
{
    return (((hg_real)scale->maximum - (hg_real)scale->minimum) + HG_REAL_C(1.0)) * scale->resolution;
}

/* The value of a good frame goes into the filter. */
static hg_status book_value(hg_tracker *self, uint8_t i, const hg_can_frame *frame, const hg_e2e_header *header)
{
    const hg_tracker_source *source = &self->config->source[i];
    const hg_code_scale *scale = source->message->scale;
    int32_t code = HG_CODE_INVALID;
    hg_status status = (self->link[i].machine.state != HG_E2E_INVALID) ? hg_frame_unpack(source->message, frame, &code) : HG_E_STATE;
    if ((status == HG_OK) && (code == HG_CODE_INVALID)) {
        add16(&self->link[i].health.invalid, 1U);
        status = HG_E_NUMERIC;
    }
    if (status == HG_OK) {
        hg_real y = hg_fusion_local(&self->fusion, i, header->stamp, hg_code_value(scale, code));
        if (source->wraps) {
            y = hg_fusion_unwrap(&self->fusion, i, header->stamp, y, period_of(scale));
        }
        status = hg_fusion_receive(&self->fusion, i, header->stamp, header->counter, y);
    }
    add16(&self->link[i].health.good, (status == HG_OK) ? 1U : 0U);
    return status;
}

/* A tick that is late, or further ahead than the clock allows: true when it goes on from one like it, so that it is this node that has lost the time. */
static bool slips(hg_tracker *self, const hg_e2e_header *header, bool late)
{
    const uint32_t modulus = self->config->fusion->modulus;
    const bool again = self->slipped && (((((uint32_t)header->counter + modulus) - self->slipped_counter) % modulus) == 1U) &&
                       (((uint32_t)header->stamp - self->slipped_stamp) & STAMP_MASK) == 1U;
    hg_link_health *health = &self->link[self->config->fusion->sensors].health;
    self->slipped = !again;
    self->slipped_counter = header->counter;
    self->slipped_stamp = header->stamp;
    add16(late ? &health->late : &health->early, again ? 0U : 1U);
    return again;
}

static hg_status take_tick(hg_tracker *self, const hg_e2e_header *header)
{
    hg_link *link = &self->link[self->config->fusion->sensors];
    hg_e2e_progress progress;
    uint8_t ahead = (uint8_t)((header->stamp - self->k) & STAMP_MASK);
    if (self->synchronised && (ahead > self->ahead_max)) {
        if (!slips(self, header, ahead > AHEAD_MAX)) {
            return HG_E_STAMP;
        }
        self->synchronised = false;
    }
    if (!self->synchronised) {
        self->k += ahead; /* the sender's sample */
        ahead = 0U;
        begin(self);
    }
    (void)hg_e2e_sequence(self->config->tick->e2e, &link->receiver, header, HG_E2E_ANY_STEP, &progress); /* no repetition, and any step will do */
    add16(&link->health.lost, ahead);
    add16(&link->health.good, 1U);
    self->synchronised = true;
    self->slipped = false;
    self->ticked = true;
    self->due = (uint8_t)(ahead + 1U);
    return HG_OK;
}

hg_status hg_tracker_receive(hg_tracker *self, const hg_can_frame *frame)
{
    const uint8_t i = link_of(self->config, frame);
    const uint8_t tick = self->config->fusion->sensors;
    if (i > tick) {
        add32(&self->unknown);
        return HG_E_ID;
    }
    if (self->due > 0U) {
        return HG_E_BUSY;
    }
    const hg_message *message = message_of(self->config, i);
    hg_link *link = &self->link[i];
    hg_e2e_header header = {.stamp = 0U, .counter = 0U, .crc = 0U};
    hg_status status = hg_frame_matches(message, frame) ? hg_e2e_check(message->e2e, frame->data, frame->length, &header) : HG_E_FORMAT;
    if ((status == HG_OK) && hg_e2e_repeated(message->e2e, &link->receiver, &header)) {
        status = HG_E_REPEATED;
    }
    if ((status == HG_OK) && (i < tick)) {
        status = admit_value(self, i, &header);
    }
    if ((status != HG_E_FORMAT) && (status != HG_E_REPEATED)) { /* a twin of another kind or length, or a double, says nothing new of its sender */
        (void)hg_e2e_machine_step(&link->machine, message->e2e->limits, status);
    }
    if (status == HG_OK) {
        status = (i < tick) ? book_value(self, i, frame, &header) : take_tick(self, &header);
    }
    hg_link_refuse(&link->health, status);
    return status;
}

void hg_tracker_expect(hg_tracker *self, uint32_t samples)
{
    self->ahead_max = (samples < AHEAD_MAX) ? (uint8_t)samples : (uint8_t)AHEAD_MAX;
}

void hg_tracker_overdue(hg_tracker *self)
{
    if (self->due == 0U) {
        self->due = 1U;
        self->ticked = false;
    }
}

void hg_tracker_outage(hg_tracker *self)
{
    for (uint8_t i = 0U; i <= self->config->fusion->sensors; i++) {
        hg_e2e_receiver_start(&self->link[i].receiver); /* a counter that ran round meanwhile is no repetition */
    }
    begin(self);
    self->due = 0U;
    self->slipped = false;
    self->synchronised = false;
}

/* Blamed sensors are out from the next sample on. */
static void judge_sensors(hg_tracker *self, bool lost)
{
    if (self->config->consistency == NULL) {
        self->judging = true;
        return;
    }
    const uint16_t blamed = lost ? 0U : hg_consistency_step(&self->consistency);
    for (uint8_t i = 0U; i < self->config->fusion->sensors; i++) {
        if ((blamed & mark(i)) != 0U) {
            hg_fusion_exclude(&self->fusion, i, true);
        }
    }
    self->blamed |= blamed;
    self->judging = self->judging || (self->consistency.rests == 0U);
    if (lost || (blamed != 0U)) {
        hg_consistency_reset(&self->consistency);
    }
}

static bool dead(const hg_tracker *self, uint8_t i)
{
    return self->fusion.sensor[i].age > self->config->fusion->watchdog;
}

/* By how many samples a sensor's heartbeat is overdue, 0: it is not. What may be late as a matter of course is not overdue before that. */
static uint32_t overdue_by(const hg_tracker *self, uint8_t i)
{
    const uint32_t age = self->fusion.sensor[i].age;
    const uint32_t limit = (uint32_t)self->config->fusion->heartbeat + self->config->fusion->delay;
    return (age > limit) ? (age - limit) : 0U;
}

static hg_bus_health health_of(const hg_tracker *self, uint8_t i)
{
    hg_bus_health health = HG_BUS_GOOD;
    if (self->link[i].health.good == 0U) {
        health = HG_BUS_ABSENT;
    } else if (dead(self, i)) {
        health = HG_BUS_STALE;
    } else if (((self->lossy & mark(i)) != 0U) || (overdue_by(self, i) > 0U)) {
        health = HG_BUS_LOSSY;
    } else {
        /* good */
    }
    return health;
}

/* A sensor that had to speak by now and did not is an event of its link, each time. */
static void watch_deadlines(hg_tracker *self)
{
    const uint8_t interval = self->config->fusion->heartbeat;
    for (uint8_t i = 0U; i < self->config->fusion->sensors; i++) {
        const uint32_t by = overdue_by(self, i);
        if ((by > 0U) && (self->fusion.sensor[i].age < UINT8_MAX) && (((by - 1U) % interval) == 0U)) {
            (void)hg_e2e_machine_step(&self->link[i].machine, self->config->source[i].message->e2e->limits, HG_E_EMPTY);
        }
    }
}

/* Two bits a sensor; of two that share them the larger number. */
static uint16_t with_health(uint16_t bus, uint8_t i, hg_bus_health health)
{
    const uint32_t place = 2U * ((uint32_t)i % BUS_SENSORS);
    const uint32_t own = (uint32_t)health;
    const uint32_t shared = ((uint32_t)bus >> place) & 3U;
    const uint32_t rest = (uint32_t)bus & ~((uint32_t)3U << place);
    return (uint16_t)(rest | (((own > shared) ? own : shared) << place));
}

static hg_verdict verdict_of(const hg_tracker *self)
{
    uint16_t deaf = 0U;
    uint16_t bus = 0U;
    uint16_t numeric = self->fusion.resets;
    const uint8_t sensors = self->config->fusion->sensors;
    for (uint8_t i = 0U; i < sensors; i++) {
        deaf |= dead(self, i) ? mark(i) : 0U;
        bus = with_health(bus, i, health_of(self, i));
        numeric |= self->link[i].health.numeric;
    }
    const bool heard = deaf != (uint16_t)((1UL << sensors) - 1UL);
    const uint16_t suspects = self->blamed | (heard ? deaf : 0U);
    const hg_plant quiet = (heard && self->judging) ? HG_PLANT_NONE : HG_PLANT_STARTING;
    return (hg_verdict){.k = self->k,
                        .model_hash = self->config->model_hash,
                        .candidates = suspects,
                        .plant = (suspects != 0U) ? HG_PLANT_CONFIRMED : quiet,
                        .basis = HG_BASIS_STATISTICAL,
                        .bus = bus,
                        .refused = numeric != 0U};
}

/* The estimate of the sample just closed, before the next one is opened. */
static void keep_estimate(hg_tracker *self)
{
    const hg_fusion_config *config = self->config->fusion;
    for (uint8_t j = 0U; j < config->states; j++) {
        const hg_real step = (config->origin != NULL) ? config->origin[j] : HG_REAL_ZERO;
        self->value[j] = self->fusion.x[j] + ((hg_real)self->fusion.origin[j] * step);
        self->deviation[j] = hg_linalg_root(self->fusion.P[((uint16_t)j * config->states) + j]);
    }
}

hg_status hg_tracker_step(hg_tracker *self, hg_verdict *verdict)
{
    if (self->due == 0U) {
        return HG_E_EMPTY;
    }
    self->due--;
    if ((self->due > 0U) || (!self->ticked)) {
        add32(&self->overdue);
    }
    const bool lost = hg_fusion_close(&self->fusion) != HG_OK; /* the state was not finite, and has begun again */
    judge_sensors(self, lost);
    watch_deadlines(self);
    keep_estimate(self);
    *verdict = verdict_of(self);
    add16(&self->unsaid, 1U);
    self->k++;
    (void)hg_fusion_open(&self->fusion, NULL); /* no input is not finite, and no sample is open */
    return HG_OK;
}

static void put_health(const hg_tracker *self, const hg_verdict *verdict, hg_can_frame *frame)
{
    uint32_t lost = 0U;
    uint32_t refused = 0U;
    for (uint8_t i = 0U; i <= self->config->fusion->sensors; i++) {
        const hg_link_health *health = &self->link[i].health;
        lost += health->lost;
        refused += (uint32_t)health->crc + health->format + health->early + health->late + health->sequence + health->untrusted + health->numeric;
    }
    hg_status_write(self->config->status, verdict, lost, refused, self->status_counter, frame);
}

uint8_t hg_tracker_report(hg_tracker *self, const hg_verdict *verdict, bool reply, hg_can_frame *frame)
{
    const hg_verdict *last = &self->last;
    const bool changed = (!self->reported) || (verdict->plant != last->plant) || (verdict->candidates != last->candidates) ||
                         (verdict->bus != last->bus) || (verdict->refused != last->refused);
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
        put_health(self, verdict, &frame[1]);
        self->status_counter = (self->status_counter + 1U) & COUNTER_MASK;
        frames = 2U;
    }
    return frames;
}

hg_status hg_tracker_estimate(hg_tracker *self, uint8_t j, hg_can_frame *frame)
{
    const hg_message *message = &self->config->estimate[j];
    if (self->unsaid < self->config->interval) {
        return HG_E_EMPTY;
    }
    const int32_t code[2] = {hg_code_encode(&message->scale[0], self->value[j]), hg_code_encode(&message->scale[1], self->deviation[j])};
    hg_frame_pack(message, code, frame);
    (void)hg_e2e_protect(message->e2e, frame->data, frame->length, self->estimate_counter, (uint8_t)((self->k - 1U) & STAMP_MASK));
    if ((j + 1U) == self->config->fusion->states) {
        self->unsaid = 0U;
        self->estimate_counter++;
    }
    return HG_OK;
}

static uint32_t digest_of(uint32_t digest, const void *data, size_t bytes)
{
    uint8_t byte[sizeof(hg_real)];
    uint32_t sum = digest;
    (void)memcpy(byte, data, bytes);
    for (size_t i = 0U; i < bytes; i++) {
        sum = (sum ^ byte[i]) * FNV_PRIME;
    }
    return sum;
}

uint32_t hg_tracker_digest(const hg_fusion *fusion, uint32_t digest)
{
    const uint8_t n = fusion->config->states;
    const uint8_t slots = (uint8_t)(fusion->config->depth + 1U);
    const uint8_t oldest = (uint8_t)(fusion->held - 1U);
    const uint8_t back = (fusion->config->delay < oldest) ? fusion->config->delay : oldest;
    const hg_fusion_slot *settled = &fusion->slot[(uint8_t)((fusion->newest + slots) - back) % slots];
    uint32_t sum = digest;
    for (uint8_t j = 0U; j < n; j++) {
        sum = digest_of(sum, &settled->x[j], sizeof(hg_real));
        sum = digest_of(sum, &fusion->origin[j], sizeof(int32_t));
    }
    for (uint16_t i = 0U; i < (uint16_t)((uint16_t)n * n); i++) {
        sum = digest_of(sum, &settled->P[i], sizeof(hg_real));
    }
    return sum;
}

const hg_link_health *hg_tracker_health(const hg_tracker *self, uint8_t i)
{
    return &self->link[i].health;
}

/* ---- A sensor's node ---- */

hg_status hg_fusion_sender_start(hg_fusion_sender *self, const hg_tracker *tracker, uint8_t sensor)
{
    if ((self == NULL) || (tracker == NULL) || (sensor >= tracker->config->fusion->sensors)) {
        return HG_E_ARGUMENT;
    }
    *self = (hg_fusion_sender){.tracker = tracker, .sensor = sensor, .counter = 0U};
    return HG_OK;
}

/* What is left of a value when whole periods are gone, within the codes. */
static hg_real wrapped(const hg_code_scale *scale, hg_real y)
{
    const hg_real period = period_of(scale);
    const hg_real half = (y < HG_REAL_ZERO) ? HG_REAL_C(-0.5) : HG_REAL_C(0.5);
    const hg_real turns = hg_real_max(hg_real_min((y / period) + half, TURNS_MAX), -TURNS_MAX);
    const hg_real rest = y - ((hg_real)(int32_t)turns * period);
    return hg_real_max(hg_real_min(rest, (hg_real)scale->maximum * scale->resolution), (hg_real)scale->minimum * scale->resolution);
}

hg_status hg_fusion_sender_step(hg_fusion_sender *self, hg_real y, hg_real dice, bool own, hg_can_frame *frame)
{
    const hg_tracker *tracker = self->tracker;
    const hg_tracker_source *source = &tracker->config->source[self->sensor];
    const hg_message *message = source->message;
    const uint8_t stamp = (uint8_t)(tracker->k & STAMP_MASK);
    if ((!tracker->synchronised) || (tracker->due > 0U)) {
        return HG_E_STATE;
    }
    hg_status status = hg_fusion_due(&tracker->fusion, self->sensor, hg_fusion_local(&tracker->fusion, self->sensor, stamp, y), dice);
    status = ((status == HG_E_EMPTY) && own) ? HG_OK : status;
    if (status == HG_OK) {
        const int32_t code = hg_code_encode(message->scale, source->wraps ? wrapped(message->scale, y) : y);
        if (code == HG_CODE_INVALID) {
            return HG_E_NUMERIC;
        }
        hg_frame_pack(message, &code, frame);
        (void)hg_e2e_protect(message->e2e, frame->data, frame->length, self->counter, stamp);
        self->counter = (uint8_t)(((uint16_t)self->counter + 1U) % tracker->config->fusion->modulus);
    }
    return status;
}

#endif
