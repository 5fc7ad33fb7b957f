/** @file
 *  Tables of a polynomial filter, made by counting through all exponents, apart from the host's. */
#ifndef HULLGUARD_TESTS_POLYNOMIAL_RIG_H
#define HULLGUARD_TESTS_POLYNOMIAL_RIG_H

#include "hullguard/polynomial.h"

#define VARIABLES_MAX 8U
#define RING_MAX 200U
#define REALS_MAX 20000U

typedef struct {
    uint8_t exponent[VARIABLES_MAX];
} monomial;

typedef struct { /* a configuration and what it points to */
    hg_polynomial_config config;
    monomial state[RING_MAX], output[RING_MAX], noise_of[RING_MAX], ring[RING_MAX];
    uint16_t start[RING_MAX + 1U], product[8000], f_end[4], h_end[4];
    uint8_t parent[RING_MAX], factor[RING_MAX], noise[RING_MAX], moment[RING_MAX], cut_moment[RING_MAX], cut_state[RING_MAX];
    hg_real mean[RING_MAX], covariance[RING_MAX * RING_MAX], cut_scale[RING_MAX], M0[RING_MAX], f[16], h[16];
    uint8_t f_factor[48], h_factor[48];
    hg_real x0[4], P0[16], Q[4], box[4], r[4], range[4], fresh[4];
    hg_real memory[REALS_MAX];
    hg_polynomial self;
    bool normal; /* noise without third moments */
} rig;

/* A test has no more than these; all of them together would not fit a small board. */
static rig rigs[4];

static inline rig *fresh(size_t which)
{
    memset(&rigs[which], 0, sizeof rigs[which]);
    return &rigs[which];
}

static inline uint8_t degree_of(const monomial *m, uint8_t from, uint8_t to)
{
    uint8_t sum = 0U;
    for (uint8_t i = from; i < to; i++) {
        sum = (uint8_t)(sum + m->exponent[i]);
    }
    return sum;
}

/* All monomials in graded order, by counting through all exponents in the order in which the first variable's is largest first. */
static inline uint16_t list(monomial *out, uint8_t variables, uint8_t degree)
{
    uint16_t count = 0U;
    for (uint8_t total = 0U; total <= degree; total++) {
        monomial m = {{0U}};
        uint32_t codes = 1U;
        for (uint8_t i = 0U; i < variables; i++) {
            codes *= (uint32_t)degree + 1U;
        }
        for (uint32_t code = codes; code-- > 0U;) {
            uint32_t left = code;
            for (uint8_t i = variables; i-- > 0U;) {
                m.exponent[i] = (uint8_t)(left % (degree + 1U));
                left /= degree + 1U;
            }
            if (degree_of(&m, 0U, variables) == total) {
                out[count] = m;
                count++;
            }
        }
    }
    return count;
}

static inline uint16_t find(const monomial *among, uint16_t count, const monomial *wanted)
{
    for (uint16_t i = 0U; i < count; i++) {
        if (memcmp(&among[i], wanted, sizeof *wanted) == 0) {
            return i;
        }
    }
    assert_true(false); /* no such monomial */
    return 0U;
}

static inline monomial part(const monomial *m, uint8_t from, uint8_t to)
{
    monomial found = {{0U}};
    for (uint8_t i = from; i < to; i++) {
        found.exponent[i - from] = m->exponent[i];
    }
    return found;
}

static inline monomial times(const monomial *a, const monomial *b)
{
    monomial found;
    for (uint8_t i = 0U; i < VARIABLES_MAX; i++) {
        found.exponent[i] = (uint8_t)(a->exponent[i] + b->exponent[i]);
    }
    return found;
}

/* Moments of a normal number of this variance with a third moment beside, exact to degree 4; degree 6 only where it is normal. */
static inline double moment_of(double variance, double third, uint8_t order)
{
    const double of[] = {1.0, 0.0, variance, third, 3.0 * variance * variance, 0.0, 15.0 * variance * variance * variance};
    return of[order];
}

static inline double expected(const rig *p, const monomial *b)
{
    double product = 1.0;
    const uint8_t n = p->config.states;
    for (uint8_t i = 0U; i < n + p->config.outputs; i++) {
        const double variance = (double)((i < n) ? p->Q[i] : p->r[i - n]);
        product *= moment_of(variance, ((i < n) || p->normal) ? 0.0 : 0.5 * variance * sqrt(variance), b->exponent[i]);
    }
    return product;
}

static inline void make_powers(rig *p, const monomial *order, uint16_t count, uint8_t variables, uint16_t at)
{
    for (uint16_t a = 1U; a < count; a++) {
        uint8_t v = 0U;
        while (order[a].exponent[v] == 0U) {
            v++;
        }
        monomial less = order[a];
        less.exponent[v]--;
        const uint16_t parent = find(order, count, &less);
        p->parent[at + a - 1U] = (uint8_t)((a > variables) ? (parent - 1U) : 0U);
        p->factor[at + a - 1U] = v;
    }
}

static inline void make_cuts(rig *p)
{
    const hg_polynomial_config *c = &p->config;
    for (uint16_t i = c->lower; i < c->ring; i++) {
        const uint16_t at = (uint16_t)(i - c->lower);
        monomial x = part(&p->ring[i], 0U, c->states);
        monomial b = part(&p->ring[i], c->states, (uint8_t)(2U * c->states + c->outputs));
        p->cut_state[at] = HG_POLYNOMIAL_NONE;
        if (degree_of(&x, 0U, c->states) > c->degree) {
            uint8_t l = (uint8_t)(c->states - 1U);
            while (x.exponent[l] == 0U) {
                l--;
            }
            x.exponent[l]--;
            p->cut_state[at] = l;
        }
        p->cut_moment[at] = (uint8_t)find(p->state, (uint16_t)(c->lifted + 1U), &x);
        p->cut_scale[at] = R(1.0 + degree_of(&b, 0U, VARIABLES_MAX)); /* any number above 0 */
    }
}

/* All tables of n, p, mu; variances, maps and levels are there. */
static inline void make_tables(rig *p)
{
    hg_polynomial_config *c = &p->config;
    const uint8_t n = c->states, variables = (uint8_t)(2U * n + c->outputs), highest = (uint8_t)(c->degree + (c->bounded ? 1U : 0U));
    const uint16_t states = list(p->state, n, c->degree), outputs = list(p->output, c->outputs, c->degree);
    c->lifted = (uint8_t)(states - 1U);
    c->measured = (uint8_t)(outputs - 1U);
    c->judged = (uint8_t)(hg_polynomial_count(c->outputs, (c->degree > 2U) ? 2U : c->degree) - 1U);
    c->noises = (uint8_t)list(p->noise_of, (uint8_t)(n + c->outputs), c->degree);
    c->ring = list(p->ring, variables, highest);
    c->lower = (uint16_t)hg_polynomial_count(variables, c->degree);
    for (uint16_t i = 0U; i < c->ring; i++) {
        p->start[i + 1U] = p->start[i];
        for (uint16_t j = 0U; j < c->ring; j++) {
            if ((degree_of(&p->ring[i], 0U, variables) + degree_of(&p->ring[j], 0U, variables)) <= highest) {
                const monomial m = times(&p->ring[i], &p->ring[j]);
                p->product[p->start[i + 1U]] = find(p->ring, c->ring, &m);
                p->start[i + 1U]++;
            }
        }
    }
    for (uint16_t i = 0U; i < c->lower; i++) {
        const monomial x = part(&p->ring[i], 0U, n), b = part(&p->ring[i], n, variables);
        p->moment[i] = (uint8_t)find(p->state, states, &x);
        p->noise[i] = (uint8_t)find(p->noise_of, c->noises, &b);
    }
    for (uint16_t a = 0U; a < c->noises; a++) {
        p->mean[a] = R(expected(p, &p->noise_of[a]));
        for (uint16_t b = 0U; b < c->noises; b++) {
            const monomial both = times(&p->noise_of[a], &p->noise_of[b]);
            p->covariance[a * c->noises + b] = R(expected(p, &both) - expected(p, &p->noise_of[a]) * expected(p, &p->noise_of[b]));
        }
    }
    for (uint16_t a = 0U; a < states; a++) {
        for (uint16_t b = 0U; b < states; b++) {
            const monomial both = times(&p->state[a], &p->state[b]);
            double value = 1.0;
            for (uint8_t l = 0U; l < n; l++) {
                value *= moment_of((double)p->P0[l * n + l], 0.0, both.exponent[l]);
            }
            p->M0[a * states + b] = R(value);
        }
    }
    make_powers(p, p->state, states, n, 0U);
    make_powers(p, p->output, outputs, c->outputs, c->lifted);
    make_cuts(p);
}

#endif
