/** @file
 *  The shipped models at their own sizes: firmware/models/MODEL.c. */
#include "state_detector.h"
#include "model_tables.h"

/** A step at the sizes of a shipped model is one that its parts were proven to allow: no undefined behaviour, a finding that there is, no past rewritten that is not kept; a detector is again
 *  one that samples can leave.
 *  All groups, generators, banks and rows of the model, with its own tables; any state, any numbers.
 *  @proves hg_detector_step
 *  @stub hg_hold_step hg_hold_past hg_hold_rewrite hg_predict_step hg_mismatch_step hg_mismatch_grow hg_residual_step hg_hull_reset hg_hull_step
 *  @stub hg_zonotope_reset hg_zonotope_widen hg_zonotope_step hg_bank_reset hg_bank_step hg_statistic_step
 *  @without conversion unsigned-overflow: bits of groups are cut on purpose, the beginnings are meant to wrap
 *  @run check real=f32 unwind=35 limit=90 write_reals.0:1000 MODEL=platoon ANY_NUMBERS ANY_SUMS
 *  @run check real=f32 unwind=35 limit=90 write_reals.0:1000 MODEL=platoon_bank ANY_NUMBERS ANY_SUMS
 *  @run check real=f32 unwind=35 limit=90 write_reals.0:1000 MODEL=suspension ANY_NUMBERS ANY_SUMS
 *  @run deep real=f32 unwind=35 limit=90 write_reals.0:1000 MODEL=suspension_published ANY_NUMBERS ANY_SUMS
 *  @run check real=f32 unwind=35 limit=90 write_reals.0:1000 MODEL=dc_motor ANY_NUMBERS ANY_SUMS
 *  @run deep real=f32 unwind=35 limit=600 write_reals.0:1000 MODEL=openacc NEWEST_ROW=0..9 ANY_NUMBERS ANY_SUMS
 *  @run deep real=f32 unwind=35 limit=600 write_reals.0:1000 MODEL=battery_pack NEWEST_ROW=0..32 ANY_NUMBERS ANY_SUMS */
void proof_shipped_step(void)
{
    const hg_detector_config *config = MODEL_CONFIG.detector;
    hg_detector self = any_detector(config);
    const hg_detector before = self;
    hg_finding finding;
    const hg_status status = hg_detector_step(&self, &finding);
    prove(ensures_detector_step(&self, &before, &finding, status), "a finding that there is");
    prove(started_detector(&self), "a state that samples can leave");
    if (finding.plant == HG_PLANT_CONFIRMED) {
        reach("an alarm");
    }
}

/** Every hull of a shipped model takes a sample at its own sizes, wherever the newest radii are, and is again one that samples can leave; J is not NaN and not infinite.
 *  As above; the newest radii in the rows stated, each in turn.
 *  @proves hg_hull_step hg_hull_valid
 *  @run check real=f32 unwind=130 limit=90 MODEL=suspension NEWEST_ROW=0U ANY_NUMBERS ANY_SUMS
 *  @run check real=f32 unwind=130 limit=90 MODEL=suspension_published NEWEST_ROW=120U ANY_NUMBERS ANY_SUMS
 *  @run check real=f32 unwind=35 limit=90 MODEL=battery_pack NEWEST_ROW=1U ANY_NUMBERS ANY_SUMS
 *  @run deep real=f32 unwind=35 limit=300 MODEL=openacc NEWEST_ROW=0..9 ANY_NUMBERS ANY_SUMS
 *  @run deep real=f32 unwind=35 limit=300 MODEL=battery_pack NEWEST_ROW=0..32 ANY_NUMBERS ANY_SUMS
 *  @run deep real=f32 unwind=130 limit=300 MODEL=suspension NEWEST_ROW=0..120 ANY_NUMBERS ANY_SUMS
 *  @run deep real=f32 unwind=130 limit=300 MODEL=suspension_published NEWEST_ROW=0..120 ANY_NUMBERS ANY_SUMS */
void proof_shipped_hull(void)
{
    const hg_detector_config *config = MODEL_CONFIG.detector;
    hg_hull *hull = state_hulls(config);
    hg_real *radii = any_array(hg_real, HG_RING_REALS(config->width, config->history));
    const hg_ring ring = {.data = radii, .width = config->width, .length = config->history, .newest = NEWEST_ROW};
    assume(ring.newest < ring.length);
    for (uint8_t g = 0U; g < config->generators; g++) {
        const uint8_t residuals = config->hull[g].residuals;
        hg_real *J = any_array(hg_real, residuals);
        const hg_hull before = hull[g];
        prove(hg_hull_valid(&config->hull[g], ring.width, ring.length), "valid tables");
        hg_hull_step(&hull[g], &ring, J);
        prove(ensures_hull_step(&hull[g], &before), "one sample on");
        prove(J[residuals - 1U] <= HG_REAL_MAX, "a threshold");
    }
    reach("end");
}

/** Every hold, generator and bank of a shipped model takes a sample at its own sizes and is again one that samples can leave.
 *  As above.
 *  @proves hg_residual_step hg_hull_step hg_bank_step hg_hold_step
 *  @without conversion unsigned-overflow: bits are cut on purpose, the beginnings are meant to wrap
 *  @run check real=f32 unwind=35 limit=150 write_reals.0:1000 MODEL=platoon ANY_NUMBERS ANY_SUMS
 *  @run deep real=f32 unwind=35 limit=150 write_reals.0:1000 MODEL=dc_motor ANY_NUMBERS ANY_SUMS */
void proof_shipped_parts(void)
{
    const hg_detector_config *config = MODEL_CONFIG.detector;
    hg_detector self = any_detector(config);
    for (uint8_t i = 0U; i < config->groups; i++) {
        hg_hold *hold = &self.memory.hold[i];
        const uint8_t width = config->hold[i].trigger->width;
        hg_real *value = any_array(hg_real, PLACES(width));
        hg_real *radius = any_array(hg_real, PLACES(width));
        uint8_t rewind;
        const hg_hold before = *hold;
        hg_hold_step(hold, value, radius, &rewind);
        prove(ensures_hold_step(hold, &before, rewind), "a value and a radius");
    }
    for (uint8_t g = 0U; g < config->generators; g++) {
        hg_residual *residual = &self.memory.residual[g];
        hg_hull *hull = &self.memory.hull[g];
        hg_real *r = any_array(hg_real, config->residual[g].residuals);
        hg_real *J = any_array(hg_real, config->residual[g].residuals);
        const hg_residual before = *residual;
        const hg_hull earlier = *hull;
        const hg_status status = hg_residual_step(residual, self.value, r);
        prove(ensures_residual_step(residual, &before, status), "a residual");
        hg_hull_step(hull, &self.radii, J);
        prove(ensures_hull_step(hull, &earlier), "a threshold");
    }
    for (uint8_t b = 0U; b < config->banks; b++) {
        hg_bank *bank = &self.memory.bank[b];
        hg_real r;
        hg_real J;
        const hg_bank before = *bank;
        const hg_status status = hg_bank_step(bank, &self.values, &self.radii, &r, &J);
        prove(ensures_bank_step(bank, &before, status), "a judgement");
    }
    reach("end");
}
