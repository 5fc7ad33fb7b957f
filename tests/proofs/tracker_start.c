/** @file
 *  tracker.h: the start of a fusion filter on a bus. Tables of any content, messages of one field each. */
#include "any_tracker.h"

/** A node starts with a sample open and links that have seen nothing, and is one that frames can leave; null pointers and tables that contradict one another are refused.
 *  STATES states, SENSORS sensors, DEPTH past samples; tables of any content: VALID, whether hg_fusion_valid() accepts the filter's; TESTS 0, no consistency test, 1, one whose tables
 *  hg_consistency_start() accepts, 2, refuses.
 *  @proves hg_tracker_start
 *  @stub hg_fusion_valid hg_fusion_start hg_fusion_reset hg_fusion_open hg_consistency_start hg_consistency_reset
 *  @without conversion unsigned-overflow: bytes are cut on purpose, sample indices are meant to wrap
 *  @run check real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 STATES=6U SENSORS=5U DEPTH=2U VALID=0U TESTS=1U ANY_SHARES
 *  @run deep real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 STATES=6U SENSORS=5U DEPTH=2U VALID=1U TESTS=0U ANY_SHARES
 *  @run check real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 STATES=6U SENSORS=5U DEPTH=2U VALID=1U TESTS=1U ANY_SHARES
 *  @run deep real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 STATES=6U SENSORS=5U DEPTH=2U VALID=1U TESTS=2U ANY_SHARES */
void proof_tracker_start(void)
{
    hg_tracker_config *config = any_tracker_config();
    config->consistency = (TESTS > 0U) ? any_consistency_config() : NULL;
    const hg_start how = any_bool() ? HG_START_REST : HG_START_MOVING;
    const hg_tracker_memory memory = {
        .fusion = {.slot = any_array(hg_fusion_slot, SLOTS), .entry = any_array(hg_fusion_entry, SLOTS * SENSORS), .sensor = any_array(hg_fusion_sensor, SENSORS),
                   .record = any_array(hg_fusion_record, SENSORS), .origin = any_array(int32_t, STATES), .real = any_array(hg_real, FUSION_REALS)},
        .consistency = {.sum = any_array(hg_consistency_sum, SENSORS), .sensor = any_array(hg_consistency_sensor, SENSORS), .real = any_array(hg_real, HG_CONSISTENCY_REALS(STATES, SENSORS, 1U))},
        .link = any_array(hg_link, SENSORS + 1U),
        .real = any_array(hg_real, 2U * STATES)};
    hg_tracker self;
    prove((hg_tracker_start(NULL, config, &memory, how) == HG_E_ARGUMENT) && (hg_tracker_start(&self, NULL, &memory, how) == HG_E_ARGUMENT) &&
              (hg_tracker_start(&self, config, NULL, how) == HG_E_ARGUMENT),
          "null pointers");
    const hg_status status = hg_tracker_start(&self, config, &memory, how);
    prove((status == HG_OK) || (status == HG_E_CONFIG), "no other status");
    prove((status != HG_OK) || started_tracker(&self), "as frames can leave it");
    prove((status != HG_OK) || ((self.k == 0U) && (self.due == 0U) && (!self.link[SENSORS].receiver.seen)), "nothing seen");
    if (status == (((VALID == 1U) && (TESTS < 2U)) ? HG_OK : HG_E_CONFIG)) {
        reach("a start");
    }
}
