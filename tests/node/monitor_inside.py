"""`hullguard monitor` beside a node on vcan0: what it says of both, and whose losses are whose."""

from __future__ import annotations

import contextlib
import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from hullguard.bus.link import CanLink
from hullguard.core.native import Frame
from inside_support import WAIT_S, Drive, exchange, link, node
from node_support import environment

STRANGER = 0x7F0
SLOTS = 16000  # frames that overflow the largest receive buffer that the monitor can get

Line = dict[str, str]


class Monitor:
    """The process; what it has said so far."""

    def __init__(self, popen: subprocess.Popen[bytes], out: Path) -> None:
        self.popen, self._out = popen, out

    def lines(self) -> list[Line]:
        whole = self._out.read_text().rpartition("\n")[0].splitlines()
        return [dict((k, v) for k, _, v in (word.partition("=") for word in text.split())) for text in whole]

    def until(self, condition: Callable[[Line], bool]) -> Line:
        end = time.monotonic() + WAIT_S
        while True:
            said = self.lines()
            if said and condition(said[-1]):
                return said[-1]
            assert time.monotonic() < end and self.popen.poll() is None, said[-3:]
            time.sleep(0.05)


@contextlib.contextmanager
def monitor(out: Path, *options: object) -> Iterator[Monitor]:
    """Started and listening."""
    command = [sys.executable, "-m", "hullguard", "monitor", "platoon", "-i", "socketcan", "-c", "vcan0", "--rest", "--lockstep", "--every", "0.1", *map(str, options)]
    with out.open("wb") as file, subprocess.Popen(command, stdout=file, stderr=subprocess.PIPE, env=environment()) as popen:
        made = Monitor(popen, out)
        try:
            made.until(lambda said: said["event"] == "status")
            yield made
        finally:
            popen.send_signal(signal.SIGCONT)
            popen.send_signal(signal.SIGINT)
            assert popen.stderr is not None
            said = popen.stderr.read()
            assert (popen.wait(WAIT_S), said) == (0, b"")


def test_monitor_and_node_say_the_same(tmp_path: Path) -> None:
    drive = Drive("platoon", "default", ("controller2:bias:1@60",))
    expected: list[tuple[int, str]] = []
    with link() as bus, node("--model", "platoon", "--rest", "--lockstep"), monitor(tmp_path / "out") as m:
        for k in range(100):
            frames, closing = drive.sample()
            verdict = exchange(bus, drive, [*frames, closing])[0]
            if not expected or expected[-1][1] != verdict.plant:
                expected.append((k, verdict.plant))
        last = m.until(lambda said: said["k"] == said["ecu_k"] == "99")
        said = m.lines()
    for who, k, plant in (("monitor", "k", "plant"), ("ecu", "ecu_k", "ecu_plant")):
        changes = [(int(x[k]), x[plant]) for x in said if x["event"] == who]
        assert [c for i, c in enumerate(changes) if i == 0 or changes[i - 1][1] != c[1]] == expected
    assert expected[-1][1] == "confirmed"
    assert (last["ecu_agrees"], last["ecu_model"], last["may_be"]) == ("yes", "match", last["ecu_may_be"])
    assert (last["lost_bus"], last["lost_host"], last["host_dropped"], last["unknown"], last["refused"]) == ("0",) * 5
    assert m.lines()[-1]["event"] == "end"


def flood(bus: CanLink, count: int) -> None:
    """Frames that are no part of the model, as fast as this kernel takes them."""
    raw = struct.pack("=IBB2x8s", STRANGER, 8, 0, bytes(8))
    for _ in range(count):
        bus.bus.socket.send(raw)  # type: ignore[attr-defined]


def test_losses_of_this_host_are_not_the_buss(tmp_path: Path) -> None:
    """The reader is stopped and flooded: what it misses is its own. Frames that were never on the bus are the bus's, before and after."""
    drive = Drive("platoon", "default")

    def send(samples: int, skip: Callable[[Frame], bool] = lambda frame: False) -> int:
        sent = 0
        for _ in range(samples):
            frames, closing = drive.sample()
            for frame in (*frames, closing):
                if not skip(frame):
                    bus.send(frame)
                    sent += 1
        return sent

    measurement = drive.native.tables.groups[0].message.id
    with link() as bus, monitor(tmp_path / "out") as m:
        total = send(40)
        m.until(lambda said: said["frames"] == str(total))
        kept = send(10, lambda frame: frame.id == measurement)
        total += kept + send(10)
        bus_lost = int(m.until(lambda said: said["frames"] == str(total))["lost_bus"])
        assert bus_lost > 0, "the sender speaks at least every fifth sample"
        os.kill(m.popen.pid, signal.SIGSTOP)
        flood(bus, SLOTS)
        missed = send(5)
        os.kill(m.popen.pid, signal.SIGCONT)
        m.until(lambda said: int(said["frames"]) > total and int(said["unknown"]) > 100)
        m.until(lambda said: int(said["unknown"]) == int(m.lines()[-4]["unknown"]) and said["event"] == "status")  # the queue is empty
        sent = send(20)
        last = m.until(lambda said: int(said["frames"]) - int(said["unknown"]) == total + sent)
        assert int(last["lost_host"]) == missed, "all that the model sent meanwhile, as its counters tell"
        assert int(last["host_dropped"]) == missed + SLOTS - int(last["unknown"]) > missed, "and all of the strangers that are not there"
        assert int(last["lost_bus"]) == bus_lost, "none of it is the bus's"
        total += send(3, lambda frame: frame.id != measurement) + sent
        total += send(3)
        last = m.until(lambda said: int(said["frames"]) - int(said["unknown"]) == total)
        assert int(last["lost_bus"]) == bus_lost + 3 and int(last["lost_host"]) == missed, "what is lost later is the bus's again"


def test_error_frames_and_a_bus_in_words(tmp_path: Path) -> None:
    """Any process may write an error frame on a vcan; python-can would lose what it says."""
    with link() as bus, monitor(tmp_path / "out") as m:
        bus.bus.socket.send(struct.pack("=IBB2x8s", 0x20000004, 8, 0, bytes([0, 0x20, 0, 0, 0, 0, 0, 0])))  # type: ignore[attr-defined]
        assert m.until(lambda said: said["errors"] == "1")["controller"] == "error_passive_(transmit)"
        bus.bus.socket.send(struct.pack("=IBB2x8s", 0x20000040, 8, 0, bytes(8)))  # type: ignore[attr-defined]
        m.until(lambda said: said["controller"] == "bus-off" and said["errors"] == "2")
        bus.send(Frame(STRANGER, 0x04, bytes(20)))
        assert m.until(lambda said: said["unknown"] == "1")["plant"] == "starting", "CAN FD too; and a broken bus accuses no plant"
