#include "zynqmp_can.h"

#include "port.h"
#include "registers.h"

/* Registers, in words from the base. */
enum {
    SRR = 0x00 / 4, MSR = 0x04 / 4, BRPR = 0x08 / 4, BTR = 0x0C / 4, ESR = 0x14 / 4, SR = 0x18 / 4, ISR = 0x1C / 4, ICR = 0x24 / 4,
    TX_ID = 0x30 / 4, TX_DLC = 0x34 / 4, TX_DATA = 0x38 / 4, RX_ID = 0x50 / 4, RX_DLC = 0x54 / 4, RX_DATA = 0x58 / 4, AFR = 0x60 / 4
};

#define SRR_RESET (1U << 0)
#define SRR_ENABLE (1U << 1)
#define SR_CONFIG (1U << 0)
#define SR_WARNING (1U << 6)
#define SR_ESTAT(sr) (((sr) >> 7) & 0x3U)
#define SR_TX_FULL (1U << 10)
#define ISR_OVERFLOW (1U << 6)
#define ISR_RECEIVED (1U << 7)
#define ISR_ERROR (1U << 8)
#define ISR_BUS_OFF (1U << 9)
#define ESR_ALL 0x1FU
#define DLC_SHIFT 28U
#define DATA_WORDS 2U
#define DEPTH_OF_CONTROLLER 64U

/* ---- receiving, and the state of the bus ---- */

/* All four words must be read: the last one moves the queue on. */
static hg_status read(const hg_controller_place *at, hg_can_frame *frame)
{
    if ((hg_register_read(at->base, ISR) & ISR_RECEIVED) == 0U) {
        return HG_E_EMPTY;
    }
    const uint32_t id = hg_register_read(at->base, RX_ID);
    const uint32_t dlc = hg_register_read(at->base, RX_DLC) >> DLC_SHIFT;
    const uint32_t data[DATA_WORDS] = {hg_register_read(at->base, RX_DATA), hg_register_read(at->base, RX_DATA + 1)};
    hg_register_write(at->base, ICR, ISR_RECEIVED); /* comes back at once where there is another one */

    *frame = (hg_can_frame){.length = (uint8_t)((dlc > HG_CAN_CLASSIC_MAX) ? HG_CAN_CLASSIC_MAX : dlc)}; /* ISO 11898-1: DLC 9 .. 15 is 8 bytes */
    hg_zynqmp_read_id(id, frame);
    if ((frame->flags & HG_CAN_REMOTE) == 0U) {
        for (uint32_t i = 0U; i < frame->length; i++) {
            frame->data[i] = (uint8_t)((data[i / 4U] >> HG_ZYNQMP_BYTE_SHIFT(i)) & 0xFFU);
        }
    }
    return ((id & HG_ZYNQMP_ERROR_FRAME) == 0U) ? HG_OK : HG_E_ID;
}

static bool overflowed(const hg_controller_place *at)
{
    const bool overflow = (hg_register_read(at->base, ISR) & ISR_OVERFLOW) != 0U;

    if (overflow) {
        hg_register_write(at->base, ICR, ISR_OVERFLOW);
    }
    return overflow;
}

static bool reported(const hg_controller_place *at)
{
    const uint32_t events = hg_register_read(at->base, ISR) & (ISR_ERROR | ISR_BUS_OFF);

    if (events != 0U) {
        hg_register_write(at->base, ESR, ESR_ALL);
        hg_register_write(at->base, ICR, events);
    }
    return events != 0U;
}

static hg_bus_state state(const hg_controller_place *at)
{
    const uint32_t status = hg_register_read(at->base, SR);

    return hg_zynqmp_state(SR_ESTAT(status), (status & SR_CONFIG) != 0U, (status & SR_WARNING) != 0U);
}

/* ---- sending ---- */

static bool write(const hg_controller_place *at, const hg_can_frame *frame)
{
    uint32_t data[DATA_WORDS] = {0U};

    if ((hg_register_read(at->base, SR) & SR_TX_FULL) != 0U) {
        return false;
    }
    if ((frame->flags & HG_CAN_REMOTE) == 0U) {
        for (uint32_t i = 0U; i < frame->length; i++) {
            data[i / 4U] |= (uint32_t)frame->data[i] << HG_ZYNQMP_BYTE_SHIFT(i);
        }
    }
    hg_register_write(at->base, TX_ID, hg_zynqmp_id_of(frame));
    hg_register_write(at->base, TX_DLC, (uint32_t)frame->length << DLC_SHIFT);
    hg_register_write(at->base, TX_DATA, data[0]);
    hg_register_write(at->base, TX_DATA + 1, data[1]); /* the last word queues the frame */
    return true;
}

/* ---- start, and start again ---- */

static bool set_up(const hg_controller_place *at)
{
    uint32_t polls = 0U;
    hg_can_frame old;

    hg_register_write(at->base, SRR, SRR_RESET);
    while (((hg_register_read(at->base, SR) & SR_CONFIG) == 0U) && (polls < HG_CONTROLLER_RESET_POLLS)) {
        polls++;
    }
    if (polls == HG_CONTROLLER_RESET_POLLS) {
        return false;
    }
    hg_register_write(at->base, BRPR, at->timing[0]);
    hg_register_write(at->base, BTR, at->timing[1]);
    hg_register_write(at->base, AFR, 0U); /* every frame: there are but four filters in hardware, and they cannot tell all kinds apart */
    hg_register_write(at->base, MSR, 0U);
    for (uint32_t i = 0U; (i < (2U * DEPTH_OF_CONTROLLER)) && (read(at, &old) != HG_E_EMPTY); i++) {
        /* of the time before the reset: port.h */
    }
    hg_register_write(at->base, SRR, SRR_ENABLE);
    return true;
}

static void withdraw(const hg_controller_place *at)
{
    (void)at; /* set_up does, with its reset */
}

static void rejoin(const hg_controller_place *at)
{
    (void)set_up(at); /* in vain: it is tried again after the same pause */
}

const hg_controller_type hg_zynqmp_can = {
    .fd = false, .set_up = set_up, .read = read, .overflowed = overflowed, .reported = reported, .state = state, .write = write, .withdraw = withdraw, .rejoin = rejoin,
};
