"""What polynomial filters of each degree make of one run, by the C library, from the values and radii that the detector held: one model, three filters side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hullguard.core.library import Library
from hullguard.core.native import Plant
from hullguard.core.statistic import FilterRun, follow
from hullguard.design.design import Design
from hullguard.design.polynomial import DEGREE_MAX
from hullguard.design.statistic import STATISTICS, StatisticTable, known_of, statistic_table
from hullguard.errors import InputError
from hullguard.model.faults import FaultSpec
from hullguard.model.table import Array
from hullguard.plant.run import Trace

FILE = "filters.csv"


class Followed(Plant):
    """The emulated plant; `states` are the true ones of every sample that was read."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.states: list[list[float]] = []

    def read(self) -> list[float]:
        """Readings of the open sample."""
        self.states.append(self.state)
        return super().read()


@dataclass(frozen=True)
class Filtered:
    """One filter over a run."""

    number: int  # of the model's filter that it is like, from 1
    states: tuple[str, ...]
    table: StatisticTable
    own: bool  # the model's degree
    run: FilterRun
    truth: Array | None  # samples x states, where the plant was emulated


def filtered(design: Design, library: Library, trace: Trace, states: Sequence[Sequence[float]] | None) -> list[Filtered]:
    """Each of a model's filters in every degree that the library can hold; nothing for a model without filters."""
    model, tables = design.model, design.tables
    value, radius = np.array(trace.value), np.array(trace.radius)
    known, found = known_of(tables.groups, design.usual.tolist()), []
    truth = None if states is None else np.array(states)
    for i, spec in enumerate(model.polynomials):
        for degree in range(1, DEGREE_MAX + 1):
            try:
                table = statistic_table(model, replace(spec, degree=degree, ram=None), known)
            except InputError:
                continue  # more than the library can index, or noise without such moments
            found.append(Filtered(i + 1, model.plant.states, table, degree == spec.degree, follow(library, table, value, radius), truth))
    return found


def filter_facts(every: Sequence[Filtered], faults: Sequence[FaultSpec]) -> dict[str, Any]:
    """What a run's JSON says of them."""
    return {"filters": [_facts(f, faults) for f in every]}


def _facts(f: Filtered, faults: Sequence[FaultSpec]) -> dict[str, Any]:
    samples, start = len(f.run.r), min((s.start for s in faults), default=len(f.run.r))
    ready = f.run.ready > 0.0
    above = (f.run.r > f.run.J) & ready[:, None]
    healthy = ready & (np.arange(samples) < start)
    count = max(1, int(healthy.sum()))
    row: dict[str, Any] = {"filter": f.number, "degree": f.table.degree, "bounded": f.table.bounded, "own": f.own, "lifted": f.table.lifted, "ram_bytes": 4 * f.table.reals}
    if f.truth is not None:
        error2 = (f.run.x - f.truth)[healthy] ** 2
        row["error_rms"] = dict(zip(f.states, np.sqrt(error2.mean(0)).tolist(), strict=True)) if len(error2) else {}
        row["consistency"] = dict(zip(f.states, (error2 / f.run.variance[healthy]).mean(0).tolist(), strict=True)) if len(error2) else {}
    row["healthy_samples"] = int(healthy.sum())
    row["false_alarms"] = {name: int(above[healthy, i].sum()) for i, name in enumerate(STATISTICS)}
    row["false_alarm_rate"] = {name: float(above[healthy, i].sum() / count) for i, name in enumerate(STATISTICS)}
    row["delay"] = {name: _first(above[start:, i]) for i, name in enumerate(STATISTICS)} if start < samples else {}
    row["restarts"] = f.run.restarts
    return row


def _first(above: NDArray[np.bool_]) -> int | None:
    at = np.flatnonzero(above)
    return int(at[0]) if len(at) else None


def filter_words(row: dict[str, Any]) -> str:
    """A line for people."""
    errors = "; ".join(f"error of {name} {value:.4g} rms, consistency {row['consistency'][name]:.3g}" for name, value in row.get("error_rms", {}).items())
    alarms = ", ".join(f"{name} {n}" for name, n in row["false_alarms"].items())
    delays = ", ".join(f"{name} {'never' if d is None else d}" for name, d in row["delay"].items())
    own = " (the detector's)" if row["own"] else ""
    return f"filter of degree {row['degree']}{own}: {errors + '; ' if errors else ''}false alarms {alarms}" + (f"; samples until the fault: {delays}" if delays else "")


def write_filters(directory: Path, design: Design, every: Sequence[Filtered]) -> None:
    """filters.csv: of each filter I and degree D the estimates I.D.STATE with .deviation and, where it is known, .truth; r and J of each statistic."""
    header, columns = ["time_s", "k"], []
    for f in every:
        key = f"{f.number}.{f.table.degree}"
        for j, name in enumerate(f.states):
            header += [f"{key}.{name}", f"{key}.{name}.deviation"] + [f"{key}.{name}.truth"] * (f.truth is not None)
            columns += [f.run.x[:, j], np.sqrt(np.maximum(f.run.variance[:, j], 0.0))] + ([] if f.truth is None else [f.truth[:, j]])
        for i, name in enumerate(STATISTICS):
            header += [f"{key}.r.{name}", f"{key}.J.{name}"]
            columns += [f.run.r[:, i], f.run.J[:, i]]
    with (directory / FILE).open("w", encoding="utf-8") as file:
        file.write(",".join(header) + "\n")
        for k, row in enumerate(np.array(columns).T):
            file.write(f"{k * design.model.sample_time_s:.6f},{k}," + ",".join(f"{x:.9g}" for x in row) + "\n")
