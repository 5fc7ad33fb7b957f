"""The banks of a model: learnt from simulated faults of the plant and the senders that the design already has; platoon, section 7."""

from __future__ import annotations

from dataclasses import replace

from hullguard.design.bank import BankSpec, make_bank
from hullguard.design.bank_types import StoredBank
from hullguard.design.design import Tick, finish, used_banks
from hullguard.design.isolation import isolation_banks
from hullguard.design.store import Stored
from hullguard.errors import InputError
from hullguard.model.detector import BankSpec as Wish
from hullguard.model.schema import Model, Reference

REST = Reference("rest", 0.0, 1)
PERIOD_S = 6.0  # of manoeuvres


def learnt(model: Model, stored: Stored, workers: int, tick: Tick) -> Stored:
    """The stored numbers with every bank that the model asks for; the same object when none was missing."""
    spec, missing = model.detector, model
    used = used_banks(model, stored)
    whole = spec.bank is None or any(b.hypothesis is None and len(b.weight) >= spec.bank.size for b in used)
    told = spec.isolation is None or any(b.hypothesis is not None for b in used)
    if whole and told:
        return stored
    if not model.faults:
        raise InputError(f"{model.path.name}: a bank is made for faults, and the model has none: add [[faults]]")
    # The node that the training runs through has no banks yet.
    plain = replace(missing, detector=replace(spec, bank=None, isolation=None))
    design = finish(plain, replace(stored, banks=()))
    kept = list(stored.banks)
    if spec.bank is not None and not whole:
        kept = [b for b in kept if b.hypothesis is not None] + [make_bank(design, training(model, spec.bank), workers, tick)]
    if spec.isolation is not None and not told:
        kept = [b for b in kept if b.hypothesis is None] + isolation_banks(design, training(model, spec.isolation), workers, tick)
    return replace(stored, banks=tuple(sorted(kept, key=_order)))


def _order(bank: StoredBank) -> int:
    return -1 if bank.hypothesis is None else bank.hypothesis


def training(model: Model, wish: Wish) -> BankSpec:
    """At rest, and under manoeuvres where something drives the plant."""
    references = [REST]
    if model.plant.feedback is not None and model.plant.feedback.reference_bound.any():
        references.append(Reference("mixed", float(model.plant.feedback.reference_bound.max()), max(2, round(PERIOD_S / model.sample_time_s))))
    chosen = tuple(i for i, f in enumerate(model.faults) if not wish.faults or f.name in wish.faults)
    return BankSpec(wish.window, wish.size, chosen, tuple(references), wish.sizes, wish.runs, wish.seed)
