"""What generated files say of themselves: every bit of a model's tables is in their digest, and a wrong table or instruction stops the node before it begins."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from host_support import Cli
from hullguard.codegen import emit_c
from hullguard.core import library as built
from hullguard.core import trust
from hullguard.core.library import Library, library
from hullguard.core.native import Native
from hullguard.design.design import design
from hullguard.errors import InputError
from hullguard.model.schema import load_model

ROOT = Path(__file__).resolve().parents[2]
ARENA = 48 << 20  # bytes: a wrong count may read far behind its table
UNUSED = {"hg_predict_config[1]", "hg_bank_config[1]", "hg_zonotope_config[1]", "hg_statistic_config[1]"}  # of a model without these parts
DIGEST, SELFTEST = -16, -17  # HG_E_DIGEST, HG_E_SELFTEST
PROGRAM = '#include "platoon.h"\nint main(void) { static hg_platoon_node n; return -(CALL); }\n'


class Arena:
    """C objects behind one another in one piece of memory, each with its type."""

    def __init__(self, made: Library) -> None:
        self.ffi, self.made, self.at = made.ffi, list[Any](), 0
        self.memory = made.ffi.new("uint8_t[]", ARENA)
        self._new = made.ffi.new_allocator(alloc=self._alloc, free=None)
        made.ffi.new = self.new

    def _alloc(self, size: int) -> Any:
        first, self.at = self.at, self.at + (size + 15) // 16 * 16
        return self.memory + first

    def new(self, kind: Any, value: Any = None) -> Any:
        self.made.append(self._new(kind, value))
        return self.made[-1]

    def place(self, thing: Any) -> int:
        return int(self.ffi.cast("uintptr_t", thing)) - int(self.ffi.cast("uintptr_t", self.memory))

    def inside(self, thing: Any) -> tuple[str, list[tuple[int, int]]]:
        """What an object is, and the numbers in it."""
        kind, count = self.ffi.typeof(thing).item, len(thing) if self.ffi.typeof(thing).kind == "array" else 1
        first = self.place(thing)
        return f"{kind.cname}[{count}]", [x for i in range(count) for x in self.numbers(kind, first + i * self.ffi.sizeof(kind))]

    def numbers(self, kind: Any, first: int) -> Iterator[tuple[int, int]]:
        """First byte and bits of every number in an object; pointers and padding are none."""
        if kind.kind == "array":
            for i in range(kind.length):
                yield from self.numbers(kind.item, first + i * self.ffi.sizeof(kind.item))
        elif kind.kind == "struct":
            for _, field in kind.fields:
                yield from self.numbers(field.type, first + field.offset)
        elif kind.kind in ("primitive", "enum"):
            yield first, 1 if kind.cname in ("_Bool", "bool") else 8 * self.ffi.sizeof(kind)


@pytest.mark.parametrize("real", ["f32", "q31"])
def test_every_bit_of_every_table_is_in_the_digest(real: str) -> None:
    made = Library(real, built._BUILT)
    arena = Arena(made)
    native = Native(made, design(load_model("platoon"))[0].tables)
    objects = [arena.inside(thing) for thing in arena.made]
    walk, lib, memory = made.ffi.new("hg_digest *"), made.lib, made.ffi.buffer(arena.memory, arena.at)

    def digest() -> int:
        lib.hg_digest_start(walk)
        status = lib.hg_digest_node(walk, native.node, head, trust.ALL)
        return int(walk.crc) if status == lib.HG_OK else -1

    head = trust.node_head(native)
    good, flipped, unused = digest(), 0, set()
    for kind, numbers in objects:
        seen = [bit for first, bits in numbers for bit in range(8 * first, 8 * first + bits)]
        missed = []
        for bit in seen:
            memory[bit // 8] = bytes([memory[bit // 8][0] ^ 1 << bit % 8])
            missed += [bit] if digest() == good else []
            memory[bit // 8] = bytes([memory[bit // 8][0] ^ 1 << bit % 8])
        if seen and len(missed) == len(seen):
            unused.add(kind)
        else:
            assert not missed, (kind, [b - seen[0] for b in missed][:20])
            flipped += len(seen)
    assert digest() == good and unused <= UNUSED
    assert flipped > 10_000
    print(f"{flipped} single bits of the platoon's tables, {real}, all detected")


def test_the_digest_is_the_same_however_the_walk_is_cut() -> None:
    native = Native(library(), design(load_model("platoon_bank"))[0].tables)
    walk, lib = native.library.ffi.new("hg_digest *"), native.library.lib
    lib.hg_digest_start(walk)
    calls = 1
    while lib.hg_digest_node(walk, native.node, trust.node_head(native), 100) == lib.HG_E_BUSY:
        calls += 1
    assert walk.crc == trust.node_digest(native) and calls == walk.done // 100 + 1


# ---- a node that is not as it was generated ----


def call(folder: Path, function: str, *sources: Path) -> int:
    """Status of a call in a program of the platoon's: sources of one's own come before the library's."""
    program = folder / "main.c"
    program.write_text(PROGRAM.replace("CALL", function))
    given = [str(s) for s in (program, *sources)] + ([] if any(s.name == "platoon.c" for s in sources) else [str(ROOT / "firmware/models/platoon.c")])
    command = ["gcc", "-std=c11", "-O1", "-ffp-contract=off", "-DHG_REAL_F32=1", f"-I{ROOT}/firmware/include", f"-I{ROOT}/firmware/models"]
    done = subprocess.run([*command, *given, str(ROOT / "build/lib/libhullguard_f32.a"), "-lm", "-o", str(folder / "main")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]
    status = subprocess.run([folder / "main"], check=False).returncode
    return -status if status < 128 else 256 - status


START, TEST = "hg_platoon_node_start(&n, HG_START_MOVING)", "hg_platoon_selftest(&n)"


def changed(folder: Path, source: str, old: str, new: str) -> Path:
    """A copy with a change."""
    text = (ROOT / "firmware" / source).read_text()
    assert text.count(old) == 1, f"{source}: '{old}' is there {text.count(old)} times"
    path = folder / Path(source).name
    path.write_text(text.replace(old, new))
    return path


def test_the_generated_node_starts_and_passes(tmp_path: Path) -> None:
    assert call(tmp_path, START) == 1 and call(tmp_path, TEST) == 1


def test_a_wrong_table_stops_the_node(tmp_path: Path) -> None:
    text = (ROOT / "firmware/models/platoon.c").read_text()
    old = text[text.index("static const hg_real generator1_state[] = {") :].split("HG_REAL_T(")[1].split(",")[0]
    new = old[:-2] + str((int(old[-1]) + 1) % 10) if old[-2] in "+-" else old[:-1] + str((int(old[-1]) + 1) % 10)
    wrong = changed(tmp_path, "models/platoon.c", old, new) if text.count(old) == 1 else changed(tmp_path, "models/platoon.c", ".down = 5U", ".down = 4U")
    assert call(tmp_path, START, wrong) == DIGEST and call(tmp_path, TEST, wrong) == DIGEST


@pytest.mark.parametrize(
    ("source", "old", "new"),
    [
        ("residual.c", "    self->z = self->next;\n", ""),
        ("decision.c", "(alarm->up >= config->up) ?", "(alarm->up > config->up) ?"),
    ],
)
def test_a_wrong_instruction_fails_the_self_test(tmp_path: Path, source: str, old: str, new: str) -> None:
    wrong = changed(tmp_path, f"src/{source}", old, new)
    assert call(tmp_path, TEST, wrong) == SELFTEST
    assert call(tmp_path, START, wrong) == 1  # tables alone do not show it


def test_the_stored_drive_is_the_libraries_own_outcome() -> None:
    made = design(load_model("platoon"))[0]
    found = trust.selftest(made)
    assert found is not None
    asked, digests = found
    header, source = emit_c(made)
    for real, native in trust.natives(made.tables).items():
        out = trust.drive(native, asked)
        assert out.quiet and out.found and out.digest == digests[real]
        assert f"SELFTEST 0x{out.digest:08X}UL" in source and f"HG_PLATOON_DIGEST 0x{trust.node_digest(native):08X}UL" in header
    wider = trust.drive(native, trust.Drive(asked.start, asked.samples, asked.samples, asked.signal, asked.spread, 0, asked.code))
    assert wider.quiet and not wider.found


# ---- the model file ----


def test_the_freeze_frame_leaves_all_other_numbers_alone() -> None:
    plain = design(load_model("platoon"))[0]
    frozen = design(load_model("platoon", {"freeze": {"samples": 8, "request": {"id": 0x140}}}))[0]
    assert frozen.tables.freeze is not None and frozen.tables.freeze.after == 2 and frozen.tables.freeze.response.id == 0x141
    assert frozen.model.sha256 == plain.model.sha256 and frozen.tables.hash != plain.tables.hash
    off = design(load_model("platoon", {"freeze": {"samples": 0}}))[0]
    assert off.tables.freeze is None and off.tables.hash == plain.tables.hash
    assert frozen.load_bound > plain.load_bound
    header, source = emit_c(frozen)
    assert "#if !HG_WITH_FREEZE" in header and ".freeze = &freeze" in source


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ({"samples": 256, "request": {"id": 0x140}}, "samples"),
        ({"samples": 8, "after": 8, "request": {"id": 0x140}}, "after"),
        ({"samples": 8}, "request"),
        ({"samples": 8, "request": {"id": 0x130}}, "which is that of 'verdict'"),
        ({"samples": 8, "request": {"id": 0x12F}, "response": {"id": 0x12F}}, "which is that of 'freeze.request'"),
        ({"samples": 8, "request": {"id": 0x7FF}}, "no identifier behind it"),
        ({"samples": 8, "request": {"id": 0x140, "fd": True}}, "classic CAN"),
        ({"samples": 8, "request": {"id": 0x140, "protection": "P05"}}, "profile 22"),
        ({"samples": 8, "request": {"id": 0x140}, "frames": 3}, "frames"),
    ],
)
def test_a_section_that_cannot_be_is_refused(section: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said) as refused:
        design(load_model("platoon", {"freeze": section}))
    assert "\n" not in str(refused.value)


def test_a_record_beyond_its_numbering_is_refused() -> None:
    large = {"plant.vehicles": 16, "freeze": {"samples": 255, "request": {"id": 0x140}}}
    model = load_model("platoon", large)
    try:
        made = design(model)[0]
    except InputError as refused:
        assert "at most" in str(refused)
    else:
        assert made.tables.freeze is not None
        assert 4 + 255 * (3 + 4 * (made.tables.width + made.tables.residuals)) <= 0xFFFF


# ---- a node of another model ----

OTHER = ["--set", "freeze.samples=4", "--set", "freeze.request={id=0x150}"]  # another hash, the same detector


def test_a_log_of_another_model_is_told_by_both_hashes(cli: Cli, tmp_path: Path) -> None:
    run = cli("run", "platoon", "--bus", "inprocess", "--samples", "40", "--no-fault", "--out", tmp_path, "-q")
    assert run.status == 0
    log, own = tmp_path / "run.log", design(load_model("platoon"))[0].tables.hash
    good = cli("detect", "platoon", "--log", log, "--rest", "--json")
    assert good.status == 0 and good.json["ecu_model"] == "match" and good.json["ecu_hash"] == f"{own:08x}"
    wrong = cli("detect", "platoon", "--log", log, "--rest", "--json", *OTHER)
    assert wrong.status == 1 and wrong.json["ecu_model"] == "other"
    for line in (wrong.err.splitlines()[-1], cli("monitor", "platoon", "--log", log, "--rest", "--plain", *OTHER).err.splitlines()[-1]):
        assert line.startswith("hullguard: the ECU runs another model") and f"{own:08x}" in line and wrong.json["model_hash"] in line
    assert cli("monitor", "platoon", "--log", log, "--rest", "--plain", "-q").status == 0
