# make bench: how fast campaigns are. Not a part of make test: it measures the machine too.
# make bench-step: instructions retired by a detector step, part by part, on one target.

.PHONY: bench bench-step
bench: lib ## plant samples per second and core in a campaign, of every shipped model; fails below 2e5
	@$(PY) tests/bench/bench.py

BENCH       := $(BUILD)/bench
BENCH_REALS := f32
MODELS      := $(patsubst firmware/models/%.c,%,$(MODEL_SRC))
RECORDER    := tests/bench/record.py

# What is measured, for one target, model and number type.
TARGET ?= cortex_m4f
MODEL  ?= platoon
REAL   ?= f32
bench-step: bench-step-$(TARGET)-$(MODEL)-$(REAL) ## instructions of a detector step on TARGET (cortex_m4f) of MODEL (platoon) with numbers REAL (f32)

$(BENCH)/count.so: tests/bench/count.c Makefile
	@mkdir -p $(@D)
	$(Q)$(CC) $(WARN) -O2 -shared -fPIC -o $@ $<

# Readings of a model's plant. They hang on the tables alone: whatever else changes in the host tools, the same drive is compared.
$(MODELS:%=$(BENCH)/%_record.h): $(BENCH)/%_record.h: firmware/models/%.c $(RECORDER) | lib
	@mkdir -p $(@D)
	$(Q)$(PY) $(RECORDER) $* $@

# The library once more for every target and number type, with what the compiler knows of stack and calls beside each object.
BENCH_FLAGS := -fstack-usage -fcallgraph-info=su
bench_cc    = $(CROSS_$(1))gcc $(MACHINE_$(1)) $(REAL_FLAG_$(2)) $(FREESTANDING) $(BENCH_FLAGS)
BENCH_CONSOLE := tests/target/console_semihosting.c hal/semihosting/semihosting.c

# $(call bench_target,TARGET,REAL)
define bench_target
$(eval $(call objects,$(BENCH)/$(1)-$(2),$(LIB_SRC) $(MODEL_SRC) $(IMAGE_SRC) $(BENCH_CONSOLE) $(filter %.c,$(START_$(1))),$$(call bench_cc,$(1),$(2)) -Itests/target))
$(eval $(call assembly,$(BENCH)/$(1)-$(2),$(filter %.S,$(START_$(1))),$$(call bench_cc,$(1),$(2))))
$(BENCH)/$(1)-$(2)/hal/start/memory.o: FREESTANDING += -fno-tree-loop-distribute-patterns
$(foreach m,$(MODELS),$(eval $(call bench_drive,$(1),$(2),$(m))))
endef

# $(call bench_drive,TARGET,REAL,MODEL)
define bench_drive
OBJECTS += $(BENCH)/$(1)-$(2)/$(3)/drive.o
$(BENCH)/$(1)-$(2)/$(3)/drive.o: tests/bench/drive.c $(BENCH)/$(3)_record.h Makefile
	@mkdir -p $$(@D)
	$$(Q)$$(call bench_cc,$(1),$(2)) $$(WARN) $$(INCLUDE) -Itests/target $$(DEPEND) -include $(BENCH)/$(3)_record.h -c $$< -o $$@
$(BENCH)/$(1)-$(2)/$(3)/drive.elf: $(BENCH)/$(1)-$(2)/$(3)/drive.o $(addprefix $(BENCH)/$(1)-$(2)/,$(addsuffix .o,$(basename $(LIB_SRC) firmware/models/$(3).c $(START_$(1)) $(IMAGE_SRC) $(BENCH_CONSOLE)))) hal/start/image.ld
	$$(Q)$$(call cross_cc,$(1)) $$(call image_link,$(1)) -Wl,-Map=$$(@:.elf=.map) -nostdlib -o $$@ $$(filter %.o,$$^) -lgcc
.PHONY: bench-step-$(1)-$(3)-$(2)
bench-step-$(1)-$(3)-$(2): $(BENCH)/$(1)-$(2)/$(3)/drive.elf $(BENCH)/count.so
	@CROSS=$(CROSS_$(1)) RUN='$(RUN_$(1))' $(PY) tests/bench/step.py $$<
endef
$(foreach r,$(BENCH_REALS),$(foreach t,$(TARGETS),$(eval $(call bench_target,$(t),$(r)))))
