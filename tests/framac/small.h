/* Two signals, and of all that a detector may have one, as small as it can be: what runs here is the code, not a plant. Numbers are such that they fit every
   number type, and their sums too. Signal vector: 0 by events, 1 every sample (it closes them), 2 the first one predicted, 3 what an uncertain plant may do. */
#ifndef HULLGUARD_FRAMAC_SMALL_H
#define HULLGUARD_FRAMAC_SMALL_H

#include "drive.h"

#include "hullguard/selftest.h"

#define SIGNALS 2U
#define GROUPS 2U
#define WIDTH 4U
#define HISTORY 4U
#define WINDOW 2U
#define CERTIFICATES 2U
#define MODES 1U
#define SAMPLES 2U /* of a freeze frame */

static const hg_real numbers[] = {HG_REAL_C(0.125), HG_REAL_C(0.125), HG_REAL_C(0.25), HG_REAL_C(0.25), HG_REAL_C(0.375), HG_REAL_C(0.375)};
static const hg_real span[] = {HG_REAL_C(0.9375), HG_REAL_C(0.9375)};

static const uint8_t silence[] = {1U, 0U};
static const uint16_t delta[] = {64U, 32U};
static const int32_t sigma[] = {16, 4};
static const int32_t activity[] = {0, 24};
static const int32_t zero[] = {0};
static const hg_trigger_config trigger[GROUPS] = {
    {.width = 1U, .levels = 2U, .interval_max = 3U, .silence = silence, .delta = delta, .sigma = sigma, .activity = activity, .zero = zero},
    {.width = 1U, .levels = 1U, .interval_max = 1U, .silence = &silence[1], .delta = delta, .sigma = sigma, .activity = activity, .zero = zero}};
static const hg_code_scale scale[] = {
    {HG_REAL_T(0.015625, 1073741824), HG_REAL_ZERO, HG_REAL_T(64.0, 1073741824), HG_EXPONENT(-10), -1000, 1000}};
static const hg_hold_config hold_config[GROUPS] = {
    {.trigger = &trigger[0], .margin = 1U, .scale = scale, .half = numbers, .slew = &numbers[1], .span = span, .middle = numbers},
    {.trigger = &trigger[1], .margin = 1U, .scale = scale, .half = numbers, .slew = &numbers[2], .span = span, .middle = numbers}};

static const uint8_t input_place[] = {1U};
static const hg_predict_config predict_config[] = {
    {.group = 0U, .first = 0U, .order = 1U, .width = 1U, .inputs = 1U, .input = input_place, .known = numbers, .correct = {1U, 1U, 0, numbers},
     .state = {1U, 1U, 0, numbers}, .drive = {1U, 1U, 0, numbers}, .output = {1U, 1U, 0, numbers}, .direct = {1U, 1U, 0, numbers}, .fresh = numbers,
     .horizon = 2U, .radius = numbers, .settle = 2U}};
static const uint8_t sent_places[] = {0U, 1U};
static const hg_mismatch_config mismatch_config = {.states = 1U, .width = 2U, .signal = sent_places, .constant = numbers, .gain = numbers};

static const uint8_t read_places[] = {2U, 1U};
static const hg_residual_config residual_config[] = {
    {.order = 1U, .residuals = 1U, .width = 2U, .signal = read_places, .state = {1U, 1U, 0, numbers}, .input = {1U, 2U, 0, numbers},
     .output = {1U, 1U, 0, numbers}, .direct = {1U, 2U, 0, numbers}}};
static const uint8_t wide_places[] = {2U, 3U};
static const uint8_t taps[] = {2U, 2U};
static const hg_real weights[] = {HG_REAL_C(0.0625), HG_REAL_C(0.0625), HG_REAL_C(0.0625), HG_REAL_C(0.0625), HG_REAL_C(0.0625), HG_REAL_C(0.0625)};
static const hg_hull_config hull_config[] = {
    {.residuals = 1U, .width = 2U, .signal = wide_places, .taps = taps, .weight = weights, .settle = 1U, .rest = numbers, .rest_left = numbers,
     .moving = numbers, .moving_left = numbers, .bias = numbers, .ready_rest = 0U, .ready_moving = 2U, .decay = numbers, .modes = MODES,
     .mode_decay = numbers, .mode_input = numbers, .mode_output = numbers, .mode_rest = numbers, .mode_moving = numbers}};

static const uint8_t extra_places[] = {3U};
static const hg_real certificate_weights[WINDOW * 2U * CERTIFICATES] = {HG_REAL_C(0.125), HG_REAL_C(-0.125), HG_REAL_C(0.125), HG_REAL_C(0.125)};
static const hg_bank_config bank_config[] = {
    {.certificates = CERTIFICATES, .window = WINDOW, .width = 2U, .signal = sent_places, .weight = certificate_weights, .extras = 1U, .extra = extra_places,
     .extra_weight = weights, .bias = numbers, .widen = HG_REAL_C(1.0)}};

static const uint8_t feeds[] = {0x3U, 0x3U};
static const uint32_t faults[] = {0x5U, 0xAU};
#define REALS \
    ((2U * WIDTH) + 4U + HG_HOLD_REALS(SIGNALS) + HG_RING_REALS(WIDTH, HISTORY) + HG_RESIDUAL_REALS(1U, 2U) + HG_HULL_REALS(1U, MODES) + HG_PREDICT_REALS(1U, 1U, 1U) + \
     HG_RING_REALS(SIGNALS, WINDOW))
static const hg_detector_config detector_config = {
    .signals = SIGNALS, .width = WIDTH, .groups = GROUPS, .hold = hold_config, .predictors = 1U, .predict = predict_config, .mismatch = &mismatch_config,
    .generators = 1U, .residual = residual_config, .hull = hull_config, .banks = 1U, .bank = bank_config,
    .decision = {.generators = 2U, .feeds = feeds, .faults = faults, .up = 1U, .down = 3U, .latch = false},
    .history = HISTORY, .window = WINDOW, .residuals = 2U, .codes = HG_HOLD_CODES(SIGNALS), .reals = REALS, .sums = HG_BANK_SUMS(CERTIFICATES)};

static const uint8_t ids[HG_E2E_IDS] = {1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 9U, 10U, 11U, 12U, 13U, 14U, 15U, 16U};
static const hg_e2e_config rule = {.profile = HG_E2E_P22, .data_ids = ids, .crc = 0U, .counter = 8U, .stamp = 12U, .limits = &hg_e2e_limits_default};
static const hg_field field[] = {{16U, 16U, HG_FIELD_SIGNED}};
static const hg_message message[GROUPS] = {{.id = 0x101U, .length = 4U, .width = 1U, .field = field, .scale = scale, .e2e = &rule},
                                           {.id = 0x110U, .length = 4U, .width = 1U, .field = field, .scale = scale, .e2e = &rule}};
static const hg_message own_message[] = {{.id = 0x200U, .length = 8U, .e2e = &rule}, {.id = 0x201U, .length = 8U, .e2e = &rule},
                                         {.id = 0x300U, .length = 8U, .e2e = &rule}, {.id = 0x301U, .length = 8U, .e2e = &rule}};
static const hg_freeze_config freeze_config = {.samples = SAMPLES, .after = 1U, .burst = 3U, .request = &own_message[2], .response = &own_message[3]};
static const hg_node_config node_config = {.detector = &detector_config, .message = message, .closing = 1U, .verdict = &own_message[0], .status = &own_message[1],
                                           .heartbeat = 5U, .model_hash = 0x12345678UL, .freeze = &freeze_config};

#endif
