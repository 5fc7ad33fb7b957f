# The node on vcan: a sender and a reference timer in C for test_timing.py. `make pytest` runs what is in this folder.

BUS_TIMER := $(BUILD)/node/bus_timer
BUS_TIMER_OBJECTS := $(patsubst %.c,$(BUILD)/apps-f32/%.o,$(wildcard firmware/src/*.c firmware/models/*.c hal/socketcan/*.c))
OBJECTS += $(BUS_TIMER).o

$(BUS_TIMER).o: tests/node/bus_timer.c tests/node/node.mk
	@mkdir -p $(@D)
	$(Q)$(CC) $(WARN) $(OPTIMISE) $(REAL_FLAG_f32) $(INCLUDE) -Ihal/socketcan $(DEPEND) -c $< -o $@
$(BUS_TIMER): $(BUS_TIMER).o $(BUS_TIMER_OBJECTS)
	$(Q)$(CC) -o $@ $^

pytest: $(BUS_TIMER)
