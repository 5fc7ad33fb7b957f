"""The monitor: a listening detector, and beside it everything else that the bus tells."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable

from hullguard.bus.bits import bit_times, load_bound
from hullguard.bus.candump import ERROR, EXTENDED
from hullguard.core.native import Frame, Native, Verdict, data_bits, frame_bits
from hullguard.design.design import Design
from hullguard.design.judges import judges, residual_columns, residual_names
from hullguard.monitor.ecu import EcuWatch, named
from hullguard.monitor.error_frames import ErrorFrames
from hullguard.monitor.group import GroupWatch
from hullguard.monitor.load import BusLoad
from hullguard.monitor.snapshot import (
    ChangeSeen,
    GroupSeen,
    LoadSeen,
    ResidualSeen,
    SignalSeen,
    Snapshot,
    VerdictSeen,
)
from hullguard.plant.detect import Detector
from hullguard.report.live import may_be

CHANGES = 50  # kept
UNKNOWN_IDS = 64  # told apart; a bus has at most this many in practice, and a flood with random ones must not fill the memory


class Monitor(Detector):
    """Feed it with note() and, where that says so, take(): what does not concern the detector ends in note().

    `period_s` as in Detector; None too for a bus in lockstep, which keeps no time. `changed` is told what is said for the first time.
    """

    def __init__(self, design: Design, native: Native, start: int, source: str, period_s: float | None = None, changed: Callable[[ChangeSeen], None] | None = None) -> None:
        super().__init__(native, start, False, None, self._step, period_s)
        self.design, self.native, self.source = design, native, source
        tables, model = native.tables, design.model
        self._changed = changed
        self.dropped: int | None = None  # by this host, up to the frame that comes next; whoever reads the bus keeps it
        self.load = BusLoad(model.sample_time_s, model.bitrate_bps)
        self.errors, self.ecu = ErrorFrames(), EcuWatch(design, native)
        self.groups = [GroupWatch(g) for g in tables.groups]
        self._place = {(g.message.id, g.message.flags & EXTENDED): i for i, g in enumerate(tables.groups)}
        self._own = {(m.id, m.flags & EXTENDED) for m in (tables.verdict, tables.status)}
        self._reading = {(m.id, m.flags & EXTENDED) for m in (tables.freeze.request, tables.freeze.response)} if tables.freeze else set()
        self._bound = load_bound(tables, model.bitrate_bps, model.sample_time_s, model.data_bitrate_bps)
        self._judges = judges(design)
        self._names, self._columns = residual_names(self._judges), residual_columns(self._judges)
        self._links = native.library.ffi.typeof("hg_link_health").fields
        self.verdict: Verdict | None = None
        self._said: dict[str, object] = {}
        self.changes: deque[ChangeSeen] = deque(maxlen=CHANGES)
        self._first_s: float | None = None
        self.time_s = 0.0
        self.ended = False
        self.clear()

    def clear(self) -> None:
        """Figures of the past begin again: load, intervals, rates, losses, largest ratios, unknown and error frames. What is known of the plant stays."""
        self.load.clear()
        self.errors.clear()
        self.ecu.clear()
        for group in self.groups:
            group.clear()
        self._most = [0.0] * len(self._names)
        self.frames = self._bits = self._reply_bits = self.unknown = 0
        self.unknown_ids: Counter[str] = Counter()
        self.changes.clear()

    # ---- what comes ----

    def move(self, time_s: float) -> None:
        """Time goes on, on the clock of the frames' stamps."""
        if self._first_s is None:
            self._first_s = time_s
        self.time_s = max(time_s, self.time_s)
        self.load.move(self.time_s)
        for group in self.groups:
            group.move(self.time_s)
        if self._said.get("ecu") and self.ecu.state(self.time_s) == "silent":
            self._say("ecu", "silent")

    def concerns(self, frame: Frame) -> bool:
        """Whether a frame carries the identifier of a group."""
        return not frame.flags & ERROR and (frame.id, frame.flags & EXTENDED) in self._place

    def note(self, frame: Frame, time_s: float) -> bool:
        """Count a frame from the bus; True if it concerns the detector."""
        self.move(time_s)
        self.frames += 1
        if frame.flags & ERROR:
            if self.errors.take(frame):
                self._say("controller", self.errors.state)
            return False
        bits = frame_bits(self.native.library, frame)
        self._bits += bits
        model = self.design.model
        self.load.add(self.time_s, bit_times(bits, data_bits(self.native.library, frame), model.bitrate_bps, model.data_bitrate_bps))
        key = (frame.id, frame.flags & EXTENDED)
        if key in self._own:
            self._ecu(frame, bits)
            return False
        if key in self._place:
            self.groups[self._place[key]].frame(self.time_s)
            return True
        if key not in self._reading:
            self._unknown(frame)
        return False

    def _unknown(self, frame: Frame) -> None:
        self.unknown += 1
        name = f"{frame.id:08X}" if frame.flags & EXTENDED else f"{frame.id:03X}"
        if name in self.unknown_ids or len(self.unknown_ids) < UNKNOWN_IDS:
            self.unknown_ids[name] += 1

    def _ecu(self, frame: Frame, bits: int) -> None:
        told = self.ecu.take(frame, self.time_s, self.verdict)
        if told is not None:
            self._reply_bits += bits if told.reply else 0
            self._say("ecu", self.ecu.verdict)
        if self.ecu.hash is not None:
            self._say("model", "the ECU runs this model" if self.ecu.model == "match" else f"the ECU runs another model, {self.ecu.hash:08x} instead of {self.ecu.expected:08x}")

    def take(self, frame: Frame, time_s: float) -> int:
        """A frame that concerns the detector: booked, and its group's intervals and losses with it."""
        place = self._place[(frame.id, frame.flags & EXTENDED)]
        group, before, k, outages = self.groups[place], self._health(place), int(self.node.node.k), self.outages
        status = super().take(frame, time_s)
        if self.outages != outages:
            self._jumped()
        after = self._health(place)
        group.lost(after["lost"] - before["lost"], self.dropped)
        if after["good"] > before["good"]:
            group.booked(self.verdict.k if place == self.native.tables.closing and self.verdict is not None else k)
        return status

    def _step(self, v: Verdict) -> None:
        if v.k != (0 if self.verdict is None else self.verdict.k + 1):
            self._jumped()
        self.verdict = v
        for i, (r, J) in enumerate(zip(self.node.r, self.node.J, strict=True)):
            self._most[i] = max(self._most[i], _ratio(r, J))
        self._say("monitor", named(self.design, v))

    def _jumped(self) -> None:
        """The sample index has lost its hold: no interval spans that."""
        for group in self.groups:
            group.last_k = None

    def finish(self) -> None:
        """The end of a log."""
        self.load.finish()
        self.ended = True

    # ---- what is said for the first time ----

    def _say(self, what: str, state: object) -> None:
        same = (state.plant, state.candidates, state.bus, state.refused) if isinstance(state, VerdictSeen) else state
        if self._said.get(what) == same:
            return
        self._said[what] = same
        k = state.k if isinstance(state, VerdictSeen) else None
        change = ChangeSeen(self.time_s, k, what, in_words(state, bool(self.design.model.faults)) if isinstance(state, VerdictSeen) else str(state))
        self.changes.append(change)
        if self._changed is not None:
            self._changed(change)

    # ---- what is known ----

    def _health(self, group: int) -> dict[str, int]:
        link = self.native.library.lib.hg_node_health(self.node.node, group)
        return {name: int(getattr(link, name)) for name, _ in self._links}

    def _groups(self) -> tuple[GroupSeen, ...]:
        bus = self.verdict.bus if self.verdict else ("absent",) * len(self.groups)
        return tuple(g.seen(self.time_s, bus[i], self._health(i)) for i, g in enumerate(self.groups))

    def _residuals(self) -> tuple[ResidualSeen, ...]:
        rows = zip(self._names, self._columns, self.node.r, self.node.J, self._most, strict=True)
        return tuple(ResidualSeen(name, column, r, J, _ratio(r, J), most) for name, column, r, J, most in rows)

    def snapshot(self) -> Snapshot:
        """All that is known now."""
        model, load = self.design.model, self.load
        signals = zip((s.name for s in model.signals), self.node.value, self.node.radius, strict=False)  # derived ones come behind the model's
        return Snapshot(
            model=model.name,
            model_hash=f"{self.ecu.expected:08x}",
            source=self.source,
            time_s=self.time_s,
            elapsed_s=self.time_s - (self.time_s if self._first_s is None else self._first_s),
            samples=self.samples,
            frames=self.frames,
            monitor=named(self.design, self.verdict) if self.verdict else None,
            ecu=self.ecu.seen(self.time_s),
            signals=tuple(SignalSeen(name, value, radius) for name, value, radius in signals) if self.verdict else (),
            residuals=self._residuals() if self.verdict else (),
            groups=self._groups(),
            load=LoadSeen(load.mean, load.now, load.peak, load.p99, self._bound, self._bits, self._reply_bits, model.bitrate_bps),
            errors=self.errors.seen(),
            host_dropped=self.dropped,
            overdue=int(self.node.node.overdue),
            outages=self.outages,
            unknown=self.unknown,
            unknown_ids=dict(self.unknown_ids.most_common()),
            known_faults=bool(model.faults),
            changes=tuple(self.changes),
            ended=self.ended,
        )


def _ratio(r: float, J: float) -> float:
    return abs(r) / J if J > 0.0 else 0.0


def in_words(v: VerdictSeen, known_faults: bool) -> str:
    """A verdict in a line: the plant and, apart from it, the bus."""
    return f"plant {v.plant}{may_be(v.plant, v.candidates, known_faults)}; bus {v.unwell() or 'good'}" + ("; a number was refused" if v.refused else "")
