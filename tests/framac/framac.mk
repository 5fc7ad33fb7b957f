# Frama-C: Eva runs real models for ever with any input (eva_*.c), WP proves contracts of kernels (wp.py, wp/). Their results stand in
# build/framac/; what Eva cannot show by itself stands in alarms.toml, with the reason.

FRAMAC      := $(BUILD)/framac
EVA_DRIVERS := $(patsubst tests/framac/%.c,%,$(wildcard tests/framac/eva_*.c))
EVA_FLAGS   := -machdep gcc_x86_64 -kernel-warn-key parser:decimal-float=inactive -eva -warn-special-float none -eva-no-show-progress -eva-no-print \
               -eva-precision 1 -eva-domains symbolic-locations -eva-split-return-function hg_frame_unpack:1,hg_node_step:1,hg_frame_matches:1,hg_tracker_step:1 \
               -eva-slevel 40 -metrics -metrics-eva-cover
EVA_UNROLL  := 1024
FRAMAC_CPP  := -Ifirmware/include -Itests/framac -DHG_REAL_F32=1

eva_models = $(patsubst eva_%,firmware/models/%.c,$(1))

define eva_driver
$(FRAMAC)/$(1).csv: tests/framac/$(1).c tests/framac/drive.h $(call eva_models,$(1)) $(LIB_SRC) $(wildcard firmware/include/hullguard/*.h) tests/framac/framac.mk
	@mkdir -p $$(@D)
	@command -v frama-c >/dev/null || { echo "frama-c is missing: host_tools/setup.sh check" >&2; exit 1; }
	$$(Q)frama-c $$(EVA_FLAGS) -eva-auto-loop-unroll $$(EVA_UNROLL) -eva-slevel-function main:1,hg_hold_rewrite:300 \
	  -cpp-extra-args="$$(FRAMAC_CPP) -Ifirmware/models" \
	  tests/framac/$(1).c $(call eva_models,$(1)) $$(LIB_SRC) -then -report-csv $$@ >$$(@:.csv=.log) 2>&1 || { tail -5 $$(@:.csv=.log); rm -f $$@; exit 1; }
endef
$(foreach d,$(EVA_DRIVERS),$(eval $(call eva_driver,$(d))))

.PHONY: eva
eva: $(EVA_DRIVERS:%=$(FRAMAC)/%.csv) ## no undefined behaviour in any run of real models with any input (Frama-C Eva)
	@$(PY) tests/framac/eva.py tests/framac/alarms.toml $(BUILD)/results/eva.json $^
CHECK_PARTS += eva

.PHONY: wp
wp: ## contracts of saturating counters and of fixed point (Frama-C WP, z3)
	@$(PY) tests/framac/wp.py $(BUILD)/results/wp.json $(FRAMAC)/wp
CHECK_PARTS += wp
