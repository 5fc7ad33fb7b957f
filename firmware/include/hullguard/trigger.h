/** @file
 *  When a sender speaks: the adaptive hybrid event trigger (methods, platoon, section 4), and the reasoning about it that the receiver
 *  repeats. Sender and receiver compute on the same integers, the raw codes on the wire, by the same functions: they agree by construction.
 *
 *      send at k when  k - k_i >= interval_max,
 *      or when         k - k_i >  silence[level]  and, in any channel g,  |code_g(k) - sent_g| > threshold_g(level, sent_g)
 *      threshold_g   = sigma_g[level] + floor(delta_g[level] |sent_g - zero_g| / 65536)
 *      level         = the highest level l with |sent_g - previously sent_g| >= activity_g[l] in some channel g; 0 is the quietest
 *
 *  A silent sender therefore promises |code - sent| <= threshold, that is |y - decode(sent)| <= (threshold + 1/2) resolution.
 *  Reentrant per instance, safe in interrupt context, no allocation. */
#ifndef HULLGUARD_TRIGGER_H
#define HULLGUARD_TRIGGER_H

#include "hullguard/code.h"
#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {                /* flash: one a group, generated; shared by sender and receiver */
    uint8_t         width;        /* channels of the group, 0 (a bare tick) .. HG_GROUP_SIGNALS_MAX */
    uint8_t         levels;       /* 1 .. HG_LEVELS_MAX */
    uint8_t         interval_max; /* tau_max: longest time between two frames, samples, 1 .. 255; 1 makes the sender periodic */
    const uint8_t  *silence;      /* [levels] h: samples after a frame in which the sender does not speak, 0 .. interval_max - 1 */
    const uint16_t *delta;        /* [levels][width] relative threshold, 1/65536 */
    const int32_t  *sigma;        /* [levels][width] absolute threshold, codes, >= 0 */
    const int32_t  *activity;     /* [levels][width] codes, rising with the level; row 0 is not read */
    const int32_t  *zero;         /* [width] code of the physical value 0 */
} hg_trigger_config;

typedef struct {                /* RAM: one a sender */
    const hg_trigger_config *config;
    int32_t                 *sent;     /* [width] codes of the last frame */
    uint8_t                  level;    /* in use since that frame, 0 .. levels - 1 */
    uint8_t                  age;      /* samples since the last frame */
    bool                     started;  /* has a frame been sent? */
} hg_trigger;

/** Are the tables within the ranges stated above? Cost: levels x width comparisons. */
bool hg_trigger_valid(const hg_trigger_config *config);

/** Largest silent deviation from the last sent code in one channel, codes.
 *  @param[in] level    0 .. levels - 1
 *  @param[in] channel  0 .. width - 1
 *  @param[in] sent     last sent code; for HG_CODE_INVALID the answer is 0: any change is worth a frame
 *  Result 0 .. INT32_MAX, saturated. Constant time. */
int32_t hg_trigger_threshold(const hg_trigger_config *config, uint8_t level, uint8_t channel, int32_t sent);

/** Level that follows from two successive frames. A channel that is or was invalid counts as the highest activity.
 *  Cost: levels x width comparisons. */
uint8_t hg_trigger_level(const hg_trigger_config *config, const int32_t *sent, const int32_t *previous);

/** Begin before the first sample; the first step then always sends.
 *  @param[in] codes  [width] memory for the last sent codes, owned by the caller
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    hg_trigger_valid() says no */
hg_status hg_trigger_start(hg_trigger *self, const hg_trigger_config *config, int32_t *codes);

/** One sample of the sender.
 *  @param[in] code  [width] this sample's codes, HG_CODE_INVALID where there is none
 *  @retval HG_OK       send these codes now; the trigger already counts them as sent
 *  @retval HG_E_EMPTY  stay silent
 *  Nothing else can happen. Cost: width multiplications, and levels x width comparisons when sending. */
hg_status hg_trigger_step(hg_trigger *self, const int32_t *code);

#ifdef __cplusplus
}
#endif

#endif
