/** @file
 *  decision.h: alarms to a verdict. */
#include "support.h"

#include "hullguard/decision.h"

static const uint8_t feeds[3] = {0x01U, 0x02U, 0x03U};
static const uint32_t faults[3] = {0x00000003U, 0x80000002U, 0x00000006U};
static const hg_decision_config usual = {.generators = 3U, .feeds = feeds, .faults = faults, .up = 1U, .down = 1U, .latch = false};

typedef struct {
    hg_decision self;
    hg_alarm    alarm[4];
    uint32_t    candidates;
} rig;

static void begin(rig *r, const hg_decision_config *config)
{
    (void)memset(r, 0x5A, sizeof(*r));
    assert_status(HG_OK, hg_decision_start(&r->self, config, r->alarm));
    hg_alarm untouched;
    (void)memset(&untouched, 0x5A, sizeof(untouched));
    assert_memory_equal(&untouched, &r->alarm[3], sizeof(untouched));
}

static hg_plant step(rig *r, uint32_t alarm, uint8_t doubt, uint8_t rewound)
{
    const hg_evidence evidence = {.alarm = alarm, .ready = true, .doubt = doubt, .rewound = rewound};
    r->candidates = 0x5A5A5A5AU;
    return hg_decision_step(&r->self, &evidence, &r->candidates);
}

static void exceeding_is_strict_and_looks_at_magnitudes(void **state)
{
    (void)state;
    const hg_real J[3] = {R(1), R(2), R(3)};
    const hg_real at[3] = {R(1), R(-2), R(3)};
    assert_false(hg_decision_exceeds(at, J, 3U));
    assert_false(hg_decision_exceeds(at, J, 0U));
    const double over = (sizeof(hg_real) == 4U) ? (double)FLT_EPSILON : DBL_EPSILON;
    for (size_t i = 0U; i < 3U; i++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            hg_real r[3] = {R(0), R(0), R(0)};
            r[i] = R((double)sign * (double)J[i] * (1.0 + over));
            assert_true(hg_decision_exceeds(r, J, 3U));
            assert_false(hg_decision_exceeds(r, J, (uint8_t)i));
        }
    }
}

static void a_number_that_is_none_is_an_alarm_not_blindness(void **state)
{
    (void)state;
    const hg_real J[1] = {R(1)};
    const hg_real nan[1] = {REAL_NAN};
    const hg_real inf[1] = {-REAL_INF};
    const hg_real zero[1] = {R(0)};
    assert_true(hg_decision_exceeds(nan, J, 1U));
    assert_true(hg_decision_exceeds(inf, J, 1U));
    assert_true(hg_decision_exceeds(zero, nan, 1U));
}

static void start_tells_null_and_bad_numbers(void **state)
{
    (void)state;
    hg_decision self;
    hg_alarm alarm[HG_GENERATORS_MAX];
    assert_status(HG_E_ARGUMENT, hg_decision_start(NULL, &usual, alarm));
    assert_status(HG_E_ARGUMENT, hg_decision_start(&self, NULL, alarm));
    assert_status(HG_E_ARGUMENT, hg_decision_start(&self, &usual, NULL));
    hg_decision_config c[6];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = usual;
    }
    c[0].generators = 0U;
    c[1].generators = (uint8_t)(HG_GENERATORS_MAX + 1U);
    c[2].up = 0U;
    c[3].down = 0U;
    c[4].feeds = NULL;
    c[5].faults = NULL;
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_status(HG_E_CONFIG, hg_decision_start(&self, &c[i], alarm));
    }
}

static void without_doubt_an_alarm_is_confirmed_at_once_and_heals(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    assert_int_equal(HG_PLANT_NONE, step(&r, 0U, 0xFFU, 0xFFU));
    assert_int_equal(0, r.candidates);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 1U, 0U, 0U));
    assert_int_equal(3, r.candidates);
    assert_int_equal(HG_PLANT_NONE, step(&r, 0U, 0U, 0U));
    assert_int_equal(0, r.candidates);
}

static void only_the_doubt_of_a_feeding_group_counts(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 1U, 0xFEU, 0U));
    begin(&r, &usual);
    assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 1U, 0x01U, 0U));
    assert_int_equal(3, r.candidates);
}

static void the_next_frame_of_the_group_confirms(void **state)
{
    (void)state;
    hg_decision_config c = usual;
    c.latch = true;
    rig r;
    begin(&r, &c);
    assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 4U, 0x03U, 0U));
    assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 0U, 0x02U, 0U)); /* one group has spoken, the other not */
    assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 0U, 0x03U, 0U)); /* new doubt of the first is not the alarm's */
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 0U, 0x01U, 0U));
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 0U, 0x00U, 0xFFU)); /* settled for good */
}

static void a_rewind_takes_the_alarm_back_and_judges_anew(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 1U, 0x01U, 0U));
    assert_int_equal(HG_PLANT_NONE, step(&r, 0U, 0U, 0x01U));
    assert_int_equal(0, r.candidates);
    assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 1U, 0x01U, 0U));
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 1U, 0U, 0x01U)); /* outside the corrected threshold too */
    begin(&r, &usual);
    assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 4U, 0x01U, 0U));
    assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 4U, 0x01U, 0x02U)); /* the rewound group was not in doubt when the alarm was raised */
    assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 4U, 0x01U, 0x01U)); /* judged anew: in doubt again */
}

static void a_rewound_alarm_counts_up_from_the_start(void **state)
{
    (void)state;
    hg_decision_config c = usual;
    c.up = 2U;
    rig r;
    begin(&r, &c);
    assert_int_equal(HG_PLANT_NONE, step(&r, 1U, 0x01U, 0U));
    assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 1U, 0x01U, 0U));
    assert_int_equal(HG_PLANT_NONE, step(&r, 1U, 0U, 0x01U));
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 1U, 0U, 0U));
}

static void debounce_counts_samples_in_a_row(void **state)
{
    (void)state;
    for (uint32_t up = 1U; up <= 255U; up += 127U) {
        for (uint32_t down = 1U; down <= 255U; down += 127U) {
            hg_decision_config c = usual;
            c.up = (uint8_t)up;
            c.down = (uint8_t)down;
            rig r;
            begin(&r, &c);
            for (uint32_t i = 1U; i < up; i++) {
                assert_int_equal(HG_PLANT_NONE, step(&r, 2U, 0U, 0U));
            }
            assert_int_equal(HG_PLANT_NONE, step(&r, 0U, 0U, 0U)); /* a quiet sample starts the count anew */
            for (uint32_t i = 1U; i < up; i++) {
                assert_int_equal(HG_PLANT_NONE, step(&r, 2U, 0U, 0U));
            }
            for (uint32_t i = 0U; i < 600U; i++) { /* the counters do not wrap */
                assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 2U, 0U, 0U));
            }
            for (uint32_t i = 1U; i < down; i++) {
                assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 0U, 0U, 0U));
            }
            assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 2U, 0U, 0U));
            for (uint32_t i = 1U; i < down; i++) {
                assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 0U, 0U, 0U));
            }
            assert_int_equal(HG_PLANT_NONE, step(&r, 0U, 0U, 0U));
            for (uint32_t i = 0U; i < 600U; i++) {
                assert_int_equal(HG_PLANT_NONE, step(&r, 0U, 0U, 0U));
            }
        }
    }
}

/* However long it was quiet while the alarm was in doubt: the count stays at its limit. */
static void a_long_quiet_is_not_forgotten(void **state)
{
    (void)state;
    static const uint8_t limits[] = {1U, 7U, 255U};
    for (size_t i = 0U; i < COUNT(limits); i++) {
        hg_decision_config c = usual;
        c.down = limits[i];
        for (uint32_t quiet = 250U; quiet < 520U; quiet++) {
            rig r;
            begin(&r, &c);
            assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 1U, 1U, 0U));
            for (uint32_t k = 0U; k < quiet; k++) {
                assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 0U, 1U, 0U));
            }
            assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 0U, 0U, 0U));
            assert_int_equal(((quiet + 2U) >= limits[i]) ? HG_PLANT_NONE : HG_PLANT_CONFIRMED, step(&r, 0U, 0U, 0U));
        }
    }
}

static void a_latched_alarm_stays_until_reset(void **state)
{
    (void)state;
    hg_decision_config c = usual;
    c.latch = true;
    rig r;
    begin(&r, &c);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 2U, 0U, 0U));
    for (int i = 0; i < 600; i++) {
        assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 0U, 0x03U, 0x03U));
        assert_true(r.candidates == 0x80000002U);
    }
    hg_decision_reset(&r.self);
    assert_int_equal(HG_PLANT_NONE, step(&r, 0U, 0U, 0U));
}

static void candidates_move_every_generator_in_alarm(void **state)
{
    (void)state;
    const uint32_t expected[8] = {0U, 0x3U, 0x80000002U, 0x2U, 0x6U, 0x2U, 0x2U, 0x2U};
    for (uint32_t alarm = 1U; alarm < 8U; alarm++) {
        rig r;
        begin(&r, &usual);
        assert_int_equal(HG_PLANT_CONFIRMED, step(&r, alarm, 0U, 0U));
        assert_true(expected[alarm] == r.candidates);
        begin(&r, &usual);
        (void)step(&r, alarm, 0xFFU, 0U);
        assert_true(expected[alarm] == r.candidates); /* provisional ones count too */
    }
}

static void candidates_narrow_over_an_episode_and_are_all_there_again_after_it(void **state)
{
    (void)state;
    hg_decision_config c = usual;
    c.down = 2U;
    rig r;
    begin(&r, &c);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 1U, 0U, 0U));
    assert_int_equal(0x3, r.candidates);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 4U, 0U, 0U)); /* the first has not healed */
    assert_int_equal(0x2, r.candidates);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 4U, 0U, 0U)); /* the first has healed and counts on */
    assert_int_equal(HG_PLANT_NONE, (int)r.alarm[0].state);
    assert_int_equal(0x2, r.candidates);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 0U, 0U, 0U));
    assert_int_equal(0x2, r.candidates);
    assert_int_equal(HG_PLANT_NONE, step(&r, 0U, 0U, 0U));
    assert_int_equal(0, r.candidates);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 4U, 0U, 0U)); /* a new episode */
    assert_int_equal(0x6, r.candidates);
}

static void no_single_fault_stays_no_single_fault_until_the_episode_is_over(void **state)
{
    (void)state;
    const uint32_t apart[3] = {1U, 2U, 4U};
    hg_decision_config c = usual;
    c.faults = apart;
    rig r;
    begin(&r, &c);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 3U, 0U, 0U));
    assert_int_equal(0, r.candidates);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 1U, 0U, 0U));
    assert_int_equal(0, r.candidates);
    assert_int_equal(HG_PLANT_NONE, step(&r, 0U, 0U, 0U));
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 1U, 0U, 0U));
    assert_int_equal(1, r.candidates);
}

/* A provisional alarm may be taken back: what it suggests must not outlive it. */
static void a_provisional_alarm_narrows_nothing_for_good(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 1U, 0U, 0U));
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 5U, 0x02U, 0U)); /* a provisional one beside it */
    assert_int_equal(0x3, r.candidates);
    assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 4U, 0x02U, 0U)); /* the first has healed: the episode goes on */
    assert_int_equal(0x2, r.candidates);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 1U, 0U, 0x02U)); /* taken back */
    assert_int_equal(0x3, r.candidates);
    begin(&r, &usual);
    assert_int_equal(HG_PLANT_PROVISIONAL, step(&r, 1U, 0x01U, 0U));
    assert_int_equal(0x3, r.candidates);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 4U, 0U, 0x01U)); /* only the other stands */
    assert_int_equal(0x6, r.candidates);
}

static void an_episode_ends_in_starting_too_and_with_a_reset(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 1U, 0U, 0U));
    const hg_evidence quiet = {.alarm = 0U, .ready = false, .doubt = 0U, .rewound = 0U};
    assert_int_equal(HG_PLANT_STARTING, hg_decision_step(&r.self, &quiet, &r.candidates));
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 4U, 0U, 0U));
    assert_int_equal(0x6, r.candidates);
    hg_decision_reset(&r.self);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 1U, 0U, 0U));
    assert_int_equal(0x3, r.candidates);
}

static void the_worst_generator_is_the_plants_state(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 3U, 0x01U, 0U)); /* the first provisional, the second confirmed */
    begin(&r, &usual);
    assert_int_equal(HG_PLANT_CONFIRMED, step(&r, 3U, 0x02U, 0U)); /* the other way round */
}

static void starting_shows_unless_there_is_an_alarm(void **state)
{
    (void)state;
    rig r;
    begin(&r, &usual);
    hg_evidence evidence = {.alarm = 0U, .ready = false, .doubt = 0U, .rewound = 0U};
    assert_int_equal(HG_PLANT_STARTING, hg_decision_step(&r.self, &evidence, &r.candidates));
    assert_int_equal(0, r.candidates);
    evidence.alarm = 1U;
    assert_int_equal(HG_PLANT_CONFIRMED, hg_decision_step(&r.self, &evidence, &r.candidates));
    assert_int_equal(3, r.candidates);
}

static void all_thirty_two_generators_have_a_bit(void **state)
{
    (void)state;
    uint8_t all_feeds[HG_GENERATORS_MAX] = {0U};
    uint32_t all_faults[HG_GENERATORS_MAX];
    hg_alarm alarm[HG_GENERATORS_MAX];
    for (uint32_t g = 0U; g < HG_GENERATORS_MAX; g++) {
        all_faults[g] = (uint32_t)1U << g;
    }
    const hg_decision_config c = {.generators = (uint8_t)HG_GENERATORS_MAX, .feeds = all_feeds, .faults = all_faults, .up = 1U,
        .down = 1U, .latch = false};
    hg_decision self;
    assert_status(HG_OK, hg_decision_start(&self, &c, alarm));
    for (uint32_t g = 0U; g < HG_GENERATORS_MAX; g++) {
        const hg_evidence evidence = {.alarm = (uint32_t)1U << g, .ready = true, .doubt = 0U, .rewound = 0U};
        uint32_t candidates = 0U;
        hg_decision_reset(&self);
        assert_int_equal(HG_PLANT_CONFIRMED, hg_decision_step(&self, &evidence, &candidates));
        assert_true(candidates == ((uint32_t)1U << g));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(exceeding_is_strict_and_looks_at_magnitudes),
        cmocka_unit_test(a_number_that_is_none_is_an_alarm_not_blindness),
        cmocka_unit_test(start_tells_null_and_bad_numbers),
        cmocka_unit_test(without_doubt_an_alarm_is_confirmed_at_once_and_heals),
        cmocka_unit_test(only_the_doubt_of_a_feeding_group_counts),
        cmocka_unit_test(the_next_frame_of_the_group_confirms),
        cmocka_unit_test(a_rewind_takes_the_alarm_back_and_judges_anew),
        cmocka_unit_test(a_rewound_alarm_counts_up_from_the_start),
        cmocka_unit_test(debounce_counts_samples_in_a_row),
        cmocka_unit_test(a_long_quiet_is_not_forgotten),
        cmocka_unit_test(a_latched_alarm_stays_until_reset),
        cmocka_unit_test(candidates_move_every_generator_in_alarm),
        cmocka_unit_test(candidates_narrow_over_an_episode_and_are_all_there_again_after_it),
        cmocka_unit_test(no_single_fault_stays_no_single_fault_until_the_episode_is_over),
        cmocka_unit_test(a_provisional_alarm_narrows_nothing_for_good),
        cmocka_unit_test(an_episode_ends_in_starting_too_and_with_a_reset),
        cmocka_unit_test(the_worst_generator_is_the_plants_state),
        cmocka_unit_test(starting_shows_unless_there_is_an_alarm),
        cmocka_unit_test(all_thirty_two_generators_have_a_bit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
