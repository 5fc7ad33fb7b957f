/** @file
 *  polynomial.h: the filter by hand where it has one state, its limits, silence, and what it answers when numbers fail. The tables are made here by counting,
 *  apart from the host's. Nonlinear plants with skewed noise are held against an independent reference by the host's tests. */
#include "support.h"

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

static rig *fresh(size_t which)
{
    memset(&rigs[which], 0, sizeof rigs[which]);
    return &rigs[which];
}

static uint8_t degree_of(const monomial *m, uint8_t from, uint8_t to)
{
    uint8_t sum = 0U;
    for (uint8_t i = from; i < to; i++) {
        sum = (uint8_t)(sum + m->exponent[i]);
    }
    return sum;
}

/* All monomials in graded order, by counting through all exponents in the order in which the first variable's is largest first. */
static uint16_t list(monomial *out, uint8_t variables, uint8_t degree)
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

static uint16_t find(const monomial *among, uint16_t count, const monomial *wanted)
{
    for (uint16_t i = 0U; i < count; i++) {
        if (memcmp(&among[i], wanted, sizeof *wanted) == 0) {
            return i;
        }
    }
    assert_true(false); /* no such monomial */
    return 0U;
}

static monomial part(const monomial *m, uint8_t from, uint8_t to)
{
    monomial found = {{0U}};
    for (uint8_t i = from; i < to; i++) {
        found.exponent[i - from] = m->exponent[i];
    }
    return found;
}

static monomial times(const monomial *a, const monomial *b)
{
    monomial found;
    for (uint8_t i = 0U; i < VARIABLES_MAX; i++) {
        found.exponent[i] = (uint8_t)(a->exponent[i] + b->exponent[i]);
    }
    return found;
}

/* Moments of a normal number of this variance with a third moment beside, exact to degree 4; degree 6 only where it is normal. */
static double moment_of(double variance, double third, uint8_t order)
{
    const double of[] = {1.0, 0.0, variance, third, 3.0 * variance * variance, 0.0, 15.0 * variance * variance * variance};
    return of[order];
}

static double expected(const rig *p, const monomial *b)
{
    double product = 1.0;
    const uint8_t n = p->config.states;
    for (uint8_t i = 0U; i < n + p->config.outputs; i++) {
        const double variance = (double)((i < n) ? p->Q[i] : p->r[i - n]);
        product *= moment_of(variance, ((i < n) || p->normal) ? 0.0 : 0.5 * variance * sqrt(variance), b->exponent[i]);
    }
    return product;
}

static void make_powers(rig *p, const monomial *order, uint16_t count, uint8_t variables, uint16_t at)
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

static void make_cuts(rig *p)
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
static void make_tables(rig *p)
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

/* n states x+ = 0.5 x (the first; cubic x^3 / 8 off with `cubic`), p outputs that all see the first. */
static void set_up(rig *p, uint8_t n, uint8_t outputs, uint8_t mu, bool bounded, bool cubic)
{
    memset(p, 0, sizeof *p);
    p->config = (hg_polynomial_config){.states = n, .outputs = outputs, .degree = mu, .bounded = bounded, .f = {3U, p->f_end, p->f, p->f_factor},
        .h = {1U, p->h_end, p->h, p->h_factor}, .start = p->start, .product = p->product, .parent = p->parent, .factor = p->factor, .noise = p->noise,
        .moment = p->moment, .mean = p->mean, .covariance = p->covariance, .cut_moment = p->cut_moment, .cut_state = p->cut_state, .cut_scale = p->cut_scale,
        .box = p->box, .reach = R(3), .x0 = p->x0, .P0 = p->P0, .M0 = p->M0, .Q = p->Q, .R = p->r, .range = p->range, .fresh = p->fresh, .kappa = R(4.47),
        .joint = R(20), .weight = R(0.125), .drift = R(9)};
    uint16_t terms = 0U;
    memset(p->f_factor, HG_POLYNOMIAL_NONE, sizeof p->f_factor);
    for (uint8_t l = 0U; l < n; l++) {
        p->f[terms] = R(0.5);
        p->f_factor[3U * terms] = l;
        terms++;
        if (cubic && (l == 0U)) {
            p->f[terms] = R(-0.125);
            memset(&p->f_factor[3U * terms], 0, 3U);
            terms++;
        }
        p->f_end[l] = terms;
        p->P0[l * n + l] = (l == 0U) ? R(1) : R(0);
        p->Q[l] = (l == 0U) ? R(0.25) : R(0);
        p->box[l] = R(100);
    }
    for (uint8_t j = 0U; j < outputs; j++) {
        p->h[j] = R(1);
        p->h_end[j] = (uint16_t)(j + 1U);
        p->r[j] = R(0.5);
        p->range[j] = R(1000);
    }
}

static void begin(rig *p)
{
    make_tables(p);
    assert_status(HG_OK, hg_polynomial_start(&p->self, &p->config, p->memory, REALS_MAX));
}

static const hg_real exact[4] = {R(0), R(0), R(0), R(0)};

static hg_status step(rig *p, double y)
{
    const hg_real all[4] = {R(y), R(y), R(y), R(y)};
    return hg_polynomial_step(&p->self, all, exact);
}

static void sizes_are_binomials(void **state)
{
    (void)state;
    assert_count(1, hg_polynomial_count(5U, 0U));
    assert_count(56, hg_polynomial_count(5U, 3U));
    assert_count(UINT32_MAX, hg_polynomial_count(100000U, 3U));
    assert_count(HG_POLYNOMIAL_REALS(2, 1, 5, 2, 21), hg_polynomial_reals(2U, 1U, 2U, false));
    assert_count(HG_POLYNOMIAL_REALS(2, 1, 5, 2, 56), hg_polynomial_reals(2U, 1U, 2U, true));
    static const uint8_t refused[][4] = {{0U, 1U, 2U, 0U},   {1U, 0U, 2U, 0U},     {1U, 1U, 0U, 0U},   {1U, 1U, 4U, 0U},   {255U, 1U, 1U, 0U},
                                         {1U, 255U, 1U, 0U}, {200U, 100U, 1U, 0U}, {11U, 11U, 2U, 0U}, {253U, 1U, 1U, 1U}};
    for (size_t i = 0U; i < COUNT(refused); i++) {
        assert_count(UINT32_MAX, hg_polynomial_reals(refused[i][0], refused[i][1], refused[i][2], refused[i][3] != 0U));
    }
}

static void validity_looks_at_every_number_and_table(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    set_up(p, 1U, 1U, 2U, true, false);
    begin(p);
    const hg_polynomial_config good = p->config;
    hg_polynomial_config c = good;
#define REFUSED(change)                        \
    do {                                       \
        c = good;                              \
        change;                                \
        assert_false(hg_polynomial_valid(&c)); \
    } while (false)
    REFUSED(c.degree = 4U);
    REFUSED(c.lifted++);
    REFUSED(c.lower--);
    REFUSED(c.judged--);
    REFUSED(c.f.end = NULL);
    REFUSED(c.fresh = NULL);
    REFUSED(c.box = NULL);
    REFUSED(c.f.width = 0U);
    REFUSED(c.h.width = 0U);
    REFUSED(c.weight = R(1.5));
    REFUSED(c.weight = R(0));
    REFUSED(c.kappa = R(0));
    REFUSED(c.reach = R(0));
    REFUSED(p->r[0] = R(0));
    p->r[0] = R(0.5);
    REFUSED(p->range[0] = R(0));
    p->range[0] = R(1000);
    REFUSED(p->fresh[0] = R(-1));
    p->fresh[0] = R(0);
    REFUSED(p->start[1] = 0U; p->start[0] = 1U);
    p->start[0] = 0U;
    c.degree = 4U;
    assert_status(HG_E_ARGUMENT, hg_polynomial_start(NULL, &good, p->memory, REALS_MAX));
    assert_status(HG_E_ARGUMENT, hg_polynomial_start(&p->self, NULL, p->memory, REALS_MAX));
    assert_status(HG_E_ARGUMENT, hg_polynomial_start(&p->self, &good, NULL, REALS_MAX));
    assert_status(HG_E_CONFIG, hg_polynomial_start(&p->self, &c, p->memory, REALS_MAX));
}

static void memory_is_as_long_as_said(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    set_up(p, 2U, 2U, 2U, true, true);
    begin(p);
    const uint32_t length = hg_polynomial_reals(2U, 2U, 2U, true);
    assert_status(HG_E_SIZE, hg_polynomial_start(&p->self, &p->config, p->memory, length - 1U));
    arm(&p->memory[length], REALS_MAX - length);
    assert_status(HG_OK, hg_polynomial_start(&p->self, &p->config, p->memory, length));
    assert_status(HG_OK, step(p, 1.0));
    assert_untouched(&p->memory[length], REALS_MAX - length);
    assert_true(&p->self.term[p->config.ring] == &p->memory[length]);
    set_up(p, 2U, 1U, 2U, false, true);
    begin(p);
    const uint32_t plain = hg_polynomial_reals(2U, 1U, 2U, false);
    assert_true(&p->self.J[HG_POLYNOMIAL_HALF(7U)] == &p->memory[plain]);
    assert_true(plain < length);
}

/* What lies in the place of the powers once they are done with is never longer than they are. */
static void the_powers_have_room_for_what_follows(void **state)
{
    (void)state;
    uint32_t sizes = 0U;
    for (uint8_t n = 1U; n <= 100U; n++) {
        for (uint8_t p = 1U; p <= 100U; p++) {
            for (uint8_t mu = 1U; mu <= 3U; mu++) {
                if (hg_polynomial_reals(n, p, mu, false) != UINT32_MAX) {
                    const uint32_t lifted = hg_polynomial_count(n, mu) - 1U;
                    const uint32_t measured = hg_polynomial_count(p, mu) - 1U;
                    const uint32_t ring = hg_polynomial_count((2U * n) + p, mu);
                    assert_true((lifted + measured) * ring >= ((lifted + measured) * lifted) + ((lifted + n) * measured));
                    sizes++;
                }
            }
        }
    }
    assert_true(sizes > 1000U);
}

/* Best estimate of x from 1, y, y^2 with x ~ N(0, 1), y = x + v, E v^2 = R, E v^3 = s: by its normal equations. */
static void the_third_moment_is_used(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    set_up(p, 1U, 1U, 2U, false, false);
    begin(p);
    const double P = 1.0, r = 0.5, s = 0.5 * r * sqrt(r), y = 0.75;
    const double S11 = P + r, S12 = s, S22 = 3.0 * P * P + 6.0 * P * r + 3.0 * r * r - S11 * S11;
    const double det = S11 * S22 - S12 * S12, r2 = y * y - S11;
    const double k1 = P * S22 / det, k2 = -P * S12 / det;
    assert_status(HG_OK, step(p, y));
    assert_near(k1 * y + k2 * r2, p->self.x[0], 1e-6);
    assert_near(P - k1 * P, p->self.Px[0], 1e-6);
    assert_near(P / S11 * y, p->self.ekf[0], 1e-6);
    assert_near((S22 * y * y - 2.0 * S12 * y * r2 + S11 * r2 * r2) / det, p->self.judgement.joint, 1e-5);
    assert_near(y, p->self.judgement.plain, 1e-6);
    assert_near(4.47 * sqrt(S11), p->self.judgement.threshold, 1e-5);
    assert_near(0.125 * 0.125 * y * y / S11 * 15.0, p->self.judgement.drift, 1e-6);
    assert_count(0, p->self.judgement.above);
}

/* Degree 1, or normal noise with a linear plant, is the Kalman filter. */
static void linear_and_normal_is_the_kalman_filter(void **state)
{
    (void)state;
    for (uint8_t mu = 1U; mu <= 3U; mu++) {
        rig *p = fresh(0U);
        double x = 0.0, P = 1.0;
        set_up(p, 1U, 1U, mu, false, false);
        p->normal = true;
        begin(p);
        for (int k = 0; k < 50; k++) {
            const double y = sin(0.7 * k) + ((k % 3) - 1.0);
            const double K = P / (P + 0.5);
            assert_status(HG_OK, step(p, y));
            x += K * (y - x);
            P -= K * P;
            assert_near(x, p->self.x[0], 2e-5);
            assert_near(P, p->self.Px[0], 2e-5);
            assert_near(x, p->self.ekf[0], 2e-5);
            x *= 0.5;
            P = 0.25 * P + 0.25;
        }
    }
}

/* A bound is never below the plain covariance, and the noise-free state stays what it is. */
static void the_bound_is_wider(void **state)
{
    (void)state;
    rig *plain = fresh(0U);
    rig *wide = fresh(1U);
    set_up(plain, 2U, 1U, 2U, false, true);
    set_up(wide, 2U, 1U, 2U, true, true);
    begin(plain);
    begin(wide);
    for (int k = 0; k < 30; k++) {
        const double y = 0.5 * sin(0.7 * k);
        assert_status(HG_OK, step(plain, y));
        assert_status(HG_OK, step(wide, y));
        assert_true(wide->self.Px[0] > plain->self.Px[0]);
        assert_real(0.0, plain->self.x[1]);
        assert_real(0.0, plain->self.Px[3]);
    }
    assert_count(0, wide->self.restarts);
}

static void each_statistic_has_its_level(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    set_up(p, 1U, 1U, 2U, false, false);
    begin(p);
    assert_status(HG_OK, step(p, 50.0));
    assert_count(HG_POLYNOMIAL_PLAIN | HG_POLYNOMIAL_JOINT | HG_POLYNOMIAL_DRIFT, p->self.judgement.above);
    hg_polynomial_reset(&p->self);
    for (int k = 0; k < 40; k++) {
        assert_status(HG_OK, step(p, 2.0));
    }
    assert_count(HG_POLYNOMIAL_DRIFT, p->self.judgement.above);
}

static void wrong_input_changes_nothing(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    static hg_real before[REALS_MAX];
    set_up(p, 1U, 1U, 2U, false, false);
    begin(p);
    assert_status(HG_OK, step(p, 0.5));
    memcpy(before, p->memory, sizeof before);
    static const hg_real bad[][2] = {{REAL_NAN, R(0)}, {REAL_INF, R(0)}, {R(1001), R(0)}, {R(1), R(-1)}, {R(1), REAL_NAN}};
    for (size_t i = 0U; i < COUNT(bad); i++) {
        assert_status(HG_E_NUMERIC, hg_polynomial_step(&p->self, &bad[i][0], &bad[i][1]));
        assert_memory_equal(before, p->memory, sizeof before);
    }
    set_up(p, 1U, 2U, 1U, false, false);
    begin(p);
    static const hg_real first[2] = {REAL_NAN, R(1)};
    assert_status(HG_E_NUMERIC, hg_polynomial_step(&p->self, first, exact));
    assert_count(0, p->self.restarts);
}

/* Nothing known: prediction alone, the value is not read. */
static void an_absent_output_is_left_out(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    static const hg_real y = REAL_NAN, none = REAL_INF;
    set_up(p, 1U, 1U, 2U, false, false);
    begin(p);
    double P = 1.0;
    for (int k = 0; k < 5; k++) {
        assert_status(HG_OK, hg_polynomial_step(&p->self, &y, &none));
        assert_near(0.0, p->self.x[0], 1e-6);
        assert_near(P, p->self.Px[0], 1e-5);
        assert_count(0, p->self.judgement.above);
        P = 0.25 * P + 0.25;
        assert_near(P, p->self.Pe[0], 1e-5);
    }
}

/* Between measurement and nothing: a small radius still narrows, less than a measurement; a large one does not; the threshold grows by it. */
static void silence_is_worth_its_radius(void **state)
{
    (void)state;
    double last = 0.0;
    static const double radius[] = {0.0, 0.1, 0.3, 1.0, 5.0};
    for (size_t i = 0U; i < COUNT(radius); i++) {
        rig *p = fresh(0U);
        set_up(p, 1U, 1U, 2U, false, false);
        begin(p);
        const hg_real y = R(0.5), wide = R(radius[i]);
        assert_status(HG_OK, hg_polynomial_step(&p->self, &y, &wide));
        assert_true((double)p->self.Px[0] >= last);
        assert_true((double)p->self.Px[0] <= 1.0);
        last = (double)p->self.Px[0];
        assert_near(4.47 * sqrt(1.5) + radius[i], p->self.judgement.threshold, 1e-5);
        if (i > 0U) { /* the point of expansion does not hear it */
            assert_near(0.0, p->self.ekf[0], 1e-6);
        }
    }
    assert_near(1.0, last, 1e-6);
    rig *p = fresh(1U);
    set_up(p, 1U, 1U, 2U, false, false);
    p->fresh[0] = R(0.1);
    begin(p);
    const hg_real y = R(0.5), within = R(0.1);
    assert_status(HG_OK, hg_polynomial_step(&p->self, &y, &within));
    assert_near(0.5 / 1.5, p->self.ekf[0], 1e-6);
    assert_near(4.47 * sqrt(1.5), p->self.judgement.threshold, 1e-5);
}

/* Two outputs: one measured, the other silent and then unknown. Powers with an output that is left out are left out too. */
static void outputs_are_left_out_one_by_one(void **state)
{
    (void)state;
    rig *both = fresh(0U);
    rig *one = fresh(1U);
    rig *none = fresh(2U);
    static const hg_real y[2] = {R(0.5), R(0.25)};
    static const hg_real small[2] = {R(0), R(0.01)}, unknown[2] = {R(0), REAL_INF};
    rig *const all[] = {both, one, none};
    const hg_real *const radius[] = {exact, small, unknown};
    for (size_t i = 0U; i < 3U; i++) {
        set_up(all[i], 1U, 2U, 2U, false, false);
        begin(all[i]);
        assert_status(HG_OK, hg_polynomial_step(&all[i]->self, y, radius[i]));
    }
    assert_true(both->self.Px[0] < one->self.Px[0]);
    assert_true(one->self.Px[0] < none->self.Px[0]);
    rig *single = fresh(3U);
    set_up(single, 1U, 1U, 2U, false, false);
    begin(single);
    assert_status(HG_OK, hg_polynomial_step(&single->self, y, exact));
    assert_near(single->self.x[0], none->self.x[0], 1e-6);
    assert_near(single->self.Px[0], none->self.Px[0], 1e-6);
}

/* Two outputs without noise that say the same: the second is left out, and what remains is right. */
static void a_component_that_says_nothing_new_is_dropped(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    set_up(p, 1U, 2U, 1U, false, false);
    p->r[0] = R(1e-13);
    p->r[1] = R(1e-13);
    begin(p);
    for (int k = 0; k < 5; k++) {
        assert_status(HG_OK, step(p, 0.5));
        assert_near(0.5, p->self.x[0], 1e-5);
        assert_true(p->self.Px[0] >= R(0));
    }
    assert_count(10, p->self.dropped); /* of the auxiliary filter and of this, each sample */
    p->self.dropped = UINT16_MAX;
    assert_status(HG_OK, step(p, 0.5));
    assert_count(UINT16_MAX, p->self.dropped);
}

/* Tables that are no covariance: an update that would leave a negative variance is not made. */
static void an_update_to_no_covariance_is_not_made(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    set_up(p, 2U, 1U, 1U, false, false);
    make_tables(p);
    p->covariance[1 * 4 + 3] = R(-5);
    p->covariance[3 * 4 + 1] = R(-5);
    assert_status(HG_OK, hg_polynomial_start(&p->self, &p->config, p->memory, REALS_MAX));
    assert_status(HG_OK, step(p, 0.5));
    assert_count(1, p->self.held);
    assert_real(0.0, p->self.x[0]);
    assert_real(1.0, p->self.Px[0]);
    assert_near(11.0 / 3.0, p->self.P[0], 1e-5); /* Jxx: (1/6)^2 P + (1/3)^2 R + Q + 2 (1/3) 5 */
}

/* Nor one for the estimate: P itself is none. */
static void an_estimate_with_no_covariance_is_not_made(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    set_up(p, 1U, 1U, 1U, false, false);
    begin(p);
    p->self.P[0] = R(-0.25);
    assert_status(HG_OK, step(p, 0.5));
    assert_count(1, p->self.held);
    assert_true(p->self.Px[0] >= R(0));
}

static void a_state_that_is_none_begins_again(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    static const hg_real y = R(0), none = REAL_INF;
    set_up(p, 1U, 1U, 2U, false, true);
    p->f[1] = R(1e30);
    p->x0[0] = R(2);
    begin(p);
    hg_status status = HG_OK;
    for (int k = 0; (k < 20) && (status == HG_OK); k++) {
        status = hg_polynomial_step(&p->self, &y, &none);
    }
    assert_status(HG_E_NUMERIC, status);
    assert_count(1, p->self.restarts);
    assert_real(2.0, p->self.c[0]);
    assert_real(1.0, p->self.Pe[0]);
    assert_count(0, p->self.judgement.above);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sizes_are_binomials),
        cmocka_unit_test(validity_looks_at_every_number_and_table),
        cmocka_unit_test(memory_is_as_long_as_said),
        cmocka_unit_test(the_powers_have_room_for_what_follows),
        cmocka_unit_test(the_third_moment_is_used),
        cmocka_unit_test(linear_and_normal_is_the_kalman_filter),
        cmocka_unit_test(the_bound_is_wider),
        cmocka_unit_test(each_statistic_has_its_level),
        cmocka_unit_test(wrong_input_changes_nothing),
        cmocka_unit_test(an_absent_output_is_left_out),
        cmocka_unit_test(silence_is_worth_its_radius),
        cmocka_unit_test(outputs_are_left_out_one_by_one),
        cmocka_unit_test(a_component_that_says_nothing_new_is_dropped),
        cmocka_unit_test(an_update_to_no_covariance_is_not_made),
        cmocka_unit_test(an_estimate_with_no_covariance_is_not_made),
        cmocka_unit_test(a_state_that_is_none_begins_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
