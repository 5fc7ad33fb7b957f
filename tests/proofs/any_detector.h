/** @file
 *  A detector of small sizes, tables and state of any content: GROUPS groups of WIDTH signals, PREDICTORS of them predicted, STATES uncertain states, GENERATORS generators of RESIDUALS
 *  residuals by hulls (COLUMNS 0) or by zonotopes of COLUMNS columns, BANKS banks, HISTORY rows. Every array is an object of its own. */
#ifndef HULLGUARD_ANY_DETECTOR_H
#define HULLGUARD_ANY_DETECTOR_H

#include "state_detector.h"

#define SIGNALS (GROUPS * WIDTH)
#define DERIVED ((PREDICTORS * WIDTH) + STATES)
#define ALL (SIGNALS + DERIVED)
#ifndef POLYNOMIALS
#define POLYNOMIALS 0U /* filters of one state, one output and degree 1 */
#endif
#define JUDGES (GENERATORS + BANKS + POLYNOMIALS)
#define RESIDUES ((GENERATORS * RESIDUALS) + BANKS + (HG_STATISTICS * POLYNOMIALS))
#define LIFTED_RING 4U /* C(2 + 1 + 1, 1) */
#define STATISTIC_REALS (HG_POLYNOMIAL_REALS(1U, 1U, 1U, 1U, LIFTED_RING) + 2U)

/* Tables of any content for these sizes. */
static hg_matrix any_matrix(uint8_t rows, uint8_t cols)
{
    return (hg_matrix){.rows = rows, .cols = cols, .exponent = 0, .data = any_array(hg_real, (size_t)rows * cols)};
}

static hg_hold_config *any_holds(void)
{
    hg_hold_config *hold = any_array(hg_hold_config, GROUPS);
    for (uint8_t i = 0U; i < GROUPS; i++) {
        hg_trigger_config *trigger = any_array(hg_trigger_config, 1U);
        *trigger = (hg_trigger_config){.width = WIDTH, .levels = 1U, .interval_max = any_u8_in(1U, HORIZON), .silence = any_array(uint8_t, 1U),
                                        .delta = any_array(uint16_t, WIDTH), .sigma = any_array(int32_t, WIDTH), .activity = any_array(int32_t, WIDTH), .zero = any_array(int32_t, WIDTH)};
        hold[i] = (hg_hold_config){.trigger = trigger, .margin = (uint8_t)(HORIZON - trigger->interval_max), .scale = any_array(hg_code_scale, WIDTH), .half = any_array(hg_real, WIDTH),
                                   .slew = any_array(hg_real, HORIZON * WIDTH),
                                   .span = any_array(hg_real, WIDTH), .middle = any_array(hg_real, WIDTH)};
    }
    return hold;
}

static hg_predict_config *any_predictors(void)
{
    hg_predict_config *predict = any_array(hg_predict_config, PLACES(PREDICTORS));
    for (uint8_t i = 0U; i < PREDICTORS; i++) {
        predict[i] = (hg_predict_config){.group = i, .first = (uint8_t)(i * WIDTH), .order = 1U, .width = WIDTH, .inputs = 1U, .input = any_array(uint8_t, 1U), .known = any_array(hg_real, 1U),
                                         .correct = any_matrix(1U, WIDTH), .state = any_matrix(1U, 1U), .drive = any_matrix(1U, 1U), .output = any_matrix(WIDTH, 1U),
                                         .direct = any_matrix(WIDTH, 1U), .fresh = any_array(hg_real, WIDTH), .horizon = 1U, .radius = any_array(hg_real, WIDTH), .settle = any_u16()};
    }
    return predict;
}

static const hg_mismatch_config *any_mismatch(void)
{
    hg_mismatch_config *mismatch = any_array(hg_mismatch_config, 1U);
    *mismatch = (hg_mismatch_config){.states = STATES, .width = 1U, .exponent = 0, .signal = any_array(uint8_t, 1U), .constant = any_array(hg_real, PLACES(STATES)),
                                     .gain = any_array(hg_real, PLACES(STATES))};
    return (STATES > 0U) ? mismatch : NULL;
}

static hg_residual_config *any_residuals(void)
{
    hg_residual_config *residual = any_array(hg_residual_config, GENERATORS);
    for (uint8_t g = 0U; g < GENERATORS; g++) {
        residual[g] = (hg_residual_config){.order = 1U, .residuals = RESIDUALS, .width = 1U, .signal = any_array(uint8_t, 1U), .state = any_matrix(1U, 1U), .input = any_matrix(1U, 1U),
                                           .output = any_matrix(RESIDUALS, 1U), .direct = any_matrix(RESIDUALS, 1U)};
    }
    return residual;
}

#if COLUMNS == 0U
static hg_hull_config *any_hulls(void)
{
    hg_hull_config *hull = any_array(hg_hull_config, GENERATORS);
    for (uint8_t g = 0U; g < GENERATORS; g++) {
        hull[g] = (hg_hull_config){.residuals = RESIDUALS, .width = 1U, .exponent = 0, .signal = any_array(uint8_t, 1U), .taps = any_array(uint8_t, 1U), .weight = any_array(hg_real, RESIDUALS * HISTORY),
                                   .settle = 1U, .rest = any_array(hg_real, RESIDUALS), .rest_left = any_array(hg_real, RESIDUALS), .moving = any_array(hg_real, RESIDUALS),
                                   .moving_left = any_array(hg_real, RESIDUALS), .bias = any_array(hg_real, RESIDUALS), .ready_rest = any_u16(), .ready_moving = any_u16(),
                                   .decay = any_array(hg_real, RESIDUALS), .modes = 0U};
    }
    return hull;
}
#define HULLS any_hulls()
#define ZONOTOPES NULL
#else
static hg_zonotope_config *any_zonotopes(void)
{
    hg_zonotope_config *zonotope = any_array(hg_zonotope_config, GENERATORS);
    for (uint8_t g = 0U; g < GENERATORS; g++) {
        zonotope[g] = (hg_zonotope_config){.order = 1U, .residuals = RESIDUALS, .width = 1U, .disturbances = 1U, .initial = 0U, .columns = COLUMNS, .blocks = 1U,
                                           .reduction = HG_REDUCTION_BALL, .signal = any_array(uint8_t, 1U), .block = any_array(uint8_t, 1U), .state = any_array(hg_real, 1U),
                                           .input = any_array(hg_real, 1U), .disturbance = any_array(hg_real, 1U), .output = any_array(hg_real, RESIDUALS),
                                           .outer = any_array(hg_real, RESIDUALS), .direct = any_array(hg_real, RESIDUALS), .settle = 1U, .bias_rest = any_array(hg_real, RESIDUALS),
                                           .bias_moving = any_array(hg_real, RESIDUALS), .decay = any_array(hg_real, 1U), .always = any_array(hg_real, 1U),
                                           .growth = any_array(hg_real, 1U), .output_growth = any_array(hg_real, RESIDUALS), .recover = any_u16(), .ready_rest = any_u16(),
                                           .ready_moving = any_u16()};
    }
    return zonotope;
}
#define HULLS NULL
#define ZONOTOPES any_zonotopes()
#endif

static hg_bank_config *any_banks(void)
{
    hg_bank_config *bank = any_array(hg_bank_config, PLACES(BANKS));
    for (uint8_t b = 0U; b < BANKS; b++) {
        hg_real widen;
        bank[b] = (hg_bank_config){.certificates = 1U, .window = any_u8(), .width = 1U, .signal = any_array(uint8_t, 1U), .exponent = 0, .weight = any_array(hg_real, HISTORY), .extras = 0U,
                                   .bias = any_array(hg_real, 1U), .widen = widen};
    }
    return bank;
}

static hg_statistic_config *any_statistics(void)
{
    hg_statistic_config *statistic = any_array(hg_statistic_config, PLACES(POLYNOMIALS));
    for (uint8_t p = 0U; p < POLYNOMIALS; p++) {
        uint16_t *end = any_array(uint16_t, 1U);
        uint16_t *start = any_array(uint16_t, LIFTED_RING + 1U);
        const hg_polynomial_map map = {.width = 1U, .end = end, .coefficient = any_array(hg_real, 1U), .factor = any_array(uint8_t, 1U)};
        hg_real kappa;
        hg_real joint;
        hg_real weight;
        hg_real drift;
        assume((end[0] <= 1U) && (start[LIFTED_RING] <= 1U)); /* what they say of their lists' lengths */
        statistic[p] = (hg_statistic_config){
            .signal = any_array(uint8_t, 1U), .gain = any_array(hg_real, 1U), .inputs = 0U, .settle = any_u8(),
            .filter = {.states = 1U, .outputs = 1U, .degree = 1U, .bounded = false, .lifted = 1U, .measured = 1U, .judged = 1U, .noises = 3U, .ring = LIFTED_RING, .lower = LIFTED_RING,
                       .f = map, .h = map, .start = start, .product = any_array(uint16_t, 1U), .parent = any_array(uint8_t, 2U),
                       .factor = any_array(uint8_t, 2U), .noise = any_array(uint8_t, LIFTED_RING), .moment = any_array(uint8_t, LIFTED_RING), .mean = any_array(hg_real, 3U),
                       .covariance = any_array(hg_real, 9U), .x0 = any_array(hg_real, 1U), .P0 = any_array(hg_real, 1U), .M0 = any_array(hg_real, 4U), .Q = any_array(hg_real, 1U),
                       .R = any_array(hg_real, 1U), .range = any_array(hg_real, 1U), .fresh = any_array(hg_real, 1U), .kappa = kappa, .joint = joint, .weight = weight, .drift = drift}};
    }
    return statistic;
}

static hg_detector_config any_detector_config(void)
{
    return (hg_detector_config){
        .signals = SIGNALS, .width = ALL, .groups = GROUPS, .hold = any_holds(), .predictors = PREDICTORS, .predict = any_predictors(), .mismatch = any_mismatch(), .generators = GENERATORS,
        .residual = any_residuals(), .hull = HULLS, .zonotope = ZONOTOPES, .banks = BANKS, .bank = any_banks(), .polynomials = POLYNOMIALS, .polynomial = any_statistics(),
        .decision = {.generators = JUDGES, .feeds = any_array(uint8_t, JUDGES), .faults = any_array(uint32_t, JUDGES), .up = any_u8_in(1U, UINT8_MAX), .down = any_u8_in(1U, UINT8_MAX),
                     .latch = any_bool()},
        .history = HISTORY, .window = HISTORY, .residuals = RESIDUES, .codes = 2U * SIGNALS};
}

#if COLUMNS == 0U
#define THRESHOLD_REALS HG_HULL_REALS(RESIDUALS, 0U)
#else
#define THRESHOLD_REALS HG_ZONOTOPE_REALS(1U, COLUMNS, 2U)
#endif
/* Numbers of each part, in their order. */
#define OWN_REALS ((2U * ALL) + (2U * RESIDUES))
#define HOLD_REALS HG_HOLD_REALS(SIGNALS)
#define RADII_REALS HG_RING_REALS(ALL, HISTORY)
#define GENERATOR_REALS (GENERATORS * (HG_RESIDUAL_REALS(1U, 1U) + THRESHOLD_REALS))
#define PREDICTOR_REALS (PREDICTORS * HG_PREDICT_REALS(1U, 1U, WIDTH))

#define REALS (OWN_REALS + HOLD_REALS + RADII_REALS + GENERATOR_REALS + PREDICTOR_REALS + (POLYNOMIALS * STATISTIC_REALS) + HG_RING_REALS(SIGNALS, HISTORY))

/* Memory as a start asks for it. */
static hg_detector_memory any_memory(void)
{
    return (hg_detector_memory){.hold = any_array(hg_hold, GROUPS), .predict = any_array(hg_predict, PLACES(PREDICTORS)), .residual = any_array(hg_residual, GENERATORS),
                                .hull = any_array(hg_hull, GENERATORS), .zonotope = any_array(hg_zonotope, GENERATORS), .bank = any_array(hg_bank, PLACES(BANKS)),
                                .polynomial = any_array(hg_statistic, PLACES(POLYNOMIALS)), .alarm = any_array(hg_alarm, JUDGES), .code = any_array(int32_t, 2U * SIGNALS), .codes = 2U * SIGNALS, .real = any_array(hg_real, REALS), .reals = REALS,
                                .sum = any_array(hg_acc, PLACES(2U * BANKS)), .sums = 2U * BANKS};
}

#endif
