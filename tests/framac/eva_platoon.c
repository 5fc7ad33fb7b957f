/* The platoon: an observer and a hull. */
#include "drive.h"
#include "platoon.h"

volatile int any;

static hg_platoon_node ecu; /* as an application has it: started, and no more */
static hg_node node;
static hg_hold hold[HG_PLATOON_GROUPS];
static hg_residual residual[LENGTH(hg_platoon_node, residual)];
static hg_hull hull[LENGTH(hg_platoon_node, hull)];
static hg_alarm alarm[LENGTH(hg_platoon_node, alarm)];
static hg_link link[HG_PLATOON_GROUPS];
static int32_t code[LENGTH(hg_platoon_node, code)];
static int32_t closing[LENGTH(hg_platoon_node, closing)];
static hg_real real[LENGTH(hg_platoon_node, real)];

int main(void)
{
    const hg_node_memory memory = {
        .detector = {.hold = hold, .residual = residual, .hull = hull, .alarm = alarm, .code = code, .codes = LENGTH(hg_platoon_node, code),
                     .real = real, .reals = LENGTH(hg_platoon_node, real)},
        .link = link,
        .closing = closing,
    };
    (void)hg_platoon_node_start(&ecu, any_start());
    if (hg_node_start(&node, &hg_platoon_config, &memory, any_start()) == HG_OK) {
        while (maybe()) {
            call_node(&node);
        }
    }
    return 0;
}
