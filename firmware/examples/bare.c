/* A detector node in 40 lines, on any board that can do the three things declared first. Build it with hullguard.c and hullguard.h of `hullguard amalgam platoon`. */
#include "hullguard.h"

bool     board_can_receive(hg_can_frame *frame); /* the oldest frame received, if there is one */
void     board_can_send(const hg_can_frame *frame);
uint32_t board_now_us(void);                     /* may wrap */

#define PERIOD_US ((uint32_t)HG_PLATOON_SAMPLE_TIME_US)

static void report(hg_node *node)
{
    hg_verdict verdict;
    hg_can_frame answer[2];
    while (hg_node_step(node, &verdict) == HG_OK) {
        const uint8_t answers = hg_node_report(node, &verdict, false, answer);
        for (uint8_t i = 0U; i < answers; i++) {
            board_can_send(&answer[i]);
        }
    }
}

int main(void)
{
    static hg_platoon_node self; /* all the memory there is */
    hg_can_frame frame;
    if (hg_platoon_node_start(&self, HG_START_MOVING) != HG_OK) {
        return 1; /* the tables are not of this library */
    }
    uint32_t closed_us = board_now_us(); /* when the last sample was closed */
    for (;;) {
        const uint32_t now_us = board_now_us(); /* before the frames: one that came in time is not late because this took long */
        while (board_can_receive(&frame)) {
            const uint32_t behind = (board_now_us() - closed_us) / PERIOD_US;
            hg_node_expect(&self.node, behind + 1U);
            (void)hg_node_receive(&self.node, &frame); /* whatever it is: refusals are counted */
            closed_us = (self.node.due > 0U) ? board_now_us() : closed_us;
            report(&self.node);
        }
        if ((int32_t)(now_us - closed_us) > (int32_t)(PERIOD_US + (PERIOD_US / 2U))) { /* the closing frame is overdue */
            hg_node_overdue(&self.node);
            closed_us += PERIOD_US;
            report(&self.node);
        }
    }
}
