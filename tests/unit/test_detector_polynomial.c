/** @file
 *  detector.h with a polynomial filter: beside the generators of small_model.h, and alone. */
#include "support.h"

#include "hullguard/detector.h"

#include "small_filter.h"
#include "small_model.h"

#define REALS (SM_REALS + SF_REALS + (2U * HG_STATISTICS))
#define FILTER_FAULT 0x8U
#define AT 64 /* code of 1, at which the input does nothing */

static const uint8_t feeds[] = {0x3U, 0x1U, 0x3U};
static const uint32_t faults[] = {0x5U, 0x2U, FILTER_FAULT};

typedef struct {
    hg_detector  self;
    sm_storage   storage;
    hg_statistic polynomial[1];
    hg_alarm     alarm[3];
    hg_real      real[REALS + 1U];
    hg_finding   finding;
} rig;

static rig r;

static hg_detector_config both_config(void)
{
    hg_detector_config c = sm_detector;
    c.polynomials = 1U;
    c.polynomial = &sf_config;
    c.decision.generators = SM_GENERATORS + 1U;
    c.decision.feeds = feeds;
    c.decision.faults = faults;
    c.residuals = sm_detector.residuals + HG_STATISTICS;
    c.reals = REALS;
    return c;
}

static hg_detector_config alone_config(void)
{
    hg_detector_config c = both_config();
    c.generators = 0U;
    c.decision.generators = 1U;
    c.decision.feeds = &feeds[2];
    c.decision.faults = &faults[2];
    c.residuals = HG_STATISTICS;
    return c;
}

static hg_detector_memory memory_of(void)
{
    hg_detector_memory memory = sm_memory(&r.storage);
    arm(r.real, COUNT(r.real));
    memory.polynomial = r.polynomial;
    memory.alarm = r.alarm;
    memory.real = r.real;
    memory.reals = REALS;
    return memory;
}

static void begin(const hg_detector_config *config)
{
    (void)memset(&r, 0, sizeof r);
    const hg_detector_memory memory = memory_of();
    assert_status(HG_OK, hg_detector_start(&r.self, config, &memory, HG_START_REST));
}

/* A healthy sample has all three at AT; group 0 is left out where it is told to be silent. */
static hg_status sample(int32_t s0, int32_t s1, int32_t s2, bool speaks, bool continues)
{
    const int32_t a[2] = {s0, s1};
    const int32_t b[2] = {s2, 0};
    if (speaks) {
        assert_status(HG_OK, hg_detector_receive(&r.self, 0U, a, continues));
    }
    assert_status(HG_OK, hg_detector_receive(&r.self, 1U, b, true));
    const hg_status status = hg_detector_step(&r.self, &r.finding);
    assert_untouched(&r.real[REALS], 1U);
    sm_check_canaries(&r.storage);
    return status;
}

/* s1 at 0 is what x is at rest. */
static void rest(int samples)
{
    for (int k = 0; k < samples; k++) {
        assert_status(HG_OK, sample(AT, 0, AT, true, true));
    }
}

static void tables_and_memory_are_checked(void **state)
{
    (void)state;
    hg_detector_config c = both_config();
    assert_count(REALS, hg_detector_reals(&c));
    hg_detector_memory memory = memory_of();
    memory.polynomial = NULL;
    assert_status(HG_E_ARGUMENT, hg_detector_start(&r.self, &c, &memory, HG_START_REST));
    memory = memory_of();
    memory.reals = REALS - 1U;
    assert_status(HG_E_SIZE, hg_detector_start(&r.self, &c, &memory, HG_START_REST));
    memory.reals = REALS;
    c.polynomial = NULL;
    assert_status(HG_E_CONFIG, hg_detector_start(&r.self, &c, &memory, HG_START_REST));
    c = both_config();
    c.residuals--;
    assert_status(HG_E_CONFIG, hg_detector_start(&r.self, &c, &memory, HG_START_REST));
    hg_statistic_config bad = sf_config;
    bad.signal = &feeds[0]; /* a place behind the signals */
    c = both_config();
    c.polynomial = &bad;
    assert_status(HG_E_CONFIG, hg_detector_start(&r.self, &c, &memory, HG_START_REST));
    c = both_config();
    c.polynomials = 31U;
    c.decision.generators = SM_GENERATORS + 31U;
    assert_status(HG_E_CONFIG, hg_detector_start(&r.self, &c, &memory, HG_START_REST));
}

static void a_generator_that_is_refused_stops_the_start(void **state)
{
    (void)state;
    hg_hull_config hull[SM_GENERATORS] = {sm_hull[0], sm_hull[1]};
    hull[1].settle = 0U;
    hg_detector_config c = both_config();
    c.hull = hull;
    const hg_detector_memory memory = memory_of();
    assert_status(HG_E_CONFIG, hg_detector_start(&r.self, &c, &memory, HG_START_REST));
}

static void an_alarm_of_the_filter_alone_is_statistical(void **state)
{
    (void)state;
    const hg_detector_config c = both_config();
    begin(&c);
    rest(40);
    assert_int_equal(HG_PLANT_NONE, r.finding.plant);
    assert_int_equal(HG_BASIS_SET, r.finding.basis);
    int32_t s1 = 0;
    for (int k = 0; (k < 60) && (r.finding.plant == HG_PLANT_NONE); k++) {
        s1 += 12; /* slower than generator 1 minds */
        assert_status(HG_OK, sample(AT, s1, AT, true, true));
    }
    assert_int_equal(HG_PLANT_CONFIRMED, r.finding.plant);
    assert_int_equal(HG_BASIS_STATISTICAL, r.finding.basis);
    assert_int_equal(FILTER_FAULT, r.finding.candidates);
    /* What rests on bounds needs no probability. */
    assert_status(HG_OK, sample(AT + 100, s1, AT, true, true));
    assert_int_equal(HG_PLANT_CONFIRMED, r.finding.plant);
    assert_int_equal(HG_BASIS_SET, r.finding.basis);
    hg_detector_restart(&r.self, HG_START_REST);
    assert_count(0, r.polynomial[0].samples);
}

static void a_filter_alone_is_statistical_always(void **state)
{
    (void)state;
    const hg_detector_config c = alone_config();
    begin(&c);
    assert_status(HG_OK, sample(AT, 0, AT, true, true));
    assert_int_equal(HG_PLANT_STARTING, r.finding.plant);
    assert_int_equal(HG_BASIS_STATISTICAL, r.finding.basis);
    assert_status(HG_OK, sample(AT, 1000, AT, true, true)); /* not yet settled */
    assert_int_equal(HG_PLANT_STARTING, r.finding.plant);
    hg_detector_restart(&r.self, HG_START_REST);
    rest(20);
    assert_int_equal(HG_PLANT_NONE, r.finding.plant);
    assert_status(HG_OK, sample(AT, 1000, AT, true, true));
    assert_int_equal(HG_PLANT_CONFIRMED, r.finding.plant);
    assert_int_equal(HG_BASIS_STATISTICAL, r.finding.basis);
}

static void all_must_have_settled(void **state)
{
    (void)state;
    const hg_detector_config c = both_config();
    (void)memset(&r, 0, sizeof r);
    const hg_detector_memory memory = memory_of();
    assert_status(HG_OK, hg_detector_start(&r.self, &c, &memory, HG_START_MOVING));
    for (int k = 0; k < 6; k++) {
        rest(1);
        assert_int_equal((k >= 3) ? HG_PLANT_NONE : HG_PLANT_STARTING, r.finding.plant);
    }
}

static void an_alarm_of_radii_that_were_too_small_is_taken_back(void **state)
{
    (void)state;
    const hg_detector_config c = alone_config();
    begin(&c);
    rest(10);
    for (int k = 0; k < 2; k++) { /* silence, first what the trigger does not look at, then what it promises */
        assert_status(HG_OK, sample(AT, 0, AT, false, true));
    }
    assert_int_equal(HG_PLANT_NONE, r.finding.plant);
    assert_status(HG_OK, sample(AT, 0, 6 * AT, false, true)); /* the input shows in y at once: the sender should have spoken */
    assert_int_equal(HG_PLANT_PROVISIONAL, r.finding.plant);
    assert_status(HG_OK, sample(AT, 240, 6 * AT, true, false)); /* it had, and the frame was lost */
    assert_int_equal(HG_PLANT_NONE, r.finding.plant);
    assert_count(14, r.polynomial[0].samples);
}

static void a_refused_number_counts_and_begins_the_filter_anew(void **state)
{
    (void)state;
    static const hg_real narrow[] = {R(8)};
    hg_statistic_config filter = sf_config;
    filter.filter.range = narrow;
    hg_detector_config c = both_config();
    c.polynomial = &filter;
    begin(&c);
    rest(10);
    assert_status(HG_E_NUMERIC, sample(AT, 1000, AT, true, true));
    assert_count(1, r.self.refusals);
    assert_count(0, r.polynomial[0].samples);
    rest(1);
    assert_count(1, r.polynomial[0].samples);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tables_and_memory_are_checked),
        cmocka_unit_test(a_generator_that_is_refused_stops_the_start),
        cmocka_unit_test(an_alarm_of_the_filter_alone_is_statistical),
        cmocka_unit_test(a_filter_alone_is_statistical_always),
        cmocka_unit_test(all_must_have_settled),
        cmocka_unit_test(an_alarm_of_radii_that_were_too_small_is_taken_back),
        cmocka_unit_test(a_refused_number_counts_and_begins_the_filter_anew),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
