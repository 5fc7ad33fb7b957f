"""Fusion filters as the C structures they are, and batches of runs of them (core/fusion_run.h)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hullguard.core.kept import Kept
from hullguard.core.library import Library
from hullguard.design.fusion import LOSS_RATES, Fusion, TriggerTable
from hullguard.errors import InputError
from hullguard.model.table import Array

TRIGGERS = {"observation": 1, "innovation": 2, "stochastic": 3, "scheduled": 4, "own": 5}
SENDERS = {"trigger": 1, "always": 2, "random": 3, "decimated": 4}
LOSSY = {"all": 1, "centre": 2}
FAULTS = {"good": 0, "dead": 1, "bias": 2, "freeze": 3}
FAR = 1e6  # range of a measurement where nothing else is said, signal units


@dataclass(frozen=True)
class Filter:
    """What hg_fusion_config says beside the plant."""

    tables: tuple[TriggerTable, ...]
    trigger: str = "innovation"
    depth: int = 0
    delay: int = 0
    heartbeat: int = 10
    watchdog: int = 30
    huber: float = 0.0
    origin: tuple[float, ...] = ()  # [n] steps; empty: none
    loss: float = 0.05  # rate to begin with
    smoothing: float = 1.0 / 128.0
    rows: bool = False  # dense rows even where a selection would do


class Native(Kept):
    """Filter configurations in one library."""

    def reals(self, values: Any) -> Any:
        """An array of hg_real."""
        return self.new("hg_real[]", [float(v) for v in np.ravel(np.array(values, dtype=float))] or [0.0])

    def doubles(self, values: Any) -> Any:
        """An array of double."""
        return self.new("double[]", [float(v) for v in np.ravel(np.array(values, dtype=float))] or [0.0])

    def filter(self, model: Fusion, chosen: Filter) -> Any:
        """An hg_fusion_config."""
        c = self.new("hg_fusion_config *")
        c.states, c.inputs, c.sensors = model.states, 0, model.sensors
        c.depth, c.delay, c.heartbeat, c.watchdog, c.modulus = chosen.depth, chosen.delay, chosen.heartbeat, chosen.watchdog, 16
        c.trigger = TRIGGERS[chosen.trigger]
        c.A, c.Q, c.x0, c.P0 = self.reals(model.A), self.reals(model.Q), self.reals(model.x0), self.reals(model.P0)
        places = np.argmax(model.C, axis=1)
        if not chosen.rows and np.array_equal(model.C, np.eye(model.states)[places]):
            c.select = self.new("uint8_t[]", [int(p) for p in places])
        else:
            c.C = self.reals(model.C)
        c.R, c.range, c.huber = self.reals(model.R), self.reals([FAR] * model.sensors), chosen.huber
        if chosen.origin:
            c.origin = self.reals(chosen.origin)
        c.rates, c.rate_step, c.smoothing = len(LOSS_RATES), LOSS_RATES[1], chosen.smoothing
        c.loss = chosen.loss
        tables = self.new("hg_fusion_table[]", len(chosen.tables))
        c.tables, c.table = len(chosen.tables), tables
        for place, table in zip(tables, chosen.tables, strict=True):
            place.alive, place.level = table.alive, self.reals(table.level)
            place.relax, place.early = self.reals(table.relax), self.reals(table.early)
        return c


class Node:
    """One hg_fusion in this process. Vectors are [n], [m] arrays; P is [n, n]."""

    def __init__(self, library: Library, model: Fusion, chosen: Filter) -> None:
        self._native = Native(library)
        self._lib, new = library.lib, self._native.new
        self.config = self._native.filter(model, chosen)
        n, m, slots = model.states, model.sensors, chosen.depth + 1
        self._n = n
        memory = new("hg_fusion_memory *")
        memory.slot, memory.entry = new("hg_fusion_slot[]", slots), new("hg_fusion_entry[]", slots * m)
        memory.sensor, memory.record, memory.origin = new("hg_fusion_sensor[]", m), new("hg_fusion_record[]", m), new("int32_t[]", n)
        memory.real = new("hg_real[]", slots * (n * (n + 2)) + n * (3 * n + 5 + m))
        self._ffi, self.node, self._none = library.ffi, new("hg_fusion *"), new("hg_real[]", 1)
        status = self._lib.hg_fusion_start(self.node, self.config, memory)
        if status != self._lib.HG_OK:
            raise InputError(f"fusion: the library refused the configuration (status {status})")

    def open(self) -> None:
        """Predict the next sample."""
        if self._lib.hg_fusion_open(self.node, self._none) != self._lib.HG_OK:
            raise InputError("fusion: the sample before is still open; close it first")

    def due(self, sensor: int, y: float, dice: float = 0.0) -> bool:
        """Whether the sensor has to speak."""
        return bool(self._lib.hg_fusion_due(self.node, sensor, y, dice) == self._lib.HG_OK)

    def receive(self, sensor: int, stamp: int, counter: int, y: float) -> int:
        """Book a frame; the library's status."""
        return int(self._lib.hg_fusion_receive(self.node, sensor, stamp % 16, counter % 16, y))

    def close(self) -> int:
        """Filter in what is booked; the library's status."""
        return int(self._lib.hg_fusion_close(self.node))

    @property
    def x(self) -> Array:
        """Estimate, relative to the local origin."""
        return np.array(self._ffi.unpack(self.node.x, self._n), dtype=float)

    @property
    def P(self) -> Array:
        """Its covariance."""
        return np.array(self._ffi.unpack(self.node.P, self._n * self._n), dtype=float).reshape(self._n, self._n)


@dataclass(frozen=True)
class Judge:
    """What hg_consistency_config says."""

    onsets: int = 25
    stride: int = 2
    least: float = 2.5  # standard deviations of each sensor
    limit: float = 24.0
    confirm: int = 10
    repeats: int = 3
    rest: int = 50


@dataclass(frozen=True)
class Windows:
    """Sensors that send by their own variance trigger."""

    window: int
    detrended: bool
    level: tuple[int, ...]  # [m] codes squared
    converter: float  # resolution, signal units


@dataclass(frozen=True)
class Case:
    """One experiment, all but filter and runs."""

    samples: int = 400
    skip: int = 100
    nodes: int = 1  # 1: one filter for all; 2: centre and one for all sensors; m + 1: one each
    send: str = "trigger"
    rate: tuple[float, ...] = ()  # [m] of random and decimated sending
    lossy: str = "all"
    loss: float = 0.0
    late: float = 0.0
    recall: bool = False
    resolution: float = 0.0  # 0: float32 on the wire
    outlier: float = 0.0
    outlier_size: float = 20.0
    jump_at: int = -1
    jump: tuple[float, ...] = ()
    fault: str = "good"
    fault_sensor: int = 0
    fault_at: int = 0
    fault_size: float = 0.0
    exclude: bool = False
    judge: Judge | None = None
    windows: Windows | None = None
    q: tuple[float, ...] = ()  # [n] true standard deviations of the plant's noise; empty: the model's
    sigma: tuple[float, ...] = ()  # [m] true ones of the sensors


@dataclass(frozen=True)
class Outcome:
    """What a batch has seen; arrays of all samples are means over its runs."""

    runs: int
    skip: int
    error2: Array  # [samples, n]
    nees: Array  # [samples]
    rates: Array  # [m] frames a sample
    bits: float  # on the wire, a sensor and sample
    blamed_at: tuple[int, ...]  # [runs]
    blamed: tuple[int, ...]
    blames: int
    unequal: int
    hash: int
    origins: int
    resets: int
    largest: float

    def rms(self, states: Sequence[int], first: int | None = None, last: int | None = None) -> float:
        """Root of the sum of these states' mean squared errors in samples first .. last - 1, by default all that count."""
        part = self.error2[self.skip if first is None else first : last, list(states)]
        return float(np.sqrt(part.mean(axis=0).sum()))

    @property
    def rate(self) -> float:
        """Frames a sensor and sample."""
        return float(self.rates.mean())

    @property
    def consistency(self) -> float:
        """Time mean of the NEES over the samples that count."""
        return float(self.nees[self.skip :].mean())

    def inside(self, states: int) -> float:
        """Share of the samples whose mean NEES is within the 95 % band of a consistent filter: n +- 1.96 sqrt(2 n / runs)."""
        band = 1.96 * np.sqrt(2.0 * states / self.runs)
        return float((np.abs(self.nees[self.skip :] - states) <= band).mean())


@dataclass
class Bench:
    """A plant and a library to run filters in."""

    library: Library
    model: Fusion
    native: Native = field(init=False)

    def __post_init__(self) -> None:
        self.native = Native(self.library)

    def _case(self, centre: Filter, sensor: Filter, case: Case, seed: int) -> Any:
        new, model = self.native, self.model
        c = new.new("hgh_fusion_config *")
        c.centre, c.sensor = new.filter(model, centre), new.filter(model, sensor)
        if case.judge is not None:
            j = c.consistency = new.new("hg_consistency_config *")
            j.onsets, j.stride, j.limit = case.judge.onsets, case.judge.stride, case.judge.limit
            j.least = new.reals(case.judge.least * np.sqrt(model.R))
            j.confirm, j.repeats, j.rest = case.judge.confirm, case.judge.repeats, case.judge.rest
        if case.windows is not None:
            windows = new.new("hg_variance_config[]", model.sensors)
            c.variance, c.converter = windows, case.windows.converter
            for place, level in zip(windows, case.windows.level, strict=True):
                place.window, place.detrended, place.level = case.windows.window, case.windows.detrended, level
        c.nodes, c.A, c.C = case.nodes, new.doubles(model.A), new.doubles(model.C)
        c.q = new.doubles(case.q or np.sqrt(np.diag(model.Q)))
        c.sigma = new.doubles(case.sigma or np.sqrt(model.R))
        c.x0, c.p0 = new.doubles(model.x0), new.doubles(np.sqrt(np.diag(model.P0)))
        c.samples, c.skip, c.send = case.samples, case.skip, SENDERS[case.send]
        if case.rate:
            c.rate = new.doubles(case.rate)
        c.lossy, c.loss, c.late, c.recall, c.resolution = LOSSY[case.lossy], case.loss, case.late, case.recall, case.resolution
        c.outlier, c.outlier_size, c.jump_at = case.outlier, case.outlier_size, case.jump_at
        if case.jump:
            c.jump = new.doubles(case.jump)
        c.fault, c.fault_sensor, c.fault_at, c.fault_size = FAULTS[case.fault], case.fault_sensor, case.fault_at, case.fault_size
        c.exclude, c.seed = case.exclude, seed
        return c

    def run(self, centre: Filter, case: Case, runs: int, seed: int, sensor: Filter | None = None) -> Outcome:
        """Runs 0 .. runs - 1 of a case; `sensor`: the filter of the sensors' nodes, where it is not the centre's."""
        ffi, n, m = self.library.ffi, self.model.states, self.model.sensors
        c = self._case(centre, sensor or centre, case, seed)
        arrays = {
            "error2": ffi.new("double[]", case.samples * n),
            "nees": ffi.new("double[]", case.samples),
            "sent": ffi.new("double[]", m),
            "blamed_at": ffi.new("int64_t[]", runs),
            "blamed": ffi.new("int32_t[]", runs),
        }
        result = ffi.new("hgh_fusion_result *", arrays)
        if not self.library.lib.hgh_fusion_batch(c, 0, runs, result):
            raise InputError("fusion: the library refused the configuration")
        counted = runs * (case.samples - case.skip)
        return Outcome(
            runs,
            case.skip,
            np.array(ffi.unpack(result.error2, case.samples * n)).reshape(case.samples, n) / runs,
            np.array(ffi.unpack(result.nees, case.samples)) / runs,
            np.array(ffi.unpack(result.sent, m)) / counted,
            float(result.bits) / (counted * m),
            tuple(ffi.unpack(result.blamed_at, runs)),
            tuple(ffi.unpack(result.blamed, runs)),
            int(result.blames),
            int(result.unequal),
            int(result.hash),
            int(result.origins),
            int(result.resets),
            float(result.largest),
        )
