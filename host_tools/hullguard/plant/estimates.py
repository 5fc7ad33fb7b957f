"""What a model's unknown-input observers make of a run: all estimates with their radii, by the C library, from the values and radii that the detector held."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hullguard.core.library import Library
from hullguard.core.native import MOVING
from hullguard.core.native_uio import CAUSES, Uio, UioRun
from hullguard.design.design import Design
from hullguard.design.uio_generator import UioDesign, uio_table
from hullguard.design.uio_isolate import Isolation, isolations
from hullguard.model.table import Array
from hullguard.model.uio import DIRECT
from hullguard.plant.run import Trace
from hullguard.plant.unknown import Emulated

FILE = "estimates.csv"


@dataclass(frozen=True)
class Verdict:
    """What isolation says of one actuator's estimate after each sample."""

    isolation: Isolation
    run: UioRun
    share: list[float]  # offset, then components, of the last window


@dataclass(frozen=True)
class Estimates:
    """Of one observer."""

    made: UioDesign
    run: UioRun
    truth: Array | None  # samples x estimates, where the plant was emulated
    verdicts: tuple[Verdict, ...]


def low_passed(values: Array, a: float) -> Array:
    """First order from 0, a column each."""
    out, low = np.zeros_like(values), np.zeros(values.shape[1])
    for k, v in enumerate(values):
        low = low + a * (v - low)
        out[k] = low
    return out


def truths(design: Design, made: UioDesign, reading: Array, emulated: Emulated) -> Array:
    """What the estimates stand for (uio.h): what moves the state beyond the model, what sensors say beyond the state, low-passed; and the state."""
    model, n, p, r = design.model, design.model.plant.n, len(made.spec.actuators), len(made.spec.sensors)
    a = model.sample_time_s / (made.spec.low_pass_s + model.sample_time_s)
    moved = np.zeros((len(reading), n))
    moved[1:] = emulated.state[1:] - emulated.state[:-1] @ model.plant.A.T - reading[:-1, model.inputs] @ model.plant.B.T
    faults = [model.faults[f].signal for f in made.spec.sensors]
    first, count = 0 if made.spec.form == DIRECT else n + r, len(made.names) - r - n
    rebuilt = low_passed(moved @ -made.follows[first : first + count].T / a, a)  # g follows -a P x
    of_sensors = low_passed(reading[:, faults] - emulated.readings[:, faults], a)
    return np.hstack([rebuilt[:, :p], of_sensors, rebuilt[:, p:], emulated.state])


def estimated(design: Design, library: Library, trace: Trace, start: int, emulated: Emulated | None) -> list[Estimates]:
    """All observers of a model over a run."""
    value, radius, width = np.array(trace.value), np.array(trace.radius), design.tables.width
    found = []
    for u in design.uios:
        table, verdicts = uio_table(u, library.real), []
        for isolation in isolations(design.model, u) if library.real != "q31" else ():  # it is for the float types
            beside = Uio(library, table, isolation.table, width, start == MOVING)
            verdicts.append(Verdict(isolation, beside.run(value, radius), beside.share))
        run = verdicts[0].run if verdicts else Uio(library, table, None, width, start == MOVING).run(value, radius)
        truth = None if emulated is None else truths(design, u, np.array(trace.reading), emulated)
        found.append(Estimates(u, run, truth, tuple(verdicts)))
    return found


def estimate_facts(every: list[Estimates]) -> dict[str, Any]:
    """What a run's JSON says of them."""
    rows, said = [], []
    for i, e in enumerate(every):
        for j, name in enumerate(e.made.names):
            row: dict[str, Any] = {"observer": i + 1, "name": name, "kind": _kind(e, j), "last": float(e.run.estimate[-1, j]), "radius": float(e.run.radius[-1, j])}
            if e.truth is not None:
                row["error_max"] = float(np.abs(e.run.estimate[:, j] - e.truth[:, j]).max())
                row["error_rms"] = float(np.sqrt(np.mean((e.run.estimate[:, j] - e.truth[:, j]) ** 2)))
            rows.append(row)
        said += [{"observer": i + 1} | _cause(v) for v in e.verdicts]
    return {"estimates": rows, "isolation": said}


def _kind(e: Estimates, j: int) -> str:
    """Faults come first, states last."""
    return "faults" if j < len(e.made.faults) else "unknown" if j < len(e.made.names) - e.made.follows.shape[1] else "states"


def _cause(v: Verdict) -> dict[str, Any]:
    """What isolation ends with, and since when."""
    last = int(v.run.cause[-1])
    since = len(v.run.cause) - 1
    while since > 0 and v.run.cause[since - 1] == last and v.run.candidates[since - 1] == v.run.candidates[-1]:
        since -= 1
    names = v.isolation.names
    parts = names[1 : 1 + len(v.isolation.table.whole)]
    return {
        "actuator": names[0],
        "cause": CAUSES[last],
        "since": since,
        "candidates": [n for i, n in enumerate(names) if int(v.run.candidates[-1]) >> i & 1],
        "explained": float(v.run.explained[-1]),
        "offset": v.share[0] if v.share else 0.0,
        "share": dict(zip(parts, v.share[1:], strict=True)),
    }


def write_estimates(directory: Path, design: Design, every: list[Estimates]) -> None:
    """estimates.csv: a column each estimate and radius, I.NAME with the observer's number in front, and .truth where it is known."""
    header, columns = ["time_s", "k"], []
    for i, e in enumerate(every):
        for j, name in enumerate(e.made.names):
            header += [f"{i + 1}.{name}", f"{i + 1}.{name}.radius"] + [f"{i + 1}.{name}.truth"] * (e.truth is not None)
            columns += [e.run.estimate[:, j], e.run.radius[:, j]] + ([] if e.truth is None else [e.truth[:, j]])
    with (directory / FILE).open("w", encoding="utf-8") as file:
        file.write(",".join(header) + "\n")
        for k, row in enumerate(np.array(columns).T):
            file.write(f"{k * design.model.sample_time_s:.6f},{k}," + ",".join(f"{x:.9g}" for x in row) + "\n")
