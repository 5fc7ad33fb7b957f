# Documentation: the API reference from the headers, the pages as HTML, and every picture and measured number from the commands beside them.

.PHONY: docs figures figures-check
docs: ## build/docs/: the headers as a manual, and all pages, as HTML; fails where something is not explained or a link leads nowhere
	@$(PY) tests/docs/manual.py $(BUILD)/docs

figures: lib tutorial ## make every picture and every measured table of the documentation again, from commands
	@$(PY) tests/docs/figures.py
	@cp $(BUILD)/tutorial/work/run.png host_tools/pictures/motor.png

figures-check: lib ## are they what their commands make? ONLY="monitor.svg ..": only these pictures
	@$(PY) tests/docs/figures.py --check $(ONLY)
CHECK_PARTS += docs
DEEP_PARTS += figures-check# searches end elsewhere in the last digits on another processor
