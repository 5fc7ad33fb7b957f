# make fusion-study: the acceptance numbers of event-triggered fusion at full size (1000 runs a case, courses of 10^5 and 10^6 samples). The quick half of it
# is tests/host/test_fusion.py.

.PHONY: fusion-study
fusion-study: lib ## event-triggered fusion: all acceptance numbers with 1000 runs a case, bits on the wire; minutes (HULLGUARD_SEED=n: other noise)
	@PYTHONPATH=host_tools $(PY) tests/fusion/study.py
