"""Campaigns of faulty frames over all directives: what each must be counted as and what it was, alarms without a fault, and faults found afterwards."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hullguard.campaign.frames import CONTENT, STAMP, Course, FaultyRun, Tally
from hullguard.campaign.frames_all import HEAVY, SEEN, FrameCase
from hullguard.campaign.tasks import each
from hullguard.codegen.dbc import emit_dbc
from hullguard.core.library import library
from hullguard.core.native import Native
from hullguard.core.protect import Protector
from hullguard.design.design import Design, finish
from hullguard.design.store import Stored
from hullguard.design.tables import MessageTable
from hullguard.inject.codec import Codec, codec_of
from hullguard.model.faults import FaultSpec
from hullguard.model.schema import Model, Scenario

CHUNK = 25  # runs a task
CONFIDENCE = 0.99


@dataclass(frozen=True)
class FramesJob:
    """What every task needs."""

    model: Model
    stored: Stored
    real: str
    scenario: Scenario
    samples: int
    end: int
    faults: tuple[FaultSpec, ...]
    seed: int


@dataclass(frozen=True)
class _Item:
    case: FrameCase
    first: int
    runs: int


class _Worker:
    """Design and codec, made once a process."""

    def __init__(self, job: FramesJob) -> None:
        self.job, self.design = job, finish(job.model, job.stored)
        self.native, self.codec = Native(library(job.real), self.design.tables), codec_for(self.design)


def codec_for(design: Design) -> Codec:
    """The model's frames by name."""
    return codec_of(emit_dbc(design), f"{design.model.name}.dbc", design.tables.groups[design.tables.closing].name)


def _work(worker: _Worker, item: _Item) -> Tally:
    job, total = worker.job, Tally()
    for run in range(item.first, item.first + item.runs):
        faults = job.faults if run % 2 else ()  # every other run is of a healthy plant from end to end
        course = Course(job.scenario, job.samples, job.end, faults, job.seed, run)
        total.add(FaultyRun(worker.design, worker.native, worker.codec, item.case, course).go())
    return total


def study(job: FramesJob, cases: Sequence[FrameCase], runs: int, workers: int, tick: Callable[[int], None]) -> list[Tally]:
    """A tally a case; it does not depend on the number of workers."""
    items = [_Item(c, first, min(CHUNK, runs - first)) for c in cases for first in range(0, runs, CHUNK)]
    done = iter(each(_Worker, _work, job, items, workers, tick))
    tallies = []
    for _ in cases:
        total = Tally()
        for _ in range(0, runs, CHUNK):
            total.add(next(done))
        tallies.append(total)
    return tallies


def residual_rate(message: MessageTable, bits: int) -> float:
    """Share of all patterns of exactly so many flipped bits that the checksum does not see, by counting code words (methods of linear codes).

    The change of the checksum by an error is the sum of the changes by its bits, where the data identifiers do not depend on the counter.
    """
    protector, length = Protector(library("f32"), message.protection), message.length
    crc = message.protection.crc
    wide = 2 if message.protection.profile == "P05" else 1
    zero = _sum(protector, bytes(length), crc, wide)
    counts = np.zeros((bits + 1, 256**wide))
    counts[0, 0] = 1.0
    every = np.arange(256**wide)
    for bit in range(8 * length):
        data = bytearray(length)
        data[bit // 8] = 1 << bit % 8
        own = bit // 8 - crc
        change = 1 << bit % 8 + 8 * own if 0 <= own < wide else _sum(protector, bytes(data), crc, wide) ^ zero
        counts[1:] += counts[:-1, every ^ change]
    return float(counts[bits, 0] / counts[bits].sum())


def _sum(protector: Protector, data: bytes, crc: int, wide: int) -> int:
    """The checksum over data whose counter is in them."""
    return int.from_bytes(protector.sum(data)[crc : crc + wide], "little")


def rows(cases: Sequence[FrameCase], tallies: Sequence[Tally], design: Design) -> list[dict[str, Any]]:
    """The result, a row a case. All intervals of passes hold together with 99 % confidence."""
    heavy = max(1, sum(c.kind == HEAVY for c in cases))
    return [row(c, t, design, 1.0 - (1.0 - CONFIDENCE) / heavy) for c, t in zip(cases, tallies, strict=True)]


def row(case: FrameCase, t: Tally, design: Design, confidence: float = CONFIDENCE) -> dict[str, Any]:
    """One case's line of the result."""
    differ = differences(case, t)
    made = {"spec": case.spec, "action": case.directive.action, "class": case.kind, "runs": t.runs, "frames": t.frames, "injected": t.injected}
    made |= {"ledger": dict(sorted(t.told.items())), "counted": dict(sorted(t.counted.items())), "health": dict(sorted(t.health.items()))}
    made |= {"differences": differ, "equal": not differ, "provisional": t.provisional, "confirmed": t.confirmed, "faults": t.faults, "found": t.found}
    made |= {"delay_max": max(t.delays, default=None)}
    if case.kind == HEAVY:
        made |= _residual(case, t, design, confidence)
    return made


def differences(case: FrameCase, t: Tally) -> list[str]:
    """Where the node's counters and the ledger differ, in words; nothing where they are equal."""
    said = list(t.wrong)
    for name in ("good", "crc", "format", "repeated", "sequence", "untrusted", "numeric", "unknown"):
        if t.health[name] != t.statuses[name]:
            said.append(f"counter {name} {t.health[name]}, frames {t.statuses[name]}")
    if sum(t.health[name] for name in STAMP) != t.statuses["stamp"]:
        said.append(f"counters early and late {sum(t.health[name] for name in STAMP)}, frames {t.statuses['stamp']}")
    for name, n in t.told.items():
        if "|" in name or not name or (case.kind == HEAVY and name in CONTENT):
            continue
        found = t.health[name] if name in ("lost", "invalid") else t.counted[name]
        if name in STAMP:
            found = t.counted["stamp"]
        if name == "good":
            found -= t.told["invalid"]
        if found != n:
            said.append(f"{name}: ledger {n}, node {found}")
    return said


def _residual(case: FrameCase, t: Tally, design: Design, confidence: float) -> dict[str, Any]:
    """Passes against what the code lets pass."""
    from scipy.stats import binom

    options = case.directive.options
    ids = [i.text for i in case.directive.trigger.ids]
    message = next((g.message for g in design.tables.groups if g.name in ids), design.tables.groups[0].message)
    tried = sum(n for name, n in t.told.items() if name not in ("unknown", "format", "lost", ""))
    passed = sum(n for name, n in t.told.items() if name not in ("unknown", "format", "lost", "", "crc"))
    rate = residual_rate(message, min(int(options["bits"]), 8 * message.length)) if "bits" in options else 256.0 ** -(2 if message.protection.profile == "P05" else 1)
    low, high = (int(x) for x in binom.interval(confidence, tried, rate)) if tried else (0, 0)
    return {"tried": tried, "passed": passed, "rate": rate, "interval": [low, high], "within": low <= passed <= high, "passed_at_node": tried - t.counted["crc"]}


def pooled(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Passes of all damaged frames together against what the codes let pass, within the 99 % interval. Rare and independent: a Poisson number."""
    from scipy.stats import poisson

    heavy = [r for r in rows if r["class"] == HEAVY]
    expected = sum(r["tried"] * r["rate"] for r in heavy)
    low, high = (int(x) for x in poisson.interval(CONFIDENCE, expected)) if expected else (0, 0)
    passed = sum(r["passed"] for r in heavy)
    return {"tried": sum(r["tried"] for r in heavy), "passed": passed, "expected": expected, "interval": [low, high], "within": low <= passed <= high}


def failures(rows: Sequence[dict[str, Any]]) -> list[str]:
    """What must not be, in words."""
    said = []
    for r in rows:
        if not r["equal"]:
            said.append(f"{r['spec']}: counters differ from the ledger: {'; '.join(r['differences'][:3])}")
        if r["class"] == SEEN and r["confirmed"]:
            said.append(f"{r['spec']}: {r['confirmed']} confirmed alarms of a healthy plant")
        if r["class"] == SEEN and r["found"] < r["faults"]:
            said.append(f"{r['spec']}: {r['faults'] - r['found']} of {r['faults']} plant faults not found")
        if r["class"] == HEAVY and not r["within"]:
            said.append(f"{r['spec']}: {r['passed']} of {r['tried']} damaged frames passed, expected {r['interval'][0]} .. {r['interval'][1]}")
    together = pooled(rows)
    if not together["within"]:
        said.append(f"{together['passed']} of {together['tried']} damaged frames passed in all, expected {together['interval'][0]} .. {together['interval'][1]}")
    return said
