#include "hullguard/hull.h"

#include <stddef.h>

static bool tables_there(const hg_hull_config *config)
{
    return (config->signal != NULL) && (config->taps != NULL) && (config->weight != NULL) && (config->rest != NULL) &&
           (config->rest_left != NULL) && (config->moving != NULL) && (config->moving_left != NULL) && (config->bias != NULL) &&
           (config->decay != NULL) && (config->tail != NULL);
}

bool hg_hull_valid(const hg_hull_config *config, uint8_t ring_width, uint8_t ring_length)
{
    bool valid = (config->residuals >= 1U) && (config->width >= 1U) && (config->settle >= 1U) && (config->settle < UINT16_MAX) &&
                 hg_exponent_valid(config->exponent) && tables_there(config);
    for (uint8_t g = 0U; valid && (g < config->width); g++) {
        valid = (config->signal[g] < ring_width) && (config->taps[g] >= 1U) && (config->taps[g] < ring_length);
    }
    for (uint8_t i = 0U; valid && (i < config->residuals); i++) {
        valid = (config->decay[i] >= HG_REAL_ZERO) && (config->decay[i] < HG_REAL_C(1.0));
    }
    return valid;
}

hg_status hg_hull_start(hg_hull *self, const hg_hull_config *config, const hg_ring *ring, hg_start how, hg_real *memory)
{
    if ((self == NULL) || (config == NULL) || (ring == NULL) || (memory == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!hg_hull_valid(config, ring->width, ring->length)) {
        return HG_E_CONFIG;
    }
    self->config = config;
    self->theta = memory;
    hg_hull_reset(self, how);
    return HG_OK;
}

void hg_hull_reset(hg_hull *self, hg_start how)
{
    for (uint8_t i = 0U; i < self->config->residuals; i++) {
        self->theta[i] = HG_REAL_ZERO;
    }
    self->k = 0U;
    self->how = how;
}

/* Numbers from the newest sample of the ring's first signal back to the one of a signal `lag` samples ago, wrapped around. */
static uint16_t place_of(const hg_ring *ring, uint8_t lag)
{
    const uint16_t row = (ring->newest >= lag) ? (uint16_t)(ring->newest - lag) : (uint16_t)((ring->newest + ring->length) - lag);
    return (uint16_t)(row * ring->width);
}

/* The bound on all lags behind the taps moves on by one sample. */
static void tail_step(hg_hull *self, const hg_ring *ring)
{
    const hg_hull_config *config = self->config;
    const hg_real *tail = config->tail;
    for (uint8_t i = 0U; i < config->residuals; i++) {
        hg_acc sum = hg_acc_zero();
        for (uint8_t g = 0U; g < config->width; g++) {
            sum = hg_acc_mac(sum, *tail, ring->data[place_of(ring, config->taps[g]) + config->signal[g]]);
            tail++;
        }
        const hg_real kept = hg_real_mul(config->decay[i], self->theta[i]);
        /* Held finite: an infinite theta would never heal. */
        self->theta[i] = hg_real_min(hg_real_add(kept, hg_acc_real(sum, config->exponent)), HG_REAL_MAX);
    }
}

/* Two residuals share what is read of the radii: a third of all that a threshold costs. */
typedef struct {
    const hg_real *weight; /* what is still to be used */
    hg_acc         first;
    hg_acc         second;
} hg_pair;

/* `lags` samples from place `at` of the ring backwards. */
static void add_pair(hg_pair *pair, const hg_ring *ring, uint16_t at, uint8_t lags)
{
    const hg_real *weight = pair->weight;
    hg_acc first = pair->first;
    hg_acc second = pair->second;
    uint16_t place = at;
    for (uint8_t left = lags; left > 0U; left--) {
        const hg_real radius = ring->data[place];
        first = hg_acc_mac(first, weight[0], radius);
        second = hg_acc_mac(second, weight[1], radius);
        weight = &weight[2];
        place = (uint16_t)(place - ring->width); /* wraps below 0 after the last one, which is not read then */
    }
    pair->weight = weight;
    pair->first = first;
    pair->second = second;
}

static void add_one(hg_pair *pair, const hg_ring *ring, uint16_t at, uint8_t lags)
{
    uint16_t place = at;
    for (uint8_t left = lags; left > 0U; left--) {
        pair->first = hg_acc_mac(pair->first, *pair->weight, ring->data[place]);
        pair->weight = &pair->weight[1];
        place = (uint16_t)(place - ring->width);
    }
}

/* All taps of one signal; `two` residuals or one. The ring may wrap in between. */
static void add_signal(hg_pair *pair, const hg_ring *ring, uint8_t signal, uint8_t taps, bool two)
{
    const uint8_t here = (taps <= ring->newest) ? taps : (uint8_t)(ring->newest + 1U);
    const uint16_t newest = (uint16_t)((ring->newest * ring->width) + signal);
    const uint16_t last = (uint16_t)(((ring->length - 1U) * ring->width) + signal);
    if (two) {
        add_pair(pair, ring, newest, here);
        add_pair(pair, ring, last, (uint8_t)(taps - here));
    } else {
        add_one(pair, ring, newest, here);
        add_one(pair, ring, last, (uint8_t)(taps - here));
    }
}

/* What the initial state and the disturbances add at this sample; what is left of the initial state goes over into theta. */
static const hg_real *bias_step(hg_hull *self)
{
    const hg_hull_config *config = self->config;
    const bool rest = self->how == HG_START_REST;
    const hg_real *bias = config->bias;
    if (self->k < config->settle) {
        bias = &(rest ? config->rest : config->moving)[(uint32_t)self->k * config->residuals];
    } else if (self->k == config->settle) {
        for (uint8_t i = 0U; i < config->residuals; i++) {
            const hg_real left = (rest ? config->rest_left : config->moving_left)[i];
            self->theta[i] = hg_real_min(hg_real_add(self->theta[i], left), HG_REAL_MAX);
        }
    } else {
        /* settled */
    }
    return bias;
}

void hg_hull_step(hg_hull *self, const hg_ring *ring, hg_real *J)
{
    const hg_hull_config *config = self->config;
    hg_pair pair = {.weight = config->weight, .first = hg_acc_zero(), .second = hg_acc_zero()};
    tail_step(self, ring);
    const hg_real *bias = bias_step(self);
    for (uint8_t i = 0U; i < config->residuals; i += 2U) {
        const bool two = (uint8_t)(i + 1U) < config->residuals;
        pair.first = hg_acc_zero();
        pair.second = hg_acc_zero();
        for (uint8_t g = 0U; g < config->width; g++) {
            add_signal(&pair, ring, config->signal[g], config->taps[g], two);
        }
        const hg_real sum[2] = {hg_acc_real(pair.first, config->exponent), hg_acc_real(pair.second, config->exponent)};
        for (uint8_t n = 0U; n < (two ? 2U : 1U); n++) {
            const hg_real whole = hg_real_add(hg_real_add(bias[i + n], sum[n]), self->theta[i + n]);
            J[i + n] = hg_real_min(whole, HG_REAL_MAX);
        }
    }
    self->k = (self->k < UINT16_MAX) ? (uint16_t)(self->k + 1U) : UINT16_MAX;
}

bool hg_hull_ready(const hg_hull *self)
{
    const uint16_t needed = (self->how == HG_START_REST) ? self->config->ready_rest : self->config->ready_moving;
    return self->k >= needed;
}
