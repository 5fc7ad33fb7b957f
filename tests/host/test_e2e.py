"""End-to-end protection of the C library against the package autosar-e2e, frame by frame in both directions; and the state machine on event-triggered
traffic, which it takes for a broken link when it is called once a cycle.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import pytest
from e2e import p01, p02, p05, p11
from host_support import REALS, SEED
from hullguard.core.library import library
from hullguard.core.protect import Header, Protector
from hullguard.design.protection import NO_STAMP, ProtectionTable, own_protection
from hypothesis import given, settings
from hypothesis import strategies as st

MODES = {
    "both": p01.E2E_P01_DATAID_BOTH,
    "alternate": p01.E2E_P01_DATAID_ALT,
    "low": p01.E2E_P01_DATAID_LOW,
    "nibble": p01.E2E_P01_DATAID_NIBBLE,
}
KINDS = [("P01", m) for m in MODES] + [("P11", "both"), ("P11", "nibble"), ("P02", "both"), ("P22", "both"), ("P05", "both")]
MANY = settings(max_examples=400)
LONGEST = {"P01": 30, "P11": 30, "P02": 32, "P22": 32, "P05": 64}  # what the profiles promise; P05: longest CAN frame


@dataclass(frozen=True)
class Case:
    """One message at the standard's places, the header `offset` bytes into the frame, and what it carries."""

    table: ProtectionTable
    offset: int
    data: bytes
    counter: int

    @property
    def ours(self) -> Protector:
        return Protector(library(REALS[len(self.data) % len(REALS)]), self.table)

    @property
    def sent(self) -> bytes:
        """Frame of the C library."""
        return self.ours.protect(self.data, self.counter, 0)

    def _call(self, name: str, frame: bytearray, **more: Any) -> Any:
        t, where = self.table, {"length": len(frame), "offset": self.offset}
        if t.profile in ("P02", "P22"):
            return getattr(p02, f"e2e_p02_{name}")(frame, bytes(t.data_ids), length=len(frame), **more)
        if t.profile == "P05":
            return getattr(p05, f"e2e_p05_{name}")(frame, t.data_id, **where, **more)
        if t.profile == "P11":
            mode = p11.E2E_P11_DATAID_NIBBLE if t.mode == "nibble" else p11.E2E_P11_DATAID_BOTH
            return getattr(p11, f"e2e_p11_{name}")(frame, t.data_id, data_id_mode=mode, **where, **more)
        return getattr(p01, f"e2e_p01_{name}")(frame, t.data_id, data_id_mode=MODES[t.mode], **where, **more)

    def their_frame(self, *, increment: bool = False, start: bytes | None = None) -> bytes:
        """Frame of the package: of these data with this counter, or of an earlier frame with the counter moved on."""
        frame = bytearray(self.data if start is None else start)
        if start is None:
            at = self.table.counter // 8
            frame[at] = self.counter if self.table.profile == "P05" else (frame[at] & 0xF0) | self.counter
        self._call("protect", frame, increment_counter=increment)
        return bytes(frame)

    def they_accept(self, frame: bytes) -> bool:
        return bool(self._call("check", bytearray(frame)))


@st.composite
def cases(draw: st.DrawFn) -> Case:
    profile, mode = draw(st.sampled_from(KINDS))
    header = 3 if profile == "P05" else 2
    length = draw(st.integers(header, LONGEST[profile]))
    # The package knows P02 at the beginning of the frame only.
    offset = 0 if profile in ("P02", "P22") else draw(st.integers(0, length - header))
    table, _ = own_protection(profile, mode, draw(st.integers(0, 0xFFFF)))
    table = replace(table, crc=offset, counter=table.counter + 8 * offset, nibble=table.nibble + 8 * offset, stamp=NO_STAMP)
    if table.data_ids:
        table = replace(table, data_ids=tuple(draw(st.binary(min_size=16, max_size=16))))
    return Case(table, offset, draw(st.binary(min_size=length, max_size=length)), draw(st.integers(0, table.modulus - 1)))


@MANY
@given(cases())
def test_both_write_the_same_frame(case: Case) -> None:
    assert case.sent == case.their_frame()


@MANY
@given(cases())
def test_each_accepts_the_others_frame(case: Case) -> None:
    assert case.they_accept(case.sent)
    assert case.ours.check(case.their_frame()) == Header(case.counter, None)


@MANY
@given(cases(), st.data())
def test_both_refuse_the_same_frames(case: Case, data: st.DataObject) -> None:
    """Wrong bits anywhere, half of the time under a checksum that is right again: then the counter's range and the nibble decide."""
    frame = bytearray(case.sent)
    own = case.table.counter // 8  # byte of counter and nibble
    for bit in data.draw(st.sets(st.one_of(st.integers(0, 8 * len(frame) - 1), st.integers(8 * own, 8 * own + 7)), max_size=6)):
        frame[bit // 8] ^= 1 << bit % 8
    if data.draw(st.booleans()):
        at = slice(case.table.crc, case.table.crc + (2 if case.table.profile == "P05" else 1))
        frame[at] = case.their_frame(start=bytes(frame))[at]
    assert (case.ours.check(bytes(frame)) is not None) == case.they_accept(bytes(frame))


@MANY
@given(cases())
def test_their_counter_runs_as_ours_does(case: Case) -> None:
    frame = case.their_frame()
    for i in range(1, 20):
        frame = case.their_frame(increment=True, start=frame)
        assert case.ours.check(frame) == Header((case.counter + i) % case.table.modulus, None)


@MANY
@given(cases(), st.integers(0, 15))
def test_p22_is_p02_and_p11_is_p01_on_the_wire(case: Case, stamp: int) -> None:
    twins = {"P02": "P22", "P22": "P02", "P01": "P11", "P11": "P01", "P05": "P05"}
    stamped = replace(case.table, stamp=8 * (len(case.data)))
    own, twin = (Protector(library(), replace(stamped, profile=p)) for p in (stamped.profile, twins[stamped.profile]))
    data = case.data + b"\xa5"
    frame = own.protect(data, case.counter, stamp)
    assert frame == twin.protect(data, case.counter, stamp)
    assert own.check(frame) == twin.check(frame) == Header(case.counter, stamp)


class Machine:
    """hg_e2e_machine with a window of 5 for every state, of which one good frame keeps VALID; `back`: good ones that lead back from INVALID."""

    def __init__(self, back: int) -> None:
        found = library()
        self._lib = found.lib
        self._limits, self._self = found.ffi.new("hg_e2e_limits *"), found.ffi.new("hg_e2e_machine *")
        for limit, ok, error in ((self._limits.init, 1, 0), (self._limits.valid, 1, 1), (self._limits.invalid, back, 0)):
            limit.window, limit.ok, limit.error = 5, ok, error
        self._lib.hg_e2e_machine_start(self._self)

    def step(self, received: bool) -> None:
        self._lib.hg_e2e_machine_step(self._self, self._limits, self._lib.HG_OK if received else self._lib.HG_E_EMPTY)

    @property
    def valid(self) -> bool:
        return bool(self._self.state == self._lib.HG_E2E_VALID)


def by_cycle(machine: Machine, received: bool, age: int, heartbeat: int) -> None:
    """As AUTOSAR has it: once a cycle, whether there was a frame or not."""
    machine.step(received)


def by_event(machine: Machine, received: bool, age: int, heartbeat: int) -> None:
    """On reception, and each time that the heartbeat's deadline has passed without one."""
    if received:
        machine.step(True)
    elif age and age % (heartbeat + 1) == 0:
        machine.step(False)


def not_valid(call: Callable[[Machine, bool, int, int], None], every: int, heartbeat: int, back: int, cycles: int, dies: int = 0) -> float:
    """Share of the cycles in which the machine is not VALID. The sender says something every `every` cycles on average, and at the latest
    `heartbeat` cycles after the last time. With `dies` it falls silent in that cycle, and only what follows counts.
    """
    draw, machine, age, count = random.Random(SEED), Machine(back), 0, 0
    for k in range(cycles):
        sends = (draw.random() < 1 / every or age + 1 >= heartbeat) and (dies == 0 or k < dies)
        age = 0 if sends else age + 1
        call(machine, sends, age, heartbeat)
        count += k >= dies and not machine.valid
    return count / (cycles - dies)


@pytest.mark.parametrize(("every", "heartbeat", "back", "least"), [(4, 20, 3, 0.5), (20, 100, 3, 0.95), (4, 20, 1, 0.2), (20, 100, 1, 0.7)])
def test_the_machine_called_by_cycle_takes_silence_for_a_fault(every: int, heartbeat: int, back: int, least: float) -> None:
    cyclic, driven = (not_valid(call, every, heartbeat, back, 200_000) for call in (by_cycle, by_event))
    print(f"a frame every {every} cycles, heartbeat {heartbeat}, {back} good lead back: not VALID {cyclic:.1%} by cycle, {driven:.4%} by event and deadline")
    assert cyclic > least
    assert driven < 0.001


@pytest.mark.parametrize(("every", "heartbeat"), [(4, 20), (20, 100)])
def test_the_machine_driven_by_deadlines_finds_a_dead_sender(every: int, heartbeat: int) -> None:
    """Events, not cycles, push the last good frame out of the window of 5: with the fifth deadline missed, counted from that frame."""
    after = 5 * (heartbeat + 1)
    share = not_valid(by_event, every, heartbeat, 3, 10_000 + 2 * after, dies=10_000)
    assert share == pytest.approx(0.5, abs=(heartbeat + 1) / (2 * after))
