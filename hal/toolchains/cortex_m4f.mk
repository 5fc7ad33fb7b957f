# Cortex-M4F: single-precision FPU. QEMU's mps2-an386.
FAMILY_cortex_m4f    := cortex_m
MACHINE_cortex_m4f   := -mcpu=cortex-m4 -mthumb -mfpu=fpv4-sp-d16 -mfloat-abi=hard
MEMORY_cortex_m4f    := ROM=0x00000000 ROM_SIZE=1M RAM=0x20000000 RAM_SIZE=4M
RUN_cortex_m4f       := qemu-system-arm -M mps2-an386 $(SEMIHOSTING)
