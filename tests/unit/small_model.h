/** @file
 *  A model small enough to compute by hand: three signals s0, s1, s2 that move by at most 1/4 a sample, and s0 = s2 + d with |d| <= 1/16.
 *  Group 0 sends s0 and s1 by events, group 1 sends s2 every sample and closes it.
 *      generator 0: r = s0 - s2                 (faults 0 and 2)
 *      generator 1: r(k) = s1(k) - s1(k-1)      (fault 1)
 *  All numbers are multiples of powers of two, so that both number types give the same. */
#ifndef HULLGUARD_TESTS_SMALL_MODEL_H
#define HULLGUARD_TESTS_SMALL_MODEL_H

#include "hullguard/node.h"

#define SM_SIGNALS 3U
#define SM_GROUPS 2U
#define SM_GENERATORS 2U
#define SM_TAPS 5U
#define SM_HISTORY (SM_TAPS + 1U)
#define SM_CODES HG_HOLD_CODES(SM_SIGNALS)
#define SM_REALS ((2U * SM_SIGNALS) + HG_HOLD_REALS(SM_SIGNALS) + (2U * 2U) + (SM_SIGNALS * SM_HISTORY) + 4U + 3U + 2U)
#define SM_RESOLUTION 0.015625
#define SM_HALF 0.0078125
#define SM_SPAN 94.0
#define SM_LIMIT 3000
#define SM_SLEW(j) R((0.25 * (j)) + SM_HALF)

static const uint8_t sm_silence_a[] = {1U, 0U};
static const uint16_t sm_delta[] = {0U, 0U, 0U, 0U};
static const int32_t sm_sigma_a[] = {16, 16, 4, 4};
static const int32_t sm_activity_a[] = {0, 0, 24, 24};
static const int32_t sm_zero[] = {0, 0};
static const hg_trigger_config sm_trigger_a = {.width = 2U, .levels = 2U, .interval_max = 4U, .silence = sm_silence_a, .delta = sm_delta,
                                               .sigma = sm_sigma_a, .activity = sm_activity_a, .zero = sm_zero};
static const uint8_t sm_silence_b[] = {0U};
static const hg_trigger_config sm_trigger_b = {.width = 1U, .levels = 1U, .interval_max = 1U, .silence = sm_silence_b, .delta = sm_delta,
                                               .sigma = sm_zero, .activity = sm_zero, .zero = sm_zero};

static const hg_code_scale sm_scale[] = {{R(SM_RESOLUTION), R(0), R(64), 0, -SM_LIMIT, SM_LIMIT}, {R(SM_RESOLUTION), R(0), R(64), 0,
    -SM_LIMIT, SM_LIMIT}};
static const hg_real sm_half[] = {R(SM_HALF), R(SM_HALF)};
static const hg_real sm_span[] = {R(SM_SPAN), R(SM_SPAN)};
static const hg_real sm_middle[] = {R(0), R(0)};
static const hg_real sm_slew_a[] = {SM_SLEW(1), SM_SLEW(1), SM_SLEW(2), SM_SLEW(2), SM_SLEW(3), SM_SLEW(3),
                                    SM_SLEW(4), SM_SLEW(4), SM_SLEW(5), SM_SLEW(5), SM_SLEW(6), SM_SLEW(6)};
static const hg_real sm_slew_b[] = {SM_SLEW(1), SM_SLEW(2), SM_SLEW(3), SM_SLEW(4)};
static const hg_hold_config sm_hold[SM_GROUPS] = {
    {.trigger = &sm_trigger_a, .margin = 2U, .scale = sm_scale, .half = sm_half, .slew = sm_slew_a, .span = sm_span, .middle = sm_middle},
    {.trigger = &sm_trigger_b, .margin = 3U, .scale = sm_scale, .half = sm_half, .slew = sm_slew_b, .span = sm_span, .middle = sm_middle}};

static const hg_real sm_none[] = {R(0), R(0)};
static const hg_real sm_one[] = {R(1), R(1)};
static const hg_real sm_minus_one[] = {R(-1)};
static const hg_real sm_difference[] = {R(1), R(-1)};
static const uint8_t sm_signals_0[] = {0U, 2U};
static const uint8_t sm_signals_1[] = {1U};
static const hg_residual_config sm_residual[SM_GENERATORS] = {
    {.order = 1U, .residuals = 1U, .width = 2U, .signal = sm_signals_0, .state = {1U, 1U, 0, sm_none}, .input = {1U, 2U, 0, sm_none},
     .output = {1U, 1U, 0, sm_none}, .direct = {1U, 2U, 0, sm_difference}},
    {.order = 1U, .residuals = 1U, .width = 1U, .signal = sm_signals_1, .state = {1U, 1U, 0, sm_none}, .input = {1U, 1U, 0, sm_one},
     .output = {1U, 1U, 0, sm_minus_one}, .direct = {1U, 1U, 0, sm_one}}};

static const uint8_t sm_taps[] = {SM_TAPS, SM_TAPS};
static const hg_real sm_weight_0[(SM_TAPS + 1U) * 2U] = {[0] = R(1), [SM_TAPS + 1U] = R(1)};
static const hg_real sm_weight_1[SM_TAPS + 1U] = {R(1), R(1)};
static const hg_real sm_start_0[] = {R(64)};
static const hg_real sm_bias_0[] = {R(0.0625)};
static const hg_real sm_start_1[] = {R(64)};
static const hg_real sm_bias_1[] = {R(0.25)};
static const hg_hull_config sm_hull[SM_GENERATORS] = {
    {.residuals = 1U, .width = 2U, .signal = sm_signals_0, .taps = sm_taps, .weight = sm_weight_0, .settle = 1U, .rest = sm_bias_0,
     .rest_left = sm_none, .moving = sm_start_0, .moving_left = sm_none, .bias = sm_bias_0, .ready_rest = 0U, .ready_moving = 3U,
     .decay = sm_none},
    {.residuals = 1U, .width = 1U, .signal = sm_signals_1, .taps = sm_taps, .weight = sm_weight_1, .settle = 1U, .rest = sm_start_1,
     .rest_left = sm_none, .moving = sm_start_1, .moving_left = sm_none, .bias = sm_bias_1, .ready_rest = 0U, .ready_moving = 2U,
     .decay = sm_none}};

static const uint8_t sm_feeds[] = {0x3U, 0x1U};
static const uint32_t sm_faults[] = {0x5U, 0x2U};
static const hg_detector_config sm_detector = {
    .signals = SM_SIGNALS, .width = SM_SIGNALS, .groups = SM_GROUPS, .hold = sm_hold, .generators = SM_GENERATORS, .residual = sm_residual, .hull = sm_hull,
    .decision = {.generators = SM_GENERATORS, .feeds = sm_feeds, .faults = sm_faults, .up = 1U, .down = 3U, .latch = false},
    .history = SM_HISTORY, .residuals = 2U, .codes = SM_CODES, .reals = SM_REALS};

typedef struct {
    hg_hold     hold[SM_GROUPS];
    hg_residual residual[SM_GENERATORS];
    hg_hull     hull[SM_GENERATORS];
    hg_alarm    alarm[SM_GENERATORS];
    int32_t     code[SM_CODES + 1U]; /* one more each, for the canary */
    hg_real     real[SM_REALS + 1U];
} sm_storage;

static inline hg_detector_memory sm_memory(sm_storage *s)
{
    arm_codes(s->code, SM_CODES + 1U);
    arm(s->real, SM_REALS + 1U);
    return (hg_detector_memory){.hold = s->hold, .residual = s->residual, .hull = s->hull, .alarm = s->alarm,
                                .code = s->code, .codes = SM_CODES, .real = s->real, .reals = SM_REALS};
}

static inline void sm_check_canaries(const sm_storage *s)
{
    assert_codes_untouched(&s->code[SM_CODES], 1U);
    assert_untouched(&s->real[SM_REALS], 1U);
}

#endif
