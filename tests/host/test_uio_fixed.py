"""Unknown-input observers in fixed point: radii are never below the exact hull of the stored numbers, with their rounding; estimates move by no more than is
stated; nothing saturates at the ends of all ranges; and a wrong rounding constant or exponent is found out.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from host_support import SEED, Cli, Models
from hullguard.core.library import library
from hullguard.core.native_uio import Uio, UioTable
from hullguard.design.design import Design
from hullguard.design.fixed import LARGEST, STEP, FixedDesign, Modal, lower
from hullguard.design.hull import Linear
from hullguard.design.uio_generator import UioDesign, uio_table
from hullguard.errors import InputError
from hullguard.model.road import RoadSpec
from hullguard.model.table import Array
from test_uio_hull import ROADS, course, errors
from uio_support import observers

LAGS = 12_000  # after them no pole here has anything left
SHOWN = 1500  # samples of a comparison
FORMS = {"direct and discrete": {}, "first-order hold": observers("first-order hold"), "discrete": observers("discrete")}


@dataclass(frozen=True)
class Exact:
    """An observer as fixed point holds it, in units of the model, and what follows from that in double precision."""

    made: UioDesign
    table: UioTable
    linear: Linear
    response: Array  # lags x estimates x width: magnitudes
    constant: Array  # SHOWN x estimates: what no radius is in it after so many samples
    moving: Array  # SHOWN x estimates: of an initial state anywhere in its range
    stepwise: Array  # estimates: what rounding of each step can do
    signal: Array  # width: units
    unit: Array  # estimates: units


def powers_of(F: Array, G: Array, count: int) -> Array:
    out = np.zeros((count, *F.shape))
    for k in range(count):
        out[k], F = F, F @ G
    return out


def state_units(stored: Linear, exact: Linear, V: Array, R: Array) -> Array:
    """The units of the states, which are powers of two that the entries show: of those that signals enter, then of those that outputs or known states show."""
    units = np.full(len(exact.state), np.nan)
    for n in range(len(units)):
        for held, given in zip(stored.input[n], exact.input[n] * V, strict=True):
            if abs(held) > 1e-4:
                units[n] = 2.0 ** np.rint(np.log2(given / held))
    rows, known = np.vstack([stored.state, stored.output]), np.concatenate([units, R])
    for n in np.flatnonzero(np.isnan(units)):
        best = int(np.where(np.isfinite(known), np.abs(rows[:, n]), 0.0).argmax())
        given = np.vstack([exact.state, exact.output])[best, n]
        units[n] = 2.0 ** np.rint(np.log2(rows[best, n] * known[best] / given))
    return units


def stored_linear(u: UioDesign, t: UioTable, V: Array, R: Array) -> tuple[Linear, Array]:
    """The matrices that fixed point holds, in units of the model, and the units of the state."""
    moved, shown = 2.0 ** t.exponents[0], 2.0 ** t.exponents[1]
    Z = state_units(Linear(t.state * moved, t.input * moved, t.output * shown, t.direct * shown), u.linear, V, R)
    to_state, to_estimate = moved * Z[:, None], shown * R[:, None]
    return Linear(t.state * to_state / Z, t.input * to_state / V, t.output * to_estimate / Z, t.direct * to_estimate / V), Z


def exact_of(u: UioDesign) -> Exact:
    assert u.fixed is not None
    table, given = uio_table(u, "q31"), u.given
    V = 2.0 ** np.array([table.signal_units[i] for i in u.signal], dtype=float)
    R = 2.0 ** np.array(table.units, dtype=float)
    lin, Z = stored_linear(u, table, V, R)
    plant, m, x, v = given.plant, len(given.plant.C), given.ranges.state, given.ranges.input
    F = powers_of(lin.output, lin.state, LAGS)
    off = np.abs(given.T @ plant.A - lin.state @ given.T - lin.input[:, :m] @ plant.C) @ x + np.abs(given.T @ plant.B - lin.input[:, :m] @ plant.D - lin.input[:, m:]) @ v
    off_r = np.abs(lin.output @ given.T + lin.direct[:, :m] @ plant.C - given.truth) @ x + np.abs(lin.direct[:, :m] @ plant.D + lin.direct[:, m:]) @ v
    into, columns = off + given.passing.box + Z * STEP / 2, given.passing.columns
    each = np.abs(F) @ into + np.abs(F @ columns).sum(2)
    at_once = off_r + np.abs(given.passing.at_once).sum(1) + R * STEP / 2
    constant = at_once + np.vstack([np.zeros(len(R)), each.cumsum(0)[: SHOWN - 1]])
    stepwise = R * STEP / 2 + (np.abs(F) @ (Z * STEP / 2)).sum(0)
    response = np.concatenate([np.abs(lin.direct)[None], np.abs(F[: SHOWN - 1] @ lin.input)])
    return Exact(u, table, lin, response, constant, np.abs(F[:SHOWN] @ given.T) @ x, stepwise, V, R)


@pytest.fixture(scope="module", params=[*FORMS, "published"])
def design(request: pytest.FixtureRequest, models: Models) -> Design:
    return models.design(scenario="default", name="suspension_published") if request.param == "published" else models.design(FORMS[request.param], "default", "suspension")


@pytest.fixture(scope="module")
def every(design: Design) -> list[Exact]:
    return [exact_of(u) for u in design.uios]


def bounds(e: Exact, radius: Array, table: UioTable | None = None) -> Array:
    """Radii of the C library after a start in a moving plant, from radii of the signals that fixed point can hold."""
    wide = np.zeros((len(radius), len(e.table.signal_units)))
    wide[:, list(e.made.signal)] = radius
    run = Uio(library("q31"), table or e.table, width=wide.shape[1], moving=True).run(0.0 * wide, wide)
    assert run.refused == 0
    return run.radius


def held(e: Exact, radius: Array) -> Array:
    """In steps, rounded up."""
    return np.asarray(np.ceil(radius / e.signal / STEP) * STEP * e.signal)


def exact_hull(e: Exact, radius: Array) -> Array:
    """The sum over all lags: samples x estimates."""
    size = 2 * len(radius)
    both = np.einsum("fiw,fw->fi", np.fft.rfft(e.response[: len(radius)], size, 0), np.fft.rfft(radius, size, 0))
    return np.asarray(np.fft.irfft(both, size, 0)[: len(radius)] + e.constant[: len(radius)] + e.moving[: len(radius)])


def some_radii(e: Exact, samples: int = SHOWN) -> list[Array]:
    """Usual ones, drawn ones, long silence of all, and single ones as wide as the unit."""
    rng, usual = np.random.default_rng([SEED, 5]), e.made.given.radius
    single = np.zeros((samples, len(usual)))
    single[rng.integers(0, samples, 12), rng.integers(0, len(usual), 12)] = 1.0
    drawn = rng.choice([0.0, 1.0, 3.0, 30.0], (samples, len(usual))) * rng.random((samples, len(usual))) * usual
    return [held(e, np.tile(usual, (samples, 1))), held(e, np.minimum(drawn, e.signal / 2)), np.zeros((samples, len(usual))), held(e, single * e.signal * (1 - 1e-6))]


def lowest(e: Exact, table: UioTable | None = None) -> float:
    """The smallest radius/exact - 1."""
    return min(float((bounds(e, r, table) / exact_hull(e, r) - 1).min()) for r in some_radii(e))


def test_no_radius_is_below_the_exact_hull_of_the_stored_numbers(every: list[Exact]) -> None:
    for e in every:
        assert lowest(e) >= 0


def test_fixed_point_costs_what_it_says_and_less_than_float32(every: list[Exact]) -> None:
    for e in every:
        assert e.made.fixed is not None
        rounding, shares = np.array(e.made.fixed.rounding), np.array(e.made.fixed.rounding) / e.made.tables.steady
        assert np.all(rounding >= e.stepwise) and shares.max() < 0.005
        assert np.all(shares < e.made.tables.rounding / e.made.tables.steady)
        radius = np.tile(held(e, e.made.given.radius), (SHOWN, 1))
        wide = np.zeros((SHOWN, len(e.table.signal_units)))
        wide[:, list(e.made.signal)] = radius
        float32 = Uio(library("f64"), uio_table(e.made), width=wide.shape[1], moving=True).run(0.0 * wide, wide).radius
        assert np.all(bounds(e, radius) <= (float32 + rounding) * (1 + 1e-5))


def test_half_the_rounding_is_found_out(every: list[Exact]) -> None:
    """Of the constant part alone, which a radius is after long silence of all signals."""
    low = []
    for e in every:
        assert e.made.fixed is not None
        less = np.array(e.made.fixed.rounding) / 2 / e.unit
        wrong = replace(e.table, rest=np.floor((e.table.rest - less) / STEP) * STEP, moving=np.floor((e.table.moving - less) / STEP) * STEP)
        none = np.zeros((6000, len(e.signal)))
        low.append(float((bounds(e, none, wrong)[-1] / e.constant[-1] - 1).min()))
        assert np.all(bounds(e, none)[-1] >= e.constant[-1])
    assert min(low) < 0, low


def test_an_exponent_that_is_1_too_small_is_found_out(every: list[Exact]) -> None:
    for e in every:
        moved, shown, summed = e.table.exponents
        assert lowest(e, replace(e.table, exponents=(moved, shown, summed - 1))) < 0


def test_without_the_start_of_the_modes_a_radius_is_below_what_the_initial_state_does(every: list[Exact]) -> None:
    for e in every:
        without = replace(e.table, mode_moving=0.0 * e.table.mode_moving)
        assert lowest(e, without) < 0


def extremes(e: Exact, samples: int, part: float) -> Array:
    """Every signal at one end of its range or the other, or anywhere between, for one sample or for long: samples x signals."""
    rng, largest = np.random.default_rng([SEED, 3]), e.made.given.ranges.value * part
    out, left, value = np.zeros((samples, len(e.table.signal_units))), np.zeros(len(largest), dtype=int), largest.copy()
    for k in range(samples):
        done = left <= 0
        left = np.where(done, rng.choice([1, 2, 5, 300], size=len(largest)), left) - 1
        value = np.where(done, rng.choice([-1.0, 1.0, -1.0, 1.0, 0.3], size=len(largest)) * largest, value)
        out[k, list(e.made.signal)] = np.trunc(value / e.signal / STEP) * STEP * e.signal
    return out


def test_rounding_moves_an_estimate_by_no_more_than_is_proven_at_the_ends_of_all_ranges(every: list[Exact]) -> None:
    for e in every:
        value = extremes(e, 1200, 1.0)
        run = Uio(library("q31"), e.table, width=value.shape[1]).run(value)
        assert run.refused == 0
        z, worst = np.zeros(len(e.linear.state)), np.zeros(len(e.unit))
        for k, v in enumerate(value[:, list(e.made.signal)]):
            worst = np.maximum(worst, np.abs(run.estimate[k] - e.linear.output @ z - e.linear.direct @ v) / (e.stepwise + 1e-13 * e.unit))
            z = e.linear.state @ z + e.linear.input @ v
        assert 0.02 < worst.max() <= 1.0


def test_nothing_saturates_whatever_values_and_radii_are(every: list[Exact]) -> None:
    """Radii as wide as the units for good, from a start anywhere in the range; values at the ends of their ranges."""
    for e in every:
        value = extremes(e, 3000, 1.0)
        wide = np.zeros_like(value)
        wide[:, list(e.made.signal)] = LARGEST * e.signal
        for moving in (False, True):
            run = Uio(library("q31"), e.table, width=value.shape[1], moving=moving).run(value, wide)
            assert run.refused == 0 and np.all(run.radius < LARGEST * e.unit) and np.all(np.abs(run.estimate) < LARGEST * e.unit)
            assert np.all(run.radius[-1] > e.unit / 64), "a unit is not far above what it is for"


def test_estimates_of_the_number_types_are_as_close_as_their_rounding(design: Design, every: list[Exact]) -> None:
    road = RoadSpec("smooth") if design.model.name == "suspension_published" else ROADS["random"]
    value, radius = errors(design, course(design, road, 1000, SEED % 1000), np.random.default_rng(SEED))
    for e in every:
        u = e.made
        found = {real: Uio(library(real), uio_table(u, real), width=value.shape[1]).run(value, radius) for real in ("f64", "q31")}
        more = np.array([design.model.signals[i].noise for i in u.signal]) + radius[:, list(u.signal)].max(0)
        F, G = powers_of(e.linear.output, e.linear.state, LAGS) @ e.linear.input, powers_of(u.linear.output, u.linear.state, LAGS) @ u.linear.input
        other = (np.abs(F - G).sum(0) + np.abs(e.linear.direct - u.linear.direct)) @ more  # the responses themselves differ by what rounds the tables
        assert u.fixed is not None
        apart = np.abs(found["q31"].estimate - found["f64"].estimate).max(0)
        assert np.all(apart <= np.array(u.fixed.rounding) + u.tables.rounding + u.tables.steady_bias * 1e-9 + other)
        assert np.all(apart > 0)


def modal_of(u: UioDesign) -> Modal:
    return Modal(u.linear, u.given, u.tables)


def lowered(design: Design, modal: tuple[Modal, ...]) -> FixedDesign:
    return lower(replace(design.tables, fixed=None, units=()), (), (), (), "here", modal)


def test_what_cannot_be_proven_is_refused(models: Models) -> None:
    made = models.design(scenario="default", name="suspension")
    first, second = (modal_of(u) for u in made.uios)
    assert lowered(made, (first, second)).observers == tuple(u.fixed for u in made.uios)
    slow = replace(first, linear=replace(first.linear, state=np.eye(2) * (1 - 1e-5)))
    with pytest.raises(InputError, match=r"forgets too slowly for fixed point"):
        lowered(made, (slow, second))
    fewer = replace(first, tables=replace(first.tables, mode_decay=first.tables.mode_decay[:1], mode_input=first.tables.mode_input[:1], mode_output=first.tables.mode_output[:, :1],
                                          mode_rest=first.tables.mode_rest[:1], mode_moving=first.tables.mode_moving[:1]))  # fmt: skip
    with pytest.raises(InputError, match=r"here: detector\.uio\[0\]: not for fixed point: rounded tables have other modes"):
        lowered(made, (fewer, second))
    larger = replace(first.given, ranges=replace(first.given.ranges, state=1e9 * first.given.ranges.state))  # units were chosen for other ranges
    with pytest.raises(InputError, match=r"leave the range of the exact ones"):
        lowered(made, (replace(first, given=larger), second))


def test_isolation_and_tables_of_another_number_type_are_refused(models: Models) -> None:
    u = models.design(scenario="default", name="suspension").uios[0]
    for real, other in (("q31", "f32"), ("f32", "q31")):
        with pytest.raises(InputError, match="for another number type"):
            Uio(library(real), uio_table(u, other))
    with pytest.raises(InputError, match="no form in fixed point; use float32"):
        uio_table(replace(u, fixed=None), "q31")


def test_the_commands_run_in_fixed_point(cli: Cli, tmp_path: Path) -> None:
    done = cli("run", "suspension", "--bus", "inprocess", "--real", "q31", "--samples", 1300, "--fault", "actuator1:bias:600@900", "--expect", "detect", "--out", tmp_path, "--json")
    assert done.status == 0, done.err
    made = json.loads(done.out)
    assert made["false_alarms"] == {"provisional": 0, "confirmed": 0} and made["isolation"] == []
    assert all(e["error_max"] > 0 for e in made["estimates"]) and made["faults"][0]["delay"] < 100
    assert (tmp_path / "estimates.csv").exists()
    assert cli("report", tmp_path).status == 0
    assert cli("campaign", "suspension", "--runs", 2, "--samples", 300, "--no-fault", "--workers", 1, "--real", "q31", "--json").status == 0
