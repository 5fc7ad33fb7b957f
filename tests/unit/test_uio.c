/** @file
 *  uio.h: an unknown-input observer against the equations it is made from, in double precision, and its radii against what errors can do. */
#include "support.h"

#include "hullguard/uio.h"

/* A cart on a spring, x = [position, speed, fault of the position sensor], pushed by an unknown force, an actuator's fault as well; signals: position
 * with the sensor's fault, speed, the fault itself (as in the publication), and the known input. */
#define N 3U
#define Q 2U
#define M 3U
#define P 1U
#define ORDER (N + Q + 1U) /* s, g, low pass of the sensor's fault */
#define ESTIMATES (1U + 1U + 1U + N)
#define WIDTH (M + P)
#define TAPS 6U
#define LENGTH (TAPS + 2U)
#define MODES 1U
#define SIGNALS (WIDTH + 1U) /* and one that is not read */

static const double Fd[N][N] = {{0.5, 0.125, 0.0}, {-0.25, 0.25, 0.0}, {0.0, 0.125, 0.5}};
static const double K0[N][M] = {{0.25, -0.125, 0.5}, {0.0, 0.5, 0.125}, {0.125, 0.0, 0.25}};
static const double K1d[N][M] = {{0.125, 0.5, 0.0}, {-0.5, 0.25, 0.25}, {0.0, 0.125, 0.0}};
static const double H[N][M] = {{1.0, 0.0, -1.0}, {0.0, 0.5, 0.0}, {0.0, 0.0, 0.75}};
static const double Ad[N][N] = {{1.0, 0.0625, 0.0}, {-0.125, 0.875, 0.0}, {0.0, 0.0, 0.9375}};
static const double Bd[N] = {0.03125, 0.5, 0.0};
static const double Bz[N] = {0.0625, -0.25, 0.125};
static const double inverse[Q][N] = {{0.5, 8.0, 0.0}, {0.0, -2.0, 4.0}}; /* Gd^+ */
static const double low[Q] = {0.25, 1.0};
static const double low_sensor = 0.125;

static hg_real state_table[ORDER * ORDER];
static hg_real input_table[ORDER * WIDTH];
static hg_real output_table[ESTIMATES * ORDER];
static hg_real direct_table[ESTIMATES * WIDTH];
static const uint8_t tap_list[WIDTH] = {TAPS, TAPS, TAPS, TAPS};
static hg_real weight_table[ESTIMATES * WIDTH * (TAPS + 1U)]; /* the modes are all there is behind the taps: tails stay 0 */
static const hg_real no_bias[ESTIMATES] = {R(0), R(0), R(0), R(0), R(0), R(0)};
static hg_real tail_out[ESTIMATES];
static hg_real mode_decay[MODES];
static hg_real mode_in[MODES * WIDTH];
static const hg_real mode_start[MODES] = {R(0)};
static const uint8_t signal_list[WIDTH] = {1U, 4U, 0U, 2U};

static hg_uio_config usual;

/* Row i of: s(k+1), g(k+1), p(k+1) | estimates, as coefficients of [s; g; p] and [y; u], by the header's equations. */
static void fill_matrices(void)
{
    double xs[N][ORDER] = {{0}};
    double xy[N][WIDTH] = {{0}};
    double S[ORDER][ORDER] = {{0}};
    double I[ORDER][WIDTH] = {{0}};
    double O[ESTIMATES][ORDER] = {{0}};
    double D[ESTIMATES][WIDTH] = {{0}};
    for (size_t i = 0U; i < N; i++) {
        xs[i][i] = 1.0;
        for (size_t j = 0U; j < M; j++) {
            xy[i][j] = K1d[i][j] + H[i][j];
            I[i][j] = K0[i][j];
            for (size_t l = 0U; l < N; l++) {
                I[i][j] += Fd[i][l] * K1d[l][j];
            }
        }
        I[i][M] = Bz[i];
        for (size_t j = 0U; j < N; j++) {
            S[i][j] = Fd[i][j];
        }
    }
    for (size_t f = 0U; f < Q; f++) {
        const size_t row = (f == 0U) ? 0U : 2U; /* the actuator's fault, the unknown input */
        O[row][N + f] = 1.0;
        S[N + f][N + f] = 1.0 - low[f];
        for (size_t i = 0U; i < N; i++) {
            double next = (1.0 - low[f]) * low[f] * inverse[f][i];
            for (size_t l = 0U; l < N; l++) {
                next -= low[f] * inverse[f][l] * Ad[l][i];
            }
            S[N + f][i] += next;
            O[row][i] += low[f] * inverse[f][i];
            I[N + f][M] -= low[f] * inverse[f][i] * Bd[i];
            for (size_t j = 0U; j < M; j++) {
                I[N + f][j] += next * xy[i][j];
                D[row][j] += low[f] * inverse[f][i] * xy[i][j];
            }
        }
    }
    S[ORDER - 1U][ORDER - 1U] = 1.0 - low_sensor;
    S[ORDER - 1U][2] = low_sensor;
    O[1][ORDER - 1U] = 1.0 - low_sensor;
    O[1][2] = low_sensor;
    for (size_t j = 0U; j < M; j++) {
        I[ORDER - 1U][j] = low_sensor * xy[2][j];
        D[1][j] = low_sensor * xy[2][j];
    }
    for (size_t i = 0U; i < N; i++) {
        for (size_t j = 0U; j < ORDER; j++) {
            O[3U + i][j] = xs[i][j];
        }
        for (size_t j = 0U; j < WIDTH; j++) {
            D[3U + i][j] = xy[i][j];
        }
    }
    for (size_t j = 0U; j < ORDER; j++) {
        for (size_t i = 0U; i < ORDER; i++) {
            state_table[(i * ORDER) + j] = R(S[i][j]);
        }
        for (size_t i = 0U; i < ESTIMATES; i++) {
            output_table[(i * ORDER) + j] = R(O[i][j]);
        }
    }
    for (size_t j = 0U; j < WIDTH; j++) {
        for (size_t i = 0U; i < ORDER; i++) {
            input_table[(i * WIDTH) + j] = R(I[i][j]);
        }
        for (size_t i = 0U; i < ESTIMATES; i++) {
            direct_table[(i * WIDTH) + j] = R(D[i][j]);
        }
    }
}

/* Estimates 2n and 2n + 1 share a place: by signal, then by lag. */
static size_t place_of(size_t i, size_t signal, size_t lag)
{
    const size_t pair = ((i / 2U) * WIDTH) + signal;
    return (((pair * (TAPS + 1U)) + lag) * 2U) + (i % 2U);
}

/* |C A^(lag-1) B| from the tables, larger by what sums can lose; one mode from above: |A^lag| <= 8 x 0.96^lag, which the test checks. */
static void fill_weights(void)
{
    double response[ORDER][WIDTH];
    for (size_t j = 0U; j < WIDTH; j++) {
        for (size_t i = 0U; i < ORDER; i++) {
            response[i][j] = (double)input_table[(i * WIDTH) + j];
        }
        for (size_t i = 0U; i < ESTIMATES; i++) {
            weight_table[place_of(i, j, 0U)] = R(fabs((double)direct_table[(i * WIDTH) + j]) * 1.0001);
        }
        mode_in[j] = R(1);
    }
    mode_decay[0] = R(0.96);
    for (size_t lag = 1U; lag < 200U; lag++) {
        double next[ORDER][WIDTH];
        for (size_t j = 0U; j < WIDTH; j++) {
            for (size_t i = 0U; i < ESTIMATES; i++) {
                double sum = 0.0;
                for (size_t l = 0U; l < ORDER; l++) {
                    sum += (double)output_table[(i * ORDER) + l] * response[l][j];
                }
                if (lag < TAPS) {
                    weight_table[place_of(i, j, lag)] = R(fabs(sum) * 1.0001);
                } else {
                    const double bound = fabs(sum) / pow(0.96, (double)(lag - TAPS)) * 1.0001;
                    tail_out[i] = (bound > (double)tail_out[i]) ? R(bound) : tail_out[i];
                }
            }
            for (size_t i = 0U; i < ORDER; i++) {
                next[i][j] = 0.0;
                for (size_t l = 0U; l < ORDER; l++) {
                    next[i][j] += (double)state_table[(i * ORDER) + l] * response[l][j];
                }
            }
        }
        memcpy(response, next, sizeof(response));
    }
}

static int fill_tables(void **state)
{
    (void)state;
    fill_matrices();
    fill_weights();
    usual = (hg_uio_config){
        .actuators = 1U, .sensors = 1U, .unknown = 1U, .states = N,
        .observer = {.order = ORDER, .residuals = ESTIMATES, .width = WIDTH, .signal = signal_list,
                     .state = {ORDER, ORDER, 0, state_table}, .input = {ORDER, WIDTH, 0, input_table},
                     .output = {ESTIMATES, ORDER, 0, output_table}, .direct = {ESTIMATES, WIDTH, 0, direct_table}},
        .hull = {.residuals = ESTIMATES, .width = WIDTH, .signal = signal_list, .taps = tap_list, .weight = weight_table, .settle = 1U,
                 .rest = no_bias, .rest_left = no_bias, .moving = no_bias, .moving_left = no_bias, .bias = no_bias, .ready_rest = 1U,
                 .ready_moving = 4U, .decay = no_bias, .modes = MODES, .mode_decay = mode_decay, .mode_input = mode_in, .mode_output = tail_out,
                 .mode_rest = mode_start, .mode_moving = mode_start}};
    return 0;
}

typedef struct {
    hg_uio  uio;
    hg_ring ring;
    hg_real ring_memory[SIGNALS * LENGTH];
    hg_real memory[HG_UIO_REALS(ORDER, WIDTH, ESTIMATES, MODES) + 1U];
    hg_real estimate[ESTIMATES + 1U];
    hg_real radius[ESTIMATES + 1U];
} rig;

static void begin(rig *r, hg_start how)
{
    arm(r->memory, COUNT(r->memory));
    arm(r->estimate, COUNT(r->estimate));
    arm(r->radius, COUNT(r->radius));
    assert_status(HG_OK, hg_ring_start(&r->ring, SIGNALS, LENGTH, r->ring_memory));
    assert_status(HG_OK, hg_uio_start(&r->uio, &usual, &r->ring, how, r->memory));
}

static hg_status step(rig *r, const hg_real *value, const hg_real *radius)
{
    assert_status(HG_OK, hg_ring_push(&r->ring, radius));
    return hg_uio_step(&r->uio, value, &r->ring, r->estimate, r->radius);
}

static void draw_signals(uint32_t *random, hg_real *value)
{
    for (size_t g = 0U; g < SIGNALS; g++) {
        value[g] = R((double)draw_between(random, -64, 64) / 16.0);
    }
}

static void start_tells_null_and_bad_tables(void **state)
{
    (void)state;
    hg_uio self;
    hg_ring ring;
    hg_real ring_memory[SIGNALS * LENGTH];
    hg_real memory[HG_UIO_REALS(ORDER, WIDTH, ESTIMATES, MODES)];
    const uint8_t outside[WIDTH] = {0U, 1U, 2U, SIGNALS};
    const uint8_t long_taps[WIDTH] = {TAPS, TAPS, LENGTH, TAPS};
    assert_status(HG_OK, hg_ring_start(&ring, SIGNALS, LENGTH, ring_memory));
    assert_status(HG_E_ARGUMENT, hg_uio_start(NULL, &usual, &ring, HG_START_REST, memory));
    assert_status(HG_E_ARGUMENT, hg_uio_start(&self, NULL, &ring, HG_START_REST, memory));
    assert_status(HG_E_ARGUMENT, hg_uio_start(&self, &usual, NULL, HG_START_REST, memory));
    assert_status(HG_E_ARGUMENT, hg_uio_start(&self, &usual, &ring, HG_START_REST, NULL));
    const uint8_t outside_at_first[WIDTH] = {SIGNALS, 1U, 2U, 0U};
    hg_uio_config c[8];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = usual;
    }
    c[0].states = N + 1U;
    c[1].hull.residuals = 1U;
    c[2].observer.order = 1U;
    c[3].hull.taps = long_taps;
    c[4].observer.signal = outside;
    c[5].actuators = 255U; /* would wrap in 8 bits */
    c[5].sensors = 1U + (uint8_t)(1U + ESTIMATES - N - 1U);
    c[5].unknown = 0U;
    c[6].observer.residuals = 1U;
    c[7].observer.signal = outside_at_first;
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_false(hg_uio_valid(&c[i], SIGNALS, LENGTH));
        assert_status(HG_E_CONFIG, hg_uio_start(&self, &c[i], &ring, HG_START_REST, memory));
    }
    assert_true(hg_uio_valid(&usual, SIGNALS, LENGTH));
}

/* The observer as it is derived: z, its FOH step, differences of xhat, low passes. */
typedef struct {
    double z[N], xhat[N], y[M], u, estimate[ESTIMATES];
    bool   begun;
} derived;

static void derived_step(derived *d, const double *y, double u)
{
    double z[N];
    double x[N];
    for (size_t i = 0U; i < N; i++) {
        z[i] = d->begun ? (Bz[i] * d->u) : 0.0;
        for (size_t j = 0U; j < M; j++) {
            /* s = 0 before the first sample */
            z[i] += (K1d[i][j] * y[j]) + (d->begun ? (K0[i][j] * d->y[j]) : 0.0);
        }
        for (size_t j = 0U; j < N; j++) {
            z[i] += d->begun ? (Fd[i][j] * d->z[j]) : 0.0;
        }
        x[i] = z[i];
        for (size_t j = 0U; j < M; j++) {
            x[i] += H[i][j] * y[j];
        }
    }
    for (size_t f = 0U; f < Q; f++) {
        double raw = 0.0;
        for (size_t i = 0U; i < N; i++) {
            double moved = x[i] - (d->begun ? (Bd[i] * d->u) : 0.0);
            for (size_t j = 0U; j < N; j++) {
                moved -= d->begun ? (Ad[i][j] * d->xhat[j]) : 0.0;
            }
            raw += inverse[f][i] * moved;
        }
        double *estimate = &d->estimate[(f == 0U) ? 0U : 2U];
        *estimate += low[f] * (raw - *estimate);
    }
    d->estimate[1] += low_sensor * (x[2] - d->estimate[1]);
    memcpy(&d->estimate[3], x, sizeof(x));
    memcpy(d->z, z, sizeof(z));
    memcpy(d->xhat, x, sizeof(x));
    memcpy(d->y, y, sizeof(d->y));
    d->u = u;
    d->begun = true;
}

static void estimates_are_those_of_the_observer_it_is_derived_from(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(51U);
    rig r;
    derived d = {.begun = false};
    const hg_real none[SIGNALS] = {R(0), R(0), R(0), R(0), R(0)};
    begin(&r, HG_START_REST);
    for (int k = 0; k < 200; k++) {
        hg_real value[SIGNALS];
        double y[M];
        draw_signals(&random, value);
        for (size_t j = 0U; j < M; j++) {
            y[j] = (double)value[signal_list[j]];
        }
        derived_step(&d, y, (double)value[signal_list[M]]);
        assert_status(HG_OK, step(&r, value, none));
        for (size_t i = 0U; i < ESTIMATES; i++) {
            assert_near(d.estimate[i], r.estimate[i], 2e-4);
            assert_real(0.0, r.radius[i]);
        }
    }
    assert_untouched(&r.memory[COUNT(r.memory) - 1U], 1U);
    assert_untouched(&r.estimate[ESTIMATES], 1U);
    assert_untouched(&r.radius[ESTIMATES], 1U);
}

/* Two observers, one of them of values that are off by their radii, every fifth of which shows one sample late only. */
static void radii_bound_what_errors_do(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(52U);
    rig held;
    rig true_one;
    double worst = 0.0;
    const hg_real none[SIGNALS] = {R(0), R(0), R(0), R(0), R(0)};
    begin(&held, HG_START_REST);
    hg_real radius[SIGNALS] = {R(0), R(0), R(0), R(0), R(0)};
    bool late = false; /* does the last sample's radius show only now? */
    begin(&true_one, HG_START_REST);
    for (int k = 0; k < 400; k++) {
        hg_real value[SIGNALS];
        hg_real wrong[SIGNALS];
        hg_real before[SIGNALS];
        const bool corrected = late;
        memcpy(before, radius, sizeof(before));
        late = (k % 5) == 0;
        draw_signals(&random, value);
        for (size_t g = 0U; g < SIGNALS; g++) {
            radius[g] = ((k / 40) % 2 == 0) ? R((double)draw_between(&random, 0, 16) / 16.0) : R(0);
            wrong[g] = value[g] + (((draw(&random) & 1U) == 0U) ? radius[g] : -radius[g]);
        }
        assert_status(HG_OK, step(&true_one, value, none));
        assert_status(HG_OK, hg_ring_push(&held.ring, late ? none : radius));
        if (corrected) {
            hg_ring_rewrite(&held.ring, 1U, 0U, SIGNALS, before);
        }
        assert_status(HG_OK, hg_uio_step(&held.uio, wrong, &held.ring, held.estimate, held.radius));
        for (size_t i = 0U; (!late) && (i < ESTIMATES); i++) {
            const double off = fabs((double)held.estimate[i] - (double)true_one.estimate[i]);
            assert_true(off <= (double)held.radius[i] + 2e-4);
            worst = ((double)held.radius[i] > 0.01) ? fmax(worst, off / (double)held.radius[i]) : worst;
        }
    }
    assert_true(worst > 0.5); /* and they are not just large */
}

static void a_bad_number_begins_again(void **state)
{
    (void)state;
    rig r;
    const hg_real one[SIGNALS] = {R(1), R(1), R(1), R(1), R(1)};
    const hg_real bad[] = {REAL_NAN, REAL_INF, -REAL_INF, HG_REAL_MAX};
    begin(&r, HG_START_REST);
    for (size_t b = 0U; b < COUNT(bad); b++) {
        hg_real value[SIGNALS] = {R(1), R(1), R(1), R(1), R(1)};
        for (int k = 0; k < 8; k++) {
            assert_status(HG_OK, step(&r, one, one));
        }
        assert_true(hg_uio_ready(&r.uio));
        value[signal_list[1]] = bad[b];
        value[signal_list[0]] = (b == 3U) ? HG_REAL_MAX : R(1);
        value[signal_list[2]] = (b == 3U) ? HG_REAL_MAX : R(1);
        assert_status(HG_E_NUMERIC, step(&r, value, one));
        for (size_t i = 0U; i < ESTIMATES; i++) {
            assert_real(0.0, r.estimate[i]);
            assert_real(HG_REAL_MAX, r.radius[i]);
        }
        assert_false(hg_uio_ready(&r.uio));
        for (size_t i = 0U; i < ORDER; i++) {
            assert_real(0.0, r.uio.observer.z[i]);
        }
        assert_int_equal((int)HG_START_MOVING, (int)r.uio.hull.how);
    }
    hg_real value[SIGNALS] = {R(1), R(1), R(1), REAL_NAN, R(1)}; /* a signal that is not read may be anything */
    assert_status(HG_OK, step(&r, value, one));
}

/* An estimate that overflows while the state does not, and a radius that does: nothing is known, and both say so. */
static void what_overflows_is_not_known(void **state)
{
    (void)state;
    rig r;
    const hg_real none[SIGNALS] = {R(0), R(0), R(0), R(0), R(0)};
    const hg_real huge[SIGNALS] = {HG_REAL_MAX, HG_REAL_MAX, HG_REAL_MAX, HG_REAL_MAX, HG_REAL_MAX};
    hg_real steep[ESTIMATES * WIDTH];
    begin(&r, HG_START_REST);
    assert_status(HG_OK, step(&r, none, huge));
    assert_real(0.0, r.estimate[0]);
    assert_real(HG_REAL_MAX, r.radius[0]);
    hg_uio_config c = usual;
    memcpy(steep, direct_table, sizeof(steep));
    steep[0] = R(1e30);
    c.observer.direct.data = steep;
    assert_status(HG_OK, hg_uio_start(&r.uio, &c, &r.ring, HG_START_REST, r.memory));
    hg_ring_reset(&r.ring);
    hg_real value[SIGNALS] = {R(0), R(0), R(0), R(0), R(0)};
    value[signal_list[0]] = HG_REAL_MAX / R(1e20);
    assert_status(HG_OK, step(&r, value, none));
    assert_real(0.0, r.estimate[0]);
    assert_real(HG_REAL_MAX, r.radius[0]);
    assert_real(0.0, r.radius[3]);
}

static void reset_begins_again(void **state)
{
    (void)state;
    rig r;
    rig fresh;
    uint32_t random = seed_of_run(53U);
    const hg_real wide[SIGNALS] = {R(1), R(2), R(3), R(4), R(5)};
    begin(&r, HG_START_REST);
    for (int k = 0; k < 20; k++) {
        assert_status(HG_OK, step(&r, wide, wide));
    }
    hg_uio_reset(&r.uio, HG_START_MOVING);
    hg_ring_reset(&r.ring);
    begin(&fresh, HG_START_MOVING);
    for (int k = 0; k < 20; k++) {
        hg_real value[SIGNALS];
        draw_signals(&random, value);
        assert_status(HG_OK, step(&r, value, wide));
        assert_status(HG_OK, step(&fresh, value, wide));
        assert_memory_equal(r.estimate, fresh.estimate, sizeof(r.estimate));
        assert_memory_equal(r.radius, fresh.radius, sizeof(r.radius));
        assert_int_equal(k >= 3, hg_uio_ready(&r.uio));
    }
}

/* A detector's restart empties its ring; a state that is older than what the ring holds would have radii that are too small. */
static void who_follows_a_detector_begins_again_with_it(void **state)
{
    (void)state;
    rig r;
    hg_real value[SIGNALS] = {R(1), R(2), R(3), R(4), R(5)};
    begin(&r, HG_START_REST);
    hg_detector detector = {.radii = r.ring, .value = value, .beginnings = 1U};
    for (int k = 0; k < 10; k++) {
        assert_status(HG_OK, hg_ring_push(&detector.radii, value));
        assert_status(HG_OK, hg_uio_follow(&r.uio, &detector, r.estimate, r.radius));
    }
    assert_int_equal((int)HG_START_REST, (int)r.uio.hull.how);
    hg_ring_reset(&detector.radii);
    detector.beginnings = 2U;
    assert_status(HG_OK, hg_ring_push(&detector.radii, value));
    assert_status(HG_OK, hg_uio_follow(&r.uio, &detector, r.estimate, r.radius));
    assert_int_equal((int)HG_START_MOVING, (int)r.uio.hull.how);
    assert_int_equal(1, (int)r.uio.hull.k);
    rig fresh;
    begin(&fresh, HG_START_MOVING);
    assert_status(HG_OK, step(&fresh, value, value));
    assert_memory_equal(fresh.estimate, r.estimate, sizeof(r.estimate));
    assert_memory_equal(fresh.radius, r.radius, sizeof(r.radius));
    assert_status(HG_OK, hg_ring_push(&detector.radii, value));
    assert_status(HG_OK, hg_uio_follow(&r.uio, &detector, r.estimate, r.radius));
    assert_int_equal(2, (int)r.uio.hull.k);
    value[signal_list[0]] = REAL_NAN;
    assert_status(HG_E_NUMERIC, hg_uio_follow(&r.uio, &detector, r.estimate, r.radius));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_tells_null_and_bad_tables),
        cmocka_unit_test(estimates_are_those_of_the_observer_it_is_derived_from),
        cmocka_unit_test(radii_bound_what_errors_do),
        cmocka_unit_test(a_bad_number_begins_again),
        cmocka_unit_test(what_overflows_is_not_known),
        cmocka_unit_test(reset_begins_again),
        cmocka_unit_test(who_follows_a_detector_begins_again_with_it),
    };
    return cmocka_run_group_tests(tests, fill_tables, NULL);
}
