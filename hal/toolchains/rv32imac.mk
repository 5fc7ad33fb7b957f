# RV32IMAC: no FPU. QEMU's virt. The compiler comes without a C library.
CROSS_rv32imac       := riscv64-unknown-elf-
MACHINE_rv32imac     := -march=rv32imac -mabi=ilp32 -mcmodel=medany
REAL_rv32imac        := f32
ENDIAN_rv32imac      := little
LIBC_rv32imac        := none
START_rv32imac       := hal/start/rv32.S
MEMORY_rv32imac      := ROM=0x80000000 ROM_SIZE=1M RAM=0x80100000 RAM_SIZE=256K
RUN_rv32imac         := qemu-system-riscv32 -M virt -bios none $(SEMIHOSTING)
