"""Work spread over processes whose result does not depend on how many there are, and the emulated runs that such work looks at."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import Any, TypeVar

import numpy as np

from hullguard.core.library import library
from hullguard.core.native import Batch, Native, Plant
from hullguard.design.design import finish
from hullguard.design.store import Stored
from hullguard.model.faults import FaultSpec
from hullguard.model.schema import Model, Reference
from hullguard.model.table import Array

Job = TypeVar("Job")
Context = TypeVar("Context")
Item = TypeVar("Item")
Result = TypeVar("Result")
Tick = Callable[[int], None]  # items that have just ended

_context: dict[str, Any] = {}  # of this worker: what every item needs is made once a process


class Emulator:
    """Runs of one design, sample by sample."""

    def __init__(self, model: Model, stored: Stored, real: str = "f32") -> None:
        self.design = finish(model, stored)
        self.native = Native(library(real), self.design.tables)

    def trace(self, samples: int, reference: Reference, faults: Sequence[FaultSpec], seed: int, run: int) -> dict[str, Array]:
        """One run as Batch.trace() gives it."""
        return Batch(self.native, self.design, samples, reference, faults, seed).trace(run)

    def reference(self, samples: int, reference: Reference, seed: int, run: int) -> Array:
        """What drives the plant of a run, u_ref (samples x p), as far as the wire tells it: within half a code of each input.

        It is read off the run without faults, u_ref = u - u_eq + K (x - x_eq): faults do not move it.
        """
        model = self.design.model
        plant, feedback = Plant(self.native, self.design, reference, (), seed, run), model.plant.feedback
        assert feedback is not None
        rows = []
        for _ in range(samples):
            u = np.array(plant.read())[model.inputs]
            rows.append(u - model.plant.equilibrium_input + feedback.gain @ (np.array(plant.state) - model.plant.equilibrium))
            plant.move()
        return np.array(rows)


@contextlib.contextmanager
def deaf() -> Iterator[None]:
    """Processes started in here do not hear Ctrl-C: it is the parent's to end them. The parent hears afterwards what came meanwhile."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def crew(count: int, initializer: Callable[..., None] | None = None, initargs: tuple[Any, ...] = ()) -> Iterator[ProcessPoolExecutor]:
    """Worker processes of their own interpreter. Where the block breaks off they end at once: what they have begun may take them a minute more, and nobody waits for it."""
    with ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"), initializer=initializer, initargs=initargs) as pool:
        try:
            yield pool
        except BaseException:
            for child in multiprocessing.active_children():
                child.terminate()
            pool.shutdown(cancel_futures=True)
            raise


def _enter(begin: Callable[[Any], Any], job: Any) -> None:
    _context["made"] = begin(job)


def _one(work: Callable[[Any, Any], Any], item: Any) -> Any:
    return work(_context["made"], item)


def each(begin: Callable[[Job], Context], work: Callable[[Context, Item], Result], job: Job, items: Sequence[Item], workers: int, tick: Tick) -> list[Result]:
    """work(begin(job), item) of every item, in the order of the items. Both functions live in modules: they are called in other processes."""
    if workers <= 1 or len(items) <= 1:
        made, results = begin(job), []
        for item in items:
            results.append(work(made, item))
            tick(1)
        return results
    with crew(min(workers, len(items)), _enter, (begin, job)) as pool:
        with deaf():  # the first tasks start the workers
            waiting = [pool.submit(_one, work, item) for item in items]
        for done in as_completed(waiting):
            done.result()
            tick(1)
        return [done.result() for done in waiting]
