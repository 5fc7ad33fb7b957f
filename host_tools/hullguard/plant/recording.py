"""Recorded signals from a CSV whose columns carry the model's signal names."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hullguard.errors import InputError
from hullguard.model.schema import Model
from hullguard.model.table import Array

TIME = "time_s"


def read_columns(path: Path, names: Sequence[str], period: float, who: str) -> Array:
    """Rows x names. Missing columns, gaps, text, NaN and uneven time are refused with their place; `who` needs the columns."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not a readable CSV file ({error})") from error
    if not rows:
        raise InputError(f"{path.name}: the file is empty")
    header = [c.strip() for c in rows[0]]
    columns = {}
    for name in names:
        if header.count(name) != 1:
            problem = "is missing" if name not in header else "is there twice"
            cure = "" if len(header) > 1 else "; columns are separated by commas, numbers have a decimal point"
            raise InputError(f"{path.name}: column '{name}' {problem}; the model {who} needs {', '.join(names)}{cure}")
        columns[name] = header.index(name)
    body = [(i, r) for i, r in enumerate(rows[1:], 2) if any(c.strip() for c in r)]
    if not body:
        raise InputError(f"{path.name}: no rows below the header")
    if TIME in header:
        _check_time(path, body, header.index(TIME), period)
    return np.array([[_number(path, line, r, s, c) for s, c in columns.items()] for line, r in body])


def read_recording(path: Path, model: Model) -> Array:
    """Samples x signals in the model's order. Missing columns, gaps, text, NaN and uneven time are refused with their place."""
    data = read_columns(path, [s.name for s in model.signals], model.sample_time_s, model.name)
    # A reading that shows an earlier row exists only from there on: sample 0 is the first row at which all do.
    latest = max(s.csv_delay for s in model.signals)
    if latest >= len(data):
        raise InputError(f"{path.name}: {len(data)} rows, fewer than the delay of {latest} that the model gives a signal")
    return np.column_stack([data[latest - s.csv_delay : len(data) - s.csv_delay, i] for i, s in enumerate(model.signals)])


def _number(path: Path, line: int, row: list[str], name: str, column: int) -> float:
    cell = row[column].strip() if column < len(row) else ""
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        shown = f"'{cell}'" if cell else "nothing"
        raise InputError(f"{path.name}:{line}: column '{name}' holds {shown}, not a finite number; fill the gap or cut the recording there")
    return value


def _check_time(path: Path, body: list[tuple[int, list[str]]], column: int, period: float) -> None:
    before = None
    for line, row in body:
        now = _number(path, line, row, TIME, column)
        if before is not None and abs(now - before - period) > 0.1 * period:
            raise InputError(f"{path.name}:{line}: time steps from {before:g} to {now:g} s, the model samples every {period:g} s; fill the gap or cut the recording there")
        before = now
