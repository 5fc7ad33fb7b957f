"""Candump logs: what is written is read back, and read alike by python-can and can-utils. Frame lengths against an encoder of the test's own."""

from __future__ import annotations

import random
import shutil
import subprocess
from pathlib import Path

import can
import pytest
from host_support import SEED, classic_bits
from hullguard.bus import candump
from hullguard.bus.bits import worst_bits
from hullguard.bus.candump import (
    BRS,
    ERROR,
    EXTENDED,
    FD,
    REMOTE,
    Entry,
    Writer,
    line,
    read,
)
from hullguard.bus.link import from_message, to_message
from hullguard.core.library import library
from hullguard.core.native import Frame, frame_bits
from hullguard.design.tables import MessageTable
from hullguard.errors import InputError
from hypothesis import example, given
from hypothesis import strategies as st

FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)


@st.composite
def frames(draw: st.DrawFn, kinds: tuple[str, ...] = ("classic", "remote", "fd", "error")) -> Frame:
    kind = draw(st.sampled_from(kinds))
    if kind == "error":
        return Frame(draw(st.integers(0, 0x1FFFFFFF)), ERROR, draw(st.binary(min_size=8, max_size=8)))
    extended = draw(st.booleans())
    number = draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF))
    flags = EXTENDED if extended else 0
    if kind == "remote":
        return Frame(number, flags | REMOTE, b"")
    if kind == "fd":
        length = draw(st.sampled_from(FD_LENGTHS))
        return Frame(number, flags | FD | (BRS if draw(st.booleans()) else 0), draw(st.binary(min_size=length, max_size=length)))
    return Frame(number, flags, draw(st.binary(max_size=8)))


logs = st.lists(st.tuples(st.integers(0, 2_000_000_000_000_000).map(lambda us: us / 1e6), frames()), max_size=20)


def written(path: Path, entries: list[tuple[float, Frame]]) -> Path:
    writer = Writer(path, "vcan0")
    for time_s, frame in entries:
        writer.write(time_s, frame)
    writer.close()
    return path


@given(logs)
def test_no_frame_is_lost_or_changed_between_writer_and_reader(tmp_path_factory: pytest.TempPathFactory, entries: list[tuple[float, Frame]]) -> None:
    found = list(read(written(tmp_path_factory.mktemp("log") / "run.log", entries)))
    assert [e.frame for e in found] == [f for _, f in entries]
    assert [e.channel for e in found] == ["vcan0"] * len(entries)
    assert all(abs(e.time_s - t) <= 1e-6 for e, (t, _) in zip(found, entries, strict=True))


@given(logs)
def test_python_can_reads_the_same_frames(tmp_path_factory: pytest.TempPathFactory, entries: list[tuple[float, Frame]]) -> None:
    path = written(tmp_path_factory.mktemp("log") / "run.log", entries)
    with can.CanutilsLogReader(path) as reader:
        messages = list(reader)
    assert len(messages) == len(entries)
    for message, (time_s, frame) in zip(messages, entries, strict=True):
        assert abs(message.timestamp - time_s) <= 1e-5
        if frame.flags & ERROR:
            continue  # python-can keeps neither its class nor its data
        assert from_message(message) == frame


@given(st.lists(frames(("classic", "remote", "fd")), max_size=20))
def test_what_python_can_writes_is_read_alike(tmp_path_factory: pytest.TempPathFactory, many: list[Frame]) -> None:
    path = tmp_path_factory.mktemp("log") / "can.log"
    with can.CanutilsLogWriter(path) as writer:
        for i, frame in enumerate(many):
            message = to_message(frame)
            message.timestamp = 1.0 + i
            writer(message)
    assert [e.frame for e in read(path)] == many


@given(frames())
def test_no_frame_changes_on_its_way_through_a_python_can_message(frame: Frame) -> None:
    assert from_message(to_message(frame)) == frame


@pytest.mark.skipif(shutil.which("log2asc") is None, reason="needs can-utils (apt: can-utils)")
def test_can_utils_read_every_line(tmp_path: Path) -> None:
    rng = random.Random(SEED)
    many = [Frame(rng.randrange(0x800), 0, rng.randbytes(rng.randrange(9))) for _ in range(50)]
    many += [Frame(rng.randrange(0x20000000), EXTENDED, rng.randbytes(8)) for _ in range(50)]
    many += [Frame(rng.randrange(0x800), REMOTE, b"") for _ in range(10)]
    many += [Frame(rng.randrange(0x800), FD | BRS, rng.randbytes(rng.choice(FD_LENGTHS))) for _ in range(50)]
    log = written(tmp_path / "run.log", [(i * 0.001, f) for i, f in enumerate(many)])
    done = subprocess.run(["log2asc", "-I", str(log), "vcan0"], check=True, capture_output=True, text=True)
    rows = [r.split() for r in done.stdout.splitlines() if r[:1].isdigit() or r.startswith(" ")]
    assert len(rows) == len(many), done.stderr
    for row, frame in zip(rows, many, strict=True):
        text = " ".join(row).lower()
        assert f"{frame.id:x}{'x' if frame.flags & EXTENDED else ''}" in text.split()
        if frame.data:
            assert frame.data.hex(" ") in text


def test_lines_are_those_of_candump() -> None:
    assert line(1.5, "vcan0", Frame(0x110, 0, b"\x01\xab")) == "(0000000001.500000) vcan0 110#01AB"
    assert line(0.0, "vcan0", Frame(0x110, EXTENDED, b"")) == "(0000000000.000000) vcan0 00000110#"
    assert line(0.0, "can1", Frame(0x7FF, REMOTE, b"")) == "(0000000000.000000) can1 7FF#R"
    assert line(0.0, "can1", Frame(0x1, FD | BRS, b"\xff" * 12)) == "(0000000000.000000) can1 001##1" + "FF" * 12
    assert line(0.0, "can1", Frame(0x40, ERROR, bytes(8))) == "(0000000000.000000) can1 20000040#" + "00" * 8


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(1436509052.249713) vcan0 044#2A366C2BBA", Frame(0x044, 0, bytes.fromhex("2A366C2BBA"))),
        ("(1436509053.850870) can0 12345678#AABB R", Frame(0x12345678, EXTENDED, bytes.fromhex("AABB"))),
        ("(1436509053.850870) can0 12345678#aabb T", Frame(0x12345678, EXTENDED, bytes.fromhex("AABB"))),
        ("(1436509053.85) can0 123#R8", Frame(0x123, REMOTE, b"")),
        ("(1436509053.850870) can0 123##0", Frame(0x123, FD, b"")),
        ("(1436509053.850870) can0 123##5AABB", Frame(0x123, FD | BRS, bytes.fromhex("AABB"))),
    ],
)
def test_lines_as_other_tools_write_them_are_understood(tmp_path: Path, text: str, expected: Frame) -> None:
    path = tmp_path / "x.log"
    path.write_text(text + "\n", encoding="ascii")
    found = list(read(path))
    assert len(found) == 1
    assert isinstance(found[0], Entry)
    assert found[0].frame == expected


@example("#")
@given(st.text(max_size=40))
def test_no_line_does_anything_but_become_a_frame_or_be_refused(text: str) -> None:
    for raw in (text, "(1.0) can0 " + text, "(1.0) can0 123#" + text, "(1.0) can0 123##" + text, "(1.0) can0 12345678#R" + text):
        try:
            candump._entry(raw, "x.log:1")
        except InputError as error:
            assert "x.log:1" in str(error)


@pytest.mark.parametrize(("mark", "length"), [("#", 9), ("#", 64), ("##1", 65), ("##0", 255), ("##0", 300)])
def test_no_frame_longer_than_its_format_is_taken_from_a_log(tmp_path: Path, mark: str, length: int) -> None:
    path = tmp_path / "x.log"
    path.write_text(f"(1.0) can0 123{mark}{'00' * length}\n", encoding="ascii")
    with pytest.raises(InputError, match="x.log:1"):
        list(read(path))


# ---- bits on the wire ----


@given(frames(("classic", "remote")))
def test_no_classic_frame_has_another_length_than_the_bit_by_bit_encoder_says(frame: Frame) -> None:
    assert frame_bits(library("f32"), frame) == classic_bits(frame)


@pytest.mark.parametrize("fill", [0x00, 0xFF, 0x55, 0xAA, 0x0F, 0x1F, 0xF8, 0x78, 0x87])
@pytest.mark.parametrize("number", [0, 0x7FF, 0x078, 0x555, 0x110])
@pytest.mark.parametrize("length", range(9))
def test_frames_full_of_stuff_bits_have_the_length_of_the_encoder(fill: int, number: int, length: int) -> None:
    for flags, wide in ((0, number), (EXTENDED, number << 18 | number)):
        frame = Frame(wide & (0x1FFFFFFF if flags else 0x7FF), flags, bytes([fill]) * length)
        assert frame_bits(library("f32"), frame) == classic_bits(frame)


@given(frames(("classic", "fd")))
def test_no_frame_is_longer_than_its_worst_case_or_shorter_than_without_stuffing(frame: Frame) -> None:
    n, extended = len(frame.data), bool(frame.flags & EXTENDED)
    bits = frame_bits(library("f32"), frame)
    flags = frame.flags & (EXTENDED | FD | BRS)
    if not flags & FD:
        assert (67 if extended else 47) + 8 * n <= bits <= (80 if extended else 55) + 10 * n
    else:
        fixed = (49 if extended else 30) + 1 + 4 + 8 * n + 4 + (17 + 6 if n <= 16 else 21 + 7)
        assert fixed <= bits <= fixed + ((36 if extended else 17) + 5 + 8 * n - 1) // 4
    if n >= 1:
        assert bits <= worst_bits(MessageTable("x", frame.id, flags, n, (0,) * 16))


def test_the_worst_case_is_reached_but_for_a_few_bits() -> None:
    """A bound that nothing comes near would prove nothing about the load."""
    frame = Frame(0x078, 0, bytes.fromhex("3C3C3C3C3C3C3C3C"))
    longest = max(frame_bits(library("f32"), Frame(number, 0, frame.data)) for number in range(0x800))
    assert longest <= 135
    rng = random.Random(SEED)
    patterns = [0x07, 0x0F, 0x1E, 0x3C, 0x78, 0xF0, 0xE1, 0xC3, 0x87, 0x83]
    best = max(frame_bits(library("f32"), Frame(0x078, 0, bytes(rng.choice(patterns) for _ in range(8)))) for _ in range(3000))
    assert best >= 123
