/** @file
 *  A library without zonotopes, banks, prediction, uncertain plants and polynomial filters (config.h): it refuses the models that need one, and runs the others.
 *  Built for this alone. */
#include "support.h"

#include "small_model.h"

#include "openacc.h"
#include "platoon.h"

#if HG_WITH_ZONOTOPE || HG_WITH_BANK || HG_WITH_PREDICT || HG_WITH_MISMATCH || HG_WITH_POLYNOMIAL || HG_WITH_DIGEST || HG_WITH_FREEZE
#error "this test is for a library without the optional parts"
#endif

/* An image without banks or freeze frames does not compile with this model. Here its tables get past that, for what the library says to them. */
#undef HG_WITH_BANK
#define HG_WITH_BANK 1
#undef HG_WITH_FREEZE
#define HG_WITH_FREEZE 1
#include "platoon_bank.c"
#undef HG_WITH_BANK
#define HG_WITH_BANK 0
#undef HG_WITH_FREEZE
#define HG_WITH_FREEZE 0

static hg_status expected_of(const hg_node_config *config)
{
    const hg_detector_config *d = config->detector;
    const bool needed = (d->predictors > 0U) || (d->banks > 0U) || (d->mismatch != NULL) || (d->zonotope != NULL);
    return needed ? HG_E_CONFIG : HG_OK;
}

static void shipped_models_start_unless_they_need_what_is_left_out(void **state)
{
    (void)state;
    static hg_platoon_node platoon;
    static hg_platoon_bank_node platoon_bank;
    static hg_openacc_node openacc;
    assert_status(HG_OK, hg_platoon_node_start(&platoon, HG_START_MOVING));
    assert_status(HG_E_CONFIG, hg_platoon_bank_node_start(&platoon_bank, HG_START_MOVING));
    assert_status(expected_of(&hg_openacc_config), hg_openacc_node_start(&openacc, HG_START_MOVING));
}

static hg_status start_of(const hg_detector_config *config)
{
    static sm_storage storage;
    static hg_real real[200];
    hg_detector self;
    hg_detector_memory memory = sm_memory(&storage);
    memory.real = real;
    memory.reals = COUNT(real);
    return hg_detector_start(&self, config, &memory, HG_START_REST);
}

static void each_part_is_refused_alone(void **state)
{
    (void)state;
    const hg_bank_config certificate = {.certificates = 1U};
    const hg_predict_config predict = {.order = 1U};
    const hg_mismatch_config mismatch = {.states = 0U}; /* nothing is derived from it: with its part this model would do */
    const hg_zonotope_config zonotope[SM_GENERATORS] = {{.order = 1U}, {.order = 1U}};
    hg_detector_config c = sm_detector;
    assert_status(HG_OK, start_of(&c));
    c.mismatch = &mismatch;
    assert_status(HG_E_CONFIG, start_of(&c));
    c = sm_detector;
    c.hull = NULL;
    c.zonotope = zonotope;
    assert_status(HG_E_CONFIG, start_of(&c));
    c = sm_detector;
    c.banks = 1U;
    c.bank = &certificate;
    c.window = 1U;
    c.decision.generators = SM_GENERATORS + 1U;
    assert_status(HG_E_CONFIG, start_of(&c));
    c = sm_detector;
    c.predictors = 1U;
    c.predict = &predict;
    assert_status(HG_E_CONFIG, start_of(&c));
    const hg_statistic_config polynomial = {.settle = 1U};
    c = sm_detector;
    c.polynomials = 1U;
    c.polynomial = &polynomial;
    c.decision.generators = SM_GENERATORS + 1U;
    assert_status(HG_E_CONFIG, start_of(&c));
}

static void a_healthy_plant_raises_no_alarm_and_a_fault_does(void **state)
{
    (void)state;
    static sm_storage storage;
    hg_detector self;
    hg_finding finding;
    const hg_detector_memory memory = sm_memory(&storage);
    assert_status(HG_OK, hg_detector_start(&self, &sm_detector, &memory, HG_START_REST));
    for (int k = 0; k < 200; k++) {
        const bool fault = k >= 150;
        const int32_t a[2] = {fault ? 300 : 100, 100};
        const int32_t b[2] = {100, 0};
        assert_status(HG_OK, hg_detector_receive(&self, 0U, a, true));
        assert_status(HG_OK, hg_detector_receive(&self, 1U, b, true));
        assert_status(HG_OK, hg_detector_step(&self, &finding));
        assert_int_equal(fault ? HG_PLANT_CONFIRMED : HG_PLANT_NONE, finding.plant);
        sm_check_canaries(&storage);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shipped_models_start_unless_they_need_what_is_left_out),
        cmocka_unit_test(each_part_is_refused_alone),
        cmocka_unit_test(a_healthy_plant_raises_no_alarm_and_a_fault_does),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
