# Cortex-M0: no FPU, no divide instruction. QEMU's microbit has 256 KB of flash and 16 KB of RAM.
FAMILY_cortex_m0     := cortex_m
MACHINE_cortex_m0    := -mcpu=cortex-m0 -mthumb -mfloat-abi=soft
MEMORY_cortex_m0     := ROM=0x00000000 ROM_SIZE=256K RAM=0x20000000 RAM_SIZE=16K
RUN_cortex_m0        := qemu-system-arm -M microbit $(SEMIHOSTING)
