# Declarations for cffi: the preprocessed host header, one a number type. The host tools read them beside the shared library.

DECLARATIONS := $(REALS:%=$(BUILD)/lib/hullguard_%.i)
lib: $(DECLARATIONS)

define declarations
$(BUILD)/lib/hullguard_$(1).i: host_tools/hullguard/core/host.h $(wildcard host_tools/hullguard/core/*.h firmware/include/hullguard/*.h)
	@mkdir -p $$(@D)
	$$(Q)$$(CC) -E -P -nostdinc $(REAL_FLAG_$(1)) -Ihost_tools/hullguard/core/declare -Ifirmware/include $$< -o $$@
endef
$(foreach r,$(REALS),$(eval $(call declarations,$(r))))
