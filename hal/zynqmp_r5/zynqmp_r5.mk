# Cortex-R5F of a Zynq UltraScale+, on QEMU's xlnx-zcu102.

BOARD_CC_zynqmp_r5 := arm-none-eabi-gcc
BOARD_ARCH_zynqmp_r5 := -mcpu=cortex-r5 -mfpu=vfpv3-d16 -mfloat-abi=hard -marm -DHG_ZYNQMP_QEMU=1
BOARD_SRC_zynqmp_r5 := $(wildcard hal/zynqmp_r5/*.c hal/zynqmp_r5/*.S)
BOARD_SCRIPT_zynqmp_r5 := hal/zynqmp_r5/r5.ld

$(eval $(call board_rules,zynqmp_r5))
$(eval $(call board_image,zynqmp_r5,detector,firmware/apps/detector_board.c))
$(eval $(call board_image,zynqmp_r5,sensor,firmware/apps/sensor_board.c))

$(BOARDS)/zynqmp_r5/cpu_on.bin: $(BOARDS)/zynqmp_r5/o/hal/zynqmp_r5/qemu/cpu_on.o
	$(Q)arm-none-eabi-objcopy -O binary -j .text $< $@
boards-images: $(BOARDS)/zynqmp_r5/cpu_on.bin
