"""Complete plant samples per second and core in a campaign: plant, triggers, codec, losses, holds, residual generators, hulls, decision.

One process, one core; each model is measured REPEATS times after a warm-up, and the median counts. A median below DEMANDED fails, but for models with banks: their
certificates cost what they bring.
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
from hullguard.model.fusion import KIND, kind_of
from hullguard.model.schema import SHIPPED

DEMANDED = 2e5
REPEATS = 3
SAMPLES = 200
SECONDS = 2.0  # of each measurement, about
LOSS = 0.1
VEHICLES = (2, 3, 5, 8, 12, 20)


def detector(made: Design) -> str:
    """What runs on each sample, in words."""
    orders = [g.spec.order for g in made.generators]
    words = [f"{len(orders)} observer{'s' * (len(orders) > 1)} of order {'/'.join(str(o) for o in sorted(set(orders)))}", f"{max(max(g.taps) for g in made.tables.generators)} taps"]
    if made.tables.banks:
        words.append(f"{len(made.tables.banks)} banks of {sum(b.certificates for b in made.tables.banks)} certificates")
    return ", ".join(words)


def speed(batch: Batch, runs: int) -> float:
    """Samples a second of this process's time on its core, whoever else uses the machine."""
    began = time.process_time()
    batch.runs(0, runs)
    return runs * SAMPLES / (time.process_time() - began)


def measured(made: Design, real: str) -> list[float]:
    """Samples a second and core, REPEATS times."""
    batch = Batch(Native(library(real), made.tables), made, SAMPLES, made.model.scenarios[0].reference, (), 1, LOSS)
    runs = max(1, int(speed(batch, 50) * SECONDS / SAMPLES))
    return [speed(batch, runs) for _ in range(REPEATS)]


def shipped() -> list[str]:
    """A line a model and number type; those that are too slow."""
    slow = []
    print(f"{'model':<13} {'real':<5} {'detector':<72} {'samples/s/core':>15}   each")
    for path in sorted(SHIPPED.glob("*.toml")):
        if path.name.endswith(".design.toml"):
            continue
        if kind_of(str(path)) == KIND:
            continue  # a fusion filter has no campaign; its batches are make fusion-study's
        made = design(load_model(str(path)))[0]
        for real in ("f32", "f64"):
            found = measured(made, real)
            median = statistics.median(found)
            print(f"{made.model.name:<13} {real:<5} {detector(made):<72} {median:15.3g}   {', '.join(f'{f:.3g}' for f in found)}", flush=True)
            if median < DEMANDED and made.model.detector.bank is None:
                slow.append(f"{made.model.name} ({real})")
    return slow


def lengths() -> None:
    """Platoons of any length: how long their design takes, and what a sample costs."""
    print(f"\n{'vehicles':>8} {'generators':>11} {'signals':>8} {'bytes':>6} {'design, s':>10} {'smallest fault':>15} {'samples/s/core':>15}")
    for vehicles in VEHICLES:
        model = load_model("platoon", {"plant.vehicles": vehicles}, "manoeuvres")
        began = time.process_time()
        made = design(model, fresh=True)[0]
        took = time.process_time() - began
        smallest = [float(x) for g in made.generators for x in g.smallest]
        longest = max(g.message.length for g in made.tables.groups)
        print(
            f"{vehicles:>8} {len(made.generators):>11} {made.tables.signals:>8} {longest:>6} {took:>10.1f} {f'{min(smallest):.2f} .. {max(smallest):.2f}':>15}"
            f" {statistics.median(measured(made, 'f32')):>15.3g}",
            flush=True,
        )


def main() -> int:
    """Both tables."""
    slow = shipped()
    lengths()
    if slow:
        print(f"below {DEMANDED:.0e} samples a second and core: {', '.join(slow)}", file=sys.stderr)
    return 1 if slow else 0


if __name__ == "__main__":
    sys.exit(main())
