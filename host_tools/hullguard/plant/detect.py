"""The detector on any python-can interface or on a log, on any operating system."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from hullguard.bus import candump
from hullguard.bus.link import CanLink
from hullguard.core.native import Frame, Native, Node, Verdict

BUSY = -11


class Detector:
    """A node fed with frames from anywhere; verdict frames go to `send`, verdicts to `watch`."""

    def __init__(self, native: Native, start: int, lockstep: bool, send: Callable[[Frame], None] | None, watch: Callable[[Verdict], None]) -> None:
        self.node = Node(native, start)
        self._lockstep, self._send, self._watch = lockstep, send, watch
        self.samples = 0

    def take(self, frame: Frame) -> None:
        """One frame from the bus."""
        self.node.receive(frame)
        self.steps()

    def steps(self) -> None:
        """All steps that are due."""
        while (verdict := self.node.step()) is not None:
            self.samples += 1
            self._watch(verdict)
            for frame in self.node.report(self._lockstep):
                if self._send is not None:
                    self._send(frame)


def from_log(detector: Detector, entries: Iterable[candump.Entry]) -> None:
    """Feed a whole log; verdict frames in it are another node's and pass by as unknown."""
    for entry in entries:
        detector.take(entry.frame)


def from_bus(detector: Detector, link: CanLink, period_s: float, deadline: bool, samples: int, stop: Callable[[], bool]) -> None:
    """Feed frames as they come until `samples` have passed (0: for ever) or `stop` says so. An overdue closing frame closes its sample."""
    next_close: float | None = None
    while not stop() and (samples == 0 or detector.samples < samples):
        wait = 0.2 if next_close is None else min(0.2, max(0.0, next_close - time.monotonic()))
        got = link.receive(wait)
        before = detector.samples
        if got is not None:
            detector.take(got[0])
        elif next_close is not None and time.monotonic() >= next_close:
            detector.node.overdue()
            detector.steps()
        if deadline and detector.samples != before:
            # Half a period of patience: a closing frame may be late, not absent.
            base = time.monotonic() if got is not None or next_close is None else next_close - 0.5 * period_s
            next_close = base + 1.5 * period_s
