"""A design as the text file that oracle_run reads: the plant, the triggers, and observer and post-filter as two systems.

    python tests/oracle/export.py MODEL FILE
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from hullguard.design.design import Design, design
from hullguard.model import load_model


def blocks(made: Design, rest: bool) -> list[tuple[str, Any]]:
    """(name, matrix) in the order of the file."""
    model, tables, plant = made.model, made.tables, made.model.plant
    out: list[tuple[str, Any]] = [(f"plant.{n}", getattr(plant, n)) for n in ("A", "B", "C", "D", "Ed", "Fd")]
    initial = np.abs(plant.equilibrium) + plant.initial_range
    out += [("initial_range", initial[:, None]), ("state_range", made.stored.state_range[:, None]), ("start", [[int(rest)]])]
    out += [("outputs", [model.outputs]), ("inputs", [model.inputs]), ("groups", [[len(tables.groups)]])]
    for i, g in enumerate(tables.groups):
        name = f"group{i}."
        out += [(name + "first", [[g.first]]), (name + "width", [[len(g.signals)]]), (name + "levels", [[g.levels]])]
        out += [(name + "interval_max", [[g.interval_max]]), (name + "margin", [[g.margin]]), (name + "silence", [list(g.silence)])]
        out += [(name + n, getattr(g, n)) for n in ("delta", "sigma", "activity")]
        out += [(name + n, [[getattr(s, n) for s in g.signals]]) for n in ("zero", "resolution", "offset", "minimum", "maximum", "half", "span", "middle")]
        out.append((name + "slew", g.slew))
    out.append(("generators", [[len(made.generators)]]))
    for i, (g, t) in enumerate(zip(made.generators, tables.generators, strict=True)):
        name = f"gen{i}."
        out += [(name + n, getattr(g.observer, n)) for n in ("G", "H", "L", "W", "V", "Qu")]
        out += [(name + "Lo", g.filter.Lo), (name + "Mo", g.filter.Mo), (name + "outputs", [list(g.spec.outputs)]), (name + "inputs", [list(g.spec.inputs)])]
        out += [(name + n, getattr(g.plant, n)) for n in ("A", "B", "C", "D", "Ed", "Fd")]
        out += [(name + "initial", initial[:, None]), (name + "range", made.stored.state_range[:, None]), (name + "feeds", [[t.feeds]])]
        out += [(name + "ready_rest", [[t.ready_rest]]), (name + "ready_moving", [[t.ready_moving]])]
    return [*out, ("decision.up", [[tables.up]]), ("decision.down", [[tables.down]]), ("decision.latch", [[int(tables.latch)]])]


def export(made: Design, path: Path, rest: bool = True) -> None:
    """Write the file."""
    lines = []
    for name, value in blocks(made, rest):
        rows = [list(r) for r in value]
        lines.append(f"{name} {len(rows)} {len(rows[0]) if rows else 0}")
        lines += [" ".join(f"{float(x):.17g}" for x in r) for r in rows]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


if __name__ == "__main__":
    export(design(load_model(sys.argv[1]))[0], Path(sys.argv[2]))
