# RISC-V with 32 bits, on QEMU's virt. The compiler comes without a C library.
CROSS_rv32  := riscv64-unknown-elf-
LIBC_rv32   := none
START_rv32  := hal/start/rv32.S
MEMORY_rv32 := ROM=0x80000000 ROM_SIZE=1M RAM=0x80100000 RAM_SIZE=256K
RUN_rv32    := qemu-system-riscv32 -M virt -bios none $(SEMIHOSTING)
