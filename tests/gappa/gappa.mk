.PHONY: gappa
gappa: lib ## the design's bounds of rounding hold for the arithmetic of the C code (Gappa)
	@PYTHONPATH=host_tools $(PY) tests/gappa/gappa.py $(BUILD)/results/gappa.json $(BUILD)/gappa
CHECK_PARTS += gappa
