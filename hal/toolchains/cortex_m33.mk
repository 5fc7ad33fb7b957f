# Cortex-M33: single-precision FPU. QEMU's mps2-an505, which starts in its secure memory.
FAMILY_cortex_m33    := cortex_m
MACHINE_cortex_m33   := -mcpu=cortex-m33 -mthumb -mfpu=fpv5-sp-d16 -mfloat-abi=hard
MEMORY_cortex_m33    := ROM=0x10000000 ROM_SIZE=1M RAM=0x38000000 RAM_SIZE=4M
RUN_cortex_m33       := qemu-system-arm -M mps2-an505 $(SEMIHOSTING)
