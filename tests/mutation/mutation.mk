# make mutation: faults are put into the library, one at a time, and the unit tests must notice each (mutate.py, run.py). A sample and the small modules;
# make mutation-deep: all.

MUTATION := $(BUILD)/mutation
MUTATION_BUILDS := f32 f64 q31 bare only
MUTATION_CC = $(CLANG) -O1 -w -fPIC -ftrivial-auto-var-init=pattern
MUTATION_TOOLS = $(wildcard tests/mutation/*.py tests/mutation/*.toml)

.PHONY: mutation mutation-deep
CHECK_PARTS += mutation
DEEP_PARTS  += mutation-deep
mutation: $(MUTATION)/built $(MUTATION_TOOLS) ## faults put into the library: the unit tests must notice each; a sample by HULLGUARD_SEED, or all of MODULES
	@$(PY) tests/mutation/run.py --results $(BUILD)/results/mutation.json $(or $(MODULES:%=--module %),--sample 200) $(MUTATION) $(MUTATION_BUILDS)
mutation-deep: $(MUTATION)/built $(MUTATION_TOOLS) ## the same with every fault that can be put in
	@$(PY) tests/mutation/run.py --results $(BUILD)/results/mutation-deep.json $(MUTATION) $(MUTATION_BUILDS)

# $(call mutation_build,BUILD): test programs that find the library, mutated or not, when they start.
define mutation_build
$(eval $(call objects,$(MUTATION)/$(1),$(LIB_SRC),$$(MUTATION_CC) $(REAL_FLAG_$(1))))
$(eval $(call objects,$(MUTATION)/$(1),$(UNIT_MODELS_$(1)) $(HOST_HAL_SRC) $(patsubst %,tests/unit/%.c,$(call unit_tests,$(1))) tests/mutation/runtime.c,$$(MUTATION_CC) -D_DEFAULT_SOURCE $(REAL_FLAG_$(1))))
$(eval $(call archive,$(MUTATION)/$(1)/libmodels.a,$(MUTATION)/$(1),$(UNIT_MODELS_$(1)) $(HOST_HAL_SRC)))
$(MUTATION)/$(1)/libhg.so: $(patsubst %.c,$(MUTATION)/$(1)/%.o,$(LIB_SRC) tests/mutation/runtime.c)
	$$(Q)$$(CLANG) -shared -Wl,-Bsymbolic,-soname,libhg.so -o $$@ $$^
$(patsubst %,$(MUTATION)/$(1)/%,$(call unit_tests,$(1))): $(MUTATION)/$(1)/%: $(MUTATION)/$(1)/tests/unit/%.o $(MUTATION)/$(1)/libmodels.a $(MUTATION)/$(1)/libhg.so
	$$(Q)$$(CLANG) -rdynamic -o $$@ $$^ -lcmocka -lm
$(MUTATION)/built: $(patsubst %,$(MUTATION)/$(1)/%,$(call unit_tests,$(1)))
endef
$(foreach r,$(MUTATION_BUILDS),$(eval $(call mutation_build,$(r))))
$(MUTATION)/built:
	@$(foreach r,$(MUTATION_BUILDS),echo '$(MUTATION_CC) $(INCLUDE) $(subst ','\'',$(REAL_FLAG_$(r)))' >$(MUTATION)/$(r)/flags;)
	@touch $@
