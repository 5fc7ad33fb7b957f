#!/usr/bin/env python3
"""Put faults into the library, one at a time, and see whether the unit tests notice: run.py FOLDER BUILD...

FOLDER/BUILD holds the objects of the library and the test programs (mutation.mk). All mutants of a file are compiled at once (mutate.py); a test program is
started once and forks for each (runtime.c). A mutant is killed when a program that comes by it fails, crashes or takes many times its usual time. What survives is
an error unless equivalent.toml explains it, and so is an entry there that explains nothing. The functions of a header are mutated in every file of the library
that takes it in, and in the tests that call them.
"""

import argparse
import os
import random
import re
import shlex
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "promises"))
from result import write_to

try:
    from mutate import Mutant, Mutator
except ImportError as missing:
    sys.exit(f"{missing}: run host_tools/setup.sh check")

HERE = Path("tests/mutation")
SOURCES = Path("firmware/src")
HEADERS = Path("firmware/include/hullguard")
UNIT = Path("tests/unit")
TIMES = 4.0  # of a program's usual time that a mutant may take, and
LEAST_S = 0.1  # that long anyway
CAMPAIGNS = {"test_adversary", "test_robust", "test_e2e_errors"}  # seconds each: what they alone notice, no test of the module does
SMALL = 120  # mutants of a file that every run makes all
FILES = 4  # larger files that a sample is from
Key = tuple[str, str, str, str, str]


@dataclass
class Verdicts:
    """What became of the mutants of one file."""

    mutants: dict[int, Mutant] = field(default_factory=dict)  # those that compile in some build and were asked for
    killer: dict[int, str] = field(default_factory=dict)

    @property
    def survivors(self) -> list[Mutant]:
        """Those that no test has noticed."""
        return [mutant for number, mutant in sorted(self.mutants.items()) if number not in self.killer]


@dataclass(frozen=True)
class Program:
    """A test program of one build, with the library that has the mutants of one file."""

    path: Path
    library: Path
    folder: Path

    def run(self, **more: str) -> float:
        """Run it; processor seconds. It must not fail."""
        environment = {**os.environ, "LD_LIBRARY_PATH": str(self.library.parent.resolve()), "CMOCKA_TEST_ABORT": "1", **more}
        before = time.perf_counter()
        done = subprocess.run([self.path.resolve()], env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False, cwd=".")
        if done.returncode != 0:
            raise RuntimeError(f"{self.path} fails without a mutant in {self.library}: {done.stderr.decode()[-500:]}")
        return time.perf_counter() - before

    def reached(self) -> tuple[set[int], float]:
        """The mutants that it comes by, and its time."""
        out = self.folder / f"{self.path.name}.reached"
        seconds = self.run(HG_REACHED=str(out))
        return {int(line) for line in out.read_text().split()}, seconds

    def killed(self, numbers: set[int], seconds: float) -> set[int]:
        """Those of the mutants that it notices."""
        asked, told = self.folder / f"{self.path.name}.asked", self.folder / f"{self.path.name}.told"
        asked.write_text("".join(f"{number}\n" for number in sorted(numbers)))
        self.run(HG_MUTANTS=str(asked), HG_VERDICTS=str(told), HG_LIMIT_US=str(int(1e6 * (LEAST_S + TIMES * seconds))))
        verdicts = dict(line.split() for line in told.read_text().splitlines())
        if len(verdicts) != len(numbers):
            raise RuntimeError(f"{self.path} answers for {len(verdicts)} of {len(numbers)} mutants")
        return {int(number) for number, verdict in verdicts.items() if verdict == "k"}


def module_of(path: Path) -> str:
    """What the table calls a file."""
    return path.stem if path.suffix == ".c" else path.name


def path_of(module: str) -> Path:
    """The file of a module."""
    return HEADERS / module if module.endswith(".h") else SOURCES / f"{module}.c"


class Builder:
    """Makes libraries with mutants."""

    def __init__(self, folder: Path, builds: list[str]) -> None:
        self.folder = folder
        self.builds = builds
        self.flags = {build: shlex.split((folder / build / "flags").read_text()) for build in builds}

    def library(self, source: Path, build: str) -> tuple[Path, Mutator, frozenset[int]]:
        """The library of a build with all mutants of one file, and which of them do not compile in it."""
        mutated = self.mutated(source, build)
        mutated.parent.mkdir(parents=True, exist_ok=True)
        left_out: frozenset[int] = frozenset()
        while True:
            mutator = Mutator(module_of(source), source.read_text(), left_out)
            mutated.write_text(mutator.write())
            bad = self.refused(mutated, build)
            if not bad:
                break
            if bad <= left_out:
                raise RuntimeError(f"{mutated} does not compile without its mutants either")
            left_out |= bad
        place = self.place(source, build)
        with_them = self.takers(source, build) if source.suffix == ".h" else {source: mutated}
        objects = [self.compile(file, build, place / f"{path.stem}.o", place) for path, file in with_them.items()]
        others = [path for path in (self.folder / build / SOURCES).glob("*.o") if SOURCES / f"{path.stem}.c" not in with_them]
        runtime = self.folder / build / "tests/mutation/runtime.o"
        subprocess.run(["clang-19", "-shared", "-Wl,-Bsymbolic,-soname,libhg.so", "-o", place / "libhg.so", *objects, *others, runtime], check=True)
        return place / "libhg.so", mutator, left_out

    def place(self, source: Path, build: str) -> Path:
        """Where the library with the mutants of a file is made."""
        return self.folder / build / "mutants" / module_of(source)

    def mutated(self, source: Path, build: str) -> Path:
        """The file with its mutants; a header where it is found before the library's own."""
        return self.place(source, build) / ("hullguard" if source.suffix == ".h" else "") / source.name

    def takers(self, header: Path, build: str) -> dict[Path, Path]:
        """The files of the library that take a header in, each as the file to compile."""
        done = subprocess.run([*self.flags[build], "-MM", *map(str, sorted(SOURCES.glob("*.c")))], capture_output=True, encoding="utf-8", check=True)
        rules = done.stdout.replace("\\\n", " ").splitlines()
        files = [words.split()[1:] for words in rules]
        return {Path(words[0]): Path(words[0]) for words in files if str(header) in words}

    def programs(self, source: Path, build: str) -> list[Path]:
        """Test programs; those that call functions of a header have its mutants in them, too."""
        folder, place = self.folder / build, self.place(source, build)
        paths = [path for path in sorted(folder.glob("test_*")) if os.access(path, os.X_OK) and not path.suffix and path.name not in CAMPAIGNS]
        if source.suffix != ".h":
            return paths
        functions = {mutant.function for mutant in mutants_of(source)}
        calls = {path: functions & set(re.findall(r"\w+", (UNIT / f"{path.name}.c").read_text(encoding="utf-8"))) for path in paths}
        return [self.with_mutants(path, build, place) if calls[path] else path for path in paths]

    def with_mutants(self, program: Path, build: str, place: Path) -> Path:
        """A test program anew, compiled with the mutated header."""
        test = self.compile(UNIT / f"{program.name}.c", build, place / f"{program.name}.o", place)
        subprocess.run(["clang-19", "-rdynamic", "-o", place / program.name, test, program.parent / "libmodels.a", place / "libhg.so", "-lcmocka", "-lm"], check=True)
        return place / program.name

    def compiled(self, source: Path, build: str) -> set[int]:
        """Numbers of the mutants that the preprocessor leaves in a build."""
        command = [*self.flags[build], "-E", "-P", "-include", str(HERE / "runtime.h"), "-x", "c", str(self.mutated(source, build))]
        text = subprocess.run(command, capture_output=True, encoding="utf-8", check=True).stdout
        return {int(number) for number in re.findall(r"hg_is_mutant\((\d+)U\)", text)}

    def compile(self, source: Path, build: str, target: Path, before: Path) -> Path:
        """An object; `before` is where headers are looked for first."""
        compiler, *flags = self.flags[build]
        extra = ["-D_DEFAULT_SOURCE"] if source.parent == UNIT else []
        subprocess.run([compiler, f"-I{before}", *flags, *extra, "-include", str(HERE / "runtime.h"), "-c", str(source), "-o", str(target)], check=True)
        return target

    def refused(self, source: Path, build: str) -> set[int]:
        """Numbers of the mutants that the compiler refuses."""
        command = [*self.flags[build], "-ferror-limit=0", "-include", str(HERE / "runtime.h"), "-fsyntax-only", "-x", "c", str(source)]
        done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
        if done.returncode == 0:
            return set()
        lines = source.read_text().splitlines()
        wrong = {int(number) for number in re.findall(rf"^{re.escape(str(source))}:(\d+):\d+: error", done.stderr, re.MULTILINE)}
        # A message about an operator stands where that is: its operand follows.
        numbers = {number for line in wrong if (number := next((int(m[1]) for text in lines[line - 1 :] if (m := re.search(r"hg_is_mutant\((\d+)U\)", text))), 0))}
        if not numbers:
            raise RuntimeError(done.stderr[:2000])
        return numbers


def programs_of(paths: list[Path], name: str, library: Path) -> Iterator[tuple[Program, set[int], float]]:
    """The test programs of a build, each with the mutants that it comes by and its time: those that are named after the file first, the quickest of them ahead."""
    programs = {path: Program(path, library, library.parent) for path in paths}
    named = [program for path, program in programs.items() if path.name.startswith(f"test_{name}")]
    yield from sorted(((program, *program.reached()) for program in named), key=lambda found: found[2])
    yield from ((program, *program.reached()) for program in programs.values() if program not in named)


def judge(builder: Builder, source: Path, chosen: set[Key] | None) -> Verdicts:
    """Run the mutants of a file: all, or those that are chosen."""
    verdicts = Verdicts()
    for build in builder.builds:
        library, mutator, left_out = builder.library(source, build)
        there = builder.compiled(source, build) - left_out
        numbers = {mutant.number: mutant for mutant in mutator.mutants if mutant.number in there and (chosen is None or mutant.key in chosen)}
        verdicts.mutants |= numbers
        for program, reached, seconds in programs_of(builder.programs(source, build), source.stem, library):
            alive = {number for number in numbers if number not in verdicts.killer}
            if alive & reached:
                killed = program.killed(alive & reached, seconds)
                verdicts.killer |= dict.fromkeys(killed, f"{build}/{program.path.name}")
            if alive <= verdicts.killer.keys():
                break
    return verdicts


def drawn(sources: list[Path], unfinished: set[str], count: int, seed: int) -> dict[Path, set[Key] | None]:
    """All mutants of the small files, and so many of the others, of a few files each time; a header counts as large, because most of the library is compiled for it."""
    random_ = random.Random(seed)
    mutants = {path: mutants_of(path) for path in sources if module_of(path) not in unfinished}
    chosen: dict[Path, set[Key] | None] = {path: None for path, found in mutants.items() if len(found) <= SMALL and path.suffix == ".c"}
    large = sorted(path for path in mutants if path not in chosen)
    files = random_.sample(large, min(FILES, len(large)))
    for path in files:
        chosen[path] = {mutant.key for mutant in random_.sample(mutants[path], min(len(mutants[path]), count // len(files)))}
    return chosen


def mutants_of(source: Path) -> list[Mutant]:
    """Every mutant of a file, whether it compiles or not."""
    mutator = Mutator(module_of(source), source.read_text(encoding="utf-8"))
    mutator.write()
    return mutator.mutants


@dataclass
class Table:
    """equivalent.toml: survivors with their reasons, files whose survivors are not all explained, and files whose survivors nobody has counted."""

    reasons: dict[Key, str]
    pending: dict[str, int]
    unmeasured: set[str]

    @property
    def unfinished(self) -> set[str]:
        """Files of which a sample shows nothing."""
        return self.pending.keys() | self.unmeasured

    @classmethod
    def read(cls, path: Path) -> "Table":
        """Read the table; an entry has module, function, operator, original, mutated (one line, or a list of those with the same reason) and why."""
        text = tomllib.loads(path.read_text(encoding="utf-8"))
        reasons: dict[Key, str] = {}
        for entry in text.get("equivalent", []):
            module, function, operator, original = (entry[name] for name in ("module", "function", "operator", "original"))
            lines = entry["mutated"] if isinstance(entry["mutated"], list) else [entry["mutated"]]
            if not lines:
                sys.exit(f"{path}: an entry of {module}, {function}() names no mutant: {original}")
            reasons |= dict.fromkeys(((module, function, operator, original, line) for line in lines), entry["why"])
        return cls(reasons, dict(text.get("pending", {})), set(text.get("unmeasured", [])))


def faults_of(module: str, verdicts: Verdicts, table: Table, whole: bool) -> list[str]:
    """Unexplained survivors of a file, and what the table says that is not so."""
    survivors = {mutant.key: mutant for mutant in verdicts.survivors}
    unexplained = [mutant for key, mutant in survivors.items() if key not in table.reasons]
    faults = []
    if module in table.unmeasured:
        faults.append(f"{module}: {len(unexplained)} unexplained survivors: equivalent.toml names it unmeasured, write the number under pending")
    elif module in table.pending:
        if len(unexplained) > table.pending[module]:
            faults.append(f"{module}: {len(unexplained)} unexplained survivors, pending says {table.pending[module]}")
        elif whole and len(unexplained) < table.pending[module]:
            faults.append(f"{module}: {len(unexplained)} unexplained survivors, fewer than the {table.pending[module]} that pending says: take the number down")
    else:
        faults += [f"{path_of(module)}:{m.line}: {m.operator} in {m.function}() survives\n    - {m.original}\n    + {m.mutated}" for m in unexplained]
    seen = {mutant.key for mutant in verdicts.mutants.values()}
    for key in table.reasons:
        if key[0] == module and key in seen and key not in survivors:
            faults.append(f"equivalent.toml: a test kills {key}")
        elif key[0] == module and whole and key not in seen:
            faults.append(f"equivalent.toml: there is no mutant {key}")
    return faults


def main() -> int:
    """Judge the files, keep the verdicts, say what survives."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("builds", nargs="+")
    parser.add_argument("--results", type=Path, help="write what holds to this file")
    parser.add_argument("--sample", type=int, help="so many mutants of the larger files, drawn by HULLGUARD_SEED; all of the small ones")
    parser.add_argument("--module", action="append", help="only this file: hull, linalg.h")
    arguments = parser.parse_args()
    builder = Builder(arguments.folder, arguments.builds)
    table = Table.read(HERE / "equivalent.toml")
    files = [*sorted(SOURCES.glob("*.c")), *(path for path in sorted(HEADERS.glob("*.h")) if mutants_of(path))]
    known = {module_of(path): path for path in files}
    if unknown := [module for module in arguments.module or () if module not in known]:
        sys.exit(f"mutation: there is no file {', '.join(unknown)}; choose of {', '.join(known)}")
    sources = [path for module, path in known.items() if not arguments.module or module in arguments.module]
    chosen: dict[Path, set[Key] | None] = dict.fromkeys(sources)
    if arguments.sample:
        seed = int(os.environ.get("HULLGUARD_SEED", "0")) or int.from_bytes(os.urandom(4))
        print(f"HULLGUARD_SEED={seed}")
        chosen = drawn(sources, table.unfinished, arguments.sample, seed)
    faults = [f"equivalent.toml: there is no {path_of(key[0])}" for key in table.reasons if not path_of(key[0]).exists()]
    made = survived = 0
    for source, keys in sorted(chosen.items()):
        verdicts = judge(builder, source, keys)
        found = faults_of(module_of(source), verdicts, table, keys is None)
        print(f"{module_of(source)}: {len(verdicts.mutants)} mutants, {len(verdicts.survivors)} survive, {len(found)} faults", flush=True)
        faults += found
        made, survived = made + len(verdicts.mutants), survived + len(verdicts.survivors)
    for fault in faults:
        print(fault, file=sys.stderr)
    if not faults and arguments.results:
        write_results(arguments.results, made, survived, sorted(module_of(path) for path in chosen), table)
    return 1 if faults else 0


def write_results(path: Path, made: int, survived: int, modules: list[str], table: Table) -> None:
    """What holds, for the page of promises."""
    complete = [module for module in modules if module not in table.unfinished]
    promise = "a fault put into a finished file of the library is noticed by a unit test, or explained as none"
    pending = ", ".join([f"{module} {count}" for module, count in sorted(table.pending.items())] + [f"{module} (not counted)" for module in sorted(table.unmeasured)])
    result = f"{made} faults made in {', '.join(complete)}; {survived} survive, each explained; not finished, with their unexplained survivors: {pending or 'none'}"
    write_to(path, [(promise, result)])


if __name__ == "__main__":
    sys.exit(main())
