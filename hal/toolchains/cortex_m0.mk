# Cortex-M0: no FPU, no divide instruction. QEMU's microbit has 256 KB of flash and 16 KB of RAM.
CROSS_cortex_m0      := arm-none-eabi-
MACHINE_cortex_m0    := -mcpu=cortex-m0 -mthumb -mfloat-abi=soft
REAL_cortex_m0       := f32
ENDIAN_cortex_m0     := little
LIBC_cortex_m0       := newlib
START_cortex_m0      := hal/cortex_m/start.c
MEMORY_cortex_m0     := ROM=0x00000000 ROM_SIZE=256K RAM=0x20000000 RAM_SIZE=16K
RUN_cortex_m0        := qemu-system-arm -M microbit $(SEMIHOSTING)
