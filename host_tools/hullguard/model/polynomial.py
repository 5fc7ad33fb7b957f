"""What a model of kind "polynomial" says: a nonlinear plant, noise by its distribution, and polynomial filters; methods, polynomial.

[plant]                                     # x(k+1) = f(x, u) + w, y = h(x, u) + v, physical units
states = ["x", "speed"]
parameters = { mass_kg = 240 }              # and sample_time_s
f = ["x + sample_time_s * speed", ..]       # a state each: an expression, or terms [[coefficient, [exponents of the states]], ..]
h = { position = "x" }                      # an output each; inputs enter by their names, linearly
operating_point = [0, 0]                    # where f and h are expanded, 0 unless said; operating_input likewise
expansion = 3                               # degree of the Taylor polynomials
box = [0.2, 2.0]                            # half width around it in which their error is bounded
initial = { mean = [0, 0], deviation = [0.02, 0.2] }    # normal, at every start; mean: the operating point unless said
noise = { x = { kind = "normal", deviation = 1e-5 }, position = { kind = "samples", file = "noise.csv", column = "position" }, .. }

[[detector.polynomial]]
degree = 2                                  # mu: 1, 2 or 3
ram_limit_bytes = 4096
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hullguard.design.polynomial import DEGREE_MAX, Noise, contaminated, exponential, laplace, monomials, normal, samples, student, two_point, uniform
from hullguard.errors import InputError
from hullguard.model.expression import FUNCTIONS, Expansion, Program, compiled, expanded, of_terms
from hullguard.model.table import Array, Table

if TYPE_CHECKING:
    from hullguard.model.plant import Plant
    from hullguard.model.schema import Fault

KIND = "polynomial"
EXPANSION_MAX = 5
KAPPA = 4.47  # 1 / sqrt(5 %): Chebyshev
NOISES: dict[str, Callable[[float], Noise]] = {"normal": normal, "uniform": uniform, "laplace": laplace}


@dataclass(frozen=True)
class Nonlinear:
    """x(k+1) = f(x, u) + w, y = h(x, u) + v, and its expansion about a point."""

    f: tuple[Program, ...]  # n, of states and inputs
    h: tuple[Program, ...]  # m
    w: tuple[Noise, ...]
    v: tuple[Noise, ...]
    point: tuple[float, ...]  # n
    input: tuple[float, ...]  # p
    box: tuple[float, ...]  # n
    mean: tuple[float, ...]  # n: of the initial state
    deviation: tuple[float, ...]  # n
    degree: int  # of the expansions
    of_f: tuple[Expansion, ...]
    of_h: tuple[Expansion, ...]


@dataclass(frozen=True)
class FilterSpec:
    """One polynomial filter."""

    degree: int
    bounded: bool
    outputs: tuple[int, ...]  # indices into y
    faults: tuple[int, ...]  # indices into the model's faults: what its alarms can stand for
    kappa: float
    joint: float  # level of J2
    weight: float
    drift: float  # level of the drift, standard deviations
    settle: int  # samples
    ram: int | None  # bytes in float32


def read_nonlinear(table: Table, outputs: Sequence[str], inputs: Sequence[str], sample_time_s: float, path: Path) -> Plant:
    """[plant] of a nonlinear one: what stands for it in a linear world is its first derivatives at the operating point."""
    from hullguard.model.plant import Plant  # which reads this kind through the schema

    states = table.names("states")
    _check_names(table, states, outputs, inputs)
    n, m, p = len(states), len(outputs), len(inputs)
    names, parameters = [*states, *inputs], {"sample_time_s": sample_time_s} | _parameters(table, [*states, *inputs])
    point = table.vector("operating_point", n) if "operating_point" in table else np.zeros(n)
    given = table.vector("operating_input", p) if "operating_input" in table else np.zeros(p)
    box, degree = table.vector("box", n, 1e-12), table.whole("expansion", 1, EXPANSION_MAX, 3)
    f = _rows(table, "f", [f"f[{i}]" for i in range(n)], names, parameters, n)
    shown = table.table("h")
    h = tuple(_row(shown.raw(o), f"{shown.where}.{o}", names, parameters, n) for o in outputs)
    shown.close()

    def near(row: Program, where: str) -> Expansion:
        return expanded(row, point.tolist(), given.tolist(), monomials(n, degree), box.tolist(), where, inputs)

    of_f = tuple(near(row, f"{table.where}.f[{i}]") for i, row in enumerate(f))
    of_h = tuple(near(row, f"{shown.where}.{o}") for row, o in zip(h, outputs, strict=True))
    noise = table.table("noise")
    w, v = (tuple(_noise(noise, name, path) for name in some) for some in (states, outputs))
    noise.close()
    start = table.table("initial")
    mean = start.vector("mean", n) if "mean" in start else point
    deviation = start.vector("deviation", n, 1e-12)
    start.close()
    table.close()
    for name, drawn in zip(outputs, v, strict=True):
        if drawn.moment(2) <= 0.0:
            raise InputError(f"{table.where}.noise.{name}: a sensor without noise; give it a deviation above 0")
    centre, given_input, half, start_mean, spread = (tuple(map(float, a)) for a in (point, given, box, mean, deviation))
    made = Nonlinear(f, h, w, v, centre, given_input, half, start_mean, spread, degree, of_f, of_h)
    A, C = _slopes(of_f, n), _slopes(of_h, n)
    B, D = (np.array([e.input for e in rows], dtype=float).reshape(len(rows), p) for rows in (of_f, of_h))
    return Plant(
        states=tuple(states), A=A, B=B, dA=np.zeros((n, n)), dB=np.zeros((n, p)), C=C, D=D, Ed=np.zeros((n, 0)), Fd=np.zeros((m, 0)),
        initial_range=3.0 * deviation, equilibrium=point, equilibrium_input=given, state_range=np.abs(point) + box,
        feedback=None, interval=None, unknown=None, hold_s=None, nonlinear=made,
    )  # fmt: skip


def _slopes(rows: Sequence[Expansion], n: int) -> Array:
    unit = [tuple(int(i == j) for j in range(n)) for i in range(n)]
    return np.array([[e.terms.get(m, 0.0) for m in unit] for e in rows]).reshape(len(rows), n)


def _check_names(table: Table, states: Sequence[str], outputs: Sequence[str], inputs: Sequence[str]) -> None:
    if not states:
        raise table.error("states", "none; name the states of the plant")
    for name in states:
        if not name.isidentifier() or name in FUNCTIONS or [*states, *outputs, *inputs].count(name) > 1:
            raise table.error("states", f"'{name}' cannot name a state: choose a word that is no function, and no other state or signal")


def _parameters(table: Table, taken: Sequence[str]) -> dict[str, float]:
    inner = table.table("parameters", optional=True)
    found = {key: float(inner.number(key)) for key in inner.data}
    for key in found:
        if key in taken or key in FUNCTIONS or key == "sample_time_s":
            raise inner.error(key, "a state, an input, a function or sample_time_s has this name; choose another")
    inner.close()
    return found


def _rows(table: Table, key: str, names: Sequence[str], variables: Sequence[str], parameters: dict[str, float], n: int) -> tuple[Program, ...]:
    given = table.raw(key)
    if not isinstance(given, list) or len(given) != len(names):
        raise table.error(key, f"expected {len(names)} entries, one a state")
    return tuple(_row(row, f"{table.where}.{name}", variables, parameters, n) for row, name in zip(given, names, strict=True))


def _row(given: object, where: str, variables: Sequence[str], parameters: dict[str, float], n: int) -> Program:
    if isinstance(given, str):
        return compiled(given, variables, parameters, where)
    if not isinstance(given, list):
        raise InputError(f"{where}: expected an expression, or terms [[coefficient, [exponents]], ..]")
    terms = []
    for i, term in enumerate(given):
        parts = Table({"coefficient": term[0], "exponents": term[1]}, f"{where}[{i}]") if isinstance(term, list) and len(term) == 2 else None
        if parts is None:
            raise InputError(f"{where}[{i}]: expected [coefficient, [exponents of the {n} states]]")
        exponents = parts.vector("exponents", n, 0.0)
        if np.any(exponents != np.round(exponents)) or exponents.sum() > 9:
            raise parts.error("exponents", "expected whole numbers that add up to at most 9")
        terms.append((float(parts.number("coefficient")), [int(e) for e in exponents]))
    return of_terms(terms)


def _noise(table: Table, name: str, path: Path) -> Noise:
    t = table.table(name)
    kind = t.text("kind", choices=[*NOISES, "exponential", "student", "contaminated", "two-point", "samples"])
    if kind == "samples":
        made = _sampled(t, path)
    elif kind == "two-point":
        made = two_point(t.number("deviation", 1e-30), t.number("probability", 1e-3, 1.0 - 1e-3))
    elif kind == "exponential":
        made = exponential(t.number("deviation", 0.0) * (-1.0 if t.text("tail", "right", ["left", "right"]) == "left" else 1.0))
    elif kind == "student":
        made = student(t.number("deviation", 1e-30), t.number("degrees_of_freedom", 2.001, 1e6))
    elif kind == "contaminated":
        made = contaminated(t.number("deviation", 1e-30), t.number("share", 1e-6, 1.0 - 1e-6), t.number("ratio", 1e-3, 1e3))
    else:
        made = NOISES[kind](t.number("deviation", 0.0) * (math.sqrt(3.0) if kind == "uniform" else 1.0))
    t.close()
    return made


def _sampled(t: Table, path: Path) -> Noise:
    """A column of a CSV beside the model."""
    file, column = path.parent / t.text("file"), t.text("column")
    try:
        with file.open(encoding="utf-8", newline="") as source:
            rows = list(csv.DictReader(source))
    except (OSError, UnicodeDecodeError) as error:
        raise t.error("file", f"{file.name} cannot be read; give a CSV file beside the model") from error
    if not rows or column not in rows[0]:
        raise t.error("column", f"{file.name} has no column '{column}': {', '.join(rows[0]) if rows else 'it is empty'}")
    try:
        return samples([float(row[column]) for row in rows])
    except (TypeError, ValueError) as error:
        raise t.error("column", f"'{column}' of {file.name} holds something that is no number") from error


def read_filters(detector: Table, outputs: Sequence[str], faults: Sequence[Fault]) -> tuple[FilterSpec, ...]:
    """[[detector.polynomial]]."""
    known = [f.name for f in faults]
    made = []
    for t in detector.tables("polynomial"):
        chosen = {"outputs": t.names("outputs", list(outputs)), "faults": t.names("faults", known)}
        for key, names in (("outputs", outputs), ("faults", known)):
            for name in chosen[key]:
                if name not in names:
                    raise t.error(key, f"'{name}' is not one of {', '.join(names) or 'none'}")
        if not chosen["outputs"]:
            raise t.error("outputs", "none: a filter without a measurement finds nothing")
        made.append(
            FilterSpec(
                degree=t.whole("degree", 1, DEGREE_MAX),
                bounded=t.flag("bounded", False),
                outputs=tuple(outputs.index(o) for o in chosen["outputs"]),
                faults=tuple(known.index(f) for f in chosen["faults"]),
                kappa=t.number("kappa", 1e-3, 1e6, KAPPA),
                joint=t.number("joint", 1e-3, 1e6, KAPPA),
                weight=t.number("weight", 1e-4, 1.0, 0.1),
                drift=t.number("drift", 1e-3, 1e6, 3.0),
                settle=t.whole("settle_samples", 0, 254, 20),
                ram=t.whole("ram_limit_bytes", 1, 2**31 - 1) if "ram_limit_bytes" in t else None,
            )
        )
        t.close()
    if not made:
        raise detector.error("polynomial", "no filter; give at least one")
    return tuple(made)
