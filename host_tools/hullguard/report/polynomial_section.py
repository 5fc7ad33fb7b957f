"""Polynomial filters in a run's report: degrees 1, 2 and 3 over the same values and radii, their errors, how honest their variances are, and what they find."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from hullguard.design.statistic import STATISTICS
from hullguard.model.table import Array
from hullguard.report import run_figures as draw
from hullguard.report.columns import read_columns
from hullguard.report.page import AMBER, BLUE, GREEN, INK, esc, num, picture, table
from hullguard.report.run_data import Run

FILE = "filters.csv"
HEIGHT = 1.5  # inches of a panel
COLOURS = (AMBER, BLUE, GREEN)  # of degrees 1, 2, 3
PANELS = 4
BAND = 2.0  # standard deviations
INTRO = (
    "The detector listens to one degree; the others follow the same values and radii beside it, heard by nobody. Degree 1 is the extended Kalman filter. Consistency is the "
    "mean of e²/P: 1 where the variance P that a filter claims is what its errors e have, above 1 where it promises too much."
)


@dataclass(frozen=True)
class Filter:
    """One filter over a run."""

    number: int
    degree: int
    own: bool
    facts: dict[str, Any]
    states: dict[str, tuple[Array, Array, Array | None]]  # estimate, deviation, truth
    ratio: dict[str, Array]  # r / J of each statistic


def read_filters(directory: Path, info: dict[str, Any]) -> list[Filter]:
    """All of filters.csv; none where a run has no polynomial filter."""
    column = read_columns(directory / FILE)
    if not column:
        return []
    found = []
    for row in info["filters"]:
        key = f"{row['filter']}.{row['degree']}."
        names = [n.removeprefix(key).removesuffix(".deviation") for n in column if n.startswith(key) and n.endswith(".deviation")]
        states = {n: (column[key + n], column[f"{key}{n}.deviation"], column.get(f"{key}{n}.truth")) for n in names}
        ratio = {s: column[f"{key}r.{s}"] / np.maximum(column[f"{key}J.{s}"], 1e-30) for s in STATISTICS}
        found.append(Filter(row["filter"], row["degree"], row["own"], row, states, ratio))
    return found


def section(run: Run, every: Sequence[Filter]) -> Iterator[str]:
    """The comparison as a table and two pictures."""
    if not every:
        return
    yield "<h2>Polynomial filters of each degree</h2>"
    yield f"<p>{esc(INTRO)}</p>"
    yield _comparison(every)
    first = [f for f in every if f.number == every[0].number]
    if all(t is not None for f in first for _, _, t in f.states.values()):
        caption = f"Estimate less truth as large as it was before a fault, and ± {BAND:g} standard deviations as the filter claims them, degree by degree."
        yield picture(error_figure(run, first), "filters-errors", "Errors of the estimates", caption)
    caption = "r/J of each statistic and degree; above 1 it is an alarm of that filter. Square roots of J2² and of the drift."
    yield picture(ratio_figure(run, first), "filters-statistics", "Statistics relative to their levels", caption)


def _comparison(every: Sequence[Filter]) -> str:
    states = list(every[0].facts.get("error_rms", {}))
    head = ["#filter", "#degree", "#RAM (bytes)", *[f"#error of {s}, rms" for s in states], *[f"#consistency of {s}" for s in states]]
    head += [f"#false alarms, {s}" for s in STATISTICS] + ([f"#delay, {s}" for s in STATISTICS] if every[0].facts["delay"] else [])
    rows = []
    for f in every:
        facts = f.facts
        row: list[Any] = [f.number, f"{f.degree}{' (used)' if f.own else ''}", facts["ram_bytes"], *[num(facts["error_rms"][s]) for s in states]]
        row += [num(facts["consistency"][s]) for s in states] + [f"{facts['false_alarms'][s]} of {facts['healthy_samples']}" for s in STATISTICS]
        rows.append(row + ["never" if facts["delay"][s] is None else facts["delay"][s] for s in STATISTICS if facts["delay"]])
    about = "Errors and false alarms are counted in the healthy samples in which the filter had settled; delays in samples from the first fault to that statistic's first alarm."
    return table(head, rows, about)


def _sheet(run: Run, rows: int) -> tuple[draw.Sheet, list[Axes]]:
    sheet = draw.Sheet([HEIGHT] * rows, 0.3, 0.68)
    axes = [sheet.add(HEIGHT) for _ in range(rows)]
    for i, ax in enumerate(axes):
        ax.set_xlim(float(run.time[0]), run.end)
        draw.mark_faults(ax, run, draw.whole(run), labels=i == 0)
        ax.tick_params(labelbottom=i == rows - 1)
    axes[-1].set_xlabel("time (s)")
    return sheet, axes


def error_figure(run: Run, every: Sequence[Filter]) -> Figure:
    """A panel a state and degree."""
    names = list(every[0].states)[:PANELS]
    sheet, axes = _sheet(run, len(names) * len(every))
    for i, name in enumerate(names):
        errors = [value - truth for value, _, truth in (f.states[name] for f in every) if truth is not None]
        healthy = slice(len(run.k) // 20, min((f.start for f in run.faults), default=len(run.k)))
        settled = max((float(np.abs(e[healthy]).max(initial=0.0)) for e in errors), default=0.0) * 1.15  # what a fault does may leave the panel
        widest = max(float(np.median(f.states[name][1])) for f in every) * BAND * 1.3
        for j, (f, error) in enumerate(zip(every, errors, strict=True)):
            ax, colour, deviation = axes[i * len(every) + j], COLOURS[f.degree - 1], f.states[name][1]
            draw.band(ax, run.time, -BAND * deviation, BAND * deviation, colour, 0.18)
            draw.line(ax, run.time, error, colour, width=1.0, order=2.6)
            ax.set_ylim(-max(settled, widest), max(settled, widest))
            ax.set_ylabel(draw.unit_of(name)[1] or "error")
            draw.heading(ax, name, f"degree {f.degree}{', the detector' + chr(8217) + 's' if f.own else ''}")
    sheet.legend([Line2D([], [], color=INK, lw=1.4, label="error"), Patch(color=INK, alpha=0.18, lw=0, label=f"± {BAND:g} standard deviations"), *draw.fault_legend(run)])
    return sheet.figure


def ratio_figure(run: Run, every: Sequence[Filter]) -> Figure:
    """A panel a statistic, a line a degree."""
    sheet, axes = _sheet(run, len(STATISTICS))
    for ax, name in zip(axes, STATISTICS, strict=True):
        for f in every:
            draw.line(ax, run.time, f.ratio[name], COLOURS[f.degree - 1], width=1.0, order=2.6)
        ax.axhline(1.0, color=INK, lw=0.8, ls=(0, (5, 2)))
        ax.set_ylim(0.0, max(1.2, *(float(np.quantile(f.ratio[name], 0.998)) * 1.1 for f in every)))
        ax.set_ylabel("r / J")
        draw.heading(ax, name, "")
    lines = [Line2D([], [], color=COLOURS[f.degree - 1], lw=1.4, label=f"degree {f.degree}") for f in every]
    sheet.legend([*lines, Line2D([], [], color=INK, lw=0.8, ls=(0, (5, 2)), label="level"), *draw.fault_legend(run)])
    return sheet.figure
