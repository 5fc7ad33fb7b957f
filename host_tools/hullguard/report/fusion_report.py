"""The report of a fusion run: errors within their standard deviations, who spoke, whom the consistency test suspects, and what sending costs beside other ways."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hullguard.campaign import fusion_compare
from hullguard.campaign.fusion_compare import Way
from hullguard.codegen.names import unit_of
from hullguard.design.fusion_model import FusionDesign
from hullguard.errors import InputError
from hullguard.model.table import Array
from hullguard.report.page import AMBER, BLUE, GREEN, INK, PINK, RC, RED, SKY, Cell, esc, num, page, percent, picture, plural, table, tile

COMPARED = "compare.json"
CHANGES_MAX = 100
COLOURS = (BLUE, AMBER, GREEN, PINK, SKY, RED)
# Bytes of 100 samples of five sensors, frames of 5 bytes, and what the source says of the errors.
SOURCE = (
    ("periodic", 2500, "the reference"),
    ("observation trigger", 1200, ""),
    ("innovation trigger", 1050, "below periodic"),
    ("variance trigger", 1100, "below periodic"),
)


@dataclass(frozen=True)
class Run:
    """What a run's folder holds."""

    info: dict[str, Any]
    column: dict[str, Array]

    @property
    def time(self) -> Array:
        """Seconds."""
        return self.column["time_s"]


def read_run(directory: Path) -> Run:
    """run.json and signals.csv."""
    try:
        info = json.loads((directory / "run.json").read_text(encoding="utf-8"))
        with (directory / "signals.csv").open(encoding="utf-8") as file:
            header = file.readline().strip().split(",")
            data = np.loadtxt(file, delimiter=",", ndmin=2)
    except (OSError, ValueError) as error:
        raise InputError(f"{directory}: not the folder of a run ({error}); make it with hullguard run --out") from error
    return Run(info, {name: data[:, i] for i, name in enumerate(header)})


# --- figures -------------------------------------------------------------------------------------------------------------------------------


def _mark_faults(axes: Axes, run: Run) -> None:
    for f in run.info["faults"]:
        axes.axvline(f["start"] * run.info["sample_time_s"], color=RED, linewidth=0.9, linestyle=(0, (4, 2)))
        if f["detected_at"] is not None:
            axes.axvline(f["detected_at"] * run.info["sample_time_s"], color=RED, linewidth=1.2)


def errors_figure(run: Run, states: list[str]) -> Figure:
    """Error of each state within two of its standard deviations."""
    figure = Figure(figsize=(9.2, 1.15 * len(states) + 0.5), layout="constrained")
    every = figure.subplots(len(states), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(every, states, strict=True):
        error, spread = run.column[f"{name}.estimate"] - run.column[name], 2.0 * run.column[f"{name}.deviation"]
        axes.fill_between(run.time, -spread, spread, color=SKY, alpha=0.3, linewidth=0)
        axes.plot(run.time, error, color=BLUE, linewidth=0.8)
        axes.set_ylabel("\n".join([name.rpartition("_")[0].replace("_", " ") or name, unit_of(name)]), rotation=0, ha="right", va="center")
        high = 1.6 * float(np.percentile(spread[min(20, len(spread) - 1) :], 98))
        axes.set_ylim(-high, high)
        _mark_faults(axes, run)
    every[-1].set_xlabel("time, s")
    return figure


def events_figure(run: Run, names: list[str]) -> Figure:
    """Frames of every sensor; lost ones; the consistency test's scores."""
    scored = f"{names[0]}.score" in run.column
    figure = Figure(figsize=(9.2, 0.24 * len(names) + (3.0 if scored else 1.0)), layout="constrained")
    rows = figure.subplots(2 if scored else 1, 1, sharex=True, squeeze=False, height_ratios=[0.24 * len(names) + 0.3, 1.7] if scored else [1])[:, 0]
    for i, name in enumerate(names):
        sent, lost = run.column[f"event.{name}"] > 0, run.column[f"lost.{name}"] > 0
        rows[0].plot(run.time[sent & ~lost], np.full(int((sent & ~lost).sum()), i), "|", color=COLOURS[i % len(COLOURS)], markersize=7, markeredgewidth=0.7)
        rows[0].plot(run.time[lost], np.full(int(lost.sum()), i), "x", color=RED, markersize=3.5, markeredgewidth=0.9)
    rows[0].set_yticks(range(len(names)), names)
    rows[0].set_ylim(len(names) - 0.4, -0.6)
    rows[0].grid(axis="y", visible=False)
    _mark_faults(rows[0], run)
    if scored:
        for i, name in enumerate(names):
            rows[1].plot(run.time, run.column[f"{name}.score"], color=COLOURS[i % len(COLOURS)], linewidth=0.9, label=name)
        rows[1].axhline(run.info.get("consistency_limit", 24.0), color=INK, linewidth=0.8, linestyle=(0, (2, 2)))
        rows[1].set_ylabel("score")
        rows[1].set_ylim(bottom=0.0)
        rows[1].legend(loc="upper left", ncols=min(len(names), 5))
        _mark_faults(rows[1], run)
    rows[-1].set_xlabel("time, s")
    return figure


def ways_figure(ways: list[Way]) -> Figure:
    """Error by the share of lost frames, a line a way to send."""
    figure = Figure(figsize=(9.2, 3.8), layout="constrained")
    axes = figure.subplots()
    for i, name in enumerate(dict.fromkeys(w.name for w in ways)):
        part = sorted((w for w in ways if w.name == name), key=lambda w: w.loss)
        own, style = name.startswith("this model"), ("-", "--", ":")[i // len(COLOURS) % 3]
        label = f"{name}: {part[0].bits:.1f} bits"
        axes.plot(
            [100 * w.loss for w in part],
            [w.error for w in part],
            style,
            marker="o",
            markersize=3,
            color=INK if own else COLOURS[i % len(COLOURS)],
            linewidth=2.0 if own else 1.0,
            label=label,
        )
    axes.set_ylim(0.95, min(2.6, 1.03 * max(w.error for w in ways)))
    axes.set_xlabel("frames lost, %")
    axes.set_ylabel("position error over lossless periodic")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


# --- sections ------------------------------------------------------------------------------------------------------------------------------


def _summary(run: Run) -> list[str]:
    info, frames = run.info, run.info["frames"]
    found, false, copies = info["faults"], info["false_alarms"]["confirmed"], info["copies"]
    share, whole = frames["bits_sensors"] / max(1, frames["bits_sensors_periodic"]), frames["bits"] / max(1, frames["bits_periodic"])
    hits = [f for f in found if f["detected_at"] is not None]
    said = f"{len(hits)} of {plural(len(found), 'faulty sensor')} found" if found else "no fault injected"
    late = ", ".join(f"{f['name']} after {plural(f['delay'], 'sample')}" for f in hits)
    return [
        f"<h1>{esc(info['model'])}: {esc(said)}</h1>",
        f'<p class="lead">Scenario {esc(info["scenario"])}, {plural(info["samples"], "sample")} of {num(info["sample_time_s"])} s, '
        f"{percent(info['loss'])} of the frames lost, {percent(info['late'])} after the tick of their sample, seed {info['seed']}; bus: {esc(info['bus'])}. {esc(late)}</p>",
        '<div class="tiles">',
        tile("faulty sensors found", f"{len(hits)} of {len(found)}", late or "no fault", "good" if len(hits) == len(found) else "bad"),
        tile("false alarms", str(false), "a stated rate, not a bound", "bad" if false else "good"),
        tile("sensors' bits", percent(share), f"of periodic; {percent(whole)} with tick, verdicts, estimates"),
        tile(
            "copies of the filter",
            str(copies["nodes"]),
            f"differ in {plural(copies['samples_unequal'], 'sample')}; digest {copies['digest']}",
            "bad" if copies["samples_unequal"] else "good",
        ),
        "</div>",
    ]


def _errors(run: Run, made: FusionDesign) -> list[str]:
    states = [s for s in made.model.plant.states if f"{s}.estimate" in run.column]
    rows = [[n, e["rms"], e["deviation"], e["predicted"], percent(e["within_2_deviations"])] for n, e in run.info["errors"].items()]
    head = ["state", "#rms error", "#its own deviation", "#predicted", "#within two deviations"]
    return [
        "<h2>Estimates</h2>",
        picture(
            errors_figure(run, states),
            "errors",
            "Errors of the estimate",
            "Estimate less truth, and two of the filter's own standard deviations either way. Dashed: a fault begins; solid: its sensor is out.",
        ),
        table(head, rows, "From sample 100 to the first fault. Predicted: by the design, without losses. A consistent filter has 95 % within two deviations."),
    ]


def _events(run: Run, made: FusionDesign) -> list[str]:
    names = made.model.names
    rows = [[n, s["frames"], s["rate"], s["lost"]] for n, s in run.info["per_sensor"].items()]
    frames = run.info["frames"]
    kinds = [["sensors", frames["bits_sensors"], frames["bits_sensors_periodic"]], ["tick", frames["bits_tick"], frames["bits_tick"]]]
    kinds += [["verdict and status", frames["bits_verdicts"], frames["bits_verdicts"]], ["estimates", frames["bits_estimates"], frames["bits_estimates"]]]
    kinds.append(["all", frames["bits"], frames["bits_periodic"]])
    return [
        "<h2>Frames, and who is suspected</h2>",
        picture(
            events_figure(run, names),
            "events",
            "Frames and scores",
            "Frames of each sensor, lost ones as crosses; below, what speaks for a bias of each sensor (twice the logarithm of a likelihood ratio), and its limit.",
        ),
        table(["sensor", "#frames", "#a sample", "#lost"], rows),
        table(
            ["frames", "#bits", "#if every sensor sent every sample"],
            kinds,
            f"Exact, stuff bits included; bus load {percent(frames['load_mean'])}, at most {percent(frames['load_bound'])}.",
        ),
    ]


def _ways(ways: list[Way], made: FusionDesign) -> list[str]:
    names = list(dict.fromkeys(w.name for w in ways))
    losses = sorted({w.loss for w in ways})
    by = {(w.name, w.loss): w for w in ways}
    rows = []
    for name in names:
        first = by[name, losses[0]]
        consistent = first.nees is None or abs(first.nees - 1.0) < 0.1
        nees = Cell("by construction", "") if first.nees is None else Cell(num(first.nees), "" if consistent else "bad")
        rows.append([name, f"{first.frames:.3f}", f"{first.bits:.1f}", *(f"{by[name, p].error:.3f}" for p in losses), nees])
    head = ["way to send", "#frames", "#bits", *(f"#error, {100 * p:g} % lost" for p in losses), "#NEES / states"]
    about = "Frames and bits a sensor and sample without losses; position error over lossless periodic sending; NEES over the number of states without losses: 1 is consistent."
    return [
        "<h2>Beside other ways to send</h2>",
        picture(ways_figure(ways), "ways", "Errors and losses", "Each line a way to send, with its bits a sensor and sample. Errors beyond 2.6 are not drawn."),
        table(head, rows, about),
        f'<p class="note">{fusion_compare.SIZE.runs} runs of {fusion_compare.SIZE.samples} samples each, emulated by the model\'s own noise; the same plant and noise for all. '
        "Other triggers are tuned to this model's rate. Batches wait for up to a sample and need no model at the sensor: at short sample times they come near.</p>",
        *_published(by, made),
    ]


def _published(by: dict[tuple[str, float], Way], made: FusionDesign) -> list[str]:
    """The source's table, and why one of its claims cannot hold."""
    measured = {
        "periodic": "periodic",
        "observation trigger": "observation trigger, silence unused",
        "innovation trigger": f"this model: {made.model.trigger.kind}, silence used",
        "variance trigger": "variance about the line",
    }
    rows = [[name, size, percent(size / SOURCE[0][1]), claim, percent(by[measured[name], 0.0].frames), by[measured[name], 0.0].error] for name, size, claim in SOURCE]
    head = ["trigger", "#bytes, source", "#share", "error, source", "#share here", "#error here"]
    best = min((w for (name, loss), w in by.items() if loss == 0.0 and name != "periodic"), key=lambda w: w.error)
    return [
        "<h3>The source's table</h3>",
        table(
            head,
            rows,
            "Five sensors, 100 samples, frames of 5 bytes there. Shares here are of frames; errors over periodic sending. The source prints no error figures.",
        ),
        "<p>The source finds errors below those of periodic sending for its innovation and variance triggers. With the right model that cannot be. "
        "What an event-triggered node has heard is a part of what a periodic one hears, and the best estimate from a part of the data has no smaller mean squared error "
        "than the best estimate from all of it: E|x − E[x|G]|² ≥ E|x − E[x|F]|² wherever G is contained in F. "
        f"Measured here, the best way beside periodic sending is {esc(best.name)}, {num(best.error, 4)} times the error. The true claim is another: "
        "at equal bits events are far better than periodic sending, when silence is used as information. A variance of raw readings measures motion, not information.</p>",
    ]


def _verdicts(run: Run) -> list[str]:
    rows = [
        [v["k"], v["plant"], ", ".join(v["candidates"]) or "–", ", ".join(f"{n} {s}" for n, s in v["bus"].items() if s != "good") or "all good"]
        for v in run.info["verdicts"][:CHANGES_MAX]
    ]
    more = len(run.info["verdicts"]) - CHANGES_MAX
    counted = [[n, c] for n, c in run.info["communication"].items() if c and not n.endswith(".good")]
    return [
        "<h2>Verdicts</h2>",
        table(
            ["#sample", "sensors", "suspected", "links"],
            rows,
            f"{more} more changes are in run.json." if more > 0 else "Every change. A suspected sensor is out of the fusion in every node from the next sample on.",
        ),
        *([table(["counter", "#frames"], counted, "What else was counted on the links.")] if counted else []),
        '<p class="note">The basis is statistical: probabilities that hold with the model\'s noise, not bounds. The rate of false alarms is judged by make fusion-study.</p>',
    ]


def compared(directory: Path, made: FusionDesign) -> list[Way]:
    """The comparison of this very model, kept in the folder because it takes seconds."""
    path, key = directory / COMPARED, f"{made.tables.hash:08x}"
    kept = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    if kept.get("model_hash") == key:
        return [Way(**row) for row in kept["ways"]]
    ways = fusion_compare.compare(made)
    path.write_text(json.dumps({"model_hash": key, "ways": [asdict(w) for w in ways]}, indent=1) + "\n", encoding="utf-8")
    return ways


def write_fusion_report(directory: Path, made: FusionDesign) -> Path:
    """Write report.html."""
    run = read_run(directory)
    with mpl.rc_context(RC):
        body = [*_summary(run), *_errors(run, made), *_events(run, made)]
        if fusion_compare.independent(made) and made.model.trigger.kind == "innovation":
            body += _ways(compared(directory, made), made)
    body += _verdicts(run)
    path = directory / "report.html"
    path.write_text(page(f"{made.model.name}: {run.info['scenario']}", body), encoding="utf-8")
    return path
