.PHONY: lint
lint: ## static checks: MISRA C:2012 (and that this gate can fail), cppcheck, ruff, mypy
	@tests/lint/lint.sh
