.PHONY: lint
lint: ## static checks: MISRA C:2012 (and that this gate can fail), cppcheck, ruff, mypy
	@tests/lint/lint.sh
	@$(RESULT) $@ 'the library keeps to MISRA C:2012 but for the deviations that are marked where they are, with a reason' 'no finding; each seeded violation found' \
	    'cppcheck has no finding in hal/; ruff and mypy --strict have none in host_tools/' 'no finding'
