#include "hullguard/digest.h"

#include "hullguard/crc32c.h"

#include <stddef.h>

void hg_digest_start(hg_digest *self)
{
    *self = (hg_digest){.crc = 0U, .done = 0U, .skip = 0U, .left = 0U};
}

void hg_digest_open(hg_digest *self, uint32_t numbers)
{
    self->skip = self->done;
    self->left = numbers;
}

hg_status hg_digest_close(const hg_digest *self)
{
    /* Something is left of the call: the tables had no more. */
    return (self->left > 0U) ? HG_OK : HG_E_BUSY;
}

/* Of a table of so many numbers this call takes those from the result up to *end - 1. A table that is not there has none, whatever a wrong number says. */
static uint32_t window(hg_digest *self, bool there, uint32_t length, uint32_t *end)
{
    const uint32_t count = there ? length : 0U;
    const uint32_t first = (self->skip < count) ? self->skip : count;
    const uint32_t more = count - first;
    const uint32_t taken = (more < self->left) ? more : self->left;
    self->skip -= first;
    self->left -= taken;
    self->done += taken;
    *end = first + taken;
    return first;
}

void hg_digest_number(hg_digest *self, uint32_t x)
{
    hg_digest_masks(self, &x, 1U);
}

void hg_digest_bytes(hg_digest *self, const uint8_t *x, uint32_t count)
{
    uint32_t end;
    for (uint32_t i = window(self, x != NULL, count, &end); i < end; i++) {
        self->crc = hg_crc32c(self->crc, x[i], 1U);
    }
}

void hg_digest_halves(hg_digest *self, const uint16_t *x, uint32_t count)
{
    uint32_t end;
    for (uint32_t i = window(self, x != NULL, count, &end); i < end; i++) {
        self->crc = hg_crc32c(self->crc, x[i], 2U);
    }
}

void hg_digest_codes(hg_digest *self, const int32_t *x, uint32_t count)
{
    uint32_t end;
    for (uint32_t i = window(self, x != NULL, count, &end); i < end; i++) {
        self->crc = hg_crc32c(self->crc, (uint32_t)x[i], 4U);
    }
}

void hg_digest_masks(hg_digest *self, const uint32_t *x, uint32_t count)
{
    uint32_t end;
    for (uint32_t i = window(self, x != NULL, count, &end); i < end; i++) {
        self->crc = hg_crc32c(self->crc, x[i], 4U);
    }
}

void hg_digest_reals(hg_digest *self, const hg_real *x, uint32_t count)
{
    uint32_t end;
    for (uint32_t i = window(self, x != NULL, count, &end); i < end; i++) {
        self->crc = hg_crc32c_real(self->crc, x[i]);
    }
}

/* Small signed numbers and flags go as words of 32 bits. */
static uint32_t word(int8_t x)
{
    return (uint32_t)(int32_t)x;
}

static uint32_t flag(bool x)
{
    return x ? 1U : 0U;
}

/* ---- frames ---- */

static void edge(hg_digest *self, const hg_e2e_limit *limit)
{
    const uint8_t number[] = {limit->window, limit->ok, limit->error};
    hg_digest_bytes(self, number, (uint32_t)sizeof(number));
}

static void e2e(hg_digest *self, const hg_e2e_config *config)
{
    const uint32_t number[] = {
        (uint32_t)config->profile, (uint32_t)config->mode,   config->data_id, flag(config->data_ids != NULL), config->crc, config->ignore,
        config->counter,           config->nibble,           config->stamp,   config->resync,                 flag(config->limits->clear),
    };
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    hg_digest_bytes(self, config->data_ids, (config->data_ids != NULL) ? HG_E2E_IDS : 0U);
    edge(self, &config->limits->init);
    edge(self, &config->limits->valid);
    edge(self, &config->limits->invalid);
}

static void scales(hg_digest *self, const hg_code_scale *scale, uint8_t width)
{
    for (uint8_t g = 0U; (scale != NULL) && (g < width); g++) {
        const hg_real real[] = {scale[g].resolution, scale[g].offset, scale[g].per_unit};
        const uint32_t number[] = {word(scale[g].exponent), (uint32_t)scale[g].minimum, (uint32_t)scale[g].maximum};
        hg_digest_reals(self, real, (uint32_t)(sizeof(real) / sizeof(real[0])));
        hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    }
}

void hg_digest_message(hg_digest *self, const hg_message *message)
{
    const uint32_t number[] = {message->id, message->flags, message->length, message->width, flag(message->idle != NULL)};
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    hg_digest_bytes(self, message->idle, (message->idle != NULL) ? message->length : 0U);
    for (uint8_t g = 0U; (message->field != NULL) && (g < message->width); g++) {
        const uint16_t field[] = {message->field[g].start, message->field[g].length, message->field[g].flags};
        hg_digest_halves(self, field, (uint32_t)(sizeof(field) / sizeof(field[0])));
    }
    scales(self, message->scale, message->width);
    e2e(self, message->e2e);
}

/* ---- groups ---- */

static void trigger(hg_digest *self, const hg_trigger_config *config)
{
    const uint32_t number[] = {config->width, config->levels, config->interval_max};
    const uint32_t table = (uint32_t)config->levels * config->width;
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    hg_digest_bytes(self, config->silence, config->levels);
    hg_digest_halves(self, config->delta, table);
    hg_digest_codes(self, config->sigma, table);
    hg_digest_codes(self, config->activity, table);
    hg_digest_codes(self, config->zero, config->width);
}

static void hold(hg_digest *self, const hg_hold_config *config)
{
    const uint32_t width = config->trigger->width;
    trigger(self, config->trigger);
    hg_digest_number(self, config->margin);
    scales(self, config->scale, config->trigger->width);
    hg_digest_reals(self, config->half, width);
    hg_digest_reals(self, config->slew, ((uint32_t)config->trigger->interval_max + config->margin) * width);
    hg_digest_reals(self, config->span, width);
    hg_digest_reals(self, config->middle, width);
}

/* ---- what is derived, generators and their thresholds ---- */

static void matrix(hg_digest *self, const hg_matrix *m)
{
    const uint32_t number[] = {m->rows, m->cols, word(m->exponent)};
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    hg_digest_reals(self, m->data, (uint32_t)m->rows * m->cols);
}

static void predictor(hg_digest *self, const hg_predict_config *config)
{
    const uint32_t number[] = {config->group, config->first, config->order, config->width, config->inputs, config->horizon, config->settle};
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    hg_digest_bytes(self, config->input, config->inputs);
    hg_digest_reals(self, config->known, config->inputs);
    matrix(self, &config->correct);
    matrix(self, &config->state);
    matrix(self, &config->drive);
    matrix(self, &config->output);
    matrix(self, &config->direct);
    hg_digest_reals(self, config->fresh, config->width);
    hg_digest_reals(self, config->radius, (uint32_t)config->horizon * config->width);
}

static void mismatch(hg_digest *self, const hg_mismatch_config *config)
{
    const uint32_t number[] = {config->states, config->width, word(config->exponent)};
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    hg_digest_bytes(self, config->signal, config->width);
    hg_digest_reals(self, config->constant, config->states);
    hg_digest_reals(self, config->gain, (uint32_t)config->states * config->width);
}

void hg_digest_residual(hg_digest *self, const hg_residual_config *config)
{
    const uint32_t number[] = {config->order, config->residuals, config->width};
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    hg_digest_bytes(self, config->signal, config->width);
    matrix(self, &config->state);
    matrix(self, &config->input);
    matrix(self, &config->output);
    matrix(self, &config->direct);
}

void hg_digest_hull(hg_digest *self, const hg_hull_config *config)
{
    const uint32_t number[] = {
        config->residuals, config->width, word(config->exponent), config->settle, config->ready_rest, config->ready_moving, config->modes,
    };
    const uint32_t residuals = config->residuals;
    const uint32_t modes = config->modes;
    uint32_t lags = config->width; /* the tails */
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    hg_digest_bytes(self, config->signal, config->width);
    hg_digest_bytes(self, config->taps, config->width);
    for (uint8_t g = 0U; g < config->width; g++) {
        lags += config->taps[g];
    }
    hg_digest_reals(self, config->weight, lags * residuals);
    hg_digest_reals(self, config->rest, config->settle * residuals);
    hg_digest_reals(self, config->rest_left, residuals);
    hg_digest_reals(self, config->moving, config->settle * residuals);
    hg_digest_reals(self, config->moving_left, residuals);
    hg_digest_reals(self, config->bias, residuals);
    hg_digest_reals(self, config->decay, residuals);
    hg_digest_reals(self, config->mode_decay, modes);
    hg_digest_reals(self, config->mode_input, modes * config->width);
    hg_digest_reals(self, config->mode_output, residuals * modes);
    hg_digest_reals(self, config->mode_rest, modes);
    hg_digest_reals(self, config->mode_moving, modes);
}

#if HG_WITH_ZONOTOPE
static void zonotope(hg_digest *self, const hg_zonotope_config *config)
{
    const uint32_t number[] = {
        config->order,  config->residuals, config->width,   config->disturbances, config->initial,      config->columns,
        config->blocks, config->settle,    config->recover, config->ready_rest,   config->ready_moving, (uint32_t)config->reduction,
    };
    const uint32_t order = config->order;
    const uint32_t residuals = config->residuals;
    uint32_t state = 0U;
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    hg_digest_bytes(self, config->signal, config->width);
    hg_digest_bytes(self, config->block, config->blocks);
    for (uint8_t b = 0U; b < config->blocks; b++) {
        state += (uint32_t)config->block[b] * config->block[b];
    }
    hg_digest_reals(self, config->state, state);
    hg_digest_reals(self, config->input, config->width * order);
    hg_digest_reals(self, config->disturbance, config->disturbances * order);
    hg_digest_reals(self, config->rest, config->initial * order);
    hg_digest_reals(self, config->moving, config->initial * order);
    hg_digest_reals(self, config->output, residuals * order);
    hg_digest_reals(self, config->outer, residuals * order);
    hg_digest_reals(self, config->direct, residuals * config->width);
    hg_digest_reals(self, config->bias_rest, config->settle * residuals);
    hg_digest_reals(self, config->bias_moving, config->settle * residuals);
    hg_digest_reals(self, config->decay, config->blocks);
    hg_digest_reals(self, config->always, order);
    hg_digest_reals(self, config->growth, order);
    hg_digest_reals(self, config->output_growth, residuals);
}
#endif

static void bank(hg_digest *self, const hg_bank_config *config)
{
    const uint32_t number[] = {config->certificates, config->window, config->width, word(config->exponent), config->extras};
    const uint32_t rows = (uint32_t)config->window * config->certificates;
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    hg_digest_bytes(self, config->signal, config->width);
    hg_digest_reals(self, config->weight, rows * config->width);
    hg_digest_bytes(self, config->extra, config->extras);
    hg_digest_reals(self, config->extra_weight, rows * config->extras);
    hg_digest_reals(self, config->bias, config->certificates);
    hg_digest_reals(self, &config->widen, 1U);
}

/* ---- detector and node ---- */

static void detector(hg_digest *self, const hg_detector_config *config)
{
    for (uint8_t i = 0U; i < config->groups; i++) {
        hold(self, &config->hold[i]);
    }
    for (uint8_t i = 0U; (HG_WITH_PREDICT != 0) && (i < config->predictors); i++) {
        predictor(self, &config->predict[i]);
    }
    if ((HG_WITH_MISMATCH != 0) && (config->mismatch != NULL)) {
        mismatch(self, config->mismatch);
    }
    for (uint8_t g = 0U; g < config->generators; g++) {
        hg_digest_residual(self, &config->residual[g]);
        if (config->hull != NULL) {
            hg_digest_hull(self, &config->hull[g]);
        }
#if HG_WITH_ZONOTOPE
        if (config->zonotope != NULL) {
            zonotope(self, &config->zonotope[g]);
        }
#endif
    }
    for (uint8_t b = 0U; (HG_WITH_BANK != 0) && (b < config->banks); b++) {
        bank(self, &config->bank[b]);
    }
#if HG_WITH_POLYNOMIAL
    for (uint8_t p = 0U; p < config->polynomials; p++) {
        hg_digest_statistic(self, &config->polynomial[p]);
    }
#endif
    hg_digest_bytes(self, config->decision.feeds, config->decision.generators);
    hg_digest_masks(self, config->decision.faults, config->decision.generators);
}

static void freeze(hg_digest *self, const hg_freeze_config *config)
{
    const uint8_t number[] = {config->samples, config->after, config->burst};
    hg_digest_bytes(self, number, (uint32_t)sizeof(number));
    hg_digest_message(self, config->request);
    hg_digest_message(self, config->response);
}

uint32_t hg_digest_node_head(const hg_node_config *config)
{
    const hg_detector_config *d = config->detector;
    const bool hulls = (d->generators > 0U) && (d->hull != NULL);
    const uint32_t number[] = {
        config->closing, config->heartbeat, config->model_hash, flag(config->freeze != NULL),
        d->signals, d->width, d->groups, d->predictors, flag(d->mismatch != NULL),
        d->generators, flag(hulls), d->banks, d->polynomials, d->history, d->window,
        d->residuals, d->codes, d->reals, d->sums,
        d->decision.generators, d->decision.up, d->decision.down, flag(d->decision.latch),
    };
    uint32_t crc = 0U;
    for (uint8_t i = 0U; i < (uint8_t)(sizeof(number) / sizeof(number[0])); i++) {
        crc = hg_crc32c(crc, number[i], 4U);
    }
    return crc;
}

hg_status hg_digest_node(hg_digest *self, const hg_node_config *config, uint32_t head, uint32_t numbers)
{
    if (hg_digest_node_head(config) != head) {
        return HG_E_DIGEST; /* before any pointer is followed that may not be there */
    }
    hg_digest_open(self, numbers);
    hg_digest_number(self, head);
    for (uint8_t i = 0U; i < config->detector->groups; i++) {
        hg_digest_message(self, &config->message[i]);
    }
    hg_digest_message(self, config->verdict);
    hg_digest_message(self, config->status);
    if ((HG_WITH_FREEZE != 0) && (config->freeze != NULL)) {
        freeze(self, config->freeze);
    }
    detector(self, config->detector);
    return hg_digest_close(self);
}
