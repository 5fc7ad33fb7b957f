"""From the observers that a model of kind "uio" asks for to generators of the detector, and to tables of all estimates with their radii."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hullguard.core.native_uio import UioTable
from hullguard.design import uio, uio_hull
from hullguard.design.arith import digits, mul, nearest32
from hullguard.design.checks import Check
from hullguard.design.fixed import FixedObserver
from hullguard.design.hull import Linear, Ranges, rounded
from hullguard.design.observer import ObserverMatrices, SubPlant
from hullguard.design.uio_discrete import Discrete, Estimator, between_samples, discretised, estimator, left_inverse, measured, sampled, zero_order_hold
from hullguard.design.uio_inverse import answers, best_rows, within_a_sample
from hullguard.design.uio_types import StoredUio
from hullguard.errors import InputError
from hullguard.model.plant import Plant
from hullguard.model.schema import Model, Observer, Search
from hullguard.model.table import Array
from hullguard.model.uio import DIRECT, DISCRETE, UioSpec, UnknownInputs

OBJECTIVE = "unknown inputs"  # of the observers made here: nothing is searched for
HORIZON_S = 5.0  # over which the answer to a step of a fault is followed
UP = 1 + 1e-9  # what a processor's own last digits may take from a stored bound


@dataclass(frozen=True)
class UioDesign:
    """One observer with all estimates: faults of actuators, faults of sensors, unknown inputs, states."""

    spec: UioSpec
    names: tuple[str, ...]  # estimates
    sub: SubPlant
    linear: Linear
    follows: Array
    given: uio_hull.ModalGiven
    tables: uio_hull.ModalTables
    signal: tuple[int, ...]
    smallest: Array  # faults of the spec: steps that leave the radius of their own estimate
    fixed: FixedObserver | None = None  # the same in fixed point, if there is a form

    @property
    def rows(self) -> Linear:
        """The estimates of faults alone."""
        return replace(self.linear, output=self.linear.output[: len(self.faults)], direct=self.linear.direct[: len(self.faults)])

    @property
    def faults(self) -> tuple[int, ...]:
        """Indices into the model's faults, in the order of the estimates."""
        return (*self.spec.actuators, *self.spec.sensors)


def where_of(model: Model, i: int) -> str:
    """What an error calls an observer."""
    return f"{model.path.name}: detector.uio[{i}]"


def unknown_of(model: Model) -> UnknownInputs:
    """The unknown inputs, which a model of kind "uio" has."""
    assert model.plant.unknown is not None
    return model.plant.unknown


def plant_of(model: Model, spec: UioSpec, with_faults: bool = True) -> uio.Unknown:
    """The continuous plant as an observer sees it: unknown are its actuators' faults, then the unknown inputs, then changes of its sensors' faults."""
    known, plant = unknown_of(model), model.plant
    columns = [model.inputs.index(model.faults[f].signal) for f in spec.actuators] if with_faults else []
    names = tuple(model.faults[f].name for f in spec.actuators) if with_faults else ()
    outputs = tuple(model.signals[model.outputs[k]].name for k in spec.outputs)
    made = uio.Unknown(known.A, known.B, plant.C[list(spec.outputs)], np.hstack([known.B[:, columns], known.G]), plant.states, names + known.names, outputs)
    return uio.augment(made, _sensor_rows(model, spec), spec.decay) if with_faults else made


def _sensor_rows(model: Model, spec: UioSpec) -> list[int]:
    read = [model.outputs[k] for k in spec.outputs]
    return [read.index(model.faults[f].signal) for f in spec.sensors]


def _the_poles(spec: UioSpec, count: int) -> Array:
    if len(spec.poles) == 3 and spec.poles[2] is None:
        slow, fast = float(np.real(spec.poles[0])), float(np.real(spec.poles[1] or 0.0))
        return -np.geomspace(-slow, -fast, count) if count > 1 else np.array([slow])
    return np.array([complex(p) for p in spec.poles if p is not None])


def _observer(model: Model, spec: UioSpec, where: str) -> uio.Observer:
    plant = plant_of(model, spec)
    if spec.gains is not None:
        return _given(plant, spec, where)
    reason = uio.obstacle(plant)
    if reason is not None:
        raise InputError(f"{where}: no unknown-input observer with {', '.join(plant.outputs)}: {reason}")
    if spec.form != DISCRETE:
        return uio.observer(plant, _the_poles(spec, uio.free_poles(plant)), where)  # type: ignore[arg-type]
    held = sampled(plant, model.sample_time_s)
    reason = uio.obstacle(held)
    if reason is not None:
        raise InputError(f'{where}: at samples of {model.sample_time_s:g} s: {reason}; sample faster, or take form = "first-order hold"')
    return uio.observer(held, np.exp(_the_poles(spec, uio.free_poles(held)) * model.sample_time_s), where)  # type: ignore[arg-type]


def _discrete(model: Model, spec: UioSpec, where: str) -> tuple[Discrete, Array]:
    """What runs, and the poles that no gain moves."""
    if spec.form != DIRECT:
        made = _observer(model, spec, where)
        return discretised(made, model.sample_time_s), made.fixed
    plant = plant_of(model, spec)
    reason = uio.obstacle(plant)
    if reason is not None:
        raise InputError(f"{where}: no unknown-input observer with {', '.join(plant.outputs)}: {reason}")
    try:
        return measured(plant, model.sample_time_s), np.zeros(0)
    except InputError as error:
        raise InputError(f'{where}: form = "direct": {error}') from error


def _given(plant: uio.Unknown, spec: UioSpec, where: str) -> uio.Observer:
    """A chosen F, K and H. T = I - H C; how far T A - F T = K C and T G = 0 are off is bounded, not assumed."""
    assert spec.gains is not None
    if np.linalg.eigvals(spec.gains.F).real.max() >= 0.0:
        raise InputError(f"{where}.gains: F has a pole at {np.linalg.eigvals(spec.gains.F).real.max():.4g}: its observer does not forget; choose another")
    made = uio.gains(plant, np.zeros((len(plant.A), len(plant.C))))
    T = np.eye(len(plant.A)) - spec.gains.H @ plant.C
    return replace(made, F=spec.gains.F, K=spec.gains.K, H=spec.gains.H, T=T, TB=T @ plant.B)


def find(model: Model, i: int, radius: Array, state_range: Array) -> StoredUio:
    """The observer of a specification, rounded for the design file. `radius` (signals): what radii usually are; `state_range` (n)."""
    spec, where = model.uios[i], where_of(model, i)
    refuse_others(model, where)
    n, r, q = model.plant.n, len(spec.sensors), len(spec.actuators)
    d, fixed = _discrete(model, spec, where)
    unknown = range(q, q + len(unknown_of(model).names))
    d = replace(d, P=_left_inverse(model, spec, d, [*range(q), *unknown], radius, state_range))
    e = estimator(d, n, range(q), range(r), unknown, spec.low_pass_s)
    return StoredUio(
        digits(e.state),
        digits(e.input),
        digits(e.output),
        digits(e.direct),
        digits(e.follows),
        digits(_passing(model, e) * UP),
        digits(fixed.real) + 1j * digits(fixed.imag),
    )


def _left_inverse(model: Model, spec: UioSpec, d: Discrete, rows: list[int], radius: Array, state_range: Array) -> Array:
    """P: by the model's trust in the states' equations, or the best for the radii."""
    if spec.trust is not None:
        return left_inverse(d.Gd, np.array([*spec.trust, *[1.0] * len(spec.sensors)]))
    known, read = unknown_of(model), [model.outputs[k] for k in spec.outputs]
    wide = radius[read] + np.array([model.signals[i].noise for i in read])
    low_pass = model.sample_time_s / (spec.low_pass_s + model.sample_time_s)
    moved = within_a_sample(known.A, known.G, known.rate, model.sample_time_s)
    drift = np.vstack([moved, np.zeros((len(spec.sensors), moved.shape[1]))])
    P = left_inverse(d.Gd)
    P[rows] = best_rows(d, rows, np.hstack([answers(d, np.maximum(wide, 1e-12), _held(model, d, state_range), low_pass), drift]))
    return P


def _held(model: Model, d: Discrete, state_range: Array) -> Array:
    """What a hold gets wrong in a sample, and what it lets through of unknown inputs: a bound for each state of the observer."""
    n, known, period = model.plant.n, unknown_of(model), model.sample_time_s
    follows, C, Ad = (d.T - d.K1d @ d.plant.C)[:, :n], d.plant.C[:, :n], d.Ad[:n, :n]
    off = np.abs(follows @ Ad - d.Fd @ follows - (d.Fd @ d.K1d + d.K0) @ C) @ state_range
    return np.asarray(off + np.abs(follows @ zero_order_hold(known.A, known.G, period)[1]) @ known.bound)


def _passing(model: Model, e: Estimator) -> Array:
    """What unknown inputs do to each state of the estimator in a sample: what the hold lets through of their middle, and of their change."""
    known, period = unknown_of(model), model.sample_time_s
    held = np.abs(e.follows @ zero_order_hold(known.A, known.G, period)[1]) @ known.bound
    moved = sum(between_samples(known.A, known.G[:, j], e.follows, period, float(known.rate[j])) for j in range(len(known.names)))
    return np.asarray(np.where(e.exempt, 0.0, held + moved))


def refuse_others(model: Model, where: str) -> None:
    """What rests on unknown inputs that are held within a sample is not sound where they are not."""
    asked = model.detector
    for wish, name in ((asked.bank, "bank"), (asked.isolation, "isolation"), (asked.prediction, "prediction"), (asked.threshold != "exact", "threshold")):
        if wish:
            raise InputError(f"{model.path.name}: detector.{name} cannot be had with inputs that nobody knows, which it would take as held within a sample; remove it")
    if model.plant.interval is not None:
        raise InputError(f"{where}: the plant has intervals (pm); an unknown-input observer is for a certain one; remove them")
    for place in model.outputs:
        if model.signals[place].slew is None:
            raise InputError(f"signal '{model.signals[place].name}': slew = \"reachable\" takes unknown inputs as held within a sample; declare the slew as a list")
    measured = {int(c) for row in model.plant.C for c in np.flatnonzero(row) if np.count_nonzero(row) == 1}
    for k, name in enumerate(model.plant.states):
        if k not in measured and not np.isfinite(model.plant.state_range[k]):
            raise InputError(f"{model.path.name}: plant.state_range: nothing bounds '{name}', which no sensor measures; declare it")


def _sub_plant(model: Model, spec: UioSpec, plant: Plant, radius: Array) -> SubPlant:
    """The plant between samples, without its unknown inputs, which are bounded apart."""
    own = plant.Ed.shape[1] - len(unknown_of(model).names)
    y = list(spec.outputs)
    Sy, Su = radius[[model.outputs[k] for k in y]], radius[model.inputs]
    return SubPlant(plant.A, plant.B, plant.C[y], plant.D[y], plant.Ed[:, :own], plant.Fd[y, :own], Sy, Su)


def finish(model: Model, i: int, found: StoredUio, radius: Array, values: Array, state_range: Array) -> UioDesign:
    """Tables of one observer. `radius` and `values` (signals): what radii usually are, and the largest magnitudes."""
    spec, plant, known = model.uios[i], model.plant, unknown_of(model)
    refuse_others(model, where_of(model, i))  # what only chooses among stored numbers may have changed
    signal = tuple([model.outputs[k] for k in spec.outputs] + model.inputs)
    sub = _sub_plant(model, spec, plant, radius)
    linear, m, n = rounded(found.state, found.input, found.output, found.direct), len(spec.outputs), plant.n
    truth = np.vstack([np.zeros((len(found.output) - n, n)), np.eye(n)])
    ranges = Ranges(np.abs(plant.equilibrium) + plant.initial_range, state_range, values[list(signal)], values[model.inputs], np.zeros(0))
    into = mul(found.follows, sub.Ed) - mul(linear.input[:, :m], sub.Fd)
    passing = uio_hull.Passing(found.passing, into, mul(linear.direct[:, :m], sub.Fd))
    longest = max(g.trigger.interval_max for g in model.groups)
    given = uio_hull.ModalGiven(found.follows, truth, sub, ranges, passing, radius[list(signal)], longest)
    tables = uio_hull.build(linear, given, where_of(model, i))
    names = tuple(model.faults[f].name for f in (*spec.actuators, *spec.sensors)) + known.names + plant.states
    made = UioDesign(spec, names, sub, linear, found.follows, given, tables, signal, np.zeros(0))
    return replace(made, smallest=np.diag(smallest_steps(model, made, made.faults)) if made.faults else np.zeros(0))


def smallest_steps(model: Model, made: UioDesign, faults: tuple[int, ...]) -> Array:
    """Steps of each of these faults that bring each estimate of a fault out of its usual radius: estimates of faults x faults, inf where none does."""
    rows, columns = len(made.faults), []
    for f in faults:
        fault, into_x, into_value = model.faults[f], np.zeros(model.plant.n), np.zeros(len(made.signal))
        if fault.type == "actuator":
            into_x = model.plant.B[:, model.inputs.index(fault.signal)]
        elif fault.signal in made.signal:
            into_value[made.signal.index(fault.signal)] = 1.0
        e, largest, x = np.zeros(len(made.linear.state)), np.zeros(rows), np.zeros(model.plant.n)
        for _ in range(round(HORIZON_S / model.sample_time_s)):
            v = into_value.copy()
            v[: len(made.sub.C)] += made.sub.C @ x
            largest = np.maximum(largest, np.abs((made.linear.output @ e + made.linear.direct @ v)[:rows]))
            e, x = made.linear.state @ e + made.linear.input @ v, model.plant.A @ x + into_x
        columns.append(np.where(largest > 1e-6 * largest.max(), made.tables.steady[:rows] / np.maximum(largest, 1e-300), np.inf))
    return np.array(columns).T.reshape(rows, len(faults))


def matrices(made: UioDesign) -> ObserverMatrices:
    """The rows that are faults, as observer of a detector's generator: G, L and H as they are, W = -output, V and -Qu side by side the direct matrix."""
    linear, m, rows = made.linear, len(made.spec.outputs), len(made.faults)
    order = len(linear.state)
    return ObserverMatrices(
        v=np.zeros((order + 1, m)),
        gamma=np.zeros(order),
        G=linear.state,
        H=linear.input[:, m:],
        L=linear.input[:, :m],
        T=made.follows,
        W=-linear.output[:rows],
        V=linear.direct[:rows, :m],
        Qu=-linear.direct[:rows, m:],
    )


def observer_spec(model: Model, made: UioDesign) -> Observer:
    """The specification under which a detector lists it."""
    search = Search(OBJECTIVE, 1, 1, (0.0, 0.0), (1.0, 1.0), 1.0)
    order = len(made.linear.state)
    return Observer(order, order, len(made.faults), made.spec.outputs, tuple(range(len(model.inputs))), made.faults, False, search, None, None)


def uio_table(made: UioDesign, real: str = "f32") -> UioTable:
    """hg_uio_config for a number type."""
    table = _float_table(made)
    if real != "q31":
        return table
    if made.fixed is None:
        raise InputError(f"the observer of {', '.join(made.names)} has no form in fixed point; use float32")
    parts = ("state", "input", "output", "direct", "weight", "rest", "moving", "mode_decay", "mode_input", "mode_output", "mode_rest", "mode_moving")
    arrays: dict[str, Any] = {part: np.array(getattr(made.fixed.table, part)) for part in parts}
    return replace(table, **arrays, exponents=made.fixed.table.exponents, units=made.fixed.units, signal_units=made.fixed.signal_units)


def _float_table(made: UioDesign) -> UioTable:
    t = made.tables
    return UioTable(
        actuators=len(made.spec.actuators),
        sensors=len(made.spec.sensors),
        unknown=len(made.names) - len(made.faults) - made.follows.shape[1],
        states=made.follows.shape[1],
        signal=made.signal,
        state=made.linear.state,
        input=made.linear.input,
        output=made.linear.output,
        direct=made.linear.direct,
        wide=made.signal,
        weight=t.weight,
        rest=t.rest,
        moving=t.moving,
        ready_rest=t.ready_rest,
        ready_moving=t.ready_moving,
        mode_decay=nearest32(t.mode_decay),
        mode_input=t.mode_input,
        mode_output=t.mode_output,
        mode_rest=t.mode_rest,
        mode_moving=t.mode_moving,
    )


def checks(i: int, made: UioDesign) -> list[Check]:
    """What an observer has to pass beside the checks of all generators."""
    name = f"unknown-input observer {i + 1}: "
    largest = float(np.abs(np.linalg.eigvals(made.linear.state)).max())
    return [Check(name + "largest pole in float32", largest, uio_hull.SLOWEST, "choose faster poles, or a shorter low pass")]
