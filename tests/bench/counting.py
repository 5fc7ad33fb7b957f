"""Calls of a program's functions and the instructions of each, exactly, as tests/bench/count.c counts them under QEMU."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

TIMEOUT_S = 300.0
LIBRARY = "firmware/src/"
STEP = "hg_detector_step"
REWIND = ("hg_hold_past", "hg_hold_rewrite")
HELPERS = ("linalg", "ring", "code", "trigger")  # modules that count for the part that calls them
_SECTION = re.compile(r"^ (\S+)?\s+0x([0-9a-f]+)\s+0x([0-9a-f]+)\s+(\S+\.o\)?)$")
_SYMBOL = re.compile(r"^\s*\d+: ([0-9a-f]+)\s+(\d+|0x[0-9a-f]+) FUNC\s+\S+\s+\S+\s+\S+\s+(\S+)")


class CountError(Exception):
    """A program that did not run, or not as it should."""


@dataclass(frozen=True)
class Section:
    """A piece of an object file in a linked program."""

    name: str
    begin: int
    size: int
    source: str  # path of the object file, or ARCHIVE(MEMBER)

    @property
    def module(self) -> str:
        """Name of the object file without folder and suffix."""
        return re.sub(r"^.*\(|\)$", "", self.source).rsplit("/", 1)[-1].removesuffix(".o")


@dataclass(frozen=True)
class Function:
    """A function in a linked program. Static functions of two modules may have the same name."""

    name: str
    begin: int
    end: int
    section: Section


@dataclass
class Call:
    """One call of a function that is counted."""

    function: Function
    all: int  # instructions, those of callees too
    self: int  # without those of counted callees
    calls: list[Call] = field(default_factory=list)

    def walk(self) -> Iterator[Call]:
        """It and all within."""
        yield self
        for c in self.calls:
            yield from c.walk()

    def has(self, *names: str) -> bool:
        """Whether a function of one of these names has been called within."""
        return any(c.function.name in names for c in self.walk())


def sections(linker_map: Path) -> list[Section]:
    """What a linker's map says has become part of the program, by address."""
    text = linker_map.read_text(encoding="utf-8").split("Linker script and memory map", 1)[1]
    text = re.sub(r"^ (\S+)\n\s+(?=0x)", r" \1 ", text, flags=re.MULTILINE)  # a long name stands on a line of its own
    found = (_SECTION.match(line) for line in text.splitlines())
    made = [Section(m[1] or "", int(m[2], 16), int(m[3], 16), m[4]) for m in found if m and int(m[3], 16) > 0]
    return sorted((s for s in made if not s.name.startswith((".debug", ".comment", ".note")) and not s.name.endswith(".attributes")), key=lambda s: s.begin)


def functions(elf: Path, cross: str) -> list[Function]:
    """Every function of a program, by address. Of two names for one place the longer-lived one, the global, stays."""
    out = subprocess.run([f"{cross}readelf", "-sW", str(elf)], check=True, capture_output=True, text=True).stdout
    placed = sections(elf.with_suffix(".map"))
    begins = [s.begin for s in placed]
    found: dict[int, Function] = {}
    for m in filter(None, map(_SYMBOL.match, out.splitlines())):
        begin, size = int(m[1], 16) & ~1, int(m[2], 0)  # bit 0 is Thumb's mark
        section = placed[bisect_right(begins, begin) - 1]
        found[begin] = Function(m[3], begin, begin + size if size > 0 else section.begin + section.size, section)
    return [found[b] for b in sorted(found)]


def of_library(function: Function) -> bool:
    """Whether a function is the library's."""
    return LIBRARY in function.section.source


def count(elf: Path, cross: str, emulator: str, plugin: Path, counted: Callable[[Function], bool] = of_library) -> tuple[str, list[Call]]:
    """Run a program to its end; what it printed, and the outermost calls of the functions that are counted, the library's."""
    listed = functions(elf, cross)
    names, calls = elf.with_suffix(".functions"), elf.with_suffix(".calls")
    names.write_text("".join(f"{f.begin:x} {f.end:x} {int(counted(f))}\n" for f in listed), encoding="utf-8")
    calls.unlink(missing_ok=True)
    machine = shlex.split(emulator)
    command = [machine[0], "-plugin", f"{plugin.resolve()},functions={names},calls={calls}", *machine[1:], str(elf)]
    try:
        ran = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=TIMEOUT_S, env={**os.environ, "QEMU_AUDIO_DRV": "none"}, check=False)
    except subprocess.TimeoutExpired as late:
        raise CountError(f"{elf} did not end within {TIMEOUT_S:g} s") from late
    if ran.returncode != 0 or not calls.exists():
        raise CountError(f"{elf} ended with status {ran.returncode}: {ran.stdout.strip()} {ran.stderr.strip()}")
    return ran.stdout, tree(calls.read_text(encoding="utf-8").splitlines(), listed)


def tree(lines: list[str], listed: list[Function]) -> list[Call]:
    """Calls are listed in the order in which they end, with their depth: those that wait one level below are a call's own."""
    waiting: list[list[Call]] = [[]]
    for line in lines:
        index, depth, with_callees, without = (int(word) for word in line.split())
        while len(waiting) <= depth + 1:
            waiting.append([])
        waiting[depth].append(Call(listed[index], with_callees, without, waiting[depth + 1]))
        waiting[depth + 1] = []
    return waiting[0]


def found(calls: Sequence[Call], name: str) -> list[Call]:
    """Every call of a function, in no more than the order in which they began within one outermost call."""
    return [c for outer in calls for c in outer.walk() if c.function.name == name]


def parts(call: Call, part: str = "") -> Counter[str]:
    """Instructions of a call by the module they are spent for."""
    module = call.function.section.module
    mine = part if module in HELPERS and part else module
    spent = Counter({mine: call.self})
    for c in call.calls:
        spent += parts(c, mine)
    return spent


def rows(head: Sequence[str], body: Sequence[Sequence[str]], left: int, markdown: bool) -> list[str]:
    """Lines of a table whose first `left` columns hold words and the others numbers."""
    if markdown:
        rule = ["---" if i < left else "--:" for i in range(len(head))]
        return ["| " + " | ".join(r) + " |" for r in (head, rule, *body)]
    widths = [max(len(r[i]) for r in (head, *body)) for i in range(len(head))]
    return ["  ".join(w.ljust(n) if i < left else w.rjust(n) for i, (w, n) in enumerate(zip(r, widths, strict=True))).rstrip() for r in (head, *body)]
