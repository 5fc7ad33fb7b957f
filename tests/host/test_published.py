"""The publication's settings: order 4, two residuals, silence 1, longest interval 5, 100 samples, a controller fault on vehicle 2 half way."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from host_support import FLOATS, Alarms, Cli, Models, alarms
from hullguard.core.library import library
from hullguard.core.pair import Pair
from hullguard.design.zonotope_table import TRUNCATE
from hullguard.errors import InputError
from hullguard.model import load_model
from hullguard.report.run_data import Run, read_run

START, SAMPLES = 50, 100
FIGURES = ("Residuals before the post-filter", "Residuals after the post-filter", "Event instants and intervals", "Residuals with their thresholds")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from hullguard.cli import main

    out = tmp_path_factory.mktemp("published")
    assert main(["run", "platoon", "--scenario", "published", "--bus", "inprocess", "--out", str(out), "-q"]) == 0
    return out


@pytest.fixture(scope="module")
def run(folder: Path) -> Run:
    return read_run(folder)


def test_the_settings_are_the_publications(models: Models) -> None:
    made = models.design(scenario="published")
    g, trigger = made.generators[0], made.model.groups[0].trigger
    assert g.zonotope is not None
    assert (g.zonotope.reduction, g.zonotope.columns) == (TRUNCATE, 12)
    assert (g.spec.order, g.observer.W.shape[0], g.spec.aware, g.spec.chosen) == (4, 2, False, True)
    assert g.spec.order < made.model.plant.n
    assert set(trigger.silence) == {1}
    assert trigger.interval_max == 5
    assert len(trigger.silence) > 1, "adaptive: more than one level"
    assert np.allclose(np.sort(np.linalg.eigvals(g.observer.G).real), [0.2, 0.3, 0.4, 0.5])
    assert made.model.scenario("published").samples == SAMPLES


def test_no_search_is_made(models: Models, monkeypatch: pytest.MonkeyPatch) -> None:
    from hullguard.design.design import design

    made, ticks = [], []
    began = time.process_time()
    made.append(design(load_model("platoon", None, "published"), tick=lambda *_: ticks.append(1))[0])
    assert time.process_time() - began < 5.0
    assert len(ticks) <= 1
    assert made[0].tables.hash == models.design(scenario="published").tables.hash


def test_intervals_lie_between_2_and_5(run: Run) -> None:
    group = next(g for g in run.groups if g.name == "measurement")
    steps = np.diff(run.k[group.event > 0])
    assert len(run.k) == SAMPLES
    assert steps.min() == 2
    assert steps.max() == 5
    assert set(np.unique(steps)) >= {2, 3, 5}, "an adaptive trigger shows more than its two ends"


def test_the_fault_shows_in_r2_and_hardly_in_r1(run: Run) -> None:
    r1, r2 = run.residuals
    after = run.k >= START + 25
    before = (run.k >= START - 25) & (run.k < START)
    assert np.abs(r2.r[after]).mean() > 10 * np.abs(r1.r[after]).mean()
    assert np.abs(r2.r[after]).mean() > 20 * np.abs(r2.r[before]).mean()
    assert r2.ratio[after].max() > 1.5
    assert r1.ratio.max() < 1.0
    assert run.faults[0].detected is not None
    assert run.faults[0].detected - START <= 15
    assert run.info["false_alarms"] == {"provisional": 0, "confirmed": 0}


def test_in_many_runs_the_truncated_threshold_is_not_passed_though_it_is_no_bound(models: Models) -> None:
    """In 2000 runs |r|/J was at most 0.991 at the start and 0.71 after it, R1 never left its threshold, and every fault was found after 2 .. 10 samples."""
    ready = models.platoon("published")
    batch = ready.batch(SAMPLES, ("controller2:bias:3.0@50",))
    rows = batch.runs(0, 200)
    assert alarms(rows) == Alarms(0, 0)
    assert max(r["margin"] for r in rows) < 1.0
    assert max(r["margin_settled"] for r in rows) < 0.9
    assert all(START <= r["confirmed_at"] <= START + 15 for r in rows)
    exact = models.platoon("published", {"detector.threshold": "exact"}).batch(SAMPLES, ("controller2:bias:3.0@50",))
    shares = []
    for i in range(5):
        found, bound = batch.trace(i), exact.trace(i)
        assert np.all(np.abs(found["r"][:, 0]) <= found["J"][:, 0])
        shares.append(found["J"] / bound["J"])
    # What a healthy plant can show is the exact hull; the truncated set stays below it, by a third at times.
    assert np.max(shares) < 1.0 + 1e-5
    assert np.min(shares) < 0.8


def test_the_report_promises_nothing_that_the_truncated_threshold_cannot_keep(folder: Path) -> None:
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert "Not guaranteed here: that there is no false alarm" in text
    assert "Guaranteed:" not in text
    assert "largest value a healthy plant can show" not in text


def test_the_report_begins_with_the_publications_four_figures(folder: Path) -> None:
    text = (folder / "report.html").read_text(encoding="utf-8")
    places = [text.index(f'aria-label="{f}"') for f in FIGURES]
    assert places == sorted(places)
    assert places[-1] < text.index("<h2>Residuals and thresholds</h2>")
    for what in ("R1", "R2", "time (s)", "interval (samples)", "r, dimensionless"):
        assert what in text


def test_other_scenarios_keep_their_report(cli: Cli, tmp_path: Path) -> None:
    assert cli("run", "platoon", "--bus", "inprocess", "--samples", 60, "--no-fault", "--out", tmp_path, "-q").status == 0
    assert "publication" not in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert read_run(tmp_path).before == ()


def test_the_figures_are_there_with_prediction_too(cli: Cli, tmp_path: Path) -> None:
    options = ("--set", "detector.prediction=true", "--bus", "inprocess", "--out", tmp_path, "-q")
    assert cli("run", "platoon", "--scenario", "published", *options).status == 0
    assert len(read_run(tmp_path).before) == 2


def test_a_run_that_lost_its_residuals_before_the_filter_is_refused(folder: Path, tmp_path: Path) -> None:
    for name in ("run.json", "labels.csv", "signals.csv"):
        (tmp_path / name).write_text((folder / name).read_text(encoding="utf-8").replace("before1.2", "elsewhere"), encoding="utf-8")
    with pytest.raises(InputError, match=r"before1\.2"):
        read_run(tmp_path)


# ---- observer and post-filter as two systems ----


@pytest.mark.parametrize("real", FLOATS)
@pytest.mark.parametrize("scenario", ["published", "rest"])
def test_two_systems_in_series_give_the_fused_residual(models: Models, real: str, scenario: str) -> None:
    ready = models.platoon(scenario, None, real)
    trace = ready.batch(SAMPLES, ("controller2:bias:3.0@50",)).trace()
    signal = list(ready.native.tables.generators[0].signal)
    r0, r = Pair(library(real), ready.design.generators[0]).run(trace["value"][:, signal])
    scale = np.abs(trace["r"]).max()
    assert scale > 1.0
    # Both sides hold float32 coefficients: what they differ by is rounding, in float64 only that of the fused tables.
    assert np.abs(r - trace["r"]).max() <= 2e-4 * scale
    assert np.abs(r0 - r).max() > 0.1 * scale


def test_before_the_filter_r0_is_the_observers(models: Models) -> None:
    """z(k+1) = G z + H u + L y, r0 = V y - W z - Qu u, here in numpy."""
    ready = models.platoon("published", None, "f64")
    g = ready.design.generators[0]
    values = ready.batch(SAMPLES, ("controller2:bias:3.0@50",)).trace()["value"][:, list(ready.native.tables.generators[0].signal)]
    r0, _ = Pair(library("f64"), g).run(values)
    z, o = np.zeros(4), g.observer
    for k, v in enumerate(values):
        y, u = v[:3], v[3:]
        assert np.abs(r0[k] - (o.V @ y - o.W @ z - o.Qu @ u)).max() <= 1e-12
        z = o.G @ z + o.H @ u + o.L @ y


def test_a_value_that_is_not_finite_is_refused(models: Models) -> None:
    pair = Pair(library("f64"), models.design(scenario="published").generators[0])
    with pytest.raises(InputError, match="finite"):
        pair.step(np.array([0.0, np.nan, 0.0, 0.0, 0.0, 0.0]))
