/* Cortex-M from reset to hg_start(): the vector table and the FPU. A board with interrupts has a table of its own, longer. */

#include "start/start.h"

#include <stdint.h>

#if defined(__ARM_FP) && !defined(HG_REAL_Q31)
#define FPU /* stays off in fixed point, so that what touches it traps */
#define CPACR (*(volatile uint32_t *)0xE000ED88UL)
#define CPACR_FPU (0xFUL << 20U) /* coprocessors 10 and 11, for all */
#endif

extern uint32_t hg_stack[];
_Noreturn void hg_reset(void);

typedef union {
    uint32_t *stack;
    void    (*handler)(void);
} vector;

/* The processor takes its stack pointer and its first instruction from here; then the exceptions of ARMv6-M, v7-M and v8-M. */
__attribute__((section(".hg_reset"), used)) static const vector vectors[16] = {
    [0] = {.stack = hg_stack},
    [1] = {.handler = hg_reset},
    [2] = {.handler = hg_stop},  /* NMI */
    [3] = {.handler = hg_stop},  /* hard fault */
    [4] = {.handler = hg_stop},  /* memory management */
    [5] = {.handler = hg_stop},  /* bus fault */
    [6] = {.handler = hg_stop},  /* usage fault */
    [7] = {.handler = hg_stop},  /* secure fault */
    [11] = {.handler = hg_stop}, /* supervisor call */
    [12] = {.handler = hg_stop}, /* debug monitor */
    [14] = {.handler = hg_stop}, /* pending supervisor call */
    [15] = {.handler = hg_stop}  /* system tick */
};

_Noreturn void hg_reset(void)
{
#ifdef FPU
    CPACR |= CPACR_FPU;
    __asm__ volatile("dsb\n\tisb" ::: "memory"); /* on before the next floating-point instruction */
#endif
    hg_start();
}
