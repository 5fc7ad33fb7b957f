# make firmware: for every hal/toolchains/NAME.mk the library and a detector image, $(BUILD)/firmware/NAME/{libhullguard.a,detector.elf}.
# A toolchain file says, each with _NAME behind it:
#   CROSS    prefix of the compiler's programs         MACHINE  its flags
#   REAL     number type, f32 unless said              ENDIAN   big, or little unless said
#   START    source of the first instructions          MEMORY   symbols of hal/start/image.ld: where flash and RAM are
#   LIBC     C library that test programs may use: newlib (bare processor), glibc (Linux), none
#   RUN      emulator that takes a program; empty: none, and nothing but the contents of library and image is tested
#   FAMILY   hal/toolchains/family/NAME.mk, which says what is left out
# An image is linked with nothing but these objects and libgcc, so that a call of a C library's function does not link.

# For RUN: QEMU's machine has a console and an exit status by semihosting, and takes the program that comes behind.
SEMIHOSTING := -display none -monitor none -serial null -chardev stdio,id=console -semihosting-config enable=on,target=native,chardev=console -kernel

TOOLCHAINS := $(wildcard hal/toolchains/*.mk)
TARGETS    := $(sort $(basename $(notdir $(TOOLCHAINS))))
FAMILIES   := $(wildcard hal/toolchains/family/*.mk)
include $(TOOLCHAINS) $(FAMILIES)
$(foreach t,$(TARGETS),$(foreach v,CROSS LIBC START MEMORY RUN,$(eval $(v)_$(t) ?= $($(v)_$(FAMILY_$(t))))))
$(foreach t,$(TARGETS),$(eval REAL_$(t) ?= f32)$(eval ENDIAN_$(t) ?= little))

FIRMWARE     := $(BUILD)/firmware
FREESTANDING := -ffreestanding -isystem hal/toolchains/include $(OPTIMISE) -ffunction-sections -fdata-sections -fno-asynchronous-unwind-tables
IMAGE_SRC    := hal/start/start.c hal/start/memory.c
DETECTOR_SRC := firmware/apps/detector_main.c firmware/models/platoon.c hal/blank/blank.c

cross_cc   = $(CROSS_$(1))gcc $(MACHINE_$(1)) $(REAL_FLAG_$(REAL_$(1)))
image_link = -static -nostartfiles -Wl,--gc-sections -Wl,--fatal-warnings -Wl,--build-id=none -T hal/start/image.ld $(MEMORY_$(1):%=-Wl,--defsym=%)
image_objects = $(addprefix $(FIRMWARE)/$(1)/,$(addsuffix .o,$(basename $(START_$(1)) $(IMAGE_SRC) $(2))))

.PHONY: firmware
firmware: $(foreach t,$(TARGETS),$(FIRMWARE)/$(t)/libhullguard.a $(FIRMWARE)/$(t)/detector.elf) ## library and detector image for every processor: build/firmware/NAME/

# $(call assembly,FOLDER,SOURCES,COMMAND): as objects, for sources in assembly language.
define assembly
$(2:%.S=$(1)/%.o): $(1)/%.o: %.S Makefile
	@mkdir -p $$(@D)
	$$(Q)$(3) $$(INCLUDE) -c $$< -o $$@
endef

define firmware_target
$(eval $(call objects,$(FIRMWARE)/$(1),$(LIB_SRC) $(IMAGE_SRC) $(DETECTOR_SRC) $(filter %.c,$(START_$(1))),$$(call cross_cc,$(1)) $$(FREESTANDING)))
$(eval $(call assembly,$(FIRMWARE)/$(1),$(filter %.S,$(START_$(1))),$$(call cross_cc,$(1))))
$(eval $(call archive,$(FIRMWARE)/$(1)/libhullguard.a,$(FIRMWARE)/$(1),$(LIB_SRC)))
$(patsubst %.c,$(FIRMWARE)/$(1)/%.o,$(LIB_SRC) $(IMAGE_SRC) $(DETECTOR_SRC)) $(FIRMWARE)/$(1)/detector.elf: hal/toolchains/$(1).mk $(FAMILIES) hal/firmware.mk
$(FIRMWARE)/$(1)/libhullguard.a: AR := $(CROSS_$(1))ar
$(FIRMWARE)/$(1)/hal/start/memory.o: FREESTANDING += -fno-tree-loop-distribute-patterns
$(FIRMWARE)/$(1)/detector.elf: $(call image_objects,$(1),$(DETECTOR_SRC)) $(FIRMWARE)/$(1)/libhullguard.a hal/start/image.ld
	$$(Q)$$(call cross_cc,$(1)) $$(call image_link,$(1)) -nostdlib -o $$@ $$(filter %.o %.a,$$^) -lgcc
endef
$(foreach t,$(TARGETS),$(eval $(call firmware_target,$(t))))
