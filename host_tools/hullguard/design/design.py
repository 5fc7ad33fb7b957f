"""From a model to a detector: reach, search, post-filter, checks, tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np

from hullguard.bus.bits import load_bound
from hullguard.design import hull, store, uio_generator, zonotope
from hullguard.design.arith import digits, mul, row_sums, up32
from hullguard.design.bank_table import FAULT_SIZE, bank_table
from hullguard.design.bank_types import BankTable, StoredBank
from hullguard.design.checks import Check, generator_checks, refuse
from hullguard.design.fixed import Modal, lower
from hullguard.design.ids import ERRORS, POLYNOMIAL, SURE, undetected_patterns
from hullguard.design.mismatch import constant_mismatch, disturbed, mismatch_table, uncertain
from hullguard.design.observer import ObserverMatrices, PostFilter, SubPlant, check_parity, fused, no_filter, post_filter, structure, weighted
from hullguard.design.predict import Bounds, predict_table, predicted_groups
from hullguard.design.protection import LISTED, NONE
from hullguard.design.reach import faulty_reach, largest, reach
from hullguard.design.search import FaultPath, between_events, fault_delays, search, smallest_faults
from hullguard.design.statistic import StatisticTable, known_of, statistic_checks, statistic_table
from hullguard.design.store import Stored, StoredObserver
from hullguard.design.tables import (
    GeneratorTable,
    GroupTable,
    MessageTable,
    MismatchTable,
    ModalGeneratorTable,
    PredictTable,
    Tables,
    check_freeze,
    freeze_table,
    group_table,
    message_table,
    rows,
    verdict_table,
)
from hullguard.design.uio_generator import UioDesign
from hullguard.design.uio_hull import ModalTables
from hullguard.design.window import Varying, varying_states
from hullguard.design.zonotope_table import BALL, TRUNCATE, ZonotopeTable
from hullguard.errors import InputError
from hullguard.model.detector import PUBLISHED
from hullguard.model.plant import Feedback
from hullguard.model.schema import GENERATORS_MAX, Model, Observer
from hullguard.model.table import Array

Tick = Callable[[str, int, int], None]  # what is being done, step, of how many
SEEN = 1e9  # a fault that would have to be larger than this does not move a generator


@dataclass(frozen=True)
class Generator:
    """One residual generator with everything it was made from."""

    spec: Observer
    plant: SubPlant
    observer: ObserverMatrices
    filter: PostFilter
    linear: hull.Linear
    given: hull.Given | None  # none of an unknown-input observer
    tables: hull.HullTables
    zonotope: ZonotopeTable | None  # the threshold instead of the hull
    signal: tuple[int, ...]  # places of its signals
    radius: Array  # usual radii of its signals, then of the uncertain states
    smallest: Array  # faults of the spec
    first: Array  # the same of the first point that the search drew, NaN where there was none
    delay: Array  # samples until a fault of the search's size leaves the steady threshold
    blind: Array  # smallest with a post-filter that does not know of the trigger


@dataclass(frozen=True)
class Design:
    """A finished design."""

    model: Model
    stored: Stored
    generators: tuple[Generator, ...]
    tables: Tables
    checks: tuple[Check, ...]
    load_bound: float
    usual: Array  # radii of the whole vector most of the time
    uncertain: tuple[int, ...]  # states whose mismatch is a derived signal, the last ones of the vector
    fixed_rounding: tuple[float, ...]  # residuals of generators, banks: the part of J that is rounding in fixed point; () where there is none
    uios: tuple[UioDesign, ...] = ()  # all estimates of the generators that are unknown-input observers

    @property
    def varying(self) -> Varying:
        """Disturbances whose bounds are the radii of the uncertain states."""
        return varying_states(self.model.plant, self.uncertain)

    def rounding_shares(self, real: str) -> list[float]:
        """What rounding is of the usual threshold, a share a residual of the generators."""
        steady = [float(x) for g in self.generators for x in g.tables.steady]
        lost = self.fixed_rounding if real == "q31" else [float(x) for g in self.generators for x in g.tables.rounding]
        return [x / J for x, J in zip(lost, steady, strict=False)]

    @property
    def judges(self) -> list[str]:
        """What generators and banks are called, in the order of the decision."""
        names = [f"observer {i + 1}" for i in range(len(self.generators))]
        for bank in used_banks(self.model, self.stored):
            names.append(f"bank of {len(bank.weight)}" if bank.hypothesis is None else f"not {self.model.faults[bank.hypothesis].name}")
        return names + [f"polynomial filter of degree {p.degree}" + (", bounded" if p.bounded else "") for p in self.tables.polynomials]


def usual_radius(model: Model, slew: Array | None = None) -> Array:
    """Radius that each signal of the vector has most of the time: its trigger's, at half its activity scale, or its quantisation.

    A periodic sender's is as wide as half its period and its skew let the signal move: `slew` (signals x horizon), or else what is declared.
    """
    radius = np.zeros(len(model.signals))
    for g in model.groups:
        t = g.trigger
        for place, i in enumerate(g.signals):
            s = model.signals[i]
            age = t.interval_max // 2 + g.skew if t.periodic else 0
            if age:
                known = slew[i] if slew is not None else np.array(s.slew or (s.resolution,))
                radius[i] = s.resolution / 2 + float(known[min(age, len(known)) - 1])
            elif t.interval_max > 1:
                radius[i] = float((t.sigma[:, place] + t.delta[:, place] * s.scale / 2).max())
            elif not g.applied_as_sent:
                radius[i] = s.resolution / 2
    return radius


def sub_plant(model: Model, spec: Observer, radius: Array) -> SubPlant:
    """What one generator sees of the plant."""
    plant, y, u = model.plant, list(spec.outputs), list(spec.inputs)
    hidden = [i for i in range(plant.p) if i not in u and (np.any(plant.B[:, i]) or np.any(plant.D[:, i]))]
    places = np.array([model.outputs[i] for i in y], dtype=int)
    inputs = np.array([model.inputs[i] for i in u], dtype=int)
    # An input that the generator does not read is a disturbance as large as its range.
    large = np.array([max(abs(model.signals[model.inputs[i]].low), abs(model.signals[model.inputs[i]].high)) for i in hidden])
    Ed = np.hstack([plant.Ed, plant.B[:, hidden] * large])
    Fd = np.hstack([plant.Fd[y], plant.D[y][:, hidden] * large])
    return SubPlant(plant.A, plant.B[:, u], plant.C[y], plant.D[np.ix_(y, u)], Ed, Fd, radius[places], radius[inputs])


def fault_paths(model: Model, spec: Observer, faults: tuple[int, ...]) -> list[FaultPath]:
    """How unit steps of the named faults reach a generator; faults of signals it does not read have no path of their own."""
    plant, paths = model.plant, []
    for f in faults:
        fault = model.faults[f]
        into_x, into_value = np.zeros(plant.n), np.zeros(len(spec.outputs) + len(spec.inputs))
        if fault.type == "actuator":
            column = model.inputs.index(fault.signal)
            into_x = plant.B[:, column].copy()
            into_value[: len(spec.outputs)] = plant.D[list(spec.outputs), column]
        elif fault.signal in model.outputs:
            column = model.outputs.index(fault.signal)
            if column in spec.outputs:
                into_value[spec.outputs.index(column)] = 1.0
        else:
            column = model.inputs.index(fault.signal)
            if column in spec.inputs:
                into_value[len(spec.outputs) + spec.inputs.index(column)] = 1.0
        paths.append(FaultPath(into_x, into_value))
    return paths


def observed(sub: SubPlant, paths: list[FaultPath]) -> tuple[SubPlant, list[FaultPath]]:
    """The states that the outputs depend on, and what moves them: in a long platoon a search has to look at nothing else."""
    seen = np.any(sub.C, axis=0)
    for _ in range(sub.A.shape[0]):
        seen = seen | np.any(sub.A[seen], axis=0)
    felt = np.any(sub.Ed[seen], axis=0) | np.any(sub.Fd, axis=0)
    part = replace(sub, A=sub.A[np.ix_(seen, seen)], B=sub.B[seen], C=sub.C[:, seen], Ed=sub.Ed[np.ix_(seen, felt)], Fd=sub.Fd[:, felt])
    return part, [FaultPath(p.into_x[seen], p.into_value) for p in paths]


def _spoken(model: Model, spec: Observer) -> tuple[Array, Array]:
    """Radius of each signal of a generator when it has just been sent, and the places of those that are sent together with a faulty one."""
    places = [model.outputs[k] for k in spec.outputs] + [model.inputs[k] for k in spec.inputs]
    quantum = np.array([model.signals[i].resolution / 2 for i in places])
    faulty = {model.faults[f].signal for f in spec.faults}
    together = {s for g in model.groups if faulty & set(g.signals) for s in g.signals}
    return quantum, np.array([n for n, i in enumerate(places) if i in together], dtype=int)


def check_observable(model: Model) -> None:
    """Refuse a plant with a state that no output shows."""
    plant = model.plant
    blocks = [plant.C]
    for _ in range(plant.n - 1):
        blocks.append(blocks[-1] @ plant.A)
    _, sigma, Vt = np.linalg.svd(np.vstack(blocks))
    rank = int(np.sum(sigma > 1e-9 * sigma[0]))
    if rank < plant.n:
        worst = plant.states[int(np.argmax(np.abs(Vt[rank:]).max(0)))]
        raise InputError(f"{model.path.name}: the plant is not observable: the outputs do not show {plant.n - rank} of {plant.n} states, '{worst}' among them; measure it")
    if np.linalg.matrix_rank(plant.C) < plant.m:
        raise InputError(f"{model.path.name}: two outputs measure the same combination of states (C has not full row rank); drop one")


def find(model: Model, tick: Tick) -> Stored:
    """All that needs a search or a solver, rounded for the design file."""
    if not model.uios:
        check_observable(model)
    horizon = max(g.horizon for g in model.groups)
    plant = replace(model.plant, A=digits(model.plant.A), B=digits(model.plant.B), dA=digits(model.plant.dA), dB=digits(model.plant.dB))
    if plant.feedback is not None:
        plant = replace(plant, feedback=Feedback(digits(plant.feedback.gain), plant.feedback.reference_bound))
    model = replace(model, plant=plant)
    reached = reach(model, horizon)
    if model.detector.isolation is not None:
        # A hypothesis must not be excluded because its fault moves the plant faster than a healthy one moves.
        reached = replace(faulty_reach(model, reached), signal=reached.signal)
    model = _disturbed(model, reached.state, reached.signal)
    radius = usual_radius(model, reached.slew)
    observers = tuple(_found(model, i, radius, tick) for i in range(len(model.observers)))
    dA, dB = (plant.dA, plant.dB) if uncertain(model) else (None, None)
    gain = plant.feedback.gain if plant.feedback is not None else None
    uios = tuple(uio_generator.find(model, i, radius, reached.state) for i in range(len(model.uios)))
    return Stored(model.sha256, plant.A, plant.B, gain, digits(reached.state), digits(reached.signal), digits(reached.slew), observers, dA, dB, uios=uios)


def _found(model: Model, i: int, radius: Array, tick: Tick) -> StoredObserver:
    """One generator of a model, searched for as far as the model does not choose it."""
    spec = model.observers[i]
    sub, where = sub_plant(model, spec, radius), f"{model.path.name}: detector.observers[{i}]"
    check_parity(sub, spec.order_max, where)
    paths = fault_paths(model, spec, spec.faults)
    if spec.filtered:
        seen, paths = observed(sub, paths)
        best = search(seen, spec, paths, np.concatenate([sub.Sy, sub.Su]), where, partial(tick, f"generator {i + 1} of {len(model.observers)}"))
    else:
        best = between_events(sub, spec.order, paths, *_spoken(model, spec))
    o, f = best.observer, best.filter
    return StoredObserver(o.v, o.gamma, o.W, o.V, digits(f.Lo), digits(f.Mo), f.regularised, digits(best.smallest, 6), digits(best.first, 6), best.weight)


def refilter(model: Model, old: Stored) -> Stored:
    """A stored design for a model whose triggers, bounds or ranges have changed: parity vectors and poles stay, the rest is made anew."""
    fresh = replace(model, observers=())
    found = find(fresh, lambda *_: None)
    radius = usual_radius(model, found.slew)
    same = _disturbed(replace(model, plant=replace(model.plant, A=found.A, B=found.B)), found.state_range, found.signal_reach)
    observers = []
    for i, (spec, stored) in enumerate(zip(model.observers, old.observers, strict=True)):
        if spec.chosen:
            observers.append(_found(same, i, radius, lambda *_: None))
            continue
        sub = sub_plant(same, spec, radius)
        G, H, L, T = structure(sub, stored.v, stored.gamma)
        if not spec.filtered:
            observers.append(stored)
            continue
        Qu = stored.V @ sub.D
        f = post_filter(weighted(sub, stored.weight), G, L, H, T, stored.W, stored.V, Qu, spec.aware)
        o = ObserverMatrices(stored.v, stored.gamma, G, H, L, T, stored.W, stored.V, Qu)
        paths = fault_paths(model, spec, spec.faults)
        smallest = smallest_faults(sub, o, f, paths, np.concatenate([sub.Sy, sub.Su]))
        # What the search first drew for other bounds says nothing about these.
        none = np.full(len(paths), np.nan)
        observers.append(replace(stored, Lo=digits(f.Lo), Mo=digits(f.Mo), regularised=f.regularised, smallest=digits(smallest, 6), first=none))
    return replace(found, observers=tuple(observers), banks=old.banks)


def _fits(model: Model, old: Stored) -> bool:
    """Whether the stored parity vectors can serve this model: same plant, same shapes."""
    same_plant = old.A.shape == model.plant.A.shape and np.allclose(old.A, model.plant.A, 0, 1e-12) and np.allclose(old.B, model.plant.B, 0, 1e-12)
    return bool(same_plant and len(old.observers) == len(model.observers) and all(map(_serves, old.observers, model.observers)))


def _serves(o: StoredObserver, spec: Observer) -> bool:
    """Whether a stored generator has the shapes of a specification, or is not needed. Half a choice is no reason to keep the other half."""
    if spec.chosen:
        return True
    fits = spec.order <= o.v.shape[0] - 1 <= spec.order_max and o.v.shape[1] == len(spec.outputs) and o.W.shape[0] <= spec.residuals
    return fits and spec.parity is None and spec.poles is None


def _searched(model: Model, fresh: bool, tick: Tick) -> tuple[Stored, bool]:
    """All but the banks."""
    old = None if fresh else store.read(store.path_of(model.path))
    if old is not None:
        if old.model_sha256 == model.sha256:
            return old, True
        if _fits(model, old):
            return refilter(model, old), False
    return find(model, tick), False


def finish(model: Model, stored: Stored) -> Design:
    """Checks and tables from a model and its stored numbers: plain arithmetic."""
    plant = replace(model.plant, A=stored.A, B=stored.B)
    if stored.dA is not None and stored.dB is not None:
        plant = replace(plant, dA=stored.dA, dB=stored.dB)
    if stored.gain is not None and plant.feedback is not None:
        plant = replace(plant, feedback=Feedback(stored.gain, plant.feedback.reference_bound))
    specs = tuple(replace(s, order=len(o.gamma), order_max=len(o.gamma)) for s, o in zip(model.observers, stored.observers, strict=True))
    model = replace(model, plant=plant, observers=specs)
    groups = tuple(group_table(model, g, stored.slew) for g in model.groups)
    derived = _derived(model, stored, groups)
    values = np.array([largest(model, stored.signal_reach, i) for i in range(len(model.signals))])
    uios = tuple(uio_generator.finish(model, i, u, derived.usual, values, stored.state_range) for i, u in enumerate(stored.uios))
    generators = tuple(_generator(model, i, stored, derived) for i in range(len(model.observers))) + tuple(_uio_generator(model, u) for u in uios)
    known = known_of(groups, derived.usual.tolist())
    polynomials = tuple(statistic_table(model, spec, known) for spec in model.polynomials)
    tables = _tables(model, groups, generators, derived, _banks(model, stored, derived), polynomials)
    _unique_ids(model, tables)
    bound = load_bound(tables, model.bitrate_bps, model.sample_time_s, model.data_bitrate_bps)
    checks = [c for i, u in enumerate(uios) for c in uio_generator.checks(i, u)]
    checks += [c for i, g in enumerate(generators[: len(model.observers)]) for c in generator_checks(i, g.plant, g.observer, g.filter, g.linear, g.spec.filtered)]
    checks += statistic_checks(model, known) + _model_checks(model, stored, tables, bound, generators)
    refuse(model.path.name, checks)
    tables, lost, uios = _fixed(model, generators, tables, uios)
    return Design(model, stored, generators, tables, tuple(checks), bound, derived.usual, derived.states, lost, uios)


def _fixed(model: Model, generators: tuple[Generator, ...], tables: Tables, uios: tuple[UioDesign, ...]) -> tuple[Tables, tuple[float, ...], tuple[UioDesign, ...]]:
    """Tables and observers with those for fixed point, or with the reason why there are none; and what rounding costs there, in residual units."""
    given, modal = tuple(g.given for g in generators if g.given is not None), tuple(Modal(u.linear, u.given, u.tables) for u in uios)
    try:
        made = lower(tables, tuple(g.linear for g in generators), given, tuple(g.tables for g in generators), model.path.name, modal)
    except InputError as reason:
        return replace(tables, not_fixed=str(reason)), (), uios
    return replace(tables, fixed=made.tables), made.rounding, tuple(replace(u, fixed=f) for u, f in zip(uios, made.observers, strict=True))


def _unique_ids(model: Model, tables: Tables) -> None:
    """Refuse two messages that a checksum cannot tell apart. Those of a vehicle are as they are."""
    vehicles = {g.name for g in model.groups if g.frame.wire is not None}
    frozen = [tables.freeze.request, tables.freeze.response] if tables.freeze else []
    messages = [m for m in ([g.message for g in tables.groups] + [tables.verdict, tables.status] + frozen) if m.protection.profile != NONE]
    for a, b in combinations(messages, 2):
        p, q = a.protection, b.protection
        if {a.name, b.name} <= vehicles or POLYNOMIAL[p.profile] != POLYNOMIAL[q.profile] or (p.data_ids, p.data_id) != (q.data_ids, q.data_id):
            continue
        same = f"fold to the same byte 0x{p.data_ids[0]:02X}" if p.data_ids else f"are the same, 0x{p.data_id:X}"
        raise InputError(f"{model.path.name}: messages '{a.name}' and '{b.name}' have data ids that {same}; give one another data_id")


def _disturbed(model: Model, state: Array, signal: Array) -> Model:
    """The model with its intervals as a bounded disturbance. `state` (n) and `signal` (signals) are of its reach."""
    return disturbed(model, state, np.array([largest(model, signal, i) for i in range(len(model.signals))]))


@dataclass(frozen=True)
class Derived:
    """The signals that the detector computes from the sent ones, and what the radii usually are."""

    predictors: tuple[PredictTable, ...]
    place: dict[int, int]  # of a sent signal: where its tighter twin is
    mismatch: MismatchTable | None
    uncertain: tuple[int, ...]  # places of the uncertain states' radii
    states: tuple[int, ...]  # and the states
    usual: Array  # width: of the whole vector
    late: Array  # width: one sample after a frame that did not come
    largest: Array  # uncertain states: radius at most


def rewind_of(model: Model, place: int) -> int:
    """How far back the radius of a signal may still be rewritten: of a derived one, whatever it is derived from."""
    own = [g.trigger.interval_max for g in model.groups if place in g.signals or place >= len(model.signals)]
    return max(own) - 1


def _derived(model: Model, stored: Stored, groups: tuple[GroupTable, ...]) -> Derived:
    usual, place = usual_radius(model, stored.slew), {}
    values = np.array([largest(model, stored.signal_reach, i) for i in range(len(model.signals))])
    spread = constant_mismatch(model, stored.state_range, values)
    bounds = Bounds(stored.state_range, values[model.inputs], spread)
    predictors = tuple(predict_table(model, i, groups, bounds) for i in predicted_groups(model)) if model.detector.prediction else ()
    for p in predictors:
        for n in range(len(p.output)):
            place[p.first + n] = len(usual) + n
        # Between events a signal is as old as half its longest interval, when nothing is known of its motion.
        middle = p.radius[(groups[p.group].interval_max - 1) // 2]
        usual = np.concatenate([usual, np.minimum(usual[p.first : p.first + len(p.output)], middle)])
    late = np.concatenate([g.slew[0] for g in groups] + [np.array(p.radius[0]) for p in predictors])
    if not uncertain(model):
        return Derived(predictors, place, None, (), (), usual, late, np.zeros(0))
    table, states = mismatch_table(model, stored.state_range)
    scale = np.array([s.scale for s in model.signals]) / 2  # what a signal usually is, as for its trigger
    own = np.array(table.constant) + mul(np.array(table.gain), (scale + usual_radius(model, stored.slew))[list(table.signal), None])[:, 0]
    places = tuple(range(len(usual), len(usual) + len(states)))
    return Derived(predictors, place, table, places, states, np.concatenate([usual, own]), np.concatenate([late, own]), spread[list(states)])


def _generator(model: Model, i: int, stored: Stored, derived: Derived) -> Generator:
    spec, found = model.observers[i], stored.observers[i]
    outputs, inputs = [model.outputs[k] for k in spec.outputs], [model.inputs[k] for k in spec.inputs]
    radius = derived.usual[: len(model.signals)].copy()
    bounded = sub_plant(_disturbed(model, stored.state_range, stored.signal_reach), spec, radius)
    sub = sub_plant(model, spec, radius)
    G, H, L, T = structure(sub, found.v, found.gamma)
    o = ObserverMatrices(found.v, found.gamma, G, H, L, T, found.W, found.V, found.V @ sub.D)
    solved = post_filter(weighted(bounded, found.weight), G, L, H, T, found.W, found.V, o.Qu, spec.aware) if spec.filtered else no_filter(spec.order)
    f = replace(solved, Lo=found.Lo, Mo=found.Mo)
    linear = hull.rounded(*fused(o, f))
    plant = model.plant
    values = np.array([largest(model, stored.signal_reach, k) for k in outputs + inputs])
    ranges = hull.Ranges(np.abs(plant.equilibrium) + plant.initial_range, stored.state_range, values, values[len(outputs) :], derived.largest)
    signal = tuple(derived.place.get(k, k) for k in outputs + inputs)
    own = derived.usual[list(signal + derived.uncertain)]
    expected = hull.Expected(own, derived.late[list(signal + derived.uncertain)], tuple(rewind_of(model, k) for k in signal + derived.uncertain))
    given = hull.Given(T, sub, ranges, expected, np.eye(plant.n)[:, list(derived.states)])
    table = hull.build(linear, given, f"{model.path.name}: detector.observers[{i}]")
    ball = _zonotope(model, linear, T, sub, ranges, own, table, signal, derived, f"{model.path.name}: detector.observers[{i}]")
    paths = fault_paths(model, spec, spec.faults)
    blind = np.full(len(paths), np.inf)
    if paths and spec.filtered:
        try:
            plain = post_filter(bounded, G, L, H, T, found.W, found.V, o.Qu, False)
            blind = smallest_faults(bounded, o, plain, paths, radius[outputs + inputs])
        except (np.linalg.LinAlgError, ValueError):
            pass  # without the event error the factorisation may not exist; then there is nothing to compare with
    delay = fault_delays(bounded, o, f, paths, radius[outputs + inputs], spec.search.size) if spec.filtered else np.full(len(paths), np.nan)
    return Generator(spec, bounded, o, f, linear, given, table, ball, signal, own, found.smallest, found.first, delay, blind)


def _uio_generator(model: Model, made: UioDesign) -> Generator:
    """An unknown-input observer as a generator: its residuals are the estimates of faults."""
    none, o = np.full(len(made.faults), np.nan), uio_generator.matrices(made)
    spec, rows, radius = uio_generator.observer_spec(model, made), len(made.faults), np.concatenate([made.sub.Sy, made.sub.Su])
    return Generator(spec, made.sub, o, no_filter(spec.order, rows), made.rows, None, made.tables.first(rows), None, made.signal, radius, made.smallest, none, none, none)


def _zonotope(
    model: Model,
    linear: hull.Linear,
    T: Array,
    sub: SubPlant,
    ranges: hull.Ranges,
    radius: Array,
    exact: hull.HullTables,
    signal: tuple[int, ...],
    derived: Derived,
    where: str,
) -> ZonotopeTable | None:
    """The zonotope of a generator whose model asks for one."""
    spec = model.detector
    if spec.threshold == "exact":
        return None
    published = spec.threshold == PUBLISHED
    more = np.eye(model.plant.n)[:, list(derived.states)]
    return zonotope.build(linear, T, sub, ranges, radius, exact, signal + derived.uncertain, spec.columns, TRUNCATE if published else BALL, where, published, more)


def _feeds(model: Model, used: set[int]) -> int:
    """Mask of the groups that send one of these signals."""
    return sum(1 << i for i, group in enumerate(model.groups) if used & set(group.signals))


def _generator_table(model: Model, g: Generator, derived: Derived) -> GeneratorTable:
    wide = g.signal + derived.uncertain
    used = {wide[i] for i in np.flatnonzero(np.any(g.tables.weight > 0, axis=(0, 1)) | np.any(g.tables.tail > 0, axis=0))}
    sent = {twin: place for place, twin in derived.place.items()}
    if used & set(derived.uncertain) and derived.mismatch is not None:
        used |= set(derived.mismatch.signal)
    paths = fault_paths(model, g.spec, tuple(range(len(model.faults))))
    size = smallest_faults(g.plant, g.observer, g.filter, paths, g.radius[: len(g.signal)]) if paths else np.zeros(0)
    # A prediction is as wrong as the faulty plant, whichever fault it is: every fault may move what reads one.
    predicted = bool(set(g.signal) & set(sent))
    made = GeneratorTable(
        signal=g.signal,
        wide=wide,
        state=rows(g.linear.state),
        input=rows(g.linear.input),
        output=rows(g.linear.output),
        direct=rows(g.linear.direct),
        taps=g.tables.taps,
        weight=tuple(rows(w) for w in g.tables.weight),
        settle=g.tables.settle,
        rest=rows(g.tables.rest[: g.tables.settle]),
        rest_left=tuple(float(x) for x in g.tables.rest_left),
        moving=rows(g.tables.moving[: g.tables.settle]),
        moving_left=tuple(float(x) for x in g.tables.moving_left),
        bias=tuple(float(x) for x in g.tables.bias),
        ready_rest=g.tables.ready_rest,
        ready_moving=g.tables.ready_moving,
        decay=tuple(float(x) for x in g.tables.decay),
        tail=rows(g.tables.tail),
        feeds=_feeds(model, {sent.get(i, i) for i in used}),
        faults=sum(1 << i for i, s in enumerate(size) if s < SEEN or predicted) | breaking(model),
        zonotope=g.zonotope,
    )
    if not isinstance(g.tables, ModalTables):
        return made
    t = g.tables
    decay, rest, moving = (tuple(float(x) for x in v) for v in (t.mode_decay, t.mode_rest, t.mode_moving))
    return ModalGeneratorTable(**vars(made), mode_decay=decay, mode_input=rows(t.mode_input), mode_output=rows(t.mode_output), mode_rest=rest, mode_moving=moving)


def used_banks(model: Model, stored: Stored) -> list[StoredBank]:
    """The stored banks that the model asks for, of the size it asks for: the one for detection, then one a hypothesis."""
    spec, used = model.detector, []
    for wanted, isolating in ((spec.bank, False), (spec.isolation, True)):
        if wanted is not None:
            fitting = [b for b in stored.banks if (b.hypothesis is not None) == isolating and b.window == wanted.window and b.weight.shape[2] == model.plant.m]
            used += [replace(b, weight=b.weight[: wanted.size]) for b in fitting if len(b.weight) >= min(wanted.size, 1)]
    return used


def breaking(model: Model) -> int:
    """Mask of the faults that can make the radii and ranges themselves too small, so that no alarm excludes them.

    An actuator's fault moves the loop beyond its healthy slews, unless these account for it; and what an uncertain plant may do is
    bounded by readings and commands, which a fault falsifies.
    """
    accounted = model.detector.isolation is not None
    return sum(1 << i for i, f in enumerate(model.faults) if uncertain(model) or (f.type == "actuator" and not (accounted and f.size_max is not None)))


def _beside(model: Model, bank: StoredBank, table: BankTable, mismatch: MismatchTable | None, size: float) -> tuple[float, ...]:
    """The bias of a bank whose hypothesis is a fault of an uncertain plant: readings and commands bound the mismatch only to within the fault."""
    fault = model.faults[bank.hypothesis].signal if bank.hypothesis is not None else -1
    if mismatch is None or fault not in mismatch.signal:
        return table.bias
    gain = np.array(mismatch.gain)[:, mismatch.signal.index(fault)]
    weight = np.array(table.extra_weight).transpose(2, 0, 1)  # certificates x window x states
    more = row_sums((weight * gain).reshape(len(weight), -1)) * size
    return tuple(float(x) for x in up32((np.array(table.bias) + more) * (1 + 1e-6)))


def _banks(model: Model, stored: Stored, derived: Derived) -> tuple[BankTable, ...]:
    varying = varying_states(model.plant, derived.states)
    made = []
    for b in used_banks(model, stored):
        size = model.faults[b.hypothesis].size_max if b.hypothesis is not None else None
        table = bank_table(model, stored, b, varying, size or FAULT_SIZE)
        behind = _feeds(model, set(derived.mismatch.signal)) if derived.mismatch is not None else 0  # what the radii of uncertain states follow from
        faults = table.faults if b.hypothesis is not None else table.faults | breaking(model)
        bias = _beside(model, b, table, derived.mismatch, size or FAULT_SIZE)
        made.append(replace(table, extra=derived.uncertain, feeds=table.feeds | behind, faults=faults, bias=bias))
    if len(model.observers) + len(made) > GENERATORS_MAX:
        raise InputError(f"{model.path.name}: {len(model.observers)} observers and {len(made)} banks, {GENERATORS_MAX} are possible; isolate fewer faults")
    return tuple(made)


def _tables(
    model: Model, groups: tuple[GroupTable, ...], generators: tuple[Generator, ...], derived: Derived, banks: tuple[BankTable, ...], polynomials: tuple[StatisticTable, ...]
) -> Tables:
    made = tuple(_generator_table(model, g, derived) for g in generators)
    verdict, status = verdict_table(model), message_table("status", model.status, 8)
    whole = Tables(
        model.name, groups, model.closing, made, model.debounce_up, model.debounce_down, model.latch, verdict, status, model.heartbeat, derived.predictors, derived.mismatch, banks,
        polynomials=polynomials, freeze=freeze_table(model),
    )  # fmt: skip
    check_freeze(whole)
    return whole


def _model_checks(model: Model, stored: Stored, tables: Tables, bound: float, generators: tuple[Generator, ...]) -> list[Check]:
    checks = []
    for i, s in enumerate(model.signals):
        if np.isfinite(stored.signal_reach[i]):
            reached, centre = float(stored.signal_reach[i]), model.centre(i)
            low, high = centre - reached, centre + reached
            cure = f"make its range {low:.3g} .. {high:.3g} or wider, or bound the reference more tightly"
            checks.append(Check(f"reach of {s.name} beyond its range", max(s.low - low, high - s.high), 0.0, cure))
    checks.append(Check("bus load, worst case", bound, model.load_max, "raise bitrate_bps, the trigger's silence or the sample time"))
    for i, g in enumerate(generators):
        share = float((g.tables.rounding / g.tables.steady).max())
        checks.append(Check(f"rounding share of threshold {i + 1}", share, 0.5, "choose poles further inside the unit circle, or narrower ranges"))
    for group in tables.groups:
        modulus = group.message.protection.modulus
        if modulus:
            checks.append(Check(f"counter alias of {group.name}", group.interval_max + group.margin, modulus * (min(group.silence) + 1) - 1, "shorten interval_max or margin"))
    frozen = (tables.freeze.request, tables.freeze.response) if tables.freeze else ()
    return checks + [c for m in (*(g.message for g in tables.groups), tables.verdict, tables.status, *frozen) for c in _protection_checks(model, m)]


def _protection_checks(model: Model, m: MessageTable) -> list[Check]:
    """How many errors of up to three bits the checksum of a frame does not see; none, where the profile can do that and the design chose its identifiers."""
    if m.protection.profile == NONE:
        return []
    count = undetected_patterns(m.protection, m.length)
    chosen = all(g.name != m.name or g.frame.wire is None for g in model.groups)
    sure = chosen and (m.protection.profile == "P05" or (m.protection.profile in LISTED and m.length <= SURE))
    name = f"undetected errors of up to {ERRORS} bits in {m.name}, {m.protection.profile}, {m.length} bytes"
    return [Check(name, count, 0 if sure else count, "choose other data ids")]


def design(model: Model, fresh: bool = False, tick: Tick | None = None, workers: int = 1) -> tuple[Design, bool]:
    """Design a model; the flag says whether the stored numbers are the design file's own."""
    stored, own = stored_for(model, fresh, tick or (lambda *_: None), workers)
    return finish(model, stored), own


def stored_for(model: Model, fresh: bool, tick: Tick, workers: int = 1) -> tuple[Stored, bool]:
    """The stored numbers of a model, and whether they are the file's own. A search is made only where the file does not help."""
    from hullguard.design.learn import learnt  # which designs detectors itself, to learn from them

    stored, own = _searched(model, fresh, tick)
    whole = learnt(model, stored, workers, tick)
    return whole, own and whole is stored
