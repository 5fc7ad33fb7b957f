"""Monte-Carlo study of the polynomial filter: the acceptance numbers of the method (polynomial, 2.4, 2.5) as checks, controls among them.

E1 is a bilinear plant, E2 a quarter of a car on a cubic spring, E3 the same with a quadratic deflection sensor; all scaled to O(1). Every run is made by the C library;
the auxiliary extended Kalman filter of the same run is what errors are compared with. Noise of two values ("atoms") is what the method's figures for skewed noise were
made with: degree 3 all but decodes it. Exponential noise stands beside it, with limits of its own where the method has none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t as student_t

from hullguard.core.library import library
from hullguard.core.polynomial import DRIFT, JOINT, PLAIN, Case, Levels, Outcome, run
from hullguard.design.polynomial import Noise, Plant, Tables, atoms, contaminated, exponential, laplace, make, normal, student, uniform, variables

SKEW = 21.0**0.5  # two values -7 and 3 with 0.3 and 0.7 have this standard deviation
AT = 100  # first faulty sample
SENSOR: dict[str, Any] = {"fault": "sensor", "fault_at": AT, "size": (0.8,)}  # four standard deviations
ACTUATOR: dict[str, Any] = {"fault": "actuator", "fault_at": AT, "size": (0.0, 0.08)}  # every sample


@dataclass(frozen=True)
class Check:
    """One number and the range it must be in."""

    what: str
    value: float
    low: float
    high: float

    @property
    def passed(self) -> bool:
        """Whether it is."""
        return self.low <= self.value <= self.high

    def __str__(self) -> str:
        return f"  {'ok' if self.passed else 'FAILED':<6} {self.what:<92} {self.value:10.4g}   {self.low:g} .. {self.high:g}"


def two_valued(deviation: float) -> Noise:
    """Skewed noise of two values."""
    return atoms((-7.0 * deviation / SKEW, 3.0 * deviation / SKEW), (0.3, 0.7))


SHAPES: dict[str, Callable[[float], Noise]] = {
    "atoms": two_valued,
    "exp": exponential,
    "gauss": normal,
    "uniform": lambda deviation: uniform(deviation * 3.0**0.5),
    "laplace": laplace,
    "student": lambda deviation: student(deviation, 5.0),  # no moment of order 5: the heaviest tail that degree 2 can be made for
    "contaminated": lambda deviation: contaminated(deviation, 0.05, 5.0),
}
HEAVY = ("exp", "laplace", "student", "contaminated")  # tails in which four standard deviations are nothing rare
# Share of the sensor faults of four deviations that are seen within 5 samples: in the hundred that "missed" counts, false alarms find some of the rest.
EARLY = {"atoms": 0.9, "exp": 0.5, "gauss": 0.85, "uniform": 0.9, "laplace": 0.75, "student": 0.7, "contaminated": 0.5}
LEVELS = Levels()
BLOCKS = 40  # independent groups of runs that a confidence bound is made from
CONFIDENCE = 0.999


def bilinear(v: Noise, w: Noise) -> Plant:
    """E1."""
    x1, x2 = variables(2)
    return Plant((0.8 * x1 + x1 * x2 + 0.1, 1.5 * x2 - x1 * x2 + 0.1), (x2,), (w, w), (v,), (1.309, 0.1236), (0.0025, 0.0009))


def suspension(shape: str, cubic: float = 1.0, quadratic: float = 0.0, driving: str | None = None) -> Plant:
    """E2; E3 with quadratic = 0.35; linear with cubic = 0. driving: another shape for w."""
    x1, x2 = variables(2)
    b, noise = 0.0667, SHAPES[shape]
    f = (x1 + 0.1 * x2, 0.93125 * x2 - b * x1 - b * cubic * x1**3)
    return Plant(f, (x1 + quadratic * x1**2,), (normal(1e-4), SHAPES[driving or shape](0.15)), (noise(0.2),), (0.0, 0.0), (0.04, 0.04))


E1_ATOMS = bilinear(atoms((-0.28, 0.12), (0.3, 0.7)), atoms((-0.01, 0.0, 0.02), (0.6, 0.1, 0.3)))
E1_LARGE = bilinear(exponential(0.1833), exponential(0.03))


@dataclass(frozen=True)
class Study:
    """Runs a case, seed and number type."""

    runs: int
    seed: int
    real: str = "f64"

    def of(self, plant: Plant, degree: int, bounded: bool = False, levels: Levels | None = None, **case: Any) -> Outcome:
        """One experiment."""
        tables: Tables = make(plant, degree, bounded)
        return run(library(self.real), tables, Case(**case), self.runs, self.seed, levels)


def linear(study: Study) -> Iterator[Check]:
    """A linear plant with normal noise: the Kalman filter."""
    for degree in (1, 2, 3):
        for i, ratio in enumerate(study.of(suspension("gauss", cubic=0.0), degree).ratio()):
            yield Check(f"linear, normal, degree {degree}: MSE of x{i + 1} over the Kalman filter's", ratio, 1 - 1e-4, 1 + 1e-4)


def errors(study: Study) -> Iterator[Check]:
    """MSE over the extended Kalman filter's."""
    cases = (
        ("E2 atoms", suspension("atoms"), 2, (0.5, 0.72), (0.85, 0.98)),
        ("E2 atoms", suspension("atoms"), 3, (0.2, 0.42), (0.7, 0.9)),
        ("E2 exp", suspension("exp"), 2, (0.5, 0.72), (0.85, 0.98)),
        ("E2 exp", suspension("exp"), 3, (0.5, 0.68), (0.85, 0.96)),
        ("E2 gauss", suspension("gauss"), 2, (0.995, 1.005), (0.995, 1.005)),
        ("E2 gauss", suspension("gauss"), 3, (0.995, 1.005), (0.995, 1.005)),
        ("E3 atoms", suspension("atoms", quadratic=0.35), 2, (0.5, 0.72), (0.85, 0.98)),
        ("E3 exp", suspension("exp", quadratic=0.35), 2, (0.5, 0.75), (0.85, 0.98)),
        ("E3 gauss", suspension("gauss", quadratic=0.35), 2, (0.97, 1.02), (0.98, 1.02)),
        ("E1 atoms", E1_ATOMS, 2, (0.5, 0.93), (0.5, 0.84)),
        ("E1 large exp", E1_LARGE, 2, (0.9, 1.0), (0.9, 1.0)),
    )
    for name, plant, degree, *ranges in cases:
        found = study.of(plant, degree)
        for i, (ratio, (low, high)) in enumerate(zip(found.ratio(), ranges, strict=True)):
            yield Check(f"{name}, degree {degree}: MSE of x{i + 1} over the EKF's", ratio, low, high)
        yield Check(f"{name}, degree {degree}: runs begun again", found.restarts, 0, 0)


def bounds(study: Study) -> Iterator[Check]:
    """E e^2 over what the filter says, with the remainder's bound; and what the bound costs."""
    for name, plant in (("E2 atoms", suspension("atoms")), ("E2 exp", suspension("exp")), ("E3 atoms", suspension("atoms", quadratic=0.35)), ("E1 large exp", E1_LARGE)):
        found = study.of(plant, 2, bounded=True)
        for i, share in enumerate(found.consistency()):
            yield Check(f"{name}, degree 2 bounded: E e^2 / P of x{i + 1}", share, 0.2, 1.0)
    costly = study.of(suspension("atoms", quadratic=0.35), 2, bounded=True).ratio()[0]
    yield Check("E3 atoms, degree 2 bounded: the bound costs more than the powers gain (control)", costly, 1.0, 1.4)


def detection(study: Study) -> Iterator[Check]:
    """False alarms at kappa = J2 = 4.47 and at 3 standard deviations of the drift; an abrupt fault of the sensor, a slow one of the actuator."""
    for shape, miss, delay in (("atoms", 0.02, 1.0), ("exp", 0.2, 20.0), ("gauss", 0.02, 1.0)):
        found = study.of(suspension(shape), 2, **SENSOR)
        yield Check(f"E2 {shape}, degree 2: false alarms a sample, plain", found.alarms[PLAIN], 0.0, 0.05)
        yield Check(f"E2 {shape}, degree 2: false alarms a sample, joint", found.alarms[JOINT], 0.0, 0.05)
        yield Check(f"E2 {shape}, degree 2: sensor fault of 4 sigma missed, joint", found.missed(JOINT), 0.0, miss)
        yield Check(f"E2 {shape}, degree 2: samples until it is seen, median, joint", found.delay(JOINT), 0.0, delay)
        slow = study.of(suspension(shape), 2, **ACTUATOR)
        yield Check(f"E2 {shape}: false alarms a sample, drift", slow.alarms[DRIFT], 0.0, 0.01)
        yield Check(f"E2 {shape}: actuator fault missed, drift", slow.missed(DRIFT), 0.0, 0.2)
        yield Check(f"E2 {shape}: samples until it is seen, median, drift", slow.delay(DRIFT), 0.0, 60.0)
    found = study.of(suspension("atoms"), 2, **SENSOR)
    yield Check("E2 atoms: the sensor fault missed, plain (control: Chebyshev's threshold is far off)", found.missed(PLAIN), 0.5, 1.0)


def promises(study: Study) -> Iterator[Check]:
    """False alarms a sample, which Chebyshev's inequality bounds whatever the noise: at most, with CONFIDENCE, by Student's t over independent blocks of runs."""
    for shape in SHAPES:
        plant = shaken(shape)
        each = [Study(max(2, study.runs // 10), study.seed + 1_000_003 * (1 + b), study.real).of(plant, 2, samples=300) for b in range(BLOCKS)]
        for i, share in enumerate(np.mean([found.consistency() for found in each], axis=0)):
            yield Check(f"E2 {shape}, degree 2: E e^2 / P of x{i + 1}", float(share), 0.9, 1.1)
        for name, statistic, promised in (("plain", PLAIN, 1.0 / LEVELS.kappa**2), ("joint", JOINT, 2.0 / LEVELS.joint)):
            shares = [found.alarms[statistic] for found in each]
            most = np.mean(shares) + student_t.ppf(CONFIDENCE, BLOCKS - 1) * np.std(shares, ddof=1) / BLOCKS**0.5
            yield Check(f"E2 {shape}, degree 2: false alarms a sample, {name}, at most ({100 * CONFIDENCE:g} %)", float(most), 0.0, promised)
    trusting = study.of(suspension("exp"), 2, levels=Levels(kappa=LEVELS.kappa / 4.0), samples=300).alarms[PLAIN]
    yield Check("E2 exp, degree 2: false alarms a sample, plain, with a quarter of the threshold (control)", trusting, 1.0 / LEVELS.kappa**2, 1.0)


def shaken(shape: str) -> Plant:
    """E2 with any noise: a shock of 25 deviations, which Student's t brings, is more than the spring's Euler step survives, so it is the sensor's alone."""
    return suspension(shape, driving="laplace" if shape == "student" else None)


def abrupt(study: Study) -> Iterator[Check]:
    """A sensor fault of four standard deviations, either way, with any noise: one of the statistics sees it; where four deviations are nothing rare, joint alone may miss it."""
    for shape in SHAPES:
        for size in (0.8, -0.8):
            found = study.of(shaken(shape), 2, fault="sensor", fault_at=AT, size=(size,))
            at = np.where(found.first < 0, found.case.samples, found.first).min(axis=1)
            yield Check(f"E2 {shape}, degree 2: sensor fault of {size:+g} missed by all statistics", float((at == found.case.samples).mean()), 0.0, 0.02)
            yield Check(f"E2 {shape}, degree 2: sensor fault of {size:+g}, samples until one sees it, median", float(np.median(at)), 0.0, 1.0)
            yield Check(f"E2 {shape}, degree 2: sensor fault of {size:+g} missed, joint", found.missed(JOINT), 0.0, 0.2 if shape in HEAVY else 0.02)
            early = found.first[:, JOINT]
            yield Check(f"E2 {shape}, degree 2: sensor fault of {size:+g} seen within 5 samples, joint", float(((early >= 0) & (early <= 5)).mean()), EARLY[shape], 1.0)


def events(study: Study) -> Iterator[Check]:
    """Send-on-delta of half a standard deviation: silence as value and radius, and as if the value held were a measurement."""
    delta = 0.1
    found = study.of(suspension("exp"), 2, delta=delta)
    trusting = study.of(suspension("exp"), 2, levels=Levels(fresh=delta), delta=delta)
    yield Check("E2 exp, send-on-delta 0.1: share of values sent", found.sent, 0.4, 0.8)
    for i, share in enumerate(found.consistency()):
        yield Check(f"the same: E e^2 / P of x{i + 1}", share, 0.2, 1.1)
    for i, name in enumerate(("plain", "joint")):
        yield Check(f"the same: false alarms a sample, {name}", found.alarms[i], 0.0, 0.05)
    yield Check("the same: MSE of x1 over that of held values taken for measurements, the price", found.mse()[0] / trusting.mse()[0], 0.0, 1.4)
    yield Check("held values taken for measurements: E e^2 / P of x1 over that with radius (control)", trusting.consistency()[0] / found.consistency()[0], 1.05, 9.0)


def precision(study: Study) -> Iterator[Check]:
    """The same runs in float32."""
    for degree in (2, 3):
        narrow = Study(study.runs, study.seed, "f32").of(suspension("exp"), degree).mse()
        yield Check(f"E2 exp, degree {degree}: MSE of x1, float32 over float64", narrow[0] / study.of(suspension("exp"), degree).mse()[0], 0.999, 1.001)


def all_checks(runs: int, seed: int) -> Iterator[Check]:
    """Everything."""
    study = Study(runs, seed)
    for part in (linear, errors, bounds, detection, promises, abrupt, events, precision):
        yield from part(study)
