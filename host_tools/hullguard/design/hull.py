"""Tables of the exact interval hull; platoon, sections 6 and 8.

With the rounded tables z(k+1) = Gr z + Er v, r = Fr z + Dr v, v = [y + ey; u + eu], and e = T x - z:

    e(k+1) = Gr e + Bd d - Er ev + (mismatch of the rounded tables) + (rounding of one step)
    r      = -Fr e + Dd d + Dr ev + (mismatch) + (rounding)         Bd = T Ed - Ly Fd,  Dd = Dy Fd

Every bound is rounded up to float32 and widened by what adding it up in float32 can lose.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hullguard.design.arith import U32, digits, mul, nearest32, powers, row_sums, up32
from hullguard.design.observer import SubPlant
from hullguard.errors import InputError
from hullguard.model.table import Array

TAPS_MAX = 200
SMALLEST_DECAY = 1e-6  # of a generator that forgets all in finite time
SETTLE_MAX = 2000
LAGS_MAX = 400  # over which the growth of rounding is followed
TAIL_SHARE = 0.005  # of the threshold: what the bound of the lags behind the taps may add
BIAS_SHARE = 0.001  # of the threshold: what the last row of the bias tables may be above its limit
READY_SHARE = 0.10  # of the threshold: what the initial state may still be when a detector is no longer starting


@dataclass(frozen=True)
class Linear:
    """A generator as the ECU runs it: float32 numbers, signals ordered [y; u]."""

    state: Array
    input: Array
    output: Array
    direct: Array


@dataclass(frozen=True)
class Ranges:
    """Largest magnitudes that the generator can meet."""

    initial: Array  # n: |x(0)| at a start at rest
    state: Array  # n: |x|
    value: Array  # signals: |v|
    input: Array  # p: |u|
    derived: Array  # derived signals: their radius


@dataclass(frozen=True)
class HullTables:
    """What hg_hull_config holds; weights in the order of [y; u], then of the derived signals that have a radius only."""

    weight: Array  # taps x residuals x width and derived
    rest: Array  # settle x residuals
    moving: Array  # settle x residuals
    ready_rest: int
    ready_moving: int
    decay: float
    tail_input: Array  # width and derived
    tail_output: Array  # residuals
    rounding: Array  # residuals: the part of the bias that is rounding
    steady: Array  # residuals: threshold at the expected radii


@dataclass(frozen=True)
class Rounding:
    """What rounded tables and float32 arithmetic add to the hull: a constant, and a share that grows with the radii like the rest."""

    into_e: Array  # order: constant, each step
    into_r: Array  # residuals: constant, at once
    weight: Array  # lags x residuals x width
    behind: Array  # residuals: what later lags can add for radii as wide as the ranges


def rounding_of(lin: Linear, T: Array, plant: SubPlant, ranges: Ranges, Bd: Array, more: Array, lags: int) -> Rounding:
    """One step loses at most gamma (|G||z| + |E||v|), one residual gamma (|F||z| + |D||v|); |z| <= |T||x| + |e|, |v| <= |s| + radius.

    `more` (order x derived): how radii enter e that come with no value; nothing is rounded where they enter, only what they do to e later.
    """
    s, width = lin.input.shape
    m = plant.C.shape[0]
    gamma = (s + width + 2) * U32 / (1 - (s + width + 2) * U32)
    x, u, v = ranges.state[:, None], ranges.input[:, None], ranges.value[:, None]
    widest = np.concatenate([2 * ranges.value, ranges.derived])[:, None]
    G, E, F, D = np.abs(lin.state), np.abs(lin.input), np.abs(lin.output), np.abs(lin.direct)
    Ly, Lu, Dy, Du = lin.input[:, :m], lin.input[:, m:], lin.direct[:, :m], lin.direct[:, m:]
    P = powers(np.eye(s), lin.state, lags)
    # Of |e|, the part that does not depend on radii: any initial state of the range, and the disturbances.
    e = np.array([mul(np.abs(mul(p, T)), x) for p in P]).max(0) + np.array([row_sums(np.abs(mul(p, Bd))) for p in P]).sum(0)[:, None]
    z = mul(np.abs(T), x) + e
    into_e = mul(np.abs(mul(T, plant.A) - mul(lin.state, T) - mul(Ly, plant.C)), x) + mul(np.abs(mul(T, plant.B) - mul(Ly, plant.D) - Lu), u)
    into_r = mul(np.abs(mul(lin.output, T) + mul(Dy, plant.C)), x) + mul(np.abs(mul(Dy, plant.D) + Du), u)
    into_e += gamma * (mul(G, z) + mul(E, v))
    into_r += gamma * (mul(F, z) + mul(D, v))
    # The part that does: |e(k)| <= sum over j of |G^j E| radius(k-1-j), and the value's own radius.
    none = np.zeros((s, more.shape[1]))
    into_z = np.array([np.abs(np.hstack([mul(p, lin.input), mul(p, more)])) for p in P])
    per_step = np.concatenate([np.hstack([E, none])[None], np.array([mul(G, w) for w in into_z])])[:lags]
    FP = np.array([np.abs(mul(lin.output, p)) for p in P])
    weight = np.zeros((lags + 1, F.shape[0], width + more.shape[1]))
    weight[0, :, :width] = D
    weight[1:] = np.array([mul(F, w) for w in into_z])
    for i in range(lags):
        for r in range(F.shape[0]):
            weight[1 + i :, r] += (FP[i, r][None, :, None] * per_step[: lags - i]).sum(1)
    return Rounding(into_e[:, 0], into_r[:, 0], gamma * weight, gamma * mul(weight[-1], widest)[:, 0] * lags)


@dataclass(frozen=True)
class Tail:
    """|F G^(j-1) E| <= output(taps) decay^(j-taps) input for all j >= taps, for every number of taps."""

    decay: float
    input: Array  # width
    output: Callable[[int], Array]  # taps -> residuals


def _tail(lin: Linear, entering: Array) -> Tail:
    """The bound of what lies behind the taps: by eigenvectors where there are enough of them, else by a power of G that contracts.

    `entering` (order x signals) is how the radii enter e.
    """
    values, vectors = np.linalg.eig(lin.state)
    # A double eigenvalue can come with columns that are no eigenvectors and yet do not look singular: both are checked.
    off = np.abs(lin.state @ vectors - vectors * values).max()
    if np.linalg.cond(vectors) < 1e6 and off < 1e-12 * (1 + np.abs(lin.state).max()):
        into = np.abs(np.linalg.solve(vectors, entering.astype(complex))).max(0)
        out = np.abs(lin.output @ vectors)
        return _rounded_tail(float(np.abs(values).max()), into, lambda taps: np.asarray(out @ np.abs(values) ** (taps - 1)))
    # With |G^q| = c < 1 every row of F G^(i + q n) is at most |F G^i| c^n.
    q = next((2**n for n in range(12) if np.abs(np.linalg.matrix_power(lin.state, 2**n)).sum(1).max() < 0.9), None)
    if q is None:
        raise InputError("the generator decays too slowly for a threshold: choose poles further inside the unit circle")
    decay = max(float(np.abs(np.linalg.matrix_power(lin.state, q)).sum(1).max()) ** (1 / q), SMALLEST_DECAY)

    def rows(taps: int) -> Array:
        F = powers(mul(lin.output, np.linalg.matrix_power(lin.state, taps - 1)), lin.state, q)
        return np.asarray((np.abs(F).sum(2) * (decay ** -np.arange(q))[:, None]).max(0))

    return _rounded_tail(decay, np.abs(entering).max(0), rows)


def _rounded_tail(decay: float, into: Array, out: Callable[[int], Array]) -> Tail:
    """Rounded up by more than eigenvectors and float32 can be off; few digits make the result the same on every processor."""
    wider = 1 + 1e-6
    kept = float(up32(digits(np.array(min(max(decay, SMALLEST_DECAY) * wider + 1e-9, 1 - 1e-7)), 7)))
    return Tail(kept, up32(digits(into * wider, 7)), lambda taps: digits(out(taps) * wider, 7))


def _taps(share: Array, constant: Array, tail: Tail, radius: Array, least: int) -> int:
    """Fewest taps behind which the bound of the tail is a small part of the threshold at the usual radii. `share`: lags x residuals."""
    limit = TAIL_SHARE * (constant + share.sum(0))
    bound = float(tail.input @ radius) / (1 - tail.decay)
    for taps in range(least, TAPS_MAX):
        if np.all(tail.output(taps) * bound <= limit):
            return taps
    return TAPS_MAX


def build(lin: Linear, T: Array, plant: SubPlant, ranges: Ranges, radius: Array, interval_max: int, where: str, derived: Array | None = None) -> HullTables:
    """All tables of one generator. `radius` (width and derived) is what the radii usually are.

    `derived` (n x derived signals): how derived signals that have a radius only disturb the state.
    """
    spectral = float(np.abs(np.linalg.eigvals(lin.state)).max())
    if spectral >= 1.0 - 1e-6:
        raise InputError(f"{where}: a pole of the fused observer has magnitude {spectral:.6f}; poles must be inside the unit circle")
    length = max(64, int(np.ceil(np.log(1e-12) / np.log(max(spectral, 0.05)))))
    if length > 20_000:
        raise InputError(f"{where}: a pole of magnitude {spectral:.6f} is too slow for a threshold; choose poles further inside the unit circle")
    m = plant.C.shape[0]
    F = powers(lin.output, lin.state, length)
    more = mul(T, derived) if derived is not None else np.zeros((lin.state.shape[0], 0))
    entering = np.hstack([lin.input, more])
    at_lag_0 = np.hstack([lin.direct, np.zeros((F.shape[1], more.shape[1]))])
    weights = np.concatenate([np.abs(at_lag_0)[None], np.abs(np.array([mul(f, entering) for f in F]))])
    Bd = mul(T, plant.Ed) - mul(lin.input[:, :m], plant.Fd)
    Dd = mul(lin.direct[:, :m], plant.Fd)
    loss = rounding_of(lin, T, plant, ranges, Bd, more, min(length, LAGS_MAX))
    lags = loss.weight.shape[0]
    weights[:lags] += loss.weight
    steps = np.array([mul(np.abs(f), loss.into_e[:, None])[:, 0] for f in F])
    driven = (np.array([row_sums(np.abs(mul(f, Bd))) for f in F]) + steps).cumsum(0)
    at_once = row_sums(np.abs(Dd)) + loss.into_r
    rounding = steps.sum(0) + loss.into_r + loss.behind
    initial = np.array([mul(np.abs(mul(f, T)), ranges.initial[:, None])[:, 0] for f in F])
    moving = np.array([mul(np.abs(mul(f, T)), ranges.state[:, None])[:, 0] for f in F])

    share = (weights * radius).sum(2)
    # What rounding adds to the lags behind the taps is no impulse response: it goes into the constant, with radii as wide as the ranges.
    tail = _tail(lin, entering)
    taps = _taps(share, driven[-1], tail, radius, max(interval_max, 2))
    at_once = at_once + loss.behind + mul(loss.weight[taps:].sum(0), np.concatenate([2 * ranges.value, ranges.derived])[:, None])[:, 0]
    driven = np.concatenate([np.zeros((1, F.shape[1])), driven]) + at_once
    steady = driven[-1] + share.sum(0)
    limit = driven[-1] * (1 + 1e-9)
    later = np.maximum.accumulate(moving[::-1])[::-1]
    settle = next((k for k in range(1, min(SETTLE_MAX, length - 1)) if np.all(later[k] + limit - driven[k] <= BIAS_SHARE * steady)), min(SETTLE_MAX, length - 1))
    later_rest = np.maximum.accumulate(initial[::-1])[::-1]
    rest_rows = driven[: settle + 1] + initial[: settle + 1]
    moving_rows = driven[: settle + 1] + moving[: settle + 1]
    rest_rows[settle], moving_rows[settle] = limit + later_rest[settle], limit + later[settle]
    widen = 1 + (taps * weights.shape[2] + 16) * U32 * 1.01
    return HullTables(
        weight=up32(weights[:taps] * widen),
        rest=up32(rest_rows * widen),
        moving=up32(moving_rows * widen),
        ready_rest=_ready(initial, steady),
        ready_moving=_ready(moving, steady),
        decay=tail.decay,
        tail_input=tail.input,
        tail_output=up32(tail.output(taps) * widen),
        rounding=rounding,
        steady=steady,
    )


def _ready(initial: Array, steady: Array) -> int:
    """Samples until the initial state is a small part of the threshold."""
    large = np.flatnonzero(np.any(initial >= READY_SHARE * (initial + steady), axis=1))
    return min(int(large[-1]) + 1, 65535) if len(large) else 0


def rounded(state: Array, inputs: Array, output: Array, direct: Array) -> Linear:
    """The matrices as float32 holds them."""
    return Linear(nearest32(state), nearest32(inputs), nearest32(output), nearest32(direct))
