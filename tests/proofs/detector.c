/** @file
 *  detector.h: holds, derived signals, generators, banks and filters under one decision. Tables and numbers are any; sizes are those of a run. */
#include "any_detector.h"

/* What the parts were given of the detector's numbers: one after another, none twice. */
static bool in_order(const hg_detector *self, const hg_real *real)
{
    const hg_real *generator = &real[OWN_REALS + HOLD_REALS + RADII_REALS];
    const hg_real *predictor = &generator[GENERATOR_REALS];
    bool fits = (self->value == real) && (self->r == &real[ALL]) && (self->J == &real[ALL + RESIDUES]) && (self->past == &real[ALL + (2U * RESIDUES)]) &&
                (self->radii.data == &real[OWN_REALS + HOLD_REALS]);
    for (uint8_t i = 0U; i < GROUPS; i++) {
        fits = fits && (self->memory.hold[i].value == &real[OWN_REALS + HG_HOLD_REALS(i * WIDTH)]) && (self->memory.hold[i].sent == &self->memory.code[HG_HOLD_CODES(i * WIDTH)]);
    }
    for (uint8_t g = 0U; g < GENERATORS; g++) {
        const hg_real *own = &generator[g * (HG_RESIDUAL_REALS(1U, 1U) + THRESHOLD_REALS)];
        const hg_real *threshold = (COLUMNS == 0U) ? self->memory.hull[g].theta : self->memory.zonotope[g].column;
        fits = fits && (self->memory.residual[g].z == own) && (threshold == &own[HG_RESIDUAL_REALS(1U, 1U)]);
    }
    for (uint8_t i = 0U; i < PREDICTORS; i++) {
        fits = fits && (self->memory.predict[i].x == &predictor[i * HG_PREDICT_REALS(1U, 1U, WIDTH)]);
    }
    return fits && ((BANKS == 0U) || (self->values.data == &predictor[PREDICTOR_REALS + (POLYNOMIALS * STATISTIC_REALS)]));
}

/** What starts is a detector that samples can leave: its tables are as its steps need them, its parts have the memory that they need, one after another and none twice. Null pointers,
 *  too little memory and tables that contradict one another are refused.
 *  GROUPS groups of WIDTH signals, PREDICTORS of them predicted, STATES uncertain states, GENERATORS generators of RESIDUALS residuals by hulls, or by zonotopes of COLUMNS columns,
 *  BANKS banks, POLYNOMIALS filters, HISTORY rows; tables of any content.
 *  @proves hg_detector_start hg_detector_reals hg_detector_sums
 *  @without conversion: bits of groups are cut on purpose
 *  @run check real=f32 unwind=7 limit=90 hg_detector_start.0:70 hg_ring_reset.0:13 GROUPS=1U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U POLYNOMIALS=0U HISTORY=2U HORIZON=2U COLUMNS=0U ANY_NUMBERS ANY_SUMS
 *  @run check real=f32 unwind=7 limit=90 hg_detector_start.0:70 hg_ring_reset.0:13 GROUPS=2U WIDTH=1U PREDICTORS=1U STATES=1U GENERATORS=2U RESIDUALS=1U BANKS=1U POLYNOMIALS=0U HISTORY=2U HORIZON=2U COLUMNS=0U ANY_NUMBERS ANY_SUMS
 *  @run check real=f32 unwind=7 limit=90 hg_detector_start.0:70 hg_ring_reset.0:13 GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=1U GENERATORS=1U RESIDUALS=1U BANKS=0U POLYNOMIALS=0U HISTORY=3U HORIZON=2U COLUMNS=1U ANY_NUMBERS ANY_SUMS
 *  @run deep real=f32 unwind=30 limit=3600 hg_detector_start.0:150 hg_ring_reset.0:13 GROUPS=1U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U POLYNOMIALS=1U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS ANY_SUMS */
void proof_detector_start(void)
{
    const hg_detector_config config = any_detector_config();
    hg_detector_memory memory = any_memory();
    const hg_start how = any_bool() ? HG_START_REST : HG_START_MOVING;
    hg_detector self;
    prove((hg_detector_reals(&config) == REALS) && (hg_detector_sums(&config) == (2U * BANKS)), "what it needs");
    prove((hg_detector_start(NULL, &config, &memory, how) == HG_E_ARGUMENT) && (hg_detector_start(&self, NULL, &memory, how) == HG_E_ARGUMENT) &&
              (hg_detector_start(&self, &config, NULL, how) == HG_E_ARGUMENT),
          "null pointers");
    memory.reals = REALS - 1U;
    const hg_status less = hg_detector_start(&self, &config, &memory, how);
    prove((less == HG_E_SIZE) || (less == HG_E_CONFIG), "too little memory");
    memory.reals = REALS;
    const hg_status status = hg_detector_start(&self, &config, &memory, how);
    prove((status == HG_OK) || (status == HG_E_CONFIG), "no other status");
    if (status == HG_OK) {
        prove(started_detector(&self), "tables and memory as a step needs them");
        prove(in_order(&self, memory.real), "no number twice");
        for (uint8_t g = 0U; g < JUDGES; g++) {
            prove(self.memory.alarm[g].state == HG_PLANT_NONE, "no alarm");
        }
        reach("a start");
    } else {
        reach("a refusal");
    }
}

/** A step asks of its parts what they were proven to do and no more: no undefined behaviour, a finding that there is, no past rewritten that is not kept; a detector is again
 *  one that samples can leave.
 *  GROUPS groups of WIDTH signals, PREDICTORS of them predicted, STATES uncertain states, GENERATORS generators of RESIDUALS residuals by hulls, or by zonotopes of COLUMNS columns,
 *  BANKS banks, POLYNOMIALS filters, whose own part is proven with the tables of a shipped model (polynomial.c), HISTORY rows; any tables that hg_detector_start() accepts, any state,
 *  any numbers.
 *  @proves hg_detector_step
 *  @stub hg_hold_step hg_hold_past hg_hold_rewrite hg_predict_step hg_mismatch_step hg_mismatch_grow hg_residual_step hg_hull_reset hg_hull_step
 *  @stub hg_zonotope_reset hg_zonotope_widen hg_zonotope_step hg_bank_reset hg_bank_step hg_statistic_step
 *  @without conversion unsigned-overflow: bits of groups are cut on purpose, the beginnings are meant to wrap
 *  @run deep real=f32 unwind=5 limit=150 GROUPS=1U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U POLYNOMIALS=0U HISTORY=2U HORIZON=2U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=5 limit=150 GROUPS=2U WIDTH=1U PREDICTORS=1U STATES=1U GENERATORS=2U RESIDUALS=1U BANKS=1U POLYNOMIALS=0U HISTORY=2U HORIZON=2U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=30 limit=150 GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=2U RESIDUALS=1U BANKS=1U POLYNOMIALS=1U HISTORY=2U HORIZON=2U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=5 limit=150 GROUPS=2U WIDTH=1U PREDICTORS=1U STATES=1U GENERATORS=1U RESIDUALS=1U BANKS=0U POLYNOMIALS=0U HISTORY=3U HORIZON=3U COLUMNS=1U ANY_NUMBERS
 *  @run deep real=f32 unwind=35 limit=600 write_reals.0:800 GROUPS=6U WIDTH=3U PREDICTORS=0U STATES=0U GENERATORS=29U RESIDUALS=1U BANKS=0U POLYNOMIALS=0U HISTORY=10U HORIZON=10U COLUMNS=0U ANY_NUMBERS
 *  @run deep real=f32 unwind=12 limit=600 write_reals.0:800 GROUPS=6U WIDTH=1U PREDICTORS=1U STATES=1U GENERATORS=2U RESIDUALS=1U BANKS=7U POLYNOMIALS=0U HISTORY=5U HORIZON=5U COLUMNS=0U ANY_NUMBERS */
void proof_detector_step(void)
{
    const hg_detector_config config = any_detector_config();
    hg_detector self = any_detector(&config);
    const hg_detector before = self;
    hg_finding finding;
    const hg_status status = hg_detector_step(&self, &finding);
    prove(ensures_detector_step(&self, &before, &finding, status), "a finding that there is");
    prove(started_detector(&self), "a state that samples can leave");
    if (finding.plant == HG_PLANT_CONFIRMED) {
        reach("an alarm");
    }
    if (status != HG_OK) {
        reach("a refusal");
    }
}

/** A frame of a group that there is, and whose codes are valid or stand for no value, is booked once a sample; what is refused counts as lost; a group that there is not is refused.
 *  A detector begun again keeps its holds, and is one that samples can leave.
 *  Sizes as above; any tables, any state, any codes.
 *  @proves hg_detector_receive hg_detector_lose hg_detector_restart
 *  @stub hg_hold_receive hg_predict_reset hg_residual_reset hg_hull_reset hg_zonotope_reset hg_bank_reset hg_statistic_reset
 *  @without conversion unsigned-overflow: bits of groups are cut on purpose, the beginnings are meant to wrap
 *  @run deep real=f32 unwind=7 limit=90 hg_ring_reset.0:13 GROUPS=2U WIDTH=2U PREDICTORS=1U STATES=1U GENERATORS=2U RESIDUALS=1U BANKS=1U POLYNOMIALS=0U HISTORY=1U HORIZON=2U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=7 limit=90 GROUPS=1U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=2U RESIDUALS=1U BANKS=1U POLYNOMIALS=0U HISTORY=2U HORIZON=2U COLUMNS=1U ANY_NUMBERS
 *  @run check real=f32 unwind=30 limit=90 GROUPS=1U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=2U RESIDUALS=1U BANKS=0U POLYNOMIALS=1U HISTORY=2U HORIZON=2U COLUMNS=0U ANY_NUMBERS */
void proof_detector_receive(void)
{
    const hg_detector_config config = any_detector_config();
    hg_detector self = any_detector(&config);
    const hg_detector before = self;
    const uint8_t group = any_u8();
    int32_t code[WIDTH];
    if (any_bool()) {
        assume(requires_detector_receive(&self, group, code));
        const hg_status status = hg_detector_receive(&self, group, code, any_bool());
        prove(ensures_detector_receive(&self, group, status), "a status of the list");
        prove((status != HG_E_NUMERIC) || self.memory.hold[group].lost, "a refused one is lost");
        if (status == HG_OK) {
            reach("a frame");
        }
    }
    prove((hg_detector_lose(&self, group) == HG_OK) == (group < GROUPS), "noted of a group that there is");
    prove((group >= GROUPS) || self.memory.hold[group].lost, "lost");
    hg_detector_restart(&self, any_bool() ? HG_START_REST : HG_START_MOVING);
    prove(ensures_detector_restart(&self, &before), "begun again");
    prove(started_detector(&self), "a state that samples can leave");
    reach("end");
}
