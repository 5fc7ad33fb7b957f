"""Run inside with-vcan by test_formats_bus.py: can-utils and tshark on a live bus read what is written here, and theirs is read."""

from __future__ import annotations

import contextlib
import io
import json
import random
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from hullguard.bus import formats
from hullguard.bus.candump import BRS, ERROR, EXTENDED, FD, REMOTE, Entry
from hullguard.cli import main
from hullguard.core.library import library
from hullguard.core.native import Frame, frame_bits
from inside_support import WAIT_S, link, recorded
from node_support import SEED

EVERYTHING = "vcan0,0:0,#FFFFFFFF"  # error frames too


def mixture(count: int) -> list[Entry]:
    """Frames of every kind, a millisecond apart."""
    rng, made = random.Random(SEED), []
    for i in range(count):
        wide = rng.random() < 0.5
        number, flags = rng.randrange(0x20000000 if wide else 0x800), EXTENDED if wide else 0
        kind = i % 5
        if kind == 0:
            e = Entry(0.0, "vcan0", Frame(rng.choice([0x40, 0x04, 0x1FF]), ERROR, rng.randbytes(8)))
        elif kind == 1:
            e = Entry(0.0, "vcan0", Frame(number, flags | REMOTE, b""), "", rng.randrange(9))
        elif kind == 2:
            e = Entry(0.0, "vcan0", Frame(number, flags | FD | (BRS if rng.random() < 0.5 else 0), rng.randbytes(rng.choice((0, 8, 12, 64)))), "", 0, rng.random() < 0.5)
        else:
            e = Entry(0.0, "vcan0", Frame(number, flags, rng.randbytes(rng.randrange(9))))
        made.append(replace(e, time_s=1_700_000_000 + i / 1000))
    return made


def bare(entries: list[Entry]) -> list[Entry]:
    return [replace(e, time_s=0.0, direction="") for e in entries]


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Entry], Path]:
    """A mixture played by canplayer once, recorded by all at once."""
    folder, many = tmp_path_factory.mktemp("played"), mixture(250)
    formats.write(folder / "run.log", many)
    with contextlib.ExitStack() as stack:
        capture = subprocess.Popen(["dumpcap", "-q", "-i", "vcan0", "-i", "any", "-w", folder / "live.pcapng"], stderr=subprocess.PIPE, text=True)
        stack.callback(capture.wait, 20)
        stack.callback(capture.send_signal, signal.SIGINT)
        assert capture.stderr is not None
        while "File:" not in (line := capture.stderr.readline()):
            assert line, "dumpcap does not capture"
        for name, options in (("plain.log", ("-L",)), ("extra.log", ("-L", "-x")), ("silent", ("-l",))):
            stack.enter_context(recorded(folder / name, "candump", *options, EVERYTHING, filters=2))
        subprocess.run(["canplayer", "-I", str(folder / "run.log")], check=True, timeout=WAIT_S)
    return many, folder


@pytest.mark.parametrize("name", ["plain.log", "extra.log", "candump-*.log"])
def test_candump_saw_what_canplayer_read(name: str, played: tuple[list[Entry], Path]) -> None:
    """Our log through canplayer and the bus into candump: nothing changes, error frames, remote lengths and ESI included."""
    many, folder = played
    (path,) = folder.glob(name)
    found = list(formats.read(path))
    assert bare(found) == bare(many)
    assert {e.direction for e in found} <= {"", "R", "T"} and (name != "extra.log" or {e.direction for e in found} == {"T"})


@pytest.mark.parametrize("name", ["vcan0", "any"])
def test_a_live_capture_is_read(name: str, played: tuple[list[Entry], Path]) -> None:
    """Wireshark's dumpcap on the interface, and on all of them, where frames have a cooked header and the identifier the host's byte order."""
    many, folder = played

    def kept(entries: list[Entry]) -> list[Entry]:
        # libpcap 1.10.3 clears the flags of FD frames that it captures from a CAN interface; that they are FD shows in their size.
        return entries if name == "any" else [replace(e, passive=False, frame=replace(e.frame, flags=e.frame.flags & ~BRS)) for e in entries]

    found = [e for e in formats.read(folder / "live.pcapng") if e.channel == name]
    assert kept(bare(found)) == kept([replace(e, channel=name) for e in bare(many)])


@contextlib.contextmanager
def busload(path: Path) -> Iterator[list[int]]:
    """What canbusload -e counts: frames, bits, bits of data; known at the end."""
    seen: list[int] = []
    with recorded(path, "stdbuf", "-oL", "canbusload", "-e", "vcan0@500000"):
        yield seen
        time.sleep(2.2)  # it tells every second
    rows = [tuple(map(int, m.groups())) for m in re.finditer(r"vcan0@500000\s+(\d+)\s+(\d+)\s+(\d+)\s+\d+%", path.read_text())]
    seen += [sum(column) for column in zip(*rows, strict=True)]


def test_canbusload_counts_the_same_bits(tmp_path: Path) -> None:
    """Classic frames, data and remote, standard and extended, with -e; it has no exact length of CAN FD."""
    rng = random.Random(SEED)
    patterns = (0x00, 0xFF, 0x0F, 0x78, 0x55)
    frames = [Frame(rng.randrange(0x800), 0, bytes(rng.choice(patterns) for _ in range(rng.randrange(9)))) for _ in range(150)]
    frames += [Frame(rng.randrange(0x20000000), EXTENDED, rng.randbytes(rng.randrange(9))) for _ in range(150)]
    with link() as bus, busload(tmp_path / "load") as seen:
        for frame in frames:
            bus.send(frame)
    assert seen == [len(frames), sum(frame_bits(library("f32"), f) for f in frames), sum(8 * len(f.data) for f in frames)]


def test_canbusload_sees_the_load_of_a_run(tmp_path: Path) -> None:
    """All frames of a run, those that only lockstep adds included."""
    out = io.StringIO()
    with busload(tmp_path / "load") as seen, contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        assert main(["run", "platoon", "--seed", str(SEED), "--bus", "vcan0", "--json"]) == 0
    frames = json.loads(out.getvalue())["frames"]
    print(f"TIMING bits of a run: canbusload -e {seen[1]}, hullguard {frames['bits']} and {frames['bits_lockstep_replies']} of lockstep replies")
    assert seen[0] == frames["total"] + frames["lockstep_replies"]
    assert seen[1] == frames["bits"] + frames["bits_lockstep_replies"]
