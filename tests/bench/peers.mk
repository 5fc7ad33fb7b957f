# make bench-peers: other libraries' sources, from package registries, at work of the same size. Nothing of them is part of the project, and
# without them the rest of the bench stands. They are built with what helps them most: unrolled loops, fused multiply-add where there is one.

PEERS         := $(BENCH)/peers
PEER_TARGETS  := $(foreach t,$(BENCH_TARGETS),$(if $(filter none,$(LIBC_$(t))),,$(t)))
PEER_C        := cmsis/Source/MatrixFunctions/arm_mat_vec_mult_f32.c cmsis/Source/FilteringFunctions/arm_fir_f32.c cmsis/Source/FilteringFunctions/arm_fir_init_f32.c \
                 ikalman/kalman.c ikalman/matrix.c frame/peer.c frame/crc8.c
PEER_INCLUDE  := -I$(PEERS)/cmsis/Include -I$(PEERS)/cmsis/PrivateInclude -I$(PEERS)/ikalman -I$(PEERS)/frame -Itests/target -Ihal $(INCLUDE)
PEER_FLAGS    := -O2 -ffunction-sections -fdata-sections -D__GNUC_PYTHON__ -DARM_MATH_LOOPUNROLL -DNDEBUG -Dmalloc=peers_malloc -w $(PEER_INCLUDE)
PEER_newlib    = $(call image_link,$(1)) --specs=nano.specs
PEER_glibc     = -static -no-pie
PEER_OWN_newlib := tests/target/newlib.c $(BENCH_CONSOLE_none)
PEER_OWN_glibc  := tests/target/console_libc.c

.PHONY: bench-peers bench-peers-table
bench-peers: ## instructions of a detector's parts beside those of other libraries, fetched into build/
	@$(PY) tests/bench/peers_fetch.py $(PEERS) firmware/models/platoon.dbc && $(MAKE) bench-peers-table || [ $$? -eq 3 ]
bench-peers-table: $(PEER_TARGETS:%=$(PEERS)/%/peers.elf) $(PEER_TARGETS:%=$(BENCH)/%-$(REAL)/platoon/drive.elf) $(BENCH)/count.so
	@$(PY) tests/bench/peers.py $(if $(FORMAT),--format $(FORMAT)) --real $(REAL) $(foreach t,$(PEER_TARGETS),'$(t)=$(CROSS_$(t))=$(RUN_$(t))')

# $(call peer_target,TARGET): recompiled as a whole, for it takes two seconds.
define peer_target
$(PEERS)/$(1)/peers.elf: tests/bench/peers.c $(BENCH)/platoon_record.h $(addprefix $(FIRMWARE)/$(1)/,$(if $(filter newlib,$(LIBC_$(1))),$(addsuffix .o,$(basename $(START_$(1)) hal/start/start.c)))) $(wildcard $(PEERS)/cmsis/PKG-INFO) Makefile
	@mkdir -p $$(@D)
	$$(Q)for c in tests/bench/peers.c $(PEER_OWN_$(LIBC_$(1))) $(PEER_C:%=$(PEERS)/%); do \
	    $(CROSS_$(1))gcc $(MACHINE_$(1)) $(REAL_FLAG_f32) $(PEER_FLAGS) $$$$([ $$$$c = tests/bench/peers.c ] && echo -include $(BENCH)/platoon_record.h) -c $$$$c -o $$(@D)/$$$$(basename $$$$c .c).o || exit 1; done
	$$(Q)$(CROSS_$(1))gcc $(MACHINE_$(1)) $$(call PEER_$(LIBC_$(1)),$(1)) -Wl,--gc-sections -Wl,-Map=$$(@:.elf=.map) -o $$@ $$(@D)/*.o $$(filter %.o,$$^) -lm
endef
$(foreach t,$(PEER_TARGETS),$(eval $(call peer_target,$(t))))
