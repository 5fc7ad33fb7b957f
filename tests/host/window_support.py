"""Plants over a window, by recursion: what window forms, programmes and certificates are held against."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hullguard.design.design import Design
from hullguard.errors import InputError
from hullguard.model.plant import Plant
from hullguard.model.schema import Fault, Model
from hullguard.model.table import Array
from test_soundness import made_of, random_source


def random_designs(seed: int, count: int) -> list[Design]:
    """Designs of the random models that can be made, the first `count` of them."""
    made: list[Design] = []
    number = 0
    while len(made) < count:
        number += 1
        try:
            made.append(made_of(random_source(np.random.default_rng([seed, number]))))
        except InputError as error:
            assert str(error)
    return made


def simulate(plant: Plant, x: Array, u: Array, d: Array, into_x: Array | None = None, into_y: Array | None = None) -> Array:
    """Readings y of a window (samples x m) from x(0), inputs (samples x p) and disturbances (samples x nd); what else enters x and y, a row a sample."""
    readings = []
    for k in range(len(d)):
        readings.append(plant.C @ x + plant.D @ u[k] + plant.Fd @ d[k] + (0 if into_y is None else into_y[k]))
        x = plant.A @ x + plant.B @ u[k] + plant.Ed @ d[k] + (0 if into_x is None else into_x[k])
    return np.array(readings)


def faulty(model: Model, fault: Fault | None, course: Array, x: Array, u: Array, d: Array) -> Array:
    """Readings of all signals (samples x signals) while a fault takes this course: an actuator's moves the plant, a sensor's its reading."""
    plant, true_u, seen_u = model.plant, u.copy(), u.copy()
    if fault is not None and fault.signal in model.inputs:
        column = model.inputs.index(fault.signal)
        (true_u if fault.type == "actuator" else seen_u)[:, column] += course
    v = np.zeros((len(d), len(model.signals)))
    v[:, model.outputs] = simulate(plant, x, true_u, d)
    v[:, model.inputs] = seen_u
    if fault is not None and fault.signal in model.outputs:
        v[:, fault.signal] += course
    return v


def with_faults(model: Model) -> Model:
    """The model with a fault of every kind on every signal."""
    sensors = [Fault(f"{s.name}_off", i, "sensor") for i, s in enumerate(model.signals)]
    actuators = [Fault(f"{model.signals[i].name}_drive", i, "actuator") for i in model.inputs]
    return replace(model, faults=tuple((sensors + actuators)[:16]))
