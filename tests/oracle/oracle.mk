# The independent check: the library against a second implementation in double precision (Eigen), on random problems.
# Included by the top Makefile. HULLGUARD_SEED=n repeats a run.

BUILD ?= build
ORACLE_DIR   := $(patsubst %/,%,$(dir $(lastword $(MAKEFILE_LIST))))
ORACLE_BUILD := $(BUILD)/oracle
ORACLE_EIGEN ?= /usr/include/eigen3
ORACLE_CXXFLAGS := -std=c++17 -O2 -ffp-contract=off -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror \
                   -isystem $(ORACLE_EIGEN) -Ifirmware/include -MMD -MP

.PHONY: oracle oracle-build
oracle: oracle-build
	$(ORACLE_BUILD)/test_oracle_f32
	$(ORACLE_BUILD)/test_oracle_f64
	sh $(ORACLE_DIR)/test_oracle_run.sh $(ORACLE_BUILD)/oracle_run $(ORACLE_DIR)

oracle-build: $(ORACLE_BUILD)/test_oracle_f32 $(ORACLE_BUILD)/test_oracle_f64 $(ORACLE_BUILD)/oracle_run

$(ORACLE_BUILD)/oracle.o $(ORACLE_BUILD)/oracle_run.o: $(ORACLE_BUILD)/%.o: $(ORACLE_DIR)/%.cpp
	@mkdir -p $(@D)
	$(CXX) $(ORACLE_CXXFLAGS) -c $< -o $@

$(ORACLE_BUILD)/test_oracle_f32.o: $(ORACLE_DIR)/test_oracle.cpp
	@mkdir -p $(@D)
	$(CXX) $(ORACLE_CXXFLAGS) -c $< -o $@

$(ORACLE_BUILD)/test_oracle_f64.o: $(ORACLE_DIR)/test_oracle.cpp
	@mkdir -p $(@D)
	$(CXX) $(ORACLE_CXXFLAGS) -DHG_REAL_F64=1 -c $< -o $@

$(ORACLE_BUILD)/test_oracle_%: $(ORACLE_BUILD)/test_oracle_%.o $(ORACLE_BUILD)/oracle.o $(BUILD)/lib/libhullguard_%.a
	$(CXX) $^ -lcmocka -o $@

$(ORACLE_BUILD)/oracle_run: $(ORACLE_BUILD)/oracle_run.o $(ORACLE_BUILD)/oracle.o
	$(CXX) $^ -o $@

-include $(wildcard $(ORACLE_BUILD)/*.d)
