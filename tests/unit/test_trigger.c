/** @file
 *  trigger.h: when a sender speaks, and what its silence promises. */
#include "support.h"

#include "hullguard/trigger.h"

#define WIDTH 2U
#define LEVELS 3U

static const uint8_t silence_table[LEVELS] = {3U, 1U, 0U};
static const uint16_t delta_table[LEVELS * WIDTH] = {6554U, 0U, 3277U, 0U, 0U, 0U};
static const int32_t sigma_table[LEVELS * WIDTH] = {10, 4, 5, 2, 1, 0};
static const int32_t activity_table[LEVELS * WIDTH] = {INT32_MIN, INT32_MIN, 20, 30, 100, 200};
static const int32_t zero_table[WIDTH] = {0, 1000};

static const hg_trigger_config usual = {.width = WIDTH,
                                        .levels = LEVELS,
                                        .interval_max = 6U,
                                        .silence = silence_table,
                                        .delta = delta_table,
                                        .sigma = sigma_table,
                                        .activity = activity_table,
                                        .zero = zero_table};

static void start_refuses_null(void **state)
{
    (void)state;
    hg_trigger self;
    int32_t codes[WIDTH];
    assert_status(HG_E_ARGUMENT, hg_trigger_start(NULL, &usual, codes));
    assert_status(HG_E_ARGUMENT, hg_trigger_start(&self, NULL, codes));
    assert_status(HG_E_ARGUMENT, hg_trigger_start(&self, &usual, NULL));
}

static void refuse(const hg_trigger_config *config)
{
    hg_trigger self;
    hg_trigger before;
    int32_t codes[WIDTH];
    (void)memset(&self, 0x5A, sizeof(self));
    (void)memcpy(&before, &self, sizeof(self));
    arm_codes(codes, WIDTH);
    assert_false(hg_trigger_valid(config));
    assert_status(HG_E_CONFIG, hg_trigger_start(&self, config, codes));
    assert_memory_equal(&before, &self, sizeof(self));
    assert_codes_untouched(codes, WIDTH);
}

static void tables_outside_their_ranges_are_refused(void **state)
{
    (void)state;
    const int32_t negative[LEVELS * WIDTH] = {10, 4, 5, 2, 1, -1};
    const uint8_t too_silent[LEVELS] = {3U, 1U, 6U};
    const uint8_t too_silent_at_first[LEVELS] = {6U, 1U, 0U};
    hg_trigger_config c = usual;
    assert_true(hg_trigger_valid(&c));
    c.width = (uint8_t)(HG_GROUP_SIGNALS_MAX + 1U);
    refuse(&c);
    c = usual, c.levels = 0U;
    refuse(&c);
    c = usual, c.levels = (uint8_t)(HG_LEVELS_MAX + 1U);
    refuse(&c);
    c = usual, c.interval_max = 0U;
    refuse(&c);
    c = usual, c.silence = NULL;
    refuse(&c);
    c = usual, c.silence = too_silent;
    refuse(&c);
    c = usual, c.silence = too_silent_at_first;
    refuse(&c);
    c = usual, c.delta = NULL;
    refuse(&c);
    c = usual, c.sigma = NULL;
    refuse(&c);
    c = usual, c.sigma = negative;
    refuse(&c);
    c = usual, c.activity = NULL;
    refuse(&c);
    c = usual, c.zero = NULL;
    refuse(&c);
    for (uint8_t i = 0U; i < (LEVELS * WIDTH); i++) { /* each place of the table is looked at */
        int32_t one_negative[LEVELS * WIDTH] = {0};
        one_negative[i] = -1;
        c = usual, c.sigma = one_negative;
        refuse(&c);
    }
    c = usual, c.width = 1U, c.delta = NULL;
    refuse(&c);
}

static void the_largest_tables_are_taken(void **state)
{
    (void)state;
    static const uint16_t delta[HG_LEVELS_MAX * HG_GROUP_SIGNALS_MAX];
    static const int32_t none[HG_LEVELS_MAX * HG_GROUP_SIGNALS_MAX];
    static const uint8_t silence[HG_LEVELS_MAX];
    const hg_trigger_config c = {.width = HG_GROUP_SIGNALS_MAX, .levels = HG_LEVELS_MAX, .interval_max = 1U, .silence = silence, .delta = delta, .sigma = none,
        .activity = none, .zero = none};
    assert_true(hg_trigger_valid(&c));
}

/* Whatever was in the memory: nothing sent, the first level, no age. */
static void a_start_leaves_nothing_undefined(void **state)
{
    (void)state;
    hg_trigger self;
    int32_t codes[WIDTH + 1U];
    (void)memset(&self, 0x5A, sizeof(self));
    arm_codes(codes, COUNT(codes));
    assert_status(HG_OK, hg_trigger_start(&self, &usual, codes));
    assert_int_equal(0, self.level);
    assert_int_equal(0, self.age);
    assert_false(self.started);
    assert_int_equal(HG_CODE_INVALID, codes[0]);
    assert_int_equal(HG_CODE_INVALID, codes[1]);
    assert_codes_untouched(&codes[WIDTH], 1U);
}

/* Each channel deviates by the threshold of what it has sent itself. */
static void a_threshold_is_that_of_its_own_channel(void **state)
{
    (void)state;
    const uint16_t half[WIDTH] = {32768U, 32768U};
    const int32_t none[WIDTH] = {0, 0};
    const uint8_t quiet[] = {0U};
    const hg_trigger_config c = {.width = WIDTH, .levels = 1U, .interval_max = 200U, .silence = quiet, .delta = half, .sigma = none, .activity = none, .zero = none};
    hg_trigger self;
    int32_t codes[WIDTH];
    for (int32_t own = 0; own < 2; own++) {
        const int32_t sent[WIDTH] = {(own == 0) ? 1000 : 20, (own == 0) ? 20 : 1000};
        const int32_t silent[WIDTH] = {(own == 0) ? 1500 : 20, (own == 0) ? 20 : 1500};
        const int32_t far[WIDTH] = {(own == 0) ? 1000 : 31, (own == 0) ? 31 : 1000};
        assert_status(HG_OK, hg_trigger_start(&self, &c, codes));
        assert_status(HG_OK, hg_trigger_step(&self, sent));
        assert_status(HG_E_EMPTY, hg_trigger_step(&self, silent));
        assert_status(HG_OK, hg_trigger_step(&self, far));
    }
}

static void the_threshold_is_absolute_plus_relative(void **state)
{
    (void)state;
    assert_int_equal(10, hg_trigger_threshold(&usual, 0U, 0U, 0));
    assert_int_equal(10 + 100, hg_trigger_threshold(&usual, 0U, 0U, 1000));   /* 6554 / 65536 of 1000, rounded down */
    assert_int_equal(10 + 100, hg_trigger_threshold(&usual, 0U, 0U, -1000));
    assert_int_equal(5 + 50, hg_trigger_threshold(&usual, 1U, 0U, 1000));
    assert_int_equal(4, hg_trigger_threshold(&usual, 0U, 1U, 5000));
    assert_int_equal(0, hg_trigger_threshold(&usual, 0U, 0U, HG_CODE_INVALID));
    assert_int_equal(0, hg_trigger_threshold(&usual, 2U, 1U, 0));
}

static void the_relative_part_counts_from_the_code_of_zero(void **state)
{
    (void)state;
    const uint16_t half[] = {32768U};
    const int32_t none[] = {0};
    const uint8_t quiet[] = {0U};
    const int32_t zero[] = {-2000000000};
    const hg_trigger_config c = {.width = 1U, .levels = 1U, .interval_max = 2U, .silence = quiet, .delta = half, .sigma = none,
        .activity = none, .zero = zero};
    assert_int_equal(0, hg_trigger_threshold(&c, 0U, 0U, -2000000000));
    assert_int_equal(5, hg_trigger_threshold(&c, 0U, 0U, -1999999990));
    assert_int_equal(2000000000, hg_trigger_threshold(&c, 0U, 0U, 2000000000)); /* the distance alone exceeds 31 bits */
}

static void the_threshold_saturates(void **state)
{
    (void)state;
    const uint16_t most[] = {65535U};
    const int32_t sigma[] = {INT32_MAX};
    const uint8_t quiet[] = {0U};
    const int32_t zero[] = {-INT32_MAX};
    const hg_trigger_config c = {.width = 1U, .levels = 1U, .interval_max = 2U, .silence = quiet, .delta = most, .sigma = sigma,
        .activity = sigma, .zero = zero};
    assert_int_equal(INT32_MAX, hg_trigger_threshold(&c, 0U, 0U, -INT32_MAX));
    assert_int_equal(INT32_MAX, hg_trigger_threshold(&c, 0U, 0U, INT32_MAX));
}

static void the_level_is_the_highest_activity_in_any_channel(void **state)
{
    (void)state;
    const int32_t previous[WIDTH] = {0, 0};
    const struct { int32_t a; int32_t b; uint8_t level; } cases[] = {
        {0, 0, 0U}, {19, 29, 0U}, {20, 0, 1U}, {-20, 0, 1U}, {0, 30, 1U}, {99, 199, 1U}, {100, 0, 2U}, {0, -200, 2U},
        {HG_CODE_INVALID, 0, 2U}, {0, HG_CODE_INVALID, 2U}};
    const int32_t next_to_invalid[WIDTH] = {HG_CODE_INVALID + 1, 0};
    const int32_t invalid[WIDTH] = {HG_CODE_INVALID, 0};
    assert_int_equal(2, hg_trigger_level(&usual, invalid, next_to_invalid)); /* however near their codes are */
    assert_int_equal(2, hg_trigger_level(&usual, next_to_invalid, invalid));
    for (size_t i = 0U; i < COUNT(cases); i++) {
        const int32_t sent[WIDTH] = {cases[i].a, cases[i].b};
        assert_int_equal(cases[i].level, hg_trigger_level(&usual, sent, previous));
        assert_int_equal(cases[i].level, hg_trigger_level(&usual, previous, sent));
    }
    const int32_t low[WIDTH] = {-INT32_MAX, 0};
    const int32_t high[WIDTH] = {INT32_MAX, 0};
    assert_int_equal(2, hg_trigger_level(&usual, low, high)); /* the difference does not fit 32 bits */
}

static void the_first_step_sends_whatever_the_codes(void **state)
{
    (void)state;
    const int32_t nothing[WIDTH] = {HG_CODE_INVALID, HG_CODE_INVALID};
    hg_trigger self;
    int32_t codes[WIDTH + 1U];
    arm_codes(codes, WIDTH + 1U);
    assert_status(HG_OK, hg_trigger_start(&self, &usual, codes));
    assert_int_equal(HG_CODE_INVALID, codes[0]);
    assert_status(HG_OK, hg_trigger_step(&self, nothing));
    assert_status(HG_OK, hg_trigger_start(&self, &usual, codes));
    const int32_t some[WIDTH] = {5, -5};
    assert_status(HG_OK, hg_trigger_step(&self, some));
    assert_int_equal(5, codes[0]);
    assert_int_equal(-5, codes[1]);
    assert_codes_untouched(&codes[WIDTH], 1U);
}

static void a_deviation_equal_to_the_threshold_is_silent(void **state)
{
    (void)state;
    const int32_t at[WIDTH] = {0, 1000};
    const int32_t edge[WIDTH] = {10, 1004};
    const int32_t over_first[WIDTH] = {-11, 1000};
    const int32_t over_second[WIDTH] = {0, 995};
    const int32_t *const over[] = {over_first, over_second};
    for (size_t i = 0U; i < 2U; i++) {
        hg_trigger self;
        int32_t codes[WIDTH];
        assert_status(HG_OK, hg_trigger_start(&self, &usual, codes));
        assert_status(HG_OK, hg_trigger_step(&self, at));
        for (int j = 0; j < 3; j++) {
            assert_status(HG_E_EMPTY, hg_trigger_step(&self, over[i])); /* the sender does not look yet */
        }
        assert_status(HG_E_EMPTY, hg_trigger_step(&self, edge));
        assert_status(HG_OK, hg_trigger_step(&self, over[i]));
    }
}

static void becoming_or_ceasing_to_be_invalid_is_worth_a_frame(void **state)
{
    (void)state;
    const int32_t zero = 0;
    const int32_t huge = INT32_MAX;
    const uint16_t none = 0U;
    const uint8_t quiet = 0U;
    const hg_trigger_config c = {
        .width = 1U, .levels = 1U, .interval_max = 200U, .silence = &quiet, .delta = &none, .sigma = &huge, .activity = &zero,
            .zero = &zero};
    hg_trigger self;
    int32_t codes;
    const int32_t invalid = HG_CODE_INVALID;
    assert_status(HG_OK, hg_trigger_start(&self, &c, &codes));
    assert_status(HG_OK, hg_trigger_step(&self, &zero));
    assert_status(HG_E_EMPTY, hg_trigger_step(&self, &huge));
    assert_status(HG_OK, hg_trigger_step(&self, &invalid));
    assert_status(HG_E_EMPTY, hg_trigger_step(&self, &invalid));
    assert_status(HG_OK, hg_trigger_step(&self, &zero));
}

/* The code next to HG_CODE_INVALID is a value: however wide the threshold, each channel tells the one from the other by its own codes. */
static void validity_is_not_a_matter_of_distance(void **state)
{
    (void)state;
    const uint16_t none[WIDTH] = {0U, 0U};
    const int32_t wide[WIDTH] = {INT32_MAX, INT32_MAX};
    const uint8_t quiet[] = {0U};
    const int32_t zero[WIDTH] = {0, 0};
    const hg_trigger_config c = {.width = WIDTH, .levels = 1U, .interval_max = 200U, .silence = quiet, .delta = none, .sigma = wide, .activity = zero, .zero = zero};
    hg_trigger self;
    int32_t codes[WIDTH];
    for (size_t g = 0U; g < WIDTH; g++) {
        const int32_t valid[WIDTH + 1U] = {HG_CODE_INVALID + 1, HG_CODE_INVALID + 1, HG_CODE_INVALID};
        int32_t without[WIDTH + 1U] = {HG_CODE_INVALID + 1, HG_CODE_INVALID + 1, 0};
        without[g] = HG_CODE_INVALID;
        assert_status(HG_OK, hg_trigger_start(&self, &c, codes));
        assert_status(HG_OK, hg_trigger_step(&self, valid));
        assert_status(HG_E_EMPTY, hg_trigger_step(&self, valid));
        assert_status(HG_OK, hg_trigger_step(&self, without));
        assert_status(HG_E_EMPTY, hg_trigger_step(&self, without));
        assert_status(HG_OK, hg_trigger_step(&self, valid));
    }
}

static void a_bare_tick_is_periodic(void **state)
{
    (void)state;
    const uint8_t quiet = 0U;
    const hg_trigger_config c = {.width = 0U, .levels = 1U, .interval_max = 1U, .silence = &quiet};
    hg_trigger self;
    int32_t codes = CANARY_CODE;
    assert_true(hg_trigger_valid(&c));
    assert_status(HG_OK, hg_trigger_start(&self, &c, &codes));
    for (int i = 0; i < 300; i++) {
        assert_status(HG_OK, hg_trigger_step(&self, &codes));
    }
    assert_codes_untouched(&codes, 1U);
    const hg_trigger_config slow = {.width = 0U, .levels = 1U, .interval_max = 255U, .silence = &quiet};
    assert_status(HG_OK, hg_trigger_start(&self, &slow, &codes));
    for (int i = 0; i < 1000; i++) {
        assert_status(((i % 255) == 0) ? HG_OK : HG_E_EMPTY, hg_trigger_step(&self, &codes));
    }
}

/* Every silence table of two levels, every interval_max up to 6, codes at random: the interval lies in (silence, interval_max], and
 * silence beyond it keeps its promise. */
static void intervals_and_promises_hold_over_all_small_configurations(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(3U);
    const uint16_t delta[2] = {16384U, 0U};
    const int32_t sigma[2] = {2, 1};
    const int32_t activity[2] = {0, 6};
    const int32_t zero[1] = {0};
    for (uint8_t interval_max = 1U; interval_max <= 6U; interval_max++) {
        for (uint8_t h0 = 0U; h0 < interval_max; h0++) {
            for (uint8_t h1 = 0U; h1 < interval_max; h1++) {
                const uint8_t quiet[2] = {h0, h1};
                const hg_trigger_config c = {
                    .width = 1U, .levels = 2U, .interval_max = interval_max, .silence = quiet, .delta = delta, .sigma = sigma,
                        .activity = activity, .zero = zero};
                hg_trigger self;
                int32_t sent;
                int32_t shadow = 0;
                int32_t code = 0;
                int interval = 0;
                uint8_t level = 0U;
                assert_status(HG_OK, hg_trigger_start(&self, &c, &sent));
                for (int k = 0; k < 600; k++) {
                    code += draw_between(&random, -4, 4);
                    const hg_status status = hg_trigger_step(&self, &code);
                    interval++;
                    if (status == HG_OK) {
                        if (k > 0) {
                            assert_true(interval > (int)quiet[level]);
                            assert_true(interval <= (int)interval_max);
                            level = (abs(code - shadow) >= 6) ? 1U : 0U;
                        }
                        shadow = code;
                        interval = 0;
                    } else {
                        assert_status(HG_E_EMPTY, status);
                        assert_true(interval < (int)interval_max);
                        if (interval > (int)quiet[level]) {
                            assert_true(abs(code - shadow) <= (sigma[level] + ((int32_t)delta[level] * abs(shadow) / 65536)));
                        }
                    }
                    assert_int_equal(shadow, sent);
                    assert_int_equal(level, self.level);
                }
            }
        }
    }
}

static void two_senders_do_not_know_of_each_other(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(5U);
    hg_trigger alone;
    hg_trigger a;
    hg_trigger b;
    int32_t codes[3][WIDTH];
    assert_status(HG_OK, hg_trigger_start(&alone, &usual, codes[0]));
    assert_status(HG_OK, hg_trigger_start(&a, &usual, codes[1]));
    assert_status(HG_OK, hg_trigger_start(&b, &usual, codes[2]));
    for (int k = 0; k < 500; k++) {
        const int32_t code[WIDTH] = {draw_between(&random, -50, 50), draw_between(&random, 950, 1050)};
        const int32_t other[WIDTH] = {draw_between(&random, -500, 500), draw_between(&random, 0, 2000)};
        const hg_status expected = hg_trigger_step(&alone, code);
        assert_status(expected, hg_trigger_step(&a, code));
        (void)hg_trigger_step(&b, other);
        assert_memory_equal(codes[0], codes[1], sizeof(codes[0]));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_refuses_null),
        cmocka_unit_test(tables_outside_their_ranges_are_refused),
        cmocka_unit_test(the_largest_tables_are_taken),
        cmocka_unit_test(a_start_leaves_nothing_undefined),
        cmocka_unit_test(a_threshold_is_that_of_its_own_channel),
        cmocka_unit_test(the_threshold_is_absolute_plus_relative),
        cmocka_unit_test(the_relative_part_counts_from_the_code_of_zero),
        cmocka_unit_test(the_threshold_saturates),
        cmocka_unit_test(the_level_is_the_highest_activity_in_any_channel),
        cmocka_unit_test(the_first_step_sends_whatever_the_codes),
        cmocka_unit_test(a_deviation_equal_to_the_threshold_is_silent),
        cmocka_unit_test(becoming_or_ceasing_to_be_invalid_is_worth_a_frame),
        cmocka_unit_test(validity_is_not_a_matter_of_distance),
        cmocka_unit_test(a_bare_tick_is_periodic),
        cmocka_unit_test(intervals_and_promises_hold_over_all_small_configurations),
        cmocka_unit_test(two_senders_do_not_know_of_each_other),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
