#!/usr/bin/env python3
"""Prove the kernels' contracts for any input: contracts go into a copy of the library, Frama-C WP makes goals of them, z3 proves each.

    wp.py RESULT WORK [--deep | CASE ..]    CASE: tests/framac/wp/CASE.acsl; without one all but those that take long, --deep: all

A .acsl file: `file PATH`, `real f32|q31`, `functions NAME ..`, `take CASE ..` (what that case says of headers, proven there, holds here), `goals N`, `deep` where
they take long; then blocks, each `before TEXT` (a line of the source, blanks at its ends aside, that stands there once; `first TEXT` to `eleventh TEXT`: that of
several; `in PATH` before it: of another file) and the annotation that goes before that line.
A number of goals that is not N is an error, so that none vanishes. Lemmas, which goals rest on, are proved as well, and count.
"""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "promises"))
from result import write_to

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
TIMEOUT_S = 20  # of one goal; most take less than 0.1
Z3_OPTION = "smt.auto_config=false"  # where products meet quantifiers the tactics that z3 chooses by itself do not end
ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth", "eleventh")
PROVED = re.compile(r"Proved goals:\s+(\d+) / (\d+)")

Block = tuple[str, str, int | None, list[str]]  # file, the line it goes before, which of several such, annotation


@dataclass
class Case:
    """One file with contracts."""

    name: str
    file: str = ""
    real: str = "f32"
    functions: list[str] = field(default_factory=list)
    takes: list[str] = field(default_factory=list)
    goals: int = 0
    deep: bool = False
    blocks: list[Block] = field(default_factory=list)


def read(path: Path) -> Case:
    """A .acsl file."""
    case = Case(path.stem)
    into = ""
    for line in path.read_text().splitlines():
        key, _, rest = line.partition(" ")
        if key == "before" or key in ORDINALS:
            case.blocks.append((into or case.file, rest.strip(), ORDINALS.index(key) if key in ORDINALS else None, []))
        elif key == "in":
            into = rest
        elif case.blocks:
            case.blocks[-1][3].append(line)
        elif key == "file":
            case.file = rest
        elif key == "real":
            case.real = rest
        elif key == "functions":
            case.functions += rest.split()
        elif key == "take":
            case.takes += rest.split()
        elif key == "goals":
            case.goals = int(rest)
        elif line == "deep":
            case.deep = True
        elif line and not line.startswith("#"):
            sys.exit(f"{path.name}: '{line}' is neither a key nor in a block")
    return case


def taken(case: Case, known: dict[str, Case], before: frozenset[str] = frozenset()) -> list[Block]:
    """Blocks of headers from the cases that this one takes, and from those that they take, each once."""
    blocks: list[Block] = []
    for name in case.takes:
        if name not in known or name == case.name or name in before:
            sys.exit(f"{case.name}.acsl: takes {name}, which is no other case, or takes this one")
        other = known[name]
        new = [*taken(other, known, before | {case.name}), *(block for block in other.blocks if block[0].endswith(".h"))]
        blocks += [block for block in new if block not in blocks]
    return blocks


def place_of(case: Case, block: Block, lines: list[str]) -> int:
    """The line that a block goes before."""
    file, anchor, which, _ = block
    places = [number for number, text in enumerate(lines) if text.strip() == anchor]
    if len(places) <= (which or 0) or (len(places) > 1 and which is None):
        sys.exit(f"{case.name}.acsl: '{anchor}' stands {len(places)} times in {file}; it must be there once, or as often as `{ORDINALS[0]}` to `{ORDINALS[-1]}` say")
    return places[which or 0]


def annotate(case: Case, blocks: list[Block], tree: Path) -> None:
    """Put the contracts into the copy."""
    for block in blocks:
        target = tree / block[0]
        lines = target.read_text().splitlines()
        place = place_of(case, block, lines)
        lines[place:place] = block[3]
        target.write_text("\n".join(lines) + "\n")


def look_up(case: Case) -> None:
    """The lines of a case must be there, also where it is not proven now."""
    for block in case.blocks:
        place_of(case, block, (ROOT / block[0]).read_text().splitlines())


def environment(work: Path) -> dict[str, str]:
    """Why3 finds its provers in a file of this build, nothing in the home directory."""
    config = work / "why3.conf"
    own = {**os.environ, "WHY3CONFIG": str(config)}
    if not config.exists() or Z3_OPTION not in config.read_text():
        config.unlink(missing_ok=True)
        for tool in ("frama-c", "why3", "z3"):
            if shutil.which(tool) is None:
                sys.exit(f"{tool} is missing: host_tools/setup.sh check")
        subprocess.run(["why3", "config", "detect"], env=own, check=True, capture_output=True)
        found, number = re.subn(r'^path = "(.*/z3)"$', rf'path = "\1 {Z3_OPTION}"', config.read_text(), flags=re.MULTILINE)
        if number == 0:
            sys.exit("why3 does not know this z3: host_tools/setup.sh check")
        config.write_text(found)
    return own


def command_of(case: Case, include: Path, what: list[str]) -> list[str]:
    """Frama-C for the goals that `what` says; the source is still missing."""
    command = ["frama-c", "-machdep", "gcc_x86_64", f"-cpp-extra-args=-I{include} -DHG_REAL_{case.real.upper()}=1", "-warn-special-float", "none"]
    return [*command, "-wp", "-wp-rte", "-wp-prover", "z3", "-wp-timeout", str(TIMEOUT_S), "-wp-par", "1", "-wp-cache", "none", *what]


def prove(case: Case, known: dict[str, Case], work: Path, env: dict[str, str]) -> bool:
    """Run one case; print what is not proved."""
    tree = work / case.name
    shutil.rmtree(tree, ignore_errors=True)
    shutil.copytree(ROOT / "firmware", tree / "firmware", ignore=shutil.ignore_patterns("models", "apps", "examples", "zephyr"))
    annotate(case, [*taken(case, known), *case.blocks], tree)
    include = tree / "firmware/include"
    source = tree / case.file
    if source.suffix == ".h":
        source = tree / "wp.c"
        source.write_text(f'#include "{case.file.removeprefix("firmware/include/")}"\n')
    lemmas = any("/*@ lemma " in line for *_, block in case.blocks for line in block)
    wanted = [["-wp-fct", ",".join(case.functions)], *([["-wp-prop", "@lemma"]] if lemmas else [])]
    text, proved, goals = "", 0, 0
    for what in wanted:
        done = subprocess.run([*command_of(case, include, what), str(source)], env=env, capture_output=True, text=True, check=False)
        text += done.stdout + done.stderr
        match = PROVED.search(done.stdout)
        if done.returncode != 0 or match is None:
            print(f"{case.name}: frama-c failed:\n{text[-1500:]}")
            return False
        proved, goals = proved + int(match[1]), goals + int(match[2])
    (work / f"{case.name}.log").write_text(text)
    for line in re.findall(r"^\[wp\] \[.*\] Goal (\S+ : (?:Failed|Unknown|Timeout|Stepout))", text, re.MULTILINE):
        print(f"{case.name}: not proved: {line}")
    if goals != case.goals:
        print(f"{case.name}: {goals} goals, {case.goals} expected: contracts have changed, or vanished")
    return proved == goals == case.goals


def main() -> int:
    """Command line."""
    result, work = Path(sys.argv[1]), Path(sys.argv[2]).resolve()
    known = {path.stem: read(path) for path in sorted((HERE / "wp").glob("*.acsl"))}
    names = sys.argv[3:] or [name for name, case in known.items() if not case.deep]
    names = list(known) if names == ["--deep"] else names
    if unknown := [name for name in names if name not in known]:
        sys.exit(f"wp: there is no case {', '.join(unknown)}; choose of {', '.join(known)}")
    work.mkdir(parents=True, exist_ok=True)
    env = environment(work)
    cases = [known[name] for name in names]
    for case in [] if sys.argv[3:] else known.values():
        look_up(case)
    good = [prove(case, known, work, env) for case in cases]
    if not all(good):
        return 1
    goals, functions = sum(case.goals for case in cases), len({name for case in cases for name in case.functions})
    text = f"{functions} functions, {goals} goals, all proved by z3"
    if sys.argv[3:] in ([], ["--deep"]):
        said = [
            "Saturating counters and the sums of fixed point stop at their ends, are exact inside them, and have no undefined behaviour, for any input",
            "Rows times a vector, roots, rings, residuals, what a threshold takes of its signals, checksums, seals, walks over tables, and checks of observers touch no "
            + "memory but what their sizes say, whatever these are, and every loop ends",
        ]
        if "--deep" in sys.argv:
            said.append(
                "The same of the checks of all tables but those of zonotopes, isolations and frames; of triggers, senders, holds, links and nodes, frames and their "
                "protection, freeze frames, messages' digests; of predictions, radii of the past, banks, alarms and their causes; of a fusion filter's update, prediction "
                "and the test of its sensors' consistency, a tracker's links and verdict, the columns of zonotopes, the regression of an isolation, and a polynomial filter"
            )
        write_to(result, [(promise, text) for promise in said])
    print(f"  ok  wp: {text}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
