/** @file
 *  linalg.h, residual.h, mismatch.h, predict.h: linear systems. Numbers are any, NaN and infinity among them; sizes are those of a run. */
#include "contract.h"

#include "hullguard/linalg.h"
#include "hullguard/mismatch.h"
#include "hullguard/predict.h"
#include "hullguard/residual.h"

static hg_matrix matrix(const hg_real *data, uint8_t rows, uint8_t cols)
{
    return (hg_matrix){.rows = rows, .cols = cols, .exponent = 0, .data = data};
}

/* Is a table within what fixed point asks of it: magnitudes that add up to less than 2^31 a row? */
static bool summable(const hg_real *table, uint8_t rows, uint8_t cols)
{
#if HG_REAL_Q31
    bool small = true;
    for (uint8_t i = 0U; i < rows; i++) {
        int64_t sum = 0;
        for (uint8_t j = 0U; j < cols; j++) {
            const int64_t entry = table[(i * cols) + j];
            sum += (entry < 0) ? -entry : entry;
        }
        small = small && (sum < ((int64_t)1 << 30));
    }
    return small;
#else
    (void)table;
    (void)rows;
    (void)cols;
    return true;
#endif
}

/** out = m x + n y reads and writes exactly rows and columns; matrices fit only with tables, equal exponents and these sizes; in fixed point no sum overflows that the
 *  design's bound allows.
 *  ORDER rows, ORDER and WIDTH columns; any numbers, of fixed-point tables magnitudes that add up to less than 2^31 a row.
 *  @proves hg_linalg_apply hg_linalg_fits hg_linalg_rows hg_linalg_add_four hg_linalg_add_two hg_linalg_add_one hg_linalg_no_sums hg_linalg_finite hg_linalg_in_order
 *  @run check real=f32 unwind=10 limit=150 ORDER=7U WIDTH=3U ANY_NUMBERS
 *  @run check real=q31 unwind=10 limit=150 ORDER=2U
 *  @run deep real=q31 unwind=10 limit=1800 ORDER=5U WIDTH=3U */
void proof_linalg_apply(void)
{
    hg_real a[ORDER * ORDER];
    hg_real b[ORDER * WIDTH];
    hg_real x[ORDER];
    hg_real y[WIDTH];
    hg_real out[ORDER];
    hg_real again[ORDER];
    uint8_t place[WIDTH];
    hg_matrix m = matrix(a, ORDER, ORDER);
    hg_matrix n = matrix(b, ORDER, WIDTH);
    assume(summable(a, ORDER, ORDER) && summable(b, ORDER, WIDTH));
    prove(hg_linalg_fits(&m, &n, ORDER, ORDER, WIDTH), "they fit");
    hg_linalg_apply(&m, x, &n, y, out);
    hg_linalg_rows(&m, x, &n, y, again, ORDER, ORDER, WIDTH);
    hg_linalg_sums sum = hg_linalg_no_sums();
    hg_linalg_add_two(&sum, a, x, (ORDER * ORDER) / 2U <= ORDER ? (ORDER * ORDER) / 2U : ORDER);
#if ORDER >= 4U
    hg_linalg_add_four(&sum, a, x, ORDER);
#endif
    (void)hg_linalg_add_one(sum.c, a, x, ORDER);
    const uint8_t i = any_u8_in(0U, ORDER - 1U);
    prove((!hg_linalg_finite(x, ORDER)) || hg_real_finite(x[i]), "finite: every one");
    const uint8_t j = any_u8_in(0U, WIDTH - 1U);
    prove((!hg_linalg_in_order(place, WIDTH)) || (place[j] == j), "in order: every one");
    m.data = NULL;
    prove(!hg_linalg_fits(&m, &n, ORDER, ORDER, WIDTH), "no table");
    m.data = a;
    m.rows = any_u8();
    n.cols = any_u8();
    m.exponent = any_i8();
    prove((!hg_linalg_fits(&m, &n, ORDER, ORDER, WIDTH)) || ((m.rows == ORDER) && (n.cols == WIDTH) && (m.exponent == 0)), "only these sizes");
    reach("end");
}

#if !HG_REAL_Q31
/** The square root ends after a fixed number of steps for any number, NaN and infinity too.
 *  @proves hg_linalg_root
 *  @run check real=f32 unwind=76 limit=150 */
void proof_linalg_root(void)
{
    hg_real x;
    const hg_real y = hg_linalg_root(x);
    prove(ensures_linalg_root(y), "an answer");
    reach("end");
}
#endif

/** A residual generator slices its memory into parts that do not overlap and fill it, reads and writes only these, and keeps its state when a number is not finite: what
 *  is not finite never enters z.
 *  ORDER states, RESIDUALS residuals, WIDTH signals out of SIGNALS; any tables and numbers; two samples.
 *  @proves hg_residual_start hg_residual_valid hg_residual_step hg_residual_reset
 *  @run check real=f32 unwind=9 limit=150 ORDER=5U WIDTH=2U RESIDUALS=3U SIGNALS=3U ANY_NUMBERS
 *  @run check real=f32 unwind=9 limit=150 ANY_NUMBERS
 *  @run check real=q31 unwind=9 limit=150 ORDER=2U SIGNALS=2U */
void proof_residual_step(void)
{
    hg_real A[ORDER * ORDER];
    hg_real B[ORDER * WIDTH];
    hg_real C[RESIDUALS * ORDER];
    hg_real D[RESIDUALS * WIDTH];
    uint8_t signal[WIDTH];
    hg_real memory[HG_RESIDUAL_REALS(ORDER, WIDTH)];
    hg_residual self;
    hg_residual_config config = {.order = ORDER, .residuals = RESIDUALS, .width = WIDTH, .signal = signal,
                                 .state = matrix(A, ORDER, ORDER), .input = matrix(B, ORDER, WIDTH), .output = matrix(C, RESIDUALS, ORDER), .direct = matrix(D, RESIDUALS, WIDTH)};
    for (uint8_t g = 0U; g < WIDTH; g++) {
        signal[g] = any_u8_in(0U, SIGNALS - 1U);
    }
    assume(summable(A, ORDER, ORDER) && summable(B, ORDER, WIDTH) && summable(C, RESIDUALS, ORDER) && summable(D, RESIDUALS, WIDTH));
    prove(hg_residual_start(&self, &config, memory) == HG_OK, "it starts");
    prove((hg_residual_start(NULL, &config, memory) == HG_E_ARGUMENT) && (hg_residual_start(&self, NULL, memory) == HG_E_ARGUMENT) &&
              (hg_residual_start(&self, &config, NULL) == HG_E_ARGUMENT),
          "null pointers");
    prove((self.z == memory) && (self.next == &memory[ORDER]) && (self.input == &memory[2U * ORDER]), "its parts, one after another");
    hg_real z[ORDER];
    hg_real next[ORDER];
    hg_real input[WIDTH];
    self.z = z;
    self.next = next;
    self.input = input;
    assume(requires_residual_reset(&self));
    hg_residual_reset(&self);
    hg_real value[SIGNALS];
    hg_real r[RESIDUALS];
    const hg_residual before = self;
    assume(requires_residual_step(&self, value, r));
    const hg_status status = hg_residual_step(&self, value, r);
    prove(ensures_residual_step(&self, &before, status), "no other status, and its parts where they were");
    prove(hg_linalg_finite(self.z, ORDER) || (HG_REAL_Q31 != 0), "the state stays finite");
    prove((self.z == z) == (status != HG_OK), "it moves on, or nothing changes");
    (void)hg_residual_step(&self, value, r);
    if (status == HG_OK) {
        reach("a sample");
    }
    config.width = any_u8();
    config.order = any_u8();
    config.residuals = any_u8();
    config.signal = any_bool() ? signal : NULL;
    prove((!hg_residual_valid(&config)) || ((config.width == WIDTH) && (config.order == ORDER) && (config.residuals == RESIDUALS) && (config.signal != NULL)), "the matrices' sizes");
}

#if !HG_REAL_Q31
/** Observer and filter in series: the filter reads what the observer says (RESIDUALS and SIGNALS are equal), and neither moves when the observer refuses.
 *  ORDER states and RESIDUALS residuals each; any tables and numbers.
 *  @proves hg_residual_pair_step
 *  @run check real=f32 unwind=9 limit=150 ORDER=2U WIDTH=2U RESIDUALS=2U SIGNALS=2U ANY_NUMBERS */
void proof_residual_pair(void)
{
    hg_real A[ORDER * ORDER];
    hg_real B[ORDER * WIDTH];
    hg_real C[RESIDUALS * ORDER];
    hg_real D[RESIDUALS * WIDTH];
    uint8_t signal[WIDTH];
    for (uint8_t g = 0U; g < WIDTH; g++) {
        signal[g] = any_u8_in(0U, SIGNALS - 1U);
    }
    hg_real memory[HG_RESIDUAL_REALS(ORDER, WIDTH)];
    hg_real more[HG_RESIDUAL_REALS(ORDER, WIDTH)];
    const hg_residual_config config = {.order = ORDER, .residuals = RESIDUALS, .width = WIDTH, .signal = signal,
                                       .state = matrix(A, ORDER, ORDER), .input = matrix(B, ORDER, WIDTH), .output = matrix(C, RESIDUALS, ORDER), .direct = matrix(D, RESIDUALS, WIDTH)};
    hg_residual_pair self;
    (void)hg_residual_start(&self.observer, &config, memory);
    (void)hg_residual_start(&self.filter, &config, more);
    hg_real value[SIGNALS];
    hg_real r0[RESIDUALS];
    hg_real r[RESIDUALS];
    const hg_status status = hg_residual_pair_step(&self, value, r0, r);
    prove((status == HG_OK) || (status == HG_E_NUMERIC), "no other status");
    prove((status != HG_OK) || ((self.observer.z != memory) && (self.filter.z != more)), "both have moved on");
    if (status == HG_OK) {
        reach("both");
    }
}
#endif

/** What an uncertain plant may do has a radius that is finite and never NaN, whatever the signals are; tables are valid only when they are there and name signals that there are.
 *  Up to RESIDUALS states and WIDTH signals out of SIGNALS; any tables, constants >= 0, and any numbers.
 *  @proves hg_mismatch_valid hg_mismatch_step hg_mismatch_grow
 *  @run check real=f32 unwind=5 limit=150 WIDTH=2U RESIDUALS=2U SIGNALS=2U ANY_NUMBERS */
void proof_mismatch(void)
{
    uint8_t signal[WIDTH];
    hg_real constant[RESIDUALS];
    hg_real gain[RESIDUALS * WIDTH];
    hg_real value[SIGNALS];
    hg_real radius[SIGNALS];
    hg_real out[RESIDUALS];
    const uint8_t states = any_u8_in(0U, RESIDUALS);
    const uint8_t width = any_u8_in(0U, WIDTH);
    const hg_mismatch_config config = {.states = states, .width = width, .exponent = any_i8(), .signal = any_bool() ? TAIL(signal, width) : NULL,
                                       .constant = any_bool() ? TAIL(constant, states) : NULL, .gain = any_bool() ? TAIL(gain, (size_t)states * width) : NULL};
    if (hg_mismatch_valid(&config, SIGNALS)) {
        assume(requires_mismatch_step(&config, value, radius, TAIL(out, states)) && requires_mismatch_grow(&config, value, TAIL(out, states)));
        hg_mismatch_step(&config, value, radius, TAIL(out, states));
        if (states > 0U) {
            prove(TAIL(out, states)[any_u8_in(0U, (uint8_t)(states - 1U))] <= HG_REAL_MAX, "finite from above, and no NaN");
            reach("a radius");
        }
        hg_mismatch_grow(&config, value, TAIL(out, states));
    } else {
        reach("refused");
    }
}

/** A prediction is never wider than what the hold says, and there is one only after it has settled, within its horizon; the parts of its memory fill it and do not overlap.
 *  ORDER states, RESIDUALS signals of the group, WIDTH inputs out of SIGNALS signals, HORIZON samples; any tables and numbers; one sample after any state.
 *  @proves hg_predict_valid hg_predict_start hg_predict_reset hg_predict_step
 *  @run check real=f32 unwind=7 limit=150 ORDER=2U WIDTH=2U SIGNALS=3U HORIZON=2U ANY_NUMBERS
 *  @run deep real=f32 unwind=7 limit=1800 ORDER=5U WIDTH=2U RESIDUALS=3U SIGNALS=5U HORIZON=4U ANY_NUMBERS */

void proof_predict(void)
{
    hg_real correct[ORDER * RESIDUALS];
    hg_real A[ORDER * ORDER];
    hg_real B[ORDER * WIDTH];
    hg_real C[RESIDUALS * ORDER];
    hg_real D[RESIDUALS * WIDTH];
    uint8_t input[WIDTH];
    hg_real known[WIDTH];
    hg_real fresh[RESIDUALS];
    hg_real table[HORIZON * RESIDUALS];
    hg_real memory[HG_PREDICT_REALS(ORDER, WIDTH, RESIDUALS)];
    hg_predict_config config = {.group = any_u8(), .first = any_u8(), .order = ORDER, .width = RESIDUALS, .inputs = WIDTH, .input = input, .known = known,
                                .correct = matrix(correct, ORDER, RESIDUALS), .state = matrix(A, ORDER, ORDER), .drive = matrix(B, ORDER, WIDTH),
                                .output = matrix(C, RESIDUALS, ORDER), .direct = matrix(D, RESIDUALS, WIDTH), .fresh = fresh, .horizon = HORIZON, .radius = table,
                                .settle = any_u16()};
    hg_predict self;
    const bool valid = hg_predict_valid(&config, SIGNALS);
    prove((!valid) || ((config.first + RESIDUALS) <= SIGNALS), "places that there are");
    assume(valid);
    prove(hg_predict_start(&self, &config, memory) == HG_OK, "it starts");
    prove((hg_predict_start(NULL, &config, memory) == HG_E_ARGUMENT) && (hg_predict_start(&self, NULL, memory) == HG_E_ARGUMENT) &&
              (hg_predict_start(&self, &config, NULL) == HG_E_ARGUMENT),
          "null pointers");
    prove((self.x == memory) && (self.next == &memory[ORDER]) && (self.u == &memory[2U * ORDER]) && (self.y == &memory[(2U * ORDER) + WIDTH]), "its parts, one after another");
    hg_real x[ORDER];
    hg_real next[ORDER];
    hg_real u[WIDTH];
    hg_real y[RESIDUALS];
    self.x = x;
    self.next = next;
    self.u = u;
    self.y = y;
    hg_predict before = self;
    assume(requires_predict_reset(&self));
    hg_predict_reset(&self);
    prove(ensures_predict_reset(&self, &before), "nothing predicted yet");
    self.k = any_u16();
    self.sure = any_bool();
    hg_real value[SIGNALS];
    hg_real radius[SIGNALS];
    hg_real out_value[RESIDUALS];
    hg_real out_radius[RESIDUALS];
    const uint8_t age = any_u8();
    before = self;
    assume(requires_predict_step(&self, value, radius, out_value, out_radius));
    hg_predict_step(&self, age, value, radius, out_value, out_radius);
    prove(ensures_predict_step(&self, &before), "its parts where they were");
    const uint8_t g = any_u8_in(0U, RESIDUALS - 1U);
    const hg_real held = radius[config.first + g];
    prove((!hg_real_finite(held)) || (out_radius[g] <= held), "never wider");
    prove((age <= HORIZON) || (!hg_real_finite(held)) || (out_radius[g] >= held), "the held one beyond the horizon");
    if (hg_real_finite(held) && (out_radius[g] < held)) {
        reach("a tighter one");
    }
}
