"""A healthy plant as an adversary sees it: readings of all signals, sample by sample, as an affine function of all that is free, and as they are with what was chosen.

Free are the initial state, the disturbances and the reference; of an unknown-input model the road: anything within its bound whose slope is within its rate, here
straight between samples, which is exact for the plant between them. Of an uncertain plant every sample has matrices of its own inside the intervals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from hullguard.core.native import REST
from hullguard.design.design import Design
from hullguard.model.table import Array


@dataclass(frozen=True)
class Choice:
    """What a run is made of."""

    initial: Array  # n
    disturbance: Array  # samples x nd
    reference: Array  # samples x p, of the largest reference

    def flat(self) -> Array:
        """In the order of the affine function."""
        return np.concatenate([self.initial, np.hstack([self.disturbance, self.reference]).ravel()])


class World:
    """The plant with what drives it. `n` counts the road's states too."""

    def __init__(self, made: Design, samples: int, start: int) -> None:
        self.made, self.samples = made, samples
        model, plant = made.model, made.model.plant
        self.A, self.B, self.C, self.Ed, self.Fd = plant.A, plant.B, plant.C, plant.Ed, plant.Fd
        self.middle = plant.equilibrium.copy()
        spread = plant.initial_range if start == REST else made.stored.state_range - np.abs(self.middle)
        self.bounded: list[tuple[int, float]] = [(i, float(x)) for i, x in enumerate(made.stored.state_range) if np.isfinite(x) and plant.unknown is not None]
        if plant.unknown is not None:
            spread = self._road(spread)
        self.spread = spread
        self.n, self.nd, self.p = len(self.A), self.Ed.shape[1], plant.p
        self.gain = np.hstack([plant.feedback.gain, np.zeros((plant.p, self.n - plant.n))]) if plant.feedback is not None else np.zeros((plant.p, self.n))
        largest = np.array([0.1 * min(-model.signals[i].low, model.signals[i].high) for i in model.inputs])
        self.reference = plant.feedback.reference_bound if plant.feedback is not None else largest
        self.held = plant.equilibrium_input
        # The plant of each sample; a certain one is always the same.
        self.uncertain = bool(plant.dA.any() or plant.dB.any())
        self.certain()
        self._steps()

    def certain(self) -> None:
        """The middle of the intervals at every sample."""
        self.dA, self.dB = np.zeros((self.samples, self.n, self.n)), np.zeros((self.samples, self.n, self.p))

    def worsen(self, reading: Array, state: Array, weight: Array, last: Array, sample: int) -> None:
        """At every sample the plant inside the intervals that makes sum weight . reading + last . state(sample) largest: a corner, by the adjoint of this run."""
        model, plant = self.made.model, self.made.model.plant
        shown = np.zeros((len(model.signals), self.n))
        shown[model.outputs], shown[model.inputs] = self.C - plant.D @ self.gain, -self.gain
        adjoint = shown.T @ weight[sample] + last
        for k in range(sample - 1, -1, -1):
            self.dA[k] = plant.dA * np.sign(np.outer(adjoint, state[k]))
            self.dB[k] = plant.dB * np.sign(np.outer(adjoint, reading[k, model.inputs]))
            adjoint = (self.A + self.dA[k] - (self.B + self.dB[k]) @ self.gain).T @ adjoint + shown.T @ weight[k]

    def quiet(self) -> Choice:
        """In the middle of everything."""
        return Choice(self.middle.copy(), np.zeros((self.samples, self.nd)), np.zeros((self.samples, self.p)))

    def _road(self, spread: Array) -> Array:
        """Unknown inputs as states that change by no more than their rate: x+ = Ad x + W w + V s, w+ = w + rate period s, |s| <= 1."""
        made, plant = self.made, self.made.model.plant
        unknown, period = plant.unknown, made.model.sample_time_s
        assert unknown is not None
        n, q = plant.n, len(unknown.names)
        M = np.zeros((n + 2 * q, n + 2 * q))
        M[:n, :n], M[:n, n : n + q], M[n : n + q, n + q :] = unknown.A * period, unknown.G * period, np.eye(q)
        grown = scipy.linalg.expm(M)
        change = np.diag(unknown.rate * period)
        own = plant.Ed.shape[1] - q
        self.A = np.block([[plant.A, grown[:n, n : n + q]], [np.zeros((q, n)), np.eye(q)]])
        self.B = np.vstack([plant.B, np.zeros((q, plant.p))])
        self.C = np.hstack([plant.C, np.zeros((plant.m, q))])
        self.Ed = np.block([[plant.Ed[:, :own], grown[:n, n + q :] @ change], [np.zeros((q, own)), change]])
        self.Fd = np.hstack([plant.Fd[:, :own], np.zeros((plant.m, q))])
        self.middle = np.concatenate([self.middle, np.zeros(q)])
        self.bounded += [(n + i, float(b)) for i, b in enumerate(unknown.bound)]
        return np.concatenate([spread, unknown.bound])

    def _steps(self) -> None:
        model = self.made.model
        table = [s for g in self.made.tables.groups for s in g.signals]
        self.step = np.array([table[i].resolution for i in model.inputs])
        self.offset = np.array([table[i].offset for i in model.inputs])
        sent = {i for g in model.groups if g.applied_as_sent for i in g.signals}
        self.as_sent = np.array([i in sent for i in model.inputs], dtype=bool)
        self.low, self.high = (np.array([getattr(model.signals[i], side) for i in model.inputs]) for side in ("low", "high"))

    def draw(self, rng: np.random.Generator) -> Choice:
        """Corners."""
        initial = self.middle + self.spread * rng.choice([-1.0, 1.0], self.n)
        return Choice(initial, rng.choice([-1.0, 1.0], (self.samples, self.nd)), rng.choice([-1.0, 1.0], (self.samples, self.p)))

    def run(self, choice: Choice) -> tuple[Array, Array]:
        """Readings (samples x signals) and states (samples x n)."""
        model = self.made.model
        readings, states = np.zeros((self.samples, len(model.signals))), np.zeros((self.samples, self.n))
        x = choice.initial.copy()
        for k in range(self.samples):
            u = np.clip(self.held - self.gain @ (x - self.middle) + self.reference * choice.reference[k], self.low, self.high)
            u = np.where(self.as_sent, self.offset + np.rint((u - self.offset) / self.step) * self.step, u)
            d = choice.disturbance[k]
            readings[k, model.outputs] = self.C @ x + model.plant.D @ u + self.Fd @ d
            readings[k, model.inputs], states[k] = u, x
            x = (self.A + self.dA[k]) @ x + (self.B + self.dB[k]) @ u + self.Ed @ d
        return readings, states

    def moves(self) -> tuple[Array, Array]:
        """The same as affine functions of a change of the choice: samples x signals x free, samples x n x free."""
        model, width = self.made.model, self.nd + self.p
        free = self.n + self.samples * width
        readings, states = np.zeros((self.samples, len(model.signals), free)), np.zeros((self.samples, self.n, free))
        x = np.zeros((self.n, free))
        x[:, : self.n] = np.eye(self.n)
        for k in range(self.samples):
            first = self.n + k * width
            u = -self.gain @ x
            u[:, first + self.nd : first + width] += np.diag(self.reference)
            y = self.C @ x + model.plant.D @ u
            y[:, first : first + self.nd] += self.Fd
            readings[k][model.outputs], readings[k][model.inputs], states[k] = y, u, x
            x = (self.A + self.dA[k]) @ x + (self.B + self.dB[k]) @ u
            x[:, first : first + self.nd] += self.Ed
        return readings, states

    def limits(self) -> tuple[Array, Array]:
        """Of the free numbers."""
        ones = np.ones(self.samples * (self.nd + self.p))
        return np.concatenate([self.middle - self.spread, -ones]), np.concatenate([self.middle + self.spread, ones])

    def choice(self, flat: Array) -> Choice:
        """Back from the order of the affine function."""
        rest = flat[self.n :].reshape(self.samples, self.nd + self.p)
        return Choice(flat[: self.n], rest[:, : self.nd], rest[:, self.nd :])
