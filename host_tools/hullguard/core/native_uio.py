"""The library's unknown-input observer (uio.h) and what its estimates stand for (isolate.h), run over recorded signals in one call."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from hullguard.core.library import Library
from hullguard.design.tables import blocks
from hullguard.errors import InputError
from hullguard.model.table import Array

CAUSES = ("undecided", "input", "actuator", "component", "sensor", "ambiguous")  # hg_cause


def _record(real: str) -> np.dtype[Any]:
    """hg_isolation as numpy has it."""
    number = np.float32 if real == "f32" else np.float64
    return np.dtype([("cause", np.int32), ("basis", np.int32), ("candidates", np.uint32), ("explained", number), ("ratio", number)], align=True)


def _none(*shape: int) -> Array:
    return np.zeros(shape)


@dataclass(frozen=True)
class UioTable:
    """hg_uio_config: what its fields are called there, as arrays; without weights all radii are the bias alone."""

    actuators: int
    sensors: int
    unknown: int
    states: int
    signal: tuple[int, ...]  # places of the signals read
    state: Array  # order x order
    input: Array  # order x width
    output: Array  # estimates x order
    direct: Array  # estimates x width
    wide: tuple[int, ...] = (0,)  # places of the signals whose radii are read
    weight: Array = field(default_factory=lambda: _none(1, 1, 1))  # taps x estimates x radii
    rest: Array = field(default_factory=lambda: _none(1, 1))  # settle x estimates
    moving: Array = field(default_factory=lambda: _none(1, 1))  # settle x estimates
    ready_rest: int = 0
    ready_moving: int = 0
    mode_decay: Array = field(default_factory=lambda: _none(0))  # modes
    mode_input: Array = field(default_factory=lambda: _none(0))  # modes x radii
    mode_output: Array = field(default_factory=lambda: _none(0))  # estimates x modes
    mode_rest: Array = field(default_factory=lambda: _none(0))  # modes
    mode_moving: Array = field(default_factory=lambda: _none(0))  # modes
    exponents: tuple[int, int, int] = (0, 0, 0)  # of fixed point: of state and input, of output and direct, of weight and modes
    units: tuple[int, ...] = ()  # of fixed point: numbers are times 2^unit; estimates and radii
    signal_units: tuple[int, ...] = ()  # the whole signal vector

    @property
    def taps(self) -> tuple[int, ...]:
        """Of each radius."""
        return (len(self.weight),) * len(self.wide)

    @property
    def blocks(self) -> list[tuple[int, int, list[list[float]]]]:
        """The weights as they lie in memory; behind them there are modes, and no tail."""
        weight = np.broadcast_to(self.weight, (len(self.weight), self.estimates, len(self.wide)))
        return blocks(weight.tolist(), self.taps, np.zeros((self.estimates, len(self.wide))).tolist())

    @property
    def bias(self) -> Array:
        """From the last row of the bias tables on."""
        return np.asarray(np.maximum(*(np.broadcast_to(rows[-1], self.estimates) for rows in (self.rest, self.moving))))

    @property
    def estimates(self) -> int:
        """Rows of estimates and radii."""
        return len(self.output)


@dataclass(frozen=True)
class IsolateTable:
    """hg_isolate_config."""

    actuator: int
    limit: float
    sensor: tuple[int, ...]
    sensor_limit: tuple[float, ...]
    whole: Array  # components x estimates
    excitation: Array  # components
    low_pass: float
    settle: int
    release: int
    block: int
    blocks: int
    explained: float = 0.9
    steady: float = 5.0


@dataclass(frozen=True)
class UioRun:
    """What came out, sample by sample."""

    estimate: Array  # samples x estimates
    radius: Array  # samples x estimates
    cause: npt.NDArray[np.int32]  # samples: places in CAUSES
    candidates: npt.NDArray[np.uint32]  # samples: bit 0 the actuator, then the components, then the sensors
    explained: Array  # samples: R^2 of all components together
    refused: int  # samples that the library refused


class Uio:
    """One observer in this process, with isolation beside it if there is a table for it; goes on where the last run ended.

    In fixed point a radius of HG_REAL_MAX, of which nothing is known, is the largest double.
    """

    def __init__(self, library: Library, table: UioTable, isolate: IsolateTable | None = None, width: int | None = None, moving: bool = False) -> None:
        self._library, self._table, self._isolate = library, table, isolate
        self._keep: list[Any] = []
        ffi, lib = library.ffi, library.lib
        if (library.real == "q31") != bool(table.units):
            raise InputError("the tables of the unknown-input observer are for another number type; take those of uio_table() for this one")
        if isolate is not None and library.real == "q31":
            raise InputError("isolation is for the float types: it divides data of any ratio; use float32")
        self._width = max(*table.signal, *table.wide) + 1 if width is None else width
        config = self._new("hgh_uio_config *")
        self.config = self._observer(table)
        config.uio, config.width, config.history = self.config, self._width, len(table.weight) + 1
        config.unit = self._new("int32_t[]", list(table.signal_units) or [0] * self._width)
        config.estimate_unit = self._new("int32_t[]", list(table.units) or [0] * table.estimates)
        self.isolation = ffi.NULL if isolate is None else self._isolation(isolate, table.estimates)
        config.isolate = self.isolation
        config.start = lib.HG_START_MOVING if moving else lib.HG_START_REST
        self._self = ffi.gc(lib.hgh_uio_new(config), lib.hgh_uio_free)
        if not self._self:
            raise InputError("the library refused the tables of the unknown-input observer: shapes that contradict one another, or a decay of 1 or more")

    def _new(self, kind: str, value: Any = None) -> Any:
        self._keep.append(self._library.ffi.new(kind, value))
        return self._keep[-1]

    def _reals(self, values: Any) -> Any:
        numbers: list[Any] = np.ravel(np.asarray(values, dtype=float)).tolist() or [0.0]
        return self._new("hg_real[]", [min(round(x * 2**31), 2**31 - 1) for x in numbers] if self._library.real == "q31" else numbers)

    def _places(self, values: tuple[int, ...]) -> Any:
        return self._new("uint8_t[]", list(values) or [0])

    def _observer(self, t: UioTable) -> Any:
        c = self._new("hg_uio_config *")
        c.actuators, c.sensors, c.unknown, c.states = t.actuators, t.sensors, t.unknown, t.states
        o, h = c.observer, c.hull
        o.order, o.residuals, o.width, o.signal = len(t.state), t.estimates, len(t.signal), self._places(t.signal)
        for place, matrix in ((o.state, t.state), (o.input, t.input), (o.output, t.output), (o.direct, t.direct)):
            exponent = t.exponents[0] if matrix is t.state or matrix is t.input else t.exponents[1]
            place.rows, place.cols, place.exponent, place.data = *matrix.shape, exponent, self._reals(matrix)
        h.exponent = t.exponents[2]
        h.residuals, h.width, h.signal, h.taps = t.estimates, len(t.wide), self._places(t.wide), self._places(t.taps)
        h.weight, h.settle = self._reals([x for _, _, block in t.blocks for row in block for x in row]), len(t.rest)
        h.rest, h.moving = (self._reals(np.broadcast_to(bias, (len(t.rest), t.estimates))) for bias in (t.rest, t.moving))
        h.ready_rest, h.ready_moving, h.bias = t.ready_rest, t.ready_moving, self._reals(t.bias)
        none = self._reals(np.zeros(t.estimates))
        h.decay, h.rest_left, h.moving_left = none, none, none
        h.modes = len(t.mode_decay)
        for name in ("mode_decay", "mode_input", "mode_output", "mode_rest", "mode_moving"):
            setattr(h, name, self._reals(getattr(t, name)))
        return c

    def _isolation(self, t: IsolateTable, estimates: int) -> Any:
        c = self._new("hg_isolate_config *")
        c.estimates, c.actuator, c.limit = estimates, t.actuator, t.limit
        c.sensors, c.sensor, c.sensor_limit = len(t.sensor), self._places(t.sensor), self._reals(t.sensor_limit)
        c.components, c.whole, c.excitation = len(t.whole), self._reals(t.whole), self._reals(t.excitation)
        c.low_pass, c.settle, c.release, c.block, c.blocks = t.low_pass, t.settle, t.release, t.block, t.blocks
        c.explained, c.steady = t.explained, t.steady
        return c

    def run(self, value: Array, radius: Array | None = None) -> UioRun:
        """All samples of the signal vector and its radii (samples x width each; no radius: 0). Numbers are rounded to the library's type."""
        lib, ffi, count, n = self._library.lib, self._library.ffi, len(value), self._table.estimates
        signals = np.ascontiguousarray(value, dtype=np.float64)
        wide = None if radius is None else np.ascontiguousarray(radius, dtype=np.float64)
        if signals.shape != (count, self._width) or (wide is not None and wide.shape != signals.shape):
            raise InputError(f"values and radii of shape {signals.shape}: expected samples x {self._width}")
        estimate, bound = np.empty((count, n)), np.empty((count, n))
        given = ffi.NULL if wide is None else ffi.from_buffer("double[]", wide)
        out = [ffi.from_buffer("double[]", made) for made in (estimate, bound)]
        found = ffi.NULL if self._library.real == "q31" else ffi.new("hg_isolation[]", max(count, 1))
        taken = lib.hgh_uio_steps(self._self, ffi.from_buffer("double[]", signals), given, count, *out, found)
        kind = _record(self._library.real)
        record = np.frombuffer(ffi.buffer(found), dtype=kind)[:count] if found else np.zeros(count, dtype=kind)
        return UioRun(estimate, bound, record["cause"].copy(), record["candidates"].copy(), record["explained"].astype(float), count - int(taken))

    @property
    def share(self) -> list[float]:
        """Offset, then the share of each component, of the last window that was judged."""
        return list(self._library.ffi.unpack(self._library.lib.hgh_uio_share(self._self), len(self._isolate.whole) + 1)) if self._isolate is not None else []
