# The independent check: the library against a second implementation in double precision (Eigen), on random problems.
# HULLGUARD_SEED=n repeats a run. The library is built here with both sanitizers, because random tables reach corners that fixed ones
# do not; a failed check jumps over destructors, so leaks are not reported.

ORACLE       := tests/oracle
ORACLE_BUILD := $(BUILD)/oracle
ORACLE_EIGEN ?= /usr/include/eigen3
ORACLE_CXX   := $(CXX) -std=c++17 -O2 -ffp-contract=off -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror \
                -isystem $(ORACLE_EIGEN) -Ifirmware/include $(DEPEND)
ORACLE_PROGRAMS := $(FLOATS:%=$(ORACLE_BUILD)/test_oracle_%) $(FLOATS:%=$(ORACLE_BUILD)/test_fusion_%) $(ORACLE_BUILD)/oracle_run
OBJECTS += $(ORACLE_BUILD)/oracle.o $(ORACLE_BUILD)/oracle_run.o $(FLOATS:%=$(ORACLE_BUILD)/test_oracle_%.o) $(FLOATS:%=$(ORACLE_BUILD)/test_fusion_%.o)

.PHONY: oracle
oracle: $(ORACLE_PROGRAMS) ## the library against an independent implementation in double precision (random; HULLGUARD_SEED=n repeats)
	$(Q)set -e; for real in $(FLOATS); do ASAN_OPTIONS=detect_leaks=0 timeout 300 $(ORACLE_BUILD)/test_oracle_$$real; \
	  ASAN_OPTIONS=detect_leaks=0 timeout 300 $(ORACLE_BUILD)/test_fusion_$$real; done
	$(Q)sh $(ORACLE)/test_oracle_run.sh $(ORACLE_BUILD)/oracle_run $(ORACLE)
TEST_PARTS += oracle

$(ORACLE_BUILD)/oracle.o $(ORACLE_BUILD)/oracle_run.o: $(ORACLE_BUILD)/%.o: $(ORACLE)/%.cpp $(ORACLE)/oracle.mk
	@mkdir -p $(@D)
	$(Q)$(ORACLE_CXX) -c $< -o $@

# $(call oracle_variant,REAL)
define oracle_variant
$(eval $(call objects,$(ORACLE_BUILD)/$(1),$(LIB_SRC),$$(CC_asan) $(REAL_FLAG_$(1))))
$(eval $(call archive,$(ORACLE_BUILD)/$(1)/libhullguard.a,$(ORACLE_BUILD)/$(1),$(LIB_SRC)))
$(ORACLE_BUILD)/test_oracle_$(1).o: $(ORACLE)/test_oracle.cpp $(ORACLE)/oracle.mk
	@mkdir -p $$(@D)
	$$(Q)$$(ORACLE_CXX) $(REAL_FLAG_$(1)) -c $$< -o $$@
$(ORACLE_BUILD)/test_oracle_$(1): $(ORACLE_BUILD)/test_oracle_$(1).o $(ORACLE_BUILD)/oracle.o $(ORACLE_BUILD)/$(1)/libhullguard.a
	$$(Q)$$(CXX) -fsanitize=address,undefined -o $$@ $$^ -lcmocka
$(ORACLE_BUILD)/test_fusion_$(1).o: $(ORACLE)/test_fusion.cpp $(ORACLE)/oracle.mk
	@mkdir -p $$(@D)
	$$(Q)$$(ORACLE_CXX) $(REAL_FLAG_$(1)) -c $$< -o $$@
$(ORACLE_BUILD)/test_fusion_$(1): $(ORACLE_BUILD)/test_fusion_$(1).o $(ORACLE_BUILD)/$(1)/libhullguard.a
	$$(Q)$$(CXX) -fsanitize=address,undefined -o $$@ $$^ -lcmocka
endef
$(foreach r,$(FLOATS),$(eval $(call oracle_variant,$(r))))

$(ORACLE_BUILD)/oracle_run: $(ORACLE_BUILD)/oracle_run.o $(ORACLE_BUILD)/oracle.o
	$(Q)$(CXX) -o $@ $^
