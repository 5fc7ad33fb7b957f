"""The command as a user meets it: help, JSON that can be recomputed from the files beside it, expectations, and a log that gives its verdicts again."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from host_support import ROOT, Cli, Models, Result, classic_bits
from hullguard import __version__
from hullguard.bus import candump

COMMANDS = ("design", "run", "replay", "detect", "plant", "campaign", "report")
NAMES = ("gap12_m", "gap23_m", "speed1_mps", "control1_mps2", "control2_mps2", "control3_mps2")

RUN_KEYS = {
    "model": str, "model_hash": str, "real": str, "bus": str, "bitrate": int, "samples": int, "seed": int, "frames": dict, "per_group": dict, "events": dict,
    "faults": list, "false_alarms": dict, "communication": dict, "margin_max": float, "verdicts": list,
}  # fmt: skip
FRAME_KEYS = {"measurement": int, "periodic": int, "total": int, "bits": int, "load_mean": float, "load_p99": float, "load_bound": float}
MATRICES = ("A", "B", "C", "D", "Ed", "Fd", "T", "G", "H", "L", "W", "V", "Qu", "Lo", "Mo")


def has(found: dict[str, Any], keys: dict[str, type]) -> None:
    for key, kind in keys.items():
        assert key in found, key
        assert isinstance(found[key], kind), key


def good(result: Result) -> Result:
    assert result.status == 0, result.err
    return result


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_every_command_is_there_and_names_the_exit_statuses(cli: Cli, command: str) -> None:
    result = cli(command, "--help")
    assert (result.status, result.err) == (0, "")
    assert f"usage: hullguard {command}" in result.out
    assert "exit status: 0 done" in result.out
    assert "NAME:KIND[:SIZE]@START[..END]" in result.out


def test_the_general_help_names_every_command(cli: Cli) -> None:
    result = good(cli("--help"))
    for command in COMMANDS:
        assert f"\n    {command} " in result.out
    assert good(cli("--version")).out.strip() == f"hullguard {__version__}"


def test_the_package_is_a_command() -> None:
    done = subprocess.run([sys.executable, "-m", "hullguard", "--version"], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == f"hullguard {__version__}"


# ---- run ----


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, models: Models) -> tuple[Path, dict[str, Any]]:
    """A run with its files, made as a process: what is on stdout is the JSON and nothing else."""
    out = tmp_path_factory.mktemp("run") / "deep" / "er"
    command = [sys.executable, "-m", "hullguard", "run", "platoon", "--scenario", "manoeuvres", "--samples", "220", "--seed", "11", "--bus", "inprocess"]
    command += ["--fault", "controller2:bias:1.5@100..130", "--fault", "gap12_m:noise:3@180..200", "--expect", "detect", "--out", str(out), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out, json.loads(done.stdout)


def test_a_run_says_all_that_the_design_promises(finished: tuple[Path, dict[str, Any]], models: Models) -> None:
    _, found = finished
    has(found, RUN_KEYS)
    has(found["frames"], FRAME_KEYS)
    assert (found["model"], found["real"], found["samples"], found["seed"], found["bitrate"]) == ("platoon", "f32", 220, 11, 500000)
    assert found["model_hash"] == f"{models.design().tables.hash:08x}"
    assert found["frames"]["load_mean"] <= found["frames"]["load_p99"] <= found["frames"]["load_bound"]
    assert set(found["events"]) == {"interval_min", "interval_max"}
    assert set(found["false_alarms"]) == {"provisional", "confirmed"}
    assert [f["name"] for f in found["faults"]] == ["controller2", "gap12_m"]
    for f in found["faults"]:
        assert set(f) >= {"name", "start", "detected_at", "confirmed_at", "delay", "candidates"}
        assert f["delay"] == f["detected_at"] - f["start"]
    assert "controller2" in found["faults"][0]["candidates"]
    assert found["verdicts"][0]["k"] == 0
    assert set(found["per_group"]) == set(found["verdicts"][0]["bus"]) == {"measurement", "control"}
    assert 0.0 < found["margin_max"] <= 1.0


def test_a_run_leaves_all_its_files(finished: tuple[Path, dict[str, Any]]) -> None:
    out, found = finished
    assert {f.name for f in out.iterdir()} >= {"run.log", "run.json", "signals.csv", "labels.csv", "platoon.dbc", "report.html"}
    assert json.loads((out / "run.json").read_text(encoding="utf-8")) == found


def test_frames_and_bits_of_a_run_can_be_recounted_from_its_log(finished: tuple[Path, dict[str, Any]]) -> None:
    out, found = finished
    frames = [e.frame for e in candump.read(out / "run.log")]
    count = {number: sum(f.id == number for f in frames) for number in (0x110, 0x120, 0x130, 0x131)}
    told = found["frames"]
    assert sum(count.values()) == len(frames) == told["total"] + told["lockstep_replies"]
    assert count[0x110] == told["measurement"] == found["per_group"]["measurement"]["frames"]
    assert count[0x120] == found["samples"] == found["per_group"]["control"]["frames"]
    assert sum(classic_bits(f) for f in frames) == told["bits"] + told["bits_lockstep_replies"]
    assert told["load_mean"] == pytest.approx(told["bits"] / (found["samples"] * 0.1 * found["bitrate"]))
    assert told["periodic"] == 2 * found["samples"]
    assert found["communication"]["good"] == count[0x110] + count[0x120]


def test_signals_and_labels_of_a_run_agree_with_its_result(finished: tuple[Path, dict[str, Any]]) -> None:
    out, found = finished
    with (out / "signals.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == found["samples"]
    assert sum(int(r["event.measurement"]) for r in rows) == found["frames"]["measurement"]
    assert sum(int(r["bits"]) for r in rows) == found["frames"]["bits"]
    healthy = rows[: found["faults"][0]["start"]]
    assert max(abs(float(r[f"r1.{i}"])) / float(r[f"J1.{i}"]) for r in healthy for i in (1, 2)) == pytest.approx(found["margin_max"], rel=1e-6)
    for row in healthy:
        for name in NAMES:
            assert abs(float(row[name]) - float(row[f"{name}.value"])) <= float(row[f"{name}.radius"]) * (1 + 1e-6) + 1e-6
    first = next(k for k, r in enumerate(rows) if int(r["plant"]) >= 2)
    assert first == found["faults"][0]["detected_at"]
    with (out / "labels.csv").open(newline="", encoding="utf-8") as file:
        labels = list(csv.DictReader(file))
    assert [(x["start"], x["end"], x["name"], x["kind"], x["signal"]) for x in labels] == [
        ("100", "130", "controller2", "bias", "control2_mps2"),
        ("180", "200", "gap12_m", "noise", "gap12_m"),
    ]


def test_a_log_gives_the_verdict_changes_of_its_run_again(cli: Cli, finished: tuple[Path, dict[str, Any]]) -> None:
    out, found = finished
    told = good(cli("detect", "platoon", "--log", out / "run.log", "--rest", "--json", "-q", "--expect", "detect")).json
    assert told["verdicts"] == found["verdicts"]
    assert told["samples"] == found["samples"]
    assert told["communication"]["good"] == found["communication"]["good"]
    assert set(told) >= {"model", "model_hash", "real", "samples", "communication", "verdicts"}


@pytest.mark.parametrize("real", ["f32", "f64"])
@pytest.mark.parametrize("scenario", ["default", "adaptive"])
def test_a_log_of_any_scenario_and_number_type_gives_its_verdicts_again(cli: Cli, tmp_path: Path, scenario: str, real: str) -> None:
    some = ("platoon", "--scenario", scenario, "--real", real)
    found = good(cli("run", *some, "--bus", "inprocess", "--out", tmp_path, "--json", "-q")).json
    told = good(cli("detect", *some, "--log", tmp_path / "run.log", "--rest", "--json", "-q")).json
    assert told["verdicts"] == found["verdicts"]
    assert found["real"] == told["real"] == real


def test_a_log_without_every_fifth_measurement_is_reported_as_a_broken_bus(cli: Cli, tmp_path: Path) -> None:
    good(cli("run", "platoon", "--scenario", "manoeuvres", "--bus", "inprocess", "--out", tmp_path, "-q"))
    lines = (tmp_path / "run.log").read_text(encoding="ascii").splitlines()
    measured = [i for i, x in enumerate(lines) if " 110#" in x]
    dropped = set(measured[5::5])
    (tmp_path / "holes.log").write_text("\n".join(x for i, x in enumerate(lines) if i not in dropped) + "\n", encoding="ascii")
    told = good(cli("detect", "platoon", "--log", tmp_path / "holes.log", "--rest", "--json", "-q")).json
    assert told["communication"]["lost"] == len([i for i in dropped if i < measured[-1]])
    assert any(v["bus"]["measurement"] == "lossy" for v in told["verdicts"])
    assert all(v["plant"] != "confirmed" for v in told["verdicts"])


def test_the_same_seed_gives_the_same_run_and_another_does_not(cli: Cli) -> None:
    base = ("run", "platoon", "--scenario", "manoeuvres", "--samples", 40, "--bus", "inprocess", "--json", "-q", "--seed")
    first = good(cli(*base, 5)).out
    assert good(cli(*base, 5)).out == first
    assert json.loads(good(cli(*base, 6)).out)["frames"] != json.loads(first)["frames"]


def test_the_seed_may_be_any_of_64_bits(cli: Cli) -> None:
    for seed in (0, 2**63, 2**64 - 1):
        assert good(cli("run", "platoon", "--samples", 20, "--no-fault", "--bus", "inprocess", "--json", "-q", "--seed", seed)).json["seed"] == seed


def test_an_override_reaches_the_detector(cli: Cli) -> None:
    base = ("run", "platoon", "--scenario", "rest", "--bus", "inprocess", "--json", "-q")
    plain = good(cli(*base)).json
    silent = good(cli(*base, "--set", "groups.measurement.trigger.silence=2")).json
    assert silent["model_hash"] != plain["model_hash"]
    assert silent["events"]["interval_min"] == 3
    good(cli(*base, "--scenario", "rest", "--set", "groups.0.trigger.silence = 2", "--set", "verdict.debounce.up=2"))


def test_lines_for_people_go_to_stderr_when_stdout_carries_json(cli: Cli) -> None:
    base = ("run", "platoon", "--samples", 60, "--no-fault", "--bus", "inprocess")
    with_json = good(cli(*base, "--json"))
    assert with_json.json["samples"] == 60
    assert "measurement frames" in with_json.err
    plain = good(cli(*base))
    assert "measurement frames" in plain.out
    silent = good(cli(*base, "-q"))
    assert (silent.out, silent.err) == ("", "")


# ---- replay ----


def test_a_recorded_run_is_replayed_with_the_same_events(cli: Cli, finished: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    out, found = finished
    told = good(cli("replay", "platoon", "--csv", out / "signals.csv", "--bus", "inprocess", "--json", "-q", "--out", tmp_path)).json
    has(told, RUN_KEYS)
    assert told["frames"]["measurement"] == found["frames"]["measurement"]
    assert told["scenario"] == "signals.csv"
    assert any(v["plant"] == "confirmed" for v in told["verdicts"])
    again = good(cli("detect", "platoon", "--log", tmp_path / "run.log", "--json", "-q")).json
    assert again["verdicts"] == told["verdicts"]


def test_a_fault_in_a_replay_is_found_and_without_it_there_is_none(cli: Cli, tmp_path: Path) -> None:
    good(cli("run", "platoon", "--scenario", "manoeuvres", "--no-fault", "--bus", "inprocess", "--out", tmp_path, "-q"))
    base = ("replay", "platoon", "--csv", tmp_path / "signals.csv", "--bus", "inprocess", "--json", "-q")
    good(cli(*base, "--expect", "quiet"))
    found = good(cli(*base, "--fault", "gap12_m:bias:1.0@120", "--expect", "detect")).json
    assert found["faults"][0]["delay"] <= 5


# ---- design ----


def test_a_design_can_be_recomputed_from_what_it_says(cli: Cli, tmp_path: Path, models: Models) -> None:
    found = good(cli("design", "platoon", "--out", tmp_path, "--json", "-q")).json
    assert found["model_hash"] == f"{models.design().tables.hash:08x}"
    assert {f.name for f in tmp_path.iterdir()} >= {"platoon.c", "platoon.h", "platoon.dbc", "platoon.html"}
    assert len(found["generators"]) == 1
    m = {name: np.array(found["generators"][0][name]) for name in MATRICES}
    assert m["A"].shape == (5, 5)
    assert m["T"].shape == (4, 5)
    assert np.abs(m["T"] @ m["A"] - m["G"] @ m["T"] - m["L"] @ m["C"]).max() <= 1e-9
    assert np.abs(m["T"] @ m["B"] - m["L"] @ m["D"] - m["H"]).max() <= 1e-9
    assert np.abs(m["V"] @ m["C"] - m["W"] @ m["T"]).max() <= 1e-9
    assert np.abs(m["V"] @ m["D"] - m["Qu"]).max() <= 1e-9
    poles = [complex(*p) for p in found["generators"][0]["poles"]]
    assert np.allclose(np.sort_complex(np.linalg.eigvals(m["G"])), np.sort_complex(np.array(poles)), atol=1e-6)
    assert all(c["passed"] and c["value"] <= c["limit"] for c in found["checks"])
    assert {"Luenberger", "all-pass", "bus load"} <= {w for c in found["checks"] for w in ("Luenberger", "all-pass", "bus load") if w in c["name"]}
    assert found["slews"]["gap12_m"][0] == pytest.approx(0.200, abs=5e-4)
    assert found["slews"]["speed1_mps"][0] == pytest.approx(0.563, abs=5e-4)
    assert set(found["generators"][0]["smallest_fault"]) == {"controller1", "controller2", "controller3"}
    assert found["reused"] is True


def test_a_design_with_an_override_does_not_touch_the_shipped_one(cli: Cli, tmp_path: Path) -> None:
    beside = ROOT / "host_tools" / "models" / "platoon.design.toml"
    before = beside.read_bytes()
    found = good(cli("design", "platoon", "--set", "groups.measurement.trigger.silence=1", "--out", tmp_path, "--json", "-q")).json
    assert found["reused"] is False
    assert beside.read_bytes() == before
    assert (tmp_path / "platoon.design.toml").is_file()


# ---- campaign, report ----


def test_a_campaign_says_all_that_the_design_promises(cli: Cli, tmp_path: Path) -> None:
    found = good(cli("campaign", "platoon", "--runs", 8, "--workers", 1, "--samples", 200, "--loss", 0.05, "--json", "-q", "--out", tmp_path, "--expect", "detect")).json
    assert found == json.loads((tmp_path / "campaign.json").read_text(encoding="utf-8"))
    assert (found["runs"], found["samples"], len(found["rows"])) == (8, 200, 8)
    assert [r["run"] for r in found["rows"]] == list(range(8))
    assert (found["false_alarm_runs"], found["provisional_alarm_runs"]) == (0, 0)
    delays = [r["provisional_at"] - 150 for r in found["rows"]]
    assert found["delay_mean"] == pytest.approx(np.mean(delays))
    assert found["delay_max"] == max(delays)
    assert found["detected_runs"] == found["confirmed_runs"] == 8
    assert found["measurement_share"] == pytest.approx(sum(r["measurement"] for r in found["rows"]) / 1600)
    assert found["frames_lost"] == sum(r["lost"] for r in found["rows"]) > 0


def test_a_quiet_campaign_meets_its_expectation(cli: Cli) -> None:
    good(cli("campaign", "platoon", "--scenario", "rest", "--runs", 8, "--workers", 1, "--expect", "quiet", "-q"))


def test_a_report_is_drawn_again_from_the_files_of_a_run(cli: Cli, finished: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    out, _ = finished
    for name in ("run.json", "signals.csv", "labels.csv"):
        (tmp_path / name).write_bytes((out / name).read_bytes())
    good(cli("report", tmp_path, "-q"))
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "platoon" in text
    assert "controller2" in text


def test_ctrl_c_ends_a_campaign_with_one_line() -> None:
    command = [sys.executable, "-m", "hullguard", "campaign", "platoon", "--scenario", "rest", "--runs", "2000000", "--workers", "2", "-q"]
    # A shell's background jobs ignore the signal, and so would all that they start.
    hears = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
    before = time.monotonic()
    subprocess.run([*command[:4], "--help"], check=True, stdout=subprocess.DEVNULL)
    start = time.monotonic() - before
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=hears)
    time.sleep(max(5.0, 5.0 * start))  # its workers are at work
    os.killpg(process.pid, signal.SIGINT)
    try:
        out, err = process.communicate(timeout=100)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert (out, err.strip()) == ("", "hullguard: interrupted")
