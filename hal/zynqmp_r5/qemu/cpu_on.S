/* QEMU 7.2 leaves the R5 off whatever boot-cpu says. These are eight words of A64 for the first A53, which calls PSCI CPU_ON(mpidr 4 = the first R5,
 * entry 0) and sleeps: mov x0,#3; movk x0,#0xC400,lsl #16; mov x1,#4; mov x2,#0; mov x3,#0; smc #0; 1: wfi; b 1b */
    .text
    .word 0xD2800060, 0xF2B88000, 0xD2800081, 0xD2800002, 0xD2800003, 0xD4000003, 0xD503207F, 0x17FFFFFF
