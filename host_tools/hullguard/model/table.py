"""Strict reading of TOML tables.

Unknown keys, wrong types, wrong shapes and numbers that are not finite are refused, and the message says where, what was found and what would do.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hullguard.errors import InputError

Array = NDArray[np.float64]
LARGEST = 1e30  # products of a few such numbers stay finite: LAPACK may run for ever on infinity


class Table:
    """One TOML table. Every key must be asked for before `close`, which refuses what is left."""

    def __init__(self, data: object, where: str) -> None:
        if not isinstance(data, dict):
            raise InputError(f"{where}: expected a table, found {_kind(data)}")
        self._data: dict[str, Any] = data
        self._asked: set[str] = set()
        self.where = where

    def __contains__(self, key: str) -> bool:
        self._asked.add(key)
        return key in self._data

    @property
    def data(self) -> dict[str, Any]:
        """All of it, unchecked."""
        return self._data

    def error(self, key: str, what: str) -> InputError:
        """An error that names this table and key."""
        return InputError(f"{self.where}.{key}: {what}")

    def raw(self, key: str) -> Any:
        """The value of a required key, unchecked."""
        self._asked.add(key)
        if key not in self._data:
            raise InputError(f"{self.where}: '{key}' is missing")
        return self._data[key]

    def text(self, key: str, default: str | None = None, choices: Sequence[str] = ()) -> str:
        """A string, one of `choices` where they are given."""
        if default is not None and key not in self:
            return default
        value = self.raw(key)
        if not isinstance(value, str):
            raise self.error(key, f"expected text, found {_kind(value)}")
        if choices and value not in choices:
            raise self.error(key, f"'{value}' is not one of {', '.join(choices)}")
        return value

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        if key not in self:
            return default
        value = self.raw(key)
        if not isinstance(value, bool):
            raise self.error(key, f"expected true or false, found {_kind(value)}")
        return value

    def whole(self, key: str, low: int, high: int, default: int | None = None) -> int:
        """A whole number in low .. high."""
        if default is not None and key not in self:
            return default
        return _whole(self.raw(key), low, high, f"{self.where}.{key}")

    def number(self, key: str, low: float = -math.inf, high: float = math.inf, default: float | None = None) -> float:
        """A finite number in low .. high."""
        if default is not None and key not in self:
            return default
        return _number(self.raw(key), low, high, f"{self.where}.{key}")

    def interval(self, key: str, low: float = -math.inf) -> tuple[float, float]:
        """A number, or { value, pm }: an interval around it. All of it must be at least `low`. The number, and how far the true one may be from it."""
        value = self.raw(key)
        if not isinstance(value, dict):
            return self.number(key, low), 0.0
        inner = self.table(key)
        middle, pm = inner.number("value", low), inner.number("pm", 0.0)
        inner.close()
        if middle - pm < low:
            raise self.error(key, f"{middle:g} - {pm:g} is below {low:g}: make pm at most {middle - low:g}")
        return middle, pm

    def vector(self, key: str, length: int | None = None, low: float = -math.inf) -> Array:
        """A list of finite numbers of this length; a single number fills a vector whose length is known."""
        value = self.raw(key)
        if length is not None and isinstance(value, (int, float)) and not isinstance(value, bool):
            value = [value] * length
        if not isinstance(value, list):
            raise self.error(key, f"expected a list of numbers, found {_kind(value)}")
        if length is not None and len(value) != length:
            raise self.error(key, f"expected {length} numbers, found {len(value)}")
        return np.array([_number(v, low, math.inf, f"{self.where}.{key}[{i}]") for i, v in enumerate(value)])

    def matrix(self, key: str, rows: int | None = None, cols: int | None = None) -> Array:
        """A list of rows of finite numbers, all of one length."""
        value = self.raw(key)
        if not isinstance(value, list) or not value or not all(isinstance(r, list) and len(r) == len(value[0]) for r in value):
            raise self.error(key, "expected a matrix: a list of rows of equal length")
        found = np.array([[_number(x, -math.inf, math.inf, f"{self.where}.{key}[{i}][{j}]") for j, x in enumerate(r)] for i, r in enumerate(value)])
        if (rows is not None and found.shape[0] != rows) or (cols is not None and found.shape[1] != cols):
            raise self.error(key, f"expected {_shape(rows, cols)}, found {found.shape[0]} x {found.shape[1]}")
        return found

    def names(self, key: str, default: Sequence[str] | None = None) -> list[str]:
        """A list of strings."""
        if default is not None and key not in self:
            return list(default)
        value = self.raw(key)
        if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
            raise self.error(key, "expected a list of names")
        return list(value)

    def table(self, key: str, optional: bool = False) -> Table:
        """A table within; an empty one where it may be left out."""
        if optional and key not in self:
            return Table({}, f"{self.where}.{key}")
        return Table(self.raw(key), f"{self.where}.{key}")

    def tables(self, key: str, optional: bool = False) -> list[Table]:
        """An array of tables."""
        if optional and key not in self:
            return []
        value = self.raw(key)
        if not isinstance(value, list):
            raise self.error(key, f"expected a list of tables, found {_kind(value)}")
        return [Table(v, f"{self.where}.{key}[{i}]") for i, v in enumerate(value)]

    def close(self) -> None:
        """Refuse the keys that nobody asked for."""
        for key in self._data:
            if key not in self._asked:
                near = difflib.get_close_matches(key, sorted(self._asked), 1)
                hint = f"; did you mean '{near[0]}'?" if near else f"; known: {', '.join(sorted(self._asked))}"
                raise InputError(f"{self.where}: unknown key '{key}'{hint}")


def _kind(value: object) -> str:
    return {bool: "true/false", int: "a number", float: "a number", str: "text", list: "a list", dict: "a table"}.get(type(value), type(value).__name__)


def _shape(rows: int | None, cols: int | None) -> str:
    return f"{'any' if rows is None else rows} x {'any' if cols is None else cols}"


def _number(value: object, low: float, high: float, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"{where}: expected a number, found {_kind(value)}")
    if abs(value) > LARGEST and abs(value) != math.inf:
        raise InputError(f"{where}: a number beyond {LARGEST:g}; choose other units")
    if not math.isfinite(value):
        raise InputError(f"{where}: {value} is not a finite number")
    if not low <= value <= high:
        raise InputError(f"{where}: {value:g} is outside {low:g} .. {high:g}")
    return float(value)


def _whole(value: object, low: int, high: int, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f"{where}: expected a whole number, found {_kind(value)}")
    if not low <= value <= high:
        raise InputError(f"{where}: {value} is outside {low} .. {high}")
    return value
