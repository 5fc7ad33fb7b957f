/** @file
 *  zonotope.h: the threshold by a set of fixed size. Numbers are any, NaN and infinity among them; sizes are those of a run. */
#include "proof.h"

#include "hullguard/zonotope.h"

#define FRESH (WIDTH + DISTURBANCES)
#define ROWS (COLUMNS + FRESH)

/** The set never holds more columns than its memory, whichever reduction, and reads and writes that alone; J is never NaN and never infinite, whatever the radii are and whatever is
 *  rewritten of the past.
 *  ORDER rows, RESIDUALS residuals, WIDTH signals out of SIGNALS, DISTURBANCES disturbances, COLUMNS columns; any tables that hg_zonotope_valid() accepts, any set, any radii.
 *  @proves hg_zonotope_start hg_zonotope_valid hg_zonotope_reset hg_zonotope_step hg_zonotope_widen hg_zonotope_ready
 *  @run deep real=f32 unwind=6 limit=3600 ORDER=1U RESIDUALS=1U WIDTH=1U SIGNALS=1U DISTURBANCES=1U COLUMNS=1U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=3600 ORDER=2U RESIDUALS=1U WIDTH=1U SIGNALS=1U DISTURBANCES=1U COLUMNS=2U ANY_NUMBERS
 *  @run deep real=f32 unwind=20 limit=7200 ORDER=3U RESIDUALS=2U WIDTH=2U SIGNALS=2U DISTURBANCES=1U COLUMNS=4U */
void proof_zonotope_step(void)
{
    uint8_t signal[WIDTH];
    uint8_t block[ORDER];
    hg_real decay[ORDER];
    hg_real state[ORDER * ORDER];
    hg_real input[WIDTH * ORDER];
    hg_real disturbance[DISTURBANCES * ORDER];
    hg_real rest[ROWS * ORDER];
    hg_real moving[ROWS * ORDER];
    hg_real output[RESIDUALS * ORDER];
    hg_real outer[RESIDUALS * ORDER];
    hg_real direct[RESIDUALS * WIDTH];
    hg_real bias_rest[RESIDUALS];
    hg_real bias_moving[RESIDUALS];
    hg_real always[ORDER];
    hg_real growth[ORDER];
    hg_real output_growth[RESIDUALS];
    hg_real memory[HG_ZONOTOPE_REALS(ORDER, COLUMNS, FRESH)];
    hg_real data[SIGNALS];
    hg_real J[RESIDUALS];
    hg_real increase[SIGNALS];
    const uint8_t blocks = any_u8_in(1U, ORDER);
    const uint8_t initial = any_u8_in(0U, ROWS);
    const hg_zonotope_config config = {.order = ORDER, .residuals = RESIDUALS, .width = WIDTH, .disturbances = DISTURBANCES, .initial = initial, .columns = COLUMNS, .blocks = blocks,
                                       .reduction = (hg_reduction)any_u8(), .signal = signal, .block = TAIL(block, blocks), .state = state, .input = input,
                                       .disturbance = disturbance, .rest = TAIL(rest, initial * ORDER), .moving = TAIL(moving, initial * ORDER), .output = output, .outer = outer,
                                       .direct = direct, .settle = 1U, .bias_rest = bias_rest, .bias_moving = bias_moving, .decay = TAIL(decay, blocks), .always = always,
                                       .growth = growth, .output_growth = output_growth, .recover = any_u16(), .ready_rest = any_u16(), .ready_moving = any_u16()};
    const hg_ring ring = {.data = data, .width = SIGNALS, .length = 1U, .newest = 0U};
    const hg_start how = any_bool() ? HG_START_REST : HG_START_MOVING;
    hg_zonotope self;
    const hg_status started = hg_zonotope_start(&self, &config, &ring, how, memory);
    prove((started == HG_OK) == hg_zonotope_valid(&config, SIGNALS), "what is valid starts");
    prove((hg_zonotope_start(NULL, &config, &ring, how, memory) == HG_E_ARGUMENT) && (hg_zonotope_start(&self, NULL, &ring, how, memory) == HG_E_ARGUMENT) &&
              (hg_zonotope_start(&self, &config, NULL, how, memory) == HG_E_ARGUMENT) && (hg_zonotope_start(&self, &config, &ring, how, NULL) == HG_E_ARGUMENT),
          "null pointers");
    assume(started == HG_OK);
    /* Memory of its own for each part. */
    hg_real column[ROWS * ORDER];
    hg_real score[ROWS];
    hg_real spread[ORDER];
    hg_real scratch[ORDER];
    self.column = column;
    self.score = score;
    self.spread = spread;
    self.scratch = scratch;
    hg_zonotope_reset(&self, how);
    prove(self.count <= ROWS, "columns that there is room for");
    self.count = any_u8_in(0U, COLUMNS);
    self.k = any_u16();
    hg_zonotope_widen(&self, any_u8_in(0U, 1U), 0U, SIGNALS, increase);
    prove(self.count <= COLUMNS, "reduced");
    hg_zonotope_step(&self, &ring, J);
    prove(self.count <= COLUMNS, "reduced again");
    const uint8_t i = any_u8_in(0U, RESIDUALS - 1U);
    prove(J[i] <= HG_REAL_MAX, "finite from above, and no NaN");
    (void)hg_zonotope_ready(&self);
    reach("end");
}
