"""Campaigns: the same configuration over many seeds, in C, on all cores. Results do not depend on the number of workers."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import threading
import uuid
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any

import numpy as np

from hullguard.core.library import library
from hullguard.core.native import Batch, Native
from hullguard.design.design import finish
from hullguard.design.store import Stored
from hullguard.model.faults import FaultSpec
from hullguard.model.schema import Model, Reference

CHUNK = 50  # runs a task


@dataclass(frozen=True)
class Job:
    """All that a worker needs."""

    model: Model
    stored: Stored
    real: str
    samples: int
    reference: Reference
    faults: tuple[FaultSpec, ...]
    seed: int
    loss: float
    start: int


_batches: dict[str, Batch] = {}  # of this process, by job: making tables costs as much as a chunk of runs


def chunk(job: Job, name: str, first: int, count: int) -> list[dict[str, Any]]:
    """Runs first .. first + count - 1 of a job with this name."""
    if name not in _batches:
        design = finish(job.model, job.stored)
        native = Native(library(job.real), design.tables)
        _batches[name] = Batch(native, design, job.samples, job.reference, job.faults, job.seed, job.loss, job.start)
    return _batches[name].runs(first, count)


@contextlib.contextmanager
def _deaf() -> Iterator[None]:
    """Processes started in here do not hear Ctrl-C: it is the parent's to end them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def campaign(job: Job, runs: int, workers: int, tick: Callable[[int], None]) -> list[dict[str, Any]]:
    """All rows, in the order of the runs. `tick` gets the number of runs that have just ended."""
    parts = [(first, min(CHUNK, runs - first)) for first in range(0, runs, CHUNK)]
    rows: list[dict[str, Any]] = []
    name = uuid.uuid4().hex
    if workers <= 1 or len(parts) == 1:
        for first, count in parts:
            rows += chunk(job, name, first, count)
            tick(count)
        _batches.clear()
        return rows
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        with _deaf():  # each of the first tasks starts a worker
            waiting = {pool.submit(chunk, job, name, first, count): count for first, count in parts[:workers]}
        try:
            waiting |= {pool.submit(chunk, job, name, first, count): count for first, count in parts[workers:]}
            for done in as_completed(waiting):
                rows += done.result()
                tick(waiting[done])
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return sorted(rows, key=lambda r: int(r["run"]))


def digest(rows: Sequence[dict[str, Any]], samples: int, groups: int, faults: Sequence[FaultSpec]) -> dict[str, Any]:
    """What --json prints of a campaign, without the rows."""
    first = min((f.start for f in faults), default=None)
    found = [r for r in rows if r["provisional_at"] >= 0]
    sure = [r for r in rows if r["confirmed_at"] >= 0]
    measured = sum(r["measurement"] for r in rows)
    result: dict[str, Any] = {
        "runs": len(rows),
        "samples": samples,
        "false_alarm_runs": sum(r["false_confirmed"] > 0 for r in rows),
        "provisional_alarm_runs": sum(r["false_provisional"] > 0 for r in rows),
        "measurement_share": measured / max(1, len(rows) * samples * groups),
        "frames_lost": sum(r["lost"] for r in rows),
        "margin_max": max((r["margin"] for r in rows), default=0.0),
    }
    if first is not None:
        delays = [r["provisional_at"] - first for r in found]
        result["faults"] = [str(f) for f in faults]
        result["detected_runs"] = len(found)
        result["confirmed_runs"] = len(sure)
        result["delay_mean"] = float(np.mean(delays)) if delays else None
        result["delay_max"] = int(max(delays)) if delays else None
        result["confirmed_delay_mean"] = float(np.mean([r["confirmed_at"] - first for r in sure])) if sure else None
    return result
