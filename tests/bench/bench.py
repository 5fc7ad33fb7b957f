"""Complete plant samples per second and core in a campaign: plant, triggers, codec, losses, holds, residual generators, hulls, decision.

One process, one core; each model is measured REPEATS times after a warm-up, and the median counts. A median below DEMANDED fails.
"""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "host_tools"))

from hullguard.core.library import library
from hullguard.core.native import Batch, Native
from hullguard.design.design import Design, design
from hullguard.model import load_model
from hullguard.model.schema import SHIPPED

DEMANDED = 2e5
REPEATS = 3
SAMPLES = 200
SECONDS = 2.0  # of each measurement, about
LOSS = 0.1


def detector(made: Design) -> str:
    """What runs on each sample, in words."""
    orders = [g.spec.order for g in made.generators]
    return f"{len(orders)} observer{'s' * (len(orders) > 1)}, order {'/'.join(str(o) for o in sorted(set(orders)))}, {made.tables.residuals} residuals, {max(g.taps for g in made.tables.generators)} taps"


def speed(batch: Batch, runs: int) -> float:
    """Samples a second of this process's time on its core, whoever else uses the machine."""
    began = time.process_time()
    batch.runs(0, runs)
    return runs * SAMPLES / (time.process_time() - began)


def main() -> int:
    slow = []
    print(f"{'model':<10} {'real':<5} {'detector':<50} {'samples/s/core':>15}   each")
    for path in sorted(SHIPPED.glob("*.toml")):
        if path.name.endswith(".design.toml"):
            continue
        model = load_model(str(path))
        made = design(model)[0]
        for real in ("f32", "f64"):
            batch = Batch(Native(library(real), made.tables), made, SAMPLES, model.scenarios[0].reference, (), 1, LOSS)
            runs = max(1, int(speed(batch, 50) * SECONDS / SAMPLES))
            found = [speed(batch, runs) for _ in range(REPEATS)]
            median = statistics.median(found)
            print(f"{model.name:<10} {real:<5} {detector(made):<50} {median:15.3g}   {', '.join(f'{f:.3g}' for f in found)}", flush=True)
            if median < DEMANDED:
                slow.append(f"{model.name} ({real})")
    if slow:
        print(f"below {DEMANDED:.0e} samples a second and core: {', '.join(slow)}", file=sys.stderr)
    return 1 if slow else 0


if __name__ == "__main__":
    sys.exit(main())
