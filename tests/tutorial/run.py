"""The tutorial, followed to the letter: its shell blocks in order, in one shell, in an empty folder; what it shows is compared with what came.

A block of ```sh is run. The block of ```text behind it holds lines that must come in this order, others may stand between; ".." stands for anything, and a number with
a decimal point may differ by TOLERANCE, because a search may end elsewhere on another processor. A block of ```c PATH is written to that file. Blocks of ```sh setup
are run only where there is nothing yet: with --root, inside that root, as make tutorial-bare does.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "promises"))
from result import write_to

ROOT = Path(__file__).resolve().parents[2]
TUTORIAL = ROOT / "host_tools" / "docs" / "tutorial.md"
TOLERANCE = 0.1
BLOCK = re.compile(r"^```(?P<kind>sh|text|c)(?: (?P<more>[^\n]+))?\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


@dataclass
class Step:
    """One shell block."""

    line: int  # of the tutorial
    text: str
    setup: bool
    shown: list[str]  # lines that must come
    out: str = ""
    seconds: float = 0.0


def steps(source: str) -> list[Step]:
    """Shell blocks with what stands under them; files are written by blocks of their own."""
    found: list[Step] = []
    for block in BLOCK.finditer(source):
        line, kind, more, text = source.count("\n", 0, block.start()) + 1, block["kind"], block["more"], block["text"]
        if kind == "sh":
            found.append(Step(line, text, more == "setup", []))
        elif kind == "c":
            found.append(Step(line, f"cat >{shlex.quote(more)} <<'END_OF_FILE'\n{text}END_OF_FILE\n", False, []))
        else:
            found[-1].shown = text.splitlines()
    return found


def script(wanted: list[Step], folder: Path) -> str:
    """All steps as one script: output and times of step i in files of `folder`."""
    parts = ["set -eu", "stamp() { date +%s.%N; }"]
    for i, step in enumerate(wanted):
        parts += [f"exec >{shlex.quote(str(folder / f'{i}.out'))} 2>&1 </dev/null", f"stamp >{shlex.quote(str(folder / f'{i}.began'))}", step.text.rstrip()]
        parts.append(f"stamp >{shlex.quote(str(folder / f'{i}.ended'))}")
    return "\n".join(parts) + "\n"


def same(shown: str, line: str) -> bool:
    """Whether a line that is shown, ".." standing for anything, is in this line."""
    pieces = [NUMBER.split(p) for p in shown.split("..")]
    pattern = ".*".join(r"(\d+(?:\.\d+)?(?:e[+-]?\d+)?)".join(re.escape(x) for x in p) for p in pieces)
    found = re.search(pattern, line)
    return found is not None and all(close(a, b) for a, b in zip((n for p in shown.split("..") for n in NUMBER.findall(p)), found.groups(), strict=True))


def close(shown: str, came: str) -> bool:
    """Whether two numbers are the same, or as good as."""
    if "." not in shown and "e" not in shown:
        return shown == came
    return abs(float(shown) - float(came)) <= TOLERANCE * abs(float(shown))


def missing(step: Step) -> Iterator[str]:
    """Lines that are shown and did not come, in their order."""
    came = iter(step.out.splitlines())
    for shown in step.shown:
        if shown.strip() != ".." and not any(same(shown.strip(), line) for line in came):
            yield shown


def follow(wanted: list[Step], inside: list[str], root: Path, folder: Path, environment: dict[str, str]) -> int:
    """Run the script in `folder` (as seen from `root`); status of the shell."""
    kept = root / folder.relative_to("/")
    (kept / "log").mkdir(parents=True)
    (kept / "log" / "script").write_text(script(wanted, folder / "log"), encoding="utf-8")
    (kept / "work").mkdir()
    command = [*inside, "bash", "-c", f"cd {shlex.quote(str(folder / 'work'))} && exec bash {shlex.quote(str(folder / 'log' / 'script'))}"]
    status = subprocess.run(command, env=environment, check=False).returncode
    for i, step in enumerate(wanted):
        out, began, ended = (kept / "log" / f"{i}.{what}" for what in ("out", "began", "ended"))
        step.out = out.read_text(encoding="utf-8", errors="replace") if out.exists() else ""
        step.seconds = float(ended.read_text()) - float(began.read_text()) if ended.exists() else -1.0
    return status


def report(wanted: list[Step], status: int, show: bool) -> list[str]:
    """A line a step; what is wrong."""
    wrong = []
    for step in wanted:
        first = next(line for line in step.text.splitlines() if line.strip())
        if step.seconds < 0.0:
            wrong.append(f"tutorial.md:{step.line}: '{first}' ended with status {status}:\n{step.out}")
            break
        lost = list(missing(step))
        print(f"  {step.seconds:7.1f} s  line {step.line}: {first[:100]}")
        if show:
            print(step.out)
        wrong += [f"tutorial.md:{step.line}: does not come as shown: {line}\n{step.out}" for line in lost[:1]]
    return wrong


def main() -> int:
    """Follow it here, or in a bare root."""
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument("folder", type=Path, help="an empty folder to work in; it is made anew")
    p.add_argument("--root", type=Path, help="a bare root with the repository in /repository: begin with the set-up")
    p.add_argument("--show", action="store_true", help="print what every step says")
    p.add_argument("--minutes", type=float, default=20.0, help="longest time that all may take (default 20)")
    p.add_argument("--results", type=Path, help="file of what held")
    args = p.parse_args()
    wanted = [s for s in steps(TUTORIAL.read_text(encoding="utf-8")) if args.root or not s.setup]
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL_ENV", "HULLGUARD", "MAKE", "MFLAGS")) or not args.root}
    if args.root:
        environment |= {"REPOSITORY": "/repository", "HOME": "/root", "PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "LC_ALL": "C.UTF-8"}
        status = follow(wanted, ["chroot", str(args.root)], args.root, Path("/tutorial"), environment)
    else:
        shutil.rmtree(args.folder, ignore_errors=True)
        environment |= {"HULLGUARD": str(ROOT), "PATH": f"{ROOT / '.venv' / 'bin'}:{os.environ['PATH']}"}
        status = follow(wanted, [], Path("/"), args.folder.resolve(), environment)
    wrong = report(wanted, status, args.show)
    total = sum(max(s.seconds, 0.0) for s in wanted)
    print(f"  {total:7.1f} s  in all")
    if total > 60 * args.minutes:
        wrong.append(f"the tutorial took {total / 60:.1f} minutes, it promises less than {args.minutes:g}")
    for line in wrong:
        print(line, file=sys.stderr)
    if not wrong and args.results:
        compared = sum(len([x for x in s.shown if x.strip() != ".."]) for s in wanted)
        write_to(args.results, [("The tutorial, followed to the letter, says what it shows.", f"{len(wanted)} blocks run, {compared} lines compared")])
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
