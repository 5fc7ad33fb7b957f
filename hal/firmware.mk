# make firmware: for every hal/toolchains/NAME.mk the library and a detector image, $(BUILD)/firmware/NAME/{libhullguard.a,detector.elf}, and
# both once more in fixed point, NAME-q31. Rules of this file and of the target tests are for a build: NAME or NAME-q31.
# A toolchain file says, each with _NAME behind it:
#   CROSS    prefix of the compiler's programs         MACHINE  its flags
#   REAL     number type, f32 unless said              ENDIAN   big, or little unless said
#   INTEGER  flags that keep a fixed-point build off the FPU, where the compiler would move other things through it
#   START    source of the first instructions          MEMORY   symbols of hal/start/image.ld: where flash and RAM are
#   LIBC     C library that test programs may use: newlib (bare processor), glibc (Linux), none
#   RUN      emulator that takes a program; empty: none, and nothing but the contents of library and image is tested
#   FAMILY   hal/toolchains/family/NAME.mk, which says what is left out
# An image is linked with nothing but these objects and libgcc, so that a call of a C library's function does not link.

# For RUN: QEMU's machine has a console and an exit status by semihosting, and takes the program that comes behind.
SEMIHOSTING := -display none -monitor none -serial null -chardev stdio,id=console -semihosting-config enable=on,target=native,chardev=console -kernel

TOOLCHAINS := $(wildcard hal/toolchains/*.mk)
TARGETS    := $(sort $(basename $(notdir $(TOOLCHAINS))))
BUILDS     := $(foreach t,$(TARGETS),$(t) $(t)-q31)
FAMILIES   := $(wildcard hal/toolchains/family/*.mk)
include $(TOOLCHAINS) $(FAMILIES)
$(foreach t,$(TARGETS),$(foreach v,CROSS LIBC START MEMORY RUN,$(eval $(v)_$(t) ?= $($(v)_$(FAMILY_$(t))))))
$(foreach t,$(TARGETS),$(eval REAL_$(t) ?= f32)$(eval ENDIAN_$(t) ?= little))

FIRMWARE     := $(BUILD)/firmware
FREESTANDING := -ffreestanding -isystem hal/toolchains/include $(OPTIMISE) -ffunction-sections -fdata-sections -fno-asynchronous-unwind-tables
IMAGE_SRC    := hal/start/start.c hal/start/memory.c
DETECTOR_SRC := firmware/apps/detector_main.c firmware/models/platoon.c hal/blank/blank.c

target_of  = $(1:%-q31=%)
real_of    = $(if $(filter %-q31,$(1)),q31,$(REAL_$(1)))
build_cc   = $(CROSS_$(1))gcc $(MACHINE_$(1)) $(REAL_FLAG_$(2)) $(if $(filter q31,$(2)),$(INTEGER_$(1)))
cross_cc   = $(call build_cc,$(call target_of,$(1)),$(call real_of,$(1)))
image_link = -static -nostartfiles -Wl,--gc-sections -Wl,--fatal-warnings -Wl,--build-id=none -T hal/start/image.ld $(MEMORY_$(call target_of,$(1)):%=-Wl,--defsym=%)
image_objects = $(addprefix $(FIRMWARE)/$(1)/,$(addsuffix .o,$(basename $(START_$(call target_of,$(1))) $(IMAGE_SRC) $(2))))

.PHONY: firmware
firmware: $(foreach b,$(BUILDS),$(FIRMWARE)/$(b)/libhullguard.a $(FIRMWARE)/$(b)/detector.elf) ## library and detector image for every processor: build/firmware/NAME/

# $(call assembly,FOLDER,SOURCES,COMMAND): as objects, for sources in assembly language.
define assembly
$(2:%.S=$(1)/%.o): $(1)/%.o: %.S Makefile
	@mkdir -p $$(@D)
	$$(Q)$(3) $$(INCLUDE) -c $$< -o $$@
endef

# $(call firmware_build,BUILD,TARGET)
define firmware_build
$(eval $(call objects,$(FIRMWARE)/$(1),$(LIB_SRC) $(IMAGE_SRC) $(DETECTOR_SRC) $(filter %.c,$(START_$(2))),$$(call cross_cc,$(1)) $$(FREESTANDING)))
$(eval $(call assembly,$(FIRMWARE)/$(1),$(filter %.S,$(START_$(2))),$$(call cross_cc,$(1))))
$(eval $(call archive,$(FIRMWARE)/$(1)/libhullguard.a,$(FIRMWARE)/$(1),$(LIB_SRC)))
$(patsubst %.c,$(FIRMWARE)/$(1)/%.o,$(LIB_SRC) $(IMAGE_SRC) $(DETECTOR_SRC)) $(FIRMWARE)/$(1)/detector.elf: hal/toolchains/$(2).mk $(FAMILIES) hal/firmware.mk
$(FIRMWARE)/$(1)/libhullguard.a: AR := $(CROSS_$(2))ar
$(FIRMWARE)/$(1)/hal/start/memory.o: FREESTANDING += -fno-tree-loop-distribute-patterns
$(FIRMWARE)/$(1)/detector.elf: $(call image_objects,$(1),$(DETECTOR_SRC)) $(FIRMWARE)/$(1)/libhullguard.a hal/start/image.ld
	$$(Q)$$(call cross_cc,$(1)) $$(call image_link,$(1)) -nostdlib -o $$@ $$(filter %.o %.a,$$^) -lgcc
endef
$(foreach b,$(BUILDS),$(eval $(call firmware_build,$(b),$(call target_of,$(b)))))
