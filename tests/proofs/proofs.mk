# make proofs: bounded model checking of the library by CBMC, every public function; make proofs-deep: at the largest sizes that end.
# PROOFS=hold chooses by parts of names. JOBS= runs at a time.

CBMC := $(BUILD)/tools/cbmc
PROOFS :=

.PHONY: proofs proofs-deep
CHECK_PARTS += proofs
DEEP_PARTS += proofs-deep
proofs: $(CBMC)/bin/cbmc ## proofs by bounded model checking: no undefined behaviour, and what the headers promise (PROOFS=hold chooses)
	@BUILD=$(BUILD) $(PY) tests/proofs/proofs.py $(JOBS:%=--jobs %) $(PROOFS)
proofs-deep: $(CBMC)/bin/cbmc ## the same at larger sizes, which takes hours
	@BUILD=$(BUILD) $(PY) tests/proofs/proofs.py --deep $(JOBS:%=--jobs %) $(PROOFS)
$(CBMC)/bin/cbmc: tests/proofs/cbmc.sh
	@sh $< $(CBMC)
	@touch $@
