#include "hullguard/hull.h"

#include "hullguard/linalg.h"

#include <stddef.h>

/* Without them a constant here, so that the compiler drops what is for modes alone. */
static uint8_t modes_of(const hg_hull_config *config)
{
    return (HG_WITH_MODES != 0) ? config->modes : 0U;
}

static uint8_t signals_of(const hg_hull_config *config)
{
    return HG_SIZE(HG_ONLY_READ, config->width);
}

static uint8_t residuals_of(const hg_hull_config *config)
{
    return HG_SIZE(HG_ONLY_RESIDUALS, config->residuals);
}

static bool tables_there(const hg_hull_config *config)
{
    return (config->signal != NULL) && (config->taps != NULL) && (config->weight != NULL) && (config->rest != NULL) &&
           (config->rest_left != NULL) && (config->moving != NULL) && (config->moving_left != NULL) && (config->bias != NULL) &&
           (config->decay != NULL);
}

static bool modes_valid(const hg_hull_config *config)
{
    bool valid = (config->modes == 0U) || ((HG_WITH_MODES != 0) && (config->mode_decay != NULL) && (config->mode_input != NULL) && (config->mode_output != NULL) &&
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
    valid = valid && HG_SIZE_FITS(HG_ONLY_RESIDUALS, config->residuals) && HG_SIZE_FITS(HG_ONLY_READ, config->width);
    valid = valid && ((HG_ONLY_IN_ORDER == 0U) || hg_linalg_in_order(config->signal, config->width));
    valid = valid && HG_SIZE_FITS(HG_ONLY_WIDTH, ring_width) && HG_SIZE_FITS(HG_ONLY_HISTORY, ring_length);
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
    for (uint8_t i = 0U; i < residuals_of(self->config); i++) {
        self->theta[i] = HG_REAL_ZERO;
    }
    for (uint8_t m = 0U; m < modes_of(self->config); m++) {
        self->mode[m] = ((how == HG_START_REST) ? self->config->mode_rest : self->config->mode_moving)[m];
    }
    self->k = 0U;
    self->how = how;
}

/* Sums for two residuals, which share what is read of the radii, or for one. */
typedef struct {
    hg_acc first;
    hg_acc second;
} hg_sums;

/* One radius, with weights that follow one another. Returns the next of them. */
static inline const hg_real *add_radius(hg_sums *sum, const hg_real *weight, hg_real radius, bool two)
{
    sum->first = hg_acc_mac(sum->first, weight[0], radius);
    if (two) {
        sum->second = hg_acc_mac(sum->second, weight[1], radius);
    }
    return two ? &weight[2] : &weight[1];
}

/* One signal, at lags whose radii follow one another in memory, `width` from one to the next. */
static inline const hg_real *add_lags(hg_sums *sum, const hg_real *weight, const hg_real *newest, int32_t width, uint8_t lags, bool two)
{
    const hg_real *next = weight;
    for (int32_t lag = 0; lag < (int32_t)lags; lag++) {
        next = add_radius(sum, next, newest[-(lag * width)], two);
    }
    return next;
}

/* All signals: the taps of each, then the radius that leaves them, which goes to the tail. Behind its first row the ring goes on with its last; there
   are two loops in each sample, so that all cost alike. `two` is a constant where this is called. */
static inline const hg_real *add_signals(hg_sums *sum, hg_sums *tail, const hg_real *weight, const hg_ring *ring, const hg_hull_config *config, bool two)
{
    const int32_t width = (int32_t)HG_SIZE(HG_ONLY_WIDTH, ring->width);
    const uint8_t rows = (uint8_t)(ring->newest + 1U);
    const hg_real *first = &ring->data[(int32_t)ring->newest * width];
    const hg_real *last = &ring->data[((int32_t)HG_SIZE(HG_ONLY_HISTORY, ring->length) - 1) * width];
    const hg_real *next = weight;
    for (uint8_t g = 0U; g < signals_of(config); g++) {
        const uint8_t signal = (HG_ONLY_IN_ORDER == 0U) ? config->signal[g] : g;
        const uint8_t taps = config->taps[g];
        const hg_real *leaving = &first[signal];
        if (taps > 0U) {
            const uint8_t lags = (taps < rows) ? taps : rows;
            const uint8_t more = (uint8_t)(taps - lags);
            next = add_lags(sum, next, leaving, width, lags, two);
            next = add_lags(sum, next, &last[signal], width, more, two);
            leaving = (taps < rows) ? &first[(int32_t)signal - ((int32_t)taps * width)] : &last[(int32_t)signal - ((int32_t)more * width)];
        }
        next = add_radius(tail, next, *leaving, two);
    }
    return next;
}

/* What the initial state and the disturbances add at this sample; what is left of the initial state goes over into theta. */
static const hg_real *bias_step(hg_hull *self)
{
    const hg_hull_config *config = self->config;
    const bool rest = self->how == HG_START_REST;
    const hg_real *bias = config->bias;
    if (self->k < config->settle) {
        bias = &(rest ? config->rest : config->moving)[(uint32_t)self->k * residuals_of(config)];
    } else if (self->k == config->settle) {
        for (uint8_t i = 0U; i < residuals_of(config); i++) {
            const hg_real left = (rest ? config->rest_left : config->moving_left)[i];
            self->theta[i] = hg_real_min(hg_real_add(self->theta[i], left), HG_REAL_MAX);
        }
    } else {
        /* settled */
    }
    return bias;
}

/* What lies behind the taps moves on by one sample, mode by mode. */
static void move_modes(hg_hull *self, const hg_ring *ring)
{
    const hg_hull_config *config = self->config;
    const hg_real *input = config->mode_input;
    for (uint8_t m = 0U; m < modes_of(config); m++) {
        hg_acc sum = hg_acc_zero();
        for (uint8_t g = 0U; g < signals_of(config); g++) {
            sum = hg_acc_mac(sum, *input, hg_ring_row(ring, config->taps[g])[config->signal[g]]);
            input = &input[1];
        }
        const hg_real kept = hg_real_mul(config->mode_decay[m], self->mode[m]);
        self->mode[m] = hg_real_min(hg_real_add(kept, hg_acc_real(sum, config->exponent)), HG_REAL_MAX);
    }
}

/* The same of one residual. Returns J, to which the modes are added. */
static hg_real finish(hg_hull *self, uint8_t i, hg_acc sum, hg_acc leaving, hg_real bias)
{
    const hg_hull_config *config = self->config;
    const hg_real kept = hg_real_mul(config->decay[i], self->theta[i]);
    /* Held finite: an infinite theta would never heal. */
    self->theta[i] = hg_real_min(hg_real_add(kept, hg_acc_real(leaving, config->exponent)), HG_REAL_MAX);
    hg_acc total = sum;
    for (uint8_t m = 0U; m < modes_of(config); m++) {
        total = hg_acc_mac(total, config->mode_output[((uint16_t)i * config->modes) + m], self->mode[m]);
    }
    return hg_real_min(hg_real_add(hg_real_add(bias, hg_acc_real(total, config->exponent)), self->theta[i]), HG_REAL_MAX);
}

void hg_hull_step(hg_hull *self, const hg_ring *ring, hg_real *J)
{
    const hg_hull_config *config = self->config;
    const hg_real *weight = config->weight;
    const hg_real *bias = bias_step(self);
    move_modes(self, ring);
    const uint8_t residuals = residuals_of(config);
    for (uint16_t i = 0U; i < residuals; i += 2U) {
        const bool two = (i + 1U) < residuals;
        hg_sums sum = {.first = hg_acc_zero(), .second = hg_acc_zero()};
        hg_sums tail = sum;
        weight = two ? add_signals(&sum, &tail, weight, ring, config, true) : add_signals(&sum, &tail, weight, ring, config, false);
        J[i] = finish(self, (uint8_t)i, sum.first, tail.first, bias[i]);
        if (two) {
            J[i + 1U] = finish(self, (uint8_t)(i + 1U), sum.second, tail.second, bias[i + 1U]);
        }
    }
    self->k = (self->k < UINT16_MAX) ? (uint16_t)(self->k + 1U) : UINT16_MAX;
}
