# Cortex-M7 with its single-precision FPU. QEMU's mps2-an500.
FAMILY_cortex_m7     := cortex_m
MACHINE_cortex_m7    := -mcpu=cortex-m7 -mthumb -mfpu=fpv5-sp-d16 -mfloat-abi=hard
MEMORY_cortex_m7     := ROM=0x00000000 ROM_SIZE=1M RAM=0x20000000 RAM_SIZE=4M
RUN_cortex_m7        := qemu-system-arm -M mps2-an500 $(SEMIHOSTING)
