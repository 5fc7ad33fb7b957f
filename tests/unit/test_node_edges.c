/** @file
 *  node.h at its edges: groups in another order or of another kind, counters that turn, times that are longer than a stamp or a counter can tell, frames that
 *  come twice or from elsewhere; and the bits of its own frames. The tables are in the rig, so that each test changes what it is about. */
#include "support.h"

#include "hullguard/node.h"

#include "small_node.h"

#define HEARTBEAT 5U

typedef struct {
    hg_node            self;
    sm_storage         storage;
    hg_hold            holds[SM_GROUPS + 1U]; /* one more than there are */
    hg_link            before; /* never written */
    hg_link            link[SM_GROUPS];
    hg_link            behind; /* never written */
    int32_t            closing[3];
    hg_node_memory     memory;
    hg_e2e_config      rule[SM_GROUPS + 1U];
    hg_message         message[SM_GROUPS + 1U];
    hg_trigger_config  trigger;
    hg_hold_config     hold[SM_GROUPS];
    hg_detector_config detector;
    hg_node_config     config;
    hg_verdict         verdict;
    uint8_t            counter[SM_GROUPS];
} rig;

static rig r;

/* Group 0 sends two signals by events, group 1 one signal every sample, and closes it. */
static void prepare(void)
{
    (void)memset(&r, 0x5A, sizeof(r));
    arm_codes(r.closing, COUNT(r.closing));
    for (size_t i = 0U; i <= SM_GROUPS; i++) {
        r.rule[i] = stamped_rule;
        r.message[i] = (hg_message){.id = 0x101U + (uint32_t)i, .length = (i == 0U) ? 6U : 4U, .width = (i == 0U) ? 2U : 1U, .field = fields,
                                    .scale = sm_scale, .e2e = &r.rule[i]};
    }
    r.trigger = sm_trigger_a;
    (void)memcpy(r.hold, sm_hold, sizeof(r.hold));
    r.hold[0].trigger = &r.trigger;
    r.detector = sm_detector;
    r.detector.hold = r.hold;
    r.config = (hg_node_config){.detector = &r.detector, .message = r.message, .closing = 1U, .verdict = &verdict_message, .status = &status_message,
                                .heartbeat = HEARTBEAT};
    r.memory = (hg_node_memory){.detector = sm_memory(&r.storage), .link = r.link, .closing = r.closing};
    r.memory.detector.hold = r.holds;
    r.counter[0] = 7U;
    r.counter[1] = 11U;
}

static hg_status start(hg_start how)
{
    return hg_node_start(&r.self, &r.config, &r.memory, how);
}

static void begin(void)
{
    assert_status(HG_OK, start(HG_START_REST));
}

/* The next frame of a group. */
static hg_can_frame frame_of(uint8_t group, uint32_t k, int32_t a, int32_t b)
{
    const int32_t code[2] = {a, b};
    hg_can_frame frame;
    const hg_e2e_config *e2e = r.message[group].e2e;
    hg_frame_pack(&r.message[group], code, &frame);
    assert_status(HG_OK, hg_e2e_protect(e2e, frame.data, frame.length, (uint8_t)(r.counter[group] % hg_e2e_modulus(e2e)), (uint8_t)(k & 15U)));
    r.counter[group] = (uint8_t)((r.counter[group] + 1U) % hg_e2e_modulus(e2e));
    return frame;
}

static hg_status give(uint8_t group, uint32_t k, int32_t a, int32_t b)
{
    const hg_can_frame frame = frame_of(group, k, a, b);
    return hg_node_receive(&r.self, &frame);
}

/* So many frames of a group are sent that nobody receives. */
static void lose(uint8_t group, uint32_t frames)
{
    r.counter[group] = (uint8_t)((r.counter[group] + frames) % hg_e2e_modulus(r.message[group].e2e));
}

static void step(uint32_t k)
{
    (void)memset(&r.verdict, 0x5A, sizeof(r.verdict));
    assert_status(HG_OK, hg_node_step(&r.self, &r.verdict));
    assert_count(k, r.verdict.k);
    sm_check_canaries(&r.storage);
    assert_codes_untouched(&r.closing[2], 1U);
    hg_link guard;
    (void)memset(&guard, 0x5A, sizeof(guard));
    assert_memory_equal(&guard, &r.before, sizeof(guard));
    assert_memory_equal(&guard, &r.behind, sizeof(guard));
}

static void nothing_is_due(void)
{
    hg_verdict none;
    assert_status(HG_E_EMPTY, hg_node_step(&r.self, &none));
}

static void tick(uint32_t k)
{
    assert_status(HG_OK, give(r.config.closing, k, 0, 0));
    step(k);
    nothing_is_due();
}

static void ticks(uint32_t from, uint32_t to)
{
    for (uint32_t k = from; k < to; k++) {
        tick(k);
    }
}

/* Whole samples. */
static void samples(uint32_t from, uint32_t to)
{
    for (uint32_t k = from; k < to; k++) {
        assert_status(HG_OK, give((uint8_t)(1U - r.config.closing), k, 0, 0));
        tick(k);
    }
}

static void overdue(uint32_t from, uint32_t to)
{
    for (uint32_t k = from; k < to; k++) {
        hg_node_overdue(&r.self);
        step(k);
    }
}

static hg_bus_health bus(uint8_t group)
{
    return (hg_bus_health)(((uint32_t)r.verdict.bus >> (2U * (uint32_t)group)) & 3U);
}

/* ---- start ---- */

static void the_tables_of_the_first_group_are_looked_at_too(void **state)
{
    (void)state;
    prepare();
    r.message[0].length = 5U;
    assert_status(HG_E_CONFIG, start(HG_START_REST));
    prepare();
    r.message[0].width = 1U;
    assert_status(HG_E_CONFIG, start(HG_START_REST));
    prepare();
    r.hold[0].trigger = NULL;
    assert_status(HG_E_CONFIG, start(HG_START_REST));
    prepare();
    begin();
}

static void a_fault_beyond_the_shorter_verdict_frame_is_found_in_any_generator(void **state)
{
    (void)state;
    static const uint32_t too_many[2][SM_GENERATORS] = {{0x10000U, 0x1U}, {0x1U, 0x10000U}};
    static const uint32_t just[SM_GENERATORS] = {0x8000U, 0x1U};
    for (size_t i = 0U; i < 2U; i++) {
        prepare();
        r.detector.decision.faults = too_many[i];
        assert_status(HG_E_CONFIG, start(HG_START_REST));
    }
    prepare();
    r.detector.decision.faults = just;
    begin();
}

/* ---- which group, which link ---- */

static void a_standard_identifier_is_not_the_extended_one_of_the_same_number(void **state)
{
    (void)state;
    const uint8_t flags[3][SM_GROUPS] = {{0U, HG_CAN_EXTENDED}, {HG_CAN_EXTENDED, 0U}, {HG_CAN_EXTENDED, HG_CAN_EXTENDED}};
    for (size_t i = 0U; i < 3U; i++) {
        prepare();
        for (size_t group = 0U; group < SM_GROUPS; group++) {
            r.message[group].flags = flags[i][group];
            r.message[group].id = ((i < 2U) || (group == 0U)) ? 0x101U : 0x102U;
        }
        begin();
        samples(0U, 3U);
        for (uint8_t group = 0U; group < SM_GROUPS; group++) {
            assert_int_equal(3, hg_node_health(&r.self, group)->good);
        }
    }
}

static void a_verdict_tells_of_the_groups_that_there_are(void **state)
{
    (void)state;
    prepare();
    begin();
    samples(0U, 3U);
    r.holds[SM_GROUPS] = r.holds[0];
    samples(3U, 4U);
    assert_int_equal(HG_BUS_GOOD | (HG_BUS_GOOD << 2), r.verdict.bus);
    assert_false(r.verdict.refused);
}

static void a_signal_marked_invalid_is_counted_wherever_it_is(void **state)
{
    (void)state;
    prepare();
    begin();
    samples(0U, 2U);
    assert_int_equal(0, hg_node_health(&r.self, 0U)->invalid);
    assert_status(HG_OK, give(0U, 2U, 0, HG_CODE_INVALID));
    assert_int_equal(1, hg_node_health(&r.self, 0U)->invalid);
    tick(2U);
    assert_status(HG_OK, give(0U, 3U, HG_CODE_INVALID, 0));
    assert_int_equal(2, hg_node_health(&r.self, 0U)->invalid);
}

static void a_closing_frame_whose_numbers_are_refused_closes_its_sample_without_them(void **state)
{
    (void)state;
    prepare();
    begin();
    samples(0U, 2U);
    assert_int_equal(2, hg_node_health(&r.self, 1U)->good);
    assert_false(r.verdict.refused);
    hg_can_frame bad = frame_of(1U, 2U, 0, 0);
    bad.data[3] = 0x7FU; /* 32512: a number, but outside the range */
    assert_status(HG_OK, hg_e2e_protect(&r.rule[1], bad.data, bad.length, bad.data[1] & 15U, 2U));
    assert_status(HG_E_NUMERIC, hg_node_receive(&r.self, &bad));
    step(2U);
    nothing_is_due();
    assert_count(1U, r.self.overdue);
    assert_int_equal(1, hg_node_health(&r.self, 1U)->numeric);
    assert_int_equal(2, hg_node_health(&r.self, 1U)->good);
    assert_true(r.verdict.refused);
    assert_real(SM_SLEW(1), r.self.detector.radius[2]);
}

/* ---- the sequence of a measurement ---- */

/* Without a counter only a sender that speaks at fixed times shows by its age that nothing was lost. */
static void an_unprotected_sender_of_events_is_never_whole(void **state)
{
    (void)state;
    static const uint8_t silences[] = {3U, 3U, 0U, 2U};
    const struct {
        const uint8_t *silence;
        uint8_t        levels;
        bool           periodic;
    } senders[] = {{&silences[0], 2U, true}, {&silences[1], 2U, false}, {&silences[3], 1U, false}, {&silences[0], 1U, true}};
    for (size_t i = 0U; i < COUNT(senders); i++) {
        prepare();
        r.rule[0] = no_rule;
        r.trigger.silence = senders[i].silence;
        r.trigger.levels = senders[i].levels;
        begin();
        for (uint32_t k = 0U; k < 6U; k++) {
            samples(k, k + 1U);
            assert_int_equal((senders[i].periodic || (k == 0U)) ? HG_BUS_GOOD : HG_BUS_LOSSY, bus(0U));
        }
    }
}

static void a_frame_of_another_sample_that_fits_the_sequence_moves_it_to_that_sample(void **state)
{
    (void)state;
    for (uint32_t ahead = 1U; ahead < 16U; ahead++) {
        const uint32_t sent = (ahead <= 7U) ? (20U + ahead) : (20U + ahead - 16U);
        prepare();
        begin();
        samples(0U, 4U);
        ticks(4U, 20U);
        assert_status(HG_E_STAMP, give(0U, sent, 0, 0));
        assert_count(sent, r.link[0].k);
        assert_int_equal((ahead <= 7U) ? 1 : 0, hg_node_health(&r.self, 0U)->early);
        assert_int_equal((ahead <= 7U) ? 0 : 1, hg_node_health(&r.self, 0U)->late);
        assert_int_equal(0, hg_node_health(&r.self, 0U)->lost);
        if (sent < 20U) {
            samples(20U, 21U); /* and the next goes on from it */
            assert_int_equal(0, hg_node_health(&r.self, 0U)->lost);
        }
    }
}

static void an_old_frame_sent_once_more_does_not_move_the_counter(void **state)
{
    (void)state;
    for (uint32_t back = 2U; back <= 8U; back++) {
        hg_can_frame old = {.id = 0U};
        prepare();
        begin();
        for (uint32_t k = 0U; k < 20U; k++) {
            const hg_can_frame frame = frame_of(0U, k, 0, 0);
            old = (k == (20U - back)) ? frame : old;
            assert_status(HG_OK, hg_node_receive(&r.self, &frame));
            tick(k);
        }
        assert_status(HG_E_STAMP, hg_node_receive(&r.self, &old));
        assert_int_equal(1, hg_node_health(&r.self, 0U)->late);
        assert_count(19U, r.link[0].k);
        samples(20U, 21U);
        assert_int_equal(0, hg_node_health(&r.self, 0U)->lost);
    }
}

/* Between two frames of the same sender its samples go forward: one of an earlier sample is not its next, whatever its counter says. */
static void a_frame_of_an_earlier_sample_is_not_the_next_one(void **state)
{
    (void)state;
    prepare();
    begin();
    samples(0U, 5U);
    assert_status(HG_OK, give(0U, 5U, 0, 0));
    assert_status(HG_E_STAMP, give(0U, 4U, 0, 0));
    assert_count(5U, r.link[0].k);
    tick(5U);
    r.counter[0] = (uint8_t)((r.counter[0] + 15U) % 16U);
    samples(6U, 7U);
}

/* Frames of two neighbouring samples may come within one where no stamp tells them apart. */
static void without_a_stamp_one_frame_more_is_possible(void **state)
{
    (void)state;
    for (uint32_t lost = 0U; lost < 5U; lost++) {
        prepare();
        r.rule[0] = unstamped_rule;
        begin();
        samples(0U, 4U);
        lose(0U, lost);
        assert_status((lost <= 1U) ? HG_OK : HG_E_SEQUENCE, give(0U, 4U, 0, 0));
        assert_int_equal((lost <= 1U) ? lost : 0U, hg_node_health(&r.self, 0U)->lost);
    }
}

static void after_a_silence_of_any_length_every_counter_is_possible(void **state)
{
    (void)state;
    const uint32_t silent[] = {16U, 65535U, 65536U, 65537U, 70000U, INT32_MAX - 1, INT32_MAX}; /* samples */
    for (size_t i = 0U; i < COUNT(silent); i++) {
        for (uint32_t lost = 0U; lost < 15U; lost++) {
            prepare();
            begin();
            samples(0U, 1U);
            r.link[0].k = 1U - silent[i];
            lose(0U, lost);
            assert_status(HG_OK, give(0U, 1U, 0, 0));
            assert_int_equal(lost, hg_node_health(&r.self, 0U)->lost);
        }
    }
}

/* In the time of a whole turn of the counter that many frames may be missing, and it goes on all the same. */
static void a_counter_proves_nothing_after_the_time_of_a_whole_turn(void **state)
{
    (void)state;
    static const uint8_t no_silence[] = {0U};
    static const uint8_t signal[] = {2U};
    static hg_real slew[2U * 24U];
    for (size_t j = 0U; j < COUNT(slew); j++) {
        slew[j] = R(SM_SPAN);
    }
    for (uint32_t passed = 15U; passed <= 18U; passed++) {
        hg_residual_config residual = sm_residual[1];
        hg_hull_config hull = sm_hull[1];
        prepare();
        residual.signal = signal; /* of group 1, which speaks in every sample */
        hull.signal = signal;
        r.detector.generators = 1U;
        r.detector.decision.generators = 1U;
        r.detector.residual = &residual;
        r.detector.hull = &hull;
        r.detector.residuals = 1U;
        r.trigger.levels = 1U;
        r.trigger.silence = no_silence;
        r.trigger.interval_max = 22U;
        r.hold[0].slew = slew;
        begin();
        samples(0U, 3U);
        ticks(3U, 2U + passed);
        samples(2U + passed, 3U + passed);
        assert_int_equal((passed <= 16U) ? HG_BUS_GOOD : HG_BUS_LOSSY, bus(0U));
    }
}

/* ---- the sequence of closing frames ---- */

/* Stragglers and a new beginning, with counters of every phase, beside a group whose counter turns elsewhere. */
static void a_closing_counter_turns_by_its_own_profile(void **state)
{
    (void)state;
    for (uint8_t from = 0U; from < 16U; from++) {
        prepare();
        r.rule[0] = unstamped_rule;
        r.counter[1] = from;
        begin();
        samples(0U, 5U);
        overdue(5U, 6U);
        assert_status(HG_E_STAMP, give(1U, 5U, 0, 0)); /* late, not lost */
        samples(6U, 7U);
        assert_int_equal(0, hg_node_health(&r.self, 1U)->lost);
        overdue(7U, 8U);
        lose(1U, 4U);
        assert_status(HG_E_SEQUENCE, give(1U, 8U, 0, 0)); /* one sample ago, and four frames */
        overdue(8U, 9U);
        assert_status(HG_OK, give(1U, 9U, 0, 0));
        step(9U);
        assert_int_equal(HG_PLANT_STARTING, r.verdict.plant);
    }
}

static void a_closing_frame_without_a_stamp_is_late_or_begins_anew_by_its_counter(void **state)
{
    (void)state;
    for (uint8_t from = 0U; from < 15U; from++) {
        for (uint32_t k = 5U; k <= 6U; k++) { /* without a clock, or with one */
            prepare();
            r.rule[1] = unstamped_rule;
            r.counter[1] = from;
            begin();
            samples(0U, 5U);
            overdue(5U, k);
            lose(1U, 9U);
            assert_status(HG_E_STAMP, give(1U, 0U, 0, 0));
            nothing_is_due();
            const uint32_t open = (k == 5U) ? 5U : 7U;
            overdue(k, open);
            assert_status(HG_OK, give(1U, 0U, 0, 0)); /* two that agree: this node has lost the counter */
            step(open); /* nobody knows how many samples have passed: the index stays */
            assert_int_equal(HG_PLANT_STARTING, r.verdict.plant);
            ticks(open + 1U, open + 3U);
            overdue(open + 3U, open + 4U);
            const hg_can_frame late = frame_of(1U, 0U, 0, 0);
            const uint16_t lost = hg_node_health(&r.self, 1U)->lost;
            assert_status(HG_E_STAMP, hg_node_receive(&r.self, &late));
            assert_status(HG_E_REPEATED, hg_node_receive(&r.self, &late)); /* it has been received */
            tick(open + 4U);
            assert_int_equal(lost, hg_node_health(&r.self, 1U)->lost);
        }
    }
}

static void a_refused_closing_frame_once_more_is_no_second_witness(void **state)
{
    (void)state;
    prepare();
    begin();
    samples(0U, 5U);
    lose(1U, 15U);
    const hg_can_frame frame = frame_of(1U, 5U, 0, 0);
    for (int i = 0; i < 3; i++) {
        assert_status(HG_E_SEQUENCE, hg_node_receive(&r.self, &frame));
    }
    nothing_is_due();
}

/* Two refused closing frames agree when no more samples lie between them than a stamp can tell forward from back. */
static void witnesses_are_at_most_seven_samples_apart(void **state)
{
    (void)state;
    for (uint32_t apart = 1U; apart <= 9U; apart++) {
        prepare();
        begin();
        samples(0U, 5U);
        lose(1U, 15U);
        assert_status(HG_E_SEQUENCE, give(1U, 5U, 0, 0));
        lose(1U, apart - 1U);
        const hg_status status = give(1U, 5U + apart, 0, 0);
        assert_status((apart <= 7U) ? HG_OK : HG_E_STAMP, status);
    }
}

static void out_of_step_is_no_question_of_the_clock(void **state)
{
    (void)state;
    prepare();
    begin();
    samples(0U, 5U);
    hg_node_expect(&r.self, 1U);
    lose(1U, 15U);
    assert_status(HG_E_SEQUENCE, give(1U, 6U, 0, 0)); /* not too soon */
    assert_int_equal(0, hg_node_health(&r.self, 1U)->early);
    assert_int_equal(1, hg_node_health(&r.self, 1U)->sequence);
}

/* An old closing frame that looks as if it were ahead has not been received: what is lost is counted from the last one accepted. */
static void a_closing_frame_that_comes_too_soon_is_none_received(void **state)
{
    (void)state;
    const uint32_t most[] = {0U, 1U, 5U, 7U, 8U, 256U};
    for (size_t i = 0U; i < COUNT(most); i++) {
        for (uint32_t ahead = 1U; ahead <= 8U; ahead++) {
            prepare();
            begin();
            samples(0U, 20U);
            hg_node_expect(&r.self, most[i]);
            const uint8_t counter = r.counter[1];
            lose(1U, ahead);
            const bool accepted = (ahead <= most[i]) && (ahead <= 7U);
            assert_status(accepted ? HG_OK : HG_E_STAMP, give(1U, 20U + ahead, 0, 0));
            if (!accepted) {
                assert_int_equal((ahead <= 7U) ? 1 : 0, hg_node_health(&r.self, 1U)->early);
                r.counter[1] = counter;
                overdue(20U, 21U);
                lose(1U, 1U);
                samples(21U, 22U);
                assert_int_equal(1, hg_node_health(&r.self, 1U)->lost);
                assert_int_equal(HG_PLANT_NONE, r.verdict.plant);
            }
        }
    }
}

/* Its counter fits a sample that was closed without it; its stamp says another. */
static void a_closing_frame_whose_stamp_does_not_fit_is_no_straggler(void **state)
{
    (void)state;
    prepare();
    begin();
    samples(0U, 5U);
    overdue(5U, 7U);
    assert_status(HG_E_SEQUENCE, give(1U, 9U, 0, 0));
    lose(1U, 1U);
    samples(7U, 8U);
    assert_int_equal(2, hg_node_health(&r.self, 1U)->lost);
}

/* Counter and stamp of the last one, and other numbers: somebody else's. */
static void a_twin_of_the_last_closing_frame_is_late_and_nothing_more(void **state)
{
    (void)state;
    prepare();
    begin();
    samples(0U, 5U);
    lose(1U, 15U);
    assert_status(HG_E_STAMP, give(1U, 4U, 99, 0));
    assert_int_equal(1, hg_node_health(&r.self, 1U)->late);
    samples(5U, 6U);
    assert_int_equal(0, hg_node_health(&r.self, 1U)->lost);
}

static void before_the_first_closing_frame_none_is_a_straggler(void **state)
{
    (void)state;
    prepare();
    r.counter[1] = 1U;
    begin();
    overdue(0U, 3U);
    const hg_can_frame late = frame_of(1U, 1U, 0, 0);
    assert_status(HG_E_STAMP, hg_node_receive(&r.self, &late));
    assert_status(HG_E_STAMP, hg_node_receive(&r.self, &late)); /* the last one received it would be, once more */
    assert_int_equal(2, hg_node_health(&r.self, 1U)->late);
}

/* ---- beginning anew ---- */

/* A measurement without a stamp that was booked while closing frames were missing may be of any of their samples. */
static void what_may_be_of_another_sample_is_forgotten_with_the_past(void **state)
{
    (void)state;
    for (uint8_t closing = 0U; closing < 2U; closing++) {
        for (int given = 0; given < 2; given++) {
            const uint8_t other = (uint8_t)(1U - closing);
            prepare();
            if (closing == 0U) {
                r.hold[0] = sm_hold[1];
                r.hold[1] = sm_hold[0];
                r.message[0].length = 4U;
                r.message[0].width = 1U;
                r.message[1].length = 6U;
                r.message[1].width = 2U;
                r.config.closing = 0U;
            }
            r.rule[other] = unstamped_rule;
            r.rule[2] = unstamped_rule; /* of no group */
            begin();
            r.holds[SM_GROUPS].fresh = true;
            samples(0U, 5U);
            assert_int_equal(HG_PLANT_NONE, r.verdict.plant);
            if (given != 0) {
                assert_status(HG_OK, give(other, 5U, 0, 0));
            }
            lose(closing, 1U);
            assert_status(HG_OK, give(closing, 6U, 0, 0));
            if (given == 0) {
                step(5U);
            }
            step(6U);
            nothing_is_due();
            assert_int_equal((given != 0) ? HG_PLANT_STARTING : HG_PLANT_NONE, r.verdict.plant);
            assert_int_equal((given != 0) ? HG_BUS_ABSENT : HG_BUS_GOOD, bus(other));
            assert_count((given != 0) ? 2U : 1U, r.self.detector.beginnings);
        }
    }
}

/* Up to a whole turn of samples may have passed: a counter may have moved as far as it likes. */
static void after_a_new_beginning_every_counter_is_possible(void **state)
{
    (void)state;
    for (uint32_t lost = 0U; lost < 15U; lost++) {
        prepare();
        begin();
        samples(0U, 5U);
        lose(1U, 5U);
        assert_status(HG_E_STAMP, give(1U, 13U, 0, 0)); /* the sender is at 13, this node at 5 */
        assert_status(HG_OK, give(1U, 14U, 0, 0));
        step(14U);
        lose(0U, lost);
        assert_status(HG_OK, give(0U, 15U, 0, 0));
        assert_int_equal(lost, hg_node_health(&r.self, 0U)->lost);
    }
}

static void the_first_sample_index_is_no_new_beginning(void **state)
{
    (void)state;
    prepare();
    assert_status(HG_OK, start(HG_START_MOVING));
    overdue(0U, 6U);
    assert_status(HG_OK, give(1U, 9U, 0, 0));
    step(9U);
    assert_count(1U, r.self.detector.beginnings);
    assert_int_equal(HG_PLANT_NONE, r.verdict.plant); /* what has settled stays so */
}

/* The counter may have gone round meanwhile, to the very frame that was the last before. */
static void after_an_outage_the_last_frame_before_is_no_repetition(void **state)
{
    (void)state;
    prepare();
    begin();
    samples(0U, 5U);
    const hg_can_frame a = frame_of(0U, 5U, 0, 0);
    const hg_can_frame b = frame_of(1U, 5U, 0, 0);
    assert_status(HG_OK, hg_node_receive(&r.self, &a));
    assert_status(HG_OK, hg_node_receive(&r.self, &b));
    step(5U);
    assert_status(HG_E_REPEATED, hg_node_receive(&r.self, &a));
    assert_status(HG_E_REPEATED, hg_node_receive(&r.self, &b));
    hg_node_outage(&r.self);
    assert_status(HG_E_STAMP, hg_node_receive(&r.self, &a));
    assert_status(HG_OK, hg_node_receive(&r.self, &b));
    step(21U);
}

/* The age of a group saturates: beyond, nobody knows when a deadline expires. */
static void deadlines_are_counted_while_the_age_is_known(void **state)
{
    (void)state;
    static const hg_e2e_limits turning = {.init = {1U, 0U, 1U}, .valid = {1U, 1U, 1U}, .invalid = {1U, 0U, 1U}, .clear = false}; /* each event changes the state */
    prepare();
    r.rule[1].limits = &turning;
    begin();
    samples(0U, 1U);
    overdue(1U, 3U);
    for (uint32_t age = 3U; age < 300U; age++) {
        const hg_e2e_state before = r.link[1].machine.state;
        overdue(age, age + 1U);
        assert_int_equal(age < UINT8_MAX, before != r.link[1].machine.state);
    }
}

/* ---- the node's own frames ---- */

static void a_reply_changes_no_other_bit_of_a_verdict(void **state)
{
    (void)state;
    for (uint32_t plant = 0U; plant < 4U; plant++) {
        for (uint32_t basis = 0U; basis < 3U; basis++) {
            hg_can_frame frame;
            const hg_verdict v = {.k = 1U, .plant = (hg_plant)plant, .basis = (hg_basis)basis};
            hg_verdict_write(&verdict_message, &v, false, 0U, &frame);
            assert_int_equal(plant | (basis << 2U), frame.data[2]);
            hg_verdict_write(&verdict_message, &v, true, 0U, &frame);
            assert_int_equal(plant | (basis << 2U) | 0x10U, frame.data[2]);
        }
    }
}

static void behind_the_end_of_a_verdict_frame_nothing_is_written_or_read(void **state)
{
    (void)state;
    hg_can_frame frame;
    hg_verdict back;
    bool reply = false;
    const hg_verdict v = {.k = 1U, .plant = HG_PLANT_CONFIRMED, .basis = HG_BASIS_SET, .candidates = 0xFFFF8421U};
    hg_verdict_write(&verdict_message, &v, false, 0U, &frame);
    for (size_t i = 8U; i < HG_CAN_DATA_MAX; i++) {
        assert_int_equal(0, frame.data[i]);
        frame.data[i] = 0xA5U;
    }
    assert_status(HG_OK, hg_verdict_read(&verdict_message, &frame, &back, &reply));
    assert_count(0x8421U, back.candidates);
}

static void a_status_frame_tells_its_sample_and_clips_its_counts(void **state)
{
    (void)state;
    const uint32_t counts[] = {0U, 1U, 254U, 255U, 256U, 257U, 511U, 512U, 65536U};
    for (uint32_t k = 0U; k < 32U; k++) {
        hg_can_frame frame;
        const hg_verdict v = {.k = k};
        hg_status_write(&status_message, &v, 0U, 0U, 0U, &frame);
        assert_count(k & 15U, frame.data[1] >> 4U);
    }
    for (size_t i = 0U; i < COUNT(counts); i++) {
        hg_can_frame frame;
        const hg_verdict v = {.k = 0U};
        const uint32_t told = (counts[i] < 255U) ? counts[i] : 255U;
        hg_status_write(&status_message, &v, counts[i], 0U, 0U, &frame);
        assert_count(told, frame.data[6]);
        assert_count(0U, frame.data[7]);
        hg_status_write(&status_message, &v, 0U, counts[i], 0U, &frame);
        assert_count(0U, frame.data[6]);
        assert_count(told, frame.data[7]);
    }
}

static void a_status_frame_counts_every_kind_of_refusal_once(void **state)
{
    (void)state;
    hg_can_frame frame[2];
    const hg_verdict v = {.k = 0U};
    prepare();
    begin();
    r.link[0].health = (hg_link_health){.crc = 1U, .format = 2U, .early = 4U, .late = 8U, .sequence = 16U, .untrusted = 32U, .numeric = 64U, .good = 99U,
                                        .repeated = 99U, .invalid = 99U};
    r.link[1].health = (hg_link_health){.sequence = 100U};
    assert_int_equal(2, hg_node_report(&r.self, &v, false, frame));
    assert_count(0U, frame[1].data[6]);
    assert_count(227U, frame[1].data[7]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_tables_of_the_first_group_are_looked_at_too),
        cmocka_unit_test(a_fault_beyond_the_shorter_verdict_frame_is_found_in_any_generator),
        cmocka_unit_test(a_standard_identifier_is_not_the_extended_one_of_the_same_number),
        cmocka_unit_test(a_verdict_tells_of_the_groups_that_there_are),
        cmocka_unit_test(a_signal_marked_invalid_is_counted_wherever_it_is),
        cmocka_unit_test(a_closing_frame_whose_numbers_are_refused_closes_its_sample_without_them),
        cmocka_unit_test(an_unprotected_sender_of_events_is_never_whole),
        cmocka_unit_test(a_frame_of_another_sample_that_fits_the_sequence_moves_it_to_that_sample),
        cmocka_unit_test(an_old_frame_sent_once_more_does_not_move_the_counter),
        cmocka_unit_test(a_frame_of_an_earlier_sample_is_not_the_next_one),
        cmocka_unit_test(without_a_stamp_one_frame_more_is_possible),
        cmocka_unit_test(after_a_silence_of_any_length_every_counter_is_possible),
        cmocka_unit_test(a_counter_proves_nothing_after_the_time_of_a_whole_turn),
        cmocka_unit_test(a_closing_counter_turns_by_its_own_profile),
        cmocka_unit_test(a_closing_frame_without_a_stamp_is_late_or_begins_anew_by_its_counter),
        cmocka_unit_test(a_refused_closing_frame_once_more_is_no_second_witness),
        cmocka_unit_test(witnesses_are_at_most_seven_samples_apart),
        cmocka_unit_test(out_of_step_is_no_question_of_the_clock),
        cmocka_unit_test(a_closing_frame_that_comes_too_soon_is_none_received),
        cmocka_unit_test(a_closing_frame_whose_stamp_does_not_fit_is_no_straggler),
        cmocka_unit_test(a_twin_of_the_last_closing_frame_is_late_and_nothing_more),
        cmocka_unit_test(before_the_first_closing_frame_none_is_a_straggler),
        cmocka_unit_test(what_may_be_of_another_sample_is_forgotten_with_the_past),
        cmocka_unit_test(after_a_new_beginning_every_counter_is_possible),
        cmocka_unit_test(the_first_sample_index_is_no_new_beginning),
        cmocka_unit_test(after_an_outage_the_last_frame_before_is_no_repetition),
        cmocka_unit_test(deadlines_are_counted_while_the_age_is_known),
        cmocka_unit_test(a_reply_changes_no_other_bit_of_a_verdict),
        cmocka_unit_test(behind_the_end_of_a_verdict_frame_nothing_is_written_or_read),
        cmocka_unit_test(a_status_frame_tells_its_sample_and_clips_its_counts),
        cmocka_unit_test(a_status_frame_counts_every_kind_of_refusal_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
