/** @file
 *  Every row of the table in firmware/README.md: what comes, its status, the counter that rises, and that neither a healthy plant is accused nor a
 *  faulty one acquitted afterwards. */
#include "support.h"

#include "robust_rig.h"

#define WARM 70U /* samples after which everything has gone round */
#define FLOOD 65536U
#define OLDEST 64U

static rig r;
static rig kept;
static hg_can_frame past[SM_GROUPS][WARM + 40U]; /* by sample */
static bool there[SM_GROUPS][WARM + 40U];

static hg_link_health health(uint8_t group)
{
    return *hg_node_health(&r.node, group);
}

/* What all counters of a link together have risen by. */
static uint32_t sum(const hg_link_health *h)
{
    return (uint32_t)h->good + h->lost + h->crc + h->format + h->repeated + h->early + h->late + h->sequence + h->untrusted + h->numeric + h->invalid;
}

/* Exactly one counter of a group rises, by so much. */
#define assert_rises(group, counter, by, before)                                              \
    do {                                                                                      \
        const hg_link_health now_ = health(group);                                            \
        assert_count((by), now_.counter - (before).counter);                                  \
        assert_count((by), sum(&now_) - sum(&(before)));                                      \
    } while (false)

static void warm(const kind *link, uint32_t samples, uint32_t seed)
{
    begin(&r, link, HG_START_MOVING, seed);
    for (uint32_t k = 0U; k < samples; k++) {
        emit(&r);
        for (uint8_t g = 0U; (g < SM_GROUPS) && (k < COUNT(past[0])); g++) {
            past[g][k] = r.frame[g];
            there[g][k] = r.sent[g];
        }
        deliver(&r);
    }
    assert_int_equal(HG_PLANT_NONE, r.verdict.plant);
}

/* Samples until the measurement's sender speaks; its frame is in r.frame[M] and nothing of that sample has been delivered. */
static void until_it_speaks(void)
{
    emit(&r);
    while (!r.sent[M]) {
        deliver(&r);
        emit(&r);
    }
}

/* Samples with a deadline for each closing frame, and none that may be ahead. */
static void run_by_the_clock(uint32_t samples)
{
    for (uint32_t i = 0U; i < samples; i++) {
        const uint32_t open = r.node.k;
        hg_node_expect(&r.node, 0U);
        emit(&r);
        deliver(&r);
        if (r.node.k == open) {
            hg_node_overdue(&r.node);
            assert_count(1U, steps(&r));
        }
    }
}

/* ---- not this model's, not this kind ---- */

static void every_id_kind_and_length_has_its_status(void **state)
{
    (void)state;
    uint32_t expected[3] = {0U, 0U, 0U};
    begin(&r, &kinds[0], HG_START_REST, 1U);
    hg_can_frame frame;
    (void)memset(&frame, 0xA5, sizeof(frame));
    for (frame.id = 0U; frame.id <= HG_CAN_ID_STANDARD; frame.id++) {
        const bool ours = (frame.id == r.message[M].id) || (frame.id == r.message[C].id);
        const uint8_t fits = (frame.id == r.message[M].id) ? 8U : 6U;
        for (uint32_t flags = 0U; flags < 32U; flags++) {
            for (uint32_t length = 0U; length < 256U; length++) {
                frame.flags = (uint8_t)flags;
                frame.length = (uint8_t)length;
                const hg_status status = give(&r, &frame);
                if ((!ours) || ((flags & HG_CAN_EXTENDED) != 0U)) {
                    expected[0] += (status == HG_E_ID) ? 1U : 0U;
                } else if (((flags & (HG_CAN_REMOTE | HG_CAN_FD | HG_CAN_ERROR)) != 0U) || (length != fits)) {
                    expected[1] += (status == HG_E_FORMAT) ? 1U : 0U;
                } else {
                    expected[2] += (status == HG_E_CRC) ? 1U : 0U;
                }
            }
        }
    }
    assert_count((2048U * 32U * 256U) - (2U * 16U * 256U), expected[0]);
    assert_count(expected[0], r.node.unknown);
    assert_count(2U * ((16U * 256U) - 2U), expected[1]);
    assert_count(2U * 2U, expected[2]); /* with the bit-rate switch, which is not looked at, and without */
    for (uint8_t g = 0U; g < SM_GROUPS; g++) {
        const hg_link_health h = health(g);
        assert_count((16U * 256U) - 2U, h.format);
        assert_count(2U, h.crc);
        assert_count((16U * 256U), sum(&h));
    }
    assert_count(0U, steps(&r));
    heals_and_finds(&r);
}

static void no_twin_of_29_bits_is_taken(void **state)
{
    (void)state;
    warm(&kinds[0], 20U, 2U);
    uint32_t random = seed_of_run(3U);
    const uint32_t ids[] = {r.message[M].id, r.message[C].id, rig_verdict.id, rig_status.id};
    for (size_t i = 0U; i < COUNT(ids); i++) {
        hg_can_frame frame = (i < SM_GROUPS) ? r.frame[i] : (hg_can_frame){.length = 8U};
        frame.flags = HG_CAN_EXTENDED;
        for (uint32_t n = 0U; n < (1UL << 18U); n++) {
            frame.id = ids[i] | (n << 11U);
            assert_status(HG_E_ID, give(&r, &frame));
            frame.id = (ids[i] << 18U) | n;
            assert_status(HG_E_ID, give(&r, &frame));
            frame.id = draw(&random) & HG_CAN_ID_EXTENDED;
            assert_status(HG_E_ID, give(&r, &frame));
        }
    }
    assert_count(4UL * 3UL * (1UL << 18U), r.node.unknown);
    run(&r, 1U);
    assert_int_equal(5, r.verdict.bus); /* none of it is a loss */
    heals_and_finds(&r);
}

static void its_own_verdicts_come_back_as_strangers(void **state)
{
    (void)state;
    warm(&kinds[0], 20U, 4U);
    hg_can_frame frame[2];
    assert_int_equal(2, hg_node_report(&r.node, &r.verdict, true, frame));
    for (uint32_t i = 0U; i < 2U; i++) {
        assert_status(HG_E_ID, give(&r, &frame[i]));
        assert_count(i + 1U, r.node.unknown);
    }
    run(&r, 1U);
    assert_int_equal(5, r.verdict.bus);
    heals_and_finds(&r);
}

/* A remote request, an FD twin, an error report or another length under a group's identifier: refused, and the group counts as lossy. */
static void a_twin_of_another_kind_marks_the_group_and_no_more(void **state)
{
    (void)state;
    const uint8_t flags[] = {HG_CAN_REMOTE, HG_CAN_FD, HG_CAN_FD | HG_CAN_BRS, HG_CAN_ERROR};
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint8_t g = 0U; g < SM_GROUPS; g++) {
            warm(&kinds[l], 20U, 5U);
            for (uint32_t i = 0U; i < (COUNT(flags) + 256U); i++) {
                emit(&r);
                hg_can_frame twin = r.frame[g];
                twin.flags = (i < COUNT(flags)) ? flags[i] : 0U;
                twin.length = (i < COUNT(flags)) ? twin.length : (uint8_t)(i - COUNT(flags));
                if ((twin.length == r.message[g].length) && (twin.flags == 0U)) {
                    twin.length++;
                }
                const hg_link_health before = health(g);
                assert_status(HG_E_FORMAT, give(&r, &twin));
                assert_rises(g, format, 1U, before);
                deliver(&r);
                assert_int_equal((r.sent[g] || (g == C)) ? (int)HG_BUS_LOSSY : (int)bus(&r, g), bus(&r, g));
            }
            assert_int_equal(HG_E2E_VALID, r.link[g].machine.state); /* it says nothing of the frames that the sender sends */
            heals_and_finds(&r);
        }
    }
}

/* ---- damaged ---- */

static void every_damaged_bit_is_a_loss(void **state)
{
    (void)state;
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint8_t g = 0U; g < SM_GROUPS; g++) {
            warm(&kinds[l], WARM, 6U);
            const hg_link_health before = health(g);
            uint32_t damaged = 0U;
            uint32_t sent = 0U;
            while (damaged < (8U * (uint32_t)r.message[g].length)) {
                emit(&r);
                sent += r.sent[g] ? 1U : 0U;
                const bool now = r.sent[g] && ((sent % 4U) == 0U); /* 2 of 8 are not too many */
                if (now) {
                    r.frame[g].data[damaged / 8U] ^= (uint8_t)(1U << (damaged % 8U));
                    damaged++;
                }
                const uint16_t crc = health(g).crc;
                deliver(&r);
                assert_count(crc + (now ? 1U : 0U), health(g).crc);
                if (now && (g == C)) {
                    hg_node_overdue(&r.node);
                    (void)steps(&r);
                }
                assert_true((!now) || (bus(&r, g) != HG_BUS_GOOD));
            }
            assert_count(damaged, health(g).crc - before.crc);
            assert_count(0U, health(g).untrusted);
            heals_and_finds(&r);
        }
    }
}

static void a_link_with_too_many_damaged_frames_is_not_trusted_for_a_while(void **state)
{
    (void)state;
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint8_t g = 0U; g < SM_GROUPS; g++) {
            warm(&kinds[l], WARM, 7U);
            hg_can_frame bad = r.frame[g];
            bad.data[0] ^= 1U;
            for (uint32_t i = 0U; i < 8U; i++) {
                assert_status(HG_E_CRC, give(&r, &bad));
            }
            assert_int_equal(HG_E2E_INVALID, r.link[g].machine.state);
            until_it_speaks();
            const hg_link_health before = health(g);
            const uint32_t k = r.node.k;
            assert_status((g == M) ? HG_E_STATE : HG_OK, give(&r, &r.frame[M]));
            assert_status((g == C) ? HG_E_STATE : HG_OK, give(&r, &r.frame[C]));
            assert_rises(g, untrusted, 1U, before);
            assert_count(1U, steps(&r));
            assert_count(k + 1U, r.node.k); /* the time goes on */
            assert_int_equal(HG_BUS_LOSSY, bus(&r, g));
            assert_true(r.node.detector.radius[(g == M) ? 0 : 2] >= SM_SLEW(1));
            heals_and_finds(&r);
        }
    }
}

/* ---- doubled, reordered, replayed ---- */

typedef struct {
    hg_verdict verdict;
    hg_real    value[SM_SIGNALS];
    hg_real    radius[SM_SIGNALS];
} seen;

static seen look(void)
{
    seen s;
    (void)memset(&s, 0, sizeof(s));
    s.verdict = r.verdict;
    (void)memcpy(s.value, r.node.detector.value, sizeof(s.value));
    (void)memcpy(s.radius, r.node.detector.radius, sizeof(s.radius));
    return s;
}

static void doubles_change_nothing(void **state)
{
    (void)state;
    static seen clean[WARM];
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint32_t copies = 0U; copies <= 40U; copies += (copies < 3U) ? 1U : 37U) {
            uint32_t doubles[SM_GROUPS] = {0U, 0U};
            begin(&r, &kinds[l], HG_START_REST, 8U);
            for (uint32_t k = 0U; k < WARM; k++) {
                hg_can_frame last[SM_GROUPS] = {r.frame[M], r.frame[C]};
                emit(&r);
                for (uint8_t g = 0U; g < SM_GROUPS; g++) {
                    for (uint32_t i = 0U; (k > 0U) && (i < copies); i++) { /* of the sample before, ahead of this one's */
                        assert_status(HG_E_REPEATED, give(&r, &last[g]));
                        doubles[g]++;
                    }
                    for (uint32_t i = 0U; r.sent[g] && (i <= copies); i++) {
                        const hg_status again = (g == C) ? HG_E_BUSY : HG_E_REPEATED; /* while steps are due nothing is looked at */
                        assert_status((i == 0U) ? HG_OK : again, give(&r, &r.frame[g]));
                        doubles[g] += ((g == M) && (i > 0U)) ? 1U : 0U;
                    }
                    r.frame[g] = r.sent[g] ? r.frame[g] : last[g];
                }
                assert_count(1U, steps(&r));
                const seen now = look();
                if (copies == 0U) {
                    clean[k] = now;
                }
                assert_memory_equal(&clean[k], &now, sizeof(now));
            }
            for (uint8_t g = 0U; g < SM_GROUPS; g++) {
                const hg_link_health h = health(g);
                assert_count(doubles[g], h.repeated);
                assert_count(doubles[g] + h.good, sum(&h));
            }
            heals_and_finds(&r);
        }
    }
}

/* The order number `n` of `count` things. */
static void permute(uint32_t n, uint8_t count, uint8_t *order)
{
    uint32_t left = n;
    for (uint8_t i = 0U; i < count; i++) {
        order[i] = i;
    }
    for (uint8_t i = 0U; i < count; i++) {
        const uint8_t pick = (uint8_t)(i + (left % ((uint32_t)count - i)));
        const uint8_t moved = order[pick];
        left /= (uint32_t)count - i;
        order[pick] = order[i];
        order[i] = moved;
    }
}

/* Without a stamp a frame is of the sample that is open: its delay is the design's to allow for, and none is tested here. */
static void any_order_of_three_samples_is_no_plant_fault(void **state)
{
    (void)state;
    for (size_t l = 0U; l < STAMPED; l++) {
        for (uint32_t start = 0U; start < 6U; start++) {
            hg_can_frame waiting[6];
            uint8_t count = 0U;
            warm(&kinds[l], WARM + start, 9U);
            for (uint32_t k = 0U; k < 3U; k++) {
                emit(&r);
                for (uint8_t g = 0U; g < SM_GROUPS; g++) {
                    waiting[count] = r.frame[g];
                    count = (uint8_t)(count + (r.sent[g] ? 1U : 0U));
                }
            }
            save(&kept, &r);
            uint32_t orders = 1U;
            for (uint32_t i = 2U; i <= count; i++) {
                orders *= i;
            }
            for (uint32_t n = 0U; n < orders; n++) {
                uint8_t order[6];
                permute(n, count, order);
                restore(&r, &kept);
                for (uint8_t i = 0U; i < count; i++) {
                    assert_true(give(&r, &waiting[order[i]]) != HG_E_CRC);
                    (void)steps(&r);
                }
                heals_and_finds(&r);
            }
        }
    }
}

/* What a node must make of an old measurement. `behind`: samples that the open one is ahead of the last good frame. */
static hg_status replayed(uint8_t g, const hg_can_frame *old, uint32_t age, uint32_t behind)
{
    hg_e2e_header header = {.stamp = 0U};
    assert_status(HG_OK, hg_e2e_check(&r.rule[g], old->data, old->length, &header));
    const hg_link *link = &r.link[g];
    const bool stamped = r.rule[g].stamp != HG_E2E_NO_STAMP;
    uint32_t moved = ((header.counter + modulus(&r, g)) - link->receiver.counter) % modulus(&r, g);
    if ((moved == 0U) && (header.crc == link->receiver.crc) && (header.stamp == link->receiver.stamp)) {
        return HG_E_REPEATED;
    }
    moved = (moved == 0U) ? modulus(&r, g) : moved;
    if (stamped && ((age % 16U) != 0U)) {
        return HG_E_STAMP;
    }
    if (moved > (behind + (stamped ? 0U : 1U))) {
        return HG_E_SEQUENCE;
    }
    return r.storage.hold[g].fresh ? HG_E_REPEATED : HG_OK; /* the sample has one */
}

/* An old measurement is either refused, or, for all that can be seen, the sender's next: its stamp is the open sample's, 16 samples or a multiple
 * later, and its counter has moved by no more frames than the sender can have sent since the last good one. */
static void an_old_measurement_is_refused_unless_it_could_be_the_next(void **state)
{
    (void)state;
    uint32_t taken[COUNT(kinds)] = {0U};
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint32_t phase = 0U; phase < 17U; phase++) {
            warm(&kinds[l], WARM + phase, 10U);
            emit(&r);
            save(&kept, &r);
            for (uint32_t i = 0U; i < (2U * OLDEST); i++) {
                const uint32_t age = 1U + (i / 2U);
                const uint32_t k = WARM + phase; /* open */
                if (!there[M][k - age]) {
                    continue;
                }
                restore(&r, &kept);
                if (((i % 2U) != 0U) && r.sent[M]) { /* after the genuine one; else before it */
                    assert_status(HG_OK, give(&r, &r.frame[M]));
                    r.sent[M] = false;
                }
                const hg_link_health before = health(M);
                const hg_status expected = replayed(M, &past[M][k - age], age, k - r.link[M].k);
                assert_status(expected, give(&r, &past[M][k - age]));
                if (expected == HG_OK) {
                    assert_true(((age % 16U) == 0U) || (!kinds[l].stamped[M]));
                    taken[l]++;
                    continue;
                }
                const hg_link_health now = health(M);
                assert_count(before.repeated + ((expected == HG_E_REPEATED) ? 1U : 0U), now.repeated);
                assert_count(before.sequence + ((expected == HG_E_SEQUENCE) ? 1U : 0U), now.sequence);
                assert_count(before.early + before.late + ((expected == HG_E_STAMP) ? 1U : 0U), now.early + now.late);
                deliver(&r);
                heals_and_finds(&r);
            }
        }
        assert_true((kinds[l].profile != HG_E2E_P05) || (taken[l] == 0U)); /* a counter of 8 bits goes round in 256 frames */
    }
    assert_true(taken[3] > 0U); /* a counter of 4 bits does, and then nothing can tell */
}

/* Of closing frames the counter and the sample move alike. Where both go round in 16 (profiles 02, 22) an old one can look as if it were up to 7
 * ahead, and only a clock can tell (hg_node_expect); with 15 or 256 they come back together after 240 or 256 samples. */
static void an_old_closing_frame_is_refused_unless_it_could_be_the_next(void **state)
{
    (void)state;
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint32_t phase = 0U; phase < 17U; phase++) {
            warm(&kinds[l], WARM + phase, 11U);
            emit(&r);
            save(&kept, &r);
            for (uint32_t i = 0U; i < (OLDEST * (AHEAD_MAX + 1U)); i++) {
                const uint32_t age = 1U + (i / (AHEAD_MAX + 1U));
                const uint32_t most = i % (AHEAD_MAX + 1U);
                const uint32_t turn = kinds[l].stamped[C] ? 16U : modulus(&r, C);
                const uint32_t ahead = (turn - (age % turn)) % turn;
                const bool in_step = ((ahead + age) % modulus(&r, C)) == 0U;
                const hg_can_frame *old = &past[C][WARM + phase - age];
                restore(&r, &kept);
                hg_node_expect(&r.node, most);
                if (r.sent[M]) {
                    assert_status(HG_OK, give(&r, &r.frame[M]));
                }
                r.sent[M] = false;
                const hg_link_health before = health(C);
                if (replayed(C, old, age, 0U) == HG_E_REPEATED) { /* the last one, or the same bytes */
                    assert_status(HG_E_REPEATED, give(&r, old));
                    assert_rises(C, repeated, 1U, before);
                } else if ((ahead <= most) && in_step) {
                    assert_status(HG_OK, give(&r, old));
                    assert_true((modulus(&r, C) == 16U) || (!kinds[l].stamped[C]));
                    continue;
                } else if (ahead > AHEAD_MAX) {
                    assert_status(HG_E_STAMP, give(&r, old));
                    assert_rises(C, late, 1U, before);
                } else if (ahead > most) {
                    assert_status(HG_E_STAMP, give(&r, old));
                    assert_rises(C, early, 1U, before);
                } else {
                    assert_status(HG_E_SEQUENCE, give(&r, old));
                    assert_rises(C, sequence, 1U, before);
                }
                deliver(&r);
                assert_int_equal(HG_PLANT_NONE, r.verdict.plant);
                heals_and_finds(&r);
            }
        }
    }
}

/* ---- of another sample ---- */

static void a_stamp_of_another_sample_is_never_booked(void **state)
{
    (void)state;
    for (size_t l = 0U; l < STAMPED; l++) {
        for (uint32_t d = 1U; d < 16U; d++) {
            for (uint8_t g = 0U; g < SM_GROUPS; g++) {
                warm(&kinds[l], WARM, 12U);
                until_it_speaks();
                hg_can_frame wrong = r.frame[g];
                protect(&r, g, &wrong, counter_of(&r, g, &wrong), r.k - 1U + d);
                const hg_link_health before = health(g);
                const bool out_of_step = (g == C) && (d <= AHEAD_MAX); /* its counter has moved by one, its sample by more */
                assert_status(out_of_step ? HG_E_SEQUENCE : HG_E_STAMP, give(&r, &wrong));
                if (out_of_step) {
                    assert_rises(C, sequence, 1U, before);
                } else if (d <= AHEAD_MAX) {
                    assert_rises(g, early, 1U, before);
                } else {
                    assert_rises(g, late, 1U, before);
                }
                assert_status((g == M) ? HG_OK : HG_E_EMPTY, (g == M) ? give(&r, &r.frame[C]) : HG_E_EMPTY);
                (void)steps(&r);
                assert_true((g == C) || (bus(&r, M) == HG_BUS_LOSSY));
                heals_and_finds(&r);
            }
        }
    }
}

/* ---- numbers ---- */

static void every_code_out_of_range_is_refused(void **state)
{
    (void)state;
    for (size_t l = 0U; l < STAMPED; l++) {
        for (uint32_t field = 0U; field < 3U; field++) {
            const uint8_t g = (uint8_t)((field < 2U) ? M : C);
            const uint8_t place = (field == 1U) ? 6U : 4U;
            warm(&kinds[l], WARM, 13U);
            until_it_speaks();
            save(&kept, &r);
            for (uint32_t pattern = 0U; pattern <= 0xFFFFU; pattern++) {
                restore(&r, &kept);
                hg_can_frame frame = r.frame[g];
                frame.data[place] = (uint8_t)(pattern & 0xFFU);
                frame.data[place + 1U] = (uint8_t)(pattern >> 8U);
                protect(&r, g, &frame, counter_of(&r, g, &frame), r.k - 1U);
                const bool none = pattern == 0x8000U;
                const bool good = none || (pattern <= (uint32_t)SM_LIMIT) || (pattern >= (0x10000U - (uint32_t)SM_LIMIT));
                assert_status(good ? HG_OK : HG_E_NUMERIC, give(&r, &frame));
                assert_count(good ? 0U : 1U, health(g).numeric);
                assert_count(none ? 1U : 0U, health(g).invalid);
                assert_count((g == C) ? 1U : 0U, r.node.due);
                if ((!good) && ((pattern % 97U) == 0U)) {
                    r.sent[g] = false;
                    deliver(&r);
                    assert_true(r.verdict.refused);
                    assert_int_equal(HG_BUS_LOSSY, bus(&r, g));
                    heals_and_finds(&r);
                }
            }
        }
    }
}

/* The same of a float32 field: every NaN but the one that stands for no value, infinity, and what lies beyond the range. */
static void no_float_that_is_no_number_of_the_range_comes_in(void **state)
{
    (void)state;
    static const hg_field field = {32U, 32U, HG_FIELD_FLOAT32};
    static const uint32_t patterns[] = {0x7FC00001U, 0xFFC00000U, 0x7F800001U, 0x7FBFFFFFU, 0x7FFFFFFFU, 0xFFFFFFFFU, 0xFF800001U, /* NaN */
                                        0x7F800000U, 0xFF800000U, 0x7F7FFFFFU, 0xFF7FFFFFU, 0x42BC0000U, 0xC2BC0000U, 0x4B000000U};
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        begin(&r, &kinds[l], HG_START_MOVING, 14U);
        r.message[C].field = &field;
        r.message[C].length = 8U;
        run(&r, 30U);
        for (size_t i = 0U; i < (COUNT(patterns) + 1U); i++) {
            const bool none = i == COUNT(patterns);
            const uint32_t pattern = none ? 0x7FC00000U : patterns[i];
            emit(&r);
            for (uint32_t b = 0U; b < 4U; b++) {
                r.frame[C].data[4U + b] = (uint8_t)((pattern >> (8U * b)) & 0xFFU);
            }
            protect(&r, C, &r.frame[C], counter_of(&r, C, &r.frame[C]), r.k - 1U);
            const uint16_t numeric = health(C).numeric;
            assert_status(none ? HG_OK : HG_E_NUMERIC, give(&r, &r.frame[C]));
            assert_count(numeric + (none ? 0U : 1U), health(C).numeric);
            assert_count(none ? 1U : 0U, health(C).invalid);
            assert_count(1U, steps(&r)); /* its numbers are lost; the time is told */
            for (uint32_t s = 0U; s < SM_SIGNALS; s++) {
                assert_true(isfinite((double)r.node.detector.value[s]) && isfinite((double)r.node.detector.radius[s]));
            }
            run(&r, 3U);
        }
        heals_and_finds(&r);
    }
}

/* ---- floods ---- */

typedef enum { FOREIGN, DOUBLED, DAMAGED, TWIN, OLD, NOISE, FLOODS } flood;

static void babble(flood what, uint8_t g, uint32_t *random)
{
    hg_can_frame frame = r.sent[g] ? r.frame[g] : past[g][0];
    const uint8_t first = frame.data[0];
    for (uint32_t i = 0U; i < FLOOD; i++) {
        if (what == FOREIGN) {
            frame.id = ((i % 2U) != 0U) ? 0U : 0x7FFU;
        } else if (what == DAMAGED) {
            frame.data[0] = (uint8_t)(first ^ (1U + (i % 255U)));
        } else if (what == TWIN) {
            frame.flags = HG_CAN_REMOTE;
        } else if (what == OLD) { /* more than 7 and less than 16 samples: late by any clock */
            frame = past[g][WARM - 1U - (i % 8U)];
            if (!there[g][WARM - 1U - (i % 8U)]) {
                continue;
            }
        } else if (what == NOISE) {
            for (uint8_t b = 0U; b < frame.length; b++) {
                frame.data[b] = (uint8_t)(draw(random) & 0xFFU);
            }
        } else {
            /* the same one over and over */
        }
        (void)give(&r, &frame);
        if (r.node.due > 0U) {
            (void)steps(&r);
        }
    }
}

/* Beyond all measure between two samples, and then through ten samples: the node steps on, no alarm is raised by it, and it heals. Noise under an own
 * identifier passes a checksum of 8 bits once in 256: stamps and the state of the link keep it out. */
static void a_flood_neither_stops_the_node_nor_accuses_the_plant(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(15U);
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint32_t what = 0U; what < (uint32_t)FLOODS; what++) {
            for (uint8_t g = 0U; g < SM_GROUPS; g++) {
                const bool needs_stamps = ((flood)what == NOISE) || ((flood)what == OLD);
                if ((needs_stamps && (!kinds[l].stamped[M])) || ((l >= STAMPED) && (what != (uint32_t)DAMAGED))) {
                    continue;
                }
                warm(&kinds[l], WARM, 15U + (uint32_t)l);
                emit(&r);
                if (r.sent[M]) {
                    assert_status(HG_OK, give(&r, &r.frame[M]));
                }
                hg_node_expect(&r.node, 0U);
                const uint32_t unknown = r.node.unknown;
                const hg_link_health before = health(g);
                babble((flood)what, g, &random);
                const hg_link_health now = health(g);
                assert_count(unknown + ((what == (uint32_t)FOREIGN) ? FLOOD : 0U), r.node.unknown);
                assert_count((what == (uint32_t)DAMAGED) ? UINT16_MAX : before.crc, (what == (uint32_t)NOISE) ? before.crc : now.crc);
                assert_count((what == (uint32_t)TWIN) ? UINT16_MAX : before.format, now.format);
                (void)give(&r, &r.frame[C]);
                (void)steps(&r);
                run_by_the_clock(40U);
                hg_node_expect(&r.node, AHEAD_MAX);
                heals_and_finds(&r);
            }
        }
    }
}

/* ---- senders ---- */

/* Its counter begins at 0, whatever it was. After the silence that node.h asks for it may even continue the old one; without it, that is the one case
 * in 16, 15 or 256 in which receivers cannot know that another promise holds now. */
static void a_measurement_sender_that_begins_anew_is_no_plant_fault(void **state)
{
    (void)state;
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        uint32_t refused = 0U;
        for (uint32_t when = 0U; when < 64U; when++) {
            for (uint32_t away = 0U; away < 8U; away++) {
                if ((away > 0U) && (away < sm_trigger_a.interval_max)) {
                    continue;
                }
                warm(&kinds[l], WARM + when, 20U + when);
                for (uint32_t k = 0U; k < away; k++) {
                    emit(&r);
                    r.sent[M] = false;
                    deliver(&r);
                }
                plant_sender(&r.plant, M);
                if ((away == 0U) && (((r.link[M].receiver.counter + 1U) % modulus(&r, M)) == 0U)) {
                    continue;
                }
                const uint16_t sequence = health(M).sequence;
                run(&r, 1U);
                refused += (uint32_t)health(M).sequence - sequence;
                assert_true(health(M).sequence <= (sequence + 1U)); /* once: the next is compared with it */
                run(&r, 20U);
                assert_true(health(M).sequence <= (sequence + 1U));
                heals_and_finds(&r);
            }
        }
        assert_true(refused > 64U);
    }
}

/* Two old closing frames running, in their order, within a sample: with a clock that closed none in between they are no sender that began anew. */
static void two_old_closing_frames_do_not_deceive_a_clock(void **state)
{
    (void)state;
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint32_t age = 2U; age <= OLDEST; age++) {
            warm(&kinds[l], WARM, 41U);
            run_by_the_clock(1U);
            emit(&r);
            if (r.sent[M]) {
                assert_status(HG_OK, give(&r, &r.frame[M]));
                r.sent[M] = false;
            }
            const uint32_t turn = (modulus(&r, C) == 16U) ? 16U : 256U;
            for (uint32_t i = 0U; (i < 6U) && (age >= (i + 2U)); i++) { /* the last of them is 2 samples old */
                if (((age - i) % turn == 0U) || ((!kinds[l].stamped[C]) && (((age - i) % modulus(&r, C)) == 0U))) {
                    break; /* the next one's, for all that can be seen */
                }
                const hg_status status = give(&r, &past[C][WARM + 1U - (age - i)]);
                assert_true((status == HG_E_STAMP) || (status == HG_E_SEQUENCE) || (status == HG_E_REPEATED));
                assert_count(0U, r.node.due);
            }
            deliver(&r);
            assert_int_equal(HG_PLANT_NONE, r.verdict.plant);
            hg_node_expect(&r.node, AHEAD_MAX);
            heals_and_finds(&r);
        }
    }
}

/* Every counter against every sample modulo 16. Of two closing frames one is accepted; what does not fit begins the detector anew. Without a stamp this
 * takes a clock, which lets none be ahead and closes in time what has not been closed. */
static void a_closing_sender_that_begins_anew_restarts_the_detector(void **state)
{
    (void)state;
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint32_t phase = 0U; phase < 16U; phase++) {
            warm(&kinds[l], WARM + phase, 40U + phase);
            save(&kept, &r);
            for (uint32_t jump = 0U; jump < modulus(&r, C); jump++) {
                restore(&r, &kept);
                r.plant.sender[C].counter = (uint8_t)((r.plant.sender[C].counter + jump) % modulus(&r, C));
                const hg_link_health before = health(C);
                if (!kinds[l].stamped[C]) {
                    hg_node_expect(&r.node, 0U);
                }
                emit(&r);
                if (r.sent[M]) {
                    assert_status(HG_OK, give(&r, &r.frame[M]));
                }
                const hg_status status = give(&r, &r.frame[C]);
                if (jump == 0U) {
                    assert_status(HG_OK, status);
                } else if (kinds[l].stamped[C]) {
                    assert_status(HG_E_SEQUENCE, status);
                    assert_rises(C, sequence, 1U, before);
                } else { /* the one before once more, too soon, or too late */
                    assert_true((status == HG_E_STAMP) || (status == HG_E_REPEATED));
                }
                if ((jump > 0U) && (!kinds[l].stamped[C])) {
                    hg_node_overdue(&r.node);
                }
                (void)steps(&r);
                if (kinds[l].stamped[C]) {
                    run(&r, 1U);
                    assert_int_equal((jump == 0U) ? HG_PLANT_NONE : HG_PLANT_STARTING, r.verdict.plant);
                } else {
                    run_by_the_clock(4U);
                    hg_node_expect(&r.node, AHEAD_MAX);
                }
                heals_and_finds(&r);
            }
        }
    }
}

/* A second sender of one identifier, every offset of its counter. Its frames do not fit the sequence, nor do the genuine ones after them: the group
 * is lossy and its radii are those of the slew. */
static void two_senders_of_one_identifier_contradict_each_other(void **state)
{
    (void)state;
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint32_t offset = 1U; offset < 16U; offset++) {
            for (uint32_t phase = 0U; phase < 16U; phase++) {
                if (offset == modulus(&r, M)) {
                    continue;
                }
                warm(&kinds[l], WARM + phase, 60U);
                const hg_link_health before = health(M);
                uint32_t sent = 0U;
                for (uint32_t k = 0U; k < 40U; k++) {
                    emit(&r);
                    if (r.sent[M]) {
                        hg_can_frame second = r.frame[M];
                        protect(&r, M, &second, counter_of(&r, M, &second) + offset, r.k - 1U);
                        (void)give(&r, (k % 2U == 0U) ? &second : &r.frame[M]);
                        (void)give(&r, (k % 2U == 0U) ? &r.frame[M] : &second);
                        sent++;
                    }
                    assert_status(HG_OK, give(&r, &r.frame[C]));
                    (void)steps(&r);
                }
                const hg_link_health now = health(M);
                assert_true(((uint32_t)now.sequence - before.sequence) + ((uint32_t)now.repeated - before.repeated) >= sent); /* one of two at least */
                heals_and_finds(&r);
            }
        }
    }
}

/* The same with other values, under a rule that wants one more frame in sequence after a jump (resync): none of the two is believed. */
static void with_resync_a_second_sender_is_not_believed(void **state)
{
    (void)state;
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint32_t offset = 2U; offset < (modulus(&r, M) - 1U); offset++) {
            warm(&kinds[l], WARM, 61U);
            r.rule[M].resync = 2U;
            uint32_t believed = 0U;
            for (uint32_t k = 0U; k < 60U; k++) {
                emit(&r);
                if (r.sent[M]) {
                    hg_can_frame second = r.frame[M];
                    second.data[4] ^= 0x40U;
                    protect(&r, M, &second, counter_of(&r, M, &second) + offset, r.k - 1U);
                    believed += (give(&r, &r.frame[M]) == HG_OK) ? 1U : 0U;
                    const hg_status status = give(&r, &second);
                    assert_true(status != HG_OK);
                }
                assert_status(HG_OK, give(&r, &r.frame[C]));
                (void)steps(&r);
            }
            assert_count(1U, believed); /* the first, before there were two */
            heals_and_finds(&r);
        }
    }
}

/* ---- the clock ---- */

static void lose_ticks(uint32_t count, bool deadline)
{
    for (uint32_t k = 0U; k < count; k++) {
        emit(&r);
        r.sent[C] = false;
        deliver(&r);
        if (deadline) {
            hg_node_overdue(&r.node);
            assert_count(1U, steps(&r));
        }
    }
}

static void lost_ticks_are_told_by_the_next_or_by_the_clock(void **state)
{
    (void)state;
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint32_t lost = 1U; lost <= 20U; lost++) {
            for (uint32_t phase = 0U; phase < 16U; phase++) {
                const bool stamps = kinds[l].stamped[M];
                /* with a deadline for each */
                warm(&kinds[l], WARM + phase, 70U + phase);
                save(&kept, &r);
                const uint32_t overdue = r.node.overdue;
                const uint32_t missed = health(C).lost;
                lose_ticks(lost, true);
                assert_count(overdue + lost, r.node.overdue);
                run(&r, 1U);
                if (((lost + 1U) % hg_e2e_modulus(r.node.config->message[C].e2e)) != 0U) { /* else it may be the last one once more */
                    assert_count(missed + lost, health(C).lost);
                }
                assert_true(r.verdict.plant == HG_PLANT_NONE || r.verdict.plant == HG_PLANT_PROVISIONAL);
                heals_and_finds(&r);
                /* told as an outage */
                restore(&r, &kept);
                lose_ticks(lost, false);
                hg_node_outage(&r.node);
                run(&r, 1U);
                assert_int_equal(HG_PLANT_STARTING, r.verdict.plant);
                assert_count(overdue, r.node.overdue);
                heals_and_finds(&r);
                /* without a clock: up to 7 are steps, or a new beginning where a frame without a stamp is of nobody knows which sample */
                restore(&r, &kept);
                lose_ticks(lost, false);
                const bool turns = (kinds[l].profile == HG_E2E_P22) || (!kinds[l].stamped[C]);
                if (turns && (lost >= 13U)) {
                    continue; /* "read as fewer or as none": node.h */
                }
                const uint32_t before = r.node.overdue;
                run(&r, 1U);
                if ((lost <= AHEAD_MAX) && stamps) {
                    assert_count(before + lost, r.node.overdue);
                    assert_true(r.verdict.plant != HG_PLANT_STARTING);
                }
                run(&r, 1U);
                assert_true((lost <= AHEAD_MAX) || (r.verdict.plant == HG_PLANT_STARTING));
                heals_and_finds(&r);
            }
        }
    }
}

/* Frames that waited come at once: each closes its sample, and doubles of them close nothing. */
static void a_burst_of_ticks_makes_up_for_what_was_late(void **state)
{
    (void)state;
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint32_t count = 1U; count <= 40U; count++) {
            for (uint32_t doubled = 0U; doubled < 4U; doubled++) {
                warm(&kinds[l], WARM, 80U + count);
                const uint32_t k = r.node.k;
                for (uint32_t i = 0U; i < count; i++) {
                    hg_node_expect(&r.node, ((doubled & 2U) != 0U) ? 0U : AHEAD_MAX);
                    emit(&r);
                    deliver(&r);
                    const hg_link_health before = health(C);
                    for (uint32_t n = 0U; n < (8U * (doubled & 1U)); n++) {
                        assert_status(HG_E_REPEATED, give(&r, &r.frame[C]));
                    }
                    assert_rises(C, repeated, 8U * (doubled & 1U), before);
                }
                assert_count(k + count, r.node.k);
                assert_int_equal(HG_PLANT_NONE, r.verdict.plant);
                heals_and_finds(&r);
            }
        }
    }
}

/* A measurement without a stamp came after a closing frame that did not: nobody knows of which sample it is. */
static void a_lost_tick_beside_a_frame_without_a_stamp_begins_anew(void **state)
{
    (void)state;
    for (size_t l = STAMPED; l < COUNT(kinds); l++) {
        warm(&kinds[l], WARM, 90U);
        until_it_speaks();
        const uint32_t k = r.k;
        assert_status(HG_OK, give(&r, &r.frame[M]));
        emit(&r); /* the closing frame before is lost */
        assert_status(HG_OK, give(&r, &r.frame[C]));
        assert_count(1U, steps(&r));
        assert_count(k, r.verdict.k);
        assert_int_equal(HG_PLANT_STARTING, r.verdict.plant);
        assert_int_equal(HG_BUS_ABSENT, bus(&r, M));
        heals_and_finds(&r);
    }
}

/* Two frames of neighbouring samples within one: the first is booked, the sender goes by the second. */
static void a_second_frame_without_a_stamp_counts_as_lost(void **state)
{
    (void)state;
    for (size_t l = STAMPED; l < COUNT(kinds); l++) {
        warm(&kinds[l], WARM, 91U);
        until_it_speaks();
        hg_can_frame second = r.frame[M];
        second.data[4] ^= 0x08U;
        protect(&r, M, &second, counter_of(&r, M, &second) + 1U, 0U);
        assert_status(HG_OK, give(&r, &r.frame[M]));
        const hg_link_health before = health(M);
        assert_status(HG_E_REPEATED, give(&r, &second));
        assert_rises(M, repeated, 1U, before);
        assert_status(HG_OK, give(&r, &r.frame[C]));
        (void)steps(&r);
        assert_int_equal(HG_BUS_LOSSY, bus(&r, M));
        r.plant.sender[M].counter = (uint8_t)((r.plant.sender[M].counter + 1U) % modulus(&r, M));
        heals_and_finds(&r);
    }
}

/* ---- what a counter and a checksum cannot tell ---- */

static void a_whole_turn_of_the_counter_proves_nothing(void **state)
{
    (void)state;
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        const uint32_t extra = kinds[l].stamped[M] ? 0U : 1U;
        for (uint32_t silent = modulus(&r, M) - 3U; silent <= (modulus(&r, M) + 1U); silent++) {
            warm(&kinds[l], WARM, 92U);
            until_it_speaks();
            deliver(&r);
            const uint8_t counter = r.plant.sender[M].counter;
            for (uint32_t k = 0U; k < silent; k++) {
                emit(&r);
                r.sent[M] = false;
                deliver(&r);
            }
            r.plant.sender[M].counter = counter; /* as if a whole turn had been lost, or nothing */
            plant_sender(&r.plant, M);
            r.plant.sender[M].counter = counter;
            r.link[M].machine.state = HG_E2E_VALID; /* as if no deadline had expired, and */
            r.link[M].machine.ok = 1U;
            r.storage.hold[M].lost = false;         /* as if the sender were allowed so long a silence */
            r.storage.hold[M].good = 1U;
            emit(&r);
            assert_status(HG_OK, give(&r, &r.frame[M]));
            assert_int_equal((silent + 1U + extra) > modulus(&r, M), r.storage.hold[M].recovering);
        }
    }
}

/* A sender that began anew, the counter where it was, and by chance the checksum too: the stamp tells it from a repetition. */
static void the_same_checksum_of_another_sample_is_no_repetition(void **state)
{
    (void)state;
    for (size_t l = 0U; l < STAMPED; l++) {
        warm(&kinds[l], WARM, 93U);
        until_it_speaks();
        const hg_can_frame first = r.frame[M];
        deliver(&r);
        hg_can_frame other = first;
        hg_e2e_header header[2] = {{.crc = 0U}, {.crc = 1U}};
        assert_status(HG_OK, hg_e2e_check(&r.rule[M], first.data, first.length, &header[0]));
        for (uint32_t n = 0U; (n <= 0xFFFFU) && (header[1].crc != header[0].crc); n++) {
            other.data[4] = (uint8_t)(n & 0xFFU);
            other.data[5] = (uint8_t)(n >> 8U);
            protect(&r, M, &other, counter_of(&r, M, &first), r.k);
            assert_status(HG_OK, hg_e2e_check(&r.rule[M], other.data, other.length, &header[1]));
        }
        assert_count(header[0].crc, header[1].crc);
        const hg_link_health before = health(M);
        assert_status(HG_E_SEQUENCE, give(&r, &other));
        assert_rises(M, sequence, 1U, before);
    }
}

/* ---- starts ---- */

static void a_detector_may_begin_in_any_sample_of_a_moving_plant(void **state)
{
    (void)state;
    for (size_t l = 0U; l < COUNT(kinds); l++) {
        for (uint32_t k = 0U; k < 200U; k++) {
            warm(&kinds[l], 10U + k, 94U);
            if ((k % 2U) == 0U) { /* in the middle of a sample: its measurement belongs to nobody yet */
                start_node(&r, HG_START_MOVING);
                emit(&r);
                assert_true((!r.sent[M]) || (give(&r, &r.frame[M]) == HG_E_STAMP));
                const hg_link_health h = health(M);
                assert_count(0U, sum(&h));
                assert_status(HG_OK, give(&r, &r.frame[C]));
                (void)steps(&r);
                assert_int_equal(HG_PLANT_STARTING, r.verdict.plant);
            }
            start_node(&r, HG_START_MOVING);
            r.confirmed = false;
            heals_and_finds(&r);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_id_kind_and_length_has_its_status),
        cmocka_unit_test(no_twin_of_29_bits_is_taken),
        cmocka_unit_test(its_own_verdicts_come_back_as_strangers),
        cmocka_unit_test(a_twin_of_another_kind_marks_the_group_and_no_more),
        cmocka_unit_test(every_damaged_bit_is_a_loss),
        cmocka_unit_test(a_link_with_too_many_damaged_frames_is_not_trusted_for_a_while),
        cmocka_unit_test(doubles_change_nothing),
        cmocka_unit_test(any_order_of_three_samples_is_no_plant_fault),
        cmocka_unit_test(an_old_measurement_is_refused_unless_it_could_be_the_next),
        cmocka_unit_test(an_old_closing_frame_is_refused_unless_it_could_be_the_next),
        cmocka_unit_test(a_stamp_of_another_sample_is_never_booked),
        cmocka_unit_test(every_code_out_of_range_is_refused),
        cmocka_unit_test(no_float_that_is_no_number_of_the_range_comes_in),
        cmocka_unit_test(a_flood_neither_stops_the_node_nor_accuses_the_plant),
        cmocka_unit_test(a_measurement_sender_that_begins_anew_is_no_plant_fault),
        cmocka_unit_test(two_old_closing_frames_do_not_deceive_a_clock),
        cmocka_unit_test(a_closing_sender_that_begins_anew_restarts_the_detector),
        cmocka_unit_test(two_senders_of_one_identifier_contradict_each_other),
        cmocka_unit_test(with_resync_a_second_sender_is_not_believed),
        cmocka_unit_test(lost_ticks_are_told_by_the_next_or_by_the_clock),
        cmocka_unit_test(a_burst_of_ticks_makes_up_for_what_was_late),
        cmocka_unit_test(a_lost_tick_beside_a_frame_without_a_stamp_begins_anew),
        cmocka_unit_test(a_second_frame_without_a_stamp_counts_as_lost),
        cmocka_unit_test(a_whole_turn_of_the_counter_proves_nothing),
        cmocka_unit_test(the_same_checksum_of_another_sample_is_no_repetition),
        cmocka_unit_test(a_detector_may_begin_in_any_sample_of_a_moving_plant),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
