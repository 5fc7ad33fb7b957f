"""The bench measures what it says: instructions counted by hand, call graphs with a known answer, stacks really used, budgets that were broken."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from counting import STEP, Call, Function, count, found, functions, of_library, rows, sections, tree
from filters import POLYNOMIAL, fusion, polynomial
from needs import needs
from size import Size, judged, versions, written
from stack import StackError, compiled, deepest, disassembled, registers, run_time, symbols
from step_size import code, flash, tables

from hullguard.design.cost import costs
from hullguard.design.design import design
from hullguard.model import load_model

BENCH = Path("build/bench")
KNOWN = BENCH / "cortex_m4f-f32/known.elf"
PAINTED = [tuple(words.strip().split("=", 2)) for words in os.environ["BENCH_PAINTED"].split(";") if words.strip()]
REP = ("hg_node_start",)  # holds an instruction that repeats itself, once more as a piece of its own
SIZE = Size("cortex_m0-f32", "platoon", "node", 1000, 2000, 300, 400, ("hg_node_step",))


def known() -> list[Call]:
    """Calls of the functions of known.c."""
    cross, emulator = os.environ["BENCH_KNOWN"].split("=", 1)
    said, calls = count(KNOWN, cross, emulator, BENCH / "count.so", lambda f: f.name.startswith("known_"))
    assert said == "known ends\n"
    return calls


def test_instructions_are_those_counted_by_hand() -> None:
    calls = known()
    last = [("known_begins_with_loop", 9, 9), ("known_jumps_before_next", 8, 3)]
    assert [(c.function.name, c.all, c.self) for c in calls] == 3 * [("known_outer", 39, 5), ("known_tail", 13, 2)] + last
    at = {f.name: f for f in functions(KNOWN, os.environ["BENCH_KNOWN"].split("=", 1)[0])}
    assert at["known_jumps_before_next"].end == at["known_next"].begin  # what makes the case
    assert [(c.function.name, c.all, c.self) for c in calls[-1].walk()][1:] == [("known_calls_next", 5, 3), ("known_next", 2, 2)]
    assert [(c.function.name, c.all) for c in calls[0].calls] == [("known_straight", 11), ("known_loop", 12), ("known_straight", 11)]
    assert [(c.function.name, c.all) for c in calls[1].calls] == [("known_straight", 11)]  # by a jump, and left with who jumped


def test_what_is_not_counted_counts_for_its_caller() -> None:
    cross, emulator = os.environ["BENCH_KNOWN"].split("=", 1)
    calls = count(KNOWN, cross, emulator, BENCH / "count.so", lambda f: f.name in ("known_outer", "known_tail"))[1]
    assert [(c.function.name, c.all, c.self) for c in calls] == 3 * [("known_outer", 39, 39), ("known_tail", 13, 13)]


def test_the_same_count_as_callgrind(tmp_path: Path) -> None:
    drive = BENCH / "x86_64-f32/platoon/drive.elf"
    calls = count(drive, "", "qemu-x86_64", BENCH / "count.so")[1]
    out = tmp_path / "callgrind.out"
    for name in (STEP, "hg_node_receive", "hg_sender_step"):
        subprocess.run(["valgrind", "--tool=callgrind", f"--toggle-collect={name}", f"--callgrind-out-file={out}", str(drive)], check=True, capture_output=True)
        totals = next(line for line in out.read_text(encoding="utf-8").splitlines() if line.startswith(("totals:", "summary:")))
        assert sum(c.all for c in found(calls, name)) == int(totals.split()[1]), name


def test_the_same_count_instruction_by_instruction() -> None:
    """Where the emulator translates every instruction alone, nothing hangs on how it cuts a program into pieces."""
    drive = BENCH / "x86_64-f32/platoon/drive.elf"
    whole, single = (count(drive, "", emulator, BENCH / "count.so")[1] for emulator in ("qemu-x86_64", "qemu-x86_64 -singlestep"))
    assert [(c.function.name, c.all, c.self) for o in whole for c in o.walk() if c.function.name not in REP] == [
        (c.function.name, c.all, c.self) for o in single for c in o.walk() if c.function.name not in REP
    ]


def test_the_tree_of_calls() -> None:
    section = sections(KNOWN.with_suffix(".map"))[0]
    listed = [Function(name, i, i + 1, section) for i, name in enumerate("abc")]
    made = tree(["2 2 5 5", "1 1 8 3", "2 1 4 4", "0 0 20 8", "2 0 1 1"], listed)
    assert [(c.function.name, c.all) for c in made] == [("a", 20), ("c", 1)]
    assert [(c.function.name, c.all) for c in made[0].walk()] == [("a", 20), ("b", 8), ("c", 5), ("c", 4)]
    assert made[0].has("c") and not made[1].has("a")


def test_filters_are_told_apart_by_their_starts() -> None:
    section = sections(KNOWN.with_suffix(".map"))[0]
    listed = [Function(f"hg_{name}", i, i + 1, section) for i, name in enumerate(("polynomial_start", "polynomial_step", "fusion_start", "fusion_open", "fusion_due", "consistency_step"))]
    made = tree(["0 0 90 90", "1 0 5 5", "1 0 7 7", *["0 0 90 90", "1 0 9 9"] * (len(POLYNOMIAL) - 1)], listed)
    assert list(polynomial(made).values()) == [[5, 7], *[[9]] * (len(POLYNOMIAL) - 1)]
    with pytest.raises(ValueError, match="zip"):
        polynomial(made[:3])
    (each,) = fusion(tree(["2 0 90 90", "3 0 5 5", "4 0 2 2", "5 0 70 70", "3 0 6 6"], listed)).values()
    assert each == [7, 6]


def test_functions_know_their_module() -> None:
    made = {f.name: f for f in functions(BENCH / "cortex_m4f-f32/platoon/painted.elf", "arm-none-eabi-")}
    assert made["hg_hull_step"].section.module == "hull" and of_library(made["hg_hull_step"])
    assert made["memcpy"].section.module == "memory" and not of_library(made["memcpy"])


CI = """graph: {{ title: "a.c"
node: {{ title: "a" label: "a\\na.c:1:1\\n8 bytes (static)" }}
node: {{ title: "a.c:b" label: "b\\na.c:2:1\\n16 bytes ({kind})" }}
node: {{ title: "c" label: "c\\na.c:3:1\\n100 bytes (static)" }}
node: {{ title: "d" label: "d\\na.c:4:1\\n24 bytes (static)" }}
node: {{ title: "run_time" label: "run_time\\n<built-in>" shape : ellipse }}
edge: {{ sourcename: "a" targetname: "a.c:b" label: "a.c:1:9" }}
edge: {{ sourcename: "a" targetname: "d" label: "a.c:1:10" }}
edge: {{ sourcename: "a.c:b" targetname: "{callee}" }}
}}
"""


@pytest.mark.parametrize(
    ("kind", "callee", "answer"),
    [
        ("static", "run_time", (8 + 16 + 12, ("a", "a.c:b", "run_time"))),
        ("static", "d", (8 + 16 + 24, ("a", "a.c:b", "d"))),
        ("static", "a", "a calls itself, by a > a.c:b"),
        ("dynamic", "d", "a.c:b has no fixed size"),
        ("static", "__indirect_call", "a.c:b calls by pointer"),
        ("static", "nobody", "nothing is known of nobody, called by a.c:b"),
    ],
)
def test_the_deepest_call(tmp_path: Path, kind: str, callee: str, answer: tuple[int, tuple[str, ...]] | str) -> None:
    file = tmp_path / "a.ci"
    file.write_text(CI.format(kind=kind, callee=callee), encoding="utf-8")
    graph = compiled([file])
    fallback = disassembled("00000010 <run_time>:\n  10:\tpush\t{r4, r5, lr}\n  12:\tpop\t{r4, r5, pc}\n", {0x10: "run_time"})
    if isinstance(answer, str):
        with pytest.raises(StackError, match=answer):
            deepest("a", graph, fallback)
    else:
        assert deepest("a", graph, fallback) == answer


def test_frames_of_disassembled_functions() -> None:
    listing = """
00000100 <OTHER_NAME>:
 100:\tpush\t{r4-r7, lr}
 102:\tsub\tsp, #24
 104:\tb.n\t102 <f+0x2>
 106:\tbl\t10a <f+0xa>
 10a:\tbl\t200 <g>
 10e:\tstr\tlr, [sp, #-4]!
 112:\tadd\tsp, #24

00000200 <g>:
 200:\taddi\tsp,sp,-16
 204:\tstwu\tr1,-32(r1)
 208:\tblx\tr3
 20a:\tbx\tlr
 20c:\t.word\t0x00000000
"""
    made = disassembled(listing, {0x100: "f", 0x200: "g"})
    assert (made["f"].bytes, made["f"].calls) == (20 + 24 + 4, {"g"})  # the jump and the far jump within are loops; f runs on into g
    assert (made["g"].bytes, made["g"].calls) == (48, {"__indirect_call"})
    assert registers("{r4, r6-r8, lr}") == 20
    assert registers("{d8-d9}") == 16


@pytest.mark.parametrize(("target", "cross", "emulator"), PAINTED, ids=[p[0] for p in PAINTED])
def test_the_bound_is_one(target: str, cross: str, emulator: str) -> None:
    """The stack that a drive takes is no more than the bound, and the bound no more than twice that."""
    elf = BENCH / f"{target}-f32/platoon/painted.elf"
    said = count(elf, cross, emulator, BENCH / "count.so")[0]
    used = int(said.splitlines()[-1].removeprefix("stack "), 16)
    objects = BENCH / f"{target}-f32"
    graph = compiled([elf.with_name("drive.ci"), elf.with_name("tables.ci"), *elf.parent.glob("firmware/src/*.ci"), *objects.glob("hal/*/*.ci"), *objects.glob("tests/target/*.ci")])
    painter = compiled([objects / "tests/bench/painted.ci"])["main"].bytes
    bound = deepest("main", graph, run_time(elf, cross, symbols(elf, cross)))[0]
    assert painter is not None
    assert bound / 2 <= used - painter <= bound, (used, painter, bound)


def test_the_flash_of_a_step() -> None:
    """What a step calls and reads, and nothing of a start or a frame."""
    elf = BENCH / "cortex_m4f-f32/platoon/detector.elf"
    functions_, tables_ = code(elf, "arm-none-eabi-"), tables(elf)
    assert {"hg_detector_step", "hg_hold_step", "hg_hull_step", "hg_residual_step", "hg_decision_step"} <= functions_.keys()
    assert not {"main", "hg_hold_receive", "hg_detector_start"} & functions_.keys()
    assert tables_["generator1_weight"] == 74 * 4 and not {"memory", "measurement_scale", "generator1_signal"} & tables_.keys()
    grown, _ = judged([replace(SIZE, step=flash(elf, "arm-none-eabi-"))], tomllib.loads(written([replace(SIZE, step=100)], {})))
    assert grown == [f"cortex_m0-f32 platoon-node: step grew from 100 to {flash(elf, 'arm-none-eabi-')} bytes, by {flash(elf, 'arm-none-eabi-') - 100}"]


def test_a_byte_too_many_is_red() -> None:
    budget = tomllib.loads(written([SIZE], {"arm-none-eabi": "12.2.1"}))
    assert budget.pop("compilers") == {"arm-none-eabi": "12.2.1"}
    assert judged([SIZE], budget) == ([], [])
    for column in ("code", "tables", "ram", "stack"):
        grown, shrunk = judged([Size(**{**vars(SIZE), column: SIZE.numbers[column] + 1})], budget)
        assert grown == [f"cortex_m0-f32 platoon-node: {column} grew from {SIZE.numbers[column]} to {SIZE.numbers[column] + 1} bytes, by 1"] and not shrunk
    assert judged([replace(SIZE, code=900)], budget) == ([], ["cortex_m0-f32 platoon-node: code fell from 1000 to 900 bytes: make size-budget"])
    assert judged([replace(SIZE, code=960, ram=250)], budget) == ([], [])
    assert judged([replace(SIZE, part="sensor")], budget)[0] == ["cortex_m0-f32 platoon-sensor: has no budget; see it, then make size-budget"]


def test_the_gate_as_a_command(tmp_path: Path) -> None:
    """Red with the line alone, green within; of other compilers nothing is said."""
    elf = BENCH / "cortex_m4f-f32/platoon/detector.elf"
    budget = tmp_path / "budget.toml"
    command = [sys.executable, "tests/bench/size.py", "--budget", str(budget), "--cross", "cortex_m4f=arm-none-eabi-", "--quiet", str(elf)]
    subprocess.run([*command, "--write"], check=True, capture_output=True)
    text = budget.read_text(encoding="utf-8")
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    stack = tomllib.loads(text)["cortex_m4f-f32"]["platoon-detector"]["stack"]
    budget.write_text(text.replace(f"stack = {stack}", f"stack = {stack - 8}"), encoding="utf-8")
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (1, f"cortex_m4f-f32 platoon-detector: stack grew from {stack - 8} to {stack} bytes, by 8\n")
    version = versions({"cortex_m4f": "arm-none-eabi-"})["arm-none-eabi"]
    budget.write_text(text.replace(version, "1.2.3"), encoding="utf-8")
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 0 and ran.stderr.startswith("sizes are not judged")


def test_needs_are_the_costs_of_the_design() -> None:
    for name in ("platoon", "platoon_bank"):
        made = design(load_model(name))[0]
        need, cost = needs(made.tables), costs(made)
        assert need["residual"].macs + need["hull"].macs == cost[0].multiplications
        assert need["bank"].macs == sum(c.multiplications for c in cost[1:-1]) if name == "platoon_bank" else len(cost) == 2


def test_tables_of_words_and_numbers() -> None:
    assert rows(("a", "n"), [("long", "1"), ("b", "22")], 1, False) == ["a      n", "long   1", "b     22"]
    assert rows(("a", "n"), [("b", "22")], 1, True) == ["| a | n |", "| --- | --: |", "| b | 22 |"]


def test_without_a_registry_nothing_is_compared(tmp_path: Path) -> None:
    ran = subprocess.run(
        [sys.executable, "tests/bench/peers_fetch.py", str(tmp_path), "firmware/models/platoon.dbc"],
        env={**os.environ, "PIP_INDEX_URL": "http://127.0.0.1:9/simple", "PIP_RETRIES": "0", "PIP_CONFIG_FILE": os.devnull},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 3
    assert ran.stdout.startswith("no other libraries are compared") and len(ran.stdout.splitlines()) == 1
