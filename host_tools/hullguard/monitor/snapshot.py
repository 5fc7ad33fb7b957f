"""What is known at one moment, immutable: made by the reader, shown by any number of renderers. Times in seconds, intervals in samples, loads as shares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

AILMENTS = ("stale", "lossy", "absent")


@dataclass(frozen=True)
class SignalSeen:
    """What the monitor's detector holds of a signal."""

    name: str
    value: float
    radius: float


@dataclass(frozen=True)
class ResidualSeen:
    """A residual and its threshold."""

    name: str  # for people
    column: str  # 1.2: as in signals.csv
    r: float
    J: float
    ratio: float  # |r| / J
    most: float  # the largest |r| / J so far


@dataclass(frozen=True)
class IntervalsSeen:
    """Samples between two frames of a group."""

    last: int | None
    least: int | None
    mean: float | None
    most: int | None
    histogram: dict[int, int]


@dataclass(frozen=True)
class GroupSeen:
    """One sender."""

    name: str
    id: int
    extended: bool
    bus: str  # health of its link as the monitor's detector sees it
    frames: int  # with its identifier, refused ones too
    rate_hz: float
    age_s: float | None  # since its last frame
    interval_max: int  # the longest that its trigger allows
    intervals: IntervalsSeen
    lost_bus: int
    lost_host: int
    counters: dict[str, int]  # hg_link_health, by its own names


@dataclass(frozen=True)
class VerdictSeen:
    """A verdict by names."""

    k: int
    plant: str
    candidates: tuple[str, ...]
    bus: dict[str, str]
    refused: bool

    def unwell(self, say: Callable[[str], str] = str) -> str:
        """Senders whose link is not good, by what ails them, worst first; `say` spells the ailment."""
        kinds = [h for h in AILMENTS if h in self.bus.values()]
        names = {h: [g for g, x in self.bus.items() if x == h] for h in kinds}
        return "; ".join(("all senders" if len(names[h]) == len(self.bus) > 1 else ", ".join(names[h])) + f" {say(h)}" for h in kinds)


@dataclass(frozen=True)
class EcuSeen:
    """What the ECU says of itself on the bus."""

    state: str  # unheard | speaking | silent
    verdict: VerdictSeen | None
    age_s: float | None  # since its last verdict or status frame
    heartbeat_s: float | None  # since its last status frame
    model: str  # unknown | match | other
    hash: str  # of its model, where heard
    lost: int | None  # frames that it has lost, saturated at 255
    refused: int | None
    agrees: bool | None  # do its verdict and the monitor's of the same sample say the same? None before both have spoken of one
    frames: int
    replies: int  # verdict frames that only answer a tick: lockstep
    damaged: int


@dataclass(frozen=True)
class LoadSeen:
    """Load of the bus by every frame seen."""

    mean: float
    now: float
    peak: float
    p99: float
    bound: float  # of this model's frames
    bits: int
    reply_bits: int  # of them in lockstep replies
    bitrate_bps: int


@dataclass(frozen=True)
class ErrorsSeen:
    """Error frames of this host's controller."""

    frames: int
    state: str
    last: str
    kinds: dict[str, int]


@dataclass(frozen=True)
class ChangeSeen:
    """Something said for the first time."""

    time_s: float
    k: int | None
    what: str  # monitor | ecu | controller | model
    text: str


@dataclass(frozen=True)
class Snapshot:
    """Everything that is shown."""

    model: str
    model_hash: str
    source: str
    time_s: float
    elapsed_s: float
    samples: int
    frames: int
    monitor: VerdictSeen | None
    ecu: EcuSeen
    signals: tuple[SignalSeen, ...]
    residuals: tuple[ResidualSeen, ...]
    groups: tuple[GroupSeen, ...]
    load: LoadSeen
    errors: ErrorsSeen
    host_dropped: int | None  # frames of any identifier that this host dropped; None: the interface does not tell
    overdue: int  # samples closed without their closing frame
    outages: int
    unknown: int
    unknown_ids: dict[str, int]
    known_faults: bool  # does the model name faults, so that an alarm has candidates?
    changes: tuple[ChangeSeen, ...] = field(default=())
    ended: bool = False

    @property
    def lost_bus(self) -> int:
        """Frames of the model that the bus lost."""
        return sum(g.lost_bus for g in self.groups)

    @property
    def lost_host(self) -> int:
        """Frames of the model that this host dropped."""
        return sum(g.lost_host for g in self.groups)

    @property
    def largest(self) -> ResidualSeen | None:
        """The residual nearest to its threshold, or the furthest above it."""
        return max(self.residuals, key=lambda x: x.ratio, default=None)
