"""The emulated plant of a model of kind "uio": continuous time in fine steps, roads, weaker components; the readings of its samples.

Commands, faults of actuators and of sensors, and the sensors' noise are those of the C emulator; what is added here moves between samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hullguard.core.native import Native, Plant, Recording, fault_array
from hullguard.design.design import Design
from hullguard.design.uio_discrete import zero_order_hold
from hullguard.errors import InputError
from hullguard.model.builders_car import TYRE
from hullguard.model.faults import FaultSpec
from hullguard.model.road import RoadSpec
from hullguard.model.schema import Model, Reference, Scenario
from hullguard.model.table import Array
from hullguard.model.uio import UnknownInputs, component_names, weakened
from hullguard.plant.road import Road, check_bounds, road

FINE_S = 1e-4  # at most, of a step


@dataclass(frozen=True)
class Emulated:
    """What a run is made from, and what nobody is told."""

    readings: Array  # samples x signals, without noise and faults of sensors
    state: Array  # samples x n
    unknown: Array  # samples x q: mean over the interval that ends with the sample, 0 in the first
    force: Array  # samples x p: what actuators add to their command, alike


def component_faults(model: Model, faults: Sequence[FaultSpec]) -> list[FaultSpec]:
    """Those of parts of the plant, each with the share that is left."""
    own = [f for f in faults if f.name in model.components]
    for f in own:
        if f.kind != "gain" or not 0.0 <= f.size <= 10.0:
            raise InputError(f"fault '{f}': a component's fault is what is left of it, as in {f.name}:gain:0.8@{f.start}")
    return own


def emulate(design: Design, native: Native, scenario: Scenario, faults: Sequence[FaultSpec], samples: int, seed: int) -> Emulated:
    """A run of the plant with the scenario's roads, from a random state within the initial range."""
    model = design.model
    known = model.plant.unknown
    if known is None:
        raise InputError(f'model {model.name}: it has no inputs that nobody knows; only kind = "uio" is emulated between samples')
    parts = component_faults(model, faults)
    others = [f for f in faults if f not in parts]
    command, applied = _inputs(design, native, scenario.reference, others, samples, seed)
    fine = max(1, round(model.sample_time_s / FINE_S))
    times: Array = np.asarray((np.arange(samples * fine) + 0.5) * (model.sample_time_s / fine), dtype=np.float64)
    roads = _roads(known, scenario.road or RoadSpec("smooth"), seed)
    for made in roads:
        check_bounds([made[0]], np.asarray(times - made[1], dtype=np.float64), float(known.bound[0]), float(known.rate[0]))
    velocity = np.array([made.velocity(np.asarray(times - late, dtype=np.float64)) for made, late in roads]).T.reshape(samples, fine, len(known.names))
    x0 = model.plant.equilibrium + model.plant.initial_range * np.random.default_rng([seed, 1]).uniform(-1.0, 1.0, model.plant.n)
    state = _states(model, known, parts, applied, velocity, x0)
    readings = np.zeros((samples, len(model.signals)))
    readings[:, model.outputs], readings[:, model.inputs] = (state * _seen(model, parts, samples)) @ model.plant.C.T, command
    before = np.zeros((1, velocity.shape[2]))
    return Emulated(readings, state, np.vstack([before, velocity.mean(1)[:-1]]), np.vstack([np.zeros((1, model.plant.p)), (applied - command)[:-1]]))


class Continuous(Recording):
    """Readings for a run, sensors' noise and faults included; `emulated` is what they were made from."""

    def __init__(self, design: Design, native: Native, scenario: Scenario, faults: Sequence[FaultSpec], samples: int, seed: int) -> None:
        self.emulated = emulate(design, native, scenario, faults, samples, seed)
        rest = [f for f in faults if f.name not in design.model.components]
        super().__init__(native, design.model, self.emulated.readings, True, rest, seed)


def _inputs(design: Design, native: Native, reference: Reference, faults: Sequence[FaultSpec], samples: int, seed: int) -> tuple[Array, Array]:
    """Commands and what actuators make of them: samples x p."""
    model, lib, ffi = design.model, native.library.lib, native.library.ffi
    driver = Plant(native, design, reference, (), seed)
    own, array = ffi.new("hgh_faults *"), fault_array(native.library, model, faults)
    lib.hgh_faults_start(own, array, len(faults), model.sample_time_s, seed, 0)
    resolution = np.array([model.signals[i].resolution for i in model.inputs])
    command, applied = np.zeros((samples, len(model.inputs))), np.zeros((samples, len(model.inputs)))
    for k in range(samples):
        reading = driver.read()
        driver.move()
        command[k] = [reading[i] for i in model.inputs]
        sent = np.round(command[k] / resolution) * resolution
        applied[k] = [lib.hgh_faults_apply(own, 1, place, k, float(v)) for place, v in zip(model.inputs, sent, strict=True)]
        command[k] = sent
    return command, applied


def _roads(known: UnknownInputs, spec: RoadSpec, seed: int) -> list[tuple[Road, float]]:
    """Of each unknown input its road, and how late it comes there: the rear axle follows the front one, left and right have roads of their own."""
    count = len(known.names)
    wheelbase = float(known.parameters.get("front_m", 0.0)) + float(known.parameters.get("rear_m", 0.0))
    rear = wheelbase / spec.speed_mps
    sides = [road(spec, seed), road(spec, seed + 1)]
    if count == 4:
        return [(sides[0], 0.0), (sides[1], 0.0), (sides[0], rear), (sides[1], rear)]
    return [(sides[0], 0.0), (sides[0], rear)][:count]


def _states(model: Model, known: UnknownInputs, parts: Sequence[FaultSpec], applied: Array, velocity: Array, x0: Array) -> Array:
    """States at the samples; inputs are held, roads held over fine steps."""
    samples, fine, _ = velocity.shape
    steps: dict[tuple[FaultSpec, ...], tuple[Array, Array, Array]] = {}
    state, x = np.zeros((samples, model.plant.n)), x0
    for k in range(samples):
        state[k] = x
        now = tuple(f for f in parts if f.start <= k and (f.end is None or k < f.end))
        if now not in steps:
            steps[now] = _step(weakened(known, {f.name: f.size for f in now}), known.B, known.G, model.sample_time_s / fine, fine)
        Ad, Bd, Gd = steps[now]
        x = Ad @ x + Bd @ applied[k] + np.tensordot(Gd, velocity[k], ((1, 2), (0, 1)))
    return state


def _seen(model: Model, parts: Sequence[FaultSpec], samples: int) -> Array:
    """What share of each state a sensor shows (samples x n): a balance of forces takes a weaker tyre for one less compressed."""
    share, names = np.ones((samples, model.plant.n)), component_names(model.plant.unknown)
    for f in parts:
        parameter, corner = names[f.name]
        if parameter == TYRE:
            share[f.start : f.end, 4 * corner + 2] *= f.size
    return share


def _step(A: Array, B: Array, G: Array, fine_s: float, fine: int) -> tuple[Array, Array, Array]:
    """A whole sample: Ad, Bd of a held input, and n x fine x q of a road's fine steps."""
    small, from_road = zero_order_hold(A, G, fine_s)
    Ad, Bd = zero_order_hold(A, B, fine_s * fine)
    blocks = [from_road]
    for _ in range(fine - 1):
        blocks.append(small @ blocks[-1])
    return Ad, Bd, np.stack(blocks[::-1], 1)
