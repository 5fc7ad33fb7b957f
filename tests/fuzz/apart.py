"""A process that lasts, for readers that start one a file because a library may die of it: the same function, called in a process that is replaced when it has died.

It is what such a reader knows as ProcessPoolExecutor(1), used in the same way; starting a process for every case would be most of a case's time. A
call may use `seconds` of the processor; one that takes longer is a Hang, which the reader cannot take for a damaged file.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Any


class Hang(BaseException):
    """A case took too long; no Exception, which a reader might take for a damaged file."""


def _serve(link: Connection, near: Connection, seconds: int) -> None:
    """One call after the other, each with its own limit of processor time, until the other end is closed."""
    near.close()
    signal.signal(signal.SIGPROF, signal.SIG_DFL)  # it dies of it, also within a library's own loop
    while True:
        try:
            call, *given = link.recv()
        except EOFError:
            return
        signal.setitimer(signal.ITIMER_PROF, seconds)
        try:
            answer: tuple[bool, Any] = (True, call(*given))
        except Exception as error:  # the caller's business
            answer = (False, error)
        signal.setitimer(signal.ITIMER_PROF, 0)
        link.send(answer)


class Answer:
    """What concurrent.futures.Future is to a caller that waits at once."""

    def __init__(self, of: Lasting) -> None:
        self._of = of

    def result(self) -> Any:
        """What the function returned or raised; BrokenProcessPool when it died."""
        return self._of.answer()


class Lasting:
    """The process, between calls and when it has died."""

    def __init__(self, seconds: int) -> None:
        self._seconds = seconds
        self._process: BaseProcess | None = None
        self._link: Connection | None = None

    def __call__(self, _: int) -> Lasting:
        """In place of ProcessPoolExecutor(1)."""
        return self

    def __enter__(self) -> Lasting:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        return None

    def submit(self, call: Callable[..., Any], *given: Any) -> Answer:
        """Send it off."""
        if self._link is None:
            self._link, far = multiprocessing.Pipe()
            process = multiprocessing.get_context("fork").Process(target=_serve, args=(far, self._link, self._seconds), daemon=True)
            process.start()
            self._process = process
            far.close()
        self._link.send((call, *given))
        return Answer(self)

    def answer(self) -> Any:
        """Of the call sent last."""
        assert self._link is not None
        try:
            well, found = self._link.recv()
        except (EOFError, ConnectionResetError):
            died = self.end()
            raise Hang if died == -signal.SIGPROF else BrokenProcessPool(f"died of {died}") from None
        if well:
            return found
        raise found

    def end(self) -> int | None:
        """Let go of the process; what it ended with."""
        process, link, self._process, self._link = self._process, self._link, None, None
        if process is None or link is None:
            return None
        with contextlib.suppress(OSError):
            link.close()
        process.join()
        return process.exitcode
