/** @file
 *  node.h: what a node and a sender put on the bus, with the tables of a shipped model. Between the bus and the detector: receive.c. */
#include "proof.h"

#include "hullguard/node.h"

#include "platoon.c"

/** What is reported of a step are frames of the model that their reader understands, as they were: a verdict frame when something has changed, with every heartbeat, and whenever a
 *  reply is asked for; with the heartbeat a status frame; none in between.
 *  The platoon's messages; any verdict that fits its frame, any earlier report, any links.
 *  @proves hg_node_report
 *  @without conversion unsigned-overflow: bytes and checksums are cut on purpose, the silence is meant to wrap
 *  @run check real=f32 unwind=65 limit=90 */
void proof_node_report(void)
{
    hg_link link[HG_PLATOON_GROUPS];
    hg_node self = {.config = &hg_platoon_config, .link = link, .silence = any_u16(), .reported = any_bool(), .verdict_counter = any_u8_in(0U, 15U), .status_counter = any_u8_in(0U, 15U),
                    .last = {.k = any_u32(), .model_hash = any_u32(), .candidates = any_u32(), .plant = (hg_plant)any_u8_in(0U, 3U), .basis = (hg_basis)any_u8_in(0U, 2U),
                             .bus = any_u16(), .refused = any_bool()}};
    assume(self.silence < hg_platoon_config.heartbeat);
    const hg_verdict last = self.last;
    const bool reported = self.reported;
    const bool beat = (!reported) || ((self.silence + 1U) >= hg_platoon_config.heartbeat);
    const hg_verdict verdict = {.k = any_u32(), .model_hash = any_u32(), .candidates = any_u16(), .plant = (hg_plant)any_u8_in(0U, 3U), .basis = (hg_basis)any_u8_in(0U, 2U),
                                .bus = any_u16(), .refused = any_bool()};
    const bool same = reported && (verdict.plant == last.plant) && (verdict.candidates == last.candidates) && (verdict.basis == last.basis) && (verdict.bus == last.bus) &&
                      (verdict.refused == last.refused);
    const bool asked = any_bool();
    hg_can_frame out[2];
    hg_verdict read;
    bool reply;
    const uint8_t frames = hg_node_report(&self, &verdict, asked, out);
    prove(frames == (beat ? 2U : ((asked || (!same)) ? 1U : 0U)), "as many as are due");
    if (frames > 0U) {
        prove(hg_verdict_read(hg_platoon_config.verdict, &out[0], &read, &reply) == HG_OK, "the reader understands it");
        prove((read.plant == verdict.plant) && (read.basis == verdict.basis) && (read.candidates == verdict.candidates) && (read.bus == verdict.bus) && (read.refused == verdict.refused),
              "the same verdict");
        prove(reply == (same && (!beat)), "a mere reply says so");
        reach("a report");
    }
    prove(self.silence < hg_platoon_config.heartbeat, "no longer silent than a heartbeat");
    prove((self.verdict_counter <= 15U) && (self.status_counter <= 15U), "counters of the frames");
}

/** Reports that are written are read as they were: every verdict that fits its frame, and any bytes are read without overrun; status frames hold what they were given, clipped.
 *  The platoon's messages of 8 bytes, and a verdict of 12; any verdicts and counts.
 *  @proves hg_verdict_write hg_verdict_read hg_status_write hg_report_valid hg_link_refuse
 *  @without conversion: bytes and checksums are cut on purpose
 *  @run check real=f32 unwind=97 limit=150 */
void proof_verdict_round(void)
{
    hg_message wide = *hg_platoon_config.verdict;
    wide.length = 12U;
    wide.flags |= HG_CAN_FD;
    const hg_message *message = any_bool() ? &wide : hg_platoon_config.verdict;
    prove(hg_report_valid(message, hg_platoon_config.status), "as frame.h draws them");
    prove(!hg_report_valid(NULL, hg_platoon_config.status) && !hg_report_valid(message, NULL), "null");
    const hg_verdict verdict = {.k = any_u32(), .model_hash = any_u32(), .candidates = any_u32(), .plant = (hg_plant)any_u8_in(0U, 3U), .basis = (hg_basis)any_u8_in(0U, 2U),
                                .bus = any_u16(), .refused = any_bool()};
    hg_can_frame frame;
    hg_verdict read;
    bool reply;
    const bool lockstep = any_bool();
    hg_verdict_write(message, &verdict, lockstep, any_u8(), &frame);
    prove(hg_verdict_read(message, &frame, &read, &reply) == HG_OK, "what was written can be read");
    prove((read.plant == verdict.plant) && (read.basis == verdict.basis) && (read.bus == verdict.bus) && (read.refused == verdict.refused) && (reply == lockstep), "as it was");
    prove(read.candidates == ((message == &wide) ? verdict.candidates : (verdict.candidates & 0xFFFFU)), "its candidates");
    prove(read.k == (verdict.k & 0xFFFU), "its sample, modulo 4096");
    hg_can_frame any;
    (void)hg_verdict_read(message, &any, &read, &reply);
    const uint32_t lost = any_u32();
    hg_status_write(hg_platoon_config.status, &verdict, lost, any_u32(), any_u8(), &frame);
    prove((frame.length == 8U) && (frame.data[6] == ((lost > 255U) ? 255U : lost)), "frames lost, clipped");
    hg_link_health health;
    const hg_link_health before = health;
    const hg_status status = (hg_status)any_i8();
    hg_link_refuse(&health, status);
    prove((health.crc == before.crc) || ((status == HG_E_CRC) && (health.crc == (before.crc + 1U))), "counted once, saturating");
    reach("end");
}

/** A sender's frame is of its message, passes the check and holds this sample's codes and stamp; its counter moves by one a frame.
 *  The platoon's measurement message; any values, NaN and infinity among them, any sample, any counter; a start and two samples.
 *  @proves hg_sender_start hg_sender_step
 *  @without conversion: bytes and checksums are cut on purpose
 *  @run check real=f32 unwind=65 limit=150 */
void proof_sender_step(void)
{
    const hg_sender_config *config = &hg_platoon_sender[0];
    int32_t codes[6];
    hg_real value[3];
    hg_sender self;
    hg_can_frame frame;
    prove((hg_sender_start(NULL, config, codes) == HG_E_ARGUMENT) && (hg_sender_start(&self, NULL, codes) == HG_E_ARGUMENT) && (hg_sender_start(&self, config, NULL) == HG_E_ARGUMENT),
          "null pointers");
    prove(hg_sender_start(&self, config, codes) == HG_OK, "it starts");
    int32_t sent[3];
    int32_t code[3];
    self.trigger.sent = sent;
    self.code = code;
    self.trigger.started = any_bool();
    self.trigger.age = any_u8_in(0U, (uint8_t)(config->trigger->interval_max - 1U));
    self.counter = any_u8_in(0U, 15U);
    const uint8_t counter = self.counter;
    const uint32_t k = any_u32();
    const hg_status status = hg_sender_step(&self, k, value, &frame);
    prove((status == HG_OK) || (status == HG_E_EMPTY), "no other status");
    prove(self.counter == ((status == HG_OK) ? ((counter + 1U) % 16U) : counter), "one a frame");
    if (status == HG_OK) {
        hg_e2e_header header;
        int32_t read[3];
        prove(hg_e2e_check(config->message->e2e, frame.data, frame.length, &header) == HG_OK, "it passes the check");
        prove((header.counter == counter) && (header.stamp == (k & 15U)), "counter and stamp");
        prove(hg_frame_unpack(config->message, &frame, read) == HG_OK, "it can be read");
        for (uint8_t g = 0U; g < 3U; g++) {
            prove(read[g] == code[g], "this sample's codes");
        }
        reach("a frame");
    }
}
