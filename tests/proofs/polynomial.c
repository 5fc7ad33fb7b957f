/** @file
 *  polynomial.h, statistic.h: a polynomial filter, with the tables of a shipped model and any measurements. */
#include "stubs.h"

#include "quadratic_sensor.c"

#define OUTPUTS 1U
#define PLACES 8U /* signals of the vector, at least */
#define POLYNOMIAL_REALS(config) HG_POLYNOMIAL_REALS((config)->states, (config)->outputs, (config)->lifted, (config)->measured, (config)->ring)
#define REALS (sizeof(((hg_quadratic_sensor_node *)0)->real) / sizeof(hg_real))

/** The number of monomials is C(variables + degree, degree) where that fits, and the memory that a filter needs is the macro's.
 *  Any number of variables up to 255 and degree up to DEGREE.
 *  @proves hg_polynomial_count hg_polynomial_reals
 *  @without unsigned-overflow conversion: products are checked before they are used
 *  @run check real=f32 unwind=5 limit=150 DEGREE=3U */
void proof_polynomial_count(void)
{
    const uint32_t variables = any_u8();
    const uint32_t degree = any_u8_in(0U, DEGREE);
    const uint32_t count = hg_polynomial_count(variables, degree);
    const uint64_t n = variables;
    const uint64_t exact[4] = {1U, n + 1U, ((n + 1U) * (n + 2U)) / 2U, ((n + 1U) * (n + 2U) * (n + 3U)) / 6U};
    prove(count == exact[degree], "C(variables + degree, degree)");
    (void)hg_polynomial_reals(any_u8(), any_u8(), any_u8_in(0U, DEGREE), any_bool());
    reach("end");
}

/** A filter starts with valid tables and enough memory, which its parts share without a gap; null pointers and too little memory are refused. Begun again, it keeps to it.
 *  The tables of quadratic_sensor, and any sizes that contradict them.
 *  @proves hg_polynomial_start hg_polynomial_valid hg_polynomial_reset
 *  @without unsigned-overflow: products of sizes are checked before they are used
 *  @run check real=f32 unwind=300 limit=90 ANY_NUMBERS ANY_SUMS */
void proof_polynomial_start(void)
{
    const hg_polynomial_config *config = &hg_quadratic_sensor_config.detector->polynomial[0].filter;
    const uint32_t reals = POLYNOMIAL_REALS(config);
    hg_real *memory = any_array(hg_real, REALS);
    hg_polynomial self;
    prove(hg_polynomial_valid(config) && (reals <= REALS), "valid tables, and the memory of a node");
    prove((hg_polynomial_start(NULL, config, memory, REALS) == HG_E_ARGUMENT) && (hg_polynomial_start(&self, NULL, memory, REALS) == HG_E_ARGUMENT) &&
              (hg_polynomial_start(&self, config, NULL, REALS) == HG_E_ARGUMENT),
          "null pointers");
    prove(hg_polynomial_start(&self, config, memory, reals - 1U) == HG_E_SIZE, "too little memory");
    prove(hg_polynomial_start(&self, config, &memory[REALS - reals], reals) == HG_OK, "it starts");
    prove(started_polynomial(&self), "parts that its steps need");
    assume(requires_polynomial_reset(&self));
    hg_polynomial_reset(&self);
    prove(started_polynomial(&self) && (self.judgement.above == 0U), "begun again, where it was");
    hg_polynomial_config other = *config;
    other.lifted = any_u8();
    prove((!hg_polynomial_valid(&other)) || (other.lifted == config->lifted), "sizes that follow from one another");
    reach("end");
}

/** A filter takes any measurements, NaN and infinity among them, in any state, and keeps to its memory; what is not finite or out of range is refused without a change.
 *  The tables of quadratic_sensor; any state, any measurements.
 *  @proves hg_polynomial_step
 *  @without unsigned-overflow: products of sizes are checked before they are used
 *  @run check real=f32 unwind=300 limit=90 proof_polynomial_step.0:3000 ANY_NUMBERS ANY_SUMS
 *  @run deep real=f64 unwind=300 limit=3600 proof_polynomial_step.0:3000 ANY_NUMBERS */
void proof_polynomial_step(void)
{
    const hg_polynomial_config *config = &hg_quadratic_sensor_config.detector->polynomial[0].filter;
    const uint32_t reals = POLYNOMIAL_REALS(config);
    hg_real *memory = any_array(hg_real, REALS);
    hg_polynomial self;
    (void)hg_polynomial_start(&self, config, &memory[REALS - reals], reals);
    for (uint32_t i = 0U; i < REALS; i++) {
        hg_real any;
        memory[i] = any;
    }
    const hg_polynomial before = self;
    const uint32_t place = any_u32();
    assume(place < REALS);
    const hg_real was = memory[place];
    hg_real *y = any_array(hg_real, OUTPUTS);
    hg_real *radius = any_array(hg_real, OUTPUTS);
    assume(requires_polynomial_step(&self, y, radius));
    const bool taken = (radius[0] > HG_REAL_MAX) || ((radius[0] >= HG_REAL_ZERO) && (hg_real_abs(y[0]) <= config->range[0]));
    const hg_status status = hg_polynomial_step(&self, y, radius);
    prove(ensures_polynomial_step(&self, &before, status), "no other status, and its parts where they were");
    prove(started_polynomial(&self), "parts that its steps need");
    prove(taken || (status == HG_E_NUMERIC), "refused");
    prove(taken || (((memory[place] == was) || (was != was)) && (self.restarts == before.restarts)), "without a change");
    if (status == HG_OK) {
        reach("a sample");
    }
    if (!taken) {
        reach("a refusal");
    }
}

/** A filter that stands as a judge starts with valid tables alone, takes any values and radii, NaN and infinity among them, and begins again where a sample is refused or an input is not
 *  known: its statistics are then 0, and no alarm counts before it has settled.
 *  The tables of quadratic_sensor; any state, any numbers.
 *  @proves hg_statistic_start hg_statistic_valid hg_statistic_reals hg_statistic_reset hg_statistic_step hg_statistic_ready
 *  @stub hg_polynomial_reset hg_polynomial_step
 *  @without unsigned-overflow: products of sizes are checked before they are used
 *  @run check real=f32 unwind=80 limit=90 ANY_NUMBERS ANY_SUMS */
void proof_statistic_step(void)
{
    const hg_statistic_config *config = &hg_quadratic_sensor_config.detector->polynomial[0];
    const uint32_t reals = hg_statistic_reals(config);
    hg_real *memory = any_array(hg_real, REALS);
    hg_statistic self;
    prove(hg_statistic_valid(config, UINT8_MAX) && (reals <= REALS), "valid tables, and the memory of a node");
    prove((hg_statistic_start(NULL, config, memory) == HG_E_ARGUMENT) && (hg_statistic_start(&self, NULL, memory) == HG_E_ARGUMENT) &&
              (hg_statistic_start(&self, config, NULL) == HG_E_ARGUMENT),
          "null pointers");
    prove(hg_statistic_start(&self, config, &memory[REALS - reals]) == HG_OK, "it starts");
    prove(started_statistic(&self) && (!hg_statistic_ready(&self)), "parts that its steps need, and no alarm that counts");
    self.samples = any_u8();
    const hg_statistic before = self;
    hg_real value[PLACES];
    hg_real radius[PLACES];
    hg_real r[HG_STATISTICS];
    hg_real J[HG_STATISTICS];
    assume(requires_statistic_step(&self, value, radius, r, J));
    const hg_status status = hg_statistic_step(&self, value, radius, r, J);
    prove(ensures_statistic_step(&self, &before, status), "no other status, and its parts where they were");
    prove((status == HG_OK) || ((self.samples == 0U) && (r[0] <= HG_REAL_ZERO) && (r[1] <= HG_REAL_ZERO) && (r[2] <= HG_REAL_ZERO)), "begun again");
    if ((status == HG_OK) && hg_statistic_ready(&self)) {
        reach("a sample that counts");
    }
    hg_statistic_reset(&self);
    prove(ensures_statistic_reset(&self, &before), "begun again");
}
