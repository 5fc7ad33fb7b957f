"""What people see of banks: columns and names of a run, the timeline of candidate faults, the design report, and what a detector costs."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hullguard.core.library import library
from hullguard.core.native import Native, Node
from hullguard.design.bank import evaluate
from hullguard.design.bank_facts import BankFacts, bank_facts
from hullguard.design.cost import BYTES, costs
from hullguard.design.design import Design
from hullguard.design.isolation import isolability
from hullguard.design.judges import BANK, HYPOTHESIS, OBSERVER, Judge, judges, residual_columns, residual_names
from hullguard.design.window import fault_response, window_form
from hullguard.report import run_figures as draw
from hullguard.report.design_banks import as_json
from hullguard.report.design_report import write_design_report
from hullguard.report.live import LiveTable, may_be
from hullguard.report.run_data import Run, read_run
from hullguard.report.run_report import write_run_report
from host_support import Cli, Models
from rich.console import Console
from test_report import check_html, make_run

FAULTS = ("gap23_sensor:bias:0.4@100..130", "controller1:bias:1.5@200..230")
SAMPLES = 260


@pytest.fixture(scope="module")
def made(models: Models) -> Design:
    return models.design(scenario="default", name="platoon_bank")


@pytest.fixture(scope="module")
def facts(made: Design) -> list[BankFacts]:
    return bank_facts(made)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from hullguard.cli import main

    out = tmp_path_factory.mktemp("banks")
    faults = [x for f in FAULTS for x in ("--fault", f)]
    assert main(["run", "platoon_bank", "--bus", "inprocess", "--samples", str(SAMPLES), *faults, "--out", str(out), "-q"]) == 0
    return out


@pytest.fixture(scope="module")
def run(folder: Path) -> Run:
    return read_run(folder)


# ---- names ----


def test_judges_are_named_in_the_order_of_the_decision(made: Design) -> None:
    every = judges(made)
    assert [j.name for j in every] == made.judges
    assert [j.kind for j in every] == [OBSERVER, BANK] + [HYPOTHESIS] * 6
    assert sum(j.residuals for j in every) == made.tables.residuals
    assert [j.name for j in every[2:]] == [f"not {f.name}" for f in made.model.faults]


def test_residuals_are_named_after_their_judge() -> None:
    every = [Judge("observer 1", OBSERVER, 2), Judge("observer 2", OBSERVER, 1), Judge("bank of 4", BANK, 1)]
    assert residual_columns(every) == ["1.1", "1.2", "2.1", "3.1"]
    assert residual_names(every) == ["observer 1, r1", "observer 1, r2", "observer 2", "bank of 4"]


# ---- a run ----


def test_every_residual_of_a_run_has_its_column(made: Design, run: Run) -> None:
    assert [r.name for r in run.residuals] == residual_names(judges(made))
    assert (len(run.observing), len(run.detecting), len(run.isolating)) == (2, 3, 6)
    before = run.k < 100
    assert max(r.ratio[before].max() for r in run.residuals) == pytest.approx(run.info["margin_max"], rel=1e-6)
    # The bank's column is that of the certificate with the largest |r| / J, recomputed here in double precision from the held values.
    value, radius = (np.array([getattr(s, what) for s in run.signals]).T for what in ("value", "radius"))
    table = made.tables.banks[0]
    r, J = evaluate(table, value, radius)
    assert np.allclose((np.abs(r) / J).max(1), run.residuals[2].ratio[table.window - 1 :], rtol=1e-3, atol=1e-4)


def test_a_hypothesis_that_is_true_stays_below_its_threshold(run: Run) -> None:
    for f in run.faults:
        own = next(r for r in run.isolating if r.name == f"not {f.name}")
        others = [r for r in run.isolating if r is not own]
        during = (run.k >= f.start) & (run.k < (f.end or SAMPLES))
        assert own.ratio[during].max() <= 1.0
        assert max(r.ratio[during].max() for r in others) > 1.0


def test_candidates_are_told_over_time(run: Run) -> None:
    state = draw.candidates(run)
    gap, controller = run.faults
    assert gap.detected is not None and controller.detected is not None
    alarmed = run.plant >= 2
    for f in (gap, controller):
        during = alarmed & (run.k >= f.start) & (run.k < (f.end or SAMPLES))
        assert during.any()
        assert np.array_equal(state[f.name][during], run.plant[during])
    assert not any(values[~alarmed].any() for values in state.values())
    # No detector tells these two from one another: design report, isolability.
    assert set(gap.candidates) == {"gap23_sensor", "controller3"} and gap.narrowed_to == gap.candidates
    assert controller.narrowed_to == ("controller1",)
    assert controller.narrowed_at is not None and controller.narrowed_at >= controller.detected


def test_a_fault_given_by_its_signal_is_the_models(cli: Cli, tmp_path: Path) -> None:
    arguments = ("run", "platoon", "--bus", "inprocess", "--samples", 20, "--fault", "gap12_m:bias:1@5", "--fault", "control1_mps2:bias:1@8", "--out", tmp_path, "-q")
    assert cli(*arguments).status == 0
    assert [f.fault for f in read_run(tmp_path).faults] == ["gap12_sensor", "controller1"]


def test_the_report_needs_no_model_and_shows_panels_map_and_timeline(cli: Cli, folder: Path) -> None:
    (folder / "report.html").unlink()
    assert cli("report", folder, "-q").status == 0
    text, seen = check_html(folder / "report.html")
    assert seen.counts["svg"] == 7
    for expected in ("bank of 16: |r|", "observer 1, r2", "not controller1", "not speed1_sensor", "candidate, confirmed", "The 6 banks of the hypotheses", "Guaranteed:"):
        assert expected in text
    named = json.loads((folder / "run.json").read_text())["faults"][1]
    assert f"; from k = {named['narrowed_at']} controller1" in text
    # The hypotheses have rows of a map, not a panel each.
    assert [r.kind for r in draw.chosen_residuals(read_run(folder))[0]].count(OBSERVER) == 2
    assert {r.kind for r in draw.chosen_residuals(read_run(folder))[0]} == {OBSERVER, BANK}


def test_alarms_that_no_fault_explains_have_a_row(tmp_path: Path) -> None:
    make_run(tmp_path)
    path = tmp_path / "run.json"
    data = json.loads(path.read_text())
    for v in data["verdicts"]:
        v["candidates"] = []
    path.write_text(json.dumps(data))
    run = read_run(tmp_path)
    state = draw.candidates(run)
    assert np.array_equal(state[draw.NO_SINGLE], np.where(run.plant >= 2, run.plant, 0))
    assert draw.NO_SINGLE in check_html(write_run_report(tmp_path))[0]


def test_a_model_without_faults_has_no_candidates(tmp_path: Path) -> None:
    make_run(tmp_path)
    path = tmp_path / "run.json"
    data = json.loads(path.read_text())
    data["known_faults"] = []
    path.write_text(json.dumps(data))
    assert "Which fault it may be" not in check_html(write_run_report(tmp_path))[0]


# ---- live, detect ----


def test_what_an_alarm_says_of_its_cause() -> None:
    assert may_be("none", ["a"], True) == may_be("confirmed", [], False) == ""
    assert may_be("provisional", ["a", "b"], True) == ", may be a, b"
    assert may_be("confirmed", [], True) == ", no single fault explains it"


def test_the_live_table_names_judges_and_candidates(made: Design) -> None:
    out = io.StringIO()
    with LiveTable(made, 10, Console(file=out, force_terminal=True, width=120, height=50, color_system="standard")) as table:
        table.update(9, [0.0] * 6, [0.1] * 6, [0.1] * 2 + [1.5] + [1.2] * 6, "confirmed", {"measurement": "good", "control": "good"}, 3, ["controller2"])
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", out.getvalue())
    for expected in ("observer 1, r1", "bank of 16", "not gap23_sensor", "may be controller2"):
        assert expected in text


def test_detect_tells_when_candidates_change(cli: Cli, folder: Path) -> None:
    found = cli("detect", "platoon_bank", "--log", folder / "run.log", "--rest", "--json").json
    assert found["verdicts"] == json.loads((folder / "run.json").read_text())["verdicts"]
    told = [v["candidates"] for v in found["verdicts"] if v["plant"] == "confirmed"]
    assert ["controller1"] in told and len(told) > 2


# ---- design ----


def test_what_a_bank_sees_is_what_a_simulated_fault_does_to_it(made: Design, facts: list[BankFacts]) -> None:
    """A constant fault of exactly the smallest size, alone on a plant at rest without disturbances, reaches the threshold in the last sample of the horizon at the latest."""
    model, f = made.model, facts[0]
    usual = np.tile(made.usual[: len(model.signals)], (2 * f.table.window, 1))
    for place, number in enumerate(f.faults):
        fault, form = model.faults[number], window_form(model.plant, 2 * f.table.window)
        start = f.table.window
        course = (np.arange(2 * f.table.window) >= start).astype(float)
        value = np.zeros_like(usual)
        value[:, model.outputs] = (fault_response(model, form, fault) @ course).reshape(-1, model.plant.m)
        r, J = evaluate(f.table, value, usual)
        ratio = (np.abs(r) / J).max(1)[start - f.table.window + 1 :]  # from the first faulty sample on
        for n, within in enumerate(f.within):
            assert f.smallest[place, n] == pytest.approx(1.0 / ratio[: within + 1].max(), rel=1e-4)


def test_no_bank_beats_what_any_detector_can(made: Design, facts: list[BankFacts]) -> None:
    pairs = {(p.truth, p.hypothesis): p for p in isolability(made.model, 30, tuple(range(6)))}
    for f in facts[1:]:
        assert f.stored.hypothesis is not None and f.within[0] == 10
        for place, truth in enumerate(f.faults):
            least = pairs[truth, f.stored.hypothesis].smallest
            assert least is not None and f.smallest[place, 0] >= 0.999 * least


def test_costs_are_those_of_the_library_and_of_the_tables(made: Design, models: Models) -> None:
    for design in (made, models.design({"detector.prediction": True, "detector.threshold": "zonotope"})):
        every, native = costs(design), Native(library("f32"), design.tables)
        lib, config = native.library.lib, native.node.detector
        assert sum(c.numbers for c in every) == lib.hg_detector_reals(config) + lib.hg_detector_sums(config)
        assert all(c.flash_bytes == BYTES * c.coefficients for c in every)
        Node(native, 1)
    bank = next(c for c in costs(made) if c.name == "bank of 16")
    assert (bank.multiplications, bank.coefficients) == (16 * 30 * 2 * 6, 16 * 30 * 6 + 16 + 1)


def test_the_design_report_shows_banks_isolability_and_cost(made: Design, facts: list[BankFacts], tmp_path: Path) -> None:
    pairs = isolability(made.model, 30, (2, 4))
    write_design_report(made, tmp_path / "d.html", pairs)
    text, _ = check_html(tmp_path / "d.html")
    wish = made.model.detector.bank
    assert wish is not None
    runs = wish.runs * len(wish.sizes) * len(wish.faults) * 2 * 2  # both signs, at rest and under manoeuvres
    for expected in ("Banks of certificates", "a bank of 16 certificates, 6 banks for isolation", "not gap12_sensor", f"{runs} runs", "Cost on the ECU", "never"):
        assert expected in text
    assert "gap23_sensor from controller3: whatever gap23_sensor does" in text
    assert f"{facts[0].smallest[1, 0]:.3g}" in text
    write_design_report(made, tmp_path / "without.html")
    assert "Which faults can be told apart" not in check_html(tmp_path / "without.html")[0]


OPTIONS: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "prediction": ({"detector.prediction": True}, ("Prediction between frames", "predicted")),
    "zonotope": ({"detector.threshold": "zonotope"}, ("Zonotope thresholds", "covered")),
    "published": ({"detector.threshold": "zonotope_published"}, ("no outer bound", "dropped")),
    "uncertain": ({"plant.drag_per_s": {"value": 1.0, "pm": 0.1}}, ("Uncertain parameters", "uncertain gap12_m", "|control1_mps2|")),
}


@pytest.mark.parametrize("option", OPTIONS)
def test_the_design_report_says_what_an_option_changed(models: Models, tmp_path: Path, option: str) -> None:
    overrides, words = OPTIONS[option]
    write_design_report(models.design(overrides), tmp_path / "d.html")
    text, _ = check_html(tmp_path / "d.html")
    for word in words:
        assert word in text
    write_design_report(models.design(), tmp_path / "plain.html")
    assert "What the radii and thresholds rest on" not in check_html(tmp_path / "plain.html")[0]


def test_json_tells_the_same(made: Design, facts: list[BankFacts]) -> None:
    found = json.loads(json.dumps(as_json(made, [])))
    assert found["isolability"] is None
    assert [b["name"] for b in found["banks"]] == [f.name for f in facts] == made.judges[1:]
    assert found["banks"][0]["smallest_fault_within"]["10"]["controller2"] == pytest.approx(facts[0].smallest[1, 0])
    assert found["banks"][1]["hypothesis"] == "controller1"
    assert sum(c["ram_bytes"] for c in found["cost"]) == BYTES * (made.tables.reals + made.tables.sums)


def test_isolability_is_looked_into_on_demand(cli: Cli, tmp_path: Path) -> None:
    plain = ("design", "platoon", "--set", "detector.observers.0.search.trials=5", "--set", "plant.vehicles=2", "--out", tmp_path, "--json")
    assert cli(*plain).json["isolability"] is None
    pairs = cli(*plain, "--isolability").json["isolability"]
    assert {(p["fault"], p["hypothesis"]) for p in pairs} >= {("controller1", "controller2"), ("controller2", "controller1")}
    assert "Which faults can be told apart" in check_html(tmp_path / "platoon.html")[0]


# ---- campaign ----


def test_a_campaign_promises_nothing_for_truncated_thresholds(cli: Cli, tmp_path: Path) -> None:
    options = ("campaign", "platoon", "--scenario", "published", "--samples", 40, "--runs", 2, "--no-fault", "--workers", 1, "-q", "--out")
    assert cli(*options, tmp_path / "a").status == 0
    text, _ = check_html(tmp_path / "a" / "campaign.html")
    assert "Not guaranteed here" in text and "No false alarm is confirmed" not in text
    assert cli(*options, tmp_path / "b", "--vary", "detector.threshold=exact,zonotope_published").status == 0
    text, _ = check_html(tmp_path / "b" / "campaign.html")
    assert "In the cases with the threshold zonotope_published: not guaranteed here" in text and "No false alarm is confirmed" in text
