"""The result of `hullguard limit` for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TextIO

from rich.console import Console
from rich.table import Table

WIDTH = 120  # columns where the output is no terminal
SHOWN = 3  # detectors that have a column each; of more, only the whole detector and the best of its parts


def show_limits(rows: Sequence[dict[str, Any]], start: int, model: str, scenario: str, file: TextIO) -> None:
    """A line a fault and size: mean delays in samples; behind a slash the runs in which it was found, where these are not all."""
    limits = [name for name in ("limit", "limit_feedback") if name in rows[0]]
    names = list(rows[0]["detectors"])
    parts = names[1:] if len(names) > SHOWN else []
    shown = [n for n in names if n not in parts]
    table = Table(box=None)
    table.add_column("fault", no_wrap=True)
    for name in ("size", "runs", *(name.replace("_", " with ") for name in limits), *shown, *(["best part alone"] if parts else [])):
        table.add_column(name, justify="right", no_wrap=True)
    for row in rows:
        found = [_cell(row, name, row[name]) for name in limits] + [_cell(row, name, row["detectors"][name]) for name in shown]
        table.add_row(row["fault"], f"{row['size']:g}", str(row["runs"]), *found, *([_best(row, parts)] if parts else []))
    console = Console(file=file, highlight=False)
    if not console.is_terminal:
        console.width = WIDTH
    partly = any(0 < n < row["runs"] for row in rows for n in row["found"].values())
    console.print(f"{model}, {scenario}: mean delay in samples, fault from sample {start}" + ("; behind a slash the runs that found it, where not all did" if partly else ""))
    console.print(table)


def _cell(row: dict[str, Any], name: str, mean: float | None) -> str:
    if mean is None:
        return "never"
    return f"{mean:.2f}" + ("" if row["found"][name] == row["runs"] else f" / {row['found'][name]}")


def _best(row: dict[str, Any], parts: Sequence[str]) -> str:
    """The part that finds the fault in most runs, the soonest among equals."""
    name = min(parts, key=lambda n: (-row["found"][n], row["detectors"][n] or 0.0))
    mean = row["detectors"][name]
    return "never" if mean is None else f"{name}: {_cell(row, name, mean)}"
