#include "ctucan.h"

#include "port.h"
#include "registers.h"

#include <string.h>

/* Registers, in words from the base; MODE, EWL and TX_COMMAND words hold several of the manual's byte registers. */
enum {
    DEVICE_ID = 0x00 / 4, MODE = 0x04 / 4, STATUS = 0x08 / 4, COMMAND = 0x0C / 4, INT_STAT = 0x10 / 4,
    BTR = 0x24 / 4, BTR_FD = 0x28 / 4, FAULT = 0x2C / 4, RX_STATUS = 0x68 / 4, RX_DATA = 0x6C / 4, TX_STATUS = 0x70 / 4,
    TX_COMMAND = 0x74 / 4, TX_PRIORITY = 0x78 / 4, TX_BUFFER = 0x100 / 4
};

#define ID_OF_CORE 0xCAFDU
#define MODE_RESET (1U << 0)
#define MODE_FD (1U << 4)
#define MODE_AUTOMATIC (1U << 9)     /* reading RX_DATA moves on; reserved, and ignored, in cores before 2.4 */
#define MODE_ENABLE (1U << 22)
#define STATUS_OVERRUN (1U << 1)
#define STATUS_WARNING (1U << 6)
#define COMMAND_CLEAR_OVERRUN (1U << 3)
#define COMMAND_RESET_ERRORS (1U << 4)
#define INT_STATE_CHANGED (1U << 4)
#define INT_BUS_ERROR (1U << 6)
#define FAULT_SHIFT 16U
#define RX_FRAMES(status) (((status) >> 4) & 0x7FFU)
#define BUFFERS 4U
#define BUFFER_STRIDE (0x100U / 4U)
#define PRIORITY_MAX 7U
#define TX_COMMAND_READY 0x2U
#define TX_COMMAND_ABORT 0x4U
#define TX_COMMAND_BUFFER(i) (0x100U << (i))

/* First word of a frame. */
#define FORM_REMOTE (1U << 5)
#define FORM_EXTENDED (1U << 6)
#define FORM_FD (1U << 7)
#define FORM_BRS (1U << 9)
#define FORM_WORDS(form) (((form) >> 11) & 0x1FU)
#define HEAD_WORDS 4U                /* form, identifier, two of time stamp */
#define FRAME_WORDS (HEAD_WORDS + (HG_CAN_DATA_MAX / 4U))
#define BASE_SHIFT 18U               /* of an 11-bit identifier, and of the upper 11 bits of a 29-bit one */

static const uint8_t dlc_length[16] = {0U, 1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 12U, 16U, 20U, 24U, 32U, 48U, 64U};

/* ---- frames ---- */

static uint32_t dlc_of(uint8_t length)
{
    uint32_t dlc = 0U;
    while ((dlc < 15U) && (dlc_length[dlc] < length)) {
        dlc++;
    }
    return dlc;
}

static void write_frame(const hg_controller_place *at, uint32_t buffer, const hg_can_frame *frame)
{
    const uint32_t first = TX_BUFFER + (buffer * BUFFER_STRIDE);
    const bool extended = (frame->flags & HG_CAN_EXTENDED) != 0U;
    const bool remote = (frame->flags & HG_CAN_REMOTE) != 0U;
    const uint32_t words = remote ? 0U : (((uint32_t)frame->length + 3U) / 4U);
    uint32_t form = dlc_of(frame->length) | ((HEAD_WORDS + words - 1U) << 11);

    form |= remote ? FORM_REMOTE : 0U;
    form |= extended ? FORM_EXTENDED : 0U;
    form |= ((frame->flags & HG_CAN_FD) != 0U) ? FORM_FD : 0U;
    form |= ((frame->flags & HG_CAN_BRS) != 0U) ? FORM_BRS : 0U;
    hg_register_write(at->base, first, form);
    hg_register_write(at->base, first + 1, extended ? frame->id : (frame->id << BASE_SHIFT));
    hg_register_write(at->base, first + 2, 0U); /* a time that has passed: now */
    hg_register_write(at->base, first + 3, 0U);
    for (uint32_t i = 0U; i < words; i++) {
        const uint8_t *const byte = &frame->data[4U * i];
        hg_register_write(at->base, first + HEAD_WORDS + i, (uint32_t)byte[0] | ((uint32_t)byte[1] << 8) | ((uint32_t)byte[2] << 16) | ((uint32_t)byte[3] << 24));
    }
}

/* Takes the whole frame from the core, however long it says it is. */
static void read_words(const hg_controller_place *at, uint32_t word[FRAME_WORDS])
{
    (void)memset(word, 0, FRAME_WORDS * sizeof(word[0]));
    word[0] = hg_register_read(at->base, RX_DATA);
    const uint32_t more = FORM_WORDS(word[0]);
    for (uint32_t i = 1U; i <= more; i++) {
        const uint32_t next = hg_register_read(at->base, RX_DATA);
        if (i < FRAME_WORDS) {
            word[i] = next;
        }
    }
}

/* False: a frame that contradicts itself. */
static bool parse(const uint32_t word[FRAME_WORDS], hg_can_frame *frame)
{
    const uint32_t form = word[0];
    const bool fd = (form & FORM_FD) != 0U;
    const bool remote = (form & FORM_REMOTE) != 0U;
    const bool extended = (form & FORM_EXTENDED) != 0U;
    uint8_t length = dlc_length[form & 0xFU];

    length = ((!fd) && (length > HG_CAN_CLASSIC_MAX)) ? (uint8_t)HG_CAN_CLASSIC_MAX : length; /* ISO 11898-1: DLC 9 .. 15 is 8 bytes */
    *frame = (hg_can_frame){.id = extended ? (word[1] & HG_CAN_ID_EXTENDED) : ((word[1] >> BASE_SHIFT) & HG_CAN_ID_STANDARD), .length = length};
    frame->flags = (uint8_t)((extended ? HG_CAN_EXTENDED : 0U) | (remote ? HG_CAN_REMOTE : 0U) | (fd ? HG_CAN_FD : 0U)
                             | ((fd && ((form & FORM_BRS) != 0U)) ? HG_CAN_BRS : 0U));
    if (remote) {
        return !fd;
    }
    for (uint32_t i = 0U; i < length; i++) {
        frame->data[i] = (uint8_t)((word[HEAD_WORDS + (i / 4U)] >> (8U * (i % 4U))) & 0xFFU);
    }
    return FORM_WORDS(form) >= (HEAD_WORDS - 1U + ((length + 3U) / 4U));
}

/* ---- receiving, and the state of the bus ---- */

static hg_status read(const hg_controller_place *at, hg_can_frame *frame)
{
    uint32_t word[FRAME_WORDS];

    if (RX_FRAMES(hg_register_read(at->base, RX_STATUS)) == 0U) {
        return HG_E_EMPTY;
    }
    read_words(at, word);
    return parse(word, frame) ? HG_OK : HG_E_FORMAT;
}

static bool overflowed(const hg_controller_place *at)
{
    const bool overrun = (hg_register_read(at->base, STATUS) & STATUS_OVERRUN) != 0U;

    if (overrun) {
        hg_register_write(at->base, COMMAND, COMMAND_CLEAR_OVERRUN);
    }
    return overrun;
}

static bool reported(const hg_controller_place *at)
{
    const uint32_t events = hg_register_read(at->base, INT_STAT) & (INT_STATE_CHANGED | INT_BUS_ERROR);

    if (events != 0U) {
        hg_register_write(at->base, INT_STAT, events);
    }
    return events != 0U;
}

static hg_bus_state state(const hg_controller_place *at)
{
    const bool enabled = (hg_register_read(at->base, MODE) & MODE_ENABLE) != 0U;
    const bool warning = (hg_register_read(at->base, STATUS) & STATUS_WARNING) != 0U;

    return hg_ctucan_fault(hg_register_read(at->base, FAULT) >> FAULT_SHIFT, enabled, warning);
}

static void withdraw(const hg_controller_place *at)
{
    hg_register_write(at->base, TX_COMMAND, TX_COMMAND_ABORT | TX_COMMAND_BUFFER(0U) | TX_COMMAND_BUFFER(1U) | TX_COMMAND_BUFFER(2U) | TX_COMMAND_BUFFER(3U));
}

static void rejoin(const hg_controller_place *at)
{
    hg_register_write(at->base, COMMAND, COMMAND_RESET_ERRORS);
}

/* ---- sending ---- */

/* Finished, failed, aborted or empty: the states 4, 6, 7 and 8. */
static bool is_free(uint32_t buffer_state)
{
    return buffer_state >= 4U;
}

/* Frames leave in the order of send: while one is pending, each new one gets a priority below all that are. A buffer, or BUFFERS. */
static uint32_t choose_buffer(const hg_controller_place *at, uint32_t *priority)
{
    const uint32_t states = hg_register_read(at->base, TX_STATUS);
    const uint32_t priorities = hg_register_read(at->base, TX_PRIORITY);
    uint32_t lowest = PRIORITY_MAX + 1U;
    uint32_t buffer = BUFFERS;

    for (uint32_t i = 0U; i < BUFFERS; i++) {
        const uint32_t own = (priorities >> (4U * i)) & 0x7U;
        if (is_free((states >> (4U * i)) & 0xFU)) {
            buffer = i;
        } else if (own < lowest) {
            lowest = own;
        } else {
            /* not the last one */
        }
    }
    *priority = lowest - 1U;
    return (lowest > 1U) ? buffer : BUFFERS;
}

static bool write(const hg_controller_place *at, const hg_can_frame *frame)
{
    uint32_t priority = 0U;
    const uint32_t buffer = choose_buffer(at, &priority);

    if (buffer == BUFFERS) {
        return false;
    }
    write_frame(at, buffer, frame);
    hg_register_write(at->base, TX_PRIORITY, (hg_register_read(at->base, TX_PRIORITY) & ~(0x7U << (4U * buffer))) | (priority << (4U * buffer)));
    hg_register_write(at->base, TX_COMMAND, TX_COMMAND_READY | TX_COMMAND_BUFFER(buffer));
    return true;
}

/* ---- start ---- */

static bool reset(uintptr_t core)
{
    uint32_t polls = 0U;

    if ((hg_register_read(core, DEVICE_ID) & 0xFFFFU) != ID_OF_CORE) {
        return false;
    }
    hg_register_write(core, MODE, MODE_RESET);
    while (((hg_register_read(core, MODE) & MODE_RESET) != 0U) && (polls < HG_CONTROLLER_RESET_POLLS)) {
        polls++;
    }
    return polls < HG_CONTROLLER_RESET_POLLS;
}

static bool set_up(const hg_controller_place *at)
{
    if (!reset(at->base)) {
        return false;
    }
    hg_register_write(at->base, BTR, at->timing[0]);
    hg_register_write(at->base, BTR_FD, at->timing[1]);
    hg_register_write(at->base, TX_PRIORITY, 0U);
    hg_register_write(at->base, MODE, MODE_FD | MODE_AUTOMATIC | MODE_ENABLE);
    return true;
}

const hg_controller_type hg_ctucan = {
    .fd = true, .set_up = set_up, .read = read, .overflowed = overflowed, .reported = reported, .state = state, .write = write, .withdraw = withdraw, .rejoin = rejoin,
};
