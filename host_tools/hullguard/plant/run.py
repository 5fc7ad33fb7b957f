"""One run: readings from the emulated plant or a recording, frames by the senders' triggers, a detector node on a bus or in this process.

A second node in this process takes the same frames. It shows what a bus does not carry (values, radii, residuals, thresholds), and in
lockstep its verdicts must be the remote node's.
"""

from __future__ import annotations

import itertools
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from hullguard.bus import candump
from hullguard.bus.bits import bit_times
from hullguard.bus.link import CanLink
from hullguard.core.library import library
from hullguard.core.native import REST, Frame, Native, Node, Sender, Verdict, data_bits, frame_bits, read_verdict
from hullguard.core.pair import Pair
from hullguard.design.design import Design
from hullguard.design.judges import judges, residual_columns
from hullguard.errors import BusError, ExpectationError
from hullguard.model.faults import FaultSpec
from hullguard.model.schema import Model
from hullguard.plant.told import ToldModel

ANSWER_TIMEOUT_S = 10.0
ALARMS = ("provisional", "confirmed")


class Source(Protocol):
    """Where readings come from."""

    def read(self) -> list[float]:
        """Readings of the open sample."""

    def move(self) -> None:
        """On to the next sample."""


@dataclass
class Trace:
    """What a run saw, sample by sample."""

    reading: list[list[float]] = field(default_factory=list)
    value: list[list[float]] = field(default_factory=list)
    radius: list[list[float]] = field(default_factory=list)
    r: list[list[float]] = field(default_factory=list)
    J: list[list[float]] = field(default_factory=list)
    verdict: list[Verdict] = field(default_factory=list)
    events: list[tuple[int, ...]] = field(default_factory=list)  # groups that sent
    bits: list[int] = field(default_factory=list)
    data_bits: list[int] = field(default_factory=list)  # of these, the ones at the data bit rate
    heard: list[Verdict] = field(default_factory=list)  # what a node told that runs freely
    reply_bits: int = 0  # of frames sent only because lockstep answers every tick
    counts: dict[str, int] = field(default_factory=lambda: {"measurement": 0, "closing": 0, "verdict": 0, "reply": 0})
    health: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Pace:
    """How fast: at most `speed` times real time; lockstep waits for the node's verdict on every tick, without it the node's timer keeps time."""

    lockstep: bool
    speed: float = math.inf


class Bus(Protocol):
    """Where frames go. `answer` gives the frames that the node sent for sample k."""

    def send(self, frame: Frame, time_s: float) -> None:
        """One frame from a sender."""

    def answer(self, k: int, expected: list[Frame], time_s: float) -> list[tuple[Frame, float]]:
        """What came back."""


class InProcess:
    """No bus at all: the shadow node's own frames are the answer."""

    def send(self, frame: Frame, time_s: float) -> None:
        """Nothing to do: the shadow node has it already."""

    def answer(self, k: int, expected: list[Frame], time_s: float) -> list[tuple[Frame, float]]:
        """The shadow node's frames."""
        return [(f, time_s) for f in expected]


class OnCan:
    """A bus with a node at its other end."""

    def __init__(self, link: CanLink, native: Native, pace: Pace) -> None:
        self._link, self._native, self._pace = link, native, pace
        self._last = -1  # stamp of the last verdict: a status frame follows it

    def send(self, frame: Frame, time_s: float) -> None:
        """One frame from a sender."""
        self._link.send(frame)

    def answer(self, k: int, expected: list[Frame], time_s: float) -> list[tuple[Frame, float]]:
        """In lockstep wait for as many of the node's frames as the shadow node sent; otherwise take what is there."""
        found: list[tuple[Frame, float]] = []
        end = time.monotonic() + ANSWER_TIMEOUT_S
        while True:
            if self._pace.lockstep and len(found) >= len(expected):
                return found
            left = end - time.monotonic()
            got = self._link.receive(max(left, 0.0) if self._pace.lockstep else 0.0)
            if got is None:
                if not self._pace.lockstep:
                    return found
                raise BusError(f"the detector node did not answer sample {k} within {ANSWER_TIMEOUT_S:g} s; is it running with --lockstep on this bus?")
            if got[0].id in (self._native.tables.verdict.id, self._native.tables.status.id):
                found.append(got)


class Run:
    """The loop."""

    def __init__(self, design: Design, native: Native, bus: Bus, pace: Pace, log: candump.Writer | None = None, start: int = REST) -> None:
        self.design, self.native, self.bus, self.pace = design, native, bus, pace
        self.sender, self.node, self.trace = Sender(native), Node(native, start), Trace()
        self._log = log
        closing = native.tables.closing
        self._order = [g for g in range(len(native.tables.groups)) if g != closing] + [closing]
        self.mismatch: str | None = None
        self.told = ToldModel(native.library, design.model.name, native.tables.hash, native.node.status, native.tables.status)

    def samples(self, source: Source, count: int, watch: Callable[[int, Trace], None] | None = None) -> Trace:
        """Make `count` samples. `watch` is called after each."""
        started = time.monotonic()
        period = self.design.model.sample_time_s
        for k in range(count):
            if math.isfinite(self.pace.speed):
                time.sleep(max(0.0, started + k * period / self.pace.speed - time.monotonic()))
            self._sample(source, k, k * period)
            if watch is not None:
                watch(k, self.trace)
            source.move()
        self.trace.health = self.node.health()
        if not self.pace.lockstep and not isinstance(self.bus, InProcess):
            self._hear_out(count)
        return self.trace

    def _hear_out(self, count: int) -> None:
        """A free-running node's own words take the place of this process's: what it has not said, nobody has found."""
        end = time.monotonic() + 2 * self.native.tables.heartbeat * self.design.model.sample_time_s
        while time.monotonic() < end and (not self.trace.heard or self.trace.heard[-1].k < count - 1):
            self._answers(count - 1, self.trace.verdict[-1], [], (count - 1) * self.design.model.sample_time_s)
            time.sleep(0.01)
        if not self.trace.heard:
            raise BusError("no verdict frame was seen: is a detector node of this model running on this bus?")
        groups = len(self.native.tables.groups)
        said = Verdict(0, "starting", 0, ("absent",) * groups, False)
        told = {v.k: v for v in self.trace.heard}
        for k in range(count):
            said = told.get(k, said)
            self.trace.verdict[k] = replace(said, k=k)

    def _sample(self, source: Source, k: int, time_s: float) -> None:
        reading = source.read()
        events, bits, fast = [], 0, 0
        for g in self._order:
            frame = self.sender.step(g, k, reading)
            if frame is None:
                continue
            events.append(g)
            self._write(frame, time_s)
            self.node.receive(frame)
            self.bus.send(frame, time_s)
            bits += frame_bits(self.native.library, frame)
            fast += data_bits(self.native.library, frame)
            self.trace.counts["closing" if g == self.native.tables.closing else "measurement"] += 1
        verdict = self.node.step()
        if verdict is None:
            raise ExpectationError(f"the closing frame of sample {k} was not accepted: {self.node.health()}")
        expected = self.node.report(self.pace.lockstep)
        told = self._answers(k, verdict, expected, time_s)
        self._record(reading, verdict, tuple(sorted(events)), bits + told[0], fast + told[1])

    def _answers(self, k: int, verdict: Verdict, expected: list[Frame], time_s: float) -> tuple[int, int]:
        """Frames of the node: logged, counted, and in lockstep compared. Bits of those that a free-running node would send too: all, and at the data rate."""
        bits = fast = 0
        got = self.bus.answer(k, expected, time_s)
        for frame, _ in got:
            self._write(frame, time_s)  # a log has one clock, the run's
            self.told.take(frame)
            told = read_verdict(self.native, frame)
            if told is not None and not self.pace.lockstep:
                self.trace.heard.append(replace(told, k=k - (k - told.k) % 4096))
            length = frame_bits(self.native.library, frame)
            if told is not None and told.reply:
                self.trace.counts["reply"] += 1
                self.trace.reply_bits += length
            else:
                self.trace.counts["verdict"] += 1
                bits += length
                fast += data_bits(self.native.library, frame)
        if self.pace.lockstep and self.mismatch is None:
            for frame, own in zip([f for f, _ in got], expected, strict=True):
                if frame != own:
                    self.mismatch = self._difference(k, frame, own, verdict)
                    break
        return bits, fast

    def _difference(self, k: int, frame: Frame, own: Frame, verdict: Verdict) -> str:
        """Why a node's frame is not the one that this process would have sent."""
        told = read_verdict(self.native, frame)
        hint = "; start the node with --rest" if k == 0 else ""
        return f"sample {k}: the node says {told or frame.data.hex()}, this process {verdict}{hint}"

    def _write(self, frame: Frame, time_s: float) -> None:
        if self._log is not None:
            self._log.write(time_s, frame)

    def _record(self, reading: list[float], verdict: Verdict, events: tuple[int, ...], bits: int, fast: int) -> None:
        t = self.trace
        t.reading.append(reading)
        t.value.append(self.node.value)
        t.radius.append(self.node.radius)
        t.r.append(self.node.r)
        t.J.append(self.node.J)
        t.verdict.append(verdict)
        t.events.append(events)
        t.bits.append(bits)
        t.data_bits.append(fast)


def periodic_bits(design: Design, native: Native, readings: Sequence[Sequence[float]]) -> tuple[int, int, int, int]:
    """Frames, bits, bits of the measurement groups alone, and bits at the data rate, if every group sent every sample through the same codec."""
    tables = native.tables
    groups = tuple(replace(g, levels=1, interval_max=1, silence=(0,), delta=g.delta[:1], sigma=g.sigma[:1], activity=g.activity[:1]) for g in tables.groups)
    every = Native(native.library, replace(tables, groups=groups))
    sender = Sender(every)
    frames = bits = measured = fast = 0
    for k, reading in enumerate(readings):
        for g in range(len(groups)):
            frame = sender.step(g, k, reading)
            if frame is not None:
                length = frame_bits(native.library, frame)
                frames, bits, fast = frames + 1, bits + length, fast + data_bits(native.library, frame)
                measured += 0 if g == tables.closing else length
    return frames, bits, measured, fast


def summary(design: Design, native: Native, trace: Trace, faults: Sequence[FaultSpec], facts: dict[str, Any]) -> dict[str, Any]:
    """The object that --json prints; `facts` are what only the caller knows (bus, seed, scenario)."""
    model, tables = design.model, native.tables
    samples = len(trace.verdict)
    first = min((f.start for f in faults), default=samples)
    frames_periodic, bits_periodic, bits_measured, fast_periodic = periodic_bits(design, native, trace.reading)
    length = [bit_times(b, f, model.bitrate_bps, model.data_bitrate_bps) for b, f in zip(trace.bits, trace.data_bits, strict=True)]
    load = _load(length, model.sample_time_s, model.bitrate_bps)
    switched = {"data_bits": sum(trace.data_bits), "data_bits_periodic": fast_periodic} if switches(model) else {}
    groups, intervals = _intervals(tables.groups, tables.closing, trace.events)
    alarms = [v.plant in ALARMS for v in trace.verdict]
    confirmed = [v.plant == "confirmed" for v in trace.verdict]
    counts = trace.counts
    margin = max((abs(r) / J for k in range(min(first, samples)) for r, J in zip(trace.r[k], trace.J[k], strict=True)), default=0.0)
    return {
        "model": model.name,
        "model_hash": f"{tables.hash:08x}",
        "real": native.library.real,
        "known_faults": [f.name for f in model.faults],
        "threshold": model.detector.threshold,
        "judges": [asdict(j) for j in judges(design)],
        **facts,
        "bitrate": model.bitrate_bps,
        **({"data_bitrate": model.data_bitrate_bps} if switched else {}),
        "samples": samples,
        "sample_time_s": model.sample_time_s,
        "frames": {
            "measurement": counts["measurement"],
            "periodic": frames_periodic,
            "total": counts["measurement"] + counts["closing"] + counts["verdict"],
            "lockstep_replies": counts["reply"],
            "bits": sum(trace.bits),
            "bits_periodic": bits_periodic,
            "bits_periodic_measurement": bits_measured,
            "bits_lockstep_replies": trace.reply_bits,
            "load_mean": load[0],
            "load_p99": load[1],
            "load_bound": design.load_bound,
            **switched,
        },
        "per_group": groups,
        "events": {"interval_min": min(intervals, default=None), "interval_max": max(intervals, default=None)},
        "faults": [_found(f, faults, design, trace, alarms, confirmed) for f in faults],
        "false_alarms": {"provisional": _episodes(alarms[:first]), "confirmed": _episodes(confirmed[:first])},
        "communication": trace.health,
        "margin_max": margin,
        "verdicts": changes(design, trace.verdict),
    }


def switches(model: Model) -> bool:
    """Whether the bus has a second bit rate, so that bits alone do not tell the load."""
    return model.data_bitrate_bps != model.bitrate_bps


def _load(bits: Sequence[float], sample_time_s: float, bitrate: int) -> tuple[float, float]:
    """Mean load and the 99th percentile over windows of one second; `bits` are bit times of the nominal rate."""
    window = max(1, round(1.0 / sample_time_s))
    sums = np.convolve(bits, np.ones(min(window, len(bits))), "valid")
    return float(np.sum(bits) / (len(bits) * sample_time_s * bitrate)), float(np.percentile(sums, 99) / (min(window, len(bits)) * sample_time_s * bitrate))


def _intervals(groups: Sequence[Any], closing: int, events: Sequence[tuple[int, ...]]) -> tuple[dict[str, Any], list[int]]:
    per_group, every = {}, []
    for i, g in enumerate(groups):
        at = [k for k, e in enumerate(events) if i in e]
        gaps = np.diff(at)
        values, counts = np.unique(gaps, return_counts=True)
        per_group[g.name] = {
            "frames": len(at),
            "interval_min": int(gaps.min()) if len(gaps) else None,
            "interval_max": int(gaps.max()) if len(gaps) else None,
            "interval_mean": float(gaps.mean()) if len(gaps) else None,
            "histogram": {str(v): int(c) for v, c in zip(values, counts, strict=True)},
        }
        if i != closing:
            every += [int(x) for x in gaps]
    return per_group, every


def _episodes(flags: Sequence[bool]) -> int:
    return sum(1 for before, now in zip([False, *flags], flags, strict=False) if now and not before)


def _found(f: FaultSpec, faults: Sequence[FaultSpec], design: Design, trace: Trace, alarms: list[bool], confirmed: list[bool]) -> dict[str, Any]:
    """When a fault was found: an alarm that rises while it is the newest one. What rose before it, or after a later fault began, is not its own."""
    last = min((o.start for o in faults if o.start > f.start), default=len(alarms))
    quiet = next((k for k in range(f.start, last) if k == 0 or not alarms[k - 1]), last)
    detected = next((k for k in range(quiet, last) if alarms[k]), None)
    sure = None if detected is None else next((k for k in range(detected, len(alarms)) if confirmed[k]), None)
    seen = trace.verdict[detected].candidates if detected is not None else 0
    at, least = (None, 0) if sure is None else _narrowed(trace.verdict[sure:last])
    return {
        "name": f.name,
        "kind": f.kind,
        "spec": str(f),
        "start": f.start,
        "detected_at": detected,
        "confirmed_at": sure,
        "delay": None if detected is None else detected - f.start,
        "fault": _known(design.model, f),
        "candidates": candidate_names(design, seen),
        "narrowed_at": at,
        "narrowed_to": candidate_names(design, least),
    }


def _known(model: Model, f: FaultSpec) -> str | None:
    """The model's fault that an injected one is, by its name or, given by its signal, by what it does there."""
    signal = model.signal(f.name)
    applied = any(g.applied_as_sent and signal in g.signals for g in model.groups)
    named = [x.name for x in model.faults if x.name == f.name]
    alike = [x.name for x in model.faults if x.signal == signal and (x.type == "actuator") == applied]
    return next(iter([*named, *alike]), None)


def _narrowed(verdicts: Sequence[Verdict]) -> tuple[int, int]:
    """Sample since which a confirmed alarm, that of the first verdict, has left as few candidates as it ever did, and these."""
    alarmed = list(itertools.takewhile(lambda v: v.plant == "confirmed", verdicts))
    best = min(alarmed, key=lambda v: v.candidates.bit_count())
    return best.k, best.candidates


def candidate_names(design: Design, mask: int) -> list[str]:
    """Faults of a verdict's mask, by name."""
    return [f.name for i, f in enumerate(design.model.faults) if mask >> i & 1]


def changes(design: Design, verdicts: Sequence[Verdict]) -> list[dict[str, Any]]:
    """The verdicts that say something else than the one before."""
    said: list[dict[str, Any]] = []
    for v in verdicts:
        row = spoken(design, v)
        if not said or {**said[-1], "k": v.k} != row:
            said.append(row)
    return said


def spoken(design: Design, v: Verdict) -> dict[str, Any]:
    """A verdict by names."""
    return {"k": v.k, "plant": v.plant, "candidates": candidate_names(design, v.candidates), "bus": {g.name: b for g, b in zip(design.tables.groups, v.bus, strict=True)}}


def before_filter(design: Design, trace: Trace) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Residuals before the post-filter, from the values that the detector held: samples x residuals, generators one after another."""
    values = np.array(trace.value)
    made = [Pair(library("f64"), g).run(values[:, list(t.signal)])[0] for g, t in zip(design.generators, design.tables.generators, strict=True)]
    return np.hstack(made)


def write_files(directory: Path, design: Design, native: Native, trace: Trace, faults: Sequence[FaultSpec], result: dict[str, Any]) -> None:
    """run.json, signals.csv and labels.csv: all that a report or a doubt needs."""
    model, tables = design.model, native.tables
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "run.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    names = [s.name for s in model.signals]
    residuals = residual_columns(judges(design))
    header = ["time_s", "k"] + [c for n in names for c in (n, f"{n}.value", f"{n}.radius")]
    before = before_filter(design, trace) if result.get("figures") else np.zeros((len(trace.verdict), 0))
    header += [c for x in residuals for c in (f"r{x}", f"J{x}")] + [f"before{x}" for x in residuals[: before.shape[1]]]
    header += ["plant"] + [f"event.{g.name}" for g in tables.groups] + ["bits"] + ["data_bits"] * switches(model)
    codes = {"starting": 0, "none": 1, "provisional": 2, "confirmed": 3}
    with (directory / "signals.csv").open("w", encoding="utf-8") as file:
        file.write(",".join(header) + "\n")
        for k, v in enumerate(trace.verdict):
            row = [f"{k * model.sample_time_s:.6f}", str(k)]
            for i in range(len(names)):
                row += [f"{trace.reading[k][i]:.9g}", f"{trace.value[k][i]:.9g}", f"{trace.radius[k][i]:.9g}"]
            for r, J in zip(trace.r[k], trace.J[k], strict=True):
                row += [f"{r:.9g}", f"{J:.9g}"]
            row += [f"{x:.9g}" for x in before[k]]
            row += [str(codes[v.plant])] + [str(int(g in trace.events[k])) for g in range(len(tables.groups))] + [str(trace.bits[k])]
            row += [str(trace.data_bits[k])] * switches(model)
            file.write(",".join(row) + "\n")
    with (directory / "labels.csv").open("w", encoding="utf-8") as file:
        file.write("start,end,name,kind,size,signal\n")
        for f in faults:
            end = "" if f.end is None else str(f.end)
            file.write(f"{f.start},{end},{f.name},{f.kind},{'' if f.kind == 'freeze' else f'{f.size:g}'},{names[model.signal(f.name)]}\n")
