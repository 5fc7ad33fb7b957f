.PHONY: lint
lint: ## static checks: MISRA C:2012 (and that this gate can fail), cppcheck, ruff, mypy
	@tests/lint/lint.sh
	@$(RESULT) $@ 'the library keeps to MISRA C:2012 but for the deviations that are marked where they are, with a reason' 'no finding; each seeded violation found' \
	    'cppcheck has no finding in hal/; ruff and mypy --strict have none in host_tools/' 'no finding'

.PHONY: deviations
deviations: ## write the table of deviations from MISRA anew, where their numbers have fallen
	@mkdir -p $(BUILD)/lint
	@tests/lint/misra.sh . $(BUILD)/lint/misra
	@tests/lint/hal.sh $(BUILD)/lint/hal
	@$(PY) tests/lint/deviations.py table --write tests/lint/DEVIATIONS.md $(BUILD)/lint/misra $(BUILD)/lint/hal

.PHONY: tidy
CHECK_PARTS += tidy
tidy: ## clang-tidy and gcc -fanalyzer over library, HAL and applications (TIDY=file: of one)
	@BUILD=$(BUILD) TIDY=$(TIDY) tests/lint/tidy.sh
