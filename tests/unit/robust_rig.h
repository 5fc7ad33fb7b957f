/** @file
 *  A node with its plant and senders, for every profile of the link and with or without stamps: what the tests of misbehaviour share. */
#ifndef HULLGUARD_TESTS_ROBUST_RIG_H
#define HULLGUARD_TESTS_ROBUST_RIG_H

#include "small_plant.h"

#define M 0U /* the measurement's group */
#define C 1U /* the closing group */
#define AHEAD_MAX 7U

typedef struct {
    hg_e2e_profile profile;
    bool           stamped[SM_GROUPS];
} kind;

static const kind kinds[] = {{HG_E2E_P22, {true, true}},   {HG_E2E_P05, {true, true}},   {HG_E2E_P11, {true, true}},
                             {HG_E2E_P22, {false, true}},  {HG_E2E_P05, {false, true}},  {HG_E2E_P11, {false, true}},
                             {HG_E2E_P22, {false, false}}, {HG_E2E_P05, {false, false}}, {HG_E2E_P11, {false, false}}};
#define STAMPED 3U /* the first of them, which are stamped throughout */

static const uint8_t rig_list[SM_GROUPS + 1U][HG_E2E_IDS] = {{0x31U}, {0x52U, 0x17U}, {0x73U}};
static const hg_field rig_fields[2] = {{32U, 16U, HG_FIELD_SIGNED}, {48U, 16U, HG_FIELD_SIGNED}};
static const hg_e2e_config rig_own = {.profile = HG_E2E_P22, .data_ids = rig_list[2], .counter = 8U, .stamp = 12U,
                                      .limits = &hg_e2e_limits_default};
static const hg_message rig_verdict = {.id = 0x200U, .length = 8U, .e2e = &rig_own};
static const hg_message rig_status = {.id = 0x201U, .length = 8U, .e2e = &rig_own};

typedef struct {
    hg_e2e_config  rule[SM_GROUPS];
    hg_message     message[SM_GROUPS];
    hg_node_config config;
    hg_node        node;
    sm_storage     storage;
    hg_link        link[SM_GROUPS];
    int32_t        closing[1];
    hg_node_memory memory;
    hg_verdict     verdict;       /* of the last step */
    plant          plant;
    uint32_t       k;             /* the plant's sample */
    bool           fault;         /* is the plant faulty? */
    bool           confirmed;     /* has an alarm been confirmed since begin()? */
    unsigned       provisional;   /* steps with one that is not */
    hg_can_frame   frame[SM_GROUPS]; /* of the plant's last sample */
    bool           sent[SM_GROUPS];  /* is there one? */
} rig;

static inline void start_node(rig *r, hg_start how)
{
    r->memory = (hg_node_memory){.detector = sm_memory(&r->storage), .link = r->link, .closing = r->closing};
    assert_status(HG_OK, hg_node_start(&r->node, &r->config, &r->memory, how));
}

/* All places of all profiles lie in the first 4 bytes; a counter of 8 bits in byte 2, one of 4 in byte 1. */
static inline void begin(rig *r, const kind *link, hg_start how, uint32_t seed)
{
    static const uint32_t ids[SM_GROUPS] = {0x101U, 0x110U};
    static const uint8_t lengths[SM_GROUPS] = {8U, 6U};
    (void)memset(r, 0, sizeof(*r));
    for (uint8_t g = 0U; g < SM_GROUPS; g++) {
        r->rule[g] = (hg_e2e_config){.profile = link->profile, .mode = HG_E2E_NIBBLE, .data_id = (uint16_t)(0x0A31U + (0x121U * g)),
                                     .data_ids = rig_list[g], .crc = 0U, .counter = (link->profile == HG_E2E_P05) ? 16U : 8U, .nibble = 12U,
                                     .stamp = link->stamped[g] ? 24U : HG_E2E_NO_STAMP, .limits = &hg_e2e_limits_default};
        r->message[g] = (hg_message){.id = ids[g], .length = lengths[g], .width = (g == M) ? 2U : 1U, .field = rig_fields, .scale = sm_scale,
                                     .e2e = &r->rule[g]};
    }
    r->config = (hg_node_config){.detector = &sm_detector, .message = r->message, .closing = C, .verdict = &rig_verdict,
                                 .status = &rig_status, .heartbeat = 10U};
    plant_begin(&r->plant, r->message, seed);
    start_node(r, how);
}

/* The steps that are due. As long as the plant is healthy none may confirm an alarm. */
static inline unsigned steps(rig *r)
{
    unsigned made = 0U;
    while (hg_node_step(&r->node, &r->verdict) == HG_OK) {
        const bool confirmed = r->verdict.plant == HG_PLANT_CONFIRMED;
        sm_check_canaries(&r->storage);
        if (confirmed && (!r->fault)) {
            print_error("plant's sample %lu, node's %lu: confirmed without a fault\n", (unsigned long)r->k, (unsigned long)r->verdict.k);
            fail();
        }
        r->confirmed = r->confirmed || confirmed;
        r->provisional += (r->verdict.plant == HG_PLANT_PROVISIONAL) ? 1U : 0U;
        made++;
    }
    assert_true(made <= (AHEAD_MAX + 1U)); /* whatever came: the cost of a sample is bounded */
    return made;
}

/* The plant's next sample, and what its senders make of it. */
static inline void emit(rig *r)
{
    hg_real value[SM_GROUPS][2];
    plant_move(&r->plant, r->fault, value);
    for (uint8_t g = 0U; g < SM_GROUPS; g++) {
        r->sent[g] = hg_sender_step(&r->plant.sender[g], r->k, value[g], &r->frame[g]) == HG_OK;
    }
    r->k++;
}

static inline hg_status give(rig *r, const hg_can_frame *frame)
{
    return hg_node_receive(&r->node, frame);
}

static inline void deliver(rig *r)
{
    for (uint8_t g = 0U; g < SM_GROUPS; g++) {
        if (r->sent[g]) {
            (void)give(r, &r->frame[g]);
        }
    }
    (void)steps(r);
}

/* Samples over a link that loses nothing. */
static inline void run(rig *r, uint32_t samples)
{
    for (uint32_t i = 0U; i < samples; i++) {
        emit(r);
        deliver(r);
    }
}

static inline unsigned bus(const rig *r, uint8_t group)
{
    return ((unsigned)r->verdict.bus >> (2U * group)) & 3U;
}

/* Whatever was: the links get well, the plant is found healthy, and then its fault is found. */
static inline void heals_and_finds(rig *r)
{
    run(r, 30U);
    assert_int_equal(HG_BUS_GOOD, bus(r, M));
    assert_int_equal(HG_BUS_GOOD, bus(r, C));
    assert_int_equal(HG_PLANT_NONE, r->verdict.plant);
    r->fault = true;
    r->confirmed = false;
    run(r, 20U);
    assert_true(r->confirmed);
}

/* A copy of the whole, senders and plant too; it holds pointers into *r and must go back there. */
static inline void save(rig *copy, const rig *r)
{
    *copy = *r;
}

static inline void restore(rig *r, const rig *copy)
{
    *r = *copy;
}

static inline uint32_t modulus(const rig *r, uint8_t group)
{
    return hg_e2e_modulus(&r->rule[group]);
}

/* Protect a frame anew after its bytes were changed. */
static inline void protect(const rig *r, uint8_t group, hg_can_frame *frame, uint32_t counter, uint32_t stamp)
{
    assert_status(HG_OK, hg_e2e_protect(&r->rule[group], frame->data, frame->length, (uint8_t)(counter % modulus(r, group)), (uint8_t)stamp));
}

static inline uint32_t counter_of(const rig *r, uint8_t group, const hg_can_frame *frame)
{
    return (r->rule[group].profile == HG_E2E_P05) ? frame->data[2] : (frame->data[1] & 15U);
}

#endif
