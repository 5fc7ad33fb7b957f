/* PowerPC from reset to hg_start(): the stack pointer and the FPU, which stays off in fixed point. A board puts its boot header and its memory controller before this. */
    .section .hg_reset, "ax"
    .global hg_reset
hg_reset:
    lis 1, hg_stack@ha
    addi 1, 1, hg_stack@l
    li 0, 0
    stwu 0, -16(1)          /* the end of the chain of frames */
#ifndef HG_REAL_Q31
    mfmsr 3
    ori 3, 3, 0x2000        /* MSR.FP */
    mtmsr 3
    isync
#endif
    b hg_start
    .section .note.GNU-stack, "", %progbits /* else the linker for Linux asks whether the stack is to be executable */
