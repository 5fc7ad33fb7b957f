"""A suspension on a random road, many seconds in one go: the exact solution between samples, by modes, as signals of the model without noise.

    x(k+1) = Ad x(k) + Bd u(k) + w(k)        w(k) = Re sum_i a_i e^(j (w_i t_k + p_i)) (j w_i - A)^-1 (e^(j w_i Ts) - Ad) G

for a road velocity sum_i a_i cos(w_i t + p_i). plant/unknown.py steps any road finely; this is for 10^7 samples of random ones, a quarter car alone.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.signal
from hullguard.design.uio_discrete import zero_order_hold
from hullguard.model.road import RoadSpec
from hullguard.model.schema import Model
from hullguard.model.table import Array
from hullguard.model.uio import weakened
from hullguard.plant.road import Waves, road

BLOCK = 1000  # samples whose phases are the first block's, turned


def driven(A: Array, G: Array, waves: Waves, first: int, samples: int, sample_time_s: float) -> Array:
    """w of samples first .. first + samples - 1: samples x n."""
    turn, n = 2 * np.pi * waves.frequency, len(A)
    Ad = scipy.linalg.expm(A * sample_time_s)
    gain = np.array([np.linalg.solve(1j * w * np.eye(n) - A, (np.exp(1j * w * sample_time_s) * np.eye(n) - Ad) @ G) for w in turn])
    gain = gain * (waves.amplitude * np.exp(1j * waves.phase))[:, None]
    blocks = -(-samples // BLOCK)
    begin = np.exp(1j * np.outer(turn, (first + BLOCK * np.arange(blocks)) * sample_time_s))
    within = np.exp(1j * np.outer(np.arange(BLOCK) * sample_time_s, turn))
    columns = (begin[:, :, None] * gain[:, None, :]).reshape(len(turn), blocks * n)
    made = within.real @ columns.real - within.imag @ columns.imag
    return np.asarray(made.reshape(BLOCK, blocks, n).transpose(1, 0, 2).reshape(blocks * BLOCK, n)[:samples])


def states(A: Array, B: Array, w: Array, force: Array, x0: Array, sample_time_s: float) -> Array:
    """x of each sample, and one more: samples + 1 x n. `force`: samples, held."""
    Ad, Bd = zero_order_hold(A, B, sample_time_s)
    values, vectors = np.linalg.eig(Ad)
    into = np.vstack([x0, w + np.outer(force, Bd[:, 0])]) @ np.linalg.inv(vectors).T
    modes = np.column_stack([scipy.signal.lfilter([1.0], [1.0, -v], into[:, i]) for i, v in enumerate(values)])
    return np.asarray((modes @ vectors.T).real)


def series(model: Model, roughness: str, seed: int, samples: int, start: int = 0, left: dict[str, float] | None = None, force_n: float = 0.0) -> Array:
    """Readings without noise, samples x signals: what is left of parts, and a force of the actuator that nobody asked for, from `start` on."""
    known, period = model.plant.unknown, model.sample_time_s
    assert known is not None and len(known.names) == 1
    waves = road(RoadSpec("iso8608", roughness=roughness, speed_mps=20.0), seed)
    assert isinstance(waves, Waves)
    x = model.plant.equilibrium + model.plant.initial_range * np.random.default_rng([seed, 1]).uniform(-1.0, 1.0, model.plant.n)
    parts = [(0, start, known.A, 0.0), (start, samples, weakened(known, left or {}), force_n)]
    made = []
    for first, end, A, force in parts:
        if end > first:
            x_all = states(A, known.B, driven(A, known.G[:, 0], waves, first, end - first, period), np.full(end - first, force), x, period)
            made.append(x_all[:-1])
            x = x_all[-1]
    readings = np.zeros((samples, len(model.signals)))
    readings[:, model.outputs] = np.vstack(made) @ model.plant.C.T
    return readings
