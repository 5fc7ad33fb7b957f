/** @file
 *  hull.h: thresholds from radii, against a sum over the whole past in double precision. */
#include "support.h"

#include "hullguard/hull.h"

#define SIGNALS 3U
#define LENGTH 5U
#define MOST 4U /* taps */
#define OUT 3U
#define IN 2U
#define SETTLE 3U

static const uint8_t signal_list[IN] = {2U, 0U};
static const uint8_t tap_list[IN] = {MOST, 2U};
static hg_real weight_table[OUT * (MOST + 2U + IN)];
static const hg_real rest_table[SETTLE * OUT] = {R(1), R(2), R(3), R(0.5), R(1), R(1.5), R(0.25), R(0.5), R(0.75)};
static const hg_real moving_table[SETTLE * OUT] = {R(100), R(200), R(300), R(50), R(100), R(150), R(25), R(50), R(75)};
static const hg_real rest_rest[OUT] = {R(0.125), R(0.25), R(0.5)};
static const hg_real moving_rest[OUT] = {R(8), R(16), R(32)};
static const hg_real bias_table[OUT] = {R(0.25), R(0.5), R(0.75)};
static const hg_real decay_table[OUT] = {R(0.5), R(0.25), R(0)};
static const hg_hull_config usual = {.residuals = OUT,
                                     .width = IN,
                                     .signal = signal_list,
                                     .taps = tap_list,
                                     .weight = weight_table,
                                     .settle = SETTLE,
                                     .rest = rest_table,
                                     .rest_left = rest_rest,
                                     .moving = moving_table,
                                     .moving_left = moving_rest,
                                     .bias = bias_table,
                                     .ready_rest = 1U,
                                     .ready_moving = 4U,
                                     .decay = decay_table};

typedef struct {
    hg_hull self;
    hg_ring ring;
    hg_real memory[SIGNALS * LENGTH];
    hg_real theta[OUT + 1U]; /* one more for the canary */
} rig;

static void begin_with(rig *r, const hg_hull_config *config, uint8_t width, uint8_t length, hg_start how)
{
    arm(r->theta, COUNT(r->theta));
    assert_status(HG_OK, hg_ring_start(&r->ring, width, length, r->memory));
    assert_status(HG_OK, hg_hull_start(&r->self, config, &r->ring, how, r->theta));
}

static void begin(rig *r, hg_start how)
{
    begin_with(r, &usual, SIGNALS, LENGTH, how);
}

/* Small multiples of 1/8: every sum is exact in float32 too. */
static int fill_weights(void **state)
{
    (void)state;
    for (size_t i = 0U; i < COUNT(weight_table); i++) {
        weight_table[i] = R((double)((i * 7U) % 11U) / 8.0);
    }
    return 0;
}

static void start_tells_null(void **state)
{
    (void)state;
    rig r;
    begin(&r, HG_START_REST);
    assert_status(HG_E_ARGUMENT, hg_hull_start(NULL, &usual, &r.ring, HG_START_REST, r.theta));
    assert_status(HG_E_ARGUMENT, hg_hull_start(&r.self, NULL, &r.ring, HG_START_REST, r.theta));
    assert_status(HG_E_ARGUMENT, hg_hull_start(&r.self, &usual, NULL, HG_START_REST, r.theta));
    assert_status(HG_E_ARGUMENT, hg_hull_start(&r.self, &usual, &r.ring, HG_START_REST, NULL));
    assert_count(OUT, HG_HULL_REALS(OUT, 0U));
    assert_count(OUT + 7U, HG_HULL_REALS(OUT, 7U));
    assert_untouched(&r.theta[OUT], 1U);
}

static void start_tells_bad_tables(void **state)
{
    (void)state;
    rig r;
    begin(&r, HG_START_REST);
    arm(r.theta, COUNT(r.theta));
    const uint8_t outside[IN] = {0U, SIGNALS};
    const uint8_t long_taps[IN] = {LENGTH, 2U};
    const uint8_t most_taps[IN] = {MOST, 255U};
    const hg_real bad[][OUT] = {{R(0), R(-0.1), R(0)}, {R(1), R(0), R(0)}, {R(0), R(0), R(-1)}, {R(0), R(0), R(1)}, {R(0), R(0), REAL_NAN}, {REAL_INF, R(0), R(0)}};
    const uint8_t all_taps[IN] = {255U, 255U};
    hg_hull_config c[27];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = usual;
    }
    c[0].residuals = 0U;
    c[1].width = 0U;
    c[2].taps = all_taps;
    c[3].taps = long_taps;
    c[4].settle = 0U;
    c[5].settle = UINT16_MAX; /* k, which saturates there, would hand over again and again */
    c[6].exponent = 1;        /* float tables are not scaled */
    c[7].signal = NULL;
    c[8].weight = NULL;
    c[9].rest = NULL;
    c[10].moving = NULL;
    c[11].exponent = INT8_MAX;
    c[12].decay = NULL;
    c[13].signal = outside;
    c[14].taps = NULL;
    c[15].rest_left = NULL;
    c[16].moving_left = NULL;
    c[17].bias = NULL;
    c[18].taps = most_taps;
    c[19].exponent = -128;
    c[20].exponent = -1;
    for (size_t i = 0U; i < COUNT(bad); i++) {
        c[21U + i].decay = bad[i];
    }
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_false(hg_hull_valid(&c[i], SIGNALS, LENGTH));
        assert_status(HG_E_CONFIG, hg_hull_start(&r.self, &c[i], &r.ring, HG_START_REST, r.theta));
    }
    assert_untouched(r.theta, COUNT(r.theta));
    assert_true(hg_hull_valid(&usual, SIGNALS, LENGTH));
    c[0] = usual;
    c[0].settle = UINT16_MAX - 1U;
    assert_true(hg_hull_valid(&c[0], SIGNALS, LENGTH));
    const uint8_t no_taps[IN] = {0U, 0U};
    c[0].taps = no_taps; /* the tail is all there is */
    assert_true(hg_hull_valid(&c[0], SIGNALS, 1U));
}

/* ---- the definition in the header, over the whole past and in double, for any shape ---- */

#define SAMPLES 300U
#define SHAPE_OUT 6U
#define SHAPE_IN 4U
#define SHAPE_LENGTH 12U
#define SHAPE_SETTLE 20U
#define SHAPE_MODES 3U

typedef struct {
    hg_hull_config config;
    uint8_t        signal[SHAPE_IN];
    uint8_t        taps[SHAPE_IN];
    hg_real        h[SHAPE_OUT][SHAPE_IN][SHAPE_LENGTH];
    hg_real        weight[SHAPE_OUT * SHAPE_IN * (SHAPE_LENGTH + 1U)];
    hg_real        rest[SHAPE_SETTLE * SHAPE_OUT];
    hg_real        moving[SHAPE_SETTLE * SHAPE_OUT];
    hg_real        rest_left[SHAPE_OUT];
    hg_real        moving_left[SHAPE_OUT];
    hg_real        bias[SHAPE_OUT];
    hg_real        decay[SHAPE_OUT];
    hg_real        tail[SHAPE_OUT][SHAPE_IN];
    hg_real        mode_decay[SHAPE_MODES];
    hg_real        mode_input[SHAPE_MODES * SHAPE_IN];
    hg_real        mode_output[SHAPE_OUT * SHAPE_MODES];
    hg_real        mode_rest[SHAPE_MODES];
    hg_real        mode_moving[SHAPE_MODES];
    uint8_t        width;  /* of the ring */
    uint8_t        length; /* of the ring */
} shape;

static void draw_reals(uint32_t *random, hg_real *x, size_t n, int32_t eighths)
{
    for (size_t i = 0U; i < n; i++) {
        x[i] = R((double)draw_between(random, 0, eighths) / 8.0);
    }
}

/* The weights as the header lays them out: two residuals, signal after signal, lag after lag, and the tail behind the lags. */
static void lay_out(shape *s)
{
    size_t at = 0U;
    for (size_t i = 0U; i < s->config.residuals; i += 2U) {
        for (size_t g = 0U; g < s->config.width; g++) {
            for (size_t lag = 0U; lag <= s->taps[g]; lag++) {
                for (size_t n = i; (n < (i + 2U)) && (n < s->config.residuals); n++) {
                    s->weight[at] = (lag < s->taps[g]) ? s->h[n][g][lag] : s->tail[n][g];
                    at++;
                }
            }
        }
    }
    arm(&s->weight[at], COUNT(s->weight) - at);
}

static void draw_shape(uint32_t *random, shape *s)
{
    s->width = (uint8_t)draw_between(random, 1, (int32_t)SHAPE_IN);
    s->length = (uint8_t)draw_between(random, 1, (int32_t)SHAPE_LENGTH);
    s->config = (hg_hull_config){.residuals = (uint8_t)draw_between(random, 1, (int32_t)SHAPE_OUT),
                                 .width = (uint8_t)draw_between(random, 1, (int32_t)SHAPE_IN),
                                 .signal = s->signal, .taps = s->taps, .weight = s->weight,
                                 .settle = (uint16_t)draw_between(random, 1, (int32_t)SHAPE_SETTLE), .rest = s->rest, .rest_left = s->rest_left,
                                 .moving = s->moving, .moving_left = s->moving_left, .bias = s->bias, .decay = s->decay,
                                 .modes = (uint8_t)draw_between(random, 0, (int32_t)SHAPE_MODES), .mode_decay = s->mode_decay,
                                 .mode_input = s->mode_input, .mode_output = s->mode_output, .mode_rest = s->mode_rest,
                                 .mode_moving = s->mode_moving};
    for (size_t g = 0U; g < s->config.width; g++) {
        s->signal[g] = (uint8_t)draw_between(random, 0, s->width - 1);
        s->taps[g] = (uint8_t)draw_between(random, 0, s->length - 1);
    }
    draw_reals(random, &s->h[0][0][0], SHAPE_OUT * SHAPE_IN * SHAPE_LENGTH, 10);
    draw_reals(random, &s->tail[0][0], SHAPE_OUT * SHAPE_IN, 10);
    lay_out(s);
    draw_reals(random, s->rest, COUNT(s->rest), 800);
    draw_reals(random, s->moving, COUNT(s->moving), 8000);
    draw_reals(random, s->rest_left, SHAPE_OUT, 80);
    draw_reals(random, s->moving_left, SHAPE_OUT, 800);
    draw_reals(random, s->bias, SHAPE_OUT, 80);
    draw_reals(random, s->decay, SHAPE_OUT, 7);
    draw_reals(random, s->mode_decay, SHAPE_MODES, 7);
    draw_reals(random, s->mode_input, COUNT(s->mode_input), 10);
    draw_reals(random, s->mode_output, COUNT(s->mode_output), 10);
    draw_reals(random, s->mode_rest, SHAPE_MODES, 80);
    draw_reals(random, s->mode_moving, SHAPE_MODES, 800);
}

/* What is behind the taps: each radius that has left them, shrunk by the decay for every sample since. */
static double left_of(const shape *s, const hg_real (*past)[SHAPE_IN], uint32_t k, double decay, const hg_real *input)
{
    double sum = 0.0;
    for (size_t g = 0U; g < s->config.width; g++) {
        for (uint32_t lag = s->taps[g]; lag <= k; lag++) {
            sum += pow(decay, (double)(lag - s->taps[g])) * (double)input[g] * (double)past[k - lag][s->signal[g]];
        }
    }
    return sum;
}

static double definition_of(const shape *s, const hg_real (*past)[SHAPE_IN], uint32_t k, size_t i, hg_start how)
{
    const bool rest = how == HG_START_REST;
    const hg_hull_config *c = &s->config;
    double J = (double)((k < c->settle) ? (rest ? s->rest : s->moving)[(k * c->residuals) + i] : s->bias[i]);
    if (k >= c->settle) {
        J += (double)(rest ? s->rest_left : s->moving_left)[i] * pow((double)s->decay[i], (double)(k - c->settle) + 1.0);
    }
    for (size_t g = 0U; g < c->width; g++) {
        for (uint32_t lag = 0U; (lag < s->taps[g]) && (lag <= k); lag++) {
            J += (double)s->h[i][g][lag] * (double)past[k - lag][s->signal[g]];
        }
    }
    for (size_t m = 0U; m < c->modes; m++) {
        const double start = pow((double)s->mode_decay[m], k + 1.0) * (double)(rest ? s->mode_rest : s->mode_moving)[m];
        const double theta = start + left_of(s, past, k, (double)s->mode_decay[m], &s->mode_input[m * c->width]);
        J += (double)s->mode_output[(i * c->modes) + m] * theta;
    }
    return J + left_of(s, past, k, (double)s->decay[i], s->tail[i]);
}

/* What a late-discovered loss does: the past grows, back to the radius that leaves the taps of this sample. */
static void grow_the_past(uint32_t *random, const shape *s, hg_real (*past)[SHAPE_IN], uint32_t k, hg_ring *ring)
{
    for (uint8_t place = 0U; place < s->width; place++) {
        uint32_t inside = s->length;
        for (size_t g = 0U; g < s->config.width; g++) {
            inside = ((s->signal[g] == place) && (s->taps[g] < inside)) ? s->taps[g] : inside;
        }
        for (uint32_t lag = 1U; (lag <= inside) && (lag <= k); lag++) {
            past[k - lag][place] += R((double)draw_between(random, 0, 16) / 4.0);
            hg_ring_rewrite(ring, (uint8_t)lag, place, 1U, &past[k - lag][place]);
        }
    }
}

static void thresholds_follow_the_definition_also_after_rewriting(void **state)
{
    (void)state;
    static shape s;
    static hg_real past[SAMPLES][SHAPE_IN];
    uint32_t random = seed_of_run(41U);
    for (int run = 0; run < 60; run++) {
        hg_hull self;
        hg_ring ring;
        hg_real memory[SHAPE_IN * SHAPE_LENGTH];
        hg_real theta[SHAPE_OUT + SHAPE_MODES + 1U];
        const hg_start how = ((run % 2) == 0) ? HG_START_REST : HG_START_MOVING;
        draw_shape(&random, &s);
        arm(theta, COUNT(theta));
        assert_status(HG_OK, hg_ring_start(&ring, s.width, s.length, memory));
        assert_status(HG_OK, hg_hull_start(&self, &s.config, &ring, how, theta));
        for (uint32_t k = 0U; k < SAMPLES; k++) {
            hg_real J[SHAPE_OUT + 1U];
            arm(J, COUNT(J));
            draw_reals(&random, past[k], SHAPE_IN, 32);
            assert_status(HG_OK, hg_ring_push(&ring, past[k]));
            if ((draw(&random) % 3U) == 0U) {
                grow_the_past(&random, &s, past, k, &ring);
            }
            hg_hull_step(&self, &ring, J);
            for (size_t i = 0U; i < s.config.residuals; i++) {
                const double expected = definition_of(&s, (const hg_real(*)[SHAPE_IN])past, k, i, how);
                assert_near(expected, J[i], 1e-5 * expected);
            }
            assert_untouched(&J[s.config.residuals], COUNT(J) - s.config.residuals);
        }
        const size_t used = HG_HULL_REALS(s.config.residuals, s.config.modes);
        assert_untouched(&theta[used], COUNT(theta) - used);
    }
}

/* What is left of the initial state enters the tail once, and shrinks from the first sample behind the tables on. */
static void the_start_is_handed_over_to_the_tail_once(void **state)
{
    (void)state;
    const hg_start starts[] = {HG_START_REST, HG_START_MOVING};
    for (size_t s = 0U; s < COUNT(starts); s++) {
        const hg_real *table = (s == 0U) ? rest_table : moving_table;
        const hg_real *left = (s == 0U) ? rest_rest : moving_rest;
        rig r;
        begin(&r, starts[s]);
        for (size_t k = 0U; k < 20U; k++) {
            hg_real J[OUT];
            hg_hull_step(&r.self, &r.ring, J);
            for (size_t i = 0U; i < OUT; i++) {
                const double shrunk = (double)left[i] * pow((double)decay_table[i], ((double)k - (double)SETTLE) + 1.0);
                assert_real((k < SETTLE) ? table[(k * OUT) + i] : R((double)bias_table[i] + shrunk), J[i]);
            }
        }
    }
}

static void the_tail_bounds_an_endless_response_and_heals(void **state)
{
    (void)state;
    /* h_j = 0.75^j: two taps, the rest in the tail, which is exact for one signal */
    const uint8_t first = 0U;
    const uint8_t two = 2U;
    const hg_real weight[3] = {R(1), R(0.75), R(0.5625)};
    const hg_real bias = R(0.0625);
    const hg_real none = R(0);
    const hg_real decay = R(0.75);
    const hg_hull_config c = {.residuals = 1U, .width = 1U, .signal = &first, .taps = &two, .weight = weight, .settle = 1U, .rest = &bias,
                              .rest_left = &none, .moving = &bias, .moving_left = &none, .bias = &bias, .decay = &decay};
    rig r;
    hg_real J;
    double exact = 0.0;
    begin_with(&r, &c, 1U, 3U, HG_START_REST);
    for (int k = 0; k < 300; k++) {
        const hg_real radius = (k < 100) ? R(8) : R(0);
        assert_status(HG_OK, hg_ring_push(&r.ring, &radius));
        hg_hull_step(&r.self, &r.ring, &J);
        exact = (0.75 * exact) + (double)radius;
        assert_near(exact + 0.0625, J, 1e-4);
    }
    assert_near(0.0625, J, 1e-7); /* no stored maximum */
}

/* Radii that no design allows still must not leave the threshold infinite for ever: nothing would be detected any more. */
static void a_tail_that_overflows_heals(void **state)
{
    (void)state;
    const uint8_t first = 0U;
    const uint8_t one = 1U;
    const hg_real zero = R(0);
    const hg_real bias = R(1);
    const hg_real weight[2] = {R(0), R(100)};
    const hg_real half = R(0.5);
    const hg_hull_config c = {.residuals = 1U, .width = 1U, .signal = &first, .taps = &one, .weight = weight, .settle = 1U, .rest = &bias,
                              .rest_left = &zero, .moving = &bias, .moving_left = &zero, .bias = &bias, .decay = &half};
    rig r;
    hg_real J;
    const hg_real most = HG_REAL_MAX;
    begin_with(&r, &c, 1U, 2U, HG_START_REST);
    for (int k = 0; k < 5000; k++) {
        assert_status(HG_OK, hg_ring_push(&r.ring, (k < 5) ? &most : &zero));
        hg_hull_step(&r.self, &r.ring, &J);
        assert_true(hg_real_finite(r.theta[0]));
        assert_true(hg_real_finite(J));
        assert_true((J >= R(1)) && ((k < 1) || (k > 5) || (J >= most)));
    }
    assert_near(0.0, r.theta[0], 1e-30);
    assert_real(1.0, J);
}

static void what_does_not_fit_is_the_largest_number(void **state)
{
    (void)state;
    const uint8_t first = 0U;
    const uint8_t one = 1U;
    const hg_real none = R(0);
    const hg_real most = HG_REAL_MAX;
    const hg_real weight[2] = {R(2), HG_REAL_MAX};
    const hg_hull_config c = {.residuals = 1U, .width = 1U, .signal = &first, .taps = &one, .weight = weight, .settle = 1U, .rest = &none,
                              .rest_left = &none, .moving = &none, .moving_left = &most, .bias = &none, .decay = &none};
    const hg_real radius[] = {R(8), HG_REAL_MAX, R(8), R(0), R(0)};
    const hg_real expected[] = {R(16), HG_REAL_MAX, HG_REAL_MAX, HG_REAL_MAX, R(0)};
    rig r;
    hg_real J;
    begin_with(&r, &c, 1U, 2U, HG_START_MOVING);
    for (size_t k = 0U; k < COUNT(radius); k++) {
        assert_status(HG_OK, hg_ring_push(&r.ring, &radius[k]));
        hg_hull_step(&r.self, &r.ring, &J);
        assert_true(hg_real_finite(r.theta[0]));
        assert_real(expected[k], J);
    }
}

/* ---- modes ---- */

#define MODES 2U

static const hg_real mode_decay[MODES] = {R(0.5), R(0.75)};
static const hg_real mode_in[MODES * IN] = {R(1), R(0.5), R(2), R(0)};
static const hg_real mode_out[OUT * MODES] = {R(0.25), R(0.125), R(0), R(1), R(2), R(0)};
static const hg_real mode_rest[MODES] = {R(8), R(0)};
static const hg_real mode_moving[MODES] = {R(16), R(64)};

static hg_hull_config with_modes(void)
{
    hg_hull_config c = usual;
    c.modes = MODES;
    c.mode_decay = mode_decay;
    c.mode_input = mode_in;
    c.mode_output = mode_out;
    c.mode_rest = mode_rest;
    c.mode_moving = mode_moving;
    return c;
}

static void modes_need_tables(void **state)
{
    (void)state;
    hg_hull self;
    rig r;
    begin(&r, HG_START_REST);
    hg_real memory[HG_HULL_REALS(OUT, MODES) + 1U];
    arm(memory, COUNT(memory));
    const hg_real growing[MODES] = {R(0), R(1)};
    const hg_real negative[MODES] = {R(0.5), R(-0.125)};
    const hg_real unknown[MODES] = {R(0.5), REAL_NAN};
    const hg_real first_growing[MODES] = {R(1), R(0.5)};
    const hg_real first_negative[MODES + 1U] = {R(-0.125), R(0.5), R(0.5)}; /* the last is of no mode */
    hg_hull_config c[10];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = with_modes();
    }
    c[0].mode_decay = NULL;
    c[1].mode_input = NULL;
    c[2].mode_output = NULL;
    c[3].mode_rest = NULL;
    c[4].mode_moving = NULL;
    c[5].mode_decay = growing;
    c[6].mode_decay = negative;
    c[7].mode_decay = unknown;
    c[8].mode_decay = first_growing;
    c[9].mode_decay = first_negative;
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_status(HG_E_CONFIG, hg_hull_start(&self, &c[i], &r.ring, HG_START_REST, memory));
    }
    assert_untouched(memory, COUNT(memory));
    c[0] = with_modes();
    assert_status(HG_E_ARGUMENT, hg_hull_start(&self, &c[0], &r.ring, HG_START_REST, NULL));
    assert_status(HG_OK, hg_hull_start(&self, &c[0], &r.ring, HG_START_REST, memory));
    assert_untouched(&memory[HG_HULL_REALS(OUT, MODES)], 1U);
}

/* Beside what there is without modes, with every radius 0: sum_m output decay^(k + 1) start; after a reset the start is the other one's. */
static void modes_begin_with_the_initial_state(void **state)
{
    (void)state;
    const hg_hull_config c = with_modes();
    const hg_start starts[] = {HG_START_REST, HG_START_MOVING, HG_START_REST};
    hg_hull self;
    hg_real memory[HG_HULL_REALS(OUT, MODES)];
    rig r;
    begin(&r, HG_START_REST);
    assert_status(HG_OK, hg_hull_start(&self, &c, &r.ring, HG_START_MOVING, memory));
    for (size_t s = 0U; s < COUNT(starts); s++) {
        const hg_real *first = (starts[s] == HG_START_REST) ? mode_rest : mode_moving;
        hg_hull_reset(&self, starts[s]);
        hg_hull_reset(&r.self, starts[s]);
        for (size_t k = 0U; k < 20U; k++) {
            hg_real J[OUT];
            hg_real without[OUT];
            hg_hull_step(&self, &r.ring, J);
            hg_hull_step(&r.self, &r.ring, without);
            for (size_t i = 0U; i < OUT; i++) {
                double modes = 0.0;
                for (size_t m = 0U; m < MODES; m++) {
                    modes += (double)mode_out[(i * MODES) + m] * pow((double)mode_decay[m], (double)k + 1.0) * (double)first[m];
                }
                assert_near((double)without[i] + modes, J[i], 1e-6 * (double)J[i]);
            }
        }
    }
}

static void a_mode_that_overflows_heals(void **state)
{
    (void)state;
    const hg_hull_config c = with_modes();
    hg_hull self;
    rig r;
    hg_real memory[HG_HULL_REALS(OUT, MODES)];
    hg_real J[OUT];
    const hg_real most[SIGNALS] = {HG_REAL_MAX, HG_REAL_MAX, HG_REAL_MAX};
    const hg_real none[SIGNALS] = {R(0), R(0), R(0)};
    begin(&r, HG_START_REST);
    assert_status(HG_OK, hg_hull_start(&self, &c, &r.ring, HG_START_REST, memory));
    for (int k = 0; k < 5000; k++) {
        assert_status(HG_OK, hg_ring_push(&r.ring, (k < 5) ? most : none));
        hg_hull_step(&self, &r.ring, J);
        for (size_t i = 0U; i < COUNT(memory); i++) {
            assert_true(hg_real_finite(memory[i]));
        }
        assert_true(hg_real_finite(J[0]) && ((k < 1) || (k > 5) || (J[0] >= HG_REAL_MAX)));
    }
    assert_real(bias_table[0], J[0]);
}

static void readiness_counts_samples_and_never_wraps(void **state)
{
    (void)state;
    rig r;
    hg_real J[OUT];
    hg_real left = moving_rest[0];
    begin(&r, HG_START_REST);
    assert_false(hg_hull_ready(&r.self));
    hg_hull_step(&r.self, &r.ring, J);
    assert_true(hg_hull_ready(&r.self));
    hg_hull_reset(&r.self, HG_START_MOVING);
    for (int k = 0; k < 70000; k++) {
        assert_int_equal(k >= 4, hg_hull_ready(&r.self));
        hg_hull_step(&r.self, &r.ring, J);
        if (k < (int)SETTLE) {
            assert_real(moving_table[(size_t)k * OUT], J[0]);
        } else {
            left = left * decay_table[0];
            assert_real(bias_table[0] + left, J[0]);
        }
    }
    assert_int_equal(65535, r.self.k);
    assert_real(bias_table[0], J[0]);
}

static void reset_forgets_all(void **state)
{
    (void)state;
    rig r;
    hg_real J[OUT];
    const hg_real wide[SIGNALS] = {R(9), R(9), R(9)};
    begin(&r, HG_START_REST);
    for (int k = 0; k < 20; k++) {
        assert_status(HG_OK, hg_ring_push(&r.ring, wide));
        hg_hull_step(&r.self, &r.ring, J);
    }
    hg_ring_reset(&r.ring);
    hg_hull_reset(&r.self, HG_START_REST);
    hg_hull_step(&r.self, &r.ring, J);
    for (size_t i = 0U; i < OUT; i++) {
        assert_real(rest_table[i], J[i]);
    }
    assert_untouched(&r.theta[OUT], 1U);
}

static void hulls_share_a_ring_and_nothing_else(void **state)
{
    (void)state;
    rig r;
    hg_hull b;
    hg_real theta[OUT];
    hg_real J[OUT];
    hg_real K[OUT];
    const hg_real row[SIGNALS] = {R(1), R(1), R(1)};
    begin(&r, HG_START_REST);
    assert_status(HG_OK, hg_hull_start(&b, &usual, &r.ring, HG_START_REST, theta));
    for (int k = 0; k < 200; k++) {
        assert_status(HG_OK, hg_ring_push(&r.ring, row));
        hg_hull_step(&r.self, &r.ring, J);
        hg_hull_step(&b, &r.ring, K);
        assert_memory_equal(J, K, sizeof(J));
    }
    hg_hull_reset(&r.self, HG_START_MOVING);
    hg_hull_step(&b, &r.ring, K);
    assert_memory_equal(J, K, sizeof(J));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_tells_null),
        cmocka_unit_test(start_tells_bad_tables),
        cmocka_unit_test(thresholds_follow_the_definition_also_after_rewriting),
        cmocka_unit_test(the_start_is_handed_over_to_the_tail_once),
        cmocka_unit_test(the_tail_bounds_an_endless_response_and_heals),
        cmocka_unit_test(a_tail_that_overflows_heals),
        cmocka_unit_test(what_does_not_fit_is_the_largest_number),
        cmocka_unit_test(modes_need_tables),
        cmocka_unit_test(modes_begin_with_the_initial_state),
        cmocka_unit_test(a_mode_that_overflows_heals),
        cmocka_unit_test(readiness_counts_samples_and_never_wraps),
        cmocka_unit_test(reset_forgets_all),
        cmocka_unit_test(hulls_share_a_ring_and_nothing_else),
    };
    return cmocka_run_group_tests(tests, fill_weights, NULL);
}
