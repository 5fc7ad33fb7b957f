"""The detector on any python-can interface or on a log, on any operating system."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

from hullguard.bus import candump
from hullguard.bus.link import CanLink
from hullguard.core.native import Frame, Native, Node, Verdict
from hullguard.plant.told import ToldModel

OK = 1  # hg_status

STAMP_AGE_S = 10.0  # older ones are of another clock
STAMPS = 7  # samples ahead that a stamp can tell


class Detector:
    """A node fed with frames from anywhere; verdict frames go to `send`, verdicts to `watch`.

    With `period_s` the time stamps of the closing frames are watched: a stamp tells a gap of up to 7 samples, a longer one is an outage.
    """

    node: Node

    def __init__(self, native: Native, start: int, lockstep: bool, send: Callable[[Frame], None] | None, watch: Callable[[Verdict], None], period_s: float | None = None) -> None:
        self.told = ToldModel(native.library, native.tables.name, native.tables.hash, native.node.status, native.tables.status)
        self.begin(Node(native, start), native.tables.groups[native.tables.closing].message.id, lockstep, send, watch, period_s)

    def begin(self, node: Any, closing: int, lockstep: bool, send: Callable[[Frame], None] | None, watch: Callable[[Verdict], None], period_s: float | None) -> None:
        """With a node of any kind that has the methods of Node; `closing` is the identifier of the frame that closes a sample."""
        self.node, self._closing = node, closing
        self._lockstep, self._send, self._watch, self._period = lockstep, send, watch, period_s
        self._closed_at: float | None = None
        self._steps_since = 0
        self.samples = self.outages = 0

    def take(self, frame: Frame, time_s: float) -> int:
        """One frame from the bus, with its time stamp; the status of the library."""
        closing = frame.id == self._closing
        if closing and self._period is not None and self._closed_at is not None:
            missed = round((time_s - self._closed_at) / self._period) - 1 - self._steps_since
            self.node.expect(min(max(missed, 0), STAMPS))
            if missed > STAMPS:
                self.node.outage()
                self.outages += 1
        self.told.take(frame)
        status = self.node.receive(frame)
        self.steps()
        if closing and status == OK:
            self._closed_at, self._steps_since = time_s, 0
        return status

    def overdue(self) -> None:
        """The closing frame has not come in time: the sample is closed without it."""
        self.node.overdue()
        self.steps()

    def steps(self) -> None:
        """All steps that are due."""
        while (verdict := self.node.step()) is not None:
            self.samples += 1
            self._steps_since += 1
            self._watch(verdict)
            for frame in self.node.report(self._lockstep):
                if self._send is not None:
                    self._send(frame)
        for frame in self.node.answers():
            if self._send is not None:
                self._send(frame)


def from_log(detector: Detector, entries: Iterable[candump.Entry], samples: int) -> None:
    """Feed a log, whole or until `samples` have passed; verdict frames in it are another node's and pass by as unknown."""
    for entry in entries:
        if samples and detector.samples >= samples:
            return
        detector.take(entry.frame, entry.time_s)


def from_bus(detector: Detector, link: CanLink, period_s: float, deadline: bool, samples: int, stop: Callable[[], bool]) -> None:
    """Feed frames as they come until `samples` have passed (0: for ever) or `stop` says so. An overdue closing frame closes its sample.

    A frame that arrived behind the deadline says that nothing in time is waiting any more, so a flood of foreign frames holds nothing up.
    """
    next_close: float | None = None
    while not stop() and (samples == 0 or detector.samples < samples):
        wait = 0.2 if next_close is None else min(0.2, max(0.0, next_close - time.monotonic()))
        got = link.receive(wait)
        arrived = time.monotonic() if got is None else _arrival(got[1])
        before = detector.samples
        late = next_close is not None and arrived >= next_close
        if late:
            detector.overdue()
        closed = detector.samples
        if got is not None:
            detector.take(got[0], got[1] or time.monotonic())
        if deadline and detector.samples != before:
            # Half a period of patience: a closing frame may be late, not absent.
            base = next_close - 0.5 * period_s if late and next_close is not None and detector.samples == closed else time.monotonic()
            next_close = base + 1.5 * period_s


def _arrival(stamp: float) -> float:
    """A frame's time stamp, where it is one of this machine's clock, by the clock that deadlines go by."""
    age = time.time() - stamp
    return time.monotonic() - (age if 0.0 <= age < STAMP_AGE_S else 0.0)
