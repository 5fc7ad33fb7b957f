"""The design of a model of kind "fusion": thresholds, what silence is worth, predicted errors, and all tables that the library needs.

What a search found (thresholds by the set of sensors alive) is kept in NAME.design.toml; all that follows from it is plain arithmetic and comes out the same
everywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from hullguard.bus.bits import worst_bits
from hullguard.design.arith import nearest32
from hullguard.design.fusion import (
    LOSS_RATES,
    SILENT,
    Fusion,
    MeanField,
    TriggerTable,
    allocate,
    beta,
    beta_stochastic,
    delta_of,
    mean_field,
    rate_of,
    relaxation,
    scheduled,
)
from hullguard.design.protection import own_protection
from hullguard.design.store import HEADER, opened, path_of
from hullguard.design.tables import EXTENDED, FLOAT32, SIGNED, MessageTable, SignalTable, hash_of, plain_of
from hullguard.errors import InputError
from hullguard.model.fusion import FusionModel, FusionSensor, _next
from hullguard.model.schema import Frame
from hullguard.model.table import Array

VERSION = 1  # rises when the same model would give other numbers
KEPT = 9  # significant digits of what a search found
MUTE = 9.0  # threshold of a sensor that is not alive, standard deviations: its heartbeat alone is wanted
REPEAT_RATE = 1e-7  # of a sensor without a fault, a sample: as many equal values in a row as make it look frozen
MODULUS = 16  # of the frames' counter


@dataclass(frozen=True)
class Found:
    """Thresholds of one set of sensors alive, those of the set in their order."""

    alive: int
    delta: tuple[float, ...]  # innovation standard deviations
    rates: tuple[float, ...]  # frames a sample that the thresholds make
    wide: tuple[float, ...]  # by how much the interval of silence is wider when a sensor's turn comes

    @property
    def sensors(self) -> list[int]:
        """The set."""
        return [i for i in range(16) if self.alive >> i & 1]


@dataclass(frozen=True)
class SourceTable:
    """hg_tracker_source: a sensor's frame."""

    name: str
    message: MessageTable
    signal: SignalTable
    wraps: bool


@dataclass(frozen=True)
class EstimateTable:
    """The frame of one state's estimate."""

    message: MessageTable
    signals: tuple[SignalTable, SignalTable]  # state, standard deviation


@dataclass(frozen=True)
class JudgeTable:
    """hg_consistency_config."""

    onsets: int
    stride: int
    least: tuple[float, ...]
    limit: float
    confirm: int
    repeats: int
    rest: int


@dataclass(frozen=True)
class FusionTables:
    """hg_tracker_config with all that hangs on it; every number is one of float32."""

    name: str
    depth: int
    delay: int
    heartbeat_sensor: int
    watchdog: int
    trigger: str
    A: tuple[tuple[float, ...], ...]
    Q: tuple[tuple[float, ...], ...]
    x0: tuple[float, ...]
    P0: tuple[tuple[float, ...], ...]
    select: tuple[int, ...]  # (): rows
    C: tuple[tuple[float, ...], ...]
    R: tuple[float, ...]
    range: tuple[float, ...]
    huber: float
    origin: tuple[float, ...]  # (): none
    rate_step: float
    loss: float
    smoothing: float
    table: tuple[TriggerTable, ...]
    judge: JudgeTable | None
    source: tuple[SourceTable, ...]
    tick: MessageTable
    verdict: MessageTable
    status: MessageTable
    estimate: tuple[EstimateTable, ...]
    heartbeat: int
    interval: int

    @property
    def states(self) -> int:
        """N."""
        return len(self.A)

    @property
    def sensors(self) -> int:
        """M."""
        return len(self.R)

    @property
    def rates(self) -> int:
        """Loss rates that the tables know."""
        return len(self.table[0].relax)

    @cached_property
    def hash(self) -> int:
        """32 bits that change with any number above: host and node compare them."""
        return hash_of(plain_of(self))


@dataclass(frozen=True)
class FusionDesign:
    """A model with its thresholds."""

    model: FusionModel
    found: tuple[Found, ...]

    @cached_property
    def plant(self) -> Fusion:
        """The plant as the mathematics takes it; rounding to codes is noise of its own."""
        return fusion_of(self.model)

    @cached_property
    def mean(self) -> MeanField:
        """Predicted steady state, all sensors alive; None of a trigger that has none."""
        t = self.model.trigger
        return mean_field(self.plant, self.found[0].rates, t.silence and t.kind == "innovation", t.kind == "innovation")

    @cached_property
    def told(self) -> Array:
        """[n, n] mean covariance of the estimate that is told with a tick: of the newest samples, as many as a frame may be late, `late` of the frames are missing."""
        t, plant, found = self.model.trigger, self.plant, self.found[0]
        P = self.mean.prior if t.delay else self.mean.P
        for back in range(t.delay):
            P = plant.A @ P @ plant.A.T + plant.Q if back else P
            for i, c in enumerate(plant.C):
                there = found.rates[i] * (1.0 - t.late)
                share = there + (1.0 - there) * _shares(self.model, found, i, t.late)
                g = P @ c
                P = P - share * np.outer(g, g) / (c @ g + plant.R[i])
        return P

    @cached_property
    def tables(self) -> FusionTables:
        """What the library needs."""
        return tables_of(self)

    @property
    def load_bound(self) -> float:
        """Largest share of the bus: every sensor, tick, verdict and status with every sample, and the estimates at their interval."""
        t = self.tables
        bits = sum(worst_bits(m) for m in (*(s.message for s in t.source), t.tick, t.verdict)) + worst_bits(t.status) / t.heartbeat
        bits += sum(worst_bits(e.message) for e in t.estimate) / t.interval
        return bits / (self.model.sample_time_s * self.model.bitrate_bps)


def fusion_of(model: FusionModel) -> Fusion:
    """The plant and its sensors."""
    p = model.plant
    noise = [s.sigma**2 + (s.resolution**2 / 12 if s.encoding == "int16" else 0.0) for s in model.sensors]
    return Fusion(p.A, p.Q, np.array([s.row for s in model.sensors]), np.array(noise), p.x0, p.P0)


# --- thresholds ----------------------------------------------------------------------------------------------------------------------------


def _kept(values: Any) -> tuple[float, ...]:
    return tuple(float(f"{float(v):.{KEPT}g}") for v in values)


def _search(model: FusionModel) -> tuple[Found, ...]:
    """The innovation trigger's thresholds: of all sensors, and of all but one wherever the rest still sees everything."""
    plant, t = fusion_of(model), model.trigger
    everyone = list(range(plant.sensors))
    found = []
    for alive in (everyone, *([i for i in everyone if i != out] for out in everyone if len(everyone) > 1)):
        part = plant.only(alive)
        rate = min(t.rate * plant.sensors / len(alive), 0.92)
        try:
            if t.level:
                rates = [rate_of(math.sqrt(t.level[i])) for i in alive]
            elif t.uniform:
                rates = [rate] * len(alive)
            else:
                rates = [float(r) for r in allocate(part, rate, t.weight).rates]
            delta = [math.sqrt(t.level[i]) for i in alive] if t.level else [delta_of(r) for r in rates]
            wide = mean_field(part, rates, t.silence, parallel=True).wide
        except InputError:
            if len(alive) == plant.sensors:
                raise
            continue  # what is left does not see every state: the first table serves
        found.append(Found(sum(1 << i for i in alive), _kept(delta), _kept(rates), _kept(wide)))
    return tuple(found)


def _everyone(model: FusionModel, delta: list[float], rates: list[float]) -> tuple[Found, ...]:
    m = len(model.sensors)
    return (Found((1 << m) - 1, _kept(delta), _kept(rates), (1.0,) * m),)


def find(model: FusionModel) -> tuple[Found, ...]:
    """Thresholds of a model's trigger."""
    t, plant = model.trigger, fusion_of(model)
    if t.kind == "innovation":
        return _search(model)
    if t.kind == "scheduled":
        plan = scheduled(plant, t.rate)
        share = np.bincount([i for step in plan.sends for i in step], minlength=plant.sensors) / plan.period
        return _everyone(model, [math.sqrt(v) for v in plan.level], list(share))
    if t.kind == "stochastic":
        return _everyone(model, [math.sqrt(v) for v in t.level], [1.0 - 1.0 / math.sqrt(1.0 + v) for v in t.level])
    S = np.diag(plant.C @ mean_field(plant, [0.5] * plant.sensors, silence=False).prior @ plant.C.T) + plant.R
    return _everyone(model, [math.sqrt(v) for v in t.level], [rate_of(math.sqrt(v / s)) for v, s in zip(t.level, S, strict=True)])


def write(path: Path, name: str, model: FusionModel, found: tuple[Found, ...]) -> None:
    """Write NAME.design.toml."""
    rows = [{"alive": f.alive, "delta": list(f.delta), "rates": list(f.rates), "wide": list(f.wide)} for f in found]
    path.write_text(HEADER.format(name=name) + tomli_w.dumps({"version": VERSION, "model_sha256": model.sha256, "fusion": rows}), encoding="utf-8")


def read(path: Path, model: FusionModel) -> tuple[Found, ...] | None:
    """A design file's thresholds; None when there is none for this very model."""
    top = opened(path, VERSION)
    if top is None or top.text("model_sha256") != model.sha256:
        return None
    found = []
    for t in top.tables("fusion"):
        alive = t.whole("alive", 1, 0xFFFF)
        count = alive.bit_count()
        found.append(Found(alive, *(tuple(float(v) for v in t.vector(key, count, 0.0)) for key in ("delta", "rates", "wide"))))
        t.close()
    top.close()
    return tuple(found)


def design_fusion(model: FusionModel, fresh: bool = False) -> tuple[FusionDesign, bool]:
    """The design of a model; whether its stored thresholds served."""
    stored = None if fresh else read(path_of(model.path), model)
    made = FusionDesign(model, stored or find(model))
    if made.load_bound > model.load_max:
        raise InputError(
            f"model {model.name}: the bus could be loaded to {100 * made.load_bound:.3g} %, more than load_max = {model.load_max:g}; lower the sample rate or raise bitrate_bps"
        )
    return made, stored is not None


# --- tables --------------------------------------------------------------------------------------------------------------------------------


def _f32(values: Any) -> Any:
    """Numbers, nested as they are, rounded to float32."""
    if isinstance(values, (list, tuple)):
        return tuple(_f32(v) for v in values)
    if isinstance(values, np.ndarray):
        return _f32(values.tolist())
    return float(nearest32(np.array(float(values))))


def message_table(name: str, frame: Frame, length: int) -> MessageTable:
    """A frame of the project's own layout."""
    return MessageTable(name, frame.id, EXTENDED if frame.extended else 0, length, own_protection(frame.profile or "P22", frame.mode, frame.data_id)[0])


def _signal(name: str, resolution: float, minimum: int, maximum: int, start: int, length: int, flags: int) -> SignalTable:
    """A signal of which nothing but its code is needed."""
    res = float(nearest32(np.array(resolution)))
    return SignalTable(name, res, 0.0, float(nearest32(np.array(1.0 / res))), minimum, maximum, start, length, flags, 0.0, 0.0, 0.0, 0)


def _source(s: FusionSensor) -> SourceTable:
    narrow = s.encoding == "int16"
    most = math.floor(s.largest / s.resolution + 1e-9)
    signal = _signal(s.name, s.resolution, -most, most, 16, 16 if narrow else 32, SIGNED if narrow else FLOAT32)
    return SourceTable(s.name, message_table(s.name, s.frame, 4 if narrow else 6), signal, s.wraps)


def _power(x: float) -> float:
    """The power of 2 at or above."""
    return 2.0 ** math.ceil(math.log2(x))


def _estimate(model: FusionModel, j: int) -> EstimateTable:
    name, (largest, deviation) = model.plant.states[j], model.ranges[j]
    resolution = _power(largest / 2.0**30)
    state = _signal(name, resolution, -math.floor(largest / resolution), math.floor(largest / resolution), 16, 32, FLOAT32)
    spread = _signal(f"{name}_deviation", _power(deviation / 65534), 0, 65534, 48, 16, 0)
    return EstimateTable(message_table(f"estimate_{name}", _next(model.estimate, j, model.path.name), 8), (state, spread))


def _shares(model: FusionModel, found: Found, place: int, loss: float) -> float:
    """Share of a measurement that this sensor's silence carries."""
    kind, delta = model.trigger.kind, found.delta[place]
    if not model.trigger.silence or kind not in ("innovation", "stochastic"):
        return 0.0
    return beta(delta * found.wide[place], loss) if kind == "innovation" else beta_stochastic(delta**2, loss)


def _trigger(model: FusionModel, found: Found) -> TriggerTable:
    m = len(model.sensors)
    late = model.trigger.late
    level = [MUTE**2] * m
    for place, i in enumerate(found.sensors):
        level[i] = found.delta[place] ** 2

    def row(loss: float) -> tuple[float, ...]:
        values = [SILENT] * m
        for place, i in enumerate(found.sensors):
            values[i] = relaxation(_shares(model, found, place, loss))
        return tuple(values)

    relax, early = [row(p) for p in LOSS_RATES], [row(p + (1 - p) * late) for p in LOSS_RATES]
    return TriggerTable(found.alive, _f32(level), _f32(relax), _f32(early))


def repeats_of(model: FusionModel) -> int:
    """Equal values in a row after which a sensor is frozen: fewer than would come by chance of noise that is rounded to codes."""
    most = max((s.resolution / (2.0 * math.sqrt(math.pi) * s.sigma) for s in model.sensors), default=0.0)
    return max(3, 1 + math.ceil(math.log(REPEAT_RATE) / math.log(most)))


def _judge(model: FusionModel, plant: Fusion) -> JudgeTable | None:
    j = model.judge
    if j is None:
        return None
    least = _f32(j.least * np.sqrt(plant.R))
    return JudgeTable(j.onsets, j.stride, least, _f32(j.limit), j.confirm, j.repeats or repeats_of(model), j.rest)


def tables_of(made: FusionDesign) -> FusionTables:
    """All that the library needs of a model."""
    model, plant = made.model, made.plant
    t = model.trigger
    places = [int(p) for p in np.argmax(plant.C, axis=1)]
    unit: bool = np.array_equal(plant.C, np.eye(plant.states)[places])
    wide: Array = np.array([s.largest if not s.wraps else 1e6 for s in model.sensors])
    return FusionTables(
        name=model.name,
        depth=t.depth,
        delay=t.delay,
        heartbeat_sensor=t.heartbeat,
        watchdog=t.watchdog,
        trigger=t.kind,
        A=_f32(plant.A),
        Q=_f32(plant.Q),
        x0=_f32(plant.x0),
        P0=_f32(plant.P0),
        select=tuple(places) if unit else (),
        C=_f32(plant.C),
        R=_f32(plant.R),
        range=_f32(2.0 * wide),
        huber=_f32(t.huber),
        origin=_f32(model.plant.origin) if any(model.plant.origin) else (),
        rate_step=_f32(LOSS_RATES[1]),
        loss=_f32(t.loss),
        smoothing=_f32(t.smoothing),
        table=tuple(_trigger(model, f) for f in made.found),
        judge=_judge(model, plant),
        source=tuple(_source(s) for s in model.sensors),
        tick=message_table("tick", model.tick, 2),
        verdict=message_table("verdict", model.verdict, 8),
        status=message_table("status", model.status, 8),
        estimate=tuple(_estimate(model, j) for j in range(plant.states)),
        heartbeat=model.heartbeat,
        interval=model.interval,
    )
