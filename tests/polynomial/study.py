"""All checks of the polynomial study at full size on three seeds, one line each; exit status 1 when a check fails. HULLGUARD_SEED=n: that seed alone."""

from __future__ import annotations

import os
import sys

from hullguard.campaign import polynomial_study as study

RUNS = 300
SEEDS = (7, 1001, 2002)  # the first is that of the method's figures


def main() -> int:
    """Print every check as it is made."""
    seed_of = os.environ.get("HULLGUARD_SEED")
    failed = 0
    for seed in SEEDS if seed_of is None else (int(seed_of),):
        print(f"HULLGUARD_SEED={seed}", flush=True)
        for check in study.all_checks(RUNS, seed):
            print(check, flush=True)
            failed += not check.passed
    print(f"\n{failed} checks failed" if failed else "\nall checks passed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
