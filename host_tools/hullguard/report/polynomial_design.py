"""Polynomial filters in a design report: what the expansion leaves out, sizes, cost, levels, and what other degrees would take."""

from __future__ import annotations

import math
from collections.abc import Iterator

from hullguard.design.design import Design
from hullguard.design.polynomial import DEGREE_MAX, Noise, reals
from hullguard.report.page import esc, num, table

INTRO = (
    "Statistical: an alarm of such a filter means that a healthy plant would hardly have shown this, not that it could not. The bounds of the false alarms a sample are "
    "Chebyshev's: they hold for any noise with these moments, and are far from what the declared noise does."
)


def section(design: Design) -> Iterator[str]:
    """Nothing for a model without them."""
    plant = design.model.plant.nonlinear
    if plant is None:
        return
    model = design.model
    yield "<h2>Polynomial filters</h2>"
    yield f"<p>{esc(INTRO)}</p>"
    rows = [["state", name, len(e.terms), num(b), num(e.remainder), _noise(w)] for name, e, b, w in zip(model.plant.states, plant.of_f, plant.box, plant.w, strict=True)]
    rows += [["output", model.signals[i].name, len(e.terms), "", num(e.remainder), _noise(v)] for i, e, v in zip(model.outputs, plant.of_h, plant.v, strict=True)]
    yield table(
        ["", "name", "#terms", "#box ±", "#remainder", "noise"],
        rows,
        f"Taylor polynomials of degree {plant.degree} about the operating point. "
        "Remainder: largest error on the box, bounded by intervals; 0 where the polynomial is the function.",
    )
    names = design.judges[-len(design.tables.polynomials) :]
    rows = []
    for name, p in zip(names, design.tables.polynomials, strict=True):
        plain, joint = min(1.0, 1.0 / p.kappa**2), min(1.0, p.judged / p.joint)
        rows.append([name, p.lifted, 4 * p.reals, num(p.kappa), num(plain), num(math.sqrt(p.joint)), num(joint), num(math.sqrt(p.drift)), f"{p.settle}"])
    yield table(
        ["filter", "#lifted states", "#RAM (bytes)", "#kappa", "#P of plain", "#level of J2", "#P of J2", "#level of drift", "#settles (samples)"],
        rows,
        "RAM in single precision. P: bound of the false alarms a sample by Chebyshev, whatever the noise.",
    )
    yield table(
        ["#filter", "#degree", "#RAM (bytes)", "#bounded (bytes)"],
        [
            [f"{i + 1}", f"{d}", *(_bytes(model.plant.n, len(spec.outputs), d, bounded) for bounded in (False, True))]
            for i, spec in enumerate(model.polynomials)
            for d in range(1, DEGREE_MAX + 1)
        ],
        "What each degree takes, in single precision.",
    )


def _bytes(states: int, outputs: int, degree: int, bounded: bool) -> str:
    found = reals(states, outputs, degree, bounded)
    return "too large" if found is None else f"{4 * (found + 2 * outputs)}"


def _noise(noise: Noise) -> str:
    deviation = math.sqrt(noise.moment(2))
    if deviation == 0.0:
        return "none"
    return f"{noise.kind}, deviation {num(deviation)}, skewness {num(noise.moment(3) / deviation**3)}" if noise.kind != "student" else f"Student's t, deviation {num(deviation)}"
