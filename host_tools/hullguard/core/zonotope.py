"""A zonotope's table as the C structure it describes."""

from __future__ import annotations

from typing import Any

import numpy as np

from hullguard.design.zonotope_table import ZonotopeTable

REALS = (
    *("state", "input", "disturbance", "rest", "moving", "output", "outer", "direct"),
    *("bias_rest", "bias_moving", "decay", "always", "growth", "output_growth"),
)


def fill(ffi: Any, config: Any, table: ZonotopeTable) -> list[Any]:
    """Write a table into an hg_zonotope_config; the arrays it points to live as long as the list that is returned."""
    kept: list[Any] = []
    config.order, config.residuals, config.width = table.order, len(table.output), len(table.signal)
    config.disturbances, config.initial, config.columns = len(table.disturbance), len(table.rest), table.columns
    config.blocks, config.reduction, config.settle = len(table.block), table.reduction, table.settle
    config.recover, config.ready_rest, config.ready_moving = table.recover, table.ready_rest, table.ready_moving
    for name, values in (("signal", table.signal), ("block", table.block)):
        kept.append(ffi.new("uint8_t[]", list(values) or [0]))
        setattr(config, name, kept[-1])
    for name in REALS:
        kept.append(ffi.new("hg_real[]", [float(x) for x in np.ravel(np.array(getattr(table, name), dtype=float))] or [0.0]))
        setattr(config, name, kept[-1])
    return kept
