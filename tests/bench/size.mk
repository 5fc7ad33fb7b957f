# make size: flash, RAM and stack of every model on every target, beside the budget of tests/bench/budget.toml. The library is built with what
# the model needs and no more: a model whose part is missing does not compile.
# A number that grew fails; make size-budget takes today's numbers for the budget, to be looked at in the difference and committed.

SIZE_PARTS := detector node sensor
FUSION_PARTS := tracker tracker_sensor# of a fusion filter, which is for float types

# The part of it in `make check`: two instruction sets, with an FPU and without.
SIZE_QUICK := cortex_m4f rv32imac

size_elfs = $(foreach t,$(1),$(foreach r,$(BENCH_REALS),$(foreach m,$(filter-out $(NOT_$(r)),$(MODELS)),$(SIZE_PARTS:%=$(BENCH)/$(t)-$(r)/$(m)/%.elf)))\
                    $(foreach m,$(FUSION_MODELS),$(FUSION_PARTS:%=$(BENCH)/$(t)-f32/$(m)/%.elf)))
size_cross = $(foreach t,$(1),$(t)=$(CROSS_$(t)))
size_run  = $(PY) tests/bench/size.py --budget tests/bench/budget.toml --cross '$(call size_cross,$(1))' $(2) $(call size_elfs,$(1))

.PHONY: size size-quick size-step size-budget
CHECK_PARTS += size-quick
size: $(call size_elfs,$(TARGETS)) ## flash, RAM and worst-case stack, beside their budget (JSON=1; FORMAT=markdown: of MODEL, short)
	@$(call size_run,$(TARGETS),$(if $(JSON),--json) $(if $(FORMAT),--format $(FORMAT) --model $(MODEL)))
size-quick: $(call size_elfs,$(SIZE_QUICK)) ## the same of a few targets
	@$(call size_run,$(SIZE_QUICK),--quiet)
	@$(RESULT) $@ 'flash, RAM and worst-case stack of every model stay within the committed budget' '$(words $(call size_elfs,$(SIZE_QUICK))) programs on $(SIZE_QUICK)'
size-step: size-step-$(TARGET)-$(MODEL)-$(REAL) ## flash of a detector's step, function by function and table by table (TARGET, MODEL, REAL as for bench-step)
size-budget: $(call size_elfs,$(TARGETS)) ## take today's sizes for the budget
	@$(call size_run,$(TARGETS),--write)

# $(call size_program,TARGET,REAL,MODEL,PART)
define size_program
OBJECTS += $(BENCH)/$(1)-$(2)/$(3)/size_$(4).o
$(BENCH)/$(1)-$(2)/$(3)/size_$(4).o: tests/bench/size_$(4).c $(BENCH)/$(3)_record.h Makefile
	@mkdir -p $$(@D)
	$$(Q)$$(call bench_model,$(1),$(2),$(3)) $$(WARN) $$(INCLUDE) -Itests/bench $$(DEPEND) -DRECORD_MODEL='"$(3).c"' -include $(BENCH)/$(3)_record.h -c $$< -o $$@
$(BENCH)/$(1)-$(2)/$(3)/$(4).elf: $(call bench_objects,$(1)-$(2),$(3)/size_$(4).o $(LIB_SRC:%=$(3)/%) $(if $(filter detector,$(4)),,$(3)/tables.o) $(START_$(1)) $(IMAGE_SRC) tests/bench/size_port.c) hal/start/image.ld
	$$(Q)$$(call cross_cc,$(1)) $$(call image_link,$(1)) -Wl,-Map=$$(@:.elf=.map) -nostdlib -o $$@ $$(filter %.o,$$^) -lgcc
$(if $(filter detector,$(4)),$(eval $(call size_step,$(1),$(2),$(3))))
endef

# $(call size_step,TARGET,REAL,MODEL)
define size_step
.PHONY: size-step-$(1)-$(3)-$(2)
size-step-$(1)-$(3)-$(2): $(BENCH)/$(1)-$(2)/$(3)/detector.elf
	@CROSS=$(CROSS_$(1)) $(PY) tests/bench/step_size.py $$<
endef

define size_target
$(eval $(call objects,$(BENCH)/$(1)-$(2),tests/bench/size_port.c,$$(call bench_cc,$(1),$(2))))
$(foreach m,$(filter-out $(NOT_$(2)),$(MODELS)),$(foreach p,$(SIZE_PARTS),$(eval $(call size_program,$(1),$(2),$(m),$(p)))))
endef
$(foreach r,$(BENCH_REALS),$(foreach t,$(TARGETS),$(eval $(call size_target,$(t),$(r)))))

# $(call size_fusion,TARGET,MODEL): the library as that model needs it, its tables, and its programs.
define size_fusion
$(eval $(call objects,$(BENCH)/$(1)-f32/$(2),$(LIB_SRC),$$(call bench_model,$(1),f32,$(2))))
OBJECTS += $(BENCH)/$(1)-f32/$(2)/tables.o $(FUSION_PARTS:%=$(BENCH)/$(1)-f32/$(2)/size_%.o)
$(BENCH)/$(1)-f32/$(2)/tables.o: firmware/models/$(2).c Makefile
	@mkdir -p $$(@D)
	$$(Q)$$(call bench_model,$(1),f32,$(2)) $$(WARN) $$(INCLUDE) $$(DEPEND) -c $$< -o $$@
$(FUSION_PARTS:%=$(BENCH)/$(1)-f32/$(2)/size_%.o): $(BENCH)/$(1)-f32/$(2)/%.o: tests/bench/%.c Makefile
	@mkdir -p $$(@D)
	$$(Q)$$(call bench_model,$(1),f32,$(2)) $$(WARN) $$(INCLUDE) -Itests/bench $$(DEPEND) -include firmware/models/$(2).h -Dsize_storage=hg_$(2)_tracker -Dsize_start=hg_$(2)_tracker_start -c $$< -o $$@
$(FUSION_PARTS:%=$(BENCH)/$(1)-f32/$(2)/%.elf): $(BENCH)/$(1)-f32/$(2)/%.elf: $(BENCH)/$(1)-f32/$(2)/size_%.o $(call bench_objects,$(1)-f32,$(LIB_SRC:%=$(2)/%) $(2)/tables.o $(START_$(1)) $(IMAGE_SRC) tests/bench/size_port.c) hal/start/image.ld
	$$(Q)$$(call cross_cc,$(1)) $$(call image_link,$(1)) -Wl,-Map=$$(@:.elf=.map) -nostdlib -o $$@ $$(filter %.o,$$^) -lgcc
endef
$(foreach t,$(TARGETS),$(foreach m,$(FUSION_MODELS),$(eval $(call size_fusion,$(t),$(m)))))
