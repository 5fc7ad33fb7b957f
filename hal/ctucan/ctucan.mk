# RISC-V (rv32imac, no FPU) on QEMU's virt machine with a CTU CAN FD card.

BOARD_CC_ctucan := riscv64-unknown-elf-gcc
BOARD_ARCH_ctucan := -march=rv32imac -mabi=ilp32 -mcmodel=medany -DHG_CTUCAN_QEMU=1
BOARD_SRC_ctucan := $(wildcard hal/ctucan/*.c hal/ctucan/*.S)
BOARD_SCRIPT_ctucan := hal/ctucan/virt.ld

$(eval $(call board_rules,ctucan))
$(eval $(call board_image,ctucan,detector,firmware/apps/detector_board.c))
$(eval $(call board_image,ctucan,sensor,firmware/apps/sensor_board.c))
