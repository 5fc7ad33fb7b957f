#include "hullguard/polynomial.h"

#include <stddef.h>

#if HG_REAL_F32 || HG_REAL_F64

#define DEGREE_MAX 3U
#define LIFTED_MAX 254U
#define SPLIT_MIN HG_REAL_C(1e-4) /* weights e, d of a bound: any above 0 is right, these keep what they multiply finite */
#define SPLIT_MAX HG_REAL_C(10.0)
#define ONE HG_REAL_C(1.0)

static uint8_t all_of(const hg_polynomial_config *config)
{
    return (uint8_t)(config->lifted + config->measured);
}

/* Place of row a, column b in a row-major matrix of n columns. */
static uint32_t spot(uint32_t n, uint32_t a, uint32_t b)
{
    return (a * n) + b;
}

/* The same in a symmetric matrix, of which the rows below the diagonal, and this, are kept one after the other. */
static uint32_t half(uint32_t a, uint32_t b)
{
    return (a > b) ? (((a * (a + 1U)) / 2U) + b) : (((b * (b + 1U)) / 2U) + a);
}

static bool is_zero(hg_real x)
{
    return (x >= HG_REAL_ZERO) && (x <= HG_REAL_ZERO); /* false for NaN */
}

static void fill(hg_real *out, hg_real x, uint32_t n)
{
    for (uint32_t i = 0U; i < n; i++) {
        out[i] = x;
    }
}

static void take_over(hg_real *out, const hg_real *in, uint32_t n)
{
    for (uint32_t i = 0U; i < n; i++) {
        out[i] = in[i];
    }
}

static hg_real dot(const hg_real *a, const hg_real *b, uint32_t n)
{
    hg_real sum = HG_REAL_ZERO;
    for (uint32_t i = 0U; i < n; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

/* Row a of a symmetric matrix of n rows times x. */
static hg_real half_dot(const hg_real *S, uint32_t a, const hg_real *x, uint32_t n)
{
    hg_real sum = HG_REAL_ZERO;
    uint32_t at = half(a, 0U);
    for (uint32_t i = 0U; i < n; i++) {
        sum += S[at] * x[i];
        at += (i < a) ? 1U : (i + 1U);
    }
    return sum;
}

static void count_one(uint16_t *counter)
{
    *counter = (*counter < UINT16_MAX) ? (uint16_t)(*counter + 1U) : UINT16_MAX;
}

uint32_t hg_polynomial_count(uint32_t variables, uint32_t degree)
{
    uint64_t count = 1U;
    for (uint64_t d = 1U; d <= degree; d++) {
        count = (count * (variables + d)) / d; /* each a binomial coefficient, so that nothing is left over */
        if (count >= UINT32_MAX) {
            return UINT32_MAX;
        }
    }
    return (uint32_t)count;
}

uint32_t hg_polynomial_reals(uint8_t states, uint8_t outputs, uint8_t degree, bool bounded)
{
    const uint32_t n = states;
    const uint32_t p = outputs;
    const uint32_t lifted = hg_polynomial_count(n, degree) - 1U;
    const uint32_t measured = hg_polynomial_count(p, degree) - 1U;
    const uint32_t noises = hg_polynomial_count(n + p, degree);
    const uint32_t highest = bounded ? ((uint32_t)degree + 1U) : degree;
    const uint32_t ring = hg_polynomial_count((2U * n) + p, highest);
    const uint32_t products = hg_polynomial_count(2U * ((2U * n) + p), highest); /* pairs of monomials = monomials of twice as many variables */
    const bool fits = (n >= 1U) && (p >= 1U) && (degree >= 1U) && (degree <= DEGREE_MAX) && (lifted <= LIFTED_MAX) && (measured <= LIFTED_MAX) &&
                      ((lifted + measured) <= LIFTED_MAX) && (noises <= UINT8_MAX) && (products <= UINT16_MAX);
    return fits ? HG_POLYNOMIAL_REALS(n, p, lifted, measured, ring) : UINT32_MAX;
}

/* Are the sizes those of n, p, mu? */
static bool dimensions_fit(const hg_polynomial_config *config)
{
    const uint32_t n = config->states;
    const uint32_t p = config->outputs;
    const uint32_t mu = config->degree;
    if (hg_polynomial_reals(config->states, config->outputs, config->degree, config->bounded) == UINT32_MAX) {
        return false;
    }
    const uint32_t variables = (2U * n) + p;
    const uint32_t expected[] = {hg_polynomial_count(n, mu) - 1U,  hg_polynomial_count(p, mu) - 1U, hg_polynomial_count(p, (mu > 2U) ? 2U : mu) - 1U,
                                 hg_polynomial_count(n + p, mu),   hg_polynomial_count(variables, config->bounded ? (mu + 1U) : mu),
                                 hg_polynomial_count(variables, mu)};
    const uint32_t found[] = {config->lifted, config->measured, config->judged, config->noises, config->ring, config->lower};
    bool valid = true;
    for (uint8_t i = 0U; i < 6U; i++) {
        valid = valid && (expected[i] == found[i]);
    }
    return valid;
}

static bool present(const void *const *table, uint8_t count)
{
    bool complete = true;
    for (uint8_t i = 0U; i < count; i++) {
        complete = complete && (table[i] != NULL);
    }
    return complete;
}

static bool lists_valid(const hg_polynomial_config *config)
{
    const void *const always[] = {config->f.end, config->f.coefficient, config->f.factor, config->h.end, config->h.coefficient, config->h.factor, config->start,
                                  config->product, config->parent, config->factor, config->noise, config->moment, config->mean, config->covariance, config->x0,
                                  config->P0, config->M0, config->Q, config->R, config->range, config->fresh};
    const void *const bounded[] = {config->cut_moment, config->cut_state, config->cut_scale, config->box};
    return present(always, 21U) && ((!config->bounded) || present(bounded, 4U));
}

static bool numbers_valid(const hg_polynomial_config *config)
{
    const hg_real positive[] = {config->kappa, config->joint, config->weight, config->drift, config->bounded ? config->reach : ONE};
    bool valid = (config->weight <= ONE) && (config->f.width >= 1U) && (config->h.width >= 1U);
    for (uint8_t i = 0U; i < 5U; i++) {
        valid = valid && (positive[i] > HG_REAL_ZERO);
    }
    for (uint8_t j = 0U; j < config->outputs; j++) {
        valid = valid && (config->R[j] > HG_REAL_ZERO) && (config->range[j] > HG_REAL_ZERO) && (config->fresh[j] >= HG_REAL_ZERO);
    }
    for (uint16_t i = 0U; i < config->ring; i++) {
        valid = valid && (config->start[i] <= config->start[i + 1U]);
    }
    return valid;
}

bool hg_polynomial_valid(const hg_polynomial_config *config)
{
    return dimensions_fit(config) && lists_valid(config) && numbers_valid(config);
}

/* Hand the memory out. What is done with when something else begins lends its place: the powers to what follows from them (they are always longer: tests/unit),
 * the states' polynomials to what the powers are gathered in. */
static void place(hg_polynomial *self, hg_real *memory)
{
    const hg_polynomial_config *config = self->config;
    const uint32_t n = config->states;
    const uint32_t p = config->outputs;
    const uint32_t lifted = config->lifted;
    const uint32_t measured = config->measured;
    const uint32_t rows = lifted + measured;
    const uint32_t ring = config->ring;
    hg_real **const array[] = {&self->x,      &self->Px,    &self->ekf, &self->c,     &self->Pe,    &self->z,    &self->P,    &self->M,
                               &self->mean,   &self->eta,   &self->radius, &self->width, &self->L,  &self->slack, &self->weigh, &self->next,
                               &self->root,   &self->scale, &self->r,   &self->t,     &self->Delta, &self->poly, &self->shift, &self->term};
    const uint32_t size[] = {n, n * n, n, n, n * n, lifted + 1U, HG_POLYNOMIAL_HALF(lifted), HG_POLYNOMIAL_HALF(lifted + 1U),
                             p, p, p, p, n * p, rows, rows, lifted + 1U,
                             measured * measured, measured, measured, measured, measured, rows * ring, n * ring, ring};
    uint32_t next = 0U;
    for (uint8_t i = 0U; i < 24U; i++) {
        *array[i] = &memory[next];
        next += size[i];
    }
    self->AP = self->poly;
    self->gain = &self->AP[rows * lifted];
    self->filtered = &self->gain[lifted * measured];
    self->A = self->shift;
    self->J = &self->A[rows * (lifted + 1U)];
}

hg_status hg_polynomial_start(hg_polynomial *self, const hg_polynomial_config *config, hg_real *memory, uint32_t length)
{
    if ((self == NULL) || (config == NULL) || (memory == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!hg_polynomial_valid(config)) {
        return HG_E_CONFIG;
    }
    if (length < HG_POLYNOMIAL_REALS(config->states, config->outputs, config->lifted, config->measured, config->ring)) {
        return HG_E_SIZE;
    }
    self->config = config;
    place(self, memory);
    self->dropped = 0U;
    self->held = 0U;
    self->restarts = 0U;
    hg_polynomial_reset(self);
    return HG_OK;
}

void hg_polynomial_reset(hg_polynomial *self)
{
    const hg_polynomial_config *config = self->config;
    const uint32_t n = config->states;
    const uint32_t lifted = config->lifted;
    const uint32_t wide = lifted + 1U;
    take_over(self->x, config->x0, n);
    take_over(self->ekf, config->x0, n);
    take_over(self->c, config->x0, n);
    take_over(self->Px, config->P0, n * n);
    take_over(self->Pe, config->P0, n * n);
    take_over(self->z, config->M0, wide);
    for (uint32_t a = 0U; a < wide; a++) {
        take_over(&self->M[half(a, 0U)], &config->M0[spot(wide, a, 0U)], a + 1U);
    }
    for (uint32_t a = 0U; a < lifted; a++) {
        for (uint32_t b = 0U; b <= a; b++) {
            self->P[half(a, b)] = config->M0[spot(wide, a + 1U, b + 1U)] - (config->M0[a + 1U] * config->M0[b + 1U]);
        }
    }
    fill(self->mean, HG_REAL_ZERO, config->outputs);
    self->judgement = (hg_polynomial_judgement){.above = 0U};
}

/* a = a b, cut off above the ring's degree. From the last monomial on: what a product is added to has been read by then. */
static void ring_multiply(const hg_polynomial_config *config, hg_real *a, const hg_real *b)
{
    for (uint32_t i = config->ring; i > 0U; i--) {
        const uint16_t *product = &config->product[config->start[i - 1U]];
        const uint16_t count = (uint16_t)(config->start[i] - config->start[i - 1U]);
        const hg_real factor = a[i - 1U];
        a[i - 1U] = HG_REAL_ZERO;
        for (uint16_t j = 0U; (!is_zero(factor)) && (j < count); j++) {
            a[product[j]] += factor * b[j];
        }
    }
}

/* out = row i of the map with polynomials in place of the states. */
static void substitute(hg_polynomial *self, const hg_polynomial_map *map, uint8_t i, hg_real *out)
{
    const hg_polynomial_config *config = self->config;
    const uint16_t first = (i > 0U) ? map->end[i - 1U] : 0U;
    fill(out, HG_REAL_ZERO, config->ring);
    for (uint16_t k = first; k < map->end[i]; k++) {
        const uint8_t *factor = &map->factor[(uint32_t)k * map->width];
        fill(self->term, HG_REAL_ZERO, config->ring);
        self->term[0] = map->coefficient[k];
        for (uint8_t w = 0U; (w < map->width) && (factor[w] != HG_POLYNOMIAL_NONE); w++) {
            ring_multiply(config, self->term, &self->shift[(uint32_t)factor[w] * config->ring]);
        }
        for (uint16_t m = 0U; m < config->ring; m++) {
            out[m] += self->term[m];
        }
    }
}

/* Is the value a measurement as v's moments have it? */
static bool is_fresh(const hg_polynomial *self, uint8_t j)
{
    return self->radius[j] <= self->config->fresh[j];
}

static bool is_there(const hg_polynomial *self, uint8_t j)
{
    return self->radius[j] <= HG_REAL_MAX;
}

/* H = h(c + xi) - h(c) + v, eta = y - h(c): the powers of degree 1 of the outputs. */
static void expand_outputs(hg_polynomial *self, const hg_real *y)
{
    const hg_polynomial_config *config = self->config;
    const uint32_t ring = config->ring;
    for (uint8_t l = 0U; l < config->states; l++) {
        hg_real *shift = &self->shift[l * ring];
        fill(shift, HG_REAL_ZERO, ring);
        shift[0] = self->c[l];
        shift[1U + l] = ONE;
    }
    for (uint8_t j = 0U; j < config->outputs; j++) {
        hg_real *poly = &self->poly[((uint32_t)config->lifted + j) * ring];
        substitute(self, &config->h, j, poly);
        self->eta[j] = is_there(self, j) ? (y[j] - poly[0]) : HG_REAL_ZERO;
        poly[0] = HG_REAL_ZERO;
        poly[1U + (2U * (uint32_t)config->states) + j] += ONE;
    }
}

/* Cholesky's factor of the covariance in self->root, count x count, divided by its diagonal's roots; the inverse of each pivot's root is on its diagonal. A row
 * that was 0 on the diagonal is left out, as is one whose pivot is too small: 0 there, and in its column. */
static void factorise(hg_polynomial *self, uint8_t count)
{
    hg_real *S = self->root;
    for (uint8_t i = 0U; i < count; i++) {
        const hg_real variance = S[spot(count, i, i)];
        self->scale[i] = (variance > HG_REAL_ZERO) ? (ONE / hg_linalg_root(variance)) : HG_REAL_ZERO;
        for (uint8_t j = 0U; j < i; j++) {
            const hg_real scaled = S[spot(count, i, j)] * (self->scale[i] * self->scale[j]);
            S[spot(count, i, j)] = (scaled - dot(&S[spot(count, i, 0U)], &S[spot(count, j, 0U)], j)) * S[spot(count, j, j)];
        }
        const hg_real pivot = ONE - dot(&S[spot(count, i, 0U)], &S[spot(count, i, 0U)], i);
        const bool good = (variance > HG_REAL_ZERO) && (pivot > HG_POLYNOMIAL_PIVOT);
        S[spot(count, i, i)] = good ? (ONE / hg_linalg_root(pivot)) : HG_REAL_ZERO;
        if ((variance > HG_REAL_ZERO) && (!good)) {
            count_one(&self->dropped);
        }
    }
}

/* t = L^-1 D^-1 t, D the roots of the diagonal: S^-1 = D^-1 L'^-1 L^-1 D^-1. */
static void forward(const hg_polynomial *self, uint8_t count, hg_real *t)
{
    for (uint8_t i = 0U; i < count; i++) {
        t[i] = ((t[i] * self->scale[i]) - dot(&self->root[spot(count, i, 0U)], t, i)) * self->root[spot(count, i, i)];
    }
}

/* t = D^-1 L'^-1 t. */
static void backward(const hg_polynomial *self, uint8_t count, hg_real *t)
{
    for (uint8_t back = 0U; back < count; back++) {
        const uint8_t i = (uint8_t)(count - 1U - back);
        for (uint8_t j = (uint8_t)(i + 1U); j < count; j++) {
            t[i] -= self->root[spot(count, j, i)] * t[j];
        }
        t[i] *= self->root[spot(count, i, i)];
    }
    for (uint8_t i = 0U; i < count; i++) {
        t[i] *= self->scale[i];
    }
}

/* Gain of the auxiliary filter, its estimate, and the averages of its innovations. */
static void run_auxiliary(hg_polynomial *self)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t n = config->states;
    const uint8_t p = config->outputs;
    for (uint8_t j = 0U; j < p; j++) {
        const hg_real *H = &self->poly[(((uint32_t)config->lifted + j) * config->ring) + 1U];
        for (uint8_t l = 0U; l < n; l++) {
            self->L[spot(p, l, j)] = dot(H, &self->Pe[spot(n, l, 0U)], n);
        }
        for (uint8_t i = 0U; i <= j; i++) {
            const hg_real *other = &self->poly[(((uint32_t)config->lifted + i) * config->ring) + 1U];
            hg_real sum = HG_REAL_ZERO;
            for (uint8_t l = 0U; l < n; l++) {
                sum += self->L[spot(p, l, j)] * other[l];
            }
            self->root[spot(p, j, i)] = sum;
        }
        self->width[j] = self->root[spot(p, j, j)] + config->R[j];
        self->root[spot(p, j, j)] = is_fresh(self, j) ? self->width[j] : HG_REAL_ZERO;
        if (is_fresh(self, j)) {
            const hg_real standard = self->eta[j] / hg_linalg_root(self->width[j]);
            self->mean[j] += config->weight * (standard - self->mean[j]);
        }
    }
    factorise(self, p);
    for (uint8_t l = 0U; l < n; l++) {
        forward(self, p, &self->L[spot(p, l, 0U)]);
        backward(self, p, &self->L[spot(p, l, 0U)]);
        self->ekf[l] = self->c[l] + dot(&self->L[spot(p, l, 0U)], self->eta, p);
    }
}

/* xi+ = f(c' + xi - L H) - f(c') + w: the powers of degree 1 of the states. self->c becomes c+. */
static void expand_states(hg_polynomial *self)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t n = config->states;
    const uint8_t p = config->outputs;
    const uint32_t ring = config->ring;
    for (uint8_t l = 0U; l < n; l++) {
        hg_real *shift = &self->shift[l * ring];
        shift[0] = self->ekf[l];
        for (uint8_t j = 0U; j < p; j++) {
            const hg_real *H = &self->poly[((uint32_t)config->lifted + j) * ring];
            for (uint32_t m = 1U; m < ring; m++) {
                shift[m] -= self->L[spot(p, l, j)] * H[m];
            }
        }
    }
    for (uint8_t l = 0U; l < n; l++) {
        hg_real *poly = &self->poly[l * ring];
        substitute(self, &config->f, l, poly);
        self->c[l] = poly[0];
        poly[0] = HG_REAL_ZERO;
        poly[1U + n + l] += ONE;
    }
}

/* The auxiliary covariance follows from what is linear in xi+: Joseph's form, with the predictor's closed loop in it. */
static void predict_auxiliary(hg_polynomial *self)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t n = config->states;
    const uint32_t ring = config->ring;
    hg_real *FP = self->A; /* n x n: not yet in use */
    for (uint8_t a = 0U; a < n; a++) {
        for (uint8_t l = 0U; l < n; l++) {
            FP[spot(n, a, l)] = dot(&self->poly[(a * ring) + 1U], &self->Pe[spot(n, l, 0U)], n);
        }
    }
    for (uint8_t a = 0U; a < n; a++) {
        const hg_real *row = &self->poly[(a * ring) + 1U];
        for (uint8_t b = 0U; b <= a; b++) {
            const hg_real *other = &self->poly[(b * ring) + 1U];
            hg_real sum = dot(&FP[spot(n, a, 0U)], other, n) + ((a == b) ? config->Q[a] : HG_REAL_ZERO);
            for (uint8_t j = 0U; j < config->outputs; j++) {
                sum += (row[(2U * (uint32_t)n) + j] * config->R[j]) * other[(2U * (uint32_t)n) + j];
            }
            self->Pe[spot(n, a, b)] = sum;
            self->Pe[spot(n, b, a)] = sum;
        }
    }
}

/* Powers of degree 2 and more: of the states from `first` = 0 on, of the outputs from `first` = lifted on. */
static void raise_powers(hg_polynomial *self, uint8_t first, uint8_t variables, uint8_t count)
{
    const hg_polynomial_config *config = self->config;
    hg_real *poly = &self->poly[(uint32_t)first * config->ring];
    for (uint8_t a = variables; a < count; a++) {
        hg_real *power = &poly[(uint32_t)a * config->ring];
        take_over(power, &poly[(uint32_t)config->factor[first + a] * config->ring], config->ring);
        ring_multiply(config, power, &poly[(uint32_t)config->parent[first + a] * config->ring]);
    }
}

/* What is linear in [1; X] in the mean: rows [U A] and [V C]. */
static void take_means(hg_polynomial *self)
{
    const hg_polynomial_config *config = self->config;
    const uint32_t wide = (uint32_t)config->lifted + 1U;
    const uint8_t rows = all_of(config);
    fill(self->A, HG_REAL_ZERO, (uint32_t)rows * wide);
    for (uint8_t a = 0U; a < rows; a++) {
        const hg_real *poly = &self->poly[(uint32_t)a * config->ring];
        for (uint16_t i = 0U; i < config->lower; i++) {
            self->A[spot(wide, a, config->moment[i])] += config->mean[config->noise[i]] * poly[i];
        }
    }
}

/* weigh = what monomial i is correlated with: the sum of Cov(nu^b, nu^b') M over the monomials of all rows. */
static void weigh_monomial(hg_polynomial *self, uint16_t i)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t rows = all_of(config);
    const hg_real *covariance = &config->covariance[(uint32_t)config->noise[i] * config->noises];
    fill(self->weigh, HG_REAL_ZERO, rows);
    for (uint16_t j = 1U; j < config->lower; j++) {
        const hg_real joint = covariance[config->noise[j]];
        if (!is_zero(joint)) {
            const hg_real worth = joint * self->M[half(config->moment[i], config->moment[j])];
            for (uint8_t a = 0U; a < rows; a++) {
                self->weigh[a] += worth * self->poly[((uint32_t)a * config->ring) + j];
            }
        }
    }
}

/* J = N: the covariance of the noise that is multiplied by the state. Most pairs of the noise's monomials are uncorrelated, and most rows have few monomials. */
static void take_noise(hg_polynomial *self)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t rows = all_of(config);
    fill(self->J, HG_REAL_ZERO, HG_POLYNOMIAL_HALF((uint32_t)rows));
    for (uint16_t i = 1U; i < config->lower; i++) {
        if (config->noise[i] != 0U) { /* else it has no noise */
            weigh_monomial(self, i);
            for (uint8_t b = 0U; b < rows; b++) {
                const hg_real factor = self->poly[((uint32_t)b * config->ring) + i];
                uint32_t at = half(b, b);
                for (uint32_t a = b; (!is_zero(factor)) && (a < rows); a++) {
                    self->J[at] += self->weigh[a] * factor;
                    at += a + 1U; /* down column b */
                }
            }
        }
    }
}

/* slack[a] = s_a^2 m, of m rows that cut something off: a vector within +-s has a covariance within that of m diag(s^2). */
static void bound_remainders(hg_polynomial *self)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t rows = all_of(config);
    uint8_t cutting = 0U;
    for (uint8_t l = 0U; l < config->states; l++) {
        self->next[l] = hg_real_min(config->reach * hg_linalg_root(hg_real_max(self->P[half(l, l)], HG_REAL_ZERO)), config->box[l]);
    }
    fill(self->slack, HG_REAL_ZERO, rows);
    for (uint16_t i = config->lower; i < config->ring; i++) {
        const uint16_t cut = (uint16_t)(i - config->lower);
        const uint8_t m = config->cut_moment[cut];
        const uint8_t l = config->cut_state[cut];
        const hg_real far = (l == HG_POLYNOMIAL_NONE) ? ONE : self->next[l];
        const hg_real worth = (config->cut_scale[cut] * far) * hg_linalg_root(hg_real_max(self->M[half(m, m)], HG_REAL_ZERO));
        for (uint8_t a = 0U; a < rows; a++) {
            self->slack[a] += hg_real_abs(self->poly[((uint32_t)a * config->ring) + i]) * worth;
        }
    }
    for (uint8_t a = 0U; a < rows; a++) {
        cutting = (uint8_t)(cutting + ((self->slack[a] > HG_REAL_ZERO) ? 1U : 0U));
    }
    for (uint8_t a = 0U; a < rows; a++) {
        self->slack[a] *= self->slack[a] * (hg_real)cutting;
    }
}

/* M+ = A M A' + .. + N; J holds N. */
static void move_moments(hg_polynomial *self)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t lifted = config->lifted;
    const uint32_t wide = (uint32_t)lifted + 1U;
    for (uint8_t a = 0U; a < lifted; a++) { /* [U A] M, and its first column is the mean */
        self->next[a] = half_dot(self->M, 0U, &self->A[spot(wide, a, 0U)], wide);
        for (uint8_t m = 0U; m < lifted; m++) {
            self->AP[spot(lifted, a, m)] = half_dot(self->M, (uint32_t)m + 1U, &self->A[spot(wide, a, 0U)], wide);
        }
    }
    for (uint8_t a = 0U; a < lifted; a++) {
        for (uint8_t b = 0U; b <= a; b++) {
            const hg_real *row = &self->A[spot(wide, b, 0U)];
            const hg_real sum = (self->next[a] * row[0]) + dot(&self->AP[spot(lifted, a, 0U)], &row[1], lifted);
            self->M[half((uint32_t)a + 1U, (uint32_t)b + 1U)] = sum + self->J[half(a, b)];
        }
        self->M[half((uint32_t)a + 1U, 0U)] = self->next[a];
    }
}

/* The weight that makes (1 + e) trace + (1 + 1/e) excess least, from the mean of excess over trace. */
static hg_real split(hg_real mean)
{
    return hg_real_max(hg_real_min(hg_linalg_root(hg_real_max(mean, HG_REAL_ZERO)), SPLIT_MAX), SPLIT_MIN);
}

/* J = (1 + e) [A; C] P [A; C]' + (1 + 1/e) slack + N. Result: 1 + e, for what P itself becomes by the same bound. */
static hg_real take_joint(hg_polynomial *self)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t lifted = config->lifted;
    const uint32_t wide = (uint32_t)lifted + 1U;
    const uint8_t rows = all_of(config);
    hg_real e = HG_REAL_ZERO;
    hg_real mean = HG_REAL_ZERO;
    for (uint8_t a = 0U; a < rows; a++) {
        for (uint8_t m = 0U; m < lifted; m++) {
            self->AP[spot(lifted, a, m)] = half_dot(self->P, m, &self->A[spot(wide, a, 1U)], lifted);
        }
        if (config->bounded) {
            const hg_real whole = dot(&self->AP[spot(lifted, a, 0U)], &self->A[spot(wide, a, 1U)], lifted) + self->J[half(a, a)];
            mean += (whole > HG_REAL_ZERO) ? (self->slack[a] / (whole * (hg_real)rows)) : HG_REAL_ZERO;
        }
    }
    if (config->bounded) {
        e = split(mean);
    }
    for (uint8_t a = 0U; a < rows; a++) {
        for (uint8_t b = 0U; b <= a; b++) {
            self->J[half(a, b)] += (ONE + e) * dot(&self->AP[spot(lifted, a, 0U)], &self->A[spot(wide, b, 1U)], lifted);
        }
        if (config->bounded) {
            self->J[half(a, a)] += (ONE + (ONE / e)) * self->slack[a];
        }
    }
    return ONE + e;
}

/* r = Y - C X - V, and how far Y can be from that of the true measurement: prod(|eta| + radius) - prod |eta|. */
static void take_residual(hg_polynomial *self)
{
    const hg_polynomial_config *config = self->config;
    const uint32_t wide = (uint32_t)config->lifted + 1U;
    hg_real *Y = self->t;
    hg_real *most = self->scale;
    for (uint8_t k = 0U; k < config->measured; k++) {
        const uint8_t a = (uint8_t)(config->lifted + k);
        const uint8_t j = (k < config->outputs) ? k : config->factor[a];
        const hg_real radius = (is_fresh(self, j) || (!is_there(self, j))) ? HG_REAL_ZERO : self->radius[j];
        Y[k] = self->eta[j];
        most[k] = hg_real_abs(self->eta[j]) + radius;
        if (k >= config->outputs) {
            Y[k] *= Y[config->parent[a]];
            most[k] *= most[config->parent[a]];
        }
        self->r[k] = Y[k] - dot(&self->A[spot(wide, a, 0U)], self->z, wide);
        self->Delta[k] = most[k] - hg_real_abs(Y[k]);
    }
}

/* Is output j worth something? Nothing is known of it, or less than is predicted. */
static bool is_worth(const hg_polynomial *self, uint8_t j)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t a = (uint8_t)(config->lifted + j);
    const hg_real radius = self->radius[j];
    return is_fresh(self, j) || (is_there(self, j) && ((radius * radius) < self->J[half(a, a)]));
}

/* Jyy to factor, with Delta in it; rows that are left out have 0 on the diagonal. Result: 1 + d. */
static hg_real take_spread(hg_polynomial *self)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t count = config->measured;
    hg_real mean = HG_REAL_ZERO;
    uint8_t silent = 0U;
    uint8_t used = 0U;
    for (uint8_t k = 0U; k < count; k++) { /* slack: 1 for rows that are used */
        const uint8_t a = (uint8_t)(config->lifted + k);
        const hg_real variance = self->J[half(a, a)];
        const bool first = k < config->outputs;
        const bool whole = first || (self->slack[config->lifted + config->parent[a]] > HG_REAL_ZERO);
        const bool used_here = whole && is_worth(self, first ? k : config->factor[a]);
        self->slack[a] = used_here ? ONE : HG_REAL_ZERO;
        if (used_here) {
            used++;
            silent = (uint8_t)(silent + ((self->Delta[k] > HG_REAL_ZERO) ? 1U : 0U));
            mean += (self->Delta[k] * self->Delta[k]) / variance;
        }
    }
    const hg_real d = (silent > 0U) ? split((mean * (hg_real)silent) / (hg_real)used) : HG_REAL_ZERO;
    for (uint8_t k = 0U; k < count; k++) {
        const uint8_t a = (uint8_t)(config->lifted + k);
        for (uint8_t i = 0U; i <= k; i++) {
            self->root[spot(count, k, i)] = (ONE + d) * self->J[half(a, (uint32_t)config->lifted + i)];
        }
        if (self->slack[a] <= HG_REAL_ZERO) {
            self->root[spot(count, k, k)] = HG_REAL_ZERO;
        } else if (silent > 0U) {
            self->root[spot(count, k, k)] += ((ONE + (ONE / d)) * (hg_real)silent) * (self->Delta[k] * self->Delta[k]);
        } else {
            /* exactly J */
        }
    }
    return ONE + d;
}

/* ||r|| against its threshold, J2 and the drift against their levels. t = L^-1 D^-1 r. */
static void compare(hg_polynomial *self)
{
    const hg_polynomial_config *config = self->config;
    hg_polynomial_judgement *judgement = &self->judgement;
    hg_real trace = HG_REAL_ZERO;
    hg_real square = HG_REAL_ZERO;
    hg_real radius = HG_REAL_ZERO;
    hg_real drift = HG_REAL_ZERO;
    for (uint8_t j = 0U; j < config->outputs; j++) {
        const uint8_t a = (uint8_t)(config->lifted + j);
        if (is_there(self, j)) {
            trace += self->J[half(a, a)];
            square += self->r[j] * self->r[j];
            radius += is_fresh(self, j) ? HG_REAL_ZERO : (self->radius[j] * self->radius[j]);
        }
        drift = hg_real_max(drift, self->mean[j] * self->mean[j]);
    }
    judgement->plain = hg_linalg_root(square);
    judgement->threshold = hg_real_min((config->kappa * hg_linalg_root(trace)) + hg_linalg_root(radius), HG_REAL_MAX);
    judgement->joint = hg_real_min(dot(self->t, self->t, config->judged), HG_REAL_MAX); /* squares of finite numbers */
    judgement->drift = hg_real_min(drift * ((HG_REAL_C(2.0) - config->weight) / config->weight), HG_REAL_MAX);
    uint32_t above = (judgement->plain > judgement->threshold) ? HG_POLYNOMIAL_PLAIN : 0U;
    above |= (judgement->joint > config->joint) ? HG_POLYNOMIAL_JOINT : 0U;
    above |= (judgement->drift > config->drift) ? HG_POLYNOMIAL_DRIFT : 0U;
    judgement->above = (uint8_t)above;
}

/* Rows of Jxy L'^-1 D^-1, for the prediction and for the estimate: the gain times r is their product with t, what the update takes from the covariance is theirs
 * with themselves. Does the update leave variances, and where something was made wider for it, is the state's covariance smaller with it? */
static bool take_gains(hg_polynomial *self, hg_real wider, hg_real bound)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t lifted = config->lifted;
    const uint8_t count = config->measured;
    bool good = true;
    hg_real left = HG_REAL_ZERO;
    for (uint8_t a = 0U; a < lifted; a++) {
        hg_real *gain = &self->gain[spot(count, a, 0U)];
        for (uint8_t k = 0U; k < count; k++) {
            gain[k] = wider * self->J[half(a, (uint32_t)lifted + k)];
        }
        forward(self, count, gain);
        const hg_real before = wider * self->J[half(a, a)];
        good = good && ((before - dot(gain, gain, count)) >= -(HG_POLYNOMIAL_PIVOT * before));
    }
    for (uint8_t a = 0U; a < config->states; a++) {
        hg_real *gain = &self->filtered[spot(count, a, 0U)];
        for (uint8_t k = 0U; k < count; k++) {
            gain[k] = (wider * bound) * self->AP[spot(lifted, (uint32_t)lifted + k, a)];
        }
        forward(self, count, gain);
        const hg_real alone = bound * self->P[half(a, a)];
        const hg_real after = (wider * alone) - dot(gain, gain, count);
        good = good && (after >= -(HG_POLYNOMIAL_PIVOT * alone));
        left += (alone > HG_REAL_ZERO) ? (after / alone) : ONE;
    }
    return good && ((wider <= ONE) || (left < (hg_real)config->states));
}

/* The estimate of this sample; x is the point it was expanded about. */
static void estimate(hg_polynomial *self, hg_real factor)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t n = config->states;
    const uint8_t count = config->measured;
    for (uint8_t a = 0U; a < n; a++) {
        const hg_real *gain = &self->filtered[spot(count, a, 0U)];
        self->x[a] += self->z[(uint32_t)a + 1U] + dot(gain, self->t, count);
        for (uint8_t b = 0U; b <= a; b++) {
            const hg_real sum = (factor * self->P[half(a, b)]) - dot(gain, &self->filtered[spot(count, b, 0U)], count);
            self->Px[spot(n, a, b)] = (a == b) ? hg_real_max(sum, HG_REAL_ZERO) : sum;
            self->Px[spot(n, b, a)] = self->Px[spot(n, a, b)];
        }
    }
}

/* The prediction for the next. */
static void predict_lifted(hg_polynomial *self, hg_real wider)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t lifted = config->lifted;
    const uint32_t wide = (uint32_t)lifted + 1U;
    const uint8_t count = config->measured;
    for (uint8_t a = 0U; a < lifted; a++) {
        const hg_real *gain = &self->gain[spot(count, a, 0U)];
        self->next[a] = dot(&self->A[spot(wide, a, 0U)], self->z, wide) + dot(gain, self->t, count);
        for (uint8_t b = 0U; b <= a; b++) {
            const hg_real sum = (wider * self->J[half(a, b)]) - dot(gain, &self->gain[spot(count, b, 0U)], count);
            self->P[half(a, b)] = (a == b) ? hg_real_max(sum, HG_REAL_ZERO) : sum;
        }
    }
    take_over(&self->z[1], self->next, lifted);
}

/* With the measurements or, where that is no update, without them. */
static void take_measurements(hg_polynomial *self, hg_real bound)
{
    const hg_polynomial_config *config = self->config;
    const uint8_t count = config->measured;
    take_residual(self);
    hg_real wider = take_spread(self);
    factorise(self, count);
    take_over(self->t, self->r, count);
    forward(self, count, self->t);
    compare(self);
    if (!take_gains(self, wider, bound)) {
        count_one(&self->held);
        fill(self->gain, HG_REAL_ZERO, (uint32_t)config->lifted * count);
        fill(self->filtered, HG_REAL_ZERO, (uint32_t)config->states * count);
        wider = ONE;
    }
    estimate(self, wider * bound);
    predict_lifted(self, wider);
}

static bool all_readable(const hg_polynomial_config *config, const hg_real *y, const hg_real *radius)
{
    bool good = true;
    for (uint8_t j = 0U; j < config->outputs; j++) {
        const bool known = radius[j] <= HG_REAL_MAX; /* false for NaN */
        const bool unknown = radius[j] > HG_REAL_MAX;
        good = good && (unknown || (known && (radius[j] >= HG_REAL_ZERO) && (hg_real_abs(y[j]) <= config->range[j])));
    }
    return good;
}

static bool all_finite(const hg_polynomial *self)
{
    const uint32_t n = self->config->states;
    const uint32_t wide = (uint32_t)self->config->lifted + 1U;
    const hg_real *const array[] = {self->x, self->Px, self->c, self->Pe, self->z, self->P, self->M, self->mean, &self->judgement.plain};
    const uint32_t size[] = {n, n * n, n, n * n, wide, HG_POLYNOMIAL_HALF(wide - 1U), HG_POLYNOMIAL_HALF(wide), self->config->outputs, 1U};
    hg_real defects = HG_REAL_ZERO;
    for (uint8_t i = 0U; i < 9U; i++) {
        for (uint32_t m = 0U; m < size[i]; m++) {
            defects += hg_real_defect(array[i][m]);
        }
    }
    return is_zero(defects);
}

hg_status hg_polynomial_step(hg_polynomial *self, const hg_real *y, const hg_real *radius)
{
    const hg_polynomial_config *config = self->config;
    if (!all_readable(config, y, radius)) {
        return HG_E_NUMERIC;
    }
    take_over(self->radius, radius, config->outputs);
    take_over(self->x, self->c, config->states);
    expand_outputs(self, y);
    run_auxiliary(self);
    expand_states(self);
    predict_auxiliary(self);
    raise_powers(self, 0U, config->states, config->lifted);
    raise_powers(self, config->lifted, config->outputs, config->measured);
    take_means(self);
    take_noise(self);
    if (config->bounded) {
        bound_remainders(self);
    }
    move_moments(self);
    take_measurements(self, take_joint(self));
    if (!all_finite(self)) {
        hg_polynomial_reset(self);
        count_one(&self->restarts);
        return HG_E_NUMERIC;
    }
    return HG_OK;
}

#endif
