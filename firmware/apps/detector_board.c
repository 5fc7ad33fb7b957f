/** @file
 *  A detector ECU without operating system: the platoon model's node (hullguard/node.h) on a board's CAN controller (hal/board/board.h). It
 *  begins in lockstep and at rest: every closing frame is answered with a verdict, and the clock only bounds how long a frame is offered to a
 *  full controller. Timed, a deadline watches the closing frames as in detector_node.c: a sample whose closing frame is overdue is
 *  closed without it, and an outage is told to the node.
 *
 *  Prints `ready` when it listens. One character on the console asks for more: `h` prints every counter of every group and `end`,
 *  `r` begins anew, in lockstep and at rest, with empty counters, and prints `ready`; so do `f`, which neither answers every closing frame nor
 *  has a deadline, and `t`, timed and in a moving plant; `q` ends. */
#include "board.h"
#include "platoon.h"

#define KEYS_US 5000U      /* how often the console is looked at while the bus is silent */
#define OFFER_MAX_US 50000U /* longest time one frame is offered to a controller that has no room: the heartbeat says it again */
#define PERIOD_US HG_PLATOON_SAMPLE_TIME_US
#define SLACK_US (PERIOD_US / 2U) /* how much later than expected a closing frame may be */
#define STAMPS_AHEAD 7U    /* samples without a closing frame that the next one's stamp still tells (node.h) */
#define EXIT_BUS 3U
#define EXIT_FAILED 1U

typedef struct {
    hg_hal        hal;
    hg_hal_filter filter[HG_PLATOON_GROUPS];
    uint32_t      steps;
    uint32_t      unsent;  /* frames that found no room or no bus */
    uint32_t      missed;  /* deadlines */
    uint32_t      outages; /* told to the node */
    bool          lockstep; /* answers every closing frame */
    bool          timed;
    uint64_t      deadline_us;   /* HG_HAL_FOREVER: not timed */
    uint64_t      closing_us;    /* arrival of the last closing frame */
    uint32_t      closing_steps; /* `steps` after its own */
} app;

static hg_platoon_node storage;

static void send_frame(app *self, const hg_can_frame *frame)
{
    const uint64_t until_us = hg_hal_now_us(&self->hal) + OFFER_MAX_US;
    hg_status status = hg_hal_send(&self->hal, frame);
    while ((status == HG_E_BUSY) && (hg_hal_now_us(&self->hal) < until_us)) {
        status = hg_hal_send(&self->hal, frame);
    }
    hg_hal_count(&self->unsent, (status == HG_OK) ? 0U : 1U);
}

static void make_steps(app *self)
{
    hg_verdict verdict;
    hg_can_frame frame[2];
    while (hg_node_step(&storage.node, &verdict) == HG_OK) {
        const uint8_t frames = hg_node_report(&storage.node, &verdict, self->lockstep && (storage.node.due == 0U), frame);
        for (uint8_t i = 0U; i < frames; i++) {
            send_frame(self, &frame[i]);
        }
        self->steps++;
    }
}

/* By how many samples this node can have fallen behind its sender, by the time of a frame's arrival; none is said without a clock. */
static void look_at_clock(app *self, uint64_t at_us)
{
    if ((!self->timed) || (!storage.node.closed) || (at_us < self->closing_us)) {
        return;
    }
    const uint64_t elapsed = ((at_us - self->closing_us) + (PERIOD_US / 2U)) / PERIOD_US;
    const uint64_t closed = (uint64_t)(self->steps - self->closing_steps) + 1U;
    const uint64_t behind = (elapsed > closed) ? (elapsed - closed) : 0U;
    hg_node_expect(&storage.node, (behind > STAMPS_AHEAD) ? STAMPS_AHEAD : (uint32_t)behind);
    if (behind > STAMPS_AHEAD) {
        hg_node_outage(&storage.node);
        hg_hal_count(&self->outages, 1U);
    }
}

static void take_frame(app *self, const hg_can_frame *frame, uint64_t at_us)
{
    look_at_clock(self, at_us);
    (void)hg_node_receive(&storage.node, frame); /* whatever it is: refusals are counted; no steps are due here */
    const bool closing = storage.node.due > 0U;  /* also one whose numbers could not be used */
    make_steps(self);
    if (closing && self->timed) {
        self->closing_us = at_us;
        self->closing_steps = self->steps;
        self->deadline_us = at_us + PERIOD_US + SLACK_US;
    }
}

/* What has arrived, a queue full of it at most, and then the deadline, by the clock before: what has come in time is not overtaken by the timer, and a bus
 * that never falls silent does not stop it. */
static void work(app *self)
{
    const uint64_t now_us = hg_hal_now_us(&self->hal);
    hg_can_frame frame;
    uint64_t at_us;
    for (uint32_t i = 0U; (i < HG_BOARD_DEPTH) && (hg_hal_receive(&self->hal, &frame, &at_us) == HG_OK); i++) {
        take_frame(self, &frame, at_us);
    }
    if (now_us >= self->deadline_us) {
        hg_node_overdue(&storage.node);
        make_steps(self);
        self->deadline_us += PERIOD_US;
        hg_hal_count(&self->missed, 1U);
    }
}

static void say_counter(const char *group, const char *name, uint32_t count)
{
    hg_board_say(group);
    hg_board_say(name);
    hg_board_say_number(count);
    hg_board_say("\n");
}

static void say_health(app *self)
{
    static const char *const group[] = HG_PLATOON_GROUP_NAMES;
    hg_hal_report report;
    for (uint8_t i = 0U; i < HG_PLATOON_GROUPS; i++) {
        const hg_link_health *h = hg_node_health(&storage.node, i);
        const struct {
            const char *name;
            uint32_t    count;
        } counters[] = {{".good ", h->good}, {".lost ", h->lost}, {".crc ", h->crc}, {".format ", h->format}, {".repeated ", h->repeated},
                        {".early ", h->early}, {".late ", h->late}, {".sequence ", h->sequence}, {".untrusted ", h->untrusted},
                        {".numeric ", h->numeric}, {".invalid ", h->invalid}};
        for (size_t j = 0U; j < (sizeof(counters) / sizeof(counters[0])); j++) {
            say_counter(group[i], counters[j].name, counters[j].count);
        }
    }
    hg_hal_state(&self->hal, &report);
    say_counter("steps", " ", self->steps);
    say_counter("unsent", " ", self->unsent);
    say_counter("missed", " ", self->missed);
    say_counter("outages", " ", self->outages);
    say_counter("can.received", " ", report.received);
    say_counter("can.sent", " ", report.sent);
    say_counter("can.lost", " ", report.lost);
    say_counter("can.refused", " ", report.refused);
    say_counter("can.errors", " ", report.errors);
    say_counter("can.malformed", " ", report.malformed);
    say_counter("can.bus", " ", (uint32_t)report.bus);
    hg_board_say("end\n");
}

/* As the key says: `r`, `f` or `t`. Only the groups' frames are of interest. */
static uint32_t begin(app *self, int key)
{
    *self = (app){.lockstep = key == 'r', .timed = key == 't', .deadline_us = HG_HAL_FOREVER};
    for (uint8_t i = 0U; i < HG_PLATOON_GROUPS; i++) {
        const hg_message *const message = &hg_platoon_config.message[i];
        self->filter[i] = (hg_hal_filter){.id = message->id, .mask = HG_CAN_ID_EXTENDED, .flags = message->flags & HG_CAN_EXTENDED};
    }
    if (hg_board_can(0U, self->filter, HG_PLATOON_GROUPS, &self->hal) != HG_OK) {
        hg_board_say("no CAN controller\n");
        return EXIT_BUS;
    }
    if ((hg_platoon_selftest(&storage) != HG_OK) || (hg_platoon_node_start(&storage, self->timed ? HG_START_MOVING : HG_START_REST) != HG_OK)) {
        hg_board_say("model fails its self-test, or does not start: generate its tables again\n");
        return EXIT_FAILED;
    }
    if (self->timed) { /* a bus that stays silent has to be reported from the start */
        self->deadline_us = hg_hal_now_us(&self->hal) + PERIOD_US + SLACK_US;
    }
    hg_board_say("ready\n");
    return 0U;
}

int main(void)
{
    static app self;
    uint32_t status = begin(&self, 'r');
    int key = 0;
    while ((status == 0U) && (key != 'q')) {
        const uint64_t keys_us = hg_hal_now_us(&self.hal) + KEYS_US;
        (void)hg_hal_wait(&self.hal, (self.deadline_us < keys_us) ? self.deadline_us : keys_us);
        work(&self);
        key = hg_board_key();
        if (key == 'h') {
            say_health(&self);
        } else if ((key == 'r') || (key == 'f') || (key == 't')) {
            status = begin(&self, key);
        } else {
            /* not for us */
        }
    }
    return (int)status;
}
