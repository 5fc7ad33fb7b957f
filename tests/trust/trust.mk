# make trust: every bit of the platoon's tables flipped and seen, in float32 and fixed point; a wrong table or instruction stops the node; freeze frames and model hashes on vcan.

.PHONY: trust
trust: lib apps with-vcan ## digests, self-tests, freeze frames and model hashes: every bit of the platoon's tables; nodes on vcan
	@$(PYTEST) -s tests/host/test_trust.py >$(BUILD)/trust.log 2>&1 || { cat $(BUILD)/trust.log; exit 1; }
	@$(PYTEST) tests/node/test_freeze_bus.py
	@$(RESULT) $@ \
	    'A node does not start with a single wrong bit in any number of its constant tables.' \
	    "$$(grep -o '[0-9]* single bits of .* all detected' $(BUILD)/trust.log | paste -sd';' | sed 's/;/; /g')" \
	    'A wrong instruction of the detector fails the self-test, which runs on every start.' 'seeded in residual.c and decision.c: both found' \
	    'What hullguard freeze reads from a node, over a bus that loses and damages frames, is to the bit what the node has recorded, and reading changes no verdict.' \
	    'platoon_bank, 16 samples, every seventh response lost' \
	    'An ECU that runs another model than the one named is told with both hashes, and an exit status of 1.' 'plant, detect, monitor'
CHECK_PARTS += trust
