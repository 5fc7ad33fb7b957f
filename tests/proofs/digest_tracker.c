/** @file
 *  digest_tracker.h: the checksum over the constant tables of a fusion filter on a bus. Numbers are any; sizes are those of a run. */
#include "any_fusion.h"

#include "hullguard/digest_tracker.h"

static const hg_field field = {.start = 24U, .length = 8U, .flags = 0U};
static const hg_code_scale scale = {.minimum = -100, .maximum = 100};

static const hg_message *messages_of(uint8_t count, uint8_t width)
{
    hg_e2e_config *e2e = any_array(hg_e2e_config, 1U);
    hg_message *message = any_array(hg_message, count);
    *e2e = (hg_e2e_config){.profile = HG_E2E_P22, .data_ids = any_array(uint8_t, HG_E2E_IDS), .crc = 0U, .counter = 8U, .stamp = 12U, .limits = &hg_e2e_limits_default};
    for (uint8_t i = 0U; i < count; i++) {
        message[i] = (hg_message){.id = any_u32(), .flags = 0U, .length = 8U, .width = width, .field = &field, .scale = &scale, .e2e = e2e, .idle = NULL};
    }
    return message;
}

/** A walk over a tracker's tables reads each table as far as its sizes say, and no further; a head that is another is refused before anything is followed.
 *  STATES states, SENSORS sensors, with a consistency test or without, rows dense or of one state; any place in a walk, any portion.
 *  @proves hg_digest_tracker hg_digest_tracker_head
 *  @stub hg_digest_bytes hg_digest_halves hg_digest_codes hg_digest_masks hg_digest_reals
 *  @stub hg_crc32c
 *  @without conversion unsigned-overflow: flags and exponents go as words of 32 bits
 *  @run check real=f32 unwind=20 limit=90 STATES=2U SENSORS=2U DEPTH=1U */
void proof_digest_tracker(void)
{
    hg_fusion_config fusion = any_fusion_config();
    hg_consistency_config consistency;
    hg_tracker_source *source = any_array(hg_tracker_source, SENSORS);
    hg_digest self;
    assume(hg_fusion_valid(&fusion));
    consistency.least = any_bool() ? any_array(hg_real, SENSORS) : NULL;
    for (uint8_t i = 0U; i < SENSORS; i++) {
        source[i] = (hg_tracker_source){.message = messages_of(1U, 1U), .wraps = any_bool()};
    }
    const hg_tracker_config config = {.fusion = &fusion, .consistency = any_bool() ? &consistency : NULL, .source = source, .tick = messages_of(1U, 0U), .verdict = messages_of(1U, 0U),
                                      .status = messages_of(1U, 0U), .estimate = messages_of(STATES, 1U), .heartbeat = any_u16(), .interval = any_u16(), .model_hash = any_u32()};
    const uint32_t head = any_u32();
    const hg_digest before = self;
    const hg_status status = hg_digest_tracker(&self, &config, head, any_u32());
    prove((status == HG_OK) || (status == HG_E_BUSY) || (status == HG_E_DIGEST), "a status of the list");
    prove((status == HG_E_DIGEST) == (head != hg_digest_tracker_head(&config)), "the head is looked at");
    prove((status != HG_E_DIGEST) || ((self.crc == before.crc) && (self.done == before.done)), "nothing taken");
    if (status == HG_OK) {
        reach("the end of a walk");
    }
}
