"""The ledger of what was injected: ground truth beside the bus, never on it."""

from __future__ import annotations

import csv
from collections import Counter
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from hullguard.bus import candump
from hullguard.core.native import Frame


def text(frame: Frame) -> str:
    """A frame as candump writes it, without time and channel."""
    return candump.line(0.0, "-", frame).split()[2]


@dataclass(frozen=True)
class Label:
    """One injected event. A row a directive and frame: where one directive worked on what another one made, there are two rows with one index."""

    time_s: float  # seconds since the start
    k: int | None  # sample open then, where the closing message is known
    directive: str
    action: str
    frame: int | None  # which of the frames that came in, counted from 0; None: no frame called for it
    original: str  # as candump writes it
    sent: str  # what the directive made of it: frames with a blank between them; empty: nothing
    expects: str  # health counter of a receiver that it raises, by one
    detail: str
    seed: int


class Ledger:
    """Rows in memory, or in a file as they come."""

    def __init__(self, path: Path | None = None, keep: bool = True) -> None:
        """Without a path rows stay in memory, unless `keep` says that counts are enough."""
        self.rows: list[Label] = []
        self._keep = keep
        self.events: Counter[str] = Counter()  # by directive
        self.actions: Counter[str] = Counter()
        self.expects: Counter[str] = Counter()
        self._file = path.open("w", encoding="utf-8", newline="") if path else None
        self._writer = csv.writer(self._file, lineterminator="\n") if self._file else None
        if self._writer:
            self._writer.writerow([f.name for f in fields(Label)])

    def add(self, label: Label) -> None:
        """One more."""
        self.events[label.directive] += 1
        self.actions[label.action] += 1
        self.expects[label.expects] += 1
        if self._writer:
            time_s, *rest = astuple(label)
            self._writer.writerow([f"{time_s:.6f}", *("" if x is None else x for x in rest)])
        elif self._keep:
            self.rows.append(label)

    def close(self) -> None:
        """Finish the file."""
        if self._file:
            self._file.close()
