"""How estimates of actuators' faults are told apart from weaker parts of the plant: [detector.uio.isolate]; suspension, section 1.6."""

from __future__ import annotations

from dataclasses import dataclass

from hullguard.model.table import Table


@dataclass(frozen=True)
class IsolateSpec:
    """What isolate.h asks for, in units of the model."""

    settle_s: float  # of an episode that is left out: the onset, and the low pass
    release_s: float  # within the radius that ends an episode
    block_s: float
    blocks: int
    limit: float  # of an actuator's fault that counts even where its radius is smaller
    excitation: float  # of a component's force, the smallest scatter that says something
    explained: float
    steady: float


def read_isolate(t: Table) -> IsolateSpec | None:
    """None where the model does not isolate."""
    if "isolate" not in t:
        return None
    inner = t.table("isolate")
    spec = IsolateSpec(
        settle_s=inner.number("settle_s", 0.0, 1e4, 1.0),
        release_s=inner.number("release_s", 1e-6, 1e4, 1.0),
        block_s=inner.number("block_s", 1e-6, 1e4, 0.5),
        blocks=inner.whole("blocks", 1, 255, 4),
        limit=inner.number("limit", 0.0, default=0.0),
        excitation=inner.number("excitation", 1e-9),
        explained=inner.number("explained", 0.0, 0.999999, 0.9),
        steady=inner.number("steady", 1e-6, default=5.0),
    )
    inner.close()
    return spec
