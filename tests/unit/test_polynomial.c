/** @file
 *  polynomial.h: the filter by hand where it has one state, its limits, silence, and what it answers when numbers fail. Tables come from polynomial_rig.h, apart
 *  from the host's; plants of several states are in test_polynomial_plants.c. */
#include "support.h"

#include "polynomial_rig.h"

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
    /* On both sides of what indices of 8 bits, and lists of products with those of 16, can hold. */
    assert_true(hg_polynomial_reals(253U, 1U, 1U, false) != UINT32_MAX); /* 254 rows, 255 noises */
    assert_count(UINT32_MAX, hg_polynomial_reals(253U, 2U, 1U, false));
    assert_true(hg_polynomial_reals(16U, 16U, 1U, false) != UINT32_MAX);
    assert_true(hg_polynomial_reals(20U, 1U, 2U, false) != UINT32_MAX);
    assert_count(UINT32_MAX, hg_polynomial_reals(21U, 1U, 2U, false)); /* 276 noises */
    assert_true(hg_polynomial_reals(7U, 2U, 3U, true) != UINT32_MAX);  /* 58 905 products */
    assert_count(UINT32_MAX, hg_polynomial_reals(8U, 1U, 3U, true));   /* 73 815 */
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
    const void **const table[] = {(const void **)&c.f.end,   (const void **)&c.f.coefficient, (const void **)&c.f.factor,   (const void **)&c.h.end,
                                  (const void **)&c.h.coefficient, (const void **)&c.h.factor,  (const void **)&c.start,      (const void **)&c.product,
                                  (const void **)&c.parent,  (const void **)&c.factor,        (const void **)&c.noise,      (const void **)&c.moment,
                                  (const void **)&c.mean,    (const void **)&c.covariance,    (const void **)&c.x0,         (const void **)&c.P0,
                                  (const void **)&c.M0,      (const void **)&c.Q,             (const void **)&c.R,          (const void **)&c.range,
                                  (const void **)&c.fresh,   (const void **)&c.cut_moment,    (const void **)&c.cut_state,  (const void **)&c.cut_scale,
                                  (const void **)&c.box};
    for (size_t i = 0U; i < COUNT(table); i++) {
        REFUSED(*table[i] = NULL);
    }
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
    p->start[1] = 1U;
    const uint16_t kept = p->start[6];
    REFUSED(p->start[6] = (uint16_t)(p->start[7] + 1U));
    p->start[6] = kept;
    REFUSED((c = (hg_polynomial_config){.states = 1U, .outputs = 1U, .degree = 0U, .noises = 1U, .ring = 1U, .lower = 1U, .f = good.f, .h = good.h, .start = p->start,
                .product = p->product, .parent = p->parent, .factor = p->factor, .noise = p->noise, .moment = p->moment, .mean = p->mean, .covariance = p->covariance,
                .x0 = p->x0, .P0 = p->P0, .M0 = p->M0, .Q = p->Q, .R = p->r, .range = p->range, .fresh = p->fresh, .kappa = R(1), .joint = R(1), .weight = R(1),
                .drift = R(1)})); /* the tables of degree 0 */
    c.degree = 4U;
    assert_status(HG_E_ARGUMENT, hg_polynomial_start(NULL, &good, p->memory, REALS_MAX));
    assert_status(HG_E_ARGUMENT, hg_polynomial_start(&p->self, NULL, p->memory, REALS_MAX));
    assert_status(HG_E_ARGUMENT, hg_polynomial_start(&p->self, &good, NULL, REALS_MAX));
    assert_status(HG_E_CONFIG, hg_polynomial_start(&p->self, &c, p->memory, REALS_MAX));
}

static void the_limits_of_every_number_are_valid(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    set_up(p, 1U, 2U, 1U, false, false);
    begin(p);
    hg_polynomial_config c = p->config;
    assert_true(hg_polynomial_valid(&c));
    c.weight = R(1);
    c.f.width = 1U;
    c.reach = R(0); /* nobody asks without a bound */
    c.box = NULL;
    c.cut_moment = NULL;
    c.cut_state = NULL;
    c.cut_scale = NULL;
    p->range[0] = R(0.5);
    for (uint16_t i = 1U; i <= c.ring; i++) {
        p->start[i] = p->start[0]; /* no products at all */
    }
    assert_true(hg_polynomial_valid(&c));
    p->r[1] = R(0);
    assert_false(hg_polynomial_valid(&c));
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
    assert_true(p->self.gain == &p->self.AP[10U * 5U]);
    assert_true(p->self.filtered == &p->self.gain[5U * 5U]);
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

static void at_its_level_no_statistic_is_above_it(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    set_up(p, 1U, 1U, 1U, false, false);
    p->r[0] = R(1.25); /* S = 2.25 */
    p->config.kappa = R(4);
    begin(p);
    assert_status(HG_OK, step(p, 6.0));
    assert_real(6.0, p->self.judgement.plain);
    assert_real(6.0, p->self.judgement.threshold);
    assert_count(0U, p->self.judgement.above & HG_POLYNOMIAL_PLAIN);
    const hg_polynomial_judgement found = p->self.judgement;
    p->config.joint = found.joint;
    p->config.drift = found.drift;
    hg_polynomial_reset(&p->self);
    assert_status(HG_OK, step(p, 6.0));
    assert_real(found.joint, p->self.judgement.joint);
    assert_real(found.drift, p->self.judgement.drift);
    assert_count(0U, p->self.judgement.above);
}

/* As before the first sample: also what nobody has computed yet. */
static void a_reset_is_a_beginning(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    set_up(p, 3U, 2U, 1U, false, false);
    for (uint8_t i = 0U; i < 3U; i++) {
        p->x0[i] = R(0.25 * (1.0 + i));
        p->P0[4U * i] = R(1.0 + i);
    }
    make_tables(p);
    for (size_t round = 0U; round < 2U; round++) {
        if (round == 0U) {
            p->self.dropped = 7U;
            p->self.held = 8U;
            p->self.restarts = 9U;
            arm(p->memory, REALS_MAX);
            assert_status(HG_OK, hg_polynomial_start(&p->self, &p->config, p->memory, REALS_MAX));
            assert_count(0U, p->self.dropped);
            assert_count(0U, p->self.held);
            assert_count(0U, p->self.restarts);
        } else {
            hg_polynomial_reset(&p->self);
        }
        for (size_t i = 0U; i < 9U; i++) {
            assert_real(p->P0[i], p->self.Px[i]);
            assert_real(p->P0[i], p->self.Pe[i]);
        }
        assert_memory_equal(p->x0, p->self.x, 3U * sizeof(hg_real));
        assert_memory_equal(p->x0, p->self.ekf, 3U * sizeof(hg_real));
        assert_memory_equal(p->x0, p->self.c, 3U * sizeof(hg_real));
        assert_real(0.0, p->self.mean[0]);
        assert_real(0.0, p->self.mean[1]);
        assert_count(0U, p->self.judgement.above);
        assert_real(0.0, p->self.judgement.plain);
        assert_status(HG_OK, step(p, 50.0));
        assert_true(p->self.judgement.above != 0U);
    }
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
    static const hg_real second[2] = {R(1), REAL_NAN}, at_range[2] = {R(1000), R(-1000)}, last[2] = {R(0), HG_REAL_MAX}, beyond[2] = {R(0), R(1001)};
    assert_status(HG_E_NUMERIC, hg_polynomial_step(&p->self, second, exact));
    assert_status(HG_OK, hg_polynomial_step(&p->self, at_range, exact));
    assert_status(HG_E_NUMERIC, hg_polynomial_step(&p->self, beyond, last)); /* the largest radius is one: its value is looked at, */
    static const hg_real none[2] = {REAL_INF, HG_REAL_MAX}, far[2] = {REAL_NAN, R(900)};
    hg_polynomial_reset(&p->self);
    assert_status(HG_OK, hg_polynomial_step(&p->self, far, none)); /* and stands in the residual, if in no threshold */
    assert_near(900.0, p->self.judgement.plain, 1e-3);
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
    hg_polynomial_reset(&p->self);
    const hg_real apart[2] = {R(0.5), R(0.75)};
    assert_status(HG_OK, hg_polynomial_step(&p->self, apart, exact));
    assert_near(0.25, p->self.judgement.joint, 1e-4); /* of the first alone */
    assert_near(0.5, p->self.x[0], 1e-5);
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

/* w and v as correlated as c says, which their variances need not allow: J - g g' is about `left`. */
static void with_correlation(rig *p, double c, double left)
{
    set_up(p, 2U, 1U, 1U, false, false);
    make_tables(p);
    p->covariance[1 * 4 + 3] = R(c);
    p->covariance[3 * 4 + 1] = R(c);
    const double without = 1.0 / 36.0 + 0.5 / 9.0 - 2.0 / 3.0 * c; /* Jxx but for Q */
    p->covariance[1 * 4 + 1] = R(left + c * c / 1.5 - without);
    assert_status(HG_OK, hg_polynomial_start(&p->self, &p->config, p->memory, REALS_MAX));
    assert_status(HG_OK, step(p, 0.5));
}

static void a_variance_may_miss_0_by_rounding_and_no_more(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    with_correlation(p, -1.7, -0.46); /* as clearly as may be, and by less than Jxx */
    assert_count(1, p->self.held);
    p->self.held = UINT16_MAX;
    hg_polynomial_reset(&p->self);
    assert_status(HG_OK, step(p, 0.5));
    assert_count(UINT16_MAX, p->self.held);
    if (sizeof(hg_real) == 4U) { /* 5e-6 of 10 000: half of what rounding may leave */
        with_correlation(p, -122.5, -0.05);
        assert_count(0, p->self.held);
        assert_real(0.0, p->self.P[0]);
    }
}

/* What silence is worth is weighed exactly: with J = 4, P = 1 a radius of 1/2 leaves the state as uncertain as it was, and one of sqrt(J) is worth nothing. */
static void silence_that_makes_nothing_smaller_is_not_used(void **state)
{
    (void)state;
    static const struct {
        double   radius;
        uint16_t held;
    } cases[] = {{0.49, 0U}, {0.5, 1U}, {0.51, 1U}, {2.0, 0U}};
    for (size_t i = 0U; i < COUNT(cases); i++) {
        rig *p = fresh(0U);
        set_up(p, 1U, 1U, 1U, false, false);
        p->r[0] = R(3);
        begin(p);
        const hg_real y = R(0), wide = R(cases[i].radius);
        assert_status(HG_OK, hg_polynomial_step(&p->self, &y, &wide));
        assert_count(cases[i].held, p->self.held);
    }
}

/* P that is none, beside one of its numbers that could be one: seen by what the estimate would be, though the prediction has noise enough. */
static void an_estimate_of_less_than_nothing_is_not_made(void **state)
{
    (void)state;
    rig *p = fresh(0U);
    set_up(p, 2U, 1U, 1U, false, false);
    p->Q[0] = R(25);
    p->Q[1] = R(25);
    begin(p);
    p->self.P[0] = R(0.1);    /* the output sees this, */
    p->self.P[1] = R(0.034);  /* their covariance, */
    p->self.P[2] = R(0.001);  /* and of this it would take 0.0019 */
    assert_status(HG_OK, step(p, 0.5));
    assert_count(1, p->self.held);
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

/* Three states that grow, each for itself, and one output: whatever number is not finite any more, the filter begins again. */
static void any_number_that_is_none_begins_again(void **state)
{
    (void)state;
    static const hg_real none = REAL_INF, nothing = REAL_NAN;
    for (size_t i = 0U; i < 11U; i++) {
        rig *p = fresh(0U);
        set_up(p, 3U, 1U, 1U, i == 3U, false);
        p->normal = true;
        for (size_t l = 0U; l < 3U; l++) {
            p->f[l] = (i == 3U) ? R(0.25) : R(2);
        }
        p->range[0] = HG_REAL_MAX;
        begin(p);
        const hg_real large = R(0.9) * HG_REAL_MAX;
        hg_real y = nothing, radius = none;
        if (i == 0U) { /* the estimate alone: c + z */
            p->f[0] = R(0.25);
            p->self.c[0] = large;
            p->self.z[1] = large;
        } else if (i == 1U) {
            p->f[2] = R(0.25);
            p->self.c[2] = large;
            p->self.z[3] = large;
        } else if (i == 2U) { /* c */
            p->self.c[2] = large;
        } else if (i == 3U) { /* the covariance of the estimate, by the bound alone */
            p->self.P[5] = HG_REAL_MAX;
        } else if (i == 4U) {
            p->self.Pe[8] = R(0.4) * HG_REAL_MAX;
        } else if (i == 5U) {
            p->self.z[3] = large;
        } else if (i == 6U) {
            p->self.P[5] = large;
        } else if (i == 7U) {
            p->self.M[9] = large;
        } else if (i == 8U) {
            p->self.mean[0] = nothing;
        } else if (i == 9U) { /* a residual whose square is none, of an output that is there and worth nothing */
            y = R(0.25) * HG_REAL_MAX;
            radius = R(1e10);
        } else {
            assert_status(HG_OK, hg_polynomial_step(&p->self, &y, &radius)); /* and nothing else */
            continue;
        }
        assert_status(HG_E_NUMERIC, hg_polynomial_step(&p->self, &y, &radius));
        assert_count(1, p->self.restarts);
    }
    rig *p = fresh(0U);
    set_up(p, 1U, 2U, 1U, false, false);
    begin(p);
    p->self.mean[1] = nothing; /* the last of several */
    const hg_real both[2] = {none, none};
    assert_status(HG_E_NUMERIC, hg_polynomial_step(&p->self, both, both));
}

/* What is judged stays finite where a square of what is finite is not, and keeps its meaning. */
static void a_judgement_beyond_a_number_is_the_largest(void **state)
{
    (void)state;
    static const hg_real none = REAL_INF, largest = HG_REAL_MAX;
    const double edge = sqrt((double)HG_REAL_MAX);
    rig *p = fresh(0U);
    set_up(p, 1U, 1U, 1U, false, false);
    begin(p);
    const hg_real y = R(500);
    assert_status(HG_OK, hg_polynomial_step(&p->self, &y, &largest));
    assert_real((double)HG_REAL_MAX, p->self.judgement.threshold);
    assert_count(0U, p->self.judgement.above & HG_POLYNOMIAL_PLAIN);

    p = fresh(0U);
    set_up(p, 1U, 1U, 1U, false, false);
    p->P0[0] = R(1e-10);
    p->r[0] = R(1e-10);
    p->range[0] = HG_REAL_MAX;
    p->config.weight = R(1e-10);
    begin(p);
    assert_status(HG_OK, step(p, 0.25 * edge));
    assert_real((double)HG_REAL_MAX, p->self.judgement.joint);
    assert_true((p->self.judgement.above & HG_POLYNOMIAL_JOINT) != 0U);

    p = fresh(0U);
    set_up(p, 1U, 1U, 1U, false, false);
    begin(p);
    p->self.mean[0] = R(2.0 * edge);
    assert_status(HG_OK, hg_polynomial_step(&p->self, &y, &none));
    assert_real((double)HG_REAL_MAX, p->self.judgement.drift);
    assert_count(HG_POLYNOMIAL_DRIFT, p->self.judgement.above);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sizes_are_binomials),
        cmocka_unit_test(validity_looks_at_every_number_and_table),
        cmocka_unit_test(the_limits_of_every_number_are_valid),
        cmocka_unit_test(memory_is_as_long_as_said),
        cmocka_unit_test(the_powers_have_room_for_what_follows),
        cmocka_unit_test(the_third_moment_is_used),
        cmocka_unit_test(linear_and_normal_is_the_kalman_filter),
        cmocka_unit_test(the_bound_is_wider),
        cmocka_unit_test(each_statistic_has_its_level),
        cmocka_unit_test(at_its_level_no_statistic_is_above_it),
        cmocka_unit_test(a_reset_is_a_beginning),
        cmocka_unit_test(wrong_input_changes_nothing),
        cmocka_unit_test(an_absent_output_is_left_out),
        cmocka_unit_test(silence_is_worth_its_radius),
        cmocka_unit_test(outputs_are_left_out_one_by_one),
        cmocka_unit_test(a_component_that_says_nothing_new_is_dropped),
        cmocka_unit_test(an_update_to_no_covariance_is_not_made),
        cmocka_unit_test(a_variance_may_miss_0_by_rounding_and_no_more),
        cmocka_unit_test(silence_that_makes_nothing_smaller_is_not_used),
        cmocka_unit_test(an_estimate_of_less_than_nothing_is_not_made),
        cmocka_unit_test(an_estimate_with_no_covariance_is_not_made),
        cmocka_unit_test(a_state_that_is_none_begins_again),
        cmocka_unit_test(any_number_that_is_none_begins_again),
        cmocka_unit_test(a_judgement_beyond_a_number_is_the_largest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
