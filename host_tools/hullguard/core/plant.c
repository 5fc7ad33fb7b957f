#include "host.h"

#include <math.h>
#include <string.h>

#define TWO_PI 6.283185307179586

#if HG_REAL_Q31
hg_real hgh_real(double x, int32_t unit)
{
    const double steps = ldexp(x, 31 - unit);
    return (fabs(steps) < (double)INT32_MAX) ? (hg_real)llround(steps) : (hg_real)((steps < 0.0) ? -INT32_MAX : INT32_MAX);
}

double hgh_number(hg_real x, int32_t unit)
{
    return ldexp((double)x, unit - 31);
}
#else
hg_real hgh_real(double x, int32_t unit)
{
    (void)unit;
    return (hg_real)x;
}

double hgh_number(hg_real x, int32_t unit)
{
    (void)unit;
    return (double)x;
}
#endif

static uint64_t mix(uint64_t z)
{
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
}

void hgh_random_start(hgh_random *self, uint64_t seed, uint64_t run, uint64_t purpose)
{
    self->state = mix(mix(mix(seed + 0x9E3779B97F4A7C15ULL) + run) + purpose);
}

double hgh_random_unit(hgh_random *self)
{
    self->state += 0x9E3779B97F4A7C15ULL;
    return (double)(mix(self->state) >> 11) * 0x1p-53;
}

double hgh_random_signed(hgh_random *self)
{
    return 2.0 * hgh_random_unit(self) - 1.0;
}

void hgh_faults_start(hgh_faults *self, const hgh_fault *fault, int32_t count, double sample_time_s, uint64_t seed, uint64_t run)
{
    memset(self, 0, sizeof *self);
    self->count = count;
    self->sample_time_s = sample_time_s;
    for (int32_t i = 0; i < count; i++) {
        self->active[i].fault = fault[i];
        hgh_random_start(&self->active[i].random, seed, run, 100U + (uint64_t)i);
    }
}

static double damaged(hgh_active *a, double sample_time_s, int64_t k, double value)
{
    switch (a->fault.kind) {
    case HGH_BIAS:
        return value + a->fault.size;
    case HGH_DRIFT:
        return value + a->fault.size * sample_time_s * (double)(k - a->fault.start + 1);
    case HGH_GAIN:
        return value * a->fault.size;
    case HGH_NOISE:
        return value + a->fault.size * hgh_random_signed(&a->random);
    default: /* HGH_FREEZE: the last good value */
        if (!a->held) {
            a->frozen = value;
        }
        a->held = true;
        return a->frozen;
    }
}

double hgh_faults_apply(hgh_faults *self, int32_t actuator, int32_t signal, int64_t k, double value)
{
    for (int32_t i = 0; i < self->count; i++) {
        hgh_active *a = &self->active[i];
        if ((a->fault.signal == signal) && (a->fault.actuator == actuator)) {
            if ((k >= a->fault.start) && (k < a->fault.end)) {
                value = damaged(a, self->sample_time_s, k, value);
            } else if (a->fault.kind == HGH_FREEZE) {
                a->frozen = value;
                a->held = k < a->fault.start;
            } else {
                /* before or after */
            }
        }
    }
    return value;
}

void hgh_plant_start(hgh_plant *self, const hgh_plant_config *config, hgh_reference reference, const hgh_fault *fault, int32_t count,
                     uint64_t seed, uint64_t run)
{
    hgh_random initial;
    memset(self, 0, sizeof *self);
    self->config = config;
    self->reference = reference;
    hgh_faults_start(&self->faults, fault, count, config->sample_time_s, seed, run);
    hgh_random_start(&initial, seed, run, 1U);
    hgh_random_start(&self->disturbance, seed, run, 2U);
    hgh_random_start(&self->drive, seed, run, 3U);
    for (int32_t i = 0; i < config->n; i++) {
        self->x[i] = config->equilibrium[i] + config->initial_range[i] * hgh_random_signed(&initial);
    }
#if !HG_REAL_Q31
    if (config->nonlinear != NULL) {
        hgh_nonlinear_start(config->nonlinear, config->n, &initial, self->x);
    }
#endif
    if (reference.kind == HGH_MIXED) {
        self->reference.kind = HGH_STEPS + (int32_t)(3.0 * hgh_random_unit(&self->drive));
        self->reference.period = 2 + (int32_t)((double)reference.period * (0.25 + 1.5 * hgh_random_unit(&self->drive)));
    }
}

/* Reference of input i at the open sample, within -1 .. 1. */
static double drive(hgh_plant *self, int32_t i)
{
    const int64_t period = self->reference.period;
    const int64_t phase = self->k % period;
    if (self->reference.kind == HGH_REST) {
        return 0.0;
    }
    if (self->reference.kind == HGH_SINES) {
        if (self->k == 0) {
            self->from[i] = hgh_random_unit(&self->drive);
        }
        return sin(TWO_PI * ((double)phase / (double)period + self->from[i]));
    }
    if (phase == 0) {
        self->from[i] = self->to[i];
        self->to[i] = hgh_random_signed(&self->drive);
    }
    if (self->reference.kind == HGH_STEPS) {
        return self->to[i];
    }
    return self->from[i] + (self->to[i] - self->from[i]) * (double)phase / (double)period;
}

static double row(const double *matrix, int32_t i, int32_t cols, const double *x)
{
    double sum = 0.0;
    for (int32_t j = 0; j < cols; j++) {
        sum += matrix[i * cols + j] * x[j];
    }
    return sum;
}

/* Command of input i, within its range; what the plant applies where it applies what the wire carries. */
static double command(hgh_plant *self, int32_t i)
{
    const hgh_plant_config *c = self->config;
    double u = c->held[i] + fmin(self->reference.amplitude, c->reference_bound[i]) * drive(self, i);
    if (c->gain != NULL) {
        for (int32_t j = 0; j < c->n; j++) {
            u -= c->gain[i * c->n + j] * (self->x[j] - c->equilibrium[j]);
        }
    }
    const double low = hgh_number(hg_code_value(&c->scale[i], c->scale[i].minimum), c->unit[i]);
    const double high = hgh_number(hg_code_value(&c->scale[i], c->scale[i].maximum), c->unit[i]);
    u = fmin(fmax(u, low), high);
    return (c->as_sent[i] != 0) ? hgh_number(hg_code_value(&c->scale[i], hg_code_encode(&c->scale[i], hgh_real(u, c->unit[i]))), c->unit[i]) : u;
}

/* Output i before a sensor's fault. */
static double shown(hgh_plant *self, int32_t i)
{
    const hgh_plant_config *c = self->config;
#if !HG_REAL_Q31
    if (c->nonlinear != NULL) {
        return hgh_nonlinear_output(c->nonlinear, c->n, i, self->x, self->u, &self->disturbance);
    }
#endif
    return row(c->C, i, c->n, self->x) + row(c->D, i, c->p, self->u) + row(c->Fd, i, c->nd, self->d);
}

void hgh_plant_read(hgh_plant *self, const double *d, double *value)
{
    const hgh_plant_config *c = self->config;
    for (int32_t i = 0; i < c->nd; i++) {
        self->d[i] = (d != NULL) ? d[i] : hgh_random_signed(&self->disturbance);
    }
    for (int32_t i = 0; i < c->p; i++) {
        const double u = command(self, i);
        value[c->input[i]] = hgh_faults_apply(&self->faults, 0, c->input[i], self->k, u);
        self->u[i] = hgh_faults_apply(&self->faults, 1, c->input[i], self->k, u);
    }
    for (int32_t i = 0; i < c->m; i++) {
        value[c->output[i]] = hgh_faults_apply(&self->faults, 0, c->output[i], self->k, shown(self, i));
    }
}

/* State i of the next sample. */
static double moved(hgh_plant *self, int32_t i)
{
    const hgh_plant_config *c = self->config;
#if !HG_REAL_Q31
    if (c->nonlinear != NULL) {
        return hgh_nonlinear_state(c->nonlinear, c->n, i, self->x, self->u, &self->disturbance);
    }
#endif
    return row(c->A, i, c->n, self->x) + row(c->B, i, c->p, self->u) + row(c->Ed, i, c->nd, self->d);
}

void hgh_plant_move(hgh_plant *self)
{
    const hgh_plant_config *c = self->config;
    double next[HGH_STATES_MAX];
    for (int32_t i = 0; i < c->n; i++) {
        next[i] = moved(self, i);
    }
    memcpy(self->x, next, (size_t)c->n * sizeof next[0]);
    self->k++;
}
