"""Frames of the platoon by their content, and streams of them through an injector."""

from __future__ import annotations

from functools import cache

from host_support import ROOT, SEED
from hullguard.bus.candump import frame_of
from hullguard.core.native import Frame
from hullguard.inject import Codec, Injector, Ledger, Sent, codec_of, parse_directive

DBC = ROOT / "firmware" / "models" / "platoon.dbc"
PERIOD_S = 0.1


@cache
def codec() -> Codec:
    """With its closing message, as a model gives it."""
    return codec_of(DBC.read_text(), "platoon.dbc", "control")


def made(message: str, counter: int, stamp: int, **values: float) -> Frame:
    """A frame in order."""
    layout = codec().message(message)
    data = bytes(layout.length)
    for name, value in values.items():
        data = layout.fields[name].with_raw(data, layout.fields[name].pattern(value))
    assert layout.protection is not None
    return Frame(layout.id, layout.flags, layout.protection.protect(data, counter, stamp))


def measurement(k: int, **values: float) -> Frame:
    return made("measurement", k % 16, k % 16, **({"gap12_m": 0.1 * k, "gap23_m": 2.0, "speed1_mps": 3.0} | values))


def control(k: int) -> Frame:
    return made("control", k % 16, k % 16, control1_mps2=0.5)


def stream(samples: int = 20) -> list[Sent]:
    """A measurement and a control frame every sample, the latter 10 ms behind."""
    return [x for k in range(samples) for x in (Sent(k * PERIOD_S, measurement(k)), Sent(k * PERIOD_S + 0.01, control(k)))]


def injector(*specs: str, seed: int = SEED, gateway: bool = True, known: Codec | None = None) -> Injector:
    return Injector([parse_directive(s) for s in specs], codec() if known is None else known, seed, gateway, Ledger())


def through(inject: Injector, frames: list[Sent]) -> list[Sent]:
    out = [x for s in frames for x in inject.take(s.frame, s.time_s)]
    return out + inject.finish()


def read(text: str) -> Frame:
    return frame_of(text, "test")


def value(frame: Frame, signal: str) -> float:
    layout, field = codec().signal(signal)
    assert layout.carries(frame)
    return field.value(frame.data)


def in_order(frame: Frame) -> bool:
    """Is the checksum right?"""
    layout = codec().layout(frame)
    assert layout is not None and layout.protection is not None
    return layout.protection.check(frame.data) is not None
