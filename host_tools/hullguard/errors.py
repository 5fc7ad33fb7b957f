"""Errors that a user can act on. Each is one line that names the cause and the cure; the command prints it and nothing else."""

from __future__ import annotations


class HullguardError(Exception):
    """Base class; `status` is the command's exit status. What a message quotes, a key or a file's name, cannot break its line."""

    status = 1

    def __init__(self, message: object) -> None:
        super().__init__("".join(c if c.isprintable() else repr(c)[1:-1] for c in str(message)))


class InputError(HullguardError):
    """Bad input: a file, an option, a model that cannot be made sound."""

    status = 2


class BusError(HullguardError):
    """A bus that cannot be opened or has failed."""

    status = 3


class ExpectationError(HullguardError):
    """A run that did not end as --expect asked, or disagreed with itself."""

    status = 1
