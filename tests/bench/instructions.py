"""instructions.py TARGET=CROSS=EMULATOR..: instructions retired by every part of the library, on every target, over the drives of tests/bench/drive.c.

One table of means, beside the loads and multiply-accumulates that a part cannot do without (needs.py), and one of how much a step depends on its data.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from counting import REWIND, STEP, Call, CountError, count, found, parts, rows

BENCH = Path("build/bench")
FULL = 64  # samples after which every hull, window and history is full; before, radii are 0, which library calls make short work of

Figures = list[int]


@dataclass(frozen=True)
class Row:
    """A line of the table: of which drive, and what of its calls."""

    label: str
    model: str
    figures: Callable[[list[Call]], Figures]
    part: str = ""  # its name among the needs of the model


def of_part(name: str) -> Callable[[list[Call]], Figures]:
    """Instructions of a part in each step."""
    return lambda calls: [parts(s)[name] for s in found(calls, STEP)]


def of_call(name: str) -> Callable[[list[Call]], Figures]:
    """Instructions of each call of a function."""
    return lambda calls: [c.all for c in found(calls, name)]


def of_sample(calls: list[Call]) -> Figures:
    """Instructions of all that a node does for a sample: frames received, the step, the report."""
    made: Figures = []
    spent = 0
    for c in calls:
        name = c.function.name
        if name.startswith("hg_node_") and not name.endswith("_start"):
            spent += c.all
        if name == "hg_node_report":
            made.append(spent)
            spent = 0
    return made


ROWS = (
    Row("hold", "platoon", of_part("hold")),
    Row("residual", "platoon", of_part("residual"), "residual"),
    Row("hull", "platoon", of_part("hull"), "hull"),
    Row("decision", "platoon", of_part("decision")),
    Row("detector: what joins them", "platoon", of_part("detector")),
    Row("detector step, platoon", "platoon", of_call(STEP), "*"),
    Row("bank", "platoon_bank", of_part("bank"), "bank"),
    Row("detector step, platoon_bank", "platoon_bank", of_call(STEP), "*"),
    Row("detector step, openacc", "openacc", of_call(STEP), "*"),
    Row("zonotope instead of hull", "zonotope", of_part("zonotope"), "zonotope"),
    Row("predict", "derived", of_part("predict"), "predict"),
    Row("mismatch", "derived", of_part("mismatch"), "mismatch"),
    Row("e2e check, a frame", "platoon", of_call("hg_e2e_check")),
    Row("frame decode, a frame", "platoon", of_call("hg_frame_unpack")),
    Row("node receive, a frame", "platoon", of_call("hg_node_receive")),
    Row("node, a sample", "platoon", of_sample),
    Row("trigger, a sample", "platoon", of_call("hg_trigger_step")),
    Row("sender, a sample", "platoon", of_call("hg_sender_step")),
)


def needed(row: Row) -> str:
    """Loads and multiply-accumulates of a row: `L + M`, or nothing where the part has none."""
    needs = json.loads((BENCH / f"{row.model}_record.h.json").read_text(encoding="utf-8"))
    mine = list(needs.values()) if row.part == "*" else [needs[row.part]] if row.part in needs else []
    return f"{sum(n['loads'] for n in mine)} + {sum(n['macs'] for n in mine)}" if mine else ""


def means(drives: dict[tuple[str, str], list[Call]], targets: Sequence[str], markdown: bool) -> list[str]:
    """The first table."""
    body = []
    for row in (r for r in ROWS if (targets[0], r.model) in drives):
        figures = [row.figures(drives[t, row.model]) for t in targets]
        body.append((row.label, needed(row), *(f"{sum(f) / len(f):.0f}" for f in figures)))
    return rows(("mean of a drive", "loads + MACs", *targets), body, 1, markdown)


def least_and_most(steps: Sequence[Call]) -> tuple[str, str, str]:
    """Of some steps."""
    each = [s.all for s in steps]
    return str(min(each)), str(max(each)), f"{100 * (max(each) / min(each) - 1):.1f} %"


def spreads(drives: dict[tuple[str, str], list[Call]], targets: Sequence[str], models: Sequence[str], markdown: bool) -> list[str]:
    """The second table: steps without a rewind, with full histories; and those with one."""
    body = []
    for model in models:
        for t in targets:
            steps = found(drives[t, model], STEP)
            quiet = [s for s in steps[FULL:] if not s.has(*REWIND)]
            rewinds = [s for s in steps if s.has(*REWIND)]
            least, most, spread = least_and_most(quiet)
            body.append((model, t, least, most, spread, str(max(s.all for s in rewinds))))
    return rows(("step of", "target", "least", "most", "spread", "most with a rewind"), body, 2, markdown)


def varying(calls: list[Call], markdown: bool) -> list[str]:
    """Which parts depend on the data."""
    quiet = [parts(s) for s in found(calls, STEP)[FULL:] if not s.has(*REWIND)]
    names = sorted({n for q in quiet for n in q}, key=lambda n: -sum(q[n] for q in quiet))
    body = [(n, str(min(q[n] for q in quiet)), str(max(q[n] for q in quiet)), str(max(q[n] for q in quiet) - min(q[n] for q in quiet))) for n in names]
    return rows(("part", "least", "most", "differs by"), body, 1, markdown)


def main() -> int:
    """All tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--real", default="f32")
    parser.add_argument("--models", required=True, help="those there are drives of")
    parser.add_argument("--format", choices=("text", "markdown"), default="text")
    parser.add_argument("target", nargs="+", help="TARGET=CROSS=EMULATOR")
    args = parser.parse_args()
    markdown = args.format == "markdown"
    known = {name: (cross, emulator) for name, cross, emulator in (t.split("=", 2) for t in args.target)}
    models = args.models.split()
    drives: dict[tuple[str, str], list[Call]] = {}
    try:
        for target, (cross, emulator) in known.items():
            for model in models:
                drives[target, model] = count(BENCH / f"{target}-{args.real}" / model / "drive.elf", cross, emulator, BENCH / "count.so")[1]
    except CountError as error:
        print(error, file=sys.stderr)
        return 1
    targets = list(known)
    print(f"Instructions retired, numbers {args.real}, gcc -O2; under QEMU, which counts instructions and knows nothing of cycles.\n")
    print("\n".join(means(drives, targets, markdown)))
    print(f"\nHow much a step depends on its data, samples {FULL} and later without a rewind.\n")
    print("\n".join(spreads(drives, targets, ("platoon", "platoon_bank", "openacc"), markdown)))
    for target in (t for t in ("cortex_m4f", "cortex_m0") if t in known):
        print(f"\nWhere it depends on them, platoon on {target}.\n")
        print("\n".join(varying(drives[target, "platoon"], markdown)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
