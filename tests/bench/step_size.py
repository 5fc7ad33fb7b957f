"""step_size.py PROGRAM: what the flash of a detector's step is spent on, function by function and table by table.

The step is all that can be called from hg_detector_step(), and every table of the model but those that only a start, a frame or the program itself reads.
PROGRAM is one of tests/bench/size_detector.c; CROSS in the environment is that of the target's toolchain file.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from counting import STEP, functions, rows, sections
from stack import run_time, symbols

# Read when a frame comes (codes, thresholds, levels) or at the start only, by the end of their names.
NOT_OF_THE_STEP = ("_scale", "_middle", "_silence", "_delta", "_sigma", "_activity", "_zero")
PROGRAM = ("memory",)  # of tests/bench/size_detector.c itself


def code(elf: Path, cross: str) -> dict[str, int]:
    """Bytes of every function that a step can call."""
    calls = run_time(elf, cross, symbols(elf, cross))
    found, open_ = set(), [STEP]
    while open_:
        name = open_.pop()
        if name not in found:
            found.add(name)
            open_ += sorted(calls[name].calls)
    return {f.name: f.end - f.begin for f in functions(elf, cross) if f.name in found}


def tables(elf: Path) -> dict[str, int]:
    """Bytes of every table that a step can read."""
    own = [s for s in sections(elf.with_suffix(".map")) if "/size_detector.o" in s.source and s.name.startswith((".rodata.", ".srodata."))]
    named = {s.name.split(".", 2)[2]: s.size for s in own}
    in_order = "#define HG_ONLY_IN_ORDER 1U" in _config(elf)
    left_out = (*NOT_OF_THE_STEP, *(("_signal",) if in_order else ()))
    return {name: size for name, size in named.items() if name not in PROGRAM and not name.endswith(left_out)}


def _config(elf: Path) -> str:
    """Text of the NAME_config.h that a program is built with."""
    return Path(f"firmware/models/{elf.parent.name}_config.h").read_text(encoding="ascii")


def flash(elf: Path, cross: str) -> int:
    """Bytes of both."""
    return sum(code(elf, cross).values()) + sum(tables(elf).values())


def main() -> None:
    """A line each, the largest first."""
    elf, cross = Path(sys.argv[1]), os.environ["CROSS"]
    whole = 0
    for what, sizes in (("function", code(elf, cross)), ("table", tables(elf))):
        body = [(name, str(size)) for name, size in sorted(sizes.items(), key=lambda s: -s[1])]
        print("\n".join(rows((what, "bytes"), [*body, ("together", str(sum(sizes.values())))], 1, False)), end="\n\n")
        whole += sum(sizes.values())
    print(f"{elf.parents[1].name} {elf.parent.name}: a step has {whole} bytes of flash")


if __name__ == "__main__":
    main()
