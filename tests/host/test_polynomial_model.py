"""Models of kind "polynomial": functions of a model file against plain arithmetic, the emulated plant, filters in the detector, runs, campaigns, and every wrong input in one line."""

from __future__ import annotations

import csv
import itertools
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from host_support import SEED, Cli, Models
from hullguard.core.library import library
from hullguard.core.native import REST, Native, Plant
from hullguard.core.polynomial import Native as Arrays
from hullguard.core.statistic import emulated_plant, follow
from hullguard.design import polynomial as noises
from hullguard.design.design import Design
from hullguard.design.statistic import known_of, scaled_plant, statistic_table
from hullguard.errors import InputError
from hullguard.model import load_model
from hullguard.model.expression import compiled, evaluated, expanded, of_terms, value_of
from hullguard.model.polynomial import read_nonlinear
from hullguard.model.table import Table
from hullguard.plant.filters import Followed, filter_facts, filtered
from hullguard.plant.run import InProcess, Pace, Run, Trace

SHIPPED = ("cubic_suspension", "quadratic_sensor", "two_state", "battery_cell")
EVERY_TIME = {"groups.corner.trigger.interval_max": 1}
TEXT = "sin(x)*cos(2*x) + tan(x/4) - atan(3*x) + exp(-x*y)/2 + log(3 + y) + sqrt(2 + x + y) - tanh(x - y) + (x + y)**3 - -y**2 + k"


def run_of(made: Design, samples: int, seed: int, real: str = "f32") -> tuple[Trace, Followed]:
    native = Native(library(real), made.tables)
    source = Followed(native, made, made.model.scenario(None).reference, (), seed)
    return Run(made, native, InProcess(), Pace(True), None, REST).samples(source, samples), source


@pytest.fixture(scope="module")
def made(models: Models) -> dict[str, Design]:
    return {name: models.design(name=name, scenario="default") for name in SHIPPED}


# ---- functions ----


def test_a_program_is_its_expression_in_c_as_in_python() -> None:
    rng = np.random.default_rng(SEED)
    program = compiled(TEXT, ["x", "y"], {"k": 0.25}, "here")
    ffi, lib, native = library("f64").ffi, library("f64").lib, Arrays(library("f64"))
    c = ffi.new("hgh_program *", {"length": len(program.code), "code": native.new("int32_t[]", [v for p in program.code for v in p])})
    c.constant = native.array("double", program.constants)
    for x, y in rng.uniform(-0.9, 0.9, (50, 2)):
        said = eval(TEXT, {"__builtins__": {}, "x": x, "y": y, "k": 0.25} | {f: getattr(math, f) for f in ("sin", "cos", "tan", "atan", "exp", "log", "sqrt", "tanh")})
        assert value_of(program, [x, y]) == pytest.approx(said, rel=1e-12)
        assert lib.hgh_program_value(c, 1, [x], [y]) == pytest.approx(said, rel=1e-12)


@pytest.mark.parametrize("text", ["sin(3*x) + y", "tan(x)*y", "atan(4*x)", "exp(-6*x)", "log(2 + x + y)", "sqrt(2 + x)/(3 + y)", "tanh(3*x)", "x**3*y + y**2", "sin(1.4*atan(6*x))"])
def test_the_remainder_bounds_the_error_on_the_box_and_not_by_far(text: str) -> None:
    box, point, degree = (0.3, 0.2), (0.1, -0.2), 3
    program, orders = compiled(text, ["x", "y"], {}, "here"), noises.monomials(2, degree)
    found = expanded(program, point, (), orders, box, "here", ())
    taylor = noises.Polynomial(2, found.terms)
    worst = 0.0
    for dx, dy in itertools.product(np.linspace(-1, 1, 41), repeat=2):
        error = abs(value_of(program, [point[0] + box[0] * dx, point[1] + box[1] * dy]) - taylor([box[0] * dx, box[1] * dy]))
        worst = max(worst, error)
    assert worst <= found.remainder * (1 + 1e-9) + 1e-15
    assert found.remainder <= 6.0 * worst + 1e-12


def test_terms_and_the_expression_of_them_are_the_same() -> None:
    terms = of_terms([(0.8, (1, 0)), (1.0, (1, 1)), (0.1, (0, 0))])
    text = compiled("0.8*x1 + x1*x2 + 0.1", ["x1", "x2"], {}, "here")
    every = noises.monomials(2, 2)
    assert expanded(terms, (1.3, 0.1), (), every, (1, 1), "", ()) == expanded(text, (1.3, 0.1), (), every, (1, 1), "", ())
    assert evaluated(terms, [2.0, 3.0], lambda name, x: x) == pytest.approx(7.7)


def test_inputs_are_gains_and_nothing_else() -> None:
    found = expanded(compiled("x**2 + 3*u - u/4", ["x", "u"], {}, ""), (1.0,), (2.0,), noises.monomials(1, 2), (1.0,), "", ("u",))
    assert found.input == (2.75,) and found.terms == {(0,): 6.5, (1,): 2.0, (2,): 1.0} and found.remainder == 0.0
    for text in ("x*u", "u**2", "sin(u)"):
        with pytest.raises(InputError, match="must enter linearly"):
            expanded(compiled(text, ["x", "u"], {}, ""), (1.0,), (0.0,), noises.monomials(1, 2), (1.0,), "here", ("u",))


# ---- noise and the emulated plant ----


@pytest.mark.parametrize(
    "noise", [noises.laplace(0.2), noises.student(0.2, 9.0), noises.contaminated(0.2, 0.1, 3.0), noises.exponential(-0.2), noises.two_point(0.2, 0.3), noises.samples([0.1, 0.5, -0.4, 0.3])], ids=lambda n: str(n.kind)
)
def test_draws_have_the_moments(noise: noises.Noise) -> None:
    lib, ffi, native, count = library("f64").lib, library("f64").ffi, Arrays(library("f64")), 40_000
    made, random = native.noises([noise]), ffi.new("hgh_random *")
    lib.hgh_random_start(random, SEED, 0, 7)
    drawn = np.array([lib.hgh_noise_draw(made, random) for _ in range(count)])
    for order in (1, 2, 3):
        spread = math.sqrt(noise.moment(2 * order) / count)
        assert abs(np.mean(drawn**order) - noise.moment(order)) < 5.0 * spread


def test_the_emulated_plant_is_the_model_and_not_its_expansion(made: dict[str, Design]) -> None:
    plant = made["battery_cell"].model.plant.nonlinear
    assert plant is not None
    quiet = replace(plant, w=tuple(n.scaled(0.0) for n in plant.w), v=tuple(n.scaled(0.0) for n in plant.v))
    c, kept = emulated_plant(library("f64"), quiet)
    lib, ffi = library("f64").lib, library("f64").ffi
    random = ffi.new("hgh_random *")
    x, u = [0.05, 0.01], [40.0]  # far outside the box, where the expansion is wrong
    relaxed = math.exp(-1.0 / 30.0)
    assert lib.hgh_nonlinear_output(c, 2, 0, x, u, random) == pytest.approx(3.4 + 0.7 * 0.05 - 0.4 * math.exp(-0.3) - 0.01 - 0.06, abs=1e-12)
    assert lib.hgh_nonlinear_state(c, 2, 1, x, u, random) == pytest.approx(relaxed * 0.01 + 0.001 * (1 - relaxed) * 40.0, abs=1e-15)
    assert kept


def test_faults_act_where_they_are_declared(made: dict[str, Design]) -> None:
    d = made["cubic_suspension"]
    native = Native(library("f64"), d.tables)

    def states(faults: tuple[str, ...]) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
        from hullguard.model import parse_fault

        source = Plant(native, d, d.model.scenario(None).reference, [parse_fault(f) for f in faults], SEED % 1000)
        rows = []
        for _ in range(30):
            reading = source.read()
            rows.append((source.state, reading))
            source.move()
        return np.array([r[0] for r in rows]), np.array([r[1] for r in rows])

    healthy, pushed, biased = states(()), states(("actuator:bias:240@10",)), states(("deflection_sensor:bias:0.1@10",))
    assert np.array_equal(healthy[0][:11], pushed[0][:11]) and pushed[0][11, 1] - healthy[0][11, 1] == pytest.approx(0.01, rel=1e-6)
    assert np.array_equal(healthy[0], biased[0]) and np.allclose(biased[1][10:, 0] - healthy[1][10:, 0], 0.1)


# ---- filters ----


def test_a_filter_in_scaled_variables_is_the_one_in_the_models(made: dict[str, Design]) -> None:
    """The scaled plant maps scaled states as the model maps states."""
    plant = made["battery_cell"].model.plant.nonlinear
    assert plant is not None
    scaled, rng = scaled_plant(plant, [0]), np.random.default_rng(SEED)
    for xi in rng.uniform(-0.5, 0.5, (20, 2)):
        x = np.array(plant.point) + np.array(scaled.unit) * xi
        less = x - np.array(plant.point)
        for row, e, s, c in zip(scaled.plant.f, plant.of_f, scaled.unit, plant.point, strict=True):
            assert row(xi) * s + c == pytest.approx(noises.Polynomial(2, e.terms)(less), abs=1e-12)
        assert scaled.plant.h[0](xi) / scaled.gain[0] == pytest.approx(noises.Polynomial(2, plant.of_h[0].terms)(less), abs=1e-12)
    assert all(math.log2(v) % 1.0 == 0.0 for v in (*scaled.unit, *scaled.gain))


@pytest.mark.parametrize("real", ["f32", "f64"])
def test_the_detector_judges_by_what_the_filter_says(made: dict[str, Design], real: str) -> None:
    d = made["cubic_suspension"]
    trace, _ = run_of(d, 200, SEED % 1000, real)
    alone = follow(library(real), d.tables.polynomials[0], np.array(trace.value), np.array(trace.radius))
    assert np.array_equal(np.array(trace.r), alone.r) and np.array_equal(np.array(trace.J), alone.J)
    above = np.any(alone.r > alone.J, axis=1) & (alone.ready > 0.0)
    alarms = np.array([v.plant in ("provisional", "confirmed") for v in trace.verdict])
    assert np.all(alarms[above]) and trace.verdict[0].plant == "starting"


def test_powers_gain_on_skewed_noise_and_claim_what_they_have(models: Models) -> None:
    """Every sample sent: the extended Kalman filter beside degrees 2 and 3."""
    d = models.design(EVERY_TIME, "default", "cubic_suspension")
    found = []
    for seed in range(4):
        trace, source = run_of(d, 500, 1000 + seed)
        found.append(filter_facts(filtered(d, library("f32"), trace, source.states), ())["filters"])
    error = [math.sqrt(np.mean([f[i]["error_rms"]["deflection"] ** 2 for f in found])) for i in range(3)]
    honest = [np.mean([f[i]["consistency"]["deflection"] for f in found]) for i in range(3)]
    assert error[1] < 0.92 * error[0] and error[2] < error[1]
    assert all(0.7 < c < 1.3 for c in honest)
    assert [f["lifted"] for f in found[0]] == [2, 5, 9] and [f["own"] for f in found[0]] == [False, True, False]


def test_a_limit_of_memory_says_what_would_fit(models: Models) -> None:
    with pytest.raises(InputError, match=r"cubic_suspension.toml: detector.polynomial: degree 3 with 2 states and 1 outputs takes \d+ bytes; what fits: degree 2"):
        Models().design({"detector.polynomial.0.degree": 3, "detector.polynomial.0.ram_limit_bytes": 2100}, "default", "cubic_suspension")
    d = models.design(scenario="default", name="cubic_suspension")
    spec, known = d.model.polynomials[0], known_of(d.tables.groups, d.usual.tolist())
    size = 4 * d.tables.polynomials[0].reals
    assert statistic_table(d.model, replace(spec, ram=size), known).reals * 4 == size
    with pytest.raises(InputError, match="what fits"):
        statistic_table(d.model, replace(spec, ram=size - 1), known)


def test_tables_say_the_memory_that_the_library_takes(made: dict[str, Design]) -> None:
    for d in made.values():
        native = Native(library("f32"), d.tables)
        assert native.library.lib.hg_detector_reals(native.node.detector) == d.tables.reals


# ---- the command ----


def test_a_run_finds_its_fault_and_compares_the_degrees(cli: Cli, tmp_path: Path) -> None:
    out = tmp_path / "run"
    done = cli("run", "cubic_suspension", "--bus", "inprocess", "--json", "--expect", "detect", "--out", out)
    assert done.status == 0, done.err
    found = done.json
    assert found["faults"][0]["candidates"] == ["actuator", "deflection_sensor"] and found["faults"][0]["delay"] <= 20
    assert found["judges"] == [{"name": "polynomial filter of degree 2", "kind": "statistic", "residuals": 3}]
    assert [f["degree"] for f in found["filters"]] == [1, 2, 3]
    assert found["filters"][1]["false_alarms"] == {"plain": 0, "joint": 0, "drift": 0}
    header = (out / "filters.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert {"1.2.deflection.truth", "1.3.body_mps.deviation", "1.1.J.joint"} <= set(header)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "filters-errors" in page and "filters-statistics" in page and "basis is statistical" in page


def test_a_recording_is_replayed(cli: Cli, tmp_path: Path) -> None:
    assert cli("run", "battery_cell", "--bus", "inprocess", "--quiet", "--samples", 250, "--no-fault", "--out", tmp_path / "run").status == 0
    with (tmp_path / "run" / "signals.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    recording = tmp_path / "drive.csv"
    recording.write_text("voltage_v,current_a\n" + "".join(f"{r['voltage_v']},{r['current_a']}\n" for r in rows), encoding="utf-8")
    done = cli("replay", "battery_cell", "--csv", recording, "--bus", "inprocess", "--json", "--fault", "voltage_sensor:bias:0.03@200")
    assert done.status == 0, done.err
    assert done.json["faults"][0]["detected_at"] is not None and "error_rms" not in done.json["filters"][0]


def test_a_campaign_counts_false_alarms_also_where_frames_are_lost(cli: Cli) -> None:
    done = cli("campaign", "cubic_suspension", "--runs", 20, "--samples", 300, "--workers", 1, "--no-fault", "--json", "--seed", SEED, "--loss", "0,0.1")
    assert done.status == 0, done.err
    assert done.json["basis"] == "statistical"
    # 2 in 10 000 samples is what the levels are for; a tenth of the frames lost must not make it another number.
    for case in done.json["cases"]:
        assert case["provisional_alarm_runs"] <= 7, case


def test_what_needs_bounds_is_refused(cli: Cli) -> None:
    for command in (("limit", "cubic_suspension"), ("campaign", "cubic_suspension", "--runs", 2, "--no-fault", "--attack", "0.5")):
        done = cli(*command)
        assert done.status == 2 and "no bounds to choose within" in done.err and done.err.count("\n") == 1
    done = cli("run", "cubic_suspension", "--bus", "inprocess", "--real", "q31")
    assert done.status == 2 and "not for fixed point: the moments of a polynomial filter" in done.err


BAD: tuple[tuple[dict[str, Any], str], ...] = (
    ({"plant.f": ["deflection"]}, "expected 2 entries"),
    ({"plant.f": ["deflection +", "body_mps"]}, "is no expression"),
    ({"plant.f": ["velocity", "body_mps"]}, "'velocity' is none of"),
    ({"plant.f": ["__import__('os')", "body_mps"]}, "is none of"),
    ({"plant.f": ["deflection * force_n", "body_mps"]}, "must enter linearly"),
    ({"plant.f": ["log(deflection)", "body_mps"]}, "no finite Taylor coefficient"),
    ({"plant.f": ["sqrt(deflection + 0.1)", "body_mps"]}, "no finite derivatives everywhere on the box"),
    ({"plant.f": [3.0, "body_mps"]}, "expected an expression, or terms"),
    ({"plant.f": [[[1.0]], "body_mps"]}, "expected [coefficient, [exponents of the 2 states]]"),
    ({"plant.f": [[[1.0, [0.5, 0]]], "body_mps"]}, "expected whole numbers"),
    ({"plant.states": []}, "name the states"),
    ({"plant.states": ["sin", "body_mps"]}, "cannot name a state"),
    ({"plant.parameters.force_n": 1.0}, "choose another"),
    ({"plant.expansion": 1}, "remainder of body_mps on the box"),
    ({"plant.noise.deflection_m.deviation": 0.0}, "a sensor without noise"),
    ({"plant.noise.body_mps.kind": "gamma"}, "is not one of normal"),
    ({"plant.noise.body_mps": {"kind": "student", "deviation": 0.1, "degrees_of_freedom": 3.5}}, "no moment of order 4"),
    ({"plant.noise.body_mps": {"kind": "samples", "file": "none.csv", "column": "w"}}, "cannot be read"),
    ({"signals.deflection_m.resolution": 0.02}, "quantisation of deflection_m"),
    ({"signals.deflection_m.slew": "reachable"}, "declare the slew as a list"),
    ({"detector.polynomial": []}, "no filter"),
    ({"detector.polynomial.0.degree": 4}, "4 is outside 1 .. 3"),
    ({"detector.polynomial.0.outputs": ["force_n"]}, "'force_n' is not one of deflection_m"),
    ({"detector.polynomial.0.outputs": []}, "a filter without a measurement"),
    ({"detector.polynomial.0.faults": ["tyre"]}, "'tyre' is not one of actuator"),
    ({"detector.prediction": True}, "it needs the bounds of a linear plant"),
    ({"detector.bank": {"size": 4}}, "it needs the bounds of a linear plant"),
)


@pytest.mark.parametrize(("changes", "says"), BAD, ids=[str(i) for i in range(len(BAD))])
def test_wrong_input_is_told_in_one_line(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError) as told:
        Models().design(changes, "default", "cubic_suspension")
    assert says in str(told.value) and "\n" not in str(told.value)


def test_noise_is_read_from_samples(tmp_path: Path) -> None:
    (tmp_path / "noise.csv").write_text("v\n" + "".join(f"{x}\n" for x in (0.1, 0.3, -0.1, 0.5)), encoding="utf-8")
    shown = {"kind": "samples", "file": "noise.csv", "column": "v"}
    table: dict[str, Any] = {"states": ["x"], "f": ["x/2"], "h": {"y": "x"}, "box": [1.0], "initial": {"deviation": [1.0]}, "noise": {"x": {"kind": "normal", "deviation": 0.1}, "y": shown}}
    plant = read_nonlinear(Table(table, "plant"), ["y"], [], 0.1, tmp_path / "model.toml").nonlinear
    assert plant is not None and plant.v[0].moment(2) == pytest.approx(0.05) and plant.v[0].moment(1) == pytest.approx(0.0)
    table["noise"]["y"] = shown | {"column": "w"}
    with pytest.raises(InputError, match="has no column 'w': v"):
        read_nonlinear(Table(table, "plant"), ["y"], [], 0.1, tmp_path / "model.toml")
    (tmp_path / "noise.csv").write_text("v\nx\n", encoding="utf-8")
    table["noise"]["y"] = shown
    with pytest.raises(InputError, match="no number"):
        read_nonlinear(Table(table, "plant"), ["y"], [], 0.1, tmp_path / "model.toml")


def test_shipped_models_start_and_run(made: dict[str, Design]) -> None:
    for name, d in made.items():
        trace, source = run_of(d, 120, SEED % 1000)
        assert len(source.states) == 120 and trace.verdict[-1].plant in ("none", "provisional", "confirmed"), name
        assert load_model(name).polynomials[0].degree == d.tables.polynomials[0].degree
