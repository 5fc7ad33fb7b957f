"""What several host tests need: models made once, batches, mutated copies of the C library, and the command without a process around it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "host_tools"))

import pytest
from hullguard.cli import main
from hullguard.core.library import Library, library
from hullguard.core.native import Batch, Frame, Native
from hullguard.design.design import Design, design
from hullguard.model import load_model, parse_fault
from hullguard.model.schema import Reference

SEED = int(os.environ.get("HULLGUARD_SEED") or int.from_bytes(os.urandom(4), "little"))
FLOATS = ("f32", "f64")
REALS = (*FLOATS, "q31")
SILENT_1 = {"groups.measurement.trigger.silence": 1}
SILENT_2 = {"groups.measurement.trigger.silence": 2}
PERIODIC = {"groups.measurement.trigger.interval_max": 1}


@dataclass(frozen=True)
class Ready:
    """A design with its structures in one library."""

    design: Design
    native: Native
    reference: Reference
    samples: int

    def batch(self, samples: int, faults: tuple[str, ...] = (), seed: int = SEED, **options: Any) -> Batch:
        return Batch(self.native, self.design, samples, self.reference, [parse_fault(f) for f in faults], seed, **options)


class Models:
    """Designs, each made once."""

    def __init__(self) -> None:
        self._designs: dict[tuple[str, str, str], Design] = {}
        self._made: dict[tuple[str, str, str, str], Ready] = {}

    def design(self, overrides: dict[str, Any] | None = None, scenario: str = "rest", name: str = "platoon") -> Design:
        key = (name, json.dumps(overrides or {}, sort_keys=True), scenario)
        if key not in self._designs:
            self._designs[key] = design(load_model(name, overrides, scenario))[0]
        return self._designs[key]

    def platoon(self, scenario: str = "rest", overrides: dict[str, Any] | None = None, real: str = "f32", lib: Library | None = None) -> Ready:
        made = self.design(overrides, scenario)
        chosen = made.model.scenario(scenario)
        key = ("platoon", json.dumps(overrides or {}, sort_keys=True), scenario, real)
        if lib is not None:
            return Ready(made, Native(lib, made.tables), chosen.reference, chosen.samples)
        if key not in self._made:
            self._made[key] = Ready(made, Native(library(real), made.tables), chosen.reference, chosen.samples)
        return self._made[key]


@dataclass(frozen=True)
class Alarms:
    """Runs with a false alarm."""

    provisional: int
    confirmed: int


def alarms(rows: list[dict[str, Any]]) -> Alarms:
    return Alarms(sum(r["false_provisional"] > 0 for r in rows), sum(r["false_confirmed"] > 0 for r in rows))


@dataclass(frozen=True)
class Result:
    """How a command ended."""

    status: int
    out: str
    err: str

    @property
    def json(self) -> dict[str, Any]:
        lines = self.out.splitlines()
        assert len(lines) == 1, f"--json must print one line on stdout, found {len(lines)}"
        found = json.loads(lines[0])
        assert isinstance(found, dict)
        return found


class Cli:
    """The command in this process; what argparse does with sys.exit is a status too."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

    def __call__(self, *arguments: object) -> Result:
        self._capsys.readouterr()
        try:
            status = main([str(a) for a in arguments])
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else 1 if end.code else 0
        out, err = self._capsys.readouterr()
        return Result(status, out, err)


INCLUDE = ("-I", str(ROOT / "firmware" / "include"))
FLAGS = ("-std=c11", "-O2", "-ffp-contract=off", "-fPIC")


def build_library(
    folder: Path, real: str, patch: dict[str, list[tuple[str, str]]] | None = None, extra: dict[str, str] | None = None, options: tuple[str, ...] = ()
) -> Library:
    """A library from a copy of the sources. `patch`: file name -> (text that must be there exactly once, what replaces it); `extra`: more files;
    `options`: of the compiler."""
    source, core = folder / "src", folder / "core"
    for origin, copy in ((ROOT / "firmware" / "src", source), (ROOT / "host_tools" / "hullguard" / "core", core)):
        copy.mkdir(parents=True)
        for file in (*origin.glob("*.c"), *origin.glob("*.h")):
            shutil.copy(file, copy)
    for name, changes in (patch or {}).items():
        text = (source / name).read_text(encoding="utf-8")
        for old, new in changes:
            assert text.count(old) == 1, f"{name}: the text to mutate is there {text.count(old)} times: {old}"
            text = text.replace(old, new)
        (source / name).write_text(text, encoding="utf-8")
    for name, text in (extra or {}).items():
        (source / name).write_text(text, encoding="utf-8")
    defined = f"-DHG_REAL_{real.upper()}=1"
    shared = folder / f"libhullguard_{real}.so"
    files = [str(f) for where in (source, core) for f in sorted(where.glob("*.c"))]
    subprocess.run(["gcc", *FLAGS, *options, defined, *INCLUDE, "-I", str(source), "-I", str(core), "-shared", "-Wl,--no-undefined", "-o", str(shared), *files, "-lm"], check=True)
    declare = ROOT / "host_tools" / "hullguard" / "core" / "declare"
    done = subprocess.run(["gcc", "-E", "-P", "-nostdinc", defined, "-I", str(declare), *INCLUDE, str(core / "host.h")], check=True, capture_output=True, text=True)
    (folder / f"hullguard_{real}.i").write_text(done.stdout, encoding="utf-8")
    return Library(real, folder)


# ---- bits of classic frames, without the library ----

EXTENDED, REMOTE = 0x01, 0x02


def crc15(bits: list[int]) -> list[int]:
    """x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1 by long division."""
    polynomial = [1 if e in (15, 14, 10, 8, 7, 4, 3, 0) else 0 for e in range(15, -1, -1)]
    rest = bits + [0] * 15
    for i in range(len(bits)):
        if rest[i]:
            for j, p in enumerate(polynomial):
                rest[i + j] ^= p
    return rest[-15:]


def binary(value: int, width: int) -> list[int]:
    return [int(c) for c in format(value, f"0{width}b")]


def stuffed(bits: list[int]) -> list[int]:
    out: list[int] = []
    for bit in bits:
        out.append(bit)
        if len(out) >= 5 and len(set(out[-5:])) == 1:
            out.append(1 - bit)
    return out


def classic_bits(frame: Frame) -> int:
    """Start of frame to interframe space of a classic frame (ISO 11898-1)."""
    remote = int(bool(frame.flags & REMOTE))
    if frame.flags & EXTENDED:
        header = [0, *binary(frame.id >> 18, 11), 1, 1, *binary(frame.id & 0x3FFFF, 18), remote, 0, 0]
    else:
        header = [0, *binary(frame.id, 11), remote, 0, 0]
    bits = header + binary(len(frame.data), 4) + [b for byte in frame.data for b in binary(byte, 8)]
    return len(stuffed(bits + crc15(bits))) + 1 + 2 + 7 + 3
