"""What tests of the unknown-input observer share: the quarter car, what is printed of it, and a fine simulation that knows nothing of the design code."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.linalg
from host_support import ROOT
from hullguard.design.uio import Unknown, augment
from hullguard.model.table import Array

SPRING, TYRE, DAMPER = 16000.0, 160000.0, 1650.0
STATES = ("deflection", "body", "tyre", "wheel")
PRINTED = {k: np.array(v, dtype=np.float64) for k, v in tomllib.loads((ROOT / "tests" / "fixtures" / "suspension" / "printed.toml").read_text(encoding="utf-8")).items()}
C_PRINTED = PRINTED["C"][:, :4]
HALF = {
    "plant.corners": 2,
    "plant.body_kg": 480,
    "plant.front_m": 1.2,
    "plant.rear_m": 1.4,
    "plant.pitch_kgm2": 800,
    "bus.bitrate_bps": 1_000_000,
    "bus.data_bitrate_bps": 5_000_000,
}


def observers(form: str) -> dict[str, Any]:
    """Overrides: the shipped suspension with observers in place of what its sensors say directly."""
    first = {"faults": ["actuator1"], "poles": {"slow": -100, "fast": -500}, "form": form, "low_pass_s": 0.1}
    return {"detector.uio": [first, {"faults": ["actuator1", "body1_sensor"], "poles": {"slow": -20, "fast": -160}, "form": form, "low_pass_s": 0.1}]}


def quarter_car(wheel_kg: float, body_kg: float, spring: float = SPRING, tyre: float = TYRE, damper: float = DAMPER) -> tuple[Array, Array, Array]:
    """A, B and G = [B, road] for x = [z2 - z1, dz2, z1 - z0, dz1], body z2 over wheel z1."""
    A = np.array([[0, 1, 0, -1], [-spring / body_kg, -damper / body_kg, 0, damper / body_kg], [0, 0, 0, 1], [spring / wheel_kg, damper / wheel_kg, -tyre / wheel_kg, -damper / wheel_kg]])
    B = np.array([[0], [1 / body_kg], [0], [-1 / wheel_kg]])
    return A, B, np.hstack([B, [[0], [0], [-1], [0]]])


def known(C: Array, wheel_kg: float = 36.0, body_kg: float = 240.0, names: tuple[str, ...] | None = None) -> Unknown:
    """The quarter car with unknown actuator fault and road."""
    A, B, G = quarter_car(wheel_kg, body_kg)
    return Unknown(A, B, C, G, STATES, ("actuator", "road"), names or tuple(f"y{i + 1}" for i in range(len(C))))


def sensors(*names: str) -> Unknown:
    """The quarter car with these states measured."""
    return known(np.eye(4)[[STATES.index(n) for n in names]], names=names)


def published() -> Unknown:
    """The published masses and outputs, the third one with the fault of its sensor as fifth state."""
    return augment(known(C_PRINTED, 240.0, 36.0), [2], [0.0])


def driven(
    plant: tuple[Array, Array, Array],
    period_s: float,
    seconds: float,
    actuator: Callable[[float], float] = lambda t: 0.0,
    road: Callable[[float], float] = lambda t: 0.0,
    start: Array | None = None,
    fine_s: float = 1e-4,
) -> tuple[Array, Array]:
    """Times and states (samples x 4) of the quarter car, inputs held over fine steps."""
    A, _, G = plant
    block = np.zeros((6, 6))
    block[:4, :4], block[:4, 4:] = A, G
    E = scipy.linalg.expm(block * fine_s)
    Ad, Gd, each, count = E[:4, :4], E[:4, 4:], round(period_s / fine_s), round(seconds / period_s)
    x, states = np.zeros(4) if start is None else np.array(start, dtype=np.float64), np.zeros((count + 1, 4))
    for k in range(count + 1):
        states[k] = x
        for j in range(each):
            t = (k * each + j + 0.5) * fine_s
            x = Ad @ x + Gd @ np.array([actuator(t), road(t)])
    return np.arange(count + 1) * period_s, states


def rough(t: float) -> float:
    """The road of section 1.5: a sine of 20 mm and 1 Hz, with a bump of 5 cm in 100 ms at 3 s; m/s."""
    bump = 0.025 * 2 * np.pi / 0.1 * np.sin(2 * np.pi * (t - 3) / 0.1) if 3 < t < 3.1 else 0.0
    return float(0.02 * 2 * np.pi * np.cos(2 * np.pi * t) + bump)
