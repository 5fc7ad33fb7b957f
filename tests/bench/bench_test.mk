# make bench-test: the bench's own logic, with programs whose instructions are known.

KNOWN   := cortex_m4f
KNOWN_F := $(BENCH)/$(KNOWN)-f32
PAINTED := cortex_m4f rv32imac

.PHONY: bench-test
CHECK_PARTS += bench-test
bench-test: $(KNOWN_F)/known.elf $(PAINTED:%=$(BENCH)/%-f32/platoon/painted.elf) $(BENCH)/x86_64-f32/platoon/drive.elf \
            $(KNOWN_F)/platoon/detector.elf $(BENCH)/count.so ## tests of make size and make bench
	@PYTHONPATH=tests/bench:host_tools BENCH_PAINTED='$(foreach t,$(PAINTED),$(t)=$(CROSS_$(t))=$(RUN_$(t));)' BENCH_KNOWN='$(CROSS_$(KNOWN))=$(RUN_$(KNOWN))' \
	    $(PY) -m pytest -q -p no:cacheprovider tests/bench
	@$(RESULT) $@ 'what make size and make bench measure is right for programs whose instructions and stack are known' 'all tests passed'

$(eval $(call objects,$(KNOWN_F),tests/bench/known.c,$$(call bench_cc,$(KNOWN),f32) -Itests/target))
$(KNOWN_F)/known.elf: $(call bench_objects,$(KNOWN)-f32,tests/bench/known.c $(call bench_start,$(KNOWN))) hal/start/image.ld
	$(Q)$(call cross_cc,$(KNOWN)) $(call BENCH_LINK_none,$(KNOWN)) -Wl,-Map=$(@:.elf=.map) -o $@ $(filter %.o,$^) -lgcc

# $(call painted_target,TARGET)
define painted_target
$(eval $(call objects,$(BENCH)/$(1)-f32,tests/bench/painted.c,$$(call bench_cc,$(1),f32) -Itests/target))
$(BENCH)/$(1)-f32/platoon/driven.o: $(BENCH)/$(1)-f32/platoon/drive.o
	$$(Q)$(CROSS_$(1))objcopy --redefine-sym main=drive_main $$< $$@
$(BENCH)/$(1)-f32/platoon/painted.elf: $(call bench_objects,$(1)-f32,tests/bench/painted.c platoon/driven.o platoon/tables.o $(LIB_SRC:%=platoon/%) $(call bench_start,$(1))) hal/start/image.ld
	$$(Q)$$(call cross_cc,$(1)) $$(call BENCH_LINK_none,$(1)) -Wl,-Map=$$(@:.elf=.map) -o $$@ $$(filter %.o,$$^) -lgcc
endef
$(foreach t,$(PAINTED),$(eval $(call painted_target,$(t))))
