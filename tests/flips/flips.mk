# Single faults, all of them: every bit of a node's memory flipped between any two of its calls; every start in a memory full of rubbish; every system call of the
# SocketCAN backend failing once, with every errno that its manual page lists.

FLIPS := $(BUILD)/flips
FLIPS_MODELS := platoon platoon_bank
FLIPS_DEEP := $(FLIPS_MODELS) openacc suspension suspension_published two_state cubic_suspension quadratic_sensor battery_cell
FLIPS_STRIDE := 7# of the sanitized run, in calls
FLIPS_CC_plain = $(CC) $(OPTIMISE) -O3
FLIPS_CC_asan = $(CC) $(SANITIZE),address -fno-sanitize=bool,enum# of which other values than their own are what is tried here

# $(call flips_program,BUILD,MODEL)
define flips_program
$(FLIPS)/$(1)/$(2): tests/flips/flips.c $(FLIPS)/$(1)/libhullguard.a $(FLIPS)/$(1)/firmware/models/$(2).o
	$$(Q)$$(FLIPS_CC_$(1)) $$(WARN) $$(INCLUDE) $(REAL_FLAG_f32) -DFLIPS_HEADER='"$(2).h"' -DFLIPS_STORAGE=hg_$(2)_node -DFLIPS_START=hg_$(2)_node_start -o $$@ $$(filter-out %.a,$$^) $$(filter %.a,$$^)
endef
define flips_build
$(eval $(call objects,$(FLIPS)/$(1),$(LIB_SRC) $(MODEL_SRC) tests/flips/garbage.c,$$(FLIPS_CC_$(1)) $(REAL_FLAG_f32)))
$(eval $(call archive,$(FLIPS)/$(1)/libhullguard.a,$(FLIPS)/$(1),$(LIB_SRC)))
$(foreach m,$(FLIPS_DEEP),$(eval $(call flips_program,$(1),$(m))))
$(FLIPS)/$(1)/garbage: $(FLIPS)/$(1)/tests/flips/garbage.o $(MODEL_SRC:%.c=$(FLIPS)/$(1)/%.o) $(FLIPS)/$(1)/libhullguard.a
	$$(Q)$$(FLIPS_CC_$(1)) -o $$@ $$^
endef
$(foreach b,plain asan,$(eval $(call flips_build,$(b))))

# The backend's system calls go through the wrappers of syscalls.c. (No AddressSanitizer: its shadow does not fit into a guest.)
FLIPS_CALLS := socket ioctl bind setsockopt getsockopt send recvmsg epoll_create1 epoll_ctl epoll_wait timerfd_create timerfd_settime eventfd signalfd read close if_nametoindex
$(eval $(call objects,$(FLIPS)/calls,hal/socketcan/socketcan.c tests/flips/syscalls.c,$$(CC) $$(SANITIZE) -Ihal/socketcan))
$(FLIPS)/calls/syscalls: $(FLIPS)/calls/hal/socketcan/socketcan.o $(FLIPS)/calls/tests/flips/syscalls.o
	$(Q)$(CC) -fsanitize=undefined $(FLIPS_CALLS:%=-Wl,--wrap=%) -o $@ $^

# What a part says goes to a file as well, from which the results are made. $(call flips_part,NAME,COMMAND)
flips_part = mkdir -p $(FLIPS)/said; $(2) >$(FLIPS)/said/$(1) 2>&1 || { cat $(FLIPS)/said/$(1); exit 1; }; cat $(FLIPS)/said/$(1)
# $(call flips_model,MODEL,BUILD,STRIDE)
flips_model = $(call flips_part,$(1)-$(2),PYTHONPATH=host_tools $(PY) tests/flips/flips.py $(1) $(FLIPS)/$(2)/$(1) $(FLIPS)/work-$(2) --stride $(3))

.PHONY: flips flips-deep flips-garbage flips-calls flips-platoon
CHECK_PARTS += flips
flips: lib $(FLIPS_MODELS:%=$(FLIPS)/plain/%) $(FLIPS_MODELS:%=$(FLIPS)/asan/%) $(FLIPS)/asan/garbage $(FLIPS)/calls/syscalls $(WITH_VCAN) ## every single bit of a node's memory flipped, starts in garbage, every system call failing once
	@$(call flips_part,garbage,$(FLIPS)/asan/garbage)
	@$(call flips_part,calls,$(WITH_VCAN) -t 300 $(FLIPS)/calls/syscalls)
	@$(call flips_model,platoon,plain,1)
	@$(call flips_model,platoon_bank,plain,$(FLIPS_STRIDE))
	@$(call flips_model,platoon,asan,$(FLIPS_STRIDE))
	@$(PY) tests/flips/results.py $(FLIPS)/said $(BUILD)/results/flips.json
# Parts of it.
flips-garbage: $(FLIPS)/asan/garbage
	@$(call flips_part,garbage,$<)
flips-calls: $(FLIPS)/calls/syscalls $(WITH_VCAN)
	@$(call flips_part,calls,$(WITH_VCAN) -t 300 $<)
flips-platoon: lib $(FLIPS)/plain/platoon
	@$(call flips_model,platoon,plain,1)
DEEP_PARTS += flips-deep
flips-deep: lib $(FLIPS_DEEP:%=$(FLIPS)/plain/%) $(FLIPS_DEEP:%=$(FLIPS)/asan/%) ## the same of all detector models, between any two calls, and under the sanitizers
	@$(foreach m,$(FLIPS_DEEP),$(call flips_model,$(m),plain,1);)
	@$(foreach m,$(FLIPS_DEEP),$(call flips_model,$(m),asan,$(FLIPS_STRIDE));)
