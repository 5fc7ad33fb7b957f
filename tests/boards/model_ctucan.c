/* Two CTU CAN FD cores on one wire, as their manual has them, as far as hal/ctucan uses them. */
#include "ctucan.h"
#include "model_board.h"

enum { DEVICE_ID = 0, MODE = 1, STATUS = 2, COMMAND = 3, INT_STAT = 4, FAULT = 11, RX_STATUS = 26, RX_DATA = 27, TX_STATUS = 28, TX_COMMAND = 29, TX_PRIORITY = 30, TX_BUFFERS = 64 };
enum { READY = 1, SENT = 4, ABORTED = 7, EMPTY = 8 };
enum { ACTIVE = 1, PASSIVE = 2, OFF = 4 };

#define BUFFERS 4U
#define STRIDE 64U
#define WORDS 20U
#define FIFO 2048U
#define ENABLE (1U << 22)

typedef struct {
    model_line line;
    uint32_t mode;
    uint32_t resetting;   /* looks at MODE until the reset is over */
    bool     overrun;
    uint32_t tx[BUFFERS][STRIDE];
    uint32_t state[BUFFERS];
    uint32_t priority;
    uint32_t fifo[FIFO];
    uint32_t head;
    uint32_t held;        /* words */
    uint32_t frames;
    uint32_t left;        /* words of the frame that is being read */
} core;

static uint32_t device_id = 0x0205CAFDU;
static uint32_t reset_lasts = 3U;   /* looks at MODE; UINT32_MAX: for ever */
static core cores[HG_BOARD_CONTROLLERS];

const model_kind model = {.type = &hg_ctucan, .active = ACTIVE, .passive = PASSIVE, .off = OFF, .error = 0x10U};
const char *const contract_name = "ctucan, registers modelled";
const bool contract_classic = false;

/* ---- the wire ---- */

static uint32_t words_of(uint32_t form)
{
    return ((form >> 11) & 0x1FU) + 1U;
}

static void deliver(core *to, const uint32_t *word)
{
    const uint32_t count = words_of(word[0]);

    if (((to->mode & ENABLE) == 0U) || (to->line.fault == OFF)) {
        return;
    }
    if ((to->held + count) > FIFO) {
        to->overrun = true;
        return;
    }
    for (uint32_t i = 0U; i < count; i++) {
        to->fifo[(to->head + to->held) % FIFO] = word[i];
        to->held++;
    }
    to->frames++;
}

/* The ready buffer of highest priority, as long as there is one. */
static void transmit(core *self)
{
    uint32_t best = 0U;

    while ((best < BUFFERS) && ((self->mode & ENABLE) != 0U) && (self->line.fault != OFF) && self->line.acknowledged) {
        best = BUFFERS;
        for (uint32_t i = 0U; i < BUFFERS; i++) {
            const bool higher = (best == BUFFERS) || (((self->priority >> (4U * i)) & 7U) > ((self->priority >> (4U * best)) & 7U));
            best = ((self->state[i] == READY) && higher) ? i : best;
        }
        if (best < BUFFERS) {
            self->state[best] = SENT;
            deliver(&cores[(self == &cores[0]) ? 1 : 0], self->tx[best]);
        }
    }
}

/* ---- registers ---- */

static uint32_t read_data(core *self)
{
    if (self->held == 0U) {
        return 0U;
    }
    const uint32_t word = self->fifo[self->head];
    self->left = (self->left == 0U) ? words_of(word) : self->left;
    self->left--;
    self->frames -= (self->left == 0U) ? 1U : 0U;
    self->head = (self->head + 1U) % FIFO;
    self->held--;
    return word;
}

static uint32_t read_states(const core *self)
{
    uint32_t states = 0U;
    for (uint32_t i = 0U; i < BUFFERS; i++) {
        states |= self->state[i] << (4U * i);
    }
    return states;
}

uint32_t hg_register_read(uintptr_t base, uint32_t number)
{
    core *const self = &cores[MODEL_NUMBER(base)];

    switch (number) {
    case DEVICE_ID:
        return device_id;
    case MODE:
        self->resetting -= ((self->resetting > 0U) && (self->resetting < UINT32_MAX)) ? 1U : 0U;
        return self->mode | ((self->resetting > 0U) ? 1U : 0U);
    case STATUS:
        return (self->overrun ? 2U : 0U) | (self->line.warning ? 0x40U : 0U);
    case INT_STAT:
        return self->line.events;
    case FAULT:
        return self->line.fault << 16;
    case RX_STATUS:
        return self->frames << 4;
    case RX_DATA:
        return read_data(self);
    case TX_STATUS:
        return read_states(self);
    case TX_PRIORITY:
        return self->priority;
    default:
        return 0U;
    }
}

static void set_mode(core *self, uint32_t value)
{
    if ((value & 1U) != 0U) {
        *self = (core){.resetting = reset_lasts, .line = {.fault = OFF, .acknowledged = true}, .state = {EMPTY, EMPTY, EMPTY, EMPTY}};
    } else {
        self->mode = value;
        self->line.fault = ((value & ENABLE) != 0U) ? ACTIVE : OFF;
    }
}

static void command_buffers(core *self, uint32_t value)
{
    for (uint32_t i = 0U; i < BUFFERS; i++) {
        if ((value & (0x100U << i)) == 0U) {
            continue;
        }
        if (((value & 2U) != 0U) && (self->state[i] >= SENT)) {
            self->state[i] = READY;
        }
        if (((value & 4U) != 0U) && (self->state[i] == READY)) {
            self->state[i] = ABORTED;
        }
    }
    transmit(self);
}

void hg_register_write(uintptr_t base, uint32_t number, uint32_t value)
{
    core *const self = &cores[MODEL_NUMBER(base)];

    if (number >= TX_BUFFERS) {
        self->tx[(number - TX_BUFFERS) / STRIDE][(number - TX_BUFFERS) % STRIDE] = value;
    } else if (number == MODE) {
        set_mode(self, value);
    } else if (number == COMMAND) {
        self->overrun = self->overrun && ((value & 8U) == 0U);
        self->line.fault = (((value & 0x10U) != 0U) && (self->line.fault == OFF)) ? ACTIVE : self->line.fault; /* after 128 times 11 recessive bits */
    } else if (number == INT_STAT) {
        self->line.events &= ~value;
    } else if (number == TX_COMMAND) {
        command_buffers(self, value);
    } else if (number == TX_PRIORITY) {
        self->priority = value;
    } else {
        /* bit timing */
    }
}

/* ---- the model ---- */

model_line *model_line_of(uint8_t number)
{
    return &cores[number].line;
}

uint32_t model_pending(uint8_t number)
{
    uint32_t ready = 0U;
    for (uint32_t i = 0U; i < BUFFERS; i++) {
        ready += (cores[number].state[i] == READY) ? 1U : 0U;
    }
    return ready;
}

void contract_full(bool full)
{
    for (uint32_t i = 0U; i < BUFFERS; i++) {
        cores[0].state[i] = full ? READY : ABORTED;
    }
    cores[0].line.acknowledged = !full;
}

/* ---- what only this controller has ---- */

static void frames_leave_in_the_order_of_send(void **state)
{
    const hg_hal *const hal = *state;
    hg_can_frame frame = {.length = 1U};

    for (uint32_t round = 0U; round < 5U; round++) {
        cores[0].line.acknowledged = false;
        for (frame.id = 0U; frame.id < BUFFERS; frame.id++) {
            assert_int_equal(hg_hal_send(&hal[0], &frame), HG_OK);
        }
        assert_int_equal(hg_hal_send(&hal[0], &frame), HG_E_BUSY);
        cores[0].line.acknowledged = true;
        transmit(&cores[0]);
        for (uint32_t i = 0U; i < BUFFERS; i++) {
            assert_int_equal(hg_hal_receive(&hal[1], &frame, NULL), HG_OK);
            assert_int_equal(frame.id, i);
        }
    }
}

static void an_overrun_of_the_core_is_counted(void **state)
{
    const hg_hal *const hal = *state;
    hg_hal_report report;

    cores[0].overrun = true;
    hg_hal_state(&hal[0], &report);
    hg_hal_state(&hal[0], &report);
    assert_int_equal(report.lost, 1);
}

static void a_frame_shorter_than_its_dlc_is_malformed(void **state)
{
    const hg_hal *const hal = *state;
    const uint32_t word[] = {8U | (4U << 11), 0x123U << 18, 0U, 0U, 0U};
    hg_can_frame frame;
    hg_hal_report report;

    deliver(&cores[0], word);
    assert_int_equal(hg_hal_receive(&hal[0], &frame, NULL), HG_E_EMPTY);
    hg_hal_state(&hal[0], &report);
    assert_int_equal(report.malformed, 1);
}

static void start_tells_of_a_core_that_is_not_there_or_stays_in_its_reset(void **state)
{
    hg_controller controller;
    const hg_controller_options good = model_options();

    (void)state;
    device_id = 0U;
    assert_int_equal(hg_controller_start(&controller, &good), HG_E_BUS);
    device_id = 0x0205CAFDU;
    reset_lasts = UINT32_MAX;
    assert_int_equal(hg_controller_start(&controller, &good), HG_E_BUS);
    reset_lasts = 3U;
}

int model_own(void)
{
    const struct CMUnitTest tests[] = {
        MODEL_TEST(start_tells_of_a_core_that_is_not_there_or_stays_in_its_reset), MODEL_TEST(frames_leave_in_the_order_of_send),
        MODEL_TEST(an_overrun_of_the_core_is_counted), MODEL_TEST(a_frame_shorter_than_its_dlc_is_malformed),
    };

    return cmocka_run_group_tests_name("ctucan alone", tests, NULL, NULL);
}
