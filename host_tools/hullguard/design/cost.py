"""What each part of a detector costs on the ECU: multiplications a sample, coefficients in flash, numbers of RAM; as the C headers state them."""

from __future__ import annotations

from dataclasses import dataclass

from hullguard.design.bank_types import BankTable
from hullguard.design.design import Design
from hullguard.design.statistic import FILTER_PLACES, FILTER_ROWS, FILTER_WIDE, JUDGE_ROWS, StatisticTable
from hullguard.design.tables import GeneratorTable, PredictTable, Tables
from hullguard.design.zonotope_table import ZonotopeTable

BYTES = 4  # of a number in single precision


@dataclass(frozen=True)
class Cost:
    """Of one part."""

    name: str
    multiplications: int  # a sample
    coefficients: int  # numbers in flash
    numbers: int  # of RAM

    @property
    def flash_bytes(self) -> int:
        """In single precision."""
        return BYTES * self.coefficients

    @property
    def ram_bytes(self) -> int:
        """In single precision."""
        return BYTES * self.numbers


def costs(design: Design) -> list[Cost]:
    """Every judge in the order of the decision, then what they share. The numbers of RAM add up to hg_detector_reals() and hg_detector_sums()."""
    t = design.tables
    made = [_generator(name, g) for name, g in zip(design.judges, t.generators, strict=False)]
    made += [bank_cost(name, b) for name, b in zip(design.judges[len(made) :], t.banks, strict=False)]
    made += [_filter(name, p) for name, p in zip(design.judges[len(made) :], t.polynomials, strict=True)]
    made += [_predictor(f"prediction of {t.groups[p.group].name}", p) for p in t.predictors]
    if t.mismatch is not None:
        states, width = len(t.mismatch.constant), len(t.mismatch.signal)
        made.append(Cost("mismatch of uncertain parameters", states * width, states * (width + 1), 0))
    return [*made, _shared(t)]


def _shared(t: Tables) -> Cost:
    """Signal vectors, promises of the holds, rings of radii and values, residuals and thresholds."""
    return Cost("shared: vectors, histories", 0, 0, 2 * t.width + 2 * t.residuals + 2 * t.signals + t.width * t.history + t.signals * t.window)


def _generator(name: str, g: GeneratorTable) -> Cost:
    order, residuals, width = len(g.state), len(g.output), len(g.signal)
    work = (order + residuals) * (order + width)
    extra, coefficients, numbers = _hull(g) if g.zonotope is None else _zonotope(g.zonotope)
    return Cost(name, work + extra, work + coefficients, 2 * order + width + numbers)


def _hull(g: GeneratorTable) -> tuple[int, int, int]:
    residuals, width = len(g.output), len(g.wide)
    taps = sum(g.taps) * residuals
    return taps + (width + 1) * residuals, taps + (2 * g.settle + width + 4) * residuals, residuals


def _zonotope(z: ZonotopeTable) -> tuple[int, int, int]:
    moved = z.columns + len(z.input) + len(z.disturbance)
    matrices = (z.input, z.disturbance, z.rest, z.moving, z.output, z.outer, z.direct, z.bias_rest, z.bias_moving)
    entries = sum(len(row) for rows in matrices for row in rows)
    entries += len(z.state) + len(z.decay) + len(z.always) + len(z.growth) + len(z.output_growth)
    return moved * (len(z.output) * z.order + sum(b * b for b in z.block)), entries, z.reals


def bank_cost(name: str, b: BankTable) -> Cost:
    """Of one bank."""
    lags = b.certificates * b.window
    return Cost(name, lags * (2 * len(b.signal) + len(b.extra)), lags * (len(b.signal) + len(b.extra)) + b.certificates + 1, 2 * b.certificates)


def _filter(name: str, p: StatisticTable) -> Cost:
    """A polynomial filter: half of its work is the noise's part of the covariance. Places of one byte and of two count as the numbers that would fill them."""
    rows = p.lifted + p.measured
    tables = sum(len(getattr(p, field)) for field in (*FILTER_ROWS, *JUDGE_ROWS)) + len(p.f.coefficient) + len(p.h.coefficient)
    places = 2 * sum(len(getattr(p, field)) for field in FILTER_WIDE) + sum(len(getattr(p, field)) for field in FILTER_PLACES) + len(p.f.factor) + len(p.h.factor)
    return Cost(name, 2 * rows * p.lower * (p.lower + rows), tables + -(-places // BYTES), p.reals)


def _predictor(name: str, p: PredictTable) -> Cost:
    order, width, inputs = len(p.state), len(p.output), len(p.input)
    coefficients = inputs + order * width + (order + width) * (order + inputs) + width + len(p.radius) * width
    return Cost(name, (order + width) * (order + inputs), coefficients, 2 * order + inputs + width)
