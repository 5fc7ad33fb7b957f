/* Two CAN controllers of the Zynq UltraScale+ on one wire, as their manual has them, as far as hal/zynqmp_r5 uses them. */
#include "model_board.h"
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
    model_line line;
    bool       enabled;
    uint32_t   staged[WORDS];
    fifo       tx;
    fifo       rx;
} controller;

static bool stuck;   /* in operation, whatever is written */
static controller controllers[HG_BOARD_CONTROLLERS];

const model_kind model = {.type = &hg_zynqmp_can, .active = ACTIVE, .passive = PASSIVE, .off = OFF, .error = ERROR};
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
    return self->enabled && (self->line.fault != OFF);
}

static void transmit(controller *self)
{
    controller *const other = &controllers[(self == &controllers[0]) ? 1 : 0];

    while ((self->tx.held > 0U) && on_bus(self) && self->line.acknowledged) {
        if (on_bus(other) && (!put(&other->rx, self->tx.word[self->tx.head]))) {
            other->line.events |= OVERFLOW;
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
        return ((self->enabled || stuck) ? 8U : 1U) | (self->line.fault << 7) | (self->line.warning ? 0x40U : 0U) | ((self->tx.held == DEPTH) ? 0x400U : 0U);
    case ISR:
        self->line.events |= (self->rx.held > 0U) ? RECEIVED : 0U;
        return self->line.events;
    default:
        return 0U;
    }
}

static void reset(controller *self, uint32_t value)
{
    if ((value & 1U) != 0U) {
        *self = (controller){.line = {.acknowledged = true}};
    } else {
        self->enabled = (value & 2U) != 0U;
        self->line.fault = self->enabled ? ACTIVE : CONFIGURING; /* after 128 times 11 recessive bits, where it was off */
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
        self->line.events &= ~value;
    } else {
        /* bit timing, mode, filters, what kind of error it was */
    }
}

/* ---- the model ---- */

model_line *model_line_of(uint8_t number)
{
    return &controllers[number].line;
}

uint32_t model_pending(uint8_t number)
{
    return controllers[number].tx.held;
}

void contract_full(bool full)
{
    controllers[0].line.acknowledged = !full;
    controllers[0].tx.held = full ? DEPTH : 0U;
}

/* ---- what only this controller has ---- */

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

static void start_tells_of_a_controller_that_stays_in_operation(void **state)
{
    hg_controller one;
    const hg_controller_options good = model_options();

    (void)state;
    stuck = true;
    assert_int_equal(hg_controller_start(&one, &good), HG_E_BUS);
    stuck = false;
}

int model_own(void)
{
    const struct CMUnitTest tests[] = {
        MODEL_TEST(start_tells_of_a_controller_that_stays_in_operation), MODEL_TEST(the_registers_have_the_layout_of_silicon),
        MODEL_TEST(an_overflow_of_the_controller_is_counted),
    };

    return cmocka_run_group_tests_name("zynqmp_r5 alone", tests, NULL, NULL);
}
