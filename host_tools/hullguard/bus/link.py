"""Frames to and from a real bus through python-can, with what python-can leaves out: full send queues, and errors in one line."""

from __future__ import annotations

import contextlib
import errno
import logging
import socket
import struct
import sys
import time
from collections.abc import Iterator
from typing import Any

import can

from hullguard.bus.candump import BRS, ERROR, EXTENDED, FD, REMOTE
from hullguard.core.native import Frame
from hullguard.design.tables import FD_LENGTHS
from hullguard.errors import BusError

logging.getLogger("can").addHandler(logging.NullHandler())  # what goes wrong comes as an exception and is told in one line
RECEIVE_BUFFER = 4 << 20  # bytes; python-can's default holds 278 frames, and the system's limit without privilege twice that
SO_RCVBUFFORCE = 33  # Linux; Python has no name for it
SEND_PATIENCE_S = 1.0
EXTENDED_BIT, CANFD_BRS = 0x80000000, 0x01  # linux/can.h


def to_message(frame: Frame) -> can.Message:
    """A frame as python-can has it."""
    return can.Message(
        arbitration_id=frame.id,
        data=frame.data,
        is_extended_id=bool(frame.flags & EXTENDED),
        is_remote_frame=bool(frame.flags & REMOTE),
        is_fd=bool(frame.flags & FD),
        bitrate_switch=bool(frame.flags & BRS),
        is_error_frame=bool(frame.flags & ERROR),
    )


def from_message(message: can.Message) -> Frame:
    """A python-can message as a frame."""
    flags = EXTENDED if message.is_extended_id and not message.is_error_frame else 0
    flags |= REMOTE if message.is_remote_frame else 0
    flags |= (FD if message.is_fd else 0) | (BRS if message.bitrate_switch else 0) | (ERROR if message.is_error_frame else 0)
    return Frame(message.arbitration_id, flags, bytes(message.data))


class CanLink:
    """An open bus."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        channel = getattr(bus, "channel", "can0")
        self.channel = channel if isinstance(channel, str) else bus.channel_info
        raw = getattr(bus, "socket", None)
        if isinstance(raw, socket.socket):
            for option in (socket.SO_RCVBUF, SO_RCVBUFFORCE) if sys.platform == "linux" else (socket.SO_RCVBUF,):
                with contextlib.suppress(OSError):
                    raw.setsockopt(socket.SOL_SOCKET, option, RECEIVE_BUFFER)

    def send(self, frame: Frame) -> None:
        """Send one frame; a full queue is waited for, a dead bus is an error."""
        end = time.monotonic() + SEND_PATIENCE_S
        while True:
            try:
                self._put(frame)
                return
            except can.CanOperationError as error:
                full = getattr(error, "error_code", None) == errno.ENOBUFS
                if not full or time.monotonic() > end:
                    cure = "raise its txqueuelen" if full else "is the interface up?"
                    raise BusError(f"cannot send on {self.channel}: {error}; {cure}") from error
                time.sleep(0.0005)

    def _put(self, frame: Frame) -> None:
        if not frame.flags & FD or len(frame.data) in FD_LENGTHS:
            self.bus.send(to_message(frame))
            return
        # python-can would fill it up to the next length that CAN FD can say; Linux takes it as it is.
        raw = getattr(self.bus, "socket", None)
        if not isinstance(raw, socket.socket):
            raise BusError(f"{len(frame.data)} bytes of data cannot be sent on {self.channel}: CAN FD has no such length; use socketcan, or one of {FD_LENGTHS[9:]}")
        number = frame.id | (EXTENDED_BIT if frame.flags & EXTENDED else 0)
        try:
            raw.send(struct.pack("=IBBxx64s", number, len(frame.data), CANFD_BRS if frame.flags & BRS else 0, frame.data))
        except OSError as error:
            raise can.CanOperationError(str(error), error.errno) from error

    def receive(self, timeout_s: float) -> tuple[Frame, float] | None:
        """The next frame and its time stamp, or None when none comes in time."""
        try:
            message = self.bus.recv(timeout_s)
        except can.CanError as error:
            raise BusError(f"cannot receive on {self.channel}: {error}; is the interface up?") from error
        return None if message is None else (from_message(message), message.timestamp)

    def close(self) -> None:
        """Let the bus go."""
        with contextlib.suppress(can.CanError, OSError):
            self.bus.shutdown()


@contextlib.contextmanager
def opened(**options: Any) -> Iterator[CanLink]:
    """Open a bus with python-can's own options; closed on the way out. Raises BusError with the cause and the cure."""
    name = f"{options.get('interface') or 'the configured interface'}:{options.get('channel')}"
    try:
        bus = can.Bus(**options)
    except Exception as error:  # a driver that is not installed raises what it likes: python-can's kvaser a NameError
        channel = options.get("channel")
        if options.get("interface") != "socketcan":
            cure = "check -i, -c and its driver"
        elif isinstance(error, OSError) and error.errno == errno.EAFNOSUPPORT:
            cure = "this kernel has no CAN: use --bus auto or --bus inprocess, or run it under build/with-vcan/with-vcan"
        else:
            cure = f"create it with: ip link add {channel} type vcan && ip link set {channel} up"
        raise BusError(f"bus {name} cannot be opened: {error}; {cure}") from error
    link = CanLink(bus)
    try:
        yield link
    finally:
        link.close()
