"""Search of the free parameters of a generator, parity vector and poles, for the smallest fault that shows; platoon, section 3."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from hullguard.design.arith import digits
from hullguard.design.observer import ObserverMatrices, PostFilter, SubPlant, best_rows, fused, gamma_of, no_filter, output_map, post_filter, structure
from hullguard.errors import InputError
from hullguard.model.schema import Search
from hullguard.model.table import Array

HORIZON = 60  # samples in which a step fault has to show
LAGS = 2048  # of the impulse response that the score adds up
SETTLED = 1e-8


@dataclass(frozen=True)
class FaultPath:
    """How a unit step of one fault enters: into x by `into_x`, or into the value of one output or input."""

    into_x: Array  # n
    into_value: Array  # width of [y; u]


@dataclass(frozen=True)
class Candidate:
    """One point of the search with its score."""

    observer: ObserverMatrices
    filter: PostFilter
    smallest: Array  # faults: size whose response reaches the threshold, inf where it never does


def make(plant: SubPlant, v: Array, poles: Array, residuals: int, paths: list[FaultPath], aware: bool) -> tuple[ObserverMatrices, PostFilter]:
    """Observer and post-filter of a parity vector (s+1 x m) and poles (s). Raises LinAlgError or ValueError where there is none."""
    v = digits(v)
    gamma = digits(gamma_of(poles))
    G, H, L, T = structure(plant, v, gamma)
    W, V = output_map(plant, T)
    if W.shape[0] == 0:
        raise np.linalg.LinAlgError("no output map")
    m = plant.C.shape[0]
    responses = [(T @ p.into_x - L @ p.into_value[:m] - H @ p.into_value[m:], p.into_value[:m]) for p in paths]
    W, V = best_rows(W, V, G, responses, min(residuals, m))
    W, V = digits(W), digits(V)
    Qu = V @ plant.D
    f = post_filter(plant, G, L, H, T, W, V, Qu, aware)
    return ObserverMatrices(v, gamma, G, H, L, T, W, V, Qu), f


def smallest_faults(plant: SubPlant, o: ObserverMatrices, f: PostFilter, paths: list[FaultPath], radius: Array) -> Array:
    """For each fault the size whose largest response within the horizon equals the steady threshold at these radii."""
    if not paths:
        return np.zeros(0)
    state, inputs, output, direct = fused(o, f)
    m = plant.C.shape[0]
    Bd = o.T @ plant.Ed - inputs[:, :m] @ plant.Fd
    errors = np.hstack([Bd, inputs * radius])
    # e = T x - z: a fault enters it by x, or with the other sign by the value that z reads; r = -output e + direct value.
    into_e = [o.T @ p.into_x - inputs @ p.into_value for p in paths]
    block = np.hstack([errors, *(c[:, None] for c in into_e)])
    P, step = output[None], state
    while P.shape[0] < LAGS and (P.shape[0] < HORIZON or np.abs(P[-1]).max() > SETTLED * np.abs(output).max()):
        P, step = np.concatenate([P, P @ step]), step @ step
    R = P @ block
    J = np.abs(direct[:, :m] @ plant.Fd).sum(1) + np.abs(direct * radius).sum(1) + np.abs(R[:, :, : errors.shape[1]]).sum((0, 2))
    answers = -R[:HORIZON, :, errors.shape[1] :]
    at_once = np.array([direct @ p.into_value for p in paths]).T
    steps = np.concatenate([at_once[None], at_once + answers.cumsum(0)])
    peak = (np.abs(steps) / J[None, :, None]).max((0, 1))
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / peak)


def between_events(plant: SubPlant, order: int, paths: list[FaultPath], quantum: Array, spoken: Array) -> Candidate:
    """The parity vector that sees a step between two frames best: a linear programme instead of a search.

    Deadbeat (gamma = 0) and without a post-filter, r = v_s y - z_s is a difference between now and `order` samples ago. Its threshold is
    least when the signals in `spoken` were sent at both ends (radius `quantum` there, the usual one in between), and the largest step is asked
    to show with size 1: min J(v) such that v' O = 0 and the sum of the newest sample's answers is 1.
    """
    if not any(path.into_value[: plant.C.shape[0]].any() for path in paths):
        raise InputError('objective "between events" needs a fault of one of the generator\'s outputs: name it in its faults')
    m, s = plant.C.shape[0], order
    n, nd, p = plant.A.shape[0], plant.Ed.shape[1], plant.B.shape[1]
    O, Md, Mu = np.zeros((s + 1, m, n)), np.zeros((s + 1, m, s + 1, nd)), np.zeros((s + 1, m, s + 1, p))
    into_d, into_u, power = plant.Fd, plant.D, np.eye(n)
    for lag in range(s + 1):
        O[lag] = plant.C @ power
        for k in range(s + 1 - lag):
            Md[k + lag, :, k] = into_d
            Mu[k + lag, :, k] = into_u
        into_d, into_u, power = plant.C @ power @ plant.Ed, plant.C @ power @ plant.B, plant.A @ power
    radius = np.tile(np.concatenate([plant.Sy, plant.Su]), (s + 1, 1))
    for end in (0, s):
        radius[end, spoken] = quantum[spoken]
    rows = (s + 1) * m
    # One bound variable for each term of J: |v_g(j)| ry, |(v' Mu)| ru, |(v' Md)|.
    terms = np.hstack([np.diag(radius[:, :m].ravel()), Mu.reshape(rows, -1) * radius[:, m:].ravel(), Md.reshape(rows, -1)])
    terms = terms[:, np.any(terms, axis=0)]
    count = terms.shape[1]
    answer = sum(path.into_value[:m] for path in paths)
    step = np.zeros(rows)
    step[-m:] = answer
    equal = np.vstack([np.hstack([O.reshape(rows, n).T, np.zeros((n, count))]), np.hstack([step, np.zeros(count)])])
    result = linprog(
        np.concatenate([np.zeros(rows), np.ones(count)]),
        A_ub=np.vstack([np.hstack([terms.T, -np.eye(count)]), np.hstack([-terms.T, -np.eye(count)])]),
        b_ub=np.zeros(2 * count),
        A_eq=equal,
        b_eq=np.concatenate([np.zeros(n), [1.0]]),
        bounds=[(None, None)] * rows + [(0, None)] * count,
        method="highs",
    )
    if result.status != 0:
        raise InputError("no difference over this order shows the fault: choose another order or other outputs")
    v = digits(result.x[:rows].reshape(s + 1, m), 9)
    basis = O.reshape(rows, n)
    # Rounding and the solver's tolerance leave v' O slightly off zero: project back.
    flat = v.ravel() - basis @ np.linalg.lstsq(basis, v.ravel(), rcond=None)[0]
    v = digits(flat.reshape(s + 1, m))
    gamma = np.zeros(s)
    G, H, L, T = structure(plant, v, gamma)
    W = np.zeros((1, s))
    W[0, -1] = 1.0
    V = v[s:]
    o = ObserverMatrices(v, gamma, G, H, L, T, W, V, V @ plant.D)
    return Candidate(o, no_filter(s), np.full(len(paths), float(result.fun)))


def _draw(rng: np.random.Generator, plant: SubPlant, basis: Array, order: int, poles: tuple[float, float]) -> tuple[Array, Array]:
    v = (rng.standard_normal(basis.shape[0]) @ basis).reshape(order + 1, plant.C.shape[0])
    return v, rng.uniform(*poles, order)


def search(
    plant: SubPlant, basis: Array, order: int, residuals: int, paths: list[FaultPath], radius: Array, aware: bool, setting: Search, tick: Callable[[int, int], None]
) -> Candidate:
    """Random trials for two thirds of the budget, then steps around the best; the same seed gives the same result on one machine."""
    rng = np.random.default_rng(setting.seed)
    best: Candidate | None = None
    centre: tuple[Array, Array] | None = None
    step = 0.3
    for trial in range(setting.trials):
        tick(trial + 1, setting.trials)
        if centre is None or 3 * trial < 2 * setting.trials:
            v, poles = _draw(rng, plant, basis, order, setting.poles)
        else:
            dv, _ = _draw(rng, plant, basis, order, setting.poles)
            v = centre[0] + step * np.linalg.norm(centre[0]) / np.linalg.norm(dv) * dv
            poles = np.clip(centre[1] + 0.2 * step * rng.standard_normal(order), *setting.poles)
            step = max(step * 0.995, 0.01)
        try:
            o, f = make(plant, v, poles, residuals, paths, aware)
        except (np.linalg.LinAlgError, ValueError):
            continue
        smallest = smallest_faults(plant, o, f, paths, radius)
        if best is None or (paths and smallest.max() < best.smallest.max()):
            best, centre = Candidate(o, f, smallest), (v, poles)
    if best is None:
        raise InputError("the search found no generator: more trials, other poles or another order may")
    return best
