"""The linear programme of one window: the smallest t for which some states and disturbances explain its readings.

    x(k+1) - A x(k) - Ed d(k) = B u(k)      C x(k) + Fd d(k) = y(k) - D u(k)      |d_j(k)| <= bound_j + t step_j

Bounds are linear in the parameters, bound = H beta. Columns that act on one equation alone are not variables but the width of that equation. The
multipliers say which rows hold t up, and how t would fall with every parameter: a cut for the programme over all windows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize
import scipy.sparse

from hullguard.errors import InputError
from hullguard.identify.records import Record
from hullguard.identify.structure import Column, Structure
from hullguard.model.table import Array


@dataclass(frozen=True)
class Answer:
    """What a window needs."""

    t: float
    slope: Array  # parameters: dt / dbeta, never positive
    sample: int  # of the window: where the equation is that holds t up most
    equation: str


class Window:
    """The programme for windows of one length; only the right side is the window's own."""

    def __init__(self, found: Structure, samples: int) -> None:
        self._found, self.samples = found, samples
        plant, count = found.model.plant, len(found.parameters)
        alone = [_alone(c) for c in found.columns]
        shared = [c for c, only in zip(found.columns, alone, strict=True) if not only]
        n, q = plant.n, len(shared)
        width, fixed = np.zeros((n + plant.m, count)), np.zeros(n + plant.m)
        for c, only in zip(found.columns, alone, strict=True):
            if only:
                into = np.abs(np.concatenate([c.into_x, c.into_y]))
                if c.parameter >= 0:
                    width[:, c.parameter] += into
                else:
                    fixed += into * c.bound
        E = np.array([c.into_x for c in shared]).reshape(q, n).T
        F = np.array([c.into_y for c in shared]).reshape(q, plant.m).T
        eye, here, ahead = scipy.sparse.eye_array(samples), scipy.sparse.eye_array(samples - 1, samples), scipy.sparse.eye_array(samples - 1, samples, k=1)
        moving = scipy.sparse.hstack([scipy.sparse.kron(ahead, np.eye(n)) - scipy.sparse.kron(here, plant.A), -scipy.sparse.kron(here, E)])
        reading = scipy.sparse.hstack([scipy.sparse.kron(eye, plant.C), scipy.sparse.kron(eye, F)])
        own = scipy.sparse.hstack([scipy.sparse.csr_array((samples * q, samples * n)), scipy.sparse.eye_array(samples * q)])
        self._left = scipy.sparse.csr_array(scipy.sparse.vstack([moving, reading, own]))
        of_shared = np.zeros((q, count))
        for j, c in enumerate(shared):
            if c.parameter >= 0:
                of_shared[j, c.parameter] = 1.0
        self._width = np.vstack([np.tile(width[:n], (samples - 1, 1)), np.tile(width[n:], (samples, 1)), np.tile(of_shared, (samples, 1))])
        self._fixed = np.concatenate([np.tile(fixed[:n], samples - 1), np.tile(fixed[n:], samples), np.tile([c.bound for c in shared], samples)])
        names = [f"equation of {s}" for s in plant.states], [f"reading of {found.model.signals[i].name}" for i in found.model.outputs]
        self._rows = [(k, e) for k in range(samples - 1) for e in names[0]] + [(k, e) for k in range(samples) for e in names[1]]
        self._rows += [(k, "disturbance of several equations") for k in range(samples) for _ in shared]

    def solve(self, y: Array, u: Array, bound: Array, step: Array) -> Answer:
        """The smallest t of the bounds `bound` + t `step` (parameters) for this window's readings."""
        plant = self._found.model.plant
        right = np.concatenate([(u[:-1] @ plant.B.T).ravel(), (y - u @ plant.D.T).ravel(), np.zeros(self._left.shape[0] - len(y) * (plant.n + plant.m) + plant.n)])
        wide, grow = self._fixed + self._width @ bound, self._width @ step
        # In units of their width all rows meet the solver's tolerance alike.
        unit = 1.0 / np.maximum(wide + grow, 1e-9)
        left = scipy.sparse.diags_array(unit) @ self._left
        A = scipy.sparse.vstack([scipy.sparse.hstack([side * left, -(unit * grow)[:, None]]) for side in (1.0, -1.0)], format="csr")
        b = np.concatenate([unit * (wide + right), unit * (wide - right)])
        cost = np.zeros(A.shape[1])
        cost[-1] = 1.0
        free = [(None, None)] * (A.shape[1] - 1)
        done = scipy.optimize.linprog(cost, A_ub=A, b_ub=b, bounds=[*free, (0.0, None)], method="highs")
        if done.status != 0:
            raise InputError(f"no bounds explain the recording: {done.message}; give every state and reading that may be disturbed a bound above 0")
        hold = -done.ineqlin.marginals
        hold = (hold[: len(unit)] + hold[len(unit) :]) * unit
        k, equation = self._rows[int(np.argmax(hold * (grow + wide)))]
        return Answer(float(done.x[-1]), -(hold @ self._width), k, equation)


def _alone(c: Column) -> bool:
    return bool(np.count_nonzero(c.into_x) + np.count_nonzero(c.into_y) == 1)


def windows(records: Sequence[Record], samples: int) -> list[tuple[int, int]]:
    """Record and first sample of overlapping windows over all of them."""
    made = []
    for i, r in enumerate(records):
        last = max(len(r.y) - samples, 0)
        made += [(i, s) for s in sorted({*range(0, last, max(samples // 2, 1)), last})]
    return made
