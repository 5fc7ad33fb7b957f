"""Plants whose entries are known to within intervals: sound bounds of the discrete matrices, and plants drawn inside them.

With M = [A B; 0 0] and |M* - M| <= D entry by entry, exp(M* T) differs from exp(M T) by at most exp((|M + cI| + D) T) - exp(|M + cI| T), times
exp(-cT), for every number c: expand the exponential of (M + cI + E) T in products of M + cI and E, |E| <= D, and take magnitudes. Where the signs
of M + cI agree along all paths, as for a string of vehicles with c at least the drag, the bound is reached by the upper end of the interval.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from hullguard.model.builders import Interval
from hullguard.model.table import Array

SLACK = 1e-9  # of a bound: more than the exponentials and their digits in a design file can be off
SHIFTS = 9  # values of c that are tried; each gives a bound, the least of them holds


def _augmented(A: Array, B: Array) -> Array:
    n, p = B.shape
    return np.block([[A, B], [np.zeros((p, n + p))]])


def zero_order_hold(A: Array, B: Array, sample_time_s: float) -> tuple[Array, Array]:
    """Discrete A, B of a continuous plant whose input is held between samples."""
    n = B.shape[0]
    M = scipy.linalg.expm(_augmented(A, B) * sample_time_s)
    return M[:n, :n], M[:n, n:]


def _paths(steps: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which entries of the powers of a matrix with these non-zero entries, the zeroth too, can be other than zero."""
    found = steps | np.eye(len(steps), dtype=bool)
    for _ in range(len(steps).bit_length()):
        found = found.astype(float) @ found > 0
    return found


def enclosure(interval: Interval, sample_time_s: float) -> tuple[Array, Array]:
    """Bounds dA (n x n), dB (n x p): how far the discrete matrices of any plant of the interval can be from those of its middle, entry by entry."""
    n, p = interval.B.shape
    D = _augmented(interval.A_pm, interval.B_pm)
    if not D.any():
        return np.zeros((n, n)), np.zeros((n, p))
    M = _augmented(interval.A, interval.B)
    largest = max(0.0, float((D.diagonal() - M.diagonal()).max()))
    bound = np.full(M.shape, np.inf)
    for c in np.linspace(0.0, largest, SHIFTS):
        shifted = np.abs(M + c * np.eye(n + p))
        spread = scipy.linalg.expm((shifted + D) * sample_time_s) - scipy.linalg.expm(shifted * sample_time_s)
        bound = np.minimum(bound, np.exp(-c * sample_time_s) * spread)
    # What is not moved at all comes out as rounding: an entry that no path of D reaches is certain.
    path = _paths((M != 0) | (D != 0)).astype(float)
    moved = path @ (D != 0) @ path > 0
    scale = np.exp(np.abs(M).sum(1).max() * sample_time_s)
    bound = np.where(moved, np.maximum(bound, 0.0) * (1 + SLACK) + 1e-14 * scale, 0.0)
    return bound[:n, :n], bound[:n, n:]


def drawn(interval: Interval, rng: np.random.Generator) -> tuple[Array, Array]:
    """A and B of one plant of the interval: half of the plants at a corner, the others anywhere inside."""
    corner = rng.random() < 0.5

    def inside(middle: Array, pm: Array) -> Array:
        share = rng.choice([-1.0, 1.0], middle.shape) if corner else rng.uniform(-1.0, 1.0, middle.shape)
        return middle + share * pm

    return inside(interval.A, interval.A_pm), inside(interval.B, interval.B_pm)
