"""The live view in a terminal (Textual): rows of cells of fixed width, of which only those that changed are drawn again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import ClassVar

from rich.segment import Segment
from rich.style import Style
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import VerticalScroll
from textual.geometry import Region, Size
from textual.screen import ModalScreen
from textual.strip import Strip
from textual.widget import Widget
from textual.widgets import Footer, Static

from hullguard.monitor.rows import WIDTH, Row, bus_rows, head, plant_rows, text
from hullguard.monitor.snapshot import Snapshot

WIDE = 2 * WIDTH + 2  # columns from which on plant and bus stand side by side

HELP = """\
ECU       what the detector node on the bus says, by its verdict frames
MONITOR   what a second detector says of the same frames; it sends none,
          and if it began later, it knows less for a while
MAY BE    every single fault of the model that can explain the alarm
BUS       a broken bus is reported as a broken bus, never as a broken
          plant: senders are good, lossy, stale (silent too long), absent
RESIDUAL  beyond |r|/J = 1 no fault-free explanation is left; most: so far
SIGNAL    |true value - value| <= radius while the model's bounds hold
GROUP     a sender: health of its link here and by the ECU's word, frames
          a second, age, samples between two frames, their histogram from
          1 to the longest that its trigger allows
LINK      lost on the bus: by sequence counters; by host: as far as the
          count of frames that this machine dropped explains them
LOAD      exact bits of all frames seen; mean bound: the most that this
          model can keep up; lockstep: the part that only answers ticks

q quit   p pause, go on   c clear figures of the past   s save the text
arrows, PgUp, PgDn, Home, End scroll                any key closes this"""


@lru_cache(maxsize=256)
def _style(words: str) -> Style:
    return Style.parse(words) if words else Style.null()


class Sheet(Widget):
    """Rows of cells. `drawn` counts the cells that were asked to be drawn anew."""

    DEFAULT_CSS = "Sheet { width: 1fr; height: auto; }"

    def __init__(self, name: str) -> None:
        super().__init__(id=name)
        self._rows: Sequence[Row] = ()
        self.drawn = 0

    def get_content_height(self, container: Size, viewport: Size, width: int) -> int:
        """One line a row."""
        return max(1, len(self._rows))

    def show(self, rows: Sequence[Row]) -> None:
        """New content: what is as it was stays on the screen."""
        before, self._rows = self._rows, rows
        if len(before) != len(rows):
            self.drawn += sum(len(r.cells) for r in rows)
            self.refresh(layout=True)
            return
        regions: list[Region] = []
        for y, (old, new) in enumerate(zip(before, rows, strict=True)):
            if old is not new and old != new:
                regions += self._changed(y, old, new)
        if regions:
            self.refresh(*regions)

    def _changed(self, y: int, old: Row, new: Row) -> list[Region]:
        """Places of the cells that differ; the whole line where its style or its layout does."""
        if old.style != new.style or [len(c.text) for c in old.cells] != [len(c.text) for c in new.cells]:
            self.drawn += len(new.cells)
            return [Region(0, y, self.size.width, 1)]
        found, x = [], 0
        for a, b in zip(old.cells, new.cells, strict=True):
            if a != b:
                found.append(Region(x, y, len(b.text), 1))
            x += len(b.text)
        self.drawn += len(found)
        return found

    def render_line(self, y: int) -> Strip:
        """A row as the terminal gets it."""
        base = self.visual_style.rich_style
        if y >= len(self._rows):
            return Strip.blank(self.size.width, base)
        row = self._rows[y]
        below = base + _style(row.style)
        strip = Strip([Segment(c.text, below + _style(c.style) if c.style else below) for c in row.cells])
        return strip.adjust_cell_length(self.size.width, below)


class Help(ModalScreen[None]):
    """What the words mean."""

    DEFAULT_CSS = (
        "Help { align: center middle; } Help Static { width: 78; max-width: 100%; height: auto; max-height: 100%; padding: 0 1; border: round $primary; background: $surface; }"
    )

    def compose(self) -> ComposeResult:
        """One text."""
        yield Static(HELP, markup=False)

    def on_key(self) -> None:
        """Any key closes it."""
        self.dismiss()


class View(App[None]):
    """Shows what `latest` has, `rate_hz` times a second. It reads no bus: whoever does ends it with exit()."""

    CSS = """
    #head { dock: top; }
    #body { height: 1fr; scrollbar-size-vertical: 1; padding-left: 1; }
    #body.wide { layout: grid; grid-size: 2 1; grid-columns: 80 1fr; }
    """
    TITLE = "hullguard monitor"
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("q", "quit", "quit"),
        Binding("ctrl+c", "quit", "quit", show=False, priority=True),
        Binding("p", "pause", "pause"),
        Binding("c", "clear", "clear"),
        Binding("s", "save", "save text"),
        Binding("question_mark", "help", "help", key_display="?"),
    ]

    def __init__(self, latest: Callable[[], Snapshot | None], clear: Callable[[], None], rate_hz: float, live: str, folder: Path) -> None:
        """`live` is the word for a source that has not ended; text goes to `folder`."""
        super().__init__()
        self._latest, self._clear, self._rate, self._live, self._folder = latest, clear, rate_hz, live, folder
        self.shown: Snapshot | None = None
        self.paused = False
        self.begin: Callable[[], None] = lambda: None  # called when there is something to see
        self._sheets = {name: Sheet(name) for name in ("head", "plant", "bus")}

    def compose(self) -> ComposeResult:
        """Head, two sheets below, keys."""
        yield self._sheets["head"]
        with VerticalScroll(id="body"):
            yield self._sheets["plant"]
            yield self._sheets["bus"]
        yield Footer(show_command_palette=False)

    def on_mount(self) -> None:
        """Look at the source from now on."""
        self.query_one("#body").focus()
        self.set_interval(1.0 / self._rate, self.look)
        self.look()
        self.begin()

    def on_resize(self) -> None:
        """Plant and bus side by side where there is room."""
        self.query_one("#body").set_class(self.size.width >= WIDE, "wide")
        self._show()

    @property
    def mode(self) -> str:
        """A word for what is shown."""
        ended = self.shown is not None and self.shown.ended
        return "PAUSED" if self.paused else "END OF LOG" if ended else self._live

    @property
    def drawn(self) -> int:
        """Cells drawn so far."""
        return sum(sheet.drawn for sheet in self._sheets.values())

    def look(self) -> None:
        """Show the newest snapshot, unless it is on the screen already."""
        newest = self._latest()
        if not self.paused and newest is not None and newest is not self.shown:
            self.shown = newest
            self._show()

    def _show(self) -> None:
        if self.shown is not None:
            self._sheets["head"].show(head(self.shown, self.mode, max(WIDTH, self.size.width)))
            self._sheets["plant"].show(plant_rows(self.shown))
            self._sheets["bus"].show(bus_rows(self.shown))

    def action_pause(self) -> None:
        """The screen stands still; what is behind it goes on."""
        self.paused = not self.paused
        self._show()
        self.look()

    def action_clear(self) -> None:
        """Figures of the past begin again."""
        self._clear()

    def action_save(self) -> None:
        """All rows to a text file of their own."""
        if self.shown is None:
            return
        path = self._folder / f"{self.shown.model}-{datetime.now():%Y%m%d-%H%M%S}.txt"
        try:
            path.write_text(text(self.shown, self.mode), encoding="utf-8")
        except OSError as error:
            self.notify(f"{path}: {error.strerror}", severity="error", markup=False)
        else:
            self.notify(f"saved {path}", markup=False)

    def action_help(self) -> None:
        """What the words mean."""
        self.push_screen(Help())
