"""What a design has to pass before it is emitted. Each check is a figure and its limit."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from hullguard.design.hull import Linear
from hullguard.design.observer import ObserverMatrices, PostFilter, SubPlant
from hullguard.errors import InputError

FREQUENCIES = 256


@dataclass(frozen=True)
class Check:
    """A figure that must not exceed its limit."""

    name: str
    value: float
    limit: float
    cure: str

    @property
    def passed(self) -> bool:
        """False for NaN too."""
        return bool(self.value <= self.limit)


def luenberger(plant: SubPlant, o: ObserverMatrices) -> float:
    """Largest entry of T A - G T - L C, T B - L D - H, V C - W T, V D - Qu, relative to the largest of T and 1."""
    scale = max(1.0, float(np.abs(o.T).max()), float(np.abs(o.L).max()))
    gaps = [o.T @ plant.A - o.G @ o.T - o.L @ plant.C, o.T @ plant.B - o.L @ plant.D - o.H, o.V @ plant.C - o.W @ o.T, o.V @ plant.D - o.Qu]
    return max(float(np.abs(g).max()) for g in gaps if g.size) / scale


def riccati(o: ObserverMatrices, f: PostFilter) -> tuple[float, float, float]:
    """Relative residual of the DARE, asymmetry of X, and largest |eigenvalue| of G - Lo W."""
    cross = o.G @ f.X @ o.W.T + f.Eb @ f.Fb.T
    right = o.G @ f.X @ o.G.T + f.Eb @ f.Eb.T - cross @ np.linalg.solve(f.S, cross.T)
    scale = max(1e-300, float(np.abs(f.X).max()), float(np.abs(f.Eb @ f.Eb.T).max()))
    stable = float(np.abs(np.linalg.eigvals(o.G - f.Lo @ o.W)).max())
    return float(np.abs(f.X - right).max()) / scale, float(np.abs(f.X - f.X.T).max()) / scale, stable


def all_pass(o: ObserverMatrices, f: PostFilter) -> float:
    """Largest distance from 1 of the singular values of R G_rd on the unit circle.

    R (Fb + W (zI - G)^-1 Eb) = Mo (Fb + W (zI - G + Lo W)^-1 (Eb - Lo Fb)): one inverse instead of a product of two, of which that of G can be
    so large that rounding alone would show.
    """
    eye, worst = np.eye(o.G.shape[0]), 0.0
    for w in np.linspace(0.0, np.pi, FREQUENCIES):
        z = np.exp(1j * w)
        from_d = f.Mo @ (f.Fb + o.W @ np.linalg.solve(z * eye - o.G + f.Lo @ o.W, f.Eb - f.Lo @ f.Fb))
        worst = max(worst, float(np.abs(np.linalg.svd(from_d, compute_uv=False) - 1.0).max()))
    return worst


def generator_checks(i: int, plant: SubPlant, o: ObserverMatrices, f: PostFilter, linear: Linear, filtered: bool) -> list[Check]:
    """All checks of one residual generator."""
    limit = 1e-9 if np.linalg.cond(f.S) <= 1e3 else 1e-7
    name = f"generator {i + 1}: "
    checks = [
        Check(name + "Luenberger residual", luenberger(plant, o), 1e-9, "choose another order or other outputs"),
        Check(name + "largest pole of G", float(np.abs(np.linalg.eigvals(o.G)).max()), 1 - 1e-9, "choose poles inside the unit circle"),
        Check(name + "largest pole in float32", float(np.abs(np.linalg.eigvals(linear.state)).max()), 1 - 1e-6, "choose poles further inside the unit circle"),
    ]
    if not filtered:
        return checks
    residual, asymmetry, stable = riccati(o, f)
    return [
        *checks,
        Check(name + "DARE residual", residual, 1e-8, "choose another order, poles or more disturbance"),
        Check(name + "DARE asymmetry", asymmetry, 1e-8, "choose another order, poles or more disturbance"),
        Check(name + "largest pole of the stabilising solution", stable, 1 - 1e-9, "choose another order, poles or more disturbance"),
        Check(name + "all-pass error", all_pass(o, f), limit, "choose another order, poles or more disturbance"),
    ]


def refuse(where: str, checks: Iterable[Check]) -> None:
    """Raise with the first check that fails."""
    for c in checks:
        if not c.passed:
            raise InputError(f"{where}: {c.name} is {c.value:.4g}, more than {c.limit:.4g}; {c.cure}")
