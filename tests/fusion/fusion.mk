# make fusion-study: the acceptance numbers of event-triggered fusion at full size (1000 runs a case, courses of 10^5 and 10^6 samples). The quick half of it
# is tests/host/test_fusion.py.

.PHONY: fusion-study
fusion-study: lib ## event-triggered fusion: all acceptance numbers with 1000 runs a case, bits on the wire; minutes (HULLGUARD_SEED=n: other noise)
	@PYTHONPATH=host_tools $(PY) tests/fusion/study.py

# make fusion-bus: emulator, every node's copy and the Linux node over 10^5 samples with 15 % of the frames lost, on a bus and without one: one digest. Minutes.
.PHONY: fusion-bus
fusion-bus: lib apps with-vcan ## event-triggered fusion on a bus: all nodes equal to the bit over 10^5 samples with 15 % loss (SAMPLES=n)
	@PYTHONPATH=host_tools $(PY) tests/fusion/same.py $(or $(SAMPLES),100000)

# The tracking model on a recorded drive, as make openacc does it.
.PHONY: tracking
tracking: ## the tracking model on a recorded drive: make tracking DATA=FILE.csv
	@host_tools/setup.sh demo
	@$(MAKE) lib
	@test -n "$(DATA)" || { echo "make tracking needs a recording: make tracking DATA=FILE.csv" >&2; exit 2; }
	@PYTHONPATH=host_tools $(PY) tests/fusion/recorded.py $(DATA)
