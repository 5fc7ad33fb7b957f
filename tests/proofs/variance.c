/** @file
 *  variance.h: when a sensor's samples scatter. */
#include "proof.h"

#include "hullguard/variance.h"

/** The running sums are those of the samples in the window, exactly, and the sensor is silent only with a full window that scatters no more than the level.
 *  Any window up to WINDOW, SAMPLES samples of any codes, with and without trend.
 *  @proves hg_variance_start hg_variance_step
 *  @run check real=f32 unwind=8 limit=30 WINDOW=3U SAMPLES=5U */
void proof_variance_sums(void)
{
    int16_t memory[WINDOW];
    int16_t y[SAMPLES];
    hg_variance self;
    const hg_variance_config config = {.window = any_u8_in(0U, WINDOW), .detrended = any_bool(), .level = any_i64()};
    const hg_status started = hg_variance_start(&self, &config, TAIL(memory, config.window));
    prove((started == HG_OK) == ((config.window >= 3U) && (config.level >= 0)), "window and level in range");
    prove((hg_variance_start(NULL, &config, memory) == HG_E_ARGUMENT) && (hg_variance_start(&self, NULL, memory) == HG_E_ARGUMENT) &&
              (hg_variance_start(&self, &config, NULL) == HG_E_ARGUMENT),
          "null pointers");
    assume(started == HG_OK);
    (void)hg_variance_start(&self, &config, TAIL(memory, config.window));
    hg_status status = HG_OK;
    for (uint8_t k = 0U; k < SAMPLES; k++) {
        y[k] = any_i16();
        status = hg_variance_step(&self, y[k]);
        prove((status == HG_OK) || (status == HG_E_EMPTY), "no other status");
        prove(((k + 1U) >= config.window) || (status == HG_OK), "it speaks until the window is full");
    }
    int64_t S1 = 0;
    int64_t S2 = 0;
    int64_t T1 = 0;
    for (uint8_t j = 0U; j < config.window; j++) {
        const int64_t sample = y[(SAMPLES - config.window) + j];
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
 *  Any sums with |S1| <= W 2^15, 0 <= S2 <= W 2^30, S1^2 <= W S2, |T1| <= W (W - 1) 2^14 and |2 T1 - (W - 1) S1| <= W^2 2^14, which the samples' own have, before and after.
 *  @proves hg_variance_step
 *  @run check real=f32 unwind=4 limit=30 WINDOW=255 */
void proof_variance_range(void)
{
    int16_t memory[WINDOW];
    const hg_variance_config config = {.window = WINDOW, .detrended = any_bool(), .level = any_i64()};
    hg_variance self = {.config = &config, .y = memory, .S1 = any_i64(), .S2 = any_i64(), .T1 = any_i64(), .oldest = any_u8_in(0U, WINDOW - 1U), .held = WINDOW};
    const int64_t W = WINDOW;
    const int16_t code = any_i16();
    const int64_t old = memory[self.oldest];
    /* After the step, in which the oldest leaves and the newest comes in. */
    const int64_t S1 = any_i64();
    const int64_t T1 = any_i64();
    const int64_t S2 = any_i64();
    assume((S1 >= -(W * 32768)) && (S1 <= (W * 32768)) && (S2 >= 0) && (S2 <= (W * 1073741824)) && ((S1 * S1) <= (W * S2)));
    assume((T1 >= -(W * (W - 1) * 16384)) && (T1 <= (W * (W - 1) * 16384)));
    const int64_t slope = (2 * T1) - ((W - 1) * S1);
    assume((slope >= -(W * W * 16384)) && (slope <= (W * W * 16384)));
    self.S1 = (S1 - code) + old;
    self.S2 = (S2 - ((int64_t)code * code)) + (old * old);
    self.T1 = (T1 - ((W - 1) * code)) + (self.S1 - old);
    const hg_status status = hg_variance_step(&self, code);
    prove((self.S1 == S1) && (self.S2 == S2) && (self.T1 == T1), "the sums after the step");
    if (status == HG_OK) {
        reach("end");
    }
}
