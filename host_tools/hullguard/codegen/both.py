"""Tables that carry both kinds of numbers: floats, and beside each what it is in fixed point."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

from hullguard.design.tables import Tables


class Both(float):
    """A float, and the same number in steps of 2^-31 of its unit."""

    fixed: int

    def __new__(cls, value: float, fixed: float) -> Both:
        """`fixed` in units."""
        made = super().__new__(cls, value)
        made.fixed = min(round(fixed * 2**31), 2**31 - 1)
        return made

    def __deepcopy__(self, memo: object) -> Both:
        return self  # a number


class Scaled(int):
    """An exponent that is 0 for the float types."""

    fixed: int

    def __new__(cls, value: int, fixed: int) -> Scaled:
        """0, and what it is in fixed point."""
        made = super().__new__(cls, value)
        made.fixed = fixed
        return made

    def __deepcopy__(self, memo: object) -> Scaled:
        return self


def both(tables: Tables) -> Tables:
    """The tables with both kinds of numbers, where there are both."""
    if tables.fixed is None:
        return tables
    made: Tables = _merged(replace(tables, fixed=None), replace(tables.fixed, units=(), float_hash=None))
    return made


def _merged(a: Any, b: Any) -> Any:
    if is_dataclass(a) and not isinstance(a, type):
        return replace(a, **{f.name: _merged(getattr(a, f.name), getattr(b, f.name)) for f in fields(a)})
    if isinstance(a, tuple):
        return tuple(_merged(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float):
        return Both(a, b)
    if isinstance(a, int) and not isinstance(a, bool) and a != b:
        return Scaled(a, b)
    return a
