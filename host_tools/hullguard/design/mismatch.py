"""What an uncertain plant does beyond its middle: a disturbance m with x(k+1) = A x + B u + Ed d + m, |m| <= dA |x| + dB |u|; platoon, section 1."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hullguard.design.arith import mul, row_sums, share32, times, up32
from hullguard.design.tables import MismatchTable, rows
from hullguard.model.schema import Model
from hullguard.model.table import Array


def uncertain(model: Model) -> bool:
    """Whether the plant has intervals at all."""
    return bool(model.plant.dA.any() or model.plant.dB.any())


def mismatch(model: Model, state: Array) -> tuple[Array, Array, Array]:
    """d0 (n), Dy (n x outputs), Du (n x inputs): |m_i(k)| <= d0_i + sum_g Dy_ig (|value_g| + radius_g) + sum_g Du_ig (|value_g| + radius_g).

    A state that is an output by itself is bounded by what is known of that output, any other by `state` (n), its reach, in d0.
    """
    plant = model.plant
    d0, Dy = np.zeros(plant.n), np.zeros((plant.n, plant.m))
    for j in range(plant.n):
        row = _measured_by(model, j)
        if row is None:
            d0 += plant.dA[:, j] * (state[j] if plant.dA[:, j].any() else 0.0)
        else:
            # The reading is c x + noise: |x| <= (|reading| + noise) / |c|.
            scale = abs(plant.C[row, j])
            Dy[:, row] += plant.dA[:, j] / scale
            d0 += plant.dA[:, j] * row_sums(np.abs(plant.Fd[[row]]))[0] / scale
    noise = np.array([model.signals[i].noise for i in model.inputs])
    return d0 + times(plant.dB, noise), Dy, plant.dB.copy()


def mismatch_table(model: Model, state: Array) -> tuple[MismatchTable, tuple[int, ...]]:
    """hg_mismatch_config, and the states that it is of: those that the intervals move."""
    d0, Dy, Du = mismatch(model, state)
    moved = np.flatnonzero((d0 > 0) | np.any(Dy > 0, axis=1) | np.any(Du > 0, axis=1))
    gain = np.hstack([Dy, Du])
    used = np.flatnonzero(np.any(gain > 0, axis=0))
    places = np.array(model.outputs + model.inputs)
    wider = 1 + share32(roundings(len(used), len(model.groups)))
    table = MismatchTable(
        signal=tuple(int(i) for i in places[used]),
        constant=tuple(float(x) for x in up32(d0[moved] * wider)),
        gain=rows(up32(gain[np.ix_(moved, used)] * wider)),
    )
    return table, tuple(int(i) for i in moved)


def roundings(width: int, groups: int) -> int:
    """Of a number on its way into a derived radius: magnitude and radius, the products of `width` signals, the constant; then it grows, once a group that shows a loss."""
    return width + 2 + max(6, groups)


def _measured_by(model: Model, state: int) -> int | None:
    """The first output that is this state and nothing else but noise."""
    plant = model.plant
    for row in range(plant.m):
        if np.flatnonzero(plant.C[row]).tolist() == [state] and not plant.D[row].any():
            return row
    return None


def constant_mismatch(model: Model, state: Array, value: Array) -> Array:
    """|m_i| wherever the plant operates, for every state i. `state` (n) bounds |x|, `value` (signals) every reading's magnitude."""
    plant = model.plant
    noise = np.array([model.signals[i].noise for i in model.inputs])
    known = np.where(plant.dA.any(axis=0), state, 0.0)  # a state without a bound may stay so where nothing is multiplied by it
    return (mul(plant.dA, known[:, None]) + mul(plant.dB, (value[model.inputs] + noise)[:, None]))[:, 0]


def disturbed(model: Model, state: Array, value: Array) -> Model:
    """The model whose disturbance covers its intervals: what a generator is designed for."""
    if not uncertain(model):
        return model
    plant = model.plant
    bound = constant_mismatch(model, state, value)
    moved = bound > 0.0
    Ed = np.hstack([plant.Ed, np.diag(bound)[:, moved]])
    Fd = np.hstack([plant.Fd, np.zeros((plant.m, int(moved.sum())))])
    return replace(model, plant=replace(plant, Ed=Ed, Fd=Fd))
