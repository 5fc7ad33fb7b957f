"""record.py MODEL FILE: readings of a model's emulated plant as a C header for tests/bench/drive.c, in codes of the wire, and the counts that
tests/bench/size_detector.c needs.

The plant of the model's first scenario runs without a fault until FAULT_AT; from there on with the scenario's own. Seeded: the same file every time.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "host_tools"))

from hullguard.core.library import library
from hullguard.core.native import Native, Plant
from hullguard.design.design import design
from hullguard.design.tables import SignalTable
from hullguard.model import load_model

SAMPLES = 500
FAULT_AT = 440
SEED = 1
LINE = 12  # numbers a line

HEADER = """/* Readings of model {name}, and how much its detector holds, by tests/bench/record.py; do not edit. */
#ifndef HULLGUARD_BENCH_RECORD_H
#define HULLGUARD_BENCH_RECORD_H

#include "{name}.h"

#define RECORD_NAME "{name}"
#define RECORD_SAMPLES {samples}U
#define RECORD_FAULT_AT {fault_at}U
#define RECORD_SIGNALS {signals}U
#define RECORD_WIDTH {width}U /* signals of the first group */
#define RECORD_GENERATORS {generators}U
#define RECORD_ZONOTOPES {zonotopes}U
#define RECORD_BANKS {banks}U
#define RECORD_PREDICTORS {predictors}U
#define RECORD_REALS {reals}U
#define RECORD_SUMS {sums}U
#define record_config hg_{name}_config
#define record_sender hg_{name}_sender
#define record_node_start hg_{name}_node_start
#define record_senders_start hg_{name}_senders_start
typedef hg_{name}_node record_node;
typedef hg_{name}_senders record_senders;

/* [samples][signals] */
static const int16_t record_code[] = {{
{codes}
}};

#endif
"""


def code_of(signal: SignalTable, reading: float) -> int:
    """The code nearest to a reading, kept in range: the plant is recorded, not the way the sender treats what cannot be sent."""
    return min(max(round((reading - signal.offset) / signal.resolution), signal.minimum), signal.maximum)


def record(name: str) -> str:
    """The header of a model."""
    made = design(load_model(name))[0]
    scenario = made.model.scenarios[0]
    faults = [replace(fault, start=FAULT_AT, end=None) for fault in scenario.faults]
    native = Native(library("f64"), made.tables)
    plant = Plant(native, made, scenario.reference, faults, SEED)
    signals = [s for g in made.tables.groups for s in g.signals]
    codes: list[int] = []
    for _ in range(SAMPLES):
        codes += [code_of(s, reading) for s, reading in zip(signals, plant.read(), strict=True)]
        plant.move()
    lines = [", ".join(str(c) for c in codes[i : i + LINE]) + "," for i in range(0, len(codes), LINE)]
    detector = native.node.detector
    counts = {
        "samples": SAMPLES,
        "fault_at": FAULT_AT,
        "signals": len(signals),
        "width": len(made.tables.groups[0].signals),
        "generators": detector.generators,
        "zonotopes": sum(g.zonotope is not None for g in made.tables.generators),
        "banks": detector.banks,
        "predictors": detector.predictors,
        "reals": detector.reals,
        "sums": detector.sums,
    }
    return HEADER.format(name=made.model.name, codes="\n".join(lines), **counts)


if __name__ == "__main__":
    Path(sys.argv[2]).write_text(record(sys.argv[1]), encoding="utf-8")
