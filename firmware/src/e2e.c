#include "hullguard/e2e.h"

#define COUNTER_MASK 0x0FU
#define START 0xFFU
#define FINAL_XOR 0xFFU

static uint8_t crc_byte(uint8_t crc, uint8_t byte)
{
    /* CRC-8H2F by nibbles: remainder of n x^4 by x^8 + x^5 + x^3 + x^2 + x + 1. 16 bytes of flash instead of 256. */
    static const uint8_t nibble[16] = {0x00U, 0x2FU, 0x5EU, 0x71U, 0xBCU, 0x93U, 0xE2U, 0xCDU,
                                       0x57U, 0x78U, 0x09U, 0x26U, 0xEBU, 0xC4U, 0xB5U, 0x9AU};
    uint8_t sum = crc ^ byte;
    sum = (uint8_t)((uint8_t)(sum << 4U) ^ nibble[sum >> 4U]);
    return (uint8_t)((uint8_t)(sum << 4U) ^ nibble[sum >> 4U]);
}

static bool length_good(uint8_t length)
{
    return (length >= HG_E2E_P22_HEADER) && (length <= HG_E2E_P22_LENGTH);
}

uint8_t hg_e2e_p22_crc(const uint8_t *data, uint8_t length, const uint8_t *data_id)
{
    uint8_t crc = START;
    for (uint8_t i = 1U; i < length; i++) {
        crc = crc_byte(crc, data[i]);
    }
    crc = crc_byte(crc, data_id[data[1] & COUNTER_MASK]);
    return crc ^ FINAL_XOR;
}

hg_status hg_e2e_p22_protect(uint8_t *data, uint8_t length, const uint8_t *data_id, uint8_t counter, uint8_t stamp)
{
    if (!length_good(length)) {
        return HG_E_FORMAT;
    }
    data[1] = (uint8_t)((uint8_t)(stamp << 4U) | (counter & COUNTER_MASK));
    data[0] = hg_e2e_p22_crc(data, length, data_id);
    return HG_OK;
}

void hg_e2e_receiver_start(hg_e2e_receiver *self)
{
    self->counter = 0U;
    self->crc = 0U;
    self->seen = false;
}

hg_status hg_e2e_p22_receive(hg_e2e_receiver *self, const uint8_t *data, uint8_t length, const uint8_t *data_id, hg_e2e_header *header)
{
    if (!length_good(length)) {
        return HG_E_FORMAT;
    }
    if (data[0] != hg_e2e_p22_crc(data, length, data_id)) {
        return HG_E_CRC;
    }
    const uint8_t counter = data[1] & COUNTER_MASK;
    const uint8_t moved = (uint8_t)((counter - self->counter) & COUNTER_MASK);
    if (self->seen && (moved == 0U) && (data[0] == self->crc)) {
        return HG_E_REPEATED;
    }
    header->stamp = data[1] >> 4U;
    header->counter = counter;
    header->lost = self->seen ? (uint8_t)((moved - 1U) & COUNTER_MASK) : 0U;
    self->counter = counter;
    self->crc = data[0];
    self->seen = true;
    return HG_OK;
}
