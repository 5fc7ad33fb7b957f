"""Monte-Carlo study of event-triggered fusion: the acceptance numbers of the method (fusion, section 9) as checks, controls that must be worse among them.

The plant is the method's: a target in a plane at nearly constant velocity, x = [px, vx, py, vy], five scalar sensors (two of px, two of py, one of vx), 0.42 frames a sensor
and sample. All runs are made by the C library (core/fusion.py); every check compares runs of one seed, which see the same plant and the same noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from hullguard.bus.bits import worst_bits
from hullguard.core.fusion import Bench, Case, Filter, Judge, Node, Outcome, Windows
from hullguard.core.library import library
from hullguard.design import fusion as design
from hullguard.design.protection import ProtectionTable
from hullguard.design.tables import MessageTable

SIGMA = np.array([0.1, 0.2, 0.15, 0.25, 0.18])  # m, m, m, m, m/s
PLACES = (0, 0, 2, 2, 1)
SENSORS, STATES = 5, 4
POSITION, VELOCITY = (0, 2), (1, 3)
WEIGHT = (1.0, 0.0, 1.0, 0.0)
RATE = 0.42  # frames a sensor and sample without the heartbeat's
LOSSES = (0.05, 0.10, 0.15)
NEVER: dict[str, Any] = {"heartbeat": 250, "watchdog": 254}  # of a control without either
ORIGIN = (128.0, 0.0, 128.0, 0.0)  # m
WIRE = 1.0 / 512.0  # m or m/s a code of 16 bits, which wrap round in 128
WINDOW, CONVERTER = 10, 0.001
STEP = 0.01  # seconds a sample, where 10 ms of delay are one sample


def tracking(sample_time_s: float) -> design.Fusion:
    """The method's plant."""
    F = np.array([[1.0, sample_time_s], [0.0, 1.0]])
    Q, P0 = np.diag([0.0, 0.01, 0.0, 0.01]), np.diag([4.0, 1.0, 4.0, 1.0])
    return design.Fusion(np.kron(np.eye(2), F), Q, np.eye(STATES)[list(PLACES)], SIGMA**2, np.array([0.0, 1.0, 0.0, 0.5]), P0)


@dataclass(frozen=True)
class Check:
    """One number and the range it must be in."""

    number: str  # of section 9
    what: str
    value: float
    low: float
    high: float

    @property
    def passed(self) -> bool:
        """Whether it is."""
        return self.low <= self.value <= self.high

    def __str__(self) -> str:
        return f"  {'ok' if self.passed else 'FAILED':<6} {self.number:>2}  {self.what:<96} {self.value:10.4g}   {self.low:g} .. {self.high:g}"


@dataclass(frozen=True)
class Size:
    """How much is simulated."""

    runs: int
    samples: int
    faults: int  # runs a sensor with a faulty sensor
    calm: int  # samples without a fault that judge the judge
    long: int  # samples of one course in two number types


QUICK = Size(200, 400, 200, 100000, 2000)
FULL = Size(1000, 400, 1000, 1000000, 100000)


class Study:
    """One plant, one number type, one seed. Outcomes that several checks need are made once."""

    def __init__(self, sample_time_s: float, size: Size, seed: int, real: str = "f32") -> None:
        self.size, self.seed = size, seed
        self.model = tracking(sample_time_s)
        self.bench = Bench(library(real), self.model)
        self.made = design.allocate(self.model, RATE, WEIGHT)
        self._kept: dict[tuple[str, float], Outcome] = {}

    def table(self, late: float = 0.0) -> design.TriggerTable:
        """Thresholds of the recommended design."""
        return design.innovation_table(self.model, self.made.delta, self.made.rates, late=late)

    @cached_property
    def usual(self) -> Filter:
        """The recommended design: allocated innovation trigger, silence used, heartbeat of 10 samples."""
        return Filter((self.table(),))

    @cached_property
    def masked(self) -> Filter:
        """The same with a table for every sensor that may die."""
        return Filter(design.masked_tables(self.model, RATE, WEIGHT))

    @cached_property
    def always(self) -> Filter:
        """For sensors that send whatever their trigger says: silence says nothing."""
        return Filter((design.plain_table(self.model, [1.0] * self.model.sensors),), heartbeat=1)

    def run(self, chosen: Filter, sensor: Filter | None = None, runs: int = 0, **case: Any) -> Outcome:
        """A batch."""
        return self.bench.run(chosen, Case(**({"samples": self.size.samples} | case)), runs or self.size.runs, self.seed, sensor)

    def _once(self, name: str, loss: float, make: Callable[[], Outcome]) -> Outcome:
        if (name, loss) not in self._kept:
            self._kept[name, loss] = make()
        return self._kept[name, loss]

    def periodic(self, loss: float = 0.0) -> Outcome:
        """Every sensor in every sample."""
        return self._once("periodic", loss, lambda: self.run(self.always, send="always", loss=loss))

    def event(self, loss: float = 0.0) -> Outcome:
        """The recommended design; a frame that is lost is lost for all (model A)."""
        return self._once("event", loss, lambda: self.run(self.usual, loss=loss))

    def ratio(self, outcome: Outcome, states: tuple[int, ...] = POSITION, loss: float = 0.0) -> float:
        """Error over that of periodic sending."""
        return outcome.rms(states) / self.periodic(loss).rms(states)

    def tuned(self, make: Callable[[float], tuple[Filter, dict[str, Any]]], rate: float) -> tuple[Filter, dict[str, Any]]:
        """The threshold of a trigger that makes this rate: bisection over its logarithm, on few runs."""
        low, high = 1e-4, 1e2
        for _ in range(14):
            middle = math.sqrt(low * high)
            chosen, case = make(middle)
            sent = self.run(chosen, runs=20, **{"samples": 250} | case).rate
            low, high = (middle, high) if sent > rate else (low, middle)
        return make(high)


def budget(study: Study, coarse: Study) -> Iterator[Check]:
    """1, 5, 6: frames, bits and errors without losses; coarse: one second a sample."""
    event = study.event()
    yield Check("1", "frames incl. heartbeat, share of periodic", event.rate, 0.0, 0.44)
    yield Check("1", "bits on the wire, share of periodic", event.bits / study.periodic().bits, 0.0, 0.44)
    yield Check("1", "position error over periodic", study.ratio(event), 0.995, 1.06)
    yield Check("1", "velocity error over periodic", study.ratio(event, VELOCITY), 0.995, 1.04)
    yield Check("1", "T = 1 s: frames incl. heartbeat, share of periodic", coarse.event().rate, 0.0, 0.44)
    yield Check("1", "T = 1 s: position error over periodic", coarse.ratio(coarse.event()), 0.995, 1.09)
    for name, s in (("", study), ("T = 1 s: ", coarse)):
        free = s.run(Filter((s.table(),), **NEVER))
        yield Check("6", f"{name}position error over the mean field's, no heartbeat", free.rms(POSITION) / s.made.rms(POSITION), 0.98, 1.02)


def losses(study: Study) -> Iterator[Check]:
    """2, 3: model A, and consistency."""
    for loss, most in zip(LOSSES, (1.09, 1.12, 1.16), strict=True):
        yield Check("2", f"loss {loss:.0%}: position error over lossless periodic", study.ratio(study.event(loss)), 0.995, most)
        yield Check("2", f"loss {loss:.0%}: position error over periodic at that loss", study.ratio(study.event(loss), loss=loss), 0.995, 1.06)
    for loss in (0.0, *LOSSES):
        yield Check("3", f"loss {loss:.0%}: mean NEES", study.event(loss).consistency, 3.85, 4.15)
        yield Check("3", f"loss {loss:.0%}: share of samples within the NEES band", study.event(loss).inside(STATES), 0.88, 1.0)


def published(study: Study, limit: float) -> tuple[Filter, dict[str, Any]]:
    """The source's trigger r^2 > limit R, the same for all sensors; silence says nothing, and there is no heartbeat."""
    return Filter((design.plain_table(study.model, limit * study.model.R),), "observation", **NEVER), {}


def controls(study: Study) -> Iterator[Check]:
    """4: what must be seen to be worse."""
    chosen, _ = study.tuned(lambda limit: published(study, limit), RATE)
    silent = study.run(chosen)
    yield Check("4", f"as published, silence unused, {silent.rate:.2f} frames: position error over periodic", study.ratio(silent), 1.15, 9.0)
    yield Check("4", "the same: mean NEES", silent.consistency, 0.0, 3.5)
    decimated = study.run(study.always, send="decimated", rate=(RATE,) * SENSORS)
    yield Check("4", "decimation: position error over periodic", study.ratio(decimated), 1.35, 9.0)
    trusting = design.plain_table(study.model, study.made.delta**2, [[design.beta(float(d)) for d in study.made.delta]] * len(design.LOSS_RATES))
    yield Check("4", "loss 15 % ignored (beta_0): mean NEES", study.run(Filter((trusting,)), loss=0.15).consistency, 4.4, 99.0)


def stochastic(study: Study, level: float) -> tuple[Filter, dict[str, Any]]:
    """Closed-loop stochastic trigger, uniform; larger levels send more, hence the inverse."""
    sensors = study.model.sensors
    share = [[design.beta_stochastic(1.0 / level, p)] * sensors for p in design.LOSS_RATES]
    return Filter((design.plain_table(study.model, [1.0 / level] * sensors, share),), "stochastic", **NEVER), {}


def windowed(study: Study, detrended: bool, tau: float) -> tuple[Filter, dict[str, Any]]:
    """Variance trigger at the sensors, var > tau R, heartbeat of 10 samples."""
    levels = tuple(design.variance_level(tau * r, WINDOW, CONVERTER, detrended) for r in study.model.R)
    chosen = Filter((design.plain_table(study.model, [1.0] * study.model.sensors),), "own")
    return chosen, {"windows": Windows(WINDOW, detrended, levels, CONVERTER)}


def triggers(study: Study) -> Iterator[Check]:
    """5: with the right model no trigger beats periodic sending. And the ranges in which section 6 has each of them."""
    uniform = design.innovation_table(study.model, np.full(SENSORS, design.delta_of(RATE)), np.full(SENSORS, RATE))
    plan = design.scheduled(study.model, 0.44)
    cases: dict[str, tuple[tuple[Filter, dict[str, Any]], float, float]] = {
        "innovation, uniform": ((Filter((uniform,)), {}), 1.05, 1.09),
        "stochastic": (study.tuned(lambda v: stochastic(study, v), RATE), 1.10, 1.15),
        "prediction variance": ((Filter((design.plain_table(study.model, plan.level),), "scheduled", **NEVER), {}), 1.15, 1.30),
        "variance about the line": (study.tuned(lambda v: windowed(study, True, v), 0.436), 1.4, 2.2),
        "variance about the mean": (study.tuned(lambda v: windowed(study, False, v), 0.48), 1.6, 2.6),
    }
    for name, ((chosen, case), low, high) in cases.items():
        found = study.run(chosen, **case)
        yield Check("5", f"{name}, {found.rate:.3f} frames: position error over periodic", study.ratio(found), low, high)


def dead_sensor(study: Study) -> Iterator[Check]:
    """8: the best sensor dies; the worst of what follows."""
    case: dict[str, Any] = {"fault": "dead", "fault_at": 100, "skip": 100 + 5 * study.masked.watchdog}
    guarded = study.run(study.masked, **case)
    blind = study.run(Filter((study.table(),), **NEVER), **case)
    yield Check("8", "dead sensor: mean NEES later", guarded.consistency, 0.0, 4.6)
    yield Check("8", "the same without heartbeat and watchdog: mean NEES", blind.consistency, 6.0, 99.0)
    yield Check("8", "position error over that without a watchdog", guarded.rms(POSITION) / blind.rms(POSITION), 0.0, 1.0)


def outliers(study: Study) -> Iterator[Check]:
    """9: one value in a hundred is off by 20 standard deviations."""
    robust = study.run(Filter((study.table(),), huber=3.0), outlier=0.01)
    yield Check("9", "1 % outliers: position error over clean periodic", study.ratio(robust), 0.995, 1.12)
    yield Check("9", "the same, last 50 samples: no lock-out", robust.rms(POSITION, study.size.samples - 50) / study.periodic().rms(POSITION), 0.9, 1.2)
    yield Check("9", "Huber's weight without an outlier: position error over periodic", study.ratio(study.run(Filter((study.table(),), huber=3.0))), 0.995, 1.06)
    yield Check("9", "1 % outliers without Huber's weight", study.ratio(study.run(study.usual, outlier=0.01)), 1.5, 9.0)


def late_frames(fine: Study) -> Iterator[Check]:
    """10: ten milliseconds a sample, half of the frames one sample late for all but their sender. Every node is there."""
    late, nodes = 0.5, SENSORS + 1
    delayed = Filter((fine.table(late=late),), depth=2, delay=1)
    found = fine.run(delayed, late=late, nodes=nodes)
    yield Check("10", f"half of the frames late, {found.rate:.3f} frames: position error over periodic", fine.ratio(found), 0.995, 1.07)
    yield Check("10", "the same: mean NEES", found.consistency, 3.8, 4.15)
    yield Check("10", "the same: samples in which settled states differ", float(found.unequal), 0.0, 0.0)
    dropped = fine.run(fine.usual, loss=late, lossy="centre", nodes=2, runs=fine.size.runs // 2)
    yield Check("10", "late frames dropped, and their absence taken for silence: position error", fine.ratio(dropped), 1.5, 99.0)


def manoeuvre(study: Study) -> Iterator[Check]:
    """11: both velocities jump by 3 m/s."""
    case: dict[str, Any] = {"jump_at": 200, "jump": (0.0, 3.0, 0.0, 3.0)}
    event, periodic = study.run(study.usual, **case), study.run(study.always, send="always", **case)
    yield Check("11", "jump of 3 m/s: position error of the 40 samples from it on, over periodic", event.rms(POSITION, 200, 240) / periodic.rms(POSITION, 200, 240), 0.95, 1.05)


def one_sided_loss(study: Study) -> Iterator[Check]:
    """13: frames that the centre alone loses; each frame carries the history of its sensor (frames of 7 bytes)."""
    case: dict[str, Any] = {"loss": 0.15, "lossy": "centre", "nodes": 2, "resolution": WIRE}
    centre = Filter((study.table(),), depth=8, origin=ORIGIN)
    sensor = Filter((study.table(),), origin=ORIGIN)
    found = study.run(centre, sensor, recall=True, **case)
    yield Check("13", "centre loses 15 %, history in the frames: position error over periodic", study.ratio(found), 0.995, 1.18)
    yield Check("13", "the same without history", study.ratio(study.run(sensor, sensor, **case)), 1.2, 9.0)


def same_state(study: Study) -> Iterator[Check]:
    """12: all nodes, 15 % loss, 16-bit values, an origin that moves."""
    runs = max(1, study.size.calm // 10000)
    chosen = Filter((study.table(),), origin=ORIGIN)
    found = study.run(chosen, runs=runs, samples=10000, loss=0.15, nodes=SENSORS + 1, resolution=WIRE)
    yield Check("12", f"{10000 * runs} samples, {SENSORS + 1} nodes, 15 % loss: samples in which their states differ", float(found.unequal), 0.0, 0.0)
    yield Check("12", "the same: steps that the origin has moved", float(found.origins), 1.0, math.inf)


def precision(study: Study, samples: int, offset: float, rows: bool = False) -> Iterator[Check]:
    """7: the same frames to a float32 and to a float64 filter, about so many metres from the origin, which does not move."""
    rng = np.random.default_rng([study.seed, int(offset)])
    model, chosen = study.model, Filter((study.table(),), rows=rows)
    narrow, wide = Node(library("f32"), model, chosen), Node(library("f64"), model, chosen)
    x, middle = model.x0.copy(), np.array([offset, 0.0, offset, 0.0])
    counter = [0] * SENSORS
    dP = dx = size = 0.0
    for k in range(samples):
        x = 0.995 * (model.A @ x + np.sqrt(np.diag(model.Q)) * rng.standard_normal(STATES))  # stays in its neighbourhood
        y = (model.C @ (x + middle) + np.sqrt(model.R) * rng.standard_normal(SENSORS)).astype(np.float32).astype(float)
        for node in (narrow, wide):
            node.open()
        for i in (i for i in range(SENSORS) if wide.due(i, y[i])):
            counter[i] += 1
            for node in (narrow, wide):
                node.receive(i, k, counter[i], y[i])
        for node in (narrow, wide):
            node.close()
        if k >= 50:
            P, found = wide.P, wide.x
            dP = max(dP, float(np.abs(narrow.P - P).max() / np.abs(P).max()))
            dx, size = max(dx, float(np.abs(narrow.x - found).max())), max(size, float(np.abs(found).max()))
    yield Check("7", f"float32 beside float64, {samples} samples, |x| <= {size:.0f} m: largest difference of P, relative", dP, 0.0, 1e-5)
    yield Check("7", "the same: largest difference of x, 2^-23 |x|", dx / (float(np.finfo(np.float32).eps) * size), 0.0, 8.0)


def same_errors(study: Study) -> Iterator[Check]:
    """7: each number type with its own events."""
    wide = Study(0.1, study.size, study.seed, "f64")
    yield Check("7", "position error of float32 over float64's, each with its own events", study.event().rms(POSITION) / wide.event().rms(POSITION), 0.999, 1.001)


@dataclass(frozen=True)
class Wire:
    """What sending costs: bits a sensor and sample on classic CAN with 11-bit identifiers, checksum, counter and stamp in every frame."""

    what: str
    length: int  # bytes of a frame
    rate: float  # frames a sensor and sample
    exact: float  # bits, mean of the frames sent
    worst: float  # with the most stuff bits
    position: float  # error over lossless periodic float32

    def __str__(self) -> str:
        return f"  {self.what:<34} {self.length} bytes  {self.rate:6.3f} frames  {self.exact:7.2f} bits  {self.worst:7.2f} at most   {self.position:6.3f}"


def wire(study: Study) -> Iterator[Wire]:
    """Periodic and event-triggered, float32 and 16 bits."""
    protection = ProtectionTable("P22", 0, 8, 0, 12, "both", 0, tuple(range(16)), ())
    for name, resolution, length in (("float32", 0.0, 6), ("16 bits of 2 mm", WIRE, 4)):
        most = worst_bits(MessageTable("fusion", 0x140, 0, length, protection))
        for what, chosen, send in (("periodic", study.always, "always"), ("event-triggered", study.usual, "trigger")):
            moving = replace(chosen, origin=ORIGIN)
            found = study.run(moving, send=send, resolution=resolution)
            yield Wire(f"{what}, {name}", length, found.rate, found.bits, found.rate * most, study.ratio(found))


JUDGE = Judge()


def judgement(study: Study) -> Iterator[Check]:
    """The consistency test: false alarms, and faulty sensors found within 50 samples."""
    calm = study.run(study.usual, runs=max(1, study.size.calm // 10000), samples=10000, judge=JUDGE)
    yield Check("C", f"false alarms per 1e5 samples, {study.size.calm} samples", calm.blames * 1e5 / study.size.calm, 0.0, 1.0)
    for i in range(SENSORS):
        for kind, size in (("bias", 3.0 * SIGMA[i]), ("freeze", 0.0)):
            case: dict[str, Any] = {"samples": 120, "skip": 0, "fault": kind, "fault_sensor": i, "fault_size": size, "fault_at": 70, "judge": JUDGE}
            found = study.run(study.usual, runs=study.size.faults, **case)
            right = [at >= 70 and who == 1 << i for at, who in zip(found.blamed_at, found.blamed, strict=True)]
            yield Check("C", f"sensor {i + 1}, {kind}{' of 3 sigma' if size else ''}: found within 50 samples", float(np.mean(right)), 0.95, 1.0)


def all_checks(size: Size, seed: int, real: str = "f32") -> Iterator[Check]:
    """Everything, in the order of section 9."""
    study = Study(0.1, size, seed, real)
    yield from budget(study, Study(1.0, size, seed, real))
    for part in (losses, controls, triggers, dead_sensor, outliers):
        yield from part(study)
    yield from late_frames(Study(STEP, size, seed, real))
    for offset in (0.0, 5000.0):
        yield from precision(study, size.long, offset)
    for part in (same_errors, manoeuvre, same_state, one_sided_loss, judgement):
        yield from part(study)
