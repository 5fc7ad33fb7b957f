"""How long each detector takes, beside the earliest that a sound one could: the same runs, fault by fault and size by size.

Nothing is lost on the bus here: after a gap the hold rewrites radii of the past, which a trace of single samples does not show.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hullguard.campaign.tasks import Emulator, Tick, each
from hullguard.core.native import PLANT_STATES
from hullguard.design.bank import usual_scale
from hullguard.design.limit import Explanation, first_unexplained
from hullguard.design.store import Stored
from hullguard.errors import InputError
from hullguard.model.faults import FaultSpec
from hullguard.model.schema import Model, Reference

RUNS_TASK = 10
PROVISIONAL = PLANT_STATES.index("provisional")
WITH_FEEDBACK = "limit_feedback"
EXCLUDING = "not "  # banks that exclude a hypothesis, which are not made to be early


@dataclass(frozen=True)
class LimitJob:
    """A study of one model."""

    model: Model
    stored: Stored
    real: str
    window: int  # samples
    samples: int
    reference: Reference
    seed: int

    @property
    def start(self) -> int:
        """First faulty sample: the middle of the run."""
        return self.samples // 2


@dataclass(frozen=True)
class Point:
    """Runs of one fault at one size, or a part of them."""

    fault: str
    size: float
    first: int
    count: int


class _Examiner:
    """A process's emulator and programmes."""

    def __init__(self, job: LimitJob) -> None:
        self.job, self.emulator = job, Emulator(job.model, job.stored, job.real)
        model = self.emulator.design.model
        scale = usual_scale(model)
        varying = self.emulator.design.varying
        self.programme = Explanation(model, job.window, scale, varying)
        self.knowing = Explanation(model, job.window, scale, varying, feedback=True) if model.detector.feedback_known else None

    def delays(self, point: Point, run: int) -> dict[str, int | None]:
        """Of the limit and of every detector in one run."""
        job = self.job
        trace = self.emulator.trace(job.samples, job.reference, [FaultSpec(point.fault, "bias", point.size, job.start, None)], job.seed, run)
        found: dict[str, int | None] = {"limit": first_unexplained(self.programme, trace, job.start, job.samples)}
        if self.knowing is not None:
            reference = self.emulator.reference(job.samples, job.reference, job.seed, run)
            found[WITH_FEEDBACK] = first_unexplained(self.knowing, trace, job.start, job.samples, reference=reference)
        found["detector"] = _first(np.asarray(trace["plant"] >= PROVISIONAL), job.start)
        first, design = 0, self.emulator.design
        widths = [len(g.output) for g in design.tables.generators] + [1] * len(design.tables.banks)
        for name, width in zip(design.judges, widths, strict=True):
            own = slice(first, first + width)
            if not name.startswith(EXCLUDING):
                found[name] = _first(np.any(np.abs(trace["r"][:, own]) > trace["J"][:, own], axis=1), job.start)
            first = own.stop
        return found


def _first(alarm: NDArray[np.bool_], start: int) -> int | None:
    after = np.flatnonzero(alarm[start:])
    return int(after[0]) if len(after) else None


def _examine(examiner: _Examiner, point: Point) -> list[dict[str, int | None]]:
    return [examiner.delays(point, run) for run in range(point.first, point.first + point.count)]


def limit_study(job: LimitJob, faults: Sequence[str], sizes: Sequence[float], runs: int, workers: int, tick: Tick) -> list[dict[str, Any]]:
    """A row a fault and size: {fault, size, runs, limit, detectors {name: mean delay}, found {name: runs}}; a mean is over the runs that found it.

    With detector.feedback_known there is also limit_feedback, the limit of a detector that knows the control law. Run i of every row has the
    disturbances of run i of every other.
    """
    if job.start < job.window:
        raise InputError(f"a fault in the middle of {job.samples} samples starts before a window of {job.window} is full: use --samples {2 * job.window} or more")
    points = [Point(f, s, first, min(RUNS_TASK, runs - first)) for f in faults for s in sizes for first in range(0, runs, RUNS_TASK)]
    parts = each(_Examiner, _examine, job, points, workers, tick)
    rows = []
    for fault in faults:
        for size in sizes:
            delays = [d for p, part in zip(points, parts, strict=True) if (p.fault, p.size) == (fault, size) for d in part]
            rows.append(_row(fault, size, delays))
    return rows


def _row(fault: str, size: float, delays: list[dict[str, int | None]]) -> dict[str, Any]:
    means: dict[str, float | None] = {}
    found: dict[str, int] = {}
    for name in delays[0]:
        known = [x for d in delays if (x := d[name]) is not None]
        means[name], found[name] = float(np.mean(known)) if known else None, len(known)
    limits = {name: means.pop(name) for name in ("limit", WITH_FEEDBACK) if name in means}
    return {"fault": fault, "size": size, "runs": len(delays), **limits, "detectors": means, "found": found}
