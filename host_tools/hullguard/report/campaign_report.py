"""The report of a campaign: one HTML file that needs nothing else, and its pictures as PNG too, from campaign.json alone."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hullguard.errors import InputError
from hullguard.model.detector import PUBLISHED
from hullguard.report.page import AMBER, BLUE, GREEN, INK, MUTED, PINK, RC, RED, SKY, Cell, num, page, percent, picture, plural, table, tile
from hullguard.report.run_report import STATISTICAL, UNSOUND

COLOURS = (BLUE, RED, GREEN, PINK, AMBER, SKY, INK, MUTED)
LINES_MAX = len(COLOURS)
BARS_MAX = 40  # cases of the picture of false alarms
Case = dict[str, Any]  # an entry of campaign.json's cases
GUARANTEE = (
    "No false alarm is confirmed as long as the plant and the bus keep within the bounds that the model states. Attacked runs are such: their disturbances stay within "
    "the bounds, but a linear programme has chosen them so that one residual at one sample comes as close to its threshold as it can. Where frames "
    "are lost a threshold can be too small until the loss shows: |r|/J may then pass 1, and the alarm is provisional until it is taken back or confirmed."
)


def write_campaign_report(directory: Path) -> Path:
    """Read campaign.json of a folder and write campaign.html and the pictures beside it."""
    source = directory / "campaign.json"
    try:
        result = json.loads(source.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{source}: not the result of a campaign ({error}); run hullguard campaign --out {directory}") from error
    drawn = list(_figures(result["cases"]))
    body = list(_body(result))
    for name, figure, caption in drawn:
        with mpl.rc_context(RC):
            body.append(picture(figure, name, caption, caption))
        with mpl.rc_context(RC | {"savefig.facecolor": "white"}):
            FigureCanvasAgg(figure)
            figure.savefig(directory / f"{name}.png", dpi=150)
    path = directory / "campaign.html"
    path.write_text(page(f"Campaign of {result['model']}", body), encoding="utf-8")
    return path


def _body(result: dict[str, Any]) -> Iterator[str]:
    cases: list[Case] = result["cases"]
    false = result["false_alarm_runs"]
    yield f"<h1>Campaign of {result['model']}</h1>"
    yield f'<p class="lead">{plural(len(cases), "case")}, {plural(result["runs"], "run")} of {result["samples"]} samples.</p>'
    tiles = [
        tile(
            "runs with a false alarm",
            num(false),
            f"confirmed; fewer than {percent(result['false_alarm_upper'])} with {percent(result['confidence'])} confidence",
            "bad" if false else "good",
        ),
        tile("provisional alarms", num(result["provisional_alarm_runs"]), "runs that had one before a fault"),
        tile("measurement frames", percent(result["measurement_share"]), "of periodic sending"),
        tile("largest |r|/J", num(result["margin_settled_max"]), "before a fault, once the start is over"),
    ]
    yield f'<div class="tiles">{"".join(tiles)}</div>'
    thresholds = result["thresholds"]
    if PUBLISHED in thresholds:
        yield f"<aside><p>{'In the cases with the threshold ' + PUBLISHED + ': n' + UNSOUND[1:] if len(thresholds) > 1 else UNSOUND}</p></aside>"
    if result.get("basis") == "statistical":
        yield f"<aside><p>{STATISTICAL}</p></aside>"
    elif thresholds != [PUBLISHED]:
        yield f"<p>{GUARANTEE}</p>"
    if "attacked" in result:
        header = ("runs", "#number", "#largest |r|/J", "#once the start is over", "#its mean over the runs")
        rows = [
            (label, r["runs"], r["margin_max"], r["margin_settled_max"], r["margin_settled_mean"])
            for label, r in (("attacked", result["attacked"]), ("others", result["not_attacked"]))
        ]
        yield table(header, rows, "Attacked runs and the others, before any fault")
    yield "<h2>Cases</h2>"
    columns = ["case", "#runs", "#provisional", "#confirmed", "#bound", "#frames", "#bits a\u00a0run", "#|r|/J", "#found", "#delay", "#10\u00a0%", "#90\u00a0%", "#limit"]
    told = len(columns) if any(c.get("limit") is not None for c in cases) else len(columns) - 1
    yield table(
        columns[:told],
        [_row(c)[:told] for c in cases],
        "False alarms in runs; bound: upper confidence bound of the share of runs with a confirmed one; delays in samples",
    )


def _row(c: Case) -> list[object]:
    false = c["false_alarm_runs"]
    shown: list[object] = [c["name"], c["runs"], c["provisional_alarm_runs"], Cell(num(false), "bad" if false else "good"), percent(c["false_alarm_upper"])]
    shown += [percent(c["measurement_share"]), round(c["bits_mean"]), c["margin_settled_max"]]
    return [*shown, c.get("detected_runs"), c.get("delay_mean"), c.get("delay_p10"), c.get("delay_p90"), c.get("limit")]


def _figures(cases: Sequence[Case]) -> Iterator[tuple[str, Figure, str]]:
    """Name, figure and caption of every picture that the cases give."""
    with mpl.rc_context(RC):
        found = [c for c in cases if c.get("delay_mean") is not None]
        if len({c["size"] for c in found if c["size"] is not None}) > 1:
            caption = (
                "Mean delay of the first alarm against the size of the fault; the band holds the middle 80 % of the runs, dashes are the limit of any detector where it is known."
            )
            yield "delay_by_size", _delay_by_size(found), caption
        if any(len({c["bits_mean"] for c in line}) > 1 for _, line, _ in _lines(found, _alike(found))):
            caption = "Mean delay of the first alarm against what a case sends; the bar holds the middle 80 %, a line joins cases of the same fault, losses and detector."
            yield "delay_by_bits", _delay_by_bits(found), caption
        caption = "Share of runs with a confirmed false alarm: what was seen, and how large it can be at most with the stated confidence, exact (Clopper and Pearson)."
        yield "false_alarms", _false_alarms(cases[:BARS_MAX]), caption


def _axes(width: float, height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width, height), dpi=100, layout="constrained")
    return figure, figure.add_subplot()


def _lines(cases: Sequence[Case], apart: Sequence[str]) -> list[tuple[str, list[Case], str]]:
    """Cases that have these facts in common, each line with its colour; what is beyond the colours shares one, without a name."""
    lines: dict[str, list[Case]] = {}
    for c in cases:
        facts = [(k, c[k]) for k in apart if any(c[k] != other[k] for other in cases)]
        lines.setdefault(", ".join(f"{k} {v:g}" if isinstance(v, float) else str(v) for k, v in facts), []).append(c)
    return [(name if i < LINES_MAX else "", line, COLOURS[min(i, LINES_MAX - 1)]) for i, (name, line) in enumerate(lines.items())]


def _alike(cases: Sequence[Case]) -> tuple[str, ...]:
    """What the cases of a line have in common: along it only what is sent changes, by trigger or plant."""
    return ("fault", "loss", "loss_burst", *sorted({k for c in cases for k in c if k.startswith("detector.")}))


def _finish(figure: Figure, ax: Axes, xlabel: str) -> Figure:
    ax.set_xlabel(xlabel)
    ax.set_ylabel("delay (samples)")
    ax.set_ylim(bottom=-0.03 * ax.get_ylim()[1])  # a delay of 0 is seen as a whole
    if any(ax.get_legend_handles_labels()[1]):
        figure.legend(loc="outside upper left", ncols=2)
    return figure


def _delay_by_size(cases: Sequence[Case]) -> Figure:
    figure, ax = _axes(9.8, 4.0)
    sized = [c | {"line": c["name"].replace(f":{c['size']:g}@", "@")} for c in cases if c["size"] is not None]
    for name, unordered, colour in _lines(sized, ("line",)):
        line = sorted(unordered, key=lambda c: float(c["size"]))
        size = [c["size"] for c in line]
        ax.fill_between(size, [c["delay_p10"] for c in line], [c["delay_p90"] for c in line], color=colour, alpha=0.14, lw=0)
        ax.plot(size, [c["delay_mean"] for c in line], color=colour, marker="o", ms=4, label=name or None)
        if any(c.get("limit") is not None for c in line):
            ax.plot(size, [float("nan") if c.get("limit") is None else c["limit"] for c in line], color=colour, ls="--")
    return _finish(figure, ax, "size of the fault")


def _delay_by_bits(cases: Sequence[Case]) -> Figure:
    """Cases with the same faults, losses and detector are one line."""
    figure, ax = _axes(9.8, 4.0)
    for name, unordered, colour in _lines(cases, _alike(cases)):
        line = sorted(unordered, key=lambda c: float(c["bits_mean"]))
        mean = [c["delay_mean"] for c in line]
        # A mean may lie outside the middle 80 %; a bar has no negative length.
        bars = [[max(m - c["delay_p10"], 0.0) for m, c in zip(mean, line, strict=True)], [max(c["delay_p90"] - m, 0.0) for m, c in zip(mean, line, strict=True)]]
        ax.errorbar([c["bits_mean"] for c in line], mean, yerr=bars, fmt="o-", ms=4.5, lw=0.8, color=colour, elinewidth=0.9, capsize=2, label=name or None)
    return _finish(figure, ax, "bits on the bus, mean of a run")


def _false_alarms(cases: Sequence[Case]) -> Figure:
    figure, ax = _axes(9.8, 1.1 + 0.25 * len(cases))
    place = range(len(cases))
    bound = [100 * c["false_alarm_upper"] for c in cases]
    seen = [100 * c["false_alarm_runs"] / c["runs"] for c in cases]
    ax.barh(place, bound, height=0.6, color=SKY, alpha=0.4, label="at most, with the stated confidence")
    ax.barh(place, seen, height=0.6, color=RED, label="seen")
    for i, c in enumerate(cases):
        seen_of = f"{c['false_alarm_runs']} of {c['runs']}"
        ax.annotate(seen_of, (bound[i], i), xytext=(4, 0), textcoords="offset points", va="center", ha="left", fontsize=7.5, color=MUTED)
    ax.set_yticks(list(place), [c["name"] for c in cases])
    ax.set_ylim(len(cases) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")
    ax.set_xlabel("runs with a confirmed false alarm (%)")
    ax.set_xlim(0, 1.15 * max(bound))
    figure.legend(loc="outside upper left", ncols=2)
    return figure
