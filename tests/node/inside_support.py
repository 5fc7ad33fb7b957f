"""For tests that run where vcan0 exists: nodes as processes, and drives whose frames are known before they are sent."""

from __future__ import annotations

import contextlib
import functools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from hullguard.bus.link import CanLink, opened
from hullguard.core.library import library
from hullguard.core.native import (
    REST,
    Frame,
    Native,
    Node,
    Plant,
    Sender,
    Verdict,
    read_verdict,
)
from hullguard.design.design import Design, design
from hullguard.model import load_model, parse_fault
from node_support import NODE, SEED, environment

WAIT_S = 100.0  # for what comes at once on a quick machine; on a slow one that is busy a command may take half a minute to start


@functools.cache
def ready(model: str = "platoon") -> tuple[Design, Native]:
    made = design(load_model(model))[0]
    return made, Native(library("f32"), made.tables)


@dataclass
class Process:
    """A node; after its end, what it said."""

    popen: subprocess.Popen[str]
    status: int | None = None
    lines: list[str] = field(default_factory=list)
    err: str = ""

    def stop(self, number: int = signal.SIGTERM) -> None:
        if self.status is None:
            self.popen.send_signal(number)
            self.wait()

    def wait(self, timeout_s: float = WAIT_S) -> None:
        out, self.err = self.popen.communicate(timeout=timeout_s)
        self.lines, self.status = out.splitlines(), self.popen.returncode


def _first_line(popen: subprocess.Popen[str]) -> str:
    """Read past the stream's buffer, byte by byte: communicate() reads past it as well, and what was in it would be lost."""
    assert popen.stdout is not None
    line = b""
    while not line.endswith(b"\n") and (byte := os.read(popen.stdout.fileno(), 1)):
        line += byte
    return line.decode()


@contextlib.contextmanager
def process(*command: object) -> Iterator[Process]:
    """A program that prints 'ready' first; stopped at the end unless it has been before."""
    popen = subprocess.Popen([str(c) for c in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment())
    made = Process(popen)
    try:
        first = _first_line(popen)
        if first != "ready\n":
            made.wait()
            raise AssertionError(f"{command}: said {first!r}, status {made.status}: {made.err}")
        yield made
    finally:
        made.stop()


def node(*options: object) -> contextlib.AbstractContextManager[Process]:
    return process(NODE["f32"], *options)


def detect(*options: object) -> contextlib.AbstractContextManager[Process]:
    return process(sys.executable, "-m", "hullguard", "detect", *options)


def link(channel: str = "vcan0") -> contextlib.AbstractContextManager[CanLink]:
    return opened(interface="socketcan", channel=channel, fd=True)


def reachable(native: Native, frame: Frame) -> bool:
    """Does the node's acceptance filter let a frame pass? Identifier, identifier type and kind count."""
    return any((frame.id, frame.flags & 3) == (g.message.id, g.message.flags & 3) for g in native.tables.groups)


class Drive:
    """Frames of an emulated plant, and a node in this process that gets what the one on the bus gets; `seen` is what the latter's controller makes
    of a frame, None for nothing."""

    def __init__(
        self,
        model: str = "platoon",
        scenario: str = "manoeuvres",
        faults: tuple[str, ...] = (),
        seed: int = SEED,
        start: int = REST,
        seen: Callable[[Frame], Frame | None] = lambda frame: frame,
    ) -> None:
        self.design, self.native = ready(model)
        self.source = Plant(self.native, self.design, self.design.model.scenario(scenario).reference, [parse_fault(f) for f in faults], seed)
        self.sender, self.shadow, self.k = Sender(self.native), Node(self.native, start), 0
        self.seen = seen
        closing = self.native.tables.closing
        self.order = [g for g in range(len(self.native.tables.groups)) if g != closing] + [closing]

    def sample(self) -> tuple[list[Frame], Frame]:
        """Measurement frames and the closing frame of the next sample."""
        reading = self.source.read()
        self.source.move()
        frames = [f for g in self.order if (f := self.sender.step(g, self.k, reading)) is not None]
        self.k += 1
        return frames[:-1], frames[-1]

    def take(self, frames: list[Frame], lockstep: bool = True) -> tuple[list[Verdict], list[Frame]]:
        """What the node makes of frames: the verdict of each step, and what it sends."""
        verdicts: list[Verdict] = []
        sent: list[Frame] = []
        for frame in frames:
            taken = self.seen(frame)
            if taken is None or not reachable(self.native, taken):
                continue
            self.shadow.receive(taken)
            self._step(lockstep, verdicts, sent)
        return verdicts, sent

    def overdue(self) -> tuple[list[Verdict], list[Frame]]:
        """What the node makes of a closing frame that has not come in time."""
        verdicts: list[Verdict] = []
        sent: list[Frame] = []
        self.shadow.overdue()
        self._step(False, verdicts, sent)
        return verdicts, sent

    def _step(self, lockstep: bool, verdicts: list[Verdict], sent: list[Frame]) -> None:
        while (verdict := self.shadow.step()) is not None:
            verdicts.append(verdict)
            sent += self.shadow.report(lockstep)

    def told(self, frame: Frame) -> Verdict:
        verdict = read_verdict(self.native, frame)
        assert verdict is not None, f"not a good verdict frame: {frame}"
        return verdict

    @property
    def verdict_id(self) -> int:
        return int(self.native.tables.verdict.id)

    @property
    def status_id(self) -> int:
        return int(self.native.tables.status.id)


def collect(bus: CanLink, ids: set[int], count: int, timeout_s: float = WAIT_S) -> list[Frame]:
    """The next `count` frames with these identifiers."""
    found: list[Frame] = []
    end = time.monotonic() + timeout_s
    while len(found) < count:
        got = bus.receive(max(0.0, end - time.monotonic()))
        assert got is not None, f"{len(found)} of {count} frames with {[hex(i) for i in sorted(ids)]} came"
        if got[0].id in ids:
            found.append(got[0])
    return found


def silent(bus: CanLink, ids: set[int], for_s: float = 0.2) -> bool:
    end = time.monotonic() + for_s
    while (left := end - time.monotonic()) > 0:
        got = bus.receive(left)
        if got is not None and got[0].id in ids:
            return False
    return True


def exchange(bus: CanLink, drive: Drive, frames: list[Frame]) -> list[Verdict]:
    """Send frames of one sample, closing frame last; the node on the bus must answer what the one in this process answers."""
    verdicts, expected = drive.take(frames)
    for frame in frames:
        bus.send(frame)
    got = collect(bus, {drive.verdict_id, drive.status_id}, len(expected))
    assert got == expected, f"sample {drive.k - 1}: {[drive.told(f) for f in got if f.id == drive.verdict_id]}, expected {verdicts}"
    return verdicts


def _receivers() -> int:
    """Filters of raw sockets on CAN interfaces, as the kernel lists them."""
    return sum(line.endswith("raw") for file in Path("/proc/net/can").glob("rcvlist_*") for line in file.read_text().splitlines())


@contextlib.contextmanager
def recorded(path: Path, *command: object, filters: int = 1) -> Iterator[None]:
    """A program that records into a file, from the moment its `filters` are in place until its end by Ctrl-C."""
    before, end = _receivers(), time.monotonic() + WAIT_S
    with path.open("w") as file:
        popen = subprocess.Popen([str(c) for c in command], stdout=file, cwd=path.parent)
        try:
            while _receivers() < before + filters:
                assert popen.poll() is None and time.monotonic() < end, f"{command}: not on the bus"
                time.sleep(0.02)
            yield
            time.sleep(0.3)
        finally:
            popen.send_signal(signal.SIGINT)
            popen.wait(WAIT_S)


def folder(path: Path, name: str) -> Path:
    made = path / name
    made.mkdir()
    return made
