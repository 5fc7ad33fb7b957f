"""NAME.dbc: the model's frames for every other CAN tool.

Written as text, so that the bytes depend on the model alone. A signal's factor is the table's float32 resolution in its shortest decimal
form (0.001, not 0.0010000000474974513): a raw value is the library's code either way, and people read these files.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from hullguard.codegen.c import Named
from hullguard.codegen.names import Names, names_of, unit_of
from hullguard.design.design import Design
from hullguard.design.protection import MODES, NO_STAMP, NONE, PROFILES, ProtectionTable
from hullguard.design.tables import BRS, EXTENDED, FD, FLOAT32, MOTOROLA, NARROW_FAULTS, SIGNED, GroupTable, MessageTable, SignalTable
from hullguard.errors import InputError

NAME_MAX = 32  # characters of a symbol in a DBC
DETECTOR = "detector"
TESTER = "tester"
NOBODY = "Vector__XXX"
SEND_TYPES = ("Cyclic", "Event", "NoMsgSendType")
FRAME_FORMATS = ("StandardCAN", "ExtendedCAN", *(f"reserved{i}" for i in range(2, 14)), "StandardCAN_FD", "ExtendedCAN_FD")
PROTECTIONS = tuple("None" if p == NONE else p for p in PROFILES)
CRC_ABOUT = {
    "P01": "CRC-8 (SAE J1850) over the data identifier and all other bytes",
    "P02": "CRC-8H2F over all other bytes and the data identifier of the counter's value",
    "P05": "CRC-16 (CCITT) over all other bytes and the data identifier, low byte first",
    "P11": "CRC-8 (SAE J1850) over the data identifier and all other bytes",
    "P22": "CRC-8H2F over bytes 1 .. end and the data identifier of the counter's value",
}

PLANT = {0: "starting", 1: "none", 2: "provisional", 3: "confirmed"}
BASIS = {0: "unset", 1: "set", 2: "statistical"}
BUS = {0: "absent", 1: "good", 2: "lossy", 3: "stale"}
FLAG = {0: "no", 1: "yes"}
FAULT = {0: "no", 1: "candidate"}

# Keywords that a reader may meet; some tools refuse a file without the list.
SYMBOLS = """
    NS_DESC_ CM_ BA_DEF_ BA_ VAL_ CAT_DEF_ CAT_ FILTER BA_DEF_DEF_ EV_DATA_ ENVVAR_DATA_ SGTYPE_ SGTYPE_VAL_ BA_DEF_SGTYPE_ BA_SGTYPE_
    SIG_TYPE_REF_ VAL_TABLE_ SIG_GROUP_ SIG_VALTYPE_ SIGTYPE_VALTYPE_ BO_TX_BU_ BA_DEF_REL_ BA_REL_ BA_DEF_DEF_REL_ BU_SG_REL_ BU_EV_REL_
    BU_BO_REL_ SG_MUL_VAL_
"""


@dataclass(frozen=True)
class Entry:
    """One signal of a message, in DBC terms."""

    name: str
    start: int
    length: int
    factor: float = 1
    offset: float = 0
    low: float = 0
    high: float = 0
    unit: str = ""
    motorola: bool = False
    is_signed: bool = False
    is_float: bool = False
    values: dict[int, str] = field(default_factory=dict)
    about: str = ""


@dataclass(frozen=True)
class Message:
    """One frame, in DBC terms."""

    table: MessageTable
    name: str
    sender: str
    receivers: tuple[str, ...]
    entries: tuple[Entry, ...]
    send_type: str
    cycle_ms: int
    about: str

    @property
    def id(self) -> int:
        """Identifier with the bit that a DBC marks extended ones by."""
        return self.table.id | (0x80000000 if self.table.flags & EXTENDED else 0)


def short(x: float) -> float:
    """The number with the fewest digits that is the same in float32."""
    return float(np.format_float_scientific(np.float32(x), unique=True))


def number(x: float) -> str:
    """A number as a DBC has it, exact."""
    return str(int(x)) if float(x).is_integer() and abs(x) < 1e15 else repr(float(x))


def quoted(text: str) -> str:
    """A DBC string; it has no escapes."""
    return '"' + text.replace('"', "'").encode("ascii", "replace").decode() + '"'


def _symbol(name: str) -> str:
    if len(name) > NAME_MAX:
        raise InputError(f"'{name}' has {len(name)} characters; a DBC allows {NAME_MAX}: choose a shorter name")
    return name


def _header(p: ProtectionTable, about_stamp: str) -> tuple[Entry, ...]:
    """The fields of a message's protection."""
    about = {
        "crc": ("E2E_CRC", CRC_ABOUT.get(p.profile, "")),
        "counter": ("E2E_counter", "Sequence counter of this message's frames"),
        "nibble": ("E2E_data_id", f"Bits 11 .. 8 of the data identifier: {p.data_id >> 8}"),
        "stamp": ("E2E_stamp", about_stamp),
    }
    return tuple(Entry(about[what][0], first, bits, high=(1 << bits) - 1, about=about[what][1]) for what, (first, bits) in p.places.items())


def _entry(s: SignalTable, name: str) -> Entry:
    is_signed, is_float, offset = bool(s.flags & SIGNED), bool(s.flags & FLOAT32), short(s.offset)
    factor = short(s.resolution)
    low, high = s.minimum * factor + offset, s.maximum * factor + offset
    invalid = -(1 << (s.length - 1)) if is_signed else (1 << s.length) - 1
    return Entry(
        name=_symbol(name),
        start=s.start,
        length=s.length,
        factor=1 if is_float else factor,
        offset=0 if is_float else offset,
        low=low,
        high=high,
        unit=unit_of(s.name),
        motorola=bool(s.flags & MOTOROLA),
        is_signed=is_signed or is_float,
        is_float=is_float,
        values={} if is_float else {invalid: "invalid"},
        about=f"NaN: no value; the receiver rounds to multiples of {number(factor)}" if is_float else f"Raw value {invalid}: no value",
    )


def _cycle_ms(design: Design, samples: int) -> int:
    return max(round(samples * design.model.sample_time_s * 1000), 1)


def _group_about(g: GroupTable, closes: bool) -> str:
    if closes:
        return "Sent with every sample, after all others of the sample: it closes the sample."
    if g.interval_max == 1:
        return "Sent with every sample."
    if g.periodic:
        return f"Sent every {g.interval_max} samples."
    return f"Sent when a value has moved far enough, at least every {g.interval_max} samples; silence is information."


def _group(design: Design, place: int, names: Names) -> Message:
    g, n = design.tables.groups[place], names.groups[place]
    signals = names.signals[sum(len(e.signals) for e in design.tables.groups[:place]) :]
    entries = [_entry(s, name) for s, name in zip(g.signals, signals, strict=False)]
    return Message(
        table=g.message,
        name=_symbol(n),
        sender=_sender(n),
        receivers=(DETECTOR,),
        entries=(*_header(g.message.protection, "Sample index modulo 16 that the frame belongs to"), *entries),
        send_type="Cyclic" if g.periodic else "Event",
        cycle_ms=_cycle_ms(design, g.interval_max),
        about=_group_about(g, place == design.tables.closing),
    )


def _sender(group: str) -> str:
    return _symbol(f"{group}_sender")


def _numbered(prefix: str, name: str, place: int) -> str:
    """prefix_name, or with its number where that is too long."""
    whole = f"{prefix}_{name}"
    return whole if len(whole) <= NAME_MAX else f"{prefix}{place}_{name}"[:NAME_MAX]


def _verdict(design: Design, names: Names, senders: tuple[str, ...]) -> Message:
    entries = [
        Entry("plant", 16, 2, high=3, values=PLANT, about="State of the plant"),
        Entry("basis", 18, 2, high=3, values=BASIS, about="What the verdict rests on: bounds or probabilities"),
        Entry("reply", 20, 1, high=1, values=FLAG, about="Sent only to answer a tick in lockstep"),
        Entry("refused", 21, 1, high=1, values=FLAG, about="A number has been refused since the start"),
    ]
    for i, fault in enumerate(design.model.faults):
        about = f"Can {fault.name} ({fault.type} of {design.model.signals[fault.signal].name}) explain the alarm?"
        place = 24 + i if i < NARROW_FAULTS else 64 + i - NARROW_FAULTS
        entries.append(Entry(_numbered("fault", names.faults[i], i), place, 1, high=1, values=FAULT, about=about))
    for i, group in enumerate(names.groups):
        entries.append(Entry(_numbered("bus", group, i), 40 + 2 * i, 2, high=3, values=BUS, about=f"Health of the link from group {group}"))
    about = "Bits 11 .. 4 of the sample index; with the stamp, the index modulo 4096"
    entries.append(Entry("sample_high", 56, 8, factor=16, high=16 * 255, about=about))
    return Message(
        table=design.tables.verdict,
        name=design.tables.verdict.name,
        sender=DETECTOR,
        receivers=senders,
        entries=(*_header(design.tables.verdict.protection, "Low 4 bits of the sample index that the verdict speaks of"), *entries),
        send_type="Event",
        cycle_ms=_cycle_ms(design, design.tables.heartbeat),
        about="Sent when the verdict changes, and as a heartbeat.",
    )


def _status(design: Design, senders: tuple[str, ...]) -> Message:
    entries = (
        Entry("model_hash", 16, 32, high=2**32 - 1, about=f"Of the detector's tables; of this file: {design.tables.hash}"),
        Entry("frames_lost", 48, 8, high=255, about="Frames lost by the sequence counters since the start, saturated"),
        Entry("frames_refused", 56, 8, high=255, about="Frames damaged, malformed, early, late or out of range since the start, saturated"),
    )
    return Message(
        table=design.tables.status,
        name=design.tables.status.name,
        sender=DETECTOR,
        receivers=senders,
        entries=(*_header(design.tables.status.protection, "Low 4 bits of the sample index"), *entries),
        send_type="Cyclic",
        cycle_ms=_cycle_ms(design, design.tables.heartbeat),
        about="Sent with every heartbeat of the verdict.",
    )


def _freeze(design: Design) -> tuple[Message, ...]:
    """Requests for the freeze frame, and what answers them (hullguard/freeze.h)."""
    table = design.tables.freeze
    if table is None:
        return ()
    asked = (
        Entry("command", 16, 8, high=255, values={1: "state", 2: "read", 3: "clear"}, about="What is asked for"),
        Entry("record", 24, 8, high=255, about="Number of the record that is read or cleared"),
        Entry("first_word", 32, 16, high=2**16 - 1, about="Place of the first word that is read"),
        Entry("words", 48, 16, high=2**16 - 1, about="How many words, 0: to the last"),
    )
    told = (
        Entry("place", 16, 16, high=2**16 - 1, about="Of the word; 65535: the state"),
        Entry("word", 32, 32, high=2**32 - 1, about="Of the record; or state in bits 1:0, alarms not recorded in 7:2, record in 15:8, words in 31:16"),
    )
    stamp = "Low 4 bits of the sample index; of a request it is not looked at"
    request = Message(table.request, table.request.name, TESTER, (DETECTOR,), (*_header(table.request.protection, stamp), *asked), "Event", 0, "Asks for the freeze frame.")
    about = "Answers a request for the freeze frame, a few words a sample."
    return request, Message(table.response, table.response.name, DETECTOR, (TESTER,), (*_header(table.response.protection, stamp), *told), "Event", 0, about)


def messages_of(design: Design) -> tuple[Message, ...]:
    """All frames of a model: the groups', the verdict, the status, those of the freeze frame."""
    names = names_of(design)
    senders = tuple(_sender(n) for n in names.groups)
    groups = tuple(_group(design, i, names) for i in range(len(names.groups)))
    made = (*groups, _verdict(design, names, senders), _status(design, senders), *_freeze(design))
    for m in made:
        taken = [e.name for e in m.entries]
        twice = sorted({n for n in taken if taken.count(n) > 1})
        if twice:
            raise InputError(f"message '{m.name}': two signals would be called '{twice[0]}' in the DBC; rename a fault or a group")
    return made


# --- text ------------------------------------------------------------------------------------------------------------------------------


def _message_lines(m: Message) -> list[str]:
    lines = [f"BO_ {m.id} {m.name}: {m.table.length} {m.sender}"]
    for e in m.entries:
        place = f"{e.start}|{e.length}@{0 if e.motorola else 1}{'-' if e.is_signed else '+'}"
        scale = f"({number(e.factor)},{number(e.offset)}) [{number(e.low)}|{number(e.high)}]"
        lines.append(f" SG_ {e.name} : {place} {scale} {quoted(e.unit)} {','.join(m.receivers) or NOBODY}")
    return [*lines, ""]


def _comments(design: Named, made: Sequence[Message]) -> list[str]:
    name, hash_ = design.tables.name, design.tables.hash
    about = f"Model {name}: generated by hullguard design from {name}.toml and {name}.design.toml; do not edit."
    lines = [f"CM_ {quoted(f'{about} Model SHA-256 {design.model.sha256}, model hash 0x{hash_:08X}.')};"]
    lines += [f"CM_ BU_ {m.sender} {quoted('Sends ' + m.name)};" for m in made if m.sender != DETECTOR]
    lines.append(f"CM_ BU_ {DETECTOR} {quoted('Finds faults from what the others send')};")
    for m in made:
        lines.append(f"CM_ BO_ {m.id} {quoted(m.about)};")
        lines += [f"CM_ SG_ {m.id} {e.name} {quoted(e.about)};" for e in m.entries if e.about]
    return lines


def _enumeration(names: Iterable[str]) -> str:
    return "ENUM " + ",".join(quoted(n) for n in names)


def _attribute_definitions(any_fd: bool) -> list[str]:
    fast = ['BA_DEF_ "BaudrateCANFD" INT 0 20000000;', 'BA_DEF_DEF_ "BaudrateCANFD" 0;'] if any_fd else []
    return [
        'BA_DEF_ "BusType" STRING ;',
        'BA_DEF_ "Baudrate" INT 0 8000000;',
        'BA_DEF_ "HullguardModel" STRING ;',
        'BA_DEF_ "HullguardModelSha256" STRING ;',
        'BA_DEF_ "HullguardModelHash" STRING ;',
        'BA_DEF_ "HullguardSampleTime_s" FLOAT 0 3600;',
        f'BA_DEF_ BO_ "GenMsgSendType" {_enumeration(SEND_TYPES)};',
        'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 2147483647;',
        f'BA_DEF_ BO_ "VFrameFormat" {_enumeration(FRAME_FORMATS)};',
        f'BA_DEF_ BO_ "CANFD_BRS" {_enumeration(("0", "1"))};',
        f'BA_DEF_ BO_ "E2EProfile" {_enumeration(PROTECTIONS)};',
        'BA_DEF_ BO_ "E2EDataIdList" STRING ;',
        'BA_DEF_ BO_ "E2EDataId" INT 0 65535;',
        f'BA_DEF_ BO_ "E2EDataIdMode" {_enumeration(MODES)};',
        'BA_DEF_ BO_ "E2ECrcByte" INT 0 63;',
        'BA_DEF_ BO_ "E2ECounterBit" INT 0 511;',
        'BA_DEF_ BO_ "E2ENibbleBit" INT 0 511;',
        'BA_DEF_ BO_ "E2EStampBit" INT -1 511;',
        *fast[:1],
        'BA_DEF_DEF_ "BusType" "CAN";',
        'BA_DEF_DEF_ "Baudrate" 500000;',
        *fast[1:],
        'BA_DEF_DEF_ "HullguardModel" "";',
        'BA_DEF_DEF_ "HullguardModelSha256" "";',
        'BA_DEF_DEF_ "HullguardModelHash" "";',
        'BA_DEF_DEF_ "HullguardSampleTime_s" 0;',
        'BA_DEF_DEF_ "GenMsgSendType" "NoMsgSendType";',
        'BA_DEF_DEF_ "GenMsgCycleTime" 0;',
        'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";',
        'BA_DEF_DEF_ "CANFD_BRS" "0";',
        'BA_DEF_DEF_ "E2EProfile" "None";',
        'BA_DEF_DEF_ "E2EDataIdList" "";',
        'BA_DEF_DEF_ "E2EDataId" 0;',
        f'BA_DEF_DEF_ "E2EDataIdMode" {quoted(MODES[0])};',
        'BA_DEF_DEF_ "E2ECrcByte" 0;',
        'BA_DEF_DEF_ "E2ECounterBit" 8;',
        'BA_DEF_DEF_ "E2ENibbleBit" 0;',
        'BA_DEF_DEF_ "E2EStampBit" -1;',
    ]


def _attributes(design: Named, made: Sequence[Message]) -> list[str]:
    tables, model = design.tables, design.model
    any_fd = any(m.table.flags & FD for m in made)
    lines = [
        f'BA_ "BusType" {quoted("CAN FD" if any_fd else "CAN")};',
        f'BA_ "Baudrate" {model.bitrate_bps};',
        *([f'BA_ "BaudrateCANFD" {model.data_bitrate_bps};'] if any_fd else []),
        f'BA_ "HullguardModel" {quoted(tables.name)};',
        f'BA_ "HullguardModelSha256" {quoted(model.sha256)};',
        f'BA_ "HullguardModelHash" "0x{tables.hash:08X}";',
        f'BA_ "HullguardSampleTime_s" {number(model.sample_time_s)};',
    ]
    for m in made:
        format_ = (14 if m.table.flags & FD else 0) + (1 if m.table.flags & EXTENDED else 0)
        lines += [
            f'BA_ "GenMsgSendType" BO_ {m.id} {SEND_TYPES.index(m.send_type)};',
            f'BA_ "GenMsgCycleTime" BO_ {m.id} {m.cycle_ms};',
            f'BA_ "VFrameFormat" BO_ {m.id} {format_};',
            f'BA_ "CANFD_BRS" BO_ {m.id} {1 if m.table.flags & BRS else 0};',
            *_protection(m),
        ]
    return lines


def _protection(m: Message) -> list[str]:
    """All that model/network.py needs to read the protection back."""
    p = m.table.protection
    return [
        f'BA_ "E2EProfile" BO_ {m.id} {PROFILES.index(p.profile)};',
        f'BA_ "E2EDataIdList" BO_ {m.id} {quoted(" ".join(f"{i:02X}" for i in p.data_ids))};',
        f'BA_ "E2EDataId" BO_ {m.id} {p.data_id};',
        f'BA_ "E2EDataIdMode" BO_ {m.id} {MODES.index(p.mode)};',
        f'BA_ "E2ECrcByte" BO_ {m.id} {p.crc};',
        f'BA_ "E2ECounterBit" BO_ {m.id} {p.counter};',
        f'BA_ "E2ENibbleBit" BO_ {m.id} {p.nibble};',
        f'BA_ "E2EStampBit" BO_ {m.id} {-1 if p.stamp == NO_STAMP else p.stamp};',
    ]


def emit_dbc(design: Design) -> str:
    """Text of NAME.dbc."""
    return dbc_text(design, messages_of(design))


def dbc_text(design: Named, made: Sequence[Message]) -> str:
    """A DBC of these frames."""
    senders = list(dict.fromkeys(m.sender for m in made))
    lines = ['VERSION ""', "", "NS_ :", *(f"\t{s}" for s in SYMBOLS.split()), "", "BS_:", "", "BU_: " + " ".join(senders), ""]
    for m in made:
        lines += _message_lines(m)
    lines += ["", *_comments(design, made), *_attribute_definitions(any(m.table.flags & FD for m in made)), *_attributes(design, made)]
    for m in made:
        for e in m.entries:
            if e.values:
                pairs = " ".join(f"{value} {quoted(label)}" for value, label in sorted(e.values.items(), reverse=True))
                lines.append(f"VAL_ {m.id} {e.name} {pairs} ;")
    for m in made:
        lines += [f"SIG_VALTYPE_ {m.id} {e.name} : 1;" for e in m.entries if e.is_float]
    return "\n".join([*lines, ""])
