"""Recordings in the formats people use: what is written is read by tools that are not ours, and what they write is read here. No frame changes
on its way, or the loss is told."""

from __future__ import annotations

import csv
import io
import json
import random
import re
import struct
import subprocess
import sys
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import asammdf
import can
import canmatrix.formats
import cantools
import numpy as np
import pandas as pd
import pytest
from host_support import ROOT, SEED, Cli
from hullguard.bus import candump, convert, formats, pcap
from hullguard.bus.candump import BRS, ERROR, EXTENDED, FD, REMOTE, Entry
from hullguard.core.native import Frame
from hullguard.errors import InputError

FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
EPOCH, VIRTUAL = 1_700_000_000, 0
KINDS = ("standard", "extended", "remote", "error", "fd", "fd-fast", "fd-passive")
CLASSES = {"can.err.tx_timeout": 0x1, "can.err.ctrl": 0x4, "can.err.prot": 0x8, "can.err.ack": 0x20, "can.err.busoff": 0x40, "can.err.restarted": 0x100}


def entries(
    rng: random.Random, count: int, kinds: Sequence[str] = KINDS, channels: Sequence[str] = ("can0",), directions: Sequence[str] = ("R",), start: int = EPOCH
) -> list[Entry]:
    """Frames of every kind, their times growing."""
    made, at = [], start * 1_000_000
    for _ in range(count):
        at += rng.randrange(1, 200_000)
        kind = rng.choice(kinds)
        wide = kind == "extended" or (kind not in ("standard", "error") and rng.random() < 0.5)
        number, flags = rng.randrange(0x20000000 if wide else 0x800), EXTENDED if wide else 0
        asked, passive, data = 0, kind == "fd-passive", rng.randbytes(rng.randrange(9))
        if kind == "remote":
            flags, asked, data = flags | REMOTE, rng.randrange(9), b""
        elif kind == "error":
            number, flags, data = rng.choice([*CLASSES.values(), 0x1FF]), ERROR, rng.randbytes(8)
        elif kind.startswith("fd"):
            flags, data = flags | FD | (BRS if kind == "fd-fast" else 0), rng.randbytes(rng.choice(FD_LENGTHS))
        made.append(Entry(at / 1_000_000, rng.choice(channels), Frame(number, flags, data), rng.choice(directions), asked, passive))
    return made


def comparable(many: Sequence[Entry]) -> list[Entry]:
    """A format that must state a direction says received where nothing is known."""
    return [replace(e, direction=e.direction or "R") for e in many]


def run(*command: object) -> str:
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{command}: {done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run in every format."""
    out = tmp_path_factory.mktemp("recorded")
    command = [sys.executable, "-m", "hullguard", "run", "platoon", "--bus", "inprocess", "--seed", str(SEED), "--out", str(out), "--formats", "pcap,pcapng,blf,mf4,asc", "--json"]
    (out / "told").write_text(run(*command))
    return out


# ---- both ways ----


@pytest.mark.parametrize("start", [EPOCH, VIRTUAL])
@pytest.mark.parametrize("suffix", formats.FORMATS)
def test_nothing_is_lost_or_the_loss_is_told(suffix: str, start: int, tmp_path: Path) -> None:
    """Over mixtures of kinds, channels and directions: the file is read back as it was exactly when no line tells of a loss."""
    rng, told = random.Random(f"{SEED}/{suffix}/{start}"), 0
    for i in range(24):
        kinds = rng.sample(KINDS, rng.randrange(1, 5))
        channels = rng.choice([("can0",), ("can0", "can3"), ("vcan0",), ("can0", "plant")])
        many = entries(rng, 20, kinds, channels, rng.choice(["R", "T", "RT", ("",)]), start)
        path = tmp_path / f"{i}{suffix}"
        lines = formats.write(path, many)
        found = list(formats.read(path))
        if suffix != ".pcap":
            found, many = comparable(found), comparable(many)
        assert (found == many) == (not lines), f"{kinds} {channels}: {lines}"
        told += bool(lines)
    assert (told == 0) == (suffix in (".log", ".pcapng"))


@pytest.mark.parametrize("source", formats.FORMATS)
@pytest.mark.parametrize("target", formats.FORMATS)
def test_convert_from_any_format_into_any(source: str, target: str, cli: Cli, tmp_path: Path) -> None:
    many = entries(random.Random(SEED), 60, [k for k in KINDS if k != "error"])
    formats.write(tmp_path / f"a{source}", many)
    done = cli("convert", tmp_path / f"a{source}", tmp_path / f"b{target.upper()}", "--json")
    assert done.status == 0, done.err
    assert done.json["frames"] == 60
    assert comparable(formats.read(tmp_path / f"b{target.upper()}")) == many


def test_convert_tells_what_is_lost(cli: Cli, tmp_path: Path) -> None:
    rng = random.Random(SEED)
    formats.write(tmp_path / "a.log", entries(rng, 30, ("error", "standard"), ("vcan0", "vcan1"), "RT"))
    found = {s: cli("convert", tmp_path / "a.log", tmp_path / f"b{s}") for s in formats.FORMATS}
    assert all(f.status == 0 and f.out.startswith("30 frames") for f in found.values())
    assert found[".log"].err == found[".pcapng"].err == ""
    for suffix, words in ((".pcap", ("vcan1 becomes can0", "received")), (".blf", ("vcan1 becomes can1",)), (".mf4", ("vcan0 becomes can0",)), (".asc", ("error frames",))):
        assert all(re.search(f"(?m)^hullguard: .*{suffix}: .*{w}", found[suffix].err) for w in words), found[suffix].err
    one = cli("convert", tmp_path / "a.log", tmp_path / "one.pcapng", "--channel", "vcan1")
    assert one.status == 0 and {e.channel for e in formats.read(tmp_path / "one.pcapng")} == {"vcan1"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("a.log", "b.xyz"), "b.xyz"),
        (("a.xyz", "b.log"), "a.xyz"),
        (("missing.blf", "b.log"), "missing.blf"),
        (("a.log", "a.log"), "name another"),
        (("a.log", "b.csv"), "--dbc"),
        (("a.log", "b.pcap", "--dbc", "x.dbc"), "--dbc"),
        (("a.log", "b.csv", "--dbc", "x.dbc"), "x.dbc"),
        (("a.log", "no/such/b.pcap"), "b.pcap"),
        (("a.log", "b.pcap", "--channel", "can7"), "can7"),
        (("text.blf", "b.log"), "text.blf"),
        (("text.mf4", "b.log"), "text.mf4"),
        (("text.pcap", "b.log"), "text.pcap"),
        (("empty.pcap", "b.log"), "an empty file"),
        (("a.log", "no/such/b.csv", "--dbc", "good.dbc"), "cannot be written"),
        (("far.log", "b.pcap"), "cannot hold"),
        (("far.log", "b.mf4"), "cannot hold"),
    ],
)
def test_convert_refuses_in_one_line(arguments: tuple[str, ...], words: str, cli: Cli, tmp_path: Path) -> None:
    formats.write(tmp_path / "a.log", entries(random.Random(SEED), 3))
    for name in ("text.blf", "text.mf4", "text.pcap", "a.xyz", "x.dbc"):
        (tmp_path / name).write_text("no recording at all, whatever its name may say")
    (tmp_path / "empty.pcap").touch()
    (tmp_path / "good.dbc").write_bytes((ROOT / "firmware" / "models" / "platoon.dbc").read_bytes())
    (tmp_path / "far.log").write_text("(99999999999.000001) can0 110#11\n")
    done = cli("convert", *(tmp_path / a if "." in a else a for a in arguments))
    assert (done.status, done.out) == (2, "") and re.fullmatch(r"hullguard: [^\n]+\n", done.err) and words in done.err


@pytest.mark.parametrize("suffix", [s for s in formats.FORMATS if s != ".mf4"])
def test_a_damaged_file_is_read_or_refused(suffix: str, tmp_path: Path) -> None:
    """Cut off, or with a wrong byte: frames or one error of ours, never another one."""
    rng = random.Random(f"{SEED}/{suffix}")
    formats.write(tmp_path / f"whole{suffix}", entries(rng, 12, channels=("can0", "can1")))
    whole, refused = (tmp_path / f"whole{suffix}").read_bytes(), 0
    for _ in range(150):
        damaged = bytearray(whole[: rng.randrange(len(whole))] if rng.random() < 0.5 else whole)
        for _ in range(rng.randrange(3)):
            if damaged:
                damaged[rng.randrange(len(damaged))] = rng.randrange(256)
        (tmp_path / f"x{suffix}").write_bytes(damaged)
        try:
            list(formats.read(tmp_path / f"x{suffix}"))
        except InputError as error:
            assert "\n" not in str(error)
            refused += 1
    assert refused > 5 or suffix == ".asc"  # python-can passes over lines of an ASC file that it does not understand


# ---- Wireshark ----

FIELDS = (
    "frame.time_epoch",
    "frame.interface_name",
    "can.id",
    "can.flags.xtd",
    "can.flags.rtr",
    "can.flags.err",
    "can.len",
    "canfd.flags.brs",
    "canfd.flags.esi",
    *CLASSES,
    "data.data",
    "frame.p2p_dir",
)


def shown(path: Path) -> list[dict[str, str]]:
    """What tshark makes of a file."""
    options = [x for f in FIELDS for x in ("-e", f)]
    return list(csv.DictReader(io.StringIO(run("tshark", "-r", path, "-T", "fields", "-E", "header=y", "-E", "separator=,", "-E", "occurrence=f", *options))))


@pytest.mark.parametrize("suffix", [".pcap", ".pcapng"])
def test_tshark_reads_every_frame(suffix: str, tmp_path: Path) -> None:
    many = entries(random.Random(SEED), 300, channels=("can0", "can1") if suffix == ".pcapng" else ("can0",), directions="RT" if suffix == ".pcapng" else "R")
    formats.write(tmp_path / f"run{suffix}", many)
    rows = shown(tmp_path / f"run{suffix}")
    assert len(rows) == len(many)
    for row, e in zip(rows, many, strict=True):
        frame = e.frame
        assert float(row["frame.time_epoch"]) == e.time_s
        assert int(row["can.len"]) == (e.asked if frame.flags & REMOTE else len(frame.data))
        if suffix == ".pcapng":
            assert row["frame.interface_name"] == e.channel and row["frame.p2p_dir"] == ("1" if e.direction == "R" else "0")
        if frame.flags & ERROR:
            assert row["can.flags.err"] == "1"
            assert {f for f in CLASSES if row[f] == "1"} == {f for f, bit in CLASSES.items() if frame.id & bit}
            continue
        assert (int(row["can.id"]), row["can.flags.xtd"]) == (frame.id, str(int(bool(frame.flags & EXTENDED))))
        assert (row["canfd.flags.brs"] != "") == bool(frame.flags & FD), "dissected as CAN FD, or not"
        if frame.flags & FD:
            assert (row["canfd.flags.brs"], row["canfd.flags.esi"]) == (str(int(bool(frame.flags & BRS))), str(int(e.passive)))
        else:
            assert (row["can.flags.rtr"], row["can.flags.err"]) == (str(int(bool(frame.flags & REMOTE))), "0")
        assert row["data.data"] == frame.data.hex() or frame.flags & REMOTE


@pytest.mark.parametrize("options", [("-F", "pcapng"), ("-F", "pcap"), ("-F", "nsecpcap")], ids=lambda o: o[1])
def test_what_wireshark_writes_is_read(options: tuple[str, ...], tmp_path: Path) -> None:
    many = entries(random.Random(SEED), 200)
    formats.write(tmp_path / "run.pcap", [replace(e, direction="") for e in many])
    run("tshark", "-r", tmp_path / "run.pcap", "-w", tmp_path / "theirs.pcapng", *options)
    found = list(formats.read(tmp_path / "theirs.pcapng"))
    assert [e.frame for e in found] == [e.frame for e in many]
    assert [(e.asked, e.passive) for e in found] == [(e.asked, e.passive) for e in many]
    assert np.allclose([e.time_s for e in found], [e.time_s for e in many], rtol=0, atol=5e-7)


def test_a_big_endian_capture_is_read(tmp_path: Path) -> None:
    """As a machine of the other byte order writes it; tshark agrees."""
    packet = bytes.fromhex("8000012302000000aabb") + bytes(6)
    (tmp_path / "a.pcap").write_bytes(struct.pack(">IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, pcap.SOCKETCAN) + struct.pack(">IIII", 5, 250_000, 16, 16) + packet)
    section, interface = struct.pack(">IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28), struct.pack(">IIHHII", 1, 20, 227, 0, 65535, 20)
    (tmp_path / "a.pcapng").write_bytes(section + interface + struct.pack(">IIIIIII", 6, 48, 0, 0, 5_250_000, 16, 16) + packet + struct.pack(">I", 48))
    for name in ("a.pcap", "a.pcapng"):
        assert [(e.time_s, e.frame) for e in formats.read(tmp_path / name)] == [(5.25, Frame(0x123, EXTENDED, b"\xaa\xbb"))]
        (row,) = shown(tmp_path / name)
        assert (row["can.id"], row["can.flags.xtd"], row["data.data"], float(row["frame.time_epoch"])) == (str(0x123), "1", "aabb", 5.25)


@pytest.mark.parametrize("link", [pcap.COOKED, pcap.COOKED_2])
def test_a_capture_of_all_interfaces_is_read(link: int, tmp_path: Path) -> None:
    """The cooked header of `-i any`, among other packets; tshark reads the same frames."""
    frames = [
        (0x000C, struct.pack("<IBBH", 0x123, 2, 0, 0) + b"\x01\x02" + bytes(6)),
        (0x000D, struct.pack("<IBBH", 0x80000124, 12, 1, 0) + bytes(range(12)) + bytes(52)),
        (0x0800, bytes(40)),
    ]
    records = b""
    for i, (protocol, packet) in enumerate(frames):
        header = struct.pack(">HHHQH", 4, 280, 0, 0, protocol) if link == pcap.COOKED else struct.pack(">HHIHBBQ", protocol, 0, 3, 280, 4, 0, 0)
        records += struct.pack("<IIII", i, 0, len(header) + len(packet), len(header) + len(packet)) + header + packet
    (tmp_path / "any.pcap").write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, link) + records)
    assert [(e.frame, e.direction) for e in formats.read(tmp_path / "any.pcap")] == [
        (Frame(0x123, 0, b"\x01\x02"), "T"),
        (Frame(0x124, EXTENDED | FD | BRS, bytes(range(12))), "T"),
    ]
    rows = [r for r in shown(tmp_path / "any.pcap") if r["can.id"]]
    assert [(int(r["can.id"]), r["data.data"]) for r in rows] == [(0x123, "0102"), (0x124, bytes(range(12)).hex())]


def test_a_capture_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "lan.pcap").write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1) + struct.pack("<IIII", 0, 0, 60, 60) + bytes(60))
    with pytest.raises(InputError, match="link type 1, where CAN has 227"):
        list(formats.read(tmp_path / "lan.pcap"))


def test_wireshark_reads_the_blf(tmp_path: Path) -> None:
    """A reader of BLF that shares nothing with the writer; it passes over error frames, and takes FD frames of up to 8 bytes for classic ones."""
    many = entries(random.Random(SEED), 200)
    formats.write(tmp_path / "run.blf", many)
    rows, good = shown(tmp_path / "run.blf"), [e for e in many if not e.frame.flags & ERROR]
    assert len(rows) == len(good) > 100
    for row, e in zip(rows, good, strict=True):
        assert abs(float(row["frame.time_epoch"]) - e.time_s) < 1e-6
        assert (int(row["can.id"]), row["can.flags.xtd"], row["data.data"]) == (e.frame.id, str(int(bool(e.frame.flags & EXTENDED))), e.frame.data.hex())


# ---- python-can and can-utils ----


def test_python_can_reads_blf_and_asc(tmp_path: Path) -> None:
    many = entries(random.Random(SEED), 200, directions="RT")
    for suffix in (".blf", ".asc"):
        formats.write(tmp_path / f"run{suffix}", many)
        with can.LogReader(tmp_path / f"run{suffix}") as reader:
            messages = list(reader)
        assert len(messages) == len(many)
        for message, e in zip(messages, many, strict=True):
            assert message.is_error_frame == bool(e.frame.flags & ERROR)
            if suffix == ".blf":
                assert (message.arbitration_id, bytes(message.data)) == (e.frame.id, e.frame.data)
                assert abs(message.timestamp - e.time_s) < 1e-6


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".mf4"])
def test_what_python_can_logs_is_read(suffix: str, tmp_path: Path) -> None:
    many = entries(random.Random(SEED), 100, [k for k in KINDS if k != "error"], directions="RT")
    with can.Logger(tmp_path / f"theirs{suffix}") as logger:
        for e in many:
            logger(formats.to_numbered(e, 0))
    found = list(formats.read(tmp_path / f"theirs{suffix}"))
    shift = found[0].time_s - many[0].time_s
    assert abs(shift) < (1.0 if suffix == ".asc" else 1e-6), "their ASC header has milliseconds, 59 of them as .59"
    remote = [e.asked for e in found if e.frame.flags & REMOTE]
    assert remote == [e.asked for e in many if e.frame.flags & REMOTE] or suffix == ".log"  # which has no length of remote frames
    assert [replace(e, time_s=0.0, asked=0) for e in found] == [replace(e, time_s=0.0, asked=0) for e in many]
    assert np.allclose([e.time_s - shift for e in found], [e.time_s for e in many], rtol=0, atol=2e-6)


def test_log2asc_and_asc2log_round_trip(tmp_path: Path) -> None:
    """Our log, their ASC, ours again; and our ASC by their asc2log. Error frames become bare ones there."""
    many = entries(random.Random(SEED), 150, directions=("",))
    formats.write(tmp_path / "run.log", many)
    (tmp_path / "theirs.asc").write_text(run("log2asc", "-I", tmp_path / "run.log", "can0"))
    found = list(formats.read(tmp_path / "theirs.asc"))
    assert [e.frame if not e.frame.flags & ERROR else ERROR for e in found] == [e.frame if not e.frame.flags & ERROR else ERROR for e in many]
    assert np.allclose(np.diff([e.time_s for e in found]), np.diff([e.time_s for e in many]), rtol=0, atol=2e-6)
    formats.write(tmp_path / "run.asc", many)
    (tmp_path / "theirs.log").write_text(run("asc2log", "-I", tmp_path / "run.asc"))
    back = list(formats.read(tmp_path / "theirs.log"))
    assert [e.frame if not e.frame.flags & ERROR else ERROR for e in back] == [e.frame if not e.frame.flags & ERROR else ERROR for e in many]


# ---- a run's files ----


def test_a_run_has_the_same_frames_in_every_format(recorded: Path) -> None:
    log = list(formats.read(recorded / "run.log"))
    assert len(log) > 600
    for suffix in formats.FORMATS:
        assert [(e.time_s, e.frame) for e in formats.read(recorded / f"run{suffix}")] == [(e.time_s, e.frame) for e in log], suffix


@pytest.mark.parametrize("suffix", formats.FORMATS)
def test_detect_reads_every_format(suffix: str, recorded: Path, cli: Cli) -> None:
    result = json.loads((recorded / "told").read_text())
    done = cli("detect", "platoon", "--rest", "--log", recorded / f"run{suffix}", "--json")
    assert done.status == 0, done.err
    assert done.json["verdicts"] == result["verdicts"]


def test_formats_belong_to_out(cli: Cli, tmp_path: Path) -> None:
    assert "--out" in cli("run", "platoon", "--bus", "inprocess", "--formats", "pcap").err
    wrong = cli("run", "platoon", "--bus", "inprocess", "--formats", "pcap,mdf", "--out", tmp_path / "o")
    assert wrong.status == 2 and "'mdf'" in wrong.err and not (tmp_path / "o").exists()


def decoded(recorded: Path) -> dict[str, list[tuple[float, float]]]:
    """Signals of the log by cantools, MESSAGE.SIGNAL -> (time, value)."""
    database, found = cantools.database.load_file(recorded / "platoon.dbc"), defaultdict(list)
    for e in candump.read(recorded / "run.log"):
        message = database.get_message_by_frame_id(e.frame.id)
        for name, value in message.decode(e.frame.data, decode_choices=False).items():
            found[f"{message.name}.{name}"].append((e.time_s, float(value)))
    return found


def test_the_dbc_reads_the_runs_codes(recorded: Path) -> None:
    """What cantools decodes from the log is what the node held in that sample."""
    held = pd.read_csv(recorded / "signals.csv").set_index("k")
    for name, series in decoded(recorded).items():
        if f"{name.split('.')[1]}.value" in held.columns:
            at = np.rint(np.array(series)[:, 0] / 0.1).astype(int)
            assert np.allclose(held[f"{name.split('.')[1]}.value"].loc[at], [v for _, v in series], rtol=1e-6, atol=1e-6)


def test_asammdf_decodes_the_mf4(recorded: Path) -> None:
    """extract_bus_logging with the run's DBC: every signal of every message, equal to cantools' of the log."""
    expected, seen = decoded(recorded), set()
    with asammdf.MDF(recorded / "run.mf4") as file:
        made = file.extract_bus_logging({"CAN": [(str(recorded / "platoon.dbc"), 0)]})
        for index, group in enumerate(made.groups):
            for place, channel in list(enumerate(group.channels))[1:]:
                (name,) = (n for n, kind in channel.display_names.items() if kind == "message")
                found = made.get(group=index, index=place)
                if found.samples.dtype.kind == "S":  # a word of the DBC's table for the value
                    found = made.get(group=index, index=place, raw=True)
                times, values = np.array(expected[name]).T
                assert np.allclose(found.timestamps, times, rtol=0, atol=1e-9) and np.allclose(found.samples.astype(float), values, rtol=0, atol=1e-9), name
                seen.add(name)
    assert seen == set(expected)


def test_cantools_and_canmatrix_read_the_dbc_alike(recorded: Path) -> None:
    database = cantools.database.load_file(recorded / "platoon.dbc")
    (matrix,) = canmatrix.formats.loadp(str(recorded / "platoon.dbc")).values()
    assert {m.name for m in database.messages} == {f.name for f in matrix.frames} >= {"measurement", "control", "verdict", "status"}
    for message in database.messages:
        frame = matrix.frame_by_name(message.name)
        assert (frame.arbitration_id.id, frame.arbitration_id.extended, frame.size) == (message.frame_id, message.is_extended_frame, message.length)
        for s in message.signals:
            other = frame.signal_by_name(s.name)
            assert (other.size, other.is_signed, float(other.factor), float(other.offset)) == (s.length, s.is_signed, float(s.scale), float(s.offset))
    for e in list(candump.read(recorded / "run.log"))[:200]:
        message, frame = database.get_message_by_frame_id(e.frame.id), next(f for f in matrix.frames if f.arbitration_id.id == e.frame.id)
        theirs = {name: float(v.phys_value) for name, v in frame.decode(e.frame.data).items()}
        assert theirs == pytest.approx({n: float(v) for n, v in message.decode(e.frame.data, decode_choices=False).items()})


def test_cantools_decodes_the_log(recorded: Path) -> None:
    with (recorded / "run.log").open() as file:
        done = subprocess.run([sys.executable, "-m", "cantools", "decode", "--single-line", str(recorded / "platoon.dbc")], stdin=file, capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert len(lines) == len(list(formats.read(recorded / "run.log")))
    assert all(re.search(r":: (measurement|control|verdict|status)\(", line) for line in lines)


def clean(path: Path) -> pd.DataFrame:
    """A CSV that PlotJuggler takes as it is: time first and rising, unique names, numbers or nothing in every cell."""
    with path.open(newline="") as file:
        header = next(csv.reader(file))
    assert header[0] == "time_s" and len(set(header)) == len(header)
    frame = pd.read_csv(path)
    assert list(frame.columns) == header
    assert all(np.issubdtype(t, np.number) for t in frame.dtypes), frame.dtypes
    assert (np.diff(frame["time_s"]) > 0).all() and not np.isinf(frame.to_numpy(dtype=float)).any()
    return frame


def test_signals_csv_is_clean(recorded: Path) -> None:
    frame = clean(recorded / "signals.csv")
    assert np.isfinite(frame.to_numpy(dtype=float)).all()
    result = json.loads((recorded / "told").read_text())
    assert len(frame) == result["samples"] and np.allclose(frame["time_s"], frame["k"] * result["sample_time_s"])
    assert frame["bits"].sum() == result["frames"]["bits"]
    plain = np.genfromtxt(recorded / "signals.csv", delimiter=",", names=True)
    assert len(plain) == len(frame) and np.allclose(plain["plant"], frame["plant"])


def test_labels_csv_is_read(recorded: Path) -> None:
    labels = pd.read_csv(recorded / "labels.csv")
    (fault,) = json.loads((recorded / "told").read_text())["faults"]
    assert list(labels.columns) == ["start", "end", "name", "kind", "size", "signal"]
    assert (labels["start"][0], labels["name"][0], labels["kind"][0]) == (fault["start"], fault["name"], fault["kind"]) and np.isnan(labels["end"][0])


def test_signals_by_dbc_are_clean_and_right(recorded: Path, cli: Cli, tmp_path: Path) -> None:
    made = {}
    for suffix in (".log", ".mf4"):
        done = cli("convert", recorded / f"run{suffix}", tmp_path / f"{suffix[1:]}.csv", "--dbc", recorded / "platoon.dbc")
        assert (done.status, done.err) == (0, "")
        made[suffix] = clean(tmp_path / f"{suffix[1:]}.csv").set_index("time_s")
    assert made[".log"].equals(made[".mf4"])
    for name, series in decoded(recorded).items():
        found = made[".log"][name].dropna()
        assert np.allclose(found.index, [t for t, _ in series]) and np.allclose(found, [v for _, v in series], rtol=1e-11)


def test_frames_that_no_dbc_knows_are_told(recorded: Path, cli: Cli, tmp_path: Path) -> None:
    many = list(formats.read(recorded / "run.log"))[:50]
    strange = [
        Entry(99.0, "vcan0", f)
        for f in (Frame(0x7FF, 0, b"x"), replace(many[0].frame, data=many[0].frame.data[:-1]), Frame(many[0].frame.id, REMOTE, b""), Frame(0x40, ERROR, bytes(8)))
    ]
    formats.write(tmp_path / "a.log", [*many, *strange])
    done = cli("convert", tmp_path / "a.log", tmp_path / "a.csv", "--dbc", recorded / "platoon.dbc")
    assert done.status == 0 and "4 of 54 frames are not decoded" in done.err


def test_mf4_needs_its_package_and_says_so(monkeypatch: pytest.MonkeyPatch, cli: Cli, tmp_path: Path) -> None:
    formats.write(tmp_path / "a.log", entries(random.Random(SEED), 3))
    monkeypatch.setitem(sys.modules, "asammdf", None)
    done = cli("convert", tmp_path / "a.log", tmp_path / "a.mf4")
    assert done.status == 2 and "hullguard[mf4]" in done.err


def test_numbers_are_unique() -> None:
    def numbers(*names: str) -> dict[str, int]:
        return formats.numbers([Entry(0.0, n, Frame(0, 0, b"")) for n in names])

    assert numbers("can3", "vcan0", "can0", "plant", "can3") == {"can3": 3, "vcan0": 0, "can0": 1, "plant": 2}
    assert numbers("x99999") == {"x99999": 0}
    assert convert.wanted("pcap, BLF", Path()) == [".pcap", ".blf"]
