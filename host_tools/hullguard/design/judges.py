"""What judges a plant in a detector, by name: for tables, pictures and files that have to say which residual is whose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hullguard.design.design import Design, used_banks
from hullguard.design.statistic import STATISTICS

OBSERVER, BANK, HYPOTHESIS, STATISTIC = "observer", "bank", "hypothesis", "statistic"
KINDS = (OBSERVER, BANK, HYPOTHESIS, STATISTIC)


@dataclass(frozen=True)
class Judge:
    """A residual generator; a bank for detection, or of the hypothesis that one fault is the cause; or a polynomial filter."""

    name: str  # observer 1, bank of 16, not controller1
    kind: str  # one of KINDS
    residuals: int  # columns that it has in a trace; a bank has one: its certificate with the largest |r| / J


def judges(design: Design) -> list[Judge]:
    """In the order of the decision, which is that of the residuals in a trace."""
    kinds = [(OBSERVER, len(g.output)) for g in design.tables.generators]
    kinds += [(BANK if b.hypothesis is None else HYPOTHESIS, 1) for b in used_banks(design.model, design.stored)]
    kinds += [(STATISTIC, len(STATISTICS))] * len(design.tables.polynomials)
    return [Judge(name, kind, count) for name, (kind, count) in zip(design.judges, kinds, strict=True)]


def residual_columns(every: Sequence[Judge]) -> list[str]:
    """Of each residual its place as J.I, judge and residual counted from 1: what its columns are called in a file."""
    return [f"{j + 1}.{i + 1}" for j, judge in enumerate(every) for i in range(judge.residuals)]


def residual_names(every: Sequence[Judge]) -> list[str]:
    """Of each residual the name for people: its judge's, with its number where that has several, or the statistic's."""
    own = {(judge.kind, i): name for judge in every if judge.kind == STATISTIC for i, name in enumerate(STATISTICS)}
    return [judge.name + (f", {own.get((judge.kind, i), f'r{i + 1}')}" if judge.residuals > 1 else "") for judge in every for i in range(judge.residuals)]
