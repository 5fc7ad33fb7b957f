"""polynomial_tables.py FILE: filters of a quarter of a car on a cubic spring (campaign/polynomial_study.py, E2), as constants for programs that run on a processor."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from hullguard.campaign.polynomial_study import suspension
from hullguard.core.polynomial import FAR, Levels
from hullguard.design.polynomial import Tables, make

FILTERS = {"degree 1": (1, False), "degree 2": (2, False), "degree 2 bounded": (2, True), "degree 3": (3, False)}
LINE = 12


def array(kind: str, name: str, values: Iterable[float]) -> str:
    """A constant array."""
    real = kind == "hg_real"
    words = [f"HG_REAL_C({float(v)!r})" if real else f"{int(v)}U" for v in np.ravel(np.asarray(list(values)))]
    lines = [", ".join(words[i : i + LINE]) for i in range(0, len(words), LINE)]
    return f"static const {kind} {name}[] = {{\n    " + ",\n    ".join(lines or ["0U"]) + "};\n"


def one(prefix: str, tables: Tables) -> tuple[str, str]:
    """Its arrays, and its configuration as an initialiser."""
    plant, levels, c = tables.plant, Levels(), tables.sizes
    n, p = plant.states, plant.outputs
    kinds = {"start": "uint16_t", "product": "uint16_t"} | dict.fromkeys(("parent", "factor", "noise", "moment"), "uint8_t")
    values: dict[str, Iterable[float]] = {name: getattr(tables, name) for name in kinds}
    numbers = {"mean": tables.mean, "covariance": np.ravel(tables.covariance), "M0": np.ravel(tables.M0), "x0": plant.x0, "P0": np.ravel(np.diag(plant.P0))}
    numbers |= {"Q": [w.moment(2) for w in plant.w], "R": [v.moment(2) for v in plant.v], "range": [FAR] * p, "fresh": [levels.fresh] * p}
    if tables.bounded:
        kinds |= {"cut_moment": "uint8_t", "cut_state": "uint8_t"}
        values |= {"cut_moment": tables.cut_moment, "cut_state": tables.cut_state}
        numbers |= {"cut_scale": tables.cut_scale, "box": [FAR] * n}
    kinds |= dict.fromkeys(numbers, "hg_real")
    values |= numbers
    maps = ""
    for name in ("f", "h"):
        m = getattr(tables, name)
        for part, kind in (("end", "uint16_t"), ("coefficient", "hg_real"), ("factor", "uint8_t")):
            maps += array(kind, f"{prefix}_{name}_{part}", getattr(m, part))
    arrays = maps + "".join(array(kinds[name], f"{prefix}_{name}", value) for name, value in values.items())
    fields = [f".states = {n}U", f".outputs = {p}U", f".degree = {tables.degree}U", f".bounded = {str(tables.bounded).lower()}"]
    fields += [f".{name} = {size}U" for name, size in c.items()]
    fields += [f".{m} = {{{getattr(tables, m).width}U, {prefix}_{m}_end, {prefix}_{m}_coefficient, {prefix}_{m}_factor}}" for m in ("f", "h")]
    fields += [f".{name} = {prefix}_{name}" for name in kinds]
    fields += [f".{name} = HG_REAL_C({float(getattr(levels, name))!r})" for name in ("reach", "kappa", "joint", "weight", "drift")]
    return arrays, "{" + ", ".join(fields) + "}"


def main() -> None:
    """The header."""
    made = [make(suspension("exp"), degree, bounded) for degree, bounded in FILTERS.values()]
    parts = [one(f"e2_{i}", tables) for i, tables in enumerate(made)]
    text = "/* Made by tests/target/polynomial_tables.py; do not edit. */\n#ifndef POLYNOMIAL_TABLES_H\n#define POLYNOMIAL_TABLES_H\n\n"
    text += '#include "hullguard/polynomial.h"\n\n'
    text += f"#define E2_FILTERS {len(made)}U\n#define E2_REALS {max(t.reals for t in made)}U\n\n" + "".join(arrays for arrays, _ in parts)
    text += "static const hg_polynomial_config e2_filter[E2_FILTERS] = {\n    " + ",\n    ".join(config for _, config in parts) + "};\n\n#endif\n"
    Path(sys.argv[1]).write_text(text, encoding="ascii")


if __name__ == "__main__":
    main()
