/** @file
 *  detector.h: holds, generators, thresholds and decision together, on a model that can be computed by hand. */
#include "support.h"

#include "hullguard/detector.h"

#include "small_model.h"

typedef struct {
    hg_detector self;
    sm_storage  storage;
    hg_finding  finding;
} rig;

static void begin_with(rig *r, const hg_detector_config *config, hg_start how)
{
    (void)memset(r, 0x5A, sizeof(*r));
    const hg_detector_memory memory = sm_memory(&r->storage);
    assert_status(HG_OK, hg_detector_start(&r->self, config, &memory, how));
}

static void begin(rig *r, hg_start how)
{
    begin_with(r, &sm_detector, how);
}

static hg_plant step(rig *r)
{
    (void)memset(&r->finding, 0x5A, sizeof(r->finding));
    assert_status(HG_OK, hg_detector_step(&r->self, &r->finding));
    assert_int_equal(HG_BASIS_SET, r->finding.basis);
    sm_check_canaries(&r->storage);
    return r->finding.plant;
}

static void give(rig *r, uint8_t group, int32_t a, int32_t b, bool continues)
{
    const int32_t code[2] = {a, b};
    assert_status(HG_OK, hg_detector_receive(&r->self, group, code, continues));
}

static void refuse(const hg_detector_config *config, hg_status expected)
{
    static sm_storage storage;
    static hg_real real[SM_REALS + 9U];
    hg_detector self;
    hg_detector_memory memory = sm_memory(&storage);
    arm(real, COUNT(real));
    memory.real = real; /* enough even for tables that contradict one another */
    memory.reals = SM_REALS + 8U;
    assert_status(expected, hg_detector_start(&self, config, &memory, HG_START_REST));
    sm_check_canaries(&storage);
    assert_untouched(&real[SM_REALS + 8U], 1U);
}

static void null_pointers_are_refused(void **state)
{
    (void)state;
    static sm_storage storage;
    hg_detector self;
    const hg_detector_memory memory = sm_memory(&storage);
    assert_status(HG_E_ARGUMENT, hg_detector_start(NULL, &sm_detector, &memory, HG_START_REST));
    assert_status(HG_E_ARGUMENT, hg_detector_start(&self, NULL, &memory, HG_START_REST));
    assert_status(HG_E_ARGUMENT, hg_detector_start(&self, &sm_detector, NULL, HG_START_REST));
    hg_detector_memory m[6] = {memory, memory, memory, memory, memory, memory};
    m[0].hold = NULL;
    m[1].residual = NULL;
    m[2].hull = NULL;
    m[3].alarm = NULL;
    m[4].code = NULL;
    m[5].real = NULL;
    for (size_t i = 0U; i < COUNT(m); i++) {
        assert_status(HG_E_ARGUMENT, hg_detector_start(&self, &sm_detector, &m[i], HG_START_REST));
    }
}

static void memory_one_too_short_is_refused(void **state)
{
    (void)state;
    static sm_storage storage;
    hg_detector self;
    hg_detector_memory memory = sm_memory(&storage);
    assert_count(SM_REALS, hg_detector_reals(&sm_detector));
    memory.codes = SM_CODES - 1U;
    assert_status(HG_E_SIZE, hg_detector_start(&self, &sm_detector, &memory, HG_START_REST));
    memory.codes = SM_CODES;
    memory.reals = SM_REALS - 1U;
    assert_status(HG_E_SIZE, hg_detector_start(&self, &sm_detector, &memory, HG_START_REST));
    assert_codes_untouched(storage.code, SM_CODES + 1U);
    assert_untouched(storage.real, SM_REALS + 1U);
    memory.reals = SM_REALS;
    assert_status(HG_OK, hg_detector_start(&self, &sm_detector, &memory, HG_START_REST));
}

static void contradicting_tables_are_refused(void **state)
{
    (void)state;
    hg_detector_config c[14];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = sm_detector;
    }
    c[0].groups = 0U;
    c[1].groups = (uint8_t)(HG_GROUPS_MAX + 1U);
    c[2].generators = 0U;
    c[3].generators = (uint8_t)(HG_GENERATORS_MAX + 1U);
    c[4].generators = 1U;
    c[5].hold = NULL;
    c[6].residual = NULL;
    c[7].hull = NULL;
    c[8].signals = 0U;
    c[9].history = 0U;
    c[10].signals = 2U;    /* the groups bring three */
    c[11].groups = 1U;     /* the groups bring two */
    c[12].history = SM_TAPS;
    c[13].residuals = 1U;
    for (size_t i = 0U; i < COUNT(c); i++) {
        refuse(&c[i], HG_E_CONFIG);
    }
    hg_detector_config d = sm_detector;
    d.decision.up = 0U;
    refuse(&d, HG_E_CONFIG);
}

/* Of a group that speaks less often than the small model's. */
static const hg_real long_slew[SM_TAPS + 2U + 3U] = {SM_SLEW(1), SM_SLEW(2), SM_SLEW(3), SM_SLEW(4), SM_SLEW(5), SM_SLEW(6), SM_SLEW(7),
                                                     SM_SLEW(8), SM_SLEW(9), SM_SLEW(10)};

static void contradicting_groups_are_refused(void **state)
{
    (void)state;
    hg_hold_config hold[SM_GROUPS] = {sm_hold[0], sm_hold[1]};
    hg_detector_config c = sm_detector;
    c.hold = hold;
    hold[1].trigger = NULL;
    refuse(&c, HG_E_CONFIG);
    hg_trigger_config wide = sm_trigger_b;
    wide.width = 2U;
    hold[1].trigger = &wide;
    refuse(&c, HG_E_CONFIG);
    hold[1] = sm_hold[1];
    hold[1].margin = 255U;
    refuse(&c, HG_E_CONFIG);
    hg_trigger_config slow = sm_trigger_b;
    slow.interval_max = SM_TAPS + 2U; /* a rewind would reach behind the taps */
    hold[1] = sm_hold[1];
    hold[1].trigger = &slow;
    hold[1].slew = long_slew;
    refuse(&c, HG_E_CONFIG);
    slow.interval_max = SM_TAPS + 1U;
    rig r;
    begin_with(&r, &c, HG_START_REST);
}

/* A frame can be found lost as long as its group may be silent; a signal without events needs no tap. */
static void a_rewind_ends_within_a_signals_own_taps(void **state)
{
    (void)state;
    hg_hull_config hull[SM_GENERATORS] = {sm_hull[0], sm_hull[1]};
    hg_detector_config c = sm_detector;
    c.hull = hull;
    const uint8_t enough[] = {3U, 0U};
    const uint8_t few[] = {2U, 0U};
    rig r;
    hull[0].taps = enough;
    begin_with(&r, &c, HG_START_REST);
    hull[1].taps = enough;
    begin_with(&r, &c, HG_START_REST);
    hull[1].taps = few;
    refuse(&c, HG_E_CONFIG);
    hull[0].taps = few;
    hull[1].taps = enough;
    refuse(&c, HG_E_CONFIG);
    hg_trigger_config slow = sm_trigger_b;
    hg_hold_config hold[SM_GROUPS] = {sm_hold[0], sm_hold[1]};
    slow.interval_max = 2U;
    hold[1].trigger = &slow;
    hold[1].slew = long_slew;
    c.hold = hold;
    hull[0].taps = enough; /* a sample may be rewritten, but it would be in the tail */
    refuse(&c, HG_E_CONFIG);
    hull[0].taps = NULL;
    refuse(&c, HG_E_CONFIG);
    hull[0] = sm_hull[0];
    hull[0].signal = NULL;
    refuse(&c, HG_E_CONFIG);
    hull[0] = sm_hull[0];
    begin_with(&r, &c, HG_START_REST);
}

static void contradicting_generators_are_refused(void **state)
{
    (void)state;
    hg_residual_config residual[SM_GENERATORS] = {sm_residual[0], sm_residual[1]};
    hg_hull_config hull[SM_GENERATORS] = {sm_hull[0], sm_hull[1]};
    const uint8_t outside[] = {SM_SIGNALS, 0U};
    hg_detector_config c = sm_detector;
    c.residual = residual;
    c.hull = hull;
    residual[0].signal = NULL;
    refuse(&c, HG_E_CONFIG);
    residual[0].signal = outside;
    refuse(&c, HG_E_CONFIG);
    residual[0] = sm_residual[0];
    hull[1].residuals = 2U;
    refuse(&c, HG_E_CONFIG);
    hull[1] = sm_hull[1];
    residual[1].state.rows = 2U;
    refuse(&c, HG_E_CONFIG);
    residual[1] = sm_residual[1];
    const hg_real endless = R(1);
    hull[0].decay = &endless;
    refuse(&c, HG_E_CONFIG);
    hull[0] = sm_hull[0];
    const hg_detector_config good = c;
    rig r;
    begin_with(&r, &good, HG_START_REST);
}

static void a_sample_computes_by_hand(void **state)
{
    (void)state;
    rig r;
    begin(&r, HG_START_REST);
    give(&r, 0U, 64, 128, true);
    give(&r, 1U, 62, 0, true);
    assert_int_equal(HG_PLANT_NONE, step(&r));
    assert_real(1.0, r.self.value[0]);
    assert_real(2.0, r.self.value[1]);
    assert_real(0.96875, r.self.value[2]);
    assert_real(0.03125, r.self.r[0]);
    assert_real(0.0625 + (2.0 * SM_HALF), r.self.J[0]);
    assert_real(2.0, r.self.r[1]);
    assert_real(64.0 + SM_HALF, r.self.J[1]);
    give(&r, 1U, 62, 0, true);
    assert_int_equal(HG_PLANT_NONE, step(&r));
    assert_real(0.0, r.self.r[1]);
    assert_real(0.25 + 0.25 + (2.0 * SM_HALF), r.self.J[1]);
    assert_int_equal(0, r.finding.candidates);
}

static void groups_that_do_not_exist_are_refused(void **state)
{
    (void)state;
    rig r;
    begin(&r, HG_START_REST);
    const int32_t code[2] = {0, 0};
    const hg_detector before = r.self;
    const sm_storage kept = r.storage;
    for (uint32_t group = SM_GROUPS; group < 256U; group++) {
        assert_status(HG_E_ARGUMENT, hg_detector_receive(&r.self, (uint8_t)group, code, true));
        assert_status(HG_E_ARGUMENT, hg_detector_lose(&r.self, (uint8_t)group));
    }
    assert_memory_equal(&before, &r.self, sizeof(before));
    assert_memory_equal(&kept, &r.storage, sizeof(kept));
    assert_status(HG_OK, hg_detector_lose(&r.self, 1U));
}

static void a_code_that_means_nothing_is_refused_and_counts_as_lost(void **state)
{
    (void)state;
    const int32_t bad[] = {SM_LIMIT + 1, -SM_LIMIT - 1, INT32_MAX, INT32_MIN + 1};
    for (size_t i = 0U; i < COUNT(bad); i++) {
        for (size_t g = 0U; g < 2U; g++) {
            rig r;
            int32_t code[2] = {0, 0};
            begin(&r, HG_START_REST);
            give(&r, 0U, 5, 5, true);
            give(&r, 1U, 5, 0, true);
            (void)step(&r);
            code[g] = bad[i];
            assert_status(HG_E_NUMERIC, hg_detector_receive(&r.self, 0U, code, true));
            give(&r, 1U, 5, 0, true);
            (void)step(&r);
            assert_real(5.0 * SM_RESOLUTION, r.self.value[0]);
            assert_int_equal(HG_BUS_LOSSY, hg_hold_health(&r.storage.hold[0]));
            assert_int_equal(HG_BUS_GOOD, hg_hold_health(&r.storage.hold[1]));
        }
    }
    rig r;
    begin(&r, HG_START_REST);
    give(&r, 0U, HG_CODE_INVALID, SM_LIMIT, true); /* marked by its sender: taken */
    give(&r, 1U, 0, 0, true);
    const int32_t again[2] = {0, 0};
    assert_status(HG_E_REPEATED, hg_detector_receive(&r.self, 1U, again, true));
    (void)step(&r);
    assert_real(SM_SPAN, r.self.radius[0]);
    assert_real(SM_HALF, r.self.radius[1]);
}

static void a_fault_is_confirmed_with_its_candidates(void **state)
{
    (void)state;
    rig r;
    begin(&r, HG_START_REST);
    for (int k = 0; k < 5; k++) {
        give(&r, 0U, 100, 100, true);
        give(&r, 1U, 100, 0, true);
        assert_int_equal(HG_PLANT_NONE, step(&r));
    }
    give(&r, 0U, 110, 100, true); /* 10 codes are more than 4 + 2 halves */
    give(&r, 1U, 100, 0, true);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r));
    assert_int_equal(0x5, r.finding.candidates);
    give(&r, 0U, 110, 200, true); /* a second fault: no single one explains both */
    give(&r, 1U, 100, 0, true);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r));
    assert_int_equal(0, r.finding.candidates);
    for (int k = 0; k < 2; k++) {
        give(&r, 0U, 100, 200, true);
        give(&r, 1U, 100, 0, true);
        assert_int_equal(HG_PLANT_CONFIRMED, step(&r));
    }
    give(&r, 0U, 100, 200, true);
    give(&r, 1U, 100, 0, true);
    assert_int_equal(HG_PLANT_NONE, step(&r)); /* three quiet samples */
    give(&r, 0U, 100, 300, true);
    give(&r, 1U, 100, 0, true);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r)); /* of generator 1 alone; it rests on bounds too (step() looks) */
    assert_int_equal(0x2, r.finding.candidates);
}

static void a_lost_frame_takes_a_provisional_alarm_back(void **state)
{
    (void)state;
    rig r;
    for (int lost = 0; lost < 2; lost++) {
        begin(&r, HG_START_REST);
        for (int k = 0; k < 3; k++) {
            give(&r, 0U, 0, 0, true);
            give(&r, 1U, 0, 0, true);
            assert_int_equal(HG_PLANT_NONE, step(&r));
        }
        give(&r, 1U, 10, 0, true);
        assert_int_equal(HG_PLANT_NONE, step(&r));
        /* s2 has run away from the value that group 0's silence vouches for: either a fault, or a frame was lost */
        give(&r, 1U, 26, 0, true);
        assert_int_equal(HG_PLANT_PROVISIONAL, step(&r));
        assert_int_equal(0x5, r.finding.candidates);
        give(&r, 0U, 30, 0, lost == 0);
        give(&r, 1U, 30, 0, true);
        assert_int_equal((lost == 0) ? HG_PLANT_CONFIRMED : HG_PLANT_NONE, step(&r));
        if (lost != 0) {
            assert_real(SM_SLEW(2), r.self.radii.data[((r.self.radii.newest + SM_HISTORY - 1U) % SM_HISTORY) * SM_SIGNALS]);
            assert_real(SM_SLEW(1), r.self.radii.data[((r.self.radii.newest + SM_HISTORY - 2U) % SM_HISTORY) * SM_SIGNALS]);
        }
    }
}

static void a_moving_start_shows_until_it_has_settled(void **state)
{
    (void)state;
    rig r;
    begin(&r, HG_START_MOVING);
    for (int k = 0; k < 6; k++) {
        give(&r, 0U, 100, 100, true);
        give(&r, 1U, 100, 0, true);
        assert_int_equal((k < 2) ? HG_PLANT_STARTING : HG_PLANT_NONE, step(&r));
    }
    hg_detector_restart(&r.self, HG_START_MOVING);
    assert_real(0.0, r.self.radii.data[0]);
    give(&r, 1U, 100, 0, true);
    assert_int_equal(HG_PLANT_STARTING, step(&r));
    assert_real(SM_SLEW(1), r.self.radius[0]); /* what the holds know stays */
    assert_real(64.0 + (0.25 + SM_HALF) + SM_HALF, r.self.J[0]);
    assert_real(100.0 * SM_RESOLUTION, r.self.r[1]); /* no value from before it is left */
}

static void restart_forgets_alarms(void **state)
{
    (void)state;
    hg_detector_config c = sm_detector;
    c.decision.latch = true;
    rig r;
    begin_with(&r, &c, HG_START_REST);
    give(&r, 0U, 1000, 0, true);
    give(&r, 1U, 0, 0, true);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r));
    assert_count(1U, r.self.beginnings);
    hg_detector_restart(&r.self, HG_START_REST);
    assert_count(2U, r.self.beginnings);
    give(&r, 0U, 0, 0, true);
    give(&r, 1U, 0, 0, true);
    assert_int_equal(HG_PLANT_NONE, step(&r));
}

/* A loss that shows after a restart corrects no radius from before it: the residual has not seen that sample. */
static void a_rewind_ends_where_the_detector_began(void **state)
{
    (void)state;
    for (uint32_t since = 0U; since < 4U; since++) {
        rig r;
        begin(&r, HG_START_REST);
        for (int k = 0; k < 2; k++) {
            give(&r, 0U, 0, 0, true);
            give(&r, 1U, 0, 0, true);
            (void)step(&r);
        }
        for (uint32_t k = 0U; k < 3U; k++) { /* silence is relied on in all three */
            if (k == (3U - since)) {
                hg_detector_restart(&r.self, HG_START_MOVING);
            }
            give(&r, 1U, 0, 0, true);
            (void)step(&r);
        }
        if (since == 0U) {
            hg_detector_restart(&r.self, HG_START_MOVING);
        }
        give(&r, 0U, 0, 0, false);
        give(&r, 1U, 0, 0, true);
        (void)step(&r);
        assert_count(since + 1U, r.self.samples);
        for (uint8_t lag = 1U; lag < 4U; lag++) {
            assert_real((lag <= since) ? SM_SLEW(4U - lag) : R(0), hg_ring_row(&r.self.radii, lag)[1]);
        }
        assert_real(SM_HALF, hg_ring_row(&r.self.radii, 0U)[1]);
    }
}

/* Their thetas take their memory from the detector's, and shift nobody else's. */
static void a_threshold_with_modes_stands_beside_the_others(void **state)
{
    (void)state;
    const hg_real decay[2] = {R(0.5), R(0.25)};
    const hg_real in[4] = {R(1), R(1), R(1), R(1)};
    const hg_real out[2] = {R(1), R(2)};
    const hg_real begun[2] = {R(8), R(16)};
    hg_hull_config hull[SM_GENERATORS] = {sm_hull[0], sm_hull[1]};
    hull[0].modes = 2U;
    hull[0].mode_decay = decay;
    hull[0].mode_input = in;
    hull[0].mode_output = out;
    hull[0].mode_rest = begun;
    hull[0].mode_moving = begun;
    hg_detector_config c = sm_detector;
    c.hull = hull;
    assert_count(SM_REALS + 2U, hg_detector_reals(&c));
    rig r;
    rig plain;
    hg_real real[SM_REALS + 3U];
    arm(real, COUNT(real));
    begin(&plain, HG_START_REST);
    hg_detector_memory memory = sm_memory(&r.storage);
    memory.real = real;
    memory.reals = SM_REALS + 1U;
    assert_status(HG_E_SIZE, hg_detector_start(&r.self, &c, &memory, HG_START_REST));
    memory.reals = SM_REALS + 2U;
    assert_status(HG_OK, hg_detector_start(&r.self, &c, &memory, HG_START_REST));
    double mode[2] = {8.0, 16.0};
    for (int k = 0; k < 10; k++) {
        give(&r, 0U, 64, 128, true);
        give(&r, 1U, 62, 0, true);
        give(&plain, 0U, 64, 128, true);
        give(&plain, 1U, 62, 0, true);
        assert_int_equal(step(&plain), step(&r));
        for (size_t m = 0U; m < 2U; m++) {
            mode[m] = ((double)decay[m] * mode[m]) + ((k < (int)SM_TAPS) ? 0.0 : (2.0 * SM_HALF));
        }
        assert_real((double)plain.self.J[0] + mode[0] + (2.0 * mode[1]), r.self.J[0]);
        assert_real(plain.self.J[1], r.self.J[1]);
        assert_memory_equal(plain.self.r, r.self.r, 2U * sizeof(hg_real));
    }
    assert_untouched(&real[SM_REALS + 2U], 1U);
}

/* Only corrupted tables bring a number that is not finite as far as a generator. */
static void a_refused_generator_begins_again_and_the_others_go_on(void **state)
{
    (void)state;
    const hg_real bad_middle[] = {REAL_NAN, R(0)};
    hg_hold_config hold[SM_GROUPS] = {sm_hold[0], sm_hold[1]};
    hold[0].middle = bad_middle;
    hg_detector_config c = sm_detector;
    c.hold = hold;
    rig r;
    begin_with(&r, &c, HG_START_REST);
    for (int k = 0; k < 5; k++) {
        give(&r, 0U, 10, 10, true);
        give(&r, 1U, 10, 0, true);
        (void)step(&r);
    }
    give(&r, 0U, HG_CODE_INVALID, 200, true);
    give(&r, 1U, 0, 0, true);
    const uint32_t before = r.self.refusals;
    assert_status(HG_E_NUMERIC, hg_detector_step(&r.self, &r.finding));
    assert_count(before + 1U, r.self.refusals);
    assert_int_equal(HG_PLANT_CONFIRMED, r.finding.plant); /* generator 1 found its fault */
    assert_int_equal(0x2, r.finding.candidates);
    assert_int_equal(0, r.storage.hull[0].k);
    assert_int_equal(HG_START_MOVING, r.storage.hull[0].how);
    assert_false(hg_hull_ready(&r.storage.hull[0]));
    assert_true(hg_hull_ready(&r.storage.hull[1]));
    r.self.refusals = UINT32_MAX;
    give(&r, 0U, HG_CODE_INVALID, 200, true);
    assert_status(HG_E_NUMERIC, hg_detector_step(&r.self, &r.finding));
    assert_true(r.self.refusals == UINT32_MAX);
}

static void two_detectors_share_tables_and_nothing_else(void **state)
{
    (void)state;
    rig a;
    rig b;
    begin(&a, HG_START_REST);
    begin(&b, HG_START_REST);
    for (int k = 0; k < 10; k++) {
        give(&a, 0U, 10, 10, true);
        give(&a, 1U, 10, 0, true);
        give(&b, 0U, 1000, 10 * k * k, true);
        give(&b, 1U, 10, 0, false);
        assert_int_equal(HG_PLANT_NONE, step(&a));
        assert_int_equal(HG_PLANT_CONFIRMED, step(&b));
    }
}

/* The claim of the library: within the bounds no alarm is ever confirmed, whatever the link loses; and a fault is. */
static void no_false_alarm_is_confirmed_whatever_is_lost(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(51U);
    unsigned provisional = 0U;
    for (int run = 0; run < 40; run++) {
        const int32_t loss = (run % 4) * 12;
        rig r;
        hg_trigger sender;
        int32_t sent[2];
        double s1 = 3.0;
        double s2 = -2.0;
        double slope = 0.0;
        uint32_t counter[2] = {0U, 0U};
        uint32_t last[2] = {0U, 0U};
        int confirmed_at = -1;
        assert_status(HG_OK, hg_trigger_start(&sender, &sm_trigger_a, sent));
        begin(&r, HG_START_REST);
        for (int k = 0; k < 1000; k++) {
            const bool fault = k >= 900;
            if ((draw(&random) % 15U) == 0U) {
                slope = (double)draw_between(&random, -3, 3) * 0.0625;
            }
            s2 += ((fabs(s2 + slope) < 40.0) ? slope : 0.0);
            const double move = (double)draw_between(&random, -16, 16) / 64.0;
            s1 += (fabs(s1 + move) < 40.0) ? move : 0.0;
            const double d = (double)draw_between(&random, -15, 15) / 1024.0; /* s0 too moves by at most 1/4 */
            const int32_t a[2] = {hg_code_encode(&sm_scale[0], R(s2 + d + (fault ? 4.0 : 0.0))), hg_code_encode(&sm_scale[1], R(s1))};
            const int32_t b[2] = {hg_code_encode(&sm_scale[0], R(s2)), 0};
            if (hg_trigger_step(&sender, a) == HG_OK) {
                counter[0]++;
                if (draw_between(&random, 0, 99) >= loss) {
                    give(&r, 0U, a[0], a[1], (counter[0] - last[0]) == 1U);
                    last[0] = counter[0];
                } else if ((draw(&random) % 3U) == 0U) {
                    assert_status(HG_OK, hg_detector_lose(&r.self, 0U));
                } else {
                    /* nobody knows yet */
                }
            }
            counter[1]++;
            if (draw_between(&random, 0, 99) >= (loss / 2)) {
                give(&r, 1U, b[0], b[1], (counter[1] - last[1]) == 1U);
                last[1] = counter[1];
            }
            const hg_plant plant = step(&r);
            if (!fault) {
                if (plant == HG_PLANT_CONFIRMED) {
                    print_error("run %d, sample %d: confirmed without a fault\n", run, k);
                    fail();
                }
                provisional += (plant == HG_PLANT_PROVISIONAL) ? 1U : 0U;
            } else if ((plant == HG_PLANT_CONFIRMED) && (confirmed_at < 0)) {
                confirmed_at = k;
            } else {
                /* not yet, or again */
            }
        }
        assert_true(confirmed_at >= 900);
        assert_true(confirmed_at < 930);
    }
    assert_true(provisional > 0U); /* losses did raise alarms that had to be taken back */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(null_pointers_are_refused),
        cmocka_unit_test(memory_one_too_short_is_refused),
        cmocka_unit_test(contradicting_tables_are_refused),
        cmocka_unit_test(contradicting_groups_are_refused),
        cmocka_unit_test(a_rewind_ends_within_a_signals_own_taps),
        cmocka_unit_test(contradicting_generators_are_refused),
        cmocka_unit_test(a_sample_computes_by_hand),
        cmocka_unit_test(groups_that_do_not_exist_are_refused),
        cmocka_unit_test(a_code_that_means_nothing_is_refused_and_counts_as_lost),
        cmocka_unit_test(a_fault_is_confirmed_with_its_candidates),
        cmocka_unit_test(a_lost_frame_takes_a_provisional_alarm_back),
        cmocka_unit_test(a_moving_start_shows_until_it_has_settled),
        cmocka_unit_test(restart_forgets_alarms),
        cmocka_unit_test(a_rewind_ends_where_the_detector_began),
        cmocka_unit_test(a_threshold_with_modes_stands_beside_the_others),
        cmocka_unit_test(a_refused_generator_begins_again_and_the_others_go_on),
        cmocka_unit_test(two_detectors_share_tables_and_nothing_else),
        cmocka_unit_test(no_false_alarm_is_confirmed_whatever_is_lost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
