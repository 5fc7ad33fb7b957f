"""Which fault it is: a bank for each hypothesis, and which pairs of faults can be told apart at all; platoon, section 7.

Hypothesis j: fault j with any course f_j(k) over the window, and no other. Its bank holds certificates with w'Gamma_j = 0, duals of the programme in
which f_j is free, collected on runs with the other faults. When it alarms no course of fault j explains what is held, and j is no candidate any more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse
from scipy.optimize import linprog

from hullguard.design.bank import BankSpec, make_bank
from hullguard.design.bank_types import StoredBank
from hullguard.design.design import Design, usual_radius
from hullguard.design.limit import equations, folded
from hullguard.design.window import fault_response, no_varying, window_form
from hullguard.errors import InputError
from hullguard.model.schema import Fault, Model

WITHIN = 10  # samples
SEPARATE = 1e-6  # share of a fault's response that must be left outside the span of O and Gamma_j
HELPLESS = 1e-6  # ratio of response to threshold below which a fault of size 1 is never seen
INFEASIBLE = 2  # status of linprog
RANGE = 1e-9  # of the largest singular value: where the span of O and Gamma_j ends


@dataclass(frozen=True)
class Pair:
    """Whether a fault can be told from a hypothesis of another one."""

    truth: int
    hypothesis: int
    separable: bool  # some certificate moves with the fault and not with the hypothesis
    smallest: float | None  # constant fault that is excluded from being the hypothesis within WITHIN samples, at usual radii; None where none is
    reason: str  # why not; empty where they can be told apart


def isolability(model: Model, window: int, faults: tuple[int, ...], within: int = WITHIN, tick: Callable[[str, int, int], None] = lambda *_: None) -> list[Pair]:
    """Every ordered pair of the given faults."""
    pairs: list[Pair] = []
    every = separable(model, window, faults)
    for (i, j), apart in every.items():
        tick("pairs of faults", len(pairs), len(every))
        truth, hypothesis = model.faults[i], model.faults[j]
        smallest = _smallest(model, window, truth, hypothesis, within) if apart else None
        pairs.append(Pair(i, j, apart, smallest, _reason(truth.name, hypothesis.name, apart, smallest, within)))
    return pairs


def separable(model: Model, window: int, faults: tuple[int, ...]) -> dict[tuple[int, int], bool]:
    """For every (truth, hypothesis): is there a w with w'O = 0, w'Gamma_hypothesis = 0 and w'Gamma_truth not 0."""
    form = window_form(model.plant, window)
    response = {i: fault_response(model, form, model.faults[i]) for i in faults}
    found = {}
    for j in faults:
        U, sigma, _ = np.linalg.svd(np.hstack([form.O, response[j]]), full_matrices=False)
        span = U[:, sigma > RANGE * sigma[0]]
        for i in faults:
            if i != j:
                left = response[i] - span @ (span.T @ response[i])
                found[i, j] = bool(np.abs(left).max() > SEPARATE * np.abs(response[i]).max())
    return found


def _reason(truth: str, hypothesis: str, separable: bool, smallest: float | None, within: int) -> str:
    if not separable:
        return f"whatever {truth} does, some course of {hypothesis} shows the same in every output: together they have the rank of {hypothesis} alone"
    return "" if smallest is not None else f"a constant {truth} of no size is told from {hypothesis} within {within} samples"


def _smallest(model: Model, window: int, truth: Fault, hypothesis: Fault, within: int) -> float | None:
    """Size 1 / t of a constant fault whose response, begun 0 .. `within` samples ago, no course of the hypothesis explains with all bounds times less than t."""
    best = max(_least_scale(model, window, truth, hypothesis, ago) for ago in range(min(within + 1, window)))
    return 1.0 / best if best > HELPLESS else None


def _least_scale(model: Model, window: int, truth: Fault, hypothesis: Fault, ago: int) -> float:
    """Least t such that the response to a fault of size 1 since `ago` samples has an explanation with all radii and disturbances times t."""
    plant, usual, errors = model.plant, usual_radius(model), folded(model.plant, no_varying(model.plant))
    x, y = equations(plant, errors, window)
    course = np.zeros(window)
    course[window - 1 - ago :] = 1.0
    into_x, into_y = np.zeros(plant.n), np.zeros(plant.m)
    if truth.signal in model.outputs:
        into_y[model.outputs.index(truth.signal)] = 1.0
    else:
        column = model.inputs.index(truth.signal)
        into_x, into_y = plant.B[:, column], plant.D[:, column]
    target = np.concatenate([np.outer(course[:-1], into_x).ravel(), np.outer(course, into_y).ravel()])
    output, error = usual[model.outputs] + errors.slack_y, np.concatenate([usual[model.inputs], np.ones(errors.fixed)])
    if hypothesis.signal in model.outputs:
        output[model.outputs.index(hypothesis.signal)] = np.inf
    else:
        error[model.inputs.index(hypothesis.signal)] = np.inf
    states = window * plant.n
    own = scipy.sparse.hstack([scipy.sparse.csr_matrix((window * len(error), states)), scipy.sparse.identity(window * len(error))])
    rows = scipy.sparse.vstack([x, y, own]).tocsr()
    target = np.concatenate([target, np.zeros(window * len(error))])
    bound = np.concatenate([np.tile(errors.slack_x, window - 1), np.tile(output, window), np.tile(error, window)])
    kept = np.isfinite(bound)
    rows, target, t = rows[kept], target[kept], scipy.sparse.csr_matrix(bound[kept][:, None])
    A = scipy.sparse.vstack([scipy.sparse.hstack([rows, -t]), scipy.sparse.hstack([-rows, -t])])
    cost = np.zeros(A.shape[1])
    cost[-1] = 1.0
    free: list[tuple[float | None, float | None]] = [(None, None)] * (A.shape[1] - 1)
    found = linprog(cost, A_ub=A, b_ub=np.concatenate([target, -target]), bounds=[*free, (0, None)], method="highs")
    if found.status == INFEASIBLE:
        return np.inf  # equations without slack: the fault is seen whatever its size
    if found.status != 0:
        raise RuntimeError(f"the linear programme of a pair of faults ended with: {found.message}")
    return float(found.fun)


def hypotheses(model: Model, spec: BankSpec) -> list[BankSpec]:
    """A bank's spec for each fault of the given one, trained on the other faults that can be told from it."""
    apart = separable(model, spec.window, spec.faults)
    made = []
    for j in spec.faults:
        others = tuple(i for i in spec.faults if apart.get((i, j), False))
        if others:
            made.append(replace(spec, hypothesis=j, faults=others))
    return made


def isolation_banks(design: Design, spec: BankSpec, workers: int = 1, tick: Callable[[str, int, int], None] = lambda *_: None) -> list[StoredBank]:
    """One bank a hypothesis; `spec.size` is certificates a bank, `spec.faults` the faults to be told apart."""
    found = [make_bank(design, s, workers, tick) for s in hypotheses(design.model, spec)]
    if not found:
        raise InputError(f"{design.model.path.name}: none of its faults can be told from another: measure more")
    return found
