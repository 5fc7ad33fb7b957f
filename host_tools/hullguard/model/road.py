"""What the wheels of a scenario meet."""

from __future__ import annotations

from dataclasses import dataclass

from hullguard.model.table import Table

CLASSES = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6}  # ISO 8608: Gd(0.1 1/m) in m^3, geometric means of the classes
KINDS = ("smooth", "sine", "bump", "iso8608")


@dataclass(frozen=True)
class RoadSpec:
    """What a scenario's wheels meet. Several axles meet the same road one after another."""

    kind: str  # one of KINDS
    height_m: float = 0.0  # amplitude of a sine, height of a bump
    frequency_hz: float = 1.0  # of a sine
    start_s: float = 1.0  # of a bump
    duration_s: float = 0.1  # of a bump
    roughness: str = "A"  # class by ISO 8608
    speed_mps: float = 20.0  # of a random road, and between axles


def read_road(t: Table) -> RoadSpec:
    """One road of a scenario; only the keys of its kind are known."""
    kind = t.text("kind", choices=list(KINDS))
    spec = RoadSpec(kind)
    speed = t.number("speed_mps", 0.1, 100.0, spec.speed_mps)
    if kind == "sine":
        spec = RoadSpec(kind, t.number("height_m", 0.0, 10.0), t.number("frequency_hz", 1e-3, 1e3), speed_mps=speed)
    elif kind == "bump":
        spec = RoadSpec(kind, t.number("height_m", -1.0, 1.0), start_s=t.number("start_s", 0.0, default=1.0), duration_s=t.number("duration_s", 1e-3, 100.0), speed_mps=speed)
    elif kind == "iso8608":
        spec = RoadSpec(kind, roughness=t.text("class", choices=sorted(CLASSES)), speed_mps=speed)
    t.close()
    return spec
