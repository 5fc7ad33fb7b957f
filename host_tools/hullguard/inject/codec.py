"""Frames by DBC name: fields as raw values or in signal units, end-to-end protection, and how a receiver will count a frame.

Places of fields are read and written bit by bit, so that what a fault does not mean to touch stays as it was.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import cantools

from hullguard.bus.candump import ERROR, EXTENDED, FD, REMOTE
from hullguard.codegen.dbc import emit_dbc
from hullguard.codegen.names import names_of
from hullguard.core.library import library
from hullguard.core.native import Frame
from hullguard.core.protect import Protector
from hullguard.design.design import Design
from hullguard.design.protection import NONE, check_protection
from hullguard.errors import InputError
from hullguard.model.network import protection, real, too_large

FLOATS = {16: ("<e", 0x7E00), 32: ("<f", 0x7FC00000), 64: ("<d", 0x7FF8000000000000)}  # bits: format, quiet NaN
KIND = EXTENDED | REMOTE | FD | ERROR


@dataclass(frozen=True)
class Field:
    """One signal of a message; minimum and maximum in its units, None where the DBC states no range."""

    name: str
    start: int
    length: int
    motorola: bool
    is_signed: bool
    is_float: bool
    scale: float
    offset: float
    minimum: float | None
    maximum: float | None
    choice: tuple[Field, tuple[int, ...]] | None = None  # a multiplexed signal's selector, and for which of its values it is there

    @cached_property
    def _places(self) -> tuple[tuple[int, int, int], ...]:
        """Bit of the field, least significant first; byte and bit of the frame. A Motorola field runs down its byte and on to the top of the next."""
        made = []
        for i in range(self.length):
            bit = self.start + i
            if self.motorola:
                sent = self.start // 8 * 8 + 7 - self.start % 8 + self.length - 1 - i
                bit = sent // 8 * 8 + 7 - sent % 8
            made.append((i, bit // 8, bit % 8))
        return tuple(made)

    def raw(self, data: bytes) -> int:
        """The field's bits, without sign."""
        return sum((data[byte] >> bit & 1) << i for i, byte, bit in self._places)

    def with_raw(self, data: bytes, raw: int) -> bytes:
        """The data with other bits in this field."""
        made = bytearray(data)
        for i, byte, bit in self._places:
            made[byte] = made[byte] & ~(1 << bit) | (raw >> i & 1) << bit
        return bytes(made)

    @property
    def invalid(self) -> int:
        """The pattern that stands for no value (frame.h): all ones, the most negative number, or a quiet NaN."""
        if self.is_float:
            return FLOATS[self.length][1]
        return 1 << (self.length - 1) if self.is_signed else (1 << self.length) - 1

    def value(self, data: bytes) -> float:
        """In signal units; NaN where the frame says that there is no value."""
        raw = self.raw(data)
        if not self.has_value(raw):
            return math.nan
        if self.is_float:
            found = struct.unpack(FLOATS[self.length][0], raw.to_bytes(self.length // 8, "little"))[0]
            return float(found) * self.scale + self.offset
        return self._code(raw) * self.scale + self.offset

    def _code(self, raw: int) -> int:
        return raw - (1 << self.length) if self.is_signed and raw >> (self.length - 1) else raw

    @cached_property
    def codes(self) -> tuple[int, int]:
        """Least and largest code, of the DBC's range as far as the field goes."""
        ones = (1 << (self.length - self.is_signed)) - 1
        least, most = (-ones - 1 if self.is_signed else 0), ones
        if self.minimum is None or self.maximum is None:
            return least, most
        ends = sorted(round((x - self.offset) / self.scale) for x in (self.minimum, self.maximum))
        return max(least, ends[0]), min(most, ends[1])

    def has_value(self, raw: int) -> bool:
        """Do these bits say a value, be it out of range? A range that holds the pattern for no value has no such pattern."""
        least, most = (0, -1) if self.is_float else self.codes
        return raw != self.invalid or least <= self._code(raw) <= most

    def pattern(self, value: float, clip: bool = True) -> int:
        """Bits for a value in signal units; clipped to the range as a converter does, or as far as the field goes."""
        if math.isnan(value):
            return self.invalid
        if self.is_float:
            if clip and self.minimum is not None and self.maximum is not None:
                value = min(max(value, self.minimum), self.maximum)
            try:
                made = struct.pack(FLOATS[self.length][0], (value - self.offset) / self.scale)
            except OverflowError:
                made = struct.pack(FLOATS[self.length][0], math.copysign(math.inf, value))
            return int.from_bytes(made, "little")
        ones = (1 << (self.length - self.is_signed)) - 1
        least, most = self.codes if clip else ((-ones if self.is_signed else 0), ones - (0 if self.is_signed else 1))
        exact = (value - self.offset) / self.scale
        return int(min(max(round(min(max(exact, -(2.0**63)), 2.0**63)), least), most)) & ((1 << self.length) - 1)

    @property
    def beyond(self) -> int | None:
        """A pattern that is neither a value within the range nor the one for no value; None where the field holds no such thing."""
        if self.is_float:
            return int.from_bytes(struct.pack(FLOATS[self.length][0], math.inf), "little")
        least, most = self.codes
        for code in (most + 1, least - 1):
            raw = code & ((1 << self.length) - 1)
            if self._code(raw) == code and self.has_value(raw):
                return raw
        return None

    def in_range(self, data: bytes) -> bool:
        """Whether what the field holds is a value within the range."""
        if not self.is_float:
            least, most = self.codes
            return least <= self._code(self.raw(data)) <= most
        value = self.value(data)
        return math.isfinite(value) and (self.minimum is None or self.minimum <= value) and (self.maximum is None or value <= self.maximum)

    def present(self, data: bytes) -> bool:
        """Whether the signal is in a frame with these data."""
        return self.choice is None or self.choice[0].raw(data) in self.choice[1]


@dataclass(frozen=True)
class Layout:
    """One message."""

    name: str
    id: int
    flags: int
    length: int
    fields: dict[str, Field]
    protection: Protector | None

    def carries(self, frame: Frame) -> bool:
        """Is it a frame of this message, whole and of its kind? Its checksum does not count."""
        return frame.id == self.id and frame.flags & KIND == self.flags & KIND and len(frame.data) == self.length

    @cached_property
    def free_bits(self) -> tuple[int, ...]:
        """Bits of the data that protection leaves as they are."""
        if self.protection is None:
            return tuple(range(8 * self.length))
        return tuple(i for i in range(8 * self.length) if i not in self.protection.table.bits)

    def renewed(self, frame: Frame, data: bytes) -> Frame:
        """The frame with other data and its own counter and stamp, protected anew. One that was damaged before stays so."""
        if self.protection is None:
            return replace(frame, data=data)
        header = self.protection.check(frame.data)
        if header is not None:
            return replace(frame, data=self.protection.protect(data, header.counter, header.stamp or 0))
        return replace(frame, data=self.damaged(data) if self.protection.check(data) else data)

    def damaged(self, data: bytes) -> bytes:
        """Data that are in order, with a checksum that is not."""
        if self.protection is None:
            return data
        at = self.protection.table.crc
        return data[:at] + bytes([data[at] ^ 0x01]) + data[at + 1 :]


@dataclass
class Codec:
    """The messages of a DBC. closing: the one that ends a sample, where that is known. An empty codec knows identifiers only."""

    layouts: tuple[Layout, ...] = ()
    closing: Layout | None = None
    source: str = ""
    _by_id: dict[tuple[int, int], Layout] = field(init=False)

    def __post_init__(self) -> None:
        self._by_id = {(x.id, x.flags & EXTENDED): x for x in self.layouts}

    def layout(self, frame: Frame) -> Layout | None:
        """The message that a frame carries whole."""
        found = self._by_id.get((frame.id, frame.flags & EXTENDED))
        return found if found is not None and found.carries(frame) else None

    def message(self, name: str) -> Layout:
        """A message by its name."""
        found = next((x for x in self.layouts if x.name == name), None)
        if found is None:
            raise InputError(f"no message '{name}'{self._known([x.name for x in self.layouts])}")
        return found

    def signal(self, name: str) -> tuple[Layout, Field]:
        """A signal by its name, or MESSAGE.SIGNAL where more than one message has it."""
        owner, _, own = name.rpartition(".")
        found = [x for x in self.layouts if own in x.fields and owner in ("", x.name)]
        if not found:
            raise InputError(f"no signal '{name}'{self._known([n for x in self.layouts for n in x.fields])}")
        if len(found) > 1:
            raise InputError(f"signal '{name}' is in messages {', '.join(x.name for x in found)}; say which, for example {found[0].name}.{own}")
        return found[0], found[0].fields[own]

    def _known(self, names: list[str]) -> str:
        if not self.layouts:
            return ": without a model or DBC nothing is known by name; name one before the options"
        return f" in {self.source}; it has {', '.join(dict.fromkeys(names))}"

    def reception(self, frame: Frame) -> str:
        """Health counter that a receiver of these messages raises for a frame as such, without its place in the sequence; empty: no message is known."""
        if not self.layouts:
            return ""
        found = self._by_id.get((frame.id, frame.flags & EXTENDED))
        if found is None:
            return "unknown"
        if not found.carries(frame):
            return "format"
        if found.protection is not None and found.protection.check(frame.data) is None:
            return "crc"
        held = [f for f in found.fields.values() if f.present(frame.data)]
        valued = [f.has_value(f.raw(frame.data)) for f in held]
        if any(v and not f.in_range(frame.data) for f, v in zip(held, valued, strict=True)):
            return "numeric"
        return "good" if all(valued) else "invalid"


def _protection(message: Any) -> Protector | None:
    """What the attributes of a message in a DBC say of its protection."""
    table = protection(message)
    check_protection(table, message.length, f"message '{message.name}'")
    return None if table.profile == NONE else Protector(library(), table)


def _fields(message: Any) -> dict[str, Field]:
    made: dict[str, Field] = {}
    for s in sorted(message.signals, key=lambda s: s.multiplexer_signal is not None):
        where = f"message '{message.name}', signal '{s.name}'"
        choice = (made[s.multiplexer_signal], tuple(s.multiplexer_ids)) if s.multiplexer_signal in made and s.multiplexer_ids else None
        made[s.name] = Field(
            name=s.name, start=s.start, length=s.length, motorola=s.byte_order == "big_endian", is_signed=bool(s.is_signed) and not s.is_float, is_float=bool(s.is_float),
            scale=real(s.scale, where), offset=real(s.offset, where), minimum=None if s.minimum is None else real(s.minimum, where),
            maximum=None if s.maximum is None else real(s.maximum, where), choice=choice,
        )  # fmt: skip
    return made


def codec_of(text: str, source: str, closing: str | None = None) -> Codec:
    """The codec of a DBC's text; `closing` names the message that ends a sample."""
    wrong = too_large(text)
    if wrong:
        raise InputError(f"{source}: a length or a place that no frame has, at '{wrong}'; correct the database")
    try:
        database: Any = cantools.database.load_string(text, "dbc")
    except Exception as error:  # cantools lets errors of several parsers through
        raise InputError(f"{source}: not a DBC that can be read ({' '.join(str(error).split()) or type(error).__name__})") from error
    layouts = []
    for m in database.messages:
        flags = (EXTENDED if m.is_extended_frame else 0) | (FD if m.is_fd else 0)
        layouts.append(Layout(m.name, m.frame_id, flags, m.length, _fields(m), _protection(m)))
    made = Codec(tuple(layouts), None, source)
    return replace(made, closing=made.message(closing)) if closing else made


def design_codec(made: Design) -> Codec:
    """The codec of a design, as its DBC has it, with the message that closes a sample."""
    return codec_of(emit_dbc(made), made.model.name, names_of(made).groups[made.tables.closing])


def read_codec(path: Path) -> Codec:
    """The codec of a DBC file."""
    try:
        return codec_of(path.read_text(encoding="cp1252"), path.name)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give a DBC file or a model") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not text in the encoding of a DBC, cp1252 ({error.reason} at byte {error.start}); save it so") from error
