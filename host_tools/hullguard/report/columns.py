"""Tables of numbers beside a report: a line of names, then a row a sample."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hullguard.errors import InputError
from hullguard.model.table import Array


def read_columns(path: Path) -> dict[str, Array]:
    """Columns by name, [samples] each; none where there is no such file."""
    if not path.is_file():
        return {}
    with path.open(encoding="utf-8") as file:
        header = file.readline().strip().split(",")
        data = np.loadtxt(file, delimiter=",", ndmin=2)
    if data.shape[1] != len(header):
        raise InputError(f"{path}: {data.shape[1]} columns below {len(header)} names; make the run again")
    return {name: data[:, i] for i, name in enumerate(header)}
