/* drive_frames <FRAMES: a node of model platoon is fed with frames, "ID DATA" in hexadecimal a line, and prints what it sends the same way, an answer to each sample. */
#ifdef AMALGAM
#include "hullguard.h"
#else
#include "platoon.h"
#endif

#include <inttypes.h>
#include <stdio.h>

static void report(hg_node *node)
{
    hg_verdict verdict;
    hg_can_frame answer[2];
    while (hg_node_step(node, &verdict) == HG_OK) {
        const uint8_t answers = hg_node_report(node, &verdict, true, answer);
        for (uint8_t i = 0U; i < answers; i++) {
            printf("%03" PRIX32 " ", answer[i].id);
            for (uint8_t b = 0U; b < answer[i].length; b++) {
                printf("%02X", (unsigned int)answer[i].data[b]);
            }
            printf("\n");
        }
    }
}

int main(void)
{
    static hg_platoon_node self;
    char line[160];
    if (hg_platoon_node_start(&self, HG_START_REST) != HG_OK) {
        return 1;
    }
    while (fgets(line, (int)sizeof(line), stdin) != NULL) {
        hg_can_frame frame = {.id = 0U, .flags = 0U, .length = 0U};
        int at = 0;
        unsigned int byte = 0U;
        if (sscanf(line, "%" SCNx32 "%n", &frame.id, &at) != 1) {
            return 1;
        }
        for (at += 1; (frame.length < HG_CAN_CLASSIC_MAX) && (sscanf(&line[at], "%2x", &byte) == 1); at += 2) {
            frame.data[frame.length] = (uint8_t)byte;
            frame.length++;
        }
        (void)hg_node_receive(&self.node, &frame);
        report(&self.node);
    }
    return 0;
}
