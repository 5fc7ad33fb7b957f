"""The same frames through detectors of every number type: verdicts differ only where a residual is as close to its threshold as rounding can move both.

    compare.py [RUNS] [MODEL ...]        fails on the first difference that rounding does not explain, and on any false alarm

Frames come from float32 senders; each detector gets them all, or, in a third of the runs, misses every tenth measurement frame. Half of the runs have a
fault, so small that it is near the threshold for long. With |r| and J of two types, an alarm of one and not of the other is explained when
| |r| - J | <= |J - J'| + e_r in double precision: both thresholds are sound, so they differ by rounding alone, and e_r is what rounding is proven to
move the residual by.
"""

from __future__ import annotations

import os
import random
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache

import numpy as np

from hullguard.core.library import library
from hullguard.core.native import REST, Native, Node, Plant, Sender
from hullguard.design.design import Design, design
from hullguard.model import load_model, parse_fault
from hullguard.model.schema import Reference
from hullguard.model.table import Array

TYPES = ("f64", "f32", "q31")
SAMPLES, START = 160, 60
ALARMS = ("provisional", "confirmed")


@dataclass(frozen=True)
class Tally:
    """What a number of runs found."""

    runs: int
    samples: int
    false_alarms: int
    differing: int  # samples in which two types disagree on an alarm
    unexplained: tuple[str, ...]
    closest: float  # of the explained ones: largest part of what rounding may do

    def __add__(self, other: Tally) -> Tally:
        both = (self.runs + other.runs, self.samples + other.samples, self.false_alarms + other.false_alarms, self.differing + other.differing)
        return Tally(*both, (*self.unexplained, *other.unexplained), max(self.closest, other.closest))


@cache
def _ready(name: str) -> tuple[Design, dict[str, Native], Array]:
    made = design(load_model(name))[0]
    lost32 = np.concatenate([g.tables.rounding for g in made.generators] + [np.zeros(len(made.tables.banks))])
    # The banks' rounding in float32 is a share of the bias; a thousandth of it is far more.
    for i, bank in enumerate(made.tables.banks):
        lost32[len(lost32) - len(made.tables.banks) + i] = 1e-3 * max(bank.bias)
    return made, {t: Native(library(t), made.tables) for t in TYPES}, lost32 + np.array(made.fixed_rounding)


def one(name: str, seed: int, run: int) -> Tally:
    """One run."""
    made, natives, rounding = _ready(name)
    dice = random.Random(f"{seed} {run}")
    faults = []
    if run % 2:
        fault = dice.choice(made.model.faults)
        faults = [parse_fault(f"{fault.name}:bias:{dice.uniform(0.02, 1.5):.4f}@{START}")]
    reference = Reference(dice.choice(("rest", "steps", "mixed")), 1.0, dice.randint(10, 60))
    plant, sender = Plant(natives["f32"], made, reference, faults, seed, run), Sender(natives["f32"])
    nodes = {t: Node(natives[t], REST) for t in TYPES}
    lossy, closing = run % 3 == 0, made.tables.closing
    differing, false, closest, unexplained = 0, 0, 0.0, []
    for k in range(SAMPLES):
        reading = plant.read()
        for g in (*(g for g in range(len(made.tables.groups)) if g != closing), closing):
            frame = sender.step(g, k, reading)
            if frame is None or (lossy and g != closing and dice.random() < 0.1):
                continue
            for node in nodes.values():
                node.receive(frame)
        plant.move()
        verdicts = {t: node.step() for t, node in nodes.items()}
        false += sum(v is not None and v.plant == "confirmed" for v in verdicts.values()) if not faults or k < START else 0
        differing, closest = _compare(nodes, rounding, unexplained, f"run {run} sample {k}", differing, closest)
    return Tally(1, SAMPLES, false, differing, tuple(unexplained), closest)


def _compare(nodes: dict[str, Node], rounding: Array, unexplained: list[str], where: str, differing: int, closest: float) -> tuple[int, float]:
    r, J = np.abs(nodes["f64"].r), np.array(nodes["f64"].J)
    for t in ("f32", "q31"):
        own_r, own_J = np.abs(nodes[t].r), np.array(nodes[t].J)
        for i in np.flatnonzero((r > J) != (own_r > own_J)):
            allowed = abs(J[i] - own_J[i]) + rounding[i]
            part = abs(r[i] - J[i]) / allowed
            differing, closest = differing + 1, max(closest, part)
            if part > 1:
                unexplained.append(f"{where}: {t}, residual {i}: f64 |r| {r[i]:.9g} J {J[i]:.9g}, here {own_r[i]:.9g} and {own_J[i]:.9g}; rounding explains {allowed:.3g}")
    return differing, closest


def many(name: str, seed: int, first: int, count: int) -> Tally:
    """Runs first .. first + count - 1."""
    tally = Tally(0, 0, 0, 0, (), 0.0)
    for run in range(first, first + count):
        tally += one(name, seed, run)
    return tally


def main() -> int:
    """Report, and the exit status."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    seed = int(os.environ.get("HULLGUARD_SEED", "1"))
    print(f"seed {seed}")
    status = 0
    for name in sys.argv[2:] or ["platoon"]:
        with ProcessPoolExecutor() as pool:
            step = max(runs // 100, 1)
            jobs = [pool.submit(many, name, seed, first, min(step, runs - first)) for first in range(0, runs, step)]
            total = sum((j.result() for j in jobs), Tally(0, 0, 0, 0, (), 0.0))
        f32, q31 = (100 * max(_ready(name)[0].rounding_shares(real)) for real in ("f32", "q31"))
        print(f"{name}: {total.runs} runs, {total.samples} samples, {len(TYPES)} number types; rounding at most {f32:.3f} % of a threshold in float32, {q31:.4f} % in fixed point")
        print(f"  samples with false alarms {total.false_alarms}; alarms that differ {total.differing}, unexplained {len(total.unexplained)}; "
              f"the closest used {100 * total.closest:.0f} % of what rounding explains")
        for line in total.unexplained[:20]:
            print("  " + line)
        status = status or int(total.false_alarms > 0 or bool(total.unexplained))
    return status


if __name__ == "__main__":
    sys.exit(main())
