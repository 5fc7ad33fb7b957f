"""What an undisturbed or disturbed, but healthy, plant can reach: ranges of states and signals, and slews; platoon, section 4."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hullguard.errors import InputError
from hullguard.model.schema import Model, Signal
from hullguard.model.table import Array

HORIZON_MAX = 20_000
SETTLED = 1e-9


@dataclass(frozen=True)
class Reach:
    """Largest magnitudes of states, signal bounds and slews of the operating set."""

    state: Array  # n: |x_i| never exceeds
    signal: Array  # signals: |s_i - equilibrium s_i| of the healthy plant, or nan where it is taken from the declared range
    slew: Array  # signals x horizon: |s(k+j) - s(k)| for j = 1 ..


@dataclass(frozen=True)
class Loop:
    """x(k+1) = A x + Bw w, s = Cs x + Dw w with |w| <= 1: the emulated loop around its equilibrium, s = all signals."""

    A: Array  # n x n
    Bw: Array  # n x nw
    Cs: Array  # signals x n
    Dw: Array  # signals x nw
    initial: Array  # n: |x(0)|
    state: Array  # n: magnitude of the state around which x moves
    input: Array  # p: magnitude of the input around which u moves, and of what an actuator adds to it


def _closed_loop(model: Model) -> Loop | None:
    """The loop with w = (reference, quantisation of u, d); none where nothing drives the inputs."""
    plant = model.plant
    if plant.feedback is None and plant.p > 0:
        return None
    # A plant without inputs is its own loop.
    K, bound = (plant.feedback.gain, plant.feedback.reference_bound) if plant.feedback is not None else (np.zeros((0, plant.n)), np.zeros(0))
    half = np.array([model.signals[i].resolution / 2 for i in model.inputs])
    drive = np.hstack([np.diag(bound), np.diag(half)])
    nd = plant.Ed.shape[1]
    A = plant.A - plant.B @ K
    Bw = np.hstack([plant.B @ drive, plant.Ed])
    Cs, Dw = np.zeros((len(model.signals), plant.n)), np.zeros((len(model.signals), Bw.shape[1]))
    for row, i in enumerate(model.outputs):
        Cs[i] = plant.C[row] - plant.D[row] @ K
        Dw[i] = np.hstack([plant.D[row] @ drive, plant.Fd[row]])
    for row, i in enumerate(model.inputs):
        Cs[i] = -K[row]
        Dw[i] = np.hstack([drive[row], np.zeros(nd)])
    return Loop(A, Bw, Cs, Dw, plant.initial_range, np.abs(plant.equilibrium), np.abs(plant.equilibrium_input))


def _with_mismatch(model: Model, loop: Loop, horizon: int) -> tuple[Array, Array, Array]:
    """Largest |x|, |s| and |s(k+j) - s(k)| of the loop with every plant of the model's intervals in it.

    The true plant differs by a disturbance |m| <= dA |x| + dB |u|. With |x| <= S0 + S1 |m| and |u| <= U0 + U1 |m|, sums of absolute impulse
    responses, |m| <= c + M |m| in every sample: (I - M)^-1 c bounds it, by induction over the samples, where the spectral radius of M is below 1.
    """
    plant = model.plant
    if not (plant.dA.any() or plant.dB.any()):
        return _sums(loop.A, loop.Bw, loop.Cs, loop.Dw, loop.initial, horizon)
    state, signal, _ = _sums(loop.A, loop.Bw, loop.Cs, loop.Dw, loop.initial, 1)
    eye, count = np.eye(plant.n), loop.Cs.shape[0]
    gains = [_responses(loop.A, C) for C in (eye, loop.Cs[model.inputs])]
    constant = plant.dA @ (loop.state + state) + plant.dB @ (loop.input + signal[model.inputs])
    bound = _fixed_point(plant.states, plant.dA @ gains[0] + plant.dB @ gains[1], constant)
    Bw, Dw = np.hstack([loop.Bw, np.diag(bound)]), np.hstack([loop.Dw, np.zeros((count, plant.n))])
    return _sums(loop.A, Bw, loop.Cs, Dw, loop.initial, horizon)


def _responses(A: Array, C: Array) -> Array:
    """Sum over j of |C A^j|: the most that unit disturbances of the states can do to C x."""
    total, term = np.zeros(C.shape), C
    for _ in range(HORIZON_MAX):
        total += np.abs(term)
        term = term @ A
        if not np.abs(term).max(initial=0.0) >= SETTLED * SETTLED:
            break
    return total


def _fixed_point(states: tuple[str, ...], gain: Array, constant: Array) -> Array:
    """The least m >= 0 with m = constant + gain m."""
    values, vectors = np.linalg.eig(gain)
    radius = float(np.abs(values).max())
    if radius >= 1.0:
        worst = states[int(np.argmax(np.abs(vectors[:, int(np.argmax(np.abs(values)))])))]
        raise InputError(f"[plant] intervals too wide: what they add to '{worst}' comes back {radius:.3g} times as large, nothing bounds it; make the pm that moves it smaller")
    return np.asarray(np.linalg.solve(np.eye(len(constant)) - gain, constant) * (1 + 1e-9))


def _declared_slew(signal: Signal, horizon: int) -> Array:
    """Declared values, continued by |y(k+a+b) - y(k)| <= slew(a) + slew(b)."""
    known = list(signal.slew or ())
    while len(known) < horizon:
        j = len(known) + 1
        known.append(min(known[a - 1] + known[j - a - 1] for a in range(1, j)))
    return np.asarray(np.minimum(np.array(known[:horizon]), signal.high - signal.low), dtype=np.float64)


def reach(model: Model, horizon: int) -> Reach:
    """Reachable set of the model's closed loop where it is asked for, declared ranges and slews elsewhere."""
    count = len(model.signals)
    spans = np.array([s.high - s.low for s in model.signals])
    signal, slew = np.full(count, np.nan), np.tile(spans[:, None], (1, horizon))
    loop = _closed_loop(model)
    wanted = [i for i, s in enumerate(model.signals) if s.slew is None]
    state = np.full(model.plant.n, np.inf)
    # Where every output's slew is declared the loop only drives the emulator: the operating set is the declared one.
    asked = any(model.signals[i].role == "output" for i in wanted)
    if asked and loop is not None and _stable(loop):
        state, signal, computed = _with_mismatch(model, loop, horizon)
        state += np.abs(model.plant.equilibrium)
        for i in wanted:
            slew[i] = np.minimum(computed[i], spans[i])
    else:
        for i in wanted:
            if model.signals[i].role == "output":
                raise InputError(f"signal '{model.signals[i].name}': slew = \"reachable\" needs [plant] feedback with a stable loop; declare the slew as a list")
    for i, s in enumerate(model.signals):
        if s.slew is not None:
            slew[i] = _declared_slew(s, horizon)
    return Reach(_declared_states(model, state), signal, slew)


def _stable(loop: Loop) -> bool:
    return bool(np.abs(np.linalg.eigvals(loop.A)).max() < 1.0)


def faulty_reach(model: Model, healthy: Reach) -> Reach:
    """What the plant and its readings can do beyond the healthy reach under one fault at a time, of at most its size_max at every sample.

    By superposition: the loop from rest, driven by the fault alone, comes on top; the largest of all faults is taken. A fault without
    size_max is not accounted for. An actuator's fault enters as its input's column of B and D; a sensor's moves a reading and nothing else.
    """
    loop = _closed_loop(model)
    horizon = healthy.slew.shape[1]
    spans = np.array([s.high - s.low for s in model.signals])
    state, signal, slew = np.zeros_like(healthy.state), np.zeros_like(healthy.signal), np.zeros_like(healthy.slew)
    for fault in model.faults:
        if fault.size_max is None:
            continue
        if fault.type == "actuator":
            if loop is None or not _stable(loop):
                raise InputError(f"fault '{fault.name}': size_max of an actuator needs [plant] feedback with a stable loop, or nothing bounds what it does; remove size_max")
            more = _with_mismatch(model, _driven_by(model, loop, fault.signal, fault.size_max), horizon)
        else:
            moved = np.zeros_like(signal)
            moved[fault.signal] = fault.size_max
            more = (np.zeros_like(state), moved, np.tile(2 * moved[:, None], (1, horizon)))
        state, signal, slew = np.maximum(state, more[0]), np.maximum(signal, more[1]), np.maximum(slew, more[2])
    return Reach(healthy.state + state, healthy.signal + signal, np.minimum(healthy.slew + slew, spans[:, None]))


def _driven_by(model: Model, loop: Loop, place: int, size: float) -> Loop:
    """The loop at rest with nothing but an actuator's fault in it; the signal of its input is the command, which the fault is not in."""
    plant, column = model.plant, model.inputs.index(place)
    Dw, offset = np.zeros((len(model.signals), 1)), np.zeros(plant.p)
    Dw[model.outputs, 0] = plant.D[:, column] * size
    offset[column] = size
    nothing = np.zeros(plant.n)
    return Loop(loop.A, plant.B[:, [column]] * size, loop.Cs, Dw, nothing, nothing, offset)


def _declared_states(model: Model, state: Array) -> Array:
    """Bounds of the states: what the loop can reach, what is declared, the range of an output that is the state itself, or what these drive."""
    plant = model.plant
    out = np.minimum(state, plant.state_range)
    for row, i in enumerate(model.outputs):
        places = np.flatnonzero(plant.C[row])
        if len(places) == 1 and not plant.D[row].any():
            s = model.signals[i]
            # The range is the reading's, noise included: the state may be as far beyond it as the noise.
            bound = (max(abs(s.low), abs(s.high)) + float(np.abs(plant.Fd[row]).sum())) / abs(plant.C[row, places[0]])
            out[places[0]] = min(out[places[0]], bound)
    unknown = ~np.isfinite(out)
    if unknown.any():
        out[unknown] = _driven(model, out, unknown)
    return out


def _driven(model: Model, bounds: Array, unknown: NDArray[np.bool_]) -> Array:
    """Reach of the states without a bound of their own, driven by the bounded ones, by inputs within their ranges and by the disturbance."""
    plant = model.plant
    own = plant.A[np.ix_(unknown, unknown)]
    names = ", ".join(np.array(plant.states)[unknown])
    if np.abs(np.linalg.eigvals(own)).max() >= 1.0:
        raise InputError(f"no bound for {names}: measure it, declare [plant] state_range, or give [plant] feedback with a stable loop so that its reach can be computed")
    largest = np.array([max(abs(model.signals[i].low), abs(model.signals[i].high)) for i in model.inputs])
    drive = np.hstack([plant.A[np.ix_(unknown, ~unknown)] * bounds[~unknown], plant.B[unknown] * largest, plant.Ed[unknown]])
    if plant.dA.any() or plant.dB.any():
        drive = np.hstack([drive, np.diag(_driven_mismatch(model, bounds, unknown, drive, largest))])
    power, reached = np.eye(own.shape[0]), np.zeros(own.shape[0])
    start = (np.abs(plant.equilibrium) + plant.initial_range)[unknown]
    first = start.copy()
    for _ in range(HORIZON_MAX):
        reached += np.abs(power @ drive).sum(1)
        power = own @ power
        first = np.maximum(first, np.abs(power) @ start)
        if np.abs(power).max() < SETTLED:
            break
    return reached + first


def _driven_mismatch(model: Model, bounds: Array, unknown: NDArray[np.bool_], drive: Array, largest: Array) -> Array:
    """The disturbance that stands for the plant's intervals in the states without a bound: |m| <= dA |x| + dB |u|."""
    plant = model.plant
    own, spread = plant.A[np.ix_(unknown, unknown)], plant.dA[np.ix_(unknown, unknown)]
    gain = _responses(own, np.eye(own.shape[0]))
    start = (np.abs(plant.equilibrium) + plant.initial_range)[unknown]
    reached = gain @ (np.abs(drive).sum(1) + start)  # the initial state is a disturbance of the sample before the first
    known = plant.dA[np.ix_(unknown, ~unknown)] @ bounds[~unknown] + plant.dB[unknown] @ largest
    return _fixed_point(tuple(np.array(plant.states)[unknown]), spread @ gain, known + spread @ reached)


def _sums(A: Array, Bw: Array, Cs: Array, Dw: Array, initial: Array, horizon: int) -> tuple[Array, Array, Array]:
    """Largest |x|, |s| and |s(k+j) - s(k)| over all |w| <= 1 and |x(0)| <= initial.

    Sums of absolute impulse responses, taken at each k and then maximised over k: while the initial state is still felt, little of the
    disturbance's history is. `horizon` is the largest j.
    """
    responses, starts = [Dw], [Cs * initial]
    states, state_starts = [np.zeros(A.shape[0])], [initial.copy()]
    power = np.eye(A.shape[0])
    for _ in range(HORIZON_MAX):
        step = power @ Bw
        responses.append(Cs @ step)
        states.append(states[-1] + np.abs(step).sum(1))
        power = A @ power
        starts.append(Cs @ power * initial)
        state_starts.append(np.abs(power) @ initial)
        if np.abs(power).max() < SETTLED:
            break
    h, x0 = np.array(responses), np.array(starts)
    state = (np.array(states) + np.array(state_starts)).max(0)
    signal = (np.abs(h).sum(2).cumsum(0) + np.abs(x0).sum(2)).max(0)
    slew = np.zeros((Cs.shape[0], horizon))
    for j in range(1, horizon + 1):
        shifted = np.concatenate([np.zeros((j, *Dw.shape)), h])
        extended = np.concatenate([h, np.zeros((j, *Dw.shape))])
        # Row k + j: everything that w(0) .. w(k + j) can do to s(k + j) - s(k).
        driven = np.abs(extended - shifted).sum(2).cumsum(0)[j:]
        later = np.concatenate([x0[j:], np.zeros((min(j, len(x0)), *x0.shape[1:]))])
        slew[:, j - 1] = (driven + np.abs(later - x0).sum(2)).max(0)
    return state, signal, slew


def largest(model: Model, signal_reach: Array, place: int) -> float:
    """Largest magnitude of a healthy signal: what it can reach, or its declared range."""
    s = model.signals[place]
    declared = max(abs(s.low), abs(s.high))
    reached = float(signal_reach[place])
    if not np.isfinite(reached):
        return declared
    return min(declared, reached + abs(model.centre(place)) + s.resolution)
