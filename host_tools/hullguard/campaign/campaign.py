"""Campaigns: cases times runs, in C, on all cores or on a cluster. Results depend neither on the number of workers nor on the chunks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass

import numpy as np

from hullguard.campaign.case import COLUMNS, Case, Rows, chunk, runs_a_chunk
from hullguard.campaign.chunks import Chunks
from hullguard.campaign.tasks import crew, deaf


@dataclass(frozen=True)
class Task:
    """Runs first .. first + count - 1 of a case."""

    case: Case
    place: int  # of the case among all
    first: int
    count: int


Way = Callable[[Sequence[Task]], Iterator[tuple[Task, Rows]]]  # how tasks are worked off, in any order


def serial(tasks: Sequence[Task]) -> Iterator[tuple[Task, Rows]]:
    """One after another, in this process."""
    for t in tasks:
        yield t, chunk(t.case, t.first, t.count)


def processes(workers: int) -> Way:
    """In this many processes of this machine."""

    def work(tasks: Sequence[Task]) -> Iterator[tuple[Task, Rows]]:
        if workers <= 1 or len(tasks) <= 1:
            yield from serial(tasks)
            return
        with crew(min(workers, len(tasks))) as pool:
            with deaf():  # each of the first tasks starts a worker
                waiting = {pool.submit(chunk, t.case, t.first, t.count): t for t in tasks[:workers]}
            waiting |= {pool.submit(chunk, t.case, t.first, t.count): t for t in tasks[workers:]}
            for done in as_completed(waiting):
                yield waiting[done], done.result()

    return work


def tasks_of(cases: Sequence[Case], runs: int, size: int | None = None) -> list[Task]:
    """All chunks; `size` runs each, or as many as a chunk of the case should have."""
    tasks = []
    for place, case in enumerate(cases):
        step = size or runs_a_chunk(case)
        tasks += [Task(case, place, first, min(step, runs - first)) for first in range(0, runs, step)]
    return tasks


def campaign(
    cases: Sequence[Case], runs: int, way: Way = serial, tick: Callable[[int, int], None] = lambda place, count: None, kept: Chunks | None = None, size: int | None = None
) -> list[Rows]:
    """The rows of every case, in the order of its runs. Chunks that `kept` has are not made again; `tick` gets case and number of the runs that are there."""
    parts: list[dict[int, Rows]] = [{} for _ in cases]
    open_tasks = []
    for t in tasks_of(cases, runs, size):
        rows = kept.get(t.case, t.first, t.count) if kept else None
        if rows is None:
            open_tasks.append(t)
        else:
            parts[t.place][t.first] = rows
            tick(t.place, t.count)
    for t, rows in way(open_tasks):
        if kept:
            kept.put(t.case, t.first, rows)
        parts[t.place][t.first] = rows
        tick(t.place, t.count)
    return [{name: np.concatenate([p[first][name] for first in sorted(p)]) for name in COLUMNS} for p in parts]
