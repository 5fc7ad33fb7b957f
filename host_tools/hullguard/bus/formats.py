"""Files of CAN frames by their suffix: candump log, pcap and pcapng of our own, BLF and ASC by python-can, MF4 by asammdf.

Every format is read into the same entries. What a format has no room for is told before it is written, never dropped in silence.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import can

from hullguard.bus import candump, lean, mf4, pcap
from hullguard.bus.candump import ERROR, REMOTE, Entry
from hullguard.bus.link import from_message, to_message
from hullguard.errors import InputError
from hullguard.files import is_file

BLF_HEADER = struct.Struct("<4sHHLL")  # of an object: signature, length and version of the header, length of the object with it, kind
FIRST_DATE_S = 631152000.0  # 1990: BLF and ASC keep the date of their first frame, and take an earlier one for none


@dataclass(frozen=True)
class Format:
    """How a file is read and written, and what of an entry it keeps."""

    read: Callable[[Path], Iterator[Entry]]
    write: Callable[[Path, Sequence[Entry]], None]
    names: bool = True  # of the channels; False: numbers
    direction: bool = True
    errors: bool = True  # class and data of error frames
    sent_errors: bool = True  # direction of error frames


# ---- python-can ----


def to_numbered(entry: Entry, channel: int) -> can.Message:
    """An entry as python-can has it, the channel as a number."""
    message = to_message(entry.frame)
    message.timestamp, message.channel, message.is_rx = entry.time_s, channel, entry.direction != "T"
    message.error_state_indicator = entry.passive
    if entry.frame.flags & REMOTE:
        message.dlc = entry.asked
    return message


def from_numbered(message: can.Message) -> Entry:
    """The other way round."""
    if message.is_fd and message.is_remote_frame:
        message.is_remote_frame = False  # there are none: python-can reads an empty FD frame of an ASC file as one
        message.dlc = 0
    frame = from_message(message)
    channel = message.channel if isinstance(message.channel, int) else 0
    remote = bool(frame.flags & REMOTE)
    time_s = round(message.timestamp, 6)  # sums of a date and an offset: off by less than a microsecond, which is what there is
    return Entry(time_s, f"can{channel}", frame, "R" if message.is_rx else "T", message.dlc if remote else 0, message.error_state_indicator)


def numbers(entries: Iterable[Entry]) -> dict[str, int]:
    """A number for each channel: that at the end of its name, or the next free one."""
    found: dict[str, int] = {}
    for name in dict.fromkeys(e.channel for e in entries):
        digits = name[len(name.rstrip("0123456789")) :]
        wanted = int(digits) if digits and len(digits) < 4 else 0
        while wanted in found.values():
            wanted += 1
        found[name] = wanted
    return found


class _BlfReader(can.BLFReader):
    """python-can's goes to the next object by the length that the file says: by none it would read the same one for ever."""

    def _parse_data(self, data: bytes) -> Iterator[can.Message]:
        at = data.find(b"LOBJ", 0, 8)
        while 0 <= at <= len(data) - BLF_HEADER.size:
            size = BLF_HEADER.unpack_from(data, at)[3]
            if size < BLF_HEADER.size:
                raise ValueError(f"an object of {size} bytes")
            at = data.find(b"LOBJ", at + size, at + size + 8)
        yield from super()._parse_data(data)


def _read_blf(path: Path) -> Iterator[Entry]:
    with _BlfReader(path) as reader:
        yield from map(from_numbered, reader)


def _write_blf(path: Path, entries: Sequence[Entry]) -> None:
    channel = numbers(entries)
    with can.BLFWriter(path) as writer:
        # Without it the first frame would be time 0, also where a log's clock is not the calendar and the date is not kept.
        writer.start_timestamp = _start(entries)
        for e in entries:
            writer(to_numbered(e, channel[e.channel]))


def _start(entries: Sequence[Entry]) -> float:
    """Begin of a recording, the date in its header. Whole seconds: python-can writes 59 ms as .59."""
    first = min((e.time_s for e in entries), default=0.0)
    return float(math.floor(first)) if first >= FIRST_DATE_S else 0.0


def _read_asc(path: Path) -> Iterator[Entry]:
    with can.ASCReader(path, relative_timestamp=False) as reader:
        yield from map(from_numbered, reader)


def _write_asc(path: Path, entries: Sequence[Entry]) -> None:
    channel = numbers(entries)
    with can.ASCWriter(path) as writer:
        writer.log_event("Start of measurement", _start(entries))  # its header has the date of the first line
        for e in entries:
            writer(to_numbered(e, channel[e.channel]))


def _read_mf4(path: Path) -> Iterator[Entry]:
    mf4.package()
    with lean.mf4().MF4Reader(path) as reader:
        yield from map(from_numbered, reader)


def _write_mf4(path: Path, entries: Sequence[Entry]) -> None:
    mf4.write(path, entries, numbers(entries), _start(entries))


FORMATS = {
    ".log": Format(candump.read, candump.write),
    ".pcapng": Format(pcap.read, pcap.write_pcapng),
    ".pcap": Format(pcap.read, pcap.write_pcap, names=False, direction=False),
    ".blf": Format(_read_blf, _write_blf, names=False, sent_errors=False),
    ".mf4": Format(_read_mf4, _write_mf4, names=False),
    ".asc": Format(_read_asc, _write_asc, names=False, errors=False),
}


# ---- by suffix ----


def of(path: Path) -> Format:
    """The format of a file by its name."""
    found = FORMATS.get(path.suffix.lower())
    if found is None:
        raise InputError(f"{path}: no format has the suffix '{path.suffix}'; name it one of {', '.join(FORMATS)}")
    return found


def read(path: Path) -> Iterator[Entry]:
    """The frames of a file, in its order."""
    made = of(path)
    if not is_file(path):
        raise InputError(f"{path}: no such file")
    try:
        yield from made.read(path)
    except InputError:
        raise
    except Exception as error:  # what python-can and asammdf raise for a damaged file is of any class
        raise InputError(f"{path}: not a readable {path.suffix[1:].upper()} file ({type(error).__name__}: {error})") from error


def losses(path: Path, entries: Sequence[Entry]) -> list[str]:
    """What a file with this suffix cannot keep of these frames, a line each."""
    made, kind, told = of(path), path.suffix[1:].lower(), []
    if not made.names:
        own = numbers(entries) if kind != "pcap" else dict.fromkeys(dict.fromkeys(e.channel for e in entries), 0)
        changed = [f"{name} becomes can{number}" for name, number in own.items() if name != f"can{number}"]
        if changed:
            told.append(f"{kind} has no names of channels: {', '.join(changed)}; log and pcapng keep them")
    if not made.direction and any(e.direction for e in entries):
        told.append(f"{kind} does not tell frames received from frames sent; log and pcapng do")
    if not made.sent_errors and any(e.frame.flags & ERROR and e.direction == "T" for e in entries):
        told.append(f"{kind} takes every error frame for a received one; log, pcapng and mf4 do not")
    errors = sum(bool(e.frame.flags & ERROR) for e in entries)
    if not made.errors and errors:
        told.append(f"{kind} keeps no class and data of error frames ({errors} here); log, pcap, blf and mf4 do")
    return told


def write(path: Path, entries: Sequence[Entry]) -> list[str]:
    """Write frames; what the file could not keep, a line each."""
    made = of(path)
    try:
        made.write(path, entries)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from error
    except (struct.error, OverflowError, ValueError) as error:
        last = max((e.time_s for e in entries), default=0.0)
        raise InputError(f"{path}: {path.suffix[1:].lower()} cannot hold these frames, whose last is of {last:.0f} s ({error}); write a log or pcapng") from error
    return losses(path, entries)
