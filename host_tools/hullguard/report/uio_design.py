"""Unknown-input observers in a design report: poles, radii of all estimates, which sensors will do and why others will not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hullguard.design import uio_sensors
from hullguard.design.design import Design
from hullguard.design.uio_generator import UioDesign
from hullguard.report.page import esc, num, table


def section(design: Design) -> Iterator[str]:
    """Nothing for a model without them."""
    if not design.uios:
        return
    yield "<h2>Unknown-input observers</h2>"
    known = design.model.plant.unknown
    assert known is not None
    bounds = ", ".join(f"|{n}| ≤ {num(float(b))}, changing by at most {num(float(r))} a second" for n, b, r in zip(known.names, known.bound, known.rate, strict=True))
    yield (
        f"<p>Promised of what nobody measures: {esc(bounds)}. Estimates are low-passed but for the states; a radius bounds the distance from what they stand for, in the "
        "long run at the usual radii of the signals.</p>"
    )
    rows = [row for i, u in enumerate(design.uios) for row in _estimates(i, u)]
    yield table(["#observer", "estimate", "#radius", "#of it no signal's radius", "#of it rounding", "#step that is found"], rows, "Estimates")
    yield table(["#observer", "poles a second", "fixed ones"], [_poles(design, i) for i in range(len(design.uios))], "Poles")
    sets = [
        [i + 1, ", ".join(s.outputs), ", ".join(s.unknown), "yes" if s.why_not is None else "no", s.why_not or f"{s.free} free poles" + _fixed(s.fixed)]
        for i, every in enumerate(uio_sensors.sensor_sets(design.model))
        for s in every
    ]
    yield table(["#observer", "sensors", "to be estimated", "works", "why"], sets, "Sensors that will do, and why others will not")
    words = uio_sensors.component_words(design.model)
    if words:
        yield table(["part", "when it is weaker"], list(words.items()), "Parts of the plant")


def _estimates(i: int, u: UioDesign) -> Iterator[list[object]]:
    t = u.tables
    for j, name in enumerate(u.names):
        found = num(float(u.smallest[j])) if j < len(u.smallest) else "–"
        yield [i + 1, name, num(float(t.steady[j])), num(float(t.bias[j])), num(float(t.rounding[j])), found]


def _poles(design: Design, i: int) -> list[object]:
    u, period = design.uios[i], design.model.sample_time_s
    values = np.linalg.eigvals(u.linear.state)
    rates = sorted(
        {f"{z.real:.3g}" + (f" ± {abs(z.imag):.3g}i" if abs(z.imag) > 1e-6 else "") for z in np.log(values[np.abs(values) > 1e-12].astype(complex)) / period},
        key=lambda s: float(s.split()[0]),
    )
    fixed = design.stored.uios[i].fixed
    return [i + 1, ", ".join(rates), ", ".join(f"{z.real:.6g}" for z in fixed) or "none"]


def _fixed(values: Sequence[complex]) -> str:
    return f", fixed {', '.join(f'{z.real:.6g}' for z in values)}" if values else ""
