"""Thresholds are neither too small nor too large: disturbances, initial states and held values are chosen to make a residual as large as a healthy
plant can make it, by sign and by linear programme, from the plant's own matrices. The same checks must fail for a library that is wrong on purpose.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from host_support import (
    PERIODIC,
    REALS,
    SEED,
    SILENT_1,
    SILENT_2,
    Alarms,
    Models,
    Ready,
    alarms,
    build_library,
)
from hullguard.core.library import Library, library
from hullguard.design.hull import START_SHARE
from scipy.optimize import linprog

OUTPUTS, INPUTS = 3, 3
# Quantisation is no disturbance that a test can choose; ten times finer codes make it small.
FINE: dict[str, Any] = {f"signals.{i}.resolution": 1e-4 for i in range(OUTPUTS)} | {f"signals.{i}.range": [-2.0, 2.0] for i in range(OUTPUTS)}
LENGTH = 160


@pytest.fixture(scope="module")
def exact() -> Iterator[Models]:
    """The designs as they are made: the tail's bound and the bias tables' last row are part of the threshold."""
    yield Models()


def worst_case(ready: Ready, residual: int, k: int) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Disturbances and the signs of the initial state that make a residual largest at sample k, from the response of plant and fused observer together."""
    generator = ready.design.generators[0]
    plant, fused = generator.plant, generator.linear
    n, order = plant.A.shape[0], fused.state.shape[0]
    into = fused.input[:, :OUTPUTS]
    both = np.block([[plant.A, np.zeros((n, order))], [into @ plant.C, fused.state]])
    enters = np.vstack([plant.Ed, into @ plant.Fd])
    row = np.hstack([fused.direct[residual, :OUTPUTS] @ plant.C, fused.output[residual]])
    d = np.zeros((LENGTH, plant.Ed.shape[1]))
    d[k] = np.sign(fused.direct[residual, :OUTPUTS] @ plant.Fd)
    for j in range(k - 1, -1, -1):
        d[j] = np.sign(row @ enters)
        row = row @ both
    return d, np.sign(row[:n])


def extremes_at(ready: Ready, residual: int, k: int, sign: float = 1.0, runs: int = 8) -> list[tuple[float, float]]:
    """|r| and J at sample k in runs that differ in their inputs only."""
    d, x0 = worst_case(ready, residual, k)
    batch = ready.batch(LENGTH, disturbance=sign * d, initial=sign * x0 * ready.design.model.plant.initial_range)
    lib = ready.native.library.lib
    found = []
    for run in range(runs):
        made = lib.hgh_run_new(batch.config, run)
        lib.hgh_run_steps(made, k + 1)
        view = lib.hgh_run_view(made)
        found.append((abs(view.r[residual]), view.J[residual]))
        lib.hgh_run_free(made)
    return found


def ratio_at(ready: Ready, residual: int, k: int, sign: float = 1.0, runs: int = 8) -> float:
    """Largest |r|/J at sample k over runs that differ in their inputs only."""
    return max(r / J for r, J in extremes_at(ready, residual, k, sign, runs))


def handed_over(ready: Ready, residual: int, k: int) -> float:
    """What the tail says of a start at rest at sample k beyond what the initial state and the disturbances do then."""
    tables = ready.design.generators[0].tables
    if k < tables.settle:
        return 0.0
    left = tables.rest_left[residual] * tables.decay[residual] ** (k - tables.settle)
    return float(tables.bias[residual] + left - tables.rest[min(k, len(tables.rest) - 1), residual])


def residuals(ready: Ready) -> range:
    return range(ready.native.tables.residuals)


@pytest.mark.parametrize("real", REALS)
@pytest.mark.parametrize("k", [0, 3, 20, 60, 150])
def test_no_periodic_residual_stays_below_its_threshold_by_more_than_2_percent_or_exceeds_it(exact: Models, real: str, k: int) -> None:
    """Soon after a start a threshold is larger by what the tail says of the initial state beyond what it does: no more than its share."""
    ready = exact.platoon("manoeuvres", PERIODIC | FINE, real)
    for i in residuals(ready):
        for sign in (1.0, -1.0):
            found, handed = extremes_at(ready, i, k, sign), handed_over(ready, i, k)
            assert max(r / J for r, J in found) <= 1.0, f"residual {i + 1} at sample {k}, sign {sign:g}"
            assert max(r / (J - handed) for r, J in found) >= 0.98, f"residual {i + 1} at sample {k}, sign {sign:g}"
            assert handed <= START_SHARE * found[0][1]


@pytest.mark.parametrize("real", REALS)
@pytest.mark.parametrize("k", [20, 60, 150])
def test_no_periodic_residual_as_designed_exceeds_its_threshold(models: Models, real: str, k: int) -> None:
    """Codes of 1 mm, whose rounding is 2 to 3 % of the threshold and falls as it may, and few taps: near the threshold, never above it."""
    ready = models.platoon("manoeuvres", PERIODIC, real)
    for i in residuals(ready):
        assert 0.85 <= ratio_at(ready, i, k, runs=200) <= 1.0


def test_the_bound_on_what_lies_behind_the_taps_does_not_cost_2_percent_of_a_threshold(models: Models) -> None:
    for generator in models.design().generators:
        tables, lin = generator.tables, generator.linear
        bound = (tables.tail * generator.radius).sum(1) / (1 - tables.decay)
        exact, F = np.zeros(len(bound)), lin.output
        for lag in range(1, 2000):
            exact += np.abs(F @ lin.input) @ (generator.radius * (lag >= np.array(tables.taps)))
            F = F @ lin.state
        assert np.all(bound >= exact)
        assert np.all(bound - exact <= 0.02 * tables.steady)


# ---- events: held values, true outputs, disturbances and initial state by linear programme ----


def pattern(ready: Ready, loss: float, run: int, samples: int) -> tuple[dict[str, Any], np.ndarray[Any, Any], np.ndarray[Any, Any], list[int]]:
    """A recorded run: its trace, which held value each sample has, radii as they are known at the end, samples at which a gap showed."""
    trace = ready.batch(samples, loss=loss).trace(run)
    table = ready.native.tables.groups[0]
    half = np.array([s.half for s in table.signals])
    fresh = np.all(np.abs(trace["radius"][:, :OUTPUTS] - half) < 1e-9, axis=1)
    sent = (trace["events"] & 1) == 1
    radius = trace["radius"][:, :OUTPUTS].copy()
    span = [s.span for s in table.signals]  # of a group that has been stale
    slew = np.vstack([np.array(table.slew), np.tile(span, (samples, 1))])
    gaps: list[int] = []
    starts = np.flatnonzero(fresh)
    for begin, end in zip(starts, starts[1:], strict=False):
        if np.any(sent[begin + 1 : end]):
            gaps.append(int(end))
            radius[begin + 1 : end] = slew[: end - begin - 1]
    return trace, np.cumsum(fresh) - 1, radius, gaps


def largest_residual(ready: Ready, residual: int, k: int, segment: np.ndarray[Any, Any], radius: np.ndarray[Any, Any]) -> float:
    """Largest r at sample k that a healthy plant within its bounds can cause, held values within these radii of the outputs."""
    generator = ready.design.generators[0]
    plant, fused, model = generator.plant, generator.linear, ready.design.model
    n, nd, order, held = plant.A.shape[0], plant.Ed.shape[1], fused.state.shape[0], int(segment[k]) + 1
    d0, u0, h0 = n, n + (k + 1) * nd, n + (k + 1) * (nd + INPUTS)
    count = h0 + OUTPUTS * held
    limit = np.full(count, np.inf)
    limit[:n] = model.plant.initial_range
    limit[d0:u0] = 1.0
    limit[u0:h0] = [model.signals[i].high for i in model.inputs] * (k + 1)
    x, z = np.zeros((n, count)), np.zeros((order, count))
    x[:, :n] = np.eye(n)
    rows, bounds, r = [], [], np.zeros(count)
    for j in range(k + 1):
        d, u, h = slice(d0 + j * nd, d0 + (j + 1) * nd), slice(u0 + j * INPUTS, u0 + (j + 1) * INPUTS), h0 + OUTPUTS * int(segment[j])
        y = plant.C @ x
        y[:, d] += plant.Fd
        value = np.zeros((OUTPUTS + INPUTS, count))
        value[:OUTPUTS, h : h + OUTPUTS] = np.eye(OUTPUTS)
        value[OUTPUTS:, u] = np.eye(INPUTS)
        rows += [y - value[:OUTPUTS], value[:OUTPUTS] - y, x, -x]
        bounds += [radius[j], radius[j], ready.design.stored.state_range, ready.design.stored.state_range]
        r = fused.output[residual] @ z + fused.direct[residual] @ value
        z = fused.state @ z + fused.input @ value
        x = plant.A @ x
        x[:, d] += plant.Ed
        x[:, u] += plant.B
    solved = linprog(-r, A_ub=np.vstack(rows), b_ub=np.concatenate(bounds), bounds=np.column_stack([-limit, limit]), method="highs")
    assert solved.status == 0, solved.message
    return float(-solved.fun)


@pytest.mark.parametrize("silence", [0, 1, 2])
@pytest.mark.parametrize("run", [SEED % 1000, SEED % 1000 + 1])
def test_no_held_value_within_its_radius_brings_a_residual_over_its_threshold(models: Models, silence: int, run: int) -> None:
    ready = models.platoon("manoeuvres", (None, SILENT_1, SILENT_2)[silence])
    trace, segment, radius, _ = pattern(ready, 0.0, run, 81)
    for i in residuals(ready):
        ratios = [largest_residual(ready, i, k, segment, radius) / trace["J"][k, i] for k in (12, 40, 60, 80)]
        assert max(ratios) <= 1.0
        assert max(ratios) > 0.9, "the programme does not come near the threshold: it could not show one that is too small"


def after_gaps(models: Models, lib: Library) -> list[float]:
    """|r|/J that can be reached at samples at which a lost frame shows."""
    ready = models.platoon("manoeuvres", lib=lib)
    ratios: list[float] = []
    for run in range(10):
        trace, segment, radius, gaps = pattern(ready, 0.1, run, 61)
        for k in [g for g in gaps if g > 10][:2]:
            ratios += [largest_residual(ready, i, k, segment, radius) / trace["J"][k, i] for i in residuals(ready)]
    return ratios


def test_no_held_value_brings_a_residual_over_its_threshold_after_a_lost_frame_has_shown(models: Models) -> None:
    ratios = after_gaps(models, library("f32"))
    assert len(ratios) >= 4, "no gap fell into these runs"
    assert max(ratios) <= 1.0
    assert max(ratios) > 0.9


# ---- libraries that are wrong on purpose ----

NO_SILENCE = {"hold.c": [("(!lost) && (age > self->silence)", "(!lost) && (!fresh)")]}
NO_REWRITING = {"detector.c": [("hg_hold_rewrite(&self->memory.hold[group], &self->radii, first, lags);", "(void)first;")]}
NO_REWIND = {"hold.c": [("*rewind = (uint8_t)(self->gap_age - 1U);", "*rewind = 0U;")]}
NO_CANCEL = {"decision.c": [("((alarm->pending & evidence->rewound) != 0U)", "false")]}
SMALL_J = {
    "hull.c": [
        (
            "return hg_real_min(hg_real_add(hg_real_add(bias, hg_acc_real(total, config->exponent)), self->theta[i]), HG_REAL_MAX);",
            "return hg_real_mul(HG_REAL_C(0.93), hg_real_add(hg_real_add(bias, hg_acc_real(total, config->exponent)), self->theta[i]));",
        )
    ]
}


def silent_alarms(models: Models, lib: Library) -> Alarms:
    return alarms(models.platoon("manoeuvres", SILENT_2, lib=lib).batch(200).runs(0, 200))


def lossy_alarms(models: Models, lib: Library) -> Alarms:
    return alarms(models.platoon("manoeuvres", lib=lib).batch(200, loss=0.1).runs(0, 1000))


def tightest(exact: Models, lib: Library) -> float:
    ready = exact.platoon("manoeuvres", PERIODIC | FINE, lib=lib)
    return max(ratio_at(ready, i, k) for i in residuals(ready) for k in (20, 150))


def worst_held(models: Models, lib: Library) -> float:
    ready = models.platoon("manoeuvres", SILENT_1, lib=lib)
    largest = 0.0
    for run in range(3):
        trace, segment, radius, _ = pattern(ready, 0.0, run, 81)
        largest = max(largest, *(largest_residual(ready, i, k, segment, radius) / trace["J"][k, i] for i in residuals(ready) for k in (12, 40, 60, 80)))
    return largest


@pytest.mark.wrong
def test_a_hold_that_ignores_the_silent_phase_is_caught(models: Models, tmp_path: Path) -> None:
    assert silent_alarms(models, library("f32")) == Alarms(0, 0)
    wrong = silent_alarms(models, build_library(tmp_path, "f32", NO_SILENCE))
    assert wrong.confirmed > 0
    assert wrong.provisional > 0


@pytest.mark.wrong
@pytest.mark.parametrize("mutation", [NO_REWIND, NO_CANCEL], ids=["no rewriting", "no withdrawal"])
def test_a_library_that_takes_nothing_back_after_a_gap_is_caught(models: Models, tmp_path: Path, mutation: dict[str, list[tuple[str, str]]]) -> None:
    assert lossy_alarms(models, library("f32")).confirmed == 0
    assert lossy_alarms(models, build_library(tmp_path, "f32", mutation)).confirmed > 0


@pytest.mark.wrong
def test_a_detector_that_withdraws_alarms_but_keeps_the_small_radii_of_a_gap_is_caught(models: Models, tmp_path: Path) -> None:
    assert max(after_gaps(models, library("f32"))) <= 1.0
    assert max(after_gaps(models, build_library(tmp_path, "f32", NO_REWRITING))) > 1.0


@pytest.mark.wrong
def test_thresholds_that_are_7_percent_too_small_are_caught(models: Models, exact: Models, tmp_path: Path) -> None:
    assert tightest(exact, library("f32")) <= 1.0
    assert worst_held(models, library("f32")) <= 1.0
    mutant = build_library(tmp_path, "f32", SMALL_J)
    assert tightest(exact, mutant) > 1.0
    assert worst_held(models, mutant) > 1.0


@pytest.mark.wrong
def test_a_rebuilt_library_without_a_mutation_passes_the_same_checks(models: Models, exact: Models, tmp_path: Path) -> None:
    """So that it is the mutation, not the rebuilding, that the three tests above see."""
    same = build_library(tmp_path, "f32")
    assert silent_alarms(models, same) == silent_alarms(models, library("f32"))
    assert lossy_alarms(models, same) == lossy_alarms(models, library("f32"))
    assert tightest(exact, same) == tightest(exact, library("f32"))
