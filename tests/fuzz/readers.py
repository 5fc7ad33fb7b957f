"""Everything that the host tools read, given files that are wrong.

Valid ones with spans, numbers, keys and bytes changed by rules that know the format. Only an
InputError of one line may come of it, never another exception, a hang of more than LIMIT_S or more than LIMIT_BYTES of memory.

    readers.py --work DIR --cases 300 --seed 1            every reader; what fails is kept in DIR and printed
    readers.py --work DIR --reader model --seed 1 --only 77    one case again, with its traceback
    readers.py --work DIR --ledger --cases 100000         up to so many cases a reader in ledger.toml, which it adds to

A case depends on reader, seed and number alone. regress/readers.txt holds the inputs of findings, in hex. Most cases are made of the small files in
seeds/, which have one of everything: what a case costs is what the file it is made of costs to read, and the shipped ones cost ten times as much.
"""

from __future__ import annotations

import argparse
import copy
import gc
import io
import json
import random
import resource
import signal
import sys
import tempfile
import time
import tomllib
import traceback
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import scipy.io
import tomli_w
from apart import Hang, Lasting

from hullguard.bus import candump, formats
from hullguard.bus.candump import Entry
from hullguard.core.library import library
from hullguard.core.native import MOVING, Frame, Native
from hullguard.design.design import Design, design
from hullguard.design.store import read as read_stored
from hullguard.errors import InputError
from hullguard.inject.codec import read_codec
from hullguard.inject.directive import parse_directive, read_directives
from hullguard.inject.predicate import Predicate
from hullguard.model import load_model, parse_fault, parse_override
from hullguard.model.expression import compiled
from hullguard.model.fusion import KIND, kind_of, load_fusion
from hullguard.model.schema import SHIPPED
from hullguard.monitor.state import Monitor
from hullguard.new import sources
from hullguard.new.sources import read_file, read_inline
from hullguard.plant.recording import read_recording
from hullguard.report.run_data import read_run

ROOT = Path(__file__).parents[2]
REGRESSIONS = Path(__file__).parent / "regress" / "readers.txt"
SEEDS = Path(__file__).parent / "seeds"
MEMORY = Path("/dev/shm")  # files of cases are never on a disk where the system has such a folder
LIMIT_S = 10
LIMIT_BYTES = 6 << 30
QUICK_S = 2.0  # of a reader in the short form
CHUNK_S = 30.0  # after so much the ledger has what was done
LEDGER_SEED = 0
NUMBERS = (
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "3",
    "255",
    "256",
    "65536",
    "4294967296",
    "-2147483648",
    "1e308",
    "-1e308",
    "1e-320",
    "inf",
    "-inf",
    "nan",
    "0.1",
    "1e30",
    "1e31",
    "9" * 30,
    "9" * 400,
    "0x10",
    "1_0",
    "true",
    "false",
    '""',
    "[]",
    "{}",
    "[[]]",
    "''",
    "null",
    "1979-05-27",
    "07:32:00",
)
WORDS = (
    "",
    " ",
    "\n",
    "\t",
    "\0",
    "\u2028",
    "é",
    "\U0001f600",
    '"',
    "'",
    "[",
    "]",
    "[[",
    "]]",
    "{",
    "}",
    "(",
    ")",
    "=",
    ",",
    ";",
    ":",
    "@",
    "..",
    "#",
    "##",
    "%",
    "\\",
    "**",
    "-",
    "+",
    "__proto__",
    "name",
    "A" * 300,
    "&a",
    "*a",
    "!!python/object:os.system",
    "<<",
    "..5",
    "1..",
    "@@",
)
LEAVES: tuple[Any, ...] = (
    0,
    1,
    -1,
    2,
    3,
    7,
    255,
    10**6,
    10**18,
    -(10**18),
    10**400,
    0.0,
    -0.5,
    0.1,
    1.5,
    1e-9,
    1e29,
    1e31,
    1e308,
    float("inf"),
    float("nan"),
    True,
    False,
    "",
    "x",
    "reachable",
    "gap12_m",
    [],
    {},
    [[]],
    [1],
    [0.1, 0.2],
    [[1.0, 0.0], [0.0, 1.0]],
    [{}],
    {"value": 1.0, "pm": 2.0},
    {"each": "gap", "name": "{i}"},
    "A" * 300,
    "{i}",
    "{",
    "tick",
    "periodic",
    "P05",
)


class Draw(random.Random):
    """Random choices of one case."""

    def text(self, source: str, words: tuple[str, ...] = WORDS, most: int = 4) -> str:
        """A valid text with a few things changed: spans dropped, doubled, exchanged, numbers and words put in, one cut off."""
        made = source
        for _ in range(self.randint(1, most)):
            place = self.randrange(len(made) + 1)
            span = min(int(self.expovariate(0.2)) + 1, 200)
            how = self.randrange(8)
            if how == 0:
                made = made[:place] + made[place + span :]
            elif how == 1:
                made = made[:place] + made[place : place + span] * self.choice((2, 2, 3, 50)) + made[place + span :]
            elif how == 2:
                made = made[:place] + self.choice(words) + made[place:]
            elif how == 3:
                made = self._number(made)
            elif how == 4:
                made = made[:place] + chr(self.choice((self.randrange(128), self.randrange(0x2100)))) + made[place + 1 :]
            elif how == 5:
                other = self.randrange(len(made) + 1)
                made = made[:place] + made[other : other + span] + made[place + span :]
            elif how == 6:
                lines = made.splitlines(True)
                self._lines(lines)
                made = "".join(lines)
            elif self.random() < 0.2:
                made = made[:place]
        return made

    def _number(self, text: str) -> str:
        starts = [i for i, c in enumerate(text) if c.isdigit() and (i == 0 or not (text[i - 1].isalnum() or text[i - 1] in "._"))]
        if not starts:
            return text
        at = self.choice(starts)
        end = at
        while end < len(text) and (text[end].isalnum() or text[end] in "._"):
            end += 1
        return text[:at] + self.choice(NUMBERS) + text[end:]

    def _lines(self, lines: list[str]) -> None:
        if lines:
            a, b = self.randrange(len(lines)), self.randrange(len(lines))
            how = self.randrange(3)
            if how == 0:
                del lines[a]
            elif how == 1:
                lines.insert(a, lines[b])
            else:
                lines[a], lines[b] = lines[b], lines[a]

    def bytes_(self, source: bytes, most: int = 6) -> bytes:
        """The same for bytes: flips, numbers of 1 to 8 bytes, cuts, doubled spans."""
        made = bytearray(source)
        for _ in range(self.randint(1, most)):
            place = self.randrange(len(made) + 1)
            size = self.choice((1, 2, 4, 8))
            how = self.randrange(6)
            if how == 0 and place < len(made):
                made[place] ^= 1 << self.randrange(8)
            elif how == 1:
                made[place : place + size] = self.choice((0, 1, 2**31, 2**63, 2 ** (8 * size) - 1, self.getrandbits(64))).to_bytes(9, self.choice(("little", "big")))[:size]
            elif how == 2:
                made[place : place + self.randrange(40)] = b""
            elif how == 3:
                made[place:place] = made[place : place + self.randrange(60)]
            elif how == 4:
                made[place:place] = self.randbytes(self.randrange(9))
            elif self.random() < 0.3:
                del made[place:]
        return bytes(made)

    def tree(self, data: Any, most: int = 3) -> Any:
        """Tables and lists with leaves of other kinds, keys gone, doubled or misspelt, entries doubled."""
        made = json.loads(json.dumps(data, default=str))
        for _ in range(self.randint(1, most)):
            self._change(made)
        return made

    def _change(self, data: Any) -> None:
        place, key = data, None
        while isinstance(place, dict | list) and place:
            key = self.choice(list(place) if isinstance(place, dict) else range(len(place)))
            if not isinstance(place[key], dict | list) or not place[key] or self.random() < 0.15:
                break
            place = place[key]
        if key is None:
            return
        how = self.randrange(8)
        if how == 0:
            del place[key]
        elif how == 1 and isinstance(place, list):
            place.insert(0, json.loads(json.dumps(place[key])))
        elif how == 2 and isinstance(place, dict):
            place[self.choice((str(key)[:-1], str(key) + "s", "each", "when", "name", "x"))] = place[key]
        elif how == 3 and isinstance(place[key], int | float) and not isinstance(place[key], bool) and abs(place[key]) < 1e200:
            place[key] = place[key] * self.choice((-1, 0, 0.5, 2, 1000, 1e12)) + self.choice((0, 0, 1, -1))
        elif how == 4 and isinstance(place[key], str):
            place[key] = self.text(place[key], most=1)
        else:
            place[key] = copy.deepcopy(self.choice(LEAVES))  # what is put in may be changed in turn, and a case depends on its own number alone


@dataclass(frozen=True)
class Reader:
    """A format: how a wrong input is made, and what is read from it; `work` is a folder of the case's own."""

    make: Callable[[Draw], bytes]
    read: Callable[[bytes, Path], object]


# ---- models, designs, options ----


@cache
def shipped(design_files: bool, kind: str = "") -> tuple[tuple[str, str], ...]:
    """Names and texts of the shipped files."""
    found = [p for p in sorted(SHIPPED.glob("*.toml")) if p.name.endswith(".design.toml") == design_files]
    return tuple((p.name, p.read_text(encoding="utf-8")) for p in found if design_files or (kind_of(str(p)) == KIND) == (kind == KIND))


@cache
def small(name: str) -> str:
    """One of the files of seeds/."""
    return (SEEDS / name).read_text(encoding="utf-8")


def _lighter(draw: Draw, texts: list[str]) -> str:
    """One of the texts, the long ones seldom: what it costs to read grows with the length."""
    return draw.choices(texts, [1.0 / len(text) for text in texts])[0]


def _toml(draw: Draw, text: str) -> bytes:
    if draw.random() < 0.5:
        return draw.text(text).encode("utf-8", "replace")
    try:
        return tomli_w.dumps(draw.tree(tomllib.loads(text))).encode()
    except (TypeError, ValueError):  # a leaf that the writer refuses
        return draw.text(text).encode("utf-8", "replace")


def _file(data: bytes, work: Path, name: str) -> Path:
    path = work / name
    path.write_bytes(data)
    return path


def make_model(draw: Draw) -> bytes:
    """A detector's model."""
    return _toml(draw, small("small.toml") if draw.random() < 0.7 else draw.choices(*plants())[0])


@cache
def plants() -> tuple[list[str], list[float]]:
    """The shipped detectors' models and their shares: those with expressions, which are expanded in symbols, cost ten times as much as the others."""
    texts = [text for _, text in shipped(False)]
    return texts, [0.1 if "polynomial" in text or "quadratic" in text else 1.0 for text in texts]


def make_fusion(draw: Draw) -> bytes:
    """A fusion filter's model."""
    return _toml(draw, draw.choice([text for _, text in shipped(False, KIND)]))


def make_design(draw: Draw) -> bytes:
    """A design file; the banks' long tables are rarely interesting."""
    return _toml(draw, _lighter(draw, [text for _, text in shipped(True) if len(text) < 60_000]))


def make_override(draw: Draw) -> bytes:
    """A --set option of the small model or the platoon."""
    keys = (
        "groups.sensor.trigger.delta",
        "groups.sensor.frame",
        "signals.way_m.slew",
        "plant.A",
        "plant.feedback",
        "detector.isolation.sizes",
        "detector",
        "groups.measurement.trigger.silence",
        "plant.vehicles",
        "groups.0.name",
        "detector.observers.0.order",
        "signals.gap12_m.range",
        "bus.bitrate_bps",
        "verdict",
        "plant.drag_per_s",
        "x.y.z",
        "schema",
    )
    return f"{draw.choice((draw.choice(keys), draw.text(draw.choice(keys))))}={draw.choice((*NUMBERS, '[1, 2]', '{ value = 1.0, pm = 0.1 }', draw.text('[0.1, 0.2]')))}".encode(
        "utf-8", "replace"
    )


def read_override(data: bytes, _: Path) -> object:
    """As the command takes it."""
    key, value = parse_override(data.decode("utf-8", "replace"))
    return load_model("platoon" if zlib.crc32(data) % 8 == 0 else str(SEEDS / "small.toml"), {key: value})


EXPRESSIONS = ("-k * (x1 - l)**3 / m + sin(x2) * exp(-x1)", "x1 + 2.5e-3*x2", "sqrt(x1**2 + x2**2) / (1 + tanh(x1))", "((((x1))))", "-x1**-x2", "a*x1 - log(x2)")


def make_expression(draw: Draw) -> bytes:
    """An expression, sometimes a deep one."""
    text = draw.text(
        draw.choice(EXPRESSIONS),
        ("(", ")", "**", "*", "/", "-", "x1", "a", "9" * 400, "1e999", "1j", "lambda: 0", "x1 if x2 else a", "[x1]", "f(x1)", "sin(", "0", "\0", "'s'", "...", "True"),
    )
    if draw.random() < 0.05:
        n = draw.choice((60, 100, 1000, 5000, 100_000))
        text = draw.choice(("(" * n + "x1" + ")" * n, "-" * n + "x1", "+".join(["x1"] * n), "x1**" * n + "2", "sin(" * n + "x1" + ")" * n))
    return text.encode("utf-8", "replace")


def read_expression(data: bytes, _: Path) -> object:
    """Compiled, as a model's is."""
    return compiled(data.decode("utf-8", "replace"), ("x1", "x2"), {"a": 2.0, "k": 3.0, "l": 0.1, "m": 1.0}, "f")


def make_fault(draw: Draw) -> bytes:
    """A --fault option."""
    return draw.text(draw.choice(("gap12_m:bias:0.5@40", "controller2:drift:-1e-3@4..9", "speed1_mps:freeze@7", "x:noise:2@0..1"))).encode("utf-8", "replace")


# ---- recordings ----


@cache
def platoon() -> Any:
    """The model whose signals the recordings carry."""
    return load_model("platoon")


def make_recording(draw: Draw) -> bytes:
    """A CSV with the platoon's columns."""
    names = ["time_s", *(s.name for s in platoon().signals)]
    rows = [",".join([f"{0.1 * k:.1f}", *(f"{draw.uniform(-1, 1):.3f}" for _ in names[1:])]) for k in range(draw.randrange(1, 8))]
    return draw.text("\n".join([",".join(names), *rows]) + "\n").encode("utf-8", "surrogatepass" if draw.random() < 0.1 else "replace")


def make_entries(draw: Draw) -> list[Entry]:
    """Frames of every kind."""
    made = []
    for i in range(draw.randrange(1, 12)):
        flags = draw.choice((0, 0, candump.EXTENDED, candump.FD, candump.FD | candump.BRS, candump.REMOTE, candump.ERROR))
        size = 0 if flags & candump.REMOTE else 8 if flags & candump.ERROR else draw.choice((0, 1, 8, 8, 12, 64) if flags & candump.FD else (0, 1, 2, 8))
        made.append(
            Entry(
                1e9 + i * 0.1,
                draw.choice(("can0", "vcan1")),
                Frame(draw.choice((0x110, 0x120, 0x7FF)) if not flags & candump.EXTENDED else 0x18DAF110, flags, draw.randbytes(size)),
                draw.choice(("", "R", "T")),
            )
        )
    return made


WHOLE = 300  # recordings of each format, which are then spoilt over and over


def of_format(suffix: str) -> Reader:
    """A recording of frames by its suffix: written whole, then spoilt."""

    @cache
    def whole_one(number: int) -> bytes:
        path = Path(scratch()) / f"whole{suffix}"
        formats.write(path, make_entries(Draw(f"whole{suffix}:{number}")))
        return path.read_bytes()

    def make(draw: Draw) -> bytes:
        whole = whole_one(draw.randrange(WHOLE))
        if suffix in (".log", ".asc"):
            return draw.text(whole.decode("ascii")).encode("utf-8", "replace")
        return draw.bytes_(whole)

    def read(data: bytes, work: Path) -> object:
        return list(formats.read(_file(data, work, f"case{suffix}")))

    return Reader(make, read)


_SCRATCH: list[Path] = []


def scratch() -> Path:
    """Where whole recordings are written before they are spoilt."""
    return _SCRATCH[0]


# ---- networks ----

NETWORK = ROOT / "tests" / "fixtures" / "network"


@cache
def databases() -> tuple[str, ...]:
    """A small one with one of everything, a vehicle's own, and two that the design emits."""
    emitted = ROOT / "firmware" / "models"
    return tuple(p.read_text(encoding="cp1252") for p in (SEEDS / "small.dbc", NETWORK / "vehicle.dbc", emitted / "platoon.dbc", emitted / "fusion5.dbc"))


def make_dbc(draw: Draw) -> bytes:
    """A database."""
    text = draw.choices(databases(), (40, 4, 1, 1))[0]
    if draw.random() < 0.5:  # without some of its messages
        text = "\n\n".join(part for part in text.split("\n\n") if not part.startswith("BO_ ") or draw.random() < 0.5)
    return draw.text(text, ("SG_", "BO_", "m0", "M", "@1+", "@0-", "(0,0)", "[0|0]", "BA_", "64", "-1", '"', "SIG_VALTYPE_", *WORDS)).encode("cp1252", "replace")


def read_dbc(data: bytes, work: Path) -> object:
    """As inject takes it."""
    return read_codec(_file(data, work, "case.dbc"))


def make_network(draw: Draw) -> bytes:
    """The database of a model that takes its frames from it: the small one's or the vehicle's."""
    return draw.text(databases()[1 if draw.random() < 0.1 else 0]).encode("cp1252", "replace")


def read_network(data: bytes, work: Path) -> object:
    """As a model takes it."""
    _file(data, work, "vehicle.dbc")
    folder = NETWORK if b"Actuators" in data else SEEDS
    (work / "network.toml").write_text((folder / "network.toml").read_text(encoding="utf-8"), encoding="utf-8")
    return load_model(str(work / "network.toml"))


# ---- new: state-space files ----

MATRICES = {"A": [[0.9, 0.1], [0.0, 0.8]], "B": [[0.0], [1.0]], "C": [[1.0, 0.0]], "D": [[0.0]]}


def _mat(draw: Draw) -> bytes:
    out = io.BytesIO()
    held: dict[str, Any] = {k: np.array(v) for k, v in MATRICES.items()} | {"Ts": 0.1}
    scipy.io.savemat(out, held if draw.random() < 0.5 else {"system": held}, do_compression=draw.random() < 0.3)
    return draw.bytes_(out.getvalue())


def _npz(draw: Draw) -> bytes:
    out = io.BytesIO()
    held: dict[str, Any] = {k: np.array(v) for k, v in MATRICES.items()}
    if draw.random() < 0.5:
        held[draw.choice("ABCD")] = np.array(draw.choice(([[1j]], [["x"]], [], [[[1.0]]], [[np.nan]], 5, [[True]], [1.0, 2.0])))
    np.savez(out, **held, dt=draw.choice((0.1, 0, True, -1, np.nan, [0.1, 0.2], "x")))
    return out.getvalue() if draw.random() < 0.3 else draw.bytes_(out.getvalue())


def _json(draw: Draw) -> bytes:
    data = draw.tree(MATRICES | {"dt": draw.choice((0.1, None, True, 0, -1))})
    text = json.dumps(data)
    return (draw.text(text) if draw.random() < 0.5 else text).encode("utf-8", "replace")


def _csv(draw: Draw) -> bytes:
    return draw.text("# a system\nA,0.9,0.1\nA,0,0.8\nB,0\nB,1\nC,1,0\nD,0\ndt,0.1\n").encode("utf-8", "replace")


def of_state_space(suffix: str, make: Callable[[Draw], bytes]) -> Reader:
    """A state-space file by its suffix."""
    return Reader(make, lambda data, work: read_file(_file(data, work, f"case{suffix}")))


def make_inline(draw: Draw) -> bytes:
    """Matrices as they stand on a command line."""
    return draw.text(draw.choice(("0.9 0.1; 0 0.8", "[[0.9, 0.1], [0, 0.8]]", "1,2;3,4", "[1, 2]"))).encode("utf-8", "replace")


def read_inline_(data: bytes, _: Path) -> object:
    """--A as given, --C one that fits two states."""
    return read_inline({"A": data.decode("utf-8", "replace"), "B": None, "C": "1 0", "D": None})


# ---- inject ----

DIRECTIVES = (
    "drop@id=0x110,p=0.1", "delay:by=0.02@id=measurement,k=100..120",
    "offset:signal=gap12_m,by=0.5@from=1,to=2", 'drop@when="abs(gap12_m) > 1 and speed1_mps < 3"', "flip:bits=3@every=4,seed=7,name=a",
    "spoof:id=0x110,data=AABB@period=0.1", "corrupt@id=0x110x", "duplicate:times=3@nth=5",
)  # fmt: skip


def make_directive(draw: Draw) -> bytes:
    """A one-line SPEC."""
    return draw.text(draw.choice(DIRECTIVES)).encode("utf-8", "replace")


@cache
def examples() -> tuple[str, ...]:
    """The entries of the shipped examples."""
    texts = [p.read_text(encoding="utf-8").partition("directives:\n")[2] for p in sorted((ROOT / "host_tools" / "examples").glob("*.yaml"))]
    return tuple(f"  - {entry}" for text in texts for entry in text.removeprefix("  - ").split("\n  - "))


def make_directives(draw: Draw) -> bytes:
    """A YAML file: some of the shipped examples' entries, and now and then nested ones."""
    text = "directives:\n" + "".join(draw.sample(examples(), draw.randrange(1, 4)))
    if draw.random() < 0.003:
        n = draw.choice((30, 200, 5000))
        text = draw.choice(
            ("[" * n, "{a: " * n, "- " * n + "x", "&a [*a]", "a: &a [x, x]\n" + "\n".join(f"{chr(98 + i)}: &{chr(98 + i)} [*{chr(97 + i)}, *{chr(97 + i)}]" for i in range(20)))
        )
        return f"directives: {text}".encode()
    return draw.text(text).encode("utf-8", "replace")


def make_predicate(draw: Draw) -> bytes:
    """A condition."""
    return draw.text(
        draw.choice(("abs(gap12_m) > 1 and speed1_mps < 3", "not (a.b >= 2 or -c == 1/0)", "1 < x < 3 != 4")),
        ("(", ")", "not ", " and ", "x", "1/0", "9" * 400, "1e999", "a.b.c", "abs(", "**", "<", "-"),
    ).encode("utf-8", "replace")


def read_predicate(data: bytes, _: Path) -> object:
    """Checked, and asked."""
    return Predicate(data.decode("utf-8", "replace")).holds({"gap12_m": 2.0, "speed1_mps": 1.0, "a.b": 1.0, "c": 0.0, "x": 1e308, "a": 1.0})


# ---- frames of a bus, and results of a run ----


@cache
def designed() -> tuple[Design, Native]:
    """What the monitor watches with."""
    made = design(load_model("platoon"))[0]
    made = replace(made, tables=replace(made.tables, float_hash=made.tables.hash))  # every monitor asks for it, and it costs as much as all the frames of a case
    return made, Native(library("f32"), made.tables)


def make_frames(draw: Draw) -> bytes:
    """Frames of a bus: identifiers of the model and others, any bytes; 14 bytes each."""
    designed()  # not within the case's time
    out = bytearray()
    for _ in range(draw.randrange(1, 40)):
        number = draw.choice((0x110, 0x120, 0x130, 0x131, 0x7FF, 0, 0x1FFFFFFF, 0x20000000 & draw.getrandbits(30)))
        out += number.to_bytes(4, "little") + bytes([draw.choice((0, 0, 0, 1, 2, 4, 12, 16, draw.randrange(32))), draw.choice((8, 8, draw.randrange(65)))]) + draw.randbytes(8)
    return bytes(out)


def read_frames(data: bytes, _: Path) -> object:
    """The monitor takes them in turn, and says what it knows."""
    made, native = designed()
    seen = Monitor(made, native, MOVING, "test", made.model.sample_time_s)
    for i in range(0, len(data) - 13, 14):
        size = data[i + 5] % 65
        frame = Frame(int.from_bytes(data[i : i + 4], "little") & 0x1FFFFFFF, data[i + 4] & 31, (data[i + 6 : i + 14] * 8)[:size])
        at = i * 0.01 * (1 + data[i + 13] % 3)
        if seen.note(frame, at):
            seen.take(frame, at)
    return seen.snapshot()


@cache
def finished() -> dict[str, bytes]:
    """The files of a short run."""
    from hullguard.cli import main

    folder = scratch() / "run"
    if main(["run", "platoon", "--bus", "inprocess", "--samples", "30", "--no-fault", "--out", str(folder), "-q"]) != 0:
        raise RuntimeError("the run whose files are to be spoilt failed")
    return {p.name: p.read_bytes() for p in sorted(folder.iterdir()) if p.suffix in (".json", ".csv")}


def make_run(draw: Draw) -> bytes:
    """One of a run's files, its number first."""
    number = draw.randrange(len(finished()))
    name, data = list(finished().items())[number]
    text = data.decode()
    text = json.dumps(draw.tree(json.loads(text))) if name.endswith(".json") and draw.random() < 0.6 else draw.text(text)
    return bytes([number]) + text.encode("utf-8", "replace")


def read_run_(data: bytes, work: Path) -> object:
    """As report reads the folder."""
    folder = work / "run_read"
    if not folder.exists():
        folder.mkdir()
        for name, whole in finished().items():
            (folder / name).write_bytes(whole)
    name, whole = list(finished().items())[data[0]]
    (folder / name).write_bytes(data[1:])
    try:
        return read_run(folder)
    finally:
        (folder / name).write_bytes(whole)


READERS: dict[str, Reader] = {
    "model": Reader(make_model, lambda data, work: load_model(str(_file(data, work, "case.toml")))),
    "fusion_model": Reader(make_fusion, lambda data, work: load_fusion(str(_file(data, work, "case.toml")))),
    "design": Reader(make_design, lambda data, work: read_stored(_file(data, work, "case.design.toml"))),
    "override": Reader(make_override, read_override),
    "expression": Reader(make_expression, read_expression),
    "fault": Reader(make_fault, lambda data, _: parse_fault(data.decode("utf-8", "replace"))),
    "recording": Reader(make_recording, lambda data, work: read_recording(_file(data, work, "case.csv"), platoon())),
    **{suffix[1:]: of_format(suffix) for suffix in (".log", ".pcap", ".pcapng", ".blf", ".asc")},
    "dbc": Reader(make_dbc, read_dbc),
    "network": Reader(make_network, read_network),
    "mat": of_state_space(".mat", _mat),
    "npz": of_state_space(".npz", _npz),
    "json": of_state_space(".json", _json),
    "state_csv": of_state_space(".csv", _csv),
    "inline": Reader(make_inline, read_inline_),
    "directive": Reader(make_directive, lambda data, _: parse_directive(data.decode("utf-8", "replace"))),
    "directives": Reader(make_directives, lambda data, work: read_directives(_file(data, work, "case.yaml"))),
    "predicate": Reader(make_predicate, read_predicate),
    "frames": Reader(make_frames, read_frames),
    "run": Reader(make_run, read_run_),
}


# ---- running ----


@contextmanager
def limited() -> Iterator[None]:
    """A case's time: of the processor, so that a busy machine makes no findings."""

    def ring(_: int, __: FrameType | None) -> None:
        raise Hang

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, LIMIT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def wrong(reader: Reader, data: bytes, work: Path) -> str:
    """What came of an input that may not; nothing when all is well."""
    try:
        with limited():
            reader.read(data, work)
    except InputError as error:
        return "" if "\n" not in str(error) and str(error) else f"an error that is not one line: {error!r}"
    except Hang:
        return f"longer than {LIMIT_S} s"
    except Exception:  # whatever else comes is a finding
        return traceback.format_exc()
    return ""


def one(name: str, seed: int, number: int, work: Path) -> tuple[bytes, str]:
    """A case by its number, and what was wrong."""
    data = READERS[name].make(Draw(f"{name}:{seed}:{number}"))
    return data, wrong(READERS[name], data, work)


def regressions(work: Path) -> list[str]:
    """Inputs of earlier findings; what is wrong with them today."""
    found = []
    for line in REGRESSIONS.read_text().splitlines() if REGRESSIONS.exists() else []:
        if line and not line.startswith("#"):
            label, _, digits = line.partition(" ")
            told = wrong(READERS[label.partition(":")[0]], bytes.fromhex(digits), work)
            if told:
                found.append(f"regression {label}: {told}")
    return found


def several(name: str, seed: int, numbers: range, seconds: float, folders: tuple[Path, Path]) -> tuple[int, list[str]]:
    """Cases of one reader, worked on in the first folder; how many were made in the processor's time, and findings that differ by their last line, kept in the second."""
    work, kept = folders
    found: dict[str, str] = {}
    end = time.process_time() + seconds
    for made, number in enumerate(numbers):
        if time.process_time() >= end:
            return made, list(found.values())
        data, told = one(name, seed, number, work)
        if told:
            key = "".join(told.strip().splitlines()[-3:-1])
            if key not in found:
                (kept / f"{name}-{seed}-{number}").write_bytes(data)
                found[key] = f"{name}, --seed {seed} --only {number}: {told}"
    return len(numbers), list(found.values())


def main() -> int:
    """See the head of the file."""
    parser = argparse.ArgumentParser(description="Wrong files for every reader.")
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--cases", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--reader", action="append", choices=sorted(READERS))
    parser.add_argument("--only", type=int)
    parser.add_argument("--ledger", action="store_true")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_AS, (LIMIT_BYTES, LIMIT_BYTES))
    names = options.reader or list(READERS)
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as made:
        folders = (Path(made), options.work)
        _SCRATCH.append(folders[0])
        if options.only is not None:
            data, told = one(names[0], options.seed, options.only, folders[0])
            print(f"{data!r}\n{told or 'refused or read as it should be'}")
            return 1 if told else 0
        found = say(regressions(folders[0]))
        gc.freeze()  # what the libraries hold is not looked through again and again
        apart = Lasting(LIMIT_S)
        sources.ProcessPoolExecutor = apart  # type: ignore[assignment, attr-defined]
        found += long(names, options.cases, folders, apart) if options.ledger else short(names, options, folders)
        apart.end()
    return 1 if found else 0


def say(found: list[str]) -> list[str]:
    """What was wrong, at once."""
    for told in found:
        print(f"FAILED {told}", flush=True)
    return found


def short(names: list[str], options: argparse.Namespace, folders: tuple[Path, Path]) -> list[str]:
    """Cases of all readers; what was wrong."""
    found: list[str] = []
    total = 0
    for name in names:
        made, more = several(name, options.seed, range(options.cases), QUICK_S, folders)
        total += made
        found += say(more)
    if not found:
        print(f"  ok  readers: {total} wrong inputs of {len(names)} kinds, each read or refused in one line")
    return found


def long(names: list[str], cases: int, folders: tuple[Path, Path], apart: Lasting) -> list[str]:
    """The cases that the ledger does not have yet, all of one seed: its numbers go on where the ledger ends. A chunk of each reader in turn."""
    from fuzz import add_to_ledger, children_s, read_ledger

    found: list[str] = []
    left = list(names)
    while left:
        for name in list(left):
            entry = read_ledger().get((name, "readers"))
            done = entry.executions if entry is not None else 0
            began = time.process_time() + children_s()
            made, more = several(name, LEDGER_SEED, range(done, max(done, cases)), CHUNK_S, folders)
            apart.end()  # its time counts once it has ended
            if made:
                add_to_ledger(name, "readers", made, round(time.process_time() + children_s() - began), len(more))
                print(f"  {name}: {made} cases, {len(more)} findings", flush=True)
            found += say(more)
            if done + made >= cases:
                left.remove(name)
    return found


if __name__ == "__main__":
    sys.exit(main())
