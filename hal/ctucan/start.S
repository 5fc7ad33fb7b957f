/* Start of an image for one RISC-V hart in machine mode: traps end the program, memory that C expects to be zero is, and main() gets a stack.
 * The image is loaded whole into RAM, so there is no initialised data to copy. */
    .option arch, +zicsr
    .section .start, "ax"
    .global _start
_start:
    csrr t0, mhartid
    bnez t0, park
    la t0, trap
    csrw mtvec, t0
    csrw mie, zero
    la sp, _stack
    la t0, _bss
    la t1, _ebss
1:  bgeu t0, t1, 2f
    sw zero, 0(t0)
    addi t0, t0, 4
    j 1b
2:  call main
    andi a0, a0, 0xFF
    call hg_board_leave
park:
    wfi
    j park
    .balign 4
trap:
    li a0, 70               /* an exception: a bug in the image */
    call hg_board_leave
