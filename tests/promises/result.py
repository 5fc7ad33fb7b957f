"""What a gate says of itself when it passes: result.py GATE PROMISE RESULT [PROMISE RESULT ..] writes build/results/GATE.json, from which tests/PROMISES.md is made.

A promise is one sentence of what holds, without numbers that a run measures; its result is one short line with them, the same in every run where the tool's are.
In make: the last line of a gate's recipe, `@$(RESULT) $@ '..' '..'`. In Python: `from result import write`.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

Said = tuple[str, str]
"""A promise and its result."""


def write(gate: str, said: list[Said], command: str = "") -> None:
    """Leave what `gate` (a make target, run by `command`) promises in $BUILD/results (build/results), in place of what it said before."""
    write_to(Path(os.environ.get("BUILD", "build")) / "results" / f"{gate}.json", said, command)


def write_to(file: Path, said: list[Said], command: str = "") -> None:
    """The same in a file that is named after the gate."""
    gate = file.stem
    for promise, result in said:
        if not promise.strip() or not result.strip() or "\n" in promise + result or "|" in promise + result:
            sys.exit(f"result.py: {gate}: a promise and its result are one line each, not empty and without |: {promise!r}, {result!r}")
    file.parent.mkdir(parents=True, exist_ok=True)
    found = {"gate": gate, "command": command or f"make {gate}", "promises": [{"promise": p, "result": r} for p, r in said]}
    file.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    words = sys.argv[2:]
    if not words or len(words) % 2:
        sys.exit("usage: result.py GATE PROMISE RESULT [PROMISE RESULT ..]")
    write(sys.argv[1], list(zip(words[::2], words[1::2], strict=True)))
