"""Unknown-input observer: existence, what stands in its way, gains; suspension, section 1.1.

    x' = A x + B u + G f      y = C x        f: unknown inputs, faults of actuators, and alpha where a sensor's fault f0' = A_f f0 + alpha is a state
    H = G ((CG)' CG)^-1 (CG)'    T = I - H C    A1 = T A    F = A1 - K1 C    K = K1 + F H    z' = F z + T B u + K y    xhat = z + H y

T G = 0, so no f reaches x - xhat, which obeys e' = F e. The same algebra serves x(k+1) = A x + .. with poles inside the unit circle.
The modes of (C, A1) that no output shows are the invariant zeros of (A, G, C): motions that f can keep out of every output. No K1 moves them.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from hullguard.errors import InputError
from hullguard.model.table import Array

RANK = 1e-9  # relative to the largest singular value: below it a direction is rounding
GROWTH = 1e-9  # of |A1|: a direction that A1 adds to the observable part and that is larger is no rounding
MARGIN = 1e-9  # how far a mode must be inside the stable region to count as one that dies out
FARTHEST = 1e5  # largest entry of A: a zero beyond is one at infinity, and rounding
PLACED = 1e-5  # how far a pole may be from where it was asked for, as a share
NAMED = 0.05  # of the largest entry of a direction: what is worth a name


@dataclass(frozen=True)
class Unknown:
    """A plant as the observer sees it, its states and unknown inputs named."""

    A: Array  # n x n
    B: Array  # n x p
    C: Array  # m x n
    G: Array  # n x q
    states: tuple[str, ...]  # n
    inputs: tuple[str, ...]  # q: names of the unknown inputs and faults
    outputs: tuple[str, ...]  # m
    discrete: bool = False


@dataclass(frozen=True)
class Zero:
    """An invariant zero: x(t) = Re(x e^(st)), f(t) = Re(f e^(st)) that no output shows."""

    value: complex
    state: Array  # n, complex
    input: Array  # q, complex


@dataclass(frozen=True)
class Observer:
    """The gains, with what could and could not be chosen."""

    plant: Unknown
    H: Array  # n x m
    T: Array  # n x n
    A1: Array  # n x n
    K1: Array  # n x m
    F: Array  # n x n
    K2: Array  # n x m
    K: Array  # n x m
    TB: Array  # n x p
    fixed: Array  # complex: poles that no gain moves, the invariant zeros
    free: Array  # complex: poles that were chosen


def augment(plant: Unknown, sensors: Sequence[int], decay_per_s: Sequence[float]) -> Unknown:
    """Faults of sensors as states behind the others: f0' = -decay f0 + alpha, y = C x + f0; alpha is one more unknown input each.

    decay 0 is a bias that moves as it likes; it must not be negative, or what the observer forgets would grow.
    """
    n, r, m = plant.A.shape[0], len(sensors), plant.C.shape[0]
    for s, decay in zip(sensors, decay_per_s, strict=True):
        if decay < 0.0:
            raise InputError(f"fault of sensor '{plant.outputs[s]}': a decay of {decay:g} a second is a fault that grows by itself; give 0 or more")
    A = scipy.linalg.block_diag(plant.A, -np.diag(np.asarray(decay_per_s, dtype=np.float64)).reshape(r, r))
    if plant.discrete:
        A[n:, n:] += np.eye(r)
    C = np.hstack([plant.C, np.eye(m)[:, list(sensors)]])
    G = scipy.linalg.block_diag(plant.G, np.eye(r))
    names = tuple(f"fault of {plant.outputs[s]}" for s in sensors)
    B = np.vstack([plant.B, np.zeros((r, plant.B.shape[1]))])
    changes = tuple(f"change of {x}" for x in names)
    return Unknown(A, B, C, G, plant.states + names, plant.inputs + changes, plant.outputs, plant.discrete)


def rank_of(a: Array) -> int:
    """Rank; rows and columns are brought to length 1 first, so that units do not decide."""
    if not a.size:
        return 0
    a = a / np.maximum(np.linalg.norm(a, axis=0, keepdims=True), 1e-300)
    a = a / np.maximum(np.linalg.norm(a, axis=1, keepdims=True), 1e-300)
    sigma = np.linalg.svd(a, compute_uv=False)
    return int(np.sum(sigma > RANK * sigma[0]))


def observable_part(A: Array, C: Array) -> Array:
    """Orthonormal columns that span what C, C A, C A^2, .. show: n x rank, grown a block at a time so that powers of A are never formed."""
    n, scale = A.shape[0], np.linalg.norm(A)
    V = scipy.linalg.orth(C.T, rcond=RANK)
    while V.shape[1] < n:
        new = A.T @ V
        new = new - V @ (V.T @ new)
        new = new - V @ (V.T @ new)
        U, sigma, _ = np.linalg.svd(new, full_matrices=False)
        more = U[:, sigma > GROWTH * scale]
        if more.shape[1] == 0:
            break
        V = np.linalg.qr(np.hstack([V, more]))[0]
    return np.asarray(V)


def decoupled(plant: Unknown) -> tuple[Array, Array, Array]:
    """H, T and A1; the rank condition must hold."""
    CG = plant.C @ plant.G
    H = plant.G @ np.linalg.solve(CG.T @ CG, CG.T)
    T = np.eye(plant.A.shape[0]) - H @ plant.C
    return H, T, T @ plant.A


def invariant_zeros(plant: Unknown) -> list[Zero]:
    """All s at which [A - sI, G; C, 0] loses column rank, each with the motion that stays hidden.

    A pencil with more rows than columns is squared by a fixed mixture of its rows; what is a zero of the mixture alone is sorted out by its rank.
    """
    n, q, m = plant.A.shape[0], plant.G.shape[1], plant.C.shape[0]
    scale = max(1.0, float(np.abs(plant.A).max()))
    pencil = np.block([[plant.A / scale, plant.G], [plant.C, np.zeros((m, q))]])
    right = scipy.linalg.block_diag(np.eye(n), np.zeros((m, q)))
    pencil[:, n:] /= np.maximum(np.linalg.norm(pencil[:, n:], axis=0), 1e-300)
    if m < q or np.linalg.matrix_rank(pencil - 0.7310585786 * right, tol=1e-11) < n + q:
        return []  # degenerate: hidden motions at every s, which rank CG says already
    mix = np.eye(n + q, n + m) if m == q else np.linalg.qr(np.random.default_rng(1).standard_normal((n + m, n + q)))[0].T
    values = scipy.linalg.eigvals(mix @ pencil, mix @ right)
    zeros = []
    for s in values[np.isfinite(values) & (np.abs(values) < FARTHEST)]:
        _, sigma, Vh = np.linalg.svd(pencil - s * right)
        if sigma[-1] < 1e-9:
            v = np.conj(Vh[-1])
            v = v / v[int(np.argmax(np.abs(v[:n])))]
            length = np.maximum(np.linalg.norm(plant.G, axis=0), 1e-300)
            value = complex(s) * scale
            zeros.append(Zero(0j if abs(value) < 1e-6 * scale else value, v[:n], v[n:] * scale / length))
    return sorted(zeros, key=lambda z: (z.value.real, z.value.imag))


def dies_out(value: complex, discrete: bool) -> bool:
    """Whether a mode with this pole vanishes by itself."""
    return abs(value) < 1.0 - MARGIN if discrete else value.real < -MARGIN


def explain(zero: Zero, plant: Unknown) -> str:
    """An invariant zero in words: which states move, how, and behind which unknown inputs."""
    steady = abs(zero.value - (1.0 if plant.discrete else 0.0)) < 1e-6
    motion = "a constant offset" if steady else "a motion that dies out" if dies_out(zero.value, plant.discrete) else "a motion that does not die out"
    moved = [plant.states[i] for i in np.flatnonzero(np.abs(zero.state) > NAMED * np.abs(zero.state).max())]
    size = np.abs(zero.input) * np.linalg.norm(plant.G, axis=0)
    behind = [plant.inputs[i] for i in np.flatnonzero(size > NAMED * max(float(size.max(initial=0.0)), 1e-12 * float(np.abs(plant.A).max())))]
    where = f"{'z' if plant.discrete else 's'} = {_number(zero.value)}"
    hides = f"hides in the unknown {_listed(behind)}" if behind else "shows in no output"
    return f"zero at {where}: {motion} {'common to' if len(moved) > 1 else 'of'} {_listed(moved)} {hides}"


def _number(s: complex) -> str:
    return f"{s.real:.6g}" if abs(s.imag) < 1e-9 * max(1.0, abs(s)) else f"{s.real:.6g} {'+' if s.imag > 0 else '-'} {abs(s.imag):.6g}i"


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)


def obstacle(plant: Unknown) -> str | None:
    """Why there is no observer, in one line; None where there is one."""
    CG, q = plant.C @ plant.G, plant.G.shape[1]
    if rank_of(plant.G) < q:
        return f"the unknown inputs {_listed(plant.inputs)} act on the states in the same way: they cannot be told apart; name one of them"
    if rank_of(CG) < q:
        hidden = [x for i, x in enumerate(plant.inputs) if rank_of(np.delete(CG, i, 1)) == rank_of(CG)]
        how, cure = ("apart", "measure what they move") if len(hidden) > 1 else ("at all", "measure what it moves")
        return f"rank CG is {rank_of(CG)}, of {q} unknown inputs: the rate of no output tells {_listed(hidden)} {how}; {cure}"
    A1 = decoupled(plant)[2]
    V = observable_part(A1, plant.C)
    stuck = [s for s in fixed_modes(A1, V) if not dies_out(s, plant.discrete)]
    if not stuck:
        return None
    zeros = [z for z in invariant_zeros(plant) if not dies_out(z.value, plant.discrete)]
    return explain(zeros[0], plant) if zeros else f"(C, A1) is not detectable: a mode at {_number(stuck[0])} shows in no output"


def fixed_modes(A1: Array, V: Array) -> Array:
    """Poles of the part that V, the observable one, leaves out."""
    N = scipy.linalg.null_space(V.T) if V.shape[1] < A1.shape[0] else np.zeros((A1.shape[0], 0))
    return np.asarray(np.linalg.eigvals(N.T @ A1 @ N) if N.shape[1] else np.zeros(0), dtype=np.complex128)


def free_poles(plant: Unknown) -> int:
    """How many poles can be chosen."""
    return int(observable_part(decoupled(plant)[2], plant.C).shape[1])


def observer(plant: Unknown, poles: Sequence[complex], where: str = "uio") -> Observer:
    """The gains for a choice of the free poles, as many as free_poles(); refused, with the reason, where there is no observer."""
    reason = obstacle(plant)
    if reason is not None:
        raise InputError(f"{where}: no unknown-input observer with {_listed(plant.outputs)}: {reason}")
    A1 = decoupled(plant)[2]
    V = observable_part(A1, plant.C)
    count = V.shape[1]
    if len(poles) != count:
        raise InputError(f"{where}: {len(poles)} poles, {count} can be chosen; " + _fixed_text(fixed_modes(A1, V)))
    bad = [p for p in poles if not dies_out(p, plant.discrete)]
    if bad:
        cure = "inside the unit circle" if plant.discrete else "left of the imaginary axis"
        raise InputError(f"{where}: a pole at {_number(complex(bad[0]))} does not die out; choose it {cure}")
    K1 = V @ _placed(V.T @ A1 @ V, plant.C @ V, np.asarray(poles), where)
    return gains(plant, K1)


def gains(plant: Unknown, K1: Array) -> Observer:
    """The observer of a given K1, a printed one for example."""
    H, T, A1 = decoupled(plant)
    F = A1 - K1 @ plant.C
    K2 = F @ H
    fixed = fixed_modes(A1, observable_part(A1, plant.C))
    poles = list(np.linalg.eigvals(F).astype(np.complex128))
    for s in fixed:
        poles.pop(int(np.argmin([abs(p - s) for p in poles])))
    return Observer(plant, H, T, A1, K1, F, K2, K1 + K2, T @ plant.B, fixed, np.array(poles))


def _fixed_text(fixed: Array) -> str:
    return f"{len(fixed)} are fixed, at {', '.join(_number(complex(s)) for s in fixed)}" if len(fixed) else "none is fixed"


def _placed(A: Array, C: Array, poles: Array, where: str) -> Array:
    """K with the eigenvalues of A - K C at `poles`."""
    if C.shape[0] == C.shape[1] and rank_of(C) == len(A) and np.all(np.isreal(poles)):
        return np.asarray((A - np.diag(poles.real)) @ np.linalg.inv(C))
    from scipy.signal import place_poles  # half the start of every command, if it were taken in above

    try:
        with warnings.catch_warnings():
            # It warns that it could have made the gain less sensitive; whether the poles are where they should be is checked below.
            warnings.simplefilter("ignore", UserWarning)
            K = np.asarray(place_poles(A.T, C.T, poles, rtol=1e-9, maxiter=200).gain_matrix.T)
    except ValueError as error:
        raise InputError(f"{where}: these poles cannot be placed ({error}); take no pole more often than there are outputs, and complex ones in pairs") from error
    found = np.linalg.eigvals(A - K @ C)
    off = max(float(np.abs(found - p).min() / (1 + abs(p))) for p in poles)
    if off > PLACED:
        raise InputError(f"{where}: these poles cannot be placed, one is off by {off:.2g} of itself; spread them")
    return K
