#include "hullguard/digest.h"

#if HG_WITH_POLYNOMIAL

/* Whether a polynomial filter keeps the remainder's bound: without it the tables for it are not there. */
static uint32_t when(bool there, uint32_t count)
{
    return there ? count : 0U;
}

static void map(hg_digest *self, const hg_polynomial_map *map, uint8_t rows)
{
    const uint32_t terms = (rows > 0U) ? map->end[rows - 1U] : 0U;
    hg_digest_number(self, map->width);
    hg_digest_halves(self, map->end, rows);
    hg_digest_reals(self, map->coefficient, terms);
    hg_digest_bytes(self, map->factor, terms * map->width);
}

static void filter(hg_digest *self, const hg_polynomial_config *config)
{
    const uint32_t number[] = {
        config->states, config->outputs, config->degree, config->bounded ? 1U : 0U, config->lifted,
        config->measured, config->judged, config->noises, config->ring, config->lower,
    };
    const hg_real real[] = {config->kappa, config->joint, config->weight, config->drift};
    const uint32_t n = config->states;
    const uint32_t p = config->outputs;
    const uint32_t rows = (uint32_t)config->lifted + config->measured;
    const uint32_t cut = when(config->bounded, (uint32_t)config->ring - config->lower);
    const uint32_t moments = (uint32_t)config->lifted + 1U;
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    map(self, &config->f, config->states);
    map(self, &config->h, config->outputs);
    hg_digest_halves(self, config->start, (uint32_t)config->ring + 1U);
    hg_digest_halves(self, config->product, config->start[config->ring]);
    hg_digest_bytes(self, config->parent, rows);
    hg_digest_bytes(self, config->factor, rows);
    hg_digest_bytes(self, config->noise, config->lower);
    hg_digest_bytes(self, config->moment, config->lower);
    hg_digest_reals(self, config->mean, config->noises);
    hg_digest_reals(self, config->covariance, (uint32_t)config->noises * config->noises);
    hg_digest_bytes(self, config->cut_moment, cut);
    hg_digest_bytes(self, config->cut_state, cut);
    hg_digest_reals(self, config->cut_scale, cut);
    hg_digest_reals(self, config->box, when(config->bounded, n));
    hg_digest_reals(self, &config->reach, when(config->bounded, 1U));
    hg_digest_reals(self, config->x0, n);
    hg_digest_reals(self, config->P0, n * n);
    hg_digest_reals(self, config->M0, moments * moments);
    hg_digest_reals(self, config->Q, n);
    hg_digest_reals(self, config->R, p);
    hg_digest_reals(self, config->range, p);
    hg_digest_reals(self, config->fresh, p);
    hg_digest_reals(self, real, (uint32_t)(sizeof(real) / sizeof(real[0])));
}

void hg_digest_statistic(hg_digest *self, const hg_statistic_config *config)
{
    const uint32_t number[] = {config->inputs, config->settle};
    const uint32_t inputs = config->inputs;
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    filter(self, &config->filter);
    hg_digest_bytes(self, config->signal, config->filter.outputs);
    hg_digest_reals(self, config->gain, config->filter.outputs);
    hg_digest_bytes(self, config->input, inputs);
    hg_digest_reals(self, config->zero, inputs);
    hg_digest_reals(self, config->drive, config->filter.states * inputs);
    hg_digest_reals(self, config->direct, config->filter.outputs * inputs);
    hg_digest_reals(self, config->known, inputs);
}
#endif
