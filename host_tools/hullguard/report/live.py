"""What a run looks like while it runs: a table in the terminal, or a line at each change of the verdict where there is none."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Self

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from hullguard.design.design import Design
from hullguard.design.judges import judges, residual_names

PERIOD_S = 0.2
ROWS_MAX = 12  # signals, and generators, that fit a screen
BAR = 24

PLANT_STYLE = {"starting": "dim", "none": "bold blue", "provisional": "bold black on yellow", "confirmed": "bold white on red"}
PLANT_SAYS = {"starting": "starting", "none": "no fault", "provisional": "fault, provisional", "confirmed": "fault confirmed"}
ALARMED = ("provisional", "confirmed")
BUS_STYLE = {"good": "blue", "absent": "dim", "lossy": "yellow", "stale": "bold magenta"}


def may_be(plant: str, candidates: Sequence[str], known: bool) -> str:
    """What an alarm says of its cause, to follow the state of the plant; nothing for a model that knows no faults."""
    return "" if plant not in ALARMED or not known else f", may be {', '.join(candidates)}" if candidates else ", no single fault explains it"


class LiveTable:
    """Live view of a run. Use it as a context manager and call update() with every sample; it draws at most five times a second."""

    def __init__(self, design: Design, samples: int, console: Console | None = None) -> None:
        """`samples` 0 is a run without an end."""
        self.console = console or Console()
        self.drawn = 0
        self._model, self._samples = design.model.name, samples
        self._signals = [s.name for s in design.model.signals]
        self._residuals = residual_names(judges(design))
        self._known = bool(design.model.faults)
        self._groups = [g.name for g in design.tables.groups]
        self._senders = max(1, len(self._groups) - 1)  # the frame that closes a sample is no measurement
        self._live: Live | None = None
        self._said: tuple[str, tuple[tuple[str, str], ...], tuple[str, ...]] | None = None
        self._next = 0.0
        self._began = 0.0
        self._worst = [0.0] * len(self._residuals)
        self._view: tuple[int, Sequence[float], Sequence[float], Sequence[float], str, Mapping[str, str], int, Sequence[str]] | None = None

    def __enter__(self) -> Self:
        """Start drawing."""
        self._began = time.monotonic()
        if self.console.is_terminal:
            self._live = Live(console=self.console, auto_refresh=False, transient=False)
            self._live.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Leave the last state on the screen and give the terminal back, after Ctrl-C too."""
        if self._live is not None:
            try:
                self._draw()
            finally:
                self._live.stop()
                self._live = None

    def update(
        self,
        k: int,
        values: Sequence[float],
        radii: Sequence[float],
        ratios: Sequence[float],
        plant: str,
        bus: Mapping[str, str],
        frames: int,
        candidates: Sequence[str] = (),
    ) -> None:
        """Sample k: what is known of each signal, |r|/J of each residual, the verdict, health of each group, measurement frames sent so far, candidate faults."""
        if not self.console.is_terminal:
            self._say(k, plant, bus, candidates)
            return
        for i, ratio in enumerate(ratios):
            self._worst[i] = max(self._worst[i], ratio)
        now = time.monotonic()
        changed = self._said is None or self._said[0] != plant
        self._said = (plant, (), ())
        if now < self._next and not (changed and now >= self._next - PERIOD_S / 2):
            # Kept as it is: copying every sample would cost more than the sample itself.
            self._view = (k, values, radii, ratios, plant, bus, frames, candidates)
            return
        self._view = (k, list(values), list(radii), list(ratios), plant, dict(bus), frames, candidates)
        self._next = now + PERIOD_S
        self._draw()

    def _say(self, k: int, plant: str, bus: Mapping[str, str], candidates: Sequence[str]) -> None:
        state = (plant, tuple((g, bus[g]) for g in self._groups if g in bus), tuple(candidates))
        if state != self._said:
            self._said = state
            health = ", ".join(f"{g} {h}" for g, h in state[1])
            cause = may_be(plant, candidates, self._known)
            self.console.print(f"k={k} plant {plant}{cause}" + (f"; bus: {health}" if health else ""), markup=False, highlight=False, soft_wrap=True)

    def _draw(self) -> None:
        if self._live is not None and self._view is not None:
            self.drawn += 1
            self._live.update(self._render(), refresh=True)

    def _render(self) -> RenderableType:
        assert self._view is not None
        k, values, radii, ratios, plant, bus, frames, candidates = self._view
        narrow = self.console.width < 72
        head = Table.grid(padding=(0, 2))
        rate = (k + 1) / max(time.monotonic() - self._began, 1e-9)
        bar = ProgressBar(total=self._samples or None, completed=k + 1, width=BAR, pulse=not self._samples, style="bright_black", complete_style="blue", finished_style="blue")
        head.add_row(
            Text(self._model, style="bold"),
            bar,
            Text(f"{k + 1}" + (f" of {self._samples}" if self._samples else "") + " samples"),
            Text(f"{rate:.0f} samples/s", style="dim"),
        )
        state = Table.grid(padding=(0, 1))
        cause = may_be(plant, candidates, self._known).removeprefix(",")
        state.add_row("plant", Text().append(f" {PLANT_SAYS.get(plant, plant)} ", style=PLANT_STYLE.get(plant, "")).append(cause))
        health = Text()
        for g in self._groups:
            h = bus.get(g, "absent")
            health.append(f"{g} ").append(h, style=BUS_STYLE.get(h, "")).append("   ")
        state.add_row("bus", health)
        state.add_row("sent", Text(f"{frames} measurement frames, {100 * frames / ((k + 1) * self._senders):.1f} % of periodic"))
        tables = Table.grid(padding=(0, 3))
        if narrow:
            tables.add_row(self._signal_table(values, radii))
            tables.add_row(self._ratio_table(ratios))
        else:
            tables.add_row(self._signal_table(values, radii), self._ratio_table(ratios))
        return Group(head, state, tables)

    def _signal_table(self, values: Sequence[float], radii: Sequence[float]) -> Table:
        table = Table(box=None, padding=(0, 1, 0, 0), header_style="dim")
        table.add_column("signal")
        table.add_column("value", justify="right", min_width=9)
        table.add_column("± radius", justify="right", min_width=9)
        for name, value, radius in list(zip(self._signals, values, radii, strict=False))[:ROWS_MAX]:
            table.add_row(name, f"{value:.3f}", f"{radius:.3g}")
        if len(self._signals) > ROWS_MAX:
            table.add_row(Text(f"and {len(self._signals) - ROWS_MAX} more", style="dim"), "", "")
        return table

    def _ratio_table(self, ratios: Sequence[float]) -> Table:
        table = Table(box=None, padding=(0, 1, 0, 0), header_style="dim")
        table.add_column("residual")
        table.add_column("|r|/J now", min_width=BAR)
        table.add_column("", justify="right", min_width=5)
        table.add_column("most", justify="right", min_width=5)
        order = list(range(len(self._residuals)))
        if len(self._residuals) > ROWS_MAX:
            order = sorted(order, key=lambda i: -self._worst[i])[:ROWS_MAX]
        for i in sorted(order):
            ratio = ratios[i] if i < len(ratios) else 0.0
            full = round(min(ratio, 1.0) * BAR)
            style = "red" if ratio > 1 else "yellow" if ratio > 0.8 else "blue"
            bar = Text("━" * full, style=style).append("━" * (BAR - full), style="bright_black")
            table.add_row(self._residuals[i], bar, Text(f"{ratio:.2f}", style=style), Text(f"{self._worst[i]:.2f}", style="red" if self._worst[i] > 1 else ""))
        if len(self._residuals) > ROWS_MAX:
            table.add_row(Text(f"and {len(self._residuals) - ROWS_MAX} lower", style="dim"), "", "", "")
        return table
