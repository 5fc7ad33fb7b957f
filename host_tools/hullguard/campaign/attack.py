"""Disturbances chosen against the detector, within the bounds that the model states: what a healthy plant can do at worst.

A residual at sample K is a linear functional of the values held, r_i(K) = sum_(j, g) w_i(j, g) value_g(K - j); a value held is the reading at the
sample of its frame, and the reading is linear in the disturbance. So with the pattern of the frames fixed, the largest |r_i(K)| is a linear
programme over |d_j(k)| <= 1, with the trigger's promises as constraints: where the sender stays silent, its readings stay within its threshold
(platoon, sections 4 and 7). The pattern is that of the run before; the run is then made again by the C loop, which knows nothing of any of this.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.optimize
import scipy.sparse
from numpy.typing import NDArray

from hullguard.core.native import Batch
from hullguard.design.design import Design
from hullguard.design.tables import Tables
from hullguard.model.plant import Plant
from hullguard.model.schema import Model
from hullguard.model.table import Array

HORIZON = 30  # samples before the target whose disturbances are chosen
ROUNDS = 2  # linear programmes a run, each with the pattern of the run before
STREAM = 0xA77AC  # keeps the draws apart from those of anything else that the seed feeds


def functionals(tables: Tables, horizon: int) -> tuple[Array, NDArray[np.intp]]:
    """Every residual and certificate as a functional of the values held: w[i, j, g] weighs value_g(K - j), functionals x horizon + 1 x signals.

    Beside it, for each, the place of its |r| / J in a trace: a bank has one place for all its certificates. A predicted signal counts as the
    held one it stands for.
    """
    held = list(range(tables.signals)) + [p.first + g for p in tables.predictors for g in range(len(p.output))]
    blocks: list[Array] = []
    places: list[int] = []
    for generator in tables.generators:
        weight = np.zeros((len(generator.output), horizon + 1, tables.signals))
        state, inward, shown = np.array(generator.state), np.array(generator.input), np.array(generator.output)
        signal = [held[g] for g in generator.signal]
        weight[:, 0, signal] = np.array(generator.direct)
        for j in range(1, horizon + 1):
            weight[:, j, signal] = shown @ inward
            shown = shown @ state
        places += range(len(places), len(places) + len(generator.output))
        blocks.append(weight)
    for b, bank in enumerate(tables.banks):
        weight = np.zeros((bank.certificates, horizon + 1, tables.signals))
        kept = min(bank.window, horizon + 1)
        weight[:, :kept, list(bank.signal)] = np.array(bank.weight)[:kept].transpose(2, 0, 1)
        places += [tables.residuals - len(tables.banks) + b] * bank.certificates
        blocks.append(weight)
    return np.concatenate(blocks), np.array(places, dtype=np.intp)


def sensitivity(model: Model, plant: Plant, horizon: int) -> Array:
    """Readings of samples 0 .. horizon by disturbance (sample by sample) and state at sample 0, loop closed: (samples, signals, samples nd + n)."""
    count = horizon + 1
    nd, gain = plant.Ed.shape[1], plant.feedback.gain if plant.feedback is not None else np.zeros((plant.p, plant.n))
    closed = plant.A - plant.B @ gain
    shown = np.zeros((len(model.signals), plant.n))
    shown[model.outputs], shown[model.inputs] = plant.C - plant.D @ gain, -gain
    direct = np.zeros((len(model.signals), nd))
    direct[model.outputs] = plant.Fd
    made = np.zeros((count, len(model.signals), count * nd + plant.n))
    effect, power = direct, np.eye(plant.n)
    for lag in range(count):
        for k in range(lag, count):
            made[k, :, (k - lag) * nd : (k - lag + 1) * nd] = effect
        made[lag, :, count * nd :] = shown @ power
        effect, power = shown @ power @ plant.Ed, closed @ power
    return made


def last_frame(there: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Sample of the latest frame at or before each sample, -1 where there is none (samples x columns)."""
    k = np.arange(len(there))[:, None]
    return np.asarray(np.maximum.accumulate(np.where(there, k, -1), axis=0))


class Attack:
    """Runs of one batch under disturbances against its detector. `batch` must read `disturbance` and `initial`, which each run rewrites."""

    def __init__(self, batch: Batch, design: Design, disturbance: Array, initial: Array, seed: int, last: int, horizon: int = HORIZON) -> None:
        """`last`: latest sample to aim at, the one before a fault begins."""
        self._batch, self._plant, self._seed, self._last, self._horizon = batch, design.model.plant, seed, last, horizon
        self._d, self._x = disturbance, initial
        self._weights, self._places = functionals(design.tables, horizon)
        self._moves = [sensitivity(design.model, plant, horizon) for plant in batch.plants]
        self._group = np.array([i for i, g in enumerate(design.model.groups) for _ in g.signals])
        self._half = np.array([s.resolution / 2 for s in design.model.signals])

    def run(self, number: int) -> dict[str, Any]:
        """The row of a run under the worst disturbance that was found; which residual, sample and sign are aimed at is drawn from the seed."""
        rng = np.random.default_rng([self._seed, number, STREAM])
        row, sample, sign = int(rng.integers(len(self._weights))), int(rng.integers(self._last + 1)), float(rng.choice([-1.0, 1.0]))
        self._d[:] = rng.choice([-1.0, 1.0], self._d.shape)
        self._x[:] = self._plant.equilibrium + self._plant.initial_range * rng.choice([-1.0, 1.0], self._plant.n)
        reached = -np.inf
        worst: dict[str, Any] = {}
        for left in range(ROUNDS, -1, -1):
            trace = self._batch.trace(number)
            place = self._places[row]
            ratio = float(abs(trace["r"][sample, place]) / trace["J"][sample, place])
            if not worst or ratio > reached:
                reached, worst = ratio, self._batch.runs(number, 1)[0]
            if left == 0 or not self._improve(trace, sign * self._weights[row], sample, self._moves[number % len(self._moves)]):
                break
        return worst

    def _improve(self, trace: dict[str, Array], weights: Array, sample: int, plant: Array) -> bool:
        """Rewrite disturbance and initial state for the largest weights . values at `sample`; False when the pattern of the trace admits none.

        `plant`: how the readings of the run's own plant move.
        """
        first = max(0, sample - self._horizon)
        count, nd = sample - first + 1, self._d.shape[1]
        # One window's matrix serves all: its first blocks are a shorter window's. The state moves only where the window begins with the run.
        moves = np.concatenate([plant[:count, :, : count * nd], plant[:count, :, -self._plant.n :]], axis=2)
        now = np.concatenate([self._d[first : sample + 1].ravel(), self._x])
        span = np.concatenate([np.ones(count * nd), self._plant.initial_range if first == 0 else np.zeros(self._plant.n)])
        middle = np.concatenate([np.zeros(count * nd), self._plant.equilibrium if first == 0 else self._x])
        sent = (trace["events"][:, None] >> self._group & 1).astype(bool)
        lost = (trace["lost"][:, None] >> self._group & 1).astype(bool)
        window = slice(first, sample + 1)
        held = last_frame(sent & ~lost)[window] - first
        goal = np.einsum("kg,kgv->v", weights[count - 1 :: -1], _at(moves, held))
        rows, low, high = self._promises(trace, moves, last_frame(sent)[window], window)
        solved = scipy.optimize.milp(  # without integer variables: HiGHS's simplex, which takes two-sided rows
            -goal,
            constraints=scipy.optimize.LinearConstraint(scipy.sparse.csr_array(rows), low, high) if len(rows) else None,
            bounds=scipy.optimize.Bounds(middle - span - now, middle + span - now),
        )
        if solved.x is None:
            return False
        better = np.clip(now + solved.x, middle - span, middle + span)
        self._d[window], self._x[:] = better[: count * nd].reshape(count, nd), better[count * nd :]
        return True

    def _promises(self, trace: dict[str, Array], moves: Array, source: NDArray[np.intp], window: slice) -> tuple[Array, Array, Array]:
        """Where a sender looked and stayed silent: |reading - reading of its last frame| <= its threshold, as rows . change within low .. high."""
        reading, promise = trace["reading"], trace["promise"][window] - self._half  # the value sent is a rounded reading
        k, g = np.nonzero(np.isfinite(promise))
        off = reading[window][k, g] - reading[source[k, g], g]
        rows = moves[k, g] - _at(moves, source - window.start)[k, g]
        return rows, -promise[k, g] - off, promise[k, g] - off


def _at(moves: Array, place: NDArray[np.intp]) -> Array:
    """Moves of the readings at the samples that `place` names; of one before the window there are none."""
    picked = moves[np.maximum(place, 0), np.arange(place.shape[1])]
    return np.where((place >= 0)[:, :, None], picked, 0.0)
