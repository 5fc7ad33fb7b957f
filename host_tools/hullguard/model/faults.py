"""Faults as they are named on a command line and in a model: NAME:KIND[:SIZE]@START[..END]."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from hullguard.errors import InputError

KINDS = ("bias", "drift", "gain", "freeze", "noise")
_SPEC = re.compile(r"^(?P<name>\w+):(?P<kind>\w+)(?::(?P<size>[^@]+))?@(?P<start>\d+)(?:\.\.(?P<end>\d+))?$")


@dataclass(frozen=True)
class FaultSpec:
    """One fault of a run. `size` is in signal units (bias, noise), units a second (drift) or a factor (gain); freeze has none."""

    name: str
    kind: str
    size: float
    start: int
    end: int | None  # first sample after the fault

    def __str__(self) -> str:
        size = "" if self.kind in ("freeze", "dead") else f":{self.size:g}"
        return f"{self.name}:{self.kind}{size}@{self.start}" + ("" if self.end is None else f"..{self.end}")


def parse_fault(text: str) -> FaultSpec:
    """Read a fault SPEC; raises InputError with what would do."""
    found = _SPEC.match(text.strip())
    if not found:
        raise InputError(f"fault '{text}': expected NAME:KIND[:SIZE]@START[..END], for example gap3_m:bias:0.5@4000")
    kind = found["kind"]
    if kind not in KINDS:
        raise InputError(f"fault '{text}': kind '{kind}' is not one of {', '.join(KINDS)}")
    size = 0.0
    if kind == "freeze":
        if found["size"] is not None:
            raise InputError(f"fault '{text}': freeze takes no size")
    else:
        try:
            size = float(found["size"] if found["size"] is not None else "nan")
        except ValueError:
            size = math.nan
        if not math.isfinite(size):
            raise InputError(f"fault '{text}': {kind} needs a size, a finite number, as in {found['name']}:{kind}:0.5@{found['start']}")
    start, end = int(found["start"]), int(found["end"]) if found["end"] else None
    if end is not None and end <= start:
        raise InputError(f"fault '{text}': it ends at {end}, not after its start at {start}")
    return FaultSpec(found["name"], kind, size, start, end)
