/** @file
 *  A program with one node's copy of a fusion filter: frames in, verdicts and estimates out. Linked and measured, never run. */

#include "size_port.h"

static size_storage storage;

static void make_steps(hg_tracker *tracker)
{
    hg_verdict verdict;
    hg_can_frame frame[2];
    while (hg_tracker_step(tracker, &verdict) == HG_OK) {
        const uint8_t frames = hg_tracker_report(tracker, &verdict, false, frame);
        port_give(frame, frames * sizeof(frame[0]));
        for (uint8_t j = 0U; j < tracker->config->fusion->states; j++) {
            if (hg_tracker_estimate(tracker, j, frame) == HG_OK) {
                port_give(frame, sizeof(frame[0]));
            }
        }
    }
}

int main(void)
{
    hg_tracker *const tracker = &storage.tracker;
    hg_can_frame frame;
    uint8_t behind;
    if (size_start(&storage, HG_START_MOVING) != HG_OK) {
        return 1;
    }
    while (port_take(&behind, sizeof(behind))) {
        hg_tracker_expect(tracker, behind);
        while (port_take(&frame, sizeof(frame))) {
            (void)hg_tracker_receive(tracker, &frame);
            make_steps(tracker);
        }
        if (behind > 7U) {
            hg_tracker_outage(tracker);
        } else {
            hg_tracker_overdue(tracker);
        }
        make_steps(tracker);
    }
    return 0;
}
