"""The limit of a case: how early the faults of its runs could be found at all, the mean over its first runs."""

from __future__ import annotations

import numpy as np

from hullguard.campaign.case import Case, configured
from hullguard.design.bank import usual_scale
from hullguard.design.limit import Explanation, first_unexplained

RUNS = 20
WINDOW = 30  # samples


def limit_of(case: Case, runs: int) -> float | None:
    """Mean delay in samples, of the runs in which there is one; None where a case has no limit: no fault, losses, or a fault before a window is full."""
    if case.fault_start is None or case.fault_start < WINDOW or case.loss > 0.0:
        return None
    batch, design = configured(case)
    programme = Explanation(design.model, WINDOW, usual_scale(design.model), design.varying)
    delays = [first_unexplained(programme, batch.trace(run), case.fault_start, case.samples) for run in range(min(runs, RUNS))]
    known = [d for d in delays if d is not None]
    return float(np.mean(known)) if known else None
