"""What the banks of a design can do, from their tables and the radii that signals usually have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hullguard.design.bank import BankSpec
from hullguard.design.bank_types import BankTable, StoredBank
from hullguard.design.cost import Cost, bank_cost
from hullguard.design.design import Design, used_banks
from hullguard.design.isolation import hypotheses
from hullguard.design.learn import training
from hullguard.design.window import WindowForm, fault_response, window_form
from hullguard.model.schema import Fault, Model
from hullguard.model.table import Array

SOON = (10, 20)  # samples within which a fault should show; the window is the third


@dataclass(frozen=True)
class BankFacts:
    """One bank."""

    name: str  # among the judges
    stored: StoredBank
    table: BankTable
    learnt: BankSpec  # from which runs
    faults: tuple[int, ...]  # that move a certificate
    within: tuple[int, ...]  # samples
    smallest: Array  # faults x within: size of a constant fault whose residual has reached the threshold at usual radii; inf where none does
    cost: Cost

    @property
    def runs(self) -> int:
        """Runs that it learnt from, those without a limit among them."""
        s = self.learnt
        return len(s.faults) * len(s.sizes) * 2 * len(s.references) * s.runs


def bank_facts(design: Design) -> list[BankFacts]:
    """Every bank of a design, in the order of the decision."""
    model, made = design.model, []
    names = design.judges[len(design.generators) : len(design.generators) + len(design.tables.banks)]
    for name, stored, table in zip(names, used_banks(model, design.stored), design.tables.banks, strict=True):
        faults = tuple(i for i in range(len(model.faults)) if stored.faults >> i & 1)
        form = window_form(model.plant, table.window)
        within = tuple(dict.fromkeys(min(w, table.window - 1) for w in (*SOON, table.window)))
        smallest = np.array([_smallest(model, form, table, design.usual, model.faults[i], within) for i in faults]).reshape(len(faults), len(within))
        made.append(BankFacts(name, stored, table, _learnt(model, stored), faults, within, smallest, bank_cost(name, table)))
    return made


def _learnt(model: Model, stored: StoredBank) -> BankSpec:
    """The training of a bank that the model asks for."""
    wish = model.detector.bank if stored.hypothesis is None else model.detector.isolation
    assert wish is not None
    spec = training(model, wish)
    return spec if stored.hypothesis is None else next(s for s in hypotheses(model, spec) if s.hypothesis == stored.hypothesis)


def usual_thresholds(table: BankTable, usual: Array) -> Array:
    """J of every certificate at usual radii; certificates."""
    J = np.array(table.bias) + table.widen * np.einsum("jsc,s->c", np.abs(np.array(table.weight)), usual[list(table.signal)])
    return np.asarray(J + np.einsum("jec,e->c", np.array(table.extra_weight), usual[list(table.extra)]) if table.extra else J)


def _smallest(model: Model, form: WindowForm, table: BankTable, usual: Array, fault: Fault, within: tuple[int, ...]) -> list[float]:
    """For each number of samples the least size of a constant fault that moves some certificate as far as its threshold is large until then."""
    weight = np.array(table.weight)[::-1, model.outputs].reshape(-1, table.certificates)  # (window outputs) x certificates, the oldest first
    response = (fault_response(model, form, fault).T @ weight)[::-1]  # newest sample of the fault first
    reached = np.abs(np.cumsum(response, axis=0)) / usual_thresholds(table, usual)
    best = np.maximum.accumulate(reached.max(1))
    return [1.0 / float(best[w]) if best[w] > 1e-9 else np.inf for w in within]
