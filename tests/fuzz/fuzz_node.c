/* node.h over the shipped models: lawful senders with any values, frames of any bytes with and without a good checksum, old frames, losses, ticks by the clock,
 * outages, restarts; observers of unknown inputs beside the models that have them. */
#include "fuzz.h"

#include "models.h"
#include "suspension.h"
#include "suspension_published.h"
#include "suspension_published_uio.h"
#include "suspension_uio.h"

#define PAST 16U
#define OPERATIONS 600U

static const hg_status receive_answers[] = {HG_OK,      HG_E_ID,       HG_E_FORMAT, HG_E_CRC,     HG_E_REPEATED,
                                            HG_E_STAMP, HG_E_SEQUENCE, HG_E_STATE,  HG_E_NUMERIC, HG_E_BUSY};

typedef struct {
    const app_model *model;
    hg_node         *node;
    uint32_t         k;                     /* the senders' sample */
    uint32_t         noise;
    hg_sender_config config[HG_GROUPS_MAX];
    hg_sender        sender[HG_GROUPS_MAX];
    int32_t          codes[HG_GROUPS_MAX][2U * HG_GROUP_SIGNALS_MAX];
    hg_can_frame     past[PAST];
    uint32_t         sent;
    bool             uio;                   /* are there observers? */
    hg_suspension_uio           first;
    hg_suspension_published_uio second;
} rig;

static uint8_t groups_of(const rig *r)
{
    return r->model->config->detector->groups;
}

static void start(rig *r, hg_start how)
{
    const bool first = strcmp(r->model->name, "suspension") == 0;
    const bool second = strcmp(r->model->name, "suspension_published") == 0;
    require(1U, app_model_start(r->model, &r->node, how) == HG_OK);
    r->uio = first || second;
    if (first) {
        require(1U, hg_suspension_uio_start(&r->first, &r->node->detector, how) == HG_OK);
    }
    if (second) {
        require(1U, hg_suspension_published_uio_start(&r->second, &r->node->detector, how) == HG_OK);
    }
}

static void begin(source *s, rig *r)
{
    (void)memset(r, 0, sizeof(*r));
    uint32_t models = 0U;
    while (app_model_at(models) != NULL) {
        models++;
    }
    r->model = app_model_at(take_below(s, models));
    const hg_start how = ((take8(s) & 1U) != 0U) ? HG_START_REST : HG_START_MOVING;
    r->k = (how == HG_START_REST) ? 0U : take32(s);
    start(r, how);
    for (uint8_t g = 0U; g < groups_of(r); g++) {
        r->config[g] = (hg_sender_config){.message = &r->model->config->message[g], .trigger = r->model->config->detector->hold[g].trigger};
        require(1U, hg_sender_start(&r->sender[g], &r->config[g], r->codes[g]) == HG_OK);
    }
}

/* Numbers of a detector's memory that last: behind a polynomial filter's is what each of its steps computes anew, and there squares may overflow. */
static uint32_t lasting(const hg_detector *d)
{
    return (d->config->polynomials > 0U) ? (uint32_t)(d->memory.polynomial[0].filter.eta - d->memory.real) : d->memory.reals;
}

/* I7: nothing that is not finite, no radius below 0 or beyond its span. */
static void check_state(const rig *r)
{
    const hg_detector *d = &r->node->detector;
    const hg_detector_config *config = d->config;
    require(7U, all_finite(d->memory.real, lasting(d)));
    require(7U, all_finite(d->value, config->width) && all_finite(d->radius, config->width) && all_finite(d->r, config->residuals));
    require(7U, all_finite(d->J, config->residuals));
    for (uint8_t i = 0U; i < config->width; i++) {
        require(7U, d->radius[i] >= HG_REAL_ZERO);
    }
    uint8_t at = 0U;
    for (uint8_t g = 0U; g < config->groups; g++) {
        for (uint8_t i = 0U; i < config->hold[g].trigger->width; i++) {
            require(7U, d->radius[at] <= config->hold[g].span[i]);
            at++;
        }
    }
}

static void check_verdict(const rig *r, const hg_verdict *v)
{
    uint32_t faults = 0U;
    const hg_decision_config *decision = &r->model->config->detector->decision;
    for (uint8_t g = 0U; g < decision->generators; g++) {
        faults |= decision->faults[g];
    }
    const bool alarm = (v->plant == HG_PLANT_PROVISIONAL) || (v->plant == HG_PLANT_CONFIRMED);
    require(8U, (v->plant == HG_PLANT_STARTING) || (v->plant == HG_PLANT_NONE) || alarm);
    require(8U, (v->basis == HG_BASIS_SET) || (v->basis == HG_BASIS_STATISTICAL) || ((!alarm) && (v->basis == HG_BASIS_UNSET)));
    require(8U, ((v->candidates & ~faults) == 0U) && (alarm || (v->candidates == 0U)));
    require(8U, ((uint32_t)v->bus >> (2U * (uint32_t)groups_of(r))) == 0U);
    require(8U, v->model_hash == r->model->config->model_hash);
}

/* I9: what is reported is what the verdict says, read by the other end. */
static void check_report(rig *r, const hg_verdict *v, bool reply)
{
    hg_can_frame out[2];
    hg_verdict read = {.k = 0U};
    bool replied = false;
    const uint8_t frames = hg_node_report(r->node, v, reply, out);
    require(9U, (frames <= 2U) && ((!reply) || (frames >= 1U)));
    if (frames > 0U) {
        require(9U, hg_verdict_read(r->model->config->verdict, &out[0], &read, &replied) == HG_OK);
        require(9U, (read.plant == v->plant) && (read.basis == v->basis) && (read.bus == v->bus) && (read.refused == v->refused));
        require(9U, (read.candidates == v->candidates) && (read.k == (v->k % 4096U)));
    }
    require(9U, (frames < 2U) || hg_frame_matches(r->model->config->status, &out[1]));
}

static void check_observers(rig *r)
{
    if (r->uio) {
        const bool first = strcmp(r->model->name, "suspension") == 0;
        const hg_status status = first ? hg_suspension_uio_follow(&r->first, &r->node->detector) : hg_suspension_published_uio_follow(&r->second, &r->node->detector);
        const hg_real *estimate = first ? r->first.estimate : r->second.estimate;
        const hg_real *radius = first ? r->first.radius : r->second.radius;
        const size_t n = first ? HG_SUSPENSION_UIO_ESTIMATES : HG_SUSPENSION_PUBLISHED_UIO_ESTIMATES;
        require(10U, (status == HG_OK) || (status == HG_E_NUMERIC));
        require(10U, all_finite(estimate, n) && all_finite(radius, n));
        for (size_t i = 0U; i < n; i++) {
            require(10U, radius[i] >= HG_REAL_ZERO);
        }
    }
}

static void steps(rig *r, bool reply)
{
    uint8_t made = 0U;
    const uint8_t due = r->node->due;
    require(5U, due <= 8U);
    for (;;) {
        hg_verdict verdict = {.k = 77U};
        const uint32_t k = r->node->k;
        const hg_status status = hg_node_step(r->node, &verdict);
        if (status != HG_OK) {
            require(1U, status == HG_E_EMPTY);
            require(5U, verdict.k == 77U);
            break;
        }
        made++;
        require(6U, (verdict.k == k) && (r->node->k == (k + 1U)));
        check_verdict(r, &verdict);
        check_state(r);
        check_report(r, &verdict, reply);
        check_observers(r);
    }
    require(5U, made == due);
}

/* I4: the counters that may move for a status: one by 1, and `lost` beside it. */
static void check_counted(const hg_link_health *was, const hg_link_health *is, hg_status status, bool synchronised)
{
    const uint16_t before[] = {was->good, was->crc, was->format, was->repeated, was->sequence, was->untrusted, was->numeric, was->early, was->late};
    const uint16_t after[] = {is->good, is->crc, is->format, is->repeated, is->sequence, is->untrusted, is->numeric, is->early, is->late};
    static const hg_status kind[] = {HG_OK, HG_E_CRC, HG_E_FORMAT, HG_E_REPEATED, HG_E_SEQUENCE, HG_E_STATE, HG_E_NUMERIC, HG_E_STAMP, HG_E_STAMP};
    unsigned moved = 0U;
    for (unsigned i = 0U; i < 9U; i++) {
        const unsigned by = (unsigned)after[i] - before[i];
        require(4U, (after[i] >= before[i]) && (by <= 1U) && ((by == 0U) || (kind[i] == status)));
        moved += by;
    }
    require(4U, is->lost >= was->lost);
    require(4U, (moved == 1U) || ((status == HG_E_STAMP) && (!synchronised)));
}

static void give(rig *r, const hg_can_frame *frame)
{
    static hg_node was;
    hg_link_health health[HG_GROUPS_MAX];
    was = *r->node;
    uint8_t group = groups_of(r);
    for (uint8_t g = 0U; g < groups_of(r); g++) {
        health[g] = *hg_node_health(r->node, g);
        const hg_message *m = &r->model->config->message[g];
        if ((m->id == frame->id) && (((m->flags ^ frame->flags) & HG_CAN_EXTENDED) == 0U)) {
            group = g;
        }
    }
    const hg_status status = hg_node_receive(r->node, frame);
    require(1U, one_of(status, receive_answers, sizeof(receive_answers) / sizeof(receive_answers[0])));
    require(6U, (int32_t)(r->node->k - was.k) >= 0 || (!was.synchronised));
    require(3U, (status == HG_E_ID) == (group == groups_of(r)));
    for (uint8_t g = 0U; g < groups_of(r); g++) {
        if ((g == group) && (status != HG_E_BUSY)) {
            check_counted(&health[g], hg_node_health(r->node, g), status, was.synchronised);
        } else {
            require(4U, memcmp(&health[g], hg_node_health(r->node, g), sizeof(health[g])) == 0);
        }
    }
    if (status == HG_E_BUSY) {
        require(2U, (was.due > 0U) && (memcmp(&was, r->node, sizeof(was)) == 0));
    }
    if (status == HG_E_ID) {
        was.unknown = r->node->unknown;
        require(3U, memcmp(&was, r->node, sizeof(was)) == 0);
    }
}

/* A sample of all senders: values about the middle, or anywhere; `how` says which frames arrive, and how. */
static void sample(source *s, rig *r)
{
    const uint8_t how = take8(s);
    const uint8_t size = take8(s);
    for (uint8_t g = 0U; g < groups_of(r); g++) {
        hg_real value[HG_GROUP_SIGNALS_MAX];
        const hg_hold_config *hold = &r->model->config->detector->hold[g];
        for (uint8_t i = 0U; i < hold->trigger->width; i++) {
            r->noise = (r->noise * 1664525U) + 1013904223U + size;
            const float spread = (float)((int32_t)(r->noise >> 8U) - 8388608) / 16777216.0F;
            value[i] = hold->middle[i] + (spread * hold->span[i] * ((float)size / 255.0F) * ((float)size / 200.0F));
        }
        if ((how & 0x18U) == 0x18U) {
            value[0] = take_finite(s);
        }
        hg_can_frame frame;
        if (hg_sender_step(&r->sender[g], r->k, value, &frame) == HG_OK) {
            r->past[r->sent % PAST] = frame;
            r->sent++;
            if (((how & 1U) == 0U) || (((how >> (g % 8U)) & 1U) == 0U)) {
                give(r, &frame);
            }
            if ((how & 6U) == 6U) {
                give(r, &frame);
            }
        }
    }
    r->k++;
}

/* A frame of a group's shape, any bytes; its checksum made good where asked for. */
static void forged(source *s, rig *r)
{
    const uint8_t g = take_below(s, groups_of(r));
    const hg_message *message = &r->model->config->message[g];
    const uint8_t how = take8(s);
    hg_can_frame frame = {.id = message->id, .flags = message->flags, .length = message->length};
    for (uint8_t i = 0U; i < (frame.length % 65U); i++) {
        frame.data[i] = take8(s);
    }
    if ((how & 0x80U) != 0U) {
        frame.id ^= take16(s);
        frame.flags ^= take8(s);
        frame.length = take_below(s, 65U);
    }
    if ((how & 1U) != 0U) {
        const uint8_t counter = ((how & 2U) != 0U) ? r->sender[g].counter : take8(s);
        const uint32_t stamp = ((how & 4U) != 0U) ? r->node->k : (r->node->k + take8(s));
        (void)hg_e2e_protect(message->e2e, frame.data, frame.length, counter, (uint8_t)(stamp % 16U));
        if ((how & 2U) != 0U) {
            r->sender[g].counter = (uint8_t)((r->sender[g].counter + 1U) % hg_e2e_modulus(message->e2e));
        }
    }
    give(r, &frame);
}

static void old(source *s, rig *r)
{
    hg_can_frame frame = r->past[take_below(s, PAST)];
    const uint8_t flip = take8(s);
    if ((flip & 0x80U) != 0U) {
        frame.data[(flip >> 3U) & 15U] ^= (uint8_t)(1U << (flip & 7U));
    }
    give(r, &frame);
}

static void operation(source *s, rig *r)
{
    const uint8_t op = take_below(s, 16U);
    if (op < 7U) {
        sample(s, r);
        steps(r, false);
    } else if (op < 10U) {
        forged(s, r);
    } else if (op == 10U) {
        old(s, r);
    } else if (op == 11U) {
        hg_node_overdue(r->node);
    } else if (op == 12U) {
        hg_node_expect(r->node, take8(s));
    } else if (op == 13U) {
        steps(r, (take8(s) & 1U) != 0U);
    } else if (op == 14U) {
        r->k += take_below(s, 40U); /* senders that nobody hears */
        if ((take8(s) & 1U) != 0U) {
            hg_node_outage(r->node);
        }
    } else if ((take8(s) & 15U) == 0U) {
        start(r, ((take8(s) & 1U) != 0U) ? HG_START_REST : HG_START_MOVING);
    } else {
        steps(r, false);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    source s = {.data = data, .left = size};
    static rig r;
    begin(&s, &r);
    for (unsigned i = 0U; more(&s) && (i < OPERATIONS); i++) {
        operation(&s, &r);
    }
    steps(&r, true);
    return 0;
}
