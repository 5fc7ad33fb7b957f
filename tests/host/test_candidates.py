"""The true fault stays among the candidates where it falsifies what a threshold rests on: the slews of a loop it moves, and the readings and commands
that bound an uncertain plant.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hullguard.core.library import library
from hullguard.core.native import Batch, Native
from hullguard.design.design import Design, design
from hullguard.model import parse_fault
from hullguard.model.plant import Plant
from hullguard.model.schema import Reference, parse_model

RUNS = 40
QUIET = {"interval_max": 4, "sigma": [0.05], "delta": 0.0, "silence": 2, "margin": 2}
NOISE = {"state": [0.01, 0.01], "output": [0.01, 0.01]}


def signal(name: str, role: str, resolution: float) -> dict[str, Any]:
    return {"name": name, "role": role, "range": [-60.0, 60.0], "resolution": resolution, "slew": "reachable"}


def model(plant: dict[str, Any], groups: list[dict[str, Any]], inputs: list[str], faults: list[dict[str, Any]], reads: list[str], **detector: Any) -> dict[str, Any]:
    """Two states, both measured; one observer of y2 and the inputs in `reads`, searched for the fault of y2."""
    observer = {"order": 1, "residuals": 1, "outputs": ["y2"], "inputs": reads, "faults": ["y2_fault"], "search": {"trials": 8, "seed": 1}}
    return {
        "schema": 1,
        "name": "small",
        "kind": "linear",
        "sample_time_s": 0.1,
        "plant": {"C": [[1.0, 0.0], [0.0, 1.0]], "discrete": True, "initial_range": [0.1, 0.1], "disturbance": NOISE} | plant,
        "signals": [signal("y1", "output", 0.01), signal("y2", "output", 0.01), *(signal(u, "input", 0.001) for u in inputs)],
        "groups": [*groups, {"name": "closing", "frame": {"id": 0x120}, "transmission": "tick", "signals": inputs, "applied_as_sent": True}],
        "verdict": {"frame": {"id": 0x130}},
        "detector": {"observers": [observer]} | detector,
        "faults": faults,
    }


def fault(name: str, kind: str, size: float) -> dict[str, Any]:
    return {"name": f"{name}_fault", "signal": name, "type": kind, "size_max": size}


LOOP = model(
    {"A": [[0.8, 0.0], [0.0, 0.7]], "B": [[1.0, 0.0], [0.0, 1.0]], "feedback": {"gain": [[0.1, 0.0], [0.8, 0.1]], "reference_bound": [0.1, 0.1]}},
    [{"name": f"s{i}", "signals": [f"y{i}"], "frame": {"id": 0x100 + i}, "trigger": QUIET} for i in (1, 2)],
    ["u1", "u2"],
    [fault("u1", "actuator", 5.0), fault("y2", "sensor", 5.0), fault("u2", "actuator", 5.0)],
    ["u2"],
)
BOTH = [{"name": "s", "signals": ["y1", "y2"], "frame": {"id": 0x100}, "trigger": QUIET | {"interval_max": 3, "sigma": [0.05, 0.05], "silence": 0}}]
FEEDBACK = {"gain": [[0.3, 0.0]], "reference_bound": [2.0]}
READING = model(
    {"A": [[0.9, 0.0], [0.0, 0.6]], "A_pm": [[0.0, 0.0], [0.15, 0.0]], "B": [[1.0], [0.3]], "feedback": FEEDBACK},
    BOTH,
    ["u"],
    [fault("y1", "sensor", 8.0), fault("y2", "sensor", 6.0)],
    ["u"],
)
COMMAND = model(
    {"A": [[0.9, 0.0], [0.0, 0.6]], "B": [[1.0], [0.0]], "B_pm": [[0.0], [0.1]], "feedback": FEEDBACK},
    BOTH,
    ["u"],
    [fault("u", "actuator", 3.0), fault("y2", "sensor", 6.0)],
    ["u"],
)


def made(source: dict[str, Any]) -> Design:
    return design(parse_model(copy.deepcopy(source), Path("small.toml")), fresh=True)[0]


def corners(plant: Plant) -> list[Plant]:
    return [replace(plant, A=plant.A + s * plant.dA, B=plant.B + s * plant.dB) for s in (1, -1)]


def kept(ready: Design, spec: str, reference: Reference) -> None:
    """The fault is confirmed in many runs, and a candidate in all of them; healthy runs stay quiet."""
    native, plants = Native(library("f32"), ready.tables), corners(ready.model.plant)
    injected = parse_fault(spec)
    bit = 1 << [f.name for f in ready.model.faults].index(injected.name)
    sure = [r for r in Batch(native, ready, 200, reference, [injected], 3, plants=plants).runs(0, RUNS) if r["confirmed_at"] >= 0]
    assert len(sure) > RUNS // 4
    assert all(r["candidates_always"] & bit for r in sure)
    assert all(r["false_confirmed"] == 0 for r in Batch(native, ready, 200, reference, [], 3, plants=plants).runs(0, RUNS))


@pytest.mark.parametrize("spec", ["u1_fault:bias:5@60", "u1_fault:bias:-5@60", "u2_fault:bias:2@60"])
def test_an_actuator_that_moves_the_loop_beyond_its_slews_stays_a_candidate(spec: str) -> None:
    kept(made(LOOP), spec, Reference("mixed", 1.0, 20))


@pytest.mark.parametrize("spec", ["y1_fault:bias:8@60", "y1_fault:bias:-8@60", "y1_fault:bias:5@60"])
def test_a_sensor_that_bounds_an_uncertain_plant_stays_a_candidate(spec: str) -> None:
    kept(made(READING), spec, Reference("mixed", 2.0, 30))


@pytest.mark.parametrize("spec", ["u_fault:bias:3@60", "u_fault:bias:-3@60"])
def test_an_actuator_that_acts_only_through_an_interval_stays_a_candidate(spec: str) -> None:
    kept(made(COMMAND), spec, Reference("mixed", 0.5, 30))


WISH = {"size": 3, "window": 8, "runs": 3, "sizes": [3.0]}


@pytest.mark.parametrize("extra", [{"bank": WISH}, {"isolation": WISH}, {"bank": WISH, "prediction": True}], ids=["bank", "isolation", "prediction"])
def test_banks_are_learnt_where_there_are_derived_signals(extra: dict[str, Any]) -> None:
    source = copy.deepcopy(READING)
    source["detector"] |= copy.deepcopy(extra)
    ready = made(source)
    assert ready.tables.banks
    assert ready.tables.mismatch is not None
    if "isolation" in extra:
        for size in (4, -6, 6):
            kept(ready, f"y1_fault:bias:{size}@60", Reference("mixed", 2.0, 30))
