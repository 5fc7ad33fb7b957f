"""What an ECU keeps of the samples around a confirmed alarm: [freeze]; hullguard/freeze.h."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from hullguard.errors import InputError
from hullguard.model.table import Table

if TYPE_CHECKING:
    from hullguard.model.schema import Frame

SAMPLES_MAX = 255
BURST = 4  # frames a sample: half of what a classic bus of 500 kbit/s carries in a millisecond


@dataclass(frozen=True)
class FreezeSpec:
    """hg_freeze_config."""

    samples: int
    after: int  # of them after the alarm
    burst: int  # frames a request or sample
    request: Frame
    response: Frame


def read_freeze(t: Table, frame: Callable[[Table], Frame], taken: dict[tuple[int, bool], str]) -> FreezeSpec | None:
    """None where the model keeps nothing. `frame` reads a frame of the detector's own; `taken`: identifiers in use, and by what."""
    samples = t.whole("samples", 0, SAMPLES_MAX, 0)
    after = t.whole("after", 0, max(samples - 1, 0), samples // 4)
    burst = t.whole("frames_per_sample", 1, 255, BURST)
    if samples == 0:
        return None
    request = frame(t.table("request"))
    if "response" in t:
        response = frame(t.table("response"))
    else:
        if request.id == (0x1FFFFFFF if request.extended else 0x7FF):
            raise t.error("request", "there is no identifier behind it for the response; give response, or a smaller id")
        response = replace(request, id=request.id + 1, data_id=(request.data_id + 1) & 0xFFFF)
    for key, one in (("request", request), ("response", response)):
        if one.fd:
            raise t.error(f"{key}.fd", "requests and responses are frames of 8 bytes of classic CAN; remove it")
        other = taken.get((one.id, one.extended))
        if other is not None:
            raise InputError(f"{t.where}: {key} has identifier 0x{one.id:X}, which is that of '{other}'; choose another")
        taken[(one.id, one.extended)] = f"freeze.{key}"
    t.close()
    return FreezeSpec(samples, after, burst, replace(request, fd=False), replace(response, fd=False))
