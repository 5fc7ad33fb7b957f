"""Radii of estimates: never too small while the promises hold, and no larger than they must be. Truth comes from an emulation in fine steps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from host_support import SEED, Models
from hullguard.core.library import library
from hullguard.core.native import Native
from hullguard.core.native_uio import Uio, UioTable
from hullguard.design import uio_hull
from hullguard.design.design import Design
from hullguard.design.hull import Linear
from hullguard.design.uio import augment, observer
from hullguard.design.uio_discrete import discretised, estimator
from hullguard.design.uio_generator import UioDesign, uio_table
from hullguard.errors import InputError
from hullguard.model.faults import parse_fault
from hullguard.model.road import RoadSpec
from hullguard.model.schema import Reference, Scenario
from hullguard.model.table import Array
from hullguard.plant.unknown import Emulated, emulate
from uio_support import C_PRINTED, HALF, driven, known, observers, quarter_car, rough

ROADS = {
    "random": RoadSpec("iso8608", roughness="A", speed_mps=20.0),
    "rough and slow": RoadSpec("iso8608", roughness="E", speed_mps=6.0),
    "bump": RoadSpec("bump", 0.05, start_s=0.4, duration_s=0.1),
    "sine": RoadSpec("sine", 0.02, 10.0),
}
VARIANTS: dict[str, dict[str, Any]] = {
    "shipped": {},
    "discrete": observers("discrete"),
    "first-order hold": observers("first-order hold"),
    "slower": {"sample_time_s": 0.002},
    "half car": HALF,
}


def course(made: Design, spec: RoadSpec, samples: int, seed: int, kind: str = "steps", faults: tuple[str, ...] = ()) -> Emulated:
    scenario = Scenario("test", samples, Reference(kind, 300.0, 97), (), road=spec)
    return emulate(made, Native(library("f64"), made.tables), scenario, [parse_fault(f) for f in faults], samples, seed)


def truths(made: Design, u: UioDesign, run: Emulated) -> Array:
    """Of each estimate what it stands for: faults, low-passed, are 0 here; unknown inputs by the mean that moves the state; states."""
    model, n = made.model, made.model.plant.n
    q, p = len(made.model.plant.unknown.names), len(u.faults)  # type: ignore[union-attr]
    moved = run.state[1:] - run.state[:-1] @ model.plant.A.T - run.readings[:-1, model.inputs] @ model.plant.B.T
    a = model.sample_time_s / (u.spec.low_pass_s + model.sample_time_s)
    first = 0 if u.spec.form == "direct" else n + len(u.spec.sensors)
    rows = -u.follows[first + len(u.spec.actuators) :][:q] / a  # P, as far as it multiplies the plant's own states
    out = np.zeros((len(run.state), len(u.names)))
    for k in range(1, len(run.state)):
        out[k, p : p + q] = out[k - 1, p : p + q] + a * (rows @ moved[k - 1] - out[k - 1, p : p + q])
    out[:, p + q :] = run.state
    return out


def errors(made: Design, run: Emulated, rng: np.random.Generator, worst: Array | None = None) -> tuple[Array, Array]:
    """Values that a receiver might hold, within radii that change with time, and these radii. `worst` (samples x signals): signs of the errors."""
    model = made.model
    radius = made.usual * rng.uniform(0.5, 1.5, run.readings.shape)
    sign = rng.uniform(-1, 1, run.readings.shape) if worst is None else worst
    noise = np.array([s.noise for s in model.signals])
    return run.readings + sign * (radius + noise), radius


@pytest.fixture(scope="module", params=sorted(VARIANTS))
def made(request: pytest.FixtureRequest, models: Models) -> Design:
    return models.design(VARIANTS[request.param], "default", "suspension")


@pytest.mark.parametrize("road", sorted(ROADS))
@pytest.mark.parametrize("real", ["f32", "f64", "q31"])
def test_no_estimate_leaves_its_radius(made: Design, road: str, real: str) -> None:
    rng = np.random.default_rng([SEED, len(road)])
    run = course(made, ROADS[road], 1200, SEED % 1000)
    value, radius = errors(made, run, rng)
    for u in made.uios:
        found = Uio(library(real), uio_table(u, real), width=len(made.model.signals)).run(value, radius)
        ratio = np.abs(found.estimate - truths(made, u, run)) / found.radius
        assert ratio.max() <= 1.0, f"{u.names[int(ratio.max(0).argmax())]} at {int(ratio.max(1).argmax())}"
        assert found.refused == 0


def test_a_start_anywhere_in_the_range(made: Design) -> None:
    """All states at their largest, in every direction of a sample of them."""
    rng = np.random.default_rng(SEED)
    for _ in range(4):
        sign = rng.choice([-1.0, 1.0], made.model.plant.n)
        plant = replace(made.model.plant, equilibrium=0.45 * made.stored.state_range * sign, initial_range=0.0 * made.model.plant.initial_range)
        run = course(replace(made, model=replace(made.model, plant=plant)), RoadSpec("smooth"), 900, SEED % 1000, "rest")
        value, radius = errors(made, run, rng)
        for u in made.uios:
            found = Uio(library("f32"), uio_table(u), width=len(made.model.signals), moving=True).run(value, radius)
            assert (np.abs(found.estimate - truths(made, u, run)) / found.radius).max() <= 1.0


def test_worst_errors_reach_the_radius(made: Design) -> None:
    """Errors signed by the impulse response reach what the radii of the signals put into the radius of an estimate, but for the tail's excess."""
    samples = 3000
    quiet = course(made, RoadSpec("smooth"), samples, 1, "rest")
    u = made.uios[0]
    rows, F = [u.linear.direct], u.linear.output
    for _ in range(samples - 1):
        rows.append(F @ u.linear.input)
        F = F @ u.linear.state
    for i in range(len(u.faults)):
        worst = np.zeros((samples, len(made.model.signals)))
        worst[:, list(u.signal)] = np.sign(np.array(rows)[::-1, i])
        value, radius = errors(made, quiet, np.random.default_rng(SEED), worst)
        found = Uio(library("f64"), uio_table(u), width=len(made.model.signals)).run(value, radius)
        error = np.abs(found.estimate - truths(made, u, quiet))[-1, i]
        assert error <= found.radius[-1, i]
        # What is left is for the road, its change within a sample, rounding and mismatch, none of which is here.
        assert error >= 0.9 * (found.radius[-1, i] - u.tables.bias[i] + noise_share(made, u, i))


def noise_share(made: Design, u: UioDesign, i: int) -> float:
    """What the sensors' noise has of the bias."""
    noise, total, F = np.array([s.noise for s in made.model.signals])[list(u.signal)], 0.0, u.linear.output[i]
    total += float(np.abs(u.linear.direct[i]) @ noise)
    for _ in range(3000):
        total += float(np.abs(F @ u.linear.input) @ noise)
        F = F @ u.linear.state
    return total


def test_the_bound_on_unknown_inputs_is_needed(models: Models) -> None:
    """Without what the hold lets through, a rough road at coarse samples leaves the radius: the check above can fail."""
    coarse = {"sample_time_s": 0.01, "plant.unknown.road.rate": 300.0} | observers("first-order hold")
    made = models.design(coarse, "default", "suspension")
    run = course(made, RoadSpec("sine", 0.01, 18.0), 400, 1, "rest")
    u = made.uios[0]
    found = Uio(library("f64"), uio_table(u), width=len(made.model.signals)).run(run.readings, 0.0 * run.readings)
    error = np.abs(found.estimate - truths(made, u, run))[:, 0]
    assert np.all(error <= found.radius[:, 0])
    bare = replace(uio_table(u), rest=0.0 * u.tables.rest, moving=0.0 * u.tables.moving, mode_rest=0.0 * u.tables.mode_rest)
    narrow = Uio(library("f64"), bare, width=len(made.model.signals)).run(run.readings, 0.0 * run.readings)
    assert np.any(np.abs(narrow.estimate - truths(made, u, run))[100:, 0] > narrow.radius[100:, 0])
    assert error.max() > 0.02 * found.radius[-1, 0]


def test_modes_do_not_depend_on_what_they_are_called(models: Models) -> None:
    """The same generator with its states in another order has the same modes in the same order, low passes with one pole included."""
    u = models.design(scenario="default", name="suspension").uios[1]
    values, vectors = uio_hull._vectors(u.linear.state)
    assert np.abs(u.linear.state @ vectors - vectors * values).max() < 1e-12
    order = np.random.default_rng(SEED).permutation(len(values))
    other, _ = uio_hull._vectors(u.linear.state[np.ix_(order, order)])
    assert np.allclose(values, other, atol=1e-12)


def test_modes_that_cannot_be_told_apart_are_refused() -> None:
    one, two = np.ones((1, 1)), np.ones((2, 1))
    with pytest.raises(InputError, match="here: poles so close to one another, or to the low pass"):
        uio_hull._modes(Linear(np.array([[0.9, 1.0], [0.0, 0.9]]), two, two.T, one), "here")
    with pytest.raises(InputError, match="too slow for a threshold"):
        Models().design({"detector.uio.1.poles": [-0.001, -20, -40, -80, -160]}, "default", "suspension")


def test_the_left_inverse_is_the_best_one(models: Models) -> None:
    """Trusting the states' equations in some other way makes no radius of an unknown input or fault smaller, and often much larger."""
    best = models.design(scenario="default", name="suspension").uios[0].tables.steady[:2]
    for trust in ([1, 1, 1, 1], [1, 1, 1e-6, 1e-6], [1e-3, 1, 1e-3, 1e-6]):
        other = models.design({"detector.uio.0.trust": trust}, "default", "suspension").uios[0].tables.steady[:2]
        assert np.all(best <= 1.03 * other)  # the tables add a few per cent for modes and rounding, which the programme does not see
        assert best.sum() < other.sum()


# ---- numbers of section 1.5, by the C library ----


def published_estimates(real: str, moved: dict[str, Any]) -> tuple[Array, Array]:
    """Actuator's fault, road and states at 1 kHz on the road of section 1.5 with 200 N from 5 s on, no low pass; and what is true of the first two."""
    p = augment(known(C_PRINTED), [2], [0.0])
    e = estimator(discretised(observer(p, [-10, -20, -20]), 1e-3), 4, [0], [0], [1], 0.0)
    table = UioTable(1, 1, 1, 4, (0, 1, 2, 3), e.state, e.input, e.output, e.direct)
    if "y" not in moved:
        t, x = driven(quarter_car(36.0, 240.0), 1e-3, 20.0, lambda t: 200.0 * (t >= 5.0), rough)
        middle = t - 5e-4
        moved["y"] = np.hstack([x @ C_PRINTED.T, np.zeros((len(t), 1))])
        moved["truth"] = np.array([200.0 * (middle >= 5.0), [rough(v) for v in middle]]).T
    return Uio(library(real), table).run(moved["y"]).estimate, moved["truth"]


def test_reconstruction_in_both_number_types() -> None:
    """Acceptance (d) and (e), by the tables that the design makes."""
    moved: dict[str, Any] = {}
    double, truth = published_estimates("f64", moved)
    single, _ = published_estimates("f32", moved)
    for found in (double, single):
        off = (found[:, [0, 2]] - truth)[1:]
        assert np.sqrt(np.mean(off[:, 0] ** 2)) <= 2.0 and np.sqrt(np.mean(off[:, 1] ** 2)) <= 3e-3
    assert np.abs(single - double)[:, 0].max() <= 0.15
    assert np.abs(single - double)[:, 3:].max() <= 1e-6
