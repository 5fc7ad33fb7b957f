/** @file
 *  A program with one sender of a model, its first: trigger and frame. Linked and measured, never run. The tables of the others are linked too. */

#include "size_port.h"

static hg_sender sender;
static int32_t codes[2U * RECORD_WIDTH];

int main(void)
{
    hg_real value[RECORD_WIDTH];
    hg_can_frame frame;
    uint32_t k = 0U;
    if (hg_sender_start(&sender, &record_sender[0], codes) != HG_OK) {
        return 1;
    }
    while (port_take(value, sizeof(value))) {
        if (hg_sender_step(&sender, k, value, &frame) == HG_OK) {
            port_give(&frame, sizeof(frame));
        }
        k++;
    }
    return 0;
}
