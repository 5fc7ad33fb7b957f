#include "hullguard/freeze.h"

#include "hullguard/crc32c.h"

#include <stddef.h>

#define LENGTH 8U      /* bytes of both frames */
#define COUNTER_BIT 8U /* as frame.h draws the node's own */
#define STAMP_BIT 12U
#define COUNTER_MASK 0x0FU
#define STAMP_MASK 0x0FU
#define BYTE_MASK 0xFFUL
#define FORMAT 1U
#define HEAD 3U     /* words before the samples */
#define ROW_HEAD 3U /* words of a sample before its numbers */
#define MISSED_MAX 63U

#if HG_REAL_Q31
#define TYPE 3U
#elif HG_REAL_F64
#define TYPE 2U
#else
#define TYPE 1U
#endif

static uint32_t reals_of(const hg_freeze *self)
{
    return HG_FREEZE_REALS(self->detector->config->width, self->detector->config->residuals);
}

static uint32_t words_of_row(const hg_freeze *self)
{
    return ROW_HEAD + (reals_of(self) * HG_REAL_WORDS);
}

static uint32_t words_of(const hg_freeze *self, uint8_t rows)
{
    return HEAD + (rows * words_of_row(self)) + 1U;
}

uint32_t hg_freeze_words(const hg_freeze *self)
{
    return words_of(self, self->held);
}

static bool message_valid(const hg_message *message)
{
    bool valid = (message != NULL) && hg_frame_valid(message);
    valid = valid && (message->length == LENGTH) && (message->width == 0U) && (message->e2e->profile == HG_E2E_P22);
    return valid && (message->e2e->crc == 0U) && (message->e2e->counter == COUNTER_BIT) && (message->e2e->stamp == STAMP_BIT);
}

hg_status hg_freeze_start(hg_freeze *self, const hg_freeze_config *config, const hg_freeze_memory *memory, const hg_detector *detector, uint32_t model_hash)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL) || (memory->row == NULL) || (memory->real == NULL) || (detector == NULL)) {
        return HG_E_ARGUMENT;
    }
    if ((config->samples < 1U) || (config->after >= config->samples) || (config->burst < 1U) || (!message_valid(config->request)) ||
        (!message_valid(config->response))) {
        return HG_E_CONFIG;
    }
    *self = (hg_freeze){.config = config, .detector = detector, .memory = *memory, .model_hash = model_hash, .state = HG_FREEZE_RECORDING};
    return (words_of(self, config->samples) <= HG_FREEZE_NO_WORD) ? HG_OK : HG_E_CONFIG;
}

/* ---- recording ---- */

static void put(hg_real *to, const hg_real *from, uint32_t count)
{
    for (uint32_t i = 0U; i < count; i++) {
        to[i] = from[i];
    }
}

static void record(hg_freeze *self, const hg_freeze_row *row)
{
    const hg_detector *detector = self->detector;
    const uint32_t width = detector->config->width;
    const uint32_t residuals = detector->config->residuals;
    const uint8_t samples = self->config->samples;
    /* Neither place nor count leaves the ring, whatever stands in a memory that failed. */
    self->newest = ((self->held == 0U) || (self->newest >= (samples - 1U))) ? 0U : (uint8_t)(self->newest + 1U);
    self->held = (self->held < samples) ? (uint8_t)(self->held + 1U) : samples;
    self->memory.row[self->newest] = *row;
    hg_real *real = &self->memory.real[self->newest * reals_of(self)];
    put(real, detector->value, width);
    put(&real[width], detector->radius, width);
    put(&real[2U * width], detector->r, residuals);
    put(&real[(2U * width) + residuals], detector->J, residuals);
}

/* Place in the ring of the row that so many others are older than. */
static uint32_t place_of(const hg_freeze *self, uint32_t older)
{
    const uint32_t samples = self->config->samples;
    return ((self->newest + 1U + (samples - self->held)) + older) % samples;
}

static uint32_t word_of_row(const hg_freeze *self, uint32_t older, uint32_t place)
{
    const uint32_t at = place_of(self, older);
    const hg_freeze_row *row = &self->memory.row[at];
    uint32_t word;
    if (place == 0U) {
        word = row->k;
    } else if (place == 1U) {
        word = (uint32_t)row->plant | ((uint32_t)row->basis << 8U) | ((uint32_t)row->bus << 16U);
    } else if (place == 2U) {
        word = row->candidates;
    } else {
        const uint32_t i = place - ROW_HEAD;
        const uint32_t number = i / HG_REAL_WORDS;
        word = hg_real_word(self->memory.real[(at * reals_of(self)) + number], (uint8_t)(i - (number * HG_REAL_WORDS)));
    }
    return word;
}

uint32_t hg_freeze_word(const hg_freeze *self, uint32_t place)
{
    const uint32_t last = hg_freeze_words(self) - 1U;
    uint32_t word;
    if (place == 0U) {
        word = FORMAT | ((uint32_t)TYPE << 8U) | ((uint32_t)self->record << 16U) | ((uint32_t)self->held << 24U);
    } else if (place == 1U) {
        word = self->model_hash;
    } else if (place == 2U) {
        const uint32_t alarm = (uint32_t)self->held - 1U - self->config->after;
        word = self->detector->config->width | (alarm << 8U) | ((uint32_t)self->detector->config->residuals << 16U);
    } else if (place < last) {
        word = word_of_row(self, (place - HEAD) / words_of_row(self), (place - HEAD) % words_of_row(self));
    } else {
        word = self->crc;
    }
    return word;
}

/* As many words as a sample has go into the checksum. */
static void sum(hg_freeze *self)
{
    const uint32_t last = hg_freeze_words(self) - 1U;
    for (uint32_t i = 0U; (i < words_of_row(self)) && (self->summed < last); i++) {
        self->crc = hg_crc32c(self->crc, hg_freeze_word(self, self->summed), 4U);
        self->summed++;
    }
    self->state = (self->summed < last) ? HG_FREEZE_CLOSING : HG_FREEZE_FROZEN;
}

void hg_freeze_step(hg_freeze *self, const hg_freeze_row *row)
{
    const bool confirmed = row->plant == HG_PLANT_CONFIRMED;
    const bool alarm = confirmed && (!self->confirmed);
    self->confirmed = confirmed;
    self->stamp = (uint8_t)(row->k & STAMP_MASK);
    self->credit = self->config->burst;
    if (self->state == HG_FREEZE_RECORDING) {
        record(self, row);
        if (alarm) {
            self->state = HG_FREEZE_CLOSING;
            self->rest = self->config->after;
            self->record++;
            self->crc = 0U;
            self->summed = 0U;
        }
    } else {
        self->missed = (alarm && (self->missed < MISSED_MAX)) ? (uint8_t)(self->missed + 1U) : self->missed;
        if (self->rest > 0U) {
            record(self, row);
            self->rest--;
        } else if (self->state == HG_FREEZE_CLOSING) {
            sum(self);
        } else {
            /* waits for its reader */
        }
    }
}

/* ---- requests ---- */

static hg_status turn_away(hg_freeze *self, hg_status status)
{
    self->refused = (self->refused < UINT16_MAX) ? (uint16_t)(self->refused + 1U) : UINT16_MAX;
    return status;
}

static hg_status obey(hg_freeze *self, const uint8_t *data)
{
    const uint32_t first = data[4] | ((uint32_t)data[5] << 8U);
    const uint32_t count = data[6] | ((uint32_t)data[7] << 8U);
    const bool there = (self->state == HG_FREEZE_FROZEN) && (data[3] == self->record);
    hg_status status = HG_E_NUMERIC;
    if (data[2] == HG_FREEZE_STATE) {
        status = HG_OK;
    } else if (data[2] == HG_FREEZE_READ) {
        const uint32_t words = there ? hg_freeze_words(self) : 0U;
        if (first < words) {
            self->next = first;
            self->end = ((count > 0U) && (count < (words - first))) ? (first + count) : words;
            status = HG_OK;
        } else {
            status = HG_E_STATE;
        }
    } else if (data[2] == HG_FREEZE_CLEAR) {
        if (there) {
            self->state = HG_FREEZE_RECORDING;
            self->held = 0U;
            self->missed = 0U;
            self->next = 0U;
            self->end = 0U;
            status = HG_OK;
        } else {
            status = HG_E_STATE;
        }
    } else {
        /* no such command */
    }
    return status;
}

hg_status hg_freeze_receive(hg_freeze *self, const hg_can_frame *frame)
{
    const hg_message *request = self->config->request;
    hg_e2e_header header;
    if ((frame->id != request->id) || (((frame->flags ^ request->flags) & HG_CAN_EXTENDED) != 0U)) {
        return HG_E_ID;
    }
    if (!hg_frame_matches(request, frame)) {
        return turn_away(self, HG_E_FORMAT);
    }
    if (hg_e2e_check(request->e2e, frame->data, frame->length, &header) != HG_OK) {
        return turn_away(self, HG_E_CRC);
    }
    const hg_status status = obey(self, frame->data);
    if (status != HG_E_NUMERIC) {
        self->answer = true;
        self->credit = self->config->burst;
    }
    return (status == HG_OK) ? HG_OK : turn_away(self, status);
}

/* ---- responses ---- */

static void respond(hg_freeze *self, uint32_t place, uint32_t word, hg_can_frame *frame)
{
    const hg_message *response = self->config->response;
    hg_frame_pack(response, NULL, frame); /* no fields: an empty frame of the message's kind and length */
    frame->data[2] = (uint8_t)(place & BYTE_MASK);
    frame->data[3] = (uint8_t)((place >> 8U) & BYTE_MASK);
    for (uint8_t i = 0U; i < 4U; i++) {
        const uint32_t shift = 8U * (uint32_t)i;
        frame->data[4U + i] = (uint8_t)((word >> shift) & BYTE_MASK);
    }
    (void)hg_e2e_protect(response->e2e, frame->data, frame->length, self->counter, self->stamp);
    self->counter = (self->counter + 1U) & COUNTER_MASK;
}

hg_status hg_freeze_report(hg_freeze *self, hg_can_frame *frame)
{
    if ((self->credit == 0U) || ((!self->answer) && (self->next >= self->end))) {
        return HG_E_EMPTY;
    }
    if (self->answer) {
        const uint32_t words = (self->state == HG_FREEZE_FROZEN) ? hg_freeze_words(self) : 0U;
        const uint32_t missed = (uint32_t)self->missed << 2U;
        respond(self, HG_FREEZE_NO_WORD, (uint32_t)self->state | missed | ((uint32_t)self->record << 8U) | (words << 16U), frame);
        self->answer = false;
    } else {
        respond(self, self->next, hg_freeze_word(self, self->next), frame);
        self->next++;
    }
    self->credit--;
    return HG_OK;
}
