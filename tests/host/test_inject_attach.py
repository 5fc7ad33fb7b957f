"""The injector on python-can's virtual buses, on logs, from the command line, and against the detector: what the ledger says is what it counts."""

from __future__ import annotations

import csv
import json
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
import pytest
from host_support import ROOT, SEED, Cli, Models
from hullguard.bus import candump
from hullguard.bus.candump import ERROR, FD
from hullguard.bus.link import CanLink, from_message, opened, to_message
from hullguard.core.native import REST, Frame, Node
from hullguard.errors import BusError
from hullguard.inject import Injector, Ledger, Sent, codec_of, parse_directive
from hullguard.inject.actions import ACTIONS
from hullguard.inject.attach import attach, on_log, play
from hullguard.plant.detect import Detector
from inject_support import (
    DBC,
    codec,
    control,
    injector,
    measurement,
    read,
    stream,
    through,
)

EXAMPLES = ROOT / "host_tools" / "examples"


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run without a fault."""
    out = tmp_path_factory.mktemp("healthy")
    command = ["run", "platoon", "--scenario", "manoeuvres", "--seed", str(SEED), "--bus", "inprocess", "--no-fault", "--out", str(out), "-q"]
    subprocess.run([sys.executable, "-m", "hullguard", *command], check=True)
    return out


# ---- against the detector ----


def counted(models: Models, entries: Iterator[candump.Entry]) -> tuple[dict[str, int], list[str]]:
    """Health counters and the plant's states of a node in this process."""
    states: list[str] = []
    detector = Detector(models.platoon("manoeuvres").native, REST, False, None, lambda v: states.append(v.plant), 0.1)
    assert isinstance(detector.node, Node)
    for e in entries:
        detector.take(e.frame, e.time_s)
    return detector.node.health(), states


# Each event raises the one counter by one, and nothing else raises it. The last second is left alone: what was lost last, the next frame tells.
EXACT = {
    "corrupt:bits=1@id=measurement,p=0.2": "crc",
    "corrupt:bits=3@id=measurement,p=0.2": "crc",
    "corrupt:bits=2@id=control,p=0.1": "crc",
    "corrupt:bits=3,copy=true@id=measurement,p=0.2": "crc",
    "length:to=7@id=measurement,p=0.2": "format",
    "length:to=2,copy=true@id=control,p=0.2": "format",
    "nan:signal=gap12_m@p=0.2": "invalid",
    "nan:signal=gap12_m,pattern=range@p=0.2": "numeric",
    "bias:signal=gap12_m,size=30,clip=false@p=0.2": "numeric",
    "drop@id=measurement,p=0.2": "lost",
    "silence:lasts=1.2@id=measurement,at=5": "lost",
    "duplicate@id=measurement,p=0.2": "repeated",
    "duplicate@id=control,p=0.2": "repeated",
    "delay:by=0.1@id=measurement,every=6": "late",
    "replay:age=0.3@id=measurement,every=6": "late",
    "rtr@id=measurement,p=0.2": "format",
    "exttwin@id=measurement,p=0.2": "unknown",
    "fdtwin@id=measurement,p=0.2": "format",
    "flood:id=0x100,rate=300@period=2.03": "unknown",
    "flood:id=0x110,rate=300,length=7@at=4.05": "format",
    "error:kind=passive@period=0.7": "unknown",
    "spoof:message=measurement,valid=false@period=0.5": "crc",
    "spoof:frame=123#00@period=0.5": "unknown",
}


@pytest.mark.parametrize("spec", EXACT)
def test_a_detector_counts_what_the_ledger_says(spec: str, healthy: Path, models: Models) -> None:
    counter = EXACT[spec]
    inject = injector(spec + ("," if "@" in spec else "@") + "to=18.0")
    health, states = counted(models, on_log(inject, candump.read(healthy / "run.log")))
    clean, _ = counted(models, candump.read(healthy / "run.log"))
    events = sum(inject.ledger.events.values())
    assert events and health[counter] - clean[counter] == events, (health, inject.ledger.expects)
    assert all(counter in r.expects.split("|") for r in inject.ledger.rows)
    also = ACTIONS[inject.directives[0].action].also
    assert {n for n in health if health[n] > clean[n]} <= {counter, "good", *also}
    assert "confirmed" not in states or counter in ("lost", "late"), "nothing of it says that the plant is faulty"


def test_exact_counters_cover_the_actions() -> None:
    """What is not there has no counter of its own: wrong values in frames that are in order, and what the sequence rules judge."""
    covered = {s.split(":")[0].split("@")[0] for s in EXACT}
    assert set(ACTIONS) - covered == {"counter", "drift", "gain", "noise", "spike", "freeze", "reorder", "busoff"}


@pytest.mark.parametrize("bits", [1, 2, 3])
def test_damage_is_no_alarm_and_a_wrong_value_is(bits: int, healthy: Path, models: Models, cli: Cli, tmp_path: Path) -> None:
    log = healthy / "run.log"
    damage = f"corrupt:bits={bits}@id=measurement|control,p=0.3"
    done = cli("inject", "platoon", "--log", log, "--out", tmp_path, "--do", damage, "--seed", SEED, "-q")
    assert done.status == 0, done.err
    told = cli("detect", "platoon", "--rest", "--log", tmp_path / "injected.log", "--json", "-q").json
    labels = list(csv.DictReader((tmp_path / "labels.csv").open()))
    assert told["communication"]["crc"] == len(labels) > 30
    assert not [v for v in told["verdicts"] if v["plant"] in ("provisional", "confirmed")]
    done = cli("inject", "platoon", "--log", log, "--out", tmp_path, "--do", "bias:signal=gap12_m,size=2@k=100", "--seed", SEED, "--json")
    found = cli("detect", "platoon", "--rest", "--log", tmp_path / "injected.log", "--json", "-q", "--expect", "detect").json
    first = next(v["k"] for v in found["verdicts"] if v["plant"] == "confirmed")
    assert 100 <= first < 120 and found["communication"]["crc"] == 0
    rows = list(csv.DictReader((tmp_path / "labels.csv").open()))
    assert min(int(r["k"]) for r in rows) >= 100 and done.json["events"] == len(rows) == done.json["actions"]["bias"]


def test_a_log_without_directives_that_fire_comes_out_as_it_was(healthy: Path, cli: Cli, tmp_path: Path) -> None:
    done = cli("inject", DBC, "--log", healthy / "run.log", "--out", tmp_path, "--do", "drop@from=1000", "--json")
    assert done.json["events"] == 0 and done.json["frames"] == done.json["sent"]
    assert (tmp_path / "injected.log").read_text() == (healthy / "run.log").read_text()
    assert json.loads((tmp_path / "inject.json").read_text()) == done.json


def test_the_same_command_writes_the_same_files(healthy: Path, cli: Cli, tmp_path: Path) -> None:
    for name in ("a", "b", "c"):
        seed = 5 if name == "c" else 4
        assert cli("inject", DBC, "--log", healthy / "run.log", "--out", tmp_path / name, "--file", EXAMPLES / "faults.yaml", "--seed", seed, "-q").status == 0
    a, b, c = ({f: (tmp_path / n / f).read_bytes() for f in ("injected.log", "labels.csv")} for n in "abc")
    assert a == b and a != c


def test_a_log_with_an_epoch_keeps_it(tmp_path: Path) -> None:
    first = 1_700_000_000.25
    entries = [candump.Entry(first + s.time_s, "can3", s.frame) for s in stream(5)]
    out = list(on_log(injector("delay:by=0.015@id=measurement,from=0.25"), iter(entries)))
    assert [e.channel for e in out] == ["can3"] * 10
    assert [round(e.time_s - first, 6) for e in out[6:]] == [0.31, 0.315, 0.41, 0.415]
    assert [e.frame for e in out[6:]] == [control(3), measurement(3), control(4), measurement(4)]


# ---- on buses ----

_names = iter(range(10**6))


def channel() -> str:
    """A virtual channel that nobody else is on."""
    return f"inject-{next(_names)}"


def bus(name: str) -> can.BusABC:
    return can.Bus(interface="virtual", channel=name, receive_own_messages=False)


def drained(end: can.BusABC, count: int, timeout_s: float = 5.0) -> list[Frame]:
    """The next frames; and no further one comes."""
    found = []
    while len(found) < count:
        message = end.recv(timeout_s)
        assert message is not None, f"{len(found)} of {count} frames came"
        found.append(from_message(message))
    assert end.recv(0.1) is None
    return found


class Attached:
    """attach() in a thread."""

    def __init__(self, inject: Injector, *names: str) -> None:
        self.sent: list[Sent] = []
        self._stop, ready = threading.Event(), threading.Event()
        self._links = [CanLink(bus(n)) for n in names]
        self.error: BaseException | None = None

        def work() -> None:
            try:
                attach(inject, self._links[0], self._links[1] if len(names) == 2 else None, self._stop.is_set, self.sent.append, ready.set)
            except BusError as error:
                self.error = error

        self._thread = threading.Thread(target=work, daemon=True)
        self._thread.start()
        assert ready.wait(5)

    def end(self) -> None:
        self._stop.set()
        self._thread.join(5)
        assert not self._thread.is_alive()
        for link in self._links:
            link.close()


def test_a_gateway_hands_on_and_back_and_changes_one_way() -> None:
    plant, ecu = channel(), channel()
    with bus(plant) as a, bus(ecu) as b:
        gate = Attached(injector("bias:signal=gap12_m,size=1", "drop@id=control,nth=2"), plant, ecu)
        for k in range(4):
            a.send(to_message(measurement(k)))
            a.send(to_message(control(k)))
        assert drained(b, 7) == [x for k in range(4) for x in (measurement(k, gap12_m=0.1 * k + 1), control(k)) if x != control(1)]
        b.send(to_message(measurement(9)))
        b.send(to_message(read("20000040#0000000000000000")))
        a.send(to_message(read("20000004#0030000000000000")))
        assert drained(a, 1) == [measurement(9)], "the other way unchanged, and error frames stay where they are"
        assert b.recv(0.05) is None
        gate.end()
    assert len(gate.sent) == 7 and gate.error is None


def test_a_gateway_delays() -> None:
    plant, ecu = channel(), channel()
    with bus(plant) as a, bus(ecu) as b:
        gate = Attached(injector("delay:by=0.2@id=measurement"), plant, ecu)
        began = time.monotonic()
        a.send(to_message(measurement(1)))
        a.send(to_message(control(1)))
        assert drained(b, 2) == [control(1), measurement(1)] and time.monotonic() - began > 0.2
        gate.end()
    assert gate.sent[1].time_s - gate.sent[0].time_s == pytest.approx(0.2, abs=0.02), "its due time, however late the machine was"


def test_a_tap_adds_and_changes_nothing() -> None:
    name = channel()
    with bus(name) as a, bus(name) as b:
        tap = Attached(injector("duplicate@id=measurement", "error:kind=busoff@id=control,count=1", gateway=False), name)
        for frame in (measurement(1), control(1)):
            a.send(to_message(frame))
        assert sorted(drained(b, 4), key=repr) == sorted([measurement(1), measurement(1), control(1), read("20000040#0000000000000000")], key=repr)
        assert drained(a, 2) == [measurement(1), read("20000040#0000000000000000")]
        tap.end()
    assert [s.frame for s in tap.sent] == [measurement(1), read("20000040#0000000000000000")]


def test_a_bus_that_fails_ends_it_with_its_error() -> None:
    name = channel()
    link_bus = bus(name)
    attached = Attached(injector("flood:lasts=0.01@at=0.2", gateway=False), name)
    attached._links[0].bus.shutdown()
    attached._thread.join(5)
    assert isinstance(attached.error, BusError) and not attached._thread.is_alive()
    link_bus.shutdown()


def test_what_was_recorded_plays_again_to_the_byte(tmp_path: Path) -> None:
    specs = ("corrupt:bits=3@p=0.5", "length:to=5@id=control,p=0.3", "error:kind=passive,tx=200@period=0.1", "rtr@id=measurement,nth=2", "exttwin@p=0.3", "fdtwin@p=0.3", "length:to=48@id=control,p=0")
    recorded = through(injector(*specs), stream(15))
    log = candump.Writer(tmp_path / "injected.log", "vcan0")
    for s in recorded:
        log.write(s.time_s, s.frame)
    log.close()
    name = channel()
    with bus(name) as end, opened(interface="virtual", channel=name) as link:
        assert play(candump.read(tmp_path / "injected.log"), link, lambda: False, speed=10.0) == len(recorded)
        assert drained(end, len(recorded)) == [s.frame for s in recorded]
    assert any(s.frame.flags & ERROR for s in recorded) and any(s.frame.flags & FD for s in recorded)


def test_play_keeps_time_and_stops() -> None:
    name = channel()
    entries = [candump.Entry(5.0 + 0.1 * i, "x", measurement(i)) for i in range(4)]
    with opened(interface="virtual", channel=name) as link:
        began = time.monotonic()
        assert play(entries, link, lambda: False) == 4 and 0.29 < time.monotonic() - began < 2
        assert play(entries, link, lambda: True) == 0


def test_a_length_that_can_fd_cannot_say_is_refused_where_it_would_be_another() -> None:
    with opened(interface="virtual", channel=channel()) as link, pytest.raises(BusError, match="13 bytes.*use socketcan"):
        link.send(Frame(0x110, FD, bytes(13)))


# ---- command ----

WRONG = [
    (("platoon",), "--do SPEC"),
    (("platoon", "--do", "drop"), "-i INTERFACE"),
    (("platoon", "--do", "drop", "-i", "virtual", "-c", "x"), "a tap cannot keep a frame from arriving"),
    (("platoon", "--do", "drop", "--from-channel", "x"), "--to-channel is missing"),
    (("platoon", "--do", "drop", "--to-channel", "x"), "--from-channel is missing"),
    (("platoon", "--do", "drop", "--from-channel", "x", "--to-channel", "x"), "two channels"),
    (("platoon", "--do", "drop", "--from-channel", "x", "--to-channel", "y", "-c", "z"), "one of them"),
    (("platoon", "--do", "drop", "--log", "x.log", "-c", "z"), "one of them"),
    (("platoon", "--do", "drop", "--log", "x.log"), "--out"),
    (("platoon", "--do", "drop@id=engine", "--dry-run"), "no message 'engine'"),
    (("nosuch.dbc", "--do", "drop", "--dry-run"), "nosuch.dbc"),
    ((str(DBC), "--set", "a=1", "--do", "drop", "--dry-run"), "--set"),
    (("--do", "bias:signal=gap12_m,size=1", "--dry-run"), "without a model or DBC"),
    (("--replay", "x.log", "--do", "drop"), "--replay"),
    (("--replay", "x.log"), "-i INTERFACE"),
    (("--replay", "x.log", "-i", "virtual", "-c", "x"), "x.log"),
    (("--do", "drop", "--duration", "0"), "--duration"),
]


@pytest.mark.parametrize(("arguments", "cure"), WRONG, ids=[" ".join(w[0]) for w in WRONG])
def test_a_wrong_command_is_refused_in_one_line(arguments: tuple[str, ...], cure: str, cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = cli("inject", *arguments)
    assert (result.status, result.out) == (2, "") and result.err.count("\n") == 1 and cure in result.err


def test_the_help_tells_how_a_directive_is_written(cli: Cli) -> None:
    said = cli("inject", "--help")
    assert said.status == 0 and "usage: hullguard inject" in said.out and "exit status: 0 done" in said.out
    assert "ACTION[:OPTION=VALUE,..][@TRIGGER=VALUE,..]" in said.out and "--from-channel" in said.out


def test_the_list_is_whole(cli: Cli) -> None:
    text, rows = cli("inject", "--list").out, cli("inject", "--list", "--json", "-q").json["actions"]
    assert [r["action"] for r in rows] == list(ACTIONS)
    for r in rows:
        assert f"\n{r['action']}: " in "\n" + text and r["example"] in text
        parse_directive(r["example"])
        assert r["expects"], r["action"]


def test_a_dry_run_says_what_it_would_do(cli: Cli) -> None:
    done = cli("inject", "platoon", "--file", EXAMPLES / "faults.yaml", "--do", "drop@k=3", "--dry-run")
    assert done.status == 0 and done.out.splitlines()[-1] == "drop2: drop@k=3"
    assert cli("inject", "platoon", "--do", "drop@k=3", "--dry-run", "--json", "-q").json["directives"][0]["events"] == 0


def live(cli: Cli, feed: Callable[[], None], *arguments: object) -> Any:
    """The command in this thread, while `feed` sends from another."""
    box: queue.Queue[BaseException | None] = queue.Queue()

    def work() -> None:
        try:
            feed()
            box.put(None)
        except BaseException as error:  # the test must see it
            box.put(error)

    helper = threading.Thread(target=work, daemon=True)
    helper.start()
    result = cli("inject", *arguments)
    helper.join(100)
    problem = box.get(timeout=1)
    assert problem is None, problem
    return result


def test_the_command_as_gateway_records_and_replays(cli: Cli, tmp_path: Path) -> None:
    plant, ecu = channel(), channel()
    got: list[Frame] = []

    def feed() -> None:
        with bus(plant) as a, bus(ecu) as b:
            time.sleep(0.8)
            for k in range(10):
                a.send(to_message(measurement(k)))
            while (m := b.recv(1.0)) is not None:
                got.append(from_message(m))

    sides = ("--from-interface", "virtual", "--from-channel", plant, "--to-interface", "virtual", "--to-channel", ecu)
    done = live(cli, feed, DBC, *sides, "--do", "corrupt:bits=2@id=measurement,every=3", "--do", "drop@id=measurement,nth=5", "--duration", 3, "--out", tmp_path, "--json", "-q")
    assert done.status == 0, done.err
    assert (done.json["mode"], done.json["frames"], done.json["sent"], done.json["actions"]) == ("gateway", 10, 9, {"corrupt": 3, "drop": 1})
    assert [e.frame for e in candump.read(tmp_path / "injected.log")] == got
    rows = list(csv.DictReader((tmp_path / "labels.csv").open()))
    assert [(r["action"], r["frame"]) for r in rows] == [("corrupt", "2"), ("drop", "4"), ("corrupt", "5"), ("corrupt", "8")]
    with bus(plant) as end:
        done = cli("inject", "--replay", tmp_path / "injected.log", "-i", "virtual", "-c", plant, "--json", "-q")
        assert done.status == 0 and done.json["sent"] == 9 and drained(end, 9) == got


# ---- examples ----


def example(name: str, *arguments: object) -> Callable[[pytest.MonkeyPatch], None]:
    """An example in this process, where the virtual buses are."""

    def run(monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        source = (EXAMPLES / name).read_text()
        exec(compile(source, name, "exec"), {"__name__": "__main__"})

    return run


def test_the_gateway_example(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    plant, ecu = channel(), channel()
    stop = threading.Event()

    def feed() -> None:
        with bus(plant) as a:
            for k in range(40):
                a.send(to_message(measurement(k)))
                if stop.wait(0.1):
                    return

    with bus(ecu) as b:
        helper = threading.Thread(target=feed, daemon=True)
        helper.start()
        example("gateway_bias.py", DBC, "virtual", plant, ecu, 3)(monkeypatch)
        stop.set()
        helper.join(5)
        got = []
        while (m := b.recv(0.05)) is not None:
            got.append(from_message(m))
    assert any(f == measurement(k, gap12_m=0.1 * k + 0.5) for f in got for k in range(40))
    assert any(f == measurement(k) for f in got for k in range(15))
    assert " -> 110#" in capsys.readouterr().out


def test_the_tap_example(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    name = channel()
    with bus(name) as end:
        example("tap_spoof.py", DBC, "virtual", name, 4.5)(monkeypatch)
        got = []
        while (m := end.recv(0.05)) is not None:
            got.append(from_message(m))
    assert sum(f.id == 0 for f in got) == 200 and sum(f.id == 0x110 for f in got) == 9
    assert capsys.readouterr().out == "spoof1: 9 frames, flood1: 200 frames\n"


def test_the_offline_example(monkeypatch: pytest.MonkeyPatch, healthy: Path, tmp_path: Path, models: Models, capsys: pytest.CaptureFixture[str]) -> None:
    example("offline_log.py", DBC, EXAMPLES / "faults.yaml", healthy / "run.log", tmp_path / "out.log")(monkeypatch)
    lines = capsys.readouterr().out.splitlines()
    health, states = counted(models, candump.read(tmp_path / "out.log"))
    assert sum("a receiver counts crc" in x for x in lines) == health["crc"] > 0
    assert "confirmed" in states[120:155] and "confirmed" not in states[:120]


def test_a_log_keeps_its_channels(cli: Cli, tmp_path: Path) -> None:
    lines = [candump.line(5.0 + i, f"can{i % 2}", measurement(i)) + "\n" for i in range(4)]
    (tmp_path / "in.log").write_text("".join(lines))
    assert cli("inject", DBC, "--log", tmp_path / "in.log", "--out", tmp_path, "--do", "drop@nth=2", "-q").status == 0
    assert (tmp_path / "injected.log").read_text() == "".join([lines[0], *lines[2:]])


def test_a_ledger_in_a_file_keeps_no_rows(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path / "labels.csv")
    inject = Injector([parse_directive("drop")], codec_of(DBC.read_text(), "x"), ledger=ledger)
    inject.take(measurement(1), 0.5)
    ledger.close()
    assert not ledger.rows and ledger.events == {"drop1": 1}
    header, row = (tmp_path / "labels.csv").read_text().splitlines()
    assert header == "time_s,k,directive,action,frame,original,sent,expects,detail,seed"
    assert row.startswith("0.500000,,drop1,drop,0,110#") and row.endswith(",,lost,dropped,1")
    assert codec().closing is not None


@pytest.mark.parametrize("suffix", ["blf", "pcapng", "asc"])
def test_recordings_of_every_format_can_be_falsified(suffix: str, healthy: Path, tmp_path: Path, cli: Cli) -> None:
    """The same frames, whatever the file; the time stamps of some formats are coarser."""
    assert cli("convert", healthy / "run.log", tmp_path / f"run.{suffix}").status == 0
    sent = []
    for log in (healthy / "run.log", tmp_path / f"run.{suffix}"):
        out = tmp_path / log.suffix[1:]
        assert cli("inject", "platoon", "--log", log, "--out", out, "--do", "corrupt:bits=3@id=measurement,every=3").status == 0
        sent.append([e.frame for e in candump.read(out / "injected.log")])
    assert sent[0] == sent[1] and len(sent[0]) > 100
