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

/* A table ends where the configuration says: the number behind it, which is there, does not count. */
static void nothing_behind_counts(const hg_node_config *config, const table *tables, size_t count)
{
    const uint32_t good = digest_of(config);
    for (size_t i = 0U; i < count; i++) {
        uint8_t *behind = &((uint8_t *)tables[i].data)[tables[i].bytes];
        *behind ^= 1U;
        assert_true(digest_of(config) == good);
        *behind ^= 1U;
    }
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

static void frames_predictions_and_uncertainties(void **state)
{
    (void)state;
    static uint8_t places[3] = {1U, 2U}, others[3] = {1U, 2U};
    static hg_real known[3], fresh[3], radius[7], square[5][5], constant[4], gain[7]; /* one more each than is read */
    static hg_matrix matrix = {.rows = 2U, .cols = 2U, .data = square[0]};
    static hg_predict_config predict[2];
    static hg_mismatch_config mismatch = {.states = 3U, .width = 2U, .signal = others, .constant = constant, .gain = gain};
    predict[0] = (hg_predict_config){.group = 1U, .first = 2U, .order = 2U, .width = 2U, .inputs = 2U, .input = places, .known = known, .correct = matrix, .state = matrix,
                                     .drive = matrix, .output = matrix, .direct = matrix, .fresh = fresh, .horizon = 3U, .radius = radius, .settle = 3U};
    predict[0].state.data = square[1];
    predict[0].drive.data = square[2];
    predict[0].output.data = square[3];
    predict[0].direct.data = square[4];
    predict[1] = predict[0];
    static hg_freeze_config freeze = {.samples = 3U, .after = 1U, .burst = 2U, .request = &own, .response = &own};
    hg_detector_config detector = sm_detector;
    detector.predictors = 2U;
    detector.predict = predict;
    detector.mismatch = &mismatch;
    const hg_node_config config = {.detector = &detector, .message = messages, .verdict = &own, .status = &own, .heartbeat = 5U, .freeze = &freeze};
    const size_t real = sizeof(hg_real);
    const table read[] = {{places, 2U}, {others, 2U}, {known, 2U * real}, {fresh, 2U * real}, {radius, 6U * real}, {constant, 3U * real}, {gain, 6U * real},
                          {square[0], 4U * real}, {square[1], 4U * real}, {square[2], 4U * real}, {square[3], 4U * real}, {square[4], 4U * real}};
    const table tables[] = {TABLE(ids), TABLE(idle), {&predict[0].settle, 2U}, {&predict[1].settle, 2U}, {&predict[1].first, 1U},
                            {&scales[1].minimum, 4U}, {&scales[0].resolution, sizeof(hg_real)}, {&fields[1].start, 2U}, {&listed.stamp, 2U}, {&messages[0].id, 4U},
                            {&mismatch.exponent, 1U}, {&freeze.after, 1U}, {&freeze.samples, 1U}, {&freeze.burst, 1U}};
    every_bit_counts(&config, read, COUNT(read));
    nothing_behind_counts(&config, read, COUNT(read));
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
    static uint8_t places[4] = {1U, 2U, 0U};
    static uint8_t blocks[2] = {2U, 1U};
    static hg_real t[14][16];
    static hg_zonotope_config zonotope[SM_GENERATORS];
    zonotope[0] = (hg_zonotope_config){.order = 3U, .residuals = 2U, .width = 3U, .disturbances = 2U, .initial = 4U, .columns = 4U, .blocks = 2U, .reduction = HG_REDUCTION_BOX,
                                       .signal = places, .block = blocks, .state = t[0], .input = t[1], .disturbance = t[2], .rest = t[3], .moving = t[4], .output = t[5],
                                       .outer = t[6], .direct = t[7], .settle = 5U, .bias_rest = t[8], .bias_moving = t[9], .decay = t[10], .always = t[11], .growth = t[12],
                                       .output_growth = t[13]};
    zonotope[1] = zonotope[0];
    hg_detector_config detector = sm_detector;
    detector.hull = NULL;
    detector.zonotope = zonotope;
    const hg_node_config config = {.detector = &detector, .message = messages, .verdict = &own, .status = &own, .heartbeat = 5U};
    static const size_t lengths[14] = {5U, 9U, 6U, 12U, 12U, 6U, 6U, 6U, 10U, 10U, 2U, 3U, 3U, 2U};
    const table fields_of[] = {{&zonotope[0].recover, 2U}, {&zonotope[1].recover, 2U}, {&zonotope[1].columns, 1U}};
    table read[14U + 1U] = {{places, 3U}};
    for (size_t i = 0U; i < 14U; i++) {
        read[1U + i] = (table){t[i], lengths[i] * sizeof(hg_real)};
    }
    every_bit_counts(&config, fields_of, COUNT(fields_of));
    every_bit_counts(&config, read, COUNT(read));
    nothing_behind_counts(&config, read, COUNT(read));
    const uint32_t good = digest_of(&config);
    blocks[0] = 1U;
    blocks[1] = 2U; /* the same squares in another order */
    assert_true(digest_of(&config) != good);
    blocks[1] = 0U;
    assert_true(digest_of(&config) != good);
}

static void certificates(void **state)
{
    (void)state;
    static uint8_t places[3] = {1U, 2U}, radii[3] = {0U, 1U};
    static hg_real weight[13], extra_weight[13], bias[3];
    static hg_bank_config bank;
    bank = (hg_bank_config){.certificates = 2U, .window = 3U, .width = 2U, .signal = places, .weight = weight, .extras = 2U, .extra = radii, .extra_weight = extra_weight,
                            .bias = bias, .widen = R(1)};
    hg_detector_config detector = sm_detector;
    detector.banks = 1U;
    detector.bank = &bank;
    const hg_node_config config = {.detector = &detector, .message = messages, .verdict = &own, .status = &own, .heartbeat = 5U};
    const size_t real = sizeof(hg_real);
    const table read[] = {{places, 2U}, {radii, 2U}, {weight, 12U * real}, {extra_weight, 12U * real}, {bias, 2U * real}};
    const table fields_of[] = {{&bank.widen, real}};
    every_bit_counts(&config, read, COUNT(read));
    nothing_behind_counts(&config, read, COUNT(read));
    every_bit_counts(&config, fields_of, COUNT(fields_of));
}

static void a_hull_ends_with_its_last_signal(void **state)
{
    (void)state;
    static uint8_t taps[2] = {2U, 1U}; /* of one signal, and one more */
    static hg_real weight[5];
    hg_hull_config hull[SM_GENERATORS] = {sm_hull[0], sm_hull[1]};
    hull[1].taps = taps;
    hull[1].weight = weight;
    hg_detector_config detector = sm_detector;
    detector.hull = hull;
    const hg_node_config config = {.detector = &detector, .message = messages, .verdict = &own, .status = &own, .heartbeat = 5U};
    const table read[] = {{taps, 1U}, {weight, 3U * sizeof(hg_real)}};
    every_bit_counts(&config, &read[1], 1U);
    nothing_behind_counts(&config, read, COUNT(read));
}

static void the_head_says_whether_there_are_hulls(void **state)
{
    (void)state;
    hg_detector_config detector = sm_detector;
    const hg_node_config config = {.detector = &detector, .message = messages, .verdict = &own, .status = &own, .heartbeat = 5U};
    const uint32_t with = hg_digest_node_head(&config);
    detector.hull = NULL;
    assert_true(hg_digest_node_head(&config) != with);
    detector.generators = 0U;
    const uint32_t none = hg_digest_node_head(&config);
    detector.hull = sm_hull; /* of no generator */
    assert_true(hg_digest_node_head(&config) == none);
}

static void filters_that_keep_the_remainder(void **state)
{
    (void)state;
    static uint16_t f_end[3] = {1U, 1U, 2U}, h_end[2] = {1U, 2U}, starts[6] = {0U, 0U, 0U, 0U, 0U, 3U}, products[4];
    static uint8_t f_factor[3], h_factor[3], parent[5], factor[5], noise[4], moment[4], cut_moment[3], cut_state[3], signal[3], input[3];
    static hg_real f[3], h[3], mean[4], covariance[10], cut_scale[3], box[4], x0[4], P0[10], M0[10], Q[4], r[3], range[3], fresh[3], gain[3], zero[3], drive[7],
        direct[5], known[3];
    static hg_statistic_config statistic;
    statistic = (hg_statistic_config){
        .filter = {.states = 3U, .outputs = 2U, .degree = 1U, .bounded = true, .lifted = 2U, .measured = 2U, .judged = 1U, .noises = 3U, .ring = 5U, .lower = 3U,
                   .f = {1U, f_end, f, f_factor}, .h = {1U, h_end, h, h_factor}, .start = starts, .product = products, .parent = parent, .factor = factor,
                   .noise = noise, .moment = moment, .mean = mean, .covariance = covariance, .cut_moment = cut_moment, .cut_state = cut_state, .cut_scale = cut_scale,
                   .box = box, .x0 = x0, .P0 = P0, .M0 = M0, .Q = Q, .R = r, .range = range, .fresh = fresh},
        .signal = signal, .gain = gain, .inputs = 2U, .input = input, .zero = zero, .drive = drive, .direct = direct, .known = known};
    hg_statistic_config several[2] = {statistic, statistic};
    hg_detector_config detector = sm_detector;
    detector.polynomials = 2U;
    detector.polynomial = several;
    const hg_node_config config = {.detector = &detector, .message = messages, .verdict = &own, .status = &own, .heartbeat = 5U};
    const size_t real = sizeof(hg_real);
    const table read[] = {{products, 6U}, {f_factor, 2U}, {h_factor, 2U}, {parent, 4U}, {factor, 4U}, {noise, 3U}, {moment, 3U}, {cut_moment, 2U}, {cut_state, 2U},
                          {signal, 2U}, {input, 2U}, {f, 2U * real}, {h, 2U * real}, {mean, 3U * real}, {covariance, 9U * real}, {cut_scale, 2U * real}, {box, 3U * real},
                          {x0, 3U * real}, {P0, 9U * real}, {M0, 9U * real}, {Q, 3U * real}, {r, 2U * real}, {range, 2U * real}, {fresh, 2U * real}, {gain, 2U * real},
                          {zero, 2U * real}, {drive, 6U * real}, {direct, 4U * real}, {known, 2U * real}};
    const table fields_of[] = {{&several[0].filter.reach, real}, {&several[0].filter.drift, real}, {&several[0].settle, 1U}, {&several[1].settle, 1U}};
    every_bit_counts(&config, read, COUNT(read));
    nothing_behind_counts(&config, read, COUNT(read));
    every_bit_counts(&config, fields_of, COUNT(fields_of));
    const table bound[] = {{cut_moment, 0U}, {cut_state, 0U}, {cut_scale, 0U}, {box, 0U}, {&several[0].filter.reach, 0U}};
    several[0].filter.bounded = false;
    several[1].filter.bounded = false;
    nothing_behind_counts(&config, bound, COUNT(bound)); /* not there without a bound */
    several[0].filter.states = 0U; /* a wrong number: nothing before the tables is read */
    several[1].filter.states = 0U;
    const table terms[] = {{f, 0U}, {f_factor, 0U}};
    nothing_behind_counts(&config, terms, COUNT(terms));
}

/* The digest of tables stands in files that were generated long ago: what goes into it, and in which order, must not change. */
static void a_flag_is_a_word_of_its_own(void **state)
{
    (void)state;
    static uint16_t starts[2] = {0U, 0U};
    static hg_real none[2];
    static hg_statistic_config statistic;
    statistic.filter.bounded = true;
    statistic.filter.start = starts;
    statistic.filter.M0 = none;
    uint32_t crc = 0U;
    const uint32_t head[] = {0U, 0U, 0U, 0U, 0U, 1U, 0U, 0U, 0U, 0U, 0U, 0U}; /* inputs and settle, sizes, */
    for (size_t i = 0U; i < COUNT(head); i++) {
        crc = hg_crc32c(crc, head[i], 4U);
    }
    crc = hg_crc32c(hg_crc32c(crc, 0U, 4U), 0U, 4U); /* widths of the maps, */
    crc = hg_crc32c(crc, 0U, 2U);                    /* where the products begin, */
    for (size_t i = 0U; i < 6U; i++) {
        crc = hg_crc32c_real(crc, R(0)); /* reach, the moment of 1, and four levels */
    }
    hg_digest walk;
    hg_digest_start(&walk);
    hg_digest_open(&walk, UINT32_MAX);
    hg_digest_statistic(&walk, &statistic);
    assert_true(walk.crc == crc);
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

static uint32_t digest_of_tracker(const hg_tracker_config *config)
{
    hg_digest walk;
    hg_digest_start(&walk);
    assert_status(HG_OK, hg_digest_tracker(&walk, config, hg_digest_tracker_head(config), UINT32_MAX));
    return walk.crc;
}

static void inputs_and_early_silence_of_a_fusion_filter(void **state)
{
    (void)state;
    static hg_real B[(HG_FUSION_STATES_MAX * 2U) + 1U], early[HG_FUSION_SENSORS_MAX], row[HG_FUSION_STATES_MAX];
    hg_tracker_config config = hg_tracking_config;
    hg_fusion_config fusion = *config.fusion;
    hg_fusion_table only = fusion.table[0];
    config.fusion = &fusion;
    fusion.inputs = 2U;
    fusion.B = B;
    fusion.delay = 0U;
    fusion.tables = 1U;
    fusion.table = &only;
    fusion.rates = 1U;
    only.early = early;
    const uint32_t good = digest_of_tracker(&config);
    const uint32_t numbers_of_B = 2U * (uint32_t)fusion.states;
    for (uint32_t i = 0U; i <= numbers_of_B; i++) {
        B[i] = R(1);
        assert_int_equal(i < numbers_of_B, digest_of_tracker(&config) != good);
        B[i] = R(0);
    }
    early[0] = R(1); /* nobody reads it: frames are never late */
    assert_true(digest_of_tracker(&config) == good);
    /* What may not be there stands in the head. */
    const uint32_t head = hg_digest_tracker_head(&config);
    config.consistency = NULL;
    assert_true(hg_digest_tracker_head(&config) != head);
    config.consistency = hg_tracking_config.consistency;
    fusion.origin = (fusion.origin == NULL) ? row : NULL;
    assert_true(hg_digest_tracker_head(&config) != head);
}

/* ---- unknown-input observers and what isolates their faults ---- */

static uint32_t digest_of_isolation(const hg_isolate_config *config, uint8_t count)
{
    hg_digest walk;
    hg_digest_start(&walk);
    assert_status(HG_OK, hg_digest_isolate(&walk, config, count, UINT32_MAX));
    return walk.crc;
}

static void every_bit_of_an_isolation(void **state)
{
    (void)state;
    static uint8_t sensor[2] = {1U, 2U};
    static hg_real limit[2], whole[6], excitation[2];
    hg_isolate_config config[2];
    config[0] = (hg_isolate_config){.estimates = 3U, .sensors = 2U, .sensor = sensor, .sensor_limit = limit, .components = 2U, .whole = whole, .excitation = excitation,
                                    .low_pass = R(0.5), .release = 1U, .block = 1U, .blocks = 1U, .explained = R(0.5), .steady = R(5)};
    config[1] = config[0];
    const table tables[] = {TABLE(sensor), TABLE(limit), TABLE(whole), TABLE(excitation), {&config[0].settle, 4U}, {&config[1].steady, sizeof(hg_real)}};
    const uint32_t good = digest_of_isolation(config, 2U);
    for (size_t i = 0U; i < COUNT(tables); i++) {
        uint8_t *byte = tables[i].data;
        for (size_t b = 0U; b < (8U * tables[i].bytes); b++) {
            const uint8_t bit = (uint8_t)(1U << (b % 8U));
            byte[b / 8U] ^= bit;
            assert_true(digest_of_isolation(config, 2U) != good);
            byte[b / 8U] ^= bit;
        }
    }
    assert_true(digest_of_isolation(config, 2U) == good);
}

static void a_walk_over_observers_may_be_cut_too(void **state)
{
    (void)state;
    hg_digest walk;
    hg_digest_start(&walk);
    assert_status(HG_E_BUSY, hg_suspension_uio_check(&walk, 5U));
    assert_count(5, walk.done);
    hg_digest_start(&walk);
    assert_status(HG_E_BUSY, hg_suspension_uio_isolate_check(&walk, 5U));
    assert_count(5, walk.done);
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
        cmocka_unit_test(certificates),
        cmocka_unit_test(a_hull_ends_with_its_last_signal),
        cmocka_unit_test(the_head_says_whether_there_are_hulls),
        cmocka_unit_test(filters_that_keep_the_remainder),
        cmocka_unit_test(a_flag_is_a_word_of_its_own),
        cmocka_unit_test(the_same_of_a_fusion_filter),
        cmocka_unit_test(inputs_and_early_silence_of_a_fusion_filter),
        cmocka_unit_test(every_bit_of_an_isolation),
        cmocka_unit_test(a_walk_over_observers_may_be_cut_too),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
