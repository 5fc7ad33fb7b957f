# make coverage: line and branch coverage of the library by its unit tests, both number types merged; less than all of it is an error.

COVERAGE := $(BUILD)/coverage
GCOVR    ?= .venv/bin/gcovr
COVERED  := $(LIB_SRC) $(MODEL_SRC) $(HOST_HAL_SRC)
REPORT   := $(GCOVR) --root . --filter 'firmware/src/' --filter 'firmware/include/'

.PHONY: coverage
coverage: $(FLOATS:%=$(COVERAGE)/%/ran) ## line and branch coverage of the library by the unit tests; fails below 100 %
	@$(REPORT) --json $(COVERAGE)/all.json $(COVERAGE)
	@$(REPORT) --add-tracefile $(COVERAGE)/all.json --txt-metric branch --txt
	@$(REPORT) --add-tracefile $(COVERAGE)/all.json --fail-under-line 100 --fail-under-branch 100 --txt

# Counters of an earlier run are removed: they may belong to code that is no longer there.
define coverage_variant
$(eval $(call objects,$(COVERAGE)/$(1),$(COVERED) $(UNIT_TESTS:%=tests/unit/%.c),$$(CC) -O0 -g --coverage $(REAL_FLAG_$(1))))
$(UNIT_TESTS:%=$(COVERAGE)/$(1)/%): $(COVERAGE)/$(1)/%: $(COVERAGE)/$(1)/tests/unit/%.o $(COVERED:%.c=$(COVERAGE)/$(1)/%.o)
	$$(Q)$$(CC) --coverage -o $$@ $$^ -lcmocka -lm
$(COVERAGE)/$(1)/ran: $(UNIT_TESTS:%=$(COVERAGE)/$(1)/%)
	@find $(COVERAGE)/$(1) -name '*.gcda' -delete
	@for test in $$^; do $$$$test >$$$$test.log 2>&1 || { cat $$$$test.log; echo "FAILED $$$$test"; exit 1; }; done
	@touch $$@
endef
$(foreach r,$(FLOATS),$(eval $(call coverage_variant,$(r))))
