/** @file
 *  A polynomial filter that can be computed by hand: degree 1, a Kalman filter. x+ = x / 2 + 2 (u - 1) + w, y = 4 s1 = x + (u - 1) + v, variances of w and v 1/4;
 *  s1 is the second signal of small_model.h, u its third. */
#ifndef HULLGUARD_TESTS_SMALL_FILTER_H
#define HULLGUARD_TESTS_SMALL_FILTER_H

#include "hullguard/statistic.h"

#define SF_REALS (HG_POLYNOMIAL_REALS(1U, 1U, 1U, 1U, 4U) + 2U)
#define SF_SETTLE 3U

static const uint16_t sf_one_term[] = {1U};
static const uint8_t sf_first[] = {0U, 0U};
static const hg_real sf_half[] = {R(0.5)};
static const hg_real sf_unit[] = {R(1)};
static const hg_real sf_zero[] = {R(0)};
static const uint16_t sf_start[] = {0U, 4U, 5U, 6U, 7U};
static const uint16_t sf_product[] = {0U, 1U, 2U, 3U, 1U, 2U, 3U};
static const uint8_t sf_noise[] = {0U, 0U, 1U, 2U};
static const uint8_t sf_moment[] = {0U, 1U, 0U, 0U};
static const hg_real sf_mean[] = {R(1), R(0), R(0)};
static const hg_real sf_covariance[] = {R(0), R(0), R(0), R(0), R(0.25), R(0), R(0), R(0), R(0.25)};
static const hg_real sf_M0[] = {R(1), R(0), R(0), R(1)};
static const hg_real sf_quarter[] = {R(0.25)};
static const hg_real sf_range[] = {R(1000)};
static const hg_real sf_fresh[] = {R(0.0625)};
static const uint8_t sf_signal[] = {1U};
static const uint8_t sf_input[] = {2U};
static const hg_real sf_gain[] = {R(4)};
static const hg_real sf_drive[] = {R(2)};
static const hg_real sf_known[] = {R(0.0078125)};

static const hg_statistic_config sf_config = {
    .filter = {.states = 1U, .outputs = 1U, .degree = 1U, .bounded = false, .lifted = 1U, .measured = 1U, .judged = 1U, .noises = 3U, .ring = 4U, .lower = 4U,
               .f = {.width = 1U, .end = sf_one_term, .coefficient = sf_half, .factor = sf_first},
               .h = {.width = 1U, .end = sf_one_term, .coefficient = sf_unit, .factor = sf_first},
               .start = sf_start, .product = sf_product, .parent = sf_first, .factor = sf_first, .noise = sf_noise, .moment = sf_moment,
               .mean = sf_mean, .covariance = sf_covariance, .x0 = sf_zero, .P0 = sf_unit, .M0 = sf_M0, .Q = sf_quarter, .R = sf_quarter,
               .range = sf_range, .fresh = sf_fresh, .kappa = R(4), .joint = R(16), .weight = R(0.25), .drift = R(9)},
    .signal = sf_signal, .gain = sf_gain, .inputs = 1U, .input = sf_input, .zero = sf_unit, .drive = sf_drive, .direct = sf_unit, .known = sf_known,
    .settle = SF_SETTLE};

#endif
