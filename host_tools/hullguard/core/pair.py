"""Observer and post-filter as the two systems they are published as, run by the C library (hg_residual_pair): r0 before and r after the filter."""

from __future__ import annotations

from typing import Any

import numpy as np

from hullguard.core.library import Library
from hullguard.design.design import Generator
from hullguard.errors import InputError
from hullguard.model.table import Array


class Pair:
    """The two systems of one generator; platoon, section 2 and R(z) of section 3."""

    def __init__(self, library: Library, generator: Generator) -> None:
        o, f = generator.observer, generator.filter
        rows = o.W.shape[0]
        self._library, self._rows = library, rows
        self._keep: list[Any] = []
        self._pair = self._new("hg_residual_pair *")
        self._start(self._pair.observer, o.G, np.hstack([o.L, o.H]), -o.W, np.hstack([o.V, -o.Qu]))
        self._start(self._pair.filter, o.G - f.Lo @ o.W, f.Lo, -f.Mo @ o.W, f.Mo)
        self._value = self._new("hg_real[]", o.L.shape[1] + o.H.shape[1])
        self._r0, self._r = self._new("hg_real[]", rows), self._new("hg_real[]", rows)

    def _new(self, kind: str, value: Any = None) -> Any:
        made = self._library.ffi.new(kind, value)
        self._keep.append(made)
        return made

    def _start(self, system: Any, state: Array, inputs: Array, output: Array, direct: Array) -> None:
        c = self._new("hg_residual_config *")
        order, width = inputs.shape
        c.order, c.residuals, c.width, c.signal = order, output.shape[0], width, self._new("uint8_t[]", list(range(width)))
        for place, matrix in ((c.state, state), (c.input, inputs), (c.output, output), (c.direct, direct)):
            place.rows, place.cols, place.exponent = *matrix.shape, 0
            place.data = self._new("hg_real[]", np.ravel(matrix).tolist())
        status = self._library.lib.hg_residual_start(self._library.ffi.addressof(system), c, self._new("hg_real[]", 2 * order + width))
        if status != self._library.lib.HG_OK:
            raise InputError(f"the library refused observer and post-filter as two systems (status {status})")

    def step(self, value: Array) -> tuple[Array, Array]:
        """One sample of the generator's signals [y; u]: r0 and r, a number a residual each."""
        lib, ffi = self._library.lib, self._library.ffi
        self._value[0 : len(value)] = value.tolist()
        if lib.hg_residual_pair_step(self._pair, self._value, self._r0, self._r) != lib.HG_OK:
            raise InputError("a value that is not finite, or so large that the observer overflows")
        return np.array(ffi.unpack(self._r0, self._rows)), np.array(ffi.unpack(self._r, self._rows))

    def run(self, values: Array) -> tuple[Array, Array]:
        """All samples (samples x width): r0 and r, samples x residuals each."""
        steps = [self.step(v) for v in values]
        return np.array([r0 for r0, _ in steps]), np.array([r for _, r in steps])
