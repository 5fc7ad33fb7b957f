# Big-endian PowerPC with an FPU, by the compiler for Linux: the image is bare (flash and RAM where the MPC5xxx have them) and runs nowhere here;
# tests are static Linux programs under qemu-user.
CROSS_powerpc        := powerpc-linux-gnu-
MACHINE_powerpc      := -mcpu=powerpc -mbig-endian -mhard-float -msdata=none -fno-pie -fno-stack-protector
ENDIAN_powerpc       := big
LIBC_powerpc         := glibc
START_powerpc        := hal/start/powerpc.S
MEMORY_powerpc       := ROM=0x00000000 ROM_SIZE=1M RAM=0x40000000 RAM_SIZE=64K
RUN_powerpc          := qemu-ppc
