"""What the monitor knows, against the run that wrote the log; its lines, its options. The view has tests of its own."""

from __future__ import annotations

import csv
import json
import random
import socket
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import can
import pytest
from can.interfaces.socketcan.socketcan import build_can_frame
from host_support import SEED, Cli, classic_bits
from hullguard.bus import candump, overflow
from hullguard.bus.candump import BRS, ERROR, EXTENDED, FD, REMOTE, Entry
from hullguard.bus.link import to_message
from hullguard.core.library import library
from hullguard.core.native import MOVING, REST, Frame, Native
from hullguard.design.design import Design, design
from hullguard.model import load_model
from hullguard.monitor import error_frames, feed, rows
from hullguard.monitor.group import GroupWatch
from hullguard.monitor.load import BINS, BusLoad
from hullguard.monitor.plain import Lines
from hullguard.monitor.snapshot import ChangeSeen
from hullguard.monitor.state import Monitor

MODELS = ("platoon", "openacc", "platoon_bank")


@pytest.fixture(scope="module")
def made() -> dict[str, tuple[Design, Native]]:
    designs = {name: design(load_model(name))[0] for name in MODELS}
    return {name: (d, Native(library("f32"), d.tables)) for name, d in designs.items()}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    from hullguard.cli import main

    out = {name: tmp_path_factory.mktemp(name) for name in MODELS}
    for name, folder in out.items():
        assert main(["run", name, "--bus", "inprocess", "--out", str(folder), "--seed", str(SEED), "-q"]) == 0
    return out


def entries(folder: Path) -> list[Entry]:
    return list(candump.read(folder / "run.log"))


def monitor(made: tuple[Design, Native], start: int = REST, changes: list[ChangeSeen] | None = None) -> Monitor:
    d, native = made
    return Monitor(d, native, start, "test", d.model.sample_time_s, None if changes is None else changes.append)


def fed(m: Monitor, log: list[Entry]) -> Monitor:
    feed.watch_log(m, log, float("inf"), 0, lambda now: False)
    return m


@pytest.mark.parametrize("name", MODELS)
def test_values_radii_residuals_and_thresholds_are_the_runs(name: str, made: dict[str, tuple[Design, Native]], runs: dict[str, Path]) -> None:
    m = monitor(made[name])
    with (runs[name] / "signals.csv").open() as file:
        expected = list(csv.DictReader(file))
    seen = 0
    for entry in entries(runs[name]):
        if not m.note(entry.frame, entry.time_s):
            continue
        before = m.samples
        m.take(entry.frame, entry.time_s)
        if m.samples == before:
            continue
        row, s = expected[seen], m.snapshot()
        seen += 1
        assert s.monitor is not None and s.monitor.k == int(row["k"])
        for x in s.signals:
            assert f"{x.value:.9g}" == row[f"{x.name}.value"] and f"{x.radius:.9g}" == row[f"{x.name}.radius"]
        for x in s.residuals:
            assert f"{x.r:.9g}" == row[f"r{x.column}"] and f"{x.J:.9g}" == row[f"J{x.column}"]
            assert x.ratio == abs(x.r) / x.J <= x.most
    assert seen == len(expected)


@pytest.mark.parametrize("name", MODELS)
def test_verdicts_load_and_intervals_are_the_runs(name: str, made: dict[str, tuple[Design, Native]], runs: dict[str, Path]) -> None:
    changes: list[ChangeSeen] = []
    s = fed(monitor(made[name], REST, changes), entries(runs[name])).snapshot()
    run = json.loads((runs[name] / "run.json").read_text())
    for who in ("monitor", "ecu"):
        said = [(c.k, rows_plant(c.text)) for c in changes if c.what == who]
        assert said == [(v["k"], rows_plant(said_in(v))) for v in run["verdicts"]], "the same changes at the same samples, by the node too"
    assert s.monitor is not None and s.ecu.verdict == s.monitor
    assert s.monitor.candidates == tuple(run["verdicts"][-1]["candidates"]) and s.monitor.bus == run["verdicts"][-1]["bus"]
    assert (s.ecu.agrees, s.ecu.model, s.ecu.hash, s.ecu.damaged) == (True, "match", run["model_hash"], 0)
    frames = run["frames"]
    assert s.load.bits == frames["bits"] + frames["bits_lockstep_replies"] and s.load.reply_bits == frames["bits_lockstep_replies"]
    assert s.ecu.replies == frames["lockstep_replies"]
    assert s.load.mean == pytest.approx(s.load.bits / (run["samples"] * run["sample_time_s"] * run["bitrate"]), rel=1e-12)
    assert s.load.bound == frames["load_bound"]
    for g in s.groups:
        told = run["per_group"][g.name]
        i = g.intervals
        assert (g.frames, i.least, i.most, i.mean) == (told["frames"], told["interval_min"], told["interval_max"], told["interval_mean"])
        assert {str(k): v for k, v in i.histogram.items()} == told["histogram"]
    total = {name: sum(g.counters[name] for g in s.groups) for name in s.groups[0].counters}
    assert total | {"unknown": s.unknown, "overdue": s.overdue} == run["communication"]
    assert s.ended and s.frames == frames["total"] + frames["lockstep_replies"]


def said_in(v: dict[str, Any]) -> str:
    return f"plant {v['plant']}, may be {', '.join(v['candidates'])}" if v["candidates"] else f"plant {v['plant']}"


def rows_plant(text: str) -> str:
    return text.partition(";")[0]


def test_load_without_lockstep_is_the_runs(made: dict[str, tuple[Design, Native]], tmp_path: Path, cli: Cli) -> None:
    """Replies to ticks are on the bus, but no part of a run's figures; in real time there are none."""
    assert cli("run", "platoon", "--bus", "inprocess", "--speed", "1000", "--samples", 200, "--out", tmp_path, "-q").status == 0
    log, run = [], json.loads((tmp_path / "run.json").read_text())
    d, native = made["platoon"]
    m = monitor(made["platoon"])
    for e in entries(tmp_path):
        before = m.ecu.replies
        wanted = m.note(e.frame, e.time_s)
        if wanted:
            m.take(e.frame, e.time_s)
        if m.ecu.replies == before:
            log.append(e)
    s = fed(monitor((d, native)), log).snapshot()
    assert s.load.reply_bits == 0 and s.load.bits == run["frames"]["bits"]
    assert s.load.mean == pytest.approx(run["frames"]["load_mean"], rel=1e-12)
    assert s.load.p99 == pytest.approx(run["frames"]["load_p99"], rel=1e-12)
    assert s.load.peak >= s.load.p99 >= s.load.mean


def test_load_of_known_bits() -> None:
    load = BusLoad(0.01, 100_000)  # 1000 bits a bin
    for k in range(300):
        load.add(100.0 + 0.01 * k, 100 if k < 200 else 1000)
    load.finish()
    assert load.mean == pytest.approx((200 * 100 + 100 * 1000) / 300_000)
    assert load.now == load.peak == 1.0
    assert load.p99 == pytest.approx(0.1 + 0.9 * 0.98), "the third largest of 201 windows, 98 of whose bins are full"
    load.move(103.5)
    assert load.now == pytest.approx(0.5), "half a second of silence"
    load.add(103.0, 7)  # a stamp that steps back
    load.move(1e6)
    assert load.now == 0.0 and load.peak == 1.0 and load.mean < 0.001
    load.add(1e6 + 0.01 * BINS * 3, 500)
    load.finish()
    assert load.now == pytest.approx(500 / 100_000)


def test_a_monitor_that_begins_in_the_middle(made: dict[str, tuple[Design, Native]], runs: dict[str, Path]) -> None:
    """It counts samples from another one, knows less at first, then says the same; no interval spans what it has not seen."""
    log = entries(runs["platoon"])
    first = random.Random(SEED).randrange(60, 300)
    s = fed(monitor(made["platoon"], MOVING), log[first:]).snapshot()
    run = json.loads((runs["platoon"] / "run.json").read_text())
    assert s.monitor is not None and s.monitor.plant == run["verdicts"][-1]["plant"] and s.ecu.agrees
    for g in s.groups:
        told = run["per_group"][g.name]
        assert g.intervals.least is not None and g.intervals.least >= told["interval_min"] and g.intervals.most == told["interval_max"]
        assert g.lost_bus == g.lost_host == 0


@pytest.mark.parametrize("samples", [30, 32])
def test_no_interval_spans_an_outage(samples: int, made: dict[str, tuple[Design, Native]], runs: dict[str, Path]) -> None:
    """Whether or not the stamps are alike on both sides of it."""
    log = [e for e in entries(runs["platoon"]) if not 9.95 < e.time_s < 9.95 + samples * 0.1]
    s = fed(monitor(made["platoon"]), log).snapshot()
    run = json.loads((runs["platoon"] / "run.json").read_text())
    assert s.outages == 1
    for g in s.groups:
        assert g.intervals.most == run["per_group"][g.name]["interval_max"]
        frames = sum(e.frame.id == g.id for e in log)
        assert sum(g.intervals.histogram.values()) <= frames - 2, "one interval fewer than frames, on each side"


def test_losses_on_the_bus_and_by_the_host_are_told_apart(made: dict[str, tuple[Design, Native]], runs: dict[str, Path]) -> None:
    """Frames are taken out of a log; for one half of the gaps the host's count rises by what is missing, as the kernel tells it."""
    log, rng = entries(runs["platoon"]), random.Random(SEED)
    d = made["platoon"][0]
    id_ = d.tables.groups[0].message.id
    places = [i for i, e in enumerate(log) if e.frame.id == id_]
    gone = {i: rng.random() < 0.5 for i in rng.sample(places[3:-3], 12)}  # the first tells nothing, a last one is told by the next
    m, dropped, lost = monitor(made["platoon"]), 0, {"bus": 0, "host": 0}
    m.dropped = 0
    for i, e in enumerate(log):
        if i in gone:
            dropped += gone[i]
            lost["host" if gone[i] else "bus"] += 1
            continue
        m.dropped = dropped
        if m.note(e.frame, e.time_s):
            m.take(e.frame, e.time_s)
    s = m.snapshot()
    assert s.groups[0].counters["lost"] == 12 == s.lost_bus + s.lost_host
    assert (s.lost_bus, s.lost_host, s.host_dropped) == (lost["bus"], lost["host"], lost["host"])
    assert s.groups[1].lost_bus == s.groups[1].lost_host == 0


def test_what_the_host_can_explain_and_what_it_cannot(made: dict[str, tuple[Design, Native]]) -> None:
    g = GroupWatch(made["platoon"][0].tables.groups[0])
    g.lost(0, 0)
    g.lost(3, 2)
    assert (g.lost_bus, g.lost_host) == (1, 2)
    g.lost(2, 2)
    assert (g.lost_bus, g.lost_host) == (3, 2), "a count that has not risen explains nothing"
    g.lost(0, 50)
    g.lost(1, 50)
    assert (g.lost_bus, g.lost_host) == (4, 2), "frames of others, dropped before a frame that continues its counter, explain nothing later"
    g.lost(0, 0xFFFFFFFF)
    g.lost(2, 1)
    assert (g.lost_bus, g.lost_host) == (4, 4), "the kernel's count runs round"
    g.lost(0, None)
    g.lost(1, None)
    assert (g.lost_bus, g.lost_host) == (5, 4), "an interface that does not tell"


def test_another_model_a_silent_ecu_strangers_and_damage(made: dict[str, tuple[Design, Native]], runs: dict[str, Path]) -> None:
    d, native = made["platoon"]
    changes: list[ChangeSeen] = []
    m = monitor((d, native), REST, changes)
    log = entries(runs["platoon"])
    fed(m, [e for e in log if e.time_s < 5.0])
    stranger = [Frame(0x7DF, 0, b"\1\2"), Frame(0x7DF, 0, b"\1\2"), Frame(d.tables.groups[0].message.id, EXTENDED, bytes(8))]
    for frame in stranger:
        assert not m.note(frame, 5.0)
    s = m.snapshot()
    assert s.unknown == 3 and s.unknown_ids == {"7DF": 2, f"{stranger[2].id:08X}": 1}
    status = next(e.frame for e in log if e.frame.id == d.tables.status.id)
    m.note(replace(status, data=status.data[:2] + b"\xff" + status.data[3:]), 5.0)
    assert m.snapshot().ecu.damaged == 1 and m.snapshot().ecu.model == "match", "a damaged status frame says nothing"
    assert m.snapshot().ecu.state == "speaking"
    m.move(5.0 + 3 * d.tables.heartbeat * d.model.sample_time_s + 0.1)
    s = m.snapshot()
    assert s.ecu.state == "silent" and changes[-1].text == "silent"
    assert "SILENT" in rows.head(s, "LIVE")[1].text
    other = design(load_model("platoon", {"groups.measurement.trigger.silence": 1}))[0]
    tables = replace(other.tables, verdict=d.tables.verdict, status=d.tables.status)
    s = fed(Monitor(other, Native(library("f32"), tables), REST, "test"), log).snapshot()
    assert tables.hash != d.tables.hash and s.ecu.model == "other" and s.ecu.hash == f"{d.tables.hash:08x}"
    assert "RUNS ANOTHER MODEL" in rows.head(s, "LIVE")[1].text


def test_a_broken_bus_is_no_broken_plant(made: dict[str, tuple[Design, Native]], runs: dict[str, Path]) -> None:
    """A sender that falls silent, samples without closing frames: the bus is stale, the plant is not accused."""
    d = made["platoon"][0]
    m = fed(monitor(made["platoon"]), [e for e in entries(runs["platoon"]) if e.time_s < 10.0])
    for _ in range(20):
        m.overdue()
    s = m.snapshot()
    assert s.monitor is not None and s.monitor.plant == "none" and set(s.monitor.bus.values()) == {"stale"}
    assert s.overdue == 20
    text = [r.text for r in rows.head(s, "LIVE")]
    assert "no fault" in text[2] and "all senders STALE" in text[3] and len(text) == 4
    assert d.model.name in text[0]


ERRORS = [
    (Frame(0x40, ERROR, bytes(8)), "bus-off", ("bus-off",)),
    (Frame(0x4, ERROR, bytes([0, 0x20, 0, 0, 0, 0, 0, 0])), "error passive (transmit)", ("error passive (transmit)",)),
    (Frame(0x4, ERROR, bytes([0, 0x10, 0, 0, 0, 0, 0, 0])), "error passive (receive)", ("error passive (receive)",)),
    (Frame(0x4, ERROR, bytes([0, 0x04, 0, 0, 0, 0, 0, 0])), "warning (receive)", ("warning (receive)",)),
    (Frame(0x88, ERROR, bytes([0, 0, 0x04, 0, 0, 0, 0, 0])), "error active", ("bus error", "stuff error")),
    (Frame(0x20, ERROR, b""), "error active", ("no acknowledge",)),
    (Frame(0x0, ERROR, b""), "error active", ("unspecified error",)),
    (Frame(0x4, ERROR, bytes(8)), "error active", ("controller problem",)),
]


@pytest.mark.parametrize(("frame", "state", "said"), ERRORS)
def test_error_frames_in_words(frame: Frame, state: str, said: tuple[str, ...], made: dict[str, tuple[Design, Native]]) -> None:
    assert error_frames.words(frame) == said
    changes: list[ChangeSeen] = []
    m = monitor(made["platoon"], REST, changes)
    assert not m.note(frame, 1.0)
    s = m.snapshot()
    assert (s.errors.state, s.errors.frames, s.errors.kinds, s.load.bits, s.unknown) == (state, 1, dict.fromkeys(said, 1), 0, 0)
    assert [c.text for c in changes] == ([state] if state != "error active" else [])
    head = " ".join(r.text[10:50].strip() for r in rows.head(s, "LIVE")[3:])
    assert (state.upper() in head) == (state != "error active")


def test_a_controller_comes_back(made: dict[str, tuple[Design, Native]]) -> None:
    e = error_frames.ErrorFrames()
    assert e.take(Frame(0x240, ERROR, bytes([0, 0, 0, 0, 0, 0, 248, 3]))) and e.state == "bus-off"
    assert e.last == "bus-off, error counters 248 transmit 3 receive"
    assert not e.take(Frame(0x4, ERROR, bytes([0, 0x20, 0, 0, 0, 0, 0, 0]))) and e.state == "bus-off", "what is off is not passive"
    assert e.take(Frame(0x100, ERROR, bytes(8))) and e.state == "error active"
    e.clear()
    assert e.count == 0


@pytest.mark.parametrize(
    "frame",
    [
        Frame(0x123, 0, b"\1\2\3"),
        Frame(0x1ABCDEF0, EXTENDED, bytes(range(8))),
        Frame(0x12, REMOTE, b""),
        Frame(0x3FF, FD, bytes(range(12))),
        Frame(0x1ABCDEF0, EXTENDED | FD | BRS, bytes(64)),
    ],
)
def test_the_kernels_frames_are_read_as_python_can_writes_them(frame: Frame) -> None:
    assert overflow.parse(bytes(build_can_frame(to_message(frame)))) == frame


def test_error_frames_of_the_kernel_keep_class_and_data() -> None:
    raw = struct.pack("=IBB2x8s", 0x20000000 | 0x44, 8, 0, bytes(range(8)))
    assert overflow.parse(raw) == Frame(0x44, ERROR, bytes(range(8)))


def test_ancillary_data() -> None:
    stamp, count = struct.pack("@ll", 17, 500_000_000), struct.pack("@I", 4_000_000_000)
    items = [(socket.SOL_SOCKET, overflow.SO_TIMESTAMPNS, stamp), (socket.SOL_SOCKET, overflow.SO_RXQ_OVFL, count), (1234, overflow.SO_RXQ_OVFL, b"")]
    assert overflow.ancillary(items) == (17.5, 4_000_000_000)
    assert overflow.ancillary([]) == (None, None)


def test_other_interfaces_do_not_tell_host_losses(made: dict[str, tuple[Design, Native]], runs: dict[str, Path]) -> None:
    """Over python-can's virtual bus; unknown frames among the model's."""
    m = monitor(made["platoon"])
    log = entries(runs["platoon"])[:60]
    with can.Bus(interface="virtual", channel="monitor") as end, can.Bus(interface="virtual", channel="monitor") as other:
        for e in log:
            other.send(to_message(e.frame))
            other.send(to_message(Frame(0x7AA, 0, b"")))
        feed.watch_bus(m, end, False, 0, lambda now: m.frames == 120)
    s = m.snapshot()
    assert s.host_dropped is None and s.unknown == 60 and s.unknown_ids == {"7AA": 60} and s.samples > 10
    assert s.load.bits == sum(classic_bits(e.frame) for e in log) + 60 * classic_bits(Frame(0x7AA, 0, b""))
    assert any("not known" in r.text for r in rows.bus_rows(s))


def test_all_rows_are_as_wide_as_they_should_be(made: dict[str, tuple[Design, Native]], runs: dict[str, Path]) -> None:
    """Before the first frame, in the middle, and with counts that have grown long."""
    for name in MODELS:
        m = monitor(made[name])
        snapshots = [m.snapshot(), fed(m, entries(runs[name])).snapshot()]
        big = snapshots[1]
        groups = tuple(replace(g, frames=10**9, lost_bus=123456, lost_host=10**12, age_s=1e6, rate_hz=12345.6, extended=True, name="a_name_that_is_long") for g in big.groups)
        signals = tuple(replace(x, value=-1.23456e300, radius=1e38, name="n" * 40) for x in big.signals)
        snapshots.append(replace(big, groups=groups, signals=signals, unknown_ids={f"{i:03X}": i for i in range(64)}))
        for s in snapshots:
            assert {sum(len(c.text) for c in r.cells) for r in [*rows.plant_rows(s), *rows.bus_rows(s)]} == {rows.BODY}
            for width in (rows.WIDTH, 133):
                assert {sum(len(c.text) for c in r.cells) for r in rows.head(s, "LIVE", width)} == {width}
            assert len(rows.bus_rows(s)) == len(rows.bus_rows(snapshots[0])), "what changes does not move what stands below it"


def test_no_clear_of_figures_touches_what_is_known_of_the_plant(made: dict[str, tuple[Design, Native]], runs: dict[str, Path]) -> None:
    m = fed(monitor(made["platoon"]), entries(runs["platoon"]))
    before = m.snapshot()
    m.clear()
    after = m.snapshot()
    assert (after.monitor, after.signals, after.samples, after.ecu.verdict) == (before.monitor, before.signals, before.samples, before.ecu.verdict)
    assert after.load.bits == after.frames == after.lost_bus == 0 and not after.groups[0].intervals.histogram
    assert all(x.most == 0.0 for x in after.residuals)


# ---- lines, options ----


def test_a_silent_bus_has_lines_too(made: dict[str, tuple[Design, Native]]) -> None:
    """Before the first frame, by this host's clock; then by the clock of the stamps, whatever that is."""
    out: list[str] = []
    lines = Lines(out.append, 1.0, False)
    m = lines.monitor = monitor(made["platoon"])
    for now in (1e9, 1e9 + 0.9, 1e9 + 1.0, 1e9 + 5.5):
        lines.beat(now)
    assert [line(x)["t"] for x in out] == ["-", "-"] and line(out[0])["ecu"] == "unheard"
    m.note(Frame(0x7AA, 0, b""), 3.0)
    for now in (3.0, 3.5, 4.0, 4.9, 5.0):
        lines.beat(now)
    assert [line(x)["t"] for x in out[2:]] == ["4.000", "5.000"]


def line(text: str) -> dict[str, str]:
    pairs = [word.partition("=") for word in text.split(" ")]
    assert all(sep == "=" and key and value for key, sep, value in pairs), text
    return {key: value for key, _, value in pairs}


def test_lines_of_a_log(runs: dict[str, Path], cli: Cli) -> None:
    done = cli("monitor", "platoon", "--log", runs["platoon"] / "run.log", "--rest", "--every", "2")
    assert (done.status, done.err) == (0, ""), "stdout is no terminal here: lines without being asked"
    found = [line(text) for text in done.out.splitlines()]
    assert len({tuple(x) for x in found}) == 1, "the same keys in the same order on every line"
    run = json.loads((runs["platoon"] / "run.json").read_text())
    said = [(int(x["k"]), x["plant"]) for x in found if x["event"] == "monitor"]
    assert said == [(v["k"], v["plant"]) for v in run["verdicts"]]
    assert [float(x["t"]) for x in found if x["event"] == "status"] == [2.0 * i for i in range(1, 15)]
    last = found[-1]
    assert last["event"] == "end" and last["may_be"].split(",") == run["verdicts"][-1]["candidates"]
    assert last["ecu_agrees"] == "yes" and last["host_dropped"] == "-" and last["lost_bus"] == "0"


def test_json_lines(runs: dict[str, Path], cli: Cli) -> None:
    done = cli("monitor", "openacc", "--log", runs["openacc"] / "run.log", "--rest", "--json", "--samples", "100")
    found = [json.loads(text) for text in done.out.splitlines()]
    assert done.status == 0 and found[-1]["event"] == "end" and found[-1]["samples"] == 100
    assert [g["name"] for g in found[-1]["groups"]] == ["car1", "car2", "car3", "car4", "car5", "tick"]
    assert all(g["frames"] == g["counters"]["good"] for g in found[-1]["groups"]), "no frame of the sample that is not shown any more"
    assert found[-1]["ecu"]["verdict"]["k"] == found[-1]["monitor"]["k"] == 99, "but all of the last one that is"
    assert len(found[-1]["residuals"]) == 29 and {"k", "plant", "candidates", "bus", "refused"} == set(found[-1]["monitor"])


def test_quiet_and_files(runs: dict[str, Path], cli: Cli, tmp_path: Path) -> None:
    done = cli("monitor", "platoon", "--log", runs["platoon"] / "run.log", "-q", "--snapshot", tmp_path / "a.txt", "--snapshot", tmp_path / "a.svg")
    assert (done.status, done.out, done.err) == (0, "", "")
    text = (tmp_path / "a.txt").read_text(encoding="utf-8")
    assert "FAULT CONFIRMED" in text and "gap12_m" in text and max(len(x) for x in text.splitlines()) <= rows.WIDTH
    svg = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert svg.startswith("<svg") and "CONFIRMED" in svg and "url(http" not in svg, "nothing that a viewer would have to load"


WRONG = [
    (["monitor", "platoon"], 2, "needs a bus"),
    (["monitor", "platoon", "--log", "no_such.log"], 2, "no_such.log"),
    (["monitor", "platoon", "--log", "LOG", "-i", "virtual", "-c", "x"], 2, "one of them"),
    (["monitor", "platoon", "-i", "virtual", "-c", "x", "--speed", "2"], 2, "--speed"),
    (["monitor", "platoon", "--log", "LOG", "--speed", "0"], 2, "--speed"),
    (["monitor", "platoon", "--log", "LOG", "--every", "0"], 2, "--every"),
    (["monitor", "platoon", "--log", "LOG", "--every", "nan"], 2, "--every"),
    (["monitor", "platoon", "--log", "LOG", "--rate", "100"], 2, "--rate"),
    (["monitor", "platoon", "--log", "LOG", "--snapshot", "x.png"], 2, ".svg or .txt"),
    (["monitor", "platoon", "--log", "LOG", "--snapshot", "nowhere/x.svg"], 2, "no such folder"),
    (["monitor", "platoon", "--log", "LOG", "--samples", "0"], 2, "--samples"),
    (["monitor", "no_such_model", "--log", "LOG"], 2, "no_such_model"),
    (["monitor", "platoon", "-i", "socketcan", "-c", "no_such0"], 3, "no_such0"),
    (["monitor", "platoon", "-i", "no_such", "-c", "x"], 2, "no_such"),
]


@pytest.mark.parametrize(("arguments", "status", "word"), WRONG, ids=lambda x: " ".join(x) if isinstance(x, list) else None)
def test_bad_input_is_one_line(arguments: list[str], status: int, word: str, runs: dict[str, Path], cli: Cli) -> None:
    done = cli(*[runs["platoon"] / "run.log" if a == "LOG" else a for a in arguments])
    assert (done.status, done.out) == (status, "") and done.err.count("\n") == 1 and word in done.err, done.err


def test_a_log_that_breaks_off_in_the_middle(runs: dict[str, Path], cli: Cli, tmp_path: Path) -> None:
    log = tmp_path / "broken.log"
    log.write_text("".join((runs["platoon"] / "run.log").read_text().splitlines(keepends=True)[:40]) + "(1.0) vcan0 12\n")
    done = cli("monitor", "platoon", "--log", log, "--rest")
    assert done.status == 2 and "broken.log:41" in done.err and done.err.count("\n") == 1
    assert done.out.count("event=") > 3, "what came before is there"
