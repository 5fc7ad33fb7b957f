/** @file
 *  The checksum of digest.h over the constant tables of a fusion filter on a bus. */
#ifndef HULLGUARD_DIGEST_TRACKER_H
#define HULLGUARD_DIGEST_TRACKER_H

#include "hullguard/digest.h"
#include "hullguard/tracker.h"

#ifdef __cplusplus
extern "C" {
#endif

#if !HG_REAL_Q31
/** As hg_digest_node_head(). */
uint32_t hg_digest_tracker_head(const hg_tracker_config *config);

/** Take the next numbers: as hg_digest_node(). @retval HG_OK that was the last one  @retval HG_E_BUSY there are more  @retval HG_E_DIGEST the head is another */
hg_status hg_digest_tracker(hg_digest *self, const hg_tracker_config *config, uint32_t head, uint32_t numbers);
#endif

#ifdef __cplusplus
}
#endif

#endif
