# The node on vcan: a sender and a reference timer in C for test_timing.py; and detector_node in virtual time. `make pytest-node` runs what is in this
# folder.

BUS_TIMER := $(BUILD)/node/bus_timer
BUS_TIMER_OBJECTS := $(patsubst %.c,$(BUILD)/apps-f32/%.o,$(wildcard firmware/src/*.c firmware/models/*.c hal/socketcan/*.c))
VIRTUAL_NODE := $(BUILD)/node/virtual_node
VIRTUAL_NODE_OBJECTS := $(patsubst %.c,$(BUILD)/apps-f32/%.o,$(wildcard firmware/src/*.c firmware/models/*.c hal/loopback/*.c) $(patsubst %,firmware/apps/%.c,models tracker_models units))
OBJECTS += $(BUS_TIMER).o $(VIRTUAL_NODE).o

$(BUS_TIMER).o $(VIRTUAL_NODE).o: $(BUILD)/node/%.o: tests/node/%.c tests/node/node.mk
	@mkdir -p $(@D)
	$(Q)$(CC) $(WARN) $(OPTIMISE) $(REAL_FLAG_f32) $(INCLUDE) -Ifirmware/apps -Ihal/socketcan -Ihal/loopback $(DEPEND) -c $< -o $@
$(BUS_TIMER): $(BUS_TIMER).o $(BUS_TIMER_OBJECTS)
	$(Q)$(CC) -o $@ $^
$(VIRTUAL_NODE): $(VIRTUAL_NODE).o $(VIRTUAL_NODE_OBJECTS)
	$(Q)$(CC) -o $@ $^

pytest-node: $(BUS_TIMER) $(VIRTUAL_NODE)
