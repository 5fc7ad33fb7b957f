"""Runs the fuzz targets and the readers' cases (fuzz.mk), and keeps corpus, regressions and the ledger of what was executed.

    fuzz.py quick  --seconds 10 TARGET ..     corpus and regressions of each target, then libFuzzer for so long; a few thousand cases a reader
    fuzz.py long   --seconds 1200 TARGET ..   libFuzzer and AFL++ for so much processor time each, 10^5 cases a reader in the ledger; adds to ledger.toml
    fuzz.py pack TARGET ..                    a small corpus from what the long runs found: corpus/TARGET.hex
    fuzz.py keep TARGET FILE NAME             an input that broke an invariant becomes a regression: regress/TARGET.hex

Inputs are in hex, one a line behind its name, so that a difference can be read.
"""

import argparse
import fcntl
import os
import re
import resource
import shutil
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "promises"))
from result import write_to

HERE = Path(__file__).parent
LEDGER = HERE / "ledger.toml"
LONGEST = {"sound": 4096, "node": 2048, "tracker": 2048}  # bytes of an input that are worth trying
CORPUS_BYTES = 12000  # of a target's committed corpus
READER_CASES_QUICK = 300
READER_CASES_LONG = 100_000
SLICE_S = 280  # of a long run: all targets in turn, so that one that is cut short has done something of each
HEAD = """\
# Executions so far of each fuzz target and reader, findings among them, and those still open. Seconds are of the processor, not of the clock: a
# machine that does other things beside makes a run longer, not smaller. Written by tests/fuzz/fuzz.py.
"""


@dataclass
class Entry:
    """What was executed so far of one target by one engine: executions, seconds of the processor, findings and how many of them are still open."""

    executions: int = 0
    seconds: int = 0
    findings: int = 0
    open: int = 0


def read_ledger() -> dict[tuple[str, str], Entry]:
    """The committed ledger, by target and engine."""
    if not LEDGER.exists():
        return {}
    rows = tomllib.loads(LEDGER.read_text())["run"]
    return {(row["target"], row["engine"]): Entry(row["executions"], row["seconds"], row["findings"], row["open"]) for row in rows}


def write_ledger(ledger: dict[tuple[str, str], Entry]) -> None:
    """Sorted, so that a difference shows what was added."""
    lines = [HEAD]
    for (target, engine), entry in sorted(ledger.items()):
        lines.append(
            f'[[run]]\ntarget = "{target}"\nengine = "{engine}"\nexecutions = {entry.executions}\nseconds = {entry.seconds}\nfindings = {entry.findings}\nopen = {entry.open}\n'
        )
    LEDGER.write_text("\n".join(lines))


def add_to_ledger(target: str, engine: str, executions: int, seconds: int, found: int) -> None:
    """One run's numbers; a finding is open until whoever mends it says so in the ledger."""
    with LEDGER.open() as held:  # readers and targets may run beside each other
        fcntl.flock(held, fcntl.LOCK_EX)
        ledger = read_ledger()
        entry = ledger.setdefault((target, engine), Entry())
        entry.executions += executions
        entry.seconds += seconds
        entry.findings += found
        entry.open += found
        write_ledger(ledger)


def children_s() -> float:
    """Processor seconds of all child processes that have ended, their children included."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def read_hex(path: Path) -> dict[str, bytes]:
    """Inputs of a file by name; lines that begin with # say what the next one shows."""
    inputs: dict[str, bytes] = {}
    for line in path.read_text().splitlines() if path.exists() else []:
        if line and not line.startswith("#"):
            name, _, digits = line.partition(" ")
            inputs[name] = bytes.fromhex(digits)
    return inputs


def write_hex(path: Path, inputs: dict[str, bytes]) -> None:
    """The reverse, without comments."""
    path.parent.mkdir(exist_ok=True)
    path.write_text("".join(f"{name} {data.hex()}\n" for name, data in inputs.items()))


def unpack(target: str, work: Path) -> list[Path]:
    """Committed inputs as files for the engines: regressions, then the corpus."""
    folders = []
    for kind in ("regress", "corpus"):
        folder = work / target / kind
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for name, data in read_hex(HERE / kind / f"{target}.hex").items():
            (folder / name).write_bytes(data)
        folders.append(folder)
    return folders


def fail(target: str, engine: str, log: Path, found: list[Path]) -> str:
    """What broke, in one paragraph: the invariant or the sanitizer's line, and where the input is."""
    lines = [line for line in log.read_text(errors="replace").splitlines() if re.search(r"invariant I|runtime error|ERROR: |SUMMARY", line)]
    where = ", ".join(str(path) for path in found)
    return f"{target} ({engine}): " + ("\n    ".join(lines[:4]) or log.read_text(errors="replace")[-2000:]) + f"\n    input: {where or 'see ' + str(log)}"


def lib_fuzzer(target: str, build: Path, seconds: int, seed: int, keep: bool) -> tuple[int, list[Path], Path]:
    """One run of libFuzzer over regressions, corpus and, where kept, what earlier runs found; executions, new artefacts, log."""
    work = build / "work"
    folders = unpack(target, work)
    grown = work / target / "grown"
    if not keep:
        shutil.rmtree(grown, ignore_errors=True)
    grown.mkdir(parents=True, exist_ok=True)
    artefacts = work / target / "found"
    shutil.rmtree(artefacts, ignore_errors=True)
    artefacts.mkdir(parents=True)
    log = work / target / "libfuzzer.log"
    command = [
        str(build / "libfuzzer" / target),
        f"-max_total_time={seconds}",
        f"-max_len={LONGEST.get(target, 512)}",
        "-len_control=20",
        "-timeout=30",
        "-rss_limit_mb=1500",
        "-print_final_stats=1",
        f"-seed={seed}",
        f"-artifact_prefix={artefacts}/",
        str(grown),
        *map(str, folders),
    ]
    with log.open("w") as out:
        code = subprocess.run(command, stdout=out, stderr=subprocess.STDOUT, check=False).returncode
    text = log.read_text(errors="replace")
    executed = re.findall(r"number_of_executed_units: (\d+)", text) or re.findall(r"^#(\d+)", text, re.MULTILINE)
    found = sorted(artefacts.iterdir())
    if code != 0 and not found:
        found = [log]
    return int(executed[-1]) if executed else 0, found, log


def afl(target: str, build: Path, seconds: int) -> tuple[int, list[Path], Path]:
    """One run of AFL++ over the same inputs; executions, crashes, log."""
    work = build / "work"
    seeds = work / target / "seeds"
    shutil.rmtree(seeds, ignore_errors=True)
    seeds.mkdir(parents=True)
    (seeds / "empty").write_bytes(b"\0")
    for folder in unpack(target, work):
        for path in folder.iterdir():
            shutil.copy(path, seeds)
    out = work / target / "afl"
    shutil.rmtree(out, ignore_errors=True)
    log = work / target / "afl.log"
    settings = dict(os.environ, AFL_SKIP_CPUFREQ="1", AFL_I_DONT_CARE_ABOUT_MISSING_CRASHES="1", AFL_NO_UI="1", AFL_NO_AFFINITY="1")
    with log.open("w") as text:
        command = ["afl-fuzz", "-V", str(seconds), "-t", "5000+", "-i", str(seeds), "-o", str(out), "--", str(build / "afl" / target)]
        code = subprocess.run(command, stdout=text, stderr=subprocess.STDOUT, env=settings, check=False).returncode
    stats_file = out / "default" / "fuzzer_stats"
    if code != 0 or not stats_file.exists():
        return 0, [log], log
    executed = re.search(r"execs_done\s*: (\d+)", stats_file.read_text())
    found = [path for kind in ("crashes", "hangs") for path in sorted((out / "default" / kind).glob("id*"))]
    return int(executed.group(1)) if executed else 0, found, log


def readers(build: Path, arguments: list[str]) -> subprocess.Popen[str]:
    """The readers' cases in a process of their own, beside the C targets."""
    command = [sys.executable, str(HERE / "readers.py"), "--work", str(build / "readers"), *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def quick_one(build: Path, target: str, seconds: int, seed: int) -> tuple[str, bool]:
    """Replay and a short run of a target: what to say of it, and whether all is well."""
    executed, found, log = lib_fuzzer(target, build, seconds, seed, False)
    inputs = sum(len(read_hex(HERE / kind / f"{target}.hex")) for kind in ("regress", "corpus"))
    if found:
        return f"FAILED {fail(target, 'libFuzzer', log, found)}", False
    return f"  ok  fuzz {target}: {inputs} inputs of corpus and regressions, {executed} executions", True


def quick_readers(build: Path, seed: int) -> tuple[str, bool]:
    """The same of the readers' cases."""
    beside = readers(build, ["--cases", str(READER_CASES_QUICK), "--seed", str(seed)])
    said, _ = beside.communicate()
    return said.rstrip("\n"), beside.returncode == 0


def quick(build: Path, targets: list[str], seconds: int, files: bool) -> int:
    """All of them, as many at a time as there are processors; any finding is a failure. Writes what the gate promises."""
    seed = int(os.environ.get("HULLGUARD_SEED", "1"))
    with ThreadPoolExecutor(os.cpu_count()) as crew:
        parts = [crew.submit(quick_readers, build, seed)] if files else []
        parts += [crew.submit(quick_one, build, target, seconds, seed) for target in targets]
        failed = False
        for part in parts:
            said, well = part.result()
            print(said, flush=True)
            failed = failed or not well
    if not failed and files:
        write_results(build, targets)
    return 1 if failed else 0


def write_results(build: Path, targets: list[str]) -> None:
    """build/results/fuzz-quick.json: numbers of the ledger and of what is committed, the same whenever it passes."""
    ledger = read_ledger()
    promises = []
    for target in targets:
        inputs = sum(len(read_hex(HERE / kind / f"{target}.hex")) for kind in ("regress", "corpus"))
        executed = sum(entry.executions for (name, _), entry in ledger.items() if name == target)
        still = sum(entry.open for (name, _), entry in ledger.items() if name == target)
        promises.append(
            (
                f"no input breaks an invariant of the fuzz target {target} (tests/fuzz/INVARIANTS.md)",
                f"{inputs} inputs of corpus and regressions; {executed} executions in the ledger, {still} findings open",
            )
        )
    cases = [(name, entry) for (name, engine), entry in sorted(ledger.items()) if engine == "readers"]
    promises.append(
        (
            "a file that is wrong in any way is refused in one line by the host's readers, in bounded time and memory",
            f"{len(cases)} readers, {sum(entry.executions for _, entry in cases)} cases in the ledger, {sum(entry.open for _, entry in cases)} findings open",
        )
    )
    write_to(build.parent / "results" / "fuzz-quick.json", promises)


def sliced(target: str, engine: str, build: Path, seconds: float) -> tuple[float, bool]:
    """A slice of a long run, which ends by the clock because both engines do; its numbers go to the ledger. Processor seconds used, and whether all is well."""
    began = children_s()
    seed = sum(entry.executions for entry in read_ledger().values()) % 2**31  # another one each time
    limit = max(1, round(min(seconds, SLICE_S)))
    executed, found, log = lib_fuzzer(target, build, limit, seed, True) if engine == "libfuzzer" else afl(target, build, limit)
    used = children_s() - began
    add_to_ledger(target, engine, executed, round(used), len(found))
    print(f"  {target} {engine}: {executed} executions in {used:.0f} s, {len(found)} findings", flush=True)
    if found:
        print(f"FAILED {fail(target, engine, log, found)}", flush=True)
    return used, not found


def long(build: Path, targets: list[str], seconds: int, engines: list[str]) -> int:
    """Each engine, slice by slice, until every target has had its processor time or a finding; then the readers' cases that the ledger does not have yet."""
    failed = False
    for engine in engines:
        left = dict.fromkeys(targets if engine != "readers" else (), float(seconds))
        while left:
            for target in list(left):
                used, well = sliced(target, engine, build, left[target])
                left[target] -= used
                failed = failed or not well
                if not well or left[target] < 1:
                    del left[target]
    if "readers" in engines:
        beside = readers(build, ["--ledger", "--cases", str(READER_CASES_LONG)])
        for line in beside.stdout or []:
            print(line, end="", flush=True)
        failed = beside.wait() != 0 or failed
    return 1 if failed else 0


def pack(build: Path, targets: list[str]) -> int:
    """The smallest inputs that reach what all that were found reach, as many as the committed corpus may hold."""
    for target in targets:
        work = build / "work" / target
        folders = [path for path in (work / "grown", work / "afl" / "default" / "queue", *unpack(target, build / "work")) if path.exists()]
        small = work / "small"
        shutil.rmtree(small, ignore_errors=True)
        small.mkdir()
        command = [str(build / "libfuzzer" / target), "-set_cover_merge=1", f"-max_len={LONGEST.get(target, 512)}", str(small), *map(str, folders)]
        subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
        inputs: dict[str, bytes] = {}
        room = CORPUS_BYTES
        for path in sorted(small.iterdir(), key=lambda one: (one.stat().st_size, one.name)):
            data = path.read_bytes()
            room -= len(data)
            if room >= 0:
                inputs[path.name[:12]] = data
        write_hex(HERE / "corpus" / f"{target}.hex", inputs)
        print(f"  {target}: {len(inputs)} inputs, {sum(map(len, inputs.values()))} bytes")
    return 0


def keep(target: str, path: Path, name: str) -> int:
    """An input becomes a regression; what it shows is to be written above it by hand."""
    file = HERE / "regress" / f"{target}.hex"
    file.parent.mkdir(exist_ok=True)
    old = file.read_text() if file.exists() else ""
    file.write_text(f"{old}# \n{name} {path.read_bytes().hex()}\n")
    return 0


def main() -> int:
    """See the head of the file."""
    parser = argparse.ArgumentParser(description="Fuzz targets and readers.")
    parser.add_argument("--build", type=Path, default=Path("build/fuzz"))
    parser.add_argument("what", choices=["quick", "long", "pack", "keep"])
    parser.add_argument("--seconds", type=int, default=10)
    parser.add_argument("--engines", default="libfuzzer,afl,readers")
    parser.add_argument("--no-readers", action="store_true", help="quick: the C targets alone")
    parser.add_argument("targets", nargs="+")
    options = parser.parse_args()
    for tool in ("afl-fuzz",) if options.what == "long" and "afl" in options.engines.split(",") else ():
        if shutil.which(tool) is None:
            print(f"{tool} is missing: host_tools/setup.sh deep installs it", file=sys.stderr)
            return 2
    if options.what == "quick":
        return quick(options.build, options.targets, options.seconds, not options.no_readers)
    if options.what == "long":
        return long(options.build, options.targets, options.seconds, options.engines.split(","))
    if options.what == "pack":
        return pack(options.build, options.targets)
    return keep(options.targets[0], Path(options.targets[1]), options.targets[2])


if __name__ == "__main__":
    sys.exit(main())
