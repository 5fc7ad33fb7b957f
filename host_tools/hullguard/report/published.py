"""The four figures of the publication (platoon, sections 1 to 3): residuals before and after the post-filter, events, residuals with thresholds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hullguard.model.table import Array
from hullguard.report import run_figures as draw
from hullguard.report.page import AMBER, BLUE, GREEN, INK, PINK, picture
from hullguard.report.run_data import GroupRun, Run

COLORS = (BLUE, AMBER, GREEN, PINK)
HEIGHT = 1.9  # inches of the axes of one figure
TOP = 0.68  # above them: legend, name of the fault, title


def section(run: Run) -> Iterator[str]:
    """The figures with their captions."""
    after = [r.r for r in run.observing]
    event = [g for g in run.groups if not draw.is_every_sample(g, len(run.k))]
    yield "<h2>The figures of the publication</h2>"
    yield picture(
        residuals_figure(run, run.before, "Residuals before the post-filter", "r0"),
        "before",
        "Residuals before the post-filter",
        "Residuals of the observer alone, r0 = V y − W z − Qu u: values of event-triggered measurements, in the units of V y.",
    )
    yield picture(
        residuals_figure(run, after, "Residuals after the post-filter", "r, dimensionless"),
        "after",
        "Residuals after the post-filter",
        "The same residuals behind the optimal post-filter, r = R(z) r0, dimensionless.",
    )
    yield picture(
        instants_figure(run, event),
        "instants",
        "Event instants and intervals",
        "A stem for every frame of a measurement; its height is the time since the frame before, in samples.",
    )
    yield picture(
        thresholds_figure(run),
        "thresholds",
        "Residuals with their thresholds",
        f"{names(len(run.observing))} within their thresholds ±J; a fault is declared when one of them leaves its threshold.",
    )


def names(count: int) -> str:
    """R1, R2 .. as the publication calls them."""
    every = [f"R{i + 1}" for i in range(count)]
    return " and ".join([", ".join(every[:-1]), every[-1]] if count > 1 else every)


def residuals_figure(run: Run, values: Sequence[Array], title: str, unit: str) -> Figure:
    """All residuals in one picture."""
    sheet = draw.Sheet([HEIGHT], 0.0, TOP)
    ax = sheet.add(HEIGHT)
    w = draw.whole(run)
    ax.set_xlim(float(run.time[0]), run.end)
    for i, r in enumerate(values):
        draw.line(ax, run.time, r, COLORS[i % len(COLORS)], width=1.4, order=2.6 - 0.1 * i)
    ax.axhline(0.0, color=INK, lw=0.6, zorder=1)
    ax.set_ylabel(unit)
    ax.set_xlabel("time (s)")
    draw.heading(ax, title)
    draw.mark_faults(ax, run, w, labels=True)
    lines = [Line2D([], [], color=COLORS[i % len(COLORS)], lw=1.6, label=f"R{i + 1}") for i in range(len(values))]
    sheet.legend([*lines, *draw.fault_legend(run)])
    return sheet.figure


def instants_figure(run: Run, groups: Sequence[GroupRun]) -> Figure:
    """Stems: when each event-triggered group sent, and how long after the frame before."""
    sheet = draw.Sheet([1.5] * len(groups), 0.34, TOP)
    axes: list[Axes] = []
    for g in groups:
        ax = sheet.add(1.5)
        places = np.flatnonzero(g.event > 0)
        t, steps = run.time[places[1:]], np.diff(run.k[places])
        ax.set_xlim(float(run.time[0]), run.end)
        ax.vlines(t, 0.0, steps, color=GREEN, lw=1.1, zorder=2)
        ax.plot(t, steps, "o", color=GREEN, ms=4.0, mew=0, zorder=2.5)
        longest = int(g.interval_max or 1)
        ax.set_ylim(0, longest + 0.6)
        ax.set_yticks(range(longest + 1))
        ax.set_ylabel("interval (samples)")
        mean = "" if g.interval_mean is None else f"{g.frames} frames, intervals {g.interval_min:g} .. {g.interval_max:g}, mean {g.interval_mean:.2f}"
        draw.heading(ax, f"Event instants of {g.name}", mean)
        draw.mark_faults(ax, run, draw.whole(run), labels=not axes)
        axes.append(ax)
    for ax in axes[:-1]:
        ax.tick_params(labelbottom=False)
    if axes:
        axes[-1].set_xlabel("time (s)")
    stem = [Line2D([], [], color=GREEN, lw=1.1, marker="o", ms=4, mew=0, label="frame, as high as the interval before it")]
    sheet.legend([*stem, *draw.fault_legend(run)])
    return sheet.figure


def thresholds_figure(run: Run) -> Figure:
    """A panel a residual."""
    sheet = draw.Sheet([1.6] * len(run.observing), 0.3, TOP)
    axes: list[Axes] = []
    w = draw.whole(run)
    for i, r in enumerate(run.observing):
        ax = sheet.add(1.6)
        draw.draw_residual(ax, run, w, r, f"R{i + 1}")
        draw.mark_faults(ax, run, w, labels=not axes)
        axes.append(ax)
    for ax in axes[:-1]:
        ax.tick_params(labelbottom=False)
    axes[-1].set_xlabel("time (s)")
    sheet.legend(draw.residual_legend(run))
    return sheet.figure
