"""Frames that do not come, come late, come twice, or in another order; only a gateway can do most of this."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

from hullguard.bus.candump import ERROR
from hullguard.core.native import Frame
from hullguard.inject.options import option
from hullguard.inject.shot import GONE, Action, Pending, Shot

LASTS = "seconds"
LOST = ("lost",)
MOVED = (*GONE, "sequence")
BUS_OFF = Frame(0x040, ERROR, bytes(8))
RESTARTED = Frame(0x100, ERROR, bytes(8))


@dataclass(kw_only=True)
class Swallow(Action):
    """Frames that never come."""

    needs_gateway: ClassVar[str] = "keep a frame from arriving"
    expects: ClassVar[tuple[str, ...]] = LOST
    also: ClassVar[tuple[str, ...]] = GONE

    def swallowed(self, shot: Shot, how: str) -> Frame | None:
        """What becomes of one."""
        shot.label([], how)
        return None


@dataclass(kw_only=True)
class Hold(Action):
    """Frames that come later than they were sent."""

    needs_gateway: ClassVar[str] = "hold a frame back"
    expects: ClassVar[tuple[str, ...]] = ("late", "good", "sequence")
    also: ClassVar[tuple[str, ...]] = MOVED


@dataclass(kw_only=True)
class Drop(Swallow):
    """Nothing."""

    about: ClassVar[str] = "swallow the frame"
    example: ClassVar[str] = "drop@id=measurement,nth=5"

    def fire(self, shot: Shot) -> Frame | None:
        """Gone."""
        return self.swallowed(shot, "dropped")


@dataclass(kw_only=True)
class Silence(Swallow):
    """A sender that says nothing for a while."""

    about: ClassVar[str] = "swallow every frame for a while, from the frame or moment on that sets it off"
    example: ClassVar[str] = "silence:lasts=0.5@id=measurement,at=10"
    lasting: ClassVar[bool] = True
    lasts: float = option(1.0, LASTS, above=0.0)
    until_s: float = field(default=-math.inf, init=False)

    def at_moments(self) -> bool:
        """A moment sets it off too."""
        return True

    def fire(self, shot: Shot) -> Frame | None:
        """From now on."""
        self.until_s = shot.time_s + self.lasts
        return self.passing(shot)

    def passing(self, shot: Shot) -> Frame | None:
        """Gone, while it lasts."""
        if shot.frame is None or shot.time_s >= self.until_s:
            return shot.frame
        return self.swallowed(shot, "silent")


@dataclass(kw_only=True)
class BusOff(Silence):
    """A controller that left the bus."""

    about: ClassVar[str] = "an error frame says bus-off, the sender is silent for a while, an error frame says restarted"
    example: ClassVar[str] = "busoff:lasts=0.3@at=10"
    needs_gateway: ClassVar[str] = "silence a sender (error:kind=busoff sends the error frame alone)"
    also: ClassVar[tuple[str, ...]] = (*GONE, "unknown")

    def fire(self, shot: Shot) -> Frame | None:
        """Off; a second time while it is off changes nothing."""
        if shot.time_s >= self.until_s:
            for frame, delay_s, what in ((BUS_OFF, 0.0, "bus-off"), (RESTARTED, self.lasts, "restarted")):
                shot.label([frame], what, "unknown", delay_s)
                shot.send(frame, delay_s)
            self.until_s = shot.time_s + self.lasts
        return self.passing(shot)


@dataclass(kw_only=True)
class Delay(Hold):
    """Later."""

    about: ClassVar[str] = "the frame comes later; with jitter, later by chance, and out of order where that is so"
    example: ClassVar[str] = "delay:by=0.15,jitter=0.05@id=measurement,p=0.2"
    by: float = option(0.1, "seconds", low=0.0)
    jitter: float = option(0.0, "seconds more at most", low=0.0)

    def fire(self, shot: Shot) -> Frame | None:
        """On its way."""
        delay_s = self.by + (shot.random.uniform(0.0, self.jitter) if self.jitter else 0.0)
        if delay_s == 0.0:
            return shot.frame
        shot.send(shot.given, delay_s, original=True)
        shot.label([shot.given], f"by {delay_s:.6f} s")
        return None


@dataclass(kw_only=True)
class Reorder(Hold):
    """Behind others."""

    about: ClassVar[str] = "the frame waits until others of the trigger's identifiers have passed it"
    example: ClassVar[str] = "reorder@id=measurement|control,p=0.1"
    behind: int = option(1, "how many pass it", low=1)
    patience: float = option(1.0, "seconds that it waits at most", above=0.0)
    _held: Pending | None = field(default=None, init=False)
    _left: int = field(default=0, init=False)

    def fire(self, shot: Shot) -> Frame | None:
        """Hold it, unless another one is held."""
        if self._held is not None and not self._held.over:
            return self.passing(shot)
        self._held, self._left = shot.send(shot.given, self.patience, original=True), self.behind
        shot.label([shot.given], f"behind {self.behind} more")
        return None

    def passing(self, shot: Shot) -> Frame | None:
        """One that passes the held frame."""
        if self._held is not None and not self._held.over:
            self._left -= 1
            if self._left == 0:
                self._held.over = True
                shot.send(self._held.frame, original=self._held)
        return shot.frame


@dataclass(kw_only=True)
class Duplicate(Action):
    """More than once."""

    about: ClassVar[str] = "the frame once more, or several times"
    example: ClassVar[str] = "duplicate@id=measurement,p=0.1"
    expects: ClassVar[tuple[str, ...]] = ("repeated",)
    also: ClassVar[tuple[str, ...]] = ("late", *MOVED)
    times: int = option(1, "copies", low=1, high=1000)
    gap: float = option(0.0, "seconds between them", low=0.0)

    def fire(self, shot: Shot) -> Frame | None:
        """Copies behind the frame."""
        for i in range(1, self.times + 1):
            shot.label([shot.given], f"copy {i}", "repeated|late|sequence" if self.gap else None, i * self.gap)
            shot.send(replace(shot.given), i * self.gap)
        return shot.frame
