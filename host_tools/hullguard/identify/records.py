"""Recordings as plant outputs and inputs, with the lags of their signals taken out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hullguard.errors import InputError
from hullguard.model.schema import Model
from hullguard.model.table import Array
from hullguard.plant.recording import read_recording

SHORTEST = 100  # samples of a part: below that nothing is found that would hold
GAIN = 0.02  # by which the volume of residuals has to shrink, in its logarithm a sample, for a lag to be believed


@dataclass(frozen=True)
class Record:
    """A part of a recording."""

    name: str
    first: int  # line of the file of its sample 0, the header is line 1
    series: Array  # samples x signals
    y: Array  # samples x m
    u: Array  # samples x p


def read(paths: Sequence[Path], model: Model) -> list[Array]:
    """All recordings, row by row (rows x signals): no lag taken out."""
    plain = replace(model, signals=tuple(replace(s, csv_delay=0) for s in model.signals))
    return [read_recording(p, plain) for p in paths]


def aligned(model: Model, raw: Array, delay: Sequence[int]) -> Array:
    """The readings at each sample: those of row k - delay."""
    latest = max(delay)
    return np.column_stack([raw[latest - d : len(raw) - d, i] for i, d in enumerate(delay)])


def parted(model: Model, paths: Sequence[Path], raw: Sequence[Array], delay: Sequence[int], hold_out: float) -> tuple[list[Record], list[Record]]:
    """The part of every recording that bounds are found on, and the rest."""
    fitted: list[Record] = []
    held: list[Record] = []
    for path, rows in zip(paths, raw, strict=True):
        series = aligned(model, rows, delay)
        split = round(len(series) * (1 - hold_out))
        if min(split, len(series) - split if hold_out else split) < SHORTEST:
            raise InputError(f"{path.name}: {len(series)} samples; bounds need {SHORTEST} and the hold-out as many: give a longer recording, or --hold-out 0")
        for part, kept, start in ((series[:split], fitted, 0), (series[split:], held, split)):
            if len(part):
                kept.append(Record(path.name, start + max(delay) + 2, part, part[:, model.outputs], part[:, model.inputs]))
    return fitted, held


def lags(model: Model, raw: Sequence[Array], most: int, score: Callable[[Sequence[tuple[Array, Array]]], float]) -> list[int]:
    """How many samples late each signal is in the recordings, 0 .. most: one signal at a time is moved as long as `score` falls."""
    count = len(model.signals)
    end = min(len(r) for r in raw)

    def of(lag: Sequence[int]) -> float:
        late = max(lag)
        moved = [aligned(model, r[: end if len(raw) == 1 else None], [late - x for x in lag]) for r in raw]
        return score([(s[:, model.outputs], s[:, model.inputs]) for s in moved])

    best = [0] * count
    least = of(best)
    better = True
    while better:
        better = False
        for i in range(count):
            for lag in range(most + 1):
                tried = [*best[:i], lag, *best[i + 1 :]]
                if tried == best or min(tried) > 0:
                    continue
                found = of(tried)
                if found < least - GAIN:
                    best, least, better = tried, found, True
    return best
