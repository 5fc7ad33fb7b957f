"""Fusion filters on a bus: model files, tables, frames, runs in process, and what is refused. On vcan: tests/node/test_fusion_node.py."""

from __future__ import annotations

import copy
import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from host_support import SEED
from hullguard.campaign import fusion_compare, fusion_study
from hullguard.campaign.fusion_compare import Way
from hullguard.cli import main
from hullguard.codegen.fusion import emit_c, emit_config, emit_dbc
from hullguard.core.library import library
from hullguard.core.native import REST
from hullguard.core.tracker import Tick, Tracker, TrackerNative
from hullguard.design.fusion import allocate
from hullguard.design.fusion_model import FusionDesign, design_fusion
from hullguard.errors import InputError
from hullguard.model.faults import FaultSpec
from hullguard.model.fusion import FusionScenario, kind_of, load_fusion, parse_fusion, parse_sensor_fault
from hullguard.model.schema import SHIPPED
from hullguard.plant.fusion import InProcess, Run, Sensors, Trace, errors, noise_drive, recorded_drive, summary, traffic_drive

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("fusion5", "fusion5_fast", "tracking")
QUIET = FusionScenario("quiet", 0, "noise", 0.0, 0.0, -1, (), ())


@pytest.fixture(scope="module")
def designs() -> dict[str, FusionDesign]:
    return {name: design_fusion(load_fusion(name))[0] for name in NAMES}


def ran(made: FusionDesign, samples: int, faults: list[FaultSpec], loss: float, seed: int, real: str = "f32") -> tuple[Run, Trace]:
    scenario = FusionScenario("test", samples, "noise", loss, 0.0, -1, (), ())
    drive = traffic_drive(made.model, samples, seed) if made.model.plant.builder == "car_following" else noise_drive(made.model, scenario, samples, seed)
    run = Run(made, TrackerNative(library(real), made.tables), InProcess())
    return run, run.samples(drive, Sensors(made, drive, faults, scenario, seed), samples)


# ---- what is shipped ----


@pytest.mark.parametrize("name", NAMES)
def test_shipped_files_are_those_of_the_shipped_models(name: str, designs: dict[str, FusionDesign]) -> None:
    made, folder = designs[name], ROOT / "firmware" / "models"
    header, source = emit_c(made)
    for suffix, text in ((".h", header), (".c", source), (".dbc", emit_dbc(made)), ("_config.h", emit_config(made))):
        assert (folder / (name + suffix)).read_text(encoding="ascii") == text


def test_shipped_thresholds_are_what_a_search_finds(designs: dict[str, FusionDesign]) -> None:
    made = designs["tracking"]
    t = made.model.trigger
    found = allocate(made.plant, t.rate, t.weight)
    assert found.delta == pytest.approx(made.found[0].delta, rel=1e-3)
    assert [f.alive for f in made.found] == [31, 30, 29, 27, 23, 15], "and one set for each sensor that may be missing"


def test_the_five_sensors_are_those_of_the_study(designs: dict[str, FusionDesign]) -> None:
    ours, theirs = designs["fusion5"].plant, fusion_study.tracking(0.1)
    for part in ("A", "Q", "C", "R", "x0", "P0"):
        assert np.allclose(getattr(ours, part), getattr(theirs, part), atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_another_tool_reads_the_frames(name: str, designs: dict[str, FusionDesign]) -> None:
    made = designs[name]
    database = cantools.database.load_string(emit_dbc(made), "dbc")
    run, trace = ran(made, 60, [], 0.0, SEED)
    sender = run.senders[1]
    frame = next(f for f in (sender.step(made.plant.C[1] @ np.array(trace.value[-1]) + d) for d in (5.0, -5.0)) if f is not None)
    told = database.decode_message(frame.id, frame.data)
    assert told["E2E_stamp"] == 60 % 16
    assert min(abs(told[made.model.names[1]] - made.plant.C[1] @ np.array(trace.value[-1]) - d) for d in (5.0, -5.0)) < 0.01
    estimate = next(f for f in Tracked(run).frames() if f.id == made.tables.estimate[0].message.id)
    told = database.decode_message(estimate.id, estimate.data)
    state = made.model.plant.states[0]
    assert told[state] == pytest.approx(run.centre.value[0], abs=made.tables.estimate[0].signals[0].resolution)
    assert told[f"{state}_deviation"] == pytest.approx(run.centre.deviation[0], abs=made.tables.estimate[0].signals[1].resolution)


class Tracked:
    """The frames that a run's centre sends in the ten samples after it."""

    def __init__(self, run: Run) -> None:
        self.run = run

    def frames(self) -> list[Any]:
        found = []
        for k in range(60, 70):
            self.run.centre.receive(self.run.tick.frame(k))
            self.run.centre.step()
            found += self.run.centre.report(False)
        return found


# ---- runs ----


@pytest.mark.parametrize("real", ["f32", "f64"])
@pytest.mark.parametrize("name", NAMES)
def test_copies_are_equal_to_the_bit(name: str, real: str, designs: dict[str, FusionDesign]) -> None:
    """One a sensor, the centre's, and the plain filter that sees no frame, with losses and an exclusion in between."""
    i = SEED % 5
    sensor = designs[name].model.sensors[i]
    run, trace = ran(designs[name], 1500, [FaultSpec(sensor.name, "bias", 5.0 * sensor.sigma, 900, None)], 0.15, SEED, real)
    assert trace.unequal == 0
    assert run.plain.digest == run.centre.digest and {c.digest for c in run.copies} == {run.centre.digest}
    assert trace.verdict[-1].candidates == 1 << i, "the biased one is out, and no other"


# ---- late frames ----


def without_delay(made: FusionDesign) -> FusionDesign:
    """The same thresholds in a filter that holds no sample: late frames are of no use to it."""
    return FusionDesign(replace(made.model, trigger=replace(made.model.trigger, delay=0, depth=0, late=0.0)), made.found)


def delayed(made: FusionDesign, samples: int, loss: float, late: float, seed: int) -> tuple[Run, Trace, float, float]:
    """A run with late frames; mean squares of its position error and of a Kalman filter's that has every reading of the same drive at once."""
    scenario = FusionScenario("late", samples, "noise", loss, late, -1, (), ())
    drive = noise_drive(made.model, scenario, samples, seed)
    run = Run(made, TrackerNative(library("f32"), made.tables), InProcess())
    trace = run.samples(drive, Sensors(made, drive, [], scenario, seed), samples)
    periodic = kalman(made, np.array(trace.reading)) - drive
    return run, trace, *(float(np.mean(e[100:, [0, 2]] ** 2)) for e in (errors(made, trace)[0], periodic))


def kalman(made: FusionDesign, y: np.ndarray) -> np.ndarray:
    """Estimates of the textbook's filter in float64, samples x n."""
    p, found = made.plant, np.empty((len(y), made.plant.states))
    x, P = p.x0, p.P0
    for k, row in enumerate(y):
        x, P = p.A @ x, p.A @ P @ p.A.T + p.Q
        K = P @ p.C.T @ np.linalg.inv(p.C @ P @ p.C.T + np.diag(p.R))
        x, P = x + K @ (row - p.C @ x), P - K @ p.C @ P
        found[k] = x
    return found


def test_copies_stay_equal_with_delay_and_loss(designs: dict[str, FusionDesign]) -> None:
    """Half of the frames come after the tick of their sample, a twentieth never."""
    run, trace, _, _ = delayed(designs["fusion5_fast"], 3000, 0.05, 0.5, SEED)
    assert trace.unequal == 0 and {run.plain.digest, *(c.digest for c in run.copies)} == {run.centre.digest}
    assert sum(trace.lost) > 0 and trace.verdict[-1].candidates == 0
    refused = {n: v for n, v in trace.health.items() if v and n.rsplit(".")[-1] not in ("good", "lost")}
    assert not refused, "within the delay a frame is neither late nor out of sequence"
    lost = sum(b.bit_count() for b in trace.lost)
    assert 0.97 * lost <= sum(v for n, v in trace.health.items() if n.endswith(".lost")) <= lost


def test_late_frames_are_filtered_in(designs: dict[str, FusionDesign]) -> None:
    """The method's limit, section 5, without losses: 1.07 of periodic sending in time at half of the frames late; dropping them is clearly worse."""
    made = designs["fusion5_fast"]

    def squares(chosen: FusionDesign, runs: int) -> np.ndarray:
        return np.mean([delayed(chosen, 1000, 0.0, 0.5, SEED + i)[2:] for i in range(runs)], axis=0)

    kept, dropped = squares(made, 12), squares(without_delay(made), 4)
    assert 0.99 < np.sqrt(kept[0] / kept[1]) <= 1.07  # 1.052 over many, 0.005 from seed to seed
    assert np.sqrt(dropped[0] / dropped[1]) > 1.15  # 1.33, 0.05
    assert np.sqrt(2.0 * kept[0]) == pytest.approx(np.sqrt(made.told[0, 0] + made.told[2, 2]), rel=0.15), "as the design says"
    assert made.told[1, 1] > 1.2 * made.mean.P[1, 1], "a speed that is late is missed most"


def test_a_frame_too_late_is_counted_and_changes_nothing(designs: dict[str, FusionDesign]) -> None:
    """In a filter that holds no sample; copies are equal all the same."""
    run, trace, _, _ = delayed(without_delay(designs["fusion5_fast"]), 300, 0.0, 0.5, SEED)
    assert trace.unequal == 0 and run.plain.digest == run.centre.digest
    assert sum(v for n, v in trace.health.items() if n.endswith(".late")) > 100


def test_digests_see_a_copy_that_missed_a_frame(designs: dict[str, FusionDesign]) -> None:
    native = TrackerNative(library("f32"), designs["fusion5"].tables)
    run = Run(designs["fusion5"], native, InProcess())
    take, count = run.copies[2].take, [0]

    def deaf(frame: Any) -> int:
        count[0] += 1
        return 1 if count[0] == 40 else take(frame)

    run.copies[2].take = deaf  # type: ignore[method-assign]
    drive = noise_drive(designs["fusion5"].model, QUIET, 100, SEED)
    assert run.samples(drive, Sensors(designs["fusion5"], drive, [], QUIET, SEED), 100).unequal > 0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", ["bias", "freeze", "dead"])
def test_a_faulty_sensor_is_found_and_taken_out(name: str, kind: str, designs: dict[str, FusionDesign]) -> None:
    made, i = designs[name], SEED % 5
    s = made.model.sensors[i]
    fault = FaultSpec(s.name, kind, 4.0 * s.sigma if kind == "bias" else 0.0, 200, None)
    _, trace = ran(made, 260, [fault], 0.05, SEED)
    row = summary(made, TrackerNative(library("f32"), made.tables), trace, [fault], {})
    assert row["faults"][0]["detected_at"] is not None and row["faults"][0]["delay"] <= 50
    assert row["faults"][0]["candidates"] == [s.name] and row["false_alarms"]["confirmed"] == 0
    assert (trace.verdict[-1].bus[i] == "stale") == (kind == "dead")


def test_errors_and_bits_are_those_of_the_method(designs: dict[str, FusionDesign]) -> None:
    """The study's figures once more, over frames."""
    made = designs["fusion5"]
    seen = [ran(made, 500, [], 0.0, SEED + i) for i in range(6)]
    sent = np.mean([[bin(b).count("1") for b in t.events[100:]] for _, t in seen]) / 5
    assert 0.40 <= sent <= 0.46
    assert 0.40 <= sum(t.total["sensor"] for _, t in seen) / sum(t.periodic for _, t in seen) <= 0.47
    e = np.concatenate([errors(made, t)[0][100:] for _, t in seen])
    assert np.sqrt(np.mean(e[:, 0] ** 2 + e[:, 2] ** 2)) == pytest.approx(made.mean.rms((0, 2)), rel=0.15)


def test_a_restarted_centre_takes_up_the_time(designs: dict[str, FusionDesign]) -> None:
    """Behind a bus that has been running; its estimate comes near to the others'."""
    made = designs["fusion5"]
    run, _ = ran(made, 20, [], 0.0, SEED)
    late, tick = Tracker(run.native), Tick(run.native, 5)
    drive = noise_drive(made.model, QUIET, 200, SEED)
    sensors = Sensors(made, drive, [], QUIET, SEED)
    for k in range(20, 120):
        for i, sender in enumerate(run.senders):
            frame = sender.step(sensors.read(k)[i])
            if frame is not None:
                for node in (*run.copies, late):
                    node.receive(frame)
        closing = tick.frame(k)
        for node in (*run.copies, late):
            node.receive(closing)
            node.step()
    assert late.value == pytest.approx(run.copies[0].value, abs=0.05)
    assert late.node.k % 16 == 120 % 16


def test_the_comparison_never_beats_periodic(designs: dict[str, FusionDesign], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fusion_compare, "SIZE", fusion_study.Size(30, 250, 0, 0, 0))
    monkeypatch.setattr(fusion_compare, "LOSSES", (0.0, 0.15))
    monkeypatch.setattr(fusion_compare.Compared, "tuned", lambda self, make, rate: make(1.0))  # any threshold will do
    ways = {(w.name, w.loss): w for w in fusion_compare.compare(designs["fusion5"], SEED)}
    assert all(w.error >= 0.99 for w in ways.values())
    own, periodic = (next(w for (name, loss), w in ways.items() if loss == 0.0 and name.startswith(n)) for n in ("this model", "periodic"))
    assert own.bits / periodic.bits < 0.46 and own.error < 1.08
    assert all(w.error > own.error for (name, loss), w in ways.items() if loss == 0.0 and name in ("decimated", "dropped at random", "prediction variance"))


# ---- recordings ----


def test_a_recording_becomes_a_drive(tmp_path: Path, designs: dict[str, FusionDesign]) -> None:
    path, v = tmp_path / "drive.csv", 10.0
    path.write_text("time_s,speed1_mps,speed2_mps,gap2_m\n" + "".join(f"{0.1 * k:.1f},{v},{v},25\n" for k in range(50)))
    drive = recorded_drive(designs["tracking"].model, path)
    assert drive[-1] == pytest.approx([4.9 * v, v, 0.0, 4.9 * v - 25.0, v, 0.0])
    with pytest.raises(InputError, match=r"car_following"):
        recorded_drive(designs["fusion5"].model, path)
    path.write_text("time_s,speed1_mps,gap2_m\n0,1,2\n")
    with pytest.raises(InputError, match=r"column 'speed2_mps' is missing"):
        recorded_drive(designs["tracking"].model, path)


# ---- the command ----


def test_run_detect_and_report(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    ways = [Way(n, p, 0.4, 40.0, 1.1, 1.0) for p in (0.0, 0.05, 0.1, 0.15) for n in ("periodic", "this model: innovation, silence used", "observation trigger, silence unused", "variance about the line")]
    monkeypatch.setattr(fusion_compare, "compare", lambda made: ways)
    out = tmp_path / "run"
    assert main(["run", "fusion5", "--bus", "inprocess", "--samples", "150", "--fault", "x1_m:bias:0.5@100", "--seed", str(SEED), "--json", "--expect", "detect", "--out", str(out)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["faults"][0]["candidates"] == ["x1_m"] and result["copies"]["samples_unequal"] == 0
    page = (out / "report.html").read_text()
    assert "cannot be" in page and "innovation trigger" in page and result["copies"]["digest"] in page
    assert main(["detect", "fusion5", "--log", str(out / "run.log"), "--rest", "--json"]) == 0
    heard = json.loads(capsys.readouterr().out)
    assert heard["digest"] == result["copies"]["digest"], "the log is all that a node needs"
    assert heard["verdicts"][-1]["candidates"] == ["x1_m"]
    (out / "report.html").unlink()
    assert main(["report", str(out)]) == 0 and (out / "report.html").is_file()
    capsys.readouterr()


def test_design_writes_tables_and_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", "fusion5", "--json", "--out", str(tmp_path)]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["reused"] and facts["rate"] == pytest.approx(0.42, abs=1e-3)
    assert facts["delta"] == pytest.approx([0.790, 1.709, 0.398, 0.743, 0.781], abs=2e-3)  # the method's, section 3
    assert facts["silence_is_worth"]["0"] == pytest.approx([0.8086, 0.3470, 0.9484, 0.8292, 0.8127], abs=0.012)
    assert {p.name for p in tmp_path.iterdir()} >= {"fusion5.c", "fusion5.h", "fusion5_config.h", "fusion5.dbc", "fusion5.html"}


@pytest.mark.parametrize("command", [["campaign"], ["limit"], ["monitor", "--log", "x.log"]])
def test_commands_that_cannot_take_it_say_what_can(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command[0], "fusion5", *command[1:]]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and 'kind "fusion"' in err


def test_inject_knows_its_frames(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """A value that was changed on the way, checksum and all, is a bias of its sensor."""
    monkeypatch.setattr("hullguard.fusion_commands._finish", lambda *a: None)
    out, bad = tmp_path / "run", tmp_path / "bad"
    assert main(["run", "fusion5", "--bus", "inprocess", "--samples", "260", "--no-fault", "-q", "--out", str(out), "--seed", str(SEED)]) == 0
    assert main(["inject", "fusion5", "--log", str(out / "run.log"), "--out", str(bad), "-q", "--do", "bias:signal=y1_m,size=2@from=18"]) == 0
    capsys.readouterr()
    assert main(["detect", "fusion5", "--log", str(bad / "injected.log"), "--rest", "--json", "--expect", "detect"]) == 0
    found = [v for v in json.loads(capsys.readouterr().out)["verdicts"] if v["candidates"]]
    assert found[0]["candidates"] == ["y1_m"] and 180 <= found[0]["k"] <= 215


# ---- wrong input ----

BASE: dict[str, Any] = tomllib.loads((SHIPPED / "fusion5.toml").read_text(encoding="utf-8"))
WRONG: list[tuple[str, Any, str]] = [
    ("name", "Fusion", "no name"),
    ("sample_time_s", -1, "outside"),
    ("kind", "linear", "not one of fusion"),
    ("plant.builder", "rocket", "not one of"),
    ("plant.axes", [], "expected names"),
    ("plant.P0", [1, 1, 1, -1], "outside"),
    ("plant.x0", [1, 2], "expected 4 numbers"),
    ("plant.origin", {"x_speed_mps": 8.0}, "cannot be shifted"),
    ("plant.origin", {"z_m": 8.0}, "not one of"),
    ("plant.origin", {"x_m": -8.0}, "above 0"),
    ("sensors.0.sigma", 0, "outside"),
    ("sensors.0.state", "z_m", "not one of"),
    ("sensors.0.encoding", "int8", "not one of"),
    ("sensors.0.frame", {"id": 0x141}, "same identifier"),
    ("sensors.0.frame", {"id": 0x7F0}, "after the tick"),
    ("sensors.0.frame", {"id": 0x140, "protection": "P05"}, "counter of 16 values"),
    ("sensors.0.name", "x2_m", "with a name each"),
    ("sensors.0.name", "tick", "filter's own"),
    ("sensors.0.colour", "red", "unknown key"),
    ("trigger.kind", "telepathy", "not one of"),
    ("trigger.kind", "observation", "needs its thresholds"),
    ("trigger.rate", 0.999, "outside"),
    ("trigger.weight", [0, 0, 0, 0], "all zero"),
    ("trigger.watchdog", 3, "outside"),
    ("trigger.delay", 2, "outside"),
    ("trigger.depth", 15, "outside"),
    ("trigger.late", 0.5, "are for delay = 1"),
    ("scenarios.0.late", 1.5, "outside"),
    ("consistency.limit", 0, "outside"),
    ("verdict.frame", {"id": 0x14F}, "same identifier"),
    ("estimate.frame", {"id": 0x7FE}, "no identifier"),
    ("scenarios.0.faults", ["q_m:dead@3"], "no sensor"),
    ("scenarios.0.drive", "boat", "not one of"),
]


@pytest.mark.parametrize(("key", "value", "said"), WRONG, ids=lambda v: str(v)[:30])
def test_a_wrong_model_is_refused_in_one_line(key: str, value: Any, said: str) -> None:
    data = copy.deepcopy(BASE)
    place: Any = data
    *parents, last = key.split(".")
    for p in parents:
        place = place[int(p)] if p.isdigit() else place[p]
    place[last] = value
    with pytest.raises(InputError, match=said) as error:
        parse_fusion(data, SHIPPED / "fusion5.toml")
    assert "\n" not in str(error.value)


def test_faults_and_kinds() -> None:
    assert str(parse_sensor_fault("x1_m:dead@40")) == "x1_m:dead@40"
    assert str(parse_sensor_fault("x1_m:dead@40..50")) == "x1_m:dead@40..50"
    assert parse_sensor_fault("x1_m:bias:0.5@3").kind == "bias"
    with pytest.raises(InputError, match="ends at 3"):
        parse_sensor_fault("x1_m:dead@4..3")
    assert (kind_of("fusion5"), kind_of("platoon")) == ("fusion", "linear")


def test_other_triggers_and_their_silence() -> None:
    """Each kind makes tables that the library takes, and runs."""
    for overrides in (
        {"trigger.kind": "scheduled"},
        {"trigger.kind": "observation", "trigger.level": [0.02] * 5, "trigger.heartbeat": 20},
        {"trigger.kind": "stochastic", "trigger.level": [1.0] * 5},
        {"trigger.uniform": True},
        {"trigger.silence": False},
        {"trigger.depth": 2, "trigger.delay": 1},
    ):
        if "trigger.level" in overrides:
            overrides = overrides | {"trigger.rate": 0.4}
        data = copy.deepcopy(BASE)
        for key, value in overrides.items():
            if key != "trigger.rate":
                data["trigger"][key.split(".")[1]] = value
        if "level" in data["trigger"]:
            del data["trigger"]["rate"], data["trigger"]["weight"]
        made = design_fusion(parse_fusion(data, Path("nowhere.toml")))[0]
        scenario = FusionScenario("t", 200, "noise", 0.05, 0.3, -1, (), ())
        drive = noise_drive(made.model, scenario, 200, SEED)
        run = Run(made, TrackerNative(library("f32"), made.tables), InProcess(), start=REST)
        trace = run.samples(drive, Sensors(made, drive, [], scenario, SEED), 200)
        assert trace.unequal == 0 and 0 < trace.counts["sensor"] < 1000
