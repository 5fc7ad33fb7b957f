#include "host.h"

#if !HG_REAL_Q31 /* the polynomial filter is for the float types */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TWO_PI 6.283185307179586

typedef struct {
    const hgh_polynomial_config *config;
    hgh_polynomial_result       *result;
    hg_polynomial                filter;
    hgh_random                   plant, sensor, initial;
    double                       x[UINT8_MAX];
    double                       held[UINT8_MAX]; /* last value sent */
    hg_real                      y[UINT8_MAX];
    hg_real                      radius[UINT8_MAX];
    int64_t                      run; /* of this batch */
} runner;

static double normal_of(double scale, double u, double v)
{
    return scale * sqrt(-2.0 * log(u)) * cos(TWO_PI * v);
}

/* Student's t by Bailey's polar form. */
double hgh_noise_draw(const hgh_polynomial_noise *noise, hgh_random *random)
{
    const double u = 1.0 - hgh_random_unit(random);
    const double v = hgh_random_unit(random);
    int32_t atom = 0;
    switch (noise->kind) {
    case HGH_NOISE_EXPONENTIAL:
        return noise->scale * (-log(u) - 1.0);
    case HGH_NOISE_UNIFORM:
        return noise->scale * (2.0 * v - 1.0);
    case HGH_NOISE_ATOMS:
        while ((atom < noise->atoms - 1) && (v >= noise->below[atom])) {
            atom++;
        }
        return noise->value[atom];
    case HGH_NOISE_LAPLACE:
        return noise->scale * ((v < 0.5) ? log(u) : -log(u));
    case HGH_NOISE_STUDENT:
        return noise->scale * sqrt(noise->value[0] * (pow(u, -2.0 / noise->value[0]) - 1.0)) * cos(TWO_PI * v);
    case HGH_NOISE_CONTAMINATED: /* within each share v is evenly spread once more */
        return (v < noise->value[0]) ? normal_of(noise->scale * noise->value[1], u, v / noise->value[0])
                                     : normal_of(noise->scale, u, (v - noise->value[0]) / (1.0 - noise->value[0]));
    default:
        return normal_of(noise->scale, u, v);
    }
}

static double row_of(const hg_polynomial_map *map, const double *coefficient, int32_t row, const double *x)
{
    double sum = 0.0;
    for (int32_t k = (row > 0) ? map->end[row - 1] : 0; k < map->end[row]; k++) {
        const uint8_t *factor = &map->factor[k * map->width];
        double term = coefficient[k];
        for (int32_t i = 0; (i < map->width) && (factor[i] != HG_POLYNOMIAL_NONE); i++) {
            term *= x[factor[i]];
        }
        sum += term;
    }
    return sum;
}

static void measure(runner *r, int64_t k)
{
    const hgh_polynomial_config *c = r->config;
    for (int32_t j = 0; j < c->config->outputs; j++) {
        double y = row_of(&c->config->h, c->h, j, r->x) + hgh_noise_draw(&c->v[j], &r->sensor);
        if ((c->fault == HGH_PLANT_SENSOR) && (k >= c->fault_at)) {
            y += c->size[j];
        }
        const bool sends = (k == 0) || (c->delta[j] <= 0.0) || (fabs(y - r->held[j]) > c->delta[j]);
        r->held[j] = sends ? y : r->held[j];
        r->y[j] = (hg_real)r->held[j];
        r->radius[j] = sends ? HG_REAL_ZERO : (hg_real)c->delta[j];
        r->result->sent += sends ? 1 : 0;
    }
}

static void move_plant(runner *r, int64_t k)
{
    const hgh_polynomial_config *c = r->config;
    const int32_t n = c->config->states;
    double next[UINT8_MAX];
    for (int32_t l = 0; l < n; l++) {
        next[l] = row_of(&c->config->f, c->f, l, r->x) + hgh_noise_draw(&c->w[l], &r->plant);
        if ((c->fault == HGH_PLANT_ACTUATOR) && (k >= c->fault_at)) {
            next[l] += c->size[l];
        }
    }
    memcpy(r->x, next, sizeof(double) * (size_t)n);
}

static void score(runner *r, int64_t k)
{
    const hgh_polynomial_config *c = r->config;
    const int32_t n = c->config->states;
    for (int32_t l = 0; l < n; l++) {
        const double e = r->x[l] - (double)r->filter.x[l];
        const double auxiliary = r->x[l] - (double)r->filter.ekf[l];
        r->result->error2[k * n + l] += e * e;
        r->result->ekf2[k * n + l] += auxiliary * auxiliary;
        r->result->variance[k * n + l] += (double)r->filter.Px[l * n + l];
    }
    for (int32_t s = 0; s < HGH_POLYNOMIAL_STATISTICS; s++) {
        const bool above = ((r->filter.judgement.above >> s) & 1) != 0;
        int64_t *first = &r->result->first[r->run * HGH_POLYNOMIAL_STATISTICS + s];
        if (above && (k >= c->fault_at) && (*first < 0)) {
            *first = k;
        }
        r->result->alarms[s] += (above && (k >= c->skip) && (k < c->fault_at)) ? 1 : 0;
    }
}

static void one_run(runner *r, uint64_t run)
{
    const hgh_polynomial_config *c = r->config;
    hgh_random_start(&r->initial, c->seed, run, 300U);
    hgh_random_start(&r->plant, c->seed, run, 301U);
    hgh_random_start(&r->sensor, c->seed, run, 302U);
    for (int32_t l = 0; l < c->config->states; l++) {
        const hgh_polynomial_noise prior = {.kind = HGH_NOISE_NORMAL, .scale = c->p0[l]};
        r->x[l] = c->x0[l] + hgh_noise_draw(&prior, &r->initial);
    }
    for (int32_t s = 0; s < HGH_POLYNOMIAL_STATISTICS; s++) {
        r->result->first[r->run * HGH_POLYNOMIAL_STATISTICS + s] = -1;
    }
    hg_polynomial_reset(&r->filter);
    for (int64_t k = 0; k < c->samples; k++) {
        measure(r, k);
        (void)hg_polynomial_step(&r->filter, r->y, r->radius);
        score(r, k);
        move_plant(r, k);
    }
}

bool hgh_polynomial_batch(const hgh_polynomial_config *config, int64_t first, int64_t count, hgh_polynomial_result *result)
{
    const hg_polynomial_config *c = config->config;
    const uint32_t length = hg_polynomial_reals(c->states, c->outputs, c->degree, c->bounded);
    if (length == UINT32_MAX) {
        return false;
    }
    runner *r = calloc(1U, sizeof *r);
    hg_real *memory = calloc(length, sizeof *memory);
    bool good = (r != NULL) && (memory != NULL) && (hg_polynomial_start(&r->filter, c, memory, length) == HG_OK);
    if (good) {
        r->config = config;
        r->result = result;
        for (r->run = 0; r->run < count; r->run++) {
            one_run(r, (uint64_t)(first + r->run));
        }
        result->dropped += r->filter.dropped;
        result->held += r->filter.held;
        result->restarts += r->filter.restarts;
    }
    free(memory);
    free(r);
    return good;
}

#endif
