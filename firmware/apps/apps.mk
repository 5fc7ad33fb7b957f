# Linux programs over hal/socketcan. Included by the top Makefile; works on its own too: make -f firmware/apps/apps.mk apps

BUILD ?= build
APPS_WARN := -std=c11 -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wdouble-promotion -Wfloat-equal -Wstrict-prototypes \
             -Wmissing-prototypes -Wshadow -Wcast-align -Wvla -Wundef -Wswitch-enum -ffp-contract=off -Werror
APPS_FLAGS := -O2 -g -Ifirmware/include -Ifirmware/models -Ifirmware/apps -Ihal -Ihal/socketcan -MMD -MP
APPS_COMMON := $(wildcard firmware/src/*.c firmware/models/*.c hal/socketcan/*.c) firmware/apps/models.c firmware/apps/tracker_models.c firmware/apps/units.c
APPS_OBJECTS_f32 := $(patsubst %.c,$(BUILD)/apps-f32/%.o,$(APPS_COMMON))
APPS_OBJECTS_f64 := $(patsubst %.c,$(BUILD)/apps-f64/%.o,$(APPS_COMMON))

.PHONY: apps
apps: $(BUILD)/bin/detector_node $(BUILD)/bin/detector_node_f64 ## Linux programs: build/bin/detector_node and detector_node_f64

$(BUILD)/apps-f32/%.o: %.c
	@mkdir -p $(@D)
	$(Q)$(CC) $(APPS_WARN) $(APPS_FLAGS) -DHG_REAL_F32=1 -c $< -o $@
$(BUILD)/apps-f64/%.o: %.c
	@mkdir -p $(@D)
	$(Q)$(CC) $(APPS_WARN) $(APPS_FLAGS) -DHG_REAL_F64=1 -c $< -o $@

$(BUILD)/bin/%_node: $(BUILD)/apps-f32/firmware/apps/%_node.o $(APPS_OBJECTS_f32)
	@mkdir -p $(@D)
	$(Q)$(CC) -o $@ $^
$(BUILD)/bin/%_node_f64: $(BUILD)/apps-f64/firmware/apps/%_node.o $(APPS_OBJECTS_f64)
	@mkdir -p $(@D)
	$(Q)$(CC) -o $@ $^

.SECONDARY: $(APPS_OBJECTS_f32) $(APPS_OBJECTS_f64) $(foreach r,f32 f64,$(BUILD)/apps-$(r)/firmware/apps/detector_node.o)
-include $(wildcard $(BUILD)/apps-f32/*/*.d $(BUILD)/apps-f32/*/*/*.d $(BUILD)/apps-f64/*/*.d $(BUILD)/apps-f64/*/*/*.d)
