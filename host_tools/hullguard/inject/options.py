"""Options of an action: declared once as fields of its class, read from text, listed for people."""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

from hullguard.errors import InputError

T = TypeVar("T")
_TRUTH = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


def option(default: Any, about: str, low: float | None = None, high: float | None = None, choices: tuple[str, ...] = (), above: float | None = None) -> Any:
    """A field that may be given; low and high are allowed themselves, `above` is not."""
    return dataclasses.field(default=default, metadata={"about": about, "low": low, "high": high, "choices": choices, "above": above})


def required(about: str, **limits: Any) -> Any:
    """A field that must be given."""
    made = option(None, about, **limits)
    return dataclasses.field(default=None, metadata=dict(made.metadata) | {"required": True})


def declared(kind: type[Any]) -> list[dataclasses.Field[Any]]:
    """The options of an action."""
    return [f for f in dataclasses.fields(kind) if "about" in f.metadata]


def fill(kind: type[T], given: Mapping[str, str], where: str) -> T:
    """An action with its options read from text; raises InputError."""
    known = {f.name: f for f in declared(kind)}
    for name in given:
        if name not in known:
            raise InputError(f"{where}: no option '{name}'; it has {', '.join(known) or 'none'}")
    for name, f in known.items():
        if f.metadata.get("required") and name not in given:
            raise InputError(f"{where}: needs {name}= ({f.metadata['about']})")
    hints = typing.get_type_hints(kind)
    return kind(**{name: _value(text, hints[name], known[name], f"{where}: {name}={text}") for name, text in given.items()})


def _value(text: str, hint: Any, f: dataclasses.Field[Any], where: str) -> Any:
    if isinstance(hint, types.UnionType):
        hint = next(h for h in hint.__args__ if h is not type(None))
    if hint is bool:
        if text.lower() not in _TRUTH:
            raise InputError(f"{where}: expected true or false")
        return _TRUTH[text.lower()]
    if hint is bytes:
        try:
            return bytes.fromhex(text)
        except ValueError as error:
            raise InputError(f"{where}: expected bytes in hexadecimal, for example 00FF") from error
    if hint is str:
        if f.metadata["choices"] and text not in f.metadata["choices"]:
            raise InputError(f"{where}: expected one of {', '.join(f.metadata['choices'])}")
        return text
    return number(text, hint, f.metadata["low"], f.metadata["high"], where, f.metadata["above"])


def number(text: str, hint: type[int] | type[float], low: float | None, high: float | None, where: str, above: float | None = None) -> int | float:
    """A number within its limits."""
    try:
        value = int(text, 0) if hint is int else float(text)
    except ValueError:
        value = math.nan
    inside = (isinstance(value, int) or math.isfinite(value)) and (low is None or value >= low) and (high is None or value <= high) and (above is None or value > above)
    if not inside:
        limits = [f"at least {low:g}" if low is not None else "", f"above {above:g}" if above is not None else "", f"at most {high:g}" if high is not None else ""]
        raise InputError(f"{where}: expected a {'whole ' if hint is int else ''}number {' and '.join(x for x in limits if x)}".rstrip())
    return value
