"""A fusion filter on a bus as the C library has it (tracker.h): its constants from a design's tables, nodes and senders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hullguard.core.fusion import TRIGGERS
from hullguard.core.library import Library
from hullguard.core.native import MOVING, PLANT_STATES, Frame, Verdict, bus_of, frame_in, frame_out
from hullguard.core.protect import protection
from hullguard.design.fusion_model import FusionTables
from hullguard.design.tables import MessageTable, SignalTable
from hullguard.errors import InputError

DIGEST = 0x811C9DC5  # HG_TRACKER_DIGEST
LINKS = 8  # with a health of their own in a verdict
COUNTERS = ("good", "lost", "crc", "format", "repeated", "early", "late", "sequence", "untrusted", "numeric", "invalid")


class TrackerNative:
    """The constant structures of one model, and the memory they lie in."""

    def __init__(self, library: Library, tables: FusionTables) -> None:
        if library.real == "q31":
            raise InputError(f"model {tables.name}: a fusion filter has no fixed-point form; use --real f32 or f64")
        self.library, self.tables = library, tables
        self._keep: list[Any] = []
        ffi, t = library.ffi, tables
        c = self.config = self.new("hg_tracker_config *")
        c.fusion = self._filter()
        if t.judge is not None:
            c.consistency = self._judge()
        sources, messages = self.new("hg_tracker_source[]", t.sensors), self.new("hg_message[]", t.sensors + 3 + t.states)
        for i, s in enumerate(t.source):
            self._message(messages[i], s.message, [s.signal])
            sources[i].message, sources[i].wraps = ffi.addressof(messages, i), s.wraps
        for i, m in enumerate((t.tick, t.verdict, t.status)):
            self._message(messages[t.sensors + i], m, [])
        for j, e in enumerate(t.estimate):
            self._message(messages[t.sensors + 3 + j], e.message, e.signals)
        c.source = sources
        c.tick, self.verdict, c.status, c.estimate = (ffi.addressof(messages, t.sensors + i) for i in range(4))
        c.verdict, c.heartbeat, c.interval, c.model_hash = self.verdict, t.heartbeat, t.interval, t.hash

    def new(self, kind: str, value: Any = None) -> Any:
        """A C object that lives as long as this."""
        self._keep.append(self.library.ffi.new(kind, value))
        return self._keep[-1]

    def _reals(self, values: Any) -> Any:
        return self.new("hg_real[]", [float(v) for v in np.ravel(np.array(values, dtype=float))])

    def _filter(self) -> Any:
        t, c = self.tables, self.new("hg_fusion_config *")
        c.states, c.inputs, c.sensors, c.depth, c.delay = t.states, 0, t.sensors, t.depth, t.delay
        c.heartbeat, c.watchdog, c.modulus, c.trigger = t.heartbeat_sensor, t.watchdog, t.source[0].message.protection.modulus, TRIGGERS[t.trigger]
        c.A, c.Q, c.x0, c.P0 = self._reals(t.A), self._reals(t.Q), self._reals(t.x0), self._reals(t.P0)
        if t.select:
            c.select = self.new("uint8_t[]", list(t.select))
        else:
            c.C = self._reals(t.C)
        c.R, c.range, c.huber = self._reals(t.R), self._reals(t.range), t.huber
        if t.origin:
            c.origin = self._reals(t.origin)
        c.rates, c.rate_step, c.loss, c.smoothing = t.rates, t.rate_step, t.loss, t.smoothing
        c.tables = len(t.table)
        c.table = table = self.new("hg_fusion_table[]", len(t.table))
        for place, each in zip(table, t.table, strict=True):
            place.alive, place.level, place.relax, place.early = each.alive, self._reals(each.level), self._reals(each.relax), self._reals(each.early)
        return c

    def _judge(self) -> Any:
        j, c = self.tables.judge, self.new("hg_consistency_config *")
        assert j is not None
        c.onsets, c.stride, c.least, c.limit, c.confirm, c.repeats, c.rest = j.onsets, j.stride, self._reals(j.least), j.limit, j.confirm, j.repeats, j.rest
        return c

    def _message(self, m: Any, table: MessageTable, signals: Sequence[SignalTable]) -> None:
        m.id, m.flags, m.length, m.width = table.id, table.flags, table.length, len(signals)
        m.e2e, kept = protection(self.library, table.protection)
        self._keep += kept
        fields, scales = self.new("hg_field[]", len(signals) or 1), self.new("hg_code_scale[]", len(signals) or 1)
        for i, s in enumerate(signals):
            fields[i].start, fields[i].length, fields[i].flags = s.start, s.length, s.flags
            scales[i].resolution, scales[i].offset, scales[i].per_unit = s.resolution, s.offset, s.per_unit
            scales[i].minimum, scales[i].maximum, scales[i].exponent = s.minimum, s.maximum, 0
        m.field, m.scale = fields, scales

    def read_verdict(self, frame: Frame) -> Verdict | None:
        """What a verdict frame says; None for another or a damaged frame."""
        lib, ffi = self.library.lib, self.library.ffi
        verdict, reply = ffi.new("hg_verdict *"), ffi.new("bool *")
        if frame.id != self.tables.verdict.id or lib.hg_verdict_read(self.verdict, frame_in(self.library, frame), verdict, reply) != lib.HG_OK:
            return None
        return self._said(verdict, bool(reply[0]))

    def _said(self, verdict: Any, reply: bool = False) -> Verdict:
        return Verdict(int(verdict.k), PLANT_STATES[verdict.plant], int(verdict.candidates), bus_of(verdict.bus, min(self.tables.sensors, LINKS)), bool(verdict.refused), reply)

    def step(self, node: Any, verdict: Any) -> Verdict | None:
        """One step of a node that is due."""
        lib = self.library.lib
        return self._said(verdict) if lib.hg_tracker_step(node, verdict) == lib.HG_OK else None


@dataclass
class Tick:
    """Whoever keeps the time: the frame that closes each sample."""

    native: TrackerNative
    counter: int = 0

    def frame(self, k: int) -> Frame:
        """The tick of sample k."""
        library, t = self.native.library, self.native.tables.tick
        data = library.ffi.new("uint8_t[]", t.length)
        library.lib.hg_e2e_protect(self.native.config.tick.e2e, data, t.length, self.counter % 16, k % 16)
        self.counter += 1
        return Frame(t.id, t.flags, bytes(library.ffi.buffer(data, t.length)))


class Tracker:
    """One node's copy of the filter, in this process."""

    def __init__(self, native: TrackerNative, start: int = MOVING) -> None:
        self.native = native
        t, new = native.tables, native.library.ffi.new
        self._lib, self._ffi = native.library.lib, native.library.ffi
        slots, n, m = t.depth + 1, t.states, t.sensors
        onsets = t.judge.onsets if t.judge else 1
        memory = new("hg_tracker_memory *")
        own = {
            "slot": new("hg_fusion_slot[]", slots), "entry": new("hg_fusion_entry[]", slots * m), "sensor": new("hg_fusion_sensor[]", m),
            "record": new("hg_fusion_record[]", m), "origin": new("int32_t[]", n), "real": new("hg_real[]", slots * n * (n + 2) + n * (3 * n + 5 + m)),
        }  # fmt: skip
        judged = {"sum": new("hg_consistency_sum[]", onsets * m), "sensor": new("hg_consistency_sensor[]", m), "real": new("hg_real[]", n * (m * onsets + 1))}
        self._keep: list[Any] = [memory, *own.values(), *judged.values(), new("hg_link[]", m + 1), new("hg_real[]", 2 * n)]
        for part, held in ((memory.fusion, own), (memory.consistency, judged)):
            for key, value in held.items():
                setattr(part, key, value)
        memory.link, memory.real = self._keep[-2:]
        self.node = new("hg_tracker *")
        status = self._lib.hg_tracker_start(self.node, native.config, memory, self._lib.HG_START_REST if start != MOVING else self._lib.HG_START_MOVING)
        if status != self._lib.HG_OK:
            raise InputError(f"model {t.name}: the library refused its tables (status {status})")
        self._verdict, self._frames = new("hg_verdict *"), new("hg_can_frame[]", 2)
        self.digest = DIGEST

    def receive(self, frame: Frame) -> int:
        """A frame from the bus; the library's status."""
        return self.take(frame_in(self.native.library, frame))

    def take(self, frame: Any) -> int:
        """The same, made a C frame once for many nodes."""
        return int(self._lib.hg_tracker_receive(self.node, frame))

    def expect(self, samples: int) -> None:
        """A tick cannot be further ahead than this."""
        self._lib.hg_tracker_expect(self.node, samples)

    def outage(self) -> None:
        """More ticks may have been missed than a stamp can tell."""
        self._lib.hg_tracker_outage(self.node)

    def step(self) -> Verdict | None:
        """Close what is due; the digest takes it in."""
        verdict = self.native.step(self.node, self._verdict)
        if verdict is not None:
            self.digest = int(self._lib.hg_tracker_digest(self._ffi.addressof(self.node.fusion), self.digest))
        return verdict

    def overdue(self) -> None:
        """The tick has not come in time."""
        self._lib.hg_tracker_overdue(self.node)

    def report(self, reply: bool) -> list[Frame]:
        """Verdict, status and estimates to send after a step."""
        count = self._lib.hg_tracker_report(self.node, self._verdict, reply, self._frames)
        found = [frame_out(self.native.library, self._frames[i]) for i in range(count)]
        for j in range(self.native.tables.states):
            if self._lib.hg_tracker_estimate(self.node, j, self._frames) == self._lib.HG_OK:
                found.append(frame_out(self.native.library, self._frames[0]))
        return found

    def answers(self) -> list[Frame]:
        """A fusion filter keeps no freeze frame."""
        return []

    @property
    def value(self) -> list[float]:
        """Estimate of the sample closed last, absolute."""
        return list(self._ffi.unpack(self.node.value, self.native.tables.states))

    @property
    def deviation(self) -> list[float]:
        """Its standard deviations."""
        return list(self._ffi.unpack(self.node.deviation, self.native.tables.states))

    @property
    def scores(self) -> list[float]:
        """Of the consistency test, a number a sensor; empty without one."""
        return [float(self.node.consistency.sensor[i].score) for i in range(self.native.tables.sensors)] if self.native.tables.judge else []

    def health(self) -> dict[str, int]:
        """Counters of all links, NAME.counter."""
        found: dict[str, int] = {}
        names = [*(s.name for s in self.native.tables.source), "tick"]
        for i, name in enumerate(names):
            health = self._lib.hg_tracker_health(self.node, i)
            found |= {f"{name}.{c}": int(getattr(health, c)) for c in COUNTERS}
        return found | {"unknown": int(self.node.unknown), "overdue": int(self.node.overdue)}


class FusionSender:
    """A sensor's node: its own copy of the filter, and what it sends."""

    def __init__(self, tracker: Tracker, sensor: int) -> None:
        self.tracker, self.sensor = tracker, sensor
        library = tracker.native.library
        self._lib, self._library = library.lib, library
        self._sender, self._frame = library.ffi.new("hg_fusion_sender *"), library.ffi.new("hg_can_frame *")
        if self._lib.hg_fusion_sender_start(self._sender, tracker.node, sensor) != self._lib.HG_OK:
            raise InputError(f"sensor {sensor}: the library refused it")

    def step(self, y: float, dice: float = 0.0) -> Frame | None:
        """One reading, absolute; the frame to send, if its trigger says so."""
        if self._lib.hg_fusion_sender_step(self._sender, y, dice, False, self._frame) != self._lib.HG_OK:
            return None
        return frame_out(self._library, self._frame)
