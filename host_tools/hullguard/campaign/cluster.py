"""The chunks of a campaign on a Dask cluster. A chunk carries model and stored design; a worker needs this package and the built C library."""

from __future__ import annotations

import contextlib
import importlib
import logging
from collections.abc import Iterator, Sequence
from typing import Any

from hullguard.campaign.campaign import Task, Way
from hullguard.campaign.case import Rows, chunk
from hullguard.campaign.tasks import deaf
from hullguard.errors import InputError

PATIENCE_S = 10.0


@contextlib.contextmanager
def cluster(address: str, workers: int) -> Iterator[Way]:
    """On the workers of the scheduler at this address; 'local' starts a cluster of `workers` processes for the campaign."""
    try:
        dask: Any = importlib.import_module("distributed")  # its functions carry no types
    except ImportError as error:
        raise InputError("--scheduler needs Dask, which is not installed: pip install 'hullguard[campaign]', or use --workers") from error
    with contextlib.ExitStack() as stack:
        try:
            if address == "local":
                with deaf():
                    own = dask.LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=":0", silence_logs=logging.CRITICAL)
                client = dask.Client(stack.enter_context(own), timeout=PATIENCE_S)
            else:
                client = dask.Client(address, timeout=PATIENCE_S)
        except (OSError, TimeoutError, ValueError) as error:
            raise InputError(f"--scheduler {address}: no scheduler answers there within {PATIENCE_S:g} s; give tcp://HOST:PORT of a running dask scheduler, or local") from error
        yield _on(stack.enter_context(client), dask.as_completed)


def _on(client: Any, as_completed: Any) -> Way:
    def work(tasks: Sequence[Task]) -> Iterator[tuple[Task, Rows]]:
        # A case goes to the cluster once, however many chunks it has. A chunk is not a pure function to the scheduler: it must not be remembered there.
        cases = {place: client.scatter(case, hash=False) for place, case in {t.place: t.case for t in tasks}.items()}
        waiting = {client.submit(chunk, cases[t.place], t.first, t.count, pure=False): t for t in tasks}
        try:
            for done in as_completed(list(waiting)):
                yield waiting[done], done.result()
        finally:
            client.cancel(list(waiting))

    return work
