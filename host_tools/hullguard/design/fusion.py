"""Thresholds and silence constants of event-triggered fusion (methods, fusion, section 3), from a mean-field Riccati equation.

A sensor with threshold delta (innovation standard deviations) speaks with probability lam = 2 Q(delta). Its frame carries a whole measurement, its silence the share
beta(delta) of one, so that on average it carries eta = lam + (1 - lam) beta, and P <- P - eta g g' / s in place of P - g g' / s is the mean course of the filter's
covariance. That is all the allocation of a budget of frames needs; no simulation is part of it.

Matrices are row-major arrays: A [n, n], Q [n, n], C [m, n], R [m]; P [n, n].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are
from scipy.optimize import brentq, minimize
from scipy.special import ndtr

from hullguard.errors import InputError
from hullguard.model.table import Array

LOSS_RATES = (0.0, 0.05, 0.10, 0.15, 0.20, 0.25, 0.30)
RATE_MIN, RATE_MAX = 0.01, 0.97  # of one sensor: nothing is gained beyond, and the normal approximation fails near 0
SETTLED = 1e-10  # relative change of all R' in a round at which a mean field has arrived
ROUNDS_MAX = 200
SAMPLES_MAX = 20000  # until a schedule repeats
SILENT = -1.0  # relaxation that says nothing


@dataclass(frozen=True)
class Fusion:
    """A linear plant x+ = A x + w, w ~ N(0, Q), and its scalar sensors y_i = C_i x + v_i, v_i ~ N(0, R_i)."""

    A: Array
    Q: Array
    C: Array
    R: Array
    x0: Array
    P0: Array

    def __post_init__(self) -> None:
        n, m = len(self.A), len(self.C)
        shapes = {"A": (n, n), "Q": (n, n), "C": (m, n), "R": (m,), "x0": (n,), "P0": (n, n)}
        for name, shape in shapes.items():
            found = np.shape(getattr(self, name))
            if found != shape:
                raise InputError(f"fusion: {name} has shape {found}; with {n} states and {m} sensors it must be {shape}")
        if not 1 <= m <= 16:
            raise InputError(f"fusion: {m} sensors; the library takes 1 .. 16 scalar ones: split the filter")
        if np.any(self.R <= 0.0):
            raise InputError("fusion: a sensor without noise; give every sensor a standard deviation above 0")

    @property
    def states(self) -> int:
        """Number of states n."""
        return len(self.A)

    @property
    def sensors(self) -> int:
        """Number of sensors m."""
        return len(self.C)

    def only(self, alive: Sequence[int]) -> Fusion:
        """The same plant with these sensors."""
        keep = list(alive)
        return Fusion(self.A, self.Q, self.C[keep], self.R[keep], self.x0, self.P0)


def rate_of(delta: float) -> float:
    """Probability of |z| > delta for a standard normal z."""
    return float(2.0 * ndtr(-delta))


def delta_of(rate: float) -> float:
    """Threshold with this probability, 0 < rate < 1."""
    return float(brentq(lambda d: rate_of(d) - rate, 1e-9, 9.0, xtol=1e-14))


def density(z: float) -> float:
    """Standard normal density."""
    return math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)


def beta(delta: float, loss: float = 0.0) -> float:
    """Share of a measurement that silence carries: 1 - the variance of a standard normal z given silence.

    Silence is |z| < delta, or a frame that was lost with probability `loss`.
    """
    inside = 1.0 - rate_of(delta)
    cut = inside - 2.0 * delta * density(delta)  # second moment within +-delta
    return 1.0 - ((1.0 - loss) * cut + loss) / (inside + loss * (1.0 - inside))


def beta_stochastic(level: float, loss: float = 0.0) -> float:
    """The same for the stochastic trigger, silent with probability exp(-level z^2 / 2): the mixture of two normals about the reference."""
    v = 1.0 / (1.0 + level)
    h = math.sqrt(v)
    return 1.0 - ((1.0 - loss) * h * v + loss) / ((1.0 - loss) * h + loss)


def relaxation(share: float) -> float:
    """1 / beta - 1 as the library takes it."""
    return 1.0 / share - 1.0 if share > 0.0 else SILENT


@dataclass(frozen=True)
class MeanField:
    """Steady state of a set of rates."""

    rates: Array  # [m]
    delta: Array  # [m]
    prior: Array  # P before the updates of a sample
    P: Array  # and after them
    wide: Array  # [m] sqrt(S_i of the prior / s_i when its turn comes): by how much the interval of silence is wider than delta then
    worth: Array  # [m] variance of a measurement in every sample that would do the same

    def rms(self, states: Sequence[int]) -> float:
        """Predicted root of the sum of these states' mean squared errors."""
        return float(np.sqrt(np.diag(self.P)[list(states)].sum()))


def _sample(model: Fusion, prior: Array, lam: Array, delta: Array, silence: bool, parallel: bool) -> tuple[Array, Array, Array]:
    """One sample's updates in the mean: P after them, [m] R' of a measurement that would do the same, [m] sqrt(S_i / s_i)."""
    P, worth, wide = prior, np.zeros(model.sensors), np.ones(model.sensors)
    for i, c in enumerate(model.C):
        g = P @ c
        p = c @ g
        s = p + model.R[i]
        if parallel:
            wide[i] = math.sqrt((c @ prior @ c + model.R[i]) / s)
        eta = lam[i] + (1.0 - lam[i]) * (beta(delta[i] * wide[i]) if silence else 0.0)
        P = P - eta * np.outer(g, g) / s
        worth[i] = s / eta - p
    return P, worth, wide


def mean_field(model: Fusion, rates: Sequence[float] | Array, silence: bool = True, parallel: bool = False, worth: Array | None = None) -> MeanField:
    """Steady state when sensor i speaks at rates[i].

    `silence`: whether silence is used. `parallel`: all triggers compare with the common prediction, so that an interval is wider than delta when sensors before it have
    been fused; without, as in section 3, each compares with the estimate when its turn comes. `worth`: R' to begin with, of a state nearby.

    An update by the share eta of g g' / s is that of a measurement with R' = s / eta - C g: with all R' it is an algebraic Riccati equation, and R' settles in few rounds.
    """
    lam = np.clip(np.asarray(rates, dtype=float), 1e-6, 1.0 - 1e-6)
    delta = np.array([delta_of(r) for r in lam])
    worth = model.R / lam if worth is None else worth
    for _ in range(ROUNDS_MAX):
        before = worth
        try:
            prior = solve_discrete_are(model.A.T, model.C.T, model.Q, np.diag(worth))
        except np.linalg.LinAlgError as error:
            raise InputError("fusion: the covariance does not settle; a state that no sensor sees grows for ever: add a sensor") from error
        P, worth, wide = _sample(model, prior, lam, delta, silence, parallel)
        if np.all(np.abs(worth - before) <= SETTLED * worth):
            return MeanField(lam, delta, prior, P, wide, worth)
    raise InputError(f"fusion: the mean covariance does not settle in {ROUNDS_MAX} rounds; choose rates further from 0")


def allocate(model: Fusion, rate: float, weight: Sequence[float] | Array, silence: bool = True) -> MeanField:
    """Thresholds that make weight' diag(P) least at a mean rate of frames a sensor and sample (SLSQP over the sensors' rates)."""
    if not RATE_MIN < rate < RATE_MAX:
        raise InputError(f"fusion: a budget of {rate:g} frames a sensor and sample is outside {RATE_MIN} .. {RATE_MAX}")
    w = np.asarray(weight, dtype=float)
    m = model.sensors

    near: list[Array | None] = [None]

    def cost(lam: Array) -> float:
        found = mean_field(model, lam, silence, worth=near[0])
        near[0] = found.worth
        return float(w @ np.diag(found.P))

    scale = cost(np.full(m, rate))
    by_precision = np.clip(rate * m / model.R / (1.0 / model.R).sum(), 0.05, 0.95)
    best: tuple[float, Array] | None = None
    for begin in (np.full(m, rate), by_precision + (rate - by_precision.mean())):
        found = minimize(
            lambda lam: cost(lam) / scale,
            np.clip(begin, RATE_MIN, RATE_MAX),
            bounds=[(RATE_MIN, RATE_MAX)] * m,
            constraints={"type": "eq", "fun": lambda lam: lam.mean() - rate},
            method="SLSQP",
            options={"maxiter": 60, "ftol": 1e-9},
        )
        if best is None or found.fun < best[0]:
            best = (float(found.fun), np.array(found.x))
    assert best is not None
    return mean_field(model, best[1], silence)


@dataclass(frozen=True)
class TriggerTable:
    """What hg_fusion_table holds: thresholds of one set of sensors alive, and what silence is worth at each loss rate."""

    alive: int
    level: tuple[float, ...]  # [m]
    relax: tuple[tuple[float, ...], ...]  # [rates][m]
    early: tuple[tuple[float, ...], ...]  # [rates][m]


def innovation_table(model: Fusion, delta: Array, rates: Array, alive: Sequence[int] | None = None, late: float = 0.0, known: bool = True) -> TriggerTable:
    """Thresholds delta_i^2 and constants beta_p of the innovation trigger with the common prediction as reference.

    `late`: probability that a frame is not there yet when its sample is closed. `known`: False makes silence say nothing (as published). Sensors that are not alive get
    the loosest threshold: their heartbeat alone is wanted.
    """
    numbers = list(range(model.sensors)) if alive is None else list(alive)
    part = model.only(numbers)
    wide = mean_field(part, rates, parallel=True).wide

    def row(loss: float) -> tuple[float, ...]:
        found = [SILENT] * model.sensors
        for place, i in enumerate(numbers):
            found[i] = relaxation(beta(float(delta[place] * wide[place]), loss)) if known else SILENT
        return tuple(found)

    level = [81.0] * model.sensors
    for place, i in enumerate(numbers):
        level[i] = float(delta[place] ** 2)
    relax = tuple(row(p) for p in LOSS_RATES)
    early = tuple(row(p + (1.0 - p) * late) for p in LOSS_RATES)
    return TriggerTable(sum(1 << i for i in numbers), tuple(level), relax, early)


def plain_table(model: Fusion, level: Sequence[float] | Array, share: Sequence[Sequence[float]] | None = None) -> TriggerTable:
    """Given thresholds; `share`: beta of each loss rate and sensor, None: silence says nothing."""
    none = tuple((SILENT,) * model.sensors for _ in LOSS_RATES)
    relax = none if share is None else tuple(tuple(relaxation(b) for b in row) for row in share)
    return TriggerTable((1 << model.sensors) - 1, tuple(float(v) for v in level), relax, relax)


def masked_tables(model: Fusion, rate: float, weight: Sequence[float] | Array, late: float = 0.0) -> tuple[TriggerTable, ...]:
    """The table of all sensors, then one for each sensor that may be missing, each with the whole budget for those that are left.

    A set that the rest cannot observe has no steady state and no table: the first one serves.
    """
    everyone = list(range(model.sensors))
    found = []
    for alive in (everyone, *([i for i in everyone if i != out] for out in everyone)):
        if not alive:
            continue
        try:
            part = model.only(alive)
            made = allocate(part, min(rate * model.sensors / len(alive), 0.95 * RATE_MAX), weight)
            found.append(innovation_table(model, made.delta, made.rates, alive, late))
        except InputError:
            if len(alive) == model.sensors:
                raise
    return tuple(found)


@dataclass(frozen=True)
class Schedule:
    """Frames of the prediction-variance trigger without losses: no data in it, so it can be written down beforehand."""

    level: tuple[float, ...]  # [m] tau R_i
    settle: int  # samples before it repeats
    period: int  # samples
    sends: tuple[tuple[int, ...], ...]  # [period] sensors that send, in each
    rate: float  # frames a sensor and sample


def schedule(model: Fusion, tau: float) -> Schedule:
    """Sensor i speaks when C_i P C_i' > tau R_i, P after the updates of the sensors before it."""
    P = model.P0.copy()
    seen: dict[bytes, int] = {}
    course: list[tuple[int, ...]] = []
    for k in range(SAMPLES_MAX):
        P = model.A @ P @ model.A.T + model.Q
        sends = []
        for i in range(model.sensors):
            g = P @ model.C[i]
            if model.C[i] @ g > tau * model.R[i]:
                sends.append(i)
                P = P - np.outer(g, g) / (model.C[i] @ g + model.R[i])
        course.append(tuple(sends))
        key = np.round(P / np.abs(P).max(), 9).tobytes()
        if key in seen:
            period = k - seen[key]
            cycle = tuple(course[-period:])
            return Schedule(tuple(float(tau * r) for r in model.R), k - period + 1, period, cycle, sum(map(len, cycle)) / (period * model.sensors))
        seen[key] = k
    raise InputError(f"fusion: no schedule repeats within {SAMPLES_MAX} samples at tau = {tau:g}; choose another")


def scheduled(model: Fusion, rate: float) -> Schedule:
    """The schedule with the most frames that keeps to a mean rate."""
    low, high = 1e-6, 1e6
    for _ in range(60):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if schedule(model, middle).rate > rate else (low, middle)
    return schedule(model, high)


def variance_level(tau: float, window: int, resolution: float, detrended: bool) -> int:
    """Level of the integer variance trigger (variance.h) for a variance of tau, signal units squared, and codes of this resolution."""
    factor = window * (window**2 - 1) * (window - 2) if detrended else window * (window - 1)
    return math.ceil(tau / resolution**2 * factor)
