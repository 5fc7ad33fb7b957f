/* A Zynq UltraScale+ whose first R5 runs this image: hal/board/board.h on UART 0, the processor's cycle counter and both CAN controllers. */
#include "board.h"

#include "port.h"
#include "zynqmp_can.h"

#define UART 0xFF000000UL
#define UART_CONTROL 0x00U
#define UART_STATUS 0x2CU
#define UART_FIFO 0x30U
#define UART_ENABLE 0x14UL   /* both directions */
#define STATUS_NOTHING 0x02U
#define STATUS_FULL 0x10U
#define CAN 0xFF060000UL
#define CAN_STRIDE 0x10000UL

/* 500 kbit/s at 100 MHz: prescaler 10, 1 + 15 + 4 quanta, sample point 80 %. */
#define PRESCALER 9UL
#define TIMING ((14UL << 0) | (3UL << 4) | (2UL << 7))

#define CYCLES_PER_TICK 64U  /* PMCR.D: the counter's 32 bits then last minutes */

static volatile uint32_t *word_at(uintptr_t address)
{
    return (volatile uint32_t *)address;
}

/* ---- console ---- */

void hg_board_say(const char *text)
{
    *word_at(UART + UART_CONTROL) = UART_ENABLE;
    for (const char *c = text; *c != '\0'; c++) {
        uint32_t polls = 0U;
        while (((*word_at(UART + UART_STATUS) & STATUS_FULL) != 0U) && (polls < HG_BOARD_SAY_POLLS)) {
            polls++;
        }
        if (polls < HG_BOARD_SAY_POLLS) {
            *word_at(UART + UART_FIFO) = (uint8_t)*c;
        }
    }
}

int hg_board_key(void)
{
    return ((*word_at(UART + UART_STATUS) & STATUS_NOTHING) == 0U) ? (int)(*word_at(UART + UART_FIFO) & 0xFFU) : -1;
}

/* ---- clock ---- */

static struct {
    uint64_t ticks;
    uint32_t last;
    bool     running;
} timer;

static uint32_t read_counter(void)
{
    uint32_t count;
    __asm__ volatile("mrc p15, 0, %0, c9, c13, 0" : "=r"(count)); /* PMCCNTR */
    return count;
}

static void start_counter(void)
{
    __asm__ volatile("mcr p15, 0, %0, c9, c12, 0" ::"r"(0xDU));        /* PMCR: enable, reset the cycle counter, divide by 64 */
    __asm__ volatile("mcr p15, 0, %0, c9, c12, 1" ::"r"(0x80000000UL)); /* PMCNTENSET: the cycle counter */
    timer.running = true;
}

/* Must be called at least once in the time that the counter needs to go round, 275 s at 1 GHz; every wait does. */
uint64_t hg_board_now_us(void)
{
    if (!timer.running) {
        start_counter();
    }
    const uint32_t now = read_counter();
    timer.ticks += now - timer.last;
    timer.last = now;
    return (timer.ticks * CYCLES_PER_TICK) / HG_ZYNQMP_PROCESSOR_MHZ;
}

/* ---- end ---- */

_Noreturn void hg_board_leave(uint32_t status)
{
#if HG_ZYNQMP_QEMU
    const uint32_t block[2] = {0x20026UL, status}; /* ADP_Stopped_ApplicationExit */
    __asm__ volatile("mov r0, %0\n mov r1, %1\n svc 0x123456" ::"r"(0x20U), "r"(block) : "r0", "r1", "memory"); /* SYS_EXIT_EXTENDED */
#else
    (void)status;
#endif
    for (;;) {
        __asm__ volatile("wfi");
    }
}

/* ---- CAN ---- */

bool hg_board_place(uint8_t number, hg_controller_place *place)
{
    *place = (hg_controller_place){.type = &hg_zynqmp_can, .base = CAN + (number * CAN_STRIDE), .timing = {PRESCALER, TIMING}};
    return true;
}
