"""The view without a terminal (Textual's own pilot), and with one: keys, what the banner says, how much is drawn, and how it ends."""

from __future__ import annotations

import asyncio
import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Coroutine
from dataclasses import replace
from pathlib import Path

import pytest
from host_support import SEED
from hullguard.bus import candump
from hullguard.core.library import library
from hullguard.core.native import REST, Native
from hullguard.design.design import design
from hullguard.model import load_model
from hullguard.monitor.rows import ALARMED, bus_rows, head, plant_rows
from hullguard.monitor.snapshot import Snapshot
from hullguard.monitor.state import Monitor
from hullguard.monitor.view import HELP, Help, Sheet, View
from textual.pilot import Pilot

FAST_HZ = 50.0
Seen = dict[int, Snapshot]  # by sample


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from hullguard.cli import main

    out = tmp_path_factory.mktemp("openacc")
    assert main(["run", "openacc", "--bus", "inprocess", "--samples", "350", "--out", str(out), "--seed", str(SEED), "-q"]) == 0
    return out


@pytest.fixture(scope="module")
def seen(folder: Path) -> Seen:
    """The monitor at every sample of a run."""
    made = design(load_model("openacc"))[0]
    m = Monitor(made, Native(library("f32"), made.tables), REST, "run.log", made.model.sample_time_s)
    found: Seen = {}
    for e in candump.read(folder / "run.log"):
        if m.note(e.frame, e.time_s):
            m.take(e.frame, e.time_s)
        elif m.samples:
            found[m.samples - 1] = m.snapshot()
    return found


def alarmed(seen: Seen) -> int:
    """A sample at which ECU and monitor both accuse the plant."""
    return next(k for k, s in seen.items() if s.monitor and s.monitor.plant in ALARMED and s.ecu.verdict and s.ecu.verdict.plant in ALARMED)


class Source:
    """What the view looks at."""

    def __init__(self, first: Snapshot | None) -> None:
        self.latest, self.cleared = first, 0

    def clear(self) -> None:
        self.cleared += 1


def shown(source: Source, what: Callable[[View, Pilot[None]], Coroutine[None, None, None]], folder: Path, size: tuple[int, int] = (80, 24), rate_hz: float = FAST_HZ) -> View:
    view = View(lambda: source.latest, source.clear, rate_hz, "LIVE", folder)

    async def run() -> None:
        async with view.run_test(size=size) as pilot:
            await pilot.pause()
            await what(view, pilot)

    asyncio.run(run())
    return view


def screen(view: View) -> list[str]:
    """What the terminal shows, line by line."""
    lines = view.screen._compositor.render_strips()
    return ["".join(segment.text for segment in strip) for strip in lines]


async def until(condition: Callable[[], bool], pilot: Pilot[None]) -> None:
    end = time.monotonic() + 100.0
    while not condition():
        assert time.monotonic() < end
        await pilot.pause(0.02)


def test_the_banner_before_and_after_the_fault(seen: Seen, tmp_path: Path) -> None:
    at = alarmed(seen)
    source = Source(seen[at - 1])

    async def steps(view: View, pilot: Pilot[None]) -> None:
        before = screen(view)
        assert before[0].startswith(" openacc") and "LIVE" in before[0]
        assert "no fault" in before[1] and "no fault" in before[2] and "FAULT" not in "".join(before[:5]) and "MAY BE" not in "".join(before)
        assert before[3].startswith(" BUS      good")
        source.latest = seen[at]
        await until(lambda: view.shown is seen[at], pilot)
        await pilot.pause(0.05)
        after = screen(view)
        assert after[1].startswith(" ECU      FAULT") and after[2].startswith(" MONITOR  FAULT") and after[3].startswith(" MAY BE ")
        verdict = seen[at].monitor
        assert verdict is not None and all(name in " ".join(after[3:6]) for name in verdict.candidates)
        source.latest = replace(seen[at], ecu=replace(seen[at].ecu, state="silent", age_s=4.0))
        await until(lambda: view.shown is source.latest, pilot)
        await pilot.pause(0.05)
        assert "SILENT" in screen(view)[1] and "for 4.0 s; said last: FAULT" in screen(view)[1]

    shown(source, steps, tmp_path)


def test_keys(seen: Seen, tmp_path: Path) -> None:
    source = Source(seen[100])

    async def steps(view: View, pilot: Pilot[None]) -> None:
        await pilot.press("p")
        source.latest = seen[101]
        await pilot.pause(0.1)
        assert view.shown is seen[100] and "PAUSED" in screen(view)[0]
        await pilot.press("p")
        await until(lambda: view.shown is seen[101], pilot)
        assert "LIVE" in screen(view)[0]
        await pilot.press("c")
        assert source.cleared == 1
        await pilot.press("s")
        await until(lambda: len(list(tmp_path.iterdir())) == 1, pilot)
        saved = next(iter(tmp_path.iterdir())).read_text(encoding="utf-8")
        assert "observer 29" in saved and "unknown ids" in saved, "all rows, not only those on the screen"
        await pilot.press("question_mark")
        assert isinstance(view.screen, Help)
        assert "never as a broken" in "".join(screen(view)) and "any key closes this" in "".join(screen(view)), "all of it, on 80 x 24 too"
        assert max(map(len, HELP.splitlines())) <= 74
        await pilot.press("x")
        assert not isinstance(view.screen, Help)
        view._folder = tmp_path / "nowhere"
        await pilot.press("s")
        await pilot.pause(0.1)
        assert view.is_running, "a folder that cannot be written to ends nothing"
        await pilot.press("q")

    assert shown(source, steps, tmp_path).return_code == 0


def test_small_screens_scroll_and_wide_ones_show_both_halves(seen: Seen, tmp_path: Path) -> None:
    async def small(view: View, pilot: Pilot[None]) -> None:
        assert len(screen(view)) == 24 and not any("LOSSES" in line for line in screen(view))
        await pilot.press("end")
        await until(lambda: any("CHANGES" in line for line in screen(view)), pilot)
        assert screen(view)[0].startswith(" openacc"), "the head stays"
        assert "quit" in screen(view)[-1] and all(len(line) == 80 for line in screen(view))

    async def wide(view: View, pilot: Pilot[None]) -> None:
        title = next(line for line in screen(view) if "RESIDUAL" in line)
        assert "GROUP" in title and title.index("RESIDUAL") < title.index("GROUP")
        assert any("CHANGES" in line for line in screen(view))
        await pilot.resize_terminal(80, 24)
        await pilot.pause(0.1)
        assert "GROUP" not in next(line for line in screen(view) if "RESIDUAL" in line)

    shown(Source(seen[200]), small, tmp_path)
    shown(Source(seen[200]), wide, tmp_path, (170, 60))


def test_before_the_first_frame_and_after_the_last(seen: Seen, tmp_path: Path) -> None:
    made = design(load_model("openacc"))[0]
    empty = Monitor(made, Native(library("f32"), made.tables), REST, "can0").snapshot()
    source = Source(empty)

    async def steps(view: View, pilot: Pilot[None]) -> None:
        assert "not heard" in screen(view)[1] and "no sample yet" in screen(view)[2]
        source.latest = replace(seen[300], ended=True)
        await until(lambda: "END OF LOG" in screen(view)[0], pilot)

    shown(source, steps, tmp_path)


def cells(s: Snapshot) -> list[tuple[object, ...]]:
    return [(x, y, c) for x, part in enumerate((head(s, "LIVE"), plant_rows(s), bus_rows(s))) for y, r in enumerate(part) for c in enumerate(r.cells)]


def test_only_cells_that_changed_are_drawn(seen: Seen, tmp_path: Path) -> None:
    """The load of the view is bounded by what changes: not one cell more is asked for, however often it looks."""
    source = Source(seen[150])

    async def steps(view: View, pilot: Pilot[None]) -> None:
        first = view.drawn
        await pilot.pause(0.2)
        assert view.drawn == first, "nothing new, nothing drawn"
        for k in range(151, 171):
            before, source.latest = view.drawn, seen[k]
            await until(lambda k=k: view.shown is seen[k], pilot)  # type: ignore[misc]
            changed = len(set(cells(seen[k])) - set(cells(seen[k - 1])))
            assert 0 < view.drawn - before <= changed < len(cells(seen[k])) / 2

    shown(source, steps, tmp_path)


def test_a_cell_is_drawn_where_it_stands(seen: Seen, tmp_path: Path) -> None:
    """Twenty updates by parts leave the screen that one update as a whole would."""
    source = Source(seen[250])
    by_parts: list[str] = []
    whole: list[str] = []

    async def parts(view: View, pilot: Pilot[None]) -> None:
        for k in range(251, alarmed(seen) + 10):
            source.latest = seen[k]
            view.look()
            await pilot.pause()
        await pilot.pause(0.1)
        by_parts.extend(screen(view))

    async def at_once(view: View, pilot: Pilot[None]) -> None:
        whole.extend(screen(view))

    shown(source, parts, tmp_path, (80, 70))
    shown(source, at_once, tmp_path, (80, 70))
    assert by_parts == whole


def test_a_sheet_of_another_layout_is_drawn_anew() -> None:
    from hullguard.monitor.rows import Cell, Row

    sheet = Sheet("x")
    sheet._rows = (Row((Cell("ab"), Cell("c"))),)
    sheet.show((Row((Cell("ab"), Cell("d"))),))
    assert sheet.drawn == 1
    sheet.show((Row((Cell("a"), Cell("bd"))),))
    assert sheet.drawn == 3
    sheet.show((Row((Cell("a"), Cell("bd")), "bold"),))
    assert sheet.drawn == 5


# ---- in a terminal ----


class Terminal:
    """The command at the other end of a pseudo-terminal of 80 x 24."""

    def __init__(self, *arguments: object) -> None:
        self.out = b""
        self._end, other = pty.openpty()
        fcntl.ioctl(other, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        command = [sys.executable, "-m", "hullguard", *map(str, arguments)]
        self.process = subprocess.Popen(command, stdin=other, stdout=other, stderr=other, env=os.environ | {"TERM": "xterm"}, start_new_session=True)
        self.before = termios.tcgetattr(other)
        self._other = other

    def read(self, condition: Callable[[], bool], for_s: float = 100.0) -> None:
        end = time.monotonic() + for_s
        while not condition():
            assert time.monotonic() < end, self.out[-3000:].decode(errors="replace")
            if select.select([self._end], [], [], 0.05)[0]:
                self.out += os.read(self._end, 65536)

    def ends(self) -> int:
        self.read(lambda: self.process.poll() is not None)
        self.read(lambda: not select.select([self._end], [], [], 0.1)[0])
        assert self.process.returncode is not None
        after = termios.tcgetattr(self._other)
        assert after == self.before, "the terminal is as it was"
        os.close(self._end)
        os.close(self._other)
        if b"\x1b[?1049h" in self.out:
            assert self.out.rindex(b"\x1b[?1049l") > self.out.rindex(b"\x1b[?1049h"), "back from the alternate screen"
            assert self.out.rindex(b"\x1b[?25h") > self.out.rindex(b"\x1b[?25l"), "the cursor is back"
        return self.process.returncode

    def send(self, keys: bytes) -> None:
        os.write(self._end, keys)


@pytest.mark.parametrize("how", ["ctrl-c", "SIGTERM"])
def test_it_leaves_the_terminal_as_it_was(how: str, folder: Path) -> None:
    t = Terminal("monitor", "openacc", "--log", folder / "run.log", "--rest")
    t.read(lambda: b"observer 9" in t.out and b"LOG x1" in t.out)
    if how.startswith("SIG"):
        t.process.send_signal(getattr(signal, how))
    else:
        t.send(b"\x03")
    assert t.ends() == 0


def test_a_broken_log_ends_the_view_with_one_line(folder: Path, tmp_path: Path) -> None:
    log = tmp_path / "broken.log"
    log.write_text("".join((folder / "run.log").read_text().splitlines(keepends=True)[:30]) + "nonsense\n")
    t = Terminal("monitor", "openacc", "--log", log, "--rest")
    assert t.ends() == 2
    said = t.out[t.out.rindex(b"\x1b[?1049l") :].decode()
    assert "hullguard: broken.log:31: not a candump -L line" in said and "Traceback" not in said


def test_a_log_at_once_stays_until_q(folder: Path, tmp_path: Path) -> None:
    picture = tmp_path / "end.txt"
    t = Terminal("monitor", "openacc", "--log", folder / "run.log", "--rest", "--speed", "max", "--snapshot", picture)
    t.read(lambda: b"END OF LOG" in t.out)
    t.send(b"q")
    assert t.ends() == 0
    assert "END OF LOG" in picture.read_text(encoding="utf-8")


def test_lines_end_with_ctrl_c(folder: Path) -> None:
    command = [sys.executable, "-m", "hullguard", "monitor", "openacc", "--log", str(folder / "run.log"), "--rest", "--plain", "--speed", "1", "--every", "0.2"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stderr is not None
        first = [process.stdout.readline() for _ in range(8)]
        process.send_signal(signal.SIGINT)
        rest, err = process.communicate(timeout=100)
    assert all(x.startswith("event=") for x in first)
    assert process.returncode == 0 and err == "" and rest.splitlines()[-1].startswith("event=end")


def test_a_reader_that_goes_away_is_no_error(folder: Path) -> None:
    command = [sys.executable, "-m", "hullguard", "monitor", "openacc", "--log", str(folder / "run.log"), "--rest", "--plain", "--every", "0.1"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert "Traceback" not in process.stderr.read()
        assert process.wait(20) in (0, 120)
