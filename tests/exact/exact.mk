# Soundness against exact numbers: the library in rational arithmetic, and the search for a fault-free run that alarms (exact.py). `make check` makes some hundred runs.

EXACT = BUILD=$(BUILD) OMP_NUM_THREADS=1 PYTHONPATH=host_tools:tests/promises:tests/host $(PY) tests/exact/exact.py

.PHONY: exact exact-deep
exact: lib ## values, radii, residuals and thresholds against exact rational numbers; worst cases by linear programme (HULLGUARD_SEED=n repeats; MODELS_OF="platoon ..")
	@$(EXACT) $(if $(MODELS_OF),--only $(MODELS_OF))
exact-deep: lib ## the same ten times over
	@$(EXACT) --deep
CHECK_PARTS += exact
DEEP_PARTS += exact-deep
