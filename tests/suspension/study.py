"""What the shipped suspension reaches on random roads, against what it has to: false alarms, frames, forces found and read, parts named.

    study.py [SECONDS] [RUNS]        of quiet road a sample rate (10 000), and of each kind of fault (200); fails where a number is missed

All roads are ISO 8608 at 20 m/s, 1 000 and 100 samples a second. Delays are those of the alarm; parts are named by what follows the detector on an ECU.
Roads, noise and starts are of seeds that no setting of the model was chosen with.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from exact import series
from hullguard.core.library import library
from hullguard.core.native import Batch, Native
from hullguard.core.native_uio import Uio
from hullguard.design.design import Design, design
from hullguard.design.uio_generator import uio_table
from hullguard.design.uio_isolate import isolations
from hullguard.design.uio_sensors import component_words
from hullguard.model import load_model, parse_fault
from hullguard.model.schema import Reference
from hullguard.model.table import Array

SCENARIOS = ("default", "slow")
CLASSES = "ABC"
FORCE_N = 200.0
SEEDS = {"quiet": 700_000, "force": 710_000, "part": 720_000}  # the first of each
PIECE_S = 250.0  # of quiet road in one go
FOUND_S, READ, SHARE_MAX, NAMED = 0.2, 0.03, 0.45, 0.95
BEFORE_S, AFTER_S, SETTLED_S = 2.0, 10.0, 2.0
PARTS = {"spring1": 0.8, "damper1": 0.5}
ZERO = "actuator1:bias:0@{}"  # tells the emulator when what comes is no false alarm


@dataclass(frozen=True)
class Row:
    """One number."""

    what: str
    found: str
    good: bool | None  # None: nothing is asked of it


def batch(made: Design, native: Native, readings: Array, seed: int, start: int | None = None) -> Batch:
    """Readings with the sensors' noise, through triggers, frames and detector."""
    faults = [] if start is None else [parse_fault(ZERO.format(start))]
    return Batch(native, made, len(readings), Reference("rest", 0.0, 1), faults=faults, seed=seed, series=readings, noise=True)


def quiet(made: Design, native: Native, seconds: float) -> list[Row]:
    """No fault: alarms, and samples with a measurement frame."""
    rows, alarms, period = [], 0, made.model.sample_time_s
    for roughness in CLASSES:
        pieces = max(1, round(seconds / len(CLASSES) / PIECE_S))
        samples = round(seconds / len(CLASSES) / pieces / period)
        frames, margin = 0, 0.0
        for i in range(pieces):
            seed = SEEDS["quiet"] + i
            found = batch(made, native, series(made.model, roughness, seed, samples), seed).runs(0, 1)[0]
            alarms += found["false_provisional"] + found["false_confirmed"]
            frames, margin = frames + found["measurement"], max(margin, found["margin_settled"])
        share = frames / (pieces * samples)
        rows.append(Row(f"class {roughness}: samples with an event", f"{share:.3f} (residual up to {margin:.2f} of its threshold)", share <= SHARE_MAX))
    return [Row(f"false alarms in {seconds:g} s of classes {', '.join(CLASSES)}", str(alarms), alarms == 0), *rows]


def held(run: Batch, samples: int, width: int) -> tuple[Array, Array, int]:
    """Values and radii that the detector held (samples x width), and the first alarm after the fault, or -1."""
    lib, ffi = run._native.library.lib, run._native.library.ffi
    value, radius = np.empty((samples, width)), np.empty((samples, width))
    made = lib.hgh_run_new(run.config, 0)
    for k in range(samples):
        lib.hgh_run_steps(made, 1)
        view = lib.hgh_run_view(made)
        value[k] = np.frombuffer(ffi.buffer(view.value, 8 * width))
        radius[k] = np.frombuffer(ffi.buffer(view.radius, 8 * width))
    first = int(lib.hgh_run_result(made).provisional_at)
    lib.hgh_run_free(made)
    return value, radius, first


class Cases:
    """Runs with a fault: the first observer's estimates, what isolation makes of them, the detector's alarm."""

    def __init__(self, made: Design) -> None:
        self.made, self.native = made, Native(library("f32"), made.tables)
        self._own = isolations(made.model, made.uios[0])[0]
        self._table = uio_table(made.uios[0])

    def run(self, roughness: str, seed: int, left: dict[str, float], force_n: float) -> tuple[float, float, str]:
        """Delay of the alarm in s (inf: none), mean of the estimate once settled, and what isolation ends with."""
        period, made = self.made.model.sample_time_s, self.made
        start, samples = round(BEFORE_S / period), round((BEFORE_S + AFTER_S) / period)
        readings = series(made.model, roughness, seed, samples, start, left, force_n)
        value, radius, first = held(batch(made, self.native, readings, seed, start), samples, made.tables.width)
        run = Uio(self.native.library, self._table, self._own.table, made.tables.width).run(value, radius)
        told = "+".join(n for i, n in enumerate(self._own.names) if int(run.candidates[-1]) >> i & 1) or "nothing"
        mean = float(run.estimate[start + round(SETTLED_S / period) :, 0].mean())
        return ((first - start) * period if first >= 0 else float("inf")), mean, told


def forces(cases: Cases, runs: int) -> list[Row]:
    """An actuator that pushes."""
    rows = []
    for roughness in CLASSES:
        found = [cases.run(roughness, SEEDS["force"] + i, {}, FORCE_N) for i in range(max(1, runs // len(CLASSES)))]
        delay, off = np.array([f[0] for f in found]), max(abs(f[1] / FORCE_N - 1) for f in found)
        rows.append(Row(f"class {roughness}: {FORCE_N:g} N found after", f"{delay.max():.3f} s at most, {np.median(delay):.3f} s mostly", bool(delay.max() <= FOUND_S)))
        rows.append(Row(f"class {roughness}: {FORCE_N:g} N read, off by at most", f"{100 * off:.2f} %", off <= READ))
    return rows


def parts(cases: Cases, runs: int, asked: bool) -> list[Row]:
    """Parts that have lost a share of themselves, on the roughest road."""
    rows = []
    for name, left in PARTS.items():
        found = [cases.run("C", SEEDS["part"] + i, {name: left}, 0.0) for i in range(runs)]
        delay, named = np.array([f[0] for f in found]), float(np.mean([f[2] == name for f in found]))
        alarms = f"alarm within {AFTER_S:g} s in {np.mean(np.isfinite(delay)):.3f}, after {np.median(delay):.2f} s mostly"
        rows.append(Row(f"class C: {name} at {left:g}: named", f"{named:.3f} of {runs}; {alarms}", bool(named >= NAMED) if asked else None))
    return rows


def main(seconds: float, runs: int) -> int:
    """The table; 1 where a number is missed."""
    bad = 0
    for scenario in SCENARIOS:
        made = design(load_model("suspension", scenario=scenario))[0]
        cases = Cases(made)
        said = component_words(made.model)["tyre1"]
        print(f"suspension, scenario {scenario}: {1 / made.model.sample_time_s:g} samples a second")
        for row in (
            *quiet(made, cases.native, seconds),
            *forces(cases, runs),
            *parts(cases, runs, scenario == "default"),
            Row("a weaker tyre", said.split(":")[0], said.startswith("not observable")),
        ):
            print(f"  {'' if row.good is None else 'ok' if row.good else 'MISSED':6}  {row.what}: {row.found}", flush=True)
            bad += row.good is False
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(float(sys.argv[1]) if len(sys.argv) > 1 else 10000.0, int(sys.argv[2]) if len(sys.argv) > 2 else 200))
