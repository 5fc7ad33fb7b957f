"""Variable-order observer and optimal post-filter; platoon, sections 2 and 3."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from hullguard.design.arith import mul
from hullguard.errors import InputError
from hullguard.model.table import Array

RANK_TOLERANCE = 1e-10  # of |T|_F, absolute: a default tolerance loses W in one design of eleven
BASIS_LEAST = 1e-3  # length of a projected unit vector that is worth a row of W
POLISH_STEPS = 3  # of Newton's method behind scipy's solution
FORGOTTEN = 1e-6  # what is left of an error of X when the polish ends
SETTLE_STEPS = 3000  # of the recursion, at most
NEWTON_STEPS = 60  # from Lo = 0
DOUBLINGS = 40


@dataclass(frozen=True)
class SubPlant:
    """The part of a plant that one generator sees: all states, some outputs and inputs."""

    A: Array  # n x n
    B: Array  # n x p
    C: Array  # m x n
    D: Array  # m x p
    Ed: Array  # n x nd
    Fd: Array  # m x nd
    Sy: Array  # m: expected event error of each output, for the trigger-aware post-filter
    Su: Array  # p: expected event error of each input


@dataclass(frozen=True)
class ObserverMatrices:
    """z(k+1) = G z + H u + L y, r0 = V y - W z - Qu u with T A - G T = L C, H = T B - L D, V C = W T, Qu = V D."""

    v: Array  # (s+1) x m parity vector
    gamma: Array  # s: last column of G
    G: Array
    H: Array
    L: Array
    T: Array
    W: Array
    V: Array
    Qu: Array


@dataclass(frozen=True)
class PostFilter:
    """R(z) = Mo - Mo W (zI - G + Lo W)^-1 Lo with what its checks need."""

    Lo: Array
    Mo: Array
    X: Array
    S: Array
    Eb: Array
    Fb: Array
    regularised: float  # epsilon added to Fb, 0 in the regular case


def parity_basis(plant: SubPlant, order: int) -> Array:
    """Rows span the left null space of [C; CA; ..; CA^s]."""
    blocks = [plant.C]
    for _ in range(order):
        blocks.append(blocks[-1] @ plant.A)
    return np.asarray(scipy.linalg.null_space(np.vstack(blocks).T).T)


def smallest_order(plant: SubPlant, limit: int) -> int | None:
    """Smallest order with a parity vector."""
    return next((s for s in range(1, limit + 1) if parity_basis(plant, s).size), None)


def gamma_of(poles: Array) -> Array:
    """Last column of the companion matrix with these poles: z^s = gamma_s z^(s-1) + .. + gamma_1."""
    return np.asarray(-np.poly(poles)[::-1][: len(poles)].real)


def structure(plant: SubPlant, v: Array, gamma: Array) -> tuple[Array, Array, Array, Array]:
    """G, H, L, T of a parity vector and a pole vector; sums in index order, so that a stored design gives the same bits everywhere."""
    s = len(gamma)
    G = np.zeros((s, s))
    G[1:, :-1] = np.eye(s - 1)
    G[:, -1] = gamma
    L = -v[:s] - np.outer(gamma, v[s])
    T = np.zeros((s, plant.A.shape[0]))
    block = plant.C
    for j in range(s):
        for i in range(s - j):
            T[i] += mul(v[None, i + j + 1], block)[0]
        block = mul(block, plant.A)
    return G, mul(T, plant.B) - mul(L, plant.D), L, T


def _canonical(N: Array) -> Array:
    """Rows of the one orthonormal basis of the span of N's columns that depends on the span alone: unit vectors projected, the last one first.

    LAPACK's basis turns with the last bits of its input, and Mo = S^(-1/2) and each single residual with it. e_s itself is in the span.
    """
    chosen: list[Array] = []
    for j in reversed(range(N.shape[0])):
        row = N @ N[j]
        for other in chosen:
            row = row - other * (other @ row)
        if len(chosen) < N.shape[1] and np.linalg.norm(row) > BASIS_LEAST:
            chosen.append(row / np.linalg.norm(row))
    return np.array(chosen[::-1]) if len(chosen) == N.shape[1] else N.T


def output_map(plant: SubPlant, T: Array) -> tuple[Array, Array]:
    """All of W (rows span the left null space of T C_perp) and V = W T C'(C C')^-1."""
    s = T.shape[0]
    perp = scipy.linalg.null_space(plant.C)
    if perp.shape[1] == 0:
        W = np.eye(s)
    else:
        U, sigma, _ = np.linalg.svd(T @ perp)
        rank = int(np.sum(sigma > RANK_TOLERANCE * np.linalg.norm(T)))
        W = _canonical(U[:, rank:])
    return W, W @ T @ plant.C.T @ np.linalg.inv(plant.C @ plant.C.T)


def best_rows(W: Array, V: Array, G: Array, responses: list[tuple[Array, Array]], count: int) -> tuple[Array, Array]:
    """The `count` combinations of rows of W in which the faults show most; responses are (column into e = T x - z, column into y)."""
    if W.shape[0] <= count:
        return W, V
    columns = []
    for into_e, into_y in responses:
        e = np.zeros(G.shape[0])
        for _ in range(4 * G.shape[0]):
            columns.append(V @ into_y + W @ e)
            e = G @ e + into_e
    U = np.linalg.svd(np.array(columns).T)[0]
    R = U[:, :count].T
    return R @ W, R @ V


def normal_rank(G: Array, W: Array, Eb: Array, Fb: Array) -> int:
    """Normal rank of the transfer matrix from d to r0, at a point where nothing special happens."""
    z = 1.7 + 0.9j
    M = Fb + W @ np.linalg.solve(z * np.eye(G.shape[0]) - G, Eb)
    return int(np.linalg.matrix_rank(M))


def _disturbed(plant: SubPlant, L: Array, H: Array, T: Array, V: Array, Qu: Array, aware: bool) -> tuple[Array, Array]:
    """Eb and Fb: how disturbances, and event errors where `aware`, reach z and r0."""
    Eb, Fb = T @ plant.Ed - L @ plant.Fd, V @ plant.Fd
    if aware:
        Eb = np.hstack([Eb, -L * plant.Sy, -H * plant.Su])
        Fb = np.hstack([Fb, V * plant.Sy, -Qu * plant.Su])
    return Eb, Fb


def weighted(plant: SubPlant, weight: float) -> SubPlant:
    """The plant as its post-filter is to see it: `weight` times the expected event error.

    1 is best for random errors; a hull adds up absolute values, and with more the filter averages longer: smaller faults show.
    """
    return replace(plant, Sy=weight * plant.Sy, Su=weight * plant.Su)


def disturbance_rank(plant: SubPlant, G: Array, H: Array, L: Array, T: Array, W: Array, V: Array, aware: bool) -> int:
    """Rows of r0 that disturbances can move independently: a post-filter for more does not exist."""
    return normal_rank(G, W, *_disturbed(plant, L, H, T, V, V @ plant.D, aware))


def post_filter(plant: SubPlant, G: Array, L: Array, H: Array, T: Array, W: Array, V: Array, Qu: Array, aware: bool, quick: bool = False) -> PostFilter:
    """Co-inner-outer factorisation; with `aware` the event error is one more disturbance. `quick`: good enough to compare candidates."""
    Eb, Fb = _disturbed(plant, L, H, T, V, Qu, aware)
    rows = W.shape[0]
    epsilon = 0.0
    if normal_rank(G, W, Eb, Fb) < rows:
        # The factorisation is singular: noise that no one claims keeps it regular, and the report says so.
        epsilon = 1e-6 * max(float(np.linalg.norm(Fb)), float(np.linalg.norm(Eb)), 1e-12)
        Eb = np.hstack([Eb, np.zeros((Eb.shape[0], rows))])
        Fb = np.hstack([Fb, epsilon * np.eye(rows)])
    if quick:
        return _filter_of(G, W, Eb, Fb, _riccati(G, W, Eb, Fb), epsilon)
    return polished(G, W, Eb, Fb, epsilon)


def _riccati(G: Array, W: Array, Eb: Array, Fb: Array) -> Array:
    """The stabilising solution X of the Riccati equation, as scipy has it."""
    return np.asarray(scipy.linalg.solve_discrete_are(G.T, W.T, Eb @ Eb.T, Fb @ Fb.T, s=Eb @ Fb.T))


def _filter_of(G: Array, W: Array, Eb: Array, Fb: Array, X: Array, epsilon: float) -> PostFilter:
    """Lo, Mo and S of a solution X."""
    S = W @ X @ W.T + Fb @ Fb.T
    S = (S + S.T) / 2
    values, vectors = np.linalg.eigh(S)
    if values[0] <= 0.0:
        raise np.linalg.LinAlgError("S is not positive definite")
    Lo = np.asarray(np.linalg.solve(S, (G @ X @ W.T + Eb @ Fb.T).T).T)
    Mo = vectors @ np.diag(values**-0.5) @ vectors.T
    return PostFilter(Lo, Mo, X, S, Eb, Fb, epsilon)


def polished(G: Array, W: Array, Eb: Array, Fb: Array, epsilon: float) -> PostFilter:
    """The post-filter by Newton's method on a factor of X (X = Z Z'): squares are never formed, so that half the digits are not lost.

    One step: X of the filter Lo in use (a Lyapunov equation), then the Lo that is best for this X. It converges from every stabilising Lo;
    G is stable, so Lo = 0 is one where scipy finds none, as with poles close to the unit circle.
    """
    try:
        Lo, steps = _filter_of(G, W, Eb, Fb, _riccati(G, W, Eb, Fb), epsilon).Lo, POLISH_STEPS
        if np.abs(np.linalg.eigvals(G - Lo @ W)).max() >= 1.0:
            raise np.linalg.LinAlgError("scipy's solution is not the stabilising one")
    except (np.linalg.LinAlgError, ValueError):
        Lo, steps = np.zeros((G.shape[0], W.shape[0])), NEWTON_STEPS
    Z = np.zeros((0, 0))
    for _ in range(steps):
        Z = _lyapunov_factor(G - Lo @ W, Eb - Lo @ Fb)
        before, (root, Lo, _) = Lo, _riccati_step(G, W, Eb, Fb, Z)
        if np.abs(Lo - before).max() <= 1e-12 * np.abs(Lo).max():
            break
    # Newton's steps wander by what squaring G - Lo W loses in companion coordinates; the recursion itself forgets it as the filter forgets.
    forgets = float(np.abs(np.linalg.eigvals(G - Lo @ W)).max())
    if forgets >= 1.0:
        raise np.linalg.LinAlgError("no stabilising solution: disturbances leave a mode on the unit circle unmoved")
    for _ in range(min(SETTLE_STEPS, math.ceil(math.log(FORGOTTEN) / (2 * math.log(max(forgets, 1e-3)))))):
        root, Lo, Z = _riccati_step(G, W, Eb, Fb, Z)
    U, sigma, _ = np.linalg.svd(root)
    if sigma[-1] <= 0.0:
        raise np.linalg.LinAlgError("S is not positive definite")
    return PostFilter(Lo, U @ np.diag(1.0 / sigma) @ U.T, Z @ Z.T, root @ root.T, Eb, Fb, epsilon)


def _riccati_step(G: Array, W: Array, Eb: Array, Fb: Array, Z: Array) -> tuple[Array, Array, Array]:
    """One step of the Riccati recursion on the factor: root of S, Lo, and the next Z."""
    rows = W.shape[0]
    low = _triangle(np.vstack([np.hstack([W @ Z, Fb]), np.hstack([G @ Z, Eb])]))
    root = low[:rows, :rows]  # root root' = S
    return root, np.asarray(np.linalg.solve(root.T, low[rows:, :rows].T).T), low[rows:, rows:]


def _triangle(a: Array) -> Array:
    """Lower triangular T with T T' = a a'."""
    upper = np.asarray(np.linalg.qr(a.T, mode="r"))
    return upper.T


def _lyapunov_factor(F: Array, E: Array) -> Array:
    """Z with Z Z' = sum over j of F^j E E' F'^j, by doubling the number of terms."""
    Z, power = _triangle(E), F
    for _ in range(DOUBLINGS):
        Z = _triangle(np.hstack([Z, power @ Z]))
        power = power @ power
        if np.abs(power).max() < 1e-18:
            return Z
    raise np.linalg.LinAlgError("a pole on the unit circle")


def no_filter(order: int, residuals: int = 1) -> PostFilter:
    """The post-filter that does nothing."""
    empty, same = np.zeros((order, order)), np.eye(residuals)
    return PostFilter(np.zeros((order, residuals)), same, empty, same, np.zeros((order, 0)), np.zeros((residuals, 0)), 0.0)


def fused(o: ObserverMatrices, f: PostFilter) -> tuple[Array, Array, Array, Array]:
    """State, input, output and direct matrices of observer and post-filter in one, signals ordered [y; u]; platoon, section 3."""
    state = o.G - mul(f.Lo, o.W)
    inputs = np.hstack([o.L + mul(f.Lo, o.V), o.H - mul(f.Lo, o.Qu)])
    return state, inputs, -mul(f.Mo, o.W), np.hstack([mul(f.Mo, o.V), -mul(f.Mo, o.Qu)])


def check_parity(plant: SubPlant, order: int, where: str) -> None:
    """Refuse an order that has no parity vector and say which would do. One that has, has them at every larger order."""
    if parity_basis(plant, order).size == 0:
        least = smallest_order(plant, 2 * plant.A.shape[0] + 2)
        cure = f"the smallest order that has one is {least}" if least else "no order has one with these outputs"
        raise InputError(f"{where}: no parity vector at order {order}; {cure}")
