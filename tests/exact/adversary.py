"""The search for a fault-free run that alarms: initial state, disturbances, reference and road chosen for the largest |r| / J of one residual, certificate or estimate.

With the pattern of the frames fixed a residual is a linear function of all that is free, and the senders' silence is linear constraints: a linear programme. Its solution
makes frames of its own, through the real senders; so the programme is solved again for the pattern of the run, and the run made again, until nothing grows. Readings keep
the declared slews and states their ranges. What is measured is the library's own |r| / J in the run, not the programme's.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.optimize
import scipy.sparse
from hullguard.campaign.attack import functionals, last_frame
from hullguard.core.library import library
from hullguard.core.native import MOVING, Batch, Native
from hullguard.core.native_uio import Uio, UioTable
from hullguard.design.design import Design
from hullguard.design.uio_generator import uio_table
from hullguard.model.schema import Reference
from hullguard.model.table import Array
from numpy.typing import NDArray
from world import Choice, World

ROUNDS = 5  # programmes a start, until nothing grows
INSIDE = 0.999  # of declared slews and ranges: the programme knows nothing of the rounding of inputs that are applied as sent
REST_REFERENCE = Reference("rest", 0.0, 1)


@dataclass
class Found:
    """The largest |r| / J of each residual, and alarms; of each estimate |estimate - truth| / radius."""

    ratio: Array
    provisional: int = 0
    confirmed: int = 0
    runs: int = 0
    outside: int = 0  # of them not counted: the plant left a declared slew or range

    @property
    def largest(self) -> float:
        """Of all."""
        return float(self.ratio.max())


@dataclass(frozen=True)
class Aim:
    """A functional of the values held, w[j, g] of value_g(K - j), and of the state at K; where its ratio is read."""

    weight: Array  # lags x signals
    state: Array  # n of the world
    place: int


@dataclass(frozen=True)
class Traced:
    """One run."""

    choice: Choice
    reading: Array
    state: Array
    trace: dict[str, Array]
    ratio: Array  # samples x places


@dataclass
class Search:
    """One model, in one number type, from one start."""

    made: Design
    real: str
    start: int
    samples: int
    seed: int
    loss: float = 0.0
    found: Found = field(init=False)

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng([self.seed, self.samples, self.start])
        self._native = Native(library(self.real), self.made.tables)
        self._world = World(self.made, self.samples, self.start)
        self._tables = [uio_table(u, self.real) for u in self.made.uios]
        self._moves = self._world.moves()
        self._half = np.array([s.resolution / 2 for s in self.made.model.signals])
        self._group = np.array([i for i, g in enumerate(self.made.model.groups) for _ in g.signals])
        self._pattern = 0
        self.aims = self._aims()
        self.found = Found(np.zeros(self.made.tables.residuals + sum(t.estimates for t in self._tables)))

    def _aims(self) -> list[Aim]:
        """Residuals and certificates, then the estimates of states."""
        weights, places = functionals(self.made.tables, self.samples - 1)
        aims = [Aim(w, np.zeros(self._world.n), int(p)) for w, p in zip(weights, places, strict=True)]
        first = self.made.tables.residuals
        for design, table in zip(self.made.uios, self._tables, strict=True):
            count = self.made.model.plant.n
            for i in range(table.estimates - count, table.estimates):
                truth = np.zeros(self._world.n)
                truth[i - (table.estimates - count)] = -1.0
                aims.append(Aim(_answer(uio_table(design), i, self.samples, len(self.made.model.signals)), truth, first + i))
            first += table.estimates
        return aims

    def run(self, choice: Choice) -> Traced:
        """Through senders, bus and detector."""
        reading, state = self._world.run(choice)
        batch = Batch(self._native, self.made, self.samples, REST_REFERENCE, seed=self.seed, loss=self.loss, burst=3 if self.loss else 0, start=self.start, series=reading)
        trace, result = batch.trace(self._pattern), batch.runs(self._pattern, 1)[0]
        ratio = [np.abs(trace["r"]) / trace["J"]]
        for table in self._tables:
            estimates = Uio(library(self.real), table, width=trace["value"].shape[1], moving=self.start == MOVING).run(trace["value"], trace["radius"])
            truth = np.zeros_like(estimates.estimate)
            n = self.made.model.plant.n
            truth[:, table.estimates - n :] = state[:, :n]
            known = np.ones(table.estimates, dtype=bool)
            known[table.estimates - n - table.unknown : table.estimates - n] = False  # what a low pass is to make of a road is not one number
            ratio.append(np.where(known, np.abs(estimates.estimate - truth) / estimates.radius, 0.0))
        ratios = np.hstack(ratio)
        _, low, high = self._kept(reading, state, 1.0)
        if np.all((low <= 0) & (high >= 0)):
            self.found.runs += 1
            self.found.provisional += int(result["false_provisional"])
            self.found.confirmed += int(result["false_confirmed"])
            self.found.ratio = np.maximum(self.found.ratio, ratios.max(0))
        else:
            self.found.outside += 1
            ratios = np.zeros_like(ratios)
        return Traced(choice, reading, state, trace, ratios)

    def attack(self, aim: Aim, sample: int, sign: float, begin: Choice | None = None) -> float:
        """From a corner, or from a choice, uphill; the largest ratio that was reached at the sample."""
        self._pattern += 1
        self._world.certain()
        self._moves = self._world.moves()
        now = self.run(begin or self._bounded())
        reached = now.ratio[sample, aim.place]
        for _ in range(ROUNDS):
            better = self._improve(now, aim, sample, sign)
            if better is None:
                break
            now = self.run(better)
            if now.ratio[sample, aim.place] <= reached * (1 + 1e-6):
                break
            reached = now.ratio[sample, aim.place]
        return float(max(reached, now.ratio[sample, aim.place]))

    def _bounded(self) -> Choice:
        """A corner of what keeps slews and ranges; any corner where the design has found the slews itself."""
        quiet = self._world.quiet()
        rows, low, high = self._kept(*self._world.run(quiet))
        if len(rows) == 0:
            return self._world.draw(self._rng)
        return self._solve(np.asarray(self._rng.normal(size=rows.shape[1])), quiet, rows, low, high) or quiet

    def _improve(self, now: Traced, aim: Aim, sample: int, sign: float) -> Choice | None:
        sent = (now.trace["events"][:, None] >> self._group & 1).astype(bool)
        lost = (now.trace["lost"][:, None] >> self._group & 1).astype(bool)
        held = last_frame(sent & ~lost)
        weight = np.zeros_like(now.reading)  # of each reading: as long as it is held
        for j in range(min(sample + 1, len(aim.weight))):
            g = np.flatnonzero(held[sample - j] >= 0)
            np.add.at(weight, (held[sample - j, g], g), sign * aim.weight[j, g])
        if self._world.uncertain:
            self._world.worsen(now.reading, now.state, weight, sign * aim.state, sample)
            self._moves = self._world.moves()
        moves, states = self._moves
        goal = np.asarray(np.einsum("kg,kgf->f", weight[: sample + 1], moves[: sample + 1]) + sign * (aim.state @ states[sample]))
        silent = self._silent(now, last_frame(sent))
        rows, low, high = (np.concatenate(parts) for parts in zip(silent, self._kept(now.reading, now.state), strict=True))
        return self._solve(goal, now.choice, rows, low, high)

    def _silent(self, now: Traced, source: NDArray[np.intp]) -> tuple[Array, Array, Array]:
        """Where a sender looked and stayed silent its readings stay within its threshold of the one it sent: |reading - sent| <= promise."""
        moves, promise = self._moves[0], now.trace["promise"] - self._half  # the value sent is a rounded reading
        k, g = np.nonzero(np.isfinite(promise))
        from_ = source[k, g]
        off = now.reading[k, g] - now.reading[from_, g]
        return moves[k, g] - moves[from_, g], -promise[k, g] - off, promise[k, g] - off

    def _kept(self, reading: Array, state: Array, share: float = INSIDE) -> tuple[Array, Array, Array]:
        """Declared slews, from each sample to the next, and the ranges of states."""
        moves, states = self._moves
        slews = [(i, s.slew[0]) for i, s in enumerate(self.made.model.signals) if s.slew]
        rows = [moves[1:, i] - moves[:-1, i] for i, _ in slews] + [states[:, i] for i, _ in self._world.bounded]
        off = [np.diff(reading[:, i]) for i, _ in slews] + [state[:, i] for i, _ in self._world.bounded]
        limit = [np.full(len(o), b * share) for o, b in zip(off, [b for _, b in slews] + [b for _, b in self._world.bounded], strict=True)]
        if not rows:
            return np.zeros((0, moves.shape[2])), np.zeros(0), np.zeros(0)
        middle, most = np.concatenate(off), np.concatenate(limit)
        return np.concatenate(rows), -most - middle, most - middle

    def _solve(self, goal: Array, now: Choice, rows: Array, low: Array, high: Array) -> Choice | None:
        least, most = self._world.limits()
        flat = now.flat()
        matrix = scipy.sparse.csr_array(np.where(np.abs(rows) > 1e-12, rows, 0.0))
        solved = scipy.optimize.milp(  # without integer variables: HiGHS's simplex, which takes two-sided rows
            -goal / max(1e-300, float(np.abs(goal).max())),
            constraints=scipy.optimize.LinearConstraint(matrix, low, high) if len(rows) else None,
            bounds=scipy.optimize.Bounds(least - flat, most - flat),
            options={"time_limit": 20.0},
        )
        return None if solved.x is None else self._world.choice(np.clip(flat + solved.x, least, most))


def _answer(table: UioTable, row: int, lags: int, signals: int) -> Array:
    """How an estimate follows from values now and before: lags x signals."""
    weight = np.zeros((lags, signals))
    weight[0, list(table.signal)] = table.direct[row]
    shown = table.output[row]
    for j in range(1, lags):
        weight[j, list(table.signal)] = shown @ table.input
        shown = shown @ table.state
    return weight
