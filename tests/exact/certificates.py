"""Banks of certificates in rational numbers: r and J of each over the window that the library has, and the least J that is sound, from the plant itself.

    r_c = sum w_c value        J_exact = sum |w_c| radius + the most that disturbances, any state of the range and inputs do to sum w_c (y, u)

The last by running the plant backwards from each certificate (the adjoint): what tables of floats leave of states and inputs is counted as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dyadic import Exact, exact, joined, zeros
from healthy import matrices
from hullguard.design.arith import U32
from hullguard.design.design import Design, used_banks
from hullguard.design.reach import largest
from hullguard.design.tables import Tables

WIDENED = 1e-4  # more than sums of some hundred numbers are widened by in float32


@dataclass(frozen=True)
class Judged:
    """One certificate at one sample."""

    r: Exact  # of length 1
    J: Exact  # of length 1: the least that is sound
    rounding: float  # that r may be off
    above: float  # that J may be above


class Bank:
    """One bank of a detector. `tables` are those of the library, in fixed point other ones than the design's."""

    def __init__(self, made: Design, tables: Tables, number: int) -> None:
        table = tables.banks[number]
        self.window, self._signal = table.window, list(table.signal)
        unit = tables.units[tables.width + tables.residuals - len(tables.banks) + number] if tables.units else 0
        own = [tables.units[g] for g in self._signal] if tables.units else [0] * len(self._signal)
        # window x signals x certificates, in the signals' own units.
        self._weight = [[exact(row).scaled(table.exponent + unit - g) for row, g in zip(lag, own, strict=True)] for lag in table.weight]
        self._places = len(table.bias)
        # A bank of a hypothesis holds for states and signals that its fault has moved as well.
        self._whole = used_banks(made.model, made.stored)[number].hypothesis is None
        self._least = self._undisturbed(made)
        size = np.array([[np.abs(row.floats()) for row in lag] for lag in self._weight])
        values = np.array([max(abs(s.low), abs(s.high)) for s in made.model.signals])[self._signal]
        terms = self.window * (len(made.model.signals) + made.model.plant.n) + 4
        self._lost = 2 * terms * U32 * np.einsum("wsc,s->c", size, values) + (2.0 ** (unit - 30) if tables.units else 0.0)

    def _undisturbed(self, made: Design) -> Exact:
        """What is in J without any radius."""
        m, model = matrices(made), made.model
        state = exact(np.where(np.isfinite(made.stored.state_range), made.stored.state_range, 0.0))
        u = exact([largest(model, made.stored.signal_reach, i) for i in model.inputs])
        total = zeros(self._places)
        adjoint = zeros(self._places, model.plant.n)
        for lag in range(self.window):  # from the newest sample back
            at = dict(zip(self._signal, self._weight[lag], strict=True))
            w = _columns([at[i] for i in model.outputs])
            v = _columns([at[i] for i in model.inputs])
            total = total + abs(w @ m.Fd + adjoint @ m.Ed).sums() + abs(w @ m.D + adjoint @ m.B + v) @ u
            adjoint = adjoint @ m.A + w @ m.C
        return total + abs(adjoint) @ state

    def judge(self, values: list[Exact], radii: list[Exact]) -> list[Judged]:
        """All certificates at the last sample; none before the window is full."""
        if len(values) < self.window:
            return []
        r, wide = zeros(self._places), self._least
        for lag in range(self.window):
            for g, row in zip(self._signal, self._weight[lag], strict=True):
                r = r + _times(row, values[-1 - lag], g)
                wide = wide + _times(abs(row), radii[-1 - lag], g)
        size = wide.floats()
        lost = self._lost + WIDENED * size
        return [Judged(r[c : c + 1], wide[c : c + 1], float(lost[c]), float(lost[c]) if self._whole else np.inf) for c in range(self._places)]


def _columns(parts: list[Exact]) -> Exact:
    """Vectors as columns."""
    if not parts:
        raise ValueError("a bank without signals")
    both = joined(parts)
    return Exact(np.asarray(both.whole.reshape(len(parts), -1).T, dtype=object), both.places)


def _times(row: Exact, of: Exact, place: int) -> Exact:
    return Exact(np.asarray(row.whole * of.whole[place], dtype=object), row.places + of.places)
