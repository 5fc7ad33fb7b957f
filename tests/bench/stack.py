"""The longest way down the stack: frames and calls as the compiler tells them (-fcallgraph-info=su), for its own run-time functions the disassembly.

A bound from above for one flow of control: interrupts come on top. What cannot be bounded is refused: recursion, frames of no fixed size, calls by
pointer whose targets are not named in TARGETS, functions that nobody knows.
"""

from __future__ import annotations

import re
import subprocess
from bisect import bisect_right
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

INDIRECT = "__indirect_call"
TARGETS: Mapping[str, tuple[str, ...]] = {}  # who calls by pointer, and whom: nobody in the library

_NODE = re.compile(r'^node: \{ title: "([^"]+)"')
_FRAME = re.compile(r"\\n(\d+) bytes \((\w+)")
_EDGE = re.compile(r'^edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')
_HEAD = re.compile(r"^([0-9a-f]+) <([^>]+)>:$")
_CODE = re.compile(r"^\s*[0-9a-f]+:\t(\S+)\s*(.*)$")
_REMARK = re.compile(r"\s+[@;#]\s.*$|\s*<.*$")
_TARGET = re.compile(r"(?:^|[\s,])([0-9a-f]+)\s+<[^>]+>$")
# What moves the stack pointer down, by processor: a list of registers, or a number of bytes.
_LISTS = re.compile(r"^(?:push(?:\.w)?|stmdb|stmfd|vpush|vstmdb)$")
_RANGE = re.compile(r"([rsd])(\d+)(?:-[rsd](\d+))?|\b(lr|ip|fp|sl|sb|sp|pc)\b")
_BYTES = re.compile(r"^(?:sub(?:\.w|w|s)?\s+sp,(?:\s*sp,)?\s*#(\d+)|addi?\s+sp,sp,-(\d+)|str\s+\w+, \[sp, #-(\d+)\]!|c\.addi16sp\s+sp,-(\d+)|stwu\s+r1,-(\d+)\(r1\))")
_CALLED = re.compile(r"^(?:bl?x?|b[a-z]{2}|bl[a-z]{2})(?:\.[nw])?$|^(?:jal|j|call|tail)$")
_LINKED = re.compile(r"^(?:blx?(?:\.[nw])?|jal|call)$")
_POINTER = re.compile(r"^(?:blx\s+r|blx\s+ip|jalr\s|c\.jalr|bctrl|blrl)")


class StackError(Exception):
    """A depth that cannot be bounded."""


@dataclass
class Node:
    """A function."""

    bytes: int | None = None  # None: unknown
    kind: str = ""
    calls: set[str] = field(default_factory=set)


def compiled(files: Iterable[Path]) -> dict[str, Node]:
    """Functions as the compiler describes them, a file an object. Those that are static are called SOURCE:NAME."""
    made: dict[str, Node] = {}
    for file in files:
        for line in file.read_text(encoding="utf-8").splitlines():
            if m := _NODE.match(line):
                node = made.setdefault(m[1], Node())
                if frame := _FRAME.search(line):
                    node.bytes, node.kind = int(frame[1]), frame[2]
            elif m := _EDGE.match(line):
                made.setdefault(m[1], Node()).calls.add(m[2])
    return made


def registers(operands: str) -> int:
    """Bytes of a list of ARM registers."""
    total = 0
    for m in _RANGE.finditer(operands[operands.index("{") :]):
        first = int(m[2] or 0)
        total += (8 if m[1] == "d" else 4) * (int(m[3] or first) - first + 1)
    return total


def lowered(code: str, operands: str) -> int:
    """By how many bytes an instruction moves the stack pointer down."""
    if _LISTS.match(code) and "{" in operands and (code.startswith(("push", "vpush")) or operands.startswith("sp!")):
        return registers(operands)
    m = _BYTES.match(f"{code} {operands}")
    return int(next(filter(None, m.groups()))) if m else 0


def ends(code: str, operands: str) -> bool:
    """Whether nothing follows an instruction."""
    return code in {"b", "b.n", "b.w", "bx", "ret", "j", "jr", "blr", "tail"} or (code.startswith(("pop", "ldm", "ldr")) and "pc" in operands)


def disassembled(listing: str, at: Mapping[int, str]) -> dict[str, Node]:
    """Functions as a disassembler lists them, by their name `at` an address. Each frame is the sum of all that moves the stack pointer down,
    whichever way is taken."""
    begins = sorted(at)
    made: dict[str, Node] = {}
    name, ended = "", True
    for line in listing.splitlines():
        if m := _HEAD.match(line):
            before, name = name, at.get(int(m[1], 16), m[2])
            if not ended:
                made[before].calls.add(name)  # runs on into the next one
            made[name], ended = Node(0), True
        elif name and (m := _CODE.match(line)):
            code, operands, target = m[1], _REMARK.sub("", m[2]), _TARGET.search(m[2])
            node = made[name]
            node.bytes = (node.bytes or 0) + lowered(code, operands)
            ended = ended if code.startswith((".", "nop")) else ends(code, operands)
            if _CALLED.match(code) and target:
                address = int(target[1], 16)
                callee = at[begins[bisect_right(begins, address) - 1]]
                recurs = address in at and _LINKED.match(code) is not None  # Thumb-1 has no other long jump than bl
                node.calls |= {callee} if callee != name or recurs else set()
            if _POINTER.match(f"{code} {operands}"):
                node.calls.add(INDIRECT)
    return made


def symbols(elf: Path, cross: str) -> dict[str, int]:
    """Addresses of all functions of a program, under all their names."""
    out = subprocess.run([f"{cross}nm", str(elf)], check=True, capture_output=True, text=True).stdout
    return {w[2]: int(w[0], 16) & ~1 for w in map(str.split, out.splitlines()) if len(w) == 3 and w[1] in "TtWw"}


def run_time(elf: Path, cross: str, names: Mapping[str, int]) -> dict[str, Node]:
    """The functions of a program by disassembly, under each of their names."""
    listing = subprocess.run([f"{cross}objdump", "-d", "--no-show-raw-insn", str(elf)], check=True, capture_output=True, text=True).stdout
    at = {address: name for name, address in names.items()}
    made = disassembled(listing, at)
    return {name: made[at[address]] for name, address in names.items() if at[address] in made}


def deepest(entry: str, graph: Mapping[str, Node], fallback: Mapping[str, Node]) -> tuple[int, tuple[str, ...]]:
    """Bytes of stack that a call of a function takes at most, and the functions on the way there."""
    open_: list[str] = []

    @cache
    def below(name: str) -> tuple[int, tuple[str, ...]]:
        node = graph.get(name)
        if node is None or node.bytes is None:
            node = fallback.get(name)
        if node is None or node.bytes is None:
            raise StackError(f"nothing is known of {name}, called by {open_[-1] if open_ else 'nobody'}")
        if node.kind.startswith("dynamic"):
            raise StackError(f"the frame of {name} has no fixed size")
        if name in open_:
            raise StackError(f"{name} calls itself, by {' > '.join(open_[open_.index(name) :])}")
        callees = set(node.calls)
        if INDIRECT in callees:
            if name not in TARGETS:
                raise StackError(f"{name} calls by pointer, and TARGETS does not say whom")
            callees = (callees - {INDIRECT}) | set(TARGETS[name])
        open_.append(name)
        longest = max((below(c) for c in sorted(callees)), default=(0, ()))
        open_.pop()
        return node.bytes + longest[0], (name, *longest[1])

    return below(entry)
