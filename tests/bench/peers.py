"""peers.py TARGET=CROSS=EMULATOR..: instructions of parts of the library beside those of other libraries at work of the same size (peers.c)."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable
from pathlib import Path

from counting import STEP, Call, CountError, count, found, parts, rows

BENCH = Path("build/bench")
MODEL = "platoon"


def mean(figures: list[int]) -> float:
    """Of all calls."""
    return sum(figures) / len(figures)


def part(name: str) -> Callable[[list[Call]], float]:
    """A part of the detector, a step."""
    return lambda calls: mean([parts(s)[name] for s in found(calls, STEP)])


def calls_of(*names: str) -> Callable[[list[Call]], float]:
    """Functions called once each."""
    return lambda calls: sum(mean([c.all for c in found(calls, n)]) for n in names)


def table(head: list[str], counts: list[tuple[list[Call], list[Call]]], shape: dict[str, int], markdown: bool) -> list[str]:
    """Ours, then theirs, pair by pair; the head names the targets."""
    hull = f"{shape['HULL_ROWS']} x {shape['HULL_COLUMNS']}"
    fir = f"{shape['HULL_ROWS'] * shape['HULL_WIDTH']} filters of {shape['HULL_COLUMNS'] // shape['HULL_WIDTH']} taps"
    filter_ = f"{shape['STATES']} states, {shape['MEASUREMENTS']} measurements"
    ours: list[tuple[str, Callable[[list[Call]], float]]] = [
        ("hull: threshold of all residuals", part("hull")),
        ("residual: step of the generator", part("residual")),
        ("detector step, hold to decision", calls_of(STEP)),
        ("e2e check and decode of a frame", calls_of("hg_e2e_check", "hg_frame_unpack")),
    ]
    theirs = [
        [(f"CMSIS-DSP arm_mat_vec_mult_f32, {hull}", "peer_hull"), (f"CMSIS-DSP arm_fir_f32, {fir}", "peer_fir")],
        [(f"CMSIS-DSP arm_mat_vec_mult_f32, {shape['RESIDUAL_ROWS']} x {shape['RESIDUAL_COLUMNS']}", "peer_residual")],
        [(f"ikalman update(), {filter_}", "peer_kalman")],
        [("cantools unpack and pycrc CRC-8 of a frame", "peer_frame")],
    ]
    body = []
    for (label, figure), others in zip(ours, theirs, strict=True):
        body.append(("hullguard", label, *(f"{figure(own):.0f}" for own, _ in counts)))
        body += [("other", what, *(f"{calls_of(name)(peers):.0f}" for _, peers in counts)) for what, name in others]
    return rows(["", *head], body, 2, markdown)


def main() -> int:
    """One table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--real", default="f32")
    parser.add_argument("--format", choices=("text", "markdown"), default="text")
    parser.add_argument("target", nargs="+", help="TARGET=CROSS=EMULATOR")
    args = parser.parse_args()
    known = [t.split("=", 2) for t in args.target]
    header = (BENCH / f"{MODEL}_record.h").read_text(encoding="utf-8")
    shape = {m[1]: int(m[2]) for m in re.finditer(r"^#define RECORD_(\w+) (\d+)$", header, re.MULTILINE)}
    try:
        counts = [
            (
                count(BENCH / f"{t}-{args.real}" / MODEL / "drive.elf", cross, run, BENCH / "count.so")[1],
                count(BENCH / "peers" / t / "peers.elf", cross, run, BENCH / "count.so", lambda f: f.name.startswith("peer_") and f.section.module == "peers")[1],
            )
            for t, cross, run in known
        ]
    except CountError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"\nInstructions of model {MODEL} beside other libraries at work of the same size, in float, all by gcc -O2 (CMSIS-DSP with unrolled loops).\n")
    print("\n".join(table(["instructions a call, mean", *(t for t, _, _ in known)], counts, shape, args.format == "markdown")))
    return 0


if __name__ == "__main__":
    sys.exit(main())
