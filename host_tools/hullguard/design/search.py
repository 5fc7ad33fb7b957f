"""Search of the free parameters of a generator, order, parity vector and poles, for the faults to show best; platoon, section 3.

Poles matter only where W has more rows than residuals are kept: G = G0 + gamma e_s' and L = L0 - gamma v_s feed r0_s = v_s y - z_s back,
which is a combination of r0, and the optimal post-filter undoes every such M(z) with M and its inverse stable and M(infinity) = I. Then all
poles give the same r, and the search leaves them at 0. What does matter is how much of the event error a trigger-aware post-filter is
told: with a larger weight smaller faults show, after more samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from hullguard.design.arith import digits
from hullguard.design.observer import (
    ObserverMatrices,
    PostFilter,
    SubPlant,
    best_rows,
    disturbance_rank,
    fused,
    gamma_of,
    no_filter,
    output_map,
    parity_basis,
    post_filter,
    structure,
    weighted,
)
from hullguard.errors import InputError
from hullguard.model.schema import Observer, Search
from hullguard.model.table import Array

HORIZON = 60  # samples in which a step fault has to show
LAGS = 2048  # of the impulse response that the score adds up
SETTLED = 1e-8
FAR = 0.01  # of its length: how far a chosen parity vector may be from the null space
NOTHING = 1e3  # cost where there is no generator; more than any that there is
INVISIBLE = 1e6  # size of a fault that never shows, for the cost
OTHERS = 0.05  # weight of the mean over all faults beside the hardest one


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
    first: Array  # faults: the same of the first point that the search drew, NaN where there was no search
    weight: float = 1.0  # of the event error in the post-filter


def make(plant: SubPlant, v: Array, gamma: Array, residuals: int, paths: list[FaultPath], aware: bool, quick: bool = False) -> tuple[ObserverMatrices, PostFilter]:
    """Observer and post-filter of a parity vector (s+1 x m) and pole vector (s). Raises LinAlgError or ValueError where there is none."""
    if not quick:
        v, gamma = digits(v), digits(gamma)
    G, H, L, T = structure(plant, v, gamma)
    W, V = output_map(plant, T)
    if W.shape[0] == 0:
        raise np.linalg.LinAlgError("no output map")
    m = plant.C.shape[0]
    count = min(residuals, m, W.shape[0])
    if W.shape[0] > 1:
        count = min(count, max(1, disturbance_rank(plant, G, H, L, T, W, V, aware)))
    responses = [(T @ p.into_x - L @ p.into_value[:m] - H @ p.into_value[m:], p.into_value[:m]) for p in paths]
    W, V = best_rows(W, V, G, responses, count)
    if not quick:
        W, V = digits(W), digits(V)
    Qu = V @ plant.D
    f = post_filter(plant, G, L, H, T, W, V, Qu, aware, quick)
    return ObserverMatrices(v, gamma, G, H, L, T, W, V, Qu), f


def step_ratios(plant: SubPlant, o: ObserverMatrices, f: PostFilter, paths: list[FaultPath], radius: Array) -> Array:
    """|response| / steady threshold at these radii to a unit step of each fault: samples x residuals x faults."""
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
    return np.asarray(np.abs(steps) / J[None, :, None])


def _smallest(ratios: Array) -> Array:
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / ratios.max((0, 1)))


def smallest_faults(plant: SubPlant, o: ObserverMatrices, f: PostFilter, paths: list[FaultPath], radius: Array) -> Array:
    """For each fault the size whose largest response within the horizon equals the steady threshold at these radii."""
    return _smallest(step_ratios(plant, o, f, paths, radius)) if paths else np.zeros(0)


def delays(ratios: Array, size: float) -> Array:
    """For each fault of this size the samples until its response leaves the steady threshold, between samples by a straight line.

    A fault that does not within the horizon counts as horizon x (what its size would have to be) / size, so that a search has a slope to follow.
    """
    largest = size * ratios.max(1)
    found = np.zeros(largest.shape[1])
    for j, course in enumerate(largest.T):
        over = np.flatnonzero(course > 1.0)
        if len(over) == 0:
            found[j] = len(course) * min(1.0 / max(float(course.max()), 1e-300), INVISIBLE)
        elif over[0] > 0:
            k = int(over[0])
            found[j] = k - 1 + (1.0 - course[k - 1]) / (course[k] - course[k - 1])
    return found


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
    return Candidate(o, no_filter(s), np.full(len(paths), float(result.fun)), np.full(len(paths), np.nan))


def fault_delays(plant: SubPlant, o: ObserverMatrices, f: PostFilter, paths: list[FaultPath], radius: Array, size: float) -> Array:
    """delays() of a generator; infinite where the fault does not show within the horizon."""
    if not paths:
        return np.zeros(0)
    found = delays(step_ratios(plant, o, f, paths, radius), size)
    return np.where(found < HORIZON + 1, found, np.inf)


def project(plant: SubPlant, parity: Array, where: str) -> Array:
    """The chosen parity vector without what rounding left outside the null space; refused when that is much."""
    s = parity.shape[0] - 1
    blocks = [plant.C]
    for _ in range(s):
        blocks.append(blocks[-1] @ plant.A)
    basis, flat = np.vstack(blocks), parity.ravel()
    inside = flat - basis @ np.linalg.lstsq(basis, flat, rcond=None)[0]
    off = float(np.linalg.norm(flat - inside) / np.linalg.norm(flat))
    if off > FAR:
        raise InputError(
            f"{where}.parity: {off:.2g} of its length is outside the left null space of [C; CA; ..; CA^{s}], at most {FAR:g} can be rounding; "
            "check the order of rows (v0 first) and outputs, or leave it to the search"
        )
    return inside.reshape(parity.shape)


def poles_from(x: Array, low: float, high: float) -> Array:
    """Any point becomes poles: of each pair of numbers the first is their middle, the second apart on the real line (> 0) or conjugate (< 0).

    Real poles and real parts stay within low .. high, magnitudes below the larger of both.
    """
    half, largest = (high - low) / 2, max(abs(low), abs(high))
    poles: list[complex] = []
    for a, b in zip(x[0::2], np.append(x[1::2], 0.0), strict=False):
        centre = low + half + half * math.tanh(a)
        room = half - abs(centre - low - half) if b > 0 else math.sqrt(max(largest**2 - centre**2, 0.0))
        apart = (room * math.tanh(abs(b))) * (1.0 if b > 0 else 1j)
        poles += [centre + apart, centre - apart]
    return np.array(poles[: len(x)] if len(x) % 2 == 0 else [*poles[: len(x) - 1], poles[-1].real])


class Problem:
    """The free parameters of one order as one vector, and what a point of it costs."""

    def __init__(self, plant: SubPlant, order: int, spec: Observer, paths: list[FaultPath], radius: Array, where: str) -> None:
        self.plant, self.order, self.spec, self.paths, self.radius = plant, order, spec, paths, radius
        self._shape = (order + 1, plant.C.shape[0])
        if spec.parity is None:
            self._basis = parity_basis(plant, order)
            rows = self._basis.shape[0]
            self.free_parity = rows if rows > 1 else 0  # the length of v does not matter
        else:
            v = project(plant, np.array(spec.parity), where)
            self._basis, self.free_parity = v.reshape(1, -1) / np.linalg.norm(v), 0
        self.free_poles = order if spec.poles is None and self._poles_matter() else 0
        low, high = spec.search.event_weight
        self.free_weight = int(spec.aware and low < high and not spec.chosen)
        self.size = self.free_parity + self.free_poles + self.free_weight

    def _poles_matter(self) -> bool:
        """Whether W has more rows than are kept."""
        v = self._basis.sum(0).reshape(self._shape)
        _, _, _, T = structure(self.plant, v, np.zeros(self.order))
        rows = int(output_map(self.plant, T)[0].shape[0])
        return rows > min(self.spec.residuals, int(self.plant.C.shape[0]))

    def draw(self, rng: np.random.Generator) -> Array:
        """A random point."""
        return np.asarray(rng.standard_normal(self.size))

    def parameters(self, x: Array) -> tuple[Array, Array]:
        """Parity vector, of length 1, and pole vector of a point."""
        v = x[: self.free_parity] @ self._basis if self.free_parity else self._basis[0]
        if self.spec.poles is not None:
            poles = np.array(self.spec.poles[: self.order])
        elif self.free_poles:
            poles = poles_from(x[self.free_parity :][: self.free_poles], *self.spec.search.poles)
        else:
            poles = np.zeros(self.order)
        return (v / np.linalg.norm(v)).reshape(self._shape), gamma_of(poles)

    def weight(self, x: Array) -> float:
        """Weight of the event error in the post-filter."""
        low, high = (math.log(w) for w in self.spec.search.event_weight)
        share = (1.0 + math.tanh(x[-1])) / 2 if self.free_weight else 0.0
        return float(f"{math.exp(low + share * (high - low)):.6g}")

    def made(self, x: Array, quick: bool) -> tuple[ObserverMatrices, PostFilter]:
        """Observer and post-filter of a point."""
        return make(weighted(self.plant, self.weight(x)), *self.parameters(x), self.spec.residuals, self.paths, self.spec.aware, quick)

    def cost(self, x: Array) -> tuple[float, Array]:
        """What the search makes small, and the smallest faults."""
        try:
            o, f = self.made(x, quick=True)
            ratios = step_ratios(self.plant, o, f, self.paths, self.radius) if self.paths else np.ones((1, 1, 0))
        except (np.linalg.LinAlgError, ValueError):
            return NOTHING, np.zeros(0)
        smallest = _smallest(ratios)
        if not self.paths:
            return 0.0, smallest
        setting: Search = self.spec.search
        if setting.objective == "delay":
            return math.log(max(float(delays(ratios, setting.size).mean()), 1.0 / INVISIBLE)), smallest
        # Logarithms, so that a fault's unit changes nothing but a constant. Where the hardest fault stays the same the others decide.
        hard = np.log(np.clip(smallest, 1.0 / INVISIBLE, INVISIBLE))
        return float(hard.max() + OTHERS * hard.mean()), smallest


class _SpentError(Exception):
    """The budget of trials is used up."""


class _Trials:
    """Counts trials and keeps the best point."""

    def __init__(self, problem: Problem, tick: Callable[[], None]) -> None:
        self.problem, self._tick, self.left = problem, tick, 0
        self.best: Array | None = None
        self.lowest, self.first = NOTHING, np.zeros(0)

    def __call__(self, x: Array) -> float:
        if self.left == 0:
            raise _SpentError
        self.left -= 1
        self._tick()
        cost, smallest = self.problem.cost(x)
        if cost < self.lowest:
            self.lowest, self.best = cost, x.copy()
        if not self.first.size and cost < NOTHING:
            self.first = smallest
        return cost

    def minimise(self, rng: np.random.Generator, budget: int) -> None:
        """CMA-ES from the best of a few random points, again from others with twice the population while trials are left."""
        import cma  # here: it takes as long to load as all the rest, and few commands search

        self.left += budget
        problem, population = self.problem, 0
        try:
            while problem.size > 1 and problem.paths:
                points = [problem.draw(rng) for _ in range(max(1, budget // 10))]
                if self.best is not None and not population:
                    points[0] = self.best  # a second helping goes on where the first one ended
                start = points[int(np.argmin([self(x) for x in points]))]
                step = 0.5 * float(np.linalg.norm(start)) / math.sqrt(problem.size)
                options = {"randn": lambda *shape: rng.standard_normal(shape), "seed": math.nan, "verbose": -9, "tolfun": 1e-5, "tolx": 1e-5}
                run = cma.CMAEvolutionStrategy(start, step, options | ({"popsize": population} if population else {}))
                while not run.stop():
                    asked = run.ask()
                    run.tell(asked, [self(x) for x in asked])
                population = 2 * int(run.popsize)
            # Without a choice, or with nothing to compare by, the first generator is as good as any.
            while self.best is None or (problem.size == 1 and problem.paths):
                self(problem.draw(rng))
                if problem.size == 0:
                    return
        except _SpentError:
            pass


def search(plant: SubPlant, spec: Observer, paths: list[FaultPath], radius: Array, where: str, tick: Callable[[int, int], None]) -> Candidate:
    """The best generator within the budget of trials; half of it chooses the order where there is a choice. The same seed gives the same result on one machine."""
    orders = [s for s in range(spec.order, spec.order_max + 1) if parity_basis(plant, s).size]
    rng, budget, done = np.random.default_rng(spec.search.seed), spec.search.trials if len(orders) == 1 else max(spec.search.trials, 2 * len(orders)), 0

    def step() -> None:
        nonlocal done
        done += 1
        tick(done, budget)

    trials = [_Trials(Problem(plant, s, spec, paths, radius, where), step) for s in orders]
    share = budget if len(orders) == 1 else budget // (2 * len(orders))
    for t in trials:
        t.minimise(rng, share)
    best = min(trials, key=lambda t: t.lowest)
    if len(orders) > 1 and best.best is not None:
        best.minimise(rng, budget - done)
    if best.best is None:
        raise InputError(f"{where}: found no generator: more trials, other poles or another order may")
    try:
        o, f = best.problem.made(best.best, quick=False)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise InputError(f"{where}: the post-filter of the best generator cannot be solved ({error}); another seed, other poles or another order may do") from error
    first = next(t.first for t in trials if t.best is not None) if best.problem.size else np.full(len(paths), np.nan)
    return Candidate(o, f, smallest_faults(plant, o, f, paths, radius), first, best.problem.weight(best.best))
