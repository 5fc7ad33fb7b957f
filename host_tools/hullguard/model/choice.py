"""What a model chooses of a generator itself instead of leaving it to the search: order, parity vector, poles; platoon, section 2."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hullguard.model.table import Table

if TYPE_CHECKING:
    from hullguard.model.schema import Search

ORDER_MAX = 40
CONJUGATE = 1e-9  # how far a pole may be from the conjugate of another


def read_orders(t: Table, search: Search) -> tuple[int, int]:
    """Smallest and largest order: order = 4, or order = [3, 6] for a search over a range."""
    if not isinstance(t.raw("order"), list):
        order = t.whole("order", 1, ORDER_MAX)
        return order, order
    pair = t.vector("order", 2)
    if not (np.all(pair == np.round(pair)) and 1 <= pair[0] <= pair[1] <= ORDER_MAX):
        raise t.error("order", f"expected an order, or [smallest, largest], within 1 .. {ORDER_MAX}")
    if search.objective == "between events":
        raise t.error("order", 'objective = "between events" computes one order; give one')
    return int(pair[0]), int(pair[1])


def read_parity(t: Table, least: int, most: int, outputs: int, search: Search) -> tuple[tuple[float, ...], ...] | None:
    """A chosen parity vector, parity = [[..], ..]: order + 1 rows v0 .. vs, a column an output."""
    if "parity" not in t:
        return None
    if search.objective == "between events":
        raise t.error("parity", 'objective = "between events" computes it; remove one of them')
    v = t.matrix("parity")
    if least != most or v.shape != (least + 1, outputs):
        raise t.error("parity", f"{v.shape[0]} x {v.shape[1]} numbers: expected order + 1 rows and a column for each of {outputs} outputs; give order = {v.shape[0] - 1}")
    if not v.any():
        raise t.error("parity", "all numbers are 0; give a vector of the left null space of [C; CA; ..]")
    return tuple(tuple(float(x) for x in row) for row in v)


def read_poles(t: Table, least: int, most: int, search: Search) -> tuple[complex, ...] | None:
    """Chosen poles, poles = "deadbeat", or a list of numbers and [re, im] pairs, every complex one with its conjugate."""
    if "poles" not in t:
        return None
    if search.objective == "between events":
        raise t.error("poles", 'objective = "between events" sets them to 0; remove one of them')
    value = t.raw("poles")
    if value == "deadbeat":
        return (0j,) * most
    if not isinstance(value, list):
        raise t.error("poles", 'expected a list of numbers and [re, im] pairs, or "deadbeat"')
    parts = Table({str(i): [p, 0.0] if isinstance(p, (int, float)) else p for i, p in enumerate(value)}, f"{t.where}.poles")
    poles = [complex(*parts.vector(str(i), 2)) for i in range(len(value))]
    if least != most or len(poles) != least:
        raise t.error("poles", f"{len(poles)} poles: as many as the order are needed")
    for p in poles:
        if abs(p) >= 1.0:
            raise t.error("poles", f"{p:g} has magnitude {abs(p):g}; poles must be inside the unit circle")
        if sum(abs(q - p.conjugate()) <= CONJUGATE for q in poles) != sum(abs(q - p) <= CONJUGATE for q in poles):
            raise t.error("poles", f"{p:g} comes without its conjugate; add [{p.real:g}, {-p.imag:g}]")
    return tuple(poles)
