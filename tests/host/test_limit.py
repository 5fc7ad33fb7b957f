"""Window forms against recursion, the limit against a dense programme solved from scratch, and the command that reports it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from host_support import SEED, Cli, Models
from hullguard.campaign.tasks import Emulator
from hullguard.design.bank import usual_scale
from hullguard.design.design import Design
from hullguard.design.limit import EXPLAINED, Explanation, first_unexplained
from hullguard.design.window import Varying, WindowForm, fault_response, window_form
from hullguard.model import parse_fault
from hullguard.model.schema import Fault, Model, Reference
from hullguard.model.table import Array
from scipy.optimize import linprog
from window_support import faulty, random_designs, simulate, with_faults

PLANTS, WINDOW = 8, 7
START, SAMPLES = 60, 110


@pytest.fixture(scope="module")
def designs() -> list[Design]:
    return random_designs(SEED, PLANTS)


def dense(model: Model, form: WindowForm, value: Array, radius: Array, scale: Array, free: Fault | None) -> float:
    """Least t of min t, |y - Mu u - O x0 - Md d - Mu eu - Gamma f| <= radius + t scale, as one dense programme."""
    y, u = value[:, model.outputs].ravel(), value[:, model.inputs].ravel()
    ry, ru = radius[:, model.outputs].ravel(), radius[:, model.inputs].ravel()
    gamma = np.zeros((len(y), 0)) if free is None else fault_response(model, form, free)
    columns = np.hstack([form.O, gamma, form.Md, form.Mu])
    t = np.tile(scale, form.window)[:, None]
    b = y - form.Mu @ u
    bounds = [(None, None)] * (form.O.shape[1] + gamma.shape[1]) + [(-1.0, 1.0)] * form.Md.shape[1] + [(-r, r) for r in ru] + [(0.0, None)]
    cost = np.zeros(columns.shape[1] + 1)
    cost[-1] = 1.0
    found = linprog(cost, A_ub=np.vstack([np.hstack([columns, -t]), np.hstack([-columns, -t])]), b_ub=np.concatenate([b + ry, ry - b]), bounds=bounds, method="highs")
    assert found.status == 0, found.message
    return float(found.fun)


def random_window(rng: np.random.Generator, model: Model, size: float) -> tuple[Array, Array]:
    """Held values and radii of a window with a fault of any course of up to `size` somewhere."""
    plant = model.plant
    fault = model.faults[int(rng.integers(len(model.faults)))]
    course = size * rng.uniform(-1, 1, WINDOW)
    x, u, d = rng.standard_normal(plant.n), rng.standard_normal((WINDOW, plant.p)), rng.uniform(-1, 1, (WINDOW, plant.Ed.shape[1]))
    radius = rng.uniform(0, 0.3, (WINDOW, len(model.signals))) * rng.integers(0, 2, (WINDOW, len(model.signals)))
    return faulty(model, fault, course, x, u, d) + radius * rng.uniform(-1, 1, radius.shape), radius


def test_a_window_form_is_the_recursion(designs: list[Design]) -> None:
    rng = np.random.default_rng(SEED)
    for design in designs:
        plant = design.model.plant
        varying = Varying(rng.standard_normal((plant.n, 2)), rng.standard_normal((plant.m, 2)))
        form = window_form(plant, WINDOW, varying)
        x, u, d, e = (rng.standard_normal(shape) for shape in (plant.n, (WINDOW, plant.p), (WINDOW, plant.Ed.shape[1]), (WINDOW, 2)))
        told = form.O @ x + form.Mu @ u.ravel() + form.Md @ d.ravel() + form.Me @ e.ravel()
        assert np.allclose(told.reshape(WINDOW, -1), simulate(plant, x, u, d, e @ varying.into_x.T, e @ varying.into_y.T), 1e-9, 1e-9)


def test_the_response_of_every_fault_is_what_it_does_to_the_readings(designs: list[Design]) -> None:
    rng = np.random.default_rng(SEED)
    for design in designs:
        model = with_faults(design.model)
        form = window_form(model.plant, WINDOW)
        x, u, d = rng.standard_normal(model.plant.n), rng.standard_normal((WINDOW, model.plant.p)), rng.uniform(-1, 1, (WINDOW, model.plant.Ed.shape[1]))
        sound = faulty(model, None, np.zeros(WINDOW), x, u, d)
        for fault in model.faults:
            course = rng.standard_normal(WINDOW)
            moved = faulty(model, fault, course, x, u, d) - sound
            residual = moved[:, model.outputs].ravel() - form.Mu @ moved[:, model.inputs].ravel()
            assert np.allclose(residual, fault_response(model, form, fault) @ course, 1e-9, 1e-9), fault


def test_the_least_relaxation_is_that_of_a_dense_programme_from_scratch(designs: list[Design]) -> None:
    rng = np.random.default_rng(SEED)
    relaxed = 0
    for design in designs:
        model = with_faults(design.model)
        form, scale = window_form(model.plant, WINDOW), usual_scale(model)
        programme = Explanation(model, WINDOW, scale)
        for trial in range(6):
            value, radius = random_window(rng, model, float(rng.choice([0.0, 0.3, 3.0])))
            free = None if trial < 3 else model.faults[int(rng.integers(len(model.faults)))]
            told = programme.relaxation(value, radius, free)
            assert told == pytest.approx(dense(model, form, value, radius, scale, free), rel=1e-5, abs=1e-5)
            relaxed += told > EXPLAINED
    assert relaxed > PLANTS


def test_the_duals_of_an_unexplained_window_are_a_certificate(designs: list[Design]) -> None:
    rng = np.random.default_rng(SEED)
    seen = 0
    for design in designs:
        model = with_faults(design.model)
        form, scale = window_form(model.plant, WINDOW), usual_scale(model)
        programme = Explanation(model, WINDOW, scale)
        for _ in range(4):
            value, radius = random_window(rng, model, 3.0)
            t = programme.relaxation(value, radius)
            if t <= EXPLAINED:
                continue
            seen += 1
            w = programme.certificate().ravel()
            r = w @ (value[:, model.outputs].ravel() - form.Mu @ value[:, model.inputs].ravel())
            J = np.abs(w) @ radius[:, model.outputs].ravel() + np.abs(w @ form.Mu) @ radius[:, model.inputs].ravel() + np.abs(w @ form.Md).sum()
            assert r - J == pytest.approx(t, rel=1e-4, abs=1e-5)
            assert np.abs(w) @ np.tile(scale, WINDOW) == pytest.approx(1.0, rel=1e-4)
            assert np.abs(w @ form.O).max() <= 1e-6 * np.abs(w).max() * np.abs(form.O).max() * len(w)
    assert seen > PLANTS


def test_a_healthy_plant_is_always_explained(designs: list[Design], models: Models) -> None:
    platoon = models.design()
    references = [platoon.model.scenario(s).reference for s in ("rest", "manoeuvres")]
    for design in [platoon, *designs]:
        emulator = Emulator(design.model, design.stored)
        model = emulator.design.model
        for reference in references if design is platoon else [Reference("mixed", 1.0, 20)]:
            programme = Explanation(model, 12, usual_scale(model))
            for run in range(2):
                trace = emulator.trace(60, reference, (), SEED, run)
                assert first_unexplained(programme, trace, 0, 60) is None
                if design is platoon:
                    known = Explanation(model, 12, usual_scale(model), feedback=True)
                    assert first_unexplained(known, trace, 0, 60, reference=emulator.reference(60, reference, SEED, run)) is None


@pytest.mark.parametrize(("size", "published"), [(0.5, 11.8), (1.0, 6.1), (2.0, 3.9)])
def test_the_limit_of_the_platoon_is_the_published_one(models: Models, size: float, published: float) -> None:
    design = models.design()
    emulator = Emulator(design.model, design.stored)
    model = emulator.design.model
    programme = Explanation(model, 30, usual_scale(model))
    rest = model.scenario("rest").reference
    delays = [first_unexplained(programme, emulator.trace(SAMPLES, rest, [parse_fault(f"controller2:bias:{size}@{START}")], SEED, run), START, SAMPLES) for run in range(20)]
    found = [d for d in delays if d is not None]
    assert len(found) == 20
    # The mean of 20 runs scatters by some 4 %.
    assert np.mean(found) == pytest.approx(published, rel=0.2)


LIMIT = ("limit", "platoon", "--scenario", "rest", "--fault", "controller2", "--size", "1,2", "--json", "-q")


def test_the_command_tells_every_delay_and_does_not_depend_on_workers(cli: Cli) -> None:
    base = (*LIMIT, "--runs", 12, "--seed", 7)
    one = cli(*base, "--workers", 1)
    assert one.status == 0
    assert cli(*base, "--workers", 2).out == one.out
    found = one.json
    assert [(r["fault"], r["size"], r["runs"]) for r in found["rows"]] == [("controller2", 1.0, 12), ("controller2", 2.0, 12)]
    for row in found["rows"]:
        assert set(row["detectors"]) == {"detector", "observer 1"}
        assert row["found"] == dict.fromkeys(("limit", "detector", "observer 1"), 12)
        assert 1.0 <= row["limit"] <= row["detectors"]["detector"] == row["detectors"]["observer 1"]
    assert found["rows"][0]["limit"] > found["rows"][1]["limit"]


def test_a_detector_that_knows_the_feedback_could_be_sooner(cli: Cli) -> None:
    for scenario in ("rest", "manoeuvres"):
        told = cli(*LIMIT[:2], "--scenario", scenario, "--fault", "controller2", "--size", "0.5", "--runs", 6, "--json", "-q", "--set", "detector.feedback_known=true")
        row = told.json["rows"][0]
        assert 1.0 <= row["limit_feedback"] <= 2.0 < row["limit"]


def test_the_command_shows_a_table_to_people(cli: Cli) -> None:
    shown = cli("limit", "platoon", "--scenario", "rest", "--size", "2", "--runs", 2, "--fault", "controller2", "--workers", 1)
    assert shown.status == 0
    line = next(x for x in shown.out.splitlines() if x.split()[:1] == ["controller2"])
    assert len(line.split()) == 6
    assert all(math.isfinite(float(x)) for x in line.split()[1:])


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (("--fault", "controller9"), "controller1"),
        (("--size", "0"), "--size"),
        (("--size", "one"), "--size"),
        (("--samples", "40"), "--samples 60"),
    ],
)
def test_what_the_command_cannot_do_it_says(cli: Cli, options: tuple[str, ...], named: str) -> None:
    refused = cli("limit", "platoon", "--runs", 1, "--workers", 1, *options)
    assert refused.status == 2
    assert named in refused.err
    assert refused.err.count("\n") == 1


def test_feedback_that_the_plant_does_not_have_cannot_be_known(cli: Cli) -> None:
    refused = cli("limit", "openacc", "--set", "detector.feedback_known=1", "--runs", 1)
    assert refused.status == 2
    assert "feedback_known" in refused.err


def test_no_plant_of_the_intervals_is_beyond_explanation(models: Models) -> None:
    """What an uncertain plant may do is part of the explanation; without it healthy plants would have none."""
    ready = models.platoon("manoeuvres", {"plant.drag_per_s": {"value": 1.0, "pm": 0.3}}, "f64")
    design = ready.design
    scale = usual_scale(design.model)
    programme, certain = Explanation(design.model, 30, scale, design.varying), Explanation(design.model, 30, scale)
    batch, wrong = ready.batch(100), 0
    for run in range(8):
        trace = batch.trace(run)
        for k in range(29, 100, 10):
            assert not programme.unexplained(trace, k)
            wrong += certain.unexplained(trace, k)
    assert wrong > 0
    found = [first_unexplained(programme, ready.batch(160, ("controller2:bias:3.0@100",)).trace(run), 100, 160) for run in range(5)]
    assert all(f is not None for f in found)
