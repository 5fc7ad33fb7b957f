/** @file
 *  node.h: a detector node between the bus and its detector. Tables of any content, messages of one field each; any frames. */
#include "any_node.h"

/** A node starts before a sample with links that have seen nothing, and is one that frames can leave; null pointers and tables that contradict one another are refused.
 *  GROUPS groups, the last of them the closing one, protected by PROTECTION; tables of any content.
 *  @proves hg_node_start
 *  @without conversion: bytes are cut on purpose
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:65 hg_detector_start.0:70 PROTECTION=1U GROUPS=6U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=90 hg_e2e_valid.0:65 hg_detector_start.0:20 PROTECTION=3U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS */
void proof_node_start(void)
{
    hg_node_config *config = any_node_config();
    const hg_node_memory memory = {.detector = any_memory(), .link = any_array(hg_link, GROUPS), .closing = any_array(int32_t, WIDTH)};
    const hg_start how = any_bool() ? HG_START_REST : HG_START_MOVING;
    hg_node self;
    prove((hg_node_start(NULL, config, &memory, how) == HG_E_ARGUMENT) && (hg_node_start(&self, NULL, &memory, how) == HG_E_ARGUMENT) &&
              (hg_node_start(&self, config, NULL, how) == HG_E_ARGUMENT),
          "null pointers");
    config->heartbeat = any_u16();
    config->closing = any_u8();
    const hg_status status = hg_node_start(&self, config, &memory, how);
    prove((status == HG_OK) || (status == HG_E_CONFIG) || (status == HG_E_SIZE) || (status == HG_E_ARGUMENT), "a status of the list");
    prove((status != HG_OK) || ((config->heartbeat >= 1U) && (config->closing < GROUPS)), "tables in range");
    prove((status != HG_OK) || (started_node(&self)), "as frames can leave it");
    prove((status != HG_OK) || ((self.k == 0U) && (self.due == 0U) && (!self.link[0].receiver.seen)), "nothing seen");
    if (status == HG_OK) {
        reach("a start");
    }
}

/** What the application's clock says leaves a node as frames can leave it: a closing frame that is overdue makes a step due, an outage forgets what was known, and only how far ahead
 *  a closing frame may be is taken over.
 *  As above; any state, any clock.
 *  @proves hg_node_expect hg_node_overdue hg_node_outage hg_node_health
 *  @stub hg_detector_restart hg_hold_start
 *  @without conversion unsigned-overflow: sample indices and stamps are meant to wrap
 *  @run check real=f32 unwind=10 limit=90 PROTECTION=1U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=150 PROTECTION=1U GROUPS=6U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS */
void proof_node_clock(void)
{
    const hg_node_config *config = any_node_config();
    hg_node self = any_node(config);
    const uint8_t due = self.due;
    const uint32_t samples = any_u32();
    hg_node_expect(&self, samples);
    prove(self.ahead_max == ((samples < 7U) ? samples : 7U), "no further than the stamp tells");
    hg_node_overdue(&self);
    prove(self.due == ((due == 0U) ? 1U : due), "a step is due");
    prove(state_node(&self), "as frames can leave it");
    hg_node_outage(&self);
    prove((self.due == 0U) && (!self.synchronised) && (!self.held) && (!self.closed), "nothing is known of the time");
    prove(started_node(&self), "as frames can leave it");
    const uint8_t group = any_u8_in(0U, GROUPS - 1U);
    prove(hg_node_health(&self, group) == &self.link[group].health, "the group's");
    reach("end");
}

/** A node takes any frame whatever: no undefined behaviour, a status of the closed list, its open sample never goes back, and at most 8 steps become due; its links, its clock and its
 *  detector are again as frames can leave them. A frame is counted as good only when it was booked.
 *  As above; a frame of any kind, length and bytes in any state: with the identifier of group FROM, the last one the closing one; FROM = GROUPS: of none; above: one that only as
 *  a standard identifier were a group's. What else its flags say only hg_frame_matches() looks at.
 *  @proves hg_node_receive
 *  @stub hg_detector_receive hg_detector_restart hg_hold_start hg_e2e_check hg_frame_matches hg_frame_unpack
 *  @without conversion unsigned-overflow: sample indices and stamps are meant to wrap, bytes are cut on purpose
 *  @run deep real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=0U PROTECTION=1U GROUPS=6U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=5U PROTECTION=1U GROUPS=6U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=0U PROTECTION=2U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=1U PROTECTION=2U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=0U PROTECTION=3U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=150 hg_e2e_valid.0:33 FROM=0U PROTECTION=3U GROUPS=6U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=1U PROTECTION=3U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=150 hg_e2e_valid.0:33 FROM=5U PROTECTION=3U GROUPS=6U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=2U PROTECTION=1U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=150 hg_e2e_valid.0:33 FROM=6U PROTECTION=1U GROUPS=6U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=3U PROTECTION=1U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=150 hg_e2e_valid.0:33 FROM=7U PROTECTION=1U GROUPS=6U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS */
void proof_node_receive(void)
{
    const hg_node_config *config = any_node_config();
    hg_node self = any_node(config);
    const uint32_t k = self.k;
    const bool waits = self.due > 0U;
    const uint8_t group = any_u8_in(0U, GROUPS - 1U);
    const uint16_t good = self.link[group].health.good;
    hg_can_frame frame;
    frame.id = FROM % (GROUPS + 1U);
#if FROM == GROUPS
    frame.flags = any_u8();
#else
    frame.flags = (FROM < GROUPS) ? 0U : HG_CAN_EXTENDED;
#endif
    const hg_status status = hg_node_receive(&self, &frame);
    prove(ensures_node_receive(status), "a status of the list");
    prove(started_node(&self), "as frames can leave it");
    prove((self.k - k) <= 15U, "no sample goes back");
    prove((!waits) || (status == HG_E_BUSY) || (status == HG_E_ID), "no frame before the steps that are due");
    prove((self.link[group].health.good == good) || ((status == HG_OK) && (frame.id == group)), "what is counted as good was booked");
#if (FROM + 1U) == GROUPS
    if ((status == HG_OK) && (self.due > 1U)) {
        reach("a closing frame, ahead");
    }
#elif FROM < GROUPS
    if (status == HG_OK) {
        reach("a measurement");
    }
#else
    prove(status == HG_E_ID, "not a frame of this model");
    reach("a frame of others");
#endif
}

/** A step that is due gives a verdict of a plant that there is, and makes one less due; one that is not due gives nothing.
 *  As above; any state, with numbers of a closing frame held or not.
 *  @proves hg_node_step
 *  @stub hg_detector_receive hg_detector_step
 *  @without conversion unsigned-overflow: sample indices are meant to wrap, bits of groups are cut on purpose
 *  @run check real=f32 unwind=10 limit=90 PROTECTION=1U GROUPS=6U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS */
void proof_node_step(void)
{
    const hg_node_config *config = any_node_config();
    hg_node self = any_node(config);
    const hg_node before = self;
    hg_verdict verdict;
    const hg_status status = hg_node_step(&self, &verdict);
    prove(ensures_node_step(&self, &before, &verdict, status), "one that is due, of the open sample, with a verdict that there is");
    prove(started_node(&self), "as samples can leave it");
    if (status == HG_OK) {
        reach("a step");
    }
}

/** With a freeze frame, each step is entered, each frame that is of no group is offered to it, and its answers are handed out; without one there is nothing to hand out.
 *  As above; any state of node and freeze frame, any frame of no group's identifier.
 *  @proves hg_node_freeze hg_node_step hg_node_receive
 *  @stub hg_detector_receive hg_detector_step hg_freeze_receive hg_freeze_step hg_freeze_report hg_e2e_check hg_frame_matches hg_frame_unpack hg_hold_start hg_detector_restart
 *  @without conversion unsigned-overflow: sample indices are meant to wrap, bits of groups are cut on purpose
 *  @run check real=f32 unwind=10 limit=90 write_reals.0:40 hg_e2e_valid.0:34 PROTECTION=1U SAMPLES=2U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=150 write_reals.0:40 hg_e2e_valid.0:34 PROTECTION=1U SAMPLES=2U GROUPS=6U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS */
void proof_node_freeze(void)
{
    hg_node_config *config = any_node_config();
    hg_node self = any_node(config);
    hg_can_frame frame;
    prove(hg_node_freeze(&self, &frame) == HG_E_EMPTY, "no freeze frame");
    hg_freeze freeze = any_freeze(&self.detector);
    config->freeze = freeze.config;
    self.freeze = &freeze;
    assume(state_node(&self));
    const hg_status said = hg_node_freeze(&self, &frame);
    prove((said == HG_OK) || (said == HG_E_EMPTY), "no other status");
    const uint32_t unknown = self.unknown;
    frame.id = GROUPS;
    const hg_status status = hg_node_receive(&self, &frame);
    prove((status == HG_OK) || (status == HG_E_ID) || (status == HG_E_FORMAT) || (status == HG_E_CRC) || (status == HG_E_STATE) || (status == HG_E_NUMERIC), "what the freeze frame says");
    prove((self.unknown == unknown) || (status == HG_E_ID), "no frame of others");
    hg_verdict verdict;
    const bool due = self.due > 0U;
    prove((hg_node_step(&self, &verdict) == HG_OK) == due, "one that is due");
    prove(state_node(&self) && requires_freeze(&freeze), "as samples can leave it");
    if (due && (status == HG_OK) && (said == HG_OK)) {
        reach("all three");
    }
}
