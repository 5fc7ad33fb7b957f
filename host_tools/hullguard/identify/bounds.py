"""The smallest bounds that explain recordings: windows agree on them by cuts.

Every window is a linear programme of its own. Where one cannot be explained by the bounds so far, the slope of what it lacks is a cut on the bounds,
and a small programme over the bounds alone, min weight' beta above all cuts, finds the next ones: the joint optimum of all windows, without a
programme that holds them all. A second pass with long windows sees what adds up slowly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from hullguard.errors import InputError
from hullguard.identify.programme import Window, windows
from hullguard.identify.records import Record
from hullguard.identify.structure import Structure
from hullguard.model.table import Array

UNIFORM = 3.0**0.5  # bound over standard deviation of a uniform disturbance
EXPLAINED = 1e-6  # of the bounds: what a window may lack
CUTS_MAX = 500
LONGER = 4  # windows of the second pass, times those of the first
STANDS_OUT = 2.0  # times what nine tenths of the windows need: a contradiction
MODE_MOMENTS, MODE_DETECTION = "moments", "detection"

Tick = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Need:
    """What one window needs, times the standard deviations."""

    record: str
    line: int  # of the file
    sample: int  # of the record's part
    equation: str
    factor: float


@dataclass(frozen=True)
class Fit:
    """Smallest bounds and what they rest on."""

    bound: Array  # parameters
    needs: tuple[Need, ...]  # windows, the most demanding first
    heavy: bool  # disturbances with rare large values: single bounds were raised above those of uniform ones
    cuts: int

    @property
    def usual(self) -> float:
        """What nine tenths of the windows can be explained with."""
        return float(np.quantile([n.factor for n in self.needs], 0.9))

    @property
    def contradictions(self) -> tuple[Need, ...]:
        """Windows that need far more than the others."""
        return tuple(n for n in self.needs if n.factor > STANDS_OUT * self.usual)


@dataclass(frozen=True)
class Task:
    """All windows of one length."""

    programme: Window
    records: Sequence[Record]
    places: Sequence[tuple[int, int]]

    @classmethod
    def of(cls, found: Structure, records: Sequence[Record], samples: int) -> Task:
        """Windows no longer than the shortest record."""
        length = min(samples, *(len(r.y) for r in records))
        return cls(Window(found, length), records, windows(records, length))

    def data(self, place: tuple[int, int]) -> tuple[Array, Array]:
        """Readings and inputs of one window."""
        r, part = self.records[place[0]], slice(place[1], place[1] + self.programme.samples)
        return r.y[part], r.u[part]


def needs(task: Task, direction: Array, what: str, tick: Tick) -> list[tuple[Need, tuple[int, int]]]:
    """The factor times `direction` that explains each window, largest first."""
    found, nothing = [], np.zeros(len(direction))
    for i, place in enumerate(task.places):
        answer = task.programme.solve(*task.data(place), nothing, direction)
        record, sample = task.records[place[0]], place[1] + answer.sample
        found.append((Need(record.name, record.first + sample, sample, answer.equation, answer.t), place))
        tick(what, i + 1, len(task.places))
    return sorted(found, key=lambda f: -f[0].factor)


def fit(found: Structure, records: Sequence[Record], sigma: Array, weight: Array | None, samples: int, tick: Tick) -> Fit:
    """The smallest bounds in proportion to `sigma`; with weights the bounds of the smallest weighted sum.

    Bounds in proportion that come out wider than uniform disturbances have them would be too wide for most: there the bounds stay at
    those of uniform ones, and single ones are raised where the data ask for it, by the smallest relative sum.
    """
    short = Task.of(found, records, samples)
    needed = needs(short, sigma, "windows", tick)
    largest = needed[0][0].factor
    heavy = weight is None and largest > UNIFORM
    ordered = [place for _, place in needed]
    if weight is None and not heavy:
        bound, cuts = largest * sigma, 0
        floor, weight = bound, 1.0 / sigma
    else:
        floor = UNIFORM * sigma if weight is None else np.zeros(len(sigma))
        weight = 1.0 / sigma if weight is None else weight
        bound, cuts = _joint(short, ordered, floor, weight, sigma, "bounds", tick)
    long = Task.of(found, records, LONGER * samples)
    if long.programme.samples > short.programme.samples:
        bound, more = _joint(long, list(long.places), np.maximum(floor, bound), weight, sigma, "long windows", tick)
        cuts += more
    return Fit(bound, tuple(n for n, _ in needed), heavy, cuts)


def _joint(task: Task, places: Sequence[tuple[int, int]], floor: Array, weight: Array, step: Array, what: str, tick: Tick) -> tuple[Array, int]:
    """Bounds of the least weighted sum, none below `floor`, that explain every window; how many cuts it took."""
    slopes: list[Array] = []
    least: list[float] = []
    bound = floor.copy()
    for i, place in enumerate(places):
        while (answer := task.programme.solve(*task.data(place), bound, step)).t > EXPLAINED:
            # t is convex in beta: it can be 0 only where its tangent is not above 0.
            slopes.append(answer.slope)
            least.append(float(answer.slope @ bound) - answer.t)
            if len(slopes) > CUTS_MAX:
                raise InputError(f"{what}: no bounds after {CUTS_MAX} cuts; use a shorter --window, or fewer bounds (one for several states)")
            done = scipy.optimize.linprog(weight * step, A_ub=np.array(slopes) * step, b_ub=least, bounds=[(f / s, None) for f, s in zip(floor, step, strict=True)], method="highs")
            if done.status != 0:
                raise InputError(f"{what}: {done.message}; use a shorter --window")
            bound = done.x * step
        tick(what, i + 1, len(places))
    return bound, len(slopes)


def margin(found: Structure, records: Sequence[Record], bound: Array, samples: int, tick: Tick) -> Need:
    """The factor times these bounds that explains the records, with where it is largest: below 1 they are inside."""
    return needs(Task.of(found, records, LONGER * samples), bound, "hold-out", tick)[0][0]
