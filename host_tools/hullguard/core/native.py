"""Tables of a design as the C structures they describe, and the C objects that run on them.

Nothing is computed here: every number goes where the generated C would put it, so that both ways give the same verdicts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hullguard.core import statistic
from hullguard.core.library import Library
from hullguard.core.protect import protection
from hullguard.core.zonotope import fill
from hullguard.design.design import Design
from hullguard.design.tables import FreezeTable, GeneratorTable, GroupTable, MessageTable, ModalGeneratorTable, Tables
from hullguard.errors import InputError
from hullguard.model.faults import FaultSpec
from hullguard.model.plant import Plant as PlantModel
from hullguard.model.plant import emulated
from hullguard.model.schema import Model, Reference
from hullguard.model.table import Array

PLANT_STATES = ("starting", "none", "provisional", "confirmed")
BUS_STATES = ("absent", "good", "lossy", "stale")
FAULT_KINDS = {"bias": 1, "drift": 2, "gain": 3, "freeze": 4, "noise": 5}
REFERENCE_KINDS = {"rest": 0, "steps": 1, "ramps": 2, "sines": 3, "mixed": 4}
FOREVER = 2**63 - 1
REST, MOVING = 1, 0
LATER = 10  # HGH_LATER: samples after detection by when a fault should be told from others


@dataclass(frozen=True)
class Frame:
    """A CAN frame on the host."""

    id: int
    flags: int
    data: bytes


class Native:
    """The constant structures of one model, and the memory they lie in."""

    def __init__(self, library: Library, tables: Tables) -> None:
        if library.real == "q31" and not tables.units:  # with units they are in fixed point already
            if tables.fixed is None:
                raise InputError(tables.not_fixed)
            tables = tables.fixed
        self.library, self.tables = library, tables
        self._keep: list[Any] = []
        ffi = library.ffi
        count = len(tables.groups)
        self.messages = ffi.new("hg_message[]", count)
        self.scales: list[Any] = []
        triggers = self._new("hg_trigger_config[]", count)
        holds = self._new("hg_hold_config[]", count)
        self.senders = self._new("hg_sender_config[]", count)
        for i, g in enumerate(tables.groups):
            self._trigger(triggers[i], g)
            self._message(self.messages[i], g.message, g)
            self._hold(holds[i], g, ffi.addressof(triggers, i))
            self.senders[i].message = ffi.addressof(self.messages, i)
            self.senders[i].trigger = ffi.addressof(triggers, i)
        self.node = self._new("hg_node_config *")
        detector = self._detector(holds)
        extra = self._new("hg_message[]", 2)
        self._message(extra[0], tables.verdict, None)
        self._message(extra[1], tables.status, None)
        self.verdict = ffi.addressof(extra, 0)
        self.node.detector, self.node.message, self.node.closing = detector, self.messages, tables.closing
        self.node.verdict, self.node.status = self.verdict, ffi.addressof(extra, 1)
        self.node.heartbeat, self.node.model_hash = tables.heartbeat, tables.hash
        if tables.freeze is not None:
            self.node.freeze = self._freeze(tables.freeze)

    def _freeze(self, table: FreezeTable) -> Any:
        made, messages = self._new("hg_freeze_config *"), self._new("hg_message[]", 2)
        made.samples, made.after, made.burst = table.samples, table.after, table.burst
        for i, message in enumerate((table.request, table.response)):
            self._message(messages[i], message, None)
        made.request, made.response = messages, self.library.ffi.addressof(messages, 1)
        return made

    def _new(self, kind: str, value: Any = None) -> Any:
        made = self.library.ffi.new(kind, value)
        self._keep.append(made)
        return made

    def _reals(self, values: Any) -> Any:
        return self._new("hg_real[]", [self._real(float(v)) for v in np.ravel(np.array(values, dtype=float))] or [0])

    def _real(self, x: float) -> float | int:
        return min(round(x * 2**31), 2**31 - 1) if self.library.real == "q31" else x

    def unit(self, place: int) -> float:
        """What a number of the signal vector, or behind it of the residuals, is times of, when hg_real holds 1; in fixed point 2^31."""
        return 2.0 ** (self.tables.units[place] - 31) if self.tables.units else 1.0

    def _ints(self, kind: str, values: Any) -> Any:
        return self._new(f"{kind}[]", [int(v) for row in values for v in (row if isinstance(row, tuple) else (row,))] or [0])

    def _trigger(self, t: Any, g: GroupTable) -> None:
        t.width, t.levels, t.interval_max = len(g.signals), g.levels, g.interval_max
        t.silence, t.delta = self._ints("uint8_t", g.silence), self._ints("uint16_t", g.delta)
        t.sigma, t.activity = self._ints("int32_t", g.sigma), self._ints("int32_t", g.activity)
        t.zero = self._ints("int32_t", [s.zero for s in g.signals])

    def _message(self, m: Any, table: MessageTable, g: GroupTable | None) -> None:
        signals = g.signals if g else ()
        m.id, m.flags, m.length, m.width = table.id, table.flags, table.length, len(signals)
        m.e2e, kept = protection(self.library, table.protection)
        self._keep += kept
        if table.idle:
            m.idle = self._ints("uint8_t", table.idle)
        if g is None:
            return
        fields, scales = self._new("hg_field[]", len(signals) or 1), self._new("hg_code_scale[]", len(signals) or 1)
        for i, s in enumerate(signals):
            fields[i].start, fields[i].length, fields[i].flags = s.start, s.length, s.flags
            scales[i].resolution, scales[i].offset, scales[i].per_unit = self._real(s.resolution), self._real(s.offset), self._real(s.per_unit)
            scales[i].minimum, scales[i].maximum, scales[i].exponent = s.minimum, s.maximum, s.exponent
        m.field, m.scale = fields, scales
        self.scales.append(scales)

    def _hold(self, h: Any, g: GroupTable, trigger: Any) -> None:
        h.trigger, h.margin, h.scale = trigger, g.margin, self.scales[-1]
        h.half, h.span = self._reals([s.half for s in g.signals]), self._reals([s.span for s in g.signals])
        h.middle, h.slew = self._reals([s.middle for s in g.signals]), self._reals(g.slew)

    def _matrix(self, m: Any, table: tuple[tuple[float, ...], ...], exponent: int = 0) -> None:
        m.rows, m.cols, m.exponent, m.data = len(table), len(table[0]), exponent, self._reals(table)

    def _detector(self, holds: Any) -> Any:
        t = self.tables
        count = len(t.generators)
        residuals, hulls = self._new("hg_residual_config[]", count or 1), self._new("hg_hull_config[]", count or 1)
        zonotopes = self._new("hg_zonotope_config[]", count or 1)
        for i, g in enumerate(t.generators):
            self._generator(residuals[i], g)
            if g.zonotope is None:
                self._hull(hulls[i], g)
            else:
                self._keep += fill(self.library.ffi, zonotopes[i], g.zonotope)
        d = self._new("hg_detector_config *")
        d.signals, d.width, d.groups, d.hold = t.signals, t.width, len(t.groups), holds
        d.generators, d.residual = count, residuals
        if any(g.zonotope is not None for g in t.generators):
            d.zonotope = zonotopes
        else:
            d.hull = hulls
        self._derived(d)
        self._banks(d)
        d.polynomials, d.polynomial = len(t.polynomials), self._new("hg_statistic_config[]", len(t.polynomials) or 1)
        for i, p in enumerate(t.polynomials):
            self._keep += statistic.fill(self.library, d.polynomial[i], p)
        d.decision.generators, d.decision.up, d.decision.down, d.decision.latch = t.judged, t.up, t.down, t.latch
        d.decision.feeds = self._ints("uint8_t", [g.feeds for g in t.judging])
        d.decision.faults = self._ints("uint32_t", [g.faults for g in t.judging])
        d.history, d.window, d.residuals, d.codes = t.history, t.window, t.residuals, t.codes
        d.reals, d.sums = self.library.lib.hg_detector_reals(d), self.library.lib.hg_detector_sums(d)
        return d

    def _derived(self, d: Any) -> None:
        t = self.tables
        predict = self._new("hg_predict_config[]", len(t.predictors) or 1)
        for p, table in zip(predict, t.predictors, strict=False):
            p.group, p.first, p.order, p.width, p.inputs = table.group, table.first, len(table.state), len(table.output), len(table.input)
            p.input, p.known = self._ints("uint8_t", table.input), self._reals(table.known)
            for place, matrix in ((p.correct, table.correct), (p.state, table.state), (p.drive, table.drive), (p.output, table.output), (p.direct, table.direct)):
                self._matrix(place, matrix)
            p.fresh, p.horizon, p.radius, p.settle = self._reals(table.fresh), len(table.radius), self._reals(table.radius), table.settle
        d.predictors, d.predict = len(t.predictors), predict
        if t.mismatch is not None:
            m = self._new("hg_mismatch_config *")
            m.states, m.width, m.signal = len(t.mismatch.constant), len(t.mismatch.signal), self._ints("uint8_t", t.mismatch.signal)
            m.constant, m.gain, m.exponent = self._reals(t.mismatch.constant), self._reals(t.mismatch.gain), t.mismatch.exponent
            d.mismatch = m

    def _banks(self, d: Any) -> None:
        t = self.tables
        banks = self._new("hg_bank_config[]", len(t.banks) or 1)
        for b, table in zip(banks, t.banks, strict=False):
            b.certificates, b.window, b.width = table.certificates, table.window, len(table.signal)
            b.signal, b.weight, b.bias, b.widen = self._ints("uint8_t", table.signal), self._reals(table.weight), self._reals(table.bias), self._real(table.widen)
            b.exponent = table.exponent
            b.extras, b.extra = len(table.extra), self._ints("uint8_t", table.extra)
            b.extra_weight = self._reals(table.extra_weight)
        d.banks, d.bank = len(t.banks), banks

    def _generator(self, r: Any, g: GeneratorTable) -> None:
        r.order, r.residuals, r.width, r.signal = len(g.state), len(g.output), len(g.signal), self._ints("uint8_t", g.signal)
        moved, shown, _ = g.exponents
        for place, table, exponent in ((r.state, g.state, moved), (r.input, g.input, moved), (r.output, g.output, shown), (r.direct, g.direct, shown)):
            self._matrix(place, table, exponent)

    def _hull(self, h: Any, g: GeneratorTable) -> None:
        h.exponent = g.exponents[2]
        h.residuals, h.width, h.signal, h.taps = len(g.output), len(g.wide), self._ints("uint8_t", g.wide), self._ints("uint8_t", g.taps)
        h.weight = self._reals([x for _, _, block in g.blocks for row in block for x in row])
        h.settle, h.rest, h.moving = g.settle, self._reals(g.rest), self._reals(g.moving)
        h.rest_left, h.moving_left, h.bias = self._reals(g.rest_left), self._reals(g.moving_left), self._reals(g.bias)
        h.ready_rest, h.ready_moving, h.decay = g.ready_rest, g.ready_moving, self._reals(g.decay)
        if isinstance(g, ModalGeneratorTable):
            h.modes, h.mode_decay, h.mode_input, h.mode_output = len(g.mode_decay), self._reals(g.mode_decay), self._reals(g.mode_input), self._reals(g.mode_output)
            h.mode_rest, h.mode_moving = self._reals(g.mode_rest), self._reals(g.mode_moving)


def frame_out(library: Library, frame: Any) -> Frame:
    """A C frame as a Python one."""
    return Frame(int(frame.id), int(frame.flags), bytes(library.ffi.buffer(frame.data, frame.length)))


def frame_in(library: Library, frame: Frame) -> Any:
    """A Python frame as a C one."""
    made = library.ffi.new("hg_can_frame *")
    made.id, made.flags, made.length = frame.id, frame.flags, len(frame.data)
    library.ffi.buffer(made.data)[: len(frame.data)] = frame.data
    return made


def frame_bits(library: Library, frame: Frame) -> int:
    """Bits on the wire, exact."""
    return int(library.lib.hgh_frame_bits(frame_in(library, frame)))


def data_bits(library: Library, frame: Frame) -> int:
    """Of these, the ones at the data bit rate, exact: 0 unless an FD frame switches."""
    return int(library.lib.hgh_frame_data_bits(frame_in(library, frame)))


@dataclass(frozen=True)
class Verdict:
    """What a verdict frame says, or a node's record of it."""

    k: int
    plant: str
    candidates: int
    bus: tuple[str, ...]
    refused: bool
    reply: bool = False


def bus_of(bits: int, groups: int) -> tuple[str, ...]:
    """Health of each group's link."""
    return tuple(BUS_STATES[bits >> 2 * i & 3] for i in range(groups))


class Node:
    """A detector node in this process."""

    def __init__(self, native: Native, start: int) -> None:
        self.native = native
        lib, ffi, t = native.library.lib, native.library.ffi, native.tables
        self._lib, self._ffi = lib, ffi
        groups, d = len(t.groups), native.node.detector
        memory = ffi.new("hg_node_memory *")
        self._keep: list[Any] = [memory]

        def room(kind: str, count: int) -> Any:
            self._keep.append(ffi.new(f"{kind}[]", count or 1))
            return self._keep[-1]

        own = memory.detector
        own.hold, own.predict, own.alarm = room("hg_hold", groups), room("hg_predict", len(t.predictors)), room("hg_alarm", t.judged)
        own.residual, own.hull, own.bank = room("hg_residual", len(t.generators)), room("hg_hull", len(t.generators)), room("hg_bank", len(t.banks))
        own.zonotope, own.polynomial = room("hg_zonotope", len(t.generators)), room("hg_statistic", len(t.polynomials))
        own.code, own.codes, own.real, own.reals = room("int32_t", t.codes), d.codes, room("hg_real", d.reals), d.reals
        own.sum, own.sums = room("hg_acc", d.sums), d.sums
        memory.link, memory.closing = room("hg_link", groups), room("int32_t", len(t.groups[t.closing].signals) + 1)
        if t.freeze is not None:
            memory.freeze, memory.frozen.row = room("hg_freeze", 1), room("hg_freeze_row", t.freeze.samples)
            memory.frozen.real = room("hg_real", t.freeze.samples * 2 * (t.width + t.residuals))
        self.node = ffi.new("hg_node *")
        status = lib.hg_node_start(self.node, native.node, memory, start)
        if status != lib.HG_OK:
            raise InputError(f"model {t.name}: the library refused its tables (status {status})")
        self._verdict, self._frames = ffi.new("hg_verdict *"), ffi.new("hg_can_frame[2]")

    def receive(self, frame: Frame) -> int:
        """Take a frame from the bus; the library's status."""
        return int(self._lib.hg_node_receive(self.node, frame_in(self.native.library, frame)))

    def overdue(self) -> None:
        """The closing frame has not come in time."""
        self._lib.hg_node_overdue(self.node)

    def expect(self, samples: int) -> None:
        """The clock says that the next closing frame is at most so many samples ahead of the open one, 0 .. 7."""
        self._lib.hg_node_expect(self.node, samples)

    def outage(self) -> None:
        """More samples may have been missed than their stamps can tell."""
        self._lib.hg_node_outage(self.node)

    def step(self) -> Verdict | None:
        """Make one step that is due; None when there is none."""
        if self._lib.hg_node_step(self.node, self._verdict) != self._lib.HG_OK:
            return None
        v = self._verdict
        return Verdict(int(v.k), PLANT_STATES[v.plant], int(v.candidates), bus_of(v.bus, len(self.native.tables.groups)), bool(v.refused))

    def report(self, lockstep: bool) -> list[Frame]:
        """Frames to send after the last step."""
        count = self._lib.hg_node_report(self.node, self._verdict, lockstep and self.node.due == 0, self._frames)
        return [frame_out(self.native.library, self._frames[i]) for i in range(count)]

    def answers(self) -> list[Frame]:
        """Frames that answer requests for the freeze frame."""
        found = []
        while self._lib.hg_node_freeze(self.node, self._frames) == self._lib.HG_OK:
            found.append(frame_out(self.native.library, self._frames[0]))
        return found

    def _numbers(self, pointer: Any, count: int, first: int = 0) -> list[float]:
        return [x * self.native.unit(first + i) for i, x in enumerate(self._ffi.unpack(pointer, count))] if count else []

    @property
    def value(self) -> list[float]:
        """Held values of the last step, then derived ones: width."""
        return self._numbers(self.node.detector.value, self.native.tables.width)

    @property
    def radius(self) -> list[float]:
        """Radii of the last step: width."""
        return self._numbers(self.node.detector.radius, self.native.tables.width)

    @property
    def r(self) -> list[float]:
        """Residuals of the last step, generators one after another."""
        return self._numbers(self.node.detector.r, self.native.tables.residuals, self.native.tables.width)

    @property
    def J(self) -> list[float]:
        """Thresholds of the last step."""
        return self._numbers(self.node.detector.J, self.native.tables.residuals, self.native.tables.width)

    def health(self) -> dict[str, int]:
        """Counters of all links together, by name, and of the node."""
        total = dict.fromkeys(("good", "lost", "crc", "format", "repeated", "early", "late", "sequence", "untrusted", "numeric", "invalid"), 0)
        for i in range(len(self.native.tables.groups)):
            link = self._lib.hg_node_health(self.node, i)
            for name in total:
                total[name] += int(getattr(link, name))
        return total | {"unknown": int(self.node.unknown), "overdue": int(self.node.overdue)}


def read_verdict(native: Native, frame: Frame) -> Verdict | None:
    """A verdict frame's content; None when it is none, or damaged."""
    lib, ffi = native.library.lib, native.library.ffi
    verdict, reply = ffi.new("hg_verdict *"), ffi.new("bool *")
    if frame.id != native.tables.verdict.id or lib.hg_verdict_read(native.verdict, frame_in(native.library, frame), verdict, reply) != lib.HG_OK:
        return None
    return Verdict(int(verdict.k), PLANT_STATES[verdict.plant], int(verdict.candidates), bus_of(verdict.bus, len(native.tables.groups)), bool(verdict.refused), bool(reply[0]))


class Sender:
    """The senders of all groups of a model."""

    def __init__(self, native: Native) -> None:
        self.native = native
        ffi, lib = native.library.ffi, native.library.lib
        self._lib = lib
        self._senders, self._keep, self._value = [], [], []
        for i, g in enumerate(native.tables.groups):
            sender, code = ffi.new("hg_sender *"), ffi.new("int32_t[]", 2 * len(g.signals) or 1)
            status = lib.hg_sender_start(sender, ffi.addressof(native.senders, i), code)
            if status != lib.HG_OK:
                raise InputError(f"group '{g.name}': the library refused its tables (status {status})")
            self._senders.append(sender)
            self._keep.append(code)
            self._value.append(ffi.new("hg_real[]", len(g.signals) or 1))
        self._frame = ffi.new("hg_can_frame *")

    def step(self, group: int, k: int, reading: Sequence[float]) -> Frame | None:
        """One sample of one group; the frame to send, if its trigger says so. `reading` is the whole signal vector."""
        table = self.native.tables.groups[group]
        value = self._value[group]
        for i in range(len(table.signals)):
            value[i] = self._lib.hgh_real(reading[table.first + i], table.signals[i].unit)
        if self._lib.hg_sender_step(self._senders[group], k & 0xFFFFFFFF, value, self._frame) != self._lib.HG_OK:
            return None
        return frame_out(self.native.library, self._frame)


def fault_array(library: Library, model: Model, faults: Sequence[FaultSpec]) -> Any:
    """Faults as hgh_fault[]; a fault's name carries its type, a bare signal's is an actuator's where the plant applies what was sent."""
    made = library.ffi.new("hgh_fault[]", max(len(faults), 1))
    for i, f in enumerate(faults):
        if f.name in model.components:
            raise InputError(f"fault '{f}': a part of the plant is weakened between samples, which only `run` and `plant` emulate; name an actuator or a sensor here")
        signal = model.signal(f.name)
        named = [x for x in model.faults if x.name == f.name]
        applied = any(g.applied_as_sent and signal in g.signals for g in model.groups)
        actuator = named[0].type == "actuator" if named else applied
        made[i].signal, made[i].actuator, made[i].kind = signal, int(actuator), FAULT_KINDS[f.kind]
        made[i].size, made[i].start, made[i].end = f.size, f.start, FOREVER if f.end is None else min(f.end, FOREVER)
    return made


def reference_of(library: Library, reference: Reference) -> Any:
    """A scenario's reference as hgh_reference."""
    made = library.ffi.new("hgh_reference *")
    made.kind, made.period, made.amplitude = REFERENCE_KINDS[reference.kind], max(reference.period, 1), reference.amplitude
    return made[0]


class PlantConfig:
    """hgh_plant_config of a plant with a design's signals."""

    def __init__(self, native: Native, design: Design, plant: PlantModel) -> None:
        ffi, model = native.library.ffi, design.model
        if plant.n > 64 or plant.p > 64 or len(model.signals) > 96 or plant.Ed.shape[1] > 192:
            raise InputError(f"model {model.name}: the emulator has room for 64 states, 96 signals and 192 disturbances")
        self._keep: list[Any] = []

        def doubles(a: Array) -> Any:
            made = ffi.new("double[]", np.ravel(a).tolist() or [0.0])
            self._keep.append(made)
            return made

        def ints(values: Sequence[int]) -> Any:
            made = ffi.new("int32_t[]", list(values) or [0])
            self._keep.append(made)
            return made

        c = ffi.new("hgh_plant_config *")
        c.n, c.m, c.p, c.nd, c.signals = plant.n, plant.m, plant.p, plant.Ed.shape[1], len(model.signals)
        c.A, c.B, c.C, c.D, c.Ed, c.Fd = (doubles(x) for x in (plant.A, plant.B, plant.C, plant.D, plant.Ed, plant.Fd))
        if plant.feedback is not None:
            c.gain, c.reference_bound = doubles(plant.feedback.gain), doubles(plant.feedback.reference_bound)
        else:
            bound = np.array([min(-model.signals[i].low, model.signals[i].high) for i in model.inputs])
            c.reference_bound = doubles(np.maximum(bound, 0.0))
        c.held = doubles(plant.equilibrium_input)
        c.equilibrium, c.initial_range = doubles(plant.equilibrium), doubles(plant.initial_range)
        c.output, c.input = ints(model.outputs), ints(model.inputs)
        group_of = {i: (g, gi) for gi, g in enumerate(model.groups) for i in g.signals}
        c.as_sent = ints([int(group_of[i][0].applied_as_sent) for i in model.inputs])
        scale = ffi.new("hg_code_scale[]", plant.p or 1)
        for row, i in enumerate(model.inputs):
            g, gi = group_of[i]
            ffi.memmove(ffi.addressof(scale, row), ffi.addressof(native.scales[gi], g.signals.index(i)), ffi.sizeof("hg_code_scale"))
        self._keep.append(scale)
        c.scale, c.sample_time_s = scale, model.sample_time_s
        c.unit = ints([native.tables.units[i] if native.tables.units else 0 for i in model.inputs])
        if plant.nonlinear is not None:
            c.nonlinear, kept = statistic.emulated_plant(native.library, plant.nonlinear)
            self._keep += kept
        self.config = c


class Plant:
    """The emulated plant."""

    def __init__(self, native: Native, design: Design, reference: Reference, faults: Sequence[FaultSpec], seed: int, run: int = 0) -> None:
        plants = emulated(design.model.plant, seed)
        self._native, self._config = native, PlantConfig(native, design, plants[run % len(plants)])
        ffi = native.library.ffi
        self._plant, self._value = ffi.new("hgh_plant *"), ffi.new("double[]", len(design.model.signals))
        array = fault_array(native.library, design.model, faults)
        native.library.lib.hgh_plant_start(self._plant, self._config.config, reference_of(native.library, reference), array, len(faults), seed, run)

    def read(self) -> list[float]:
        """Readings of the open sample: the whole signal vector."""
        self._native.library.lib.hgh_plant_read(self._plant, self._native.library.ffi.NULL, self._value)
        return list(self._value)

    @property
    def state(self) -> list[float]:
        """True states of the open sample."""
        return list(self._native.library.ffi.unpack(self._plant.x, self._config.config.n))

    def move(self) -> None:
        """On to the next sample."""
        self._native.library.lib.hgh_plant_move(self._plant)


class Recording:
    """Recorded readings with seeded sensor noise and faults: the emulator's stand-in in a replay."""

    def __init__(self, native: Native, model: Model, series: Array, noise: bool, faults: Sequence[FaultSpec], seed: int, run: int = 0) -> None:
        self._series, self._lib, self._k = series, native.library.lib, 0
        self._noise = [s.noise for s in model.signals] if noise else None
        ffi = native.library.ffi
        self._faults, self._random = ffi.new("hgh_faults *"), ffi.new("hgh_random *")
        array = fault_array(native.library, model, faults)
        self._lib.hgh_faults_start(self._faults, array, len(faults), model.sample_time_s, seed, run)
        self._lib.hgh_random_start(self._random, seed, run, 4)

    def read(self) -> list[float]:
        """Readings of the open sample."""
        values = self._series[self._k].tolist()
        if self._noise is not None:
            values = [v + n * self._lib.hgh_random_signed(self._random) for v, n in zip(values, self._noise, strict=True)]
        return [self._lib.hgh_faults_apply(self._faults, 0, i, self._k, v) for i, v in enumerate(values)]

    def move(self) -> None:
        """On to the next sample."""
        self._k += 1


RESULT = (
    *("measurement", "closing", "verdicts", "lost", "silent", "bits", "measurement_bits", "provisional_at", "confirmed_at"),
    *("false_provisional", "false_confirmed", "interval_min", "interval_max", "margin", "margin_settled", "margin_after"),
    *("candidates", "candidates_later", "candidates_always", "plant"),
)


class Batch:
    """Runs of one configuration in C: plant or recording, senders, losses, detector node, all in one process.

    Arrays of doubles (series, disturbance, initial) are read where they lie: what is written into them counts from the next run on.
    """

    def __init__(
        self,
        native: Native,
        design: Design,
        samples: int,
        reference: Reference,
        faults: Sequence[FaultSpec] = (),
        seed: int = 1,
        loss: float = 0.0,
        start: int = REST,
        burst: int = 0,
        series: Array | None = None,
        noise: bool = False,
        disturbance: Array | None = None,
        initial: Array | None = None,
        plants: Sequence[PlantModel] = (),
    ) -> None:
        """`plants`: what the runs emulate in turn; without them plants of the model's intervals, drawn by the seed."""
        ffi, model = native.library.ffi, design.model
        self._native, self._model = native, model
        self.plants = list(plants or emulated(model.plant, seed))
        made = [PlantConfig(native, design, p) for p in self.plants]
        configs = ffi.new("hgh_plant_config[]", [p.config[0] for p in made])
        self._keep: list[Any] = [configs, fault_array(native.library, model, faults), made]

        def doubles(a: Array) -> Any:
            flat = np.ascontiguousarray(a, dtype=np.float64)
            self._keep.append(flat)
            return ffi.cast("double *", ffi.from_buffer(flat))

        c = ffi.new("hgh_run_config *")
        c.node, c.sender = native.node, native.senders
        self._keep.append(ffi.new("int32_t[]", native.tables.units or [0] * (native.tables.width + native.tables.residuals)))
        c.unit = self._keep[-1]
        if series is None:
            c.plant, c.plants = configs, len(made)
        else:
            if samples > len(series):
                raise InputError(f"{samples} samples asked for, the recording has {len(series)}")
            c.series = doubles(series)
            if noise:
                c.noise = doubles(np.array([s.noise for s in model.signals]))
        if disturbance is not None:
            c.disturbance = doubles(disturbance)
        if initial is not None:
            c.initial = doubles(initial)
        c.reference, c.fault, c.faults = reference_of(native.library, reference), self._keep[1], len(faults)
        c.signals, c.samples, c.sample_time_s = len(model.signals), samples, model.sample_time_s
        c.loss, c.burst, c.seed, c.start = loss, burst, seed, start
        self.config = c

    def runs(self, first: int, count: int) -> list[dict[str, Any]]:
        """Results of runs first .. first + count - 1, a row each."""
        lib, ffi = self._native.library.lib, self._native.library.ffi
        results = ffi.new("hgh_result[]", count)
        if lib.hgh_batch(self.config, first, count, results) != count:
            raise InputError(f"model {self._model.name}: the emulator refused the configuration")
        return [{name: getattr(results[i], name) for name in RESULT} | {"run": first + i} for i in range(count)]

    def trace(self, run: int = 0) -> dict[str, Array]:
        """One run sample by sample: reading, promise (samples x signals), value, radius (samples x width), r, J (samples x residuals), events, lost, plant, bus, bits."""
        lib, ffi, t = self._native.library.lib, self._native.library.ffi, self._native.tables
        lengths = dict.fromkeys(("reading", "promise"), t.signals) | dict.fromkeys(("value", "radius"), t.width) | dict.fromkeys(("r", "J"), t.residuals)
        made = lib.hgh_run_new(self.config, run)
        if made == ffi.NULL:
            raise InputError(f"model {self._model.name}: the emulator refused the configuration")
        rows: dict[str, list[Any]] = {name: [] for name in (*lengths, "events", "lost", "plant", "bus", "bits")}
        try:
            more = True
            while more:
                more = lib.hgh_run_steps(made, 1)
                view = lib.hgh_run_view(made)
                for name, length in lengths.items():
                    rows[name].append(ffi.unpack(getattr(view, name), length))
                for name in ("events", "lost", "plant", "bus", "bits"):
                    rows[name].append(getattr(view, name))
        finally:
            lib.hgh_run_free(made)
        return {name: np.array(values) for name, values in rows.items()}

    def sweep(self, faults: Sequence[FaultSpec], start: int, step: int, starts: int, horizon: int) -> Array:
        """Delay to the first alarm of each fault begun at each start: starts x faults, -1 where none comes within the horizon."""
        lib, ffi = self._native.library.lib, self._native.library.ffi
        array = fault_array(self._native.library, self._model, faults)
        delay = np.empty((starts, len(faults)), dtype=np.int32)
        made = lib.hgh_sweep(self.config, array, len(faults), start, step, starts, horizon, ffi.cast("int32_t *", ffi.from_buffer(delay)))
        if made != starts:
            raise InputError(f"model {self._model.name}: the emulator refused the configuration")
        return delay.astype(np.float64)
