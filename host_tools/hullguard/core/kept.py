"""C objects that live as long as who asked for them."""

from __future__ import annotations

from typing import Any

from hullguard.core.library import Library


class Kept:
    """Configurations in one library; the memory they lie in lives as long as this."""

    def __init__(self, library: Library) -> None:
        self.library = library
        self._keep: list[Any] = []

    def new(self, kind: str, value: Any = None) -> Any:
        """A C object."""
        made = self.library.ffi.new(kind, value)
        self._keep.append(made)
        return made
