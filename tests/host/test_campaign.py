"""Campaigns: a grid is its cases one by one, however the work is spread and however often it is interrupted; attacked runs come closer to the threshold
than random ones, and never pass it.
"""

from __future__ import annotations

import contextlib
import csv
import itertools
import json
import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.stats
from host_support import SEED, SILENT_1, Cli, Models, Ready
from hullguard.campaign import attack, cluster, grid
from hullguard.campaign.attack import Attack
from hullguard.campaign.campaign import Task, campaign, processes, serial, tasks_of
from hullguard.campaign.case import COLUMNS, Case, Rows, chunk, setup_of
from hullguard.campaign.chunks import Chunks
from hullguard.campaign.summary import summary, upper_bound
from hullguard.core.library import library
from hullguard.core.native import Native
from hullguard.design import store
from hullguard.design.design import finish
from hullguard.errors import InputError
from hullguard.model import parse_fault
from hullguard.model.schema import SHIPPED

FAULT = "controller2:bias:1@40"
ADAPTIVE = {"groups.measurement.trigger.silence": [0, 1], "groups.measurement.trigger.delta": [0.02, 0.05], "groups.measurement.trigger.levels": 4}


def case_of(models: Models, overrides: dict[str, Any] | None = None, faults: Sequence[str] = (), real: str = "f32", **changes: Any) -> Case:
    made = models.design(overrides, "manoeuvres")
    reference = made.model.scenario("manoeuvres").reference
    return Case(setup_of(made, real), changes.pop("samples", 100), reference, tuple(parse_fault(f) for f in faults), SEED, **changes)


def same(a: Sequence[Rows], b: Sequence[Rows]) -> bool:
    return len(a) == len(b) and all(list(x) == list(y) == list(COLUMNS) and all(np.array_equal(x[n], y[n]) for n in COLUMNS) for x, y in zip(a, b, strict=True))


def files(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in sorted(folder.iterdir()) if p.is_file()}


# ---- the grid ----

GRID = ("--vary", "groups.measurement.trigger.silence=0,1", "--loss", "0,0.2", "--size", "0.5,1,2", "--each-fault", "--fault", FAULT, "--fault", "gap12_m:bias:3@50")
FEW = ("campaign", "platoon", "--scenario", "manoeuvres", "--samples", "80", "--workers", "1", "--json", "-q", "--seed", "7")


def test_a_grid_has_a_case_for_every_combination_and_each_is_the_campaign_of_its_own(cli: Cli) -> None:
    found = cli(*FEW, "--runs", 4, *GRID).json
    cases = found["cases"]
    silences = [c["groups.measurement.trigger.silence"] for c in cases]
    spans = itertools.product((0, 1), ("controller2:bias:0.5@40", "controller2:bias:1@40", "controller2:bias:2@40", "gap12_m:bias:0.5@50", "gap12_m:bias:1@50", "gap12_m:bias:2@50"), (0.0, 0.2))
    assert list(zip(silences, [c["fault"] for c in cases], [c["loss"] for c in cases], strict=True)) == list(spans)
    assert (found["runs"], len(found["rows"])) == (4 * 24, 4 * 24)
    assert len({c["name"] for c in cases}) == 24
    for c in (cases[5], cases[22]):
        one = ("--set", f"groups.measurement.trigger.silence={c['groups.measurement.trigger.silence']}", "--loss", c["loss"], "--fault", c["fault"])
        alone = cli(*FEW, "--runs", 4, *one).json
        assert alone["rows"] == [{k: v for k, v in r.items() if k != "case"} for r in found["rows"] if r["case"] == c["case"]]
        assert alone["model_hash"] == c["model_hash"]
        assert all(alone[k] == c[k] for k in ("runs", "detected_runs", "delay_mean", "delay_p10", "delay_p90", "measurement_share", "bits_mean", "frames_lost"))


def test_faults_of_one_run_stay_together_without_each_fault(cli: Cli) -> None:
    found = cli(*FEW, "--runs", 1, "--fault", FAULT, "--fault", "gap12_m:bias:3@50", "--size", "2,4").json
    assert [c["faults"] for c in found["cases"]] == [[f"controller2:bias:{s}@40", f"gap12_m:bias:{s}@50"] for s in (2, 4)]


def test_values_of_a_key_are_split_outside_brackets_and_quotes() -> None:
    found = grid.combinations(["a.b=[1, 2],[3]", "c=x,'y,z',true"])
    assert [(c["a.b"], c["c"]) for c in found] == list(itertools.product(([1, 2], [3]), ("x", "y,z", True)))
    assert grid.combinations([]) == [{}]


BAD: list[tuple[tuple[object, ...], str]] = [
    (("--loss", "0,1"), "--loss"), (("--loss", "0,x"), "'x'"), (("--loss", ""), "--loss"), (("--loss", "0.1,0.1"), "twice"), (("--loss-burst", "1.5"), "--loss-burst"),
    (("--loss-burst", "-1"), "--loss-burst"), (("--size", "1"), "no fault"), (("--size", "inf", "--fault", FAULT), "--size"), (("--each-fault",), "no fault"),
    (("--size", "1,2", "--fault", "gap12_m:freeze@9"), "freeze"), (("--vary", "x"), "KEY=V1,V2"), (("--vary", "=1"), "KEY=V1,V2"), (("--vary", "a=1,,2"), "KEY=V1,V2"),
    (("--vary", "groups.nobody.trigger.silence=0,1"), "nobody"), (("--vary", "bus.load_max=0.7,0.7"), "twice"),
    (("--vary", "bus.load_max=0.7", "--vary", "bus.load_max=0.8"), "varied twice"), (("--attack", "1.5"), "--attack"), (("--attack", "nan"), "--attack"),
    (("--attack", "0.5", "--fault", "gap12_m:bias:1@0"), "sample 1 or later"), (("--table", "x.xlsx"), ".parquet"), (("--table", "nowhere/x.csv"), "no folder"),
    (("--scheduler", "nonsense"), "tcp://HOST:PORT"),
]  # fmt: skip


@pytest.mark.parametrize(("options", "word"), BAD, ids=[" ".join(map(str, o)) for o, _ in BAD])
def test_a_grid_that_makes_no_sense_is_refused_in_one_line(cli: Cli, options: tuple[object, ...], word: str) -> None:
    result = cli("campaign", "platoon", "--scenario", "rest", "--runs", 1, "--samples", 20, "-q", *options)
    assert (result.status, result.out) == (2, ""), result
    assert len(result.err.strip().splitlines()) == 1
    assert word in result.err


# ---- spread and interrupted ----


def test_results_depend_neither_on_the_workers_nor_on_the_chunks(models: Models) -> None:
    cases = [case_of(models, faults=[FAULT], loss=0.1, burst=3, attack=0.2), case_of(models, SILENT_1, loss=0.1)]
    once = campaign(cases, 20, serial)
    assert [r["run"].tolist() for r in once] == [list(range(20))] * 2
    assert same(campaign(cases, 20, serial, size=1), once)
    for workers, size in ((1, 7), (2, 20), (3, 4)):
        assert same(campaign(cases, 20, processes(workers), size=size), once), (workers, size)


def test_a_case_is_equal_to_its_copy_and_to_no_other(models: Models) -> None:
    base = case_of(models, faults=[FAULT])
    copy = pickle.loads(pickle.dumps(base))
    assert copy == base
    assert hash(copy) == hash(base)
    others = [
        replace(base, seed=SEED + 1), replace(base, loss=0.1), replace(base, burst=2), replace(base, attack=0.1), replace(base, samples=99), replace(base, faults=()),
        replace(base, faults=(parse_fault("controller2:bias:1.0000001@40"),)), replace(base, setup=replace(base.setup, build="another")), case_of(models, SILENT_1, [FAULT]), case_of(models, faults=[FAULT], real="f64"),
    ]  # fmt: skip
    assert len({base.key, *(o.key for o in others)}) == 1 + len(others)


class Stop(Exception):
    """What ends a campaign in the middle."""


def test_an_interrupted_campaign_goes_on_where_it_was(models: Models, tmp_path: Path) -> None:
    cases = [case_of(models, faults=[FAULT], attack=0.2), case_of(models, SILENT_1)]
    once = campaign(cases, 20, serial, size=4)
    made: list[Task] = []

    def until(count: int) -> Any:
        def work(tasks: Sequence[Task]) -> Iterator[tuple[Task, Rows]]:
            for t, rows in serial(tasks):
                if len(made) == count:
                    raise Stop
                made.append(t)
                yield t, rows

        return work

    with pytest.raises(Stop):
        campaign(cases, 20, until(3), kept=Chunks(tmp_path), size=4)
    kept = sorted(tmp_path.iterdir())
    assert len(kept) == 3
    kept[0].write_text(kept[0].read_text(encoding="utf-8")[:-40], encoding="utf-8")  # damaged: made again
    (tmp_path / f"{kept[1].stem}.123.part").write_text("{", encoding="utf-8")
    made.clear()
    ticks = [0, 0]

    def tick(place: int, count: int) -> None:
        ticks[place] += count

    assert same(campaign(cases, 20, until(99), tick, Chunks(tmp_path), 4), once)
    assert len(made) == len(tasks_of(cases, 20, 4)) - 2
    assert ticks == [20, 20]
    made.clear()
    assert same(campaign(cases, 20, until(0), kept=Chunks(tmp_path), size=4), once), "all of it is there"
    longer = campaign(cases, 24, until(2), kept=Chunks(tmp_path), size=4)
    assert [len(made), *(len(r["run"]) for r in longer)] == [2, 24, 24]


def test_a_killed_campaign_ends_with_the_files_of_one_that_was_not(cli: Cli, tmp_path: Path) -> None:
    command = ("campaign", "platoon", "--scenario", "manoeuvres", "--samples", "100", "--runs", "80", "--attack", "0.5", "--loss", "0,0.1", "-q", "--workers", "2", "--out")
    assert cli(*command, tmp_path / "once").status == 0
    folder = tmp_path / "killed" / "chunks"
    process = subprocess.Popen([sys.executable, "-m", "hullguard", *command, str(tmp_path / "killed")], start_new_session=True, stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 200.0
        while len(list(folder.glob("*.json"))) < 2:
            assert time.monotonic() < deadline
            assert process.poll() is None
            time.sleep(0.01)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    there = len(list(folder.glob("*.json")))
    assert 2 <= there < len(list((tmp_path / "once" / "chunks").iterdir()))
    assert not (tmp_path / "killed" / "campaign.json").exists()
    resumed = cli(*(c for c in command if c != "-q"), tmp_path / "killed")
    assert resumed.status == 0
    assert "runs were there already" in resumed.out
    once = files(tmp_path / "once")
    assert set(once) == {"campaign.json", "results.parquet", "campaign.html", "false_alarms.png"}
    assert files(tmp_path / "killed") == once


def test_designs_of_a_grid_are_made_once(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options = ("campaign", "platoon", "--runs", 2, "--samples", 40, "--no-fault", "--workers", 1, "--vary", "groups.measurement.trigger.silence=0,1", "--out", tmp_path)
    first = cli(*options)
    assert "design 2 of 2: groups.measurement.trigger.silence = 1\n" in first.out
    monkeypatch.setattr("hullguard.commands.stored_for", None)
    again = cli(*options)
    assert "design 2 of 2: groups.measurement.trigger.silence = 1 (kept)\n" in again.out
    assert again.status == first.status == 0


# ---- Dask ----


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """A scheduler with two workers, which are processes and do not stand in the source tree."""
    from distributed import LocalCluster

    here = Path.cwd()
    os.chdir("/")
    try:
        with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as made:
            os.chdir(here)
            yield made.scheduler_address
    finally:
        os.chdir(here)


def test_a_cluster_gives_the_same_results_from_a_model_that_only_the_caller_has(cli: Cli, tmp_path: Path, address: str) -> None:
    for name in ("platoon.toml", "platoon.design.toml"):
        (tmp_path / name).write_bytes((SHIPPED / name).read_bytes())
    options = ("campaign", tmp_path / "platoon.toml", "--scenario", "manoeuvres", "--samples", 80, "--runs", 40, "--attack", 0.3, "--loss", "0,0.1", "--workers", 1, "-q", "--json")
    here = cli(*options)
    there = cli(*options, "--scheduler", address)
    assert there.json == here.json


def test_local_starts_a_cluster_of_its_own(models: Models) -> None:
    case = case_of(models, faults=[FAULT])
    with cluster.cluster("local", 2) as way:
        assert same(campaign([case], 8, way, size=2), campaign([case], 8))


def test_a_worker_with_another_build_of_the_library_is_refused(models: Models) -> None:
    case = case_of(models)
    with pytest.raises(InputError, match="another build"):
        chunk(replace(case, setup=replace(case.setup, build="another")), 0, 1)


def test_a_cluster_that_is_not_there_is_one_clear_line(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "PATIENCE_S", 0.3)
    few = ("campaign", "platoon", "--scenario", "rest", "--runs", 1, "--samples", 20, "-q", "--scheduler")
    silent = cli(*few, "tcp://127.0.0.1:9")
    assert (silent.status, len(silent.err.strip().splitlines())) == (2, 1), silent.err
    assert "no scheduler answers" in silent.err
    monkeypatch.setitem(sys.modules, "distributed", None)
    missing = cli(*few, "local")
    assert (missing.status, len(missing.err.strip().splitlines())) == (2, 1)
    assert "pip install 'hullguard[campaign]'" in missing.err


# ---- tables, summary, report ----


def test_tables_have_a_row_a_run_with_its_case(cli: Cli, tmp_path: Path) -> None:
    options = (*FEW, "--runs", 5, "--loss", "0,0.2", "--fault", FAULT, "--vary", "groups.measurement.trigger.silence=0,[0, 1]")
    found = cli(*options, "--table", tmp_path / "t.parquet").json
    cli(*options, "--table", tmp_path / "t.csv")
    columns = pq.read_table(tmp_path / "t.parquet").to_pydict()
    with (tmp_path / "t.csv").open(encoding="utf-8", newline="") as f:
        lines = list(csv.DictReader(f))
    assert len(lines) == len(columns["run"]) == 20
    for i, row in enumerate(found["rows"]):
        case = found["cases"][row["case"]]
        assert all(columns[k][i] == v for k, v in row.items())
        assert all(float(lines[i][k]) == v for k, v in row.items())
        assert (columns["loss"][i], columns["fault"][i], float(lines[i]["loss"]), lines[i]["fault"]) == (case["loss"], case["fault"]) * 2
        assert columns["groups.measurement.trigger.silence"][i] == str(case["groups.measurement.trigger.silence"])
        assert columns["delay"][i] == (None if row["provisional_at"] < 0 else row["provisional_at"] - 40)
    assert pq.read_schema(tmp_path / "t.parquet").field("margin").type == pa.float64()


def test_without_pyarrow_parquet_is_refused_and_a_folder_gets_csv(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    few = ("campaign", "platoon", "--scenario", "rest", "--runs", 2, "--samples", 20, "--workers", 1)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    refused = cli(*few, "--table", tmp_path / "t.parquet")
    assert (refused.status, len(refused.err.strip().splitlines())) == (2, 1)
    assert "hullguard[campaign]" in refused.err
    made = cli(*few, "--out", tmp_path)
    assert made.status == 0
    assert "pyarrow" in made.out
    assert len((tmp_path / "results.csv").read_text(encoding="utf-8").splitlines()) == 3
    assert not (tmp_path / "results.parquet").exists()


@pytest.mark.parametrize(("hits", "runs"), [(0, 1), (0, 100), (3, 100), (99, 100), (100, 100), (0, 10_000)])
def test_the_bound_of_false_alarms_is_exact(hits: int, runs: int) -> None:
    """The smallest share with which so few hits are as rare as 5 %."""
    bound = upper_bound(hits, runs)
    assert scipy.stats.binom.cdf(hits, runs, bound) == pytest.approx(1.0 if hits == runs else 0.05, rel=1e-6)


def test_a_summary_is_that_of_its_rows(models: Models) -> None:
    cases = [case_of(models, faults=[FAULT], attack=0.25), case_of(models, SILENT_1, [FAULT])]
    parts = list(zip(cases, campaign(cases, 40), strict=True))
    both = summary(parts)
    delays = np.concatenate([r["provisional_at"] for _, r in parts]) - 40
    assert (delays >= 0).all()
    assert both["delay_mean"] == delays.mean()
    assert (both["delay_p10"], both["delay_p90"]) == tuple(np.percentile(delays, [10, 90]))
    assert both["silent_share"] == sum(int(r["silent"].sum()) for _, r in parts) / 8000
    hard = parts[0][1]["attacked"] == 1
    assert (both["attacked"]["runs"], both["not_attacked"]["runs"]) == (10, 70)
    assert both["attacked"]["margin_settled_max"] == parts[0][1]["margin_settled"][hard].max()


def test_a_report_shows_the_grid_and_is_drawn_again_to_the_byte(cli: Cli, tmp_path: Path) -> None:
    options = ("campaign", "platoon", "--scenario", "manoeuvres", "--samples", 80, "--runs", 6, "--attack", 0.5, "--workers", 1, "-q", *GRID)
    assert cli(*options, "--out", tmp_path).status == 0
    before = files(tmp_path)
    assert set(before) == {"campaign.json", "results.parquet", "campaign.html", "delay_by_size.png", "delay_by_bits.png", "false_alarms.png"}
    text = before["campaign.html"].decode()
    assert text.count("<figure>") == 3
    assert "http" not in text.replace("http-equiv", "")
    for case in json.loads(before["campaign.json"])["cases"]:
        assert case["name"] in text
    for name in ("campaign.html", "delay_by_size.png"):
        (tmp_path / name).unlink()
    assert cli("report", tmp_path, "-q").status == 0
    assert files(tmp_path) == before


def test_a_report_shows_the_limit_where_a_case_has_one(cli: Cli, tmp_path: Path) -> None:
    options = ("campaign", "platoon", "--scenario", "rest", "--samples", 80, "--runs", 3, "--workers", 1, "-q", "--fault", FAULT, "--size", "1,2", "--out", tmp_path)
    assert cli(*options).status == 0
    plain = files(tmp_path)
    result = json.loads(plain["campaign.json"])
    for case in result["cases"]:
        case["limit"] = 5.125
    (tmp_path / "campaign.json").write_text(json.dumps(result), encoding="utf-8")
    assert cli("report", tmp_path, "-q").status == 0
    limited = files(tmp_path)
    assert "5.12" in limited["campaign.html"].decode()
    assert limited["delay_by_size.png"] != plain["delay_by_size.png"]


def test_rows_of_many_runs_are_in_the_table_only(cli: Cli, tmp_path: Path) -> None:
    found = cli("campaign", "platoon", "--scenario", "rest", "--samples", 3, "--runs", 2001, "--workers", 1, "-q", "--json", "--out", tmp_path).json
    assert "rows" not in found
    assert pq.read_table(tmp_path / "results.parquet").num_rows == found["runs"] == 2001


# ---- losses in bursts, silent phases ----


@pytest.mark.parametrize("burst", [0, 1, 3, 9])
def test_a_burst_takes_all_frames_of_its_group_and_then_ends(models: Models, burst: int) -> None:
    batch = models.platoon("manoeuvres").batch(2000, loss=0.05, burst=burst)
    trace = batch.trace(0)
    sent, lost = trace["events"] & 1, trace["lost"] & 1
    assert not np.any(lost & ~sent)
    assert not np.any(trace["lost"] >> 1), "the closing frame is never lost"
    assert batch.runs(0, 1)[0]["lost"] == lost.sum() > 0
    begins, until, chances = 0, -1, 0
    for k in np.nonzero(sent)[0]:
        if k < until:
            assert lost[k], f"sample {k} is within the burst that ends before {until}"
            continue
        chances += 1
        begins += int(lost[k])
        until = k + max(burst, 1) if lost[k] else until
    assert scipy.stats.binomtest(begins, chances, 0.05).pvalue > 1e-6


def test_no_alarm_is_confirmed_whatever_burst_of_losses_comes(models: Models) -> None:
    for burst, overrides in itertools.product((2, 5, 12), (None, SILENT_1, ADAPTIVE)):
        rows = campaign([case_of(models, overrides, loss=0.1, burst=burst, attack=0.1, samples=200)], 100)[0]
        assert rows["lost"].sum() > 0
        assert not rows["false_confirmed"].any(), (burst, overrides)


@pytest.mark.parametrize("silence", [0, 1, 3])
def test_samples_of_the_silent_phase_are_counted(models: Models, silence: int) -> None:
    batch = models.platoon("manoeuvres", {"groups.measurement.trigger.silence": silence}).batch(300)
    sent = np.nonzero(batch.trace(2)["events"] & 1)[0]
    expected = sum(min(silence, after - before - 1) for before, after in itertools.pairwise([*sent, 300]))
    assert batch.runs(2, 1)[0]["silent"] == expected


# ---- the attack ----


@pytest.mark.parametrize("overrides", [None, SILENT_1, ADAPTIVE], ids=["always", "silent", "adaptive"])
def test_a_trace_tells_what_silent_senders_promise(models: Models, overrides: dict[str, Any] | None) -> None:
    """Without losses the receiver knows it too: the radius is the promise with the rounding of the value sent, or the slew where that is less."""
    ready = models.platoon("manoeuvres", overrides)
    trace = ready.batch(2000).trace(0)
    promise, radius, off = trace["promise"][:, :3], trace["radius"][:, :3], np.abs(trace["reading"] - trace["value"])[:, :3]
    silent = (trace["events"] & 1) == 0
    looked = np.isfinite(promise).all(axis=1)
    assert not np.any(looked & ~silent)
    assert np.isinf(promise[~looked]).all()
    first = [silent[k] and not silent[k - 1] for k in range(1, 2000)]
    if overrides is None:
        assert np.array_equal(looked, silent)
    elif overrides is SILENT_1:
        assert np.array_equal(looked[1:], silent[1:] & ~np.array(first))
    assert np.isinf(trace["promise"][:, 3:]).all(), "the closing group is never silent"
    assert (off[looked] <= promise[looked] + 1e-4).all()
    assert (radius[looked] <= promise[looked] + 1e-4).all()
    bound_by_promise = np.abs(radius - promise)[looked] <= 1e-4
    assert bound_by_promise.mean() > 0.5


def attack_on(ready: Ready, last: int = 149, **options: Any) -> tuple[Attack, np.ndarray, np.ndarray]:
    plant = ready.design.model.plant
    d, x = np.zeros((150, plant.Ed.shape[1])), np.zeros(plant.n)
    return Attack(ready.batch(150, disturbance=d, initial=x, **options), ready.design, d, x, SEED, last), d, x


@pytest.mark.parametrize("overrides", [None, SILENT_1, ADAPTIVE], ids=["always", "silent", "adaptive"])
@pytest.mark.parametrize("real", ["f32", "f64"])
def test_attacked_runs_come_closer_to_the_threshold_than_random_ones_and_never_pass_it(models: Models, overrides: dict[str, Any] | None, real: str) -> None:
    case = case_of(models, overrides, real=real, attack=0.25, samples=150)
    rows = campaign([case], 160)[0]
    hard, easy = rows["margin_settled"][rows["attacked"] == 1], rows["margin_settled"][rows["attacked"] == 0]
    assert (len(hard), len(easy)) == (40, 120)
    assert hard.mean() > 1.5 * easy.mean()
    assert hard.max() > easy.max() + 0.1
    assert rows["margin"].max() <= 1.0
    assert not rows["false_provisional"].any()


def test_an_attack_stays_within_the_bounds_and_is_repeatable(models: Models) -> None:
    ready = models.platoon("manoeuvres")
    made, d, x = attack_on(ready)
    rows = []
    for number in (0, 1, 2, 3, 0):
        rows.append(made.run(number))
        assert np.abs(d).max() <= 1.0
        assert np.all(np.abs(x) <= ready.design.model.plant.initial_range)
        assert (np.abs(d) == 1.0).mean() > 0.5, "a linear programme ends at a vertex"
    assert rows[0] == rows[4]
    assert rows[0] != rows[1]


def test_an_attack_aims_before_the_fault(models: Models) -> None:
    made, d, _ = attack_on(models.platoon("rest"), last=9)
    for number in range(10):
        rng = np.random.default_rng([SEED, number, attack.STREAM])
        drawn = int(rng.integers(2)), int(rng.integers(10)), float(rng.choice([-1.0, 1.0]))
        assert drawn[1] <= 9
        random = rng.choice([-1.0, 1.0], d.shape)
        made.run(number)
        assert np.array_equal(d[10:], random[10:]), "behind the last sample nothing is chosen"


def test_residuals_are_the_functionals_that_an_attack_takes_them_for(models: Models) -> None:
    for name, scenario in (("platoon", "manoeuvres"), ("openacc", "default"), ("platoon_bank", "manoeuvres")):
        made = models.design(None, scenario, name)
        ready = Ready(made, Native(library("f64"), made.tables), made.model.scenario(scenario).reference, 150)
        trace = ready.batch(150).trace(0)
        weights, places = attack.functionals(made.tables, 120)
        for k in (125, 149):
            r = np.einsum("ijg,jg->i", weights, trace["value"][k - np.arange(121)])
            # Of a bank's certificates the trace shows the one that comes closest.
            for place in range(made.tables.residuals):
                assert np.abs(r[places == place] - trace["r"][k, place]).min() <= 1e-6 * max(1.0, np.abs(trace["r"]).max()), name


def test_readings_move_with_disturbance_and_initial_state_as_an_attack_takes_them_to(models: Models) -> None:
    ready = models.platoon("manoeuvres", real="f64")
    rng = np.random.default_rng([SEED, 3])
    plant, quantum = ready.design.model.plant, max(s.resolution for s in ready.design.model.signals)
    moves = attack.sensitivity(ready.design.model, ready.design.model.plant, 30)
    d, x = rng.uniform(-1.0, 1.0, (2, 31, plant.Ed.shape[1])), rng.uniform(-1.0, 1.0, (2, plant.n)) * plant.initial_range
    before, after = (ready.batch(31, disturbance=d[i], initial=x[i]).trace(0)["reading"] for i in (0, 1))
    predicted = moves @ np.concatenate([(d[1] - d[0]).ravel(), x[1] - x[0]])
    # The plant applies what the wire carries: each sample's inputs are rounded, and the loop carries that on.
    assert np.abs(after - before - predicted).max() <= 20 * quantum
    assert np.abs(predicted).max() > 200 * quantum


def test_an_attack_reaches_what_its_programme_promises_where_the_frames_come_as_before(models: Models, monkeypatch: pytest.MonkeyPatch) -> None:
    made, d, x = attack_on(models.platoon("manoeuvres", real="f64"))
    gained: list[float] = []
    plain = attack.scipy.optimize.milp

    def spy(c: Any, **options: Any) -> Any:
        solved = plain(c, **options)
        gained.append(0.0 if solved.fun is None else -float(solved.fun))
        return solved

    monkeypatch.setattr(attack.scipy.optimize, "milp", spy)
    rng = np.random.default_rng([SEED, 5])
    compared = 0
    for number in range(120):
        sample, row = int(rng.integers(3, 60)), int(rng.integers(2))
        d[:], x[:] = rng.choice([-1.0, 1.0], d.shape), 0.0
        before = made._batch.trace(number)
        if not made._improve(before, made._weights[row], sample, made._moves[0]):
            continue
        after = made._batch.trace(number)
        window = slice(0, sample + 1)
        if np.array_equal(before["events"][window], after["events"][window]):
            compared += 1
            assert gained[-1] > 0.0
            assert after["r"][sample, row] == pytest.approx(before["r"][sample, row] + gained[-1], abs=0.03 * after["J"][sample, row])
    assert compared >= 3


def test_a_pattern_that_no_disturbance_fits_ends_the_attack(models: Models, monkeypatch: pytest.MonkeyPatch) -> None:
    made, _, _ = attack_on(models.platoon("manoeuvres"))
    plain = made._promises

    def impossible(*arguments: Any) -> tuple[Any, Any, Any]:
        rows, low, high = plain(*arguments)
        return np.vstack([rows, np.zeros(rows.shape[1])]), np.append(low, 1.0), np.append(high, 2.0)

    monkeypatch.setattr(made, "_promises", impossible)
    assert made.run(1)["margin"] > 0.0


def test_attacked_runs_are_an_exact_share_spread_evenly(models: Models) -> None:
    for share, expected in ((0.1, 100), (0.25, 250), (1.0, 1000), (0.0, 0), (0.333, 333)):
        case = case_of(models, attack=share)
        hits = [r for r in range(1000) if case.attacked(r)]
        assert len(hits) == expected
        assert not hits or max(np.diff([-1, *hits])) <= int(1 / share) + 1


def test_a_chunk_of_an_attacked_case_leaves_the_other_runs_as_they_are(models: Models) -> None:
    plain, hard = chunk(case_of(models), 3, 8), chunk(case_of(models, attack=0.25), 3, 8)
    for n in range(8):
        equal = all(plain[name][n] == hard[name][n] for name in COLUMNS if name != "attacked")
        assert equal == (hard["attacked"][n] == 0), n
    assert hard["attacked"].tolist() == [1, 0, 0, 0, 1, 0, 0, 0]


def test_kept_designs_are_the_designs_to_the_bit(models: Models, tmp_path: Path) -> None:
    made = models.design(SILENT_1, "manoeuvres")
    store.write(tmp_path / "x.design.toml", "x", made.stored)
    again = store.read(tmp_path / "x.design.toml")
    assert again is not None
    assert setup_of(finish(made.model, again), "f32") == setup_of(made, "f32")


def test_a_folder_that_holds_no_campaign_is_refused(tmp_path: Path) -> None:
    from hullguard.report.campaign_report import write_campaign_report

    with pytest.raises(InputError, match=r"campaign\.json"):
        write_campaign_report(tmp_path)


# ---- plants of the intervals, and the limit beside the delays ----

UNCERTAIN = 'plant.drag_per_s={value=1.0,pm=0.1}'


def test_plants_are_drawn_from_the_intervals_in_turn(cli: Cli) -> None:
    common = ("campaign", "platoon", "--scenario", "manoeuvres", "--runs", 12, "--set", UNCERTAIN, "--json", "-q")
    few, more = (cli(*common, "--plants", n).json["rows"] for n in (1, 12))
    assert [r["bits"] for r in few] != [r["bits"] for r in more], "other plants send other frames"
    assert all(r["false_provisional"] == 0 for r in few + more)
    refused = cli("campaign", "platoon", "--runs", 1, "--plants", 3)
    assert refused.status == 2
    assert "no interval to draw from" in refused.err


def test_the_limit_stands_beside_the_delay(cli: Cli) -> None:
    found = cli("campaign", "platoon", "--scenario", "rest", "--runs", 20, "--size", "1,2", "--fault", "controller2:bias:1@100", "--limit", "--json", "-q").json["cases"]
    for case in found:
        assert 1.0 <= case["limit"] <= case["delay_mean"]
    assert found[1]["limit"] < found[0]["limit"]
    lossy = cli("campaign", "platoon", "--scenario", "rest", "--runs", 5, "--loss", "0.1", "--fault", "controller2:bias:1@100", "--limit", "--json", "-q").json["cases"]
    assert lossy[0].get("limit") is None
