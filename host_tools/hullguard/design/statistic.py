"""Polynomial filters of a model as judges of its detector (firmware: statistic.h): the expanded plant in scaled variables, and tables in float32.

States are counted from the operating point in units of the nearest power of two to five of their initial standard deviations, measurements likewise by their
noise: numbers near 1 whatever the model's units, and no rounding in between.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hullguard.design import polynomial
from hullguard.design.arith import nearest32, up32
from hullguard.design.checks import Check
from hullguard.design.polynomial import Exponents, Map, Polynomial
from hullguard.errors import InputError
from hullguard.model.polynomial import FilterSpec, Nonlinear
from hullguard.model.schema import Model

if TYPE_CHECKING:
    from hullguard.design.tables import GroupTable

STATISTICS = ("plain", "joint", "drift")
UNIT = 5.0  # standard deviations, about
REACH = 3.0  # standard deviations that the remainder's bound counts on
QUANTUM_MAX = 0.3  # of a sensor's noise: what quantisation may add to it
WIDER = 1.0 + 1e-6

Reals = tuple[float, ...]


@dataclass(frozen=True)
class MapTable:
    """hg_polynomial_map."""

    width: int
    end: tuple[int, ...]
    coefficient: Reals
    factor: tuple[int, ...]


@dataclass(frozen=True)
class StatisticTable:
    """hg_statistic_config with its hg_polynomial_config, what the decision says of it, and its memory."""

    states: int
    outputs: int
    degree: int
    bounded: bool
    lifted: int
    measured: int
    judged: int
    noises: int
    ring: int
    lower: int
    f: MapTable
    h: MapTable
    start: tuple[int, ...]
    product: tuple[int, ...]
    parent: tuple[int, ...]
    factor: tuple[int, ...]
    noise: tuple[int, ...]
    moment: tuple[int, ...]
    mean: Reals
    covariance: Reals
    cut_moment: tuple[int, ...]
    cut_state: tuple[int, ...]
    cut_scale: Reals
    box: Reals
    x0: Reals
    P0: Reals
    M0: Reals
    Q: Reals
    R: Reals
    range: Reals
    fresh: Reals
    reach: float
    kappa: float
    joint: float
    weight: float
    drift: float
    signal: tuple[int, ...]
    gain: Reals
    input: tuple[int, ...]
    zero: Reals
    drive: Reals  # states x inputs
    direct: Reals  # outputs x inputs
    known: Reals
    settle: int
    reals: int  # numbers of RAM: hg_statistic_reals()
    unit: Reals  # of the states, physical units a filter unit: for people
    point: Reals  # and where they are counted from
    feeds: int = 0
    faults: int = 0


# Fields of hg_polynomial_config and of hg_statistic_config by their kind.
FILTER_COUNTS = ("states", "outputs", "degree", "lifted", "measured", "judged", "noises", "ring", "lower")
FILTER_WIDE = ("start", "product")
FILTER_PLACES = ("parent", "factor", "noise", "moment", "cut_moment", "cut_state")
FILTER_ROWS = ("mean", "covariance", "cut_scale", "box", "x0", "P0", "M0", "Q", "R", "range", "fresh")
FILTER_NUMBERS = ("reach", "kappa", "joint", "weight", "drift")
JUDGE_PLACES = ("signal", "input")
JUDGE_ROWS = ("gain", "zero", "drive", "direct", "known")
NOT_READ = 1.0  # in tables of a bound that is not asked for


def power(x: float) -> float:
    """The nearest power of two."""
    return float(2.0 ** round(math.log2(x)))


@dataclass(frozen=True)
class Scaled:
    """The plant as a filter has it."""

    plant: polynomial.Plant
    unit: tuple[float, ...]  # of states
    gain: tuple[float, ...]  # of the filter's outputs


def scaled_plant(plant: Nonlinear, outputs: Sequence[int]) -> Scaled:
    """With x = point + unit xi and y' = gain y."""
    unit = [power(UNIT * d) for d in plant.deviation]
    gain = [1.0 / power(UNIT * math.sqrt(plant.v[j].moment(2))) for j in outputs]
    n, origin = len(unit), (0,) * len(unit)

    def rescaled(terms: dict[Exponents, float], factor: float, less: float) -> Polynomial:
        made = {m: c * math.prod(s**e for s, e in zip(unit, m, strict=True)) * factor for m, c in terms.items()}
        made[origin] = (terms.get(origin, 0.0) - less) * factor
        return Polynomial(n, {m: c for m, c in made.items() if c != 0.0})

    f = tuple(rescaled(e.terms, 1.0 / s, c) for e, s, c in zip(plant.of_f, unit, plant.point, strict=True))
    h = tuple(rescaled(plant.of_h[j].terms, g, 0.0) for j, g in zip(outputs, gain, strict=True))
    w = tuple(noise.scaled(1.0 / s) for noise, s in zip(plant.w, unit, strict=True))
    v = tuple(plant.v[j].scaled(g) for j, g in zip(outputs, gain, strict=True))
    x0 = tuple((m - c) / s for m, c, s in zip(plant.mean, plant.point, unit, strict=True))
    P0 = tuple((d / s) ** 2 for d, s in zip(plant.deviation, unit, strict=True))
    return Scaled(polynomial.Plant(f, h, w, v, x0, P0), tuple(unit), tuple(gain))


@dataclass(frozen=True)
class Known:
    """What the groups' tables say of the signals, a number a place."""

    half: Sequence[float]  # error of a value that has just arrived
    usual: Sequence[float]  # radius most of the time


def known_of(groups: Sequence[GroupTable], usual: Sequence[float]) -> Known:
    """From the tables of all groups; `usual` radii of the whole signal vector."""
    half = [s.half for g in groups for s in g.signals]
    return Known(half, usual[: len(half)])


def statistic_table(model: Model, spec: FilterSpec, known: Known) -> StatisticTable:
    """Tables of one filter."""
    plant = model.plant.nonlinear
    assert plant is not None
    outputs, places, inputs = list(spec.outputs), [model.outputs[j] for j in spec.outputs], model.inputs
    scaled = scaled_plant(plant, outputs)
    try:
        made = polynomial.make(scaled.plant, spec.degree, spec.bounded, _for_filter(spec, len(outputs)))
    except InputError as error:
        raise InputError(f"{model.path.name}: detector.{error}") from error
    gain = np.array(scaled.gain)
    drive = model.plant.B / np.array(scaled.unit)[:, None]
    direct = model.plant.D[outputs] * gain[:, None]
    # An input's silence is part of w: its radius is known as long as no frame is lost.
    radius = [max(known.half[i], known.usual[i]) * WIDER for i in inputs]
    far = [max(abs(model.signals[i].low - z), abs(model.signals[i].high - z)) for i, z in zip(inputs, plant.input, strict=True)]
    most = np.array([max(abs(model.signals[i].low), abs(model.signals[i].high)) for i in places])
    n = made.plant.states
    return StatisticTable(
        states=n, outputs=made.plant.outputs, degree=made.degree, bounded=made.bounded, **made.sizes,
        f=_map(made.f), h=_map(made.h), start=made.start, product=made.product, parent=made.parent, factor=made.factor, noise=made.noise, moment=made.moment,
        mean=_near(made.mean), covariance=_near(made.covariance), cut_moment=made.cut_moment, cut_state=made.cut_state, cut_scale=_near(made.cut_scale),
        box=_near([b / s for b, s in zip(plant.box, scaled.unit, strict=True)]), x0=_near(made.plant.x0), P0=_near(np.diag(made.plant.P0)), M0=_near(made.M0),
        Q=_near([d.moment(2) for d in made.plant.w]), R=_near([d.moment(2) for d in made.plant.v]),
        range=_above((gain * most + np.abs(direct) @ np.array(far)) * 1.01), fresh=_above(gain * np.array([known.half[i] for i in places]) * WIDER),
        reach=REACH, kappa=_one(spec.kappa), joint=_one(spec.joint**2), weight=_one(spec.weight), drift=_one(spec.drift**2),
        signal=tuple(places), gain=scaled.gain, input=tuple(inputs), zero=_near(plant.input), drive=_near(drive), direct=_near(direct), known=_above(radius),
        settle=spec.settle, reals=made.reals + 2 * made.plant.outputs, unit=scaled.unit, point=plant.point,
        feeds=sum(1 << g for g, group in enumerate(model.groups) if {*places, *inputs} & set(group.signals)), faults=sum(1 << f for f in spec.faults),
    )  # fmt: skip


def _for_filter(spec: FilterSpec, outputs: int) -> int | None:
    """Bytes that are left for the filter beside the judge's own two numbers an output."""
    return None if spec.ram is None else spec.ram - 8 * outputs


def _map(made: Map) -> MapTable:
    return MapTable(made.width, made.end, _near(made.coefficient), made.factor)


def _near(values: object) -> Reals:
    return tuple(float(x) for x in nearest32(np.ravel(np.asarray(values, dtype=float))))


def _above(values: object) -> Reals:
    return tuple(float(x) for x in up32(np.ravel(np.asarray(values, dtype=float))))


def _one(value: float) -> float:
    return _near([value])[0]


def statistic_checks(model: Model, known: Known) -> list[Check]:
    """What the expansions leave out, and what quantisation adds, beside the noise that the filter knows."""
    plant = model.plant.nonlinear
    if plant is None:
        return []
    checks = []
    names = [(model.plant.states[i], e, w) for i, (e, w) in enumerate(zip(plant.of_f, plant.w, strict=True))]
    names += [(model.signals[model.outputs[j]].name, e, v) for j, (e, v) in enumerate(zip(plant.of_h, plant.v, strict=True))]
    for name, e, noise in names:
        deviation = math.sqrt(noise.moment(2))
        share = e.remainder / deviation if deviation > 0.0 else (math.inf if e.remainder > 0.0 else 0.0)
        checks.append(Check(f"remainder of {name} on the box, standard deviations of its noise", share, 1.0, "raise [plant] expansion, or make the box smaller"))
    for j, place in enumerate(model.outputs):
        share = known.half[place] / math.sqrt(plant.v[j].moment(2))
        checks.append(Check(f"quantisation of {model.signals[place].name}, standard deviations of its noise", share, QUANTUM_MAX, "make its resolution finer"))
    return checks
