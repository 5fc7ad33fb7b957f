/** @file
 *  The variance trigger of a sensor (methods, fusion, section 3): speak when the last W samples scatter by more than a threshold, about their mean, or
 *  about their straight line. In integers, the codes of a 16-bit converter, so that the sums never drift: with the newest entering and the oldest leaving,
 *
 *      S1 = sum y_j,  S2 = sum y_j^2,  T1 = sum j y_j  (j = 0 .. W - 1, oldest first)
 *      about the mean   W (W - 1) variance             = W S2 - S1^2
 *      about the line   W (W^2 - 1) (W - 2) variance   = (W^2 - 1)(W S2 - S1^2) - 3 (2 T1 - (W - 1) S1)^2
 *
 *  About the mean it measures motion, not information: a target at constant speed sends always, one that stops is not heard of again but by its heartbeat.
 *  Silence under either says nothing of the state (HG_FUSION_OWN). Reentrant per instance, safe in interrupt context, no allocation. */
#ifndef HULLGUARD_VARIANCE_H
#define HULLGUARD_VARIANCE_H

#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {         /* flash */
    uint8_t window;      /* W: samples, 3 .. 255 */
    bool    detrended;   /* about the straight line */
    int64_t level;       /* of the left sides above, codes squared, >= 0 */
} hg_variance_config;

typedef struct {         /* RAM */
    const hg_variance_config *config;
    int16_t                  *y;      /* [window] ring */
    int64_t                   S1;     /* the sums above */
    int64_t                   S2;     /* of squares */
    int64_t                   T1;     /* about the line */
    uint8_t                   oldest; /* place of the oldest sample once the window is full */
    uint8_t                   held;   /* samples in the window, 0 .. window */
} hg_variance;

/** Begin with an empty window.
 *  @param[in] memory  [window], owned by the caller
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    window or level out of range */
hg_status hg_variance_start(hg_variance *self, const hg_variance_config *config, int16_t *memory);

/** One sample. No sum can overflow: 255 samples of 16 bits make less than 2^62.
 *  @retval HG_OK       send: the window scatters by more than the level, or is not full yet
 *  @retval HG_E_EMPTY  stay silent
 *  Cost: 9 multiplications of 64 bits. */
hg_status hg_variance_step(hg_variance *self, int16_t code);

#ifdef __cplusplus
}
#endif

#endif
