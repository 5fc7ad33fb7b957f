"""Random stable systems for the tests of thresholds."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from hullguard.model.table import Array

KINDS = ("modal", "deadbeat", "multiple", "companion")


def pair(size: float, angle: float) -> Array:
    """Two states that turn and shrink."""
    return size * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def companion(gamma: Array) -> Array:
    G = np.eye(len(gamma), k=-1)
    G[:, -1] = gamma
    return G


def random_state(rng: np.random.Generator, kind: str) -> Array:
    """A stable state matrix: separate poles, deadbeat, multiple poles, or a companion."""
    if kind == "deadbeat":
        return companion(np.zeros(int(rng.integers(1, 7))))
    if kind == "multiple":
        s = int(rng.integers(2, 5))
        return companion(-np.poly(np.full(s, rng.uniform(0.0, 0.6)))[::-1][:s])
    blocks: list[Array] = [np.array([[rng.uniform(-0.95, 0.95)]]) for _ in range(int(rng.integers(0, 4)))]
    blocks += [pair(rng.uniform(0.0, 0.95), rng.uniform(0.1, 3.0)) for _ in range(int(rng.integers(0 if blocks else 1, 3)))]
    modal = scipy.linalg.block_diag(*blocks)
    if kind == "companion":
        return companion(-np.poly(np.linalg.eigvals(modal)).real[::-1][: len(modal)])
    X = rng.standard_normal(modal.shape)
    return np.asarray(X @ modal @ np.linalg.inv(X))
