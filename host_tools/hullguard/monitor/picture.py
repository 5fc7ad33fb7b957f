"""The screen as a file: SVG as the terminal would show it, or the text behind it. No terminal is needed."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path

from hullguard.errors import InputError
from hullguard.monitor.rows import WIDTH, bus_rows, head, plant_rows, text
from hullguard.monitor.snapshot import Snapshot
from hullguard.monitor.view import View

SUFFIXES = (".svg", ".txt")


def check(path: Path) -> None:
    """Before anything long begins."""
    if path.suffix not in SUFFIXES:
        raise InputError(f"--snapshot {path}: expected a file that ends in {' or '.join(SUFFIXES)}")
    if not path.parent.is_dir():
        raise InputError(f"--snapshot {path}: no such folder {path.parent}")


def write(path: Path, s: Snapshot, mode: str) -> None:
    """All rows of a snapshot, 80 columns wide."""
    made = text(s, mode) if path.suffix == ".txt" else asyncio.run(_svg(s, mode))
    try:
        path.write_text(made, encoding="utf-8")
    except OSError as error:
        raise InputError(f"--snapshot {path}: cannot be written ({error.strerror})") from error


async def _svg(s: Snapshot, mode: str) -> str:
    view = View(lambda: s, lambda: None, 1.0, mode, Path())
    rows = len(head(s, mode)) + len(plant_rows(s)) + len(bus_rows(s)) + 1  # the keys
    async with view.run_test(size=(WIDTH, rows)) as pilot:
        await pilot.pause()
        svg = view.export_screenshot(title=f"hullguard monitor {s.model}")
    return re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL)  # they are loaded from the net; a viewer has a font of its own
