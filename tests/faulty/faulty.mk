# Faulty frames of every action: in process under AddressSanitizer and UBSan, and on vcan against a node that is a process of its own (UBSan: the
# shadow memory of AddressSanitizer does not fit into a guest). `make check` makes few of them, `make faulty` 10^6 and 10^5.

FAULTY_RUNS := 170
FAULTY_OPTIONS := --inject all --samples 300 --scenario manoeuvres --fault controller1:bias:2@120
FAULTY_LIB := $(BUILD)/faulty/lib
FAULTY_NODE := $(BUILD)/faulty/detector_node

$(eval $(call objects,$(BUILD)/faulty/shared,$(LIB_SRC) $(CORE_SRC),$$(CC) $$(SANITIZE),address -fPIC $(REAL_FLAG_f32)))
$(FAULTY_LIB)/libhullguard_f32.so: $(patsubst %.c,$(BUILD)/faulty/shared/%.o,$(LIB_SRC) $(CORE_SRC))
	@mkdir -p $(@D)
	$(Q)$(CC) -shared -fsanitize=undefined,address -o $@ $^ -lm
$(FAULTY_LIB)/hullguard_f32.i: $(BUILD)/lib/hullguard_f32.i $(FAULTY_LIB)/libhullguard_f32.so
	@cp $< $@

FAULTY_NODE_SRC := $(LIB_SRC) $(MODEL_SRC) $(wildcard hal/socketcan/*.c) $(patsubst %,firmware/apps/%.c,models tracker_models units detector_node)
$(eval $(call objects,$(BUILD)/faulty/node,$(FAULTY_NODE_SRC),$$(CC) $$(SANITIZE) -Ifirmware/apps -Ihal/socketcan $(REAL_FLAG_f32)))
$(FAULTY_NODE): $(FAULTY_NODE_SRC:%.c=$(BUILD)/faulty/node/%.o)
	$(Q)$(CC) -fsanitize=undefined -o $@ $^

FAULTY_SANITIZED = HULLGUARD_LIB=$(FAULTY_LIB) LD_PRELOAD=$$($(CC) -print-file-name=libasan.so) ASAN_OPTIONS=detect_leaks=0
FAULTY_BUILT := $(FAULTY_LIB)/hullguard_f32.i $(FAULTY_NODE) $(WITH_VCAN)

# $(call faulty_run,RUNS,FRAMES ON VCAN,OF EACH DIRECTIVE)
define faulty_run
$(FAULTY_SANITIZED) $(PY) -m hullguard campaign platoon $(FAULTY_OPTIONS) --runs $(1) --out $(BUILD)/faulty/out $(2)
endef
faulty_vcan = $(WITH_VCAN) -t 0 $(PY) tests/faulty/vcan_inside.py $(abspath $(FAULTY_NODE)) $(abspath $(BUILD)/faulty) $(1) $(2)

.PHONY: faulty
faulty: lib $(FAULTY_BUILT) ## 10^6 faulty frames in process, 10^5 on vcan: counters against the ledger, alarms, faults found
	$(call faulty_run,$(FAULTY_RUNS))
	$(call faulty_vcan,100000,300)

.PHONY: faulty-short
faulty-short: lib $(FAULTY_BUILT)
	@$(call faulty_run,2,--quiet) && echo "  ok  faulty frames, sanitized"
	@$(call faulty_vcan,2000,5) >$(BUILD)/faulty/vcan.log 2>&1 || { cat $(BUILD)/faulty/vcan.log; exit 1; }
	@tail -n 1 $(BUILD)/faulty/vcan.log | sed 's/^/  ok  /'
	@$(RESULT) $@ 'whatever is done to frames, every counter of the node equals the ledger, no alarm is false, the fault is found, and no sanitizer has a finding' \
	    "$$(tail -n 1 $(BUILD)/faulty/vcan.log)"
CHECK_PARTS += faulty-short
