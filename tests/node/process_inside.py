"""Run inside with-vcan by test_node_process.py: detector_node and the commands on a bus, with whatever may come along it."""

from __future__ import annotations

import contextlib
import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hullguard.bus.candump import BRS, EXTENDED, FD, REMOTE
from hullguard.core.native import Frame
from hullguard.errors import BusError
from inside_support import (
    Drive,
    collect,
    detect,
    exchange,
    health,
    link,
    node,
    ready,
    silent,
)
from node_support import NODE, command, hullguard

ALARMS = ("provisional", "confirmed")
NEVER = ("--period", "3600000")  # without lockstep, but the deadline does not come during a test


def alarmed(verdicts: list, state: str) -> bool:
    return any(v.plant == state for v in verdicts)


# ---- start and end ----


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=lambda n: n.name)
@pytest.mark.parametrize("options", [("--lockstep",), ("--rest",), ()], ids=lambda o: "".join(o) or "timed")
@pytest.mark.parametrize("traffic", [False, True], ids=["silent", "traffic"])
def test_a_signal_ends_it_cleanly(number: signal.Signals, options: tuple[str, ...], traffic: bool, tmp_path: Path) -> None:
    missed = tmp_path / "missed"
    with link() as bus, node("--status", "--timing", missed, *options) as n:
        if traffic:
            drive = Drive()
            for _ in range(5):
                frames, tick = drive.sample()
                for f in [*frames, tick]:
                    bus.send(f)
            collect(bus, {drive.verdict_id}, 1)
        n.stop(number)
    assert (n.status, n.err) == (0, "")
    assert n.lines[-1].startswith("k=") and missed.read_text().startswith("# samples ")


def test_it_ends_after_its_samples() -> None:
    drive = Drive()
    with link() as bus, node("--lockstep", "--rest", "--samples", 7) as n:
        for _ in range(7):
            frames, tick = drive.sample()
            exchange(bus, drive, [*frames, tick])
        n.wait()
    assert (n.status, n.err) == (0, "")


def test_a_timing_file_that_cannot_be_written_is_status_1(tmp_path: Path) -> None:
    with node("--timing", tmp_path / "no" / "such" / "file") as n:
        n.stop()
    assert n.status == 1 and re.fullmatch(r"detector_node: [^\n]+\n", n.err)


def test_an_interface_that_goes_down_and_comes_back() -> None:
    drive = Drive()
    with link("vcan1") as bus, node("--interface", "vcan1", "--lockstep", "--rest", "--status") as n:
        for k in range(40):
            if k == 20:
                subprocess.run(["ip", "link", "set", "vcan1", "down"], check=True)
                time.sleep(0.1)
                subprocess.run(["ip", "link", "set", "vcan1", "up"], check=True)
                time.sleep(0.1)
                with contextlib.suppress(BusError):  # this end's socket tells once that its interface was down
                    bus.receive(0.0)
            frames, tick = drive.sample()
            exchange(bus, drive, [*frames, tick])
        n.stop()
    assert n.status == 0 and "can=active" in n.lines[-1]


# ---- what it says ----


def test_heartbeat_and_verdict_on_change() -> None:
    """Free running: a verdict frame when the record changes, one and a status frame every ten samples; nothing else."""
    drive = Drive(faults=("controller2:bias:3@60..75",))
    heartbeat, bits = drive.native.tables.heartbeat, drive.design.tables.hash
    verdicts, expected, last = [], [], Frame(0x110, 0, bytes(8))
    with link() as bus, node("--rest", *NEVER) as n:
        for _ in range(160):
            frames, tick = drive.sample()
            last = frames[0] if frames else last
            sent = [*frames, tick]
            if drive.k - 1 in (33, 57, 101):  # a damaged frame: the bus is no longer good
                sent.insert(0, Frame(last.id, last.flags, bytes(8)))
            made, answers = drive.take(sent, lockstep=False)
            verdicts, expected = verdicts + made, expected + answers
            for f in sent:
                bus.send(f)
        got = collect(bus, {drive.verdict_id, drive.status_id}, len(expected))
        assert silent(bus, {drive.verdict_id, drive.status_id})
        n.stop()
    assert got == expected
    told = [drive.told(f) for f in got if f.id == drive.verdict_id]
    assert not any(v.reply for v in told)
    records = [(v.plant, v.candidates, v.bus, v.refused) for v in verdicts]
    change = [k for k in range(160) if k == 0 or records[k] != records[k - 1]]
    assert [v.k for v in told] == sorted(set(change) | set(range(0, 160, heartbeat)))
    assert [(v.plant, v.candidates, v.bus, v.refused) for v in told] == [records[v.k] for v in told]
    assert len(set(change) - set(range(0, 160, heartbeat))) >= 2, "the run changes between heartbeats"
    status = [f for f in got if f.id == drive.status_id]
    assert [f.data[1] >> 4 for f in status] == [k % 16 for k in range(0, 160, heartbeat)]
    assert {int.from_bytes(f.data[2:6], "little") for f in status} == {bits}


@pytest.mark.parametrize("model", ["platoon", "openacc"])
def test_the_model_hash_is_the_same_everywhere(model: str) -> None:
    drive = Drive(model, "default")
    listed = dict(line.split() for line in command([str(NODE["f32"]), "--list"]).stdout.splitlines())
    assert listed[model] == f"{drive.design.tables.hash:08x}"
    with link() as bus, node("--model", model, "--lockstep", "--rest"):
        frames, tick = drive.sample()
        for f in [*frames, tick]:
            bus.send(f)
        (status,) = collect(bus, {drive.status_id}, 1)
    assert f"{int.from_bytes(status.data[2:6], 'little'):08x}" == listed[model]


# ---- what is lost or spoilt ----


@pytest.mark.parametrize("missing", [1, 2, 7])
def test_ticks_dropped_in_lockstep(missing: int) -> None:
    """The next tick closes the samples of the missing ones too: their bus health has changed, so each step is told, and the count goes on."""
    drive = Drive("platoon", "rest")
    told = []
    with link() as bus, node("--lockstep", "--rest", "--status") as n:
        for k in range(60):
            frames, tick = drive.sample()
            if 30 <= k < 30 + missing:
                for f in frames:
                    bus.send(f)
                drive.take(frames)
                continue
            verdicts = exchange(bus, drive, [*frames, tick])
            told += verdicts
            if k == 30 + missing:
                assert [v.k for v in verdicts] == list(range(30, 31 + missing))
                assert all(v.bus[1] != "good" for v in verdicts[:-1]), "the samples without a tick say so"
        n.stop()
    assert [v.k for v in told] == list(range(60))
    assert not alarmed(told, "confirmed")
    assert health(n)["control"]["lost"] == missing and n.status == 0


def spoilt(good: Frame) -> dict[str, Frame]:
    """Everything that a measurement frame can become, and is not."""
    number = int.from_bytes(good.data, "little")
    out = {f"bit {i}": Frame(good.id, good.flags, (number ^ 1 << i).to_bytes(8, "little")) for i in range(64)}
    out |= {f"length {n}": Frame(good.id, good.flags, good.data[:n]) for n in range(8)}
    out["again"] = good  # length 8: a duplicate
    out |= {f"fd {n}": Frame(good.id, good.flags | FD, (good.data * 8)[:n]) for n in (8, 12, 64)}
    out["fd brs"] = Frame(good.id, good.flags | FD | BRS, good.data)
    out["remote"] = Frame(good.id, good.flags | REMOTE, b"")
    out["extended"] = Frame(good.id, good.flags | EXTENDED, good.data)
    out["extended remote"] = Frame(good.id, good.flags | EXTENDED | REMOTE, b"")
    out["zeros"] = Frame(good.id, good.flags, bytes(8))
    out["ones"] = Frame(good.id, good.flags, b"\xff" * 8)
    return out


FILTERED = ("remote", "extended", "extended remote")  # not for this node: its filter keeps them away


@pytest.mark.parametrize("place", ["between", "instead"])
def test_spoilt_measurements_are_no_plant_fault(place: str) -> None:
    """`between` two good frames: a sample with a spoilt frame beside the good one, if any. `instead`: in place of the good one."""
    samples = 1400
    drive = Drive("platoon", "manoeuvres", (f"controller2:bias:3@{samples - 100}",))
    kinds, last, states, doubted, bad, sent = [], None, [], 0, 0, 0
    with link() as bus, node("--lockstep", "--rest", "--status") as n:
        for k in range(samples):
            frames, tick = drive.sample()
            if frames:
                last, sent = frames[0], sent + 1
            # In every second sample, or in place of every third frame.
            wanted = k % 2 == 0 if place == "between" else bool(frames) and sent % 3 == 0
            if wanted and last is not None and 40 <= k < samples - 140:
                every = spoilt(last)
                name = list(every)[len(kinds) % len(every)]
                kinds.append(name)
                bad += name not in (*FILTERED, "again")
                frames = [every[name], *frames] if place == "between" else [every[name]]
            verdicts = exchange(bus, drive, [*frames, tick])
            states += verdicts
            doubted += any(v.bus[0] != "good" for v in verdicts)
        n.stop()
    healthy, faulty = states[: samples - 100], states[samples - 100 :]
    assert set(kinds) == set(spoilt(Frame(0x110, 0, bytes(8)))), "every kind was sent"
    assert not alarmed(healthy, "confirmed")
    assert alarmed(faulty, "confirmed"), "a fault afterwards is found"
    row = health(n)["measurement"]
    assert row["refused"] >= bad, row
    assert doubted >= bad / 2, "the bus health in the verdicts shows it"
    assert n.status == 0


def test_spoilt_ticks_are_no_plant_fault() -> None:
    """The closing frame itself, spoilt in every bit: the sample is closed by the next good one."""
    drive = Drive("platoon", "rest")
    states = []
    with link() as bus, node("--lockstep", "--rest", "--status") as n:
        for k in range(64 * 6):
            frames, tick = drive.sample()
            if k % 6 == 5:
                tick = list(spoilt(tick).values())[k // 6]
            states += exchange(bus, drive, [*frames, tick])
        frames, tick = drive.sample()
        states += exchange(bus, drive, [*frames, tick])
        n.stop()
    assert [v.k for v in states] == list(range(64 * 6 + 1))
    assert not alarmed(states, "confirmed")
    assert health(n)["control"]["refused"] == 64


def test_frames_of_strangers_change_nothing() -> None:
    drive = Drive("platoon", "rest")
    with link() as bus, node("--lockstep", "--rest", "--status") as n:
        for k in range(50):
            frames, tick = drive.sample()
            for i in range(8):
                bus.send(Frame((0x400 + 37 * k + i) & 0x7FF | 0x400, 0, bytes([k, i])))
                bus.send(Frame(0x110 + (i << 18), EXTENDED, bytes(8)))
            bus.send(Frame(drive.verdict_id, 0, bytes(8)))
            verdicts, expected = drive.take([*frames, tick])
            for f in [*frames, tick]:
                bus.send(f)
            assert collect(bus, {drive.verdict_id, drive.status_id}, len(expected)) == expected
            assert verdicts[-1].bus == ("good", "good")
        n.stop()
    assert all(row["refused"] == row["lost"] == 0 for row in health(n).values())


def test_a_stopped_node_is_no_plant_fault() -> None:
    """Stopped while 16 samples pass unsent: to their stamps nothing has happened, and only the clock tells that much has."""
    period_s, at, samples = 0.03, range(60, 300, 60), 460
    drive = Drive("platoon", "manoeuvres", (f"controller2:bias:3@{samples - 100}",))
    got: list[Frame] = []
    with link() as bus, node("--rest", "--status", "--period", period_s * 1000) as n:
        for k in range(samples):
            if k in at:
                n.popen.send_signal(signal.SIGSTOP)
                for _ in range(16):
                    drive.sample()
                time.sleep(16 * period_s)
            frames, tick = drive.sample()
            for f in [*frames, tick]:
                bus.send(f)
            if k in at:
                n.popen.send_signal(signal.SIGCONT)
            while (told := bus.receive(0.001)) is not None:
                got.append(told[0])
        n.stop()
    confirmed = [v.k for v in (drive.told(f) for f in got if f.id == drive.verdict_id) if v.plant == "confirmed"]
    assert n.status == 0 and f" outages={len(at)} " in n.lines[-1]
    # The node's samples lag: what it never heard of, and 16 at a time, it has not counted.
    assert confirmed and confirmed[0] >= samples - 100 - 16 * len(at), f"a fault is found, and none before it: {confirmed[:1]}"


# ---- together ----


def test_two_nodes_on_one_bus() -> None:
    platoon, openacc = Drive("platoon", "default", ("controller2:bias:3@60",)), Drive("openacc", "default", ("gap3_m:bias:3@90",))
    seen: dict[str, list] = {"platoon": [], "openacc": []}
    ids = {platoon.verdict_id, platoon.status_id, openacc.verdict_id, openacc.status_id}
    with link() as bus, node("--model", "platoon", "--lockstep", "--rest", "--status") as a, node("--model", "openacc", "--lockstep", "--rest", "--status") as b:
        for _ in range(150):
            together, expected = [], []
            for name, drive in (("platoon", platoon), ("openacc", openacc)):
                frames, tick = drive.sample()
                verdicts, answers = drive.take([*frames, tick])
                together.append([*frames, tick])
                expected += answers
                seen[name] += verdicts
            long = max(len(t) for t in together)
            for i in range(long):  # frame by frame in turn
                for t in together:
                    if i < len(t):
                        bus.send(t[i])
            got = collect(bus, ids, len(expected))
            for drive in (platoon, openacc):
                own = {drive.verdict_id, drive.status_id}
                assert [f for f in got if f.id in own] == [f for f in expected if f.id in own]
        a.stop()
        b.stop()
    assert (a.status, b.status) == (0, 0)
    for name, start in (("platoon", 60), ("openacc", 90)):
        assert not alarmed(seen[name][:start], "provisional") and alarmed(seen[name][start:], "confirmed"), name
    for n in (a, b):
        assert all(row["refused"] == row["lost"] == 0 for row in health(n).values())


ON_BUS = ("-i", "socketcan", "-c", "vcan0")


@pytest.mark.parametrize("other", ["detect", "detector_node"])
def test_plant_and_node_by_hand(other: str) -> None:
    started = detect("platoon", *ON_BUS, "--lockstep", "--rest", "--ready", "--json") if other == "detect" else node("--lockstep", "--rest")
    with started as n:
        plant = command(hullguard("plant", "platoon", *ON_BUS, "--lockstep", "--speed", "max", "--json"), timeout_s=30)
        n.stop()
    assert plant.returncode == 0, plant.stderr
    result = json.loads(plant.stdout)
    assert result["faults"][0]["confirmed_at"] is not None and result["false_alarms"] == {"provisional": 0, "confirmed": 0}
    assert n.status == 0
    if other == "detect":
        told = json.loads(n.lines[-1])
        assert told["verdicts"] == result["verdicts"] and told["samples"] == result["samples"]
        assert told["communication"] | {"unknown": 0} == result["communication"]


def test_plant_notices_a_node_that_says_something_else() -> None:
    with node("--lockstep"):  # without --rest it knows less
        plant = command(hullguard("plant", "platoon", *ON_BUS, "--lockstep", "--speed", "max", "--scenario", "rest"), timeout_s=30)
    assert plant.returncode == 1
    assert re.fullmatch(r"hullguard: the node's verdicts differ[^\n]*\n", plant.stderr)


def test_plant_without_a_node_says_so() -> None:
    """Ten seconds of patience, shortened here; the message names the cure."""
    code = "import hullguard.plant.run as r, sys; r.ANSWER_TIMEOUT_S = 0.3; from hullguard.cli import main; sys.exit(main(sys.argv[1:]))"
    done = command([sys.executable, "-c", code, "plant", "platoon", *ON_BUS, "--lockstep", "--speed", "max"])
    assert done.returncode == 3 and re.fullmatch(r"hullguard: [^\n]*did not answer sample 0[^\n]*--lockstep[^\n]*\n", done.stderr)


def test_detect_listens_and_says_nothing_on_the_bus() -> None:
    drive = Drive("platoon", "default", ("controller2:bias:3@60",))
    verdicts = []
    with link() as bus, detect("platoon", *ON_BUS, "--rest", "--lockstep", "--listen", "--ready", "--json", "--samples", 120) as n:
        for _ in range(120):
            frames, tick = drive.sample()
            verdicts += drive.take([*frames, tick])[0]
            for f in [*frames, tick]:
                bus.send(f)
        n.wait(20)
        assert silent(bus, {drive.verdict_id, drive.status_id}, 0.3)
    assert n.status == 0, n.err
    told = json.loads(n.lines[-1])
    assert told["samples"] == 120
    changes = [v for i, v in enumerate(verdicts) if i == 0 or (v.plant, v.bus) != (verdicts[i - 1].plant, verdicts[i - 1].bus)]
    assert [(c["k"], c["plant"], tuple(c["bus"].values())) for c in told["verdicts"]] == [(v.k, v.plant, v.bus) for v in changes]
    assert alarmed(changes, "confirmed")


def test_detect_ends_by_signal() -> None:
    with detect("platoon", *ON_BUS, "--ready", "--json") as n:
        n.stop(signal.SIGINT)
    assert n.status == 0, n.err
    assert json.loads(n.lines[-1])["model_hash"] == f"{ready()[0].tables.hash:08x}"
