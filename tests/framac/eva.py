#!/usr/bin/env python3
"""Judge what Eva said: every alarm has its reason in the table, every entry of the table its alarm, every public function of the library and of the portable parts of a
board was reached, or stands in the table as one that no driver reaches yet. Both lists may only become shorter. No statement of a driver is dead: else something
did not start, and nothing was shown. Of some of the drivers only new alarms and dead statements are judged.

    eva.py TABLE RESULT CSV ..    CSV: properties of a driver (frama-c -report-csv), beside it .log with the coverage of the run
"""

import csv
import re
import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "promises"))
from result import write_to

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
COPY = re.compile(r"_\d+$")
DEFINED = re.compile(r"^(?!static|typedef|return|else)[a-z_][\w ]*[ *](hg_\w+)\([^;]*$", re.MULTILINE)
OF_DRIVER = re.compile(r"^(?!typedef|return|else)[a-z_][\w ]*[ *](\w+)\([^;]*$", re.MULTILINE)
COVERED = re.compile(r"^\s+(\w+): (\d+) stmts out of (\d+)")
SOURCES = ("firmware/src/*.c", "hal/loopback/*.c", "hal/board/controller.c", "hal/board/queue.c")  # drivers of registers and of Linux have suites of their own (make contract)
SETTLED = ("Valid", "Considered valid", "Dead", "Untried")

Alarm = tuple[str, str, str]  # file, function, property


def alarms(path: Path) -> set[Alarm]:
    """What a driver leaves open in the library, without line numbers."""
    with path.open(newline="") as lines:
        rows = list(csv.DictReader(lines, delimiter="\t"))
    # What a function of the C library requires is a property of each call, too, and that one stands in the library.
    open_rows = [row for row in rows if row["status"] not in SETTLED and not row["directory"].startswith("FRAMAC_SHARE")]
    if not rows:
        sys.exit(f"{path}: no property at all: Eva has not run")
    return {(f"{row['directory']}/{row['file']}", COPY.sub("", row["function"]), row["property"]) for row in open_rows}


def names_of(log: Path) -> dict[str, tuple[int, int]]:
    """Functions that a run has reached: statements reached, and all."""
    reached: dict[str, tuple[int, int]] = {}
    for line in log.read_text().splitlines():
        match = COVERED.match(line)
        if match is not None and int(match[2]) > 0:
            reached[COPY.sub("", match[1])] = (int(match[2]), int(match[3]))
    if not reached:
        sys.exit(f"{log}: nothing was reached: Eva has not run")
    return reached


def dead(driver: str, reached: dict[str, tuple[int, int]]) -> list[str]:
    """Functions of a driver with a statement that no run comes to."""
    source = HERE / f"{driver.removesuffix('_q31')}.c"
    return [name for name in OF_DRIVER.findall(source.read_text()) if len(set(reached.get(name, (0, 1)))) > 1]


def public() -> set[str]:
    """Functions with external linkage of the library, and of a board where they are plain C."""
    found: set[str] = set()
    for pattern in SOURCES:
        for source in sorted(ROOT.glob(pattern)):
            found |= set(DEFINED.findall(source.read_text()))
    return found


def entries(path: Path) -> tuple[dict[Alarm, str], set[str]]:
    """The table: alarm and its reason; functions that no driver reaches yet."""
    with path.open("rb") as file:
        table = tomllib.load(file)
    return {(one["file"], one["function"], one["property"]): one["reason"] for one in table.get("alarm", [])}, set(table.get("unreached", []))


def main() -> int:
    """Command line."""
    table, result, files = Path(sys.argv[1]), Path(sys.argv[2]), [Path(name) for name in sys.argv[3:]]
    known, left_out = entries(table)
    found: set[Alarm] = set()
    reached: set[str] = set()
    bad: list[str] = []
    for path in files:
        names = names_of(path.with_suffix(".log"))
        found |= alarms(path)
        reached |= set(names)
        bad += [f"{path.stem}: statements of {name}() are dead: does all start?" for name in dead(path.stem, names)]
    bad += [f"alarm without a reason in {table.name}: {file}: {function}: {text}" for file, function, text in sorted(found - set(known))]
    if len(files) < len(list(HERE.glob("eva_*.c"))):
        print(*bad or [f"  ok  eva: {', '.join(path.stem for path in files)} alone"], sep="\n")
        return int(bool(bad))
    bad += [f"{table.name} has a reason for what is no alarm any more, take it out: {file}: {function}: {text}" for file, function, text in sorted(set(known) - found)]
    missing = sorted(public() - reached)
    bad += [f"no driver reaches {name}()" for name in missing if name not in left_out]
    bad += [f"{table.name}: {name}() is reached now, take it out" for name in sorted(left_out - set(missing))]
    for line in bad:
        print(line)
    if bad:
        return 1
    functions = len(public())
    promise = (
        "No undefined behaviour of memory, integers, shifts, conversions or uninitialised data in any run, however long, "
        "of these models and parts with any frame, any input and any order of calls, but for the places that tests/framac/alarms.toml gives a reason for"
    )
    text = f"{len(files)} drivers, {functions - len(missing)} of {functions} public functions reached, {len(known)} alarms, each with its reason"
    write_to(result, [(promise, text)])
    print(f"  ok  eva: {text}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
