"""flips.py MODEL PROGRAM WORK: single bits of a detector node's memory flipped between any two of its calls, counted by what becomes of each.

The run: the model's own plant, events, a lost frame, an overdue closing frame, a fault. The program is tests/flips/flips.c built for the model. Pointers are left out:
a wrong one is a wild access, which is a matter of memory protection. Fails when a member's flips do more lasting harm that nothing shows than
known.json allows, or when the program breaks off (sanitizers).
"""

from __future__ import annotations

import argparse
import json
import re
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import cffi

from hullguard.core.library import library
from hullguard.core.native import Native, Plant, Sender
from hullguard.design.design import design
from hullguard.model import load_model

ROOT = Path(__file__).parents[2]
SAMPLES, FAULT_AT, LOST_AT, OVERDUE_AT = 110, 46, 40, 43
FIRST, LAST = 38, 50  # samples in which flips are made: silence, a loss, a missing tick, the begin of the fault
BOUND = 40  # samples after which nothing that a flip did unseen may be left
KINDS = ("harmless", "detected", "recovered", "false alarm", "suppressed", "other")


def operations(name: str) -> tuple[bytes, list[int]]:
    """The run's calls, in the layout of flips.c, and the sample of each."""
    made = design(load_model(name))[0]
    native = Native(library("f32"), made.tables)
    scenario = made.model.scenarios[0]
    faults = [replace(fault, start=FAULT_AT, end=None) for fault in scenario.faults]
    plant, sender = Plant(native, made, scenario.reference, faults, 1), Sender(native)
    out, samples = b"", []
    lost = 0

    def add(kind: str, k: int, data: bytes = b"", number: int = 0, flags: int = 0) -> None:
        nonlocal out
        out += struct.pack("<BBBBI64s", ord(kind), flags, len(data), k, number, data)
        samples.append(k)

    for k in range(SAMPLES):
        readings = plant.read()
        plant.move()
        for i in range(len(made.tables.groups)):
            frame = sender.step(i, k, readings)
            if frame is None:
                continue
            if i != made.tables.closing and k >= LOST_AT and lost == 0:
                lost += 1  # this one never arrives
            elif not (i == made.tables.closing and k == OVERDUE_AT):
                add("F", k, frame.data, frame.id, frame.flags)
        if k == OVERDUE_AT:
            add("O", k)
        add("S", k)
    return out, samples


def members(name: str) -> tuple[int, list[tuple[str, int, int, bool]]]:
    """Size of the model's storage, and its members: name, offset, bytes, and is it a pointer."""
    command = ["gcc", "-E", "-P", "-DHG_REAL_F32=1", f"-I{ROOT}/firmware/include", str(ROOT / "firmware" / "models" / f"{name}.h")]
    header = subprocess.run(command, check=True, capture_output=True, encoding="utf-8").stdout
    found = re.search(r"typedef struct \{([^}]*)\} hg_" + name + r"_node;", header)
    assert found is not None
    text = re.sub(r"\(uint32_t\)|(?<=\d)U\b", "", found[1])  # sizes as sums and products of numbers, which is all that cffi takes
    ffi = cffi.FFI()
    ffi.include(library("f32").ffi)
    ffi.cdef(f"typedef struct {{{text}}} flips_storage;")
    made: list[tuple[str, int, int, bool]] = []

    def walk(kind: Any, where: str, at: int) -> None:
        if kind.kind == "struct" and kind.fields:
            for field, inner in kind.fields:
                walk(inner.type, f"{where}.{field}" if where else field, at + inner.offset)
        elif kind.kind == "array" and kind.item.kind == "struct":
            for i in range(kind.length):
                walk(kind.item, where, at + i * ffi.sizeof(kind.item))
        else:
            made.append((where, at, ffi.sizeof(kind), kind.kind == "pointer"))

    storage = ffi.typeof("flips_storage")
    walk(storage, "", 0)
    return ffi.sizeof(storage), made


def main() -> int:
    """Counts by member; the exit status is 1 where a place does more harm than it may."""
    parser = argparse.ArgumentParser(description="Bits of a node's memory, flipped.")
    parser.add_argument("model")
    parser.add_argument("program", type=Path)
    parser.add_argument("work", type=Path)
    parser.add_argument("--stride", type=int, default=1, help="every so many calls")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    data, samples = operations(options.model)
    size, parts = members(options.model)
    mask = bytearray(size)
    for _, at, width, pointer in parts:
        mask[at : at + width] = bytes([0 if pointer else 1]) * width
    (options.work / "operations").write_bytes(data)
    (options.work / "mask").write_bytes(mask)
    window = [i for i, k in enumerate(samples) if FIRST <= k <= LAST]
    command = [str(options.program), str(options.work / "operations"), str(options.work / "mask"), str(window[0]), str(window[-1]), str(options.stride), str(BOUND)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    if ran.returncode != 0:
        print(f"FAILED flips of {options.model}: the program broke off ({ran.returncode}): {ran.stderr[-3000:]}")
        return 1
    guard, *rows = ran.stdout.splitlines()
    counts = {int(row[0]): [int(n) for n in row[1:]] for row in map(str.split, rows)}
    return max(report(options, parts, counts), guarded(options.model, guard))


def guarded(model: str, line: str) -> int:
    """What the program says of the node under guard.h: every flip is found, and a new start alarms of nothing."""
    flips, missed, longest, false_alarms = map(int, line.split()[1:])
    if missed or false_alarms:
        print(f"FAILED flips of {model}, guarded: {missed} of {flips} flips not found, {false_alarms} false alarms after a new start")
        return 1
    print(f"  ok  flips of {model}, guarded: {flips} of memory and seal, pointers too, all found; started anew, its verdicts are as usual after {longest} samples at most")
    return 0


def report(options: argparse.Namespace, parts: list[tuple[str, int, int, bool]], counts: dict[int, list[int]]) -> int:
    """The table, and the verdict on it."""
    table: dict[str, list[int]] = {}
    for name, at, width, pointer in parts:
        row = table.setdefault(name, [0] * len(KINDS))
        for place in range(at, at + width) if not pointer else ():
            for i, n in enumerate(counts[place]):
                row[i] += n
    pointers = sum(width for _, _, width, pointer in parts if pointer)
    total = [sum(row[i] for row in table.values()) for i in range(len(KINDS))]
    flips = sum(total)
    print(f"  {options.model}: {flips} flips of {sum(w for _, _, w, p in parts if not p)} bytes; {pointers} bytes are pointers, which are not flipped")
    print("    " + f"{'member':44}" + "".join(f"{kind:>13}" for kind in KINDS))
    for name, row in sorted(table.items(), key=lambda item: (-sum(item[1][3:]), item[0])):
        if sum(row[1:]) > 0:
            print("    " + f"{name:44}" + "".join(f"{n:13}" for n in row))
    print("    " + f"{'all':44}" + "".join(f"{n:13}" for n in total))
    # The largest share of a member's flips that may do lasting harm which nothing shows, and why it does.
    known = json.loads((Path(__file__).parent / "known.json").read_text(encoding="utf-8"))["lasting"]
    worse = [f"{name} ({sum(row[3:])} of {sum(row)})" for name, row in table.items() if sum(row[3:]) > known.get(name, 0.0) * sum(row)]
    if worse:
        print(f"FAILED flips of {options.model}: more lasting harm that nothing shows than is known: {', '.join(worse)}")
        return 1
    told = ", ".join(f"{n} {kind}" for kind, n in zip(KINDS, total, strict=True))
    print(f"  ok  flips of {options.model}: {flips} ({told}); recovered means within {BOUND} samples")
    return 0


if __name__ == "__main__":
    sys.exit(main())
