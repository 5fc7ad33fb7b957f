"""Error frames of SocketCAN (linux/can/error.h) in words. They speak of this host's controller, not of the ECU's."""

from __future__ import annotations

from collections import Counter

from hullguard.core.native import Frame
from hullguard.monitor.snapshot import ErrorsSeen

TX_TIMEOUT, LOST_ARBITRATION, CONTROLLER, PROTOCOL, TRANSCEIVER, NO_ACK, BUS_OFF, BUS_ERROR, RESTARTED, COUNTERS = (1 << i for i in range(10))
_CLASSES = (
    (BUS_OFF, "bus-off"),
    (RESTARTED, "restarted"),
    (TX_TIMEOUT, "transmit timeout"),
    (LOST_ARBITRATION, "lost arbitration"),
    (TRANSCEIVER, "transceiver fault"),
    (NO_ACK, "no acknowledge"),
    (BUS_ERROR, "bus error"),
)
_CONTROLLER = (
    (0x20, "error passive (transmit)"),
    (0x10, "error passive (receive)"),
    (0x08, "warning (transmit)"),
    (0x04, "warning (receive)"),
    (0x01, "receive overflow"),
    (0x02, "transmit overflow"),
    (0x40, "error active"),
)
_PROTOCOL = (
    (0x01, "bit"),
    (0x02, "form"),
    (0x04, "stuff"),
    (0x08, "dominant bit"),
    (0x10, "recessive bit"),
    (0x20, "overload"),
    (0x40, "active error announcement"),
    (0x80, "transmission"),
)


def words(frame: Frame) -> tuple[str, ...]:
    """What an error frame says, each thing once."""
    data = frame.data.ljust(8, b"\0")
    said = [text for bit, text in _CLASSES if frame.id & bit]
    if frame.id & CONTROLLER:
        said += [text for bit, text in _CONTROLLER if data[1] & bit] or ["controller problem"]
    if frame.id & PROTOCOL:
        said += [f"{text} error" for bit, text in _PROTOCOL if data[2] & bit] or ["protocol error"]
    return tuple(said) or ("unspecified error",)


class ErrorFrames:
    """Counts of error frames, and the state of the controller that they tell."""

    def __init__(self) -> None:
        self.state = "error active"
        self.clear()

    def clear(self) -> None:
        """Counters only: a controller that is off stays off."""
        self.count, self.kinds, self.last = 0, Counter[str](), ""

    def take(self, frame: Frame) -> bool:
        """Count an error frame; True if the state of the controller has changed."""
        said, before = words(frame), self.state
        self.count += 1
        self.kinds.update(said)
        self.last = ", ".join(said)
        if frame.id & COUNTERS:
            data = frame.data.ljust(8, b"\0")
            self.last += f", error counters {data[6]} transmit {data[7]} receive"
        for text in said:
            if text in ("restarted", "error active"):
                self.state = "error active"
            elif text == "bus-off" or (text.startswith(("error passive", "warning")) and self.state != "bus-off"):
                self.state = text
                break
        return self.state != before

    def seen(self) -> ErrorsSeen:
        """For a snapshot."""
        return ErrorsSeen(self.count, self.state, self.last, dict(self.kinds))
