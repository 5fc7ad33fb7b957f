"""Which sensors an unknown-input observer can do with, which faults it can tell apart, and why not; suspension, section 1.6."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hullguard.design import uio
from hullguard.design.uio_generator import plant_of
from hullguard.errors import InputError
from hullguard.model.builders_car import TYRE
from hullguard.model.schema import Model
from hullguard.model.table import Array
from hullguard.model.uio import UioSpec, component_names


@dataclass(frozen=True)
class SensorSet:
    """One row of the table."""

    outputs: tuple[str, ...]
    unknown: tuple[str, ...]  # faults and inputs that are to be estimated
    why_not: str | None  # None: it works
    free: int  # poles that can be chosen, 0 where it does not work
    fixed: tuple[complex, ...]  # poles that no gain moves


def judged(plant: uio.Unknown, faults: Sequence[str] = ()) -> SensorSet:
    """Whether there is an observer. `faults`: what the changes of sensors' faults are called."""
    names = tuple(n for n in plant.inputs if not n.startswith("change of ")) + tuple(faults)
    reason = uio.obstacle(plant)
    fixed = () if reason is not None else tuple(complex(z.value) for z in uio.invariant_zeros(plant))
    return SensorSet(plant.outputs, names, reason, 0 if reason is not None else uio.free_poles(plant), fixed)


def without_feedthrough(plant: uio.Unknown, E: Array) -> uio.Unknown:
    """A plant whose outputs y = C x + E f feel unknown inputs at once, accelerometers for example, as one whose outputs do not.

    What E shows of f is known from y, E = U S V': f = V1 S^-1 (U1'y - U1'C x) + V2 f2. It leaves x' = (A - G V1 S^-1 U1'C) x + G V2 f2 + (known) with the
    outputs U2'y = U2'C x.
    """
    U, sigma, Vh = np.linalg.svd(E)
    rank = int(np.sum(sigma > uio.RANK * max(float(sigma[0]), 1e-300))) if sigma.size else 0
    if rank == 0:
        return plant
    known = Vh[:rank].T @ np.diag(1.0 / sigma[:rank]) @ U[:, :rank].T
    left, rest = U[:, rank:].T, Vh[rank:].T
    # A direction that E does not show is one of the inputs by itself, or a mixture.
    named = [plant.inputs[int(np.argmax(np.abs(c)))] if np.abs(c).max() > 1 - 1e-9 else f"mixture {i + 1} of {', '.join(plant.inputs)}" for i, c in enumerate(rest.T)]
    A = plant.A - plant.G @ known @ plant.C
    return uio.Unknown(A, plant.B, left @ plant.C, plant.G @ rest, plant.states, tuple(named), tuple(f"y without f, {i + 1}" for i in range(len(left))), plant.discrete)


def asked(model: Model, names: Sequence[str]) -> SensorSet:
    """Whether these sensors would do for the first observer's actuators and the unknown inputs.

    Names are those of outputs; rate:STATE is what an accelerometer reads where the state is a velocity, and feels forces at once.
    """
    if not model.uios:
        raise InputError(f'model {model.name}: it has no inputs that nobody knows; --sensors is for kind = "uio"')
    spec = replace(model.uios[0], outputs=tuple(range(len(model.outputs))), sensors=(), decay=())
    plant = plant_of(model, spec)
    rows = {n: (plant.C[i], np.zeros(plant.G.shape[1])) for i, n in enumerate(plant.outputs)}
    rows |= {f"rate:{n}": (plant.A[i], plant.G[i]) for i, n in enumerate(plant.states)}
    for n in names:
        if n not in rows:
            raise InputError(f"--sensors: '{n}' is none of {', '.join(rows)}")
    C, E = (np.array([rows[n][j] for n in names]) for j in (0, 1))
    found = judged(without_feedthrough(replace(plant, C=C, outputs=tuple(names)), E))
    return replace(found, outputs=tuple(names), unknown=plant.inputs)


def sensor_sets(model: Model) -> list[list[SensorSet]]:
    """Of each observer: its own set, each with one sensor less, and its own with the fault of each sensor beside those that it estimates."""
    return [_around(model, spec) for spec in model.uios]


def _around(model: Model, spec: UioSpec) -> list[SensorSet]:
    own = _set(model, spec)
    fewer = [_set(model, _less(model, spec, k)) for k in spec.outputs] if len(spec.outputs) > 1 else []
    read = {model.outputs[k] for k in spec.outputs}
    others = [i for i, f in enumerate(model.faults) if f.type == "sensor" and f.signal in read and i not in spec.sensors]
    more = [_set(model, replace(spec, sensors=(*spec.sensors, i), decay=(*spec.decay, 0.0))) for i in others]
    return [own, *fewer, *more]


def _less(model: Model, spec: UioSpec, output: int) -> UioSpec:
    """Without a sensor, and without its fault."""
    kept = [i for i, f in enumerate(spec.sensors) if model.faults[f].signal != model.outputs[output]]
    outputs = tuple(k for k in spec.outputs if k != output)
    return replace(spec, outputs=outputs, sensors=tuple(spec.sensors[i] for i in kept), decay=tuple(spec.decay[i] for i in kept))


def _set(model: Model, spec: UioSpec) -> SensorSet:
    try:
        return judged(plant_of(model, spec), [model.faults[f].name for f in spec.sensors])
    except np.linalg.LinAlgError as error:
        raise InputError(f"{model.path.name}: a set of sensors cannot be judged ({error})") from error


def component_words(model: Model) -> dict[str, str]:
    """What becomes of a weaker part of the plant, by its name."""
    said = {}
    for name, (parameter, corner) in component_names(model.plant.unknown).items():
        acts = model.signals[model.inputs[corner]].name
        said[name] = (
            "not observable: where its compression is computed from accelerations, a weaker tyre looks like another road, share road + (1 - share) wheel, and like nothing else"
            if parameter == TYRE
            else f"shows as a fault of {acts}, through the same column of B; only its course, which follows the motion, tells them apart"
        )
    return said


def as_json(model: Model, more: Sequence[SensorSet] = ()) -> dict[str, Any]:
    """What `design --json` adds for a model of kind "uio"; `more`: sets that were asked for."""
    if not model.uios:
        return {}
    rows = [{"observer": i + 1} | _facts(s) for i, every in enumerate(sensor_sets(model)) for s in every]
    return {"sensor_sets": rows, "asked": [_facts(s) for s in more], "components": component_words(model)}


def _facts(s: SensorSet) -> dict[str, Any]:
    return {
        "sensors": list(s.outputs),
        "unknown": list(s.unknown),
        "works": s.why_not is None,
        "why_not": s.why_not,
        "free_poles": s.free,
        "fixed_poles": [[z.real, z.imag] for z in s.fixed],
    }


def leaky_integration_error(leak_per_s: float, height_m: float, offset_mps2: float) -> float:
    """How far a velocity v' = -leak v + (acceleration + offset) can be from the true one, m/s, once it has forgotten its start.

    The error e obeys e' = -leak e + leak velocity - offset, hence e = leak (height - its low pass) - offset / leak: a body within +- height of its
    mean gives 2 leak height at most.
    """
    return 2.0 * leak_per_s * height_m + abs(offset_mps2) / leak_per_s
