/* flips OPERATIONS MASK FIRST LAST STRIDE BOUND: every bit of a node's memory that MASK names, flipped once between any two of its calls FIRST .. LAST,
 * every STRIDEth, of a recorded run; the run goes on to its end and is compared with the one that was not disturbed. flips.py makes the files and reads the counts.
 *
 *      harmless   every verdict and every answer is the same
 *      detected   something else than the plant shows it: bus health, refused, STARTING, another sample, another answer of a call
 *      recovered  nothing shows it, and the verdicts are the same again at most BOUND samples later
 *      lasting    nothing shows it, and they are not: an alarm suppressed, a false one, or other candidates
 *
 * Then the same with the memory sealed between two calls (guard.h), and whatever MASK says: how many flips were made, of memory and seal, and how many of them
 * the guard did not find; and from every call on, started anew: after how many samples at most the verdicts are the usual ones, and false alarms. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include FLIPS_HEADER

#include "hullguard/guard.h"

#define OPERATIONS_MAX 2048U

typedef struct {
    uint8_t  kind; /* F a frame, O overdue, S the steps that are due */
    uint8_t  flags;
    uint8_t  length;
    uint8_t  sample; /* from the run's begin */
    uint32_t id;
    uint8_t  data[HG_CAN_DATA_MAX];
} operation;

typedef struct {        /* what an operation answers */
    int32_t    status;  /* of a frame; steps made */
    hg_verdict verdict; /* of the last step */
} answer;

enum { HARMLESS, DETECTED, RECOVERED, FALSE_ALARM, SUPPRESSED, OTHER, KINDS };

static FLIPS_STORAGE storage;
static operation     run[OPERATIONS_MAX];
static answer        usual[OPERATIONS_MAX];
static FLIPS_STORAGE before[OPERATIONS_MAX]; /* the memory before each operation */
static uint8_t       mask[sizeof(FLIPS_STORAGE)];
static uint32_t      counts[sizeof(FLIPS_STORAGE)][KINDS];
static size_t        length;

static answer perform(const operation *op)
{
    answer found = {.status = 0, .verdict = {.k = 0U}};
    if (op->kind == (uint8_t)'F') {
        hg_can_frame frame = {.id = op->id, .flags = op->flags, .length = op->length};
        (void)memcpy(frame.data, op->data, sizeof(frame.data));
        found.status = (int32_t)hg_node_receive(&storage.node, &frame);
    } else if (op->kind == (uint8_t)'O') {
        hg_node_overdue(&storage.node);
    } else {
        while (hg_node_step(&storage.node, &found.verdict) == HG_OK) {
            hg_can_frame out[2];
            found.status++;
            (void)hg_node_report(&storage.node, &found.verdict, false, out);
        }
    }
    return found;
}

static bool alarm(const answer *a)
{
    return a->verdict.plant == HG_PLANT_CONFIRMED;
}

static bool shows(const answer *a, const answer *b)
{
    const bool starting = (a->verdict.plant == HG_PLANT_STARTING) != (b->verdict.plant == HG_PLANT_STARTING);
    return (a->status != b->status) || (a->verdict.bus != b->verdict.bus) || (a->verdict.refused != b->verdict.refused) || (a->verdict.k != b->verdict.k) || starting;
}

/* The run from operation `from` on, its memory as it stands. */
static unsigned judge(size_t from, unsigned bound)
{
    bool shown = false;
    bool false_alarm = false;
    bool suppressed = false;
    unsigned last = 0U;
    bool differs = false;
    for (size_t i = from; i < length; i++) {
        const answer now = perform(&run[i]);
        shown = shown || shows(&now, &usual[i]);
        if ((now.verdict.plant != usual[i].verdict.plant) || (now.verdict.candidates != usual[i].verdict.candidates)) {
            differs = true;
            last = (unsigned)run[i].sample - run[from].sample;
            false_alarm = false_alarm || (alarm(&now) && (!alarm(&usual[i])));
            suppressed = suppressed || ((!alarm(&now)) && alarm(&usual[i]));
        }
        if (((i + 1U) < length) && (memcmp(&storage, &before[i + 1U], sizeof(storage)) == 0)) {
            break; /* the same from here on */
        }
    }
    unsigned kind = HARMLESS;
    if (shown) {
        kind = DETECTED;
    } else if (!differs) {
        kind = HARMLESS;
    } else if (last <= bound) {
        kind = RECOVERED;
    } else if (suppressed) {
        kind = SUPPRESSED;
    } else {
        kind = false_alarm ? FALSE_ALARM : OTHER;
    }
    return kind;
}

static bool found(const hg_guard *guard)
{
    return hg_guard_check(guard, (const uint8_t *)&storage, sizeof(storage)) == HG_E_DIGEST;
}

static void guarded(size_t from, unsigned long *flips, unsigned long *missed)
{
    hg_guard guard;
    storage = before[from];
    if (hg_guard_seal(&guard, (const uint8_t *)&storage, sizeof(storage)) != HG_OK) {
        exit(3);
    }
    for (size_t place = 0U; place < (sizeof(storage) + sizeof(guard)); place++) {
        uint8_t *const byte = (place < sizeof(storage)) ? ((uint8_t *)&storage + place) : ((uint8_t *)&guard + (place - sizeof(storage)));
        for (unsigned bit = 0U; bit < 8U; bit++) {
            *byte ^= (uint8_t)(1U << bit);
            (*flips)++;
            *missed += found(&guard) ? 0U : 1U;
            *byte ^= (uint8_t)(1U << bit);
        }
    }
    *missed += found(&guard) ? 1U : 0U; /* of the memory as it was */
}

/* A new start before operation `from`, while the plant moves: samples until the plant's verdict is the usual one for good. */
static unsigned restarted(size_t from, unsigned long *false_alarms)
{
    unsigned last = 0U;
    if (FLIPS_START(&storage, HG_START_MOVING) != HG_OK) {
        exit(3);
    }
    for (size_t i = from; i < length; i++) {
        const answer now = perform(&run[i]);
        *false_alarms += (alarm(&now) && (!alarm(&usual[i]))) ? 1U : 0U;
        last = (now.verdict.plant != usual[i].verdict.plant) ? ((unsigned)run[i].sample - run[from].sample + 1U) : last;
    }
    return last;
}

static void record(void)
{
    (void)memset(&storage, 0, sizeof(storage));
    if (FLIPS_START(&storage, HG_START_REST) != HG_OK) {
        exit(3);
    }
    for (size_t i = 0U; i < length; i++) {
        before[i] = storage;
        usual[i] = perform(&run[i]);
    }
}

static void read_file(const char *name, void *to, size_t unit, size_t most, size_t *count)
{
    FILE *file = fopen(name, "rb");
    if (file == NULL) {
        perror(name);
        exit(2);
    }
    *count = fread(to, unit, most, file);
    (void)fclose(file);
}

int main(int argc, char **argv)
{
    size_t bytes = 0U;
    if (argc != 7) {
        return 2;
    }
    read_file(argv[1], run, sizeof(run[0]), OPERATIONS_MAX, &length);
    read_file(argv[2], mask, 1U, sizeof(mask), &bytes);
    const size_t first = strtoul(argv[3], NULL, 10);
    const size_t last = strtoul(argv[4], NULL, 10);
    const size_t stride = strtoul(argv[5], NULL, 10);
    const unsigned bound = (unsigned)strtoul(argv[6], NULL, 10);
    if (bytes != sizeof(FLIPS_STORAGE)) {
        (void)fprintf(stderr, "flips: the memory has %zu bytes, the mask %zu\n", sizeof(FLIPS_STORAGE), bytes);
        return 2;
    }
    record();
    for (size_t i = first; (i <= last) && (i < length); i += stride) {
        for (size_t place = 0U; place < sizeof(storage); place++) {
            for (unsigned bit = 0U; (mask[place] != 0U) && (bit < 8U); bit++) {
                storage = before[i];
                ((uint8_t *)&storage)[place] ^= (uint8_t)(1U << bit);
                counts[place][judge(i, bound)]++;
            }
        }
    }
    unsigned long flips = 0U;
    unsigned long missed = 0U;
    unsigned long false_alarms = 0U;
    unsigned      longest = 0U;
    for (size_t i = first; (i <= last) && (i < length); i += stride) {
        guarded(i, &flips, &missed);
        const unsigned samples = restarted(i, &false_alarms);
        longest = (samples > longest) ? samples : longest;
    }
    (void)printf("guard %lu %lu %u %lu\n", flips, missed, longest, false_alarms);
    for (size_t place = 0U; place < sizeof(storage); place++) {
        if (mask[place] != 0U) {
            (void)printf("%zu %u %u %u %u %u %u\n", place, counts[place][HARMLESS], counts[place][DETECTED], counts[place][RECOVERED], counts[place][FALSE_ALARM],
                         counts[place][SUPPRESSED], counts[place][OTHER]);
        }
    }
    return 0;
}
