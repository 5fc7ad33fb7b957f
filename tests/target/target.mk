# make target-tests: what can be shown of every target of hal/firmware.mk without its hardware.
#   image   tests/target/check_image: what stands in library and image, and what does not
#   corpus  tests/target/corpus.c: every target that has an emulator computes what the host does, to the bit
#   node    firmware/apps/detector_main.c on a board with a story: frames lost, a processor that stood still, a fault
#   unit    tests/unit, unchanged, with the small CMocka of this folder: targets with a C library
# Image, corpus and node are tested of both builds of a target, its own number type and fixed point; unit tests compute in float.
# A test that passed is run again only when it changed; its output is beside it, in .log, and QEMU's in .err.

TARGET_TESTS := $(BUILD)/target-tests
RUN_TARGETS  := $(foreach t,$(TARGETS),$(if $(RUN_$(t)),$(t)))
RUN_BUILDS   := $(foreach t,$(RUN_TARGETS),$(t) $(t)-q31)
UNIT_TARGETS := $(foreach t,$(RUN_TARGETS),$(if $(filter-out none,$(LIBC_$(t))),$(t)))

# Unit tests that need more than the 16 KB of RAM of the microbit: what was compiled for Cortex-M0 runs on the board of Cortex-M3, whose
# instructions contain M0's. No test is left out on any target.
UNIT_LARGE_cortex_m0 := test_adversary test_bank test_consistency test_detector_all test_fusion test_fusion_plants test_hold test_hull test_linalg test_mismatch test_node test_polynomial test_polynomial_plants test_ring test_robust test_tracker test_zonotope
UNIT_BOARD_cortex_m0 := cortex_m3

# These take 7 s to minutes on each target. `make check` runs the others, on the smallest core, on one with an FPU and on the big-endian one, beside
# images and corpus of all; `make target-tests` runs all on all.
UNIT_SLOW  := test_adversary test_e2e_errors test_hull test_robust test_zonotope
CORPUS_QUICK := $(filter-out $(patsubst %,%-q31,cortex_m3 cortex_m33 cortex_m7 cortex_r5f rv32imafc),$(RUN_BUILDS))# theirs are the instructions of the others
TARGET_UNIT := $(filter-out test_digest test_selftest,$(UNIT_TESTS))# these have the tables of models; their digests and self-tests are in the corpus
UNIT_QUICK := $(foreach t,cortex_m0 cortex_m4f powerpc,$(patsubst %,$(TARGET_TESTS)/$(t)/%.ok,$(filter-out $(UNIT_SLOW),$(TARGET_UNIT))))

# What a program is made of beside its test: by the C library of its target.
CORPUS_SRC        := tests/target/corpus.c $(patsubst %,firmware/models/%.c,platoon platoon_bank openacc)
CORPUS_SRC_f32    := $(CORPUS_SRC) tests/target/corpus_fusion.c tests/target/corpus_polynomial.c
CORPUS_SRC_q31    := $(CORPUS_SRC)
NODE_SRC          := firmware/apps/detector_main.c tests/target/board_script.c firmware/models/platoon.c
CONSOLE_none      := tests/target/console_semihosting.c hal/semihosting/semihosting.c
CONSOLE_newlib    := $(CONSOLE_none)
CONSOLE_glibc     := tests/target/console_libc.c
CMOCKA_newlib     := tests/target/cmocka.c tests/target/newlib.c
CMOCKA_glibc      := tests/target/cmocka.c tests/target/glibc.c
TEST_FLAGS_none   := $(FREESTANDING)
TEST_FLAGS_newlib := -O1 -g -ffunction-sections -fdata-sections
TEST_FLAGS_glibc  := -O1 -g
CORPUS_LINK_none   = $(call image_link,$(1)) -nostdlib
CORPUS_LINK_newlib = $(CORPUS_LINK_none)
CORPUS_LINK_glibc  = -static -no-pie
UNIT_LINK_newlib   = $(call image_link,$(1)) --specs=nano.specs -u _printf_float
UNIT_LINK_glibc    = -static -no-pie

target_objects = $(addprefix $(TARGET_TESTS)/$(1)/,$(patsubst %.c,%.o,$(2)))
target_start   = $(if $(filter-out glibc,$(LIBC_$(2))),$(addprefix $(FIRMWARE)/$(1)/,$(addsuffix .o,$(basename $(START_$(2)) hal/start/start.c hal/start/memory.c))))
unit_board     = $(if $(filter $(notdir $(2)),$(UNIT_LARGE_$(1))),$(UNIT_BOARD_$(1)),$(1))
target_run     = QEMU_AUDIO_DRV=none timeout --foreground -k 5 900 $(RUN_$(1)) $(2) </dev/null

.PHONY: target-tests target-quick target-image target-corpus target-node target-unit
CHECK_PARTS += target-quick
target-tests: target-image target-corpus target-node target-unit $(TARGET_TESTS)/seeded.ok ## all targets: contents of the images, the host's bits, unit tests under QEMU
target-quick: target-image $(CORPUS_QUICK:%=$(TARGET_TESTS)/%/corpus.ok) target-node $(UNIT_QUICK) $(TARGET_TESTS)/seeded.ok ## the part of it that is in `make check`
	@$(RESULT) $@ 'an image holds no floating-point instruction in fixed point, no arithmetic in double, no C library and no name without hg_' '$(words $(BUILDS)) images' \
	    'every processor computes the same bits as the host, in float32 and in fixed point' '$(words $(CORPUS_QUICK)) builds under emulation' \
	    'the unit tests pass on processors without and with an FPU and on a big-endian one' '$(words $(UNIT_QUICK)) programs under emulation'
target-image: $(BUILDS:%=$(FIRMWARE)/%/image.ok)
target-corpus: $(RUN_BUILDS:%=$(TARGET_TESTS)/%/corpus.ok)
target-node: $(RUN_BUILDS:%=$(TARGET_TESTS)/%/node.ok)
target-unit: $(UNIT_TARGETS:%=target-unit-%)

$(FIRMWARE)/%/image.ok: $(FIRMWARE)/%/detector.elf $(FIRMWARE)/%/libhullguard.a tests/target/check_image
	@tests/target/check_image $(CROSS_$(call target_of,$*)) $(ENDIAN_$(call target_of,$*)) $(call real_of,$*) $(@D) && touch $@

# $(call host_corpus,REAL,LIBRARY)
define host_corpus
$(eval $(call objects,$(TARGET_TESTS)/host-$(1),$(CORPUS_SRC_$(1)) $(CONSOLE_glibc),$$(CC) $$(OPTIMISE) $(REAL_FLAG_$(1)) -Itests/target -I$(TARGET_TESTS)))
$(TARGET_TESTS)/host-$(1)/corpus: $(call target_objects,host-$(1),$(CORPUS_SRC_$(1)) $(CONSOLE_glibc)) $(2)
	$$(Q)$$(CC) -o $$@ $$^
$(TARGET_TESTS)/host-$(1)/corpus.log: $(TARGET_TESTS)/host-$(1)/corpus
	$$(Q)$$< >$$@
endef
$(eval $(call host_corpus,f32,$(STATIC_LIB)))
$(eval $(call host_corpus,q31,$(LIB_SRC:%.c=$(BUILD)/shared-q31/%.o)))

# $(call target_tests,BUILD,LIBC,TARGET,REAL)
define target_tests
$(eval $(call objects,$(TARGET_TESTS)/$(1),$(sort $(CORPUS_SRC_$(4)) $(NODE_SRC)) $(CONSOLE_$(2)) $(if $(filter $(1),$(UNIT_TARGETS)),$(CMOCKA_$(2)) $(TARGET_UNIT:%=tests/unit/%.c)),$$(call cross_cc,$(1)) $$(TEST_FLAGS_$(2)) -Itests/target -I$(TARGET_TESTS)))
$(TARGET_TESTS)/$(1)/corpus $(TARGET_TESTS)/$(1)/node: hal/start/image.ld
$(TARGET_TESTS)/$(1)/corpus: $(call target_objects,$(1),$(CORPUS_SRC_$(4)) $(CONSOLE_$(2))) $(call target_start,$(1),$(3)) $(FIRMWARE)/$(1)/libhullguard.a
	$$(Q)$$(call cross_cc,$(1)) $$(call CORPUS_LINK_$(2),$(1)) -o $$@ $$(filter %.o %.a,$$^) -lgcc
$(TARGET_TESTS)/$(1)/corpus.ok: $(TARGET_TESTS)/$(1)/corpus $(TARGET_TESTS)/host-$(4)/corpus.log
	@$$(call target_run,$(3),$$<) >$$<.log 2>$$<.err && diff $(TARGET_TESTS)/host-$(4)/corpus.log $$<.log && touch $$@ && echo "  ok  $$<" || { echo "FAILED $$<, see $$<.log"; exit 1; }
$(TARGET_TESTS)/$(1)/node: $(call target_objects,$(1),$(NODE_SRC) $(CONSOLE_$(2))) $(call target_start,$(1),$(3)) $(FIRMWARE)/$(1)/libhullguard.a
	$$(Q)$$(call cross_cc,$(1)) $$(call CORPUS_LINK_$(2),$(1)) -o $$@ $$(filter %.o %.a,$$^) -lgcc
$(TARGET_TESTS)/$(1)/node.ok: $(TARGET_TESTS)/$(1)/node
	@$$(call target_run,$(3),$$<) >$$<.log 2>$$<.err && grep -q 'tell the story$$$$' $$<.log && touch $$@ && echo "  ok  $$<" || \
	    { cat $$<.log $$<.err; echo "FAILED $$<"; exit 1; }
endef
$(foreach b,$(RUN_BUILDS),$(eval $(call target_tests,$(b),$(LIBC_$(call target_of,$(b))),$(call target_of,$(b)),$(call real_of,$(b)))))

# Filters of a nonlinear plant, for which no model is shipped.
POLYNOMIAL_TABLES := $(TARGET_TESTS)/polynomial_tables.h
$(POLYNOMIAL_TABLES): tests/target/polynomial_tables.py host_tools/hullguard/design/polynomial.py host_tools/hullguard/campaign/polynomial_study.py | lib
	@mkdir -p $(@D)
	$(Q)PYTHONPATH=host_tools $(PY) $< $@
POLYNOMIAL_USERS := $(patsubst %,$(TARGET_TESTS)/%,host-f32 $(RUN_TARGETS)) $(BENCH_TARGETS:%=$(BENCH)/%-f32)
$(POLYNOMIAL_USERS:%=%/tests/target/corpus_polynomial.o): $(POLYNOMIAL_TABLES)

SEEDED := cortex_m4f
$(TARGET_TESTS)/seeded.ok: tests/target/seeded tests/target/check_image $(FIRMWARE)/$(SEEDED)/image.ok $(FIRMWARE)/$(SEEDED)-q31/image.ok $(TARGET_TESTS)/$(SEEDED)/corpus.ok
	@COMPILE='$(call cross_cc,$(SEEDED)) $(FREESTANDING) $(WARN) $(INCLUDE)' LINK='$(call cross_cc,$(SEEDED)) $(call image_link,$(SEEDED)) -nostdlib' \
	    RUN='env QEMU_AUDIO_DRV=none $(RUN_$(SEEDED))' tests/target/seeded $(CROSS_$(SEEDED)) $(ENDIAN_$(SEEDED)) $(FIRMWARE)/$(SEEDED) $(TARGET_TESTS)/$(SEEDED)
	@touch $@

# The small CMocka counts, and so does the source: a program that ends early, or a test that is not run, is no success.
# The start-up code is that of the target, also where another board runs it; so is everything else but the places of flash and RAM.
define target_unit
.PHONY: target-unit-$(1)
target-unit-$(1): $(TARGET_UNIT:%=$(TARGET_TESTS)/$(1)/%.ok)
$(TARGET_UNIT:%=$(TARGET_TESTS)/$(1)/%): hal/start/image.ld
$(TARGET_UNIT:%=$(TARGET_TESTS)/$(1)/%): $(TARGET_TESTS)/$(1)/%: $(TARGET_TESTS)/$(1)/tests/unit/%.o $(call target_objects,$(1),$(CONSOLE_$(2)) $(CMOCKA_$(2))) $(filter-out %/memory.o,$(call target_start,$(1),$(1))) $(FIRMWARE)/$(1)/libhullguard.a
	$$(Q)$$(call cross_cc,$(1)) $$(call UNIT_LINK_$(2),$$(call unit_board,$(1),$$@)) -o $$@ $$(filter %.o %.a,$$^) -lm
$(TARGET_UNIT:%=$(TARGET_TESTS)/$(1)/%.ok): %.ok: %
	@$$(call target_run,$$(call unit_board,$(1),$$<),$$<) >$$<.log 2>$$<.err && \
	    grep -q "^\[  PASSED  \] $$$$(grep -o 'cmocka_unit_test(' tests/unit/$$(@F:.ok=.c) | wc -l) test" $$<.log && touch $$@ && echo "  ok  $$<" || \
	    { cat $$<.log $$<.err; echo "FAILED $$<"; exit 1; }
endef
$(foreach t,$(UNIT_TARGETS),$(eval $(call target_unit,$(t),$(LIBC_$(t)))))
