"""The rows of a campaign as a table, one a run with its case's columns: Parquet, or CSV."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hullguard.campaign.case import Case, Rows
from hullguard.errors import InputError

SUFFIXES = (".parquet", ".csv")
NO_PYARROW = "Parquet needs pyarrow, which is not installed: pip install 'hullguard[campaign]'"


def has_parquet() -> bool:
    """Whether pyarrow is installed."""
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError:
        return False
    return True


def check_table(path: Path) -> None:
    """Refuse a table that could not be written, before any run is made."""
    if path.suffix not in SUFFIXES:
        raise InputError(f"--table {path}: expected a name that ends in {' or '.join(SUFFIXES)}")
    if path.suffix == ".parquet" and not has_parquet():
        raise InputError(f"--table {path}: {NO_PYARROW}, or name a .csv file")
    if not path.parent.is_dir():
        raise InputError(f"--table {path}: there is no folder {path.parent}; make it first")


def table(parts: Sequence[tuple[Case, Rows]]) -> dict[str, list[Any]]:
    """Columns by name."""
    made: dict[str, list[Any]] = {}
    for place, (case, rows) in enumerate(parts):
        count = len(rows["run"])
        constant = {"case": place, **case.labels(), "fault_start": case.fault_start}
        for name, value in constant.items():
            made.setdefault(name, []).extend([value] * count)
        for name, values in rows.items():
            made.setdefault(name, []).extend(values.tolist())
        delay = np.where(rows["provisional_at"] >= 0, rows["provisional_at"] - (case.fault_start or 0), -1)
        made.setdefault("delay", []).extend(int(d) if d >= 0 and case.faults else None for d in delay)
    for name in dict.fromkeys(name for case, _ in parts for name, _ in case.varied):
        if not all(isinstance(v, (int, float)) for v in made[name]):  # a column has one type
            made[name] = [str(v) for v in made[name]]
    return made


def write_table(path: Path, made: dict[str, list[Any]]) -> None:
    """Write the table in the format of the file's name; the same rows give the same bytes."""
    try:
        if path.suffix == ".csv":
            with path.open("w", encoding="utf-8", newline="") as f:
                writer = csv.writer(f, lineterminator="\n")
                writer.writerow(made)
                writer.writerows(zip(*made.values(), strict=True))
        else:
            import pyarrow as pa
            import pyarrow.parquet as pq

            pq.write_table(pa.table(made), path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); name another place") from error
