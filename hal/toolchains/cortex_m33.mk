# Cortex-M33: single-precision FPU. QEMU's mps2-an505, which starts in its secure memory.
CROSS_cortex_m33     := arm-none-eabi-
MACHINE_cortex_m33   := -mcpu=cortex-m33 -mthumb -mfpu=fpv5-sp-d16 -mfloat-abi=hard
INTEGER_cortex_m33   := -mgeneral-regs-only
REAL_cortex_m33      := f32
ENDIAN_cortex_m33    := little
LIBC_cortex_m33      := newlib
START_cortex_m33     := hal/cortex_m/start.c
MEMORY_cortex_m33    := ROM=0x10000000 ROM_SIZE=1M RAM=0x38000000 RAM_SIZE=4M
RUN_cortex_m33       := qemu-system-arm -M mps2-an505 $(SEMIHOSTING)
