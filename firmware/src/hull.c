#include "hullguard/hull.h"

#include <stddef.h>

static bool tables_there(const hg_hull_config *config)
{
    return (config->signal != NULL) && (config->taps != NULL) && (config->weight != NULL) && (config->rest != NULL) &&
           (config->rest_left != NULL) && (config->moving != NULL) && (config->moving_left != NULL) && (config->bias != NULL) &&
           (config->decay != NULL);
}

static bool modes_valid(const hg_hull_config *config)
{
    bool valid = (config->modes == 0U) || ((config->mode_decay != NULL) && (config->mode_input != NULL) && (config->mode_output != NULL) &&
                                           (config->mode_rest != NULL) && (config->mode_moving != NULL));
    for (uint8_t m = 0U; valid && (m < config->modes); m++) {
        valid = (config->mode_decay[m] >= HG_REAL_ZERO) && (config->mode_decay[m] < HG_REAL_C(1.0));
    }
    return valid;
}

bool hg_hull_valid(const hg_hull_config *config, uint8_t ring_width, uint8_t ring_length)
{
    bool valid = (config->residuals >= 1U) && (config->width >= 1U) && (config->settle >= 1U) && (config->settle < UINT16_MAX) &&
                 hg_exponent_valid(config->exponent) && tables_there(config) && modes_valid(config);
    for (uint8_t g = 0U; valid && (g < config->width); g++) {
        valid = (config->signal[g] < ring_width) && (config->taps[g] < ring_length);
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
    self->mode = &memory[config->residuals];
    hg_hull_reset(self, how);
    return HG_OK;
}

void hg_hull_reset(hg_hull *self, hg_start how)
{
    for (uint8_t i = 0U; i < self->config->residuals; i++) {
        self->theta[i] = HG_REAL_ZERO;
    }
    for (uint8_t m = 0U; m < self->config->modes; m++) {
        self->mode[m] = ((how == HG_START_REST) ? self->config->mode_rest : self->config->mode_moving)[m];
    }
    self->k = 0U;
    self->how = how;
}

/* Sums for two residuals, which share what is read of the radii, or for one. */
typedef struct {
    hg_acc first;
    hg_acc second;
} hg_hull_pair;

/* One radius, with weights that follow one another. Returns the next of them. */
static inline const hg_real *add_radius(hg_hull_pair *sum, const hg_real *weight, hg_real radius, bool two)
{
    sum->first = hg_acc_mac(sum->first, weight[0], radius);
    if (two) {
        sum->second = hg_acc_mac(sum->second, weight[1], radius);
    }
    return two ? &weight[2] : &weight[1];
}

/* `lags` radii, one a sample, back from this place on. */
static inline const hg_real *add_lags(hg_hull_pair *sum, const hg_real *weight, const hg_real *data, uint32_t newest, uint8_t lags, uint8_t stride,
                                      bool two)
{
    const uint32_t end = (uint32_t)lags * stride;
    const hg_real *next = weight;
    hg_hull_pair own = *sum;
    for (uint32_t back = 0U; back < end; back += stride) {
        next = add_radius(&own, next, data[newest - back], two);
    }
    *sum = own;
    return next;
}

/* All taps of one signal, then the radius that leaves them, which goes to the tail. `two` is a constant where this is called. */
static inline const hg_real *add_signal(hg_hull_pair *sum, hg_hull_pair *tail, const hg_real *weight, const hg_ring *ring, uint8_t signal,
                                        uint8_t taps, bool two)
{
    const uint8_t stride = ring->width;
    const uint8_t rows = (uint8_t)(ring->newest + 1U); /* from the newest back to where the ring wraps */
    const uint32_t newest = ((uint32_t)ring->newest * stride) + signal;
    const hg_real *next;
    uint32_t leaving;
    if (taps < rows) {
        next = add_lags(sum, weight, ring->data, newest, taps, stride, two);
        leaving = newest - ((uint32_t)taps * stride);
    } else {
        const uint32_t last = (((uint32_t)ring->length - 1U) * stride) + signal;
        const uint8_t behind = (uint8_t)(taps - rows);
        next = add_lags(sum, weight, ring->data, newest, rows, stride, two);
        next = add_lags(sum, next, ring->data, last, behind, stride, two);
        leaving = last - ((uint32_t)behind * stride);
    }
    return add_radius(tail, next, ring->data[leaving], two);
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

/* The bound on all lags behind the taps moves on by one sample. */
static hg_real move_tail(hg_hull *self, uint8_t i, hg_acc leaving)
{
    const hg_real kept = hg_real_mul(self->config->decay[i], self->theta[i]);
    /* Held finite: an infinite theta would never heal. */
    self->theta[i] = hg_real_min(hg_real_add(kept, hg_acc_real(leaving, self->config->exponent)), HG_REAL_MAX);
    return self->theta[i];
}

/* The same of the modes. */
static void move_modes(hg_hull *self, const hg_ring *ring)
{
    const hg_hull_config *config = self->config;
    const hg_real *input = config->mode_input;
    for (uint8_t m = 0U; m < config->modes; m++) {
        hg_acc sum = hg_acc_zero();
        for (uint8_t g = 0U; g < config->width; g++) {
            sum = hg_acc_mac(sum, *input, hg_ring_row(ring, config->taps[g])[config->signal[g]]);
            input = &input[1];
        }
        const hg_real kept = hg_real_mul(config->mode_decay[m], self->mode[m]);
        self->mode[m] = hg_real_min(hg_real_add(kept, hg_acc_real(sum, config->exponent)), HG_REAL_MAX);
    }
}

/* Threshold of one residual from its sum over the taps; the modes are added to it. */
static hg_real joined(const hg_hull *self, uint8_t i, hg_acc sum, hg_real bias, hg_real theta)
{
    const hg_hull_config *config = self->config;
    hg_acc total = sum;
    for (uint8_t m = 0U; m < config->modes; m++) {
        total = hg_acc_mac(total, config->mode_output[((uint16_t)i * config->modes) + m], self->mode[m]);
    }
    return hg_real_min(hg_real_add(hg_real_add(bias, hg_acc_real(total, config->exponent)), theta), HG_REAL_MAX);
}

void hg_hull_step(hg_hull *self, const hg_ring *ring, hg_real *J)
{
    const hg_hull_config *config = self->config;
    const hg_real *weight = config->weight;
    const hg_real *bias = bias_step(self);
    uint8_t i = 0U;
    move_modes(self, ring);
    while ((uint8_t)(i + 1U) < config->residuals) {
        hg_hull_pair sum = {.first = hg_acc_zero(), .second = hg_acc_zero()};
        hg_hull_pair tail = sum;
        for (uint8_t g = 0U; g < config->width; g++) {
            weight = add_signal(&sum, &tail, weight, ring, config->signal[g], config->taps[g], true);
        }
        J[i] = joined(self, i, sum.first, bias[i], move_tail(self, i, tail.first));
        J[i + 1U] = joined(self, (uint8_t)(i + 1U), sum.second, bias[i + 1U], move_tail(self, (uint8_t)(i + 1U), tail.second));
        i += 2U;
    }
    if (i < config->residuals) {
        hg_hull_pair sum = {.first = hg_acc_zero(), .second = hg_acc_zero()};
        hg_hull_pair tail = sum;
        for (uint8_t g = 0U; g < config->width; g++) {
            weight = add_signal(&sum, &tail, weight, ring, config->signal[g], config->taps[g], false);
        }
        J[i] = joined(self, i, sum.first, bias[i], move_tail(self, i, tail.first));
    }
    self->k = (self->k < UINT16_MAX) ? (uint16_t)(self->k + 1U) : UINT16_MAX;
}

bool hg_hull_ready(const hg_hull *self)
{
    const uint16_t needed = (self->how == HG_START_REST) ? self->config->ready_rest : self->config->ready_moving;
    return self->k >= needed;
}
