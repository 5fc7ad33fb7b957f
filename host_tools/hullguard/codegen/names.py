"""Names of a model's parts as C and DBC identifiers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from hullguard.design.design import Design
from hullguard.errors import InputError


def identifier(text: str) -> str:
    """Letters, digits and underscores of a name, not beginning with a digit."""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")
    return plain if plain and not plain[0].isdigit() else "n" + plain


def identifiers(kind: str, names: Sequence[str], fold: bool = True) -> tuple[str, ...]:
    """Identifiers of names that must stay apart; `fold`: in upper case too."""
    made = tuple(identifier(n) for n in names)
    seen: dict[str, str] = {}
    for name, short in zip(names, made, strict=True):
        key = short.upper() if fold else short
        if key in seen:
            raise InputError(f"{kind} '{seen[key]}' and '{name}' have the same identifier '{short}' in generated files; rename one")
        seen[key] = name
    return made


UNITS = {
    "m": "m",
    "mm": "mm",
    "km": "km",
    "mps": "m/s",
    "kmph": "km/h",
    "mps2": "m/s^2",
    "mps3": "m/s^3",
    "rad": "rad",
    "radps": "rad/s",
    "radps2": "rad/s^2",
    "deg": "deg",
    "degps": "deg/s",
    "rpm": "rpm",
    "hz": "Hz",
    "s": "s",
    "ms": "ms",
    "us": "us",
    "n": "N",
    "nm": "Nm",
    "kg": "kg",
    "pa": "Pa",
    "kpa": "kPa",
    "bar": "bar",
    "k": "K",
    "degc": "degC",
    "v": "V",
    "mv": "mV",
    "a": "A",
    "ma": "mA",
    "w": "W",
    "kw": "kW",
    "j": "J",
    "ohm": "Ohm",
    "pct": "%",
}


def unit_of(name: str) -> str:
    """Unit that a signal's name ends with; none: an empty text."""
    _, _, suffix = name.rpartition("_")
    return UNITS.get(suffix, "") if suffix != name else ""


# The library's own headers: hg_NAME_config and NAME.h of a model that is called like one would be declared twice.
LIBRARY = frozenset(
    {
        *("bank", "can", "code", "config", "consistency", "crc32c", "decision", "detector", "digest", "digest_tracker", "digest_uio", "e2e", "frame", "freeze", "fusion", "guard"),
        *("hold", "hull", "hullguard", "isolate", "linalg"),
        *("mismatch", "node", "polynomial", "predict", "real", "residual", "ring", "selftest", "statistic", "status", "tracker", "trigger", "uio", "variance", "zonotope"),
    }
)


@dataclass(frozen=True)
class Names:
    """Identifiers of groups, signals (in vector order) and faults."""

    groups: tuple[str, ...]
    signals: tuple[str, ...]
    faults: tuple[str, ...]


def names_of(design: Design) -> Names:
    """The identifiers of a design."""
    tables = design.tables
    if tables.name in LIBRARY:
        raise InputError(f"model name '{tables.name}': the library has a header {tables.name}.h of its own, and generated files would clash with it; rename the model")
    own = (tables.verdict.name, tables.status.name)
    for g in tables.groups:
        if identifier(g.name).lower() in own:
            raise InputError(f"group '{g.name}': the detector's own frame has that name; rename the group")
    signals = [s.name for g in tables.groups for s in g.signals]
    return Names(
        groups=identifiers("groups", [g.name for g in tables.groups]),
        signals=identifiers("signals", signals),
        faults=identifiers("faults", [f.name for f in design.model.faults]),
    )
