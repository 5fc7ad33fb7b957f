"""candump -L logs: (seconds.microseconds) channel ID#DATA, FD as ID##FLAGS DATA. Written as can-utils write them, error frames intact."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from hullguard.core.native import Frame
from hullguard.errors import InputError

EXTENDED, REMOTE, FD, BRS, ERROR = 0x01, 0x02, 0x04, 0x08, 0x10
_ERROR_BIT = 0x20000000
HEX = tuple("0123456789abcdefABCDEF")
_LINE = re.compile(r"^\((?P<time>\d+\.\d{1,9})\)\s+(?P<channel>\S+)\s+(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?P<rest>[#0-9A-Fa-fR]*)(\s+[RT])?\s*$")


@dataclass(frozen=True)
class Entry:
    """One line of a log."""

    time_s: float
    channel: str
    frame: Frame


def line(time_s: float, channel: str, frame: Frame) -> str:
    """One frame as candump -L writes it."""
    wide = frame.flags & (EXTENDED | ERROR)
    number = frame.id | (_ERROR_BIT if frame.flags & ERROR else 0)
    name = f"{number:08X}" if wide else f"{number:03X}"
    data = frame.data.hex().upper()
    if frame.flags & FD:
        return f"({time_s:017.6f}) {channel} {name}##{1 if frame.flags & BRS else 0}{data}"
    return f"({time_s:017.6f}) {channel} {name}#{'R' if frame.flags & REMOTE else data}"


class Writer:
    """Writes a log as frames come."""

    def __init__(self, path: Path, channel: str) -> None:
        self._file: TextIO = path.open("w", encoding="ascii")
        self._channel = channel

    def write(self, time_s: float, frame: Frame) -> None:
        """Add one frame."""
        self._file.write(line(time_s, self._channel, frame) + "\n")

    def close(self) -> None:
        """Finish the file."""
        self._file.close()


def read(path: Path) -> Iterator[Entry]:
    """The frames of a log; a line that is none is refused with its number."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a readable candump log ({error})") from error
    for number, raw in enumerate(text.splitlines(), 1):
        if raw.strip():
            yield _entry(raw, f"{path.name}:{number}")


def frame_of(text: str, where: str) -> Frame:
    """A frame without time and channel, such as 110#AABB; `where` names it in errors."""
    return _entry(f"(0.0) - {text}", where).frame


def _entry(raw: str, where: str) -> Entry:
    found = _LINE.match(raw)
    if not found:
        raise InputError(f"{where}: not a candump -L line: '{raw[:60]}'")
    number, rest = int(found["id"], 16), found["rest"]
    flags = EXTENDED if len(found["id"]) == 8 else 0
    if flags and number & _ERROR_BIT:
        flags, number = ERROR, number & ~_ERROR_BIT
    if rest.startswith("#"):
        if rest[1:2] not in HEX:
            raise InputError(f"{where}: '##' without the digit of FD flags")
        flags |= FD | (BRS if int(rest[1], 16) & 1 else 0)
        rest = rest[2:]
    elif rest.startswith("R"):
        return Entry(float(found["time"]), found["channel"], Frame(number, flags | REMOTE, b""))
    if len(rest) % 2 or "R" in rest or "#" in rest:
        raise InputError(f"{where}: data '{rest[:40]}' is not whole bytes")
    if len(rest) > 2 * (64 if flags & FD else 8):
        raise InputError(f"{where}: {len(rest) // 2} bytes of data, more than a frame of this kind has")
    return Entry(float(found["time"]), found["channel"], Frame(number, flags, bytes.fromhex(rest)))
