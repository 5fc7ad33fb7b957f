#include "hullguard/e2e.h"

#include <stddef.h>

#define NIBBLE_MASK 0x0FU
#define WINDOW_MAX 16U
#define STEPS_J1850 15U /* counter values of P01, P11 */
#define STEPS_H2F 16U   /* of P02, P22 */
#define STEPS_P05 256U
#define START_H2F 0xFFU
#define FINAL_H2F 0xFFU
#define START_CCITT 0xFFFFU

const hg_e2e_limits hg_e2e_limits_default = {.init = {.window = 8U, .ok = 1U, .error = 2U},
                                             .valid = {.window = 8U, .ok = 1U, .error = 3U},
                                             .invalid = {.window = 8U, .ok = 2U, .error = 2U},
                                             .clear = false};

/* ---- Checksums: by nibbles, 16 entries of flash instead of 256 ---- */

static uint8_t crc8_byte(const uint8_t *nibble, uint8_t crc, uint8_t byte)
{
    uint8_t sum = crc ^ byte;
    sum = (uint8_t)((uint8_t)(sum << 4U) ^ nibble[sum >> 4U]);
    return (uint8_t)((uint8_t)(sum << 4U) ^ nibble[sum >> 4U]);
}

static uint16_t crc16_byte(uint16_t crc, uint8_t byte)
{
    static const uint16_t nibble[16] = {0x0000U, 0x1021U, 0x2042U, 0x3063U, 0x4084U, 0x50A5U, 0x60C6U, 0x70E7U,
                                        0x8108U, 0x9129U, 0xA14AU, 0xB16BU, 0xC18CU, 0xD1ADU, 0xE1CEU, 0xF1EFU};
    uint16_t sum = (uint16_t)(crc ^ (uint16_t)((uint16_t)byte << 8U));
    sum = (uint16_t)((uint16_t)(sum << 4U) ^ nibble[sum >> 12U]);
    return (uint16_t)((uint16_t)(sum << 4U) ^ nibble[sum >> 12U]);
}

/* The identifier first, then the frame. */
static uint8_t sum_j1850(const hg_e2e_config *config, const uint8_t *data, uint8_t length, uint8_t counter)
{
    static const uint8_t nibble[16] = {0x00U, 0x1DU, 0x3AU, 0x27U, 0x74U, 0x69U, 0x4EU, 0x53U,
                                       0xE8U, 0xF5U, 0xD2U, 0xCFU, 0x9CU, 0x81U, 0xA6U, 0xBBU};
    const uint8_t low = (uint8_t)(config->data_id & 0xFFU);
    const uint8_t high = (uint8_t)(config->data_id >> 8U);
    const bool odd = (counter & 1U) != 0U;
    uint8_t crc = crc8_byte(nibble, 0U, ((config->mode == HG_E2E_ALTERNATE) && odd) ? high : low);
    if (config->mode == HG_E2E_BOTH) {
        crc = crc8_byte(nibble, crc, high);
    } else if (config->mode == HG_E2E_NIBBLE) {
        crc = crc8_byte(nibble, crc, 0U);
    } else {
        /* one byte of it only */
    }
    for (uint8_t i = 0U; i < length; i++) {
        crc = (i != config->crc) ? crc8_byte(nibble, crc, data[i]) : crc;
    }
    return crc;
}

/* The frame first, then the counter's entry of the list. */
static uint8_t sum_h2f(const hg_e2e_config *config, const uint8_t *data, uint8_t length, uint8_t counter)
{
    static const uint8_t nibble[16] = {0x00U, 0x2FU, 0x5EU, 0x71U, 0xBCU, 0x93U, 0xE2U, 0xCDU,
                                       0x57U, 0x78U, 0x09U, 0x26U, 0xEBU, 0xC4U, 0xB5U, 0x9AU};
    uint8_t crc = START_H2F;
    for (uint8_t i = 0U; i < length; i++) {
        crc = (i != config->crc) ? crc8_byte(nibble, crc, data[i]) : crc;
    }
    return crc8_byte(nibble, crc, config->data_ids[counter]) ^ FINAL_H2F;
}

static uint16_t sum_p05(const hg_e2e_config *config, const uint8_t *data, uint8_t length)
{
    uint16_t crc = START_CCITT;
    for (uint8_t i = 0U; i < length; i++) {
        const bool own = (i == config->crc) || (i == (config->crc + 1U));
        crc = own ? crc : crc16_byte(crc, data[i]);
    }
    crc = crc16_byte(crc, (uint8_t)(config->data_id & 0xFFU));
    return crc16_byte(crc, (uint8_t)(config->data_id >> 8U));
}

static bool is_j1850(const hg_e2e_config *config)
{
    return (config->profile == HG_E2E_P01) || (config->profile == HG_E2E_P11);
}

static bool is_h2f(const hg_e2e_config *config)
{
    return (config->profile == HG_E2E_P02) || (config->profile == HG_E2E_P22);
}

static bool has_nibble(const hg_e2e_config *config)
{
    return is_j1850(config) && (config->mode == HG_E2E_NIBBLE);
}

static uint16_t checksum(const hg_e2e_config *config, const uint8_t *data, uint8_t length, uint8_t counter)
{
    uint16_t sum = 0U;
    if (is_j1850(config)) {
        sum = sum_j1850(config, data, length, counter);
    } else if (is_h2f(config)) {
        sum = sum_h2f(config, data, length, counter);
    } else {
        sum = sum_p05(config, data, length);
    }
    return sum;
}

/* ---- Places ---- */

static uint8_t get_nibble(const uint8_t *data, uint16_t bit)
{
    return (uint8_t)(data[bit / 8U] >> (bit % 8U)) & NIBBLE_MASK;
}

static void put_nibble(uint8_t *data, uint16_t bit, uint8_t value)
{
    const uint32_t place = (uint32_t)bit % 8U;
    const uint32_t kept = (uint32_t)data[bit / 8U] & ~((uint32_t)NIBBLE_MASK << place);
    data[bit / 8U] = (uint8_t)(kept | (((uint32_t)value & NIBBLE_MASK) << place));
}

static uint16_t read_sum(const hg_e2e_config *config, const uint8_t *data)
{
    uint16_t sum = data[config->crc];
    if (config->profile == HG_E2E_P05) {
        sum = (uint16_t)(sum | (uint16_t)((uint16_t)data[config->crc + 1U] << 8U));
    }
    return sum;
}

/* Bits from `first` on, `count` of them: one place of the protection in a frame. */
static bool within(uint16_t bit, uint16_t first, uint16_t count)
{
    return (bit >= first) && ((uint32_t)bit < ((uint32_t)first + count));
}

/* How many places hold the bit. */
static uint32_t owners(const hg_e2e_config *config, uint16_t bit)
{
    const bool guarded = config->profile != HG_E2E_NONE;
    const bool wide = config->profile == HG_E2E_P05;
    const uint16_t crc = (uint16_t)(8U * config->crc);
    uint32_t count = (guarded && within(bit, crc, wide ? 16U : 8U)) ? 1U : 0U;
    count += (guarded && within(bit, config->counter, wide ? 8U : 4U)) ? 1U : 0U;
    count += (has_nibble(config) && within(bit, config->nibble, 4U)) ? 1U : 0U;
    count += ((config->stamp != HG_E2E_NO_STAMP) && within(bit, config->stamp, 4U)) ? 1U : 0U;
    return count;
}

bool hg_e2e_owns(const hg_e2e_config *config, uint16_t bit)
{
    return owners(config, bit) > 0U;
}

/* Bits that the protection takes in a frame, each place for itself. */
static uint32_t bits_taken(const hg_e2e_config *config)
{
    uint32_t bits = (config->stamp != HG_E2E_NO_STAMP) ? 4U : 0U;
    if (config->profile == HG_E2E_P05) {
        bits += 24U;
    } else if (config->profile != HG_E2E_NONE) {
        bits += has_nibble(config) ? 16U : 12U;
    } else {
        /* no checksum and no counter */
    }
    return bits;
}

static bool limit_valid(const hg_e2e_limit *limit)
{
    return (limit->window >= 1U) && (limit->window <= WINDOW_MAX) && (limit->ok <= limit->window) && (limit->error <= limit->window);
}

static bool rules_valid(const hg_e2e_config *config)
{
    const hg_e2e_limits *limits = config->limits;
    bool valid = (config->profile >= HG_E2E_NONE) && (config->profile <= HG_E2E_P22);
    valid = valid && ((!is_h2f(config)) || (config->data_ids != NULL));
    valid = valid && ((!is_j1850(config)) || ((config->mode >= HG_E2E_BOTH) && (config->mode <= HG_E2E_NIBBLE)));
    valid = valid && (limits != NULL) && limit_valid(&limits->init) && limit_valid(&limits->valid) && limit_valid(&limits->invalid);
    return valid;
}

static bool places_aligned(const hg_e2e_config *config)
{
    bool aligned = (config->stamp == HG_E2E_NO_STAMP) || ((config->stamp % 4U) == 0U);
    if (config->profile != HG_E2E_NONE) {
        aligned = aligned && ((config->counter % ((config->profile == HG_E2E_P05) ? 8U : 4U)) == 0U);
    }
    return aligned && ((!has_nibble(config)) || ((config->nibble % 4U) == 0U));
}

bool hg_e2e_valid(const hg_e2e_config *config, uint8_t length)
{
    if ((config == NULL) || (length > HG_E2E_LENGTH_MAX) || (!rules_valid(config)) || (!places_aligned(config))) {
        return false;
    }
    uint32_t owned = 0U;
    bool apart = true;
    for (uint16_t bit = 0U; bit < (8U * (uint16_t)length); bit++) {
        const uint32_t count = owners(config, bit);
        owned += count;
        apart = apart && (count <= 1U);
    }
    return apart && (owned == bits_taken(config)); /* fewer: a place lies beyond the frame's end */
}

uint16_t hg_e2e_modulus(const hg_e2e_config *config)
{
    uint16_t steps = 1U;
    if (is_j1850(config)) {
        steps = STEPS_J1850;
    } else if (is_h2f(config)) {
        steps = STEPS_H2F;
    } else {
        steps = (config->profile == HG_E2E_P05) ? STEPS_P05 : 1U;
    }
    return steps;
}

/* Shortest frame that holds every place, bytes. */
static bool length_good(const hg_e2e_config *config, uint8_t length)
{
    const uint16_t bits = (uint16_t)(8U * (uint16_t)length);
    const bool wide = config->profile == HG_E2E_P05;
    bool good = length <= HG_E2E_LENGTH_MAX;
    if (config->profile != HG_E2E_NONE) {
        good = good && ((config->crc + (wide ? 2U : 1U)) <= length) && (((uint32_t)config->counter + (wide ? 8U : 4U)) <= bits);
    }
    good = good && ((!has_nibble(config)) || (((uint32_t)config->nibble + 4U) <= bits));
    return good && ((config->stamp == HG_E2E_NO_STAMP) || (((uint32_t)config->stamp + 4U) <= bits));
}

/* ---- One frame ---- */

hg_status hg_e2e_protect(const hg_e2e_config *config, uint8_t *data, uint8_t length, uint8_t counter, uint8_t stamp)
{
    if (!length_good(config, length)) {
        return HG_E_FORMAT;
    }
    if (config->stamp != HG_E2E_NO_STAMP) {
        put_nibble(data, config->stamp, stamp);
    }
    if (config->profile != HG_E2E_NONE) {
        const uint8_t count = (uint8_t)(counter % hg_e2e_modulus(config));
        if (config->profile == HG_E2E_P05) {
            data[config->counter / 8U] = count;
        } else {
            put_nibble(data, config->counter, count);
        }
        if (has_nibble(config)) {
            put_nibble(data, config->nibble, (uint8_t)(config->data_id >> 8U));
        }
        const uint16_t sum = checksum(config, data, length, count);
        data[config->crc] = (uint8_t)(sum & 0xFFU);
        if (config->profile == HG_E2E_P05) {
            data[config->crc + 1U] = (uint8_t)(sum >> 8U);
        }
    }
    return HG_OK;
}

hg_status hg_e2e_check(const hg_e2e_config *config, const uint8_t *data, uint8_t length, hg_e2e_header *header)
{
    if (!length_good(config, length)) {
        return HG_E_FORMAT;
    }
    hg_e2e_header seen = {.stamp = 0U, .counter = 0U, .crc = 0U};
    bool good = true;
    if (config->stamp != HG_E2E_NO_STAMP) {
        seen.stamp = get_nibble(data, config->stamp);
    }
    if (config->profile != HG_E2E_NONE) {
        seen.counter = (config->profile == HG_E2E_P05) ? data[config->counter / 8U] : get_nibble(data, config->counter);
        good = seen.counter < hg_e2e_modulus(config); /* before the list of identifiers is read */
        seen.crc = good ? checksum(config, data, length, seen.counter) : 0U;
        if ((config->ignore & HG_E2E_IGNORE_CRC) == 0U) {
            good = good && (seen.crc == read_sum(config, data));
            good = good && ((!has_nibble(config)) || (get_nibble(data, config->nibble) == ((config->data_id >> 8U) & NIBBLE_MASK)));
        }
    }
    if (good) {
        *header = seen;
    }
    return good ? HG_OK : HG_E_CRC;
}

/* ---- One frame after another ---- */

void hg_e2e_receiver_start(hg_e2e_receiver *self)
{
    *self = (hg_e2e_receiver){.seen = false};
}

static bool counted(const hg_e2e_config *config)
{
    return (config->profile != HG_E2E_NONE) && ((config->ignore & HG_E2E_IGNORE_COUNTER) == 0U);
}

bool hg_e2e_repeated(const hg_e2e_config *config, const hg_e2e_receiver *self, const hg_e2e_header *header)
{
    return counted(config) && self->seen && (header->counter == self->counter) && (header->crc == self->crc) &&
           (header->stamp == self->stamp);
}

hg_status hg_e2e_sequence(const hg_e2e_config *config, hg_e2e_receiver *self, const hg_e2e_header *header, uint16_t step, hg_e2e_progress *progress)
{
    if (!counted(config)) {
        *progress = (hg_e2e_progress){.lost = 0U, .continues = false};
        return HG_OK;
    }
    if (hg_e2e_repeated(config, self, header)) {
        return HG_E_REPEATED;
    }
    const uint32_t modulus = hg_e2e_modulus(config);
    uint32_t moved = 1U;
    if (self->seen) {
        moved = ((header->counter + modulus) - self->counter) % modulus;
        moved = (moved == 0U) ? modulus : moved;
    }
    const bool jumped = (moved > step) || ((self->resync > 0U) && (moved != 1U));
    const bool refused = jumped || (self->resync > 0U);
    if (jumped) {
        self->resync = config->resync;
    } else if (refused) {
        self->resync--;
    } else {
        *progress = (hg_e2e_progress){.lost = (uint8_t)(moved - 1U), .continues = self->seen && (moved == 1U)};
    }
    self->counter = header->counter;
    self->crc = header->crc;
    self->stamp = header->stamp;
    self->seen = true;
    return refused ? HG_E_SEQUENCE : HG_OK;
}

/* ---- State machine ---- */

void hg_e2e_machine_start(hg_e2e_machine *self)
{
    *self = (hg_e2e_machine){.state = HG_E2E_NODATA};
}

static uint8_t ones(uint16_t bits)
{
    uint8_t count = 0U;
    for (uint16_t left = bits; left != 0U; left &= (uint16_t)(left - 1U)) {
        count++;
    }
    return count;
}

static void keep(hg_e2e_machine *self, uint8_t window)
{
    const uint16_t mask = (uint16_t)(((uint32_t)1U << window) - 1U);
    self->ok &= mask;
    self->error &= mask;
}

static bool enough(const hg_e2e_machine *self, const hg_e2e_limit *limit)
{
    return (ones(self->ok) >= limit->ok) && (ones(self->error) <= limit->error);
}

static void distrust(hg_e2e_machine *self, const hg_e2e_limits *limits)
{
    self->state = HG_E2E_INVALID;
    keep(self, limits->clear ? 0U : limits->invalid.window);
}

static void trust(hg_e2e_machine *self, const hg_e2e_limits *limits)
{
    self->state = HG_E2E_VALID;
    keep(self, limits->valid.window);
}

hg_e2e_state hg_e2e_machine_step(hg_e2e_machine *self, const hg_e2e_limits *limits, hg_status event)
{
    const bool error = (event == HG_E_CRC) || (event == HG_E_FORMAT);
    self->ok = (uint16_t)((uint16_t)(self->ok << 1U) | ((event == HG_OK) ? 1U : 0U));
    self->error = (uint16_t)((uint16_t)(self->error << 1U) | (error ? 1U : 0U));
    switch (self->state) {
    case HG_E2E_NODATA:
        keep(self, 0U); /* the window of INIT begins with INIT */
        if ((!error) && (event != HG_E_EMPTY)) {
            self->state = HG_E2E_INIT;
        }
        break;
    case HG_E2E_INIT:
        keep(self, limits->init.window);
        if (enough(self, &limits->init)) {
            trust(self, limits);
        } else if (ones(self->error) > limits->init.error) {
            distrust(self, limits);
        } else {
            /* not enough seen yet */
        }
        break;
    case HG_E2E_VALID:
        keep(self, limits->valid.window);
        if (!enough(self, &limits->valid)) {
            distrust(self, limits);
        }
        break;
    case HG_E2E_INVALID:
        keep(self, limits->invalid.window);
        if (enough(self, &limits->invalid)) {
            trust(self, limits);
        }
        break;
    case HG_E2E_DEINIT:
    default:
        self->ok = 0U;
        self->error = 0U;
        break;
    }
    return self->state;
}
