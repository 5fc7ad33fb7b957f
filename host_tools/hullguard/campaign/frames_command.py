"""`hullguard campaign MODEL --inject SPEC`: faulty frames instead of a grid of losses."""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

from rich.console import Console
from rich.table import Table

from hullguard.campaign.frames import Tally
from hullguard.campaign.frames_all import CLASSES, HEAVY, SEEN, FrameCase, all_cases, case_of
from hullguard.campaign.frames_study import CHUNK, FramesJob, codec_for, failures, pooled, residual_rate, rows, study
from hullguard.commands import emit, make_folder, prepared, progress, say, the_faults
from hullguard.core.native import Frame
from hullguard.design.design import Design
from hullguard.design.protection import NO_STAMP
from hullguard.errors import ExpectationError, InputError
from hullguard.inject.codec import Codec
from hullguard.inject.engine import Injector
from hullguard.model.schema import Scenario

ALL = "all"
SAID = {"stamp": "early or late"}
WIDTH = 160  # columns where the output is no terminal
UNUSED: dict[str, Any] = {
    "loss": "0", "loss_burst": "0", "size": None, "each_fault": False, "vary": [], "limit": False, "plants": 0, "attack": 0.0, "scheduler": None, "table": None,
}  # fmt: skip


def run_frames(args: argparse.Namespace) -> int:
    """Inject, count, compare; status 1 when a counter differs from the ledger or a class does not hold."""
    for name, default in UNUSED.items():
        if getattr(args, name) != default:
            raise InputError(f"--{name.replace('_', '-')} and --inject do not go together: faulty frames are made one by one; use a campaign of its own for each")
    model, made = prepared(args)
    scenario = model.scenario(args.scenario)
    samples = args.samples or _samples(args, scenario)
    end = samples // 2
    faults = the_faults(args, model, scenario.faults, samples)
    if any(f.start >= end for f in faults):
        raise InputError(f"frames are tampered with until sample {end}, half of the run: let the fault start before, or use --samples")
    cases = _cases(args, made, end)
    job = FramesJob(made.model, made.stored, args.real, scenario, samples, end, tuple(faults), args.seed)
    began = time.monotonic()
    chunks = -(-args.runs // CHUNK) * len(cases)
    with progress(args, "faulty frames") as tick:
        done = 0

        def more(count: int) -> None:
            nonlocal done
            done += count
            tick("tasks", done, chunks)

        tallies = study(job, cases, args.runs, args.workers or os.cpu_count() or 1, more)
    found = rows(cases, tallies, made)
    failed, together = failures(found), pooled(found)
    result = {
        "model": model.name, "scenario": scenario.name, "seed": args.seed, "samples": samples, "tampered_until": end, "runs": sum(r["runs"] for r in found),
        "frames": sum(r["frames"] for r in found), "injected": sum(r["injected"] for r in found), "faults": [str(f) for f in faults], "rows": found,
        "damaged": together, "failures": failed,
    }  # fmt: skip
    if args.out:
        _write(Path(args.out), result, cases, tallies)
    if not args.quiet:
        show(found, sys.stderr if args.json else sys.stdout)
    if together["tried"]:
        low, high = together["interval"]
        say(args, f"of {together['tried']} heavily damaged frames {together['passed']} passed the checksum, expected {together['expected']:.1f} ({low} .. {high})")
    said = f"{result['injected']} faulty frames in {result['runs']} runs of {samples} samples, {time.monotonic() - began:.0f} s"
    say(args, f"{said}; frames are tampered with until sample {end} where nothing else is said")
    emit(args, result)
    if failed:
        raise ExpectationError("; ".join(failed[:3]) + (f"; and {len(failed) - 3} more" if len(failed) > 3 else ""))
    return 0


def _samples(args: argparse.Namespace, scenario: Scenario) -> int:
    """Length of a run where none is asked for: the scenario's, or more, so that its own faults begin while frames are tampered with."""
    own = [] if args.no_fault or args.fault else scenario.faults
    return max([scenario.samples, *(3 * f.start for f in own)])


def _cases(args: argparse.Namespace, made: Design, end: int) -> list[FrameCase]:
    codec = codec_for(made)
    cases: list[FrameCase] = []
    for spec in args.inject:
        cases += all_cases(made.model, made.tables, codec, end // 5, end) if spec == ALL else [_windowed(case_of(spec), end, made.model.sample_time_s)]
    return [_judged(c, made, codec) for c in cases]


def _windowed(case: FrameCase, end: int, period_s: float) -> FrameCase:
    """A user's directive, where it names no time of its own, between two samples: what is lost first or last no receiver can count."""
    t = case.directive.trigger
    if t.k_start is not None or t.at_s is not None or t.start_s > 0.0 or t.end_s < math.inf:
        return case
    window = f"from={end // 5 * period_s:g},to={end * period_s:g}" if t.timed else f"k={end // 5}..{end}"
    return case_of(case.spec + ("," if "@" in case.spec else "@") + window)


def _judged(case: FrameCase, made: Design, codec: Codec) -> FrameCase:
    """The case in its class on these messages; refuses what cannot be, or cannot be counted, before the work begins."""
    injector = Injector([case.directive], codec)
    messages = [(g.name, g.message) for g in made.tables.groups if injector.wants(Frame(g.message.id, g.message.flags, b""))]
    for name, message in messages:
        if message.protection.stamp == NO_STAMP:
            raise InputError(f"{case.spec}: frames of '{name}' carry no sample index, so that nothing says how each must be counted; name other groups with id=")
    d = case.directive
    if case.kind != SEEN or d.action != "corrupt":
        return case
    bits = int(d.options.get("bits", "1"))
    return replace(case, kind=HEAVY) if any(residual_rate(m, min(bits, 8 * m.length)) > 0.0 for _, m in messages) else case


def _write(out: Path, result: dict[str, Any], cases: Sequence[FrameCase], tallies: Sequence[Tally]) -> None:
    """frames.json, and passes.csv: every damaged frame that a checksum let pass."""
    make_folder(out)
    (out / "frames.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    with (out / "passes.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["directive", "run", "time_s", "frame", "content", "counted_as"])
        for c, t in zip(cases, tallies, strict=True):
            writer.writerows([c.spec, run, f"{time_s:.6f}", *rest] for run, time_s, *rest in t.passes)


def show(rows: Sequence[dict[str, Any]], file: TextIO) -> None:
    """A line a directive, by class."""
    console = Console(file=file, highlight=False)
    if not console.is_terminal:
        console.width = WIDTH
    for kind, about in CLASSES.items():
        chosen = [r for r in rows if r["class"] == kind]
        if not chosen:
            continue
        table = Table(box=None)
        for name in ("directive", "injected", "counted as", "ledger", "false alarms", "faults found"):
            table.add_column(name, justify="right" if name == "injected" else "left", no_wrap=name != "counted as")
        for r in chosen:
            alarms = f"{r['confirmed']} confirmed, {r['provisional']} provisional"
            ledger = "equal" if r["equal"] else "DIFFERS"
            table.add_row(r["spec"].split("@")[0] + _where(r["spec"]), str(r["injected"]), _counted(r), ledger, alarms, f"{r['found']} of {r['faults']}")
        console.print(f"{kind}: {about}")
        console.print(table)


def _where(spec: str) -> str:
    found = [p.removeprefix("id=") for p in spec.partition("@")[2].split(",") if p.startswith("id=")]
    return f" on {found[0]}" if found else ""


def _counted(r: dict[str, Any]) -> str:
    said = ", ".join(f"{SAID.get(name, name)} {n}" for name, n in r["counted"].items()) or f"lost {r['health']['lost']}"
    if r["class"] == HEAVY:
        said += f" ({r['passed']} passed, expected {r['interval'][0]} .. {r['interval'][1]})"
    return said
