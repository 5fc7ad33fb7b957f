/** @file
 *  A detector node on a board without an operating system: model platoon over hal.h, for ever. Another model is another header and name here;
 *  another board another backend to link with. The node's memory is sealed while the processor waits. detector_node.c is the same with options and reports for
 *  people. */

#include "bare.h"
#include "hullguard/guard.h"
#include "platoon.h"

#define PERIOD_US HG_PLATOON_SAMPLE_TIME_US
#define SLACK_US (PERIOD_US / 2UL) /* how much later than a period after the last one a closing frame may be */
#define AHEAD_MAX 7U               /* samples that a stamp can tell */

typedef struct {
    hg_platoon_node detector;
    hg_guard        guard;
    hg_hal          board;
    uint64_t        deadline_us; /* of the next closing frame; a bus that stays silent from the start is reported, too */
    uint64_t        closing_us;  /* when the last one came */
    uint32_t        closed;      /* samples closed since */
} app;

static void make_steps(app *self)
{
    hg_verdict verdict;
    hg_can_frame frame[2];
    while (hg_node_step(&self->detector.node, &verdict) == HG_OK) {
        const uint8_t frames = hg_node_report(&self->detector.node, &verdict, false, frame);
        for (uint8_t i = 0U; i < frames; i++) {
            (void)hg_hal_send(&self->board, &frame[i]); /* one that finds no room is said again by the heartbeat */
        }
        self->closed += (self->closed < UINT32_MAX) ? 1U : 0U;
    }
}

/* Samples that the sender can be ahead of this node, by the time of arrival; any number beyond AHEAD_MAX is too many. */
static uint32_t samples_behind(const app *self, uint64_t at_us)
{
    const uint64_t elapsed_us = (at_us - self->closing_us) + (PERIOD_US / 2UL);
    const uint32_t elapsed = (elapsed_us > UINT32_MAX) ? UINT32_MAX : ((uint32_t)elapsed_us / PERIOD_US);
    const uint32_t ours = (self->closed < UINT32_MAX) ? (self->closed + 1U) : UINT32_MAX;
    return (elapsed > ours) ? (elapsed - ours) : 0U;
}

static void look_at_clock(app *self, uint64_t at_us)
{
    hg_node *const node = &self->detector.node;
    if ((!node->closed) || (at_us < self->closing_us)) {
        return;
    }
    const uint32_t behind = samples_behind(self, at_us);
    hg_node_expect(node, behind);
    if (behind > AHEAD_MAX) {
        hg_node_outage(node);
    }
}

static void take_frame(app *self, const hg_can_frame *frame, uint64_t at_us)
{
    hg_node *const node = &self->detector.node;
    look_at_clock(self, at_us);
    (void)hg_node_receive(node, frame); /* whatever it is; refusals are counted, and no step is due here */
    if (node->due > 0U) {
        make_steps(self);
        self->closing_us = at_us;
        self->closed = 0U;
        self->deadline_us = at_us + PERIOD_US + SLACK_US;
    }
}

/* `now_us` is from before the frames were taken: what has arrived in time is not overtaken by the timer. */
static void look_at_deadline(app *self, uint64_t now_us)
{
    if (now_us >= self->deadline_us) {
        hg_node_overdue(&self->detector.node);
        make_steps(self);
        self->deadline_us += PERIOD_US;
    }
}

/* Wait with the node's memory sealed; one that is not as it was left is started anew, while the plant goes on. */
static bool waited(app *self)
{
    uint8_t *const memory = (uint8_t *)&self->detector;
    (void)hg_guard_seal(&self->guard, memory, sizeof(self->detector));
    if (hg_hal_wait(&self->board, self->deadline_us) == HG_E_IO) {
        return false;
    }
    return (hg_guard_check(&self->guard, memory, sizeof(self->detector)) == HG_OK) || (hg_platoon_node_start(&self->detector, HG_START_MOVING) == HG_OK);
}

int main(void)
{
    static app self;
    hg_can_frame frame;
    uint64_t at_us;
    if ((hg_board_start(&self.board) != HG_OK) || (hg_platoon_selftest(&self.detector) != HG_OK) || (hg_platoon_node_start(&self.detector, HG_START_MOVING) != HG_OK)) {
        return 1;
    }
    self.deadline_us = hg_hal_now_us(&self.board) + PERIOD_US + SLACK_US;
    while (waited(&self)) {
        const uint64_t now_us = hg_hal_now_us(&self.board);
        while (hg_hal_receive(&self.board, &frame, &at_us) == HG_OK) {
            take_frame(&self, &frame, at_us);
        }
        look_at_deadline(&self, now_us);
    }
    return 0;
}
