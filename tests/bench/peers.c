/** @file
 *  Other libraries at work of the same size as a model's, for counting. Each is called by a function of its own, whose name the count looks for. */

#include "arm_math.h"
#include "console.h"
#include "crc8.h"
#include "kalman.h"
#include "peer.h"

#define ROUNDS 64U
#define FIR_TAPS (RECORD_HULL_COLUMNS / RECORD_HULL_WIDTH)
#define FIRS (RECORD_HULL_ROWS * RECORD_HULL_WIDTH)
#define POOL 8192U

void *peers_malloc(size_t bytes);
void peer_hull(void);
void peer_fir(void);
void peer_residual(void);
void peer_kalman(void);
void peer_frame(void);

static float32_t table[RECORD_HULL_ROWS * RECORD_HULL_COLUMNS];
static float32_t vector[RECORD_HULL_COLUMNS];
static float32_t past[FIRS][FIR_TAPS];
static volatile float32_t seen;
static arm_matrix_instance_f32 hull = {RECORD_HULL_ROWS, RECORD_HULL_COLUMNS, table};
static arm_matrix_instance_f32 residual = {RECORD_RESIDUAL_ROWS, RECORD_RESIDUAL_COLUMNS, table};
static arm_fir_instance_f32 fir[FIRS];
static KalmanFilter filter;
static uint8_t bytes[8] = {0x00, 0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0xDE};

void *peers_malloc(size_t size)
{
    static uint64_t pool[POOL / sizeof(uint64_t)];
    static size_t used;
    void *const piece = &pool[used];
    used += (size + sizeof(pool[0]) - 1U) / sizeof(pool[0]);
    if (used > (POOL / sizeof(pool[0]))) {
        __builtin_trap();
    }
    return piece;
}

/* The threshold: all tables times all past radii. */
__attribute__((noinline)) void peer_hull(void)
{
    float32_t out[RECORD_HULL_ROWS];
    arm_mat_vec_mult_f32(&hull, vector, out);
    seen = out[0];
}

/* The same as filters: one for each residual and signal, one sample of each. */
__attribute__((noinline)) void peer_fir(void)
{
    float32_t sum = 0.0F;
    for (size_t i = 0U; i < FIRS; i++) {
        float32_t out;
        arm_fir_f32(&fir[i], &vector[i], &out, 1U);
        sum += out;
    }
    seen = sum;
}

/* The residual generator: states and residuals from states and signals. */
__attribute__((noinline)) void peer_residual(void)
{
    float32_t out[RECORD_RESIDUAL_ROWS];
    arm_mat_vec_mult_f32(&residual, vector, out);
    seen = out[0];
}

/* A Kalman filter with the model's states and measurements: what innovation-based detection steps. */
__attribute__((noinline)) void peer_kalman(void)
{
    update(filter);
    seen = filter.innovation.data[0][0];
}

/* A frame of eight bytes: its checksum, its signals as integers. */
__attribute__((noinline)) void peer_frame(void)
{
    struct peer_measurement_t message;
    const crc8_t crc = crc8_finalize(crc8_update(crc8_init(), &bytes[1], sizeof(bytes) - 1U));
    const int unpacked = peer_measurement_unpack(&message, bytes, sizeof(bytes));
    seen = (float32_t)(message.gap12_m + message.gap23_m + message.speed1_mps + (int)crc + unpacked);
}

static float32_t draw(uint32_t *random)
{
    *random = (*random * 1664525U) + 1013904223U;
    return (float32_t)((int32_t)(*random >> 8U) - 0x800000) / 8388608.0F;
}

/* A filter that settles: states that decay, each seen by a measurement. */
static void start_filter(uint32_t *random)
{
    filter = alloc_filter(RECORD_STATES, RECORD_MEASUREMENTS);
    for (int i = 0; i < RECORD_STATES; i++) {
        for (int j = 0; j < RECORD_STATES; j++) {
            filter.state_transition.data[i][j] = (i == j) ? 0.9F : (0.05F * draw(random));
            filter.process_noise_covariance.data[i][j] = (i == j) ? 0.01F : 0.0F;
            filter.estimate_covariance.data[i][j] = (i == j) ? 1.0F : 0.0F;
        }
    }
    for (int i = 0; i < RECORD_MEASUREMENTS; i++) {
        for (int j = 0; j < RECORD_STATES; j++) {
            filter.observation_model.data[i][j] = draw(random);
        }
        filter.observation_noise_covariance.data[i][i] = 0.01F;
    }
}

int main(void)
{
    uint32_t random = 1U;
    for (size_t i = 0U; i < (sizeof(table) / sizeof(table[0])); i++) {
        table[i] = draw(&random);
    }
    for (size_t i = 0U; i < FIRS; i++) {
        arm_fir_init_f32(&fir[i], FIR_TAPS, table, past[i], 1U);
    }
    start_filter(&random);
    for (uint32_t k = 0U; k < ROUNDS; k++) {
        for (size_t i = 0U; i < RECORD_HULL_COLUMNS; i++) {
            vector[i] = draw(&random);
        }
        for (int i = 0; i < RECORD_MEASUREMENTS; i++) {
            filter.observation.data[i][0] = vector[i];
        }
        bytes[0] = (uint8_t)k;
        peer_hull();
        peer_fir();
        peer_residual();
        peer_kalman();
        peer_frame();
    }
    console_write("peers end\n", 10U);
    return ((seen == seen) && (filter.state_estimate.data[0][0] > -1.0e3F) && (filter.state_estimate.data[0][0] < 1.0e3F)) ? 0 : 1; /* no NaN, no runaway */
}
