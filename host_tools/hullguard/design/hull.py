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

from hullguard.design.arith import digits, gamma32, mul, nearest32, powers, row_sums, share32, times, up32
from hullguard.design.observer import SubPlant
from hullguard.errors import InputError
from hullguard.model.table import Array

TAPS_MAX = 200
SMALLEST_DECAY = 1e-6  # of a generator that forgets all in finite time
SETTLE_MAX = 2000
LAGS_MAX = 400  # over which the growth of rounding is followed
TAIL_SHARE = 0.01  # of the threshold: what the bound of the lags behind the taps may add to them
LATE_SHARE = 0.7  # the same when all radii are as wide as after a frame that did not come
DECAYS = 40  # tried for a tail
DOUBLE = 1 + 1e-9  # more than what double precision loses
SLOWER = 1 - 1e-6  # a tail is made for a decay that much below the table's: rounding may take that much from it each sample
START_SHARE = 0.1  # of the threshold: what the bound of what is left of the initial state may add to it
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

    weight: Array  # most taps x residuals x width and derived; 0 behind a signal's taps
    taps: tuple[int, ...]  # width and derived
    rest: Array  # samples x residuals: bias after a start, its last row holds for good; the hull keeps the first `settle` of them
    moving: Array  # samples x residuals
    settle: int
    rest_left: Array  # residuals: what the tail is given for the initial state the sample before
    moving_left: Array  # residuals
    bias: Array  # residuals: from then on
    ready_rest: int
    ready_moving: int
    decay: Array  # residuals
    tail: Array  # residuals x width and derived
    rounding: Array  # residuals: the part of the bias that is rounding
    steady: Array  # residuals: threshold at the expected radii


@dataclass(frozen=True)
class Rounding:
    """What rounded tables and float32 arithmetic add to the hull: a constant, and a share that grows with the radii like the rest."""

    into_e: Array  # order: constant, each step
    into_r: Array  # residuals: constant, at once
    weight: Array  # lags x residuals x width
    behind: Array  # residuals: what later lags can add for radii as wide as the ranges


@dataclass(frozen=True)
class Fixed:
    """Fixed-point arithmetic: what a step of each number is, signal units."""

    state: Array  # order
    residual: Array  # residuals
    like: HullTables  # of the same generator in float32: same taps, decays and rows


def rounding_of(lin: Linear, T: Array, plant: SubPlant, ranges: Ranges, Bd: Array, more: Array, lags: int, fixed: Fixed | None = None, truth: Array | None = None) -> Rounding:
    """One step loses at most gamma (|G||z| + |E||v|), one residual gamma (|F||z| + |D||v|); |z| <= |T||x| + |e|, |v| <= |s| + radius.

    In fixed point sums are exact, and each loses half a step of its number in the end.

    `truth` (residuals x n): what the outputs of the generator stand for, in place of 0.

    `more` (order x derived): how radii enter e that come with no value; nothing is rounded where they enter, only what they do to e later.
    """
    s, width = lin.input.shape
    m = plant.C.shape[0]
    gamma = 0.0 if fixed else gamma32(s + width + 2)
    x, u, v = ranges.state[:, None], ranges.input[:, None], ranges.value[:, None]
    widest = np.concatenate([2 * ranges.value, ranges.derived])[:, None]
    G, E, F, D = np.abs(lin.state), np.abs(lin.input), np.abs(lin.output), np.abs(lin.direct)
    Ly, Lu, Dy, Du = lin.input[:, :m], lin.input[:, m:], lin.direct[:, :m], lin.direct[:, m:]
    P = powers(np.eye(s), lin.state, lags)
    # Of |e|, the part that does not depend on radii: any initial state of the range, and the disturbances.
    e = mul(np.abs(mul(P, T)), x).max(0) + row_sums(np.abs(mul(P, Bd))).sum(0)[:, None]
    z = mul(np.abs(T), x) + e
    into_e = mul(np.abs(mul(T, plant.A) - mul(lin.state, T) - mul(Ly, plant.C)), x) + mul(np.abs(mul(T, plant.B) - mul(Ly, plant.D) - Lu), u)
    meant = truth if truth is not None else np.zeros((lin.output.shape[0], T.shape[1]))
    into_r = mul(np.abs(mul(lin.output, T) + mul(Dy, plant.C) - meant), x) + mul(np.abs(mul(Dy, plant.D) + Du), u)
    into_e += gamma * (mul(G, z) + mul(E, v))
    into_r += gamma * (mul(F, z) + mul(D, v))
    if fixed:
        into_e += fixed.state[:, None] / 2 * DOUBLE
        into_r += fixed.residual[:, None] / 2 * DOUBLE
        return Rounding(into_e[:, 0], into_r[:, 0], np.zeros((1, F.shape[0], width + more.shape[1])), np.zeros(F.shape[0]))
    # The part that does: |e(k)| <= sum over j of |G^j E| radius(k-1-j), and the value's own radius.
    none = np.zeros((s, more.shape[1]))
    into_z = np.abs(mul(P, np.hstack([lin.input, more])))
    per_step = np.concatenate([np.hstack([E, none])[None], mul(G, into_z)])[:lags]
    FP = np.abs(mul(lin.output, P))
    weight = np.zeros((lags + 1, F.shape[0], width + more.shape[1]))
    weight[0, :, :width] = D
    weight[1:] = mul(F, into_z)
    weight[1:] += _through(FP, per_step) if lags > LAGS_MAX else _lag_by_lag(FP, per_step)
    return Rounding(into_e[:, 0], into_r[:, 0], gamma * weight, gamma * mul(weight[-1], widest)[:, 0] * lags)


def _lag_by_lag(answer: Array, step: Array) -> Array:
    """Sum over i of answer(i) step(lag - i): lags x residuals x width."""
    out = np.zeros((len(step), answer.shape[1], step.shape[2]))
    for i in range(len(step)):
        for r in range(answer.shape[1]):
            out[i:, r] += (answer[i, r][None, :, None] * step[: len(step) - i]).sum(1)
    return out


def _through(answer: Array, step: Array) -> Array:
    """The same over many lags, by transforms; few digits, rounded up by more than these lose, are the same on every processor."""
    size = 2 * len(step)
    both = np.einsum("frs,fsw->frw", np.fft.rfft(answer, size, 0), np.fft.rfft(step, size, 0))
    found = np.abs(np.fft.irfft(both, size, 0)[: len(step)])
    return digits(found + 1e-9 * found.max((0, 2), keepdims=True), 6) * (1 + 1e-5)


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


@dataclass(frozen=True)
class Envelope:
    """How impulse responses shrink, for every number of taps and several decays: |h_ig(taps + j)| <= cover decay_i^j for all j >= 0."""

    decay: Array  # residuals x decays, as the tables will have them
    cover: Array  # taps x residuals x signals x decays
    behind: Array  # taps x residuals x signals: sum of |h_ig(j)|, j >= taps

    def excess(self, taps: Array, radius: Array) -> Array:
        """What the tail adds beyond the sum that it bounds, with these radii always (residuals x decays)."""
        g = np.arange(len(taps))
        cover, behind = self.cover[taps, :, g], self.behind[taps, :, g]
        return np.asarray(((cover / (1 - self.decay) - behind[:, :, None]) * radius[:, None, None]).sum(0))


def _decays(slowest: Tail, residuals: int) -> Array:
    """What a tail may shrink by (residuals x decays)."""
    return np.tile(up32(digits(slowest.decay + (1 - slowest.decay) * np.linspace(0.002, 0.9, DECAYS), 7)), (residuals, 1))


def _envelope(weights: Array, slowest: Tail, most: int, kept: Array) -> Envelope:
    """`weights` (lags x residuals x signals): all of |h| but what `slowest` bounds; `kept`: the decays."""
    length = len(weights)
    grid = kept[:, None, :] * SLOWER
    if grid.min() < slowest.decay:
        raise InputError("the generator decays too slowly for a threshold: choose poles further inside the unit circle")
    cover = (slowest.output(length)[:, None] * slowest.input)[:, :, None] * np.ones(kept.shape[1])
    behind = cover[:, :, 0] / (1 - slowest.decay)
    covers, sums = np.zeros((most + 1, *cover.shape)), np.zeros((most + 1, *behind.shape))
    for lag in range(length - 1, -1, -1):
        cover = np.maximum(weights[lag][:, :, None], cover / grid)
        behind = behind + weights[lag]
        if lag <= most:
            covers[lag], sums[lag] = cover, behind
    return Envelope(kept, covers, sums)


def _taps(envelope: Envelope, limits: tuple[tuple[Array, Array], ...], least: Array, most: int) -> Array:
    """Few taps behind which no tail adds more than it may: `limits` are radii, and what may be added (residuals) with them.

    From as many for each signal as are enough, one is taken where it hurts least, until none can be.
    """

    def worst(taps: Array) -> float:
        parts = [envelope.excess(taps, radius) / limit[:, None] for radius, limit in limits]
        return float(np.max(parts, axis=0).min(1).max())

    taps = next((t for n in range(most) if worst(t := np.maximum(least, n)) <= 1), np.full(len(least), most))
    spare = set(range(len(taps)))
    while spare:
        costs = {}
        for g in sorted(spare):
            fewer = taps - (np.arange(len(taps)) == g)
            costs[g] = worst(fewer) if fewer[g] >= least[g] else np.inf
        spare = {g for g in spare if costs[g] <= 1}
        if spare:
            taps = taps - (np.arange(len(taps)) == min(spare, key=lambda g: costs[g]))
    return taps


@dataclass(frozen=True)
class Start:
    """What the initial state adds to a threshold after a start (samples x residuals), and a bound for the sample after the last."""

    added: Array
    end: Array  # residuals

    def later(self) -> Array:
        """The most that it adds from each sample on."""
        return np.asarray(np.maximum.accumulate(np.vstack([self.added, self.end])[::-1])[::-1])

    def forgotten(self, driven: Array, limit: Array, steady: Array) -> int:
        """The sample from which on the bias is nearly `limit`."""
        later, last = self.later(), min(SETTLE_MAX, len(self.added) - 1)
        return next((k for k in range(1, last) if np.all(later[k] + limit - driven[k] <= BIAS_SHARE * steady)), last)

    def rows(self, driven: Array, limit: Array, last: int) -> Array:
        """The bias, sample by sample; the last row holds for good."""
        table = np.asarray(driven[: last + 1] + self.added[: last + 1])
        table[last] = limit + self.later()[last]
        return table

    def left(self, driven: Array, limit: Array, decay: Array) -> Array:
        """What a tail must begin with at each sample, if the bias is `limit` from there on (samples x residuals)."""
        above = np.maximum(self.added + driven - limit, 0.0)
        left = np.vstack([above, self.end])
        for k in range(len(above) - 1, -1, -1):
            left[k] = np.maximum(above[k], left[k + 1] / decay)
        return left

    def settled(self, driven: Array, limit: Array, steady: Array, decay: Array) -> int:
        """From which sample on the tail that takes over adds little."""
        left, above = self.left(driven, limit, decay), np.maximum(self.added + driven - limit, 0.0)
        last = min(SETTLE_MAX, len(above) - 1)
        for k in range(1, last):
            tail = left[k] * decay ** np.arange(len(above) - k)[:, None]
            if np.all(tail - above[k:] <= START_SHARE * (steady + above[k:])):
                return k
        return last


@dataclass(frozen=True)
class Expected:
    """Radii of a generator's signals (width and derived)."""

    usual: Array  # most of the time
    late: Array  # one sample after a frame that did not come
    rewind: tuple[int, ...]  # how far back one may still be rewritten, samples


def _start(lin: Linear, T: Array, F: Array, x: Array) -> Start:
    """From anywhere in |x(0)| <= x."""
    added = times(np.abs(mul(F, T)), x)
    bound = _tail(lin, T)
    return Start(added, bound.output(len(F) + 1) * float((bound.input * x).sum()))


@dataclass(frozen=True)
class Given:
    """What the tables of one generator follow from, besides its matrices."""

    T: Array
    plant: SubPlant
    ranges: Ranges
    expected: Expected
    derived: Array  # n x derived signals: how those disturb the state that have a radius only


def roundings(taps: int, width: int) -> int:
    """Of a number on its way into a threshold: as many products are added up as there are lags of all signals together, then tails, bias and theta."""
    return taps + 2 * width + 16


def build(lin: Linear, given: Given, where: str, fixed: Fixed | None = None) -> HullTables:
    """All tables of one generator, rounded up to float32; for fixed point not yet rounded."""
    T, plant, ranges, expected = given.T, given.plant, given.ranges, given.expected
    spectral = float(np.abs(np.linalg.eigvals(lin.state)).max())
    if spectral >= 1.0 - 1e-6:
        raise InputError(f"{where}: a pole of the fused observer has magnitude {spectral:.6f}; poles must be inside the unit circle")
    length = max(64, int(np.ceil(np.log(1e-12) / np.log(max(spectral, 0.05)))))
    if length > 20_000:
        raise InputError(f"{where}: a pole of magnitude {spectral:.6f} is too slow for a threshold; choose poles further inside the unit circle")
    m, radius = plant.C.shape[0], expected.usual
    F = powers(lin.output, lin.state, length)
    more = mul(T, given.derived)
    entering = np.hstack([lin.input, more])
    at_lag_0 = np.hstack([lin.direct, np.zeros((F.shape[1], more.shape[1]))])
    response = np.concatenate([np.abs(at_lag_0)[None], np.abs(mul(F, entering))])
    Bd = mul(T, plant.Ed) - mul(lin.input[:, :m], plant.Fd)
    Dd = mul(lin.direct[:, :m], plant.Fd)
    loss = rounding_of(lin, T, plant, ranges, Bd, more, min(length, LAGS_MAX), fixed)
    lags = loss.weight.shape[0]
    weights = response.copy()
    weights[:lags] += loss.weight
    steps = times(np.abs(F), loss.into_e)
    driven = (row_sums(np.abs(mul(F, Bd))) + steps).cumsum(0)
    at_once = row_sums(np.abs(Dd)) + loss.into_r
    rounding = steps.sum(0) + loss.into_r + loss.behind
    rest, moving = (_start(lin, T, F, x) for x in (ranges.initial, ranges.state))

    share = (weights * radius).sum(2)
    most = min(TAPS_MAX, length)
    slowest = _tail(lin, entering)
    envelope = _envelope(response, slowest, most, fixed.like.decay[:, None] if fixed else _decays(slowest, F.shape[1]))
    usual, late = driven[-1] + at_once + share.sum(0), driven[-1] + at_once + (weights * expected.late).sum((0, 2))
    limits = (radius, TAIL_SHARE * usual), (expected.late, LATE_SHARE * late)
    taps = np.array(fixed.like.taps) if fixed else _taps(envelope, limits, np.array(expected.rewind), most)
    chosen = np.max([envelope.excess(taps, r) / limit[:, None] for r, limit in limits], axis=0).argmin(1)
    one = np.arange(len(chosen))
    decay = envelope.decay[one, chosen]
    # What rounding adds to the lags behind the taps is no impulse response: it goes into the constant, with radii as wide as the ranges.
    widest = np.concatenate([2 * ranges.value, ranges.derived])
    behind = np.array([loss.weight[t:, :, g].sum(0) for g, t in enumerate(taps)]).T
    late = times(behind, widest)
    at_once, rounding = at_once + loss.behind + late, rounding + late
    if fixed:  # a threshold rounds its sum, and a tail two products a sample
        own = fixed.residual * (1 + 1 / (1 - decay))
        at_once, rounding = at_once + own, rounding + own
    limit = (driven[-1] + at_once) * (1 + 1e-9)
    driven = np.concatenate([np.zeros((1, F.shape[1])), driven[:-1]]) + at_once
    steady = limit + share.sum(0)
    used = np.where(np.arange(max(taps.max(), 1))[:, None, None] < taps, weights[: max(taps.max(), 1)], 0.0)
    widen = DOUBLE if fixed else 1 + share32(roundings(int(taps.sum()), weights.shape[2]))
    up: Callable[[Array], Array] = np.asarray if fixed else up32
    slow = decay * SLOWER
    settle = fixed.like.settle if fixed else max(start.settled(driven, limit, steady, slow) for start in (rest, moving))
    last = max(moving.forgotten(driven, limit, steady), settle)
    return HullTables(
        weight=up(used * widen),
        taps=tuple(int(t) for t in taps),
        rest=up(rest.rows(driven, limit, last) * widen),
        moving=up(moving.rows(driven, limit, last) * widen),
        settle=settle,
        rest_left=up(rest.left(driven, limit, slow)[settle] / slow * widen),
        moving_left=up(moving.left(driven, limit, slow)[settle] / slow * widen),
        bias=up(limit * widen),
        ready_rest=_ready(rest.added, steady),
        ready_moving=_ready(moving.added, steady),
        decay=decay,
        tail=up(digits(envelope.cover[taps, :, np.arange(len(taps))][:, one, chosen].T, 7) * (widen + 1e-6)),
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
