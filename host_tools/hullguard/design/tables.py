"""Everything that the C library needs of one model: plain numbers, the same for generated C and for structures filled at run time."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from hullguard.design.arith import U32, nearest32, up32
from hullguard.design.bank_types import BankTable
from hullguard.design.ids import SURE
from hullguard.design.protection import NONE, ProtectionTable, own_protection
from hullguard.design.statistic import STATISTICS, StatisticTable
from hullguard.design.zonotope_table import ZonotopeTable
from hullguard.errors import InputError
from hullguard.model.network import Field
from hullguard.model.schema import Frame, Group, Model, Signal
from hullguard.model.table import Array

CODE_BITS_MAX = 24  # float32 holds every code of that many bits exactly
EXTENDED, FD, BRS = 0x01, 0x04, 0x08
MOTOROLA, SIGNED, FLOAT32 = 0x01, 0x02, 0x04
CLASSIC_MAX = 8
FD_LENGTHS = (*range(CLASSIC_MAX + 1), 12, 16, 20, 24, 32, 48, 64)
FREEZE_WORDS_MAX = 0xFFFF  # hg_freeze_words()
USUAL, LONG = "P22", "P05"  # profiles of frames of up to 12 bytes and of longer ones
NARROW_FAULTS = 16  # candidates in a verdict frame of 8 bytes; one of 12 holds the rest


@dataclass(frozen=True)
class SignalTable:
    """hg_code_scale, hg_field and the hold's numbers of one signal."""

    name: str
    resolution: float
    offset: float
    per_unit: float
    minimum: int
    maximum: int
    start: int
    length: int
    flags: int
    half: float
    span: float
    middle: float
    zero: int
    exponent: int = 0  # of the resolution in fixed point
    unit: int = 0  # its values and radii are these numbers times 2^unit


@dataclass(frozen=True)
class MessageTable:
    """hg_message."""

    name: str
    id: int
    flags: int
    length: int
    protection: ProtectionTable
    idle: tuple[int, ...] = ()  # the frame's bytes where no field lies; () where they are 0


@dataclass(frozen=True)
class GroupTable:
    """One group: trigger, hold and message."""

    name: str
    first: int
    signals: tuple[SignalTable, ...]
    message: MessageTable
    levels: int
    interval_max: int
    margin: int
    silence: tuple[int, ...]
    delta: tuple[tuple[int, ...], ...]
    sigma: tuple[tuple[int, ...], ...]
    activity: tuple[tuple[int, ...], ...]
    slew: tuple[tuple[float, ...], ...]  # interval_max + margin x width

    @property
    def periodic(self) -> bool:
        """Whether the sender speaks every interval_max samples, whatever its signals do."""
        return min(self.silence) + 1 >= self.interval_max


@dataclass(frozen=True)
class PredictTable:
    """hg_predict_config."""

    group: int
    first: int
    input: tuple[int, ...]
    known: tuple[float, ...]
    correct: tuple[tuple[float, ...], ...]
    state: tuple[tuple[float, ...], ...]
    drive: tuple[tuple[float, ...], ...]
    output: tuple[tuple[float, ...], ...]
    direct: tuple[tuple[float, ...], ...]
    fresh: tuple[float, ...]
    radius: tuple[tuple[float, ...], ...]  # horizon x width
    settle: int


@dataclass(frozen=True)
class MismatchTable:
    """hg_mismatch_config."""

    signal: tuple[int, ...]
    constant: tuple[float, ...]
    gain: tuple[tuple[float, ...], ...]  # states x signals
    exponent: int = 0


Rows = Sequence[Sequence[float]]


def blocks(weight: Sequence[Rows], taps: Sequence[int], tail: Rows) -> list[tuple[int, int, list[list[float]]]]:
    """Weights (lags x residuals x signals) and tails (residuals x signals) as hg_hull_config has them; see GeneratorTable.blocks."""
    made = []
    for first in range(0, len(tail), 2):
        pair = range(first, min(first + 2, len(tail)))
        for g, count in enumerate(taps):
            lags = [[weight[lag][i][g] for i in pair] for lag in range(count)]
            made.append((first, g, [*lags, [tail[i][g] for i in pair]]))
    return made


@dataclass(frozen=True)
class GeneratorTable:
    """hg_residual_config and hg_hull_config."""

    signal: tuple[int, ...]
    wide: tuple[int, ...]  # the signals of the threshold: these, and derived ones that have a radius only
    state: tuple[tuple[float, ...], ...]
    input: tuple[tuple[float, ...], ...]
    output: tuple[tuple[float, ...], ...]
    direct: tuple[tuple[float, ...], ...]
    taps: tuple[int, ...]  # of each of `wide`
    weight: tuple[tuple[tuple[float, ...], ...], ...]  # by lag, residual and signal; 0 behind a signal's taps
    settle: int
    rest: tuple[tuple[float, ...], ...]
    rest_left: tuple[float, ...]
    moving: tuple[tuple[float, ...], ...]
    moving_left: tuple[float, ...]
    bias: tuple[float, ...]
    ready_rest: int
    ready_moving: int
    decay: tuple[float, ...]
    tail: tuple[tuple[float, ...], ...]  # residuals x wide
    feeds: int
    faults: int
    zonotope: ZonotopeTable | None = None  # the threshold instead of the hull
    exponents: tuple[int, int, int] = (0, 0, 0)  # of state and input, of output and direct, of weight and tail

    @property
    def blocks(self) -> list[tuple[int, int, list[list[float]]]]:
        """The weights as they lie in memory: (first residual, signal, taps and tail x 2 or 1) for each two residuals, signal after signal."""
        return blocks(self.weight, self.taps, self.tail)


@dataclass(frozen=True)
class ModalGeneratorTable(GeneratorTable):
    """A generator whose threshold has a theta for each mode."""

    mode_decay: tuple[float, ...] = ()
    mode_input: tuple[tuple[float, ...], ...] = ()  # modes x wide
    mode_output: tuple[tuple[float, ...], ...] = ()  # residuals x modes
    mode_rest: tuple[float, ...] = ()
    mode_moving: tuple[float, ...] = ()


@dataclass(frozen=True)
class FreezeTable:
    """hg_freeze_config."""

    samples: int
    after: int
    burst: int
    request: MessageTable
    response: MessageTable


@dataclass(frozen=True)
class Tables:
    """hg_node_config with all that hangs on it."""

    name: str
    groups: tuple[GroupTable, ...]
    closing: int
    generators: tuple[GeneratorTable, ...]
    up: int
    down: int
    latch: bool
    verdict: MessageTable
    status: MessageTable
    heartbeat: int
    predictors: tuple[PredictTable, ...] = ()
    mismatch: MismatchTable | None = None
    banks: tuple[BankTable, ...] = ()
    fixed: Tables | None = None  # the same in fixed point, or
    not_fixed: str = ""  # why there is none
    units: tuple[int, ...] = ()  # of fixed point: numbers are times 2^unit; the signal vector, then the residuals
    float_hash: int | None = None  # of fixed point: it is the same model
    polynomials: tuple[StatisticTable, ...] = ()
    freeze: FreezeTable | None = None

    @property
    def signals(self) -> int:
        """Signals that are sent."""
        return sum(len(g.signals) for g in self.groups)

    @property
    def width(self) -> int:
        """Length of the signal vector: sent and derived signals."""
        return self.signals + sum(len(p.output) for p in self.predictors) + (len(self.mismatch.constant) if self.mismatch else 0)

    @property
    def history(self) -> int:
        """Rows of the ring of radii."""
        taps = [max(g.taps) + 1 for g in self.generators if g.zonotope is None]
        rewinds = [g.interval_max + 1 for g in self.groups] if any(g.zonotope is not None for g in self.generators) else []
        return max(taps + rewinds + [b.window for b in self.banks] + [1] * len(self.polynomials))

    @property
    def window(self) -> int:
        """Rows of the ring of values."""
        return max((b.window for b in self.banks), default=0)

    @property
    def judging(self) -> tuple[GeneratorTable | BankTable | StatisticTable, ...]:
        """Residual generators, then banks, then polynomial filters: what the decision listens to."""
        return (*self.generators, *self.banks, *self.polynomials)

    @property
    def judged(self) -> int:
        """How many they are."""
        return len(self.judging)

    @property
    def residuals(self) -> int:
        """Residuals of all generators together, one for each bank, and a polynomial filter's statistics."""
        return sum(len(g.output) for g in self.generators) + len(self.banks) + len(STATISTICS) * len(self.polynomials)

    @property
    def reals(self) -> int:
        """hg_detector_reals(), evaluated here so that the generated storage has exactly that length."""
        own = sum(2 * len(g.state) + len(g.signal) for g in self.generators)
        own += sum(len(g.output) if g.zonotope is None else g.zonotope.reals for g in self.generators)
        own += sum(len(g.mode_decay) for g in self.generators if isinstance(g, ModalGeneratorTable))
        own += sum(2 * len(p.state) + len(p.input) + len(p.output) for p in self.predictors) + sum(p.reals for p in self.polynomials)
        return 2 * self.width + 2 * self.residuals + 2 * self.signals + self.width * self.history + self.signals * self.window + own

    @property
    def codes(self) -> int:
        """HG_HOLD_CODES of all groups."""
        return 2 * self.signals

    @property
    def sums(self) -> int:
        """hg_detector_sums()."""
        return sum(2 * b.certificates for b in self.banks)

    @cached_property
    def hash(self) -> int:
        """32 bits that change with any number above: host and node compare them."""
        if self.float_hash is not None:
            return self.float_hash
        plain = plain_of(replace(self, fixed=None, not_fixed=""))
        for part in ("polynomials", "freeze"):
            if not plain[part]:
                del plain[part]  # a model without it is what it was before there were any
        return hash_of(plain)


def hash_of(plain: Any) -> int:
    """32 bits of plain data."""
    text = json.dumps(plain, sort_keys=True, separators=(",", ":"))
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "little")


def plain_of(value: Any) -> Any:
    """Data with every float as its exact hexadecimal text."""
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain_of(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, dict):
        return {k: plain_of(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain_of(v) for v in value]
    return value.hex() if isinstance(value, float) else value


def rows(a: Array) -> tuple[tuple[float, ...], ...]:
    """A matrix as nested tuples."""
    return tuple(tuple(float(x) for x in r) for r in a)


def _codes(s: Signal, resolution: float, offset: float) -> tuple[int, int, int]:
    """Smallest and largest code, and the bits of a signed field that holds them beside its most negative pattern, which says 'invalid'."""
    minimum, maximum = round((s.low - offset) / resolution), round((s.high - offset) / resolution)
    return minimum, maximum, max(abs(maximum), abs(minimum), 1).bit_length() + 1


def signal_table(s: Signal, start: int, exact: bool) -> SignalTable:
    """Codes and the wire of one signal. `exact`: the receiver's value is the truth (an input applied as sent)."""
    resolution = float(nearest32(np.array(s.resolution)))
    offset = 0.0
    minimum, maximum, bits = _codes(s, resolution, offset)
    middle = float(nearest32(np.array(round((s.low + s.high) / 2 / resolution) * resolution)))
    if (_codes(s, resolution, middle)[2] + 7) // 8 < (bits + 7) // 8:
        offset = middle  # saves a byte
        minimum, maximum, bits = _codes(s, resolution, offset)
    if bits > CODE_BITS_MAX:
        raise InputError(f"signal '{s.name}': {s.low:g} .. {s.high:g} in steps of {s.resolution:g} needs {bits} bits, at most {CODE_BITS_MAX} fit; make the resolution coarser")
    length = 32 if s.float32 else (bits + 7) // 8 * 8
    largest = max(abs(s.low), abs(s.high), abs(offset))
    rounding = 12 * U32 * largest  # encoder, decoder and the reading itself, in float32
    return SignalTable(
        name=s.name,
        resolution=resolution,
        offset=offset,
        per_unit=float(nearest32(np.array(1.0 / resolution))),
        minimum=minimum,
        maximum=maximum,
        start=start,
        length=length,
        flags=FLOAT32 if s.float32 else SIGNED,
        half=float(up32(np.array(rounding if exact else resolution / 2 + rounding))),
        span=float(up32(np.array((s.high - s.low) * (1 + 4 * U32) + resolution))),
        middle=float(nearest32(np.array((s.low + s.high) / 2))),
        zero=round(-offset / resolution),
    )


def field_table(s: Signal, field: Field, exact: bool) -> SignalTable:
    """Codes and the wire of one signal where a vehicle's frame has it. `exact` as in signal_table()."""
    resolution, offset = float(nearest32(np.array(s.resolution))), 0.0 if field.is_float else float(nearest32(np.array(field.offset)))
    zero = 0.0 if field.is_float else field.offset
    minimum, maximum = round((s.low - zero) / s.resolution), round((s.high - zero) / s.resolution)
    if max(abs(minimum), abs(maximum)).bit_length() > CODE_BITS_MAX:
        raise InputError(
            f"signal '{s.name}': {s.low:g} .. {s.high:g} is raw {minimum} .. {maximum} of '{field.name}', beyond {CODE_BITS_MAX} bits, which float32 would round; "
            "give it a narrower range"
        )
    # Encoder, decoder and reading in float32, and the database's factor and offset as float32 tables have them.
    rounding = 16 * U32 * (max(abs(s.low), abs(s.high)) + abs(offset))
    return SignalTable(
        name=s.name,
        resolution=resolution,
        offset=offset,
        per_unit=float(nearest32(np.array(1.0 / resolution))),
        minimum=minimum,
        maximum=maximum,
        start=field.start,
        length=field.length,
        flags=(MOTOROLA if field.motorola else 0) | (FLOAT32 if field.is_float else SIGNED if field.is_signed else 0),
        half=float(up32(np.array(rounding if exact else resolution / 2 + rounding))),
        span=float(up32(np.array((s.high - s.low) * (1 + 4 * U32) + resolution + 2 * rounding))),
        middle=float(nearest32(np.array((s.low + s.high) / 2))),
        zero=round(-offset / resolution),
    )


def message_table(name: str, frame: Frame, length: int, protection: ProtectionTable | None = None) -> MessageTable:
    """hg_message; CAN FD where the model asks for it or says nothing and a classic frame is too short. A length that FD cannot carry is rounded up."""
    fd = length > CLASSIC_MAX if frame.fd is None else frame.fd
    most = FD_LENGTHS[-1] if fd else CLASSIC_MAX
    if length > most:
        cure = "split the group" if fd else "make the frame fd = true, or split the group"
        raise InputError(f"group '{name}': its signals need {length} bytes with protection, more than {most}; {cure}")
    if fd:
        length = next(n for n in FD_LENGTHS if n >= max(length, CLASSIC_MAX))
    flags = (EXTENDED if frame.extended else 0) | ((FD | BRS) if fd else 0)
    return MessageTable(name, frame.id, flags, length, protection or own_protection(frame.profile or USUAL, frame.mode, frame.data_id)[0])


def _own_layout(model: Model, group: Group, profile: str) -> tuple[list[SignalTable], ProtectionTable, int]:
    """Signals, protection and bytes of a frame of the project's own layout: one signal behind another."""
    protection, place = own_protection(profile, group.frame.mode, group.frame.data_id)
    signals = []
    for i in group.signals:
        s = signal_table(model.signals[i], place, group.applied_as_sent)
        signals.append(s)
        place += s.length
    return signals, protection, (place + 7) // 8


def _layout(model: Model, group: Group) -> tuple[list[SignalTable], MessageTable]:
    """Signals and frame of a group, with the checks that the model leaves on."""
    signals, message = _placed(model, group)
    return signals, replace(message, protection=replace(message.protection, ignore=group.ignore, resync=group.resync))


def _placed(model: Model, group: Group) -> tuple[list[SignalTable], MessageTable]:
    """The vehicle's frame, or the project's own, by profile 05 where that of 8 bits is not sure of three flipped bits."""
    frame, wire = group.frame, group.frame.wire
    if wire is not None:
        signals = [field_table(model.signals[i], f, group.applied_as_sent) for i, f in zip(group.signals, wire.fields, strict=True)]
        flags = (EXTENDED if wire.extended else 0) | (FD if wire.fd else 0) | (BRS if wire.fd and wire.brs else 0)
        return signals, MessageTable(group.name, wire.id, flags, wire.length, wire.protection, wire.idle)
    signals, protection, length = _own_layout(model, group, frame.profile or USUAL)
    if frame.profile is None and length > SURE:
        signals, protection, length = _own_layout(model, group, LONG)
    return signals, message_table(group.name, frame, length, protection)


def verdict_table(model: Model) -> MessageTable:
    """hg_message of the verdict frame: 8 bytes, or 12 where there are more faults than those name."""
    wide = len(model.faults) > NARROW_FAULTS
    if wide and model.verdict.fd is False:
        raise InputError(f"verdict frame: {len(model.faults)} faults need 12 bytes, 8 bytes of classic CAN name {NARROW_FAULTS}; leave fd out of its frame, or name fewer faults")
    return message_table("verdict", model.verdict, 12 if wide else 8)


def freeze_table(model: Model) -> FreezeTable | None:
    """hg_freeze_config, where the model keeps samples around an alarm."""
    f = model.freeze
    if f is None:
        return None
    request, response = message_table("freeze_request", f.request, CLASSIC_MAX), message_table("freeze_response", f.response, CLASSIC_MAX)
    return FreezeTable(f.samples, f.after, f.burst, request, response)


def check_freeze(tables: Tables) -> None:
    """Refuse a record whose words have no number in a response; float64 has most of them."""
    if tables.freeze is not None:
        row = 3 + 4 * (tables.width + tables.residuals)
        most = (FREEZE_WORDS_MAX - 4) // row
        if tables.freeze.samples > most:
            raise InputError(f"freeze.samples: {tables.freeze.samples} samples of {row} words are more than the {FREEZE_WORDS_MAX} that responses can number; at most {most}")


def _check_alias(group: Group, message: MessageTable) -> None:
    """Refuse a counter that runs round before the group is stale: as many lost frames would look like none."""
    modulus, horizon = message.protection.modulus, group.trigger.interval_max + group.trigger.margin
    shortest = min(group.trigger.silence) + 1
    if message.protection.profile != NONE and modulus * shortest <= horizon:
        raise InputError(
            f"group '{group.name}': its counter of {modulus} hides the loss of {modulus} frames, which can pass within interval_max + margin = {horizon} samples; "
            f"shorten them to {modulus * shortest - 1}, or make the sender silent for longer"
        )


def group_table(model: Model, group: Group, slew: Array) -> GroupTable:
    """Trigger in codes, hold in signal units. `slew` (signals x horizon) is of the model's whole signal vector."""
    trigger, skew = group.trigger, group.skew
    signals, message = _layout(model, group)
    resolution = np.array([s.resolution for s in signals])
    half = np.array([s.half for s in signals])
    # Radius (threshold + 1/2) resolution must not exceed the trigger that was asked for.
    sigma = np.maximum(np.floor(trigger.sigma / resolution - 0.5 + 1e-6), 0.0)
    widest = np.array([s.span for s in signals])
    moved = slew[list(group.signals), : group.horizon].T
    table = np.minimum(moved[skew:] + half, widest)
    if skew:
        # Booked to a sample that it need not be of: fresh is as old as that may be.
        late = up32(np.minimum(moved[skew - 1] + half, widest))
        signals = [replace(s, half=float(h)) for s, h in zip(signals, late, strict=True)]
    _check_alias(group, message)
    return GroupTable(
        name=group.name,
        first=group.signals[0] if group.signals else 0,
        signals=tuple(signals),
        message=message,
        levels=len(trigger.silence),
        interval_max=trigger.interval_max,
        margin=trigger.margin,
        silence=trigger.silence,
        delta=tuple(tuple(math.floor(x * 65536) for x in r) for r in trigger.delta),
        sigma=tuple(tuple(int(x) for x in r) for r in sigma),
        activity=tuple(tuple(math.ceil(x - 1e-9) for x in r) for r in trigger.activity / resolution),
        slew=rows(up32(table)),
    )
