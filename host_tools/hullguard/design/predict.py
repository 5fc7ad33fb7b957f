"""Tables of the prediction between frames; platoon, section 7, end, and predict.h.

With the rounded tables Ar, Br, Cr, S, the error e = x - x^ of the open-loop copy is

    at a frame   e <- (I - S Cr) e - S (Fd d + ey) + rounding          always   e <- Ar e + (A - Ar) x + (B - Br) u + Br eu + Ed d + w + rounding

It is followed in two parts, h = (I - S Cr) e that frames do not correct, and what they do. Both are bounded by magnitudes: h in each sample
whatever the frames, the other by the samples since the last one. y - y^ = Cr e + (C - Cr) x + Fd d.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hullguard.design.arith import gamma32, mul, nearest32, row_sums, times, up32
from hullguard.design.tables import GroupTable, PredictTable, rows
from hullguard.errors import InputError
from hullguard.model.plant import Plant
from hullguard.model.schema import Model
from hullguard.model.table import Array

SETTLED = 0.02  # of the steady bound of what frames do not correct: what the start may still add to it
SETTLE_MAX = 5000
EXACT = 1e30  # radius below which the stand-in input of a plant without inputs counts as known


@dataclass(frozen=True)
class Bounds:
    """Largest magnitudes in operation."""

    state: Array  # n: |x|
    input: Array  # p: |u|
    mismatch: Array  # n: what an uncertain plant adds to x in one sample


def predicted_groups(model: Model) -> list[int]:
    """Groups whose signals are worth predicting: outputs, sent by events."""
    outputs = set(model.outputs)
    return [i for i, g in enumerate(model.groups) if g.trigger.interval_max > 1 and g.signals and set(g.signals) <= outputs]


def predict_table(model: Model, index: int, groups: tuple[GroupTable, ...], bounds: Bounds) -> PredictTable:
    """The table of one group."""
    group, table, plant = model.groups[index], groups[index], model.plant
    at = [model.outputs.index(i) for i in group.signals]
    C, D, Fd = plant.C[at], plant.D[at], plant.Fd[at]
    if D.any():
        where = f"{model.path.name}: detector.prediction: group '{group.name}'"
        raise InputError(f"{where} sees inputs at once (D is not 0), which a frame's values alone cannot tell apart; remove it")
    S = nearest32(mul(C.T, _inverse(mul(C, C.T))))
    half = np.array([s.half for s in table.signals])
    known = np.array([_half_of(groups, i) for i in model.inputs])
    rounded = _Rounded(plant, C, Fd, S, nearest32(plant.A), nearest32(plant.B), nearest32(C), half, known, bounds)
    settle, hidden = _hidden(rounded, table.interval_max + table.margin)
    if settle is None:
        where = f"{model.path.name}: detector.prediction: what group '{group.name}' does not see of the plant"
        raise InputError(f"{where} is not stable, and no prediction forgets how it began; remove it")
    B, places, limits = rounded.B, tuple(model.inputs), known
    if plant.p == 0:
        B, places, limits = np.zeros((plant.n, 1)), (0,), np.array([EXACT])  # the library wants an input: any signal will do, with weight 0
    return PredictTable(
        group=index,
        first=table.first,
        input=places,
        known=tuple(limits.tolist()),
        correct=rows(S),
        state=rows(rounded.A),
        drive=rows(B),
        output=rows(rounded.Cr),
        direct=rows(np.zeros((len(at), B.shape[1]))),
        fresh=tuple(half.tolist()),
        radius=rows(up32(_radii(rounded, hidden, table.interval_max + table.margin))),
        settle=settle,
    )


def _half_of(groups: tuple[GroupTable, ...], place: int) -> float:
    """Radius of a signal that has just arrived."""
    return next(g.signals[place - g.first].half for g in groups if g.first <= place < g.first + len(g.signals))


def _inverse(M: Array) -> Array:
    """Of a small positive definite matrix, by elimination in a stated order."""
    n = M.shape[0]
    work = np.hstack([M.copy(), np.eye(n)])
    for i in range(n):
        work[i] /= work[i, i]
        for k in range(n):
            if k != i:
                work[k] -= work[k, i] * work[i]
    return work[:, n:]


@dataclass(frozen=True)
class _Rounded:
    """The tables, and what disturbs their error."""

    plant: Plant
    C: Array
    Fd: Array
    S: Array
    A: Array
    B: Array
    Cr: Array
    half: Array
    known: Array
    bounds: Bounds

    @property
    def unseen(self) -> Array:
        """I - S Cr."""
        return np.eye(self.plant.n) - mul(self.S, self.Cr)

    def entering(self, e: Array) -> Array:
        """Columns that enter e in one sample, each with its bound taken in; `e` (n) bounds |e|, for the rounding."""
        plant, b = self.plant, self.bounds
        gamma = self.gamma
        X, U = b.state[:, None], b.input[:, None]
        each = mul(np.abs(plant.A - self.A), X) + mul(np.abs(plant.B - self.B), U) + mul(np.abs(self.B), self.known[:, None])
        each += gamma * (mul(np.abs(self.A), X + e[:, None]) + mul(np.abs(self.B), U))
        return np.hstack([plant.Ed, np.diag(each[:, 0] + b.mismatch)])

    def correcting(self, e: Array) -> Array:
        """The same of a frame: noise, quantisation, rounding."""
        y = times(np.abs(self.C), self.bounds.state) + row_sums(np.abs(self.Fd)) + self.half
        off = times(np.abs(self.Cr - self.C), self.bounds.state) + self.gamma * (2 * y + times(np.abs(self.Cr), e))
        innovation = times(np.abs(self.Cr), e) + y
        rounding = self.gamma * (times(np.abs(self.S), innovation) + self.bounds.state + e)
        return np.hstack([mul(self.S, self.Fd), self.S * (self.half + off), np.diag(rounding)])

    @property
    def gamma(self) -> float:
        """Relative rounding of a sum as long as the longest row."""
        return gamma32(self.plant.n + self.plant.p + len(self.half) + 4)


def _hidden(t: _Rounded, horizon: int) -> tuple[int | None, Array]:
    """Samples until the start is forgotten, and from then on the bound of h (n); None where it is not.

    Sample by sample, whatever the frames: `hidden` bounds |h|, row j of `seen` bounds |S Cr e| j samples after the last frame.
    """
    P, Q = t.unseen, mul(t.S, t.Cr)
    QA = np.abs(mul(Q, t.A))
    PAP, PAQ = np.abs(mul(mul(P, t.A), P)), np.abs(mul(mul(P, t.A), Q))
    X = t.bounds.state
    hidden, seen = times(np.abs(P), X), np.tile(times(np.abs(Q), X), (horizon + 1, 1))
    trail = [hidden]
    for _ in range(SETTLE_MAX):
        e = hidden + seen.max(0)
        entering, correcting = t.entering(e), row_sums(np.abs(t.correcting(e)))
        # A frame leaves h as it is but for S's own rounding: P S is not quite 0.
        kept = hidden + times(np.abs(P), correcting) + times(np.abs(mul(P, Q)), seen.max(0))
        fresh = times(np.abs(Q), correcting) + times(np.abs(mul(Q, P)), hidden)
        seen[0] = fresh
        seen[1:] = np.array([times(QA, kept + s) for s in seen[:-1]]) + row_sums(np.abs(mul(Q, entering)))
        hidden = times(PAP, kept) + times(PAQ, seen.max(0)) + row_sums(np.abs(mul(P, entering)))
        trail.append(hidden)
        if not np.all(np.isfinite(hidden)) or hidden.max() > 1e6 * max(1.0, float(X.max())):
            return None, hidden
        if len(trail) > 2 * horizon and np.all(np.abs(trail[-1] - trail[-2]) <= 1e-9 * (1e-12 + trail[-1])):
            break
    else:
        return None, hidden
    limit = trail[-1] * (1 + SETTLED)
    return next(k for k in range(len(trail)) if all(np.all(h <= limit + 1e-12) for h in trail[k:])), limit


def _radii(t: _Rounded, hidden: Array, horizon: int) -> Array:
    """|y(k_i + j) - y^| for j = 1 .. horizon; horizon x width."""
    X = t.bounds.state
    e = hidden + row_sums(np.abs(t.correcting(hidden)))  # after a frame, for the rounding only; it grows from here on
    for _ in range(horizon):
        e = np.maximum(e, times(np.abs(t.A), e) + row_sums(np.abs(t.entering(e))))
    start, entering = np.hstack([np.diag(hidden), t.correcting(e)]), t.entering(e)
    at_once = times(np.abs(t.C - t.Cr), X) + row_sums(np.abs(t.Fd)) + t.gamma * times(np.abs(t.Cr), X + e)
    through, steps, out = t.Cr, np.zeros(t.Cr.shape[0]), []
    for _ in range(horizon):
        steps = steps + row_sums(np.abs(mul(through, entering)))
        through = mul(through, t.A)
        out.append(row_sums(np.abs(mul(through, start))) + steps + at_once)
    return np.array(out) * (1 + 1e-9)
