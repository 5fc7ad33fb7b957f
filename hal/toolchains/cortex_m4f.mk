# Cortex-M4F: single-precision FPU. QEMU's mps2-an386. Tuned for this core gcc does without vmla.f32, which rounds as vmul and vadd do; with it a
# detector step is a tenth fewer instructions. ARM's manual has 3 cycles for it and 1 for either of the two: for speed on silicon measure both.
FAMILY_cortex_m4f    := cortex_m
MACHINE_cortex_m4f   := -mcpu=cortex-m4 -mthumb -mfpu=fpv4-sp-d16 -mfloat-abi=hard -mtune=generic-armv7-a
INTEGER_cortex_m4f   := -mgeneral-regs-only
MEMORY_cortex_m4f    := ROM=0x00000000 ROM_SIZE=1M RAM=0x20000000 RAM_SIZE=4M
RUN_cortex_m4f       := qemu-system-arm -M mps2-an386 $(SEMIHOSTING)
