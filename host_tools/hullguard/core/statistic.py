"""Polynomial filters of a model as the C structures they are (statistic.h), one of them alone over recorded values and radii, and nonlinear plants of the emulator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hullguard.core.library import Library
from hullguard.core.polynomial import Native
from hullguard.design.statistic import FILTER_COUNTS, FILTER_NUMBERS, FILTER_PLACES, FILTER_ROWS, FILTER_WIDE, JUDGE_PLACES, JUDGE_ROWS, STATISTICS, MapTable, StatisticTable
from hullguard.errors import InputError
from hullguard.model.expression import Program
from hullguard.model.polynomial import Nonlinear
from hullguard.model.table import Array


def fill(library: Library, place: Any, table: StatisticTable) -> list[Any]:
    """Fill in an hg_statistic_config; the memory that its tables lie in."""
    native = Native(library)
    c = place.filter
    c.bounded = table.bounded
    for name in (*FILTER_COUNTS, *FILTER_NUMBERS):
        setattr(c, name, getattr(table, name))
    for name in FILTER_WIDE:
        setattr(c, name, native.array("uint16_t", getattr(table, name)))
    for name in FILTER_PLACES:
        setattr(c, name, native.array("uint8_t", getattr(table, name)))
    for name in FILTER_ROWS:
        setattr(c, name, native.array("hg_real", getattr(table, name)))
    for there, made in ((c.f, table.f), (c.h, table.h)):
        _map(native, there, made)
    place.inputs, place.settle = len(table.input), table.settle
    for name in JUDGE_PLACES:
        setattr(place, name, native.array("uint8_t", getattr(table, name)))
    for name in JUDGE_ROWS:
        setattr(place, name, native.array("hg_real", getattr(table, name)))
    return [native]


def _map(native: Native, place: Any, made: MapTable) -> None:
    place.width, place.end = made.width, native.array("uint16_t", made.end)
    place.coefficient, place.factor = native.array("hg_real", made.coefficient), native.array("uint8_t", made.factor)


@dataclass(frozen=True)
class FilterRun:
    """What a filter makes of a run, sample by sample."""

    x: Array  # samples x states, physical units
    variance: Array  # samples x states, physical units squared
    r: Array  # samples x 3
    J: Array  # samples x 3
    ready: Array  # samples: 1 where its alarms count
    restarts: int  # times that it began again for a number that was not finite


def follow(library: Library, table: StatisticTable, value: Array, radius: Array) -> FilterRun:
    """A filter over values and radii of the whole signal vector (samples x width), which no decision hears."""
    ffi, lib, n = library.ffi, library.lib, table.states
    config, self = ffi.new("hg_statistic_config *"), ffi.new("hg_statistic *")
    kept = fill(library, config, table)
    memory = ffi.new("hg_real[]", table.reals)
    if lib.hg_statistic_start(self, config, memory) != lib.HG_OK:
        raise InputError("the library refused the tables of a polynomial filter")
    unit, point = np.array(table.unit), np.array(table.point)
    r, J = ffi.new("hg_real[]", len(STATISTICS)), ffi.new("hg_real[]", len(STATISTICS))
    rows: dict[str, list[Any]] = {name: [] for name in ("x", "variance", "r", "J", "ready")}
    for v, w in zip(value, radius, strict=True):
        lib.hg_statistic_step(self, v.tolist(), w.tolist(), r, J)
        rows["x"].append(point + unit * ffi.unpack(self.filter.x, n))
        rows["variance"].append(unit**2 * np.array(ffi.unpack(self.filter.Px, n * n))[:: n + 1])
        rows["r"].append(ffi.unpack(r, len(STATISTICS)))
        rows["J"].append(ffi.unpack(J, len(STATISTICS)))
        rows["ready"].append(float(lib.hg_statistic_ready(self)))
    del kept
    x, variance, shown, level, ready = (np.array(row, dtype=float) for row in rows.values())
    return FilterRun(x, variance, shown, level, ready, int(self.filter.restarts))


def emulated_plant(library: Library, plant: Nonlinear) -> tuple[Any, list[Any]]:
    """An hgh_nonlinear, and the memory that it lies in."""
    native = Native(library)
    made = native.new("hgh_nonlinear *")
    made.f, made.h = _programs(native, plant.f), _programs(native, plant.h)
    made.w, made.v = native.noises(plant.w), native.noises(plant.v)
    made.x0, made.p0 = native.array("double", plant.mean), native.array("double", plant.deviation)
    return made, [native]


def _programs(native: Native, rows: Sequence[Program]) -> Any:
    made = native.new("hgh_program[]", len(rows))
    for place, row in zip(made, rows, strict=True):
        place.length = len(row.code)
        place.code = native.new("int32_t[]", [x for pair in row.code for x in pair])
        place.constant = native.array("double", row.constants)
    return made
