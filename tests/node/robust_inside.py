"""Run inside with-vcan by test_robust_process.py: what only a real socket shows of the table in firmware/README.md."""

from __future__ import annotations

import contextlib
import signal
import socket
import struct
import subprocess
import time
from collections.abc import Callable, Iterator

import pytest
from hullguard.bus.candump import FD
from hullguard.core.native import Frame, Verdict
from hullguard.errors import BusError
from inside_support import Drive, Process, exchange, health, link, node

ERROR_FLAG, EXTENDED_FLAG, REMOTE_FLAG = 0x20000000, 0x80000000, 0x40000000
BUS_OFF, RESTARTED, CONTROLLER, PASSIVE, WARNING = 0x40, 0x100, 0x04, 0x30, 0x0C
PERIOD_S = 0.03


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


def off(bits: int, controller: int = 0) -> bytes:
    """A report as a controller's driver writes it."""
    return classic(ERROR_FLAG | bits, bytes([0, controller, 0, 0, 0, 0, 0, 0]))


def word(process: Process, name: str) -> str:
    """A word of the last status line."""
    return next(w.partition("=")[2] for w in process.lines[-1].split() if w.startswith(f"{name}="))


def confirmed(verdicts: list[Verdict]) -> bool:
    return any(v.plant == "confirmed" for v in verdicts)


# ---- kinds and lengths that the kernel lets through; every answer is the one of the node in this process ----


@pytest.mark.parametrize("length", [*range(9, 12), 13, 21, 33, 63])
def test_fd_lengths_between_two_steps_of_the_dlc(length: int) -> None:
    drive = Drive("platoon", "rest")
    with link() as bus, raw() as other, node("--lockstep", "--rest", "--status") as n:
        for k in range(30):
            frames, tick = drive.sample()
            if k == 20:
                drive.take([Frame(0x110, FD, bytes(range(length)))])
                other.send(fd(0x110, length))
            verdicts = exchange(bus, drive, [*frames, tick])
            assert not confirmed(verdicts)
        n.stop()
    assert health(n)["measurement"]["refused"] == 1 and word(n, "malformed") == "0"


def test_the_dlc_of_a_classic_frame_does_not_matter() -> None:
    """9 .. 15 in the DLC of 8 bytes: the same frame."""
    drive = Drive("platoon", "default", ("controller2:bias:3@60",))
    told = []
    with link() as bus, raw() as other, node("--lockstep", "--rest", "--status") as n:
        for k in range(100):
            frames, tick = drive.sample()
            for f in frames:
                drive.take([f])
                other.send(classic(f.id, f.data, len8_dlc=9 + k % 7 if len(f.data) == 8 else 0))
            told += exchange(bus, drive, [tick])
        n.stop()
    assert all(row["refused"] == row["lost"] == 0 for row in health(n).values())
    assert not confirmed(told[:60]) and confirmed(told[60:])


def test_twins_do_not_reach_the_node() -> None:
    """Remote requests and 29-bit twins stay in the kernel's filter, FD twins are refused."""
    drive = Drive("platoon", "rest")
    with link() as bus, raw() as other, node("--lockstep", "--rest", "--status") as n:
        for _ in range(40):
            frames, tick = drive.sample()
            for identifier in (0x110, tick.id):
                for flag in (EXTENDED_FLAG, REMOTE_FLAG, EXTENDED_FLAG | REMOTE_FLAG):
                    for length in range(9):
                        other.send(classic(identifier | flag, bytes(length)))
            verdicts = exchange(bus, drive, [*frames, tick])
            assert verdicts[-1].bus == ("good", "good")
        n.stop()
    assert all(row["refused"] == row["lost"] == 0 for row in health(n).values())


# ---- error reports ----


@pytest.mark.parametrize(("bits", "controller", "state"), [(CONTROLLER, PASSIVE, "passive"), (CONTROLLER, WARNING, "warning"), (0x08, 0, "active"), (0x02, 0, "active")])
def test_an_error_report_is_no_frame(bits: int, controller: int, state: str) -> None:
    drive = Drive("platoon", "rest")
    with link() as bus, raw() as other, node("--lockstep", "--rest", "--status") as n:
        for k in range(30):
            frames, tick = drive.sample()
            if k >= 20:
                other.send(off(bits, controller))
            verdicts = exchange(bus, drive, [*frames, tick])
            assert verdicts[-1].bus == ("good", "good")
        n.stop()
    assert (n.status, word(n, "can"), word(n, "errors")) == (0, state, "10")


def test_bus_off_and_restart() -> None:
    """Off until the controller says otherwise, or a frame from the bus does. Whoever wrote the report, the node goes on, and a fault is found."""
    drive = Drive("platoon", "default", ("controller2:bias:3@80",))
    told = []
    with link() as bus, raw() as other, node("--lockstep", "--rest", "--status") as n:
        for k in range(120):
            frames, tick = drive.sample()
            if k % 10 == 0:
                other.send(off(BUS_OFF))
            if k % 20 == 0:
                other.send(off(RESTARTED))
            told += exchange(bus, drive, [*frames, tick])
        other.send(off(BUS_OFF))
        n.stop()
    assert (n.status, word(n, "can"), word(n, "errors"), word(n, "unsent")) == (0, "off", "19", "0")
    assert not confirmed(told[:80]) and confirmed(told[80:])


# ---- in real time ----


class Drill:
    """A plant in real time, what a node says of it, and something that happens in between."""

    def __init__(self, channel: str = "vcan0", fault_at: int = 120) -> None:
        self.drive = Drive("platoon", "manoeuvres", (f"controller2:bias:3@{fault_at}",))
        self.channel, self.fault_at, self.samples = channel, fault_at, fault_at + 40
        self.told: list[tuple[int, Verdict]] = []

    def run(self, happens: Callable[[int, Process], bool]) -> Process:
        """`happens` is called ahead of every sample; a sample is sent unless it says no."""
        with link(self.channel) as bus, raw(self.channel, self.drive.verdict_id) as ear, node("--interface", self.channel, "--rest", "--status", "--period", PERIOD_S * 1000) as n:
            start = time.monotonic()
            for k in range(self.samples):
                frames, tick = self.drive.sample()
                if happens(k, n):
                    with contextlib.suppress(BusError):  # a full queue is one more loss
                        for f in [*frames, tick]:
                            bus.send(f)
                time.sleep(max(0.0, start + (k + 1) * PERIOD_S - time.monotonic()))
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
def flood(*identifiers: str) -> Iterator[None]:
    """A process each that sends 8 random bytes under one identifier as fast as it can."""
    made = [subprocess.Popen(["cangen", "vcan0", "-g", "0", "-i", "-I", i, "-L", "8"], stderr=subprocess.DEVNULL) for i in identifiers]
    try:
        yield
    finally:
        for p in made:
            p.terminate()
            p.wait(10)


def test_two_babblers_at_full_rate() -> None:
    """One at the highest priority, which the filter keeps away, one under the measurement's own identifier."""
    drill = Drill()
    with contextlib.ExitStack() as stack:

        def happens(k: int, n: Process) -> bool:
            if k == 40:
                stack.enter_context(flood("000", "110"))
            if k == 80:
                stack.close()
            return True

        n = drill.run(happens)
    drill.judged()
    assert n.status == 0 and health(n)["measurement"]["refused"] > 100, n.lines[-1]
    assert any(v.bus[0] in ("lossy", "stale") for k, v in drill.told if 40 <= k < 90), "the verdicts tell of it"


def test_frames_that_the_socket_dropped() -> None:
    """A node that is stopped while its queue overflows: what is gone was closing frames, too."""
    drill = Drill()
    junk = raw()

    def happens(k: int, n: Process) -> bool:
        if k == 40:
            n.popen.send_signal(signal.SIGSTOP)
        if 40 <= k < 60:
            for _ in range(150):
                with contextlib.suppress(OSError):
                    junk.send(classic(0x110, bytes([k] * 8)))
        if k == 60:
            n.popen.send_signal(signal.SIGCONT)
        return True

    with junk:
        n = drill.run(happens)
    drill.judged()
    assert n.status == 0 and int(word(n, "dropped")) > 0, n.lines[-1]


@pytest.mark.parametrize("samples", [3, 20])
def test_an_interface_that_is_down_for_a_while(samples: int) -> None:
    drill = Drill("vcan1")

    def happens(k: int, n: Process) -> bool:
        if k in (60, 60 + samples):
            subprocess.run(["ip", "link", "set", "vcan1", "down" if k == 60 else "up"], check=True)
        return not 60 <= k <= 60 + samples

    n = drill.run(happens)
    drill.judged()
    assert (n.status, word(n, "can")) == (0, "active")
