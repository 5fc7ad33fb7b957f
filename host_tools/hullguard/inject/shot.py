"""What an action gets to work with when its directive fires or a frame passes, and what every action has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random
from typing import ClassVar

from hullguard.core.native import Frame
from hullguard.core.protect import Header
from hullguard.errors import InputError
from hullguard.inject.codec import Codec, Field, Layout
from hullguard.inject.options import option

STAMP_MODULUS = 16
GONE = ("lost", "early", "overdue", "untrusted")  # consequences of a frame that a receiver does not get or refuses; early and overdue: of closing ones
COPY = "the changed frame goes out beside the original, which a tap can do, not in its place"


@dataclass
class Traffic:
    """What has come in so far, before any directive touched it."""

    codec: Codec
    frames: int = 0
    k: int = 0  # closing frames so far: the sample that is open
    stamp: int = 0  # of the open sample, where a header has told one
    watched: dict[str, tuple[Layout, Field]] = field(default_factory=dict)  # what conditions look at, as they call it
    values: dict[str, float] = field(default_factory=dict)  # of these
    last: dict[str, Frame] = field(default_factory=dict)  # by message
    headers: dict[str, Header] = field(default_factory=dict)

    def note(self, frame: Frame) -> bool:
        """One more frame; whether it closes its sample. Damaged ones tell nothing."""
        self.frames += 1
        layout = self.codec.layout(frame)
        header = layout.protection.check(frame.data) if layout is not None and layout.protection is not None else None
        if layout is None or (layout.protection is not None and header is None):
            return False
        self.last[layout.name] = frame
        for name, (owner, f) in self.watched.items():
            if owner is layout and f.present(frame.data):
                self.values[name] = f.value(frame.data)
        closes = self.codec.closing is layout
        if header is not None:
            self.headers[layout.name] = header
            if header.stamp is not None and (closes or self.codec.closing is None):
                self.stamp = (header.stamp + int(closes)) % STAMP_MODULUS
        return closes


@dataclass
class Pending:
    """A frame on its way, or with none a moment to be woken at."""

    frame: Frame | None
    stage: int  # the first directive that is to see it
    real: bool = False  # one that came in, not an injected one
    index: int | None = None
    over: bool = False  # sent, or called off
    told: str = ""  # what the label of the last directive that made or changed it expects


@dataclass
class Shot:
    """One frame in front of one directive, or a moment (frame None)."""

    frame: Frame | None
    time_s: float
    random: Random
    traffic: Traffic
    send: Callable[..., Pending]  # send(frame, delay_s=0.0, original=None): a further frame behind this one; `original`: the pending one it stood for
    label: Callable[..., None]  # label(sent, detail="", expects=None, delay_s=0.0): an event of the ledger

    @property
    def given(self) -> Frame:
        """The frame, where the action only ever gets one."""
        assert self.frame is not None
        return self.frame


@dataclass(kw_only=True)
class Action:
    """What a directive does. An instance belongs to one injector and holds the state of one directive.

    fire() and passing() return what becomes of the frame itself: itself, a changed one, or None for nothing; further ones go out by shot.send.
    """

    about: ClassVar[str] = ""
    example: ClassVar[str] = ""
    needs_gateway: ClassVar[str] = ""  # what a tap cannot do of it; empty: a tap can
    expects: ClassVar[tuple[str, ...]] = ()  # each event raises one of these health counters of a receiver by one
    also: ClassVar[tuple[str, ...]] = ()  # what may rise besides, in consequence
    once: ClassVar[bool] = False  # fires once where the trigger does not choose frames
    lasting: ClassVar[bool] = False  # set off by a moment, it works on frames for a while

    def gateway_only(self) -> str:
        """Why a tap cannot do it with these options; empty: it can."""
        return self.needs_gateway

    def at_moments(self) -> bool:
        """Whether it can fire without a frame, with these options."""
        return False

    def prepare(self, codec: Codec) -> tuple[Layout, ...]:
        """Look up names; the messages it is about where no id= says so, none for all."""
        return ()

    def fire(self, shot: Shot) -> Frame | None:
        """The trigger says so."""
        raise NotImplementedError

    def passing(self, shot: Shot) -> Frame | None:
        """A frame of the trigger's identifiers for which it does not fire."""
        return shot.frame


@dataclass(kw_only=True)
class Change(Action):
    """An action that makes another frame of one; `copy`: beside it, instead of in its place."""

    copy: bool = option(False, COPY)
    needs_gateway: ClassVar[str] = "change a frame"

    def gateway_only(self) -> str:
        """A changed copy needs no gateway."""
        return "" if self.copy else self.needs_gateway

    def changed(self, shot: Shot) -> tuple[Frame, str] | None:
        """The other frame and what was done; None: it cannot be done to this one."""
        raise NotImplementedError

    def fire(self, shot: Shot) -> Frame | None:
        """Change it, and tell how a receiver must count what comes out."""
        made = self.changed(shot)
        if made is None or made[0] == shot.frame:
            return shot.frame
        frame, detail = made
        shot.label([frame], detail, shot.traffic.codec.reception(frame))
        if not self.copy:
            return frame
        shot.send(frame)
        return shot.frame


def assignments(codec: Codec, layout: Layout, text: str, where: str) -> list[tuple[Field, float]]:
    """SIGNAL=VALUE;SIGNAL=VALUE of one message."""
    made = []
    for part in (p for p in text.split(";") if p.strip()):
        name, _, value = (x.strip() for x in part.partition("="))
        if name not in layout.fields:
            raise InputError(f"{where}: message '{layout.name}' has no signal '{name}'; it has {', '.join(layout.fields)}")
        try:
            made.append((layout.fields[name], float(value)))
        except ValueError as error:
            raise InputError(f"{where}: {part.strip()}: expected SIGNAL=NUMBER") from error
    return made
