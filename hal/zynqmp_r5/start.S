/* Start of an image for one Cortex-R5F: exceptions end the program, the FPU is on, memory that C expects to be zero is, and main() gets a stack.
 * The image is loaded whole into RAM, so there is no initialised data to copy. FPSCR is 0 after reset: round to nearest, subnormals kept, as
 * on the host. Caches and MPU stay off: tightly coupled memory needs neither. */
    .syntax unified
    .arm
    .fpu vfpv3-d16
    .section .vectors, "ax"
    .global _start
_start:
    ldr pc, =reset
    .rept 7
    ldr pc, =trap
    .endr
    .ltorg
    .text
reset:
    ldr sp, =_stack
    mrc p15, 0, r0, c1, c0, 2      @ CPACR: allow cp10 and cp11
    orr r0, r0, #(0xF << 20)
    mcr p15, 0, r0, c1, c0, 2
    isb
    mov r0, #0x40000000            @ FPEXC.EN
    vmsr fpexc, r0
    mov r0, #0
    vmsr fpscr, r0
    ldr r0, =_bss
    ldr r1, =_ebss
    mov r2, #0
1:  cmp r0, r1
    strlo r2, [r0], #4
    blo 1b
    bl main
    and r0, r0, #0xFF
    b hg_board_leave
trap:
    ldr sp, =_stack
    mov r0, #70                    @ an exception: a bug in the image
    b hg_board_leave
