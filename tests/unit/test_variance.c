/** @file
 *  variance.h: the running sums against the plain definition in double precision, on windows of every size and on the largest codes. */
#include "support.h"

#include "hullguard/variance.h"

/* (W - 1) or (W - 2) times the variance about the mean or the line, by definition. */
static double squares(const int16_t *y, uint32_t W, bool detrended)
{
    double mean = 0.0;
    double slope = 0.0;
    double spread = 0.0;
    for (uint32_t j = 0U; j < W; j++) {
        mean += (double)y[j] / W;
    }
    for (uint32_t j = 0U; detrended && (j < W); j++) {
        const double t = j - ((W - 1.0) / 2.0);
        slope += t * y[j];
        spread += t * t;
    }
    slope = detrended ? (slope / spread) : 0.0;
    double sum = 0.0;
    for (uint32_t j = 0U; j < W; j++) {
        const double rest = y[j] - mean - (slope * (j - ((W - 1.0) / 2.0)));
        sum += rest * rest;
    }
    return sum;
}

static void start_tells_null_and_range(void **state)
{
    (void)state;
    hg_variance self;
    int16_t memory[3];
    hg_variance_config c = {.window = 3U, .detrended = false, .level = 0};
    assert_status(HG_E_ARGUMENT, hg_variance_start(NULL, &c, memory));
    assert_status(HG_E_ARGUMENT, hg_variance_start(&self, NULL, memory));
    assert_status(HG_E_ARGUMENT, hg_variance_start(&self, &c, NULL));
    c.window = 2U;
    assert_status(HG_E_CONFIG, hg_variance_start(&self, &c, memory));
    c.window = 3U;
    c.level = -1;
    assert_status(HG_E_CONFIG, hg_variance_start(&self, &c, memory));
    c.level = 0;
    assert_status(HG_OK, hg_variance_start(&self, &c, memory));
}

/* The level is put just below and just above what the window scatters by: the answers must differ. */
static void it_speaks_above_its_level(void **state)
{
    (void)state;
    static const uint8_t windows[] = {3U, 4U, 10U, 64U, 255U};
    uint32_t seed = seed_of_run(21U);
    for (size_t w = 0U; w < COUNT(windows); w++) {
        for (uint32_t kind = 0U; kind < 6U; kind++) {
            const uint32_t W = windows[w];
            const bool detrended = (kind % 2U) == 1U;
            const int32_t size = (kind < 2U) ? 3 : ((kind < 4U) ? 1000 : 32767);
            hg_variance_config c = {.window = windows[w], .detrended = detrended, .level = 0};
            hg_variance self;
            int16_t memory[255];
            int16_t course[700];
            assert_status(HG_OK, hg_variance_start(&self, &c, memory));
            for (uint32_t k = 0U; k < COUNT(course); k++) {
                course[k] = (int16_t)((kind >= 4U) ? (((draw(&seed) % 2U) == 0U) ? -size - 1 : size) : draw_between(&seed, -size, size));
                const double factor = detrended ? ((double)W * (((double)W * W) - 1.0)) : (double)W;
                const double expected = (k + 1U >= W) ? factor * squares(&course[k + 1U - W], W, detrended) : 0.0;
                const bool above = (k % 2U) == 0U;
                c.level = (int64_t)(expected * (above ? 1.0000001 : 0.9999999)) + (above ? 1 : -1);
                c.level = (c.level < 0) ? 0 : c.level;
                const hg_status status = hg_variance_step(&self, course[k]);
                if (k + 1U < W) {
                    assert_status(HG_OK, status);
                } else if (above || (expected < 1.5)) {
                    assert_status(((double)c.level < expected - 0.5) ? HG_OK : HG_E_EMPTY, status);
                } else {
                    assert_status(HG_OK, status);
                }
            }
        }
    }
}

static void a_straight_line_is_no_scatter_but_motion_is(void **state)
{
    (void)state;
    hg_variance about_mean;
    hg_variance about_line;
    int16_t memory[2][20];
    const hg_variance_config mean = {.window = 20U, .detrended = false, .level = 0};
    const hg_variance_config line = {.window = 20U, .detrended = true, .level = 0};
    assert_status(HG_OK, hg_variance_start(&about_mean, &mean, memory[0]));
    assert_status(HG_OK, hg_variance_start(&about_line, &line, memory[1]));
    for (int32_t k = 0; k < 1000; k++) {
        const int16_t y = (int16_t)(-30000 + (60 * k));
        assert_status(HG_OK, hg_variance_step(&about_mean, y));
        assert_status((k < 19) ? HG_OK : HG_E_EMPTY, hg_variance_step(&about_line, y));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_tells_null_and_range),
        cmocka_unit_test(it_speaks_above_its_level),
        cmocka_unit_test(a_straight_line_is_no_scatter_but_motion_is),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
