"""Window form of a plant: what the last N samples can show, and how every fault shows in them; platoon, section 7.

    y = O x0 + Md d + Mu u + Me e        y, u, d, e: the samples of the window one after another, the oldest first

e are further disturbances whose bounds change from sample to sample, those of uncertain parameters for example. Products are summed in index
order (arith.mul), so that tables made from a window form are the same to the byte everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hullguard.design.arith import mul
from hullguard.model.plant import Plant
from hullguard.model.schema import Fault, Model
from hullguard.model.table import Array


@dataclass(frozen=True)
class Varying:
    """Disturbance columns whose bounds are known only while the detector runs: radii of derived signals."""

    into_x: Array  # n x columns
    into_y: Array  # m x columns

    @property
    def columns(self) -> int:
        """Derived signals."""
        return int(self.into_x.shape[1])


@dataclass(frozen=True)
class WindowForm:
    """The matrices over a window of N samples; rows are (sample, output), columns (sample, input) or (sample, disturbance)."""

    window: int  # N
    O: Array  # N m x n
    Md: Array  # N m x N nd, |d| <= 1
    Mu: Array  # N m x N p
    Me: Array  # N m x N ne


def varying_states(plant: Plant, states: Sequence[int]) -> Varying:
    """What an uncertain plant adds to these states: a derived signal each."""
    columns = list(states)
    return Varying(np.eye(plant.n)[:, columns], np.zeros((plant.m, len(columns))))


def no_varying(plant: Plant) -> Varying:
    """A plant whose parameters are certain."""
    return varying_states(plant, ())


def window_form(plant: Plant, window: int, varying: Varying | None = None) -> WindowForm:
    """The window form of a plant over `window` samples."""
    more = varying or no_varying(plant)
    seen = [plant.C]  # C A^lag
    for _ in range(window - 1):
        seen.append(mul(seen[-1], plant.A))

    def responses(into_x: Array, into_y: Array) -> Array:
        width = into_x.shape[1]
        impulse = [into_y, *(mul(s, into_x) for s in seen[:-1])]
        M = np.zeros((window, plant.m, window, width))
        for k in range(window):
            for j in range(k + 1):
                M[k, :, j] = impulse[k - j]
        return M.reshape(window * plant.m, window * width)

    return WindowForm(window, np.vstack(seen), responses(plant.Ed, plant.Fd), responses(plant.B, plant.D), responses(more.into_x, more.into_y))


def fault_response(model: Model, form: WindowForm, fault: Fault) -> Array:
    """Gamma of a fault: what each sample of its time course adds to y - Mu u as the detector reads it; N m x N."""
    if fault.signal in model.outputs:
        return np.asarray(np.kron(np.eye(form.window), np.eye(model.plant.m)[:, [model.outputs.index(fault.signal)]]), dtype=np.float64)
    own = form.Mu[:, model.inputs.index(fault.signal) :: model.plant.p]
    # An actuator's fault acts on the plant; a measured input's is subtracted where it has not acted.
    return own if fault.type == "actuator" else -own
