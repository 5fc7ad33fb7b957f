"""`hullguard monitor`: a bus or a log, in a terminal or as lines."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from hullguard.bus import candump, formats
from hullguard.bus.link import opened
from hullguard.commands import bus_options, make_speed, prepared, signalled
from hullguard.core.library import library
from hullguard.core.native import MOVING, REST, Native
from hullguard.design.design import Design
from hullguard.errors import ExpectationError, HullguardError, InputError
from hullguard.monitor.feed import Beat, watch_bus, watch_log
from hullguard.monitor.plain import Lines
from hullguard.monitor.snapshot import Snapshot
from hullguard.monitor.state import Monitor

RATE_MAX_HZ = 30.0
WAIT_S = 0.1

Read = Callable[[Beat], None]  # reads the source to its end, or until the beat says stop


def run_monitor(args: argparse.Namespace) -> int:
    """`hullguard monitor`."""
    pictures = _checked(args)
    _, made = prepared(args)
    plain = args.plain or args.json or not _terminal()
    lines = Lines((lambda text: None) if args.quiet and not args.json else lambda text: print(text, flush=True), args.every, args.json) if plain else None
    monitor = _monitor(args, made, lines)
    with signalled() as stopped, _source(args, monitor, plain) as read:
        last = _view(args, monitor, read, stopped) if lines is None else _lines(lines, monitor, read, stopped)
    for path in pictures:
        from hullguard.monitor.picture import write

        write(path, last, "END OF LOG" if last.ended else "LIVE")
    if monitor.ecu.complaint is not None:
        raise ExpectationError(monitor.ecu.complaint)
    return 0


def _checked(args: argparse.Namespace) -> list[Path]:
    """Options that contradict one another are refused before anything begins; the files of --snapshot."""
    if not args.log and not bus_options(args):
        raise InputError("monitor needs a bus (-i INTERFACE -c CHANNEL) or a log (--log FILE)")
    if args.log and bus_options(args):
        raise InputError("--log and a bus: give one of them")
    if args.speed is not None and not args.log:
        raise InputError("--speed is for a log: a bus has its own")
    if not 0.0 < args.every < math.inf:
        raise InputError(f"--every {args.every:g}: expected seconds above 0")
    if not 0.0 < args.rate <= RATE_MAX_HZ:
        raise InputError(f"--rate {args.rate:g}: expected pictures a second above 0, at most {RATE_MAX_HZ:g}")
    pictures = [Path(p) for p in args.snapshot]
    if pictures:
        from hullguard.monitor.picture import check

        for path in pictures:
            check(path)
    return pictures


def _terminal() -> bool:
    return sys.stdin.isatty() and sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb"


def _monitor(args: argparse.Namespace, made: Design, lines: Lines | None) -> Monitor:
    options = bus_options(args)
    source = Path(args.log).name if args.log else f"{options.get('interface', 'default')}:{options.get('channel', '')}"
    native = Native(library(args.real), made.tables)
    period = None if args.lockstep else made.model.sample_time_s
    monitor = Monitor(made, native, REST if args.rest else MOVING, source, period, lines.changed if lines else None)
    if lines is not None:
        lines.monitor = monitor
    return monitor


@contextlib.contextmanager
def _source(args: argparse.Namespace, monitor: Monitor, plain: bool) -> Iterator[Read]:
    """Open until the reader has ended."""
    samples = args.samples or 0
    if args.log:
        speed = make_speed(args.speed or ("max" if plain else "1"))
        entries = formats.read(Path(args.log))
        yield lambda beat: watch_log(monitor, entries, speed, samples, beat)
        return
    options = bus_options(args)
    tables = monitor.native.tables
    if options.get("interface") == "socketcan" or any(m.flags & candump.FD for m in (*(g.message for g in tables.groups), tables.verdict, tables.status)):
        options.setdefault("fd", True)  # SocketCAN needs no telling of speeds, and frames of others count as well
    with opened(**options) as link:
        yield lambda beat: watch_bus(monitor, link.bus, not args.lockstep, samples, beat)


def _lines(lines: Lines, monitor: Monitor, read: Read, stopped: Callable[[], bool]) -> Snapshot:
    def beat(now_s: float) -> bool:
        lines.beat(now_s)
        return stopped()

    read(beat)
    lines.end()
    return monitor.snapshot()


class _Reader(threading.Thread):
    """Reads the source beside the view. Snapshots are made here, between two frames, so that nothing is shared but the newest of them."""

    def __init__(self, monitor: Monitor, read: Read, rate_hz: float, stopped: Callable[[], bool], ended: Callable[[], None]) -> None:
        super().__init__(name="reader", daemon=True)
        self._monitor, self._read, self._period = monitor, read, 1.0 / rate_hz
        self._stopped, self._ended = stopped, ended
        self._next = 0.0
        self.clear, self.stop = threading.Event(), threading.Event()
        self.latest = monitor.snapshot()
        self.error: BaseException | None = None

    def run(self) -> None:
        """Until the source ends or somebody says stop. The last picture of a log stays until then."""
        try:
            self._read(self._beat)
            self.latest = self._monitor.snapshot()
            while self.latest.ended and not self._beat(self._monitor.time_s):
                time.sleep(WAIT_S)
        except Exception as error:  # raised again by the main thread, once the terminal is its own again
            self.error = error
        finally:
            self._ended()

    def _beat(self, now_s: float) -> bool:
        fresh = self.clear.is_set()
        if fresh:
            self.clear.clear()
            self._monitor.clear()
        if (fresh or time.monotonic() >= self._next) and not (self.latest.ended and not fresh):
            self.latest = self._monitor.snapshot()
            self._next = time.monotonic() + self._period
        return self.stop.is_set() or self._stopped()


def _view(args: argparse.Namespace, monitor: Monitor, read: Read, stopped: Callable[[], bool]) -> Snapshot:
    from hullguard.monitor.view import View

    def ended() -> None:
        with contextlib.suppress(RuntimeError):  # the view has gone already
            view.call_from_thread(view.exit)

    reader = _Reader(monitor, read, args.rate, stopped, ended)
    live = f"LOG x{args.speed or '1'}" if args.log else "LIVE"
    view = View(lambda: reader.latest, reader.clear.set, args.rate, live, Path())
    view.begin = reader.start
    try:
        view.run(mouse=False)  # the terminal's own selection keeps working
    finally:
        reader.stop.set()
        if reader.is_alive():
            reader.join()
    if reader.error is not None:
        raise reader.error
    if view.return_code:
        raise HullguardError("the view has failed; see above, and use --plain meanwhile")
    return reader.latest
