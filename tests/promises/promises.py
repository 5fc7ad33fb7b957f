"""promises.py [--check GATE ..]: tests/PROMISES.md from what every gate wrote when it last passed (build/results/GATE.json, see result.py).

With --check nothing is written. Each GATE must have left a result, and every gate that did must promise what the committed page says: its name, its command
and the sentences. The column of results is not compared: tools differ in what they count, and most of the numbers grow with the code.
"""

from __future__ import annotations

import difflib
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "tests" / "PROMISES.md"
HEAD = """# What is promised, and the command that checks it

Made by `make promises` from what every gate wrote when it last passed; `make check` fails where the gates promise something else than this page says. Results
are those of one run: tools count differently, and most numbers grow with the code, so they are not compared. What the gates would miss if they
were blind is shown by `make seeded`: realistic faults, each of which turns its gate red.
"""


@dataclass(frozen=True)
class Gate:
    """A gate, the command that runs it, and its promises with their results."""

    name: str
    command: str
    promises: tuple[tuple[str, str], ...]

    def lines(self, results: bool) -> list[str]:
        """Its part of the page."""
        rows = [f"| {p} | {r} |" if results else f"| {p} |" for p, r in self.promises]
        return [f"## {self.name}", "", f"`{self.command}`", "", "| promise | last result |" if results else "| promise |", "| --- | --- |" if results else "| --- |", *rows, ""]


def written(folder: Path) -> list[Gate]:
    """The gates that have passed, by name."""
    gates = []
    for file in sorted(folder.glob("*.json")):
        said = json.loads(file.read_text(encoding="utf-8"))
        if said["gate"] != file.stem:
            sys.exit(f"promises.py: {file.name} is of another gate, {said['gate']}")
        gates.append(Gate(said["gate"], said["command"], tuple((p["promise"], p["result"]) for p in said["promises"])))
    return gates


def committed(text: str) -> list[Gate]:
    """The gates of a page."""
    gates = []
    for part in text.split("\n## ")[1:]:
        lines = part.splitlines()
        rows = [line.strip("| ").split(" | ") for line in lines if line.startswith("| ")][2:]
        gates.append(Gate(lines[0], next(line.strip("`") for line in lines if line.startswith("`")), tuple((row[0], row[1]) for row in rows)))
    return gates


def page(gates: list[Gate], results: bool = True) -> list[str]:
    """All of it."""
    return [*HEAD.splitlines(), "", *[line for gate in gates for line in gate.lines(results)]][:-1]


def check(wanted: list[str], found: list[Gate]) -> int:
    """How many things are wrong; each is said."""
    names = {gate.name for gate in found}
    silent = sorted(set(wanted) - names)
    for name in silent:
        print(f"promises: {name} has left no result in build/results; the last line of its recipe is for that (tests/promises/result.py)", file=sys.stderr)
    # Of gates that were not run here (make check without make test) the page is believed.
    told = committed(PAGE.read_text(encoding="utf-8")) if PAGE.is_file() else []
    gone = [gate for gate in told if gate.name in names]
    differing = list(difflib.unified_diff(page(gone, False), page(found, False), "tests/PROMISES.md", "build/results", lineterm="", n=0))
    for line in differing:
        print(line, file=sys.stderr)
    if differing:
        print("promises: the page is not what the gates promise: make promises, look at the difference, commit it", file=sys.stderr)
    return len(silent) + len(differing)


def main() -> int:
    """Write the page, or check it."""
    found = written(Path(os.environ.get("BUILD", "build")) / "results")
    if sys.argv[1:2] == ["--check"]:
        wrong = check(sys.argv[2:], found)
        if not wrong:
            print(f"  ok  {sum(len(g.promises) for g in found)} promises of {len(found)} gates, as on tests/PROMISES.md")
        return 1 if wrong else 0
    kept = {gate.name: gate for gate in (committed(PAGE.read_text(encoding="utf-8")) if PAGE.is_file() else [])}
    kept.update({gate.name: gate for gate in found})
    for name in sorted(set(kept) - set(sys.argv[1:])):
        kept.pop(name)
    PAGE.write_text("\n".join(page([kept[name] for name in sorted(kept)])) + "\n", encoding="utf-8")
    missing = sorted(set(sys.argv[1:]) - set(kept))
    print(f"wrote tests/PROMISES.md{'; no result yet of: ' + ', '.join(missing) if missing else ''}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
