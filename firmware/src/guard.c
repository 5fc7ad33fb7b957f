#include "hullguard/guard.h"

#include <stdbool.h>
#include <stddef.h>

#define WORD_BYTES 4U
#define BYTE_BITS 8U
#define WORD_BITS 32U

/* Not zero: a seal that was never made does not fit a memory that was never written. */
#define START ((uint32_t)0x9E3779B9UL)

static bool here(const hg_guard *self, const uint8_t *memory, uint32_t bytes)
{
    return (self != NULL) && (memory != NULL) && (bytes > 0U);
}

static uint32_t joined(uint32_t sum, uint32_t word)
{
    /* To the right: to the left, bit 31 of a word and bit 0 of the next, neighbours in memory, would cancel. */
    return ((sum >> 1U) | (sum << (WORD_BITS - 1U))) ^ word;
}

static uint32_t word_at(const uint8_t *memory)
{
    return (uint32_t)memory[0] | ((uint32_t)memory[1] << BYTE_BITS) | ((uint32_t)memory[2] << (2U * BYTE_BITS)) | ((uint32_t)memory[3] << (3U * BYTE_BITS));
}

/* Both steps, rotation and XOR, can be undone: sums that differ somewhere differ at the end, unless a later word undoes it. */
static uint32_t sum_of(const uint8_t *memory, uint32_t bytes)
{
    uint32_t sum = START ^ bytes; /* another length has another sum */
    uint32_t at = 0U;
    for (; (bytes - at) >= WORD_BYTES; at += WORD_BYTES) {
        sum = joined(sum, word_at(&memory[at]));
    }
    uint8_t rest[WORD_BYTES] = {0U, 0U, 0U, 0U};
    for (uint32_t i = 0U; (at + i) < bytes; i++) {
        rest[i] = memory[at + i];
    }
    return joined(sum, word_at(rest));
}

hg_status hg_guard_seal(hg_guard *self, const uint8_t *memory, uint32_t bytes)
{
    if (!here(self, memory, bytes)) {
        return HG_E_ARGUMENT;
    }
    self->sum = sum_of(memory, bytes);
    return HG_OK;
}

hg_status hg_guard_check(const hg_guard *self, const uint8_t *memory, uint32_t bytes)
{
    if (!here(self, memory, bytes)) {
        return HG_E_ARGUMENT;
    }
    return (sum_of(memory, bytes) == self->sum) ? HG_OK : HG_E_DIGEST;
}
