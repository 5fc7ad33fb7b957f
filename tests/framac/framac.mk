# Frama-C: Eva runs real models for ever with any input (eva_*.c), WP proves contracts of kernels (wp.py, wp/). Their results stand in
# build/framac/; what Eva cannot show by itself stands in alarms.toml, with the reason.

FRAMAC      := $(BUILD)/framac
EVA_DRIVERS := $(patsubst tests/framac/%.c,%,$(wildcard tests/framac/eva_*.c))
EVA_FLAGS   := -machdep gcc_x86_64 -kernel-warn-key parser:decimal-float=inactive -eva -warn-special-float none -eva-no-show-progress -eva-no-print \
               -eva-precision 1 -eva-domains symbolic-locations -metrics -metrics-eva-cover
EVA_UNROLL  := 1024
EVA_SPLIT   := hg_frame_unpack:1,hg_node_step:1,hg_frame_matches:1,hg_residual_step:1,hg_e2e_check:1
FRAMAC_CPP  := -Ifirmware/include -Ifirmware/models -Ihal -Itests/framac

# What a driver runs besides the library: the model that it is named after, or what EVA_SRC_NAME says. NAME_q31 is in fixed point.
EVA_SRC_eva_hal := hal/loopback/loopback.c hal/board/controller.c hal/board/queue.c
EVA_SPLIT_eva_fusion5 := $(EVA_SPLIT),hg_tracker_step:1
EVA_FEW := eva_fusion5 eva_hal eva_parts eva_uio# as precise with 10 states as with 40, in a third to half of the time
EVA_SPLIT_eva_fusion := reachable:1,hg_fusion_open:1
EVA_SPLIT_eva_zonotope := hg_detector_start:1
EVA_SLEVEL_eva_zonotope := ,run:1,call:1
EVA_SPLIT_eva_hal := hg_loopback_start:1,hg_controller_start:1,hg_queue_start:1,well_formed:1,hg_hal_sendable:1
EVA_SRC_eva_uio := firmware/models/two_state.c
eva_models = $(or $(EVA_SRC_$(1)),$(wildcard $(patsubst eva_%,firmware/models/%.c,$(1))))
eva_real   = $(if $(filter %_q31,$(1)),-DHG_REAL_Q31=1,-DHG_REAL_F32=1)

define eva_driver
$(FRAMAC)/$(1).csv: tests/framac/$(1).c $(wildcard tests/framac/*.h) $(call eva_models,$(1)) $(LIB_SRC) $(wildcard firmware/include/hullguard/*.h) tests/framac/framac.mk
	@mkdir -p $$(@D)
	@command -v frama-c >/dev/null || { echo "frama-c is missing: host_tools/setup.sh check" >&2; exit 1; }
	$$(Q)frama-c $$(EVA_FLAGS) -eva-slevel $(if $(filter $(1),$(EVA_FEW)),10,40) -eva-split-return-function $$(or $$(EVA_SPLIT_$(1)),$$(EVA_SPLIT)) -eva-auto-loop-unroll $$(EVA_UNROLL) -eva-slevel-function main:1,hg_hold_rewrite:300$$(EVA_SLEVEL_$(1)) \
	  -cpp-extra-args="$$(FRAMAC_CPP) $(call eva_real,$(1))" \
	  tests/framac/$(1).c $(call eva_models,$(1)) $$(LIB_SRC) -then -report-csv $$@ >$$(@:.csv=.log) 2>&1 || { tail -5 $$(@:.csv=.log); rm -f $$@; exit 1; }
endef
$(foreach d,$(EVA_DRIVERS),$(eval $(call eva_driver,$(d))))

.PHONY: eva
eva: $(EVA_DRIVERS:%=$(FRAMAC)/%.csv) ## no undefined behaviour in any run of real models with any input (Frama-C Eva)
	@$(PY) tests/framac/eva.py tests/framac/alarms.toml $(BUILD)/results/eva.json $^
CHECK_PARTS += eva

.PHONY: wp
wp: ## contracts of kernels (Frama-C WP, z3); WP=ring: of one file in tests/framac/wp
	@$(PY) tests/framac/wp.py $(BUILD)/results/wp.json $(FRAMAC)/wp $(WP)
CHECK_PARTS += wp

.PHONY: wp-deep
wp-deep: ## the same, and those that take minutes
	@$(PY) tests/framac/wp.py $(BUILD)/results/wp-deep.json $(FRAMAC)/wp-deep --deep
DEEP_PARTS += wp-deep
