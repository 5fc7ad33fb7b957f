"""proofs.py [--deep] [NAME ..]: proofs by bounded model checking, tests/proofs/*.c; those whose file or function has one of the names in it, or all.

A proof is a C function proof_X(), and what the comment before it says:

    @proves FUNCTION ..     of the library; every public function must be in some proof, or in exceptions.txt with a reason
    @run check|deep real=f32|f64|q31 unwind=N limit=SECONDS [LOOP:N ..] [NAME=NUMBER ..]    once each; processor time; sizes are macros of the proof, or HG_* of the library;
                            NAME=FIRST..LAST is a run for each number
    @stub FUNCTION ..       calls of these go to stub_FUNCTION() of stubs.h in their place, which knows of them only what another proof shows: see contract.h
    @with CHECK ..          also this check of CBMC
    @without CHECK: WHY     without it

Everything else in the comment is for the reader: what is proven, for which sizes, under which assumptions. The library that is checked is the one of firmware/, with
every subscript of an array checked besides (instrument.py). A run fails when an assertion can fail, a loop runs longer than it is unwound, or the time is over; and when
it says nothing: no property, or a reach() that no input comes to.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from functools import cache
from math import ceil
from pathlib import Path
from threading import Lock

from instrument import InstrumentError, instrument, nodes, parse, text_of
from tree_sitter import Node

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "promises"))
from result import write

ROOT = Path(__file__).resolve().parents[2]
HERE = ROOT / "tests/proofs"
BUILD = ROOT / os.environ.get("BUILD", "build") / "proofs"
TOOLS = BUILD.parent / "tools/cbmc/bin"
MEMORY = 8 << 30  # of one run, bytes

CHECKS = ("bounds", "pointer", "pointer-overflow", "div-by-zero", "signed-overflow", "unsigned-overflow", "conversion", "undefined-shift")
LIBRARY = ("HG_", "ANY_")  # macros that the library is compiled with, too
SHOWN = 8  # of what is wrong with one run
REACH = "reachable: "
PROPERTY = re.compile(r"^\[([^\]]+)\] line \d+ (.*): (SUCCESS|FAILURE|UNKNOWN|ERROR)$", re.MULTILINE)
TOTAL = re.compile(r"^\*\* (\d+) of (\d+) failed", re.MULTILINE)


class ProofError(Exception):
    """Something about a proof, not about the library, is wrong; one line says what."""


@dataclass(frozen=True)
class Run:
    """One run of the model checker."""

    kind: str
    real: str
    unwind: int
    limit: float
    loops: tuple[str, ...]
    defines: tuple[str, ...]

    @property
    def library(self) -> tuple[str, ...]:
        """What the library is compiled with."""
        return (f"HG_REAL_{self.real.upper()}=1", *(d for d in self.defines if d.startswith(LIBRARY)))


@dataclass(frozen=True)
class Proof:
    """A function of tests/proofs/*.c and what its comment says."""

    source: Path
    name: str
    says: str
    proves: tuple[str, ...]
    runs: tuple[Run, ...]
    checks: tuple[str, ...]
    stubs: tuple[str, ...] = ()
    reached: frozenset[str] = frozenset()  # names that it uses, directly or by helpers of its file
    others: tuple[str, ...] = ()  # sizes of all proofs of the file: 1 where a run does not name them


@dataclass(frozen=True)
class Outcome:
    """Of one run."""

    proof: Proof
    run: Run
    seconds: float
    properties: int
    problems: tuple[str, ...] = field(default=())

    @property
    def title(self) -> str:
        """As it stands in the list."""
        return " ".join((self.proof.name, self.run.real, *self.run.defines))


def runs_of(words: Sequence[str], where: str) -> list[Run]:
    """A line behind @run: one, or one for each number of its ranges."""
    for i, word in enumerate(words):
        if span := re.fullmatch(r"([A-Z_]+)=(\d+)\.\.(\d+)", word):
            numbers = range(int(span[2]), int(span[3]) + 1)
            if not numbers:
                raise ProofError(f"{where}: @run has no number in '{word}'")
            return [run for n in numbers for run in runs_of([*words[:i], f"{span[1]}={n}U", *words[i + 1 :]], where)]
    return [run_of(words, where)]


def run_of(words: Sequence[str], where: str) -> Run:
    """A line behind @run, without ranges."""
    known: dict[str, str] = {}
    loops: list[str] = []
    defines: list[str] = []
    for word in words[1:]:
        name, _, value = word.partition("=")
        if name in ("real", "unwind", "limit"):
            known[name] = value
        elif ":" in word:
            loops.append(word)
        elif name.isupper() or name.startswith("HG_"):
            defines.append(word if value else f"{name}=1")
        else:
            raise ProofError(f"{where}: @run does not know '{word}'")
    if not words or words[0] not in ("check", "deep") or known.keys() != {"real", "unwind", "limit"} or known["real"] not in ("f32", "f64", "q31"):
        raise ProofError(f"{where}: @run wants check or deep, real=, unwind= and limit=")
    return Run(words[0], known["real"], int(known["unwind"]), float(known["limit"]), tuple(loops), tuple(defines))


def proof_of(source: Path, name: str, comment: str) -> Proof:
    """A proof by its comment."""
    where = f"{source.name}: {name}"
    lines = [re.sub(r"^\s*/?\*+/?\s?", "", line).removesuffix("*/").strip() for line in comment.splitlines()]
    checks = list(CHECKS)
    proves: list[str] = []
    stubs: list[str] = []
    runs: list[Run] = []
    for line in lines:
        tag, _, rest = line.partition(" ")
        if tag == "@proves":
            proves += rest.split()
        elif tag == "@stub":
            stubs += rest.split()
        elif tag == "@run":
            runs += runs_of(rest.split(), where)
        elif tag == "@with":
            checks += rest.split()
        elif tag == "@without":
            names, colon, why = rest.partition(":")
            if not colon or not why.strip() or any(n not in checks for n in names.split()):
                raise ProofError(f"{where}: @without wants checks that there are, a colon and why")
            checks = [c for c in checks if c not in names.split()]
        elif tag.startswith("@"):
            raise ProofError(f"{where}: no such word as {tag}")
    says = " ".join(line for line in lines if line and not line.startswith("@"))
    if not says or not proves or not runs:
        raise ProofError(f"{where}: the comment wants a sentence of what is proven, @proves and @run")
    return Proof(source, name, says, tuple(proves), tuple(runs), tuple(checks), tuple(stubs))


def names_in(root: Node) -> dict[str, set[str]]:
    """Each function of a file, and all names in it but its own."""
    found: dict[str, set[str]] = {}
    for node in nodes(root):
        if node.type == "function_definition":
            name = text_of(declarator_of(node))
            found[name] = {text_of(n) for n in nodes(node) if n.type == "identifier"} - {name}
    return found


def declarator_of(function: Node) -> Node:
    """The name of a function that is defined."""
    declarator = next(n for n in nodes(function) if n.type == "function_declarator").child_by_field_name("declarator")
    assert declarator is not None
    return declarator


def reached_from(name: str, names: dict[str, set[str]]) -> frozenset[str]:
    """The names in a function and in all functions of its file that it reaches."""
    reached, waiting = set[str](), [name]
    while waiting:
        new = names.get(waiting.pop(), set()) - reached
        reached |= new
        waiting += new
    return frozenset(reached)


def proofs_in(source: Path) -> list[Proof]:
    """All proofs of a file; each must call what it says it proves, directly or by helpers of the file."""
    root = parse(source).root_node
    names = names_in(root)
    proofs = []
    for node in nodes(root):
        if node.type == "function_definition" and (name := text_of(declarator_of(node))).startswith("proof_"):
            before = node.prev_sibling
            proof = proof_of(source, name, text_of(before) if before is not None and before.type == "comment" else "")
            proofs.append(replace(proof, reached=reached_from(name, names)))
    sizes = {d.partition("=")[0] for p in proofs for r in p.runs for d in r.defines if re.fullmatch(r"[A-Z]+=\d+U?", d)}
    proofs = [replace(p, others=tuple(sorted(sizes))) for p in proofs]
    for proof in proofs:
        if idle := [f for f in proof.proves if f not in proof.reached]:
            raise ProofError(f"{source.name}: {proof.name} says it proves {', '.join(idle)} and does not call it")
        if both := set(proof.proves) & set(proof.stubs):
            raise ProofError(f"{source.name}: {proof.name} says it proves {', '.join(both)} and has a stub in its place")
        if "reach" not in proof.reached:
            raise ProofError(f"{source.name}: {proof.name} has no reach(): nothing tells whether any input is left")
    return proofs


def check_stubs(proofs: Sequence[Proof]) -> None:
    """What a stub asserts and assumes stands in a proof of the function that it replaces, the other way round: both call the same requires_, ensures_ and started_ of contract.h."""
    names = names_in(parse(HERE / "stubs.h").root_node)
    for name in sorted({f for p in proofs for f in p.stubs}):
        if f"stub_{name}" not in names:
            raise ProofError(f"{name}() has no stub_{name}() in tests/proofs/stubs.h")
        contract = {n for n in reached_from(f"stub_{name}", names) if n.startswith(("requires_", "ensures_", "started_"))}
        proven = [p for p in proofs if name in p.proves]
        if not contract or not proven:
            raise ProofError(f"the stub of {name}() rests on nothing: it wants a contract, and a proof of the function")
        if not any(contract <= p.reached and any(r.kind == "check" for r in p.runs) for p in proven):
            raise ProofError(f"no proof of {name}() calls all of {', '.join(sorted(contract))}: what its stub assumes is not proven")


def public_functions() -> set[str]:
    """Functions of the library's headers, declared or defined."""
    found = set()
    for header in sorted((ROOT / "firmware/include/hullguard").glob("*.h")):
        for node in nodes(parse(header).root_node):
            if node.type == "function_declarator" and (name := node.child_by_field_name("declarator")) is not None and text_of(name).startswith("hg_"):
                found.add(text_of(name))
    return found


def exceptions() -> dict[str, str]:
    """Public functions without a proof, and why."""
    lines = (line.partition(":") for line in (HERE / "exceptions.txt").read_text().splitlines() if line and not line.startswith("#"))
    return {name.strip(): why.strip() for name, _, why in lines}


def check_coverage(proofs: Iterable[Proof]) -> None:
    """Every public function has a proof or is excepted, and nothing else is."""
    public, proven, excepted = public_functions(), {f for p in proofs for f in p.proves}, exceptions()
    for name in sorted(public):
        if name not in proven and not excepted.get(name):
            raise ProofError(f"{name}() is public and has no proof: write one, or a line with a reason in tests/proofs/exceptions.txt")
        if name in proven and name in excepted:
            raise ProofError(f"{name}() has a proof: take its line out of tests/proofs/exceptions.txt")
    if strangers := (proven | excepted.keys()) - public:
        raise ProofError(f"no public function has this name: {', '.join(sorted(strangers))}")


def compile_goto(sources: Sequence[Path], output: Path, defines: Sequence[str], link: bool = False) -> None:
    """Compile to CBMC's form, unless that is newer than all sources."""
    inputs = [*sources, HERE / "proof.h", *(BUILD / "source").rglob("*.h"), *(ROOT / "firmware/models").glob("*.[ch]"), *HERE.glob("*.h")]
    if output.exists() and all(s.stat().st_mtime <= output.stat().st_mtime for s in inputs):
        return
    output.parent.mkdir(parents=True, exist_ok=True)
    include = [f"-I{BUILD / 'source/firmware/include'}", f"-I{ROOT / 'firmware/models'}", f"-I{HERE}", "-include", str(HERE / "proof.h")]
    what = [] if link else ["-c", "-std=c11", *include, *(f"-D{d}" for d in defines)]
    partial = output.with_suffix(".part")
    done = subprocess.run([TOOLS / "goto-cc", *what, "-o", partial, *sources], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ProofError(f"{output.name} does not compile:\n{done.stdout}{done.stderr}")
    partial.rename(output)


def replace_calls(program: Path, output: Path, functions: Sequence[str]) -> Path:
    """The program with stubs in place of some functions, everywhere."""
    calls = [word for f in functions for word in ("--replace-calls", f"{f}:stub_{f}")]
    done = subprocess.run([TOOLS / "goto-instrument", *calls, program, output], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ProofError(f"{output.name}: calls cannot be replaced:\n{done.stdout}{done.stderr}")
    return output


_compiling = Lock()


@cache
def library_of(defines: tuple[str, ...]) -> tuple[Path, ...]:
    """The instrumented library for one set of options."""
    folder = BUILD / "library" / "-".join(d.replace("=", "") for d in defines)
    objects = []
    for source in sorted((BUILD / "source/firmware/src").glob("*.c")):
        objects.append(folder / f"{source.stem}.o")
        compile_goto([source], objects[-1], defines)
    return tuple(objects)


def command_of(proof: Proof, run: Run) -> list[str]:
    """What proves it; compiles what that needs."""
    folder = BUILD / "run" / "-".join((proof.source.stem, run.real, *(d.replace("=", "") for d in run.defines)))
    with _compiling:
        objects = library_of(run.library)
        own = [d for d in run.defines if not d.startswith(LIBRARY)]
        ones = [f"{size}=1U" for size in proof.others if not any(d.startswith(f"{size}=") for d in own)]
        compile_goto([proof.source], folder / "proof.o", (*run.library, *own, *ones))
        compile_goto([folder / "proof.o", *objects], folder / "all.goto", (), link=True)
        program = replace_calls(folder / "all.goto", folder / f"{proof.name}.goto", proof.stubs) if proof.stubs else folder / "all.goto"
    flags = [f"--{check}-check" for check in proof.checks]
    loops = ["--unwindset", ",".join(run.loops)] if run.loops else []
    return [
        str(TOOLS / "cbmc"), str(program), "--function", proof.name, "--no-standard-checks", "--unwinding-assertions", "--no-malloc-may-fail",
        "--drop-unused-functions", "--slice-formula", "--object-bits", "10", "--unwind", str(run.unwind), *loops, *flags,
    ]  # fmt: skip


def judge(output: str) -> tuple[int, list[str]]:
    """Properties, and what is wrong."""
    properties = PROPERTY.findall(output)
    total = TOTAL.search(output)
    problems = []
    if total is None or int(total[2]) != len(properties):
        return 0, ["its output cannot be read: " + (output.strip().splitlines() or ["nothing"])[-1]]
    reaches = [status for _, text, status in properties if text.startswith(REACH)]
    checked = [(name, text, status) for name, text, status in properties if not text.startswith(REACH)]
    problems += [f"no input comes to it, the assumptions contradict one another: {text}" for _, text, status in properties if text.startswith(REACH) and status != "FAILURE"]
    wrong = [f"{status}: {name}: {text}" for name, text, status in checked if status not in ("SUCCESS", "UNKNOWN")]
    # Behind what is undefined everything is unknown.
    wrong = wrong or [f"{status}: {name}: {text}" for name, text, status in checked if status != "SUCCESS"]
    problems += wrong[:SHOWN] + ([f"and {len(wrong) - SHOWN} more"] if len(wrong) > SHOWN else [])
    if not reaches or not checked:
        problems.append("it states nothing")
    return len(checked), problems


def prove(proof: Proof, run: Run) -> Outcome:
    """Run it."""
    command = command_of(proof, run)

    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
        resource.prlimit(process.pid, resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.prlimit(process.pid, resource.RLIMIT_CPU, (ceil(run.limit), ceil(run.limit)))
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        properties, problems = judge(output.read())
    seconds = usage.ru_utime + usage.ru_stime
    if process.returncode < 0:
        properties, problems = 0, [f"not decided in {run.limit:g} s of processor time"]
    if problems:
        problems.append("see for yourself: " + shlex.join(os.path.relpath(w, ROOT) if w.startswith("/") else w for w in command) + " --trace")
    return Outcome(proof, run, seconds, properties, tuple(problems))


def report(outcome: Outcome) -> None:
    """One line; what is wrong below it."""
    print(f"  {'FAILED' if outcome.problems else 'ok'}  {outcome.title}: {outcome.properties} properties, {outcome.seconds:.1f} s", flush=True)
    for problem in outcome.problems:
        print(f"      {problem}", flush=True)


def say(gate: str, outcomes: Sequence[Outcome]) -> None:
    """What the gate promises: the first sentence of each proof, and what was proven of it."""
    said = [
        (
            "No undefined behaviour, no overrun of an array and no endless loop in these public functions, for all inputs their headers allow, at the sizes below",
            f"{len({f for o in outcomes for f in o.proof.proves})} of {len(public_functions())} public functions, {len(outcomes)} runs of "
            f"{len({o.proof for o in outcomes})} proofs, {sum(o.properties for o in outcomes)} properties proven",
        )
    ]
    for proof in dict.fromkeys(o.proof for o in outcomes):
        own = [o for o in outcomes if o.proof is proof]
        sentence = re.split(r"(?<!\.)\.(?= [A-Z]|$)", proof.says)[0]
        sizes = "; ".join(" ".join((o.run.real, *o.run.defines)) for o in own)
        said.append((sentence, f"{proof.name}, {sum(o.properties for o in own)} properties: {sizes}"))
    write(gate, said)


def prepare() -> int:
    """The checked copy of the library. Returns its subscripts."""
    count = 0
    for source in sorted((ROOT / "firmware").glob("src/*.c")) + sorted((ROOT / "firmware").glob("include/hullguard/*.h")):
        count += instrument(source, BUILD / "source" / source.relative_to(ROOT))
    return count


def main() -> int:
    """As the module says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--deep", action="store_true", help="the runs that take long")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="runs at a time")
    parser.add_argument("--list", action="store_true", help="only list the proofs")
    parser.add_argument("names", nargs="*", help="parts of names of files or proofs")
    options = parser.parse_args()
    kind = "deep" if options.deep else "check"
    try:
        every = [p for source in sorted(HERE.glob("*.c")) for p in proofs_in(source)]
        chosen = [(p, r) for p in every for r in p.runs if r.kind == kind and (not options.names or any(n in f"{p.source.stem} {p.name}" for n in options.names))]
        if options.list:
            print("\n".join(f"{p.source.stem}: {p.name}: {p.says}" for p in dict.fromkeys(p for p, _ in chosen)))
            return 0
        if not chosen:
            raise ProofError(f"no proof has one of these in its name: {' '.join(options.names)}")
        check_stubs(every)
        if not options.names:
            check_coverage(every)
        subscripts = prepare()
        chosen.sort(key=lambda pair: -pair[1].limit)
        with ThreadPoolExecutor(options.jobs) as pool:
            outcomes = []
            for future in as_completed(pool.submit(prove, p, r) for p, r in chosen):
                outcomes.append(future.result())
                report(outcomes[-1])
    except (ProofError, InstrumentError) as error:
        print(f"proofs: {error}", file=sys.stderr)
        return 2
    failed = [o for o in outcomes if o.problems]
    sums = f"{sum(o.properties for o in outcomes)} properties, {sum(o.seconds for o in outcomes):.0f} s of processor time"
    print(f"{len(outcomes) - len(failed)} of {len(outcomes)} proven, {sums}; {subscripts} subscripts instrumented")
    if not options.names and not failed:
        say("proofs-deep" if options.deep else "proofs", sorted(outcomes, key=lambda o: (every.index(o.proof), o.proof.runs.index(o.run))))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
