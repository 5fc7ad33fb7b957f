/* A filter on its own, with what no tracker calls: values that wrap round, what a frame says of the past, sensors in the fusion. Two states, two sensors, an
   input, an origin that moves; one sample is held: that no slot beyond those that are held is read is a relation of two numbers (wp/fusion.acsl). */
#include "drive.h"

#include "hullguard/fusion.h"

volatile int any;
volatile hg_real any_real;

#define STATES 2U
#define INPUTS 1U
#define SENSORS 2U
#define DEPTH 0U

static const hg_real unit[STATES * STATES] = {HG_REAL_C(1.0), HG_REAL_C(0.0), HG_REAL_C(0.0), HG_REAL_C(1.0)};
static const hg_real numbers[STATES * STATES] = {HG_REAL_C(0.25), HG_REAL_C(0.125), HG_REAL_C(0.125), HG_REAL_C(0.25)};
static const hg_real ranges[SENSORS] = {HG_REAL_C(100.0), HG_REAL_C(100.0)};
static const hg_fusion_table table[] = {{.alive = 0x3U, .level = numbers, .relax = numbers, .early = numbers}};
static const hg_fusion_config config = {
    .states = STATES, .inputs = INPUTS, .sensors = SENSORS, .depth = DEPTH, .delay = 0U, .heartbeat = 3U, .watchdog = 9U, .modulus = 16U, .trigger = HG_FUSION_INNOVATION,
    .A = unit, .B = numbers, .Q = numbers, .x0 = numbers, .P0 = numbers, .select = NULL, .C = numbers, .R = numbers, .range = ranges, .huber = HG_REAL_C(3.0),
    .origin = numbers, .rates = 1U, .rate_step = HG_REAL_C(0.5), .loss = HG_REAL_C(0.25), .smoothing = HG_REAL_C(0.125), .tables = 1U, .table = table};

static hg_fusion fusion;
static hg_fusion_slot slot[DEPTH + 1U];
static hg_fusion_entry entry[(DEPTH + 1U) * SENSORS];
static hg_fusion_sensor sensor[SENSORS];
static hg_fusion_record record[SENSORS];
static int32_t origin[STATES];
static hg_real real[HG_FUSION_REALS(STATES, INPUTS, SENSORS, DEPTH)];

/* Whatever can be booked of a sample. */
static void book(uint8_t i)
{
    const uint8_t stamp = (uint8_t)any;
    const hg_real y = hg_fusion_unwrap(&fusion, i, stamp, hg_fusion_local(&fusion, i, stamp, any_real), HG_REAL_C(64.0));
    (void)hg_fusion_receive(&fusion, i, stamp, (uint8_t)any, y);
    (void)hg_fusion_recall(&fusion, i, stamp, (uint8_t)any, any_real);
    (void)hg_fusion_alive(&fusion);
}

int main(void)
{
    const hg_fusion_memory memory = {.slot = slot, .entry = entry, .sensor = sensor, .record = record, .origin = origin, .real = real};
    if ((hg_fusion_start(&fusion, &config, &memory) == HG_OK) && (hg_fusion_open(&fusion, numbers) == HG_OK)) { /* a slot has its table from then on */
        while (maybe()) {
            const hg_real u[INPUTS] = {any_real};
            (void)hg_fusion_open(&fusion, u);
            book(0U);
            book(1U);
            (void)hg_fusion_close(&fusion);
            hg_fusion_exclude(&fusion, 1U, maybe());
        }
    }
    return 0;
}
