/** @file
 *  polynomial.h, statistic.h: a polynomial filter, with the tables of a shipped model and any measurements. */
#include "proof.h"

#include "hullguard/statistic.h"

#include "quadratic_sensor.c"

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

/** A filter takes any measurements, NaN and infinity among them, keeps to its memory, refuses what is not finite or out of range, and its statistics stand beside thresholds
 *  that there are.
 *  The tables of quadratic_sensor; a start and a sample.
 *  @proves hg_polynomial_start hg_polynomial_valid hg_polynomial_reset hg_polynomial_step
 *  @proves hg_statistic_start hg_statistic_valid hg_statistic_reals hg_statistic_reset hg_statistic_step hg_statistic_ready
 *  @without unsigned-overflow: products of sizes are checked before they are used
 *  @run deep real=f32 unwind=300 limit=3600 ANY_NUMBERS
 *  @run deep real=f64 unwind=300 limit=3600 */
void proof_polynomial_step(void)
{
    const hg_statistic_config *config = &hg_quadratic_sensor_config.detector->polynomial[0];
    static hg_real memory[REALS];
    static hg_real more[REALS];
    const uint32_t reals = hg_statistic_reals(config);
    prove(reals <= REALS, "the memory of a node");
    hg_statistic self;
    prove(hg_statistic_valid(config, 255U) && hg_polynomial_valid(&config->filter), "valid tables");
    prove(hg_statistic_start(&self, config, TAIL(memory, reals)) == HG_OK, "it starts");
    prove((hg_statistic_start(NULL, config, memory) == HG_E_ARGUMENT) && (hg_statistic_start(&self, NULL, memory) == HG_E_ARGUMENT) &&
              (hg_statistic_start(&self, config, NULL) == HG_E_ARGUMENT),
          "null pointers");
    hg_polynomial filter;
    prove(hg_polynomial_start(&filter, &config->filter, more, 0U) == HG_E_SIZE, "too little memory");
    prove(hg_polynomial_start(&filter, &config->filter, more, COUNT_OF(more)) == HG_OK, "it starts");
    hg_real value[8];
    hg_real radius[8];
    hg_real r[HG_STATISTICS];
    hg_real J[HG_STATISTICS];
    (void)hg_statistic_start(&self, config, TAIL(memory, reals));
    const hg_status status = hg_statistic_step(&self, value, radius, r, J);
    prove((status == HG_OK) || (status == HG_E_NUMERIC), "no other status");
    const hg_status alone = hg_polynomial_step(&filter, value, radius);
    prove((alone == HG_OK) || (alone == HG_E_NUMERIC), "no other status");
    (void)hg_statistic_ready(&self);
    hg_statistic_reset(&self);
    hg_polynomial_reset(&filter);
    reach("end");
}
