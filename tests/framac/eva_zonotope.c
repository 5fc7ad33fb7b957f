/* A detector whose threshold is a zonotope, of each reduction: a disc and an interval, columns that come in and go, radii that grow later. */
#include "small.h"

volatile int any;

#define ORDER 3U
#define COLUMNS 4U
#define DISTURBANCES 1U
#define NUMBERS ((2U * SIGNALS) + 2U + HG_HOLD_REALS(SIGNALS) + HG_RING_REALS(SIGNALS, HISTORY) + HG_RESIDUAL_REALS(1U, 2U) + HG_ZONOTOPE_REALS(ORDER, COLUMNS, SIGNALS + DISTURBANCES))

static const uint8_t block[] = {2U, 1U};
static const hg_real lam[] = {HG_REAL_C(0.5), HG_REAL_C(-0.25), HG_REAL_C(0.25), HG_REAL_C(0.5), HG_REAL_C(0.75)};
static const hg_real decay[] = {HG_REAL_C(0.5625), HG_REAL_ZERO};
static const hg_real column[] = {HG_REAL_C(0.5), HG_REAL_C(0.25), HG_REAL_C(-0.5), HG_REAL_C(0.125), HG_REAL_C(0.5), HG_REAL_C(1.0)};
static const hg_residual_config observer[] = {
    {.order = 1U, .residuals = 1U, .width = SIGNALS, .signal = sent_places, .state = {1U, 1U, 0, numbers}, .input = {1U, SIGNALS, 0, numbers},
     .output = {1U, 1U, 0, numbers}, .direct = {1U, SIGNALS, 0, numbers}}};

#define SET(how)                                                                                                                                               \
    {                                                                                                                                                          \
        .order = ORDER, .residuals = 1U, .width = SIGNALS, .disturbances = DISTURBANCES, .initial = 1U, .columns = COLUMNS, .blocks = 2U, .reduction = (how),   \
        .signal = sent_places, .block = block, .state = lam, .input = column, .disturbance = column, .rest = column, .moving = column, .output = column,       \
        .outer = numbers, .direct = numbers, .settle = 1U, .bias_rest = numbers, .bias_moving = numbers, .decay = decay, .always = numbers, .growth = numbers, \
        .output_growth = numbers, .recover = 3U, .ready_rest = 0U, .ready_moving = 2U                                                                          \
    }
static const hg_zonotope_config truncated[] = {SET(HG_REDUCTION_TRUNCATE)};
static const hg_zonotope_config boxed[] = {SET(HG_REDUCTION_BOX)};
static const hg_zonotope_config rounded[] = {SET(HG_REDUCTION_BALL)};

#define DETECTOR(set)                                                                                                                              \
    {                                                                                                                                              \
        .signals = SIGNALS, .width = SIGNALS, .groups = GROUPS, .hold = hold_config, .generators = 1U, .residual = observer, .zonotope = (set),    \
        .decision = {.generators = 1U, .feeds = feeds, .faults = faults, .up = 1U, .down = 3U, .latch = false}, .history = HISTORY, .residuals = 1U, \
        .codes = HG_HOLD_CODES(SIGNALS), .reals = NUMBERS                                                                                          \
    }
static const hg_detector_config detectors[] = {DETECTOR(truncated), DETECTOR(boxed), DETECTOR(rounded)};

static hg_hold hold[GROUPS];
static hg_residual residual[1];
static hg_zonotope zonotope[1];
static hg_alarm alarm[1];
static int32_t code[HG_HOLD_CODES(SIGNALS)];
static hg_real real[NUMBERS];

/* One call of a detector, whichever. */
static void call(hg_detector *self)
{
    const int32_t sent[1] = {any};
    const uint8_t group = (uint8_t)Frama_C_unsigned_int_interval(0U, GROUPS);
    hg_finding finding;
    switch (any) {
    case 0:
        (void)hg_detector_receive(self, group, sent, maybe());
        break;
    case 1:
        (void)hg_detector_lose(self, group);
        break;
    case 2:
        hg_detector_restart(self, any_start());
        break;
    default:
        (void)hg_detector_step(self, &finding);
        break;
    }
}

static void run(const hg_detector_config *config)
{
    const hg_detector_memory memory = {.hold = hold, .residual = residual, .zonotope = zonotope, .alarm = alarm, .code = code, .codes = LENGTH_OF(code),
                                       .real = real, .reals = LENGTH_OF(real)};
    hg_detector self;
    if (hg_detector_start(&self, config, &memory, any_start()) == HG_OK) {
        while (maybe()) {
            call(&self);
        }
    }
}

int main(void)
{
    run(&detectors[0]);
    run(&detectors[1]);
    run(&detectors[2]);
    return 0;
}
