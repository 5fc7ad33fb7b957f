/** @file
 *  A model's senders and its detector node over a recorded drive, for counting: readings by record.py, included before this file. The bus loses
 *  every LOST_EVERYth measurement frame, which the receiver finds out later and rewinds, and the closing frame of sample OVERDUE_AT.
 *  Prints what happened; the exit status is 1 for an alarm before the fault, or none after it. No C library is needed. */

#include "console.h"

#define LOST_EVERY 11U
#define OVERDUE_AT 300U

static record_node node;
static record_senders senders;

static void print(const char *name, uint32_t number)
{
    char text[10];
    size_t digits = 0U;
    size_t length = 0U;
    uint32_t rest = number;
    do {
        digits++;
        text[sizeof(text) - digits] = (char)('0' + (rest % 10U));
        rest /= 10U;
    } while (rest > 0U);
    while (name[length] != '\0') {
        length++;
    }
    console_write(name, length);
    console_write(&text[sizeof(text) - digits], digits);
}

typedef struct {
    uint32_t frames;      /* sent */
    uint32_t event;       /* of them, those of event-triggered groups */
    uint32_t lost;
    uint32_t steps;
    uint32_t first_alarm; /* its sample */
} drive;

static void make_steps(drive *d)
{
    hg_verdict verdict;
    while (hg_node_step(&node.node, &verdict) == HG_OK) {
        hg_can_frame out[2];
        (void)hg_node_report(&node.node, &verdict, false, out);
        if ((verdict.plant == HG_PLANT_CONFIRMED) && (d->first_alarm == UINT32_MAX)) {
            d->first_alarm = verdict.k;
        }
        d->steps++;
    }
}

/* Every group's reading of the sample; frames arrive in the order of the groups, the closing one last. */
static void speak(drive *d, uint32_t k)
{
    const hg_node_config *const config = &record_config;
    const int32_t *code = &record_code[k * RECORD_SIGNALS];
    hg_real value[RECORD_SIGNALS];
    hg_can_frame frame;
    hg_can_frame closing = {.id = 0U};
    bool closes = false;
    for (uint8_t g = 0U; g < config->detector->groups; g++) {
        const hg_message *const message = &config->message[g];
        for (uint8_t i = 0U; i < message->width; i++) {
            value[i] = hg_code_value(&message->scale[i], code[i]);
        }
        code = &code[message->width];
        if (hg_sender_step(&senders.sender[g], k, value, &frame) != HG_OK) {
            continue;
        }
        d->frames++;
        if (g == config->closing) {
            closing = frame;
            closes = k != OVERDUE_AT;
            continue;
        }
        d->event++;
        if ((d->event % LOST_EVERY) == 0U) {
            d->lost++;
        } else {
            (void)hg_node_receive(&node.node, &frame);
        }
    }
    if (closes) {
        (void)hg_node_receive(&node.node, &closing);
    } else {
        d->lost++;
        hg_node_overdue(&node.node);
    }
    make_steps(d);
}

int main(void)
{
    drive d = {.first_alarm = UINT32_MAX};
    if ((record_node_start(&node, HG_START_MOVING) != HG_OK) || (record_senders_start(&senders) != HG_OK)) {
        return 1;
    }
    for (uint32_t k = 0U; k < RECORD_SAMPLES; k++) {
        speak(&d, k);
    }
    print(RECORD_NAME ": steps ", d.steps);
    print(", frames ", d.frames);
    print(", of events ", d.event);
    print(", lost ", d.lost);
    print(", fault at ", RECORD_FAULT_AT);
    print(", found at ", d.first_alarm);
    console_write("\n", 1U);
    return ((d.first_alarm >= RECORD_FAULT_AT) && (d.first_alarm < RECORD_SAMPLES)) ? 0 : 1;
}
