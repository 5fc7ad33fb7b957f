"""`make figures`: every picture and every measured table of the documentation, from the commands that stand beside them.

Pictures go to host_tools/pictures/. A table stands in a page between `<!-- measured: NAME -->` and `<!-- end -->`: the command first, then what it said. From the same sources and
packages the bytes are the same; `--check` makes all of it in build/ and fails where a picture or a table in the tree is another.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import re
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from hullguard.bus import candump
from hullguard.cli import main as hullguard
from hullguard.core.library import library
from hullguard.core.native import REST, Frame, Native
from hullguard.design.design import design
from hullguard.model import load_model
from hullguard.plant.detect import Detector
from hullguard.report.page import BLUE, GREEN, RC, RED
from hullguard.report.run_report import write_picture

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "promises"))
from result import write_to

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "host_tools" / "pictures"
PAGES = [ROOT / "host_tools" / "docs" / name for name in ("choosing.md", "guarantee.md")]
WORK = ROOT / "build" / "figures"
FAULT = "controller2"
REST_RUNS = f"platoon --scenario rest --runs 100 --seed 12 --fault {FAULT}:bias:1@100"
SHOWN = 1e6  # a fault that must be larger is one that the generator does not show
MEASURED = re.compile(r"(<!-- measured: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


# ---- commands ----


@cache
def said(command: str, good: tuple[int, ...] = (0,)) -> str:
    """Standard output of `hullguard COMMAND`, run in build/figures/, which must end with one of these exit statuses."""
    WORK.mkdir(parents=True, exist_ok=True)
    out = io.StringIO()
    with contextlib.chdir(WORK), contextlib.redirect_stdout(out):
        status = hullguard(shlex.split(command))
    if status not in good:
        raise SystemExit(f"hullguard {command}: exit status {status}")
    return out.getvalue()


def cases(command: str) -> list[dict[str, Any]]:
    """The cases of a campaign."""
    result = json.loads(said(f"{command} --json -q --workers 1"))
    return list(result.get("cases") or [result])


def smallest(options: str) -> str:
    """The smallest bias of the fault whose steady residual leaves the threshold, by the design alone."""
    generators = json.loads(said(f"design platoon --json -q --out design {options}"))["generators"]
    values = [g["smallest_fault"][FAULT] for g in generators if FAULT in g["smallest_fault"]]
    return f"{min(values):.2f}" if values and min(values) < SHOWN else "none"


def outcome(case: dict[str, Any]) -> list[str]:
    """What became of a case's runs: frames, found, delay, false alarms."""
    delay = f"{case['delay_mean']:.1f}" if case["detected_runs"] else "–"
    return [f"{100 * case['measurement_share']:.1f} %", f"{case['detected_runs']} of {case['runs']}", delay, str(case["false_alarm_runs"])]


FRAMES = ("frames", "frames, % of periodic", GREEN)  # column, label, colour
SMALLEST = ("smallest fault", "smallest fault, m/s²", BLUE)
EVERY = ("found in every run from", "found in every run from, m/s²", BLUE)
DELAY, DELAY_OF_1 = (("mean delay" + of, "delay of a fault of 1, samples", RED) for of in ("", " of 1"))
COST = ("multiplications a sample", "multiplications a sample", GREEN)
OUTCOME = ["frames", "found", "mean delay", "false alarms"]


# ---- tables ----


@dataclass(frozen=True)
class Table:
    """One measured table: the commands as a reader types them, and the rows they gave."""

    commands: tuple[str, ...]
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def text(self) -> str:
        """As markdown."""
        lines = ["| " + " | ".join(self.header) + " |", "|" + "---|" * len(self.header)]
        return "\n".join(["", *(f"    hullguard {c}" for c in self.commands), "", *lines, *("| " + " | ".join(row) + " |" for row in self.rows), "", ""])


@dataclass(frozen=True)
class Words:
    """Commands and what the last of them said."""

    commands: tuple[str, ...]
    lines: tuple[str, ...]

    def text(self) -> str:
        """As markdown."""
        return "\n".join(["", *(f"    hullguard {c}" for c in self.commands), "", *(f"    {line}" for line in self.lines), "", ""])


def varied(key: str, values: Sequence[str], title: str, extra: str = "") -> Table:
    """A campaign over one key, and the smallest fault that the design promises at each value."""
    every = f"{key}={','.join(values)}"
    command = f"campaign {REST_RUNS}{extra} --vary {shlex.quote(every)}"
    found = cases(command)
    rows = [(v, smallest(f"--set {key}={v}{extra}"), *outcome(c)) for v, c in zip(values, found, strict=True)]
    return Table((command, f"design platoon --set {key}=..{extra}"), (title, "smallest fault", *OUTCOME), tuple(rows))


def _code(options: str) -> str:
    return f"`{options}`" if options else ""


def chosen(ways: dict[str, str], title: str) -> Table:
    """A campaign for each of several sets of options."""
    rows = [(name, smallest(re.sub(r"--(real|plants) \w+", "", options)), *outcome(cases(f"campaign {REST_RUNS} {options}")[0]), _code(options)) for name, options in ways.items()]
    return Table((f"campaign {REST_RUNS} OPTIONS",), (title, "smallest fault", *OUTCOME, "options"), tuple(rows))


TRIGGER = "groups.measurement.trigger"


def trigger() -> Table:
    """Send on delta: the absolute threshold alone, against the smallest fault that is found in every run."""
    sigmas, sizes = ("0.01", "0.02", "0.05", "0.1", "0.2", "0.3"), "0.4,0.5,0.6,0.7,0.8,0.9,1,1.2,1.5"
    command = f"campaign {REST_RUNS} --set {TRIGGER}.delta=0 --size {sizes} --vary {TRIGGER}.sigma={','.join(sigmas)}"
    found = cases(command)
    rows = []
    for sigma in sigmas:
        here = [c for c in found if f"{c[f'{TRIGGER}.sigma']:g}" == sigma]
        every = [c["size"] for c in here if c["detected_runs"] == c["runs"]]
        one = next(c for c in here if c["size"] == 1.0)
        rows.append((sigma, f"{100 * one['measurement_share']:.1f} %", f"{min(every):g}", f"{one['delay_mean']:.1f}", str(sum(c["false_alarm_runs"] for c in here))))
    return Table((command,), ("sigma", "frames", "found in every run from", "mean delay of 1", "false alarms"), tuple(rows))


def kinds() -> Table:
    """Ways to trigger, at the same absolute threshold."""
    adaptive = f"--set {TRIGGER}.delta=[0.02,0.05] --set {TRIGGER}.silence=[0,1] --set {TRIGGER}.levels=4"
    ways = {
        "send on delta": f"--set {TRIGGER}.delta=0",
        "as shipped: relative part beside it": "",
        "hybrid: one sample of silence": f"--set {TRIGGER}.silence=1",
        "hybrid: two": f"--set {TRIGGER}.silence=2",
        "hybrid: two, with prediction": f"--set {TRIGGER}.silence=2 --set detector.prediction=true",
        "adaptive: four levels": adaptive,
    }
    return chosen(ways, "trigger")


def interval() -> Table:
    """The longest time between two frames."""
    return varied(f"{TRIGGER}.interval_max", ("2", "3", "5", "8", "11"), "interval_max")


def state() -> Table:
    """The bound of what disturbs each state, per sample."""
    return varied("plant.disturbance.state", ("0.0025", "0.005", "0.01", "0.02", "0.03"), "disturbance of each state")


def noise() -> Table:
    """The bound of each sensor's noise."""
    return varied("plant.disturbance.output", ("0.0025", "0.01", "0.02", "0.05"), "noise of each output")


def plants() -> Table:
    """What the plant's own uncertainty costs."""
    ways = {"none": ""} | {f"{100 * pm:g} %": f"--plants 100 --set plant.drag_per_s={{value=1.0,pm={pm:g}}}" for pm in (0.02, 0.05, 0.1)}
    return chosen(ways, "drag uncertain by")


def order() -> Table:
    """The observer's order: each searched with the same number of draws."""
    rows = []
    for n in range(1, 7):
        options = f"--set detector.observers.0.order={n}"
        cost = json.loads(said(f"design platoon --json -q --out design {options}"))["cost"][0]
        rows.append((str(n), smallest(options), *outcome(cases(f"campaign {REST_RUNS} {options}")[0]), str(cost["multiplications"]), str(cost["flash_bytes"])))
    return Table((f"campaign {REST_RUNS} --set detector.observers.0.order=..", "design platoon --json --set detector.observers.0.order=.."),
                 ("order", "smallest fault", *OUTCOME, "multiplications a sample", "flash, bytes"), tuple(rows))  # fmt: skip


def threshold() -> Table:
    """Hull, zonotope, number type."""
    zonotope = "--set 'detector.threshold=\"zonotope\"'"
    ways = {
        "hull": "",
        "hull in fixed point": "--real q31",
        "zonotope, 12 columns": zonotope,
        "zonotope, 6 columns": f"{zonotope} --set detector.zonotope.columns=6",
    }
    return chosen(ways, "threshold")


def banks() -> Table:
    """One observer and a bank of certificates beside what any sound detector could do."""
    command = f"limit platoon_bank --scenario rest --runs 20 --seed 77 --fault {FAULT}"
    rows = json.loads(said(f"{command} --json -q"))["rows"]
    names = list(rows[0]["detectors"])
    return Table((command,), ("fault", "limit", *names), tuple((f"{r['size']:g}", f"{r['limit']:.1f}", *(f"{r['detectors'][n]:.1f}" for n in names)) for r in rows))


def beyond() -> Table:
    """Noise beyond its bound on one sensor: what a broken promise does."""
    rows = []
    for size in ("0.02", "0.05", "0.1", "0.2", "0.5"):
        case = cases(f"campaign platoon --scenario rest --runs 100 --seed 12 --fault gap12_m:noise:{size}@100")[0]
        rows.append((size, f"{float(size) / 0.01 + 1.0:g}", f"{case['detected_runs']} of {case['runs']}"))
    return Table(
        ("campaign platoon --scenario rest --runs 100 --seed 12 --fault gap12_m:noise:..@100",), ("noise added to gap12_m, m", "times the bound", "runs with an alarm"), tuple(rows)
    )


def losses() -> Table:
    """Lost frames: provisional alarms that are taken back, and no confirmed one."""
    command = "campaign platoon --scenario manoeuvres --runs 200 --seed 13 --loss 0,0.1,0.3"
    rows = [(f"{c['loss']:g}", f"{c['provisional_alarm_runs']} of {c['runs']}", f"{c['false_alarm_runs']} of {c['runs']}") for c in cases(command)]
    return Table((command,), ("share of frames lost", "runs with a provisional alarm", "with a confirmed one"), tuple(rows))


def identified() -> Words:
    """Bounds from a recording, here of the emulated plant, whose own bounds are known: 0.01 each."""
    commands = (
        "run platoon --bus inprocess --scenario manoeuvres --no-fault --samples 1000 --seed 3 --out drive",
        "identify platoon --csv drive/signals.csv --bus-load 0.4 --force --out identified",
    )
    said(f"{commands[0]} -q")
    return Words(commands, tuple(line for line in said(commands[1]).splitlines() if not line.startswith("model: ")))


def attacked() -> Table:
    """Disturbances within their bounds, at random and chosen against the detector."""
    command = "campaign platoon --scenario manoeuvres --runs 200 --seed 13 --attack .."
    found = [(name, cases(command.replace("..", share))[0]) for name, share in (("at random", "0"), ("against the detector", "1"))]
    rows = [(name, f"{c['margin_settled_max']:.3f}", f"{c['false_alarm_runs']} of {c['runs']}") for name, c in found]
    return Table((command,), ("disturbances", "largest residual / threshold, settled", "runs with a false alarm"), tuple(rows))


def started() -> Table:
    """A detector that is told of another start than the plant has."""
    run = "run platoon --bus inprocess --scenario manoeuvres --no-fault --samples 300 --seed 3 --out moved"
    said(f"{run} -q")
    rows = []
    for name, options in (("0.5 m/s, 1 m: the plant's", ""), ("0.01 m/s, 0.01 m", " --set plant.initial_range={speed=0.01,gap=0.01}")):
        verdicts = json.loads(said(f"detect platoon --rest --log moved/run.log --json -q{options}", good=(0, 1)))["verdicts"]  # 1: not the model of the recorded node
        rows.append((name, ", ".join(f"{v['plant']} from sample {v['k']}" for v in verdicts), _code(options.strip())))
    return Table((run, "detect platoon --rest --log moved/run.log OPTIONS"), ("initial_range of the detector", "verdicts", "options"), tuple(rows))


MADE: tuple[Callable[[], Table | Words], ...] = (identified, trigger, kinds, interval, state, noise, plants, order, threshold, banks, beyond, attacked, started, losses)
TABLES = {f.__name__: cache(f) for f in MADE}


# ---- pictures ----


def _number(text: str) -> float:
    return float("nan") if text in ("none", "–") else float(text.removesuffix(" %"))


def curves(left: str, xlabel: str, x: str, y: tuple[tuple[str, str, str], ...], logarithmic: bool = False) -> Callable[[Path], None]:
    """A picture of one table: column `x` against columns of the table, an axis each: (column, label, colour)."""

    def draw(path: Path) -> None:
        table = TABLES[left]()
        assert isinstance(table, Table)
        column = {name: [_number(row[i]) for row in table.rows] for i, name in enumerate(table.header) if all(re.fullmatch(r"[\d.]+( %)?|none|–", row[i]) for row in table.rows)}
        with mpl.rc_context(RC):
            figure = Figure(figsize=(7.6, 2.5), layout="constrained")
            for ax, (name, label, colour) in zip(figure.subplots(1, len(y)), y, strict=True):
                ax.plot(column[x], column[name], "o-", color=colour, linewidth=1.4, markersize=4)
                ax.set(xlabel=xlabel, ylabel=label, ylim=(0, None))
                if logarithmic:
                    ax.set_xscale("log")
            FigureCanvasSVG(figure)
            figure.savefig(path, format="svg", metadata={"Date": None, "Creator": None}, facecolor="white")

    return draw


def platoon(path: Path) -> None:
    """The run that `make demo` shows."""
    said("run platoon --bus inprocess -q --out demo")
    write_picture(WORK / "demo", path)


TAMPERED = (
    "drop@id=verdict|status",  # the node that follows writes its own
    "corrupt:bits=3@id=measurement,p=0.3,k=40..140",
    "drop@id=measurement,p=0.1,k=40..140",
    "duplicate@id=control,p=0.1,k=40..140",
    "replay:frames=2,age=0.7@id=measurement,p=0.1,k=40..140",
    "bias:signal=gap12_m,size=0.8@k=160",
)


def monitor(path: Path) -> None:
    """The monitor on a recording: frames tampered with as README shows it, and the node's answers."""
    said("run platoon --bus inprocess -q --scenario manoeuvres --no-fault --samples 163 --out healthy")
    said("inject platoon --log healthy/run.log --seed 1 -q --out tampered " + " ".join(f"--do {shlex.quote(d)}" for d in TAMPERED))
    made = design(load_model("platoon", {}, None), fresh=False, tick=lambda what, step, total: None, workers=1)[0]
    entries: list[candump.Entry] = []
    answers: list[Frame] = []
    node = Detector(Native(library("f32"), made.tables), REST, False, answers.append, lambda verdict: None, made.model.sample_time_s)
    for entry in candump.read(WORK / "tampered" / "injected.log"):
        node.take(entry.frame, entry.time_s)
        entries += [entry, *(candump.Entry(entry.time_s, entry.channel, frame) for frame in answers)]
        answers.clear()
    candump.write(WORK / "answered.log", entries)
    said(f"monitor platoon --log answered.log --rest --plain -q --snapshot {shlex.quote(str(path))}")


PICTURE: dict[str, Callable[[Path], None]] = {
    "platoon.png": platoon,
    "monitor.svg": monitor,
    "trigger.svg": curves("trigger", "sigma, m and m/s", "sigma", (FRAMES, EVERY, DELAY_OF_1)),
    "order.svg": curves("order", "order of the observer", "order", (SMALLEST, DELAY, COST)),
    "bounds.svg": curves("state", "disturbance of each state", "disturbance of each state", (SMALLEST, DELAY)),
}  # fmt: skip


ELSEWHERE = ("motor.png",)  # of the tutorial: `make figures` takes it from its run


# ---- all of it ----


def filled(page: Path) -> str:
    """A page with its tables made anew."""
    return MEASURED.sub(lambda m: m[1] + TABLES[m[2]]().text() + m[3], page.read_text())


def main() -> int:
    """Write, or compare."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--check", action="store_true", help="write into build/figures/ and fail where the tree has another")
    parser.add_argument("only", nargs="*", help="pictures by name; none: all, and the tables")
    args = parser.parse_args()
    place = WORK / "pictures" if args.check else PICTURES
    place.mkdir(parents=True, exist_ok=True)
    stale = []
    for name in args.only or PICTURE:
        PICTURE[name](place / name)
        if args.check and (place / name).read_bytes() != (PICTURES / name).read_bytes():
            stale.append(f"host_tools/pictures/{name}")
    for page in () if args.only else PAGES:
        text = filled(page)
        if args.check and text != page.read_text():
            (WORK / page.name).write_text(text)
            stale.append(f"{page.relative_to(ROOT)} (as it would be: build/figures/{page.name})")
        elif not args.check:
            page.write_text(text)
    if stale:
        print("not what `make figures` makes: " + ", ".join(stale), file=sys.stderr)
        return 1
    if args.check and not args.only:
        passed(ROOT / "build" / "results")
    return 0


def passed(results: Path) -> None:
    """What the check has shown."""
    promise = "Every picture in host_tools/pictures and every measured table in host_tools/docs is, to the byte, what the commands beside it make."
    result = f"{len(PICTURE)} pictures, {len(TABLES)} tables"
    write_to(results / "figures-check.json", [(promise, result)])
    print(f"  ok  {result} of the documentation are as they were")


if __name__ == "__main__":
    sys.exit(main())
