"""Requests for a freeze frame on a bus, and what comes back (hullguard/freeze.h). Lost frames are asked for once more."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from hullguard.bus.link import CanLink
from hullguard.core.library import Library
from hullguard.core.native import Frame
from hullguard.core.protect import Protector
from hullguard.design.tables import FreezeTable
from hullguard.errors import BusError

STATE, READ, CLEAR = 1, 2, 3
STATES = ("off", "recording", "closing", "frozen")
NO_WORD = 0xFFFF
ANSWER_S = 0.25  # patience with one answer: an ECU may be busy with a sample
TRIES = 20  # requests running that bring nothing new
PACE_S = 0.01  # between two requests: reading leaves the bus to others

Tick = Callable[[int, int], None]


@dataclass(frozen=True)
class State:
    """What the ECU says of its record."""

    state: str
    missed: int  # alarms confirmed since it was frozen
    record: int
    words: int


class Reader:
    """One ECU's freeze frame, over an open bus."""

    def __init__(self, library: Library, link: CanLink, table: FreezeTable) -> None:
        self._link, self._table = link, table
        self._request, self._response = Protector(library, table.request.protection), Protector(library, table.response.protection)
        self._counter = 0
        self._last = 0.0
        self._words: dict[int, int] = {}

    def _ask(self, command: int, record: int = 0, first: int = 0, count: int = 0) -> None:
        time.sleep(max(0.0, self._last + PACE_S - time.monotonic()))
        data = bytes((0, 0, command, record)) + first.to_bytes(2, "little") + count.to_bytes(2, "little")
        self._link.send(Frame(self._table.request.id, self._table.request.flags, self._request.protect(data, self._counter, 0)))
        self._counter = (self._counter + 1) % 16
        self._last = time.monotonic()

    def _hear(self, until: Callable[[], bool]) -> State | None:
        """Take responses until there is nothing more to wait for, or for as long as one may take; the last state that came."""
        state, end = None, time.monotonic() + ANSWER_S
        while (left := end - time.monotonic()) > 0.0:
            got = self._link.receive(left)
            if got is None or got[0].id != self._table.response.id or self._response.check(got[0].data) is None:
                continue
            place, word = (int.from_bytes(got[0].data[i:j], "little") for i, j in ((2, 4), (4, 8)))
            if place == NO_WORD:
                state = State(STATES[word & 3], word >> 2 & 0x3F, word >> 8 & 0xFF, word >> 16)
            else:
                self._words[place] = word
            if state is not None and until():
                break
        return state

    def state(self) -> State:
        """The ECU's answer; BusError where none comes."""
        for _ in range(TRIES):
            self._ask(STATE)
            if (state := self._hear(lambda: True)) is not None:
                return state
        raise BusError(
            f"no ECU answered a request for its freeze frame (0x{self._table.request.id:X}): is it running on this bus, and built from a model with this [freeze] section?"
        )

    def read(self, state: State, tick: Tick) -> list[int]:
        """All words of a record that is frozen."""
        self._words = {}
        window, tries = max(self._table.burst - 1, 1), 0
        while len(self._words) < state.words:
            before = len(self._words)
            first = next(i for i in range(state.words) if i not in self._words)
            wanted = range(first, min(first + window, state.words))
            self._ask(READ, state.record, first, len(wanted))
            told = self._hear(lambda wanted=wanted: all(i in self._words for i in wanted))  # type: ignore[misc]
            if told is not None and (told.state, told.record) != (state.state, state.record):
                raise BusError(f"record {state.record} is gone while it was read: the ECU says {told.state}, record {told.record}; somebody else has cleared it, or it began anew")
            tries = 0 if len(self._words) > before else tries + 1
            if tries >= TRIES:
                raise BusError(f"the ECU stopped answering after {len(self._words)} of {state.words} words; is it still running on this bus?")
            tick(len(self._words), state.words)
        return [self._words[i] for i in range(state.words)]

    def clear(self, record: int) -> State:
        """Let the ECU record again."""
        for _ in range(TRIES):
            self._ask(CLEAR, record)
            state = self._hear(lambda: True)
            if state is not None and not (state.state == "frozen" and state.record == record):
                return state
        raise BusError(f"the ECU did not clear record {record}; is it still running on this bus?")
