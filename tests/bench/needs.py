"""What the detector's parts cannot do without: a number loaded for every coefficient, a number loaded for every signal and state once a sample, and
a multiply-accumulate for every coefficient's use. No bound from below in the strict sense: some processors load several numbers by one instruction.
"""

from __future__ import annotations

from dataclasses import dataclass

from hullguard.design.bank_types import BankTable
from hullguard.design.tables import GeneratorTable, PredictTable, Tables


@dataclass(frozen=True)
class Need:
    """Of a part, a sample."""

    loads: int
    macs: int

    def __add__(self, other: Need) -> Need:
        return Need(self.loads + other.loads, self.macs + other.macs)

    @property
    def all(self) -> int:
        """One instruction each."""
        return self.loads + self.macs


def needs(tables: Tables) -> dict[str, Need]:
    """Of every part that computes with numbers; holds and decision compare integers and a few numbers only."""
    made: dict[str, Need] = {}

    def add(part: str, need: Need) -> None:
        made[part] = made.get(part, Need(0, 0)) + need

    for g in tables.generators:
        add("residual", _residual(g))
        if g.zonotope is None:
            add("hull", _hull(g))
        else:
            z = g.zonotope
            moved = z.columns + len(z.input) + len(z.disturbance)
            entries = len(z.output) * z.order + sum(b * b for b in z.block)
            add("zonotope", Need(entries + moved * z.order, entries * moved))
    for b in tables.banks:
        add("bank", _bank(b))
    for p in tables.predictors:
        add("predict", _predict(p))
    if tables.mismatch is not None:
        states, width = len(tables.mismatch.constant), len(tables.mismatch.signal)
        add("mismatch", Need(states * width + width + states, states * width))
    return made


def _residual(g: GeneratorTable) -> Need:
    order, residuals, width = len(g.state), len(g.output), len(g.signal)
    entries = (order + residuals) * (order + width)
    return Need(entries + order + width, entries)


def _hull(g: GeneratorTable) -> Need:
    """The taps; behind them a tail for every residual, which takes in a row and has one state; the bias."""
    residuals, width, taps = len(g.output), len(g.wide), sum(g.taps)
    entries = (taps + width + 1) * residuals
    return Need(entries + taps + width + 2 * residuals, entries)


def _bank(b: BankTable) -> Need:
    """Values and radii of all lags, each certificate's weight once for both."""
    signals, extra = len(b.signal), len(b.extra)
    weights = b.certificates * b.window * (signals + extra)
    return Need(weights + b.window * (2 * signals + extra), b.certificates * b.window * (2 * signals + extra))


def _predict(p: PredictTable) -> Need:
    order, width, inputs = len(p.state), len(p.output), len(p.input)
    entries = (order + width) * (order + inputs)
    return Need(entries + order + inputs + width, entries)
