"""The C library on the host, by cffi: one shared library a number type, side by side, declared by its own headers."""

from __future__ import annotations

import hashlib
import os
import re
from functools import cache
from pathlib import Path
from typing import Any

import cffi

from hullguard.errors import InputError

REALS = ("f32", "f64", "q31")
_BUILT = Path(__file__).resolve().parents[3] / "build" / "lib"


def _declarations(text: str) -> str:
    """What cffi can read of a preprocessed header: everything but the bodies of inline functions."""
    out, at = [], 0
    for found in re.finditer(r"static inline [^{;]*\{", text):
        if found.start() < at:
            continue
        out.append(text[at : found.start()])
        depth, at = 1, found.end()
        while depth:
            depth += {"{": 1, "}": -1}.get(text[at], 0)
            at += 1
    out.append(text[at:])
    # cffi takes a constant object for a number; as a variable it can be pointed at.
    declared = "".join(out).replace("extern const ", "extern ")
    # cffi evaluates array lengths and enumerators; it wants plain numbers there.
    return re.sub(r"\b(\d+|0x[0-9A-Fa-f]+)[UuLl]+\b", r"\1", declared)


class Library:
    """One loaded build: `ffi` and `lib` as cffi has them, `real` is f32 or f64, `digest` tells it from other builds."""

    def __init__(self, real: str, folder: Path) -> None:
        self.real = real
        self.ffi: Any = cffi.FFI()
        shared, header = folder / f"libhullguard_{real}.so", folder / f"hullguard_{real}.i"
        if not shared.is_file() or not header.is_file():
            raise InputError(f"the C library is not built ({shared.name} is missing); run: make lib")
        self.ffi.cdef(_declarations(header.read_text(encoding="utf-8")))
        self.lib: Any = self.ffi.dlopen(str(shared))
        self.digest = hashlib.sha256(shared.read_bytes()).hexdigest()


@cache
def library(real: str = "f32") -> Library:
    """The library for a number type; HULLGUARD_LIB names another folder than build/lib."""
    if real not in REALS:
        raise InputError(f"number type '{real}': expected one of {', '.join(REALS)}")
    return Library(real, Path(os.environ.get("HULLGUARD_LIB", str(_BUILT))))
