"""Tables of isolate.h: what the parts of the plant that could be weaker would exert, beside each estimate of an actuator's fault."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hullguard.core.native_uio import IsolateTable
from hullguard.design.arith import nearest32
from hullguard.design.uio_generator import UioDesign, unknown_of
from hullguard.errors import InputError
from hullguard.model.builders_car import TYRE, component_force
from hullguard.model.schema import Model
from hullguard.model.table import Table
from hullguard.model.uio import component_names


@dataclass(frozen=True)
class Isolation:
    """One estimate of an actuator's fault with what else it may be."""

    table: IsolateTable
    names: tuple[str, ...]  # bits of hg_isolation.candidates: the actuator, the components, the sensors


def isolations(model: Model, made: UioDesign) -> list[Isolation]:
    """One for each actuator of an observer; none where the model does not isolate."""
    return [_isolation(model, made, i) for i in range(len(made.spec.actuators))] if made.spec.isolate is not None else []


def _isolation(model: Model, made: UioDesign, row: int) -> Isolation:
    spec, known, period = made.spec.isolate, unknown_of(model), model.sample_time_s
    assert spec is not None
    if known.builder is None:
        raise InputError(f"{model.path.name}: detector.uio.isolate: a plant given by matrices has no parts by name; remove it, or use a builder")
    corner = model.inputs.index(model.faults[made.spec.actuators[row]].signal)
    parts = {name: parameter for name, (parameter, place) in component_names(known).items() if place == corner and parameter != TYRE}
    given, n = Table(known.parameters, "plant"), made.follows.shape[1]
    whole = np.zeros((len(parts), len(made.names)))
    whole[:, len(made.names) - n :] = [component_force(parameter, corner, given) for parameter in parts.values()]
    a = period / (made.spec.low_pass_s + period)
    sensors = range(len(made.spec.actuators), len(made.faults))
    table = IsolateTable(
        actuator=row,
        limit=spec.limit,
        sensor=tuple(sensors),
        sensor_limit=(0.0,) * len(sensors),
        whole=nearest32(whole),
        excitation=np.full(len(parts), spec.excitation),
        low_pass=float(nearest32(np.array(a))),
        settle=round(spec.settle_s / period),
        release=max(1, round(spec.release_s / period)),
        block=max(1, min(65535, round(spec.block_s / period))),
        blocks=spec.blocks,
        explained=spec.explained,
        steady=spec.steady,
    )
    return Isolation(table, (made.names[row], *parts, *(made.names[i] for i in sensors)))
