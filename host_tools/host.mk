# The host tools: the demo, generated models, the recorded drive, and their tests.

HULLGUARD := .venv/bin/hullguard
SHIPPED   := $(filter-out %.design,$(patsubst host_tools/models/%.toml,%,$(wildcard host_tools/models/*.toml)))

.PHONY: demo
demo: ## set up, then run the platoon with a controller fault on the best bus at hand; report in build/demo/
	@host_tools/setup.sh demo
	@$(MAKE) lib apps with-vcan
	@$(HULLGUARD) run platoon --speed 10 --expect detect --out $(BUILD)/demo
	@echo "look at $(BUILD)/demo/report.html"

.PHONY: models
models: lib ## generate firmware/models/ from host_tools/models/ again
	@for m in $(SHIPPED); do $(HULLGUARD) design $$m --quiet --out $(BUILD)/models/$$m || exit 1; \
	  cp $(BUILD)/models/$$m/$$m*.h $(BUILD)/models/$$m/$$m*.c $(BUILD)/models/$$m/$$m.dbc firmware/models/; echo "  ok  $$m"; done

.PHONY: amalgam
amalgam: lib ## the library with MODEL's tables (platoon) as two files: build/hullguard.h and build/hullguard.c
	@$(HULLGUARD) amalgam $(MODEL) --out $(BUILD)

.PHONY: openacc
openacc: ## the openacc model on a recorded drive: make openacc DATA=FILE.csv
	@host_tools/setup.sh demo
	@$(MAKE) lib
	@test -n "$(DATA)" || { echo "make openacc needs a recording: make openacc DATA=FILE.csv" >&2; exit 2; }
	@$(PY) tests/openacc/openacc.py $(DATA)

.PHONY: openacc-identify
openacc-identify: lib ## bounds of the openacc model from the first half of a recorded drive, checked on the rest: make openacc-identify DATA=FILE.csv
	@test -n "$(DATA)" || { echo "make openacc-identify needs a recording: make openacc-identify DATA=FILE.csv" >&2; exit 2; }
	@$(HULLGUARD) identify openacc --csv $(DATA) --noise --margin 0.2 --out $(BUILD)/openacc-identify --force
	@$(HULLGUARD) design $(BUILD)/openacc-identify/openacc.toml --quiet --out $(BUILD)/openacc-identify
	@$(HULLGUARD) replay $(BUILD)/openacc-identify/openacc.toml --csv $(DATA) --noise --bus inprocess --json --expect quiet >$(BUILD)/openacc-identify/replay.json
	@echo "  ok  no alarm in a replay of the whole drive"

.PHONY: openacc-generated
openacc-generated: lib
	@$(PY) tests/openacc/openacc.py --generated --misses $(BUILD)/openacc-generated-misses.txt
	@$(RESULT) $@ 'on a drive of five cars no alarm is false, small steps of every sensor are found in time, and fewer bits are sent than the limit' 'all limits met'

# What `make trust` runs, in `make check`, is left to it. The node's tests keep real time and mostly wait; the host's are dealt out by file to a process for each processor.
pytest_run = $$(sed -n 's/.*<testsuite [^>]*tests="\([0-9]*\)".*/\1/p' $(BUILD)/$(1).xml)
PYTEST = HULLGUARD_SEED=$${HULLGUARD_SEED:-1} $(PY) -m pytest -q -p no:cacheprovider

.PHONY: pytest pytest-host pytest-node pytest-wrong
pytest: pytest-host pytest-node ## tests of the host tools, and of the node on vcan (HULLGUARD_SEED=n: other random cases)
pytest-host: lib apps with-vcan $(BUILD)/oracle/oracle_run
	@$(PYTEST) -n $(shell nproc) --dist loadfile --junitxml=$(BUILD)/pytest-host.xml --ignore=tests/host/test_trust.py -m 'not wrong' tests/host
	@$(RESULT) $@ 'the host tools do what they say: design, tables, runs, reports, faults on the bus; soundness of random designs' "$(call pytest_run,$@) tests passed"
pytest-node: lib apps with-vcan $(BUILD)/oracle/oracle_run
	@$(PYTEST) --junitxml=$(BUILD)/pytest-node.xml --ignore=tests/node/test_freeze_bus.py tests/node
	@$(RESULT) $@ 'the detector node as a process on a CAN bus answers like one in process, keeps its deadlines, and tells every misbehaviour of the bus' "$(call pytest_run,$@) tests passed"

pytest-wrong: lib
	@$(PYTEST) --junitxml=$(BUILD)/pytest-wrong.xml -m wrong tests/host
	@$(RESULT) $@ 'runs in search of false alarms find them with each library that is wrong on purpose: a share of the threshold left out, a hold without its silence, nothing taken back after a gap' "$(call pytest_run,$@) tests passed"

TEST_PARTS += openacc-generated lint
CHECK_PARTS += coverage pytest-wrong
