"""Situations in which a healthy plant once was called faulty, or a model was wrongly taken or refused. Each fails on the code before its mend."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hullguard.core.library import library
from hullguard.core.native import (
    MOVING,
    REST,
    Batch,
    Native,
    Node,
    Plant,
    Sender,
    Verdict,
)
from hullguard.design.design import Design, design, find, finish
from hullguard.errors import InputError
from hullguard.model import load_model
from hullguard.model.schema import Model, Reference, parse_model
from hullguard.plant.detect import Detector

SCALAR: dict[str, Any] = {
    "schema": 1,
    "name": "scalar",
    "kind": "linear",
    "sample_time_s": 0.1,
    "plant": {"A": [[0.9]], "B": [[0.1]], "C": [[1.0]], "discrete": True, "initial_range": [0.5], "disturbance": {"state": 0.02, "output": 0.01}},
    "signals": [
        {"name": "y", "role": "output", "range": [-60.0, 60.0], "resolution": 0.001, "slew": "reachable"},
        {"name": "u", "role": "input", "range": [-60.0, 60.0], "resolution": 0.001},
    ],
    "groups": [
        {"name": "sensor", "signals": ["y"], "frame": {"id": 0x110}, "trigger": {"delta": 0.0, "sigma": [0.05], "silence": 2, "interval_max": 5}},
        {"name": "control", "signals": ["u"], "frame": {"id": 0x120}, "transmission": "tick", "applied_as_sent": True},
    ],
    "verdict": {"frame": {"id": 0x130}},
    "detector": {"observers": [{"order": 1, "residuals": 1, "search": {"trials": 30, "seed": 1, "poles": [0.2, 0.8]}}]},
    "faults": [{"name": "actuator", "signal": "u", "type": "actuator"}],
}
LOOP = {"gain": [[0.5]], "reference_bound": 1.0}


def scalar(plant: dict[str, Any] | None = None, signals: list[dict[str, Any]] | None = None) -> Model:
    """The scalar model with some of its keys replaced."""
    data = copy.deepcopy(SCALAR)
    data["plant"] |= plant or {}
    for mine, change in zip(data["signals"], signals or [], strict=False):
        mine |= change
    return parse_model(data, Path("scalar.toml"))


def made(model: Model) -> Design:
    """A design that does not touch the disk."""
    return finish(model, find(model, lambda *_: None))


@pytest.fixture(scope="module")
def platoon() -> tuple[Design, Native]:
    """The shipped model."""
    shipped, _ = design(load_model("platoon"))
    return shipped, Native(library("f32"), shipped.tables)


def test_a_plant_away_from_zero_is_held_there_and_quiet() -> None:
    """The emulator once drove it to zero, against slews computed around the equilibrium."""
    shifted = made(scalar({"equilibrium": [10.0], "feedback": LOOP}))
    assert shifted.model.plant.equilibrium_input == pytest.approx([10.0])
    rows = Batch(Native(library("f32"), shifted.tables), shifted, 150, Reference("mixed", 1.0, 20)).runs(0, 200)
    assert sum(r["false_provisional"] for r in rows) == 0
    assert max(r["margin"] for r in rows) <= 1.0


def test_an_equilibrium_that_no_input_holds_is_refused() -> None:
    """x+ = 0.9 x with no input drifts."""
    with pytest.raises(InputError, match="no input holds the plant there"):
        scalar({"B": [[0.0]], "equilibrium": [10.0]})


def test_a_range_is_compared_with_the_reach_around_its_own_middle() -> None:
    """A range that is not symmetric about zero was once compared by magnitudes."""
    with pytest.raises(InputError, match="reach of y beyond its range"):
        made(scalar({"feedback": LOOP}, [{"range": [10.0, 60.0]}]))
    made(scalar({"equilibrium": [45.0], "feedback": LOOP}, [{"range": [-1.0, 90.0]}, {"range": [-1.0, 90.0]}]))


def test_a_state_may_be_as_far_beyond_its_outputs_range_as_the_noise() -> None:
    """The range bounds the reading, not the state."""
    noisy = made(scalar({"disturbance": {"state": 0.02, "output": 0.5}}, [{"range": [-1.0, 1.0], "slew": [2.0]}, {"range": [-1.0, 1.0]}]))
    assert noisy.stored.state_range == pytest.approx([1.5])


def test_noise_of_a_measured_input_comes_through_d() -> None:
    """y = x + u with a noisy reading of u."""
    plant = scalar({"D": [[1.0]]}, [{}, {"noise": 0.2}]).plant
    columns = np.abs(np.vstack([plant.Ed, plant.Fd])).T
    assert any(column == pytest.approx([0.1 * 0.2, 1.0 * 0.2]) for column in columns)


def test_a_model_without_faults_is_designed() -> None:
    """A stranger's first model has none."""
    data = copy.deepcopy(SCALAR)
    del data["faults"]
    data["plant"]["feedback"] = LOOP
    bare = made(parse_model(data, Path("bare.toml")))
    assert bare.generators[0].smallest.size == 0


def frames_of(platoon: tuple[Design, Native], seed: int, count: int) -> list[tuple[int, Any]]:
    """All frames of a healthy drive, each with its sample."""
    shipped, native = platoon
    plant, sender = Plant(native, shipped, Reference("mixed", 1.0, 60), (), seed), Sender(native)
    frames = []
    for k in range(count):
        reading = plant.read()
        frames += [(k, f) for g in (0, 1) if (f := sender.step(g, k, reading)) is not None]
        plant.move()
    return frames


@pytest.mark.parametrize("length", [8, 15, 16, 17, 31, 32])
def test_a_hole_in_a_log_is_an_outage_and_no_fault(platoon: tuple[Design, Native], length: int) -> None:
    """Stamp and counter wrap at 16: after such a hole only the time stamps tell that samples are missing."""
    confirmed = []
    for seed in range(3):
        frames = frames_of(platoon, seed, 200)
        for hole in range(60, 160, 9):
            verdicts: list[Verdict] = []
            detector = Detector(platoon[1], MOVING, False, None, verdicts.append, 0.1)
            for k, frame in frames:
                if not hole <= k < hole + length:
                    detector.take(frame, 0.1 * k)
            confirmed += [(seed, hole)] if any(v.plant == "confirmed" for v in verdicts) else []
            assert detector.outages == 1 or length == 8
    assert confirmed == []


def test_a_tick_sender_that_begins_anew_is_no_fault(platoon: tuple[Design, Native]) -> None:
    """Counter and sample index start at 0 again while the plant goes on; at one place in sixteen they look like a repetition."""
    shipped, native = platoon
    confirmed = []
    for at in range(60, 76):
        for down in (0, 3):
            for seed in range(4):
                plant, senders, ticks, node, begun = Plant(native, shipped, Reference("mixed", 1.0, 20), (), seed), Sender(native), Sender(native), Node(native, REST), 0
                for k in range(140):
                    if k == at + down:
                        ticks, begun = Sender(native), k
                    reading = plant.read()
                    off = at <= k < at + down
                    for sender, group in ((senders, 0), (ticks, 1)):
                        frame = None if off and group == 1 else sender.step(group, k - begun, reading)
                        if frame is not None:
                            node.receive(frame)
                    if off:
                        node.overdue()
                    while (verdict := node.step()) is not None:
                        confirmed += [(at, down, seed, k)] if verdict.plant == "confirmed" else []
                    plant.move()
    assert confirmed == []


def test_the_example_of_the_model_file_needs_no_feedback() -> None:
    """A state that is not measured gets its bound from what drives it."""
    shipped = tomllib.loads(load_model("platoon").path.read_text())
    del shipped["plant"]["feedback"]
    for s, slew in zip(shipped["signals"], ([0.2], [0.2], [0.57]), strict=False):
        s["slew"] = slew
    shipped["detector"]["observers"][0]["search"]["trials"] = 20
    model = parse_model(shipped, Path("open.toml"))
    assert np.all(np.isfinite(made(model).stored.state_range))


def test_a_folder_called_like_a_shipped_model_does_not_hide_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As `hullguard run platoon --out platoon` leaves one."""
    (tmp_path / "platoon").mkdir()
    monkeypatch.chdir(tmp_path)
    assert load_model("platoon").name == "platoon"
