"""A certificate bank as a design file stores it, and as the C library runs it; how one becomes the other stands in bank_table.py."""

from __future__ import annotations

from dataclasses import dataclass

from hullguard.model.table import Array


@dataclass(frozen=True)
class StoredBank:
    """What a design file keeps of a bank: the certificates over the outputs. Those over the inputs follow from them."""

    window: int  # samples
    weight: Array  # certificates x window (oldest sample first) x outputs, 9 significant digits, exact in float32
    faults: int  # mask of the model's faults that can explain an alarm
    hypothesis: int | None = None  # fault whose effect, of any shape over the window, moves no certificate; None for a detection bank


@dataclass(frozen=True)
class BankTable:
    """What hg_bank_config holds: float32 numbers, as float64."""

    signal: tuple[int, ...]  # places in the model's signal vector
    window: int  # samples
    weight: tuple[tuple[tuple[float, ...], ...], ...]  # window (lag 0 the newest) x signals x certificates
    bias: tuple[float, ...]  # certificates: state range, disturbance, rounding
    widen: float  # at least 1: what adding up J in float32 can lose, and the rounding of r that grows with the radii
    faults: int  # mask of the model's faults that can explain an alarm
    feeds: int  # mask of the groups whose signals carry weight
    extra: tuple[int, ...] = ()  # places of derived signals that have a radius only
    extra_weight: tuple[tuple[tuple[float, ...], ...], ...] = ()  # window x extra x certificates, rounded up
    exponent: int = 0

    @property
    def certificates(self) -> int:
        """Residuals of the bank."""
        return len(self.bias)
