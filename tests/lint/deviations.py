#!/usr/bin/env python3
"""What cppcheck and its MISRA addon say and why it stands: checks findings against the reasons, and keeps the table of them, DEVIATIONS.md.

    deviations.py check LIST FINDINGS [ROOT]    every finding has its line in LIST, and every line of LIST a finding
    deviations.py table OUT MISRA HAL           the table from the findings of both; a number above OUT's, or another table, is an error
    deviations.py table --write OUT MISRA HAL   write it where no number is above OUT's

A line of a LIST is RULE or RULE:FILE, then // and the reason. Beside a line of code a reason is a comment `deviation: RULE: reason` above the
suppression. Findings are lines FILE:LINE: RULE: text.
"""

import argparse
import re
import sys
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
FINDING = re.compile(r"^(?P<file>[^:\s]+):(?P<line>\d+): (?P<rule>[\w.-]+): ")
ENTRY = re.compile(r"^(?P<rule>[\w.-]+)(?::(?P<file>\S+))?\s+// (?P<reason>.+)$")
BESIDE = re.compile(r"deviation: (?P<rule>[\w.-]+): (?P<reason>.+?)\s*\*/")
SUPPRESS = re.compile(r"cppcheck-suppress(?:-macro|-begin|-file)? (?P<rule>[\w.-]+)")
FUNCTION = re.compile(r"^(?:#define (?P<macro>\w+)|(?!typedef|return)[a-z_][\w ]*[ *](?P<name>\w+)\()")
COUNT = re.compile(r"^\| (?P<rule>[\w.-]+) \| (?P<tree>[\w/]+) \| (?P<count>\d+) \|", re.MULTILINE)


@dataclass
class Deviation:
    """Places and reasons of one rule in one tree."""

    places: list[str] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)


def entries(path: Path) -> list[tuple[str, str, str]]:
    """(rule, file or "", reason) of a list."""
    found = []
    for line in path.read_text().splitlines():
        if line and not line.startswith("#"):
            match = ENTRY.match(line)
            if match is None:
                sys.exit(f"{path.name}: '{line}' is not RULE // reason")
            found.append((match["rule"], match["file"] or "", match["reason"]))
    return found


def findings(path: Path) -> list[tuple[str, int, str, str]]:
    """(file, line, rule, whole line); what is no finding makes the run fail."""
    found = []
    for line in path.read_text().splitlines():
        match = FINDING.match(line)
        if match is None:
            sys.exit(f"not a finding of cppcheck: {line}")
        found.append((match["file"], int(match["line"]), match["rule"], line))
    return found


def reason_of(listed: list[tuple[str, str, str]], file: str, rule: str) -> str | None:
    """The reason in the list, where there is one."""
    return next((reason for r, f, reason in listed if r == rule and f in ("", file)), None)


def check(listed: Path, found: Path) -> bool:
    """Print what has no reason, and reasons that nothing needs."""
    known = entries(listed)
    good = True
    for file, _, rule, line in findings(found):
        if reason_of(known, file, rule) is None:
            print(line)
            good = False
    for rule, file, _ in known:
        if not any(r == rule and file in ("", f) for f, _, r, _ in findings(found)):
            print(f"{listed.name}: {rule} {file} suppresses nothing any more: take it out".replace("  ", " "))
            good = False
    return good


def place(file: str, line: int) -> str:
    """FILE: FUNCTION of a line; a macro or function begins in the first column."""
    name = "file scope"
    for text in (ROOT / file).read_text().splitlines()[:line]:
        match = FUNCTION.match(text)
        if match is not None:
            name = match["macro"] or match["name"]
        elif text.startswith(("}", "typedef", "struct", "enum")):
            name = name if line and text.startswith("}") else "file scope"
    return f"{file}: {name}"


def beside(tree: Path) -> dict[str, Deviation]:
    """Suppressions that stand beside their line. One without its reason above it is an error."""
    found: dict[str, Deviation] = {}
    for source in sorted(tree.rglob("*.[ch]")):
        lines = source.read_text().splitlines()
        file = source.relative_to(ROOT).as_posix()
        for number, text in enumerate(lines, 1):
            match = SUPPRESS.search(text)
            if match is None:
                continue
            reason = BESIDE.search(lines[number - 2]) if number > 1 else None
            if reason is None or reason["rule"] != match["rule"]:
                sys.exit(f"{file}:{number}: {match['rule']} is suppressed without 'deviation: {match['rule']}: reason' in the line above")
            one = found.setdefault(match["rule"], Deviation())
            one.places.append(place(file, number + 1))
            one.reasons.append(reason["reason"])
    return found


def collect(listed: Path, found: Path, tree: str) -> dict[str, Deviation]:
    """All deviations of a tree: by its list, and beside the lines."""
    known = entries(listed)
    together = beside(ROOT / tree)
    for file, line, rule, _ in findings(found):
        one = together.setdefault(rule, Deviation())
        one.places.append(place(file, line))
        one.reasons.append(str(reason_of(known, file, rule)))
    return together


def unique(items: list[str]) -> list[str]:
    """In order, each once."""
    return list(dict.fromkeys(items))


def several(items: list[str]) -> list[str]:
    """In order, each once, with how often it occurs where that is more than once."""
    return [item if items.count(item) == 1 else f"{item} ({items.count(item)})" for item in unique(sorted(items))]


def table(trees: dict[str, dict[str, Deviation]]) -> str:
    """The page."""
    rows = [(rule, tree, deviation) for tree, all_of in trees.items() for rule, deviation in sorted(all_of.items())]
    text = [
        "# Deviations",
        "",
        "Where MISRA C:2012 (`firmware/`) or cppcheck (`hal/`) is not followed, and why. Made by `tests/lint/deviations.py` from the suppressions beside the lines",
        "and from the lists `misra.txt` and `hal.txt`; `make lint` fails when it is not up to date and when a number has grown.",
        "`make deviations` writes it anew where numbers have fallen.",
        "",
        "| rule | tree | places | reason |",
        "| --- | --- | --: | --- |",
    ]
    text += [f"| {rule} | {tree} | {len(deviation.places)} | {'; '.join(unique(deviation.reasons))} |" for rule, tree, deviation in rows]
    for rule, tree, deviation in rows:
        text += ["", f"## {rule}, {tree}", ""]
        text += [f"- {one}" for one in several(deviation.places)]
    return "\n".join(text) + "\n"


def counts(text: str) -> dict[tuple[str, str], int]:
    """Number of places by rule and tree."""
    return {(row["rule"], row["tree"]): int(row["count"]) for row in COUNT.finditer(text)}


def keep(out: Path, text: str, write: bool) -> bool:
    """Compare with the committed table; numbers may only fall."""
    before = counts(out.read_text()) if out.exists() else counts(text)
    grown = {key: n for key, n in counts(text).items() if n > before.get(key, 0)}
    for (rule, tree), n in grown.items():
        print(f"{out.name}: {rule} in {tree}: {n} places, {before.get((rule, tree), 0)} are allowed: mend the new one; numbers may only fall")
    if grown:
        return False
    if write:
        out.write_text(text)
    elif not out.exists() or out.read_text() != text:
        print(f"{out.name} is not up to date: make deviations")
        return False
    return True


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("check")
    one.add_argument("list", type=Path)
    one.add_argument("findings", type=Path)
    two = commands.add_parser("table")
    two.add_argument("--write", action="store_true")
    two.add_argument("out", type=Path)
    two.add_argument("misra", type=Path)
    two.add_argument("hal", type=Path)
    asked = parser.parse_args()
    if asked.command == "check":
        return 0 if check(asked.list, asked.findings) else 1
    trees = {"firmware": collect(HERE / "misra.txt", asked.misra, "firmware"), "hal": collect(HERE / "hal.txt", asked.hal, "hal")}
    return 0 if keep(asked.out, table(trees), asked.write) else 1


if __name__ == "__main__":
    sys.exit(main())
