"""What a fusion model's trigger costs and reaches beside other ways to send, at several loss rates.

Periodic, decimated, batched, dropped at random, and other triggers. Runs by the C library (core/fusion.py), all with the same plant and noise; batches, whose covariance
depends on no data, by that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from hullguard.bus.bits import worst_bits
from hullguard.campaign import fusion_study as study
from hullguard.core.fusion import Bench, Filter, Outcome
from hullguard.core.library import library
from hullguard.design import fusion as design
from hullguard.design.fusion_model import FusionDesign, message_table
from hullguard.model.table import Array

LOSSES = (0.0, 0.05, 0.10, 0.15)
SIZE = study.Size(60, 300, 0, 0, 0)
BATCH = 2  # values a frame, of 16 bits each
STEPS = 20000  # of a batch's covariance with losses
SEED = 1
STUFFED = 0.175  # stuff bits of a frame with random data, share of the most that there can be


@dataclass(frozen=True)
class Way:
    """One way to send, at one rate of losses."""

    name: str
    loss: float
    frames: float  # a sensor and sample
    bits: float  # the same, on the wire
    error: float  # of position, over that of lossless periodic sending
    nees: float | None  # over the number of states


class Compared(study.Study):
    """A model's plant under the study's other triggers."""

    def __init__(self, made: FusionDesign, seed: int) -> None:
        """All that a study has, of this model."""
        self.size, self.seed, self.model = SIZE, seed, made.plant
        self.bench = Bench(library("f32"), made.plant)
        self.made = made.mean
        self._kept = {}
        self.design = made
        self.positions = tuple(j for j, n in enumerate(made.model.plant.states) if n.endswith("_m")) or tuple(range(made.plant.states))
        self.origin = made.tables.origin

    def run(self, chosen: Filter, sensor: Filter | None = None, runs: int = 0, **case: Any) -> Outcome:
        """A batch; values as float32, whatever the model's frames have: a plant that only noise drives has no range that codes could rely on."""
        return super().run(replace(chosen, origin=self.origin), sensor, runs, **case)

    @property
    def own(self) -> Filter:
        """The model's own trigger."""
        t = self.design.model.trigger
        table = self.design.tables.table
        return Filter(table, t.kind, t.depth, t.delay, t.heartbeat, t.watchdog, t.huber, loss=t.loss, smoothing=t.smoothing)


def _batched(made: FusionDesign, positions: tuple[int, ...], loss: float) -> float:
    """Position error of frames with two values each, sent every second sample; the NEES is right by construction."""
    plant, rng = made.plant, np.random.default_rng(SEED)
    P, total = plant.P0, 0.0
    held: list[Array] = []
    for k in range(STEPS):
        past = P  # after the updates of the sample before the pair
        P = plant.A @ P @ plant.A.T + plant.Q
        if k % BATCH == BATCH - 1:
            alive = rng.random(plant.sensors) >= loss
            P = _with(plant, held[0], alive)  # the first value of each pair, in its own sample
            P = _with(plant, plant.A @ P @ plant.A.T + plant.Q, alive)
            held = []
        else:
            held = [plant.A @ past @ plant.A.T + plant.Q]
        total += float(np.diag(P)[list(positions)].sum()) if k >= STEPS // 10 else 0.0
    return float(np.sqrt(total / (STEPS - STEPS // 10)))


def _with(plant: design.Fusion, P: Array, alive: Any) -> Array:
    """P after a value of each sensor that is heard."""
    for i in np.flatnonzero(alive):
        g = P @ plant.C[i]
        P = P - np.outer(g, g) / (plant.C[i] @ g + plant.R[i])
    return P


def _ways(s: Compared) -> dict[str, tuple[Filter, dict[str, Any]]]:
    """Every way that the library runs."""
    m = s.model.sensors
    own = s.run(s.own).rate
    rate = [own] * m
    plan = design.scheduled(s.model, own)
    found: dict[str, tuple[Filter, dict[str, Any]]] = {
        "periodic": (s.always, {"send": "always"}),
        f"this model: {s.design.model.trigger.kind}, silence used": (s.own, {}),
        "innovation, one threshold, silence used": (Filter((design.innovation_table(s.model, np.full(m, design.delta_of(own)), np.full(m, own)),)), {}),
        "observation trigger, silence unused": s.tuned(lambda v: study.published(s, v), own),
        "stochastic trigger": s.tuned(lambda v: study.stochastic(s, v), own),
        "prediction variance": (Filter((design.plain_table(s.model, plan.level),), "scheduled", **study.NEVER), {}),
        "variance about the line": s.tuned(lambda v: study.windowed(s, True, v), own),
        "decimated": (s.always, {"send": "decimated", "rate": tuple(rate)}),
        "dropped at random": (s.always, {"send": "random", "rate": tuple(rate)}),
    }
    return found


def independent(made: FusionDesign) -> bool:
    """Whether the emulated plant of the library has this noise: independent from state to state."""
    Q = made.plant.Q
    return bool(np.allclose(Q, np.diag(np.diag(Q))))


def frame_bits(made: FusionDesign, length: int) -> float:
    """A frame of that many bytes on classic CAN: without stuff bits 47 + 8 length, of which there are as many as in the mean of random data."""
    message = message_table("any", made.model.sensors[0].frame, length)
    plain = 47 + 8 * length
    return plain + STUFFED * (worst_bits(message) - plain)


def compare(made: FusionDesign, seed: int = SEED, tick: Callable[[str], None] = lambda name: None) -> list[Way]:
    """All ways at all loss rates."""
    s = Compared(made, seed)
    found = []
    usual = s.periodic().rms(s.positions)
    for name, (chosen, case) in _ways(s).items():
        tick(name)
        for loss in LOSSES:
            seen = s.run(chosen, loss=loss, **case)
            bits = float(seen.rates @ [frame_bits(made, t.message.length) for t in made.tables.source]) / s.model.sensors
            found.append(Way(name, loss, seen.rate, bits, seen.rms(s.positions) / usual, seen.consistency / s.model.states))
    for loss in LOSSES:
        error = _batched(made, s.positions, loss) / usual
        found.append(Way(f"batched, {BATCH} values of 16 bits a frame", loss, 1.0 / BATCH, frame_bits(made, 2 + 2 * BATCH) / BATCH, error, None))
    return found


def as_json(ways: list[Way]) -> list[dict[str, Any]]:
    """For run.json."""
    return [asdict(w) for w in ways]
