"""A link that knows how many frames this host has dropped: SocketCAN's own count, which python-can does not ask for."""

from __future__ import annotations

import select
import socket
import struct
import sys

import can

from hullguard.bus.candump import BRS, ERROR, EXTENDED, FD, REMOTE
from hullguard.bus.link import CanLink
from hullguard.core.native import Frame
from hullguard.errors import BusError

SO_RXQ_OVFL = 40  # Linux; Python has names for neither
SO_TIMESTAMPNS = 35
FRAME_SIZE, FD_FRAME_SIZE = 16, 72  # struct can_frame, struct canfd_frame
_HEAD = struct.Struct("=IBB2x")  # identifier with its flags, length, flags of CAN FD
_TIME = struct.Struct("@ll")  # struct timespec
_DROPPED = struct.Struct("@I")
_ANCILLARY = socket.CMSG_SPACE(_TIME.size) + socket.CMSG_SPACE(_DROPPED.size) if sys.platform == "linux" else 0
_WIDE, _REMOTE, _ERROR = 0x80000000, 0x40000000, 0x20000000
_FD_BRS = 0x01


def parse(raw: bytes) -> Frame:
    """The kernel's struct can_frame or canfd_frame, told apart by its size."""
    number, length, fd_flags = _HEAD.unpack_from(raw)
    fd = len(raw) == FD_FRAME_SIZE
    flags = (FD if fd else 0) | (BRS if fd and fd_flags & _FD_BRS else 0) | (REMOTE if number & _REMOTE else 0)
    if number & _ERROR:
        return Frame(number & 0x1FFFFFFF, flags | ERROR, raw[8 : 8 + length])
    wide = bool(number & _WIDE)
    data = b"" if number & _REMOTE else raw[8 : 8 + length]
    return Frame(number & (0x1FFFFFFF if wide else 0x7FF), flags | (EXTENDED if wide else 0), data)


def ancillary(items: list[tuple[int, int, bytes]]) -> tuple[float | None, int | None]:
    """Time stamp in s, and frames dropped since the socket was opened (modulo 2^32), where they came along."""
    time_s: float | None = None
    dropped: int | None = None
    for level, kind, data in items:
        if level != socket.SOL_SOCKET:
            continue
        if kind == SO_TIMESTAMPNS:
            seconds, nanoseconds = _TIME.unpack_from(data)
            time_s = seconds + nanoseconds * 1e-9
        elif kind == SO_RXQ_OVFL:
            dropped = int(_DROPPED.unpack_from(data)[0])
    return time_s, dropped


class OverflowLink(CanLink):
    """An open bus whose host losses are known where it is SocketCAN: `dropped` counts them, None on other interfaces.

    The kernel tells the count with the first frame behind the gap, so it stands at the place where the frames are missing.
    """

    def __init__(self, bus: can.BusABC) -> None:
        super().__init__(bus)
        self.dropped: int | None = None
        self._socket: socket.socket | None = None
        raw = getattr(bus, "socket", None)
        if sys.platform == "linux" and isinstance(raw, socket.socket) and raw.family == socket.AF_CAN:
            try:
                raw.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
            except OSError:
                return  # an old kernel: python-can reads, the count stays unknown
            self._socket, self.dropped = raw, 0

    def receive(self, timeout_s: float) -> tuple[Frame, float] | None:
        """The next frame and its time stamp. python-can takes ancillary data for one thing only, hence the read of one's own."""
        if self._socket is None:
            return super().receive(timeout_s)
        try:
            ready, _, _ = select.select([self._socket], [], [], timeout_s)
            if not ready:
                return None
            raw, items, _, _ = self._socket.recvmsg(FD_FRAME_SIZE, _ANCILLARY)
        except OSError as error:
            raise BusError(f"cannot receive on {self.channel}: {error.strerror}; is the interface up?") from error
        time_s, dropped = ancillary(items)
        if dropped is not None:
            self.dropped = dropped
        return parse(raw), time_s or 0.0
