# make coverage: line and branch coverage of the library by its unit tests, all builds merged; less than all of it is an error.

COVERAGE := $(BUILD)/coverage
GCOVR    ?= .venv/bin/gcovr
COVERAGE_BUILDS := $(FLOATS) $(UNIT_BUILDS)
# A function of real.h stands there once for each number type.
REPORT   := $(GCOVR) --root . --merge-mode-functions separate --filter 'firmware/src/' --filter 'firmware/include/'

.PHONY: coverage
coverage: $(COVERAGE_BUILDS:%=$(COVERAGE)/%/ran) ## line and branch coverage of the library by the unit tests; fails below 100 %
	@$(REPORT) --json $(COVERAGE)/all.json $(COVERAGE)
	@$(REPORT) --add-tracefile $(COVERAGE)/all.json --txt-metric branch --txt
	@$(REPORT) --add-tracefile $(COVERAGE)/all.json --fail-under-line 100 --fail-under-branch 100 --txt

# Counters of an earlier run are removed: they may belong to code that is no longer there.
define coverage_variant
$(eval $(call objects,$(COVERAGE)/$(1),$(call unit_src,$(1)) $(patsubst %,tests/unit/%.c,$(call unit_tests,$(1))),$$(CC) -O0 -g --coverage $(REAL_FLAG_$(1))))
$(patsubst %,$(COVERAGE)/$(1)/%,$(call unit_tests,$(1))): $(COVERAGE)/$(1)/%: $(COVERAGE)/$(1)/tests/unit/%.o $(patsubst %.c,$(COVERAGE)/$(1)/%.o,$(call unit_src,$(1)))
	$$(Q)$$(CC) --coverage -o $$@ $$^ -lcmocka -lm
$(COVERAGE)/$(1)/ran: $(patsubst %,$(COVERAGE)/$(1)/%,$(call unit_tests,$(1)))
	@find $(COVERAGE)/$(1) -name '*.gcda' -delete
	@for test in $$^; do $$$$test >$$$$test.log 2>&1 || { cat $$$$test.log; echo "FAILED $$$$test"; exit 1; }; done
	@touch $$@
endef
$(foreach r,$(COVERAGE_BUILDS),$(eval $(call coverage_variant,$(r))))
