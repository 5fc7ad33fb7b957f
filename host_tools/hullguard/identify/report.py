"""identify.html: bounds, where they come from, what they cost, and the trade-off of the triggers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from hullguard.report.page import AMBER, BLUE, GREEN, INK, PINK, RC, RED, SKY, Cell, num, page, percent, picture, plural, table, tile

COLOURS = (BLUE, RED, GREEN, PINK, AMBER, SKY)
LEAST = "Smallest: the least that explains every window; written: with its margin, rounded up"
SHARES = "Mean share of the steady thresholds: halving a bound makes them smaller by half its share."
DETECTABLE = 1e6  # a fault that would have to be larger is not drawn


def write_report(path: Path, result: dict[str, Any]) -> Path:
    """One file that needs nothing else, from what --json prints."""
    with mpl.rc_context(RC):
        path.write_text(page(f"Bounds of {result['model']}", _body(result)), encoding="utf-8")
    return path


def _body(result: dict[str, Any]) -> Iterator[str]:
    hold, names = result["hold_out"], ", ".join(Path(p).name for p in result["recordings"])
    yield f"<h1>Bounds of {result['model']}</h1>"
    yield f'<p class="lead">From {plural(result["samples"], "sample")} of {names}; checked on {plural(result["held_out"], "sample")} more.</p>'
    yield f'<div class="tiles">{"".join(_tiles(result))}</div>'
    yield "<h2>Bounds</h2>"
    rows: list[Sequence[object]] = [(b["name"], b["given"], b["smallest"], b["written"], percent(b["relative_error"], 2), percent(b["share"])) for b in result["bounds"]]
    yield table(("bound", "#given", "#smallest", "#written", "#told apart to", "#of the thresholds"), rows, LEAST)
    if result["heavy_tails"]:
        yield "<p>Rare large disturbances: bounds in the proportion of their second moments would be too wide for most, so that single ones were raised.</p>"
    yield "<p>Only what disturbance and noise do together shows in the readings. They are told apart by their second moments, taken as white and independent.</p>"
    yield "<h2>What hurts detection</h2>"
    yield picture(_shares(result["threshold_shares"]), "shares", "share of each bound in the thresholds", SHARES)
    yield "<h2>Where the recording is hardest to explain</h2>"
    t, usual = result["tightest"], result["window_factors"]["usual"]
    yield f"<p>The bounds rest on line {t['line']} of {t['record']}, {t['equation']}.</p>"
    if result["contradictions"]:
        rows = [(n["record"], n["line"], n["equation"], Cell(num(n["factor"] / usual), "bad")) for n in result["contradictions"]]
        yield table(("recording", "#line", "equation", "#times the usual"), rows, "Contradictions: windows that need more than twice what nine tenths of all do")
    else:
        yield "<p>No window needs more than twice what nine tenths of all do.</p>"
    if result["slews"]:
        rows = [(n, s["seen"], s["written"], result["lags"].get(n)) for n, s in result["slews"].items()]
        yield table(("signal", "#largest step seen", "#slew written", "#lag, samples"), rows, "Slews over one sample")
    if hold is not None:
        yield "<h2>Held-out part</h2>"
        place = f"line {hold['line']} of {hold['record']}, {hold['equation']}"
        yield f"<p>It uses {percent(hold['factor'])} of the bounds ({place}); all of the recording uses {percent(result['slew_used']['factor'])} of the slews.</p>"
    if len(result["trade_off"]) > 1:
        yield "<h2>Triggers</h2>"
        yield picture(_trade_off(result), "trade", "smallest faults over frames sent", "Every point is a width of all triggers; dashed: the one that was chosen, or given.")
        faults = list(result["smallest_fault"])
        rows = [(p["scale"], percent(p["frames"]), p["margin_max"], *(p["smallest_fault"].get(f) for f in faults)) for p in result["trade_off"]]
        yield table(("#sigma, times the given", "#frames", "#largest |r|/J", *(f"#{f}" for f in faults)), rows, "Smallest lasting fault that leaves a threshold")


def _tiles(result: dict[str, Any]) -> Iterator[str]:
    hold = result["hold_out"]
    if hold is not None:
        alarms = hold["false_alarms"]["provisional"]
        yield tile("held-out part uses", percent(hold["factor"]), "of the bounds", "bad" if hold["factor"] > 1 else "good")
        yield tile("false alarms there", num(alarms), f"largest |r|/J {num(hold['margin_max'])}", "bad" if alarms else "good")
    worst = max(result["threshold_shares"], key=result["threshold_shares"].get)
    yield tile("most of the thresholds", percent(result["threshold_shares"][worst]), worst)
    yield tile("contradictions", num(len(result["contradictions"])), "windows unlike the others", "bad" if result["contradictions"] else "good")
    yield tile("frames", percent((hold or result["fitted"])["frames"]), "of periodic measurement frames")


def _shares(shares: dict[str, float]) -> Figure:
    figure = Figure(figsize=(9, 0.6 + 0.28 * len(shares)), dpi=100, layout="constrained")
    axes = figure.add_subplot()
    names = list(shares)[::-1]
    axes.barh(names, [100 * shares[n] for n in names], color=BLUE, height=0.65)
    axes.set_xlabel("share of the thresholds, %")
    axes.grid(visible=False, axis="y")
    return figure


def _trade_off(result: dict[str, Any]) -> Figure:
    figure = Figure(figsize=(9, 3.4), dpi=100, layout="constrained")
    axes = figure.add_subplot()
    for i, fault in enumerate(result["smallest_fault"]):
        points = [(100 * p["frames"], p["smallest_fault"][fault]) for p in result["trade_off"] if p["smallest_fault"].get(fault) is not None]
        points = sorted(p for p in points if p[1] < DETECTABLE)
        if points:
            axes.plot(*zip(*points, strict=True), marker="o", markersize=3, color=COLOURS[i % len(COLOURS)], label=fault)
    used = next(p for p in result["trade_off"] if p["scale"] == (result["chosen"] or 1.0)) if any(p["scale"] == (result["chosen"] or 1.0) for p in result["trade_off"]) else None
    if used is not None:
        axes.axvline(100 * used["frames"], color=INK, linestyle="--", linewidth=0.9)
    axes.set_xlabel("measurement frames, % of periodic")
    axes.set_ylabel("smallest lasting fault")
    axes.set_yscale("log")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(ncols=3)
    return figure
