/** @file
 *  digest_tracker.h: the checksum over the constant tables of a fusion filter on a bus. Numbers are any; sizes are those of a run. */
#include "any_tracker.h"

#include "hullguard/digest_tracker.h"

/** A walk over a tracker's tables reads each table as far as its sizes say, and no further; a head that is another is refused before anything is followed.
 *  STATES states, SENSORS sensors, with a consistency test or without, rows dense or of one state; any place in a walk, any portion.
 *  @proves hg_digest_tracker hg_digest_tracker_head
 *  @stub hg_digest_bytes hg_digest_halves hg_digest_codes hg_digest_masks hg_digest_reals
 *  @stub hg_crc32c
 *  @without conversion unsigned-overflow: flags and exponents go as words of 32 bits
 *  @run check real=f32 unwind=20 limit=90 STATES=2U SENSORS=2U DEPTH=1U */
void proof_digest_tracker(void)
{
    const hg_tracker_config *config = any_tracker_config();
    hg_digest self;
    assume(hg_fusion_valid(config->fusion));
    const uint32_t head = any_u32();
    const hg_digest before = self;
    const hg_status status = hg_digest_tracker(&self, config, head, any_u32());
    prove((status == HG_OK) || (status == HG_E_BUSY) || (status == HG_E_DIGEST), "a status of the list");
    prove((status == HG_E_DIGEST) == (head != hg_digest_tracker_head(config)), "the head is looked at");
    prove((status != HG_E_DIGEST) || ((self.crc == before.crc) && (self.done == before.done)), "nothing taken");
    if (status == HG_OK) {
        reach("the end of a walk");
    }
}
