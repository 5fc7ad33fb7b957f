/** @file
 *  tracker.h: a fusion filter on a bus. Tables of any content, messages of one field each; any frames, any clock. */
#include "any_tracker.h"

/* A node in any state that frames and samples can leave. */
static void any_tracker(hg_tracker *self, const hg_tracker_config *config)
{
    hg_tracker any;
    *self = any;
    self->config = config;
    self->fusion = any_fusion(config->fusion);
    self->consistency = (hg_consistency){.config = config->consistency, .fusion = &self->fusion, .sum = any_array(hg_consistency_sum, SENSORS),
                                         .sensor = any_array(hg_consistency_sensor, SENSORS), .f = any_array(hg_real, SENSORS * STATES), .next = any_array(hg_real, STATES),
                                         .onset = any_u8(), .since = any_u8(), .leader = any_u8(), .leads = any_u8(), .rests = any_u8(), .blamed = any_u16()};
    self->link = any_array(hg_link, SENSORS + 1U);
    self->value = any_array(hg_real, STATES);
    self->deviation = any_array(hg_real, STATES);
    self->ticked = any_bool();
    self->synchronised = any_bool();
    self->judging = any_bool();
    self->slipped = any_bool();
    self->reported = any_bool();
    self->last.refused = any_bool();
    for (uint8_t i = 0U; i <= SENSORS; i++) {
        self->link[i].timed = any_bool();
        self->link[i].receiver.seen = any_bool();
    }
    assume(started_tracker(self));
}

/** What the application's clock says leaves a node as frames can leave it: a tick that is overdue makes a step due, an outage forgets what was known, and only how far ahead a tick may be is
 *  taken over.
 *  As above; any state, any clock.
 *  @proves hg_tracker_expect hg_tracker_overdue hg_tracker_outage hg_tracker_health
 *  @stub hg_fusion_valid hg_fusion_open hg_fusion_reset
 *  @without conversion unsigned-overflow: sample indices and stamps are meant to wrap
 *  @run check real=f32 unwind=37 limit=90 STATES=6U SENSORS=5U DEPTH=2U VALID=1U ANY_SHARES */
void proof_tracker_clock(void)
{
    const hg_tracker_config *config = any_tracker_config();
    hg_tracker self;
    assume(hg_fusion_valid(config->fusion));
    any_tracker(&self, config);
    const uint8_t due = self.due;
    const uint32_t samples = any_u32();
    hg_tracker_expect(&self, samples);
    prove(self.ahead_max == ((samples < 7U) ? samples : 7U), "no further than the stamp tells");
    hg_tracker_overdue(&self);
    prove(self.due == ((due == 0U) ? 1U : due), "a step is due");
    hg_tracker_outage(&self);
    prove((self.due == 0U) && (!self.synchronised) && (!self.link[SENSORS].receiver.seen), "nothing is known of the time");
    prove(started_tracker(&self), "as frames can leave it");
    const uint8_t i = any_u8_in(0U, SENSORS);
    prove(hg_tracker_health(&self, i) == &self.link[i].health, "the sensor's");
    reach("end");
}

/** A node takes any frame whatever: no undefined behaviour, a status of the closed list, its open sample never goes back, and at most 8 steps become due; its links, its clock and its filter
 *  are again as frames can leave them.
 *  As above; a frame of any kind, length and bytes in any state: with the identifier of sensor FROM, FROM = SENSORS: of the tick, above: of none.
 *  @proves hg_tracker_receive
 *  @stub hg_fusion_valid hg_fusion_local hg_fusion_unwrap hg_fusion_receive hg_fusion_open hg_fusion_reset hg_e2e_check hg_frame_matches hg_frame_unpack
 *  @without conversion unsigned-overflow: sample indices and stamps are meant to wrap, bytes are cut on purpose
 *  @run check real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 FROM=0U STATES=6U SENSORS=5U DEPTH=2U VALID=1U ANY_SHARES
 *  @run check real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 FROM=5U STATES=6U SENSORS=5U DEPTH=2U VALID=1U ANY_SHARES
 *  @run check real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 FROM=6U STATES=6U SENSORS=5U DEPTH=2U VALID=1U ANY_SHARES */
void proof_tracker_receive(void)
{
    const hg_tracker_config *config = any_tracker_config();
    hg_tracker self;
    assume(hg_fusion_valid(config->fusion) && (config->fusion->modulus == 16U));
    any_tracker(&self, config);
    const uint32_t k = self.k;
    const bool waits = self.due > 0U;
    hg_can_frame frame;
    frame.id = FROM;
    frame.flags = 0U;
    const hg_status status = hg_tracker_receive(&self, &frame);
    prove((status == HG_OK) || (status == HG_E_ID) || (status == HG_E_FORMAT) || (status == HG_E_CRC) || (status == HG_E_REPEATED) || (status == HG_E_STAMP) ||
              (status == HG_E_SEQUENCE) || (status == HG_E_STATE) || (status == HG_E_NUMERIC) || (status == HG_E_BUSY),
          "a status of the list");
    prove(started_tracker(&self), "as frames can leave it");
    prove((self.k - k) <= 15U, "no sample goes back");
    prove((!waits) || (status == HG_E_BUSY) || (status == HG_E_ID), "no frame before the steps that are due");
    prove((status == HG_E_ID) == (FROM > SENSORS), "a frame of this model, or not");
    if ((status == HG_OK) || (FROM > SENSORS)) {
        reach("a frame");
    }
}

/** A step that is due gives a verdict that there is and opens the next sample; one that is not due gives nothing. What is reported of it are at most two frames, and a digest ends.
 *  As above; any state.
 *  @proves hg_tracker_step hg_tracker_report hg_tracker_estimate hg_tracker_digest
 *  @stub hg_fusion_valid hg_fusion_close hg_fusion_open hg_consistency_step hg_linalg_root hg_frame_pack hg_e2e_protect
 *  @without conversion unsigned-overflow: sample indices, stamps and the digest are meant to wrap, bytes are cut on purpose
 *  @run check real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 STATES=6U SENSORS=5U DEPTH=2U VALID=1U ANY_SHARES */
void proof_tracker_step(void)
{
    const hg_tracker_config *config = any_tracker_config();
    hg_tracker self;
    assume(hg_fusion_valid(config->fusion));
    any_tracker(&self, config);
    const uint8_t due = self.due;
    const uint32_t k = self.k;
    hg_verdict verdict;
    const hg_status status = hg_tracker_step(&self, &verdict);
    prove(status == ((due > 0U) ? HG_OK : HG_E_EMPTY), "one that is due");
    prove(started_tracker(&self), "as samples can leave it");
    if (status == HG_OK) {
        hg_can_frame out[2];
        prove((verdict.k == k) && (self.k == (uint32_t)(k + 1U)) && (self.due == (due - 1U)), "of the open sample");
        prove((verdict.plant <= HG_PLANT_CONFIRMED) && (verdict.basis == HG_BASIS_STATISTICAL), "a verdict that there is");
        prove(hg_tracker_report(&self, &verdict, any_bool(), out) <= 2U, "two frames at most");
        const hg_status said = hg_tracker_estimate(&self, 0U, out);
        prove((said == HG_OK) || (said == HG_E_EMPTY), "no other status");
        (void)hg_tracker_digest(&self.fusion, any_u32());
        prove(started_tracker(&self), "as samples can leave it");
        reach("a step");
    }
}

/** A sensor's node sends only in a sample that is known, and only what can be sent; its counter stays in range.
 *  As above; the sender of sensor FROM, FROM = SENSORS: of none; any reading, NaN and infinity among them, any state. Of the filter's tables only that hg_fusion_valid() accepts them.
 *  @proves hg_fusion_sender_start hg_fusion_sender_step
 *  @stub hg_fusion_valid hg_fusion_due hg_fusion_local hg_frame_pack hg_e2e_protect
 *  @without conversion: bytes are cut on purpose
 *  @run check real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 FROM=0U STATES=6U SENSORS=5U DEPTH=2U VALID=1U ANY_SHARES
 *  @run deep real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 FROM=1U STATES=6U SENSORS=5U DEPTH=2U VALID=1U ANY_SHARES
 *  @run deep real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 FROM=2U STATES=6U SENSORS=5U DEPTH=2U VALID=1U ANY_SHARES
 *  @run deep real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 FROM=3U STATES=6U SENSORS=5U DEPTH=2U VALID=1U ANY_SHARES
 *  @run check real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 FROM=4U STATES=6U SENSORS=5U DEPTH=2U VALID=1U ANY_SHARES
 *  @run check real=f32 unwind=37 limit=90 hg_e2e_valid.0:65 FROM=5U STATES=6U SENSORS=5U DEPTH=2U VALID=1U ANY_SHARES */
void proof_fusion_sender(void)
{
    const hg_tracker_config *config = any_tracker_config();
    hg_tracker tracker;
    hg_fusion_sender self;
    assume(hg_fusion_valid(config->fusion));
    any_tracker(&tracker, config);
    const uint8_t sensor = (FROM < SENSORS) ? FROM : any_u8_in(SENSORS, UINT8_MAX);
    prove((hg_fusion_sender_start(NULL, &tracker, sensor) == HG_E_ARGUMENT) && (hg_fusion_sender_start(&self, NULL, sensor) == HG_E_ARGUMENT), "null pointers");
    const hg_status started = hg_fusion_sender_start(&self, &tracker, sensor);
    prove(started == ((FROM < SENSORS) ? HG_OK : HG_E_ARGUMENT), "a sensor that there is");
    bool ends = FROM >= SENSORS;
    if (!ends) {
        hg_can_frame frame;
        hg_real y;
        hg_real dice;
        self.counter = any_u8();
        assume(self.counter < config->fusion->modulus);
        const hg_status status = hg_fusion_sender_step(&self, y, dice, any_bool(), &frame);
        prove((status == HG_OK) || (status == HG_E_EMPTY) || (status == HG_E_NUMERIC) || (status == HG_E_STATE), "no other status");
        prove((status != HG_OK) || (tracker.synchronised && (tracker.due == 0U)), "in a sample that is known");
        prove((self.counter < config->fusion->modulus) && ((status != HG_OK) || (frame.id == sensor)), "a counter in range, a frame of the sensor's");
        ends = status == HG_OK;
    }
    if (ends) {
        reach("a frame, or no sender");
    }
}
