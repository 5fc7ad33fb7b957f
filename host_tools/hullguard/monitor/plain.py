"""Lines for logs: key=value, or JSON. A line at each change and one every so many seconds of the bus's own time; keys never change their order."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from hullguard.monitor.snapshot import ChangeSeen, Snapshot
from hullguard.monitor.state import Monitor

NOTHING = "-"  # a value that is not known, or an empty list


def _text(value: object) -> str:
    """A value without a space in it."""
    if value is None or value in ("", ()):
        return NOTHING
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (tuple, list)):
        return ",".join(str(v) for v in value)
    if isinstance(value, dict):
        return ",".join(f"{k}:{v}" for k, v in value.items()) or NOTHING
    return str(value).replace(" ", "_")


def fields(s: Snapshot) -> dict[str, object]:
    """What a line says. Times in s, loads in percent of the bus, J.I the residual nearest to its threshold as in signals.csv."""
    own, ecu, told, largest = s.monitor, s.ecu, s.ecu.verdict, s.largest
    return {
        "t": f"{s.time_s:.3f}" if s.frames else None,
        "k": own.k if own else None,
        "plant": own.plant if own else "starting",
        "may_be": own.candidates if own else (),
        "bus": own.bus if own else {},
        "ratio": largest.ratio if largest else None,
        "residual": largest.column if largest else None,
        "ecu": ecu.state,
        "ecu_k": told.k if told else None,
        "ecu_plant": told.plant if told else None,
        "ecu_may_be": told.candidates if told else (),
        "ecu_bus": told.bus if told else {},
        "ecu_heartbeat_s": ecu.heartbeat_s,
        "ecu_model": ecu.model,
        "ecu_hash": ecu.hash,
        "ecu_agrees": {True: "yes", False: "no", None: None}[ecu.agrees],
        "ecu_lost": ecu.lost,
        "ecu_refused": ecu.refused,
        "frames": s.frames,
        "load": 100 * s.load.now,
        "load_mean": 100 * s.load.mean,
        "load_peak": 100 * s.load.peak,
        "load_p99": 100 * s.load.p99,
        "load_bound": 100 * s.load.bound,
        "lost_bus": s.lost_bus,
        "lost_host": s.lost_host,
        "host_dropped": s.host_dropped,
        "refused": _refused(s),
        "overdue": s.overdue,
        "outages": s.outages,
        "unknown": s.unknown,
        "errors": s.errors.frames,
        "controller": s.errors.state,
    }


def _refused(s: Snapshot) -> int:
    """Frames of the model that were not booked, whatever for."""
    return sum(count for g in s.groups for name, count in g.counters.items() if name not in ("good", "lost", "invalid"))


class Lines:
    """Prints them. The monitor is given when it exists; its changes come here."""

    def __init__(self, out: Callable[[str], None], every_s: float, as_json: bool) -> None:
        self._out, self._every, self._json = out, every_s, as_json
        self._next: float | None = None
        self.monitor: Monitor | None = None

    def beat(self, now_s: float) -> None:
        """A line when one is due, with what was known then."""
        assert self.monitor is not None
        if self._next is None or now_s < self._next - self._every:  # the first frame may bring another clock along
            self._next = now_s + self._every
        elif now_s >= self._next:
            if self.monitor.frames:
                self.monitor.move(self._next)
            self._line("status")
            self._next += self._every * math.floor((now_s - self._next) / self._every + 1)

    def changed(self, change: ChangeSeen) -> None:
        """A line at once."""
        self._line(change.what)

    def end(self) -> None:
        """The last line."""
        self._line("end")

    def _line(self, what: str) -> None:
        assert self.monitor is not None
        s = self.monitor.snapshot()
        if self._json:
            whole: dict[str, Any] = asdict(s)
            del whole["changes"]
            self._out(json.dumps({"event": what} | whole))
        else:
            self._out(f"event={what} " + " ".join(f"{key}={_text(value)}" for key, value in fields(s).items()))
