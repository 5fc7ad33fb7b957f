# tests/PROMISES.md: what every gate promises, with the result it last had. A gate is a part of `make test` or `make check` that verifies; the last line of its
# recipe is `@$(RESULT) $@ 'PROMISE' 'RESULT' ..`, reached only when it has passed.
# `make check` ends with promises-check, when every part has spoken.

RESULT = BUILD=$(BUILD) $(PY) tests/promises/result.py
CHECK_GATES = $(filter-out lib apps,$(CHECK_PARTS)) seeded
GATES  = $(sort $(filter-out lib apps,$(TEST_PARTS)) $(CHECK_GATES))

# $(call tests_run,LOGS): how many CMocka tests passed in them.
tests_run = $$(cat $(1) | grep -c '^\[       OK \]')

.PHONY: promises promises-check
promises: ## tests/PROMISES.md from what the gates said when they last passed
	@BUILD=$(BUILD) $(PY) tests/promises/promises.py $(GATES)
promises-check:
	@BUILD=$(BUILD) $(PY) tests/promises/promises.py --check $(CHECK_GATES)
