/** @file
 *  hull.h, bank.h, uio.h: thresholds and estimates. Numbers are any, NaN and infinity among them; sizes are those of a run. */
#include "contract.h"

#include "hullguard/bank.h"
#include "hullguard/uio.h"

/* Tables of a hull of RESIDUALS residuals, WIDTH signals and MODES modes over a ring of LENGTH rows of SIGNALS signals. */
typedef struct {
    uint8_t signal[WIDTH];
    uint8_t taps[WIDTH];
    hg_real weight[RESIDUALS * WIDTH * (LENGTH + 1U)];
    hg_real rest[SETTLE * RESIDUALS];
    hg_real rest_left[RESIDUALS];
    hg_real moving[SETTLE * RESIDUALS];
    hg_real moving_left[RESIDUALS];
    hg_real bias[RESIDUALS];
    hg_real decay[RESIDUALS];
    hg_real mode_decay[MODES];
    hg_real mode_input[MODES * WIDTH];
    hg_real mode_output[RESIDUALS * MODES];
    hg_real mode_rest[MODES];
    hg_real mode_moving[MODES];
} hull_tables;

static hg_hull_config hull_config(const hull_tables *t)
{
    size_t weights = 0U;
    for (uint8_t g = 0U; g < WIDTH; g++) {
        assume(t->taps[g] <= LENGTH);
        weights += ((size_t)t->taps[g] + 1U) * RESIDUALS;
    }
    return (hg_hull_config){.residuals = RESIDUALS, .width = WIDTH, .exponent = 0, .signal = t->signal, .taps = t->taps, .weight = TAIL(t->weight, weights),
                            .settle = SETTLE, .rest = t->rest, .rest_left = t->rest_left, .moving = t->moving, .moving_left = t->moving_left, .bias = t->bias,
                            .ready_rest = any_u16(), .ready_moving = any_u16(), .decay = t->decay, .modes = MODES, .mode_decay = t->mode_decay,
                            .mode_input = t->mode_input, .mode_output = t->mode_output, .mode_rest = t->mode_rest, .mode_moving = t->mode_moving};
}

/** A threshold reads exactly its weights and the ring's rows, wherever the newest stands and whatever taps its signals have; J and what lies behind the taps are never NaN and never
 *  infinite, whatever the radii are.
 *  RESIDUALS residuals, WIDTH signals out of SIGNALS, MODES modes, a ring of LENGTH rows, SETTLE rows of bias; any tables that hg_hull_valid() accepts, any radii, any sample.
 *  @proves hg_hull_start hg_hull_valid hg_hull_reset hg_hull_step hg_hull_ready
 *  @run check real=f32 unwind=8 limit=150 RESIDUALS=3U WIDTH=1U SIGNALS=1U MODES=1U LENGTH=3U SETTLE=2U ANY_NUMBERS
 *  @run deep real=f32 unwind=13 limit=3600 RESIDUALS=3U WIDTH=2U SIGNALS=2U MODES=2U LENGTH=4U SETTLE=2U */
void proof_hull_step(void)
{
    hull_tables t;
    hg_real data[LENGTH * SIGNALS];
    hg_real memory[HG_HULL_REALS(RESIDUALS, MODES)];
    hg_real theta[RESIDUALS];
    hg_real mode[MODES];
    hg_real J[RESIDUALS];
    const hg_hull_config config = hull_config(&t);
    const hg_ring ring = {.data = data, .width = SIGNALS, .length = LENGTH, .newest = any_u8_in(0U, LENGTH - 1U)};
    const hg_start how = any_bool() ? HG_START_REST : HG_START_MOVING;
    hg_hull self;
    const hg_status status = hg_hull_start(&self, &config, &ring, how, memory);
    prove((status == HG_OK) == hg_hull_valid(&config, SIGNALS, LENGTH), "what is valid starts");
    prove((hg_hull_start(NULL, &config, &ring, how, memory) == HG_E_ARGUMENT) && (hg_hull_start(&self, NULL, &ring, how, memory) == HG_E_ARGUMENT) &&
              (hg_hull_start(&self, &config, NULL, how, memory) == HG_E_ARGUMENT) && (hg_hull_start(&self, &config, &ring, how, NULL) == HG_E_ARGUMENT),
          "null pointers");
    assume(status == HG_OK);
    prove((self.theta == memory) && (self.mode == &memory[RESIDUALS]), "its parts, one after another");
    self.theta = theta;
    self.mode = mode;
    hg_hull before = self;
    assume(requires_hull_reset(&self));
    hg_hull_reset(&self, how);
    prove(ensures_hull_reset(&self, &before), "begun again");
    self.k = any_u16();
    prove(hg_hull_ready(&self) == (self.k >= ((how == HG_START_REST) ? config.ready_rest : config.ready_moving)), "ready when it says");
    before = self;
    assume(requires_hull_step(&self, &ring, J));
    hg_hull_step(&self, &ring, J);
    const uint8_t i = any_u8_in(0U, RESIDUALS - 1U);
    prove((J[i] <= HG_REAL_MAX) && (theta[i] <= HG_REAL_MAX), "finite from above, and no NaN");
    prove(ensures_hull_step(&self, &before), "one sample on");
    reach("end");
}

/** A bank's certificates read exactly their tables and the rings' windows; what is not finite is refused with a residual of 0, and the closest certificate is one that there is.
 *  CERTIFICATES certificates, WIDTH signals and EXTRAS extras out of SIGNALS, a window of LENGTH samples; any tables that hg_bank_valid() accepts, any values and radii.
 *  @proves hg_bank_start hg_bank_valid hg_bank_reset hg_bank_step hg_bank_ready
 *  @run check real=f32 unwind=8 limit=150 CERTIFICATES=2U WIDTH=1U EXTRAS=1U SIGNALS=2U LENGTH=2U ANY_NUMBERS
 *  @run deep real=f32 unwind=13 limit=3600 CERTIFICATES=3U WIDTH=2U EXTRAS=1U SIGNALS=3U LENGTH=3U */
void proof_bank_step(void)
{
    uint8_t signal[WIDTH];
    uint8_t extra[EXTRAS];
    hg_real weight[LENGTH * WIDTH * CERTIFICATES];
    hg_real extra_weight[LENGTH * EXTRAS * CERTIFICATES];
    hg_real bias[CERTIFICATES];
    hg_real values[LENGTH * SIGNALS];
    hg_real radii[(LENGTH + 1U) * SIGNALS];
    hg_acc sums[HG_BANK_SUMS(CERTIFICATES)];
    hg_real widen;
    hg_bank_config config = {.certificates = CERTIFICATES, .window = any_u8(), .width = WIDTH, .signal = signal, .exponent = any_i8(), .weight = weight, .extras = EXTRAS, .extra = extra,
                             .extra_weight = extra_weight, .bias = bias, .widen = widen};
    const hg_ring value = {.data = values, .width = SIGNALS, .length = LENGTH, .newest = any_u8_in(0U, LENGTH - 1U)};
    const hg_ring radius = {.data = radii, .width = SIGNALS, .length = LENGTH + 1U, .newest = any_u8_in(0U, LENGTH)};
    hg_bank self;
    assume(hg_bank_valid(&config, SIGNALS, SIGNALS, LENGTH));
    prove((config.window >= 1U) && (config.window <= LENGTH) && (signal[0] < SIGNALS) && (extra[0] < SIGNALS), "sizes and places in range");
    prove(hg_bank_start(&self, &config, sums) == HG_OK, "it starts");
    prove((hg_bank_start(NULL, &config, sums) == HG_E_ARGUMENT) && (hg_bank_start(&self, NULL, sums) == HG_E_ARGUMENT) && (hg_bank_start(&self, &config, NULL) == HG_E_ARGUMENT),
          "null pointers");
    hg_bank before = self;
    assume(requires_bank_reset(&self));
    hg_bank_reset(&self);
    prove(ensures_bank_reset(&self, &before), "an empty window");
    self.k = any_u8();
    self.closest = 0U;
    hg_real r;
    hg_real J;
    before = self;
    assume(requires_bank_step(&self, &value, &radius, &r, &J));
    const hg_status status = hg_bank_step(&self, &value, &radius, &r, &J);
    prove(ensures_bank_step(&self, &before, status), "no other status");
    prove((status == HG_E_EMPTY) == (!hg_bank_ready(&self)), "empty until the window is full");
    prove((status != HG_OK) || (hg_real_finite(r) && hg_real_finite(J)), "what is judged is finite");
    prove((status == HG_OK) || ((r <= HG_REAL_ZERO) && (r >= HG_REAL_ZERO)), "else no residual");
    if (status == HG_OK) {
        reach("judged");
    }
}

/** An observer's estimates and radii are finite, whatever the signals are: what is not finite is an estimate of 0 with a radius of HG_REAL_MAX, and the observer begins again; its
 *  memory is that of its two parts, one after another.
 *  RESIDUALS estimates, ORDER states, WIDTH signals out of SIGNALS, a ring of LENGTH rows; any tables that hg_uio_valid() accepts, any signals and radii.
 *  @proves hg_uio_start hg_uio_valid hg_uio_reset hg_uio_step hg_uio_follow hg_uio_ready
 *  @run check real=f32 unwind=8 limit=150 RESIDUALS=2U WIDTH=1U SIGNALS=1U MODES=1U LENGTH=2U SETTLE=1U ORDER=1U ANY_NUMBERS
 *  @run deep real=f32 unwind=13 limit=3600 RESIDUALS=3U WIDTH=2U SIGNALS=2U MODES=1U LENGTH=3U SETTLE=2U ORDER=2U */
void proof_uio_step(void)
{
    hull_tables t;
    hg_real A[ORDER * ORDER];
    hg_real B[ORDER * WIDTH];
    hg_real C[RESIDUALS * ORDER];
    hg_real D[RESIDUALS * WIDTH];
    uint8_t signal[WIDTH];
    hg_real data[LENGTH * SIGNALS];
    hg_real memory[HG_UIO_REALS(ORDER, WIDTH, RESIDUALS, MODES)];
    hg_real value[SIGNALS];
    hg_real estimate[RESIDUALS];
    hg_real radius[RESIDUALS];
    const hg_uio_config config = {.actuators = any_u8(), .sensors = any_u8(), .unknown = any_u8(), .states = any_u8(), .hull = hull_config(&t),
                                  .observer = {.order = ORDER, .residuals = RESIDUALS, .width = WIDTH, .signal = signal,
                                               .state = {.rows = ORDER, .cols = ORDER, .data = A}, .input = {.rows = ORDER, .cols = WIDTH, .data = B},
                                               .output = {.rows = RESIDUALS, .cols = ORDER, .data = C}, .direct = {.rows = RESIDUALS, .cols = WIDTH, .data = D}}};
    hg_detector detector = {.value = value, .radii = {.data = data, .width = SIGNALS, .length = LENGTH, .newest = any_u8_in(0U, LENGTH - 1U)}, .beginnings = any_u32()};
    const hg_ring *ring = &detector.radii;
    hg_uio self;
    const hg_status started = hg_uio_start(&self, &config, ring, HG_START_REST, memory);
    prove((started == HG_OK) == hg_uio_valid(&config, SIGNALS, LENGTH), "what is valid starts");
    prove((hg_uio_start(NULL, &config, ring, HG_START_REST, memory) == HG_E_ARGUMENT) && (hg_uio_start(&self, NULL, ring, HG_START_REST, memory) == HG_E_ARGUMENT) &&
              (hg_uio_start(&self, &config, NULL, HG_START_REST, memory) == HG_E_ARGUMENT) && (hg_uio_start(&self, &config, ring, HG_START_REST, NULL) == HG_E_ARGUMENT),
          "null pointers");
    assume(started == HG_OK);
    prove((config.actuators + config.sensors + config.unknown + config.states) == RESIDUALS, "as many estimates");
    prove((self.observer.z == memory) && (self.hull.theta == &memory[HG_RESIDUAL_REALS(ORDER, WIDTH)]), "its parts, one after another");
    const hg_status status = any_bool() ? hg_uio_step(&self, value, ring, estimate, radius) : hg_uio_follow(&self, &detector, estimate, radius);
    prove((status == HG_OK) || (status == HG_E_NUMERIC), "no other status");
    const uint8_t i = any_u8_in(0U, RESIDUALS - 1U);
    prove(hg_real_finite(estimate[i]) && (radius[i] <= HG_REAL_MAX), "finite");
    prove((status == HG_OK) || (radius[i] >= HG_REAL_MAX), "nothing is known where it was refused");
    prove((status == HG_OK) || (self.hull.k == 0U), "and it begins again");
    (void)hg_uio_ready(&self);
    hg_uio_reset(&self, HG_START_REST);
    prove(self.hull.k == 0U, "begun again");
    if (status == HG_OK) {
        reach("a sample");
    }
}
