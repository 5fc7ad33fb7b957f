"""What may be wrong with a frame's bytes: flipped bits, a counter that jumps, a length that is not the message's."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

from hullguard.bus.candump import FD
from hullguard.core.native import Frame
from hullguard.inject.options import option, required
from hullguard.inject.shot import GONE, Action, Change, Shot

CLASSIC_MAX, FD_MAX = 8, 64


@dataclass(kw_only=True)
class Corrupt(Change):
    """Flip bits."""

    about: ClassVar[str] = "flip bits of the data; with repair, of what the checksum guards, and renew the checksum"
    example: ClassVar[str] = "corrupt:bits=3@id=0x110,p=0.1,from=5,to=10"
    expects: ClassVar[tuple[str, ...]] = ("crc", "good", "invalid", "numeric")
    also: ClassVar[tuple[str, ...]] = GONE

    bits: int = option(1, "how many, chosen by chance", low=1, high=8 * FD_MAX)
    byte: int | None = option(None, "only in this byte, counted from 0", low=0, high=FD_MAX - 1)
    mask: bytes | None = option(None, "instead of chosen bits: exclusive or with these bytes")
    repair: bool = option(False, "renew the checksum: the frame is in order, its content wrong")

    def changed(self, shot: Shot) -> tuple[Frame, str] | None:
        """Frame with bits flipped."""
        frame = shot.given
        layout = shot.traffic.codec.layout(frame)
        if self.mask is not None:
            places = [i for i in range(8 * min(len(self.mask), len(frame.data))) if self.mask[i // 8] >> i % 8 & 1]
        else:
            free = layout.free_bits if self.repair and layout is not None else range(8 * len(frame.data))
            able = [i for i in free if self.byte is None or i // 8 == self.byte]
            places = sorted(shot.random.sample(able, min(self.bits, len(able))))
        if not places:
            return None
        data = bytearray(frame.data)
        for i in places:
            data[i // 8] ^= 1 << i % 8
        made = layout.renewed(frame, bytes(data)) if self.repair and layout is not None else replace(frame, data=bytes(data))
        return made, f"bits {' '.join(map(str, places))}{', checksum renewed' if self.repair else ''}"


@dataclass(kw_only=True)
class Length(Change):
    """Another length."""

    about: ClassVar[str] = "cut the data off or lengthen them; CAN FD lengths that its length code cannot say, such as 13, go out on SocketCAN only"
    example: ClassVar[str] = "length:to=6@id=measurement,nth=20"
    expects: ClassVar[tuple[str, ...]] = ("format",)
    also: ClassVar[tuple[str, ...]] = GONE

    to: int = required("bytes; a classic frame has 8 at most", low=0, high=FD_MAX)
    fill: int = option(0, "value of the bytes added", low=0, high=255)

    def changed(self, shot: Shot) -> tuple[Frame, str] | None:
        """Frame of another length."""
        frame = shot.given
        length = min(self.to, FD_MAX if frame.flags & FD else CLASSIC_MAX)
        data = frame.data[:length] + bytes([self.fill]) * (length - len(frame.data))
        return replace(frame, data=data), f"{len(frame.data)} -> {length} bytes"


@dataclass(kw_only=True)
class Counter(Action):
    """A jump of the sequence counter."""

    about: ClassVar[str] = "the sequence counter jumps, and goes on from there to the end; the checksum is renewed"
    example: ClassVar[str] = "counter:by=3@id=measurement,nth=10"
    needs_gateway: ClassVar[str] = "change a frame"
    expects: ClassVar[tuple[str, ...]] = ("good", "sequence", "repeated")
    also: ClassVar[tuple[str, ...]] = ("lost",)

    by: int = option(1, "how far, modulo the counter's range")
    _offset: dict[str, int] = field(default_factory=dict, init=False)

    def fire(self, shot: Shot) -> Frame | None:
        """Further away from what the sender counts."""
        layout = shot.traffic.codec.layout(shot.given)
        if layout is None or layout.protection is None or layout.protection.check(shot.given.data) is None:
            return shot.frame
        before = self._counted(shot)
        self._offset[layout.name] = (self._offset.get(layout.name, 0) + self.by) % layout.protection.modulus
        made = self._counted(shot)
        if made != before:
            shot.label([made], f"{self.by:+d} counts")
        return made

    def passing(self, shot: Shot) -> Frame | None:
        """Away as far as the last jump took it."""
        return self._counted(shot)

    def _counted(self, shot: Shot) -> Frame:
        frame = shot.given
        layout = shot.traffic.codec.layout(frame)
        if layout is None or layout.protection is None or not self._offset.get(layout.name):
            return frame
        header = layout.protection.check(frame.data)
        if header is None:
            return frame
        counter = (header.counter + self._offset[layout.name]) % layout.protection.modulus
        return replace(frame, data=layout.protection.protect(frame.data, counter, header.stamp or 0))
