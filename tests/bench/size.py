"""size.py PROGRAM..: flash, RAM and worst-case stack of the programs of tests/bench/size_*.c, BUILD/bench/TARGET-REAL/MODEL/PART.elf, and their budget.

Code and tables are what the linker has kept of library, model and the compiler's run-time functions; start-up code and the program around them
are not counted, but for its static variables, which are the model's storage. The stack is that of the deepest call of the library, without the
caller's own frame and without interrupts. Gaps that the linker leaves for alignment belong to nobody.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from counting import Section, rows, sections
from stack import StackError, compiled, deepest, run_time, symbols
from step_size import flash

COLUMNS = ("code", "tables", "ram", "stack")
LOWER_BY = 0.05  # a number that has fallen below its budget by this share, and by
LOWER_BYTES = 64  # this many bytes, asks for a lower budget
PROGRAM = "tests/bench/size_"
OUTSIDE = ("hal/start/start.o", "hal/cortex_m/", "hal/start/cortex_r5f.o", "hal/start/rv32.o", "hal/start/powerpc.o", "tests/bench/size_port.o")

Budget = dict[str, dict[str, dict[str, int]]]


@dataclass(frozen=True)
class Size:
    """Of one program; bytes."""

    target: str  # TARGET-REAL
    model: str
    part: str
    code: int
    tables: int
    ram: int
    stack: int
    deepest: tuple[str, ...]  # the calls that take the most stack
    step: int = 0  # of code and tables, what a step of the detector has (step_size.py); of a detector alone

    @property
    def name(self) -> str:
        """Its key in the target's budget."""
        return f"{self.model}-{self.part}"

    @property
    def numbers(self) -> dict[str, int]:
        """What is budgeted."""
        return {c: getattr(self, c) for c in COLUMNS} | ({"step": self.step} if self.step else {})


def kinds(placed: Sequence[Section]) -> tuple[int, int, int]:
    """Bytes of code, tables and RAM. What is initialised stands in RAM and in flash."""
    code = tables = ram = 0
    for s in placed:
        program = f"/size_{s.module.removeprefix('size_')}.o" in s.source and s.module.startswith("size_")
        if any(o in s.source for o in OUTSIDE):
            continue
        if s.name.startswith((".text", ".ARM.ex")):
            code += 0 if program else s.size
        elif s.name.startswith((".rodata", ".srodata", ".got")):
            tables += s.size
        elif s.name.startswith((".data", ".sdata")):
            tables += s.size
            ram += s.size
        elif s.name.startswith((".bss", ".sbss", "COMMON")):
            ram += s.size
        else:
            raise StackError(f"{s.source}: what is a section {s.name}?")
    return code, tables, ram


def stack(elf: Path, cross: str, part: str) -> tuple[int, tuple[str, ...]]:
    """The deepest of all calls that the program makes into the library."""
    sources = {Path(s.source).with_suffix(".ci") for s in sections(elf.with_suffix(".map"))}
    graph = compiled(file for file in sorted(sources) if file.exists())
    own = {name for name in graph if name == "main" or name.startswith(f"{PROGRAM}{part}.c:")}
    entries = {c for name in own for c in graph[name].calls} - own
    compiler = run_time(elf, cross, symbols(elf, cross))
    return max(deepest(e, graph, compiler) for e in sorted(entries) if not e.startswith("port_"))


def measure(elf: Path, cross: str) -> Size:
    """Everything of one program."""
    part = elf.stem
    try:
        code, tables, ram = kinds(sections(elf.with_suffix(".map")))
        depth, way = stack(elf, cross, part)
    except StackError as error:
        raise StackError(f"{elf}: {error}") from error
    return Size(elf.parents[1].name, elf.parent.name, part, code, tables, ram, depth, way, flash(elf, cross) if part == "detector" else 0)


def judged(sizes: Sequence[Size], budget: Budget) -> tuple[list[str], list[str]]:
    """A line for every number above its budget or without one; and one for each that is far below."""
    grown, shrunk = [], []
    for s in sizes:
        allowed = budget.get(s.target, {}).get(s.name)
        if allowed is None:
            grown.append(f"{s.target} {s.name}: has no budget; see it, then make size-budget")
            continue
        for column, is_ in s.numbers.items():
            may = allowed.get(column, 0)
            if is_ > may:
                grown.append(f"{s.target} {s.name}: {column} grew from {may} to {is_} bytes, by {is_ - may}")
            elif may - is_ > max(LOWER_BY * may, LOWER_BYTES):
                shrunk.append(f"{s.target} {s.name}: {column} fell from {may} to {is_} bytes: make size-budget")
    return grown, shrunk


def written(sizes: Sequence[Size], compilers: Mapping[str, str]) -> str:
    """The budget file that allows just these sizes."""
    lines = ["# Bytes that make size allows, by the compilers named: written by make size-budget.", "", "[compilers]"]
    lines += [f'{name} = "{version}"' for name, version in sorted(compilers.items())]
    for target in sorted({s.target for s in sizes}):
        lines += ["", f"[{target}]"]
        for s in (s for s in sizes if s.target == target):
            lines.append(f"{s.name} = {{ {', '.join(f'{c} = {n}' for c, n in s.numbers.items())} }}")
    return "\n".join(lines) + "\n"


def versions(crosses: Mapping[str, str]) -> dict[str, str]:
    """Full version of every compiler, by the prefix of its programs without the last hyphen."""
    ask = {cross: subprocess.run([f"{cross}gcc", "-dumpfullversion"], check=True, capture_output=True, text=True).stdout.strip() for cross in set(crosses.values())}
    return {cross.rstrip("-"): version for cross, version in ask.items()}


def table(sizes: Sequence[Size]) -> list[str]:
    """A row a program."""
    body = [(s.target, s.model, s.part, *(str(s.numbers[c]) for c in COLUMNS)) for s in sizes]
    return rows(("target", "model", "part", "code", "tables", "RAM", "stack"), body, 3, False)


def short(sizes: Sequence[Size], model: str) -> list[str]:
    """Markdown of one model: a row a target, a column a program."""
    mine = {(s.target, s.part): s for s in sizes if s.model == model}
    targets, programs = list(dict.fromkeys(t for t, _ in mine)), list(dict.fromkeys(p for _, p in mine))
    body = [(t, *(" / ".join(str(mine[t, p].numbers[c]) for c in COLUMNS) for p in programs)) for t in targets]
    return rows((f"{model}: code / tables / RAM / stack, bytes", *programs), body, 1, True)


def main() -> int:
    """Measure, print, judge."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--budget", type=Path, required=True)
    parser.add_argument("--cross", required=True, help="TARGET=PREFIX ..")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--quiet", action="store_true")
    parser.add_argument("--format", choices=("text", "markdown"), default="text")
    parser.add_argument("--model", default="", help="the one that markdown tells of")
    parser.add_argument("program", nargs="+", type=Path)
    args = parser.parse_args()
    crosses = dict(word.split("=") for word in args.cross.split())
    found = versions(crosses)
    try:
        sizes = [measure(elf, crosses[elf.parents[1].name.rsplit("-", 1)[0]]) for elf in args.program]
    except StackError as error:
        print(error, file=sys.stderr)
        return 1
    if args.write:
        args.budget.write_text(written(sizes, found), encoding="utf-8")
        print(f"{args.budget}: {len(sizes)} programs")
        return 0
    budget = tomllib.loads(args.budget.read_text(encoding="utf-8"))
    known = budget.pop("compilers")
    if args.json:
        print(json.dumps([asdict(s) for s in sizes]))
    elif not args.quiet:
        print("\n".join(short(sizes, args.model) if args.format == "markdown" else table(sizes)))
    if other := {name: version for name, version in found.items() if known.get(name) != version}:
        print(f"sizes are not judged: the budget is of {known}, and these are {other}", file=sys.stderr)
        return 0
    grown, shrunk = judged(sizes, budget)
    print("".join(f"{line}\n" for line in shrunk + grown), file=sys.stderr, end="")
    if not grown:
        print(f"  ok  sizes of {len(sizes)} programs are within {args.budget}", file=sys.stderr if args.json or args.format == "markdown" else sys.stdout)
    return 1 if grown else 0


if __name__ == "__main__":
    sys.exit(main())
