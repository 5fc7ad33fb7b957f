"""Frames that nobody meant to send: old ones, forged ones, twins, requests, floods, error frames. A tap can do all of this."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from typing import ClassVar

from hullguard.bus.candump import BRS, ERROR, EXTENDED, FD, REMOTE, frame_of
from hullguard.core.native import Frame
from hullguard.core.protect import Header
from hullguard.errors import InputError
from hullguard.inject.codec import Codec, Field, Layout
from hullguard.inject.options import option
from hullguard.inject.shot import COPY, GONE, Action, Change, Shot, assignments

FLOOD_MAX = 1_000_000
HISTORY = 4096  # frames that replay can look back on
CLASSIC_MAX, STANDARD_MAX, EXTENDED_MAX = 8, 0x7FF, 0x1FFFFFFF


@dataclass(kw_only=True)
class Replay(Action):
    """Old frames."""

    about: ClassVar[str] = "send again what passed a while ago, as it was"
    example: ClassVar[str] = "replay:frames=5,age=1.0@id=measurement,at=10"
    expects: ClassVar[tuple[str, ...]] = ("late", "early", "repeated", "sequence", "good")
    also: ClassVar[tuple[str, ...]] = (*GONE, "late")
    frames: int = option(1, "how many", low=1, high=HISTORY)
    age: float = option(0.0, "seconds ago that the last of them passed, at least", low=0.0)
    spacing: str = option("kept", "kept: as they came; burst: at once", choices=("kept", "burst"))
    _past: deque[tuple[float, Frame]] = field(default_factory=lambda: deque(maxlen=HISTORY), init=False)

    def at_moments(self) -> bool:
        """What passed is remembered."""
        return True

    def fire(self, shot: Shot) -> Frame | None:
        """The last ones that are old enough."""
        old = [x for x in self._past if x[0] <= shot.time_s - self.age][-self.frames :]
        for at, frame in old:
            delay_s = at - old[0][0] if self.spacing == "kept" else 0.0
            shot.label([frame], f"of {at:.6f} s", delay_s=delay_s)
            shot.send(replace(frame), delay_s)
        return self.passing(shot)

    def passing(self, shot: Shot) -> Frame | None:
        """To be remembered."""
        if shot.frame is not None:
            self._past.append((shot.time_s, shot.frame))
        return shot.frame


@dataclass(kw_only=True)
class Spoof(Action):
    """A forged frame."""

    about: ClassVar[str] = "a frame of one's own, counted and stamped as the sender's next one; without `set`, with the values it last had"
    example: ClassVar[str] = "spoof:message=measurement,set=gap12_m=1.5;speed1_mps=0@at=10"
    expects: ClassVar[tuple[str, ...]] = ("good", "repeated", "crc", "unknown", "format")
    also: ClassVar[tuple[str, ...]] = (*GONE, "late", "sequence")
    message: str | None = option(None, "message to forge (default: that of the frame which sets it off)")
    frame: str | None = option(None, "instead of a message: a whole frame as candump writes it, 123#DEADBEEF")
    set: str = option("", "SIGNAL=VALUE;.. in units of the signals")
    counter: int | None = option(None, "sequence counter (default: the next)", low=0)
    stamp: int | None = option(None, "sample index modulo 16 (default: the open sample's)", low=0, high=15)
    valid: bool = option(True, "false: the checksum is wrong")
    _layout: Layout | None = field(default=None, init=False)
    _whole: Frame | None = field(default=None, init=False)
    _values: list[tuple[Field, float]] = field(default_factory=list, init=False)
    _since: dict[str, tuple[Header | None, int]] = field(default_factory=dict, init=False)

    def at_moments(self) -> bool:
        """Where it is said what to forge."""
        return self.message is not None or self.frame is not None

    def prepare(self, codec: Codec) -> tuple[Layout, ...]:
        """Read frame, message and values."""
        if self.frame is not None:
            if self.message is not None or self.set:
                raise InputError("frame= is a whole frame: leave message= and set= out")
            self._whole = frame_of(self.frame, f"frame={self.frame}")
        if self.message is not None:
            self._layout = codec.message(self.message)
        if self.set:
            if self._layout is None:
                raise InputError("set= needs message=: the values are one message's")
            self._values = assignments(codec, self._layout, self.set, f"set={self.set}")
        return ()

    def fire(self, shot: Shot) -> Frame | None:
        """The frame, behind the one that set it off."""
        layout = self._layout or (shot.traffic.codec.layout(shot.frame) if shot.frame is not None else None)
        made = self._whole or (self._forged(shot, layout) if layout is not None else None)
        if made is not None:
            reception = shot.traffic.codec.reception(made)
            placed = self.counter is None and self.stamp is None
            shot.label([made], "forged", reception if reception not in ("good", "invalid") else "good|repeated" if placed else "good|repeated|early|late|sequence")
            shot.send(made)
        return shot.frame

    def _forged(self, shot: Shot, layout: Layout) -> Frame:
        last = shot.traffic.last.get(layout.name)
        data = last.data if last is not None else bytes(layout.length)
        for f, value in self._values:
            data = f.with_raw(data, f.pattern(value, clip=False))
        if layout.protection is not None:
            stamp = shot.traffic.stamp if self.stamp is None else self.stamp
            data = layout.protection.protect(data, self._count(shot, layout) % layout.protection.modulus, stamp)
            data = data if self.valid else layout.damaged(data)
        return Frame(layout.id, layout.flags if last is None else last.flags, data)

    def _count(self, shot: Shot, layout: Layout) -> int:
        """The counter behind the sender's last one and this one's own since."""
        header = shot.traffic.headers.get(layout.name)
        seen, own = self._since.get(layout.name, (None, 0))
        own = own + 1 if seen is header else 1
        self._since[layout.name] = (header, own)
        return self.counter if self.counter is not None else (header.counter if header else -1) + own


@dataclass(kw_only=True)
class Rtr(Action):
    """A remote request."""

    about: ClassVar[str] = "a remote request with the frame's identifier"
    example: ClassVar[str] = "rtr@id=measurement,every=10"
    expects: ClassVar[tuple[str, ...]] = ("format", "unknown")
    id: int | None = option(None, "identifier (default: that of the frame which sets it off)", low=0, high=EXTENDED_MAX)

    def at_moments(self) -> bool:
        """Where the identifier is said."""
        return self.id is not None

    def fire(self, shot: Shot) -> Frame | None:
        """Behind the frame."""
        number = shot.given.id if self.id is None else self.id
        extended = number > STANDARD_MAX or (self.id is None and shot.given.flags & EXTENDED)
        made = Frame(number, REMOTE | (EXTENDED if extended else 0), b"")
        shot.label([made], "request", shot.traffic.codec.reception(made))
        shot.send(made)
        return shot.frame


@dataclass(kw_only=True)
class ExtTwin(Change):
    """The same number as an identifier of the other kind."""

    about: ClassVar[str] = "the frame with the same number as an extended identifier, or a standard one where it was extended"
    example: ClassVar[str] = "exttwin@id=measurement,p=0.1"
    expects: ClassVar[tuple[str, ...]] = ("unknown",)
    copy: bool = option(True, COPY)

    def changed(self, shot: Shot) -> tuple[Frame, str] | None:
        """The twin; a number above 0x7FF has none."""
        frame = shot.given
        if frame.id > STANDARD_MAX:
            return None
        return replace(frame, flags=frame.flags ^ EXTENDED), "standard" if frame.flags & EXTENDED else "extended"


@dataclass(kw_only=True)
class FdTwin(Change):
    """The same frame in the other format."""

    about: ClassVar[str] = "the frame as one of CAN FD, or as a classic one where it was FD and has 8 bytes at most"
    example: ClassVar[str] = "fdtwin@id=measurement,p=0.1"
    expects: ClassVar[tuple[str, ...]] = ("format",)
    copy: bool = option(True, COPY)

    def changed(self, shot: Shot) -> tuple[Frame, str] | None:
        """The twin."""
        frame = shot.given
        if frame.flags & REMOTE or (frame.flags & FD and len(frame.data) > CLASSIC_MAX):
            return None
        return replace(frame, flags=(frame.flags ^ FD) & ~BRS), "classic" if frame.flags & FD else "FD"


@dataclass(kw_only=True)
class Flood(Action):
    """Many frames."""

    about: ClassVar[str] = "many frames with one identifier; on a real bus 0 wins every arbitration"
    example: ClassVar[str] = "flood:id=0x000,rate=2000,lasts=0.5@at=10"
    expects: ClassVar[tuple[str, ...]] = ("unknown", "crc", "format", "good")
    also: ClassVar[tuple[str, ...]] = (*GONE, "late", "repeated", "sequence")
    id: int = option(0, "identifier", low=0, high=EXTENDED_MAX)
    rate: float = option(1000.0, "frames a second", above=0.0, high=1e5)
    lasts: float = option(0.1, "seconds", above=0.0, high=3600.0)
    length: int = option(8, "bytes of data, chosen by chance", low=0, high=CLASSIC_MAX)
    data: bytes | None = option(None, "data instead of chosen ones")

    def at_moments(self) -> bool:
        """It needs no frame."""
        return True

    def prepare(self, codec: Codec) -> tuple[Layout, ...]:
        """All frames of a flood are made at once."""
        if self.rate * self.lasts > FLOOD_MAX:
            raise InputError(f"{self.rate * self.lasts:.0f} frames at once are more than {FLOOD_MAX}; take a shorter flood and repeat it with period=")
        return ()

    def fire(self, shot: Shot) -> Frame | None:
        """All of them, one after another."""
        flags = EXTENDED if self.id > STANDARD_MAX else 0
        if self.data is not None and len(self.data) > CLASSIC_MAX:
            flags |= FD
        for i in range(max(1, round(self.rate * self.lasts))):
            made = Frame(self.id, flags, self.data if self.data is not None else shot.random.randbytes(self.length))
            shot.label([made], "flood", shot.traffic.codec.reception(made), i / self.rate)
            shot.send(made, i / self.rate)
        return shot.frame


# Class in the identifier, and data[1], data[2], as in linux/can/error.h
ERRORS = {
    "busoff": (0x040, 0, 0), "warning": (0x004, 0x0C, 0), "passive": (0x004, 0x30, 0), "active": (0x004, 0x40, 0), "overflow": (0x004, 0x01, 0),
    "bit": (0x008, 0, 0x01), "form": (0x008, 0, 0x02), "stuff": (0x008, 0, 0x04), "noack": (0x020, 0, 0), "restarted": (0x100, 0, 0),
}  # fmt: skip
ERROR_COUNTERS = 0x200  # data[6], data[7] hold the controller's


@dataclass(kw_only=True)
class Error(Action):
    """An error frame of SocketCAN."""

    about: ClassVar[str] = "an error frame as a SocketCAN driver reports it; receivers must be listening for them"
    example: ClassVar[str] = "error:kind=passive,tx=128@at=10"
    expects: ClassVar[tuple[str, ...]] = ("unknown",)
    kind: str = option("busoff", "what it reports", choices=tuple(ERRORS))
    tx: int | None = option(None, "the controller's transmit error counter", low=0, high=255)
    rx: int | None = option(None, "and its receive error counter", low=0, high=255)

    def at_moments(self) -> bool:
        """It needs no frame."""
        return True

    def fire(self, shot: Shot) -> Frame | None:
        """Behind the frame."""
        number, controller, protocol = ERRORS[self.kind]
        counted = self.tx is not None or self.rx is not None
        data = bytes([0, controller, protocol, 0, 0, 0, self.tx or 0, self.rx or 0])
        made = Frame(number | (ERROR_COUNTERS if counted else 0), ERROR, data)
        shot.label([made], self.kind, "unknown")
        shot.send(made)
        return shot.frame
