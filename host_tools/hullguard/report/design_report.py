"""The report of a design: everything a control engineer wants to see before trusting it, in one HTML file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from hullguard.bus.bits import worst_bit_times, worst_bits
from hullguard.design.design import Design, Generator
from hullguard.design.ids import ERRORS, undetected_patterns
from hullguard.design.isolation import Pair
from hullguard.design.judges import BANK, HYPOTHESIS, STATISTIC, judges
from hullguard.design.protection import MODAL, NONE
from hullguard.design.tables import GeneratorTable, MessageTable
from hullguard.errors import InputError
from hullguard.model.table import Array
from hullguard.report import polynomial_design, uio_design
from hullguard.report.design_banks import banks_section, cost_section, derived_section, isolability_section, uncertain_names
from hullguard.report.page import AMBER, BLUE, EDGE, GREEN, INK, MUTED, PINK, RC, RED, SKY, Cell, esc, num, page, percent, picture, plural, table, tile

LINES = (BLUE, RED, GREEN, PINK, AMBER, SKY, MUTED, INK)
STYLES = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (6, 1.5, 1.5, 1.5)))
SIGNALS_MAX = 8  # signals with a line of their own in the picture of the impulse response
LONG_NAME = 16  # letters of a signal from which a line of a legend has fewer entries
OPEN_MAX = 4  # generators that are not folded away
LARGE = 12  # columns from which a matrix is folded away
SMALLEST = "Smallest lasting step that reaches the steady threshold, in the signal's unit; ready in samples."
SLEWS_MAX = 6  # columns of the table of slews


def write_design_report(design: Design, path: Path, pairs: Sequence[Pair] = ()) -> None:
    """Write the report of a finished design. `pairs`: which faults can be told apart, where that was looked into."""
    with mpl.rc_context(RC):
        text = page(f"Design of {design.model.name}", _body(design, pairs))
    try:
        path.write_bytes(text.encode())
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error


def _body(design: Design, pairs: Sequence[Pair]) -> Iterator[str]:
    yield from _summary(design)
    yield "<h2>Plant and signals</h2>"
    yield _signals(design)
    yield _slews(design)
    yield from _plant(design)
    yield "<h2>Groups, frames, triggers</h2>"
    yield _frames(design)
    yield _triggers(design)
    yield "<h2>Faults</h2>"
    yield _faults(design)
    if len(design.generators) > 1:
        yield "<h2>Generators</h2>"
        yield _overview(design)
    folded = len(design.generators) > OPEN_MAX
    for i, g in enumerate(design.generators):
        yield f"<details><summary>Generator {i + 1}: {esc(_reads(design, g))}</summary>" if folded else f"<h2>Generator {i + 1}</h2>"
        yield from _generator(design, i, g)
        if folded:
            yield "</details>"
    yield from uio_design.section(design)
    yield from polynomial_design.section(design)
    yield from banks_section(design)
    yield from isolability_section(design, pairs)
    yield from derived_section(design)
    yield from cost_section(design)
    yield "<h2>Checks</h2>"
    yield _checks(design)


# --- summary -------------------------------------------------------------------------------------------------------------


def _summary(design: Design) -> Iterator[str]:
    model, passed = design.model, sum(c.passed for c in design.checks)
    fast = f", {num(model.data_bitrate_bps / 1000)} kbit/s in data phases" if model.data_bitrate_bps != model.bitrate_bps else ""
    yield f"<h1>hullguard design: {esc(model.name)}</h1>"
    yield (
        f'<p class="note">{plural(model.plant.n, "state")}, {plural(model.plant.m, "output")}, {plural(model.plant.p, "input")}; {num(model.sample_time_s * 1000)} ms; '
        f"{num(model.bitrate_bps / 1000)} kbit/s{fast}; model hash <code>{design.tables.hash:08x}</code></p>"
    )
    yield f'<p class="lead">{esc(_judging(design))}; {passed} of {len(design.checks)} checks passed.</p>'
    used = [g for g in design.generators if g.filter.regularised > 0]
    if used:
        names = ", ".join(str(i + 1) for i, g in enumerate(design.generators) if g.filter.regularised > 0)
        told = f"The factorisation of generator {names} is singular and was regularised with a little noise that no one claims; the thresholds are sound all the same."
        yield f"<aside><p>{told}</p></aside>"
    tiles = [tile("checks", f"{passed} of {len(design.checks)}", "passed", "good" if passed == len(design.checks) else "bad")]
    tiles.append(tile("bus load, worst case", percent(design.load_bound), f"limit {percent(model.load_max)}", "good" if design.load_bound <= model.load_max else "bad"))
    f32, q31 = (max(design.rounding_shares(real), default=0.0) for real in ("f32", "q31"))
    if design.tables.fixed is not None and design.generators:
        tiles.append(tile("rounding, fixed point", percent(q31), f"of a threshold; {percent(f32)} in float32"))
    best = _smallest(design)
    if best:
        name, size = max(best.items(), key=lambda kv: kv[1])
        tiles.append(tile("hardest fault asked for", num(size), f"{name}: smallest size that is found"))
    full = max([b.window for b in design.tables.banks] + [p.settle for p in design.tables.polynomials], default=0)
    rest, moving = (max([full, *(ready(g) for g in design.tables.generators)]) for ready in (_ready_rest, _ready_moving))
    tiles.append(tile("ready after", f"{rest} samples", f"from rest; {moving} in motion"))
    tiles.append(tile("longest history", f"{design.tables.history} samples", "of radii, in RAM"))
    yield '<div class="tiles">' + "".join(tiles) + "</div>"


def _judging(design: Design) -> str:
    """What the detector is made of, in words."""
    residuals = sum(len(g.output) for g in design.tables.generators)
    parts = [f"{plural(len(design.generators), 'residual generator')} with {plural(residuals, 'residual')}"] if design.generators else []
    parts += [f"a {j.name} certificates" for j in judges(design) if j.kind == BANK]
    isolating = sum(j.kind == HYPOTHESIS for j in judges(design))
    parts += [j.name for j in judges(design) if j.kind == STATISTIC]
    return ", ".join([*parts, *([f"{plural(isolating, 'bank')} for isolation"] if isolating else [])])


def _smallest(design: Design) -> dict[str, float]:
    """Smallest size of each fault that some generator was searched for."""
    best: dict[str, float] = {}
    for g in design.generators:
        for f, size in zip(g.spec.faults, g.smallest, strict=True):
            name = design.model.faults[f].name
            best[name] = min(best.get(name, np.inf), float(size))
    return best


def _ready_rest(g: GeneratorTable) -> int:
    return g.ready_rest if g.zonotope is None else g.zonotope.ready_rest


def _ready_moving(g: GeneratorTable) -> int:
    return g.ready_moving if g.zonotope is None else g.zonotope.ready_moving


# --- tables of the model ---------------------------------------------------------------------------------------------------


def _signals(design: Design) -> str:
    rows = []
    group_of = {i: g.name for g in design.model.groups for i in g.signals}
    wire = [s for g in design.tables.groups for s in g.signals]
    for i, (s, t) in enumerate(zip(design.model.signals, wire, strict=True)):
        reach = float(design.stored.signal_reach[i])
        rows.append([s.name, s.role, group_of[i], f"{num(s.low)} .. {num(s.high)}", reach, s.resolution, f"{t.length}\u00a0bit", s.noise])
    return table(
        ["signal", "role", "group", "range", "#reach", "#resolution", "wire", "#noise bound"],
        rows,
        "Reach: largest distance from the equilibrium in the healthy, disturbed loop; a dash where the range stands for it.",
    )


def _slews(design: Design) -> str:
    slew = design.stored.slew
    horizon = slew.shape[1]
    columns = sorted({int(j) for j in np.unique(np.round(np.geomspace(1, horizon, SLEWS_MAX)))})
    rows = [[s.name, "declared" if s.slew is not None else "reachable set", *[float(slew[i, j - 1]) for j in columns]] for i, s in enumerate(design.model.signals)]
    return table(["signal", "from", *[f"#{j}" for j in columns]], rows, "Slew: the most a signal can change within so many samples, in its own unit.")


def _plant(design: Design) -> Iterator[str]:
    plant = design.model.plant
    named = {"A": plant.A, "B": plant.B, "C": plant.C, "D": plant.D, "Ed": plant.Ed, "Fd": plant.Fd}
    if plant.feedback is not None:
        named["K"] = plant.feedback.gain
    if plant.interval is not None:
        named |= {"dA": plant.dA, "dB": plant.dB}
        yield "<p>The plant is any with |A* − A| ≤ dA and |B* − B| ≤ dB, entry by entry, even one that varies; reach, slews and thresholds hold for all of them.</p>"
    states = ", ".join(f"{name} ≤ {num(float(r))}" for name, r in zip(plant.states, design.stored.state_range, strict=True))
    yield f"<p>Largest magnitudes of the states: {esc(states)}.</p>"
    yield (
        "<details><summary>Matrices of the plant, x(k+1) = A x + B u + Ed d, y = C x + D u + Fd d, |d| ≤ 1"
        + ("; u = −K x + reference" if plant.feedback is not None else "")
        + f"</summary>{_matrices(named)}</details>"
    )


def _frames(design: Design) -> str:
    rows = []
    tables, model = design.tables, design.model
    period = model.sample_time_s * model.bitrate_bps
    senders = [(g.message, min(g.silence) + 1.0, ", ".join(s.name for s in g.signals) or "tick") for g in tables.groups]
    senders += [(tables.verdict, 1.0, "verdict"), (tables.status, float(tables.heartbeat), "health counters")]
    for message, every, what in senders:
        bits = worst_bits(message)
        rows.append(
            [
                message.name,
                f"0x{message.id:X}",
                what,
                f"{message.length}\u00a0bytes" + ("\u00a0FD" if message.flags & 4 else ""),
                *_protection(message),
                bits,
                every,
                percent(worst_bit_times(message, model.bitrate_bps, model.data_bitrate_bps) / every / period),
            ]
        )
    rows.append(["all", "", "", "", "", "", "", "", percent(design.load_bound)])
    return table(
        ["frame", "identifier", "content", "length", "protection", "#errors it misses", "#most bits", "#at most every (samples)", "#load, worst case"],
        rows,
        f"End-to-end protection by profiles of AUTOSAR E2E; of all errors of up to {ERRORS} flipped bits, those that its checksum does not see are counted. "
        f"The limit of the load is {percent(model.load_max)}.",
    )


def _protection(message: MessageTable) -> tuple[str, str | int]:
    """Profile, and how many of the smallest errors pass."""
    p = message.protection
    if p.profile == NONE:
        return "none", ""
    return p.profile + (f" {p.mode}" if p.profile in MODAL else ""), undetected_patterns(p, message.length)


def _triggers(design: Design) -> str:
    rows = []
    for g, t in zip(design.model.groups, design.tables.groups, strict=True):
        if t.periodic:
            usual = "every sample" if t.interval_max == 1 else f"every {t.interval_max} samples"
            rows.append([g.name, "", "", "every sample, closes it" if g.closing else usual, "", t.interval_max, t.interval_max + t.margin])
            continue
        for level in range(t.levels):
            for place, i in enumerate(g.signals):
                first = level == 0 and place == 0
                rows.append(
                    [
                        g.name if first else "",
                        f"{level}" if place == 0 and t.levels > 1 else "",
                        design.model.signals[i].name,
                        _promise(float(g.trigger.delta[level, place]), float(g.trigger.sigma[level, place])),
                        f"{t.silence[level]}",
                        t.interval_max if first else "",
                        t.interval_max + t.margin if first else "",
                    ]
                )
    return table(
        ["group", "level", "signal", "sends when moved by more than", "#silent for", "#sends at the latest after", "#stale after"],
        rows,
        "Triggers, in signal units and samples. Levels go from quiet to active; the sender and the receiver choose the same one from what was sent.",
    )


def _promise(delta: float, sigma: float) -> str:
    return num(sigma) if delta == 0 else f"{num(delta)} |value| + {num(sigma)}"


def _faults(design: Design) -> str:
    rows = []
    best = _smallest(design)
    for i, f in enumerate(design.model.faults):
        seen = [str(k + 1) for k, t in enumerate(design.tables.generators) if t.faults >> i & 1]
        seen += [j.name for j, t in zip(judges(design), design.tables.judging, strict=True) if j.kind in (BANK, STATISTIC) and t.faults >> i & 1]
        asked = best.get(f.name)
        rows.append([f.name, f.type, design.model.signals[f.signal].name, ", ".join(seen) or Cell("none", "bad"), "not asked for" if asked is None else num(asked)])
    return (
        table(["fault", "type", "signal", "shows in generators", "#smallest size found"], rows)
        if rows
        else "<p>The model names no faults: any deviation from the model is one.</p>"
    )


def _reads(design: Design, g: Generator) -> str:
    model = design.model
    places = [model.outputs[k] for k in g.spec.outputs] + [model.inputs[k] for k in g.spec.inputs]
    return ", ".join(model.signals[k].name for k in places)


def _overview(design: Design) -> str:
    rows = []
    for i, g in enumerate(design.generators):
        found = ", ".join(f"{design.model.faults[f].name} {num(float(size))}" for f, size in zip(g.spec.faults, g.smallest, strict=True))
        t = g.tables
        rows.append([i + 1, _reads(design, g), g.spec.order, t.weight.shape[1], found or "–", t.weight.shape[0], t.ready_rest, t.ready_moving])
    return table(
        ["#", "reads", "#order", "#residuals", "smallest faults found", "#taps", "#ready from rest", "#in motion"],
        rows,
        SMALLEST,
    )


# --- one generator -------------------------------------------------------------------------------------------------------


def _generator(design: Design, i: int, g: Generator) -> Iterator[str]:
    model = design.model
    names = _reads(design, g).split(", ")
    residuals = g.tables.weight.shape[1]
    feeds = [group.name for k, group in enumerate(model.groups) if design.tables.generators[i].feeds >> k & 1]
    sources = ", ".join(feeds) or "no group"
    yield (
        f"<p>Order {g.spec.order} for {plural(model.plant.n, 'state')}, {plural(residuals, 'residual')}; reads {esc(', '.join(names))}; fed by {esc(sources)}. {esc(_how(g))}</p>"
    )
    if g.spec.aware and g.spec.filtered:
        yield f"<p>The post-filter is told {num(design.stored.observers[i].weight)} times the expected event error.</p>"
    if g.filter.regularised > 0:
        yield f"<p><b>The factorisation was singular and is regularised</b>: noise of size {num(g.filter.regularised)} that no one claims was added to each row of Fb.</p>"
    yield _search(design, g)
    wide = names + uncertain_names(design)
    yield _composition(wide, g)
    yield picture(_response_figure(g, wide), f"h{i + 1}", f"Threshold of generator {i + 1}", _response_caption(g))
    yield picture(_bias_figure(g), f"p{i + 1}", f"Poles and start of generator {i + 1}", _bias_caption(g))
    yield _poles(g)
    o, f = g.observer, g.filter
    named = {"G": o.G, "H": o.H, "L": o.L, "T": o.T, "W": o.W, "V": o.V, "Qu": o.Qu, "Lo": f.Lo, "Mo": f.Mo}
    yield (
        "<p>z(k+1) = (G − Lo W) z + (H − Lo Qu) u + (L + Lo V) y, r = Mo (V y − W z − Qu u), with "
        + ", ".join(e.replace(" ", "\u00a0") for e in ("T A − G T = L C", "H = T B − L D", "V C = W T"))
        + ".</p>"
    )
    text = _matrices(named)
    yield f"<details><summary>Matrices G, H, L, T, W, V, Qu, Lo, Mo</summary>{text}</details>" if max(m.shape[1] for m in named.values()) > LARGE else text


def _how(g: Generator) -> str:
    """Where the free parameters come from."""
    spec, s = g.spec, g.spec.search
    if not spec.filtered:
        return "A linear programme found the parity vector; poles 0."
    if spec.chosen:
        return "Parity vector and poles are the model's own choice."
    chosen = " The parity vector is the model's own choice." if spec.parity is not None else " The poles are the model's own choice." if spec.poles is not None else ""
    return f"Search: {s.objective}, {plural(s.trials, 'trial')}, seed {s.seed}, poles {num(s.poles[0])} .. {num(s.poles[1])} where they matter.{chosen}"


def _search(design: Design, g: Generator) -> str:
    rows = []
    for f, size, first, blind, delay in zip(g.spec.faults, g.smallest, g.first, g.blind, g.delay, strict=True):
        fault = design.model.faults[f]
        rows.append([fault.name, design.model.signals[fault.signal].name, float(size), *_gain(size, first), *_gain(size, blind), float(delay)])
    if not rows:
        return "<p>No fault was asked for in the search.</p>"
    aware = "aware of the trigger" if g.spec.aware else "as designed, not aware of the trigger"
    return table(
        ["fault", "of signal", f"#post-filter {aware}", "#search's first draw", "#gain", "#not aware of the trigger", "#gain", f"#delay at {num(g.spec.search.size)} (samples)"],
        rows,
        "What the search reached: the smallest lasting step, in the signal's unit, whose residual reaches the steady threshold. A dash: nothing was searched for, or "
        "the bounds have changed since.",
    )


def _gain(size: float, other: float) -> tuple[float, str]:
    """Another design's smallest fault, and how much smaller this one's is."""
    known = np.isfinite(size) and np.isfinite(other) and size > 0
    return float(other), f"{num(other / size)} times smaller" if known else "–"


def shares(g: Generator) -> tuple[Array, Array, Array]:
    """Parts of the steady threshold of each residual: disturbance, events of each signal, rounding."""
    events = (g.tables.weight * g.radius).sum(0)
    rounding = g.tables.rounding
    return np.maximum(g.tables.steady - events.sum(1) - rounding, 0.0), events, rounding


def _composition(names: list[str], g: Generator) -> str:
    disturbance, events, rounding = shares(g)
    # Signals whose radius is practically nothing get no column of their own.
    shown = [s for s in range(len(names)) if float((events[:, s] / g.tables.steady).max()) >= 0.001]
    rows = []
    for i in range(len(g.tables.steady)):
        J = float(g.tables.steady[i])
        rows.append([f"residual\u00a0{i + 1}", J, percent(float(disturbance[i]) / J), *[percent(float(events[i, s]) / J) for s in shown], percent(float(rounding[i]) / J)])
    return table(
        ["", "#steady J", "#disturbance", *[f"#{names[s]}" for s in shown], "#rounding"],
        rows,
        "What the threshold is made of, once started and at the usual radii of the signals.",
    )


def _response_figure(g: Generator, names: list[str]) -> Figure:
    weight = g.tables.weight
    taps, residuals, width = weight.shape
    columns = min(residuals, 2)
    lines = -(-residuals // columns)
    row, top, bottom, total = 1.75, 0.62, 0.5, 9.8
    height = top + lines * row + (lines - 1) * 0.5 + bottom
    figure = Figure(figsize=(total, height), dpi=100)
    size = weight.max((0, 1))
    shown = sorted(np.argsort(-size, kind="stable")[: min(SIGNALS_MAX, width)].tolist())
    shown = [s for s in shown if size[s] > 0]
    half = (total - 0.85 - 0.2 - (columns - 1) * 0.75) / columns
    least = float(weight[weight > 0].min()) if np.any(weight > 0) else 1e-6
    floor = max(least, 1e-6 * float(weight.max()))
    for i in range(residuals):
        left, y = 0.85 + (i % columns) * (half + 0.75), height - top - row - (i // columns) * (row + 0.5)
        ax = figure.add_axes((left / total, y / height, half / total, row / height))
        for place, s in enumerate(shown):
            style = STYLES[place // len(LINES) % len(STYLES)]
            ax.plot(
                np.arange(taps),
                np.maximum(weight[:, i, s], floor / 10),
                color=LINES[place % len(LINES)],
                ls=style,
                marker="o" if taps <= 60 else None,
                ms=2.2,
                lw=1.1,
            )
        ax.set_yscale("log")
        ax.set_ylim(floor / 1.5, 2.0 * float(weight.max()))
        ax.set_xlim(-0.5, max(int(np.flatnonzero(weight.max((1, 2)) > 0).max(initial=0)), 4) + 0.5)
        ax.xaxis.set_major_locator(MaxNLocator(8, integer=True))
        ax.set_title(f"residual {i + 1}", loc="left", fontweight="bold")
        ax.set_xlabel("lag j (samples)")
        if i % columns == 0:
            ax.set_ylabel("|h(j)|, per unit of radius")
    handles = [Line2D([], [], color=LINES[k % len(LINES)], marker="o" if taps <= 60 else None, ms=3, lw=1.4, label=names[s]) for k, s in enumerate(shown)]
    figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(0.85 / total, 1 - 0.03 / height),
        ncols=min(len(handles), 6 if max(map(len, names)) <= LONG_NAME else 4),
        borderaxespad=0,
        columnspacing=1.4,
        handlelength=1.6,
        fontsize=7.5 if len(handles) > 4 else 8,
    )
    return figure


def _response_caption(g: Generator) -> str:
    taps, decays = g.tables.weight.shape[0], ", ".join(num(float(d)) for d in g.tables.decay)
    active = int(np.sum(g.tables.weight.max((0, 1)) > 0))
    left = active - min(active, SIGNALS_MAX)
    more = f" {plural(left, 'signal')} with smaller weights not drawn." if left else ""
    return f"Weights of the threshold: what a radius j samples ago adds to J; {taps} taps at most, behind them tails that shrink by {decays} a sample.{more}"


def _bias_figure(g: Generator) -> Figure:
    total, height = 9.8, 3.0
    figure = Figure(figsize=(total, height), dpi=100)
    side = 2.05
    ax = figure.add_axes((0.6 / total, 0.52 / height, side / total, side / height))
    ax.set_aspect("equal")
    ax.add_patch(Circle((0, 0), 1.0, fill=False, ec=EDGE, lw=1.0))
    before, after = np.linalg.eigvals(g.observer.G), np.linalg.eigvals(g.linear.state)
    ax.plot(before.real, before.imag, "x", color=MUTED, ms=6, mew=1.4)
    ax.plot(after.real, after.imag, "+", color=RED, ms=8, mew=1.6)
    ax.set_xlim(-1.12, 1.12)
    ax.set_ylim(-1.12, 1.12)
    ax.set_xticks([-1, 0, 1])
    ax.set_yticks([-1, 0, 1])
    ax.set_xlabel("real")
    ax.set_ylabel("imaginary", labelpad=0)
    poles = [
        Line2D([], [], color=MUTED, marker="x", ls="", ms=6, mew=1.4, label="of G"),
        Line2D([], [], color=RED, marker="+", ls="", ms=8, mew=1.6, label="of G − Lo W, as it runs"),
    ]
    figure.legend(
        handles=poles,
        loc="upper left",
        bbox_to_anchor=(0.6 / total, 1 - 0.03 / height),
        ncols=2,
        borderaxespad=0,
        columnspacing=1.0,
        handletextpad=0.2,
        title="poles",
        title_fontproperties={"weight": "bold", "size": 8.5},
        alignment="left",
    )

    left = 3.75
    ax = figure.add_axes((left / total, 0.52 / height, (total - left - 0.2) / total, side / height))
    settle, residuals = g.tables.rest.shape
    for i in range(residuals):
        color = LINES[i % len(LINES)]
        for values, style in ((g.tables.rest, "-"), (g.tables.moving, (0, (5, 2)))):
            ax.plot(np.arange(settle), values[:, i], color=color, ls=style, lw=1.3)
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.set_xlim(0, max(settle - 1, 1, 1.05 * g.tables.ready_moving if g.tables.ready_moving <= 2 * settle else 1))
    ax.xaxis.set_major_locator(MaxNLocator(8, integer=True))
    marks = ((g.tables.ready_rest, "-"), (g.tables.ready_moving, (0, (5, 2))))
    for at, style in marks:
        if at <= ax.get_xlim()[1]:
            ax.axvline(at, color=INK, lw=0.9, ls=style, zorder=1.5)
    ax.set_xlabel("samples since the start")
    ax.set_ylabel("constant part of J")
    handles: list[Line2D | Patch] = [Line2D([], [], color=LINES[i % len(LINES)], lw=1.4, label=f"residual {i + 1}") for i in range(min(residuals, 6))]
    handles += [Line2D([], [], color=INK, lw=1.1, label="at rest"), Line2D([], [], color=INK, lw=1.1, ls=(0, (5, 2)), label="moving")]
    figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(left / total, 1 - 0.03 / height),
        ncols=len(handles),
        borderaxespad=0,
        columnspacing=1.2,
        handlelength=1.8,
        title="start; upright lines: ready",
        title_fontproperties={"weight": "bold", "size": 8.5},
        alignment="left",
    )
    return figure


def _bias_caption(g: Generator) -> str:
    t = g.tables
    return (
        f"Left: poles in the unit circle. Right: the part of the threshold that does not depend on what was received; it falls as the initial state "
        f"is forgotten and stays constant after {t.rest.shape[0]} samples. "
        f"Ready after {plural(t.ready_rest, 'sample')} from a start at rest, {t.ready_moving} from a start in motion."
    )


def _poles(g: Generator) -> str:
    def listed(a: Array) -> str:
        values = sorted(np.linalg.eigvals(a), key=lambda p: (-round(abs(p), 9), p.imag))
        return ", ".join(num(float(p.real)) + ("" if abs(p.imag) < 1e-12 else (" + " if p.imag > 0 else " − ") + f"{num(abs(float(p.imag)))} j") for p in values)

    return table(["", "poles"], [["G", listed(g.observer.G)], ["G − Lo W, float32", listed(g.linear.state)]])


def _checks(design: Design) -> str:
    rows = [[c.name, f"{c.value:.3g}", f"{c.limit:.4g}", Cell("passed", "good") if c.passed else Cell(f"failed: {c.cure}", "bad")] for c in design.checks]
    return table(["check", "#value", "#limit", "result"], rows, "A value must not exceed its limit; a design that fails one is not emitted.")


def _matrices(named: dict[str, Array]) -> str:
    return '<div class="matrices">' + "".join(_matrix(name, m) for name, m in named.items() if m.size) + "</div>"


def _matrix(name: str, m: Array) -> str:
    rows = "".join("<tr>" + "".join(f"<td>{esc(_entry(float(x)))}</td>" for x in row) + "</tr>" for row in m)
    return f'<div><h4>{esc(name)} <span>({m.shape[0]} × {m.shape[1]})</span></h4><table class="matrix"><tbody>{rows}</tbody></table></div>'


def _entry(x: float) -> str:
    return "0" if x == 0 else "1" if x == 1 else f"{x:.4g}".replace("-", "−")
