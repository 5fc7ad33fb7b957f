"""Captures for Wireshark, tshark and tcpdump: pcap and pcapng, read and written without a library.

Written is what the kernel gives a capture of a CAN interface: whole struct can_frame and struct canfd_frame, LINKTYPE_CAN_SOCKETCAN, identifier
in network byte order. Read are these, and the cooked captures of `-i any` (LINKTYPE_LINUX_SLL and SLL2), where it has the order of the host.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from hullguard.bus.candump import BRS, ERROR, EXTENDED, FD, REMOTE, Entry
from hullguard.core.native import Frame
from hullguard.errors import InputError

SOCKETCAN, COOKED, COOKED_2 = 227, 113, 276
_EXTENDED_BIT, _REMOTE_BIT, _ERROR_BIT, _ID = 0x80000000, 0x40000000, 0x20000000, 0x1FFFFFFF
_BRS, _ESI, _FDF = 1, 2, 4  # of struct canfd_frame
_CLASSIC_SIZE, _FD_SIZE, _HEADER = 16, 72, 8
_ETH_CAN, _ETH_CANFD = 0x000C, 0x000D
_OUTGOING = 4  # packet type of a cooked capture
_SNAP = 65535
# pcapng
_SECTION, _INTERFACE, _PACKET, _SIMPLE = 0x0A0D0D0A, 1, 6, 3
_ORDER_MAGIC = 0x1A2B3C4D
_IF_NAME, _IF_TSRESOL, _IF_TSOFFSET, _EPB_FLAGS = 2, 9, 14, 2
_DIRECTIONS = {1: "R", 2: "T"}
_CLASSIC_MAGIC = {0xA1B2C3D4: 1_000_000, 0xA1B23C4D: 1_000_000_000}


@dataclass(frozen=True)
class _Interface:
    """Where packets of a capture come from."""

    link: int
    name: str
    per_s: int
    offset_s: int = 0


# ---- writing ----


def _packet(entry: Entry) -> bytes:
    """The C structure can_frame or canfd_frame, the identifier big-endian."""
    frame = entry.frame
    number = frame.id | (_EXTENDED_BIT if frame.flags & EXTENDED else 0) | (_REMOTE_BIT if frame.flags & REMOTE else 0) | (_ERROR_BIT if frame.flags & ERROR else 0)
    flags = 0
    if frame.flags & FD:
        flags = _FDF | (_BRS if frame.flags & BRS else 0) | (_ESI if entry.passive else 0)
    length = entry.asked if frame.flags & REMOTE else len(frame.data)
    size = _FD_SIZE if frame.flags & FD else _CLASSIC_SIZE
    return struct.pack(">IBBH", number, length, flags, 0) + frame.data.ljust(size - _HEADER, b"\0")


def write_pcap(path: Path, entries: Iterable[Entry]) -> None:
    """A pcap file, microseconds. It has no room for channel and direction."""
    with path.open("wb") as file:
        file.write(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, _SNAP, SOCKETCAN))
        for e in entries:
            packet, at = _packet(e), round(e.time_s * 1_000_000)
            file.write(struct.pack("<IIII", at // 1_000_000, at % 1_000_000, len(packet), len(packet)) + packet)


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def _block(kind: int, body: bytes) -> bytes:
    size = struct.pack("<I", len(body) + 12)
    return struct.pack("<I", kind) + size + body + size


def _option(code: int, value: bytes) -> bytes:
    return struct.pack("<HH", code, len(value)) + _padded(value)


def write_pcapng(path: Path, entries: Iterable[Entry]) -> None:
    """A pcapng file, microseconds: an interface for each channel, directions where they are known."""
    known: dict[str, int] = {}
    with path.open("wb") as file:
        file.write(_block(_SECTION, struct.pack("<IHHq", _ORDER_MAGIC, 1, 0, -1)))
        for e in entries:
            if e.channel not in known:
                known[e.channel] = len(known)
                file.write(_block(_INTERFACE, struct.pack("<HHI", SOCKETCAN, 0, _SNAP) + _option(_IF_NAME, e.channel.encode()) + _option(0, b"")))
            packet, at = _packet(e), round(e.time_s * 1_000_000)
            body = struct.pack("<IIIII", known[e.channel], at >> 32, at & 0xFFFFFFFF, len(packet), len(packet)) + _padded(packet)
            if e.direction:
                body += _option(_EPB_FLAGS, struct.pack("<I", 1 if e.direction == "R" else 2)) + _option(0, b"")
            file.write(_block(_PACKET, body))


# ---- reading ----


def read(path: Path) -> Iterator[Entry]:
    """The frames of a pcap or pcapng file; packets that are no CAN frames are passed over in cooked captures and refused elsewhere."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    if not data:
        raise InputError(f"{path}: an empty file, no capture")
    reader = _pcapng if data[:4] == struct.pack("<I", _SECTION) else _pcap
    try:
        yield from reader(data)
    except (struct.error, ValueError, IndexError) as error:
        raise InputError(f"{path}: not a whole capture of a CAN bus ({error}); write it again with tshark -w") from error


def _pcap(data: bytes) -> Iterator[Entry]:
    order = next((o for o in "<>" if struct.unpack_from(o + "I", data)[0] in _CLASSIC_MAGIC), None)
    if order is None:
        raise ValueError("neither pcap nor pcapng")
    magic, _, _, _, _, _, link = struct.unpack_from(order + "IHHiIII", data)
    interface, place = _Interface(link & 0xFFFF, "can0", _CLASSIC_MAGIC[magic]), 24
    while place < len(data):
        seconds, fraction, size, _ = struct.unpack_from(order + "IIII", data, place)
        found = _entry(interface, seconds + fraction / interface.per_s, _slice(data, place + 16, size), order)
        if found is not None:
            yield found
        place += 16 + size


def _slice(data: bytes, start: int, size: int) -> bytes:
    if start + size > len(data):
        raise ValueError(f"cut off at byte {len(data)}")
    return data[start : start + size]


def _pcapng(data: bytes) -> Iterator[Entry]:
    order, interfaces, place = "<", list[_Interface](), 0
    while place < len(data):
        if data[place : place + 4] == struct.pack("<I", _SECTION):
            order = "<" if struct.unpack_from("<I", data, place + 8)[0] == _ORDER_MAGIC else ">"
            interfaces = []
        kind, size = struct.unpack_from(order + "II", data, place)
        if size < 12 or size % 4:
            raise ValueError(f"a block of {size} bytes at byte {place}")
        body = _slice(data, place + 8, size - 12)
        if kind == _INTERFACE:
            interfaces.append(_interface(body, order, len(interfaces)))
        elif kind == _PACKET:
            found = _enhanced(body, order, interfaces)
            if found is not None:
                yield found
        elif kind == _SIMPLE:
            raise ValueError("a packet without a time stamp")
        place += size


def _options(body: bytes, place: int, order: str) -> dict[int, bytes]:
    found: dict[int, bytes] = {}
    while place + 4 <= len(body):
        code, size = struct.unpack_from(order + "HH", body, place)
        if code == 0:
            break
        found[code] = body[place + 4 : place + 4 + size]
        place += 4 + size + -size % 4
    return found


def _interface(body: bytes, order: str, index: int) -> _Interface:
    options = _options(body, 8, order)
    resolution = options.get(_IF_TSRESOL, b"\x06")[0]
    per_s = 2 ** (resolution & 0x7F) if resolution & 0x80 else 10**resolution
    offset = struct.unpack(order + "q", options[_IF_TSOFFSET])[0] if _IF_TSOFFSET in options else 0
    name = options.get(_IF_NAME, f"can{index}".encode()).decode("utf-8", "replace")
    return _Interface(struct.unpack_from(order + "H", body)[0], "_".join(name.split()) or f"can{index}", per_s, offset)


def _enhanced(body: bytes, order: str, interfaces: list[_Interface]) -> Entry | None:
    index, high, low, size, _ = struct.unpack_from(order + "IIIII", body)
    interface, at = interfaces[index], high << 32 | low
    direction = ""
    flags = _options(body, 20 + size + -size % 4, order).get(_EPB_FLAGS)
    if flags is not None:
        direction = _DIRECTIONS.get(struct.unpack(order + "I", flags)[0] & 3, "")
    # Whole seconds apart: a float that holds an epoch has no room for more than a fraction of a microsecond.
    seconds = interface.offset_s + at // interface.per_s
    return _entry(interface, seconds + at % interface.per_s / interface.per_s, _slice(body, 20, size), order, direction)


def _entry(interface: _Interface, time_s: float, packet: bytes, order: str, direction: str = "") -> Entry | None:
    """A packet as an entry; None for one of a cooked capture that is no CAN frame."""
    fd = False
    if interface.link == SOCKETCAN:
        order = ">"
    elif interface.link in (COOKED, COOKED_2):
        kind, protocol, header = (*struct.unpack_from(">H12xH", packet), 16) if interface.link == COOKED else (packet[10], *struct.unpack_from(">H", packet), 20)
        if protocol not in (_ETH_CAN, _ETH_CANFD):
            return None
        direction = direction or ("T" if kind == _OUTGOING else "R")
        packet, fd = packet[header:], protocol == _ETH_CANFD
    else:
        raise ValueError(f"link type {interface.link}, where CAN has {SOCKETCAN}")
    if interface.per_s <= 1_000_000:
        time_s = round(time_s, 6)  # sums leave a trace in the last digit
    number, length, bits = struct.unpack_from(order + "IBB", packet)
    fd = fd or bool(bits & _FDF) or len(packet) == _FD_SIZE
    return _frame(interface.name, time_s, number, length, bits if fd else 0, fd, packet[_HEADER:], direction)


def _frame(channel: str, time_s: float, number: int, length: int, bits: int, fd: bool, data: bytes, direction: str) -> Entry:
    if length > (64 if fd else 8):
        raise ValueError(f"a frame of {length} bytes")
    flags = (FD if fd else 0) | (BRS if bits & _BRS else 0)
    if number & _ERROR_BIT:
        flags |= ERROR
    else:
        flags |= (EXTENDED if number & _EXTENDED_BIT else 0) | (REMOTE if number & _REMOTE_BIT and not fd else 0)
    remote = bool(flags & REMOTE)
    if not remote and len(data) < length:
        raise ValueError(f"a frame of {length} bytes with {len(data)} of them captured")
    return Entry(time_s, channel, Frame(number & _ID, flags, b"" if remote else data[:length]), direction, length if remote else 0, bool(bits & _ESI))
