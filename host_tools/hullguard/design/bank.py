"""Certificate banks: duals of the limit's programme collected over simulated faults, and the few of them that together come close to it; platoon, section 7.

A run's limit is the first sample with no explanation left; the dual there, and those of the samples after it, which noise moves less, are candidates.
A candidate is projected on its own support onto the left null space of what it must not see, and scaled to a threshold of 1 at usual radii. The
choice looks at delays over limit, class by class (a class is one fault at one size): what exceeds the limit, relative to it, to a high power, so that no
class is left behind. The first few certificates take the limit as it is; those after them take it as LEAST samples or more, so that limits of one or two
do not dominate. All numbers that leave here are rounded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hullguard.campaign.tasks import Emulator, Tick, each
from hullguard.design.bank_table import full_weight, stored_weight
from hullguard.design.bank_types import BankTable, StoredBank
from hullguard.design.design import Design, usual_radius
from hullguard.design.limit import Explanation, first_unexplained
from hullguard.design.store import Stored
from hullguard.design.window import WindowForm, fault_response, window_form
from hullguard.errors import InputError
from hullguard.model.faults import FaultSpec
from hullguard.model.schema import Model, Reference
from hullguard.model.table import Array

Real = TypeVar("Real", bound=np.floating)

TRAINING = 2**63  # added to a seed: evaluations have the seeds below
RUNS_TASK = 10
DUST = 1e-6  # share of a dual below which the projection has left nothing of it
SUPPORT = 1e-9  # of a dual's largest entry: what is below is the solver's dust
DECOUPLED = 1e-7  # what may be left of O and Gamma after the projection, for a certificate of threshold 1
POWER = 8  # of what exceeds a limit: almost the worst class alone
FIRST_LEAST = 1.0  # samples that a limit counts as at least, in the first stage
LEAST = 5.0  # samples, in the stages after it
WORTH = 1e-9  # share of the cost that a certificate, or an exchange, must save
TIE = 1e-6  # share by which weights may differ that count as equally large
POOL = 6000  # candidates
FIRST_STAGE = 4  # certificates: a bank of 4, 8, 16 .. is as good as the choice can make it, each the beginning of the next


@dataclass(frozen=True)
class BankSpec:
    """What a bank is made for, and how it is trained."""

    window: int  # samples
    size: int  # certificates
    faults: tuple[int, ...]  # indices into the model's faults: what the bank shall find
    references: tuple[Reference, ...]  # how the plant is driven meanwhile
    sizes: tuple[float, ...] = (0.5, 1.0, 2.0)  # of the faults, both signs
    runs: int = 20  # a fault, size, sign and reference
    seed: int = 1
    horizon: int = 45  # samples after the start of a fault within which it counts
    later: int = 3  # duals a run: at the limit and at the samples after it
    hypothesis: int | None = None  # fault of any course that must move no certificate

    @property
    def start(self) -> int:
        """First faulty sample: the window is full, and a start at rest forgotten."""
        return 2 * self.window


@dataclass(frozen=True)
class Case:
    """A class of training runs, or a part of one."""

    fault: int
    size: float
    reference: int
    first: int  # run
    count: int


@dataclass(frozen=True)
class Training:
    """Training runs that have a limit, and the candidates that they gave."""

    group: Array  # runs: number of the class
    limit: Array  # runs: samples after the start of the fault
    value: Array  # runs x (window - 1 + horizon) x signals: from the first sample of the first window on
    radius: Array  # runs x (window - 1 + horizon) x signals
    weight: Array  # candidates x window x outputs, threshold 1 at usual radii

    @property
    def runs(self) -> int:
        """Runs with a limit."""
        return len(self.limit)


@dataclass(frozen=True)
class _Job:
    model: Model
    stored: Stored
    spec: BankSpec


@dataclass(frozen=True)
class _Found:
    """What one task brings home."""

    group: list[int]
    limit: list[int]
    value: list[Array]
    radius: list[Array]
    dual: list[Array]


class _Trainer:
    """A process's emulator and programme."""

    def __init__(self, job: _Job) -> None:
        self.spec = job.spec
        self.emulator = Emulator(job.model, job.stored)
        model = self.emulator.design.model
        self.model = model
        self.programme = Explanation(model, job.spec.window, usual_scale(model), self.emulator.design.varying)
        self.free = None if job.spec.hypothesis is None else model.faults[job.spec.hypothesis]

    def work(self, task: tuple[int, Case]) -> _Found:
        """All runs of a case."""
        spec, (group, case) = self.spec, task
        found = _Found([], [], [], [], [])
        fault = FaultSpec(self.model.faults[case.fault].name, "bias", case.size, spec.start, None)
        begin, end = spec.start - spec.window + 1, spec.start + spec.horizon
        for run in range(case.first, case.first + case.count):
            trace = self.emulator.trace(end, spec.references[case.reference], [fault], TRAINING + spec.seed, run)
            limit = first_unexplained(self.programme, trace, spec.start, end, self.free)
            if limit is None:
                continue
            found.group.append(group)
            found.limit.append(limit)
            sent = len(self.model.signals)  # certificates read nothing that is derived
            found.value.append(trace["value"][begin:, :sent])
            found.radius.append(trace["radius"][begin:, :sent])
            found.dual.extend(self._duals(trace, spec.start + limit))
        return found

    def _duals(self, trace: dict[str, Array], limit: int) -> list[Array]:
        duals = [self.programme.certificate()]
        for k in range(limit + 1, min(limit + self.spec.later, len(trace["value"]))):
            if self.programme.unexplained(trace, k, self.free):
                duals.append(self.programme.certificate())
        return duals


def _work(trainer: _Trainer, task: tuple[int, Case]) -> _Found:
    return trainer.work(task)


def usual_scale(model: Model) -> Array:
    """Usual radius of every output (m), never zero: what the limit's programme counts in."""
    outputs = model.outputs
    return np.asarray(np.maximum(usual_radius(model)[outputs], np.array([model.signals[i].resolution for i in outputs])))


def cases(spec: BankSpec) -> list[tuple[int, Case]]:
    """Number of the class and case of every task; each run of the training has a number of its own."""
    made, first = [], 0
    classes = [(f, s, r) for f in spec.faults for s in spec.sizes for r in range(len(spec.references))]
    for group, (fault, size, reference) in enumerate(classes):
        for sign in (1.0, -1.0):
            for done in range(0, spec.runs, RUNS_TASK):
                count = min(RUNS_TASK, spec.runs - done)
                made.append((group, Case(fault, sign * size, reference, first, count)))
                first += count
    return made


def collect(design: Design, spec: BankSpec, workers: int = 1, tick: Callable[[str, int, int], None] = lambda *_: None) -> Training:
    """Simulated faults with their limits, and every dual as a candidate. The same spec gives the same result with any number of workers."""
    tasks, done = cases(spec), [0]
    what = "certificates" if spec.hypothesis is None else f"certificates without {design.model.faults[spec.hypothesis].name}"

    def count(ended: int) -> None:
        done[0] += ended
        tick(what, done[0], len(tasks))

    plain: Tick = count
    parts = each(_Trainer, _work, _Job(design.model, design.stored, spec), tasks, workers, plain)
    duals = [d for p in parts for d in p.dual]
    names = ", ".join(design.model.faults[f].name for f in spec.faults)
    m = design.model.plant.m
    weight = candidates(design.model, window_form(design.model.plant, spec.window), np.array(duals).reshape(len(duals), spec.window, m), spec.hypothesis)
    if not len(weight):
        raise InputError(f"{design.model.path.name}: no run with a fault of {names} can be told from a healthy one within {spec.horizon} samples: give larger sizes")
    return Training(
        group=np.array([g for p in parts for g in p.group]),
        limit=np.array([x for p in parts for x in p.limit], dtype=np.float64),
        value=np.array([v for p in parts for v in p.value]),
        radius=np.array([r for p in parts for r in p.radius]),
        weight=weight,
    )


def usual_threshold(model: Model, form: WindowForm, weight: Array) -> Array:
    """J of certificates (count x window x outputs) at usual radii, without what rounding adds."""
    full = np.abs(full_weight(model, form, weight))
    return np.asarray(full.sum(1) @ usual_radius(model) + np.abs(weight.reshape(len(weight), -1) @ form.Md).sum(1))


def candidates(model: Model, form: WindowForm, duals: Array, hypothesis: int | None) -> Array:
    """Duals projected, scaled, rounded, each once; count x window x outputs."""
    basis = form.O if hypothesis is None else np.hstack([form.O, fault_response(model, form, model.faults[hypothesis])])
    flat = duals.reshape(len(duals), form.window * model.plant.m)
    made = np.array([project(dual, basis) for dual in flat]).reshape(flat.shape)
    made = made[np.abs(made).max(1, initial=0.0) > DUST * np.abs(flat).max(1, initial=0.0)].reshape(-1, form.window, model.plant.m)
    if not len(made):
        return np.zeros((0, form.window, model.plant.m))
    made /= usual_threshold(model, form, made)[:, None, None]
    flat = made.reshape(len(made), -1)
    # r and -r are the same certificate: the first of its largest weights is positive, and as large as another is what rounding cannot tell apart.
    size = np.abs(flat)
    flat *= np.sign(flat[np.arange(len(flat)), (size >= (1 - TIE) * size.max(1, keepdims=True)).argmax(1)])[:, None]
    kept = flat[np.abs(flat @ basis).max(1) <= DECOUPLED * np.abs(basis).max()]
    rounded = stored_weight(kept).reshape(-1, form.window, model.plant.m)
    _, first = np.unique(rounded.round(5), axis=0, return_index=True)
    # A larger pool costs time and gains nothing.
    first = np.sort(first)
    return rounded[first[:: max(1, -(-len(first) // POOL))]]


def project(w: Array, basis: Array) -> Array:
    """Project: w - Q (Q'Q)^-1 Q'w for the rows Q of the basis where w is not zero: what is zero stays zero."""
    support = np.abs(w) > SUPPORT * np.abs(w).max()
    if not support.any():
        return np.zeros_like(w)
    out, Q = np.where(support, w, 0.0), basis[support]
    # Twice: what the first leaves is rounding of large numbers, what the second leaves rounding of small ones.
    for _ in range(2):
        out[support] -= Q @ np.linalg.lstsq(Q, out[support], rcond=1e-10)[0]
    return out


def first_alarms(model: Model, form: WindowForm, weight: Array, training: Training) -> NDArray[np.float32]:
    """Delay of each certificate in each run: certificates x runs, the horizon where it never alarms."""
    # Single precision is good enough for a choice, and twice as fast.
    full = full_weight(model, form, weight).reshape(len(weight), -1).astype(np.float32)
    size, own = np.abs(full), np.abs(weight.reshape(len(weight), -1) @ form.Md).sum(1)[:, None].astype(np.float32)
    horizon = training.value.shape[1] - form.window + 1
    delays = np.full((len(weight), training.runs), horizon, dtype=np.float32)
    for i in range(training.runs):
        value, radius = (windows(a[i].astype(np.float32), form.window) for a in (training.value, training.radius))
        alarm = np.abs(full @ value.T) > size @ radius.T + own
        delays[:, i] = np.where(alarm.any(1), alarm.argmax(1), horizon)
    return delays


def windows(rows: NDArray[Real], window: int) -> NDArray[Real]:
    """Every window of consecutive rows, flattened with the oldest first: count x (window signals)."""
    view = np.lib.stride_tricks.sliding_window_view(rows, window, axis=0)  # count x signals x window
    return np.ascontiguousarray(view.transpose(0, 2, 1)).reshape(len(view), -1)


class _Cost:
    """What the choice makes small: delay over limit of the classes, relative to the limit or to `least` samples if that is more, to the power POWER, added up."""

    def __init__(self, delays: NDArray[np.float32], training: Training, least: float) -> None:
        classes, count = np.unique(training.group, return_counts=True)
        # Sums of small whole numbers are exact in single precision: no order of addition, and no number of threads, decides a choice.
        self._delays, self._member = delays, (training.group[:, None] == classes).astype(np.float32)
        self._runs, self._limit = count, training.limit @ self._member / count
        self._relative = np.maximum(self._limit, least)

    def means(self, others: Sequence[int]) -> Array:
        """Delay of every candidate added to the others, class by class: candidates x classes, samples."""
        best = np.minimum(self._delays, self._delays[list(others)].min(0)) if others else self._delays
        return np.asarray((best @ self._member).astype(np.float64) / self._runs)

    def __call__(self, others: Sequence[int]) -> Array:
        """Of every candidate added to the others."""
        excess = (self.means(others) - self._limit) / self._relative
        return np.asarray((excess**POWER).sum(1))

    def reached(self, chosen: Sequence[int]) -> float:
        """Of the chosen."""
        return float(self(chosen[:-1])[chosen[-1]])


def select(delays: NDArray[np.float32], training: Training, size: int) -> list[int]:
    """At most `size` certificates in the order of their choice, fewer where no other helps: in stages of 4, 8, 16 .., each greedy, then exchanged one by one."""
    cost, stage = _Cost(delays, training, FIRST_LEAST), FIRST_STAGE
    # An exchange ends where no single one helps, which depends on the start. The first stage, on which all others stand, starts with the best of every class.
    starts = dict.fromkeys(int(i) for i in [cost([]).argmin(), *cost.means([]).argmin(0)])
    chosen = min((_stage([start], 0, min(stage, size), cost) for start in starts), key=lambda end: (cost.reached(end), len(end)))
    cost = _Cost(delays, training, LEAST)
    while len(chosen) == stage < size:
        stage *= 2
        chosen = _stage(chosen, len(chosen), min(stage, size), cost)
    return chosen


def _stage(begun: list[int], fixed: int, size: int, cost: _Cost) -> list[int]:
    """Greedily more certificates while they help, then those behind the first `fixed` exchanged."""
    chosen, reached = list(begun), cost.reached(begun)
    while len(chosen) < size:
        costs = cost(chosen)
        if costs.min() >= reached * (1 - WORTH):
            break
        chosen.append(int(costs.argmin()))
        reached = float(costs.min())
    _exchange(chosen, fixed, cost)
    return chosen


def _exchange(chosen: list[int], fixed: int, cost: _Cost) -> None:
    """Replace certificates behind the first `fixed` by better ones until none is."""
    better = True
    while better:
        better = False
        for i in range(fixed, len(chosen)):
            all_costs = cost([c for j, c in enumerate(chosen) if j != i])
            best = int(all_costs.argmin())
            if all_costs[best] < all_costs[chosen[i]] * (1 - WORTH):
                chosen[i], better = best, True


def make_bank(design: Design, spec: BankSpec, workers: int = 1, tick: Callable[[str, int, int], None] = lambda *_: None) -> StoredBank:
    """Collect and select."""
    model = design.model
    training = collect(design, spec, workers, tick)
    form = window_form(model.plant, spec.window)
    weight = training.weight[select(first_alarms(model, form, training.weight, training), training, spec.size)]
    return StoredBank(spec.window, weight, explained(model, form, weight, spec.hypothesis), spec.hypothesis)


def explained(model: Model, form: WindowForm, weight: Array, hypothesis: int | None) -> int:
    """Mask of the faults that can move a certificate: all but the hypothesis, and those that none sees at all."""
    w = weight.reshape(len(weight), -1)
    return sum(1 << i for i, fault in enumerate(model.faults) if i != hypothesis and (w @ fault_response(model, form, fault)).any())


def shortened(bank: StoredBank, size: int) -> StoredBank:
    """The bank of its first certificates."""
    return replace(bank, weight=bank.weight[:size])


def evaluate(table: BankTable, value: Array, radius: Array) -> tuple[Array, Array]:
    """Residuals r and thresholds J of a bank over held values and radii (samples x signals), from the first full window on: (samples - window + 1) x certificates, in double."""
    weight = np.array(table.weight)[::-1].reshape(-1, table.certificates)  # (window signals) x certificates, the oldest first
    places = list(table.signal)
    r = windows(value[:, places], table.window) @ weight
    J = windows(radius[:, places], table.window) @ (np.abs(weight) * table.widen) + np.array(table.bias)
    return r, J


def alarm_delay(table: BankTable, trace: dict[str, Array], start: int, last: int) -> int | None:
    """Samples from `start` to the first alarm at or after it; None when there is none before `last`."""
    first = max(start - table.window + 1, 0)
    r, J = evaluate(table, trace["value"][first:last], trace["radius"][first:last])
    alarm = np.flatnonzero((np.abs(r) > J).any(1))
    return int(alarm[0]) + first + table.window - 1 - start if len(alarm) else None
