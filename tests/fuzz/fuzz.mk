# Fuzzing: each fuzz_NAME.c is one function that libFuzzer (clang-19) and AFL++ (clang-14) both drive, with AddressSanitizer and UBSan, against the numbered
# invariants of INVARIANTS.md; readers.py does the same to the host's readers of files. corpus/ and regress/ are in hex. `make fuzz-quick` replays both
# and fuzzes on for a few seconds, `make fuzz` for RUNTIME seconds of the processor a target and engine and adds what it did to ledger.toml.

FUZZ := $(BUILD)/fuzz
RUNTIME := 1200
FUZZ_SECONDS := 10
FUZZ_TARGETS := $(patsubst tests/fuzz/fuzz_%.c,%,$(wildcard tests/fuzz/fuzz_*.c))
FUZZ_ENGINES := libfuzzer afl
FUZZ_SANITIZE := -O1 -g -fno-omit-frame-pointer -fno-sanitize-recover=all
FUZZ_CC_libfuzzer = $(CLANG) $(FUZZ_SANITIZE) -fsanitize=fuzzer-no-link,address,undefined,float-cast-overflow
FUZZ_LINK_libfuzzer = $(CLANG) -fsanitize=fuzzer,address,undefined,float-cast-overflow
FUZZ_CC_afl = AFL_QUIET=1 AFL_USE_ASAN=1 AFL_USE_UBSAN=1 afl-clang-fast $(FUZZ_SANITIZE)
FUZZ_LINK_afl = $(FUZZ_CC_afl) -fsanitize=fuzzer
FUZZ_SRC := $(LIB_SRC) $(MODEL_SRC) firmware/apps/models.c

# $(call fuzz_engine,ENGINE)
define fuzz_engine
$(eval $(call objects,$(FUZZ)/$(1),$(FUZZ_SRC) $(FUZZ_TARGETS:%=tests/fuzz/fuzz_%.c),$$(FUZZ_CC_$(1)) -Ifirmware/apps $(REAL_FLAG_f32)))
$(eval $(call archive,$(FUZZ)/$(1)/libhullguard.a,$(FUZZ)/$(1),$(FUZZ_SRC)))
$(FUZZ_TARGETS:%=$(FUZZ)/$(1)/%): $(FUZZ)/$(1)/%: $(FUZZ)/$(1)/tests/fuzz/fuzz_%.o $(FUZZ)/$(1)/libhullguard.a
	$$(Q)$$(FUZZ_LINK_$(1)) -o $$@ $$^ -lm
endef
$(foreach e,$(FUZZ_ENGINES),$(eval $(call fuzz_engine,$(e))))

# Said before anything is compiled, and once.
.PHONY: afl-there
$(patsubst %.c,$(FUZZ)/afl/%.o,$(FUZZ_SRC) $(FUZZ_TARGETS:%=tests/fuzz/fuzz_%.c)): | afl-there
afl-there:
	@command -v afl-clang-fast >/dev/null || { echo "afl-clang-fast is missing: host_tools/setup.sh deep" >&2; exit 1; }

fuzz_programs = $(foreach e,$(1),$(FUZZ_TARGETS:%=$(FUZZ)/$(e)/%))
fuzz_run = PYTHONPATH=host_tools $(PY) tests/fuzz/fuzz.py --build $(FUZZ) $(1)

.PHONY: fuzz fuzz-quick fuzz-readers $(FUZZ_TARGETS:%=fuzz-%)
CHECK_PARTS += fuzz-quick
fuzz-quick: lib $(call fuzz_programs,libfuzzer) ## fuzzing, short: corpus and regressions of all targets, 10 s each, some thousand cases a reader of files
	@$(call fuzz_run,quick --seconds $(FUZZ_SECONDS) $(FUZZ_TARGETS))
DEEP_PARTS += fuzz
fuzz: lib $(call fuzz_programs,$(FUZZ_ENGINES)) ## fuzzing, long: RUNTIME processor seconds a target and engine, 10^5 cases a reader; adds to tests/fuzz/ledger.toml
	@$(call fuzz_run,long --seconds $(RUNTIME) $(FUZZ_TARGETS))

# Parts of the short form: one target, or the readers alone (READER).
$(FUZZ_TARGETS:%=fuzz-%): fuzz-%: $(FUZZ)/libfuzzer/%
	@$(call fuzz_run,quick --seconds $(FUZZ_SECONDS) --no-readers $*)
fuzz-readers: lib
	@PYTHONPATH=host_tools $(PY) tests/fuzz/readers.py --work $(FUZZ)/readers --seed 1 $(READER:%=--reader %)
