"""The figures of the publication on suspensions, for every run of unknown-input observers: states, unknown inputs, faults, each within its radius."""

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

from hullguard.model.table import Array
from hullguard.report import run_figures as draw
from hullguard.report.columns import read_columns
from hullguard.report.page import AMBER, BLUE, INK, num, picture, table
from hullguard.report.run_data import Run

FILE = "estimates.csv"
HEIGHT = 1.6  # inches of a panel
PANELS = 8
LOOK = 1.5  # how much of a radius is shown around what moves within it
CAPTIONS = {
    "states": ("States and their estimates", "The emulated state, its estimate, and the band in which it must be: estimate ± radius."),
    "unknown": ("Unknown inputs", "What nobody measures: mean over each sample, low-passed, as it was and as it is estimated."),
    "errors": ("Errors of unknown inputs", "Estimate less truth within ± radius. It decays as the slowest mode does, faults or no faults: they are unknown inputs as well."),
    "faults": ("Estimates of faults", "Estimates within the radius that they have without a fault; one that leaves it proves a fault. Its truth is low-passed too."),
}


@dataclass(frozen=True)
class Estimate:
    """One estimate over a run."""

    observer: int
    name: str
    kind: str  # states | unknown | faults
    value: Array
    radius: Array
    truth: Array | None


def read_estimates(directory: Path, info: dict[str, Any]) -> list[Estimate]:
    """All of estimates.csv; none where a run has no unknown-input observer."""
    column = read_columns(directory / FILE)
    if not column:
        return []
    found = []
    for row in info["estimates"]:
        key = f"{row['observer']}.{row['name']}"
        found.append(Estimate(row["observer"], row["name"], row["kind"], column[key], column[f"{key}.radius"], column.get(f"{key}.truth")))
    return found


def section(run: Run, every: Sequence[Estimate]) -> Iterator[str]:
    """The figures with their captions, and what isolation found."""
    if not every:
        return
    yield "<h2>Estimates</h2>"
    first = min(e.observer for e in every)
    shown = {
        "states": [e for e in every if e.kind == "states" and e.observer == first],
        "unknown": [e for e in every if e.kind == "unknown" and e.observer == first],
        "errors": [e for e in every if e.kind == "unknown" and e.observer == first and e.truth is not None],
        "faults": [e for e in every if e.kind == "faults"],
    }
    for name, chosen in shown.items():
        if chosen:
            title, caption = CAPTIONS[name]
            yield picture(figure(run, chosen[:PANELS], name), f"estimates-{name}", title, caption)
    said = run.info.get("isolation", [])
    if said:
        rows = [
            [v["observer"], v["actuator"], v["cause"], ", ".join(v["candidates"]) or "–", num(v["explained"]), ", ".join(f"{n} {num(100 * s)} %" for n, s in v["share"].items())]
            for v in said
        ]
        yield table(
            ["#observer", "estimate of", "cause", "may be", "#explained by parts", "share that is missing"], rows, "What the estimates of forces stand for at the end of the run"
        )


def figure(run: Run, chosen: Sequence[Estimate], kind: str) -> Figure:
    """A panel an estimate."""
    sheet = draw.Sheet([HEIGHT] * len(chosen), 0.3, 0.68)
    axes: list[Axes] = []
    for e in chosen:
        ax = sheet.add(HEIGHT)
        _panel(ax, run, e, kind)
        draw.mark_faults(ax, run, draw.whole(run), labels=not axes)
        axes.append(ax)
    for ax in axes[:-1]:
        ax.tick_params(labelbottom=False)
    axes[-1].set_xlabel("time (s)")
    sheet.legend([*_legend(kind, any(e.truth is not None for e in chosen)), *draw.fault_legend(run)])
    return sheet.figure


def _panel(ax: Axes, run: Run, e: Estimate, kind: str) -> None:
    t = run.time
    middle = np.zeros_like(e.value) if kind in ("errors", "faults") else e.value
    line = e.value - e.truth if kind == "errors" and e.truth is not None else e.value
    ax.set_xlim(float(t[0]), run.end)
    draw.band(ax, t, middle - e.radius, middle + e.radius, BLUE, 0.15)
    if kind != "errors" and e.truth is not None:
        draw.line(ax, t, e.truth, INK, width=1.6, order=2.2)
    draw.line(ax, t, line, AMBER if kind == "errors" else BLUE, width=1.1, order=2.6)
    settled = e.radius[len(t) // 2 :]
    span = max(float(np.abs(line[len(t) // 10 :]).max(initial=0.0)), float(np.median(settled)) if kind != "states" else 0.0, 1e-12) * LOOK
    ax.set_ylim(-span, span)
    ax.set_ylabel(draw.unit_of(e.name)[1] or "estimate")
    draw.heading(ax, e.name, f"observer {e.observer}")


def _legend(kind: str, known: bool) -> list[Any]:
    made: list[Any] = [Line2D([], [], color=AMBER if kind == "errors" else BLUE, lw=1.4, label="error" if kind == "errors" else "estimate")]
    if known and kind != "errors":
        made.append(Line2D([], [], color=INK, lw=1.6, label="truth"))
    return [*made, Patch(color=BLUE, alpha=0.15, lw=0, label="± radius")]
