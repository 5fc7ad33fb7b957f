# hullguard. Everything that is built goes to $(BUILD); sources are found by wildcards, so that a new file needs no line here.
# V=1 shows the commands. A folder may add targets of its own in a *.mk file (see the include at the end), parts of `make test` by
# TEST_PARTS += NAME, of `make check` by CHECK_PARTS += NAME, of `make check-deep` by DEEP_PARTS += NAME. A target with a ## comment
# shows up in `make help`.

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SUFFIXES:
MAKEFLAGS += --no-builtin-rules --no-print-directory

BUILD := build
CC    := gcc
CLANG := clang-19
AR    := ar
PY    := .venv/bin/python
Q     := $(if $(V),,@)

# --- flags ---------------------------------------------------------------------------------------------------------------------------

WARN := -std=c11 -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wdouble-promotion -Wfloat-equal -Wstrict-prototypes \
        -Wmissing-prototypes -Wshadow -Wcast-align -Wvla -Wundef -Wswitch-enum -ffp-contract=off -Werror
INCLUDE  := -Ifirmware/include -Ifirmware/models -Ihal
OPTIMISE := -O2 -g
DEPEND    = -MMD -MP
SANITIZE := -O1 -g -fno-omit-frame-pointer -fno-sanitize-recover=all -fsanitize=undefined

# The number types the library is built for on the host; unit tests compute with the float ones. And the tool sets every test is built with.
FLOATS := f32 f64
REALS  := $(FLOATS) q31
REAL_FLAG_f32 := -DHG_REAL_F32=1
REAL_FLAG_f64 := -DHG_REAL_F64=1
REAL_FLAG_q31 := -DHG_REAL_Q31=1
TOOLSETS := gcc asan clang
CC_gcc     = $(CC) $(OPTIMISE)
CC_asan    = $(CC) $(SANITIZE),address
CC_clang   = $(CLANG) $(OPTIMISE)

# Unit tests that are for one build alone: fixed point, a library without what a model may do without, and one for one model's sizes only. And those that no number type has a part in.
UNIT_BUILDS     := q31 bare only
UNIT_TESTS_q31  := test_q31
UNIT_TESTS_bare := test_bare
UNIT_TESTS_only := test_only
UNIT_ONCE       := test_e2e_errors
REAL_FLAG_bare  := $(REAL_FLAG_f32) $(patsubst %,-DHG_WITH_%=0,ZONOTOPE BANK PREDICT MISMATCH POLYNOMIAL DIGEST FREEZE)
REAL_FLAG_only  := $(REAL_FLAG_f32) -DHG_CONFIG_HEADER='"platoon_bank_config.h"'

LIB_SRC     := $(wildcard firmware/src/*.c)
MODEL_SRC   := $(wildcard firmware/models/*.c)
FUSION_MODELS := $(notdir $(basename $(shell grep -l 'hullguard/tracker\.h' firmware/models/*.h)))# filters on a bus: another storage, no fixed point
CORE_SRC    := $(wildcard host_tools/hullguard/core/*.c)
HOST_HAL    := loopback socketcan
HOST_HAL_SRC := $(foreach h,$(HOST_HAL),$(wildcard hal/$(h)/*.c))
UNIT_TESTS  := $(filter-out $(foreach b,$(UNIT_BUILDS),$(UNIT_TESTS_$(b))),$(patsubst tests/unit/%.c,%,$(wildcard tests/unit/test_*.c)))
UNIT_DATA   := $(wildcard tests/fixtures/*)
RIGS        := $(patsubst tests/contract/rig_%.c,%,$(wildcard tests/contract/rig_*.c))

OBJECTS :=
TEST_PARTS := lib apps pytest-node# the one that mostly waits first
CHECK_PARTS := lib
DEEP_PARTS := lib

# --- what to run ---------------------------------------------------------------------------------------------------------------------

.PHONY: help
help: ## what make can do
	@awk 'BEGIN { FS = ":.*## " } /^[a-z0-9_-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

.PHONY: setup-demo setup-test
setup-demo: ## system packages and .venv for the demo (apt where it is, nothing when all is there)
	@host_tools/setup.sh demo
setup-test: ## the same for the tests
	@host_tools/setup.sh test

# The parts start after the set-up, in a make of their own, because they may need what it installs.
parts = $(MAKE) $(if $(filter --jobserver%,$(MAKEFLAGS)),,-j$(shell nproc)) -Otarget

.PHONY: test check check-deep
test: ## set up all that is needed, build, test the library and the host tools
	@host_tools/setup.sh test
	@+$(parts) $(TEST_PARTS)
	@echo "all tests passed: $(TEST_PARTS)"
check: export HULLGUARD_SEED ?= 1
check: ## proofs, coverage, mutation, fuzzing, targets, emulated boards, sizes, and that each gate can fail (HULLGUARD_SEED=n: other draws; 1)
	@host_tools/setup.sh check
	@rm -f $(CHECK_PARTS:%=$(BUILD)/results/%.json)
	@+$(parts) $(CHECK_PARTS)
	@+$(MAKE) seeded
	@+$(MAKE) promises-check
	@echo "all checks passed: $(CHECK_PARTS)"
check-deep: ## what takes hours: the long forms of proofs, mutation and fuzzing
	@host_tools/setup.sh deep
	@+$(parts) $(DEEP_PARTS)
	@+$(MAKE) seeded-deep
	@echo "all deep checks passed: $(DEEP_PARTS)"

.PHONY: clean
clean: ## remove what was built (not .venv)
	rm -rf $(BUILD)

# --- compiling -----------------------------------------------------------------------------------------------------------------------

# $(call objects,FOLDER,SOURCES,COMMAND): rules for the objects of SOURCES under FOLDER, compiled by COMMAND.
define objects
OBJECTS += $(2:%.c=$(1)/%.o)
$(2:%.c=$(1)/%.o): $(1)/%.o: %.c Makefile
	@mkdir -p $$(@D)
	$$(Q)$(3) $$(WARN) $$(INCLUDE) $$(DEPEND) -c $$< -o $$@
endef

# $(call archive,FILE,FOLDER,SOURCES)
define archive
$(1): $(3:%.c=$(2)/%.o)
	@mkdir -p $$(@D)
	@rm -f $$@
	$$(Q)$$(AR) rcs $$@ $$^
endef

# --- the library on the host ---------------------------------------------------------------------------------------------------------

SHARED_LIBS := $(REALS:%=$(BUILD)/lib/libhullguard_%.so)
STATIC_LIB  := $(BUILD)/lib/libhullguard_f32.a

.PHONY: lib
lib: $(SHARED_LIBS) $(STATIC_LIB) ## the C library for the host: build/lib/libhullguard_{f32,f64}.so and libhullguard_f32.a

define shared_lib
$(eval $(call objects,$(BUILD)/shared-$(1),$(LIB_SRC) $(CORE_SRC),$$(CC) $$(OPTIMISE) -O3 -fPIC $(REAL_FLAG_$(1))))
$(BUILD)/lib/libhullguard_$(1).so: $(patsubst %.c,$(BUILD)/shared-$(1)/%.o,$(LIB_SRC) $(CORE_SRC))
	@mkdir -p $$(@D)
	$$(Q)$$(CC) -shared -Wl,--no-undefined -o $$@ $$^ -lm
endef
$(foreach r,$(REALS),$(eval $(call shared_lib,$(r))))

$(eval $(call objects,$(BUILD)/static-f32,$(LIB_SRC),$$(CC) $$(OPTIMISE) $(REAL_FLAG_f32)))
$(eval $(call archive,$(STATIC_LIB),$(BUILD)/static-f32,$(LIB_SRC)))

# --- unit tests: tests/unit/test_X.c, one program each, with every tool set and number type; a few in a build of their own -------------

.PHONY: unit
unit: ## unit tests (CMocka) with gcc, gcc + ASan + UBSan, clang; f32 and f64, some for Q31 or without optional parts
	@$(RESULT) $@ 'every module does what its header says: float32, float64, fixed point and without optional parts; gcc, gcc with AddressSanitizer and UBSan, clang' \
	    "$(call tests_run,$(BUILD)/unit/*/*.log) tests passed in $(words $^) programs"
TEST_PARTS += unit

# A test whose program has not changed since it passed is not run again; its output is beside it, in .log.
run_test = timeout --foreground -k 5 300 $(1) >$(2).log 2>&1 && touch $(2).ok && echo "  ok  $(2)" \
           || { cat $(2).log; echo "FAILED $(2)"; exit 1; }

# The tables of the models are floats; models that need an optional part do not compile without it.
$(foreach r,$(FLOATS),$(eval UNIT_MODELS_$(r) := $(MODEL_SRC)))
UNIT_MODELS_bare := $(filter-out $(patsubst %.h,%.c,$(shell grep -l '^.if !HG_WITH_' firmware/models/*.h)),$(MODEL_SRC))
UNIT_MODELS_only := firmware/models/platoon_bank.c
unit_tests = $(or $(UNIT_TESTS_$(1)),$(if $(filter f64,$(1)),$(filter-out $(UNIT_ONCE),$(UNIT_TESTS)),$(UNIT_TESTS)))
unit_src   = $(LIB_SRC) $(UNIT_MODELS_$(1)) $(HOST_HAL_SRC)

define unit_variant
$(eval $(call objects,$(BUILD)/unit/$(1)-$(2),$(call unit_src,$(2)),$$(CC_$(1)) $(REAL_FLAG_$(2))))
$(eval $(call archive,$(BUILD)/unit/$(1)-$(2)/libhullguard.a,$(BUILD)/unit/$(1)-$(2),$(call unit_src,$(2))))
$(eval $(call objects,$(BUILD)/unit/$(1)-$(2),$(patsubst %,tests/unit/%.c,$(call unit_tests,$(2))),$$(CC_$(1)) $(REAL_FLAG_$(2))))
$(patsubst %,$(BUILD)/unit/$(1)-$(2)/%,$(call unit_tests,$(2))): %: $(BUILD)/unit/$(1)-$(2)/libhullguard.a
$(patsubst %,$(BUILD)/unit/$(1)-$(2)/%,$(call unit_tests,$(2))): $(BUILD)/unit/$(1)-$(2)/%: $(BUILD)/unit/$(1)-$(2)/tests/unit/%.o
	$$(Q)$$(CC_$(1)) -o $$@ $$< $(BUILD)/unit/$(1)-$(2)/libhullguard.a -lcmocka -lm
$(patsubst %,$(BUILD)/unit/$(1)-$(2)/%.ok,$(call unit_tests,$(2))): %.ok: % $(UNIT_DATA)
	@$$(call run_test,$$<,$$*)
unit: $(patsubst %,$(BUILD)/unit/$(1)-$(2)/%.ok,$(call unit_tests,$(2)))
endef
$(foreach t,$(TOOLSETS),$(foreach r,$(FLOATS) $(UNIT_BUILDS),$(eval $(call unit_variant,$(t),$(r)))))

# --- with-vcan: a CAN bus on machines whose kernel has none ----------------------------------------------------------------------------

WITH_VCAN := $(BUILD)/with-vcan/with-vcan

.PHONY: with-vcan
with-vcan: $(WITH_VCAN) ## build/with-vcan/with-vcan CMD: run CMD where vcan0 exists
$(WITH_VCAN): tests/with-vcan/with-vcan $(BUILD)/with-vcan/with-vcan-init
	@mkdir -p $(@D)
	$(Q)cp $< $@
$(BUILD)/with-vcan/with-vcan-init: tests/with-vcan/with-vcan-init.c Makefile
	@mkdir -p $(@D)
	$(Q)$(CC) $(WARN) -O2 -static -o $@ $<

# --- contract tests: tests/contract/contract.c against every backend that has a rig_X.c ------------------------------------------------

.PHONY: contract
contract: ## one suite for every HAL backend: loopback, and SocketCAN under with-vcan
	@$(RESULT) $@ 'every HAL backend passes one suite of what a backend promises: loopback, and SocketCAN on a bus' "$(call tests_run,$(BUILD)/contract/*/*/*.log) tests passed in $(words $^) programs"
TEST_PARTS += contract

# How a rig is started; nothing: directly. AddressSanitizer's shadow does not fit into the 512 GB that a process has in User-Mode Linux,
# so there the sanitized program has UBSan only, and valgrind watches the memory.
CONTRACT_START_socketcan = $(WITH_VCAN) -t 120 $(if $(filter asan,$(1)),valgrind -q --error-exitcode=9 --child-silent-after-fork=yes)
CONTRACT_NEEDS_socketcan = $(WITH_VCAN)
CONTRACT_CC_asan_socketcan = $(CC) $(SANITIZE)

# $(call contract_program,TOOLSET,RIG)
contract_src = tests/contract/contract.c tests/contract/rig_$(1).c $(wildcard hal/$(1)/*.c)
contract_cc  = $(or $(CONTRACT_CC_$(1)_$(2)),$(CC_$(1)))
define contract_program
$(eval $(call objects,$(BUILD)/contract/$(1)/$(2),$(call contract_src,$(2)),$$(call contract_cc,$(1),$(2))))
$(BUILD)/contract/$(1)/$(2)/contract: $(patsubst %.c,$(BUILD)/contract/$(1)/$(2)/%.o,$(call contract_src,$(2)))
	$$(Q)$$(call contract_cc,$(1),$(2)) -o $$@ $$^ -lcmocka
$(BUILD)/contract/$(1)/$(2)/contract.ok: $(BUILD)/contract/$(1)/$(2)/contract $(CONTRACT_NEEDS_$(2))
	@$$(call run_test,$$(call CONTRACT_START_$(2),$(1)) $$<,$$<)
contract: $(BUILD)/contract/$(1)/$(2)/contract.ok
endef
$(foreach t,$(TOOLSETS),$(foreach r,$(RIGS),$(eval $(call contract_program,$(t),$(r)))))

# --- parts of other folders --------------------------------------------------------------------------------------------------------------

include $(wildcard firmware/*.mk firmware/*/*.mk hal/*.mk hal/*/*.mk host_tools/*.mk tests/*.mk tests/*/*.mk)
TEST_PARTS += pytest-host# last, with a process for each processor
-include $(OBJECTS:.o=.d)
