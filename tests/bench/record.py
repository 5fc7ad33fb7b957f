"""record.py MODEL NAME FILE [KEY=VALUE..]: readings of a model's emulated plant as a C header for tests/bench/drive.c, in codes of the wire, and the
counts that tests/bench/size_detector.c needs. Beside it, FILE.json: what each part of the detector cannot do without (needs.py). NAME is what the
bench calls the model with these keys overridden.

The plant of the model's first scenario runs without a fault until FAULT_AT; from there on with the scenario's own. Seeded: the same file every time.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "host_tools"))

from needs import needs

from hullguard.core.library import library
from hullguard.core.native import Native, Plant
from hullguard.design.design import Design, design
from hullguard.design.tables import SignalTable
from hullguard.model import load_model, parse_override

SAMPLES = 500
FAULT_AT = 440
SEED = 1
LINE = 12  # numbers a line

HEADER = """/* Readings of model {name}, and how much its detector holds, by tests/bench/record.py; do not edit. */
#ifndef HULLGUARD_BENCH_RECORD_H
#define HULLGUARD_BENCH_RECORD_H

#include "{name}.h"

#define RECORD_NAME "{title}"
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
/* Of its first generator: shapes of a matrix with as many multiply-accumulates as threshold and residuals have. */
#define RECORD_HULL_ROWS {hull_rows}
#define RECORD_HULL_COLUMNS {hull_columns}
#define RECORD_HULL_WIDTH {hull_width}
#define RECORD_RESIDUAL_ROWS {residual_rows}
#define RECORD_RESIDUAL_COLUMNS {residual_columns}
#define RECORD_STATES {states}
#define RECORD_MEASUREMENTS {measurements}
#define record_config hg_{name}_config
#define record_sender hg_{name}_sender
#define record_node_start hg_{name}_node_start
#define record_senders_start hg_{name}_senders_start
typedef hg_{name}_node record_node;
typedef hg_{name}_senders record_senders;

/* [samples][signals] */
static const int32_t record_code[] = {{
{codes}
}};

#endif
"""


def code_of(signal: SignalTable, reading: float) -> int:
    """The code nearest to a reading, kept in range: the plant is recorded, not the way the sender treats what cannot be sent."""
    return min(max(round((reading - signal.offset) / signal.resolution), signal.minimum), signal.maximum)


def record(made: Design, title: str) -> str:
    """The header of a model."""
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
    g = made.tables.generators[0]
    counts |= {
        "hull_rows": len(g.output),
        "hull_columns": needs(made.tables)["hull"].macs // len(g.output) if g.zonotope is None else 0,
        "hull_width": len(g.wide),
        "residual_rows": len(g.state) + len(g.output),
        "residual_columns": len(g.state) + len(g.signal),
        "states": len(g.state),
        "measurements": sum(i in made.model.outputs for i in g.signal),
    }
    return HEADER.format(name=made.model.name, title=title, codes="\n".join(lines), **counts)


def main() -> None:
    """Both files."""
    name, title, header, *words = sys.argv[1:]
    made = design(load_model(name, dict(parse_override(word) for word in words)))[0]
    Path(header).write_text(record(made, title), encoding="utf-8")
    Path(f"{header}.json").write_text(json.dumps({part: asdict(need) for part, need in needs(made.tables).items()}), encoding="utf-8")


if __name__ == "__main__":
    main()
