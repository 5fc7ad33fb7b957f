"""The node that tests of a node on a bus are about: detector_node on Linux, or the detector image of an emulated board (tests/boards). HULLGUARD_NODES
names them, separated by commas; Linux alone without it. What only processes have (options, signals, files) is not asked of it here."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hullguard.core.native import Frame
from inside_support import Drive, Process, node
from node_support import ROOT

if TYPE_CHECKING:
    from board_support import Board

REFUSED = ("crc", "format", "repeated", "early", "late", "sequence", "untrusted", "numeric")
CAN = ("unknown", "active", "warning", "passive", "off")
HOUR_MS = 3_600_000


class Mode(Enum):
    """How a node begins, and what makes it speak; the values are the keys of firmware/apps/detector_board.c."""

    LOCKSTEP = "r"  # at rest; every closing frame is answered
    FREE = "f"  # at rest; it speaks when something changes and with every heartbeat, and has no deadline
    TIMED = "t"  # in a moving plant, with a deadline for every closing frame


@dataclass(frozen=True)
class Told:
    """What a node has counted."""

    counts: dict[str, int]  # "GROUP.COUNTER" of every group, "missed", "outages", "unsent", "can.errors", "can.lost", "can.malformed"
    can: str

    def refused(self, group: str) -> int:
        return sum(self.counts[f"{group}.{name}"] for name in REFUSED)

    def lost(self, group: str) -> int:
        return self.counts[f"{group}.lost"]

    def clean(self) -> bool:
        """Nothing refused and nothing lost, of any group."""
        return not any(n for name, n in self.counts.items() if name.partition(".")[2] in (*REFUSED, "lost"))


class Running(ABC):
    """A node that has begun."""

    told: Told  # after stop()

    @abstractmethod
    def hold(self, held: bool) -> None:
        """Stop it from doing anything, or let it go on."""

    @abstractmethod
    def stop(self) -> None:
        """Ask what it has counted, and end it."""


class Under(ABC):
    """A kind of node."""

    name: str
    drill_period_ms: int | None  # of samples in real time; None: the model's own, the only one it has
    flood_gap_ms: str  # between two frames of somebody who babbles as fast as its bus lets him
    reports: bool  # does an error frame of SocketCAN reach it as a report of its controller?

    def seen(self, frame: Frame) -> Frame | None:
        """A frame of the bus as its controller hands it on; None: not at all."""
        return frame

    def malformed(self, frame: Frame) -> bool:
        """Does its driver count a frame of the bus as one that contradicts itself?"""
        return False

    def drive(self, *what: Any, **more: Any) -> Drive:
        """A Drive whose node in this process gets what this one's controller hands on."""
        return Drive(*what, seen=self.seen, **more)

    @abstractmethod
    def start(self, mode: Mode = Mode.LOCKSTEP, channel: str = "vcan0", period_ms: int | None = None) -> contextlib.AbstractContextManager[Running]:
        """A node of model platoon."""


class _Process(Running):
    def __init__(self, process: Process, file: Path) -> None:
        self.process, self.file = process, file

    def hold(self, held: bool) -> None:
        self.process.popen.send_signal(signal.SIGSTOP if held else signal.SIGCONT)

    def stop(self) -> None:
        self.process.stop()
        assert (self.process.status, self.process.err) == (0, ""), self.process.err
        said = dict(word.split("=", 1) for word in self.process.lines[-1].split())
        counts = {name: int(count) for name, count in (line.rsplit(" ", 1) for line in self.file.read_text().splitlines())}
        counts |= {name: int(said[name]) for name in ("missed", "outages", "unsent")}
        self.told = Told(counts | {"can.errors": int(said["errors"]), "can.lost": int(said["dropped"]), "can.malformed": int(said["malformed"])}, said["can"])


class Linux(Under):
    """detector_node, a process for each start."""

    name = "linux"
    drill_period_ms = 30
    flood_gap_ms = "0"
    reports = True

    @contextlib.contextmanager
    def start(self, mode: Mode = Mode.LOCKSTEP, channel: str = "vcan0", period_ms: int | None = None, model: str = "platoon") -> Iterator[Running]:
        options: dict[Mode, tuple[object, ...]] = {Mode.LOCKSTEP: ("--lockstep", "--rest"), Mode.FREE: ("--rest", "--period", HOUR_MS), Mode.TIMED: ()}
        period = ("--period", period_ms) if period_ms else ()
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "health"
            with node("--model", model, "--interface", channel, "--status", "--health", file, *options[mode], *period) as process:
                yield _Process(process, file)


class _OnBoard(Running):
    def __init__(self, board: Board) -> None:
        self.board = board

    def hold(self, held: bool) -> None:
        self.board.popen.send_signal(signal.SIGSTOP if held else signal.SIGCONT)

    def stop(self) -> None:
        counts = self.board.quiet()
        self.told = Told(counts, CAN[counts["can.bus"]])


class OnBoard(Under):
    """An emulated board; it boots once for all tests on one channel, and begins anew for each."""

    drill_period_ms = None
    flood_gap_ms = "0.25"  # 8 bytes take 0.23 ms at 500 kbit/s
    reports = False

    def __init__(self, name: str) -> None:
        sys.path.insert(0, str(ROOT / "tests" / "boards"))
        import board_support

        self.name, self._boards, self._booted = name, board_support, contextlib.ExitStack()
        self._channel, self._board = "", None

    def seen(self, frame: Frame) -> Frame | None:
        return self._boards.seen(self.name, frame)

    def malformed(self, frame: Frame) -> bool:
        return self._boards.malformed(self.name, frame)

    @contextlib.contextmanager
    def start(self, mode: Mode = Mode.LOCKSTEP, channel: str = "vcan0", period_ms: int | None = None) -> Iterator[Running]:
        assert period_ms is None, "a board has the model's period"
        if channel != self._channel:
            self.end()
            self._board, self._channel = self._booted.enter_context(self._boards.board(self.name, channel=channel)), channel
        self._board.restart(mode.value)
        running = _OnBoard(self._board)
        try:
            yield running
        finally:
            running.hold(False)
            self._board.restart(Mode.FREE.value)  # silent until somebody speaks to it

    def end(self) -> None:
        """Switch it off."""
        self._booted.close()
        self._channel = ""


def nodes() -> list[str]:
    return os.environ.get("HULLGUARD_NODES", "linux").split(",")


@contextlib.contextmanager
def under(name: str) -> Iterator[Under]:
    """A kind of node, by its name."""
    if name == "linux":
        yield Linux()
    else:
        made = OnBoard(name)
        try:
            yield made
        finally:
            made.end()
