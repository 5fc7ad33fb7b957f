"""One run of a fusion model on a bus: an emulated or recorded drive, a node of its own for each sensor, the tick, and the node that tells verdicts and estimates.

Every node has a copy of the filter. All copies hear the same frames and must stay equal to the bit; so must a plain filter of the library that is given the
values without any frame, and the node at the other end of a bus, whose verdicts and estimates are compared byte for byte.
"""

from __future__ import annotations

import json
import math
import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from hullguard.bus import candump
from hullguard.bus.link import CanLink
from hullguard.core.native import REST, Frame, Verdict, frame_bits, frame_in
from hullguard.core.tracker import DIGEST, FusionSender, Tick, Tracker, TrackerNative
from hullguard.design.fusion_model import FusionDesign
from hullguard.errors import BusError, ExpectationError, InputError
from hullguard.model.faults import FaultSpec
from hullguard.model.fusion import DEAD, FusionModel, FusionScenario
from hullguard.model.table import Array
from hullguard.plant.recording import read_columns
from hullguard.plant.told import ToldModel

ANSWER_TIMEOUT_S = 10.0
RECORDED = ("speed1_mps", "speed2_mps", "gap2_m")  # columns of a recording of two cars
SPRING = (1e-4, 0.02)  # pull a second and unit of position, and of speed
SETTLE = 100  # samples before errors count


# --- drives --------------------------------------------------------------------------------------------------------------------------------


def _leashed(model: FusionModel) -> Array:
    """A of a plant that noise alone would carry out of its sensors' range in a long run: each position on a spring so weak that no filter sees it."""
    A = model.plant.A.copy()
    if model.plant.builder == "constant_velocity":
        for j in range(0, len(A), 2):
            A[j + 1, [j, j + 1]] -= model.sample_time_s * np.array(SPRING)
    return A


def noise_drive(model: FusionModel, scenario: FusionScenario, samples: int, seed: int) -> Array:
    """States by the model's own noise, samples x n."""
    rng, p, A = np.random.default_rng([seed, 1]), model.plant, _leashed(model)
    values, vectors = np.linalg.eigh(p.Q)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    x = p.x0 + np.sqrt(np.diag(p.P0)) * rng.standard_normal(len(p.x0))
    found = np.empty((samples, len(x)))
    for k in range(samples):
        x = A @ x + root @ rng.standard_normal(len(x)) + (np.array(scenario.jump) if k == scenario.jump_at else 0.0)
        found[k] = x
    return found


def traffic_drive(model: FusionModel, samples: int, seed: int) -> Array:
    """Two cars: the first between cruising speeds and stops, the second behind it by the intelligent driver model; samples x 6."""
    if model.plant.builder != "car_following":
        raise InputError(f'model {model.name}: drive = "traffic" is of builder = "car_following"; use drive = "noise"')
    rng, T = np.random.default_rng([seed, 2]), model.sample_time_s
    p, v, a = np.array([0.0, -25.0]), np.array([15.0, 15.0]), np.zeros(2)
    wish, until = 15.0, 0
    found = np.empty((samples, 6))
    for k in range(samples):
        if k >= until:
            wish, until = float(rng.choice([0.0, 8.0, 15.0, 22.0, 30.0])), k + int(rng.integers(80, 200))
        gap = max(p[0] - p[1], 0.5)
        spaced = 3.0 + max(0.0, 1.3 * v[1] + v[1] * (v[1] - v[0]) / (2.0 * math.sqrt(1.5 * 2.0)))
        target = np.array([np.clip(0.5 * (wish - v[0]), -2.5, 1.5), np.clip(1.5 * (1.0 - (v[1] / 34.0) ** 4 - (spaced / gap) ** 2), -4.0, 1.5)])
        a += np.clip(target - a, -0.25, 0.25) + 0.02 * rng.standard_normal(2)
        a = np.where((v <= 0.0) & (a < 0.0), 0.0, a)
        p, v = p + T * v + T**2 / 2 * a, np.maximum(v + T * a, 0.0)
        found[k] = [p[0], v[0], a[0], p[1], v[1], a[1]]
    return found


def recorded_drive(model: FusionModel, path: Path) -> Array:
    """Two cars of a recording: the first one's position is the integral of its speed, the second one's is behind it by the gap; samples x 6."""
    if model.plant.builder != "car_following":
        raise InputError(f'model {model.name}: only builder = "car_following" says how a recording becomes a state')
    columns = read_columns(path, RECORDED, model.sample_time_s, model.name)
    T, (v1, v2, gap) = model.sample_time_s, columns.T
    p1 = np.concatenate([[0.0], np.cumsum(T * (v1[1:] + v1[:-1]) / 2)])
    return np.column_stack([p1, v1, np.gradient(v1, T), p1 - gap, v2, np.gradient(v2, T)])


# --- sensors -------------------------------------------------------------------------------------------------------------------------------


class Sensors:
    """Readings of a drive, with noise and faults; and which frames are lost or late."""

    def __init__(self, made: FusionDesign, drive: Array, faults: Sequence[FaultSpec], scenario: FusionScenario, seed: int) -> None:
        model = made.model
        self._model, self._faults, self._scenario = model, [(model.sensor(f.name), f) for f in faults], scenario
        rng = np.random.default_rng([seed, 3])
        C = np.array([s.row for s in model.sensors])
        self._y = drive @ C.T + rng.standard_normal((len(drive), len(C))) * np.array([s.sigma for s in model.sensors])
        self._noise, self._luck, self._late, self._dice = (np.random.default_rng([seed, i]) for i in (4, 5, 6, 7))
        self._frozen: dict[int, float] = {}

    def read(self, k: int) -> list[float]:
        """Readings of sample k, absolute; NaN of a sensor that is dead."""
        y = [float(v) for v in self._y[k]]
        for i, f in self._faults:
            if k < f.start or (f.end is not None and k >= f.end):
                continue
            y[i] = self._faulty(f, i, y[i], k)
        return y

    def _faulty(self, f: FaultSpec, i: int, y: float, k: int) -> float:
        if f.kind == DEAD:
            return math.nan
        if f.kind == "freeze":
            return self._frozen.setdefault(i, y)
        if f.kind == "noise":
            return y + f.size * float(self._noise.standard_normal())
        if f.kind == "gain":
            return f.size * y
        return y + f.size * ((k - f.start + 1) * self._model.sample_time_s if f.kind == "drift" else 1.0)

    def lost(self) -> bool:
        """Whether the next frame is lost, for all."""
        return bool(self._luck.random() < self._scenario.loss)

    def late(self) -> bool:
        """Whether it comes one sample late."""
        return bool(self._late.random() < self._scenario.late)

    def dice(self) -> float:
        """-2 ln u."""
        return -2.0 * math.log(1.0 - float(self._dice.random()))


# --- the other end -------------------------------------------------------------------------------------------------------------------------


class Bus(Protocol):
    """Where frames go."""

    def send(self, frame: Frame) -> None:
        """One frame."""

    def answer(self, k: int, expected: list[Frame]) -> list[Frame]:
        """What the node sent for sample k."""


class InProcess:
    """No bus at all: this process's node answers."""

    def send(self, frame: Frame) -> None:
        """All copies have it already."""

    def answer(self, k: int, expected: list[Frame]) -> list[Frame]:
        """What the process's own node sent."""
        return expected


class OnCan:
    """A bus with a node at its other end."""

    def __init__(self, link: CanLink, native: TrackerNative, lockstep: bool) -> None:
        self._link, self._lockstep, t = link, lockstep, native.tables
        self._ids = {t.verdict.id, t.status.id, *(e.message.id for e in t.estimate)}

    def send(self, frame: Frame) -> None:
        """One frame of a sensor or the tick."""
        self._link.send(frame)

    def answer(self, k: int, expected: list[Frame]) -> list[Frame]:
        """In lockstep as many frames as this process's node sent; else what is there."""
        found: list[Frame] = []
        end = time.monotonic() + ANSWER_TIMEOUT_S
        while not self._lockstep or len(found) < len(expected):
            got = self._link.receive(max(end - time.monotonic(), 0.0) if self._lockstep else 0.0)
            if got is None:
                if self._lockstep:
                    raise BusError(f"the node did not answer sample {k} within {ANSWER_TIMEOUT_S:g} s; is it running with --lockstep on this bus?")
                return found
            if got[0].id in self._ids:
                found.append(got[0])
        return found


# --- the loop ------------------------------------------------------------------------------------------------------------------------------


@dataclass
class Trace:
    """What a run saw, sample by sample."""

    truth: list[list[float]] = field(default_factory=list)
    reading: list[list[float]] = field(default_factory=list)
    value: list[list[float]] = field(default_factory=list)
    deviation: list[list[float]] = field(default_factory=list)
    scores: list[list[float]] = field(default_factory=list)
    events: list[int] = field(default_factory=list)  # bit i: sensor i sent
    lost: list[int] = field(default_factory=list)  # bit i: and it was lost
    verdict: list[Verdict] = field(default_factory=list)
    heard: list[Verdict] = field(default_factory=list)
    bits: list[int] = field(default_factory=list)  # of sensors' frames
    counts: dict[str, int] = field(default_factory=lambda: {"sensor": 0, "tick": 0, "verdict": 0, "estimate": 0, "reply": 0})
    total: dict[str, int] = field(default_factory=lambda: {"sensor": 0, "tick": 0, "verdict": 0, "estimate": 0, "reply": 0})
    periodic: int = 0  # bits if every sensor sent in every sample
    health: dict[str, int] = field(default_factory=dict)
    unequal: int = 0  # samples in which a copy was not equal to the others
    digest: int = DIGEST


class Plain:
    """The library's filter and consistency test without any frame: told values and counters, it must come to the same state."""

    def __init__(self, native: TrackerNative, start: int) -> None:
        self._tracker, self._lib, self._ffi = Tracker(native, start), native.library.lib, native.library.ffi
        self._fusion = self._ffi.addressof(self._tracker.node.fusion)
        self._judge = self._ffi.addressof(self._tracker.node.consistency) if native.tables.judge else None
        self._sensors, self.digest = native.tables.sensors, DIGEST

    def receive(self, i: int, stamp: int, counter: int, code_value: float, period: float) -> None:
        """A value as it was on the wire, absolute or wrapped round in `period`."""
        lib = self._lib
        y = lib.hg_fusion_local(self._fusion, i, stamp, code_value)
        lib.hg_fusion_receive(self._fusion, i, stamp, counter, lib.hg_fusion_unwrap(self._fusion, i, stamp, y, period) if period else y)

    def step(self) -> None:
        """Close the sample and open the next one."""
        lib = self._lib
        lib.hg_fusion_close(self._fusion)
        blamed = lib.hg_consistency_step(self._judge) if self._judge is not None else 0
        for i in range(self._sensors):
            if blamed >> i & 1:
                lib.hg_fusion_exclude(self._fusion, i, True)
        if blamed:
            lib.hg_consistency_reset(self._judge)
        lib.hg_fusion_open(self._fusion, self._ffi.NULL)
        self.digest = int(lib.hg_tracker_digest(self._fusion, self.digest))


class Run:
    """The loop."""

    def __init__(
        self, made: FusionDesign, native: TrackerNative, bus: Bus, lockstep: bool = True, speed: float = math.inf, log: candump.Writer | None = None, start: int = REST
    ) -> None:
        self.made, self.native, self.bus, self.lockstep, self.speed, self._log = made, native, bus, lockstep, speed, log
        self.centre = Tracker(native, start)
        self.copies = [Tracker(native, start) for _ in range(native.tables.sensors)]
        self.senders = [FusionSender(copy, i) for i, copy in enumerate(self.copies)]
        self.plain, self.tick, self.trace = Plain(native, start), Tick(native), Trace()
        self.mismatch: str | None = None
        self.told = ToldModel(native.library, made.model.name, native.tables.hash, native.config.status, native.tables.status)
        self._waiting: list[tuple[int, Frame]] = []

    def samples(self, drive: Array, sensors: Sensors, count: int, watch: Callable[[int, Trace], None] | None = None) -> Trace:
        """Make `count` samples; `watch` is called after each."""
        started, period = time.monotonic(), self.made.model.sample_time_s
        for k in range(count):
            if math.isfinite(self.speed):
                time.sleep(max(0.0, started + k * period / self.speed - time.monotonic()))
            self._sample(k, drive[k], sensors)
            if watch is not None:
                watch(k, self.trace)
        self.trace.health, self.trace.digest = self.centre.health(), self.centre.digest
        if not self.lockstep:
            self._hear_out(count)
        return self.trace

    def _sample(self, k: int, truth: Array, sensors: Sensors) -> None:
        t, time_s = self.trace, k * self.made.model.sample_time_s
        late, self._waiting = self._waiting, []
        for i, overdue in late:
            self._deliver(i, overdue, time_s)
        reading, events, lost, bits = sensors.read(k), 0, 0, 0
        for i, sender in enumerate(self.senders):
            gone, waits, dice = sensors.lost(), sensors.late(), sensors.dice()
            t.periodic += self._periodic_bits(i, k, reading[i])
            frame = None if math.isnan(reading[i]) else sender.step(reading[i], dice)
            if frame is None:
                continue
            events |= 1 << i
            bits += self._count("sensor", frame)
            if gone:
                lost |= 1 << i
            elif waits:
                self._waiting.append((i, frame))
            else:
                self._deliver(i, frame, time_s)
        verdict = self._close(k, time_s)
        t.truth.append([float(v) for v in truth])
        t.reading.append(reading)
        t.value.append(self.centre.value)
        t.deviation.append(self.centre.deviation)
        t.scores.append(self.centre.scores)
        t.events.append(events)
        t.lost.append(lost)
        t.bits.append(bits)
        t.verdict.append(verdict)

    def _count(self, what: str, frame: Frame) -> int:
        length = frame_bits(self.native.library, frame)
        self.trace.counts[what] += 1
        self.trace.total[what] += length
        return length

    def _write(self, frame: Frame, time_s: float) -> None:
        if self._log is not None:
            self._log.write(time_s, frame)

    def _deliver(self, i: int, frame: Frame, time_s: float) -> None:
        """A sensor's frame as all hear it, its sender too: it was sent for certain."""
        self._write(frame, time_s)
        self.bus.send(frame)
        shared = frame_in(self.native.library, frame)
        taken = [node.take(shared) for node in (self.centre, *self.copies)]
        if taken[0] != self.native.library.lib.HG_OK:
            return  # a late one that no sample is held for any more, or whose link is not to be trusted: the plain filter knows no links
        source = self.native.tables.source[i]
        value = _wire_value(frame, source.signal.resolution)
        period = (source.signal.maximum - source.signal.minimum + 1) * source.signal.resolution if source.wraps else 0.0
        self.plain.receive(i, frame.data[1] >> 4, frame.data[1] & 15, value, period)

    def _periodic_bits(self, i: int, k: int, y: float) -> int:
        """Length of the frame that the sensor would send if it sent every one."""
        source = self.native.tables.source[i]
        if math.isnan(y):
            return 0
        raw = struct.pack("<f", y) if source.message.length == 6 else struct.pack("<H", round(y / source.signal.resolution) & 0xFFFF)
        library = self.native.library
        data = library.ffi.new("uint8_t[]", bytes(2) + raw)
        library.lib.hg_e2e_protect(self.native.config.source[i].message.e2e, data, source.message.length, k % 16, k % 16)
        return frame_bits(library, Frame(source.message.id, source.message.flags, bytes(library.ffi.buffer(data, source.message.length))))

    def _close(self, k: int, time_s: float) -> Verdict:
        """The tick, in every node; their states compared; what the node tells."""
        frame = self.tick.frame(k)
        self._write(frame, time_s)
        self._count("tick", frame)
        self.bus.send(frame)
        shared = frame_in(self.native.library, frame)
        said = []
        for node in (self.centre, *self.copies):
            node.take(shared)
            said.append(node.step())
        self.plain.step()
        if said[0] is None:
            raise ExpectationError(f"the tick of sample {k} was not accepted: {self.centre.health()}")
        digests = {self.plain.digest, *(n.digest for n in (self.centre, *self.copies))}
        same = all(v == said[0] for v in said) and len(digests) == 1
        self.trace.unequal += not same
        expected = self.centre.report(self.lockstep)
        got = self.bus.answer(k, expected)
        for told in got:
            self._write(told, time_s)
            self._hear(k, told)
        if self.lockstep and self.mismatch is None and got != expected:
            self.mismatch = self._difference(k, got, expected)
        return said[0]

    def _hear(self, k: int, frame: Frame) -> None:
        self.told.take(frame)
        verdict = self.native.read_verdict(frame)
        if verdict is not None and not self.lockstep:
            self.trace.heard.append(replace(verdict, k=k - (k - verdict.k) % 4096))
        if verdict is not None and verdict.reply:
            self._count("reply", frame)
        else:
            self._count("verdict" if frame.id in (self.native.tables.verdict.id, self.native.tables.status.id) else "estimate", frame)

    def _difference(self, k: int, got: list[Frame], expected: list[Frame]) -> str:
        """Why a node's frames are not the ones that this process would have sent."""
        for theirs, ours in zip(got, expected, strict=False):
            if theirs != ours:
                return f"sample {k}: the node sent {theirs.id:X}#{theirs.data.hex()}, this process {ours.id:X}#{ours.data.hex()}" + (
                    "; start the node with --rest" if k == 0 else ""
                )
        return f"sample {k}: the node sent {len(got)} frames, this process {len(expected)}"

    def _hear_out(self, count: int) -> None:
        """A free-running node's own words take the place of this process's: what it has not said, nobody has found."""
        end = time.monotonic() + 2 * self.native.tables.heartbeat * self.made.model.sample_time_s
        while time.monotonic() < end and (not self.trace.heard or self.trace.heard[-1].k < count - 1):
            for frame in self.bus.answer(count - 1, []):
                self._hear(count - 1, frame)
            time.sleep(0.01)
        if not self.trace.heard:
            raise BusError("no verdict frame was seen: is a node of this model running on this bus?")
        said = Verdict(0, "starting", 0, ("absent",) * len(self.trace.verdict[0].bus), False)
        told = {v.k: v for v in self.trace.heard}
        for k in range(count):
            said = told.get(k, said)
            self.trace.verdict[k] = replace(said, k=k)


def _wire_value(frame: Frame, resolution: float) -> float:
    """What a sensor's frame says, before anything that wraps is put right."""
    if len(frame.data) == 6:
        return float(struct.unpack("<f", frame.data[2:6])[0])
    return float(struct.unpack("<h", frame.data[2:4])[0]) * resolution


# --- results -------------------------------------------------------------------------------------------------------------------------------


def names_of(made: FusionDesign, mask: int) -> list[str]:
    """Sensors of a verdict's mask, by name."""
    return [n for i, n in enumerate(made.model.names) if mask >> i & 1]


def changes(made: FusionDesign, verdicts: Sequence[Verdict]) -> list[dict[str, Any]]:
    """The verdicts that say something else than the one before."""
    said: list[dict[str, Any]] = []
    for v in verdicts:
        row = {"k": v.k, "plant": v.plant, "candidates": names_of(made, v.candidates), "bus": dict(zip(made.model.names, v.bus, strict=False))}
        if not said or {**said[-1], "k": v.k} != row:
            said.append(row)
    return said


def _found(made: FusionDesign, f: FaultSpec, trace: Trace, first: int) -> dict[str, Any]:
    """When a faulty sensor was flagged: a candidate that was none before the fault."""
    i = made.model.sensor(f.name)
    at = next((v.k for v in trace.verdict[f.start :] if v.candidates >> i & 1), None)
    before = bool(f.start and trace.verdict[f.start - 1].candidates >> i & 1)
    at = None if before else at
    row = {"name": f.name, "kind": f.kind, "spec": str(f), "start": f.start, "detected_at": at, "confirmed_at": at, "delay": None if at is None else at - f.start, "fault": f.name}
    return row | {"candidates": [] if at is None else names_of(made, trace.verdict[at].candidates), "narrowed_at": None, "narrowed_to": []}


def _false_alarms(made: FusionDesign, trace: Trace, faults: Sequence[FaultSpec]) -> int:
    """Candidates that rise without a fault of their sensor having begun."""
    count, last = 0, 0
    begun = {made.model.sensor(f.name): f.start for f in faults}
    for v in trace.verdict:
        for i in range(made.tables.sensors):
            rises = v.candidates >> i & 1 and not last >> i & 1
            count += bool(rises and v.k < begun.get(i, len(trace.verdict)))
        last = v.candidates
    return count


def errors(made: FusionDesign, trace: Trace) -> tuple[Array, Array]:
    """Errors of the estimate and its standard deviations, samples x n."""
    return np.array(trace.value) - np.array(trace.truth), np.array(trace.deviation)


def summary(made: FusionDesign, native: TrackerNative, trace: Trace, faults: Sequence[FaultSpec], facts: dict[str, Any]) -> dict[str, Any]:
    """The object that --json prints; `facts` are what only the caller knows (bus, seed, scenario)."""
    model, samples = made.model, len(trace.verdict)
    first = min([f.start for f in faults if f.start > SETTLE], default=samples)
    e, spread = errors(made, trace)
    part = slice(min(SETTLE, first // 2), first)
    rms = np.sqrt(np.mean(e[part] ** 2, axis=0))
    share = np.mean(np.abs(e[part]) <= 2.0 * spread[part], axis=0)
    predicted = np.sqrt(np.diag(made.told))
    sent = np.array([[b >> i & 1 for i in range(native.tables.sensors)] for b in trace.events])
    total = trace.total["sensor"] + trace.total["tick"] + trace.total["verdict"] + trace.total["estimate"]
    found = [_found(made, f, trace, first) for f in faults]
    period = model.sample_time_s
    return {
        "model": model.name,
        "kind": "fusion",
        "model_hash": f"{native.tables.hash:08x}",
        "real": native.library.real,
        **facts,
        "bitrate": model.bitrate_bps,
        "samples": samples,
        "sample_time_s": period,
        "known_faults": model.names,
        "consistency_limit": native.tables.judge.limit if native.tables.judge else None,
        "frames": {
            "measurement": trace.counts["sensor"],
            "periodic": samples * native.tables.sensors,
            "total": sum(trace.counts.values()) - trace.counts["reply"],
            "lockstep_replies": trace.counts["reply"],
            "bits": total,
            "bits_sensors": trace.total["sensor"],
            "bits_sensors_periodic": trace.periodic,
            "bits_tick": trace.total["tick"],
            "bits_verdicts": trace.total["verdict"],
            "bits_estimates": trace.total["estimate"],
            "bits_periodic": total - trace.total["sensor"] + trace.periodic,
            "load_mean": total / (samples * period * model.bitrate_bps),
            "load_bound": made.load_bound,
        },
        "per_sensor": {n: {"frames": int(sent[:, i].sum()), "rate": float(sent[:, i].mean()), "lost": sum(x >> i & 1 for x in trace.lost)} for i, n in enumerate(model.names)},
        "errors": {
            n: {"rms": float(rms[j]), "predicted": float(predicted[j]), "deviation": float(spread[part][:, j].mean()), "within_2_deviations": float(share[j])}
            for j, n in enumerate(model.plant.states)
        },
        "copies": {"nodes": native.tables.sensors + 2, "samples_unequal": trace.unequal, "digest": f"{trace.digest:08x}"},
        "faults": found,
        "false_alarms": {"provisional": _false_alarms(made, trace, faults), "confirmed": _false_alarms(made, trace, faults)},
        "communication": trace.health,
        "verdicts": changes(made, trace.verdict),
    }


def write_files(directory: Path, made: FusionDesign, trace: Trace, faults: Sequence[FaultSpec], result: dict[str, Any]) -> None:
    """run.json, signals.csv and labels.csv."""
    model = made.model
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "run.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    states, names = model.plant.states, model.names
    header = ["time_s", "k", *(c for n in states for c in (n, f"{n}.estimate", f"{n}.deviation")), *(f"{n}.reading" for n in names)]
    header += [*(f"{n}.score" for n in names if trace.scores[0]), *(f"event.{n}" for n in names), *(f"lost.{n}" for n in names), "plant", "candidates", "bits"]
    codes = {"starting": 0, "none": 1, "provisional": 2, "confirmed": 3}
    with (directory / "signals.csv").open("w", encoding="utf-8") as file:
        file.write(",".join(header) + "\n")
        for k, v in enumerate(trace.verdict):
            row = [f"{k * model.sample_time_s:.6f}", str(k)]
            row += [f"{x:.9g}" for j in range(len(states)) for x in (trace.truth[k][j], trace.value[k][j], trace.deviation[k][j])]
            row += [f"{x:.9g}" for x in (*trace.reading[k], *trace.scores[k])]
            row += [str(mask >> i & 1) for mask in (trace.events[k], trace.lost[k]) for i in range(len(names))]
            file.write(",".join([*row, str(codes[v.plant]), str(v.candidates), str(trace.bits[k])]) + "\n")
    with (directory / "labels.csv").open("w", encoding="utf-8") as file:
        file.write("name,kind,size,start,end\n")
        for f in faults:
            file.write(f"{f.name},{f.kind},{f.size:.9g},{f.start},{len(trace.verdict) if f.end is None else f.end}\n")
