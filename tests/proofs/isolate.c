/** @file
 *  isolate.h: what a fault estimate stands for. Numbers are any, NaN and infinity among them; sizes are those of a run. */
#include "proof.h"

#include "hullguard/isolate.h"

/** An isolation reads and writes its own memory only, whatever the estimates are, names only candidates that there are, and refuses what is not finite without a change.
 *  ESTIMATES estimates, SENSORS sensors, COMPONENTS components, BLOCKS blocks; any tables that hg_isolate_valid() accepts; a start and one sample in any state of an episode.
 *  @proves hg_isolate_start hg_isolate_valid hg_isolate_reset hg_isolate_step
 *  @run check real=f32 unwind=24 limit=150 ESTIMATES=2U SENSORS=1U COMPONENTS=1U BLOCKS=1U ANY_NUMBERS
 *  @run deep real=f32 unwind=40 limit=3600 ESTIMATES=3U SENSORS=1U COMPONENTS=2U BLOCKS=2U */
void proof_isolate_step(void)
{
    uint8_t sensor[SENSORS];
    hg_real sensor_limit[SENSORS];
    hg_real whole[COMPONENTS * ESTIMATES];
    hg_real excitation[COMPONENTS];
    hg_real memory[HG_ISOLATE_REALS(COMPONENTS, BLOCKS)];
    hg_isolate_config config;
    config.estimates = ESTIMATES;
    config.sensors = SENSORS;
    config.sensor = sensor;
    config.sensor_limit = sensor_limit;
    config.components = COMPONENTS;
    config.whole = whole;
    config.excitation = excitation;
    config.blocks = BLOCKS;
    hg_isolate self;
    const hg_status started = hg_isolate_start(&self, &config, memory);
    prove((started == HG_OK) == hg_isolate_valid(&config), "what is valid starts");
    prove((hg_isolate_start(NULL, &config, memory) == HG_E_ARGUMENT) && (hg_isolate_start(&self, NULL, memory) == HG_E_ARGUMENT) &&
              (hg_isolate_start(&self, &config, NULL) == HG_E_ARGUMENT),
          "null pointers");
    assume(started == HG_OK);
    prove((config.actuator < ESTIMATES) && (sensor[0] < ESTIMATES) && (config.block >= 1U), "rows that there are");
    /* Memory of its own for each part. */
    hg_real share[COMPONENTS + 1U];
    hg_real now[COMPONENTS];
    hg_real smooth[COMPONENTS];
    hg_real row[COMPONENTS + 1U];
    hg_real factor[(BLOCKS + 1U) * HG_ISOLATE_FACTOR(COMPONENTS)];
    self.share = share;
    self.now = now;
    self.smooth = smooth;
    self.row = row;
    self.factor = factor;
    hg_isolate_reset(&self);
    self.episode = any_bool();
    self.age = any_u32();
    self.quiet = any_u32();
    self.silent = any_u32();
    self.filled = any_u16();
    self.open = any_u8_in(0U, BLOCKS - 1U);
    self.complete = any_u8_in(0U, BLOCKS);
    assume(self.filled < config.block);
    hg_real estimate[ESTIMATES];
    hg_real radius[ESTIMATES];
    hg_isolation found;
    const hg_status status = hg_isolate_step(&self, estimate, radius, &found);
    prove((status == HG_OK) || (status == HG_E_NUMERIC), "no other status");
    prove((found.cause >= HG_CAUSE_UNDECIDED) && (found.cause <= HG_CAUSE_AMBIGUOUS), "a cause that there is");
    prove((status != HG_OK) || ((found.candidates >> (1U + COMPONENTS + SENSORS)) == 0U), "candidates that there are");
    prove((self.open < BLOCKS) && (self.complete <= BLOCKS) && ((self.filled < config.block) || (!self.episode)), "blocks that there are");
    if (status == HG_OK) {
        reach("a sample");
    } else {
        reach("refused");
    }
}
