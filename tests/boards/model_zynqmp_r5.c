/* Two CAN controllers of the Zynq UltraScale+ on one wire, as their manual has them, as far as hal/zynqmp_r5 uses them. */
#include "contract_rig.h"
#include "model_board.h"
#include "registers.h"
#include "rig.h"
#include "zynqmp_can.h"

enum { SRR = 0, ESR = 5, SR = 6, ISR = 7, ICR = 9, TX_ID = 12, TX_DATA2 = 15, RX_ID = 20, RX_DATA2 = 23 };
enum { CONFIGURING = 0, ACTIVE = 1, OFF = 2, PASSIVE = 3 };

#define WORDS 4U
#define DEPTH 64U
#define RECEIVED (1U << 7)
#define OVERFLOW (1U << 6)
#define ERROR (1U << 8)

typedef struct {
    uint32_t word[DEPTH][WORDS];
    uint32_t head;
    uint32_t held;
} fifo;

typedef struct {
    uint32_t state;
    bool     enabled;
    bool     warning;
    bool     acknowledged;  /* is there anybody who does? */
    uint32_t events;
    uint32_t starts;
    uint32_t staged[WORDS];
    fifo     tx;
    fifo     rx;
} controller;

static bool stuck;   /* in operation, whatever is written */
static controller controllers[HG_BOARD_CONTROLLERS];
static hg_zynqmp_can drivers[HG_BOARD_CONTROLLERS];

const char *const contract_name = "zynqmp_r5, registers modelled";
const bool contract_classic = true;

/* ---- the wire ---- */

static bool put(fifo *to, const uint32_t *word)
{
    if (to->held == DEPTH) {
        return false;
    }
    memcpy(to->word[(to->head + to->held) % DEPTH], word, sizeof to->word[0]);
    to->held++;
    return true;
}

static void drop(fifo *from)
{
    from->head = (from->head + 1U) % DEPTH;
    from->held--;
}

static bool on_bus(const controller *self)
{
    return self->enabled && (self->state != OFF);
}

static void transmit(controller *self)
{
    controller *const other = &controllers[(self == &controllers[0]) ? 1 : 0];

    while ((self->tx.held > 0U) && on_bus(self) && self->acknowledged) {
        if (on_bus(other) && (!put(&other->rx, self->tx.word[self->tx.head]))) {
            other->events |= OVERFLOW;
        }
        drop(&self->tx);
    }
}

/* ---- registers ---- */

static uint32_t read_received(controller *self, uint32_t word)
{
    if (self->rx.held == 0U) {
        return 0U;
    }
    const uint32_t value = self->rx.word[self->rx.head][word];
    if (word == (WORDS - 1U)) {
        drop(&self->rx);
    }
    return value;
}

uint32_t hg_register_read(uintptr_t base, uint32_t number)
{
    controller *const self = &controllers[MODEL_NUMBER(base)];

    if ((number >= RX_ID) && (number <= RX_DATA2)) {
        return read_received(self, number - RX_ID);
    }
    switch (number) {
    case SRR:
        return self->enabled ? 2U : 0U;
    case SR:
        return ((self->enabled || stuck) ? 8U : 1U) | (self->state << 7) | (self->warning ? 0x40U : 0U) | ((self->tx.held == DEPTH) ? 0x400U : 0U);
    case ISR:
        self->events |= (self->rx.held > 0U) ? RECEIVED : 0U;
        return self->events;
    default:
        return 0U;
    }
}

static void reset(controller *self, uint32_t value)
{
    if ((value & 1U) != 0U) {
        *self = (controller){.acknowledged = true, .starts = self->starts};
    } else {
        self->enabled = (value & 2U) != 0U;
        self->state = self->enabled ? ACTIVE : CONFIGURING; /* after 128 times 11 recessive bits, where it was off */
        self->starts += self->enabled ? 1U : 0U;
    }
}

void hg_register_write(uintptr_t base, uint32_t number, uint32_t value)
{
    controller *const self = &controllers[MODEL_NUMBER(base)];

    if ((number >= TX_ID) && (number <= TX_DATA2)) {
        self->staged[number - TX_ID] = value;
        if (number == TX_DATA2) {
            assert_true(put(&self->tx, self->staged));
            transmit(self);
        }
    } else if (number == SRR) {
        reset(self, value);
    } else if (number == ICR) {
        self->events &= ~value;
    } else {
        /* bit timing, mode, filters, what kind of error it was */
    }
}

/* ---- the board ---- */

hg_status hg_board_can(uint8_t number, const hg_hal_filter *filters, size_t count, hg_hal *hal)
{
    const hg_zynqmp_can_options options = {
        .base = MODEL_BASE(number), .now_us = hg_board_now_us, .idle = model_idle, .filters = filters, .filter_count = count,
        .slots = model_slots[number], .depth = HG_BOARD_DEPTH,
    };
    const hg_status status = hg_zynqmp_can_start(&drivers[number], &options);
    *hal = hg_zynqmp_can_hal(&drivers[number]);
    return status;
}

void hg_board_service(uint8_t number)
{
    hg_zynqmp_can_interrupt(&drivers[number]);
}

void hg_board_stop(uint8_t number)
{
    hg_zynqmp_can_stop(&drivers[number]);
}

/* ---- the hand on controller 0 ---- */

void contract_full(bool full)
{
    controllers[0].acknowledged = !full;
    controllers[0].tx.held = full ? DEPTH : 0U;
}

void contract_link(bool up)
{
    controllers[0].state = up ? ACTIVE : OFF;
    controllers[0].warning = false;
}

void contract_report(hg_bus_state state)
{
    static const uint32_t told[] = {[HG_BUS_UNKNOWN] = OFF, [HG_BUS_ACTIVE] = ACTIVE, [HG_BUS_WARNING] = ACTIVE, [HG_BUS_PASSIVE] = PASSIVE, [HG_BUS_OFF] = OFF};

    controllers[0].state = told[state];
    controllers[0].warning = state == HG_BUS_WARNING;
    controllers[0].events |= ERROR;
}

/* ---- what only this controller has ---- */

static int open_both(void **state)
{
    hg_hal *const hal = *state;

    hg_board_set_idle(NULL);
    assert_int_equal(hg_board_can(0U, NULL, 0U, &hal[0]), HG_OK);
    assert_int_equal(hg_board_can(1U, NULL, 0U, &hal[1]), HG_OK);
    return 0;
}

static int nothing(void **state)
{
    (void)state;
    return 0;
}

/* The words that the manual's register layout gives, worked out by hand. */
static void the_registers_have_the_layout_of_silicon(void **state)
{
    const hg_hal *const hal = *state;
    const hg_can_frame frames[] = {
        {.id = 0x123U, .length = 8U, .data = {1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U}}, {.id = 0x12345678U, .flags = HG_CAN_EXTENDED, .length = 1U, .data = {0xABU}},
        {.id = 0x7FFU, .flags = HG_CAN_REMOTE, .length = 3U}, {.id = 0x1FFFFFFFU, .flags = HG_CAN_EXTENDED | HG_CAN_REMOTE},
    };
    const uint32_t words[][WORDS] = {
        {0x24600000U, 0x80000000U, 0x01020304U, 0x05060708U}, {0x91B8ACF0U, 0x10000000U, 0xAB000000U, 0U}, {0xFFF00000U, 0x30000000U, 0U, 0U}, {0xFFFFFFFFU, 0U, 0U, 0U},
    };

    for (size_t i = 0U; i < (sizeof frames / sizeof frames[0]); i++) {
        assert_int_equal(hg_hal_send(&hal[0], &frames[i]), HG_OK);
        assert_memory_equal(controllers[0].staged, words[i], sizeof words[i]);
    }
}

static void bus_off_heals_after_a_pause(void **state)
{
    const hg_hal *const hal = *state;
    const hg_can_frame frame = {.id = 5U, .length = 1U};
    hg_hal_report report;

    controllers[0].acknowledged = false;
    assert_int_equal(hg_hal_send(&hal[0], &frame), HG_OK);
    controllers[0].state = OFF;
    assert_int_equal(hg_hal_wait(&hal[0], hg_hal_now_us(&hal[0]) + (HG_ZYNQMP_CAN_RESTART_US / 2U)), HG_E_EMPTY);
    hg_hal_state(&hal[0], &report);
    assert_int_equal(report.bus, HG_BUS_OFF);
    const uint32_t starts = controllers[0].starts;
    assert_int_equal(hg_hal_wait(&hal[0], hg_hal_now_us(&hal[0]) + HG_ZYNQMP_CAN_RESTART_US), HG_E_EMPTY);
    assert_int_equal(controllers[0].starts, starts + 1U);
    assert_int_equal(controllers[0].tx.held, 0);
    hg_hal_state(&hal[0], &report);
    assert_int_equal(report.bus, HG_BUS_ACTIVE);
    assert_int_equal(hg_hal_send(&hal[0], &frame), HG_OK);
    assert_int_equal(hg_hal_wait(&hal[1], 0U), HG_OK);
}

static void an_overflow_of_the_controller_is_counted(void **state)
{
    const hg_hal *const hal = *state;
    const hg_can_frame frame = {.id = 5U};
    hg_can_frame got;
    hg_hal_report report;
    uint32_t received = 0U;

    for (uint32_t i = 0U; i < (DEPTH + 3U); i++) {
        assert_int_equal(hg_hal_send(&hal[1], &frame), HG_OK);
    }
    while (hg_hal_receive(&hal[0], &got, NULL) == HG_OK) {
        received++;
    }
    assert_int_equal(received, DEPTH);
    hg_hal_state(&hal[0], &report);
    assert_int_equal(report.lost, 1);
}

static void start_refuses_what_cannot_be(void **state)
{
    static const hg_hal_filter bad = {.id = 0x800U};
    hg_zynqmp_can board;
    const hg_zynqmp_can_options good = {.base = MODEL_BASE(0), .now_us = hg_board_now_us, .slots = model_slots[0], .depth = HG_BOARD_DEPTH};
    hg_zynqmp_can_options options[6] = {good, good, good, good, good, good};

    (void)state;
    options[0].base = 0U;
    options[1].base += 2U;
    options[2].now_us = NULL;
    options[3].slots = NULL;
    options[4].depth = 3U;
    options[5].filters = &bad;
    options[5].filter_count = 1U;
    for (size_t i = 0U; i < 6U; i++) {
        assert_int_equal(hg_zynqmp_can_start(&board, &options[i]), HG_E_ARGUMENT);
    }
    assert_int_equal(hg_zynqmp_can_start(NULL, &good), HG_E_ARGUMENT);
    assert_int_equal(hg_zynqmp_can_start(&board, NULL), HG_E_ARGUMENT);
    assert_int_equal(hg_zynqmp_can_start(&board, &good), HG_OK);
    stuck = true;
    assert_int_equal(hg_zynqmp_can_start(&board, &good), HG_E_BUS);
    stuck = false;
}

int contract_own(void)
{
    static hg_hal hal[2];
    const struct CMUnitTest tests[] = {
        {"start_refuses_what_cannot_be", start_refuses_what_cannot_be, nothing, nothing, hal},
        {"the_registers_have_the_layout_of_silicon", the_registers_have_the_layout_of_silicon, open_both, nothing, hal},
        {"bus_off_heals_after_a_pause", bus_off_heals_after_a_pause, open_both, nothing, hal},
        {"an_overflow_of_the_controller_is_counted", an_overflow_of_the_controller_is_counted, open_both, nothing, hal},
    };

    return cmocka_run_group_tests_name("zynqmp_r5 alone", tests, NULL, NULL);
}
