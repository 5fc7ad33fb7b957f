/* Cortex-R5F from reset to hg_start(): vectors, the stack pointer, the FPU: off in fixed point, so that what touches it traps. Stays in supervisor mode, interrupts off. */
    .syntax unified
    .arm
    .section .hg_reset, "ax"
    .global hg_reset
hg_reset:
    ldr pc, =begin
    ldr pc, =hg_stop        @ undefined instruction
    ldr pc, =hg_stop        @ supervisor call
    ldr pc, =hg_stop        @ prefetch abort
    ldr pc, =hg_stop        @ data abort
    ldr pc, =hg_stop        @ reserved
    ldr pc, =hg_stop        @ interrupt
    ldr pc, =hg_stop        @ fast interrupt
begin:
    ldr sp, =hg_stack
#ifndef HG_REAL_Q31
    mrc p15, 0, r0, c1, c0, 2
    orr r0, r0, #(0xF << 20) @ CPACR: cp10 and cp11, the FPU, for all
    mcr p15, 0, r0, c1, c0, 2
    isb
    mov r0, #0x40000000      @ FPEXC.EN
    vmsr fpexc, r0
#endif
    b hg_start
    .ltorg
