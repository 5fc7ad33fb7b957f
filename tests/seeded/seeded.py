"""seeded.py [--all] [--gate GATE .. [--fault NAME]] [--gates GATE ..]: proof that the gates can fail. Realistic faults are put into a copy of
the tree, one at a time, and each must turn its gate red.

tests/seeded/GATE.toml holds [[fault]] tables: name; file, old, new (the text `old`, there exactly once, becomes `new`); why; gate, the command as a list of
words, run in the copy; expect, a text that must stand in its output, so that it fails for the right reason. Without --all a draw (HULLGUARD_SEED) takes one
fault of each gate; with it all are taken, and each command must also pass in the copy as it is. A gate of --gates without a fault is an error, and so is a file of
no gate; NAME-quick and NAME-short may have their faults in NAME.toml.

The copies stand in build/seeded, one a process. They begin as the tree and its build directory are and are brought back to that after every fault, with the times of all
files, so that make builds only what the fault touches.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import Queue
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "promises"))
from result import write

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("BUILD", "build"))
SEED = int(os.environ.get("HULLGUARD_SEED") or int.from_bytes(os.urandom(4), "little"))
TIME_LIMIT_S = 600
CACHES = ("host_tools/.mypy_cache", "host_tools/.ruff_cache")


@dataclass(frozen=True)
class Fault:
    """One entry, of the gate its file is named after."""

    of: str
    name: str
    file: str
    old: str
    new: str
    why: str
    gate: tuple[str, ...]
    expect: str

    def check(self) -> str:
        """What is wrong with the entry itself; empty when nothing is."""
        file = ROOT / self.file
        if not file.is_file():
            return f"{self.file} is no file"
        found = file.read_text(encoding="utf-8").count(self.old)
        return f"`old` stands {found} times in {self.file}, not once" if found != 1 else "" if self.old != self.new else "`new` is `old`"


def read(folder: Path) -> list[Fault]:
    """All entries, by gate."""
    faults = []
    for file in sorted(folder.glob("*.toml")):
        for entry in tomllib.loads(file.read_text(encoding="utf-8"))["fault"]:
            try:
                faults.append(Fault(of=file.stem, **{**entry, "gate": tuple(entry["gate"])}))
            except (TypeError, KeyError) as error:
                sys.exit(f"seeded: {file.name}, {entry.get('name', '?')}: an entry has name, file, old, new, why, gate and expect: {error}")
    return faults


def tree() -> set[Path]:
    """Every file that a copy holds, relative: those git knows or would add, what was built, and caches of slow checkers."""
    listed = subprocess.run(["git", "ls-files", "-coz", "--exclude-standard"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    files = {Path(name) for name in listed.split("\0") if name and (ROOT / name).is_file()}
    for top in (str(BUILD), *CACHES):
        for folder, below, names in os.walk(ROOT / top):
            here = Path(folder).relative_to(ROOT)
            if here == BUILD:
                below[:] = [name for name in below if name not in ("seeded", "results")]
            files.update(here / name for name in names + links(Path(folder), below))
    return files


def links(folder: Path, below: list[str]) -> list[str]:
    """Which of these folders are links: a copy has the link, not what it points to."""
    return [name for name in below if (folder / name).is_symlink()]


def stamp(file: Path) -> tuple[int, int] | None:
    """Size and time of change, which tell whether a file is the one it was; none where there is no file."""
    try:
        found = file.lstat()
    except FileNotFoundError:
        return None
    return found.st_size, found.st_mtime_ns


class Copy:
    """A copy of the tree that can be brought back to what it was."""

    def __init__(self, root: Path, files: set[Path]) -> None:
        self.root = root
        self._files = files
        root.mkdir(parents=True, exist_ok=True)
        venv = root / ".venv"
        if not venv.is_symlink():
            venv.symlink_to((ROOT / ".venv").resolve())
        # Objects compiled for coverage name the folder they were compiled in. GCOV_PREFIX takes the tree's away; this link, what is left of the copy's.
        here = root / BUILD / "seeded" / root.name
        here.parent.mkdir(parents=True, exist_ok=True)
        if not here.is_symlink():
            here.symlink_to(root)

    def restore(self) -> None:
        """Every file as in the tree, with its time, and no other."""
        for folder, below, names in os.walk(self.root):
            here = Path(folder)
            if here == self.root / BUILD:
                below[:] = [name for name in below if name != "seeded"]
            for name in names + [link for link in links(here, below) if link != ".venv"]:
                if (here / name).relative_to(self.root) not in self._files:
                    (here / name).unlink()
        for file in self._files:
            if (wanted := stamp(ROOT / file)) is not None and stamp(self.root / file) != wanted:
                (self.root / file).parent.mkdir(parents=True, exist_ok=True)
                (self.root / file).unlink(missing_ok=True)
                shutil.copy2(ROOT / file, self.root / file, follow_symlinks=False)

    def run(self, command: tuple[str, ...]) -> tuple[int, str]:
        """Exit status and all output."""
        environment = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "MAKEOVERRIDES")}
        environment |= {"PYTHONPATH": str(self.root / "host_tools"), "HULLGUARD_SEED": str(SEED), "PYTHONDONTWRITEBYTECODE": "1"}
        environment |= {"GCOV_PREFIX": str(self.root), "GCOV_PREFIX_STRIP": str(len(ROOT.parts) - 1)}
        pipes: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        with subprocess.Popen(command, cwd=self.root, env=environment, start_new_session=True, **pipes) as process:
            try:
                said = process.communicate(timeout=TIME_LIMIT_S)[0]
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                said = process.communicate()[0] + f"\nseeded: not done after {TIME_LIMIT_S} s\n".encode()
        return process.returncode, said.decode(errors="replace")

    def judge(self, fault: Fault, first: bool) -> str:
        """Put the fault in, run its gate, take it out. What is wrong; empty when the gate was red for the right reason."""
        if first:
            self.restore()
            status, said = self.run(fault.gate)
            if status != 0:
                return f"fails without the fault:\n{said[-2000:]}"
        self.restore()
        file = self.root / fault.file
        file.write_text(file.read_text(encoding="utf-8").replace(fault.old, fault.new), encoding="utf-8")
        status, said = self.run(fault.gate)
        if status == 0:
            return "passes with the fault"
        return "" if fault.expect in said else f"fails for another reason; it does not say: {fault.expect}\n{said[-2000:]}"


def stem(gate: str) -> str:
    """Of the short form of a gate, the gate: their faults are the same."""
    return gate.removesuffix("-quick").removesuffix("-short")


def drawn(faults: list[Fault]) -> list[Fault]:
    """One fault of each gate."""
    draw = random.Random(SEED)
    gates = sorted({fault.of for fault in faults})
    return [draw.choice([fault for fault in faults if fault.of == gate]) for gate in gates]


def judged(faults: list[Fault], first: bool, jobs: int) -> list[str]:
    """The faults through as many copies as there are jobs; what is wrong with each."""
    files = tree()
    copies: Queue[Copy] = Queue()
    for job in range(jobs):
        copies.put(Copy(ROOT / BUILD / "seeded" / str(job), files))

    def one(fault: Fault) -> str:
        copy, start = copies.get(), time.monotonic()
        try:
            wrong = copy.judge(fault, first)
        finally:
            copies.put(copy)
        print(f"  {'MISSED' if wrong else 'red   '}  {fault.of:<18} {fault.name:<44} {time.monotonic() - start:4.0f} s  {fault.file}{': ' + wrong if wrong else ''}", flush=True)
        return wrong

    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(one, faults))


def main() -> int:
    """All that was asked for; exit status 1 when a gate did not see its fault."""
    parser = argparse.ArgumentParser(description="realistic faults, each of which must turn its gate red")
    parser.add_argument("--all", action="store_true", help="every fault, and each command without it first")
    parser.add_argument("--gate", nargs="+", default=[], help="faults of these gates alone, all of them")
    parser.add_argument("--fault", default="", help="only those with this in their name")
    parser.add_argument("--gates", nargs="+", default=[], help="gates that must have a fault")
    parser.add_argument("--jobs", type=int, default=min(4, len(os.sched_getaffinity(0))))
    asked = parser.parse_args()
    faults = read(ROOT / "tests" / "seeded")
    wrong = [f"{fault.of}: {fault.name}: {text}" for fault in faults if (text := fault.check())]
    named = {fault.of for fault in faults}
    wrong += [f"{gate}: no fault is known that turns it red: tests/seeded/{gate}.toml" for gate in asked.gates if not {gate, stem(gate)} & named]
    known = {name for gate in asked.gates for name in (gate, stem(gate))}
    wrong += [f"tests/seeded/{name}.toml: there is no such gate" for name in sorted(named - known) if asked.gates]
    if wrong:
        print("\n".join(f"seeded: {line}" for line in wrong), file=sys.stderr)
        return 1
    chosen = [fault for fault in faults if fault.of in asked.gate and asked.fault in fault.name] if asked.gate else faults if asked.all else drawn(faults)
    if not chosen:
        print(f"seeded: no fault is of gate {', '.join(asked.gate) or '-'} and has '{asked.fault}' in its name; gates: {', '.join(sorted(named))}", file=sys.stderr)
        return 1
    print(f"seeded: {len(chosen)} of {len(faults)} faults, HULLGUARD_SEED={SEED}", flush=True)
    missed = sum(bool(text) for text in judged(chosen, asked.all, asked.jobs))
    gates = len({fault.of for fault in chosen})
    if not missed and not asked.gate:
        promise = "every gate turns red when a realistic fault is put into a copy of the tree: a sign, a step too few, a stale buffer, a wrong exponent or modulus, byte order"
        write("seeded", [(promise, f"{len(chosen)} of {len(faults)} faults drawn, all found, {gates} gates")], "make seeded")
    print(f"seeded: {len(chosen) - missed} faults of {gates} gates found, {missed} missed")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
