/** @file
 *  A library for the sizes of the platoon with banks alone (config.h: HG_ONLY_..): it runs that model, and refuses tables of any other size. Built for this alone. */
#include "support.h"

#include "hullguard/node.h"

#include "platoon_bank.h"

#if (HG_ONLY_GROUPS == 0U) || (HG_ONLY_IN_ORDER == 0U)
#error "this test is for a library that serves the sizes of one model"
#endif

static hg_platoon_bank_node node;

static hg_status start_of(const hg_detector_config *config)
{
    hg_detector self;
    const hg_detector_memory memory = {.hold = node.hold, .residual = node.residual, .hull = node.hull, .bank = node.bank, .alarm = node.alarm,
                                       .code = node.code, .codes = COUNT(node.code), .real = node.real, .reals = COUNT(node.real),
                                       .sum = node.sum, .sums = COUNT(node.sum)};
    return hg_detector_start(&self, config, &memory, HG_START_REST);
}

/* The model's tables, to be changed. */
typedef struct {
    hg_detector_config detector;
    hg_hold_config     hold[HG_PLATOON_BANK_GROUPS];
    hg_trigger_config  trigger;
    hg_residual_config residual;
    hg_hull_config     hull;
    uint8_t            order[HG_PLATOON_BANK_SIGNALS];
} tables;

static void begin(tables *t)
{
    t->detector = *hg_platoon_bank_config.detector;
    (void)memcpy(t->hold, t->detector.hold, sizeof(t->hold));
    t->trigger = *t->hold[0].trigger;
    t->residual = t->detector.residual[0];
    t->hull = t->detector.hull[0];
    t->hold[0].trigger = &t->trigger;
    t->detector.hold = t->hold;
    t->detector.residual = &t->residual;
    t->detector.hull = &t->hull;
    for (uint8_t i = 0U; i < HG_PLATOON_BANK_SIGNALS; i++) {
        t->order[i] = i;
    }
}

static void the_model_itself_starts(void **state)
{
    (void)state;
    tables t;
    begin(&t);
    assert_status(HG_OK, start_of(&t.detector));
    t.residual.signal = t.order;
    t.hull.signal = t.order;
    assert_status(HG_OK, start_of(&t.detector));
    assert_status(HG_OK, hg_platoon_bank_node_start(&node, HG_START_REST));
}

/* Each module looks at its own sizes: a table that the others would take is refused by the one that knows the size at compile time. */
static void another_size_is_refused_by_every_module(void **state)
{
    (void)state;
    tables t;
    hg_hold hold;
    hg_residual residual;
    hg_hull hull;
    hg_decision decision;
    hg_ring ring;
    int32_t codes[16];
    hg_real memory[256];
#define REFUSED(change, call)            \
    do {                                 \
        begin(&t);                       \
        assert_status(HG_OK, call);      \
        change;                          \
        assert_status(HG_E_CONFIG, call); \
    } while (false)
    REFUSED(t.trigger.width = 2U, hg_hold_start(&hold, t.hold, codes, memory));
    REFUSED(t.residual.order = t.residual.state.rows = t.residual.state.cols = t.residual.input.rows = t.residual.output.cols = 3U,
            hg_residual_start(&residual, &t.residual, memory));
    REFUSED(t.residual.residuals = t.residual.output.rows = t.residual.direct.rows = 1U, hg_residual_start(&residual, &t.residual, memory));
    REFUSED(t.residual.width = t.residual.input.cols = t.residual.direct.cols = 5U, hg_residual_start(&residual, &t.residual, memory));
    assert_status(HG_OK, hg_ring_start(&ring, HG_ONLY_WIDTH, HG_ONLY_HISTORY, memory));
    REFUSED(t.hull.residuals = 1U, hg_hull_start(&hull, &t.hull, &ring, HG_START_REST, memory));
    REFUSED(t.hull.width = 5U, hg_hull_start(&hull, &t.hull, &ring, HG_START_REST, memory));
    hg_alarm alarm[HG_ONLY_JUDGED];
    REFUSED(t.detector.decision.generators--, hg_decision_start(&decision, &t.detector.decision, alarm));
#undef REFUSED
}

static void a_ring_of_another_size_is_refused(void **state)
{
    (void)state;
    tables t;
    begin(&t);
    assert_true(hg_hull_valid(&t.hull, HG_ONLY_WIDTH, HG_ONLY_HISTORY));
    assert_false(hg_hull_valid(&t.hull, HG_ONLY_WIDTH + 1U, HG_ONLY_HISTORY));
    assert_false(hg_hull_valid(&t.hull, HG_ONLY_WIDTH, HG_ONLY_HISTORY + 1U));
}

static void another_count_is_refused_by_the_detector(void **state)
{
    (void)state;
    tables t;
    begin(&t);
    hg_hold_config more[3] = {t.hold[0], t.hold[1], t.hold[1]};
    t.detector.hold = more;
    t.detector.groups = 3U;
    assert_status(HG_E_CONFIG, start_of(&t.detector));
    t.detector.groups = 1U;
    assert_status(HG_E_CONFIG, start_of(&t.detector));
    begin(&t);
    t.detector.width++;
    assert_status(HG_E_CONFIG, start_of(&t.detector));
    begin(&t);
    t.detector.history--;
    assert_status(HG_E_CONFIG, start_of(&t.detector));
    begin(&t);
    t.detector.generators--;
    t.detector.banks++; /* as many that are judged */
    t.detector.residuals = (uint16_t)(t.detector.residuals - (HG_ONLY_RESIDUALS - 1U));
    assert_status(HG_E_CONFIG, start_of(&t.detector));
}

/* The signals are read one after another: a list in another order would be read as if it were in this one. */
static void another_order_is_refused(void **state)
{
    (void)state;
    tables t;
    for (uint8_t i = 0U; i < (HG_PLATOON_BANK_SIGNALS - 1U); i++) {
        begin(&t);
        t.order[i] = (uint8_t)(i + 1U);
        t.order[i + 1U] = i;
        t.residual.signal = t.order;
        assert_status(HG_E_CONFIG, start_of(&t.detector));
        assert_false(hg_residual_valid(&t.residual));
        t.residual.signal = t.detector.hull[0].signal;
        t.hull.signal = t.order;
        assert_false(hg_hull_valid(&t.hull, HG_ONLY_WIDTH, HG_ONLY_HISTORY));
        assert_status(HG_E_CONFIG, start_of(&t.detector));
    }
}

/* Nothing is gathered where the signals are read in their order: each must come in by its own column all the same. */
static void a_residual_reads_the_signals_where_they_are(void **state)
{
    (void)state;
    tables t;
    begin(&t);
    hg_residual self;
    hg_real memory[64];
    for (uint8_t g = 0U; g < HG_ONLY_READ; g++) {
        hg_real value[HG_ONLY_READ] = {R(0)};
        hg_real r[HG_ONLY_RESIDUALS];
        value[g] = R(1);
        arm(memory, COUNT(memory));
        assert_status(HG_OK, hg_residual_start(&self, &t.residual, memory));
        assert_status(HG_OK, hg_residual_step(&self, value, r));
        for (uint8_t i = 0U; i < HG_ONLY_RESIDUALS; i++) {
            assert_real(t.residual.direct.data[(HG_ONLY_READ * i) + g], r[i]);
        }
    }
}

static void a_plant_at_rest_raises_no_alarm_and_a_fault_does(void **state)
{
    (void)state;
    tables t;
    begin(&t);
    hg_detector self;
    hg_finding finding;
    const hg_detector_memory memory = {.hold = node.hold, .residual = node.residual, .hull = node.hull, .bank = node.bank, .alarm = node.alarm,
                                       .code = node.code, .codes = COUNT(node.code), .real = node.real, .reals = COUNT(node.real),
                                       .sum = node.sum, .sums = COUNT(node.sum)};
    assert_status(HG_OK, hg_detector_start(&self, &t.detector, &memory, HG_START_REST));
    hg_plant found = HG_PLANT_NONE;
    for (uint32_t k = 0U; k < 200U; k++) {
        const bool fault = k >= 100U;
        const hg_real values[HG_PLATOON_BANK_SIGNALS] = {R(0), R(0), R(0), R(0), fault ? R(20) : R(0), R(0)}; /* an acceleration that moves nothing */
        int32_t code[HG_PLATOON_BANK_SIGNALS];
        for (uint8_t g = 0U; g < HG_PLATOON_BANK_SIGNALS; g++) {
            code[g] = hg_code_encode(&t.hold[g / 3U].scale[g % 3U], values[g]);
        }
        assert_status(HG_OK, hg_detector_receive(&self, 0U, code, true));
        assert_status(HG_OK, hg_detector_receive(&self, 1U, &code[3], true));
        assert_status(HG_OK, hg_detector_step(&self, &finding));
        assert_true(fault || (finding.plant == HG_PLANT_NONE) || (finding.plant == HG_PLANT_STARTING));
        found = finding.plant;
    }
    assert_int_equal(HG_PLANT_CONFIRMED, found);
}

/* A group has as many signals as a group can have here. */
static void frames_of_the_widest_groups_are_received(void **state)
{
    (void)state;
    const hg_node_config *config = &hg_platoon_bank_config;
    const int32_t code[HG_GROUP_SIGNALS_MAX] = {0};
    assert_status(HG_OK, hg_platoon_bank_node_start(&node, HG_START_REST));
    for (uint8_t k = 0U; k < 20U; k++) {
        hg_verdict verdict;
        for (uint8_t group = 0U; group < HG_PLATOON_BANK_GROUPS; group++) {
            const hg_message *message = &config->message[group];
            hg_can_frame frame;
            assert_count(HG_GROUP_SIGNALS_MAX, message->width);
            hg_frame_pack(message, code, &frame);
            assert_status(HG_OK, hg_e2e_protect(message->e2e, frame.data, frame.length, (uint8_t)(k % hg_e2e_modulus(message->e2e)), k & 15U));
            assert_status(HG_OK, hg_node_receive(&node.node, &frame));
        }
        assert_status(HG_OK, hg_node_step(&node.node, &verdict));
        assert_count(k, verdict.k);
    }
    for (uint8_t group = 0U; group < HG_PLATOON_BANK_GROUPS; group++) {
        assert_int_equal(20, hg_node_health(&node.node, group)->good);
        assert_int_equal(0, hg_node_health(&node.node, group)->invalid);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_model_itself_starts),
        cmocka_unit_test(another_size_is_refused_by_every_module),
        cmocka_unit_test(a_ring_of_another_size_is_refused),
        cmocka_unit_test(another_count_is_refused_by_the_detector),
        cmocka_unit_test(another_order_is_refused),
        cmocka_unit_test(a_residual_reads_the_signals_where_they_are),
        cmocka_unit_test(frames_of_the_widest_groups_are_received),
        cmocka_unit_test(a_plant_at_rest_raises_no_alarm_and_a_fault_does),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
