/** @file
 *  node.h: a detector node between the bus and its detector. Tables of any content, messages of one field each; any frames. */
#include "any_detector.h"

/* Protection of a measurement message and of the closing one, by PROTECTION: of the project's own frames; of a vehicle's, without stamps; without protection beside the closing one. */
#if PROTECTION == 1U
#define MEASURED {.profile = HG_E2E_P22, .data_ids = ids, .crc = 0U, .counter = 8U, .stamp = 12U, .resync = any_u8(), .limits = &hg_e2e_limits_default}
#define CLOSING MEASURED
#elif PROTECTION == 2U
#define MEASURED {.profile = HG_E2E_P05, .data_id = any_u16(), .crc = 0U, .counter = 16U, .stamp = HG_E2E_NO_STAMP, .resync = any_u8(), .limits = &hg_e2e_limits_default}
#define CLOSING MEASURED
#else
#define MEASURED {.profile = HG_E2E_NONE, .stamp = HG_E2E_NO_STAMP, .limits = &hg_e2e_limits_default}
#define CLOSING {.profile = HG_E2E_P01, .mode = HG_E2E_BOTH, .data_id = any_u16(), .crc = 0U, .counter = 8U, .stamp = HG_E2E_NO_STAMP, .resync = any_u8(), .limits = &hg_e2e_limits_default}
#endif
#define OWN {.profile = HG_E2E_P22, .data_ids = ids, .crc = 0U, .counter = 8U, .stamp = 12U, .limits = &hg_e2e_limits_default}

static const hg_field field = {.start = 24U, .length = 8U, .flags = HG_FIELD_SIGNED};
static const hg_code_scale scale = {.minimum = -100, .maximum = 100};

static hg_message message_of(uint32_t id, uint8_t length, uint8_t width, const hg_e2e_config *e2e)
{
    return (hg_message){.id = id, .flags = 0U, .length = length, .width = width, .field = &field, .scale = &scale, .e2e = e2e, .idle = NULL};
}

/* What a node is made of, each an object of its own. */
static hg_node_config *any_node_config(void)
{
    const uint8_t *ids = any_array(uint8_t, HG_E2E_IDS);
    hg_e2e_config *e2e = any_array(hg_e2e_config, 3U);
    hg_message *message = any_array(hg_message, GROUPS);
    hg_message *own = any_array(hg_message, 2U);
    hg_detector_config *detector = any_array(hg_detector_config, 1U);
    hg_node_config *config = any_array(hg_node_config, 1U);
    e2e[0] = (hg_e2e_config)MEASURED;
    e2e[1] = (hg_e2e_config)CLOSING;
    e2e[2] = (hg_e2e_config)OWN;
    for (uint8_t i = 0U; i < GROUPS; i++) {
        message[i] = message_of(i, 4U, 1U, &e2e[((i + 1U) < GROUPS) ? 0U : 1U]);
    }
    own[0] = message_of(GROUPS, 8U, 0U, &e2e[2]);
    own[1] = message_of(GROUPS + 1U, 8U, 0U, &e2e[2]);
    *detector = any_detector_config();
    *config = (hg_node_config){.detector = detector, .message = message, .closing = GROUPS - 1U, .verdict = &own[0], .status = &own[1], .heartbeat = any_u16(), .model_hash = any_u32(),
                               .freeze = NULL};
    assume(config->heartbeat >= 1U);
    return config;
}

/* A node in any state that frames and samples can leave. */
static hg_node any_node(const hg_node_config *config)
{
    hg_node self;
    self.config = config;
    self.detector = any_detector(config->detector);
    self.link = any_array(hg_link, GROUPS);
    self.closing = any_array(int32_t, WIDTH);
    self.held = any_bool();
    self.continues = any_bool();
    self.synchronised = any_bool();
    self.slipped = any_bool();
    self.clocked = any_bool();
    self.closed = any_bool();
    self.reported = any_bool();
    self.last.refused = any_bool();
    self.freeze = NULL;
    for (uint8_t i = 0U; i < GROUPS; i++) {
        self.link[i].timed = any_bool();
        self.link[i].receiver.seen = any_bool();
    }
    assume(state_node(&self));
    return self;
}

/** A node starts before a sample with links that have seen nothing, and is one that frames can leave; null pointers and tables that contradict one another are refused.
 *  GROUPS groups, the last of them the closing one, protected by PROTECTION; tables of any content.
 *  @proves hg_node_start
 *  @stub hg_detector_start
 *  @without conversion: bytes are cut on purpose
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:65 PROTECTION=1U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:65 PROTECTION=3U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS */
void proof_node_start(void)
{
    hg_node_config *config = any_node_config();
    const hg_node before = any_node(config);
    const hg_node_memory memory = {.detector = before.detector.memory, .link = any_array(hg_link, GROUPS), .closing = any_array(int32_t, WIDTH)};
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
    prove((status != HG_OK) || (state_node(&self) && (self.k == 0U) && (self.due == 0U) && (!self.link[0].receiver.seen)), "as frames can leave it");
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
 *  @run check real=f32 unwind=10 limit=90 PROTECTION=1U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS */
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
    prove(state_node(&self) && started_detector(&self.detector), "as frames can leave it");
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
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=0U PROTECTION=1U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=1U PROTECTION=1U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=0U PROTECTION=2U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=1U PROTECTION=2U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=0U PROTECTION=3U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=1U PROTECTION=3U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=2U PROTECTION=1U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:33 FROM=3U PROTECTION=1U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS */
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
    prove((status == HG_OK) || (status == HG_E_ID) || (status == HG_E_FORMAT) || (status == HG_E_CRC) || (status == HG_E_REPEATED) || (status == HG_E_STAMP) ||
              (status == HG_E_SEQUENCE) || (status == HG_E_STATE) || (status == HG_E_NUMERIC) || (status == HG_E_BUSY),
          "a status of the list");
    prove(state_node(&self) && started_detector(&self.detector), "as frames can leave it");
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
 *  @run check real=f32 unwind=10 limit=90 PROTECTION=1U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS */
void proof_node_step(void)
{
    const hg_node_config *config = any_node_config();
    hg_node self = any_node(config);
    const uint32_t k = self.k;
    const uint8_t due = self.due;
    hg_verdict verdict;
    const hg_status status = hg_node_step(&self, &verdict);
    prove((status == HG_OK) ? (self.due == (due - 1U)) : ((status == HG_E_EMPTY) && (due == 0U)), "one that is due");
    prove(state_node(&self) && started_detector(&self.detector), "as samples can leave it");
    if (status == HG_OK) {
        prove((verdict.k == k) && (self.k == (uint32_t)(k + 1U)), "the open sample");
        prove((verdict.plant <= HG_PLANT_CONFIRMED) && (verdict.basis != HG_BASIS_UNSET) && (verdict.model_hash == config->model_hash), "a verdict that there is");
        reach("a step");
    }
}
