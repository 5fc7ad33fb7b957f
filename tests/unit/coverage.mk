# make coverage: lines, branches and conditions (MC/DC) of the library that its unit tests cover, all builds together; less than all is an error.

COVERAGE := $(BUILD)/coverage
COVERAGE_BUILDS := $(FLOATS) $(UNIT_BUILDS)
# No folder of this machine in what is compiled: a copy of the tree can go on with it.
COVERAGE_CC = $(CLANG) -O1 -g -ffile-compilation-dir=.
INSTRUMENT  = -fprofile-instr-generate -fcoverage-mapping -fcoverage-mcdc

.PHONY: coverage
coverage: tests/unit/coverage.py tests/unit/coverage.toml ## line, branch and MC/DC coverage of the library by the unit tests; fails below 100 %
	@$(PY) $< --results $(BUILD)/results/coverage.json $(COVERAGE) $(COVERAGE_BUILDS)

# $(call coverage_variant,BUILD): models and backends carry no counters. The tests do: what of a header only they call is compiled into them.
define coverage_variant
$(eval $(call objects,$(COVERAGE)/$(1),$(LIB_SRC) $(patsubst %,tests/unit/%.c,$(call unit_tests,$(1))),$$(COVERAGE_CC) $$(INSTRUMENT) $(REAL_FLAG_$(1))))
$(eval $(call objects,$(COVERAGE)/$(1),$(UNIT_MODELS_$(1)) $(HOST_HAL_SRC),$$(COVERAGE_CC) $(REAL_FLAG_$(1))))
$(patsubst %,$(COVERAGE)/$(1)/%,$(call unit_tests,$(1))): $(COVERAGE)/$(1)/%: $(COVERAGE)/$(1)/tests/unit/%.o $(patsubst %.c,$(COVERAGE)/$(1)/%.o,$(call unit_src,$(1)))
	$$(Q)$$(COVERAGE_CC) $$(INSTRUMENT) -o $$@ $$^ -lcmocka -lm
$(patsubst %,$(COVERAGE)/$(1)/%.profraw,$(call unit_tests,$(1))): %.profraw: % $(UNIT_DATA)
	@LLVM_PROFILE_FILE=$$@ $$< >$$<.log 2>&1 || { cat $$<.log; echo "FAILED $$<"; exit 1; }
coverage: $(patsubst %,$(COVERAGE)/$(1)/%.profraw,$(call unit_tests,$(1)))
endef
$(foreach r,$(COVERAGE_BUILDS),$(eval $(call coverage_variant,$(r))))
