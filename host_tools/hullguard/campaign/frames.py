"""Runs with faulty frames: emulated plant and senders, an injector as a gateway, a detector node with a clock, all in virtual time and in one process.

Every frame that the node gets is known to be untouched or to be some directive's, and so is what a receiver must make of it: the ledger's
counters are compared with the node's own, one by one.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from hullguard.campaign.frames_all import HEAVY, FrameCase
from hullguard.core.native import REST, Frame, Native, Plant, Sender, Verdict
from hullguard.design.design import Design
from hullguard.inject.codec import Codec
from hullguard.inject.engine import Injector, Sent
from hullguard.inject.labels import Ledger, text
from hullguard.model.faults import FaultSpec
from hullguard.model.schema import Scenario
from hullguard.plant.detect import Detector

MEASURED_AT, CLOSED_AT = 0.1, 0.2  # when in a sample its frames are sent, in samples
PATIENCE = 0.5  # samples that a closing frame may come late
STATUS = {1: "good", -4: "numeric", -5: "format", -6: "unknown", -7: "crc", -8: "repeated", -9: "stamp", -14: "sequence", -15: "untrusted"}  # hg_status
STAMP = ("early", "late")  # two counters, one status
PLACED = ("stamp", "sequence", "repeated", "untrusted")  # what a frame in order may still be refused for
CONTENT = ("good", "numeric", "invalid")
WORDS = 20  # examples kept of what is not explained


Watch = Callable[[Frame, float, str], None]  # every frame that the node got, its time, and what it was counted as


@dataclass
class Tally:
    """What one run, or many, came to."""

    runs: int = 0
    samples: int = 0
    frames: int = 0  # that the node got
    injected: int = 0  # events of the ledger
    told: Counter[str] = field(default_factory=Counter)  # ledger: what a receiver must count, by event
    counted: Counter[str] = field(default_factory=Counter)  # node: what it made of the frames that the ledger tells of
    statuses: Counter[str] = field(default_factory=Counter)  # node: the same of all frames
    health: Counter[str] = field(default_factory=Counter)  # node: its health counters
    passes: list[tuple[int, float, str, str, str]] = field(default_factory=list)  # damaged frames that the checksum let pass: run, time, frame, ledger, node
    wrong: list[str] = field(default_factory=list)  # frames that were counted as nothing the ledger allows, in words
    provisional: int = 0  # episodes without a plant fault
    confirmed: int = 0
    faults: int = 0
    found: int = 0
    delays: list[int] = field(default_factory=list)  # samples from the fault, or from the end of the injection if later, to the confirmed alarm

    def add(self, other: Tally) -> None:
        """Another run's."""
        for name in ("runs", "samples", "frames", "injected", "provisional", "confirmed", "faults", "found"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name in ("told", "counted", "statuses", "health"):
            getattr(self, name).update(getattr(other, name))
        self.wrong += other.wrong[: max(0, WORDS - len(self.wrong))]
        self.passes += other.passes
        self.delays += other.delays


@dataclass(frozen=True)
class Course:
    """One run: how long, until when frames are tampered with, and the plant faults."""

    scenario: Scenario
    samples: int
    end: int  # first sample in which no frame is tampered with any more
    faults: tuple[FaultSpec, ...]
    seed: int
    run: int


class FaultyRun:
    """One run."""

    def __init__(self, design: Design, native: Native, codec: Codec, case: FrameCase, course: Course, watch: Watch | None = None) -> None:
        self._course, self._case, self._watch = course, case, watch
        self._period = design.model.sample_time_s
        self._plant = Plant(native, design, course.scenario.reference, course.faults, course.seed, course.run)
        self._sender = Sender(native)
        closing = native.tables.closing
        self._order = [g for g in range(len(native.tables.groups)) if g != closing] + [closing]
        self._closing_id = native.tables.groups[closing].message.id
        self._ledger = Ledger()
        self._injector = Injector([case.directive], codec, course.seed * 1_000_003 + course.run, True, self._ledger)
        self.verdicts: list[Verdict] = []
        self._detector = Detector(native, REST, False, None, self.verdicts.append, self._period)
        self._deadline = math.inf
        self.tally = Tally(runs=1, samples=course.samples)

    def go(self) -> Tally:
        """Make the run."""
        for k in range(self._course.samples):
            reading = self._plant.read()
            for g in self._order:
                frame = self._sender.step(g, k, reading)
                if frame is not None:
                    time_s = (k + (CLOSED_AT if g == self._order[-1] else MEASURED_AT)) * self._period
                    self._deliver(self._injector.take(frame, time_s))
            self._plant.move()
        self._deliver(self._injector.finish())
        return self._judged()

    def _deliver(self, sent: Sequence[Sent]) -> None:
        for s in sent:
            while s.time_s > self._deadline:
                self._detector.overdue()
                self._deadline += self._period
            before = self._detector.samples
            status = self._detector.take(s.frame, s.time_s)
            if self._detector.samples != before:
                self._deadline = s.time_s + (1.0 + PATIENCE) * self._period
            self._count(s, status)

    def _count(self, s: Sent, status: int) -> None:
        t, name = self.tally, STATUS[status]
        t.frames += 1
        t.statuses[name] += 1
        if self._watch is not None:
            self._watch(s.frame, s.time_s, name)
        if not s.expects:
            return
        t.counted[name] += 1
        heavy = self._case.kind == HEAVY and s.expects in CONTENT  # no error of few bits: the header may be anything
        if heavy:
            t.passes.append((self._course.run, s.time_s, text(s.frame), s.expects, name))
        if name not in self._allowed(s.expects) and not (heavy and name in PLACED) and len(t.wrong) < WORDS:
            t.wrong.append(f"run {self._course.run}, {s.time_s:.3f} s: {text(s.frame)} counted as {name}, the ledger says {s.expects}")

    @staticmethod
    def _allowed(expects: str) -> set[str]:
        names = {"stamp" if x in STAMP else "good" if x == "invalid" else x for x in expects.split("|")}
        # A frame in order whose place is the receiver's to judge may also meet a link that others of its kind have spoilt.
        return names | ({"untrusted"} if "good" in names and len(names) > 1 else set())

    def _judged(self) -> Tally:
        t, c = self.tally, self._course
        t.injected = sum(self._ledger.actions.values())
        t.told.update(self._ledger.expects)
        t.health.update(self._detector.node.health())
        first = min((f.start for f in c.faults), default=c.samples)
        healthy = [v for v in self.verdicts if v.k < first]
        for before, now in zip([None, *healthy], healthy, strict=False):
            was = before.plant if before is not None else "none"
            t.provisional += now.plant == "provisional" and was not in ("provisional", "confirmed")
            t.confirmed += now.plant == "confirmed" and was != "confirmed"
        if c.faults:
            t.faults = 1
            at = next((v.k for v in self.verdicts if v.k >= first and v.plant == "confirmed"), None)
            t.found = int(at is not None)
            t.delays = [] if at is None else [max(0, at - max(first, c.end))]
        return t
