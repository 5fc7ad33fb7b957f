/** @file
 *  isolate.h: the judgement of a window, held against sums over the whole window in double precision, for courses of three components; what happens exactly at each
 *  limit; and single sensors. */
#include "support.h"

#include "hullguard/isolate.h"

#define ESTIMATES 6U
#define COMPONENTS 3U
#define SENSORS 2U
#define BLOCK 8U
#define BLOCKS 3U
#define WINDOW (BLOCK * BLOCKS)
#define REALS (HG_ISOLATE_REALS(COMPONENTS, BLOCKS))
#define LOW_PASS 0.375

/* What stands behind a list is nothing that it could hold. */
static const uint8_t sensor_list[SENSORS + 1U] = {2U, 1U, ESTIMATES};
static const hg_real sensor_limit[SENSORS] = {R(0.5), R(0.25)};
static const hg_real whole[COMPONENTS * ESTIMATES] = {R(0.125), R(0), R(0), R(20), R(1), R(-2), R(-0.0625), R(0), R(0), R(2), R(15), R(-12), R(0.25), R(0), R(0), R(-4), R(3), R(18)};
static const hg_real excitation[COMPONENTS] = {R(4), R(1.5), R(2.5)};
static const hg_isolate_config usual = {.estimates = ESTIMATES, .actuator = 0U, .limit = R(0.125), .sensors = SENSORS, .sensor = sensor_list,
                                        .sensor_limit = sensor_limit, .components = COMPONENTS, .whole = whole, .excitation = excitation,
                                        .low_pass = R(LOW_PASS), .settle = 0U, .release = 30U, .block = BLOCK, .blocks = BLOCKS,
                                        .explained = R(0.75), .steady = R(3)};
static const hg_real no_radius[ESTIMATES] = {R(0), R(0), R(0), R(0), R(0), R(0)};

typedef struct {
    hg_isolate   isolate;
    hg_isolation found;
    hg_real      memory[REALS + 1U];
} rig;

static void begin(rig *r, const hg_isolate_config *config)
{
    arm(r->memory, COUNT(r->memory));
    assert_status(HG_OK, hg_isolate_start(&r->isolate, config, r->memory));
    assert_count(UINT32_MAX, r->isolate.quiet); /* nothing was ever outside */
    assert_count(UINT32_MAX, r->isolate.silent);
}

static void step(rig *r, const hg_real *estimate)
{
    assert_status(HG_OK, hg_isolate_step(&r->isolate, estimate, no_radius, &r->found));
    assert_untouched(&r->memory[REALS], 1U);
}

/* ---- the reference ---- */

typedef struct { /* of the samples in the window */
    double phi[WINDOW][COMPONENTS], fault[WINDOW];
} window;

typedef struct {
    hg_cause cause;
    uint32_t candidates;
    double   explained, ratio, share[COMPONENTS + 1U];
    bool     close; /* something was next to its limit: rounding decides */
} judgement;

static bool above(judgement *j, double a, double b)
{
    j->close = j->close || (fabs(a - b) < (1e-3 * (fabs(a) + fabs(b))));
    return a > b;
}

/* Least squares of y - mean on the first `count` columns about their means: coefficients, and what is left. */
static double regress(double x[WINDOW][COMPONENTS], const double *y, size_t count, double *b)
{
    double a[COMPONENTS][COMPONENTS + 1U];
    for (size_t i = 0U; i < count; i++) {
        for (size_t j = 0U; j <= count; j++) {
            a[i][j] = 0.0;
            for (size_t k = 0U; k < WINDOW; k++) {
                a[i][j] += x[k][i] * ((j < count) ? x[k][j] : y[k]);
            }
        }
    }
    for (size_t i = 0U; i < count; i++) {
        for (size_t l = 0U; l < count; l++) {
            const double part = (l == i) ? 0.0 : (a[l][i] / a[i][i]);
            for (size_t j = 0U; j <= count; j++) {
                a[l][j] -= part * a[i][j];
            }
        }
    }
    double left = 0.0;
    for (size_t i = 0U; i < count; i++) {
        b[i] = a[i][count] / a[i][i];
    }
    for (size_t k = 0U; k < WINDOW; k++) {
        double rest = y[k];
        for (size_t i = 0U; i < count; i++) {
            rest -= b[i] * x[k][i];
        }
        left += rest * rest;
    }
    return left;
}

/* b = R^-1 right, where columns that add too little of their own are 0 in the solution: as the header says of share[]. */
static void shares(const hg_isolate_config *c, double x[WINDOW][COMPONENTS], const double *y, const double *mean, double fault_mean, judgement *j)
{
    double rest[WINDOW];
    for (size_t k = 0U; k < WINDOW; k++) {
        rest[k] = y[k];
    }
    j->share[0] = fault_mean;
    for (size_t i = COMPONENTS; i-- > 0U;) {
        double own[WINDOW];
        double coefficients[COMPONENTS];
        double b[COMPONENTS];
        double scatter;
        double whole_scatter = 0.0;
        for (size_t k = 0U; k < WINDOW; k++) {
            own[k] = x[k][i];
        }
        scatter = (i == 0U) ? 0.0 : regress(x, own, i, coefficients);
        for (size_t k = 0U; (i == 0U) && (k < WINDOW); k++) {
            scatter += own[k] * own[k];
        }
        (void)regress(x, rest, i + 1U, b);
        for (size_t k = 0U; k < WINDOW; k++) { /* nothing of its own: then double precision is not enough for sums of squares */
            whole_scatter += own[k] * own[k];
        }
        j->close = j->close || (scatter < (1e-5 * whole_scatter));
        j->share[i + 1U] = above(j, (double)WINDOW * (double)c->excitation[i] * (double)c->excitation[i], scatter) ? 0.0 : b[i];
        for (size_t k = 0U; k < WINDOW; k++) {
            rest[k] -= j->share[i + 1U] * x[k][i];
        }
        j->share[0] -= j->share[i + 1U] * mean[i];
    }
}

static judgement judge(const hg_isolate_config *c, const window *w)
{
    judgement j = {.close = false};
    const double n = (double)WINDOW;
    const double share = (double)c->explained;
    double x[WINDOW][COMPONENTS], y[WINDOW];
    double mean[COMPONENTS] = {0.0, 0.0, 0.0};
    double scatter[COMPONENTS] = {0.0, 0.0, 0.0};
    double shared[COMPONENTS] = {0.0, 0.0, 0.0};
    double fault_mean = 0.0;
    double fault = 0.0;
    double b[COMPONENTS];
    for (size_t k = 0U; k < WINDOW; k++) {
        fault_mean += w->fault[k] / n;
        for (size_t i = 0U; i < COMPONENTS; i++) {
            mean[i] += w->phi[k][i] / n;
        }
    }
    for (size_t k = 0U; k < WINDOW; k++) {
        y[k] = w->fault[k] - fault_mean;
        fault += y[k] * y[k];
        for (size_t i = 0U; i < COMPONENTS; i++) {
            x[k][i] = w->phi[k][i] - mean[i];
            scatter[i] += x[k][i] * x[k][i];
            shared[i] += x[k][i] * y[k];
        }
    }
    uint32_t named = 0U;
    uint32_t rivals = 0U;
    uint32_t count = 0U;
    for (size_t i = 0U; i < COMPONENTS; i++) {
        const double least = (double)c->excitation[i];
        const double about_0 = shared[i] + (n * mean[i] * fault_mean);
        const double square = scatter[i] + (n * mean[i] * mean[i]);
        const bool moves = above(&j, scatter[i], n * least * least);
        const bool centred = above(&j, shared[i] * shared[i] / scatter[i], share * fault);
        const bool whole_of_it = above(&j, about_0 * about_0 / square, share * (fault + (n * fault_mean * fault_mean)));
        if (moves && centred && whole_of_it) {
            named |= 2U << i;
            count++;
        }
        const bool still = above(&j, n * mean[i] * mean[i], (double)c->steady * (double)c->steady * scatter[i]);
        if (still && above(&j, fabs(mean[i]), 0.5 * fabs(fault_mean))) {
            rivals |= 2U << i;
        }
    }
    j.explained = (fault - regress(x, y, COMPONENTS, b)) / fault;
    j.ratio = n * fault_mean * fault_mean / fault;
    const bool steady = above(&j, n * fault_mean * fault_mean, (double)c->steady * (double)c->steady * fault);
    const bool all = above(&j, j.explained, share);
    if (count > 0U) {
        j.cause = (count == 1U) ? HG_CAUSE_COMPONENT : HG_CAUSE_AMBIGUOUS;
        j.candidates = named;
    } else if (steady) {
        j.cause = (rivals == 0U) ? HG_CAUSE_ACTUATOR : HG_CAUSE_AMBIGUOUS;
        j.candidates = rivals | 1U;
    } else {
        j.cause = HG_CAUSE_AMBIGUOUS;
        j.candidates = all ? 14U : 15U;
    }
    shares(c, x, y, mean, fault_mean, &j);
    return j;
}

/* ---- courses ---- */

static double chance(uint32_t *seed)
{
    return draw_between(seed, -1000, 1000) / 1000.0;
}

/* The same are left out, and together they say the same of every sample. Each alone may be known less well, where two components move alike. */
static void check_shares(const hg_isolate *self, const judgement *j, const window *w, double scale)
{
    for (size_t i = 1U; i <= COMPONENTS; i++) {
        assert_int_equal(fabs(j->share[i]) > 0.0, hg_real_abs(self->share[i]) > R(0));
    }
    for (size_t k = 0U; k < WINDOW; k++) {
        double expected = j->share[0];
        double found = (double)self->share[0];
        for (size_t i = 0U; i < COMPONENTS; i++) {
            expected += j->share[i + 1U] * w->phi[k][i];
            found += (double)self->share[i + 1U] * w->phi[k][i];
        }
        assert_near(expected, found, 2e-3 * (scale + fabs(expected)));
    }
}

/* Offsets, motion of the estimates, forces and shares by chance: an actuator, one component, several, or all of it. */
static void compare(const hg_isolate_config *c, uint32_t *seed, double scale, uint32_t *causes)
{
    rig r;
    window w;
    double last[COMPONENTS] = {0.0, 0.0, 0.0};
    double phi[COMPONENTS] = {0.0, 0.0, 0.0};
    double offset[ESTIMATES], motion[ESTIMATES], share[COMPONENTS];
    const int32_t kind = draw_between(seed, 0, 3);
    const size_t one = (size_t)draw_between(seed, 0, (int32_t)COMPONENTS - 1);
    const double actuator = ((kind == 0) || (kind == 3)) ? (scale * 20.0 * chance(seed)) : 0.0;
    const double noise = scale * ((draw_between(seed, 0, 3) == 0) ? 10.0 : 0.25);
    for (size_t e = 3U; e < ESTIMATES; e++) {
        offset[e] = (draw_between(seed, 0, 2) > 0) ? 0.0 : (scale * chance(seed));
        motion[e] = scale * ((draw_between(seed, 0, 2) == 0) ? 0.02 : 1.5);
    }
    for (size_t i = 0U; i < COMPONENTS; i++) {
        share[i] = ((kind >= 2) || ((kind == 1) && (i == one))) ? chance(seed) : 0.0;
    }
    begin(&r, c);
    assert_real(0.0, r.isolate.found.explained);
    assert_real(0.0, r.isolate.found.ratio);
    for (uint32_t k = 0U; k < (6U * WINDOW); k++) {
        hg_real estimate[ESTIMATES] = {R(0), R(0), R(0), R(0), R(0), R(0)};
        double y = actuator + (noise * chance(seed));
        for (size_t e = 3U; e < ESTIMATES; e++) {
            estimate[e] = R(offset[e] + (motion[e] * chance(seed)));
            for (size_t i = 0U; i < COMPONENTS; i++) { /* as phi: the mean of this and the last, through the low pass */
                y += share[i] * 0.5 * LOW_PASS * (double)whole[(i * ESTIMATES) + e] * (double)estimate[e];
            }
        }
        for (size_t i = 0U; i < COMPONENTS; i++) {
            y += share[i] * (((1.0 - LOW_PASS) * phi[i]) + (0.5 * LOW_PASS * last[i]));
        }
        estimate[0] = R(((fabs(y) > (0.25 * scale)) || (k > 0U)) ? y : scale); /* the episode begins at once */
        step(&r, estimate);
        for (size_t i = 0U; i < COMPONENTS; i++) {
            double force = 0.0;
            for (size_t e = 0U; e < ESTIMATES; e++) {
                force += (double)whole[(i * ESTIMATES) + e] * (double)estimate[e];
            }
            phi[i] += LOW_PASS * ((0.5 * (force + last[i])) - phi[i]);
            last[i] = force;
            w.phi[k % WINDOW][i] = phi[i];
        }
        w.fault[k % WINDOW] = (double)estimate[0];
        if (((k + 1U) % BLOCK) == 0U) {
            if ((k + 1U) < WINDOW) {
                assert_int_equal((int)HG_CAUSE_UNDECIDED, (int)r.found.cause);
                continue;
            }
            const judgement j = judge(c, &w);
            assert_near(j.ratio, r.found.ratio, 1e-3 * (0.01 + j.ratio));
            if (!j.close) {
                assert_near(j.explained, r.found.explained, 1e-3);
                assert_int_equal((int)j.cause, (int)r.found.cause);
                assert_count(j.candidates, r.found.candidates);
                causes[j.cause]++;
                check_shares(&r.isolate, &j, &w, scale);
            }
        }
    }
}

static void every_judgement_is_that_of_the_sums(void **state)
{
    (void)state;
    uint32_t seed = seed_of_run(91U);
    const double scales[] = {1.0, 0.0009765625};
    for (size_t s = 0U; s < COUNT(scales); s++) {
        uint32_t causes[6] = {0U, 0U, 0U, 0U, 0U, 0U};
        hg_real least[COMPONENTS];
        hg_isolate_config c = usual;
        c.limit = R((double)usual.limit * scales[s]);
        for (size_t i = 0U; i < COMPONENTS; i++) {
            least[i] = R((double)excitation[i] * scales[s]);
        }
        c.excitation = least;
        for (uint32_t round = 0U; round < 300U; round++) {
            compare(&c, &seed, scales[s], causes);
        }
        assert_true((causes[HG_CAUSE_ACTUATOR] > 50U) && (causes[HG_CAUSE_COMPONENT] > 50U) && (causes[HG_CAUSE_AMBIGUOUS] > 50U));
    }
}

/* ---- at the limits: windows of two samples, small whole numbers ---- */

#define PAIR_REALS (HG_ISOLATE_REALS(1U, 1U))

static const hg_real first_force[2] = {R(0), R(1)};
static const hg_real least_8[1] = {R(8)};

/* Of a component that exerts what estimate 1 says, averaged over two samples: phi is (a, b). */
static hg_isolation of_pair(double explained, double steady, double a, double b, double fault_a, double fault_b, double *share)
{
    hg_isolate self;
    hg_isolation found;
    hg_real memory[PAIR_REALS + 1U];
    const hg_isolate_config c = {.estimates = 2U, .actuator = 0U, .limit = R(0), .components = 1U, .whole = first_force, .excitation = least_8, .low_pass = R(1), .release = 1U,
                                 .block = 2U, .blocks = 1U, .explained = R(explained), .steady = R(steady)};
    const hg_real one[2] = {R(fault_a), R(2.0 * a)};
    const hg_real two[2] = {R(fault_b), R((2.0 * b) - (2.0 * a))};
    arm(memory, COUNT(memory));
    assert_status(HG_OK, hg_isolate_start(&self, &c, memory));
    assert_status(HG_OK, hg_isolate_step(&self, one, no_radius, &found));
    assert_int_equal((int)HG_CAUSE_UNDECIDED, (int)found.cause);
    assert_status(HG_OK, hg_isolate_step(&self, two, no_radius, &found));
    assert_untouched(&memory[PAIR_REALS], 1U);
    share[0] = (double)self.share[0];
    share[1] = (double)self.share[1];
    return found;
}

static void at_its_limit_each_inequality_is_what_the_header_says(void **state)
{
    (void)state;
    double share[2];
    hg_isolation found = of_pair(0.75, 5.0, 8.0, -8.0, 2.0, -2.0, share); /* s(phi) = excitation is enough */
    assert_int_equal((int)HG_CAUSE_COMPONENT, (int)found.cause);
    assert_count(2U, found.candidates);
    assert_real(0.25, R(share[1]));
    found = of_pair(0.0, 5.0, 8.0, -8.0, 16.0, 16.0, share); /* explaining nothing is not explaining more than nothing */
    assert_int_equal((int)HG_CAUSE_ACTUATOR, (int)found.cause);
    assert_count(1U, found.candidates);
    assert_real(HG_REAL_MAX, found.ratio); /* it does not scatter at all */
    found = of_pair(0.0, 5.0, 8.0, 8.0, 2.0, -2.0, share);
    assert_int_equal((int)HG_CAUSE_AMBIGUOUS, (int)found.cause);
    assert_count(3U, found.candidates);
    found = of_pair(0.75, 5.0, 0.0, 0.0, 6.0, 4.0, share); /* |m| = steady s is not steady */
    assert_int_equal((int)HG_CAUSE_AMBIGUOUS, (int)found.cause);
    assert_count(3U, found.candidates);
    assert_real(25.0, found.ratio);
    found = of_pair(0.75, 5.0, 8.0, 8.0, 16.0, 16.0, share); /* half as large is large enough for a rival */
    assert_int_equal((int)HG_CAUSE_AMBIGUOUS, (int)found.cause);
    assert_count(3U, found.candidates);
    found = of_pair(0.75, 5.0, 7.75, 7.75, 16.0, 16.0, share);
    assert_int_equal((int)HG_CAUSE_ACTUATOR, (int)found.cause);
    found = of_pair(0.75, 1.0, 0.0, 0.0, 0.03125, 0.015625, share); /* small numbers are judged as large ones are */
    assert_int_equal((int)HG_CAUSE_ACTUATOR, (int)found.cause);
    assert_real(9.0, found.ratio);
}

static void any_number_of_blocks_is_judged(void **state)
{
    (void)state;
    static hg_real memory[HG_ISOLATE_REALS(0U, 1U)];
    const hg_isolate_config c = {.estimates = 1U, .limit = R(12), .low_pass = R(1), .release = 1U, .block = 1U, .blocks = 1U, .steady = R(1)};
    hg_isolate self;
    hg_isolation found;
    assert_status(HG_OK, hg_isolate_start(&self, &c, memory));
    for (uint32_t k = 0U; k < 700U; k++) {
        const hg_real estimate = R(64 + k);
        assert_status(HG_OK, hg_isolate_step(&self, &estimate, no_radius, &found));
        assert_real(estimate, self.share[0]);
    }
}

static void two_that_stand_still_are_two_rivals(void **state)
{
    (void)state;
    rig r;
    const hg_real estimate[ESTIMATES] = {R(4), R(0), R(0), R(1), R(1), R(0)}; /* forces 21.5, 16.75 and 0 */
    begin(&r, &usual);
    for (uint32_t k = 0U; k < (10U * WINDOW); k++) {
        step(&r, estimate);
    }
    assert_int_equal((int)HG_CAUSE_AMBIGUOUS, (int)r.found.cause);
    assert_count(1U | 2U | 4U, r.found.candidates);
}

/* ---- tables and numbers ---- */

static void the_limits_of_every_number_are_valid(void **state)
{
    (void)state;
    static uint8_t many[31];
    static hg_real limits[31], forces[31 * ESTIMATES], least[31];
    static const uint8_t first_outside[SENSORS + 1U] = {ESTIMATES, 0U, 0U};
    static const hg_real first_nothing[COMPONENTS] = {R(0), R(1), R(1)};
    for (size_t i = 0U; i < COUNT(least); i++) {
        least[i] = R(1);
    }
    assert_true(hg_isolate_valid(&usual));
    hg_isolate_config c = usual;
    c.sensor = many;
    c.sensor_limit = limits;
    c.whole = forces;
    c.excitation = least;
    for (uint8_t components = 0U; components <= 31U; components++) {
        c.components = components;
        for (uint8_t sensors = 0U; sensors <= 31U; sensors++) {
            c.sensors = sensors;
            assert_int_equal((components + sensors) <= 30U, hg_isolate_valid(&c)); /* and the actuator */
        }
    }
    hg_isolate_config good[7] = {usual, usual, usual, usual, usual, usual, usual};
    good[0].release = 1U;
    good[1].limit = R(0);
    good[2].limit = R(0.5);
    good[3].low_pass = R(1);
    good[4].explained = R(0);
    good[5].steady = R(0.5);
    good[6].block = 1U;
    for (size_t i = 0U; i < COUNT(good); i++) {
        assert_true(hg_isolate_valid(&good[i]));
    }
    hg_isolate_config bad[2] = {usual, usual};
    bad[0].sensor = first_outside;
    bad[1].excitation = first_nothing;
    for (size_t i = 0U; i < COUNT(bad); i++) {
        assert_false(hg_isolate_valid(&bad[i]));
    }
}

static void every_number_is_looked_at(void **state)
{
    (void)state;
    rig r;
    static const hg_real unread[COMPONENTS * ESTIMATES] = {[3] = R(1), [ESTIMATES + 3U] = R(1), [(2U * ESTIMATES) + 3U] = R(2)};
    hg_isolate_config c = usual;
    c.whole = unread;
    begin(&r, &c);
    for (size_t e = 0U; e < ESTIMATES; e++) {
        hg_real estimate[ESTIMATES] = {R(0), R(0), R(0), R(0), R(0), R(0)};
        hg_real radius[ESTIMATES] = {R(0), R(0), R(0), R(0), R(0), R(0)};
        estimate[e] = R(2e9);
        assert_status(HG_E_NUMERIC, hg_isolate_step(&r.isolate, estimate, radius, &r.found));
        estimate[e] = R(0);
        radius[e] = R(-0.5);
        assert_status(HG_E_NUMERIC, hg_isolate_step(&r.isolate, estimate, radius, &r.found));
    }
    const hg_real last[ESTIMATES] = {R(0), R(0), R(0), R(6e8), R(0), R(0)}; /* only the last component's force is too large */
    assert_status(HG_E_NUMERIC, hg_isolate_step(&r.isolate, last, no_radius, &r.found));
}

/* ---- sensors ---- */

static void each_sensor_has_its_own_row_and_limit(void **state)
{
    (void)state;
    rig r;
    hg_real estimate[ESTIMATES] = {R(0), R(0), R(0.75), R(0), R(0), R(0)};
    hg_real radius[ESTIMATES] = {R(0), R(0), R(1), R(0), R(0), R(0)};
    begin(&r, &usual);
    assert_status(HG_OK, hg_isolate_step(&r.isolate, estimate, radius, &r.found));
    assert_int_equal((int)HG_CAUSE_INPUT, (int)r.found.cause); /* within its radius */
    estimate[2] = R(0.375);
    step(&r, estimate);
    assert_int_equal((int)HG_CAUSE_INPUT, (int)r.found.cause); /* within its limit, and beyond the other one's */
    estimate[2] = R(0.75);
    for (uint32_t k = 0U; k < 3U; k++) { /* once, and once more */
        step(&r, estimate);
        assert_int_equal((int)HG_CAUSE_SENSOR, (int)r.found.cause);
        assert_count(0x10U, r.found.candidates);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_judgement_is_that_of_the_sums),
        cmocka_unit_test(at_its_limit_each_inequality_is_what_the_header_says),
        cmocka_unit_test(any_number_of_blocks_is_judged),
        cmocka_unit_test(two_that_stand_still_are_two_rivals),
        cmocka_unit_test(the_limits_of_every_number_are_valid),
        cmocka_unit_test(every_number_is_looked_at),
        cmocka_unit_test(each_sensor_has_its_own_row_and_limit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
