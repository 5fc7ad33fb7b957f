"""Tables of the radii of an unknown-input observer's estimates (uio.h, hull.h): what they can be wrong without a broken promise.

With the rounded tables s(k+1) = Gr s + Er v, estimate = Fr s + Dr v and e = T x - s (and t, the low-passed unknown input, where a row follows one):

    e(k+1) = Gr e + w - Er ev + (mismatch of the rounded and held tables) + (rounding of one step)            estimate - truth = -Fr e + Dr (ev + Fd d)

w: unknown inputs as far as they get through (a hold lets a little pass, and what changes within a sample does), and the disturbances. The lags
behind the taps have a theta for each mode, and so has the initial state: slow modes are an unknown-input observer's own (its invariant zeros).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hullguard.design.arith import digits, mul, powers, row_sums, share32, up32
from hullguard.design.hull import DOUBLE, READY_SHARE, TAIL_SHARE, Fixed, HullTables, Linear, Ranges, rounding_of
from hullguard.design.observer import SubPlant
from hullguard.errors import InputError
from hullguard.model.table import Array

SLOWEST = 1.0 - 1e-5  # pole: with a slower one sums over 10^6 lags would be needed
FORGOTTEN = 0.02  # what a mode has left when rounding is no longer followed lag by lag
GONE = 1e-9  # and when a sum of magnitudes ends
FAST = 1e-24  # what a mode has left behind the taps: below it, its share of the initial state is in the bias, or its theta would not fit float32
SETTLE_MAX = 254
TAPS_MAX = 120  # behind them modes take over, a few per cent above the exact sum
WIDER = 1 + 1e-6  # more than eigenvectors can be off where CONDITION holds
CONDITION = 1e9
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class ModalTables(HullTables):
    """What hg_hull_config holds, with a theta for each mode in place of the common one."""

    mode_decay: Array  # modes
    mode_input: Array  # modes x width
    mode_output: Array  # rows x modes
    mode_rest: Array  # modes
    mode_moving: Array  # modes
    steady_bias: Array  # rows: what no radius is in it, in the long run

    def first(self, rows: int) -> ModalTables:
        """The tables of the first estimates alone."""
        of_rows = {name: getattr(self, name)[:rows] for name in ("rest_left", "moving_left", "bias", "decay", "tail", "mode_output", "rounding", "steady", "steady_bias")}
        return replace(self, weight=self.weight[:, :rows], rest=self.rest[:, :rows], moving=self.moving[:, :rows], **of_rows)


@dataclass(frozen=True)
class Passing:
    """What gets into e and is no signal's radius, each bound for one sample."""

    box: Array  # order: rows independent of one another
    columns: Array  # order x nd: disturbances |d| <= 1
    at_once: Array  # rows x nd: what the same disturbances do to an estimate at once, the noise of the sensors


@dataclass(frozen=True)
class ModalGiven:
    """What the tables of one observer follow from, besides its matrices."""

    T: Array  # order x n
    truth: Array  # rows x n: what the rows stand for
    plant: SubPlant
    ranges: Ranges
    passing: Passing
    radius: Array  # width: what the radii usually are
    least: int  # fewest taps


def _vectors(G: Array) -> tuple[Complex, Complex]:
    """Poles and eigenvectors, in an order and a basis that do not depend on the processor.

    Low passes are states that move no other, each a mode of its own however many have the same pole; the observer's own modes are sorted.
    """
    low = np.array([not np.any(np.delete(G[:, k], k)) for k in range(len(G))])
    own = np.diag(G)[low]
    values, inner = np.linalg.eig(G[np.ix_(~low, ~low)])
    order = np.lexsort((np.round(values.imag, 9), np.round(values.real, 9)))
    values, inner = values[order].astype(complex), inner[:, order].astype(complex)
    vectors = np.zeros((len(G), len(G)), dtype=complex)
    vectors[np.ix_(~low, np.arange(len(values)))] = inner
    with np.errstate(divide="ignore", invalid="ignore"):
        vectors[np.ix_(low, np.arange(len(values)))] = (G[np.ix_(low, ~low)] @ inner) / (values[None, :] - own[:, None])
    vectors[np.ix_(low, np.arange(len(values), len(G)))] = np.eye(len(own))
    with np.errstate(invalid="ignore"):  # vectors of equal poles are infinite: the caller refuses them
        return np.concatenate([values, own]), np.asarray(vectors / np.linalg.norm(vectors, axis=0))


def _modes(lin: Linear, where: str) -> tuple[Array, Complex, Complex]:
    """Magnitudes of the poles, |S^-1| and |M S| made one of each complex pair, the output counted twice."""
    values, vectors = _vectors(lin.state)
    if np.abs(values).max() >= SLOWEST:
        raise InputError(f"{where}: a pole of magnitude {np.abs(values).max():.7f} is too slow for a threshold; choose faster ones, or other outputs if it is fixed")
    if not np.all(np.isfinite(vectors)) or np.linalg.cond(vectors) > CONDITION or np.abs(lin.state @ vectors - vectors * values).max() > 1e-10 * (1 + np.abs(lin.state).max()):
        raise InputError(f"{where}: poles so close to one another, or to the low pass, that their modes cannot be told apart; spread them")
    keep = values.imag >= 0
    twice = np.where(values.imag > 0, 2.0, 1.0)[keep]
    return np.abs(values)[keep], np.asarray(np.linalg.inv(vectors))[keep], np.asarray((lin.output @ vectors)[:, keep] * twice)


def _times(F: Array, M: Array) -> Array:
    """F(lag) M of all lags, summed in index order."""
    out = np.zeros((F.shape[0], F.shape[1], M.shape[1]))
    for i in range(F.shape[2]):
        out += F[:, :, i, None] * M[None, i, None, :]
    return out


def build(lin: Linear, given: ModalGiven, where: str, fixed: Fixed | None = None) -> ModalTables:
    """All tables, rounded up to float32; for fixed point not yet rounded, and without what the steps of the thetas lose."""
    T, plant, ranges, passing, radius = given.T, given.plant, given.ranges, given.passing, given.radius
    decay, inverse, out = _modes(lin, where)
    slowest = float(decay.max())
    length = int(np.ceil(np.log(GONE) / np.log(max(slowest, 0.05)))) + 2
    F = powers(lin.output, lin.state, length)
    lags = max(64, int(np.ceil(np.log(FORGOTTEN) / np.log(max(slowest, 0.05)))))
    loss = rounding_of(lin, T, plant, ranges, np.hstack([np.diag(passing.box), passing.columns]), np.zeros((len(lin.state), 0)), min(lags, length), fixed, given.truth)
    weights = np.concatenate([np.abs(lin.direct)[None], np.abs(_times(F, lin.input))])
    count = loss.weight.shape[0]
    weights[:count] += loss.weight
    step = _times(np.abs(F), loss.into_e[:, None])[:, :, 0]
    driven = _times(np.abs(F), passing.box[:, None])[:, :, 0] + np.array([row_sums(x) for x in np.abs(_times(F, passing.columns))])
    per_step = step + driven
    behind = (np.abs(out) * (decay**length / (1 - decay))) @ (np.abs(inverse) @ (loss.into_e + passing.box + row_sums(np.abs(passing.columns))))

    mode_input = np.abs(mul(inverse.real, lin.input) + 1j * mul(inverse.imag, lin.input)) * WIDER
    rounded_lags = mul(loss.weight.reshape(-1, len(ranges.value)), (2 * ranges.value)[:, None]).reshape(loss.weight.shape[:2])
    taps = fixed.like.taps[0] if fixed else _taps(weights, np.abs(out) * WIDER, decay, mode_input, radius, rounded_lags, given.least)
    late = rounded_lags[taps:].sum(0)
    # Of it, what is no rounding: a hold that takes y for straight between samples.
    m = plant.C.shape[0]
    off = [mul(T, plant.A) - mul(lin.state, T) - mul(lin.input[:, :m], plant.C), mul(T, plant.B) - mul(lin.input[:, :m], plant.D) - lin.input[:, m:]]
    into = mul(np.abs(off[0]), ranges.state[:, None]) + mul(np.abs(off[1]), ranges.input[:, None])
    held = _times(np.abs(F), into)[:, :, 0].sum(0)
    own = fixed.residual if fixed else 0.0  # a threshold rounds its sum
    bias = per_step.sum(0) + behind + row_sums(np.abs(passing.at_once)) + loss.into_r + loss.behind + late + own
    up: Callable[[Array], Array] = np.asarray if fixed else up32
    mode_decay = up(digits(decay * WIDER + 1e-9, 7))
    mode_output = np.abs(out) * WIDER * mode_decay ** (taps - 1)
    tail = mode_output @ (mode_input @ radius / (1 - mode_decay))
    steady = bias + (weights[:taps] * radius).sum((0, 2)) + tail
    starts = {name: np.abs(inverse @ T) @ x * WIDER for name, x in (("rest", ranges.initial), ("moving", ranges.state))}
    fast = mode_decay**taps < FAST
    settle = fixed.like.settle if fixed else 1 + next((k for k in range(SETTLE_MAX) if np.all(mode_decay[fast] ** k < GONE)), SETTLE_MAX)
    widen = DOUBLE if fixed else 1 + share32(roundings(taps * weights.shape[2], len(decay)))
    course = mode_decay[:, None] ** np.arange(settle)
    rows = {name: bias + ((np.abs(out) * WIDER * np.where(fast, x, 0.0)) @ course).T for name, x in starts.items()}
    # theta moves on once before it is first used, and its output counts it as taps - 1 samples older.
    before = {name: np.where(fast, 0.0, x / np.where(fast, 1.0, mode_decay) ** taps) for name, x in starts.items()}
    none = np.zeros(weights.shape[1])
    return ModalTables(
        weight=up(weights[:taps] * widen),
        taps=(taps,) * weights.shape[2],
        rest=up(rows["rest"] * widen),
        moving=up(rows["moving"] * widen),
        settle=settle,
        rest_left=none,
        moving_left=none,
        bias=up(np.maximum(rows["rest"][-1], rows["moving"][-1]) * widen),
        ready_rest=_ready(np.abs(out), mode_decay, starts["rest"], steady),
        ready_moving=_ready(np.abs(out), mode_decay, starts["moving"], steady),
        decay=none,
        tail=np.zeros(weights.shape[1:]),
        mode_decay=mode_decay,
        mode_input=up(digits(mode_input, 7) * widen),
        mode_output=up(digits(mode_output, 7) * widen),
        mode_rest=up(digits(before["rest"], 7) * widen),
        mode_moving=up(digits(before["moving"], 7) * widen),
        rounding=step.sum(0) + loss.into_r + loss.behind + late - held + own,
        steady_bias=bias,
        steady=steady,
    )


def roundings(taps: int, modes: int) -> int:
    """Of a number on its way into a radius: the lags of all signals together, the modes, then bias and theta."""
    return taps + modes + 16


def _taps(weights: Array, out: Array, decay: Array, into: Array, radius: Array, late: Array, least: int) -> int:
    """Fewest taps with which radii are hardly larger than with TAPS_MAX: two do where each estimate has one mode, whose bound is then exact.

    `late` (lags x rows): what the rounding of each lag adds if the modes bound it.
    """
    by_lag, behind = (weights * radius).sum(2), into @ radius / (1 - decay)
    summed, added = np.vstack([np.zeros(len(out)), by_lag.cumsum(0)]), late[::-1].cumsum(0)[::-1]

    def radii(t: int) -> Array:
        return np.asarray(summed[min(t, len(by_lag))] + out * decay ** (t - 1) @ behind + (added[t] if t < len(added) else 0.0))

    limit = radii(TAPS_MAX) + TAIL_SHARE * summed[-1]
    return next((t for t in range(max(least, 2), TAPS_MAX) if np.all(radii(t) <= limit)), TAPS_MAX)


def _ready(out: Array, decay: Array, start: Array, steady: Array) -> int:
    """Samples until the initial state is a small part of the radius."""
    k = np.arange(65535)
    left = (out * start) @ np.exp(np.minimum(np.log(np.maximum(decay, 1e-30))[:, None] * k, 0.0))
    large = np.flatnonzero(np.any(left >= READY_SHARE * (left + steady[:, None]), axis=0))
    return min(int(large[-1]) + 1, 65535) if len(large) else 0
