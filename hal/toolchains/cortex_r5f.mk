# Cortex-R5F, A32. QEMU's integratorcp takes any 32-bit ARM core, which is enough for programs without a CAN controller.
CROSS_cortex_r5f     := arm-none-eabi-
MACHINE_cortex_r5f   := -mcpu=cortex-r5 -mfpu=vfpv3-d16 -mfloat-abi=hard -marm
LIBC_cortex_r5f      := newlib
START_cortex_r5f     := hal/start/cortex_r5f.S
MEMORY_cortex_r5f    := ROM=0x00000000 ROM_SIZE=1M RAM=0x00100000 RAM_SIZE=4M
RUN_cortex_r5f       := qemu-system-arm -M integratorcp -cpu cortex-r5f $(SEMIHOSTING)
