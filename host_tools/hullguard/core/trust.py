"""What generated files say of themselves, asked of the C library in each number type: the digest of a model's tables (digest.h) and the self-test's drive (selftest.h)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from math import prod
from typing import Any

import numpy as np

from hullguard.core.library import REALS, Library, library
from hullguard.core.native import MOVING, REST, Native, Node
from hullguard.core.native_uio import IsolateTable, Uio, UioTable
from hullguard.core.tracker import TrackerNative
from hullguard.design.arith import nearest32
from hullguard.design.design import Design
from hullguard.design.fusion_model import FusionTables
from hullguard.design.statistic import MapTable
from hullguard.design.tables import Tables

ALL = 0xFFFFFFFF
NO_FACTOR = 255  # HG_POLYNOMIAL_NONE
QUIET = 24  # samples of the self-test before its fault
FAULTY = 40  # at most, from there on
SPREADS = (64, 32, 16, 8, 4, 2, 1, 0)
SHARES = (16, 8, 4, 2)  # of a signal's range


def _walked(made: Library, walk: Any, status: int) -> int:
    if status != made.lib.HG_OK:
        raise AssertionError("the walk did not end")
    return int(walk.crc)


def _begun(made: Library) -> Any:
    walk = made.ffi.new("hg_digest *")
    made.lib.hg_digest_start(walk)
    return walk


def node_head(native: Native) -> int:
    """Of the numbers that say how many tables a detector node has."""
    return int(native.library.lib.hg_digest_node_head(native.node))


def tracker_head(native: TrackerNative) -> int:
    """The same of a fusion filter."""
    return int(native.library.lib.hg_digest_tracker_head(native.config))


def node_digest(native: Native) -> int:
    """Of a detector node's tables."""
    walk = _begun(native.library)
    return _walked(native.library, walk, native.library.lib.hg_digest_node(walk, native.node, node_head(native), ALL))


def tracker_digest(native: TrackerNative) -> int:
    """Of a fusion filter's tables."""
    walk = _begun(native.library)
    return _walked(native.library, walk, native.library.lib.hg_digest_tracker(walk, native.config, tracker_head(native), ALL))


def _exact(table: Any) -> Any:
    """A table with the numbers that generated files hold: exact in float32 for float64, too."""
    rounded = {f.name: getattr(table, f.name) for f in fields(table)}
    return replace(table, **{k: nearest32(v) if isinstance(v, np.ndarray) else float(nearest32(np.array(v))) for k, v in rounded.items() if isinstance(v, (np.ndarray, float))})


def uio_digest(made: Library, tables: Sequence[UioTable]) -> int:
    """Of unknown-input observers."""
    kept = [Uio(made, table if made.real == "q31" else _exact(table)) for table in tables]
    configs = made.ffi.new("hg_uio_config[]", [u.config[0] for u in kept])
    walk = _begun(made)
    return _walked(made, walk, made.lib.hg_digest_uio(walk, configs, len(kept), ALL))


def isolate_digest(made: Library, tables: Sequence[tuple[UioTable, IsolateTable]]) -> int:
    """Of what tells their causes apart, each with the observer whose estimates it reads."""
    kept = [Uio(made, _exact(table), _exact(isolate)) for table, isolate in tables]
    configs = made.ffi.new("hg_isolate_config[]", [u.isolation[0] for u in kept])
    walk = _begun(made)
    return _walked(made, walk, made.lib.hg_digest_isolate(walk, configs, len(kept), ALL))


def natives(tables: Tables) -> dict[str, Native]:
    """A model's structures in each number type that it has a form in."""
    return {real: Native(library(real), tables) for real in REALS if real != "q31" or tables.fixed is not None}


def node_digests(tables: Tables) -> dict[str, int]:
    """By number type."""
    return {real: node_digest(native) for real, native in natives(tables).items()}


def tracker_digests(tables: FusionTables) -> dict[str, int]:
    """By number type."""
    return {real: tracker_digest(TrackerNative(library(real), tables)) for real in REALS if real != "q31"}


@dataclass(frozen=True)
class Drive:
    """hg_selftest_config without its digest."""

    start: int
    samples: int
    fault: int
    signal: int
    spread: int
    size: int
    code: tuple[int, ...]


@dataclass(frozen=True)
class Outcome:
    """hg_selftest_result."""

    digest: int
    quiet: bool
    found: bool


def drive(native: Native, asked: Drive) -> Outcome:
    """One drive of a node of its own."""
    ffi, lib = native.library.ffi, native.library.lib
    node, result, config, code = Node(native, asked.start), ffi.new("hg_selftest_result *"), ffi.new("hg_selftest_config *"), ffi.new("int32_t[]", asked.code)
    config.how, config.samples, config.fault, config.signal = asked.start, asked.samples, asked.fault, asked.signal
    config.spread, config.size, config.code = asked.spread, asked.size, code
    lib.hg_selftest_drive(node.node, config, result)
    return Outcome(int(result.digest), bool(result.quiet), bool(result.found))


def _mapped(rows: MapTable, x: Sequence[float]) -> list[float]:
    """Polynomials in x, a number a row."""
    terms = [c * prod(x[i] for i in rows.factor[k * rows.width : (k + 1) * rows.width] if i != NO_FACTOR) for k, c in enumerate(rows.coefficient)]
    return [sum(terms[first:end]) for first, end in pairwise((0, *rows.end))]


def _at_rest(design: Design) -> tuple[int, ...]:
    """Codes of the plant's equilibrium, within their ranges."""
    signals = [s for g in design.tables.groups for s in g.signals]
    value = [design.model.centre(i) for i in range(len(signals))]
    for table in design.tables.polynomials[:1]:  # a nonlinear plant's is where its filter begins
        shown = zip(table.signal, _mapped(table.h, table.x0), table.gain, strict=True)
        for place, known in [*((place, y / gain) for place, y, gain in shown), *zip(table.input, table.zero, strict=True)]:
            value[place] = known
    nearest = (round((x - s.offset) / s.resolution) for x, s in zip(value, signals, strict=True))
    return tuple(min(max(code, s.minimum), s.maximum) for code, s in zip(nearest, signals, strict=True))


def _faults(design: Design, code: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Signals and sizes worth a try: those of named faults first, a larger part of the range each time, towards the end that is further off."""
    signals = [s for g in design.tables.groups for s in g.signals]
    places = dict.fromkeys([*(f.signal for f in design.model.faults), *range(len(signals))])
    for share in SHARES:
        for place in places:
            s = signals[place]
            up = s.maximum - code[place] >= code[place] - s.minimum
            size = min((s.maximum - s.minimum) // share, s.maximum - code[place] if up else code[place] - s.minimum)
            yield place, size if up else -size


def selftest(design: Design) -> tuple[Drive, dict[str, int]] | None:
    """The widest drive without a false alarm, the smallest fault of those tried that is found in every number type, and the digests. None where there is no such drive."""
    made, code = natives(design.tables), _at_rest(design)

    def passed(asked: Drive) -> bool:
        return all(out.quiet and (out.found or asked.fault == asked.samples) for out in (drive(native, asked) for native in made.values()))

    for start in (REST, MOVING):
        quiet = (Drive(start, QUIET + FAULTY, QUIET + FAULTY, 0, spread, 0, code) for spread in SPREADS)
        widest = next((asked for asked in quiet if passed(asked)), None)
        if widest is None:
            continue
        for place, size in _faults(design, code):
            for samples in range(QUIET + 1, QUIET + FAULTY + 1):
                asked = Drive(start, samples, QUIET, place, widest.spread, size, code)
                if passed(asked):
                    return asked, {real: drive(native, asked).digest for real, native in made.items()}
    return None
