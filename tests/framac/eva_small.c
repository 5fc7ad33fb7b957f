/* A node with all that a detector may have (small.h): a predicted group, an uncertain plant, a bank, modes of a hull, a freeze frame; its self-test, and the
   other end of its verdict frames. */
#include "small.h"

volatile int any;

static hg_node node;
static hg_freeze frozen;
static hg_hold hold[GROUPS];
static hg_predict predict[1];
static hg_residual residual[1];
static hg_hull hull[1];
static hg_bank bank[1];
static hg_alarm alarm[2];
static hg_link link[GROUPS];
static int32_t code[HG_HOLD_CODES(SIGNALS)];
static int32_t closing[1];
static hg_real real[REALS];
static hg_acc sum[HG_BANK_SUMS(CERTIFICATES)];
static hg_freeze_row row[SAMPLES];
static hg_real recorded[SAMPLES * HG_FREEZE_REALS(WIDTH, 2U)];

static const int32_t rest[SIGNALS] = {0, 1};
static const hg_selftest_config selftest = {.how = HG_START_REST, .samples = 2U, .fault = 1U, .signal = 1U, .spread = 3U, .size = 100, .code = rest};

/* A call that a node with a freeze frame has besides. */
static void call_more(void)
{
    hg_can_frame frame;
    hg_verdict verdict;
    bool reply;
    switch (any) {
    case 0:
        any_frame(&frame);
        (void)hg_verdict_read(&own_message[0], &frame, &verdict, &reply);
        break;
    case 1:
        (void)hg_node_health(&node, (uint8_t)Frama_C_unsigned_int_interval(0U, GROUPS - 1U));
        break;
    default:
        (void)hg_node_freeze(&node, &frame);
        break;
    }
}

int main(void)
{
    const hg_node_memory memory = {
        .detector = {.hold = hold, .predict = predict, .residual = residual, .hull = hull, .bank = bank, .alarm = alarm, .code = code, .codes = LENGTH_OF(code),
                     .real = real, .reals = LENGTH_OF(real), .sum = sum, .sums = LENGTH_OF(sum)},
        .link = link,
        .closing = closing,
        .freeze = &frozen,
        .frozen = {.row = row, .real = recorded},
    };
    if (hg_node_start(&node, &node_config, &memory, any_start()) == HG_OK) {
        while (maybe()) {
            call_node(&node);
            call_more();
        }
        (void)hg_selftest_run(&node, &selftest);
    }
    return 0;
}
