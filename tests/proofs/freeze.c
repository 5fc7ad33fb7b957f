/** @file
 *  freeze.h: the last samples before a confirmed alarm. Numbers are any; sizes are those of a run. */
#include "any_node.h"

#include "hullguard/crc32c.h"

#define ROW_WORDS (3U + (HG_FREEZE_REALS(ALL, RESIDUES) * HG_REAL_WORDS)) /* of a sample */

/** A freeze frame starts with numbers in range and messages as it draws them; null pointers are refused; a record that its words could not count is.
 *  Any numbers of samples, of a detector of ALL signals; any messages of 8 bytes, valid or not.
 *  @proves hg_freeze_start
 *  @without conversion unsigned-overflow: places in a frame are cut on purpose
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:65 GROUPS=1U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS PROTECTION=1U */
void proof_freeze_start(void)
{
    hg_freeze_config *config = any_freeze_config();
    const hg_detector_config tables = any_detector_config();
    const hg_detector detector = {.config = &tables};
    const hg_freeze_memory memory = {.row = any_array(hg_freeze_row, 1U), .real = any_array(hg_real, 1U)};
    const hg_freeze_memory none = {.row = NULL, .real = NULL};
    hg_freeze self;
    config->samples = any_u8();
    config->after = any_u8();
    config->burst = any_u8();
    prove((hg_freeze_start(NULL, config, &memory, &detector, 0U) == HG_E_ARGUMENT) && (hg_freeze_start(&self, NULL, &memory, &detector, 0U) == HG_E_ARGUMENT) &&
              (hg_freeze_start(&self, config, NULL, &detector, 0U) == HG_E_ARGUMENT) && (hg_freeze_start(&self, config, &none, &detector, 0U) == HG_E_ARGUMENT) &&
              (hg_freeze_start(&self, config, &memory, NULL, 0U) == HG_E_ARGUMENT),
          "null pointers");
    config->request = any_bool() ? config->request : NULL;
    const hg_status status = hg_freeze_start(&self, config, &memory, &detector, any_u32());
    const bool fits = (config->samples >= 1U) && (config->after < config->samples) && (config->burst >= 1U) && (config->request != NULL) &&
                      ((4U + ((uint32_t)config->samples * ROW_WORDS)) <= HG_FREEZE_NO_WORD);
    prove(status == (fits ? HG_OK : HG_E_CONFIG), "numbers in range");
    if (status == HG_OK) {
        prove((self.state == HG_FREEZE_RECORDING) && (self.held == 0U) && (hg_freeze_words(&self) == 4U), "it records, and holds nothing");
        reach("a start");
    }
}

/** A record that is being read, or waits for its checksum, is not overwritten: once the samples after an alarm are in, what is held stays bit for bit until somebody clears it, whatever
 *  comes; alarms meanwhile are counted. Neither place nor count ever leaves the ring, whatever stands in them.
 *  SAMPLES rows of a detector of ALL signals and RESIDUES residuals; any state, any sample.
 *  @proves hg_freeze_step hg_freeze_word hg_freeze_words
 *  @stub hg_crc32c
 *  @without conversion unsigned-overflow: places go round the ring, the number of a record is meant to wrap
 *  @run check real=f32 unwind=12 limit=90 sum.0:24 SAMPLES=2U GROUPS=1U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS PROTECTION=1U
 *  @run deep real=f64 unwind=12 limit=90 sum.0:36 SAMPLES=2U GROUPS=1U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS PROTECTION=1U */
void proof_freeze_step(void)
{
    const hg_detector_config tables = any_detector_config();
    const hg_detector detector = any_detector(&tables);
    hg_freeze self = any_freeze(&detector);
    const hg_freeze before = self;
    const hg_freeze_row row = {.k = any_u32(), .candidates = any_u32(), .bus = any_u16(), .plant = (hg_plant)any_u8_in(0U, 3U), .basis = (hg_basis)any_u8_in(0U, 2U)};
    const uint8_t at = any_u8_in(0U, SAMPLES - 1U);
    const uint32_t k = self.memory.row[at].k;
    assume(requires_freeze(&self));
    hg_freeze_step(&self, &row);
    prove(ensures_freeze(&self, &before), "a state that samples can leave");
    prove((self.held <= SAMPLES) && (self.newest < SAMPLES), "within the ring");
    const bool kept = (before.state != HG_FREEZE_RECORDING) && (before.rest == 0U);
    prove((!kept) || ((self.held == before.held) && (self.newest == before.newest) && (self.memory.row[at].k == k)), "what is held stays");
    prove((!kept) || (self.state == before.state) || (self.state == HG_FREEZE_FROZEN), "until it is cleared");
    prove((self.state == before.state) || (before.state != HG_FREEZE_RECORDING) || ((row.plant == HG_PLANT_CONFIRMED) && (!before.confirmed)), "an alarm that begins ends the recording");
    const uint32_t words = hg_freeze_words(&self);
    prove(words == (4U + ((uint32_t)self.held * ROW_WORDS)), "its words");
    const uint32_t place = any_u32();
    const uint32_t word = hg_freeze_word(&self, place);
    prove((place != 1U) || (word == self.model_hash), "the model's");
    prove((place < (words - 1U)) || (word == self.crc), "the last is the checksum");
    if ((before.state == HG_FREEZE_RECORDING) && (self.state == HG_FREEZE_CLOSING)) {
        reach("an alarm");
    }
    if ((before.state == HG_FREEZE_CLOSING) && (self.state == HG_FREEZE_FROZEN)) {
        reach("a record");
    }
}

/** A request is obeyed only when its identifier, kind and checksum are right and it names the record that there is; a clear alone begins anew, and what is refused is counted. No more
 *  frames are handed out than the burst allows between two requests or samples, each of a word that there is or of the state.
 *  Any frame, any state.
 *  @proves hg_freeze_receive hg_freeze_report
 *  @stub hg_e2e_check hg_e2e_protect hg_frame_matches hg_crc32c
 *  @without conversion unsigned-overflow: bytes are cut on purpose, places go round the ring
 *  @run check real=f32 unwind=12 limit=90 hg_frame_pack.0:65 hg_frame_pack.1:65 SAMPLES=2U GROUPS=1U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS PROTECTION=1U */
void proof_freeze_receive(void)
{
    const hg_detector_config tables = any_detector_config();
    const hg_detector detector = any_detector(&tables);
    hg_freeze self = any_freeze(&detector);
    hg_freeze before = self;
    hg_can_frame frame;
    assume(requires_freeze(&self) && requires_freeze_receive(&self, &frame));
    const hg_status status = hg_freeze_receive(&self, &frame);
    prove(ensures_freeze_receive(&self, &before, status), "a status of the list");
    prove((frame.id == self.config->request->id) || (status == HG_E_ID), "its identifier");
    prove((status == HG_OK) || (status == HG_E_ID) || (self.refused > before.refused) || (before.refused == UINT16_MAX), "what is refused is counted");
    prove((self.state == before.state) || ((status == HG_OK) && (before.state == HG_FREEZE_FROZEN) && (frame.data[2] == HG_FREEZE_CLEAR) && (frame.data[3] == before.record)),
          "only a clear of this record begins anew");
    if (self.state != before.state) {
        reach("a clear");
    }
    before = self;
    hg_can_frame out;
    const hg_status said = hg_freeze_report(&self, &out);
    prove(ensures_freeze_report(&self, &before, said), "no more than the burst");
    prove((self.next <= self.end) || (self.next == before.next), "words that were asked for");
    if ((said == HG_OK) && (!before.answer)) {
        reach("a word");
    }
}
