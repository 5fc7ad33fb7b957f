# Proof that the gates can fail: a realistic fault in a copy of the tree, and its gate must turn red (seeded.py has the form of the entries, GATE.toml). `make check` draws one
# fault a gate, after all other parts, so that the copies begin with what those have built.

# Their own recipes seed their own faults: tests/target/seeded beside check_image and corpus, tests/lint/seeded.sh beside MISRA.
.PHONY: seeded seeded-deep
seeded: ## proof that the gates can fail: one seeded fault a gate, drawn (HULLGUARD_SEED=n; GATE=name: all of that one; FAULT=part of a name)
	@BUILD=$(BUILD) $(PY) tests/seeded/seeded.py $(if $(GATE),--gate $(GATE) $(if $(FAULT),--fault '$(FAULT)'),--gates $(filter-out seeded,$(GATES)))
seeded-deep: ## every seeded fault; each gate must pass without it, too
	@BUILD=$(BUILD) $(PY) tests/seeded/seeded.py --all --gates $(filter-out seeded,$(GATES))
