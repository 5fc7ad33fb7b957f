"""Polynomial filters as the C structures they are, and batches of runs of them (core/polynomial_run.h)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hullguard.core.kept import Kept
from hullguard.core.library import Library
from hullguard.design.polynomial import Map, Noise, Tables
from hullguard.errors import InputError
from hullguard.model.table import Array

KINDS = {"normal": 1, "exponential": 2, "uniform": 3, "atoms": 4, "laplace": 5, "student": 6, "contaminated": 7}
FAULTS = {"good": 0, "actuator": 1, "sensor": 2}
PLAIN, JOINT, DRIFT = 0, 1, 2  # places of the statistics; bits of hg_polynomial_judgement.above
FAR = 1e6  # range of a measurement and of the remainder where nothing else is said, signal units


@dataclass(frozen=True)
class Levels:
    """What hg_polynomial_config says of decisions. Squares where the library takes squares."""

    kappa: float = 4.47  # 1 / sqrt(5 %)
    joint: float = 4.47**2
    weight: float = 0.1
    drift: float = 9.0
    reach: float = 3.0
    fresh: float = 0.0  # of every output


class Native(Kept):
    """Filter configurations in one library."""

    def array(self, kind: str, values: Any) -> Any:
        """An array of numbers of this type."""
        whole = kind.startswith("uint")
        return self.new(f"{kind}[]", [int(v) if whole else float(v) for v in np.ravel(np.asarray(values))] or [0])

    def map(self, place: Any, made: Map) -> None:
        """Fill in an hg_polynomial_map."""
        place.width, place.end = made.width, self.array("uint16_t", made.end)
        place.coefficient, place.factor = self.array("hg_real", made.coefficient), self.array("uint8_t", made.factor)

    def filter(self, tables: Tables, levels: Levels) -> Any:
        """An hg_polynomial_config."""
        c, plant, n, p = self.new("hg_polynomial_config *"), tables.plant, tables.plant.states, tables.plant.outputs
        c.states, c.outputs, c.degree, c.bounded = n, p, tables.degree, tables.bounded
        for name, value in tables.sizes.items():
            setattr(c, name, value)
        self.map(c.f, tables.f)
        self.map(c.h, tables.h)
        for name in ("start", "product"):
            setattr(c, name, self.array("uint16_t", getattr(tables, name)))
        for name in ("parent", "factor", "noise", "moment", "cut_moment", "cut_state"):
            setattr(c, name, self.array("uint8_t", getattr(tables, name)))
        for name in ("mean", "covariance", "cut_scale", "M0"):
            setattr(c, name, self.array("hg_real", getattr(tables, name)))
        c.x0, c.P0 = self.array("hg_real", plant.x0), self.array("hg_real", np.diag(plant.P0))
        c.Q, c.R = (self.array("hg_real", [d.moment(2) for d in part]) for part in (plant.w, plant.v))
        c.box, c.range, c.fresh = (self.array("hg_real", [v] * k) for v, k in ((FAR, n), (FAR, p), (levels.fresh, p)))
        c.reach, c.kappa, c.joint, c.weight, c.drift = levels.reach, levels.kappa, levels.joint, levels.weight, levels.drift
        return c

    def noises(self, drive: Sequence[Noise]) -> Any:
        """An array of hgh_polynomial_noise."""
        made = self.new("hgh_polynomial_noise[]", len(drive))
        for place, noise in zip(made, drive, strict=True):
            place.kind, place.scale, place.atoms = KINDS[noise.kind], noise.scale, len(noise.values)
            place.value, place.below = self.array("double", noise.values), self.array("double", np.cumsum(noise.weights))
        return made


class Node:
    """One hg_polynomial in this process."""

    def __init__(self, library: Library, tables: Tables, levels: Levels | None = None) -> None:
        self._native, self._n, self._N = Native(library), tables.plant.states, tables.sizes["lifted"]
        self._lib, self._ffi = library.lib, library.ffi
        self.config = self._native.filter(tables, levels or Levels())
        self.node = self._native.new("hg_polynomial *")
        status = self._lib.hg_polynomial_start(self.node, self.config, self._native.new("hg_real[]", tables.reals), tables.reals)
        if status != self._lib.HG_OK:
            raise InputError(f"polynomial: the library refused the configuration (status {status})")

    def step(self, y: Sequence[float] | Array, radius: Sequence[float] | Array | None = None) -> int:
        """One sample, y [p], radius [p] or none; the library's status."""
        wide = [0.0] * len(y) if radius is None else radius
        return int(self._lib.hg_polynomial_step(self.node, [float(v) for v in y], [float(v) for v in wide]))

    def vector(self, name: str, size: int | None = None) -> Array:
        """A field of hg_polynomial, [n] unless said."""
        return np.array(self._ffi.unpack(getattr(self.node, name), size or self._n), dtype=float)

    def matrix(self, name: str, size: int | None = None) -> Array:
        """A square one, [n, n] unless said."""
        k = size or self._n
        return self.vector(name, k * k).reshape(k, k)

    @property
    def judgement(self) -> Any:
        """hg_polynomial_judgement of the last sample."""
        return self.node.judgement


@dataclass(frozen=True)
class Case:
    """One experiment, all but filter and runs."""

    samples: int = 200
    skip: int = 20
    fault: str = "good"
    fault_at: int = 10**9
    size: tuple[float, ...] = ()  # [n] of an actuator fault, [p] of a sensor's
    delta: float = 0.0  # send-on-delta of all sensors; 0: every sample


@dataclass(frozen=True)
class Outcome:
    """What a batch has seen; arrays of all samples are means over its runs."""

    runs: int
    case: Case
    error2: Array  # [samples, n]
    ekf2: Array  # [samples, n] of the auxiliary filter
    variance: Array  # [samples, n]
    first: Array  # [runs, 3] samples from the fault to the first above its level, -1: none
    alarms: tuple[float, float, float]  # shares of the samples without a fault
    sent: float  # values an output and sample
    dropped: int
    held: int
    restarts: int

    def mse(self) -> Array:
        """[n] after the first samples."""
        return np.asarray(self.error2[self.case.skip :].mean(axis=0))

    def ratio(self) -> Array:
        """[n] mean squared error over the auxiliary filter's."""
        return np.asarray(self.mse() / self.ekf2[self.case.skip :].mean(axis=0))

    def consistency(self) -> Array:
        """[n] time mean of E e^2 / E P."""
        part = slice(self.case.skip, None)
        return np.asarray((self.error2[part] / self.variance[part]).mean(axis=0))

    def missed(self, statistic: int) -> float:
        """Share of the runs in which a fault was never seen."""
        return float((self.first[:, statistic] < 0).mean())

    def delay(self, statistic: int) -> float:
        """Median of samples until it was seen; one that was not counts as the longest."""
        at = self.first[:, statistic]
        return float(np.median(np.where(at < 0, self.case.samples, at)))


def run(library: Library, tables: Tables, case: Case, runs: int, seed: int, levels: Levels | None = None) -> Outcome:
    """Runs 0 .. runs - 1 of a case."""
    ffi, plant, native = library.ffi, tables.plant, Native(library)
    n, p = plant.states, plant.outputs
    c = native.new("hgh_polynomial_config *")
    c.config = native.filter(tables, levels or Levels())
    c.f, c.h = native.array("double", tables.f.coefficient), native.array("double", tables.h.coefficient)
    c.w, c.v = native.noises(plant.w), native.noises(plant.v)
    c.x0, c.p0 = native.array("double", plant.x0), native.array("double", np.sqrt(plant.P0))
    c.samples, c.skip, c.fault, c.fault_at, c.seed = case.samples, case.skip, FAULTS[case.fault], case.fault_at, seed
    c.size, c.delta = native.array("double", case.size), native.array("double", [case.delta] * p)
    arrays = {name: ffi.new("double[]", case.samples * n) for name in ("error2", "ekf2", "variance")}
    first = ffi.new("int64_t[]", runs * 3)
    result = ffi.new("hgh_polynomial_result *", {**arrays, "first": first})
    if not library.lib.hgh_polynomial_batch(c, 0, runs, result):
        raise InputError("polynomial: the library refused the configuration")
    error2, ekf2, variance = (np.array(ffi.unpack(a, case.samples * n)).reshape(case.samples, n) / runs for a in arrays.values())
    seen = np.array(ffi.unpack(first, runs * 3)).reshape(runs, 3)
    calm = runs * (min(case.samples, case.fault_at) - case.skip)
    plain, joint, drift = (a / calm for a in ffi.unpack(result.alarms, 3))
    at = np.where(seen < 0, -1, seen - case.fault_at)
    sent = result.sent / (runs * case.samples * p)
    return Outcome(runs, case, error2, ekf2, variance, at, (plain, joint, drift), sent, int(result.dropped), int(result.held), int(result.restarts))
