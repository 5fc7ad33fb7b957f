"""How disturbance and noise share what the readings show beyond the plant: from the covariance of a window's parity residuals.

With O the observability matrix of a window, N spanning its left null space, zeta = N' (Y - Mu U) is free of the state: zeta = N' Md d. For white,
independent disturbances its covariance is the sum over all bounds of sigma_p^2 M_p with M_p = N' Md_p Md_p' N: linear in the squares, which
non-negative least squares finds, weighted by the inverse of the covariance itself. Bounds cannot be seen apart by extremes alone: a rare
worst case of five terms never comes in a recording, their second moments are there in every sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.optimize

from hullguard.identify.records import Record
from hullguard.identify.structure import Structure
from hullguard.model.plant import Plant
from hullguard.model.table import Array

ROWS = 60  # of a window's residual, about
LONGEST = 20  # samples of a window
ROUNDS = 8
FLOOR = 1e-3  # of a standard deviation: of what could still be there where the data show nothing


@dataclass(frozen=True)
class Shares:
    """Standard deviations of the disturbances behind each bound."""

    sigma: Array  # parameters
    error: Array  # parameters: relative standard error of sigma, about; infinite where the data show nothing


@dataclass(frozen=True)
class Parity:
    """Residuals of a window that the state does not reach."""

    length: int  # samples
    null: Array  # length m x residuals
    response: Array  # length x m x n: C A^k

    @classmethod
    def of(cls, plant: Plant, length: int) -> Parity:
        """Of a window of this length."""
        rows = [plant.C]
        for _ in range(length - 1):
            rows.append(rows[-1] @ plant.A)
        return cls(length, scipy.linalg.null_space(np.vstack(rows).T), np.array(rows))

    def driven(self, into_x: Array, into_y: Array) -> Array:
        """Markov blocks of columns (n x q and m x q) over the window: length m x length q."""
        m, q = into_y.shape
        first = np.concatenate([into_y[None], self.response[:-1] @ into_x])  # length x m x q
        out = np.zeros((self.length, m, self.length, q))
        for start in range(self.length):
            out[start:, :, start] = first[: self.length - start]
        return out.reshape(self.length * m, self.length * q)

    def residuals(self, plant: Plant, y: Array, u: Array) -> Array:
        """Of every window of a record: windows x residuals."""
        stacked = [np.lib.stride_tricks.sliding_window_view(s, self.length, axis=0).transpose(0, 2, 1).reshape(-1, self.length * s.shape[1]) for s in (y, u)]
        return np.asarray((stacked[0] - stacked[1] @ self.driven(plant.B, plant.D).T) @ self.null)


def window_length(plant: Plant) -> int:
    """As many samples as give about ROWS residuals, and at least one more than the state needs."""
    return max(min(ROWS // plant.m, LONGEST), -(-plant.n // plant.m) + 2)


def shares(found: Structure, records: Sequence[Record]) -> Shares:
    """Standard deviations by weighted non-negative least squares."""
    plant = found.model.plant
    parity = Parity.of(plant, window_length(plant))
    zeta = np.vstack([parity.residuals(plant, r.y, r.u) for r in records])
    S = zeta.T @ zeta / len(zeta)
    count = len(found.parameters)
    M, fixed = np.zeros((count, *S.shape)), np.zeros(S.shape)
    for c in found.columns:
        spread = parity.null.T @ parity.driven(c.into_x[:, None], c.into_y[:, None])
        if c.parameter >= 0:
            M[c.parameter] += spread @ spread.T
        else:
            fixed += c.bound**2 / 3 * spread @ spread.T  # of a uniform one
    ridge = 1e-9 * np.trace(S) / len(S) * np.eye(len(S))
    model, theta = S, np.zeros(count)
    for _ in range(ROUNDS):
        white = scipy.linalg.solve_triangular(np.linalg.cholesky(model + ridge), np.eye(len(S)), lower=True)
        X = np.array([(white @ P @ white.T).ravel() for P in M]).T
        size = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
        theta = scipy.optimize.nnls(X / size, (white @ (S - fixed) @ white.T).ravel())[0] / size
        model = fixed + np.tensordot(theta, M, 1)
    spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv((X / size).T @ (X / size))), 0.0)) / size * np.sqrt(2 * parity.length / len(zeta))
    with np.errstate(divide="ignore"):
        error = np.where(theta > 0.0, spread / (2 * np.maximum(theta, 1e-300)), np.inf)
    return Shares(np.sqrt(np.maximum(theta, FLOOR**2 * (theta + 2 * spread))), error)


def disagreement(plant: Plant, records: Sequence[tuple[Array, Array]]) -> float:
    """Logarithm of the volume that the parity residuals fill, a sample: lags are the less likely, the larger it is."""
    parity = Parity.of(plant, window_length(plant))
    zeta = np.vstack([parity.residuals(plant, y, u) for y, u in records])
    S = zeta.T @ zeta / len(zeta)
    return float(np.linalg.slogdet(S + 1e-14 * np.trace(S) / len(S) * np.eye(len(S)))[1]) / parity.length
