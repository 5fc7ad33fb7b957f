"""Plants known to within intervals: bounds that hold every plant inside, corners too, and detectors that raise no false alarm on any of them."""

from __future__ import annotations

import itertools
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from host_support import SEED, Models
from hullguard.core.library import library
from hullguard.core.native import Batch, Native
from hullguard.design import store
from hullguard.design.design import Design, find, finish
from hullguard.design.mismatch import constant_mismatch, disturbed, mismatch, uncertain
from hullguard.design.reach import Reach, faulty_reach, reach
from hullguard.errors import InputError
from hullguard.model import load_model, parse_fault
from hullguard.model.builders import Interval
from hullguard.model.plant import Plant, draw, emulated
from hullguard.model.schema import SHIPPED, Model, parse_model
from hullguard.model.table import Array
from hullguard.model.templates import expand
from hullguard.model.uncertain import drawn, enclosure, zero_order_hold

PLATOON = expand(tomllib.loads((SHIPPED / "platoon.toml").read_text(encoding="utf-8")), "platoon.toml")
HORIZON = 9
SMALL = 1e-12  # what double precision adds up to in a simulation


def drag(pm: float) -> dict[str, Any]:
    return {"plant.drag_per_s": {"value": 1.0, "pm": pm}}


# ---- reading ----


def test_an_interval_of_nothing_is_a_certain_plant() -> None:
    certain, same = load_model("platoon").plant, load_model("platoon", drag(0.0)).plant
    assert certain.interval is same.interval is None
    assert not (certain.dA.any() or certain.dB.any() or same.dA.any() or same.dB.any())
    assert np.array_equal(certain.A, same.A)


def test_each_vehicles_drag_moves_its_own_speed_and_the_gaps_beside_it() -> None:
    plant = load_model("platoon", drag(0.1)).plant
    speed = [0, 2, 4]
    assert np.flatnonzero(plant.dA.any(axis=0)).tolist() == speed
    assert all(plant.dA[i, i] > 0 for i in speed) and plant.dA[0, 2] == plant.dA[0, 1] == plant.dA[1, 1] == 0
    # exp(-0.09) - exp(-0.1): the upper end of the interval, reached.
    assert plant.dA[0, 0] == pytest.approx(np.exp(-0.09) - np.exp(-0.1), rel=1e-6)


REFUSED = [
    ({"value": 1.0, "pm": 1.5}, "make pm at most 1"),
    ({"value": 1.0, "pm": -0.1}, "outside"),
    ({"value": 1.0}, "'pm' is missing"),
    ({"value": 1.0, "pm": 0.1, "p": 1}, "unknown key 'p'"),
    ("fast", "expected a number"),
]


@pytest.mark.parametrize(("value", "why"), REFUSED)
def test_an_interval_that_makes_no_sense_is_refused(value: Any, why: str) -> None:
    with pytest.raises(InputError) as error:
        load_model("platoon", {"plant.drag_per_s": value})
    assert why in str(error.value) and "drag_per_s" in str(error.value)


def by_matrices(discrete: bool, **bounds: Any) -> Model:
    """A platoon of two, as matrices."""
    found = load_model("platoon", {"plant.vehicles": 2})
    A = [[-1.0, 0.0, 0.0], [1.0, 0.0, -1.0], [0.0, 0.0, -1.0]]
    B = [[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]]
    if discrete:
        A, B = found.plant.A.tolist(), found.plant.B.tolist()
    data = expand(tomllib.loads((SHIPPED / "platoon.toml").read_text(encoding="utf-8")) | {"plant": {**PLATOON["plant"], "vehicles": 2}}, "m.toml")
    data["plant"] = {
        **{"A": A, "B": B, "C": [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], "discrete": discrete, "initial_range": [0.5, 1.0, 0.5]},
        **{"disturbance": {"state": 0.01, "output": 0.01}, **bounds},
        "feedback": {"state_weights": [0, 10, 0], "input_weights": [1, 1], "reference_bound": 1.0},
    }
    return parse_model(data, Path("m.toml"))


def test_matrices_take_bounds_entry_by_entry_continuous_or_discrete() -> None:
    A_pm = [[0.1, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.1]]
    built = load_model("platoon", {"plant.vehicles": 2, **drag(0.1)}).plant
    given = by_matrices(False, A_pm=A_pm).plant
    assert np.allclose(given.dA, built.dA, 1e-9, 0) and np.allclose(given.dB, built.dB, 1e-9, 0)
    direct = by_matrices(True, A_pm=A_pm, B_pm=[[0.01, 0.0], [0.0, 0.0], [0.0, 0.0]]).plant
    assert np.array_equal(direct.dA, np.array(A_pm)) and direct.dB[0, 0] == 0.01
    assert direct.hold_s is None


def test_bounds_of_a_wrong_shape_or_sign_are_refused() -> None:
    with pytest.raises(InputError, match="A_pm: expected 3 x 3"):
        by_matrices(False, A_pm=[[0.1]])
    with pytest.raises(InputError, match="B_pm: a bound is not negative"):
        by_matrices(True, B_pm=[[-0.01, 0.0], [0.0, 0.0], [0.0, 0.0]])


# ---- enclosure ----


def random_interval(dice: np.random.Generator) -> Interval:
    n, p = int(dice.integers(1, 6)), int(dice.integers(1, 4))

    def thin(shape: tuple[int, int]) -> Array:
        return np.asarray(dice.normal(size=shape) * (dice.random(shape) < 0.6))

    return Interval(2 * thin((n, n)), thin((n, p)), 0.4 * np.abs(thin((n, n))), 0.4 * np.abs(thin((n, p))))


def test_the_enclosure_holds_every_plant_inside() -> None:
    dice = np.random.default_rng(SEED)
    for _ in range(100):
        interval, sample = random_interval(dice), float(dice.choice([0.01, 0.1, 0.5]))
        dA, dB = enclosure(interval, sample)
        A, B = zero_order_hold(interval.A, interval.B, sample)
        for _ in range(10):
            other = zero_order_hold(*drawn(interval, dice), sample)
            assert np.all(np.abs(other[0] - A) <= dA + 1e-14 * np.abs(A).max()), "A"
            assert np.all(np.abs(other[1] - B) <= dB + 1e-14 * np.abs(A).max()), "B"


def test_the_enclosure_of_a_platoon_is_reached_at_its_corners() -> None:
    """A wider one would cost detection: at the upper end of all intervals every entry is at its bound."""
    plant = load_model("platoon", drag(0.2)).plant
    assert plant.interval is not None
    A, B = zero_order_hold(plant.interval.A + plant.interval.A_pm, plant.interval.B, 0.1)
    for found, bound in ((np.abs(A - plant.A), plant.dA), (np.abs(B - plant.B), plant.dB)):
        assert np.all(found <= bound)
        assert np.all(found[bound > 0] > 0.999 * bound[bound > 0])


def test_half_of_the_plants_drawn_are_corners() -> None:
    dice = np.random.default_rng(SEED)
    plant = load_model("platoon", drag(0.2)).plant
    corners = inside = 0
    for _ in range(200):
        other = draw(plant, dice)
        assert np.all(np.abs(other.A - plant.A) <= plant.dA) and np.all(np.abs(other.B - plant.B) <= plant.dB)
        assert other.feedback is plant.feedback and other.interval is None and not other.dA.any()
        drags = -np.log(other.A.diagonal()[::2]) / 0.1
        at_end = np.isclose(np.abs(drags - 1.0), 0.2, 0, 1e-9)
        corners += bool(at_end.all())
        inside += not at_end.any()
    assert corners + inside == 200 and 70 <= corners <= 130
    certain = load_model("platoon").plant
    assert draw(certain, dice) is certain and emulated(certain, SEED) == [certain]


# ---- reach ----


def simulated(model: Model, plants: list[Plant], dice: np.random.Generator, samples: int = 150, faults: Array | None = None, offset: Array | None = None) -> tuple[Array, Array]:
    """States (samples x n) and readings (samples x signals) of a loop whose plant is another one at every sample. `faults` (p): actuators."""
    plant = model.plant
    assert plant.feedback is not None
    quantum = np.array([model.signals[i].resolution for i in model.inputs])
    x = plant.initial_range * dice.choice([-1.0, 1.0], plant.n)
    push = dice.choice([-1.0, 1.0], plant.p)
    states, readings = [], []
    for k in range(samples):
        if k % 10 == 0:
            push = dice.choice([-1.0, 1.0], plant.p)
        u = quantum * np.round((-plant.feedback.gain @ x + plant.feedback.reference_bound * push) / quantum)  # as the wire carries it
        d = dice.choice([-1.0, 1.0], plant.Ed.shape[1])
        reading = np.zeros(len(model.signals))
        reading[model.outputs] = plant.C @ x + plant.Fd @ d
        reading[model.inputs] = u
        states.append(x)
        readings.append(reading + (0.0 if offset is None else offset))
        applied = u + (0.0 if faults is None else faults * push)
        now = plants[int(dice.integers(len(plants)))]
        x = now.A @ x + now.B @ applied + plant.Ed @ d
    return np.array(states), np.array(readings)


def holds(found: Reach, states: Array, readings: Array) -> None:
    assert np.all(np.abs(states).max(0) <= found.state + SMALL)
    assert np.all(np.abs(readings).max(0) <= found.signal + SMALL)
    for j in range(1, HORIZON + 1):
        assert np.all(np.abs(readings[j:] - readings[:-j]).max(0) <= found.slew[:, j - 1] + SMALL)


@pytest.mark.parametrize("pm", [0.1, 0.4])
def test_the_reach_holds_every_plant_inside_even_one_that_varies(pm: float) -> None:
    dice = np.random.default_rng(SEED)
    model = load_model("platoon", drag(pm))
    found = reach(model, HORIZON)
    for _ in range(15):
        holds(found, *simulated(model, [draw(model.plant, dice) for _ in range(int(dice.choice([1, 4])))], dice))


@pytest.mark.parametrize("pm", [0.1, 0.4])
def test_the_reach_holds_the_exact_one_of_every_corner(pm: float) -> None:
    """The reach of a certain plant is a maximum that some input attains."""
    model, certain = load_model("platoon", drag(pm)), reach(load_model("platoon"), HORIZON)
    plant, found = model.plant, reach(model, HORIZON)
    assert plant.interval is not None
    beyond = np.zeros(3, dtype=bool)
    for corner in itertools.product((-1.0, 1.0), repeat=3):
        A, B = zero_order_hold(plant.interval.A + np.diag(np.array([corner[0], 0.0, corner[1], 0.0, corner[2]]) * pm), plant.interval.B, 0.1)
        one = replace(plant, A=A, B=B, dA=np.zeros_like(A), dB=np.zeros_like(B), interval=None)
        extreme = reach(replace(model, plant=one), HORIZON)
        pairs = [(getattr(extreme, part), getattr(found, part), getattr(certain, part)) for part in ("state", "signal", "slew")]
        assert all(np.all(e <= f + SMALL) for e, f, _ in pairs)
        beyond |= [bool(np.any(e > c * 1.01)) for e, _, c in pairs]
    assert beyond.all(), "no corner leaves the reach of the middle: this test shows nothing"


def test_the_reach_is_wider_than_without_intervals_and_grows_with_them() -> None:
    certain, *wider = (reach(load_model("platoon", drag(pm)), HORIZON) for pm in (0.0, 0.05, 0.2))
    for narrow, wide in ((certain, wider[0]), (wider[0], wider[1])):
        assert np.all(narrow.state < wide.state) and np.all(narrow.slew[:3, 0] < wide.slew[:3, 0])


def test_intervals_that_nothing_bounds_are_refused_with_the_one_to_narrow() -> None:
    with pytest.raises(InputError, match=r"intervals too wide.*speed\d_mps.*make the pm that moves it smaller"):
        reach(load_model("platoon", drag(0.95)), HORIZON)


def test_states_that_only_their_drive_bounds_take_the_intervals_along() -> None:
    """Declared slews: no loop is asked, the speeds behind are bounded by their drag and the controls' ranges."""
    declared = {f"signals.{s}.slew": [1.0, 2.0] for s in ("gap12_m", "gap23_m", "speed1_mps")}
    certain, some = reach(load_model("platoon", declared), HORIZON), reach(load_model("platoon", declared | drag(0.2)), HORIZON)
    speed = certain.state[2]
    # dw/dt = -0.8 w + u, |u| <= 30: the slowest plant of the interval reaches 30/0.8 instead of 30.
    assert speed == pytest.approx(30.0, rel=0.05)
    assert 30.0 / 0.8 <= some.state[2] <= 1.3 * 30.0 / 0.8


def test_the_mismatch_holds_whatever_the_plant_inside_is() -> None:
    dice = np.random.default_rng(SEED)
    model = load_model("platoon", drag(0.3))
    found = reach(model, HORIZON)
    d0, Dy, Du = mismatch(model, found.state)
    assert np.count_nonzero(Dy.any(axis=0)) == 1, "speed1 is the only uncertain state that is an output"
    largest = found.signal.copy()
    constant = constant_mismatch(model, found.state, largest)
    for _ in range(20):
        other = draw(model.plant, dice)
        states, readings = simulated(model, [other], dice, 50)
        y, u = readings[:, model.outputs], readings[:, model.inputs]
        m = np.abs(states @ (other.A - model.plant.A).T + u @ (other.B - model.plant.B).T)
        assert np.all(m <= d0 + np.abs(y) @ Dy.T + np.abs(u) @ Du.T + SMALL)
        assert np.all(m <= constant + SMALL)


def test_a_certain_plant_has_no_mismatch() -> None:
    model = load_model("platoon")
    found = reach(model, HORIZON)
    assert not any(part.any() for part in mismatch(model, found.state))
    assert not uncertain(model) and disturbed(model, found.state, found.signal) is model


# ---- detectors ----


def made(models: Models, pm: float) -> Design:
    return models.design(drag(pm) | {"detector.observers.0.search.trials": 300}, "manoeuvres")


@pytest.mark.parametrize("real", ["f32", "q31"])
def test_no_false_alarm_on_any_plant_of_the_intervals_and_many_on_a_detector_that_knows_none(models: Models, real: str) -> None:
    dice = np.random.default_rng(SEED)
    design = made(models, 0.3)
    plants = [draw(design.model.plant, dice) for _ in range(40)]
    reference = design.model.scenario("manoeuvres").reference
    rows = Batch(Native(library(real), design.tables), design, 200, reference, (), SEED, plants=plants).runs(0, 200)
    assert sum(r["false_provisional"] for r in rows) == 0
    assert max(r["margin"] for r in rows) <= 1.0
    blind = models.design({}, "manoeuvres")
    rows = Batch(Native(library(real), blind.tables), blind, 200, reference, (), SEED, plants=plants).runs(0, 200)
    assert sum(r["false_provisional"] > 0 for r in rows) > 5, "these plants differ too little: this test shows nothing"


@pytest.mark.parametrize("real", ["f32", "q31"])
def test_no_false_alarm_on_a_plant_that_varies_within_its_intervals(models: Models, real: str) -> None:
    dice = np.random.default_rng(SEED)
    design = made(models, 0.3)
    native, scenario = Native(library(real), design.tables), design.model.scenario("manoeuvres")
    for _ in range(20):
        _, readings = simulated(design.model, [draw(design.model.plant, dice) for _ in range(8)], dice, 200)
        rows = Batch(native, design, 200, scenario.reference, (), SEED, series=readings).runs(0, 1)
        assert rows[0]["false_provisional"] == 0 and 0.0 < rows[0]["margin"] <= 1.0


def test_a_fault_is_still_found_and_costs_more(models: Models) -> None:
    design, certain = made(models, 0.1), models.design({}, "manoeuvres")
    assert np.all(design.generators[0].smallest > certain.generators[0].smallest)
    native, reference = Native(library("f32"), design.tables), design.model.scenario("manoeuvres").reference
    plants = [draw(design.model.plant, np.random.default_rng(SEED)) for _ in range(10)]
    rows = Batch(native, design, 200, reference, [parse_fault("controller2:bias:2.0@100")], SEED, plants=plants).runs(0, 30)
    assert all(r["provisional_at"] >= 100 for r in rows)


def test_run_i_emulates_plant_i_modulo_their_number(models: Models) -> None:
    design = made(models, 0.3)
    native, reference = Native(library("f32"), design.tables), design.model.scenario("manoeuvres").reference
    plants = [draw(design.model.plant, np.random.default_rng(SEED + i)) for i in range(3)]
    together = Batch(native, design, 60, reference, (), SEED, plants=plants)
    for run in range(7):
        alone = Batch(native, design, 60, reference, (), SEED, plants=[plants[run % 3]])
        assert np.array_equal(together.trace(run)["reading"], alone.trace(run)["reading"])
    seeded = Batch(native, design, 60, reference, (), SEED, plants=emulated(design.model.plant, SEED)).trace(1)["reading"]
    assert np.array_equal(Batch(native, design, 60, reference, (), SEED).trace(1)["reading"], seeded)
    assert not np.array_equal(Batch(native, design, 60, reference, (), SEED, plants=[design.model.plant]).trace(1)["reading"], seeded)
    together.config.plants = 0
    with pytest.raises(InputError, match="refused"):
        together.runs(0, 1)


def test_the_design_file_keeps_the_bounds_and_a_certain_ones_has_none(models: Models, tmp_path: Path) -> None:
    design = made(models, 0.1)
    path = tmp_path / "m.design.toml"
    store.write(path, "m", design.stored)
    again = store.read(path)
    assert again is not None and again.dA is not None and again.dB is not None
    assert np.array_equal(again.dA, design.stored.dA) and np.array_equal(again.dB, design.stored.dB)
    assert finish(design.model, again).tables == design.tables
    store.write(path, "m", replace(models.design({}).stored))
    assert "dA" not in path.read_text(encoding="utf-8")
    shipped = store.read(SHIPPED / "platoon.design.toml")
    assert shipped is not None and shipped.dA is None


def test_matrices_with_bounds_make_a_detector() -> None:
    model = by_matrices(True, A_pm=[[0.01, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.01]])
    model = replace(model, observers=tuple(replace(o, search=replace(o.search, trials=50)) for o in model.observers))
    assert finish(model, find(model, lambda *_: None)).tables.signals == 4


def test_a_plant_without_inputs_may_be_uncertain_too(tmp_path: Path) -> None:
    """A clock of its own closes the sample; the state decays at 0.8 +- 0.1 a sample: its reach is 0.05 / (1 - 0.9), or where it starts."""
    data = {
        **{key: PLATOON[key] for key in ("schema", "kind", "sample_time_s", "verdict")},
        "name": "heat",
        "plant": {"A": [[0.8]], "A_pm": [[0.1]], "C": [[1.0]], "discrete": True, "initial_range": [0.1], "disturbance": {"state": 0.05, "output": 0.01}},
        "signals": [{"name": "heat_k", "role": "output", "range": [-5.0, 5.0], "resolution": 0.001, "slew": "reachable"}],
        "groups": [
            {"name": "sensor", "signals": ["heat_k"], "frame": {"id": 0x110}, "trigger": {"delta": 0.0, "sigma": 0.02, "interval_max": 4}},
            {"name": "clock", "frame": {"id": 0x120}, "transmission": "tick"},
        ],
        "faults": [{"name": "heat_sensor", "signal": "heat_k", "type": "sensor"}],
        "detector": {"observers": [{"order": 1, "residuals": 1, "search": {"trials": 20}}]},
    }
    model = parse_model(data, Path("m.toml"))
    assert reach(model, HORIZON).state[0] == pytest.approx(0.5, rel=0.01)
    stored = find(model, lambda *_: None)
    store.write(tmp_path / "m.design.toml", "heat", stored)
    again = store.read(tmp_path / "m.design.toml")
    assert again is not None and finish(model, again).tables == finish(model, stored).tables


# ---- sizes of faults ----


def sized(pm: float = 0.0, **sizes: float) -> Model:
    data = tomllib.loads(tomli_w.dumps(PLATOON))
    for f in data["faults"]:
        f.pop("size_max", None)
        if f["name"] in sizes:
            f["size_max"] = sizes[f["name"]]
    data["plant"]["drag_per_s"] = {"value": 1.0, "pm": pm}
    return parse_model(data, Path("m.toml"))


def test_a_fault_has_a_largest_size_where_it_is_given() -> None:
    model = sized(controller2=3.0)
    assert [f.size_max for f in model.faults] == [None, 3.0, None, None, None, None]
    with pytest.raises(InputError, match="size_max"):
        sized(controller2=-1.0)


def test_without_a_size_nothing_is_added_and_the_healthy_reach_never_changes() -> None:
    plain = reach(load_model("platoon"), HORIZON)
    sizes = reach(sized(controller2=3.0, gap12_sensor=1.0), HORIZON)
    for a, b in ((plain.state, sizes.state), (plain.signal, sizes.signal), (plain.slew, sizes.slew)):
        assert np.array_equal(a, b)
    same = faulty_reach(sized(), plain)
    assert np.array_equal(same.state, plain.state) and np.array_equal(same.slew, plain.slew)


@pytest.mark.parametrize("pm", [0.0, 0.2])
def test_the_faulty_reach_holds_each_single_fault(pm: float) -> None:
    dice = np.random.default_rng(SEED)
    model = sized(pm, controller1=4.0, controller2=6.0, gap12_sensor=1.5)
    healthy = reach(model, HORIZON)
    found = faulty_reach(model, healthy)
    beyond = 0
    for place, size in ((0, 4.0), (1, 6.0)):
        for _ in range(6):
            states, readings = simulated(model, [draw(model.plant, dice)], dice, faults=np.eye(3)[place] * size)
            holds(found, states, readings)
            beyond += bool(np.any(np.abs(states).max(0) > healthy.state))
    assert beyond > 0 or pm > 0.0, "no fault left the healthy reach: this test shows nothing"
    states, readings = simulated(model, [draw(model.plant, dice)], dice)
    readings[60:, 0] += 1.5
    readings[90:, 0] -= 3.0
    holds(found, states, readings)


def test_a_sensors_fault_moves_its_reading_by_twice_its_size_and_nothing_else() -> None:
    model = sized(gap12_sensor=1.5)
    healthy = reach(model, HORIZON)
    found = faulty_reach(model, healthy)
    assert np.array_equal(found.state, healthy.state)
    assert np.allclose(found.slew[0] - healthy.slew[0], 3.0) and np.array_equal(found.slew[1:], healthy.slew[1:])
    assert found.signal[0] - healthy.signal[0] == pytest.approx(1.5)


def test_an_actuators_size_needs_a_loop_that_bounds_it() -> None:
    model = sized(controller1=2.0)
    healthy = reach(model, HORIZON)
    with pytest.raises(InputError, match=r"controller1.*stable loop"):
        faulty_reach(replace(model, plant=replace(model.plant, feedback=None)), healthy)
