"""Plants: matrices as given, or made by a builder, always discrete in the end.

x(k+1) = A x + B u + Ed d      y(k) = C x + D u + Fd d      |d_j| <= 1

An uncertain plant is any with |A* - A| <= dA and |B* - B| <= dB, entry by entry, one that varies with time among them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from hullguard.errors import InputError
from hullguard.model.builders import BUILDERS, Interval
from hullguard.model.polynomial import Nonlinear
from hullguard.model.table import Array, Table
from hullguard.model.uio import UnknownInputs, read_unknown
from hullguard.model.uncertain import drawn, enclosure, zero_order_hold

PLANTS = 64  # that stand for an uncertain one in a campaign


@dataclass(frozen=True)
class Feedback:
    """How the emulated plant is driven: u = equilibrium input - gain (x - equilibrium) + u_ref, |u_ref| <= reference_bound."""

    gain: Array  # p x n
    reference_bound: Array  # p


@dataclass(frozen=True)
class Plant:
    """A discrete linear plant with bounded disturbances."""

    states: tuple[str, ...]
    A: Array  # n x n
    B: Array  # n x p
    dA: Array  # n x n: the true A is this near, entry by entry; zeros for a certain plant
    dB: Array  # n x p
    C: Array  # m x n
    D: Array  # m x p
    Ed: Array  # n x nd
    Fd: Array  # m x nd
    initial_range: Array  # n: |x(0) - equilibrium| at a start at rest
    equilibrium: Array  # n: the state around which an emulated plant moves
    equilibrium_input: Array  # p: the input that holds it there
    state_range: Array  # n: |x| in operation as far as it is declared, infinite where it is not
    feedback: Feedback | None
    interval: Interval | None  # what dA and dB were made from; None for a certain plant
    unknown: UnknownInputs | None  # inputs that nobody knows, of a model of kind "uio"
    hold_s: float | None  # sample time of the zero-order hold between the interval and A, B; None where the model gives discrete matrices
    nonlinear: Nonlinear | None = None  # of a model of kind "polynomial": the matrices are its first derivatives

    @property
    def n(self) -> int:
        """States."""
        return int(self.A.shape[0])

    @property
    def m(self) -> int:
        """Outputs."""
        return int(self.C.shape[0])

    @property
    def p(self) -> int:
        """Inputs."""
        return int(self.B.shape[1])


def draw(plant: Plant, rng: np.random.Generator) -> Plant:
    """A certain plant inside the intervals of an uncertain one, every entry drawn by itself, half of the plants at a corner; gain and equilibrium stay."""
    if plant.interval is None:
        return plant
    A, B = drawn(plant.interval, rng)
    if plant.hold_s is not None:
        A, B = zero_order_hold(A, B, plant.hold_s)
    return replace(plant, A=A, B=B, dA=np.zeros_like(A), dB=np.zeros_like(B), interval=None)


def emulated(plant: Plant, seed: int) -> list[Plant]:
    """What the runs of a seed emulate in turn: the plant itself, or as many as PLANTS inside its intervals."""
    if plant.interval is None:
        return [plant]
    rng = np.random.default_rng(seed)
    return [draw(plant, rng) for _ in range(PLANTS)]


def _read_matrices(table: Table, outputs: int, inputs: int) -> tuple[Interval, Array, Array]:
    """A, B with their bounds, C and D as a user gives them."""
    A = table.matrix("A")
    n = A.shape[0]
    if A.shape != (n, n):
        raise table.error("A", f"expected a square matrix, found {A.shape[0]} x {A.shape[1]}")
    B = table.matrix("B", n, inputs) if inputs else np.zeros((n, 0))
    bounds = [table.matrix(key, *known.shape) if key in table else np.zeros_like(known) for key, known in (("A_pm", A), ("B_pm", B))]
    for key, pm in zip(("A_pm", "B_pm"), bounds, strict=True):
        if np.any(pm < 0.0):
            raise table.error(key, "a bound is not negative")
    C = table.matrix("C", outputs, n)
    return Interval(A, B, *bounds), C, table.matrix("D", outputs, inputs) if "D" in table else np.zeros((outputs, inputs))


def read_plant(table: Table, outputs: list[str], inputs: list[str], noise: dict[str, float], sample_time_s: float) -> Plant:
    """Read the [plant] table. `outputs` and `inputs` are signal names in the model's order; `noise` bounds sensor noise by signal."""
    builder = None
    if "builder" in table:
        name = table.text("builder", choices=sorted(BUILDERS))
        builder = BUILDERS[name]
        made = builder.make(table)
        size = made.B.shape[1]
        states, names = builder.states(size), builder.inputs(size)
        for signal in outputs if "C" not in table else ():
            if signal not in states:
                raise InputError(f"signal '{signal}': the builder {name} has no such state; it has {', '.join(states)}")
        if list(names) != inputs:
            raise InputError(f"inputs are {', '.join(inputs) or 'none'}: the builder {name} needs, in this order, {', '.join(names)}")
        hold_s: float | None = sample_time_s
        C = table.matrix("C", len(outputs), len(states)) if "C" in table else np.eye(len(states))[[states.index(s) for s in outputs]]
        D = np.zeros((len(outputs), len(inputs)))
    else:
        made, C, D = _read_matrices(table, len(outputs), len(inputs))
        n = C.shape[1]
        states = tuple(table.names("states", [f"x{i + 1}" for i in range(n)]))
        if len(states) != n:
            raise table.error("states", f"expected {n} names, found {len(states)}")
        hold_s = None if table.flag("discrete", False) else sample_time_s
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused below
        A, B = (made.A, made.B) if hold_s is None else zero_order_hold(made.A, made.B, hold_s)
        dA, dB = (made.A_pm, made.B_pm) if hold_s is None else enclosure(made, hold_s)
    if not all(np.isfinite(x).all() for x in (A, B, dA, dB)):
        raise InputError(f"{table.where}: within a sample the plant grows beyond all numbers; check its matrices and sample_time_s")
    n = A.shape[0]
    Ed, Fd = _disturbance(table, B, D, outputs, inputs, noise)
    unknown = read_unknown(table, builder, made.A, made.B)
    if unknown is not None:
        if hold_s is None:
            raise table.error("unknown", "inputs that nobody knows act in continuous time; give A and B of continuous time and leave discrete out")
        # Behind the disturbances, held within a sample: what drives reachable sets and the emulator of campaigns.
        held = zero_order_hold(made.A, unknown.G, hold_s)[1] * unknown.bound
        Ed, Fd = np.hstack([Ed, held]), np.hstack([Fd, np.zeros((len(outputs), held.shape[1]))])
    equilibrium = table.vector("equilibrium", n) if "equilibrium" in table else np.zeros(n)
    plant = Plant(
        states=states,
        A=A,
        B=B,
        dA=dA,
        dB=dB,
        C=C,
        D=D,
        Ed=Ed,
        Fd=Fd,
        initial_range=table.vector("initial_range", n, 0.0),
        equilibrium=equilibrium,
        equilibrium_input=_holding_input(table, A, B, equilibrium),
        state_range=table.vector("state_range", n, 0.0) if "state_range" in table else np.full(n, np.inf),
        feedback=_feedback(table, A, B) if "feedback" in table else None,
        interval=made if made.A_pm.any() or made.B_pm.any() else None,
        unknown=unknown,
        hold_s=hold_s,
    )
    table.close()
    return plant


def _holding_input(table: Table, A: Array, B: Array, equilibrium: Array) -> Array:
    """The input that keeps the plant at its equilibrium: B u = (I - A) x."""
    drift = equilibrium - A @ equilibrium
    held = np.linalg.lstsq(B, drift, rcond=None)[0] if B.shape[1] else np.zeros(0)
    held = np.where(np.abs(held) < 1e-12, 0.0, held)
    left = np.abs(drift - B @ held).max()
    if left > 1e-9 * max(1.0, float(np.abs(equilibrium).max())):
        raise table.error("equilibrium", f"no input holds the plant there: it would drift by {left:.3g} a sample")
    return np.asarray(held)


def _disturbance(table: Table, B: Array, D: Array, outputs: list[str], inputs: list[str], noise: dict[str, float]) -> tuple[Array, Array]:
    """Ed, Fd from the disturbance table and from the sensors' noise; measured inputs pass their noise on through B and D."""
    n, m = B.shape[0], len(outputs)
    bounds = table.table("disturbance", optional=True)
    state = _bound(bounds, "state", n)
    output = _bound(bounds, "output", m)
    bounds.close()
    on_output = np.diag([noise.get(s, 0.0) for s in outputs])
    spread = np.diag([noise.get(s, 0.0) for s in inputs]).reshape(len(inputs), len(inputs))
    on_input, through = B @ spread, D @ spread
    Ed = np.hstack([state, np.zeros((n, output.shape[1])), np.zeros((n, m)), on_input])
    Fd = np.hstack([np.zeros((m, state.shape[1])), output, on_output, through])
    used = np.any(Ed, axis=0) | np.any(Fd, axis=0)
    return Ed[:, used], Fd[:, used]


def _bound(table: Table, key: str, rows: int) -> Array:
    if key not in table:
        return np.zeros((rows, 0))
    value = table.raw(key)
    if isinstance(value, list) and value and isinstance(value[0], list):
        return table.matrix(key, rows)
    return np.diag(table.vector(key, rows, 0.0))


def _feedback(table: Table, A: Array, B: Array) -> Feedback:
    """Either a gain matrix, or the weights of a discrete linear-quadratic regulator."""
    inner = table.table("feedback")
    n, p = B.shape
    if "gain" in inner:
        gain = inner.matrix("gain", p, n)
    else:
        Q = np.diag(inner.vector("state_weights", n, 0.0))
        R = np.diag(inner.vector("input_weights", p, 1e-12))
        try:
            # The tiny weight lets the solver find the stabilising solution when a stable mode carries no weight.
            P = scipy.linalg.solve_discrete_are(A, B, Q + 1e-9 * np.eye(n), R)
        except (np.linalg.LinAlgError, ValueError) as error:
            raise inner.error("state_weights", f"no stabilising regulator ({error}); give 'gain' instead") from error
        gain = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    feedback = Feedback(gain, inner.vector("reference_bound", p, 0.0))
    inner.close()
    return feedback
