/** @file
 *  A detector ECU without operating system: the platoon model's node (hullguard/node.h) on a board's CAN controller (hal/board/board.h), in
 *  lockstep: every closing frame is answered with a verdict, and the clock only bounds how long a frame is offered to a full controller.
 *
 *  Prints `ready` when it listens. One character on the console asks for more: `h` prints every counter of every group and `end`,
 *  `r` begins anew with empty counters and prints `ready`, `q` ends. */
#include "board.h"
#include "platoon.h"

#define KEYS_US 5000U      /* how often the console is looked at while the bus is silent */
#define OFFER_MAX_US 50000U /* longest time one frame is offered to a controller that has no room: the heartbeat says it again */
#define EXIT_BUS 3U
#define EXIT_FAILED 1U

typedef struct {
    hg_hal        hal;
    hg_hal_filter filter[HG_PLATOON_GROUPS];
    uint32_t      steps;
    uint32_t      unsent;  /* frames that found no room or no bus */
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
        const uint8_t frames = hg_node_report(&storage.node, &verdict, storage.node.due == 0U, frame);
        for (uint8_t i = 0U; i < frames; i++) {
            send_frame(self, &frame[i]);
        }
        hg_hal_count(&self->steps, 1U);
    }
}

/* All that has arrived; a bus that never falls silent keeps the console waiting, not the node. */
static void take_frames(app *self)
{
    hg_can_frame frame;
    while (hg_hal_receive(&self->hal, &frame, NULL) == HG_OK) {
        (void)hg_node_receive(&storage.node, &frame); /* whatever it is: refusals are counted; no steps are due here */
        make_steps(self);
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
    say_counter("can.received", " ", report.received);
    say_counter("can.sent", " ", report.sent);
    say_counter("can.lost", " ", report.lost);
    say_counter("can.refused", " ", report.refused);
    say_counter("can.errors", " ", report.errors);
    say_counter("can.malformed", " ", report.malformed);
    say_counter("can.bus", " ", (uint32_t)report.bus);
    hg_board_say("end\n");
}

/* Only the groups' frames are of interest. */
static uint32_t begin(app *self)
{
    for (uint8_t i = 0U; i < HG_PLATOON_GROUPS; i++) {
        const hg_message *const message = &hg_platoon_config.message[i];
        self->filter[i] = (hg_hal_filter){.id = message->id, .mask = HG_CAN_ID_EXTENDED, .flags = message->flags & HG_CAN_EXTENDED};
    }
    self->steps = 0U;
    self->unsent = 0U;
    if (hg_board_can(0U, self->filter, HG_PLATOON_GROUPS, &self->hal) != HG_OK) {
        hg_board_say("no CAN controller\n");
        return EXIT_BUS;
    }
    if (hg_platoon_node_start(&storage, HG_START_REST) != HG_OK) {
        hg_board_say("model does not start: generate its tables again\n");
        return EXIT_FAILED;
    }
    hg_board_say("ready\n");
    return 0U;
}

int main(void)
{
    static app self;
    uint32_t status = begin(&self);
    int key = 0;
    while ((status == 0U) && (key != 'q')) {
        (void)hg_hal_wait(&self.hal, hg_hal_now_us(&self.hal) + KEYS_US);
        take_frames(&self);
        key = hg_board_key();
        if (key == 'h') {
            say_health(&self);
        } else if (key == 'r') {
            status = begin(&self);
        } else {
            /* not for us */
        }
    }
    return (int)status;
}
