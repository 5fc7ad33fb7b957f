"""What the bounds cost: their shares of the thresholds, and what wider triggers save and hide."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hullguard.core.library import library
from hullguard.core.native import MOVING, Batch, Native
from hullguard.design.arith import mul, powers, row_sums
from hullguard.design.design import Design, Generator, fault_paths, finish, refilter
from hullguard.design.search import smallest_faults
from hullguard.design.store import Stored
from hullguard.errors import InputError
from hullguard.identify.records import Record
from hullguard.identify.structure import Structure
from hullguard.model.schema import Model, Reference
from hullguard.model.table import Array

SCALES = (0.25, 0.5, 1.0, 2.0, 4.0)
STEPS = 5  # of the search between two of them
FORGOTTEN = 1e-9
LENGTH_MAX = 20_000
REST = Reference("rest", 0.0, 1)
OTHERS = ("triggers and quantisation", "known disturbances and rounding")


@dataclass(frozen=True)
class Drive:
    """A detector over recordings."""

    frames: float  # measurement frames, share of periodic
    provisional: int  # false alarms
    confirmed: int
    margin: float  # largest |r|/J


@dataclass(frozen=True)
class Point:
    """One width of the triggers."""

    scale: float  # times the given sigma
    drive: Drive
    smallest: dict[str, float]  # fault: the least lasting size that leaves a threshold
    design: Design


def drive(made: Design, records: Sequence[Record]) -> Drive:
    """Every record by itself, begun in a moving plant."""
    native = Native(library("f32"), made.tables)
    groups = len(made.model.groups) - 1
    results = [Batch(native, made, len(r.series), REST, seed=1, start=MOVING, series=r.series).runs(0, 1)[0] for r in records]
    samples = sum(len(r.series) for r in records)
    return Drive(
        sum(r["measurement"] for r in results) / max(1, groups * samples),
        sum(r["false_provisional"] for r in results),
        sum(r["false_confirmed"] for r in results),
        max(r["margin"] for r in results),
    )


def least_faults(made: Design) -> dict[str, float]:
    """For each fault of the model the least lasting size that some generator shows, at the triggers' usual radii."""
    found: dict[str, float] = {}
    for g in made.generators:
        paths = fault_paths(made.model, g.spec, g.spec.faults)
        radius = g.radius[: len(g.signal)]
        for f, size in zip(g.spec.faults, smallest_faults(g.plant, g.observer, g.filter, paths, radius), strict=True):
            name = made.model.faults[f].name
            found[name] = min(found.get(name, np.inf), float(size))
    return found


def shares(found: Structure, made: Design, bound: Array) -> Array:
    """Share of every parameter in the steady thresholds, then of OTHERS: a row a residual of every generator."""
    return np.vstack([_of_generator(found, g, bound) for g in made.generators if g.given is not None])


def _of_generator(found: Structure, g: Generator, bound: Array) -> Array:
    assert g.given is not None
    T, lin, m = g.given.T, g.linear, len(g.spec.outputs)
    slowest = float(np.abs(np.linalg.eigvals(lin.state)).max())
    length = min(LENGTH_MAX, max(64, int(np.ceil(np.log(FORGOTTEN) / np.log(min(max(slowest, 0.05), 1 - 1e-9))))))
    F = powers(lin.output, lin.state, length)
    part = np.zeros((F.shape[1], len(bound)))
    for c in found.columns:
        if c.parameter < 0:
            continue
        into_y = c.into_y[list(g.spec.outputs), None]
        into_e = mul(T, c.into_x[:, None]) - mul(lin.input[:, :m], into_y)
        moved = sum((row_sums(np.abs(mul(f, into_e))) for f in F), row_sums(np.abs(mul(lin.direct[:, :m], into_y))))
        part[:, c.parameter] += moved * bound[c.parameter]
    steady = g.tables.steady
    radius = np.maximum(steady - g.tables.bias, 0.0)
    rest = np.maximum(steady - radius - part.sum(1), 0.0)
    return np.column_stack([part, radius, rest]) / steady[:, None]


def narrowest(model: Model) -> float:
    """The least scale at which every trigger still sees its signal's resolution."""
    needed = [s.resolution / 2 / x for g in model.groups for s, x in zip((model.signals[i] for i in g.signals), g.trigger.sigma[0], strict=True) if _by_event(model, g.name) and x]
    return max(needed, default=0.0)


def _by_event(model: Model, name: str) -> bool:
    group = next(g for g in model.groups if g.name == name)
    return not group.closing and not group.trigger.periodic


def scaled(model: Model, scale: float) -> Model:
    """The model with every sigma of its triggers times `scale`."""
    groups = tuple(replace(g, trigger=replace(g.trigger, sigma=g.trigger.sigma * scale)) if _by_event(model, g.name) else g for g in model.groups)
    return replace(model, groups=groups)


def point(model: Model, stored: Stored, records: Sequence[Record], scale: float) -> Point:
    """A detector whose triggers are that much wider."""
    wider = scaled(model, scale)
    made = finish(wider, refilter(wider, stored))
    return Point(scale, drive(made, records), least_faults(made), made)


class Curve:
    """Trigger widths that were tried."""

    def __init__(self, model: Model, stored: Stored, records: Sequence[Record], tick: Callable[[str, int, int], None]) -> None:
        self._model, self._stored, self._records, self._tick = model, stored, records, tick
        self._least, self.points = narrowest(model), list[Point]()
        if not any(_by_event(model, g.name) for g in model.groups):
            return
        for scale in sorted({max(s, self._least) for s in SCALES}):
            self.at(scale)

    def at(self, scale: float) -> Point:
        """The point of this width."""
        known = [p for p in self.points if p.scale == scale]
        if known:
            return known[0]
        made = point(self._model, self._stored, self._records, scale)
        self.points = sorted([*self.points, made], key=lambda p: p.scale)
        self._tick("triggers", len(self.points), len(SCALES) + STEPS)
        return made

    def widest(self, good: Callable[[Point], bool]) -> Point | None:
        """The widest triggers with which `good` holds, which it does below some width; none where it never does."""
        while not any(good(p) for p in self.points) and self._narrower():
            pass
        fine = [p for p in self.points if good(p)]
        if not fine:
            return None
        best = fine[-1]
        beyond = [p for p in self.points if p.scale > best.scale]
        return self._between(best, beyond[0], good) if beyond else best

    def narrowest(self, good: Callable[[Point], bool]) -> Point | None:
        """The narrowest with which `good` holds, which it does above some width."""
        while good(self.points[0]) and self._narrower():
            pass
        fine = [p for p in self.points if good(p)]
        if not fine:
            return None
        best = fine[0]
        below = [p for p in self.points if p.scale < best.scale]
        return self._between(best, below[-1], good) if below else best

    def _narrower(self) -> bool:
        """A point below all others; none where a trigger could not see its signal's resolution any more."""
        if self.points[0].scale <= self._least:
            return False
        self.at(max(self.points[0].scale / 4, self._least))
        return True

    def _between(self, good_one: Point, other: Point, good: Callable[[Point], bool]) -> Point:
        for _ in range(STEPS):
            middle = self.at(round(float(np.sqrt(good_one.scale * other.scale)), 4))
            if good(middle):
                good_one = middle
            else:
                other = middle
        return good_one


def chosen(curve: Curve, model: Model, bus_load: float | None, smallest: tuple[str, float] | None) -> Point | None:
    """The triggers for a wished share of the frames, or for a wished smallest fault; none where nothing is wished."""
    if bus_load is None and smallest is None:
        return None
    if not curve.points:
        raise InputError(f"{model.path.name}: no group sends by events, so there is no trigger to choose; leave --bus-load and --smallest-fault out")
    if bus_load is not None:
        found = curve.narrowest(lambda p: p.drive.frames <= bus_load)
        if found is None:
            least = min(p.drive.frames for p in curve.points)
            raise InputError(f"--bus-load {bus_load:g}: triggers {SCALES[-1]:g} times as wide send {least:.3g} of the periodic frames; raise sigma or interval_max")
        return found
    assert smallest is not None
    name, size = smallest
    found = curve.widest(lambda p: p.smallest[name] <= size)
    if found is None:
        least = min(p.smallest[name] for p in curve.points)
        raise InputError(f"--smallest-fault {name}:{size:g}: the narrowest triggers show {least:.3g} at best; ask for more, or make the recordings' bounds smaller")
    return found
