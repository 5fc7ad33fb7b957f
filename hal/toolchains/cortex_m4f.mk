# Cortex-M4F: single-precision FPU. QEMU's mps2-an386.
CROSS_cortex_m4f     := arm-none-eabi-
MACHINE_cortex_m4f   := -mcpu=cortex-m4 -mthumb -mfpu=fpv4-sp-d16 -mfloat-abi=hard
INTEGER_cortex_m4f   := -mgeneral-regs-only
REAL_cortex_m4f      := f32
ENDIAN_cortex_m4f    := little
LIBC_cortex_m4f      := newlib
START_cortex_m4f     := hal/cortex_m/start.c
MEMORY_cortex_m4f    := ROM=0x00000000 ROM_SIZE=1M RAM=0x20000000 RAM_SIZE=4M
RUN_cortex_m4f       := qemu-system-arm -M mps2-an386 $(SEMIHOSTING)
