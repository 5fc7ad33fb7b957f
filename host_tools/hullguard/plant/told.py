"""Which model a node at the other end of a bus runs, by the status frame that it sends with every heartbeat."""

from __future__ import annotations

from hullguard.core.library import Library
from hullguard.core.native import Frame, frame_in
from hullguard.design.tables import MessageTable


def read_status(library: Library, message: object, frame: Frame) -> tuple[int, int, int] | None:
    """Model hash, frames lost and frames refused (frame.h); None for a damaged frame. `message` is the hg_message; its protection is a verdict's, so one check reads both."""
    verdict, reply = library.ffi.new("hg_verdict *"), library.ffi.new("bool *")
    if library.lib.hg_verdict_read(message, frame_in(library, frame), verdict, reply) != library.lib.HG_OK:
        return None
    return int.from_bytes(frame.data[2:6], "little"), frame.data[6], frame.data[7]


def another(name: str, theirs: int | None, ours: int) -> str | None:
    """A line for whoever has to do something about a node of another model; None where nothing is wrong, or nothing known."""
    if theirs is None or theirs == ours:
        return None
    return f"the ECU runs another model: its hash is {theirs:08x}, that of {name} {ours:08x}; build its image from this model, or name the one that it runs"


class ToldModel:
    """What the last good status frame says of the node's model."""

    def __init__(self, library: Library, name: str, expected: int, message: object, table: MessageTable) -> None:
        self._library, self._name, self._expected, self._message, self._id = library, name, expected, message, table.id
        self.hash: int | None = None

    def take(self, frame: Frame) -> None:
        """Any frame from the bus."""
        if frame.id == self._id and (told := read_status(self._library, self._message, frame)) is not None:
            self.hash = told[0]

    @property
    def model(self) -> str:
        """unknown, match or other."""
        return "unknown" if self.hash is None else "match" if self.hash == self._expected else "other"

    @property
    def complaint(self) -> str | None:
        """As another()."""
        return another(self._name, self.hash, self._expected)

    def facts(self) -> dict[str, str]:
        """For --json."""
        return {"ecu_model": self.model, "ecu_hash": "" if self.hash is None else f"{self.hash:08x}"}
