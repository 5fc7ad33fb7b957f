"""An injector on python-can buses: as a tap on one, as a gateway between two, or on a log without any bus."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from hullguard.bus.candump import ERROR, Entry
from hullguard.bus.link import CanLink
from hullguard.core.native import Frame
from hullguard.errors import BusError
from hullguard.inject.engine import Injector, Sent

POLL_S = 0.05  # how soon a reader sees that it is to end
Sink = Callable[[Sent], None]


class _Reader(threading.Thread):
    """Frames of one bus into a common queue; an error goes there too, and ends it."""

    def __init__(self, link: CanLink, into: queue.Queue[tuple[CanLink, Frame | BusError]]) -> None:
        super().__init__(daemon=True)
        self._link, self._into, self._ended = link, into, threading.Event()

    def run(self) -> None:
        """Until end()."""
        try:
            while not self._ended.is_set():
                got = self._link.receive(POLL_S)
                if got is not None:
                    self._into.put((self._link, got[0]))
        except BusError as error:
            self._into.put((self._link, error))

    def end(self) -> None:
        """Let the bus go, so that it can be closed."""
        self._ended.set()
        self.join()


def attach(injector: Injector, near: CanLink, far: CanLink | None, stop: Callable[[], bool], sink: Sink = lambda sent: None, ready: Callable[[], None] = lambda: None) -> None:
    """Work until `stop` says so: without `far` as a tap on `near`, with it as a gateway that injects on the way from near to far.

    What comes the other way is handed back as it is. Error frames of a bus stay on it. `sink` gets what was sent, with seconds since the start.
    """
    frames: queue.Queue[tuple[CanLink, Frame | BusError]] = queue.Queue()
    readers = [_Reader(link, frames) for link in (near, far) if link is not None]
    started = time.monotonic()

    def put(out: Iterable[Sent]) -> None:
        for sent in out:
            (far or near).send(sent.frame)
            sink(sent)

    for r in readers:
        r.start()
    try:
        ready()
        while not stop():
            due = injector.next_due()
            wait = POLL_S if due is None else min(POLL_S, max(0.0, due - (time.monotonic() - started)))
            try:
                link, frame = frames.get(timeout=wait) if wait > 0.0 else frames.get_nowait()
            except queue.Empty:
                put(injector.due(time.monotonic() - started))
                continue
            if isinstance(frame, BusError):
                raise frame
            if link is far:
                if not frame.flags & ERROR:
                    near.send(frame)
            elif far is None or not frame.flags & ERROR:
                put(injector.take(frame, time.monotonic() - started))
    finally:
        for r in readers:
            r.end()


def on_log(injector: Injector, entries: Iterable[Entry]) -> Iterator[Entry]:
    """A log as a gateway would have made it; the injector's time begins with the first entry."""
    first: Entry | None = None
    last: Entry | None = None
    for last in entries:
        first = first or last
        for sent in injector.take(last.frame, max(0.0, last.time_s - first.time_s)):
            yield replace(last, time_s=first.time_s + sent.time_s, frame=sent.frame)
    if first is not None and last is not None:
        for sent in injector.finish():
            yield replace(last, time_s=first.time_s + sent.time_s, frame=sent.frame)


def play(entries: Iterable[Entry], link: CanLink, stop: Callable[[], bool], speed: float = 1.0) -> int:
    """Send recorded frames at their times, byte for byte; how many. The first goes out at once."""
    count, base, started = 0, None, time.monotonic()
    for entry in entries:
        base = entry.time_s if base is None else base
        due = started + (entry.time_s - base) / speed
        while not stop() and (left := due - time.monotonic()) > 0.0:
            time.sleep(min(left, POLL_S))
        if stop():
            break
        link.send(entry.frame)
        count += 1
    return count
