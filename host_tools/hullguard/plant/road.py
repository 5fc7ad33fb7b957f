"""Roads as vertical velocity over time: sine, bump, and random ones of a class by ISO 8608; suspension, section 1.5.

A vehicle at a constant speed meets a profile of spatial frequency n (1/m) with n times its speed (Hz). ISO 8608 gives the one-sided spectral density of
the height, Gd(n) = Gd(0.1) (n / 0.1)^-2 within 0.011 .. 2.83 1/m, with Gd(0.1) = 16, 64, 256, 1024, 4096 e-6 m^3 for classes A .. E. A random road is a
sum of sines over bands of equal ratio with random phases, and a random frequency within each band so that it does not repeat.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hullguard.errors import InputError
from hullguard.model.road import CLASSES, RoadSpec
from hullguard.model.table import Array

REFERENCE_PER_M = 0.1
LOWEST_PER_M, HIGHEST_PER_M = 0.011, 2.83
BANDS = 160


@dataclass(frozen=True)
class Waves:
    """Velocity as a sum of amplitude cos(2 pi frequency t + phase)."""

    frequency: Array  # Hz
    amplitude: Array  # m/s
    phase: Array

    def velocity(self, t: Array) -> Array:
        """m/s at these times."""
        out = np.zeros_like(t)
        for f, a, p in zip(self.frequency, self.amplitude, self.phase, strict=True):
            out += a * np.cos(2 * np.pi * f * t + p)
        return out

    def acceleration(self, t: Array) -> Array:
        """m/s2 at these times."""
        out = np.zeros_like(t)
        for f, a, p in zip(self.frequency, self.amplitude, self.phase, strict=True):
            out -= 2 * np.pi * f * a * np.sin(2 * np.pi * f * t + p)
        return out


@dataclass(frozen=True)
class Bump:
    """A raised cosine of this height."""

    height: float
    start: float
    duration: float

    def velocity(self, t: Array) -> Array:
        """m/s at these times."""
        turn = 2 * np.pi / self.duration
        return np.where((t >= self.start) & (t < self.start + self.duration), self.height / 2 * turn * np.sin(turn * (t - self.start)), 0.0)

    def acceleration(self, t: Array) -> Array:
        """m/s2 at these times."""
        turn = 2 * np.pi / self.duration
        return np.where((t >= self.start) & (t < self.start + self.duration), self.height / 2 * turn**2 * np.cos(turn * (t - self.start)), 0.0)


Road = Waves | Bump


def density(roughness: str, n: Array) -> Array:
    """Gd(n), m^3, of a class at spatial frequencies n (1/m)."""
    return np.asarray(CLASSES[roughness] * (n / REFERENCE_PER_M) ** -2.0)


def random_road(roughness: str, speed_mps: float, seed: int) -> Waves:
    """A road of a class: each band of the spectrum is one sine that has the band's power; same seed, same road."""
    rng = np.random.default_rng([seed, 8608])
    edge = np.geomspace(LOWEST_PER_M, HIGHEST_PER_M, BANDS + 1)
    n = edge[:-1] * (edge[1:] / edge[:-1]) ** rng.random(BANDS)
    power = CLASSES[roughness] * REFERENCE_PER_M**2 * (1 / edge[:-1] - 1 / edge[1:])  # the integral of Gd over each band
    return Waves(n * speed_mps, 2 * np.pi * n * speed_mps * np.sqrt(2 * power), 2 * np.pi * rng.random(BANDS))


def road(spec: RoadSpec, seed: int) -> Road:
    """The road of a scenario."""
    none = np.zeros(0)
    if spec.kind == "sine":
        turn = 2 * np.pi * spec.frequency_hz
        return Waves(np.array([spec.frequency_hz]), np.array([spec.height_m * turn]), np.zeros(1))
    if spec.kind == "bump":
        return Bump(spec.height_m, spec.start_s, spec.duration_s)
    return random_road(spec.roughness, spec.speed_mps, seed) if spec.kind == "iso8608" else Waves(none, none, none)


def check_bounds(roads: list[Road], times: Array, bound: float, rate: float) -> None:
    """Refuse roads that break what the model promises of them: a threshold says nothing then."""
    velocity, acceleration = sum(np.abs(r.velocity(times)).max() for r in roads), sum(np.abs(r.acceleration(times)).max() for r in roads)
    for found, limit, what, key in ((velocity, bound, "m/s", "bound"), (acceleration, rate, "m/s2", "rate")):
        if found > limit:
            raise InputError(
                f"the scenario's road reaches {found:.3g} {what}, the model promises at most {limit:g}; drive slower, choose a smoother road, or raise plant.unknown.{key}"
            )
