"""Fixed point: thresholds are never below the exact hull and rounding costs what is stated; a residual moves by no more than that; nothing saturates at
the ends of all ranges; what has no fixed-point form says so; and a wrong rounding constant or exponent is found out.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from host_support import SEED, Cli, Models, Ready
from hullguard.core.library import library
from hullguard.core.native import REST, Native, Node, Sender
from hullguard.design import hull
from hullguard.design.arith import nearest32
from hullguard.design.design import Design, design
from hullguard.design.fixed import STEP, FixedDesign, lower
from hullguard.design.tables import GeneratorTable, GroupTable, MismatchTable, SignalTable, Tables, rows
from hullguard.model import load_model
from hullguard.model.table import Array
from test_hull import STARTS, WIDEST, Problem, exact_hull, exact_responses, problem, sequences, thresholds

CODES = 30_000  # of a signal of a random problem, on each side
PROBLEMS = 16
TINY = 1e-13  # of a unit: what the double precision of a test loses


# ---- thresholds of random generators ----


def random_tables(p: Problem, platoon: Tables) -> Tables:
    """A detector of this one generator, in one group; derived radii as an uncertain plant has them."""
    sent, derived = len(p.ranges.value), len(p.ranges.derived)
    signals = []
    for i, value in enumerate(p.ranges.value):
        resolution = float(nearest32(np.array(value / (CODES + 1))))
        signals.append(
            SignalTable(f"s{i}", resolution, 0.0, float(nearest32(np.array(1 / resolution))), -CODES, CODES, 16 * i, 16, 2, resolution / 2, 2 * float(value), 0.0, 0)
        )  # fmt: skip
    group = replace(platoon.groups[0], signals=tuple(signals), slew=(tuple(s.span for s in signals),))
    t, places = p.tables, tuple(range(sent + derived))
    generator = GeneratorTable(
        places[:sent], places, rows(p.lin.state), rows(p.lin.input), rows(p.lin.output), rows(p.lin.direct), t.taps, tuple(rows(w) for w in t.weight), t.settle,
        rows(t.rest), tuple(t.rest_left), rows(t.moving), tuple(t.moving_left), tuple(t.bias), t.ready_rest, t.ready_moving, tuple(t.decay), rows(t.tail), 1, 1,
    )  # fmt: skip
    mismatch = MismatchTable((), tuple(float(x) for x in p.ranges.derived), ((),) * derived) if derived else None
    return replace(platoon, groups=(group,), generators=(generator,), mismatch=mismatch, banks=(), predictors=(), fixed=None)


@dataclass(frozen=True)
class Lowered:
    """A random problem in fixed point: tables in units, and the exact hull of the generator as it is stored."""

    problem: Problem  # its response, and so on, are those of the stored numbers
    tables: hull.HullTables
    exponent: int
    scale: Array  # width and derived
    residual: Array  # residuals: their units
    rounding: Array  # residuals: what the design says that rounding costs
    proven: Array  # residuals: what rounding of each step can do to a residual
    ideal: Problem


def stored_linear(g: GeneratorTable, exact: hull.Linear, signal: Array, residual: Array) -> tuple[hull.Linear, Array]:
    """The matrices that fixed point holds, in units of the model, and the units of the state, which are powers of two that the input shows."""
    moved, shown = 2.0 ** g.exponents[0], 2.0 ** g.exponents[1]
    E, held = exact.input * signal, np.array(g.input) * moved
    largest = np.abs(E).argmax(1), np.arange(len(E))
    state = 2.0 ** np.rint(np.log2(E[largest[1], largest[0]] / held[largest[1], largest[0]]))
    Z, R = state[:, None], residual[:, None]
    made = hull.Linear(np.array(g.state) * moved * Z / state, held * Z / signal, np.array(g.output) * shown * R / state, np.array(g.direct) * shown * R / signal)
    return made, state


def lowered(p: Problem, platoon: Tables) -> Lowered:
    tables = random_tables(p, platoon)
    made = lower(tables, (p.lin,), (p.given,), (p.tables,), "random")
    g, sent = made.tables.generators[0], len(p.ranges.value)
    scale = 2.0 ** np.array(made.tables.units[: len(g.wide)], dtype=float)
    residual = 2.0 ** np.array(made.tables.units[len(g.wide) :], dtype=float)
    lin, state = stored_linear(g, p.lin, scale[:sent], residual)
    plant, m = p.given.plant, len(p.given.plant.C)
    # T = 1: what the stored matrices are off enters e and r, wherever the state is in its range.
    off = np.abs(plant.A - lin.state - lin.input[:, :m] @ plant.C) @ p.ranges.state + np.abs(plant.B - lin.input[:, m:]) @ p.ranges.input
    off_r = np.abs(lin.output + lin.direct[:, :m] @ plant.C) @ p.ranges.state + np.abs(lin.direct[:, m:]) @ p.ranges.input
    Bd, Dd = plant.Ed - lin.input[:, :m] @ plant.Fd, lin.direct[:, :m] @ plant.Fd
    entering, at_once = np.hstack([lin.input, p.given.derived]), np.hstack([lin.direct, np.zeros((len(residual), len(scale) - sent))])
    loss = state * STEP / 2, residual * STEP / 2
    ideal = replace(p, lin=lin)
    for_good = np.hstack([Bd, np.diag(off + loss[0])]), np.hstack([Dd, np.diag(off_r + loss[1])])
    response, driven, added = exact_responses(lin, entering, at_once, p.ranges, *for_good)
    ideal = replace(p, lin=lin, response=response, driven=exact_responses(lin, entering, at_once, p.ranges, Bd, Dd)[1], added=added)
    proven = exact_responses(lin, entering, at_once, p.ranges, np.diag(loss[0]), np.diag(loss[1]))[1][-1]
    parts = {"weight": np.array(g.weight), "rest": np.array(g.rest), "moving": np.array(g.moving), "tail": np.array(g.tail)}
    parts |= {key: np.array(getattr(g, key)) for key in ("rest_left", "moving_left", "bias", "decay")}
    held = replace(p.tables, **parts)
    return Lowered(replace(p, lin=lin, response=response, driven=driven, added=added), held, g.exponents[2], scale, residual, np.array(made.rounding), proven, ideal)


def J_of(found: Lowered, tables: hull.HullTables, start: str, radius: Array, exponent: int | None = None) -> Array:
    """Thresholds of the C library in units of the model, samples x residuals; infinite where they have reached the largest number."""
    steps = radius / found.scale / STEP
    assert np.all(steps == np.rint(steps)) and np.all(steps < 2.0**31 - 1)
    J = thresholds(tables, start, steps * STEP, "q31", found.exponent if exponent is None else exponent)[0]
    return np.where(J >= 1 - 2 * STEP, np.inf, J * found.residual)


def held_sequences(found: Lowered, rng: np.random.Generator) -> list[Array]:
    """Radii as fixed point holds them, no wider than the ranges."""
    widest = WIDEST * found.problem.expected.usual
    return [held_radius(found, np.minimum(r, widest)) for r in sequences(found.problem, rng)]


def held_radius(found: Lowered, radius: Array) -> Array:
    """In steps, rounded up."""
    return np.asarray(np.ceil(radius / found.scale / STEP) * STEP * found.scale)


def lowest(found: Lowered, tables: hull.HullTables, exponent: int | None = None) -> float:
    """The smallest J/exact - 1 over starts and radii."""
    rng = np.random.default_rng([SEED, 7])
    smallest = np.inf
    for radius in held_sequences(found, rng):
        for start in STARTS:
            exact = exact_hull(found.problem, start, radius)
            smallest = min(smallest, float((J_of(found, tables, start, radius, exponent) / exact - 1).min()))
    return smallest


@pytest.fixture(scope="module")
def problems(models: Models) -> list[Lowered]:
    """Random problems; each can be held, whatever its poles and units are."""
    return [lowered(problem(i), models.design().tables) for i in range(PROBLEMS)]


def test_no_threshold_is_below_the_exact_hull_of_the_stored_numbers_with_its_rounding(problems: list[Lowered]) -> None:
    for i, p in enumerate(problems):
        assert lowest(p, p.tables) >= 0, f"problem {i}"


def test_a_threshold_at_usual_radii_is_the_hull_the_stated_rounding_and_its_shares(problems: list[Lowered]) -> None:
    for p in problems:
        if max(p.tables.taps) < hull.TAPS_MAX:
            radius = np.tile(held_radius(p, p.problem.expected.usual), (1500, 1))
            exact = exact_hull(p.ideal, "moving", radius)[-1]
            J = J_of(p, p.tables, "moving", radius)[-1]
            assert np.all(np.isfinite(J))
            assert np.all(J <= (exact + p.rounding) * (1 + hull.TAIL_SHARE) * (1 + 2e-3))


def test_half_the_rounding_is_found_out(problems: list[Lowered]) -> None:
    """Of the constant part alone, which a threshold is after long silence of all radii."""
    low = []
    for p in problems:
        assert np.all(p.rounding >= (p.problem.driven - p.ideal.driven)[-1])
        less = p.tables.bias - p.rounding / 2 / p.residual
        less_rows = {name: getattr(p.tables, name) - p.rounding / 2 / p.residual for name in STARTS}
        wrong = replace(p.tables, bias=np.floor(less / STEP) * STEP, **{name: np.floor(np.maximum(x, 0) / STEP) * STEP for name, x in less_rows.items()})
        radius = np.zeros((1500, len(p.scale)))
        exact = exact_hull(p.problem, "rest", radius)[-1]
        assert np.all(J_of(p, p.tables, "rest", radius)[-1] >= exact)
        low.append(float((J_of(p, wrong, "rest", radius)[-1] / exact - 1).min()))
    assert sum(x < 0 for x in low) >= PROBLEMS / 2, low


def test_a_threshold_with_an_exponent_that_is_1_too_small_is_found_out(problems: list[Lowered]) -> None:
    low = [lowest(p, p.tables, p.exponent - 1) for p in problems]
    assert all(x < 0 for x in low), low


# ---- residuals: the whole detector, by frames ----


class Exact:
    """A generator in double precision, signal units. `lin`: its matrices."""

    def __init__(self, lin: hull.Linear) -> None:
        self.lin, self.z = lin, np.zeros(len(lin.state))

    def step(self, v: Array) -> Array:
        r = self.lin.output @ self.z + self.lin.direct @ v
        self.z = self.lin.state @ self.z + self.lin.input @ v
        return np.asarray(r)


def impulse(lin: hull.Linear, count: int) -> Array:
    """The response itself: lags x residuals x signals."""
    F, out = lin.output, [lin.direct]
    for _ in range(count - 1):
        out.append(F @ lin.input)
        F = F @ lin.state
    return np.array(out)


@dataclass(frozen=True)
class Detector:
    """A design in fixed point with all that is exact of its first generator."""

    ready: Ready
    table: GeneratorTable
    given: hull.Linear  # float32 matrices as designed
    stored: hull.Linear  # as fixed point holds them
    scale: Array
    state: Array
    residual: Array
    proven: Array  # residuals: what rounding of each step can do, from zero radii on

    @property
    def first(self) -> slice:
        """Its residuals."""
        return slice(0, len(self.residual))


@pytest.fixture(scope="module", params=["platoon", "platoon_bank", "openacc"])
def detector(request: pytest.FixtureRequest, models: Models) -> Detector:
    made = models.design() if request.param == "platoon" else design(load_model(request.param))[0]
    chosen = made.model.scenario("rest" if request.param.startswith("platoon") else "default")
    return detector_of(Ready(made, Native(library("q31"), made.tables), chosen.reference, chosen.samples))


def detector_of(ready: Ready) -> Detector:
    t = ready.native.tables
    g, given = t.generators[0], ready.design.generators[0].linear
    scale = 2.0 ** np.array([t.units[i] for i in g.signal], dtype=float)
    residual = 2.0 ** np.array(t.units[t.width : t.width + len(g.output)], dtype=float)
    stored, state = stored_linear(g, given, scale, residual)
    steps, F = residual * STEP / 2, stored.output
    for _ in range(2000):
        steps = steps + np.abs(F) @ state * STEP / 2
        F = F @ stored.state
    return Detector(ready, g, given, stored, scale, state, residual, steps)


def ends(ready: Ready) -> tuple[Array, Array]:
    """Values of the smallest and the largest codes of all signals."""
    signals = [s for g in ready.design.tables.groups for s in g.signals]
    return np.array([s.offset + s.resolution * s.minimum for s in signals]), np.array([s.offset + s.resolution * s.maximum for s in signals])


def driven(ready: Ready, readings: Iterator[Array]) -> Iterator[tuple[Node, Array]]:
    """A node and the values behind the codes it got, in double precision, sample by sample; every frame arrives, and none is refused."""
    tables, sender, node = ready.native.tables, Sender(ready.native), Node(ready.native, REST)
    plain = [s for g in ready.design.tables.groups for s in g.signals]
    closing = tables.closing
    value = np.array([s.middle for s in plain])
    for k, reading in enumerate(readings):
        for i in [*(i for i in range(len(tables.groups)) if i != closing), closing]:
            frame, g = sender.step(i, k, reading.tolist()), tables.groups[i]
            if frame is not None:
                assert node.receive(frame) == ready.native.library.lib.HG_OK
                for s in range(g.first, g.first + len(g.signals)):
                    value[s] = plain[s].offset + plain[s].resolution * round((reading[s] - plain[s].offset) / plain[s].resolution)
        verdict = node.step()
        assert verdict is not None and not verdict.refused
        yield node, value.copy()
    assert node.health()["numeric"] == 0 and node.node.detector.refusals == 0


def held(node: Node, d: Detector) -> Array:
    """State of the first generator after a step, in its units."""
    z = node.native.library.ffi.unpack(node.node.detector.memory.residual[0].z, len(d.state))
    return np.array(z) * STEP


def extremes(d: Detector, rng: np.random.Generator, samples: int) -> Iterator[Array]:
    """Every signal at one end of its range or the other, or anywhere between, for one sample or for long."""
    low, high = ends(d.ready)
    left, value = np.zeros(len(low), dtype=int), low.copy()
    for _ in range(samples):
        done = left <= 0
        left = np.where(done, rng.choice([1, 2, 5, 60], size=len(low)), left) - 1
        value = np.where(done, rng.choice([0.0, 1.0, 1.0, 0.0, 0.5], size=len(low)) * (high - low) + low, value)
        yield value


def furthest(d: Detector, samples: int) -> float:
    """How far the residual is from exact arithmetic with the stored matrices at most, as a part of what rounding is proven to do."""
    exact, worst = Exact(d.stored), 0.0
    for node, _ in driven(d.ready, extremes(d, np.random.default_rng([SEED, 3]), samples)):
        v = np.array(node.value)[list(d.table.signal)]
        r = np.array(node.r)[d.first]
        worst = max(worst, float((np.abs(r - exact.step(v)) / (d.proven + TINY * d.residual)).max()))
    return worst


def test_rounding_moves_a_residual_by_no_more_than_is_proven_at_the_ends_of_all_ranges(detector: Detector) -> None:
    assert 0.05 < furthest(detector, 600) <= 1.0


def test_no_value_is_further_from_its_code_than_its_radius_allows_for(detector: Detector) -> None:
    """half is a code's half and what reading, encoder and decoder lose; of the last, a value is one step at most."""
    for node, value in driven(detector.ready, extremes(detector, np.random.default_rng([SEED, 4]), 100)):
        steps = 2.0 ** np.array(detector.ready.native.tables.units[: len(value)], dtype=float) * STEP
        assert np.all(np.abs(np.array(node.value)[: len(value)] - value) <= 2 * steps)


def test_a_residual_is_that_of_the_matrices_as_designed(detector: Detector) -> None:
    """Their rounding is in the thresholds' constant for a healthy plant: held values differ from a plant's own by their radii, whose response differs too."""
    d, t = detector, detector.ready.native.tables
    lost = np.array(d.ready.design.fixed_rounding)[d.first] + d.ready.design.generators[0].tables.rounding
    differ = np.abs(impulse(d.stored, 400) - impulse(d.given, 400))
    places = list(d.table.signal)
    for loss in (0.0, 0.2):
        trace = d.ready.batch(300, loss=loss).trace(0)
        exact = Exact(d.given)
        r = np.array([exact.step(v) for v in trace["value"][:, places]])
        radius = trace["radius"][:, places]
        past = np.array([sum(np.convolve(differ[:, i, g], radius[:, g])[: len(r)] for g in range(len(places))) for i in range(r.shape[1])]).T
        assert np.all(np.abs(trace["r"][:, d.first] - r) <= lost + past)


def responses(lin: hull.Linear, length: int) -> list[Array]:
    """How values of each lag (lags x signals) get into each number of the state after a sample, then into each residual."""
    power, into = np.eye(len(lin.state)), []
    for _ in range(length):
        into.append(power @ lin.input)
        power = power @ lin.state
    state, residual = np.array(into), impulse(lin, length)
    return [state[:, i] for i in range(state.shape[1])] + [residual[:, i] for i in range(residual.shape[1])]


@dataclass(frozen=True)
class Reached:
    """How large a number became, how large any values within their ranges can make it in so many samples, and its unit."""

    size: float
    bound: float
    unit: float


def reached(d: Detector, length: int) -> list[Reached]:
    """Of every number of the state and every residual, with both signs: each signal has been at the end that the sign of its response asks for."""
    low, high = ends(d.ready)
    places, units, found = list(d.table.signal), np.concatenate([d.state, d.residual]), []
    for i, response in enumerate(responses(d.stored, length)):
        for h in (response[::-1], -response[::-1]):
            readings = np.tile(low, (length, 1))
            readings[:, places] = np.where(h > 0, high[places], low[places])
            node = None
            for node, _ in driven(d.ready, iter(readings)):
                assert np.all(np.abs(held(node, d)) < 1 - 2 * STEP)
                assert np.all(np.abs(np.array(node.r)[d.first]) < d.residual * (1 - 2 * STEP))
            assert node is not None
            last = np.concatenate([held(node, d) * d.state, np.array(node.r)[d.first]])[i]
            found.append(Reached(abs(float(last)), abs(float((h * readings[:, places]).sum())), float(units[i])))
    return found


def test_nothing_saturates_when_every_sign_is_the_worst(detector: Detector) -> None:
    found = reached(detector, 60)
    assert all(f.bound < f.unit for f in found)
    assert all(f.size == pytest.approx(f.bound, rel=1e-3) for f in found), "the values did not get to where they were sent"
    assert max(f.size / f.unit for f in found) > 0.4, "nothing came near its range: this test shows nothing"


def test_nothing_saturates_at_the_ends_of_all_ranges_for_long(detector: Detector) -> None:
    low, high = ends(detector.ready)
    for value in (low, high):
        assert len(list(driven(detector.ready, iter(np.tile(value, (300, 1)))))) == 300
    for _, _ in driven(detector.ready, extremes(detector, np.random.default_rng([SEED, 5]), 1000)):
        pass  # refusals are looked for there


def test_a_banks_residual_is_the_exact_sum_over_its_window(models: Models) -> None:
    """Of the certificate that the node names; it rounds once."""
    made = models.design(name="platoon_bank", scenario="manoeuvres")
    native = Native(library("q31"), made.tables)
    b, chosen = native.tables.banks[0], made.model.scenario("manoeuvres")
    weight, past = np.array(b.weight) * 2.0**b.exponent, []
    for k, (node, _) in enumerate(driven(ready := Ready(made, native, chosen.reference, 0), extremes(detector_of(ready), np.random.default_rng([SEED, 6]), 150))):
        sent = node.native.library.ffi.unpack(node.node.detector.value, native.tables.signals)
        past.insert(0, np.array(sent)[list(b.signal)] * STEP)
        if k >= b.window:
            place = native.tables.residuals - len(native.tables.banks)
            r = node.native.library.ffi.unpack(node.node.detector.r, native.tables.residuals)[place] * STEP
            exact = float((weight[:, :, node.node.detector.memory.bank[0].closest] * np.array(past[: b.window])).sum())
            assert abs(abs(r) - abs(exact)) <= STEP / 2 + TINY


# ---- tables that are wrong on purpose ----


def wrong_tables(tables: Tables, part: str) -> Tables:
    """Fixed-point tables with one exponent that is 1 too small."""
    assert tables.fixed is not None
    g, group = tables.fixed.generators[0], tables.fixed.groups[0]
    if part == "code":
        signals = (replace(group.signals[0], exponent=group.signals[0].exponent - 1), *group.signals[1:])
        return replace(tables, fixed=replace(tables.fixed, groups=(replace(group, signals=signals), *tables.fixed.groups[1:])))
    exponents = [e - (i == ("state", "residual").index(part)) for i, e in enumerate(g.exponents)]
    return replace(tables, fixed=replace(tables.fixed, generators=(replace(g, exponents=tuple(exponents)), *tables.fixed.generators[1:])))


@pytest.mark.parametrize("part", ["state", "residual", "code"])
def test_an_exponent_that_is_1_too_small_is_found_out(models: Models, part: str) -> None:
    right = detector_of(models.platoon(real="q31"))
    mutant = replace(right, ready=replace(right.ready, native=Native(library("q31"), wrong_tables(right.ready.design.tables, part))))
    with pytest.raises(AssertionError):
        if part == "code":
            test_no_value_is_further_from_its_code_than_its_radius_allows_for(mutant)
        else:
            assert furthest(mutant, 60) <= 1.0


# ---- what it costs, and what has no fixed-point form ----


def test_rounding_is_less_than_2_percent_of_a_threshold_of_the_platoon(models: Models) -> None:
    made: Design = models.design()
    assert max(made.rounding_shares("f32")) < 0.02
    assert max(made.rounding_shares("q31")) < 0.02
    assert max(made.rounding_shares("q31")) < max(made.rounding_shares("f32")) / 10, "31 bits are 7 more than float32 has"


REFUSED: dict[str, tuple[str, tuple[str, ...], str, str]] = {
    "zonotope": ("platoon", ("detector.threshold=zonotope",), "columns of a zonotope", 'detector.threshold = "exact"'),
    "prediction": ("platoon", ("detector.prediction=true",), "prediction of 'measurement'", "detector.prediction = false"),
    "float32": ("platoon", ("signals.0.wire=float32", "groups.0.frame.fd=true"), "a float32 on the wire", "integer field"),
    "unknown inputs": ("suspension", ("signals.deflection1_m.wire=float32",), "a float32 on the wire", "integer field"),
}


def test_the_commands_run_in_fixed_point(cli: Cli, tmp_path: Any) -> None:
    done = cli("run", "platoon", "--bus", "inprocess", "--real", "q31", "--expect", "detect", "--out", tmp_path, "--json")
    assert done.status == 0, done.err
    made = json.loads(done.out)
    assert made["real"] == "q31" and made["false_alarms"] == {"provisional": 0, "confirmed": 0}
    assert made["frames"]["periodic"] == 2 * made["samples"]
    again = cli("detect", "platoon", "--log", tmp_path / "run.log", "--rest", "--lockstep", "--real", "q31", "--json")
    assert again.status == 0, again.err
    assert json.loads(again.out)["verdicts"] == made["verdicts"]
    assert cli("campaign", "platoon", "--runs", 2, "--real", "q31", "--json").status == 0


@pytest.mark.parametrize("case", REFUSED)
def test_what_has_no_fixed_point_form_is_refused_in_one_line_with_reason_and_cure(cli: Cli, case: str) -> None:
    model, overrides, reason, cure = REFUSED[case]
    options = [x for o in overrides for x in ("--set", o)]
    for command in (("campaign", model, "--runs", 1), ("run", model, "--bus", "inprocess")):
        done = cli(*command, *options, "--real", "q31", "-q")
        assert done.status != 0 and not done.out
        assert len(done.err.splitlines()) == 1
        assert reason in done.err and cure in done.err


@pytest.mark.parametrize("case", REFUSED)
def test_design_names_why_there_is_no_fixed_point_form(cli: Cli, tmp_path: Any, case: str) -> None:
    model, overrides, reason, cure = REFUSED[case]
    done = cli("design", model, *(x for o in overrides for x in ("--set", o)), "--out", tmp_path)
    assert done.status == 0
    assert reason in done.out and cure in done.out
