"""The [detector] table beside its observers: thresholds, prediction, banks of certificates."""

from __future__ import annotations

from dataclasses import dataclass

from hullguard.model.table import Table

PUBLISHED = "zonotope_published"  # truncated, for comparison: no outer bound
THRESHOLDS = ("exact", "zonotope", PUBLISHED)
CERTIFICATES_MAX = 64


@dataclass(frozen=True)
class BankSpec:
    """A bank of certificates that the design has to find; platoon, section 7."""

    size: int  # certificates; of a larger stored bank the first ones
    window: int  # samples
    seed: int  # of the runs that it learns from
    runs: int  # a fault and size
    sizes: tuple[float, ...]  # of the faults, signal units, both signs
    faults: tuple[str, ...]  # names of those it is made for; empty for all


@dataclass(frozen=True)
class DetectorSpec:
    """How residuals are judged, and what stands beside the observers."""

    threshold: str  # exact | zonotope | zonotope_published
    columns: int  # of the zonotope
    prediction: bool  # between frames, where it is tighter than silence
    bank: BankSpec | None  # for detection
    isolation: BankSpec | None  # one bank for each fault that could be the cause; size: certificates of each
    feedback_known: bool  # the node knows the controller and its reference: u = held - gain (x - equilibrium) + reference; for `limit` only


def read_detector(t: Table) -> DetectorSpec:
    """Read all keys but `observers`, which stay to be read, and the table open."""
    zonotope = t.table("zonotope", optional=True)
    columns = zonotope.whole("columns", 1, 255, 12)
    zonotope.close()
    t.text("number", "f32", ["f32", "f64"])
    return DetectorSpec(
        threshold=t.text("threshold", "exact", list(THRESHOLDS)),
        columns=columns,
        prediction=t.flag("prediction", False),
        bank=_read_bank(t, "bank", 16),
        isolation=_read_bank(t, "isolation", 4),
        feedback_known=t.flag("feedback_known", False),
    )


def _read_bank(t: Table, key: str, size: int) -> BankSpec | None:
    if key not in t:
        return None
    inner = t.table(key)
    sizes = tuple(float(x) for x in inner.vector("sizes")) if "sizes" in inner else (0.5, 1.0, 2.0)
    if not sizes or min(sizes) <= 0.0:
        raise inner.error("sizes", "expected sizes of faults above 0, signal units; both signs are tried")
    spec = BankSpec(
        size=inner.whole("size", 1, CERTIFICATES_MAX, size),
        window=inner.whole("window", 2, 200, 30),
        seed=inner.whole("seed", 0, 2**32 - 1, 1),
        runs=inner.whole("runs", 1, 1000, 12),
        sizes=sizes,
        faults=tuple(inner.names("faults", [])),
    )
    inner.close()
    return spec
