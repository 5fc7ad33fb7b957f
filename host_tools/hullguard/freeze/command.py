"""`hullguard freeze`: read what an ECU knew in the samples around a confirmed alarm, over the bus, and clear it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hullguard.bus.link import opened
from hullguard.codegen.c import derived_names
from hullguard.codegen.names import names_of
from hullguard.commands import bus_options, emit, prepared, progress, say
from hullguard.core.library import library
from hullguard.design.design import Design
from hullguard.design.judges import judges, residual_columns, residual_names
from hullguard.errors import ExpectationError, InputError
from hullguard.freeze.reader import Reader, State
from hullguard.freeze.record import Record, Sample, decode, ratios
from hullguard.plant.run import candidate_names
from hullguard.plant.told import another


def run_freeze(args: argparse.Namespace) -> int:
    """`hullguard freeze`."""
    _, made = prepared(args)
    table = made.tables.freeze
    if table is None:
        raise InputError(f"model {made.model.name} keeps no freeze frame; give it a section [freeze] with samples = 16 and request = {{ id = .. }}, and build its image anew")
    options = bus_options(args)
    if not options:
        raise InputError("freeze needs a bus: -i INTERFACE -c CHANNEL")
    with opened(**options) as link:
        reader = Reader(library(), link, table)
        state = reader.state()
        record = None
        if state.state == "frozen":
            with progress(args, "reading") as tick:
                record = decode(made, reader.read(state, lambda done, whole: tick("words", done, whole)))
        after = reader.clear(state.record) if args.clear and record is not None else None
    if args.csv and record is not None:
        _write_csv(Path(args.csv), made, record)
    for line in _lines(made, state, record):
        say(args, line)
    if after is not None:
        say(args, f"cleared: the ECU is {after.state}")
    emit(args, as_json(made, state, record) | {"cleared": after is not None})
    complaint = another(made.model.name, record.model_hash, made.tables.hash) if record is not None else None
    if complaint is not None:
        raise ExpectationError(complaint)
    return 0


def _signals(made: Design) -> list[str]:
    """Names of the whole signal vector."""
    names = names_of(made)
    return [*names.signals, *derived_names(made.tables, names)]


def as_json(made: Design, state: State, record: Record | None) -> dict[str, Any]:
    """The object that --json prints."""
    facts: dict[str, Any] = {"model": made.model.name, "model_hash": f"{made.tables.hash:08x}", "state": state.state, "record": state.record, "missed": state.missed}
    if record is None:
        return facts | {"samples": []}
    facts |= {"ecu_hash": f"{record.model_hash:08x}", "real": record.real, "alarm_k": record.samples[record.alarm].k}
    return facts | {"samples": [_row(made, s) for s in record.samples]}


def _row(made: Design, s: Sample) -> dict[str, Any]:
    columns, signals = residual_columns(judges(made)), _signals(made)
    return {
        "k": s.k,
        "plant": s.plant,
        "basis": s.basis,
        "candidates": candidate_names(made, s.candidates),
        "bus": {g.name: b for g, b in zip(made.tables.groups, s.bus, strict=True)},
        "value": dict(zip(signals, s.value, strict=True)),
        "radius": dict(zip(signals, s.radius, strict=True)),
        "r": dict(zip(columns, s.r, strict=True)),
        "J": dict(zip(columns, s.J, strict=True)),
    }


def _lines(made: Design, state: State, record: Record | None) -> list[str]:
    """The table for people: a line a sample, signals as value and radius."""
    if record is None:
        return [f"nothing to read: the ECU is {state.state}, {state.record} records since its start"]
    signals, names = _signals(made), residual_names(judges(made))
    alarm = record.samples[record.alarm]
    head = f"record {record.number}, {record.real}: alarm confirmed at sample {alarm.k}, may be: {', '.join(candidate_names(made, alarm.candidates)) or 'no single fault'}"
    missed = f"; {state.missed} more alarm{'s' * (state.missed > 1)} since, not recorded" if state.missed else ""
    rows = [["", "k", "plant", "bus", "|r|/J", "of", *signals]]
    for i, s in enumerate(record.samples):
        largest = max(ratios(s), default=0.0)
        whose = names[list(ratios(s)).index(largest)]
        shown = [f"{v:.5g} +-{w:.3g}" for v, w in zip(s.value, s.radius, strict=True)]
        rows.append([">" if i == record.alarm else "", str(s.k), s.plant, ",".join(s.bus), f"{largest:.3f}", whose, *shown])
    width = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [head + missed, *("  ".join(cell.ljust(w) for cell, w in zip(row, width, strict=True)).rstrip() for row in rows)]


def _write_csv(path: Path, made: Design, record: Record) -> None:
    """All numbers, a row a sample; columns as in a run's signals.csv."""
    signals, columns = _signals(made), residual_columns(judges(made))
    header = ["k", "plant", "basis", "candidates", *(f"bus.{g.name}" for g in made.tables.groups)]
    header += [c for n in signals for c in (f"{n}.value", f"{n}.radius")] + [c for x in columns for c in (f"r{x}", f"J{x}")]
    lines = [",".join(header)]
    for s in record.samples:
        row = [str(s.k), s.plant, s.basis, " ".join(candidate_names(made, s.candidates)), *s.bus]
        row += [f"{x:.17g}" for pair in (*zip(s.value, s.radius, strict=True), *zip(s.r, s.J, strict=True)) for x in pair]
        lines.append(",".join(row))
    try:
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"--csv {path}: cannot be written ({error.strerror}); name a file in a folder of your own") from error
