"""`hullguard new`: from every kind of source a file that design takes as it is; what cannot work is refused before there is a file."""

from __future__ import annotations

import json
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from host_support import Cli
from test_bad_input import refused

from hullguard.design.design import design
from hullguard.model import load_model

A = [[0.0, 1.0], [-4.0, -0.8]]
B = [[0.0], [1.0]]
C = [[1.0, 0.0]]
INLINE = ("--A", "0 1; -4 -0.8", "--B", "[[0], [1]]", "--C", "1 0")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def written(path: Path) -> Path:
    """The oscillator as a file of this kind, 0.05 s and discrete where the format says so."""
    arrays = {k: np.array(v) for k, v in (("A", A), ("B", B), ("C", C))}
    if path.suffix == ".mat":
        scipy.io.savemat(path, {**arrays, "Ts": 0.05} if path.stem == "plain" else {"sys": {**arrays, "Ts": 0.05}})
    elif path.suffix == ".npz":
        np.savez(path, **arrays, dt=0.05)
    elif path.suffix == ".json":
        path.write_text(json.dumps({"A": A, "B": B, "C": C, "D": None, "dt": 0.05}))
    else:
        rows = [f"{k},{','.join(map(str, row))}" for k, m in (("A", A), ("B", B), ("C", C)) for row in m]
        path.write_text("# oscillator\n" + "\n".join([*rows, "dt,0.05"]) + "\n")
    return path


@pytest.mark.parametrize("name", ["plain.mat", "struct.mat", "plant.npz", "plant.json", "plant.csv"])
def test_every_kind_of_file_gives_the_same_plant(cli: Cli, name: str) -> None:
    path = written(Path(name))
    assert cli("new", "own", "--from", path, "--state-range", "x2=10").status == 0
    plant = load_model("own.toml").plant
    # A sample time in the file says that its matrices are discrete.
    assert np.array_equal(plant.A, A) and np.array_equal(plant.B, B) and np.array_equal(plant.C, C)
    assert load_model("own.toml").sample_time_s == 0.05


def test_continuous_matrices_are_held(cli: Cli) -> None:
    assert cli("new", "own", *INLINE, "--sample-time", 0.05, "-q").status == 0
    t, damping, turning = 0.05, 0.4, np.sqrt(4 - 0.16)
    decay = np.exp(-damping * t)
    assert load_model("own.toml").plant.A[0, 0] == pytest.approx(decay * (np.cos(turning * t) + damping / turning * np.sin(turning * t)), abs=1e-12)


@pytest.mark.parametrize(
    "options",
    [
        (*INLINE, "--sample-time", 0.05),
        ("--builder", "string_of_vehicles", "vehicles=3", "drag_per_s=1.0", "--sample-time", 0.1, "--outputs", "gap12_m,gap23_m,speed1_mps"),
        ("--builder", "car_following", "cars=2", "--sample-time", 0.1),
        ("--A", "0.5", "--C", "1", "--discrete", "--sample-time", 1),
    ],
    ids=["matrices", "string", "cars", "no inputs"],
)
def test_design_and_run_take_what_it_writes(cli: Cli, options: tuple[Any, ...]) -> None:
    assert cli("new", "own", *options).status == 0
    path = Path("own.toml")
    text = path.read_text()
    assert "hullguard design own.toml" in text and "CHECK" in text
    path.write_text(text.replace("trials = 1000", "trials = 20"))
    found = cli("run", path, "--bus", "inprocess", "--json", "--expect", "detect")
    assert found.status == 0, found.err
    assert found.json["false_alarms"]["provisional"] == 0


def test_names_ranges_and_bounds_go_where_they_belong(cli: Cli) -> None:
    options = ("--states", "angle,rate", "--outputs", "angle_rad", "--inputs", "torque_nm", "--range", "angle_rad=-2..3", "--disturbance", 0.002, "--noise", 0.003)
    assert cli("new", "own", *INLINE, "--sample-time", 0.05, *options, "--out", "other.toml").status == 0
    model = load_model("other.toml")
    angle = model.signals[model.signal("angle_rad")]
    assert (angle.low, angle.high, angle.noise) == (-2.0, 3.0, 0.003)
    assert model.plant.states == ("angle", "rate")
    assert np.allclose(np.abs(model.plant.Ed).sum(1), 0.002)
    assert [f.name for f in model.faults] == ["torque_nm_actuator", "angle_rad_sensor"]


def test_nothing_is_overwritten_without_force(cli: Cli) -> None:
    path = Path("own.toml")
    path.write_text("mine")
    refused(cli("new", "own", *INLINE, "--sample-time", 0.05), 2, "own.toml", "--force")
    assert path.read_text() == "mine"
    assert cli("new", "own", *INLINE, "--sample-time", 0.05, "--force").status == 0
    assert design(load_model("own.toml", {"detector.observers.0.search.trials": 5}))[0].generators


def test_on_a_terminal_it_asks(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter(["asked", "0 1; -4 -0.8", "0; 1", "1 0", "0.05", "", "", "", "y1=-5..5"])
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr("builtins.input", lambda question: next(answers))
    assert cli("new").status == 0
    model = load_model("asked.toml")
    assert model.sample_time_s == 0.05 and model.signals[0].high == 5.0
    assert next(answers, None) is None


BAD = [
    ((), "--from"),
    (("--A", "1 x", "--C", "1"), "rows of numbers"),
    (("--A", "1 2; 3", "--C", "1"), "differ in length"),
    (("--A", "0.5", "--C", "1 2", "--sample-time", "1"), "expected 1 x 1"),
    (("--A", "0.5", "--C", "1"), "--sample-time is needed"),
    (("--A", "0.5", "--C", "0", "--sample-time", "1", "--discrete"), "not observable"),
    (("--A", "1 0.1; 0 1", "--B", "0; 0.1", "--C", "1 0", "--discrete", "--sample-time", "0.1"), "--state-range"),
    (("--builder", "string_of_vehicles", "vehicles", "--sample-time", "0.1"), "KEY=VALUE"),
    (("--builder", "string_of_vehicles", "vehicles=3", "drag=1", "--sample-time", "0.1"), "drag_per_s"),
    (("--builder", "suspension", "corners=1", "--sample-time", "0.1"), "suspension.toml"),
    (("--builder", "rocket", "--sample-time", "0.1"), "string_of_vehicles"),
    (("--from", "none.mat"), "no such file"),
    (("--from", "plant.xls"), ".mat"),
    ((*INLINE, "--sample-time", "0.05", "--range", "y9=0..1"), "no such name"),
    ((*INLINE, "--sample-time", "0.05", "--range", "y1=1..0"), "LOW..HIGH"),
    (("--A", "0 1; -4 -0.8", "--B", "0 1", "--C", "1 0", "--sample-time", "0.05"), "semicolon"),
    ((*INLINE, "--sample-time", "0.05", "--outputs", "Y"), "lower-case"),
    ((*INLINE, "--sample-time", "0.05", "--outputs", "a,b"), "2 names"),
    ((*INLINE, "--builder", "car_following", "cars=2"), "one source"),
]


@pytest.mark.parametrize(("options", "word"), BAD, ids=[word for _, word in BAD])
def test_what_cannot_work_is_one_line_and_no_file(cli: Cli, options: tuple[str, ...], word: str) -> None:
    refused(cli("new", "own", *options), 2, word)
    assert not Path("own.toml").exists()


class Harm:
    """An object whose unpickling would leave a file."""

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return (Path.touch, (Path("harm"),))


def test_nothing_that_is_read_runs(cli: Cli) -> None:
    np.savez("plant.npz", A=np.array([[Harm()]], dtype=object), C=np.array(C))
    refused(cli("new", "own", "--from", "plant.npz", "--sample-time", 1), 2, "plant.npz")
    Path("plant.mat").write_bytes(pickle.dumps(Harm()))
    refused(cli("new", "own", "--from", "plant.mat", "--sample-time", 1), 2, "plant.mat")
    assert not Path("harm").exists()


def test_the_emulator_of_a_damped_plant_stays_within_half_of_every_range(cli: Cli) -> None:
    """However its input steps between the ends of its reference: the worst case of the oscillator, summed here over its impulse response."""
    assert cli("new", "own", *INLINE, "--sample-time", 0.05, "--range", "y1=-3..3", "-q").status == 0
    model = load_model("own.toml")
    assert model.plant.feedback is not None
    reference = model.plant.feedback.reference_bound[0]
    response, x = 0.0, model.plant.B[:, 0]
    for _ in range(2000):
        response, x = response + abs(x[0]), model.plant.A @ x
    assert model.scenarios[0].reference.amplitude == reference and 1.3 < response * reference < 1.6
