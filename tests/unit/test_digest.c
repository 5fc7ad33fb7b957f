/** @file
 *  crc32c.h, and digest.h with digest_tracker.h and digest_uio.h: what generated files say of themselves, walks of every length, and every bit of every
 *  table of configurations that hold what the shipped models do not. */
#include "support.h"

#include "hullguard/crc32c.h"
#include "hullguard/digest.h"
#include "hullguard/digest_tracker.h"
#include "hullguard/digest_uio.h"

#include "battery_cell.h"
#include "cubic_suspension.h"
#include "fusion5.h"
#include "fusion5_fast.h"
#include "openacc.h"
#include "platoon.h"
#include "platoon_bank.h"
#include "quadratic_sensor.h"
#include "small_model.h"
#include "suspension.h"
#include "suspension_published.h"
#include "suspension_published_uio.h"
#include "suspension_uio.h"
#include "tracking.h"
#include "two_state.h"

/* ---- the checksum ---- */

/* Bit by bit, from the definition. */
static uint32_t reference(uint32_t crc, uint8_t byte)
{
    uint32_t x = ~crc ^ byte;
    for (unsigned bit = 0U; bit < 8U; bit++) {
        x = (x >> 1U) ^ (((x & 1U) != 0U) ? 0x82F63B78U : 0U);
    }
    return ~x;
}

static void the_checksum_is_crc_32c(void **state)
{
    (void)state;
    const char *text = "123456789";
    uint32_t crc = 0U;
    for (size_t i = 0U; i < 9U; i++) {
        crc = hg_crc32c(crc, (uint32_t)text[i], 1U);
    }
    assert_true(crc == 0xE3069283U);
    uint32_t random = 5U;
    uint32_t slow = 0U;
    crc = 0U;
    for (uint32_t i = 0U; i < 1000U; i++) {
        const uint32_t number = draw(&random);
        const uint8_t bytes = (uint8_t)(i % 5U);
        for (uint8_t b = 0U; b < bytes; b++) {
            slow = reference(slow, (uint8_t)((number >> (8U * b)) & 0xFFU));
        }
        crc = hg_crc32c(crc, number, bytes);
        assert_true(crc == slow);
    }
}

static void numbers_go_by_their_bits_lowest_first(void **state)
{
    (void)state;
#if HG_REAL_F64
    assert_true(hg_real_word(R(1), 0U) == 0U);
    assert_true(hg_real_word(R(1), 1U) == 0x3FF00000U);
    assert_true(hg_crc32c_real(7U, R(1)) == hg_crc32c(hg_crc32c(7U, 0U, 4U), 0x3FF00000U, 4U));
#else
    assert_true(hg_real_word(R(1), 0U) == 0x3F800000U);
    assert_true(hg_crc32c_real(7U, R(1)) == hg_crc32c(7U, 0x3F800000U, 4U));
#endif
}

/* ---- shipped models ---- */

typedef hg_status (*checker)(hg_digest *walk, uint32_t numbers);

static const checker every[] = {
    hg_platoon_check,          hg_platoon_bank_check,     hg_openacc_check,   hg_suspension_check,     hg_suspension_published_check, hg_battery_cell_check,
    hg_cubic_suspension_check, hg_quadratic_sensor_check, hg_two_state_check, hg_suspension_uio_check, hg_suspension_published_uio_check,
    hg_fusion5_check,          hg_fusion5_fast_check,     hg_tracking_check,  hg_suspension_uio_isolate_check,
};

static void generated_files_know_the_digest_of_their_tables(void **state)
{
    (void)state;
    for (size_t i = 0U; i < COUNT(every); i++) {
        hg_digest walk;
        hg_digest_start(&walk);
        assert_status(HG_OK, every[i](&walk, UINT32_MAX));
    }
}

static void a_walk_may_be_cut_anywhere(void **state)
{
    (void)state;
    static const uint32_t lengths[] = {1U, 7U, 64U};
    hg_digest whole;
    hg_digest_start(&whole);
    assert_status(HG_OK, hg_platoon_check(&whole, UINT32_MAX));
    for (size_t i = 0U; i < COUNT(lengths); i++) {
        hg_digest walk;
        uint32_t calls = 1U;
        hg_digest_start(&walk);
        hg_status status = hg_platoon_check(&walk, lengths[i]);
        while (status == HG_E_BUSY) {
            assert_true(walk.done == (calls * lengths[i]));
            status = hg_platoon_check(&walk, lengths[i]);
            calls++;
        }
        assert_status(HG_OK, status);
        assert_true(walk.crc == whole.crc);
        assert_true(walk.done == whole.done);
        assert_true(calls == ((whole.done / lengths[i]) + 1U));
    }
}

static uint32_t digest_of(const hg_node_config *config)
{
    hg_digest walk;
    hg_digest_start(&walk);
    assert_status(HG_OK, hg_digest_node(&walk, config, hg_digest_node_head(config), UINT32_MAX));
    return walk.crc;
}

static void a_wrong_number_is_no_digest(void **state)
{
    (void)state;
    hg_node_config config = hg_platoon_config;
    config.heartbeat++;
    hg_digest walk;
    hg_digest_start(&walk);
    assert_status(HG_E_DIGEST, hg_digest_node(&walk, &config, HG_PLATOON_DIGEST_HEAD, UINT32_MAX));
    assert_count(0, walk.done);
    assert_true(digest_of(&config) != HG_PLATOON_DIGEST);
    walk.crc ^= 1U; /* as a wrong bit before leaves it */
    assert_status(HG_E_DIGEST, hg_platoon_check(&walk, UINT32_MAX));
}

static void a_table_that_is_not_there_has_no_numbers(void **state)
{
    (void)state;
    hg_digest walk;
    hg_digest_start(&walk);
    hg_digest_open(&walk, UINT32_MAX);
    hg_digest_bytes(&walk, NULL, 3U);
    hg_digest_halves(&walk, NULL, 3U);
    hg_digest_codes(&walk, NULL, 3U);
    hg_digest_masks(&walk, NULL, 3U);
    hg_digest_reals(&walk, NULL, 3U);
    assert_count(0, walk.done);
    const hg_node_config *config = &hg_platoon_config;
    hg_message message = *config->verdict; /* without fields, and a width that is wrong */
    message.width = 2U;
    hg_digest_message(&walk, &message);
    assert_true(walk.done > 0U);
}

/* ---- every bit of what no shipped model has ---- */

typedef struct {
    void  *data;
    size_t bytes;
} table;

#define TABLE(x) {(x), sizeof(x)}

static void every_bit_counts(const hg_node_config *config, const table *tables, size_t count)
{
    const uint32_t good = digest_of(config);
    for (size_t i = 0U; i < count; i++) {
        uint8_t *byte = tables[i].data;
        for (size_t b = 0U; b < (8U * tables[i].bytes); b++) {
            const uint8_t bit = (uint8_t)(1U << (b % 8U));
            byte[b / 8U] ^= bit;
            assert_true(digest_of(config) != good);
            byte[b / 8U] ^= bit;
        }
    }
    assert_true(digest_of(config) == good);
}

#define P22(list) {.profile = HG_E2E_P22, .data_ids = (list), .crc = 0U, .counter = 8U, .stamp = 12U, .limits = &hg_e2e_limits_default}

static uint8_t ids[HG_E2E_IDS] = {1U, 2U, 3U};
static hg_e2e_config listed = P22(ids);
static hg_e2e_config bare_rules = {.profile = HG_E2E_P11, .mode = HG_E2E_BOTH, .data_id = 5U, .limits = &hg_e2e_limits_default};
static hg_field fields[2] = {{16U, 16U, HG_FIELD_SIGNED}, {32U, 16U, HG_FIELD_SIGNED}};
static hg_code_scale scales[2] = {{R(0.5), R(0), R(2), 0, -9, 9}, {R(0.25), R(0), R(4), 0, -9, 9}};
static uint8_t idle[8] = {0xFFU};
static hg_message messages[SM_GROUPS] = {{.id = 0x101U, .length = 8U, .width = 2U, .field = fields, .scale = scales, .e2e = &listed, .idle = idle},
                                         {.id = 0x110U, .length = 4U, .width = 1U, .field = fields, .scale = scales, .e2e = &bare_rules}};
static const hg_message own = {.id = 0x200U, .length = 8U, .e2e = &listed};

static hg_real numbers[128];

static void frames_predictions_and_uncertainties(void **state)
{
    (void)state;
    static uint8_t places[2] = {1U, 2U};
    static hg_real known[2], fresh[1], radius[2], square[4];
    static hg_matrix matrix = {.rows = 2U, .cols = 2U, .data = square};
    static hg_predict_config predict;
    static hg_mismatch_config mismatch = {.states = 1U, .width = 2U, .signal = places, .constant = fresh, .gain = known};
    predict = (hg_predict_config){.group = 1U, .first = 2U, .order = 2U, .width = 1U, .inputs = 2U, .input = places, .known = known, .correct = matrix, .state = matrix,
                                  .drive = matrix, .output = matrix, .direct = matrix, .fresh = fresh, .horizon = 2U, .radius = radius, .settle = 3U};
    static hg_freeze_config freeze = {.samples = 3U, .after = 1U, .burst = 2U, .request = &own, .response = &own};
    hg_detector_config detector = sm_detector;
    detector.predictors = 1U;
    detector.predict = &predict;
    detector.mismatch = &mismatch;
    const hg_node_config config = {.detector = &detector, .message = messages, .verdict = &own, .status = &own, .heartbeat = 5U, .freeze = &freeze};
    const table tables[] = {TABLE(ids), TABLE(idle), TABLE(places), TABLE(known), TABLE(fresh), TABLE(radius), TABLE(square), {&predict.settle, 2U}, {&predict.first, 1U},
                            {&scales[1].minimum, 4U}, {&scales[0].resolution, sizeof(hg_real)}, {&fields[1].start, 2U}, {&listed.stamp, 2U}, {&messages[0].id, 4U},
                            {&matrix.exponent, 0U}, {&mismatch.exponent, 1U}, {&freeze.after, 1U}, {&freeze.samples, 1U}, {&freeze.burst, 1U}};
    every_bit_counts(&config, tables, COUNT(tables));
    const uint32_t good = digest_of(&config);
    messages[0].idle = NULL;
    assert_true(digest_of(&config) != good);
    messages[0].idle = idle;
    listed.data_ids = NULL;
    assert_true(digest_of(&config) != good);
    listed.data_ids = ids;
    detector.mismatch = NULL;
    assert_true(digest_of(&config) != good);
    detector.mismatch = &mismatch;
    detector.decision.latch = true;
    assert_true(digest_of(&config) != good);
}

static void zonotopes(void **state)
{
    (void)state;
    static uint8_t places[2] = {1U, 2U};
    static uint8_t blocks[2] = {2U, 1U};
    static hg_real t[14][16];
    static hg_zonotope_config zonotope[SM_GENERATORS];
    zonotope[0] = (hg_zonotope_config){.order = 3U, .residuals = 2U, .width = 2U, .disturbances = 1U, .initial = 2U, .columns = 4U, .blocks = 2U, .reduction = HG_REDUCTION_BOX,
                                       .signal = places, .block = blocks, .state = t[0], .input = t[1], .disturbance = t[2], .rest = t[3], .moving = t[4], .output = t[5],
                                       .outer = t[6], .direct = t[7], .settle = 2U, .bias_rest = t[8], .bias_moving = t[9], .decay = t[10], .always = t[11], .growth = t[12],
                                       .output_growth = t[13]};
    zonotope[1] = zonotope[0];
    hg_detector_config detector = sm_detector;
    detector.hull = NULL;
    detector.zonotope = zonotope;
    const hg_node_config config = {.detector = &detector, .message = messages, .verdict = &own, .status = &own, .heartbeat = 5U};
    static const size_t lengths[14] = {5U, 6U, 3U, 6U, 6U, 6U, 6U, 4U, 4U, 4U, 2U, 3U, 3U, 2U};
    table tables[14U + 3U] = {TABLE(places), {&zonotope[1].recover, 2U}, {&zonotope[1].columns, 1U}};
    for (size_t i = 0U; i < 14U; i++) {
        tables[3U + i] = (table){t[i], lengths[i] * sizeof(hg_real)};
    }
    every_bit_counts(&config, tables, COUNT(tables));
    const uint32_t good = digest_of(&config);
    t[0][5] = R(1); /* behind a table */
    assert_true(digest_of(&config) == good);
    blocks[1] = 0U;
    assert_true(digest_of(&config) != good);
}

static void filters_that_keep_the_remainder(void **state)
{
    (void)state;
    static uint16_t end[1] = {2U}, starts[6] = {0U, 0U, 0U, 0U, 0U, 3U}, products[3];
    static uint8_t places[16];
    static hg_statistic_config statistic;
    statistic = (hg_statistic_config){
        .filter = {.states = 1U, .outputs = 1U, .degree = 1U, .bounded = true, .lifted = 1U, .measured = 1U, .judged = 1U, .noises = 3U, .ring = 5U, .lower = 4U,
                   .f = {1U, end, numbers, places}, .h = {1U, end, numbers, places}, .start = starts, .product = products, .parent = places, .factor = places,
                   .noise = places, .moment = places, .mean = numbers, .covariance = numbers, .cut_moment = &places[8], .cut_state = &places[9], .cut_scale = &numbers[20],
                   .box = &numbers[21], .x0 = numbers, .P0 = numbers, .M0 = numbers, .Q = numbers, .R = numbers, .range = numbers, .fresh = numbers},
        .signal = places, .gain = numbers, .inputs = 1U, .input = places, .zero = numbers, .drive = numbers, .direct = numbers, .known = numbers};
    hg_detector_config detector = sm_detector;
    detector.polynomials = 1U;
    detector.polynomial = &statistic;
    const hg_node_config config = {.detector = &detector, .message = messages, .verdict = &own, .status = &own, .heartbeat = 5U};
    const table tables[] = {{places, 4U}, {&places[8], 2U}, TABLE(products), {&numbers[0], 9U * sizeof(hg_real)}, {&numbers[20], 2U * sizeof(hg_real)},
                            {&statistic.filter.reach, sizeof(hg_real)}, {&statistic.filter.drift, sizeof(hg_real)}, {&statistic.settle, 1U}};
    every_bit_counts(&config, tables, COUNT(tables));
    statistic.filter.bounded = false;
    const uint32_t good = digest_of(&config);
    numbers[21] = R(3); /* not there without a bound */
    assert_true(digest_of(&config) == good);
    statistic.filter.states = 0U; /* a wrong number: nothing before the tables is read */
    assert_true(digest_of(&config) != good);
}

static void the_same_of_a_fusion_filter(void **state)
{
    (void)state;
    hg_digest walk;
    hg_tracker_config config = hg_tracking_config;
    hg_fusion_config fusion = *config.fusion;
    static const hg_real row[HG_FUSION_STATES_MAX];
    static const hg_real dense[HG_FUSION_STATES_MAX * HG_FUSION_SENSORS_MAX];
    config.fusion = &fusion;
    hg_digest_start(&walk);
    assert_status(HG_E_BUSY, hg_digest_tracker(&walk, &config, HG_TRACKING_DIGEST_HEAD, 5U));
    assert_status(HG_OK, hg_digest_tracker(&walk, &config, HG_TRACKING_DIGEST_HEAD, UINT32_MAX));
    assert_true(walk.crc == HG_TRACKING_DIGEST);
    assert_status(HG_E_DIGEST, hg_digest_tracker(&walk, &config, HG_TRACKING_DIGEST_HEAD + 1U, UINT32_MAX));
    /* And with what it has not: rows in place of a selection, a local origin, no frames on their way, nobody who judges. */
    fusion.delay = 0U;
    fusion.origin = row;
    fusion.select = NULL;
    fusion.C = dense;
    config.consistency = NULL;
    hg_digest_start(&walk);
    assert_status(HG_OK, hg_digest_tracker(&walk, &config, hg_digest_tracker_head(&config), UINT32_MAX));
    const uint32_t with = walk.crc;
    fusion.origin = NULL;
    hg_digest_start(&walk);
    assert_status(HG_OK, hg_digest_tracker(&walk, &config, hg_digest_tracker_head(&config), UINT32_MAX));
    assert_true(walk.crc != with);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_checksum_is_crc_32c),
        cmocka_unit_test(numbers_go_by_their_bits_lowest_first),
        cmocka_unit_test(generated_files_know_the_digest_of_their_tables),
        cmocka_unit_test(a_walk_may_be_cut_anywhere),
        cmocka_unit_test(a_wrong_number_is_no_digest),
        cmocka_unit_test(a_table_that_is_not_there_has_no_numbers),
        cmocka_unit_test(frames_predictions_and_uncertainties),
        cmocka_unit_test(zonotopes),
        cmocka_unit_test(filters_that_keep_the_remainder),
        cmocka_unit_test(the_same_of_a_fusion_filter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
