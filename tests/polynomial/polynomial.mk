# make polynomial-study: the acceptance numbers of the polynomial filter with 300 runs a case. The quick half of it is tests/host/test_polynomial.py.

.PHONY: polynomial-study
polynomial-study: lib ## polynomial filter: all acceptance numbers with 300 runs a case on three seeds; minutes (HULLGUARD_SEED=n: that one alone)
	@PYTHONPATH=host_tools $(PY) tests/polynomial/study.py
