"""Frames, layouts, identifiers and protection taken from a vehicle's own database (DBC) by name.

`adopt` looks at a model's data before anything else is read: a group with `dbc_message` gets its frame from the database, and each of its signals
what the model leaves out. All that the library could not do, or could not do soundly, is refused here, in one line that says what would do.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hullguard.design.protection import LISTED, MODAL, MODES, NIBBLE, NO_STAMP, NONE, PROFILES, UNPROTECTED, ProtectionTable, check_protection, own_protection
from hullguard.errors import InputError
from hullguard.files import is_file
from hullguard.model.table import Table

if TYPE_CHECKING:
    from hullguard.model.schema import Signal

SAME = 1e-9  # relative: two numbers that a person wrote as the same
UNSIGNED_MAX, SIGNED_MAX, FLOAT_BITS = 31, 32, 32
LENGTH_MAX = 1785  # bytes: of a message that a transport protocol (J1939) carries in many frames
_PLACE = re.compile(r"\bBO_\s+\d+\s+\w+\s*:\s*(-?\d+)|:\s*(-?\d+)\s*\|\s*(-?\d+)\s*@")
FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
CLASSIC_MAX = 8
CYCLE_MAX_MS = 3_600_000  # an hour


@dataclass(frozen=True)
class Field:
    """One signal in a frame: value = offset + factor * raw."""

    name: str
    start: int  # as in the DBC: least significant bit (Intel), most significant bit (Motorola)
    length: int
    motorola: bool
    is_signed: bool
    is_float: bool
    factor: float
    offset: float
    low: float | None
    high: float | None

    @property
    def bits(self) -> tuple[int, ...]:
        """Its bits in Intel numbering, least significant first."""
        if not self.motorola:
            return tuple(range(self.start, self.start + self.length))
        # In the order of transmission a Motorola field is one run: bit 7 of a byte first.
        first = self.start // 8 * 8 + 7 - self.start % 8
        return tuple(sent // 8 * 8 + 7 - sent % 8 for sent in range(first + self.length - 1, first - 1, -1))

    @property
    def codes(self) -> tuple[int, int]:
        """Smallest and largest raw value; the one that stands for 'no value' is not among them."""
        if self.is_signed:
            return 1 - (1 << (self.length - 1)), (1 << (self.length - 1)) - 1
        return 0, (1 << self.length) - 2


@dataclass(frozen=True)
class Wire:
    """A group's frame as the vehicle has it."""

    message: str
    id: int
    extended: bool
    fd: bool
    brs: bool
    length: int  # bytes
    fields: tuple[Field, ...]  # of the group's signals
    protection: ProtectionTable
    idle: tuple[int, ...]  # the frame's bytes where its other signals have their initial values and these are 0; () where all are 0
    cycle_ms: int  # 0: not stated


@dataclass(frozen=True)
class Network:
    """What a model takes from a database."""

    wires: tuple[Wire | None, ...]  # a place for every group
    taken: dict[tuple[int, bool], str]  # identifier and whether it is extended: the vehicle's message

    def plain(self) -> list[Any]:
        """Data that changes with anything taken."""
        return [None if w is None else asdict(w) for w in self.wires]


def adopt(data: dict[str, Any], where: str, folder: Path) -> Network:
    """Take the frames that a model names from its database, and fill in what its signals leave out. Changes `data`."""
    network = Table(data.get("network", {}), f"{where}.network")
    database = load(network, folder) if "dbc" in network else None
    network.close()
    groups = [g for g in data.get("groups", []) if isinstance(g, dict)] if isinstance(data.get("groups"), list) else []
    signals = [s for s in data.get("signals", []) if isinstance(s, dict)] if isinstance(data.get("signals"), list) else []
    wires: list[Wire | None] = []
    for i, group in enumerate(groups):
        t = Table(group, f"{where}.groups[{i}]")
        if "dbc_message" not in t:
            wires.append(None)
            continue
        if database is None:
            raise t.error("dbc_message", 'needs the database it is in; give [network] dbc = "FILE.dbc"')
        wires.append(_wire(t, database, [(f"{where}.signals[{k}]", s) for k, s in enumerate(signals)]))
        for key in ("dbc_message", "frame"):
            group.pop(key, None)
    for k, s in enumerate(signals):
        if "dbc_signal" in s:
            raise InputError(f"{where}.signals[{k}].dbc_signal: its group takes no frame from a database; give the group dbc_message, or remove it")
    if database is None:
        return Network(tuple(wires), {})
    return Network(tuple(wires), {(m.frame_id, m.is_extended_frame): m.name for m in database.messages})


def too_large(text: str) -> str:
    """The first place or length in a DBC's text that no frame has, empty for none: cantools would lay it out bit by bit until the memory is full."""
    for found in _PLACE.finditer(text):
        if any(not 0 <= int(n[:12]) <= most for n, most in zip(found.groups("0"), (LENGTH_MAX, 8 * LENGTH_MAX, 8 * LENGTH_MAX), strict=True)):
            return " ".join(found[0].split())
    return ""


def real(value: Any, where: str) -> float:
    """A number of a database as a float: it may have more digits than one holds."""
    try:
        return float(value)
    except OverflowError as error:
        raise InputError(f"{where}: {str(value)[:12]}.. is too large a number; correct the database") from error


def _cycle_ms(message: Any) -> int:
    """The period of a message, 0 where the database states none."""
    cycle = message.cycle_time or 0
    if not 0 <= cycle <= CYCLE_MAX_MS:
        raise InputError(f"message '{message.name}': its cycle time of {str(cycle)[:12]} ms is outside 0 .. {CYCLE_MAX_MS}; correct the database")
    return int(cycle)


def load(network: Table, folder: Path) -> Any:
    """The database that [network] names, a path relative to the model file."""
    import cantools
    from cantools.database.errors import Error, UnsupportedDatabaseFormatError

    name = network.text("dbc")
    path = folder / name
    if not is_file(path):
        raise network.error("dbc", f"no file '{name}' beside the model")
    try:
        wrong = too_large(path.read_text(encoding="cp1252", errors="replace"))
        if wrong:
            raise network.error("dbc", f"'{name}' has a length or a place that no frame has, at '{wrong}'; correct the database")
        # Not strict: what is wrong with messages that the model does not use is no business of its.
        return cantools.database.load_file(path, database_format="dbc", strict=False)
    except (Error, UnsupportedDatabaseFormatError, UnicodeDecodeError, ValueError, KeyError) as error:
        raise network.error("dbc", f"'{name}' is not a database that can be read: {' '.join(str(error).split())}") from error
    except OSError as error:
        raise network.error("dbc", f"'{name}' cannot be read: {error.strerror}") from error


def _nearest(name: str, known: Iterable[str]) -> str:
    """What may have been meant, as the end of a message."""
    names = sorted(known)
    alike = [n for n in names if n.casefold() == name.casefold()]
    if len(alike) > 1:
        return f" alone: {', '.join(alike)} are called so; rename all but one in the database"
    folded = {n.casefold(): n for n in reversed(names)}
    near = difflib.get_close_matches(name.casefold(), list(folded), 1, 0.5)
    return f"; did you mean '{folded[near[0]]}'?" if near else f"; there are {', '.join(names[:12])}{', ..' if len(names) > 12 else ''}" if names else ""


def _found(name: str, known: Sequence[Any]) -> Any | None:
    """What is called so, if need be in other letters than these; None where there is nothing, or no single one."""
    exact = [k for k in known if k.name == name]
    alike = exact or [k for k in known if k.name.casefold() == name.casefold()]
    return alike[0] if len(alike) == 1 else None


def _wire(t: Table, database: Any, signals: list[tuple[str, dict[str, Any]]]) -> Wire:
    name = t.text("dbc_message")
    message = _found(name, database.messages)
    if message is None:
        raise t.error("dbc_message", f"the database has no message '{name}'{_nearest(name, [m.name for m in database.messages])}")
    where = f"{t.where}: message '{message.name}'"
    twins = [m.name for m in database.messages if m is not message and (m.frame_id, m.is_extended_frame) == (message.frame_id, message.is_extended_frame)]
    if twins:
        raise InputError(f"{where} has its identifier, 0x{message.frame_id:X}, in common with '{twins[0]}'; correct the database")
    if message.is_multiplexed():
        raise InputError(f"{where} is multiplexed: what its bits mean changes from frame to frame; ask for the signals in a message of one layout")
    if message.length not in FD_LENGTHS:
        raise InputError(f"{where} has {message.length} bytes, no length of a CAN frame; correct the database")
    fields = tuple(_field(where, signal, message, entry) for signal, entry in _members(t, signals))
    if len({f.name for f in fields}) < len(fields):
        raise InputError(f"{where}: two of the model's signals are one and the same of its own; remove one, or give dbc_signal")
    protection_ = _protection(t, message, where)
    check_protection(protection_, message.length, where)
    _apart(message, fields, protection_, where)
    brs = _attribute(message, "CANFD_BRS")
    return Wire(
        message=message.name,
        id=message.frame_id,
        extended=message.is_extended_frame,
        fd=bool(message.is_fd) or message.length > CLASSIC_MAX,
        brs=str(brs) != "0",
        length=message.length,
        fields=fields,
        protection=protection_,
        idle=_idle(message, {f.name for f in fields}),
        cycle_ms=_cycle_ms(message),
    )


def _members(t: Table, signals: list[tuple[str, dict[str, Any]]]) -> list[tuple[str, dict[str, Any]]]:
    """The entries of a group's signals."""
    known = {e.get("name"): (where, e) for where, e in signals if isinstance(e.get("name"), str)}
    members = t.names("signals", [])
    for n in members:
        if n not in known:
            raise t.error("signals", f"'{n}' is not a declared signal")
    return [known[n] for n in members]


def _field(where: str, at: str, message: Any, entry: dict[str, Any]) -> Field:
    """One signal's place; gives the entry what it leaves out."""
    t = Table(entry, at)
    asked = t.text("dbc_signal", t.text("name"))
    entry.pop("dbc_signal", None)
    signal = _found(asked, message.signals)
    if signal is None:
        raise InputError(f"{where} has no signal '{asked}'{_nearest(asked, [s.name for s in message.signals])}")
    here = f"{where}, signal '{signal.name}'"
    made = Field(
        name=signal.name,
        start=signal.start,
        length=signal.length,
        motorola=signal.byte_order == "big_endian",
        is_signed=bool(signal.is_signed),
        is_float=bool(signal.is_float),
        factor=real(signal.scale, here),
        offset=real(signal.offset, here),
        low=None if signal.minimum is None else real(signal.minimum, here),
        high=None if signal.maximum is None else real(signal.maximum, here),
    )
    _readable(here, made)
    _filled(here, made, entry)
    return made


def _readable(where: str, f: Field) -> None:
    """Refuse what the codec does not do."""
    if f.is_float:
        if f.length != FLOAT_BITS:
            raise InputError(f"{where}: a float of {f.length} bits; only float32 and integers can be read")
        if f.factor != 1 or f.offset != 0:
            raise InputError(f"{where}: a float32 with factor {f.factor:g} and offset {f.offset:g}; it must carry signal units: factor 1, offset 0")
        return
    most = SIGNED_MAX if f.is_signed else UNSIGNED_MAX
    if f.length > most:
        raise InputError(f"{where}: {f.length} bits; a{' signed' if f.is_signed else 'n unsigned'} signal may have {most}")
    if f.factor <= 0:
        raise InputError(f"{where}: factor {f.factor:g}; it must be positive: make the model's signal the negative one by a positive factor in the database")
    least, largest = f.codes
    if least >= largest:
        raise InputError(f"{where}: {f.length} bit has no room for two values beside the pattern that says 'no value'; make the field longer")


def _filled(where: str, f: Field, entry: dict[str, Any]) -> None:
    """Give a signal what it leaves out: resolution, range, kind of wire."""
    kind = "float32" if f.is_float else "integer"
    if entry.setdefault("wire", kind) != kind:
        raise InputError(f"{where} is {'a float32' if f.is_float else 'an integer'} in the database, the model says '{entry['wire']}'; remove wire from the signal")
    given = entry.get("resolution")
    if f.is_float and given is None:
        raise InputError(f"{where}: a float32 has no step of its own, and the receiver rounds to one; give the signal a resolution")
    if not f.is_float and isinstance(given, (int, float)) and not abs(given - f.factor) <= SAME * f.factor:
        raise InputError(f"{where}: its wire has steps of {f.factor:g}, the model says {given:g}; remove resolution from the signal")
    entry.setdefault("resolution", f.factor)
    if "range" in entry:
        return
    if f.low is None or f.high is None or not f.low < f.high:
        raise InputError(f"{where}: the database states no range; give the signal one")
    entry["range"] = [f.low, f.high]


def check_range(wire: Wire, field: Field, s: Signal) -> None:
    """Refuse a range that the field cannot carry beside its pattern for 'no value'."""
    if field.is_float:
        return
    where = f"signal '{s.name}': range {s.low:g} .. {s.high:g}"
    least, largest = field.codes
    codes = (s.low - field.offset) / field.factor, (s.high - field.offset) / field.factor  # infinite where the factor is tiny
    bounds = f"{field.offset + least * field.factor:g} .. {field.offset + largest * field.factor:g}"
    if not all(map(math.isfinite, codes)) or round(codes[0]) < least or round(codes[1]) > largest:
        raise InputError(
            f"{where} does not fit '{field.name}' of message '{wire.message}', which carries {bounds} beside the raw value that says 'no value', "
            f"{least - 1 if field.is_signed else largest + 1}; give a range within"
        )


def _apart(message: Any, fields: tuple[Field, ...], p: ProtectionTable, where: str) -> None:
    """Refuse a signal outside the frame, on another signal, or on the protection."""
    owner: dict[int, str] = {}
    used = {f.name for f in fields}
    for signal in message.signals:
        field = Field(signal.name, signal.start, signal.length, signal.byte_order == "big_endian", False, False, 1, 0, None, None)
        for bit in field.bits:
            if not 0 <= bit < 8 * message.length:
                raise InputError(f"{where}: signal '{signal.name}' is not inside its {message.length} bytes; correct the database")
            other = owner.setdefault(bit, signal.name)
            if other != signal.name and {other, signal.name} & used:
                raise InputError(f"{where}: signals '{other}' and '{signal.name}' overlap; correct the database")
            if signal.name in used and bit in p.bits:
                raise InputError(f"{where}: signal '{signal.name}' lies on the {p.bits[bit]} of its protection; name the place of the {p.bits[bit]} by its signal")


def _idle(message: Any, used: set[str]) -> tuple[int, ...]:
    """The frame with the signals that the model does not use at their initial values."""
    made = bytearray(message.length)
    for s in message.signals:
        start = s.raw_initial
        if s.name in used or not isinstance(start, int):
            continue
        field = Field(s.name, s.start, s.length, s.byte_order == "big_endian", False, False, 1, 0, None, None)
        for i, bit in enumerate(field.bits):
            made[bit // 8] |= (start >> i & 1) << (bit % 8)
    return tuple(made) if any(made) else ()


# --- protection ------------------------------------------------------------------------------------------------------------------------


def _attribute(message: Any, name: str) -> Any:
    """Value of a message's attribute, an enumeration's by its text; the definition's default where the message has none."""
    database = message.dbc
    if database is None or name not in database.attribute_definitions:
        return None
    definition = database.attribute_definitions[name]
    value = database.attributes[name].value if name in database.attributes else definition.default_value
    if definition.type_name == "ENUM" and isinstance(value, int) and definition.choices and 0 <= value < len(definition.choices):
        value = definition.choices[value]
    return value


def _number(message: Any, name: str, default: int) -> int:
    value = _attribute(message, name)
    if value is None:
        return default
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != int(value):
        raise InputError(f"message '{message.name}': attribute {name} is '{value}', not a whole number; correct the database")
    return int(value)


def protection(message: Any) -> ProtectionTable:
    """Protection of a cantools message by its attributes, the ones that codegen/dbc.py writes; that of the project's own layout where a place is not stated."""
    stated = _attribute(message, "E2EProfile")
    profile = str(stated) if stated not in (None, "", "None") else NONE
    if profile == NONE:
        return UNPROTECTED
    if profile not in PROFILES:
        raise InputError(f"message '{message.name}': attribute E2EProfile is '{profile}', not one of {', '.join(PROFILES)}; give the group protection = {{ profile = .. }}")
    mode = str(_attribute(message, "E2EDataIdMode") or "both")
    if mode not in MODES:
        raise InputError(f"message '{message.name}': attribute E2EDataIdMode is '{mode}', not one of {', '.join(MODES)}; correct the database")
    if profile not in LISTED and _attribute(message, "E2EDataId") is None:
        raise InputError(f"message '{message.name}': profile {profile} without an attribute E2EDataId; give the group protection = {{ profile = \"{profile}\", data_id = .. }}")
    data_id = _number(message, "E2EDataId", 0)
    usual, _ = own_protection(profile, mode, data_id)
    stamp = _number(message, "E2EStampBit", usual.stamp)
    return ProtectionTable(
        profile=profile,
        crc=_number(message, "E2ECrcByte", usual.crc),
        counter=_number(message, "E2ECounterBit", usual.counter),
        nibble=_number(message, "E2ENibbleBit", usual.nibble) if usual.nibbled else 0,
        stamp=stamp if stamp >= 0 else NO_STAMP,
        mode=usual.mode,
        data_id=usual.data_id,
        data_ids=_list(message) if profile in LISTED else (),
        ignore=(),
    )


def _list(message: Any) -> tuple[int, ...]:
    text = str(_attribute(message, "E2EDataIdList") or "")
    parts = [p for p in re.split(r"[\s,;]+", text) if p]
    if not all(re.fullmatch(r"(0[xX])?[0-9A-Fa-f]{1,2}", p) for p in parts):
        raise InputError(f"message '{message.name}': attribute E2EDataIdList is '{text}', not a list of bytes in hexadecimal; correct the database")
    return tuple(int(p, 16) for p in parts)


def _protection(t: Table, message: Any, where: str) -> ProtectionTable:
    """What the group's frame says of its protection by the names of signals; else the message's attributes."""
    frame = t.table("frame", optional=True)
    for key in ("id", "extended", "fd", "data_id", "mode"):
        if key in frame:
            raise frame.error(key, "taken from the database; remove it")
    stated = frame.raw("protection") if "protection" in frame else None
    frame.close()
    if stated is None:
        return protection(message)
    if isinstance(stated, dict):
        return _by_name(Table(stated, f"{frame.where}.protection"), message, where)
    if stated == NONE and protection(message).profile == NONE:
        return UNPROTECTED
    raise frame.error("protection", f"the database says {protection(message).profile}; remove it, or name the fields: protection = {{ profile = .., crc = .., counter = .. }}")


def _by_name(t: Table, message: Any, where: str) -> ProtectionTable:
    """Protection whose fields are signals of the message."""
    profile = t.text("profile", choices=[p for p in PROFILES if p != NONE])
    wide = profile == "P05"
    mode = t.text("mode", "both", MODES) if profile in MODAL else "both"
    ids: tuple[int, ...] = ()
    if profile in LISTED:
        ids = tuple(int(x) for x in t.vector("data_ids", 16, 0.0))
        if any(x != y or y > 0xFF for x, y in zip(t.vector("data_ids", 16), ids, strict=True)):
            raise t.error("data_ids", "expected 16 whole numbers of 0 .. 255")
    crc = _place(t, "crc", message, 16 if wide else 8, 8, where)
    if crc is None:
        raise InputError(f"{t.where}: 'crc' is missing")
    counter = _place(t, "counter", message, 8 if wide else NIBBLE, 8 if wide else NIBBLE, where)
    if counter is None:
        raise InputError(f"{t.where}: 'counter' is missing")
    stamp = _place(t, "stamp", message, NIBBLE, NIBBLE, where)
    nibbled = profile in MODAL and mode == "nibble"
    # Of the profile's own layouts: beside the counter.
    nibble = _place(t, "nibble", message, NIBBLE, NIBBLE, where) if nibbled else None
    nibble = (counter ^ NIBBLE if nibble is None else nibble) if nibbled else 0
    made = ProtectionTable(
        profile=profile,
        crc=crc // 8,
        counter=counter,
        nibble=nibble,
        stamp=NO_STAMP if stamp is None else stamp,
        mode=mode,
        data_id=0 if profile in LISTED else t.whole("data_id", 0, 0xFFFF),
        data_ids=ids,
        ignore=(),
    )
    t.close()
    return made


def _place(t: Table, key: str, message: Any, length: int, boundary: int, where: str) -> int | None:
    """First bit, Intel numbering, of a field of the protection that a signal names."""
    if key not in t:
        return None
    name = t.text(key)
    signal = _found(name, message.signals)
    if signal is None:
        raise t.error(key, f"message '{message.name}' has no signal '{name}'{_nearest(name, [s.name for s in message.signals])}")
    motorola = signal.byte_order == "big_endian"
    field = Field(signal.name, signal.start, signal.length, motorola, False, False, 1, 0, None, None)
    first = field.bits[0]
    if signal.length != length or first % boundary:
        raise t.error(key, f"'{signal.name}' has {signal.length} bits from bit {first} on; it must have {length} and begin at a multiple of {boundary}")
    if motorola and length > 8:
        raise t.error(key, f"'{signal.name}' is big-endian (Motorola); profile 05 sends the low byte of its checksum first")
    return first
