/* QEMU's RISC-V virt machine with a ctucan_pci card: hal/board/board.h on its UART, its machine timer and the card's two cores. There is no
 * firmware before this image, so it gives the card its addresses itself. */
#include "board.h"

#include "ctucan.h"

#define ECAM 0x30000000UL            /* configuration space of PCI: 32 KiB a device of bus 0 */
#define DEVICE_STRIDE 0x8000UL
#define DEVICES 32U
#define CARD 0xFF001760UL            /* device and vendor of ctucan_pci */
#define COMMAND_MEMORY 0x2UL
#define WINDOW_BRIDGE 0x40010000UL   /* BAR 0, within the machine's window for memory of PCI */
#define WINDOW_CORES 0x40000000UL    /* BAR 1: the cores, CORE_STRIDE apart */
#define CORE_STRIDE 0x4000UL
#define UART 0x10000000UL            /* 16550, byte registers */
#define UART_LSR 5U
#define LSR_READY 0x01U
#define LSR_ROOM 0x20U
#define MTIME 0x0200BFF8UL
#define MTIME_TICKS_PER_US 10U
#define TEST_DEVICE 0x00100000UL     /* ends the emulator */
#define TEST_PASS 0x5555UL
#define TEST_FAIL 0x3333UL

/* 500 kbit/s and 2 Mbit/s at 100 MHz, sample points 80 %: ignored by the emulator, obeyed by a core with that clock. */
#define TIMING ((29UL << 0) | (10UL << 7) | (10UL << 13) | (4UL << 19) | (5UL << 27))
#define TIMING_FD ((29UL << 0) | (10UL << 7) | (10UL << 13) | (1UL << 19) | (5UL << 27))

static volatile uint32_t *word_at(uintptr_t address)
{
    return (volatile uint32_t *)address;
}

static volatile uint8_t *byte_at(uintptr_t address)
{
    return (volatile uint8_t *)address;
}

/* ---- console, clock, end ---- */

void hg_board_say(const char *text)
{
    for (const char *c = text; *c != '\0'; c++) {
        uint32_t polls = 0U;
        while (((*byte_at(UART + UART_LSR) & LSR_ROOM) == 0U) && (polls < HG_BOARD_SAY_POLLS)) {
            polls++;
        }
        if (polls < HG_BOARD_SAY_POLLS) {
            *byte_at(UART) = (uint8_t)*c;
        }
    }
}

int hg_board_key(void)
{
    return ((*byte_at(UART + UART_LSR) & LSR_READY) != 0U) ? (int)*byte_at(UART) : -1;
}

/* The two halves are read again when the upper one has moved between them: at most twice, as it moves every seven minutes. */
uint64_t hg_board_now_us(void)
{
    uint32_t high;
    uint32_t low;

    do {
        high = *word_at(MTIME + 4U);
        low = *word_at(MTIME);
    } while (high != *word_at(MTIME + 4U));
    return (((uint64_t)high << 32) | low) / MTIME_TICKS_PER_US;
}

_Noreturn void hg_board_leave(uint32_t status)
{
    *word_at(TEST_DEVICE) = (status == 0U) ? TEST_PASS : ((status << 16) | TEST_FAIL);
    for (;;) {
    }
}

/* ---- CAN ---- */

static bool open_card(void)
{
    for (uint32_t i = 0U; i < DEVICES; i++) {
        const uintptr_t device = ECAM + (i * DEVICE_STRIDE);
        if (*word_at(device) == CARD) {
            *word_at(device + 0x10U) = WINDOW_BRIDGE;
            *word_at(device + 0x14U) = WINDOW_CORES;
            *word_at(device + 0x04U) = COMMAND_MEMORY;
            return true;
        }
    }
    return false;
}

bool hg_board_place(uint8_t number, hg_controller_place *place)
{
    *place = (hg_controller_place){.type = &hg_ctucan, .base = WINDOW_CORES + (number * CORE_STRIDE), .timing = {TIMING, TIMING_FD}};
    return open_card();
}
