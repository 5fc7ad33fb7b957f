"""The options of a campaign as a grid of cases."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from hullguard.errors import InputError
from hullguard.model.faults import FaultSpec
from hullguard.model.schema import parse_override


def numbers(option: str, text: str, good: Callable[[float], bool], what: str) -> list[float]:
    """A list of numbers, P or P1,P2,.."""
    found = []
    for part in text.split(","):
        try:
            value = float(part)
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or not good(value):
            raise InputError(f"{option} {text}: '{part.strip()}' is not {what}")
        found.append(value)
    return distinct(option, text, found)


def losses(text: str) -> list[float]:
    """--loss."""
    return numbers("--loss", text, lambda p: 0.0 <= p < 1.0, "a probability from 0 to below 1")


def bursts(text: str) -> list[int]:
    """--loss-burst, in samples."""
    return [int(b) for b in numbers("--loss-burst", text, lambda b: 0.0 <= b <= 1e6 and b.is_integer(), "a whole number of samples within 0 .. 1000000")]


def sizes(text: str) -> list[float]:
    """--size, in the units of the fault's kind."""
    return numbers("--size", text, lambda _: True, "a finite number")


def share(option: str, value: float) -> float:
    """A share of the runs."""
    if not 0.0 <= value <= 1.0:
        raise InputError(f"{option} {value:g}: expected a share from 0 to 1")
    return value


def distinct(option: str, text: str, values: list[Any]) -> list[Any]:
    """Refuse a value that is there twice: its runs would be the same runs."""
    if any(v in values[:i] for i, v in enumerate(values)):
        raise InputError(f"{option} {text}: a value is there twice; the same case gives the same runs")
    return values


def _split(text: str) -> list[str]:
    """At the commas outside brackets and quotes."""
    parts, depth, quote = [""], 0, ""
    for c in text:
        if quote:
            quote = "" if c == quote else quote
        elif c in "\"'":
            quote = c
        else:
            depth += {"[": 1, "{": 1, "]": -1, "}": -1}.get(c, 0)
        if c == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += c
    return parts


def combinations(options: Sequence[str]) -> list[dict[str, Any]]:
    """Every combination of the values of each --vary KEY=V1,V2,..; one empty one without any."""
    axes: list[list[tuple[str, Any]]] = []
    for text in options:
        key, equals, values = text.partition("=")
        if not equals or not key.strip() or not all(part.strip() for part in _split(values)):
            raise InputError(f"--vary '{text}': expected KEY=V1,V2,.., for example groups.measurement.trigger.silence=0,1")
        if any(key.strip() == axis[0][0] for axis in axes):
            raise InputError(f"--vary '{text}': {key.strip()} is varied twice; give all its values in one list")
        axes.append(distinct("--vary", text, [parse_override(f"{key}={part}") for part in _split(values)]))
    return [dict(chosen) for chosen in itertools.product(*axes)]


def fault_sets(faults: Sequence[FaultSpec], each: bool, size_list: Sequence[float]) -> list[tuple[FaultSpec, ...]]:
    """The faults of each case: all together or one a case, as they are or with each of the sizes."""
    if not faults and (each or size_list):
        raise InputError(f"{'--each-fault' if each else '--size'}: there is no fault; give --fault SPEC, or a scenario that has some")
    if size_list and any(f.kind == "freeze" for f in faults):
        raise InputError("--size: a freeze has no size; leave it out")
    sets: list[tuple[FaultSpec, ...]] = [(f,) for f in faults] if each else [tuple(faults)]
    if not size_list:
        return sets
    return [tuple(replace(f, size=s) for f in chosen) for chosen in sets for s in size_list]
