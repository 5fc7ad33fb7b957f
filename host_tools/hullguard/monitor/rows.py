"""A snapshot as rows of cells of fixed width, for 80 columns or more: the screen and the text of a snapshot show these. Every state is a word; colour only repeats it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from textwrap import wrap

from rich.cells import set_cell_size

from hullguard.monitor.snapshot import EcuSeen, GroupSeen, Snapshot
from hullguard.report.live import ALARMED, PLANT_SAYS

WIDTH = 80  # of the smallest screen
BODY = WIDTH - 2  # below the head: a margin on the left, a scroll bar on the right
BAR = 20
SPARKS = "▁▂▃▄▅▆▇█"
NONE_BIN = "·"  # an interval that has not come
BINS = 10
CHANGES = 6
TITLE, DIM = "bold underline", "dim"
# Warm is the plant, cold is the bus: one is not taken for the other at a glance either.
WARN, BAD = "bold #e69f00", "bold #ffffff on #c4001a"
BUS_ILL, BUS_BAD = "bold #ffffff on #0072b2", "bold #ffffff on #5e35b1"
PLANT_STYLE = {"starting": DIM, "none": "bold", "provisional": "bold black on #e69f00", "confirmed": BAD}
BUS_STYLE = {"good": "", "absent": DIM, "lossy": BUS_ILL, "stale": BUS_BAD}


@dataclass(frozen=True)
class Cell:
    """Text that is exactly as wide as its place."""

    text: str
    style: str = ""


@dataclass(frozen=True)
class Row:
    """Cells side by side; `style` lies below them and fills the line."""

    cells: tuple[Cell, ...]
    style: str = ""

    @property
    def text(self) -> str:
        """Without styles."""
        return "".join(c.text for c in self.cells).rstrip()


def left(text: str, width: int, style: str = "") -> Cell:
    """Padded or cut on the right; a cut shows."""
    return Cell(set_cell_size(text if len(text) <= width else text[: width - 1] + "…", width), style)


def right(text: str, width: int, style: str = "") -> Cell:
    """Padded on the left."""
    return Cell(text.rjust(width) if len(text) <= width else "…".rjust(width), style)


def count(number: int | None) -> str:
    """At most five characters."""
    if number is None:
        return "?"
    for limit, unit, by in ((10**5, "", 1), (10**8, "k", 10**3), (10**11, "M", 10**6)):
        if number < limit:
            return f"{number // by}{unit}"
    return "many"


def seconds(age_s: float | None) -> str:
    """At most six characters."""
    if age_s is None:
        return "never"
    return f"{age_s:.1f}" if age_s < 1000 else f"{age_s:.0f}" if age_s < 1e5 else "> day"


def number(value: float) -> str:
    """A physical number in nine characters: three decimals where they fit."""
    return f"{value:.3f}" if abs(value) < 1e5 else f"{value:.2e}"


def small(value: float) -> str:
    """A bound: three digits, rounded like any other number to be read."""
    return f"{value:.3g}" if value < 1e5 else f"{value:.1e}"


def share(value: float) -> str:
    """A load."""
    return f"{100 * value:.2f} %"


# ---- head: what one must not miss ----


def head(s: Snapshot, mode: str, width: int = WIDTH) -> list[Row]:
    """What is watched, the ECU's verdict, the monitor's own, in an alarm what the fault may be, the bus."""
    where = f" {s.model} {s.model_hash}  {s.source}"
    clock = f"{s.elapsed_s:.1f} s  {mode} "
    return [
        Row((left(where, width - len(clock)), Cell(clock)), "bold"),
        _ecu_row(s.ecu, s.model_hash, width),
        _monitor_row(s, width),
        *_may_be_rows(s, width),
        *_bus_rows(s, width),
    ]


def _says(plant: str) -> str:
    text = PLANT_SAYS.get(plant, plant)
    return text.upper() if plant in ALARMED else text


def _ecu_row(ecu: EcuSeen, expected: str, width: int) -> Row:
    def row(state: str, more: str, style: str) -> Row:
        return Row((Cell(" ECU      "), left(state, 20), left(more, width - 30)), style)

    if ecu.state == "unheard":
        return row("not heard", "no verdict or status frame has come", DIM)
    said = _says(ecu.verdict.plant) if ecu.verdict else "no verdict yet"
    if ecu.model == "other":
        return row(said, f"RUNS ANOTHER MODEL, {ecu.hash} instead of {expected}", BUS_BAD)
    if ecu.state == "silent":
        return row("SILENT", f"for {seconds(ecu.age_s)} s; said last: {said}", BUS_BAD)
    k = f"k {ecu.verdict.k}, " if ecu.verdict else ""
    alive = "no heartbeat yet" if ecu.heartbeat_s is None else f"heartbeat {seconds(ecu.heartbeat_s)} s ago, model matches"
    agrees = {None: "", True: ", agrees", False: ", differs"}[ecu.agrees]
    return row(said, k + alive + agrees, PLANT_STYLE.get(ecu.verdict.plant, "") if ecu.verdict else "")


def _monitor_row(s: Snapshot, width: int) -> Row:
    own, largest = s.monitor, s.largest
    if own is None or largest is None:
        return Row((Cell(" MONITOR  "), left("no sample yet", 20), left("waits for a closing frame", width - 30)), DIM)
    return Row((Cell(" MONITOR  "), left(_says(own.plant), 20), left(f"k {own.k}, largest |r|/J {largest.ratio:.2f}: {largest.name}", width - 30)), PLANT_STYLE.get(own.plant, ""))


def _may_be_rows(s: Snapshot, width: int) -> list[Row]:
    """Candidates of whoever alarms, the ECU first."""
    alarmed = [v for v in (s.ecu.verdict, s.monitor) if v is not None and v.plant in ALARMED]
    if not alarmed or not s.known_faults:
        return []
    lines = wrap(", ".join(alarmed[0].candidates) or "no single fault of the model explains it", width - 10)
    return [Row((Cell(" MAY BE   " if i == 0 else " " * 10), left(line, width - 10)), "bold") for i, line in enumerate(lines)]


def _bus_rows(s: Snapshot, width: int) -> list[Row]:
    """Whatever the length: what ails the bus is not cut off."""
    unwell, told = (v.unwell(str.upper) if v else "" for v in (s.monitor, s.ecu.verdict))
    off = s.errors.state != "error active"
    parts = [unwell or ("good" if s.monitor else "unknown")]
    if told != unwell and s.ecu.verdict is not None and s.monitor is not None:
        parts.append(f"ECU: {told or 'good'}")
    if off:
        parts.append(f"this host's controller: {s.errors.state.upper()}")
    style = BUS_BAD if "STALE" in unwell + told or s.errors.state == "bus-off" else BUS_ILL if unwell or told or off else ""
    facts = f"load {share(s.load.now)}, lost: {count(s.lost_bus)} bus, {count(s.lost_host)} host "
    room = width - 10 - len(facts)
    lines = wrap("; ".join(parts), room, break_on_hyphens=False)
    first = Row((Cell(" BUS      "), left(lines[0], room), Cell(facts)), style)
    return [first, *(Row((Cell(" " * 10), left(line, width - 10)), style) for line in lines[1:])]


# ---- body ----


def plant_rows(s: Snapshot) -> list[Row]:
    """Residuals and signals."""
    return [*_residuals(s), *_signals(s)]


def bus_rows(s: Snapshot) -> list[Row]:
    """Groups, links, load, losses, what changed last."""
    return [*_groups(s), *_links(s), *_load(s), *_losses(s), *_changes(s)]


def _residuals(s: Snapshot) -> list[Row]:
    rows = [Row((left("RESIDUAL", 18), right("r", 10), right("J", 10), right("|r|/J", 7), left("  0" + "1".rjust(BAR - 1), BAR + 2), right("most", 7), Cell("    ")), TITLE)]
    for x in s.residuals:
        full = round(min(x.ratio, 1.0) * BAR)
        style = BAD if x.ratio > 1 else WARN if x.ratio > 0.8 else ""
        bar = "█" * full + "·" * (BAR - full)
        most = right(f"{x.most:.2f}", 7, WARN if x.most > 1 else "")
        mark = Cell(" >J " if x.ratio > 1 else "    ", "bold" if x.ratio > 1 else "")
        rows.append(Row((left(x.name, 18), right(number(x.r), 10), right(small(x.J), 10), right(f"{x.ratio:.2f}", 7, style), Cell("  " + bar), most, mark)))
    return rows


def _signals(s: Snapshot) -> list[Row]:
    """Two side by side, down the left half first: a screen of 24 lines is short."""
    title = (left("SIGNAL", 18), right("value", 10), right("± radius", 10))
    half = -(-len(s.signals) // 2)
    cells = [(left(x.name, 18), right(number(x.value), 10), right(small(x.radius), 10)) for x in s.signals]
    rows = [Row((*title, Cell("  "), *(title if len(cells) > 1 else (Cell(" " * 38),))), TITLE)]
    for i in range(half):
        other = cells[half + i] if half + i < len(cells) else (Cell(" " * 38),)
        rows.append(Row((*cells[i], Cell("  "), *other)))
    return rows


def spark(group: GroupSeen) -> str:
    """Histogram of the intervals 1 .. the longest allowed, in BINS places at most."""
    bins = min(group.interval_max, BINS)
    heights = [0] * bins
    for interval, times in group.intervals.histogram.items():
        heights[min(bins - 1, (interval - 1) * bins // group.interval_max)] += times
    top = max(heights, default=0)
    return "".join(SPARKS[(len(SPARKS) * h - 1) // top] if h else NONE_BIN for h in heights) if top else NONE_BIN * bins


def _groups(s: Snapshot) -> list[Row]:
    ecu = s.ecu.verdict.bus if s.ecu.verdict else {}
    title = (left("GROUP", 12), left("id", 9), left("health", 7), left("by ECU", 7), right("/s", 6), right("age s", 6))
    rows = [Row((*title, right("last", 5), right("min", 4), right("mean", 6), right("max", 4), left("  intervals", 12)), TITLE)]
    for g in s.groups:
        i = g.intervals
        name, told = f"{g.id:08X}" if g.extended else f"{g.id:03X}", ecu.get(g.name, "?")
        who = (left(g.name, 11), Cell(" "), left(name, 9), left(g.bus, 7, BUS_STYLE.get(g.bus, "")), left(told, 7, BUS_STYLE.get(told, "")))
        samples = (right(count(i.last), 5), right(count(i.least), 4), right("?" if i.mean is None else f"{i.mean:.2f}", 6), right(count(i.most), 4))
        rows.append(Row((*who, right(f"{g.rate_hz:.1f}", 6), right(seconds(g.age_s), 6), *samples, left("  " + spark(g), 12))))
    return rows


def _links(s: Snapshot) -> list[Row]:
    rows = [Row((left("LINK", 13), right("frames", 7), right("good", 7), right("lost on bus", 13), right("by host", 9), left("  refused, and other counts", 29)), TITLE)]
    for g in s.groups:
        rest = "  ".join(f"{name} {count(n)}" for name, n in g.counters.items() if n and name not in ("good", "lost"))
        good = right(count(g.counters.get("good", 0)), 7)
        lost = (right(count(g.lost_bus), 13, WARN if g.lost_bus else ""), right(count(g.lost_host), 9, WARN if g.lost_host else ""))
        rows.append(Row((left(g.name, 13), right(count(g.frames), 7), good, *lost, left("  " + (rest or "none"), 29, WARN if rest else ""))))
    return rows


def _load(s: Snapshot) -> list[Row]:
    x = s.load
    names = ("last 1 s", "mean", "peak 0.1 s", "p99 1 s", "mean bound", "lockstep")
    values = (x.now, x.mean, x.peak, x.p99, x.bound, x.mean * x.reply_bits / x.bits if x.bits else 0.0)
    widths = (10, 10, 12, 10, 12, 10)
    return [
        Row((left("LOAD", 14), *(right(n, w) for n, w in zip(names, widths, strict=True))), TITLE),
        Row((left(f"{x.bitrate_bps / 1000:g} kbit/s", 14), *(right(share(v), w) for v, w in zip(values, widths, strict=True)))),
    ]


def _losses(s: Snapshot) -> list[Row]:
    def some(n: int | None) -> str:
        return WARN if n else ""

    host = "not known" if s.host_dropped is None else count(s.host_dropped)
    ids = ", ".join(f"{name} x {count(n)}" for name, n in s.unknown_ids.items()) or "none"
    last = "none" if not s.errors.frames else f"{count(s.errors.frames)}, last: {s.errors.last}"
    lost, refused = count(s.ecu.lost), count(s.ecu.refused)
    return [
        Row((left("LOSSES AND ERRORS", BODY),), TITLE),
        Row((left("dropped by host, any id", 24), left(host, 15, some(s.host_dropped)), left("samples overdue", 24), left(count(s.overdue), 15, some(s.overdue)))),
        Row(
            (
                left("ECU lost, refused", 24),
                left(f"{lost}, {refused}", 15, some(s.ecu.lost) or some(s.ecu.refused)),
                left("outages", 24),
                left(count(s.outages), 15, some(s.outages)),
            )
        ),
        Row((left("unknown ids", 24), left(ids, 54, some(s.unknown)))),
        Row((left("error frames", 24), left(last, 54, some(s.errors.frames)))),
    ]


def _changes(s: Snapshot) -> list[Row]:
    """The last ones, the newest first."""
    rows = [Row((left("CHANGES", 10), left("k", 8), left("who", 11), left("says", 49)), TITLE)]
    start = s.time_s - s.elapsed_s
    for c in s.changes[: -CHANGES - 1 : -1]:
        rows.append(Row((left(f"{c.time_s - start:.1f} s", 10), left("" if c.k is None else str(c.k), 8), left(c.what, 11), left(c.text, 49))))
    return rows + [Row((Cell(" " * BODY),))] * (1 + CHANGES - len(rows))


def text(s: Snapshot, mode: str) -> str:
    """Everything, as text."""
    rows: Iterable[Row] = [*head(s, mode), Row(()), *plant_rows(s), Row(()), *bus_rows(s)]
    return "\n".join(r.text for r in rows) + "\n"
