"""The same detector in fixed point (Q31); platoon, section 8.

Every number x of the detector has a unit 2^e that it never reaches, and is held as x / 2^e in steps of 2^-31. Units follow from what is proven for
any data whatever: a value is that of a valid code, a generator's state and residual are sums over all past values, a tail is one over all past radii
as wide as the ranges. So nothing saturates but a threshold that exceeds all its residual can be, where saturation changes no verdict.

Sums of products are exact in 64 bits: each table is scaled by one power of two so that the magnitudes multiplied into one sum add up to at most 1.
What rounding does to tables and results is bounded as in float32 and added to the constant part of each threshold; radii are rounded up by STEPS.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hullguard.design import uio_hull
from hullguard.design.arith import mul, powers, times
from hullguard.design.bank_types import BankTable
from hullguard.design.hull import Fixed, Given, HullTables, Linear, build
from hullguard.design.tables import FLOAT32, GeneratorTable, GroupTable, MismatchTable, ModalGeneratorTable, SignalTable, Tables, rows
from hullguard.errors import InputError
from hullguard.model.table import Array

STEP = 2.0**-31
MOST = 1 - STEP  # saturates, and is not finite
LARGEST = 1 - 2 * STEP  # HG_REAL_MAX
STEPS = 10  # more than reading, encoder and decoder lose together, in steps of the value
MARGIN = 1.001  # of a range: what rounded tables may move it by, which is checked
EXPONENTS = (-31, 30)
CODE_EXPONENT_MIN = -40
LENGTH_MAX = 20_000


@dataclass(frozen=True)
class FixedDesign:
    """Tables for HG_REAL_Q31, numbers in units of 2^unit (k / 2^31 each), and what their rounding costs."""

    tables: Tables
    rounding: tuple[float, ...]  # residuals of generators, banks: the part of J that is rounding, residual units
    observers: tuple[FixedObserver, ...] = ()  # unknown-input observers, all estimates


@dataclass(frozen=True)
class Modal:
    """An unknown-input observer of the design, all estimates: its generator in the detector has the first of them."""

    linear: Linear
    given: uio_hull.ModalGiven
    tables: uio_hull.ModalTables


@dataclass(frozen=True)
class FixedObserver:
    """The same for HG_REAL_Q31, numbers in units of 2^unit (k / 2^31 each)."""

    table: ModalGeneratorTable  # all estimates in the place of residuals
    units: tuple[int, ...]  # of the estimates and their radii
    signal_units: tuple[int, ...]  # of the whole signal vector
    rounding: tuple[float, ...]  # estimates: the part of the radius that is rounding, signal units


def unit_of(bound: float, what: str) -> int:
    """The e with bound < 2^e that leaves no step unused."""
    if not np.isfinite(bound) or bound <= 0.0:
        raise InputError(f"{what} has no finite range")
    e = int(np.floor(np.log2(bound))) - 1
    while bound >= LARGEST * 2.0**e:
        e += 1
    return e


def near(a: Array) -> Array:
    """To the nearest step."""
    return np.asarray(np.rint(a / STEP) * STEP)


def above(a: Array) -> Array:
    """To a step that is not below, and to HG_REAL_MAX where it is larger."""
    return np.asarray(np.minimum(np.ceil(a / STEP * (1 + 1e-12)) * STEP, LARGEST))


def _exponent(sums: Array, what: str) -> int:
    """The power of two that brings these sums of magnitudes to at most 1, with room for the rounding of each term."""
    largest = float(np.max(sums, initial=0.0)) * (1 + 1e-6)
    exponent = max(int(np.ceil(np.log2(largest))), EXPONENTS[0]) if largest > 0 else 0
    if exponent > EXPONENTS[1]:
        raise InputError(f"{what}: its coefficients differ by more than 2^{EXPONENTS[1]}")
    return exponent


def lower(tables: Tables, linear: tuple[Linear, ...], given: tuple[Given, ...], hulls: tuple[HullTables, ...], where: str, modal: tuple[Modal, ...] = ()) -> FixedDesign:
    """A design's tables in fixed point; refuses what has no range that holds for any data.

    The last generators are unknown-input observers, `modal`; all others have `linear`, `given` and `hulls`.
    """
    _refuse(tables, where)
    groups = tuple(_group(g, where) for g in tables.groups)
    sent = [s for g in groups for s in g.signals]
    values = np.array([_largest(s) for g in tables.groups for s in g.signals])
    spans = np.array([s.span * 2.0**s.unit for s in sent])
    units = np.array([s.unit for s in sent])
    mismatch = None
    if tables.mismatch is not None:
        mismatch, more, radii = _mismatch(tables.mismatch, units, values, spans, where)
        units, spans = np.concatenate([units, more]), np.concatenate([spans, radii])
    scale = 2.0 ** units.astype(float)
    residual_units: list[int] = []
    rounding: list[float] = []
    generators: list[GeneratorTable] = []
    observers = []
    for i, g in enumerate(tables.generators):
        if i < len(given):
            made, unit, lost = _generator(g, linear[i], given[i], hulls[i], _Signals(scale, values, spans), f"{where}: detector.observers[{i}]")
        else:
            observers.append(_modal(g, modal[i - len(given)], units, values, f"{where}: detector.uio[{i - len(given)}]"))
            made, unit, lost = _first(g, observers[-1])
        generators.append(made)
        residual_units += unit
        rounding += lost
    banks = []
    for b in tables.banks:
        bank, unit_b, lost_b = _bank(b, scale, values, f"{where}: its bank")
        banks.append(bank)
        residual_units.append(unit_b)
        rounding.append(lost_b)
    everything = (*(int(u) for u in units), *residual_units)
    made_tables = replace(
        tables, groups=groups, generators=tuple(generators), banks=tuple(banks), mismatch=mismatch, units=everything, float_hash=tables.hash, fixed=None, not_fixed=""
    )
    return FixedDesign(made_tables, tuple(rounding), tuple(observers))


@dataclass(frozen=True)
class _Signals:
    """Of the whole signal vector; values of the sent ones only."""

    scale: Array
    value: Array
    span: Array


def _refuse(tables: Tables, where: str) -> None:
    if tables.polynomials:
        raise InputError(f"{where}: not for fixed point: the moments of a polynomial filter have no proven range; use float32")
    if any(g.zonotope is not None for g in tables.generators):
        raise InputError(f'{where}: not for fixed point: the columns of a zonotope have no proven range; set detector.threshold = "exact"')
    if tables.predictors:
        name = tables.groups[tables.predictors[0].group].name
        cure = "set detector.prediction = false"
        raise InputError(f"{where}: not for fixed point: the prediction of '{name}' copies the plant without feedback and has no range that holds for any data; {cure}")
    for g in tables.groups:
        for s in g.signals:
            if s.flags & FLOAT32:
                raise InputError(f"{where}: not for fixed point: signal '{s.name}' is a float32 on the wire; give it an integer field")


def _largest(s: SignalTable) -> float:
    return max(abs(s.offset + s.resolution * s.minimum), abs(s.offset + s.resolution * s.maximum), abs(s.middle))


def _signal(s: SignalTable, slew: float, where: str) -> SignalTable:
    largest = _largest(s)
    unit = unit_of((largest + max(s.span, s.half, slew)) * 1.0001, f"{where}: signal '{s.name}'")  # a mismatch adds the two
    scale, step = 2.0**unit, 2.0 ** (unit - 31)
    mantissa, exponent = np.frexp(s.resolution / scale)
    if exponent < CODE_EXPONENT_MIN:
        raise InputError(f"{where}: signal '{s.name}': a resolution of {s.resolution:g} in a range of {largest:g} is too fine for fixed point; make it coarser")
    return replace(
        s,
        resolution=float(near(np.array(mantissa))),
        offset=float(near(np.array(s.offset / scale))),
        per_unit=float(near(np.array(0.25 / mantissa))),
        half=float(above(np.array((s.half + STEPS * step) / scale))),
        span=float(above(np.array((s.span + STEPS * step) / scale))),
        middle=float(near(np.array(s.middle / scale))),
        exponent=int(exponent),
        unit=unit,
    )


def _group(g: GroupTable, where: str) -> GroupTable:
    if not g.signals:
        return g
    slew = np.array(g.slew)
    signals = tuple(_signal(s, float(slew[:, i].max()), where) for i, s in enumerate(g.signals))
    scale = np.array([2.0**s.unit for s in signals])
    return replace(g, signals=signals, slew=rows(above(slew / scale + STEPS * STEP)))


def _mismatch(m: MismatchTable, units: Array, values: Array, spans: Array, where: str) -> tuple[MismatchTable, Array, Array]:
    """Tables, units of the derived radii, and how large these can be."""
    place, gain, constant = list(m.signal), np.array(m.gain).reshape(len(m.constant), -1), np.array(m.constant)
    radii = constant + mul(gain, (values + spans)[place, None])[:, 0]
    own = np.array([unit_of(r * MARGIN, f"{where}: the mismatch of an uncertain state") for r in radii])
    scaled = gain * 2.0 ** (units[place].astype(float) - own[:, None])
    exponent = _exponent(scaled.sum(1), f"{where}: its mismatch")
    # The sum rounds once.
    made = replace(m, constant=tuple(float(x) for x in above(constant / 2.0**own + 2 * STEP)), gain=rows(above(scaled / 2.0**exponent)), exponent=exponent)
    return made, own, radii * MARGIN


def _generator(g: GeneratorTable, lin: Linear, given: Given, like: HullTables, signals: _Signals, where: str) -> tuple[GeneratorTable, list[int], list[float]]:
    """Tables, units of the residuals, and rounding."""
    place, wide = list(g.signal), list(g.wide)
    v, spans = signals.value[place], signals.span[wide]
    z, r = _ranges(lin, v)
    tail = (np.array(g.tail) * spans).sum(1) / (1 - np.array(g.decay)) + np.maximum(g.rest_left, g.moving_left)
    z_unit = np.array([unit_of(x * MARGIN, f"{where}: its state") for x in z])
    r_unit = np.array([unit_of(max(a, b) * MARGIN, f"{where}: its residual") for a, b in zip(r, tail, strict=True)])
    Z, R = 2.0**z_unit, 2.0**r_unit
    held, as_run, (moved, shown) = _matrices(lin, Z, R, signals.scale[place], where)
    _check(as_run, v, Z, R, where)
    t = build(as_run, given, where, Fixed(Z * STEP, R * STEP, like))
    weight, into = t.weight * signals.scale[wide] / R[:, None], t.tail * signals.scale[wide] / R[:, None]
    summed = _exponent(np.concatenate([weight.sum((0, 2)), into.sum(1)]), where)
    tail = (t.tail * spans).sum(1) / (1 - t.decay) + np.maximum(t.rest_left, t.moving_left)
    if np.any(tail >= LARGEST * R):
        raise InputError(f"{where}: not for fixed point: the tail of its threshold has no proven range")
    made = replace(
        g,
        state=rows(held.state),
        input=rows(held.input),
        output=rows(held.output),
        direct=rows(held.direct),
        weight=tuple(rows(w) for w in above(weight / 2.0**summed)),
        rest=rows(above(t.rest[: t.settle] / R)),
        rest_left=_row(above(t.rest_left / R)),
        moving=rows(above(t.moving[: t.settle] / R)),
        moving_left=_row(above(t.moving_left / R)),
        bias=_row(above(t.bias / R)),
        decay=_row(above(t.decay)),
        tail=rows(above(into / 2.0**summed)),
        exponents=(moved, shown, summed),
    )
    return made, [int(u) for u in r_unit], [float(x) for x in t.rounding]


def _matrices(lin: Linear, Z: Array, R: Array, V: Array, where: str) -> tuple[Linear, Linear, tuple[int, int]]:
    """A generator in units of its states, residuals and signals: as stored, the same in units of the model, and the exponents."""
    state, inputs = lin.state * Z / Z[:, None], lin.input * V / Z[:, None]
    output, direct = lin.output * Z / R[:, None], lin.direct * V / R[:, None]
    moved = _exponent(np.abs(state).sum(1) + np.abs(inputs).sum(1), where)
    shown = _exponent(np.abs(output).sum(1) + np.abs(direct).sum(1), where)
    held = Linear(near(state / 2.0**moved), near(inputs / 2.0**moved), near(output / 2.0**shown), near(direct / 2.0**shown))
    to_state, to_residual = 2.0**moved * Z[:, None], 2.0**shown * R[:, None]
    return held, Linear(held.state * to_state / Z, held.input * to_state / V, held.output * to_residual / Z, held.direct * to_residual / V), (moved, shown)


def _modal(g: GeneratorTable, u: Modal, units: Array, values: Array, where: str) -> FixedObserver:
    """All estimates of an unknown-input observer. None reaches its unit, nor a radius or theta, whatever the codes, and the radii below their units, are."""
    place = list(g.signal)
    v, V = values[place], 2.0 ** units[place].astype(float)
    z, r = _ranges(u.linear, v)
    z_unit = np.array([unit_of(x * MARGIN, f"{where}: its state") for x in z])
    r_unit = np.array([unit_of(max(a, b) * MARGIN, f"{where}: its estimate") for a, b in zip(r, _widest(u.tables, V), strict=True)])
    Z, R = 2.0**z_unit, 2.0**r_unit
    held, as_run, (moved, shown) = _matrices(u.linear, Z, R, V, where)
    _check(as_run, v, Z, R, where)
    t = uio_hull.build(as_run, u.given, where, Fixed(Z * STEP, R * STEP, u.tables))
    if t.mode_decay.shape != u.tables.mode_decay.shape:
        raise InputError(f"{where}: not for fixed point: rounded tables have other modes than the exact ones; spread the poles")
    start = np.maximum(t.mode_rest, t.mode_moving)
    M = 2.0 ** np.array([unit_of((x or 1.0) * MARGIN, f"{where}: a mode of its radii") for x in start + times(t.mode_input, V) / (1 - t.mode_decay)])
    # A theta rounds two products a sample, half a step each.
    own = times(t.mode_output, M * STEP / (1 - t.mode_decay)) * (1 + 1e-6)
    weight, into, out = t.weight * V / R[:, None], t.mode_input * V / M[:, None], t.mode_output * M / R[:, None]
    summed = _exponent(np.concatenate([weight.sum((0, 2)) + out.sum(1), into.sum(1)]), where)
    made = ModalGeneratorTable(
        **{
            **vars(g),
            "state": rows(held.state),
            "input": rows(held.input),
            "output": rows(held.output),
            "direct": rows(held.direct),
            "weight": tuple(rows(w) for w in above(weight / 2.0**summed)),
            "rest": rows(above((t.rest[: t.settle] + own) / R)),
            "rest_left": _row(t.rest_left),
            "moving": rows(above((t.moving[: t.settle] + own) / R)),
            "moving_left": _row(t.moving_left),
            "bias": _row(above((t.bias + own) / R)),
            "decay": _row(t.decay),
            "tail": rows(t.tail),
            "exponents": (moved, shown, summed),
            "mode_decay": _row(above(t.mode_decay)),
            "mode_input": rows(above(into / 2.0**summed)),
            "mode_output": rows(above(out / 2.0**summed)),
            "mode_rest": _row(above(t.mode_rest / M)),
            "mode_moving": _row(above(t.mode_moving / M)),
        }
    )
    _check_radii(made, where)
    return FixedObserver(made, tuple(int(x) for x in r_unit), tuple(int(x) for x in units), _row(t.rounding + own))


def _widest(t: uio_hull.ModalTables, V: Array) -> Array:
    """The largest radii of estimates, after any radii of signals within +-V. A theta moves on once before it is first read."""
    theta = np.maximum(t.mode_rest, t.mode_moving) * t.mode_decay + times(t.mode_input, V) / (1 - t.mode_decay)
    bias = np.max(np.vstack([t.rest, t.moving, t.bias]), axis=0)
    return np.asarray((t.weight * V).sum((0, 2)) + times(t.mode_output, theta) + bias)


def _check_radii(g: ModalGeneratorTable, where: str) -> None:
    """The ranges of thetas and radii once more, of the tables as they are stored, with what each step rounds: the units were chosen before."""
    scale, decay = 2.0 ** g.exponents[2], np.array(g.mode_decay)
    start, later = np.maximum(g.mode_rest, g.mode_moving), (scale * np.array(g.mode_input).sum(1) + STEP) / (1 - decay)
    bias = np.max(np.vstack([g.rest, g.moving, g.bias]), axis=0)
    radius = scale * (np.array(g.weight).sum((0, 2)) + times(np.array(g.mode_output), start * decay + later + STEP)) + bias + STEP
    if np.any(start + later >= LARGEST) or np.any(radius >= LARGEST):
        raise InputError(f"{where}: not for fixed point: rounded tables of its radii leave the range of the exact ones")


def _first(g: GeneratorTable, made: FixedObserver) -> tuple[GeneratorTable, list[int], list[float]]:
    """The generator of a detector: the first estimates alone."""
    t, count = made.table, len(g.output)
    of_rows: dict[str, Any] = {name: getattr(t, name)[:count] for name in ("output", "direct", "rest_left", "moving_left", "bias", "decay", "tail", "mode_output")}
    by_sample: dict[str, Any] = {name: tuple(x[:count] for x in getattr(t, name)) for name in ("weight", "rest", "moving")}
    return replace(t, **of_rows, **by_sample), list(made.units[:count]), list(made.rounding[:count])


def _row(a: Array) -> tuple[float, ...]:
    return tuple(float(x) for x in a)


def _ranges(lin: Linear, v: Array) -> tuple[Array, Array]:
    """What state and residual can be after any values within +-v: sums of impulse responses, from above."""
    spectral = float(np.abs(np.linalg.eigvals(lin.state)).max())
    length = min(LENGTH_MAX, max(64, int(np.ceil(np.log(1e-9) / np.log(max(spectral, 0.05))))))
    entering = mul(np.abs(lin.input), v[:, None])
    z = times(np.abs(mul(powers(np.eye(len(lin.state)), lin.state, length), lin.input)), v).sum(0)
    # What is left of z after that many steps can be no larger than it ever was times what the power of G leaves.
    rest = float(np.abs(np.linalg.matrix_power(lin.state, length)).sum(1).max())
    if rest >= 1e-3:
        raise InputError("the generator forgets too slowly for fixed point: choose poles further inside the unit circle")
    z = z + rest / (1 - rest) * z.max() + 1e-12 * entering.max()
    return z, times(np.abs(lin.output), z) + times(np.abs(lin.direct), v)


def _check(lin: Linear, v: Array, Z: Array, R: Array, where: str) -> None:
    """The ranges once more, of the tables as they are stored, with what each step rounds: the units were chosen before."""
    rounds = Linear(lin.state, np.hstack([lin.input, np.diag(Z)]), lin.output, np.hstack([lin.direct, np.zeros((len(R), len(Z)))]))
    z, r = _ranges(rounds, np.concatenate([v, np.full(len(Z), STEP)]))
    if np.any(z >= LARGEST * Z) or np.any(r + STEP * R >= LARGEST * R):
        raise InputError(f"{where}: not for fixed point: rounded tables leave the range of the exact ones")


def _bank(b: BankTable, scale: Array, values: Array, where: str) -> tuple[BankTable, int, float]:
    """Tables, unit of its residuals, and rounding."""
    place = list(b.signal)
    weight = np.array(b.weight)  # window x signals x certificates
    r = (np.abs(weight) * values[place, None]).sum((0, 1))
    unit = unit_of(float(r.max()) * MARGIN, where)
    R = 2.0**unit
    scaled = weight * scale[place, None] / R
    extra = np.array(b.extra_weight) * scale[list(b.extra), None] / R if b.extra else np.zeros((len(weight), 0, weight.shape[2]))
    exponent = _exponent((np.abs(scaled).sum((0, 1)) + extra.sum((0, 1))), where)
    # Half a step of each weight, times a value and a radius that are below 1; one step of each sum.
    lost = (weight.shape[0] * weight.shape[1] * STEP * 2.0**exponent + 2 * STEP) * R
    made = replace(
        b,
        weight=tuple(rows(w) for w in near(scaled / 2.0**exponent)),
        bias=_row(above((np.array(b.bias) + lost) / R)),
        widen=1.0,
        extra_weight=tuple(rows(w) for w in above(extra / 2.0**exponent)) if b.extra else (),
        exponent=exponent,
    )
    return made, unit, float(lost)
