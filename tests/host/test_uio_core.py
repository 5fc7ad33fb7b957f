"""The library's unknown-input observer and isolation on a quarter car: methods, suspension, acceptance (d), (e) and (h), and a million samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import quarter_car as car
from host_support import SEED, Models
from hullguard.core.library import library
from hullguard.core.native_uio import CAUSES, IsolateTable, Uio, UioTable
from hullguard.design.design import Design
from hullguard.design.uio_generator import uio_table
from hullguard.design.uio_isolate import isolations
from hullguard.errors import InputError
from hullguard.model.table import Array
from uio_support import observers

MS = 1e-3
LOW = MS / (0.1 + MS)  # 100 ms
NOISE = np.array([1e-4, 1e-3, 1e-4])
TRIP = (12.0, 1e-4, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
WHOLE = np.zeros((2, 8))
WHOLE[0, 3], WHOLE[1, 4], WHOLE[1, 6] = car.SPRING, car.DAMPER, -car.DAMPER
ISOLATE = IsolateTable(0, 12.0, (1,), (1e-4,), WHOLE, np.array([8.0, 8.0]), LOW, settle=2000, release=2000, block=1000, blocks=5)


def quiet(seconds: float) -> Array:
    return np.zeros(round(seconds / car.FINE_S))


@pytest.fixture(scope="module")
def smooth() -> car.Drive:
    return car.simulate(20.0, 5.0, 200.0, (7.0, 0.05), {}, quiet(20.0))


@pytest.mark.parametrize("real", ["f32", "f64"])
def test_estimates_from_the_right_start(smooth: car.Drive, real: str) -> None:
    """Acceptance (d)."""
    e = Uio(library(real), car.table(MS, 1.0)).run(smooth.y)
    rms = np.sqrt(np.mean((e.estimate[1:, [0, 2]] - np.column_stack([smooth.force, smooth.speed])[:-1]) ** 2, axis=0))
    assert e.refused == 0
    assert rms[0] <= 2.0 and rms[1] <= 3e-3
    assert np.abs(e.estimate[:, 3:] - smooth.x).max() <= 3e-4


def test_float32_is_enough(smooth: car.Drive) -> None:
    """Acceptance (e)."""
    single, double = (Uio(library(real), car.table(MS, 1.0)).run(smooth.y).estimate for real in ("f32", "f64"))
    off = np.abs(single - double).max(0)
    assert off[0] <= 0.15
    assert off[3:].max() <= 1e-6


DESIGNED = {"as shipped": {}, "discrete": observers("discrete"), "first-order hold": observers("first-order hold")}


@pytest.fixture(scope="module", params=sorted(DESIGNED))
def designed(request: pytest.FixtureRequest, models: Models) -> Design:
    return models.design(DESIGNED[request.param] | {"detector.uio.0.isolate": {"excitation": 8.0}}, "default", "suspension")


@pytest.mark.parametrize(
    ("course", "cause", "candidates", "share", "off"),
    [
        ({}, "input", 0, None, None),
        ({"force": 200.0}, "actuator", 1, 0, (195.0, 206.0)),
        ({"spring": 0.8 * car.SPRING}, "component", 2, 1, (0.2 * 0.99, 0.2 * 1.01)),
        ({"damper": 0.5 * car.DAMPER}, "component", 4, 2, (0.5 * 0.99, 0.5 * 1.01)),
    ],
)
def test_designed_tables_tell_each_cause(designed: Design, course: dict[str, float], cause: str, candidates: int, share: int | None, off: tuple[float, float] | None) -> None:
    """Acceptance (h) of what `design` makes of a model: J_f = 12 N on the estimate alone, no radius; every reading is known."""
    random, u = np.random.default_rng(SEED), designed.uios[0]
    d = car.simulate(16.0, 6.0, course.get("force", 0.0), (6.0, 0.0), {k: v for k, v in course.items() if k != "force"}, 0.3 * random.standard_normal(160000))
    value = np.zeros((len(d.x), len(designed.model.signals)))
    value[:, designed.model.outputs] = (d.x[:, :4] + random.standard_normal((len(d.x), 4)) * [1e-4, 1e-3, 1e-4, 1e-3]) @ designed.model.plant.C.T
    t = uio_table(u)
    bare = UioTable(t.actuators, t.sensors, t.unknown, t.states, t.signal, t.state, t.input, t.output, t.direct)
    isolation = replace(isolations(designed.model, u)[0].table, limit=12.0, settle=2000, release=2000)
    uio = Uio(library("f32"), bare, isolation, width=value.shape[1])
    run = uio.run(value)
    assert np.abs(run.estimate[3000:6000, 0]).max() < 12.0
    assert CAUSES[run.cause[-1]] == cause and run.candidates[-1] == candidates
    if share is not None and off is not None:
        assert off[0] <= uio.share[share] <= off[1]


def noisy(random: np.random.Generator, force: float = 0.0, f0: float = 0.0, moving: float = 1.0, **broken: float) -> Array:
    d = car.simulate(16.0, 6.0, force, (6.0, f0), broken, 0.3 * random.standard_normal(160000), moving=moving)
    return np.asarray(d.y + random.standard_normal(d.y.shape) * NOISE)


@pytest.mark.parametrize(
    ("course", "cause", "candidates", "share", "off"),
    [
        ({}, "input", 0, None, None),
        ({"tyre": 0.8 * car.TYRE}, "input", 0, None, None),
        ({"force": 200.0}, "actuator", 1, 0, (195.0, 206.0)),
        ({"force": 20.0}, "actuator", 1, 0, (18.0, 22.0)),
        ({"spring": 0.8 * car.SPRING}, "component", 2, 1, (0.198, 0.202)),
        ({"damper": 0.5 * car.DAMPER}, "component", 4, 2, (0.495, 0.505)),
        ({"f0": 0.05}, "sensor", 8, None, None),
        ({"force": 200.0, "f0": 0.05}, "ambiguous", 9, 0, (195.0, 206.0)),
        ({"spring": 0.8 * car.SPRING, "damper": 0.5 * car.DAMPER}, "ambiguous", 6, 1, (0.19, 0.21)),
        ({"force": 200.0, "moving": 0.0}, "ambiguous", 3, None, None),
    ],
)
@pytest.mark.parametrize("real", ["f32", "f64"])
def test_each_cause_is_told(real: str, course: dict[str, float], cause: str, candidates: int, share: int | None, off: tuple[float, float] | None) -> None:
    """Acceptance (h), by tables made by hand."""
    y = noisy(np.random.default_rng(SEED), **course)
    uio = Uio(library(real), car.table(MS, LOW, TRIP), ISOLATE)
    run = uio.run(y)
    assert np.abs(run.estimate[3500:6000, 0]).max() < 12.0  # no alarm of the road alone
    assert {CAUSES[c] for c in run.cause[:6000]} == {"input"}
    assert CAUSES[run.cause[-1]] == cause
    assert run.candidates[-1] == candidates
    if share is not None and off is not None:
        assert off[0] <= uio.share[share] <= off[1]


@pytest.mark.parametrize("real", ["f32", "f64"])
def test_a_million_samples_do_not_drift(real: str) -> None:
    """The same 5 s of a drive with a weak spring, again and again: every window says what the first one said."""
    random = np.random.default_rng(SEED)
    t = np.arange(5000) * MS
    y = np.zeros((5000, 3))
    phi = 0.02 * np.sin(2 * np.pi * t)
    y[:, 0], y[:, 1], y[:, 2] = 0.2 * car.SPRING * phi + random.standard_normal(5000), phi, np.cos(2 * np.pi * t)
    order = np.zeros((1, 1))
    straight = replace(
        car.table(MS, 1.0), state=order, input=np.zeros((1, 3)), output=np.zeros((8, 1)), direct=np.eye(8)[:, [0, 3, 4]], rest=np.zeros((1, 8)), moving=np.zeros((1, 8))
    )
    uio = Uio(library(real), straight, replace(ISOLATE, low_pass=1.0))
    shares = []
    for _ in range(200):
        last = uio.run(y)
        shares.append(uio.share)
    assert CAUSES[last.cause[-1]] == "component"
    assert last.refused == 0
    late = np.array(shares[2:])
    assert np.ptp(late, axis=0).max() <= 1e-6 * np.abs(late).max()
    assert late[-1, 1] == pytest.approx(0.2, abs=1e-3)


def test_a_bad_number_costs_one_sample() -> None:
    y = np.zeros((100, 3))
    y[50, 1] = np.nan
    run = Uio(library(), car.table(MS, 1.0), ISOLATE).run(y, np.zeros((100, 3)))
    assert run.refused == 1
    assert run.radius[50].min() > 1e38
    assert np.isfinite(run.estimate).all()


def test_bad_tables_are_refused() -> None:
    good = car.table(MS, 1.0)
    with pytest.raises(InputError, match="refused the tables"):
        Uio(library(), replace(good, states=4))
    with pytest.raises(InputError, match="samples x 3"):
        Uio(library(), good).run(np.zeros((10, 2)))
