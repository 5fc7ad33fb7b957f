# Cortex-M3: no FPU. QEMU's mps2-an385.
FAMILY_cortex_m3     := cortex_m
MACHINE_cortex_m3    := -mcpu=cortex-m3 -mthumb -mfloat-abi=soft
MEMORY_cortex_m3     := ROM=0x00000000 ROM_SIZE=1M RAM=0x20000000 RAM_SIZE=4M
RUN_cortex_m3        := qemu-system-arm -M mps2-an385 $(SEMIHOSTING)
