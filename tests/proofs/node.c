/** @file
 *  node.h, detector.h: what runs on an ECU, with the tables of a shipped model and any frames. */
#include "proof.h"

#include "hullguard/node.h"

#include "platoon.c"

#define GROUPS HG_PLATOON_GROUPS

/* Memory of its own for each part: what runs over the end of one is outside. */
typedef struct {
    hg_hold     hold[GROUPS];
    hg_residual residual[1];
    hg_hull     hull[1];
    hg_alarm    alarm[1];
} parts;

/** A node takes any frames whatever: no undefined behaviour, a status of the closed list, its open sample never goes back, and at most 8 steps become due; whatever the application's
 *  clock says in between.
 *  The platoon's tables; FRAMES frames of any identifier, kind, length and bytes after a start, overdue, expect and outage among them.
 *  @proves hg_node_start hg_node_receive hg_node_expect hg_node_overdue hg_node_outage hg_node_health
 *  @without conversion unsigned-overflow: sample indices and stamps are meant to wrap, bytes and checksums are cut on purpose
 *  @run deep real=f32 unwind=65 limit=3600 hg_detector_start.0:153 hg_ring_reset.0:109 FRAMES=1U ANY_NUMBERS
 *  @run deep real=f32 unwind=65 limit=7200 hg_detector_start.0:153 hg_ring_reset.0:109 FRAMES=3U */
void proof_node_receive(void)
{
    parts p;
    hg_link link[GROUPS];
    int32_t closing[3];
    int32_t code[12];
    hg_real real[152];
    const hg_node_memory memory = {.detector = {.hold = p.hold, .residual = p.residual, .hull = p.hull, .alarm = p.alarm, .code = code, .codes = 12U, .real = real, .reals = 152U},
                                   .link = link, .closing = closing};
    const hg_start how = any_bool() ? HG_START_REST : HG_START_MOVING;
    hg_node self;
    prove((hg_node_start(NULL, &hg_platoon_config, &memory, how) == HG_E_ARGUMENT) && (hg_node_start(&self, NULL, &memory, how) == HG_E_ARGUMENT) &&
              (hg_node_start(&self, &hg_platoon_config, NULL, how) == HG_E_ARGUMENT),
          "null pointers");
    prove(hg_node_start(&self, &hg_platoon_config, &memory, how) == HG_OK, "it starts");
    self.k = any_u32();
    for (uint8_t i = 0U; i < FRAMES; i++) {
        hg_can_frame frame;
        const uint32_t k = self.k;
        if (any_bool()) {
            hg_node_expect(&self, any_u32());
        }
        if (any_bool()) {
            hg_node_overdue(&self);
        }
        if (any_bool()) {
            hg_node_outage(&self);
        }
        const hg_status status = hg_node_receive(&self, &frame);
        prove((status == HG_OK) || (status == HG_E_ID) || (status == HG_E_FORMAT) || (status == HG_E_CRC) || (status == HG_E_REPEATED) || (status == HG_E_STAMP) ||
                  (status == HG_E_SEQUENCE) || (status == HG_E_STATE) || (status == HG_E_NUMERIC) || (status == HG_E_BUSY),
              "a status of the list");
        prove(self.due <= 8U, "at most 8 steps");
        prove((self.k - k) <= 15U, "no sample goes back");
        if ((status == HG_OK) && (self.due > 0U)) {
            reach("a closing frame");
        }
    }
    prove(hg_node_health(&self, 0U) == &link[0].health, "the group's");
    reach("end");
}

/** A step that is due gives a verdict of a plant that there is, one that is not due nothing; what is reported are frames of the model that their reader understands, as they were.
 *  The platoon's tables; a start anywhere, two samples whose closing frames did not come, any earlier report.
 *  @proves hg_node_step hg_node_report hg_node_overdue
 *  @without conversion unsigned-overflow: sample indices and stamps are meant to wrap, bytes and checksums are cut on purpose
 *  @run check real=f32 unwind=65 limit=150 hg_detector_start.0:153 hg_ring_reset.0:109 ANY_NUMBERS */
void proof_node_step(void)
{
    parts p;
    hg_link link[GROUPS];
    int32_t closing[3];
    int32_t code[12];
    hg_real real[152];
    const hg_node_memory memory = {.detector = {.hold = p.hold, .residual = p.residual, .hull = p.hull, .alarm = p.alarm, .code = code, .codes = 12U, .real = real, .reals = 152U},
                                   .link = link, .closing = closing};
    hg_node self;
    prove(hg_node_start(&self, &hg_platoon_config, &memory, HG_START_MOVING) == HG_OK, "it starts");
    self.k = any_u32();
    self.silence = any_u16();
    self.reported = any_bool();
    assume(self.silence < hg_platoon_config.heartbeat);
    hg_verdict verdict;
    hg_can_frame out[2];
    hg_verdict read;
    bool reply;
    prove(hg_node_step(&self, &verdict) == HG_E_EMPTY, "nothing is due");
    for (uint8_t i = 0U; i < 2U; i++) {
        hg_node_overdue(&self);
        const uint32_t k = self.k;
        prove((hg_node_step(&self, &verdict) == HG_OK) && (verdict.k == k), "a step");
        prove(verdict.plant <= HG_PLANT_CONFIRMED, "a state that there is");
        const uint8_t frames = hg_node_report(&self, &verdict, true, out);
        prove((frames >= 1U) && (frames <= 2U), "asked for a reply, one or two frames");
        prove(hg_verdict_read(hg_platoon_config.verdict, &out[0], &read, &reply) == HG_OK, "the reader understands it");
        prove((read.plant == verdict.plant) && (read.bus == verdict.bus) && (read.refused == verdict.refused), "the same verdict");
    }
    reach("end");
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

/** A detector takes any codes, losses and restarts: no undefined behaviour; codes that are none and groups that there are not are refused; its finding is one that there is.
 *  The platoon's tables; a start anywhere and SAMPLES samples, each with a frame of the first group, or none.
 *  @proves hg_detector_start hg_detector_restart hg_detector_receive hg_detector_lose hg_detector_step hg_detector_reals hg_detector_sums
 *  @run deep real=f32 unwind=65 limit=3600 hg_detector_start.0:153 hg_ring_reset.0:109 SAMPLES=1U ANY_NUMBERS
 *  @run deep real=f32 unwind=65 limit=7200 hg_detector_start.0:153 hg_ring_reset.0:109 SAMPLES=3U */
void proof_detector_step(void)
{
    parts p;
    int32_t code[12];
    hg_real real[152];
    const hg_detector_config *config = hg_platoon_config.detector;
    hg_detector_memory memory = {.hold = p.hold, .residual = p.residual, .hull = p.hull, .alarm = p.alarm, .code = code, .codes = any_u16(), .real = real, .reals = any_u32(), .sums = 0U};
    hg_detector self;
    assume((memory.codes <= 12U) && (memory.reals <= 152U));
    prove((hg_detector_reals(config) == 152U) && (hg_detector_sums(config) == 0U), "what it needs");
    prove((hg_detector_start(NULL, config, &memory, HG_START_MOVING) == HG_E_ARGUMENT) && (hg_detector_start(&self, NULL, &memory, HG_START_MOVING) == HG_E_ARGUMENT) &&
              (hg_detector_start(&self, config, NULL, HG_START_MOVING) == HG_E_ARGUMENT),
          "null pointers");
    const bool room = (memory.codes == 12U) && (memory.reals == 152U);
    prove(room || (hg_detector_start(&self, config, &memory, HG_START_MOVING) == HG_E_SIZE), "too little memory");
    memory.codes = 12U;
    memory.reals = 152U;
    prove(hg_detector_start(&self, config, &memory, HG_START_MOVING) == HG_OK, "it starts");
    const uint8_t none = any_u8_in(GROUPS, UINT8_MAX);
    int32_t codes[3];
    prove((hg_detector_lose(&self, none) == HG_E_ARGUMENT) && (hg_detector_receive(&self, none, codes, true) == HG_E_ARGUMENT), "no such group");
    for (uint8_t k = 0U; k < SAMPLES; k++) {
        hg_finding finding;
        if (any_bool()) {
            prove(hg_detector_lose(&self, 0U) == HG_OK, "noted");
        }
        if (any_bool()) {
            const hg_status status = hg_detector_receive(&self, 0U, codes, any_bool());
            prove((status == HG_OK) || (status == HG_E_NUMERIC), "no other status");
            if (status == HG_OK) {
                reach("a frame");
            }
        }
        const hg_status status = hg_detector_step(&self, &finding);
        prove((status == HG_OK) || (status == HG_E_NUMERIC), "no other status");
        prove((finding.plant <= HG_PLANT_CONFIRMED) && (finding.basis != HG_BASIS_UNSET), "a finding that there is");
    }
    hg_detector_restart(&self, HG_START_MOVING);
    prove(self.samples == 0U, "begun again");
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
