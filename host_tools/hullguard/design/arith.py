"""Linear algebra whose result does not depend on the processor: plain multiplications and additions in a stated order, no BLAS.

Tables are made with these from numbers that are already rounded in NAME.design.toml, so that they are the same to the byte everywhere.
"""

from __future__ import annotations

import numpy as np

from hullguard.model.table import Array

U32 = 2.0**-24  # unit roundoff of float32


def gamma32(terms: int) -> float:
    """Largest share of sum |a_i x_i| that a float32 sum of products loses where no number passes more roundings than `terms` (proved: tests/gappa)."""
    return terms * U32 / (1 - terms * U32)


def share32(roundings: int) -> float:
    """What the tables of a sum of positive numbers are widened by, a share of them, where no number passes more roundings to float32 (proved: tests/gappa)."""
    return roundings * U32 * 1.01


def mul(a: Array, b: Array) -> Array:
    """A b, summed in index order; of stacks of matrices each with each, or all with the one."""
    out = np.zeros((*np.broadcast_shapes(a.shape[:-2], b.shape[:-2]), a.shape[-2], b.shape[-1]))
    for i in range(a.shape[-1]):
        out += a[..., :, i, None] * b[..., None, i, :]
    return out


def times(a: Array, x: Array) -> Array:
    """A x, summed in index order; of each matrix of a stack."""
    return np.ascontiguousarray(mul(a, x[:, None])[..., 0])


def row_sums(a: Array) -> Array:
    """Sum of each row, in index order; of each matrix of a stack."""
    out = np.zeros(a.shape[:-1])
    for i in range(a.shape[-1]):
        out += a[..., i]
    return out


def powers(F: Array, G: Array, count: int) -> Array:
    """F, F G, F G^2, ..: count x rows x order."""
    out = np.zeros((count, *F.shape))
    term = F
    for i in range(count):
        out[i] = term
        term = mul(term, G)
    return out


def nearest32(a: Array) -> Array:
    """Rounded to float32, as float64."""
    return np.asarray(a, dtype=np.float32).astype(np.float64)


def up32(a: Array) -> Array:
    """The smallest float32 not below each number, as float64."""
    near = np.asarray(a, dtype=np.float32)
    return np.where(near.astype(np.float64) < a, np.nextafter(near, np.float32(np.inf)), near).astype(np.float64)


def digits(a: Array, n: int = 15) -> Array:
    """Rounded to n significant decimal digits: what a design file stores."""
    return np.array([float(f"{x:.{n}g}") for x in np.ravel(a)]).reshape(np.shape(a))
