"""What the shipped suspension reaches on random roads, against what it has to: false alarms, frames, forces found and read, parts named.

    study.py [SECONDS] [RUNS]        of quiet road a sample rate (10 000), and of each kind of fault (200); fails where a number is missed

All roads are ISO 8608 at 20 m/s. A part is named twice: where the guaranteed radius opens an episode, as the library does beside a detector, and where a
limit that rests on experience does (LIMIT_N; radii 0): what events and the road could do at worst is several times what they do.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace

import numpy as np
from exact import series
from hullguard.core.library import library
from hullguard.core.native import Batch, Native
from hullguard.core.native_uio import Uio, UioTable
from hullguard.design.design import Design, design
from hullguard.design.uio_generator import uio_table
from hullguard.design.uio_isolate import isolations
from hullguard.design.uio_sensors import component_words
from hullguard.model import load_model, parse_fault
from hullguard.model.schema import Reference
from hullguard.model.table import Array

SCENARIOS = {"default": ("ABC", 200.0), "slow": ("AB", 200.0), "slow_rough": ("C", 250.0)}  # the roads each is for, and the force it has to find
PIECE_S = 250.0  # of quiet road in one go
FOUND_S, READ, SHARE_MAX, NAMED = 0.2, 0.03, 0.45, 0.95
BEFORE_S, AFTER_S, SETTLED_S = 2.0, 10.0, 2.0
OTHER_N = 200.0  # of which the delay is told where another force has to be found
LIMIT_N = 30.0  # about the largest that the estimate of the default scenario gets on quiet roads: experience, no bound
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


def quiet(made: Design, native: Native, classes: str, seconds: float) -> list[Row]:
    """No fault: alarms, and samples with a measurement frame."""
    rows, alarms, period = [], 0, made.model.sample_time_s
    for roughness in classes:
        pieces = max(1, round(seconds / len(classes) / PIECE_S))
        samples = round(seconds / len(classes) / pieces / period)
        frames, margin = 0, 0.0
        for i in range(pieces):
            seed = 1000 + i
            found = batch(made, native, series(made.model, roughness, seed, samples), seed).runs(0, 1)[0]
            alarms += found["false_provisional"] + found["false_confirmed"]
            frames, margin = frames + found["measurement"], max(margin, found["margin_settled"])
        share = frames / (pieces * samples)
        rows.append(Row(f"class {roughness}: samples with an event", f"{share:.3f} (residual up to {margin:.2f} of its threshold)", share <= SHARE_MAX))
    return [Row(f"false alarms in {seconds:g} s of classes {', '.join(classes)}", str(alarms), alarms == 0), *rows]


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


def without_radii(table: UioTable) -> UioTable:
    """The same estimates, all radii 0."""
    none = UioTable(table.actuators, table.sensors, table.unknown, table.states, table.signal, table.state, table.input, table.output, table.direct)
    return replace(none, wide=(0,))


class Cases:
    """Runs with a fault: the observer's estimates, what isolation makes of them with and without radii, the detector's alarm."""

    def __init__(self, made: Design) -> None:
        self.made, self.native = made, Native(library("f32"), made.tables)
        self._own = isolations(made.model, made.uios[0])[0]
        self._table = uio_table(made.uios[0])

    def run(self, roughness: str, seed: int, left: dict[str, float], force_n: float) -> tuple[float, float, str, str]:
        """Delay of the alarm in s (inf: none), mean of the estimate once settled, what the guaranteed and the statistical episode end with."""
        period, made = self.made.model.sample_time_s, self.made
        start, samples = round(BEFORE_S / period), round((BEFORE_S + AFTER_S) / period)
        readings = series(made.model, roughness, seed, samples, start, left, force_n)
        value, radius, first = held(batch(made, self.native, readings, seed, start), samples, made.tables.width)
        told = []
        for table, limit, wide in ((self._table, 0.0, radius), (without_radii(self._table), LIMIT_N, None)):
            beside = Uio(self.native.library, table, replace(self._own.table, limit=limit), made.tables.width)
            run = beside.run(value, wide)
            told.append("+".join(n for i, n in enumerate(self._own.names) if int(run.candidates[-1]) >> i & 1) or "nothing")
        mean = float(run.estimate[start + round(SETTLED_S / period) :, 0].mean())
        return ((first - start) * period if first >= 0 else float("inf")), mean, told[0], told[1]


def forces(cases: Cases, classes: str, force_n: float, runs: int, asked: bool) -> list[Row]:
    """An actuator that pushes."""
    rows = []
    for roughness in classes:
        found = [cases.run(roughness, 20000 + i, {}, force_n) for i in range(max(1, runs // len(classes)))]
        delay, off = np.array([f[0] for f in found]), max(abs(f[1] / force_n - 1) for f in found)
        good = bool(delay.max() <= FOUND_S) if asked else None
        rows.append(Row(f"class {roughness}: {force_n:g} N found after", f"{delay.max():.3f} s at most, {np.median(delay):.3f} s mostly", good))
        rows.append(Row(f"class {roughness}: {force_n:g} N read, off by at most", f"{100 * off:.2f} %", off <= READ))
    return rows


def parts(cases: Cases, runs: int, asked: bool) -> list[Row]:
    """Parts that have lost a share of themselves, on the roughest road."""
    rows = []
    for name, left in PARTS.items():
        found = [cases.run("C", 30000 + i, {name: left}, 0.0) for i in range(runs)]
        alarms, guaranteed, usual = (np.mean(x) for x in ([np.isfinite(f[0]) for f in found], [f[2] == name for f in found], [f[3] == name for f in found]))
        rows.append(Row(f"class C: {name} at {left:g}: named, of estimates beyond {LIMIT_N:g} N", f"{usual:.3f} of {runs}", bool(usual >= NAMED) if asked else None))
        rows.append(Row(f"class C: {name} at {left:g}: named, of estimates beyond their radius", f"{guaranteed:.3f} of {runs}; alarm within {AFTER_S:g} s in {alarms:.3f}", None))
    return rows


def main(seconds: float, runs: int) -> int:
    """The table; 1 where a number is missed."""
    bad = 0
    for scenario, (classes, force_n) in SCENARIOS.items():
        made = design(load_model("suspension", scenario=scenario))[0]
        cases = Cases(made)
        rows = [*quiet(made, cases.native, classes, seconds), *forces(cases, classes, force_n, runs, True)]
        rows += forces(cases, classes, OTHER_N, runs, False) if force_n != OTHER_N else []
        rows += parts(cases, runs, scenario == "default") if "C" in classes else []
        said = component_words(made.model)["tyre1"]
        rows.append(Row("a weaker tyre", said.split(":")[0], said.startswith("not observable")))
        print(f"suspension, scenario {scenario}: {1 / made.model.sample_time_s:g} samples a second")
        for row in rows:
            print(f"  {'' if row.good is None else 'ok' if row.good else 'MISSED':6}  {row.what}: {row.found}", flush=True)
            bad += row.good is False
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(float(sys.argv[1]) if len(sys.argv) > 1 else 10000.0, int(sys.argv[2]) if len(sys.argv) > 2 else 200))
