"""The left inverse P of Gd (P Gd = I) that makes the radius of each reconstructed input as small as it can be: a linear programme a row.

Gd has more rows than columns: what moves the state beyond the model can be read off several of its equations. fhat is linear in P, so that its radius is
the sum of |P c| over what signals and unknown inputs do, one sample after another, to xhat(k) - Ad xhat(k-1) behind the low pass. P = P0 + Y N with the
left null space N of Gd leaves Y free, and min sum |P0 c + Y N c| is a linear programme.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse
from scipy.optimize import linprog

from hullguard.design.uio_discrete import Discrete, left_inverse
from hullguard.model.table import Array

LAGS = 250  # of the answers of xhat that are weighed
PANELS = 12  # of a sample, for what unknown inputs do within it


def answers(d: Discrete, radius: Array, passing: Array, low_pass: float) -> Array:
    """What errors do to xhat(k) - Ad xhat(k-1) behind the low pass: n x (lags (signals + n)).

    An error of each signal, as large as its radius; then what gets into each state in a sample, `passing` (n): of unknown inputs, and of a hold.
    """
    x = np.hstack([(d.K1d + d.H) * radius, np.diag(passing)])
    s = np.hstack([(d.Fd @ d.K1d + d.K0) * radius, d.Fd * passing])
    before, low, found = np.zeros_like(x), np.zeros_like(x), []
    for _ in range(LAGS):
        low = low + low_pass * (x - d.Ad @ before - low)
        found.append(low)
        before, x, s = x, s, d.Fd @ s
    return np.hstack(found)


def within_a_sample(A: Array, columns: Array, rate: Array, sample_time_s: float) -> Array:
    """What unknown inputs that change at their rate do to the state in a sample, panel by panel: n x (panels inputs)."""
    h = sample_time_s / PANELS
    parts = []
    for i in range(PANELS):
        s = (i + 0.5) * h
        parts.append(scipy.linalg.expm(A * (sample_time_s - s)) @ columns * rate * abs(s - sample_time_s / 2) * h)
    return np.hstack(parts)


def best_rows(d: Discrete, rows: list[int], moved: Array) -> Array:
    """Rows of the best left inverse. `moved` (n x k): what the radius sums up."""
    P0, N = left_inverse(d.Gd), scipy.linalg.null_space(d.Gd.T).T
    if N.shape[0] == 0:
        return P0[rows]
    free, count = N @ moved, moved.shape[1]
    out = []
    for i in rows:
        fixed = P0[i] @ moved
        size, unit = float(np.abs(fixed).sum()), np.maximum(np.abs(free).sum(1), 1e-300)
        # Everything about 1: y in units of what it does, the sum in units of what it was.
        base, slope = fixed / size, (free / unit[:, None]).T
        eye = scipy.sparse.identity(count)
        A = scipy.sparse.vstack([scipy.sparse.hstack([slope, -eye]), scipy.sparse.hstack([-slope, -eye])]).tocsc()
        cost = np.concatenate([np.zeros(len(free)), np.ones(count)])
        bounds = [(None, None)] * len(free) + [(0, None)] * count
        solved = linprog(cost, A, np.concatenate([-base, base]), bounds=bounds, method="highs")
        row = P0[i] + (solved.x[: len(free)] * size / unit) @ N if solved.status == 0 else P0[i]
        # A solver's tolerance must not let unknown inputs through.
        out.append(row + (np.eye(d.Gd.shape[1])[i] - row @ d.Gd) @ P0)
    return np.array(out)
