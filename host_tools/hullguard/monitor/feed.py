"""From a bus or a log into the monitor, with a beat between frames at which others may look."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator

import can

from hullguard.bus import candump
from hullguard.bus.overflow import OverflowLink
from hullguard.core.native import Frame
from hullguard.monitor.state import Monitor
from hullguard.plant.detect import from_bus, from_log

BEAT_S = 0.1  # at most between two beats of a log that is played slowly

Beat = Callable[[float], bool]  # given the present on the clock of the stamps, before what comes then; True: stop


class _Tap(OverflowLink):
    """Hands on what concerns the detector; the monitor notes everything."""

    def __init__(self, bus: can.BusABC, monitor: Monitor, beat: Beat) -> None:
        super().__init__(bus)
        self._monitor, self._beat = monitor, beat
        self._behind_s: float | None = None  # from this host's monotonic clock to the stamps'

    def receive(self, timeout_s: float) -> tuple[Frame, float] | None:
        """The next frame for the detector. None says that the queue was empty: what waits in it has come in time, however late it is read."""
        end = time.monotonic() + timeout_s
        while (got := super().receive(max(0.0, end - time.monotonic()))) is not None:
            now = time.monotonic()
            frame, stamp = got[0], got[1] or now
            self._behind_s = stamp - now
            self._monitor.dropped = self.dropped
            if self._monitor.note(frame, stamp):
                return frame, stamp
            if self.stop():
                return None
        return None

    def stop(self) -> bool:
        """Time goes on, with or without frames; before the first of them by this host's clock."""
        if self._behind_s is None:
            return self._beat(time.time())
        self._monitor.move(time.monotonic() + self._behind_s)
        return self._beat(self._monitor.time_s)


def watch_bus(monitor: Monitor, bus: can.BusABC, deadline: bool, samples: int, beat: Beat) -> None:
    """Until `samples` have passed (0: for ever) or the beat says stop."""
    tap = _Tap(bus, monitor, beat)
    monitor.dropped = tap.dropped
    from_bus(monitor, tap, monitor.design.model.sample_time_s, deadline, samples, tap.stop)


def watch_log(monitor: Monitor, entries: Iterable[candump.Entry], speed: float, samples: int, beat: Beat) -> None:
    """A log at `speed` times its own pace, infinity: at once. After the last sample the ECU has its say, before the next one begins."""
    from_log(monitor, _played(monitor, entries, speed, samples, beat), 0)
    monitor.finish()


def _played(monitor: Monitor, entries: Iterable[candump.Entry], speed: float, samples: int, beat: Beat) -> Iterator[candump.Entry]:
    began, first = time.monotonic(), None
    for entry in entries:
        if samples and monitor.samples >= samples and monitor.concerns(entry.frame):
            return
        first = entry.time_s if first is None else first
        due = began + (entry.time_s - first) / speed
        while (left := due - time.monotonic()) > 0.0:
            if beat(max(monitor.time_s, entry.time_s - left * speed)):
                return
            time.sleep(min(left, BEAT_S))
        if beat(entry.time_s):
            return
        if monitor.note(entry.frame, entry.time_s):
            yield entry
