/** @file
 *  The nodes of the shipped models over a fixed drive: random walks, standstill, a link that loses, damages, doubles and delays frames, a clock
 *  that closes samples, outages. A hash is printed over every verdict, every report and the bits of every value, radius, r and J. float32
 *  arithmetic is exact to the bit by IEEE 754 wherever no product is fused into a sum and no subnormal number is flushed to zero, and fixed point
 *  is integers, so that every processor must print the same. To have subnormal numbers, and in fixed point such as do not fit, the residual
 *  generators run once more on signals of such a size. Before each drive the model's self-test (selftest.h), whose outcome was computed on the host, and
 *  the digest of its tables (digest.h), taken in parts. Then the fusion filter (corpus_fusion.c)
 *  and the polynomial filter (corpus_polynomial.c). No C library is needed. */

#include "console.h"
#include "openacc.h"
#include "platoon.h"
#include "platoon_bank.h"

#include <string.h>

#if !HG_REAL_Q31
#include "corpus_fusion.h" /* in float only */
#include "corpus_polynomial.h"
#endif

#define SAMPLES 4096UL
#define POLYNOMIAL_SAMPLES 128UL
#define PART 1024UL   /* samples between two lines: they tell where two processors part */
#define WALK 256UL    /* samples of random walk, then as many of standstill */
#define GROUPS 8U
#define SIGNALS 32U
#define NUMBERS 100UL /* of the tables at a time */
#define FNV_BASIS 0xCBF29CE484222325ULL
#define FNV_PRIME 0x100000001B3ULL

/* A signal as large as a number can be; or, of at most 30000 codes, subnormal as what is computed from it. */
#if HG_REAL_Q31
#define EXTREME(code) (((code) < 0) ? -HG_REAL_MAX : HG_REAL_MAX)
#define EXTREMES " refused "
#else
#define EXTREME(code) ((hg_real)(code) * 0x1p-144F)
#define EXTREMES " subnormal "
#define SMALLEST_NORMAL 0x00800000UL
#endif

typedef struct {
    const char             *name;
    const hg_node_config   *config;
    const hg_sender_config *sender;
    bool                  (*start)(hg_node **node, hg_sender **sender);
    hg_status             (*selftest)(void);
    hg_status             (*check)(hg_digest *walk, uint32_t numbers);
} subject;

typedef struct {
    const subject *subject;
    hg_node       *node;
    hg_sender     *sender;           /* [groups] */
    int32_t        code[SIGNALS];    /* the plant: one walk a signal */
    hg_can_frame   late;             /* one frame that was delayed */
    bool           delayed;
    uint32_t       random;
    uint64_t       hash;
    uint32_t       steps;
    uint32_t       alarms;
    uint32_t       extremes;         /* numbers hashed that are subnormal; in fixed point steps refused for what did not fit */
} drive;

/* One at a time: a processor with 16 KB of RAM runs this. */
static union {
    hg_platoon_node      platoon;
    hg_platoon_bank_node platoon_bank;
    hg_openacc_node      openacc;
} node_memory;
static union {
    hg_platoon_senders      platoon;
    hg_platoon_bank_senders platoon_bank;
    hg_openacc_senders      openacc;
} sender_memory;

#define START(model)                                                                                             \
    static bool model##_start(hg_node **node, hg_sender **sender)                                                \
    {                                                                                                            \
        *node = &node_memory.model.node;                                                                         \
        *sender = sender_memory.model.sender;                                                                    \
        return (hg_##model##_node_start(&node_memory.model, HG_START_MOVING) == HG_OK) &&                        \
               (hg_##model##_senders_start(&sender_memory.model) == HG_OK);                                      \
    }                                                                                                            \
    static hg_status model##_selftest(void)                                                                      \
    {                                                                                                            \
        return hg_##model##_selftest(&node_memory.model);                                                        \
    }
START(platoon)
START(platoon_bank)
START(openacc)

static const subject subjects[] = {
    {"platoon", &hg_platoon_config, hg_platoon_sender, platoon_start, platoon_selftest, hg_platoon_check},
    {"platoon_bank", &hg_platoon_bank_config, hg_platoon_bank_sender, platoon_bank_start, platoon_bank_selftest, hg_platoon_bank_check},
    {"openacc", &hg_openacc_config, hg_openacc_sender, openacc_start, openacc_selftest, hg_openacc_check}};

/* ---- what is printed ---- */

static void print(const char *text)
{
    size_t length = 0U;
    while (text[length] != '\0') {
        length++;
    }
    console_write(text, length);
}

static void print_hex(const char *before, uint64_t value, unsigned digits)
{
    char text[16];
    for (unsigned i = 0U; i < digits; i++) {
        text[i] = "0123456789abcdef"[(value >> (4U * (digits - 1U - i))) & 15U];
    }
    print(before);
    console_write(text, digits);
}

/* ---- the hash: FNV-1a, numbers from their lowest byte on whatever the processor's order is ---- */

static void take(drive *d, uint32_t number)
{
    for (unsigned shift = 0U; shift < 32U; shift += 8U) {
        d->hash = (d->hash ^ ((number >> shift) & 0xFFU)) * FNV_PRIME;
    }
}

static void take_reals(drive *d, const hg_real *x, size_t n)
{
    for (size_t i = 0U; i < n; i++) {
        uint32_t bits;
        (void)memcpy(&bits, &x[i], sizeof(bits));
#if !HG_REAL_Q31
        const uint32_t magnitude = bits & 0x7FFFFFFFUL;
        d->extremes += ((magnitude > 0U) && (magnitude < SMALLEST_NORMAL)) ? 1U : 0U;
#endif
        take(d, bits);
    }
}

static void take_frame(drive *d, const hg_can_frame *frame)
{
    take(d, frame->id);
    take(d, frame->length);
    for (uint8_t i = 0U; i < frame->length; i++) {
        take(d, frame->data[i]);
    }
}

static void take_verdict(drive *d, const hg_verdict *verdict)
{
    take(d, verdict->k);
    take(d, verdict->candidates);
    take(d, (uint32_t)verdict->plant);
    take(d, (uint32_t)verdict->basis);
    take(d, verdict->bus);
    take(d, verdict->refused ? 1U : 0U);
}

static void take_detector(drive *d)
{
    const hg_detector *detector = &d->node->detector;
    const hg_detector_config *config = detector->config;
    take_reals(d, detector->value, config->width);
    take_reals(d, detector->radius, config->width);
    take_reals(d, detector->r, config->residuals);
    take_reals(d, detector->J, config->residuals);
}

/* ---- the drive ---- */

static uint32_t draw(drive *d)
{
    d->random ^= d->random << 13U;
    d->random ^= d->random >> 17U;
    d->random ^= d->random << 5U;
    return d->random;
}

static bool one_in(drive *d, uint32_t n)
{
    return (draw(d) % n) == 0U;
}

static void make_steps(drive *d)
{
    hg_verdict verdict;
    hg_can_frame frame[2];
    while (hg_node_step(d->node, &verdict) == HG_OK) {
        const uint8_t frames = hg_node_report(d->node, &verdict, false, frame);
        for (uint8_t i = 0U; i < frames; i++) {
            take_frame(d, &frame[i]);
        }
        take_verdict(d, &verdict);
        take_detector(d);
        d->steps++;
        d->alarms += (verdict.plant == HG_PLANT_CONFIRMED) ? 1U : 0U;
    }
}

static void give(drive *d, const hg_can_frame *frame)
{
    take(d, (uint32_t)hg_node_receive(d->node, frame));
    make_steps(d);
}

/* A link on which nothing is certain. */
static void send(drive *d, hg_can_frame *frame)
{
    if (d->delayed) {
        d->delayed = false;
        give(d, &d->late);
    }
    if (one_in(d, 64U)) {
        frame->data[draw(d) % frame->length] ^= (uint8_t)(1U << (draw(d) % 8U));
    }
    if (one_in(d, 64U)) {
        d->late = *frame;
        d->delayed = true;
    } else if (!one_in(d, 16U)) {
        give(d, frame);
        if (one_in(d, 64U)) {
            give(d, frame);
        }
    } else {
        /* lost */
    }
}

/* The plant at sample k: every signal walks for a while, then stands at what is nearest to 0, for the tables know no other rest. */
static void move(drive *d, uint32_t k)
{
    const bool walks = ((k / WALK) % 2U) == 0U;
    size_t signal = 0U;
    for (uint8_t g = 0U; g < d->subject->config->detector->groups; g++) {
        const hg_message *message = &d->subject->config->message[g];
        for (uint8_t i = 0U; i < message->width; i++) {
            const hg_code_scale *scale = &message->scale[i];
            const int32_t reach = (scale->maximum / 256) - (scale->minimum / 256);
            const int32_t step = (int32_t)(draw(d) % (uint32_t)((2 * reach) + 1)) - reach;
            const int32_t next = walks ? (d->code[signal] + step) : d->subject->sender[g].trigger->zero[i];
            d->code[signal] = ((next < scale->minimum) || (next > scale->maximum)) ? d->code[signal] : next;
            signal++;
        }
    }
}

/* All groups speak, the closing one last, as its identifier makes it on a bus. */
static void speak(drive *d, uint32_t k)
{
    hg_real value[SIGNALS];
    hg_can_frame frame[GROUPS];
    bool spoken[GROUPS];
    const hg_node_config *config = d->subject->config;
    size_t signal = 0U;
    for (uint8_t g = 0U; g < config->detector->groups; g++) {
        for (uint8_t i = 0U; i < config->message[g].width; i++) {
            value[i] = hg_code_value(&config->message[g].scale[i], d->code[signal]);
            signal++;
        }
        spoken[g] = hg_sender_step(&d->sender[g], k, value, &frame[g]) == HG_OK;
    }
    for (uint8_t g = 0U; g < config->detector->groups; g++) {
        if (spoken[g] && (g != config->closing)) {
            send(d, &frame[g]);
        }
    }
    if (spoken[config->closing]) {
        send(d, &frame[config->closing]);
    }
}

static void print_state(const drive *d, uint32_t samples)
{
    print(d->subject->name);
    print_hex(" samples ", samples, 4U);
    print_hex(" steps ", d->steps, 4U);
    print_hex(" alarms ", d->alarms, 4U);
    print_hex(EXTREMES, d->extremes, 4U);
    print_hex(" hash ", d->hash, 16U);
    print("\n");
}

/* No signal of a bus is of such a size. Uses the node's residual generators, whose states nobody needs any more. */
static void run_extremes(drive *d)
{
    hg_detector *const detector = &d->node->detector;
    hg_real value[SIGNALS] = {HG_REAL_ZERO};
    for (uint8_t i = 0U; i < detector->config->generators; i++) {
        hg_residual *const residual = &detector->memory.residual[i];
        hg_residual_reset(residual);
        for (uint32_t k = 0U; k < WALK; k++) {
            move(d, k);
            for (size_t j = 0U; j < SIGNALS; j++) {
                value[j] = EXTREME(d->code[j]);
            }
            const hg_status status = hg_residual_step(residual, value, detector->r);
            d->extremes += (status == HG_E_NUMERIC) ? 1U : 0U;
            take(d, (uint32_t)status);
            take_reals(d, detector->r, residual->config->residuals);
            take_reals(d, residual->z, residual->config->order);
        }
    }
}

/* What the model says of itself, and whether it holds here. */
static bool tested(const subject *of)
{
    hg_digest walk;
    hg_digest_start(&walk);
    hg_status status = of->check(&walk, NUMBERS);
    while (status == HG_E_BUSY) {
        status = of->check(&walk, NUMBERS);
    }
    const hg_status passed = of->selftest();
    print(of->name);
    print_hex(" digest ", walk.crc, 8U);
    print((status == HG_OK) ? " good" : " wrong");
    print((passed == HG_OK) ? " self-test passed\n" : " self-test failed\n");
    return (status == HG_OK) && (passed == HG_OK);
}

static bool run(const subject *of)
{
    drive d = {.subject = of, .random = 0x2545F491UL, .hash = FNV_BASIS};
    if ((of->config->detector->width > SIGNALS) || (of->config->detector->groups > GROUPS) || (!of->start(&d.node, &d.sender))) {
        return false;
    }
    for (uint32_t k = 0U; k < SAMPLES; k++) {
        const uint32_t steps = d.steps;
        move(&d, k);
        if ((k % 512U) < 504U) { /* else the senders stop for 8 samples */
            speak(&d, k);
        }
        if (d.steps == steps) { /* the application's clock */
            hg_node_overdue(d.node);
            make_steps(&d);
        }
        if ((k % PART) == (PART / 4U)) {
            hg_node_outage(d.node);
        }
        if (((k + 1U) % PART) == 0U) {
            print_state(&d, k + 1U);
        }
    }
    run_extremes(&d);
    print_state(&d, SAMPLES);
    return d.extremes > 0U;
}

int main(void)
{
    bool good = true;
    for (size_t i = 0U; i < (sizeof(subjects) / sizeof(subjects[0])); i++) {
        const bool passes = tested(&subjects[i]); /* the drive says how other bits show, so it is run all the same */
        good = run(&subjects[i]) && passes && good;
    }
#if !HG_REAL_Q31
    const uint64_t fusion = corpus_fusion(SAMPLES);
    const uint64_t polynomial = corpus_polynomial(POLYNOMIAL_SAMPLES);
    good = good && (fusion != 0U) && (polynomial != 0U);
    print_hex("fusion ", fusion, 16U);
    print_hex(" polynomial ", polynomial, 16U);
    print("\n");
#endif
    print(good ? "corpus ends\n" : "corpus fails\n");
    return good ? 0 : 1;
}
