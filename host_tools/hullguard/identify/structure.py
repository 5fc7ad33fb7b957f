"""What is looked for: columns of disturbance and noise, and the bounds that they share.

A model says which disturbances there are, and which have a bound in common: `state = 0.01` is one bound for all states, `{ speed = .., gap = .. }` one
for each kind, a list one for each state, and a matrix keeps its columns' directions. A state whose bound is given as 0 has none. Noise belongs to
[[signals]], one bound an entry, or to `disturbance.output` where the model gives that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hullguard.errors import InputError
from hullguard.model.schema import Model
from hullguard.model.table import Array
from hullguard.model.templates import STEM, expand

STATE, OUTPUT, NOISE = "state", "output", "noise"  # where a bound is written: plant.disturbance.state, .output, or noise of [[signals]]


@dataclass(frozen=True)
class Parameter:
    """One bound that is looked for."""

    name: str
    where: str  # STATE | OUTPUT | NOISE
    key: str | int | None  # of the table, list or signal that it is written to; None: all of it
    given: float
    direction: bool = False  # the bound scales a column of a matrix


@dataclass(frozen=True)
class Column:
    """One disturbance: x(k+1) = .. + into_x d, y(k) = .. + into_y d, |d| <= bound, or <= a parameter where there is one."""

    into_x: Array  # n
    into_y: Array  # m
    parameter: int  # -1: none, the bound is known
    bound: float


@dataclass(frozen=True)
class Structure:
    """All columns and parameters of a model."""

    model: Model
    parameters: tuple[Parameter, ...]
    columns: tuple[Column, ...]

    @property
    def given(self) -> Array:
        """The parameters as the model gives them."""
        return np.array([p.given for p in self.parameters])


def structure(model: Model, source: dict[str, Any]) -> Structure:
    """`source` is the model file's data as written, templates and all."""
    if model.uios:
        raise InputError(f"{model.path.name}: identify is for models of kind linear; bounds of unknown inputs are chosen, not found")
    plant = model.plant
    parameters: list[Parameter] = []
    columns: list[Column] = []
    disturbance = source.get("plant", {}).get("disturbance", {})
    _states(model, disturbance.get("state"), parameters, columns)
    _outputs(model, source, disturbance.get("output"), parameters, columns)
    for row, place in enumerate(model.inputs):
        group = next(g for g in model.groups if place in g.signals)
        signal = model.signals[place]
        bound = signal.noise + (signal.resolution / 2 if group.applied_as_sent else 0.0)  # what is applied is what was decoded
        if bound > 0.0 and (plant.B[:, row].any() or plant.D[:, row].any()):
            columns.append(Column(plant.B[:, row], plant.D[:, row], -1, bound))
    return Structure(model, tuple(parameters), tuple(columns))


def _states(model: Model, given: Any, parameters: list[Parameter], columns: list[Column]) -> None:
    """Bounds of the state equations."""
    plant, silent = model.plant, np.zeros(model.plant.m)
    unit = np.eye(plant.n)
    if isinstance(given, list) and given and isinstance(given[0], list):
        matrix = np.array(given, dtype=np.float64)
        for j in range(matrix.shape[1]):
            columns.append(Column(matrix[:, j], silent, len(parameters), 0.0))
            parameters.append(Parameter(f"column {j + 1} of disturbance.state", STATE, j, 1.0, True))
        return
    keys: list[str | int | None]
    values: list[float]
    if isinstance(given, dict):
        keys = [name if name in given else _stem(name) for name in plant.states]
        values = [float(given[k]) for k in keys]
    elif isinstance(given, list):
        keys, values = list(range(plant.n)), [float(x) for x in given]
    elif given is not None and float(given) > 0.0:
        keys, values = [None] * plant.n, [float(given)] * plant.n
    else:
        keys, values = list(range(plant.n)), [0.0] * plant.n
    nothing_given = not any(values)
    known: dict[str | int | None, int] = {}
    for i, (key, value) in enumerate(zip(keys, values, strict=True)):
        if value == 0.0 and not nothing_given:
            continue
        if key not in known:
            known[key] = len(parameters)
            label = "all states" if key is None else plant.states[key] if isinstance(key, int) else key
            parameters.append(Parameter(f"disturbance of {label}", STATE, key, value))
        columns.append(Column(unit[i], silent, known[key], 0.0))


def _outputs(model: Model, source: dict[str, Any], given: Any, parameters: list[Parameter], columns: list[Column]) -> None:
    """Bounds of the readings."""
    unit, still = np.eye(model.plant.m), np.zeros(model.plant.n)
    if isinstance(given, list) and given and isinstance(given[0], list):
        raise InputError(f"{model.path.name}: plant.disturbance.output is a matrix; identify looks for one bound a reading: give a number, a list or names")
    entry = entries(model, source) if given is None else {}
    known: dict[tuple[str, str | int | None], int] = {}
    for row, place in enumerate(model.outputs):
        signal = model.signals[place]
        where, value, label = NOISE, signal.noise, signal.name
        key: str | int | None = entry.get(signal.name)
        if isinstance(given, dict):
            name = signal.name if signal.name in given else _stem(signal.name)
            where, key, value, label = OUTPUT, name, float(given[name]), name
        elif given is not None:
            listed = isinstance(given, list)
            where, key, value, label = OUTPUT, row if listed else None, float(given[row] if listed else given), signal.name if listed else "all readings"
        if (where, key) not in known:
            known[where, key] = len(parameters)
            parameters.append(Parameter(f"noise of {_each(source, key) if where == NOISE else label}", where, key, value))
        columns.append(Column(still, unit[row], known[where, key], 0.0))
        if given is not None and signal.noise > 0.0:
            columns.append(Column(still, unit[row], -1, signal.noise))


def entries(model: Model, source: dict[str, Any]) -> dict[str, int]:
    """For every signal the [[signals]] entry that it comes from."""
    found = {}
    for i, entry in enumerate(source["signals"]):
        alone = {**source, "signals": [entry]}
        for signal in expand(alone, model.path.name)["signals"]:
            found[signal["name"]] = i
    return found


def _each(source: dict[str, Any], key: str | int | None) -> str:
    return str(source["signals"][key]["name"])


def _stem(name: str) -> str:
    found = STEM.match(name)
    return found[0] if found else name
