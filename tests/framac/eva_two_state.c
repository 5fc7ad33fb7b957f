/* A polynomial filter as the judge. */
#include "drive.h"
#include "two_state.h"

volatile int any;

static hg_node node;
static hg_hold hold[HG_TWO_STATE_GROUPS];
static hg_statistic polynomial[LENGTH(hg_two_state_node, polynomial)];
static hg_alarm alarm[LENGTH(hg_two_state_node, alarm)];
static hg_link link[HG_TWO_STATE_GROUPS];
static int32_t code[LENGTH(hg_two_state_node, code)];
static int32_t closing[LENGTH(hg_two_state_node, closing)];
static hg_real real[LENGTH(hg_two_state_node, real)];

int main(void)
{
    const hg_node_memory memory = {
        .detector = {.hold = hold, .polynomial = polynomial, .alarm = alarm, .code = code, .codes = LENGTH(hg_two_state_node, code),
                     .real = real, .reals = LENGTH(hg_two_state_node, real)},
        .link = link,
        .closing = closing,
    };
    if (hg_node_start(&node, &hg_two_state_config, &memory, any_start()) == HG_OK) {
        while (maybe()) {
            call_node(&node);
        }
    }
    return 0;
}
