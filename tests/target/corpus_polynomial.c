/** @file
 *  A quarter of a car on a cubic spring: filters of every degree over the same measurements, some of them silent with a radius, some missing. */
#include "corpus_polynomial.h"

#include "polynomial_tables.h"

#include <stddef.h>
#include <string.h>

#define FNV_BASIS 0xCBF29CE484222325ULL
#define FNV_PRIME 0x100000001B3ULL
#define MISSING 16U /* one in so many */
#define SILENT 4U

static hg_real memory[E2_REALS];

static uint32_t draw(uint32_t *state)
{
    uint32_t x = *state;
    x ^= x << 13U;
    x ^= x >> 17U;
    x ^= x << 5U;
    *state = x;
    return x;
}

static uint64_t hash_reals(uint64_t hash, const hg_real *x, size_t n)
{
    for (size_t i = 0U; i < n; i++) {
        uint32_t bits;
        (void)memcpy(&bits, &x[i], sizeof(bits));
        for (unsigned shift = 0U; shift < 32U; shift += 8U) {
            hash = (hash ^ ((bits >> shift) & 0xFFU)) * FNV_PRIME;
        }
    }
    return hash;
}

/* A walk in whole 1/1024, so that it is the same everywhere. */
static uint64_t run(const hg_polynomial_config *config, uint32_t samples, uint64_t hash)
{
    static hg_polynomial filter;
    uint32_t random = 0x2545F491UL;
    int32_t walk = 0;
    if (hg_polynomial_start(&filter, config, memory, E2_REALS) != HG_OK) {
        return 0U;
    }
    for (uint32_t k = 0U; k < samples; k++) {
        const uint32_t dice = draw(&random);
        walk = ((walk * 7) / 8) + (int32_t)(draw(&random) % 257U) - 128;
        const hg_real y = (hg_real)walk * 0x1p-10F;
        hg_real radius = ((dice % SILENT) == 0U) ? 0x1p-4F : HG_REAL_ZERO;
        if ((dice % MISSING) == 0U) {
            radius = HG_REAL_MAX * 2.0F;
        }
        if (hg_polynomial_step(&filter, &y, &radius) != HG_OK) {
            return 0U;
        }
        hash = hash_reals(hash_reals(hash, filter.x, config->states), filter.Px, (size_t)config->states * config->states);
        hash = hash_reals(hash_reals(hash, filter.z, (size_t)config->lifted + 1U), filter.P, HG_POLYNOMIAL_HALF((size_t)config->lifted));
        hash = hash_reals(hash_reals(hash, filter.M, HG_POLYNOMIAL_HALF((size_t)config->lifted + 1U)), filter.Pe, (size_t)config->states * config->states);
        hash = hash_reals(hash, &filter.judgement.joint, 1U);
    }
    return hash;
}

uint64_t corpus_polynomial(uint32_t samples)
{
    uint64_t hash = FNV_BASIS;
    for (size_t i = 0U; (i < E2_FILTERS) && (hash != 0U); i++) {
        hash = run(&e2_filter[i], samples, hash);
    }
    return hash;
}
