"""Wrong values of a signal in frames that are otherwise in order: the checksum is renewed, so that only the physics can tell."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

from hullguard.core.native import Frame
from hullguard.errors import InputError
from hullguard.inject.codec import Codec, Field, Layout
from hullguard.inject.options import option, required
from hullguard.inject.shot import GONE, Change, Shot

SIGNAL = "the signal, by its name in the DBC, or MESSAGE.SIGNAL"
SIZE = "in units of the signal"


@dataclass(kw_only=True)
class Value(Change):
    """An action on one signal."""

    expects: ClassVar[tuple[str, ...]] = ("good", "numeric", "crc")  # crc: of a frame that was damaged before
    also: ClassVar[tuple[str, ...]] = GONE

    signal: str = required(SIGNAL)
    clip: bool = option(True, "values beyond the DBC's range become its end, as in a converter; false: they go out as far as the field holds them")
    _layout: Layout = field(init=False)
    _field: Field = field(init=False)

    def prepare(self, codec: Codec) -> tuple[Layout, ...]:
        """The message that carries the signal."""
        self._layout, self._field = codec.signal(self.signal)
        return (self._layout,)

    def held(self, frame: Frame) -> float:
        """The signal's value in a frame; NaN: none."""
        there = self._layout.carries(frame) and self._field.present(frame.data)
        return self._field.value(frame.data) if there else math.nan

    def changed(self, shot: Shot) -> tuple[Frame, str] | None:
        """Frame with another value; one that says no value stays as it is."""
        old = self.held(shot.given)
        if math.isnan(old):
            return None
        made = self.with_bits(shot.given, self._field.pattern(self.value(old, shot), self.clip))
        return made, f"{self.signal} {old:.9g} -> {self.held(made):.9g}"

    def with_bits(self, frame: Frame, raw: int) -> Frame:
        """The frame with other bits in the field, protected."""
        return self._layout.renewed(frame, self._field.with_raw(frame.data, raw))

    def value(self, old: float, shot: Shot) -> float:
        """The wrong value."""
        raise NotImplementedError


@dataclass(kw_only=True)
class Bias(Value):
    """Offset."""

    about: ClassVar[str] = "add a constant"
    example: ClassVar[str] = "bias:signal=gap12_m,size=0.5@time>=10"
    size: float = required(SIZE)

    def value(self, old: float, shot: Shot) -> float:
        """Shifted."""
        return old + self.size


@dataclass(kw_only=True)
class Drift(Value):
    """Growing offset."""

    about: ClassVar[str] = "add what grows with the time since the first frame concerned"
    example: ClassVar[str] = "drift:signal=gap12_m,rate=0.1@from=10,to=20"
    rate: float = required("units of the signal a second")
    _since: float | None = field(default=None, init=False)

    def value(self, old: float, shot: Shot) -> float:
        """Shifted by the time passed."""
        self._since = shot.time_s if self._since is None else self._since
        return old + self.rate * (shot.time_s - self._since)


@dataclass(kw_only=True)
class Gain(Value):
    """Wrong scale."""

    about: ClassVar[str] = "multiply"
    example: ClassVar[str] = "gain:signal=speed1_mps,factor=1.1@from=10"
    factor: float = required("factor")

    def value(self, old: float, shot: Shot) -> float:
        """Scaled."""
        return old * self.factor


@dataclass(kw_only=True)
class Noise(Value):
    """Noise."""

    about: ClassVar[str] = "add noise, uniform within +-size"
    example: ClassVar[str] = "noise:signal=gap12_m,size=0.3@from=10"
    size: float = required(SIZE, low=0.0)

    def value(self, old: float, shot: Shot) -> float:
        """Noisy."""
        return old + shot.random.uniform(-self.size, self.size)


@dataclass(kw_only=True)
class Spike(Value):
    """Single wrong values."""

    about: ClassVar[str] = "add to single frames, of either sign by chance; once, where the trigger chooses no frames"
    example: ClassVar[str] = 'spike:signal=speed1_mps,size=3@when="gap12_m>1.0"'
    once: ClassVar[bool] = True
    size: float = required(SIZE)
    sign: str = option("random", "of the size", choices=("random", "plus", "minus"))

    def value(self, old: float, shot: Shot) -> float:
        """One off."""
        up = shot.random.random() < 0.5 if self.sign == "random" else self.sign == "plus"
        return old + (self.size if up else -self.size)


@dataclass(kw_only=True)
class Freeze(Value):
    """Stuck value."""

    about: ClassVar[str] = "the value before the first frame concerned, for ever"
    example: ClassVar[str] = "freeze:signal=gap12_m@from=10,to=15"
    _before: float = field(default=math.nan, init=False)

    def value(self, old: float, shot: Shot) -> float:
        """The old one."""
        self._before = old if math.isnan(self._before) else self._before
        return self._before

    def passing(self, shot: Shot) -> Frame | None:
        """Remember the last healthy value; a fault that comes and goes sticks anew each time."""
        held = self.held(shot.given)
        self._before = self._before if math.isnan(held) else held
        return shot.frame


@dataclass(kw_only=True)
class Nan(Value):
    """No number."""

    about: ClassVar[str] = "no value, or one that cannot be"
    example: ClassVar[str] = "nan:signal=gap12_m,pattern=range@id=measurement,every=10"
    expects: ClassVar[tuple[str, ...]] = ("invalid", "numeric", "crc")
    pattern: str = option(
        "invalid",
        "invalid: the pattern for no value (all ones, the most negative number, or a quiet NaN); range: a code beyond the range, or infinity in a float",
        choices=("invalid", "range"),
    )

    def prepare(self, codec: Codec) -> tuple[Layout, ...]:
        """The message; a field that is full to the brim has nothing beyond its range."""
        made = super().prepare(codec)
        if self.pattern == "range" and self._field.beyond is None:
            raise InputError(f"signal '{self.signal}': its field holds nothing beyond its range; use pattern=invalid")
        return made

    def changed(self, shot: Shot) -> tuple[Frame, str] | None:
        """Frame with the pattern."""
        if not self._layout.carries(shot.given) or not self._field.present(shot.given.data):
            return None
        beyond = self._field.beyond
        raw = self._field.invalid if self.pattern == "invalid" or beyond is None else beyond
        return self.with_bits(shot.given, raw), f"{self.signal} raw {raw:#x}"
