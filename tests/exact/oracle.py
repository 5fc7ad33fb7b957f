"""The library against exact rational numbers: every value and radius, every residual, every threshold of a run, as they lie in its memory.

    |true - value| <= radius              of every signal of a group whose losses are known, also of the samples before that a gap has rewritten; and of
                                          what an uncertain plant does beyond its middle
    |r_exact - r| <= rounding of r        r_exact from the tables and the values that the library has, in rational numbers; and in fixed point, where half a
                                          step each is all there is, the design's share of the threshold is no less than what all of them can add up to
    J >= J_exact + |r_exact - r|          the hull of these tables over the radii that the library has: disturbances and initial states as they are,
                                          the plant as it is; no tail. And J no more above it than the design says it may be.

For the proof of a bound from below numbers are cut, never rounded up: to 2^-PLACES.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
from certificates import Bank, Judged
from dyadic import Exact, exact, joined, zeros
from healthy import Healthy, within_slews
from hullguard.core.library import library
from hullguard.core.native import MOVING, REST, Native, Node, Sender
from hullguard.design import hull
from hullguard.design.design import Design, Generator
from hullguard.design.tables import GeneratorTable
from hullguard.model.table import Array

PLACES = 160
WIDENED = 1e-4  # more than sums of some hundred numbers are widened by in float32
UNIT = {"f32": Fraction(1, 2**24), "f64": Fraction(1, 2**53)}


class BrokenError(Exception):
    """A promise that does not hold."""


@dataclass
class Worst:
    """What a run has shown, as shares of what is allowed: 1 is the limit."""

    hold: float = 0.0  # |true - value| / radius
    rounding: float = 0.0  # |r_exact - r| / bound
    low: float = float("inf")  # J / J_exact, at least 1
    slack: float = 0.0  # (J - J_exact) / what it may be
    samples: int = 0

    def join(self, other: Worst) -> Worst:
        """Of both."""
        return Worst(max(self.hold, other.hold), max(self.rounding, other.rounding), min(self.low, other.low), max(self.slack, other.slack), self.samples + other.samples)


class Reader:
    """Numbers of a node as exact ones, in the units of the signals."""

    def __init__(self, node: Node, native: Native) -> None:
        self._d, self._ffi, self._t, self._q31 = node.node.detector, native.library.ffi, native.tables, native.library.real == "q31"
        self._seen: dict[int, bytes] = {}

    def _exact(self, pointer: Any, count: int, first: int) -> Exact:
        numbers = self._ffi.unpack(pointer, count)
        if not self._q31:
            return exact(numbers)
        units = self._t.units[first : first + count]
        return joined([Exact(np.array([n], dtype=object), 31).scaled(u) for n, u in zip(numbers, units, strict=True)])

    def value(self) -> Exact:
        return self._exact(self._d.value, self._t.width, 0)

    def radii(self, lags: int) -> list[tuple[int, Exact]]:
        """Rows of the ring that are not as they were at the last call, as (lag, row): the newest, and what a gap has rewritten."""
        ring, found = self._d.radii, []
        for lag in range(lags):
            row = (ring.newest - lag) % ring.length
            raw = bytes(self._ffi.buffer(ring.data + row * ring.width, ring.width * self._ffi.sizeof("hg_real")))
            if lag == 0 or self._seen.get(row) != raw:
                found.append((lag, self._exact(ring.data + row * ring.width, ring.width, 0)))
            self._seen[row] = raw
        return found

    def r(self) -> Exact:
        return self._exact(self._d.r, self._t.residuals, self._t.width)

    def J(self) -> Exact:
        return self._exact(self._d.J, self._t.residuals, self._t.width)

    def closest(self, bank: int) -> int:
        """The certificate that a bank speaks of."""
        return int(self._d.memory.bank[bank].closest)

    def open(self) -> list[bool]:
        """Which thresholds are the largest number there is: no finite residual is above it, and what is not finite is refused."""
        return [self._q31 and J == 2**31 - 2 for J in self._ffi.unpack(self._d.J, self._t.residuals)]


class Residual:
    """One generator in rational numbers, from the library's own tables and values; and how far the library may be off it."""

    def __init__(self, table: GeneratorTable, real: str, units: tuple[int, ...], width: int, first: int) -> None:
        self._q31, self._signal = real == "q31", list(table.signal)
        moved, shown, _ = table.exponents
        state, into = (exact(m).scaled(moved) for m in (table.state, table.input))
        output, direct = (exact(m).scaled(shown) for m in (table.output, table.direct))
        self.G, self.E, self.F, self.D = state, into, output, direct
        self._in = [units[g] for g in self._signal] if units else [0] * len(self._signal)
        self._out = [units[width + first + i] for i in range(len(table.output))] if units else [0] * len(table.output)
        self._z = zeros(len(table.state))
        self._off = np.zeros(len(table.state))
        count = len(table.state) + len(self._signal) + 2
        u = UNIT.get(real, Fraction(0))
        self._gamma = float(count * u / (1 - count * u)) * (1 + 1e-9)
        self._step = 2.0**-32 if self._q31 else 0.0

    def step(self, value: Exact) -> tuple[Exact, Array]:
        """r, and a bound of its rounding, both in the residual's own units."""
        v = joined([value[g : g + 1].scaled(-unit) for g, unit in zip(self._signal, self._in, strict=True)])
        r = self.F @ self._z + self.D @ v
        size, reading = np.abs(self._z.floats()) + self._off, np.abs(v.floats())
        G, E, F, D = (np.abs(m.floats()) for m in (self.G, self.E, self.F, self.D))
        off = (F @ self._off + self._gamma * (F @ size + D @ reading) + self._step) * (1 + 1e-9)
        self._off = (G @ self._off + self._gamma * (G @ size + E @ reading) + self._step) * (1 + 1e-9)
        self._z = self.G @ self._z + self.E @ v
        bound = off * 2.0 ** np.array(self._out)
        return joined([r[i : i + 1].scaled(unit) for i, unit in enumerate(self._out)]), bound

    def fixed(self, decay: Array) -> Array:
        """What fixed point may lose at most, of r and of J: half a step at each sum, and in a tail at a product and a sum each sample."""
        F, G = self.F.floats(), self.G.floats()
        lost, power = np.full(len(self._out), 0.5), F
        while np.abs(power).max() > 1e-12:
            lost, power = lost + 0.5 * np.abs(power).sum(1), power @ G
        return np.asarray((lost + 0.5 + 1.0 / (1.0 - decay)) * 2.0 ** (np.array(self._out) - 31))


class Hull:
    """The threshold of one generator in rational numbers, from the radii that the library has."""

    def __init__(self, made: Design, g: Generator, start: int) -> None:
        assert g.given is not None
        self._g = g
        first = sum(len(x.linear.output) for x in made.generators[: made.generators.index(g)])
        self._lost = np.array((made.fixed_rounding or (0.0,) * made.tables.residuals)[first : first + len(g.linear.output)])
        m, lin, given = len(g.spec.outputs), g.linear, g.given
        G, E, F, D, T = (exact(x) for x in (lin.state, lin.input, lin.output, lin.direct, given.T))
        A, B, C, Dp, Ed, Fd = (exact(x) for x in (given.plant.A, given.plant.B, given.plant.C, given.plant.D, given.plant.Ed, given.plant.Fd))
        Ly, Lu, Dy, Du = E[:, :m], E[:, m:], D[:, :m], D[:, m:]
        disturbed = T @ Ed - Ly @ Fd
        # Rounded tables do not follow the plant exactly.
        state, control = T @ A - G @ T - Ly @ C, T @ B - Ly @ Dp - Lu
        state_r, control_r = F @ T + Dy @ C, Dy @ Dp + Du
        x, u = exact(given.ranges.state), exact(given.ranges.input)
        entering = joined_columns(E, T @ exact(given.derived))
        zero = zeros(D.whole.shape[0], given.derived.shape[1])
        self._at_once = (abs(Dy @ Fd).sums() + abs(state_r) @ x + abs(control_r) @ u).floor(PLACES)
        self._lag = [abs(joined_columns(D, zero)).floor(PLACES)]
        self._driven: list[Exact] = []
        self._initial: list[Exact] = []
        begun = exact(given.ranges.initial if start == REST else given.ranges.state)
        self._parts = (F, G, T, entering, disturbed, state, control, x, u, begun)
        self._places = [*g.signal, *range(made.tables.width - len(made.uncertain), made.tables.width)]

    def _further(self) -> None:
        """One more lag: F G^j."""
        F, G, T, entering, disturbed, state, control, x, u, begun = self._parts
        self._initial.append((abs(F @ T) @ begun).floor(PLACES))
        self._lag.append(abs(F @ entering).floor(PLACES))
        self._driven.append((abs(F @ disturbed).sums() + abs(F @ state) @ x + abs(F @ control) @ u).floor(PLACES))
        self._parts = (F @ G, G, T, entering, disturbed, state, control, x, u, begun)

    def at(self, radii: list[Exact]) -> Exact:
        """J_exact of the last sample of a run; `radii` of all samples since the start."""
        k = len(radii) - 1
        while len(self._initial) <= k:
            self._further()
        total = self._at_once + self._initial[k]
        for j in range(k):
            total = total + self._driven[j]
        for lag in range(k + 1):
            total = total + self._lag[lag] @ radii[k - lag][self._places].floor(PLACES)
        return total

    def slack(self, k: int, widest: Array, J: Array, real: str) -> Array:
        """How far the threshold may be above: the tail's share of radii that are `widest` times the usual ones, what is left of a start, and rounding."""
        t = self._g.tables
        initial = self._initial[k].floats()
        tail = hull.TAIL_SHARE * t.steady * max(1.0, float(widest.max()))
        begun = hull.START_SHARE * (t.steady + initial) + hull.BIAS_SHARE * t.steady
        lost = self._lost if real == "q31" else t.rounding
        return np.asarray(tail + begun + lost + WIDENED * J)


def joined_columns(left: Exact, right: Exact) -> Exact:
    """Two matrices side by side."""
    places = max(left.places, right.places)
    a, b = left.whole * (1 << (places - left.places)), right.whole * (1 << (places - right.places))
    return Exact(np.concatenate([a, b], axis=1), places)


class Links:
    """Which groups' losses are known: from the loss of a frame until the next one, whose counter tells, nothing is promised."""

    def __init__(self, groups: int) -> None:
        self.unknown = [False] * groups

    def sent(self, group: int, lost: bool) -> bool:
        """Whether a gap shows with this frame."""
        shows = self.unknown[group] and not lost
        self.unknown[group] = lost or (self.unknown[group] and not shows)
        return shows


@dataclass
class Run:
    """One run of a model, checked at every sample."""

    made: Design
    real: str
    seed: int
    loss: float
    start: int
    worst: Worst = field(default_factory=Worst)

    def __post_init__(self) -> None:
        tables = self.made.tables
        self._native = Native(library(self.real), tables)
        self._node, self._sender = Node(self._native, self.start), Sender(self._native)
        self._read = Reader(self._node, self._native)
        t = self._native.tables
        first = np.cumsum([0, *(len(g.output) for g in t.generators)])
        self._residuals = [Residual(g, self.real, t.units, t.width, int(i)) for g, i in zip(t.generators, first, strict=False)]
        self._hulls = [Hull(self.made, g, self.start) if g.given is not None and g.zonotope is None else None for g in self.made.generators]
        self._first = [int(i) for i in first]
        mismatched = bool(self.made.uncertain)  # of an uncertain plant radii without values count too
        self._banks = [] if mismatched else [Bank(self.made, t, i) for i in range(len(t.banks))]
        if self.real == "q31":
            self._stated()
        self._truth: list[Exact] = []
        self._mismatch: list[Exact] = []
        self._values: list[Exact] = []
        self._radii: list[Exact] = []
        half = np.array([s.half for g in tables.groups for s in g.signals])  # of inputs that are applied as sent: rounding alone
        self._usual = np.array(self.made.usual)
        self._usual[: len(half)] = np.maximum(self._usual[: len(half)], half)

    def _stated(self) -> None:
        """What the design says that rounding is of a threshold is no less than what it can be."""
        for i, residual in enumerate(self._residuals):
            g = self.made.generators[i]
            if g.zonotope is None:
                stated = np.array(self.made.fixed_rounding[self._first[i] : self._first[i] + len(g.tables.decay)])
                lost = residual.fixed(g.tables.decay)
                if np.any(lost > stated * (1 + 1e-9)):
                    raise BrokenError(f"generator {i + 1}: rounding in fixed point is said to be {stated}, it can be {lost}")

    def samples(self, count: int) -> Worst:
        """So many; the first promise that does not hold ends it."""
        rng = np.random.default_rng([self.seed, 0xE8AC7])
        plant, links = Healthy(self.made, rng), Links(len(self.made.tables.groups))
        if self.start == MOVING:
            for _ in range(int(rng.integers(5, 40))):
                plant.step()
        closing = self.made.tables.closing
        for k in range(count):
            self._truth.append(plant.step())
            self._mismatch.append(plant.mismatch)
            if not within_slews(self.made, self._truth[-12:]):
                raise BrokenError("the plant of this check moves faster than the model says: the check is wrong")
            reading, shows = self._truth[-1].floats().tolist(), False
            for g in (*(g for g in range(len(self.made.tables.groups)) if g != closing), closing):
                frame = self._sender.step(g, k, reading)
                if frame is not None:
                    lost = g != closing and rng.random() < self.loss
                    shows = links.sent(g, lost) or shows
                    if not lost:
                        self._node.receive(frame)
            verdict = self._node.step()
            if verdict is None:
                raise BrokenError(f"sample {k}: no step was made")
            self._check(k, links, shows)
            if verdict.plant == "confirmed" or (verdict.plant == "provisional" and self.loss == 0.0):
                raise BrokenError(f"sample {k}: a false alarm, {verdict.plant}")
        self.worst.samples = count
        return self.worst

    def _check(self, k: int, links: Links, shows: bool) -> None:
        self._values.append(self._read.value())
        self._radii.append(self._values[k])
        lags = min(k + 1, self._native.tables.history)
        changed = self._read.radii(lags)
        for lag, row in changed:
            self._radii[k - lag] = row
        for lag in range(lags) if shows else [lag for lag, _ in changed]:
            self._held(k - lag, links)
        r, J = self._read.r(), self._read.J()
        for i, residual in enumerate(self._residuals):
            found, bound = residual.step(self._values[k])
            self._rounded(k, i, r, found, bound)
            self._threshold(k, i, J, abs(r[self._first[i] : self._first[i] + len(bound)] - found))

        for i, bank in enumerate(self._banks):
            place = self._native.tables.residuals - len(self._banks) + i
            self._certified(f"sample {k}, bank {i + 1}", bank.judge(self._values, self._radii), self._read.closest(i), r.fraction(place), J.fraction(place))

    def _certified(self, what: str, certificates: list[Judged], closest: int, r: Fraction, J: Fraction) -> None:
        """What the library says of a bank is what the certificate is that it calls closest, and its threshold is no smaller than that one's least."""
        if not certificates:
            return
        found = certificates[closest]
        if abs(found.r.fraction(0) - r) > Fraction(found.rounding):
            raise BrokenError(f"{what}: r = {float(r):.9g} is not that of certificate {closest + 1}, {float(found.r.fraction(0)):.9g}")
        if found.J.fraction(0) > J:
            raise BrokenError(f"{what}: J = {float(J):.9g} is less than the exact {float(found.J.fraction(0)):.9g}")
        if float(J - found.J.fraction(0)) > found.above:
            raise BrokenError(f"{what}: J = {float(J):.9g} is above the exact {float(found.J.fraction(0)):.9g} by more than {found.above:.3g}")
        self.worst.low = min(self.worst.low, float(J / found.J.fraction(0)))

    def _held(self, k: int, links: Links) -> None:
        """|true - value| <= radius."""
        for group, g in enumerate(self.made.tables.groups):
            if not links.unknown[group]:
                for n, s in enumerate(g.signals):
                    place = g.first + n
                    self._within(f"sample {k}, signal {s.name}", self._truth[k], place, place, k)
        for p in self.made.tables.predictors:
            if not any(links.unknown):
                for n in range(len(p.output)):
                    self._within(f"sample {k}, prediction of signal {p.first + n}", self._truth[k], p.first + n, self._twin(p, n), k)

        first = self.made.tables.width - len(self.made.uncertain)
        for n, state in enumerate(self.made.uncertain if not any(links.unknown) else ()):
            moved, radius = abs(self._mismatch[k]).fraction(state), self._radii[k].fraction(first + n)
            if moved > radius:
                raise BrokenError(f"sample {k}, state {state}: what an uncertain plant does, {float(moved):.9g}, is more than the radius {float(radius):.9g}")
            self.worst.hold = max(self.worst.hold, float(moved / radius))

    def _twin(self, p: Any, n: int) -> int:
        before = self.made.tables.predictors[: self.made.tables.predictors.index(p)]
        return self.made.tables.signals + sum(len(q.output) for q in before) + n

    def _within(self, what: str, truth: Exact, place: int, held: int, k: int) -> None:
        off = abs(truth[place : place + 1] - self._values[k][held : held + 1]).fraction(0)
        radius = self._radii[k].fraction(held)
        if off > radius:
            raise BrokenError(f"{what}: |true - value| = {float(off):.9g} is more than the radius {float(radius):.9g}")
        self.worst.hold = max(self.worst.hold, float(off / radius) if radius else 0.0)

    def _rounded(self, k: int, i: int, r: Exact, found: Exact, bound: Array) -> None:
        for n in range(len(bound)):
            off = abs(r[self._first[i] + n : self._first[i] + n + 1] - found[n : n + 1]).fraction(0)
            if off > Fraction(float(bound[n])):
                raise BrokenError(f"sample {k}, generator {i + 1}, residual {n + 1}: rounding has moved it by {float(off):.3g}, more than {bound[n]:.3g}")
            self.worst.rounding = max(self.worst.rounding, float(off) / float(bound[n]) if off else 0.0)

    def _threshold(self, k: int, i: int, J: Exact, moved: Exact) -> None:
        exactly = self._hulls[i]
        if exactly is None:
            return
        least = exactly.at(self._radii) + moved
        own = J[self._first[i] : self._first[i] + least.whole.shape[0]]
        widest = np.max([np.max((x.floats() / self._usual)[list(self.made.generators[i].signal)]) for x in self._radii])
        allowed = exactly.slack(k, np.array([widest]), own.floats(), self.real)
        for n in range(least.whole.shape[0]):
            if self._read.open()[self._first[i] + n]:
                continue
            a, b = own.fraction(n), least.fraction(n)
            if a < b:
                raise BrokenError(f"sample {k}, generator {i + 1}, residual {n + 1}: J = {float(a):.9g} is less than the exact {float(b):.9g}")
            if a - b > Fraction(float(allowed[n])):
                raise BrokenError(f"sample {k}, generator {i + 1}, residual {n + 1}: J = {float(a):.9g} is above the exact {float(b):.9g} by more than {allowed[n]:.3g}")
            self.worst.low = min(self.worst.low, float(a / b))
            self.worst.slack = max(self.worst.slack, float(a - b) / float(allowed[n]))
