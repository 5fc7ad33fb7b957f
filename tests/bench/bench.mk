# make bench: how fast campaigns are. Not a part of make test: it measures the machine too.

.PHONY: bench
bench: lib ## plant samples per second and core in a campaign, of every shipped model; fails below 2e5
	@$(PY) tests/bench/bench.py
