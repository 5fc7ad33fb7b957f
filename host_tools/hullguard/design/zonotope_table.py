"""Plain numbers of hg_zonotope_config, the same for generated C and for structures filled at run time."""

from __future__ import annotations

from dataclasses import dataclass

TRUNCATE, BOX, BALL = 1, 2, 3  # hg_reduction
Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class ZonotopeTable:
    """hg_zonotope_config, field by field. Empty tables (no signals, no disturbances, no initial columns) are empty tuples."""

    signal: tuple[int, ...]  # width
    columns: int
    reduction: int
    block: tuple[int, ...]  # blocks; their sum is the order
    state: tuple[float, ...]  # the blocks one after another, each row-major
    input: Rows  # width x order
    disturbance: Rows  # disturbances x order
    rest: Rows  # initial x order
    moving: Rows  # initial x order
    output: Rows  # residuals x order
    outer: Rows  # residuals x order
    direct: Rows  # residuals x width
    bias_rest: Rows  # settle x residuals
    bias_moving: Rows  # settle x residuals
    decay: tuple[float, ...]  # blocks
    always: tuple[float, ...]  # order
    growth: tuple[float, ...]  # order
    output_growth: tuple[float, ...]  # residuals
    recover: int
    ready_rest: int
    ready_moving: int

    @property
    def order(self) -> int:
        """Rows of the set."""
        return sum(self.block)

    @property
    def settle(self) -> int:
        """Rows of the bias tables."""
        return len(self.bias_rest)

    @property
    def reals(self) -> int:
        """HG_ZONOTOPE_REALS: numbers of memory."""
        fresh = len(self.input) + len(self.disturbance)
        return (self.columns + fresh) * (self.order + 1) + 2 * self.order
