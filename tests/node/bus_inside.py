"""Run inside with-vcan by test_node_bus.py and `make boards-node`: a detector node on a bus, with whatever may come along it. The same tests for
detector_node on Linux and for the boards (under_test.py), each against a node in this process."""

from __future__ import annotations

import contextlib
import csv
import json
import signal
import socket
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hullguard.bus import candump
from hullguard.bus.candump import BRS, EXTENDED, FD, REMOTE
from hullguard.bus.link import CanLink
from hullguard.core.native import MOVING, Frame, Verdict
from hullguard.errors import BusError
from inside_support import WAIT_S, Drive, collect, exchange, link, process, reachable, silent
from node_support import command, hullguard
from under_test import Linux, Mode, Running, Under, nodes, under

ERROR_FLAG, EXTENDED_FLAG, REMOTE_FLAG = 0x20000000, 0x80000000, 0x40000000
BUS_OFF, RESTARTED, CONTROLLER, PASSIVE, WARNING = 0x40, 0x100, 0x04, 0x30, 0x0C
quick = pytest.mark.quick  # part of `make check` on boards, too


@pytest.fixture(scope="session", params=nodes())
def ecu(request: pytest.FixtureRequest) -> Iterator[Under]:
    """The node under test."""
    with under(request.param) as made:
        yield made


def alarmed(verdicts: list[Verdict], state: str = "confirmed") -> bool:
    return any(v.plant == state for v in verdicts)


def raw(channel: str = "vcan0", only: int | None = None) -> socket.socket:
    """A socket that says what it likes, and hears one identifier, or nothing."""
    made = socket.socket(socket.AF_CAN, socket.SOCK_RAW | socket.SOCK_NONBLOCK, socket.CAN_RAW)
    made.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, b"" if only is None else struct.pack("=II", only, 0x1FFFFFFF | EXTENDED_FLAG | REMOTE_FLAG))
    made.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
    made.bind((channel,))
    return made


def classic(identifier: int, data: bytes, length: int | None = None, len8_dlc: int = 0) -> bytes:
    return struct.pack("=IBBBB8s", identifier, len(data) if length is None else length, 0, 0, len8_dlc, data)


def fd(identifier: int, length: int) -> bytes:
    return struct.pack("=IBBBB64s", identifier, length, 0, 0, 0, bytes(range(64)))


def report(bits: int, controller: int = 0) -> bytes:
    """An error frame as a controller's driver writes it."""
    return classic(ERROR_FLAG | bits, bytes([0, controller, 0, 0, 0, 0, 0, 0]))


# ---- what it says ----


@quick
def test_heartbeat_and_verdict_on_change(ecu: Under) -> None:
    """Free running: a verdict frame when the record changes, one and a status frame every ten samples; nothing else."""
    drive = ecu.drive(faults=("controller2:bias:3@60..75",))
    heartbeat, bits = drive.native.tables.heartbeat, drive.design.tables.hash
    verdicts, got, last = [], [], Frame(0x110, 0, bytes(8))
    with link() as bus, ecu.start(Mode.FREE) as n:
        for k in range(160):
            frames, tick = drive.sample()
            last = frames[0] if frames else last
            sent = [*frames, tick]
            if k in (33, 57, 101):  # a damaged frame: the bus is no longer good
                sent.insert(0, Frame(last.id, last.flags, bytes(8)))
            made, answers = drive.take(sent, lockstep=False)
            verdicts += made
            for f in sent:
                bus.send(f)
            got += collect(bus, {drive.verdict_id, drive.status_id}, len(answers))
            assert got[len(got) - len(answers) :] == answers, f"sample {k}"
        assert silent(bus, {drive.verdict_id, drive.status_id})
        n.stop()
    told = [drive.told(f) for f in got if f.id == drive.verdict_id]
    assert not any(v.reply for v in told)
    records = [(v.plant, v.candidates, v.bus, v.refused) for v in verdicts]
    change = [k for k in range(160) if k == 0 or records[k] != records[k - 1]]
    assert [v.k for v in told] == sorted(set(change) | set(range(0, 160, heartbeat)))
    assert [(v.plant, v.candidates, v.bus, v.refused) for v in told] == [records[v.k] for v in told]
    assert len(set(change) - set(range(0, 160, heartbeat))) >= 2, "the run changes between heartbeats"
    status = [f for f in got if f.id == drive.status_id]
    assert [f.data[1] >> 4 for f in status] == [k % 16 for k in range(0, 160, heartbeat)]
    assert {int.from_bytes(f.data[2:6], "little") for f in status} == {bits}, "the hash of the model"


def test_an_interface_that_goes_down_and_comes_back(ecu: Under) -> None:
    drive = ecu.drive()
    with link("vcan1") as bus, ecu.start(channel="vcan1") as n:
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
    assert n.told.can == "active"


# ---- what is lost or spoilt ----


@pytest.mark.parametrize("missing", [1, 2, pytest.param(7, marks=quick)])
def test_ticks_dropped_in_lockstep(ecu: Under, missing: int) -> None:
    """The next tick closes the samples of the missing ones too: their bus health has changed, so each step is told, and the count goes on."""
    drive = ecu.drive("platoon", "rest")
    told = []
    with link() as bus, ecu.start() as n:
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
    assert not alarmed(told)
    assert n.told.lost("control") == missing


@quick
def test_a_sender_that_falls_silent_becomes_a_bit_of_bus_health(ecu: Under) -> None:
    """To the sample; to the microsecond in test_virtual_node.py."""
    drive = ecu.drive()
    group, stop, back = drive.native.tables.groups[0], 60, 90
    sent, told = [], []
    with link() as bus, ecu.start() as n:
        for k in range(130):
            frames, tick = drive.sample()
            frames = [] if stop <= k < back else frames
            sent += [k] * len(frames)
            told += exchange(bus, drive, [*frames, tick])
        n.stop()
    last, again = max(k for k in sent if k < stop), [k for k in sent if k >= back]
    states = [v.bus[0] for v in told]
    assert states.index("lossy") == last + group.interval_max
    assert states.index("stale") == last + group.interval_max + group.margin + 1
    assert states.index("good", back) == again[1]
    assert not alarmed(told)


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


@pytest.mark.parametrize("place", ["between", "instead"])
def test_spoilt_measurements_are_no_plant_fault(ecu: Under, place: str) -> None:
    """`between` two good frames: a sample with a spoilt frame beside the good one, if any. `instead`: in place of the good one."""
    samples = 1400
    drive = ecu.drive("platoon", "manoeuvres", (f"controller2:bias:3@{samples - 100}",))
    kinds, last, states, doubted, bad, sent = [], None, [], 0, 0, 0
    with link() as bus, ecu.start() as n:
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
                taken = ecu.seen(every[name])  # its filter keeps some away, its controller others
                bad += taken is not None and taken != last and reachable(drive.native, taken)
                frames = [every[name], *frames] if place == "between" else [every[name]]
            verdicts = exchange(bus, drive, [*frames, tick])
            states += verdicts
            doubted += any(v.bus[0] != "good" for v in verdicts)
        n.stop()
    healthy, faulty = states[: samples - 100], states[samples - 100 :]
    assert set(kinds) == set(spoilt(Frame(0x110, 0, bytes(8)))), "every kind was sent"
    assert not alarmed(healthy)
    assert alarmed(faulty), "a fault afterwards is found"
    assert n.told.refused("measurement") >= bad, n.told
    assert doubted >= bad / 2, "the bus health in the verdicts shows it"


@quick
def test_spoilt_ticks_are_no_plant_fault(ecu: Under) -> None:
    """The closing frame itself, spoilt in every bit: the sample is closed by the next good one."""
    drive = ecu.drive("platoon", "rest")
    states = []
    with link() as bus, ecu.start() as n:
        for k in range(64 * 6):
            frames, tick = drive.sample()
            if k % 6 == 5:
                tick = list(spoilt(tick).values())[k // 6]
            states += exchange(bus, drive, [*frames, tick])
        frames, tick = drive.sample()
        states += exchange(bus, drive, [*frames, tick])
        n.stop()
    assert [v.k for v in states] == list(range(64 * 6 + 1))
    assert not alarmed(states)
    assert n.told.refused("control") == 64


@quick
def test_frames_of_strangers_change_nothing(ecu: Under) -> None:
    drive = ecu.drive("platoon", "rest")
    with link() as bus, ecu.start() as n:
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
    assert n.told.clean()


# ---- kinds and lengths that the kernel lets through; every answer is the one of the node in this process ----


@pytest.mark.parametrize("length", [*range(9, 12), 13, 21, 33, 63])
def test_fd_lengths_between_two_steps_of_the_dlc(ecu: Under, length: int) -> None:
    drive = ecu.drive("platoon", "rest")
    odd = Frame(0x110, FD, bytes(range(length)))
    with link() as bus, raw() as other, ecu.start() as n:
        for k in range(30):
            frames, tick = drive.sample()
            if k == 20:
                drive.take([odd])
                other.send(fd(0x110, length))
            verdicts = exchange(bus, drive, [*frames, tick])
            assert not alarmed(verdicts)
        n.stop()
    assert (n.told.refused("measurement"), n.told.counts["can.malformed"]) == (ecu.seen(odd) is not None, ecu.malformed(odd))


def test_the_dlc_of_a_classic_frame_does_not_matter(ecu: Under) -> None:
    """9 .. 15 in the DLC of 8 bytes: the same frame."""
    drive = ecu.drive("platoon", "default", ("controller2:bias:3@60",))
    told = []
    with link() as bus, raw() as other, ecu.start() as n:
        for k in range(100):
            frames, tick = drive.sample()
            for f in frames:
                drive.take([f])
                other.send(classic(f.id, f.data, len8_dlc=9 + k % 7 if len(f.data) == 8 else 0))
            told += exchange(bus, drive, [tick])
        n.stop()
    assert n.told.clean()
    assert not alarmed(told[:60]) and alarmed(told[60:])


@quick
def test_twins_do_not_reach_the_node(ecu: Under) -> None:
    """Remote requests and 29-bit twins stay in the filter, of the kernel or of the board."""
    drive = ecu.drive("platoon", "rest")
    with link() as bus, raw() as other, ecu.start() as n:
        for _ in range(40):
            frames, tick = drive.sample()
            for identifier in (0x110, tick.id):
                for flag in (EXTENDED_FLAG, REMOTE_FLAG, EXTENDED_FLAG | REMOTE_FLAG):
                    for length in range(9):
                        other.send(classic(identifier | flag, bytes(length)))
            verdicts = exchange(bus, drive, [*frames, tick])
            assert verdicts[-1].bus == ("good", "good")
        n.stop()
    assert n.told.clean()


# ---- error reports ----


@pytest.mark.parametrize(("bits", "controller", "state"), [(CONTROLLER, PASSIVE, "passive"), (CONTROLLER, WARNING, "warning"), (0x08, 0, "active"), (0x02, 0, "active")])
def test_an_error_report_is_no_frame(ecu: Under, bits: int, controller: int, state: str) -> None:
    drive = ecu.drive("platoon", "rest")
    with link() as bus, raw() as other, ecu.start() as n:
        for k in range(30):
            frames, tick = drive.sample()
            if k >= 20:
                other.send(report(bits, controller))
            verdicts = exchange(bus, drive, [*frames, tick])
            assert verdicts[-1].bus == ("good", "good")
        n.stop()
    assert (n.told.can, n.told.counts["can.errors"]) == ((state, 10) if ecu.reports else ("active", 0))
    assert n.told.clean()


def test_bus_off_and_restart(ecu: Under) -> None:
    """Off until the controller says otherwise, or a frame from the bus does. Whoever wrote the report, the node goes on, and a fault is found."""
    drive = ecu.drive("platoon", "default", ("controller2:bias:3@80",))
    told = []
    with link() as bus, raw() as other, ecu.start() as n:
        for k in range(120):
            frames, tick = drive.sample()
            if k % 10 == 0:
                other.send(report(BUS_OFF))
            if k % 20 == 0:
                other.send(report(RESTARTED))
            told += exchange(bus, drive, [*frames, tick])
        other.send(report(BUS_OFF))
        n.stop()
    assert (n.told.can, n.told.counts["can.errors"], n.told.counts["unsent"]) == (("off", 19, 0) if ecu.reports else ("active", 0, 0))
    assert not alarmed(told[:80]) and alarmed(told[80:])


# ---- by its own clock ----


def heard(bus: CanLink, drive: Drive, count: int) -> list[tuple[Frame, float]]:
    """The next frames of the node, and when they had come."""
    return [(collect(bus, {drive.verdict_id, drive.status_id}, 1)[0], time.monotonic()) for _ in range(count)]


@quick
def test_a_start_without_any_frame_is_reported(ecu: Under) -> None:
    """In a moving plant the first deadline counts from the start; the verdict then says that nothing is known."""
    drive = ecu.drive(start=MOVING)
    with link() as bus, ecu.start(Mode.TIMED):
        ((first, _),) = heard(bus, drive, 1)
    told = drive.told(first)
    assert (told.plant, set(told.bus)) == ("starting", {"absent"})


@quick
def test_a_bus_that_falls_silent_is_closed_deadline_by_deadline(ecu: Under) -> None:
    """Every frame is that of a node in this process which is told of each deadline, and none comes before it: a period and a half after the last
    closing frame the first one, a period after another the rest. Then the senders are back."""
    drive = ecu.drive(start=MOVING)
    period_s, before = drive.design.model.sample_time_s, 30
    table = drive.native.tables.groups[drive.native.tables.closing]
    with link() as bus, ecu.start(Mode.TIMED) as n:
        expected = []
        for _ in range(before):  # one right after the other: no deadline comes in between
            frames, tick = drive.sample()
            expected += drive.take([*frames, tick], lockstep=False)[1]
            fell_silent = time.monotonic()
            for f in [*frames, tick]:
                bus.send(f)
        assert [f for f, _ in heard(bus, drive, len(expected))] == expected
        states, due, overdue = [], [], []
        for j in range(table.margin + 3):
            drive.sample()
            verdicts, frames = drive.overdue()
            states += [v.bus[1] for v in verdicts]
            due += [fell_silent + (1.5 + j) * period_s] * len(frames)
            overdue += frames
        got = heard(bus, drive, len(overdue))
        assert [f for f, _ in got] == overdue
        assert all(at >= early for (_, at), early in zip(got, due, strict=True)), "no deadline is told early"
        assert states[0] == "lossy" and states.index("stale") == table.margin + 1
        back: list[Verdict] = []
        for _ in range(40):
            frames, tick = drive.sample()
            for f in [*frames, tick]:
                bus.send(f)
            time.sleep(0.2 * period_s)
            while (said := bus.receive(0.0)) is not None:
                back += [drive.told(said[0])] if said[0].id == drive.verdict_id else []
        n.stop()
    assert any(v.bus == ("good", "good") for v in back) and not alarmed(back)
    assert n.told.counts["missed"] >= table.margin + 3


# ---- in real time ----


class Drill:
    """A plant in real time, what a node says of it, and something that happens in between."""

    def __init__(self, ecu: Under, channel: str = "vcan0", fault_at: int = 120) -> None:
        self.ecu, self.drive = ecu, ecu.drive("platoon", "manoeuvres", (f"controller2:bias:3@{fault_at}",))
        self.period_s = (ecu.drill_period_ms or 1000 * self.drive.design.model.sample_time_s) / 1000
        self.channel, self.fault_at, self.samples = channel, fault_at, fault_at + 40
        self.told: list[tuple[int, Verdict]] = []

    def run(self, happens: Callable[[int, Running], bool]) -> Running:
        """`happens` is called ahead of every sample; a sample is sent unless it says no."""
        started = self.ecu.start(Mode.TIMED, self.channel, self.ecu.drill_period_ms)
        with link(self.channel) as bus, raw(self.channel, self.drive.verdict_id) as ear, started as n:
            start = time.monotonic()
            for k in range(self.samples):
                frames, tick = self.drive.sample()
                go = happens(k, n)
                start = max(start, time.monotonic() - (k + 1) * self.period_s)  # what took long is a gap, not a burst of samples
                if go:
                    with contextlib.suppress(BusError):  # a full queue is one more loss
                        for f in [*frames, tick]:
                            bus.send(f)
                time.sleep(max(0.0, start + (k + 1) * self.period_s - time.monotonic()))
                self.listen(ear, k)
            n.stop()
        return n

    def listen(self, ear: socket.socket, k: int) -> None:
        with contextlib.suppress(OSError):  # nothing more, or the interface is down
            while True:
                data = ear.recv(72)
                identifier, length = struct.unpack("=IB", data[:5])
                self.told.append((k, self.drive.told(Frame(identifier, 0, data[8 : 8 + length]))))

    def judged(self) -> None:
        early = [k for k, v in self.told if v.plant == "confirmed" and k < self.fault_at]
        assert not early, f"confirmed without a fault at {early[:3]}"
        assert any(v.plant == "confirmed" for k, v in self.told), "the fault afterwards is found"


@contextlib.contextmanager
def flood(gap_ms: str, *identifiers: str) -> Iterator[None]:
    """A process each that sends 8 random bytes under one identifier as fast as it can, or as the bus lets it, from the moment when each is heard."""
    with contextlib.ExitStack() as stack:
        for identifier in identifiers:
            with raw(only=int(identifier, 16)) as ear:
                ear.settimeout(WAIT_S)
                babbler = subprocess.Popen(["cangen", "vcan0", "-g", gap_ms, "-i", "-I", identifier, "-L", "8"], stderr=subprocess.DEVNULL)
                stack.callback(babbler.wait, 10)
                stack.callback(babbler.terminate)
                ear.recv(72)
        yield


def test_two_babblers_at_full_rate(ecu: Under) -> None:
    """One at the highest priority, which the filter keeps away, one under the measurement's own identifier."""
    drill = Drill(ecu)
    heard = 0
    with contextlib.ExitStack() as stack, raw(only=0x110) as ear:

        def happens(k: int, n: Running) -> bool:
            nonlocal heard
            if k == 40:
                stack.enter_context(flood(ecu.flood_gap_ms, "000", "110"))
            if 40 <= k < 110:
                with contextlib.suppress(BlockingIOError):
                    while True:
                        ear.recv(72)
                        heard += 1
            if (k >= 80 and heard > 200) or k == 110:  # on a busy machine they need their time
                stack.close()
            return True

        n = drill.run(happens)
    drill.judged()
    refused = n.told.refused("measurement")
    assert refused > 100, n.told
    assert not ecu.reports or n.told.counts["measurement.good"] + refused + n.told.counts["can.lost"] >= heard, (heard, n.told)
    assert any(v.bus[0] in ("lossy", "stale") for k, v in drill.told if 40 <= k < 90), "the verdicts tell of it"


def test_frames_that_the_socket_dropped(ecu: Under) -> None:
    """A node that is held while its queue overflows: what is gone was closing frames, too."""
    drill = Drill(ecu)
    junk = raw()

    def happens(k: int, n: Running) -> bool:
        if k in (40, 60):
            n.hold(k == 40)
        if 40 <= k < 60:
            for _ in range(150):
                with contextlib.suppress(OSError):
                    junk.send(classic(0x110, bytes([k] * 8)))
        return True

    with junk:
        n = drill.run(happens)
    drill.judged()
    assert n.told.counts["can.lost"] > 0 or not ecu.reports, n.told


@pytest.mark.parametrize("samples", [3, 20])
def test_an_interface_that_is_down_for_a_while(ecu: Under, samples: int) -> None:
    drill = Drill(ecu, "vcan1")

    def happens(k: int, n: Running) -> bool:
        if k in (60, 60 + samples):
            subprocess.run(["ip", "link", "set", "vcan1", "down" if k == 60 else "up"], check=True)
        return not 60 <= k <= 60 + samples

    n = drill.run(happens)
    drill.judged()
    assert n.told.can == "active"


def test_a_stopped_node_is_no_plant_fault(ecu: Under) -> None:
    """Held while 16 samples pass unsent: to their stamps nothing has happened, and only the clock tells that much has."""
    at = range(60, 300 if ecu.drill_period_ms else 120, 60)
    samples = at.stop + 160
    drive = ecu.drive("platoon", "manoeuvres", (f"controller2:bias:3@{samples - 100}",))
    period_s = (ecu.drill_period_ms or 1000 * drive.design.model.sample_time_s) / 1000
    got: list[Frame] = []
    with link() as bus, ecu.start(Mode.TIMED, period_ms=ecu.drill_period_ms) as n:
        for k in range(samples):
            if k in at:
                n.hold(True)
                for _ in range(16):
                    drive.sample()
                time.sleep(16 * period_s)
            frames, tick = drive.sample()
            for f in [*frames, tick]:
                bus.send(f)
            if k in at:
                n.hold(False)
            while (told := bus.receive(0.001)) is not None:
                got.append(told[0])
        n.stop()
    confirmed = [v.k for v in (drive.told(f) for f in got if f.id == drive.verdict_id) if v.plant == "confirmed"]
    assert n.told.counts["outages"] == len(at)
    # The node's samples lag: what it never heard of, and 16 at a time, it has not counted.
    assert confirmed and confirmed[0] >= samples - 100 - 16 * len(at), f"a fault is found, and none before it: {confirmed[:1]}"


# ---- together ----


def test_two_nodes_on_one_bus(ecu: Under) -> None:
    platoon, openacc = ecu.drive("platoon", "default", ("controller2:bias:3@60",)), Drive("openacc", "default", ("gap3_m:bias:3@90",))
    seen: dict[str, list[Verdict]] = {"platoon": [], "openacc": []}
    ids = {platoon.verdict_id, platoon.status_id, openacc.verdict_id, openacc.status_id}
    with link() as bus, ecu.start() as a, Linux().start(model="openacc") as b:
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
    for name, start in (("platoon", 60), ("openacc", 90)):
        assert not alarmed(seen[name][:start], "provisional") and alarmed(seen[name][start:]), name
    assert a.told.clean() and b.told.clean()


def test_plant_by_hand(ecu: Under) -> None:
    with ecu.start():
        plant = command(hullguard("plant", "platoon", "-i", "socketcan", "-c", "vcan0", "--lockstep", "--speed", "max", "--json"))
    assert plant.returncode == 0, plant.stderr
    result = json.loads(plant.stdout)
    assert result["faults"][0]["confirmed_at"] is not None and result["false_alarms"] == {"provisional": 0, "confirmed": 0}


def test_a_gateway_before_a_node(ecu: Under, tmp_path: Path) -> None:
    """Plant on vcan0, node on vcan1; the node counts what the ledger says and finds the wrong value; its verdicts come back through."""
    drive = ecu.drive(scenario="rest")
    between = ("--from-interface", "socketcan", "--from-channel", "vcan0", "--to-interface", "socketcan", "--to-channel", "vcan1")
    faults = ("--do", "bias:signal=gap12_m,size=3@k=50", "--do", "corrupt:bits=3@id=measurement,every=4,k=0..40")  # a step right behind a lost frame may hide behind it
    gateway = process(*hullguard("inject", "platoon", "--ready", "--json", "-q", *between, *faults, "--out", tmp_path))
    with ecu.start(channel="vcan1") as n, link("vcan0") as plant, gateway as gate:
        verdicts = []
        for _ in range(80):
            frames, tick = drive.sample()
            for f in [*frames, tick]:
                plant.send(f)
            verdicts += [drive.told(f) for f in collect(plant, {drive.verdict_id}, 1)]
        gate.stop(signal.SIGINT)
        n.stop()
    assert gate.status == 0, gate.err
    result: dict[str, Any] = json.loads(gate.lines[-1])
    rows = list(csv.DictReader((tmp_path / "labels.csv").open()))
    crc = sum(r["expects"] == "crc" for r in rows)
    assert result["mode"] == "gateway" and result["events"] == len(rows) and crc >= 3
    sent = [e.frame for e in candump.read(tmp_path / "injected.log")]
    assert n.told.counts["measurement.good"] + crc == sum(f.id == 0x110 for f in sent) and len(sent) == result["sent"]
    found = [v.k for v in verdicts if v.plant == "confirmed"]
    assert found and min(found) >= 50 and min(int(r["k"]) for r in rows if r["action"] == "bias") >= 50, "past the checksum, not past the physics"
