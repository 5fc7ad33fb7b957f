"""`hullguard identify`: bounds that nobody told it, from recordings of a plant that keeps within them; where data contradict a model; a model that works as it is."""

from __future__ import annotations

import csv
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from host_support import SEED, Cli, Models, Result
from test_bad_input import refused

from hullguard.core.library import library
from hullguard.core.native import Batch, Native
from hullguard.errors import InputError
from hullguard.identify import bounds, records, tradeoff
from hullguard.identify.moments import disagreement, shares
from hullguard.identify.programme import Window
from hullguard.identify.records import Record
from hullguard.identify.structure import Structure, structure
from hullguard.identify.write import rounded_up
from hullguard.model import load_model
from hullguard.model.schema import SHIPPED, Model
from hullguard.model.table import Array

HIDDEN = {"state": 0.02, "output": 0.012}
SAMPLES = 1400
NEAR = 0.2


def quiet(*_: object) -> None:
    """No progress."""


@pytest.fixture(scope="module")
def drive(models: Models) -> tuple[Model, Array]:
    """A platoon whose disturbances are other than the shipped model says, and its readings."""
    made = models.design({"plant.disturbance": HIDDEN}, "manoeuvres")
    batch = Batch(Native(library("f32"), made.tables), made, SAMPLES, made.model.scenario("manoeuvres").reference, seed=SEED)
    return made.model, np.asarray(batch.trace()["reading"])


def write_csv(path: Path, model: Model, series: Array) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time_s", *(s.name for s in model.signals)])
        writer.writerows([f"{k * model.sample_time_s:.3f}", *(f"{x:.9g}" for x in row)] for k, row in enumerate(series))
    return path


@pytest.fixture
def given(tmp_path: Path) -> Path:
    """The shipped platoon with a short search: the bounds in it are not those of the drive."""
    path = tmp_path / "mine.toml"
    path.write_text((SHIPPED / "platoon.toml").read_text(encoding="utf-8").replace("trials = 3000", "trials = 40"), encoding="utf-8")
    return path


def record(model: Model, series: Array) -> Record:
    return Record("drive.csv", 2, series, series[:, model.outputs], series[:, model.inputs])


def platoon(model: Model, disturbance: Any = None) -> Structure:
    data = tomllib.loads((SHIPPED / "platoon.toml").read_text(encoding="utf-8"))
    data["plant"]["disturbance"] = data["plant"]["disturbance"] if disturbance is None else disturbance
    return structure(model, data)


def test_hidden_bounds_are_found_and_the_model_works_as_it_is(cli: Cli, tmp_path: Path, given: Path, drive: tuple[Model, Array]) -> None:
    model, series = drive
    whole = write_csv(tmp_path / "drive.csv", model, series)
    found = cli("identify", given, "--csv", whole, "--out", tmp_path / "out", "--json")
    assert found.status == 0, found.err
    result = found.json
    for bound, hidden in zip(result["bounds"], HIDDEN.values(), strict=True):
        assert abs(bound["smallest"] / hidden - 1) <= NEAR, bound
        assert abs(bound["written"] / hidden - 1) <= NEAR, bound
    assert result["hold_out"]["factor"] <= 1.0
    assert result["hold_out"]["false_alarms"] == {"provisional": 0, "confirmed": 0}
    assert sum(result["threshold_shares"].values()) == pytest.approx(1.0, abs=0.02)
    assert not result["contradictions"] and not any(result["lags"].values())
    made = tmp_path / "out" / "mine.toml"
    text = made.read_text(encoding="utf-8")
    assert "given 0.01" in text and "# Vehicles behind one another" in text
    assert load_model(str(made)).plant.Ed.max() == result["bounds"][0]["written"]
    assert cli("design", made, "--out", tmp_path / "design", "-q").status == 0
    rest = write_csv(tmp_path / "rest.csv", model, series[SAMPLES // 2 :])
    assert cli("replay", made, "--csv", rest, "--bus", "inprocess", "-q", "--expect", "quiet").status == 0
    page = (tmp_path / "out" / "identify.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 2 and "http" not in page


def test_triggers_are_chosen_for_a_wish(cli: Cli, tmp_path: Path, given: Path, drive: tuple[Model, Array]) -> None:
    model, series = drive
    path = write_csv(tmp_path / "drive.csv", model, series[:400])
    options = ("identify", given, "--csv", path, "--out", tmp_path / "out", "--json", "--force", "--hold-out", 0)
    least = cli(*options, "--bus-load", 0.3).json
    assert 0.28 <= least["fitted"]["frames"] <= 0.3
    sigma = float(load_model(str(tmp_path / "out" / "mine.toml")).groups[0].trigger.sigma[0, 0])
    assert sigma == pytest.approx(0.05 * least["chosen"], rel=0.01)
    sizes = [p["smallest_fault"]["controller1"] for p in least["trade_off"]]
    frames = [p["frames"] for p in least["trade_off"]]
    assert frames == sorted(frames, reverse=True) and sizes[-1] > sizes[0]
    line = refused(cli(*options, "--bus-load", 0.05), 2, "--bus-load 0.05", "interval_max")
    assert "0.2" in line


def test_the_widest_triggers_that_show_a_fault_are_searched_for(monkeypatch: pytest.MonkeyPatch, models: Models) -> None:
    """With a curve known in closed form: frames 1 / (1 + scale), smallest fault 0.3 + scale."""
    made = models.design()

    def point(model: Model, stored: object, parts: object, scale: float) -> tradeoff.Point:
        return tradeoff.Point(scale, tradeoff.Drive(1 / (1 + scale), 0, 0, 0.5), {"f": 0.3 + scale}, made)

    monkeypatch.setattr(tradeoff, "point", point)
    curve = tradeoff.Curve(made.model, made.stored, [], quiet)
    fine = tradeoff.chosen(curve, made.model, None, ("f", 1.7))
    assert fine is not None and 1.4 / 1.03 <= fine.scale <= 1.4
    few = tradeoff.chosen(curve, made.model, 0.4, None)
    assert few is not None and 1.5 <= few.scale <= 1.5 * 1.03
    # Narrower than any width that a curve begins with, where the wish asks for it.
    often = tradeoff.chosen(curve, made.model, 0.9, None)
    assert often is not None and 1 / 9 <= often.scale <= 1.03**2 / 9
    small = tradeoff.chosen(curve, made.model, None, ("f", 0.4))
    assert small is not None and 0.1 / 1.03**2 <= small.scale <= 0.1
    assert tradeoff.chosen(curve, made.model, None, None) is None
    for load, fault, word in ((0.1, None, "--bus-load 0.1"), (None, ("f", 0.3), "--smallest-fault f:0.3")):
        with pytest.raises(InputError, match=word):
            tradeoff.chosen(curve, made.model, load, fault)
    closed = replace(made.model, groups=tuple(g for g in made.model.groups if g.closing))
    with pytest.raises(InputError, match="no trigger to choose"):
        tradeoff.chosen(tradeoff.Curve(closed, made.stored, [], quiet), closed, 0.5, None)


def test_a_row_that_contradicts_the_model_is_named(drive: tuple[Model, Array]) -> None:
    model, series = drive
    hit = series[:400].copy()
    row = int(np.random.default_rng(SEED).integers(60, 340))
    hit[row, model.signal("gap12_m")] += 1.0
    found = platoon(model)
    one = [record(model, hit)]
    fit = bounds.fit(found, one, shares(found, one).sigma, None, 40, quiet)
    assert fit.contradictions
    assert all(abs(c.sample - row) <= 1 for c in fit.contradictions)
    assert fit.contradictions[0].line == fit.contradictions[0].sample + 2
    clean = [record(model, series[:400])]
    assert not bounds.fit(found, clean, shares(found, clean).sigma, None, 40, quiet).contradictions


def test_every_window_is_explained_and_no_smaller_bounds_of_that_kind_do(drive: tuple[Model, Array]) -> None:
    model, series = drive
    found, parts = platoon(model), [record(model, series[:200])]
    sigma = shares(found, parts).sigma
    nothing = np.zeros(2)
    for weight in (None, np.array([1.0, 3.0])):
        fit = bounds.fit(found, parts, sigma, weight, 40, quiet)
        whole = Window(found, 200)
        # The whole record at once needs no more than its windows.
        assert whole.solve(parts[0].y, parts[0].u, nothing, fit.bound).t <= 1.02
        for smaller in (fit.bound * 0.97, *(fit.bound * (1 - 0.05 * unit) for unit in np.eye(2) if weight is not None and unit @ fit.bound > 0)):
            needed = max(n.factor for n, _ in bounds.needs(bounds.Task.of(found, parts, 160), smaller, "", quiet))
            assert needed > 1.0


def test_weights_decide_what_is_noise(drive: tuple[Model, Array]) -> None:
    model, series = drive
    found, parts = platoon(model), [record(model, series[:200])]
    sigma = shares(found, parts).sigma
    cheap, dear = (bounds.fit(found, parts, sigma, np.array([1.0, w]), 40, quiet).bound for w in (0.1, 30.0))
    assert cheap[1] > dear[1] and cheap[0] < dear[0]


def test_bounds_that_the_model_writes_apart_are_found_apart(drive: tuple[Model, Array]) -> None:
    model, series = drive
    found = platoon(model, {"state": {"speed": 0.01, "gap": 0.01}})
    assert [p.name for p in found.parameters] == ["disturbance of speed", "disturbance of gap", "noise of gap{i}{j}_m", "noise of speed1_mps"]
    sigma = shares(found, [record(model, series)]).sigma * np.sqrt(3)
    assert np.allclose(sigma, [0.02, 0.02, 0.012, 0.012], rtol=0.3)
    still = platoon(model, {"state": [0.01, 0.0, 0.01, 0.0, 0.01]})
    assert [p.name for p in still.parameters if p.where == "state"] == [f"disturbance of speed{i}_mps" for i in (1, 2, 3)]


@pytest.mark.parametrize("late", ["gap23_m", "speed1_mps"])
def test_a_lag_is_found_and_taken_out(drive: tuple[Model, Array], late: str) -> None:
    model, series = drive
    place, wanted = model.signal(late), 2
    moved = series.copy()
    moved[wanted:, place] = series[:-wanted, place]
    found = records.lags(model, [moved[wanted:]], 3, lambda parts: disagreement(model.plant, parts))
    assert [i for i, x in enumerate(found) if x] == [place] and found[place] == wanted
    again = records.aligned(model, moved[wanted:], [wanted - x for x in found])
    assert np.array_equal(again, series[wanted : SAMPLES - wanted])


def test_a_lag_goes_into_the_model(cli: Cli, tmp_path: Path, given: Path, drive: tuple[Model, Array]) -> None:
    model, series = drive
    place = model.signal("speed1_mps")
    moved = series[:500].copy()
    moved[1:, place] = series[:499, place]
    path = write_csv(tmp_path / "drive.csv", model, moved[1:])
    result = cli("identify", given, "--csv", path, "--out", tmp_path / "out", "--json", "--hold-out", 0).json
    assert result["lags"] == {s.name: int(s.name == "speed1_mps") for s in model.signals}
    made = load_model(str(tmp_path / "out" / "mine.toml"))
    assert {s.name: s.csv_delay for s in made.signals} == {s.name: int(s.name != "speed1_mps") for s in model.signals}


def test_the_held_out_part_can_fail(cli: Cli, tmp_path: Path, given: Path, drive: tuple[Model, Array]) -> None:
    model, series = drive
    worse = series[:600].copy()
    worse[500:, model.signal("gap12_m")] += 0.3 * (-1.0) ** np.arange(100)
    path = write_csv(tmp_path / "drive.csv", model, worse)
    found = cli("identify", given, "--csv", path, "--out", tmp_path / "out")
    refused(Result(found.status, "", found.err), 1, "drive.csv:", "--margin")


def test_wrong_input_is_one_line(cli: Cli, tmp_path: Path, given: Path, drive: tuple[Model, Array]) -> None:
    model, series = drive
    path = write_csv(tmp_path / "drive.csv", model, series[:150])
    out = ("--out", tmp_path / "out")
    refused(cli("identify", given, "--csv", path, *out), 2, "drive.csv", "--hold-out 0")
    refused(cli("identify", given, "--csv", tmp_path / "none.csv", *out), 2, "none.csv")
    refused(cli("identify", "suspension", "--csv", path, *out), 2, "column")
    for option, word in ((("--smallest-fault", "nothing:1"), "controller1"), (("--smallest-fault", "controller1:0"), "above 0"), (("--weight", "a=1"), "--split detection")):
        refused(cli("identify", given, "--csv", path, *out, "--hold-out", 0, *option), 2, word)
    for option in (("--hold-out", "1"), ("--bus-load", "0"), ("--window", "2"), ("--lag-max", "x"), ("--margin", "-1")):
        refused(cli("identify", given, "--csv", path, *option), 2, option[0])
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.toml").write_text("mine")
    refused(cli("identify", given, "--csv", path, *out, "--hold-out", 0), 2, "--force")
    assert (tmp_path / "out" / "mine.toml").read_text() == "mine"


@pytest.mark.parametrize(("value", "wanted"), [(0.0, 0.0), (0.0123, 0.0123), (0.01231, 0.0124), (9.991, 10.0), (1234.0, 1240.0)])
def test_bounds_are_rounded_up(value: float, wanted: float) -> None:
    assert rounded_up(value) == pytest.approx(wanted, rel=1e-12) and rounded_up(value) >= value


def test_a_sensor_that_is_wired_the_wrong_way_round_is_doubted(cli: Cli, tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    made = cli("new", "own", "--A", "0.8 0.2; -0.1 0.7", "--B", "0; 1", "--C", "1 0; 0 1", "--discrete", "--sample-time", 1, "--out", path, "-q")
    assert made.status == 0, made.err
    model, rng = load_model(str(path)), np.random.default_rng(SEED)
    rows, x = [], np.zeros(2)
    for u in np.repeat(rng.uniform(-1.0, 1.0, 30), 5):
        rows.append([*(x + 0.01 * rng.uniform(-1.0, 1.0, 2)), u])
        x = model.plant.A @ x + model.plant.B[:, 0] * u
    found = []
    for name, sign in (("right", 1.0), ("wrong", -1.0)):
        recording = write_csv(tmp_path / f"{name}.csv", model, np.array(rows) * [1.0, sign, 1.0])
        done = cli("identify", path, "--csv", recording, "--out", tmp_path / name, "--hold-out", 0, "--lag-max", 0, "--json")
        found.append(list(done.json["doubted"]))
    assert found[0] == [] and found[1] == ["y2"]
