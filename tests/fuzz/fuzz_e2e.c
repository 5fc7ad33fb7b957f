/* e2e.h: every rule table that is valid, frames of any bytes, sequences of any counters, and the state machine beside one that keeps a list of events. */
#include "fuzz.h"

#include "hullguard/e2e.h"

#define EVENTS 64U

static const hg_status check_answers[] = {HG_OK, HG_E_FORMAT, HG_E_CRC};
static const hg_status sequence_answers[] = {HG_OK, HG_E_REPEATED, HG_E_SEQUENCE};

static hg_e2e_limit take_limit(source *s)
{
    hg_e2e_limit limit;
    limit.window = take_below(s, 18U);
    limit.ok = take_below(s, 18U);
    limit.error = take_below(s, 18U);
    return limit;
}

static uint16_t take_place(source *s)
{
    const uint8_t byte = take8(s);
    return (byte < 8U) ? take16(s) : (uint16_t)(4U * (byte % 128U));
}

/* Any table; most of its places lie where they may. */
static hg_e2e_config take_config(source *s, uint8_t *ids, hg_e2e_limits *limits)
{
    const bool usual = (take8(s) & 1U) != 0U;
    hg_e2e_config config = {.profile = (hg_e2e_profile)take_below(s, 8U), .mode = (hg_e2e_id_mode)take_below(s, 6U)};
    config.data_id = take16(s);
    config.crc = take_below(s, (take8(s) == 255U) ? 256U : 64U);
    config.ignore = take_below(s, 16U);
    config.counter = take_place(s);
    config.nibble = take_place(s);
    config.stamp = ((take8(s) & 1U) != 0U) ? HG_E2E_NO_STAMP : take_place(s);
    config.resync = take_below(s, 4U);
    for (uint8_t i = 0U; i < HG_E2E_IDS; i++) {
        ids[i] = take8(s);
    }
    config.data_ids = (take8(s) == 255U) ? NULL : ids;
    *limits = (hg_e2e_limits){.init = take_limit(s), .valid = take_limit(s), .invalid = take_limit(s), .clear = (take8(s) & 1U) != 0U};
    if (usual) {
        *limits = hg_e2e_limits_default;
    }
    config.limits = (take8(s) == 255U) ? NULL : limits;
    return config;
}

/* Errors of one bit are seen by all but those that e2e.h names: alternate identifiers, and lists that are not all equal. */
static bool sees_one_bit(const hg_e2e_config *config, uint8_t length)
{
    bool equal = true;
    for (uint8_t i = 0U; (config->data_ids != NULL) && (i < HG_E2E_IDS); i++) {
        equal = equal && (config->data_ids[i] == config->data_ids[0]);
    }
    const bool h2f = (config->profile == HG_E2E_P02) || (config->profile == HG_E2E_P22);
    const bool j1850 = (config->profile == HG_E2E_P01) || (config->profile == HG_E2E_P11);
    const bool code = ((config->profile == HG_E2E_P05) || (h2f && equal && (length <= 14U)) ||
                       (j1850 && (config->mode != HG_E2E_ALTERNATE) && (length <= 31U)));
    return code && ((config->ignore & HG_E2E_IGNORE_CRC) == 0U);
}

static void one_frame(source *s, const hg_e2e_config *config, uint8_t length)
{
    uint8_t data[HG_E2E_LENGTH_MAX];
    uint8_t before[HG_E2E_LENGTH_MAX];
    for (uint8_t i = 0U; i < HG_E2E_LENGTH_MAX; i++) {
        data[i] = take8(s);
    }
    hg_e2e_header header = {.stamp = 77U, .counter = 77U, .crc = 77U};
    const hg_status any = hg_e2e_check(config, data, length, &header);
    require(30U, one_of(any, check_answers, 3U));
    require(31U, (any == HG_OK) ? (header.counter < hg_e2e_modulus(config)) : (header.counter == 77U));

    (void)memcpy(before, data, sizeof(data));
    const uint8_t counter = take8(s);
    const uint8_t stamp = take8(s);
    require(32U, hg_e2e_protect(config, data, length, counter, stamp) == HG_OK);
    for (uint16_t bit = 0U; bit < (8U * HG_E2E_LENGTH_MAX); bit++) {
        const bool changed = (((data[bit / 8U] ^ before[bit / 8U]) >> (bit % 8U)) & 1U) != 0U;
        require(33U, (!changed) || ((bit < (8U * (uint16_t)length)) && hg_e2e_owns(config, bit)));
    }
    require(32U, hg_e2e_check(config, data, length, &header) == HG_OK);
    require(32U, header.counter == (counter % hg_e2e_modulus(config)));
    require(32U, (config->stamp == HG_E2E_NO_STAMP) ? (header.stamp == 0U) : (header.stamp == (stamp % 16U)));
    if (sees_one_bit(config, length)) {
        const uint16_t bit = (uint16_t)(take16(s) % (8U * (uint16_t)length));
        data[bit / 8U] ^= (uint8_t)(1U << (bit % 8U));
        require(34U, hg_e2e_check(config, data, length, &header) == HG_E_CRC);
    }
}

/* Frames of one sender, some of them lost; and headers of any counters. */
static void sequences(source *s, const hg_e2e_config *config)
{
    const bool counts = (config->profile != HG_E2E_NONE) && ((config->ignore & HG_E2E_IGNORE_COUNTER) == 0U);
    const uint32_t modulus = hg_e2e_modulus(config);
    hg_e2e_receiver lawful;
    hg_e2e_receiver any;
    hg_e2e_receiver_start(&lawful);
    hg_e2e_receiver_start(&any);
    uint32_t sent = take8(s);
    for (uint8_t i = take_below(s, 20U); i > 0U; i--) {
        hg_e2e_progress progress = {.lost = 0U, .continues = false};
        const uint32_t lost = take_below(s, (modulus < 20U) ? modulus : 20U);
        sent += lost + 1U;
        const hg_e2e_header next = {.stamp = (uint8_t)(sent % 16U), .counter = (uint8_t)(sent % modulus), .crc = (uint16_t)sent};
        const bool first = !lawful.seen;
        require(35U, hg_e2e_sequence(config, &lawful, &next, (uint16_t)(lost + 1U), &progress) == HG_OK);
        require(35U, (!counts) || (progress.lost == (first ? 0U : lost)));
        require(35U, progress.continues == (counts && (!first) && (lost == 0U)));

        const hg_e2e_receiver was = any;
        const hg_e2e_header wild = {.stamp = take_below(s, 16U), .counter = take_below(s, modulus), .crc = take_below(s, 3U)};
        const hg_status status = hg_e2e_sequence(config, &any, &wild, ((take8(s) & 3U) == 0U) ? HG_E2E_ANY_STEP : take_below(s, 20U), &progress);
        require(30U, one_of(status, sequence_answers, 3U));
        require(36U, (status != HG_E_REPEATED) || (memcmp(&was, &any, sizeof(was)) == 0));
        require(36U, (status == HG_E_REPEATED) == (hg_e2e_repeated(config, &was, &wild) && counts));
        require(35U, (status != HG_OK) || (progress.lost < modulus));
        require(35U, (status != HG_OK) || (!progress.continues) || (progress.lost == 0U));
    }
}

/* The state machine of AUTOSAR E2E as it is told: a list of events since the state's window began, newest last. */
typedef struct {
    hg_e2e_state state;
    uint8_t      event[EVENTS]; /* 1 good, 2 damaged, 0 neither */
    uint32_t     count;
} told;

static uint32_t seen(const told *m, uint8_t window, uint8_t kind)
{
    uint32_t n = 0U;
    for (uint32_t i = 0U; (i < window) && (i < m->count); i++) {
        n += (m->event[(m->count - 1U) - i] == kind) ? 1U : 0U;
    }
    return n;
}

/* On the way to another state only its window is kept. */
static void forget(told *m, uint8_t window)
{
    for (uint32_t i = 0U; i < m->count; i++) {
        if ((m->count - i) > window) {
            m->event[i] = 0U;
        }
    }
}

static void tell(told *m, const hg_e2e_limits *limits, hg_status event)
{
    const bool damaged = (event == HG_E_CRC) || (event == HG_E_FORMAT);
    const hg_e2e_limit *limit = (m->state == HG_E2E_INIT) ? &limits->init : ((m->state == HG_E2E_VALID) ? &limits->valid : &limits->invalid);
    m->event[m->count] = (event == HG_OK) ? 1U : (damaged ? 2U : 0U);
    m->count++;
    if (m->state == HG_E2E_NODATA) {
        forget(m, 0U);
        m->state = ((!damaged) && (event != HG_E_EMPTY)) ? HG_E2E_INIT : HG_E2E_NODATA;
        return;
    }
    forget(m, limit->window);
    const bool enough = (seen(m, limit->window, 1U) >= limit->ok) && (seen(m, limit->window, 2U) <= limit->error);
    if (enough && (m->state != HG_E2E_VALID)) {
        m->state = HG_E2E_VALID;
        forget(m, limits->valid.window);
    } else if ((!enough) && ((m->state == HG_E2E_VALID) || ((m->state == HG_E2E_INIT) && (seen(m, limit->window, 2U) > limit->error)))) {
        m->state = HG_E2E_INVALID;
        forget(m, limits->clear ? 0U : limits->invalid.window);
    } else {
        /* stays */
    }
}

static void machine(source *s, const hg_e2e_limits *limits)
{
    static const hg_status kinds[] = {HG_OK, HG_E_CRC, HG_E_EMPTY, HG_E_REPEATED, HG_E_FORMAT, HG_E_SEQUENCE, HG_OK, HG_OK};
    hg_e2e_machine self = {.state = HG_E2E_DEINIT};
    require(37U, hg_e2e_machine_step(&self, limits, HG_OK) == HG_E2E_DEINIT);
    hg_e2e_machine_start(&self);
    told other = {.state = HG_E2E_NODATA};
    while (more(s) && (other.count < EVENTS)) {
        const hg_status event = kinds[take_below(s, 8U)];
        tell(&other, limits, event);
        require(37U, hg_e2e_machine_step(&self, limits, event) == other.state);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    source s = {.data = data, .left = size};
    uint8_t ids[HG_E2E_IDS];
    hg_e2e_limits limits;
    const uint8_t length = take_below(&s, 70U);
    const hg_e2e_config config = take_config(&s, ids, &limits);
    if (hg_e2e_valid(&config, length)) {
        one_frame(&s, &config, length);
        sequences(&s, &config);
        machine(&s, config.limits);
    }
    return 0;
}
