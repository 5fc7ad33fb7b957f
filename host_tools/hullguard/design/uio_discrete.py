"""The form an ECU runs: first-order hold, reconstruction of what moves the state beyond the model, low pass; suspension, section 1.4.

    z(k+1) = Fd z(k) + K0 y(k) + K1d y(k+1) + Bz u(k)         xhat(k) = z(k) + H y(k)
    fhat(k) = fhat(k-1) + a (P (xhat(k) - Ad xhat(k-1) - Bd u(k-1)) - fhat(k-1))             P Gd = I, one sample late

u is held between samples by the actuator. As a linear system from signals to estimates (uio.h), s(k) = z(k) - K1d y(k), Q = K1d + H:

    s(k+1) = Fd s(k) + (Fd K1d + K0) y(k) + Bz u(k)           xhat(k) = s(k) + Q y(k)
    g(k+1) = (1-a) g(k) + N xhat(k) - a P Bd u(k)             fhat(k) = g(k) + a P xhat(k)    N = a P ((1-a) I - Ad)
    l(k+1) = (1-a) (l(k) + a x0hat(k))                        low-passed fault of a sensor, l(k) + a x0hat(k)

Where the outputs tell every state, xhat(k) = C^-1 y(k) is an observer too, H = C^-1 with T = 0: it waits for nothing, so that an error of a signal
counts in its own sample and not as long as a pole remembers it. s stays 0 and is left out.

Without a fault s = Ts x, g = t - a P x and l = 0 but for what is bounded here, t the low-passed mean of an unknown input over its intervals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from hullguard.design.uio import Observer, Unknown, rank_of
from hullguard.errors import InputError
from hullguard.model.table import Array

PANELS = 64  # of a sample, for the integral of a kernel's magnitude
SHARPEST = 4.0  # e-foldings of the fastest mode within a panel at most


@dataclass(frozen=True)
class Discrete:
    """An observer at a sample time."""

    plant: Unknown  # continuous, with the faults of sensors as states; or discrete already
    sample_time_s: float
    Fd: Array  # n x n
    K0: Array  # n x m
    K1d: Array  # n x m
    Bz: Array  # n x p
    H: Array  # n x m
    T: Array  # n x n: z follows T x
    Ad: Array  # n x n
    Bd: Array  # n x p
    Gd: Array  # n x q
    P: Array  # q x n: left inverse of Gd


@dataclass(frozen=True)
class Estimator:
    """A linear system from signals [y; u] to estimates [faults of actuators; of sensors; unknown inputs; states], float64."""

    state: Array
    input: Array
    output: Array
    direct: Array
    follows: Array  # order x n: what the state is without a fault, of the plant's own states
    truth: Array  # estimates x n: what the estimates are then
    exempt: Array  # order: rows that follow an unknown input too, so that it does not disturb them


def zero_order_hold(A: Array, M: Array, sample_time_s: float) -> tuple[Array, Array]:
    """e^(A Ts) and the integral of e^(A s) M over a sample; A may be singular."""
    n, m = M.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = A, M
    E = scipy.linalg.expm(block * sample_time_s)
    return np.asarray(E[:n, :n]), np.asarray(E[:n, n:])


def first_order_hold(F: Array, K: Array, sample_time_s: float) -> tuple[Array, Array, Array]:
    """Fd, K0, K1d of z' = F z + K y with y linear between samples: exact for such y at any sample time."""
    n, m = K.shape
    block = np.zeros((n + 2 * m, n + 2 * m))
    block[:n, :n], block[:n, n : n + m], block[n : n + m, n + m :] = F, K, np.eye(m) / sample_time_s
    E = scipy.linalg.expm(block * sample_time_s)
    K1d = E[:n, n + m :]
    return np.asarray(E[:n, :n]), np.asarray(E[:n, n : n + m] - K1d), np.asarray(K1d)


def left_inverse(Gd: Array, weight: Array | None = None) -> Array:
    """P with P Gd = I; `weight` (n): how much each state's equation is trusted."""
    root = np.sqrt(weight) if weight is not None else np.ones(Gd.shape[0])
    return np.asarray(np.linalg.pinv(root[:, None] * Gd) * root)


def discretised(made: Observer, sample_time_s: float, P: Array | None = None) -> Discrete:
    """First-order hold of a continuous observer; an observer that is discrete already stays as it is."""
    plant = made.plant
    if plant.discrete:
        Fd, K0, K1d, Bz, Ad, Bd, Gd = made.F, made.K, np.zeros_like(made.K), made.TB, plant.A, plant.B, plant.G
    else:
        Fd, K0, K1d = first_order_hold(made.F, made.K, sample_time_s)
        Bz = zero_order_hold(made.F, made.TB, sample_time_s)[1]
        Ad, BG = zero_order_hold(plant.A, np.hstack([plant.B, plant.G]), sample_time_s)
        Bd, Gd = BG[:, : plant.B.shape[1]], BG[:, plant.B.shape[1] :]
    return Discrete(plant, sample_time_s, Fd, K0, K1d, Bz, made.H, made.T, Ad, Bd, Gd, left_inverse(Gd) if P is None else P)


def measured(plant: Unknown, sample_time_s: float) -> Discrete:
    """Of sensors that tell every state: xhat = C^-1 y."""
    n, p = len(plant.A), plant.B.shape[1]
    if rank_of(plant.C) < n:
        raise InputError(f"{', '.join(plant.outputs)} do not tell every one of {', '.join(plant.states)} directly; add sensors, or choose another form")
    at, none, H = sampled(plant, sample_time_s), np.zeros((n, n)), np.asarray(np.linalg.pinv(plant.C))
    return Discrete(plant, sample_time_s, none, np.zeros_like(H), np.zeros_like(H), np.zeros((n, p)), H, none, at.A, at.B, at.G, left_inverse(at.G))


def sampled(plant: Unknown, sample_time_s: float) -> Unknown:
    """The plant at its samples, unknown inputs held in between: what an observer designed in discrete time is made for."""
    Ad, BG = zero_order_hold(plant.A, np.hstack([plant.B, plant.G]), sample_time_s)
    p = plant.B.shape[1]
    return Unknown(Ad, BG[:, :p], plant.C, BG[:, p:], plant.states, plant.inputs, plant.outputs, True)


def check_euler(F: Array, sample_time_s: float, where: str) -> None:
    """Refuse to step z' = F z + .. by forward Euler where that grows."""
    worst = float(np.abs(np.linalg.eigvals(np.eye(len(F)) + sample_time_s * F)).max())
    if worst >= 1.0:
        poles = np.linalg.eigvals(F)
        longest = float((-2 * poles.real / np.abs(poles) ** 2).min())
        cure = f"sample every {longest:.3g} s or faster, or use the first-order hold" if longest > 0 else "the observer itself is not stable"
        raise InputError(f"{where}: forward Euler with {sample_time_s:g} s grows by {worst:.4g} a sample: {cure}")


def estimator(d: Discrete, own: int, actuators: Sequence[int], sensors: Sequence[int], unknown: Sequence[int], time_constant_s: float) -> Estimator:
    """All estimates of one observer. `own`: states of the plant itself, in front; the others are columns of G, and `sensors` states behind `own`.

    time_constant_s: of the low pass, 0 for none.
    """
    n, m, p = d.Ad.shape[0], d.H.shape[1], d.Bd.shape[1]
    rebuilt = [*actuators, *unknown]
    P, faults, q, r = d.P[rebuilt], [own + i for i in sensors], len(rebuilt), len(sensors)
    a = d.sample_time_s / (time_constant_s + d.sample_time_s)
    Q, N = d.K1d + d.H, a * P @ ((1 - a) * np.eye(n) - d.Ad)
    pick = np.eye(n)[faults]
    s, g, low = slice(0, n), slice(n, n + q), slice(n + q, n + q + r)
    order, width = n + q + r, m + p
    state, inputs = np.zeros((order, order)), np.zeros((order, width))
    state[s, s], inputs[s, :m], inputs[s, m:] = d.Fd, d.Fd @ d.K1d + d.K0, d.Bz
    state[g, g], state[g, s], inputs[g, :m], inputs[g, m:] = (1 - a) * np.eye(q), N, N @ Q, -a * P @ d.Bd
    state[low, low], state[low, s], inputs[low, :m] = (1 - a) * np.eye(r), (1 - a) * a * pick, (1 - a) * a * pick @ Q
    from_x, from_g, from_l = np.vstack([a * P, a * pick, np.eye(n)[:own]]), np.eye(q), np.eye(r)
    output = np.zeros((q + r + own, order))
    output[:, s] = from_x
    output[:q, g], output[q : q + r, low] = from_g, from_l
    direct = np.hstack([from_x @ Q, np.zeros((q + r + own, p))])
    follows = np.vstack([d.T - d.K1d @ d.plant.C, -a * P, np.zeros((r, n))])[:, :own]
    truth = np.vstack([np.zeros((q + r, own)), np.eye(own)])
    exempt = np.zeros(order, dtype=bool)
    exempt[n + len(actuators) : n + q] = True
    # Faults of actuators, of sensors, unknown inputs, states.
    rows = [*range(len(actuators)), *range(q, q + r), *range(len(actuators), q), *range(q + r, q + r + own)]
    kept = slice(n if not np.any(d.T) else 0, order)  # without T, s stays 0
    return Estimator(state[kept, kept], inputs[kept], output[rows, kept], direct[rows], follows[kept], truth[rows], exempt[kept])


def between_samples(A: Array, column: Array, follows: Array, sample_time_s: float, change: float) -> Array:
    """What one unknown input that changes by at most `change` a second does to follows x within a sample, beyond its value in the middle.

    |follows v| <= change * integral over a sample of |follows e^(A (Ts - s)) column| |s - Ts/2| ds, per row. The kernel's magnitude is bounded
    over each of many panels by its value in the panel's middle and the most that its slope can be there, so that nothing is lost to quadrature.
    """
    count = max(PANELS, int(np.ceil(sample_time_s * np.abs(A).sum(1).max() / SHARPEST * PANELS)))
    h = sample_time_s / count
    half = scipy.linalg.expm(A * (h / 2))
    step = half @ half
    x, total = half @ column, np.zeros(follows.shape[0])
    # |d/ds follows e^(As) c| <= |follows A| |e^(As) c|, and |e^(As) c| of the panel <= e^(|A| h/2) |its middle|.
    swell = scipy.linalg.expm(np.abs(A) * (h / 2))
    for i in range(count):
        middle = np.abs(follows @ x) + np.abs(follows @ A) @ (swell @ np.abs(x)) * (h / 2)
        near, far = abs(sample_time_s / 2 - i * h), abs(sample_time_s / 2 - (i + 1) * h)
        total += middle * h * max(near, far)
        x = step @ x
    return total * change
