/** @file
 *  bank.h: certificates over a window, against the sums of their definition in double precision. */
#include "support.h"

#include "hullguard/bank.h"

#define VALUES 3U  /* signals that have a value */
#define RADII 5U   /* signals that have a radius */
#define LENGTH 6U  /* of the ring of values */
#define HISTORY 8U /* of the ring of radii */
#define WINDOW 4U
#define WIDTH 2U
#define EXTRAS 2U
#define CERTIFICATES 3U

static const uint8_t signal_list[WIDTH] = {2U, 0U};
static const uint8_t extra_list[EXTRAS] = {4U, 3U};
static hg_real weight_table[WINDOW * WIDTH * CERTIFICATES];
static hg_real extra_table[WINDOW * EXTRAS * CERTIFICATES];
static const hg_real bias_table[CERTIFICATES] = {R(1), R(0.5), R(2)};
static const hg_bank_config usual = {.certificates = CERTIFICATES, .window = WINDOW, .width = WIDTH, .signal = signal_list,
                                     .weight = weight_table, .extras = EXTRAS, .extra = extra_list, .extra_weight = extra_table,
                                     .bias = bias_table, .widen = R(1.5)};

/* Small multiples of 1/8, of both signs: every sum is exact in float32 too. */
static int fill_weights(void **state)
{
    (void)state;
    for (size_t i = 0U; i < COUNT(weight_table); i++) {
        weight_table[i] = R(((double)((i * 7U) % 11U) - 5.0) / 8.0);
    }
    for (size_t i = 0U; i < COUNT(extra_table); i++) {
        extra_table[i] = R((double)((i * 5U) % 7U) / 8.0);
    }
    return 0;
}

typedef struct {
    hg_bank self;
    hg_ring value;
    hg_ring radius;
    hg_real values[VALUES * LENGTH];
    hg_real radii[RADII * HISTORY];
    hg_acc  sum[HG_BANK_SUMS(CERTIFICATES) + 1U];
    hg_real r[2];
    hg_real J[2];
} rig;

static void begin(rig *b, const hg_bank_config *config)
{
    (void)memset(b, 0x5A, sizeof(*b));
    arm(b->sum, COUNT(b->sum));
    assert_status(HG_OK, hg_ring_start(&b->value, VALUES, LENGTH, b->values));
    assert_status(HG_OK, hg_ring_start(&b->radius, RADII, HISTORY, b->radii));
    assert_true(hg_bank_valid(config, VALUES, RADII, LENGTH));
    assert_status(HG_OK, hg_bank_start(&b->self, config, b->sum));
}

static hg_status step(rig *b, const hg_real *value, const hg_real *radius)
{
    arm(b->r, 2U);
    arm(b->J, 2U);
    assert_status(HG_OK, hg_ring_push(&b->value, value));
    assert_status(HG_OK, hg_ring_push(&b->radius, radius));
    const hg_status status = hg_bank_step(&b->self, &b->value, &b->radius, b->r, b->J);
    assert_untouched(&b->r[1], 1U);
    assert_untouched(&b->J[1], 1U);
    assert_untouched(&b->sum[HG_BANK_SUMS(b->self.config->certificates)], 1U);
    return status;
}

static void start_tells_null(void **state)
{
    (void)state;
    hg_bank self;
    hg_acc sum[HG_BANK_SUMS(CERTIFICATES)];
    arm(sum, COUNT(sum));
    assert_status(HG_E_ARGUMENT, hg_bank_start(NULL, &usual, sum));
    assert_status(HG_E_ARGUMENT, hg_bank_start(&self, NULL, sum));
    assert_status(HG_E_ARGUMENT, hg_bank_start(&self, &usual, NULL));
    assert_untouched(sum, COUNT(sum));
    assert_status(HG_OK, hg_bank_start(&self, &usual, sum));
    for (size_t i = 0U; i < COUNT(sum); i++) {
        assert_real(0.0, sum[i]);
    }
}

static void validity_looks_at_every_number_and_table(void **state)
{
    (void)state;
    assert_true(hg_bank_valid(&usual, VALUES, RADII, WINDOW));
    assert_false(hg_bank_valid(&usual, VALUES, RADII, WINDOW - 1U));
    assert_false(hg_bank_valid(&usual, VALUES - 1U, RADII, LENGTH));
    assert_false(hg_bank_valid(&usual, VALUES, RADII - 1U, LENGTH));
    assert_false(hg_bank_valid(&usual, VALUES, 2U, LENGTH));
    hg_bank_config c[11];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = usual;
    }
    c[0].certificates = 0U;
    c[1].window = 0U;
    c[2].width = 0U;
    c[3].signal = NULL;
    c[4].weight = NULL;
    c[5].bias = NULL;
    c[6].widen = R(1) - ((sizeof(hg_real) == 4U) ? R(FLT_EPSILON) : R(DBL_EPSILON));
    c[7].widen = REAL_NAN;
    c[8].extra = NULL;
    c[9].extra_weight = NULL;
    c[10].window = LENGTH + 1U;
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_false(hg_bank_valid(&c[i], VALUES, RADII, LENGTH));
    }
    c[8].extras = 0U;
    c[9].extras = 0U;
    assert_true(hg_bank_valid(&c[8], VALUES, RADII, LENGTH));
    assert_true(hg_bank_valid(&c[9], VALUES, RADII, LENGTH));
    c[6].widen = R(1);
    assert_true(hg_bank_valid(&c[6], VALUES, RADII, LENGTH));
}

/* One certificate is a bank. */
static void the_smallest_bank_is_taken(void **state)
{
    (void)state;
    hg_bank_config c = usual;
    c.certificates = 1U;
    c.window = 1U;
    c.width = 1U;
    assert_true(hg_bank_valid(&c, VALUES, RADII, 1U));
}

/* The closest of two certificates, of |r| 1/2 or 1 or 2 at thresholds that are their biases: of a window of one sample whose radius is 0. */
static uint8_t closest_of(double r0, double J0, double r1, double J1)
{
    static rig b;
    const hg_real weight[2] = {R(r0), R(r1)};
    const hg_real bias[2] = {R(J0), R(J1)};
    const hg_bank_config c = {.certificates = 2U, .window = 1U, .width = 1U, .signal = signal_list, .weight = weight, .bias = bias, .widen = R(1)};
    const hg_real value[VALUES] = {R(1), R(1), R(1)};
    const hg_real radius[RADII] = {R(0)};
    begin(&b, &c);
    assert_status(HG_OK, step(&b, value, radius));
    assert_real((b.self.closest == 0U) ? r0 : r1, b.r[0]);
    assert_real((b.self.closest == 0U) ? J0 : J1, b.J[0]);
    return b.self.closest;
}

/* At its threshold a certificate raises no alarm: it is nearer than one below, and further than one above. */
static void at_its_threshold_a_certificate_is_between(void **state)
{
    (void)state;
    assert_int_equal(1, closest_of(0.5, 1.0, -1.0, 1.0));
    assert_int_equal(0, closest_of(-1.0, 1.0, 0.5, 1.0));
    assert_int_equal(1, closest_of(1.0, 1.0, 2.0, 1.5));
    assert_int_equal(0, closest_of(2.0, 1.5, 1.0, 1.0));
    assert_int_equal(1, closest_of(0.0, 0.0, 2.0, 1.0)); /* nothing at a threshold of nothing */
    assert_int_equal(0, closest_of(2.0, 1.0, 0.0, 0.0));
    assert_int_equal(0, closest_of(2.0, 0.5, 2.0, 1.0)); /* of two alarms the greater one */
    assert_int_equal(1, closest_of(2.0, 1.0, 2.0, 0.5));
}

/* What does not fit gives the first certificate's threshold, and says so. */
static void after_an_overflow_the_first_certificate_speaks(void **state)
{
    (void)state;
    rig b;
    const hg_real weight[3] = {R(0.5), R(1), R(2)};
    const hg_real bias[3] = {R(1), R(0.5), R(0.25)};
    const hg_bank_config c = {.certificates = 3U, .window = 1U, .width = 1U, .signal = signal_list, .weight = weight, .bias = bias, .widen = R(1)};
    const hg_real one[VALUES] = {R(1), R(1), R(1)};
    const hg_real large[VALUES] = {R(0), R(0), HG_REAL_MAX};
    const hg_real radius[RADII] = {R(0)};
    begin(&b, &c);
    assert_status(HG_OK, step(&b, one, radius));
    assert_int_equal(2, b.self.closest);
    assert_status(HG_E_NUMERIC, step(&b, large, radius));
    assert_int_equal(0, b.self.closest);
    assert_real(0.0, b.r[0]);
    assert_real(1.0, b.J[0]);
}

static void validity_looks_at_every_place(void **state)
{
    (void)state;
    for (size_t g = 0U; g < 2U; g++) {
        uint8_t places[2] = {0U, 1U};
        hg_bank_config c = usual;
        c.signal = places;
        places[g] = VALUES; /* has a radius and no value */
        assert_false(hg_bank_valid(&c, VALUES, RADII, LENGTH));
        places[g] = VALUES - 1U;
        assert_true(hg_bank_valid(&c, VALUES, RADII, LENGTH));
        c.extras = 0U;
        assert_true(hg_bank_valid(&c, VALUES, VALUES, LENGTH));
        assert_false(hg_bank_valid(&c, VALUES, VALUES - 1U, LENGTH)); /* has a value and no radius */
        c.extras = EXTRAS;
        places[g] = 255U;
        assert_false(hg_bank_valid(&c, 255U, 255U, LENGTH));
        c = usual;
        c.extra = places;
        places[g] = RADII;
        assert_false(hg_bank_valid(&c, VALUES, RADII, LENGTH));
        places[g] = RADII - 1U;
        assert_true(hg_bank_valid(&c, VALUES, RADII, LENGTH));
    }
}

static void a_window_of_one_computes_by_hand(void **state)
{
    (void)state;
    const hg_real weight[4] = {R(1), R(-2), R(-1), R(0.5)}; /* [signal][certificate] */
    const hg_real extra[2] = {R(4), R(0)};
    const uint8_t places[2] = {1U, 2U};
    const uint8_t more = 3U;
    const hg_bank_config c = {.certificates = 2U, .window = 1U, .width = 2U, .signal = places, .weight = weight, .extras = 1U, .extra = &more,
                              .extra_weight = extra, .bias = bias_table, .widen = R(2)};
    const hg_real radius[RADII] = {R(100), R(0.5), R(0.25), R(0.125), R(100)};
    rig b;
    begin(&b, &c);
    assert_false(hg_bank_ready(&b.self));
    const hg_real value[VALUES] = {R(100), R(3), R(1)};
    assert_status(HG_OK, step(&b, value, radius));
    assert_true(hg_bank_ready(&b.self));
    assert_int_equal(1, b.self.closest); /* |-6 + 1/2| of 0.5 + 2 (1 + 1/8), against |3 - 1| of 1 + 2 (1/2 + 1/4) + 4/8 */
    assert_real(-5.5, b.r[0]);
    assert_real(2.75, b.J[0]);
    const hg_real other[VALUES] = {R(100), R(-1), R(4)};
    assert_status(HG_OK, step(&b, other, radius));
    assert_int_equal(0, b.self.closest); /* |-5| of 3, against |2 + 2| of 2.75 */
    assert_real(-5.0, b.r[0]);
    assert_real(3.0, b.J[0]);
}

static void nothing_is_said_before_the_window_is_full(void **state)
{
    (void)state;
    const hg_real value[VALUES] = {R(1000), R(1000), R(1000)};
    const hg_real radius[RADII] = {R(0), R(0), R(0), R(0), R(0)};
    rig b;
    begin(&b, &usual);
    for (int round = 0; round < 3; round++) {
        for (uint32_t k = 1U; k < WINDOW; k++) {
            assert_status(HG_E_EMPTY, step(&b, value, radius));
            assert_real(0.0, b.r[0]);
            assert_real(1.0, b.J[0]);
            assert_false(hg_bank_ready(&b.self));
        }
        for (uint32_t k = 0U; k < 600U; k++) { /* the count does not wrap */
            assert_status(HG_OK, step(&b, value, radius));
            assert_true(hg_bank_ready(&b.self));
        }
        hg_bank_reset(&b.self);
        assert_false(hg_bank_ready(&b.self));
        assert_int_equal(0, b.self.closest);
    }
}

/* |r| / J of every certificate by the definition, from all that was pushed. */
static void sums_follow_the_definition_also_after_rewriting(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(81U);
    static hg_real value[400][VALUES];
    static hg_real radius[400][RADII];
    rig b;
    begin(&b, &usual);
    for (uint32_t k = 0U; k < 400U; k++) {
        for (size_t g = 0U; g < VALUES; g++) {
            value[k][g] = R((double)draw_between(&random, -40, 40) / 4.0);
        }
        for (size_t g = 0U; g < RADII; g++) {
            radius[k][g] = R((double)draw_between(&random, 0, 8) / 4.0);
        }
        if (((draw(&random) % 3U) == 0U) && (k >= HISTORY)) {
            for (uint32_t lag = 1U; lag < HISTORY; lag++) {
                radius[k - lag][2] += R(1);
                hg_ring_rewrite(&b.radius, (uint8_t)(lag - 1U), 2U, 1U, &radius[k - lag][2]);
            }
        }
        const hg_status status = step(&b, value[k], radius[k]);
        if (k < (WINDOW - 1U)) {
            assert_status(HG_E_EMPTY, status);
            continue;
        }
        assert_status(HG_OK, status);
        double closest = -1.0;
        bool alarm = false;
        for (size_t c = 0U; c < CERTIFICATES; c++) {
            double r = 0.0;
            double J = (double)bias_table[c];
            for (size_t lag = 0U; lag < WINDOW; lag++) {
                for (size_t g = 0U; g < WIDTH; g++) {
                    const double w = (double)weight_table[(((lag * WIDTH) + g) * CERTIFICATES) + c];
                    r += w * (double)value[k - lag][signal_list[g]];
                    J += 1.5 * fabs(w) * (double)radius[k - lag][signal_list[g]];
                }
                for (size_t e = 0U; e < EXTRAS; e++) {
                    J += (double)extra_table[(((lag * EXTRAS) + e) * CERTIFICATES) + c] * (double)radius[k - lag][extra_list[e]];
                }
            }
            assert_near(r, b.sum[c], 0.0);
            if (c == b.self.closest) {
                assert_near(r, b.r[0], 0.0);
                assert_near(J, b.J[0], 0.0);
            }
            closest = (closest > (fabs(r) / J)) ? closest : (fabs(r) / J);
            alarm = alarm || (fabs(r) > J);
        }
        assert_near(closest, fabs((double)b.r[0]) / (double)b.J[0], 1e-6);
        assert_int_equal(alarm, hg_real_abs(b.r[0]) > b.J[0]);
    }
}

/* Three certificates of one signal each, so that any residuals and thresholds can be set. */
static void choose(rig *b, const hg_bank_config *c, double r0, double J0, double r1, double J1)
{
    const hg_real value[VALUES] = {R(r0), R(r1), R(0)};
    const hg_real radius[RADII] = {R(J0), R(J1), R(0), R(0), R(0)};
    begin(b, c);
    assert_status(HG_OK, step(b, value, radius));
}

static void an_alarm_is_never_hidden_by_another_certificate(void **state)
{
    (void)state;
    const uint8_t places[2] = {0U, 1U};
    const hg_real weight[4] = {R(1), R(0), R(0), R(1)};
    const hg_real bias[2] = {(hg_real)FLT_MIN, (hg_real)FLT_MIN};
    const hg_bank_config c = {.certificates = 2U, .window = 1U, .width = 2U, .signal = places, .weight = weight, .extras = 0U, .extra = NULL,
                              .extra_weight = NULL, .bias = bias, .widen = R(1)};
    const double most = (double)HG_REAL_MAX / 2.0;
    rig b;
    choose(&b, &c, 1.0, 2.0, 1.5, 2.0);
    assert_int_equal(1, b.self.closest);
    choose(&b, &c, -1.5, 2.0, 1.0, 2.0);
    assert_int_equal(0, b.self.closest);
    choose(&b, &c, 3.0, 2.0, 9.0, 8.0); /* both in alarm: the clearer one */
    assert_int_equal(0, b.self.closest);
    choose(&b, &c, 1.0, 1.0, 1.0, 1.0); /* at the threshold is no alarm, and the first stays */
    assert_int_equal(0, b.self.closest);
    assert_false(hg_real_abs(b.r[0]) > b.J[0]);
    /* Products that overflow or vanish must not decide. */
    choose(&b, &c, most / 2.0, most, most, most / 2.0);
    assert_int_equal(1, b.self.closest);
    assert_true(hg_real_abs(b.r[0]) > b.J[0]);
    choose(&b, &c, -most, most / 2.0, most / 2.0, most);
    assert_int_equal(0, b.self.closest);
    choose(&b, &c, 1e-30, 2e-30, 2e-30, 1e-30);
    assert_int_equal(1, b.self.closest);
    choose(&b, &c, 2e-30, 1e-30, 1e-30, 2e-30);
    assert_int_equal(0, b.self.closest);
}

static void the_largest_bank_reads_its_tables_to_their_ends(void **state)
{
    (void)state;
    enum { N = 255, W = 255 }; /* certificates, window: one certificate a lag */
    static hg_real weight[W * N];
    static hg_real extra_weight[W * N];
    static hg_real bias[N];
    static hg_acc sum[(2 * N) + 1];
    static hg_real memory[2][W];
    const uint8_t place = 0U;
    for (size_t lag = 0U; lag < (size_t)W; lag++) {
        weight[(lag * (size_t)N) + lag] = R(1);
        extra_weight[(lag * (size_t)N) + lag] = R(2);
        bias[lag] = R(1);
    }
    const hg_bank_config c = {.certificates = N, .window = W, .width = 1U, .signal = &place, .weight = weight, .extras = 1U, .extra = &place,
                              .extra_weight = extra_weight, .bias = bias, .widen = R(1)};
    hg_bank self;
    hg_ring value;
    hg_ring radius;
    arm(sum, COUNT(sum));
    assert_true(hg_bank_valid(&c, 1U, 1U, W));
    assert_status(HG_OK, hg_ring_start(&value, 1U, W, memory[0]));
    assert_status(HG_OK, hg_ring_start(&radius, 1U, W, memory[1]));
    assert_status(HG_OK, hg_bank_start(&self, &c, sum));
    for (uint32_t k = 0U; k < 300U; k++) {
        const hg_real v = R(k);
        const hg_real w = R(1000U - k);
        hg_real r = CANARY;
        hg_real J = CANARY;
        assert_status(HG_OK, hg_ring_push(&value, &v));
        assert_status(HG_OK, hg_ring_push(&radius, &w));
        assert_status((k < 254U) ? HG_E_EMPTY : HG_OK, hg_bank_step(&self, &value, &radius, &r, &J));
    }
    for (size_t lag = 0U; lag < (size_t)W; lag++) {
        assert_real(299.0 - (double)lag, sum[lag]);
        assert_real(3.0 * (701.0 + (double)lag), sum[(size_t)N + lag]);
    }
    assert_untouched(&sum[2 * N], 1U);
}

static void the_widest_bank_reads_its_tables_to_their_ends(void **state)
{
    (void)state;
    static uint8_t place[255];
    static hg_real weight[255U * 255U];
    static hg_real value_memory[255];
    static hg_real radius_memory[255];
    static hg_real bias[255];
    static hg_acc sum[511];
    for (size_t g = 0U; g < 255U; g++) {
        place[g] = (uint8_t)(254U - g);
        weight[(g * 255U) + g] = R(1);
        bias[g] = R(1);
    }
    const hg_bank_config c = {.certificates = 255U, .window = 1U, .width = 255U, .signal = place, .weight = weight, .extras = 255U, .extra = place,
                              .extra_weight = weight, .bias = bias, .widen = R(1)};
    hg_real row[255];
    hg_real r;
    hg_real J;
    hg_bank self;
    hg_ring value;
    hg_ring radius;
    for (size_t g = 0U; g < 255U; g++) {
        row[g] = R(g);
    }
    assert_true(hg_bank_valid(&c, 255U, 255U, 1U));
    assert_status(HG_OK, hg_ring_start(&value, 255U, 1U, value_memory));
    assert_status(HG_OK, hg_ring_start(&radius, 255U, 1U, radius_memory));
    assert_status(HG_OK, hg_bank_start(&self, &c, sum));
    sum[510] = CANARY;
    assert_status(HG_OK, hg_ring_push(&value, row));
    assert_status(HG_OK, hg_ring_push(&radius, row));
    assert_status(HG_OK, hg_bank_step(&self, &value, &radius, &r, &J));
    for (size_t g = 0U; g < 255U; g++) {
        assert_real(254.0 - (double)g, sum[g]);
        assert_real(2.0 * (254.0 - (double)g), sum[255U + g]);
    }
    assert_untouched(&sum[510], 1U);
}

static void a_sum_that_is_not_finite_is_refused_until_it_has_left_the_window(void **state)
{
    (void)state;
    const hg_real zero[RADII] = {R(0), R(0), R(0), R(0), R(0)};
    for (size_t wide = 0U; wide < 2U; wide++) {
        hg_real big[RADII] = {R(0), R(0), R(0), R(0), R(0)};
        rig b;
        begin(&b, &usual);
        for (uint32_t k = 0U; k < WINDOW; k++) {
            (void)step(&b, zero, zero);
        }
        /* weights are below 1: only the sum over the window overflows, or the widened radius */
        for (uint32_t k = 0U; k < WINDOW; k++) {
            big[0] = ((k % 2U) == 0U) ? HG_REAL_MAX : -HG_REAL_MAX;
            big[2] = big[0];
            (void)step(&b, (wide == 0U) ? big : zero, (wide == 1U) ? big : zero);
        }
        bool refused = false;
        for (uint32_t k = 1U; k <= WINDOW; k++) {
            const hg_status status = step(&b, zero, zero);
            refused = refused || (status == HG_E_NUMERIC);
            if (status != HG_OK) {
                assert_status(HG_E_NUMERIC, status);
                assert_real(0.0, b.r[0]);
                assert_real(1.0, b.J[0]);
            }
            assert_true(hg_bank_ready(&b.self));
            if (k == WINDOW) {
                assert_status(HG_OK, status); /* nothing of it is left */
                assert_real(0.0, b.r[0]);
            }
        }
        assert_true(refused);
    }
}

static void banks_share_rings_and_nothing_else(void **state)
{
    (void)state;
    const hg_real value[VALUES] = {R(1), R(2), R(3)};
    const hg_real radius[RADII] = {R(1), R(1), R(1), R(1), R(1)};
    rig a;
    hg_bank other;
    hg_acc sum[HG_BANK_SUMS(CERTIFICATES)];
    hg_real r = CANARY;
    hg_real J = CANARY;
    begin(&a, &usual);
    assert_status(HG_OK, hg_bank_start(&other, &usual, sum));
    for (uint32_t k = 0U; k < 20U; k++) {
        const hg_status status = step(&a, value, radius);
        assert_status(status, hg_bank_step(&other, &a.value, &a.radius, &r, &J));
        assert_real(a.r[0], r);
        assert_real(a.J[0], J);
    }
    hg_bank_reset(&a.self);
    assert_status(HG_OK, hg_bank_step(&other, &a.value, &a.radius, &r, &J));
    assert_status(HG_E_EMPTY, hg_bank_step(&a.self, &a.value, &a.radius, a.r, a.J));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_tells_null),
        cmocka_unit_test(validity_looks_at_every_number_and_table),
        cmocka_unit_test(the_smallest_bank_is_taken),
        cmocka_unit_test(at_its_threshold_a_certificate_is_between),
        cmocka_unit_test(after_an_overflow_the_first_certificate_speaks),
        cmocka_unit_test(validity_looks_at_every_place),
        cmocka_unit_test(a_window_of_one_computes_by_hand),
        cmocka_unit_test(nothing_is_said_before_the_window_is_full),
        cmocka_unit_test(sums_follow_the_definition_also_after_rewriting),
        cmocka_unit_test(an_alarm_is_never_hidden_by_another_certificate),
        cmocka_unit_test(the_largest_bank_reads_its_tables_to_their_ends),
        cmocka_unit_test(the_widest_bank_reads_its_tables_to_their_ends),
        cmocka_unit_test(a_sum_that_is_not_finite_is_refused_until_it_has_left_the_window),
        cmocka_unit_test(banks_share_rings_and_nothing_else),
    };
    return cmocka_run_group_tests(tests, fill_weights, NULL);
}
