"""A healthy plant, exactly: x(k+1) = A x + B u + Ed d, y = C x + D u + Fd d in rational numbers, and what its sensors and controllers hand to the senders.

The matrices are those that the design was made for, taken as the exact numbers that their floats are; of an uncertain plant, other ones inside its
intervals at every sample. An input that is applied as it was sent is what its code stands for. Only what a sensor hands over is rounded, to a double.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from dyadic import Exact, exact
from hullguard.design.design import Design
from hullguard.model.table import Array

STEPS = 1 << 20  # of a disturbance, from nothing to its bound


@dataclass(frozen=True)
class Matrices:
    """Of the plant; x(k+1) = A x + B u + Ed d."""

    A: Exact
    B: Exact
    C: Exact
    D: Exact
    Ed: Exact
    Fd: Exact


def matrices(made: Design) -> Matrices:
    """The floats of the design's plant."""
    p = made.model.plant
    return Matrices(*(exact(m) for m in (p.A, p.B, p.C, p.D, p.Ed, p.Fd)))


@dataclass
class Healthy:
    """One run. `rough`: disturbances at their bounds, in turn anywhere within; the reference as far as it may go, for a few samples each."""

    made: Design
    rng: np.random.Generator
    state: Exact = field(init=False)
    mismatch: Exact = field(init=False)  # of the last step: what a plant inside the intervals has done beyond the middle

    def __post_init__(self) -> None:
        plant = self.made.model.plant
        self._m = matrices(self.made)
        self.state = exact(plant.equilibrium) + exact(plant.initial_range * self._signs(plant.n))
        self._reference = np.zeros(plant.p)
        groups = self.made.model.groups
        self._table = {i: g.signals[n] for g, spec in zip(self.made.tables.groups, groups, strict=True) for n, i in enumerate(spec.signals)}
        # A declared slew holds for the noise of the sensor as well, which this plant has on the signal's way into the plant.
        self._moved = np.array([(s.slew[0] - 2 * s.noise) if s.slew else np.inf for s in (self.made.model.signals[i] for i in self.made.model.inputs)])
        self._last: Array | None = None
        self._as_sent = {i for g in groups if g.applied_as_sent for i in g.signals}

    def _signs(self, count: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """Bounds, or anything between them."""
        corners = self.rng.choice([-1.0, 1.0], count)
        within = self.rng.integers(-STEPS, STEPS, count, endpoint=True) / STEPS
        return np.asarray(corners if self.rng.random() < 0.7 else within)

    def _inputs(self) -> Exact:
        """What the controllers command: feedback and reference, within the range of the signal; of what is applied as sent, what its code stands for."""
        model, plant = self.made.model, self.made.model.plant
        if self.rng.random() < 0.15:
            self._reference = self._signs(plant.p)
        moved = self.state.floats() - plant.equilibrium
        if plant.feedback is not None:
            wanted = plant.equilibrium_input - plant.feedback.gain @ moved + plant.feedback.reference_bound * self._reference
        else:
            wanted = 0.1 * self._reference * np.array([min(-model.signals[i].low, model.signals[i].high) for i in model.inputs])
        near = wanted if self._last is None else np.clip(wanted, self._last - self._moved, self._last + self._moved)
        sent = np.array([self._sent(i, float(u)) for i, u in zip(model.inputs, near, strict=True)])
        self._last = sent
        return exact(sent)

    def _sent(self, signal: int, value: float) -> float:
        table = self._table[signal]
        code = min(max(round((value - table.offset) / table.resolution), table.minimum), table.maximum)
        # Both are float32 and the code has at most 24 bits: exact in a double.
        return table.offset + code * table.resolution if signal in self._as_sent else value

    def step(self) -> Exact:
        """Readings of all signals at the open sample, as they truly are; then on to the next."""
        model, m = self.made.model, self._m
        u, d = self._inputs(), exact(self._signs(m.Ed.whole.shape[1]))
        y = m.C @ self.state + m.D @ u + m.Fd @ d
        p = model.plant
        self.mismatch = exact(p.dA * self._signs(p.dA.size).reshape(p.dA.shape)) @ self.state + exact(p.dB * self._signs(p.dB.size).reshape(p.dB.shape)) @ u
        self.state = m.A @ self.state + m.B @ u + m.Ed @ d + self.mismatch
        places = max(y.places, u.places)
        reading = np.zeros(len(model.signals), dtype=object)
        reading[model.outputs] = (y.whole * (1 << (places - y.places)))[: len(model.outputs)]
        reading[model.inputs] = u.whole * (1 << (places - u.places))
        return Exact(reading, places)


def within_slews(made: Design, readings: list[Exact]) -> bool:
    """Do the last readings keep the slews that the holds count on, from each sample to the last?"""
    last = readings[-1]
    for g in made.tables.groups:
        for n in range(len(g.signals)):
            for age, row in enumerate(g.slew[: len(readings) - 1], 1):
                moved = abs(last[g.first + n : g.first + n + 1] - readings[-1 - age][g.first + n : g.first + n + 1])
                if moved.fraction(0) > row[n]:
                    return False
    return True
