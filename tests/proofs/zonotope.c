/** @file
 *  zonotope.h: the threshold by a set of fixed size. Numbers are any, NaN and infinity among them; sizes are those of a run. */
#include "stubs.h"

#define FRESH (WIDTH + DISTURBANCES)
#define ROWS (COLUMNS + FRESH) /* columns before a reduction */

/* Tables of any content. */
static hg_zonotope_config any_config(void)
{
    uint8_t *block = any_array(uint8_t, 1U);
    *block = ORDER;
    return (hg_zonotope_config){
        .order = ORDER, .residuals = RESIDUALS, .width = WIDTH, .disturbances = DISTURBANCES, .initial = ROWS, .columns = COLUMNS, .blocks = 1U, .reduction = REDUCTION,
        .signal = any_array(uint8_t, WIDTH), .block = block, .state = any_array(hg_real, ORDER * ORDER), .input = any_array(hg_real, WIDTH * ORDER),
        .disturbance = any_array(hg_real, DISTURBANCES * ORDER), .rest = any_array(hg_real, ROWS * ORDER), .moving = any_array(hg_real, ROWS * ORDER),
        .output = any_array(hg_real, RESIDUALS * ORDER), .outer = any_array(hg_real, RESIDUALS * ORDER), .direct = any_array(hg_real, RESIDUALS * WIDTH), .settle = 1U,
        .bias_rest = any_array(hg_real, RESIDUALS), .bias_moving = any_array(hg_real, RESIDUALS), .decay = any_array(hg_real, 1U), .always = any_array(hg_real, ORDER),
        .growth = any_array(hg_real, ORDER), .output_growth = any_array(hg_real, RESIDUALS), .recover = any_u16(), .ready_rest = any_u16(), .ready_moving = any_u16()};
}

/* Memory of its own for each part: what runs over the end of one is outside. */
static hg_zonotope any_zonotope(const hg_zonotope_config *config)
{
    hg_real size;
    return (hg_zonotope){.config = config, .column = any_array(hg_real, ROWS * ORDER), .score = any_array(hg_real, ROWS), .spread = any_array(hg_real, ORDER),
                         .scratch = any_array(hg_real, ORDER), .size = size, .count = any_u16(), .lost = any_u16(), .k = any_u16(), .how = (hg_start)any_u8_in(0U, 1U)};
}

/** A zonotope starts with tables in range alone, null pointers are refused, and the parts of its memory follow one another.
 *  ORDER rows, RESIDUALS residuals, WIDTH signals, DISTURBANCES disturbances, COLUMNS columns; tables of any content and sizes.
 *  @proves hg_zonotope_start hg_zonotope_valid hg_zonotope_ready
 *  @stub hg_zonotope_reset
 *  @run check real=f32 unwind=12 limit=90 ORDER=2U RESIDUALS=1U WIDTH=2U DISTURBANCES=1U COLUMNS=2U REDUCTION=3 ANY_NUMBERS ANY_SUMS */
void proof_zonotope_start(void)
{
    hg_zonotope_config config = any_config();
    config.blocks = any_u8_in(0U, 1U);
    config.reduction = (hg_reduction)any_u8();
    config.initial = any_u8();
    config.signal = any_bool() ? config.signal : NULL;
    hg_real memory[HG_ZONOTOPE_REALS(ORDER, COLUMNS, FRESH)];
    const hg_ring ring = {.data = memory, .width = any_u8(), .length = 1U, .newest = 0U};
    const hg_start how = any_bool() ? HG_START_REST : HG_START_MOVING;
    hg_zonotope self;
    const hg_status started = hg_zonotope_start(&self, &config, &ring, how, memory);
    prove((started == HG_OK) == hg_zonotope_valid(&config, ring.width), "what is valid starts");
    prove((hg_zonotope_start(NULL, &config, &ring, how, memory) == HG_E_ARGUMENT) && (hg_zonotope_start(&self, NULL, &ring, how, memory) == HG_E_ARGUMENT) &&
              (hg_zonotope_start(&self, &config, NULL, how, memory) == HG_E_ARGUMENT) && (hg_zonotope_start(&self, &config, &ring, how, NULL) == HG_E_ARGUMENT),
          "null pointers");
    if (started == HG_OK) {
        prove((self.column == memory) && (self.score == &memory[ROWS * ORDER]) && (self.spread == &self.score[ROWS]) && (self.scratch == &self.spread[ORDER]), "its parts, one after another");
        prove(state_zonotope(&self, ring.width), "a state that samples can leave");
        (void)hg_zonotope_ready(&self);
        reach("a start");
    }
}

/** A set begun again holds no more columns than its memory, whatever its initial columns are.
 *  As many initial columns as there is room for before a reduction; any numbers.
 *  @proves hg_zonotope_reset
 *  @run check real=f32 unwind=18 limit=90 ORDER=2U RESIDUALS=2U WIDTH=1U DISTURBANCES=1U COLUMNS=2U REDUCTION=3 ANY_NUMBERS ANY_SUMS
 *  @run check real=f32 unwind=18 limit=90 ORDER=2U RESIDUALS=2U WIDTH=1U DISTURBANCES=1U COLUMNS=2U REDUCTION=2 ANY_NUMBERS ANY_SUMS */
void proof_zonotope_reset(void)
{
    const hg_zonotope_config config = any_config();
    assume(hg_zonotope_valid(&config, UINT8_MAX));
    hg_zonotope self = any_zonotope(&config);
    const hg_zonotope before = self;
    assume(requires_zonotope_reset(&self));
    hg_zonotope_reset(&self, any_bool() ? HG_START_REST : HG_START_MOVING);
    prove(ensures_zonotope(&self, &before), "columns that there is room for");
    reach("end");
}

/** A past that is widened adds no more columns than its memory holds, whatever the lag and the increase.
 *  Lags up to LAG; any set, any numbers.
 *  @proves hg_zonotope_widen
 *  @run check real=f32 unwind=18 limit=90 ORDER=2U RESIDUALS=2U WIDTH=1U DISTURBANCES=1U COLUMNS=2U LAG=3U REDUCTION=3 ANY_NUMBERS ANY_SUMS
 *  @run check real=f32 unwind=18 limit=90 ORDER=2U RESIDUALS=2U WIDTH=1U DISTURBANCES=1U COLUMNS=2U LAG=3U REDUCTION=2 ANY_NUMBERS ANY_SUMS */
void proof_zonotope_widen(void)
{
    const hg_zonotope_config config = any_config();
    hg_zonotope self = any_zonotope(&config);
    const hg_zonotope before = self;
    const uint8_t first = any_u8();
    hg_real increase[WIDTH];
    assume(requires_zonotope_widen(&self, WIDTH, increase));
    hg_zonotope_widen(&self, any_u8_in(0U, LAG), first, WIDTH, increase);
    prove(ensures_zonotope(&self, &before), "columns that there is room for");
    if (self.count > before.count) {
        reach("a wider set");
    }
}

/** The set never holds more columns than its memory, whichever reduction, and reads and writes that alone; J is never NaN and never infinite, whatever the radii are.
 *  ORDER rows, RESIDUALS residuals, WIDTH signals, DISTURBANCES disturbances, COLUMNS columns; any tables that hg_zonotope_valid() accepts, any set, any radii.
 *  @proves hg_zonotope_step
 *  @run check real=f32 unwind=18 limit=90 ORDER=2U RESIDUALS=2U WIDTH=1U DISTURBANCES=1U COLUMNS=2U REDUCTION=3 ANY_NUMBERS ANY_SUMS
 *  @run check real=f32 unwind=18 limit=90 ORDER=2U RESIDUALS=2U WIDTH=1U DISTURBANCES=1U COLUMNS=2U REDUCTION=2 ANY_NUMBERS ANY_SUMS
 *  @run deep real=f32 unwind=10 limit=1200 ORDER=2U RESIDUALS=1U WIDTH=1U DISTURBANCES=1U COLUMNS=2U REDUCTION=3 ANY_NUMBERS ANY_SUMS */
void proof_zonotope_step(void)
{
    const hg_zonotope_config config = any_config();
    hg_zonotope self = any_zonotope(&config);
    const hg_zonotope before = self;
    const hg_ring ring = {.data = any_array(hg_real, WIDTH), .width = WIDTH, .length = 1U, .newest = 0U};
    hg_real J[RESIDUALS];
    assume(requires_zonotope_step(&self, &ring, J));
    hg_zonotope_step(&self, &ring, J);
    prove(ensures_zonotope(&self, &before), "columns that there is room for");
    prove(J[any_u8_in(0U, RESIDUALS - 1U)] <= HG_REAL_MAX, "finite from above, and no NaN");
    reach("end");
}
