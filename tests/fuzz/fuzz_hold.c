/* trigger.h beside hold.h: a lawful sender of any table, a link that loses any frames, and the truth. Numbers are multiples of powers of two, so that
 * nothing rounds and the bounds may be as tight as they are stated. */
#include "fuzz.h"

#include "hullguard/hold.h"

#define WIDTH 2U
#define LEVELS 3U
#define HORIZON 20U
#define PAST 40U
#define STEPS 8 /* of the truth in one code */

typedef struct {
    hg_real value[WIDTH];
    hg_real radius[WIDTH];
    double  truth[WIDTH];
} sample;

typedef struct {
    uint8_t           silence[LEVELS];
    uint16_t          delta[LEVELS * WIDTH];
    int32_t           sigma[LEVELS * WIDTH];
    int32_t           activity[LEVELS * WIDTH];
    int32_t           zero[WIDTH];
    hg_code_scale     scale[WIDTH];
    hg_real           half[WIDTH];
    hg_real           slew[HORIZON * WIDTH];
    hg_real           span[WIDTH];
    hg_real           middle[WIDTH];
    int32_t           speed[WIDTH];  /* most that the truth moves in a sample, steps */
    hg_trigger_config trigger;
    hg_hold_config    hold;
} tables;

typedef struct {
    tables     t;
    hg_trigger sender;
    int32_t    sent[WIDTH];
    hg_hold    receiver;
    int32_t    codes[HG_HOLD_CODES(WIDTH)];
    hg_real    reals[HG_HOLD_REALS(WIDTH)];
    hg_ring    ring;
    hg_real    rows[HG_RING_REALS(WIDTH, PAST)];
    int32_t    truth[WIDTH];          /* steps */
    uint32_t   spoken;                /* frames sent */
    uint32_t   heard;                 /* number of the last one received, 0: none */
    sample     past[PAST];            /* newest first */
    unsigned   known;                 /* samples in past[] */
} rig;

static void take_tables(source *s, tables *t)
{
    (void)memset(t, 0, sizeof(*t));
    t->trigger = (hg_trigger_config){.width = (uint8_t)(1U + take_below(s, WIDTH)), .levels = (uint8_t)(1U + take_below(s, LEVELS)),
                                     .interval_max = (uint8_t)(1U + take_below(s, 14U)), .silence = t->silence, .delta = t->delta, .sigma = t->sigma,
                                     .activity = t->activity, .zero = t->zero};
    t->hold = (hg_hold_config){.trigger = &t->trigger, .margin = take_below(s, 6U), .scale = t->scale, .half = t->half, .slew = t->slew,
                               .span = t->span, .middle = t->middle};
    const uint8_t width = t->trigger.width;
    for (uint8_t l = 0U; l < t->trigger.levels; l++) {
        t->silence[l] = take_below(s, t->trigger.interval_max);
    }
    for (uint8_t i = 0U; i < (t->trigger.levels * width); i++) {
        t->delta[i] = (uint16_t)(take16(s) >> take_below(s, 16U));
        t->sigma[i] = take_below(s, 64U);
        t->activity[i] = (i < width) ? 0 : (t->activity[i - width] + take_below(s, 32U));
    }
    for (uint8_t g = 0U; g < width; g++) {
        const double resolution = 1.0 / (double)(1U << take_below(s, 8U));
        const int32_t limit = 16 + (int32_t)(take16(s) >> take_below(s, 16U));
        t->speed[g] = 1 + (take16(s) >> take_below(s, 16U));
        t->zero[g] = (int8_t)take8(s);
        t->scale[g] = (hg_code_scale){.resolution = (hg_real)resolution, .offset = (hg_real)((double)(int8_t)take8(s) / 4.0),
                                      .per_unit = (hg_real)(1.0 / resolution), .minimum = -limit, .maximum = limit};
        t->half[g] = (hg_real)(resolution / 2.0);
        t->span[g] = (hg_real)(resolution * 2.0 * (double)limit);
        t->middle[g] = t->scale[g].offset;
        for (uint8_t j = 0U; j < (t->trigger.interval_max + t->hold.margin); j++) {
            const double slew = (((double)t->speed[g] * (double)(j + 1U) / STEPS) + 0.5) * resolution;
            t->slew[(j * width) + g] = hg_real_min((hg_real)slew, t->span[g]);
        }
    }
}

/* The truth moves, no further than its speed and its range; in codes, with STEPS steps each. */
static void move(source *s, rig *r)
{
    for (uint8_t g = 0U; g < r->t.trigger.width; g++) {
        const int32_t limit = r->t.scale[g].maximum * STEPS;
        const uint8_t how = take8(s);
        int32_t by = (int32_t)(((int64_t)r->t.speed[g] * (int8_t)how) / 128);
        by = ((how & 15U) == 15U) ? ((((how & 16U) != 0U)) ? r->t.speed[g] : -r->t.speed[g]) : by;
        const int32_t to = r->truth[g] + by;
        r->truth[g] = (to > limit) ? limit : ((to < -limit) ? -limit : to);
    }
}

static double real_truth(const rig *r, uint8_t g)
{
    return (double)r->t.scale[g].offset + ((double)r->t.scale[g].resolution * (double)r->truth[g] / STEPS);
}

static void check_enclosed(const rig *r, unsigned number, const sample *one)
{
    for (uint8_t g = 0U; g < r->t.trigger.width; g++) {
        const double error = one->truth[g] - (double)one->value[g];
        require(number, ((error < 0.0) ? -error : error) <= (double)one->radius[g]);
    }
}

/* What a step says of the past: rewritten both ways, which must agree; nothing becomes smaller. */
static void rewrite(rig *r, uint8_t rewind)
{
    hg_real radius[WIDTH];
    const uint8_t width = r->t.trigger.width;
    require(42U, rewind < r->known);
    hg_hold_rewrite(&r->receiver, &r->ring, 0U, rewind);
    for (uint8_t lag = 1U; lag <= rewind; lag++) {
        hg_hold_past(&r->receiver, lag, radius);
        const hg_real *row = hg_ring_row(&r->ring, lag);
        for (uint8_t g = 0U; g < width; g++) {
            require(43U, (radius[g] >= r->past[lag].radius[g]) && (row[g] <= radius[g]) && (row[g] >= radius[g]));
            r->past[lag].radius[g] = radius[g];
        }
    }
}

static void close(rig *r)
{
    const uint8_t width = r->t.trigger.width;
    uint8_t rewind = 0U;
    (void)memmove(&r->past[1], &r->past[0], sizeof(r->past[0]) * (PAST - 1U));
    sample *now = &r->past[0];
    hg_hold_step(&r->receiver, now->value, now->radius, &rewind);
    for (uint8_t g = 0U; g < width; g++) {
        now->truth[g] = real_truth(r, g);
        require(40U, hg_real_finite(now->value[g]) && hg_real_finite(now->radius[g]) && (now->radius[g] >= HG_REAL_ZERO));
        require(40U, now->radius[g] <= r->t.span[g]);
    }
    r->known += (r->known < PAST) ? 1U : 0U;
    require(42U, hg_ring_push(&r->ring, now->radius) == HG_OK);
    rewrite(r, rewind);
    if (!hg_hold_doubt(&r->receiver)) {
        for (unsigned i = 0U; i < r->known; i++) {
            check_enclosed(r, 41U, &r->past[i]);
        }
    }
}

/* One sample: fate 0 the frame arrives, 1 it is lost unseen, 2 it is lost and known to be, 3 it comes twice. */
static void one(source *s, rig *r)
{
    int32_t code[WIDTH];
    const uint8_t what = take8(s);
    const uint8_t fate = (what & 8U) != 0U ? (what & 3U) : 0U;
    move(s, r);
    for (uint8_t g = 0U; g < r->t.trigger.width; g++) {
        code[g] = hg_code_encode(&r->t.scale[g], (hg_real)real_truth(r, g));
        require(44U, code[g] != HG_CODE_INVALID);
        code[g] = ((what & 0xE0U) == 0xE0U) ? HG_CODE_INVALID : code[g];
    }
    const hg_status spoke = hg_trigger_step(&r->sender, code);
    require(45U, (spoke == HG_OK) || (spoke == HG_E_EMPTY));
    if (spoke == HG_OK) {
        r->spoken++;
        if ((fate == 0U) || (fate == 3U)) {
            const bool continues = (r->heard > 0U) && (r->spoken == (r->heard + 1U));
            require(45U, hg_hold_receive(&r->receiver, code, continues) == HG_OK);
            require(45U, (fate != 3U) || (hg_hold_receive(&r->receiver, code, false) == HG_E_REPEATED));
            r->heard = r->spoken;
        } else if (fate == 2U) {
            hg_hold_lose(&r->receiver);
        } else {
            /* nobody knows */
        }
    }
    close(r);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    source s = {.data = data, .left = size};
    static rig r;
    (void)memset(&r, 0, sizeof(r));
    take_tables(&s, &r.t);
    require(46U, hg_trigger_valid(&r.t.trigger));
    require(46U, hg_trigger_start(&r.sender, &r.t.trigger, r.sent) == HG_OK);
    require(46U, hg_hold_start(&r.receiver, &r.t.hold, r.codes, r.reals) == HG_OK);
    require(46U, hg_ring_start(&r.ring, r.t.trigger.width, PAST, r.rows) == HG_OK);
    for (unsigned i = 0U; more(&s) && (i < 400U); i++) {
        one(&s, &r);
    }
    return 0;
}
