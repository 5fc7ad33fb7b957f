/* tracker.h over the shipped fusion filters: a centre and a sensor's node that hear the same frames, whatever these are. Neither may keep a number that is not
 * finite, and their copies are equal to the bit. The second one's memory is filled with rubbish first. */
#include "fuzz.h"

#include "fusion5.h"
#include "fusion5_fast.h"
#include "tracking.h"

#define NODES 2U
#define PAST 16U
#define OPERATIONS 400U

static const hg_status receive_answers[] = {HG_OK,      HG_E_ID,       HG_E_FORMAT, HG_E_CRC,     HG_E_REPEATED,
                                            HG_E_STAMP, HG_E_SEQUENCE, HG_E_STATE,  HG_E_NUMERIC, HG_E_BUSY};

typedef struct {
    union {
        hg_fusion5_tracker      fusion5;
        hg_fusion5_fast_tracker fusion5_fast;
        hg_tracking_tracker     tracking;
    } storage[NODES];
    const hg_tracker_config *config;
    hg_tracker              *node[NODES];
    hg_fusion_sender         sender[HG_FUSION_SENSORS_MAX];
    double                   truth[HG_FUSION_SENSORS_MAX];
    uint32_t                 digest[NODES];
    uint32_t                 ticks;
    hg_can_frame             past[PAST];
    uint32_t                 sent;
} rig;

static void start(rig *r, uint8_t model, uint8_t i, hg_start how)
{
    hg_status status;
    if (model == 0U) {
        r->config = &hg_fusion5_config;
        r->node[i] = &r->storage[i].fusion5.tracker;
        status = hg_fusion5_tracker_start(&r->storage[i].fusion5, how);
    } else if (model == 1U) {
        r->config = &hg_fusion5_fast_config;
        r->node[i] = &r->storage[i].fusion5_fast.tracker;
        status = hg_fusion5_fast_tracker_start(&r->storage[i].fusion5_fast, how);
    } else {
        r->config = &hg_tracking_config;
        r->node[i] = &r->storage[i].tracking.tracker;
        status = hg_tracking_tracker_start(&r->storage[i].tracking, how);
    }
    require(11U, status == HG_OK);
    r->digest[i] = HG_TRACKER_DIGEST;
}

static void begin(source *s, rig *r)
{
    (void)memset(r, 0, sizeof(*r));
    (void)memset(&r->storage[1], 0xA5, sizeof(r->storage[1]));
    const uint8_t model = take_below(s, 3U);
    const hg_start how = ((take8(s) & 1U) != 0U) ? HG_START_REST : HG_START_MOVING;
    for (uint8_t i = 0U; i < NODES; i++) {
        start(r, model, i, how);
    }
    for (uint8_t i = 0U; i < r->config->fusion->sensors; i++) {
        require(11U, hg_fusion_sender_start(&r->sender[i], r->node[1], i) == HG_OK);
    }
}

static void give(rig *r, const hg_can_frame *frame)
{
    hg_status status[NODES];
    for (uint8_t i = 0U; i < NODES; i++) {
        const hg_tracker was = *r->node[i];
        status[i] = hg_tracker_receive(r->node[i], frame);
        require(11U, one_of(status[i], receive_answers, sizeof(receive_answers) / sizeof(receive_answers[0])));
        require(12U, (status[i] != HG_E_BUSY) || ((was.due > 0U) && (memcmp(&was, r->node[i], sizeof(was)) == 0)));
        require(12U, (status[i] != HG_E_ID) || (r->node[i]->unknown >= was.unknown));
    }
    require(14U, status[0] == status[1]);
}

static void check_state(const rig *r, uint8_t i)
{
    const hg_tracker *t = r->node[i];
    const size_t n = r->config->fusion->states;
    require(13U, all_finite(t->fusion.x, n) && all_finite(t->fusion.P, n * n) && all_finite(t->value, n) && all_finite(t->deviation, n));
    for (size_t j = 0U; j < n; j++) {
        require(13U, (t->deviation[j] >= HG_REAL_ZERO) && (t->fusion.P[(j * n) + j] >= HG_REAL_ZERO));
    }
}

static void check_verdict(const rig *r, const hg_verdict *v)
{
    const bool alarm = (v->plant == HG_PLANT_PROVISIONAL) || (v->plant == HG_PLANT_CONFIRMED);
    require(15U, (v->plant == HG_PLANT_STARTING) || (v->plant == HG_PLANT_NONE) || alarm);
    require(15U, (v->candidates >> r->config->fusion->sensors) == 0U);
    require(15U, v->model_hash == r->config->model_hash);
}

static void steps(rig *r)
{
    hg_status status = HG_OK;
    uint8_t made = 0U;
    while (status == HG_OK) {
        hg_verdict verdict[NODES] = {{.k = 0U}, {.k = 0U}};
        hg_can_frame out[NODES][2];
        (void)memset(out, 0, sizeof(out));
        uint8_t frames[NODES];
        const uint32_t k = r->node[0]->k;
        status = hg_tracker_step(r->node[0], &verdict[0]);
        require(14U, hg_tracker_step(r->node[1], &verdict[1]) == status);
        require(11U, (status == HG_OK) || (status == HG_E_EMPTY));
        if (status == HG_OK) {
            made++;
            for (uint8_t i = 0U; i < NODES; i++) {
                check_state(r, i);
                check_verdict(r, &verdict[i]);
                frames[i] = hg_tracker_report(r->node[i], &verdict[i], false, out[i]);
                r->digest[i] = hg_tracker_digest(&r->node[i]->fusion, r->digest[i]);
            }
            require(15U, (verdict[0].k == k) && (frames[0] <= 2U));
            require(14U, (frames[0] == frames[1]) && (memcmp(out[0], out[1], sizeof(out[0])) == 0));
            require(14U, r->digest[0] == r->digest[1]);
            for (uint8_t j = 0U; j < r->config->fusion->states; j++) {
                require(14U, hg_tracker_estimate(r->node[0], j, &out[0][0]) == hg_tracker_estimate(r->node[1], j, &out[1][0]));
            }
        }
    }
    require(15U, made <= 8U);
}

/* A sample: what is true moves, sensors speak when the prediction does not say it, the tick closes. */
static void sample(source *s, rig *r)
{
    const uint8_t how = take8(s);
    const uint8_t size = take8(s);
    for (uint8_t i = 0U; i < r->config->fusion->sensors; i++) {
        hg_can_frame frame;
        r->truth[i] += ((double)(int8_t)(size * (uint8_t)(i + 37U)) / 128.0) * (double)(size % 16U);
        const hg_real y = ((how & 0x70U) == 0x70U) ? take_finite(s) : (hg_real)r->truth[i];
        const hg_status status = hg_fusion_sender_step(&r->sender[i], y, (hg_real)((double)size / 64.0), (how & 1U) != 0U, &frame);
        require(11U, (status == HG_OK) || (status == HG_E_EMPTY) || (status == HG_E_NUMERIC) || (status == HG_E_STATE));
        if (status == HG_OK) {
            r->past[r->sent % PAST] = frame;
            r->sent++;
            if (((how & 2U) == 0U) || (((how >> (i % 8U)) & 1U) == 0U)) {
                give(r, &frame);
            }
        }
    }
}

static void tick(source *s, rig *r)
{
    const uint8_t how = take8(s);
    hg_can_frame frame;
    hg_frame_pack(r->config->tick, NULL, &frame);
    const uint32_t k = ((how & 0xC0U) == 0xC0U) ? (r->node[0]->k + how) : r->node[0]->k;
    (void)hg_e2e_protect(r->config->tick->e2e, frame.data, frame.length, (uint8_t)(r->ticks % 16U), (uint8_t)(k % 16U));
    r->ticks += ((how & 0x30U) == 0x30U) ? (how & 7U) : 1U;
    r->past[r->sent % PAST] = frame;
    r->sent++;
    give(r, &frame);
    steps(r);
}

static void forged(source *s, rig *r)
{
    const uint8_t i = take_below(s, r->config->fusion->sensors);
    const uint8_t how = take8(s);
    const hg_message *message = r->config->source[i].message;
    hg_can_frame frame = {.id = message->id, .flags = message->flags, .length = message->length};
    for (uint8_t b = 0U; b < frame.length; b++) {
        frame.data[b] = take8(s);
    }
    if ((how & 0x80U) != 0U) {
        frame.id ^= take16(s);
        frame.flags ^= take8(s);
        frame.length = take_below(s, 65U);
    }
    if ((how & 1U) != 0U) {
        const uint8_t counter = ((how & 2U) != 0U) ? r->sender[i].counter : take8(s);
        const uint32_t k = r->node[0]->k - (((how & 4U) != 0U) ? 0U : take8(s));
        (void)hg_e2e_protect(message->e2e, frame.data, frame.length, counter, (uint8_t)(k % 16U));
    }
    give(r, &frame);
}

static void operation(source *s, rig *r)
{
    const uint8_t op = take_below(s, 16U);
    if (op < 5U) {
        sample(s, r);
        tick(s, r);
    } else if (op < 8U) {
        forged(s, r);
    } else if (op < 10U) {
        tick(s, r);
    } else if (op < 12U) {
        give(r, &r->past[take_below(s, PAST)]);
    } else if (op == 12U) {
        const uint8_t samples = take8(s);
        hg_tracker_expect(r->node[0], samples);
        hg_tracker_expect(r->node[1], samples);
    } else if (op == 13U) {
        hg_tracker_overdue(r->node[0]);
        hg_tracker_overdue(r->node[1]);
    } else if ((op == 14U) && (take_below(s, 4U) == 0U)) {
        hg_tracker_outage(r->node[0]);
        hg_tracker_outage(r->node[1]);
    } else {
        steps(r);
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
    return 0;
}
