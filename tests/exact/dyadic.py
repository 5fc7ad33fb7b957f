"""Exact arithmetic on what computers compute with: every float and every fixed-point number is a whole number over a power of two, and so are sums and products of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

Whole = NDArray[Any]  # of Python's integers, which have any size


@dataclass(frozen=True)
class Exact:
    """An array of numbers whole / 2^places."""

    whole: Whole
    places: int

    def __matmul__(self, other: Exact) -> Exact:
        return Exact(np.asarray(self.whole @ other.whole, dtype=object), self.places + other.places)

    def __add__(self, other: Exact) -> Exact:
        places = max(self.places, other.places)
        return Exact(self._at(places) + other._at(places), places)

    def __neg__(self) -> Exact:
        return Exact(-self.whole, self.places)

    def __sub__(self, other: Exact) -> Exact:
        return self + (-other)

    def __abs__(self) -> Exact:
        return Exact(np.asarray(np.abs(self.whole), dtype=object), self.places)

    def __getitem__(self, place: Any) -> Exact:
        return Exact(np.asarray(self.whole[place], dtype=object), self.places)

    def _at(self, places: int) -> Whole:
        return np.asarray(self.whole * (1 << (places - self.places)), dtype=object)

    def scaled(self, power: int) -> Exact:
        """Times 2^power."""
        return Exact(self.whole, self.places - power) if power <= self.places else Exact(self._at(power), 0)

    def sums(self) -> Exact:
        """Of each row."""
        return Exact(np.array([sum(row) for row in self.whole], dtype=object), self.places)

    def floats(self) -> NDArray[np.float64]:
        """To nearest; Python divides whole numbers of any size so."""
        one = 1 << max(self.places, 0)
        return np.array([x / one for x in np.ravel(self.whole)], dtype=float).reshape(self.whole.shape)

    def fraction(self, *place: int) -> Fraction:
        """One of them."""
        return Fraction(int(self.whole[place]), 1 << self.places)

    def floor(self, places: int) -> Exact:
        """The largest multiples of 2^-places that are not above: keeps a long sum of bounds from below short."""
        if places >= self.places:
            return self
        return Exact(np.array([x >> (self.places - places) for x in np.ravel(self.whole)], dtype=object).reshape(self.whole.shape), places)


def exact(values: Any) -> Exact:
    """Finite floats or integers, as they are."""
    array = np.asarray(values, dtype=float)
    ratios = [float(x).as_integer_ratio() for x in np.ravel(array)]
    places = max((d.bit_length() - 1 for _, d in ratios), default=0)
    whole = [n << (places - (d.bit_length() - 1)) for n, d in ratios]
    return Exact(np.array(whole, dtype=object).reshape(array.shape), places)


def zeros(*shape: int) -> Exact:
    """As many."""
    return Exact(np.full(shape, 0, dtype=object), 0)


def eye(n: int) -> Exact:
    """The unit matrix."""
    return Exact(np.array([[int(i == j) for j in range(n)] for i in range(n)], dtype=object).reshape(n, n), 0)


def joined(parts: Sequence[Exact]) -> Exact:
    """Vectors one behind another."""
    places = max(p.places for p in parts)
    return Exact(np.concatenate([p._at(places) for p in parts]), places)


def stacked(rows: Sequence[Exact]) -> Exact:
    """Vectors as rows."""
    places = max(p.places for p in rows)
    return Exact(np.array([p._at(places) for p in rows], dtype=object), places)
