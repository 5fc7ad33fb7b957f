"""candump -L logs: (seconds.microseconds) channel ID#DATA, FD as ID##FLAGS DATA, R or T behind it where the direction is known.

Written as can-utils write them, error frames intact.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from hullguard.core.native import Frame
from hullguard.errors import InputError

EXTENDED, REMOTE, FD, BRS, ERROR = 0x01, 0x02, 0x04, 0x08, 0x10
_ERROR_BIT = 0x20000000
_BRS, _ESI = 1, 2  # of the digit behind ##
HEX = tuple("0123456789abcdefABCDEF")
DIGITS = ("", *"012345678")
_LINE = re.compile(r"^\((?P<time>\d+\.\d{1,9})\)\s+(?P<channel>\S+)\s+(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?P<rest>[#0-9A-Fa-fR]*)(\s+(?P<direction>[RT]))?\s*$")


@dataclass(frozen=True)
class Entry:
    """One line of a log: a frame, and what only a recording knows of it."""

    time_s: float
    channel: str
    frame: Frame
    direction: str = ""  # R received, T sent
    asked: int = 0  # data length that a remote frame asks for, bytes
    passive: bool = False  # sent by an error-passive FD controller (ESI)


def line(time_s: float, channel: str, frame: Frame) -> str:
    """One frame as candump -L writes it."""
    return text(Entry(time_s, channel, frame))


def text(entry: Entry) -> str:
    """One line as candump -L, or with a direction candump -L -x, writes it."""
    frame = entry.frame
    wide = frame.flags & (EXTENDED | ERROR)
    number = frame.id | (_ERROR_BIT if frame.flags & ERROR else 0)
    name = f"{number:08X}" if wide else f"{number:03X}"
    data = frame.data.hex().upper()
    if frame.flags & FD:
        data = f"#{(_BRS if frame.flags & BRS else 0) | (_ESI if entry.passive else 0)}{data}"
    elif frame.flags & REMOTE:
        data = f"R{entry.asked or ''}"
    return f"({entry.time_s:017.6f}) {entry.channel} {name}#{data}" + (f" {entry.direction}" if entry.direction else "")


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


def write(path: Path, entries: Iterable[Entry]) -> None:
    """A whole log at once."""
    with path.open("w", encoding="ascii") as file:
        file.writelines(text(e) + "\n" for e in entries)


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
    number, rest, passive = int(found["id"], 16), found["rest"], False
    flags = EXTENDED if len(found["id"]) == 8 else 0
    if flags and number & _ERROR_BIT:
        flags, number = ERROR, number & ~_ERROR_BIT
    if rest.startswith("#"):
        if rest[1:2] not in HEX:
            raise InputError(f"{where}: '##' without the digit of FD flags")
        flags |= FD | (BRS if int(rest[1], 16) & _BRS else 0)
        passive = bool(int(rest[1], 16) & _ESI)
        rest = rest[2:]
    elif rest.startswith("R"):
        if len(rest) > 2 or rest[1:] not in DIGITS:
            raise InputError(f"{where}: a remote frame is R and the length it asks for, 0 .. 8, not '{rest[:40]}'")
        return Entry(float(found["time"]), found["channel"], Frame(number, flags | REMOTE, b""), found["direction"] or "", int(rest[1:] or "0"))
    if len(rest) % 2 or "R" in rest or "#" in rest:
        raise InputError(f"{where}: data '{rest[:40]}' is not whole bytes")
    if len(rest) > 2 * (64 if flags & FD else 8):
        raise InputError(f"{where}: {len(rest) // 2} bytes of data, more than a frame of this kind has")
    return Entry(float(found["time"]), found["channel"], Frame(number, flags, bytes.fromhex(rest)), found["direction"] or "", 0, passive)
