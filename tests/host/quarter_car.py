"""A quarter car and its unknown-input observer, as small as a test needs them: methods, suspension, sections 1.1 to 1.4, corrected masses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
import scipy.linalg
import scipy.signal
from hullguard.core.native_uio import UioTable
from hullguard.model.table import Array

SPRING, TYRE, DAMPER, WHEEL, BODY = 16000.0, 160000.0, 1650.0, 36.0, 240.0
C = np.array([[1, 0, 0.5, -1, 0], [-1, -1, 0, 1, 0], [0, 0, 0, 0, 1.0]])
POLES = np.array([-10.0, -20.0, -20.0])
FINE_S = 1e-4


def plant(spring: float = SPRING, damper: float = DAMPER, tyre: float = TYRE) -> tuple[Array, Array]:
    """A of [z2-z1, dz2, z1-z0, dz1, f0] and G of [force, road, change of f0]."""
    A = np.zeros((5, 5))
    A[:4, :4] = [[0, 1, 0, -1], [-spring / BODY, -damper / BODY, 0, damper / BODY], [0, 0, 0, 1], [spring / WHEEL, damper / WHEEL, -tyre / WHEEL, -damper / WHEEL]]
    G = np.zeros((5, 3))
    G[1, 0], G[3, 0], G[2, 1], G[4, 2] = 1 / BODY, -1 / WHEEL, -1, 1
    return A, G


def held(A: Array, M: Array, t: float) -> tuple[Array, Array]:
    """e^(A t) and the integral of e^(A s) M."""
    n, m = M.shape
    E = scipy.linalg.expm(np.block([[A, M], [np.zeros((m, n + m))]]) * t)
    return E[:n, :n], E[:n, n:]


def observer() -> tuple[Array, Array, Array]:
    """F, K, H."""
    A, G = plant()
    CG = C @ G
    H = G @ np.linalg.inv(CG)
    A1 = (np.eye(5) - H @ C) @ A
    V = scipy.linalg.orth(C.T)
    K1 = V @ (V.T @ A1 @ V - np.diag(POLES)) @ np.linalg.inv(C @ V)
    F = A1 - K1 @ C
    return F, K1 + F @ H, H


def table(sample_time_s: float, low_pass: float, radius: tuple[float, ...] = (0.0,) * 8) -> UioTable:
    """What uio.h makes of it: [force; f0; road; states], no radius but a constant; low_pass 1 for none."""
    F, K, H = observer()
    A, G = plant()
    n, m, t = 5, 3, sample_time_s
    E = scipy.linalg.expm(np.block([[F, K, np.zeros((n, m))], [np.zeros((m, n + m)), np.eye(m) / t], [np.zeros((m, n + 2 * m))]]) * t)
    Fd, K1d = E[:n, :n], E[:n, n + m :]
    K0 = E[:n, n : n + m] - K1d
    Ad, Gd = held(A, G, t)
    P = low_pass * np.linalg.pinv(Gd)[:2]
    N = (1 - low_pass) * P - P @ Ad
    xs, xy = np.eye(n), K1d + H
    f0 = np.array([[0, 0, 0, 0, 1.0]])
    order = n + 3
    S, I, O, D = np.zeros((order, order)), np.zeros((order, m)), np.zeros((8, order)), np.zeros((8, m))
    S[:n, :n], I[:n] = Fd, Fd @ K1d + K0
    S[n : n + 2, :n], I[n : n + 2], S[n : n + 2, n : n + 2] = N, N @ xy, (1 - low_pass) * np.eye(2)
    S[-1, :n], I[-1], S[-1, -1] = low_pass * f0, low_pass * f0 @ xy, 1 - low_pass
    O[[0, 2], :n], D[[0, 2]], O[[0, 2], [n, n + 1]] = P, P @ xy, 1
    O[1], D[1] = S[-1], I[-1]
    O[3:, :n], D[3:] = xs, xy
    bias = np.array([radius])
    return UioTable(1, 1, 1, 5, (0, 1, 2), S, I, O, D, weight=np.zeros((1, 8, 1)), rest=bias, moving=bias)


def road(t: Array) -> Array:
    """Speed of the road: 1 Hz, 20 mm, and a bump of 5 cm in 100 ms at 3 s."""
    bump = np.where((t > 3) & (t < 3.1), 0.025 * 2 * np.pi / 0.1 * np.sin(2 * np.pi * (t - 3) / 0.1), 0)
    return cast(Array, 0.02 * 2 * np.pi * np.cos(2 * np.pi * t) + bump)


def drive(A: Array, G: Array, x: Array, force: Array, speed: Array) -> tuple[Array, Array]:
    """States before each fine step (steps x 4), and after the last one. In modal coordinates each mode is a filter of its own."""
    Ad, Gd = held(A[:4, :4], G[:4, :2], FINE_S)
    values, vectors = np.linalg.eig(Ad)
    into = np.linalg.solve(vectors, (Gd @ np.vstack([force, speed])).astype(complex))
    begun = np.linalg.solve(vectors, x.astype(complex))
    modes = np.array([scipy.signal.lfilter([1.0], [1.0, -v], np.concatenate([[b], w])) for v, b, w in zip(values, begun, into, strict=True)])
    states = (vectors @ modes).real.T
    return states[:-1], states[-1]


@dataclass(frozen=True)
class Drive:
    """Samples of a drive."""

    x: Array  # samples x 5
    y: Array  # samples x 3
    force: Array  # samples: means over the interval that follows
    speed: Array


def simulate(seconds: float, fault_s: float, force: float, f0: tuple[float, float], broken: dict[str, float], rough: Array, t_s: float = 1e-3, moving: float = 1.0) -> Drive:
    """From rest; `force` and a broken component from fault_s on, f0 (time, size) on the third output; `rough` (fine steps) on top of the road."""
    sub, steps = round(t_s / FINE_S), round(seconds / FINE_S)
    t = (np.arange(steps) + 0.5) * FINE_S
    speed, push, split = moving * road(t) + rough, force * (t >= fault_s), round(fault_s / FINE_S)
    before, x = drive(*plant(), np.zeros(4), push[:split], speed[:split])
    after, _ = drive(*plant(**broken), x, push[split:], speed[split:])
    fine = np.vstack([before, after])[::sub]
    states = np.column_stack([fine, f0[1] * (np.arange(len(fine)) * t_s >= f0[0])])
    return Drive(states, states @ C.T, push.reshape(-1, sub).mean(1), speed.reshape(-1, sub).mean(1))
