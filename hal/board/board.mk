# Images for boards without operating system, build/boards/BOARD/NAME.elf. Each board's own .mk sets its compiler and flags and calls `board_image`
# for every main. Included before them: `board` sorts first.

BOARDS := $(BUILD)/boards
BOARD_WARN := -std=c11 -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wdouble-promotion -Wfloat-equal -Wstrict-prototypes \
              -Wmissing-prototypes -Wshadow -Wcast-align -Wvla -Wundef -Wswitch-enum -ffp-contract=off -Werror
BOARD_FLAGS := -O2 -g -ffreestanding -ffunction-sections -fdata-sections -fno-common -DHG_REAL_F32=1 \
               -isystem hal/board/include -Ifirmware/include -Ifirmware/models -Ihal -Ihal/board -MMD -MP
BOARD_LINK := -nostdlib -nostartfiles -static -Wl,--gc-sections -Wl,--no-warn-rwx-segments
BOARD_LIB_SRC := $(wildcard firmware/src/*.c) firmware/models/platoon.c $(wildcard hal/board/*.c)

.PHONY: boards-images
boards-images: ## bare-metal images: build/boards/BOARD/*.elf

# $(call board_objects,BOARD,SOURCES): the objects of an image.
board_objects = $(patsubst %,$(BOARDS)/$(1)/o/%.o,$(basename $(2)))

# $(call board_rules,BOARD): how the board's sources are compiled; BOARD_CC_$(1), BOARD_ARCH_$(1), BOARD_SRC_$(1), BOARD_SCRIPT_$(1).
define board_rules
$(BOARDS)/$(1)/o/hal/board/string.o: BOARD_MORE := -fno-tree-loop-distribute-patterns -fno-builtin
$(BOARDS)/$(1)/o/%.o: %.c hal/board/board.mk hal/$(1)/$(1).mk
	@mkdir -p $$(@D)
	$$(Q)$$(BOARD_CC_$(1)) $$(BOARD_ARCH_$(1)) $$(BOARD_WARN) $$(BOARD_FLAGS) -Ihal/$(1) $$(BOARD_MORE) -c $$< -o $$@
$(BOARDS)/$(1)/o/%.o: %.S hal/board/board.mk hal/$(1)/$(1).mk
	@mkdir -p $$(@D)
	$$(Q)$$(BOARD_CC_$(1)) $$(BOARD_ARCH_$(1)) -c $$< -o $$@
-include $(patsubst %.o,%.d,$(call board_objects,$(1),$(BOARD_LIB_SRC) $(BOARD_SRC_$(1))))
endef

# $(call board_image,BOARD,NAME,SOURCES): build/boards/BOARD/NAME.elf of a main's sources, the library and the board.
define board_image
$(BOARDS)/$(1)/$(2).elf: $(call board_objects,$(1),$(3) $(BOARD_LIB_SRC) $(BOARD_SRC_$(1))) $(BOARD_SCRIPT_$(1))
	$$(Q)$$(BOARD_CC_$(1)) $$(BOARD_ARCH_$(1)) $$(BOARD_LINK) -Wl,-T,$(BOARD_SCRIPT_$(1)) -o $$@ $$(filter %.o,$$^) -lgcc
boards-images: $(BOARDS)/$(1)/$(2).elf
-include $(patsubst %.o,%.d,$(call board_objects,$(1),$(3)))
endef
