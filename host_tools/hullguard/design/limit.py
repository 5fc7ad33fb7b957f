"""The earliest sound detection: the first sample at which no fault-free explanation of the held values is left; platoon, section 7.

An explanation of the last N samples is a course of states, disturbances and input errors within their bounds that lies within the radius of every
held output. The programme looks for the least relaxation of the radii that admits one,

    min t    x(i+1) - A x(i) - B eu(i) - Ed d(i) = B u(i)      |y(i) - C x(i) - D (u(i) + eu(i)) - Fd d(i)| <= radius(i) + t scale      t >= 0

and t > 0 proves a fault. It is written with all states of the window, not with x(0) alone: the matrix is sparse and the same at every sample, only
bounds change, so the solver starts from its last basis. The duals of the output rows are a parity vector over the window, the certificate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import highspy
import numpy as np
import scipy.sparse

from hullguard.design.window import Varying, no_varying
from hullguard.model.plant import Plant
from hullguard.model.schema import Fault, Model
from hullguard.model.table import Array

EXPLAINED = 1e-5  # t up to which values count as explained: a small part of a radius, far above the solver's tolerance


@dataclass(frozen=True)
class Folded:
    """The errors of a plant. A disturbance that enters one equation alone is a part of that equation's bound; only the others need variables."""

    slack_x: Array  # n
    slack_y: Array  # m
    into_x: Array  # n x errors: inputs, varying disturbances, the others
    into_y: Array  # m x errors
    fixed: int  # of them, how many have the bound 1


def folded(plant: Plant, varying: Varying) -> Folded:
    """Errors of the inputs, whose bounds are radii, then the varying disturbances, then the disturbances that enter several equations."""
    both = np.vstack([plant.Ed, plant.Fd])
    single = (both != 0).sum(0) == 1
    bound = np.abs(both[:, single]).sum(1)
    into_x = np.hstack([plant.B, varying.into_x, plant.Ed[:, ~single]])
    into_y = np.hstack([plant.D, varying.into_y, plant.Fd[:, ~single]])
    return Folded(bound[: plant.n], bound[plant.n :], into_x, into_y, int((~single).sum()))


def equations(plant: Plant, errors: Folded, window: int) -> tuple[Any, Any]:
    """Rows of the state equations and of the outputs of a window, sparse; columns are the states of every sample, then its errors."""
    each, now, following = np.eye(window), np.eye(window - 1, window), np.eye(window - 1, window, 1)
    x = scipy.sparse.hstack([scipy.sparse.kron(following, np.eye(plant.n)) - scipy.sparse.kron(now, plant.A), -scipy.sparse.kron(now, errors.into_x)])
    y = scipy.sparse.hstack([scipy.sparse.kron(each, plant.C), scipy.sparse.kron(each, errors.into_y)])
    return x.tocsr(), y.tocsr()


class Explanation:
    """The programme of one model and window. One fault of the model may be allowed any course: what is left then is evidence against the others."""

    def __init__(self, model: Model, window: int, scale: Array, varying: Varying | None = None, feedback: bool = False) -> None:
        """`scale` (m) is what t is counted in, an output's usual radius. `feedback`: the loop is known, u = u_eq - K (x - x_eq) + u_ref."""
        plant = model.plant
        self.model, self.window = model, window
        self._gain = plant.feedback.gain if feedback and plant.feedback is not None else None
        self._varying = (varying or no_varying(plant)).columns
        self._errors = folded(plant, varying or no_varying(plant))
        rows = self._matrix(scale)
        self._highs: Any = highspy.Highs()  # type: ignore[no-untyped-call]
        for option, value in (("output_flag", False), ("threads", 1)):
            self._highs.setOptionValue(option, value)
        self._highs.passModel(self._programme(rows))
        self._every_row, self._every_column = np.arange(rows.shape[0], dtype=np.int32), np.arange(rows.shape[1], dtype=np.int32)

    def _matrix(self, scale: Array) -> Any:
        """Rows: state equations, outputs from below and from above, feedback likewise. Columns: states, errors, t."""
        plant, N = self.model.plant, self.window
        x, y = equations(plant, self._errors, N)
        t = scipy.sparse.csr_matrix(np.tile(scale, N)[:, None])
        blocks = [[x, scipy.sparse.csr_matrix((x.shape[0], 1))], [y, t], [y, -t]]
        if self._gain is not None:
            own = np.hstack([np.eye(plant.p), np.zeros((plant.p, self._errors.into_x.shape[1] - plant.p))])
            u = scipy.sparse.hstack([scipy.sparse.kron(np.eye(N), self._gain), scipy.sparse.kron(np.eye(N), own)])
            # Any positive scale keeps the programme solvable; this one is the command that a usual radius of the states would make.
            t_u = scipy.sparse.csr_matrix(np.tile(np.abs(self._gain).sum(1) * scale.max(), N)[:, None])
            blocks += [[u, t_u], [u, -t_u]]
        rows = scipy.sparse.csr_matrix(scipy.sparse.vstack([scipy.sparse.hstack(b) for b in blocks]))
        rows.eliminate_zeros()
        return rows

    def _programme(self, rows: Any) -> highspy.HighsLp:
        lp = highspy.HighsLp()
        lp.num_row_, lp.num_col_ = rows.shape
        cost = np.zeros(rows.shape[1])
        cost[-1] = 1.0
        lp.col_cost_ = cost
        lp.col_lower_, lp.col_upper_ = np.zeros(rows.shape[1]), np.zeros(rows.shape[1])
        lp.row_lower_, lp.row_upper_ = np.zeros(rows.shape[0]), np.zeros(rows.shape[0])
        lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
        lp.a_matrix_.start_, lp.a_matrix_.index_, lp.a_matrix_.value_ = rows.indptr, rows.indices, rows.data
        return lp

    def relaxation(self, value: Array, radius: Array, free: Fault | None = None, varying_radius: Array | None = None, reference: Array | None = None) -> float:
        """Least t for a window of held values and radii (N x signals).

        `free` is a fault of any course; `varying_radius` (N x derived signals) bounds the varying disturbances; `reference` (N x p) is u_ref.
        """
        model, plant, N = self.model, self.model.plant, self.window
        y, u = value[:, model.outputs], value[:, model.inputs]
        ry, ru = radius[:, model.outputs] + self._errors.slack_y, radius[:, model.inputs].copy()
        if free is not None and free.signal in model.outputs:
            ry[:, model.outputs.index(free.signal)] = math.inf
        elif free is not None:
            ru[:, model.inputs.index(free.signal)] = math.inf
        driven, direct = (u @ plant.B.T)[:-1], y - u @ plant.D.T
        none = np.full(y.size, math.inf)
        lower = [(driven - self._errors.slack_x).ravel(), (direct - ry).ravel(), -none]
        upper = [(driven + self._errors.slack_x).ravel(), none, (direct + ry).ravel()]
        if self._gain is not None:
            command, half = self._command(u, reference)
            lower += [(command - half).ravel(), np.full(command.size, -math.inf)]
            upper += [np.full(command.size, math.inf), (command + half).ravel()]
        more = np.zeros((N, 0)) if varying_radius is None else varying_radius
        errors = np.hstack([ru, more, np.ones((N, self._errors.fixed))]).ravel()
        states = np.full(N * plant.n, math.inf)
        self._highs.changeRowsBounds(len(self._every_row), self._every_row, np.concatenate(lower), np.concatenate(upper))
        bound = np.concatenate([states, errors])
        self._highs.changeColsBounds(len(self._every_column), self._every_column, np.append(-bound, 0.0), np.append(bound, math.inf))
        return self._solve()

    def unexplained(self, trace: dict[str, Array], k: int, free: Fault | None = None, reference: Array | None = None) -> bool:
        """Whether the window that ends at sample k of Batch.trace() has no explanation. Its signal vector ends with the radii of the varying disturbances."""
        past, width = slice(k - self.window + 1, k + 1), trace["radius"].shape[1]
        known = None if reference is None else reference[past]
        return self.relaxation(trace["value"][past], trace["radius"][past], free, trace["radius"][past, width - self._varying :], known) > EXPLAINED

    def _command(self, u: Array, reference: Array | None) -> tuple[Array, Array]:
        """K x + eu as the control law gives it, and how far the wire's code and a sensor of u may be off it."""
        plant, model = self.model.plant, self.model
        assert self._gain is not None
        known = np.zeros_like(u) if reference is None else reference
        half = np.array([model.signals[i].resolution + model.signals[i].noise for i in model.inputs])
        return plant.equilibrium_input + self._gain @ plant.equilibrium + known - u, half

    def _solve(self) -> float:
        self._highs.run()
        if self._highs.getModelStatus() == highspy.HighsModelStatus.kOptimal:
            return float(self._highs.getObjectiveValue())
        # A warm start from a far basis can go astray; from scratch the programme always has a solution.
        self._highs.clearSolver()
        self._highs.run()
        if self._highs.getModelStatus() != highspy.HighsModelStatus.kOptimal:
            raise RuntimeError(f"the linear programme of the limit ended with {self._highs.modelStatusToString(self._highs.getModelStatus())}")
        return float(self._highs.getObjectiveValue())

    def certificate(self) -> Array:
        """Duals of the outputs at the last solution: w over the window (N x m), w'(y - Mu u) > |w|' radius + sum |w' Md| where t > 0."""
        first, count = (self.window - 1) * self.model.plant.n, self.window * self.model.plant.m
        dual = np.array(self._highs.getSolution().row_dual[first : first + 2 * count])
        return np.asarray((dual[:count] + dual[count:]).reshape(self.window, -1))


def first_unexplained(programme: Explanation, trace: dict[str, Array], start: int, last: int, free: Fault | None = None, reference: Array | None = None) -> int | None:
    """Samples from `start` to the first window that ends at it or later and has no explanation; None when there is none before `last`."""
    return next((k - start for k in range(max(start, programme.window - 1), last) if programme.unexplained(trace, k, free, reference)), None)
