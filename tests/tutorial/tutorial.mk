# The tutorial, followed to the letter: here, in an empty folder, and on a bare Debian, from the clone on.

TUTORIAL_RUN := tests/tutorial/run.py

.PHONY: tutorial tutorial-bare
tutorial: lib with-vcan ## follow host_tools/docs/tutorial.md to the letter in an empty folder, and compare what it shows
	@$(PY) $(TUTORIAL_RUN) $(BUILD)/tutorial --results $(BUILD)/results/tutorial.json
tutorial-bare: ## the same on a bare Debian 12, made here with debootstrap, from git clone on; needs root
	@tests/tutorial/bare.sh $(BUILD)/tutorial-bare

CHECK_PARTS += tutorial
DEEP_PARTS += tutorial-bare
