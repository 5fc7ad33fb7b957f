# The shipped suspension on random roads. `make test` drives a few seconds, `make suspension-study` 10 000 at each sample rate, which takes some ten minutes.

.PHONY: suspension-study suspension-short
suspension-study: lib ## 10 000 s of roads: false alarms, frames, delays, parts named
	$(PY) tests/suspension/study.py

suspension-short: lib
	@$(PY) tests/suspension/study.py 6 3 >$(BUILD)/suspension.log 2>&1 || { cat $(BUILD)/suspension.log; exit 1; }
	@echo "  ok  suspension on random roads"
	@$(RESULT) $@ 'on random roads the suspension raises no false alarm, finds forces and reads them, and names weak parts as often as it has to' 'seconds of road: all numbers met'
TEST_PARTS += suspension-short
