"""What the ECU says of itself: its verdict and status frames."""

from __future__ import annotations

from dataclasses import replace

from hullguard.core.native import Frame, Native, Verdict, read_verdict
from hullguard.design.design import Design
from hullguard.monitor.snapshot import EcuSeen, VerdictSeen
from hullguard.plant.run import candidate_names
from hullguard.plant.told import another, read_status

SILENT_HEARTBEATS = 3  # a node that has said nothing for so many is silent
STAMPS = 16  # a monitor that began later counts samples from another one, but alike modulo 16
TOLD = 4096  # a verdict frame tells its sample modulo this


def named(design: Design, v: Verdict) -> VerdictSeen:
    """A verdict by names."""
    bus = {g.name: b for g, b in zip(design.tables.groups, v.bus, strict=True)}
    return VerdictSeen(v.k, v.plant, tuple(candidate_names(design, v.candidates)), bus, v.refused)


def _unwrapped(k: int, own: Verdict | None) -> int:
    """The sample that a verdict frame means, where node and monitor count from the same one; otherwise as it was told."""
    if own is None:
        return k
    behind = (own.k - k + STAMPS) % TOLD - STAMPS
    return own.k - behind if behind < STAMPS else k


class EcuWatch:
    """The node at the other end, as far as its frames tell."""

    def __init__(self, design: Design, native: Native) -> None:
        self._design, self._native = design, native
        self.expected = native.tables.hash  # a pass over all tables: taken once
        self._quiet_s = SILENT_HEARTBEATS * native.tables.heartbeat * design.model.sample_time_s
        self.verdict: VerdictSeen | None = None
        self._time_s: float | None = None
        self._status_s: float | None = None
        self.hash: int | None = None
        self._lost: int | None = None
        self._refused: int | None = None
        self.agrees: bool | None = None
        self.clear()

    def clear(self) -> None:
        """Counts begin again."""
        self.frames = self.replies = self.damaged = 0

    def take(self, frame: Frame, time_s: float, own: Verdict | None) -> Verdict | None:
        """A verdict or status frame, beside the monitor's last verdict. A good verdict frame's content comes back."""
        if frame.id == self._native.tables.status.id:
            self._status(frame, time_s)
            return None
        told = read_verdict(self._native, frame)
        if told is None:
            self.damaged += 1
            return None
        self._heard(time_s)
        self.replies += told.reply
        if own is not None and (own.k - told.k) % STAMPS == 0:
            self.agrees = replace(told, k=own.k, reply=False) == own
        self.verdict = named(self._design, replace(told, k=_unwrapped(told.k, own)))
        return told

    def _heard(self, time_s: float) -> None:
        self.frames += 1
        self._time_s = time_s

    def _status(self, frame: Frame, time_s: float) -> None:
        """Model hash, frames lost, frames refused."""
        told = read_status(self._native.library, self._native.node.status, frame)
        if told is None:
            self.damaged += 1
            return
        self._heard(time_s)
        self._status_s = time_s
        self.hash, self._lost, self._refused = told

    @property
    def model(self) -> str:
        """Whether it runs this model."""
        return "unknown" if self.hash is None else "match" if self.hash == self.expected else "other"

    @property
    def complaint(self) -> str | None:
        """A line for whoever has to do something about a node of another model."""
        return another(self._design.model.name, self.hash, self.expected)

    def state(self, now_s: float) -> str:
        """Whether it speaks."""
        return "unheard" if self._time_s is None else "silent" if now_s - self._time_s > self._quiet_s else "speaking"

    def seen(self, now_s: float) -> EcuSeen:
        """For a snapshot."""
        return EcuSeen(
            state=self.state(now_s),
            verdict=self.verdict,
            age_s=None if self._time_s is None else max(0.0, now_s - self._time_s),
            heartbeat_s=None if self._status_s is None else max(0.0, now_s - self._status_s),
            model=self.model,
            hash="" if self.hash is None else f"{self.hash:08x}",
            lost=self._lost,
            refused=self._refused,
            agrees=self.agrees,
            frames=self.frames,
            replies=self.replies,
            damaged=self.damaged,
        )
