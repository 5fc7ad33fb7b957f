/* What stands beside a node: senders, their triggers, the send-on-variance trigger, the way from an interrupt to the main loop, ring and observer on their own, a seal. That
   the running sums of a window stay small for ever is a property of sums, not of intervals (tests/proofs/variance.c has it): here they run for SCATTERED samples. */
#include "small.h"

#include "hullguard/guard.h"
#include "hullguard/variance.h"

volatile int any;
volatile hg_real any_real;
static volatile hg_real sink; /* what is read */

#define PLACES 4U
#define SPREAD 3U
#define SCATTERED 8U
#define GUARDED 9U

static void send(void)
{
    static hg_sender sender;
    static int32_t codes[2];
    const hg_sender_config config = {.message = &message[0], .trigger = &trigger[0]};
    hg_can_frame frame;
    (void)hg_sender_start(NULL, &config, codes);
    if (hg_sender_start(&sender, &config, codes) == HG_OK) {
        while (maybe()) {
            const hg_real value[1] = {any_real};
            (void)hg_sender_step(&sender, (uint32_t)any, value, &frame);
        }
    }
}

static void scatter(bool detrended)
{
    static hg_variance variance;
    static int16_t window[SPREAD];
    const hg_variance_config config = {.window = SPREAD, .detrended = detrended, .level = 1000};
    if (hg_variance_start(&variance, &config, window) == HG_OK) {
        for (uint8_t k = 0U; k < SCATTERED; k++) {
            (void)hg_variance_step(&variance, (int16_t)any);
        }
    }
}

static void queue(void)
{
    static hg_inbox inbox;
    static hg_can_frame place[PLACES];
    hg_can_frame frame;
    (void)hg_inbox_start(&inbox, place, (uint8_t)any);
    if (hg_inbox_start(&inbox, place, PLACES) == HG_OK) {
        while (maybe()) {
            inbox.written = (uint8_t)any; /* what the other side has done meanwhile */
            inbox.read = (uint8_t)any;
            if (maybe()) {
                any_frame(&frame);
                (void)hg_inbox_put(&inbox, &frame);
            } else {
                (void)hg_inbox_get(&inbox, &frame);
            }
        }
    }
}

static void remember(void)
{
    static hg_real data[HG_RING_REALS(SIGNALS, HISTORY)];
    hg_ring ring;
    if (hg_ring_start(&ring, SIGNALS, HISTORY, data) == HG_OK) {
        while (maybe()) {
            const hg_real row[SIGNALS] = {any_real, any_real};
            (void)hg_ring_push(&ring, row);
            for (uint8_t lag = 0U; lag <= HISTORY; lag++) {
                hg_ring_rewrite(&ring, lag, 1U, 1U, row);
            }
            for (uint8_t lag = 0U; lag < HISTORY; lag++) {
                sink = hg_ring_row(&ring, lag)[SIGNALS - 1U];
            }
        }
    }
}

static void observe(void)
{
    static hg_real of_observer[HG_RESIDUAL_REALS(1U, 2U)];
    static hg_real of_filter[HG_RESIDUAL_REALS(1U, 1U)];
    static const hg_residual_config filter = {.order = 1U, .residuals = 1U, .width = 1U, .signal = sent_places, .state = {1U, 1U, 0, numbers},
                                              .input = {1U, 1U, 0, numbers}, .output = {1U, 1U, 0, numbers}, .direct = {1U, 1U, 0, numbers}};
    hg_residual_pair pair;
    if ((hg_residual_start(&pair.observer, &residual_config[0], of_observer) == HG_OK) && (hg_residual_start(&pair.filter, &filter, of_filter) == HG_OK)) {
        while (maybe()) {
            const hg_real value[WIDTH] = {any_real, any_real, any_real, any_real};
            hg_real raw[1];
            hg_real r[1];
            (void)hg_residual_pair_step(&pair, value, raw, r);
        }
    }
}

/* Any memory of up to GUARDED bytes; of any length: wp/guard.acsl. */
static void guard(void)
{
    uint8_t memory[GUARDED];
    hg_guard seal;
    Frama_C_make_unknown((char *)memory, sizeof memory);
    for (uint32_t bytes = 1U; bytes <= GUARDED; bytes++) {
        uint8_t *last = &memory[GUARDED - bytes]; /* so that what is read behind it lies outside */
        if (hg_guard_seal(&seal, last, bytes) == HG_OK) {
            (void)hg_guard_check(&seal, last, bytes);
        }
    }
    (void)hg_guard_seal(&seal, memory, 0U);
}

int main(void)
{
    send();
    scatter(true);
    scatter(false);
    queue();
    remember();
    observe();
    guard();
    return 0;
}
