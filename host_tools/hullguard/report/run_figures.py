"""The pictures of a run. Every picture takes a window of samples, so that a long run is shown whole and again around what matters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import ScaledTranslation, Transform
from numpy.typing import NDArray

from hullguard.bus.bits import bit_times
from hullguard.design.judges import OBSERVER
from hullguard.model.table import Array
from hullguard.report.page import AMBER, BLUE, EDGE, GREEN, INK, MUTED, PINK, RED, SKY
from hullguard.report.run_data import BUS, PLANT, FaultRun, GroupRun, Residual, Run, SignalRun

BINS = 600  # columns of a picture: a longer run is drawn as the least and largest of each column
PANELS = 8  # residuals drawn in full
WIDTH = 9.8  # inches
LEFT, RIGHT = 0.72, 0.2

# Fill and colour of the writing on it; the same in light and dark.
PLANT_FILL = {"starting": ("#b7bec6", "#14181c"), "none": ("#8fc9ea", "#14181c"), "provisional": ("#f2a81d", "#14181c"), "confirmed": ("#a5231b", "#ffffff")}
BUS_FILL = {"good": ("#8fc9ea", "#14181c"), "absent": ("#b7bec6", "#14181c"), "lossy": ("#f2a81d", "#14181c"), "stale": ("#5d429c", "#ffffff")}
PLANT_SAYS = {"starting": "starting", "none": "no fault", "provisional": "provisional", "confirmed": "fault confirmed"}

UNITS = {
    "mps2": "m/s²",
    "mps": "m/s",
    "m": "m",
    "s": "s",
    "rad": "rad",
    "radps": "rad/s",
    "deg": "°",
    "a": "A",
    "v": "V",
    "k": "K",
    "c": "°C",
    "bar": "bar",
    "pa": "Pa",
    "n": "N",
    "nm": "N m",
}


@dataclass(frozen=True)
class Window:
    """Part of a run."""

    first: int  # rows
    last: int

    @property
    def rows(self) -> slice:
        """For the columns of a run."""
        return slice(self.first, self.last)

    @property
    def size(self) -> int:
        """Samples."""
        return self.last - self.first


class Sheet:
    """Axes below one another, placed in inches."""

    def __init__(self, heights: Sequence[float], gap: float, top: float, bottom: float = 0.48, width: float = WIDTH) -> None:
        self.width, self.height = width, top + sum(heights) + gap * (len(heights) - 1) + bottom
        self.figure = Figure(figsize=(self.width, self.height), dpi=100)
        self.top = self.height
        self._y = self.height - top
        self._gap = gap

    def add(self, height: float, left: float = LEFT, right: float = RIGHT, keep: bool = False) -> Axes:
        """The next axes from the top; with `keep` another one follows in the same row."""
        width = self.width - left - right
        ax = self.figure.add_axes((left / self.width, (self._y - height) / self.height, width / self.width, height / self.height))
        if not keep:
            self._y -= height + self._gap
        return ax

    def legend(self, handles: Sequence[Artist], left: float = LEFT) -> None:
        """One line of legend above everything."""
        self.figure.legend(
            handles=list(handles),
            loc="upper left",
            bbox_to_anchor=(left / self.width, 1 - 0.05 / self.height),
            ncols=len(handles),
            borderaxespad=0.0,
            borderpad=0.1,
            columnspacing=1.4,
            handlelength=1.6,
            handletextpad=0.5,
        )


def unit_of(name: str) -> tuple[str, str]:
    """A signal's name without its unit, and the unit."""
    stem, _, last = name.rpartition("_")
    return (stem, UNITS[last]) if stem and last in UNITS else (name, "")


def _edges(n: int, bins: int) -> NDArray[np.intp]:
    return np.linspace(0, n, min(bins, n) + 1).astype(np.intp)[:-1]


def _is_long(n: int) -> bool:
    return n > 2 * BINS


def _ends(y: Array) -> tuple[Array, Array]:
    edges = _edges(len(y), BINS)
    return np.fmin.reduceat(y, edges), np.fmax.reduceat(y, edges)


def line(ax: Axes, t: Array, y: Array, color: str, step: bool = False, width: float = 1.1, order: float = 2.0, alpha: float = 0.75) -> None:
    """A line; of a long run the area between the least and the largest of each column, as dense as `alpha`."""
    y = np.where(np.isfinite(y), y, np.nan)
    if _is_long(len(y)):
        low, high = _ends(y)
        ax.fill_between(t[_edges(len(t), BINS)], low, high, facecolor=to_rgba(color, alpha), edgecolor=to_rgba(color, min(1.0, alpha + 0.2)), lw=0.5, zorder=order)
    elif step:
        ax.step(t, y, where="post", color=color, lw=width, zorder=order)
    else:
        ax.plot(t, y, color=color, lw=width, zorder=order)


def band(ax: Axes, t: Array, low: Array, high: Array, color: str, alpha: float, order: float = 1.5, step: bool = True) -> None:
    """The area between two lines."""
    if _is_long(len(low)):
        low, high = _ends(low)[0], _ends(high)[1]
        t = t[_edges(len(t), BINS)]
        ax.fill_between(t, low, high, color=color, alpha=alpha, lw=0, zorder=order)
    else:
        ax.fill_between(t, low, high, step="post" if step else None, color=color, alpha=alpha, lw=0, zorder=order)


def _number_ticks(ax: Axes, count: int = 4) -> None:
    ax.yaxis.set_major_locator(MaxNLocator(count, min_n_ticks=2))


def _limits(ax: Axes, run: Run, w: Window) -> None:
    ax.set_xlim(float(run.time[w.first]), float(run.time[w.last - 1]) + run.sample_time_s)


def _times(axes: Sequence[Axes]) -> None:
    """Time at the lowest axes only."""
    for ax in axes[:-1]:
        ax.tick_params(labelbottom=False)
    axes[-1].set_xlabel("time (s)")


def heading(ax: Axes, text: str, more: str = "", color: str = MUTED) -> None:
    """A panel's name above its left end, and a remark above its right one."""
    ax.text(0.0, 1.0, text, transform=_above(ax), ha="left", va="bottom", fontweight="bold")
    if more:
        ax.text(1.0, 1.0, more, transform=_above(ax), ha="right", va="bottom", color=color)


def _above(ax: Axes) -> Transform:
    return ax.transAxes + ScaledTranslation(0.0, 0.04, ax.figure.dpi_scale_trans)


def _top(run: Run, legend: float = 0.24, heading: bool = True) -> float:
    """Inches above the first axes: legend, names of the faults, heading."""
    crowded = any(0 < (b.start - a.start) * 1.0 < 0.04 * len(run.k) for a, b in zip(run.faults, run.faults[1:], strict=False))
    names = 0.0 if not run.faults else 0.34 if crowded else 0.2
    return legend + names + (0.24 if heading else 0.1)


def _label(ax: Axes, text: str, at: float, points: float) -> None:
    """The name of a fault, above the axes."""
    where = ax.get_xaxis_transform()
    ax.annotate(text, (at, 1.0), xycoords=where, xytext=(0, points), textcoords="offset points", ha="center", va="bottom", color=PINK, fontweight="bold")


def mark_faults(ax: Axes, run: Run, w: Window, labels: bool = False, above: float = 15.0) -> None:
    """Fault intervals as shaded areas, detection dashed, confirmation solid."""
    low, high = ax.get_xlim()
    taken = [-1e9, -1e9]
    for f in run.faults:
        start, end = run.at(f.start), run.end if f.end is None else run.at(f.end)
        if start < high and end > low:
            ax.axvspan(max(start, low), min(end, high), color=PINK, alpha=0.16, lw=0, zorder=0.5)
        if low <= start <= high:
            ax.axvline(start, color=PINK, lw=0.9, zorder=3)
        for k, style in ((f.detected, (0, (4, 2))), (f.confirmed, "-")):
            if k is not None and low <= run.at(k) <= high and not (style != "-" and f.confirmed == k):
                ax.axvline(run.at(k), color=RED, lw=1.2, ls=style, zorder=3)
        if labels and low <= start <= high:
            row = next((i for i, x in enumerate(taken) if start - x > 0.035 * (high - low)), None)
            if row is not None:
                taken[row] = start
                _label(ax, f.label, start, above + 10 * row)


def fault_legend(run: Run) -> list[Artist]:
    """What the marks mean, for those that occur."""
    out: list[Artist] = []
    if run.faults:
        out.append(Patch(facecolor=PINK, alpha=0.28, label="fault present"))
    if any(f.detected is not None and f.detected != f.confirmed for f in run.faults):
        out.append(Line2D([], [], color=RED, lw=1.2, ls=(0, (4, 2)), label="detected"))
    if any(f.confirmed is not None for f in run.faults):
        same = all(f.detected == f.confirmed for f in run.faults if f.confirmed is not None)
        out.append(Line2D([], [], color=RED, lw=1.2, label="detected and confirmed" if same else "confirmed"))
    return out


# --- residuals -----------------------------------------------------------------------------------------------------------


def chosen_residuals(run: Run, count: int = PANELS) -> tuple[list[Residual], int, int]:
    """Of observers and banks for detection the residuals worth a panel, and how many residuals and judges of theirs are left out.

    First the judges that alarmed, the first to alarm first, then those that came closest to it.
    """
    rank: dict[int, tuple[float, float]] = {}
    for r in run.detecting:
        over = np.flatnonzero(r.ratio > 1.0)
        key = (float(over[0]) if len(over) else np.inf, -float(r.ratio.max(initial=0.0)))
        rank[r.judge] = min(rank.get(r.judge, (np.inf, 0.0)), key)
    shown: list[Residual] = []
    order = sorted(rank, key=lambda g: (*rank[g], g))
    for g in order:
        mine = [r for r in run.detecting if r.judge == g]
        if len(mine) > count:
            closest = sorted(mine, key=lambda r: -float(r.ratio.max(initial=0.0)))[:count]
            mine = [r for r in mine if any(r is c for c in closest)]
        if len(shown) + len(mine) > count and shown:
            break
        shown += mine
    left = {r.judge for r in run.detecting} - {r.judge for r in shown}
    return shown, len(run.detecting) - len(shown), len(left)


def _residual_limit(r: Residual, w: Window, plant: Array) -> float:
    """Scale of a panel: thresholds of the running detector fill it; a residual far beyond is cut."""
    rows = w.rows
    running = plant[rows] > 0
    J = r.J[rows][running & np.isfinite(r.J[rows])]
    J = J if len(J) else r.J[rows][np.isfinite(r.J[rows])]
    usual = float(np.quantile(J, 0.98)) if len(J) else 1.0
    alarming = np.abs(r.r[rows][r.ratio[rows] > 1.0])
    largest = float(alarming.max(initial=0.0))
    return max(1.35 * usual, min(1.1 * largest, 4.0 * usual), 1e-12)


def draw_residual(ax: Axes, run: Run, w: Window, r: Residual, name: str = "") -> None:
    """One residual within its threshold, under another name if there is one.

    Of a bank it is |r|: the sign says nothing where the certificate may be another one in every sample.
    """
    t, rows = run.time[w.rows], w.rows
    _limits(ax, run, w)
    top = _residual_limit(r, w, run.plant)
    J = np.where(np.isfinite(r.J[rows]), r.J[rows], 10 * top)
    one_sided = r.kind != OBSERVER
    values = np.abs(r.r[rows]) if one_sided else r.r[rows]
    band(ax, t, np.zeros_like(J) if one_sided else np.maximum(-J, -2 * top), np.minimum(J, 2 * top), SKY, 0.17, 1.0, step=False)
    for sign in (1.0,) if one_sided else (1.0, -1.0):
        line(ax, t, sign * np.minimum(J, 2 * top), INK, width=0.8, order=2.2, alpha=0.3)
    line(ax, t, np.clip(values, -2 * top, 2 * top), BLUE, width=1.2, order=2.5)
    ax.set_ylim(0.0 if one_sided else -top, top)
    _number_ticks(ax)
    quiet = r.ratio[rows]
    first = min((f.start for f in run.faults), default=None)
    before = r.ratio if first is None else r.ratio[run.k < first]
    cut = bool(np.any(np.abs(r.r[rows]) > top))
    # The largest before the fault is what a reader checks; in a window without it, the largest of the window.
    more = (
        f"largest |r|/J: {before.max(initial=0.0):.2f} before the fault, {r.ratio.max(initial=0.0):.2f} overall"
        if first is not None
        else f"largest |r|/J {quiet.max(initial=0.0):.2f}"
    )
    heading(ax, (name or r.name) + (": |r|" if one_sided else ""), more + (", cut at the frame" if cut else ""))


def residual_legend(run: Run) -> list[Artist]:
    """For residual panels."""
    return [Line2D([], [], color=BLUE, lw=1.4, label="residual r"), Line2D([], [], color=INK, lw=0.9, label="threshold ±J"), *fault_legend(run)]


def residual_figure(run: Run, w: Window, residuals: Sequence[Residual]) -> Figure:
    """A panel a residual."""
    height = 1.45 if len(residuals) <= 3 else 1.05
    sheet = Sheet([height] * len(residuals), 0.3, _top(run))
    axes = []
    for i, r in enumerate(residuals):
        ax = sheet.add(height)
        draw_residual(ax, run, w, r)
        mark_faults(ax, run, w, labels=i == 0)
        axes.append(ax)
    _times(axes)
    sheet.legend(residual_legend(run))
    return sheet.figure


def ratio_figure(run: Run, w: Window, residuals: Sequence[Residual]) -> Figure:
    """Many residuals at once: |r|/J as colour."""
    n = len(residuals)
    height = max(0.6, min(0.17 * n, 4.0))
    sheet = Sheet([height], 0.0, _top(run, heading=False))
    left = _name_margin([r.name for r in residuals])
    ax = sheet.add(height, left=left, right=1.0)
    edges = _edges(w.size, BINS)
    data = np.array([np.maximum.reduceat(r.ratio[w.rows], edges) for r in residuals])
    shades = LinearSegmentedColormap.from_list("ratio", ["#eef4f8", "#9ccbe6", "#3f8fc0", "#0d4f80"]).with_extremes(over="#f08c00")
    low, high = float(run.time[w.first]), float(run.time[w.last - 1]) + run.sample_time_s
    image = ax.imshow(data, aspect="auto", interpolation="nearest", cmap=shades, vmin=0.0, vmax=1.0, extent=(low, high, n - 0.5, -0.5))
    ax.grid(False)
    ax.set_yticks(range(n), [r.name for r in residuals], fontsize=7.5 if n > 10 else 8)
    ax.set_xlabel("time (s)")
    bar = ax.inset_axes((1.02, 0.0, 0.016, 1.0))
    drawn = sheet.figure.colorbar(image, cax=bar, extend="max", ticks=[0, 0.5, 1])
    drawn.outline.set_visible(False)
    bar.set_ylabel("|r| / J")
    _limits(ax, run, w)
    mark_faults_above(ax, run)
    handles: list[Artist] = [Patch(facecolor="#f08c00", label="above its threshold")]
    if any(f.detected is not None for f in run.faults):
        handles.append(Line2D([], [], color=RED, marker="v", ls="", ms=5, mew=0, label="detected"))
    sheet.legend(handles, left)
    return sheet.figure


def mark_faults_above(ax: Axes, run: Run) -> None:
    """Names of the faults and instants of detection above the axes, for pictures whose colours must stay as they are."""
    low, high = ax.get_xlim()
    taken = -1e9
    above = ax.get_xaxis_transform()
    for f in run.faults:
        start = run.at(f.start)
        if low <= start <= high:
            ax.plot([start, start], [1.0, 1.0], "|", color=PINK, ms=9, mew=1.3, transform=above, clip_on=False, zorder=4)
            if start - taken > 0.035 * (high - low):
                taken = start
                _label(ax, f.label, start, 7.0)
        if f.detected is not None and low <= run.at(f.detected) <= high:
            mark = above + ScaledTranslation(0.0, 3.5 / 72, ax.figure.dpi_scale_trans)
            ax.plot([run.at(f.detected)], [1.0], "v", color=RED, ms=5, mew=0, transform=mark, clip_on=False, zorder=5)


# --- events --------------------------------------------------------------------------------------------------------------


def is_every_sample(g: GroupRun, samples: int) -> bool:
    """Whether a group sends with every sample."""
    return g.frames >= samples or (g.interval_max is not None and g.interval_max <= 1)


def draw_raster(ax: Axes, run: Run, w: Window) -> None:
    """A row a group: an event is a stroke; of a long run the share of samples with an event."""
    t, names = run.time[w.rows], []
    _limits(ax, run, w)
    for row, g in enumerate(run.groups):
        y = len(run.groups) - 1 - row
        event = g.event[w.rows] > 0
        if _is_long(w.size):
            edges = _edges(w.size, BINS // 4)
            share = np.add.reduceat(event.astype(float), edges) / np.diff(np.append(edges, w.size))
            ax.fill_between(np.append(t[edges], t[-1]), y, y + 0.8 * np.append(share, share[-1]), step="post", color=GREEN, alpha=0.85, lw=0, zorder=2)
            ax.axhline(y, color=EDGE, lw=0.6, zorder=1)
        else:
            at = t[event]
            x = np.column_stack([at, at, np.full(len(at), np.nan)]).ravel()
            ax.plot(x, np.tile([y, y + 0.8, np.nan], len(at)), color=GREEN, lw=1.0 if w.size < 450 else 0.6, zorder=2, solid_capstyle="butt")
        names.append((y + 0.4, g.name))
    ax.set_ylim(-0.15, len(run.groups) - 0.05)
    ax.set_yticks([y for y, _ in names], [n for _, n in names])
    ax.tick_params(axis="y", length=0)
    ax.grid(False, axis="y")


def _name_margin(names: Sequence[str]) -> float:
    """Inches that the names of groups need left of the axes."""
    return max(LEFT, 0.2 + 0.083 * max((len(n) for n in names), default=0))


def event_figure(run: Run, w: Window) -> Figure:
    """Instants of all groups, then the intervals of those that do not send every sample."""
    event = [g for g in run.groups if not is_every_sample(g, len(run.k))]
    raster = 0.12 + 0.3 * len(run.groups)
    height = 0.95 if len(event) <= 3 else 0.72
    sheet = Sheet([raster] + [height] * len(event), 0.34, _top(run, heading=False))
    left, hist = _name_margin([g.name for g in run.groups]), 1.9
    ax = sheet.add(raster, left=left, right=hist)
    draw_raster(ax, run, w)
    mark_faults(ax, run, w, labels=True, above=3.0)
    axes, bars = [ax], []
    share = "share of samples with a frame (full height: every sample)" if _is_long(w.size) else "frames of each group, a stroke each"
    sheet.figure.text(left / sheet.width, 1 - 0.05 / sheet.height, share, ha="left", va="top", color=MUTED)
    for g in event:
        ax = sheet.add(height, left=left, right=hist, keep=True)
        _draw_intervals(ax, run, w, g)
        mark_faults(ax, run, w)
        bar = sheet.add(height, left=sheet.width - hist + 0.25, right=RIGHT)
        _draw_histogram(bar, g, ax)
        axes.append(ax)
        bars.append(bar)
    _times(axes)
    for bar in bars[:-1]:
        bar.set_xlabel("")
    return sheet.figure


def _draw_intervals(ax: Axes, run: Run, w: Window, g: GroupRun) -> None:
    places = np.flatnonzero(g.event > 0)
    steps = np.diff(run.k[places]) if len(places) > 1 else np.zeros(0)
    at = places[1:]
    keep = (at >= w.first) & (at < w.last)
    at, steps = at[keep], steps[keep]
    _limits(ax, run, w)
    t = run.time[at]
    if len(at) > 2 * BINS:
        low, high = _ends(steps)
        ax.fill_between(t[_edges(len(t), BINS)], low, high, step="post", color=GREEN, alpha=0.5, lw=0, zorder=2)
        mean = np.add.reduceat(steps, _edges(len(t), BINS)) / np.diff(np.append(_edges(len(t), BINS), len(t)))
        ax.plot(t[_edges(len(t), BINS)], mean, color=GREEN, lw=0.9, zorder=2.4)
    elif len(at):
        x = np.column_stack([t, t, np.full(len(t), np.nan)]).ravel()
        y = np.column_stack([np.zeros(len(t)), steps, np.full(len(t), np.nan)]).ravel()
        ax.plot(x, y, color=GREEN, lw=0.8, zorder=2)
        if len(at) <= 400:
            ax.plot(t, steps, "o", color=GREEN, ms=2.4, mew=0, zorder=2.4)
    longest = max(float(g.interval_max or 1), float(steps.max(initial=1.0)))
    usual = float(np.quantile(steps, 0.98)) if len(steps) else longest
    cut = longest > 3 * usual  # a lost sender must not flatten the rest
    ax.set_ylim(0, 1.15 * (1.4 * usual if cut else longest))
    ax.yaxis.set_major_locator(MaxNLocator(4, integer=True, min_n_ticks=2))
    mean_text = "" if g.interval_mean is None else f"mean {g.interval_mean:.2f}, longest {g.interval_max:g}" + (", cut at the frame" if cut else "")
    heading(ax, f"{g.name}: samples between frames", mean_text)


def _draw_histogram(bar: Axes, g: GroupRun, beside: Axes) -> None:
    intervals = [i for i in g.histogram if g.histogram[i] > 0]
    counts = [g.histogram[i] for i in intervals]
    bar.barh(intervals, counts, height=0.72, color=GREEN, alpha=0.85, zorder=2)
    bar.set_ylim(beside.get_ylim())
    top = bar.get_ylim()[1]
    bar.yaxis.set_major_locator(MaxNLocator(4, integer=True, min_n_ticks=2))
    bar.tick_params(labelleft=False)
    most = max(counts, default=1)
    bar.set_xlim(0, 1.3 * most)
    bar.xaxis.set_major_locator(MaxNLocator(3, integer=True))
    if beside.bbox.height * 72 / beside.figure.dpi > 8 * top:
        for i, c in zip(intervals, counts, strict=True):
            if i < top:
                bar.text(c + 0.03 * most, i, f"{c}", va="center", ha="left", fontsize=7, color=MUTED)
    bar.set_xlabel("count")


# --- bus load ------------------------------------------------------------------------------------------------------------


def load_window(run: Run) -> int:
    """Samples over which the load is averaged: a second, at least ten samples, at most a tenth of the run."""
    return max(1, min(max(10, round(1.0 / run.sample_time_s)), max(len(run.k) // 10, 5), len(run.k)))


def load_figure(run: Run, w: Window) -> Figure:
    """Bus load over a sliding window, against sending everything every sample."""
    sheet = Sheet([1.7], 0.0, _top(run, heading=False))
    ax = sheet.add(1.7)
    frames = run.info["frames"]
    n = load_window(run)
    total = np.concatenate([np.zeros(1), np.cumsum(run.bits)])
    # Whole windows only: a shorter one at the start would show loads that no bus sees.
    load = np.full(len(run.bits), np.nan)
    load[n - 1 :] = 100 * (total[n:] - total[:-n]) / (n * run.sample_time_s * run.bitrate)
    _limits(ax, run, w)
    t = run.time[w.rows]
    fast, rate = float(frames.get("data_bits_periodic", 0)), float(run.info.get("data_bitrate", run.bitrate))
    periodic = 100 * bit_times(float(frames["bits_periodic"]), fast, run.bitrate, rate) / (len(run.k) * run.sample_time_s * run.bitrate)
    bound, mean = 100 * float(frames["load_bound"]), 100 * float(frames["load_mean"])
    band(ax, t, np.zeros(w.size), load[w.rows], BLUE, 0.18, step=False)
    line(ax, t, load[w.rows], BLUE, width=1.3)
    ax.axhline(periodic, color=AMBER, lw=1.5, ls=(0, (5, 2)), zorder=3.5)
    ax.axhline(bound, color=INK, lw=1.2, ls=(0, (1.5, 1.5)), zorder=2)
    ax.set_ylim(0, 1.12 * max(periodic, bound, float(np.nanmax(load, initial=0.0)), 1e-9))
    _number_ticks(ax, 5)
    ax.set_ylabel("bus load (%)")
    ax.set_xlabel("time (s)")
    mark_faults(ax, run, w, labels=True, above=3.0)
    sheet.legend(
        [
            Line2D([], [], color=BLUE, lw=1.4, label=f"event-triggered, mean {mean:.3g} %"),
            Line2D([], [], color=AMBER, lw=1.4, ls=(0, (5, 2)), label=f"periodic {periodic:.3g} %"),
            Line2D([], [], color=INK, lw=1.2, ls=(0, (1.5, 1.5)), label=f"worst case of the design {bound:.3g} %"),
        ]
    )
    return sheet.figure


# --- verdict -------------------------------------------------------------------------------------------------------------


def _bars(ax: Axes, run: Run, w: Window, row: float, state: Array, names: Sequence[str], fill: dict[str, tuple[str, str]], says: dict[str, str]) -> None:
    """A coloured bar; of a long run the worst state of each column."""
    state, t = state[w.rows], run.time[w.rows]
    if _is_long(len(state)):
        edges = _edges(len(state), BINS)
        state, t = np.maximum.reduceat(state, edges), t[edges]
    change = np.flatnonzero(np.diff(state)) + 1
    starts = np.concatenate([[0], change])
    stop = float(run.time[w.last - 1]) + run.sample_time_s
    ends = np.append(t[change], stop)
    span = stop - float(run.time[w.first])
    for name, (color, ink) in fill.items():
        code = names.index(name)
        least = 0.004 * span if code > 1 else 0.0  # what matters is seen however short it is
        spans = [(float(t[a]), max(float(b - t[a]), least)) for a, b in zip(starts, ends, strict=True) if state[a] == code]
        if not spans:
            continue
        ax.broken_barh(spans, (row - 0.36, 0.72), facecolors=color, lw=0, zorder=2)
        text = says.get(name, name)
        for left, length in spans:
            if length > (0.012 * len(text) + 0.01) * span:
                ax.text(left + 0.006 * span, row, text, ha="left", va="center", color=ink, fontsize=7.5, zorder=4)


def draw_verdict(ax: Axes, run: Run, w: Window) -> None:
    """The plant's verdict and the health of every group."""
    _limits(ax, run, w)
    rows = ["plant"] + [f"bus: {g.name}" for g in run.groups]
    _bars(ax, run, w, len(rows) - 1, run.plant, PLANT, PLANT_FILL, PLANT_SAYS)
    for i, g in enumerate(run.groups):
        _bars(ax, run, w, len(rows) - 2 - i, run.bus[g.name], BUS, BUS_FILL, {})
    ax.set_ylim(-0.6, len(rows) - 0.4)
    ax.set_yticks(range(len(rows) - 1, -1, -1), rows)
    ax.tick_params(axis="y", length=0)
    ax.grid(False)


def verdict_legend(run: Run) -> list[Artist]:
    """Only what occurs."""
    seen: list[Artist] = []
    for i, name in enumerate(PLANT):
        if np.any(run.plant == i):
            seen.append(Patch(facecolor=PLANT_FILL[name][0], label=PLANT_SAYS[name]))
    for i, name in enumerate(BUS):
        if i and any(np.any(h == i) for h in run.bus.values()):
            seen.append(Patch(facecolor=BUS_FILL[name][0], label=f"bus {name}"))
    return seen


def verdict_figure(run: Run, w: Window) -> Figure:
    """Verdict timeline."""
    rows = 1 + len(run.groups)
    height = 0.12 + 0.27 * rows
    sheet = Sheet([height], 0.0, _top(run, heading=False))
    left = _name_margin([f"bus: {g.name}" for g in run.groups])
    ax = sheet.add(height, left=left)
    draw_verdict(ax, run, w)
    ax.set_xlabel("time (s)")
    for f in run.faults:
        for k in (f.start, f.end):
            if k is not None and k < run.k[-1]:
                ax.axvline(run.at(k), color=PINK, lw=1.2, zorder=1)  # behind the bars
    mark_faults_above(ax, run)
    sheet.legend(verdict_legend(run), left)
    return sheet.figure


# --- candidates ----------------------------------------------------------------------------------------------------------

ALARM_FILL = {name: PLANT_FILL[name] for name in ("provisional", "confirmed")}
NO_SINGLE = "no single fault"


def candidates(run: Run) -> dict[str, Array]:
    """For each fault of the model, and for the case that none explains all alarms: index into PLANT where it is a candidate, 0 elsewhere, a sample."""
    state = {name: np.zeros(len(run.k), dtype=int) for name in (*run.known_faults, NO_SINGLE)}
    ends = [v.k for v in run.verdicts[1:]] + [run.k[-1] + 1]
    for v, end in zip(run.verdicts, ends, strict=True):
        if v.plant in ALARM_FILL:
            rows = slice(*np.searchsorted(run.k, [v.k, end]))
            for name in v.candidates or (NO_SINGLE,):
                state[name][rows] = PLANT.index(v.plant)
    if not state[NO_SINGLE].any():
        del state[NO_SINGLE]
    return state


def draw_candidates(ax: Axes, run: Run, w: Window, state: dict[str, Array]) -> None:
    """A row a fault of the model; a box marks where the fault was injected."""
    _limits(ax, run, w)
    for i, values in enumerate(state.values()):
        _bars(ax, run, w, len(state) - 1 - i, values, PLANT, ALARM_FILL, {})
    for f in run.faults:
        if f.fault in state:
            row = len(state) - 1 - list(state).index(f.fault)
            start, end = run.at(f.start), run.end if f.end is None else run.at(f.end)
            ax.broken_barh([(start, end - start)], (row - 0.46, 0.92), facecolors="none", edgecolors=PINK, lw=1.6, zorder=5)
    ax.set_ylim(-0.6, len(state) - 0.4)
    ax.set_yticks(range(len(state) - 1, -1, -1), list(state))
    ax.tick_params(axis="y", length=0)
    ax.grid(False, axis="y")


def candidate_figure(run: Run, w: Window) -> Figure:
    """Which fault it may be, in time."""
    state = candidates(run)
    height = 0.12 + 0.25 * len(state)
    sheet = Sheet([height], 0.0, _top(run, heading=False))
    left = _name_margin(list(state))
    ax = sheet.add(height, left=left)
    draw_candidates(ax, run, w, state)
    ax.set_xlabel("time (s)")
    mark_faults_above(ax, run)
    seen = {PLANT[i] for values in state.values() for i in np.unique(values)}
    handles: list[Artist] = [Patch(facecolor=fill, label=f"candidate, {name}") for name, (fill, _) in ALARM_FILL.items() if name in seen]
    if any(f.fault in state for f in run.faults):
        handles.append(Patch(facecolor="none", edgecolor=PINK, lw=1.6, label="fault present"))
    sheet.legend(handles, left)
    return sheet.figure


# --- signals -------------------------------------------------------------------------------------------------------------


def draw_signal(ax: Axes, run: Run, w: Window, s: SignalRun) -> None:
    """What the detector knows against what the sensor read."""
    t, rows = run.time[w.rows], w.rows
    reading, value, radius = s.reading[rows], s.value[rows], s.radius[rows]
    _limits(ax, run, w)
    low, high = value - radius, value + radius
    both = np.concatenate([reading[np.isfinite(reading)], value[np.isfinite(value)]])
    known = radius[np.isfinite(radius)]
    # Some stale samples, whose radius is the whole range, must not flatten the rest.
    usual = min(float(np.quantile(known, 0.95)), max(4 * float(np.median(known)), 0.5 * float(np.ptp(both)))) if len(known) and len(both) else 0.0
    bottom, top = (float(both.min()) - usual, float(both.max()) + usual) if len(both) else (-1.0, 1.0)
    pad = 0.06 * max(top - bottom, 1e-9)
    bottom, top = bottom - pad, top + pad
    cut = bool(np.any(low < bottom) or np.any(high > top))
    span = top - bottom
    band(ax, t, np.clip(low, bottom - span, top + span), np.clip(high, bottom - span, top + span), SKY, 0.38)
    line(ax, t, value, BLUE, step=True, width=1.1, order=2.2, alpha=0.35)
    line(ax, t, reading, INK, width=0.8, order=2.4, alpha=0.3)
    ax.set_ylim(bottom, top)
    _number_ticks(ax)
    name, unit = unit_of(s.name)
    heading(ax, name + (f" ({unit})" if unit else ""), f"radius ≤ {np.nanmax(radius, initial=0.0):.3g}" + (", cut at the frame" if cut else ""))


def signal_figure(run: Run, w: Window) -> Figure:
    """A panel a signal; in two columns where there are many."""
    columns = 1 if len(run.signals) <= 4 else 2
    rows = -(-len(run.signals) // columns)
    height = 1.25 if columns == 1 else 1.0
    sheet = Sheet([height] * rows, 0.34, _top(run))
    half = (sheet.width - LEFT - RIGHT - 0.62) / 2
    lowest: list[Axes] = []
    for i, s in enumerate(run.signals):
        column = i % columns
        last_of_row = column == columns - 1 or i == len(run.signals) - 1
        left = LEFT + column * (half + 0.62)
        right = RIGHT if columns == 1 else sheet.width - left - half
        ax = sheet.add(height, left=left, right=right, keep=not last_of_row)
        draw_signal(ax, run, w, s)
        mark_faults(ax, run, w, labels=i < columns)
        if i + columns < len(run.signals):
            ax.tick_params(labelbottom=False)
        else:
            ax.set_xlabel("time (s)")
        lowest.append(ax)
    band_mark = Patch(facecolor=SKY, alpha=0.5, label="value ± radius")
    sheet.legend(
        [
            Line2D([], [], color=INK, lw=0.9, label="reading of the sensor"),
            Line2D([], [], color=BLUE, lw=1.4, label="value at the detector"),
            band_mark,
            *fault_legend(run),
        ]
    )
    return sheet.figure


# --- for a README --------------------------------------------------------------------------------------------------------


def overview_figure(run: Run, w: Window, count: int = 3) -> Figure:
    """Residuals, events, verdict and, where banks isolate, candidate faults below one another."""
    residuals = near(run, w, chosen_residuals(run)[0], count)
    raster = 0.12 + 0.26 * len(run.groups)
    bars = 0.12 + 0.25 * (1 + len(run.groups))
    state = candidates(run) if run.isolating else {}
    causes = [0.12 + 0.22 * len(state)] if state else []
    sheet = Sheet([1.35] * len(residuals) + [raster, bars, *causes], 0.34, _top(run, 0.3), 0.5, 10.0)
    left = _name_margin([f"bus: {g.name}" for g in run.groups] + list(state))
    axes = []
    for i, r in enumerate(residuals):
        ax = sheet.add(1.35, left=left)
        draw_residual(ax, run, w, r)
        mark_faults(ax, run, w, labels=i == 0)
        axes.append(ax)
    ax = sheet.add(raster, left=left)
    draw_raster(ax, run, w)
    mark_faults(ax, run, w)
    heading(ax, "frames sent" if not _is_long(w.size) else "share of samples with a frame")
    axes.append(ax)
    ax = sheet.add(bars, left=left)
    draw_verdict(ax, run, w)
    heading(ax, "verdict")
    keys = verdict_legend(run)
    ax.legend(
        handles=keys,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=len(keys),
        borderaxespad=0.1,
        borderpad=0.1,
        columnspacing=1.2,
        handlelength=1.2,
        handletextpad=0.4,
    )
    axes.append(ax)
    for height in causes:
        ax = sheet.add(height, left=left)
        draw_candidates(ax, run, w, state)
        heading(ax, "which fault it may be")
        axes.append(ax)
    _times(axes)
    sheet.legend(residual_legend(run), left=left)
    return sheet.figure


def whole(run: Run) -> Window:
    """All of a run."""
    return Window(0, len(run.k))


def close_up(run: Run) -> tuple[Window, FaultRun] | None:
    """Samples around the first fault that was found, or else the first one; nothing for a run that is short anyway."""
    if not _is_long(len(run.k)) or not run.faults:
        return None
    f = min(run.faults, key=lambda f: (f.detected is None, f.start))
    seen = [k for k in (f.start, f.detected, f.confirmed) if k is not None and k < f.start + 500]
    first, last = f.start - 60, max(seen) + 90
    rows = np.searchsorted(run.k, [first, last])
    w = Window(int(rows[0]), int(rows[1]))
    return (w, f) if w.size > 10 else None


def near(run: Run, w: Window, residuals: Sequence[Residual], count: int) -> list[Residual]:
    """Of these residuals the ones with the largest |r|/J within a window, in their own order."""
    best = sorted(residuals, key=lambda r: -float(r.ratio[w.rows].max(initial=0.0)))[:count]
    return [r for r in residuals if any(r is b for b in best)]
