# The independent check: the library against a second implementation in double precision (Eigen), on random problems.
# HULLGUARD_SEED=n repeats a run, HULLGUARD_PROBLEMS=n makes it longer (300 are usual). The library is built here with both sanitizers, because random tables reach corners that fixed ones
# do not; a failed check jumps over destructors, so leaks are not reported.

ORACLE       := tests/oracle
ORACLE_BUILD := $(BUILD)/oracle
ORACLE_EIGEN ?= /usr/include/eigen3
# clang compiles Eigen's templates in two thirds of the time that gcc takes.
ORACLE_CXX   := $(CLANG:clang%=clang++%) -std=c++17 -O1 -ffp-contract=off -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror \
                -isystem $(ORACLE_EIGEN) -Ifirmware/include $(DEPEND)
ORACLE_TESTS := $(foreach r,$(FLOATS),$(patsubst $(ORACLE)/%.cpp,$(ORACLE_BUILD)/$(r)/%,$(wildcard $(ORACLE)/test_*.cpp)))
ORACLE_ONCE  := $(patsubst %,$(ORACLE_BUILD)/%.o,oracle problem polynomial_oracle oracle_run)
OBJECTS += $(ORACLE_ONCE) $(ORACLE_TESTS:=.o)

.PHONY: oracle
oracle: $(ORACLE_TESTS) $(ORACLE_BUILD)/oracle_run ## the library against an independent implementation in double precision (random; HULLGUARD_SEED=n repeats)
	$(Q)set -e; for test in $(ORACLE_TESTS); do ASAN_OPTIONS=detect_leaks=0 timeout 300 $$test; done
	$(Q)sh $(ORACLE)/test_oracle_run.sh $(ORACLE_BUILD)/oracle_run $(ORACLE)
	@$(RESULT) $@ 'on random problems the library agrees with a second implementation in double precision (Eigen), without a finding of AddressSanitizer or UBSan' \
	    'no difference in $(words $(ORACLE_TESTS)) programs'
TEST_PARTS += oracle

$(ORACLE_ONCE): $(ORACLE_BUILD)/%.o: $(ORACLE)/%.cpp $(ORACLE)/oracle.mk
	@mkdir -p $(@D)
	$(Q)$(ORACLE_CXX) -c $< -o $@

# $(call oracle_variant,REAL)
define oracle_variant
$(eval $(call objects,$(ORACLE_BUILD)/$(1),$(LIB_SRC),$$(CC_asan) $(REAL_FLAG_$(1))))
$(eval $(call archive,$(ORACLE_BUILD)/$(1)/libhullguard.a,$(ORACLE_BUILD)/$(1),$(LIB_SRC)))
$(filter $(ORACLE_BUILD)/$(1)/%,$(ORACLE_TESTS:=.o)): $(ORACLE_BUILD)/$(1)/%.o: $(ORACLE)/%.cpp $(ORACLE)/oracle.mk
	@mkdir -p $$(@D)
	$$(Q)$$(ORACLE_CXX) $(REAL_FLAG_$(1)) -c $$< -o $$@
$(filter $(ORACLE_BUILD)/$(1)/%,$(ORACLE_TESTS)): %: %.o $(ORACLE_BUILD)/oracle.o $(ORACLE_BUILD)/problem.o $(ORACLE_BUILD)/$(1)/libhullguard.a
	$$(Q)$$(CXX) -fsanitize=address,undefined -o $$@ $$^ -lcmocka
endef
$(foreach r,$(FLOATS),$(eval $(call oracle_variant,$(r))))
$(ORACLE_BUILD)/polynomial_oracle.o: ORACLE_CXX += -O2
$(FLOATS:%=$(ORACLE_BUILD)/%/test_polynomial): $(ORACLE_BUILD)/polynomial_oracle.o

$(ORACLE_BUILD)/oracle_run: $(ORACLE_BUILD)/oracle_run.o $(ORACLE_BUILD)/oracle.o
	$(Q)$(CXX) -o $@ $^
