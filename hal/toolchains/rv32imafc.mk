# RV32IMAFC: single-precision FPU. QEMU's virt. The compiler comes without a C library.
CROSS_rv32imafc      := riscv64-unknown-elf-
MACHINE_rv32imafc    := -march=rv32imafc -mabi=ilp32f -mcmodel=medany
REAL_rv32imafc       := f32
ENDIAN_rv32imafc     := little
LIBC_rv32imafc       := none
START_rv32imafc      := hal/start/rv32.S
MEMORY_rv32imafc     := ROM=0x80000000 ROM_SIZE=1M RAM=0x80100000 RAM_SIZE=256K
RUN_rv32imafc        := qemu-system-riscv32 -M virt -bios none $(SEMIHOSTING)
