"""What a design file keeps of an unknown-input observer."""

from __future__ import annotations

from dataclasses import dataclass

from hullguard.model.table import Array

UIO_MATRICES = ("state", "input", "output", "direct", "follows", "passing")


@dataclass(frozen=True)
class StoredUio:
    """One observer in a design file."""

    state: Array  # order x order
    input: Array  # order x signals read
    output: Array  # estimates x order
    direct: Array  # estimates x signals read
    follows: Array  # order x n
    passing: Array  # order: what unknown inputs do to a state in a sample, at most
    fixed: Array  # complex: poles that no gain moves
