/* An unknown-input observer beside a detector, the isolation that reads its estimates, and the walks over the tables of both and of a statistical judge. */
#include "small.h"

#include "two_state.h"

#include "hullguard/digest_uio.h"
#include "hullguard/isolate.h"
#include "hullguard/uio.h"

volatile int any;
volatile hg_real any_real;

#define ORDER 2U
#define ESTIMATES 3U
#define COMPONENTS 2U
#define SENSORS 1U
#define BLOCKS 2U
#define PART 11U /* numbers of a step of a walk */
#define PARTS 16U

static const hg_real table[] = {HG_REAL_C(0.0625), HG_REAL_C(-0.0625), HG_REAL_C(0.0625), HG_REAL_C(0.0625), HG_REAL_C(0.125), HG_REAL_C(0.125),
                                HG_REAL_C(0.0625), HG_REAL_C(0.0625),  HG_REAL_C(0.125),  HG_REAL_C(0.0625), HG_REAL_C(0.125), HG_REAL_C(0.125),
                                HG_REAL_C(0.0625), HG_REAL_C(0.0625),  HG_REAL_C(0.125),  HG_REAL_C(0.0625), HG_REAL_C(0.125), HG_REAL_C(0.125)};
static const hg_uio_config uio_config[] = {
    {.actuators = 1U, .sensors = 1U, .unknown = 0U, .states = 1U,
     .observer = {.order = ORDER, .residuals = ESTIMATES, .width = SIGNALS, .signal = sent_places, .state = {ORDER, ORDER, 0, table},
                  .input = {ORDER, SIGNALS, 0, table}, .output = {ESTIMATES, ORDER, 0, table}, .direct = {ESTIMATES, SIGNALS, 0, table}},
     .hull = {.residuals = ESTIMATES, .width = SIGNALS, .signal = sent_places, .taps = taps, .weight = table, .settle = 1U, .rest = numbers, .rest_left = numbers,
              .moving = numbers, .moving_left = numbers, .bias = numbers, .ready_rest = 0U, .ready_moving = 2U, .decay = numbers, .modes = ORDER,
              .mode_decay = numbers, .mode_input = numbers, .mode_output = numbers, .mode_rest = numbers, .mode_moving = numbers}}};

static const uint8_t sensor[SENSORS] = {1U};
static const hg_isolate_config isolate_config = {.estimates = ESTIMATES, .actuator = 0U, .limit = HG_REAL_C(0.25), .sensors = SENSORS, .sensor = sensor, .sensor_limit = numbers,
                                                 .components = COMPONENTS, .whole = table, .excitation = numbers, .low_pass = HG_REAL_C(0.5), .settle = 1U, .release = 2U,
                                                 .block = 2U, .blocks = BLOCKS, .explained = HG_REAL_C(0.75), .steady = HG_REAL_C(5.0)};

static hg_real of_uio[HG_UIO_REALS(ORDER, SIGNALS, ESTIMATES, ORDER)];
static hg_real of_isolate[HG_ISOLATE_REALS(COMPONENTS, BLOCKS)];
static hg_real data[HG_RING_REALS(SIGNALS, HISTORY)];
static hg_real value[SIGNALS];

/* The samples of a detector, as far as an observer reads them. */
static void follow(hg_detector *detector, hg_uio *uio, hg_isolate *isolate)
{
    hg_real estimate[ESTIMATES];
    hg_real radius[ESTIMATES];
    hg_isolation found;
    hg_real *row = hg_ring_open(&detector->radii);
    for (uint8_t g = 0U; g < SIGNALS; g++) {
        value[g] = any_real;
        row[g] = any_real;
    }
    detector->beginnings = (uint32_t)any;
    (void)hg_uio_follow(uio, detector, estimate, radius);
    (void)hg_uio_ready(uio);
    (void)hg_isolate_step(isolate, estimate, radius, &found);
    if (maybe()) {
        for (uint8_t e = 0U; e < ESTIMATES; e++) { /* an isolation takes any numbers, an observer's or not */
            estimate[e] = any_real;
            radius[e] = any_real;
        }
        (void)hg_isolate_step(isolate, estimate, radius, &found);
    }
    if (maybe()) {
        hg_isolate_reset(isolate);
    }
}

/* A few numbers at a time, and all at once. */
static void walk(void)
{
    hg_digest digest;
    hg_digest_start(&digest);
    for (uint8_t i = 0U; i < PARTS; i++) {
        (void)hg_digest_uio(&digest, uio_config, 1U, PART);
    }
    hg_digest_start(&digest);
    (void)hg_digest_isolate(&digest, &isolate_config, 1U, UINT32_MAX);
    hg_digest_open(&digest, UINT32_MAX);
    hg_digest_statistic(&digest, hg_two_state_config.detector->polynomial);
}

int main(void)
{
    hg_detector detector = {.value = value};
    static hg_uio uio;
    static hg_isolate isolate;
    if ((hg_ring_start(&detector.radii, SIGNALS, HISTORY, data) == HG_OK) && (hg_uio_start(&uio, uio_config, &detector.radii, any_start(), of_uio) == HG_OK) &&
        (hg_isolate_start(&isolate, &isolate_config, of_isolate) == HG_OK)) {
        while (maybe()) {
            follow(&detector, &uio, &isolate);
        }
    }
    walk();
    return 0;
}
