"""A certificate bank: its stored numbers, and the tables that the C library runs; platoon, section 7.

With lag 0 the newest sample and the model's signal vector v, outputs and inputs alike:

    r_c(k) = sum_lag sum_g weight[lag][g][c] value_g(k-lag)
    J_c(k) = bias_c + sum_lag sum_g |weight[lag][g][c]| widen radius_g(k-lag) + sum_lag sum_e extra_weight[lag][e][c] radius_e(k-lag)

There is no output before `window` samples since the start; the bank alarms when any |r_c| > J_c. With w the weights of the outputs and w_u those
of the inputs over the window, r = w'O x0 + w'Md d + (w'Mu + w_u') u + w'Me e + w'Gamma f + (w, w_u)'(value - true value), so that

    bias >= |w'O| |x|max + sum |w'Md| + |w'Mu + w_u'| |u|max + sum |w'Gamma| fmax + rounding of r and J

bounds |r| in whatever numbers the table holds: w'O, w'Mu + w_u' and w'Gamma, zero by design, keep what rounding leaves of them.
"""

from __future__ import annotations

import numpy as np

from hullguard.design.arith import digits, gamma32, mul, nearest32, row_sums, times, up32
from hullguard.design.bank_types import BankTable, StoredBank
from hullguard.design.reach import largest
from hullguard.design.store import Stored
from hullguard.design.window import Varying, WindowForm, fault_response, window_form
from hullguard.errors import InputError
from hullguard.model.schema import Fault, Model
from hullguard.model.table import Array

FAULT_SIZE = 3.0  # largest |f| of a hypothesis' fault, signal units, where nothing else is said
DOUBLE = 1 + 1e-9  # far more than what the sums below lose in double precision
SETTLED = 1e-9
SETTLE_MAX = 20_000


def stored_weight(weight: Array) -> Array:
    """Certificates as a design file keeps them: float32 numbers in as many digits as tell them apart."""
    return digits(nearest32(weight), 9) + 0.0  # no -0


def full_weight(model: Model, form: WindowForm, weight: Array) -> Array:
    """Certificates over all signals: w at the outputs, -w'Mu at the inputs; certificates x window (oldest first) x signals."""
    count, window, _ = weight.shape
    made = np.zeros((count, window, len(model.signals)))
    made[:, :, model.outputs] = weight
    made[:, :, model.inputs] = -mul(weight.reshape(count, -1), form.Mu).reshape(count, window, -1)
    return made


def bank_table(model: Model, stored: Stored, bank: StoredBank, varying: Varying | None = None, fault_size: float = FAULT_SIZE) -> BankTable:
    """Tables of a bank by plain arithmetic from stored numbers. `model` carries the stored plant, as design.finish makes it.

    `varying`: disturbances whose bounds are radii of derived signals; `fault_size`: largest |f| of the hypothesis' fault, in its signal's units.
    """
    form = window_form(model.plant, bank.window, varying)
    weight = nearest32(full_weight(model, form, nearest32(bank.weight)))
    terms = bank.window * (len(model.signals) + form.Me.shape[1] // bank.window) + 4
    gamma, widen = gamma32(terms), widened(terms)
    values = _values(model, stored, bank)
    bias = _healthy(model, form, weight, _states(model, stored, bank, fault_size), values[model.inputs])
    bias += gamma * times(np.abs(weight).reshape(len(weight), -1), np.tile(values, bank.window))
    bias = (bias + _left(model, bank, form, weight, fault_size)) * (1 + gamma) * DOUBLE
    if not np.all(np.isfinite(bias)):
        cure = "give plant.state_range" if bank.hypothesis is None else "give [plant] feedback with a stable loop, which bounds what a fault can do"
        raise InputError(f"{model.path.name}: a certificate bank needs a bound of every state: {cure}")
    used = np.any(weight != 0, axis=(0, 1))
    extra = np.abs(mul(weight[:, :, model.outputs].reshape(len(weight), -1), form.Me)).reshape(len(weight), bank.window, -1)
    return BankTable(
        signal=tuple(range(len(model.signals))),
        window=bank.window,
        weight=_by_lag(weight),
        bias=tuple(float(x) for x in up32(bias)),
        widen=widen,
        faults=bank.faults,
        feeds=sum(1 << i for i, group in enumerate(model.groups) if any(used[s] for s in group.signals)),
        extra_weight=_by_lag(up32(extra * widen)) if extra.shape[2] else (),
    )


def widened(terms: int) -> float:
    """Factor on radii that covers the rounding of as many products in J, and in r the part that grows with the radii (proved: tests/gappa)."""
    gamma = gamma32(terms)
    return float(up32(np.array((1 + gamma) * (1 + gamma) * DOUBLE)))


def _by_lag(a: Array) -> tuple[tuple[tuple[float, ...], ...], ...]:
    """Certificates x window x signals as nested tuples window x signals x certificates, the newest sample first."""
    return tuple(tuple(tuple(float(x) for x in signal) for signal in lag) for lag in a[:, ::-1].transpose(1, 2, 0))


def _healthy(model: Model, form: WindowForm, weight: Array, state: Array, inputs: Array) -> Array:
    """|w'O| |x|max + sum |w'Md| + |w'Mu + w_u'| |u|max for each certificate."""
    w = weight[:, :, model.outputs].reshape(len(weight), -1)
    w_u = weight[:, :, model.inputs].reshape(len(weight), -1)
    seen = np.abs(mul(w, form.O))
    # A state that a certificate does not see at all may be unbounded.
    initial = row_sums(seen * np.where(seen > 0, state, 0.0))
    return initial + row_sums(np.abs(mul(w, form.Md))) + times(np.abs(mul(w, form.Mu) + w_u), np.tile(inputs, form.window))


def _states(model: Model, stored: Stored, bank: StoredBank, size: float) -> Array:
    """Largest magnitude of every state, under the hypothesis' fault where there is one."""
    if bank.hypothesis is None:
        return stored.state_range
    return stored.state_range + moved(model, model.faults[bank.hypothesis]) * size


def _values(model: Model, stored: Stored, bank: StoredBank) -> Array:
    """Largest magnitude of every signal: what it can reach, under a fault its declared range, beyond which no value can be sent."""
    if bank.hypothesis is not None:
        return np.array([max(abs(s.low), abs(s.high)) for s in model.signals])
    return np.array([largest(model, stored.signal_reach, i) for i in range(len(model.signals))])


def _left(model: Model, bank: StoredBank, form: WindowForm, weight: Array, size: float) -> Array:
    """The sum |w'Gamma| fmax: what rounding leaves of the hypothesis' fault."""
    if bank.hypothesis is None:
        return np.zeros(len(weight))
    fault = model.faults[bank.hypothesis]
    if fault.type == "sensor":
        return row_sums(np.abs(weight[:, :, fault.signal])) * size
    return row_sums(np.abs(mul(weight[:, :, model.outputs].reshape(len(weight), -1), fault_response(model, form, fault)))) * size


def moved(model: Model, fault: Fault) -> Array:
    """How much further a fault of any course within -1 .. 1 can move the states in the closed loop; n."""
    plant = model.plant
    if fault.signal in model.inputs and fault.type == "sensor":
        return np.zeros(plant.n)
    gain = np.zeros((plant.p, plant.n)) if plant.feedback is None else plant.feedback.gain
    A = plant.A - mul(plant.B, gain)
    if fault.type == "actuator":
        into = plant.B[:, [model.inputs.index(fault.signal)]]
    else:
        # A controller that believes the sensor is off by the smallest state that would read so.
        row = plant.C[[model.outputs.index(fault.signal)]]
        into = mul(plant.B, mul(gain, row.T / row_sums(row * row)))
    total = np.zeros((plant.n, 1))
    for _ in range(SETTLE_MAX):
        total += np.abs(into)
        into = mul(A, into)
        if np.abs(into).max() < SETTLED * max(1.0, float(total.max())):
            return np.asarray(total[:, 0] * (1 + 1e-3))  # the rest of the sum is far less
    return np.full(plant.n, np.inf)
