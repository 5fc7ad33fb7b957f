"""recorded.py FILE.csv: the tracking model on a recorded drive of two cars (columns speed1_mps, speed2_mps, gap2_m). Judged: no sensor suspected without a fault, a filter that is
consistent, fewer than 45 % of the sensors' bits, and a frozen or biased sensor found within 50 samples in 95 % of the starts. Exit status 1 when a figure misses its limit.

Recordings have smooth signals: the noise that the model states is added, seeded.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from hullguard.core.library import library
from hullguard.core.tracker import TrackerNative
from hullguard.design.fusion_model import FusionDesign, design_fusion
from hullguard.errors import HullguardError
from hullguard.model.faults import FaultSpec
from hullguard.model.fusion import FusionScenario, load_fusion
from hullguard.model.table import Array
from hullguard.plant.fusion import InProcess, Run, Sensors, errors, recorded_drive, summary

SEED = 1
WITHIN, FOUND = 50, 0.95
BEFORE = 150  # samples of a drive before a fault
STARTS = 25  # a fault


def drive_on(made: FusionDesign, native: TrackerNative, drive: Array, faults: list[FaultSpec], seed: int) -> Run:
    """A run in process."""
    run = Run(made, native, InProcess())
    run.samples(drive, Sensors(made, drive, faults, FusionScenario("recording", len(drive), "recording", 0.0, 0.0, -1, (), ()), seed), len(drive))
    return run


def main() -> int:
    """Print every figure; 1 when one misses its limit."""
    made, _ = design_fusion(load_fusion("tracking"))
    native = TrackerNative(library("f32"), made.tables)
    drive = recorded_drive(made.model, Path(sys.argv[1]))
    run = drive_on(made, native, drive, [], SEED)
    result = summary(made, native, run.trace, [], {})
    frames, inside = result["frames"], [e["within_2_deviations"] for n, e in result["errors"].items() if n.endswith(("_m", "_mps"))]
    share = frames["bits_sensors"] / frames["bits_sensors_periodic"]
    e, _ = errors(made, run.trace)
    failed = 0

    def check(what: str, value: float, good: bool) -> None:
        nonlocal failed
        failed += not good
        print(f"  {'ok' if good else 'FAILED':<6} {what:<60} {value:.4g}", flush=True)

    print(f"{len(drive)} samples")
    check("sensors suspected without a fault", result["false_alarms"]["confirmed"], result["false_alarms"]["confirmed"] == 0)
    check("samples in which copies of the filter differ", run.trace.unequal, run.trace.unequal == 0)
    check("sensors' bits, share of periodic", share, share <= 0.45)
    check("rms error of the first car's position, m", float(np.sqrt(np.mean(e[100:, 0] ** 2))), True)
    check("least share of positions and speeds within two deviations", min(inside), min(inside) >= 0.93)
    step = (len(drive) - BEFORE - WITHIN - 1) // STARTS
    for i, s in enumerate(made.model.sensors):
        for kind, size in (("bias", 3.0 * s.sigma), ("freeze", 0.0)):
            hits = 0
            for place in range(STARTS):
                part = drive[place * step : place * step + BEFORE + WITHIN + 1].copy()
                part[:, [0, 3]] -= part[0, 0]  # each begins where the filter believes it does
                found = drive_on(made, native, part, [FaultSpec(s.name, kind, size, BEFORE, None)], SEED + place).trace.verdict
                hits += next((v.k <= BEFORE + WITHIN and v.candidates == 1 << i for v in found if v.candidates), False)
            check(f"{s.name}: {kind}{f' of {size:g}' if size else ''}, found within {WITHIN} samples", hits / STARTS, hits / STARTS >= FOUND)
    return 1 if failed else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except HullguardError as error:
        print(f"recorded.py: {error}", file=sys.stderr)
        sys.exit(error.status)
