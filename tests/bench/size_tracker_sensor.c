/** @file
 *  A program with a sensor of a fusion filter: its own copy of the filter, which hears all others, and what it sends. Linked and measured, never run. */

#include "size_port.h"

static size_storage storage;
static hg_fusion_sender sender;

static void take(const hg_can_frame *frame)
{
    hg_verdict verdict;
    (void)hg_tracker_receive(&storage.tracker, frame);
    while (hg_tracker_step(&storage.tracker, &verdict) == HG_OK) {
        port_give(&verdict, sizeof(verdict));
    }
}

int main(void)
{
    hg_can_frame frame;
    hg_real y;
    if ((size_start(&storage, HG_START_MOVING) != HG_OK) || (hg_fusion_sender_start(&sender, &storage.tracker, 0U) != HG_OK)) {
        return 1;
    }
    while (port_take(&y, sizeof(y))) {
        if (hg_fusion_sender_step(&sender, y, HG_REAL_ZERO, false, &frame) == HG_OK) {
            port_give(&frame, sizeof(frame));
            take(&frame);
        }
        while (port_take(&frame, sizeof(frame))) {
            take(&frame);
        }
    }
    return 0;
}
