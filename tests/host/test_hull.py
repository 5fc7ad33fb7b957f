"""The threshold's tables in the C library: never below the exact hull over 2000 lags, whatever the poles, the radii and the start are, in either number
type; above it by no more than the shares that the design allows; and a table that is 1 % smaller would be found out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from host_support import FLOATS, SEED
from hullguard.core.library import library
from hullguard.design import hull
from hullguard.design.arith import nearest32
from hullguard.design.observer import SubPlant
from hullguard.model.table import Array
from linear_support import KINDS, random_state

LAGS = 2000
SAMPLES = 900
WIDEST = 2000.0  # times the usual radius: a range end to end
STARTS = ("moving", "rest")


@dataclass(frozen=True)
class Problem:
    """A generator without mismatch (T = 1, A = G + Ly C, F = -Dy C), its tables, and what is exact (float64, by the equations at the top of hull.py)."""

    lin: hull.Linear
    given: hull.Given
    tables: hull.HullTables
    response: Array  # LAGS x residuals x signals: |h|
    driven: Array  # LAGS x residuals: disturbances up to a sample
    added: dict[str, Array]  # LAGS x residuals: initial state, by start

    @property
    def ranges(self) -> hull.Ranges:
        """Largest magnitudes."""
        return self.given.ranges

    @property
    def expected(self) -> hull.Expected:
        """Usual and late radii."""
        return self.given.expected


def exact_responses(lin: hull.Linear, entering: Array, at_once: Array, ranges: hull.Ranges, Bd: Array, Dd: Array) -> tuple[Array, Array, dict[str, Array]]:
    F, response, driven, reach = lin.output, [np.abs(at_once)], [np.abs(Dd).sum(1)], []
    for _ in range(LAGS):
        reach.append(np.abs(F))
        response.append(np.abs(F @ entering))
        driven.append(driven[-1] + np.abs(F @ Bd).sum(1))
        F = F @ lin.state
    added = {"rest": np.array(reach) @ ranges.initial, "moving": np.array(reach) @ ranges.state}
    return np.array(response[:LAGS]), np.array(driven[:LAGS]), added


def problem(number: int) -> Problem:
    """Random units, disturbances, derived signals and ranges."""
    rng = np.random.default_rng([SEED, number])
    state = random_state(rng, KINDS[number % 4])
    s, m, p, q, nd, residuals = len(state), *(int(rng.integers(a, b)) for a, b in ((1, 4), (0, 3), (0, 3), (1, 3), (1, 4)))
    radius = 10.0 ** rng.uniform(-2, 2, m + p + q)
    C = rng.standard_normal((m, s)) * radius[:m, None]
    inputs, Dy = rng.standard_normal((s, m + p)) / radius[: m + p], rng.standard_normal((residuals, m)) / radius[:m]
    lin = hull.rounded(state, inputs, -Dy @ C, np.hstack([Dy, np.zeros((residuals, p))]))
    plant = SubPlant(
        state + inputs[:, :m] @ C, inputs[:, m:], C, np.zeros((m, p)), rng.standard_normal((s, nd)) * 0.1, rng.standard_normal((m, nd)) * radius[:m, None] * 0.1,
        radius[:m], radius[m : m + p],
    )  # fmt: skip
    x = 10.0 ** rng.uniform(0, 3, s)
    derived = rng.standard_normal((s, q)) / radius[m + p :]
    ranges = hull.Ranges(x * rng.uniform(0.0, 0.1), x, WIDEST / 2 * radius[: m + p], WIDEST / 2 * radius[m : m + p], WIDEST * radius[m + p :])
    expected = hull.Expected(radius, radius * rng.uniform(1.0, 30.0, len(radius)), tuple(int(t) for t in rng.integers(1, 12, len(radius))))
    given = hull.Given(np.eye(s), plant, ranges, expected, derived)
    tables = hull.build(lin, given, "random")
    Bd, Dd = plant.Ed - lin.input[:, :m] @ plant.Fd, lin.direct[:, :m] @ plant.Fd
    exact = exact_responses(lin, np.hstack([lin.input, derived]), np.hstack([lin.direct, np.zeros((residuals, q))]), ranges, Bd, Dd)
    return Problem(lin, given, tables, *exact)


def summed(response: Array, radius: Array) -> Array:
    """Samples x residuals: the sum of |h| over the whole past of radii."""
    signals, residuals = range(radius.shape[1]), range(response.shape[1])
    return np.array([sum(np.convolve(response[:, i, g], radius[:, g])[: len(radius)] for g in signals) for i in residuals]).T


def exact_hull(p: Problem, start: str, radius: Array) -> Array:
    return np.asarray(summed(p.response, radius) + (p.driven + p.added[start])[: len(radius)])


def thresholds(tables: hull.HullTables, start: str, radius: Array, real: str, exponent: int = 0) -> tuple[Array, Array]:
    """J and theta of the C library, samples x residuals. The tables are laid out as hull.h says, not by the design's own code.

    In fixed point all numbers are in units, which they do not reach; `exponent` is that of the weights.
    """
    lib, ffi = library(real).lib, library(real).ffi

    def numbers(values: Array) -> list[float]:
        flat = np.ravel(values)
        return [round(x * 2**31) for x in flat.tolist()] if real == "q31" else list(flat.tolist())

    one = 2.0**-31 if real == "q31" else 1.0
    residuals, width = tables.tail.shape
    settle = tables.settle
    pairs = [range(i, min(i + 2, residuals)) for i in range(0, residuals, 2)]
    whole = [np.concatenate([tables.weight[: tables.taps[g], :, g], tables.tail[None, :, g]]) for g in range(width)]
    weight = [float(lag[i]) for pair in pairs for g in range(width) for lag in whole[g] for i in pair]
    table = {"weight": weight, "rest": tables.rest[:settle], "moving": tables.moving[:settle]}
    table |= {key: getattr(tables, key) for key in ("rest_left", "moving_left", "bias", "decay")}
    keep = {key: ffi.new("hg_real[]", numbers(np.asarray(value))) for key, value in table.items()}
    keep |= {"signal": ffi.new("uint8_t[]", list(range(width))), "taps": ffi.new("uint8_t[]", list(tables.taps))}
    config = ffi.new("hg_hull_config *", {"residuals": residuals, "width": width, "settle": settle, "exponent": exponent, **keep})
    ring, self, length = ffi.new("hg_ring *"), ffi.new("hg_hull *"), max(tables.taps) + 1
    memory, theta, J = ffi.new("hg_real[]", width * length), ffi.new("hg_real[]", residuals), ffi.new("hg_real[]", residuals)
    assert lib.hg_ring_start(ring, width, length, memory) == lib.HG_OK
    assert lib.hg_hull_start(self, config, ring, STARTS.index(start), theta) == lib.HG_OK
    out = np.zeros((2, len(radius), residuals))
    for k, row in enumerate(radius):
        assert lib.hg_ring_push(ring, ffi.new("hg_real[]", numbers(row))) == lib.HG_OK
        lib.hg_hull_step(self, ring, J)
        out[:, k] = np.array([list(J), list(theta)]) * one
    return out[0], out[1]


def sequences(p: Problem, rng: np.random.Generator) -> list[Array]:
    """Radii as float32 holds them: often 0, mostly usual, sometimes far beyond; bursts as wide as the range; one signal once; none."""
    radius, width = p.expected.usual, len(p.expected.usual)
    mixed = radius * rng.choice([0.0, 0.1, 1.0, 30.0], p=[0.3, 0.2, 0.45, 0.05], size=(SAMPLES, width)) * rng.random((SAMPLES, width))
    bursts = radius * rng.random((SAMPLES, width))
    for begin in rng.integers(0, SAMPLES, 6):
        bursts[begin : begin + int(rng.integers(1, 40))] *= WIDEST * 0.99
    single = np.zeros((width, SAMPLES, width))
    single[range(width), 0, range(width)] = WIDEST * 0.99 * radius
    return [nearest32(r) for r in (mixed, bursts, *single, np.zeros((SAMPLES, width)))]


@pytest.fixture(scope="module")
def problems() -> list[Problem]:
    made = [problem(i) for i in range(40)]
    assert any(max(p.tables.taps) > min(p.tables.taps) for p in made), "no signal has taps of its own: the test would not see it"
    assert any(np.any(p.tables.tail > 0) for p in made)
    assert any(np.any(p.tables.moving_left > 0) for p in made)
    return made


def lowest(p: Problem, tables: hull.HullTables, real: str) -> float:
    """The smallest J/exact - 1 over starts and radii."""
    rng = np.random.default_rng([SEED, 7])
    found = [(start, radius, exact_hull(p, start, radius)) for radius in sequences(p, rng) for start in STARTS]
    return min(float((thresholds(tables, start, radius, real)[0] / exact - 1).min()) for start, radius, exact in found)


@pytest.mark.parametrize("real", FLOATS)
def test_no_threshold_is_below_the_exact_hull(problems: list[Problem], real: str) -> None:
    for i, p in enumerate(problems):
        assert lowest(p, p.tables, real) >= 0, f"problem {i}"


def test_the_bias_tables_are_as_long_as_they_are_used(problems: list[Problem]) -> None:
    for p in problems:
        assert len(p.tables.rest) == len(p.tables.moving) >= p.tables.settle >= 1


def test_a_tail_that_is_1_percent_smaller_is_found_out(problems: list[Problem]) -> None:
    tailed = [p for p in problems if np.any(p.tables.tail > 0)]
    low = [lowest(p, replace(p.tables, tail=p.tables.tail * 0.99), "f64") for p in tailed]
    assert sum(x < 0 for x in low) >= len(tailed) // 2 >= 5, low


@pytest.mark.parametrize("start", STARTS)
def test_what_is_left_of_a_start_cannot_be_1_percent_smaller(problems: list[Problem], start: str) -> None:
    left = f"{start}_left"
    started = [p for p in problems if np.any(getattr(p.tables, left) > 3 * p.tables.bias)]
    low = [lowest(p, replace(p.tables, **{left: getattr(p.tables, left) * 0.99}), "f64") for p in started]
    assert sum(x < 0 for x in low) >= len(started) / 4 > 0, low


def behind(p: Problem, radius: Array) -> Array:
    """Residuals: the sum of |h| behind the taps of each signal, with these radii always."""
    return np.asarray(sum(p.response[taps:, :, g].sum(0) * radius[g] for g, taps in enumerate(p.tables.taps)))


@pytest.mark.parametrize("which, share", [("usual", hull.TAIL_SHARE), ("late", hull.LATE_SHARE)])
def test_the_bound_of_what_lies_behind_the_taps_adds_no_more_than_its_share(problems: list[Problem], which: str, share: float) -> None:
    for p in problems:
        if max(p.tables.taps) == hull.TAPS_MAX:
            continue  # there are no more
        radius = getattr(p.expected, which)
        _, theta = thresholds(p.tables, "rest", np.tile(radius, (LAGS, 1)), "f64")
        whole = p.tables.bias + p.response.sum(0) @ radius
        assert np.all(theta[-1] >= behind(p, radius))
        assert np.all(theta[-1] - behind(p, radius) <= share * whole * (1 + 1e-3))


@pytest.mark.parametrize("start", STARTS)
def test_what_a_tail_takes_over_of_a_start_adds_no_more_than_its_share(problems: list[Problem], start: str) -> None:
    for p in problems:
        _, theta = thresholds(p.tables, start, np.zeros((SAMPLES, len(p.expected.usual))), "f64")
        rounding = p.tables.bias - p.driven[-1]
        beyond = (p.added[start] + p.driven - p.tables.bias)[p.tables.settle : SAMPLES]
        above, theta = np.maximum(beyond + rounding, 0.0), theta[p.tables.settle :]
        assert np.all(theta >= beyond)
        assert np.all(theta - above <= hull.START_SHARE * (p.tables.steady + above) * (1 + 1e-3))


@pytest.mark.parametrize("real", FLOATS)
def test_a_threshold_at_usual_radii_is_the_hull_and_its_shares(problems: list[Problem], real: str) -> None:
    """After the start, and with the constant of rounding that a generator of such ranges needs."""
    for p in problems:
        if max(p.tables.taps) < hull.TAPS_MAX:
            radius = nearest32(np.tile(p.expected.usual, (LAGS, 1)))
            J = thresholds(p.tables, "moving", radius, real)[0][-1]
            exact = exact_hull(p, "moving", radius)[-1] + (p.tables.bias - p.driven[-1])
            assert np.all(J <= exact * (1 + hull.TAIL_SHARE) * (1 + 2e-3))
