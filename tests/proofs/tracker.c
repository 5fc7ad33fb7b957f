/** @file
 *  tracker.h: a fusion filter on a bus, with the tables of a shipped model and any frames. */
#include "proof.h"

#include "hullguard/tracker.h"

#include "fusion5.c"

/** A node takes any frames whatever: no undefined behaviour, a status of the closed list, at most 8 steps become due, its open sample never goes back.
 *  The tables of fusion5; FRAMES frames of any identifier, kind, length and bytes after a start, any clock.
 *  @proves hg_tracker_start hg_tracker_receive hg_tracker_expect hg_tracker_overdue hg_tracker_outage hg_tracker_health
 *  @without conversion unsigned-overflow: sample indices and stamps are meant to wrap, bytes and checksums are cut on purpose
 *  @run deep real=f32 unwind=65 limit=3600 FRAMES=1U ANY_NUMBERS
 *  @run deep real=f32 unwind=65 limit=7200 FRAMES=2U */
void proof_tracker_receive(void)
{
    static hg_fusion5_tracker storage;
    prove(hg_fusion5_tracker_start(&storage, HG_START_REST) == HG_OK, "it starts");
    hg_tracker *self = &storage.tracker;
    const hg_tracker_memory none = {.link = NULL, .real = NULL};
    prove((hg_tracker_start(NULL, self->config, &none, HG_START_REST) == HG_E_ARGUMENT) && (hg_tracker_start(self, self->config, &none, HG_START_REST) == HG_E_ARGUMENT), "null pointers");
    for (uint8_t i = 0U; i < FRAMES; i++) {
        hg_can_frame frame;
        const uint32_t k = self->k;
        hg_tracker_expect(self, any_u32());
        if (any_bool()) {
            hg_tracker_overdue(self);
        }
        if (any_bool()) {
            hg_tracker_outage(self);
        }
        const hg_status status = hg_tracker_receive(self, &frame);
        prove((status == HG_OK) || (status == HG_E_ID) || (status == HG_E_FORMAT) || (status == HG_E_CRC) || (status == HG_E_REPEATED) || (status == HG_E_STAMP) ||
                  (status == HG_E_SEQUENCE) || (status == HG_E_STATE) || (status == HG_E_NUMERIC) || (status == HG_E_BUSY),
              "a status of the list");
        prove((self->due <= 8U) && ((self->k - k) <= 15U), "no sample goes back");
        if (status == HG_OK) {
            reach("a frame");
        }
    }
    prove(hg_tracker_health(self, 0U) == &self->link[0].health, "the sensor's");
    reach("end");
}

/** A step that is due gives a verdict, and what is reported of it are frames; a sensor's node sends only in a sample that is known, and only what can be sent.
 *  The tables of fusion5; a start, a reading of any value, a sample whose tick did not come.
 *  @proves hg_tracker_overdue hg_tracker_step hg_tracker_report hg_tracker_estimate hg_tracker_digest hg_fusion_sender_start hg_fusion_sender_step
 *  @without conversion unsigned-overflow: sample indices, stamps and the digest are meant to wrap, bytes and checksums are cut on purpose
 *  @run deep real=f32 unwind=65 limit=3600 ANY_NUMBERS */
void proof_tracker_step(void)
{
    static hg_fusion5_tracker storage;
    prove(hg_fusion5_tracker_start(&storage, HG_START_REST) == HG_OK, "it starts");
    hg_tracker *self = &storage.tracker;
    hg_can_frame out[2];
    hg_fusion_sender sender;
    hg_real y;
    hg_real dice;
    prove((hg_fusion_sender_start(NULL, self, 0U) == HG_E_ARGUMENT) && (hg_fusion_sender_start(&sender, NULL, 0U) == HG_E_ARGUMENT) &&
              (hg_fusion_sender_start(&sender, self, HG_FUSION5_SENSORS) == HG_E_ARGUMENT),
          "null, or no such sensor");
    prove(hg_fusion_sender_start(&sender, self, 0U) == HG_OK, "it starts");
    const hg_status sent = hg_fusion_sender_step(&sender, y, dice, any_bool(), out);
    prove((sent == HG_OK) || (sent == HG_E_EMPTY) || (sent == HG_E_NUMERIC), "no other status");
    hg_verdict verdict;
    prove(hg_tracker_step(self, &verdict) == HG_E_EMPTY, "nothing is due");
    hg_tracker_overdue(self);
    prove(hg_tracker_step(self, &verdict) == HG_OK, "a step");
    prove(verdict.plant <= HG_PLANT_CONFIRMED, "a state that there is");
    prove(hg_tracker_report(self, &verdict, any_bool(), out) <= 2U, "two frames at most");
    const hg_status said = hg_tracker_estimate(self, 0U, out);
    prove((said == HG_OK) || (said == HG_E_EMPTY), "no other status");
    (void)hg_tracker_digest(&self->fusion, HG_TRACKER_DIGEST);
    reach("end");
}
