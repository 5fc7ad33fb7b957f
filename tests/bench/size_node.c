/** @file
 *  A program with a model's whole detector node: frames in by an inbox, verdict frames out. Linked and measured, never run. */

#include "size_port.h"

#define INBOX 8U /* frames */

static record_node storage;
static hg_inbox inbox;
static hg_can_frame queue[INBOX];

/* A controller's interrupt. */
static void interrupt(void)
{
    hg_can_frame frame;
    while (port_take(&frame, sizeof(frame))) {
        (void)hg_inbox_put(&inbox, &frame);
    }
}

static void make_steps(hg_node *node)
{
    hg_verdict verdict;
    hg_can_frame frame[2];
    while (hg_node_step(node, &verdict) == HG_OK) {
        const uint8_t frames = hg_node_report(node, &verdict, false, frame);
        port_give(frame, frames * sizeof(frame[0]));
    }
}

int main(void)
{
    hg_node *const node = &storage.node;
    hg_can_frame frame;
    uint8_t behind;
    if ((record_node_start(&storage, HG_START_MOVING) != HG_OK) || (hg_inbox_start(&inbox, queue, INBOX) != HG_OK)) {
        return 1;
    }
    while (port_take(&behind, sizeof(behind))) {
        interrupt();
        hg_node_expect(node, behind);
        while (hg_inbox_get(&inbox, &frame) == HG_OK) {
            (void)hg_node_receive(node, &frame);
            make_steps(node);
        }
        if (behind > 7U) {
            hg_node_outage(node);
        } else {
            hg_node_overdue(node);
        }
        make_steps(node);
    }
    return 0;
}
