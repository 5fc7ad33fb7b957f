#!/usr/bin/env python3
"""Lines, branches and conditions (MC/DC) of the library that its unit tests cover, from the coverage of each build: coverage.py FOLDER BUILD...

What one build covers counts for all: a condition is covered where some build's tests show that it alone changes its decision (unique cause, or masked by
short-circuit evaluation). A condition that is a constant in every build that has it has nothing to show. A number must not be below all there is,
except for what tests/unit/coverage.toml names, each with its reason; an entry that names nothing uncovered is an error too.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "promises"))
from result import write_to

FILES = "firmware/include/", "firmware/src/"
Place = tuple[str, int, int, int, int]  # file, line and column of the first character, of the one behind the last


@dataclass
class Covered:
    """What was seen of every place, all builds so far together."""

    regions: defaultdict[Place, int] = field(default_factory=lambda: defaultdict(int))
    branches: defaultdict[Place, list[int]] = field(default_factory=lambda: defaultdict(lambda: [0, 0]))
    conditions: dict[tuple[str, str, int], tuple[str, set[str]]] = field(default_factory=dict)  # (file, decision, number): place, what builds say of it


def tool(*command: str) -> str:
    """Output of a command that must work."""
    return subprocess.run(command, capture_output=True, check=True, encoding="utf-8").stdout


def ours(name: str) -> str | None:
    """A file of the library by its path in the repository."""
    path = os.path.relpath(name)
    return path if path.startswith(FILES) else None


def add_counts(seen: Covered, exported: str) -> None:
    """Regions and branches; a condition that is a constant here has no branch."""
    for function in json.loads(exported)["data"][0]["functions"]:
        files = [ours(name) for name in function["filenames"]]
        for region in function["regions"]:
            name = files[region[5]]
            if name and region[7] == 0 and region[:2] != region[2:4]:  # code; what has no extent is a constant's other branch in a macro
                seen.regions[(name, *region[:4])] += region[4]
        for branch in function["branches"]:
            name = files[branch[6]]
            if name:
                count = seen.branches[(name, *branch[:4])]
                count[0] += branch[4]
                count[1] += branch[5]


def add_conditions(seen: Covered, shown: str) -> None:
    """Independence pairs, which only the readable output tells from constants."""
    name: str | None = None
    decision = ""
    places: list[str] = []
    for line in shown.splitlines():
        if match := re.fullmatch(r"([^\s|]+\.[ch]):", line):
            name = ours(match[1])
        elif match := re.search(r"MC/DC Decision Region \((.*)\) to", line):
            decision, places = match[1], []
        elif match := re.search(r"Condition C\d+ --> \((.*)\)", line):
            places.append(match[1])
        elif name and (match := re.search(r"C(\d+)-Pair: (covered|not covered|constant folded)", line)):
            number = int(match[1])
            seen.conditions.setdefault((name, decision, number), (places[number - 1], set()))[1].add(match[2])


def source(place: Place) -> str:
    """The text at a place, its first line."""
    name, line, column, last_line, last_column = place
    text = Path(name).read_text(encoding="utf-8").splitlines()[line - 1]
    return text[column - 1 : last_column - 1 if last_line == line else None].strip()


def uncovered(seen: Covered) -> Iterable[tuple[str, str]]:
    """What is missing: file and source text; what and where."""
    for place, count in sorted(seen.regions.items()):
        if count == 0:
            yield f"{place[0]}: {source(place)}", f"line {place[1]}: never run"
    for place, (true, false) in sorted(seen.branches.items()):
        if not (true and false):
            yield f"{place[0]}: {source(place)}", f"line {place[1]}: never {'true' if not true else 'false'}"
    for (name, decision, number), (place_of, said) in sorted(seen.conditions.items()):
        if "covered" not in said and "not covered" in said:
            line, column = (int(part) for part in decision.split(":"))
            yield f"{name}: {source((name, line, column, 0, 0))}", f"decision {decision}, condition {number} at {place_of}: never alone decides"


def read_build(seen: Covered, folder: Path, build: str) -> None:
    """Add one build: all its programs together."""
    programs = sorted(program.with_suffix("") for program in (folder / build).glob("*.profraw"))
    objects = [word for program in programs for word in ("--object", str(program))]
    profile = f"--instr-profile={folder / build}.profdata"
    tool("llvm-profdata-19", "merge", "-sparse", *(f"{program}.profraw" for program in programs), "-o", f"{folder / build}.profdata")
    add_counts(seen, tool("llvm-cov-19", "export", "--skip-expansions", profile, *objects))
    add_conditions(seen, tool("llvm-cov-19", "show", "--show-mcdc", "--show-instantiations=false", profile, *objects))


def judge(seen: Covered, allowed: dict[str, str]) -> list[str]:
    """Faults of coverage and of the table of what is allowed."""
    missing = list(uncovered(seen))
    named = {text for text, _ in missing}
    faults = [f"{text}: {what}" for text, what in missing if text not in allowed]
    return faults + [f"tests/unit/coverage.toml: nothing uncovered at {text!r}" for text in allowed if text not in named]


def main() -> int:
    """Judge the builds, say what is missing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path, help="where the builds are")
    parser.add_argument("builds", nargs="+", help="f32, ..: folders in it, with test programs and their .profraw")
    parser.add_argument("--results", type=Path, help="write what holds to this file")
    arguments = parser.parse_args()
    seen = Covered()
    for build in arguments.builds:
        read_build(seen, arguments.folder, build)
    table = tomllib.loads(Path("tests/unit/coverage.toml").read_text(encoding="utf-8"))
    allowed = {f"{entry['file']}: {entry['text']}": entry["why"] for entry in table.get("uncovered", [])}
    faults = judge(seen, allowed)
    if len(allowed) > table["most"]:
        faults.append(f"tests/unit/coverage.toml: {len(allowed)} places, more than the {table['most']} that it allows")
    shown = [1 for _, said in seen.conditions.values() if said != {"constant folded"}]
    if not (seen.regions and seen.branches and shown):
        faults.append(f"of {len(seen.regions)} places, {len(seen.branches)} branches and {len(shown)} conditions one is none: what llvm-cov says was not understood")
    lines = {(place[0], line) for place in seen.regions for line in range(place[1], place[3] + 1)}
    result = (
        f"{len(lines)} lines, {2 * len(seen.branches)} branch outcomes, {len(shown)} conditions in {len(arguments.builds)} builds ({', '.join(arguments.builds)}), "
        f"all covered but {len(allowed)} places marked with a reason"
    )
    for fault in faults:
        print(fault, file=sys.stderr)
    if not faults:
        print(f"coverage: {result}")
        if arguments.results:
            promise = "every line, branch and condition (MC/DC) of the library is covered by its unit tests"
            write_to(arguments.results, [(promise, result)])
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
