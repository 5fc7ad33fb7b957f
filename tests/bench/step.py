"""step.py PROGRAM: what a step of the detector costs on a target, part by part and function by function, over the drive of tests/bench/drive.c.

CROSS and RUN in the environment are those of the target's toolchain file.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from pathlib import Path

from counting import REWIND, STEP, Call, CountError, count, found, parts


def row(name: str, each: list[int], whole: float) -> str:
    """Least, most and mean of a part's instructions in every step."""
    mean = sum(each) / len(each)
    return f"{name:<34} {min(each):>8} {max(each):>8} {mean:>10.1f} {100 * mean / whole:>6.1f} %"


def show(steps: list[Call]) -> None:
    """Parts of a step, then its functions."""
    whole = sum(s.all for s in steps) / len(steps)
    spent = [parts(s) for s in steps]
    print(f"{'instructions a step':<34} {'least':>8} {'most':>8} {'mean':>10}   share")
    print(row(STEP, [s.all for s in steps], whole))
    quiet = [s.all for s in steps if not s.has(*REWIND)]
    print(row(f"  of {len(quiet)} without a rewind", quiet, whole))
    rewinds = [s.all for s in steps if s.has(*REWIND)]
    if rewinds:
        print(row(f"  of {len(rewinds)} with one", rewinds, whole))
    print()
    for name in sorted({n for s in spent for n in s}, key=lambda n: -sum(s[n] for s in spent)):
        print(row(name, [s[name] for s in spent], whole))
    print(f"\n{'function, callees not counted':<34} {'calls':>8} {'a step':>8} {'a call':>10}   share")
    own: Counter[tuple[str, str]] = Counter()
    times: Counter[tuple[str, str]] = Counter()
    for c in (c for s in steps for c in s.walk()):
        key = (c.function.name, c.function.section.module)
        own[key] += c.self
        times[key] += 1
    for key, total in own.most_common():
        label = key[0] if key[0].startswith("hg_") else f"{key[1]}.c: {key[0]}"
        print(f"{label:<34} {times[key]:>8} {total / len(steps):>8.1f} {total / times[key]:>10.1f} {100 * total / len(steps) / whole:>6.1f} %")


def main() -> int:
    """The tables of one program."""
    elf = Path(sys.argv[1])
    try:
        said, calls = count(elf, os.environ["CROSS"], os.environ["RUN"], elf.parents[2] / "count.so")
    except CountError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{elf.parents[1].name}, {said.strip()}\n")
    show(found(calls, STEP))
    return 0


if __name__ == "__main__":
    sys.exit(main())
