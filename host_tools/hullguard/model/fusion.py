"""A model of kind "fusion": a linear plant with noise, and scalar sensors that speak when the common prediction does not already say it.

[plant]
builder = "constant_velocity"        # axes = ["x", "y"]; or "car_following"; or states = [..] with A and Q
speed_noise_mps = 0.1                # standard deviation of what a speed changes by in a sample
x0 = [..]  P0 = [..]                 # mean and variances of the initial state

[[sensors]]
name = "x1_m"
state = "x_m"                        # or row = [..], one number a state
sigma = 0.1
encoding = "float32"                 # or "int16" with resolution, which goes round with wraps = true
frame = { id = 0x140 }
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hullguard.errors import InputError
from hullguard.model.faults import FaultSpec, parse_fault
from hullguard.model.schema import (
    NAME,
    SCHEMA,
    Frame,
    _fingerprint,
    _override,
    _read_file,
    find_model,
    read_frame,
)
from hullguard.model.table import Array, Table

KIND = "fusion"
TRIGGERS = ("innovation", "observation", "stochastic", "scheduled")
ENCODINGS = ("float32", "int16")
DRIVES = ("noise", "traffic")
SENSORS_MAX, STATES_MAX = 16, 32
DEAD = "dead"
OWN = ("tick", "verdict", "status")  # messages beside the sensors'
_DEAD = re.compile(r"^(?P<name>\w+):dead@(?P<start>\d+)(?:\.\.(?P<end>\d+))?$")
CODES = 32767  # of 16 bits, on either side of 0


@dataclass(frozen=True)
class FusionPlant:
    """x+ = A x + w, w ~ N(0, Q)."""

    builder: str  # "" for matrices
    states: tuple[str, ...]
    A: Array
    Q: Array
    x0: Array
    P0: Array
    origin: tuple[float, ...]  # [n] step of the local origin, 0: none


@dataclass(frozen=True)
class FusionSensor:
    """One scalar sensor and its frame."""

    name: str
    row: tuple[float, ...]
    sigma: float
    frame: Frame
    encoding: str
    resolution: float  # signal units a code
    largest: float  # |y| that a frame can carry, without wraps
    wraps: bool


@dataclass(frozen=True)
class FusionTrigger:
    """When a sensor speaks, and what its silence is worth."""

    kind: str
    rate: float  # frames a sensor and sample, without the heartbeat's
    weight: tuple[float, ...]  # [n] of the states' variances in the allocation of that budget
    uniform: bool  # every sensor the same threshold
    level: tuple[float, ...]  # [m] chosen thresholds; () where the design finds them
    silence: bool  # False: silence says nothing, as published
    heartbeat: int
    watchdog: int
    delay: int  # samples that a frame may be late as a matter of course
    depth: int  # samples that can be filtered again
    late: float  # probability that a frame has not come when its sample is closed; 0 without delay
    huber: float
    loss: float
    smoothing: float


@dataclass(frozen=True)
class FusionJudge:
    """The consistency test; hg_consistency_config."""

    onsets: int
    stride: int
    least: float  # standard deviations
    limit: float
    confirm: int
    repeats: int
    rest: int


@dataclass(frozen=True)
class FusionScenario:
    """A named run."""

    name: str
    samples: int
    drive: str
    loss: float
    late: float  # probability that a sensor's frame comes after the tick of its sample, in the next one
    jump_at: int  # sample in which the state jumps; -1: never
    jump: tuple[float, ...]
    faults: tuple[FaultSpec, ...]


@dataclass(frozen=True)
class FusionModel:
    """A whole model."""

    name: str
    path: Path
    sample_time_s: float
    bitrate_bps: int
    load_max: float
    plant: FusionPlant
    sensors: tuple[FusionSensor, ...]
    trigger: FusionTrigger
    judge: FusionJudge | None
    tick: Frame
    verdict: Frame
    status: Frame
    heartbeat: int
    estimate: Frame  # of the first state; the others follow
    interval: int
    ranges: tuple[tuple[float, float], ...]  # [n] largest |state| and standard deviation in an estimate frame
    scenarios: tuple[FusionScenario, ...]
    sha256: str

    @property
    def names(self) -> list[str]:
        """Names of the sensors."""
        return [s.name for s in self.sensors]

    def sensor(self, name: str) -> int:
        """Place of a sensor by its name."""
        if name not in self.names:
            raise InputError(f"'{name}' is no sensor of model {self.name}: {', '.join(self.names)}")
        return self.names.index(name)

    def scenario(self, name: str | None) -> FusionScenario:
        """A scenario by name; the first one without a name."""
        if name is None:
            return self.scenarios[0]
        for s in self.scenarios:
            if s.name == name:
                return s
        raise InputError(f"model {self.name} has no scenario '{name}': {', '.join(s.name for s in self.scenarios)}")


def kind_of(name: str) -> str:
    """Kind of a model file, by shipped name or path; empty where it says none that is text."""
    kind = _read_file(find_model(name)).get("kind", "")
    return kind if isinstance(kind, str) else ""


def parse_sensor_fault(text: str) -> FaultSpec:
    """A fault SPEC of a sensor; beside the usual kinds NAME:dead@START: it sends nothing."""
    found = _DEAD.match(text.strip())
    if not found:
        return parse_fault(text)
    start, end = int(found["start"]), int(found["end"]) if found["end"] else None
    if end is not None and end <= start:
        raise InputError(f"fault '{text}': it ends at {end}, not after its start at {start}")
    return FaultSpec(found["name"], DEAD, 0.0, start, end)


def load_fusion(name: str, overrides: dict[str, Any] | None = None) -> FusionModel:
    """Read a model by shipped name or path, with `overrides` (dotted keys, as --set gives them)."""
    path = find_model(name)
    data = _read_file(path)
    for key, value in (overrides or {}).items():
        _override(data, key, value)
    return parse_fusion(data, path)


# --- plant -----------------------------------------------------------------------------------------------------------------------------


def _constant_velocity(t: Table, period: float) -> tuple[tuple[str, ...], Array, Array]:
    """A point on each axis: position and speed."""
    axes = t.names("axes")
    if not axes or not all(NAME.match(a) for a in axes):
        raise t.error("axes", 'expected names of axes, for example ["x", "y"]')
    noise = t.number("speed_noise_mps", 1e-9)
    states = tuple(n for a in axes for n in (f"{a}_m", f"{a}_speed_mps"))
    F = np.array([[1.0, period], [0.0, 1.0]])
    return states, np.kron(np.eye(len(axes)), F), np.diag(np.tile([0.0, noise**2], len(axes)))


def _car_following(t: Table, period: float) -> tuple[tuple[str, ...], Array, Array]:
    """Two cars on a road, each with position, speed and acceleration; the second follows the first."""
    noise = t.number("acceleration_noise_mps2", 1e-9)
    F = np.array([[1.0, period, period**2 / 2], [0.0, 1.0, period], [0.0, 0.0, 1.0]])
    states = tuple(n for i in (1, 2) for n in (f"position{i}_m", f"speed{i}_mps", f"accel{i}_mps2"))
    return states, np.kron(np.eye(2), F), np.diag(np.tile([0.0, 0.0, noise**2], 2))


BUILDERS: dict[str, Callable[[Table, float], tuple[tuple[str, ...], Array, Array]]] = {
    "constant_velocity": _constant_velocity,
    "car_following": _car_following,
}


def _read_plant(t: Table, period: float) -> FusionPlant:
    builder = t.text("builder", "", list(BUILDERS))
    if builder:
        states, A, Q = BUILDERS[builder](t, period)
    else:
        states = tuple(t.names("states"))
        A, Q = t.matrix("A", len(states), len(states)), t.matrix("Q", len(states), len(states))
    n = len(states)
    if not 1 <= n <= STATES_MAX or len(set(states)) != n:
        raise t.error("states", f"{n} states, {len(set(states))} names; 1 .. {STATES_MAX} with a name each")
    if not np.allclose(Q, Q.T) or float(np.linalg.eigvalsh((Q + Q.T) / 2).min()) < -1e-12:
        raise t.error("Q", "a covariance is symmetric and not negative")
    wide = t.vector("P0", n, 1e-12)
    origin = np.zeros(n)
    steps = t.table("origin", optional=True)
    for name in steps.data:
        if name not in states:
            raise t.error("origin", f"'{name}' is not one of {', '.join(states)}")
        j = states.index(name)
        step = steps.number(name)
        if step <= 0:
            raise t.error("origin", f"the step of {name} must be a number above 0")
        if not np.array_equal(A[:, j], np.eye(n)[j]):
            raise t.error("origin", f"{name} moves other states by its size, so its origin cannot be shifted; only where column {j + 1} of A is that of the unit matrix")
        origin[j] = step
    plant = FusionPlant(builder, states, A, Q, t.vector("x0", n), np.diag(wide), tuple(float(x) for x in origin))
    t.close()
    return plant


# --- sensors, trigger, judge -------------------------------------------------------------------------------------------------------------


def _row(t: Table, states: Sequence[str]) -> tuple[float, ...]:
    if "row" in t:
        row = t.vector("row", len(states))
        if not np.any(row):
            raise t.error("row", "all zero: the sensor sees nothing")
        return tuple(float(x) for x in row)
    state = t.text("state", None, list(states))
    return tuple(float(s == state) for s in states)


def _read_sensor(t: Table, states: Sequence[str]) -> FusionSensor:
    name = t.text("name")
    if not NAME.match(name):
        raise t.error("name", f"'{name}' is no name: small letters, digits and underscores, at most 31, a letter first")
    if name in OWN:
        raise t.error("name", f"'{name}' is a message of the filter's own; choose another")
    encoding = t.text("encoding", "float32", ENCODINGS)
    inner = t.table("frame")
    frame = read_frame(inner, int(inner.whole("id", 0, 0x1FFFFFFF)) & 0xFFFF)
    if frame.profile not in (None, "P22", "P02"):
        raise t.error("frame", f"a sensor's frame has a counter of 16 values and a stamp in one byte: profile P22 or P02, not {frame.profile}")
    sigma = t.number("sigma", 1e-12)
    if encoding == "float32":
        largest, wraps = t.number("largest", 1e-6, 1e7, 8192.0), False
        resolution = 2.0 ** float(np.ceil(np.log2(largest / 2.0**30)))
    else:
        resolution, wraps = t.number("resolution", 1e-9), t.flag("wraps", False)
        largest = CODES * resolution
        if wraps and largest < 20 * sigma:
            raise t.error("resolution", f"values go round every {2 * largest:g}, less than 40 standard deviations; make it coarser")
    if resolution > sigma:
        raise t.error("resolution" if encoding == "int16" else "largest", f"codes are {resolution:g} apart, coarser than sigma = {sigma:g}")
    sensor = FusionSensor(name, _row(t, states), sigma, frame, encoding, resolution, largest, wraps)
    t.close()
    return sensor


def _read_trigger(t: Table, n: int, m: int) -> FusionTrigger:
    kind = t.text("kind", "innovation", TRIGGERS)
    chosen = "level" in t
    if kind in ("observation", "stochastic") and not chosen:
        raise t.error("level", f"the {kind} trigger needs its thresholds, one a sensor; or take innovation or scheduled, whose design finds them")
    if kind == "scheduled" and chosen:
        raise t.error("level", "a schedule follows from rate; remove it")
    heartbeat = t.whole("heartbeat", 1, 250, 10)
    depth = t.whole("depth", 0, 14, 0)
    delay = t.whole("delay", 0, depth, 0)
    if "late" in t and not delay:
        raise t.error("late", "frames that come after their sample's tick are for delay = 1 or more, with depth at least as large; set both or remove it")
    trigger = FusionTrigger(
        kind=kind,
        rate=t.number("rate", 0.02, 0.95) if not chosen else 0.0,
        weight=tuple(float(x) for x in t.vector("weight", n, 0.0)) if not chosen else (),
        uniform=t.flag("uniform", False),
        level=tuple(float(x) for x in t.vector("level", m, 1e-12)) if chosen else (),
        silence=t.flag("silence", True),
        heartbeat=heartbeat,
        watchdog=t.whole("watchdog", heartbeat, 254, min(3 * heartbeat, 254)),
        delay=delay,
        depth=depth,
        late=t.number("late", 0.0, 0.95, 0.5) if delay else 0.0,
        huber=t.number("huber", 0.0, 100.0, 0.0),
        loss=t.number("loss", 0.0, 0.3, 0.05),
        smoothing=t.number("smoothing", 0.0, 1.0, 1.0 / 128.0),
    )
    if not chosen and not any(trigger.weight):
        raise t.error("weight", "all zero: nothing says which errors count")
    t.close()
    return trigger


def _read_judge(t: Table) -> FusionJudge:
    judge = FusionJudge(
        onsets=t.whole("onsets", 1, 255, 25),
        stride=t.whole("stride", 1, 255, 2),
        least=t.number("least", 0.0, 100.0, 2.5),
        limit=t.number("limit", 1e-3, 1e4, 24.0),
        confirm=t.whole("confirm", 1, 255, 10),
        repeats=t.whole("repeats", 2, 255, 0) if "repeats" in t else 0,
        rest=t.whole("rest", 0, 255, 50),
    )
    t.close()
    return judge


def _read_scenarios(top: Table, states: int, names: Sequence[str], where: str) -> tuple[FusionScenario, ...]:
    found = []
    for t in top.tables("scenarios", optional=True):
        faults = tuple(parse_sensor_fault(f) for f in t.names("faults", []))
        for f in faults:
            if f.name not in names:
                raise t.error("faults", f"'{f.name}' is no sensor: {', '.join(names)}")
        jump_at = t.whole("jump_at", 0, 10_000_000) if "jump_at" in t else -1
        jump = tuple(float(x) for x in t.vector("jump", states)) if jump_at >= 0 else ()
        loss, late = t.number("loss", 0.0, 0.9, 0.0), t.number("late", 0.0, 0.9, 0.0)
        found.append(FusionScenario(t.text("name"), t.whole("samples", 1, 10_000_000), t.text("drive", "noise", DRIVES), loss, late, jump_at, jump, faults))
        t.close()
    if len({s.name for s in found}) != len(found):
        raise InputError(f"{where}: two scenarios have the same name; rename one")
    return tuple(found) or (FusionScenario("default", 400, "noise", 0.0, 0.0, -1, (), ()),)


# --- the whole ----------------------------------------------------------------------------------------------------------------------------


def _next(frame: Frame, by: int, where: str) -> Frame:
    """The frame with the next identifier but some."""
    if frame.id + by > (0x1FFFFFFF if frame.extended else 0x7FF):
        raise InputError(f"{where}: there is no identifier 0x{frame.id + by:X}; choose a smaller first one")
    return Frame(frame.id + by, frame.extended, frame.fd, (frame.data_id + by) & 0xFFFF, frame.profile, frame.mode)


def _own_frame(t: Table, key: str) -> Frame:
    inner = t.table(key)
    frame = read_frame(inner, int(inner.whole("id", 0, 0x1FFFFFFF)) & 0xFFFF)
    if frame.profile not in (None, "P22"):
        raise t.error(key, f"this frame has a layout of profile 22, not {frame.profile}; remove it")
    return frame


def _check_ids(model: FusionModel, path: Path) -> None:
    frames = {s.name: s.frame for s in model.sensors} | {"tick": model.tick, "verdict": model.verdict, "status": model.status}
    frames |= {f"estimate {i + 1}": _next(model.estimate, i, path.name) for i in range(len(model.plant.states))}
    seen: dict[tuple[int, bool], str] = {}
    for name, f in frames.items():
        key = (f.id, f.extended)
        if key in seen:
            raise InputError(f"{path.name}: '{seen[key]}' and '{name}' have the same identifier 0x{f.id:X}; give each its own")
        seen[key] = name
    for s in model.sensors:
        if s.frame.id > model.tick.id:
            raise InputError(f"{path.name}: sensor '{s.name}' (0x{s.frame.id:X}) would arrive after the tick (0x{model.tick.id:X}): give the tick the larger identifier")


def parse_fusion(data: dict[str, Any], path: Path) -> FusionModel:
    """Check a model's data and make a FusionModel of it."""
    top = Table(data, path.name)
    if top.whole("schema", 1, 10_000) != SCHEMA:
        raise top.error("schema", f"this version reads schema {SCHEMA}")
    name = top.text("name")
    if not NAME.match(name):
        raise top.error("name", f"'{name}' is no name: small letters, digits and underscores, at most 31, a letter first")
    top.text("kind", None, [KIND])
    period = top.number("sample_time_s", 1e-6, 3600.0)
    bus = top.table("bus", optional=True)
    bitrate, load_max = bus.whole("bitrate_bps", 10_000, 1_000_000, 500_000), bus.number("load_max", 0.01, 1.0, 0.7)
    bus.close()
    plant = _read_plant(top.table("plant"), period)
    n = len(plant.states)
    sensors = tuple(_read_sensor(t, plant.states) for t in top.tables("sensors"))
    if not 1 <= len(sensors) <= SENSORS_MAX or len({s.name for s in sensors}) != len(sensors):
        raise InputError(f"{path.name}: {len(sensors)} sensors; 1 .. {SENSORS_MAX} with a name each")
    verdict = top.table("verdict")
    estimate = top.table("estimate")
    model = FusionModel(
        name=name,
        path=path,
        sample_time_s=period,
        bitrate_bps=bitrate,
        load_max=load_max,
        plant=plant,
        sensors=sensors,
        trigger=_read_trigger(top.table("trigger"), n, len(sensors)),
        judge=_read_judge(top.table("consistency")) if "consistency" in top else None,
        tick=_own_frame(top, "tick"),
        verdict=_own_frame(verdict, "frame"),
        status=_next(_own_frame(verdict, "frame"), 1, path.name),
        heartbeat=verdict.whole("heartbeat_samples", 1, 65535, 10),
        estimate=_own_frame(estimate, "frame"),
        interval=estimate.whole("interval_samples", 1, 65535, 10),
        ranges=tuple(zip(estimate.vector("largest", n, 1e-6).tolist(), estimate.vector("deviation", n, 1e-9).tolist(), strict=True)),
        scenarios=_read_scenarios(top, n, [s.name for s in sensors], path.name),
        sha256=_fingerprint(data),
    )
    for t in (verdict, estimate, top):
        t.close()
    _check_ids(model, path)
    return model
