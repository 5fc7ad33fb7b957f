/** @file
 *  real.h for Q31, and what runs on it: the primitives at every edge, codes, residual, hull, observer and hold, against whole numbers of 128 bits that are
 *  divided and rounded by a rule of their own. Built for HG_REAL_Q31 alone. */
#include "support.h"

#include "hullguard/code.h"
#include "hullguard/frame.h"
#include "hullguard/freeze.h"
#include "hullguard/hold.h"
#include "hullguard/hull.h"
#include "hullguard/residual.h"
#include "hullguard/uio.h"

#if !HG_REAL_Q31
#error "this test is for the fixed-point number type"
#endif

__extension__ typedef __int128 wide;

#define TERMS 255U

static const int32_t edges[] = {INT32_MIN, INT32_MIN + 1, INT32_MIN + 2, -1073741825, -1073741824, -1073741823, -65536, -3, -2, -1, 0, 1, 2, 3,
                                65536, 1073741823, 1073741824, 1073741825, INT32_MAX - 2, INT32_MAX - 1, INT32_MAX};

/* x / 2^places to the nearest, ties away from zero: by a quotient and its remainder. */
static wide divided(wide x, unsigned places)
{
    const wide divisor = (wide)1 << places;
    const wide rest = x % divisor;
    const wide twice = 2 * ((rest < 0) ? -rest : rest);
    wide quotient = x / divisor;
    if (twice >= divisor) {
        quotient += (x < 0) ? -1 : 1;
    }
    return quotient;
}

static hg_real held(wide x)
{
    wide inside = (x > INT32_MAX) ? (wide)INT32_MAX : x;
    inside = (inside < -(wide)INT32_MAX) ? -(wide)INT32_MAX : inside;
    return (hg_real)inside;
}

static int32_t draw_edge(uint32_t *random)
{
    const int32_t any = draw_between(random, INT32_MIN, INT32_MAX);
    return ((draw(random) % 4U) == 0U) ? edges[draw(random) % COUNT(edges)] : (any >> (draw(random) % 31U));
}

/* ---- primitives ---- */

static void check_pair(hg_real a, hg_real b)
{
    assert_int_equal(held((wide)a + b), hg_real_add(a, b));
    assert_int_equal(held((wide)a - b), hg_real_sub(a, b));
    assert_int_equal(held(divided((wide)a * b, 31U)), hg_real_mul(a, b));
    assert_int_equal((a > b) ? a : b, hg_real_max(a, b));
    assert_int_equal((a < b) ? a : b, hg_real_min(a, b));
    assert_true(hg_acc_mac(hg_acc_zero(), a, b) == (int64_t)a * b);
    assert_int_equal(a, hg_real_widen(a, b));
}

static void check_scaled(hg_real a, int32_t b)
{
    for (int exponent = -40; exponent <= 0; exponent++) {
        assert_int_equal(held(divided((wide)a * b, (unsigned)-exponent)), hg_real_of_code(a, (int8_t)exponent, b));
        const wide code = divided((wide)a * b, (unsigned)(60 + exponent));
        const bool known = (a >= -HG_REAL_MAX) && (a <= HG_REAL_MAX) && (code > -(wide)INT32_MAX) && (code < (wide)INT32_MAX);
        assert_int_equal(known ? (int32_t)code : INT32_MIN, hg_real_to_code(a, b, (int8_t)exponent));
    }
    for (int exponent = -31; exponent <= 30; exponent++) {
        assert_int_equal(held(divided((wide)a * b, (unsigned)(31 - exponent))), hg_acc_real(hg_acc_mac(hg_acc_zero(), a, b), (int8_t)exponent));
    }
}

static void primitives_are_exact_or_nearest_at_every_edge(void **state)
{
    (void)state;
    for (size_t i = 0U; i < COUNT(edges); i++) {
        const int32_t a = edges[i];
        assert_int_equal(held((a < 0) ? -(wide)a : (wide)a), hg_real_abs(a));
        assert_int_equal((a != INT32_MIN) && (a != -INT32_MAX) && (a != INT32_MAX), hg_real_finite(a));
        assert_int_equal(hg_real_finite(a) ? 0 : 1, hg_real_defect(a));
        for (size_t j = 0U; j < COUNT(edges); j++) {
            check_pair(a, edges[j]);
            check_scaled(a, edges[j]);
        }
    }
}

static void primitives_are_exact_or_nearest_anywhere(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(61U);
    for (int i = 0; i < 2000; i++) {
        const int32_t a = draw_edge(&random);
        const int32_t b = draw_edge(&random);
        check_pair(a, b);
        check_scaled(a, b);
    }
}

static void ties_go_away_from_zero(void **state)
{
    (void)state;
    const hg_real half = HG_REAL_C(0.5);
    assert_int_equal(1073741824, half);
    for (int32_t odd = 1; odd < 100; odd += 2) {
        assert_int_equal((odd + 1) / 2, hg_real_mul(half, odd));
        assert_int_equal(-((odd + 1) / 2), hg_real_mul(half, -odd));
        assert_int_equal((odd + 1) / 2, hg_real_of_code(1, -1, odd));
        assert_int_equal(-((odd + 1) / 2), hg_real_of_code(1, -1, -odd));
        assert_int_equal((odd + 1) / 2, hg_acc_real((hg_acc)odd, 30));
        assert_int_equal(-((odd + 1) / 2), hg_acc_real(-(hg_acc)odd, 30));
        assert_int_equal((odd + 1) / 2, hg_real_to_code(odd, half, -29));
        assert_int_equal(-((odd + 1) / 2), hg_real_to_code(-odd, half, -29));
    }
}

static void constants_and_exponents_have_their_range(void **state)
{
    (void)state;
    assert_int_equal(INT32_MAX, HG_REAL_C(1.0));
    assert_int_equal(INT32_MAX, HG_REAL_C(1.000001));
    assert_int_equal(-1073741824, HG_REAL_C(-0.5));
    assert_int_equal(0, HG_REAL_ZERO);
    assert_true(hg_real_finite(HG_REAL_MAX) && hg_real_finite(-HG_REAL_MAX));
    assert_false(hg_real_finite(HG_REAL_MAX + 1) || hg_real_finite(-HG_REAL_MAX - 1));
    for (int exponent = INT8_MIN; exponent <= INT8_MAX; exponent++) {
        assert_int_equal((exponent >= -31) && (exponent <= 30), hg_exponent_valid((int8_t)exponent));
    }
}

/* ---- sums ---- */

/* Terms whose magnitudes add up to 2^31 - 1 at most, as every table's do. */
static void draw_terms(uint32_t *random, hg_real *term, size_t n, bool positive)
{
    int64_t left = INT32_MAX;
    for (size_t i = 0U; i < n; i++) {
        const int64_t most = ((draw(random) % 8U) == 0U) ? left : ((2 * left) / (int64_t)n);
        const int32_t size = draw_between(random, 0, (int32_t)((most < left) ? most : left));
        left -= size;
        term[i] = (positive || ((draw(random) % 2U) == 0U)) ? size : -size;
    }
    if (n > 0U) {
        term[n - 1U] += (hg_real)(((term[n - 1U] < 0) ? -left : left) * ((draw(random) % 2U) == 0U)); /* often all of it */
    }
}

static void sums_of_whole_tables_never_overflow(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(62U);
    for (int run = 0; run < 400; run++) {
        hg_real term[TERMS];
        const size_t n = (size_t)draw_between(&random, 1, (int32_t)TERMS);
        const int how = draw_between(&random, 0, 3);
        draw_terms(&random, term, n, false);
        hg_acc sum = hg_acc_zero();
        wide exact = 0;
        for (size_t i = 0U; i < n; i++) {
            const hg_real against = (term[i] < 0) ? INT32_MIN : INT32_MAX; /* all terms add up */
            const hg_real x = (how == 0) ? against : (how == 1) ? INT32_MIN : draw_edge(&random);
            sum = hg_acc_mac(sum, term[i], x);
            exact += (wide)term[i] * x;
        }
        assert_true((wide)sum == exact);
        for (int exponent = -31; exponent <= 30; exponent++) {
            assert_int_equal(held(divided(exact, (unsigned)(31 - exponent))), hg_acc_real(sum, (int8_t)exponent));
        }
    }
}

/* ---- codes ---- */

static hg_code_scale scale_of(hg_real resolution, int8_t exponent, hg_real offset)
{
    return (hg_code_scale){.resolution = resolution, .exponent = exponent, .offset = offset, .minimum = -32768, .maximum = 32767,
                           .per_unit = held(divided(((wide)1 << 62) / resolution, 2U))};
}

static void every_16_bit_code_survives_the_round_trip(void **state)
{
    (void)state;
    const hg_real resolutions[] = {536870913, 1073741824, 1000000007, 1717986918, INT32_MAX - 1}; /* 1/4 to 1 */
    for (size_t i = 0U; i < COUNT(resolutions); i++) {
        for (int8_t exponent = -27; exponent <= -16; exponent++) {
            const hg_code_scale scale = scale_of(resolutions[i], exponent, (exponent < -16) ? HG_REAL_C(-0.25) : 0);
            for (int32_t code = -32768; code <= 32767; code++) {
                const hg_real value = hg_real_of_code(scale.resolution, exponent, code);
                assert_int_equal(code, hg_real_to_code(value, scale.per_unit, exponent));
                assert_int_equal(code, hg_code_encode(&scale, hg_code_value(&scale, code)));
            }
        }
    }
}

static void what_did_not_fit_has_no_code(void **state)
{
    (void)state;
    const hg_code_scale scale = scale_of(HG_REAL_C(0.5), -15, 0);
    const hg_real outside[] = {INT32_MIN, -INT32_MAX, INT32_MAX};
    for (size_t i = 0U; i < COUNT(outside); i++) {
        assert_int_equal(HG_CODE_INVALID, hg_code_encode(&scale, outside[i]));
    }
    assert_int_equal(HG_CODE_INVALID, hg_code_encode(&scale, HG_REAL_MAX)); /* 65536 codes */
    const hg_code_scale high = scale_of(HG_REAL_C(0.5), -15, HG_REAL_C(0.75));
    const hg_code_scale low = scale_of(HG_REAL_C(0.5), -15, HG_REAL_C(-0.75));
    assert_int_equal(16384, hg_code_encode(&high, HG_REAL_MAX)); /* what saturated lies within this range, and is not taken for a number of it */
    assert_int_equal(HG_CODE_INVALID, hg_code_encode(&high, INT32_MAX));
    assert_int_equal(HG_CODE_INVALID, hg_code_encode(&low, -INT32_MAX));
    assert_int_equal(INT32_MAX, hg_code_value(&scale, INT32_MAX));
    assert_int_equal(-INT32_MAX, hg_code_value(&scale, INT32_MIN));
}

/* A float field has no place in an image without floats: the message is refused, and nothing of it would be believed. */
static void a_float_field_is_refused(void **state)
{
    (void)state;
    const hg_field field = {.start = 0U, .length = 32U, .flags = HG_FIELD_FLOAT32};
    const hg_code_scale scale = scale_of(HG_REAL_C(0.5), -16, 0);
    const hg_e2e_config none = {.profile = HG_E2E_NONE, .stamp = HG_E2E_NO_STAMP, .limits = &hg_e2e_limits_default};
    const hg_field integer = {.start = 0U, .length = 32U, .flags = HG_FIELD_SIGNED};
    const hg_message message = {.id = 1U, .length = 8U, .width = 1U, .field = &field, .scale = &scale, .e2e = &none};
    hg_can_frame frame;
    int32_t code = 7;
    hg_message other = message;
    other.field = &integer;
    assert_true(hg_frame_valid(&other)); /* nothing but the field's type is wrong */
    assert_false(hg_frame_valid(&message));
    hg_frame_pack(&message, &code, &frame);
    assert_status(HG_OK, hg_frame_unpack(&message, &frame, &code));
    assert_int_equal(HG_CODE_INVALID, code);
    frame.data[0] ^= 1U;
    assert_status(HG_E_NUMERIC, hg_frame_unpack(&message, &frame, &code));
}

/* ---- a generator ---- */

#define ORDER 4U
#define IN 5U
#define OUT 3U

static wide product(const hg_real *row, const hg_real *x, size_t n)
{
    wide sum = 0;
    for (size_t i = 0U; i < n; i++) {
        sum += (wide)row[i] * x[i];
    }
    return sum;
}

static void draw_rows(uint32_t *random, hg_real *m, size_t m_cols, hg_real *n, size_t n_cols, size_t rows)
{
    for (size_t i = 0U; i < rows; i++) {
        hg_real row[ORDER + IN];
        draw_terms(random, row, m_cols + n_cols, false);
        (void)memcpy(&m[i * m_cols], row, m_cols * sizeof(row[0]));
        (void)memcpy(&n[i * n_cols], &row[m_cols], n_cols * sizeof(row[0]));
    }
}

static void a_generator_is_its_equations_with_one_rounding_a_sum(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(63U);
    const uint8_t signal[IN] = {4U, 1U, 0U, 3U, 2U};
    unsigned refused = 0U;
    for (int run = 0; run < 200; run++) {
        hg_real A[ORDER * ORDER];
        hg_real B[ORDER * IN];
        hg_real C[OUT * ORDER];
        hg_real D[OUT * IN];
        const int8_t of_state = (int8_t)draw_between(&random, -3, 1);
        const int8_t of_output = (int8_t)draw_between(&random, -31, 30);
        draw_rows(&random, A, ORDER, B, IN, ORDER);
        draw_rows(&random, C, ORDER, D, IN, OUT);
        const hg_residual_config config = {.order = ORDER, .residuals = OUT, .width = IN, .signal = signal, .state = {ORDER, ORDER, of_state, A},
            .input = {ORDER, IN, of_state, B}, .output = {OUT, ORDER, of_output, C}, .direct = {OUT, IN, of_output, D}};
        hg_residual self;
        hg_real memory[HG_RESIDUAL_REALS(ORDER, IN)];
        hg_real z[ORDER] = {0};
        assert_status(HG_OK, hg_residual_start(&self, &config, memory));
        for (int k = 0; k < 50; k++) {
            hg_real value[IN];
            hg_real v[IN];
            hg_real r[OUT] = {0};
            hg_real next[ORDER];
            bool finite = true;
            for (size_t g = 0U; g < IN; g++) {
                value[g] = ((draw(&random) % 100U) == 0U) ? draw_edge(&random) : draw_between(&random, -HG_REAL_MAX, HG_REAL_MAX);
                finite = finite && hg_real_finite(value[g]);
            }
            for (size_t g = 0U; g < IN; g++) {
                v[g] = value[signal[g]];
            }
            for (size_t i = 0U; i < ORDER; i++) {
                next[i] = held(divided(product(&A[i * ORDER], z, ORDER) + product(&B[i * IN], v, IN), (unsigned)(31 - of_state)));
                finite = finite && hg_real_finite(next[i]);
            }
            assert_status(finite ? HG_OK : HG_E_NUMERIC, hg_residual_step(&self, value, r));
            refused += finite ? 0U : 1U;
            for (size_t i = 0U; finite && (i < OUT); i++) {
                assert_int_equal(held(divided(product(&C[i * ORDER], z, ORDER) + product(&D[i * IN], v, IN), (unsigned)(31 - of_output))), r[i]);
            }
            (void)memcpy(z, finite ? next : z, sizeof(z));
            assert_memory_equal(z, self.z, sizeof(z));
        }
    }
    assert_true(refused > 0U);
}

/* ---- a threshold ---- */

#define LENGTH 8U
#define SETTLE 5U
#define SAMPLES 120U
#define MODES 2U

typedef struct {
    uint8_t signal[IN];
    uint8_t taps[IN];
    size_t  all; /* numbers of one residual */
    hg_real weight[OUT * ((IN * LENGTH) + MODES)]; /* by residual: by signal and lag, behind a signal's lags its tail; then of the modes */
    hg_real laid_out[OUT * IN * LENGTH];
    hg_real rest[SETTLE * OUT];
    hg_real moving[SETTLE * OUT];
    hg_real rest_left[OUT];
    hg_real moving_left[OUT];
    hg_real bias[OUT];
    hg_real decay[OUT];
    hg_real mode_decay[MODES];
    hg_real mode_input[MODES * IN];
    hg_real mode_output[OUT * MODES];
    hg_real mode_rest[MODES];
    hg_real mode_moving[MODES];
} tables;

static const hg_real *row_of(const tables *t, size_t i)
{
    return &t->weight[i * (t->all + MODES)];
}

static void draw_positive(uint32_t *random, hg_real *x, size_t n, hg_real most)
{
    for (size_t i = 0U; i < n; i++) {
        x[i] = draw_between(random, 0, most);
    }
}

static void draw_tables(uint32_t *random, tables *t)
{
    t->all = 0U;
    for (size_t g = 0U; g < IN; g++) {
        t->signal[g] = (uint8_t)draw_between(random, 0, (int32_t)IN - 1);
        t->taps[g] = (uint8_t)draw_between(random, 0, (int32_t)LENGTH - 1);
        t->all += t->taps[g] + 1U;
    }
    for (size_t i = 0U; i < OUT; i++) {
        draw_terms(random, &t->weight[i * (t->all + MODES)], t->all + MODES, true);
        (void)memcpy(&t->mode_output[i * MODES], &row_of(t, i)[t->all], MODES * sizeof(hg_real));
    }
    for (size_t m = 0U; m < MODES; m++) {
        draw_terms(random, &t->mode_input[m * IN], IN, true);
    }
    draw_positive(random, t->mode_decay, MODES, HG_REAL_MAX);
    draw_positive(random, t->mode_rest, MODES, HG_REAL_MAX / 4);
    draw_positive(random, t->mode_moving, MODES, HG_REAL_MAX);
    size_t to = 0U;
    for (size_t i = 0U; i < OUT; i += 2U) {
        for (size_t at = 0U; at < t->all; at++) { /* signal after signal, lag after lag */
            for (size_t n = i; (n < OUT) && (n < (i + 2U)); n++) {
                t->laid_out[to] = row_of(t, n)[at];
                to++;
            }
        }
    }
    draw_positive(random, t->rest, COUNT(t->rest), HG_REAL_MAX / 4);
    draw_positive(random, t->moving, COUNT(t->moving), HG_REAL_MAX);
    draw_positive(random, t->rest_left, OUT, HG_REAL_MAX / 4);
    draw_positive(random, t->moving_left, OUT, HG_REAL_MAX);
    draw_positive(random, t->bias, OUT, HG_REAL_MAX / 4);
    draw_positive(random, t->decay, OUT, HG_REAL_MAX);
}

static hg_real at_most(wide x)
{
    return hg_real_min(held(x), HG_REAL_MAX);
}

static wide sum_of_taps(const tables *t, const hg_real (*past)[IN], size_t k, size_t i)
{
    const hg_real *weight = row_of(t, i);
    wide sum = 0;
    for (size_t g = 0U; g < IN; g++) {
        for (size_t lag = 0U; lag < t->taps[g]; lag++) {
            sum += (lag <= k) ? ((wide)*weight * past[k - lag][t->signal[g]]) : 0;
            weight++;
        }
        weight++;
    }
    return sum;
}

static wide sum_of_tails(const tables *t, const hg_real (*past)[IN], size_t k, size_t i)
{
    const hg_real *tail = row_of(t, i);
    wide sum = 0;
    for (size_t g = 0U; g < IN; g++) {
        tail = &tail[t->taps[g]];
        sum += (k >= t->taps[g]) ? ((wide)*tail * past[k - t->taps[g]][t->signal[g]]) : 0;
        tail++;
    }
    return sum;
}

/* What leaves the taps, into mode m. */
static wide into_mode(const tables *t, const hg_real (*past)[IN], size_t k, size_t m)
{
    wide sum = 0;
    for (size_t g = 0U; g < IN; g++) {
        sum += (k >= t->taps[g]) ? ((wide)t->mode_input[(m * IN) + g] * past[k - t->taps[g]][t->signal[g]]) : 0;
    }
    return sum;
}

static void a_threshold_is_its_formula_with_one_rounding_a_sum(void **state)
{
    (void)state;
    static tables t;
    static hg_real past[SAMPLES][IN];
    uint32_t random = seed_of_run(64U);
    unsigned largest = 0U;
    for (int run = 0; run < 100; run++) {
        draw_tables(&random, &t);
        const int8_t exponent = (int8_t)draw_between(&random, -6, 2);
        const hg_real most = HG_REAL_MAX >> draw_between(&random, 0, 20);
        const hg_start how = ((run % 2) == 0) ? HG_START_REST : HG_START_MOVING;
        const hg_hull_config config = {.residuals = OUT, .width = IN, .exponent = exponent, .signal = t.signal, .taps = t.taps, .weight = t.laid_out,
            .settle = SETTLE, .rest = t.rest, .rest_left = t.rest_left, .moving = t.moving, .moving_left = t.moving_left, .bias = t.bias,
            .decay = t.decay, .modes = ((run % 4) < 2) ? 0U : MODES, .mode_decay = t.mode_decay, .mode_input = t.mode_input,
            .mode_output = t.mode_output, .mode_rest = t.mode_rest, .mode_moving = t.mode_moving};
        hg_hull self;
        hg_ring ring;
        hg_real memory[IN * LENGTH];
        hg_real theta[OUT + MODES];
        hg_real expected[OUT] = {0};
        hg_real mode[MODES];
        (void)memcpy(mode, (how == HG_START_REST) ? t.mode_rest : t.mode_moving, sizeof(mode));
        assert_status(HG_OK, hg_ring_start(&ring, IN, LENGTH, memory));
        assert_status(HG_OK, hg_hull_start(&self, &config, &ring, how, theta));
        for (size_t k = 0U; k < SAMPLES; k++) {
            hg_real J[OUT];
            draw_positive(&random, past[k], IN, ((draw(&random) % 16U) == 0U) ? HG_REAL_MAX : most);
            assert_status(HG_OK, hg_ring_push(&ring, past[k]));
            hg_hull_step(&self, &ring, J);
            for (size_t m = 0U; m < config.modes; m++) {
                const wide leaving = into_mode(&t, (const hg_real(*)[IN])past, k, m);
                mode[m] = at_most(divided((wide)t.mode_decay[m] * mode[m], 31U) + divided(leaving, (unsigned)(31 - exponent)));
                assert_int_equal(mode[m], theta[OUT + m]);
            }
            for (size_t i = 0U; i < OUT; i++) {
                const wide behind = sum_of_tails(&t, (const hg_real(*)[IN])past, k, i);
                const bool rest = how == HG_START_REST;
                if (k == SETTLE) {
                    expected[i] = at_most((wide)expected[i] + (rest ? t.rest_left : t.moving_left)[i]);
                }
                expected[i] = at_most(divided((wide)t.decay[i] * expected[i], 31U) + divided(behind, (unsigned)(31 - exponent)));
                const hg_real bias = (k < SETTLE) ? (rest ? t.rest : t.moving)[(k * OUT) + i] : t.bias[i];
                wide sum = sum_of_taps(&t, (const hg_real(*)[IN])past, k, i);
                for (size_t m = 0U; m < config.modes; m++) {
                    sum += (wide)t.mode_output[(i * MODES) + m] * mode[m];
                }
                assert_int_equal(at_most((wide)bias + divided(sum, (unsigned)(31 - exponent)) + expected[i]), J[i]);
                assert_int_equal(expected[i], theta[i]);
                largest += (J[i] == HG_REAL_MAX) ? 1U : 0U;
            }
        }
    }
    assert_true(largest > 0U);
}

/* A bad table is one that the float types do not have: an exponent that the sums do not hold. */
static void tables_with_an_exponent_out_of_range_are_refused(void **state)
{
    (void)state;
    static tables t;
    uint32_t random = 1U;
    draw_tables(&random, &t);
    hg_hull_config c = {.residuals = OUT, .width = IN, .signal = t.signal, .taps = t.taps, .weight = t.laid_out, .settle = SETTLE, .rest = t.rest,
        .rest_left = t.rest_left, .moving = t.moving, .moving_left = t.moving_left, .bias = t.bias, .decay = t.decay};
    for (int exponent = INT8_MIN; exponent <= INT8_MAX; exponent++) {
        c.exponent = (int8_t)exponent;
        assert_int_equal((exponent >= -31) && (exponent <= 30), hg_hull_valid(&c, IN, LENGTH));
    }
    c.exponent = 0;
    t.decay[0] = INT32_MAX; /* 1 */
    assert_false(hg_hull_valid(&c, IN, LENGTH));
    t.decay[0] = -1;
    assert_false(hg_hull_valid(&c, IN, LENGTH));
}

/* ---- an unknown-input observer ---- */

/* A signal that did not fit, or a state, says that nothing is known and begins again; an estimate that does not fit has no radius. */
static void an_observer_is_its_generator_and_its_threshold_or_says_nothing(void **state)
{
    (void)state;
    static tables t;
    static hg_real A[ORDER * ORDER], B[ORDER * IN], C[OUT * ORDER], D[OUT * IN];
    uint32_t random = seed_of_run(65U);
    unsigned refused = 0U;
    unsigned unheld = 0U;
    for (int run = 0; run < 40; run++) {
        draw_tables(&random, &t);
        draw_rows(&random, A, ORDER, B, IN, ORDER);
        draw_rows(&random, C, ORDER, D, IN, OUT);
        const hg_residual_config observer = {.order = ORDER, .residuals = OUT, .width = IN, .signal = t.signal,
            .state = {.rows = ORDER, .cols = ORDER, .exponent = 0, .data = A}, .input = {.rows = ORDER, .cols = IN, .exponent = 0, .data = B},
            .output = {.rows = OUT, .cols = ORDER, .exponent = 1, .data = C}, .direct = {.rows = OUT, .cols = IN, .exponent = 1, .data = D}};
        const hg_uio_config config = {.states = OUT, .observer = observer, .hull = {.residuals = OUT, .width = IN, .exponent = -1, .signal = t.signal,
            .taps = t.taps, .weight = t.laid_out, .settle = SETTLE, .rest = t.rest, .rest_left = t.rest_left, .moving = t.moving,
            .moving_left = t.moving_left, .bias = t.bias, .decay = t.decay, .modes = MODES, .mode_decay = t.mode_decay, .mode_input = t.mode_input,
            .mode_output = t.mode_output, .mode_rest = t.mode_rest, .mode_moving = t.mode_moving}};
        hg_uio self;
        hg_residual generator;
        hg_hull hull;
        hg_ring ring;
        hg_real rows[IN * LENGTH];
        hg_real memory[HG_UIO_REALS(ORDER, IN, OUT, MODES)];
        hg_real own[HG_UIO_REALS(ORDER, IN, OUT, MODES)];
        assert_status(HG_OK, hg_ring_start(&ring, IN, LENGTH, rows));
        assert_status(HG_OK, hg_uio_start(&self, &config, &ring, HG_START_MOVING, memory));
        assert_status(HG_OK, hg_residual_start(&generator, &observer, own));
        assert_status(HG_OK, hg_hull_start(&hull, &config.hull, &ring, HG_START_MOVING, &own[HG_RESIDUAL_REALS(ORDER, IN)]));
        for (size_t k = 0U; k < SAMPLES; k++) {
            hg_real value[IN], radius[IN], estimate[OUT], wide_as[OUT], r[OUT], J[OUT];
            for (size_t g = 0U; g < IN; g++) {
                value[g] = ((draw(&random) % 200U) == 0U) ? INT32_MAX : draw_between(&random, -HG_REAL_MAX, HG_REAL_MAX);
            }
            draw_positive(&random, radius, IN, HG_REAL_MAX);
            assert_status(HG_OK, hg_ring_push(&ring, radius));
            const hg_status status = hg_residual_step(&generator, value, r);
            hg_hull_step(&hull, &ring, J);
            assert_status(status, hg_uio_step(&self, value, &ring, estimate, wide_as));
            if (status != HG_OK) {
                refused++;
                hg_residual_reset(&generator);
                hg_hull_reset(&hull, HG_START_MOVING);
            }
            for (size_t i = 0U; i < OUT; i++) {
                const bool known = (status == HG_OK) && hg_real_finite(r[i]);
                unheld += ((status == HG_OK) && !known) ? 1U : 0U;
                assert_int_equal(known ? r[i] : 0, estimate[i]);
                assert_int_equal(known ? J[i] : HG_REAL_MAX, wide_as[i]);
            }
        }
    }
    assert_true((refused > 0U) && (unheld > 0U));
}

/* ---- a hold ---- */

#define INTERVAL 4U
#define MARGIN 2U

static void a_hold_knows_values_and_radii_to_the_step(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(65U);
    const uint8_t silence[] = {1U};
    const uint16_t delta[] = {3000U};
    const int32_t activity[] = {0};
    const int32_t zero[] = {0};
    unsigned promised = 0U;
    for (int run = 0; run < 500; run++) {
        const int32_t sigma[] = {draw_between(&random, 0, 200)};
        const hg_trigger_config trigger = {.width = 1U, .levels = 1U, .interval_max = INTERVAL, .silence = silence, .delta = delta, .sigma = sigma,
                                           .activity = activity, .zero = zero};
        const hg_code_scale scale = scale_of(draw_between(&random, 536870913, HG_REAL_MAX), (int8_t)draw_between(&random, -26, -17),
                                             draw_between(&random, -HG_REAL_MAX / 2, HG_REAL_MAX / 2));
        const hg_real half = draw_between(&random, 0, 1000);
        const hg_real span = HG_REAL_MAX;
        const hg_real middle = draw_between(&random, -1000, 1000);
        hg_real slew[INTERVAL + MARGIN];
        for (size_t j = 0U; j < COUNT(slew); j++) {
            slew[j] = draw_between(&random, 0, 1 << 22) + ((j > 0U) ? slew[j - 1U] : 0);
        }
        const hg_hold_config config = {.trigger = &trigger, .margin = MARGIN, .scale = &scale, .half = &half, .slew = slew, .span = &span, .middle = &middle};
        hg_hold self;
        int32_t codes[HG_HOLD_CODES(1U)];
        hg_real reals[HG_HOLD_REALS(1U)];
        hg_real value;
        hg_real radius;
        uint8_t rewind;
        assert_status(HG_OK, hg_hold_start(&self, &config, codes, reals));
        hg_hold_step(&self, &value, &radius, &rewind);
        assert_int_equal(middle, value);
        assert_int_equal(span, radius);
        const int32_t code = draw_between(&random, -32768, 32767);
        const wide threshold = sigma[0] + (((wide)delta[0] * ((code < 0) ? -(wide)code : (wide)code)) / 65536);
        const hg_real exact = held((wide)scale.offset + divided((wide)scale.resolution * code, (unsigned)-scale.exponent));
        const hg_real silent = held(divided((wide)scale.resolution * threshold, (unsigned)-scale.exponent) + half);
        assert_status(HG_OK, hg_hold_receive(&self, &code, true));
        for (size_t age = 0U; age < (INTERVAL + MARGIN + 2U); age++) {
            hg_hold_step(&self, &value, &radius, &rewind);
            assert_int_equal(exact, value);
            hg_real expected = (age == 0U) ? half : (age <= (INTERVAL + MARGIN)) ? slew[age - 1U] : span;
            if ((age > silence[0]) && (age < INTERVAL) && (silent < expected)) {
                expected = silent;
                promised++;
            }
            assert_int_equal(expected, radius);
        }
    }
    assert_true(promised > 0U);
}

static void scales_with_an_exponent_out_of_range_are_refused(void **state)
{
    (void)state;
    const uint8_t silence[] = {0U};
    const uint16_t delta[] = {0U};
    const int32_t none[] = {0};
    const hg_trigger_config trigger = {.width = 1U, .levels = 1U, .interval_max = 1U, .silence = silence, .delta = delta, .sigma = none,
                                       .activity = none, .zero = none};
    const hg_real one[] = {1};
    const hg_field field = {.start = 0U, .length = 16U, .flags = HG_FIELD_SIGNED};
    const hg_e2e_config e2e = {.profile = HG_E2E_NONE, .stamp = HG_E2E_NO_STAMP, .limits = &hg_e2e_limits_default};
    for (int exponent = INT8_MIN; exponent <= INT8_MAX; exponent++) {
        hg_code_scale scale = scale_of(HG_REAL_C(0.5), (int8_t)exponent, 0);
        scale.minimum = -32767;
        const hg_hold_config config = {.trigger = &trigger, .margin = 0U, .scale = &scale, .half = one, .slew = one, .span = one, .middle = one};
        const hg_message message = {.id = 1U, .length = 8U, .width = 1U, .field = &field, .scale = &scale, .e2e = &e2e};
        const bool valid = (exponent >= -40) && (exponent <= 0);
        hg_hold self;
        int32_t codes[HG_HOLD_CODES(1U)];
        hg_real reals[HG_HOLD_REALS(1U)];
        assert_int_equal(valid ? HG_OK : HG_E_CONFIG, hg_hold_start(&self, &config, codes, reals));
        assert_int_equal(valid, hg_frame_valid(&message));
    }
}

/* At the ends of the range nothing is shifted out of its 64 bits, whatever comes. */
static void codes_at_the_ends_of_the_exponents(void **state)
{
    (void)state;
    const int8_t exponents[] = {-40, -39, -1, 0};
    for (size_t e = 0U; e < COUNT(exponents); e++) {
        for (size_t i = 0U; i < COUNT(edges); i++) {
            for (size_t j = 0U; j < COUNT(edges); j++) {
                const wide value = divided((wide)edges[i] * edges[j], (unsigned)-exponents[e]);
                assert_int_equal(held(value), hg_real_of_code(edges[i], exponents[e], edges[j]));
                const wide code = divided((wide)edges[i] * edges[j], (unsigned)(60 + exponents[e]));
                const bool known = (edges[i] >= -HG_REAL_MAX) && (edges[i] <= HG_REAL_MAX) && (code > -(wide)INT32_MAX) && (code < INT32_MAX);
                assert_int_equal(known ? (int32_t)code : INT32_MIN, hg_real_to_code(edges[i], edges[j], exponents[e]));
            }
        }
    }
}

/* A reader of a freeze frame learns from its first word what its numbers are. */
static void a_freeze_frame_says_that_its_numbers_are_fixed_point(void **state)
{
    (void)state;
    const hg_detector_config config = {.width = 1U, .residuals = 1U};
    const hg_detector detector = {.config = &config};
    const hg_freeze_config recorded = {.samples = 2U};
    const hg_freeze self = {.config = &recorded, .detector = &detector, .held = 2U};
    assert_int_equal(3U, (hg_freeze_word(&self, 0U) >> 8U) & 0xFFU);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(primitives_are_exact_or_nearest_at_every_edge),
        cmocka_unit_test(primitives_are_exact_or_nearest_anywhere),
        cmocka_unit_test(ties_go_away_from_zero),
        cmocka_unit_test(constants_and_exponents_have_their_range),
        cmocka_unit_test(sums_of_whole_tables_never_overflow),
        cmocka_unit_test(every_16_bit_code_survives_the_round_trip),
        cmocka_unit_test(what_did_not_fit_has_no_code),
        cmocka_unit_test(a_float_field_is_refused),
        cmocka_unit_test(a_generator_is_its_equations_with_one_rounding_a_sum),
        cmocka_unit_test(a_threshold_is_its_formula_with_one_rounding_a_sum),
        cmocka_unit_test(tables_with_an_exponent_out_of_range_are_refused),
        cmocka_unit_test(an_observer_is_its_generator_and_its_threshold_or_says_nothing),
        cmocka_unit_test(a_hold_knows_values_and_radii_to_the_step),
        cmocka_unit_test(scales_with_an_exponent_out_of_range_are_refused),
        cmocka_unit_test(codes_at_the_ends_of_the_exponents),
        cmocka_unit_test(a_freeze_frame_says_that_its_numbers_are_fixed_point),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
