# The same frames through detectors of every number type. `make test` makes few runs, `make fixed` 10^4.

.PHONY: fixed fixed-short
fixed: lib ## 10 000 runs in float64, float32 and fixed point: verdicts differ only where rounding explains it
	$(PY) tests/fixed/compare.py 10000 platoon

fixed-short: lib
	@$(PY) tests/fixed/compare.py 60 platoon platoon_bank openacc >$(BUILD)/fixed.log 2>&1 || { cat $(BUILD)/fixed.log; exit 1; }
	@echo "  ok  number types agree"
	@$(RESULT) $@ 'detectors in float64, float32 and fixed point give the same verdicts on the same frames but where rounding explains it, and no false alarm' \
	    "$$(grep -c 'unexplained 0;' $(BUILD)/fixed.log) models, 60 runs each, no difference unexplained"
TEST_PARTS += fixed-short
