/* RV32 from reset to hg_start(): hart 0 alone, traps, the stack pointer, the FPU: off in fixed point, so that what touches it traps. */
    .option arch, +zicsr    # named here, not in the flags: the compiler has no libgcc for the long name of the same set
    .section .hg_reset, "ax"
    .global hg_reset
hg_reset:
    csrr t0, mhartid
    bnez t0, others
    la t0, trap
    csrw mtvec, t0
    la sp, hg_stack
#if defined(__riscv_flen) && !defined(HG_REAL_Q31)
    li t0, 0x2000           # mstatus.FS = initial
    csrs mstatus, t0
    fscsr zero              # round to nearest
#endif
    j hg_start
others:
    wfi
    j others
    .balign 4
trap:
    j hg_stop
