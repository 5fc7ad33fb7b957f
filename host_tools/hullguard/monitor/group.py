"""One sender as the bus shows it: intervals between its frames, rate, age, and where lost frames were lost."""

from __future__ import annotations

from collections import Counter

from hullguard.design.tables import EXTENDED, GroupTable
from hullguard.monitor.snapshot import GroupSeen, IntervalsSeen

RATE_S = 1.0
DROPPED_MODULUS = 1 << 32  # of the kernel's count


class GroupWatch:
    """Counts of one group. The library's link health is told from outside, before and after each frame."""

    def __init__(self, table: GroupTable) -> None:
        self.table = table
        self.last_k: int | None = None
        self._time_s: float | None = None
        self._dropped: int | None = None
        self.clear()

    def clear(self) -> None:
        """Counts begin again; what the next interval begins with stays."""
        self.frames = self.lost_bus = self.lost_host = 0
        self._intervals: Counter[int] = Counter()
        self._last: int | None = None
        self._rate, self._mark, self._marked = 0.0, 0, self._time_s

    def frame(self, time_s: float) -> None:
        """A frame with the group's identifier, good or not."""
        self.frames += 1
        self._time_s = time_s
        if self._marked is None:
            self._marked = time_s

    def booked(self, k: int) -> None:
        """A good frame of sample k."""
        if self.last_k is not None and k > self.last_k:
            self._last = k - self.last_k
            self._intervals[self._last] += 1
        self.last_k = k

    def lost(self, count: int, dropped: int | None) -> None:
        """A frame showed that `count` were lost before it; `dropped` is what this host has dropped up to it, of any identifier.

        A frame lost in a stretch in which this host dropped some may be one of those: it is the host's as far as its count goes. What
        no host loss can explain is the bus's.
        """
        before, self._dropped = self._dropped, dropped
        own = 0 if dropped is None or before is None else (dropped - before) % DROPPED_MODULUS
        self.lost_host += min(count, own)
        self.lost_bus += count - min(count, own)

    def move(self, time_s: float) -> None:
        """Time goes on: the rate is of whole seconds."""
        if self._marked is not None and time_s - self._marked >= RATE_S:
            self._rate = (self.frames - self._mark) / (time_s - self._marked)
            self._mark, self._marked = self.frames, time_s

    def seen(self, now_s: float, bus: str, counters: dict[str, int]) -> GroupSeen:
        """For a snapshot."""
        message, every = self.table.message, self._intervals
        count = sum(every.values())
        intervals = IntervalsSeen(
            last=self._last,
            least=min(every, default=None),
            mean=sum(n * c for n, c in every.items()) / count if count else None,
            most=max(every, default=None),
            histogram=dict(sorted(every.items())),
        )
        return GroupSeen(
            name=self.table.name,
            id=message.id,
            extended=bool(message.flags & EXTENDED),
            bus=bus,
            frames=self.frames,
            rate_hz=self._rate,
            age_s=None if self._time_s is None else max(0.0, now_s - self._time_s),
            interval_max=self.table.interval_max,
            intervals=intervals,
            lost_bus=self.lost_bus,
            lost_host=self.lost_host,
            counters=counters,
        )
