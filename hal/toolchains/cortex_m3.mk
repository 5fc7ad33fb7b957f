# Cortex-M3: no FPU. QEMU's mps2-an385.
CROSS_cortex_m3      := arm-none-eabi-
MACHINE_cortex_m3    := -mcpu=cortex-m3 -mthumb -mfloat-abi=soft
REAL_cortex_m3       := f32
ENDIAN_cortex_m3     := little
LIBC_cortex_m3       := newlib
START_cortex_m3      := hal/cortex_m/start.c
MEMORY_cortex_m3     := ROM=0x00000000 ROM_SIZE=1M RAM=0x20000000 RAM_SIZE=4M
RUN_cortex_m3        := qemu-system-arm -M mps2-an385 $(SEMIHOSTING)
