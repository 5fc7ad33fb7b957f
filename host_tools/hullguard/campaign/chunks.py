"""Finished chunks in a folder: what an interrupted campaign has already done, and what a longer one need not do again."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np

from hullguard.campaign.case import COLUMNS, FLOATS, Case, Rows


class Chunks:
    """One file a chunk, named by its case's key and its runs; a file is there whole or not at all."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.found = 0  # runs that did not have to be made
        folder.mkdir(parents=True, exist_ok=True)

    def _path(self, case: Case, first: int, count: int) -> Path:
        return self._folder / f"{case.key[:24]}-{first}-{count}.json"

    def get(self, case: Case, first: int, count: int) -> Rows | None:
        """The rows of a chunk; None where they have to be made."""
        try:
            data = json.loads(self._path(case, first, count).read_text(encoding="utf-8"))
            rows = {name: np.array(data[name], dtype=np.float64 if name in FLOATS else np.int64) for name in COLUMNS}
        except (OSError, ValueError, KeyError, TypeError, OverflowError):
            return None
        if any(r.shape != (count,) for r in rows.values()):
            return None
        self.found += count
        return rows

    def put(self, case: Case, first: int, rows: Rows) -> None:
        """Keep the rows of a chunk: written beside its place, then moved there, so that a kill leaves no half of it."""
        path = self._path(case, first, len(rows["run"]))
        beside = path.with_suffix(f".{os.getpid()}.part")
        beside.write_text(json.dumps({name: values.tolist() for name, values in rows.items()}), encoding="utf-8")
        beside.replace(path)
