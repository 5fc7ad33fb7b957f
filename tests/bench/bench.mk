# make bench: what the library costs, in instructions retired under QEMU, beside what others need for comparable work; and how fast campaigns
# are. Not a part of make test: it fetches sources and measures the machine too.
# make bench-step: one target and model, part by part and function by function.

.PHONY: bench bench-step bench-instructions bench-speed
bench: bench-instructions bench-filters bench-peers bench-speed ## instructions of every part on every target, beside other libraries' (FORMAT=markdown); samples a second of campaigns
bench-speed: lib ## plant samples per second and core in a campaign, of every shipped model; fails below 2e5
	@$(PY) tests/bench/bench.py

BENCH       := $(BUILD)/bench
BENCH_REALS := f32 q31
# Polynomial filters are counted by themselves (make bench-filters).
FILTER_MODELS := $(notdir $(basename $(shell grep -l '^.if !HG_WITH_POLYNOMIAL' firmware/models/*.h)))
MODELS      := $(filter-out %_uio $(FUSION_MODELS) $(FILTER_MODELS),$(patsubst firmware/models/%.c,%,$(MODEL_SRC)))
RECORDER    := tests/bench/record.py

# This machine is a target too, and has a C library as powerpc has.
CROSS_x86_64   :=
MACHINE_x86_64 := -march=x86-64 -fno-pie
LIBC_x86_64    := glibc
RUN_x86_64     := qemu-x86_64
BENCH_TARGETS  := $(foreach t,$(TARGETS) x86_64,$(if $(RUN_$(t)),$(t)))

# Models that no table is shipped of, for the parts that no shipped model has: SOURCE_NAME with the keys of SET_NAME.
VARIANTS        := zonotope derived
SOURCE_zonotope := platoon
SET_zonotope    := detector.threshold=zonotope
SOURCE_derived  := platoon
SET_derived     := detector.prediction=true plant.drag_per_s={value=1.0,pm=0.1}
BENCH_MODELS    := $(MODELS) $(VARIANTS)
NOT_q31         := $(VARIANTS) $(notdir $(basename $(shell grep -l "^.error .* fixed" firmware/models/*.h)))# what has no fixed-point form
bench_models    = $(filter-out $(NOT_$(1)),$(BENCH_MODELS))
bench_source    = $(or $(SOURCE_$(1)),$(1))
bench_tables    = $(if $(SOURCE_$(1)),$(BENCH)/tables/$(1)/$(SOURCE_$(1)).c,firmware/models/$(1).c)
bench_words     = $(foreach w,$(SET_$(1)),'$(w)')

# What is measured, for one target, model and number type.
TARGET ?= cortex_m4f
MODEL  ?= platoon
REAL   ?= f32
bench-step: bench-step-$(TARGET)-$(MODEL)-$(REAL) ## instructions of a detector step on TARGET (cortex_m4f) of MODEL (platoon) with numbers REAL (f32)

$(BENCH)/count.so: tests/bench/count.c Makefile
	@mkdir -p $(@D)
	$(Q)$(CC) $(WARN) -O2 -shared -fPIC -o $@ $<

$(VARIANTS:%=$(BENCH)/tables/%.ok): $(BENCH)/tables/%.ok: | lib
	@mkdir -p $(@D)
	$(Q)PYTHONPATH=host_tools $(PY) -m hullguard design $(SOURCE_$*) $(foreach w,$(SET_$*),--set '$(w)') --quiet --out $(BENCH)/tables/$*
	@touch $@
$(foreach v,$(VARIANTS),$(eval $(call bench_tables,$(v)): $(BENCH)/tables/$(v).ok;))
$(foreach v,$(VARIANTS),$(eval $(BENCH)/tables/$(v).ok: firmware/models/$(SOURCE_$(v)).c))

# Readings of a model's plant. They hang on the tables alone: whatever else changes in the host tools, the same drive is compared.
$(foreach m,$(BENCH_MODELS),$(eval $(BENCH)/$(m)_record.h: $(call bench_tables,$(m))))
$(BENCH_MODELS:%=$(BENCH)/%_record.h): $(BENCH)/%_record.h: $(RECORDER) tests/bench/needs.py | lib
	@mkdir -p $(@D)
	$(Q)$(PY) $(RECORDER) $(call bench_source,$*) $* $@ $(call bench_words,$*)

# The library once more for every target, number type and model, as an integrator of that model builds it: with what it needs, by its
# NAME_config.h; and with what the compiler knows of stack and calls beside each object.
BENCH_FLAGS        := -fstack-usage -fcallgraph-info=su
BENCH_CONSOLE_none := tests/target/console_semihosting.c hal/semihosting/semihosting.c
BENCH_LINK_glibc    = -static -no-pie
BENCH_LINK_none     = $(call image_link,$(1)) -nostdlib
bench_libc     = $(if $(filter glibc,$(LIBC_$(1))),glibc,none)
bench_cc       = $(CROSS_$(1))gcc $(MACHINE_$(1)) $(REAL_FLAG_$(2)) $(FREESTANDING) $(BENCH_FLAGS)
bench_model    = $(call bench_cc,$(1),$(2)) -DHG_CONFIG_HEADER='"$(call bench_source,$(3))_config.h"' -I$(dir $(call bench_tables,$(3)))
bench_hosted   = $(CROSS_$(1))gcc $(MACHINE_$(1)) $(OPTIMISE)
bench_objects  = $(addprefix $(BENCH)/$(1)/,$(addsuffix .o,$(basename $(2))))
bench_start    = $(if $(filter none,$(call bench_libc,$(1))),$(START_$(1)) $(IMAGE_SRC) $(BENCH_CONSOLE_none),tests/target/console_libc.c)

# $(call bench_target,TARGET,REAL)
define bench_target
$(eval $(call objects,$(BENCH)/$(1)-$(2),$(IMAGE_SRC) $(BENCH_CONSOLE_none) $(filter %.c,$(START_$(1))),$$(call bench_cc,$(1),$(2)) -Itests/target))
$(eval $(call objects,$(BENCH)/$(1)-$(2),tests/target/console_libc.c,$$(call bench_hosted,$(1))))
$(eval $(call assembly,$(BENCH)/$(1)-$(2),$(filter %.S,$(START_$(1))),$$(call bench_cc,$(1),$(2))))
$(BENCH)/$(1)-$(2)/hal/start/memory.o: FREESTANDING += -fno-tree-loop-distribute-patterns
$(foreach m,$(call bench_models,$(2)),$(eval $(call bench_drive,$(1),$(2),$(m))))
endef

# $(call bench_drive,TARGET,REAL,MODEL)
define bench_drive
$(eval $(call objects,$(BENCH)/$(1)-$(2)/$(3),$(LIB_SRC),$$(call bench_model,$(1),$(2),$(3))))
$(LIB_SRC:%.c=$(BENCH)/$(1)-$(2)/$(3)/%.o): | $(call bench_tables,$(3))
OBJECTS += $(BENCH)/$(1)-$(2)/$(3)/drive.o $(BENCH)/$(1)-$(2)/$(3)/tables.o
$(BENCH)/$(1)-$(2)/$(3)/tables.o: $(call bench_tables,$(3)) Makefile
	@mkdir -p $$(@D)
	$$(Q)$$(call bench_model,$(1),$(2),$(3)) $$(WARN) $$(INCLUDE) $$(DEPEND) -c $$< -o $$@
$(BENCH)/$(1)-$(2)/$(3)/drive.o: tests/bench/drive.c $(BENCH)/$(3)_record.h Makefile
	@mkdir -p $$(@D)
	$$(Q)$$(call bench_model,$(1),$(2),$(3)) $$(WARN) $$(INCLUDE) -Itests/target $$(DEPEND) -include $(BENCH)/$(3)_record.h -c $$< -o $$@
$(BENCH)/$(1)-$(2)/$(3)/drive.elf: $(call bench_objects,$(1)-$(2),$(3)/drive.o $(3)/tables.o $(LIB_SRC:%=$(3)/%) $(call bench_start,$(1))) hal/start/image.ld
	$$(Q)$$(call cross_cc,$(1)) $$(call BENCH_LINK_$(call bench_libc,$(1)),$(1)) -Wl,-Map=$$(@:.elf=.map) -o $$@ $$(filter %.o,$$^) -lgcc
.PHONY: bench-step-$(1)-$(3)-$(2)
bench-step-$(1)-$(3)-$(2): $(BENCH)/$(1)-$(2)/$(3)/drive.elf $(BENCH)/count.so
	@CROSS=$(CROSS_$(1)) RUN='$(RUN_$(1))' $(PY) tests/bench/step.py $$<
endef
$(foreach r,$(BENCH_REALS),$(foreach t,$(TARGETS) x86_64,$(eval $(call bench_target,$(t),$(r)))))

# Filters that no shipped model has a drive for: over the corpus's (tests/target), with the library as the platoon's integrator builds it.
# Copies of four bytes are compiled in place: a C library's that is called through a table of jumps is never seen to return.
FILTER_SRC := tests/bench/filters.c tests/target/corpus_polynomial.c tests/target/corpus_fusion.c

.PHONY: bench-filters
bench-filters: $(BENCH_TARGETS:%=$(BENCH)/%-f32/filters.elf) $(BENCH)/count.so ## instructions of a sample of the polynomial and the fusion filter, on every target
	@$(PY) tests/bench/filters.py $(if $(FORMAT),--format $(FORMAT)) $(foreach t,$(BENCH_TARGETS),'$(t)=$(CROSS_$(t))=$(RUN_$(t))')

# $(call bench_filters,TARGET)
define bench_filters
$(eval $(call objects,$(BENCH)/$(1)-f32,$(FILTER_SRC),$$(call bench_cc,$(1),f32) -fbuiltin -Itests/target -I$$(TARGET_TESTS)))
$(BENCH)/$(1)-f32/filters.elf: $(call bench_objects,$(1)-f32,$(FILTER_SRC) $(LIB_SRC:%=platoon/%) $(call bench_start,$(1))) hal/start/image.ld
	$$(Q)$$(call cross_cc,$(1)) $$(call BENCH_LINK_$(call bench_libc,$(1)),$(1)) -Wl,-Map=$$(@:.elf=.map) -o $$@ $$(filter %.o,$$^) -lgcc
endef
$(foreach t,$(BENCH_TARGETS),$(eval $(call bench_filters,$(t))))

bench-instructions: $(BENCH_REALS:%=bench-instructions-%) ## instructions of every part, on every target, number type after number type

# $(call bench_table,REAL)
define bench_table
.PHONY: bench-instructions-$(1)
bench-instructions-$(1): $(foreach t,$(BENCH_TARGETS),$(foreach m,$(call bench_models,$(1)),$(BENCH)/$(t)-$(1)/$(m)/drive.elf)) $(BENCH)/count.so
	@$(PY) tests/bench/instructions.py $(if $(FORMAT),--format $(FORMAT)) --real $(1) --models '$(call bench_models,$(1))' $(foreach t,$(BENCH_TARGETS),'$(t)=$(CROSS_$(t))=$(RUN_$(t))')
endef
$(foreach r,$(BENCH_REALS),$(eval $(call bench_table,$(r))))
