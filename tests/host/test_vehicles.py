"""Platoons of any length from one model file: templates give the model that one would write by hand, and what comes of it works end to end."""

from __future__ import annotations

import subprocess
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from host_support import ROOT, SEED, Alarms, Cli, Models, alarms
from hullguard.codegen import emit_dbc, write_all
from hullguard.core.library import library
from hullguard.core.native import Batch, Native, read_verdict
from hullguard.core.native import Node as NativeNode
from hullguard.design.design import Design, find, observed, sub_plant, usual_radius
from hullguard.design.tables import BRS, FD, message_table, verdict_table
from hullguard.errors import InputError
from hullguard.model import load_model, parse_fault
from hullguard.model.schema import SHIPPED, Frame, parse_model
from hullguard.model.templates import expand

PLATOON = tomllib.loads((SHIPPED / "platoon.toml").read_text(encoding="utf-8"))
LENGTHS = (2, 4, 20)
DIGITS_OF_2 = """
[plant]
builder = "string_of_vehicles"
vehicles = 2
drag_per_s = 1.0
initial_range = [0.5, 1.0, 0.5]
disturbance = { state = 0.01, output = 0.01 }
feedback = { state_weights = [0, 10, 0], input_weights = [1, 1], reference_bound = 1.0 }

[[signals]]
name = "gap12_m"
role = "output"
range = [-20.0, 20.0]
resolution = 0.001
slew = "reachable"

[[signals]]
name = "speed1_mps"
role = "output"
range = [-20.0, 20.0]
resolution = 0.001
slew = "reachable"

[[signals]]
name = "control1_mps2"
role = "input"
range = [-30.0, 30.0]
resolution = 0.001

[[signals]]
name = "control2_mps2"
role = "input"
range = [-30.0, 30.0]
resolution = 0.001

[[faults]]
name = "controller1"
signal = "control1_mps2"
type = "actuator"
size_max = 3.0

[[faults]]
name = "controller2"
signal = "control2_mps2"
type = "actuator"
size_max = 3.0

[[faults]]
name = "gap12_sensor"
signal = "gap12_m"
type = "sensor"
size_max = 3.0

[[faults]]
name = "speed1_sensor"
signal = "speed1_mps"
type = "sensor"
size_max = 3.0
"""


def of(vehicles: int) -> dict[str, Any]:
    return expand(PLATOON | {"plant": PLATOON["plant"] | {"vehicles": vehicles}}, "m.toml")


def made(models: Models, vehicles: int) -> Design:
    return models.design({"plant.vehicles": vehicles}, "manoeuvres")


# ---- templates ----


def test_two_vehicles_expand_to_what_one_would_write_by_hand() -> None:
    found, hand = of(2), tomllib.loads(DIGITS_OF_2)
    for key in ("plant", "signals", "faults"):
        assert found[key] == hand[key]
    assert [g["signals"] for g in found["groups"]] == [["gap12_m", "speed1_mps"], ["control1_mps2", "control2_mps2"]]
    assert found["groups"][0]["trigger"]["sigma"] == [0.05, 0.05]
    assert found["detector"]["observers"] == [{"order": 4, "residuals": 2, "faults": ["controller1", "controller2"], "search": {"trials": 3000, "seed": 1}}]


def test_three_vehicles_have_the_signal_vector_of_the_shipped_tables() -> None:
    model = load_model("platoon")
    assert [s.name for s in model.signals] == ["gap12_m", "gap23_m", "speed1_mps", "control1_mps2", "control2_mps2", "control3_mps2"]


@pytest.mark.parametrize("name", ["platoon", "openacc"])
def test_a_shipped_models_design_was_made_for_what_its_templates_expand_to(name: str) -> None:
    design = tomllib.loads((SHIPPED / f"{name}.design.toml").read_text(encoding="utf-8"))
    assert load_model(name).sha256 == design["model_sha256"]


@pytest.mark.parametrize("vehicles", range(2, 21))
def test_every_length_has_its_signals_faults_and_observers(vehicles: int) -> None:
    model = load_model("platoon", {"plant.vehicles": vehicles})
    assert len(model.outputs) == len(model.inputs) == vehicles
    assert model.plant.states[-3:] == (f"speed{vehicles - 1}_mps", f"gap{vehicles - 1}{vehicles}_m", f"speed{vehicles}_mps")
    assert len(model.faults) == (2 * vehicles if vehicles <= 16 else vehicles + 1)
    assert len(model.observers) == (1 if vehicles <= 3 else vehicles)
    covered = {f for o in model.observers for f in o.faults}
    assert {model.faults[f].name for f in covered} == {f"controller{i + 1}" for i in range(vehicles)}
    assert parse_model(of(vehicles), model.path).sha256 == model.sha256


def test_a_model_without_templates_stays_as_it_is_and_expanding_twice_is_expanding_once() -> None:
    once = of(5)
    assert expand(once, "m.toml") == once
    assert once is not expand(once, "m.toml")
    assert tomllib.loads(DIGITS_OF_2) == expand(tomllib.loads(DIGITS_OF_2), "m.toml")


def test_neighbouring_entries_take_turns_and_numbers_grow() -> None:
    data = {
        "plant": {"builder": "car_following", "cars": 4},
        "signals": [{"name": "speed1_mps"}, {"each": "gap", "name": "speed{j}_mps"}, {"each": "gap", "name": "gap{j}_m", "slew": [1.0]}],
        "groups": [{"each": "gap", "name": "car{j}", "signals": ["speed{j}_mps", "gap{j}_m"], "frame": {"id": {"first": 0x220, "step": 0x10}}}],
    }
    found = expand(data, "m.toml")
    assert [s["name"] for s in found["signals"]] == ["speed1_mps", "speed2_mps", "gap2_m", "speed3_mps", "gap3_m", "speed4_mps", "gap4_m"]
    assert [g["frame"]["id"] for g in found["groups"]] == [0x220, 0x230, 0x240]
    assert found["groups"][2]["signals"] == ["speed4_mps", "gap4_m"]
    assert [s.get("slew") for s in found["signals"]] == [None, None, [1.0], None, [1.0], None, [1.0]]


WRONG = [
    ({"signals": [{"each": "wheel", "name": "w{i}"}]}, "signals[0].each", "'wheel' is not one of vehicle, gap"),
    ({"signals": [{"each": "gap", "name": "gap{k}_m"}]}, "signals[0]", "{k} is not one of {i}, {j}"),
    ({"signals": [{"each": 3, "name": "gap_m"}]}, "signals[0].each", "'3' is not one of"),
    ({"signals": [{"when": {"vehicles": 3}, "name": "gap_m"}]}, "signals[0].when", "vehicles = [smallest, largest]"),
    ({"signals": [{"when": {"cars": [2, 3]}, "name": "gap_m"}]}, "signals[0].when", "vehicles = [smallest, largest]"),
    ({"signals": [{"when": {"vehicles": [4, 3]}, "name": "gap_m"}]}, "signals[0].when", "vehicles = [smallest, largest]"),
    ({"groups": [{"signals": [{"each": "gap", "name": "g", "role": "x"}]}]}, "groups[0].signals", "expected names"),
    ({"detector": {"observers": [{"faults": [{"each": "vehicle", "name": "c{j}"}]}]}}, "detector.observers[0].faults", "{j} is not one of {i}"),
    ({"signals": [{"each": "gap", "name": "g{i}"}], "plant": {"A": [[1.0]]}}, "signals[0].each", "builder"),
    ({"signals": [{"when": {"vehicles": [2, 3]}, "name": "g"}], "plant": {"A": [[1.0]]}}, "signals[0].when", "builder"),
    ({"signals": [{"each": "gap", "name": "g{i}"}], "plant": {"builder": "train", "vehicles": 3}}, "plant.builder", "'train' is not one of"),
    ({"signals": [{"each": "gap", "name": "g{i}"}], "plant": {"builder": "string_of_vehicles", "vehicles": 21}}, "plant.vehicles", "2 .. 20"),
    ({"signals": [{"each": "gap", "name": "g{i}"}], "plant": {"builder": "string_of_vehicles"}}, "plant", "'vehicles' is missing"),
]


@pytest.mark.parametrize(("change", "where", "why"), WRONG, ids=[w for _, w, _ in WRONG])
def test_a_template_that_makes_no_sense_is_refused_in_one_line(change: dict[str, Any], where: str, why: str) -> None:
    with pytest.raises(InputError) as error:
        expand(PLATOON | change, "m.toml")
    assert where in str(error.value) and why in str(error.value) and "\n" not in str(error.value)
    assert str(error.value).startswith("m.toml.") or str(error.value).startswith("m.toml:")


BY_NAME = [
    ("plant.initial_range", {"speed": 0.5}, "nothing for 'gap12_m'"),
    ("plant.initial_range", {"speed": 0.5, "gap": 1.0, "angle": 2.0}, "'angle' is the beginning of none"),
    ("plant.initial_range", {"speed": 0.5, "gap": -1.0}, "outside"),
    ("plant.feedback.input_weights", {"gap": 1}, "nothing for 'control1_mps2'"),
    ("groups.measurement.trigger.sigma", {"gap": 0.05}, "nothing for 'speed1_mps'"),
    ("plant.disturbance.output", {"gap": 0.01}, "nothing for 'speed1_mps'"),
]


@pytest.mark.parametrize(("key", "value", "why"), BY_NAME)
def test_a_vector_by_name_that_does_not_fit_is_refused(key: str, value: Any, why: str) -> None:
    with pytest.raises(InputError) as error:
        load_model("platoon", {key: value})
    assert why in str(error.value) and key.rsplit(".", 1)[1] in str(error.value)


def test_a_whole_name_beats_what_it_begins_with() -> None:
    model = load_model("platoon", {"plant.initial_range": {"speed": 0.5, "gap": 1.0, "speed2_mps": 0.25}, "plant.disturbance.output": {"gap": 0.02, "speed": 0.01}})
    assert model.plant.initial_range.tolist() == [0.5, 1.0, 0.25, 1.0, 0.5]
    assert model.plant.Fd[:, -3:].diagonal().tolist() == [0.02, 0.02, 0.01]


def test_an_override_names_entries_as_they_are_for_the_length_asked_for() -> None:
    model = load_model("platoon", {"plant.vehicles": 7, "signals.gap67_m.resolution": 0.01})
    assert [s.resolution for s in model.signals if s.name == "gap67_m"] == [0.01]
    with pytest.raises(InputError, match="no entry 'gap78_m'"):
        load_model("platoon", {"plant.vehicles": 7, "signals.gap78_m.resolution": 0.01})


# ---- frames ----


@pytest.mark.parametrize(("length", "sent"), [(2, 2), (8, 8), (9, 12), (12, 12), (21, 24), (33, 48), (42, 48), (49, 64), (64, 64)])
def test_a_frame_is_classic_while_it_fits_and_of_can_fd_beyond(length: int, sent: int) -> None:
    table = message_table("g", Frame(0x100, False, None, 1), length)
    assert table.length == sent
    assert bool(table.flags & FD) == bool(table.flags & BRS) == (length > 8)
    if length > 8:
        with pytest.raises(InputError, match="fd = true"):
            message_table("g", Frame(0x100, False, False, 1), length)


def test_more_than_64_bytes_are_refused() -> None:
    with pytest.raises(InputError, match="split the group"):
        message_table("g", Frame(0x100, False, None, 1), 65)


def test_more_than_16_faults_need_a_longer_verdict_frame(models: Models) -> None:
    assert made(models, 2).tables.verdict.length == 8
    wide = made(models, 20).tables.verdict
    assert (wide.length, bool(wide.flags & FD)) == (12, True)
    with pytest.raises(InputError, match="verdict frame"):
        verdict_table(load_model("platoon", {"plant.vehicles": 20, "verdict.frame.fd": False}))


def test_more_than_32_faults_or_signals_in_a_frame_are_refused() -> None:
    many = {"signals": [{"name": f"s{i}", "role": "output", "range": [0.0, 1.0], "resolution": 0.01} for i in range(33)]}
    with pytest.raises(InputError, match="33 signals, a frame has room for 32"):
        parse_model(of(3) | many | {"groups": [of(3)["groups"][0] | {"signals": [f"s{i}" for i in range(33)]}]}, Path("m.toml"))
    faults = [{"name": f"f{i}", "signal": "gap12_m", "type": "sensor"} for i in range(33)]
    with pytest.raises(InputError, match="33 faults, the verdict frame has room for 32"):
        parse_model(of(3) | {"faults": faults}, Path("m.toml"))


# ---- end to end ----


@pytest.mark.parametrize("vehicles", LENGTHS)
def test_no_false_alarm_and_every_controllers_fault_is_found(models: Models, vehicles: int) -> None:
    design = made(models, vehicles)
    native, reference = Native(library("f32"), design.tables), design.model.scenario("manoeuvres").reference
    rows = Batch(native, design, 200, reference, (), SEED).runs(0, 100)
    assert alarms(rows) == Alarms(0, 0)
    assert max(r["margin"] for r in rows) <= 1.0
    for vehicle in {1, vehicles // 2 + 1, vehicles}:
        rows = Batch(native, design, 200, reference, [parse_fault(f"controller{vehicle}:bias:2.0@100")], SEED).runs(0, 30)
        assert alarms(rows) == Alarms(0, 0)
        assert all(100 <= r["provisional_at"] <= 130 for r in rows)
        assert all(r["candidates"] >> (vehicle - 1) & 1 for r in rows), "the true fault is not among the candidates"


def test_a_gap_and_the_controls_beside_it_are_exact_by_themselves(models: Models) -> None:
    """T B of every control that the generator does not read is zero: thresholds do not pay for it."""
    design = made(models, 20)
    for g in design.generators[:-1]:
        model = design.model
        hidden = [i for i in range(model.plant.p) if i not in g.spec.inputs]
        assert np.abs(g.observer.T @ model.plant.B[:, hidden]).max() * 30.0 < 1e-12 * np.abs(g.observer.T).max()
        assert max(g.smallest) < 0.7


def test_a_search_looks_at_the_states_behind_its_outputs_only() -> None:
    model = load_model("platoon", {"plant.vehicles": 20})
    radius = usual_radius(model)
    whole = sub_plant(model, model.observers[5], radius)
    part, _ = observed(whole, [])
    assert part.A.shape == (3, 3) and part.B.shape == (3, 2) and part.Ed.shape[1] < whole.Ed.shape[1]
    k = 7
    assert np.allclose(whole.C @ np.linalg.matrix_power(whole.A, k) @ whole.B, part.C @ np.linalg.matrix_power(part.A, k) @ part.B, 0, 1e-15)
    three = load_model("platoon")
    full = sub_plant(three, three.observers[0], usual_radius(three))
    assert observed(full, [])[0].A.shape == (5, 5)


@pytest.mark.parametrize("vehicles", LENGTHS)
def test_the_tables_compile_without_a_warning_and_cantools_reads_the_dbc(models: Models, vehicles: int, tmp_path: Path) -> None:
    design = made(models, vehicles)
    write_all(design, tmp_path)
    warn = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wdouble-promotion", "-Wundef", "-Werror"]
    include = ["-I", str(ROOT / "firmware" / "include"), "-I", str(tmp_path)]
    subprocess.run(["gcc", *warn, "-DHG_REAL_F32=1", *include, "-c", str(tmp_path / "platoon.c"), "-o", str(tmp_path / "platoon.o")], check=True)
    database = cantools.database.load_string(emit_dbc(design), "dbc")
    assert isinstance(database, cantools.database.can.Database)
    measurement = database.get_message_by_frame_id(0x110)
    assert measurement.length == design.tables.groups[0].message.length
    assert measurement.is_fd == (vehicles > 3)
    assert [s.name for s in measurement.signals if not s.name.startswith("E2E")] == [design.model.signals[i].name for i in design.model.groups[0].signals]


def test_all_candidates_of_a_long_platoon_pass_through_its_verdict_frame(models: Models) -> None:
    design = made(models, 20)
    native = Native(library("f32"), design.tables)
    database = cantools.database.load_string(emit_dbc(design), "dbc")
    node = NativeNode(native, 1)
    for candidates in (0, 1, 0x8000, 0x10000, 0x100001, 0x1FFFFF):
        node._verdict.candidates, node._verdict.plant = candidates, 3
        frame = node.report(True)[0]
        told = read_verdict(native, frame)
        assert told is not None and told.candidates == candidates
        decoded = database.decode_message(frame.id, frame.data)
        assert isinstance(decoded, dict)
        said = {name.removeprefix("fault_") for name, value in decoded.items() if name.startswith("fault_") and str(value) == "candidate"}
        assert said == {f.name for i, f in enumerate(design.model.faults) if candidates >> i & 1}


@pytest.mark.parametrize("vehicles", [2, 20])
def test_the_command_designs_and_runs_it(cli: Cli, vehicles: int, tmp_path: Path) -> None:
    done = cli("design", "platoon", "--set", f"plant.vehicles={vehicles}", "--out", tmp_path, "--json")
    assert done.status == 0, done.err
    found = done.json
    assert len(found["generators"]) == (1 if vehicles == 2 else 20)
    assert all(c["passed"] for c in found["checks"])
    done = cli("run", "platoon", "--set", f"plant.vehicles={vehicles}", "--bus", "inprocess", "--samples", 200, "--fault", f"controller{vehicles}:bias:2.0@100", "--expect", "detect", "--json")
    assert done.status == 0, done.err
    assert done.json["false_alarms"] == {"provisional": 0, "confirmed": 0}
    assert f"controller{vehicles}" in done.json["faults"][0]["candidates"]


def test_what_a_gap_tells_does_not_depend_on_how_long_the_platoon_is() -> None:
    """The same local observer in platoons of 5 and 12: the smallest fault it shows is the same."""
    smallest = []
    for vehicles in (5, 12):
        model = load_model("platoon", {"plant.vehicles": vehicles})
        smallest.append(find(replace(model, observers=model.observers[1:2]), lambda *_: None).observers[0].smallest)
    assert smallest[0] == pytest.approx(smallest[1], rel=1e-3)
