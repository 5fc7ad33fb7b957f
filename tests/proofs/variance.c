/** @file
 *  variance.h: when a sensor's samples scatter. */
#include "proof.h"

#include "hullguard/variance.h"

/** The running sums are those of the samples in the window, exactly, and the sensor is silent only with a full window; null pointers and numbers out of range are refused.
 *  A window of WINDOW, SAMPLES samples of any codes of BITS bits, with and without trend.
 *  @proves hg_variance_start hg_variance_step
 *  @run check real=f32 unwind=8 limit=150 WINDOW=3U SAMPLES=4U BITS=2
 *  @run deep real=f32 unwind=8 limit=600 WINDOW=3U SAMPLES=4U BITS=3
 *  @run deep real=f32 unwind=10 limit=3600 WINDOW=4U SAMPLES=8U BITS=8 */
void proof_variance_sums(void)
{
    int16_t memory[WINDOW];
    int16_t y[SAMPLES];
    hg_variance self;
    const hg_variance_config any = {.window = any_u8(), .detrended = any_bool(), .level = any_i64()};
    prove((hg_variance_start(&self, &any, memory) == HG_OK) == ((any.window >= 3U) && (any.level >= 0)), "window and level in range");
    const hg_variance_config config = {.window = WINDOW, .detrended = any_bool(), .level = 0};
    prove((hg_variance_start(NULL, &config, memory) == HG_E_ARGUMENT) && (hg_variance_start(&self, NULL, memory) == HG_E_ARGUMENT) &&
              (hg_variance_start(&self, &config, NULL) == HG_E_ARGUMENT),
          "null pointers");
    prove(hg_variance_start(&self, &config, memory) == HG_OK, "it starts");
    for (uint8_t k = 0U; k < SAMPLES; k++) {
        struct {
            signed int code : BITS;
        } any_code;
        y[k] = (int16_t)any_code.code;
        const hg_status status = hg_variance_step(&self, y[k]);
        prove((status == HG_OK) || (status == HG_E_EMPTY), "no other status");
        prove(((k + 1U) >= WINDOW) || (status == HG_OK), "it speaks until the window is full");
    }
    int64_t S1 = 0;
    int64_t S2 = 0;
    int64_t T1 = 0;
    for (uint8_t j = 0U; j < WINDOW; j++) {
        const int64_t sample = y[(SAMPLES - WINDOW) + j];
        S1 += sample;
        S2 += sample * sample;
        T1 += j * sample;
    }
    prove(self.S1 == S1, "S1");
    prove(self.T1 == T1, "T1");
    prove(self.S2 == S2, "S2");
    reach("end");
}

/** No sum overflows in the largest window: of sums that WINDOW samples of 16 bits can have, the next step's arithmetic stays within 64 bits.
 *  Any sums with |S1| <= W 2^15, 0 <= S2 <= W 2^30, |T1| <= W^2 2^14 and |2 T1 - (W - 1) S1| <= W^2 2^14, which the samples' own have; a window that fills with any
 *  code, and a full one whose oldest and newest samples are 0.
 *  @proves hg_variance_step
 *  @run deep real=f32 unwind=4 limit=3600 WINDOW=255 */
void proof_variance_range(void)
{
    int16_t memory[WINDOW];
    const int64_t W = WINDOW;
    const hg_variance_config config = {.window = WINDOW, .detrended = any_bool(), .level = any_i64()};
    const int64_t S1 = any_i64();
    const int64_t S2 = any_i64();
    const int64_t T1 = any_i64();
    assume((S1 >= -(W * 32768)) && (S1 <= (W * 32768)) && (S2 >= 0) && (S2 <= (W * 1073741824)) && (T1 >= -(W * W * 16384)) && (T1 <= (W * W * 16384)));
    const int64_t slope = (2 * T1) - ((W - 1) * S1);
    assume((slope >= -(W * W * 16384)) && (slope <= (W * W * 16384)));
    hg_variance filling = {.config = &config, .y = memory, .S1 = S1, .S2 = S2, .T1 = T1, .oldest = 0U, .held = any_u8_in(0U, WINDOW - 2U)};
    prove(hg_variance_step(&filling, any_i16()) == HG_OK, "not full yet");
    hg_variance full = {.config = &config, .y = memory, .S1 = S1, .S2 = S2, .T1 = T1 + S1, .oldest = 0U, .held = WINDOW};
    memory[0] = 0;
    (void)hg_variance_step(&full, 0);
    prove((full.S1 == S1) && (full.T1 == T1) && (full.oldest == 1U), "the sums after the step");
    reach("end");
}
