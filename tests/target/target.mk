# make target-tests: what can be shown of every target of hal/firmware.mk without its hardware.
#   image   tests/target/check_image: what stands in library and image, and what does not
#   corpus  tests/target/corpus.c: every target that has an emulator computes what the host does, to the bit
#   unit    tests/unit, unchanged, with the small CMocka of this folder: targets with a C library
# A test that passed is run again only when it changed; its output is beside it, in .log, and QEMU's in .err.

TARGET_TESTS := $(BUILD)/target-tests
UNIT_TARGETS := $(foreach t,$(TARGETS),$(if $(filter-out none,$(LIBC_$(t))),$(t)))

# Unit tests that a target cannot run, and why.
UNIT_SKIP_cortex_m0 :=

# What a program is made of beside its test: by the C library of its target.
CORPUS_SRC        := tests/target/corpus.c $(MODEL_SRC)
CONSOLE_none      := tests/target/console_semihosting.c hal/semihosting/semihosting.c
CONSOLE_newlib    := $(CONSOLE_none)
CONSOLE_glibc     := tests/target/console_libc.c
CMOCKA_newlib     := tests/target/cmocka.c tests/target/newlib.c
CMOCKA_glibc      := tests/target/cmocka.c
TEST_FLAGS_none   := $(FREESTANDING)
TEST_FLAGS_newlib := -O1 -g -ffunction-sections -fdata-sections
TEST_FLAGS_glibc  := -O1 -g
CORPUS_LINK_none   = $(call image_link,$(1)) -nostdlib
CORPUS_LINK_newlib = $(CORPUS_LINK_none)
CORPUS_LINK_glibc  = -static -no-pie
UNIT_LINK_newlib   = $(call image_link,$(1)) --specs=nano.specs -u _printf_float
UNIT_LINK_glibc    = -static -no-pie

target_objects = $(addprefix $(TARGET_TESTS)/$(1)/,$(patsubst %.c,%.o,$(2)))
target_start   = $(if $(filter-out glibc,$(LIBC_$(1))),$(addprefix $(FIRMWARE)/$(1)/,$(addsuffix .o,$(basename $(START_$(1)) hal/start/start.c hal/start/memory.c))))
target_units   = $(filter-out $(UNIT_SKIP_$(1)),$(UNIT_TESTS))
target_run     = QEMU_AUDIO_DRV=none timeout --foreground -k 5 300 $(RUN_$(1)) $(2) </dev/null

.PHONY: target-tests target-image target-corpus target-unit
target-tests: target-image target-corpus target-unit ## all targets: contents of the images, the host's bits, unit tests under QEMU
target-image: $(TARGETS:%=$(FIRMWARE)/%/image.ok)
target-corpus: $(TARGETS:%=$(TARGET_TESTS)/%/corpus.ok)
target-unit: $(UNIT_TARGETS:%=target-unit-%)

$(FIRMWARE)/%/image.ok: $(FIRMWARE)/%/detector.elf $(FIRMWARE)/%/libhullguard.a tests/target/check_image
	@tests/target/check_image $(CROSS_$*) $(ENDIAN_$*) $(@D) && touch $@

$(eval $(call objects,$(TARGET_TESTS)/host,$(CORPUS_SRC) $(CONSOLE_glibc),$$(CC) $$(OPTIMISE) $(REAL_FLAG_f32) -Itests/target))
$(TARGET_TESTS)/host/corpus: $(call target_objects,host,$(CORPUS_SRC) $(CONSOLE_glibc)) $(STATIC_LIB)
	$(Q)$(CC) -o $@ $^
$(TARGET_TESTS)/host/corpus.log: $(TARGET_TESTS)/host/corpus
	$(Q)$< >$@

# $(call target_tests,TARGET,LIBC)
define target_tests
$(eval $(call objects,$(TARGET_TESTS)/$(1),$(CORPUS_SRC) $(CONSOLE_$(2)) $(CMOCKA_$(2)) $(if $(CMOCKA_$(2)),$(UNIT_TESTS:%=tests/unit/%.c)),$$(call cross_cc,$(1)) $$(TEST_FLAGS_$(2)) -Itests/target))
$(TARGET_TESTS)/$(1)/corpus: $(call target_objects,$(1),$(CORPUS_SRC) $(CONSOLE_$(2))) $(call target_start,$(1)) $(FIRMWARE)/$(1)/libhullguard.a
	$$(Q)$$(call cross_cc,$(1)) $$(call CORPUS_LINK_$(2),$(1)) -o $$@ $$^ -lgcc
$(TARGET_TESTS)/$(1)/corpus.ok: $(TARGET_TESTS)/$(1)/corpus $(TARGET_TESTS)/host/corpus.log
	@$$(call target_run,$(1),$$<) >$$<.log 2>$$<.err && diff $(TARGET_TESTS)/host/corpus.log $$<.log && touch $$@ && echo "  ok  $$<" || { echo "FAILED $$<, see $$<.log"; exit 1; }
endef
$(foreach t,$(TARGETS),$(eval $(call target_tests,$(t),$(LIBC_$(t)))))

# The small CMocka counts, and so does the source: a program that ends early, or a test that is not run, is no success.
define target_unit
.PHONY: target-unit-$(1)
target-unit-$(1): $(patsubst %,$(TARGET_TESTS)/$(1)/%.ok,$(call target_units,$(1)))
$(patsubst %,$(TARGET_TESTS)/$(1)/%,$(call target_units,$(1))): $(TARGET_TESTS)/$(1)/%: $(TARGET_TESTS)/$(1)/tests/unit/%.o $(call target_objects,$(1),$(CONSOLE_$(2)) $(CMOCKA_$(2))) $(filter-out %/memory.o,$(call target_start,$(1))) $(FIRMWARE)/$(1)/libhullguard.a
	$$(Q)$$(call cross_cc,$(1)) $$(call UNIT_LINK_$(2),$(1)) -o $$@ $$^ -lm
$(patsubst %,$(TARGET_TESTS)/$(1)/%.ok,$(call target_units,$(1))): %.ok: %
	@$$(call target_run,$(1),$$<) >$$<.log 2>$$<.err && \
	    grep -q "^\[  PASSED  \] $$$$(grep -o 'cmocka_unit_test(' tests/unit/$$(@F:.ok=.c) | wc -l) test" $$<.log && touch $$@ && echo "  ok  $$<" || \
	    { cat $$<.log $$<.err; echo "FAILED $$<"; exit 1; }
endef
$(foreach t,$(UNIT_TARGETS),$(eval $(call target_unit,$(t),$(LIBC_$(t)))))
