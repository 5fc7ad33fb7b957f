"""filters.py TARGET=CROSS=EMULATOR..: instructions retired by a sample of the polynomial filter, degree by degree, and of the fusion filter (tests/bench/filters.c)."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from counting import Call, CountError, count, rows

BENCH = Path("build/bench")
POLYNOMIAL = ("degree 1", "degree 2", "degree 2 bounded", "degree 3")  # in the order of tests/target/polynomial_tables.py
STEP = "hg_polynomial_step"


def polynomial(calls: Sequence[Call]) -> dict[str, list[int]]:
    """Instructions of each step of each filter; every one begins with a start of its own."""
    each: list[list[int]] = []
    for c in calls:
        if c.function.name == "hg_polynomial_start":
            each.append([])
        elif c.function.name == STEP:
            each[-1].append(c.all)
    return {f"polynomial, n = 2, p = 1, {name}": found for name, found in zip(POLYNOMIAL, each, strict=True)}


def fusion(calls: Sequence[Call]) -> dict[str, list[int]]:
    """Of each sample: open, what the sensors ask and send, close."""
    each: list[int] = []
    for c in (c for c in calls if c.function.name.startswith("hg_fusion_") and not c.function.name.endswith("_start")):
        if c.function.name == "hg_fusion_open":
            each.append(0)
        each[-1] += c.all
    return {"fusion, n = 4, m = 5, a node and its sensors' triggers": each}


def main() -> int:
    """One table: mean, and the most."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--format", choices=("text", "markdown"), default="text")
    parser.add_argument("target", nargs="+", help="TARGET=CROSS=EMULATOR")
    args = parser.parse_args()
    known = [t.split("=", 2) for t in args.target]
    figures: dict[str, list[str]] = {}
    try:
        for target, cross, emulator in known:
            calls = count(BENCH / f"{target}-f32" / "filters.elf", cross, emulator, BENCH / "count.so")[1]
            for name, each in (polynomial(calls) | fusion(calls)).items():
                figures.setdefault(name, []).append(f"{sum(each) / len(each):.0f} / {max(each)}")
    except CountError as error:
        print(error, file=sys.stderr)
        return 1
    print("\nInstructions a sample of the filters, numbers f32, mean / most; a quarter of the polynomial filter's values silent with a radius, a sixteenth missing.\n")
    print("\n".join(rows(["sample", *(t for t, _, _ in known)], [(name, *cells) for name, cells in figures.items()], 1, args.format == "markdown")))
    return 0


if __name__ == "__main__":
    sys.exit(main())
